"""Set 1: the loop and its equations; models and filters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from nrdob.diagram import LowPassFilter, as_fraction
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray

from .cases import POINTS, LoopCase
from .comparing import FOUR_DIGITS
from .drawing import draw, few, fitting
from .problems import Lack, Misconception, lacking, pose
from .reading import block, lowpass, number, things

__all__ = ["TWIN", "WISHES"]

# --- 1.5 Find the error: three degrees of freedom -----------------------------------------------


class TwinCase(LoopCase):
    """A stable loop, for which a twin is to be found."""

    def __repr__(self) -> str:
        F = self.loop.filter
        return f"λ = {F.time_constant:g} s, n = {F.order}, Gm(0) = {self.loop.Gm.dc_gain:g}"


@fitting(lambda case: case.loop.stability().stable is True)
def _twin_case(rng: np.random.Generator) -> TwinCase:
    order, gain = int(rng.integers(2, 4)), draw(rng, 0.5, 5)
    poles = [draw(rng, 0.5, 2), draw(rng, 2.5, 8)]
    moved = [p * float(rng.uniform(1.1, 1.4)) for p in poles]
    model, plant = (ct.tf([gain * p * q], np.poly([-p, -q])) for p, q in (poles, moved))
    return TwinCase(NRDOB(plant, model, 0.5 / gain, LowPassFilter(draw(rng, 0.05, 0.3), order)))


Twin = tuple[float, ct.TransferFunction]


def _twin(given: Any) -> Twin:
    """Read c and F', given as (c, num, den) or as (c, F')."""
    wanted = "three things are asked for, (c, num, den)"
    factor, *rest = things(given, wanted, (2, 3), names="c, num, den")
    return number(factor), block(rest[0] if len(rest) == 1 else tuple(rest))


def _stronger(case: TwinCase, got: Twin) -> ComplexArray:
    """Divide K of the new loop by K, at some points, whether the filter may be used or not."""
    factor, filter = got
    F = filter(POINTS)
    return np.asarray(F / ((1 - F) * factor * case.loop.Gm(POINTS)) / case.loop.K(POINTS))


LEAST = 0.009
"""By how much the factor must differ from 1."""

SAME_K = 2e-3
"""By how much K may differ: its filter may be given with four digits."""


def _twin_lacks(case: TwinCase, got: Twin) -> str:
    factor, filter = got
    if abs(filter(0) - 1) < FOUR_DIGITS:  # as near as python-control keeps it
        filter = filter * float(1 / filter(0).real)
    if abs(factor - 1) < LEAST:
        return "c is 1: give a model that differs from the given one by a hundredth or more"
    share = _stronger(case, got)
    worst = int(np.argmax(np.abs(share - 1)))
    same = abs(share[worst] - 1) <= SAME_K
    try:
        twin = NRDOB(case.loop.process, factor * case.loop.model, case.loop.controller, filter)
    except (TypeError, ValueError) as error:
        return Lack("unusable" if same else "filter", f"this filter cannot be used: {error}")
    if not same:
        words = f"at s = {POINTS[worst]:g} it is {abs(share[worst]):.3g} times it"
        return Lack("K", f"the feedback K is not the same: {words}")
    if twin.stability().observer_loop.stable is not True:
        return "K is the same, but p_B of the new loop is not stable"
    return ""


def _nearly_a_twin(case: TwinCase, got: Twin) -> bool:
    """Tell whether K is nearly the same, far nearer than the change of the model accounts for.

    Nothing else may be wrong: a filter that is unstable is no right one with fewer digits.
    """
    lack = _twin_lacks(case, got)
    if not isinstance(lack, Lack) or lack.kind != "K":
        return False
    off = float(np.abs(_stronger(case, got) - 1).max())
    return abs(got[0] - 1) >= LEAST and off < min(0.1, 0.3 * abs(got[0] - 1))


def _is_filter(case: TwinCase, got: Twin, of: float) -> bool:
    kept = np.allclose(got[1](POINTS), of * case.loop.F(POINTS), rtol=SAME_K)
    return bool(kept) and abs(got[0] - 1) > LEAST


def _same_integral_gain(case: TwinCase, got: Twin) -> bool:
    factor, filter = got
    given, tiny = case.loop.filter, 1e-6
    slope = (1 - filter(tiny).real) / tiny
    expected = given.order * given.time_constant / factor
    same = np.allclose(_stronger(case, got), 1, rtol=0.05)
    return abs(filter(0).real - 1) < 1e-6 and abs(slope / expected - 1) < 1e-3 and not same


def _den(case: TwinCase, factor: float = 1.0) -> list[float]:
    """Coefficients of (λs + 1)^n, with λ divided by a factor."""
    F = case.loop.filter
    return [float(a) for a in LowPassFilter(F.time_constant / factor, F.order).den]


TWIN = pose(
    "1.5",
    case=_twin_case,
    reads=_twin,
    lacks=_twin_lacks,
    rounded=_nearly_a_twin,
    misconceptions={
        "nothing changed": Misconception(
            lambda case: (1.0, [1.0], _den(case)), lambda case, got: abs(got[0] - 1) < LEAST
        ),
        "filter kept": Misconception(
            lambda case: (2.0, [1.0], _den(case)), lambda case, got: _is_filter(case, got, of=1.0)
        ),
        "filter scaled along": Misconception(
            lambda case: (2.0, [2.0], _den(case)),
            lambda case, got: _is_filter(case, got, of=got[0]),
        ),
        "only the integral gain kept": Misconception(
            lambda case: (2.0, [1.0], _den(case, 2.0)), _same_integral_gain
        ),
        "a filter that is unstable": lacking(
            "unusable", lambda case: (-2.0, [-2.0], np.polyadd(case.loop.filter.den, [-3.0]))
        ),
    },
)


# --- 1.6 A filter for three wishes ----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class WishCase:
    """What a filter should do, for a plant that its model describes.

    `plant`: the plant, which is its own model; `omega_d`: up to this frequency (rad/s) disturbances
    at the output are to be reduced to a tenth; `omega_hum`: frequency (rad/s) of a hum in the
    sensor; `hum`: how much of the hum may reach y.
    """

    plant: ct.TransferFunction
    omega_d: float
    omega_hum: float
    hum: float

    @property
    def relative_degree(self) -> int:
        """Poles minus zeros of the plant."""
        return as_fraction(self.plant, "plant").relative_degree

    def __repr__(self) -> str:
        return (
            f"a plant of relative degree {self.relative_degree}, |S_d| ≤ 0.1 up to "
            f"{self.omega_d:g} rad/s, |S_η| ≤ {self.hum:g} at {self.omega_hum:g} rad/s"
        )


REJECTION = 0.1


def _wish_case(rng: np.random.Generator) -> WishCase:
    zero, poles = draw(rng, 2, 6), [draw(rng, 0.5, 2), draw(rng, 2.5, 8)]
    num = [1.0] if rng.random() < 0.5 else [1 / zero, 1.0]
    plant = ct.tf(draw(rng, 0.5, 5) * np.array(num), np.polymul(*([1 / p, 1] for p in poles)))
    omega_d = draw(rng, 0.2, 2)
    order = 4 - len(num)  # an additional lag, beyond causality
    # The slowest filter that rejects enough has λ ω_d just above 0.1/n; a fifth less is allowed.
    fastest = LowPassFilter(0.8 * REJECTION / order / omega_d, order)
    omega_hum = few(omega_d * float(rng.uniform(60, 120)))
    return WishCase(plant, omega_d, omega_hum, few(abs(fastest(1j * omega_hum))))


WITHIN = 1.01
"""By what factor a limit may be exceeded: that is three digits of λ."""


def _most(case: WishCase, S_d: Callable[[ComplexArray], ComplexArray]) -> float:
    """Give the largest |S_d| where disturbances are to be reduced."""
    return float(np.abs(S_d(1j * np.linspace(0, case.omega_d, 201))).max())


def _rejects(case: WishCase, F: LowPassFilter) -> bool:
    return _most(case, lambda s: 1 - F(s)) <= REJECTION * WITHIN


def _wish_lacks(case: WishCase, F: LowPassFilter) -> str:
    loop = NRDOB(case.plant, case.plant, 0.1 / case.plant.dcgain(), F)
    rejection = _most(case, loop.S_d)
    if rejection > REJECTION * WITHIN:
        return f"|S_d| reaches {rejection:.3g} below {case.omega_d:g} rad/s"
    if any(loop.U_eta.at_infinity):
        return "the noise reaches the actuator at every frequency: |U/η| does not fall to zero"
    hum = float(abs(loop.S_eta(1j * case.omega_hum)))
    if hum > case.hum * WITHIN:
        return f"|S_η| is {hum:.3g} at {case.omega_hum:g} rad/s"
    return "" if loop.stability().stable else "the loop is not stable"


def _wish_rounded(case: WishCase, F: LowPassFilter) -> bool:
    """Tell whether λ has so few digits that the last of them is what is too much."""
    few_digits = few(F.time_constant) == F.time_constant
    return few_digits and not _wish_lacks(case, LowPassFilter(0.95 * F.time_constant, F.order))


def _chosen(case: WishCase, rule: Callable[[int], float], more: int = 1) -> LowPassFilter:
    """Choose λ ω_d by a rule for the order, which is that of the model and some more."""
    order = case.relative_degree + more
    return LowPassFilter(rule(order) / case.omega_d, order)


def _gain_at_edge(case: WishCase, got: LowPassFilter) -> float:
    return float(abs(got(1j * case.omega_d)))


WISHES = pose(
    "1.6",
    case=_wish_case,
    reads=lowpass,
    lacks=_wish_lacks,
    rounded=_wish_rounded,
    misconceptions={
        "order just causal": Misconception(
            lambda case: _chosen(case, lambda n: REJECTION / n, more=0),
            lambda case, got: got.order == case.relative_degree and _rejects(case, got),
        ),
        "bandwidth put at the edge": Misconception(
            lambda case: _chosen(case, lambda n: LowPassFilter(1.0, n).bandwidth),
            lambda case, got: abs(_gain_at_edge(case, got) - np.sqrt(0.5)) < 0.01,
        ),
        "order forgotten in the bound": Misconception(
            lambda case: _chosen(case, lambda n: REJECTION),
            lambda case, got: (
                got.order > 1 and abs(got.time_constant * case.omega_d / REJECTION - 1) < 0.02
            ),
        ),
        "1 - |F| taken for |1 - F|": Misconception(
            lambda case: _chosen(case, lambda n: np.sqrt(0.9 ** (-2 / n) - 1)),  # |F| is 0.9 there
            lambda case, got: _gain_at_edge(case, got) >= 0.899 and not _rejects(case, got),
        ),
        "only the disturbance": Misconception(
            lambda case: _chosen(case, lambda n: 0.4 * REJECTION / n),
            lambda case, got: got.order > case.relative_degree and _rejects(case, got),
        ),
    },
)
