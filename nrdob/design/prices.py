r"""What a filter costs: noise on u, and how far u moves, as limits on the time constant.

A limit that no closed form inverts is met on some intervals of λ. They are found by sampling its
slack, by looking closer at every extreme that comes close to 0, and by solving for the ends. The
slack of margins alone is sampled for all λ at once; the ends are solved for with exact margins.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import cache, cached_property, partial
from itertools import pairwise
from math import ceil, exp, inf, isfinite, log, log10
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ..analysis import judge, quotient_margins, resolved_frequencies, step_response
from ..diagram import FilterFamily, LoopEquations, LowPassFilter, ObserverEquations, Quotient
from ..numerics import FloatArray, golden, is_real
from .familyslack import FamilyLoops
from .mismatch import Mismatch
from .mismatchgrid import Frequencies
from .slack import UNSTABLE, Specification
from .timeconstants import intersection, stabilizing_set, stable_filters

__all__ = [
    "PricedSearch",
    "Prices",
    "member",
    "noise_on_u",
    "peak_gain",
    "sluggishness",
    "step_peak",
]

PER_DECADE, DENSE, DECADES = 8, 32, 3
"""How densely time constants are tried one by one and all at once, and how far beyond those of the
plant."""

NEARLY = 0.3
"""Slack within which an extreme between samples may lie on the other side of 0."""

NEAR_PEAK, ROUNDS, ACROSS = 0.9, 2, 65
"""Share of the largest value from which a peak is looked at; how often, at how many points."""

EVENLY, EARLIEST = 1001, 1e-6
"""Times of the first look at a response, evenly and by ratio; the first of these, of the last."""

CLOSER, BETWEEN = 3, 33
"""How often a step over an end or an extreme is looked at more closely, and at how many λ."""

Interval = tuple[float, float]

Slacks = Callable[[FloatArray], FloatArray]
"""Slacks of many time constants."""


@dataclass(frozen=True)
class Prices:
    """Limits on noise and actuator, none of them or some.

    Attributes
    ----------
    max_noise, max_u_eta, max_u_step_d, max_u_step_R : float or None
        As for `nrdob.design_filter`.
    """

    max_noise: float | None = None
    max_u_eta: float | None = None
    max_u_step_d: float | None = None
    max_u_step_R: float | None = None  # noqa: N815  (R is the reference, as in the diagram)

    def __post_init__(self) -> None:
        for name, value in self._given.items():
            if not is_real(value):
                raise TypeError(f"{name} is {value!r}; give a real number, or None")
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}; give a positive number")

    def __bool__(self) -> bool:
        return bool(self._given)

    @property
    def _given(self) -> dict[str, float]:
        every = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in every.items() if value is not None}

    def check_controller(self, controller: Any, model: Any) -> None:
        """Refuse a step of R without a controller, which u then is all about, or with a wrong one.

        Which filter is taken does not change what C and the model do.
        """
        if self.max_u_step_R is None:
            return
        if controller is None:
            raise ValueError("max_u_step_R needs the controller: give controller=C")
        Gm = ObserverEquations(model, 1.0, LowPassFilter(1.0, 1)).fractions.G
        F = LowPassFilter(1.0, max(1, Gm.relative_degree))
        loop = LoopEquations(model, model, controller, F)
        found = judge("C Gm (i)", loop.CGm.den, loop.p_A, loop.ill_posed_model_loop)
        if not found.stable:
            raise ValueError(
                "max_u_step_R needs a controller that stabilises the model; with this one u grows "
                f"under every filter: the loop of controller and model has {found.reason}; change "
                "the controller"
            )

    def slack(self, loop: LoopEquations, so_far: float) -> float:
        """By how much a stable loop meets the limits, as a logarithm; negative where it does not.

        What takes long is not looked at any more where the slack `so_far` is far from 0.
        """
        for name, limit in self._given.items():
            if so_far < -NEARLY:
                break
            paid = PAID[name](loop)
            so_far = min(so_far, log(limit) - log(min(max(paid, 1e-300), 1e300)))
        return max(so_far, UNSTABLE)

    def __str__(self) -> str:
        return ", ".join(f"{SAID[name]} ≤ {value:g}" for name, value in self._given.items())


def noise_on_u(loop: LoopEquations) -> float:
    """Return the standard deviation of u for white noise of unit density; inf without roll-off."""
    return inf if any(loop.U_eta.at_infinity) else loop.U_eta.noise_power() ** 0.5


def peak_gain(quotient: Quotient) -> float:
    """Largest size of a stable map on the imaginary axis, its limit at infinity included.

    Parameters
    ----------
    quotient : Quotient
        The map.
    """
    omega = resolved_frequencies(quotient)
    size = np.abs(quotient(1j * omega))
    largest = size.max()
    inner = 1 + np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:]))
    inner = inner[size[inner] > NEAR_PEAK * largest]
    tops = golden(lambda w: -np.abs(quotient(1j * w)), omega[inner - 1], omega[inner + 1])
    ends = [abs(quotient.dc_gain), sum(map(abs, quotient.at_infinity))]
    return float(max([largest, *np.abs(quotient(1j * tops)).tolist(), *ends]))


def step_peak(loop: LoopEquations, input: str, signal: str) -> float:
    """Largest ``|y|`` or ``|u|`` after a unit step.

    Parameters
    ----------
    loop : LoopEquations
        A stable loop.
    input : {"R", "d", "delta", "eta"}
        Where the step enters.
    signal : {"y", "u"}
        What is looked at.
    """
    row = "yu".index(signal)
    last = step_response(loop, input).time[-1]
    # A slow end must not hide a fast beginning.
    times = last * np.union1d(np.linspace(0, 1, EVENLY), np.geomspace(EARLIEST, 1, EVENLY))
    size = np.abs(step_response(loop, input, times).outputs[row, 0])
    largest = np.nanmax(size)
    for _ in range(ROUNDS):
        k = int(np.nanargmax(size))
        if k == 0:
            break
        low, high = times[k - 1], times[min(k + 1, times.size - 1)]
        times = np.linspace(low, high, ACROSS)
        size = np.abs(step_response(loop, input, times).outputs[row, 0])
    return float(max(largest, np.nanmax(size)))


PAID: dict[str, Callable[[LoopEquations], float]] = {
    "max_noise": noise_on_u,
    "max_u_eta": lambda loop: peak_gain(loop.U_eta),
    "max_u_step_d": lambda loop: step_peak(loop, "d", "u"),
    "max_u_step_R": lambda loop: step_peak(loop, "R", "u"),
}
"""What each limit bounds."""

SAID = {
    "max_noise": "‖U_η‖₂",
    "max_u_eta": "|U_η|",
    "max_u_step_d": "|u| for a step of d",
    "max_u_step_R": "|u| for a step of R",
}


@dataclass(frozen=True, eq=False)
class PricedSearch:
    """The search for the filters of a family that meet a specification and can be paid for.

    Attributes
    ----------
    family : int or FilterFamily
        The filters.
    intervals : list of (low, high)
        The stabilising set.
    floor : float
        The λ down to which was looked, in seconds.
    speeds : array of float
        What the time constants to try are chosen by, in rad/s.
    slack : callable
        By how much all limits are met with one λ: it decides.
    many : callable, optional
        The same for many λ at once, all but exactly.
    """

    family: int | FilterFamily
    intervals: list[Interval]
    floor: float
    speeds: FloatArray
    slack: Callable[[float], float]
    many: Slacks | None

    @classmethod
    def of(
        cls,
        process: Any,
        model: Any,
        family: int | FilterFamily,
        specification: Specification | None,
        prices: Prices,
        controller: Any,
    ) -> PricedSearch:
        """Find the stabilising set, in which it will be seen where the limits are met."""
        frequencies = Frequencies(Mismatch.of(process, model, family, waits=True))
        floor = frequencies.lowest_floor
        intervals = intersection(
            stabilizing_set(frequencies, floor), stable_filters(frequencies.mismatch.family)
        )

        @cache
        def slack(time_constant: float) -> float:
            filter = member(family, time_constant)
            loop = LoopEquations(process, model, 0.0 if controller is None else controller, filter)
            so_far = -UNSTABLE
            if specification is not None:
                so_far = specification.slack(quotient_margins(loop.L, True))
            return prices.slack(loop, so_far)

        many = None
        if intervals and specification is not None and not prices:
            slowest = max(intervals[0][0], floor)
            loops = FamilyLoops.for_family(process, model, family, specification, slowest)
            many = partial(specification.of_many, loops)
        return cls(family, intervals, floor, frequencies.mismatch.speeds, slack, many)

    @cached_property
    def met_from(self) -> float | None:
        """Where the first interval begins that meets all limits, if right there they are met."""
        for low, high in self.intervals[:1]:
            if self.slack(float(self._samples(low, high)[0])) >= 0:
                return low
        lows = [low for low, _ in self.windows[:1] if low in (ends[0] for ends in self.intervals)]
        return lows[0] if lows else None

    @cached_property
    def windows(self) -> list[Interval]:
        """Where in the stabilising set all limits are met, as a list of (low, high)."""
        return [
            window
            for interval, looked in self._looked
            for window in _windows(self.slack, _confirmed(self.slack, looked), interval)
        ]

    @property
    def best(self) -> tuple[float, float]:
        """The time constant with which they are met most, or least missed, and the slack."""
        tried = [item for _, looked in self._looked for item in looked.items()]
        return max(tried, key=lambda item: item[1], default=(inf, -inf))

    @cached_property
    def _looked(self) -> list[tuple[Interval, dict[float, float]]]:
        """Slacks all over each interval, closer where they may touch 0."""

        def one_by_one(values: FloatArray) -> FloatArray:
            return np.array([self.slack(value) for value in values.tolist()])

        look, closer = (self.many, _zoomed) if self.many else (one_by_one, _extremes)
        every = []
        for low, high in self.intervals:
            samples = self._samples(low, high)
            looked = dict(zip(samples.tolist(), look(samples).tolist(), strict=True))
            every.append(((low, high), dict(sorted((looked | closer(look, looked)).items()))))
        return every

    def _samples(self, low: float, high: float) -> FloatArray:
        return _samples(low, high, self.speeds, DENSE if self.many else PER_DECADE)


def member(family: int | FilterFamily, time_constant: float) -> Any:
    """Return the filter of an order, or of a family."""
    if isinstance(family, FilterFamily):
        return family.at(time_constant)
    return LowPassFilter(time_constant, family)


def sluggishness(process: Any, model: Any, filter: Any) -> float:
    r"""Time in which the loop rejects, in seconds: the smaller, the more it rejects.

    At low frequency :math:`S_d \to (1 - F)/R = c\,s^k`, and :math:`c^{1/k}` is one over the
    frequency at which that line reaches 1: nλ/R(0) for eq. (1), comparable for ramps of all kinds.
    """
    S = ObserverEquations(process, model, filter).S_d
    k = S.zeros_at_origin
    if k <= 0:
        return inf
    num, den = (
        np.prod([factor.without_origin.constant for factor in part]) for part in (S.num, S.den)
    )
    return float(abs(num / den) ** (1 / k))


def _samples(low: float, high: float, speeds: FloatArray, density: int) -> FloatArray:
    """Time constants to try between two critical ones, or some decades around the plant's."""
    if not low:
        low = min(1 / float(speeds.max()), high) * 10.0**-DECADES
    if high == inf:
        high = max(1 / float(speeds.min()), low) * 10.0**DECADES
    inside = np.geomspace(low, high, max(8, ceil(density * log10(high / low))) + 1)[1:-1]
    # At an end the loop is lost; beside it the margins are nearly zero.
    return np.array([low * (1 + 1e-6), *inside, high * (1 - 1e-6)])


def _turning(looked: dict[float, float]) -> Iterator[tuple[int, float]]:
    """Give the samples between whose neighbours the slack may touch 0, and the sign of its bend."""
    slacks = list(looked.values())
    for k in range(1, len(slacks) - 1):
        before, at, after = slacks[k - 1 : k + 2]
        top, bottom = at >= max(before, after) and at < 0, at <= min(before, after) and at >= 0
        # Where a jump at t = 0 binds, which no filter moves, the slack is one constant.
        level = before == at == after
        if (top or bottom) and not level and abs(at) < NEARLY:
            yield k, -1.0 if top else 1.0


def _extremes(look: Slacks, looked: dict[float, float]) -> dict[float, float]:
    """Look closer, one λ by the other, where the slack may touch 0 between two samples."""
    values, found = list(looked), {}

    def slack(x: float) -> float:
        return float(look(np.exp([x]))[0])

    for k, sign in _turning(looked):
        best = minimize_scalar(
            lambda x, sign=sign: sign * slack(x),
            bounds=(log(values[k - 1]), log(values[k + 1])), method="bounded",
            options={"xatol": 1e-6},
        )  # fmt: skip
        found[exp(best.x)] = slack(best.x)
    return found


def _zoomed(look: Slacks, looked: dict[float, float]) -> dict[float, float]:
    """Look closer, many λ at once, where the slack touches 0 or may do so between two samples."""
    values, found = list(looked), dict(looked)
    for k, sign in _turning(looked):
        low, high = values[k - 1], values[k + 1]
        for _ in range(CLOSER):
            inside = np.geomspace(low, high, BETWEEN)
            slacks = look(inside)
            found |= dict(zip(inside.tolist(), slacks.tolist(), strict=True))
            at = int(np.clip((sign * slacks).argmin(), 1, BETWEEN - 2))
            low, high = inside[at - 1], inside[at + 1]
    found = dict(sorted(found.items()))
    for (low, before), (high, after) in list(pairwise(found.items())):
        for _ in range(CLOSER if (before >= 0) != (after >= 0) else 0):
            inside = np.geomspace(low, high, BETWEEN)
            slacks = look(inside)
            found |= dict(zip(inside.tolist(), slacks.tolist(), strict=True))
            at = int(np.argmax((slacks >= 0) != (before >= 0)))
            low, high = inside[max(at, 1) - 1], inside[max(at, 1)]
    return found


def _confirmed(slack: Callable[[float], float], looked: dict[float, float]) -> dict[float, float]:
    """Take the exact slack on both sides of every change of sign, and so on until all are."""
    looked, exact = dict(looked), set[float]()
    while True:
        changes = [
            value
            for (low, before), (high, after) in pairwise(looked.items())
            if (before >= 0) != (after >= 0)
            for value in (low, high)
            if value not in exact
        ]
        if not changes:
            return looked
        looked |= {value: slack(value) for value in changes}
        exact |= set(changes)


def _windows(
    slack: Callable[[float], float], looked: dict[float, float], interval: Interval
) -> list[Interval]:
    """Join neighbouring samples that will do; an end is solved for, or is that of the interval."""
    good = [value >= 0 for value in looked.values()]
    values = list(looked)
    ends = [interval[0]] if good[0] else []
    for (before, after), (first, second) in zip(pairwise(values), pairwise(good), strict=True):
        if first != second:
            ends.append(_border(slack, *((before, after) if first else (after, before))))
    if good[-1]:
        ends.append(interval[1])
    return list(zip(ends[::2], ends[1::2], strict=True))


def _border(slack: Callable[[float], float], good: float, bad: float) -> float:
    """Find where the slack passes 0 between two λ, on the good side."""
    at = float(brentq(lambda x: slack(exp(x)), log(good), log(bad), xtol=1e-12, rtol=1e-13))
    way = 1.0 if good > bad else -1.0
    steps = (0.0, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8)
    return next((exp(at + way * x) for x in steps if slack(exp(at + way * x)) >= 0), good)
