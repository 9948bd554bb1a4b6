"""What leads through the book: the map of its chapters, ways with their time, the paper's numbers.

    ```{chapter-map}
    ```

lays out the chapters part by part, as cards: number, title, minutes, what each needs.

    ```{reading-path} 00 03 17
    The paper in an evening.
    ```

writes a way: the sentence, the chapters in this order, and the sum of their times. Both are read
out of the openings of the chapters themselves. And

    ```{paper-map}
    ```

leads from the equations, lemmas, figures and examples of the paper to chapters and ledger.
"""

import re
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from chapters import CHAPTERS, folder_of
from mentions import TAG, claims_of
from nrdob_course.claims import LEDGER
from openings import PARTS, Chapter, read_chapters
from pages import cells_of, prose_of, quarters
from statements import theorems_of, title_of

DISPLAYED = re.compile(r"\$\$(.+?)\$\$|\\begin\{(\w+\*?)\}.+?\\end\{\2\}", re.DOTALL)
FIGURE = re.compile(r"fig-(\d+)(-[a-zH]+)?")
EQUATIONS, FIGURES = range(1, 18), range(1, 20)
FIGURE_PARTS = defaultdict(str, bode=" (Bode)", nyquist=" (Nyquist)", ratio=" (G̃⁻¹G)", H=" (H)")
"""What the name of a figure says beside its number."""
EXAMPLES = {
    1: "03_is_a_perfect_model_perfect",
    2: "05_how_slow_must_the_filter_be",
    3: "06_why_must_the_model_be_wrong",
    4: "07_do_endless_encirclements_matter",
}


def told(minutes: int) -> str:
    """Write a time as one says it, to the quarter of an hour where it is long."""
    return f"{minutes} min" if minutes < 60 else f"{quarters(round(minutes / 15) / 4)} h"


def link(opening: Chapter, shown: str, page: str) -> nodes.Node:
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


class PaperMap(SphinxDirective):
    """The table from the paper's numbers to the book."""

    def run(self) -> list[nodes.Node]:
        return self.parse_text_to_nodes(table(folder_of(self.env, noted=True)))


def equations_in(cells: Iterable[str]) -> list[int]:
    """Give the paper's numbers of the displayed equations of a chapter."""
    found = (TAG.findall(match.group()) for cell in cells for match in DISPLAYED.finditer(cell))
    return sorted({int(number) for numbers in found for number in numbers})


def figures_in(notebook: Path) -> dict[str, int]:
    """Give the names of the figures of a chapter that are the paper's, with their numbers."""
    cells = cells_of(notebook)
    names = (cell["metadata"].get("mystnb", {}).get("figure", {}).get("name") for cell in cells)
    matches = (FIGURE.fullmatch(name or "") for name in names)
    return {match.group(): int(match[1]) for match in matches if match}


def table(folder: Path) -> str:
    pages = {path.stem: path for path in sorted(folder.glob("*.ipynb"))}
    equations = {page: equations_in(prose_of(path)) for page, path in pages.items()}
    figures = {page: figures_in(path) for page, path in pages.items()}
    theorems = [theorem for of in theorems_of(folder).values() for theorem in of]

    def chapter(page: str) -> str:
        return f"[{short(page)} {title_of(pages[page])}](/{CHAPTERS}/{page}.ipynb)"

    def short(page: str) -> str:
        return page.partition("_")[0].lstrip("0")

    rows = ["| In the paper | In the book | In the ledger |", "|---|---|---|"]

    def row(name: str, places: list[str], claims: list[str]) -> None:
        ledger = " ".join(f"`claim:{id}`" for id in claims)
        rows.append(f"| {name} | {'; '.join(places) or '–'} | {ledger or '–'} |")

    for n in EQUATIONS:
        claims = claims_of(f"eq{n:02}")
        shown = dict.fromkeys(LEDGER[id].chapter for id in claims)
        at = [page for page, of in equations.items() if n in of] or [p for p in shown if p in pages]
        row(f"eq. ({n})", [chapter(page) for page in at], claims)
    for name, stem in (("Lemma 1", "lemma1"), ("Lemma 2", "lemma2"), ("Corollary 1", "cor1")):
        at = [f"Theorem {t.number} ({t.name})" for t in theorems if name in t.name]
        at += [chapter(page) for page, path in pages.items() if name in title_of(path)]
        row(name, at, claims_of(stem))
    for n, page in EXAMPLES.items():
        row(f"Example {n}", [chapter(page)] if page in pages else [], [])
    for n in FIGURES:
        at = [
            f"[{short(page)}, Figure {n}{FIGURE_PARTS[name.rpartition('-')[2]]}](#{name})"
            for page, names in figures.items()
            for name, number in names.items()
            if number == n
        ]
        row(f"Figure {n}", at, claims_of(f"fig{n:02}", n))
    return "\n".join(rows)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("chapter-map", ChapterMap)
    app.add_directive("reading-path", ReadingPath)
    app.add_directive("paper-map", PaperMap)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
