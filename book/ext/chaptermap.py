"""The chapters at a glance: a map of all of them, and ways through them, with the time they take.

    ```{chapter-map}
    ```

lays out the chapters part by part, as cards: number, title, minutes, what each needs. And

    ```{reading-path} 00 03 17
    The paper in an evening.
    ```

writes a way: the sentence, the chapters in this order, and the sum of their times. All of it is
read out of the openings of the chapters themselves. The title of a chapter's page begins with its
number.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from openings import PARTS, Chapter, read_chapter


def read_opening(path: Path) -> Chapter:
    """Read the opening of a chapter, or say what it lacks."""
    found = read_chapter(path)
    if not (found.title and found.minutes) or found.needs is None:
        raise ValueError(f"{path.name} must open with a title, **You need** and **Time** n minutes")
    return found


def read_openings(folder: Path) -> dict[str, Chapter]:
    """Read the openings of all chapters in a folder, by number."""
    found = [read_opening(path) for path in sorted(folder.glob("*.ipynb"))]
    return {opening.number: opening for opening in found}


def told(minutes: int) -> str:
    """Write a time as one says it, to the quarter of an hour where it is long."""
    hours, rest = divmod(round(minutes / 15), 4)
    return f"{minutes} min" if minutes < 60 else f"{hours}{('', '¼', '½', '¾')[rest]} h"


class ChapterDirective(SphinxDirective):
    """Something that is read out of the openings of the chapters."""

    def openings(self) -> dict[str, Chapter]:
        """Read them, and have the page written again when one changes."""
        folder = Path(self.env.srcdir) / "chapters"
        for path in folder.glob("*.ipynb"):
            self.env.note_dependency(str(path))
        return read_openings(folder)

    def link(self, opening: Chapter, shown: str) -> nodes.Node:
        """Lead to a chapter."""
        return addnodes.pending_xref(
            "", nodes.inline("", shown), reftype="doc", refdomain="std", refexplicit=True,
            reftarget=f"/chapters/{opening.stem}", refdoc=self.env.docname,
        )  # fmt: skip


class ChapterMap(ChapterDirective):
    """All chapters, part by part."""

    def run(self) -> list[nodes.Node]:
        openings = self.openings()
        found = nodes.container(classes=["chapter-map"])
        for part, numbers in PARTS.items():
            cards = [self.card(o) for o in openings.values() if o.number in numbers]
            found += [nodes.rubric(part, part)]
            found += [nodes.bullet_list("", *cards, classes=["chapter-cards"])]
        return [found]

    def card(self, opening: Chapter) -> nodes.list_item:
        """Make the card of one chapter."""
        said = f"{opening.minutes} min"
        if opening.needs:
            said += f", after {', '.join(opening.needs)}"
        return nodes.list_item(
            "",
            nodes.paragraph("", "", nodes.inline("", opening.number, classes=["chapter-number"]),
                            nodes.Text(" "), self.link(opening, opening.title)),
            nodes.paragraph("", said, classes=["chapter-needs"]),
        )  # fmt: skip


class ReadingPath(ChapterDirective):
    """One way through the book."""

    required_arguments = 1
    final_argument_whitespace = True
    has_content = True

    def run(self) -> list[nodes.Node]:
        openings = self.openings()
        numbers = self.arguments[0].split()
        if unknown := sorted(set(numbers) - set(openings)):
            raise self.error(f"there is no chapter {', '.join(unknown)}")
        text, messages = self.parse_inline(" ".join(self.content))
        minutes = sum(openings[number].minutes for number in numbers)
        way = nodes.paragraph(classes=["reading-path"])
        way += [*text, nodes.Text(f" About {told(minutes)}: "), *self.steps(openings, numbers)]
        return [way, *messages]

    def steps(self, openings: dict[str, Chapter], numbers: list[str]) -> Iterator[nodes.Node]:
        """Give the chapters, with arrows between them."""
        for number in numbers:
            if number != numbers[0]:
                yield nodes.Text(" → ")
            yield self.link(openings[number], openings[number].title.split(":")[0])


NUMBERED = re.compile(r"chapters/0?(\d+|[A-Z])_\w+")


def number_title(_app: Sphinx, page: str, source: list[str]) -> None:
    """Put the number of a chapter before its title, which then has it wherever it stands."""
    if found := NUMBERED.fullmatch(page):
        notebook = json.loads(source[0])
        text = "".join(notebook["cells"][0]["source"])
        notebook["cells"][0]["source"] = re.sub(r"\A# ", rf"# {found[1]}. ", text)
        source[0] = json.dumps(notebook)


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", number_title)
    app.add_directive("chapter-map", ChapterMap)
    app.add_directive("reading-path", ReadingPath)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
