r"""Quasi-polynomials :math:`p(s) = q(s) + r(s)\,e^{-sT}`: where the roots of a delayed loop live.

Two independent ways to know the right half plane, neither of which approximates the delay away:

- `count_rhp` follows the argument of p along the imaginary axis (Mikhailov). Each step is
  certified: a Taylor bound proves that p has no zero in the disc over the step, so that no
  resonance, however sharp, can slip between two frequencies.
- `QuasiPolynomial.roots` are the roots themselves, see `nrdob.rootfinding`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache, reduce
from math import ceil, comb, inf, log2, pi
from typing import Any

import numpy as np

from .blocks import ROUNDING, BoolArray, ComplexArray, FloatArray
from .rootfinding import delay_roots, dominance_radius, polynomial_roots

MAX_SEGMENTS = 400_000


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
    scale: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        q, r = np.asarray(self.q, dtype=float), np.asarray(self.r, dtype=float)
        scale = self.scale if self.scale.size else add(np.abs(q), np.abs(r))
        if self.delay:
            r = _trim(r, scale)
        else:
            q, r = add(q, r), np.zeros(1)
        q = _trim(q, scale)
        delay = self.delay if self.delay and r.any() else 0.0
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
        if self.r.size > self.q.size or not self.q.any():
            return inf
        return float(abs(self.r[0] / self.q[0]))

    @cached_property
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

    @property
    def constant(self) -> float:
        """Value at s = 0."""
        return float(self.q[-1] + self.r[-1])

    def __call__(self, s: complex | ComplexArray) -> Any:
        """Evaluate at complex `s`, a number or an array of any shape."""
        s = np.asarray(s, dtype=complex)
        value = _horner(self.q, s)
        if self.delay:
            value = value + _horner(self.r, s) * np.exp(-self.delay * s)
        return value

    def near_axis(self, roots: ComplexArray) -> BoolArray:
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
            If the delay is too long for the loop's speed to be resolved (see `nrdob.rootfinding`).
        """
        p = self.without_origin
        found = delay_roots(p.q, p.r, p.delay) if p.delay else polynomial_roots(p.q)
        if self.zeros_at_origin:
            found = np.concatenate([found, np.zeros(self.zeros_at_origin)])
        return found[np.lexsort((-found.imag, -found.real))]


@dataclass(frozen=True)
class RootCount:
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
    if p.delay and not p.q.any():  # a bare dead time has no zeros: those of r are left
        p = QuasiPolynomial(p.r, scale=p.scale)
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
    high = dominance_radius(p.scale[::-1] / (abs(p.q[0]) * (1 - p.neutral_ratio)))
    low = _lowest(p)
    if low is None:
        return "a root at s = 0 within rounding"
    span = max(high / low, 1.0)
    count = ceil(min(max(log2(span), 1), 2000))
    todo = np.concatenate([[0.0], low * span ** (np.arange(count + 1) / count)])
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


def multiply(*factors: QuasiPolynomial) -> QuasiPolynomial:
    """Multiply quasi-polynomials, at most one of which has a delay."""
    if len(factors) == 1:
        return factors[0]
    delays = [factor.delay for factor in factors if factor.delay]
    if len(delays) > 1:
        raise NotImplementedError("two delayed factors have two delays; keep them factored")
    q = reduce(np.convolve, [factor.q for factor in factors])
    scale = reduce(np.convolve, [factor.scale for factor in factors])
    if not delays:
        return QuasiPolynomial(q, scale=scale)
    r = reduce(np.convolve, [factor.r if factor.delay else factor.q for factor in factors])
    return QuasiPolynomial(q, r, delays[0], scale)


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


def _horner(coefficients: FloatArray, s: ComplexArray) -> Any:
    """`numpy.polyval` without its overhead, which would be most of the time on a few points."""
    first, *others = coefficients.tolist()
    value = np.full_like(s, first)[()]
    for coefficient in others:
        value = value * s + coefficient
    return value


def _argument_change(p: QuasiPolynomial) -> float | str:
    """Change of arg p(jω) from ω = 0 to infinity, in radians; or the reason why there is none."""
    omega = frequency_segments(p)
    if isinstance(omega, str):
        return omega
    values = np.append(complex(p.constant), _scaled_values(p, omega[1:]))
    # Beyond the last frequency the leading term q_n (jω)^n keeps p in an open half plane around it.
    leading = p.q[0] * 1j**p.degree
    steps = np.angle(values[1:] / values[:-1])
    return float(steps.sum() + np.angle(leading / values[-1]))


def _zero_free(
    p: QuasiPolynomial, centre: FloatArray, radius: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Certify discs around j·centre in which p cannot vanish; flag centres where p is rounding.

    Taylor: |p(s) - p(c)| <= sum |p^(m)(c)|/m! radius^m < |p(c)| over the disc.
    """
    n = p.scale.size
    powers, spread = _powers(p, centre), (radius / centre)[:, None] ** np.arange(n)
    value, bound = _taylor_sums(p.q, powers, spread)
    if p.delay:
        r_value, r_bound = _taylor_sums(p.r, powers, spread)
        value = value + r_value * np.exp(-1j * p.delay * centre)
        bound = bound + r_bound + np.abs(r_value) * np.minimum(2.0, p.delay * radius)
    size = np.abs(value)
    noise = ROUNDING * (powers @ p.scale[::-1])
    return size > bound, size <= noise


def _powers(p: QuasiPolynomial, omega: FloatArray) -> FloatArray:
    """Powers 0, 1, 2, … of each frequency along axis 1, in a unit in which no term exceeds 1.

    The unit differs from row to row; what is asked of a row does not depend on it. Without it the
    roots of a very fast filter, 1e30 rad/s and more, would overflow.
    """
    exponents = np.log(omega)[:, None] * np.arange(p.scale.size)
    present = p.scale[::-1] > 0
    with np.errstate(divide="ignore"):
        largest = np.max(exponents + np.log(p.scale[::-1]), axis=1, keepdims=True)
    return np.exp(np.where(present, exponents - largest, -np.inf))


def _scaled_values(p: QuasiPolynomial, omega: FloatArray) -> ComplexArray:
    """p(jω) up to a positive factor that differs from one frequency to the next, ω > 0."""
    powers = _powers(p, omega) * _unit_powers(p.scale.size)
    values = powers[:, : p.q.size] @ p.q[::-1]
    if p.delay:
        values = values + (powers[:, : p.r.size] @ p.r[::-1]) * np.exp(-1j * p.delay * omega)
    return np.asarray(values)


def _unit_powers(count: int) -> ComplexArray:
    return np.array([(1, 1j, -1, -1j)[i % 4] for i in range(count)])


def _taylor_sums(
    coefficients: FloatArray, powers: FloatArray, spread: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Value at jc and the sum of the higher Taylor terms' sizes for |s - jc| = spread·c.

    Both c and spread are given by their powers 0, 1, 2, … along axis 1.
    """
    n = coefficients.size
    taylor = (powers[:, :n] * coefficients[::-1]) @ _binomial(n)
    return taylor[:, 0], (np.abs(taylor[:, 1:]) * spread[:, 1:n]).sum(axis=1)


@lru_cache(maxsize=64)
def _binomial(n: int) -> ComplexArray:
    """Binomial coefficients times powers of j: C(i, m) j^i, row i, column m."""
    return np.array([[comb(i, m) * (1, 1j, -1, -1j)[i % 4] for m in range(n)] for i in range(n)])


def _lowest(p: QuasiPolynomial) -> float | None:
    """Frequency below which the constant term dominates, None if it is only rounding."""
    if abs(p.constant) <= ROUNDING * p.scale[-1]:
        return None
    ascending = p.scale[::-1].copy()
    if p.delay:  # |exp(-jωT) - 1| <= ωT
        ascending = add(ascending[::-1], np.append(np.abs(p.r) * p.delay, 0.0))[::-1]
    ascending[0] = abs(p.constant)
    return 1 / dominance_radius(ascending[::-1] / ascending[0])


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
