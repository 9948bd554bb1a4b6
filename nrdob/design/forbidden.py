r"""What a specification forbids at one frequency, as a range of :math:`x = \lambda\omega`.

The plant loop is :math:`L = R(j\omega)/D(x)`, where :math:`D(x) = (1 + jx)^n - 1` is one curve for
all plants. Its angle grows from 90° to n·90°, and its size, up to n = 12, from 0 to infinity: so
where L is real, or of size 1, or close to -1 follows from the inverse of that curve.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from math import asin, log, pi, radians
from typing import NamedTuple

import numpy as np

from ..numerics import ComplexArray, FloatArray, bisect, newton
from .slack import Specification

__all__ = ["Curve", "Forbidden", "Limit", "limits", "log_den_less_1"]

WIDEST, PER_E_FOLD = 46.0, 40
"""Range of ±ln x in which the curve D is tabulated, and how densely."""

NEWTON = 3
"""Steps from the table to the inverse of the angle, none wider than the table's."""

THIN = 1e-8
"""Half the angle that a whole range of λ is wide, where the phase of L does not depend on λ."""

ENOUGH = 1e-9
"""How closely ln x is found at the edges of what the sensitivity forbids."""

LARGEST = 300.0
"""Bound of ln|L|, far from all that is forbidden, so that nothing overflows."""


@dataclass(frozen=True, eq=False)
class Curve:
    """D(x) = (1 + jx)^n - 1 as a function of u = ln x, and its inverses.

    Attributes
    ----------
    order : int
        n.
    u : array of float
        Where it is tabulated.
    size, angle : array of float
        ln|D| and arg D, which grows from π/2 to nπ/2.
    """

    order: int
    u: FloatArray
    size: FloatArray
    angle: FloatArray

    @classmethod
    @cache
    def of(cls, order: int) -> Curve:
        """Tabulate the curve of one order."""
        u = np.linspace(-WIDEST, WIDEST, int(2 * WIDEST * PER_E_FOLD) + 1)
        slope = log_den_less_1(u, order)[1].real
        k = np.flatnonzero(np.diff(slope >= 0))
        turns = bisect(lambda u: log_den_less_1(u, order)[1].real, u[k], u[k + 1])
        u = np.union1d(u, turns)
        table = log_den_less_1(u, order)[0]
        return cls(order, u, table.real, table.imag)

    @property
    def ends(self) -> tuple[float, float]:
        """Angles of D for x = 0 and infinite x."""
        return pi / 2, self.order * pi / 2

    def at_angle(self, angle: FloatArray) -> FloatArray:
        """Return u where D has an angle, or the end of the table beyond the ends."""
        first, last = self.ends
        u = np.interp(angle, self.angle, self.u)
        for _ in range(NEWTON):
            value, slope = log_den_less_1(u, self.order)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = np.nan_to_num((angle - value.imag) / slope.imag)
            u = u + np.clip(step, -1 / PER_E_FOLD, 1 / PER_E_FOLD)
        return np.where(angle <= first, -WIDEST, np.where(angle >= last, WIDEST, u))

    def rising(self) -> Iterator[tuple[float, float, Callable[[FloatArray], FloatArray]]]:
        """Give the stretches of monotone size, one up to n = 12: their ends, and the inverse."""
        turns = 1 + np.flatnonzero(np.diff(np.sign(np.diff(self.size))))
        for first, last in zip([0, *turns], [*turns, self.u.size - 1], strict=True):
            size, u = self.size[first : last + 1], self.u[first : last + 1]
            size, u = (size, u) if size[0] < size[-1] else (size[::-1], u[::-1])

            yield float(size[0]), float(size[-1]), partial(self._at_size, size, u)

    def _at_size(self, size: FloatArray, u: FloatArray, wanted: FloatArray) -> FloatArray:
        """Return u where ln|D| has a value, on a stretch where it is tabulated as rising."""
        k = np.clip(np.searchsorted(size, wanted), 1, size.size - 1)
        return bisect(lambda u: log_den_less_1(u, self.order)[0].real - wanted, u[k - 1], u[k])


def log_den_less_1(u: FloatArray, order: int) -> tuple[ComplexArray, ComplexArray]:
    """Return ln D, its angle continued, and its derivative by u = ln x, accurate for every x."""
    x = np.exp(u)
    log_w = np.log1p(x * x) / 2 + 1j * np.arctan(x)
    less_1 = -np.expm1(-order * log_w)  # (D + 1 - 1)/(D + 1), on the right of the axis
    value = order * log_w + np.log(less_1)
    return value, order * 1j * x / ((1 + 1j * x) * less_1)


# What each limit forbids at one frequency.


class Forbidden(NamedTuple):
    """By how much anything is forbidden, negative where nothing is, and which range of u = ln(λω).

    The sign of `off` tells on which side of the middle of what is forbidden L passes. The edges of
    the range are found when they are asked for, for they are dear and the depth often is enough.
    """

    depth: FloatArray
    off: FloatArray
    edges: Callable[[], tuple[FloatArray, FloatArray]]


class Limit(NamedTuple):
    """One limit: half the angle around -1 in which it forbids anything, and what it forbids.

    What is `thick` covers a range of λ at each frequency.
    `forbids` takes ln|R| and the angle that D must have to turn L onto the negative real axis.
    """

    half_angle: float
    thick: bool
    forbids: Callable[[FloatArray, FloatArray], Forbidden]


def limits(order: int, specification: Specification) -> Iterator[Limit]:
    """Give each limit of a specification, for filters of one order."""
    curve = Curve.of(order)
    if specification.max_ms is not None:
        yield _sensitivity(curve, specification.max_ms)
    if specification.min_gm_db is not None:
        yield _gain_margin(curve, specification.min_gm_db * log(10) / 20)
    if specification.min_pm_deg is not None:
        yield from _phase_margin(curve, radians(specification.min_pm_deg))


def _gain_margin(curve: Curve, most: float) -> Limit:
    """Forbid L on the negative real axis with a size within exp(±most)."""
    first, last = curve.ends

    def forbids(size: FloatArray, angle: FloatArray) -> Forbidden:
        u = curve.at_angle(angle)
        off = size - log_den_less_1(u, curve.order)[0].real
        depth = np.minimum(most - np.abs(off), np.minimum(angle - first, last - angle))
        return Forbidden(depth, off, lambda: (u, u))

    def forbids_first_order(size: FloatArray, angle: FloatArray) -> Forbidden:
        # D = jx has but one angle: a whole range of x, at single frequencies.
        off = angle - first
        return Forbidden(THIN - np.abs(off), off, lambda: (size - most, size + most))

    return Limit(0.0, False, forbids if curve.order > 1 else forbids_first_order)


def _phase_margin(curve: Curve, most: float) -> Iterator[Limit]:
    """Forbid L on the unit circle within an angle of -1."""

    def forbids(
        stretch: tuple[float, float, Callable[[FloatArray], FloatArray]],
        size: FloatArray,
        angle: FloatArray,
    ) -> Forbidden:
        first, last, inverse = stretch
        u = inverse(size)
        off = angle - log_den_less_1(u, curve.order)[0].imag
        depth = np.minimum(most - np.abs(off), np.minimum(size - first, last - size))
        return Forbidden(depth, off, lambda: (u, u))

    for stretch in curve.rising():
        yield Limit(most, False, partial(forbids, stretch))


def _sensitivity(curve: Curve, max_ms: float) -> Limit:
    """Forbid L within 1/Ms of -1.

    Within half a turn ``|1 + L|`` has but one dip, and rises from it to both sides: this is seen
    for thousands of R and orders up to 30, not proved.
    """
    half_angle, radius = asin(1 / max_ms), 1 / max_ms

    def forbids(size: FloatArray, angle: FloatArray) -> Forbidden:
        ends = curve.at_angle(np.stack([angle - half_angle, angle + half_angle]))
        at_ends = _Distance.of(curve, ends, size, angle)
        u = np.where(at_ends.square[0] < at_ends.square[1], ends[0], ends[1])
        dips = (at_ends.slope[0] < 0) & (at_ends.slope[1] > 0)

        def rise(u: FloatArray) -> tuple[FloatArray, FloatArray]:
            there = _Distance.of(curve, u, size[dips], angle[dips])
            return there.slope, there.bend

        first, last = ends[:, dips]
        of_size_1 = np.interp(size[dips], curve.size, curve.u)
        u[dips] = newton(rise, first, last, of_size_1, ENOUGH**0.5)
        middle = _Distance.of(curve, u, size, angle)
        depth = 1 - max_ms * np.sqrt(middle.square)

        def edges() -> tuple[FloatArray, FloatArray]:
            within = depth > 0
            sizes, angles = size[within], angle[within]

            def beyond(u: FloatArray) -> tuple[FloatArray, FloatArray]:
                there = _Distance.of(curve, u, sizes, angles)
                return there.square - radius**2, 2 * there.slope

            inner = u[within]
            short = np.maximum(radius**2 - middle.square[within], 0)
            half = np.sqrt(short / np.abs(middle.bend[within]))
            start = np.stack([inner - half, inner + half])
            found = np.stack([u, u])
            inner = np.stack([inner, inner])
            found[:, within] = newton(beyond, inner, ends[:, within], start, ENOUGH)
            return found[0], found[1]

        return Forbidden(depth, middle.across, edges)

    return Limit(half_angle, True, forbids)


class _Distance(NamedTuple):
    """The square of |1 + L|, half its first and second derivative by u, and that across it."""

    square: FloatArray
    slope: FloatArray
    bend: FloatArray
    across: FloatArray

    @classmethod
    def of(cls, curve: Curve, u: FloatArray, size: FloatArray, angle: FloatArray) -> _Distance:
        """Find it where L = -exp(size + j angle)/D(x)."""
        value, slope = log_den_less_1(u, curve.order)
        L = -np.exp(np.minimum(size - value.real, LARGEST) + 1j * (angle - value.imag))
        turn, toward = -L * slope, np.conj(1 + L)
        rising = turn * toward
        # The second derivative of ln D follows from the first.
        q = 1j / (np.exp(-u) + 1j)
        curved = -turn * (2 * slope - 1 - (curve.order - 1) * q) * toward
        bend = np.abs(turn) ** 2 + curved.real
        return cls(np.abs(toward) ** 2, rising.real, bend, rising.imag)
