r"""What a motor turns: one inertia, or two with a shaft between them.

With the motor's torque :math:`\tau`, the load's torque :math:`\delta` and the twist
:math:`\psi=\theta_m-\theta_l`,

.. math:: J_m\dot\omega_m=\tau-b\,\omega_m-T,\qquad J_l\dot\omega_l=T+\delta,\qquad
    T=k\psi+c\,\dot\psi

The motor sees an *antiresonance* :math:`\sqrt{k/J_l}`, where the load swings on a motor that stands
still, and a *resonance* :math:`\sqrt{k(1/J_m+1/J_l)}`, where both swing against each other. Their
ratio :math:`\sqrt{1+J_l/J_m}` knows the inertias only. Resonance-ratio control makes the motor's
inertia look another one, so that it is about :math:`\sqrt5` (Yuki, Murakami, Ohnishi, Proc. IECON
1993). An observer does so by itself, below the bandwidth of its filter, if its *model* is a drive
with that ratio: it makes the plant behave like the model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, sqrt

import control as ct
import numpy as np

from ..diagram import real_number

__all__ = ["OneMass", "TwoMasses"]


@dataclass(frozen=True)
class OneMass:
    """A rigid drive: all that turns is one inertia.

    Parameters
    ----------
    inertia : float
        J of motor and load together, in kg m².

    Examples
    --------
    >>> OneMass(0.01)
    OneMass(inertia=0.01)
    """

    inertia: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "inertia", _positive(self.inertia, "inertia", "kg m²"))


@dataclass(frozen=True)
class TwoMasses:
    """A motor that turns its load through a shaft that gives way.

    Parameters
    ----------
    motor, load : float
        Inertias, in kg m².
    stiffness, damping : float
        k of the shaft, in N m/rad, and its c, in N m s/rad.

    Examples
    --------
    >>> drive = TwoMasses(1e-3, 4e-3, 10.0)
    >>> round(drive.resonance, 3)                      # √(1 + 4) times the antiresonance, 50 rad/s
    111.803
    """

    motor: float
    load: float
    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("motor", "kg m²"), ("load", "kg m²"), ("stiffness", "N m/rad")):
            object.__setattr__(self, name, _positive(getattr(self, name), name, unit))
        if self.damping != 0:
            object.__setattr__(self, "damping", _positive(self.damping, "damping", "N m s/rad"))

    @property
    def resonance(self) -> float:
        """Frequency at which both swing against each other, undamped, in rad/s."""
        return sqrt(self.stiffness * (1 / self.motor + 1 / self.load))

    def with_resonance_ratio(self, ratio: float) -> TwoMasses:
        """Exchange the motor for one that makes another ratio with the same shaft and load.

        As the model of an NR-DOB this is resonance-ratio control: the antiresonance belongs to load
        and shaft and stays, the resonance goes where the model has it.

        Parameters
        ----------
        ratio : float
            Resonance over antiresonance, above 1: √(1 + load/motor); √5 is customary.

        Examples
        --------
        >>> round(TwoMasses(4e-3, 4e-3, 10.0).with_resonance_ratio(5**0.5).motor, 6)
        0.001
        """
        ratio = real_number(ratio, "ratio", "give one above 1, such as 5**0.5", above=1.0)
        return replace(self, motor=self.load / (ratio**2 - 1))

    def speed(self, viscous: float = 0.0) -> ct.TransferFunction:
        r"""Give the motor's speed in rad/s from its torque in N m.

        With b = 0 it is :math:`(J_ls^2+cs+k)/\bigl(s(J_mJ_ls^2+(J_m+J_l)(cs+k))\bigr)`.

        Parameters
        ----------
        viscous : float
            Viscous friction b of the motor, in N m s.
        """
        own, total = np.array([self.load, self.damping, self.stiffness]), self.motor + self.load
        free = [self.motor * self.load, total * self.damping, total * self.stiffness, 0.0]
        return ct.tf(own, np.polyadd(free, viscous * own))


def _positive(value: float, name: str, unit: str) -> float:
    number = real_number(value, name, f"give a number in {unit}")
    if not 0 < number < inf:
        remedy = "a drive without load is OneMass(inertia)" if name == "load" else "check its sign"
        raise ValueError(f"{name} is {number:g} {unit}; it must be positive and finite: {remedy}")
    return number
