r"""Condition ii of Lemma 1 for many plants at once, certified.

Model, filter and controller are the same for all of them, so that condition i is judged once, and

.. math:: p_B = D\,(N_m' E) + N\,(D_m' N_f')\,e^{-\theta s}

is a sum of two products with fixed polynomials. Without dead time it is Routh's test that decides,
with dead time, or where a sign in Routh's array is not certain, the argument along the axis. Both
allow the coefficients to be off by what `nrdob.numerics` calls rounding: what is so close to the
border that this matters is left to `nrdob.NRDOB.stability`.
"""

from __future__ import annotations

from functools import cached_property
from math import prod

import numpy as np

from ..diagram import LoopEquations, ObserverEquations
from ..numerics import (
    ROUNDING,
    BoolArray,
    ComplexArray,
    FloatArray,
    ManyTerms,
    QuasiPolynomial,
    convolved,
    hurwitz,
    multiply,
    padded_sum,
    rhp_counts,
    values_and_slopes,
)
from .batch import PlantBatch

__all__ = ["SLAB", "Feedback"]

SLAB = 500  # plants looked at together: what they need fits into the cache


class Feedback:
    """All of a loop that does not depend on the plant."""

    def __init__(self, loop: LoopEquations | ObserverEquations) -> None:
        built = loop.built
        self.zeros = (built.Nf, built.Dm)
        self.poles = (built.E, built.Nm)
        self.numerator = multiply(*self.zeros)
        self.denominator = multiply(*self.poles)

    @cached_property
    def delayed(self) -> bool:
        """Whether the model has a dead time."""
        return self.denominator.delay > 0

    @cached_property
    def zeros_at_origin(self) -> int:
        """Power of s in K; negative for poles."""
        power = sum(factor.zeros_at_origin for factor in self.zeros)
        return power - sum(factor.zeros_at_origin for factor in self.poles)

    @cached_property
    def level(self) -> float:
        """K without that power of s, at s = 0."""
        zeros, poles = (
            prod(factor.without_origin.constant for factor in factors)
            for factors in (self.zeros, self.poles)
        )
        return zeros / poles

    def gain_and_slope(self, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Evaluate K(jω), and dK/ds over K there."""
        parts = []
        for p in (self.numerator, self.denominator):
            value = slope = np.zeros(1, dtype=complex)
            for q, delay in p.terms:
                at, rising = values_and_slopes(q, omega)
                late = np.exp(-1j * delay * omega) if delay else 1.0
                value, slope = value + at * late, slope + (rising - delay * at) * late
            parts.append((value, slope / value))
        (num, rises), (den, its_rises) = parts
        return np.asarray(num / den), np.asarray(rises - its_rises)

    def characteristic(self, plants: PlantBatch) -> tuple[list[ManyTerms], FloatArray]:
        """Terms of p_B, and for each power of s the size of what is summed."""
        products = [
            (convolved(plants.den, _column(p)), np.full(1, delay))
            for p, delay in self.denominator.terms
        ]
        late = convolved(plants.num, _column(self.numerator.q))
        size = convolved(np.abs(plants.den), _column(self._sizes[0]))
        scale = padded_sum(size, convolved(np.abs(plants.num), _column(self._sizes[1])))
        if not plants.delay.any():
            (prompt, none), *others = products
            products = [(padded_sum(prompt, late), none), *others]
        else:
            products.append((late, plants.delay))
        return [ManyTerms(q, delay) for q, delay in products], scale

    @cached_property
    def _sizes(self) -> tuple[FloatArray, FloatArray]:
        """Sizes of what is multiplied with denominator and numerator of the plant."""
        first, second = (
            multiply(*(QuasiPolynomial(p.scale) for p in factors)).q
            for factors in (self.poles, self.zeros)
        )
        return first, second

    def verdicts(self, plants: PlantBatch) -> tuple[BoolArray, BoolArray]:
        """Tell for which plants of one degree p_B is certainly stable, and unstable."""
        terms, scale = self.characteristic(plants)
        n = scale.shape[1]
        q = terms[0].q
        if q.shape[0] < scale.shape[0]:  # advanced, or ill-posed: not for arrays
            return np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        if len(terms) == 1:
            stable, unstable = hurwitz(q, ROUNDING * scale)
        else:
            stable, unstable = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        well_posed = np.abs(q[0]) > ROUNDING * scale[0]
        unstable |= well_posed & (np.sum([term.q[-1] != 0 for term in terms], axis=0) == 0)
        unsure = np.flatnonzero(~(stable | unstable))
        for first in range(0, unsure.size, SLAB):
            few = unsure[first : first + SLAB]
            counts = rhp_counts([term.of(few) for term in terms], scale[:, few])
            stable[few], unstable[few] = counts == 0, counts > 0
        return stable, unstable


def _column(p: FloatArray) -> FloatArray:
    return p[:, None]
