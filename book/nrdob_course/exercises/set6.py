"""Set 6: a design project, from specification to a verified loop."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isinf, isnan, log10, nan, sqrt
from typing import Any, NamedTuple

import control as ct
import numpy as np
from scipy.optimize import brentq

from nrdob.analysis import LoopMargins
from nrdob.design import design_controller, right_half_plane_parity, stabilizing_time_constants
from nrdob.diagram import LowPassFilter, Quotient, delay
from nrdob.digital import ActuatorLimits
from nrdob.loop import NRDOB
from nrdob.numerics import FloatArray
from nrdob.plotting import Figure

from .cases import factored, grid_peak, mirrored_pair, observer_stable
from .comparing import LEEWAY, READING, near, same
from .drawing import apart, draw, either_sign, few, fitting, kept
from .figures import Peaks, draw_peaks
from .problems import Lack, Misconception, any_of, first_of, lacking, pose, put_right, reading
from .reading import UnreadableError, number, numbers, things

__all__ = ["BENCH", "DESIGN", "EQUAL_REJECTION", "ONE_PLANT", "QUIETEST"]


# --- 6.1 Equal rejection ------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RejectionCase:
    """A loop for an unstable plant, and another model and order for the same plant."""

    plant: ct.TransferFunction
    model: ct.TransferFunction
    filter: LowPassFilter  # goes with model
    other: ct.TransferFunction  # another model
    order: int  # of the filter that is to go with it

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


# --- The plant of the project: 6.2 and 6.6 ------------------------------------------------------

ORDER = 3  # relative degree of the model and one more, so that noise reaches u with a finite power


class Goal(NamedTuple):
    """One line of the specification."""

    name: str
    value: float  # what the design makes of it
    limit: float  # what it may be at most

    @property
    def met(self) -> bool:
        """Whether the value is within the limit, printed to two or three digits."""
        return self.value <= self.limit * (1 + 1e-3)


@dataclass(frozen=True, eq=False)
class Project:
    """A plant with an unstable pole, and what is asked of its loop."""

    plant: ct.TransferFunction  # gain · pole · decay/((s - pole)(s + decay))
    gain: float
    pole: float  # this and decay in rad/s
    decay: float
    modified: ct.TransferFunction  # with a lag that was neglected, another pole and another gain
    gains: tuple[float, ...]  # what the plant's gain may be multiplied by
    dead_time: float  # what may be added to each of them, in seconds
    max_ms: float = inf
    omega: float = nan  # in rad/s
    max_disturbance: float = inf  # limit for |S_d| there
    settling: float = inf  # after this, in seconds, y stays within 5 % of a step of R
    max_noise: float = inf  # limit for the rms of u, for white noise of unit density at the sensor
    max_input: float = 0.9  # the largest that the actuator gives on the bench, see on_bench

    @property
    def dt(self) -> float:
        """Sampling time of the bench, a hundredth of the time of the unstable pole."""
        return few(0.01 / self.pole)

    def __repr__(self) -> str:
        return f"plant {factored(self.plant)}"

    @property
    def specification(self) -> str:
        """All that is known and asked for, in words."""
        gains = ", ".join(f"{gain:g}" for gain in self.gains)
        return "\n".join(
            [
                f"plant             {factored(self.plant)}",
                f"modified plant    {factored(self.modified)}",
                f"other changes     gain × {gains}, with a dead time of 0 or {self.dead_time:g} s",
                f"Ms                at most {self.max_ms:g}",
                f"disturbances      |S_d| at most {self.max_disturbance:g} at {self.omega:g} rad/s",
                f"settling          y within 5 % after {self.settling:g} s",
                f"noise             rms of u at most {self.max_noise:g}",
            ]
        )

    @property
    def changed(self) -> list[Any]:
        """Every plant that the loop must survive: the modified one, gains, and dead times."""
        scaled = [gain * self.plant for gain in self.gains]
        return [self.modified, *scaled, *(delay(self.dead_time) * plant for plant in scaled)]

    def goals(self, model: Any, controller: Any, filter: Any) -> list[Goal]:
        """Compute what a design makes of each goal."""
        return list(_goals(self, NRDOB(self.plant, model, controller, filter)))

    def report(self, model: Any, controller: Any, filter: Any) -> None:
        """Print the table of goals."""
        print(_table(self.goals(model, controller, filter)))

    def on_bench(self, model: Any, controller: Any, filter: Any) -> None:
        """Print two goals more, without points: the loop sampled, and with a limited actuator."""
        print(_table(_bench_goals(self, NRDOB(self.plant, model, controller, filter))))


def _goals(case: Project, loop: NRDOB) -> Iterator[Goal]:
    verdict = loop.stability()
    for name, part in (("model", verdict.model_loop), ("observer", verdict.observer_loop)):
        # Without a verdict, and for a root on the axis, there is no number that meets the limit.
        value = part.rightmost.real
        yield Goal(f"rightmost root, {name} loop", value if part.stable or value > 0 else nan, 0.0)
    if not verdict.stable:
        return
    yield Goal("Ms", loop.margins().plant_loop.ms, case.max_ms)
    size = float(abs(loop.S_d(1j * case.omega)))
    yield Goal(f"|S_d| at {case.omega:g} rad/s", size, case.max_disturbance)
    yield Goal("settled after (s)", _settled(case, loop), case.settling)
    verdicts = [observer_stable(plant, loop.model, loop.filter) for plant in case.changed]
    unstable = sum(verdict is not True for verdict in verdicts)
    yield Goal(f"unstable with {len(verdicts)} changed plants", float(unstable), 0.0)
    yield Goal("noise in u (rms)", rms(loop.U_eta), case.max_noise)


def _bench_goals(case: Project, loop: NRDOB) -> list[Goal]:
    """Sample the loop, one sample for the computation; then load it for 1/pole seconds.

    Whatever controls the plant, a load of 1 that lasts so long takes an input of 1 - 1/e.
    """
    limit = 1.1 * case.max_ms  # a sample and a half of dead time has its price
    sampled = loop.sampled(case.dt, computation_delay=case.dt)
    if sampled.stability().stable is not True:
        return [Goal("sampled Ms", nan, limit)]
    time = case.dt * np.arange(1500)
    load = np.where(time < 1 / case.pole, 1.0, 0.0)
    limits = ActuatorLimits(-case.max_input, case.max_input)
    run = sampled.simulate({"delta": load}, limits=limits, timepts=time)
    left = float(np.abs(run.y[-1]) / np.abs(run.y).max())
    peak = sampled.margins().ms
    return [Goal("sampled Ms", peak, limit), Goal("left of y after the load", left, 0.05)]


def _settled(case: Project, loop: NRDOB) -> float:
    """Time after which y stays within 5 % of a step of R; infinite if it is too long."""
    horizon = 3 * case.settling if case.settling < inf else 25 / case.pole
    times = np.linspace(0, horizon, 1201)
    outside = np.abs(loop.step_response("R", times).outputs[0, 0] - 1) > 0.05
    last = int(np.flatnonzero(outside)[-1]) if outside.any() else -1
    return float(times[last + 1]) if last + 1 < times.size else inf


def mirrored_model(case: Project) -> ct.TransferFunction:
    """Give the plant with its pole in the left half plane."""
    return mirrored_pair(case.pole, case.decay, gain=case.gain)[1]


@kept
def controller_of(case: Project) -> ct.TransferFunction:
    """Give a PI controller for the mirrored model."""
    return design_controller(mirrored_model(case), bandwidth=case.pole, phase_margin=60)


def loop_of(case: Project, speed: float) -> NRDOB:
    """Make the loop with the mirrored model and λ = speed/pole."""
    filter = LowPassFilter(speed / case.pole, ORDER)
    return NRDOB(case.plant, mirrored_model(case), controller_of(case), filter)


SLOWEST = 1.18  # by how much a good λ may grow until slow disturbances are not held well enough


@kept
def _good(case: Project) -> float:
    """Find a good λ, times the pole: |S_d| is proportional to λ."""
    tried = 0.07
    size = float(abs(loop_of(case, tried).S_d(1j * case.omega)))
    return tried * case.max_disturbance / size / SLOWEST


def _table(goals: list[Goal]) -> str:
    rows = [f"{'':28}{'yours':>10}{'limit':>10}"]
    for goal in goals:
        word = "met" if goal.met else "not met"
        rows.append(f"{goal.name:28}{goal.value:10.4g}{goal.limit:10.4g}   {word}")
    return "\n".join(rows)


def rms(transfer: Quotient) -> float:
    """Root of the power of the output for white noise of unit density, the norm of order 2.

    >>> loop = NRDOB(ct.tf([1], [1, 1]), ct.tf([1], [1, 1]), 1.0, LowPassFilter(0.5, 2))
    >>> round(rms(loop.S_eta) ** 2, 6)                  # 1/(4λ)
    0.5
    """
    return inf if any(transfer.at_infinity) else sqrt(transfer.noise_power())


@dataclass(frozen=True, eq=False)
class QuietCase:
    """A plant, a plant that it may become, and a model: `case.plot()` draws Ms over λ for both."""

    plant: ct.TransferFunction
    modified: ct.TransferFunction  # what the plant may become
    model: ct.TransferFunction
    max_ms: float  # the red line

    def __repr__(self) -> str:
        return f"plant {factored(self.plant)}"

    def plot(self) -> Figure:
        """Draw Ms over λ, for the plant and for the modified one."""
        found, ends = _curves(self), ends_of_quiet(self)
        looks = (("plant", "process", "--"), ("modified plant", "loop", "-"))
        curves = []
        for which, (label, role, style) in enumerate(looks):
            tried, edge = found.tried(which), 1000 * found.edges[which]
            peaks = [found.peak(which, value) for value in tried]
            curves.append(Peaks(label, 1000 * tried, peaks, edge, role, style))
        alt = (
            f"Ms over λ: with the modified plant below {self.max_ms:g} for λ from "
            f"{1000 * ends['fast']:.3g} to {1000 * ends['slow']:.3g} ms, with the plant up to "
            f"{1000 * ends['nominal']:.3g} ms; unstable at {curves[1].edge:.3g} and "
            f"{curves[0].edge:.3g} ms"
        )
        return draw_peaks(curves, self.max_ms, 2.2 * self.max_ms, "time constant λ (ms)", alt)


class _Curves:
    """Ms over λ, for a plant (0) and a modified plant (1), with one model."""

    def __init__(self, plant: Any, modified: Any, model: Any) -> None:
        self.speed = float(np.abs(plant.poles()).min())  # of the unstable pole
        self.omega = self.speed * np.geomspace(1e-2, 1e3, 1500)
        s, plants = 1j * self.omega, (plant, modified)
        self.ratios = [each(s) / model(s) for each in plants]
        self.edges = [stabilizing_time_constants(each, model, ORDER)[-1][1] for each in plants]
        tried = self.tried(1)
        peaks = [self.peak(1, value) for value in tried]
        self.calmest, self.least = float(tried[int(np.argmin(peaks))]), min(peaks)

    def tried(self, which: int) -> FloatArray:
        """Time constants from fast to the edge, in seconds."""
        return np.linspace(0.01 / self.speed, 0.97 * self.edges[which], 120)

    def peak(self, which: int, time_constant: float) -> float:
        """Ms of the plant loop."""
        F, R = LowPassFilter(time_constant, ORDER)(1j * self.omega), self.ratios[which]
        return grid_peak(F, R)


_curves_of = kept(_Curves)


def _curves(case: QuietCase) -> _Curves:
    return _curves_of(case.plant, case.modified, case.model)


@kept
def ends_of_quiet(case: QuietCase) -> dict[str, float]:
    """Find where the curves meet the red line: λ in seconds."""
    found = _curves(case)

    def meeting(which: int, low: float, high: float) -> float:
        return float(brentq(lambda value: found.peak(which, value) - case.max_ms, low, high))

    return {
        "slow": meeting(1, found.calmest, 0.99 * found.edges[1]),
        "fast": meeting(1, 1e-3 / found.speed, found.calmest),
        "nominal": meeting(0, found.calmest, 0.99 * found.edges[0]),
    }


@kept
def _quiet_case(project: Project) -> QuietCase:
    """Draw the red line a little above the least Ms with the modified plant."""
    model = mirrored_model(project)
    least = _curves_of(project.plant, project.modified, model).least
    return QuietCase(project.plant, project.modified, model, round(1.15 * least, 1))


GAINS = (0.7, 1.0, 1.5)


def _telling(case: Project) -> bool:
    """Whether every reading of the figure and every stage of the design is told apart."""
    quiet = _quiet_case(case)
    return apart(*ends_of_quiet(quiet).values(), *_curves(quiet).edges, by=0.2)


@fitting(_telling)
def _project(rng: np.random.Generator) -> Project:
    pole = draw(rng, 0.8, 20)
    gain = either_sign(rng) * draw(rng, 0.5, 5)
    decay = few(pole * rng.uniform(1.2, 2))
    plant = mirrored_pair(pole, decay, gain=gain)[0]
    lag = few(rng.uniform(0.045, 0.055) / pole)
    less, faster = few(rng.uniform(0.8, 0.9)), few(pole * rng.uniform(1.1, 1.15), 3)
    den = np.polymul(np.polymul([1, -faster], [1, decay]), [lag, 1])
    modified = less * gain * pole * decay * ct.tf([1], den)
    dead_time = few(rng.uniform(0.045, 0.055) / pole)
    free = Project(plant, gain, pole, decay, modified, GAINS, dead_time, omega=few(0.1 * pole))
    # A good λ, times the pole; up to a fifth more or a seventh less will do.
    good = rng.uniform(0.06, 0.08)
    slow = loop_of(free, SLOWEST * good)
    return replace(
        free,
        max_ms=few(loop_of(free, 1.4 * good).margins().plant_loop.ms, 3),
        max_disturbance=few(float(abs(slow.S_d(1j * free.omega)))),
        settling=few(1.4 * _settled(free, loop_of(free, good))),
        max_noise=few(rms(loop_of(free, 0.86 * good).U_eta)),
    )


# --- 6.2 The quietest filter --------------------------------------------------------------------


def _quiet(case: QuietCase, value: float) -> str:
    for name, plant in (("plant", case.plant), ("modified plant", case.modified)):
        if observer_stable(plant, case.model, LowPassFilter(value, ORDER)) is not True:
            return f"the loop with the {name} is unstable there"
    if near(ends_of_quiet(case)["slow"], value, READING):
        return ""
    peak = _curves(case).peak(1, value)
    if peak > case.max_ms:
        return f"with the modified plant Ms is {peak:.3g} there"
    return "Ms is within the limit, but a slower and quieter filter keeps to it, too"


QUIETEST = pose(
    "6.2",
    alike=partial(near, tolerance=READING),
    case=lambda rng: _quiet_case(_project(rng)),
    reads=number,
    lacks=_quiet,
    own=True,
    drawn_as="6",
    misconceptions={
        "fast end read": reading(ends_of_quiet, "fast"),
        "modified plant left out": reading(ends_of_quiet, "nominal"),
        "edge taken for the specification": any_of(lambda case: _curves(case).edges[::-1]),
        "milliseconds for seconds": lambda case: 1000 * ends_of_quiet(case)["slow"],
    },
)


# --- 6.4 Find the error: one modified plant -----------------------------------------------------


@dataclass(frozen=True, eq=False)
class SurvivalCase:
    """A loop that is stable with its plant and with a modified one."""

    loop: NRDOB  # with the nominal plant
    gain: float  # of the modified plant, as a factor below 1
    lag: float  # of the modified plant, 1/(lag s + 1), in seconds

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
    less, lag = round(rng.uniform(0.4, 0.6), 2), few(rng.uniform(0.08, 0.12) / pole)
    return SurvivalCase(NRDOB(plant, model, controller, filter), less, lag)


def _unstable_inside(case: SurvivalCase, at: FloatArray) -> str:
    if not _inside(case, *at):
        return "this plant is changed by more than the modified one"
    return "" if survives(case, *at) is False else "the loop is stable with this plant"


ONE_PLANT = pose(
    "6.4",
    alike=partial(same, rtol=1e-3),
    case=_survival_case,
    reads=partial(numbers, names="gain, lag"),
    lacks=_unstable_inside,
    misconceptions={
        "the modified plant itself": lambda case: (case.gain, case.lag),
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
    """Three filters to be tried on several plants."""

    model: ct.TransferFunction
    controller: ct.TransferFunction
    plants: list[ct.TransferFunction]  # the first is the plant as it is
    filters: list[LowPassFilter]

    def __repr__(self) -> str:
        times = ", ".join(f"{filter.time_constant:g}" for filter in self.filters)
        return (
            f"{len(self.plants)} plants like {factored(self.plants[0])}, n = "
            f"{self.filters[0].order}, λ = {times} s"
        )


def _bench(case: BenchCase) -> list[list[NRDOB]]:
    blocks = case.model, case.controller
    return [[NRDOB(plant, *blocks, filter) for plant in case.plants] for filter in case.filters]


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
    s = 1j * np.geomspace(1e-2, 1e3, 1500) * float(np.abs(case.model.poles()).min())
    return [1 / min(float(np.abs(1 + loop.L(s)).min()) for loop in row) for row in _bench(case)]


def _bench_tells(case: BenchCase) -> bool:
    """Whether some filter fails and some does not, and each mistake gives other numbers."""
    worst = _worst(case)
    finite = [k for k, value in enumerate(worst) if value < inf]
    others = (_largest(_peaks(case, "observer_loop")), [peaks[0] for peaks in _peaks(case)])
    return (
        0 < len(finite) < len(worst)
        and all(any(abs(other[k] / worst[k] - 1) > 0.05 for k in finite) for other in others)
        and all(peaks[0] < inf for peaks in _peaks(case))
    )


@fitting(_bench_tells)
def _bench_case(rng: np.random.Generator) -> BenchCase:
    pole = draw(rng, 0.5, 10)
    gain = either_sign(rng) * draw(rng, 0.5, 5)
    plant, model = mirrored_pair(pole, few(pole * rng.uniform(1.5, 2.5)), gain=gain)
    lags = [ct.tf([1], [few(share / pole), 1]) for share in rng.uniform(0.06, 0.11, 2)]
    weak, strong = (round(rng.uniform(*ends), 2) for ends in ((0.5, 0.8), (1.3, 1.8)))
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


# --- 6.6 The design -----------------------------------------------------------------------------

STAGES = ("model", "observer", "Ms", "disturbance", "settling", "changed", "noise")
"""In the order in which they are looked at; each is worth a point of seven."""


def _passes(case: Project, got: Any) -> str:
    goals = case.goals(*got)
    for stage, goal in zip(STAGES, goals, strict=True):
        if not goal.value <= goal.limit * LEEWAY:
            # Where the observer loop is stable nonetheless, it is the controller.
            kind = "controller" if stage == "model" and goals[1].met else stage
            return Lack(kind, f"\n{_table(goals)}")
    return ""


Blocks = tuple[Any, Any, Any]


def _of(loop: NRDOB, **changed: Any) -> Blocks:
    loop = replace(loop, **changed)
    return loop.model, loop.controller, loop.filter


def _with_good(times: float) -> Callable[[Project], Blocks]:
    return lambda case: _of(loop_of(case, times * _good(case)))


DESIGN = pose(
    "6.6",
    case=_project,
    reads=partial(
        things, wanted="three blocks are asked for: (model, controller, filter)", counts=(3,)
    ),
    lacks=_passes,
    own=True,
    drawn_as="6",
    misconceptions={
        "matched model": Misconception(
            lambda case: _of(loop_of(case, 0.07), model=case.plant),
            lambda case, got: np.abs(got[0].poles() - case.pole).min() < 1e-2 * case.pole,
        ),
        "sign of the model": Misconception(
            lambda case: _of(
                loop_of(case, 0.07), model=-mirrored_model(case), controller=-controller_of(case)
            ),
            lambda case, got: right_half_plane_parity(case.plant, got[0]).holds is False,
        ),
        "filter too slow for the plant": lacking("observer", lambda case: _of(loop_of(case, 1.0))),
        "controller for the plant, not for the model": lacking(
            "controller",
            lambda case: _of(loop_of(case, _good(case)), controller=-controller_of(case)),
        ),
        "Ms above its limit": lacking("Ms", _with_good(1.7)),
        "disturbances not held": lacking("disturbance", _with_good(1.3)),
        "reference too slow": lacking(
            "settling",
            lambda case: _of(
                loop_of(case, _good(case)),
                controller=design_controller(mirrored_model(case), bandwidth=0.2 * case.pole),
            ),
        ),
        "unstable with a changed plant": lacking("changed", lambda case: _of(loop_of(case, 0.01))),
        "too much noise in u": lacking("noise", _with_good(0.7)),
    },
)
