"""Set 6: a design project, from specification to a verified loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isinf, isnan, log10, nan

import control as ct
import numpy as np

from nrdob.analysis import LoopMargins
from nrdob.design import design_controller
from nrdob.diagram import LowPassFilter
from nrdob.loop import NRDOB
from nrdob.numerics import FloatArray

from .cases import factored, mirrored_pair, observer_stable
from .comparing import LEEWAY, same
from .drawing import apart, draw, either_sign, few, fitting, kept
from .problems import Misconception, first_of, pose, put_right
from .reading import UnreadableError, number, numbers

__all__ = ["BENCH", "EQUAL_REJECTION", "ONE_PLANT"]


# --- 6.1 Equal rejection ------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RejectionCase:
    """A loop for an unstable plant, and another model and order for the same plant.

    `filter`: the filter that goes with `model`; `other`: another model; `order`: order of the
    filter that is to go with it.
    """

    plant: ct.TransferFunction
    model: ct.TransferFunction
    filter: LowPassFilter
    other: ct.TransferFunction
    order: int

    def __repr__(self) -> str:
        return (
            f"{factored(self.plant)}: {factored(self.model)} with n = {self.filter.order}, "
            f"λ = {self.filter.time_constant:g} s; {factored(self.other)} with n = {self.order}"
        )


def _gains(case: RejectionCase) -> float:
    """Give the DC gain of the model over that of the other one."""
    return float(abs(case.model.dcgain() / case.other.dcgain()))


def _equal(case: RejectionCase) -> float:
    """Give the λ with which nλ/|R(0)| stays."""
    return case.filter.order * case.filter.time_constant * _gains(case) / case.order


REJECTION_MISTAKES: dict[str, Callable[[RejectionCase], float]] = {
    "same λ": lambda case: case.filter.time_constant,
    "gain of the model forgotten": lambda case: _equal(case) / _gains(case),
    "order forgotten": lambda case: case.filter.time_constant * _gains(case),
    "gain upside down": lambda case: _equal(case) / _gains(case) ** 2,
}


def _tells_apart(case: RejectionCase) -> bool:
    """Whether both loops are stable, and each way to go wrong leads elsewhere."""
    value = _equal(case)
    return bool(
        observer_stable(case.plant, case.model, case.filter)
        and observer_stable(case.plant, case.other, LowPassFilter(value, case.order))
        and apart(value, *(of(case) for of in REJECTION_MISTAKES.values()), by=0.05)
    )


@fitting(_tells_apart)
def _rejection_case(rng: np.random.Generator) -> RejectionCase:
    pole = draw(rng, 0.5, 10)
    gain = draw(rng, 0.5, 5)
    plant, mirrored = mirrored_pair(pole, few(pole * rng.uniform(1.5, 3)), gain=gain)
    first, second = rng.permutation([2, 3]).tolist()
    factor, other = rng.permutation([1.0, float(rng.choice([0.4, 0.5, 0.6]))]).tolist()
    filter = LowPassFilter(draw(rng, 0.02 / pole, 0.05 / pole), int(first))
    return RejectionCase(plant, factor * mirrored, filter, other * mirrored, int(second))


@kept
def _rejects_equally(case: RejectionCase, got: float) -> str:
    loop = NRDOB(case.plant, case.other, 0.0, LowPassFilter(got, case.order))
    if loop.stability().observer_loop.stable is not True:
        return "with this λ the loop is not stable"
    first = NRDOB(case.plant, case.model, 0.0, case.filter)
    # Far below every corner |S_d| is a straight line.
    omega = 1e-5 / max(got, case.filter.time_constant)
    size, wanted = (float(abs(of.S_d(1j * omega))) for of in (loop, first))
    if abs(size / wanted - 1) < LEEWAY - 1:
        return ""
    return f"at low frequency |S_d| is {size / wanted:.3g} times what it was"


EQUAL_REJECTION = pose(
    "6.1",
    case=_rejection_case,
    reads=number,
    lacks=_rejects_equally,
    misconceptions=REJECTION_MISTAKES,
)


# --- 6.4 Find the error: one modified plant -----------------------------------------------------


@dataclass(frozen=True, eq=False)
class SurvivalCase:
    """A loop that is stable with its plant and with a modified one.

    `loop`: the loop with the nominal plant; `gain`, `lag`: the modified plant has this
    gain, as a factor below 1, and a lag 1/(lag s + 1) besides, in seconds.
    """

    loop: NRDOB
    gain: float
    lag: float

    def __repr__(self) -> str:
        return (
            f"{factored(self.loop.process)} under {factored(self.loop.model)}, n = 2, "
            f"λ = {self.loop.filter.time_constant:g} s; modified: gain × {self.gain:g}, lag "
            f"{self.lag:g} s"
        )

    def changed(self, gain: float, lag: float) -> NRDOB:
        """Give the loop around the plant with another gain and a lag."""
        plant = gain * self.loop.process
        if lag:
            plant = plant * ct.tf([1], [lag, 1])
        return replace(self.loop, process=plant)


@kept
def survives(case: SurvivalCase, gain: float, lag: float) -> bool | None:
    return case.changed(gain, lag).stability().stable


def _inside(case: SurvivalCase, gain: float, lag: float) -> bool:
    """Whether nothing changes by more than in the modified plant."""
    slack = 1e-9
    return bool(case.gain * (1 - slack) <= gain <= 1 + slack and 0 <= lag <= case.lag * (1 + slack))


def _half(case: SurvivalCase) -> tuple[float, float]:
    return (1 + case.gain) / 2, case.lag / 4


def _deceives(case: SurvivalCase) -> bool:
    good = ((1, 0), (case.gain, case.lag), (case.gain, 0), _half(case))
    return survives(case, 1, case.lag) is False and all(survives(case, *at) is True for at in good)


@fitting(_deceives)
def _survival_case(rng: np.random.Generator) -> SurvivalCase:
    pole = draw(rng, 0.5, 10)
    gain = either_sign(rng) * draw(rng, 0.5, 5)
    plant, mirrored = mirrored_pair(pole, few(pole * rng.uniform(1.5, 2.5)), gain=gain)
    model = float(rng.choice([0.2, 0.25, 0.3])) * mirrored
    filter = LowPassFilter(few(rng.uniform(0.04, 0.06) / pole), 2)
    controller = design_controller(model, bandwidth=pole, phase_margin=60)
    less, lag = round(float(rng.uniform(0.4, 0.6)), 2), few(rng.uniform(0.08, 0.12) / pole)
    return SurvivalCase(NRDOB(plant, model, controller, filter), less, lag)


def _unstable_inside(case: SurvivalCase, at: FloatArray) -> str:
    if not _inside(case, *at):
        return "this plant is changed by more than the modified one"
    return "" if survives(case, *at) is False else "the loop is stable with this plant"


ONE_PLANT = pose(
    "6.4",
    case=_survival_case,
    reads=partial(numbers, names="gain, lag"),
    lacks=_unstable_inside,
    misconceptions={
        "the modified plant itself": Misconception(
            lambda case: (case.gain, case.lag),
            lambda case, got: same((case.gain, case.lag), got, rtol=1e-3),
        ),
        "the harmless change alone": Misconception(
            lambda case: (case.gain, 0.0),
            lambda case, got: (
                _inside(case, *got) and got[0] < 1 and got[1] == 0 and survives(case, *got) is True
            ),
        ),
        "stable inside": Misconception(
            _half, lambda case, got: _inside(case, *got) and survives(case, *got) is True
        ),
        "beyond what was tried": Misconception(
            lambda case: (1.0, 2 * case.lag),
            lambda case, got: (
                not _inside(case, *got)
                and min(got) > 0
                and not _inside(case, *got[::-1])
                and survives(case, *got) is False
            ),
        ),
        "lag and gain exchanged": Misconception(
            lambda case: (case.lag, 1.0),
            lambda case, got: not _inside(case, *got) and not _unstable_inside(case, got[::-1]),
        ),
    },
)


# --- 6.5 The test bench -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class BenchCase:
    """Three filters to be tried on several plants.

    `plants`: the first is the plant as it is.
    """

    model: ct.TransferFunction
    controller: ct.TransferFunction
    plants: list[ct.TransferFunction]
    filters: list[LowPassFilter]

    def __repr__(self) -> str:
        times = ", ".join(f"{filter.time_constant:g}" for filter in self.filters)
        return (
            f"{len(self.plants)} plants like {factored(self.plants[0])}, n = "
            f"{self.filters[0].order}, λ = {times} s"
        )


def _bench(case: BenchCase) -> list[list[NRDOB]]:
    return [
        [NRDOB(plant, case.model, case.controller, filter) for plant in case.plants]
        for filter in case.filters
    ]


@kept
def _margins(case: BenchCase) -> list[list[LoopMargins]]:
    return [[loop.margins() for loop in row] for row in _bench(case)]


def _peaks(case: BenchCase, which: str = "plant_loop") -> list[list[float]]:
    """Give Ms for each filter and plant; nan where the loop is not stable."""
    return [[float(getattr(found, which).ms) for found in row] for row in _margins(case)]


def _worst(case: BenchCase) -> list[float]:
    """Give the largest Ms for each filter, infinite where the loop is unstable."""
    return _largest(_peaks(case))


def _unjudged(case: BenchCase) -> list[float]:
    """Give the largest |1/(1 + L)| on a grid, stable or not."""
    omega = np.geomspace(1e-2, 1e3, 1500) * float(np.abs(case.model.poles()).min())
    return [
        max(float((1 / np.abs(1 + loop.L(1j * omega))).max()) for loop in row)
        for row in _bench(case)
    ]


def _telling(case: BenchCase) -> bool:
    """Whether some filter fails and some does not, and each mistake gives other numbers."""
    worst = _worst(case)
    finite = [k for k, value in enumerate(worst) if value < inf]
    others = (_largest(_peaks(case, "observer_loop")), [peaks[0] for peaks in _peaks(case)])
    return (
        0 < len(finite) < len(worst)
        and all(any(abs(other[k] / worst[k] - 1) > 0.05 for k in finite) for other in others)
        and all(peaks[0] < inf for peaks in _peaks(case))
    )


@fitting(_telling)
def _bench_case(rng: np.random.Generator) -> BenchCase:
    pole = draw(rng, 0.5, 10)
    gain = either_sign(rng) * draw(rng, 0.5, 5)
    plant, model = mirrored_pair(pole, few(pole * rng.uniform(1.5, 2.5)), gain=gain)
    lags = [ct.tf([1], [few(share / pole), 1]) for share in rng.uniform(0.06, 0.11, 2)]
    weak, strong = (round(float(rng.uniform(*ends)), 2) for ends in ((0.5, 0.8), (1.3, 1.8)))
    plants = [plant, weak * plant * lags[0], strong * plant * lags[1]]
    values = [few(share / pole) for share in (0.05, 0.08, 0.16)]
    filters = [LowPassFilter(value, 3) for value in rng.permutation(values).tolist()]
    controller = design_controller(model, bandwidth=pole, phase_margin=60)
    return BenchCase(model, controller, plants, filters)


def _largest(peaks: list[list[float]], unstable: float = inf) -> list[float]:
    return [unstable if any(map(isnan, row)) else max(row) for row in peaks]


def _like(expected: list[float], got: FloatArray) -> bool:
    return got.size == len(expected) and bool(np.allclose(got, expected, rtol=0.01, equal_nan=True))


def _benched(case: BenchCase, got: FloatArray) -> dict[str, str]:
    """Tell for each filter what its number lacks."""
    if got.size != len(case.filters):
        raise UnreadableError(f"{got.size} numbers for {len(case.filters)} filters")

    def lack(true: float, value: float) -> str:
        if _like([true], np.array([value])):
            return ""
        if isinf(true):
            return "the loop with a plant is unstable"
        if isinf(value):
            return "the loop is stable with every plant"
        return f"it is {'larger' if value < true else 'smaller'} than {value:.4g}"

    lacks = map(lack, _worst(case), got)
    return {f"filter {k}": each and f"for filter {k} {each}" for k, each in enumerate(lacks, 1)}


BENCH = pose(
    "6.5",
    alike=_like,
    case=_bench_case,
    reads=partial(numbers, gaps=True),
    lacks=first_of(_benched),
    parts=_benched,
    misconceptions={
        "nan reported": Misconception(
            lambda case: _largest(_peaks(case), nan),
            lambda case, got: (
                got.size == len(case.filters)
                and bool(np.isnan(got).any())
                and not any(_benched(case, np.where(np.isnan(got), inf, got)).values())
            ),
        ),
        "decibels": put_right(
            lambda case: [20 * log10(value) for value in _worst(case)], lambda got: 10 ** (got / 20)
        ),
        "unstable plants left out": lambda case: [float(np.nanmax(row)) for row in _peaks(case)],
        "peak without a verdict": _unjudged,
        "margins of FH": lambda case: _largest(_peaks(case, "observer_loop")),
        "plant as it is": lambda case: [row[0] for row in _peaks(case)],
    },
)
