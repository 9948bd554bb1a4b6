"""Set 4: what no filter of equal lags can do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi
from typing import Any, NamedTuple

import control as ct
import numpy as np

from nrdob.design import (
    disturbance_index,
    gain_bound,
    noise_index,
    stable_for_slow_filters,
)
from nrdob.diagram import (
    DelayedTransferFunction,
    LowPassFilter,
    ObserverEquations,
    as_fraction,
    filter_fraction,
    rational_power,
)
from nrdob.numerics import ComplexArray, QuasiPolynomial

from .cases import all_pole, draw, either_sign, factored, few, observer_stable
from .problems import Misconception, pose
from .reading import block

__all__ = ["PROBLEMS"]


# --- 4.5 Find the error: reduce the bandwidth ---------------------------------------------------

SLOW = (1e2, 1e3, 1e4)
"""Time constants against the slowest of plant and model: so slow that the limit has come."""


@dataclass(frozen=True, eq=False)
class SlowCase:
    """A stable model without zeros in the right half plane, and the order of the filter.

    `order`: 3 or more.
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
    model = all_pole(draw(rng, 0.2, 1), draw(rng, 2, 6), gain=gain)
    return SlowCase(model, int(rng.integers(3, 7)))


def _mirrored(case: SlowCase, gain: float) -> ct.TransferFunction:
    """Give the model times a gain, an unstable zero and a pole at its mirror image."""
    speed = float(np.abs(case.model.poles()).max())
    return gain * case.model * ct.tf([-1 / speed, 1], [1 / speed, 1])


class _Facts(NamedTuple):
    """What matters about a plant that is offered as a counterexample."""

    stable: bool
    g0: float
    encirclements: int
    slow_unstable: bool


def _facts(case: SlowCase, plant: Any) -> _Facts:
    blocks = ObserverEquations(plant, case.model, LowPassFilter(1.0, case.order)).fractions
    G, Gm = blocks.G, blocks.Gm
    # 1 + H = b/a: its zeros less its poles in the right half plane are the clockwise encirclements.
    a, b = QuasiPolynomial(np.convolve(G.den, Gm.num)), QuasiPolynomial(np.convolve(G.num, Gm.den))
    slowest = 1 / min(float(np.abs(p.without_origin.roots).min(initial=inf)) for p in (a, b))
    filters = [LowPassFilter(factor * slowest, case.order) for factor in SLOW]
    verdicts = [observer_stable(plant, case.model, F) for F in filters]
    limit = stable_for_slow_filters(plant, case.model, case.order).holds
    poles, zeros = (int(np.sum(p.roots.real >= 0)) for p in (a, b))
    g0 = float(b.q[-1] / a.q[-1]) if a.q[-1] else inf
    return _Facts(poles == 0, g0, zeros - poles, verdicts == [False] * 3 and limit is False)


def _refutes(case: SlowCase, got: Any) -> str:
    if isinstance(got, DelayedTransferFunction) and got.delay:
        return "it has a dead time; give a plant without one"
    facts = _facts(case, got)
    if not facts.stable:
        return "this plant is not stable"
    if not facts.g0 > 0:
        return f"G(0)/model(0) is {facts.g0:.3g}; the two are to have the same sign"
    if not facts.slow_unstable:
        return (
            f"a slow enough filter makes this loop stable; G(0)/model(0) is {facts.g0:.3g}, and H "
            f"makes {facts.encirclements} clockwise encirclements of -1"
        )
    return "" if facts.encirclements >= 1 else "H does not encircle -1 clockwise"


def _offered(
    example: Callable[[SlowCase], Any], of_kind: Callable[[SlowCase, _Facts], bool]
) -> Misconception:
    """Make a misconception that is recognised by the facts about its plant."""
    return Misconception(example, lambda case, got: of_kind(case, _facts(case, got)))


SLOW_FILTER = pose(
    "4.5",
    case=_slow_case,
    reads=block,
    lacks=_refutes,
    misconceptions={
        "a zero in the right half plane alone": _offered(
            lambda case: _mirrored(case, 1.0),
            lambda case, f: f.stable and f.encirclements >= 1 and 0 < f.g0 <= _onset(case),
        ),
        "H(0) mixed up with G(0)/model(0)": _offered(
            lambda case: _mirrored(case, _onset(case) + 0.5),
            lambda case, f: f.stable and _onset(case) < f.g0 <= _onset(case) + 1,
        ),
        "no turn that could be avoided": _offered(
            lambda case: (_onset(case) + 3) * case.model,
            lambda _, f: f.stable and f.g0 > 0 and f.slow_unstable and f.encirclements == 0,
        ),
        "opposite DC signs": _offered(lambda case: -case.model, lambda _, f: f.stable and f.g0 < 0),
        "unstable plant": _offered(
            lambda case: case.model * ct.tf([1, 1], [1, -1]), lambda _, f: not f.stable
        ),
    },
)


# --- 4.6 Better than equal lags -----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class BetterCase:
    """A model that is right, and what a filter should do.

    `model`: the model, which is the plant; `noise`: limit for the power of white noise at y, in
    1/s; `error`: limit for the integral of the squared error after a unit step of d, in seconds;
    `fastest`: no pole of the filter may be faster than this, in rad/s.
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
    return _Price(
        noise=rational_power(num, den),
        error=rational_power(np.polysub(den, num)[:-1], den),  # of (1 - F)/s
        speed=float(np.abs(poles).max()),
        poles=poles,
        causal=den.size - num.size >= _order(case),
    )


def _spread(case: BetterCase, slow: float, ratio: float) -> ct.TransferFunction:
    return all_pole(slow, *[ratio * slow] * (_order(case) - 1))


def _better_case(rng: np.random.Generator) -> BetterCase:
    order = int(rng.integers(3, 5))
    slowest = draw(rng, 0.5, 5)
    poles = [slowest, *(few(slowest * rng.uniform(2, 5)) for _ in range(order - 1))]
    free = BetterCase(all_pole(*poles, gain=draw(rng, 0.5, 5)), inf, inf, inf)
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
    price = _price(case, all_pole(*poles))
    factor = ((case.noise / price.noise) / (case.error / price.error)) ** 0.5
    return all_pole(*(factor * pole for pole in poles))


def _slow(case: BetterCase) -> float:
    """Speed of the slow pole of a good filter."""
    return case.fastest / 6.5


def _butterworth(case: BetterCase) -> ct.TransferFunction:
    angles = pi * (2 * np.arange(_order(case)) + 1 + _order(case)) / (2 * _order(case))
    den = np.real(np.poly(2 * _slow(case) * np.exp(1j * angles)))
    return ct.tf([den[-1]], den)


def _costing(
    example: Callable[[BetterCase], Any], of_kind: Callable[[BetterCase, _Price], Any]
) -> Misconception:
    """Make a misconception that is recognised by what its filter costs."""
    return Misconception(example, lambda case, got: bool(of_kind(case, _price(case, got))))


BETTER = pose(
    "4.6",
    case=_better_case,
    reads=block,
    lacks=_beats,
    own=True,
    misconceptions={
        "too few poles": _costing(lambda case: _scaled(case, [1.0]), lambda _, p: not p.causal),
        "equal lags": _costing(
            lambda case: _scaled(case, [1.0] * _order(case)),
            lambda _, p: np.abs(p.poles / p.poles.mean() - 1).max() < 0.02,
        ),
        "flat rather than early": _costing(
            _butterworth,
            lambda case, p: (
                p.noise * p.error
                > noise_index(_order(case)) * disturbance_index(_order(case)) * LEEWAY
            ),
        ),
        "a pole that is too fast": _costing(
            lambda case: _scaled(case, [1.0] + [12.0] * (_order(case) - 1)),
            lambda case, p: (
                p.speed > case.fastest * LEEWAY
                and p.noise <= case.noise * LEEWAY
                and p.error <= case.error * LEEWAY
            ),
        ),
        "right shape, wrong scale": _costing(
            lambda case: _spread(case, 0.8 * _slow(case), 5.0),
            lambda case, p: p.noise * p.error <= case.noise * case.error * LEEWAY,
        ),
    },
)


PROBLEMS = (SLOW_FILTER, BETTER)
