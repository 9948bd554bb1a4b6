r"""Dry friction: what it is at each speed, what a loop sees of it, and what may be fed forward.

At rest friction gives whatever torque holds the shaft, up to the stiction :math:`F_s`. In motion it
opposes the speed :math:`\omega`,

.. math:: f(\omega)=\operatorname{sign}(\omega)\Bigl(F_c+(F_s-F_c)\max\bigl(0,\,1-
    \tfrac{|\omega|}{\omega_s}\bigr)\Bigr)+b\,\omega

with Coulomb's :math:`F_c`, the viscous b, and Stribeck's fall from :math:`F_s` to :math:`F_c` over
the first :math:`\omega_s` of speed. That fall is straight here, so that between events a drive is
linear and its motion exact; with :math:`\omega_s=0` it happens at once.

.. rubric:: References

Armstrong-Hélouvry, B., P. Dupont, C. Canudas de Wit, A survey of models, analysis tools and
compensation methods for the control of machines with friction, Automatica 30 (1994) 1083-1138.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, cos, pi, sin

import numpy as np
from numpy.typing import ArrayLike

from ..diagram import real_number
from ..numerics import FloatArray

__all__ = ["Friction"]


@dataclass(frozen=True)
class Friction:
    """Friction of a shaft: Coulomb, stiction, Stribeck's fall between them, and viscous.

    Parameters
    ----------
    coulomb, viscous : float
        Torque in motion, in N m, and what is added to it for each rad/s, in N m s.
    stiction : float, optional
        Largest torque at rest, at least `coulomb`, in N m; by default the same.
    stribeck_speed : float
        Speed at which stiction has fallen to Coulomb friction, in rad/s; 0 if at once.

    Examples
    --------
    >>> friction = Friction(0.10, 0.15, stribeck_speed=0.2, viscous=0.1)
    >>> friction.torque([-1.0, 0.1, 1.0]).round(6).tolist()
    [-0.2, 0.135, 0.2]
    """

    coulomb: float = 0.0
    stiction: float | None = None
    stribeck_speed: float = 0.0
    viscous: float = 0.0

    def __post_init__(self) -> None:
        remedy = (
            "friction takes energy out, so it must be a number, 0 or more and finite: give its "
            "size, the sign follows the speed"
        )
        for name, given in vars(self).copy().items():
            if given is not None:
                object.__setattr__(self, name, real_number(given, name, remedy, least=0.0))
        if self.breakaway < self.coulomb:
            raise ValueError(
                f"stiction is {self.breakaway:g} N m, below the Coulomb friction of "
                f"{self.coulomb:g} N m: Stribeck's curve falls from stiction to Coulomb friction; "
                "exchange them, or leave stiction out"
            )

    @property
    def breakaway(self) -> float:
        """Torque at which a shaft at rest begins to move, in N m."""
        return self.coulomb if self.stiction is None else self.stiction

    @property
    def slope(self) -> float:
        """How fast Stribeck's part falls, in N m s; 0 where it falls at once."""
        drop = self.breakaway - self.coulomb
        return drop / self.stribeck_speed if self.stribeck_speed else 0.0

    def torque(self, speed: ArrayLike) -> FloatArray:
        """Compute the torque in N m that opposes a motion; 0 at rest, where it is what it must be.

        Parameters
        ----------
        speed : array_like
            In rad/s.
        """
        omega = np.asarray(speed, dtype=float)
        size = np.abs(omega)
        above = self.breakaway - self.coulomb - self.slope * size
        dry = self.coulomb + np.where(size < self.stribeck_speed, above, 0.0)
        return np.asarray(np.sign(omega) * dry + self.viscous * omega)

    def describing_function(self, amplitude: float) -> float:
        r"""Give the gain of the first harmonic in N m s, for a speed :math:`A\sin\varphi`.

        Coulomb friction has :math:`4F_c/(\pi A)`: like viscous friction, the more of it the smaller
        the motion. The friction force is in phase with the speed, so the gain is real.

        Parameters
        ----------
        amplitude : float
            A of the speed, positive, in rad/s. The shaft does not stop in between.

        Examples
        --------
        >>> round(Friction(0.1).describing_function(0.5) * np.pi * 0.5 / 4, 6)
        0.1
        """
        remedy = "give a positive, finite amplitude of the speed, in rad/s"
        A = real_number(amplitude, "amplitude", remedy, above=0.0)
        gain = 4 * self.coulomb / (pi * A) + self.viscous
        if self.slope:
            until = asin(min(1.0, self.stribeck_speed / A))
            falling = 1 - cos(until) - A / self.stribeck_speed * (until - sin(2 * until) / 2) / 2
            gain += 4 * (self.breakaway - self.coulomb) / (pi * A) * falling
        return gain

    def feedforward(self, speed: ArrayLike) -> FloatArray:
        """Give the dry friction in N m at a planned speed, to be added to the torque.

        An observer must receive the applied torque *without* it: what is fed forward and what
        friction takes then cancel before the observer sees either.

        Parameters
        ----------
        speed : array_like
            The speed that the reference plans, in rad/s. At 0 nothing is fed forward.

        Examples
        --------
        >>> Friction(0.1, viscous=2.0).feedforward([-3.0, 0.0, 3.0]).round(6).tolist()
        [-0.1, 0.0, 0.1]
        """
        return np.asarray(self.torque(speed) - self.viscous * np.asarray(speed, dtype=float))
