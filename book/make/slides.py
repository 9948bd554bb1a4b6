"""Make slides of the prediction questions: for a projector, and without a network.

`jupyter nbconvert --to slides` with a template of our own. Code cells are not shown; what they
made is. reveal.js and MathJax come out of installed packages and are laid beside the slides.

    python book/make/slides.py                      into build/slides
    python book/make/slides.py --output FOLDER      into another folder
"""

from __future__ import annotations

import argparse
import shutil
import sys
from importlib.metadata import distribution
from pathlib import Path

import nbformat
from nbconvert.exporters import SlidesExporter
from traitlets.config import Config

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "notebooks" / "class"
TEMPLATE = ROOT / "book" / "templates" / "slides"

BESIDE = (
    ("sphinx-revealjs", "_static/revealjs/dist/reveal.js"),
    ("sphinx-revealjs", "_static/revealjs/dist/reveal.css"),
    ("sphinx-mathjax-offline", "static/mathjax/tex-svg-full.js"),
)
"""Packages, and the end of the path of what the slides need of them; all of it self-contained."""

CONFIG = Config(
    SlidesExporter={
        "template_name": TEMPLATE.name,
        "extra_template_basedirs": [str(TEMPLATE.parent)],
        "exclude_input_prompt": True,
        "exclude_output_prompt": True,
    },
    TagRemovePreprocessor={
        "enabled": True,
        "remove_cell_tags": {"remove-cell"},
        "remove_input_tags": {"remove-input"},
    },
)


class SlidesError(Exception):
    """A notebook of which no slides can be made."""


def slides(path: Path) -> str:
    """Convert an executed notebook to one page of slides."""
    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]
    if any(cell.execution_count is None for cell in code):
        raise SlidesError(f"{path.name} has not been run: make execute")
    title = notebook.cells[0].source.partition("\n")[0].lstrip("# ")
    page, _ = SlidesExporter(config=CONFIG).from_notebook_node(notebook, {"deck_title": title})
    return str(page)


def copy_beside(folder: Path) -> None:
    """Copy what the pages load into the folder in which they are."""
    for package, end in BESIDE:
        files = distribution(package).files or []
        found = next(file for file in files if str(file.as_posix()).endswith(end))
        shutil.copyfile(str(found.locate()), folder / found.name)
    shutil.copyfile(TEMPLATE / "slides.css", folder / "slides.css")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; the result is the exit code."""
    parser = argparse.ArgumentParser(description="Make slides of the notebooks for class.")
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "slides")
    folder = parser.parse_args(arguments).output
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.html"):
        old.unlink()
    copy_beside(folder)
    for path in sorted(FOLDER.glob("*.ipynb")):
        try:
            page = slides(path)
        except SlidesError as error:
            print(error, file=sys.stderr)
            return 1
        target = folder / f"{path.stem}.html"
        target.write_text(page, encoding="utf-8")
        print(target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
