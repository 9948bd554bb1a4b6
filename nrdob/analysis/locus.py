r"""The frequency response of loops, how it moves, and where something happens to it.

Everything comes from :math:`\log L(j\omega)`, the sum of its factors' logarithms, and from
:math:`\Lambda = L'/L`, the sum of their :math:`p'/p`. Nothing is multiplied out: a pole and a zero
that almost cancel keep their places, and no unit of time or gain makes a product overflow. Loops
that share factors are evaluated together, each factor once.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..diagram import Quotient
from ..numerics import (
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    QuasiPolynomial,
    exponential_rest,
    halley,
)

__all__ = ["Found", "Locus", "Notable", "factors_of", "notable_frequencies"]

NOISE = 1e-13  # what is below it may be rounding, and has no sign
CROSSING = 1e-3  # how well a crossing must be one: at a pole on the axis the side changes by a jump
STEEP = 1e12  # slope of log L over log ω beyond which a crossing is a pole or a zero on the axis
NEXT = 1e-3  # how far beside a frequency, against its neighbours, where a side is looked at
LEEWAY = 0.1  # by how much the logarithm of L may leave what it is at both ends of a stretch
SMALL = 0.5  # size of L, against 1 and its largest value, below which a delay's turns do not matter
CUTS = 8  # parts of a stretch in which a minimum and a maximum may hide together

LAST_STEP = 1e-14  # how exactly a zero is found, against its bracket

VANISHED = 1e-290  # in place of 0, the value of a factor at a root on the axis

SIZE, SIDE, RETREAT, DISK_RETREAT, SIZE_SLOPE, SIDE_SLOPE, DISTANCE, DISK, COSINE = range(9)
r"""Rows of `Locus.motion`: :math:`\log|L|`, zero at a gain crossover; :math:`\sin\arg L`, zero
where L is real; :math:`d\log|1 + L|/d\log\omega`, zero and rising where L is nearest to -1; the
same of :math:`|(1 + L)/(1 - L)|`; the derivatives of the first two with respect to
:math:`\log\omega`; :math:`\log|1 + L|`; :math:`\log|(1 + L)/(1 - L)|`; the cosine of the angle."""


class Found(NamedTuple):
    """Increasing frequencies of one kind, in rad/s, and L there."""

    omega: FloatArray
    L: ComplexArray


class Notable(NamedTuple):
    """Where ``|L|`` = 1, L is real, and ``|1 + L|`` and ``|(1 + L)/(1 - L)|`` are smallest."""

    gain: Found
    phase: Found
    nearest: Found
    disk: Found


class Locus:
    """Loop gains on the imaginary axis; a factor that several share is evaluated once.

    Parameters
    ----------
    *loops : Quotient
    """

    def __init__(self, *loops: Quotient) -> None:
        self.count, factors = len(loops), factors_of(*loops)
        above = np.array([[loop.num.count(p) for p in factors] for loop in loops], dtype=float)
        below = np.array([[loop.den.count(p) for p in factors] for loop in loops], dtype=float)
        self._signs: FloatArray = above - below
        self._above: FloatArray = np.minimum(above, 1.0)
        delayed = [(i, *term) for i, factor in enumerate(factors) for term in factor.delayed]
        self._delayed = np.array([i for i, _, _ in delayed], dtype=np.intp)
        self._delays = np.array([delay for _, _, delay in delayed])[:, None]
        # Near a zero at s = 0 that the terms have only together, what counts is the rest of
        # exp(-sT) behind its Taylor polynomial.
        expanded = [factor.expanded for factor in factors]
        self._behind = np.array([expanded[i][1] for i, _, _ in delayed], dtype=np.intp)
        self._complex_signs = self._signs.astype(complex)
        self._divided = self._signs @ [float(factor.divided) for factor in factors]
        self._any_divided = bool(self._divided.any())
        rows = [row for row, _ in expanded]
        rows += [r for _, r, _ in delayed]
        # p(s) = even(s²) + s odd(s²): on the axis s² is real, so that half the work is left.
        length = max(row.size for row in rows) // 2 + 1
        ascending = np.zeros((len(rows), 2 * length))
        for line, row in zip(ascending, rows, strict=True):
            line[: row.size] = row[::-1]
        parts = ascending.reshape(len(rows), length, 2)[:, ::-1]
        self._table = np.ascontiguousarray(parts.transpose(1, 2, 0))[..., None]

    def values(self, omega: FloatArray) -> ComplexArray:
        """Evaluate L(jω), shape (loops, N), zero and infinite at roots on the axis.

        Parameters
        ----------
        omega : (N,) array of float
            In rad/s.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(np.exp(self.log_and_slope(omega)[0]))

    def motion(self, omega: FloatArray, loop: IntArray | None = None) -> FloatArray:
        """Evaluate what decides about margins, the rows named above: shape (rows, loops, N).

        Parameters
        ----------
        omega : (N,) array of float
            In rad/s, above 0.
        loop : (N,) array of int, optional
            The one loop that is asked for at each frequency: then the shape is (rows, N).
        """
        log, slope = self.log_and_slope(omega)
        if loop is not None:
            log, slope = (part[loop, np.arange(loop.size)] for part in (log, slope))
        size, angle = log.real, log.imag
        rows, z = np.empty((9, *log.shape)), np.empty_like(log)
        with np.errstate(all="ignore"):
            cosine, sine = np.cos(angle), np.sin(angle)
            # L or 1/L, whichever is not above 1.
            large, smaller = size > 0, np.exp(-np.abs(size))
            z.real, z.imag = smaller * cosine, smaller * np.where(large, -sine, sine)
            above, below = 1 + z, 1 - z
            away = slope / above  # d log(1 + L) = L/(1 + L) d log L
            turned = 2 * away * z / below
            distance = np.log(np.abs(above))
            rows[SIZE], rows[SIDE], rows[COSINE] = size, sine, cosine
            rows[RETREAT] = np.where(large, away, away * z).real
            rows[DISK_RETREAT] = np.where(large, -turned, turned).real
            rows[SIZE_SLOPE], rows[SIDE_SLOPE] = slope.real, cosine * slope.imag
            rows[DISTANCE] = distance + np.where(large, size, 0.0)
            rows[DISK] = distance - np.log(np.abs(below))
        return rows

    def reach(self, omega: FloatArray) -> FloatArray:
        """Evaluate the logarithm of what the size of L can be whatever its numerator's delays are.

        Parameters
        ----------
        omega : (N,) array of float
            In rad/s.
        """
        rows, count = np.abs(self._rows(omega)[0]), self._signs.shape[1]
        size = np.abs(self._factors(omega)[0])
        largest = rows[:count].copy()
        np.add.at(largest, self._delayed, rows[count:])
        more = np.log(np.maximum(largest, size) / size)
        return self.log_and_slope(omega)[0].real + self._above @ more

    def log_and_slope(self, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Evaluate log L(jω) and its derivative with respect to log ω, shapes (loops, N).

        Parameters
        ----------
        omega : (N,) array of float
            In rad/s.
        """
        p, dp = self._factors(omega)
        s = 1j * omega
        with np.errstate(all="ignore"):
            log: ComplexArray = self._complex_signs @ np.log(p)
            slope: ComplexArray = s * (self._complex_signs @ (dp / p))
            if self._any_divided:
                log = log - self._divided[:, None] * np.log(s)
                slope = slope - self._divided[:, None]
            return log, slope

    def _factors(self, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Values of the factors and their derivatives with respect to s, none of them 0."""
        p, dp = self._rows(omega)
        if self._delayed.size:
            count, wait = self._signs.shape[1], -self._delays * (1j * omega)
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
        if not p.all():
            p[p == 0] = VANISHED
        return p, dp

    def _rows(self, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Values and derivatives of the factors' polynomials, without dead times."""
        square, s = -omega * omega, 1j * omega
        first, *others = self._table
        value = np.repeat(first, omega.size, axis=-1)
        slope = np.zeros_like(value)
        for k, coefficients in enumerate(others):
            if k:
                slope *= square
            slope += value
            value *= square
            value += coefficients
        p: ComplexArray = value[0] + s * value[1]
        return p, value[1] + 2 * s * (slope[0] + s * slope[1])


def factors_of(*loops: Quotient) -> list[QuasiPolynomial]:
    """List the factors of loop gains, each object once."""
    return list({id(factor): factor for loop in loops for factor in loop.num + loop.den}.values())


def notable_frequencies(
    locus: Locus, omega: FloatArray, last: FloatArray | float = np.inf
) -> list[Notable]:
    """Find where something happens, starting from frequencies between which log L bends little.

    Parameters
    ----------
    locus : Locus
    omega : (N,) array of float
        Increasing, in rad/s, without 0.
    last : float or (loops,) array of float
        Frequency up to which each loop is followed.
    """
    last = np.broadcast_to(np.asarray(last, dtype=float), locus.count)

    def followed(omega: FloatArray) -> FloatArray:
        motion = locus.motion(omega)
        if omega.max() > last.min():
            motion[:, omega > last[:, None]] = np.nan
        return motion

    def joined(
        omega: FloatArray, motion: FloatArray, more: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        if not more.size:
            return omega, motion
        every, first = np.unique(np.concatenate([omega, more]), return_index=True)
        return every, np.concatenate([motion, followed(more)], axis=-1)[..., first]

    motion = followed(omega)
    omega, motion = joined(omega, motion, _beside(omega, motion))
    omega, motion = joined(omega, motion, _hidden(locus, omega, motion))
    brackets = _relevant(motion, _changes(motion[: DISK_RETREAT + 1]), np.isfinite(last))
    row, loop, _, _ = brackets
    solved = _solved(locus, omega, motion, brackets)
    each = np.arange(solved.size)
    log, slope = (part[loop, each] for part in locus.log_and_slope(solved))
    zero = np.where(row == SIZE, log.real, np.sin(log.imag))
    kept = (np.abs(zero) < CROSSING) & (np.abs(slope) < STEEP) | (row >= RETREAT)
    with np.errstate(all="ignore"):
        value = np.exp(log)
    row, loop, solved, value = row[kept], loop[kept], solved[kept], value[kept]
    # Brackets come in the order of rows, and in each in that of loops.
    ends = np.searchsorted(row * locus.count + loop, np.arange(4 * locus.count + 1)).tolist()
    parts = [Found(solved[a:b], value[a:b]) for a, b in pairwise(ends)]
    return [Notable(*parts[i :: locus.count]) for i in range(locus.count)]


# Row, loop, and the indices of the lower and upper ends of intervals.
Brackets = tuple[IntArray, IntArray, IntArray, IntArray]


def _changes(values: FloatArray) -> Brackets:
    """Intervals between significant values of different sides; rows, loops and places are axes."""
    _, loops, count = values.shape
    flat = values.ravel()
    with np.errstate(invalid="ignore"):
        known = np.flatnonzero(np.abs(flat) > NOISE)
    positive, curve = flat[known] >= 0, known // count
    changed = (positive[1:] != positive[:-1]) & (curve[1:] == curve[:-1])
    curve, low, high = curve[1:][changed], known[:-1][changed], known[1:][changed]
    return curve // loops, curve % loops, low % count, high % count


def _relevant(motion: FloatArray, brackets: Brackets, late: BoolArray) -> Brackets:
    """Choose the intervals in which something may happen that decides about a margin."""
    row, loop, low, high = brackets
    sizes = motion[SIZE, loop, low], motion[SIZE, loop, high]
    smallest, largest = np.fmin(*sizes), np.fmax(*sizes)
    negative = motion[COSINE, loop, low] < 0, motion[COSINE, loop, high] < 0
    kept = (row != SIDE) | negative[0] | negative[1]
    if late.any():
        # Of a loop gain that a dead time turns for ever the largest small crossing counts.
        certain = np.full(late.size, -np.inf)
        sure = (row == SIDE) & negative[0] & negative[1] & (largest < 0)
        np.maximum.at(certain, loop[sure], smallest[sure])
        floor = np.fmin(np.fmax.reduce(motion[SIZE], axis=-1, initial=-np.inf), 0.0) + np.log(SMALL)
        small = late[loop] & (largest + LEEWAY < np.fmin(floor, certain)[loop])
        kept &= (row != SIDE) | ~small
    towards, known = motion[row, loop, low] < 0, _known(motion)[row - RETREAT, loop]
    kept &= (row < RETREAT) | (towards & (_least(smallest, largest, row == DISK_RETREAT) < known))
    return row[kept], loop[kept], low[kept], high[kept]


def _known(motion: FloatArray) -> FloatArray:
    """Smallest values of the two distances on the frequencies at hand."""
    return np.asarray(np.exp(np.fmin.reduce(motion[DISTANCE : DISK + 1], axis=-1, initial=np.inf)))


def _least(smallest: FloatArray, largest: FloatArray, disk: BoolArray | bool) -> FloatArray:
    """Bound ``|1 + L|``, or ``|(1 + L)/(1 - L)|``, from below by the size of L in a stretch."""
    size = np.exp(np.minimum(np.maximum(smallest - LEEWAY, 0.0), largest + LEEWAY))
    return np.asarray(np.abs(1 - size) / np.where(disk, 1 + size, 1.0))


def _beside(omega: FloatArray, motion: FloatArray) -> FloatArray:
    """Frequencies on both sides of one at which something happens, where there is no side."""
    at = np.flatnonzero((np.abs(motion[: DISK_RETREAT + 1]) <= NOISE).any(axis=(0, 1)))
    at = at[(at > 0) & (at < omega.size - 1)]
    width = NEXT * np.minimum(omega[at] - omega[at - 1], omega[at + 1] - omega[at])
    return np.concatenate([omega[at] - width, omega[at] + width])


def _hidden(locus: Locus, omega: FloatArray, motion: FloatArray) -> FloatArray:
    """Frequencies that must be looked at, too, because two zeros may hide between neighbours."""
    found = []
    # A function that first nears zero and then leaves it may have crossed it twice in between.
    value, slope = motion[: SIDE + 1], motion[SIZE_SLOPE : SIDE_SLOPE + 1]
    with np.errstate(all="ignore"):
        log, leaves = np.log(omega), value * slope
        width = log[1:] - log[:-1]
        dips = (leaves[..., :-1] < 0) & (leaves[..., 1:] > 0)
        if dips.any():
            far = np.abs(value / slope) / 2
            dips &= (value[..., :-1] >= 0) == (value[..., 1:] >= 0)
            dips &= (far[..., :-1] < width) & (far[..., 1:] < width)
            row, loop, low = np.nonzero(dips)
            found.append(_solved(locus, omega, motion, (row + SIZE_SLOPE, loop, low, low + 1)))
        # The parabola through the slopes at both ends, of which the mean slope is known, too, may
        # have another sign in the middle: then a maximum hides with a minimum.
        slope, value = motion[RETREAT : DISK_RETREAT + 1], motion[DISTANCE : DISK + 1]
        before, after = slope[..., :-1], slope[..., 1:]
        mean = (before + after) / 2
        middle = (1.5 * (value[..., 1:] - value[..., :-1]) / width - mean / 2) * mean
        pairs = (middle < 0.1 * mean * mean) & (before * after > 0)
        if pairs.any():
            size = motion[SIZE, :, :-1], motion[SIZE, :, 1:]
            bounds = _least(np.fmin(*size), np.fmax(*size), np.array([[[False]], [[True]]]))
            near = pairs & (bounds < _known(motion)[..., None])
            low = np.flatnonzero(near.any(axis=(0, 1)))
            parts = np.arange(1, CUTS) / CUTS
            found.append((omega[low, None] + np.diff(omega)[low, None] * parts).ravel())
    return np.concatenate(found) if found else np.empty(0)


def _solved(locus: Locus, omega: FloatArray, motion: FloatArray, at: Brackets) -> FloatArray:
    """Find the zeros of rows of the motion, each in its bracket, by Halley's steps."""
    row, loop, low, high = at
    if not row.size:
        return omega[low]
    each, rows, loops = np.arange(3 * row.size), np.tile(row, 3), np.tile(loop, 3)
    first, last = motion[row, loop, low], motion[row, loop, high]
    upwards = np.where(first < 0, 1.0, -1.0)
    left, right = omega[low], omega[high]

    def value(omega: FloatArray) -> FloatArray:
        found = locus.motion(omega.ravel(), loops)[rows, each]
        return upwards * found.reshape(omega.shape)

    with np.errstate(all="ignore"):
        start = left * (right / left) ** _guessed(motion, omega, at, first, last)
    start = np.where(np.isfinite(start), start, (left + right) / 2)
    return halley(value, left, right, start, LAST_STEP * (right - left))


def _guessed(
    motion: FloatArray, omega: FloatArray, at: Brackets, first: FloatArray, last: FloatArray
) -> FloatArray:
    """Guess zeros as parts of their brackets, by parabolas over log ω."""
    row, loop, low, high = at
    other = np.minimum(row + SIZE_SLOPE, DISK)
    a, b = motion[other, loop, low], motion[other, loop, high]
    width = np.log(omega[high] / omega[low])
    mean = (first + last) / 2
    middle = np.where(row < RETREAT, mean + width * (a - b) / 8, 1.5 * (b - a) / width - mean / 2)
    middle = np.where(row < SIZE_SLOPE, middle, mean)
    # first + t slope + t² bend, its zero between 0 and 1 in the form that does not cancel.
    bend, slope = 2 * (first + last) - 4 * middle, last - first
    slope = slope - bend
    root = np.sqrt(slope**2 - 4 * bend * first)
    return np.asarray(-2 * first / (slope + np.where(last > first, root, -root)))
