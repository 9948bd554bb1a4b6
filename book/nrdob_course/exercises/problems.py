"""Graders that test properties, recognise how a mistake came about, and say so kindly.

A problem draws its cases from a seed: the same difficulty for everyone, other numbers for each.
An answer is a function of a case, or a value for the student's own case. It is judged by what it
must satisfy, never by comparison with a stored number. If it fails, the grader looks whether it is
what somebody would answer who holds one of the problem's typical misconceptions, and tells what
went wrong and what to do; else it shows the first case that fails. A right answer that was rounded
is told so, and accused of nothing.

A case holds what the problem's text names, and nothing else: what a grader knows besides, it
computes from the case, in functions of the problem's module.
"""

from __future__ import annotations

import builtins
import copy
import hashlib
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from html import escape
from math import log
from typing import Any

import numpy as np

from nrdob.diagram import LowPassFilter
from nrdob.loop import NRDOB

from .reading import UnreadableError, as_given

__all__ = [
    "BLANK",
    "BUDGET",
    "FOUR_DIGITS",
    "HARD_CODED",
    "HIDDEN_CASES",
    "ROUNDED",
    "TOO_SLOW",
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
    "read_as",
    "review",
    "rounds",
    "same",
    "timed",
]

Case = Any
"""What a problem is posed with: a dataclass whose fields the problem's text names."""

Draw = Callable[[np.random.Generator], Case]
"""Draws a case."""

VISIBLE_CASES, HIDDEN_CASES = 4, 8

BUDGET = 60.0
"""Seconds that a cell may take when it is graded; `check` tells how much of them it needs."""

FOUR_DIGITS = 6e-4
"""By how much a number may differ that is given to four digits, as a share of it."""


def same(expected: Any, got: Any, rtol: float = FOUR_DIGITS) -> bool:
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


def rounds(right: Any, got: Any) -> bool:
    """Tell whether an answer is a right one with fewer digits, rounded or cut off.

    Numbers are so if they have few digits, and are off by less than one in the last of them and by
    at most 5 %; of filters, the time constants. What is right to four digits counts, too.

    Examples
    --------
    >>> rounds(0.12345, 0.123), rounds([0.12345, 2.0], [0.12, 2.0]), rounds(0.12345, 0.1236)
    (True, True, False)
    """
    if isinstance(right, LowPassFilter):
        return right.order == got.order and rounds(right.time_constant, got.time_constant)
    if isinstance(right, Mapping):
        return right.keys() == got.keys() and all(rounds(right[key], got[key]) for key in right)
    expected, given = np.ravel(right).astype(float), np.ravel(got).astype(float)
    return expected.size == given.size and all(map(_rounds, expected, given))


def _rounds(right: float, got: float) -> bool:
    if same(right, got):
        return True
    if not (np.isfinite(right) and np.isfinite(got)) or abs(got - right) > 0.05 * abs(right):
        return False
    units = 10.0 ** -np.arange(-3, 9)
    short = np.abs(got / units - np.round(got / units)) < 1e-9
    return bool(np.any(short & (abs(got - right) < units)))


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


def read_as(
    name: str,
    says: str,
    example: Callable[[Case], Any],
    back: Callable[[Any], Any],
    lacks: Callable[[Case, Any], str],
    marks: float = 0.5,
) -> Misconception:
    """Make a misconception that is recognised by being right once its unit, or order, is put right.

    Parameters
    ----------
    name, says, example, marks
        As of a `Misconception`.
    back : callable
        Converts what was given to what is asked for.
    lacks : callable
        The problem's own judge.
    """
    return Misconception(name, says, example, lambda case, got: not lacks(case, back(got)), marks)


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
    notes : tuple of str
        What is to be said besides, about the time and the group.
    """

    share: float
    text: str
    recognised: str = ""
    notes: tuple[str, ...] = field(default=(), compare=False)

    def __repr__(self) -> str:
        return "\n".join([self.text, *self.notes])

    def _repr_html_(self) -> str:
        # A word and a mark, not colour alone.
        mark = "✓" if self.share == 1 else "→"
        notes = "".join(f"<p>{escape(note)}</p>" for note in self.notes)
        return f"<p><strong>{mark}</strong> {escape(self.text)}</p>{notes}"


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
    case : callable or tuple of callable
        Draws a case from a random generator. Several are used in turn, so that every student meets
        each kind of case.
    lacks : callable
        Tells which of the properties asked for an answer to a case lacks, as a sentence or as a
        `Lack`; empty if it has them all.
    praise : str
        What the student reads when all is well: a sentence that says what was shown.
    misconceptions : tuple of Misconception
        In the order in which they are looked for.
    own : bool
        Whether the answer is a value for the student's own case rather than a function of a case.
    reads : callable
        Reads what a student gives, see `nrdob_course.exercises.reading`; all that judges an answer
        gets what this returns.
    rounded : callable, optional
        Tells whether an answer that fails is right but for rounding.
    parts : callable, optional
        Tells which of several independent parts of an answer are right, each by its name. An answer
        earns the share of the parts that are right in every case.
    budget : float
        Seconds that the graded cell may take.
    """

    id: str
    title: str
    case: Draw | tuple[Draw, ...]
    lacks: Callable[[Case, Any], str]
    praise: str
    misconceptions: tuple[Misconception, ...] = ()
    own: bool = False
    reads: Callable[[Any], Any] = as_given
    rounded: Callable[[Case, Any], bool] | None = None
    parts: Callable[[Case, Any], Mapping[str, bool]] | None = None
    budget: float = BUDGET

    def accepts(self, case: Case, got: Any) -> bool:
        """Tell whether an answer to a case has the properties asked for.

        Parameters
        ----------
        case : Case
            What was asked.
        got : object
            The answer, as it is given.
        """
        return not self.lacks(case, self.reads(got))

    def cases(self, seed: Any, count: int) -> list[Case]:
        """Give cases; the first one of a group's seed is its own.

        They are copies, so that whoever changes a case changes nobody else's.

        Parameters
        ----------
        seed : object
            A group, or a hidden seed.
        count : int
            How many.
        """
        return copy.deepcopy(self.drawn(seed, count))

    def drawn(self, seed: Any, count: int) -> list[Case]:
        """Draw cases, once; what graders have computed of them stays known.

        Parameters
        ----------
        seed : object
            A group, or a hidden seed.
        count : int
            How many.
        """
        if isinstance(seed, float) and seed.is_integer():
            seed = int(seed)
        # Anything can be a seed, so that a group's number that is none does not stop the grading.
        digest = hashlib.sha256(f"{self.id}/{seed}".encode()).digest()
        kinds = self.case if isinstance(self.case, tuple) else (self.case,)
        cases = _sequence(kinds, int.from_bytes(digest[:8], "big"))
        while len(cases.drawn) < count:
            cases.draw()
        return cases.drawn[:count]


class _Sequence:
    """Cases of one seed, drawn as they are asked for."""

    def __init__(self, kinds: tuple[Draw, ...], seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.kinds, self.first = kinds, seed % len(kinds)
        self.drawn: list[Case] = []

    def draw(self) -> None:
        kind = self.kinds[(self.first + len(self.drawn)) % len(self.kinds)]
        self.drawn.append(kind(self.rng))


_sequence = lru_cache(maxsize=512)(_Sequence)


BLANK = "Nothing to check yet: replace the placeholder by your answer and run this cell again."

NOTHING = (
    "Nothing to check yet: your function returns nothing. Write the answer into it, end it with "
    "return …, and run this cell again."
)

SOMETIMES = (
    "Your function returns an answer in some cases, and nothing for {case}. Does a search end "
    "there without having found anything, or is there a branch without return?"
)

ROUNDED = (
    "Right, but rounded: numbers are compared to four digits, and these have fewer, which costs a "
    "quarter of the points. Leave the rounding out, or keep four digits or more."
)
KEPT = 0.75
"""Share of the points for a right answer that was rounded."""

TOO_SLOW = "Right, but too slow: when it is graded it would be stopped, and earn nothing."

HARD_CODED = (
    "Right for the first case and wrong for another: it looks as if a number of one case were "
    "written into the answer. Compute it from the case that the function is given."
)


HIDDEN = (
    "Right for your own case, and not for all others, which are drawn as yours was. Run the check "
    "with the numbers of other groups, in a cell of your own, until it shows you one that fails."
)


def review(
    problem: Problem, answer: Any, cases: Iterable[Case], shown: int | None = None
) -> Feedback:
    """Judge an answer on some cases.

    Parameters
    ----------
    problem : Problem
        The problem.
    answer : object
        A function of a case, or, where the problem asks for the student's own case, a value.
    cases : iterable
        What it is tried on; the value of an own case is tried on the first one only.
    shown : int, optional
        How many of them the student may see; what is said tells nothing of the others.
    """
    if answer is None or answer is Ellipsis:
        return Feedback(0.0, BLANK)
    if problem.own:
        return _judge(problem, [_tried(problem, next(iter(cases)), answer)])
    if not callable(answer):
        return Feedback(0.0, "The answer must be a function of a case; this is a value.")
    tried: list[_Tried] = []
    for count, case in enumerate(cases):
        seen = f"{case}" if shown is None or count < shown else ""
        try:
            # A copy, so that an answer which changes its case is judged on the case it was given.
            got = _quietly(answer, copy.deepcopy(case))
        except NotImplementedError:
            return Feedback(0.0, BLANK)
        except (Exception, SystemExit) as error:
            return Feedback(0.0, _told(error, answer, seen))
        if got is None or got is Ellipsis:
            return Feedback(0.0, SOMETIMES.format(case=seen or OTHER) if tried else NOTHING)
        tried.append(_tried(problem, case, got))
    return _judge(problem, tried, shown)


def timed(problem: Problem, answer: Any, cases: Sequence[Case], graded: int) -> Feedback:
    """Judge an answer, and tell how much of the time allowed it takes when it is graded.

    Parameters
    ----------
    problem, answer, cases
        As `review` takes them.
    graded : int
        On how many cases it will be graded.
    """
    start = time.perf_counter()
    found = review(problem, answer, cases)
    seconds = (time.perf_counter() - start) * graded / len(cases)
    if seconds < 0.05 * problem.budget:
        return found
    note = f"When it is graded it takes about {seconds:.2g} s of the {problem.budget:g} s allowed."
    if seconds > problem.budget:
        found = replace(found, share=0.0, text=TOO_SLOW if found.share == 1 else found.text)
    return replace(found, notes=(note,))


def _quietly(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call without warnings: nbgrader gives no points to a test that writes to stderr."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(*arguments)


OTHER = "a case that is not your own"


def _told(error: BaseException, answer: Any, case: str) -> str:
    """Tell an error, and the line of the answer that it comes from; no words of it for no case."""
    name = type(error).__name__
    if not case:  # a name, too, can be made up of what nobody is to see
        name = f", {name}," if hasattr(builtins, name) else ""
        return f"Your function ends with an error{name} for {OTHER}. {HIDDEN.partition('. ')[2]}"
    file = getattr(getattr(answer, "__code__", None), "co_filename", None)
    lines = [
        frame.line for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file
    ]
    where = f" In the line: {lines[-1]}" if lines and lines[-1] else ""
    return f"Your function ends with an error, {name}, for {case}: {error}.{where}"


def _shown(value: Any, longest: int = 200) -> str:
    """Write a value as text, numbers to four digits, cut where it is long."""
    try:
        text = _text(value)
    except Exception:
        text = f"an object of type {type(value).__name__}"
    return text if len(text) <= longest else text[:longest] + " …"


def _text(value: Any) -> str:
    if isinstance(value, NRDOB):
        return "(a loop)"
    if isinstance(value, LowPassFilter):
        return f"LowPassFilter({_text(value.time_constant)}, {value.order})"
    if isinstance(value, np.ndarray):
        return _text(value.tolist())
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key!r}: {_text(held)}" for key, held in value.items()) + "}"
    if isinstance(value, list | tuple):
        inside = ", ".join(map(_text, value))
        return f"[{inside}]" if isinstance(value, list) else f"({inside})"
    if isinstance(value, float | complex | np.number):
        plain = complex(value)
        whole = plain.imag == 0 and plain.real.is_integer() and abs(plain) < 1e6
        return f"{int(plain.real)}" if whole else f"{value:.4g}"
    return str(value)


@dataclass(frozen=True, eq=False)
class _Tried:
    """An answer to a case, as it was given and as it was read, and what it lacks."""

    case: Case
    given: Any
    got: Any
    lack: str


def _tried(problem: Problem, case: Case, given: Any) -> _Tried:
    try:
        got = _quietly(problem.reads, given)
    except Exception as error:
        return _Tried(case, given, None, _unusable(error))
    return _Tried(case, given, got, _lack(problem, case, got))


def _judge(problem: Problem, tried: Sequence[_Tried], shown: int | None = None) -> Feedback:
    failing = [each for each in tried if each.lack]
    if not failing:
        return Feedback(1.0, problem.praise)
    right = _right_parts(problem, tried)
    earned = sum(right.values()) / len(right) if right else 0.0

    def recognised(how: Callable[[_Tried], Any]) -> bool:
        return all(each.got is not None and _holds(how, each) for each in failing)

    is_rounded = problem.rounded
    if is_rounded and recognised(lambda each: is_rounded(each.case, each.got)):
        return Feedback(max(earned, KEPT), ROUNDED, "rounded")
    for misconception in problem.misconceptions:
        if recognised(partial(_recognises, misconception)):
            share = max(earned, misconception.marks)
            return Feedback(share, misconception.says, misconception.name)
    first = tried[0]
    if len(tried) > 1 and not first.lack and all(same(first.given, t.given) for t in tried):
        return Feedback(0.0, HARD_CODED, "hard-coded")
    worst = failing[0]
    text = f"Not yet. For {worst.case} the answer {_shown(worst.given)} fails: {worst.lack}"
    if shown is not None and tried.index(worst) >= shown:
        text = HIDDEN
    if earned:
        text += f"{'' if text == HIDDEN else '.'} (Right in every case: "
        text += f"{', '.join(name for name in right if right[name])}.)"
    return Feedback(earned, text)


def _right_parts(problem: Problem, tried: Sequence[_Tried]) -> dict[str, bool]:
    """Tell which parts of an answer are right in every case."""
    if not problem.parts or any(each.got is None for each in tried):
        return {}
    try:
        found = [_quietly(problem.parts, each.case, each.got) for each in tried]
    except Exception:  # what cannot be taken apart has no parts that are right
        return {}
    return {name: all(parts[name] for parts in found) for name in found[0]}


def _lack(problem: Problem, case: Case, got: Any) -> str:
    try:
        lack = _quietly(problem.lacks, case, got)
    except Exception as error:
        return _unusable(error)
    if not isinstance(lack, str):
        raise TypeError(
            f"lacks of problem {problem.id} gives {lack!r}; it must give a sentence that says what "
            "the answer lacks, or an empty one if it lacks nothing"
        )
    return lack


def _unusable(error: Exception) -> str:
    if isinstance(error, UnreadableError):
        return _shown(error, longest=300)
    # What the package refuses it says in words that need no name.
    name = "" if isinstance(error, ValueError | TypeError) else f"{type(error).__name__}: "
    return f"it cannot be used: {name}{_shown(error, longest=300)}"


def _recognises(misconception: Misconception, tried: _Tried) -> bool:
    if misconception.kind:
        return isinstance(tried.lack, Lack) and tried.lack.kind == misconception.kind
    return misconception.recognises(tried.case, tried.got)


def _holds(how: Callable[[_Tried], Any], tried: _Tried) -> bool:
    try:
        return bool(_quietly(how, tried))
    except Exception:
        return False
