r"""Roots on the right counted for many sums :math:`\sum_i q_i(s)\,e^{-sT_i}` at once, certified.

What `nrdob.numerics.argument` does for one: the argument is followed along the imaginary axis from
one frequency to the next where a Taylor bound proves that it turns by less than half a revolution,
or that one term is larger than all others together, so that its own dead time says how far.
All begin on the same frequencies; where that is not enough for one of them, its own are halved.
Nothing is said of a sum that vanishes on the axis within rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

import numpy as np

from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray, IntArray
from .manypolynomials import sizes_on_axis, taylor_on_axis, values_on_axis

__all__ = ["ManyTerms", "frequency_range", "rhp_counts", "zero_free"]

SLACK = 1.05
"""By how much a value must exceed its Taylor bound, so that no zero hides at the end of a step."""

PER_OCTAVE, AT_MOST = 6, 600
"""Stretches of an octave to begin with, and stretches in all."""

HALVINGS, LARGEST = 40, 2_000_000
"""How often a stretch is halved, and how many are looked at together."""

FREE, OPEN = -1, -2
"""Marks of a stretch of the axis: the sum has no zero there; it may have one."""


class ManyTerms(NamedTuple):
    """Terms of many sums: coefficients (k, n) in descending powers, and dead times (n,) or (1,).

    Attributes
    ----------
    q : (k, n) array of float
        Coefficients.
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
            Which.
        """
        delay = self.delay[chosen] if self.delay.size > 1 else self.delay
        return ManyTerms(self.q[:, chosen] if self.q.shape[1] > 1 else self.q, delay)

    def across(self) -> ManyTerms:
        """Add an axis for frequencies."""
        return ManyTerms(self.q[:, :, None], self.delay[:, None])


def rhp_counts(terms: Sequence[ManyTerms], scale: FloatArray) -> IntArray:
    """Count the roots in the open right half plane.

    Parameters
    ----------
    terms : sequence of ManyTerms
        The first one without dead time and of the highest degree, its leading coefficient not 0.
    scale : (k, n) array of float
        For each power of s (descending) the size of what was summed to give the coefficients.

    Returns
    -------
    (n,) array of int
        The counts; -1 where a root is on the axis within rounding, or steps would be too many.

    Examples
    --------
    >>> q = np.array([[1.0, 1.0], [-1.0, 1.0], [4.0, 4.0]])        # s² - s + 4, s² + s + 4
    >>> rhp_counts([ManyTerms(q, np.zeros(1))], np.abs(q)).tolist()
    [2, 0]
    """
    with np.errstate(all="ignore"):  # what is not finite is not certain
        low, high, certain = frequency_range(terms, scale)
        counts = np.full(scale.shape[1], -1)
        known = np.flatnonzero(certain)
        if known.size:
            of = [term.of(known) for term in terms]
            turns = _turns(of, scale[:, known], low[known].min(), high[known].max())
            whole = np.round(turns)
            counts[known] = np.where(np.abs(turns - whole) < 0.1, whole, -1)
    return counts


def frequency_range(
    terms: Sequence[ManyTerms], scale: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Frequencies below which the constant, and above which the leading term dominates.

    Parameters
    ----------
    terms : sequence of ManyTerms
        As for `rhp_counts`.
    scale : (k, n) array of float
        As for `rhp_counts`.

    Returns
    -------
    low, high : (n,) array of float
        In rad/s.
    certain : (n,) array of bool
        Whether constant and leading coefficients are more than rounding.
    """
    lead = np.abs(terms[0].q[0])
    degree = scale.shape[0] - 1
    for q, _ in terms[1:]:
        if q.shape[0] == degree + 1:
            lead = lead - np.abs(q[0])
    constant = np.abs(sum(term.q[-1] for term in terms))
    certain = (lead > ROUNDING * scale[0]) & (constant > ROUNDING * scale[-1])
    certain &= np.isfinite(scale).all(axis=0)
    rising = np.zeros((degree + 2, scale.shape[1]))  # ascending
    rising[: degree + 1] = scale[::-1]
    for q, delay in terms:  # |exp(-jωT) - 1| <= ωT
        rising[1 : q.shape[0] + 1] += np.abs(q[::-1]) * delay
    return 1 / _beyond(rising[1:] / constant), _beyond(scale[1:] / lead), certain


def _beyond(ratios: FloatArray) -> FloatArray:
    """Radius beyond which the leading term, 1, dominates the others (Fujiwara's bound)."""
    powers = 1 / np.arange(1, ratios.shape[0] + 1)[:, None]
    return np.asarray(2.02 * np.max(ratios**powers, axis=0, initial=1e-300))


def _turns(terms: Sequence[ManyTerms], scale: FloatArray, low: float, high: float) -> FloatArray:
    """Roots on the right as the turn of the argument tells, nan where that cannot be followed."""
    n, degree = scale.shape[1], scale.shape[0] - 1
    stretches = int(min(max(PER_OCTAVE * np.log2(high / low), 1), AT_MOST))
    edges = np.geomspace(low, high, stretches + 1)
    across = [term.across() for term in terms]
    left, right = edges[:-1], edges[1:]
    mark, lost = _examine(across, scale[:, :, None], (left + right) / 2, (right - left) / 2)
    total = _summed(across, edges)
    # From 0 to the first frequency, and beyond the last one, constant and leading term dominate.
    first = total[:, 0] / sum(term.q[-1] for term in terms)
    last = terms[0].q[0] * 1j**degree / total[:, -1]
    angle = np.angle(first) + np.angle(last)
    steps = np.angle(total[:, 1:] / total[:, :-1])
    angle += np.where(mark == FREE, steps, 0.0).sum(axis=1)
    led, where = np.nonzero(mark >= 0)
    if led.size:
        of = [term.of(led) for term in terms]
        turned = _led(of, mark[led, where], left[where], right[where])
        angle += np.bincount(led, turned, n)
    angle[lost.any(axis=1)] = np.nan
    member, where = np.nonzero(mark == OPEN)
    left, right = left[where], right[where]
    for _ in range(HALVINGS):
        hopeless = np.isnan(angle[member])
        member, left, right = (column[~hopeless] for column in (member, left, right))
        if not member.size or member.size > LARGEST:
            break
        middle = (left + right) / 2
        member = np.concatenate([member, member])
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
        of, size = [term.of(member) for term in terms], scale[:, member]
        mark, lost = _examine(of, size, (left + right) / 2, (right - left) / 2)
        angle[member[lost]] = np.nan
        free = mark == FREE
        for kind, turned_by in ((free, _free), (mark >= 0, _led)):
            chosen = np.flatnonzero(kind)
            few = [term.of(chosen) for term in of]
            turned = turned_by(few, mark[chosen], left[chosen], right[chosen])
            angle += np.bincount(member[chosen], turned, n)
        unsure = mark == OPEN
        member, left, right = member[unsure], left[unsure], right[unsure]
    angle[member] = np.nan
    return np.asarray(degree / 2 - angle / pi)


def zero_free(
    terms: Sequence[ManyTerms], scale: FloatArray, centre: FloatArray, radius: FloatArray
) -> BoolArray:
    """Tell on which discs around j·centre a sum certainly has no zero.

    Parameters
    ----------
    terms : sequence of ManyTerms
        As for `rhp_counts`; their columns broadcast with the discs.
    scale : (k, ...) array of float
        As for `rhp_counts`.
    centre, radius : array of float
        Of the discs, in rad/s.

    Returns
    -------
    array of bool
        For each disc.
    """
    value, bound, noise, _, _ = _bounds(terms, scale, centre, radius)
    return np.asarray(value > SLACK * bound + noise)


def _examine(
    terms: Sequence[ManyTerms], scale: FloatArray, centre: FloatArray, radius: FloatArray
) -> tuple[IntArray, BoolArray]:
    """Say for discs around j·centre what certifies them; flag centres where the sum is rounding."""
    total, bound, noise, sizes, rests = _bounds(terms, scale, centre, radius)
    mark = np.where(total > SLACK * bound + noise, FREE, OPEN)
    if len(terms) > 1:
        everything = sum(size + rest for size, rest in zip(sizes, rests, strict=True))
        for i, (size, rest) in enumerate(zip(sizes, rests, strict=True)):
            # size - rest > what the others can be; a free stretch needs no leader
            mark[(size - rest > everything - size - rest + noise) & (mark == OPEN)] = i
    return mark, (mark == OPEN) & (total <= noise)


def _bounds(
    terms: Sequence[ManyTerms], scale: FloatArray, centre: FloatArray, radius: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, list[FloatArray], list[FloatArray]]:
    """Size at the centres, how far it is from that on the discs, rounding; size and rest by term.

    Taylor: |q(s) - q(c)| <= sum |q^(m)(c)|/m! radius^m over the disc.
    """
    values, rests, sizes = [], [], []
    for q, delay in terms:
        value, rest = taylor_on_axis(q, centre, radius)
        values.append(value * np.exp(-1j * delay * centre) if delay.any() else value)
        rests.append(rest)
        sizes.append(np.abs(value))
    total = np.abs(sum(values[1:], start=values[0])) if len(terms) > 1 else sizes[0]
    bound = sum(rests[1:], start=rests[0])
    for (_, delay), size in zip(terms[1:], sizes[1:], strict=True):
        bound = bound + size * np.minimum(2.0, delay * radius)
    return total, bound, ROUNDING * sizes_on_axis(scale, centre), sizes, rests


def _values(term: ManyTerms, omega: FloatArray) -> ComplexArray:
    value = values_on_axis(term.q, omega)
    return value * np.exp(-1j * term.delay * omega) if term.delay.any() else value


def _summed(terms: Sequence[ManyTerms], omega: FloatArray) -> ComplexArray:
    return np.asarray(sum(_values(term, omega) for term in terms))


def _free(
    terms: Sequence[ManyTerms], mark: IntArray, left: FloatArray, right: FloatArray
) -> FloatArray:
    """Turn of sums over stretches where they have no zero."""
    before, after = (_summed(terms, omega) for omega in (left, right))
    return np.asarray(np.angle(after / before))


def _led(
    terms: Sequence[ManyTerms], mark: IntArray, left: FloatArray, right: FloatArray
) -> FloatArray:
    """Turn of sums over stretches where one term dominates."""
    values = [[_values(term, omega) for term in terms] for omega in (left, right)]
    before, after = (_summed(terms, omega) for omega in (left, right))
    turned = np.zeros(left.size)
    for i, term in enumerate(terms):
        on = np.flatnonzero(mark == i)
        if on.size:
            a, b = values[0][i][on], values[1][i][on]
            delay = np.broadcast_to(term.delay, left.shape)[on]
            # The term itself without its dead time, the dead time, and the angles from the term
            # to the sum at both ends.
            waits = np.exp(1j * delay * right[on]) / np.exp(1j * delay * left[on])
            turned[on] = np.angle(b * waits / a) - delay * (right[on] - left[on])
            turned[on] += np.angle(after[on] / b) - np.angle(before[on] / a)
    return turned
