"""Roots in the right half plane: how many, by the argument along the axis, and which."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isnan, pi

import numpy as np

from .argument import ArgumentChange, zero_free_frequencies
from .arrays import ROUNDING, ComplexArray, FloatArray
from .quasipoly import QuasiPolynomial

__all__ = ["RootCount", "count_rhp", "frequency_segments", "unstable_roots"]


@dataclass(frozen=True)
class RootCount:
    """Number of roots with positive real part.

    Attributes
    ----------
    count : float or None
        Infinite for an advanced or an unstable neutral equation; None where roots on
        the axis, within rounding, leave it open.
    reason : str
        Why it is not known.
    at_least : float
        Roots that are in the right half plane whatever rounding does to those on the axis, which
        the path passes on their right.
    """

    count: float | None
    reason: str = ""
    at_least: float = 0


def count_rhp(p: QuasiPolynomial) -> RootCount:
    """Count the roots in the open right half plane by the argument along the imaginary axis.

    Roots at s = 0 that the coefficients prove are divided out first and not counted. Open are the
    counts with a root on the axis within rounding, and of a neutral equation at its limit.

    Parameters
    ----------
    p : QuasiPolynomial
        Not identically zero.

    Examples
    --------
    >>> count_rhp(QuasiPolynomial([1.0, -1.0, 4.0])).count         # s^2 - s + 4
    2
    >>> count_rhp(QuasiPolynomial([1.0, 0.0], [2.0], delay=1.0)).count   # s + 2 exp(-s)
    2
    """
    p = p.finite_part
    ratio = p.neutral_ratio
    if ratio > 1 - ROUNDING:
        return _chains(p, ratio)
    try:
        change = p.argument_change
    except ArithmeticError as error:
        return RootCount(None, str(error))
    if isnan(change.angle):
        return RootCount(None, _where(change))
    roots = p.degree / 2 - change.angle / pi
    count = round(roots)
    if abs(roots - count) > 0.1:
        return RootCount(None, "the changes of the argument do not add up to a whole number")
    if change.touched:
        return RootCount(None, _where(change), count)
    return RootCount(count, at_least=count)


def _chains(p: QuasiPolynomial, ratio: float) -> RootCount:
    """Judge chains of roots where the delayed terms together are as large as the other one."""
    most = max(term.q.size for term in p.terms)
    leading = [abs(term.q[0]) for term in p.terms if term.q.size == most]
    if p.q.size < most or max(leading[1:]) > (1 + ROUNDING) * (sum(leading) - max(leading)):
        return RootCount(inf, at_least=inf)
    return RootCount(None, (
        f"neutral, the sizes of its delayed terms at infinite frequency add up to {ratio:.4g}, not "
        "below 1: a chain of roots comes arbitrarily close to the imaginary axis, or the smallest "
        "change of a dead time may make it unstable"
    ))  # fmt: skip


def frequency_segments(p: QuasiPolynomial) -> FloatArray:
    """Frequencies between which p provably turns by less than half a revolution.

    In rad/s, increasing, from 0 to where the leading term dominates; for roots on the axis and very
    long delays see `nrdob.numerics.argument.zero_free_frequencies`.

    Parameters
    ----------
    p : QuasiPolynomial
        Without roots at s = 0; retarded, or neutral with ratio below 1.
    """
    return zero_free_frequencies(p.terms, p.scale, max(p.divided, 1))


def _where(change: ArgumentChange) -> str:
    if 0.0 in change.touched:
        return "a root at s = 0 within rounding"
    return f"a root on the imaginary axis within rounding, near {change.touched[0]:.6g} rad/s"


def unstable_roots(p: QuasiPolynomial) -> ComplexArray:
    """Roots in rad/s right of the axis, or on it within rounding; not those at s = 0 exactly.

    Parameters
    ----------
    p : QuasiPolynomial

    Examples
    --------
    >>> unstable_roots(QuasiPolynomial([1.0, 0.0, 0.0, -1.0, 0.0])).real.tolist()   # s (s³ - 1)
    [1.0]
    """
    roots = p.without_origin.roots
    return np.asarray(roots[(roots.real > 0) | p.without_origin.near_axis(roots)])
