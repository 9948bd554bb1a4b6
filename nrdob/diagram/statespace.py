r"""Numerator and denominator of a state space, exactly, and which of their zeros are rounding.

Floating-point numbers are fractions, so the two polynomials of

.. math:: G(s) = D + C\,(sI - A)^{-1} B,\qquad
          \det(sI - A),\qquad \det(sI - A + BC) - \det(sI - A)

can be had without any error from whole numbers (Faddeev and LeVerrier). No time scale is then lost
against a faster one. What remains is that A, B, C themselves have been rounded: an integrator or
a relative degree, hidden by a change of coordinates, comes out as a number of the size of that
rounding instead of 0. How far a coefficient moves if each entry of A, B and C is off by one
rounding follows from the same matrices. For det A it is, up to a factor n, the componentwise
distance to the nearest singular matrix (Demmel, SIAM J. Matrix Anal. Appl. 13, 1992, 10-19), which
does not depend on the units of the states.
"""

from __future__ import annotations

from fractions import Fraction as Exact
from functools import lru_cache
from typing import Any

import numpy as np

from ..numerics import FloatArray

__all__ = ["MAX_STATES", "polynomials"]

MAX_STATES = 24  # whole numbers grow with the number of states; more would take over half a second

ZERO, NONZERO = (roundings * float(np.finfo(float).eps) for roundings in (1e2, 1e6))
"""Size of a coefficient, against the errors of the entries, that is 0; that is certainly not."""


def polynomials(system: Any, name: str) -> tuple[FloatArray, FloatArray]:
    """Read numerator and denominator off a SISO state space, for messages called `name`.

    Coefficients come in descending powers, correctly rounded, the first of the denominator 1. It
    has the degree of A: modes that cannot be reached or seen stay in both polynomials, as factors
    that they share. Leading coefficients of the numerator and trailing ones of both, where a zero
    means a relative degree, a zero or a pole at s = 0, are zero if a relative change of the entries
    below `ZERO` makes them so.

    A TypeError for complex entries; a ValueError for such as are not finite, over `MAX_STATES`
    states, or entries rounded too coarsely to tell whether such a coefficient is zero.
    """
    given = [np.asarray(part) for part in (system.A, system.B, system.C, system.D)]
    if any(part.imag.any() for part in given):
        raise TypeError(f"{name} has a complex entry in A, B, C or D; they must be real")
    parts = [part.real.astype(float) for part in given]
    if not all(np.isfinite(part).all() for part in parts):
        raise ValueError(
            f"{name} has an entry in A, B, C or D that is not finite; every one must be a number"
        )
    n = parts[0].shape[0]
    if n > MAX_STATES:
        raise ValueError(
            f"{name} has {n} states; up to {MAX_STATES} are read exactly: pass a reduced model, or "
            "the transfer function if you have it"
        )
    num, den = _polynomials(name, n, *(tuple(part.ravel().tolist()) for part in parts))
    return num.copy(), den.copy()


@lru_cache(maxsize=32)  # a search reads the same block again and again
def _polynomials(name: str, n: int, *parts: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
    (whole_A, a), (whole_B, b), (whole_C, c) = (
        _whole(part, shape) for part, shape in zip(parts, ((n, n), (n, 1), (1, n)), strict=False)
    )
    # A is whole/a; with the input in other units, so that B C has the same denominator as A.
    den, adjugates = _faddeev(whole_A)
    closed, closed_adjugates = _faddeev(whole_A - whole_B @ whole_C)
    through = Exact(parts[3][0]) * b * c / a
    num = [q - p + through * p for p, q in zip(den, closed, strict=True)]

    size_A, size_B, size_C = (np.abs(part) for part in (whole_A, whole_B, whole_C))
    den_error, num_error = [0], [abs(through)]
    for k, (M, N) in enumerate(zip(adjugates, closed_adjugates, strict=True), start=1):
        den_error.append(_pairing(M, size_A))
        by_B, by_C = np.abs(whole_C @ M) @ size_B, size_C @ np.abs(M @ whole_B)
        by_A = _pairing(N - M + through * M, size_A)
        num_error.append(by_A + int(by_B[0, 0] + by_C[0, 0]) + abs(through * den[k]))

    integrators = _rounded_zeros(den[::-1], den_error[::-1], f"a pole of {name} at s = 0")
    if integrators:
        den[-integrators:] = [0] * integrators
    if any(num):
        lost = _rounded_zeros(num, num_error, f"the relative degree of {name}")
        num = num[lost:]
        zeros = _rounded_zeros(num[::-1], num_error[::-1], f"a zero of {name} at s = 0")
        num = [*num[: len(num) - zeros], *([0] * zeros)]
    gain = Exact(a, b * c)
    exact = (
        [gain * v / a ** (n + 1 - len(num) + k) for k, v in enumerate(num)],
        [Exact(v, a**k) for k, v in enumerate(den)],
    )
    try:
        read = [np.array(part, dtype=float) for part in exact]
        lost = list(map(np.count_nonzero, read)) != list(map(np.count_nonzero, exact))
    except OverflowError:
        lost = True
    if lost:
        raise ValueError(
            f"{name} has coefficients beyond the range of floating-point numbers; choose another "
            "unit of time"
        )
    return read[0], read[1]


def _whole(entries: tuple[float, ...], shape: tuple[int, int]) -> tuple[Any, int]:
    """Write a matrix as whole numbers over one power of two."""
    ratios = [value.as_integer_ratio() for value in entries]
    over = max((den for _, den in ratios), default=1)
    whole = np.empty(len(ratios), dtype=object)
    whole[:] = [num * (over // den) for num, den in ratios]
    return whole.reshape(shape), over


def _faddeev(A: Any) -> tuple[list[Any], list[Any]]:
    """Coefficients of det(sI - A) and the matrices of adj(sI - A), both in descending powers."""
    identity = np.eye(len(A), dtype=int).astype(object)
    coefficients, matrices, M = [1], [], identity
    for k in range(1, len(A) + 1):
        matrices.append(M)
        AM = A @ M
        coefficients.append(-sum(AM.diagonal()) // k)
        M = AM + coefficients[-1] * identity
    return coefficients, matrices


def _pairing(M: Any, size_A: Any) -> Any:
    """How far tr(M δA) reaches for |δA| <= |A|."""
    return (np.abs(M) * size_A.T).sum()


def _rounded_zeros(coefficients: list[Any], errors: list[Any], what: str) -> int:
    """Count the first coefficients that are zero within the rounding of the entries."""
    for count, (value, error) in enumerate(zip(coefficients, errors, strict=False)):
        relative = float(Exact(abs(value), 1) / Exact(error)) if error else float(value != 0)
        if relative <= ZERO:
            continue
        if relative < NONZERO:
            raise ValueError(
                f"{what} cannot be told from a rounding of the entries of the state space "
                f"(relative distance {relative:.1g}): pass the transfer function"
            )
        return count
    return len(coefficients)
