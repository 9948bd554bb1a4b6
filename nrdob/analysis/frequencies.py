"""Frequencies that show all of a loop: between two of them nothing turns far, nothing resonates."""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from math import pi

import numpy as np

from ..diagram import Quotient
from ..numerics import FloatArray, QuasiPolynomial, frequency_segments
from .nyquist import minus_point

__all__ = ["on_axis", "resolved_frequencies", "subdivided"]

CLOSEST = 2.0**-40
"""How close to a root on the axis there are still frequencies, as a fraction of its own."""


def resolved_frequencies(
    loop: Quotient, per_segment: int = 8, closed: QuasiPolynomial | None = None
) -> FloatArray:
    """Frequencies that show every turn of a loop's Nyquist plot.

    Between two certified frequencies neither a factor of the loop nor 1 + L turns by more than
    half a revolution; each such stretch is sampled `per_segment` times, and the range is wide
    enough to hold the corner frequencies and, with a delay, two turns beyond them.

    Parameters
    ----------
    loop : Quotient
        Any map of the loop, with or without delay, proper or not.
    per_segment : int
        Samples in each stretch.
    closed : QuasiPolynomial, optional
        Numerator of 1 + L if it is known better than by adding.

    Returns
    -------
    array of float
        Increasing, in rad/s, without 0.
    """
    parts = [minus_point(loop) if closed is None else closed]
    for factor in (*loop.num, *loop.den):
        parts += [QuasiPolynomial(term.q) for term in factor.terms if term.q.any()]
    # A delayed factor of the denominator may come close to zero again and again.
    parts += [factor for factor in loop.den if factor.delay]
    grids = [_segments(p.without_origin) for p in parts if p.neutral_ratio < 1]
    omega = reduce(np.union1d, grids, np.zeros(1))[1:]
    if not omega.size:  # nothing but gains and dead time
        omega = np.array([pi / loop.delay if loop.delay else 1.0])
    # Towards zero nothing turns any more, but a size may still pass 1.
    omega = np.append(omega[0] * np.geomspace(1e-8, 0.8, 25), omega)
    if loop.delay:
        turn = 2 * pi / loop.delay
        omega = np.union1d(omega, omega[-1] + turn * np.linspace(0, 2, 17))
    return subdivided(omega, per_segment)


def subdivided(omega: FloatArray, count: int) -> FloatArray:
    """Cut each stretch between neighbouring frequencies into `count` equal ones.

    Parameters
    ----------
    omega : array of float, shape (N,)
        Increasing frequencies, in rad/s.
    count : int
        Into how many.
    """
    fractions = np.arange(count) / count
    return np.append((omega[:-1, None] + np.diff(omega)[:, None] * fractions).ravel(), omega[-1])


def on_axis(factors: Iterable[QuasiPolynomial]) -> FloatArray:
    """Frequencies ω > 0, in rad/s, at which a factor has a root on the axis within rounding.

    Parameters
    ----------
    factors : iterable of QuasiPolynomial
        The factors.
    """
    found: list[FloatArray] = [np.empty(0)]
    for factor in factors:
        roots = factor.roots
        found.append(roots.imag[factor.near_axis(roots) & (roots.imag > 0)])
    return np.concatenate(found)


def _segments(p: QuasiPolynomial) -> FloatArray:
    """Certified frequencies, and ever finer ones at a root on the axis, where none can be."""
    found = frequency_segments(p)
    if p.delay or not (omega := on_axis([p])).size:
        return found
    closer = 2.0 ** -np.arange(1.0, 1 - np.log2(CLOSEST))
    around = omega[:, None] * (1 + np.concatenate([-closer, closer]))
    return np.union1d(found, around.ravel())
