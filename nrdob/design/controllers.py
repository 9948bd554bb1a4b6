"""A controller for the model loop: condition i of Lemmas 1 and 2 by classical loop shaping."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import asin, atan, ceil, degrees, inf, log, log10, radians, sin, tan
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import minimize_scalar

from ..analysis import Margins, judge, quotient_margins
from ..diagram import (
    Fraction,
    LoopEquations,
    LowPassFilter,
    as_fraction,
    nonzero,
    real_number,
    undelayed,
)
from ..numerics import ComplexArray, FloatArray, IntArray, QuasiPolynomial

__all__ = ["design_controller"]

SLOWEST_INTEGRAL = 5.0  # largest Ti·ω: the integral action takes at least 11°, atan(1/5)
LARGEST_RATIO = 10.0  # largest ratio of the two corners of the lead, derivative and its filter

INTEGRAL_LAG = degrees(atan(1 / SLOWEST_INTEGRAL))
MOST_AHEAD = degrees(asin((LARGEST_RATIO - 1) / (LARGEST_RATIO + 1))) - INTEGRAL_LAG
"""By how much a PID can be ahead at the crossover, in degrees: 43.6."""

CROSSOVERS, PER_DECADE = 48, 32  # crossovers tried, and frequencies of each loop, in a decade
ROUGH = 2.0  # how many degrees a phase margin read off the frequencies may be too small
LOWERED, LOWEST = 0.7, 1e-6  # step by which a gain is lowered, and the smallest tried
TRIED = 8  # samples of a run that are judged exactly until one is good


@dataclass(frozen=True)
class _Design:
    """A controller tried, and what became of the model loop."""

    controller: ct.TransferFunction
    found: Margins

    @classmethod
    def of(cls, model: Fraction, controller: ct.TransferFunction) -> _Design:
        """Judge the loop C·G̃."""
        filter = LowPassFilter(1.0, max(1, model.relative_degree))
        loop = LoopEquations(model, model, controller, filter)
        verdict = judge("C Gm", loop.CGm.den, loop.p_A, loop.ill_posed_model_loop)
        return cls(controller, quotient_margins(loop.CGm, verdict.stable))

    @property
    def integral_gain(self) -> float:
        """Limit of ``|s C|`` at s = 0."""
        num, den = self.controller.num[0][0], self.controller.den[0][0]
        return float(abs(num[-1] / den[-2]))

    def keeps(self, phase_margin: float, max_ms: float = inf) -> bool:
        """Tell whether the loop is stable with these margins."""
        enough = self.found.pm >= phase_margin * (1 - 1e-6)
        return bool(self.found.stable and enough and self.found.ms <= max_ms)


def design_controller(
    model: Any,
    *,
    bandwidth: float | None = None,
    phase_margin: float = 60.0,
    max_ms: float | None = None,
) -> ct.TransferFunction:
    r"""Design an I, PI or PID controller on the model, from bandwidth and phase margin.

    At the crossover ω the controller must supply the phase that is missing:
    :math:`\arg C(j\omega) = P_M - 180° - \arg\tilde G(j\omega)`. Between -90° and -11° a PI,
    :math:`k(1 + 1/(T_is))`, does so exactly; above that a PID with filter, up to 44° ahead; below
    -90° an integrator, with a larger margin than asked for. What comes out is verified.

    Near a resonance the loop can come close to -1 without a crossover: `max_ms` limits the peak of
    the sensitivity as well. The dead time of a delayed model stays outside of the loop that C
    closes, as in a Smith predictor.

    Parameters
    ----------
    model : as for `nrdob.NRDOB`
        G̃, with or without dead time.
    bandwidth : float, optional
        Crossover frequency of C·G̃, in rad/s. Without it, the PI, T_i > 0, of largest integral gain
        k/T_i that has the phase margin, where that margin limits the gain.
    phase_margin : float
        In degrees, between 0 and 90.
    max_ms : float, optional
        Largest peak of the sensitivity 1/(1 + C·G̃), above 1. Without a bandwidth, the gain is
        lowered until it is kept; with one, a controller that does not keep it is refused.

    Returns
    -------
    control.TransferFunction
        C, verified with the model.

    Raises
    ------
    TypeError, ValueError
        If the model cannot stand in the loop, or no controller of this kind does what is asked.

    Examples
    --------
    The model of Example 4 of the paper:

    >>> import control as ct
    >>> C = design_controller(ct.tf([1], [1, 4, 3.75]), bandwidth=1.0, phase_margin=68)
    >>> [round(float(k), 3) for k in C.num[0][0]]
    [1.772, 2.679]
    """
    fraction = nonzero(as_fraction(undelayed(model)[0], "model"), "model")
    options = {"bandwidth": bandwidth, "phase_margin": phase_margin, "max_ms": max_ms}
    for name, given in options.items():
        if given is not None:
            real_number(given, name, "give a real number")
    if not 0 < phase_margin < 90:
        raise ValueError(
            f"phase_margin is {phase_margin}; give an angle between 0 and 90 degrees, such as 60"
        )
    if max_ms is not None and not max_ms > 1:
        raise ValueError(f"max_ms is {max_ms}; a sensitivity peaks above 1, ask for 1.5 or so")
    if bandwidth is None:
        best = _largest_integral_gain(fraction, phase_margin)
        return _calmed(fraction, best, phase_margin, inf if max_ms is None else max_ms).controller
    remedy = "it is a frequency in rad/s, positive and finite"
    bandwidth = real_number(bandwidth, "bandwidth", remedy, above=0.0)
    missing = {sign: _missing_phase(fraction, bandwidth, phase_margin, sign) for sign in (1, -1)}
    tried = [
        _design(fraction, bandwidth, phase, sign)
        for sign, phase in missing.items()
        if phase <= MOST_AHEAD
    ]
    stable = [design for design in tried if design.found.stable]
    if not stable:
        ahead = [f"{phase:.1f}° ahead" for phase in missing.values() if phase > MOST_AHEAD]
        needed = f"; it had to be {ahead[0]}, a PID reaches {MOST_AHEAD:.1f}°" if ahead else ""
        raise ValueError(
            f"no PI or PID with crossover at {bandwidth:g} rad/s and a phase margin of "
            f"{phase_margin:g}° stabilises the model{needed}: choose another bandwidth"
        )
    best = max(stable, key=lambda design: design.found.pm)
    if not best.keeps(phase_margin):
        raise ValueError(
            f"|C·model| is 1 at {best.found.wgc:.4g} rad/s, too, where the phase margin is only "
            f"{best.found.pm:.1f}°: choose another bandwidth"
        )
    if max_ms is not None and best.found.ms > max_ms:
        raise ValueError(
            f"the sensitivity peaks at {best.found.ms:.4g}, at {best.found.wms:.4g} rad/s, above "
            f"max_ms = {max_ms:g}: choose another bandwidth, or a larger phase margin"
        )
    return best.controller


def _calmed(model: Fraction, design: _Design, phase_margin: float, max_ms: float) -> _Design:
    """Lower the gain until the sensitivity peaks at `max_ms` at most."""
    if design.found.ms <= max_ms:
        return design
    high, low = 1.0, LOWERED
    while not (best := _Design.of(model, low * design.controller)).keeps(phase_margin, max_ms):
        if low < LOWEST:
            raise ValueError(
                f"no lower gain brings the sensitivity peak below {max_ms:g}, it is "
                f"{design.found.ms:.4g} at {design.found.wms:.4g} rad/s: allow more, or give a "
                "bandwidth"
            )
        high, low = low, low * LOWERED
    while high - low > 1e-6 * high:
        middle = (low + high) / 2
        if (tried := _Design.of(model, middle * design.controller)).keeps(phase_margin, max_ms):
            low, best = middle, tried
        else:
            high = middle
    return best


def _missing_phase(model: Fraction, omega: Any, phase_margin: float, sign: int) -> Any:
    """Phase that the controller must have at each crossover, in degrees, from -270 to 90."""
    angle = np.degrees(np.angle(sign * _value(model, omega)))
    return (phase_margin - 180 - angle + 270) % 360 - 270


def _design(model: Fraction, omega: float, phase: float, sign: int) -> _Design:
    """Give the controller a phase and the loop a crossover, and see what becomes of it."""
    if phase <= -90:  # an integrator alone leaves more phase margin than asked for
        shape = ct.tf([1.0], [1.0, 0.0])
    elif phase <= -INTEGRAL_LAG:
        time = tan(radians(90 + phase)) / omega
        shape = ct.tf([time, 1.0], [time, 0.0])
    else:
        lead = sin(radians(phase + INTEGRAL_LAG))
        ratio = (1 + lead) / (1 - lead)  # of the two corners around the crossover
        slow, fast = ratio**0.5 / omega, 1 / (ratio**0.5 * omega)
        time = SLOWEST_INTEGRAL / omega
        shape = ct.tf(np.convolve([time, 1.0], [slow, 1.0]), np.convolve([time, 0.0], [fast, 1.0]))
    gain = sign / abs(complex(shape(1j * omega)) * complex(_value(model, omega)))
    return _Design.of(model, gain * shape)


def _largest_integral_gain(model: Fraction, phase_margin: float) -> _Design:
    """Find the PI of largest integral gain among those of every crossover frequency.

    In a run of crossovers that keep the phase margin the loop is either always stable or never: to
    change, it would have to pass -1. So one exact verdict judges a run.
    """
    omega = _frequencies(model, CROSSOVERS)
    found: list[_Design] = []
    # The margin may be just kept against a turn in either sense.
    for sign, turn in product((1, -1), (phase_margin, -phase_margin)):
        phase = _missing_phase(model, omega, turn, sign)
        slowest = -180 if turn > 0 else -90
        possible = (phase > slowest) & (phase <= -INTEGRAL_LAG)
        gain = np.where(possible, _integral_gain(model, omega, phase), 0.0)
        good = possible & (_smallest_rotations(model, omega, phase, sign) >= phase_margin - ROUGH)
        for run in np.split(np.arange(omega.size), 1 + np.flatnonzero(np.diff(good))):
            if good[run[0]]:
                found += _best_of_run(model, turn, sign, omega, gain, run)
    if not found:
        raise ValueError(
            f"no PI gives the model a phase margin of {phase_margin:g}°: give a bandwidth, so that "
            "a PID can be used, or lower the phase margin"
        )
    best = max(found, key=lambda design: design.integral_gain)
    if best.found.wgc > 0.9 * omega[-1]:
        raise ValueError(
            f"a phase margin of {phase_margin:g}° does not limit the bandwidth of this model: give "
            "a bandwidth in rad/s"
        )
    return best


def _best_of_run(
    model: Fraction, turn: float, sign: int, omega: FloatArray, gain: FloatArray, run: IntArray
) -> list[_Design]:
    """Refine the largest integral gain around the best sample of a run; empty if none is good."""

    def design(exponent: float) -> _Design:
        at = float(np.exp(exponent))
        return _design(model, at, _missing_phase(model, at, turn, sign), sign)

    def integral_gain(exponent: float) -> float:
        at = np.exp(exponent)
        return float(_integral_gain(model, at, _missing_phase(model, at, turn, sign)))

    def keeps(exponent: float) -> bool:
        return design(exponent).keeps(abs(turn))

    order = run[np.argsort(-gain[run], kind="stable")]
    # Beside the end of a run the rough margin may be a little too good.
    best = next((k for k in order[:TRIED].tolist() if keeps(log(omega[k]))), None)
    if best is None:
        return []
    inside = log(omega[best])
    ends = []
    for neighbour in (max(best - 1, 0), min(best + 1, omega.size - 1)):
        good, beyond = inside, log(omega[neighbour])
        if keeps(beyond):
            good = beyond  # the top may lie in between, but no end
        while abs(beyond - good) > 1e-9:
            middle = (good + beyond) / 2
            good, beyond = (middle, beyond) if keeps(middle) else (good, middle)
        ends.append(good)
    top = minimize_scalar(lambda x: -integral_gain(x), bounds=ends, method="bounded")
    tried = [design(x) for x in (inside, *ends, float(top.x))]
    return [each for each in tried if each.keeps(abs(turn))]


def _frequencies(model: Fraction, per_decade: int) -> FloatArray:
    """Frequencies from two decades below to two above the model's, dense beside resonances."""
    roots = np.concatenate([QuasiPolynomial(p).without_origin.roots for p in model])
    sizes = np.abs(roots) if roots.size else np.ones(1)
    low, high = sizes.min() / 100, sizes.max() * 100
    grids = [np.geomspace(low, high, ceil(per_decade * log10(high / low)) + 1)]
    for root in roots[roots.imag > 0]:
        width = max(abs(root.real), 1e-8 * abs(root))
        steps = np.geomspace(0.1 * width, abs(root), 16)
        grids += [root.imag + steps, root.imag - steps]
    omega = np.unique(np.concatenate(grids))
    return np.asarray(omega[(omega >= low) & (omega <= high)])


def _integral_gain(model: Fraction, omega: Any, phase: Any) -> FloatArray:
    """k/Ti of the PI, or k of the integrator, with a given phase at each crossover."""
    with np.errstate(divide="ignore"):  # at an undamped pole the gain is 0
        share = np.where(phase <= -90, 1.0, -np.sin(np.radians(phase)))
        return np.asarray(omega * share / np.abs(_value(model, omega)))


def _smallest_rotations(
    model: Fraction, omega: FloatArray, phase: FloatArray, sign: int
) -> FloatArray:
    """Roughly the smallest phase margin over all crossovers, for a PI at each frequency."""
    grid = _frequencies(model, PER_DECADE)
    with np.errstate(divide="ignore", invalid="ignore"):
        plant = sign * _value(model, grid)
        time = np.where(phase <= -90, 0.0, np.tan(np.radians(90 + phase)) / omega)
        gain = _integral_gain(model, omega, phase)
        L = gain[:, None] * (1 / (1j * grid) + time[:, None]) * plant
        size = np.log(np.abs(L))
        row, column = np.nonzero((size[:, 1:] >= 0) != (size[:, :-1] >= 0))
        before, after = size[row, column], size[row, column + 1]
        turn = np.angle(-L[row, column])
        step = np.angle(L[row, column + 1] / L[row, column])
        angle = np.abs(np.angle(np.exp(1j * (turn + before / (before - after) * step))))
    smallest = np.full(omega.shape, 180.0)
    np.minimum.at(smallest, row, np.degrees(np.nan_to_num(angle)))
    return smallest


def _value(model: Fraction, omega: Any) -> ComplexArray:
    """G̃(jω)."""
    s = 1j * np.asarray(omega)
    return np.asarray(np.polyval(model.num, s) / np.polyval(model.den, s))
