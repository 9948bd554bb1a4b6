"""The chapters at a glance: a map of all of them, and ways through them, with the time they take.

    ```{chapter-map}
    ```

lays out the chapters part by part, as cards: number, title, minutes, what each needs. And

    ```{reading-path} 00 03 17
    The paper in an evening.
    ```

writes a way: the sentence, the chapters in this order, and the sum of their times. All of it is
read out of the openings of the chapters themselves.
"""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from chapters import CHAPTERS, folder_of
from openings import PARTS, Chapter, read_chapters
from pages import quarters


def told(minutes: int) -> str:
    """Write a time as one says it, to the quarter of an hour where it is long."""
    return f"{minutes} min" if minutes < 60 else f"{quarters(round(minutes / 15) / 4)} h"


def link(opening: Chapter, shown: str, page: str) -> nodes.Node:
    """Lead to a chapter."""
    return addnodes.pending_xref(
        "", nodes.inline("", shown), reftype="doc", refdomain="std", refexplicit=True,
        reftarget=f"/{CHAPTERS}/{opening.stem}", refdoc=page,
    )  # fmt: skip


class ChapterMap(SphinxDirective):
    """All chapters, part by part."""

    def run(self) -> list[nodes.Node]:
        chapters = read_chapters(folder_of(self.env, noted=True))
        found = nodes.container(classes=["chapter-map"])
        for part, numbers in PARTS.items():
            cards = [self.card(each) for each in chapters if each.number in numbers]
            found += [nodes.rubric(part, part)]
            found += [nodes.bullet_list("", *cards, classes=["chapter-cards"])]
        return [found]

    def card(self, opening: Chapter) -> nodes.list_item:
        """Make the card of one chapter."""
        after = f", after {', '.join(opening.needs)}" if opening.needs else ""
        number = nodes.inline("", opening.number, classes=["chapter-number"])
        named = number, nodes.Text(" "), link(opening, opening.title, self.env.docname)
        needs = nodes.paragraph("", f"{opening.minutes} min{after}", classes=["chapter-needs"])
        return nodes.list_item("", nodes.paragraph("", "", *named), needs)


class ReadingPath(SphinxDirective):
    """One way through the book."""

    required_arguments = 1
    final_argument_whitespace = True
    has_content = True

    def run(self) -> list[nodes.Node]:
        chapters = {each.number: each for each in read_chapters(folder_of(self.env, noted=True))}
        numbers = self.arguments[0].split()
        if unknown := sorted(set(numbers) - set(chapters)):
            raise self.error(f"there is no chapter {', '.join(unknown)}")
        chosen = [chapters[number] for number in numbers]
        text, messages = self.parse_inline(" ".join(self.content))
        time = f" About {told(sum(opening.minutes for opening in chosen))}: "
        way = nodes.paragraph("", "", *text, nodes.Text(time), classes=["reading-path"])
        for opening in chosen:
            arrow = [nodes.Text(" → ")] if opening is not chosen[0] else []
            way += [*arrow, link(opening, opening.title.split(":")[0], self.env.docname)]
        return [way, *messages]


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("chapter-map", ChapterMap)
    app.add_directive("reading-path", ReadingPath)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
