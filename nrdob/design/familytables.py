"""Polynomials of a filter family: tables of coefficients in s and in λ.

A family has a row for each power of s, descending; here, turned by `by_powers`, row k holds the
coefficients of λ^k, descending in s.
"""

from __future__ import annotations

from fractions import Fraction
from math import factorial
from typing import Any

import numpy as np

from ..diagram import FilterFamily
from ..numerics import ROUNDING, ComplexArray, FloatArray, QuasiPolynomial, count_rhp, shared_factor

__all__ = [
    "by_powers",
    "common_ramp",
    "exactly_on_axis",
    "multiplied",
    "rows",
    "stable_member",
    "summed",
    "taylor",
    "wide",
    "without_shared",
]

GENERIC = (0.71, 1.93, 0.31)  # λ, against the typical one, at all of which a factor is shared

OWN, TRIED = "own", (1.0, 0.1, 10.0, 1e-2, 1e2, 1e-3, 1e3)
"""The only kind whose filters may be unstable, and the λ of which one should not be."""


def stable_member(family: FilterFamily) -> Any:
    """Give one filter of the family that is stable, if there is one, as all should be."""
    for time_constant in TRIED:
        filter = family.at(time_constant)
        if family.kind != OWN or count_rhp(QuasiPolynomial(filter.den[0][0])).count == 0:
            break
    return filter


def common_ramp(family: FilterFamily, wait: float) -> int:
    """Count the zeros at s = 0 that Df - Nf exp(-θm s) has for every λ."""
    if not wait:
        return family.ramp
    num, den = family.num, family.den
    count = int(den.shape[0])
    columns = max(num.shape[1], den.shape[1])
    ahead, behind = (
        np.pad(table[::-1], ((0, count - table.shape[0]), (columns - table.shape[1], 0)))
        for table in (den, num)
    )
    lag = taylor(wait, count)
    for k in range(count):
        late = lag[k::-1] @ behind[: k + 1]
        sizes = np.abs(ahead[k]) + np.abs(lag[k::-1]) @ np.abs(behind[: k + 1])
        if np.any(np.abs(ahead[k] - late) > ROUNDING * sizes):
            return k
    return count


def taylor(delay: float, count: int) -> FloatArray:
    """First coefficients of the series of exp(-θs), ascending."""
    return np.array([(-delay) ** k / factorial(k) for k in range(count)])


def without_shared(table: FloatArray, block: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Divide a family's polynomial and one of the model by what they share for every λ but s."""
    model = QuasiPolynomial(block).without_origin
    held = block.size - model.q.size
    if model.q.size == 1 or np.array_equal(table, np.diag(np.diagonal(table))):
        return table, block
    typical = 1 / float(np.median(np.abs(model.roots)))
    common = model
    for share in GENERIC:
        one = QuasiPolynomial(_trimmed(np.polyval(table.T, share * typical)))
        if not (common.degree and one.degree):
            return table, block
        common = shared_factor(common, one).common
    if not common.degree:
        return table, block
    divided = [_divided(column, common.q) for column in table.T]
    longest = max(column.size for column in divided)
    columns = [np.pad(column, (longest - column.size, 0)) for column in divided]
    return np.array(columns).T, np.append(_divided(model.q, common.q), np.zeros(held))


def _divided(p: FloatArray, divisor: FloatArray) -> FloatArray:
    """Divide a polynomial by a factor of it; roots at s = 0 stay exact."""
    if not p.any():
        return np.zeros(1)
    zeros = QuasiPolynomial(p).zeros_at_origin
    return np.append(np.polydiv(p[: p.size - zeros], divisor)[0], np.zeros(zeros))


def by_powers(*tables: FloatArray) -> list[FloatArray]:
    """Turn tables to ascending powers of λ in rows, as many in all as are used."""
    columns = max(table.shape[1] for table in tables)
    wide = [np.pad(table, ((0, 0), (columns - table.shape[1], 0))).T[::-1] for table in tables]
    used = np.flatnonzero(np.any([table.any(axis=1) for table in wide], axis=0))
    return [table[used[0] : used[-1] + 1] for table in wide]


def wide(table: FloatArray) -> FloatArray:
    """Leave out the powers of s that no λ needs."""
    used = np.flatnonzero(table.any(axis=0))
    return table[:, used[0] :] if used.size else table[:, -1:]


def rows(table: FloatArray, s: Any) -> Any:
    """Value of each row's polynomial, descending coefficients, at the same points."""
    return np.polynomial.polynomial.polyval(s, table.T[::-1])


def exactly_on_axis(p: FloatArray, omega: FloatArray) -> ComplexArray:
    """Values of a polynomial at jω, rounded but once: beside a root Horner's scheme loses them."""
    found = []
    for w in map(Fraction, omega.tolist()):
        real, imag = Fraction(0), Fraction(0)
        for c in p.tolist():
            real, imag = Fraction(c) - imag * w, real * w
        found.append(complex(real, imag))
    return np.array(found)


def summed(tables: list[FloatArray]) -> FloatArray:
    """Add tables; what is only rounding is 0."""
    total, size = sum(tables), sum(map(np.abs, tables))
    return np.where(np.abs(total) <= ROUNDING * size, 0.0, total)


def _trimmed(p: FloatArray) -> FloatArray:
    used = np.flatnonzero(p)
    return p[used[0] :] if used.size else p[-1:]


def multiplied(of_process: FloatArray, of_model: FloatArray) -> FloatArray:
    """Multiply a polynomial of the process by one of the model, within the range of floats."""
    with np.errstate(over="ignore", under="ignore"):
        product = np.convolve(of_process, of_model)
    if not (np.isfinite(product).all() and product[0]):
        raise ValueError(
            "the coefficients of process and model are so large or so small that their product "
            "leaves the range of floating-point numbers: divide numerator and denominator of each "
            "block by its leading coefficient, or change the units"
        )
    return product
