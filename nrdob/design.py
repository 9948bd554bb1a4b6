"""The fastest filter that meets a specification, judged on the loop that the plant feels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import ceil, inf, isfinite, log, log10
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from .blocks import BoolArray, ComplexArray, FloatArray
from .equations import ObserverEquations
from .filters import LowPassFilter
from .limits import stabilizing_filter_exists
from .margins import Margins, margins
from .mismatch import Mismatch
from .timeconstants import stabilizing_set

PER_DECADE, DECADES = 6, 3
"""How densely time constants are tried, and how far beyond the time constants of the plant."""

EXTRA_ORDERS = 2
"""How many orders above the lowest causal one are tried where none is asked for."""

UNSTABLE = -10.0
"""Slack given to a loop that is not stable, below that of any stable one tried."""


def design_filter(
    process: Any,
    model: Any,
    *,
    order: int | None = None,
    max_ms: float | None = None,
    min_gm_db: float | None = None,
    min_pm_deg: float | None = None,
) -> LowPassFilter:
    """Find the filter of widest bandwidth whose plant loop L meets a specification.

    Margins are those of L = F·R/(1 - F), R = G/G̃, because these are what a change of the plant uses
    up; the margins of F·H are not.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G, with or without dead time, and G̃.
    order : int, optional
        Order of the filter. By default the lowest causal one and the next two are compared.
    max_ms : float, optional
        Largest allowed peak of the sensitivity ``|S_d|``; above 1.
    min_gm_db : float, optional
        Smallest allowed gain margin, up and down, in dB.
    min_pm_deg : float, optional
        Smallest allowed phase margin in degrees, below 180.

    Returns
    -------
    LowPassFilter

    Raises
    ------
    TypeError
        If a block or the order is of the wrong type.
    ValueError
        If no specification is given, or one that no loop can meet; if no filter stabilises the
        loop; if none meets the specification (the message gives the best that can be had); or if
        every filter does, however fast, so that noise alone must choose.

    Examples
    --------
    Example 2 of the paper, a zero in the right half plane:

    >>> import control as ct
    >>> s = ct.tf('s')
    >>> F = design_filter(0.1*(100 - s)/(s + 2), 10/(s + 2), order=2, max_ms=1.6)
    >>> round(F.time_constant, 5)
    0.01708
    """
    specification = Specification(max_ms, min_gm_db, min_pm_deg)
    if order is None:
        lowest = Mismatch.of(process, model).order
        orders = range(lowest, lowest + EXTRA_ORDERS + 1)
    else:
        orders = range(order, order + 1)
    searches = [FilterSearch.of(process, model, n, specification) for n in orders]
    best: LowPassFilter | None = None
    for search in sorted(searches, key=lambda search: -search.promise):
        if best and search.promise < best.bandwidth:
            break
        time_constant = search.fastest()
        if time_constant == 0:
            raise ValueError(
                f"{specification} is met by every filter of order {search.order}, however fast "
                f"(tried down to {search.tried[0]:.3g} s); let the noise choose, for example by "
                "the largest |U_eta| that the actuator bears"
            )
        if time_constant:
            found = LowPassFilter(time_constant, search.order)
            best = found if not best or found.bandwidth > best.bandwidth else best
    if best:
        return best
    raise ValueError(_refusal(process, model, searches, specification))


@dataclass(frozen=True)
class Specification:
    """What is asked of the plant loop; at least one of the three.

    Attributes
    ----------
    max_ms, min_gm_db, min_pm_deg : float or None
        As for `design_filter`.
    """

    max_ms: float | None = None
    min_gm_db: float | None = None
    min_pm_deg: float | None = None

    def __post_init__(self) -> None:
        if self.max_ms is None and self.min_gm_db is None and self.min_pm_deg is None:
            raise ValueError(
                "nothing is specified; give max_ms, min_gm_db or min_pm_deg, for example max_ms=1.7"
            )
        if self.max_ms is not None and not 1 < self.max_ms < inf:
            raise ValueError(
                f"max_ms is {self.max_ms}; |S_d| tends to 1 at high frequency, so its peak cannot "
                "be held to 1 or less: give a number above 1, for example 1.7"
            )
        if self.min_gm_db is not None and not (isfinite(self.min_gm_db) and self.min_gm_db > 0):
            raise ValueError(
                f"min_gm_db is {self.min_gm_db}; it is how far the gain may move either way, in "
                "dB: give a positive number, for example 6"
            )
        if self.min_pm_deg is not None and not 0 < self.min_pm_deg < 180:
            raise ValueError(
                f"min_pm_deg is {self.min_pm_deg}; give an angle between 0 and 180 degrees, for "
                "example 45"
            )

    def slack(self, found: Margins) -> float:
        """By how much a loop meets the specification; negative where it does not."""
        if not found.stable:
            return UNSTABLE
        slacks = [-UNSTABLE]
        if self.max_ms is not None:
            slacks.append(log(self.max_ms / found.ms))
        if self.min_gm_db is not None:
            slacks.append((abs(found.gm_db) - self.min_gm_db) / 20)
        if self.min_pm_deg is not None:
            slacks.append((found.pm - self.min_pm_deg) / 60)
        return max(min(slacks), UNSTABLE)

    def __str__(self) -> str:
        given = {"Ms ≤ %g": self.max_ms, "GM ≥ %g dB": self.min_gm_db, "PM ≥ %g°": self.min_pm_deg}
        return ", ".join(text % value for text, value in given.items() if value is not None)


@dataclass(frozen=True, eq=False)
class FilterSearch:
    """The search for the fastest filter of one order.

    Attributes
    ----------
    order : int
        n.
    intervals : list of (low, high)
        The stabilising set.
    tried : list of float
        The λ at which the specification is looked at, increasing; two neighbours may lie on both
        sides of a stretch where the loop is unstable.
    rough : array of float
        Slack of the specification at each, read off a grid of frequencies.
    plant_loop : callable
        Margins of L as a function of λ.
    specification : Specification
        What is asked of them.
    """

    order: int
    intervals: list[tuple[float, float]]
    tried: list[float]
    rough: FloatArray
    plant_loop: Callable[[float], Margins]
    specification: Specification

    @classmethod
    def of(cls, process: Any, model: Any, order: int, specification: Specification) -> FilterSearch:
        """Prepare the search: the stabilising set, and where in it to look."""
        mismatch = Mismatch.of(process, model, order)
        intervals = stabilizing_set(mismatch, mismatch.default_floor)
        tried = [value for ends in intervals for value in _samples(*ends, mismatch)]

        @cache
        def plant_loop(time_constant: float) -> Margins:
            stable = any(low < time_constant < high for low, high in intervals)
            loop = ObserverEquations(process, model, LowPassFilter(time_constant, order))
            return margins(loop.L, stable, loop.p_B)

        rough = _rough_slacks(mismatch, tried, specification)
        return cls(order, intervals, tried, rough, plant_loop, specification)

    @property
    def promise(self) -> float:
        """Bandwidth that the rough slacks do not exclude, in rad/s."""
        good = np.flatnonzero(self.rough >= 0)
        if not good.size:
            return 0.0
        fastest = self.tried[max(int(good[0]) - 1, 0)]
        return LowPassFilter(fastest, self.order).bandwidth if good[0] else inf

    def slack(self, exponent: float) -> float:
        """Exact slack of the specification at ln λ."""
        return self.specification.slack(self.plant_loop(float(np.exp(exponent))))

    def fastest(self) -> float | None:
        """Find the smallest λ that meets the specification: None if none does, 0 if all do."""
        exponents = [log(value) for value in self.tried]
        # The rough slacks tell where to begin, the exact ones decide.
        first = next(iter(np.flatnonzero(self.rough >= 0).tolist()), len(exponents))
        while first > 0 and self.slack(exponents[first - 1]) >= 0:
            first -= 1
        while first < len(exponents) and self.slack(exponents[first]) < 0:
            first += 1
        if first == len(exponents):
            return None
        if first == 0:
            return 0.0
        bad, good = exponents[first - 1], exponents[first]
        border = float(brentq(self.slack, bad, good, xtol=1e-10))
        # The zero found may lie a rounding error on the wrong side.
        steps = [0.0, *(good - border) * np.logspace(-8, 0, 5)]
        return next(
            float(np.exp(border + step)) for step in steps if self.slack(border + step) >= 0
        )

    def closest(self) -> tuple[float, float]:
        """Find the λ of the greatest slack, and the slack."""
        k = int(np.argmax(self.rough))
        around = (self.tried[max(k - 1, 0)], self.tried[min(k + 1, len(self.tried) - 1)])
        best = minimize_scalar(lambda x: -self.slack(x), bounds=np.log(around), method="bounded")
        return float(np.exp(best.x)), float(-best.fun)


def _rough_slacks(
    mismatch: Mismatch, tried: list[float], specification: Specification
) -> FloatArray:
    """Read the slacks off L(jω) on a grid of frequencies, for all λ at once."""
    if not tried:
        return np.empty(0)
    omega = mismatch.frequencies(tried[0])
    R = mismatch.ratio(omega)
    F = (1 + 1j * np.outer(tried, omega)) ** -mismatch.order
    L = F * R / (1 - F)
    slacks = []
    if specification.max_ms is not None:
        slacks.append(np.log(specification.max_ms * np.abs(1 + L).min(axis=1)))
    if specification.min_pm_deg is not None:
        crossing, L_there = _interpolated(np.log(np.abs(L)), L)
        phase = np.where(crossing, np.degrees(np.abs(np.angle(-L_there))), 180.0).min(axis=1)
        slacks.append((phase - specification.min_pm_deg) / 60)
    if specification.min_gm_db is not None:
        crossing, L_there = _interpolated(L.imag, L)
        size = np.where(crossing & (L_there.real < 0), np.abs(L_there), 1e-10)
        gain = np.abs(np.log10(size))
        slacks.append(gain.min(axis=1) - specification.min_gm_db / 20)
    return np.asarray(np.min(slacks, axis=0))


def _interpolated(function: FloatArray, L: ComplexArray) -> tuple[BoolArray, ComplexArray]:
    """Tell where rows of a function change sign, and interpolate L there."""
    before, after = function[:, :-1], function[:, 1:]
    share = before / np.where(before == after, 1.0, before - after)
    return before * after < 0, L[:, :-1] + share * (L[:, 1:] - L[:, :-1])


def _samples(low: float, high: float, mismatch: Mismatch) -> list[float]:
    """Time constants to try between two critical ones, or some decades around the plant's."""
    sizes = mismatch.speeds
    if not low:
        low = min(1 / float(sizes.max()), high) * 10.0**-DECADES
    if high == inf:
        high = max(1 / float(sizes.min()), low) * 10.0**DECADES
    count = max(8, ceil(PER_DECADE * log10(high / low)))
    inside = np.geomspace(low, high, count + 1)[1:-1]
    # At an end the loop is lost; beside it the margins are nearly zero.
    return [low * (1 + 1e-6), *inside.tolist(), high * (1 - 1e-6)]


def _refusal(
    process: Any, model: Any, searches: list[FilterSearch], specification: Specification
) -> str:
    """Say why there is no filter, and what comes closest."""
    orders = " or ".join(str(search.order) for search in searches)
    stable = [search for search in searches if search.tried]
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
