"""Many polynomials of one degree at once: products, values on the imaginary axis, stability.

Coefficients stand in the rows, in descending powers; the polynomials in the columns, or wherever
further axes put them, as long as these broadcast with the frequencies. Nothing here calls BLAS, so
that the digits depend on neither threads nor on how many polynomials there are.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from .arrays import BoolArray, ComplexArray, FloatArray

__all__ = ["convolved", "hurwitz", "padded_sum", "values_and_slopes", "values_on_axis"]

EPS = 4 * float(np.finfo(float).eps)  # rounding of a step of Routh's array, generously


def convolved(a: FloatArray, b: FloatArray) -> FloatArray:
    """Multiply polynomials column by column.

    Parameters
    ----------
    a, b : (k, ...) and (l, ...) array of float
        Of as many axes, and shapes that broadcast.

    Examples
    --------
    >>> convolved(np.array([[1.0], [2.0]]), np.array([[1.0, 2.0], [1.0, 3.0]])).T
    array([[1., 3., 2.],
           [2., 7., 6.]])
    """
    shape = np.broadcast_shapes(a.shape[1:], b.shape[1:])
    product = np.zeros((a.shape[0] + b.shape[0] - 1, *shape))
    for i, x in enumerate(a):
        product[i : i + len(b)] += x * b
    return product


def padded_sum(*polynomials: FloatArray) -> FloatArray:
    """Add polynomials of any degrees column by column.

    Parameters
    ----------
    *polynomials : (k, ...) array of float
    """
    shape = np.broadcast_shapes(*(p.shape[1:] for p in polynomials))
    total = np.zeros((max(p.shape[0] for p in polynomials), *shape))
    for p in polynomials:
        total[total.shape[0] - p.shape[0] :] += p
    return total


def values_on_axis(p: FloatArray, omega: FloatArray) -> ComplexArray:
    """Evaluate p(jω).

    Parameters
    ----------
    p : (k, ...) array of float
    omega : array of float
        In rad/s, of a shape that broadcasts with the columns.
    """
    # p(s) = even(s²) + s odd(s²): on the axis s² is real, so that half the work is left.
    square, ascending = -(omega**2), p[::-1]
    even = polyval(square, ascending[::2], tensor=False)
    odd = polyval(square, ascending[1::2], tensor=False) if len(p) > 1 else 0.0
    return np.asarray(even + 1j * (omega * odd))


def values_and_slopes(p: FloatArray, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Evaluate p(jω) and dp/ds there.

    Parameters
    ----------
    p, omega : (k, ...) array of float, array of float
        As for `values_on_axis`.

    Examples
    --------
    >>> value, slope = values_and_slopes(np.array([1.0, 2.0, 3.0]), np.array(2.0))
    >>> complex(value), complex(slope)                          # s² + 2s + 3 at 2j
    ((-1+4j), (2+4j))
    """
    return values_on_axis(p, omega), values_on_axis(polyder(p[::-1])[::-1], omega)


def hurwitz(coefficients: FloatArray, off: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Tell which polynomials certainly are stable, and which certainly are not.

    Routh's array (Gantmacher, The Theory of Matrices, vol. 2, 1959, ch. XV) is built for all of
    them at once, and beside every number how far it can be from the truth: what the coefficients
    may be off, and what each step rounds. A certain sign of the first column is that of every
    polynomial within that distance; from the first one on that is not, nothing is said.

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
