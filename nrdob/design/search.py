r"""The fastest filter that meets a specification, judged on the loop that the plant feels.

Among filters of different order "fastest" means the one that rejects most. A disturbance reaches
the output through :math:`S_d = (1 - F)/(1 + FH)`, which at low frequency is
:math:`n\lambda s/R(0)`: what a constant disturbance leaves behind, and how far a ramp pulls the
output away, is proportional to nλ, and R(0) is the same for every filter. So the smallest nλ wins;
the bandwidth of F would flatter the high orders.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import ceil, exp, inf, log, log10
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ..analysis import Margins, margins
from ..diagram import FilterFamily, LowPassFilter, ObserverEquations
from ..numerics import BoolArray, FloatArray
from .limits import stabilizing_filter_exists
from .mismatch import Mismatch
from .mismatchgrid import Frequencies
from .prices import PricedSearch, Prices, member, sluggishness
from .slack import PlantLoops, Specification
from .timeconstants import lowest_floor, stabilizing_set

PER_DECADE, DECADES = 16, 3
"""How densely time constants are tried, and how far beyond the time constants of the plant."""

REFINED, BETWEEN = 4, 3
"""How often the surroundings of each extreme of the slack are refined, and by how many more."""

CLOSE = 0.1
"""Slack within which the frequencies between those of the grid are looked at, too."""

SMALL_STEP, HALVINGS = 1e-6, 26
"""Share of a window that counts as rounding at its end; how closely an end is found otherwise."""

NEARLY = 0.02
"""Slack by which the top of a peak may exceed the samples beside it."""

EXTRA_ORDERS = 2
"""How many orders above the lowest causal one are tried where none is asked for."""


def design_filter(
    process: Any,
    model: Any,
    *,
    order: int | FilterFamily | Sequence[int | FilterFamily] | None = None,
    max_ms: float | None = None,
    min_gm_db: float | None = None,
    min_pm_deg: float | None = None,
    max_noise: float | None = None,
    max_u_eta: float | None = None,
    max_u_step_d: float | None = None,
    max_u_step_R: float | None = None,
    controller: Any = None,
) -> LowPassFilter | ct.TransferFunction:
    """Find the filter that rejects most and whose plant loop L meets a specification.

    Of one order that is the filter of widest bandwidth, the smallest λ. Orders are compared by nλ,
    the slope of the filter's part in S_d at low frequency, which says what a slow disturbance
    leaves behind. Families are compared alike: where S_d ~ c s^k, by c^(1/k), one over the
    frequency at which that line reaches 1, whatever the ramp k. Margins are those of
    L = F·R/(1 - F), R = G/G̃, because these are what a change of the plant uses up; the margins of
    F·H are not.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G, with or without dead time, and G̃.
    order : int or FilterFamily, or several of them, optional
        Order or family of the filter. By default the lowest causal order and the next two are
        compared.
    max_ms : float, optional
        Largest allowed peak of the sensitivity ``|S_d|``; above 1.
    min_gm_db : float, optional
        Smallest allowed gain margin, up and down, in dB.
    min_pm_deg : float, optional
        Smallest allowed phase margin in degrees, below 180.
    max_noise : float, optional
        Largest allowed standard deviation of u for white measurement noise of unit density,
        ``‖U_η‖₂``.
    max_u_eta : float, optional
        Largest allowed peak of ``|U_η|``, noise to controller output, over all frequencies.
    max_u_step_d, max_u_step_R : float, optional
        Largest allowed ``|u|`` after a unit step of d, or of R, for which C must be given.
    controller : as for `nrdob.NRDOB`, optional
        C, for `max_u_step_R` alone.

    Returns
    -------
    LowPassFilter, or control.TransferFunction of another family

    Raises
    ------
    TypeError
        If a block, the order or a limit is of the wrong type.
    ValueError
        If no specification is given, or one that no loop can meet; if no filter stabilises the
        loop; if none meets the specification (the message gives the best that can be had); or if
        every filter does, however fast, so that noise alone must choose.

    See Also
    --------
    admissible_time_constants : all time constants of one order that meet it.

    Examples
    --------
    Example 2 of the paper, a zero in the right half plane:

    >>> import control as ct
    >>> s = ct.tf('s')
    >>> F = design_filter(0.1*(100 - s)/(s + 2), 10/(s + 2), order=2, max_ms=1.6)
    >>> round(F.time_constant, 5)
    0.01708
    """
    orders = _orders(process, model, order)
    prices = Prices(max_noise, max_u_eta, max_u_step_d, max_u_step_R)
    if prices or any(isinstance(each, FilterFamily) for each in orders):
        specification = _specification(prices, max_ms, min_gm_db, min_pm_deg)
        return _best_paid(process, model, orders, specification, prices, controller)
    specification = Specification(max_ms, min_gm_db, min_pm_deg)
    searches = [FilterSearch.of(process, model, n, specification) for n in orders]
    best: LowPassFilter | None = None
    for search in sorted(searches, key=lambda search: search.promise):
        if best and search.promise > _sluggishness(best):
            break
        time_constant = search.fastest()
        if time_constant == 0:
            raise ValueError(
                f"{specification} is met by every filter of order {search.order}, however fast "
                f"(tried down to {search.tried[0]:.3g} s); let the noise choose, for example by "
                "the largest |U_eta| that the actuator bears"
            )
        if time_constant and (not best or search.order * time_constant < _sluggishness(best)):
            best = LowPassFilter(time_constant, search.order)
    if best:
        return best
    raise ValueError(_refusal(process, model, searches, specification))


def admissible_time_constants(
    process: Any,
    model: Any,
    order: int | FilterFamily,
    *,
    max_ms: float | None = None,
    min_gm_db: float | None = None,
    min_pm_deg: float | None = None,
    max_noise: float | None = None,
    max_u_eta: float | None = None,
    max_u_step_d: float | None = None,
    max_u_step_R: float | None = None,
    controller: Any = None,
) -> list[tuple[float, float]]:
    """Find all λ for which the filter meets a specification on the plant loop L.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G, with or without dead time, and G̃.
    order : int or FilterFamily
        n of the filter 1/(λs + 1)^n, or a family from `nrdob.filter_family`.
    max_ms, min_gm_db, min_pm_deg : float, optional
        What is asked of the margins, as for `design_filter`.
    max_noise, max_u_eta, max_u_step_d, max_u_step_R : float, optional
        What it may cost, as for `design_filter`. At least one limit must be given.
    controller : as for `nrdob.NRDOB`, optional
        C, for `max_u_step_R` alone.

    Returns
    -------
    list of (low, high)
        Intervals in seconds, increasing, within those of `nrdob.stabilizing_time_constants`; empty
        where no λ will do. `low` is 0 and `high` inf where every filter will do that is at least
        so fast, or so slow. With dead time nothing is looked for below
        `nrdob.design.timeconstants.default_floor`.

    Raises
    ------
    TypeError, ValueError
        As `design_filter`, but for a specification that no λ meets.

    Examples
    --------
    An unstable plant: with a slow filter the loop is lost, with a fast one it comes close to it.

    >>> import control as ct
    >>> s = ct.tf('s')
    >>> found = admissible_time_constants(4/(2 - s - s**2), -1/(s**2 + 3*s + 2), 2, max_ms=1.5)
    >>> [(round(low, 4), round(high, 4)) for low, high in found]
    [(0.0, 0.031)]
    """
    prices = Prices(max_noise, max_u_eta, max_u_step_d, max_u_step_R)
    if prices or isinstance(order, FilterFamily):
        specification = _specification(prices, max_ms, min_gm_db, min_pm_deg)
        prices.check_controller(controller)
        return PricedSearch.of(process, model, order, specification, prices, controller).windows
    specification = Specification(max_ms, min_gm_db, min_pm_deg)
    return FilterSearch.of(process, model, order, specification).admissible()


def _orders(
    process: Any, model: Any, order: int | FilterFamily | Sequence[int | FilterFamily] | None
) -> tuple[Any, ...]:
    """Give the orders and families to be compared."""
    if order is None:
        lowest = Mismatch.of(process, model).order
        return tuple(range(lowest, lowest + EXTRA_ORDERS + 1))
    several = tuple(order) if isinstance(order, list | tuple) else (order,)
    if not several:
        raise ValueError("order is an empty list; give an order, a family, or several of them")
    return several


def _specification(prices: Prices, *margins: float | None) -> Specification | None:
    """Return the specification of the margins, if there is one besides other limits."""
    return None if prices and margins == (None, None, None) else Specification(*margins)


def _best_paid(
    process: Any,
    model: Any,
    families: tuple[int | FilterFamily, ...],
    specification: Specification | None,
    prices: Prices,
    controller: Any,
) -> Any:
    """Find the filter that rejects most among families and orders, if limits are on its price."""
    prices.check_controller(controller)
    asked = ", ".join(filter(None, [str(specification or ""), str(prices)]))
    searches = [
        PricedSearch.of(process, model, family, specification, prices, controller)
        for family in families
    ]
    found = []
    for search in searches:
        for low, _ in search.windows[:1]:
            if low in (ends[0] for ends in search.intervals):
                edge = f"down to the border of stability at {low:.4g} s" if low else "however fast"
                raise ValueError(
                    f"{asked} is met by every filter of {_named(search.family)}, {edge}; ask for "
                    "more, such as max_ms against the border, or max_u_eta against the noise"
                )
            best = member(search.family, low)
            found.append((sluggishness(process, model, best), best))
    if found:
        return min(found, key=lambda item: item[0])[1]
    names = " or ".join(_named(search.family) for search in searches)
    stable = [search for search in searches if search.intervals]
    if not stable:
        raise ValueError(f"no filter of {names} stabilises the loop: choose another model")
    closest = max(stable, key=lambda search: search.best[1])
    raise ValueError(
        f"no filter of {names} meets {asked}; closest comes λ = {closest.best[0]:.4g} s of "
        f"{_named(closest.family)}: relax the specification or choose another model"
    )


def _named(family: int | FilterFamily) -> str:
    if isinstance(family, FilterFamily):
        return f"the {family.kind} family of order {family.order}"
    return f"order {family}"


def _sluggishness(filter: LowPassFilter) -> float:
    return filter.order * filter.time_constant


@dataclass(frozen=True)
class _Window:
    """Time constants that meet the specification, and what was tried around them.

    Attributes
    ----------
    low, high : float
        First and last that will do, in seconds.
    bounded_below, bounded_above : bool
        Whether the next one tried will not do.
    """

    low: float
    high: float
    bounded_below: bool
    bounded_above: bool


@dataclass(frozen=True, eq=False)
class FilterSearch:
    """The search for the filters of one order that meet a specification.

    Attributes
    ----------
    order : int
        n.
    intervals : list of (low, high)
        The stabilising set.
    tried : array of float
        The λ at which the specification was looked at, increasing, in seconds.
    slacks : array of float
        By how much it is met at each.
    windows : list of _Window
        Where it is met, all of them.
    precise : callable
        Slack as a function of λ, between the frequencies of the grid, too.
    plant_loop : callable
        Margins of L as a function of λ: they decide.
    specification : Specification
        What is asked of them.
    """

    order: int
    intervals: list[tuple[float, float]]
    tried: FloatArray
    slacks: FloatArray
    windows: list[_Window]
    precise: Callable[[float], float]
    plant_loop: Callable[[float], Margins]
    specification: Specification

    @classmethod
    def of(cls, process: Any, model: Any, order: int, specification: Specification) -> FilterSearch:
        """Find the stabilising set, and in it where the specification is met."""
        frequencies = Frequencies(Mismatch.of(process, model, order))
        mismatch = frequencies.mismatch
        intervals = stabilizing_set(frequencies, lowest_floor(frequencies))

        @cache
        def plant_loop(time_constant: float) -> Margins:
            stable = any(low < time_constant < high for low, high in intervals)
            loop = ObserverEquations(process, model, LowPassFilter(time_constant, order))
            return margins(loop.L, stable, loop.p_B)

        samples = [_samples(low, high, mismatch) for low, high in intervals]
        slowest = float(samples[0][0]) if samples else 1.0
        loops = PlantLoops.of(frequencies, slowest) if samples else PlantLoops(mismatch, np.ones(1))

        def precise(time_constant: float) -> float:
            return float(specification.of_many(loops, np.array([time_constant]), rough=False)[0])

        looked = [_looked_at(loops, tried, specification) for tried in samples]
        windows = [w for tried, slacks in looked for w in _windows(tried, slacks, precise)]
        tried, slacks = (
            np.concatenate([*part, np.empty(0)])
            for part in (zip(*looked, strict=True) if looked else ((), ()))
        )
        return cls(order, intervals, tried, slacks, windows, precise, plant_loop, specification)

    @property
    def promise(self) -> float:
        """Smallest nλ that is not excluded, in seconds: 0 if all will do, inf if none."""
        if not self.windows:
            return inf
        return 0.0 if self._begins(self.windows[0]) else self.order * self.windows[0].low

    def _begins(self, window: _Window) -> bool:
        """Whether a window begins with the fastest filter tried."""
        return not window.bounded_below and window.low == self.tried[0]

    def slack(self, time_constant: float) -> float:
        """Exact slack of the specification."""
        return self.specification.slack(self.plant_loop(time_constant))

    def fastest(self) -> float | None:
        """Find the smallest λ that meets the specification: None if none does, 0 if all do."""
        for window in self.windows:
            if self._begins(window):
                return 0.0
            found = self._end(window, window.low, window.high)
            if found is not None:
                return found
        return None

    def admissible(self) -> list[tuple[float, float]]:
        """Find all intervals of λ that meet the specification."""
        found = []
        for window in self.windows:
            low = self._end(window, window.low, window.high)
            high = self._end(window, window.high, window.low)
            if low is None or high is None:
                continue
            inside = next(ends for ends in self.intervals if ends[0] < low < ends[1])
            found.append(
                (
                    low if window.bounded_below else inside[0],
                    high if window.bounded_above else inside[1],
                )
            )
        return found

    def closest(self) -> tuple[float, float]:
        """Find the λ of the greatest slack, and the slack."""
        before, after = np.append(-inf, self.slacks[:-1]), np.append(self.slacks[1:], -inf)
        tops = (self.slacks > before) & (self.slacks >= after)  # of a plateau, its first end
        highest = np.flatnonzero(tops & (self.slacks > self.slacks.max() - CLOSE))
        k = max(highest.tolist(), key=lambda k: self.precise(float(self.tried[k])))
        low, high = next(ends for ends in self.intervals if ends[0] < self.tried[k] < ends[1])
        inside = self.tried[(self.tried > low) & (self.tried < high)]
        # The slack off the grid has its top a little beside the true one.
        middle, at = log(self.tried[k]), int(np.searchsorted(inside, self.tried[k]))
        below, above = inside[max(at - 1, 0)], inside[min(at + 1, inside.size - 1)]
        around = (
            max(min(middle - CLOSE, log(below)), log(inside[0])),
            min(max(middle + CLOSE, log(above)), log(inside[-1])),
        )
        best = minimize_scalar(
            lambda x: -self.precise(exp(x)), bounds=around, method="bounded",
            options={"xatol": 1e-4 * (around[1] - around[0])},
        )  # fmt: skip
        time_constant = max((float(np.exp(best.x)), float(self.tried[k])), key=self.precise)
        return time_constant, self.slack(time_constant)

    def _end(self, window: _Window, end: float, other: float) -> float | None:
        """Find the end of a window by the exact slack.

        It may differ by a rounding error; by more where a margin jumps because the loop gain just
        reaches 1 between two frequencies of the grid.
        """
        bad = end
        for step in np.logspace(-10, 0, 6).tolist():
            value = end * (other / end) ** step
            if self.slack(value) >= 0:
                return value if step <= SMALL_STEP else self._last_good(value, bad)
            bad = value
        return None

    def _last_good(self, good: float, bad: float) -> float:
        """Halve the way from a λ that meets the specification to one that does not."""
        for _ in range(HALVINGS):
            middle = (good * bad) ** 0.5
            good, bad = (middle, bad) if self.slack(middle) >= 0 else (good, middle)
        return good


def _looked_at(
    loops: PlantLoops, tried: FloatArray, specification: Specification
) -> tuple[FloatArray, FloatArray]:
    """Look at the specification at given λ, and around every extreme of its slack at more.

    Between two samples a slack can only change its sign unseen where it has an extreme; the
    surroundings of each are refined until the slack is the same from one to the next.
    """
    slacks = specification.of_many(loops, tried, rough=True)
    for _ in range(REFINED):
        more = _around_extremes(tried, slacks)
        if not more.size:
            break
        new = specification.of_many(loops, more, rough=True)
        tried, slacks = np.append(tried, more), np.append(slacks, new)
        by_size = np.argsort(tried)
        tried, slacks = tried[by_size], slacks[by_size]
    known = np.zeros(tried.size, dtype=bool)
    while (unsure := ((np.abs(slacks) < CLOSE) | _beside_a_change(slacks)) & ~known).any():
        slacks[unsure] = specification.of_many(loops, tried[unsure], rough=False)
        known |= unsure
    return tried, slacks


def _around_extremes(tried: FloatArray, slacks: FloatArray) -> FloatArray:
    """More λ in the gaps on both sides of each extreme that points towards the other sign."""
    inner, before, after = slacks[1:-1], slacks[:-2], slacks[2:]
    below = (inner < 0) & (inner >= before) & (inner >= after)
    above = (inner >= 0) & (inner <= before) & (inner <= after)
    level = (inner == before) & (inner == after)
    at = 1 + np.flatnonzero((below | above) & ~level)
    gaps = np.unique(np.concatenate([at - 1, at]))
    share = np.arange(1, BETWEEN + 1) / (BETWEEN + 1)
    low, high = tried[gaps, None], tried[gaps + 1, None]
    wide = (high > low * (1 + 1e-9)).ravel()
    return np.asarray((low * (high / low) ** share)[wide].ravel())


def _beside_a_change(slacks: FloatArray) -> BoolArray:
    """Tell which samples lie beside a change of sign."""
    changes = (slacks[1:] >= 0) != (slacks[:-1] >= 0)
    return np.asarray(np.append(changes, False) | np.append(False, changes))


def _windows(
    tried: FloatArray, slacks: FloatArray, precise: Callable[[float], float]
) -> list[_Window]:
    """Bound the runs of samples that meet a specification, and the peaks that nearly do."""
    tried, slacks = _with_peaks(tried, slacks, precise)
    good = slacks >= 0
    edges = np.flatnonzero(good[1:] != good[:-1])
    bounds = [0, *(edges + 1).tolist(), good.size]
    found = []
    for first, after in pairwise(bounds):
        if not good[first]:
            continue
        below, above = first > 0, after < good.size
        low, high = float(tried[first]), float(tried[after - 1])
        if below:
            low = _border(precise, low, float(tried[first - 1]))
        if above:
            high = _border(precise, high, float(tried[after]))
        found.append(_Window(low, high, below, above))
    return found


def _with_peaks(
    tried: FloatArray, slacks: FloatArray, precise: Callable[[float], float]
) -> tuple[FloatArray, FloatArray]:
    """Add the tops of peaks that reach nearly 0, where the specification may just be met."""
    inner = slacks[1:-1]
    peaks = (inner < 0) & (inner > -NEARLY) & (inner >= slacks[:-2]) & (inner >= slacks[2:])
    for k in 1 + np.flatnonzero(peaks):
        around = log(tried[k - 1]), log(tried[k + 1])
        best = minimize_scalar(
            lambda x: -precise(exp(x)), bounds=around, method="bounded",
            options={"xatol": 1e-3 * (around[1] - around[0])},
        )  # fmt: skip
        if best.fun <= 0:
            return _with_peaks(*_inserted(tried, slacks, exp(best.x), -best.fun), precise)
    return tried, slacks


def _inserted(
    tried: FloatArray, slacks: FloatArray, time_constant: float, slack: float
) -> tuple[FloatArray, FloatArray]:
    k = int(np.searchsorted(tried, time_constant))
    return np.insert(tried, k, time_constant), np.insert(slacks, k, slack)


def _border(precise: Callable[[float], float], good: float, bad: float) -> float:
    """Find where the slack passes 0 between two λ, on the good side."""
    border = float(brentq(lambda x: precise(exp(x)), log(good), log(bad), xtol=1e-11, rtol=1e-14))
    return exp(border)


def _samples(low: float, high: float, mismatch: Mismatch) -> FloatArray:
    """Time constants to try between two critical ones, or some decades around the plant's."""
    sizes = mismatch.speeds
    if not low:
        low = min(1 / float(sizes.max()), high) * 10.0**-DECADES
    if high == inf:
        high = max(1 / float(sizes.min()), low) * 10.0**DECADES
    count = max(8, ceil(PER_DECADE * log10(high / low)))
    inside = np.geomspace(low, high, count + 1)[1:-1]
    # At an end the loop is lost; beside it the margins are nearly zero.
    return np.array([low * (1 + 1e-6), *inside, high * (1 - 1e-6)])


def _refusal(
    process: Any, model: Any, searches: list[FilterSearch], specification: Specification
) -> str:
    """Say why there is no filter, and what comes closest."""
    orders = " or ".join(str(search.order) for search in searches)
    stable = [search for search in searches if search.tried.size]
    if not stable:
        answer = stabilizing_filter_exists(process, model)
        reason = "" if answer.holds else f" ({answer.reason})"
        return f"no filter of order {orders} stabilises the loop{reason}: choose another model"
    found = [(search, *search.closest()) for search in stable]
    closest, time_constant, _slack = max(found, key=lambda item: item[2])
    best = closest.plant_loop(time_constant)
    return (
        f"no filter of order {orders} meets {specification}; closest comes λ = "
        f"{time_constant:.4g} s, n = {closest.order}, with Ms = {best.ms:.4g}, "
        f"GM = {abs(best.gm_db):.4g} dB, PM = {best.pm:.4g}°: relax the specification or choose "
        "another model"
    )
