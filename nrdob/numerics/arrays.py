"""Types of the arrays that everything works on, what is a number, and what counts as rounding."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ROUNDING", "BoolArray", "ComplexArray", "FloatArray", "IntArray", "is_real", "is_whole",
    "runs",
]  # fmt: skip

FloatArray = NDArray[np.floating[Any]]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

ROUNDING = 1e3 * float(np.finfo(float).eps)
"""Relative change of the coefficients below which two loops cannot be told apart."""


def is_real(value: object) -> bool:
    """Tell whether a value is a real number of Python or NumPy; truth values and texts are none.

    Parameters
    ----------
    value : object
    """
    return isinstance(value, Real) and not isinstance(value, bool)


def is_whole(value: object) -> bool:
    """Tell whether a value is an integer of Python or NumPy; truth values are none.

    Parameters
    ----------
    value : object
    """
    return isinstance(value, Integral) and not isinstance(value, bool)


def runs(where: BoolArray) -> IntArray:
    """Give the runs over which something is true.

    Parameters
    ----------
    where : (N,) array of bool

    Returns
    -------
    (n, 2) array of int
        The first index of each run, and the one behind it.

    Examples
    --------
    >>> runs(np.array([True, True, False, True])).tolist()
    [[0, 2], [3, 4]]
    """
    return np.flatnonzero(np.diff(where, prepend=False, append=False)).reshape(-1, 2)
