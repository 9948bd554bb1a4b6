"""Set 3: which margins the plant feels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any

import control as ct
import numpy as np

from nrdob.analysis import LoopMargins
from nrdob.diagram import LowPassFilter
from nrdob.loop import NRDOB

from .cases import LoopCase, observer_stable
from .comparing import LEEWAY
from .drawing import draw, few, fitting, kept
from .problems import Lack, Misconception, lacking, pose
from .reading import lowpass, number

__all__ = ["DESIGN", "GAIN"]


# --- 3.5 Find the error: the margin of FH -------------------------------------------------------


class GainCase(LoopCase):
    """A stable loop whose F H has an adequate gain margin."""

    def __repr__(self) -> str:
        m = self.loop.margins().observer_loop
        return f"a loop whose FH has a gain margin of {m.gm_db:.2f} dB"


@kept
def _margins(case: GainCase) -> LoopMargins:
    return case.loop.margins()


def _seems_robust(case: GainCase) -> bool:
    found = _margins(case)
    fh, true = found.observer_loop, found.plant_loop
    return bool(
        found.stable
        and 3.5 < fh.gm_high < inf
        and fh.pm > 60
        and found.model_loop.pm > 45
        and fh.gm_high > 1.3 * true.gm_high
    )


@fitting(_seems_robust)
def _gain_case(rng: np.random.Generator) -> GainCase:
    constant, gain = draw(rng, 0.05, 0.5), draw(rng, 0.5, 5)
    pole = draw(rng, 0.5, 3)
    model = ct.tf([gain], [1 / pole, 1])
    # Two kinds, so that no one number lies between the two margins of all loops.
    stronger = float(rng.choice([rng.uniform(1.1, 1.2), rng.uniform(1.8, 2.1)]))
    fast = float(rng.uniform(0.05, 0.12)) * constant
    lag = rng.random() < 0.5
    wrong = ct.tf([stronger], [fast, 1]) if lag else ct.tf([-stronger * fast, stronger], [1])
    loop = NRDOB(model * wrong, model, ct.tf([pole], [gain, 0]), LowPassFilter(constant, 3))
    return GainCase(loop)


@kept
def _gain_lacks(case: GainCase, k: float) -> str:
    fh = _margins(case).observer_loop
    if not fh.gm_low < k < fh.gm_high:
        return f"the margin of F H allows gains from {fh.gm_low:.4g} to {fh.gm_high:.4g} only"
    loop = case.loop
    stable = observer_stable(k * loop.process, loop.model, loop.filter)  # p_A stays as it is
    if stable is False:
        return ""
    return f"with {k:.4g} times its plant the loop is " + ("stable" if stable else "on the border")


def _decibels(case: GainCase, k: float) -> bool:
    """Tell whether a gain is right in decibels, or one of the two margins in them."""
    found = _margins(case)
    margins = (found.observer_loop, found.plant_loop)
    return any(abs(k / m.gm_db - 1) < 1e-2 for m in margins) or (
        0 < k < 100 and not _gain_lacks(case, 10 ** (k / 20))
    )


GAIN = pose(
    "3.5",
    case=_gain_case,
    reads=number,
    lacks=_gain_lacks,
    misconceptions={
        "decibels taken for a factor": Misconception(
            lambda case: _margins(case).observer_loop.gm_db, _decibels
        ),
        "margin of FH taken for the plant's": Misconception(
            lambda case: 1.01 * _margins(case).observer_loop.gm_high,
            lambda case, got: got >= _margins(case).observer_loop.gm_high,
        ),
        "still stable": Misconception(
            lambda case: 0.95 * _margins(case).plant_loop.gm_high,
            lambda case, got: 0 < got < _margins(case).plant_loop.gm_high,
        ),
    },
)


# --- 3.6 Design for margins ---------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class MarginCase:
    """A plant, its model, and what the loop should be able to do.

    `plant`, `model`, `controller`: blocks of the loop; `ms`: M_s of the plant loop may not be
    larger; `delay_margin`: in seconds; may not be smaller; `rejection`: |S_d|
    at the frequency `omega`, in rad/s, may not be larger than this.
    """

    plant: ct.TransferFunction
    model: ct.TransferFunction
    controller: ct.TransferFunction
    ms: float
    delay_margin: float
    omega: float
    rejection: float

    def loop(self, filter: Any) -> NRDOB:
        """Make the loop with a filter."""
        return NRDOB(self.plant, self.model, self.controller, filter)

    def __repr__(self) -> str:
        return (
            f"Ms ≤ {self.ms:g}, delay margin ≥ {self.delay_margin:g} s, "
            f"|S_d| ≤ {self.rejection:g} at {self.omega:g} rad/s"
        )


def _leaves_room(found: tuple[MarginCase, float]) -> bool:
    """Tell whether between what F H allows and what L allows there is room for the mistake."""
    case, good = found
    faster = case.loop(LowPassFilter(0.88 * SHARES[0] * good, 2))
    return bool(faster.margins().observer_loop.ms <= case.ms)


@fitting(_leaves_room)
def draw_margin_loop(rng: np.random.Generator) -> tuple[MarginCase, float]:
    """Draw a case, and a λ that is good for it."""
    lag, gain = draw(rng, 0.02, 0.3), draw(rng, 0.5, 5)
    slow = [draw(rng, 0.05, 0.15) / lag, draw(rng, 0.2, 0.4) / lag]
    model = ct.tf([gain], np.polymul(*([1 / p, 1] for p in slow)))
    stronger = float(rng.uniform(1.2, 1.5))
    plant = model * ct.tf([stronger], np.polymul([lag, 1], [lag, 1]))
    controller = ct.tf([1 / slow[0], 1], [4 * gain / slow[1], 0])
    good, omega = float(rng.uniform(3.5, 5)) * lag, few(0.05 / lag)
    loops = [NRDOB(plant, model, controller, LowPassFilter(share * good, 2)) for share in SHARES]
    case = MarginCase(
        plant,
        model,
        controller,
        ms=float(np.ceil(100 * loops[0].margins().plant_loop.ms) / 100),
        delay_margin=few(loops[1].margins().plant_loop.delay_margin, 3),
        omega=omega,
        rejection=few(float(abs(loops[2].S_d(1j * omega))), 3),
    )
    return case, good


SHARES = (0.7, 0.9, 1.15)
"""Of a good λ: where M_s becomes too large, then the delay margin too small, then S_d too large."""


def _fastest(case: MarginCase, which: str) -> float:
    """Find the smallest λ at which one loop, judged by M_s, would do."""

    def enough(constant: float) -> bool:
        found = case.loop(LowPassFilter(constant, 2)).margins()
        return bool(found.stable) and bool(getattr(found, which).ms <= case.ms)

    lag = 1 / float(np.abs(case.plant.poles()).max())
    low, high = 0.5 * lag, 8 * lag
    for _ in range(12):
        middle = sqrt(low * high)
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def _design_lacks(case: MarginCase, filter: Any) -> str:
    loop = case.loop(filter)
    if loop.stability().stable is not True:
        return "the loop is not stable"
    true = loop.margins().plant_loop
    size = float(abs(loop.S_d(1j * case.omega)))
    lacks = []
    if true.ms > case.ms * LEEWAY:
        lacks.append(Lack("ms", f"Ms of L is {true.ms:.4g}"))
    if true.delay_margin < case.delay_margin / LEEWAY:
        lacks.append(Lack("delay", f"the delay margin is {true.delay_margin:.4g} s"))
    if size > case.rejection * LEEWAY:
        lacks.append(Lack("rejection", f"|S_d| is {size:.4g} at {case.omega:g} rad/s"))
    return lacks[0] if len(lacks) == 1 else ", ".join(lacks)


def _trusts_FH(case: MarginCase, filter: Any) -> bool:
    found = case.loop(filter).margins()
    return bool(found.observer_loop.ms <= case.ms * LEEWAY < found.plant_loop.ms)


def _slower(share: float, which: str) -> Callable[[MarginCase], LowPassFilter]:
    return lambda case: LowPassFilter(share * _fastest(case, which), 2)


DESIGN = pose(
    "3.6",
    case=lambda rng: draw_margin_loop(rng)[0],
    reads=lambda given: given if isinstance(given, ct.TransferFunction) else lowpass(given),
    lacks=_design_lacks,
    own=True,
    misconceptions={
        "Ms of FH taken for the plant's": Misconception(_slower(1.02, "observer_loop"), _trusts_FH),
        "delay margin not looked at": lacking("delay", _slower(1.05, "plant_loop")),
        "robust only": lacking("rejection", _slower(2.2, "plant_loop")),
    },
)
