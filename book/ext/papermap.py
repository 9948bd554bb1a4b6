r"""The paper's own numbers: equations that carry them, and the table that leads from them.

A displayed equation of a chapter with ``\tag{3}`` is the paper's (3): the page gives it the number,
the anchor ``paper-eq-3`` and a line that leads to the ledger. The table

    ```{paper-map}
    ```

leads from the equations, lemmas, figures and examples of the paper to chapters and ledger.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.util.docutils import SphinxDirective

from chapters import CHAPTERS, folder_of
from mentions import claim_link
from nrdob_course.claims import LEDGER
from pages import cells_of, prose_of
from statements import theorems_of, title_of

TAG = re.compile(r"\s*\\tag\{(\d+)\}")
DISPLAYED = re.compile(r"\$\$(.+?)\$\$|\\begin\{(\w+\*?)\}.+?\\end\{\2\}", re.DOTALL)
FIGURE = re.compile(r"fig-(\d+)(-[a-zH]+)?")
EQUATIONS, FIGURES = range(1, 18), range(1, 20)
PARTS = defaultdict(str, bode=" (Bode)", nyquist=" (Nyquist)", ratio=" (G̃⁻¹G)", H=" (H)")
"""What the name of a figure says beside its number."""
EXAMPLES = {
    1: "03_is_a_perfect_model_perfect",
    2: "05_how_slow_must_the_filter_be",
    3: "06_why_must_the_model_be_wrong",
    4: "07_do_endless_encirclements_matter",
}


def claims_of(stem: str, figure: int = 0) -> list[str]:
    """Give the claims of the ledger about one thing in the paper: eq03, fig15a, lemma1, ex2.

    For a figure those, too, that the paper makes of another thing and shows there.
    """
    return [
        id
        for id, claim in LEDGER.items()
        if re.fullmatch(rf"{stem}[a-z]?", id.partition(".")[0].partition("_")[0])
        or (figure and re.search(rf"Fig\. {figure}(?!\d)", claim.place))
    ]


class PaperNumbers(SphinxTransform):
    """Give the paper's equations their numbers, anchors, and the way to the ledger."""

    default_priority = 480

    def apply(self, **_: object) -> None:
        if not self.env.docname.startswith(f"{CHAPTERS}/"):
            return
        led: set[str] = set()
        for formula in list(self.document.findall(nodes.math_block)):
            latex = formula.astext()
            numbers = TAG.findall(latex)
            if len(numbers) == 1:  # the page sets it, where any formula can
                formula.rawsource = TAG.sub("", latex)
                formula.children = []
                formula += nodes.Text(formula.rawsource)
                formula["number"] = numbers[0]
            if new := [number for number in numbers if number not in led]:
                led |= set(new)
                self.lead(formula, new)

    def lead(self, formula: nodes.math_block, numbers: list[str]) -> None:
        """Give a formula its anchors, and a line that leads to the ledger."""
        anchors = [f"paper-eq-{number}" for number in numbers]
        targets = [nodes.target("", "", ids=[each], names=[each]) for each in anchors]
        if not formula.get("ids"):
            formula["ids"] = [f"paper-formula-{numbers[0]}"]
        listed = ", ".join(f"({number})" for number in numbers)
        said = f"The paper's equation{'s' * (len(numbers) > 1)} {listed}"
        line = nodes.paragraph("", "", nodes.Text(said), classes=["paper-number"])
        for k, id in enumerate(id for number in numbers for id in claims_of(f"eq{int(number):02}")):
            line += [nodes.Text("; " if k else ": "), claim_link(id, self.env.docname, formula)]
        place = formula.parent.index(formula)
        formula.parent[place : place + 1] = [*targets, formula, line]


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
    """Write the table."""
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
            f"[{short(page)}, Figure {n}{PARTS[name.rpartition('-')[2]]}](#{name})"
            for page, names in figures.items()
            for name, number in names.items()
            if number == n
        ]
        row(f"Figure {n}", at, claims_of(f"fig{n:02}", n))
    return "\n".join(rows)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("paper-map", PaperMap)
    app.add_transform(PaperNumbers)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
