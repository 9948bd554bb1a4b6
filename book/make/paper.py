"""Write the problem sets, their solutions and the boards as pages to be printed.

Each page is one HTML file that needs no network and no script: formulas are set as MathML when the
page is made. Print it from a browser, on paper or into a PDF.
"""

import re
import sys
from collections.abc import Iterator
from html import escape
from io import StringIO
from pathlib import Path

import matplotlib
import nbformat
from markdown_it import MarkdownIt
from markupsafe import Markup
from mdit_py_plugins.dollarmath import dollarmath_plugin
from nbgrader.preprocessors import ClearHiddenTests, ClearSolutions

from mathml import mathml
from nrdob.plotting import diagrams
from pages import ROOT, TEACHING, options, render, store
from teaching import SOLUTION, SOURCE, Pack, ProblemSet, read_pack

NOT_PRINTED = ("group", "imports", "check")
"""Cells that mean something in a notebook only, by the first word of their names."""

LINES = 11
"""To write on, for an answer in words."""

DRAWN = {"## Week 1\n": diagrams.nrdob, "## Week 2\n": diagrams.two_degrees_of_freedom}
"""The weeks whose board has a block diagram."""

MARKER = re.compile(r"^ *### (?:BEGIN|END) SOLUTION\n?", re.MULTILINE)


MARKDOWN = (
    MarkdownIt("commonmark")
    .enable("table")
    .use(dollarmath_plugin, renderer=lambda latex, how: mathml(latex, how["display_mode"]))
)


def html(markdown: str) -> Markup:
    """Give Markdown as HTML, without comments, and links as plain text."""
    text = re.sub(r"<!--.*?-->", "", markdown, flags=re.DOTALL)
    text = re.sub(r"^(\$\$.+\$\$)$", r"\n\1\n", text, flags=re.MULTILINE)  # as Jupyter reads it
    return Markup(re.sub(r"</?a\b[^>]*>", "", MARKDOWN.render(text)))


def code(source: str) -> Markup:
    return Markup(f"<pre>{escape(source.strip())}</pre>")


def problems(path: Path) -> Iterator[list[Markup]]:
    """Give the parts of each problem as students get it; first of all the opening."""
    notebook = nbformat.read(path, as_version=4)
    for clear in (ClearSolutions(), ClearHiddenTests()):
        notebook, _ = clear.preprocess(notebook, {})
    parts: list[Markup] = []
    for cell in notebook.cells:
        kind = cell.id.partition("-")[0]
        if kind == "task" and parts:
            yield parts
            parts = []
        if kind == "written":
            parts.append(Markup('<div class="line"></div>\n') * LINES)
        elif cell.cell_type == "markdown":
            parts.append(html(cell.source))
        elif kind not in NOT_PRINTED:
            parts.append(code(cell.source))
    yield parts


def solutions(path: Path, pack: Pack, of: ProblemSet) -> Iterator[list[Markup]]:
    """Give the parts of the solution of each problem, with the rubric where there is one."""
    written = {task.id: task for task in of.tasks if task.written}
    parts: list[Markup] = []
    for cell in nbformat.read(path, as_version=4).cells:
        kind, _, number = cell.id.partition("-")
        if kind == "task":
            if parts:
                yield parts
            parts = [html(cell.source.partition("\n")[0])]
        if SOLUTION.search(cell.source):
            answer = MARKER.sub("", cell.source)
            parts.append(code(answer) if cell.cell_type == "code" else html(answer))
        if kind == "written" and (task := written.get(number.replace("-", "."))):
            rubric = pack.advice_on(task.id).rubric
            rows = "".join(f"| {points:g} | {text} |\n" for points, text in rubric)
            parts.append(html(f"| Points | For |\n|--:|---|\n{rows}"))
    yield parts


def boards() -> Iterator[list[Markup]]:
    """Give the session of each week: its minutes, its board, and the diagram drawn on it."""
    text = (TEACHING / "in_class.md").read_text("utf-8")
    for session in re.split(r"^(?=## Week \d)", text, flags=re.MULTILINE)[1:]:
        yield [html(session), *(sketch(draw()) for week, draw in DRAWN.items() if week in session)]


def sketch(diagram: diagrams.Diagram) -> Markup:
    """Give a block diagram as a picture within the page."""
    drawn, buffer = diagram.plot(), StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "nrdob"}):  # else its names change each time
        drawn.figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    _, _, picture = buffer.getvalue().partition("<svg")
    return Markup(f'<figure role="img" aria-label="{escape(drawn.alt)}"><svg{picture}</figure>')


def write(folder: Path) -> list[Path]:
    pack = read_pack()
    pages = {"boards": ("In class: minutes and boards", boards(), "boards")}
    for each in pack.sets:
        path = SOURCE / each.name / f"{each.name}.ipynb"
        answers = solutions(path, pack, each)
        pages[each.name] = (each.title, problems(path), "set")
        pages[f"{each.name}_solutions"] = (f"{each.title}. Solutions", answers, "solutions")
    for name, (title, sections, look) in pages.items():
        text = render("paper.html", title=title, sections=list(sections), look=look)
        store(text, folder / f"{name}.html")
    return [folder / f"{name}.html" for name in pages]


def main(arguments: list[str] | None = None) -> int:
    given = options(__doc__, arguments, output=ROOT / "build" / "paper")
    print(*write(given.output), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
