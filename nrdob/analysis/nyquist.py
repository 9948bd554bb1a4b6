"""Encirclements that can be trusted: the Nyquist criterion counted with a certificate.

For a loop L = num/den the function 1 + L is p/den with p = num + den, so it encircles 0 as often as
p does, less the encirclements by den. Both are counted without a plot: the argument of p and that
of every factor of den are followed along the axis in certified steps (`nrdob.numerics.argument`).
That is N, positive clockwise as in `control.nyquist_response`; P comes from the coefficients or
roots of the factors alone, and Z = N + P. Poles on the axis, of any multiplicity, are left of the
contour, which passes them on the right; the arcs at infinity of improper loops are contained in the
degrees.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from ..diagram import Quotient, as_quotient
from ..numerics import QuasiPolynomial, RootCount, Term, add, count_rhp, follow_together

__all__ = [
    "NyquistCount", "closed_around", "encirclements", "minus_point", "nyquist_count", "rhp_roots",
]  # fmt: skip


@dataclass(frozen=True)
class NyquistCount:
    """Encirclements and what they mean, Z = N + P.

    Attributes
    ----------
    encirclements : float or None
        N, clockwise positive; None where the curve meets the point, infinite where it circles the
        point for ever.
    open_loop_rhp, closed_loop_rhp : float or None
        P, poles in the open right half plane before any cancellation, and Z, zeros of L - point.
    reason : str
        Why a number is missing, or why Z is not N + P.
    """

    encirclements: float | None
    open_loop_rhp: float
    closed_loop_rhp: float | None
    reason: str = ""


def nyquist_count(
    open_loop: Iterable[QuasiPolynomial], closed_loop: QuasiPolynomial
) -> NyquistCount:
    """Count encirclements from the factors of den and the closed-loop function p."""
    factors = tuple(open_loop)
    follow_together([*factors, closed_loop])
    poles = sum(rhp_roots(factor) for factor in factors)
    zeros = count_rhp(closed_loop)
    if closed_loop.zeros_at_origin:
        zeros = RootCount(None, "the curve passes through the point at zero frequency")
    if zeros.count is None:
        return NyquistCount(None, poles, None, zeros.reason)
    if closed_loop.delay and not closed_loop.q.any():
        reason = "infinitely many encirclements; Z is counted without them, as N has no limit"
        return NyquistCount(inf, poles, zeros.count, reason)
    if poles == inf:
        return NyquistCount(
            None, poles, None, "the open loop has infinitely many poles in the right half plane"
        )
    # Each count is one of turns, of 1 + L's numerator and of its denominator around 0, ω from -∞
    # to ∞ and back on the large arc; what the denominator has on the axis is passed on the right.
    turns = zeros.count - sum(count_rhp(factor).at_least for factor in factors)
    return NyquistCount(turns, poles, turns + poles)


def encirclements(loop: Any, point: float = -1.0) -> NyquistCount:
    """Count the encirclements of a point of the real axis by a Nyquist plot.

    Parameters
    ----------
    loop : Quotient, or as for `nrdob.margins`
        Any map of the loop, such as ``loop.FH``, or other loop gain; proper or not.
    point : float
        The point to encircle: -1 for a loop gain, +1 for the paper's G̃⁻¹G.

    Returns
    -------
    NyquistCount
        N, P and Z = N + P; None, with the reason, where the curve meets the point.

    Raises
    ------
    TypeError, ValueError
        If `loop` is no single-input single-output block in continuous time.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import NRDOB, LowPassFilter
    >>> s = ct.tf('s')
    >>> C, F = -1.8*(0.5*s + 1)/s, LowPassFilter(0.05, 2)
    >>> loop = NRDOB(4/(2 - s - s**2), -1/(s**2 + 3*s + 2), C, F)
    >>> encirclements(loop.H)
    NyquistCount(encirclements=-1, open_loop_rhp=1, closed_loop_rhp=0, reason='')
    """
    loop, closed, well_posed = closed_around(loop, point)
    found = nyquist_count(loop.den, closed)
    if found.reason or well_posed:
        return found
    # The leading terms cancel, or all do: what is left is counted, but the plot does not turn.
    where = "ends at the point at infinite frequency" if closed.q.any() else "stays at the point"
    zeros = found.closed_loop_rhp if closed.q.any() else None
    return NyquistCount(None, found.open_loop_rhp, zeros, f"the curve {where}")


def closed_around(loop: Any, point: float = -1.0) -> tuple[Quotient, QuasiPolynomial, bool]:
    """Read a loop gain; the numerator of L - point, and whether its leading terms stay."""
    L = as_quotient(loop, "L")
    closed = minus_point(L, point)
    full = max(L.numerator.degree, L.denominator.degree)
    return L, closed, bool(closed.delay or (closed.degree == full and closed.q.any()))


def minus_point(loop: Quotient, point: float = -1.0) -> QuasiPolynomial:
    """Numerator of L - point, that is num - point * den.

    Parameters
    ----------
    loop : Quotient
    point : float
    """
    num, den = loop.numerator, loop.denominator
    power = max(num.divided, den.divided)
    top, less = num.lifted(power), den.lifted(power)
    scale = add(top.scale, abs(point) * less.scale)
    more = top.delayed + tuple(Term(-point * p, delay) for p, delay in less.terms)
    return QuasiPolynomial(top.q, scale=scale, more=more, origin=power).over_s(power)


def rhp_roots(factor: QuasiPolynomial) -> float:
    """Roots of one factor in the open right half plane; roots on the axis do not count.

    Parameters
    ----------
    factor : QuasiPolynomial
    """
    if factor.finite_part.neutral_ratio >= 1:
        return inf
    count = None if factor.argument_change.touched else factor.rhp_in_whole_numbers
    if count is None:
        if not factor.roots_resolved:
            return count_rhp(factor).at_least
        roots = factor.without_origin.roots
        count = int(np.sum((roots.real > 0) & ~factor.near_axis(roots)))
    return count
