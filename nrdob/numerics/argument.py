r"""The change in argument of :math:`\sum_i q_i(s)\,e^{-sT_i}` along the imaginary axis, certified.

It says how many roots are in the right half plane (Mikhailov): for one sum, or for many at once.
Where a single sum vanishes on the axis within rounding the path leaves the axis for a half circle
on the right, so that what lies on the axis counts as lying in the left half plane; of many sums
those that vanish are left open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from math import ceil, log2, nan, pi, sqrt
from typing import NamedTuple

import numpy as np

from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray, IntArray
from .stretches import (
    ZERO_FREE,
    Certified,
    ManyTerms,
    Stretches,
    Sums,
    binomial,
    certified,
    multiplied,
)

__all__ = [
    "ArgumentChange", "Term", "argument_change", "argument_changes", "frequency_range",
    "rhp_counts", "zero_free", "zero_free_frequencies",
]  # fmt: skip

MAX_SEGMENTS, MAX_STEPS = 400_000, 40_000  # stretches at most; if dominance is enough
TOGETHER, LEAST_STEPS = 250, 4000  # sums at once, and least limit of stretches of each
ARCS = 32  # discs that cover a half circle around a zero on the axis
FAR = 1e6  # longest dead time, and inverse of the shortest, whose powers are taken as they are
SERIES = 24  # coefficients of exp(-sT) for |s|T <= 1, behind which less than rounding is left


class Term(NamedTuple):
    """A polynomial behind a dead time.

    Attributes
    ----------
    q : array of float
        Coefficients in descending powers.
    delay : float
        In seconds.
    """

    q: FloatArray
    delay: float


@dataclass(frozen=True)
class ArgumentChange:
    """How much the argument changes from ω = 0 to infinity, in radians counterclockwise.

    Zeros on the axis are passed on their right; nan if one of them cannot be. `touched` are the
    frequencies at which the function vanishes within rounding, in rad/s; `origin_alone` tells
    whether no more zeros were passed at s = 0 than are known to be there.
    """

    angle: float
    touched: tuple[float, ...] = ()
    origin_alone: bool = True


def rhp_counts(terms: Sequence[ManyTerms], scale: FloatArray) -> IntArray:
    """Count the roots of many sums in the open right half plane.

    -1 stands where a root is on the axis within rounding, or steps would be too many.

    Parameters
    ----------
    terms : sequence of ManyTerms
        The first one without dead time and of the highest degree, its leading coefficient not 0.
    scale : (k, n) array of float
        For each power of s (descending) the size of what was summed to give the coefficients.

    Examples
    --------
    >>> q = np.array([[1.0, 1.0], [-1.0, 1.0], [4.0, 4.0]])        # s² - s + 4, s² + s + 4
    >>> rhp_counts([ManyTerms(q, np.zeros(1))], np.abs(q)).tolist()
    [2, 0]
    """
    roots = (len(scale) - 1) / 2 - _changes(terms, scale) / pi
    whole = np.round(roots)
    return np.where(np.abs(roots - whole) < 0.1, whole, -1).astype(int)


def argument_changes(sums: Sequence[tuple[Sequence[Term], FloatArray]]) -> FloatArray:
    """Follow the arguments of sums of as many terms each from ω = 0 to infinity at once.

    Of each are given its terms and their `scale`, as for `argument_change`. A change is nan where
    it has to be followed alone: with a root on the axis within rounding, say.
    """
    each, scales = zip(*sums, strict=True)
    terms = [
        ManyTerms(_beside([q for q, _ in some]), np.array([T for _, T in some]))
        for some in zip(*each, strict=True)
    ]
    return _changes(terms, _beside(scales))


def _beside(polynomials: Sequence[FloatArray]) -> FloatArray:
    """Put polynomials beside each other, each a column."""
    columns = np.zeros((max(p.size for p in polynomials), len(polynomials)))
    for k, p in enumerate(polynomials):
        columns[-p.size :, k] = p
    return columns


def _changes(terms: Sequence[ManyTerms], scale: FloatArray) -> FloatArray:
    """By how much the argument of each sum changes; nan where that is not certain."""
    changes = np.full(scale.shape[1], nan)
    low, high, certain = frequency_range(terms, scale)
    known = np.flatnonzero(certain)
    for few in np.array_split(known, ceil(known.size / TOGETHER)) if known.size else ():
        slowest, fastest = float(low[few].min()), float(high[few].max())
        sums = Sums.between([term.of(few) for term in terms], scale[:, few], slowest, fastest)
        limit = max(MAX_STEPS // few.size, LEAST_STEPS)
        with np.errstate(all="ignore"):  # what is not finite is not certain
            found = certified(sums, slowest, fastest, limit)
            for part in found.vanishing:
                found.given_up[part.column] = True
            changes[few] = np.where(found.given_up, nan, sums.changes(found.rounds))
    return changes


def frequency_range(
    terms: Sequence[ManyTerms], scale: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Frequencies below which the constant, and above which the leading term dominates, in rad/s.

    The lower one is 0 where the constant is only rounding; and whether both are more than that.

    Parameters
    ----------
    terms, scale : sequence of ManyTerms, (k, n) array of float
        As for `rhp_counts`.
    """
    sums = Sums(terms, scale, moderate=True)
    top, lead = len(scale) - 1 - sums.degree, np.abs(sums.lead)
    columns = np.arange(top.size)
    rising = np.zeros((len(scale) + 1, scale.shape[1]))  # ascending
    rising[:-1] = scale[::-1]
    for q, delay in terms[1:]:  # |exp(-jωT) - 1| <= ωT
        size = np.zeros_like(scale)
        size[-len(q) :] = np.abs(q)
        rising[1:] += size[::-1] * delay
        lead = lead - size[top, columns]
    constant = np.abs(sums.constant)
    with np.errstate(all="ignore"):
        low = 1 / _dominance_radius(rising / constant, np.zeros(1, dtype=int))
        high = _dominance_radius(scale / lead, top)
    low = np.where(constant > ROUNDING * scale[-1], low, 0.0)
    leads = lead > ROUNDING * scale[top, columns]
    certain = (low > 0) & leads & np.isfinite(scale).all(axis=0)
    return low, high, certain


def zero_free(
    terms: Sequence[ManyTerms], scale: FloatArray, centre: FloatArray, radius: FloatArray
) -> BoolArray:
    """Tell on which discs around j·centre a sum certainly has no zero.

    Parameters
    ----------
    terms, scale : sequence of ManyTerms, (k, ...) array of float
        As for `rhp_counts`; their columns broadcast with the discs.
    centre, radius : array of float
        In rad/s.
    """
    with np.errstate(all="ignore"):
        sums = Sums.between(terms, scale, float(centre.min()), float(centre.max()))
        if centre.ndim < scale.ndim - 1:
            centre, radius = centre[None], radius[None]
        return np.asarray(sums.examined(centre, radius)[0] == ZERO_FREE)


def argument_change(terms: Sequence[Term], scale: FloatArray, origin: int = 1) -> ArgumentChange:
    """Follow the argument of one sum from ω = 0 to infinity.

    The first term has no dead time and the highest degree, its leading coefficient larger than
    those of the others together; `scale` is as for `rhp_counts`, `origin` the multiplicity of the
    zero at s = 0, if there is one. An ArithmeticError if it would take over `MAX_STEPS` steps.
    """
    lead = terms[0].q
    degree = lead.size - 1
    if degree == 0:
        return ArgumentChange(0.0)
    if len(terms) == 1 and degree <= 2 and (angle := _of_low_degree(lead, scale)) is not None:
        return ArgumentChange(angle)
    with np.errstate(all="ignore"):
        zeros, legs, unit = _legs(terms, scale, origin)
        angle, touched = zeros * pi / 2, [0.0] * (zeros > 0)
        for leg in legs:
            sums = leg.sums()
            found = _certified(sums, leg.low, leg.high)
            if len(legs) == 1 and not found.vanishing:
                return ArgumentChange(float(sums.changes(found.rounds)[0]))
            if leg is legs[0]:
                angle += _angle(sums.constant, sums, leg.low)
            more, passed = _indented(sums, found, leg.high)
            angle, touched = angle + more, touched + passed
        angle -= _angle(sums.lead, sums, leg.high)
    return ArgumentChange(angle, tuple(w / unit for w in touched), zeros in (0, origin))


def zero_free_frequencies(terms: Sequence[Term], scale: FloatArray, origin: int = 1) -> FloatArray:
    """Frequencies of `nrdob.numerics.frequency_segments`.

    The argument may change by more around a zero on the axis, within rounding, and with a dominant
    term's dead time where over `MAX_SEGMENTS` frequencies would be needed.
    """
    if terms[0].q.size == 1:
        return np.zeros(1)
    with np.errstate(all="ignore"):
        _, legs, unit = _legs(terms, scale, origin)
        return np.unique(np.concatenate([np.zeros(1), *map(_segments, legs)])) / unit


class _Leg(NamedTuple):
    """A part of the axis, and the sum to follow there."""

    terms: Sequence[Term]
    scale: FloatArray
    low: float
    high: float

    def sums(self) -> Sums:
        return Sums.between(_columns(self.terms), self.scale[:, None], self.low, self.high)


def _legs(terms: Sequence[Term], scale: FloatArray, origin: int) -> tuple[int, list[_Leg], float]:
    """Give zeros at s = 0, the axis from there to where the leading term dominates, and its unit.

    A zero at s = 0, with all lower coefficients that are rounding, is divided out of the Taylor
    series, which stands for the sum on the first part.
    """
    low, high = _range_of_one(terms, scale)
    if low:
        return 0, [_Leg(terms, scale, low, high)], 1.0
    longest, unit = max(T for _, T in terms), 1.0
    if longest and not 1 / FAR < longest < FAR:  # so that the powers of a dead time do not overflow
        unit = 2.0 ** round(log2(longest))  # which changes no digit
        powers = (1 / unit) ** np.arange(scale.size - 1, -1, -1)
        terms, scale = [Term(q * powers[-q.size :], T / unit) for q, T in terms], scale * powers
        _, high = _range_of_one(terms, scale)
    count = origin + scale.size + SERIES
    c, sizes = np.zeros(count), np.zeros(count)
    sizes[: scale.size] = scale[::-1]
    for q, T in terms:
        series = np.cumprod(np.append(1.0, T / np.arange(1.0, count)))
        c += np.convolve(q[::-1], (-1.0) ** np.arange(count) * series)[:count]
        sizes += np.convolve(np.abs(q[::-1]), series)[:count] * (T > 0)
    zeros = origin + int(np.argmax(np.abs(c[origin:]) > ROUNDING * sizes[origin:]))
    radius = min([high, *(1 / T for _, T in terms if T)])
    size = np.trim_zeros(sizes[: zeros - 1 : -1], "f")
    rest = [Term(c[: zeros - 1 : -1][-size.size :], 0.0)]
    first, _ = _range_of_one(rest, size)
    near = _Leg(rest, size, min(first or radius, radius), radius)
    return zeros, [near, _Leg(terms, scale, radius, high)], unit


def _segments(leg: _Leg) -> FloatArray:
    """Return ends and middles of certified stretches; with a dominant term where there are many."""
    sums = leg.sums()
    found = certified(sums, leg.low, leg.high, MAX_SEGMENTS, dominance=False)
    if found.given_up[0]:
        found = _certified(sums, leg.low, leg.high)
    _, left, right, _ = Stretches.joined(found.rounds)
    return np.concatenate([[leg.low], left, (left + right) / 2, right])


def _certified(sums: Sums, low: float, high: float) -> Certified:
    found = certified(sums, low, high, MAX_STEPS)
    if found.given_up[0]:
        raise ArithmeticError(
            f"over {MAX_STEPS} frequencies would be needed to follow the argument: the "
            "dead time is too long for terms of so nearly equal size"
        )
    return found


def _columns(terms: Sequence[Term]) -> list[ManyTerms]:
    return [ManyTerms(q[:, None], np.array([delay])) for q, delay in terms]


def _range_of_one(terms: Sequence[Term], scale: FloatArray) -> tuple[float, float]:
    low, high, _ = frequency_range(_columns(terms), scale[:, None])
    return float(low[0]), float(high[0])


def _angle(base: FloatArray | ComplexArray, sums: Sums, omega: float) -> float:
    """Angle from a value to that of the one sum at jω."""
    value = sum(sums.values(np.array([omega])))
    return float(np.angle(value / base)[0])


def _of_low_degree(q: FloatArray, scale: FloatArray) -> float | None:
    """Change for degree 1 or 2, from where it crosses an axis; None with a root on the axis."""
    a, *middle, c = q.tolist()
    *sizes, size = scale.tolist()
    if abs(c) <= ROUNDING * size:
        return None
    if not middle:
        return pi / 2 if (a > 0) == (c > 0) else -pi / 2
    if (a > 0) != (c > 0):  # the real part keeps its sign
        return 0.0
    (b,), omega = middle, sqrt(c / a)  # here the value is imaginary
    if abs(b) * omega <= ROUNDING * ((sizes[0] * omega + sizes[1]) * omega + size):
        return None
    return pi if (b > 0) == (c > 0) else -pi


def _dominance_radius(ratios: FloatArray, top: IntArray) -> FloatArray:
    """Radius beyond which the term in row `top`, 1, exceeds the sum of those behind (Fujiwara)."""
    behind = np.arange(len(ratios))[:, None] - top
    powers = ratios ** (1 / np.maximum(behind, 1))
    return np.asarray(2.02 * np.max(powers, axis=0, initial=1e-300, where=behind > 0))


def _indented(sums: Sums, found: Certified, last: float) -> tuple[float, list[float]]:
    """Change where zeros are passed by half circles on the right, and the frequencies of these."""
    stretches, angle = Stretches.joined(found.rounds), 0.0
    passed = _half_circles(sums, found.vanishing)
    for low, high, around in passed:
        below = stretches._replace(right=np.minimum(stretches.right, low))
        above = stretches._replace(left=np.maximum(stretches.left, high))
        stretches = Stretches.joined(
            [part.where(part.left < part.right) for part in (below, above)]
        )
        angle += around if high < last else nan
    angle += float(sums.changes_over(stretches)[0])
    return angle, [(low + high) / 2 for low, high, _ in passed]


def _half_circles(sums: Sums, vanishing: list[Stretches]) -> list[tuple[float, float, float]]:
    """Half circles around zeros on the axis: low, high, change on the way."""
    ends = [np.stack([part.left, part.right], axis=1).tolist() for part in vanishing]
    passed: list[tuple[float, float, float]] = []
    for low, high in sorted(chain.from_iterable(ends)):
        if passed and high <= passed[-1][1]:
            continue
        a, b = low, high
        if passed and low <= passed[-1][1]:
            a = passed.pop()[0]
        centre, radius = (a + b) / 2, max((b - a) / 2, 1e-15 * b)
        while (angle := _on_half_circle(sums, centre, radius)) is None:
            radius *= 4
            if radius > 0.3 * centre:
                angle = nan
                break
            while passed and centre - radius <= passed[-1][1]:  # take in what was passed before
                a = passed.pop()[0]
                centre, radius = (a + centre + radius) / 2, (centre + radius - a) / 2
        passed.append((centre - radius, centre + radius, angle))
    return passed


def _on_half_circle(sums: Sums, centre: float, radius: float) -> float | None:
    """Change on the half circle on the right of j·centre; None where it is not certain."""
    steps = np.linspace(-pi / 2, pi / 2, ARCS + 1)
    ends = 1j * centre + radius * np.exp(1j * steps)
    middles = 1j * centre + radius * np.exp(1j * (steps[:-1] + steps[1:]) / 2)
    reach = radius * (steps[1] - steps[0]) / 2
    total, bound = np.zeros(ARCS, dtype=complex), np.zeros(ARCS)
    at_ends = np.zeros(ARCS + 1, dtype=complex)
    unit = max(centre, radius)
    in_unit = sums.powers(np.array([unit]))
    spread = reach / np.abs(middles)
    for q, delay in sums.terms:
        T, scaled = float(delay[0]), q[::-1] * in_unit[: len(q)]
        taylor = binomial(len(q)).T @ (scaled * multiplied(middles / unit, len(q)))
        value, rest = taylor[0], np.zeros(ARCS)
        for size in np.abs(taylor[:0:-1]):
            rest = (rest + size) * spread
        lag = np.exp(-T * middles)
        growth = float(np.expm1(min(T * reach, 700.0)))
        total += value * lag
        bound += np.abs(lag) * (rest * (1 + growth) + np.abs(value) * growth)
        at_ends += np.polyval(scaled[::-1], ends / unit) * np.exp(-T * ends)
    noise = ROUNDING * np.polyval((sums.scale[::-1] * in_unit)[::-1], np.abs(middles) / unit)
    if not np.all(np.abs(total) > bound + 4 * noise):
        return None
    return float(np.angle(at_ends[1:] / at_ends[:-1]).sum())
