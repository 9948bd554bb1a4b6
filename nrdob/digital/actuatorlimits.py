"""Range and rate of an actuator, and the resolution of a converter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isinf

import numpy as np

from ..diagram import real_number
from ..numerics import FloatArray

__all__ = ["ActuatorLimits", "Rule", "limited", "rounded"]

FINEST = 2.0**-52  # resolution, against a signal's size, of floating-point numbers


@dataclass(frozen=True)
class ActuatorLimits:
    """Range of u and rate of an actuator, infinite where there is no limit.

    Parameters
    ----------
    low, high : float
        Range of u, low < high.
    rate : float
        Largest change of u in one second, positive.

    Raises
    ------
    ValueError
        If the range is empty or the rate is not positive.

    Examples
    --------
    >>> ActuatorLimits(0, 100, rate=25)
    ActuatorLimits(low=0, high=100, rate=25)
    """

    low: float = -inf
    high: float = inf
    rate: float = inf

    def __post_init__(self) -> None:
        remedy = "limits are numbers in the unit of u, and inf where there is none"
        low, high, rate = (
            real_number(getattr(self, name), name, remedy) for name in ("low", "high", "rate")
        )
        if not low < high:
            raise ValueError(
                f"the limits of u are low = {low:g} and high = {high:g}; low must be below high: "
                "is it ActuatorLimits(low, high)?"
            )
        if not rate > 0:
            raise ValueError(
                f"the rate limit is {rate:g}; it is the largest change of u in a second and "
                "must be positive: leave it out (inf) if there is none"
            )


@dataclass(frozen=True)
class Rule:
    """How a proposed number becomes the actual one; whether many proposed in turn all stay."""

    apply: Callable[[float, float], float]
    leaves: Callable[[FloatArray, float], bool]


def limited(limits: ActuatorLimits, dt: float) -> Rule:
    """Give the rule of an actuator, `apply(command, before)`: rate first, then range.

    Examples
    --------
    >>> rule = limited(ActuatorLimits(-1, 1, rate=10), 0.05)
    >>> rule.apply(3.0, 0.0), rule.apply(3.0, 0.8)
    (0.5, 1.0)
    """
    low, high, step = float(limits.low), float(limits.high), float(limits.rate) * dt

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

    def leaves(values: FloatArray, before: float) -> bool:
        inside = bool(values.max() <= high and values.min() >= low)
        if not inside or isinf(step):
            return inside
        return bool(np.abs(np.diff(values, prepend=before)).max() <= step)

    return Rule(apply, leaves)


def rounded(resolution: float) -> Rule:
    """Round a signal as a converter does: whole multiples of its resolution, ties to even."""
    remedy = (
        "it is one step of a converter, positive, in the unit of the signal: leave it out if "
        "nothing is rounded"
    )
    resolution = real_number(resolution, "the resolution", remedy, above=0.0)

    def apply(value: float, _: float) -> float:
        if abs(value) * FINEST < resolution:
            return round(value / resolution) * resolution
        return value

    return Rule(apply, lambda values, before: False)
