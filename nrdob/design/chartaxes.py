"""The axes of a stability chart: which parameters there are, and what values they may have."""

from __future__ import annotations

from math import isfinite, log
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from ..numerics import FloatArray

__all__ = ["MANY_ROOTS", "PIXELS", "Axis", "check_value", "given_axis"]

AXES = {
    "time_constant": "λ of the filter, in seconds",
    "gain": "factor of the process",
    "delay": "dead time of the process, in seconds",
    "lag": "time constant of one more lag of the process, in seconds",
}
"""What may be on an axis."""

PIXELS = 320
"""Regions narrower than this part of the chart may be left out."""

MANY_ROOTS = 80
"""Where the curves of a dead time are too many there are so many roots on the right, at least."""

LOGARITHMIC = 20.0
"""Ratio of the ends of an axis from which it is logarithmic."""


class Axis(NamedTuple):
    """A parameter and its range.

    Attributes
    ----------
    name : str
        What is on the axis.
    low, high : float
        Its ends.
    """

    name: str
    low: float
    high: float

    @property
    def logarithmic(self) -> bool:
        """Whether the ends are decades apart."""
        return self.low > 0 and self.high >= LOGARITHMIC * self.low

    def share(self, values: Any) -> FloatArray:
        """Position of values between the ends, 0 to 1 within.

        Parameters
        ----------
        values : array_like of float
            Of the parameter.
        """
        values = np.asarray(values, dtype=float)
        if self.logarithmic:
            values = np.maximum(values, self.low / LOGARITHMIC)
            return np.asarray(np.log(values / self.low) / log(self.high / self.low))
        return np.asarray((values - self.low) / (self.high - self.low))

    def value(self, share: Any) -> FloatArray:
        """Values at positions.

        Parameters
        ----------
        share : array_like of float
            Positions between the ends, 0 to 1.
        """
        share = np.asarray(share, dtype=float)
        if self.logarithmic:
            return np.asarray(self.low * (self.high / self.low) ** share)
        return np.asarray(self.low + share * (self.high - self.low))


def given_axis(which: str, given: Any) -> Axis:
    """Read an axis, or say what is wrong with it."""
    if not (isinstance(given, tuple | list) and len(given) == 3):
        raise TypeError(f'{which} is {given!r}; give (name, low, high), as ("delay", 0.0, 1.0)')
    name, low, high = given
    if name not in AXES:
        known = ", ".join(f'"{each}" ({what})' for each, what in AXES.items())
        raise ValueError(f"{which} is {name!r}; it must be one of {known}")
    for end in (low, high):
        if isinstance(end, bool) or not isinstance(end, Real):
            raise TypeError(f"{which} reaches from {low!r} to {high!r}; give two real numbers")
    if not (isfinite(low) and isfinite(high) and 0 <= low < high):
        raise ValueError(
            f"{which} reaches from {low} to {high}; give two increasing numbers, 0 or above"
        )
    return Axis(name, float(low), float(high))


def check_value(name: str, value: Any) -> None:
    """Refuse a value that the parameter cannot have."""
    positive = name not in ("delay", "lag")
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} is {value!r}; give a real number")
    number = float(value)
    if not (isfinite(number) and (number > 0 if positive else number >= 0)):
        raise ValueError(
            f"{name} is {value}; it must be {'positive' if positive else '0 or above'}"
        )
