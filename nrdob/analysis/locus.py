r"""The frequency response of a loop, how it moves, and where something happens to it.

Everything comes from :math:`\log L(j\omega)`, the sum of its factors' logarithms, and from
:math:`\Lambda = L'/L`, the sum of their :math:`p'/p`. Nothing is multiplied out: a pole and a zero
that almost cancel keep their places, and no unit of time or gain makes a product overflow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..diagram import Quotient
from ..numerics import ComplexArray, FloatArray, IntArray, bisect, exponential_rest, side

__all__ = ["Locus", "Notable", "notable_frequencies"]

NOISE = 1e-13
"""What is below it may be rounding, and has no sign."""

CROSSING = 1e-3
"""How well a crossing found must be one: at a pole on the axis the side of L changes by a jump."""

SHALLOW = 0.5
"""Minima of ``log |1 + L|`` that begin so far above the least value are not looked into."""

SIZE, SIDE, RETREAT, SIZE_SLOPE, SIDE_SLOPE, DISTANCE = range(6)
r"""Rows of `Locus.motion`: :math:`\log|L|`, zero at a gain crossover; :math:`\sin\arg L`, zero
where L is real; :math:`d\log|1 + L|/d\log\omega`, zero and rising where L is nearest to -1; the
derivatives of the first two with respect to :math:`\log\omega`; :math:`\log|1 + L|`."""


class Notable(NamedTuple):
    """Frequencies in rad/s at which something happens to a loop gain.

    Attributes
    ----------
    gain : array of float
        Where ``|L|`` = 1.
    phase : array of float
        Where L is real.
    nearest : array of float
        Where ``|1 + L|`` is smallest.
    """

    gain: FloatArray
    phase: FloatArray
    nearest: FloatArray


class Locus:
    """A loop gain on the imaginary axis.

    Parameters
    ----------
    loop : Quotient
        The loop gain L.
    """

    def __init__(self, loop: Quotient) -> None:
        factors = (*loop.num, *loop.den)
        self._signs = np.repeat([1.0, -1.0], [len(loop.num), len(loop.den)])
        delayed = [(i, *term) for i, factor in enumerate(factors) for term in factor.delayed]
        self._delayed = np.array([i for i, _, _ in delayed], dtype=np.intp)
        self._delays = np.array([delay for _, _, delay in delayed])[:, None]
        # Near a zero at s = 0 that the terms have only together, what counts is the rest of
        # exp(-sT) behind its Taylor polynomial.
        expanded = [factor.expanded for factor in factors]
        self._behind = np.array([expanded[i][1] for i, _, _ in delayed], dtype=np.intp)
        self._divided = float(self._signs @ [factor.divided for factor in factors])
        rows = [row for row, _ in expanded]
        rows += [r for _, r, _ in delayed]
        # p(s) = even(s²) + s odd(s²): on the axis s² is real, so that half the work is left.
        length = max(row.size for row in rows) // 2 + 1
        table = np.zeros((length, 2, len(rows)))
        for i, row in enumerate(rows):
            for j in (0, 1):
                part = row[::-1][j::2]
                table[length - part.size :, j, i] = part[::-1]
        self._table = table[..., None]

    def log(self, omega: FloatArray) -> ComplexArray:
        """Evaluate log L(jω), -inf at a zero, inf at a pole.

        Parameters
        ----------
        omega : array of float
            Frequencies in rad/s.
        """
        return self.log_and_slope(omega)[0]

    def motion(self, omega: FloatArray) -> FloatArray:
        """Evaluate what decides about margins: the rows named above.

        Parameters
        ----------
        omega : array of float
            Frequencies in rad/s, above 0.
        """
        log, slope = self.log_and_slope(omega)
        size, angle = log.real, log.imag
        with np.errstate(all="ignore"):
            inverse = np.exp(-np.clip(size, -700, 700) - 1j * angle)
            retreat = (slope / (1 + inverse)).real  # d log(1 + L) = L/(1 + L) d log L
            distance = size + np.log(np.abs(1 + inverse))
        rows = (size, np.sin(angle), retreat, slope.real, np.cos(angle) * slope.imag, distance)
        return np.stack(rows)

    def log_and_slope(self, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Evaluate log L(jω) and its derivative with respect to log ω.

        Parameters
        ----------
        omega : array of float
            Frequencies in rad/s.
        """
        square, s = -(omega**2), 1j * omega
        first, *others = self._table
        value = np.repeat(first, omega.size, axis=-1)
        slope = np.zeros_like(value)
        for coefficients in others:
            slope = slope * square + value
            value = value * square + coefficients
        p = value[0] + s * value[1]
        dp = value[1] + 2 * s * (slope[0] + s * slope[1])
        if self._delayed.size:
            count, wait = self._signs.size, -self._delays * s
            lag, slope_of_lag = np.empty_like(wait), np.empty_like(wait)
            for m in np.unique(self._behind).tolist():
                own = self._behind == m
                lag[own] = exponential_rest(wait[own], m)
                slope_of_lag[own] = exponential_rest(wait[own], max(m - 1, 0))
            slope_of_lag *= -self._delays
            late = p[count:] * lag, dp[count:] * lag + p[count:] * slope_of_lag
            p, dp = p[:count], dp[:count]
            for values, more in zip((p, dp), late, strict=True):
                np.add.at(values, self._delayed, more)
        with np.errstate(all="ignore"):
            log, slope = self._signs @ np.log(p), s * (self._signs @ (dp / p))
            if self._divided:
                log, slope = log - self._divided * np.log(s), slope - self._divided
            return log, slope


def notable_frequencies(locus: Locus, omega: FloatArray) -> Notable:
    """Find where something happens, starting from frequencies that show every turn.

    Parameters
    ----------
    locus : Locus
        The loop gain.
    omega : array of float
        Increasing, in rad/s, without 0.
    """
    motion = locus.motion(omega)
    # A function that first nears zero and then leaves it may have crossed it twice in between.
    hidden = [_between(motion[row], motion[row + SIZE_SLOPE]) for row in (SIZE, SIDE)]
    bottoms = _solved(locus, omega, (SIZE_SLOPE, SIDE_SLOPE), hidden)
    if bottoms[0].size + bottoms[1].size:
        omega = np.union1d(omega, np.concatenate(bottoms))
        motion = locus.motion(omega)
    brackets = [_changes(motion[row]) for row in (SIZE, SIDE, RETREAT)]
    distance = motion[DISTANCE]
    least = np.nanmin(distance, initial=np.inf) + SHALLOW
    low, high = brackets[RETREAT]
    deep = (motion[RETREAT, low] < 0) & (np.fmin(distance[low], distance[high]) < least)
    brackets[RETREAT] = low[deep], high[deep]
    found = _solved(locus, omega, (SIZE, SIDE, RETREAT), brackets)
    for row in (SIZE, SIDE):
        found[row] = found[row][np.abs(locus.motion(found[row])[row]) < CROSSING]
    return Notable(*found)


# Indices of the lower and upper ends of intervals.
Bracket = tuple[IntArray, IntArray]


def _changes(values: FloatArray) -> Bracket:
    """Intervals between significant values of different sides."""
    known = np.flatnonzero(np.abs(values) > NOISE)
    sides = side(values[known])
    where = np.flatnonzero(sides[:-1] != sides[1:])
    return known[where], known[where + 1]


def _between(values: FloatArray, slopes: FloatArray) -> Bracket:
    """Intervals between values of the same side in which a smaller one may lie."""
    sides = side(values)
    nearing = sides * slopes
    where = np.flatnonzero((sides[:-1] == sides[1:]) & (nearing[:-1] < 0) & (nearing[1:] > 0))
    return where, where + 1


def _solved(
    locus: Locus, omega: FloatArray, rows: tuple[int, ...], brackets: list[Bracket]
) -> list[FloatArray]:
    """Find the zeros of several rows of the motion, each in its brackets, all together."""
    sizes = [low.size for low, _ in brackets]
    row, each = np.repeat(rows, sizes), np.arange(sum(sizes))
    low, high = (omega[np.concatenate(ends)] for ends in zip(*brackets, strict=True))
    if not each.size:
        return [low for _ in rows]
    found = bisect(lambda w: locus.motion(w)[row, each], low, high)
    return np.split(found, np.cumsum(sizes)[:-1])
