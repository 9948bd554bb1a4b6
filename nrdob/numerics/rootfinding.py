r"""Roots of :math:`q(s) + \sum_i r_i(s)\,e^{-sT_i}`: eigenvalues, polished by Newton's method.

A polynomial is the characteristic polynomial of its companion matrix. With delays, p = 0 says that
:math:`u = -\sum_i (r_i/q)\,w_i` closes a loop in which :math:`w_i` is u some time ago: one delay
line, as long as the longest delay, is collocated at Chebyshev points and read at its end and, by
interpolation, further in. The loop becomes a matrix, too (Breda, Maset, Vermiglio, SIAM J. Sci.
Comput. 27, 2005, 482-495).
"""

from __future__ import annotations

from cmath import sqrt
from collections.abc import Sequence
from functools import lru_cache, reduce
from math import ceil, pi

import numpy as np

from .arrays import BoolArray, ComplexArray, FloatArray

__all__ = [
    "Delayed", "companion_roots", "delay_roots", "frequencies_beside", "polynomial_roots",
    "value_and_slope", "vanishing",
]  # fmt: skip
# Polynomials behind their delays in seconds.
Delayed = Sequence[tuple[FloatArray, float]]

MAX_DELAY_NODES = 120  # time grows with their third power; beyond it there is `longdelay`


def polynomial_roots(q: FloatArray) -> ComplexArray:
    """Find all roots of a polynomial in descending powers.

    Parameters
    ----------
    q : array of float
        Neither the first nor the last coefficient is zero.

    Examples
    --------
    >>> sorted(polynomial_roots(np.array([1.0, 3.0, 2.0])).real.tolist())
    [-2.0, -1.0]
    """
    if q.size <= 2:
        return -q[1:] / q[:1] + 0j
    if q.size == 3:
        return np.array(_quadratic_roots(*(q[1:] / q[0]).tolist()))
    return _polished(q, (), companion_roots(q))


def companion_roots(q: FloatArray) -> ComplexArray:
    """Find all roots of a polynomial as eigenvalues, to the accuracy of `numpy.roots`.

    Parameters
    ----------
    q : array of float
        The first coefficient is not zero.
    """
    if q.size == 1:
        return np.empty(0, dtype=complex)
    companion = np.eye(q.size - 1, k=-1)
    companion[0] = -q[1:] / q[0]
    return np.asarray(np.linalg.eigvals(companion), dtype=np.complex128)


@np.errstate(all="ignore")  # what is not finite is no root
def delay_roots(q: FloatArray, delayed: Delayed) -> ComplexArray:
    """Find the roots of q + sum of r exp(-sT) that matter for stability.

    All of those in the right half plane and the rightmost ones of the left half plane. No r is of a
    higher degree than q; the longest dead time comes first. An ArithmeticError if a delay is too
    long for the loop's speed (see `MAX_DELAY_NODES`), or numbers leave the floating-point range.
    """
    longest = delayed[0][1]
    factors = [companion_roots(p) for p in (q, *(r for r, _ in delayed))]
    fastest = _reach(q, delayed, factors, 0.0)
    right_half_plane = _nodes_needed(fastest * longest)
    nodes = 24
    while True:
        found = _collocated_roots(q, delayed, max(fastest, 1 / longest), nodes)
        # |q(s)| <= sum of |r(s)| exp(-T Re s) bounds every root to the right of the rightmost one.
        abscissa = float(found.real.max(initial=-1 / longest))
        rightmost = right_half_plane
        if abscissa < 0:
            rightmost = _nodes_needed(_reach(q, delayed, factors, abscissa) * longest)
        if rightmost <= nodes or (right_half_plane <= nodes and rightmost > MAX_DELAY_NODES):
            return found
        if right_half_plane > MAX_DELAY_NODES:
            raise ArithmeticError(
                f"the delay of {longest:.4g} s is too long against the loop's bandwidth to "
                "resolve its roots"
            )
        nodes = ceil(min(max(rightmost, nodes + 8), MAX_DELAY_NODES))


def frequencies_beside(roots: ComplexArray, count: int) -> list[FloatArray]:
    """Frequencies in rad/s, dense at roots near the axis, `count` on either side of each."""
    found = []
    for root in roots[roots.imag > 0]:
        width = max(abs(root.real), 1e-12 * abs(root))
        steps = np.geomspace(0.1 * width, abs(root), count)
        found.append(root.imag + np.concatenate([-steps, [0.0], steps]))
    return found


def _quadratic_roots(b: float, c: float) -> tuple[complex, complex]:
    """Return the roots of s² + b s + c, c not 0, without cancellation."""
    root = sqrt(b * b / 4 - c)
    if root.imag:
        return -b / 2 + root, -b / 2 - root
    far = -b / 2 - root if b > 0 else -b / 2 + root
    return far, c / far


def value_and_slope(
    q: FloatArray, delayed: Delayed, s: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return p and dp/ds at `s`."""
    value, slope = _both(q, s)
    for r, delay in delayed:
        r_value, r_slope = _both(r, s)
        lag = np.exp(-delay * s)
        value, slope = value + r_value * lag, slope + (r_slope - delay * r_value) * lag
    return value, slope


def _both(p: FloatArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return a polynomial and its derivative at `s`."""
    both = np.zeros((p.size, 2), dtype=complex)
    both[:, 0], both[:-1, 1] = p[::-1], p[-2::-1] * np.arange(1, p.size)
    found = np.vander(s, p.size, increasing=True) @ both
    return found[:, 0], found[:, 1]


def vanishing(q: FloatArray, delayed: Delayed, s: ComplexArray) -> BoolArray:
    """Tell where p is as small against its terms as rounding leaves it at a root."""
    size = np.polyval(np.abs(q), np.abs(s))
    for r, delay in delayed:
        size = size + np.polyval(np.abs(r), np.abs(s)) * np.exp(-delay * s.real)
    return np.asarray(np.abs(value_and_slope(q, delayed, s)[0]) <= 1e-9 * size)


def _polished(q: FloatArray, delayed: Delayed, roots: ComplexArray) -> ComplexArray:
    """Newton steps on p, each kept only where it lowers |p|."""
    with np.errstate(all="ignore"):  # a step that is not finite is refused
        value, slope = value_and_slope(q, delayed, roots)
        for _ in range(3):
            step = value / slope
            tried, tried_slope = value_and_slope(q, delayed, roots - step)
            keep = np.abs(tried) < np.abs(value)
            if not keep.any():
                break
            roots = np.where(keep, roots - step, roots)
            value, slope = np.where(keep, tried, value), np.where(keep, tried_slope, slope)
            if not np.any(np.abs(step[keep]) > 4e-16 * np.abs(roots[keep])):
                break
    return roots


def _nodes_needed(reach: float) -> float:
    """Collocation points that resolve every root of at most this modulus times the delay."""
    return 0.8 * reach + 20


def _reach(
    q: FloatArray, delayed: Delayed, factors: Sequence[ComplexArray], abscissa: float
) -> float:
    """Largest modulus that a root to the right of `abscissa` can have; `factors`: roots of q and r.

    There |q(s)| <= sum of |r(s)| exp(-T·abscissa). With s = abscissa + z, Re z >= 0, a factor z + a
    of q with real a > 0 is at least as large as |z| and as a: fast stable lags do not count.
    """
    grown = [(r, float(np.exp(-delay * abscissa))) for r, delay in delayed]
    neutral = sum(growth * abs(r[0] / q[0]) for r, growth in grown if r.size == q.size)
    # A neutral equation has chains of roots that no radius bounds: those further left are left out.
    shrink = min(1.0, 0.999 / neutral) if neutral else 1.0
    poles, *zeros = (roots - abscissa for roots in factors)
    leading = [shrink * growth * abs(r[0]) for r, growth in grown]
    sizes = np.concatenate([np.abs(poles), *map(np.abs, zeros)])
    top = 4 * float(np.max(sizes, initial=0.0)) + 4 * max(
        (size / abs(q[0])) ** (1 / (q.size - r.size)) if r.size < q.size else 0.0
        for (r, _), size in zip(delayed, leading, strict=True)
    )
    radius = np.geomspace(1e-6, 1.0, 500) * top
    gap = np.where(
        (poles.real <= 0) & (np.abs(poles.imag) <= 1e-9 * np.abs(poles)),
        np.hypot(radius[:, None], np.abs(poles)),
        np.abs(radius[:, None] - np.abs(poles)),
    )
    with np.errstate(divide="ignore"):
        lower = np.log(gap).sum(axis=1) + np.log(abs(q[0]))
    bounds = (
        np.log(radius[:, None] + np.abs(each)).sum(axis=1) + np.log(size)
        for each, size in zip(zeros, leading, strict=True)
    )
    upper = reduce(np.logaddexp, bounds)
    inside = np.flatnonzero(lower <= upper)
    return float(radius[min(inside[-1] + 1, 499)] if inside.size else radius[0]) + abs(abscissa)


def _collocated_roots(q: FloatArray, delayed: Delayed, speed: float, nodes: int) -> ComplexArray:
    longest = delayed[0][1]
    loop = _collocated_loop(q, delayed, speed, nodes)
    if not np.isfinite(loop).all():
        raise ArithmeticError("the coefficients leave the range of floating-point numbers")
    guesses = np.asarray(np.linalg.eigvals(loop), dtype=np.complex128) * speed
    # To the left only roots that the collocation resolves are true; to the right the delayed terms
    # are small and Newton's method settles every one.
    resolved = (np.abs(guesses) * longest < 1.1 * nodes) & (guesses.real * longest > -30)
    guesses = guesses[resolved | (guesses.real > 0)]
    roots = _polished(q, delayed, guesses)
    moved = np.abs(roots - guesses) * longest
    near = moved < 1e-2 * (1 + np.abs(guesses) * longest)
    return np.asarray(roots[near & vanishing(q, delayed, roots)])


def _collocated_loop(q: FloatArray, delayed: Delayed, speed: float, nodes: int) -> FloatArray:
    """Matrix of the loop closed around the delay line, time in units of 1/speed.

    x' = A x + sum of b w and u = x[0] + sum of d w, in observer form so that one x is enough.
    """
    n, longest = q.size - 1, delayed[0][1]
    powers = speed ** np.arange(n, -1, -1.0)  # keeps the companion form well scaled
    lead = q[0] * powers[0]
    q = q * powers / lead
    transport = -_differentiation(nodes) / (longest * speed)
    matrix = np.zeros((n + nodes, n + nodes))
    matrix[:n, :n] = np.eye(n, k=1)
    matrix[:n, :1] = -q[1:, None]
    read_at_start, line = 0.0, np.zeros(nodes)
    into_states = np.zeros(n)  # of u itself, where a delay is read next to the start of the line
    for r, delay in delayed:
        r = np.pad(r, (n + 1 - r.size, 0)) * powers / lead
        row = _read(nodes, delay / longest)
        through, drive = -r[0], r[0] * q[1:] - r[1:]
        matrix[:n, n:] += np.outer(drive, row[1:])
        into_states += drive * row[0]
        line += through * row[1:]
        read_at_start += through * row[0]
    # u = x[0] + line·w + read_at_start u
    u = np.concatenate([np.eye(1, n)[0], line]) / (1 - read_at_start)
    matrix[:n] += np.outer(into_states, u)
    matrix[n:, n:] += transport[1:, 1:]
    matrix[n:] += np.outer(transport[1:, 0], u)
    return matrix


def _read(nodes: int, place: float) -> FloatArray:
    """Weights of the line's nodes for its value at a place in (0, 1], by barycentric formula."""
    k = np.arange(nodes + 1)
    distance = place - (1 - np.cos(pi * k / nodes)) / 2
    if (exact := distance == 0).any():
        return np.asarray(exact, dtype=float)
    weights = (-1.0) ** k * np.where(k % nodes == 0, 0.5, 1.0) / distance
    return np.asarray(weights / weights.sum())


@lru_cache(maxsize=32)
def _differentiation(nodes: int) -> FloatArray:
    """Chebyshev differentiation on [0, 1], points from 0 to 1, (nodes+1) by (nodes+1)."""
    k = np.arange(nodes + 1)
    x = np.cos(pi * k / nodes)
    weights = np.where(k % nodes == 0, 2.0, 1.0) * (-1.0) ** k
    difference = x[:, None] - x[None, :] + np.eye(nodes + 1)
    matrix = np.outer(weights, 1 / weights) / difference
    matrix -= np.diag(matrix.sum(axis=1))
    return np.asarray(-2.0 * matrix)
