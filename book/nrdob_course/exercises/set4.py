"""Set 4: choosing F, stabilising sets and trade-offs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from math import inf, isfinite, log, pi
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

from nrdob.design import (
    Mismatch,
    critical_time_constants,
    disturbance_index,
    gain_bound,
    noise_index,
    smallest_for_delay,
    smallest_for_double_lag,
    smallest_for_rhp_zero,
    stable_for_slow_filters,
)
from nrdob.diagram import (
    DelayedTransferFunction,
    LowPassFilter,
    as_fraction,
    filter_fraction,
    rational_power,
)
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray, FloatArray, QuasiPolynomial
from nrdob.plants import lags
from nrdob.plotting import COLOURS, INK, TALL, Figure, axes_for, styled

from .cases import (
    apart,
    draw,
    either_sign,
    factored,
    few,
    first_fitting,
    grid_peak,
    kept,
    observer_stable,
)
from .problems import (
    Misconception,
    Problem,
    answers_like,
    answers_like_any,
    near,
    read_as,
    rounds,
    same,
)
from .reading import block, lowpass, number, numbers, things, whole

__all__ = ["PROBLEMS"]


# --- 4.1 The card -------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class CardCase:
    """Four errors of a model, each by itself, and the order of the filter.

    Attributes
    ----------
    delay : float
        A dead time in seconds.
    zero : float
        A zero at s = zero, in rad/s.
    lag : float
        A lag 1/(lag s + 1), in seconds.
    double_lag : float
        A factor 1/(double_lag s + 1)^2, in seconds.
    order : int
        Order of the filter.
    """

    delay: float
    zero: float
    lag: float
    double_lag: float
    order: int

    def __repr__(self) -> str:
        return (
            f"dead time {self.delay:g} s, zero {self.zero:g} rad/s, lag {self.lag:g} s, two lags "
            f"of {self.double_lag:g} s, n = {self.order}"
        )


def _edges(case: CardCase) -> list[float]:
    """Give the four numbers, by the closed forms."""
    return [
        smallest_for_delay(case.delay, case.order),
        smallest_for_rhp_zero(case.zero, case.order),
        0.0,
        smallest_for_double_lag(case.double_lag, case.order),
    ]


def _plants(case: CardCase) -> list[Any]:
    """Give a model 1/(s + 1) each of the errors."""
    lag, T = ct.tf([1], [1, 1]), case.double_lag
    return [
        DelayedTransferFunction(lag, case.delay),
        lag * ct.tf([-1 / case.zero, 1], [1]),
        lag * ct.tf([1], [case.lag, 1]),
        lag * ct.tf([1], [T * T, 2 * T, 1]),
    ]


def _card_case(rng: np.random.Generator) -> CardCase:
    return CardCase(
        delay=draw(rng, 0.02, 3),
        zero=draw(rng, 3, 60),
        lag=draw(rng, 0.02, 3),
        double_lag=draw(rng, 0.02, 3),
        order=int(rng.integers(2, 4)),
    )


ERRORS = ("the dead time", "the zero", "the lag", "the two lags")
EDGE = 1.01
"""How near to an edge a number must be: a step of one per cent must cross it."""


def _off(case: CardCase, got: FloatArray) -> dict[str, str]:
    """Tell of each number why it is no edge; empty if it is one."""
    each = zip(ERRORS, _plants(case), got, _edges(case), strict=True)
    return {
        name: _off_the_edge(plant, case.order, float(value), edge)
        for name, plant, value, edge in each
    }


def _on_the_edge(case: CardCase, got: FloatArray) -> str:
    off: dict[str, list[str]] = {}
    for name, how in _off(case, got).items():
        if how:
            off.setdefault(how, []).append(name)
    return "; ".join(f"{how} for {' and '.join(names)}" for how, names in off.items())


def _off_the_edge(plant: Any, order: int, value: float, edge: float) -> str:
    """Tell whether the loop is lost just below a λ, and not just above it; empty if so."""
    if not (isfinite(value) and value >= 0):
        return "it is not a time"
    if edge == 0:
        return "smaller λ are stable, too," if value else ""
    if value == 0:
        return "not every λ is stable"
    above, below = (
        observer_stable(plant, ct.tf([1], [1, 1]), LowPassFilter(factor * value, order))
        for factor in (EDGE, 1 / EDGE)
    )
    if above is not True:
        return "the loop is lost at this λ"
    return "smaller λ are stable, too," if below is not False else ""


_card_like = partial(answers_like, close=partial(same, rtol=5e-3))


def _but_for(entry: int, value: Callable[[CardCase], float]) -> Callable[[CardCase], list[float]]:
    """Answer as one should, but for one of the four numbers."""
    return lambda case: [value(case) if k == entry else edge for k, edge in enumerate(_edges(case))]


CARD = Problem(
    id="4.1",
    title="Four errors, four numbers",
    case=_card_case,
    reads=partial(numbers, names=", ".join(ERRORS), gaps=True),
    lacks=_on_the_edge,
    parts=lambda case, got: {name: not how for name, how in _off(case, got).items()},
    rounded=lambda case, got: rounds(_edges(case), got),
    praise=(
        "Right: each edge is a number times the size of the error, and a single neglected lag "
        "has none. (For several errors at once the numbers do not add.)"
    ),
    misconceptions=(
        _card_like(
            "2θ/π for every order",
            "Three are right. But 2θ/π is the edge of a dead time for one lag in the filter. With "
            "more lags the number is smaller: look at the card in the column of your n.",
            _but_for(0, lambda case: 2 * case.delay / pi),
            0.75,
        ),
        _card_like(
            "frequency taken for a time",
            "Three are right. The size of a zero at z is the time 1/z: a zero far out is a small "
            "error. You multiplied by z.",
            _but_for(1, lambda case: smallest_for_rhp_zero(1.0, case.order) * case.zero),
            0.75,
        ),
        _card_like(
            "one lag counted as dead time",
            "Three are right. To count a lag as a dead time is safe, but it is not the edge: "
            "|H| = |Ts/(Ts + 1)| is below 1, so small gain makes the loop stable for every λ. "
            "The smallest λ is 0.",
            _but_for(2, lambda case: smallest_for_delay(case.lag, case.order)),
            0.75,
        ),
        _card_like(
            "two lags as harmless as one",
            "Three are right. One lag is harmless because |H| < 1. For two |H| exceeds 1 at high "
            "frequency, and there is an edge.",
            _but_for(3, lambda case: 0.0),
            0.75,
        ),
        _card_like(
            "column of another order",
            "These are the numbers for another order of the filter. Each further lag changes them "
            "all; take n from the case.",
            lambda case: _edges(replace(case, order=5 - case.order)),
            0.5,
        ),
        read_as(
            "milliseconds",
            "All four are right, in milliseconds. The case gives seconds, and λ is asked for in "
            "seconds, too.",
            lambda case: [1000 * edge for edge in _edges(case)],
            lambda got: got / 1000,
            _on_the_edge,
            0.75,
        ),
    ),
)


# --- 4.2 Which order is the fastest? ------------------------------------------------------------

ORDERS = (2, 3, 4)
READING = 0.08
"""How far a number that is read off a figure may be from the true one."""


@dataclass(frozen=True, eq=False)
class OrdersCase:
    """A plant that first moves the wrong way, a model without that, and a limit for Ms.

    Attributes
    ----------
    plant, model : control.TransferFunction
    max_ms : float
    """

    plant: ct.TransferFunction
    model: ct.TransferFunction
    max_ms: float

    def __repr__(self) -> str:
        return f"{factored(self.plant)} under {factored(self.model)}, Ms ≤ {self.max_ms:g}"

    def plot(self) -> Figure:
        """Draw Ms over the bandwidth of the filter, for three orders."""
        edges, fastest = lost_of(self), fastest_of(self)
        with styled():
            (ax,) = axes_for(None, 1, TALL)
            for n, role, style in zip(
                ORDERS, ("filter", "process", "noise"), ("-", "--", "-."), strict=True
            ):
                bandwidth = np.linspace(0.04, 0.98, 150) * edges[n]
                peaks = [_peak(self, n, w) for w in bandwidth]
                colour = COLOURS[role]
                lines = ax.plot(bandwidth, peaks, style, color=colour, label=f"n = {n}")
                ax.axvline(edges[n], color=colour, ls=":", lw=1.5)
                ax.text(
                    edges[n], 4.4, f"n = {n} lost ", color=colour, rotation=90, ha="right", va="top"
                )
            ax.axhline(self.max_ms, color=COLOURS["critical"], lw=1)
            ax.minorticks_on()
            ax.grid(True, which="minor", color=INK, alpha=0.12, lw=0.5)
            ax.set(xlabel="bandwidth of the filter (rad/s)", ylabel="$M_s$", ylim=(1, 4.5))
            ax.set_xlim(0, 1.04 * edges[4])
            ax.legend(loc="upper left")
        read = "; ".join(
            f"n = {n} reaches {self.max_ms:g} at {fastest[n]:.3g} and is lost at "
            f"{edges[n]:.3g} rad/s"
            for n in ORDERS
        )
        return Figure(lines, ax, alt=f"Ms over the bandwidth: {read}")


@kept
def lost_of(case: OrdersCase) -> dict[int, float]:
    """Give the bandwidth in rad/s at which the loop is lost, for each order."""
    return {
        n: LowPassFilter(
            critical_time_constants(case.plant, case.model, n)[-1].time_constant, n
        ).bandwidth
        for n in ORDERS
    }


@kept
def _grid(case: OrdersCase) -> tuple[FloatArray, Any]:
    omega = np.geomspace(2e-2, 2e2, 1200) * lost_of(case)[2]
    return omega, Mismatch.of(case.plant, case.model, 2).ratio(omega)


def _peak(case: OrdersCase, order: int, bandwidth: float) -> float:
    """Compute Ms on a grid of frequencies; true only where the loop is stable."""
    omega, R = _grid(case)
    return grid_peak(_filter(order, bandwidth)(1j * omega), R)


@kept
def fastest_of(case: OrdersCase) -> dict[int, float]:
    """Give the bandwidth up to which Ms is within its limit, for each order."""

    def meeting(order: int) -> float:
        edge = lost_of(case)[order]
        excess = partial(_peak, case, order)
        return float(brentq(lambda w: excess(w) - case.max_ms, 0.02 * edge, 0.97 * edge))

    return {order: meeting(order) for order in ORDERS}


def _filter(order: int, bandwidth: float) -> LowPassFilter:
    return LowPassFilter(LowPassFilter(1.0, order).bandwidth / bandwidth, order)


def _orders_case(rng: np.random.Generator) -> OrdersCase:
    def drawn() -> OrdersCase:
        poles = [draw(rng, 0.5, 2), draw(rng, 2.5, 6)]
        gain, zero = draw(rng, 0.5, 5), draw(rng, 15, 90)
        stronger = round(float(rng.uniform(0.92, 1.08)), 2)
        model = _all_pole(*poles, gain=gain)
        plant = stronger * model * ct.tf([-1 / zero, 1], [1 / zero, 1])
        return OrdersCase(plant, model, float(rng.choice([1.8, 1.9, 2.0])))

    # The curves must be told apart, and so must the λ that the mistakes lead to.
    return first_fitting(drawn, lambda case: fastest_of(case)[3] < 0.9 * fastest_of(case)[2])


def _order_and_time(given: Any) -> LowPassFilter:
    """Read an order and a time constant, or the filter that has them."""
    if isinstance(given, LowPassFilter):
        return given
    order, value = things(given, "two things are asked for, (order, time constant in seconds)")
    return LowPassFilter(number(value), whole(order))


def _read_well(case: OrdersCase, F: LowPassFilter) -> str:
    if not observer_stable(case.plant, case.model, F):
        return "with this filter the loop is not stable"
    ms = NRDOB(case.plant, case.model, 0.0, F).margins().plant_loop.ms
    if ms > case.max_ms * (1 + READING / 2):
        return f"its Ms is {ms:.3g}"
    best = max(fastest_of(case).values())
    if F.bandwidth < (1 - READING) * best:
        return (
            f"its bandwidth is {F.bandwidth:.3g} rad/s, and more can be had; read again where the "
            "curves meet the line, or compute λ from the bandwidth again"
        )
    return ""


def _read_alike(expected: tuple[int, float], got: LowPassFilter) -> bool:
    order, value = expected
    return got.order == order and near(value, got.time_constant, READING)


_misread = partial(answers_like_any, close=_read_alike)


def _times(bandwidths: dict[int, float], *orders: int) -> list[tuple[int, float]]:
    return [(n, _filter(n, bandwidths[n]).time_constant) for n in orders]


FASTEST_ORDER = Problem(
    id="4.2",
    title="Which order is the fastest?",
    case=_orders_case,
    reads=_order_and_time,
    lacks=_read_well,
    praise=(
        "Right: the lowest order is the fastest that meets the specification, although a higher "
        "one is lost later. An edge is not a margin."
    ),
    misconceptions=(
        _misread(
            "judged by the edge",
            "You have read a dotted line: there the loop is lost, and Ms has no bound. What is "
            "asked for is where a curve meets the red line, at the largest Ms that is allowed.",
            lambda case: _times(lost_of(case), 4, 3, 2),
        ),
        _misread(
            "reciprocal of the bandwidth",
            "The order is right, and so is the bandwidth, but λ is not its reciprocal: n lags in "
            "a row lose 3 dB earlier than one. ω_B = √(2^(1/n) - 1)/λ; solve that for λ.",
            lambda case: [(2, 1 / fastest_of(case)[2])],
            marks=0.5,
        ),
        _misread(
            "another curve than the fastest",
            "This filter meets the specification, just so. But the curve of another order meets "
            "the red line farther to the right: at equal Ms that one is faster.",
            lambda case: _times(fastest_of(case), 4, 3),
            marks=0.5,
        ),
    ),
    own=True,
)


# --- 4.3 One filter for three plants ------------------------------------------------------------

FASTER = 1.05
"""By how much a filter may be slower than needed."""


@dataclass(frozen=True, eq=False)
class PlantsCase:
    """A plant as it is and as it may become, and what is asked of the filter.

    Attributes
    ----------
    plants : list of control.TransferFunction
        The first is the plant as it is today.
    model : control.TransferFunction
    order : int
        Order of the filter.
    max_ms : float
        Limit for Ms, with each of the plants.
    """

    plants: list[ct.TransferFunction]
    model: ct.TransferFunction
    order: int
    max_ms: float

    def __repr__(self) -> str:
        each = ", ".join(f"{gain:.3g}(1 − s/{zero:.3g})" for gain, zero in _errors(self))
        return f"G/model = {each}; n = {self.order}, Ms ≤ {self.max_ms:g}"


def _errors(case: PlantsCase) -> list[tuple[float, float]]:
    """Give gain and zero of G/model, for each plant."""
    return [
        (round(float(plant.dcgain() / case.model.dcgain()), 6), float(plant.zeros().real.max()))
        for plant in case.plants
    ]


def borders_of(case: PlantsCase, of_FH: bool = False) -> list[float]:
    """Give the smallest λ that meets the limit, for each plant, plus 1 %."""
    return [
        1.01 * _border(case.order, gain, case.max_ms, of_FH) / zero for gain, zero in _errors(case)
    ]


def _last_edge(case: PlantsCase) -> float:
    """Give the smallest λ at which the loop is stable with every plant."""
    return max(_edge(case.order, gain) / zero for gain, zero in _errors(case))


@kept
def peaks_of(case: PlantsCase, time_constant: float, which: str = "plant_loop") -> list[float]:
    """Give Ms with each plant; infinite where the loop is not stable."""
    F = LowPassFilter(time_constant, case.order)
    found = [getattr(NRDOB(plant, case.model, 0.0, F).margins(), which) for plant in case.plants]
    return [m.ms if m.stable else inf for m in found]


THREE_DIGITS = 1.01
"""By what factor Ms may be exceeded, for a λ of three digits."""


def _good(case: PlantsCase, peak: float) -> bool:
    """Tell whether a peak is within the limit."""
    return peak <= case.max_ms * THREE_DIGITS


def just_good(case: PlantsCase, peak: Callable[[float], float], value: float) -> bool:
    """Tell whether a peak is within the limit, but not with a slightly faster filter."""
    return _good(case, peak(value)) and not peak(value / FASTER) <= case.max_ms


@cache
def _edge(order: int, gain: float) -> float:
    """Edge for G/model = gain (1 - s), to be divided by the zero."""
    lag = ct.tf([1], [1, 1])
    return critical_time_constants(gain * lag * ct.tf([-1, 1], [1]), lag, order)[-1].time_constant


@cache
def _border(order: int, gain: float, max_ms: float, of_FH: bool) -> float:
    """Smallest λ of the same loop with a peak of L, or of FH, on a grid, within the limit."""
    edge = _edge(order, gain)
    omega = np.geomspace(1e-2, 1e2, 4000) / edge
    R = gain * (1 - 1j * omega)

    def excess(exponent: float) -> float:
        F = LowPassFilter(float(np.exp(exponent)), order)(1j * omega)
        return grid_peak(F, R, of_FH) - max_ms

    return float(np.exp(brentq(excess, log(1.01 * edge), log(50 * edge), xtol=1e-6)))


def _plants_case(rng: np.random.Generator) -> PlantsCase:
    def drawn() -> PlantsCase:
        slow = draw(rng, 0.3, 3)
        other, zero = few(slow * rng.uniform(1.5, 3)), few(slow * rng.uniform(15, 30))
        nearer, more = few(zero / rng.uniform(1.15, 1.6)), few(rng.uniform(1.1, 1.5))
        model = _all_pole(slow, other, gain=draw(rng, 0.3, 5))
        worn = [model * ct.tf([-1 / nearer, 1], [1]), more * model * ct.tf([-1 / zero, 1], [1])]
        plants = [model * ct.tf([-1 / zero, 1], [1]), *(worn[k] for k in rng.permutation(2))]
        order, max_ms = int(rng.integers(2, 4)), float(rng.choice([1.8, 1.9, 2.0]))
        return PlantsCase(plants, model, order, max_ms)

    def fits(case: PlantsCase) -> bool:
        # Either of the other two may be the one that decides; each mistake leads elsewhere.
        borders = borders_of(case)
        return min(borders) == borders[0] and apart(*borders, max(borders_of(case, True)), by=0.07)

    return first_fitting(drawn, fits)


def _good_for_all(case: PlantsCase, got: LowPassFilter) -> str:
    if got.order != case.order:
        return f"it has the order {got.order}, asked for is {case.order}"
    for k, peak in enumerate(peaks_of(case, got.time_constant), start=1):
        if peak == inf:
            return f"with plant {k} the loop is not stable"
        if not _good(case, peak):
            return f"with plant {k} Ms is {peak:.4g}"
    if max(peaks_of(case, got.time_constant / FASTER)) <= case.max_ms:
        return f"Ms is met with every plant, but a filter {FASTER:g} times as fast does it, too"
    return ""


def _slowed(
    name: str,
    says: str,
    example: Callable[[PlantsCase], float],
    recognises: Callable[[PlantsCase, float], bool],
    marks: float = 0.0,
) -> Misconception:
    """Make a misconception that leads to another λ."""
    return Misconception(
        name,
        says,
        lambda case: LowPassFilter(example(case), case.order),
        lambda case, got: got.order == case.order and recognises(case, got.time_constant),
        marks,
    )


THREE_PLANTS = Problem(
    id="4.3",
    title="One filter for three plants",
    case=_plants_case,
    reads=lowpass,
    lacks=_good_for_all,
    rounded=lambda case, got: rounds(LowPassFilter(max(borders_of(case)) / 1.01, case.order), got),
    praise=(
        "Right: each loop is stable, Ms of L is within the limit with each plant, and no "
        "noticeably faster filter of this order does that."
    ),
    misconceptions=(
        _slowed(
            "edge of stability taken for the specification",
            "This is the edge of the stabilising set: the loops are just about stable, and Ms is "
            "beyond all bounds. The set says where the loop is lost; how far you must stay away "
            "from there is what the limit on Ms asks for.",
            lambda case: _last_edge(case) * (1 + 1e-6),
            lambda case, value: abs(log(value / _last_edge(case))) < 0.01,
        ),
        _slowed(
            "plant of today only",
            "This is the fastest filter for the first plant, the one of today. With another Ms is "
            "above the limit, or the loop is lost. Ask all of them, and keep the filter that is "
            "slow enough for each.",
            lambda case: borders_of(case)[0],
            lambda case, value: (
                just_good(case, lambda v: peaks_of(case, v)[0], value)
                and not _good(case, max(peaks_of(case, value)))
            ),
            marks=0.25,
        ),
        _slowed(
            "margin of FH taken for the plant's",
            "Here it is 1/|1 + FH| that stays below the limit. A change of the plant uses up the "
            "margins of L = FR/(1 - F): take Ms from plant_loop, not from observer_loop.",
            lambda case: max(borders_of(case, of_FH=True)),
            lambda case, value: just_good(
                case, lambda v: max(peaks_of(case, v, "observer_loop")), value
            ),
            marks=0.25,
        ),
        _slowed(
            "the fastest kept instead of the slowest",
            "Two of the plants are content, the third is not. Each plant has a smallest λ of its "
            "own; a filter that is good for all must have the largest of them.",
            lambda case: sorted(borders_of(case))[1],
            lambda case, value: sum(_good(case, peak) for peak in peaks_of(case, value)) == 2,
            marks=0.5,
        ),
        _slowed(
            "slower than needed",
            "Ms is within the limit with every plant, so this filter is safe. But it is slower "
            "than it need be, and disturbances pay for that: |S_d| is about nλω. Find the "
            "smallest λ that still meets the limit with every plant.",
            lambda case: 3 * max(borders_of(case)),
            lambda case, value: _good(case, max(peaks_of(case, value))),
            marks=0.5,
        ),
    ),
)


# --- 4.5 Find the error: reduce the bandwidth ---------------------------------------------------

SLOW = (1e2, 1e3, 1e4)
"""Time constants against the slowest of plant and model: so slow that the limit has come."""


@dataclass(frozen=True, eq=False)
class SlowCase:
    """A stable model without zeros on the right, and the order of the filter.

    Attributes
    ----------
    model : control.TransferFunction
    order : int
        3 or more.
    """

    model: ct.TransferFunction
    order: int

    def __repr__(self) -> str:
        return f"{factored(self.model)}, n = {self.order}"


def _onset(case: SlowCase) -> float:
    """Give the size at which H(0) meets Γ_n, sec^n(π/n): the bound of G(0)/model(0), less 1."""
    return gain_bound(case.order) - 1


def _slow_case(rng: np.random.Generator) -> SlowCase:
    gain = either_sign(rng) * draw(rng, 0.3, 5)
    model = _all_pole(draw(rng, 0.2, 1), draw(rng, 2, 6), gain=gain)
    return SlowCase(model, int(rng.integers(3, 7)))


def _mirrored(case: SlowCase, gain: float) -> ct.TransferFunction:
    """Give the model times a gain, with a zero on the right and a pole at its mirror image."""
    speed = float(np.abs(case.model.poles()).max())
    return gain * case.model * ct.tf([-1 / speed, 1], [1 / speed, 1])


@dataclass(frozen=True)
class _Facts:
    """What matters about a plant that is offered as a counterexample."""

    stable: bool
    g0: float
    turns: int
    lost: bool


def _facts(case: SlowCase, plant: Any) -> _Facts:
    mismatch = Mismatch.of(plant, case.model, case.order)
    slowest = 1 / float(mismatch.speeds.min())
    filters = [LowPassFilter(factor * slowest, case.order) for factor in SLOW]
    verdicts = [observer_stable(plant, case.model, F) for F in filters]
    limit = stable_for_slow_filters(plant, case.model, case.order).holds
    # 1 + H = b/a: its zeros less its poles on the right are the clockwise turns.
    poles, zeros = (
        int(np.sum(QuasiPolynomial(p).roots.real >= 0)) for p in (mismatch.a, mismatch.b)
    )
    g0 = float(mismatch.b[-1] / mismatch.a[-1]) if mismatch.a[-1] else inf
    return _Facts(poles == 0, g0, zeros - poles, verdicts == [False] * 3 and limit is False)


def _refutes(case: SlowCase, got: Any) -> str:
    if isinstance(got, DelayedTransferFunction) and got.delay:
        return "it has a dead time; give a plant without one"
    facts = _facts(case, got)
    if not facts.stable:
        return "this plant is not stable"
    if not facts.g0 > 0:
        return f"G(0)/model(0) is {facts.g0:.3g}; the two are to have the same sign"
    if not facts.lost:
        return (
            f"a slow enough filter makes this loop stable; G(0)/model(0) is {facts.g0:.3g}, and H "
            f"makes {facts.turns} clockwise turns"
        )
    return "" if facts.turns >= 1 else "H makes no clockwise turn around -1"


SLOW_FILTER = Problem(
    id="4.5",
    title="Find the error: reduce the bandwidth",
    case=_slow_case,
    reads=block,
    lacks=_refutes,
    praise=(
        "Right, and this refutes the sentence as it stands: H turns clockwise, and no filter is "
        "slow enough. Near zero frequency FH is H(0)/(1 + jx)^n however slow the filter is; "
        "what is needed besides is 0 < G(0)/model(0) < 1 + sec^n(π/n)."
    ),
    misconceptions=(
        Misconception(
            "a zero on the right alone",
            "H turns clockwise, and a slow filter cures it, as in Example 2: here the sentence is "
            "right. What can a slow filter never reduce, since F(0) = 1? Look at FH near zero "
            "frequency.",
            lambda case: _mirrored(case, 1.0),
            lambda case, got: (
                (f := _facts(case, got)).stable and f.turns >= 1 and 0 < f.g0 <= _onset(case)
            ),
        ),
        Misconception(
            "H(0) mixed up with G(0)/model(0)",
            "Very near. The curve Γ_n meets the positive axis at sec^n(π/n), and H(0) must be "
            "beyond it. But H(0) is G(0)/model(0) - 1, so the ratio must be larger by 1.",
            lambda case: _mirrored(case, _onset(case) + 0.5),
            lambda case, got: (
                (f := _facts(case, got)).stable and _onset(case) < f.g0 <= _onset(case) + 1
            ),
            marks=0.5,
        ),
        Misconception(
            "no turn that could be avoided",
            "No slow filter works here, for the right reason: the plant is too strong. But this H "
            "makes no clockwise turn, so the sentence does not speak of it. Give the plant a "
            "zero on the right as well.",
            lambda case: (_onset(case) + 3) * case.model,
            lambda case, got: (
                (f := _facts(case, got)).stable and f.g0 > 0 and f.lost and f.turns == 0
            ),
            marks=0.5,
        ),
        Misconception(
            "opposite DC signs",
            "No filter works here, fast or slow, since parity forbids it. That is the case which "
            "was left out. Keep the sign at zero frequency.",
            lambda case: -case.model,
            lambda case, got: (f := _facts(case, got)).stable and f.g0 < 0,
            marks=0.25,
        ),
        Misconception(
            "unstable plant",
            "A slow filter leaves an unstable plant unstable; that is true, and the paper says "
            "so. The sentence here is about clockwise turns of a stable plant.",
            lambda case: case.model * ct.tf([1, 1], [1, -1]),
            lambda case, got: not _facts(case, got).stable,
        ),
    ),
)


# --- 4.6 Better than equal lags -----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class BetterCase:
    """A model that is right, and what a filter should do.

    Attributes
    ----------
    model : control.TransferFunction
        The model, which is the plant.
    noise : float
        Limit for the power of white noise at y, in 1/s.
    error : float
        Limit for the integral of the squared error after a unit step of d, in seconds.
    fastest : float
        No pole of the filter may be faster than this, in rad/s.
    """

    model: ct.TransferFunction
    noise: float
    error: float
    fastest: float

    def __repr__(self) -> str:
        return (
            f"{factored(self.model)}, noise ≤ {self.noise:g}, error ≤ {self.error:g}, poles up "
            f"to {self.fastest:g} rad/s"
        )


def _order(case: BetterCase) -> int:
    """Give the relative degree of the model."""
    return as_fraction(case.model, "model").relative_degree


def _with_equal_lags(case: BetterCase) -> float:
    """Give the product of noise and error for equal lags."""
    return noise_index(_order(case)) * disturbance_index(_order(case))


@dataclass(frozen=True)
class _Price:
    """What a filter costs, and whether it may be used at all."""

    noise: float
    error: float
    speed: float
    poles: ComplexArray
    causal: bool


def _price(case: BetterCase, filter: Any) -> _Price:
    num, den = filter_fraction(filter)
    left = np.polysub(den, num)[:-1]  # (1 - F)/s
    poles = np.roots(den).astype(complex)
    return _Price(
        rational_power(num, den),
        rational_power(left, den),
        float(np.abs(poles).max()),
        poles,
        den.size - num.size >= _order(case),
    )


def _spread(case: BetterCase, slow: float, ratio: float) -> ct.TransferFunction:
    return _all_pole(slow, *[ratio * slow] * (_order(case) - 1))


def _better_case(rng: np.random.Generator) -> BetterCase:
    order = int(rng.integers(3, 5))
    slowest = draw(rng, 0.5, 5)
    poles = [slowest, *(few(slowest * rng.uniform(2, 5)) for _ in range(order - 1))]
    free = BetterCase(_all_pole(*poles, gain=draw(rng, 0.5, 5)), inf, inf, inf)
    slow = slowest * float(rng.uniform(3, 6))
    price = _price(free, _spread(free, slow, 4.0))
    return BetterCase(
        free.model,
        noise=few(1.03 * price.noise, 3),
        error=few(1.04 * price.error, 3),
        fastest=few(6.5 * slow),
    )


LEEWAY = 1 + 6e-3
"""Limits, and the filter's coefficients, are given to three digits."""


def _beats(case: BetterCase, got: Any) -> str:
    price = _price(case, got)
    if not price.causal:
        return "F/model is not causal"
    if observer_stable(case.model, case.model, got) is not True:
        return "the loop is not stable"
    if price.speed > case.fastest * LEEWAY:
        return f"its fastest pole is {price.speed:.4g} rad/s"
    lacks = []
    if price.noise > case.noise * LEEWAY:
        lacks.append(f"the noise is {price.noise:.4g}")
    if price.error > case.error * LEEWAY:
        lacks.append(f"the error is {price.error:.4g}")
    return " and ".join(lacks)


def _scaled(case: BetterCase, poles: list[float]) -> ct.TransferFunction:
    """Scale a filter in time so that noise and error miss their limits by the same factor."""
    price = _price(case, _all_pole(*poles))
    factor = ((case.noise / price.noise) / (case.error / price.error)) ** 0.5
    return _all_pole(*(factor * pole for pole in poles))


def _slow(case: BetterCase) -> float:
    """Speed of the slow pole of a good filter."""
    return case.fastest / 6.5


def _butterworth(case: BetterCase) -> ct.TransferFunction:
    angles = pi * (2 * np.arange(_order(case)) + 1 + _order(case)) / (2 * _order(case))
    den = np.real(np.poly(2 * _slow(case) * np.exp(1j * angles)))
    return ct.tf([den[-1]], den)


def _equal(price: _Price) -> bool:
    mean = price.poles.mean()
    return bool(np.abs(price.poles - mean).max() < 0.02 * abs(mean))


BETTER = Problem(
    id="4.6",
    title="Better than equal lags",
    case=_better_case,
    reads=block,
    lacks=_beats,
    praise=(
        "Within all limits, where no filter 1/(λs + 1)^n with F/model causal can be: with so many "
        "equal lags the product of noise and error is too large, whatever λ. The bound 1/4 is "
        "still below you."
    ),
    misconceptions=(
        Misconception(
            "too few poles",
            "With so few poles the limits are easily met, even by equal lags, but F/model would "
            "have more zeros than poles: it cannot be built. F needs at least the relative degree "
            "of the model.",
            lambda case: _scaled(case, [1.0]),
            lambda case, got: not _price(case, got).causal,
            marks=0.25,
        ),
        Misconception(
            "equal lags",
            "With equal lags noise times error is the same number for every λ; it grows with n, "
            "and from the relative degree of the model on it is larger than what is allowed here. "
            "Trading λ gains nothing; spread the poles.",
            lambda case: _scaled(case, [1.0] * _order(case)),
            lambda case, got: _equal(_price(case, got)),
            marks=0.25,
        ),
        Misconception(
            "flat rather than early",
            "Noise times error is even larger than with equal lags. A flat |F| that falls "
            "steeply is late, and being late is what the error counts. Go the other way: less "
            "steep, with real poles that differ.",
            _butterworth,
            lambda case, got: (
                (p := _price(case, got)).noise * p.error > _with_equal_lags(case) * LEEWAY
            ),
        ),
        Misconception(
            "a pole that is too fast",
            "Noise and error are fine, but a pole is faster than what can be built. Bring it in, "
            "and see how far the product of noise and error still allows that.",
            lambda case: _scaled(case, [1.0] + [12.0] * (_order(case) - 1)),
            lambda case, got: (
                (p := _price(case, got)).speed > case.fastest * LEEWAY
                and p.noise <= case.noise * LEEWAY
                and p.error <= case.error * LEEWAY
            ),
            marks=0.5,
        ),
        Misconception(
            "right shape, wrong scale",
            "The product of noise and error is small enough, but they are not shared out as "
            "asked: one is above its limit, the other far below. Make all poles faster, or all "
            "slower, by the same factor.",
            lambda case: _spread(case, 0.8 * _slow(case), 5.0),
            lambda case, got: (
                (p := _price(case, got)).noise * p.error <= case.noise * case.error * LEEWAY
            ),
            marks=0.5,
        ),
    ),
    own=True,
)

PROBLEMS = (CARD, FASTEST_ORDER, THREE_PLANTS, SLOW_FILTER, BETTER)


def _all_pole(*poles: float, gain: float = 1.0) -> ct.TransferFunction:
    """Lags given by their poles, in rad/s."""
    return lags(*(1 / pole for pole in poles), gain=gain)
