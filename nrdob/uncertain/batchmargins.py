r"""Margins of the plant loops L = K·G of many plants at once.

All plants are looked at on the same frequencies, and each on frequencies of its own where around
the stretch between two of them a factor of L, or 1 + L, may have a root, or a dead time turns it
far: then nothing resonates between two frequencies. Crossings and closest points are solved for,
each in its bracket, all together, from values and slopes of the factors, as
`nrdob.analysis.margins` does for one loop. A plant that would need too many frequencies is left to
it.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import NamedTuple

import numpy as np

from ..numerics import (
    ROUNDING,
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    ManyTerms,
    bisect,
    frequency_range,
    side,
    values_and_slopes,
    zero_free,
)
from .batch import Feedback, PlantBatch

__all__ = ["MARGINS", "batch_margins"]

MARGINS = ("ms", "gm", "pm", "delay_margin")  # as `nrdob.analysis.Margins` calls them
PER_OCTAVE, AT_MOST = 8, 400  # frequencies of an octave that all plants share, and all at most
CLEAR = 2.0  # around each stretch nothing may vanish on a disc so many times as wide
ROUNDS, OWN = 25, 400  # how often stretches are halved, and how many a plant may have
RADIANS = 0.5  # how far a dead time may turn L from one frequency to the next
SMALL = 1e-3  # size of L beyond which a dead time turns it on: no gain margin is there
NOISE = 1e-13  # what is below it may be rounding, and has no sign
CROSSING = 1e-3  # how well a crossing must be one: at a pole on the axis L jumps
SHALLOW = 2.7  # minima of ``|1 + L|²`` so many times above the least are left out
WITHIN = 1e-10  # how well a frequency is to be known, relatively


def batch_margins(
    feedback: Feedback, plants: PlantBatch
) -> tuple[dict[str, FloatArray], BoolArray]:
    """Compute margins (n,) by name of stable loops of one kind, and which are to be trusted."""
    loops = _Loops(feedback, plants)
    with np.errstate(all="ignore"):  # what is not finite is looked at again
        shared, clear, own, trusted = _frequencies(loops)
        gain, phase, nearest = _notable(loops, shared, clear, own)
        ends = _ends(loops)
        found = {
            "ms": 1 / _closest(nearest, ends),
            "gm": _gain_margin(phase, ends),
            **_rotations(gain, ends),
        }
    for values in found.values():
        trusted &= ~np.isnan(values)
    if loops.late:
        trusted &= found["gm"] < 0.5 / SMALL
    return found, trusted


class _Motion(NamedTuple):
    """L(jω), and its derivative with respect to log ω, divided by L."""

    L: ComplexArray
    slope: ComplexArray

    @property
    def retreat(self) -> FloatArray:
        """Positive where L moves away from -1 with growing frequency."""
        return np.asarray((self.slope * self.L * (1 + self.L).conj()).real)

    @property
    def distance(self) -> FloatArray:
        """Square of the distance from -1."""
        return np.asarray((1 + self.L.real) ** 2 + self.L.imag**2)

    @property
    def rows(self) -> _Rows:
        real, imag = self.L.real, self.L.imag
        size = real * real + imag * imag
        by_size, by_side = 2 * size * self.slope.real, real * self.slope.imag
        side = imag / np.sqrt(size)
        return _Rows(real, size - 1, by_size, side, by_side, self.retreat, self.distance)


class _Rows(NamedTuple):
    """What decides about margins, at one end of each stretch.

    Real part of L; ``|L|² - 1`` and its slope; the sine of the angle of L and what its slope has
    the sign of; what is positive where L moves away from -1, and the square of how far it is.
    """

    real: FloatArray
    size: FloatArray
    size_slope: FloatArray
    side: FloatArray
    side_slope: FloatArray
    retreat: FloatArray
    distance: FloatArray

    def of(self, chosen: slice) -> _Rows:
        return _Rows(*(row[:, chosen] for row in self))


class _Stretches(NamedTuple):
    """Stretches of frequency, each of one loop."""

    loop: IntArray
    low: FloatArray
    high: FloatArray

    def of(self, chosen: BoolArray | IntArray) -> _Stretches:
        return _Stretches(self.loop[chosen], self.low[chosen], self.high[chosen])

    def joined(self, *others: _Stretches) -> _Stretches:
        loop, low, high = map(np.concatenate, zip(self, *others, strict=True))
        return _Stretches(loop, low, high)

    def halved(self) -> _Stretches:
        middle = np.sqrt(self.low * self.high)
        return self._replace(high=middle).joined(self._replace(low=middle))


class _Found(NamedTuple):
    """Solutions of one kind: which loop, at which frequency in rad/s, and L there."""

    loop: IntArray
    omega: FloatArray
    L: ComplexArray

    def of(self, kept: BoolArray) -> _Found:
        return _Found(self.loop[kept], self.omega[kept], self.L[kept])


class _Ends(NamedTuple):
    """L(0), and a and b of the circle a + b exp(-jωθ) that L(jω) tends to; nan where unknown."""

    dc: FloatArray
    a: FloatArray
    b: FloatArray


class _Loops:
    """Plant loops on the imaginary axis."""

    def __init__(self, feedback: Feedback, plants: PlantBatch) -> None:
        self.feedback, self.plants = feedback, plants
        self.count = plants.delay.size
        self.late = bool(plants.delay.any())
        self.factors = self._factors()

    def _factors(self) -> list[tuple[list[ManyTerms], FloatArray]]:
        """List what may vanish: p_B, numerators and denominators of the plants, factors of K."""
        prompt = np.zeros(1)
        found = [self.feedback.characteristic(self.plants)]
        for part in (self.plants.num, self.plants.den):
            found.append(([ManyTerms(part, prompt)], np.abs(part)))
        for each in (*self.feedback.zeros, *self.feedback.poles):
            # One that vanishes at s = 0 is not divided by s: no stretch begins there.
            p = each if each.without_origin.divided else each.without_origin
            terms = [ManyTerms(q[:, None], np.full(1, delay)) for q, delay in p.terms]
            found.append((terms, p.scale[:, None]))
        return [factor for factor in found if factor[1].shape[0] > 1]

    def motion(self, omega: FloatArray, of: PlantBatch) -> _Motion:
        """Evaluate L(jω) and how it moves."""
        d, dd = values_and_slopes(of.den, omega)
        n, dn = values_and_slopes(of.num, omega)
        value, slope = n / d, -dd / d
        if of.num.shape[0] > 1:
            slope += dn / n
        if self.late:
            value, slope = value * np.exp(-1j * (of.delay * omega)), slope - of.delay
        gain, its_slope = self.feedback.gain_and_slope(omega)
        return _Motion(value * gain, 1j * omega * (slope + its_slope))

    def across(self) -> PlantBatch:
        """Return the plants with an axis for frequencies."""
        num, den, delay = self.plants
        return PlantBatch(num[:, :, None], den[:, :, None], delay[:, None])


def _frequencies(loops: _Loops) -> tuple[FloatArray, BoolArray, _Stretches, BoolArray]:
    """Choose frequencies that all share, and stretches of their own where those are not clear.

    Returned are the frequencies, between which of them which loops are clear, the stretches that
    stand there for the others, and which loops can be trusted.
    """
    low, high = 1.0, 1.0
    ranges = [frequency_range(*factor) for factor in loops.factors]
    if ranges:
        lows, highs = (np.concatenate([each[k] for each in ranges]) for k in (0, 1))
        low = float(lows[np.isfinite(lows) & (lows > 0)].min(initial=1e300))
        high = float(highs[np.isfinite(highs)].max(initial=low))
    count = int(np.clip(PER_OCTAVE * np.log2(high / low), 1, AT_MOST))
    omega = np.geomspace(low, high, count + 1)
    clear = _clear(loops, omega[:-1], omega[1:])
    loop, k = np.nonzero(~clear)
    doubtful = _Stretches(loop, omega[k], omega[k + 1])
    kept: list[_Stretches] = []
    trusted = np.ones(loops.count, dtype=bool)
    own = np.zeros(loops.count, dtype=int)
    for _ in range(ROUNDS):
        if not doubtful.loop.size:
            break
        halves = doubtful.halved()
        alone = _clear(loops, halves.low, halves.high, halves.loop)
        kept.append(halves.of(alone))
        doubtful = halves.of(~alone)
        own += np.bincount(halves.loop, minlength=loops.count)
        trusted &= own <= OWN
        doubtful = doubtful.of(trusted[doubtful.loop])
    trusted[doubtful.loop] = False
    none = _Stretches(np.empty(0, dtype=np.intp), np.empty(0), np.empty(0))
    # Beyond all roots little happens, but a size may still pass 1, and a phase creep to the axis.
    end = omega[-1] + 4 * pi / loops.plants.delay.max() if loops.late else 1e8 * omega[-1]
    below = omega[0] * np.geomspace(1e-8, 0.8, 12)
    above = np.geomspace(omega[-1], end, 17)[1:]
    clear = np.pad(clear, ((0, 0), (below.size, above.size)), constant_values=True)
    return np.concatenate([below, omega, above]), clear, none.joined(*kept), trusted


def _clear(
    loops: _Loops, left: FloatArray, right: FloatArray, loop: IntArray | None = None
) -> BoolArray:
    """Tell on which stretches all loops, or one loop on each, have nothing to hide."""
    centre, radius = (left + right) / 2, CLEAR * (right - left) / 2
    plants = loops.across() if loop is None else loops.plants.of(loop)
    clear = np.ones(np.broadcast_shapes(plants.delay.shape, left.shape), dtype=bool)
    for terms, scale in loops.factors:
        if loop is None:
            terms, scale = [term.across() for term in terms], scale[:, :, None]
        else:
            terms = [term.of(loop) for term in terms]
            scale = scale[:, loop] if scale.shape[1] > 1 else scale
        clear &= zero_free(terms, scale, centre, radius)
    if loops.late:
        far = plants.delay * (right - left) > RADIANS
        clear &= ~(far & (np.abs(loops.motion(left, plants).L) > SMALL))
    return clear


def _notable(
    loops: _Loops, shared: FloatArray, clear: BoolArray, own: _Stretches
) -> tuple[_Found, _Found, _Found]:
    """Find where the size of L is 1, where it is real, and where it is nearest to -1."""
    rows = loops.motion(shared, loops.across()).rows
    few = loops.plants.of(own.loop)
    low, high = (loops.motion(omega, few).rows for omega in (own.low, own.high))
    least = rows.distance.min(axis=1)
    for end in (low, high):
        np.minimum.at(least, own.loop, end.distance)
    left, right = rows.of(slice(-1)), rows.of(slice(1, None))
    widths = np.diff(np.log(shared)), np.log(own.high / own.low)

    def gather(choose: Choice) -> _Stretches:
        """Collect stretches by what is at their ends, and by the least distance of their loop."""
        loop, k = np.nonzero(clear & choose(left, right, least[:, None], widths[0]))
        alone = own.of(choose(low, high, least[own.loop], widths[1]))
        return _Stretches(loop, shared[k], shared[k + 1]).joined(alone)

    def log_size(motion: _Motion) -> FloatArray:
        return np.log(np.abs(motion.L))

    def sine(motion: _Motion) -> FloatArray:
        return np.asarray(motion.L.imag / np.abs(motion.L))

    hidden = _hidden(loops, gather(_size_nears), log_size, lambda motion: motion.slope.real)
    gain_found = _solved(loops, gather(_sizes_differ).joined(*hidden), log_size)
    hidden = _hidden(loops, gather(_side_nears), sine, lambda motion: motion.slope.imag)
    real = _critical(loops, gather(_sides_differ).joined(*hidden))
    phase_found = _solved(loops, real, sine)
    nearest = _solved(
        loops, gather(_nearest_between), lambda motion: motion.retreat / motion.distance
    )
    crossed = np.abs(np.abs(gain_found.L) - 1) < CROSSING
    met = np.abs(phase_found.L.imag) < CROSSING * np.abs(phase_found.L)
    return gain_found.of(crossed), phase_found.of(met), nearest


Choice = Callable[[_Rows, _Rows, FloatArray, FloatArray], BoolArray]
"""Of what is at both ends of stretches, the least distance of each loop, and the width of each."""


def _sizes_differ(a: _Rows, b: _Rows, _: FloatArray, __: FloatArray) -> BoolArray:
    return np.asarray((a.size >= 0) != (b.size >= 0))


def _sides_differ(a: _Rows, b: _Rows, _: FloatArray, __: FloatArray) -> BoolArray:
    differ = (a.side >= 0) != (b.side >= 0)
    return np.asarray(differ & ((a.real < 0) | (b.real < 0)) & (np.abs(a.side) > NOISE))


def _nearest_between(a: _Rows, b: _Rows, least: FloatArray, _: FloatArray) -> BoolArray:
    near = np.fmin(a.distance, b.distance) < SHALLOW * least
    return np.asarray((a.retreat < 0) & (b.retreat >= 0) & near)


def _size_nears(a: _Rows, b: _Rows, _: FloatArray, width: FloatArray) -> BoolArray:
    return _nears(a.size, a.size_slope, b.size, b.size_slope, width)


def _side_nears(a: _Rows, b: _Rows, _: FloatArray, width: FloatArray) -> BoolArray:
    # Where L is far from the axis, no crossing is hidden, and the slope is only a sign.
    close = (np.abs(a.side) < 0.5) & ((a.real < 0) | (b.real < 0))
    return close & _nears(a.side, a.side_slope, b.side, b.side_slope, np.inf)


def _nears(
    value: FloatArray,
    slope: FloatArray,
    later: FloatArray,
    later_slope: FloatArray,
    width: FloatArray | float,
) -> BoolArray:
    """Tell where a function first nears zero and then leaves it on the same side."""
    positive = value >= 0
    turns = (positive == (later >= 0)) & (positive == (slope < 0)) & (positive == (later_slope > 0))
    # As far as its slope goes, twice over, it must come to zero.
    return np.asarray(turns & (np.abs(value) < 2 * width * np.abs(slope)))


At = Callable[[_Motion], FloatArray]  # what is to be 0, from L and its motion


def _hidden(loops: _Loops, dips: _Stretches, at: At, slope: At) -> list[_Stretches]:
    """Find crossings that come in twos, on both sides of where a function comes nearest to zero."""
    if not dips.loop.size:
        return []
    bottom = _solved(loops, dips, slope).omega
    few = loops.plants.of(dips.loop)
    value, before = (at(loops.motion(omega, few)) for omega in (bottom, dips.low))
    crossed = (side(value) != side(before)) & (np.abs(value) > NOISE)
    return [dips._replace(high=bottom).of(crossed), dips._replace(low=bottom).of(crossed)]


def _critical(loops: _Loops, phase: _Stretches) -> _Stretches:
    """Leave out crossings of the negative real axis that cannot be next to -1."""
    few = loops.plants.of(phase.loop)
    ends = [loops.motion(omega, few).L for omega in (phase.low, phase.high)]
    sizes = [np.log(np.abs(end)) for end in ends]
    largest, smallest = np.fmax(*sizes), np.fmin(*sizes)
    # Of those below 1 only the largest counts, of those above only the smallest: of what certainly
    # crosses the negative axis.
    certain = (ends[0].real < 0) & (ends[1].real < 0)
    below, above = np.full(loops.count, -np.inf), np.full(loops.count, np.inf)
    small, large = certain & (largest < 0), certain & (smallest > 0)
    np.maximum.at(below, phase.loop[small], smallest[small])
    np.minimum.at(above, phase.loop[large], largest[large])
    near = (largest >= below[phase.loop] - 0.1) & (smallest <= above[phase.loop] + 0.1)
    return phase.of(near)


def _solved(loops: _Loops, stretches: _Stretches, at: At) -> _Found:
    """Find a zero of a function in every stretch."""
    loop, low, high = stretches
    few = loops.plants.of(loop)

    def function(x: FloatArray) -> FloatArray:
        return at(loops.motion(np.exp(x), few))

    omega = np.exp(bisect(function, np.log(low), np.log(high), WITHIN)) if loop.size else low
    return _Found(loop, omega, loops.motion(omega, few).L)


def _ends(loops: _Loops) -> _Ends:
    feedback, (num, den, delay) = loops.feedback, loops.plants
    at = np.arange(delay.size)
    zeros, poles = (np.argmax(p[::-1] != 0, axis=0) for p in (num, den))
    order = feedback.zeros_at_origin + zeros - poles
    level = feedback.level * num[-1 - zeros, at] / den[-1 - poles, at]
    dc = np.where(order > 0, 0.0, np.where(order < 0, np.inf, level))
    none = np.zeros(delay.size)
    if feedback.numerator.degree + num.shape[0] < feedback.denominator.degree + den.shape[0]:
        return _Ends(dc, none, none)
    if feedback.delayed:  # the circle is more than that
        return _Ends(dc, none + np.nan, none)
    limit = feedback.numerator.q[0] * num[0] / (feedback.denominator.q[0] * den[0])
    return _Ends(dc, none, limit) if loops.late else _Ends(dc, limit, none)


def _gain_margin(phase: _Found, ends: _Ends) -> FloatArray:
    n = ends.dc.size
    low, high = np.zeros(n), np.full(n, np.inf)
    every, b = np.arange(n), np.abs(ends.b)
    for loop, value in (
        (phase.loop, phase.L.real), (every, ends.dc), (every, ends.a - b), (every, ends.a + b),
    ):  # fmt: skip
        critical = np.isfinite(value) & (value < 0)
        gains, which = -1 / value[critical], loop[critical]
        np.maximum.at(low, which[gains < 1], gains[gains < 1])
        np.minimum.at(high, which[gains > 1], gains[gains > 1])
    gm = np.where(low * high > 1, low, high)
    return np.where(np.isnan(ends.a), np.nan, gm)


def _rotations(gain: _Found, ends: _Ends) -> dict[str, FloatArray]:
    """Phase margin in degrees, and the delay margin."""
    dc, a, b = ends
    angle = np.angle(-gain.L)
    pm = np.full(dc.size, np.inf)
    np.minimum.at(pm, gain.loop, np.abs(angle))
    at_zero = np.abs(np.abs(dc) - 1) <= ROUNDING
    pm = np.where(at_zero, np.minimum(pm, np.where(dc < 0, 0.0, pi)), pm)
    cosine = (1 + a * a - b * b) / (2 * a)
    at_end = (a != 0) & (np.abs(cosine) <= 1 + ROUNDING)
    pm = np.where(at_end, np.minimum(pm, pi - np.arccos(np.clip(cosine, -1, 1))), pm)
    margin = np.where(np.abs(a) + np.abs(b) >= 1, 0.0, np.inf)
    np.minimum.at(margin, gain.loop, np.mod(angle, 2 * pi) / gain.omega)
    unknown = np.isnan(a)
    return {
        "pm": np.where(unknown, np.nan, np.degrees(pm)),
        "delay_margin": np.where(unknown, np.nan, margin),
    }


def _closest(nearest: _Found, ends: _Ends) -> FloatArray:
    """Smallest ``|1 + L|``."""
    least = np.fmin(np.abs(1 + ends.dc), np.abs(np.abs(1 + ends.a) - np.abs(ends.b)))
    np.minimum.at(least, nearest.loop, np.abs(1 + nearest.L))
    return np.where(np.isnan(ends.a), np.nan, least)
