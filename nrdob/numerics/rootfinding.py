r"""Roots of :math:`p(s) = q(s) + r(s)\,e^{-sT}`: eigenvalues, polished by Newton's method on p.

A polynomial is the characteristic polynomial of its companion matrix. With a delay, p = 0 says
that u = -(r/q) w closes a loop in which w is u one delay later: the delay line is collocated at
Chebyshev points, and the loop becomes a matrix, too.

.. rubric:: References

W. Michiels, S.-I. Niculescu, Stability, Control, and Computation for Time-Delay Systems, SIAM 2014.

D. Breda, S. Maset, R. Vermiglio, Pseudospectral differencing methods for characteristic roots of
delay differential equations, SIAM J. Sci. Comput. 27 (2005) 482-495.
"""

from __future__ import annotations

from cmath import sqrt
from functools import lru_cache
from math import ceil, inf, pi

import numpy as np

from .arrays import ComplexArray, FloatArray

MAX_DELAY_NODES = 120
"""Collocation points at most: the time for eigenvalues grows with their third power.

A loop that needs more is so fast for its delay that `nrdob.numerics.longdelay` finds its rightmost
roots.
"""


def polynomial_roots(q: FloatArray) -> ComplexArray:
    """Find all roots of a polynomial.

    Parameters
    ----------
    q : array of float
        Coefficients in descending powers, neither the first nor the last one zero.

    Examples
    --------
    >>> sorted(polynomial_roots(np.array([1.0, 3.0, 2.0])).real.tolist())
    [-2.0, -1.0]
    """
    if q.size <= 2:
        return -q[1:] / q[:1] + 0j
    if q.size == 3:
        return np.array(_quadratic_roots(*(q[1:] / q[0]).tolist()))
    return _polished(q, np.zeros(1), 0.0, companion_roots(q))


def companion_roots(q: FloatArray) -> ComplexArray:
    """Find all roots of a polynomial as eigenvalues, to the accuracy of `numpy.roots`.

    Parameters
    ----------
    q : array of float
        Coefficients in descending powers, the first one not zero.
    """
    if q.size == 1:
        return np.empty(0, dtype=complex)
    companion = np.eye(q.size - 1, k=-1)
    companion[0] = -q[1:] / q[0]
    return np.asarray(np.linalg.eigvals(companion), dtype=np.complex128)


def delay_roots(q: FloatArray, r: FloatArray, delay: float) -> ComplexArray:
    """Find the roots of q + r exp(-sT) that matter for stability.

    All of those in the right half plane and the rightmost ones of the left half plane.

    Parameters
    ----------
    q, r : array of float
        Coefficients in descending powers, the first one of q not zero; the degree of r at most
        that of q.
    delay : float
        T > 0, in seconds.

    Raises
    ------
    ArithmeticError
        If the delay is too long for the loop's speed to be resolved (see `MAX_DELAY_NODES`).

    Examples
    --------
    >>> roots = delay_roots(np.array([1.0, 0.0]), np.array([np.pi / 2]), delay=1.0)
    >>> bool(abs(roots - 0.5j * np.pi).min() < 1e-12)     # j exp(jπ/2) = -1
    True
    """
    r = np.pad(r, (q.size - r.size, 0))
    nodes = 24
    while True:
        found = _collocated_roots(q, r, delay, nodes)
        # |q(s)| <= |r(s)| exp(-T Re s) bounds every root to the right of the rightmost one found.
        abscissa = min(float(found.real.max(initial=-1 / delay)), 0.0)
        right_half_plane, rightmost = (_nodes_needed(q, r, delay, a) for a in (0.0, abscissa))
        if rightmost <= nodes or (right_half_plane <= nodes and rightmost > MAX_DELAY_NODES):
            return found
        if right_half_plane > MAX_DELAY_NODES:
            raise ArithmeticError(
                f"the delay of {delay:.4g} s is too long against the loop's bandwidth to "
                "resolve its roots"
            )
        nodes = ceil(min(max(rightmost, nodes + 8), MAX_DELAY_NODES))


def dominance_radius(ascending: FloatArray) -> float:
    """Radius beyond which the last term exceeds the sum of the others (Fujiwara's bound).

    Parameters
    ----------
    ascending : array of float
        Coefficients in ascending powers, the last one 1.
    """
    n = ascending.size - 1
    sizes = np.abs(ascending[:-1])
    exponents = n - np.arange(n)
    return float(2 * np.max(sizes ** (1 / exponents), initial=1e-300)) * 1.01


def _quadratic_roots(b: float, c: float) -> tuple[complex, complex]:
    """Return the roots of s² + b s + c, c not 0, without cancellation."""
    root = sqrt(b * b / 4 - c)
    if root.imag:
        return -b / 2 + root, -b / 2 - root
    far = -b / 2 - root if b > 0 else -b / 2 + root
    return far, c / far


def value_and_slope(
    q: FloatArray, r: FloatArray, delay: float, s: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return p and dp/ds at `s`."""
    value, slope = _horner(q, s)
    if delay:
        r_value, r_slope = _horner(r, s)
        lag = np.exp(-delay * s)
        value, slope = value + r_value * lag, slope + (r_slope - delay * r_value) * lag
    return value, slope


def _horner(coefficients: FloatArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return a polynomial and its derivative at `s`."""
    value, slope = np.full_like(s, coefficients[0]), np.zeros_like(s)
    for coefficient in coefficients[1:].tolist():
        slope *= s
        slope += value
        value *= s
        value += coefficient
    return value, slope


def _polished(q: FloatArray, r: FloatArray, delay: float, roots: ComplexArray) -> ComplexArray:
    """Newton steps on p, each kept only where it lowers |p|."""
    with np.errstate(all="ignore"):  # a step that is not finite is refused
        value, slope = value_and_slope(q, r, delay, roots)
        for _ in range(3):
            step = value / slope
            tried, tried_slope = value_and_slope(q, r, delay, roots - step)
            keep = np.abs(tried) < np.abs(value)
            if not keep.any():
                break
            roots = np.where(keep, roots - step, roots)
            value, slope = np.where(keep, tried, value), np.where(keep, tried_slope, slope)
            if not np.any(np.abs(step[keep]) > 4e-16 * np.abs(roots[keep])):
                break
    return roots


def _nodes_needed(q: FloatArray, r: FloatArray, delay: float, abscissa: float) -> float:
    """Collocation points that resolve every root to the right of `abscissa`."""
    return 0.8 * _reach(q, r, abscissa, delay) * delay + 20


def _reach(q: FloatArray, r: FloatArray, abscissa: float, delay: float) -> float:
    """Largest modulus that a root to the right of `abscissa` can have.

    There |q(s)| <= |r(s)| exp(-T·abscissa). With s = abscissa + z, Re z >= 0, a factor z + a of q
    with real a > 0 is at least as large as |z| and as a: fast stable lags do not count.
    """
    growth = min(float(np.exp(-delay * abscissa)), 0.999 * abs(q[0] / r[0]) if r[0] else inf)
    poles, zeros = (companion_roots(np.trim_zeros(c, "f")) - abscissa for c in (q, r))
    sizes = np.concatenate([np.abs(poles), np.abs(zeros)])
    top = 4 * float(np.max(sizes, initial=0.0)) + 4 * _crossover(q, r, growth)
    radius = np.geomspace(1e-6, 1.0, 500) * top
    gap = np.where(
        (poles.real <= 0) & (np.abs(poles.imag) <= 1e-9 * np.abs(poles)),
        np.hypot(radius[:, None], np.abs(poles)),
        np.abs(radius[:, None] - np.abs(poles)),
    )
    with np.errstate(divide="ignore"):
        lower = np.log(gap).sum(axis=1) + np.log(abs(q[0]))
    leading = abs(np.trim_zeros(r, "f")[0])
    upper = np.log(radius[:, None] + np.abs(zeros)).sum(axis=1) + np.log(growth * leading)
    inside = np.flatnonzero(lower <= upper)
    return float(radius[min(inside[-1] + 1, 499)] if inside.size else radius[0]) + abs(abscissa)


def _crossover(q: FloatArray, r: FloatArray, growth: float) -> float:
    """Return where the leading terms of q and growth·r are equal, 0 for equal degrees."""
    r = np.trim_zeros(r, "f")
    excess = q.size - r.size
    return float(abs(growth * r[0] / q[0]) ** (1 / excess)) if excess else 0.0


def _collocated_roots(q: FloatArray, r: FloatArray, delay: float, nodes: int) -> ComplexArray:
    speed = max(_reach(q, r, 0.0, delay), 1 / delay)
    loop = _collocated_loop(q, r, delay, speed, nodes)
    guesses = np.asarray(np.linalg.eigvals(loop), dtype=np.complex128) * speed
    # To the left only roots that the collocation resolves are true; to the right the delayed term
    # is small and Newton's method settles every one.
    resolved = (np.abs(guesses) * delay < 1.1 * nodes) & (guesses.real * delay > -30)
    guesses = guesses[resolved | (guesses.real > 0)]
    roots = _polished(q, r, delay, guesses)
    moved = np.abs(roots - guesses) * delay
    with np.errstate(divide="ignore", invalid="ignore"):
        residual = np.abs(value_and_slope(q, r, delay, roots)[0]) / (
            np.polyval(np.abs(q), np.abs(roots))
            + np.polyval(np.abs(r), np.abs(roots)) * np.exp(-delay * roots.real)
        )
    true = (moved < 1e-2 * (1 + np.abs(guesses) * delay)) & (residual < 1e-9)
    return np.asarray(roots[true])


def _collocated_loop(
    q: FloatArray, r: FloatArray, delay: float, speed: float, nodes: int
) -> FloatArray:
    """Matrix of the loop closed around the delay line, time in units of 1/speed."""
    n = q.size - 1
    powers = speed ** np.arange(n, -1, -1.0)  # keeps the companion form well scaled
    q, r = q * powers / (q[0] * powers[0]), r * powers / (q[0] * powers[0])
    through = -r[0]  # u = output @ x + through * w
    output = -(r[1:] - r[0] * q[1:])
    companion = np.eye(n, k=-1)
    companion[:1] = -q[1:]
    transport = -_differentiation(nodes) / (delay * speed)
    matrix = np.zeros((n + nodes, n + nodes))
    matrix[:n, :n] = companion
    matrix[: min(n, 1), -1] = 1.0
    matrix[n:, :n] = np.outer(transport[1:, 0], output)
    matrix[n:, n:] = transport[1:, 1:]
    matrix[n:, -1] += transport[1:, 0] * through
    return matrix


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
