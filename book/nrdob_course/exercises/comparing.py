"""Compare answers: to four digits, as read off a figure, or as rounded."""

from collections.abc import Iterable, Mapping
from math import log
from typing import Any

import numpy as np

from nrdob.diagram import LowPassFilter

__all__ = ["FOUR_DIGITS", "LEEWAY", "READING", "near", "rounds", "same", "unlike"]

FOUR_DIGITS = 6e-4
"""By how much a number may differ that is given to four digits, as a share of it."""

LEEWAY = 1 + 6e-3
"""By what factor a limit may be exceeded by what is given to three digits."""

READING = 0.08
"""How far a number that is read off a figure may be from the true one."""


def same(expected: Any, got: Any, rtol: float = FOUR_DIGITS) -> bool:
    """Compare numbers, arrays, lists, tuples, booleans or texts, numbers to four digits.

    What is zero may be off by rounding, measured by the largest of the numbers compared.

    >>> same((2, "stable"), [2.00001, "stable"])
    True
    >>> same(1, True)
    False
    """
    if isinstance(expected, bool | np.bool_) != isinstance(got, bool | np.bool_):
        return False
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


def unlike(right: Iterable[Any], got: Iterable[Any], lacks: Mapping[str, str]) -> dict[str, str]:
    """Compare an answer part by part: what each lacks, by its name, is empty if it is right.

    >>> unlike((3, 0.5), (3, 0.6), {"m": "not the window", "delay": "not its delay"})
    {'m': '', 'delay': 'not its delay'}
    """
    each = zip(lacks.items(), right, got, strict=True)
    return {name: "" if same(true, given) else lack for (name, lack), true, given in each}


def _numbers(value: Any) -> Any:
    """Make an array of numbers; texts and booleans, which numpy would convert, are none."""
    array = np.asarray(value)
    if array.dtype.kind in "USb":
        raise TypeError("no numbers")
    return array.astype(complex)


def near(expected: float, got: Any, tolerance: float) -> bool:
    """Tell whether a number is right that was read off a figure: nearly the same share.

    >>> near(2.0, 2.1, 0.08), near(2.0, 2.2, 0.08), near(2.0, -2.0, 0.08)
    (True, False, False)
    """
    share = float(got) / expected
    return share > 0 and abs(log(share)) < tolerance


def rounds(right: Any, got: Any) -> bool:
    """Tell whether an answer is a right one with fewer digits, rounded or cut off.

    Numbers are so if they have few digits, and are off by less than one in the last of them and by
    at most 5 %; of filters, the time constants. What is right to four digits counts, too.

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
