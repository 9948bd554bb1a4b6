"""Pure dead time, kept exact: a rational transfer function times exp(-sT)."""

from __future__ import annotations

import sys
from math import inf, nan
from typing import Any

import control as ct
import numpy as np

from ..numerics import ComplexArray, FloatArray, is_whole
from .blocks import as_fraction, real_number, six_digits

__all__ = ["DelayedTransferFunction", "delay", "undelayed"]


class DelayedTransferFunction:
    r"""A process with dead time, :math:`G(s) = G_0(s)\,e^{-sT}`.

    It multiplies and divides with `control.TransferFunction`, with numbers and with its own kind.
    Sums need equal dead times, powers whole numbers; two are equal if dead time and coefficients
    are, for a denominator that starts with 1.

    Parameters
    ----------
    tf : control.TransferFunction, control.StateSpace, number or (num, den)
        The rational part :math:`G_0`.
    delay : float
        The dead time :math:`T \ge 0`, in seconds.

    Raises
    ------
    TypeError, ValueError
        If `delay` is no real number, negative or not finite, or the rational part is not SISO
        continuous-time.

    Examples
    --------
    >>> import control as ct
    >>> s = ct.tf('s')
    >>> G = delay(0.05) / (s + 2)**2
    >>> G.delay, [float(c) for c in G.tf.den[0][0]]
    (0.05, [1.0, 4.0, 4.0])
    """

    __array_ufunc__ = None  # numpy scalars on the left then use __rmul__

    def __init__(self, tf: Any, delay: float) -> None:
        remedy = (
            "a dead time is a finite number of seconds, zero or positive (a negative one would "
            "predict the future)"
        )
        self.delay = real_number(delay, "delay", remedy, least=0.0)
        self.tf = ct.tf(*as_fraction(tf, "the rational part", proper=False))

    def __call__(self, s: complex | ComplexArray) -> Any:
        """Evaluate at complex `s`, a number or an array of any shape, in rad/s."""
        s = np.asarray(s, dtype=complex)
        num, den = (np.polyval(part, s) for part in self._coefficients)
        with np.errstate(all="ignore"):
            value = num / den * np.exp(-self.delay * s)
            return np.where((den == 0) | np.isnan(value), inf, value)[()]

    def poles(self) -> ComplexArray:
        """Poles of the rational part in rad/s, as `control.poles`; the dead time has none."""
        return np.asarray(self.tf.poles())

    def zeros(self) -> ComplexArray:
        """Zeros of the rational part in rad/s, as `control.zeros`; the dead time has none."""
        return np.asarray(self.tf.zeros())

    def dcgain(self) -> float:
        """Value at s = 0, infinite with a pole there and nan for 0/0, as `control.dcgain`."""
        num, den = (float(part[-1]) for part in self._coefficients)
        return num / den if den else inf if num else nan

    def __mul__(self, other: Any) -> DelayedTransferFunction:
        factor = _as_delayed(other, "the other factor")
        return DelayedTransferFunction(self.tf * factor.tf, self.delay + factor.delay)

    __rmul__ = __mul__  # SISO blocks commute

    def __truediv__(self, other: Any) -> DelayedTransferFunction:
        divisor = _as_delayed(other, "the divisor")
        if not np.any(divisor.tf.num_array[0, 0]):
            raise ZeroDivisionError("the divisor is identically zero")
        left = self.delay - divisor.delay
        if abs(left) <= 4 * np.finfo(float).eps * self.delay:
            left = 0.0  # 0.3 - 0.1 - 0.2 is not 0 in floating point
        if left < 0:
            raise ValueError(
                f"a dead time of {self.delay:g} s divided by one of {divisor.delay:g} s is an "
                "advance, which is not causal: it would predict the future; divide by the rational "
                "part alone, .tf"
            )
        return DelayedTransferFunction(self.tf / divisor.tf, left)

    def __rtruediv__(self, other: Any) -> DelayedTransferFunction:
        return _as_delayed(other, "the dividend") / self

    def __pow__(self, exponent: int) -> DelayedTransferFunction:
        if not is_whole(exponent):
            raise TypeError(f"the exponent is {exponent!r}; a power needs a whole number")
        if exponent < 0:
            return DelayedTransferFunction(1.0, 0.0) / self.__pow__(-int(exponent))
        return DelayedTransferFunction(self.tf ** int(exponent), self.delay * int(exponent))

    def __add__(self, other: Any) -> DelayedTransferFunction:
        term = _as_delayed(other, "the other term")
        if term.delay != self.delay:
            raise ValueError(
                f"a sum of terms with dead times {self.delay:g} s and {term.delay:g} s is no "
                "rational function times one dead time; for a closed loop use nrdob.NRDOB, which "
                "keeps the dead time exact"
            )
        return DelayedTransferFunction(self.tf + term.tf, self.delay)

    __radd__ = __add__

    def __sub__(self, other: Any) -> DelayedTransferFunction:
        return self + -_as_delayed(other, "the other term")

    def __rsub__(self, other: Any) -> DelayedTransferFunction:
        return _as_delayed(other, "the other term") + -self

    def __neg__(self) -> DelayedTransferFunction:
        return DelayedTransferFunction(-self.tf, self.delay)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, DelayedTransferFunction):
            return NotImplemented
        return self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    def __array__(self, *_: Any, **__: Any) -> FloatArray:
        # control.TransferFunction takes a divisor that it does not know for an array, and replaces
        # whatever is raised here by a sentence about types. If there is more than one entry, it
        # leaves the division to __rtruediv__, which knows the quotient, or why there is none.
        asking = sys._getframe(1)
        dividing = asking.f_back.f_code.co_name if asking.f_back else ""
        if (asking.f_code.co_name, dividing) == ("_convert_to_transfer_function", "__truediv__"):
            return np.ones((2, 2))
        raise TypeError("a DelayedTransferFunction is no array")

    def __repr__(self) -> str:
        num, den = ([six_digits(c) for c in part] for part in self._coefficients)
        return f"DelayedTransferFunction(({num}, {den}), delay={six_digits(self.delay)})"

    @property
    def _coefficients(self) -> tuple[FloatArray, FloatArray]:
        return self.tf.num_array[0, 0], self.tf.den_array[0, 0]

    @property
    def _key(self) -> tuple[Any, ...]:
        """What two equal ones share: coefficients for a monic denominator, and the dead time."""
        num, den = as_fraction(self.tf, "the rational part", proper=False)
        return tuple((num / den[0]).tolist()), tuple((den / den[0]).tolist()), self.delay


def delay(seconds: float) -> DelayedTransferFunction:
    """Pure dead time exp(-s·seconds), to be multiplied with a transfer function.

    Parameters
    ----------
    seconds : float
        The dead time, zero or positive.

    Returns
    -------
    DelayedTransferFunction
        With `.tf` 1; products with transfer functions keep the delay exact.

    Raises
    ------
    TypeError, ValueError
        If `seconds` is no real number, negative or not finite.

    Examples
    --------
    >>> delay(2.0).delay
    2.0
    """
    return DelayedTransferFunction(1.0, seconds)


def undelayed(block: Any) -> tuple[Any, float]:
    """Take the dead time off a block: the block without it, and the dead time in seconds.

    Parameters
    ----------
    block : block or DelayedTransferFunction
    """
    return (block.tf, block.delay) if isinstance(block, DelayedTransferFunction) else (block, 0.0)


def _as_delayed(block: Any, name: str) -> DelayedTransferFunction:
    if isinstance(block, DelayedTransferFunction):
        return block
    if isinstance(block, tuple | list):  # in a product [1, 2] would look like a vector
        raise TypeError(f"{name} is a {type(block).__name__}; write control.tf(num, den)")
    return DelayedTransferFunction(ct.tf(*as_fraction(block, name, proper=False)), 0.0)
