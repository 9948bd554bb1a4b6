"""What every chapter must be before it goes onto a page: told, drawn, described and run.

Nothing here needs Sphinx: the tests and the build ask the same function.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pages import cells_of

Cell = Mapping[str, Any]


def faults_of_book(folder: Path) -> list[str]:
    """Name what the chapters in a folder lack, each with its place."""
    paths = sorted(folder.glob("*.ipynb"))
    return [fault for path in paths for fault in faults(path.stem, cells_of(path))]


def faults(page: str, cells: Sequence[Cell]) -> Iterator[str]:
    """Name what one chapter lacks."""
    first = cells[0] if cells else {"cell_type": "raw", "source": ""}
    if first["cell_type"] != "markdown" or not re.match(r"(<!--.*?-->\s*)*# \S", first["source"]):
        yield f"{page}: does not open with its title, '# …'"
    code = [cell for cell in cells if cell["cell_type"] == "code" and cell["source"].strip()]
    if not any(pictures(cell) for cell in code):
        yield f"{page}: has no figure"
    for expected, cell in enumerate(code, 1):
        if cell["execution_count"] != expected:
            yield f"{page}: {named(cell)} was not run in its turn (make execute)"
            break
    for cell in code:
        yield from (f"{page}: {named(cell)} {fault}" for fault in faults_of_figure(cell))


def faults_of_figure(cell: Cell) -> Iterator[str]:
    """Say what the figure of a cell lacks."""
    book = cell["metadata"].get("mystnb", {})
    figure = book.get("figure", {})
    shown = pictures(cell)
    if figure and not shown:
        yield "has the caption of a figure, and shows none"
    if len(shown) > 1:
        yield f"shows {len(shown)} figures; each needs a cell of its own"
    for output in shown:
        alt = output.get("metadata", {}).get("image/png", {}).get("alt", "")
        if not alt.strip():
            yield "shows a figure without alt text; show one of the package's plots"
        elif book.get("image", {}).get("alt") != alt:
            yield "has a figure whose alt text is not carried to the page (make execute)"
        for key in ("caption", "name"):
            if not str(figure.get(key, "")).strip():
                yield f"shows a figure without a {key}: metadata mystnb.figure.{key}"


def pictures(cell: Cell) -> list[Any]:
    """Give the outputs of a cell that are pictures."""
    return [output for output in cell["outputs"] if "image/png" in output.get("data", {})]


def named(cell: Cell) -> str:
    """Name a cell by its first line."""
    return f"cell {cell.get('id', '')!r} ({cell['source'].strip().splitlines()[0]})"
