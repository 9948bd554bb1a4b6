"""Numbers only, no control theory: roots, crossings, polynomials with a delay."""

from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray, IntArray
from .crossings import bisect, golden, newton, side
from .quasipoly import (
    QuasiPolynomial,
    RootCount,
    add,
    count_rhp,
    differentiate,
    frequency_segments,
    multiply,
)
from .rootfinding import companion_roots
from .sharedfactor import without_shared_factor
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
    "add",
    "bisect",
    "companion_roots",
    "count_rhp",
    "differentiate",
    "frequency_segments",
    "golden",
    "impulse_states",
    "multiply",
    "newton",
    "number",
    "roots_by_time_scale",
    "side",
    "split",
    "without_shared_factor",
    "written",
]
