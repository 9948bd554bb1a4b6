r"""Quasi-polynomials :math:`q(s) + r(s)\,e^{-sT} + …`: where the roots of a delayed loop live.

There is one delayed term for every dead time: one in the process, another in a delayed model. The
right half plane is known in independent ways, none of which approximates the delay away: by the
argument along the imaginary axis (`nrdob.numerics.count_rhp`); by the roots, which are eigenvalues,
or with a long delay the rightmost ones; and from the coefficients alone, without rounding, by Routh
and Hurwitz's test or Walton and Marshall's crossings (`nrdob.numerics.crossingcount`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from itertools import product
from math import factorial, inf, isnan, pi
from typing import Any

import numpy as np

from .argument import ArgumentChange, Term, argument_change, argument_changes
from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray
from .coefficients import add, exponential, exponential_rest, horner, trailing_zeros, trim
from .crossingcount import count_by_crossings, crossings_between
from .exact import rhp_count, whole
from .longdelay import rightmost_roots
from .rootfinding import delay_roots, polynomial_roots

__all__ = ["QuasiPolynomial", "follow_together", "multiply"]

AT_ORIGIN = 1e-6  # size of a root, times the dead time, that is the one at s = 0


@dataclass(frozen=True, eq=False)
class QuasiPolynomial:
    r"""The function :math:`q(s) + r(s)\,e^{-sT}` with real polynomials, or with further such terms.

    Parameters
    ----------
    q, r : array_like of float
        Coefficients in descending powers of s. Without a delay, r is added to q.
    delay : float
        T >= 0, in seconds.
    scale : array_like of float, optional
        For each power of s (descending) the size of what was summed to give the coefficients of
        the terms, which tells how much of them may be rounding.
    more : tuple of Term, optional
        Further terms. Those with equal delays are added up; r and `delay` are then the term with
        the longest one, `more` those with the others, in descending order.
    origin : int
        Roots of the sum at s = 0 that are known to be there, although rounding hides them in the
        coefficients.
    divided : int
        Power of s by which the sum is divided, although not all of its terms have it: see `over_s`.

    Examples
    --------
    >>> p = QuasiPolynomial([1.0, 0.0], [1.0], delay=1.0)      # s + exp(-s)
    >>> complex(p(0.0))
    (1+0j)
    >>> p.rhp_in_whole_numbers
    0
    """

    q: FloatArray
    r: FloatArray = field(default_factory=lambda: np.zeros(1))
    delay: float = 0.0
    scale: FloatArray = field(default_factory=lambda: np.zeros(0))
    more: tuple[Term, ...] = ()
    origin: int = 0
    divided: int = 0

    def __post_init__(self) -> None:
        q, r = np.asarray(self.q, dtype=float), np.asarray(self.r, dtype=float)
        scale = self.scale
        if not (self.delay or self.more or any(r.tolist())):  # the usual polynomial, in less time
            scale = scale if scale.size else np.abs(q)
            q = trim(q, scale)
            self.__dict__.update(q=q, r=np.zeros(1), scale=scale[-q.size :])
            return
        given = [Term(r, self.delay), *self.more]
        if not scale.size:
            scale = reduce(add, [np.abs(term.q) for term in given], np.abs(q))
        sums: dict[float, FloatArray] = {}
        for p, delay in given:
            if delay:
                sums[delay] = add(sums[delay], p) if delay in sums else p
            else:
                q = add(q, p)
        trimmed = {delay: trim(p, scale) for delay, p in sums.items()}
        delayed = [Term(p, delay) for delay, p in trimmed.items() if p.any()]
        delayed.sort(key=lambda term: -term.delay)
        q = trim(q, scale)
        r, delay = delayed[0] if delayed else (np.zeros(1), 0.0)
        scale = scale[-max(q.size, *(term.q.size for term in delayed), 1) :]
        self.__dict__.update(q=q, r=r, scale=scale, delay=delay, more=tuple(delayed[1:]))

    @cached_property
    def delayed(self) -> tuple[Term, ...]:
        """The terms with dead time, the longest first."""
        return (Term(self.r, self.delay), *self.more) if self.delay else ()

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """The polynomials with their dead times, the one without first."""
        return (Term(self.q, 0.0), *self.delayed)

    @property
    def degree(self) -> int:
        """Highest power of s that occurs."""
        if not self.delay:  # the usual polynomial, in less time
            return self.q.size - 1
        return max(term.q.size for term in self.terms) - 1 - self.divided

    @property
    def neutral_ratio(self) -> float:
        """Sizes of the delayed leading coefficients together against the undelayed one.

        0 for a polynomial or a retarded equation, a positive number for a neutral one,
        infinite for an advanced one.
        """
        if not self.delay:
            return 0.0
        if max(term.q.size for term in self.delayed) > self.q.size or not self.q.any():
            return inf
        leading = sum(abs(p[0]) for p, _ in self.delayed if p.size == self.q.size)
        return float(leading / abs(self.q[0]))

    @cached_property
    def zeros_at_origin(self) -> int:
        """Multiplicity of the root s = 0 that the coefficients prove exactly, or that is known."""
        if not self.delay:
            return trailing_zeros(self.q) if not self.q[-1] and self.q.any() else 0
        shared = self._shared_zeros
        cancel = sum(float(p[-1 - shared]) for p, _ in self.terms if p.size > shared) == 0
        return max(shared + cancel, self.origin) - self.divided

    @cached_property
    def undivided(self) -> QuasiPolynomial:
        """The sum of terms itself, where it has been divided by a power of s."""
        return replace(self, divided=0) if self.divided else self

    @property
    def _shared_zeros(self) -> int:
        """Multiplicity of the root s = 0 that all terms share."""
        return min(trailing_zeros(p) for p, _ in self.terms if p.any())

    @cached_property
    def without_origin(self) -> QuasiPolynomial:
        """The quasi-polynomial divided by its roots at s = 0."""
        return self.over_s(self.zeros_at_origin)

    def over_s(self, power: int) -> QuasiPolynomial:
        """Divide by a power of s, at most `zeros_at_origin`, that not every term has.

        Parameters
        ----------
        power : int
        """
        if not power:
            return self
        shared = min(power, self._shared_zeros)
        p = self._times_s(-shared)
        return replace(p, divided=p.divided + power - shared) if power > shared else p

    def lifted(self, power: int) -> QuasiPolynomial:
        """Multiply by a power of s, at least `divided`: whole terms are left.

        Parameters
        ----------
        power : int
        """
        return self.undivided._times_s(power - self.divided)

    def _times_s(self, power: int) -> QuasiPolynomial:
        """Multiply every term by a power of s, or divide where all of them have it."""
        if not power:
            return self

        def moved(p: FloatArray) -> FloatArray:
            if not p.any():
                return p
            return np.append(p, np.zeros(power)) if power > 0 else p[:power]

        delayed = tuple(Term(moved(p), delay) for p, delay in self.delayed)
        origin = self.origin + power
        return QuasiPolynomial(moved(self.q), scale=moved(self.scale), more=delayed, origin=origin)

    @cached_property
    def expanded(self) -> tuple[FloatArray, int]:
        r"""P and m of ``P(s) + sum of r(s) (exp(-sT) - its Taylor polynomial of degree m - 1)``.

        That is the undivided sum, written so that its root at s = 0, which its terms have only
        together, of multiplicity m, is one of P, too.
        """
        zeros = self.zeros_at_origin + self.divided
        m = zeros - self._shared_zeros if self.delay else 0
        if m <= 0:
            return self.q, 0
        parts = [np.convolve(r, exponential(delay, m)) for r, delay in self.delayed]
        p = reduce(add, parts, self.q)
        p[-min(zeros, p.size) :] = 0.0
        return p, m

    @property
    def constant(self) -> float:
        """Value at s = 0."""
        p, m = self.expanded
        if m > self.divided:
            return 0.0
        at_zero = float(p[-1 - m]) if p.size > m else 0.0
        return at_zero + sum(float(r[-1]) * (-T) ** m / factorial(m) for r, T in self.delayed)

    def __call__(self, s: complex | ComplexArray) -> Any:
        """Evaluate at complex `s`, a number or an array of any shape."""
        s = np.asarray(s, dtype=complex)
        p, m = self.expanded if self.divided else (self.q, 0)
        value = horner(p[: p.size - m], s) if p.size > m else 0.0
        for r, T in self.delayed:
            value = value + horner(r, s) * (-T) ** m * exponential_rest(-T * s, m, divided=True)
        return value * s ** (m - self.divided) if m > self.divided else value

    def size(self, s: ComplexArray) -> FloatArray:
        """Size of what is summed to give the value at each `s` on the axis or right of it.

        Parameters
        ----------
        s : array of complex
            In rad/s.
        """
        scale = self.scale
        if self.divided:  # Taylor's remainder of exp(-sT) is at most T^m |s|^m/m!
            late = [np.convolve(abs(r), exponential(-T, self.divided + 1)) for r, T in self.delayed]
            scale = reduce(add, late, scale)[: -self.divided]
        return np.asarray(np.polyval(scale, np.abs(s)))

    @cached_property
    def finite_part(self) -> QuasiPolynomial:
        """What is left when roots at s = 0 and a bare dead time, which has none, are taken out."""
        p = self.without_origin
        if not p.delay or p.divided or p.q.any():
            return p
        shortest = p.delayed[-1].delay
        advanced = tuple(Term(r, delay - shortest) for r, delay in p.delayed)
        return QuasiPolynomial(np.zeros(1), scale=p.scale, more=advanced)

    @cached_property
    def argument_change(self) -> ArgumentChange:
        """Change in argument of the finite part from ω = 0 to infinity.

        A root at s = 0, which the path passes on the right, adds a quarter of a revolution.
        """
        p = self.finite_part
        if p is not self:
            return p.argument_change
        found = argument_change(self.terms, self.scale, max(self.divided, 1))
        if not self.divided:
            return found
        touched = tuple(w for w in found.touched if w) if found.origin_alone else found.touched
        return ArgumentChange(found.angle - self.divided * pi / 2, touched)

    def near_axis(self, roots: ComplexArray) -> BoolArray:
        """Tell which roots a change of the coefficients within rounding moves onto the axis.

        Parameters
        ----------
        roots : array of complex, shape (N,)
            Of this function, in rad/s.
        """
        near = np.abs(roots.real) <= 0.1 * np.abs(roots)
        if near.any():
            omega = np.abs(roots.imag[near])
            size = np.polyval(self.scale, omega)
            near[near] = np.abs(self.undivided(1j * omega)) <= ROUNDING * size
        return near

    @cached_property
    def roots(self) -> ComplexArray:
        """Roots, rightmost first: all of a polynomial.

        With a delay all in the right half plane and the rightmost of those in the left one; where
        `roots_resolved` is false roots of which none lies further to the right than the first, or
        none at all if that is not certain.
        """
        found, p = self._eigenvalues, self.without_origin
        if found is None:
            found = rightmost_roots(p.q, p.delayed)
            origin = (np.abs(found) * p.delay <= AT_ORIGIN) & (p.divided > 0)
            # Of the root next to one at s = 0 that is the rightmost nothing is known.
            found = found[:0] if origin[:1].any() else found[~origin]
        found = np.concatenate([found, np.zeros(self.zeros_at_origin)])
        return found[np.lexsort((-found.imag, -found.real))]

    @property
    def roots_resolved(self) -> bool:
        """Whether `roots` are eigenvalues, which hold every root in the right half plane."""
        return self._eigenvalues is not None

    @cached_property
    def _eigenvalues(self) -> ComplexArray | None:
        p = self.without_origin
        if p is not self:
            return p._eigenvalues
        if not p.delay:
            return polynomial_roots(p.q)
        try:
            found = delay_roots(p.q, p.delayed)
        except ArithmeticError:
            return None
        return found[np.argsort(np.abs(found))[p.divided :]]

    @cached_property
    def rhp_in_whole_numbers(self) -> int | None:
        """Roots in the open right half plane, from the coefficients alone, without rounding.

        None where there are roots on the axis; roots at s = 0 that the coefficients prove are not
        counted.
        """
        p = self.finite_part
        if p is not self:
            return p.rhp_in_whole_numbers
        if not p.delay:
            return rhp_count(whole(p.q)[0])
        if p.divided > 1:
            return None
        return p._rhp_between_delays() if p.more else count_by_crossings(p.q, p.r, p.delay)

    def _rhp_between_delays(self) -> int | None:
        """Count with two delays; `divided` roots stay at s = 0 whatever they are."""
        if len(self.more) > 1:
            return None
        (moving, shorter), longer = self.more[0], self.delay
        equal = QuasiPolynomial(self.q, add(self.r, moving), longer, self.scale)
        if equal.zeros_at_origin != self.divided:
            return None
        start = equal.over_s(self.divided).rhp_in_whole_numbers
        change = crossings_between(self.q, (self.r, longer), moving, longer, shorter)
        return None if start is None or change is None else start + change


def follow_together(functions: Iterable[QuasiPolynomial]) -> None:
    """Find changes in argument at once, which takes less time than one by one.

    A root on the axis is left to `argument_change`, and so are polynomials of degree 1 and 2, where
    the coefficients tell.

    Parameters
    ----------
    functions : iterable of QuasiPolynomial
    """
    parts = {id(part): part for part in (p.finite_part for p in functions)}
    alike: dict[int, list[QuasiPolynomial]] = {}
    for p in parts.values():
        least = max(p.degree, 1) if p.delay else 3
        if p.q.size > least and not p.divided and "argument_change" not in p.__dict__:
            alike.setdefault(len(p.delayed), []).append(p)
    for several in alike.values():
        if len(several) < 2:
            continue
        angles = argument_changes([(p.terms, p.scale) for p in several]).tolist()
        for p, angle in zip(several, angles, strict=True):
            if not isnan(angle):
                p.__dict__["argument_change"] = ArgumentChange(angle)  # as if asked for


def multiply(*factors: QuasiPolynomial) -> QuasiPolynomial:
    """Multiply quasi-polynomials; dead times add up, and so do powers of s in denominators.

    Parameters
    ----------
    *factors : QuasiPolynomial
    """
    if len(factors) == 1:
        return factors[0]
    power = sum(factor.divided for factor in factors)
    factors = tuple(factor.undivided for factor in factors)
    scale = reduce(np.convolve, [factor.scale for factor in factors])
    terms = [
        Term(reduce(np.convolve, [p for p, _ in chosen]), sum(delay for _, delay in chosen))
        for chosen in product(*(factor.terms for factor in factors))
    ]
    known = power or any(factor.origin for factor in factors)
    origin = sum(factor.zeros_at_origin for factor in factors) if known else 0
    whole = QuasiPolynomial(terms[0].q, scale=scale, more=tuple(terms[1:]), origin=origin)
    return whole.over_s(power)
