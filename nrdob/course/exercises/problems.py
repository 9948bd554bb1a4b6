"""Graders that test properties, recognise how a mistake came about, and say so kindly.

A problem draws its cases from a seed: the same difficulty for everyone, other numbers for each.
An answer is a function of a case, or a value for the student's own case. It is judged by what it
must satisfy, never by comparison with a stored number. If it fails, the grader looks whether it is
what somebody would answer who holds one of the problem's typical misconceptions, and tells what
went wrong and what to do; else it shows the first case that fails.
"""

from __future__ import annotations

import copy
import hashlib
import traceback
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from html import escape
from math import log
from typing import Any

import numpy as np

from ...loop import NRDOB

__all__ = [
    "BLANK",
    "HARD_CODED",
    "HIDDEN_CASES",
    "VISIBLE_CASES",
    "Case",
    "Feedback",
    "Lack",
    "Misconception",
    "Points",
    "Problem",
    "answers_like",
    "answers_like_any",
    "lacking",
    "near",
    "review",
    "same",
]

Case = Any
"""What a problem is posed with: a dataclass whose fields the problem's text names."""

VISIBLE_CASES, HIDDEN_CASES = 4, 8


def same(expected: Any, got: Any, rtol: float = 1e-4) -> bool:
    """Compare numbers, arrays, lists, tuples, booleans or texts, numbers to four digits.

    What is zero may be off by rounding, measured by the largest of the numbers compared.

    Examples
    --------
    >>> same((2, "stable"), [2.00001, "stable"])
    True
    >>> same(1, True)
    False
    """
    if isinstance(expected, bool | np.bool_) or isinstance(got, bool | np.bool_):
        both = isinstance(expected, bool | np.bool_) and isinstance(got, bool | np.bool_)
        return both and bool(expected) == bool(got)
    if isinstance(expected, str) or isinstance(got, str) or expected is None or got is None:
        return type(expected) is type(got) and bool(expected == got)
    try:
        a, b = _numbers(expected), _numbers(got)
    except (TypeError, ValueError):
        if isinstance(expected, list | tuple) and isinstance(got, list | tuple):
            pairs = zip(expected, got, strict=False)
            return len(expected) == len(got) and all(same(x, y, rtol) for x, y in pairs)
        return bool(np.all(expected == got))
    if a.shape != b.shape:
        return False
    finite = np.abs(a[np.isfinite(a)])
    rounding = max(1e-12, 1e-9 * finite.max(initial=0.0))
    return bool(np.allclose(b, a, rtol=rtol, atol=rounding, equal_nan=True))


def _numbers(value: Any) -> Any:
    """Make an array of numbers; texts and booleans, which numpy would convert, are none."""
    array = np.asarray(value)
    if array.dtype.kind in "USb":
        raise TypeError("no numbers")
    return array.astype(complex)


def near(expected: float, got: Any, tolerance: float) -> bool:
    """Tell whether a number is right that was read off a figure: nearly the same share.

    Examples
    --------
    >>> near(2.0, 2.1, 0.08), near(2.0, 2.2, 0.08), near(2.0, -2.0, 0.08)
    (True, False, False)
    """
    share = float(got) / expected
    return share > 0 and abs(log(share)) < tolerance


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
    kind : str
        What an answer lacks, see `Lack`, if it is recognised by that instead.
    """

    name: str
    says: str
    example: Callable[[Case], Any]
    recognises: Callable[[Case, Any], bool] = lambda case, got: False
    marks: float = 0.0
    kind: str = ""


def answers_like(
    name: str,
    says: str,
    example: Callable[[Case], Any],
    marks: float = 0.0,
    close: Callable[[Any, Any], bool] = same,
) -> Misconception:
    """Make a misconception that is recognised by giving the same answer as its example.

    What is the same, `close` tells of the example's answer and of the one given.
    """
    return answers_like_any(name, says, lambda case: (example(case),), marks, close)


def answers_like_any(
    name: str,
    says: str,
    examples: Callable[[Case], Sequence[Any]],
    marks: float = 0.0,
    close: Callable[[Any, Any], bool] = same,
) -> Misconception:
    """Make a misconception that leads to one of several answers; the first is its example."""
    return Misconception(
        name,
        says,
        example=lambda case: examples(case)[0],
        recognises=lambda case, got: any(close(each, got) for each in examples(case)),
        marks=marks,
    )


def lacking(
    kind: str, name: str, says: str, example: Callable[[Case], Any], marks: float = 0.0
) -> Misconception:
    """Make a misconception that is recognised by what its answers lack."""
    return Misconception(name, says, example, marks=marks, kind=kind)


class Lack(str):
    """What an answer lacks, in words, and in one word by which a misconception knows it.

    Examples
    --------
    >>> Lack("sign", "the gain has the wrong sign").kind
    'sign'
    """

    kind: str

    def __new__(cls, kind: str, words: str) -> Lack:
        """Say it in words; the kind goes with them."""
        found = super().__new__(cls, words)
        found.kind = kind
        return found


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


class Points(float):
    """Points, and the words that go with them.

    nbgrader reads the number; whoever reads the marked notebook sees the words.

    Parameters
    ----------
    feedback : Feedback
        What comes of the answer.
    most : float
        Points for an answer that has all that is asked for.
    """

    def __new__(cls, feedback: Feedback, most: float) -> Points:
        """Give the share of the feedback, of the points that there are at most."""
        return super().__new__(cls, most * feedback.share)

    def __init__(self, feedback: Feedback, most: float) -> None:
        self.feedback, self.most = feedback, most

    def _repr_html_(self) -> str:
        return f"<p>{float(self):g} of {self.most:g} points</p>{self.feedback._repr_html_()}"


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
    lacks : callable
        Tells which of the properties asked for an answer to a case lacks, as a sentence or as a
        `Lack`; empty if it has them all.
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
    lacks: Callable[[Case, Any], str]
    praise: str
    misconceptions: tuple[Misconception, ...] = ()
    own: bool = False

    def accepts(self, case: Case, got: Any) -> bool:
        """Tell whether an answer to a case has the properties asked for.

        Parameters
        ----------
        case : object
            A case of the problem.
        got : object
            What the answer gives for it.
        """
        return not self.lacks(case, got)

    def cases(self, seed: Any, count: int) -> list[Case]:
        """Draw cases; the first one of a group's seed is its own.

        Parameters
        ----------
        seed : object
            Number of the group, or a hidden seed.
        count : int
            How many.
        """
        if isinstance(seed, float) and seed.is_integer():
            seed = int(seed)
        # Anything can be a seed, so that a group's number that is none does not stop the grading.
        digest = hashlib.sha256(f"{self.id}/{seed}".encode()).digest()
        # Drawn once; a copy, so that whoever changes a case changes nobody else's.
        return copy.deepcopy(_drawn(self.case, int.from_bytes(digest[:8], "big"), count))


@lru_cache(maxsize=512)
def _drawn(draw: Callable[[np.random.Generator], Case], seed: int, count: int) -> list[Case]:
    rng = np.random.default_rng(seed)
    return [draw(rng) for _ in range(count)]


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
        return _judge(problem, [(next(iter(cases)), answer)])
    if not callable(answer):
        return Feedback(0.0, "The answer must be a function of a case; this is a value.")
    tried = []
    for case in cases:
        try:
            # A copy, so that an answer which changes its case is judged on the case it was given.
            got = _quietly(answer, copy.deepcopy(case))
        except NotImplementedError:
            return Feedback(0.0, BLANK)
        except (Exception, SystemExit) as error:
            return Feedback(0.0, _told(error, answer, case))
        if got is None or got is Ellipsis:
            return Feedback(0.0, "The function returns nothing: end it with return …")
        tried.append((case, got))
    return _judge(problem, tried)


def _quietly(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call without warnings: nbgrader gives no points to a test that writes to stderr."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(*arguments)


def _told(error: BaseException, answer: Any, case: Case) -> str:
    """Tell an error, and the line of the answer that it comes from."""
    file = getattr(getattr(answer, "__code__", None), "co_filename", None)
    lines = [
        frame.line for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file
    ]
    where = f" In the line: {lines[-1]}" if lines and lines[-1] else ""
    return f"Your function ends with an error, {type(error).__name__}, for {case}: {error}.{where}"


def _shown(value: Any, longest: int = 200) -> str:
    """Write a value as text, cut where it is long."""
    try:
        text = "(a loop)" if isinstance(value, NRDOB) else str(value)
    except Exception:
        text = f"an object of type {type(value).__name__}"
    return text if len(text) <= longest else text[:longest] + " …"


def _judge(problem: Problem, tried: list[tuple[Case, Any]]) -> Feedback:
    found = [(case, got, _lack(problem, case, got)) for case, got in tried]
    failing = [each for each in found if each[2]]
    if not failing:
        return Feedback(1.0, problem.praise)
    for misconception in problem.misconceptions:
        if all(_recognises(misconception, *each) for each in failing):
            return Feedback(misconception.marks, misconception.says, misconception.name)
    first = tried[0][1]
    if len(tried) > 1 and not found[0][2] and all(same(first, got) for _, got in tried):
        return Feedback(0.0, HARD_CODED, "hard-coded")
    case, got, lack = failing[0]
    return Feedback(0.0, f"Not yet. For {case} the answer {_shown(got)} fails: {lack}")


def _lack(problem: Problem, case: Case, got: Any) -> str:
    try:
        lack = _quietly(problem.lacks, case, got)
    except Exception as error:
        return f"it cannot be used: {type(error).__name__}: {error}"
    if not isinstance(lack, str):
        raise TypeError(
            f"lacks of problem {problem.id} gives {lack!r}; it must give a sentence that says what "
            "the answer lacks, or an empty one if it lacks nothing"
        )
    return lack


def _recognises(misconception: Misconception, case: Case, got: Any, lack: str) -> bool:
    if misconception.kind:
        return isinstance(lack, Lack) and lack.kind == misconception.kind
    try:
        return bool(_quietly(misconception.recognises, case, got))
    except Exception:
        return False
