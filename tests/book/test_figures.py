"""The figures that are stored in the notebooks, and the cells that draw them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest

from lettering import LEAST, shown, too_small
from nrdob.plotting.figure import PIXELS, SMALLEST, WIDTH
from pages import NOTEBOOKS

PATHS = sorted(NOTEBOOKS.rglob("*.ipynb"))
each_notebook = pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)


def cells_of(path: Path) -> list[Any]:
    cells = nbformat.read(path, as_version=4).cells
    return [cell for cell in cells if cell.cell_type == "code"]


@each_notebook
def test_no_figure_is_so_wide_that_a_phone_would_make_its_type_too_small(path: Path) -> None:
    about = [
        output["metadata"]["image/png"]
        for cell in cells_of(path)
        for output in cell.outputs
        if "image/png" in output.get("data", {})
    ]
    assert all(shown(SMALLEST, each["width"] / PIXELS) >= LEAST for each in about)
    assert max((each["width"] for each in about), default=0) <= PIXELS * WIDTH


@each_notebook
def test_no_cell_writes_smaller_than_the_smallest_type(path: Path) -> None:
    assert {
        k: found for k, cell in enumerate(cells_of(path)) if (found := too_small(cell.source))
    } == {}
