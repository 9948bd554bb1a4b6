"""Judge an answer on some cases, and say what comes of it."""

import copy
import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import FunctionType
from typing import Any

import control as ct
import numpy as np

from nrdob.diagram import DelayedTransferFunction, LowPassFilter
from nrdob.loop import NRDOB

from ..encoding import BLOCKS, decode, encode, line_of
from .cases import factored
from .comparing import same
from .problems import BUDGET, Case, Feedback, Lack, Misconception, Problem, texts_of, words
from .reading import UnreadableError

__all__ = [
    "BLANK", "HARD_CODED", "HIDDEN", "HIDDEN_CASES", "NOBODY", "NOTHING", "NOT_NOW",
    "OTHER", "ROUNDED", "TOO_SLOW", "VISIBLE_CASES", "review", "timed",
]  # fmt: skip

VISIBLE_CASES, HIDDEN_CASES = 4, 8

_SAID = {name: words(text) for name, text in texts_of("reviewing").items()}
BLANK, NOTHING, SOMETIMES = (_SAID[name] for name in ("blank", "nothing", "sometimes"))
ROUNDED, TOO_SLOW, HARD_CODED = (_SAID[name] for name in ("rounded", "too slow", "hard-coded"))
HIDDEN, ENDED = (f"{_SAID[name]} {_SAID['find one']}" for name in ("hidden", "ended"))
OTHER, NOT_NOW, NOBODY = (_SAID[name] for name in ("other", "not now", "nobody"))
KEPT = 0.75  # share of the points for a right answer that was rounded


def review(
    problem: Problem, answer: Any, cases: Iterable[Case], told: str | None = None
) -> Feedback:
    """Judge an answer on some cases; the value for an own case on the first one only.

    Where some of them are hidden, `told` is what was said of the first one, empty if it was right.
    Then nothing else is said but sentences that hold nothing of a case or of an answer.
    """
    if answer is None or answer is Ellipsis:
        return Feedback(0.0, BLANK)
    if problem.own:
        return _judge(problem, [_tried(problem, next(iter(cases)), answer)])
    if not callable(answer):
        return Feedback(0.0, "The answer must be a function of a case; this is a value.")
    tried: list[_Tried] = []
    for case in cases:
        try:
            # A copy, so that an answer which changes its case is judged on the case it was given.
            got = _quietly(answer, copy.deepcopy(case))
        except NotImplementedError:
            return Feedback(0.0, BLANK)
        except (Exception, SystemExit) as error:
            words = f"{type(error).__name__}, for {case}: {error}. {line_of(error, answer)}".strip()
            text = f"Your function ends with an error, {words}"
            return Feedback(0.0, text if told is None else told or ENDED)
        if got is None or got is Ellipsis:
            nothing = SOMETIMES.format(case=case if told is None else OTHER) if tried else NOTHING
            return Feedback(0.0, told or nothing)
        tried.append(_tried(problem, case, got))
    return _judge(problem, tried, told)


def timed(problem: Problem, answer: Any, cases: Sequence[Case], graded: int) -> Feedback:
    """Judge an answer, and tell how much time it takes when it is graded on so many cases."""
    start = time.perf_counter()
    found = review(problem, answer, cases)
    seconds = (time.perf_counter() - start) * graded / len(cases)
    if seconds < 0.05 * BUDGET:
        return found
    note = f"When it is graded it takes about {seconds:.2g} s of the {BUDGET:g} s allowed."
    if seconds > BUDGET:
        found = replace(found, share=0.0, text=TOO_SLOW if found.share == 1 else found.text)
    return replace(found, notes=(*found.notes, note))


def _quietly(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call without warnings: nbgrader gives no points to a test that writes to stderr."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(*arguments)


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
    # By itself a block shows a number that counts all blocks, another one in each run.
    if isinstance(value, DelayedTransferFunction) or (isinstance(value, ct.LTI) and value.issiso()):
        return factored(value)
    if isinstance(value, ct.InputOutputSystem):
        return f"(a system with inputs: {value.ninputs}, outputs: {value.noutputs})"
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
    if isinstance(value, FunctionType | partial):  # by itself it shows its address
        return "(a function)"
    return str(value)


@dataclass(frozen=True, eq=False)
class _Tried:
    """An answer to a case, as it was given and as it was read, and what it lacks."""

    case: Case
    given: Any
    got: Any
    lack: str


def _tried(problem: Problem, case: Case, given: Any) -> _Tried:
    got = None
    try:
        # When it is graded it comes out of another process, but for functions in a value's place.
        stays = problem.own and callable(given) and not isinstance(given, BLOCKS)
        sent = given if stays else _quietly(decode, _quietly(encode, given))
        got = _quietly(problem.reads, sent)
        lack = _quietly(problem.lacks, case, got)
    except Exception as error:
        return _Tried(case, given, got, _unusable(error))
    if not isinstance(lack, str):
        raise TypeError(
            f"lacks of problem {problem.id} gives {lack!r}; it must give a sentence that says what "
            "the answer lacks, or an empty one if it lacks nothing"
        )
    return _Tried(case, given, got, lack)


def _judge(problem: Problem, tried: Sequence[_Tried], told: str | None = None) -> Feedback:
    failing = [each for each in tried if each.lack]
    if not failing:
        return Feedback(1.0, problem.praise)
    right = _right_parts(problem, tried)
    earned = sum(right.values()) / len(right) if right else 0.0

    def recognised(how: Callable[[_Tried], Any]) -> bool:
        try:
            return all(each.got is not None and _quietly(how, each) for each in failing)
        except Exception:
            return False

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
    parts = ", ".join(name for name in right if right[name])
    notes = (f"Right in every case: {parts}.",) if parts else ()
    return Feedback(earned, text if told is None else told or HIDDEN, notes=notes)


def _right_parts(problem: Problem, tried: Sequence[_Tried]) -> dict[str, bool]:
    """Tell which parts of an answer are right in every case."""
    if not problem.parts or any(each.got is None for each in tried):
        return {}
    try:
        found = [_quietly(problem.parts, each.case, each.got) for each in tried]
    except Exception:  # what cannot be taken apart has no parts that are right
        return {}
    return {name: not any(parts[name] for parts in found) for name in found[0]}


def _unusable(error: Exception) -> str:
    if isinstance(error, UnreadableError):
        return _shown(error, longest=300)
    # What the package refuses it says in words that need no name.
    name = "" if isinstance(error, ValueError | TypeError) else f"{type(error).__name__}: "
    return f"it cannot be used: {name}{_shown(error, longest=300)}"


def _recognises(misconception: Misconception, tried: _Tried) -> bool:
    if misconception.kind:
        return isinstance(tried.lack, Lack) and tried.lack.kind == misconception.kind
    return bool(misconception.recognises and misconception.recognises(tried.case, tried.got))
