"""Nothing is printed that another processor would print otherwise.

The last digits of a result are the kernel's: another BLAS, another vector unit, another digit.
``make test`` runs the notebooks in such an arithmetic, ``make thorough`` the doctests; here it is
asked that they show nothing which hangs on it.
"""

from __future__ import annotations

import doctest
from pathlib import Path

import nbformat
import pytest

from digits import hanging_on_rounding

ROOT = Path(__file__).resolve().parents[2]
MODULES = sorted((ROOT / "nrdob").rglob("*.py"))
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb")) + sorted(
    (ROOT / "notebooks" / "class").glob("*.ipynb")
)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("LowPassFilter(time_constant=0.04813978129516375, order=2)", ["0.04813978129516375"]),
        ("[(0.0, 0.76393202)], -0.5 + 0.80622577j, 1e5, 12345.678", []),
        ("residue 2.2e-17, error 8.5e-10, −3.1e-16j", ["2.2e-17", "−3.1e-16"]),
        ("zeros -0.0 and 0.000 and −0.000", ["-0.0", "−0.000"]),
        ("1000000007 loops, version 1.2.3", []),
    ],
)
def test_what_hangs_on_rounding_is_found(text, found):
    assert hanging_on_rounding(text) == found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_doctest_hangs_on_rounding(path):
    examples = doctest.DocTestParser().get_examples(path.read_text(encoding="utf-8"))
    found = [number for example in examples for number in hanging_on_rounding(example.want)]
    assert not found, f"{path.name}: print fewer digits of {found}"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_no_output_of_a_notebook_hangs_on_rounding(path):
    found = {
        f"{number}  in cell {cell.id!r}"
        for cell in nbformat.read(path, as_version=4).cells
        for output in cell.get("outputs", [])
        for number in hanging_on_rounding(shown(output))
    }
    assert not found, f"{path.name}: print fewer digits, in the cell itself:\n  " + "\n  ".join(
        sorted(found)
    )


def shown(output):
    """Give what an output says in words, the alt text of a figure included."""
    if output.output_type == "stream":
        return output.text
    alt = output.get("metadata", {}).get("image/png", {}).get("alt", "")
    return f"{output.get('data', {}).get('text/plain', '')}\n{alt}"
