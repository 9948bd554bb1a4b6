r"""Functions on the unit circle as sums of products, and certified counts of their zeros.

With v = αw = (z - 1)/(z + 1) a polynomial of degree n in w, divided by (1 + v)^n, is a product of
factors

.. math:: \frac{v - v_i}{1 + v} = \frac{(1 - v_i) - (1 + v_i)\,z^{-1}}{2}

each of which is linear in 1/z: over an angle h on the circle it moves by at most
:math:`h|1 + v_i|/2`. So a bound is at hand for how far a product, and a sum of products, can get in
an interval. Where that is less than where it is, it has not passed 0, and its argument is known.
The number of zeros outside the circle is minus the turn of the argument from z = 1 to z = -1, in
half revolutions.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, reduce
from math import pi

import numpy as np

from ..numerics import (
    ROUNDING,
    ComplexArray,
    FloatArray,
    QuasiPolynomial,
    add,
    companion_roots,
)
from .wplane import MULTIPLIED_OUT

__all__ = ["CircleFunction", "Product", "TurnCount", "count_outside", "resolved"]

TURN = 0.6
"""How far a function may get within half an interval, against its own size."""

SMALLEST = 2.0**-48
"""Half width of an interval, against its angle, at which it is halved no more."""

MOST = 400_000
"""Intervals at most."""


@dataclass(frozen=True, eq=False)
class Product:
    """A product of real polynomials of v = αw, each over (1 + v)^degree, times z^-samples.

    Attributes
    ----------
    factors : tuple of arrays of float
        Coefficients in descending powers of v. Leading zeros count as roots at z = -1.
    samples : int
        Dead time in samples.
    """

    factors: tuple[FloatArray, ...]
    samples: int = 0

    def __call__(self, angle: FloatArray) -> ComplexArray:
        """Values at z = exp(j·angle).

        Parameters
        ----------
        angle : array of float
            From 0 to π.
        """
        value = np.exp(-1j * self.samples * angle)
        for factor in self.factors:
            value = value * _over_power(factor, angle)
        return np.asarray(value)

    def size(self, angle: FloatArray) -> FloatArray:
        """Sum of the sizes of all that is added up, against which rounding is measured.

        Parameters
        ----------
        angle : array of float
            From 0 to π.
        """
        value = np.ones(angle.shape)
        for factor in self.factors:
            value = value * np.abs(_over_power(np.abs(factor), angle, size=True))
        return np.asarray(value)

    def reach(self, angle: FloatArray, half: FloatArray) -> FloatArray:
        """How far the product can get from its value at `angle` within `half` an interval.

        Parameters
        ----------
        angle, half : array of float, shape (N,)
            Angles and half widths.
        """
        at = np.full(angle.shape, abs(self._leading))
        far = at * (1 + np.minimum(self.samples * half, 1.0))
        v = np.tan(angle / 2)
        top = np.sqrt(1 + v**2)
        for root in self._roots:
            size = np.abs(1j * v - root) / top
            far = far * (size + half * abs(1 + root) / 2)
            at = at * size
        for _ in range(self._at_minus_one):
            far = far * (1 / top + half / 2)
            at = at / top
        return np.asarray(far - at)

    def slope(self, angle: FloatArray) -> ComplexArray:
        """Logarithmic derivative with respect to the angle.

        Parameters
        ----------
        angle : array of float
            Between 0 and π.
        """
        v = 1j * np.tan(angle / 2)
        total = np.full(angle.shape, -1j * self.samples)
        with np.errstate(divide="ignore", invalid="ignore"):  # at a zero on the circle
            for root in self._roots:
                total += 0.5j * (1 + root) * (1 - v) / (v - root)
        return np.asarray(total - 0.5j * self._at_minus_one * (1 - v))

    @property
    def inside(self) -> Product:
        """The product without its zeros at z = 1 and z = -1, beside which it turns no more."""
        return Product(tuple(np.trim_zeros(factor) for factor in self.factors), self.samples)

    @cached_property
    def _roots(self) -> ComplexArray:
        found = [companion_roots(_used(factor)) for factor in self.factors if factor.any()]
        return np.concatenate([*found, np.empty(0, dtype=complex)])

    @cached_property
    def _leading(self) -> float:
        return float(np.prod([_used(factor)[0] for factor in self.factors]))

    @cached_property
    def _at_minus_one(self) -> int:
        return sum(factor.size - _used(factor).size for factor in self.factors)


@dataclass(frozen=True, eq=False)
class CircleFunction:
    """A sum of products on the unit circle, all over the same power of 1 + v.

    Attributes
    ----------
    terms : tuple of Product
        What is added up.
    """

    terms: tuple[Product, ...]

    def __call__(self, angle: FloatArray) -> ComplexArray:
        """Values at z = exp(j·angle).

        Parameters
        ----------
        angle : array of float
            From 0 to π.
        """
        return np.asarray(sum(term(angle) for term in self.terms))

    def rounding(self, angle: FloatArray) -> FloatArray:
        """Bound of the rounding error.

        Parameters
        ----------
        angle : array of float
            From 0 to π.
        """
        return np.asarray(ROUNDING * sum(term.size(angle) for term in self.terms))

    def reach(self, angle: FloatArray, half: FloatArray) -> FloatArray:
        """How far the function can get from its value at `angle` within `half` an interval.

        Parameters
        ----------
        angle, half : array of float, shape (N,)
            Angles and half widths.
        """
        return np.asarray(sum(term.reach(angle, half) for term in self.terms))

    @property
    def vanishes_at_one(self) -> bool:
        """Whether all terms have a zero at z = 1 exactly."""
        return all(any(f[-1] == 0 for f in term.factors) for term in self.terms)

    @cached_property
    def polynomial(self) -> QuasiPolynomial | None:
        """The function times (1 + v)^degree, or None if its dead time holds too many samples."""
        longest = max(term.samples for term in self.terms)
        if longest > MULTIPLIED_OUT:
            return None
        total: FloatArray = np.zeros(1)
        for term in self.terms:
            powers = [np.array([-1.0, 1.0])] * term.samples
            powers += [np.ones(2)] * (longest - term.samples)
            total = add(total, reduce(np.convolve, (*term.factors, *powers)))
        return QuasiPolynomial(total)


@dataclass(frozen=True)
class TurnCount:
    """How many zeros lie outside the unit circle.

    Attributes
    ----------
    count : int or None
        The zeros outside the circle, z = ∞ included; None if one lies on it within rounding.
    angle : float
        Where that is, in radians; nan if it is nowhere.
    """

    count: int | None
    angle: float = field(default=float("nan"))


def resolved(function: CircleFunction) -> tuple[FloatArray, float | None]:
    """Angles between which a function provably turns by less than a right angle.

    Parameters
    ----------
    function : CircleFunction
        On the unit circle.

    Returns
    -------
    angles : array of float
        From 0 to π.
    touched : float or None
        An angle at which the function is 0 within rounding, if there is one.

    Raises
    ------
    ArithmeticError
        If it takes too many of them.
    """
    edges = np.array([0.0, pi])
    low, high = edges[:1], edges[1:]
    kept, total = [edges], 2
    touched: float | None = None
    while low.size:
        middle, half = (low + high) / 2, (high - low) / 2
        value = np.abs(function(middle))
        wide = function.reach(middle, half) > TURN * value
        zero = wide & (half <= 1e-3 * middle)
        zero[zero] = value[zero] <= function.rounding(middle[zero])
        if zero.any() or np.any(wide & (half <= SMALLEST * middle)):
            hit = zero | (half <= SMALLEST * middle)
            touched = float(middle[hit][0]) if touched is None else touched
            wide &= ~hit
        low, high = (
            np.concatenate([low[wide], middle[wide]]),
            np.concatenate([middle[wide], high[wide]]),
        )
        kept.append(middle)
        total += middle.size
        if total > MOST:
            raise ArithmeticError(
                "the sampled loop turns too often on the unit circle to be followed: the dead "
                "time holds too many samples, or modes are hardly damped; choose a larger dt"
            )
    return np.unique(np.concatenate(kept)), touched


def count_outside(function: CircleFunction) -> TurnCount:
    """Count the zeros outside the unit circle by the turn of the argument.

    Parameters
    ----------
    function : CircleFunction
        On the unit circle.

    Returns
    -------
    TurnCount
        The count, or where the function is 0.

    Examples
    --------
    1 - 2/z, that is v + 1 less 2 (1 - v), over 1 + v:

    >>> import numpy as np
    >>> count_outside(CircleFunction((Product((np.array([3.0, -1.0]),)),))).count
    1
    """
    ends = np.array([0.0, pi])
    at_ends = np.abs(function(ends)) <= function.rounding(ends)
    if at_ends.any():
        return TurnCount(None, float(ends[at_ends][0]))
    angles, touched = resolved(function)
    if touched is not None:
        return TurnCount(None, touched)
    value = function(angles)
    turns = -np.angle(value[1:] / value[:-1]).sum() / pi
    return TurnCount(round(float(turns)))


def _over_power(factor: FloatArray, angle: FloatArray, *, size: bool = False) -> ComplexArray:
    """p(v)/(1 + v)^degree on the circle, v = j tan(angle/2); with `size`, at |v|."""
    # Beside z = -1, where v is large, in powers of 1/v.
    near, degree = angle <= pi / 2, factor.size - 1
    unit = 1.0 if size else 1j
    value = np.empty(angle.shape, dtype=complex)
    v = np.tan(angle[near] / 2)
    value[near] = np.polyval(factor, unit * v) / (1 + 1j * v) ** degree
    inverse = np.tan((pi - angle[~near]) / 2)
    value[~near] = np.polyval(factor[::-1], inverse / unit) / (1 - 1j * inverse) ** degree
    return value


def _used(factor: FloatArray) -> FloatArray:
    return factor[np.flatnonzero(factor)[0] :]
