r"""Blocks of a sampled controller as second-order sections that stay accurate at a short dt.

Sampled fast, every pole lies next to z = 1, and in powers of z the digits go into saying so: a lag
of 1 s sampled at 1 ms has :math:`a_2 = 1 + a_1 + \dots`, of which six digits are about the lag. In
powers of :math:`\delta = z - 1` nothing has to be subtracted (Middleton and Goodwin, IEEE Trans.
Automatic Control 31, 1986, 1015-1021):

.. math:: \frac{b_0\delta^2 + b_1\delta + b_2}{\delta^2 + a_1\delta + a_2}

and the section is as short as the usual one, with sums in place of shifts::

    w  = b0 v + x1          x1 += x2 + b1 v - a1 w          x2 += b2 v - a2 w
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, reduce
from typing import NamedTuple

import numpy as np

from ..numerics import ComplexArray, FloatArray, roots_by_time_scale

__all__ = ["Section", "StateSpace", "at_rest", "bilinear_sections", "state_space"]

AT_INFINITY = 1e-12  # size of 1 - αp for a pole p at which its image is z = ∞


class StateSpace(NamedTuple):
    """Difference equations x[k+1] = A x[k] + B v[k], w[k] = C x[k] + D v[k]; B, C are vectors."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: float


class Section(NamedTuple):
    """One second-order section (b0 δ² + b1 δ + b2)/(δ² + a1 δ + a2), δ = z - 1.

    One of first order has b2 = a2 = 0 and stands for (b0 δ + b1)/(δ + a1); a number is b0 alone.

    Attributes
    ----------
    b0, b1, b2, a1, a2 : float
    """

    b0: float
    b1: float = 0.0
    b2: float = 0.0
    a1: float = 0.0
    a2: float = 0.0

    @property
    def integrates(self) -> bool:
        """Whether there is a pole at z = 1, so that the output at rest is not determined."""
        return (self.b2 != 0 or self.b1 != 0) and self._last[1] == 0

    @property
    def rest(self) -> float:
        """Output at rest over input, the gain at z = 1; 0 for a section that integrates."""
        num, den = self._last
        if self.integrates:
            return 0.0
        return num / den if den else self.b0

    @property
    def order(self) -> int:
        """Number of states: 0, 1 or 2."""
        if self.b2 != 0 or self.a2 != 0:
            return 2
        return int(self.b1 != 0 or self.a1 != 0)

    @property
    def _last(self) -> tuple[float, float]:
        return (self.b2, self.a2) if self.order == 2 else (self.b1, self.a1)


def bilinear_sections(
    num: Sequence[FloatArray], den: Sequence[FloatArray], alpha: float, name: str = "the block"
) -> tuple[Section, ...]:
    """Put a block of w = (z - 1)/(α (z + 1)) into sections, those that integrate last.

    It is proper and given by its factors, in descending powers of w; with α = dt/2, in seconds, and
    s for w this is Tustin's rule. A pole at w = 1/α, whose image is z = ∞, raises a ValueError.
    """
    (top, zeros), (bottom, poles) = map(_leading_and_roots, (num, den))
    if top == 0:
        return (Section(0.0),)
    # w - p = ((1 - αp) δ - 2αp)/(α (δ + 2)): a zero at w = 1/α is none in δ.
    scale_zeros, scale_poles = 1 - alpha * zeros, 1 - alpha * poles
    if (np.abs(scale_poles) < AT_INFINITY).any():
        raise ValueError(
            f"{name} has a pole at {1 / alpha:.6g} rad/s, which Tustin's rule maps to z = ∞: it "
            "would need y before it is there; choose another dt"
        )
    lost = scale_zeros == 0
    factors = np.where(lost, -2.0, scale_zeros)
    excess = poles.size - zeros.size
    gain = top / bottom * alpha**excess * np.prod(factors) / np.prod(scale_poles)
    mapped = 2 * alpha * zeros[~lost] / scale_zeros[~lost]
    return _paired(
        np.append(mapped, np.full(excess, -2.0)), 2 * alpha * poles / scale_poles, float(gain.real)
    )


def state_space(cascade: Sequence[Section]) -> StateSpace:
    """Write sections as a state space with the sums x1, x2 of each as states."""
    return reduce(_behind, map(_realised, cascade))


def at_rest(cascade: Sequence[Section], input: float, output: float) -> FloatArray:
    """States of rest at a constant input, shape (n,), as `state_space` orders them.

    A section that integrates gets an `output`; its input at rest is 0.
    """
    states: list[float] = []
    for section in cascade:
        b0, b1, _, a1, _ = section
        value = output if section.integrates else section.rest * input
        states += [value - b0 * input, a1 * value - b1 * input][: section.order]
        input = value
    return np.array(states)


def _leading_and_roots(factors: Sequence[FloatArray]) -> tuple[float, ComplexArray]:
    leading, roots = zip(*(_factored(tuple(factor.tolist())) for factor in factors), strict=True)
    return float(np.prod(leading)), np.concatenate(roots)


@lru_cache(maxsize=256)  # of one loop at many sampling times they are the same
def _factored(p: tuple[float, ...]) -> tuple[float, ComplexArray]:
    """Leading coefficient and roots, those at 0 exactly."""
    there = np.flatnonzero(p)
    if not there.size:
        return 0.0, np.empty(0, dtype=complex)
    q = np.array(p[there[0] : there[-1] + 1])
    return q[0], np.append(roots_by_time_scale(q), np.zeros(len(p) - 1 - there[-1]))


def _paired(zeros: ComplexArray, poles: ComplexArray, gain: float) -> tuple[Section, ...]:
    """Put zeros and poles in δ into sections, neighbours together."""
    if poles.size == 0:
        return (Section(gain),)
    nums, dens = _factors(zeros), _factors(poles)
    share = abs(gain) ** (1 / len(dens))
    found: list[Section] = []
    for den in sorted(dens, key=lambda den: (den.size, abs(den[-1]))):
        fitting = [num for num in nums if num.size <= den.size]
        num = min(fitting, key=lambda num: abs(_mean(num) - _mean(den)), default=np.ones(1))
        nums = [other for other in nums if other is not num]
        sign = np.sign(gain) if not found else 1.0
        # A numerator may begin with 0, and a factor of first order ends with it.
        late, end = [0.0] * (den.size - num.size), [0.0] * (3 - den.size)
        b, a = (sign * share * num).tolist(), den[1:].tolist()
        found.append(Section(*late, *b, *end, *a, *end))
    return tuple(sorted(found, key=lambda section: section.integrates))


def _factors(roots: ComplexArray) -> list[FloatArray]:
    """Real polynomials of second order with these roots, and one of first order if need be."""
    upper = roots[roots.imag > 0]
    real = sorted(roots[roots.imag == 0].real.tolist(), key=abs)
    alone = [np.array([1.0, 0.0 - real.pop(0)])] if len(real) % 2 else []
    pairs = [
        np.array([1.0, 0.0 - (a + b), a * b]) for a, b in zip(real[::2], real[1::2], strict=True)
    ]
    return alone + pairs + [np.array([1.0, -2 * r.real, abs(r) ** 2]) for r in upper.tolist()]


def _mean(factor: FloatArray) -> float:
    return float(-factor[1] / (factor.size - 1))


def _realised(section: Section) -> StateSpace:
    b0, b1, b2, a1, a2 = section
    n = section.order
    A, B, C = [[1 - a1, 1.0], [-a2, 1.0]], [b1 - a1 * b0, b2 - a2 * b0], [1.0, 0.0]
    return StateSpace(np.array(A)[:n, :n], np.array(B)[:n], np.array(C)[:n], b0)


def _behind(first: StateSpace, second: StateSpace) -> StateSpace:
    """Feed the output of one realisation into another one."""
    (A, B, C, D), (A2, B2, C2, D2) = first, second
    joined = np.block([[A, np.zeros((B.size, B2.size))], [np.outer(B2, C), A2]])
    return StateSpace(joined, np.append(B, B2 * D), np.append(D2 * C, C2), D2 * D)
