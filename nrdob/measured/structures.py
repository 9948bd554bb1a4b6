r"""Which plants a record is compared with: one or two lags with dead time, or an integrator.

Each has few numbers that enter its response nonlinearly, and the rest linearly: the dead time
:math:`\theta`, and what fixes the denominator, are searched for; numerator, level and initial state
then follow by linear least squares.

An input that is held between samples is answered exactly, whatever the dead time.
Time is counted in samples. With the dead time :math:`\theta = d + f`, d whole and
:math:`0 \le f < 1`, the input switches f after each sample, so that the state of
:math:`\dot x = Ax + Bu(t - \theta)` goes from one sample to the next by

.. math:: x_{k+1} = e^Ax_k + \Gamma(1-f)\,u_{k-d} + e^{A(1-f)}\Gamma(f)\,u_{k-d-1},
          \qquad \Gamma(t) = \int_0^t e^{A\sigma}B\,d\sigma .

The response is continuous in the dead time.
"""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, expm1, floor, log, pi, sqrt

import numpy as np
from scipy.signal import lfilter

from ..numerics import FloatArray, transition

__all__ = ["STRUCTURES", "Structure", "free_responses", "held_responses"]

FASTEST_LAG = 0.05  # in samples: a faster lag is not seen
DAMPING = (0.003, 30.0)  # damping ratios looked at
EYE = np.eye(2)
RAMP = 100.0  # samples in which the ramp of an integrator's level grows by one


@dataclass(frozen=True)
class Structure:
    """A kind of plant: in words, with 0 to 2 lags, a pole at s = 0 or not, a zero or not."""

    name: str
    lags: int
    integrates: bool = False
    zero: bool = False

    @property
    def numerators(self) -> int:
        """How many coefficients the numerator has."""
        return 1 + self.zero

    @property
    def told(self) -> int:
        """How many numbers it is described by."""
        return 1 + self.lags + self.numerators

    def count(self, moving: bool) -> int:
        """How many numbers are fitted in all, level and initial state (if it moves) included."""
        return self.told + 1 + moving * (self.lags + self.integrates)

    def bounds(self, samples: int) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest `shape` in a record of so many samples."""
        slow = log(20.0 * samples)
        pairs = [(log(FASTEST_LAG), slow)] * self.lags
        if self.lags == 2:
            pairs = [(-slow, log(pi)), (log(DAMPING[0]), log(DAMPING[1]))]
        low, high = np.array([(0.0, 0.5 * samples), *pairs]).T
        return low, high

    def den(self, shape: FloatArray) -> list[float]:
        """Monic denominator, in samples; shape: dead time; ln T of a lag, or ln ω, ln ζ of two."""
        if self.lags == 2:
            omega, damping = exp(shape[1]), exp(shape[2])
            rest = [1.0, 2 * damping * omega, omega**2]
        else:
            rest = [1.0, *(exp(-lag) for lag in shape[1:])]
        return rest + [0.0] * self.integrates

    def slowest(self, shape: FloatArray) -> float:
        """Longest lag of a denominator, or inverse frequency of a resonance, in samples."""
        if self.lags < 2:
            return exp(shape[1]) if self.lags else 0.0
        damping = max(exp(shape[2]), 1.0)
        return (damping + sqrt(damping**2 - 1)) / exp(shape[1])

    def stretched(self, shape: FloatArray, factor: int) -> FloatArray:
        """Give a shape in samples that are shorter by a factor."""
        more = [-log(factor), 0.0] if self.lags == 2 else [log(factor)] * self.lags
        return np.array([shape[0] * factor, *(shape[1:] + more)])

    def shapes(self, samples: int) -> list[FloatArray]:
        """Denominators tried at first, without dead time."""
        lags = np.geomspace(0.3, samples / 3, 14)
        if self.lags == 0:
            return [np.zeros(1)]
        if self.lags == 1:
            return [np.array([0.0, log(lag)]) for lag in lags]
        real = [(a, b) for a in lags for b in lags if a <= b]
        found = [(1 / sqrt(a * b), (a + b) / sqrt(a * b) / 2) for a, b in real]
        found += [
            (omega, damping)
            for damping, many in ((0.05, 40), (0.2, 20), (0.6, 10))
            for omega in np.geomspace(6 / samples, 2.5, many)
        ]
        return [np.array([0.0, log(omega), log(damping)]) for omega, damping in found]

    def forced(self, shape: FloatArray, inputs: FloatArray) -> FloatArray:
        """Responses that the coefficients of the numerator multiply, shape (numerators, N)."""
        den = self.den(shape)
        found = held_responses(den, inputs, float(shape[0]), self.numerators)
        return found * next(c for c in den[::-1] if c)  # so that the first coefficient is a gain

    def columns(
        self, shape: FloatArray, inputs: FloatArray, start: int, moving: bool
    ) -> FloatArray:
        """All responses of which the output is a sum, shape (N - start, numerators + own)."""
        forced = self.forced(shape, inputs)[:, start:]
        return np.vstack([forced, self.own(shape, forced.shape[1], moving)]).T

    def own(self, shape: FloatArray, count: int, moving: bool) -> FloatArray:
        """Give what the plant does by itself: rest at a level or, moving, go on from any state."""
        level = np.ones((1, count))
        if not moving:
            return level
        # An integrator that moves has a level of u, too.
        ramp = np.arange(count)[None] / RAMP if self.integrates else level
        return np.vstack([free_responses(self.den(shape), count), ramp])


STRUCTURES = (
    Structure("integrator with dead time", 0, integrates=True),
    Structure("one lag with dead time", 1),
    Structure("integrator and lag with dead time", 1, integrates=True),
    Structure("two lags with dead time", 2),
    Structure("integrator, lag and zero with dead time", 1, integrates=True, zero=True),
    Structure("two lags and a zero with dead time", 2, zero=True),
)
"""From simple to rich."""


def held_responses(
    den: Sequence[float], inputs: FloatArray, delay: float = 0.0, most: int | None = None
) -> FloatArray:
    r"""Respond from rest, shape (n, N), with :math:`e^{-\theta s}s^i/D(s)` for i from 0 to n - 1.

    Den is the monic :math:`D(s)` of degree n, 1 or 2, descending; the input is zero before its
    first sample, shape (N,). Most is how many of the n are wanted. A lag of one sampling time after
    half a sample of dead time:

    >>> held_responses([1.0, 1.0], np.ones(3), 0.5).round(4)
    array([[0.    , 0.3935, 0.7769]])
    """
    whole = floor(delay)
    part = delay - whole
    if len(den) == 2:
        rate = den[1]
        before, now = (-expm1(-rate * t) / rate if rate else t for t in (part, 1 - part))
        taps = np.array([[0.0, now, exp(-rate * (1 - part)) * before]])
    else:
        A = np.array([[0.0, 1.0], [-den[2], -den[1]]])
        (early, late), (before, now) = transition(A, EYE[1], [part, 1 - part])
        before, step = late @ before, late @ early
        # (zI - step)^-1 applied to the two vectors, over the characteristic polynomial.
        turned = step - (step[0, 0] + step[1, 1]) * EYE
        taps = np.array([0 * now, now, turned @ now + before, turned @ before]).T
    shifted = np.concatenate([np.zeros(min(whole, inputs.size)), inputs[: -whole or None]])
    poles = _poles(den)
    return np.array([lfilter(row, poles, shifted[: inputs.size]) for row in taps[:most]])


def free_responses(den: Sequence[float], count: int) -> FloatArray:
    """Give a basis, shape (n, count), of what the output does by itself after any initial state."""
    found = np.zeros((len(den) - 1, count))
    found[0, 0] = 1.0
    found[0] = lfilter([1.0], _poles(den), found[0])
    found[1:, 1:] = found[0, :-1]
    return found


def _poles(den: Sequence[float]) -> list[float]:
    """Give the characteristic polynomial, descending, of the state from one sample to the next."""
    if len(den) == 2:
        return [1.0, -exp(-den[1])]
    mean = -den[1] / 2
    apart = cmath.sqrt(mean**2 - den[2])
    return [1.0, -(cmath.exp(mean + apart) + cmath.exp(mean - apart)).real, exp(-den[1])]
