"""A controller for the model loop: condition i of Lemmas 1 and 2 by classical loop shaping."""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, atan, degrees, isfinite, radians, sin, tan
from typing import Any

import control as ct
import numpy as np

from .blocks import Fraction, as_fraction, nonzero
from .equations import LoopEquations
from .filters import LowPassFilter
from .margins import Margins, margins
from .quasipoly import QuasiPolynomial
from .stability import judge

SLOWEST_INTEGRAL = 5.0
"""Largest Ti·ω: the integral action takes at least atan(1/5), 11°, at the crossover."""

LARGEST_RATIO = 10.0
"""Largest ratio of the two corners of the lead, derivative and its filter."""

INTEGRAL_LAG = degrees(atan(1 / SLOWEST_INTEGRAL))
MOST_AHEAD = degrees(asin((LARGEST_RATIO - 1) / (LARGEST_RATIO + 1))) - INTEGRAL_LAG
"""By how much a PID can be ahead at the crossover, in degrees: 43.6."""

TRIED = 120
"""Crossover frequencies tried for the largest integral gain."""


@dataclass(frozen=True)
class _Design:
    """A controller tried, and what became of the model loop."""

    controller: ct.TransferFunction
    integral_gain: float
    found: Margins


def design_controller(
    model: Any, *, bandwidth: float | None = None, phase_margin: float = 60.0
) -> ct.TransferFunction:
    r"""Design an I, PI or PID controller on the model, from bandwidth and phase margin.

    At the crossover ω the controller must supply the phase that is missing:
    :math:`\arg C(j\omega) = P_M - 180° - \arg\tilde G(j\omega)`. Between -90° and -11° a PI,
    :math:`k(1 + 1/(T_is))`, does so exactly; above that a PID with filter, up to 44° ahead; below
    -90° an integrator, with a larger margin than asked for. What comes out is verified.

    Parameters
    ----------
    model : control.TransferFunction, StateSpace or (num, den)
        G̃, proper, without dead time.
    bandwidth : float, optional
        Crossover frequency of C·G̃, in rad/s. Without it, the PI of largest integral gain k/T_i that
        has the phase margin.
    phase_margin : float
        In degrees, between 0 and 90.

    Returns
    -------
    control.TransferFunction

    Raises
    ------
    TypeError, ValueError
        If the model cannot stand in the loop, or no controller of this kind does what is asked;
        the message says what to change.

    Examples
    --------
    The model of Example 4 of the paper:

    >>> import control as ct
    >>> C = design_controller(ct.tf([1], [1, 4, 3.75]), bandwidth=1.0, phase_margin=68)
    >>> [round(float(k), 3) for k in C.num[0][0]]
    [1.772, 2.679]
    """
    fraction = nonzero(as_fraction(model, "model"), "model")
    if not 0 < phase_margin < 90:
        raise ValueError(
            f"phase_margin is {phase_margin}; give an angle between 0 and 90 degrees, such as 60"
        )
    if bandwidth is None:
        return _largest_integral_gain(fraction, phase_margin).controller
    if not (isfinite(bandwidth) and bandwidth > 0):
        raise ValueError(
            f"bandwidth is {bandwidth}; it is a frequency in rad/s, positive and finite"
        )
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
    if best.found.pm < phase_margin * (1 - 1e-6):
        raise ValueError(
            f"|C·model| is 1 at {best.found.wgc:.4g} rad/s, too, where the phase margin is only "
            f"{best.found.pm:.1f}°: choose another bandwidth"
        )
    return best.controller


def _missing_phase(model: Fraction, omega: float, phase_margin: float, sign: int) -> float:
    """Phase that the controller must have at the crossover, in degrees, from -270 to 90."""
    angle = degrees(float(np.angle(sign * _value(model, omega))))
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
    gain = sign / abs(complex(shape(1j * omega)) * _value(model, omega))
    controller = gain * shape
    loop = LoopEquations(
        model, model, controller, LowPassFilter(1.0, max(1, model.relative_degree))
    )
    verdict = judge("C Gm", loop.CGm.den, loop.p_A, loop.ill_posed_model_loop)
    integral = abs(gain * shape.num[0][0][-1] / shape.den[0][0][-2])
    return _Design(controller, float(integral), margins(loop.CGm, verdict.stable, loop.p_A))


def _largest_integral_gain(model: Fraction, phase_margin: float) -> _Design:
    roots = np.concatenate([QuasiPolynomial(p).without_origin.roots for p in model])
    sizes = np.abs(roots) if roots.size else np.ones(1)
    tried = np.geomspace(sizes.min() / 100, sizes.max() * 100, TRIED).tolist()
    designs = [
        _design(model, omega, phase, sign)
        for omega in tried
        for sign in (1, -1)
        if -180 < (phase := _missing_phase(model, omega, phase_margin, sign)) <= -INTEGRAL_LAG
    ]
    good = [d for d in designs if d.found.stable and d.found.pm >= phase_margin * (1 - 1e-6)]
    if not good:
        raise ValueError(
            f"no PI gives the model a phase margin of {phase_margin:g}°: give a bandwidth, so that "
            "a PID can be used, or lower the phase margin"
        )
    best = max(good, key=lambda design: design.integral_gain)
    if best.found.wgc > 0.9 * tried[-1]:
        raise ValueError(
            f"a phase margin of {phase_margin:g}° does not limit the bandwidth of this model: give "
            "a bandwidth in rad/s"
        )
    return best


def _value(model: Fraction, omega: float) -> complex:
    return complex(np.polyval(model.num, 1j * omega) / np.polyval(model.den, 1j * omega))
