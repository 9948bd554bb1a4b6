"""Types of the arrays that everything works on, and what counts as rounding."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["ROUNDING", "BoolArray", "ComplexArray", "FloatArray", "IntArray"]

FloatArray = NDArray[np.floating[Any]]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

ROUNDING = 1e3 * float(np.finfo(float).eps)
"""Relative change of the coefficients below which two loops cannot be told apart."""
