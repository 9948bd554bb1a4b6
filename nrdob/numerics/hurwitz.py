"""Which of many polynomials have all roots in the left half plane, certified.

Routh's array (Gantmacher, The Theory of Matrices, vol. 2, 1959, ch. XV) is built for all of them at
once, and beside every number how far it can be from the truth: what the coefficients may be off,
and what each step rounds. A certain sign of the first column is that of every polynomial within
that distance; from the first one on that is not, nothing is said.
"""

from __future__ import annotations

import numpy as np

from .arrays import BoolArray, FloatArray

__all__ = ["hurwitz"]

EPS = 4 * float(np.finfo(float).eps)
"""Rounding of a step of the array against its largest term, generously."""


def hurwitz(coefficients: FloatArray, off: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Tell which polynomials certainly are stable, and which certainly are not.

    Parameters
    ----------
    coefficients : (k, n) array of float
        Polynomials of degree k - 1 in the columns, in descending powers.
    off : (k, n) array of float
        By how much each may be wrong.

    Returns
    -------
    left, right : (n,) array of bool
        All roots in the open left half plane; a root in the open right half plane. Neither where
        a root may lie on the axis, or the leading coefficient may be 0.

    Examples
    --------
    >>> p = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 0.0], [4.0, 4.0, 4.0]])
    >>> left, right = hurwitz(p, 1e-12 * np.abs(p))             # s² + s + 4, s² - s + 4, s² + 4
    >>> left.tolist(), right.tolist()
    ([True, False, False], [False, True, False])
    """
    with np.errstate(all="ignore"):  # what is not finite is not certain
        p = coefficients * np.sign(coefficients[0])
        certain = p[0] > off[0]
        right = certain & (p < -off).any(axis=0)
        upper, lower = (p[0::2], off[0::2]), (p[1::2], off[1::2])
        while lower[0].shape[0]:
            pivot, doubt = lower[0][0], lower[1][0]
            right |= certain & (pivot < -doubt)
            certain &= pivot > doubt
            if not certain.any():
                break
            upper, lower = lower, _next(upper, lower)
    return certain & ~right, right


def _next(
    upper: tuple[FloatArray, FloatArray], lower: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Next row of the array, and how far it can be from the truth."""
    (a, a_off), (b, b_off) = upper, lower
    ratio = a[0] / b[0]
    size = np.abs(ratio)
    ratio_off = (a_off[0] + size * b_off[0]) / (np.abs(b[0]) - b_off[0]) + EPS * size
    row, row_off = a[1:].copy(), a_off[1:].copy()
    m = b.shape[0] - 1  # the last one of the lower row may be missing
    product = ratio * b[1:]
    row[:m] -= product
    row_off[:m] += size * b_off[1:] + ratio_off * (np.abs(b[1:]) + b_off[1:])
    row_off[:m] += EPS * (np.abs(a[1 : m + 1]) + np.abs(product))
    return row, row_off
