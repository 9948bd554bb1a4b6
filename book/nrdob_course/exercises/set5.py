"""Set 5: unstable and delayed plants."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from math import asin, inf, log, pi
from typing import Any, NamedTuple

import control as ct
import numpy as np
from scipy.optimize import brentq, minimize_scalar

from nrdob import NRDOB, LowPassFilter, critical_time_constants, delay, stabilizing_time_constants
from nrdob.design import right_half_plane_parity
from nrdob.diagram import DelayedTransferFunction, as_fraction
from nrdob.numerics import FloatArray
from nrdob.plotting import Figure

from .cases import UnstablePlant, around, factored, mirrored, observer_stable, on_the_right, s
from .comparing import near, rounds, same
from .drawing import apart, draw, either_sign, few, first_fitting, fitting, kept
from .figures import draw_crossing
from .problems import Lack, Misconception, any_of, lack_of, lacking, pose, reading
from .reading import UnreadableError, block, numbers, things, whole
from .reading import number as one_number

__all__ = ["ADVICE", "BORDER", "DESIGN", "EDGE", "SIGN", "WAITING", "draw_edge"]


# --- 5.1 Which sign? ----------------------------------------------------------------------------


class Pair(NamedTuple):
    """A plant, and a stable model whose sign is still open."""

    process: ct.TransferFunction
    model: ct.TransferFunction

    def __str__(self) -> str:
        return f"plant {factored(self.process)}, model {factored(self.model)}"


@dataclass(frozen=True, eq=False)
class SignCase:
    """Five pairs."""

    pairs: tuple[Pair, ...]  # the models are stable, with positive DC gains

    def __repr__(self) -> str:
        return f"the five pairs of which the first is {self.pairs[0]}"


@fitting(lambda case: any(np.real(pair.process(0)) < 0 for pair in case.pairs))
def _sign_case(rng: np.random.Generator) -> SignCase:
    """Draw five pairs, not all of whose plants have a positive DC gain."""

    def root() -> float:
        return draw(rng, 0.3, 5)

    def pair_of_poles() -> ct.TransferFunction:
        omega = draw(rng, 0.5, 3)
        return s**2 - few(rng.uniform(0.1, 0.9) * omega) * s + few(omega**2)

    def model(zero: bool) -> ct.TransferFunction:
        first, second = root(), root()
        over = root() - s if zero else 1
        return few(rng.uniform(0.5, 2)) * over / ((s + first) * (s + second))

    def plant(over: Any, under: Any) -> ct.TransferFunction:
        return either_sign(rng) * few(rng.uniform(0.5, 4)) * over / under

    zero = root()
    beside = first_fitting(root, lambda pole: apart(pole, zero, by=0.2))

    pairs = [
        Pair(plant(1, (s - root()) * (s + root())), model(False)),
        Pair(plant(1, pair_of_poles()), model(False)),
        Pair(plant(s - root(), (s + root()) * (s + root())), model(False)),
        Pair(plant(s - zero, (s - beside) * (s + root())), model(False)),
        Pair(plant(1, (s - root()) * (s + root())), model(True)),
    ]
    return SignCase(tuple(pairs[k] for k in rng.permutation(len(pairs))))


def _signs(rule: Callable[[Pair], float]) -> Callable[[SignCase], list[int]]:
    return lambda case: [int(np.sign(rule(pair))) for pair in case.pairs]


def _dc(pair: Pair) -> float:
    return float(np.real(pair.process(0) / pair.model(0)))


def _high_frequency(pair: Pair) -> float:
    (a, b), (c, d) = ((tf.num[0][0][0], tf.den[0][0][0]) for tf in pair)
    return float(a / b * c / d)


@kept
def _odd(pair: Pair, sign: float) -> bool:
    """Whether p_B has an odd number of unstable roots: by the rule, or counted for a filter."""
    loop = NRDOB(pair.process, sign * pair.model, 0, LowPassFilter(0.1, 2))
    counted = loop.stability().observer_loop.closed_loop_rhp
    return not right_half_plane_parity(loop.process, loop.model).holds or bool((counted or 0) % 2)


def _sign_lacks(case: SignCase, signs: FloatArray) -> str:
    if not np.all(np.abs(signs) == 1):
        return "give five numbers, each +1 or -1, in the order of the pairs"
    for k, (pair, sign) in enumerate(zip(case.pairs, signs, strict=True), start=1):
        if _odd(pair, float(sign)):
            return f"with your sign, p_B of pair {k} has an odd number of unstable roots"
    return ""


SIGN = pose(
    "5.1",
    case=_sign_case,
    reads=partial(numbers, names="first, second, third, fourth, fifth"),
    lacks=_sign_lacks,
    misconceptions={
        "the DC sign of the plant, always": _signs(_dc),
        "the opposite sign for every unstable plant": _signs(
            lambda pair: -_dc(pair) if on_the_right(pair.process.poles()) else _dc(pair)
        ),
        "the sign of the plant left out": _signs(
            lambda pair: (-1) ** on_the_right(pair.process.poles(), pair.model.zeros())
        ),
        "zeros of the plant counted": _signs(_high_frequency),
        "zeros of the model forgotten": _signs(
            lambda pair: _dc(pair) * (-1) ** on_the_right(pair.process.poles())
        ),
    },
)


# --- 5.3 How fast may the filter be? ------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class FilterCase:
    """A plant, a model and the order of the filter."""

    process: Any  # a dead time is process.delay, in seconds
    model: ct.TransferFunction
    order: int

    def __repr__(self) -> str:
        return f"plant {factored(self.process)}, model {factored(self.model)}, n = {self.order}"


@kept
def _stable(case: FilterCase, time_constant: float) -> bool | None:
    return observer_stable(case.process, case.model, LowPassFilter(time_constant, case.order))


@kept
def borders_read(case: FilterCase) -> dict[str, float]:
    """Give the true border, and what one would take for it."""
    edges = critical_time_constants(case.process, case.model, case.order)
    late, rational = case.process.delay, case.process.tf
    fractions = {f"Padé {k}": ct.tf(*ct.pade(late, k)) * rational for k in (1, 2)}
    return {
        "true": edges[-1].time_constant,
        "first edge": edges[0].time_constant,
        "bandwidth": 1 / edges[-1].time_constant,
        "frequency": edges[-1].frequency,
        "2θ/π": 2 * late / pi,
        "small gain": _small_gain(case),
        **{
            name: stabilizing_time_constants(plant, case.model, case.order)[-1][0]
            for name, plant in fractions.items()
        },
    }


def _small_gain(case: FilterCase) -> float:
    """Find the fastest filter with ``|FH| < 1`` at all frequencies."""
    late = case.process.delay
    omega = np.geomspace(1e-3, 1e3, 4001) / late
    size = np.abs(NRDOB(case.process, case.model, 0, LowPassFilter(1.0, 3)).H(1j * omega))

    def excess(value: float) -> float:
        return float((size * np.abs(LowPassFilter(value, case.order)(1j * omega))).max() - 1)

    return float(brentq(excess, 1e-3 * late, 100 * late, xtol=1e-9))


def _tells_apart(case: FilterCase) -> bool:
    found = borders_read(case)
    rough = [value for name, value in found.items() if name not in ("Padé 2", "frequency")]
    sets = stabilizing_time_constants(case.process, case.model, case.order)
    is_last = len(sets) == 1 and sets[0][1] == inf
    told = apart(*rough, by=0.05) and apart(found["true"], found["frequency"], by=0.5)
    return is_last and told and apart(found["true"], found["Padé 2"], by=0.0025)


@fitting(_tells_apart)
def _late_case(rng: np.random.Generator) -> FilterCase:
    """Draw a plant of two lags and a dead time, and a model whose poles are a little off."""
    poles = [draw(rng, 1, 6) for _ in range(2)]
    close = [few(pole * rng.uniform(0.75, 1.35)) for pole in poles]
    gain = few(rng.uniform(0.85, 1.2) * poles[0] * poles[1])
    process = delay(draw(rng, 0.06, 0.4)) * (gain / ((s + poles[0]) * (s + poles[1])))
    model = few(close[0] * close[1]) / ((s + close[0]) * (s + close[1]))
    return FilterCase(process, model, int(rng.integers(2, 4)))


def _border_lacks(case: FilterCase, value: float) -> str:
    if not 0 < value < inf:
        return "a time constant is a positive number"
    if not all(_stable(case, k * value) for k in (50.0, 5.0, 1.5, 1.001)):
        return "there is a slower filter that does not stabilise the loop"
    if _stable(case, 0.999 * value) is not False:
        return "a slightly faster filter stabilises the loop, too"
    return ""


BORDER = pose(
    "5.3",
    alike=partial(same, rtol=1.2e-3),
    case=_late_case,
    reads=one_number,
    lacks=_border_lacks,
    rounded=lambda case, got: rounds(borders_read(case)["true"], got),
    misconceptions={
        "Padé trusted": reading(borders_read, "Padé 1", "Padé 2"),
        "the closed form of a pure dead time": reading(borders_read, "2θ/π"),
        "small gain taken for the border": reading(borders_read, "small gain"),
        "the first edge taken for the last": reading(borders_read, "first edge"),
        "a frequency given for the time constant": reading(borders_read, "bandwidth", "frequency"),
    },
)


# --- 5.4 Read an edge off a picture -------------------------------------------------------------


@kept
def edge_of(case: FilterCase) -> tuple[float, float]:
    """Give the time constant of the edge, and the frequency of the roots there."""
    ((value, omega, _),) = critical_time_constants(case.process, case.model, case.order)
    return value, omega


@kept
def side_of(case: FilterCase) -> str:
    """Tell whether the loop is stable "below" or "above" the edge."""
    return "below" if _stable(case, 0.9 * edge_of(case)[0]) else "above"


def _edge_case(rng: np.random.Generator) -> FilterCase:
    """Draw an unstable pole that the model mirrors, or an unstable zero that it leaves out."""
    unstable = bool(rng.random() < 0.5)

    def drawn() -> FilterCase:
        gain, lag, speed = (draw(rng, low, high) for low, high in ((1.3, 5), (2, 9), (0.6, 6)))
        size = draw(rng, 0.5, 4)
        stronger = 1.0 if unstable else rng.uniform(0.7, 1.4)
        model = size / ((s + few(speed * rng.uniform(0.6, 1.6))) * (s + lag))
        if unstable:
            return FilterCase(few(gain * size) / ((s - speed) * (s + lag)), model, 2)
        process = few(size * stronger) * (1 - s / few(2 * speed)) / ((s + speed) * (s + lag))
        return FilterCase(process, model, 2)

    return first_fitting(drawn, lambda case: _legible(case, unstable))


def _legible(case: FilterCase, unstable: bool) -> bool:
    """Whether there is one edge, in the picture, and every misreading leads elsewhere."""
    if len(critical_time_constants(case.process, case.model, case.order)) != 1:
        return False
    value, omega = edge_of(case)
    x = value * omega
    verdicts = [_stable(case, k * value) for k in (0.9, 1.1)]
    seen = 0.5 < x < 2.2 and 0.5 < omega < 30
    told = apart(value, x, 1 / value, by=0.3) and apart(value, x, omega, by=0.3)
    return verdicts == [unstable, not unstable] and seen and told


def draw_edge(case: FilterCase) -> Figure:
    """Draw H, marked at round frequencies, and the curve of order 2, marked at round x.

    Parameters
    ----------
    case : FilterCase
        What is asked for.
    """
    return draw_crossing(NRDOB(case.process, case.model, 0, LowPassFilter(1.0, 2)), *edge_of(case))


Edge = tuple[float, str]


def _read_edge(given: Any) -> Edge:
    wanted = 'two things are asked for, the time constant and "below" or "above"'
    value, given_side = things(given, wanted)
    side = str(given_side).strip().lower()
    if side not in ("below", "above"):
        raise UnreadableError('the second entry must be "below" or "above"')
    return one_number(value), side


def _edge_lacks(case: FilterCase, got: Edge) -> str:
    value, side = got
    if not value > 0:
        return "a time constant is a positive number"
    low, high = (_stable(case, k * value) for k in (1 / NEAR_EDGE, NEAR_EDGE))
    if low is high:
        return lack_of("5.4", "elsewhere", value=value)
    return "" if bool(low) is (side == "below") else "it is stable on the other side"


NEAR_EDGE = 1.12  # how well an edge can be read off a picture


def _other_side(case: FilterCase) -> Edge:
    return edge_of(case)[0], "above" if side_of(case) == "below" else "below"


EDGE = pose(
    "5.4",
    alike=lambda expected, got: near(expected[0], got[0], log(NEAR_EDGE)),
    case=_edge_case,
    reads=_read_edge,
    lacks=_edge_lacks,
    own=True,
    misconceptions={
        "the wrong side": Misconception(
            _other_side,
            lambda case, got: (
                near(edge_of(case)[0], got[0], log(NEAR_EDGE)) and got[1] == _other_side(case)[1]
            ),
        ),
        "x taken for the time constant": lambda case: (
            edge_of(case)[0] * edge_of(case)[1],
            side_of(case),
        ),
        "a frequency taken for the time constant": any_of(
            lambda case: [(1 / edge_of(case)[0], side_of(case)), (edge_of(case)[1], side_of(case))]
        ),
    },
)


# --- 5.5 More lags in the model -----------------------------------------------------------------


def _unstable_plant(rng: np.random.Generator) -> UnstablePlant:
    pole = draw(rng, 0.5, 3)
    gain = either_sign(rng) * draw(rng, 0.5, 5)
    return UnstablePlant(gain, pole, few(pole * rng.uniform(1.5, 4)))


def _model_and_order(given: Any) -> tuple[ct.TransferFunction, int]:
    wanted = "two things are asked for, the model and the order, a whole number"
    given_model, order = things(given, wanted)
    model = block(given_model)
    if not isinstance(model, ct.TransferFunction):
        raise UnreadableError("the model has a dead time; give one without")
    if not np.any(model.num_array[0, 0]) or whole(order) < 1:
        raise UnreadableError(f"{wanted}; neither can be nothing")
    return model, whole(order)


def _not_refuting(case: UnstablePlant, got: tuple[ct.TransferFunction, int]) -> str:
    model, order = got
    roots = np.concatenate([model.poles(), model.zeros()])
    if np.any(roots.real >= 0):
        return lack_of("5.5", "right")
    falls = as_fraction(model, "model", proper=False).relative_degree
    if falls <= 2:
        return lack_of("5.5", "lags")
    if order < falls:
        return lack_of("5.5", "order")
    if not right_half_plane_parity(case.process, model).holds:
        return lack_of("5.5", "sign")
    works = stabilizing_time_constants(case.process, model, order)
    small = works[0][0] / 2 if works else 0.01 / float(np.abs(roots).max())
    fast = (LowPassFilter(k * small, order) for k in (1.0, 0.1)) if small else ()
    if not small or any(observer_stable(case.process, model, F) is not False for F in fast):
        return lack_of("5.5", "works")
    return ""


def _over(case: UnstablePlant, lags: int = 1, sign: float = 1.0) -> ct.TransferFunction:
    """Mirror the pole of the plant, and add lags ten times as fast."""
    return sign * mirrored(case) / (s / (10 * case.decay) + 1) ** lags


ADVICE = pose(
    "5.5",
    case=_unstable_plant,
    reads=_model_and_order,
    lacks=_not_refuting,
    misconceptions={
        "an order that works": lacking("works", lambda case: (_over(case), 3)),
        "the DC sign of the plant": lacking("sign", lambda case: (_over(case, sign=-1.0), 4)),
        "no lag more than the plant": lacking("lags", lambda case: (_over(case, lags=0) / 20, 3)),
        "an unstable pole in the model": lacking(
            "right", lambda case: (case.process / (s / (10 * case.decay) + 1), 4)
        ),
        "a filter that is not causal": lacking("order", lambda case: (_over(case), 2)),
    },
)


# --- 5.6 Hold it --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DesignCase:
    """A plant gain/((s - pole)(s/decay + 1)), with a dead time that may come on top."""

    gain: float  # positive, as pole and decay are
    pole: float  # this and decay in rad/s
    decay: float
    dead_time: float  # in seconds
    max_ms: float = inf  # allowed with the dead time
    max_noise: float = inf  # largest |U_eta| allowed with the dead time

    @property
    def process(self) -> ct.TransferFunction:
        """The plant without dead time."""
        return self.gain / ((s - self.pole) * (s / self.decay + 1))

    @property
    def feared(self) -> DelayedTransferFunction:
        """The plant with it."""
        return DelayedTransferFunction(self.process, self.dead_time)

    def __repr__(self) -> str:
        return (
            f"the plant {factored(self.process)}, feared with {self.dead_time:g} s of dead time, "
            f"Ms ≤ {self.max_ms:g}, |U_eta| ≤ {self.max_noise:g}"
        )


def _design_case(rng: np.random.Generator) -> DesignCase:
    """Draw a plant; the limits are such that the mirrored model of full size meets them."""
    pole = draw(rng, 0.5, 5)
    gain, decay = draw(rng, 0.5, 4), few(pole * rng.uniform(3, 6))
    case = DesignCase(gain, pole, decay, dead_time=few(rng.uniform(0.055, 0.065) / pole))
    tempting = replace(_design(case, 0.2, size=0.5), process=case.feared).margins()
    between = (tempting.plant_loop.ms * tempting.observer_loop.ms) ** 0.5
    noise = _noise(replace(_design(case, 0.1), process=case.feared))
    return replace(case, max_ms=few(between, 3), max_noise=few(1.6 * noise))


def _design(case: DesignCase, value: float, size: float = 1.0, sign: float = 1.0) -> NRDOB:
    """Mirror the pole; the time constant is given in units of 1/pole."""
    model = sign * size * case.gain / ((s + case.pole) * (s / case.decay + 1))
    controller = sign * (s + case.pole) * case.pole / (size * case.gain * s)
    return NRDOB(case.process, model, controller, LowPassFilter(value / case.pole, 2))


def _noise(loop: NRDOB) -> float:
    roots = np.abs(np.concatenate([loop.p_B.roots, loop.G.denominator.roots]))
    omega = np.geomspace(1e-3 * roots.min(), 1e3 * roots.max(), 3001)
    return float(np.abs(loop.U_eta(1j * omega)).max())


@around
def _shortcoming(case: DesignCase, got: NRDOB) -> str:
    verdict = got.stability()
    if np.any(np.abs(got.p_B.roots - case.pole) < 1e-6 * case.pole):
        return Lack("matched", "the plant's unstable pole is a root of p_B")
    if not right_half_plane_parity(got.process, got.model).holds:
        return Lack("sign", "p_B has an odd number of roots in the right half plane")
    if verdict.model_loop.stable is not True:
        return "the controller does not stabilise the model"
    if verdict.stable is not True:
        return f"even without the dead time it is not stable: {_which_way(got)}"
    late = replace(got, process=case.feared)
    if late.stability().stable is not True:
        return Lack("feared", "with the dead time the loop is not stable")
    found, noise = late.margins(), _noise(late)
    if not found.plant_loop.ms <= case.max_ms * (1 + 1e-6):
        kind = "margin of FH" if found.observer_loop.ms <= case.max_ms else "ms"
        words = f"with the dead time Ms is {found.plant_loop.ms:.3g}{_calmer(late)}"
        return Lack(kind, words)
    if not noise <= case.max_noise * (1 + 1e-6):
        return Lack("noise", f"with the dead time |U_eta| reaches {noise:.3g}")
    if abs(late.T_R.dc_gain - 1) > 0.01:
        return f"y comes to rest at {late.T_R.dc_gain:.3g} after a unit step of R"
    return ""


def _which_way(loop: NRDOB) -> str:
    """Tell an unstable loop whether its filter is too fast or too slow."""
    F = loop.filter
    if not isinstance(F, LowPassFilter):
        return "the filter does not stabilise p_B"
    works = stabilizing_time_constants(loop.process, loop.model, F.order)
    if not works:
        return "no filter of this order stabilises p_B with this model"
    slow = F.time_constant >= works[0][1]
    return "the filter is too slow for the unstable pole" if slow else "the filter is too fast"


def _calmer(late: NRDOB) -> str:
    """Tell a loop whose sensitivity peak is too high which way is down."""
    F = late.filter
    if not isinstance(F, LowPassFilter):
        return ""
    filters = [LowPassFilter(factor * F.time_constant, F.order) for factor in (0.9, 1.1)]
    peaks = [replace(late, filter=other).margins().plant_loop.ms for other in filters]
    best = np.nanargmin(peaks) if not np.isnan(peaks).all() else 1
    return f"; a {('faster', 'slower')[int(best)]} filter lowers it"


DESIGN = pose(
    "5.6",
    case=_design_case,
    lacks=_shortcoming,
    misconceptions={
        "a model that matches the plant": lacking(
            "matched", lambda case: replace(_design(case, 0.1, size=1 / 3), model=case.process)
        ),
        "the DC sign of the plant": lacking("sign", lambda case: _design(case, 0.1, sign=-1.0)),
        "designed for the plant that is hoped for": lacking(
            "feared", lambda case: _design(case, 0.02)
        ),
        "margin of FH taken for the plant's": lacking(
            "margin of FH", lambda case: _design(case, 0.2, size=0.5)
        ),
        "too much noise at the actuator": lacking("noise", lambda case: _design(case, 0.065)),
    },
)


# --- 5.7 How well must the dead time be known? --------------------------------------------------


@dataclass(frozen=True, eq=False)
class DelayedCase:
    """A plant whose model has nearly the right dead time."""

    prompt: ct.TransferFunction  # what stands before the dead time, in the plant and in the model
    dead_time: float  # of the model today, in seconds
    error: float  # by how much the plant's may be another one, in seconds, up or down
    order: int  # of the filter

    def __repr__(self) -> str:
        late = delay(self.dead_time) * self.prompt
        return f"model {factored(late)}, dead time wrong by {self.error:g} s, n = {self.order}"


@cache
def _tolerated(order: int) -> float:
    """Error of the dead time, relative to λ, tolerated whatever the dead time: c_n.

    Roots reach the axis where Df = exp(-jωθm) - exp(-jωθ), of size 2 sin(ω|θ - θm|/2) at most.
    """
    last = (2 ** (2 / order) - 1) ** 0.5  # where |Df| = 2

    def error(x: float) -> float:
        return 2 * asin(min((1 + x * x) ** (order / 2) / 2, 1.0)) / x

    return float(minimize_scalar(error, bounds=(0, last), method="bounded").fun)


@kept
def _today(case: DelayedCase) -> float:
    """Find the fastest filter that tolerates the error with the dead time of today."""
    model = delay(case.dead_time) * case.prompt
    plants = [delay(case.dead_time + off) * case.prompt for off in (-case.error, case.error)]
    floor = 0.1 * case.error
    edges = [critical_time_constants(each, model, case.order, floor=floor) for each in plants]
    return max(found[-1].time_constant for found in edges)


@kept
def _unwaited(case: DelayedCase) -> float:
    """Find the fastest filter where the error is all the dead time and the model has none."""
    process = delay(case.error) * case.prompt
    return float(stabilizing_time_constants(process, case.prompt, case.order)[-1][0])


def _ramp_bound(case: DelayedCase) -> float:
    """Give λ with ``ω|error| |F| < 1``: the largest x/(1 + x²)^(n/2) is at x = 1/√(n - 1)."""
    n = case.order
    return float(case.error * (n - 1) ** ((n - 1) / 2) / n ** (n / 2))


WAITING_MISTAKES: dict[str, Callable[[DelayedCase], float]] = {
    "order forgotten": lambda case: case.error / _tolerated(1),
    "error taken for the whole dead time": _unwaited,
    "the dead time of today alone": _today,
    "sine taken for its angle": _ramp_bound,
    "upside down": lambda case: case.error * _tolerated(case.order),
}


def _differs(case: DelayedCase) -> bool:
    """Whether each mistake leads elsewhere; the one that seldom does is asked first."""
    right, each = case.error / _tolerated(case.order), WAITING_MISTAKES.values()
    return apart(right, _today(case), by=0.004) and apart(
        right, *(of(case) for of in each), by=0.004
    )


@fitting(_differs)
def _waiting_case(rng: np.random.Generator) -> DelayedCase:
    pole, other = draw(rng, 0.5, 4), draw(rng, 0.5, 4)
    prompt = few(rng.uniform(0.5, 4)) / ((s / pole + 1) * (s / other + 1))
    dead_time = draw(rng, 0.2, 1.5)
    error = few(dead_time * rng.uniform(0.08, 0.2))
    return DelayedCase(prompt, dead_time, error, int(rng.integers(2, 5)))


def _waiting_lacks(case: DelayedCase, got: float) -> str:
    if not 0 < got < inf:
        return "a time constant is a positive number"
    tolerated = _tolerated(case.order) * got
    if same(case.error, tolerated):
        return ""
    kind = "slow" if tolerated > case.error else "fast"
    return lack_of("5.7", kind, tolerated=tolerated, error=case.error)


WAITING = pose(
    "5.7",
    case=_waiting_case,
    reads=one_number,
    lacks=_waiting_lacks,
    rounded=lambda case, got: rounds(case.error / _tolerated(case.order), got),
    misconceptions=WAITING_MISTAKES,
)
