"""Set 3: margins, and Lemma 2."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from math import asin, degrees, inf, log, nan, pi, radians, sin, sqrt
from typing import Any

import control as ct
import numpy as np

from nrdob import NRDOB, LowPassFilter
from nrdob.analysis import LoopMargins, MarginBounds, margin_bounds
from nrdob.numerics import ComplexArray, FloatArray
from nrdob.plants import antiresonance, resonance
from nrdob.plotting import Figure

from .cases import LoopCase, observer_stable
from .comparing import LEEWAY, near, rounds, same
from .drawing import apart, draw, few, first_fitting, fitting, kept
from .figures import draw_gains
from .problems import Lack, Misconception, first_of, lack_of, lacking, pose, put_right, reading
from .reading import lowpass, number, numbers

__all__ = ["DELAY_MARGIN", "DESIGN", "GAIN", "NOISE_MAP", "PROMISE"]


# --- 3.1 What M_s promises ----------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PeakCase:
    """A loop of which only the peak of the sensitivity is known."""

    ms: float  # the maximum of |S_d|

    def __repr__(self) -> str:
        return f"Ms = {self.ms:g}"


def _promised(case: PeakCase, **changed: float) -> MarginBounds:
    return margin_bounds(case.ms)._replace(**changed)


def _broken(case: PeakCase, got: FloatArray) -> dict[str, str]:
    """Tell of each of the three numbers which point it moves to -1, unless that is 1/Ms off."""
    low, high, angle = map(float, got)

    def lack(point: str, distance: float) -> str:
        if abs(distance * case.ms - 1) <= 1e-3:
            return ""
        return lack_of("3.1", "distance", point=point, distance=distance, wanted=1 / case.ms)

    chord = 2 * sin(radians(angle) / 2) if 0 < angle < 180 else -1.0
    return {
        "high": lack(f"upper gain: the point -1/{high:.4g}", 1 - 1 / high if high else nan),
        "low": lack(f"lower gain: the point -1/{low:.4g}", 1 / low - 1 if low else nan),
        "angle": lack(f"angle: the point of the unit circle that is {angle:.4g}° from -1", chord),
    }


def _promise_lacks(case: PeakCase, got: FloatArray) -> str:
    low, high, angle = map(float, got)
    if not 0 < low < 1 < high:
        return lack_of("3.1", "gains")
    if not 0 < angle < 180:
        return lack_of("3.1", "degrees")
    return first_of(_broken)(case, got)


def _as_factors(got: FloatArray) -> FloatArray:
    """Take two gains in decibels, the lower one with its sign or without."""
    low, high, angle = map(float, got)
    return np.array([10 ** (-abs(low) / 20), 10 ** (high / 20), angle])


PROMISE = pose(
    "3.1",
    case=lambda rng: PeakCase(round(rng.uniform(1.2, 1.9), 2)),
    reads=partial(numbers, names="low, high, angle", gaps=True),
    lacks=_promise_lacks,
    parts=_broken,
    rounded=lambda case, got: rounds(_promised(case), got),
    misconceptions={
        "angle in radians": lambda case: _promised(case, pm=radians(_promised(case).pm)),
        "lower gain as the inverse of the upper": lambda case: _promised(
            case, gm_low=1 / _promised(case).gm_high
        ),
        "Ms taken for a gain margin": lambda case: _promised(
            case, gm_low=1 / case.ms, gm_high=case.ms
        ),
        "distance taken for a change of gain": lambda case: _promised(
            case, gm_low=1 - 1 / case.ms, gm_high=1 + 1 / case.ms
        ),
        "chord taken for a sine": lambda case: _promised(case, pm=degrees(asin(1 / case.ms))),
        "gains in decibels": put_right(
            lambda case: [*(20 * np.log10(_promised(case)[:2])), _promised(case).pm], _as_factors
        ),
        "low and high exchanged": put_right(
            lambda case: np.array(_promised(case))[[1, 0, 2]], lambda got: got[[1, 0, 2]]
        ),
    },
)


# --- 3.3 The delay margin, from a measurement ---------------------------------------------------


@dataclass(frozen=True, eq=False)
class MeasuredCase:
    """The frequency response of a plant loop, measured; the loop is stable."""

    omega: FloatArray  # in rad/s, ascending
    L: ComplexArray  # L(jω) at these frequencies

    def __repr__(self) -> str:
        low, high = self.omega[[0, -1]]
        return f"L at {self.omega.size} frequencies from {low:.3g} to {high:.3g} rad/s"


def draw_far(rng: np.random.Generator) -> tuple[NRDOB, float]:
    """Draw a loop with a resonance far out, where it decides; and its λ."""
    constant, gain = draw(rng, 0.2, 1.5), draw(rng, 0.6, 2)
    pole = rng.uniform(11, 16) / constant
    corner = pole * rng.uniform(0.5, 0.8)
    lead = ct.tf([1 / corner, 1], [1 / (corner * rng.uniform(2.0, 2.6)), 1])
    model = ct.tf([gain], [1, gain])
    shape = antiresonance(pole, pole * rng.uniform(0.8, 0.88), rng.uniform(0.012, 0.016))
    return NRDOB(model * shape * lead, model, 1.0, LowPassFilter(constant, 1)), constant


def draw_close(rng: np.random.Generator) -> tuple[NRDOB, float]:
    """Draw a loop with lags and a resonance so near that the first crossover decides."""
    constant, gain = draw(rng, 0.2, 1.5), draw(rng, 0.6, 2)
    lag = rng.uniform(0.3, 0.6) * constant
    pole, damping = rng.uniform(2.5, 3.5) / constant, rng.uniform(0.02, 0.05)
    model = ct.tf([gain], [1, gain])
    stronger = rng.uniform(0.9, 1.3) * ct.tf([1], [lag, 1]) * ct.tf([1], [lag, 1])
    plant = model * resonance(pole, damping) * stronger
    return NRDOB(plant, model, 1.0, LowPassFilter(constant, 1)), constant


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
        omega = np.geomspace(0.2, 60, 3001) / constant
        return MeasuredCase(omega, loop.L(1j * omega)), loop

    def fits(found: tuple[MeasuredCase, NRDOB]) -> bool:
        case, loop = found
        w = measured_crossovers(case)[0]
        if w.size != 3 or w[2] < 1.03 * w[1]:  # a peak that a reader of the points can see
            return False
        readings = delay_readings(case)
        others = ["degrees", "plus one", "either way", "phase margin" if which else "last"]
        decides = readings["right"] == delays_of(case)[which]
        told = apart(*(readings[name] for name in ("right", *others)), by=0.1)
        return bool(decides and told and loop.stability().stable is True)

    return first_fitting(drawn, fits)


READ_OFF = 0.04  # how far a delay found from measured points may be off


def _delay_lacks(case: MeasuredCase, margin: float) -> str:
    if not 0 < margin < inf:
        return "the delay margin of this loop is a positive number of seconds"
    # A dead time turns each point of the curve clockwise, by ω times it; stable until one is at -1.
    first = delays_of(case).min()
    if first <= margin * (1 - READ_OFF):
        return f"at a shorter dead time, {first:.4g} s, the loop is already unstable"
    if first > margin * (1 + READ_OFF):
        return f"with a little more, {margin * (1 + READ_OFF):.4g} s, the loop is still stable"
    return ""


DELAY_MARGIN = pose(
    "3.3",
    alike=partial(same, rtol=READ_OFF),
    case=(
        lambda rng: draw_measured_loop(draw_far, -1, rng)[0],
        lambda rng: draw_measured_loop(draw_close, 0, rng)[0],
    ),
    reads=number,
    lacks=_delay_lacks,
    misconceptions={
        "degrees for radians": reading(delay_readings, "degrees"),
        "the crossover of the phase margin only": reading(delay_readings, "phase margin"),
        "the last crossover only": reading(delay_readings, "last"),
        "measured to +1 instead of -1": reading(delay_readings, "plus one"),
        "negative angle not taken modulo 2π": reading(delay_readings, "negative"),
        "turned either way": reading(delay_readings, "either way"),
        "milliseconds": put_right(
            lambda case: 1000 * delay_readings(case)["right"], lambda got: got / 1000
        ),
    },
)


# --- 3.4 Where may the plant be wrong -----------------------------------------------------------


@dataclass(frozen=True, eq=False)
class NoiseCase:
    """A loop whose maps are drawn, `case.plot()`, and how wrong its plant may be."""

    size: float  # bound of the plant's relative error |Δ| beyond the frequency asked for
    omega: FloatArray = field(repr=False)  # points of the curves, in rad/s
    S_d: FloatArray = field(repr=False)  # three gains there
    S_eta: FloatArray = field(repr=False)
    F: FloatArray = field(repr=False)

    def __repr__(self) -> str:
        return f"|Δ| up to {self.size:g}"

    def plot(self) -> Figure:
        """Draw |S_d|, |S_η| and |F| over the frequency, all on log scales."""
        gains = {name: getattr(self, name) for name in ("S_d", "S_eta", "F")}
        seen = [_falls_to(self.omega, self.S_eta, level) for level in (0.5, 0.2, 0.1)]
        words = ", ".join(f"{value:.3g}" for value in seen)
        alt = f"|S_η| falls through 0.5, 0.2 and 0.1 at {words} rad/s"
        return draw_gains(self.omega, gains, alt, ylim=(0.02, 4))


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


@fitting(
    lambda drawn: (
        apart(*noise_readings(drawn[0]).values(), by=0.25) and drawn[1].stability().stable is True
    )
)
def draw_noise_loop(rng: np.random.Generator) -> tuple[NoiseCase, NRDOB]:
    """Draw a loop, and what is drawn of it."""
    constant, gain, pole = draw(rng, 0.05, 0.5), draw(rng, 0.5, 5), draw(rng, 0.5, 3)
    model = ct.tf([gain], [1 / pole, 1])
    stronger = rng.uniform(2.0, 2.5)
    plant = model * ct.tf([stronger], [rng.uniform(0.01, 0.03) * constant, 1])
    loop = NRDOB(plant, model, 1 / gain, LowPassFilter(constant, 2))
    omega = np.geomspace(0.01, 100, 2001) * loop.filter.bandwidth
    S_d, S_eta, F = (np.abs(of(1j * omega)) for of in (loop.S_d, loop.S_eta, loop.F))
    return NoiseCase(float(rng.integers(7, 13)), omega, S_d, S_eta, F), loop


def _noise_lacks(case: NoiseCase, omega: float) -> str:
    if not omega > 0:
        return "a frequency in rad/s is asked for"
    worst = float(case.S_eta[case.omega >= 1.13 * omega].max(initial=0.0))
    if (reached := worst * case.size) >= 1:
        return f"beyond it |S_η| is still {worst:.3g}, and |Δ S_η| may reach {reached:.3g}"
    before = float(np.interp(omega / 1.13, case.omega, case.S_eta))
    if before * case.size < 1:
        return f"a little below it |Δ S_η| is at most {before * case.size:.3g}: go lower"
    return ""


NOISE_MAP = pose(
    "3.4",
    alike=partial(near, tolerance=log(1.13)),
    case=lambda rng: draw_noise_loop(rng)[0],
    reads=number,
    lacks=_noise_lacks,
    own=True,
    misconceptions={
        "filter's curve read instead of the noise map": reading(noise_readings, "F"),
        "disturbance map read instead of the noise map": reading(noise_readings, "S_d"),
        "bandwidth of the noise map": reading(noise_readings, "bandwidth"),
        "hertz for rad/s": put_right(
            lambda case: noise_readings(case)["right"] / (2 * pi), lambda got: 2 * pi * got
        ),
    },
)


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
    good = found.stable and 3.5 < fh.gm_high < inf and fh.pm > 60 and found.model_loop.pm > 45
    return bool(good and fh.gm_high > 1.3 * true.gm_high)


@fitting(_seems_robust)
def _gain_case(rng: np.random.Generator) -> GainCase:
    constant, gain = draw(rng, 0.05, 0.5), draw(rng, 0.5, 5)
    pole = draw(rng, 0.5, 3)
    model = ct.tf([gain], [1 / pole, 1])
    # Two kinds, so that no one number lies between the two margins of all loops.
    stronger = float(rng.choice([rng.uniform(1.1, 1.2), rng.uniform(1.8, 2.1)]))
    fast = rng.uniform(0.05, 0.12) * constant
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
    """A plant, its model, and what the loop should be able to do."""

    plant: ct.TransferFunction  # blocks of the loop
    model: ct.TransferFunction
    controller: ct.TransferFunction
    ms: float  # M_s of the plant loop may not be larger
    delay_margin: float  # may not be smaller, in seconds
    omega: float  # in rad/s
    rejection: float  # |S_d| may not be larger there

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
    stronger = rng.uniform(1.2, 1.5)
    plant = model * ct.tf([stronger], np.polymul([lag, 1], [lag, 1]))
    controller = ct.tf([1 / slow[0], 1], [4 * gain / slow[1], 0])
    good, omega = rng.uniform(3.5, 5) * lag, few(0.05 / lag)
    loops = [NRDOB(plant, model, controller, LowPassFilter(share * good, 2)) for share in SHARES]
    ms = float(np.ceil(100 * loops[0].margins().plant_loop.ms) / 100)
    delay_margin = few(loops[1].margins().plant_loop.delay_margin, 3)
    rejection = few(float(abs(loops[2].S_d(1j * omega))), 3)
    return MarginCase(plant, model, controller, ms, delay_margin, omega, rejection), good


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
