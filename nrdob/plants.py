r"""Example plants, from what an actuator takes to what a sensor reads, in SI units.

Where a source prints numbers, these are the defaults.
"""

from __future__ import annotations

from functools import reduce

import control as ct
import numpy as np

from .diagram import DelayedTransferFunction
from .drives import TwoMasses

__all__ = [
    "antiresonance", "heated_air", "lags", "motor_position", "motor_speed", "resonance",
    "two_masses",
]  # fmt: skip


def lags(*time_constants: float, gain: float = 1.0) -> ct.TransferFunction:
    r"""Lags in series, :math:`k/\prod_i(T_is+1)`.

    Parameters
    ----------
    *time_constants : float
        :math:`T_i`, in seconds; negative for an unstable pole.
    gain : float
        Gain k at zero frequency.

    Returns
    -------
    control.TransferFunction
        Of as many poles as there are lags.

    Examples
    --------
    >>> [round(float(c), 6) for c in lags(0.5, 0.1, gain=2.0).den[0][0]]
    [0.05, 0.6, 1.0]
    """
    return ct.tf([gain], reduce(np.convolve, [[T, 1.0] for T in time_constants], np.ones(1)))


def resonance(
    natural_frequency: float, damping: float, *, gain: float = 1.0
) -> ct.TransferFunction:
    r"""Give a damped oscillator, :math:`k/\big((s/\omega_0)^2+2\zeta s/\omega_0+1\big)`.

    Parameters
    ----------
    natural_frequency, damping : float
        :math:`\omega_0`, in rad/s, and damping ratio :math:`\zeta`, 0 for an undamped one.
    gain : float
        Gain k at zero frequency.

    Returns
    -------
    control.TransferFunction
        Of order 2.

    Examples
    --------
    >>> round(abs(complex(resonance(2.0, 0.05)(2j))), 6)      # 1/(2ζ) at resonance
    10.0
    """
    return ct.tf([gain], [natural_frequency**-2, 2 * damping / natural_frequency, 1.0])


def antiresonance(pole: float, zero: float, damping: float) -> ct.TransferFunction:
    r"""Give a resonance beside an antiresonance, as of a load on a spring, with gain 1 at s = 0.

    Parameters
    ----------
    pole, zero, damping : float
        Frequencies of resonance and antiresonance, in rad/s, and the damping ratio of both.

    Returns
    -------
    control.TransferFunction
        The factor that a plant is multiplied by.

    Examples
    --------
    >>> round(abs(complex(antiresonance(2.0, 1.0, 0.05)(1j))), 6)           # nearly nothing passes
    0.133038
    """
    return resonance(pole, damping) / resonance(zero, damping)


def motor_speed(
    inertia: float = 0.01, friction: float = 0.1, torque: float = 0.01, resistance: float = 1.0
) -> ct.TransferFunction:
    r"""Speed of a DC motor from its voltage, the inductance left out.

    From :math:`J\dot\omega + b\omega = K_ti` and :math:`v = Ri + K_t\omega` follows
    :math:`K_t/(RJs + Rb + K_t^2)`.

    Parameters
    ----------
    inertia, friction : float
        J of motor and load, in kg m², and b, in N m s.
    torque, resistance : float
        Torque constant :math:`K_t`, in N m/A, also the voltage at 1 rad/s, and R, in ohm.

    Returns
    -------
    control.TransferFunction
        From volt to rad/s.

    References
    ----------
    The numbers are those of the University of Michigan's Control Tutorials, "DC Motor Speed".

    Examples
    --------
    >>> round(float(motor_speed().dcgain()), 4)
    0.0999
    """
    return ct.tf([torque], [resistance * inertia, resistance * friction + torque**2])


def motor_position(
    inertia: float = 0.01, friction: float = 0.1, torque: float = 0.01, resistance: float = 1.0
) -> ct.TransferFunction:
    r"""Angle of a DC motor from its voltage: `motor_speed` and an integrator.

    Parameters
    ----------
    inertia, friction, torque, resistance : float
        As for `motor_speed`.

    Returns
    -------
    control.TransferFunction
        From volt to rad.

    Examples
    --------
    >>> sorted(round(float(p.real), 4) for p in motor_position().poles())
    [-10.01, 0.0]
    """
    speed = motor_speed(inertia, friction, torque, resistance)
    # An integrator multiplied in as a polynomial: its pole is 0 exactly.
    return ct.tf(speed.num[0][0], np.append(speed.den[0][0], 0.0))


def two_masses(
    motor: float, load: float, stiffness: float, damping: float = 0.0
) -> ct.TransferFunction:
    r"""Speed of a motor that drives its load through a shaft, see `nrdob.drives.TwoMasses.speed`.

    Parameters
    ----------
    motor, load, stiffness, damping : float
        As for `nrdob.drives.TwoMasses`.

    Returns
    -------
    control.TransferFunction
        From N m to rad/s.

    Examples
    --------
    The antiresonance is where the load swings on a motor that stands still, at √(k/Jl).

    >>> max(round(float(z.imag), 6) for z in two_masses(1e-3, 4e-3, 10.0).zeros())
    50.0
    """
    return TwoMasses(motor, load, stiffness, damping).speed()


def heated_air() -> DelayedTransferFunction:
    """Temperature of air blown through a heated tube, fitted to a laboratory record.

    Gain 0.93, lags of 0.27 s and 0.12 s, and a dead time of 0.16 s, two samples of 0.08 s.

    Returns
    -------
    DelayedTransferFunction
        In the units of the record, which it does not name.

    References
    ----------
    Fitted to the example data of routine IB01AD of the SLICOT library, whose length and levels are
    those of the hot-air trainer PT326 sampled at 0.08 s.

    Examples
    --------
    >>> heated_air().delay
    0.16
    """
    return DelayedTransferFunction(lags(0.27, 0.12, gain=0.93), 0.16)
