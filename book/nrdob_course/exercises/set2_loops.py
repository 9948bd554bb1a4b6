"""Set 2: Lemma 1, and loops that meet it or do not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from nrdob.design import right_half_plane_parity, stabilizing_time_constants
from nrdob.diagram import LowPassFilter, Quotient
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray

from .cases import UnstablePlant, alike, mirrored, not_around, s
from .drawing import draw, either_sign, few
from .problems import Lack, lacking, pose

__all__ = ["LITERAL", "UNTURNED"]

# --- 2.5 Lemma 1, read literally ----------------------------------------------------------------


def _unstable_plant(rng: np.random.Generator) -> UnstablePlant:
    pole = draw(rng, 0.5, 3)
    return UnstablePlant(draw(rng, 0.5, 5), pole, few(pole * rng.uniform(1.5, 4)))


def _visible(open_loop: Quotient) -> ComplexArray:
    """Unstable zeros of 1 + L after cancellation: what Lemma 1 read literally looks at."""
    if not open_loop.numerator.q.any():
        return np.empty(0, dtype=complex)
    tf = open_loop.to_tf()
    roots = np.roots(np.polyadd(tf.num_array[0, 0], tf.den_array[0, 0]))
    return np.asarray(roots[roots.real >= 0], dtype=complex)


def _not_refuting(case: UnstablePlant, got: Any) -> str:
    """Tell what keeps a loop from being a counterexample."""
    if lack := not_around(case.process, got):
        return lack
    for kind, term, open_loop in (("A", "C Gm", got.CGm), ("B", "FH", got.FH)):
        if _visible(open_loop).size:
            return Lack(
                kind,
                f"1 + {term} has an unstable zero, so the lemma does not call this loop stable",
            )
    verdict = got.stability().stable
    if verdict is None:
        return AT_A_BORDER
    if verdict:
        return Lack("stable", "this loop is stable, as the lemma says")
    if alike(got.G, got.Gm):
        return Lack("matched", "the model is the plant itself, which was excluded")
    return ""


AT_A_BORDER = "there is no verdict on this loop, it is at a border; move away from it"


def _held(case: UnstablePlant, pole: float, gain: float) -> NRDOB:
    """Take a model with an unstable pole, and a controller that holds the model."""
    decay = case.decay + case.pole
    model = 1 / ((s - pole) * (s + decay))
    return NRDOB(case.process, model, gain * 2 * pole * decay, LowPassFilter(0.1 / case.pole, 2))


def _around_mirrored(
    case: UnstablePlant, value: float, sign: float = 1.0, hold: float = 0.5
) -> NRDOB:
    """Take the mirrored model, and a controller that gives C Gm a gain."""
    controller = sign * hold * case.pole * case.decay / case.gain
    return NRDOB(case.process, sign * mirrored(case), controller, LowPassFilter(value, 2))


LITERAL = pose(
    "2.5",
    case=_unstable_plant,
    lacks=_not_refuting,
    misconceptions={
        "the model is the plant itself": lacking(
            "matched",
            lambda case: NRDOB(
                case.process,
                case.process,
                2 * case.pole * case.decay / case.gain,
                LowPassFilter(0.1 / case.pole, 2),
            ),
        ),
        "a loop that is stable": lacking(
            "stable", lambda case: _around_mirrored(case, 0.1 / case.pole)
        ),
        "a root that is not hidden": lacking("B", lambda case: _held(case, 1.05 * case.pole, 1.0)),
        "the controller does not hold the model": lacking(
            "A", lambda case: _held(case, case.pole, -1.0)
        ),
        "another plant": lacking(
            "plant",
            lambda case: NRDOB(4 / (2 - s - s**2), 4 / (2 - s - s**2), -2, LowPassFilter(0.05, 2)),
        ),
    },
)


# --- 2.6 A loop that should not exist -----------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class DistantZero(UnstablePlant):
    """A plant gain (1 - s/zero)/((s - pole)(s + decay)).

    `gain`, `pole`, `decay`, `zero`: the gain of either sign; the others positive, in rad/s. The
    zero is far beyond the pole.
    """

    zero: float

    @property
    def process(self) -> ct.TransferFunction:
        """The plant made of these numbers."""
        return (1 - s / self.zero) * super().process


def _distant_zero(rng: np.random.Generator) -> DistantZero:
    pole = draw(rng, 0.5, 3)
    return DistantZero(
        either_sign(rng) * draw(rng, 0.5, 5),
        pole,
        few(pole * rng.uniform(2, 5)),
        few(pole * rng.uniform(60, 150)),
    )


def _not_held(case: DistantZero, got: Any) -> str:
    """Tell why a loop is not the one that should not exist."""
    if lack := not_around(case.process, got):
        return lack
    verdict = got.stability()
    if verdict.stable:
        return ""
    if verdict.observer_loop.stable:
        if verdict.stable is None:
            return AT_A_BORDER
        return Lack("controller", "the controller does not stabilise the model (condition i)")
    shared = [
        root
        for root in verdict.observer_loop.roots
        if root.real > 0 and any(abs(root - r) < 1e-6 * abs(r) for r in (case.pole, case.zero))
    ]
    if shared:
        return Lack(
            "shared", "the model shares an unstable root with the plant, which stays in the loop"
        )
    if verdict.stable is None:
        return AT_A_BORDER
    if not right_half_plane_parity(got.process, got.model).holds:
        return Lack("sign", "p_B has an odd number of unstable roots for every λ and n")
    F = got.filter
    works = isinstance(F, LowPassFilter) and stabilizing_time_constants(
        got.process, got.model, F.order
    )
    if not works:
        return "with this model and order the filter does not stabilise p_B"
    kind = "fast" if F.time_constant <= works[0][0] else "slow"
    return Lack(kind, f"the filter is too {kind}, p_B has roots in the right half plane")


def _with_shared_zero(case: DistantZero) -> NRDOB:
    model = (1 - s / case.zero) * mirrored(case)
    return NRDOB(case.process, model, 0, LowPassFilter(0.1 / case.pole, 2))


UNTURNED = pose(
    "2.6",
    case=_distant_zero,
    lacks=_not_held,
    misconceptions={
        "a root shared in the right half plane": lacking("shared", _with_shared_zero),
        "the DC sign of the plant": lacking(
            "sign", lambda case: _around_mirrored(case, 0.1 / case.pole, sign=-1.0)
        ),
        "the controller does not hold the model": lacking(
            "controller", lambda case: _around_mirrored(case, 0.1 / case.pole, hold=-2.0)
        ),
        "a filter that is too fast": lacking(
            "fast", lambda case: _around_mirrored(case, 0.2 / case.zero)
        ),
        "a filter that is too slow": lacking(
            "slow", lambda case: _around_mirrored(case, 2 / case.pole)
        ),
    },
)
