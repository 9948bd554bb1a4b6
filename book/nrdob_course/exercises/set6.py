"""Set 6: a design project, from specification to a verified loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isinf, isnan, log10, nan, sqrt
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

from nrdob.analysis import LoopMargins
from nrdob.design import (
    Mismatch,
    design_controller,
    right_half_plane_parity,
    stabilizing_time_constants,
)
from nrdob.diagram import LowPassFilter, Quotient, delay
from nrdob.loop import NRDOB
from nrdob.numerics import FloatArray
from nrdob.plants import lags
from nrdob.plotting import COLOURS, INK, TALL, Figure, axes_for, styled

from .cases import (
    apart,
    draw,
    either_sign,
    factored,
    few,
    first_fitting,
    grid_peak,
    kept,
    observer_stable,
)
from .problems import (
    Case,
    Lack,
    Misconception,
    Problem,
    answers_like,
    answers_like_any,
    lacking,
    near,
    read_as,
    same,
)
from .reading import number, numbers, things

__all__ = ["PROBLEMS", "STAGES", "Project", "rms"]


# --- 6.1 Equal rejection ------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RejectionCase:
    """A loop for an unstable plant, and another model and order for the same plant.

    Attributes
    ----------
    plant, model : control.TransferFunction
    filter : LowPassFilter
        The filter that goes with `model`.
    other : control.TransferFunction
        Another model.
    order : int
        Order of the filter that is to go with it.
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


def _rejection_case(rng: np.random.Generator) -> RejectionCase:
    def drawn() -> RejectionCase:
        pole = draw(rng, 0.5, 10)
        gain = draw(rng, 0.5, 5)
        plant, mirrored = _mirrored_pair(pole, few(pole * rng.uniform(1.5, 3)), gain=gain)
        first, second = rng.permutation([2, 3]).tolist()
        factor, other = rng.permutation([1.0, float(rng.choice([0.4, 0.5, 0.6]))]).tolist()
        filter = LowPassFilter(draw(rng, 0.02 / pole, 0.05 / pole), int(first))
        return RejectionCase(plant, factor * mirrored, filter, other * mirrored, int(second))

    def fits(case: RejectionCase) -> bool:
        value = _equal(case)
        return bool(
            observer_stable(case.plant, case.model, case.filter)
            and observer_stable(case.plant, case.other, LowPassFilter(value, case.order))
            # Each way to go wrong leads elsewhere.
            and apart(value, *(of(case) for of in _WRONG_REJECTION), by=0.05)
        )

    return first_fitting(drawn, fits)


_WRONG_REJECTION: tuple[Callable[[RejectionCase], float], ...] = (
    lambda case: case.filter.time_constant,
    lambda case: case.filter.time_constant * case.filter.order / case.order,
    lambda case: case.filter.time_constant * _gains(case),
    lambda case: case.filter.time_constant * case.filter.order / case.order / _gains(case),
)


def _rejects_equally(case: RejectionCase, got: float) -> str:
    loop = NRDOB(case.plant, case.other, 0.0, LowPassFilter(got, case.order))
    if loop.stability().observer_loop.stable is not True:
        return "with this λ the loop is not stable"
    first = NRDOB(case.plant, case.model, 0.0, case.filter)
    # Far below every corner |S_d| is a straight line.
    omega = 1e-5 / max(got, case.filter.time_constant)
    size, wanted = (float(abs(of.S_d(1j * omega))) for of in (loop, first))
    if abs(size / wanted - 1) < 6e-3:  # three digits
        return ""
    return f"at low frequency |S_d| is {size / wanted:.3g} times what it was"


EQUAL_REJECTION = Problem(
    id="6.1",
    title="Equal rejection",
    case=_rejection_case,
    reads=number,
    lacks=_rejects_equally,
    praise=(
        "Right: at low frequency |S_d| is nλω/|R(0)|, so a model of half the gain takes twice the "
        "λ for the same rejection. Only at equal rejection can designs be compared."
    ),
    misconceptions=(
        answers_like(
            "same λ",
            "You kept λ. But the disturbance meets nλ/|R(0)|, R = G/Gm: the order and the gain of "
            "the model both count.",
            _WRONG_REJECTION[0],
        ),
        answers_like(
            "gain of the model forgotten",
            "You kept nλ. That is right for models of equal gain. A smaller model makes the "
            "feedback F/((1 - F) Gm) stronger, and the rejection with it.",
            _WRONG_REJECTION[1],
            marks=0.5,
        ),
        answers_like(
            "order forgotten",
            "The gain is taken into account, the order is not: F is late by nλ, not by λ.",
            _WRONG_REJECTION[2],
            marks=0.5,
        ),
        answers_like(
            "gain upside down",
            "The gain went the wrong way. A smaller model makes |R(0)| larger and |S_d| = "
            "nλω/|R(0)| smaller, so it can afford a larger λ, not a smaller one.",
            _WRONG_REJECTION[3],
            marks=0.5,
        ),
    ),
)


# --- The plant of the project: 6.2 and 6.6 ------------------------------------------------------

ORDER = 3
"""Relative degree of the model and one more, so that noise reaches u with a finite power."""


@dataclass(frozen=True)
class Goal:
    """One line of the specification.

    Attributes
    ----------
    name : str
    value, limit : float
        What the design makes of it, and what it may be at most.
    """

    name: str
    value: float
    limit: float

    @property
    def met(self) -> bool:
        """Whether the value is within the limit, printed to two or three digits."""
        return self.value <= self.limit * (1 + 1e-3)


@dataclass(frozen=True, eq=False)
class Project:
    """A plant with an unstable pole, and what is asked of its loop.

    Attributes
    ----------
    plant : control.TransferFunction
        gain · pole · decay/((s - pole)(s + decay)).
    gain, pole, decay : float
        Its numbers; pole and decay in rad/s.
    modified : control.TransferFunction
        The plant with a lag that was neglected, another pole and another gain.
    gains : tuple of float
        By which the plant's gain may be multiplied,
    dead_time : float
        and a dead time in seconds that may be added to each of them.
    max_ms : float
        Limit for Ms.
    omega, max_disturbance : float
        A frequency in rad/s, and the limit for |S_d| there.
    settling : float
        After this time, in seconds, y stays within 5 % of a step of R.
    max_noise : float
        Limit for the rms value of u, if white noise of unit density is at the sensor.
    """

    plant: ct.TransferFunction
    gain: float
    pole: float
    decay: float
    modified: ct.TransferFunction
    gains: tuple[float, ...]
    dead_time: float
    max_ms: float = inf
    omega: float = nan
    max_disturbance: float = inf
    settling: float = inf
    max_noise: float = inf

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


def _goals(case: Project, loop: NRDOB) -> Iterator[Goal]:
    verdict = loop.stability()
    for name, part in (("model", verdict.model_loop), ("observer", verdict.observer_loop)):
        # A root on the right, or no verdict: then there is no number to be signed.
        value = part.rightmost.real if part.stable is not None else nan
        yield Goal(f"rightmost root, {name} loop", value, 0.0)
    if not verdict.stable:
        return
    yield Goal("Ms", loop.margins().plant_loop.ms, case.max_ms)
    size = float(abs(loop.S_d(1j * case.omega)))
    yield Goal(f"|S_d| at {case.omega:g} rad/s", size, case.max_disturbance)
    yield Goal("settled after (s)", _settled(case, loop), case.settling)
    verdicts = [observer_stable(plant, loop.model, loop.filter) for plant in case.changed]
    lost = sum(verdict is not True for verdict in verdicts)
    yield Goal(f"lost of {len(verdicts)} changed plants", float(lost), 0.0)
    yield Goal("noise in u (rms)", rms(loop.U_eta), case.max_noise)


def _settled(case: Project, loop: NRDOB) -> float:
    """Time after which y stays within 5 % of a step of R; infinite if it is too long."""
    horizon = 3 * case.settling if case.settling < inf else 25 / case.pole
    times = np.linspace(0, horizon, 1201)
    outside = np.abs(loop.step_response("R", times).outputs[0, 0] - 1) > 0.05
    last = int(np.flatnonzero(outside)[-1]) if outside.any() else -1
    return float(times[last + 1]) if last + 1 < times.size else inf


def mirrored_model(case: Project) -> ct.TransferFunction:
    """Give the plant with its pole on the left."""
    return _mirrored_pair(case.pole, case.decay, gain=case.gain)[1]


@kept
def controller_of(case: Project) -> ct.TransferFunction:
    """Give a PI controller for the mirrored model."""
    return design_controller(mirrored_model(case), bandwidth=case.pole, phase_margin=60)


def loop_of(case: Project, speed: float, order: int = ORDER) -> NRDOB:
    """Make the loop with the mirrored model and λ = speed/pole."""
    filter = LowPassFilter(speed / case.pole, order)
    return NRDOB(case.plant, mirrored_model(case), controller_of(case), filter)


SLOWEST = 1.18
"""By how much a good λ may grow until slow disturbances are not held well enough."""


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

    Examples
    --------
    >>> loop = NRDOB(ct.tf([1], [1, 1]), ct.tf([1], [1, 1]), 1.0, LowPassFilter(0.5, 2))
    >>> round(rms(loop.S_eta) ** 2, 6)                  # 1/(4λ)
    0.5
    """
    return inf if any(transfer.at_infinity) else sqrt(transfer.noise_power())


@dataclass(frozen=True, eq=False)
class QuietCase:
    """A plant, a plant that it may become, and a model: `case.plot()` draws Ms over λ for both.

    Attributes
    ----------
    plant, modified, model : control.TransferFunction
    max_ms : float
        The red line.
    """

    plant: ct.TransferFunction
    modified: ct.TransferFunction
    model: ct.TransferFunction
    max_ms: float

    def __repr__(self) -> str:
        return f"plant {factored(self.plant)}"

    def plot(self) -> Figure:
        """Draw Ms over λ, for the plant and for the modified one."""
        found = _curves(self)
        with styled():
            (ax,) = axes_for(None, 1, TALL)
            for which, (label, style, role) in enumerate(
                (("plant", "--", "process"), ("modified plant", "-", "loop"))
            ):
                tried = found.tried(which)
                peaks = [found.peak(which, value) for value in tried]
                lines = ax.plot(1000 * tried, peaks, style, color=COLOURS[role], label=label)
                edge = 1000 * found.edges[which]
                ax.axvline(edge, color=COLOURS[role], ls=":", lw=1.5)
                short = label.split()[0]
                ax.text(edge, 1.1, f"{short}: lost ", color=COLOURS[role], rotation=90, ha="right")
            ax.axhline(self.max_ms, color=COLOURS["critical"], lw=1)
            ax.minorticks_on()
            ax.grid(True, which="minor", color=INK, alpha=0.12, lw=0.5)
            ax.set(xlabel="time constant λ (ms)", ylabel="$M_s$", ylim=(1, 2.2 * self.max_ms))
            ax.set_xlim(0, 1050 * found.edges[0])
            ax.legend(loc="upper left")
        ends = ends_of_quiet(self)
        alt = (
            f"Ms over λ: with the modified plant below {self.max_ms:g} for λ from "
            f"{1000 * ends['fast']:.3g} to {1000 * ends['slow']:.3g} ms, with the plant up to "
            f"{1000 * ends['nominal']:.3g} ms; lost at {1000 * found.edges[1]:.3g} and "
            f"{1000 * found.edges[0]:.3g} ms"
        )
        return Figure(lines, ax, alt=alt)


class _Curves:
    """Ms over λ, for a plant (0) and a modified plant (1), with one model."""

    def __init__(self, plant: Any, modified: Any, model: Any) -> None:
        self.speed = float(np.abs(plant.poles()).min())  # of the unstable pole
        self.omega = self.speed * np.geomspace(1e-2, 1e3, 1500)
        plants = (plant, modified)
        self.ratios = [Mismatch.of(each, model, ORDER).ratio(self.omega) for each in plants]
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


@kept
def _curves(case: QuietCase) -> _Curves:
    return _Curves(case.plant, case.modified, case.model)


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


def _quiet_case(project: Project) -> QuietCase:
    """Draw the red line a little above the least Ms with the modified plant."""
    model = mirrored_model(project)
    least = _Curves(project.plant, project.modified, model).least
    return QuietCase(project.plant, project.modified, model, round(1.15 * least, 1))


GAINS = (0.7, 1.0, 1.5)


def _project(rng: np.random.Generator) -> Project:
    def drawn() -> Project:
        pole = draw(rng, 0.8, 20)
        gain = either_sign(rng) * draw(rng, 0.5, 5)
        decay = few(pole * rng.uniform(1.2, 2))
        plant = _mirrored_pair(pole, decay, gain=gain)[0]
        lag = few(rng.uniform(0.045, 0.055) / pole)
        less, faster = few(rng.uniform(0.8, 0.9)), few(pole * rng.uniform(1.1, 1.15), 3)
        modified = (
            less
            * gain
            * pole
            * decay
            * ct.tf([1], np.polymul(np.polymul([1, -faster], [1, decay]), [lag, 1]))
        )
        dead_time = few(rng.uniform(0.045, 0.055) / pole)
        free = Project(plant, gain, pole, decay, modified, GAINS, dead_time, omega=few(0.1 * pole))
        # A good λ, times the pole; up to a fifth more or a seventh less will do.
        good = float(rng.uniform(0.06, 0.08))
        slow = loop_of(free, SLOWEST * good)
        return replace(
            free,
            max_ms=few(loop_of(free, 1.4 * good).margins().plant_loop.ms, 3),
            max_disturbance=few(float(abs(slow.S_d(1j * free.omega)))),
            settling=few(1.4 * _settled(free, loop_of(free, good))),
            max_noise=few(rms(loop_of(free, 0.86 * good).U_eta)),
        )

    return first_fitting(drawn, _telling)


def _telling(case: Project) -> bool:
    """Whether every reading of the figure and every stage of the design is told apart."""
    quiet = _quiet_case(case)
    return apart(*ends_of_quiet(quiet).values(), *_curves(quiet).edges, by=0.2)


@dataclass(frozen=True)
class _Part(Problem):
    """A part of the project, which is about one plant of the group."""

    def drawn(self, seed: Any, count: int) -> list[Case]:
        """Draw the same cases for every part."""
        return Problem.drawn(replace(self, id="6"), seed, count)


# --- 6.2 The quietest filter --------------------------------------------------------------------

READING = 0.08
"""How far a number that is read off a figure may be from the true one."""


def _quiet(case: QuietCase, value: float) -> str:
    for name, plant in (("plant", case.plant), ("modified plant", case.modified)):
        if observer_stable(plant, case.model, LowPassFilter(value, ORDER)) is not True:
            return f"the loop with the {name} is lost there"
    if near(ends_of_quiet(case)["slow"], value, READING):
        return ""
    peak = _curves(case).peak(1, value)
    if peak > case.max_ms:
        return f"with the modified plant Ms is {peak:.3g} there"
    return "Ms is within the limit, but a slower and quieter filter keeps to it, too"


_misread = partial(answers_like_any, close=partial(near, tolerance=READING))


QUIETEST = _Part(
    id="6.2",
    title="The quietest filter",
    case=lambda rng: _quiet_case(_project(rng)),
    reads=number,
    lacks=_quiet,
    praise=(
        "Right: an unstable plant gives an interval of filters, and its slow end is the quiet one. "
        "The modified plant decides where it ends."
    ),
    misconceptions=(
        _misread(
            "fast end read",
            "This is the fast end of the interval. It is the best against disturbances; but the "
            "faster the filter, the more of the sensor's noise reaches the actuator.",
            lambda case: [ends_of_quiet(case)["fast"]],
            marks=0.25,
        ),
        _misread(
            "modified plant left out",
            "You have read the curve of the plant as it is. With the modified plant Ms is above "
            "the line there: a filter must be good for both.",
            lambda case: [ends_of_quiet(case)["nominal"]],
            marks=0.25,
        ),
        _misread(
            "edge taken for the specification",
            "You have read a dotted line, where the loop is lost. Asked for is where the curve "
            "meets the red line.",
            lambda case: _curves(case).edges[::-1],
        ),
        _misread(
            "milliseconds for seconds",
            "The axis of the figure is in milliseconds; the answer is to be in seconds.",
            lambda case: [1000 * ends_of_quiet(case)["slow"]],
            marks=0.5,
        ),
    ),
    own=True,
)


# --- 6.4 Find the error: one modified plant -----------------------------------------------------


@dataclass(frozen=True, eq=False)
class SurvivalCase:
    """A loop that is stable with its plant and with a modified one.

    Attributes
    ----------
    loop : NRDOB
        The loop with the nominal plant.
    gain : float
        The modified plant has this gain, as a factor below 1,
    lag : float
        and this lag 1/(lag s + 1) besides, in seconds.
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


def _survival_case(rng: np.random.Generator) -> SurvivalCase:
    def drawn() -> SurvivalCase:
        pole = draw(rng, 0.5, 10)
        gain = either_sign(rng) * draw(rng, 0.5, 5)
        plant, mirrored = _mirrored_pair(pole, few(pole * rng.uniform(1.5, 2.5)), gain=gain)
        model = float(rng.choice([0.2, 0.25, 0.3])) * mirrored
        filter = LowPassFilter(few(rng.uniform(0.04, 0.06) / pole), 2)
        controller = design_controller(model, bandwidth=pole, phase_margin=60)
        loop = NRDOB(plant, model, controller, filter)
        less, lag = round(float(rng.uniform(0.4, 0.6)), 2), few(rng.uniform(0.08, 0.12) / pole)
        return SurvivalCase(loop, less, lag)

    def fits(case: SurvivalCase) -> bool:
        good = ((1, 0), (case.gain, case.lag), (case.gain, 0), _half(case))
        return survives(case, 1, case.lag) is False and all(
            survives(case, *at) is True for at in good
        )

    return first_fitting(drawn, fits)


def _half(case: SurvivalCase) -> tuple[float, float]:
    return (1 + case.gain) / 2, case.lag / 4


def _lost_inside(case: SurvivalCase, at: FloatArray) -> str:
    if not _inside(case, *at):
        return "this plant is changed by more than the modified one"
    return "" if survives(case, *at) is False else "the loop is stable with this plant"


ONE_PLANT = Problem(
    id="6.4",
    title="Find the error: one modified plant",
    case=_survival_case,
    reads=partial(numbers, names="gain, lag"),
    lacks=_lost_inside,
    praise=(
        "Right: a change that is smaller in every respect loses the loop. The modified plant "
        "survived because its lower gain made up for the lag; one plant proves nothing about its "
        "neighbours."
    ),
    misconceptions=(
        answers_like(
            "the modified plant itself",
            "That is the plant that was tried, and the loop is stable with it. Change less: which "
            "of its two changes hurts, and which one helps?",
            lambda case: (case.gain, case.lag),
            close=partial(same, rtol=1e-3),
        ),
        Misconception(
            "the harmless change alone",
            "Here only the gain has changed, and the loop bears it. What does a lag do to L near "
            "its upper crossover, and where does a lower gain put that crossover?",
            lambda case: (case.gain, 0.0),
            lambda case, got: (
                _inside(case, *got) and got[0] < 1 and got[1] == 0 and survives(case, *got) is True
            ),
        ),
        Misconception(
            "stable inside",
            "Within the range that was tried, but the loop is stable there. Follow the rightmost "
            "root from the modified plant while you take back one change, then the other.",
            _half,
            lambda case, got: _inside(case, *got) and survives(case, *got) is True,
        ),
        Misconception(
            "beyond what was tried",
            "The loop is lost with this plant, but it is changed by more than the modified one, so "
            "nobody had promised anything. Stay between the two plants: gain between case.gain and "
            "1, lag between 0 and case.lag.",
            lambda case: (1.0, 2 * case.lag),
            lambda case, got: (
                not _inside(case, *got)
                and min(got) > 0
                and not _inside(case, *got[::-1])
                and survives(case, *got) is False
            ),
            marks=0.25,
        ),
        Misconception(
            "lag and gain exchanged",
            "The right plant, but the two numbers have changed places: first the gain, then the "
            "lag in seconds.",
            lambda case: (case.lag, 1.0),
            lambda case, got: not _inside(case, *got) and not _lost_inside(case, got[::-1]),
            marks=0.5,
        ),
    ),
)


# --- 6.5 The test bench -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class BenchCase:
    """Three filters to be tried on several plants.

    Attributes
    ----------
    model, controller : control.TransferFunction
    plants : list of control.TransferFunction
        The first is the plant as it is.
    filters : list of LowPassFilter
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
    """Give the largest Ms for each filter, infinite where a plant is lost."""
    return [
        max(found.plant_loop.ms for found in row) if all(found.stable for found in row) else inf
        for row in _margins(case)
    ]


def _unjudged(case: BenchCase) -> list[float]:
    """Give the largest |1/(1 + L)| on a grid, stable or not."""
    omega = np.geomspace(1e-2, 1e3, 1500) * float(np.abs(case.model.poles()).min())
    return [
        max(float((1 / np.abs(1 + loop.L(1j * omega))).max()) for loop in row)
        for row in _bench(case)
    ]


def _bench_case(rng: np.random.Generator) -> BenchCase:
    def drawn() -> BenchCase:
        pole = draw(rng, 0.5, 10)
        gain = either_sign(rng) * draw(rng, 0.5, 5)
        plant, model = _mirrored_pair(pole, few(pole * rng.uniform(1.5, 2.5)), gain=gain)
        lags = [ct.tf([1], [few(share / pole), 1]) for share in rng.uniform(0.06, 0.11, 2)]
        weak, strong = (round(float(rng.uniform(*ends)), 2) for ends in ((0.5, 0.8), (1.3, 1.8)))
        plants = [plant, weak * plant * lags[0], strong * plant * lags[1]]
        values = [few(share / pole) for share in (0.05, 0.08, 0.16)]
        filters = [LowPassFilter(value, 3) for value in rng.permutation(values).tolist()]
        controller = design_controller(model, bandwidth=pole, phase_margin=60)
        return BenchCase(model, controller, plants, filters)

    def fits(case: BenchCase) -> bool:
        worst = _worst(case)
        if not 0 < sum(map(isinf, worst)) < len(worst):
            return False
        finite = [k for k, value in enumerate(worst) if value < inf]
        others = (
            _largest(_peaks(case, "observer_loop")),
            [peaks[0] for peaks in _peaks(case)],
        )
        return all(
            any(abs(other[k] / worst[k] - 1) > 0.05 for k in finite) for other in others
        ) and all(peaks[0] < inf for peaks in _peaks(case))

    return first_fitting(drawn, fits)


def _largest(peaks: list[list[float]], lost: float = inf) -> list[float]:
    return [lost if any(map(isnan, row)) else max(row) for row in peaks]


def _like(expected: list[float], got: FloatArray) -> bool:
    return got.size == len(expected) and bool(np.allclose(got, expected, rtol=0.01, equal_nan=True))


def _by_filter(case: BenchCase, got: FloatArray) -> dict[str, bool]:
    """Tell for which filters the number is right."""
    return {
        f"filter {k}": _like([true], np.array([value]))
        for k, (true, value) in enumerate(zip(_worst(case), got, strict=True), start=1)
    }


def _benched(case: BenchCase, got: FloatArray) -> str:
    if got.size != len(case.filters):
        return f"{got.size} numbers for {len(case.filters)} filters"
    each = zip(_by_filter(case, got).items(), _worst(case), got, strict=True)
    for (filter, right), true, value in each:
        if right:
            continue
        if isinf(true):
            return f"for {filter} a plant is lost"
        if isinf(value):
            return f"for {filter} no plant is lost"
        return f"for {filter} it is {'larger' if value < true else 'smaller'} than {value:.4g}"
    return ""


_bench_like = partial(answers_like, close=_like)


BENCH = Problem(
    id="6.5",
    title="The test bench",
    case=_bench_case,
    reads=partial(numbers, gaps=True),
    lacks=_benched,
    parts=_by_filter,
    praise=(
        "Right: the worst plant counts, a lost plant counts as infinitely bad, and Ms is that of "
        "the loop which the plant feels. This bench will serve you below."
    ),
    misconceptions=(
        Misconception(
            "nan reported",
            "There is a nan, or no number at all, where a plant is lost. An unstable loop has no "
            "margins, so its Ms is nan, and what max makes of nan depends on where it stands. Ask "
            "for the verdict first, and report inf where a plant is lost.",
            lambda case: _largest(_peaks(case), nan),
            lambda case, got: (
                got.size == len(case.filters)
                and bool(np.isnan(got).any())
                and not _benched(case, np.where(np.isnan(got), inf, got))
            ),
            marks=0.5,
        ),
        read_as(
            "decibels",
            "Right, in decibels. Ms is asked for as a plain factor: 10^(dB/20).",
            lambda case: [20 * log10(value) for value in _worst(case)],
            lambda got: 10 ** (got / 20),
            _benched,
            0.75,
        ),
        _bench_like(
            "lost plants left out",
            "This is the largest Ms over those plants with which the loop is stable. (Python's max "
            "passes over a nan that is not the first.) A plant that is lost is the worst of all: "
            "ask for the verdict, and report inf.",
            lambda case: [float(np.nanmax(row)) for row in _peaks(case)],
            marks=0.25,
        ),
        _bench_like(
            "peak without a verdict",
            "You have computed the peak of |1/(1 + L)|, and it is finite for unstable loops, too. "
            "A distance from -1 means nothing on the wrong side of it: ask for stability first.",
            lambda case: _unjudged(case),
            marks=0.25,
        ),
        _bench_like(
            "margins of FH",
            "These are the Ms of FH. What the plant feels is L = KG: take plant_loop.",
            lambda case: _largest(_peaks(case, "observer_loop")),
            marks=0.25,
        ),
        _bench_like(
            "plant as it is",
            "These are the numbers for the first plant, the one that you hope for. Go through all "
            "of case.plants and keep the largest.",
            lambda case: [row[0] for row in _peaks(case)],
            marks=0.25,
        ),
    ),
)


# --- 6.6 The design -----------------------------------------------------------------------------

STAGES = ("model", "observer", "Ms", "disturbance", "settling", "changed", "noise")
"""In the order in which they are looked at; each is worth a point of seven."""


WITHIN = 1 + 6e-3
"""By what factor a limit may be exceeded: that is three digits of λ."""


def _three_blocks(given: Any) -> tuple[Any, Any, Any]:
    wanted = "three blocks are asked for: (model, controller, filter)"
    model, controller, filter = things(given, wanted, (3,))
    return model, controller, filter


def _passes(case: Project, got: Any) -> str:
    goals = case.goals(*got)
    missed = [
        stage
        for stage, goal in zip(STAGES, goals, strict=False)
        if not goal.value <= goal.limit * WITHIN
    ]
    if not missed:
        return ""
    # Where the observer loop is stable nonetheless, it is the controller.
    kind = "controller" if missed[0] == "model" and goals[1].met else missed[0]
    return Lack(kind, f"\n{_table(goals)}")


def _of(loop: NRDOB, **changes: Any) -> tuple[Any, Any, Any]:
    blocks = {"model": loop.model, "controller": loop.controller, "filter": loop.filter} | changes
    return blocks["model"], blocks["controller"], blocks["filter"]


def _is_matched(case: Project, got: Any) -> bool:
    poles = got[0].poles()
    return bool(np.abs(poles - case.pole).min() < 1e-2 * case.pole)


DESIGN = _Part(
    id="6.6",
    title="The design",
    case=_project,
    reads=_three_blocks,
    lacks=_passes,
    praise=(
        "Specification met, verified in two ways, and every changed plant survived. Now you may "
        "sign it."
    ),
    misconceptions=(
        Misconception(
            "matched model",
            "Your model has the plant's unstable pole, or nearly so. Then p_B keeps a root on the "
            "right at that place, for every filter 1/(λs + 1)^n: what cancels stays. Mirror the "
            "pole.",
            lambda case: (
                case.plant,
                controller_of(case),
                LowPassFilter(0.07 / case.pole, ORDER),
            ),
            _is_matched,
        ),
        Misconception(
            "sign of the model",
            "With this model p_B has an odd number of roots on the right for all λ and n: parity. "
            "The plant has one unstable pole, so the model's DC gain must have the opposite sign.",
            lambda case: (
                -mirrored_model(case),
                -controller_of(case),
                LowPassFilter(0.07 / case.pole, ORDER),
            ),
            lambda case, got: right_half_plane_parity(case.plant, got[0]).holds is False,
        ),
        lacking(
            "observer",
            "filter too slow for the plant",
            "The signs are right, but with this filter p_B is unstable. An unstable plant is lost "
            "where the feedback is too weak: in general λ is then too large for this model. Look "
            "at stabilizing_time_constants, for your model and your order.",
            lambda case: _of(loop_of(case, 1.0)),
            marks=1 / 7,
        ),
        lacking(
            "controller",
            "controller for the plant, not for the model",
            "The observer holds the plant, but C does not stabilise the model: condition (i) "
            "fails. C sees the model only. Design it for that, sign included.",
            lambda case: _of(loop_of(case, _good(case)), controller=-controller_of(case)),
            marks=1 / 7,
        ),
        lacking(
            "Ms",
            "Ms above its limit",
            "The loop is stable, but Ms is too large. Too slow a filter lets go of the plant; a "
            "model that is too small makes the loop nervous. Draw Ms over λ, as in problem 6.2.",
            lambda case: _of(loop_of(case, 1.7 * _good(case))),
            marks=2 / 7,
        ),
        lacking(
            "disturbance",
            "disturbances not held",
            "Stable, with a good Ms, but slow disturbances are not held well enough: |S_d| is "
            "about nλω/|R(0)|. Make λ smaller, or the model.",
            lambda case: _of(loop_of(case, 1.3 * _good(case))),
            marks=3 / 7,
        ),
        lacking(
            "settling",
            "reference too slow",
            "The plant is held well; now y is too slow to follow the reference, or does not settle "
            "at it. That is up to C and the model: give C an integrator and a higher crossover.",
            lambda case: _of(
                loop_of(case, _good(case)),
                controller=design_controller(mirrored_model(case), bandwidth=0.2 * case.pole),
            ),
            marks=4 / 7,
        ),
        lacking(
            "changed",
            "changed plant lost",
            "Everything is met with the plant as it is, and a changed plant is lost. A filter that "
            "is very fast leans on a plant that is known exactly up to high frequency; a lag or a "
            "dead time breaks that. Slow it down.",
            lambda case: _of(loop_of(case, 0.01)),
            marks=5 / 7,
        ),
        lacking(
            "noise",
            "too much noise in u",
            "Everything is met but the noise. If it is infinite, F has only as many lags as the "
            "model: take one more. If it is finite, go to the slow end of the λ that meet the "
            "other goals, where the loop is quiet.",
            lambda case: _of(loop_of(case, 0.7 * _good(case))),
            marks=6 / 7,
        ),
    ),
    own=True,
)

PROBLEMS = (EQUAL_REJECTION, QUIETEST, ONE_PLANT, BENCH, DESIGN)


def _mirrored_pair(
    pole: float, decay: float, gain: float
) -> tuple[ct.TransferFunction, ct.TransferFunction]:
    """Give an unstable plant of gain -k at s = 0, and the model in which its pole is mirrored."""
    return lags(-1 / pole, 1 / decay, gain=-gain), lags(1 / pole, 1 / decay, gain=gain)
