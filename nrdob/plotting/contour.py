r"""The Nyquist curve as it is drawn: smooth, complete, closed where it runs off to infinity.

Frequencies come from `nrdob.analysis.frequencies`, so that no resonance is missed, and are halved
until the polygon through them is as smooth as the eye can tell. Near a pole on the axis and at
infinity of an improper loop the curve leaves every window: it is cut at a finite `radius` and
closed there by an arc with as many half turns as the pole's order demands.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from math import inf, nan, pi
from typing import NamedTuple

import numpy as np

from ..analysis import on_axis, resolved_frequencies, subdivided
from ..diagram import Quotient
from ..numerics import BoolArray, ComplexArray, FloatArray, QuasiPolynomial, golden, runs

__all__ = ["Approach", "Contour", "closest_approach", "contour"]

SMOOTH = 1e-3  # largest distance between curve and polygon, as a fraction of the curve's size
LINE = 6e-3  # width of a line, as a fraction of the curve's size: turns within it look like one
# Samples in each certified stretch; from so many stretches on there is one in each.
PER_SEGMENT, MANY_FREQUENCIES = 8, 20_000
MANY_TURNS = 100  # so many turns of the dead time are drawn one by one
_FAR = 1e200
_TIE = 1e-9


class Arc(NamedTuple):
    """A stylised closure at the radius of the curve."""

    label: str
    points: ComplexArray


class Approach(NamedTuple):
    """Where a curve comes closest to a point; a frequency of nan means everywhere."""

    distance: float
    omega: float
    value: complex


@dataclass(frozen=True)
class Contour:
    """A Nyquist curve ready to draw: frequencies in rad/s, and the values of the loop there.

    It is cut at `radius`, where it goes to infinity, and closed there by `arcs`. The last frequency
    is inf where the limit is known. `left_out` counts the turns of the dead time that are not
    sampled, because they lie within the line of others.
    """

    omega: FloatArray
    values: ComplexArray
    radius: float
    arcs: tuple[Arc, ...]
    left_out: int = 0

    @property
    def branches(self) -> list[ComplexArray]:
        """Parts of the curve within the radius, for positive frequencies."""
        return [self.values[first:behind] for first, behind in _runs(self.values, self.radius)]

    @property
    def size(self) -> float:
        """Largest modulus of what is drawn."""
        drawn = (float(np.abs(branch).max()) for branch in self.branches)
        return self.radius if self.radius < inf else max(drawn, default=0.0)


def contour(loop: Quotient) -> Contour:
    """Sample the Nyquist curve of any map of the loop, and close it."""
    omega = _frequencies(loop)
    values = _values(loop, omega)
    radius = _radius(loop, omega, values)
    shown, left_out = _without_like_turns(loop, omega, _size(values, radius))
    if shown is not omega:
        omega, values = shown, _values(loop, shown)
    turns = round(float(np.diff(omega)[left_out].sum()) * loop.delay / (2 * pi))
    omega, values = _refined(loop, omega, values, radius, ~left_out)
    return Contour(omega, values, radius, _arcs(loop, omega, values, radius), turns)


def closest_approach(loop: Quotient, curve: Contour, point: float = -1.0) -> Approach:
    """Find where the curve of a loop comes closest to a point of the real axis."""
    omega, values = curve.omega, curve.values
    distance = np.abs(values - point)
    lowest = float(distance.min())
    limit = _limit_circle(loop, point)
    if limit and limit.distance <= lowest * (1 + _TIE):
        return limit
    if float(distance.max()) <= lowest * (1 + _TIE):
        return Approach(lowest, nan, complex(values[0]))
    for end in (0, -1):  # Where an end is as close as anything, rounding must not choose.
        if distance[end] <= lowest * (1 + _TIE) and omega[end] in (0.0, inf):
            return Approach(float(distance[end]), float(omega[end]), complex(values[end]))
    inner = 1 + np.flatnonzero((distance[1:-1] <= distance[:-2]) & (distance[1:-1] <= distance[2:]))
    near = inner[distance[inner] <= 1.05 * lowest]
    ends = omega[near - 1], np.minimum(omega[near + 1], 10 * omega[near])
    found = golden(lambda w: np.abs(loop(1j * w) - point), *ends)
    candidates = np.append(found, omega[int(np.argmin(distance))])
    nearest = float(candidates[np.argmin(np.abs(loop(1j * candidates) - point))])
    value = complex(loop(1j * nearest))
    return Approach(abs(value - point), nearest, value)


def _values(loop: Quotient, omega: FloatArray) -> ComplexArray:
    """Evaluate the loop; poles become very far points, ω = ∞ the limit."""
    finite = omega < inf
    values = np.full(omega.size, _limit(loop), dtype=complex)
    values[finite] = loop(1j * omega[finite])
    return np.where(np.isfinite(values), values, _FAR)


def _limit(loop: Quotient) -> complex:
    """Value at infinite frequency, nan where there is none."""
    undelayed, delayed = loop.at_infinity
    endless = delayed or (undelayed and loop.denominator.neutral_ratio > 0)
    return complex(nan) if endless or undelayed == inf else complex(undelayed)


def _limit_circle(loop: Quotient, point: float) -> Approach | None:
    """Nearest point of the circle a + b exp(-jωθ) that a neutral loop tends to."""
    centre, delayed = loop.at_infinity
    if not delayed or inf in (centre, delayed) or loop.denominator.delay:
        return None
    radius = abs(delayed)
    value = centre + (radius if point >= centre else -radius)
    return Approach(abs(value - point), inf, complex(value))


def _frequencies(loop: Quotient) -> FloatArray:
    """Extend the resolved frequencies to where L has its values for ω = 0 and ω = ∞."""
    omega = resolved_frequencies(loop, per_segment=1)
    # Of very many turns most will be left out again, see `_without_like_turns`.
    if omega.size < MANY_FREQUENCIES:
        omega = subdivided(omega, PER_SEGMENT)
    low = [0.0] if np.isfinite(loop.dc_gain) else omega[0] * np.geomspace(1e-12, 1, 97)
    if loop.delay:  # A spiral or a circle needs some turns more before one sees where it ends.
        high = omega[-1] + 2 * pi / loop.delay * np.linspace(0, 4, 4 * 64 + 1)
    else:
        high = omega[-1] * np.geomspace(1, 1e12 if loop.numerator.degree else 1e3, 97)
    end = [inf] if np.isfinite(_limit(loop)) else []
    return np.unique(np.concatenate([low, omega, high, end]))


def _radius(loop: Quotient, omega: FloatArray, values: ComplexArray) -> float:
    """Radius that holds all that is finite: peaks and crossings of the real axis."""
    size = np.abs(values)
    runs_off = loop.numerator.degree > loop.denominator.degree
    if not (runs_off or on_axis(loop.den).size or not np.isfinite(loop.dc_gain)):
        return inf
    peaks = size[1:-1][(size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])]
    crosses = np.diff(np.sign(values.imag)) * np.sign(values.imag[1:]) > 0
    crossings = np.minimum(size[1:], size[:-1])[crosses]
    features = np.concatenate([peaks, crossings])
    # A curve that is nowhere small is still shown where it is smallest.
    smallest = 2.0 * float(size.min())
    return 1.3 * max(2.0, smallest, float(features[features < 1e4].max(initial=0.0)))


def _size(values: ComplexArray, radius: float) -> float:
    finite = np.abs(values)[np.abs(values) < _FAR]
    return min(radius, max(float(finite.max(initial=0.0)), 1e-12))


def _without_like_turns(
    loop: Quotient, omega: FloatArray, size: float
) -> tuple[FloatArray, BoolArray]:
    """Leave out turns of the dead time that lie within the line of the last one that is drawn.

    A turn begins where the one before ends, so that whole ones can be left out without a gap.
    Returned are the frequencies, and which of the steps between them leave out turns.
    """
    turn = 2 * pi / loop.delay if loop.delay else inf
    finite = omega[(omega > 0) & (omega < inf)]
    start, count = finite[0], int((finite[-1] - finite[0]) / turn)
    if count <= MANY_TURNS:
        return omega, np.zeros(omega.size - 1, dtype=bool)
    begins = start + turn * np.arange(count + 1)
    # Frequencies that only follow the dead time stand up to some hundreds to a turn; those that
    # follow a resonance stand closer.
    closer = np.diff(finite, prepend=0.0) < turn / 1000
    apart = 1 + count // MANY_FREQUENCIES
    every = np.union1d(finite[closer], np.append(begins[::apart], begins[-1]))
    # How the curve changes apart from turning: with the dead time's phase held at four values.
    held = _held(loop, every)
    held = np.where(np.abs(held) < 2 * size, held, 2 * size)
    # Near the point an inset may magnify the curve: there the line is thinner.
    line = LINE * np.minimum(size, np.maximum(np.abs(held[:, 1:]), 1.0))
    moved = (np.abs(np.diff(held)) / line).max(axis=0)
    marks = np.floor(np.interp(begins, every, np.append(0.0, np.cumsum(moved))))
    drawn = marks[1:] != marks[:-1]
    drawn[[0, -1]] = True
    fine = begins[:-1][drawn][:, None] + turn * np.arange(0, 1, 1 / 16)
    ends = begins[1:][drawn]
    of = np.clip(np.searchsorted(begins, omega, "right") - 1, 0, count - 1)
    kept = omega[drawn[of] | (omega < start) | (omega > begins[-1])]
    omega = np.unique(np.concatenate([kept, fine.ravel(), ends]))
    first = np.clip(np.searchsorted(begins, omega[:-1], "right") - 1, 0, count - 1)
    inside = (omega[:-1] >= start) & (omega[:-1] < begins[-1])
    return omega, inside & ~drawn[first]


def _held(loop: Quotient, omega: FloatArray) -> ComplexArray:
    """Evaluate a loop with exp(-jωθ), θ the longest dead time, held at four values, one a row."""
    s, held = 1j * omega, np.array([[1], [-1j], [-1], [1j]])

    def value(factor: QuasiPolynomial) -> ComplexArray:
        late = [np.polyval(r, s) * np.exp((loop.delay - T) * s) for r, T in factor.delayed]
        return np.asarray(np.polyval(factor.q, s) + held * sum(late))

    num, den = (reduce(np.multiply, map(value, factors)) for factors in (loop.num, loop.den))
    with np.errstate(all="ignore"):
        return np.asarray(np.nan_to_num(num / den, nan=_FAR, posinf=_FAR, neginf=-_FAR))


def _refined(
    loop: Quotient, omega: FloatArray, values: ComplexArray, radius: float, check: BoolArray
) -> tuple[FloatArray, ComplexArray]:
    """Halve those steps to be checked whose chord leaves the curve."""
    tolerance = SMOOTH * _size(values, radius)
    check = check & np.isfinite(omega[1:])
    for _ in range(60):
        near = np.minimum(np.abs(values[1:]), np.abs(values[:-1])) < 1.5 * radius
        i = np.flatnonzero(check & near)
        middle = (omega[i] + omega[i + 1]) / 2
        found = _values(loop, middle)
        chord = np.abs(values[i + 1] - values[i])
        bent = np.abs(found - (values[i] + values[i + 1]) / 2) > tolerance
        # Long chords would also cut the circle at `radius` visibly off its place.
        bent |= (chord > 50 * tolerance) & (omega[i + 1] - omega[i] > 1e-12 * omega[i + 1])
        i, middle, found = i[bent], middle[bent], found[bent]
        if not i.size:
            break
        check = np.zeros(check.size + i.size, dtype=bool)
        new = i + np.arange(i.size)
        check[new] = check[new + 1] = True
        omega, values = np.insert(omega, i + 1, middle), np.insert(values, i + 1, found)
    return omega, values


def _arcs(
    loop: Quotient, omega: FloatArray, values: ComplexArray, radius: float
) -> tuple[Arc, ...]:
    """Close the curve at `radius`, in the sense in which it is closed at infinity."""
    inside = _runs(values, radius)
    if radius == inf or not inside:
        return ()
    arcs = []
    order = -loop.zeros_at_origin
    first, last = values[inside[0][0]], values[inside[-1][1] - 1]
    if order > 0:
        arcs.append(Arc("indentation", _arc(np.conj(first), first, order, radius)))
    poles = on_axis(loop.den)
    for (_, behind), (back, _) in pairwise(inside):
        order = int(np.sum((poles > omega[behind - 1]) & (poles < omega[back])))
        if order:
            arc = _arc(values[behind - 1], values[back], order, radius)
            arcs += [Arc("indentation", arc), Arc("", np.conj(arc))]
    excess = loop.numerator.q.size - loop.denominator.q.size
    if excess > 0 and not loop.delay:
        arcs.append(Arc("arc at infinity", _arc(last, np.conj(last), excess, radius)))
    return tuple(arcs)


def _arc(start: complex, end: complex, half_turns: int, radius: float) -> ComplexArray:
    """Clockwise arc from the angle of `start` to that of `end`, of about `half_turns` times π."""
    begin, wanted = np.angle(start), -pi * half_turns
    turn = np.angle(end) - begin
    turn += 2 * pi * np.round((wanted - turn) / (2 * pi))
    count = 2 + int(60 * abs(turn))
    return np.asarray(radius * np.exp(1j * (begin + turn * np.linspace(0, 1, count))))


def _runs(values: ComplexArray, radius: float) -> list[list[int]]:
    """Stretches of a curve within the radius, each from its first index to the one behind it."""
    return list(runs(np.abs(values) <= min(radius, _FAR / 2)).tolist())
