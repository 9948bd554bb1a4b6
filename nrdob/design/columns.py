"""Polynomials in λ at many frequencies: coefficients ascending, each polynomial a column."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from scipy.linalg import pascal

from ..numerics import BoolArray, ComplexArray, FloatArray, companion_roots, convolved

__all__ = [
    "last_root", "none_beyond", "positive_roots", "root_near", "roots_of_columns", "size_squared",
    "values_and_slopes",
]  # fmt: skip

NEWTON, FARTHEST = 2, 1e-5  # steps that polish a root, and how far one may lead, against the root
EPS = 16 * float(np.finfo(float).eps)  # value at a root, against the terms, that is rounding
SAME_PRODUCT = 1e-8  # by how much the product of all roots may be off that of the coefficients

CUBE_ROOTS = np.exp(2j * np.pi / 3 * np.arange(3))

SETTLING, SETTLED, SAME_ROOT = 5, 1e-11, 0.05  # Newton steps from a guess, the last, and all
NEARLY_REAL = 0.2  # imaginary part of a root, against the real one, that is near a real one
REAL = 1e-7  # imaginary part of a root, against its size, that may be rounding

Columns = TypeVar("Columns", FloatArray, ComplexArray)


def roots_of_columns(coefficients: Any) -> ComplexArray:
    """Roots of polynomials, ascending coefficients in columns: shape (n, N), all at once."""
    coefficients = np.asarray(coefficients, dtype=complex)
    n = coefficients.shape[0] - 1
    scaled, scale = _scaled(coefficients)
    if n == 1:
        return np.asarray(-scaled[:1] * scale)
    if n > 3:
        return _polished(coefficients, _eigenvalues(scaled) * scale)[0]
    with np.errstate(all="ignore"):
        roots, known = _polished(coefficients, _by_formula(scaled) * scale)
        vieta = np.prod(roots, axis=0) * coefficients[-1] + (-1) ** (n + 1) * coefficients[0]
        known &= np.abs(vieta) <= SAME_PRODUCT * np.abs(coefficients[0])
    if not known.all():
        few = coefficients[:, ~known]
        every = _eigenvalues(scaled[:, ~known]) * scale[~known]
        roots[:, ~known] = _polished(few, every)[0]
    return roots


def _scaled(coefficients: Columns) -> tuple[Columns, FloatArray]:
    """Make polynomials monic, with roots whose product is of size 1, and give their scales."""
    n = coefficients.shape[0] - 1
    first, last = np.abs(coefficients[0]), np.abs(coefficients[-1])
    tiny = 1e-290 + 1e-30 * np.abs(coefficients).max(axis=0, initial=0.0)
    with np.errstate(all="ignore"):
        scale = np.where(first > 0, first / np.maximum(last, tiny), 1.0) ** (1 / n)
        scaled = coefficients * scale ** np.arange(n + 1)[:, None]
        return scaled / np.where(last > 0, scaled[-1], 1.0), scale


def _eigenvalues(monic: Columns) -> ComplexArray:
    """Roots of monic polynomials as eigenvalues of their companion matrices."""
    n = monic.shape[0] - 1
    companion = np.zeros((monic.shape[1], n, n), dtype=monic.dtype)
    companion[:, np.arange(1, n), np.arange(n - 1)] = 1
    companion[:, :, -1] = -np.nan_to_num(monic[:-1].T)
    return np.asarray(np.linalg.eigvals(companion).T)


def _by_formula(monic: ComplexArray) -> ComplexArray:
    """Roots of monic quadratics or cubics: by Cardano's formula the largest, then the others."""
    if monic.shape[0] == 3:
        return _of_quadratic(monic[1], monic[0])
    p, q, r = monic[2] / 3, monic[1], monic[0]
    P, Q = p * p - q / 3, p**3 - (p * q - r) / 2
    root = np.sqrt(Q * Q - P**3)
    root = np.where((root * Q.conj()).real < 0, -root, root)
    A = -((Q + root) ** (1 / 3))
    every = np.array([A * turn + P / np.where(A == 0, 1.0, A * turn) - p for turn in CUBE_ROOTS])
    largest = np.take_along_axis(every, np.abs(every).argmax(axis=0)[None], axis=0)[0]
    product = -r / largest
    return np.vstack([largest, _of_quadratic((product - q) / largest, product)])


def _of_quadratic(p: ComplexArray, q: ComplexArray) -> ComplexArray:
    """Roots of x² + p x + q."""
    root = np.sqrt(p * p - 4 * q)
    larger = -(p + np.where((root * p.conj()).real < 0, -root, root)) / 2
    return np.array([larger, q / larger])


def _polished(coefficients: ComplexArray, roots: ComplexArray) -> tuple[ComplexArray, BoolArray]:
    """Take Newton's steps to roots, unless the value is rounding; tell where they lead nowhere."""
    sizes = np.abs(coefficients)
    with np.errstate(all="ignore"):
        for _ in range(NEWTON):
            value, slope = values_and_slopes(coefficients, roots)
            there = np.abs(value) <= EPS * values_and_slopes(sizes, np.abs(roots))[0]
            step = np.nan_to_num(value / slope, posinf=0.0, neginf=0.0)
            small = np.abs(step) <= FARTHEST * np.abs(roots)
            roots = roots - np.where(small & ~there, step, 0.0)
    known = np.isfinite(roots) & (small | there)
    return np.asarray(roots), np.asarray(known.all(axis=0))


def last_root(columns: FloatArray) -> FloatArray:
    """Bound the last positive root of polynomials, ascending coefficients in columns; 0 for none.

    A pair that is not quite real counts, because between two frequencies it may become so.
    """
    scaled, scale = _scaled(columns)
    roots = _eigenvalues(scaled) * scale
    real = np.abs(roots.imag) <= NEARLY_REAL * roots.real
    return np.asarray(np.where(real, roots.real, 0.0).max(axis=0, initial=0.0))


def none_beyond(columns: FloatArray, at: float) -> BoolArray:
    """Tell which polynomials surely have no root beyond `at`: derivatives of one sign (Budan)."""
    n = columns.shape[0] - 1
    with np.errstate(all="ignore"):
        there = pascal(n + 1, "upper") @ (columns * at ** np.arange(n + 1)[:, None])
        return np.asarray((there * there[-1] > 0).all(axis=0))


def values_and_slopes(
    coefficients: ComplexArray, x: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Polynomials, ascending coefficients in columns, at the points of the same columns."""
    value = np.zeros_like(x) + coefficients[-1]
    slope = np.zeros_like(x)
    for k in range(coefficients.shape[0] - 2, -1, -1):
        slope = slope * x + value
        value = value * x + coefficients[k]
    return value, slope


def root_near(coefficients: ComplexArray, guess: ComplexArray) -> ComplexArray:
    """Root of each polynomial next to a guess: by Newton, and where that fails of all of them."""
    found = guess[None]
    with np.errstate(all="ignore"):
        for _ in range(SETTLING):
            value, slope = values_and_slopes(coefficients, found)
            step = value / slope
            found = found - step
            settled = np.abs(step[0]) <= SETTLED * np.abs(found[0])
            if settled.all():
                break
        lost = ~(settled & (np.abs(found[0] - guess) <= SAME_ROOT * np.abs(guess)))
    found = found[0]
    if lost.any():
        every = roots_of_columns(coefficients[:, lost])
        nearest = np.abs(every - guess[lost]).argmin(axis=0)
        found[lost] = every[nearest, np.arange(nearest.size)]
    return np.asarray(found)


def size_squared(columns: ComplexArray) -> FloatArray:
    """Coefficients of the square of a polynomial's size at a real λ."""
    return convolved(columns.real, columns.real) + convolved(columns.imag, columns.imag)


def positive_roots(p: FloatArray) -> FloatArray:
    """Real positive roots of a polynomial, descending coefficients, increasing."""
    p = np.trim_zeros(p)
    if not ((p > 0).any() and (p < 0).any()):
        return np.empty(0)
    roots = companion_roots(p)
    real = np.abs(roots.imag) <= REAL * np.abs(roots)
    return np.sort(roots.real[real & (roots.real > 0)])
