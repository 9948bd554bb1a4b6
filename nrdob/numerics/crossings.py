"""Where real functions of frequency change sign or are smallest, many at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .arrays import FloatArray

__all__ = ["bisect", "golden", "halley", "side", "zeros"]

Function = Callable[[FloatArray], FloatArray]

EPS = float(np.finfo(float).eps)

PART, LEAST = 1e-4, 1e-7
"""Over which part of the last step, and at least of the bracket, derivatives are taken."""


def side(values: FloatArray) -> FloatArray:
    """Sign of each value, a zero counted as positive so that none falls between two sides.

    Parameters
    ----------
    values : array of float
    """
    return np.where(values >= 0, 1.0, -1.0)


def bisect(
    function: Function, low: FloatArray, high: FloatArray, within: float = 0.0
) -> FloatArray:
    """Find a zero between each `low` and `high`, on which the function's sides differ.

    Brackets shrink by inverse quadratic interpolation where that is safe, else by halves
    (Chandrupatla, Adv. Eng. Software 28, 1997, 145-149): on smooth functions about ten evaluations
    reach the last bits, on jumps as many as halving needs.

    Parameters
    ----------
    function : callable
        Takes an array of the brackets' shape, and gives one.
    low, high : array of float, of one shape
    within : float
        Width at which a bracket is narrow enough.
    """
    a, b = np.array(high, dtype=float), np.array(low, dtype=float)
    at_a, at_b = function(a), function(b)
    width = np.abs(a - b)
    t = np.full(a.shape, 0.5)
    for _ in range(120):
        x = a + t * (b - a)
        at_x = function(x)
        same = side(at_x) == side(at_a)
        # The last point but one of the bracket shapes the parabola.
        c, at_c = np.where(same, a, b), np.where(same, at_a, at_b)
        b, at_b = np.where(same, b, a), np.where(same, at_b, at_a)
        a, at_a = x, at_x
        best = np.where(np.abs(at_a) < np.abs(at_b), a, b)
        gap = np.abs(b - a)
        tolerance = np.maximum(2 * EPS * np.abs(best) + EPS * width, within)
        if np.all((gap <= tolerance) | (np.minimum(np.abs(at_a), np.abs(at_b)) == 0)):
            break
        with np.errstate(all="ignore"):  # what is not finite is halved
            xi, phi = (a - b) / (c - b), (at_a - at_b) / (at_c - at_b)
            smooth = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi)
            step = at_a / (at_b - at_a) * at_c / (at_b - at_c)
            step += (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b)
            least = np.minimum(tolerance / gap, 0.5)
        t = np.where(smooth & np.isfinite(step), np.clip(step, least, 1 - least), 0.5)
    return best


def halley(
    function: Function, low: FloatArray, high: FloatArray, start: FloatArray, within: FloatArray
) -> FloatArray:
    """Find a zero between each `low` and `high`, at which the function is below and above 0.

    By Halley's steps from `start`, each of which leaves about the cube of the last error; by halves
    where one would leave the bracket or is not half as long as the last. They end when the next
    ones are expected to be shorter than `within`.

    Parameters
    ----------
    function : callable
        Takes an array of shape (3, n), and gives one: derivatives are taken by differences.
    low, high, start, within : array of float, shape (n,)
    """
    x = np.minimum(np.maximum(start, np.minimum(low, high)), np.maximum(low, high))
    last = width = np.abs(high - low)
    for _ in range(120):
        h = np.maximum(PART * last, LEAST * width)
        value, before, behind = function(np.array([x, x - h, x + h]))
        below = value < 0
        low, high = np.where(below, x, low), np.where(below, high, x)
        with np.errstate(all="ignore"):  # what is not finite is halved
            step = -2 * h * value / (behind - before)
            step = step / (1 + step * (behind - 2 * value + before) / (behind - before) / h)
            safe = ((x + step - low) * (x + step - high) <= 0) & (np.abs(step) < last / 2)
        step = np.where(safe | (np.abs(step) <= within), step, (low + high) / 2 - x)
        x, before_last, last = x + step, last, np.abs(step)
        if (last**4 <= within * before_last**3).all():
            break
    return x


def golden(function: Function, low: FloatArray, high: FloatArray) -> FloatArray:
    """Find the minimum between each `low` and `high` by golden section.

    Parameters
    ----------
    function : callable
        Takes an array of the brackets' shape, and gives one.
    low, high : array of float, of one shape
    """
    ratio = (5**0.5 - 1) / 2
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    at_left, at_right = function(left), function(right)
    for _ in range(40):
        keep_left = at_left < at_right
        low, high = np.where(keep_left, low, left), np.where(keep_left, right, high)
        new = np.where(keep_left, high - ratio * (high - low), low + ratio * (high - low))
        at_new = function(new)
        left, right = np.where(keep_left, [new, left], [right, new])
        at_left, at_right = np.where(keep_left, [at_new, at_left], [at_right, at_new])
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
