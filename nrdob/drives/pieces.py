r"""A linear motion over a stretch of time, as polynomials with enclosures.

Over a stretch T of a linear system z' = M z every signal g z is, to rounding, a polynomial of the
time :math:`\tau` in units of T, with the coefficients :math:`g\,(MT)^k/k!\;z`. In Bernstein's
form they enclose it: a signal whose Bernstein coefficients are not negative is not negative in the
stretch. Where one is, halving the stretch finds the first time at which the signal leaves, or that
it does not. So no event is missed, however short, and none is invented.

.. rubric:: References

Farouki, R. T., The Bernstein polynomial basis: a centennial retrospective, Computer Aided Geometric
Design 29 (2012) 379-419.
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil

import numpy as np
from scipy.interpolate import BPoly, PPoly
from scipy.optimize import brentq

from ..numerics import FloatArray

__all__ = ["Stretch", "first_exit", "stretches"]

LARGEST = 1.0  # largest modulus of an eigenvalue of M T
# Size of the last term of a series against its largest, and the most terms.
NEGLIGIBLE, HIGHEST = 1e-18, 40
NARROWEST = 2.0**-50  # share of a stretch at which it is halved no more


class Stretch:
    """The motion of z' = M z over a time, and signals that are watched.

    `guards`, shape (g, m), are rows of signals that are not to become negative; the time in seconds
    is short against the fastest mode (see `stretches`); only the first `states` of z move. The rows
    of `watched` give the states at the end, then the Bernstein coefficients of the signals.
    """

    def __init__(self, M: FloatArray, guards: FloatArray, time: float, states: int) -> None:
        self.time = time
        terms = [np.eye(len(M))]
        largest = np.abs(terms[0])
        while len(terms) <= HIGHEST:
            terms.append(terms[-1] @ M * (time / len(terms)))
            size = np.abs(terms[-1])
            largest = np.maximum(largest, size)
            if np.all(size <= NEGLIGIBLE * largest):
                break
        self._states = np.array(terms)[:, :states]
        self._signals = np.einsum("gi,kij->gkj", guards, terms)
        self._bernstein = _to_bernstein(len(terms) - 1)
        self._powers = np.arange(len(terms))
        enclosing = np.einsum("bk,gkj->gbj", self._bernstein, self._signals)
        self._sizes = np.abs(enclosing).max(axis=1)
        self.watched = np.vstack([self._states.sum(axis=0), *enclosing])

    def states_at(self, z: FloatArray, share: float) -> FloatArray:
        """Compute the states after a share of the stretch, shape (states,)."""
        return np.asarray(share**self._powers @ (self._states @ z))

    def crossing(self, z: FloatArray, value: float, share: float) -> float:
        """Find the share, up to the given one, at which the first state passes a value, once."""
        return float(brentq(lambda at: self.states_at(z, at)[0] - value, 0.0, share, xtol=1e-15))

    def exit(self, z: FloatArray, share: float) -> tuple[float, int] | None:
        """Find the first share, up to the given one, at which a signal leaves, and which does."""
        scale = share**self._powers
        tolerances = 16 * np.finfo(float).eps * (self._sizes @ np.abs(z))
        first: tuple[float, int] | None = None
        for guard, signal in enumerate(self._signals):
            enclosed = self._bernstein @ (scale * (signal @ z))
            at = first_exit(enclosed, float(tolerances[guard]))
            if at is not None and (first is None or at * share < first[0]):
                first = at * share, guard
        return first


def stretches(M: FloatArray, time: float) -> int:
    """Count the equal stretches into which a time, in seconds, is to be divided for a generator."""
    fastest = float(np.abs(np.linalg.eigvals(M)).max(initial=0.0))
    return max(1, ceil(fastest * time / LARGEST))


def first_exit(enclosed: FloatArray, tolerance: float) -> float | None:
    """Find where a polynomial on [0, 1] becomes negative, given by its Bernstein coefficients.

    The root before it is less than -tolerance for the first time; None if it never is.

    Examples
    --------
    The parabola (1 - 4t)(3 - 4t), with coefficients 3, -5, 3, and one that does not reach 0:

    >>> round(first_exit(np.array([3.0, -5.0, 3.0]), 1e-15), 12)
    0.25
    >>> first_exit(np.array([1.0, -0.9, 1.0]), 1e-15)
    """
    waiting = [(enclosed, 0.0, 1.0)]
    while waiting:
        b, low, width = waiting.pop()
        if b.min() >= -tolerance:
            continue
        if b[0] < 0 and (b[0] < -tolerance or width <= NARROWEST):
            return low
        falls = b[-1] < -tolerance and bool(np.all(np.diff(b) <= 0))
        if falls and b[0] >= 0:
            signal = BPoly(b[:, None], [0.0, 1.0])
            return low + width * brentq(signal, 0.0, 1.0, xtol=1e-16) if b[0] else low
        if width <= NARROWEST:
            return low
        left, right = _halves(b)
        waiting += [(right, low + width / 2, width / 2), (left, low, width / 2)]
    return None


def _halves(b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Write a polynomial over each half of its interval."""
    left, right = np.empty_like(b), np.empty_like(b)
    for i in range(b.size):
        left[i], right[-1 - i] = b[0], b[-1]
        b = 0.5 * (b[:-1] + b[1:])
    return left, right


@lru_cache
def _to_bernstein(degree: int) -> FloatArray:
    """Matrix from coefficients of powers to those of Bernstein's form, shape (K+1, K+1)."""
    powers = PPoly(np.eye(degree + 1)[::-1, np.newaxis], [0.0, 1.0])  # each for itself
    return np.asarray(BPoly.from_power_basis(powers).c[:, 0])
