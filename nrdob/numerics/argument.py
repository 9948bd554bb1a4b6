r"""The argument of :math:`\sum_i q_i(s)\,e^{-sT_i}` followed along the imaginary axis, certified.

From one frequency to the next the argument is known where a Taylor bound proves one of two things
on the disc over the step:

- the sum has no zero there, so that it turns by less than half a revolution;
- one term is larger than all others together. Then the argument stays within a quarter of a
  revolution of that term's, whose dead time turns it by exactly T times the step.

A dead time therefore costs small steps only where two terms are of equal size: their number
grows with the logarithm of T. Where the sum vanishes on the axis within rounding the path leaves
it for a half circle on the right, so that what lies on the axis counts as lying on the left.
"""

from __future__ import annotations

from cmath import exp, phase
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, comb, inf, log2, nan, pi, sqrt
from typing import NamedTuple

import numpy as np

from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray
from .rootfinding import dominance_radius

__all__ = ["Term", "Turn", "turn", "zero_free_frequencies"]

MAX_SEGMENTS = 400_000
"""Stretches of the axis at most where every turn is to be followed."""

MAX_STEPS = 40_000
"""Stretches at most where a dominant term is enough."""

PER_OCTAVE = 6
"""Stretches of an octave to begin with: many at once take less time than many rounds."""

SLACK = 1.05
"""By how much a value must exceed its Taylor bound, so that no zero hides at the end of a step."""

ARCS = 32
"""Discs that cover a half circle around a zero on the axis."""


SERIES = 24
"""Coefficients of exp(-sT) for |s|T <= 1, behind which less than rounding is left."""

MODERATE = 300
"""Exponents of two: below 2^this, coefficients are multiplied by powers below 2^twice this."""

FREE, OPEN = -1, -2
"""Marks of a stretch of the axis: the sum has no zero there; it may have one."""


class Term(NamedTuple):
    """A polynomial behind a dead time.

    Attributes
    ----------
    q : array of float
        Coefficients of the polynomial, in descending powers.
    delay : float
        Dead time in seconds.
    """

    q: FloatArray
    delay: float


@dataclass(frozen=True)
class Turn:
    """How far the argument turns from ω = 0 to infinity.

    Attributes
    ----------
    angle : float
        In radians, counterclockwise positive, zeros on the axis passed on their right; nan if
        one of them cannot be passed.
    touched : tuple of float
        Frequencies at which the function vanishes within rounding, in rad/s.
    origin_alone : bool
        Whether no more zeros were passed at s = 0 than are known to be there.
    """

    angle: float
    touched: tuple[float, ...] = ()
    origin_alone: bool = True


class _Stretches(NamedTuple):
    """Certified stretches of the axis: the number of the dominant term, or `FREE`."""

    left: FloatArray
    right: FloatArray
    term: FloatArray

    def outside(self, low: float, high: float) -> _Stretches:
        """Cut out what lies between two frequencies."""
        below = _Stretches(self.left, np.minimum(self.right, low), self.term)
        above = _Stretches(np.maximum(self.left, high), self.right, self.term)
        both = _Stretches(*map(np.concatenate, zip(below, above, strict=True)))
        kept = both.left < both.right
        return _Stretches(*(column[kept] for column in both))


def turn(terms: Sequence[Term], scale: FloatArray, origin: int = 1) -> Turn:
    """Follow the argument from ω = 0 to infinity.

    Parameters
    ----------
    terms : sequence of Term
        The first one without dead time and of the highest degree, its leading coefficient larger
        than those of the others together.
    scale : array of float
        For each power of s (descending) the size of what was summed to give the coefficients.
    origin : int
        Multiplicity of the zero at s = 0, if there is one.

    Raises
    ------
    ArithmeticError
        If more than `MAX_STEPS` steps would be needed.

    Examples
    --------
    >>> q = np.array([1.0, -1.0, 4.0])                       # two roots on the right
    >>> bool(np.isclose(turn([Term(q, 0.0)], np.abs(q)).angle, -np.pi))
    True
    """
    lead = terms[0].q
    degree = lead.size - 1
    if degree == 0:
        return Turn(0.0)
    if len(terms) == 1 and degree <= 2 and (angle := _short(lead, scale)) is not None:
        return Turn(angle)
    low, high = _range(terms, scale)
    touched: list[float] = []
    angle, alone = 0.0, True
    if low is None:
        touched.append(0.0)
        near = _near_origin(terms, scale, high, origin)
        alone = near is not None
        if near is None:
            low, angle = _pass_origin(terms, scale, high)
        else:
            low, angle = near.radius, origin * pi / 2
            slowest = _range([near.rest], near.scale)[0] or low
            more, passed = _followed([near.rest], near.scale, min(slowest, low), low)
            angle, touched = angle + more, touched + passed
    more, passed = _followed(terms, scale, low, high, from_zero=not touched)
    # Beyond the last frequency the leading term keeps the sum in an open half plane around it.
    more -= phase(_against_lead(terms, high))
    return Turn(angle + more, (*touched, *passed), alone)


def _against_lead(terms: Sequence[Term], omega: float) -> complex:
    """Value of the sum at jω, divided by that of its leading term."""
    x, lead = -1j / omega, terms[0].q
    total = 0j
    for q, delay in terms:
        value = 0j
        for coefficient in (q[::-1] / lead[0]).tolist():
            value = value * x + coefficient
        total += value * x ** (lead.size - q.size) * exp(-1j * delay * omega)
    return total


def _followed(
    terms: Sequence[Term], scale: FloatArray, low: float, high: float, *, from_zero: bool = True
) -> tuple[float, list[float]]:
    """Follow the argument to a frequency, and say what is touched on the way.

    From 0 on, where the constant term dominates up to the frequency `low`, or from there.
    """
    stretches, holes = _certified(terms, scale, low, high, dominance=True)
    if from_zero:
        first = _Stretches(np.zeros(1), np.array([low]), np.array([FREE]))
        stretches = _Stretches(*map(np.concatenate, zip(first, stretches, strict=True)))
    angle, touched = 0.0, []
    for a, b, around in _passed(terms, scale, holes):
        stretches = stretches.outside(a, b)
        angle += around if b < high else nan
        touched.append((a + b) / 2)
    return angle + _angles(terms, scale, stretches), touched


def zero_free_frequencies(terms: Sequence[Term], scale: FloatArray, origin: int = 1) -> FloatArray:
    """Frequencies between which the sum provably turns by less than half a revolution.

    Around a zero on the axis, within rounding, a stretch is left in which it may. If the dead time
    is so long that more than `MAX_SEGMENTS` frequencies would be needed, there are stretches, too,
    in which it turns with a dominant term's dead time, any number of times.

    Parameters
    ----------
    terms, scale, origin
        As for `turn`.

    Returns
    -------
    array of float
        Increasing, in rad/s, from 0 to where the leading term dominates.
    """
    if terms[0].q.size == 1:
        return np.zeros(1)
    low, high = _range(terms, scale)
    near = _near_origin(terms, scale, high, origin) if low is None else None
    first: FloatArray = np.zeros(1)
    if near is not None:
        low = near.radius
        first = zero_free_frequencies([near.rest], near.scale)
        first = first[first < low]
    low = low or 1e-12 * high
    try:
        (left, right, _), _ = _certified(terms, scale, low, high, dominance=False)
    except ArithmeticError:
        (left, right, _), _ = _certified(terms, scale, low, high, dominance=True)
    return np.unique(np.concatenate([first, [low], left, (left + right) / 2, right]))


def _short(q: FloatArray, scale: FloatArray) -> float | None:
    """Turn of a polynomial of degree 1 or 2, which is seen from where it crosses an axis.

    None where a root is on the axis within rounding.
    """
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


def _range(terms: Sequence[Term], scale: FloatArray) -> tuple[float | None, float]:
    """Frequencies below and above which the constant and the leading term dominate.

    The lower one is None if the constant term is only rounding.
    """
    lead = terms[0].q
    rivals = sum(abs(t.q[0]) for t in terms[1:] if t.q.size == lead.size)
    high = dominance_radius(scale[::-1] / (abs(lead[0]) - rivals))
    constant = abs(float(sum(term.q[-1] for term in terms)))
    if constant <= ROUNDING * scale[-1]:
        return None, high
    descending = np.append(0.0, scale)
    for q, delay in terms:  # |exp(-jωT) - 1| <= ωT
        if delay:
            descending[-1 - q.size : -1] += np.abs(q) * delay
    descending[-1] = constant
    return 1 / dominance_radius(descending[np.argmax(descending > 0) :] / constant), high


def _certified(
    terms: Sequence[Term], scale: FloatArray, low: float, high: float, *, dominance: bool
) -> tuple[_Stretches, FloatArray]:
    """Cut the axis between two frequencies into certified stretches; the rest are the holes."""
    span = max(high / low, 1.0)
    per_octave = PER_OCTAVE if dominance else 1
    count = ceil(min(max(per_octave * log2(span), 1), 2000))
    todo = low * span ** (np.arange(count + 1) / count)
    todo[-1] = high
    left, right = todo[:-1], todo[1:]
    limit = MAX_STEPS if dominance else MAX_SEGMENTS
    done: list[_Stretches] = []
    holes: list[FloatArray] = [np.zeros((0, 2))]
    steps = left.size
    while left.size:
        middle = (left + right) / 2
        term, vanishing = _examine(terms, scale, middle, (right - left) / 2, dominance)
        if dominance and len(terms) > 1 and (unsure := term == OPEN).any():
            term[unsure] = _leader(terms, scale, left[unsure], right[unsure])
        unknown = term == OPEN
        if not unknown.any():
            done.append(_Stretches(left, right, term))
            break
        vanishing = unknown & (vanishing | (middle <= left) | (middle >= right))
        done.append(_Stretches(left[~unknown], right[~unknown], term[~unknown]))
        holes.append(np.stack([left[vanishing], right[vanishing]], axis=1))
        more = unknown & ~vanishing
        left, middle, right = left[more], middle[more], right[more]
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
        steps += left.size
        if steps > limit:
            raise ArithmeticError(
                f"over {limit} frequencies would be needed to follow the argument: the "
                "dead time is too long for terms of so nearly equal size"
            )
    whole = done[0] if len(done) == 1 else _Stretches(*map(np.concatenate, zip(*done, strict=True)))
    return whole, np.concatenate(holes)


def _examine(
    terms: Sequence[Term],
    scale: FloatArray,
    centre: FloatArray,
    radius: FloatArray,
    dominance: bool,
) -> tuple[FloatArray, BoolArray]:
    """Say for discs around j·centre what certifies them; flag centres where the sum is rounding.

    Taylor: |q(s) - q(c)| <= sum |q^(m)(c)|/m! radius^m over the disc.
    """
    powers = _powers(scale, centre)
    spread = _multiplied(radius / centre, scale.size)
    noise = ROUNDING * (powers @ scale[::-1])
    found = [_taylor_sums(term.q, powers, spread) for term in terms]
    if len(terms) == 1:
        (value, rest), turns = found[0], terms[0].delay * radius
        size = np.abs(value)
        bound = rest + size * np.minimum(2.0, turns) if terms[0].delay else rest
        result = np.where(size > SLACK * bound + noise, FREE, OPEN)
        return result, (result == OPEN) & (size <= noise)
    sizes = [np.abs(value) for value, _ in found]
    total = np.zeros(centre.size, dtype=complex)
    bound = np.zeros(centre.size)
    for (_, delay), (value, rest), size in zip(terms, found, sizes, strict=True):
        total += value * np.exp(-1j * delay * centre) if delay else value
        bound += rest + (size * np.minimum(2.0, delay * radius) if delay else 0.0)
    result = np.where(np.abs(total) > SLACK * bound + noise, FREE, OPEN)
    if dominance and len(terms) > 1:
        everything = sum(size + rest for size, (_, rest) in zip(sizes, found, strict=True))
        for i, (size, (_, rest)) in enumerate(zip(sizes, found, strict=True)):
            # size - rest > what the others can be
            result[size - rest > everything - size - rest + noise] = i
    return result, (result == OPEN) & (np.abs(total) <= noise)


def _leader(
    terms: Sequence[Term], scale: FloatArray, left: FloatArray, right: FloatArray
) -> FloatArray:
    """Find the term that is certainly larger than all others on each stretch, or `OPEN`.

    For terms of nearly equal size over a long stretch: the difference of their squares is bounded,
    not each. The sum of n - 1 squares is at least the square of the sum divided by n - 1. Each
    stretch has its own unit of frequency and of size, so that no square leaves the range.
    """
    ratio = right / left
    omega = left * np.sqrt((1 + ratio**2) / 2)
    spread = _multiplied((ratio**2 - 1) / (ratio**2 + 1), scale.size)
    exponents = np.log(omega)[:, None] * np.arange(scale.size) - _log_unit(scale, omega)
    local = np.zeros((len(terms), *exponents.shape))
    with np.errstate(divide="ignore"):
        for row, (q, _) in zip(local, terms, strict=True):
            n = q.size
            row[:, :n] = np.exp(exponents[:, :n] + np.log(np.abs(q[::-1]))) * np.sign(q[::-1])
        sizes = np.exp(exponents + np.log(scale[::-1])).sum(axis=1)
    squares = [_squared_sizes(row) for row in local]
    result = np.full(omega.size, OPEN)
    for i, square in enumerate(squares):
        lead = square - (len(terms) - 1) * (sum(squares) - square)
        taylor = lead @ _binomial(scale.size)
        rest = (np.abs(taylor[:, 1:]) * spread[:, 1:]).sum(axis=1)
        result[taylor[:, 0] - rest > ROUNDING * sizes**2] = i
    return result


def _squared_sizes(ascending: FloatArray) -> FloatArray:
    """|q(jω)|² in ascending powers of ω², for polynomials in rows."""
    squares = np.zeros_like(ascending)
    for first in (0, 1):
        part = ascending[:, first::2] * (-1.0) ** np.arange(ascending[0, first::2].size)
        for k in range(part.shape[1]):
            squares[:, first + k : first + k + part.shape[1]] += part[:, k : k + 1] * part
    return squares


def _angles(terms: Sequence[Term], scale: FloatArray, stretches: _Stretches) -> float:
    """Sum of what the argument turns over certified stretches."""
    left, right, mark = stretches
    joined = bool((left[1:] == right[:-1]).all())  # then every edge is looked at once
    edges = np.append(left, right[-1:]) if joined else np.concatenate([left, right])
    origin = edges == 0
    values = _values(terms, scale, np.where(origin, 1.0, edges))
    values[:, origin] = np.array([[term.q[-1]] for term in terms])
    n, second = left.size, 1 if joined else left.size
    sums = values.sum(axis=0)
    before, after = sums[:n], sums[second:]
    free = mark == FREE
    if free.all():
        return float(np.angle(after / before).sum())
    angle = float(np.angle(after[free] / before[free]).sum())
    for i, (_, delay) in enumerate(terms):
        on = mark == i
        if on.any():
            a, b = values[i, :n][on], values[i, second:][on]
            # The term itself without its dead time, the dead time, and the angles from the term
            # to the sum at both ends.
            waits = np.exp(1j * delay * right[on]) / np.exp(1j * delay * left[on])
            angle += float(np.angle(b * waits / a).sum() - delay * (right[on] - left[on]).sum())
            angle += float((np.angle(after[on] / b) - np.angle(before[on] / a)).sum())
    return angle


def _values(terms: Sequence[Term], scale: FloatArray, omega: FloatArray) -> ComplexArray:
    """Each term at jω > 0, up to a positive factor that differs from one frequency to the next."""
    powers = _powers(scale, omega) * _units(scale.size)
    rows = [powers[:, : q.size] @ q[::-1] for q, _ in terms]
    for row, (_, delay) in zip(rows, terms, strict=True):
        if delay:
            row *= np.exp(-1j * delay * omega)
    return np.array(rows)


def _passed(
    terms: Sequence[Term], scale: FloatArray, holes: FloatArray
) -> list[tuple[float, float, float]]:
    """Pass the holes by half circles on the right: low, high, angle turned on the way."""
    passed: list[tuple[float, float, float]] = []
    for low, high in sorted(holes.tolist()):
        if passed and high <= passed[-1][1]:
            continue
        a, b = low, high
        if passed and low <= passed[-1][1]:
            a = passed.pop()[0]
        centre, radius = (a + b) / 2, max((b - a) / 2, 1e-15 * b)
        while (angle := _round(terms, scale, centre, radius, -pi / 2)) is None:
            radius *= 4
            if radius > 0.3 * centre:
                angle = nan
                break
            while passed and centre - radius <= passed[-1][1]:  # take in what was passed before
                a = passed.pop()[0]
                centre, radius = (a + centre + radius) / 2, (centre + radius - a) / 2
        passed.append((centre - radius, centre + radius, angle))
    return passed


class _Near(NamedTuple):
    """A sum near its zero at s = 0: this polynomial times s^m within the radius."""

    rest: Term
    scale: FloatArray
    radius: float


def _near_origin(
    terms: Sequence[Term], scale: FloatArray, high: float, multiplicity: int
) -> _Near | None:
    """Divide a zero at s = 0 out of the Taylor series; None if it is of higher multiplicity.

    Where no dead time turns by more than one radian, so many coefficients are the sum itself.
    """
    count = multiplicity + scale.size + SERIES
    c, sizes = np.zeros(count), np.zeros(count)
    sizes[: scale.size] = scale[::-1]
    for q, T in terms:
        ascending = q[::-1]
        series = np.cumprod(np.append(1.0, T / np.arange(1.0, count)))
        signs = (-1.0) ** np.arange(count)
        c += np.convolve(ascending, signs * series)[:count]
        sizes += np.convolve(np.abs(ascending), series)[:count] * (T > 0)
    c, sizes = c[multiplicity:], sizes[multiplicity:]
    if abs(c[0]) <= ROUNDING * sizes[0]:
        return None
    radius = min([high, *(1 / T for _, T in terms if T)])
    return _Near(Term(np.trim_zeros(c[::-1], "f"), 0.0), sizes[::-1], radius)


def _pass_origin(terms: Sequence[Term], scale: FloatArray, high: float) -> tuple[float, float]:
    """Pass s = 0 by a quarter circle: its radius, and the angle turned on the way."""
    speeds = [high, 1 / dominance_radius(scale / scale[-1])]
    radius = 1e-15 * min([*speeds, *(1 / delay for _, delay in terms if delay)])
    while (angle := _round(terms, scale, 0.0, radius, 0.0)) is None:
        radius *= 4
        if radius > high:
            return high / 2, nan
    return radius, angle


def _round(
    terms: Sequence[Term], scale: FloatArray, centre: float, radius: float, start: float
) -> float | None:
    """Angle turned on the arc from `start` to a right angle; None where it is not certain."""
    steps = np.linspace(start, pi / 2, ARCS + 1)
    ends = 1j * centre + radius * np.exp(1j * steps)
    middles = 1j * centre + radius * np.exp(1j * (steps[:-1] + steps[1:]) / 2)
    reach = radius * (steps[1] - steps[0]) / 2
    total, bound = np.zeros(ARCS, dtype=complex), np.zeros(ARCS)
    at_ends = np.zeros(ARCS + 1, dtype=complex)
    unit = max(centre, radius)
    powers = _powers(scale, np.array([unit]))[0, ::-1]
    for q, delay in terms:
        scaled = q * powers[-q.size :]
        value, rest = _taylor_at(scaled, middles / unit, reach / unit)
        lag = np.exp(-delay * middles)
        growth = float(np.expm1(min(delay * reach, 700.0)))
        total += value * lag
        bound += np.abs(lag) * (rest * (1 + growth) + np.abs(value) * growth)
        at_ends += np.polyval(scaled, ends / unit) * np.exp(-delay * ends)
    noise = ROUNDING * np.polyval(scale * powers, np.abs(middles) / unit)
    if not np.all(np.abs(total) > bound + 4 * noise):
        return None
    return float(np.angle(at_ends[1:] / at_ends[:-1]).sum())


def _taylor_at(q: FloatArray, s: ComplexArray, radius: float) -> tuple[ComplexArray, FloatArray]:
    """Values at s and bounds of how far q can be from them within `radius`."""
    rows = [np.full(s.shape, complex(c)) for c in q]
    n = q.size
    taylor = []
    for m in range(n):  # repeated synthetic division
        for i in range(1, n - m):
            rows[i] = rows[i] + s * rows[i - 1]
        taylor.append(rows[n - m - 1])
    rest = sum((np.abs(t) * radius**m for m, t in enumerate(taylor[1:], 1)), np.zeros(s.shape))
    return taylor[0], rest


def _powers(scale: FloatArray, omega: FloatArray) -> FloatArray:
    """Powers 0, 1, 2, … of each frequency along axis 1, up to a factor for each row.

    Where they might leave the floating-point range (the roots of a very fast filter, 1e30 rad/s
    and more) they are given in a unit in which no term exceeds 1. What is asked of a row does not
    depend on it.
    """
    if _moderate(scale, omega):
        return _multiplied(omega, scale.size)
    exponents = np.log(omega)[:, None] * np.arange(scale.size) - _log_unit(scale, omega)
    return np.exp(np.where(scale[::-1] > 0, exponents, -inf))


def _multiplied(x: FloatArray, count: int) -> FloatArray:
    """Powers 0, 1, 2, … of each number along axis 1."""
    powers = np.ones((x.size, count))
    powers[:, 1:] = x[:, None]
    return np.multiply.accumulate(powers, axis=1, out=powers)


def _moderate(scale: FloatArray, omega: FloatArray) -> bool:
    """Whether powers and terms stay so far within the floating-point range that no unit is needed.

    Coefficients 0 are never seen against the others.
    """
    sizes = [size for size in scale.tolist() if size]
    speed = max(float(omega.max(initial=1.0)), 1 / float(omega.min(initial=1.0)))
    return (
        len(scale) * log2(speed) < 2 * MODERATE
        and max(sizes) < 2.0**MODERATE
        and min(sizes) > 2.0**-MODERATE
    )


def _log_unit(scale: FloatArray, omega: FloatArray) -> FloatArray:
    """Logarithm of the largest term of `scale` at each frequency, as a column."""
    with np.errstate(divide="ignore"):
        sizes = np.log(scale[::-1])
    return np.asarray(
        np.max(np.log(omega)[:, None] * np.arange(scale.size) + sizes, axis=1, keepdims=True)
    )


def _taylor_sums(
    coefficients: FloatArray, powers: FloatArray, spread: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Value at jc and the sum of the higher Taylor terms' sizes for |s - jc| = spread·c.

    Both c and spread are given by their powers 0, 1, 2, … along axis 1.
    """
    n = coefficients.size
    taylor = (powers[:, :n] * coefficients[::-1]) @ _turned_binomial(n)
    return taylor[:, 0], (np.abs(taylor[:, 1:]) * spread[:, 1:n]).sum(axis=1)


@lru_cache(maxsize=64)
def _binomial(n: int) -> FloatArray:
    """Binomial coefficients C(i, m), row i, column m."""
    return np.array([[float(comb(i, m)) for m in range(n)] for i in range(n)])


@lru_cache(maxsize=64)
def _turned_binomial(n: int) -> ComplexArray:
    return np.asarray(_units(n)[:, None] * _binomial(n))


@lru_cache(maxsize=64)
def _units(count: int) -> ComplexArray:
    return np.array([(1, 1j, -1, -1j)[i % 4] for i in range(count)])
