"""Frequencies that show all of a loop: between two of them nothing turns far, nothing resonates."""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from math import inf, log, pi

import numpy as np

from ..diagram import Quotient
from ..numerics import (
    ComplexArray,
    FloatArray,
    QuasiPolynomial,
    companion_roots,
    frequency_segments,
    polynomial_roots,
    runs,
)
from .locus import Locus, factors_of
from .nyquist import minus_point

__all__ = ["gentle_frequencies", "on_axis", "resolved_frequencies", "subdivided", "with_turns"]

CLOSEST = 2.0**-40  # how close to a root on the axis there are frequencies, against its own
CUTS = 8  # parts into which a stretch is cut at most before it is looked at again
BEND = 0.5  # largest product of the second derivative of log L over log ω and the square of a step
DECADES = 8  # how far below and above all roots loops are followed: a size may still pass 1 there
PER_SEGMENT = 4  # frequencies in each certified stretch of a delayed factor
RADIANS = 0.7  # how far a dead time may turn L from one frequency to the next, where L is not small
TURNS = 2  # how many turns of a dead time are followed beyond where L is not small
FAR = 20.0  # how far beyond all roots a loop gain that does not fall off is followed
PEAK = 1e-9  # by how much the logarithm of the largest value of L exceeds those beside it
MOST = 200_000  # frequencies at most that a dead time asks for


def gentle_frequencies(*loops: Quotient) -> FloatArray:
    r"""Frequencies above 0 between which the logarithm of L bends little, but for dead times.

    Over log ω a pole or zero z bends log L by :math:`\omega |z|/|j\omega - z|^2`. Their sum times
    the square of a stretch is at most `BEND`. Delayed factors of the denominator turn by less than
    half a revolution in `PER_SEGMENT` stretches together.
    """
    factors = factors_of(*loops)
    roots = [_corners(factor) for factor in factors]
    z = np.concatenate(roots)
    member = [[factor in loop.num + loop.den for loop in loops] for factor in factors]
    member_of = np.repeat(np.array(member, dtype=float), [each.size for each in roots], axis=0)
    size = np.abs(z)
    square = np.maximum(np.abs(z.real), CLOSEST * size) ** 2
    # Nothing but gains and dead time: its turns give the unit.
    longest = max((p.delay for p in factors), default=0.0)
    speeds = size if size.size else np.array([pi / longest if longest else 1.0])
    ends = log(speeds.min()) - DECADES * log(10), log(speeds.max()) + DECADES * log(10)
    x = np.linspace(*ends, int(ends[1] - ends[0]) + 1)
    left: FloatArray = x[:-1]
    right: FloatArray = x[1:]
    done: list[FloatArray] = [x[-1:]]
    while left.size:
        omega, width = np.exp((left + right) / 2), right - left
        bends = (omega[:, None] * size / ((omega[:, None] - z.imag) ** 2 + square)) @ member_of
        parts = np.ceil(np.sqrt(bends.max(axis=1) / BEND) * width)
        gentle = parts <= 1
        done.append(left[gentle])
        count = np.minimum(parts[~gentle], CUTS).astype(np.intp)
        start, step = np.repeat(left[~gentle], count), np.repeat(width[~gentle] / count, count)
        k = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        left, right = start + k * step, start + (k + 1) * step
    omega = np.exp(np.sort(np.concatenate(done)))
    delayed = {id(p): p for loop in loops for p in loop.den if p.delay and p.neutral_ratio < 1}
    if not delayed:
        return omega
    own = [subdivided(_segments(p.without_origin), PER_SEGMENT) for p in delayed.values()]
    return reduce(np.union1d, own, omega)[1:]


def _corners(factor: QuasiPolynomial) -> ComplexArray:
    """Roots of the factor's polynomials, each by itself, without those at s = 0."""
    found: list[ComplexArray] = []
    for q, _ in factor.terms:
        used = q.nonzero()[0]
        if used.size > 1:
            p = q[used[0] : used[-1] + 1]
            found.append(polynomial_roots(p) if p.size <= 3 else companion_roots(p))
    return np.concatenate([np.empty(0, dtype=complex), *found])


def with_turns(locus: Locus, omega: FloatArray, *loops: Quotient) -> tuple[FloatArray, FloatArray]:
    """Add frequencies in rad/s where dead times turn loop gains that are not small.

    Between the given ones nothing else bends them. Returned are also the frequencies up to which
    each loop is then resolved.
    """
    delays = np.array([loop.delay for loop in loops])
    last = np.full(delays.size, inf)
    reach = locus.reach(omega)
    found = [omega]
    for k, (loop, delay) in enumerate(zip(loops, delays.tolist(), strict=True)):
        if not delay:
            continue
        turn = TURNS * 2 * pi / delay
        top = inf if not any(loop.at_infinity) else FAR * omega[-1] / 10**DECADES
        large = (reach[k] > min(np.nanmax(reach[k]), 0.0) + log(0.5)) & (omega <= top)
        # What matters where L is small lies beside its largest values, too.
        rise = np.diff(reach[k]) > PEAK
        peak = 1 + np.flatnonzero(rise[:-1] & (np.diff(reach[k])[1:] < -PEAK))
        large[peak[omega[peak] <= top]] = True
        first, behind = runs(large).T
        first, behind = omega[np.maximum(first - 1, 0)], omega[np.minimum(behind, omega.size - 1)]
        first, behind = np.maximum(first - turn, omega[0]), behind + turn
        last[k] = max(behind.max(), omega[-1] / 10**DECADES + turn)
        step = RADIANS / delay
        for low, high in zip((first / step).tolist(), (behind / step).tolist(), strict=True):
            count = min(int(high) - int(low) + 2, MOST)
            found.append((max(int(low), 1) + np.arange(count)) * step)
    return np.unique(np.concatenate(found)), last


def resolved_frequencies(
    loop: Quotient, per_segment: int = 8, closed: QuasiPolynomial | None = None
) -> FloatArray:
    """Frequencies above 0, in rad/s, that show every turn of a loop's Nyquist plot.

    Between two certified frequencies neither a factor of the loop nor 1 + L turns by more than
    half a revolution, and the range is wide enough to hold the corner frequencies and, with a
    delay, two turns beyond them.

    Parameters
    ----------
    loop : Quotient
        With or without delay, proper or not.
    per_segment : int
        Samples in each such stretch.
    closed : QuasiPolynomial, optional
        Numerator of 1 + L if it is known better than by adding.
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
        Increasing.
    count : int
    """
    fractions = np.arange(count) / count
    return np.append((omega[:-1, None] + np.diff(omega)[:, None] * fractions).ravel(), omega[-1])


def on_axis(factors: Iterable[QuasiPolynomial]) -> FloatArray:
    """Frequencies ω > 0, in rad/s, at which a factor has a root on the axis within rounding.

    Parameters
    ----------
    factors : iterable of QuasiPolynomial
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
