r"""Functions on the unit circle as sums of products, and certified counts of their zeros.

With v = (z - 1)/(z + 1), a polynomial of degree n in v, divided by (1 + v)^n, has the factors

.. math:: \frac{v - v_i}{1 + v} = \frac{(1 - v_i) - (1 + v_i)\,z^{-1}}{2}

each of which is linear in 1/z: over an angle h on the circle it moves by at most
:math:`h|1 + v_i|/2`. That bounds how far a product, and a sum of products, can move in an interval.
Where it is less than the function's size, the function has not passed 0, and its argument is known.
The number of zeros outside the circle is minus the turn of the argument from z = 1 to z = -1, in
half revolutions. Where the terms behind one dead time are certainly larger than all others, the
argument follows theirs within a right angle, and z^-samples turns it by exactly samples times the
angle: so the number of intervals grows with the logarithm of the samples.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, reduce
from math import nan, pi
from typing import NamedTuple

import numpy as np

from ..numerics import (
    ROUNDING,
    ComplexArray,
    FloatArray,
    IntArray,
    QuasiPolynomial,
    add,
    companion_roots,
)
from .bilinear import MULTIPLIED_OUT

__all__ = [
    "CircleFunction", "Group", "Product", "TurnCount", "count_outside", "multiplied_out",
    "resolved",
]  # fmt: skip

TURN = 0.6  # how far a function may get within half an interval, against its own size

SMALLEST, MOST = 2.0**-48, 400_000
"""Half width of an interval, against its angle, at which it is halved no more; most intervals."""

TOGETHER = 8  # samples between terms that are taken together, behind one dead time
FIRST = np.linspace(0, pi, 17)
"""Ends of the intervals that are tried first."""
FREE, OPEN = -1, -2  # marks of an interval: the function has no zero there; it may have one


@dataclass(frozen=True, eq=False)
class Product:
    """A product of real polynomials of v, each over (1 + v)^degree, times z^-samples.

    It is evaluated at z = exp(j·angle), v = j tan(angle/2), for angles from 0 to π. The factors are
    in descending powers of v; leading zeros count as roots at z = -1.
    """

    factors: tuple[FloatArray, ...]
    samples: int = 0

    def __call__(self, angle: FloatArray) -> ComplexArray:
        """Values at these angles."""
        sine, cosine = _half(angle)
        turns = self.samples + sum(factor.size - 1 for factor in self.factors) / 2
        value = np.exp(-1j * turns * angle)
        for factor in self.factors:
            value = value * _homogeneous(factor, 1j * sine, cosine)
        return np.asarray(value)

    def size(self, angle: FloatArray) -> FloatArray:
        """Sum of the sizes of all that is added up, against which rounding is measured."""
        parts = (_homogeneous(np.abs(factor), *_half(angle)) for factor in self.factors)
        return np.asarray(reduce(np.multiply, parts, np.ones(angle.shape)).real)

    def reach(self, angle: FloatArray, half: FloatArray) -> FloatArray:
        """How far the product can get from its value at `angle` within `half` an interval."""
        a, b = self._linear
        sizes = np.abs(_linear(a, b, angle))
        moved = sizes + np.abs(a + b)[:, None] / 2 * half
        far = moved.prod(axis=0) * (1 + np.minimum(self.samples * half, 2.0))
        return np.asarray(self._leading * (far - sizes.prod(axis=0)))

    def slope(self, angle: FloatArray) -> ComplexArray:
        """Logarithmic derivative with respect to the angle; infinite at a zero on the circle."""
        a, b = self._linear
        with np.errstate(divide="ignore", invalid="ignore"):
            each = -0.5j * _linear(b, a, angle) / _linear(a, b, angle)
        return np.asarray(each.sum(axis=0) - 1j * (self.samples + a.size / 2))

    @property
    def inside(self) -> Product:
        """The product without its zeros at z = 1 and z = -1, near which it turns no more."""
        return Product(tuple(np.trim_zeros(factor) for factor in self.factors), self.samples)

    @cached_property
    def _leading(self) -> float:
        """Size of the product of the leading coefficients."""
        return float(np.prod([abs(np.trim_zeros(factor, "f")[0]) for factor in self.factors]))

    @cached_property
    def _linear(self) -> tuple[ComplexArray, ComplexArray]:
        """The a and b of the linear factors (a v - b)/(1 + v): a = 1 but for roots at z = -1."""
        used = [np.trim_zeros(factor, "f") for factor in self.factors]
        roots = np.concatenate([np.empty(0, dtype=complex), *map(companion_roots, used)])
        at_infinity = sum(factor.size for factor in self.factors) - sum(p.size for p in used)
        finite = np.arange(roots.size + at_infinity) < roots.size
        return finite.astype(complex), np.append(roots, np.ones(at_infinity))


@dataclass(frozen=True, eq=False)
class CircleFunction:
    """A sum of products on the unit circle, all over the same power of 1 + v."""

    terms: tuple[Product, ...]

    def __call__(self, angle: FloatArray) -> ComplexArray:
        """Values at these angles."""
        return np.asarray(sum(term(angle) for term in self.terms))

    def rounding(self, angle: FloatArray) -> FloatArray:
        """Bound of the rounding error."""
        turned = np.finfo(float).eps * angle
        return np.asarray(
            sum((ROUNDING + term.samples * turned) * term.size(angle) for term in self.terms)
        )

    def reach(self, angle: FloatArray, half: FloatArray) -> FloatArray:
        """How far the function can get from its value at `angle` within `half` an interval."""
        return np.asarray(sum(term.reach(angle, half) for term in self.terms))

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The terms behind one dead time, or nearly one, together."""
        found: list[Group] = []
        for term in sorted(self.terms, key=lambda term: term.samples):
            samples, terms = term.samples, tuple[Product, ...]()
            if found and term.samples - found[-1].samples <= TOGETHER:
                samples, terms = found[-1].samples, found.pop().bare.terms
            bare = Product(term.factors, term.samples - samples)
            found.append(Group(samples, CircleFunction((*terms, bare))))
        return tuple(found)

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
        return QuasiPolynomial(multiplied_out(self.terms, longest))


class Group(NamedTuple):
    """Terms behind a dead time: z^-samples times a `bare` sum of low degree in 1/z."""

    samples: int
    bare: CircleFunction


@dataclass(frozen=True)
class TurnCount:
    """Zeros outside the unit circle, z = ∞ included; None if one is on it, at the angle in rad."""

    count: int | None
    angle: float = nan


def multiplied_out(terms: Iterable[Product], samples: int) -> FloatArray:
    """Multiply a sum of products out, z^-k = ((1 - v)/(1 + v))^k, over (1 + v)^samples further.

    No term has a longer dead time; the result is in descending powers of v.
    """
    total: FloatArray = np.zeros(1)
    for term in terms:
        powers = [np.array([-1.0, 1.0])] * term.samples + [np.ones(2)] * (samples - term.samples)
        total = add(total, reduce(np.convolve, (*term.factors, *powers)))
    return total


def count_outside(function: CircleFunction) -> TurnCount:
    """Count the zeros outside the unit circle by the turn of the argument."""
    ends = np.array([0.0, pi])
    at_ends = np.abs(function(ends)) <= function.rounding(ends)
    if at_ends.any():
        return TurnCount(None, float(ends[at_ends][0]))
    found = _certified(function, dominance=True)
    if found.touched is not None:
        return TurnCount(None, found.touched)
    return TurnCount(round(-_turned(function, found) / pi))


def resolved(function: CircleFunction) -> FloatArray:
    """Angles from 0 to π between which a function provably turns by less than a right angle."""
    low, high, *_ = _certified(function, dominance=False)
    return np.unique(np.concatenate([low, high, (low + high) / 2]))


class _Certified(NamedTuple):
    """Intervals, the number of the dominant group in each or `FREE`, and an angle of a zero."""

    low: FloatArray
    high: FloatArray
    mark: IntArray
    touched: float | None


def _certified(function: CircleFunction, *, dominance: bool) -> _Certified:
    """Cut the upper half of the circle into intervals over which the argument is known."""
    low, high = FIRST[:-1], FIRST[1:]
    done: list[tuple[FloatArray, FloatArray, IntArray]] = []
    total = 0
    touched: float | None = None
    while low.size:
        middle, half = (low + high) / 2, (high - low) / 2
        mark, value = _examined(function, middle, half, dominance)
        zero = (mark == OPEN) & (half <= 1e-3 * middle)
        zero[zero] = value[zero] <= function.rounding(middle[zero])
        zero |= (mark == OPEN) & (half <= SMALLEST * middle)
        if zero.any() and touched is None:
            touched = float(middle[zero][0])
        wide = (mark == OPEN) & ~zero
        done.append((low[~wide], high[~wide], mark[~wide]))
        total += middle.size
        low, middle, high = low[wide], middle[wide], high[wide]
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        if total > MOST:
            raise ArithmeticError(
                "the sampled loop turns too often on the unit circle to be followed: the dead "
                "time holds too many samples, or modes are hardly damped; choose a larger dt"
            )
    lows, highs, marks = map(np.concatenate, zip(*done, strict=True))
    return _Certified(lows, highs, marks, touched)


def _examined(
    function: CircleFunction, middle: FloatArray, half: FloatArray, dominance: bool
) -> tuple[IntArray, FloatArray]:
    """Say what certifies each interval, and how large the function is in its middle."""
    delays = np.array([[group.samples] for group in function.groups])
    values = np.array([group.bare(middle) for group in function.groups])
    reaches = np.array([group.bare.reach(middle, half) for group in function.groups])
    sizes = np.abs(values)
    total = np.abs((values * np.exp(-1j * delays * middle)).sum(axis=0))
    far = (reaches + sizes * np.minimum(delays * half, 2.0)).sum(axis=0)
    mark = np.where(far <= TURN * total, FREE, OPEN)
    if dominance and len(values) > 1:  # one less its reach is more than what the others can be
        leads = 2 * sizes > (sizes + reaches).sum(axis=0) + function.rounding(middle)
        mark = np.where(leads.any(axis=0), leads.argmax(axis=0), mark)
    return mark, total


def _turned(function: CircleFunction, found: _Certified) -> float:
    """Sum of what the argument turns over certified intervals."""
    edges = np.stack([found.low, found.high])
    sums, free = function(edges), found.mark == FREE
    angle = float(np.angle(sums[1, free] / sums[0, free]).sum())
    for k, group in enumerate(function.groups):
        on = found.mark == k
        at, value = edges[:, on], group.bare(edges[:, on])
        # The group without its dead time, the dead time, and the angles from it to the sum.
        angle += float(np.angle(value[1] / value[0]).sum())
        angle -= group.samples * float((at[1] - at[0]).sum())
        beside = np.angle(sums[:, on] / (value * np.exp(-1j * group.samples * at)))
        angle += float((beside[1] - beside[0]).sum())
    return angle


def _half(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of half an angle, the latter 0 at π."""
    return np.sin(angle / 2), np.sin((pi - angle) / 2)


def _homogeneous(factor: FloatArray, x: ComplexArray | FloatArray, y: FloatArray) -> ComplexArray:
    """Σ p_k x^k y^(n-k): with v = x/y, and 1 + v = exp(j·angle/2)/y, p(v)/(1 + v)^n but a turn."""
    value, power = np.asarray(factor[0]), np.ones(())
    for coefficient in factor[1:].tolist():
        power = power * y
        value = value * x + coefficient * power
    return value


def _linear(a: ComplexArray, b: ComplexArray, angle: FloatArray) -> ComplexArray:
    """Linear factors a v - b over 1 + v, but for a turn that all share: one row for each."""
    sine, cosine = _half(angle)
    return np.asarray(np.multiply.outer(a, 1j * sine) - np.multiply.outer(b, cosine))
