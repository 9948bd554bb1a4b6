"""Set 4: what no filter of equal lags can do."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi
from typing import Any, NamedTuple

import control as ct
import numpy as np

from nrdob.design import disturbance_index, gain_bound, noise_index, stable_for_slow_filters
from nrdob.diagram import (
    DelayedTransferFunction,
    LowPassFilter,
    ObserverEquations,
    as_fraction,
    filter_fraction,
    rational_power,
)
from nrdob.numerics import ComplexArray, QuasiPolynomial

from .cases import all_pole, factored, observer_stable
from .comparing import LEEWAY
from .drawing import draw, either_sign, few
from .problems import Lack, lacking, pose
from .reading import block

__all__ = ["BETTER", "SLOW_FILTER"]


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


def _beats(case: BetterCase, got: Any) -> str:
    price = _price(case, got)
    if not price.causal:
        words = "F/model is not causal"
    elif observer_stable(case.model, case.model, got) is not True:
        words = "the loop is not stable"
    elif price.speed > case.fastest * LEEWAY:
        words = f"its fastest pole is {price.speed:.4g} rad/s"
    else:
        each = {"noise": (price.noise, case.noise), "error": (price.error, case.error)}
        words = " and ".join(
            f"the {name} is {value:.4g}"
            for name, (value, limit) in each.items()
            if value > limit * LEEWAY
        )
    return words and Lack(_mistake(case, price), words)


def _mistake(case: BetterCase, price: _Price) -> str:
    """Tell by what a filter costs how it came about."""
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
    angles = pi * (2 * np.arange(_order(case)) + 1 + _order(case)) / (2 * _order(case))
    den = np.real(np.poly(2 * _slow(case) * np.exp(1j * angles)))
    return ct.tf([den[-1]], den)


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
