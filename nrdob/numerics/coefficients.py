"""Coefficients of single polynomials and of the exponential series, in descending powers."""

from __future__ import annotations

from math import comb, factorial, perm
from typing import Any

import numpy as np

from .arrays import ROUNDING, ComplexArray, FloatArray

__all__ = [
    "add", "convolution_matrix", "exponential", "exponential_rest", "horner", "pade",
    "trailing_zeros", "trim",
]  # fmt: skip

NEAR = 1.0  # size of z up to which the rest of exp(z) is summed up: a difference loses digits


def exponential_rest(z: ComplexArray, m: int, *, divided: bool = False) -> ComplexArray:
    """Evaluate what Taylor's polynomial of degree m - 1 leaves of exp(z), without cancellation.

    Parameters
    ----------
    z : array of complex
    m : int
        0 for exp(z) itself, 1 for exp(z) - 1.
    divided : bool
        Whether it is divided by z^m, which at 0 leaves 1/m!.

    Examples
    --------
    >>> exponential_rest(np.array([0.0, 1.0, 2.0]), 2, divided=True).real.round(6).tolist()
    [0.5, 0.718282, 1.097264]
    """
    z = np.asarray(z, dtype=complex)
    if not m:
        return np.asarray(np.exp(z))
    if m == 1 and not divided:
        return np.asarray(np.expm1(z))
    near = np.abs(z) <= NEAR
    close, far = np.where(near, z, 0.0), np.where(near, 1.0, z)
    series = np.ones_like(z)
    for k in range(m + 18, m, -1):  # (…(z/k + 1) z/(k - 1) + 1)…
        series = series * close / k + 1.0
    rest = np.expm1(far) - sum(far**k / factorial(k) for k in range(1, m))
    value = np.where(near, series / factorial(m), rest / far**m)
    return np.asarray(value if divided else value * z**m)


def exponential(delay: float, m: int) -> FloatArray:
    """Taylor's polynomial of exp(-delay·s), in descending powers.

    Parameters
    ----------
    delay : float
        In seconds.
    m : int
        Number of coefficients.
    """
    return np.array([(-delay) ** k / factorial(k) for k in range(m - 1, -1, -1)])


def pade(order: int, delay: float) -> tuple[FloatArray, FloatArray]:
    """Diagonal Padé approximant of exp(-delay·s).

    Parameters
    ----------
    order : int
    delay : float
        In seconds.

    Examples
    --------
    >>> [p.tolist() for p in pade(1, 2.0)]
    [[-1.0, 1.0], [1.0, 1.0]]
    """
    k = np.arange(order, -1, -1)
    den = np.array([comb(order, i) / perm(2 * order, i) * delay**i for i in k.tolist()])
    return den * (-1.0) ** k, den


def add(a: FloatArray, b: FloatArray) -> FloatArray:
    """Add two coefficient arrays in descending powers, of any lengths.

    Parameters
    ----------
    a, b : array of float
    """
    if a.size < b.size:
        a, b = b, a
    total = np.array(a, dtype=float)
    total[a.size - b.size :] += b
    return total


def horner(coefficients: FloatArray, s: ComplexArray) -> Any:
    """`numpy.polyval` without its overhead, which would be most of the time on a few points."""
    first, *others = coefficients.tolist()
    value = np.full_like(s, first)[()]
    for coefficient in others:
        value = value * s + coefficient
    return value


def convolution_matrix(p: FloatArray, n: int) -> FloatArray:
    """`scipy.linalg.convolution_matrix` without its overhead, fifty times that of the work."""
    matrix = np.zeros((p.size + n - 1, n))
    for k in range(n):
        matrix[k : k + p.size, k] = p
    return matrix


def trim(coefficients: FloatArray, scale: FloatArray) -> FloatArray:
    """Drop leading coefficients that are rounding of larger terms which cancelled."""
    size = scale[-coefficients.size :]
    if abs(coefficients[0]) > ROUNDING * size[0]:
        return coefficients
    used = np.flatnonzero(np.abs(coefficients) > ROUNDING * size)
    return coefficients[used[0] :] if used.size else np.zeros(1)


def trailing_zeros(coefficients: FloatArray) -> int:
    """Multiplicity of the root at 0."""
    if coefficients[-1]:
        return 0
    used = np.flatnonzero(coefficients)
    return int(coefficients.size - 1 - used[-1]) if used.size else int(coefficients.size)
