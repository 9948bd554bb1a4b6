r"""The time constants that a specification excludes, found frequency by frequency.

What a limit forbids at a frequency is a range of λ, or a single one, that changes continuously with
the frequency along each turn of :math:`(1 + j\lambda\omega)^n`. So it excludes a few patches, or
lines, of the (ω, λ) plane, whose shadows on the axis of λ are left out. No λ is tried, so that none
lies unseen between two that were.

At one frequency all that is forbidden is found. Between two frequencies a patch, or a gap, is found
where L passes what is forbidden from one side to the other, and where the depths around it let one
expect it: this is not proved, but rests on frequencies so dense that R is smooth between them, as
`nrdob.design.mismatchgrid` chooses them. The ends of what is left are good to some eight digits;
`nrdob.design.search` confirms each by exact margins.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from math import asin, pi, radians

import numpy as np

from ..numerics import BoolArray, FloatArray, IntArray
from .existence import roots_by_side
from .forbidden import Curve, Forbidden, Limit, limits
from .mismatch import ERROR, Mismatch
from .mismatchgrid import Frequencies
from .slack import NARROW, Specification

__all__ = ["admissible"]

BESIDE = 11
"""At how many frequencies on each side an edge is looked at more closely."""

ZOOMS, MORE_ZOOMS = 3, 9
"""How often, and how often where what is forbidden at a frequency is but a point: a closed form."""

STEEPEST = 1e-6
"""Relative distance of two frequencies at which a patch that is so steep is cut no more."""

MARGIN = 0.5
"""Angle beyond what is forbidden in which it may come close between two frequencies."""

NOISE = 1e-2
"""Relative rounding error of R, beside its poles and zeros on the axis, from which it is none."""

SHORT = 1.01
"""How far short of the smallest forbidden gain a dead time is followed: L may tend to just that."""

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
    known = [*_at_ends(mismatch, specification), *_beside_poles(mismatch, specification)]
    left = _without(intervals, known)
    if not left:
        return []
    every = list(limits(mismatch.order, specification))

    def looked_at(gain: float) -> list[_Patches]:
        omega = _followed(mismatch, frequencies.above(left[0][0], gain))
        return [_Patches.of(mismatch, omega, limit) for limit in every]

    patches = looked_at(1.0)
    if mismatch.delay:
        # Smaller gains than an unstable loop's are forbidden, too, up to higher frequency; how high
        # depends on the fastest filter that may be left.
        covered = [shadow for each in patches for shadow in each.shadows(closely=False)]
        rough = _without(left, covered)
        if not rough:
            return []
        left = _without(left, [(0.0, rough[0][0])])
        patches = looked_at(SHORT * specification.smallest_gain)
    for each in patches:
        left = _without(left, each.shadows() if left else [])
    return left


def _without(intervals: list[Interval], covered: list[Interval]) -> list[Interval]:
    """Leave out of increasing intervals what others cover."""
    for low, high in (ends for ends in covered if ends[0] < ends[1]):
        parts = [((a, min(b, low)), (max(a, high), b)) for a, b in intervals]
        intervals = [(a, b) for pair in parts for a, b in pair if a < b]
    return intervals


def _followed(mismatch: Mismatch, omega: FloatArray) -> FloatArray:
    """Leave out frequencies at which R is noise; follow it further if L does not vanish."""
    if mismatch.excess == mismatch.order and not mismatch.delay:
        omega = np.append(omega, omega[-1] * np.geomspace(1, FAR, 41)[1:])
    return omega[_rounding(mismatch, omega) < NOISE * np.abs(mismatch.ratio(omega))]


def _at_ends(mismatch: Mismatch, specification: Specification) -> Iterator[Interval]:
    """Give the λ at which L tends to what is forbidden at zero or at infinite frequency.

    At infinite frequency that is a point, or with dead time a circle, at zero a point.
    """
    n, ends = mismatch.order, []
    if mismatch.excess == n:
        last = float(mismatch.b[0] / mismatch.a[0])
        ends += [(abs(last), n)] if last < 0 or mismatch.delay else []
    if mismatch.integrator:
        first = float(mismatch.delayed[-1] / mismatch.a[-1]) / n
        ends += [(-first, 1)] if first < 0 else []
    for size, power in ends:
        if specification.max_ms is not None:
            near = 1 / specification.max_ms
            yield _between(size, 1 - near, 1 + near, power)
        if specification.min_gm_db is not None:
            gain = 10 ** (specification.min_gm_db / 20)
            yield _between(size, 1 / gain, gain, power)


def _between(size: float, least: float, most: float, power: int) -> Interval:
    """Give the λ at which size/λ^power lies between two others."""
    return (size / most) ** (1 / power), (size / least) ** (1 / power)


def _beside_poles(mismatch: Mismatch, specification: Specification) -> Iterator[Interval]:
    """Give the λ at which a resonance is too narrow to be looked at, and comes too close to -1.

    Beside a pole of R on the axis L = ρ/(j(ω - ω0) D(λω0)) is a straight line through 0, the longer
    the narrower. The angle at which it runs hangs on λ alone.
    """
    near = [asin(1 / specification.max_ms)] if specification.max_ms else []
    near += [radians(specification.min_pm_deg)] if specification.min_pm_deg else []
    half_angle = min(max(near, default=0.0), pi / 2)
    curve = Curve.of(mismatch.order)
    first, last = curve.ends
    _, D, Nm, _ = mismatch.factors
    axis = roots_by_side(D, Nm)[1]
    for pole in axis[axis.imag > 0].tolist():
        slope = np.polyval(np.polyder(mismatch.a), pole)
        if not (near and slope):
            continue
        residue = np.polyval(mismatch.b, pole) * np.exp(-mismatch.delay * pole) / slope
        # From here on |D| >= (λω0)^n - 1 is so large that the resonance is narrow.
        narrow = (1 + abs(residue) / (NARROW * pole.imag)) ** (1 / mismatch.order) / pole.imag
        lines = np.arange(np.angle(residue) - 2.5 * pi, last + pi, pi)
        u = curve.at_angle(np.stack([lines - half_angle, lines + half_angle]))
        within = (lines + half_angle > first) & (lines - half_angle < last)
        lows, highs = np.exp(u[:, within]) / pole.imag
        highs[lines[within] + half_angle >= last] = np.inf
        yield from zip(np.maximum(lows, narrow).tolist(), highs.tolist(), strict=True)


@dataclass(frozen=True, eq=False)
class _Patches:
    """What one limit forbids, frequency by frequency along each turn of D.

    Attributes
    ----------
    mismatch : Mismatch
        The ratio R and the order.
    limit : Limit
        What is forbidden.
    omega, phase : array of float
        N frequencies and arg R there, continued.
    stretch : array of int
        Number of poles and zeros of R on the axis below each.
    at, turn : array of int
        Which frequency, and how many whole turns are added to the phase, sorted by turn.
    found : Forbidden
        What is forbidden there.
    """

    mismatch: Mismatch
    limit: Limit
    omega: FloatArray
    phase: FloatArray
    stretch: IntArray
    at: IntArray
    turn: IntArray
    found: Forbidden

    @classmethod
    def of(cls, mismatch: Mismatch, omega: FloatArray, limit: Limit) -> _Patches:
        """Look at all frequencies, and where the limit is nearly reached between two."""
        R = mismatch.ratio(omega)
        phase = np.unwrap(np.angle(R))
        stretch = np.searchsorted(_on_axis(mismatch)[0], omega)
        first, last = Curve.of(mismatch.order).ends
        beside = limit.half_angle + MARGIN
        least = np.ceil((first - beside - pi - phase) / (2 * pi))
        most = np.floor((last + beside - pi - phase) / (2 * pi))
        turns = least[:, None] + np.arange(int((most - least).max(initial=0)) + 1)
        at, k = np.nonzero(turns <= most[:, None])
        turn = turns[at, k].astype(int)
        by_turn = np.lexsort((at, turn))
        at, turn = at[by_turn], turn[by_turn]
        found = limit.forbids(np.log(np.abs(R))[at], phase[at] + pi + 2 * pi * turn)
        patches = cls(mismatch, limit, omega, phase, stretch, at, turn, found)
        more = np.union1d(omega, patches._between())
        return cls.of(mismatch, more, limit) if more.size > omega.size else patches

    def shadows(self, *, closely: bool = True) -> list[Interval]:
        """Find the λ that each patch covers, off the frequencies looked at if not closely."""
        there = np.flatnonzero(self.found.depth >= 0)
        if not there.size:
            return []
        low, high = self._edges.copy()
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

    @cached_property
    def _edges(self) -> FloatArray:
        """Edges of ln λ, lower and upper, at each of the points looked at."""
        return np.stack(self.found.edges()) - np.log(self.omega[self.at])

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
        axis, is_pole = _on_axis(self.mismatch)
        axis = np.concatenate([[0.0], axis, [np.inf]])
        is_pole = np.concatenate([[True], is_pole, [False]])
        breaks = np.diff(self.stretch) > 0
        first, last = np.append(True, breaks)[self.at], np.append(breaks, True)[self.at]
        below, above = self.stretch[self.at], self.stretch[self.at] + 1
        to_inf = (first & is_pole[below]) | (last & is_pole[above])
        # So close to a pole it is known what happens: see _beside_poles.
        omega = self.omega[self.at]
        to_inf &= ~(first & (omega <= axis[below] * (1 + NARROW)))
        to_inf &= ~(last & (omega >= axis[above] * (1 - NARROW)))
        to_0 = (first & ~is_pole[below]) | (last & ~is_pole[above])
        if self.mismatch.excess == self.mismatch.order:  # L does not vanish at infinite frequency
            to_0 &= self.at < self.omega.size - 1
        if self.mismatch.integrator:  # and is finite at zero
            to_inf &= self.at > 0
        return to_0, to_inf

    @property
    def _linked(self) -> BoolArray:
        """Tell between which of the points looked at a patch goes on."""
        there = self.found.depth >= 0
        return np.asarray(self._joined & there[1:] & there[:-1])

    def _between(self) -> FloatArray:
        """Frequencies of patches, or of gaps, that lie between two of those looked at."""
        depth, joined = self.found.depth, self._joined
        k = np.flatnonzero(_nearly_reached(depth, joined) | _nearly_reached(-depth, joined))
        # Where L passes from one side to the other it passes what is forbidden, however fast.
        off = self.found.off >= 0
        passed = joined & (off[1:] != off[:-1]) & (depth[1:] < 0) & (depth[:-1] < 0)
        of = np.append(k, np.flatnonzero(passed))
        if not of.size:
            return self._steep()
        way = np.where(depth[of] < 0, 1, -1)
        where, best = self._zoomed(
            of,
            lambda found, _: way[:, None] * found.depth,
            both_sides=np.arange(of.size) < k.size,
        )
        return np.append(where[best > 0], self._steep())

    def _steep(self) -> FloatArray:
        """Frequencies between neighbours of one patch, if it is one, that share no λ."""
        if not self.limit.thick:
            return np.empty(0)
        low, high = self._edges
        apart = (low[1:] > high[:-1]) | (low[:-1] > high[1:])
        k = np.flatnonzero(self._linked & apart)
        before, after = self.omega[self.at[k]], self.omega[self.at[k + 1]]
        wide = after > before * (1 + STEEPEST)
        share = np.linspace(0, 1, 2 * BESIDE)[1:-1]
        return (before[wide, None] + share * (after - before)[wide, None]).ravel()

    def _zoomed(
        self,
        of: IntArray,
        value: Callable[[Forbidden, FloatArray], FloatArray],
        both_sides: BoolArray | bool = True,
    ) -> tuple[FloatArray, FloatArray]:
        """Frequencies beside some of the points at which a value is largest, and the value.

        On both sides, or only between a point and the next.
        """
        before, after = np.append(False, self._joined)[of], np.append(self._joined, False)[of]
        before = before & both_sides
        low, best, high = (self.omega[self.at[k]] for k in (of - before, of, of + after))
        turned = pi + 2 * pi * self.turn[of, None]
        phase = self.phase[self.at[of], None]
        rows = np.arange(of.size)
        for _ in range(ZOOMS if self.limit.thick else MORE_ZOOMS):
            sides = np.linspace(low, best, BESIDE), np.linspace(best, high, BESIDE)
            omega = np.concatenate([sides[0], sides[1][1:]]).T
            R = self.mismatch.ratio(omega)
            angle = np.angle(R)
            angle = angle + 2 * pi * np.round((phase - angle) / (2 * pi)) + turned
            values = value(self.limit.forbids(np.log(np.abs(R)), angle), omega)
            k = values.argmax(axis=1)
            below, above = np.maximum(k - 1, 0), np.minimum(k + 1, omega.shape[1] - 1)
            low, best, high = omega[rows, below], omega[rows, k], omega[rows, above]
        return best, values[rows, k]


def _reach(way: IntArray, found: Forbidden, omega: FloatArray) -> FloatArray:
    """Return ln λ at the upper edge of a patch, or -ln λ at the lower one; -inf beside it."""
    low, high = found.edges()
    edge = np.where(way > 0, high, low) - np.log(omega)
    return np.where(found.depth >= 0, way * edge, -np.inf)


def _nearly_reached(depth: FloatArray, joined: BoolArray) -> BoolArray:
    """Tell beside which negative depths there may be a positive one between two points."""
    # Off a grid a top may lie as much higher as its neighbours lie below, and a bit.
    around = np.pad(depth, 2, constant_values=np.inf)
    lowest = np.min([around[k : k + depth.size] for k in range(5)], axis=0)
    near = depth + 2 * (depth - lowest) >= 0
    return np.asarray((depth < 0) & near & _tops(depth, joined))


def _tops(values: FloatArray, linked: BoolArray) -> BoolArray:
    """Tell which values are at least as large as their neighbours, where these are linked."""
    lower = ~linked | (values[1:] <= values[:-1]), ~linked | (values[1:] >= values[:-1])
    return np.asarray(np.append(lower[0], True) & np.append(True, lower[1]))


@lru_cache(maxsize=4)
def _on_axis(mismatch: Mismatch) -> tuple[FloatArray, BoolArray]:
    """Frequencies of the poles and zeros of R on the axis, increasing, and which are poles."""
    N, D, Nm, Dm = mismatch.factors
    parts = [roots_by_side(*factors)[1].imag for factors in ((D, Nm), (N, Dm))]
    omega = np.concatenate([part[part > 0] for part in parts])
    is_pole = np.arange(omega.size) < np.sum(parts[0] > 0)
    by_size = np.argsort(omega)
    return omega[by_size], is_pole[by_size]


def _rounding(mismatch: Mismatch, omega: FloatArray) -> FloatArray:
    """Bound the rounding error of R(jω), which near a zero on the axis exceeds R itself."""
    values = [np.abs(np.polyval(p, 1j * omega)) for p in mismatch.factors]
    sizes = [np.polyval(np.abs(p), omega) for p in mismatch.factors]
    with np.errstate(divide="ignore", invalid="ignore"):
        poles = values[1] * values[2]
        at_most = sizes[0] * sizes[3] / poles
        relative = sizes[1] / values[1] + sizes[2] / values[2]
        # The angle ωθ of the dead time is rounded in proportion to its size.
        turned = at_most * (1 + mismatch.longest_delay * omega / 8)
        return np.asarray(ERROR * (turned + values[0] * values[3] / poles * relative))
