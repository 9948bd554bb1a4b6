"""Numbers only, no control theory: roots, crossings, polynomials with a delay."""

from .argument import Term
from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray, IntArray
from .crossings import bisect, golden, newton, side
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
from .rootfinding import companion_roots
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
    "QuasiPolynomial",
    "RootCount",
    "Shared",
    "Term",
    "add",
    "bisect",
    "companion_roots",
    "count_rhp",
    "differentiate",
    "exponential_rest",
    "factor_near",
    "frequency_segments",
    "golden",
    "impulse_states",
    "multiply",
    "newton",
    "number",
    "roots_by_time_scale",
    "shared_factor",
    "side",
    "split",
    "unstable_roots",
    "without_shared_factor",
    "written",
]
