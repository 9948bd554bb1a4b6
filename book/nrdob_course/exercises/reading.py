"""Read what students give: numbers, polynomials, transfer functions and filters in any dress.

One reader for all problems, so that a right answer is never refused for how it is written: as a
list, an array, a text or a dictionary, ``[x]`` or ``x``, "0,173", a complex number without
imaginary part, an object of python-control or a polynomial, see also `nrdob_course.encoding`. What
cannot be read is refused with a word of advice.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from math import inf, nan
from typing import Any

import control as ct
import numpy as np

from nrdob.diagram import DelayedTransferFunction, LowPassFilter, as_fraction
from nrdob.numerics import FloatArray

__all__ = [
    "UNORDERED", "UnreadableError", "as_given", "block", "lowpass", "number", "numbers",
    "polynomial", "things", "whole",
]  # fmt: skip

REAL, NOTHING = 1e-9, 1e-12
"""An imaginary part is rounding, if it is a smaller share than this, or a smaller number."""

LARGEST = 1e100
"""Finite numbers beyond it are refused: what is computed of them overflows to inf, or to nan."""

UNORDERED = (
    str, dict, set, frozenset, np.poly1d, np.polynomial.Polynomial, ct.InputOutputSystem,
)  # fmt: skip
"""What can be gone through, but holds no numbers in an order that was meant."""


class UnreadableError(ValueError):
    """An answer that is not what was asked for; the message says so to the student."""


def as_given(given: Any) -> Any:
    """Leave an answer as it is."""
    return given


def number(given: Any) -> float:
    """Read a real number.

    >>> number([0.173]), number("0,173"), number(2 + 1e-17j), number(ct.tf([6], [3]))
    (0.173, 0.173, 2.0, 2.0)
    >>> number("2 s")
    Traceback (most recent call last):
    ...
    nrdob_course.exercises.reading.UnreadableError: a number without a unit is asked for, not '2 s'
    """
    if isinstance(given, str):
        return _spelled(given)
    if isinstance(given, ct.TransferFunction | ct.StateSpace):
        num, den = as_fraction(given, "it", proper=False)
        if num.size == den.size == 1:
            return float(num[0] / den[0])
        raise UnreadableError("a number is asked for; this is a transfer function")
    if isinstance(given, np.polynomial.Polynomial | np.poly1d):
        if given.degree() if isinstance(given, np.polynomial.Polynomial) else given.order:
            raise UnreadableError("a number is asked for; this is a polynomial")
        return number(given(0))
    if isinstance(given, bool | np.bool_):
        raise UnreadableError(f"a number is asked for; this is {given}")
    if callable(given) and not isinstance(given, np.generic):
        words = "a number is asked for; this is a function: call it, with its brackets"
        raise UnreadableError(words)
    if isinstance(given, dict | set | frozenset | LowPassFilter):
        raise UnreadableError(f"a number is asked for; this is a {type(given).__name__}")
    if isinstance(given, Sequence) or np.ndim(given):
        held = list(given)
        if len(held) != 1:
            raise UnreadableError(f"one number is asked for; these are {len(held)}")
        return number(held[0])
    return _real(given)


def _real(given: Any) -> float:
    try:
        value = complex(given)
    except (TypeError, ValueError, OverflowError):
        raise UnreadableError(f"a number is asked for; this is a {type(given).__name__}") from None
    if abs(value.imag) > max(REAL * abs(value), NOTHING):
        words = f"this one has the imaginary part {value.imag:.3g}"
        raise UnreadableError(f"a real number is asked for; {words}")
    if LARGEST < abs(value.real) < inf:
        raise UnreadableError(f"a number of up to {LARGEST:g} is asked for; this is {value.real:g}")
    return value.real


def _spelled(text: str) -> float:
    try:
        value = complex(text.strip().replace("−", "-").replace(",", "."))
    except ValueError:
        raise UnreadableError(f"a number without a unit is asked for, not {text[:40]!r}") from None
    return _real(value)


def whole(given: Any) -> int:
    """Read a whole number.

    >>> whole(3.0), whole("3")
    (3, 3)
    """
    value = number(given)
    if not np.isfinite(value) or abs(value - round(value)) > REAL * max(1.0, abs(value)):
        raise UnreadableError(f"a whole number is asked for; this is {value:g}")
    return round(value)


def listed(given: Any, names: str = "") -> Any:
    """Take a dictionary with these keys, or a text of several entries, for the list that it means.

    >>> listed({"Z": 2, "N": 1, "P": 1}, "N, P, Z"), listed("(-2, 3, 1)"), listed("0,5; 2")
    ([1, 1, 2], ['-2', '3', '1'], ['0,5', '2'])
    """
    if isinstance(given, Mapping):
        keys = {str(key).strip().casefold(): key for key in given}
        wanted = [name.strip().casefold() for name in names.split(",")] if names else []
        if wanted and keys.keys() == set(wanted):
            return [given[keys[name]] for name in wanted]
    if isinstance(given, str):
        text = given.strip().strip("()[]{}").strip()
        for separator in (";", ", ", ",", None):
            entries = [entry.strip() for entry in text.split(separator)]
            if len(entries) > 1 and all(map(NUMERAL.fullmatch, entries)):
                return entries
    return given


NUMERAL = re.compile(r"[+\-−]?(\d+([.,]\d*)?|[.,]\d+|inf|nan)([eE][+\-−]?\d+)?j?")


def numbers(given: Any, names: str = "", gaps: bool = False) -> FloatArray:
    """Read several real numbers; as many as there are names, "low, high, angle", if there are any.

    With gaps an entry that is no number is read as nan, because each counts by itself.

    >>> numbers((1, "2", [3.0]), "N, P, Z"), numbers([1.5, None], gaps=True)
    (array([1., 2., 3.]), array([1.5, nan]))
    """
    given = listed(given, names)
    count = len(names.split(",")) if names else 0
    wanted = f"{count} numbers are asked for, ({names})" if names else "numbers are asked for"
    if not isinstance(given, Iterable) or isinstance(given, UNORDERED):
        raise UnreadableError(f"{wanted}, in a list or a tuple; this is a {type(given).__name__}")
    held = list(np.ravel(given) if isinstance(given, np.ndarray) else given)
    if names and len(held) != count:
        raise UnreadableError(f"{wanted}; these are {len(held)}")
    read = [_or_nan(value) for value in held] if gaps else list(map(number, held))
    if held and gaps and np.isnan(read).all():
        read = list(map(number, held))  # none of them can be read: say why
    return np.array(read, dtype=float)


def _or_nan(value: Any) -> float:
    try:
        return number(value)
    except UnreadableError:
        return nan


def things(given: Any, wanted: str, counts: tuple[int, ...] = (2,), names: str = "") -> list[Any]:
    """Take apart what holds several things, in a list, a tuple, a dictionary or the like.

    >>> things(np.array([2, 0.03]), "two things are asked for")
    [2.0, 0.03]
    """
    given = listed(given, names)
    if isinstance(given, Iterable) and not isinstance(given, UNORDERED):
        held = given.tolist() if isinstance(given, np.ndarray) else list(given)
        if isinstance(held, list) and len(held) in counts:
            return held
    raise UnreadableError(wanted)


def polynomial(given: Any) -> FloatArray:
    """Read the real coefficients of a polynomial, descending, without zeros in front.

    >>> polynomial(np.poly1d([1, 3])), polynomial(np.polynomial.Polynomial([3, 1]))
    (array([1., 3.]), array([1., 3.]))
    """
    given = listed(given)
    if isinstance(given, np.poly1d):
        given = given.coeffs
    elif isinstance(given, np.polynomial.Polynomial):
        given = given.convert().coef[::-1]
    elif isinstance(given, ct.TransferFunction):
        num, den = as_fraction(given, "it", proper=False)
        if den.size > 1:
            words = "a polynomial is asked for; this is a fraction: give its numerator"
            raise UnreadableError(words)
        given = num / den[0]
    elif not isinstance(given, Iterable) or isinstance(given, UNORDERED):
        words = "coefficients are asked for, in a list"
        raise UnreadableError(f"{words}; this is a {type(given).__name__}")
    p = np.array(list(np.ravel(np.asarray(given, dtype=object))), dtype=object)
    try:
        values = p.astype(complex)
    except (TypeError, ValueError):
        values = numbers(p).astype(complex)
    if np.abs(values.imag).max(initial=0) > REAL * np.abs(values).max(initial=0):
        raise UnreadableError("coefficients are asked for, which are real; these look like roots")
    if np.abs(values.real).max(initial=0) > LARGEST:
        raise UnreadableError(f"coefficients of up to {LARGEST:g} are asked for")
    used = np.flatnonzero(np.abs(values) > 1e-12 * np.abs(values).max(initial=0))
    return values.real[used[0] :] if used.size else np.zeros(1)


def block(given: Any) -> Any:
    """Read a transfer function, also as numerator and denominator; a dead time stays with it.

    >>> block(([1], [1, 2])).poles().real
    array([-2.])
    """
    if isinstance(given, DelayedTransferFunction | ct.TransferFunction):
        return given
    if isinstance(given, LowPassFilter):
        return ct.tf([1.0], given.den)
    try:
        if isinstance(given, tuple | list) and len(given) == 2:
            num, den = map(polynomial, map(np.atleast_1d, given))
        else:
            num, den = as_fraction(given, "it", proper=False)
    except (TypeError, ValueError) as error:
        if isinstance(error, UnreadableError):
            raise
        raise UnreadableError(f"a transfer function is asked for: {error}") from None
    return ct.tf(num, den)


def lowpass(given: Any) -> LowPassFilter:
    """Read a filter of the family, given as such or as (λ, n).

    >>> lowpass((0.5, 2.0))
    LowPassFilter(time_constant=0.5, order=2)
    """
    if isinstance(given, LowPassFilter):
        return given
    if isinstance(given, tuple | list) and len(given) == 2:
        try:
            return LowPassFilter(number(given[0]), whole(given[1]))
        except ValueError as error:
            raise UnreadableError(str(error)) from None
    raise UnreadableError("a filter is asked for, LowPassFilter(λ, n)")
