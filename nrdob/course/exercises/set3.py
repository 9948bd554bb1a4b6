"""Set 3: margins, and Lemma 2."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from math import asin, degrees, inf, log, pi, radians, sin, sqrt
from typing import Any

import control as ct
import numpy as np

from ...analysis import margin_bounds
from ...diagram import LowPassFilter, delay
from ...loop import NRDOB
from ...numerics import ComplexArray, FloatArray
from ...plotting import SHORT, Figure, axes_for, colour_of, styled
from .cases import LoopCase, apart, draw, few, first_fitting
from .problems import Lack, Misconception, Problem, answers_like, lacking, near, same

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


@dataclass(frozen=True)
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


def _promise(case: PeakCase) -> tuple[float, float, float]:
    return margin_bounds(case.ms)


def _promise_lacks(case: PeakCase, got: Any) -> str:
    if np.size(got) != 3:
        return "three numbers are asked for: (low, high, angle)"
    low, high, angle = map(float, got)
    if not 0 < low < 1 < high:
        return "the loop is stable as it is: the lower gain is below 1 and the upper above"
    distance = 1 / case.ms
    points = {
        f"upper gain: the point -1/{high:.4g}": 1 - 1 / high,
        f"lower gain: the point -1/{low:.4g}": 1 / low - 1,
        f"angle: the point of the unit circle that is {angle:.4g}° from -1": (
            2 * abs(sin(radians(angle) / 2))
        ),
    }
    for where, found in points.items():
        if abs(found - distance) > 1e-3 * distance:
            return (
                f"{where} is at the distance {found:.4g} from -1, not 1/Ms = {distance:.4g}; the "
                "curve may come as near as that, and no nearer"
            )
    return ""


PROMISE = Problem(
    id="3.1",
    title="What M_s promises",
    case=lambda rng: PeakCase(round(float(rng.uniform(1.2, 1.9)), 2)),
    lacks=_promise_lacks,
    praise=(
        "Right: three points on a circle of radius 1/Ms around -1. The converse is false: fine "
        "gain and phase margins do not bound Ms."
    ),
    misconceptions=(
        answers_like(
            "angle in radians",
            "The gains are right, and so is the angle, but for its unit: sines and arcs in "
            "numpy are in radians, and degrees were asked for.",
            lambda case: (*_promise(case)[:2], radians(_promise(case)[2])),
            0.75,
        ),
        answers_like(
            "lower gain as the inverse of the upper",
            "The lower gain is not one over the upper one. Draw the circle of radius 1/Ms "
            "around -1: it is symmetric about -1, and -1/g is not. The far side is at "
            "-(1 + 1/Ms) = -1/g; solve for g.",
            lambda case: (1 / _promise(case)[1], *_promise(case)[1:]),
            0.5,
        ),
        answers_like(
            "Ms taken for a gain margin",
            "You let the gain change by the factor Ms. But 1/Ms is a distance, from -1 to the "
            "curve, not a gain. The gain multiplies the curve, which crosses the axis at some "
            "-1/g: its distance from -1 is |1 - 1/g|. Make that 1/Ms, on either side.",
            lambda case: (1 / case.ms, case.ms, _promise(case)[2]),
        ),
        answers_like(
            "distance taken for a change of gain",
            "You let the gain change by 1/Ms either way. But the gain multiplies the curve, which "
            "crosses the axis at some -1/g: what is 1/Ms is the distance from there to -1, "
            "|1 - 1/g|.",
            lambda case: (1 - 1 / case.ms, 1 + 1 / case.ms, _promise(case)[2]),
            0.25,
        ),
        answers_like(
            "chord taken for a sine",
            "The gains are right. The angle belongs to a chord of the unit circle, from -1 to the "
            "curve: a chord of length c spans the angle 2 arcsin(c/2), not arcsin(c).",
            lambda case: (*_promise(case)[:2], degrees(asin(1 / case.ms))),
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
    truth: NRDOB = field(repr=False)

    def __repr__(self) -> str:
        low, high = self.omega[[0, -1]]
        return f"L at {self.omega.size} frequencies from {low:.3g} to {high:.3g} rad/s"


def _resonance(pole: float, zero: float, damping: float) -> ct.TransferFunction:
    top, bottom = (np.array([1.0, 2 * damping * w, w * w]) for w in (zero, pole))
    return ct.tf((pole / zero) ** 2 * top, bottom)


def _measured(rng: np.random.Generator) -> MeasuredCase:
    constant, gain = draw(rng, 0.2, 1.5), draw(rng, 0.6, 2)
    pole = float(rng.uniform(11, 16)) / constant
    corner = pole * float(rng.uniform(0.5, 0.8))
    lead = ct.tf([1 / corner, 1], [1 / (corner * float(rng.uniform(2.0, 2.6))), 1])
    model = ct.tf([gain], [1, gain])
    shape = _resonance(pole, pole * float(rng.uniform(0.8, 0.88)), float(rng.uniform(0.012, 0.016)))
    loop = NRDOB(model * shape * lead, model, 1.0, LowPassFilter(constant, 1))
    omega = np.geomspace(0.1, 100, 20_001) / constant
    return MeasuredCase(omega, loop.L(1j * omega), loop)


def measured_crossovers(case: MeasuredCase) -> tuple[FloatArray, ComplexArray]:
    """Frequencies where |L| crosses 1, and L there."""
    above = np.abs(case.L) > 1
    k = np.flatnonzero(above[1:] != above[:-1])
    a, b = np.abs(case.L[k]), np.abs(case.L[k + 1])
    share = (1 - a) / (b - a)
    omega = case.omega[k] + share * (case.omega[k + 1] - case.omega[k])
    return omega, case.L[k] + share * (case.L[k + 1] - case.L[k])


def delay_readings(case: MeasuredCase) -> dict[str, float]:
    """Compute the delay margin, rightly and wrongly."""
    w, L = measured_crossovers(case)
    angle = np.angle(-L)
    lag = np.mod(angle, 2 * pi)
    smallest = int(np.argmin(np.abs(angle)))
    return {
        "right": float((lag / w).min()),
        "degrees": float((np.degrees(lag) / w).min()),
        "phase margin": float(abs(angle[smallest]) / w[smallest]),
        "plus one": float((np.mod(np.angle(L), 2 * pi) / w).min()),
        "either way": float((np.abs(angle) / w).min()),
        "negative": float((angle / w).min()),
    }


def _measured_case(rng: np.random.Generator) -> MeasuredCase:
    def fits(case: MeasuredCase) -> bool:
        w, found = measured_crossovers(case)[0], delay_readings(case)
        return (
            w.size == 3
            and w[2] > 1.03 * w[1]  # a peak that a reader of the points can see
            and apart(*(value for key, value in found.items() if key != "negative"), by=0.1)
            and case.truth.stability().stable is True
        )

    return first_fitting(lambda: _measured(rng), fits)


READ_OFF = 0.04
"""How far a delay found from measured points may be off."""


def _delay_lacks(case: MeasuredCase, got: Any) -> str:
    if np.size(got) != 1:
        return "one number is asked for, the smallest dead time at which the loop is lost"
    margin = float(np.ravel(got)[0])
    if not 0 < margin < inf:
        return "the delay margin of this loop is a positive number of seconds"
    plant = case.truth.process
    w, L = measured_crossovers(case)
    # At a longer dead time the loop may be stable once more: every shorter one must do.
    for shorter in np.mod(np.angle(-L), 2 * pi) / w * (1 + READ_OFF):
        if shorter < margin and _changed(case.truth, delay(float(shorter)) * plant) is not True:
            return f"at a shorter dead time, {shorter:.4g} s, the loop is already lost"
    if _changed(case.truth, delay(margin * (1 - READ_OFF)) * plant) is not True:
        return f"with a little less, {margin * (1 - READ_OFF):.4g} s, the loop is already lost"
    if _changed(case.truth, delay(margin * (1 + READ_OFF)) * plant) is not False:
        return f"with a little more, {margin * (1 + READ_OFF):.4g} s, the loop is still stable"
    return ""


def _same_delay(held: float, got: Any) -> bool:
    return same(held, float(got), READ_OFF)


_delay_like = partial(answers_like, close=_same_delay)


DELAY_MARGIN = Problem(
    id="3.3",
    title="The delay margin, from a measurement",
    case=_measured_case,
    lacks=_delay_lacks,
    praise=(
        "Right, and the exact count agrees: stable with a little less dead time, lost with a "
        "little more. Not the crossover with the least phase decides, but the one with the least "
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
    truth : NRDOB
        The loop itself: for graders and solutions alone.
    """

    size: float
    truth: NRDOB = field(repr=False)

    def __repr__(self) -> str:
        return f"|Δ| up to {self.size:g}"

    def plot(self) -> Figure:
        """Draw |S_d|, |S_η| and |F| over the frequency, all on log scales."""
        unit = self.truth.filter.bandwidth
        w = np.geomspace(0.03, 30, 600) * unit
        with styled():
            (ax,) = axes_for(None, 1, SHORT)
            lines = []
            for name, style in (("S_d", "-"), ("S_eta", "-"), ("F", "--")):
                size = np.abs(getattr(self.truth, name)(1j * w))
                label = {"S_eta": r"$|S_\eta|$"}.get(name, f"$|{name}|$")
                lines += ax.loglog(w, size, style, color=colour_of(name), label=label)
            ax.grid(True, which="minor", alpha=0.15)
            ax.set(xlabel="frequency (rad/s)", ylabel="gain", ylim=(0.02, 4))
            ax.legend(loc="center left")
        seen = [_falls_to(self.truth, "S_eta", level) for level in (0.5, 0.2, 0.1)]
        words = ", ".join(f"{value:.3g}" for value in seen)
        return Figure(lines, ax, alt=f"|S_η| falls through 0.5, 0.2 and 0.1 at {words} rad/s")


def _falls_to(loop: NRDOB, name: str, level: float) -> float:
    """Find the last frequency at which a map has a size."""
    w = np.geomspace(1e-3, 1e3, 6001) * loop.filter.bandwidth
    above = np.flatnonzero(np.abs(getattr(loop, name)(1j * w)) >= level)
    return float(w[above[-1]]) if above.size else float(w[0])


def _rises_to(loop: NRDOB, name: str, level: float) -> float:
    """Find the first frequency at which a map has a size."""
    w = np.geomspace(1e-3, 1e3, 6001) * loop.filter.bandwidth
    return float(w[np.argmax(np.abs(getattr(loop, name)(1j * w)) >= level)])


def noise_readings(case: NoiseCase) -> dict[str, float]:
    """Read the figure, rightly and wrongly."""
    loop, level = case.truth, 1 / case.size
    return {
        "right": _falls_to(loop, "S_eta", level),
        "F": _falls_to(loop, "F", level),
        "S_d": _rises_to(loop, "S_d", level),
        "bandwidth": _falls_to(loop, "S_eta", sqrt(0.5)),
    }


def _noise_case(rng: np.random.Generator) -> NoiseCase:
    def drawn() -> NoiseCase:
        constant, gain, pole = draw(rng, 0.05, 0.5), draw(rng, 0.5, 5), draw(rng, 0.5, 3)
        model = ct.tf([gain], [1 / pole, 1])
        stronger = float(rng.uniform(2.0, 2.5))
        plant = model * ct.tf([stronger], [float(rng.uniform(0.01, 0.03)) * constant, 1])
        loop = NRDOB(plant, model, 1 / gain, LowPassFilter(constant, 2))
        return NoiseCase(float(rng.integers(7, 13)), loop)

    def fits(case: NoiseCase) -> bool:
        return apart(*noise_readings(case).values(), by=0.25) and (
            case.truth.stability().stable is True
        )

    return first_fitting(drawn, fits)


def _noise_lacks(case: NoiseCase, got: Any) -> str:
    omega = float(got)
    if omega <= 0:
        return "a frequency in rad/s is asked for"
    beyond = np.geomspace(1.13 * omega, 1e3 * omega, 400)
    worst = float(np.abs(case.truth.S_eta(1j * beyond)).max())
    if worst * case.size >= 1:
        return (
            f"beyond it |S_η| is still {worst:.3g}, and |Δ S_η| may reach {worst * case.size:.3g}"
        )
    before = float(abs(case.truth.S_eta(1j * omega / 1.13)))
    if before * case.size < 1:
        return f"a little below it |Δ S_η| is at most {before * case.size:.3g}: go lower"
    return ""


_noise_like = partial(answers_like, close=partial(near, tolerance=log(1.13)))


NOISE_MAP = Problem(
    id="3.4",
    title="Where may the plant be wrong?",
    case=_noise_case,
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


def _gain_lacks(case: GainCase, got: Any) -> str:
    k = float(got)
    fh = case.loop.margins().observer_loop
    if not fh.gm_low < k < fh.gm_high:
        return f"the margin of F H allows gains from {fh.gm_low:.4g} to {fh.gm_high:.4g} only"
    stable = _changed(case.loop, k * case.loop.process)
    if stable is False:
        return ""
    return f"with {k:.4g} times its plant the loop is " + ("stable" if stable else "on the border")


def _decibels(case: GainCase, got: Any) -> bool:
    found = case.loop.margins()
    k = float(got)
    return any(abs(k / m.gm_db - 1) < 1e-2 for m in (found.observer_loop, found.plant_loop))


GAIN = Problem(
    id="3.5",
    title="Find the error: the margin of F H",
    case=_gain_case,
    lacks=_gain_lacks,
    praise=(
        "Right: the margin of F H allows this gain, and the plant loop is lost. 1 + F (kR - 1) is "
        "(1 - F)(1 + kL), not 1 + kFH."
    ),
    misconceptions=(
        Misconception(
            "decibels taken for a factor",
            "This is a margin in decibels. The plant's gain is a plain factor: 10^(dB/20).",
            example=lambda case: case.loop.margins().observer_loop.gm_db,
            recognises=_decibels,
            marks=0.25,
        ),
        Misconception(
            "margin of FH taken for the plant's",
            "At this gain the loop is lost, but the margin of F H did not promise it: you went "
            "beyond that margin. The loop breaks earlier. Which loop has the plant's gain as a "
            "factor? Compute its margin, and take a gain between the two.",
            example=lambda case: 1.01 * case.loop.margins().observer_loop.gm_high,
            recognises=lambda case, got: float(got) >= case.loop.margins().observer_loop.gm_high,
        ),
        Misconception(
            "still stable",
            "The loop bears this gain: look at the roots, with the plant multiplied. The "
            "error of Lemma 2 shows only beyond the upper gain margin of L = K G.",
            example=lambda case: 0.95 * case.loop.margins().plant_loop.gm_high,
            recognises=lambda case, got: 0 < float(got) < case.loop.margins().plant_loop.gm_high,
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
    good: float = field(repr=False)

    def loop(self, filter: Any) -> NRDOB:
        """Make the loop with a filter."""
        return NRDOB(self.plant, self.model, self.controller, filter)

    def __repr__(self) -> str:
        return (
            f"Ms ≤ {self.ms:g}, delay margin ≥ {self.delay_margin:g} s, "
            f"|S_d| ≤ {self.rejection:g} at {self.omega:g} rad/s"
        )


def _margin_case(rng: np.random.Generator) -> MarginCase:
    def drawn() -> MarginCase:
        lag, gain = draw(rng, 0.02, 0.3), draw(rng, 0.5, 5)
        slow = [draw(rng, 0.05, 0.15) / lag, draw(rng, 0.2, 0.4) / lag]
        model = ct.tf([gain], np.polymul(*([1 / p, 1] for p in slow)))
        stronger = float(rng.uniform(1.2, 1.5))
        plant = model * ct.tf([stronger], np.polymul([lag, 1], [lag, 1]))
        controller = ct.tf([1 / slow[0], 1], [4 * gain / slow[1], 0])
        good, omega = float(rng.uniform(3.5, 5)) * lag, few(0.05 / lag)

        def at(share: float) -> NRDOB:
            return NRDOB(plant, model, controller, LowPassFilter(share * good, 2))

        return MarginCase(
            plant,
            model,
            controller,
            ms=float(np.ceil(100 * at(SHARES[0]).margins().plant_loop.ms) / 100),
            delay_margin=few(at(SHARES[1]).margins().plant_loop.delay_margin, 3),
            omega=omega,
            rejection=few(float(abs(at(SHARES[2]).S_d(1j * omega))), 3),
            good=good,
        )

    def fits(case: MarginCase) -> bool:
        # Between what F H allows and what L allows there must be room for the mistake.
        faster = case.loop(LowPassFilter(0.88 * SHARES[0] * case.good, 2))
        return bool(faster.margins().observer_loop.ms <= case.ms)

    return first_fitting(drawn, fits)


SHARES = (0.7, 0.9, 1.15)
"""Of a good λ: where M_s becomes too large, then the delay margin too small, then S_d too large."""


def _fastest(case: MarginCase, which: str) -> float:
    """Find the smallest λ at which one loop, judged by M_s, would do."""

    def enough(constant: float) -> bool:
        found = case.loop(LowPassFilter(constant, 2)).margins()
        return bool(found.stable) and bool(getattr(found, which).ms <= case.ms)

    low, high = 0.1 * case.good, 2 * case.good
    for _ in range(12):
        middle = sqrt(low * high)
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def _design_filter(got: Any) -> Any:
    if isinstance(got, tuple | list):
        return LowPassFilter(*got)
    if isinstance(got, float | int):
        raise TypeError("a filter is asked for, LowPassFilter(λ, n)")
    return got


def _design_lacks(case: MarginCase, got: Any) -> str:
    loop = case.loop(_design_filter(got))
    if loop.stability().stable is not True:
        return "the loop is not stable"
    true = loop.margins().plant_loop
    size = float(abs(loop.S_d(1j * case.omega)))
    lacks = []
    if true.ms > case.ms * (1 + 1e-3):
        lacks.append(Lack("ms", f"Ms of L is {true.ms:.4g}"))
    if true.delay_margin < case.delay_margin * (1 - 1e-3):
        lacks.append(Lack("delay", f"the delay margin is {true.delay_margin:.4g} s"))
    if size > case.rejection * (1 + 1e-3):
        lacks.append(Lack("rejection", f"|S_d| is {size:.4g} at {case.omega:g} rad/s"))
    return lacks[0] if len(lacks) == 1 else ", ".join(lacks)


def _trusts_FH(case: MarginCase, got: Any) -> bool:
    found = case.loop(_design_filter(got)).margins()
    return bool(found.observer_loop.ms <= case.ms * (1 + 1e-3) < found.plant_loop.ms)


def _example(find: Callable[[MarginCase], float]) -> Callable[[MarginCase], LowPassFilter]:
    return lambda case: LowPassFilter(find(case), 2)


DESIGN = Problem(
    id="3.6",
    title="Design for margins",
    case=_margin_case,
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
