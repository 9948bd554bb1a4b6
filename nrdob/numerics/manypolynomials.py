"""Many polynomials of one degree at once: products, values and slopes on the imaginary axis.

Coefficients stand in the rows, in descending powers; the polynomials in the columns, or wherever
further axes put them, as long as these broadcast with the frequencies. Nothing here calls BLAS, so
that the digits depend on neither threads nor on how many polynomials there are.
"""

from __future__ import annotations

import numpy as np

from .arrays import ComplexArray, FloatArray

__all__ = ["convolved", "padded_sum", "values_and_slopes", "values_on_axis"]


def convolved(a: FloatArray, b: FloatArray) -> FloatArray:
    """Multiply polynomials column by column.

    Parameters
    ----------
    a, b : (k, ...) and (l, ...) array of float
        Of shapes that broadcast.

    Examples
    --------
    >>> convolved(np.array([[1.0], [2.0]]), np.array([[1.0, 2.0], [1.0, 3.0]])).T
    array([[1., 3., 2.],
           [2., 7., 6.]])
    """
    shape = np.broadcast_shapes(a.shape[1:], b.shape[1:])
    product = np.zeros((a.shape[0] + b.shape[0] - 1, *shape))
    for i, x in enumerate(a):
        for k, y in enumerate(b):
            product[i + k] += x * y
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
    square = -(omega**2)
    even, odd = (_plain(p[::-1][k::2], square) for k in (0, 1))
    return np.asarray(even + 1j * (omega * odd))


def _plain(ascending: FloatArray, x: FloatArray) -> FloatArray:
    """Values of polynomials at real x."""
    if not ascending.shape[0]:
        return np.zeros(1)
    value = np.asarray(ascending[-1] + np.zeros_like(x))
    for coefficient in ascending[-2::-1]:
        value *= x
        value += coefficient
    return value


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
    # p(s) = even(s²) + s odd(s²): on the axis s² is real, so that half the work is left.
    square = -(omega**2)
    (even, odd), (even_slope, odd_slope) = zip(
        *(_horner(p[::-1][k::2], square, np.shape(omega)) for k in (0, 1)), strict=True
    )
    s = 1j * omega
    return even + s * odd, odd + 2 * s * (even_slope + s * odd_slope)


def _horner(
    ascending: FloatArray, x: FloatArray, shape: tuple[int, ...]
) -> tuple[FloatArray, FloatArray]:
    """Values and derivatives of polynomials at real x."""
    full = np.broadcast_shapes(ascending.shape[1:], shape)
    value, slope = np.zeros(full), np.zeros(full)
    for coefficient in ascending[::-1]:
        slope *= x
        slope += value
        value *= x
        value += coefficient
    return value, slope
