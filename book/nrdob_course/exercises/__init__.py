"""Problem sets that grade themselves: the graders behind the notebooks of `book/nrdob_course/sets`.

In a notebook, `check` gives immediate feedback and `score`, in the hidden tests, the points.

>>> from nrdob_course.exercises import PROBLEMS, check
>>> check("2.1", None, group=7)
Nothing to check yet: replace the placeholder by your answer and run this cell again.
"""

import contextlib
import os
from dataclasses import replace
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from .cases import factored
from .figures import draw_without_count
from .problems import BUDGET, Case, Feedback, Misconception, Points, Problem
from .reviewing import HIDDEN_CASES, NOBODY, NOT_NOW, VISIBLE_CASES, review, timed
from .set5 import draw_edge

__all__ = [
    "BUDGET", "PROBLEMS", "Feedback", "Misconception", "Points", "Problem", "check", "draw_edge",
    "draw_without_count", "factored", "judge_all", "judge_own", "own_case", "score",
]  # fmt: skip

PROBLEMS: dict[str, Problem] = {
    held.id: held
    for _, name, _ in iter_modules(__path__)
    if name.startswith("set")
    for held in vars(import_module(f"{__name__}.{name}")).values()
    if isinstance(held, Problem)
}
"""Every problem by its id, in their order, found in the modules set1, set2, …"""


def own_case(id: str, group: int) -> Case:
    """Give the case of a group: the same problem for all, with numbers of its own.

    Parameters
    ----------
    id : str
        Number of the problem, "2.1".
    group : int
        Seed of the group.
    """
    return _problem(id).cases(group, 1)[0]


def check(id: str, answer: Any, group: int) -> Feedback:
    """Judge an answer on the group's own case and some more, and tell what to think about.

    It tells, too, how much of the time allowed the answer takes when it is graded, if that is more
    than a little.

    Parameters
    ----------
    id : str
        Number of the problem, "2.1".
    answer : object
        What the problem asks for: a function of a case, or a value for the group's own case.
    group : int
        Seed of the group.
    """
    problem = _problem(id)
    if os.environ.get("NBGRADER_EXECUTION") == "autograde":
        return Feedback(0.0, NOT_NOW)
    count, graded = (1, 1) if problem.own else (VISIBLE_CASES, 1 + HIDDEN_CASES)
    found = timed(problem, answer, problem.drawn(group, count), graded)
    return replace(found, notes=(*found.notes, NOBODY)) if group == 0 else found


def score(id: str, answer: Any, group: int, points: float, seed: int) -> Points:
    """Points of an answer on cases that the student has not seen, for the hidden tests.

    The answer must hold on the group's own case too; a value is for that case alone. What the
    answer prints is left out, and what is said tells nothing of the cases that nobody has seen.

    Parameters
    ----------
    id : str
        Number of the problem, "2.1".
    answer : object
        A function of a case, or a value for the group's own case.
    group : int
        Seed of the group.
    points : float
        Points of a right answer.
    seed : int
        Hidden seed of the cases that the student has not seen.
    """
    with (
        open(os.devnull, "w", encoding="utf-8") as nowhere,
        contextlib.redirect_stdout(nowhere),
        contextlib.redirect_stderr(nowhere),
    ):
        return Points(judge_all(id, answer, group, seed, judge_own(id, answer, group)), points)


def judge_own(id: str, answer: Any, group: Any) -> Feedback:
    """Judge an answer on the group's own case, of which anything can be said.

    What mistake a function makes is not looked for: all cases must show it, see `judge_all`.

    Parameters
    ----------
    id, answer, group : str, object, int
        As of `score`.
    """
    problem = _problem(id)
    if not problem.own:
        problem = replace(problem, misconceptions=(), rounded=None)
    return review(problem, answer, problem.drawn(group, 1))


def judge_all(id: str, answer: Any, group: Any, seed: int, own: Feedback) -> Feedback:
    """Judge an answer on the own case and the hidden ones, of which nothing is said.

    Parameters
    ----------
    id, answer, group, seed : str, object, int, int
        As of `score`.
    own : Feedback
        What `judge_own` gave. An answer that is a value has nothing to add to it.
    """
    problem = _problem(id)
    if problem.own:
        return own
    cases = problem.drawn(group, 1) + problem.drawn(seed, HIDDEN_CASES)
    return review(problem, answer, cases, told="" if own.share == 1 else own.text)


def _problem(id: str) -> Problem:
    if id not in PROBLEMS:
        raise KeyError(f"there is no problem {id!r}; there are {', '.join(PROBLEMS)}")
    return PROBLEMS[id]
