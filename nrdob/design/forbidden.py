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
from typing import Any, NamedTuple

import numpy as np

from ..numerics import ComplexArray, FloatArray, bisect
from .slack import Specification

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
    """Range of u = ln(λω) that is forbidden, and by how much: negative where none is.

    The sign of `off` tells on which side of the middle of what is forbidden L passes.
    """

    low: FloatArray
    high: FloatArray
    depth: FloatArray
    off: FloatArray


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
        return Forbidden(u, u, depth, off)

    def forbids_first_order(size: FloatArray, angle: FloatArray) -> Forbidden:
        # D = jx has but one angle: a whole range of x, at single frequencies.
        off = angle - first
        return Forbidden(size - most, size + most, THIN - np.abs(off), off)

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
        return Forbidden(u, u, depth, off)

    for stretch in curve.rising():
        yield Limit(most, False, partial(forbids, stretch))


def _sensitivity(curve: Curve, max_ms: float) -> Limit:
    """Forbid L within 1/Ms of -1."""
    half_angle = asin(1 / max_ms)

    def forbids(size: FloatArray, angle: FloatArray) -> Forbidden:
        def distance(u: FloatArray, of: Any = np.s_[:]) -> tuple[FloatArray, ComplexArray]:
            """|1 + L|, and its slope in u and across it but for a positive factor."""
            value, slope = log_den_less_1(u, curve.order)
            L = -np.exp(np.minimum(size[of] - value.real, LARGEST) + 1j * (angle[of] - value.imag))
            return np.abs(1 + L), -L * slope * np.conj(1 + L)

        ends = curve.at_angle(np.stack([angle - half_angle, angle + half_angle]))
        (at_first, falls), (at_last, rises) = distance(ends[0]), distance(ends[1])
        middle = np.where(at_first < at_last, ends[0], ends[1])
        dips = (falls.real < 0) & (rises.real > 0)
        first, last = ends[:, dips]
        middle[dips] = bisect(lambda u: distance(u, dips)[1].real, first, last, ENOUGH**0.5)
        least, across = distance(middle)
        depth = 1 - max_ms * least
        low, high = middle.copy(), middle.copy()
        within = np.flatnonzero(depth > 0)
        both = np.tile(within, 2)
        outer = ends[:, within].ravel()
        edges = bisect(lambda u: max_ms * distance(u, both)[0] - 1, outer, middle[both], ENOUGH)
        low[within], high[within] = np.split(edges, 2)
        return Forbidden(low, high, depth, across.imag)

    return Limit(half_angle, True, forbids)
