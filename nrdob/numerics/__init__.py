"""Numbers only, no control theory: roots, crossings, polynomials with a delay."""

from .argument import Term, frequency_range, rhp_counts, zero_free
from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray, IntArray, is_real, is_whole, runs
from .coefficients import add, exponential, exponential_rest, pade
from .crossings import bisect, golden, halley, side
from .manypolynomials import convolved, hurwitz, padded_sum, values_and_slopes, values_on_axis
from .quasipoly import QuasiPolynomial, follow_together, multiply
from .rootcount import RootCount, count_rhp, frequency_segments, unstable_roots
from .rootfinding import companion_roots, polynomial_roots
from .sharedfactor import Shared, factor_near, shared_factor
from .stretches import ManyTerms
from .timescales import Block, impulse_states, roots_by_time_scale, split, transition
from .writing import number, written

__all__ = [
    "ROUNDING", "Block", "BoolArray", "ComplexArray", "FloatArray", "IntArray", "ManyTerms",
    "QuasiPolynomial", "RootCount", "Shared", "Term", "add", "bisect", "companion_roots",
    "convolved", "count_rhp", "exponential", "exponential_rest", "factor_near", "follow_together",
    "frequency_range", "frequency_segments", "golden", "halley", "hurwitz", "impulse_states",
    "is_real", "is_whole", "multiply", "number", "padded_sum", "pade", "polynomial_roots",
    "rhp_counts", "roots_by_time_scale", "runs", "shared_factor", "side", "split", "transition",
    "unstable_roots", "values_and_slopes", "values_on_axis", "written", "zero_free",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
