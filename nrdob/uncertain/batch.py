"""Many plants as one array of coefficients each for numerators and denominators.

Plants of the same degrees stand together; what no array can hold (an improper plant, one whose
coefficients are no numbers) is left to be looked at by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import control as ct
import numpy as np

from ..diagram import DelayedTransferFunction, as_fraction, undelayed
from ..numerics import BoolArray, ComplexArray, FloatArray, IntArray, convolved

__all__ = ["Moving", "PlantBatch", "moving"]


class PlantBatch(NamedTuple):
    """Numerators and denominators (k, n), descending, and dead times (n,): plants in columns."""

    num: FloatArray
    den: FloatArray
    delay: FloatArray

    @property
    def regular(self) -> BoolArray:
        """Which can be computed with together: all numbers finite, nothing negative or zero."""
        finite = np.isfinite(self.num).all(axis=0) & np.isfinite(self.den).all(axis=0)
        causal = np.isfinite(self.delay) & (self.delay >= 0)
        return np.asarray(finite & causal & self.num.any(axis=0) & self.den.any(axis=0))

    def of(self, chosen: IntArray) -> PlantBatch:
        """Take the columns of these numbers."""
        return PlantBatch(self.num[:, chosen], self.den[:, chosen], self.delay[chosen])

    def groups(self) -> Iterator[tuple[IntArray, PlantBatch]]:
        """Regular, proper plants by degrees, with or without dead time: which, and they alone."""
        num, den = (np.argmax(c != 0, axis=0) for c in (self.num, self.den))
        proper = self.den.shape[0] - den >= self.num.shape[0] - num
        usable = np.flatnonzero(self.regular & proper)
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


class Moving(NamedTuple):
    """A polynomial whose roots move, each by a factor of its own, and pairs together.

    Fixed are roots at s = 0 and the first coefficient that is not 0; of a pair there is the root
    with positive imaginary part.
    """

    fixed: FloatArray
    roots: ComplexArray

    def moved(self, factors: list[FloatArray]) -> FloatArray:
        """Multiply every root by its factor, (n,) each; the value, or slope, at s = 0 remains."""
        product = self.fixed[:, None]
        for root, factor in zip(self.roots.tolist(), factors, strict=True):
            one = np.ones_like(factor)
            if root.imag:
                size = abs(root) * factor
                rows = [size**-2, -2 * (root.real / abs(root)) / size, one]
            else:
                rows = [-1 / (root.real * factor), one]
            product = convolved(product, np.array(rows))
        return product


def moving(p: FloatArray) -> Moving:
    """Take a polynomial, descending coefficients, apart into its roots and what remains."""
    used = np.flatnonzero(p)[-1] + 1
    fixed = np.append(p[used - 1], np.zeros(p.size - used))
    roots = np.roots(p[:used]).astype(complex)
    return Moving(fixed, roots[roots.imag >= 0])
