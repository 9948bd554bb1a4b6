"""What the user hands in: SISO continuous-time blocks, checked once, as exact polynomials.

Whatever can be wrong with a block (its type, its time base, its coefficients) is found here, and
named; everything else works on the two coefficient arrays of a `Fraction`.
"""

from __future__ import annotations

from math import inf
from numbers import Number
from typing import Any, NamedTuple

import control as ct
import numpy as np
from scipy import signal

from ..numerics import FloatArray
from .statespace import polynomials

__all__ = ["Fraction", "as_fraction", "is_number", "nonzero", "real_number", "six_digits"]

ACCEPTED = (
    "pass a control.TransferFunction, a control.StateSpace, a scipy.signal.lti, a number, or a "
    "pair (num, den) of coefficients in descending powers of s"
)

REMEDIES = {
    "FrequencyResponseData": "measured points are no block: fit a transfer function to them first",
    "poly1d": "give numerator and denominator: (num, den)",
    "Polynomial": "give numerator and denominator, descending: (num.coef[::-1], den.coef[::-1])",
    "LowPassFilter": "pass its transfer function, .tf",
    "NRDOB": "pass one of its maps where a loop gain is needed, such as .L",
}
"""What to do with types that mean something, but no block, by name."""


class Fraction(NamedTuple):
    """A ratio of two real polynomials in s, coefficients in descending powers.

    Attributes
    ----------
    num, den : array of float
        The coefficients, without leading zeros.
    """

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
    system : control.TransferFunction, control.StateSpace, scipy.signal.lti, number or (num, den)
        The block. Pairs (tuples, lists or arrays of two rows) hold coefficients in descending
        powers of s. A state space is read exactly, see `nrdob.diagram.statespace`.
    name : str
        What the block is called in messages.
    proper : bool
        Whether a numerator of higher degree than the denominator is refused.

    Raises
    ------
    TypeError, ValueError
        If `system` is none of the types above; if it is not single-input single-output, not
        continuous-time, has coefficients that are no finite real numbers, a zero denominator, is
        improper where that is not allowed, or does not tell whether it has an integrator.

    Examples
    --------
    >>> as_fraction(([0, 2], [1, 3]), "process")
    Fraction(num=array([2.]), den=array([1., 3.]))
    """
    fraction = Fraction(*_read(system, name))
    if not fraction.den.any():
        raise ValueError(f"{name} has the denominator 0; give at least one nonzero coefficient")
    if proper and fraction.relative_degree < 0:
        raise ValueError(
            f"{name} is improper: numerator degree {fraction.num.size - 1} exceeds denominator "
            f"degree {fraction.den.size - 1}; add fast poles until it is proper"
        )
    return fraction


def nonzero(fraction: Fraction, name: str) -> Fraction:
    """Return `fraction`, or raise ValueError, with its name, if it is identically zero.

    Parameters
    ----------
    fraction, name : Fraction, str
    """
    if not fraction.num.any():
        raise ValueError(f"{name} is identically zero; its numerator needs a nonzero coefficient")
    return fraction


def real_number(
    value: Any, name: str, remedy: str, *, above: float | None = None, least: float | None = None
) -> float:
    """Read one real number, or raise TypeError with the `remedy`.

    Parameters
    ----------
    value : object
    name, remedy : str
        What it is called in the message, and what to give instead.
    above, least : float, optional
        A number that is not finite, not above this, or not at least that, is a ValueError.

    Examples
    --------
    >>> real_number("1", "delay", "give seconds as a number")
    Traceback (most recent call last):
    TypeError: delay is '1', a str; give seconds as a number
    """
    try:
        number = complex(value) if is_number(value) else 1j
    except OverflowError:
        number = complex(inf)
    if number.imag:
        raise TypeError(f"{name} is {value!r}, a {type(value).__name__}; {remedy}")
    below = above is not None and not above < number.real < inf
    if below or (least is not None and not least <= number.real < inf):
        raise ValueError(f"{name} is {value}; {remedy}")
    return number.real


def six_digits(value: float) -> float:
    """Round to what is worth printing; the last digits hang on the processor.

    Parameters
    ----------
    value : float
    """
    return float(f"{value:.6g}")


def is_number(value: Any) -> bool:
    """Tell whether `value` is one number: truth values and texts are none, 0-D arrays are.

    Parameters
    ----------
    value : object
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    return isinstance(value, Number) and not isinstance(value, bool | np.bool_)


def _read(system: Any, name: str) -> tuple[FloatArray, FloatArray]:
    if type(system).__name__ == "DelayedTransferFunction":  # its module is above this one
        if system.delay:
            raise ValueError(
                f"{name} has a dead time of {system.delay:g} s; it must be given without one: pass "
                "its .tf (in a loop, only the process and the model may have one)"
            )
        system = system.tf
    if isinstance(system, ct.StateSpace | ct.TransferFunction):
        _check_siso(name, system.ninputs, system.noutputs, system.dt, system.isctime())
    elif isinstance(system, signal.lti | signal.dlti):
        continuous = isinstance(system, signal.lti)
        _check_siso(name, system.inputs, system.outputs, system.dt, continuous)
    num: Any
    den: Any
    if isinstance(system, ct.TransferFunction):
        num, den = system.num_array[0, 0], system.den_array[0, 0]
    elif isinstance(system, ct.StateSpace | signal.StateSpace):
        return polynomials(system, name)
    elif isinstance(system, signal.TransferFunction):
        num, den = system.num, system.den
    elif isinstance(system, signal.ZerosPolesGain):  # its own to_tf drops small coefficients
        num, den = system.gain * np.poly(system.zeros), np.poly(system.poles)
    elif is_number(system):
        num, den = [system], [1.0]
    elif isinstance(system, tuple | list | np.ndarray) and len(system) == 2:
        num, den = system
    else:
        kind = type(system)
        remedy = REMEDIES.get(kind.__name__, ACCEPTED)
        if kind.__module__.startswith("sympy"):
            remedy = f"turn it into numbers first; {ACCEPTED}"
        raise TypeError(f"{name} is a {kind.__name__}; {remedy}")
    return _coefficients(num, f"{name} numerator"), _coefficients(den, f"{name} denominator")


def _check_siso(name: str, inputs: int, outputs: int, dt: Any, continuous: bool) -> None:
    if (inputs, outputs) != (1, 1):
        raise ValueError(
            f"{name} has {inputs} inputs and {outputs} outputs; this analysis is for one input and "
            "one output: pass one channel, for example sys[0, 0]"
        )
    if not continuous:
        raise ValueError(
            f"{name} is discrete-time (dt={dt}); this analysis is in continuous time: pass the "
            "continuous-time block"
        )


def _coefficients(values: Any, name: str) -> FloatArray:
    real = isinstance(values, np.ndarray) and values.dtype == float
    array = values if real else _numbers(values, name)
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"{name} has shape {array.shape}; it must be a non-empty 1-D list")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} is {values}; every coefficient must be a finite number")
    used = np.flatnonzero(array)
    return array[used[0] :] if used.size else array[-1:]


def _numbers(values: Any, name: str) -> FloatArray:
    if isinstance(values, np.polynomial.polynomial.Polynomial):
        raise TypeError(
            f"{name} is a Polynomial, whose coefficients ascend; pass them descending, .coef[::-1]"
        )
    try:
        array = np.array([] if values is None else values, dtype=object, ndmin=1)
    except ValueError:  # rows of different length
        array = np.array([None])
    given = array.ravel().tolist()
    if not all(map(is_number, given)):
        raise TypeError(f"{name} is {values!r}; it must be a list of real coefficients, numbers")
    if any(complex(value).imag for value in given if isinstance(value, complex)):
        raise TypeError(f"{name} has complex coefficients {values}; they must be real")
    try:
        real = [float(complex(value).real) for value in given]
    except OverflowError:
        real = [inf] * len(given)
    return np.array(real).reshape(array.shape)
