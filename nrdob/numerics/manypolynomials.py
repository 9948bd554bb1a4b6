"""Many polynomials of one degree at once: products, values and slopes on the imaginary axis.

Coefficients stand in the rows, in descending powers; the polynomials in the columns, or wherever
further axes put them, as long as these broadcast with the frequencies. Nothing here calls BLAS, so
that the digits depend on neither threads nor on how many polynomials there are.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from .arrays import ComplexArray, FloatArray

__all__ = [
    "convolved",
    "padded_sum",
    "sizes_on_axis",
    "taylor_on_axis",
    "values_and_slopes",
    "values_on_axis",
]


def convolved(a: FloatArray, b: FloatArray) -> FloatArray:
    """Multiply polynomials column by column.

    Parameters
    ----------
    a : (k, ...) array of float
        Coefficients in descending powers.
    b : (l, ...) array of float
        The same of the other factors, of a shape that broadcasts.

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
        Coefficients in descending powers.
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
        Coefficients in descending powers.
    omega : array of float
        Frequencies in rad/s, of a shape that broadcasts with the columns.
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
    p : (k, ...) array of float
        Coefficients in descending powers.
    omega : array of float
        Frequencies in rad/s, of a shape that broadcasts with the columns.

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


def sizes_on_axis(sizes: FloatArray, omega: FloatArray) -> FloatArray:
    """Evaluate polynomials with coefficients of one sign at ω itself.

    Parameters
    ----------
    sizes : (k, ...) array of float
        Coefficients in descending powers.
    omega : array of float
        Frequencies in rad/s.
    """
    return _plain(sizes[::-1], omega)


def taylor_on_axis(
    p: FloatArray, centre: FloatArray, radius: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Values at j·centre, and how far p can be from them within `radius`.

    Parameters
    ----------
    p : (k, ...) array of float
        Coefficients in descending powers.
    centre, radius : array of float
        Of discs around j·centre; their shape broadcasts with the columns.
    """
    power = np.ones_like(centre)
    scaled = []
    for coefficient in p[::-1]:
        scaled.append(coefficient * power)
        power = power * centre
    even, odd = _derivative(scaled, 0)
    spread = radius / centre
    rest, step = np.zeros_like(scaled[0]), spread
    for m in range(1, p.shape[0]):
        # The sum of the sizes of both parts is cheaper than their root of squares, and no smaller.
        rest += sum(np.abs(part) for part in _derivative(scaled, m)) * step
        step = step * spread
    return even + 1j * odd, rest


def _derivative(scaled: list[FloatArray], m: int) -> tuple[FloatArray, FloatArray]:
    """Real and imaginary part of Taylor's coefficient m for the radius |c|, up to a power of j."""
    parts: list[FloatArray] = [np.zeros(1), np.zeros(1)]
    for k, weight in _weights(len(scaled), m):
        parts[(k - m) % 2] = parts[(k - m) % 2] + (scaled[k] if weight == 1 else weight * scaled[k])
    return parts[0], parts[1]


@lru_cache(maxsize=256)
def _weights(n: int, m: int) -> list[tuple[int, float]]:
    """C(k, m) with the sign of j^(k-m), without j where that is odd."""
    return [(k, comb(k, m) * (1.0, 1.0, -1.0, -1.0)[(k - m) % 4]) for k in range(m, n)]
