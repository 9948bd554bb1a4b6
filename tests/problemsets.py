"""The problem sets as the tests see them: their cells, read and run without a kernel."""

from __future__ import annotations

import ast
import pickle
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, wraps
from pathlib import Path
from typing import Any

import control as ct
import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest
from nbgrader.preprocessors import ClearHiddenTests, ClearSolutions

from nrdob import NRDOB, LowPassFilter
from nrdob_course.exercises import PROBLEMS, Points, Problem, score
from nrdob_course.exercises.drawing import few
from nrdob_course.grading.release import SOURCE

SETS = sorted(SOURCE.glob("*/*.ipynb"))
STUB = "# YOUR CODE HERE"
"""What a student finds in the place of an answer, as the settings of nbgrader say."""


def each_case(problem: Problem, count: int) -> pytest.MarkDecorator:
    """Ask a test of so many cases of the first group, each drawn when its turn comes.

    Drawn where the tests are collected, they would be drawn in each process that shares them.
    """
    return pytest.mark.parametrize(
        "case", [(problem, k) for k in range(count)], ids=map(str, range(count)), indirect=True
    )


def accepts(problem: Problem, case: Any, answer: Any) -> bool:
    """Whether an answer to a case, however it is given, has the properties asked for."""
    return not problem.lacks(case, problem.reads(answer))


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


def once_a_case(answer: Callable[..., Any]) -> Callable[..., Any]:
    """Let an answer be computed once for each case, however often it is asked for."""
    known: dict[bytes, Any] = {}

    @wraps(answer)
    def remembered(*case: Any) -> Any:
        key = pickle.dumps(case)
        if key not in known:
            known[key] = answer(*case)
        return known[key]

    return remembered


def published(this: Posed, group: int) -> Any:
    """The published answer; it is asked once for each case."""
    if this.problem.own:
        return eval(this.answer, run(this.path, group))
    return _published(this.path, this.answer)  # a function of a case, the same for each group


@cache
def _published(path: Path, answer: str) -> Any:
    return once_a_case(eval(answer, run(path, 1)))


def rounded(value: Any, digits: int) -> Any:
    """Round every number of an answer; what is made of blocks keeps all but its time constant."""
    if isinstance(value, dict):
        return {key: rounded(each, digits) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return type(value)(rounded(each, digits) for each in value)
    if isinstance(value, np.ndarray):
        return np.array([rounded(float(each), digits) for each in value])
    if isinstance(value, LowPassFilter):
        return LowPassFilter(few(value.time_constant, digits), value.order)
    if isinstance(value, ct.TransferFunction):
        den = np.poly([-few(float(abs(pole)), digits) for pole in value.poles()])
        return ct.tf([value.dcgain() * den[-1]], den) if value.zeros().size == 0 else value
    if isinstance(value, NRDOB):
        return replace(value, filter=rounded(value.filter, digits))
    return few(float(value), digits) if isinstance(value, float) else value
