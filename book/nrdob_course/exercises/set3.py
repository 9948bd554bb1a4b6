"""Set 3: margins, and Lemma 2."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from math import asin, degrees, inf, log, log10, nan, pi, radians, sin, sqrt
from typing import Any

import control as ct
import numpy as np

from nrdob.analysis import LoopMargins, margin_bounds
from nrdob.diagram import LowPassFilter
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray, FloatArray
from nrdob.plants import antiresonance, resonance
from nrdob.plotting import SHORT, Figure, axes_for, colour_of, styled

from .cases import LoopCase, apart, draw, few, first_fitting, kept
from .problems import (
    Lack,
    Misconception,
    Problem,
    answers_like,
    lacking,
    near,
    read_as,
    rounds,
    same,
)
from .reading import lowpass, number, numbers

__all__ = [
    "PROBLEMS",
    "SHARES",
    "GainCase",
    "MarginCase",
    "MeasuredCase",
    "NoiseCase",
    "PeakCase",
    "delay_readings",
    "measured_crossovers",
    "noise_readings",
]


def _changed(loop: NRDOB, plant: Any) -> bool | None:
    """Judge the same loop around another plant; p_A stays as it is."""
    return replace(loop, process=plant).stability().observer_loop.stable


# --- 3.1 What M_s promises ----------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PeakCase:
    """A loop of which only the peak of the sensitivity is known.

    Attributes
    ----------
    ms : float
        M_s, the maximum of |S_d|.
    """

    ms: float

    def __repr__(self) -> str:
        return f"Ms = {self.ms:g}"


def promised_margins(case: PeakCase) -> tuple[float, float, float]:
    return margin_bounds(case.ms)


def _distances(case: PeakCase, got: FloatArray) -> dict[str, tuple[str, float]]:
    """Tell for each of the three numbers which point it moves to -1, and how far that is."""
    low, high, angle = map(float, got)
    return {
        "high": (f"upper gain: the point -1/{high:.4g}", 1 - 1 / high if high else nan),
        "low": (f"lower gain: the point -1/{low:.4g}", 1 / low - 1 if low else nan),
        "angle": (
            f"angle: the point of the unit circle that is {angle:.4g}° from -1",
            2 * sin(radians(angle) / 2) if 0 < angle < 180 else -1.0,
        ),
    }


def _kept_promises(case: PeakCase, got: FloatArray) -> dict[str, bool]:
    found = _distances(case, got)
    return {name: abs(at * case.ms - 1) <= 1e-3 for name, (_, at) in found.items()}


def _promise_lacks(case: PeakCase, got: FloatArray) -> str:
    low, high, angle = map(float, got)
    if not 0 < low < 1 < high:
        return "the loop is stable as it is: the lower gain is below 1 and the upper above"
    if not 0 < angle < 180:
        return "the angle is asked for in degrees, between 0 and 180"
    for name, right in _kept_promises(case, got).items():
        if not right:
            where, found = _distances(case, got)[name]
            return (
                f"{where} is at the distance {found:.4g} from -1, not 1/Ms = {1 / case.ms:.4g}; "
                "the curve may come as near as that, and no nearer"
            )
    return ""


def _in_decibels(case: PeakCase) -> tuple[float, float, float]:
    low, high, angle = promised_margins(case)
    return 20 * log10(low), 20 * log10(high), angle


def _as_factors(got: FloatArray) -> FloatArray:
    """Take two gains in decibels, the lower one with its sign or without."""
    low, high, angle = map(float, got)
    return np.array([10 ** (-abs(low) / 20), 10 ** (high / 20), angle])


PROMISE = Problem(
    id="3.1",
    title="What M_s promises",
    case=lambda rng: PeakCase(round(float(rng.uniform(1.2, 1.9)), 2)),
    reads=partial(numbers, names="low, high, angle", gaps=True),
    lacks=_promise_lacks,
    parts=_kept_promises,
    rounded=lambda case, got: rounds(promised_margins(case), got),
    praise=(
        "Right: three points on a circle of radius 1/Ms around -1. The converse is false: fine "
        "gain and phase margins do not bound Ms."
    ),
    misconceptions=(
        answers_like(
            "angle in radians",
            "The gains are right, and so is the angle, but for its unit: sines and arcs in "
            "numpy are in radians, and degrees were asked for.",
            lambda case: (*promised_margins(case)[:2], radians(promised_margins(case)[2])),
            0.75,
        ),
        answers_like(
            "lower gain as the inverse of the upper",
            "The lower gain is not one over the upper one. Draw the circle of radius 1/Ms "
            "around -1: it is symmetric about -1, and -1/g is not. The far side is at "
            "-(1 + 1/Ms) = -1/g; solve for g.",
            lambda case: (1 / promised_margins(case)[1], *promised_margins(case)[1:]),
            2 / 3,
        ),
        answers_like(
            "Ms taken for a gain margin",
            "You let the gain change by the factor Ms. But 1/Ms is a distance, from -1 to the "
            "curve, not a gain. The gain multiplies the curve, which crosses the axis at some "
            "-1/g: its distance from -1 is |1 - 1/g|. Make that 1/Ms, on either side.",
            lambda case: (1 / case.ms, case.ms, promised_margins(case)[2]),
            1 / 3,
        ),
        answers_like(
            "distance taken for a change of gain",
            "You let the gain change by 1/Ms either way. But the gain multiplies the curve, which "
            "crosses the axis at some -1/g: what is 1/Ms is the distance from there to -1, "
            "|1 - 1/g|.",
            lambda case: (1 - 1 / case.ms, 1 + 1 / case.ms, promised_margins(case)[2]),
            1 / 3,
        ),
        answers_like(
            "chord taken for a sine",
            "The gains are right. The angle belongs to a chord of the unit circle, from -1 to the "
            "curve: a chord of length c spans the angle 2 arcsin(c/2), not arcsin(c).",
            lambda case: (*promised_margins(case)[:2], degrees(asin(1 / case.ms))),
            0.75,
        ),
        read_as(
            "gains in decibels",
            "The angle is right, and so are the gains, in decibels. Asked for are plain factors, "
            "below 1 and above: 10^(dB/20).",
            _in_decibels,
            _as_factors,
            _promise_lacks,
            0.75,
        ),
        read_as(
            "low and high exchanged",
            "All three are right, and the first two have changed places: the lower gain, below 1, "
            "comes first.",
            lambda case: (*promised_margins(case)[1::-1], promised_margins(case)[2]),
            lambda got: got[[1, 0, 2]],
            _promise_lacks,
            0.75,
        ),
    ),
)


# --- 3.3 The delay margin, from a measurement ---------------------------------------------------


@dataclass(frozen=True, eq=False)
class MeasuredCase:
    """The frequency response of a plant loop, measured; the loop is stable.

    Attributes
    ----------
    omega : array of float
        Frequencies, rad/s, ascending.
    L : array of complex
        L(jω) at these frequencies.
    truth : NRDOB
        The loop that was measured: for graders and solutions alone.
    """

    omega: FloatArray
    L: ComplexArray

    def __repr__(self) -> str:
        low, high = self.omega[[0, -1]]
        return f"L at {self.omega.size} frequencies from {low:.3g} to {high:.3g} rad/s"


def draw_far(rng: np.random.Generator) -> tuple[NRDOB, float]:
    """Draw a loop with a resonance far out, where it decides; and its λ."""
    constant, gain = draw(rng, 0.2, 1.5), draw(rng, 0.6, 2)
    pole = float(rng.uniform(11, 16)) / constant
    corner = pole * float(rng.uniform(0.5, 0.8))
    lead = ct.tf([1 / corner, 1], [1 / (corner * float(rng.uniform(2.0, 2.6))), 1])
    model = ct.tf([gain], [1, gain])
    shape = antiresonance(
        pole, pole * float(rng.uniform(0.8, 0.88)), float(rng.uniform(0.012, 0.016))
    )
    return NRDOB(model * shape * lead, model, 1.0, LowPassFilter(constant, 1)), constant


def draw_close(rng: np.random.Generator) -> tuple[NRDOB, float]:
    """Draw a loop with lags and a resonance so near that the first crossover decides."""
    constant, gain = draw(rng, 0.2, 1.5), draw(rng, 0.6, 2)
    lag = float(rng.uniform(0.3, 0.6)) * constant
    pole, damping = float(rng.uniform(2.5, 3.5)) / constant, float(rng.uniform(0.02, 0.05))
    model = ct.tf([gain], [1, gain])
    stronger = float(rng.uniform(0.9, 1.3)) * ct.tf([1], [lag, 1]) * ct.tf([1], [lag, 1])
    return NRDOB(
        model * resonance(pole, damping) * stronger, model, 1.0, LowPassFilter(constant, 1)
    ), constant


def _measure(loop: NRDOB, constant: float) -> MeasuredCase:
    omega = np.geomspace(0.2, 60, 3001) / constant
    return MeasuredCase(omega, loop.L(1j * omega))


def measured_crossovers(case: MeasuredCase) -> tuple[FloatArray, ComplexArray]:
    """Frequencies where |L| crosses 1, and L there."""
    above = np.abs(case.L) > 1
    k = np.flatnonzero(above[1:] != above[:-1])
    a, b = np.abs(case.L[k]), np.abs(case.L[k + 1])
    share = (1 - a) / (b - a)
    omega = case.omega[k] + share * (case.omega[k + 1] - case.omega[k])
    return omega, case.L[k] + share * (case.L[k + 1] - case.L[k])


@kept
def delays_of(case: MeasuredCase) -> FloatArray:
    """Dead time with which each crossover reaches -1."""
    w, L = measured_crossovers(case)
    return np.asarray(np.mod(np.angle(-L), 2 * pi) / w)


def delay_readings(case: MeasuredCase) -> dict[str, float]:
    """Compute the delay margin, rightly and wrongly."""
    w, L = measured_crossovers(case)
    angle, delays = np.angle(-L), delays_of(case)
    smallest = int(np.argmin(np.abs(angle)))
    return {
        "right": float(delays.min()),
        "last": float(delays[-1]),
        "degrees": float(np.degrees(delays).min()),
        "phase margin": float(abs(angle[smallest]) / w[smallest]),
        "plus one": float((np.mod(np.angle(L), 2 * pi) / w).min()),
        "either way": float((np.abs(angle) / w).min()),
        "negative": float((angle / w).min()),
    }


def draw_measured_loop(draw: Callable[..., Any], which: int, rng: np.random.Generator) -> Any:
    """Draw a loop whose delay margin is decided by the first crossover, 0, or the last, -1."""

    def drawn() -> tuple[MeasuredCase, NRDOB]:
        loop, constant = draw(rng)
        return _measure(loop, constant), loop

    def fits(found: tuple[MeasuredCase, NRDOB]) -> bool:
        case, loop = found
        w = measured_crossovers(case)[0]
        if w.size != 3 or w[2] < 1.03 * w[1]:  # a peak that a reader of the points can see
            return False
        readings = delay_readings(case)
        others = ["degrees", "plus one", "either way", "phase margin" if which else "last"]
        return (
            readings["right"] == delays_of(case)[which]
            and apart(*(readings[name] for name in ("right", *others)), by=0.1)
            and loop.stability().stable is True
        )

    return first_fitting(drawn, fits)


def _far_case(rng: np.random.Generator) -> MeasuredCase:
    case: MeasuredCase = draw_measured_loop(draw_far, -1, rng)[0]
    return case


def _close_case(rng: np.random.Generator) -> MeasuredCase:
    case: MeasuredCase = draw_measured_loop(draw_close, 0, rng)[0]
    return case


READ_OFF = 0.04
"""How far a delay found from measured points may be off."""


def _delay_lacks(case: MeasuredCase, margin: float) -> str:
    if not 0 < margin < inf:
        return "the delay margin of this loop is a positive number of seconds"
    # A dead time turns each point of the curve clockwise, by ω times it; stable until one is at -1.
    reached = delays_of(case) <= margin * (1 - READ_OFF)
    if reached.any():
        shorter = float(delays_of(case).min())
        return f"at a shorter dead time, {shorter:.4g} s, the loop is already lost"
    if not np.any(delays_of(case) <= margin * (1 + READ_OFF)):
        return f"with a little more, {margin * (1 + READ_OFF):.4g} s, the loop is still stable"
    return ""


_delay_like = partial(answers_like, close=partial(same, rtol=READ_OFF))


DELAY_MARGIN = Problem(
    id="3.3",
    title="The delay margin, from a measurement",
    case=(_far_case, _close_case),
    reads=number,
    lacks=_delay_lacks,
    praise=(
        "Right: with a little less dead time the curve does not reach -1, with a little more it "
        "does. Not the crossover with the least phase decides, but the one with the least "
        "time."
    ),
    misconceptions=(
        _delay_like(
            "degrees for radians",
            "Right, if a full turn were 360 radians: the angle must be in radians before it is "
            "divided by ω in rad/s. Leave out np.degrees.",
            lambda case: delay_readings(case)["degrees"],
            0.5,
        ),
        _delay_like(
            "the crossover of the phase margin only",
            "You took the crossover with the smallest phase margin. But a delay turns the curve by "
            "ω τ, fast at high frequency: a crossover far out is lost sooner, though it has "
            "more phase in hand. Take the smallest quotient over all crossovers.",
            lambda case: delay_readings(case)["phase margin"],
            0.25,
        ),
        _delay_like(
            "the last crossover only",
            "You took the last crossover. It is often lost first, since a delay turns the curve "
            "by ω τ; but where the first one has little phase in hand, that is lost sooner. Take "
            "the smallest quotient over all crossovers.",
            lambda case: delay_readings(case)["last"],
            0.25,
        ),
        _delay_like(
            "measured to +1 instead of -1",
            "You measured the angle to the positive real axis. Critical for 1 + L = 0 is -1: the "
            "angle by which L must turn clockwise to reach it is that of -L, modulo 2π.",
            lambda case: delay_readings(case)["plus one"],
            0.25,
        ),
        _delay_like(
            "negative angle not taken modulo 2π",
            "A negative dead time does not exist. Where np.angle(-L) is negative the curve has "
            "passed -1, seen clockwise, and must go nearly once around: take the angle modulo "
            "2π.",
            lambda case: delay_readings(case)["negative"],
            0.25,
        ),
        _delay_like(
            "turned either way",
            "At one crossover you let the curve turn counter-clockwise to -1, which is nearer. A "
            "delay turns it clockwise only: where np.angle(-L) is negative add 2π, instead of "
            "dropping the sign.",
            lambda case: delay_readings(case)["either way"],
            0.25,
        ),
        read_as(
            "milliseconds",
            "Right, in milliseconds. Frequencies are in rad/s here, and dead times in seconds.",
            lambda case: 1000 * delay_readings(case)["right"],
            lambda got: got / 1000,
            _delay_lacks,
            0.75,
        ),
    ),
)


# --- 3.4 Where may the plant be wrong -----------------------------------------------------------


@dataclass(frozen=True, eq=False)
class NoiseCase:
    """A loop whose maps are drawn, `case.plot()`, and how wrong its plant may be.

    Attributes
    ----------
    size : float
        Bound of the plant's relative error |Δ| beyond the frequency asked for.
    omega, S_d, S_eta, F : array of float
        The points of the curves: frequencies in rad/s, and the three gains there.
    """

    size: float
    omega: FloatArray = field(repr=False)
    S_d: FloatArray = field(repr=False)
    S_eta: FloatArray = field(repr=False)
    F: FloatArray = field(repr=False)

    def __repr__(self) -> str:
        return f"|Δ| up to {self.size:g}"

    def plot(self) -> Figure:
        """Draw |S_d|, |S_η| and |F| over the frequency, all on log scales."""
        with styled():
            (ax,) = axes_for(None, 1, SHORT)
            lines = []
            for name, style in (("S_d", "-"), ("S_eta", "-"), ("F", "--")):
                label = {"S_eta": r"$|S_\eta|$"}.get(name, f"$|{name}|$")
                size = getattr(self, name)
                lines += ax.loglog(self.omega, size, style, color=colour_of(name), label=label)
            ax.grid(True, which="minor", alpha=0.15)
            ax.set(xlabel="frequency (rad/s)", ylabel="gain", ylim=(0.02, 4))
            ax.legend(loc="center left")
        seen = [_falls_to(self.omega, self.S_eta, level) for level in (0.5, 0.2, 0.1)]
        words = ", ".join(f"{value:.3g}" for value in seen)
        return Figure(lines, ax, alt=f"|S_η| falls through 0.5, 0.2 and 0.1 at {words} rad/s")


def _falls_to(omega: FloatArray, size: FloatArray, level: float) -> float:
    """Find the last frequency at which a map has a size."""
    return float(omega[np.flatnonzero(size >= level)[-1]])


def noise_readings(case: NoiseCase) -> dict[str, float]:
    """Read the figure, rightly and wrongly."""
    level = 1 / case.size
    return {
        "right": _falls_to(case.omega, case.S_eta, level),
        "F": _falls_to(case.omega, case.F, level),
        "S_d": float(case.omega[np.argmax(case.S_d >= level)]),
        "bandwidth": _falls_to(case.omega, case.S_eta, sqrt(0.5)),
    }


def _noisy(rng: np.random.Generator) -> tuple[NoiseCase, NRDOB]:
    """Draw a loop, and what is drawn of it."""
    constant, gain, pole = draw(rng, 0.05, 0.5), draw(rng, 0.5, 5), draw(rng, 0.5, 3)
    model = ct.tf([gain], [1 / pole, 1])
    stronger = float(rng.uniform(2.0, 2.5))
    plant = model * ct.tf([stronger], [float(rng.uniform(0.01, 0.03)) * constant, 1])
    loop = NRDOB(plant, model, 1 / gain, LowPassFilter(constant, 2))
    omega = np.geomspace(0.01, 100, 2001) * loop.filter.bandwidth
    S_d, S_eta, F = (np.abs(of(1j * omega)) for of in (loop.S_d, loop.S_eta, loop.F))
    return NoiseCase(float(rng.integers(7, 13)), omega, S_d, S_eta, F), loop


def draw_noise_loop(rng: np.random.Generator) -> tuple[NoiseCase, NRDOB]:
    def fits(drawn: tuple[NoiseCase, NRDOB]) -> bool:
        case, loop = drawn
        return apart(*noise_readings(case).values(), by=0.25) and loop.stability().stable is True

    return first_fitting(lambda: _noisy(rng), fits)


def _noise_lacks(case: NoiseCase, omega: float) -> str:
    if not omega > 0:
        return "a frequency in rad/s is asked for"
    beyond, worst = case.omega >= 1.13 * omega, 0.0
    if beyond.any():
        worst = float(case.S_eta[beyond].max())
    if worst * case.size >= 1:
        return (
            f"beyond it |S_η| is still {worst:.3g}, and |Δ S_η| may reach {worst * case.size:.3g}"
        )
    before = float(np.interp(omega / 1.13, case.omega, case.S_eta))
    if before * case.size < 1:
        return f"a little below it |Δ S_η| is at most {before * case.size:.3g}: go lower"
    return ""


_noise_like = partial(answers_like, close=partial(near, tolerance=log(1.13)))


NOISE_MAP = Problem(
    id="3.4",
    title="Where may the plant be wrong?",
    case=lambda rng: draw_noise_loop(rng)[0],
    reads=number,
    lacks=_noise_lacks,
    praise=(
        "Right: |Δ| |S_η| < 1. Where the loop stops the noise, it does not need to know the plant."
    ),
    misconceptions=(
        _noise_like(
            "filter's curve read instead of the noise map",
            "You read the curve of F. It would be the right one for a perfect model. This plant is "
            "stronger than its model, so the loop is faster than the filter: read |S_η|.",
            lambda case: noise_readings(case)["F"],
            0.5,
        ),
        _noise_like(
            "disturbance map read instead of the noise map",
            "You read |S_d|. That tells where disturbances are rejected; there the loop needs the "
            "plant most of all. 1 + L(1 + Δ) = (1 + L)(1 + TΔ), and T = -S_η.",
            lambda case: noise_readings(case)["S_d"],
            0.0,
        ),
        _noise_like(
            "bandwidth of the noise map",
            "This is where |S_η| has lost 3 dB. There it is 0.71, and an error of the size given "
            "would make |Δ S_η| far larger than 1. Which |S_η| makes the product 1?",
            lambda case: noise_readings(case)["bandwidth"],
            0.25,
        ),
        read_as(
            "hertz for rad/s",
            "This is the frequency in hertz. The axis of the figure is in rad/s, and so is what is "
            "asked for: 2π times as much.",
            lambda case: noise_readings(case)["right"] / (2 * pi),
            lambda got: 2 * pi * got,
            _noise_lacks,
            0.75,
        ),
    ),
    own=True,
)


# --- 3.5 Find the error: the margin of FH -------------------------------------------------------


class GainCase(LoopCase):
    """A stable loop whose F H has an adequate gain margin."""

    def __repr__(self) -> str:
        m = self.loop.margins().observer_loop
        return f"a loop whose FH has a gain margin of {m.gm_db:.2f} dB"


def _gain_case(rng: np.random.Generator) -> GainCase:
    def drawn() -> GainCase:
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

    def fits(case: GainCase) -> bool:
        found = case.loop.margins()
        fh, true = found.observer_loop, found.plant_loop
        return bool(
            found.stable
            and 3.5 < fh.gm_high < inf
            and fh.pm > 60
            and found.model_loop.pm > 45
            and fh.gm_high > 1.3 * true.gm_high
        )

    return first_fitting(drawn, fits)


@kept
def _margins(case: GainCase) -> LoopMargins:
    return case.loop.margins()


def _gain_lacks(case: GainCase, k: float) -> str:
    fh = _margins(case).observer_loop
    if not fh.gm_low < k < fh.gm_high:
        return f"the margin of F H allows gains from {fh.gm_low:.4g} to {fh.gm_high:.4g} only"
    stable = _changed(case.loop, k * case.loop.process)
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


GAIN = Problem(
    id="3.5",
    title="Find the error: the margin of F H",
    case=_gain_case,
    reads=number,
    lacks=_gain_lacks,
    praise=(
        "Right: the margin of F H allows this gain, and the plant loop is lost. 1 + F (kR - 1) is "
        "(1 - F)(1 + kL), not 1 + kFH."
    ),
    misconceptions=(
        Misconception(
            "decibels taken for a factor",
            "This looks like decibels. The plant's gain is a plain factor: 10^(dB/20). As a factor "
            "your number is another gain altogether.",
            example=lambda case: _margins(case).observer_loop.gm_db,
            recognises=_decibels,
            marks=0.5,
        ),
        Misconception(
            "margin of FH taken for the plant's",
            "At this gain the loop is lost, but the margin of F H did not promise it: you went "
            "beyond that margin. The loop breaks earlier. Which loop has the plant's gain as a "
            "factor? Compute its margin, and take a gain between the two.",
            example=lambda case: 1.01 * _margins(case).observer_loop.gm_high,
            recognises=lambda case, got: got >= _margins(case).observer_loop.gm_high,
        ),
        Misconception(
            "still stable",
            "The loop bears this gain: look at the roots, with the plant multiplied. The "
            "error of Lemma 2 shows only beyond the upper gain margin of L = K G.",
            example=lambda case: 0.95 * _margins(case).plant_loop.gm_high,
            recognises=lambda case, got: 0 < got < _margins(case).plant_loop.gm_high,
            marks=0.25,
        ),
    ),
)


# --- 3.6 Design for margins ---------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class MarginCase:
    """A plant, its model, and what the loop should be able to do.

    Attributes
    ----------
    plant, model, controller : control.TransferFunction
        Blocks of the loop.
    ms : float
        M_s of the plant loop may not be larger.
    delay_margin : float
        In seconds; may not be smaller.
    omega : float
        A frequency in rad/s,
    rejection : float
        at which |S_d| may not be larger than this.
    good : float
        λ of a filter of order 2 that does it all: for graders alone.
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


def draw_margin_loop(rng: np.random.Generator) -> tuple[MarginCase, float]:
    """Draw a case, and a λ that is good for it."""

    def drawn() -> tuple[MarginCase, float]:
        lag, gain = draw(rng, 0.02, 0.3), draw(rng, 0.5, 5)
        slow = [draw(rng, 0.05, 0.15) / lag, draw(rng, 0.2, 0.4) / lag]
        model = ct.tf([gain], np.polymul(*([1 / p, 1] for p in slow)))
        stronger = float(rng.uniform(1.2, 1.5))
        plant = model * ct.tf([stronger], np.polymul([lag, 1], [lag, 1]))
        controller = ct.tf([1 / slow[0], 1], [4 * gain / slow[1], 0])
        good, omega = float(rng.uniform(3.5, 5)) * lag, few(0.05 / lag)

        def at(share: float) -> NRDOB:
            return NRDOB(plant, model, controller, LowPassFilter(share * good, 2))

        case = MarginCase(
            plant,
            model,
            controller,
            ms=float(np.ceil(100 * at(SHARES[0]).margins().plant_loop.ms) / 100),
            delay_margin=few(at(SHARES[1]).margins().plant_loop.delay_margin, 3),
            omega=omega,
            rejection=few(float(abs(at(SHARES[2]).S_d(1j * omega))), 3),
        )
        return case, good

    def fits(found: tuple[MarginCase, float]) -> bool:
        # Between what F H allows and what L allows there must be room for the mistake.
        case, good = found
        faster = case.loop(LowPassFilter(0.88 * SHARES[0] * good, 2))
        return bool(faster.margins().observer_loop.ms <= case.ms)

    return first_fitting(drawn, fits)


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


def _filter(given: Any) -> Any:
    """Read a filter of the family, or take one of another."""
    return given if isinstance(given, ct.TransferFunction) else lowpass(given)


WITHIN = 6e-3
"""By what share a limit may be missed: that is three digits of λ."""


def _design_lacks(case: MarginCase, filter: Any) -> str:
    loop = case.loop(filter)
    if loop.stability().stable is not True:
        return "the loop is not stable"
    true = loop.margins().plant_loop
    size = float(abs(loop.S_d(1j * case.omega)))
    lacks = []
    if true.ms > case.ms * (1 + WITHIN):
        lacks.append(Lack("ms", f"Ms of L is {true.ms:.4g}"))
    if true.delay_margin < case.delay_margin * (1 - WITHIN):
        lacks.append(Lack("delay", f"the delay margin is {true.delay_margin:.4g} s"))
    if size > case.rejection * (1 + WITHIN):
        lacks.append(Lack("rejection", f"|S_d| is {size:.4g} at {case.omega:g} rad/s"))
    return lacks[0] if len(lacks) == 1 else ", ".join(lacks)


def _trusts_FH(case: MarginCase, filter: Any) -> bool:
    found = case.loop(filter).margins()
    return bool(found.observer_loop.ms <= case.ms * (1 + WITHIN) < found.plant_loop.ms)


def _example(find: Callable[[MarginCase], float]) -> Callable[[MarginCase], LowPassFilter]:
    return lambda case: LowPassFilter(find(case), 2)


DESIGN = Problem(
    id="3.6",
    title="Design for margins",
    case=lambda rng: draw_margin_loop(rng)[0],
    reads=_filter,
    lacks=_design_lacks,
    praise=(
        "Right: stable, and with margins that the plant feels. How narrow the room is shows what "
        "the neglected lags cost."
    ),
    misconceptions=(
        Misconception(
            "Ms of FH taken for the plant's",
            "The Ms of F H is small enough, that of L is not. The first belongs to a loop in "
            "which the model error is exaggerated; what the plant and its disturbances feel is "
            "L = K G. Take the third line of the margins.",
            example=_example(lambda case: 1.02 * _fastest(case, "observer_loop")),
            recognises=_trusts_FH,
            marks=0.25,
        ),
        lacking(
            "delay",
            "delay margin not looked at",
            "Ms and the rejection are as wanted, but the delay margin is too small. Ms does not "
            "bound it from below. Make the filter a little slower.",
            example=_example(lambda case: 1.05 * _fastest(case, "plant_loop")),
            marks=0.5,
        ),
        lacking(
            "rejection",
            "robust only",
            "Robust enough, and too slow: the disturbance is not rejected as it should be. The "
            "margins leave you room; make λ smaller, until the first of them is used up.",
            example=_example(lambda case: 2.2 * _fastest(case, "plant_loop")),
            marks=0.5,
        ),
    ),
    own=True,
)

PROBLEMS = (PROMISE, DELAY_MARGIN, NOISE_MAP, GAIN, DESIGN)
