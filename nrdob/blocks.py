"""What the user hands in: SISO continuous-time blocks, checked once, as exact polynomials.

Every other room works on the two coefficient arrays of a `Fraction`. Whatever can be wrong with a
block (its type, its time base, its coefficients) is found here, and named.
"""

from __future__ import annotations

from math import comb
from typing import Any, NamedTuple

import control as ct
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance

FloatArray = NDArray[np.floating[Any]]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

ROUNDING = 1e3 * float(np.finfo(float).eps)
"""Relative change of the coefficients below which two loops cannot be told apart."""


class Fraction(NamedTuple):
    """A ratio of two real polynomials in s, coefficients in descending powers."""

    num: FloatArray
    den: FloatArray

    @property
    def relative_degree(self) -> int:
        """Degree of the denominator minus degree of the numerator."""
        return int(self.den.size - self.num.size)


def as_fraction(system: Any, name: str, *, proper: bool = True) -> Fraction:
    """Read a SISO continuous-time block as numerator and denominator.

    Parameters
    ----------
    system : control.TransferFunction, control.StateSpace, number or (num, den)
        The block. Pairs hold coefficients in descending powers of s.
    name : str
        What the block is called in messages.
    proper : bool
        Whether a numerator of higher degree than the denominator is refused.

    Returns
    -------
    Fraction
        Coefficients without leading zeros.

    Raises
    ------
    TypeError
        If `system` is none of the types above, or has complex coefficients.
    ValueError
        If it is not single-input single-output, not continuous-time, has NaN or infinite
        coefficients, a zero denominator, or is improper where that is not allowed.

    Examples
    --------
    >>> as_fraction(([0, 2], [1, 3]), "process")
    Fraction(num=array([2.]), den=array([1., 3.]))
    """
    if isinstance(system, ct.StateSpace | ct.TransferFunction):
        if not system.issiso():
            raise ValueError(
                f"{name} has {system.ninputs} inputs and {system.noutputs} outputs; this analysis "
                "is for one input and one output: pass one channel, for example sys[0, 0]"
            )
        if not system.isctime():
            raise ValueError(
                f"{name} is discrete-time (dt={system.dt}); this analysis is in continuous time: "
                "pass the continuous-time block"
            )
    num: Any
    den: Any
    if isinstance(system, ct.StateSpace):
        num, den = _from_state_space(system)
    elif isinstance(system, ct.TransferFunction):
        num, den = system.num_array[0, 0], system.den_array[0, 0]
    elif isinstance(system, tuple | list) and len(system) == 2:
        num, den = system
    elif np.isscalar(system) and not isinstance(system, str | bytes):
        num, den = [system], [1.0]
    else:
        raise TypeError(
            f"{name} is a {type(system).__name__}; pass a control.TransferFunction, a "
            "control.StateSpace, a number, or a pair (num, den) of coefficients"
        )
    fraction = Fraction(
        _coefficients(num, f"{name} numerator"), _coefficients(den, f"{name} denominator")
    )
    if not fraction.den.any():
        raise ValueError(f"{name} has the denominator 0; give at least one nonzero coefficient")
    if proper and fraction.relative_degree < 0:
        raise ValueError(
            f"{name} is improper: numerator degree {fraction.num.size - 1} exceeds denominator "
            f"degree {fraction.den.size - 1}; add fast poles until it is proper"
        )
    return fraction


def nonzero(fraction: Fraction, name: str) -> Fraction:
    """Return `fraction`, or raise ValueError if it is identically zero."""
    if not fraction.num.any():
        raise ValueError(f"{name} is identically zero; its numerator needs a nonzero coefficient")
    return fraction


def _coefficients(values: Any, name: str) -> FloatArray:
    array = np.atleast_1d(np.asarray(values))
    if array.dtype.kind == "c":
        if np.any(array.imag != 0):
            raise TypeError(f"{name} has complex coefficients {array}; they must be real")
        array = array.real
    try:
        array = array.astype(float)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name} is {values!r}; it must be a list of real coefficients") from error
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"{name} has shape {array.shape}; it must be a non-empty 1-D list")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} is {array}; every coefficient must be a finite number")
    used = np.flatnonzero(array)
    return array[used[0] :] if used.size else array[-1:]


def _from_state_space(system: ct.StateSpace) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator from the Markov parameters D, CB, CAB, ...

    What is only rounding of larger terms is set to zero: it would otherwise change the relative
    degree, or move an integrator off the origin.
    """
    A, B, C, D = system.A, system.B, system.C, float(system.D[0, 0])
    n = A.shape[0]
    den = np.atleast_1d(np.real(np.poly(A))) if n else np.ones(1)
    markov, size = [D], [abs(D)]
    column, bound = B, np.abs(B)
    for _ in range(n):
        markov.append(float((C @ column)[0, 0]))
        size.append(float((np.abs(C) @ bound)[0, 0]))
        column, bound = A @ column, np.abs(A) @ bound
    num = np.convolve(den, markov)[: n + 1]
    num[np.abs(num) <= ROUNDING * np.convolve(np.abs(den), size)[: n + 1]] = 0.0
    norm = float(np.linalg.norm(matrix_balance(A)[0], 2)) if n else 0.0
    noise = 16 * np.finfo(float).eps * np.array([comb(n, k) * norm**k for k in range(n + 1)])
    large = np.flatnonzero(np.abs(den) > noise)
    den[large[-1] + 1 :] = 0.0
    return num, den
