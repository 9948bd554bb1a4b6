r"""Many plants as arrays of coefficients, and condition ii of Lemma 1 for all, certified.

Model, filter and controller are the same for all plants, so that condition i is judged once, and

.. math:: p_B = D\,(N_m' E) + N\,(D_m' N_f')\,e^{-\theta s}

is a sum of two products with fixed polynomials, in an array for plants of the same degrees. Without
dead time Routh's test decides; with it, or where a sign in Routh's array is not certain, the
argument along the axis. What is within rounding of the border is left to `nrdob.NRDOB.stability`.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from math import prod
from typing import Any, NamedTuple

import control as ct
import numpy as np

from ..diagram import (
    DelayedTransferFunction,
    LoopEquations,
    ObserverEquations,
    as_fraction,
    undelayed,
)
from ..numerics import (
    ROUNDING,
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    ManyTerms,
    QuasiPolynomial,
    convolved,
    hurwitz,
    multiply,
    padded_sum,
    rhp_counts,
    values_and_slopes,
)

__all__ = ["SLAB", "Feedback", "PlantBatch"]

SLAB = 500  # plants looked at together: what they need fits into the cache


class PlantBatch(NamedTuple):
    """Numerators and denominators (k, n), descending, and dead times (n,): plants in columns."""

    num: FloatArray
    den: FloatArray
    delay: FloatArray

    def of(self, chosen: IntArray) -> PlantBatch:
        """Take the columns of these numbers."""
        return PlantBatch(self.num[:, chosen], self.den[:, chosen], self.delay[chosen])

    def groups(self) -> Iterator[tuple[IntArray, PlantBatch]]:
        """Proper plants of finite numbers by degrees, and with or without dead time: which."""
        finite = np.isfinite(self.num).all(axis=0) & np.isfinite(self.den).all(axis=0)
        causal = np.isfinite(self.delay) & (self.delay >= 0)
        num, den = (np.argmax(c != 0, axis=0) for c in (self.num, self.den))
        proper = self.den.shape[0] - den >= self.num.shape[0] - num
        given = self.num.any(axis=0) & self.den.any(axis=0)
        usable = np.flatnonzero(finite & causal & given & proper)
        key = np.stack([num[usable], den[usable], self.delay[usable] > 0])
        for kind in np.unique(key, axis=1).T:
            chosen = usable[(key == kind[:, None]).all(axis=0)]
            few = self.of(chosen)
            yield chosen, few._replace(num=few.num[kind[0] :], den=few.den[kind[1] :])

    def plant(self, k: int) -> ct.TransferFunction | DelayedTransferFunction:
        """Return one as a block that `nrdob.NRDOB` takes; ValueError if it is none."""
        num, den = as_fraction((self.num[:, k], self.den[:, k]), "the plant", proper=False)
        plant = ct.tf(num, den)
        delay = float(self.delay[k])
        return DelayedTransferFunction(plant, delay) if delay else plant

    @classmethod
    def of_blocks(cls, blocks: list[Any]) -> PlantBatch:
        """Gather plants of any degrees; nan where one is None."""
        read = [_read(block) for block in blocks]
        tables = []
        for part in (0, 1):
            rows = [fraction[part] for fraction, _ in read]
            size = max(row.size for row in rows)
            tables.append(np.array([np.pad(row, (size - row.size, 0)) for row in rows]).T)
        num, den = tables
        return cls(num, den, np.array([delay for _, delay in read]))


def _read(block: Any) -> tuple[tuple[FloatArray, FloatArray], float]:
    if block is None:
        return (np.full(1, np.nan), np.ones(1)), 0.0
    prompt, delay = undelayed(block)
    return as_fraction(prompt, "the plant", proper=False), delay


class Feedback:
    """All of a loop that does not depend on the plant."""

    def __init__(self, loop: LoopEquations | ObserverEquations) -> None:
        built = loop.built
        self.zeros = (built.Nf, built.Dm)
        self.poles = (built.E, built.Nm)
        self.numerator = multiply(*self.zeros)
        self.denominator = multiply(*self.poles)

    @cached_property
    def lowest(self) -> tuple[float, int]:
        """Value and power of s that K tends to at s = 0."""
        (zeros, power), (poles, order) = (
            (prod(p.without_origin.constant for p in part), sum(p.zeros_at_origin for p in part))
            for part in (self.zeros, self.poles)
        )
        return zeros / poles, power - order

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
