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
from functools import cache, cached_property
from math import ceil, exp, inf, log, log10
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ..analysis import Margins, quotient_margins
from ..diagram import DelayedTransferFunction, FilterFamily, LowPassFilter, ObserverEquations
from ..numerics import FloatArray
from .excluded import admissible
from .existence import stabilizing_filter_exists
from .mismatch import Mismatch
from .mismatchgrid import Frequencies
from .prices import PricedSearch, Prices, member, sluggishness
from .slack import PlantLoops, Specification
from .timeconstants import stabilizing_set

__all__ = ["FilterSearch", "admissible_time_constants", "design_filter"]

PER_DECADE, DECADES = 16, 3
"""How densely time constants are tried, and how far beyond the time constants of the plant."""

CLOSE = 0.1
"""Half the width, in ln λ, within which the top of the slack is looked for at least."""

BESIDE, WIDER = 1e-8, 30.0
"""Distance from an end, in ln λ, at which it is confirmed, and by how much it grows otherwise."""

ROUNDING = (0.0, 1e-12, 1e-11, 1e-10, 1e-9)
"""Steps inwards from an end, in ln λ, until rounding does not matter."""

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
        G and G̃, both with or without dead time.
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
        The one of smallest nλ, or what corresponds to it in a family.

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
    if prices or _waits(model) or any(isinstance(each, FilterFamily) for each in orders):
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
            floor = search.intervals[0][0]
            looked_at = f" (looked at down to {floor:.3g} s)" if floor else ""
            raise ValueError(
                f"{specification} is met by every filter of order {search.order}, however fast"
                f"{looked_at}; let the noise choose, for example by the largest |U_eta| that the "
                "actuator bears"
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
        G and G̃, both with or without dead time.
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
        so fast, or so slow. With dead time nothing is looked for below the default floor of
        `nrdob.critical_time_constants`.

    Raises
    ------
    TypeError, ValueError
        As `design_filter`, but for a specification that no λ meets.

    Notes
    -----
    No λ is tried: what the specification forbids at each frequency is a range of λ, and left out.
    So windows of a millionth of their λ are found, and their ends confirmed by exact margins. That
    no range is missed between two frequencies rests on how densely they lie beside each pole, zero
    and turn of the dead time: it is not proved. With limits on the price, with a family other than
    the lags, and with a model that waits, the slack is sampled over λ instead, closer beside each
    extreme; the ends are confirmed in the same way.

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
    if prices or _waits(model) or isinstance(order, FilterFamily):
        specification = _specification(prices, max_ms, min_gm_db, min_pm_deg)
        prices.check_controller(controller, model)
        return PricedSearch.of(process, model, order, specification, prices, controller).windows
    specification = Specification(max_ms, min_gm_db, min_pm_deg)
    return FilterSearch.of(process, model, order, specification).admissible()


def _orders(
    process: Any, model: Any, order: int | FilterFamily | Sequence[int | FilterFamily] | None
) -> tuple[Any, ...]:
    """Give the orders and families to be compared."""
    if order is None:
        lowest = Mismatch.of(process, model, waits=True).order
        return tuple(range(lowest, lowest + EXTRA_ORDERS + 1))
    several = tuple(order) if isinstance(order, list | tuple) else (order,)
    if not several:
        raise ValueError("order is an empty list; give an order, a family, or several of them")
    return several


def _waits(model: Any) -> bool:
    """Tell whether a model has a dead time."""
    return isinstance(model, DelayedTransferFunction) and model.delay > 0


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
    prices.check_controller(controller, model)
    asked = ", ".join(filter(None, [str(specification or ""), str(prices)]))
    searches = []
    for family in families:
        search = PricedSearch.of(process, model, family, specification, prices, controller)
        if (low := search.met_from) is not None:
            edge = f"down to the border of stability at {low:.4g} s"
            if low == search.floor:
                edge = f"however fast{f' (looked at down to {low:.3g} s)' if low else ''}"
            raise ValueError(
                f"{asked} is met by every filter of {_named(search.family)}, {edge}; ask for "
                "more, such as max_ms against the border, or max_u_eta against the noise"
            )
        searches.append(search)
    best = [member(search.family, low) for search in searches for low, _ in search.windows[:1]]
    found = [(sluggishness(process, model, filter), filter) for filter in best]
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


@dataclass(frozen=True, eq=False)
class FilterSearch:
    """The search for the filters of one order that meet a specification.

    Attributes
    ----------
    order : int
        n.
    intervals : list of (low, high)
        The stabilising set.
    windows : list of (low, high)
        Where in it the specification is met, all of them, but for the last digits.
    plant_loop : callable
        Margins of L as a function of λ: they decide.
    specification : Specification
        What is asked of them.
    frequencies : Frequencies
        Where the mismatch is looked at.
    """

    order: int
    intervals: list[tuple[float, float]]
    windows: list[tuple[float, float]]
    plant_loop: Callable[[float], Margins]
    specification: Specification
    frequencies: Frequencies

    @classmethod
    def of(cls, process: Any, model: Any, order: int, specification: Specification) -> FilterSearch:
        """Find the stabilising set, and in it where the specification is met."""
        frequencies = Frequencies(Mismatch.of(process, model, order))
        intervals = stabilizing_set(frequencies, frequencies.lowest_floor)

        @cache
        def plant_loop(time_constant: float) -> Margins:
            stable = any(low < time_constant < high for low, high in intervals)
            loop = ObserverEquations(process, model, LowPassFilter(time_constant, order))
            return quotient_margins(loop.L, stable)

        windows = admissible(frequencies, specification, intervals)
        return cls(order, intervals, windows, plant_loop, specification, frequencies)

    @property
    def promise(self) -> float:
        """Smallest nλ that is not excluded, in seconds: 0 if all will do, inf if none."""
        if not self.windows:
            return inf
        return 0.0 if self._all_fast_ones_do else self.order * self.windows[0][0]

    @property
    def _all_fast_ones_do(self) -> bool:
        """Whether the first window begins with the fastest filter there is."""
        return bool(self.windows) and self.windows[0][0] == self.intervals[0][0]

    def slack(self, time_constant: float) -> float:
        """Exact slack of the specification."""
        return self.specification.slack(self.plant_loop(time_constant))

    def fastest(self) -> float | None:
        """Find the smallest λ that meets the specification: None if none does, 0 if all do."""
        if self._all_fast_ones_do:
            return 0.0
        ends = (self._end(low, high) for low, high in self.windows)
        return next((end for end in ends if end is not None), None)

    def admissible(self) -> list[tuple[float, float]]:
        """Find all intervals of λ that meet the specification."""
        ends = {end for ends in self.intervals for end in ends}
        found = []
        for window in self.windows:
            low, high = (
                end if end in ends else self._end(end, other)
                for end, other in (window, window[::-1])
            )
            if low is not None and high is not None:
                found.append((low, high))
        return found

    def closest(self) -> tuple[float, float]:
        """Find the λ of the greatest slack, and the slack."""
        tried, slacks = self._tried
        k = int(slacks.argmax())
        low, high = next(ends for ends in self.intervals if ends[0] < tried[k] < ends[1])
        inside = tried[(tried > low) & (tried < high)]
        # The slack off the grid has its top a little beside the true one.
        middle, at = log(tried[k]), int(np.searchsorted(inside, tried[k]))
        below, above = inside[max(at - 1, 0)], inside[min(at + 1, inside.size - 1)]
        around = (
            max(min(middle - CLOSE, log(below)), log(inside[0])),
            min(max(middle + CLOSE, log(above)), log(inside[-1])),
        )
        best = minimize_scalar(
            lambda x: -self._precise(np.exp([x]))[0], bounds=around, method="bounded",
            options={"xatol": 1e-4 * (around[1] - around[0])},
        )  # fmt: skip
        time_constant = float(np.exp(best.x)) if -best.fun > slacks[k] else float(tried[k])
        return time_constant, self.slack(time_constant)

    @cached_property
    def _tried(self) -> tuple[FloatArray, FloatArray]:
        """Time constants all over the stabilising set, and the slack of each."""
        samples = [_samples(low, high, self.frequencies.mismatch) for low, high in self.intervals]
        tried = np.concatenate(samples)
        return tried, self._precise(tried)

    def _precise(self, time_constants: FloatArray) -> FloatArray:
        """Slack of many time constants at once."""
        return self.specification.of_many(self._loops, time_constants)

    @cached_property
    def _loops(self) -> PlantLoops:
        return PlantLoops.of(self.frequencies, self.intervals[0][0])

    def _end(self, end: float, other: float) -> float | None:
        """Find the end of a window to the last digits, by the exact slack: None if there is none.

        A window is known to about 1e-8 of its end, less closely where an edge of what is excluded
        is steep. Where a crossover appears the slack jumps.
        """
        way = 1.0 if other > end else -1.0
        width = abs(log(other / end)) if 0 < other < inf else 1.0

        def at(step: float) -> float:
            return end * exp(way * step)

        inwards = (BESIDE * WIDER**k for k in range(6))
        good = next((x for x in inwards if x < width and self.slack(at(x)) >= 0), None)
        if good is None:
            return None
        bad = next((-good * k for k in (1.0, WIDER) if self.slack(at(-good * k)) < 0), None)
        if bad is None:
            return at(good)
        border = float(brentq(lambda x: self.slack(at(x)), bad, good, xtol=1e-12, rtol=1e-12))
        return next((at(border + x) for x in ROUNDING if self.slack(at(border + x)) >= 0), at(good))


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
    stable = [search for search in searches if search.intervals]
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
