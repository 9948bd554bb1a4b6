"""Where real functions of frequency change sign or are smallest, many at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .blocks import FloatArray

Function = Callable[[FloatArray], FloatArray]


def side(values: FloatArray) -> FloatArray:
    """Sign of each value, a zero counted as positive so that none falls between two sides."""
    return np.where(values >= 0, 1.0, -1.0)


def bisect(function: Function, low: FloatArray, high: FloatArray) -> FloatArray:
    """Find a zero between each `low` and `high`, on which the function's sides differ."""
    sign = side(function(low))
    for _ in range(52):
        middle = (low + high) / 2
        same = side(function(middle)) == sign
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return (low + high) / 2


def golden(function: Function, low: FloatArray, high: FloatArray) -> FloatArray:
    """Find the minimum between each `low` and `high` by golden section."""
    ratio = (5**0.5 - 1) / 2
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    at_left, at_right = function(left), function(right)
    for _ in range(40):
        keep_left = at_left < at_right
        low, high = np.where(keep_left, low, left), np.where(keep_left, right, high)
        new = np.where(keep_left, high - ratio * (high - low), low + ratio * (high - low))
        at_new = function(new)
        left, right = np.where(keep_left, new, right), np.where(keep_left, left, new)
        at_left, at_right = (
            np.where(keep_left, at_new, at_right),
            np.where(keep_left, at_left, at_new),
        )
    return (low + high) / 2


def zeros(function: Function, omega: FloatArray) -> FloatArray:
    """Bisect all sign changes of a function on a grid, and those that hide between its points."""
    signs = side(values := function(omega))
    # A dip towards zero may hide two crossings between neighbours of the same sign.
    inner, sign = np.abs(values[1:-1]), signs[1:-1]
    dips = (inner <= np.abs(values[:-2])) & (inner <= np.abs(values[2:]))
    dips &= (sign == signs[:-2]) & (sign == signs[2:])
    where = 1 + np.flatnonzero(dips)
    bottom = golden(lambda w: signs[where] * function(w), omega[where - 1], omega[where + 1])
    omega = np.union1d(omega, bottom)
    signs = side(function(omega))
    where = np.flatnonzero(signs[:-1] * signs[1:] < 0)
    return bisect(function, omega[where], omega[where + 1])


def minima(function: Function, omega: FloatArray) -> FloatArray:
    """Refine the deepest minima of a function on a grid, all together."""
    values = function(omega)
    inner = values[1:-1]
    # On a grid that follows every turn the least value lies in one of the deepest dips.
    dips = (inner <= values[:-2]) & (inner <= values[2:]) & (inner <= 1.5 * values.min())
    where = 1 + np.flatnonzero(dips)
    return golden(function, omega[where - 1], omega[where + 1])
