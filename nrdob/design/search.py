"""All λ that meet a specification, judged on the loop that the plant feels.

On the stabilising set it is computed how near plant loops come to -1 at many λ, and how far λ may
change before one can reach the limit. Where two neighbours do not cover what lies between them,
there is another λ in the middle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import ceil, exp, inf, log, log10
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, elementwise

from ..analysis import Margins, quotient_margins
from ..diagram import FilterFamily, ObserverEquations, real_number
from ..numerics import BoolArray, FloatArray, IntArray, bisect
from .mismatch import Mismatch
from .mismatchgrid import Frequencies
from .plantloops import PlantLoops
from .timeconstants import Interval, intersection, stabilizing_set, stable_filters

__all__ = [
    "Bracket", "FilterSearch", "admissible_time_constants", "checked_ms", "solved",
]  # fmt: skip

PER_DECADE, DECADES = 16, 2  # how densely λ are tried, how far beyond the plant's time constants
FAR, SPARSE = 12, 2  # how many decades beyond these, and how densely, they are tried, too
FINEST = 0.02  # step of ln λ below which only extremes are looked into
NEARLY = 0.3  # ln of the limit over Ms within which an extreme may lie beyond 0
SHORT = 1.01  # how far short of the smallest forbidden gain, which may be L(∞), one follows
FLAT = 1e-7  # change of the slack from one λ to the next that may be rounding
FEW = 1500  # frequencies at which all λ may be tried without asking which are left
BEFORE = 0.8  # from where dead times are followed farther, against the first λ that may be left
BESIDE = 1e-8  # how well an end is known, in ln λ, where it need not be known better
ROUNDING = (0.0, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8)  # steps inwards from an end, in ln λ


def admissible_time_constants(
    process: Any, model: Any, order: int | FilterFamily, *, max_ms: float
) -> list[tuple[float, float]]:
    """Find all λ for which the sensitivity of the plant loop L peaks at a given value at most.

    Parameters
    ----------
    process, model, order : as for `nrdob.stabilizing_time_constants`
        G and G̃; n or a family.
    max_ms : float
        Largest allowed peak of ``|S_d|``, above 1.

    Returns
    -------
    list of (low, high)
        Intervals in seconds, increasing, within those of `nrdob.stabilizing_time_constants`, with
        its floor; empty where no λ will do. `low` is 0 and `high` inf where every filter will do
        that is at least so fast, or so slow.

    Raises
    ------
    TypeError, ValueError
        As `nrdob.design_filter`, but for a limit that no λ meets.

    Notes
    -----
    The ends are confirmed by exact margins. Between two λ that are tried nothing is missed as long
    as ``|L|`` changes by no more than the n-th power of λ at each frequency, or is wider than 1 %.

    Examples
    --------
    An unstable plant: slow filters make the loop unstable, fast ones bring it close to that.

    >>> import control as ct
    >>> s = ct.tf('s')
    >>> found = admissible_time_constants(4/(2 - s - s**2), -1/(s**2 + 3*s + 2), 2, max_ms=1.5)
    >>> [(round(low, 4), round(high, 4)) for low, high in found]
    [(0.0, 0.031)]
    """
    return FilterSearch.of(process, model, order, checked_ms(max_ms)).admissible


def checked_ms(max_ms: Any) -> float:
    """Return a limit of the sensitivity peak, or refuse it."""
    limit = real_number(max_ms, "max_ms", "give a real number, for example 1.7")
    if not 1 < limit < inf:
        raise ValueError(
            f"max_ms is {max_ms}; |S_d| tends to 1 at high frequency, so its peak cannot be held "
            "to 1 or less: give a number above 1, for example 1.7"
        )
    return limit


class Bracket(NamedTuple):
    """An end of what meets a specification lies between these; they are equal if it is known.

    Attributes
    ----------
    outside, inside : float
        Values with which it is not met, and is.
    """

    outside: float
    inside: float


@dataclass(frozen=True, eq=False)
class FilterSearch:
    """The search on the stabilising set for the filters of a family that meet a limit of Ms."""

    process: Any
    model: Any
    family: FilterFamily
    max_ms: float
    frequencies: Frequencies
    intervals: list[Interval]

    @classmethod
    def of(cls, process: Any, model: Any, order: int | FilterFamily, max_ms: float) -> FilterSearch:
        """Find the stabilising set, in which it will be seen where the specification is met."""
        found = Frequencies(Mismatch.of(process, model, order))
        family = found.mismatch.family
        intervals = stabilizing_set(found, found.lowest_floor)
        intervals = intersection(intervals, stable_filters(family))
        return cls(process, model, family, max_ms, found, intervals)

    def plant_loop(self, time_constant: float) -> Margins:
        """Exact margins of L with a λ of the stabilising set."""
        loop = ObserverEquations(self.process, self.model, self.family.at(time_constant))
        return quotient_margins(loop.L, True)

    @cached_property
    def slack(self) -> Callable[[float], float]:
        """Logarithm of the limit over the exact Ms, as a function of λ."""
        loops = PlantLoops(self.frequencies.mismatch, np.empty(0))

        @cache
        def slack(value: float) -> float:
            # Where a mode is narrower than frequencies are rounded, it is not in the margins.
            narrow = 1 / float(loops.at_poles(np.array([value]))[0])
            return log(self.max_ms / max(self.plant_loop(value).ms, narrow))

        return slack

    @property
    def all_fast_ones_do(self) -> bool:
        """Whether the fastest filters looked at meet the specification."""
        return bool(self._windows) and self._windows[0][0].outside == self.intervals[0][0]

    @property
    def promise(self) -> float:
        """Least nλ that is not excluded: 0 if all fast filters do, inf for none."""
        if self.all_fast_ones_do:
            return 0.0
        return self.family.order * self._windows[0][0].outside if self._windows else inf

    @cached_property
    def admissible(self) -> list[Interval]:
        """All intervals of λ that meet the specification."""
        found: list[Interval] = []
        for first, last in self._windows:
            ends = self._past_infinity(first, last.inside), last
            low, high = (solved(self.slack, end) for end in ends)
            if low is None or high is None:
                continue
            if found and low <= found[-1][1]:
                low = found.pop()[0]
            found.append((low, high))
        return found

    def _past_infinity(self, end: Bracket, far: float) -> Bracket:
        """Open an end that only the limit at infinite frequency sets, as peaks may be higher.

        `SHORT` beyond it, none is at frequencies that were not followed.
        """
        if end.outside != end.inside or any(end.inside in each for each in self.intervals):
            return end
        return Bracket(end.outside, min(SHORT * end.inside, far))

    @cached_property
    def closest(self) -> tuple[float, Margins]:
        """The λ of the smallest Ms on the stabilising set, and the margins of L."""
        value = float(np.exp(self._scan.best))
        return value, self.plant_loop(value)

    @property
    def _windows(self) -> list[tuple[Bracket, Bracket]]:
        return self._scan.windows if self.intervals else []

    @cached_property
    def _scan(self) -> Scan:
        """Distances all over the stabilising set, dead times followed as far as it takes."""
        slowest, gain = self.intervals[0][0], (1 - 1 / self.max_ms) / SHORT
        try:
            loops = PlantLoops.above(self.frequencies, slowest, gain)
            if loops.omega.size <= FEW or not self.frequencies.mismatch.longest_delay:
                return Scan.of(loops, self.max_ms, self.intervals)
        except ValueError:  # dead times would have to be followed too far
            pass
        # How far they must be depends on the fastest filter that an unstable loop's gains leave.
        scan = Scan.of(PlantLoops.above(self.frequencies, slowest), self.max_ms, self.intervals)
        if not scan.windows:
            return scan
        bracket, _ = scan.windows[0]
        low = BEFORE * bracket.outside
        if low and scan.loops.at_infinity(np.array([low]))[0] != 1:  # L(∞) is just that gain
            low, gain = scan.solved(bracket), gain * SHORT**2
        left = [(max(low, a), b) for a, b in self.intervals if b > low]
        try:
            return Scan.of(
                PlantLoops.above(self.frequencies, low or slowest, gain), self.max_ms, left
            )
        except ValueError as refusal:
            raise ValueError(f"max_ms is {self.max_ms}, too close to 1: {refusal}") from refusal


@dataclass(frozen=True, eq=False)
class Scan:
    """Samples of ln λ, x, and the slack ln(limit/Ms), in the intervals with the numbers `part`."""

    loops: PlantLoops
    max_ms: float
    intervals: list[Interval]
    x: FloatArray
    slack: FloatArray
    part: IntArray

    @classmethod
    def of(cls, loops: PlantLoops, max_ms: float, intervals: list[Interval]) -> Scan:
        """Try λ all over the intervals, more where those tried do not cover what is between."""
        speeds = loops.mismatch.speeds
        first, last = 10.0**-DECADES / float(speeds.max()), 10.0**DECADES / float(speeds.min())
        each = [_samples(low, high, first, last) for low, high in intervals]
        part = np.repeat(np.arange(len(each)), [values.size for values in each])
        x = np.log(np.concatenate(each))
        least, reach = loops.distances(np.exp(x), 1 / max_ms)
        while True:
            slack = np.log(least * max_ms)
            apart = np.diff(x) > np.maximum(reach[1:] + reach[:-1], FINEST)
            plants = (x[1:] > log(first)) & (x[:-1] < log(last))
            k = np.flatnonzero(apart & plants & _alike(slack, part))
            if not k.size:
                break
            more = (x[k] + x[k + 1]) / 2
            found = loops.distances(np.exp(more), 1 / max_ms)
            x, part = np.insert(x, k + 1, more), np.insert(part, k + 1, part[k])
            least, reach = (
                np.insert(old, k + 1, new) for old, new in zip((least, reach), found, strict=True)
            )
        scan = cls(loops, max_ms, intervals, x, slack, part)
        return scan._with_extremes(np.diff(x) > reach[1:] + reach[:-1])

    def _at(self, x: FloatArray) -> FloatArray:
        least, _ = self.loops.distances(np.exp(np.ravel(x)), 1 / self.max_ms)
        return np.asarray(np.log(least * self.max_ms).reshape(np.shape(x)))

    def _with_extremes(self, apart: BoolArray) -> Scan:
        """Look into extremes that may lie on the other side of 0, where samples are apart."""
        size, alike = np.abs(self.slack), _alike(self.slack, self.part)
        low = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:]) & (size[1:-1] < NEARLY)
        low &= np.maximum(size[:-2], size[2:]) > size[1:-1] + FLAT
        k = 1 + np.flatnonzero(low & alike[1:] & alike[:-1] & (apart[1:] | apart[:-1]))
        if not k.size:
            return self
        way = np.where(self.slack[k] >= 0, 1.0, -1.0)
        found = elementwise.find_minimum(
            lambda x, way: way * self._at(x), (self.x[k - 1], self.x[k], self.x[k + 1]),
            args=(way,), tolerances={"xatol": 1e-7, "xrtol": 1e-9}, maxiter=40,
        )  # fmt: skip
        by_size = np.argsort(np.append(self.x, found.x), kind="stable")
        x, slack, part = (
            np.append(old, new)[by_size]
            for old, new in (
                (self.x, found.x), (self.slack, way * found.f_x), (self.part, self.part[k]),
            )
        )  # fmt: skip
        return replace(self, x=x, slack=slack, part=part)

    @cached_property
    def windows(self) -> list[tuple[Bracket, Bracket]]:
        """Where the slack is positive, as far as the samples tell."""
        good, x = self.slack >= 0, np.exp(self.x)
        k = np.flatnonzero((np.diff(self.part) == 0) & (good[1:] != good[:-1]))
        found: list[tuple[Bracket, Bracket]] = []
        for number, interval in enumerate(self.intervals):
            mine = good[self.part == number]
            ends = [
                Bracket(*pair) if good[i + 1] else Bracket(*pair[::-1])
                for i, pair in ((i, x[i : i + 2].tolist()) for i in k[self.part[k] == number])
            ]
            low, high = (Bracket(end, end) for end in interval)
            ends = [low] * bool(mine[0]) + ends + [high] * bool(mine[-1])
            found += zip(ends[::2], ends[1::2], strict=True)
        return found

    def solved(self, bracket: Bracket) -> float:
        """Find where the slack passes 0 at a bracket, to some eight digits."""
        outside, inside = np.log([[each] for each in bracket])
        return float(np.exp(bisect(self._at, outside, inside, BESIDE)[0]))

    @cached_property
    def best(self) -> float:
        """Ln λ of the largest slack."""
        highest = np.flatnonzero(self.slack > self.slack.max() - FLAT)
        k = int(highest[highest.size // 2])
        around = slice(max(k - 1, 0), k + 2)
        x, slack = self.x[around], self.slack[around]
        if np.unique(self.part[around]).size > 1 or x.size < 3 or slack.min() == slack.max():
            return float(self.x[k])
        found = elementwise.find_minimum(
            lambda x: -self._at(x), tuple(x), tolerances={"xatol": 1e-6}
        )
        return float(found.x if -found.f_x > self.slack[k] else self.x[k])


def _alike(slack: FloatArray, part: IntArray) -> BoolArray:
    """Tell between which neighbours of one interval the slack keeps its side."""
    return np.asarray((np.diff(part) == 0) & ((slack[1:] >= 0) == (slack[:-1] >= 0)))


def _samples(low: float, high: float, first: float, last: float) -> FloatArray:
    """Time constants to try between two critical ones, or from `first` to `last` and beyond."""
    begin = low or min(first, high * 10.0**-DECADES)
    end = high if high < inf else max(last, begin * 10.0**DECADES)
    inside = np.geomspace(begin, end, max(8, ceil(PER_DECADE * log10(end / begin))) + 1)[1:-1]
    far = np.logspace(0, FAR, FAR * SPARSE + 1)[1:]
    faster = begin / far[::-1] if not low else far[:0]
    slower = end * far if high == inf else far[:0]
    # At an end the loop is unstable; beside it Ms is large.
    return np.array([*faster, begin * (1 + 1e-6), *inside, end * (1 - 1e-6), *slower])


def solved(slack: Callable[[float], float], bracket: Bracket) -> float | None:
    """Find the end of what meets a limit to the last digits, on the side where it is met.

    Parameters
    ----------
    slack : callable
        Takes a value, and is negative where the limit is not met.
    bracket : Bracket
        Values on both sides of the end; one value twice for an end that is known.

    Returns
    -------
    float or None
        None if the limit is not met inside.
    """
    outside, inside = bracket
    if outside == inside or slack(outside) >= 0:
        return outside
    if slack(inside) < 0:
        return None
    bad, good = log(outside), log(inside)
    found = float(brentq(lambda x: slack(exp(x)), bad, good, xtol=1e-12, rtol=1e-13))
    way = 1.0 if good > bad else -1.0
    near = (exp(found + way * x) for x in ROUNDING)
    return next((value for value in near if slack(value) >= 0), inside)
