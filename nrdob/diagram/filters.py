"""Low-pass Q-filters, eq. (1) of the paper, and the check that any other filter must pass."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, log10, sqrt
from typing import Any

import control as ct
import numpy as np

from ..numerics import ComplexArray, FloatArray, QuasiPolynomial, count_rhp, is_whole, written
from .blocks import Fraction, as_fraction, real_number, six_digits

__all__ = ["TYPED_IN", "LowPassFilter", "filter_fraction", "unstable_pole"]

TYPED_IN = 8 * float(np.finfo(float).eps)  # of two coefficients that are meant to be the same
DC_GAIN_TOLERANCE = 1e-9  # how far F(0) may be from 1 and still count as a typed-in 1


@dataclass(frozen=True, repr=False)
class LowPassFilter:
    r"""Unity-gain low-pass filter :math:`F(s) = 1/(\lambda s + 1)^n`, eq. (1).

    Parameters
    ----------
    time_constant : float
        :math:`\lambda > 0`, in seconds.
    order : int
        :math:`n \ge 1`; at least the relative degree of the model, so that F/model is causal.

    Raises
    ------
    TypeError, ValueError
        If `time_constant` is no real number, positive and finite, or `order` no whole one from 1
        on; if a coefficient leaves the range of floating-point numbers.

    Examples
    --------
    >>> round(LowPassFilter(0.025, 2).bandwidth, 2)
    25.74
    """

    time_constant: float
    order: int

    def __post_init__(self) -> None:
        remedy = "F(s) = 1/(time_constant s + 1)^n needs a positive number of seconds"
        seconds = real_number(self.time_constant, "time_constant", remedy, above=0.0)
        object.__setattr__(self, "time_constant", seconds)
        if not is_whole(self.order):
            raise TypeError(f"order is {self.order!r}; it counts lags and must be a whole number")
        if self.order < 1:
            raise ValueError(f"order is {self.order}; F needs at least one lag: order >= 1")
        # The largest coefficient is below (1 + λ)^n, the smallest is 1 or λ^n.
        decades = max(log10(1 + self.time_constant), -log10(self.time_constant))
        if self.order > 300 / decades:
            raise ValueError(
                f"(λs + 1)^n with time_constant {self.time_constant:g} and order {self.order} has "
                "coefficients outside the range of floating-point numbers; choose another unit of "
                "time, or a lower order"
            )

    def __repr__(self) -> str:
        return f"LowPassFilter(time_constant={six_digits(self.time_constant)}, order={self.order})"

    @property
    def den(self) -> FloatArray:
        """Coefficients of (λs+1)^n, descending powers."""
        n = int(self.order)
        return np.array([comb(n, k) * self.time_constant**k for k in range(n, -1, -1)])

    @property
    def tf(self) -> ct.TransferFunction:
        """The filter as a `control.TransferFunction`."""
        return ct.tf([1.0], self.den)

    @property
    def bandwidth(self) -> float:
        """Frequency at which the gain has fallen to -3 dB (1/√2), in rad/s."""
        return sqrt(2 ** (1 / self.order) - 1) / self.time_constant

    def __call__(self, s: complex | ComplexArray) -> Any:
        """Evaluate at complex `s`, a number or an array of any shape."""
        return 1 / (self.time_constant * np.asarray(s, dtype=complex) + 1) ** self.order


def filter_fraction(filter: Any) -> Fraction:
    """Read a Q-filter, scaled so that both constant coefficients are exactly 1.

    Then 1 - F has its zero at s = 0 exactly, as the theory needs.

    Parameters
    ----------
    filter : LowPassFilter, control.TransferFunction, control.StateSpace or (num, den)
        Stable and proper, with F(0) = 1; a ValueError if it is not.
    """
    if isinstance(filter, LowPassFilter):
        return Fraction(np.ones(1), filter.den)
    num, den = as_fraction(filter, "filter")
    if (pole := unstable_pole(den)) is not None:
        raise ValueError(
            f"filter has a pole at {written(pole)}; F must be stable: every pole needs a negative "
            "real part"
        )
    dc_gain = num[-1] / den[-1]
    if abs(dc_gain - 1) > DC_GAIN_TOLERANCE:
        remedy = "divide it by its DC gain"
        if num.size == den.size == 1:
            remedy = f"for a time constant of that many seconds LowPassFilter({dc_gain:.6g}, 2)"
        raise ValueError(f"filter has F(0) = {dc_gain:.6g}; the observer needs 1: {remedy}")
    num, den = num / num[-1], den / den[-1]
    if num.size == den.size and (np.abs(den - num) <= TYPED_IN * (np.abs(den) + np.abs(num))).all():
        raise ValueError("filter is 1 at every frequency; F must fall off, such as LowPassFilter")
    return Fraction(num, den)


def unstable_pole(den: FloatArray) -> complex | None:
    """Find the rightmost root if it is not in the open left half plane."""
    p = QuasiPolynomial(den)
    stable = not p.zeros_at_origin and count_rhp(p).count == 0
    return None if stable else complex(p.roots[0])
