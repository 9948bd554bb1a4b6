"""The template of "Your own plant", run on plants that the chapter does not show.

The judge knows nothing of the package: it multiplies polynomials and counts the roots of p_A and
p_B on the right by the turns of these functions along a contour around the right half plane.
"""

from __future__ import annotations

import ast
import contextlib
import io
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest

CHAPTER = Path(__file__).resolve().parents[2] / "notebooks" / "24_your_own_plant.ipynb"
DEAR = "answer(nrdob.report", "answer(alternatives", "answer(survivors"
"""Questions that take long; one plant is asked all of them."""


def code_cells() -> list[Any]:
    return [cell for cell in nbformat.read(CHAPTER, as_version=4).cells if cell.cell_type == "code"]


def run(every: bool = False, **exchanged: Any) -> tuple[dict[str, Any], str]:
    """Run the template with another plant; an exception of any cell is one here."""
    names: dict[str, Any] = {"table": None}
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        for cell in code_cells():
            dear = any(question in cell.source for question in DEAR)
            if not cell.metadata.get("template") or (dear and not every):
                continue
            exec(cell.source, names)
            if cell.id == "your-plant":
                assert set(exchanged) <= set(names)
                names.update(exchanged)
            plt.close("all")
    return names, said.getvalue()


def polynomials(block: Any) -> tuple[np.ndarray, np.ndarray]:
    if hasattr(block, "time_constant"):
        return np.ones(1), power([np.array([block.time_constant, 1.0])] * block.order)
    block = getattr(block, "tf", block)
    return np.trim_zeros(block.num[0][0], "f"), np.trim_zeros(block.den[0][0], "f")


def power(factors: list[np.ndarray]) -> np.ndarray:
    found = np.ones(1)
    for factor in factors:
        found = np.convolve(found, factor)
    return found


def on_the_right(*terms: tuple[np.ndarray, float]) -> int:
    """Count roots of Σ p exp(-θ s), the first p of the highest degree, without those at 0."""
    size = max(p.size for p, _ in terms)
    padded = [(np.pad(p, (size - p.size, 0)), theta) for p, theta in terms]
    scale = max(np.abs(p).max() for p, _ in padded)
    while all(abs(p[-1]) < 1e-12 * scale for p, _ in padded):
        padded = [(p[:-1], theta) for p, theta in padded]
    together = sum(p for p, _ in padded)
    every = [p for p, _ in padded] + [together]
    sizes = [abs(root) for p in every for root in np.roots(np.trim_zeros(p, "f"))]
    sizes += [1 / theta for _, theta in padded if theta]
    low, high = 1e-4 * min(x for x in sizes if x > 0), 1e4 * max(sizes)
    up = 1j * np.concatenate([[0.0], np.geomspace(low, high, 300_000)])
    arc = high * np.exp(1j * np.linspace(np.pi / 2, 0, 20_000))
    s = np.concatenate([up, arc])
    value = sum(np.polyval(p, s) * np.exp(-theta * s) for p, theta in padded)
    steps = np.angle(value[1:] / value[:-1])
    assert np.abs(steps).max() < 1.5, "too coarse to count"
    return round(-2 * steps.sum() / (2 * np.pi))


def judged(loop: Any) -> tuple[int, int]:
    """Roots of p_A and of p_B on the right."""
    (N, D), (Nm, Dm), (Nc, Dc), (Nf, Df) = map(
        polynomials, (loop.process, loop.model, loop.controller, loop.filter)
    )
    p_A = np.polyadd(np.convolve(Dm, Dc), np.convolve(Nm, Nc))
    inner = power([D, Nm, np.polysub(Df, Nf)]), 0.0
    outer = power([N, Dm, Nf]), float(getattr(loop.process, "delay", 0.0))
    return on_the_right((p_A, 0.0)), on_the_right(inner, outer)


PLANTS = {
    "integrating, with dead time": "2 exp(-0.4s)/(s(3s + 1))",
    "resonant": "(s + 3)/((s + 1)(s^2 + 0.04s + 4))",
    "inverse, with dead time": "-4(1 - 3s)exp(-2s)/((10s + 1)(4s + 1))",
    "long dead time": "1.7 exp(-30s)/(2s + 1)",
    "unstable, with dead time": "exp(-0.1s)/(2s - 1)",
    "unstable and resonant": "1/((s^2 - 0.2s + 9)(s + 4))",
    "negative static gain": "-0.02",
    "double integrator with a lag": "7/(s^2(0.05s + 1))",
    "biproper, inverse": "(3 - s)/(s + 8)",
}


@pytest.mark.thorough
@pytest.mark.parametrize("kind", PLANTS)
def test_a_plant_that_the_chapter_does_not_show_gets_a_loop_that_is_stable(kind: str) -> None:
    names, said = run(every=kind == "biproper, inverse", process=PLANTS[kind])
    assert names["loop"] is not None, said
    assert names["verdict"].stable is True
    assert judged(names["loop"]) == (0, 0)
    assert names["sampled"].stability().stable
    missing = said.count("No answer") - said.count("No answer: the chart is drawn for filters")
    assert not missing, said


@pytest.mark.thorough
def test_where_the_loop_that_was_asked_for_is_unstable_it_says_so() -> None:
    names, said = run(process="1/(s - 1)", model="-1/(s + 1)", controller="-2(s + 1)/s")
    assert names["loop"] is None or names["verdict"].stable is False
    names, said = run(process="exp(-s)/(s + 1)^2", model="1/(s + 1)^2", controller="-2/s")
    assert judged(names["loop"])[0] > 0
    assert names["verdict"].stable is False
    assert "no margins" in said


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("process", "why"),
    [
        ("(s - 2)/((s - 5)(s + 1))", "interlace"),  # one pole between the zero and infinity
        ("exp(-2s)/(s - 1)", "peaks at 6.39"),  # e^2 - 1
        ("s/(s + 1)^2", "zero at s = 0"),
        ("2 exp(-s", "bracket"),
        ("exp(s)/(s + 1)", "future"),
        ("no_such_file.csv", "no_such_file.csv"),
        ("s^2/(s + 1)", "proper"),
    ],
)
def test_where_nothing_works_the_reason_is_given(process: str, why: str) -> None:
    names, said = run(process=process)
    assert names["loop"] is None
    assert why in said, said


def test_only_the_template_depends_on_the_cell_that_is_edited() -> None:
    """So no other cell can raise, whatever plant the reader puts in."""
    helpers = {"answer", "read", "plan_for"}
    edited: set[str] = set()
    for cell in code_cells():
        tree = ast.parse(cell.source)
        stored = {
            node.id
            for node in ast.walk(tree)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        }
        read = {
            node.id
            for node in ast.walk(tree)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
        }
        if cell.metadata.get("template"):
            assert not any(isinstance(node, ast.Assert) for node in ast.walk(tree)), cell.source
            top = {
                name.id
                for node in tree.body
                if isinstance(node, ast.Assign)
                for target in node.targets
                for name in ast.walk(target)
                if isinstance(name, ast.Name)
            }
            edited |= top - {"EXPECTED"} - helpers
        else:
            stored |= {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
            taken = (read - stored) & edited
            assert not taken, f"{taken} in a cell that is not of the template: {cell.source}"
