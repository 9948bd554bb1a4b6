"""The problem sets as the tests see them: their cells, read and run without a kernel."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import nbformat
from nbgrader.preprocessors import ClearHiddenTests, ClearSolutions

from nrdob.course.exercises import PROBLEMS, Points, Problem, score

SOURCE = Path(__file__).resolve().parent.parent / "notebooks" / "exercises" / "source"
SETS = sorted(SOURCE.glob("*/*.ipynb"))
STUB = "# YOUR CODE HERE"
"""What a student finds in the place of an answer, as the settings of nbgrader say."""


@dataclass(frozen=True)
class Posed:
    """A problem as its notebook poses it."""

    id: str
    path: Path
    answer: str
    points: float
    seed: int
    cell: Any

    @property
    def problem(self) -> Problem:
        return PROBLEMS[self.id]

    def score(self, answer: Any, group: int, seed: int) -> Points:
        return score(self.id, answer, group, points=self.points, seed=seed)


def cells(path: Path) -> list[Any]:
    return list(nbformat.read(path, as_version=4).cells)


def nbgrader(cell: Any) -> dict[str, Any]:
    return dict(cell.metadata.get("nbgrader", {}))


def is_check(cell: Any) -> bool:
    """A cell that is graded automatically."""
    return cell.cell_type == "code" and bool(nbgrader(cell).get("grade"))


def calls(source: str) -> dict[str, ast.Call]:
    """The calls that stand alone on a line, by the name of the function."""
    return {
        ast.unparse(statement.value.func): statement.value
        for statement in ast.parse(source).body
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call)
    }


@cache
def posed(path: Path) -> tuple[Posed, ...]:
    """Read the problems from the cells that check them."""
    found = []
    for cell in filter(is_check, cells(path)):
        call = calls(cell.source)["score"]
        given = {keyword.arg: ast.literal_eval(keyword.value) for keyword in call.keywords}
        id = ast.literal_eval(call.args[0])
        answer = ast.unparse(call.args[1])
        found.append(Posed(id, path, answer, given["points"], given["seed"], cell))
    return tuple(found)


@cache
def run(path: Path, group: int, blank: bool = False) -> dict[str, Any]:
    """Run the cells of a set in this process, those that check left out.

    Where a set is blank, its cells stop where the answer should be.
    """
    notebook = nbformat.read(path, as_version=4)
    notebook, _ = ClearHiddenTests().preprocess(notebook, {})
    if blank:
        notebook, _ = ClearSolutions(code_stub={"python": STUB}).preprocess(notebook, {})
    space: dict[str, Any] = {"__name__": "__main__"}
    for cell in notebook.cells:
        if cell.cell_type != "code" or is_check(cell):
            continue
        source = re.sub(r"^GROUP = .*", f"GROUP = {group}", cell.source)
        exec(compile(source, f"<{path.stem}, {cell.id}>", "exec"), space)
        plt.close("all")
    return space
