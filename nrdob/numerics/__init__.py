"""Numbers only, no control theory: roots, crossings, polynomials with a delay."""

from .argument import Term
from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray, IntArray
from .crossings import bisect, golden, newton, side
from .hurwitz import hurwitz
from .manypolynomials import convolved, padded_sum, values_and_slopes, values_on_axis
from .manyturns import ManyTerms, frequency_range, rhp_counts, zero_free
from .quasipoly import (
    QuasiPolynomial,
    RootCount,
    add,
    count_rhp,
    differentiate,
    exponential_rest,
    frequency_segments,
    multiply,
    unstable_roots,
)
from .rootfinding import companion_roots, polynomial_roots
from .sharedfactor import Shared, factor_near, shared_factor, without_shared_factor
from .timescales import Block, impulse_states, roots_by_time_scale, split
from .writing import number, written

__all__ = [
    "ROUNDING",
    "Block",
    "BoolArray",
    "ComplexArray",
    "FloatArray",
    "IntArray",
    "ManyTerms",
    "QuasiPolynomial",
    "RootCount",
    "Shared",
    "Term",
    "add",
    "bisect",
    "companion_roots",
    "convolved",
    "count_rhp",
    "differentiate",
    "exponential_rest",
    "factor_near",
    "frequency_range",
    "frequency_segments",
    "golden",
    "hurwitz",
    "impulse_states",
    "multiply",
    "newton",
    "number",
    "padded_sum",
    "polynomial_roots",
    "rhp_counts",
    "roots_by_time_scale",
    "shared_factor",
    "side",
    "split",
    "unstable_roots",
    "values_and_slopes",
    "values_on_axis",
    "without_shared_factor",
    "written",
    "zero_free",
]


def __dir__() -> list[str]:
    return __all__
