"""Set 4: choosing F, stabilising sets and trade-offs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from math import inf, isfinite, log, pi
from typing import Any, NamedTuple

import control as ct
import numpy as np
from scipy.optimize import brentq
from scipy.signal import butter

from nrdob import NRDOB, LowPassFilter, critical_time_constants
from nrdob.design import (
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
    ObserverEquations,
    as_fraction,
    filter_fraction,
    rational_power,
)
from nrdob.numerics import ComplexArray, FloatArray, QuasiPolynomial
from nrdob.plotting import Figure

from .cases import all_pole, factored, grid_peak, observer_stable
from .comparing import LEEWAY, READING, near, rounds, same
from .drawing import apart, draw, either_sign, few, fitting, kept
from .figures import Peaks, draw_peaks
from .problems import Lack, Misconception, any_of, lack_of, lacking, pose, put_right
from .reading import block, lowpass, number, numbers, things, whole

__all__ = ["BETTER", "CARD", "FASTEST_ORDER", "SLOW_FILTER", "THREE_PLANTS"]


# --- 4.1 The card -------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class CardCase:
    """Four errors of a model, each by itself, and the order of the filter."""

    delay: float  # a dead time, in seconds
    zero: float  # a zero at s = zero, in rad/s
    lag: float  # 1/(lag s + 1), in seconds
    double_lag: float  # 1/(double_lag s + 1)^2, in seconds
    order: int  # of the filter

    def __repr__(self) -> str:
        return (
            f"dead time {self.delay:g} s, zero {self.zero:g} rad/s, lag {self.lag:g} s, two lags "
            f"of {self.double_lag:g} s, n = {self.order}"
        )


def _edges(case: CardCase) -> list[float]:
    n = case.order
    by_delay, by_zero = smallest_for_delay(case.delay, n), smallest_for_rhp_zero(case.zero, n)
    return [by_delay, by_zero, 0.0, smallest_for_double_lag(case.double_lag, n)]


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
    ends = (0.02, 3), (3, 60), (0.02, 3), (0.02, 3)
    delay, zero, lag, double_lag = (draw(rng, *each) for each in ends)
    return CardCase(delay, zero, lag, double_lag, order=int(rng.integers(2, 4)))


ERRORS = ("the dead time", "the zero", "the lag", "the two lags")
EDGE = 1.01  # how near to an edge a number must be: a step of one per cent must cross it


def _off(case: CardCase, got: FloatArray) -> dict[str, str]:
    return {name: _off_the_edge(case, k, float(got[k])) for k, name in enumerate(ERRORS)}


def _on_the_edge(case: CardCase, got: FloatArray) -> str:
    off = _off(case, got)
    names = {how: [name for name in off if off[name] == how] for how in off.values() if how}
    return "; ".join(f"{how} for {' and '.join(names[how])}" for how in names)


@kept
def _off_the_edge(case: CardCase, k: int, value: float) -> str:
    """Tell whether the loop becomes unstable just below a λ, and not just above it; empty if so."""
    if not (isfinite(value) and value >= 0):
        return "it is not a time"
    if _edges(case)[k] == 0:
        return "smaller λ are stable, too," if value else ""
    if value == 0:
        return "not every λ is stable"
    plant, model = _plants(case)[k], ct.tf([1], [1, 1])
    filters = (LowPassFilter(factor * value, case.order) for factor in (EDGE, 1 / EDGE))
    above, below = (observer_stable(plant, model, F) for F in filters)
    if above is not True:
        return "the loop becomes unstable at this λ"
    return "smaller λ are stable, too," if below is not False else ""


def _but_for(entry: int, value: Callable[[CardCase], float]) -> Callable[[CardCase], list[float]]:
    """Answer as one should, but for one of the four numbers."""
    return lambda case: [value(case) if k == entry else edge for k, edge in enumerate(_edges(case))]


CARD = pose(
    "4.1",
    alike=partial(same, rtol=5e-3),
    case=_card_case,
    reads=partial(numbers, names=", ".join(ERRORS), gaps=True),
    lacks=_on_the_edge,
    parts=_off,
    rounded=lambda case, got: rounds(_edges(case), got),
    misconceptions={
        "2θ/π for every order": _but_for(0, lambda case: 2 * case.delay / pi),
        "frequency taken for a time": _but_for(
            1, lambda case: smallest_for_rhp_zero(1.0, case.order) * case.zero
        ),
        "one lag counted as dead time": _but_for(
            2, lambda case: smallest_for_delay(case.lag, case.order)
        ),
        "two lags as harmless as one": _but_for(3, lambda case: 0.0),
        "column of another order": lambda case: _edges(replace(case, order=5 - case.order)),
        "milliseconds": put_right(
            lambda case: [1000 * edge for edge in _edges(case)], lambda got: got / 1000
        ),
    },
)


# --- 4.2 Which order is the fastest? ------------------------------------------------------------

ORDERS = (2, 3, 4)


@dataclass(frozen=True, eq=False)
class OrdersCase:
    """A plant that first moves the wrong way, a model without that, and a limit for Ms."""

    plant: ct.TransferFunction
    model: ct.TransferFunction
    max_ms: float

    def __repr__(self) -> str:
        return f"{factored(self.plant)} under {factored(self.model)}, Ms ≤ {self.max_ms:g}"

    def plot(self) -> Figure:
        """Draw Ms over the bandwidth of the filter, for three orders."""
        edges, fastest = edges_of(self), fastest_of(self)
        curves = []
        for n, role, style in ((2, "filter", "-"), (3, "process", "--"), (4, "noise", "-.")):
            bandwidth = np.linspace(0.04, 0.98, 150) * edges[n]
            peaks = [_peak(self, n, w) for w in bandwidth]
            curves.append(Peaks(f"n = {n}", bandwidth, peaks, edges[n], role, style))
        read = "; ".join(
            f"n = {n} reaches {self.max_ms:g} at {fastest[n]:.3g} and is unstable from "
            f"{edges[n]:.3g} rad/s"
            for n in ORDERS
        )
        along, alt = "bandwidth of the filter (rad/s)", f"Ms over the bandwidth: {read}"
        return draw_peaks(curves, self.max_ms, 4.5, along, alt)


@kept
def edges_of(case: OrdersCase) -> dict[int, float]:
    """Give the bandwidth in rad/s at which the loop becomes unstable, for each order."""
    last = {n: critical_time_constants(case.plant, case.model, n)[-1] for n in ORDERS}
    return {n: LowPassFilter(edge.time_constant, n).bandwidth for n, edge in last.items()}


@kept
def _grid(case: OrdersCase) -> tuple[ComplexArray, ComplexArray]:
    s = 1j * np.geomspace(2e-2, 2e2, 1200) * edges_of(case)[2]
    return s, case.plant(s) / case.model(s)


def _peak(case: OrdersCase, order: int, bandwidth: float) -> float:
    """Compute Ms on a grid of frequencies; true only where the loop is stable."""
    s, R = _grid(case)
    return grid_peak(_filter(order, bandwidth)(s), R)


@kept
def fastest_of(case: OrdersCase) -> dict[int, float]:
    """Give the bandwidth up to which Ms is within its limit, for each order."""
    return {
        n: float(brentq(lambda w, n=n: _peak(case, n, w) - case.max_ms, 0.02 * edge, 0.97 * edge))
        for n, edge in edges_of(case).items()
    }


def _filter(order: int, bandwidth: float) -> LowPassFilter:
    return LowPassFilter(LowPassFilter(1.0, order).bandwidth / bandwidth, order)


# The curves must be told apart, and so must the λ that the mistakes lead to.
@fitting(lambda case: fastest_of(case)[3] < 0.9 * fastest_of(case)[2])
def _orders_case(rng: np.random.Generator) -> OrdersCase:
    poles = [draw(rng, 0.5, 2), draw(rng, 2.5, 6)]
    gain, zero = draw(rng, 0.5, 5), draw(rng, 15, 90)
    stronger = round(rng.uniform(0.92, 1.08), 2)
    model = all_pole(*poles, gain=gain)
    plant = stronger * model * ct.tf([-1 / zero, 1], [1 / zero, 1])
    return OrdersCase(plant, model, float(rng.choice([1.8, 1.9, 2.0])))


def _order_and_time(given: Any) -> LowPassFilter:
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
    if F.bandwidth < (1 - READING) * max(fastest_of(case).values()):
        return lack_of("4.2", "slower", bandwidth=F.bandwidth)
    return ""


def _times(bandwidths: dict[int, float], *orders: int) -> list[tuple[int, float]]:
    return [(n, _filter(n, bandwidths[n]).time_constant) for n in orders]


FASTEST_ORDER = pose(
    "4.2",
    alike=lambda expected, got: (
        got.order == expected[0] and near(expected[1], got.time_constant, READING)
    ),
    case=_orders_case,
    reads=_order_and_time,
    lacks=_read_well,
    own=True,
    misconceptions={
        "judged by the edge": any_of(lambda case: _times(edges_of(case), 4, 3, 2)),
        "reciprocal of the bandwidth": lambda case: (2, 1 / fastest_of(case)[2]),
        "another curve than the fastest": any_of(lambda case: _times(fastest_of(case), 4, 3)),
    },
)


# --- 4.3 One filter for three plants ------------------------------------------------------------

FASTER = 1.05  # by how much a filter may be slower than needed


@dataclass(frozen=True, eq=False)
class PlantsCase:
    """A plant as it is and as it may become, and what is asked of the filter."""

    plants: list[ct.TransferFunction]  # the first is the plant as it is today
    model: ct.TransferFunction
    order: int  # of the filter
    max_ms: float  # limit for Ms, with each of the plants

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
    n, ms = case.order, case.max_ms
    return [1.01 * _border(n, gain, ms, of_FH) / zero for gain, zero in _errors(case)]


def _last_edge(case: PlantsCase) -> float:
    """Give the smallest λ at which the loop is stable with every plant."""
    return max(_edge(case.order, gain) / zero for gain, zero in _errors(case))


@kept
def peaks_of(case: PlantsCase, time_constant: float, which: str = "plant_loop") -> list[float]:
    """Give Ms with each plant; infinite where the loop is not stable."""
    F = LowPassFilter(time_constant, case.order)
    found = [getattr(NRDOB(plant, case.model, 0.0, F).margins(), which) for plant in case.plants]
    return [m.ms if m.stable else inf for m in found]


def _good(case: PlantsCase, peak: float) -> bool:
    """Tell whether a peak is within the limit, for a λ of three digits."""
    return peak <= 1.01 * case.max_ms


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


def _telling(case: PlantsCase) -> bool:
    """Either of the worn plants may be the one that decides; each mistake leads elsewhere."""
    borders = borders_of(case)
    return min(borders) == borders[0] and apart(*borders, max(borders_of(case, True)), by=0.07)


@fitting(_telling)
def _plants_case(rng: np.random.Generator) -> PlantsCase:
    slow = draw(rng, 0.3, 3)
    other, zero = few(slow * rng.uniform(1.5, 3)), few(slow * rng.uniform(15, 30))
    nearer, more = few(zero / rng.uniform(1.15, 1.6)), few(rng.uniform(1.1, 1.5))
    model = all_pole(slow, other, gain=draw(rng, 0.3, 5))
    worn = [model * ct.tf([-1 / nearer, 1], [1]), more * model * ct.tf([-1 / zero, 1], [1])]
    plants = [model * ct.tf([-1 / zero, 1], [1]), *(worn[k] for k in rng.permutation(2))]
    order, max_ms = int(rng.integers(2, 4)), float(rng.choice([1.8, 1.9, 2.0]))
    return PlantsCase(plants, model, order, max_ms)


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
    example: Callable[[PlantsCase], float], recognises: Callable[[PlantsCase, float], bool]
) -> Misconception:
    return Misconception(
        lambda case: LowPassFilter(example(case), case.order),
        lambda case, got: got.order == case.order and recognises(case, got.time_constant),
    )


THREE_PLANTS = pose(
    "4.3",
    case=_plants_case,
    reads=lowpass,
    lacks=_good_for_all,
    rounded=lambda case, got: rounds(LowPassFilter(max(borders_of(case)) / 1.01, case.order), got),
    misconceptions={
        "edge of stability taken for the specification": _slowed(
            lambda case: _last_edge(case) * (1 + 1e-6),
            lambda case, value: abs(log(value / _last_edge(case))) < 0.01,
        ),
        "plant of today only": _slowed(
            lambda case: borders_of(case)[0],
            lambda case, value: (
                just_good(case, lambda v: peaks_of(case, v)[0], value)
                and not _good(case, max(peaks_of(case, value)))
            ),
        ),
        "margin of FH taken for the plant's": _slowed(
            lambda case: max(borders_of(case, of_FH=True)),
            lambda case, value: just_good(
                case, lambda v: max(peaks_of(case, v, "observer_loop")), value
            ),
        ),
        "the fastest kept instead of the slowest": _slowed(
            lambda case: sorted(borders_of(case))[1],
            lambda case, value: sum(_good(case, peak) for peak in peaks_of(case, value)) == 2,
        ),
        "slower than needed": _slowed(
            lambda case: 3 * max(borders_of(case)),
            lambda case, value: _good(case, max(peaks_of(case, value))),
        ),
    },
)


# --- 4.5 Find the error: reduce the bandwidth ---------------------------------------------------

SLOW = (1e2, 1e3, 1e4)
"""Time constants against the slowest of plant and model: so slow that the limit has come."""


@dataclass(frozen=True, eq=False)
class SlowCase:
    """A stable model without zeros in the right half plane, and the order of the filter."""

    model: ct.TransferFunction
    order: int  # 3 or more

    def __repr__(self) -> str:
        return f"{factored(self.model)}, n = {self.order}"


def _onset(case: SlowCase) -> float:
    """Give the size at which H(0) meets -Γ_n, sec^n(π/n): the bound of G(0)/model(0), less 1."""
    return gain_bound(case.order) - 1


def _slow_case(rng: np.random.Generator) -> SlowCase:
    gain = either_sign(rng) * draw(rng, 0.3, 5)
    model = all_pole(draw(rng, 0.2, 1), draw(rng, 2, 6), gain=gain)
    return SlowCase(model, int(rng.integers(3, 7)))


def _mirrored(case: SlowCase, gain: float) -> ct.TransferFunction:
    """Give the model times a gain, an unstable zero and a pole at its mirror image."""
    speed = float(np.abs(case.model.poles()).max())
    return gain * case.model * ct.tf([-1 / speed, 1], [1 / speed, 1])


def _refutes(case: SlowCase, got: Any) -> str:
    """Tell what keeps a plant from being a counterexample."""
    if isinstance(got, DelayedTransferFunction) and got.delay:
        return "it has a dead time; give a plant without one"
    blocks = ObserverEquations(got, case.model, LowPassFilter(1.0, case.order)).fractions
    G, Gm = blocks.G, blocks.Gm
    # 1 + H = b/a: its zeros less its poles in the right half plane are the clockwise encirclements.
    a, b = QuasiPolynomial(np.convolve(G.den, Gm.num)), QuasiPolynomial(np.convolve(G.num, Gm.den))
    if np.any(a.roots.real >= 0):
        return Lack("unstable", "this plant is not stable")
    g0, encirclements = float(b.q[-1] / a.q[-1]), int(np.sum(b.roots.real >= 0))
    if not g0 > 0:
        words = f"G(0)/model(0) is {g0:.3g}; the two are to have the same sign"
        return Lack("sign" if g0 < 0 else "", words)
    slowest = 1 / min(float(np.abs(p.without_origin.roots).min(initial=inf)) for p in (a, b))
    filters = [LowPassFilter(factor * slowest, case.order) for factor in SLOW]
    unstable = all(observer_stable(got, case.model, F) is False for F in filters)
    beyond = "H(0)" if _onset(case) < g0 <= _onset(case) + 1 else ""
    if not unstable or stable_for_slow_filters(got, case.model, case.order).holds is not False:
        return Lack(
            beyond or ("zero" if encirclements and g0 <= _onset(case) else ""),
            f"a slow enough filter makes this loop stable; G(0)/model(0) is {g0:.3g}, and H "
            f"makes {encirclements} clockwise encirclements of -1",
        )
    return "" if encirclements else Lack(beyond or "turn", "H does not encircle -1 clockwise")


SLOW_FILTER = pose(
    "4.5",
    case=_slow_case,
    reads=block,
    lacks=_refutes,
    misconceptions={
        "a zero in the right half plane alone": lacking("zero", lambda case: _mirrored(case, 1.0)),
        "H(0) mixed up with G(0)/model(0)": lacking(
            "H(0)", lambda case: _mirrored(case, _onset(case) + 0.5)
        ),
        "no turn that could be avoided": lacking(
            "turn", lambda case: (_onset(case) + 3) * case.model
        ),
        "opposite DC signs": lacking("sign", lambda case: -case.model),
        "unstable plant": lacking("unstable", lambda case: case.model * ct.tf([1, 1], [1, -1])),
    },
)


# --- 4.6 Better than equal lags -----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class BetterCase:
    """A model that is right, and what a filter should do."""

    model: ct.TransferFunction  # and the plant
    noise: float  # limit for the power of white noise at y, in 1/s
    error: float  # limit for the integral of the squared error after a unit step of d, in s
    fastest: float  # limit for the poles of the filter, in rad/s

    def __repr__(self) -> str:
        return (
            f"{factored(self.model)}, noise ≤ {self.noise:g}, error ≤ {self.error:g}, poles up "
            f"to {self.fastest:g} rad/s"
        )


def _order(case: BetterCase) -> int:
    return as_fraction(case.model, "model").relative_degree


class _Price(NamedTuple):
    """What a filter costs, and whether it may be used at all."""

    noise: float
    error: float
    speed: float
    poles: ComplexArray
    causal: bool


def _price(case: BetterCase, filter: Any) -> _Price:
    num, den = filter_fraction(filter)
    poles = np.roots(den).astype(complex)
    speed, causal = float(np.abs(poles).max()), den.size - num.size >= _order(case)
    error = rational_power(np.polysub(den, num)[:-1], den)  # of (1 - F)/s
    return _Price(rational_power(num, den), error, speed, poles, causal)


def _spread(case: BetterCase, slow: float, ratio: float) -> ct.TransferFunction:
    return all_pole(slow, *[ratio * slow] * (_order(case) - 1))


def _better_case(rng: np.random.Generator) -> BetterCase:
    order = int(rng.integers(3, 5))
    slowest = draw(rng, 0.5, 5)
    poles = [slowest, *(few(slowest * rng.uniform(2, 5)) for _ in range(order - 1))]
    free = BetterCase(all_pole(*poles, gain=draw(rng, 0.5, 5)), inf, inf, inf)
    slow = slowest * rng.uniform(3, 6)
    price = _price(free, _spread(free, slow, 4.0))
    noise, error = few(1.03 * price.noise, 3), few(1.04 * price.error, 3)
    return BetterCase(free.model, noise, error, fastest=few(6.5 * slow))


def _beats(case: BetterCase, got: Any) -> str:
    price = _price(case, got)
    if not price.causal:
        words = "F/model is not causal"
    elif observer_stable(case.model, case.model, got) is not True:
        words = "the loop is not stable"
    elif price.speed > case.fastest * LEEWAY:
        words = f"its fastest pole is {price.speed:.4g} rad/s"
    else:
        found = {name: getattr(price, name) for name in ("noise", "error")}
        over = [name for name in found if found[name] > getattr(case, name) * LEEWAY]
        words = " and ".join(f"the {name} is {found[name]:.4g}" for name in over)
    return words and Lack(_mistake(case, price), words)


def _mistake(case: BetterCase, price: _Price) -> str:
    product, order = price.noise * price.error, _order(case)
    if not price.causal:
        return "too few"
    if np.abs(price.poles / price.poles.mean() - 1).max() < 0.02:
        return "equal"
    if product > noise_index(order) * disturbance_index(order) * LEEWAY:
        return "flat"
    kept = price.noise <= case.noise * LEEWAY and price.error <= case.error * LEEWAY
    if price.speed > case.fastest * LEEWAY and kept:
        return "fast"
    return "scale" if product <= case.noise * case.error * LEEWAY else ""


def _scaled(case: BetterCase, poles: list[float]) -> ct.TransferFunction:
    """Scale a filter in time so that noise and error miss their limits by the same factor."""
    price = _price(case, all_pole(*poles))
    factor = ((case.noise / price.noise) / (case.error / price.error)) ** 0.5
    return all_pole(*(factor * pole for pole in poles))


def _slow(case: BetterCase) -> float:
    """Speed of the slow pole of a good filter."""
    return case.fastest / 6.5


def _butterworth(case: BetterCase) -> ct.TransferFunction:
    num, den = butter(_order(case), 2 * _slow(case), analog=True)
    return ct.tf(num, den)


BETTER = pose(
    "4.6",
    case=_better_case,
    reads=block,
    lacks=_beats,
    own=True,
    misconceptions={
        "too few poles": lacking("too few", lambda case: _scaled(case, [1.0])),
        "equal lags": lacking("equal", lambda case: _scaled(case, [1.0] * _order(case))),
        "flat rather than early": lacking("flat", _butterworth),
        "a pole that is too fast": lacking(
            "fast", lambda case: _scaled(case, [1.0] + [12.0] * (_order(case) - 1))
        ),
        "right shape, wrong scale": lacking(
            "scale", lambda case: _spread(case, 0.8 * _slow(case), 5.0)
        ),
    },
)
