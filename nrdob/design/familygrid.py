"""Frequencies at which a family's mismatch is looked at: as for one order, and farther out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..diagram import FilterFamily, as_family
from ..numerics import FloatArray
from .familymismatch import FamilyMismatch
from .mismatch import Mismatch
from .mismatchgrid import Frequencies

__all__ = ["FamilyFrequencies", "frequencies_for"]

FARTHER, SPARSE = 10, 4
"""Decades beyond the others, and frequencies in each, where R is but a power of s."""


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
        return self.mismatch.largest(omega, gain)


def frequencies_for(process: Any, model: Any, order: int | FilterFamily | None) -> Frequencies:
    """Read process and model for the filters of one order, or of a family.

    Without an order, for those of the lowest that is causal.
    """
    if isinstance(order, FilterFamily) and not order.is_binomial:
        return FamilyFrequencies(FamilyMismatch.for_family(process, model, order))
    order = as_family(order).order if isinstance(order, FilterFamily) else order
    return Frequencies(Mismatch.of(process, model, order, waits=True))
