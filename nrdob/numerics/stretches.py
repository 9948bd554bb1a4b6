r"""Stretches of the imaginary axis along which the arguments of sums are known, certified.

Many sums :math:`\sum_i q_i(s)\,e^{-sT_i}` are followed at once. From one frequency to the next the
argument is known where a Taylor bound proves one of two things on the disc over the step:

- the sum has no zero there, so that its argument changes by less than half a revolution;
- one term is larger than all others together. Then the argument stays within a quarter of a
  revolution of that term's, which its dead time turns by exactly T times the step.

All begin on the same frequencies; where neither is certain, stretches are halved. A dead time costs
small steps only where two terms are of equal size: their number grows with the logarithm of T.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, reduce
from math import ceil, comb, inf, log2
from operator import add
from typing import Any, NamedTuple, TypeVar

import numpy as np

from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray, IntArray

__all__ = [
    "ZERO_FREE", "Certified", "ManyTerms", "Stretches", "Sums", "binomial", "certified",
    "multiplied",
]  # fmt: skip

PER_OCTAVE, AT_FIRST = 6, 2000  # stretches to begin with: many take less time than many rounds
SAFETY = 1.05  # value against its Taylor bound, so that no zero hides at the end of a step

MODERATE = 300
"""Exponents of two: below 2^this, coefficients are multiplied by powers below 2^twice this."""

FEW = 1500  # points below which a product with a matrix takes less time than sums of rows
SIGNS = (1.0, 1.0, -1.0, -1.0)  # of j^k for k = 0, 1, 2, 3: real and imaginary by turns
ZERO_FREE, UNDECIDED = -1, -2  # marks of a stretch, beside the number of the dominant term

Numbers = TypeVar("Numbers", FloatArray, ComplexArray)


class ManyTerms(NamedTuple):
    """Terms of many sums, one in each column; a single column stands for any number.

    Attributes
    ----------
    q : (k, n) array of float
        Coefficients in descending powers.
    delay : (n,) array of float
        Dead times in seconds.
    """

    q: FloatArray
    delay: FloatArray

    def of(self, chosen: IntArray) -> ManyTerms:
        """Take some of the columns.

        Parameters
        ----------
        chosen : (m,) array of int
        """
        delay = self.delay[chosen] if self.delay.size > 1 else self.delay
        return ManyTerms(self.q[:, chosen] if self.q.shape[1] > 1 else self.q, delay)

    def across(self) -> ManyTerms:
        """Add an axis for frequencies."""
        return ManyTerms(self.q[:, :, None], self.delay[:, None])


class Stretches(NamedTuple):
    """Stretches: which sum, ends in rad/s, and a mark or the number of the dominant term."""

    column: IntArray
    left: FloatArray
    right: FloatArray
    mark: IntArray

    def where(self, chosen: BoolArray) -> Stretches:
        """Take some of them."""
        if self.mark.ndim == 1:
            column, left, right, mark = self
            return Stretches(column[chosen], left[chosen], right[chosen], mark[chosen])
        column, place = np.nonzero(chosen)
        return Stretches(column, self.left[0, place], self.right[0, place], self.mark[chosen])

    @classmethod
    def joined(cls, parts: Sequence[Stretches]) -> Stretches:
        """Put those together that are decided."""
        decided = [part.where(part.mark != UNDECIDED) for part in parts]
        return cls(*map(np.concatenate, zip(*decided, strict=True)))


class Certified(NamedTuple):
    """What is certain, in rounds; where sums vanish within rounding; which sums are given up."""

    rounds: list[Stretches]
    vanishing: list[Stretches]
    given_up: BoolArray


class Sums(NamedTuple):
    """Sums of terms, of each the first without dead time and of its highest degree.

    `scale` is as for `nrdob.numerics.rhp_counts`; `moderate` tells whether powers stay so far
    within the floating-point range that no unit is needed.
    """

    terms: Sequence[ManyTerms]
    scale: FloatArray
    moderate: bool

    @classmethod
    def between(
        cls, terms: Sequence[ManyTerms], scale: FloatArray, low: float, high: float
    ) -> Sums:
        """Take sums that will be asked for between two frequencies."""
        sizes = scale[scale > 0]  # coefficients 0 are never seen against the others
        moderate = len(scale) * log2(max(high, 1 / low, 1.0)) < 2 * MODERATE
        moderate = moderate and bool(2.0**-MODERATE < sizes.min() <= sizes.max() < 2.0**MODERATE)
        return cls(terms, scale, moderate)

    def of(self, chosen: IntArray) -> Sums:
        """Take some of the sums."""
        if self.scale.shape[-1] == 1:
            return self
        return Sums([term.of(chosen) for term in self.terms], self.scale[:, chosen], self.moderate)

    def across(self) -> Sums:
        """Add an axis for frequencies."""
        return Sums([term.across() for term in self.terms], self.scale[:, :, None], self.moderate)

    @property
    def constant(self) -> FloatArray:
        """Values at s = 0."""
        return np.asarray(_added([q[-1] for q, _ in self.terms]))

    @property
    def degree(self) -> IntArray:
        """Degree of each sum."""
        return np.asarray(len(self.scale) - 1 - (self.scale > 0).argmax(axis=0))

    @property
    def lead(self) -> ComplexArray:
        """Values of the leading terms on the axis, up to a positive factor."""
        degree = self.degree
        ascending = np.broadcast_to(self.terms[0].q[::-1], self.scale.shape)
        return np.asarray(ascending[degree, np.arange(degree.size)] * 1j**degree)

    def powers(self, omega: FloatArray) -> FloatArray:
        """Powers 0, 1, 2, … of frequencies along the first axis, up to a factor for each column.

        Where they might leave the floating-point range (the roots of a very fast filter, 1e30 rad/s
        and more) they are given in a unit in which no term exceeds 1.
        """
        if self.moderate:
            return multiplied(omega, len(self.scale))
        return np.exp(np.where(self.scale[::-1] > 0, self.exponents(omega), -inf))

    def exponents(self, omega: FloatArray) -> FloatArray:
        """Logarithms of the powers of each frequency, in a unit in which no term exceeds 1."""
        exponents = np.log(omega) * np.arange(len(self.scale)).reshape(-1, *[1] * omega.ndim)
        return np.asarray(exponents - (exponents + np.log(self.scale[::-1])).max(axis=0))

    def values(self, omega: FloatArray) -> list[ComplexArray]:
        """Each term at jω > 0, up to a positive factor for each frequency and sum."""
        powers, found = self.powers(omega), []
        for q, delay in self.terms:
            rows = _rows(q, powers)
            if isinstance(rows, np.ndarray):
                real, imag = _binomial_parts(len(q))[:: len(q)] @ rows.reshape(len(q), -1)
                value = (real + 1j * imag).reshape(rows.shape[1:])
            else:
                value = _coefficient(rows, 0, 0) + 1j * _coefficient(rows, 0, 1)
            found.append(value * np.exp(-1j * delay * omega) if delay.any() else value)
        return found

    def changes(self, rounds: Sequence[Stretches]) -> FloatArray:
        """By how much each argument changes from ω = 0 to infinity, in radians."""
        first, *more = rounds
        across = self.across()
        each = across.values(np.append(first.left, first.right[:, -1:], axis=1))
        total = _added(each)
        change = across._over(first, [(value[:, :-1], value[:, 1:]) for value in each]).sum(axis=1)
        change += np.angle(total[:, 0] / self.constant) + np.angle(self.lead / total[:, -1])
        return np.asarray(change + self.changes_over(Stretches.joined(more)) if more else change)

    def changes_over(self, stretches: Stretches) -> FloatArray:
        """By how much each argument changes over its stretches, in radians."""
        column, left, right, _ = stretches
        each = self.of(np.tile(column, 2)).values(np.concatenate([left, right]))
        ends = [(value[: left.size], value[left.size :]) for value in each]
        change = self.of(column)._over(stretches, ends)
        return np.asarray(np.bincount(column, change, self.scale.shape[1]))

    def _over(
        self, stretches: Stretches, ends: list[tuple[ComplexArray, ComplexArray]]
    ) -> FloatArray:
        """Change over each stretch from the terms' values at both ends; 0 over undecided ones."""
        mark = stretches.mark
        before, after = (_added(values) for values in zip(*ends, strict=True))
        change = np.asarray(np.angle(after / before))
        if (mark == ZERO_FREE).all():
            return change
        change[mark == UNDECIDED] = 0.0
        for i, ((start, end), term) in enumerate(zip(ends, self.terms, strict=True)):
            if (on := mark == i).any():
                spans = stretches.left, stretches.right, term.delay
                left, right, T = (np.broadcast_to(each, mark.shape)[on] for each in spans)
                a, b = start[on], end[on]
                prompt = b * np.exp(1j * T * right) / np.exp(1j * T * left)
                # The term without its dead time, the dead time, and from the term to the sum.
                change[on] = np.angle(prompt / a) - T * (right - left)
                change[on] += np.angle(after[on] / b) - np.angle(before[on] / a)
        return change

    def examined(
        self, centre: FloatArray, radius: FloatArray, *, dominance: bool = False
    ) -> tuple[IntArray, BoolArray]:
        """Say for discs around j·centre what certifies them; flag centres that are rounding."""
        spread, powers = radius / centre, self.powers(centre)
        values, sizes, rests, bounds = [], [], [], []
        for q, delay in self.terms:
            value, rest = _taylor_sums(_rows(q, powers), spread)
            size = np.abs(value)
            bounds.append(rest)
            if delay.any():
                value = value * np.exp(-1j * delay * centre)
                bounds.append(size * np.minimum(2.0, delay * radius))
            values.append(value)
            sizes.append(size)
            rests.append(rest)
        noise = ROUNDING * _added(_rows(self.scale, powers))
        size = sizes[0] if len(sizes) == 1 else np.abs(_added(values))
        mark = np.where(size > SAFETY * _added(bounds) + noise, ZERO_FREE, UNDECIDED)
        unknown = mark == UNDECIDED
        if dominance and len(sizes) > 1 and unknown.any():
            everything = _added([*sizes, *rests, noise])
            for i, own in enumerate(sizes):
                # size - rest > what the others can be
                mark[unknown & (2 * own > everything)] = i
            unknown = mark == UNDECIDED
        return mark, unknown & (size <= noise)

    def dominant(self, left: FloatArray, right: FloatArray) -> IntArray:
        """Find the term that is certainly larger than all others on each stretch, or `UNDECIDED`.

        For terms of nearly equal size over a long stretch: the difference of their squares is
        bounded, not each. The sum of n - 1 squares is at least the square of the sum divided by
        n - 1. Each stretch has its own unit of frequency and of size, so that no square leaves the
        range.
        """
        ratio = right / left
        omega = left * np.sqrt((1 + ratio**2) / 2)
        exponents = self.exponents(omega)
        local = np.zeros((len(self.terms), *exponents.shape))
        for rows, (q, _) in zip(local, self.terms, strict=True):
            sizes = np.exp(exponents[: len(q)] + np.log(np.abs(q[::-1])))
            rows[: len(q)] = sizes * np.sign(q[::-1])
        noise = ROUNDING * np.exp(exponents + np.log(self.scale[::-1])).sum(axis=0) ** 2
        spread = multiplied((ratio**2 - 1) / (ratio**2 + 1), len(exponents))[1:]
        squares = [_squared_sizes(rows) for rows in local]
        mark = np.full(omega.size, UNDECIDED)
        for i, square in enumerate(squares):
            lead = square - (len(squares) - 1) * (_added(squares) - square)
            taylor = binomial(len(lead)).T @ lead
            mark[taylor[0] - (np.abs(taylor[1:]) * spread).sum(axis=0) > noise] = i
        return mark


def certified(
    sums: Sums, low: float, high: float, limit: int, *, dominance: bool = True
) -> Certified:
    """Cut the axis between two frequencies, at most `limit` times for each sum."""
    n = sums.scale.shape[1]
    span = max(high / low, 1.0)
    count = ceil(min(max((PER_OCTAVE if dominance else 1) * log2(span), 1), AT_FIRST))
    edges = low * span ** (np.arange(count + 1) / count)
    edges[-1] = high
    column = np.arange(n)
    left: FloatArray = edges[None, :-1]
    right: FloatArray = edges[None, 1:]
    own = sums.across()
    found = Certified([], [], np.zeros(n, dtype=bool))
    steps = np.full(n, count)
    while True:
        mark, vanishing = own.examined((left + right) / 2, (right - left) / 2, dominance=dominance)
        part = Stretches(column, left, right, mark)
        found.rounds.append(part)
        unknown = mark == UNDECIDED
        if not unknown.any():
            return found
        column, left, right, _ = part.where(unknown)
        if dominance and len(sums.terms) > 1:
            mark[unknown] = sums.of(column).dominant(left, right)
            unknown = mark == UNDECIDED
            column, left, right, _ = part.where(unknown)
        middle = (left + right) / 2
        gone = vanishing[unknown] | (middle <= left) | (middle >= right)
        if gone.any():
            found.vanishing.append(Stretches(column, left, right, column).where(gone))
        steps += 2 * np.bincount(column, minlength=n)
        np.logical_or(found.given_up, steps > limit, out=found.given_up)
        more = ~(gone | found.given_up[column])
        if not more.any():
            return found
        column, left, middle, right = (each[more] for each in (column, left, middle, right))
        column = np.concatenate([column, column])
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
        own = sums.of(column)


def _taylor_sums(
    rows: FloatArray | list[FloatArray], spread: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Value of a polynomial at jc, and how far it can be from it for |s - jc| <= spread·c.

    The rows are its terms at c, in ascending powers. Taylor: that far is at most the sum of
    |q^(m)(jc)|/m! radius^m. Of rows in a list the sum of both parts' sizes stands for the size,
    which takes less time, and is no smaller.
    """
    n = len(rows)
    rest: FloatArray | float = 0.0
    if isinstance(rows, np.ndarray):
        parts = (_binomial_parts(n) @ rows.reshape(n, -1)).reshape(-1, *rows.shape[1:])
        for size in np.hypot(parts[n - 1 : 0 : -1], parts[:n:-1]):
            rest = (rest + size) * spread
        return parts[0] + 1j * parts[n], np.asarray(rest)
    for m in reversed(range(n)):
        even, odd = (_coefficient(rows, m, first) for first in (0, 1))
        if m:
            rest = (rest + (np.abs(even) + np.abs(odd))) * spread
    return even + 1j * odd, np.asarray(rest)


def _coefficient(rows: list[FloatArray], m: int, first: int) -> FloatArray:
    """Taylor's coefficient m up to a power of j: its real part, or its imaginary one."""
    parts = [
        rows[i] if i == m else (comb(i, m) * SIGNS[(i - m) % 4]) * rows[i]
        for i in range(m + first, len(rows), 2)
    ]
    return np.asarray(_added(parts)) if parts else np.zeros(1)


def _rows(q: FloatArray, powers: FloatArray) -> FloatArray | list[FloatArray]:
    """Terms of polynomials in ascending powers: an array where that takes less time, see `FEW`."""
    ascending, powers = q[::-1], powers[: len(q)]
    if np.broadcast(q[0], powers[0]).size < FEW:
        return ascending * powers
    return [c * power for c, power in zip(ascending, powers, strict=True)]


def _added(parts: Any) -> Any:
    return parts.sum(axis=0) if isinstance(parts, np.ndarray) else reduce(add, parts)


def multiplied(x: Numbers, count: int) -> Numbers:
    """Powers 0, 1, 2, … of each number along the first axis."""
    found = np.ones((count, *x.shape), dtype=x.dtype)
    found[1:] = x
    return np.multiply.accumulate(found, axis=0, out=found)


def _squared_sizes(ascending: FloatArray) -> FloatArray:
    """|q(jω)|² in ascending powers of ω², for polynomials in columns."""
    squares = np.zeros_like(ascending)
    for first in (0, 1):
        part = ascending[first::2].copy()
        part[1::2] *= -1
        for k in range(len(part)):
            squares[first + k : first + k + len(part)] += part[k] * part
    return squares


@lru_cache(maxsize=64)
def binomial(n: int) -> FloatArray:
    """Binomial coefficients C(i, m), row i, column m."""
    return np.array([[float(comb(i, m)) for m in range(n)] for i in range(n)])


@lru_cache(maxsize=64)
def _binomial_parts(n: int) -> FloatArray:
    """Real parts of j^(i-m) C(i, m), row m, column i, and below them the imaginary ones."""
    found = np.zeros((2, n, n))
    for i, m in np.ndindex(n, n):
        found[(i - m) % 2, m, i] = comb(i, m) * SIGNS[(i - m) % 4]
    return found.reshape(2 * n, n)
