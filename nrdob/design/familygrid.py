"""Frequencies at which a family's mismatch is looked at: as for one order, and farther out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..diagram import FilterFamily, as_family
from ..numerics import FloatArray
from .familymismatch import FamilyMismatch, beyond_roots, last_root
from .mismatch import Mismatch
from .mismatchgrid import Frequencies

__all__ = ["FamilyFrequencies", "frequencies_for"]

FARTHER, SPARSE = 10, 4
"""Decades beyond the others, and frequencies in each, where R is but a power of s."""

AT_ONCE = 16
"""Frequencies at which roots are found at once."""


@dataclass(frozen=True, eq=False)
class FamilyFrequencies(Frequencies):
    """The frequencies for the mismatch of a family.

    Attributes
    ----------
    mismatch : FamilyMismatch
        The ratio R and the family.
    """

    mismatch: FamilyMismatch

    @cached_property
    def base(self) -> FloatArray:
        """Frequencies over the whole range of R, dense where a pole or zero is near the axis."""
        near = super().base
        beyond = np.geomspace(1, 10.0**FARTHER, FARTHER * SPARSE + 1)[1:]
        omega = np.concatenate([near[0] / beyond[::-1], near, near[-1] * beyond])
        return np.asarray(omega[(omega > 1e-40) & (omega < 1e40)])

    def largest_time_constant(self, omega: FloatArray, gain: float = 1.0) -> FloatArray:
        """Bound of the λ with ``|L| = gain`` at a frequency."""
        return last_root(self.mismatch.off_gain(omega, gain))

    # The roots of a polynomial at each frequency are dear; of few it must be known what they are.

    def last_above(self, omega: FloatArray, floor: float, gain: float = 1.0) -> int:
        """Give the number of the last frequency at which λ may exceed a floor; -1 for none."""
        columns = self.mismatch.off_gain(omega, gain)
        possible = np.flatnonzero(beyond_roots(columns) > floor)
        for first in range(possible.size, 0, -AT_ONCE):
            some = possible[max(first - AT_ONCE, 0) : first]
            found = some[last_root(columns[:, some]) > floor]
            if found.size:
                return int(found[-1])
        return -1

    def highest(self, omega: FloatArray) -> float:
        """Bound the critical λ of all these frequencies."""
        columns = self.mismatch.off_gain(omega)
        bounds = beyond_roots(columns)
        order, highest = np.argsort(-bounds), 0.0
        for first in range(0, order.size, AT_ONCE):
            some = order[first : first + AT_ONCE]
            if bounds[some[0]] <= highest:
                break
            highest = max(highest, float(last_root(columns[:, some]).max()))
        return highest


def frequencies_for(process: Any, model: Any, order: int | FilterFamily | None) -> Frequencies:
    """Read process and model for the filters of one order, or of a family.

    Without an order, for those of the lowest that is causal.
    """
    if isinstance(order, FilterFamily) and not order.is_binomial:
        return FamilyFrequencies(FamilyMismatch.for_family(process, model, order))
    order = as_family(order).order if isinstance(order, FilterFamily) else order
    return Frequencies(Mismatch.of(process, model, order, waits=True))
