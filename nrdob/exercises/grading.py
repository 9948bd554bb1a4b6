"""Graders that test properties, recognise how a mistake came about, and say so kindly.

A problem draws its cases from a seed: the same difficulty for everyone, other numbers for each.
An answer is a function of a case, or a value for the student's own case. It is judged by what it
must satisfy, never by comparison with a stored number. If it fails, the grader looks whether it is
what somebody would answer who holds one of the problem's typical misconceptions, and tells what
went wrong and what to do; else it shows the first case that fails.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

Case = Any
"""What a problem is posed with: a dataclass whose fields the problem's text names."""

VISIBLE_CASES, HIDDEN_CASES = 4, 8


@dataclass(frozen=True)
class Misconception:
    """A typical mistake.

    Attributes
    ----------
    name : str
        Short, for the instructor: "counter-clockwise counted as positive".
    says : str
        What the student reads: what seems to have happened, why it is not right, what to do.
    example : callable
        What somebody who holds it answers to a case.
    recognises : callable
        Tells whether an answer to a case is of this kind.
    marks : float
        Share of the points that it deserves, from 0 to 1.
    """

    name: str
    says: str
    example: Callable[[Case], Any]
    recognises: Callable[[Case, Any], bool]
    marks: float = 0.0


def answers_like(
    name: str, says: str, example: Callable[[Case], Any], marks: float = 0.0
) -> Misconception:
    """Make a misconception that is recognised by giving the same answer as its example."""
    return Misconception(name, says, example, lambda case, got: same(example(case), got), marks)


def same(expected: Any, got: Any, rtol: float = 1e-4) -> bool:
    """Compare numbers, arrays, tuples, booleans or texts, numbers to four digits."""
    if isinstance(expected, bool | np.bool_) or isinstance(got, bool | np.bool_):
        return isinstance(got, bool | np.bool_) and bool(expected) == bool(got)
    if isinstance(expected, str) or got is None or isinstance(got, str):
        return bool(expected == got)
    try:
        a, b = np.asarray(expected, dtype=complex), np.asarray(got, dtype=complex)
    except (TypeError, ValueError):
        return bool(expected == got)
    if a.shape != b.shape:
        return False
    return bool(np.allclose(a, b, rtol=rtol, atol=1e-9, equal_nan=True))


@dataclass(frozen=True)
class Feedback:
    """What comes of an answer.

    Attributes
    ----------
    share : float
        Share of the points earned, from 0 to 1.
    text : str
        What the student reads.
    recognised : str
        Name of the misconception recognised; empty if there is none.
    """

    share: float
    text: str
    recognised: str = ""

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        # A word and a mark, not colour alone.
        mark = "✓" if self.share == 1 else "→"
        return f"<p><strong>{mark}</strong> {escape(self.text)}</p>"


@dataclass(frozen=True)
class Problem:
    """One problem.

    Attributes
    ----------
    id : str
        Number of the set and of the problem: "2.1".
    title : str
        What it is about.
    case : callable
        Draws a case from a random generator.
    accepts : callable
        Tells whether an answer to a case has the properties asked for: True, or a sentence that
        says which one it lacks.
    praise : str
        What the student reads when all is well: a sentence that says what was shown.
    misconceptions : tuple of Misconception
        In the order in which they are looked for.
    own : bool
        Whether the answer is a value for the student's own case rather than a function of a case.
    """

    id: str
    title: str
    case: Callable[[np.random.Generator], Case]
    accepts: Callable[[Case, Any], bool | str]
    praise: str
    misconceptions: tuple[Misconception, ...] = ()
    own: bool = False

    def cases(self, seed: int, count: int) -> list[Case]:
        """Draw cases; the first one of a group's seed is its own."""
        digest = hashlib.sha256(f"{self.id}/{seed}".encode()).digest()
        rng = np.random.default_rng(int.from_bytes(digest[:8], "big"))
        return [self.case(rng) for _ in range(count)]


BLANK = "Nothing to check yet: replace the placeholder by your answer and run this cell again."

HARD_CODED = (
    "Right for the first case and wrong for another: it looks as if a number of one case were "
    "written into the answer. Compute it from the case that the function is given."
)


def review(problem: Problem, answer: Any, cases: Iterable[Case]) -> Feedback:
    """Judge an answer on some cases.

    Parameters
    ----------
    problem : Problem
        The problem.
    answer : object
        A function of a case, or, where the problem asks for the student's own case, a value.
    cases : iterable
        What it is tried on; the value of an own case is tried on the first one only.
    """
    if answer is None or answer is Ellipsis:
        return Feedback(0.0, BLANK)
    if problem.own:
        tried = [(next(iter(cases)), answer)]
    elif not callable(answer):
        return Feedback(0.0, "The answer must be a function of a case; this is a value.")
    else:
        tried = []
        for case in cases:
            try:
                got = answer(case)
            except NotImplementedError:
                return Feedback(0.0, BLANK)
            except Exception as error:
                return Feedback(0.0, f"{type(error).__name__} for {case}: {error}")
            if got is None or got is Ellipsis:
                return Feedback(0.0, "The function returns nothing: end it with return …")
            tried.append((case, got))
    return _judge(problem, tried)


def _judge(problem: Problem, tried: list[tuple[Case, Any]]) -> Feedback:
    verdicts = [_accepts(problem, case, got) for case, got in tried]
    wrong = [k for k, verdict in enumerate(verdicts) if verdict is not True]
    if not wrong:
        return Feedback(1.0, problem.praise)
    failing = [tried[k] for k in wrong]
    for misconception in problem.misconceptions:
        if all(_recognises(misconception, case, got) for case, got in failing):
            return Feedback(misconception.marks, misconception.says, misconception.name)
    if len(tried) > 1 and wrong[0] > 0 and len({str(got) for _, got in tried}) == 1:
        return Feedback(0.0, HARD_CODED, "hard-coded")
    case, got = failing[0]
    reason = verdicts[wrong[0]] or "it does not have the properties asked for"
    return Feedback(0.0, f"Not yet. For {case} the answer {got} fails: {reason}")


def _accepts(problem: Problem, case: Case, got: Any) -> bool | str:
    try:
        return problem.accepts(case, got)
    except Exception as error:
        return f"it cannot be used: {type(error).__name__}: {error}"


def _recognises(misconception: Misconception, case: Case, got: Any) -> bool:
    try:
        return misconception.recognises(case, got)
    except Exception:
        return False
