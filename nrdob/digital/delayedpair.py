r"""Zeros outside the unit circle, counted from where two parts of a function are of equal size.

With one dead time of N samples the characteristic function is :math:`P + Q z^{-N}` with P and Q of
low degree. Where :math:`|P| > |Q|` its argument follows P, elsewhere :math:`Q z^{-N}`, both to
within a right angle. Between the crossings, roots of :math:`|P|^2 = |Q|^2`, the argument of P is a
sum over its zeros and that of z^-N is N times the angle. So the count is a closed form whatever N
is, as for dead times in continuous time (`nrdob.numerics.crossingcount`), and shares nothing with
the intervals of `nrdob.digital.unitcircle`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import nan, pi

import numpy as np

from ..numerics import ComplexArray, FloatArray, companion_roots
from .unitcircle import CircleFunction, Product, multiplied_out

__all__ = ["DelayedPair"]

WHOLE = 1e-3  # distance of a count from a whole number that is rounding
CLOSEST = 1e-9  # size of a sum at a crossing, against its parts, at which it may be 0
STARTS, STEPS, CONVERGED = 256, 50, 1e-9  # where the largest root is sought from, and for how long


@dataclass(frozen=True, eq=False)
class DelayedPair:
    """P + Q z^-N on the unit circle, polynomials of v of equal size, over (1 + v)^degree."""

    P: FloatArray
    Q: FloatArray
    samples: int

    @classmethod
    def of(cls, function: CircleFunction) -> DelayedPair | None:
        """Take a function apart; None if there is not one dead time in it."""
        if len(function.groups) != 2:
            return None
        early, late = function.groups
        more = max(term.samples for term in early.bare.terms + late.bare.terms)
        P, Q = (multiplied_out(group.bare.terms, more) for group in (early, late))
        return cls(P, Q, late.samples - early.samples)

    def count(self) -> int | None:
        """Count the zeros outside the unit circle; None if one may be on it."""
        angles = np.concatenate([[0.0], 2 * np.arctan(_equal_sizes(self.P, self.Q)), [pi]])
        P, Q = np.abs(self._parts((angles[:-1] + angles[1:]) / 2))
        leads = P >= Q
        late = self.samples * np.diff(angles)
        turned = np.where(leads, _turned(self.P, angles), _turned(self.Q, angles) - late)
        # From the larger part to the sum, at both ends of each stretch.
        ends = self._parts(angles)
        P, Q = np.stack([ends[:, :-1], ends[:, 1:]], axis=1)
        with np.errstate(all="ignore"):
            beside = 1 + np.where(leads, Q / P, P / Q)
        if not np.all(np.abs(beside) > CLOSEST):
            return None
        found = -float((turned + np.diff(np.angle(beside), axis=0)[0]).sum()) / pi
        return round(found) if abs(found - round(found)) < WHOLE else None

    def largest_root(self) -> complex:
        r"""Find the root z of largest modulus by Newton's method; nan if none is found.

        From the zeros of P, and from the angles at which Q is largest against P: with a long dead
        time roots are near them, :math:`N\,\ln z = \ln(-Q/P) + 2\pi jk`.
        """
        roots = companion_roots(np.trim_zeros(self.P, "f"))
        turns = np.linspace(0, pi, min(self.samples, 64 * STARTS) + 2)[1:-1]
        turns = np.concatenate([np.arange(1, 33) / (2 * self.samples), turns])
        P, Q = np.abs(self._parts(turns))
        with np.errstate(all="ignore"):
            near, ratio = np.log((1 + roots) / (1 - roots)), Q / P
            best = np.argsort(-ratio)[:STARTS]
            x = np.concatenate([near, np.log(ratio[best]) / self.samples + 1j * turns[best]])
            for _ in range(STEPS):
                step = self._newton(x)
                x = x - step
            x = x[np.abs(step) <= CONVERGED / self.samples]
        if not x.size:
            return complex(nan, nan)
        found = complex(x[x.real.argmax()])
        apart = abs(found.imag) > CONVERGED / self.samples
        return complex(np.exp(complex(found.real, abs(found.imag) if apart else 0.0)))

    def _parts(self, angle: FloatArray) -> ComplexArray:
        return np.stack([Product((self.P,))(angle), Product((self.Q,), self.samples)(angle)])

    def _newton(self, x: ComplexArray) -> ComplexArray:
        """Newton's step for P + Q z^-N in x = ln z."""
        v = np.tanh(x / 2)
        P, Q = (np.polyval(p, v) for p in (self.P, self.Q))
        by_P, by_Q = (np.polyval(np.polyder(p), v) * (1 - v**2) / 2 for p in (self.P, self.Q))
        late = np.exp(-self.samples * x)
        outside = np.abs(late) <= 1  # of 1/z^N or z^N what does not overflow
        early = np.where(outside, 1.0, 1 / late)
        late = np.where(outside, late, 1.0)
        slope = early * by_P + late * (by_Q - self.samples * Q)
        common = (self.P.size - 1) * (1 - v) / 2  # of (1 + v)^degree, which divides both
        value = early * P + late * Q
        return np.asarray(value / (slope - common * value))


def _equal_sizes(P: FloatArray, Q: FloatArray) -> FloatArray:
    """All y > 0 with |P(jy)| = |Q(jy)|, and a few more: roots of a polynomial in y²."""
    mirror = (-1.0) ** np.arange(P.size - 1, -1, -1)  # p(-s), of which every other power is left
    even = (np.convolve(P, P * mirror) - np.convolve(Q, Q * mirror))[::2]
    squares = np.trim_zeros(even * mirror, "f")
    if squares.size < 2:
        return np.empty(0)
    roots = companion_roots(squares)
    found = np.sqrt(roots.real[(roots.real > 0) & (np.abs(roots.imag) <= 1e-3 * roots.real)])
    return np.unique(found)


def _turned(p: FloatArray, angles: FloatArray) -> FloatArray:
    """How far p(v)/(1 + v)^degree turns from each angle to the next, a sum over its zeros."""
    roots, y = companion_roots(np.trim_zeros(p, "f")), np.tan(angles / 2)
    each = np.arctan2(y[:, None] - roots.imag, np.abs(roots.real))
    total = (each * np.where(roots.real > 0, -1.0, 1.0)).sum(axis=1)
    return np.diff(total - (p.size - 1) * angles / 2)
