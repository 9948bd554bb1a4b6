"""What the user hands in: SISO continuous-time blocks, checked once, as exact polynomials.

Every other room works on the two coefficient arrays of a `Fraction`. Whatever can be wrong with a
block (its type, its time base, its coefficients) is found here, and named.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import control as ct
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating[Any]]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
BoolArray = NDArray[np.bool_]


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
    # Zeros, poles and one value of the response: unlike a determinant formula this leaves no
    # rounding noise in the leading numerator coefficients, which would change the relative degree.
    poles, zeros = system.poles(), system.zeros()
    zeros = zeros[np.isfinite(zeros)]
    den, monic = (np.atleast_1d(np.real(np.poly(roots))) for roots in (poles, zeros))
    probe = 1.0 + 2.0 * float(np.max(np.abs(np.concatenate([poles, zeros])), initial=0.0))
    gain = float(np.real(system(probe))) * np.polyval(den, probe) / np.polyval(monic, probe)
    return gain * monic, den
