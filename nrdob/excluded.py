r"""The time constants that a specification excludes, found frequency by frequency.

With :math:`x = \lambda\omega` the plant loop is :math:`L = R(j\omega)/D(x)`, where
:math:`D(x) = (1 + jx)^n - 1` is one curve for all plants; its angle grows from 90° to n·90°. So at
each frequency the λ that bring L onto the circle around -1, the unit circle or the negative real
axis follow from the inverse of that curve, and along each of its turns they change continuously
with the frequency. What a limit excludes is thus a few patches of the (ω, λ) plane, and their
shadows on the axis of λ are what must be left out: no λ is tried, and none can be overlooked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from math import asin, log, pi, radians
from typing import NamedTuple

import numpy as np

from .blocks import BoolArray, ComplexArray, FloatArray, IntArray
from .crossings import bisect
from .limits import roots_by_side
from .mismatch import Mismatch
from .mismatchgrid import Frequencies
from .slack import Specification

WIDEST, PER_E_FOLD = 46.0, 40
"""Range of ±ln x in which the curve D is tabulated, and how densely."""

NEWTON = 3
"""Steps from the table to the inverse of the curve."""

ACROSS, ZOOMS = 9, 5
"""At how many frequencies, and how often, an edge of a patch is looked at more closely."""

STEEPEST = 1e-6
"""Relative distance of two frequencies at which a patch that is so steep is cut no more."""

CHEAP = 14
"""How often where it costs little."""

THIN = 1e-8
"""Half the angle that a whole range of λ is wide, where the phase of L does not depend on λ."""

MARGIN = 0.5
"""Angle beyond what is forbidden in which it may come close between two frequencies."""

NOISE = 1e-2
"""Relative rounding error of R, beside its poles and zeros on the axis, from which it is none."""

ENOUGH = 1e-9
"""How closely ln x is found at the edges of what the sensitivity forbids."""

SMALLEST_GAIN = 0.01
"""Size of L down to which a dead time is followed."""

FAR = 1e10
"""How far beyond all else R is followed if L does not vanish at infinite frequency."""

Interval = tuple[float, float]


def admissible(
    frequencies: Frequencies, specification: Specification, intervals: list[Interval]
) -> list[Interval]:
    """Find all λ within intervals of stable loops that meet a specification.

    Returns
    -------
    list of (low, high)
        Disjoint and increasing, in seconds.
    """
    mismatch = frequencies.mismatch
    left = _without(intervals, list(_at_infinity(mismatch, specification)))
    if not left:
        return []
    floor, limits = left[0][0], list(_limits(mismatch, specification))
    patches = _looked_at(mismatch, frequencies.above(floor), limits)
    # Smaller loop gains than those of an unstable loop are forbidden, too, up to higher frequency.
    rough = _without(left, [shadow for each in patches for shadow in each.shadows(closely=False)])
    least = max(specification.smallest_gain, SMALLEST_GAIN)
    if mismatch.delay and rough:
        floor = max(floor, rough[0][0])
        left = _without(left, [(0.0, floor)])
        patches = _looked_at(mismatch, frequencies.above(floor, least), limits)
    for each in patches:
        left = _without(left, each.shadows() if left else [])
    return left


def _looked_at(mismatch: Mismatch, omega: FloatArray, limits: list[_Limit]) -> list[_Patches]:
    omega = _followed(mismatch, omega)
    return [_Patches.of(mismatch, omega, limit) for limit in limits]


def _without(intervals: list[Interval], covered: list[Interval]) -> list[Interval]:
    """Leave out of increasing intervals what others cover."""
    for low, high in covered:
        parts = [((a, min(b, low)), (max(a, high), b)) for a, b in intervals]
        intervals = [(a, b) for pair in parts for a, b in pair if a < b]
    return intervals


def _followed(mismatch: Mismatch, omega: FloatArray) -> FloatArray:
    """Leave out frequencies at which R is noise; follow it further if L does not vanish."""
    if mismatch.excess == mismatch.order and not mismatch.delay:
        omega = np.append(omega, omega[-1] * np.geomspace(1, FAR, 41)[1:])
    return omega[mismatch.noise(omega) < NOISE * np.abs(mismatch.ratio(omega))]


def _at_infinity(mismatch: Mismatch, specification: Specification) -> Iterator[Interval]:
    """Give the λ at which L tends to a forbidden point, or circle, at infinite frequency."""
    if mismatch.excess < mismatch.order:
        return
    last = float(mismatch.b[0] / mismatch.a[0])
    if last > 0 and not mismatch.delay:
        return
    if specification.max_ms is not None:
        near = 1 / specification.max_ms
        yield _between(abs(last), 1 - near, 1 + near, mismatch.order)
    if specification.min_gm_db is not None:
        gain = 10 ** (specification.min_gm_db / 20)
        yield _between(abs(last), 1 / gain, gain, mismatch.order)


def _between(last: float, least: float, most: float, order: int) -> Interval:
    return (last / most) ** (1 / order), (last / least) ** (1 / order)


# The curve D(x) of each order.


@dataclass(frozen=True, eq=False)
class _Curve:
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
    def of(cls, order: int) -> _Curve:
        """Tabulate the curve of one order."""
        u = np.linspace(-WIDEST, WIDEST, int(2 * WIDEST * PER_E_FOLD) + 1)
        table = _log_den_less_1(u, order)[0]
        return cls(order, u, table.real, table.imag)

    @property
    def ends(self) -> tuple[float, float]:
        """Angles of D for x = 0 and infinite x."""
        return pi / 2, self.order * pi / 2

    def at_angle(self, angle: FloatArray) -> FloatArray:
        """Return u where D has an angle, or the end of the table beyond the ends."""
        first, last = self.ends
        u = self._polished(np.interp(angle, self.angle, self.u), angle, lambda z: z.imag)
        return np.where(angle <= first, -WIDEST, np.where(angle >= last, WIDEST, u))

    def rising(self) -> Iterator[tuple[float, float, Callable[[FloatArray], FloatArray]]]:
        """Give the stretches of monotone size, one up to n = 12: their ends, and the inverse."""
        turns = 1 + np.flatnonzero(np.diff(np.sign(np.diff(self.size))))
        for first, last in zip([0, *turns], [*turns, self.u.size - 1], strict=True):
            size, u = self.size[first : last + 1], self.u[first : last + 1]
            size, u = (size, u) if size[0] < size[-1] else (size[::-1], u[::-1])

            def inverse(value: FloatArray, size: FloatArray = size, u: FloatArray = u) -> FloatArray:
                return self._polished(np.interp(value, size, u), value, lambda z: z.real)

            yield float(size[0]), float(size[-1]), inverse

    def _polished(
        self, u: FloatArray, wanted: FloatArray, part: Callable[[ComplexArray], FloatArray]
    ) -> FloatArray:
        """Newton steps, none wider than the table's."""
        for _ in range(NEWTON):
            value, slope = _log_den_less_1(u, self.order)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = np.nan_to_num((wanted - part(value)) / part(slope))
            u = u + np.clip(step, -1 / PER_E_FOLD, 1 / PER_E_FOLD)
        return u


def _log_den_less_1(u: FloatArray, order: int) -> tuple[ComplexArray, ComplexArray]:
    """ln D, its angle continued, and its derivative by u = ln x, accurate for every x."""
    x = np.exp(u)
    log_w = np.log1p(x * x) / 2 + 1j * np.arctan(x)
    less_1 = -np.expm1(-order * log_w)  # (D + 1 - 1)/(D + 1), on the right of the axis
    value = order * log_w + np.log(less_1)
    return value, order * 1j * x / ((1 + 1j * x) * less_1)


# What each limit forbids at one frequency.


class _Forbidden(NamedTuple):
    """Range of u = ln(λω) that is forbidden, and by how much: negative where none is."""

    low: FloatArray
    high: FloatArray
    depth: FloatArray


class _Limit(NamedTuple):
    """One limit: half the angle around -1 in which it forbids anything, and what it forbids.

    What is `thick` covers a range of λ at each frequency.
    `forbids` takes ln|R| and the angle that D must have to turn L onto the negative real axis.
    """

    half_angle: float
    thick: bool
    forbids: Callable[[FloatArray, FloatArray], _Forbidden]


def _limits(mismatch: Mismatch, specification: Specification) -> Iterator[_Limit]:
    curve = _Curve.of(mismatch.order)
    if specification.max_ms is not None:
        yield _sensitivity(curve, specification.max_ms)
    if specification.min_gm_db is not None:
        yield _gain_margin(curve, specification.min_gm_db * log(10) / 20)
    if specification.min_pm_deg is not None:
        yield from _phase_margin(curve, radians(specification.min_pm_deg))


def _gain_margin(curve: _Curve, most: float) -> _Limit:
    """Forbid L on the negative real axis with a size within exp(±most)."""
    first, last = curve.ends

    def forbids(size: FloatArray, angle: FloatArray) -> _Forbidden:
        u = curve.at_angle(angle)
        off = np.abs(size - _log_den_less_1(u, curve.order)[0].real)
        return _Forbidden(u, u, np.minimum(most - off, np.minimum(angle - first, last - angle)))

    def forbids_first_order(size: FloatArray, angle: FloatArray) -> _Forbidden:
        # D = jx has but one angle: a whole range of x, at single frequencies.
        return _Forbidden(size - most, size + most, THIN - np.abs(angle - first))

    return _Limit(0.0, False, forbids if curve.order > 1 else forbids_first_order)


def _phase_margin(curve: _Curve, most: float) -> Iterator[_Limit]:
    """Forbid L on the unit circle within an angle of -1."""
    for first, last, inverse in curve.rising():

        def forbids(
            size: FloatArray,
            angle: FloatArray,
            first: float = first,
            last: float = last,
            inverse: Callable[[FloatArray], FloatArray] = inverse,
        ) -> _Forbidden:
            u = inverse(size)
            off = np.abs(angle - _log_den_less_1(u, curve.order)[0].imag)
            return _Forbidden(u, u, np.minimum(most - off, np.minimum(size - first, last - size)))

        yield _Limit(most, False, forbids)


def _sensitivity(curve: _Curve, max_ms: float) -> _Limit:
    """Forbid L within 1/Ms of -1."""
    half_angle = asin(1 / max_ms)

    def forbids(size: FloatArray, angle: FloatArray) -> _Forbidden:
        def distance(u: FloatArray, of: BoolArray | IntArray | slice = np.s_[:]) -> tuple[FloatArray, FloatArray]:
            """|1 + L| and its slope."""
            value, slope = _log_den_less_1(u, curve.order)
            L = -np.exp(np.minimum(size[of] - value.real, 300) + 1j * (angle[of] - value.imag))
            return np.abs(1 + L), -(L * slope * np.conj(1 + L)).real

        ends = curve.at_angle(np.stack([angle - half_angle, angle + half_angle]))
        (near_low, falls), (near_high, rises) = distance(ends[0]), distance(ends[1])
        middle = np.where(near_low < near_high, *ends)
        dips = (falls < 0) & (rises > 0)
        middle[dips] = bisect(lambda u: distance(u, dips)[1], *ends[:, dips], ENOUGH**0.5)
        depth = 1 - max_ms * distance(middle)[0]
        low, high = middle.copy(), middle.copy()
        within = np.flatnonzero(depth > 0)
        both = np.tile(within, 2)
        edges = bisect(
            lambda u: max_ms * distance(u, both)[0] - 1, ends[:, within].ravel(), middle[both], ENOUGH
        )
        low[within], high[within] = np.split(edges, 2)
        return _Forbidden(low, high, depth)

    return _Limit(half_angle, True, forbids)


# The patches of the (ω, λ) plane.


@dataclass(frozen=True, eq=False)
class _Patches:
    """What one limit forbids, frequency by frequency along each turn of D.

    Attributes
    ----------
    mismatch : Mismatch
        The ratio R and the order.
    limit : _Limit
        What is forbidden.
    omega, phase : array of float
        N frequencies and arg R there, continued.
    stretch : array of int
        Number of poles and zeros of R on the axis below each.
    at, turn : array of int
        Which frequency, and how many whole turns are added to the phase, sorted by turn.
    found : _Forbidden
        What is forbidden there.
    """

    mismatch: Mismatch
    limit: _Limit
    omega: FloatArray
    phase: FloatArray
    stretch: IntArray
    at: IntArray
    turn: IntArray
    found: _Forbidden

    @classmethod
    def of(cls, mismatch: Mismatch, omega: FloatArray, limit: _Limit) -> _Patches:
        """Look at all frequencies, and where the limit is nearly reached between two."""
        R = mismatch.ratio(omega)
        phase = np.unwrap(np.angle(R))
        stretch = np.searchsorted(_on_axis(mismatch)[0], omega)
        first, last = _Curve.of(mismatch.order).ends
        beside = limit.half_angle + MARGIN - pi
        least = np.ceil((first - beside - 2 * pi - phase) / (2 * pi))
        most = np.floor((last + beside - phase) / (2 * pi))
        turns = least[:, None] + np.arange(int((most - least).max(initial=0)) + 1)
        at, k = np.nonzero(turns <= most[:, None])
        turn = turns[at, k].astype(int)
        by_turn = np.lexsort((at, turn))
        at, turn = at[by_turn], turn[by_turn]
        found = limit.forbids(np.log(np.abs(R))[at], phase[at] + pi + 2 * pi * turn)
        patches = cls(mismatch, limit, omega, phase, stretch, at, turn, found)
        between = patches._between()
        if between.size:
            return cls.of(mismatch, np.union1d(omega, between), limit)
        return patches

    def shadows(self, *, closely: bool = True) -> list[Interval]:
        """Find the λ that each patch covers, off the frequencies looked at if not closely."""
        there = np.flatnonzero(self.found.depth >= 0)
        if not there.size:
            return []
        low, high = (edge - np.log(self.omega[self.at]) for edge in self.found[:2])
        linked = self._linked
        patch = np.cumsum(np.append(True, ~linked))[there]
        starts = np.flatnonzero(np.append(True, np.diff(patch) > 0))
        if closely:
            lowest, highest = (there[_tops(edge, linked)[there]] for edge in (-low, high))
            way = np.repeat([-1, 1], [lowest.size, highest.size])[:, None]
            _, reach = self._zoomed(np.append(lowest, highest), partial(_reach, way))
            low[lowest], high[highest] = -reach[: lowest.size], reach[lowest.size :]
        to_0, to_inf = (np.logical_or.reduceat(end[there], starts) for end in self._open_ends)
        lows = np.exp(np.minimum.reduceat(low[there], starts))
        highs = np.exp(np.maximum.reduceat(high[there], starts))
        lows, highs = np.where(to_0, 0.0, lows), np.where(to_inf, np.inf, highs)
        return list(zip(lows.tolist(), highs.tolist(), strict=True))

    @property
    def _joined(self) -> BoolArray:
        """Tell between which of the points looked at everything changes continuously."""
        same = (np.diff(self.turn) == 0) & (np.diff(self.at) == 1)
        return np.asarray(same & (np.diff(self.stretch[self.at]) == 0))

    @property
    def _open_ends(self) -> tuple[BoolArray, BoolArray]:
        """Tell from which points a patch goes on to λ = 0, or to infinite λ.

        At a zero of R on the axis, and at infinite frequency, L is of size 1 only if λ tends to 0;
        at a pole and at ω = 0 only if it is infinite.
        """
        is_pole = np.concatenate([[True], _on_axis(self.mismatch)[1], [False]])
        breaks = np.diff(self.stretch) > 0
        first, last = np.append(True, breaks)[self.at], np.append(breaks, True)[self.at]
        below, above = self.stretch[self.at], self.stretch[self.at] + 1
        to_inf = (first & is_pole[below]) | (last & is_pole[above])
        to_0 = (first & ~is_pole[below]) | (last & ~is_pole[above])
        if self.mismatch.excess == self.mismatch.order:  # L does not vanish at infinite frequency
            to_0 &= self.at < self.omega.size - 1
        return to_0, to_inf

    @property
    def _linked(self) -> BoolArray:
        """Tell between which of the points looked at a patch goes on."""
        there = self.found.depth >= 0
        return np.asarray(self._joined & there[1:] & there[:-1])

    def _between(self) -> FloatArray:
        """Frequencies of patches, or of gaps, that lie between two of those looked at."""
        parts = [self._hidden(np.array([way])) for way in (1, -1)]
        return np.concatenate([*parts, self._steep()])

    def _hidden(self, way: IntArray) -> FloatArray:
        """Frequencies at which a patch hides, or a gap if the way is -1."""
        depth = way * self.found.depth
        near = np.flatnonzero((depth < 0) & _tops(depth, self._joined))
        near = near[(near > 0) & (near < depth.size - 1)]
        drop = depth[near] - np.minimum(depth[near - 1], depth[near + 1])
        near = near[depth[near] + 2 * drop >= 0]
        if not near.size:
            return np.empty(0)
        where, best = self._zoomed(near, lambda found, _: way * found.depth)
        return where[best > 0]

    def _steep(self) -> FloatArray:
        """Frequencies between neighbours of one patch, if it is one, that share no λ."""
        if not self.limit.thick:
            return np.empty(0)
        low, high = (edge - np.log(self.omega[self.at]) for edge in self.found[:2])
        apart = (low[1:] > high[:-1]) | (low[:-1] > high[1:])
        k = np.flatnonzero(self._linked & apart)
        before, after = self.omega[self.at[k]], self.omega[self.at[k + 1]]
        wide = after > before * (1 + STEEPEST)
        share = np.linspace(0, 1, ACROSS)[1:-1]
        return (before[wide, None] + share * (after - before)[wide, None]).ravel()

    def _zoomed(
        self, of: IntArray, value: Callable[[_Forbidden, FloatArray], FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Frequencies beside some of the points at which a value is largest, and the value."""
        before, after = np.append(False, self._joined)[of], np.append(self._joined, False)[of]
        low, high = self.omega[self.at[of - before]], self.omega[self.at[of + after]]
        turned = pi + 2 * pi * self.turn[of, None]
        phase = self.phase[self.at[of], None]
        share, rows = np.linspace(0, 1, ACROSS), np.arange(of.size)
        for _ in range(ZOOMS if self.limit.thick else CHEAP):
            omega = low[:, None] + share * (high - low)[:, None]
            R = self.mismatch.ratio(omega)
            angle = np.angle(R)
            angle = angle + 2 * pi * np.round((phase - angle) / (2 * pi)) + turned
            found = self.limit.forbids(np.log(np.abs(R)).ravel(), angle.ravel())
            values = value(_Forbidden(*(part.reshape(omega.shape) for part in found)), omega)
            k = values.argmax(axis=1)
            low, high = omega[rows, np.maximum(k - 1, 0)], omega[rows, np.minimum(k + 1, ACROSS - 1)]
        return omega[rows, k], values[rows, k]


def _reach(way: IntArray, found: _Forbidden, omega: FloatArray) -> FloatArray:
    """ln λ at the upper edge of a patch, or -ln λ at the lower one; -inf beside it."""
    edge = np.where(way > 0, found.high, found.low) - np.log(omega)
    return np.where(found.depth >= 0, way * edge, -np.inf)


def _tops(values: FloatArray, linked: BoolArray) -> BoolArray:
    """Tell which values are at least as large as their neighbours, where these are linked."""
    lower = ~linked | (values[1:] <= values[:-1]), ~linked | (values[1:] >= values[:-1])
    return np.append(lower[0], True) & np.append(True, lower[1])


def _on_axis(mismatch: Mismatch) -> tuple[FloatArray, BoolArray]:
    """Frequencies of the poles and zeros of R on the axis, increasing, and which are poles."""
    N, D, Nm, Dm = mismatch.factors
    parts = [roots_by_side(*factors)[1].imag for factors in ((D, Nm), (N, Dm))]
    omega = np.concatenate([part[part > 0] for part in parts])
    is_pole = np.arange(omega.size) < np.sum(parts[0] > 0)
    by_size = np.argsort(omega)
    return omega[by_size], is_pole[by_size]
