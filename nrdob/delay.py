"""Pure dead time, kept exact: a rational transfer function times exp(-sT)."""

from __future__ import annotations

from math import isfinite
from typing import Any

import control as ct
import numpy as np

from .blocks import ComplexArray, as_fraction


class DelayedTransferFunction:
    r"""A process with dead time, :math:`G(s) = G_0(s)\,e^{-sT}`.

    It multiplies and divides with `control.TransferFunction`, with numbers and with its own kind,
    so that a delayed plant is written as it is read.

    Parameters
    ----------
    tf : control.TransferFunction, control.StateSpace, number or (num, den)
        The rational part :math:`G_0`.
    delay : float
        The dead time :math:`T \ge 0`, in seconds.

    Raises
    ------
    ValueError
        If `delay` is negative or not finite, or the rational part is not SISO continuous-time.

    Examples
    --------
    >>> import control as ct
    >>> s = ct.tf('s')
    >>> G = delay(0.05) / (s + 2)**2
    >>> G.delay, [float(c) for c in G.tf.den[0][0]]
    (0.05, [1.0, 4.0, 4.0])
    >>> abs(G(2j)).round(6)
    np.float64(0.125)
    """

    __array_ufunc__ = None  # numpy scalars on the left then use __rmul__

    def __init__(self, tf: Any, delay: float) -> None:
        if not (isfinite(delay) and delay >= 0):
            raise ValueError(
                f"delay is {delay}; a dead time is a finite number of seconds, zero or positive "
                "(a negative one would predict the future)"
            )
        self.tf = ct.tf(*as_fraction(tf, "the rational part", proper=False))
        self.delay = float(delay)

    def __call__(self, s: complex | ComplexArray) -> Any:
        """Evaluate at complex `s`, a number or an array of any shape, in rad/s."""
        s = np.asarray(s, dtype=complex)
        (num,), (den,) = self.tf.num_array[0], self.tf.den_array[0]
        return np.polyval(num, s) / np.polyval(den, s) * np.exp(-self.delay * s)

    def __mul__(self, other: Any) -> DelayedTransferFunction:
        if isinstance(other, DelayedTransferFunction):
            return DelayedTransferFunction(self.tf * other.tf, self.delay + other.delay)
        if isinstance(other, ct.StateSpace | ct.TransferFunction) or np.isscalar(other):
            return DelayedTransferFunction(self.tf * _rational(other), self.delay)
        return NotImplemented

    __rmul__ = __mul__  # SISO blocks commute

    def __truediv__(self, other: Any) -> DelayedTransferFunction:
        if isinstance(other, DelayedTransferFunction):
            return DelayedTransferFunction(self.tf / other.tf, self.delay - other.delay)
        if isinstance(other, ct.StateSpace | ct.TransferFunction) or np.isscalar(other):
            return DelayedTransferFunction(self.tf / _rational(other), self.delay)
        return NotImplemented

    def __rtruediv__(self, other: Any) -> DelayedTransferFunction:
        return DelayedTransferFunction(_rational(other) / self.tf, -self.delay)

    def __neg__(self) -> DelayedTransferFunction:
        return DelayedTransferFunction(-self.tf, self.delay)

    def __repr__(self) -> str:
        num, den = (f"{list(map(float, c))}" for c in (self.tf.num[0][0], self.tf.den[0][0]))
        return f"DelayedTransferFunction(({num}, {den}), delay={self.delay})"


def delay(seconds: float) -> DelayedTransferFunction:
    """Pure dead time exp(-s·seconds), to be multiplied with a transfer function.

    Raises
    ------
    ValueError
        If `seconds` is negative or not finite.

    Examples
    --------
    >>> delay(2.0).delay
    2.0
    """
    return DelayedTransferFunction(1.0, seconds)


def _rational(block: Any) -> ct.TransferFunction:
    return ct.tf(*as_fraction(block, "the other factor", proper=False))
