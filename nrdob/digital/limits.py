"""What an actuator and a converter make of a command: limits, rate, resolution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isfinite, isnan

import numpy as np

from ..numerics import FloatArray

__all__ = ["Limits", "Rule", "exactly", "limited", "rounded"]

FINEST = 2.0**-52
"""Resolution, against the size of a signal, that floating-point numbers have anyway."""


@dataclass(frozen=True)
class Limits:
    """Limits of an actuator: the range of u, and how fast u can change.

    Parameters
    ----------
    low, high : float
        Range of u, low < high; infinite where there is no limit.
    rate : float
        Largest change of u in one second, positive; infinite if there is no limit.

    Raises
    ------
    ValueError
        If the range is empty or the rate is not positive.

    Examples
    --------
    >>> Limits(0, 100, rate=25)
    Limits(low=0, high=100, rate=25)
    """

    low: float = -inf
    high: float = inf
    rate: float = inf

    def __post_init__(self) -> None:
        for name in ("low", "high", "rate"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float | np.number):
                raise TypeError(
                    f"{name} is {value!r}; limits are numbers in the unit of u, and inf where "
                    "there is none"
                )
        if isnan(self.low) or isnan(self.high) or not self.low < self.high:
            raise ValueError(
                f"the limits of u are low = {self.low:g} and high = {self.high:g}; low must be "
                "below high: is it Limits(low, high)?"
            )
        if not self.rate > 0:
            raise ValueError(
                f"the rate limit is {self.rate:g}; it is the largest change of u in a second and "
                "must be positive: leave it out (inf) if there is none"
            )


@dataclass(frozen=True)
class Rule:
    """How a number that is proposed becomes the one that is real.

    Attributes
    ----------
    apply : callable
        From the value proposed and the one that was real a sample ago, to the real one.
    leaves : callable
        Whether values proposed for some samples on end, shape (m,), after the real one before
        them, all stay as they are.
    """

    apply: Callable[[float, float], float]
    leaves: Callable[[FloatArray, float], bool]


def limited(limits: Limits, dt: float, resolution: float | None = None) -> Rule:
    """Make of a command what the actuator does: rate first, then range, then resolution.

    Parameters
    ----------
    limits : Limits
        The actuator.
    dt : float
        Sampling time in seconds.
    resolution : float, optional
        Step of the converter that writes u.

    Examples
    --------
    >>> rule = limited(Limits(-1, 1, rate=10), 0.05)
    >>> rule.apply(3.0, 0.0), rule.apply(3.0, 0.8)
    (0.5, 1.0)
    """
    low, high, step = float(limits.low), float(limits.high), float(limits.rate) * dt
    converted = exactly if resolution is None else rounded(resolution)

    def apply(value: float, before: float) -> float:
        if value > before + step:
            value = before + step
        elif value < before - step:
            value = before - step
        if value > high:
            value = high
        elif value < low:
            value = low
        return value

    def apply_and_convert(value: float, before: float) -> float:
        return converted.apply(apply(value, before), before)

    def leaves(values: FloatArray, before: float) -> bool:
        if not (values.max() <= high and values.min() >= low):
            return False
        if isfinite(step):
            if not abs(values[0] - before) <= step:
                return False
            return bool(np.abs(values[1:] - values[:-1]).max(initial=0.0) <= step)
        return True

    if resolution is not None:
        return Rule(apply_and_convert, converted.leaves)
    return Rule(apply, leaves)


def rounded(resolution: float) -> Rule:
    """Make of a signal what a converter does: whole multiples of its resolution, ties to even.

    Parameters
    ----------
    resolution : float
        The step, in the unit of the signal.

    Raises
    ------
    ValueError
        If it is not positive and finite.

    Examples
    --------
    >>> rounded(0.25).apply(1.2, 0.0)
    1.25
    """
    if not (isfinite(resolution) and resolution > 0):
        raise ValueError(
            f"the resolution is {resolution:g}; it is one step of a converter, positive, in the "
            "unit of the signal: leave it out if nothing is rounded"
        )

    def apply(value: float, _: float) -> float:
        if abs(value) * FINEST < resolution:
            return round(value / resolution) * resolution
        return value

    return Rule(apply, lambda values, before: False)


exactly = Rule(lambda value, before: value, lambda values, before: True)
"""The rule of what is not limited at all."""
