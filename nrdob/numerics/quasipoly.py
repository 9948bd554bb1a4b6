r"""Quasi-polynomials :math:`p(s) = q(s) + r(s)\,e^{-sT}`: where the roots of a delayed loop live.

Independent ways to know the right half plane, none of which approximates the delay away:

- `count_rhp` follows the argument of p along the imaginary axis (Mikhailov), in steps that are
  certified, so that no resonance, however sharp, can slip between two frequencies: see
  `nrdob.numerics.argument`.
- `QuasiPolynomial.roots` are the roots themselves: eigenvalues (`nrdob.numerics.rootfinding`), or
  with a long delay the rightmost ones (`nrdob.numerics.longdelay`).
- `QuasiPolynomial.rhp_in_whole_numbers` asks the coefficients alone, without rounding: Routh and
  Hurwitz's test (`nrdob.numerics.exact`), or with a delay Walton and Marshall's count
  (`nrdob.numerics.crossingcount`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, reduce
from math import inf, isnan, pi
from typing import Any

import numpy as np

from .argument import Term, Turn, turn, zero_free_frequencies
from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray
from .crossingcount import count_by_crossings
from .exact import rhp_count, whole
from .longdelay import rightmost_roots
from .rootfinding import delay_roots, polynomial_roots


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

    @property
    def terms(self) -> tuple[Term, ...]:
        """The polynomials with their dead times."""
        undelayed = Term(self.q, 0.0)
        return (undelayed, Term(self.r, self.delay)) if self.delay else (undelayed,)

    @cached_property
    def finite_part(self) -> QuasiPolynomial:
        """What is left when roots at s = 0 and a bare dead time, which has none, are taken out."""
        p = self.without_origin
        return QuasiPolynomial(p.r, scale=p.scale) if p.delay and not p.q.any() else p

    @cached_property
    def turn(self) -> Turn:
        """Turn of the argument from ω = 0 to infinity, see `nrdob.numerics.argument`.

        That of the finite part: a root at s = 0, which the path passes on the right, adds a
        quarter of a revolution.
        """
        p = self.finite_part
        return turn(p.terms, p.scale)

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

        All of them for a polynomial. With a delay: all in the right half plane and the rightmost
        ones of the left half plane. With a delay so long that `roots_resolved` is false: roots of
        which none lies further to the right than the first; none at all if that is not certain.
        """
        found = self._eigenvalues
        if found is None:
            p = self.without_origin
            found = rightmost_roots(p.q, p.r, p.delay)
        if self.zeros_at_origin:
            found = np.concatenate([found, np.zeros(self.zeros_at_origin)])
        return found[np.lexsort((-found.imag, -found.real))]

    @property
    def roots_resolved(self) -> bool:
        """Whether `roots` are eigenvalues, which hold every root in the right half plane."""
        return self._eigenvalues is not None

    @cached_property
    def _eigenvalues(self) -> ComplexArray | None:
        p = self.without_origin
        if not p.delay:
            return polynomial_roots(p.q)
        try:
            return delay_roots(p.q, p.r, p.delay)
        except ArithmeticError:
            return None

    @cached_property
    def rhp_in_whole_numbers(self) -> int | None:
        """Roots in the open right half plane, from the coefficients alone, without rounding.

        By Routh and Hurwitz's test, see `nrdob.numerics.exact`, or with a delay by Walton and
        Marshall's count, see `nrdob.numerics.crossingcount`. None where there are roots on the
        axis; roots at s = 0 that the coefficients prove are not counted.
        """
        p = self.finite_part
        return count_by_crossings(p.q, p.r, p.delay) if p.delay else rhp_count(whole(p.q)[0])


@dataclass(frozen=True)
class RootCount:
    """Number of roots with positive real part.

    Attributes
    ----------
    count : float or None
        The number, infinite for an advanced or an unstable neutral equation; None where roots on
        the axis, within rounding, leave it open.
    reason : str
        Why the count is not known.
    at_least : float
        Roots that are on the right whatever rounding does to those on the axis, which the path
        passes on their right.
    """

    count: float | None
    reason: str = ""
    at_least: float = 0


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
    p = p.finite_part
    ratio = p.neutral_ratio
    if abs(ratio - 1) <= ROUNDING:
        return RootCount(None, "neutral with |r/q| = 1 at infinite frequency: a chain of roots "
                               "comes arbitrarily close to the imaginary axis")  # fmt: skip
    if ratio > 1:
        return RootCount(inf, at_least=inf)
    try:
        turn = p.turn
    except ArithmeticError as error:
        return RootCount(None, str(error))
    if isnan(turn.angle):
        return RootCount(None, _where(turn))
    turns = p.degree / 2 - turn.angle / pi
    count = round(turns)
    if abs(turns - count) > 0.1:
        return RootCount(None, "the turns of the argument do not add up to a whole number")
    if turn.touched:
        return RootCount(None, _where(turn), count)
    return RootCount(count, at_least=count)


def frequency_segments(p: QuasiPolynomial) -> FloatArray:
    """Frequencies between which p provably turns by less than half a revolution.

    See `nrdob.numerics.argument.zero_free_frequencies` for roots on the axis and for very long
    delays.

    Parameters
    ----------
    p : QuasiPolynomial
        Without roots at s = 0; retarded, or neutral with ratio below 1.

    Returns
    -------
    array of float
        Increasing frequencies in rad/s from 0 to where the leading term dominates.
    """
    return zero_free_frequencies(p.terms, p.scale)


def _where(turn: Turn) -> str:
    if 0.0 in turn.touched:
        return "a root at s = 0 within rounding"
    return f"a root on the imaginary axis within rounding, near {turn.touched[0]:.6g} rad/s"


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
