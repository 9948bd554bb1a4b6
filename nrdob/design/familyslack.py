r"""How far the plant loops of a family, or of a model that waits, are from a specification.

.. math:: L = \frac{b\,N_f\,e^{-\theta s}}{a\,E - D N_m N_f\,e^{-\theta_m s}},

all polynomials in λ at each frequency, so that many λ are read at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from ..diagram import FilterFamily
from ..numerics import ComplexArray, FloatArray
from .mismatch import Mismatch
from .mismatchgrid import Frequencies
from .slack import PlantLoops, Specification

__all__ = ["FamilyLoops"]

SHORT = 1.01
"""How far short of the smallest forbidden gain a dead time is followed."""


@dataclass(frozen=True, eq=False)
class FamilyLoops(PlantLoops):
    """The plant loops L of one process and model with all filters of a family.

    Attributes
    ----------
    mismatch : Mismatch
        Process over model, and the family.
    omega : (N,) array of float
        Frequencies that hold all there is to see, in rad/s.
    """

    mismatch: Mismatch

    @classmethod
    def for_family(
        cls,
        process: Any,
        model: Any,
        family: int | FilterFamily,
        specification: Specification,
        slowest: float,
    ) -> FamilyLoops:
        """Choose the frequencies for all time constants from the smallest of interest on."""
        mismatch = Mismatch.of(process, model, family, waits=True)
        gain = specification.smallest_gain / SHORT
        return cls(mismatch, Frequencies(mismatch).above(slowest, gain))

    def _gain(
        self, time_constants: FloatArray, omega: FloatArray, ratio: ComplexArray | None = None
    ) -> ComplexArray:
        ahead, behind, waits = self.mismatch.terms(omega, time_constants)
        with np.errstate(all="ignore"):
            L = behind / (ahead + waits)
        return np.where(np.isfinite(L), L, inf + 0j)  # at a pole

    def _at_infinity(self, time_constants: FloatArray, *, near: bool) -> FloatArray:
        mismatch = self.mismatch
        ahead, behind, waits = mismatch.highest(time_constants)
        with np.errstate(all="ignore"):
            last = np.nan_to_num(behind / ahead, nan=0.0)
            if mismatch.wait or mismatch.delay:  # circles, at their worst
                last = -np.abs(last) / (1 - np.abs(waits / ahead))
        return np.asarray(np.abs(1 + last) if near else np.maximum(-last, 0.0))

    def _at_zero(self, time_constants: FloatArray) -> FloatArray:
        ahead, behind, waits = self.mismatch.lowest(time_constants)
        with np.errstate(all="ignore"):
            first = np.nan_to_num(behind / (ahead + waits), nan=0.0, posinf=0.0, neginf=0.0)
        return np.asarray(np.maximum(-first, 0.0))

    def _residue(self, time_constants: FloatArray, root: complex) -> ComplexArray:
        mismatch = self.mismatch
        E, Nf = mismatch.filters(root, time_constants)
        ahead = np.polyval(np.polyder(mismatch.a), root) * E
        if mismatch.wait:
            waiting = np.polyval(np.polyder(mismatch.waiting), root)
            ahead = ahead - waiting * Nf * np.exp(-mismatch.wait * root)
        behind = np.polyval(mismatch.b, root) * np.exp(-mismatch.delay * root) * Nf
        with np.errstate(all="ignore"):
            return np.asarray(behind / ahead)
