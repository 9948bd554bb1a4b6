"""Make slides of the prediction questions: for a projector, and without a network.

One deck for each week, and one with all questions in the order of the course of two days.

`jupyter nbconvert --to slides` with a template of our own. Code cells are not shown; what they
made is. reveal.js and MathJax come out of installed packages and are laid beside the slides.
"""

import re
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import nbformat
from nbconvert.exporters import SlidesExporter

from pages import NOTEBOOKS, ROOT, TEACHING, installed, options, store
from predictions import split

FOLDER = NOTEBOOKS / "class"
TEMPLATE = ROOT / "book" / "templates" / "slides"
SYLLABUS = TEACHING / "syllabus.md"

TWO_DAYS = re.compile(r"^\| \d+:\d\d \| \d+:\d\d \|[^|]*\| ([\w, ]+) \|", re.MULTILINE)
"""A line of the plan for two days that has questions; their numbers."""

BESIDE = (
    ("sphinx-revealjs", "_static/revealjs/dist/reveal.js"),
    ("sphinx-revealjs", "_static/revealjs/dist/reveal.css"),
    ("sphinx-mathjax-offline", "static/mathjax/tex-svg-full.js"),
)
"""Packages, and the end of the path of what the slides need of them; all of it self-contained."""

EXPORTER = SlidesExporter(
    template_name=TEMPLATE.name,
    extra_template_basedirs=[str(TEMPLATE.parent)],
    exclude_input_prompt=True,
    exclude_output_prompt=True,
)


def read(path: Path) -> Any:
    """Read a notebook, and stop at one that has not been executed."""
    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]
    if any(cell.execution_count is None for cell in code):
        sys.exit(f"{path.name} has not been run: make execute")
    return notebook


def two_days(notebooks: Iterable[Any]) -> Any:
    """Give all questions in one notebook, in the order of the course of two days."""
    questions = [cells for notebook in notebooks for cells in split(notebook.cells)]
    by_number = {cells[0].source.split()[1]: cells for cells in questions}
    numbers = ", ".join(TWO_DAYS.findall(SYLLABUS.read_text("utf-8"))).split(", ")
    chosen = [by_number[number] for number in numbers if number in by_number]
    titles = [cells[0].source.partition("\n")[0].removeprefix("## ") for cells in chosen]
    first = "# Predict, then look: two days\n\n" + "\n".join(
        f"- [{title}](#{title.replace(' ', '-')})" for title in titles
    )
    opening = nbformat.v4.new_markdown_cell(first, metadata={"slideshow": {"slide_type": "slide"}})
    return nbformat.v4.new_notebook(cells=[opening, *(cell for cells in chosen for cell in cells)])


def slides(notebook: Any) -> str:
    """Convert an executed notebook to one page of slides."""
    title = notebook.cells[0].source.partition("\n")[0].lstrip("# ")
    page, _ = EXPORTER.from_notebook_node(notebook, {"deck_title": title})
    return str(page)


def main(arguments: list[str] | None = None) -> int:
    folder: Path = options(__doc__, arguments, output=ROOT / "build" / "slides").output
    notebooks = {path.stem: read(path) for path in sorted(FOLDER.glob("*.ipynb"))}
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.html"):
        old.unlink()
    for file in (TEMPLATE / "slides.css", *(installed(*place) for place in BESIDE)):
        shutil.copyfile(file, folder / file.name)
    for name, notebook in (notebooks | {"two_days": two_days(notebooks.values())}).items():
        target = folder / f"{name}.html"
        store(slides(notebook), target)
        print(target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
