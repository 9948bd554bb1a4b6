r"""Quasi-polynomials :math:`p(s) = q(s) + r(s)\,e^{-sT}`: where the roots of a delayed loop live.

Two independent ways to know the right half plane, neither of which approximates the delay away:

- `count_rhp` follows the argument of p along the imaginary axis (Mikhailov). Each step is
  certified: a Taylor bound proves that p has no zero in the disc over the step, so that no
  resonance, however sharp, can slip between two frequencies.
- `roots` finds the roots themselves: companion eigenvalues for a polynomial; for a delay, the
  eigenvalues of the loop closed around a Chebyshev-collocated delay line, each one then polished
  by Newton's method on p itself.

References
----------
W. Michiels, S.-I. Niculescu, Stability, Control, and Computation for Time-Delay Systems, SIAM 2014.
D. Breda, S. Maset, R. Vermiglio, Pseudospectral differencing methods for characteristic roots of
delay differential equations, SIAM J. Sci. Comput. 27 (2005) 482-495.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import inf, pi
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from .blocks import ComplexArray, FloatArray

ROUNDING = 1e3 * float(np.finfo(float).eps)
"""Relative change of the coefficients below which two loops cannot be told apart."""

MAX_SEGMENTS = 400_000
MAX_DELAY_NODES = 600


@dataclass(frozen=True, eq=False)
class QuasiPolynomial:
    r"""The function :math:`q(s) + r(s)\,e^{-sT}` with real polynomials q and r.

    Parameters
    ----------
    q, r : array_like of float
        Coefficients in descending powers of s. Without a delay, r is added to q.
    delay : float
        T >= 0, in seconds.
    scale : array_like of float, optional
        For each power of s (descending) the size of what was summed to give the coefficient.
        It tells how much of a small coefficient may be rounding.

    Examples
    --------
    >>> p = QuasiPolynomial([1.0, 0.0], [1.0], delay=1.0)      # s + exp(-s)
    >>> complex(p(0.0))
    (1+0j)
    >>> count_rhp(p).count
    0
    """

    q: FloatArray
    r: FloatArray = field(default_factory=lambda: np.zeros(1))
    delay: float = 0.0
    scale: FloatArray | None = None

    def __post_init__(self) -> None:
        q, r = np.asarray(self.q, dtype=float), np.asarray(self.r, dtype=float)
        scale = add(np.abs(q), np.abs(r)) if self.scale is None else self.scale
        if self.delay == 0:
            q, r = add(q, r), np.zeros(1)
        q, r = _trim(q, scale), _trim(r, scale)
        delay = self.delay if r.any() else 0.0
        scale = scale[-max(q.size, r.size) :]
        for name, value in (("q", q), ("r", r), ("scale", scale), ("delay", delay)):
            object.__setattr__(self, name, value)

    @property
    def degree(self) -> int:
        """Highest power of s that occurs."""
        return int(max(self.q.size, self.r.size)) - 1

    @property
    def neutral_ratio(self) -> float:
        """Size of the delayed leading coefficient against the undelayed one.

        0 for a polynomial or a retarded equation, a positive number for a neutral one,
        infinite for an advanced one.
        """
        if self.delay == 0 or self.r.size < self.q.size:
            return 0.0
        return inf if self.r.size > self.q.size else float(abs(self.r[0] / self.q[0]))

    @property
    def zeros_at_origin(self) -> int:
        """Multiplicity of the root s = 0 that the coefficients prove exactly."""
        if not self.delay:
            return _trailing_zeros(self.q) if self.q.any() else 0
        return min(_trailing_zeros(self.q), _trailing_zeros(self.r))

    @cached_property
    def without_origin(self) -> QuasiPolynomial:
        """The quasi-polynomial divided by its exact roots at s = 0."""
        m = self.zeros_at_origin
        if not m:
            return self
        return QuasiPolynomial(_drop(self.q, m), _drop(self.r, m), self.delay, self.scale[:-m])

    def __call__(self, s: complex | ComplexArray) -> Any:
        """Evaluate at complex `s`, a number or an array of any shape."""
        s = np.asarray(s, dtype=complex)
        value = np.polyval(self.q, s)
        if self.delay:
            value = value + np.polyval(self.r, s) * np.exp(-self.delay * s)
        return value

    def derivative(self, s: ComplexArray) -> Any:
        """Evaluate dp/ds at complex `s`."""
        value = np.polyval(differentiate(self.q), s)
        if self.delay:
            r = np.polyval(differentiate(self.r), s) - self.delay * np.polyval(self.r, s)
            value = value + r * np.exp(-self.delay * s)
        return value

    def near_axis(self, roots: ComplexArray) -> NDArrayBool:
        """Tell which roots a change of the coefficients within rounding moves onto the axis."""
        near = np.abs(roots.real) <= 0.1 * np.abs(roots)
        if near.any():
            omega = np.abs(roots.imag[near])
            near[near] = np.abs(self(1j * omega)) <= ROUNDING * np.polyval(self.scale, omega)
        return near

    @cached_property
    def roots(self) -> ComplexArray:
        """Roots, rightmost first.

        All of them for a polynomial. With a delay: those that matter for stability, that is all
        in the right half plane and the rightmost ones of the left half plane.

        Raises
        ------
        ArithmeticError
            If the delay is too long for the loop's speed to be resolved (see `MAX_DELAY_NODES`).
        """
        p = self.without_origin
        found = _delay_roots(p) if p.delay else _polished(p, np.roots(p.q).astype(complex))
        found = np.concatenate([found, np.zeros(self.zeros_at_origin)])
        return found[np.lexsort((-found.imag, -found.real))]


NDArrayBool = np.ndarray[Any, np.dtype[np.bool_]]


class RootCount(NamedTuple):
    """Number of roots with positive real part, or None and the reason why it is not known."""

    count: float | None
    reason: str = ""


def count_rhp(p: QuasiPolynomial) -> RootCount:
    """Count the roots in the open right half plane by the argument along the imaginary axis.

    Roots at s = 0 that the coefficients prove are divided out first and not counted.

    Parameters
    ----------
    p : QuasiPolynomial
        Not identically zero.

    Returns
    -------
    RootCount
        The count (infinite for an advanced or an unstable neutral equation), or None with the
        reason: a root on the axis within rounding, or a neutral equation at its limit.

    Examples
    --------
    >>> count_rhp(QuasiPolynomial([1.0, -1.0, 4.0])).count         # s^2 - s + 4
    2
    >>> count_rhp(QuasiPolynomial([1.0, 0.0], [2.0], delay=1.0)).count   # s + 2 exp(-s)
    2
    """
    p = p.without_origin
    ratio = p.neutral_ratio
    if abs(ratio - 1) <= ROUNDING:
        return RootCount(None, "neutral with |r/q| = 1 at infinite frequency: a chain of roots "
                               "comes arbitrarily close to the imaginary axis")  # fmt: skip
    if ratio > 1:
        return RootCount(inf)
    if p.degree == 0:
        return RootCount(0)
    turn = _argument_change(p)
    if isinstance(turn, str):
        return RootCount(None, turn)
    return RootCount(round((p.degree * pi / 2 - turn) / pi))


def frequency_segments(p: QuasiPolynomial) -> FloatArray | str:
    """Frequencies between which p provably turns by less than half a revolution.

    Parameters
    ----------
    p : QuasiPolynomial
        Without roots at s = 0; retarded, or neutral with ratio below 1.

    Returns
    -------
    array of float, or str
        Increasing frequencies in rad/s from 0 to where the leading term dominates; or, if p
        vanishes on the axis within rounding, a sentence that says where.
    """
    if p.degree == 0:
        return np.zeros(1)
    high = _dominance_radius(p.scale[::-1] / (abs(p.q[0]) * (1 - p.neutral_ratio)))
    low = _lowest(p)
    if low is None:
        return "a root at s = 0 within rounding"
    count = int(np.clip(np.ceil(np.log2(high / low)), 1, 2000)) if high > low else 1
    todo = np.concatenate([[0.0], np.geomspace(low, max(high, low), count + 1)])
    done = [todo[:1]]
    left, right = todo[1:-1], todo[2:]
    done += [right[-1:], left[:1]]
    total = left.size
    while left.size:
        middle = (left + right) / 2
        certified, vanishing = _zero_free(p, middle, (right - left) / 2)
        if vanishing.any():
            omega = middle[vanishing][0]
            return f"a root on the imaginary axis within rounding, near {omega:.6g} rad/s"
        done += [middle, right[certified]]
        left, right = left[~certified], right[~certified]
        left, right = (
            np.concatenate([left, (left + right) / 2]),
            np.concatenate([(left + right) / 2, right]),
        )
        total += left.size
        if total > MAX_SEGMENTS:
            return f"the delay is so long that over {MAX_SEGMENTS} frequencies would be needed"
    return np.unique(np.concatenate(done))


def multiply(a: QuasiPolynomial, b: QuasiPolynomial) -> QuasiPolynomial:
    """Multiply two quasi-polynomials, at most one of which has a delay."""
    if a.delay and b.delay:
        raise NotImplementedError("a product of two delayed factors has two delays; keep it factored")
    if b.delay:
        a, b = b, a
    q, r = np.convolve(a.q, b.q), np.convolve(a.r, b.q)
    return QuasiPolynomial(q, r, a.delay, np.convolve(a.scale, b.scale))


def add(a: FloatArray, b: FloatArray) -> FloatArray:
    """Add two coefficient arrays in descending powers."""
    if a.size < b.size:
        a, b = b, a
    total = np.array(a, dtype=float)
    total[a.size - b.size :] += b
    return total


def differentiate(coefficients: FloatArray) -> FloatArray:
    """Differentiate a polynomial given in descending powers."""
    return coefficients[:-1] * np.arange(coefficients.size - 1, 0, -1)


def _argument_change(p: QuasiPolynomial) -> float | str:
    """Change of arg p(jω) from ω = 0 to infinity, in radians; or the reason why there is none."""
    omega = frequency_segments(p)
    if isinstance(omega, str):
        return omega
    values = p(1j * omega)
    # Beyond the last frequency the leading term q_n (jω)^n keeps p in an open half plane around it.
    leading = p.q[0] * 1j**p.degree
    steps = np.angle(values[1:] / values[:-1])
    return float(steps.sum() + np.angle(leading / values[-1]))


def _zero_free(
    p: QuasiPolynomial, centre: FloatArray, radius: FloatArray
) -> tuple[NDArrayBool, NDArrayBool]:
    """Certify discs around j·centre in which p cannot vanish; flag centres where p is rounding.

    Taylor: |p(s) - p(c)| <= sum |p^(m)(c)|/m! radius^m < |p(c)| over the disc.
    """
    spread = radius / centre
    value, bound = _taylor_sums(p.q, centre, spread)
    if p.delay:
        r_value, r_bound = _taylor_sums(p.r, centre, spread)
        value = value + r_value * np.exp(-1j * p.delay * centre)
        bound = bound + r_bound + np.abs(r_value) * np.minimum(2.0, p.delay * radius)
    size = np.abs(value)
    noise = ROUNDING * np.polyval(p.scale, centre)
    return size > bound, size <= noise


def _taylor_sums(
    coefficients: FloatArray, centre: FloatArray, spread: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Value at j·centre and the sum of the higher Taylor terms' sizes for |s - jc| = spread·c."""
    n = coefficients.size
    terms = np.vander(1j * centre, n, increasing=True) * coefficients[::-1]
    taylor = terms @ _pascal(n)
    powers = np.vander(spread, n, increasing=True)
    return taylor[:, 0], (np.abs(taylor[:, 1:]) * powers[:, 1:]).sum(axis=1)


@lru_cache(maxsize=64)
def _pascal(n: int) -> FloatArray:
    """Binomial coefficients C(i, m), row i, column m."""
    table = np.zeros((n, n))
    table[:, 0] = 1.0
    for i in range(1, n):
        table[i, 1:] = table[i - 1, 1:] + table[i - 1, :-1]
    return table


def _dominance_radius(ascending: FloatArray) -> float:
    """Radius beyond which the last term exceeds the sum of the others (Fujiwara's bound)."""
    n = ascending.size - 1
    sizes = np.abs(ascending[:-1])
    exponents = n - np.arange(n)
    return float(2 * np.max(sizes ** (1 / exponents), initial=1e-300)) * 1.01


def _lowest(p: QuasiPolynomial) -> float | None:
    """Frequency below which the constant term dominates, None if it is only rounding."""
    constant = p.q[-1] + (p.r[-1] if p.delay else 0.0)
    if abs(constant) <= ROUNDING * p.scale[-1]:
        return None
    ascending = p.scale[::-1].copy()
    if p.delay:  # |exp(-jωT) - 1| <= ωT
        ascending = add(ascending[::-1], np.append(np.abs(p.r) * p.delay, 0.0))[::-1]
    ascending[0] = abs(constant)
    return 1 / _dominance_radius(ascending[::-1] / abs(constant))


def _polished(p: QuasiPolynomial, roots: ComplexArray) -> ComplexArray:
    """Newton steps on p, each kept only where it lowers |p|."""
    value = p(roots)
    for _ in range(3):
        with np.errstate(all="ignore"):  # a step that is not finite is refused below
            step = value / p.derivative(roots)
            tried = p(roots - step)
        keep = np.abs(tried) < np.abs(value)
        roots, value = np.where(keep, roots - step, roots), np.where(keep, tried, value)
        if not np.any(np.abs(step[keep]) > 4e-16 * np.abs(roots[keep])):
            break
    return roots


def _delay_roots(p: QuasiPolynomial) -> ComplexArray:
    """Rightmost roots of p: u = -(r/q) w, w = u delayed, the delay line collocated."""
    nodes = 24
    while True:
        found = _collocated_roots(p, nodes)
        # |q(s)| <= |r(s)| exp(-T Re s) bounds every root to the right of the rightmost one found.
        abscissa = min(float(found.real.max(initial=-1 / p.delay)), 0.0)
        right_half_plane, rightmost = (_nodes_needed(p, a) for a in (0.0, abscissa))
        if rightmost <= nodes or (right_half_plane <= nodes and rightmost > MAX_DELAY_NODES):
            return found
        if right_half_plane > MAX_DELAY_NODES:
            raise ArithmeticError(
                f"the delay of {p.delay:.4g} s is too long against the loop's bandwidth to "
                "resolve its roots"
            )
        nodes = int(min(max(rightmost, nodes + 8), MAX_DELAY_NODES))


def _nodes_needed(p: QuasiPolynomial, abscissa: float) -> float:
    """Collocation points that resolve every root to the right of `abscissa`."""
    return 0.8 * _reach(p, float(np.exp(-p.delay * abscissa))) * p.delay + 20


def _reach(p: QuasiPolynomial, growth: float) -> float:
    """Radius beyond which |q| > growth·|r|, or that of the resolved roots of a neutral chain."""
    n = p.q.size
    if p.r.size == n and growth * p.neutral_ratio >= 1:
        growth = 0.999 / p.neutral_ratio
    sizes = add(np.abs(p.q), growth * np.abs(p.r))
    sizes[0] = abs(p.q[0]) - (growth * abs(p.r[0]) if p.r.size == n else 0.0)
    radius = _dominance_radius(sizes[::-1] / sizes[0])
    # Cauchy's bound is the positive root of x^n - (the rest); Newton descends to it from above.
    cauchy = np.append(sizes[0], -sizes[1:])
    for _ in range(6):
        radius -= float(np.polyval(cauchy, radius) / np.polyval(np.polyder(cauchy), radius))
    return radius


def _collocated_roots(p: QuasiPolynomial, nodes: int) -> ComplexArray:
    n = p.q.size - 1
    speed = _reach(p, 1.0)
    # Time in units of 1/speed keeps the companion form well scaled.
    powers = speed ** np.arange(n, -1, -1.0)
    q = p.q * powers / (p.q[0] * powers[0])
    r = np.concatenate([np.zeros(n + 1 - p.r.size), p.r]) * powers / (p.q[0] * powers[0])
    through = -r[0]  # u = output @ x + through * w
    output = -(r[1:] - r[0] * q[1:])
    companion = np.eye(n, k=-1)
    companion[:1] = -q[1:]
    transport = -_differentiation(nodes) / (p.delay * speed)
    matrix = np.zeros((n + nodes, n + nodes))
    matrix[:n, :n] = companion
    matrix[:1, -1] = 1.0
    matrix[n:, :n] = np.outer(transport[1:, 0], output)
    matrix[n:, n:] = transport[1:, 1:]
    matrix[n:, -1] += transport[1:, 0] * through
    guesses = np.linalg.eigvals(matrix).astype(complex) * speed
    # To the left only roots that the collocation resolves are true; to the right the delayed term
    # is small and Newton's method settles every one.
    resolved = (np.abs(guesses) * p.delay < 1.1 * nodes) & (guesses.real * p.delay > -30)
    guesses = guesses[resolved | (guesses.real > 0)]
    roots = _polished(p, guesses)
    moved = np.abs(roots - guesses) * p.delay
    with np.errstate(divide="ignore", invalid="ignore"):
        residual = np.abs(p(roots)) / (
            np.polyval(np.abs(p.q), np.abs(roots))
            + np.polyval(np.abs(p.r), np.abs(roots)) * np.exp(-p.delay * roots.real)
        )
    true = (moved < 1e-2 * (1 + np.abs(guesses) * p.delay)) & (residual < 1e-9)
    return roots[true]


@lru_cache(maxsize=32)
def _differentiation(nodes: int) -> FloatArray:
    """Chebyshev differentiation on [0, 1], points from 0 to 1, (nodes+1) by (nodes+1)."""
    x = np.cos(pi * np.arange(nodes + 1) / nodes)
    weights = np.where((np.arange(nodes + 1) % nodes) == 0, 2.0, 1.0) * (-1.0) ** np.arange(nodes + 1)
    difference = x[:, None] - x[None, :] + np.eye(nodes + 1)
    matrix = np.outer(weights, 1 / weights) / difference
    matrix -= np.diag(matrix.sum(axis=1))
    return -2.0 * matrix


def _trim(coefficients: FloatArray, scale: FloatArray) -> FloatArray:
    """Drop leading coefficients that are rounding of larger terms which cancelled."""
    size = scale[-coefficients.size :]
    if abs(coefficients[0]) > ROUNDING * size[0]:
        return coefficients
    used = np.flatnonzero(np.abs(coefficients) > ROUNDING * size)
    return coefficients[used[0] :] if used.size else np.zeros(1)


def _trailing_zeros(coefficients: FloatArray) -> int:
    if coefficients[-1]:
        return 0
    used = np.flatnonzero(coefficients)
    return int(coefficients.size - 1 - used[-1]) if used.size else int(coefficients.size)


def _drop(coefficients: FloatArray, m: int) -> FloatArray:
    return coefficients[:-m] if coefficients.size > m else np.zeros(1)
