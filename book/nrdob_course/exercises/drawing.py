"""Draw a case that fits, and keep what is found out about it."""

from collections.abc import Callable
from functools import lru_cache
from itertools import combinations
from typing import Any, TypeVar

import numpy as np

__all__ = ["apart", "draw", "either_sign", "few", "first_fitting", "fitting", "kept"]

T = TypeVar("T")

Drawing = Callable[[np.random.Generator], T]

kept = lru_cache(maxsize=512)
"""Keeps what a grader has found out about a case, by the case itself, not by its numbers."""


def few(value: float, digits: int = 2) -> float:
    """Round to a few significant digits, so that a case is short to print.

    >>> few(0.12345), few(1234.5, 3)
    (0.12, 1230.0)
    """
    return float(f"{value:.{digits}g}")


def draw(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number of two digits, evenly on a log scale."""
    return few(float(np.exp(rng.uniform(np.log(low), np.log(high)))))


def either_sign(rng: np.random.Generator) -> float:
    """Draw 1 or -1."""
    return float(rng.choice([-1, 1]))


def first_fitting(draw: Callable[[], T], fits: Callable[[T], bool], tries: int = 2000) -> T:
    """Draw until a case fits; a RuntimeError says that a generator has become too strict.

    >>> numbers = iter(range(10))
    >>> first_fitting(lambda: next(numbers), lambda n: n > 3)
    4
    """
    for _ in range(tries):
        if fits(case := draw()):
            return case
    raise RuntimeError(f"none of {tries} cases drawn fits")


def fitting(fits: Callable[[Any], bool]) -> Callable[[Drawing[T]], Drawing[T]]:
    """Make the decorated function draw until a case fits, see `first_fitting`."""
    return lambda draw: lambda rng: first_fitting(lambda: draw(rng), fits)


def apart(*values: Any, by: float = 0.02) -> bool:
    """Tell whether numbers, or tuples of numbers, differ from one another by more than a share.

    >>> apart(1.0, 1.5, -1.0), apart((1, 2), (1, 3)), apart(1.0, 1.01)
    (True, True, False)
    """
    pairs = combinations([np.asarray(value, dtype=float) for value in values], 2)
    return all(np.any(abs(a - b) > by * np.maximum(abs(a), abs(b))) for a, b in pairs)
