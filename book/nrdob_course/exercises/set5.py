"""Set 5: unstable and delayed plants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from typing import Any, NamedTuple

import control as ct
import numpy as np

from nrdob.design import right_half_plane_parity, stabilizing_time_constants
from nrdob.diagram import DelayedTransferFunction, LowPassFilter, as_fraction
from nrdob.loop import NRDOB
from nrdob.numerics import FloatArray

from .cases import UnstablePlant, factored, mirrored, not_around, observer_stable, on_the_right, s
from .drawing import apart, draw, either_sign, few, first_fitting, fitting, kept
from .problems import Lack, lacking, pose
from .reading import UnreadableError, block, numbers, things, whole

__all__ = ["ADVICE", "DESIGN", "SIGN"]

# --- 5.1 Which sign? ----------------------------------------------------------------------------


class Pair(NamedTuple):
    """A plant, and a stable model whose sign is still open."""

    process: ct.TransferFunction
    model: ct.TransferFunction

    def __str__(self) -> str:
        return f"plant {factored(self.process)}, model {factored(self.model)}"


@dataclass(frozen=True, eq=False)
class SignCase:
    """Five pairs.

    `pairs`: Each has a `process` and a `model`, both transfer functions; the model is stable and
    has a positive DC gain.
    """

    pairs: tuple[Pair, ...]

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
    return model, whole(order)


def _not_refuting(case: UnstablePlant, got: tuple[ct.TransferFunction, int]) -> str:
    """Tell what keeps a model and an order from refuting the advice."""
    model, order = got
    roots = np.concatenate([model.poles(), model.zeros()])
    if np.any(roots.real >= 0):
        return Lack("right", "the model has an unstable pole or zero; the advice asks for neither")
    falls = as_fraction(model, "model", proper=False).relative_degree
    if falls <= 2:
        return Lack(
            "lags",
            "the model must fall off faster than the plant: that is what over-parametrised is for",
        )
    if order < falls:
        return Lack("order", "F/model is not causal with this order")
    if not right_half_plane_parity(case.process, model).holds:
        return Lack(
            "sign",
            "the model has the wrong sign, so that no filter can work: that is not the advice",
        )
    works = stabilizing_time_constants(case.process, model, order)
    small = works[0][0] / 2 if works else 0.01 / float(np.abs(roots).max())
    fast = (LowPassFilter(k * small, order) for k in (1.0, 0.1)) if small else ()
    if not small or any(observer_stable(case.process, model, F) for F in fast):
        return Lack("works", "every filter that is fast enough stabilises this, as the advice says")
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
    """A plant gain/((s - pole)(s/decay + 1)), with a dead time that may come on top.

    `gain`, `pole`, `decay`: all positive; `pole` and `decay` in rad/s; `dead_time`: in seconds;
    `max_ms`, `max_noise`: largest sensitivity peak, and largest ``|U_eta|``, allowed with the dead
    time.
    """

    gain: float
    pole: float
    decay: float
    dead_time: float
    max_ms: float = inf
    max_noise: float = inf

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
    case = DesignCase(
        gain=draw(rng, 0.5, 4),
        pole=pole,
        decay=few(pole * rng.uniform(3, 6)),
        dead_time=few(rng.uniform(0.055, 0.065) / pole),
    )
    tempting = replace(_design(case, 0.2, size=0.5), process=case.feared).margins()
    return replace(
        case,
        max_ms=few((tempting.plant_loop.ms * tempting.observer_loop.ms) ** 0.5, 3),
        max_noise=few(1.6 * _noise(replace(_design(case, 0.1), process=case.feared))),
    )


def _design(case: DesignCase, value: float, size: float = 1.0, sign: float = 1.0) -> NRDOB:
    """Mirror the pole; the time constant is given in units of 1/pole."""
    model = sign * size * case.gain / ((s + case.pole) * (s / case.decay + 1))
    controller = sign * (s + case.pole) * case.pole / (size * case.gain * s)
    return NRDOB(case.process, model, controller, LowPassFilter(value / case.pole, 2))


def _noise(loop: NRDOB) -> float:
    roots = np.abs(np.concatenate([loop.p_B.roots, loop.G.denominator.roots]))
    omega = np.geomspace(1e-3 * roots.min(), 1e3 * roots.max(), 3001)
    return float(np.abs(loop.U_eta(1j * omega)).max())


def _shortcoming(case: DesignCase, got: Any) -> str:
    """Tell what a design lacks, with numbers."""
    if lack := not_around(case.process, got):
        return lack
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
        trusted = found.observer_loop.ms <= case.max_ms
        return Lack(
            "margin of FH" if trusted else "ms",
            f"with the dead time Ms is {found.plant_loop.ms:.3g}{_calmer(late)}",
        )
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
    peaks = []
    for factor in (0.9, 1.1):
        other = replace(late, filter=LowPassFilter(factor * F.time_constant, F.order))
        peaks.append(other.margins().plant_loop.ms)
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
