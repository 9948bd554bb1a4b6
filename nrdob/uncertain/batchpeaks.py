r"""Sensitivity peaks of the plant loops L = K·G of many plants at once.

All plants are looked at on the same frequencies, and each on frequencies of its own where around
the stretch between two of them a factor of L, or 1 + L, may have a root, or a dead time turns it
far: then nothing resonates between two frequencies. Closest points to -1 are solved for, each in
its bracket, all together, from values and slopes of the factors, as `nrdob.analysis.margins` does
for one loop. A plant that would need too many frequencies is left to it.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from ..numerics import (
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    ManyTerms,
    bisect,
    frequency_range,
    values_and_slopes,
    zero_free,
)
from .batch import Feedback, PlantBatch

__all__ = ["batch_peaks"]

PER_OCTAVE, AT_MOST = 8, 400  # frequencies of an octave that all plants share, and all at most
CLEAR = 2.0  # around each stretch nothing may vanish on a disc so many times as wide
ROUNDS, OWN = 25, 400  # how often stretches are halved, and how many a plant may have
RADIANS = 0.5  # how far a dead time may turn L from one frequency to the next
SMALL = 1e-3  # size of L below which that is no matter
SHALLOW = 2.7  # minima of ``|1 + L|²`` so many times above the least are left out
WITHIN = 1e-10  # how well a frequency is to be known, relatively


def batch_peaks(feedback: Feedback, plants: PlantBatch) -> tuple[FloatArray, BoolArray]:
    """Compute Ms (n,) of stable loops of one kind, and tell which are to be trusted."""
    loops = _Loops(feedback, plants)
    with np.errstate(all="ignore"):  # what is not finite is looked at again
        shared, clear, own, trusted = _frequencies(loops)
        distance = np.minimum(_between(loops, shared, clear, own), _at_ends(loops))
    trusted &= ~np.isnan(distance)
    if loops.late:
        trusted &= distance < 1 - 2 * SMALL
    return 1 / distance, trusted


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

    Returned are also between which of them which loops are clear, and which can be trusted.
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


def _between(loops: _Loops, shared: FloatArray, clear: BoolArray, own: _Stretches) -> FloatArray:
    """Smallest ``|1 + L|`` between frequencies: where L stops coming nearer to -1."""
    at = loops.motion(shared, loops.across())
    few = loops.plants.of(own.loop)
    low, high = (loops.motion(omega, few) for omega in (own.low, own.high))
    retreat, distance = at.retreat, at.distance
    least = distance.min(axis=1)
    for end in (low, high):
        np.minimum.at(least, own.loop, end.distance)
    near = distance < SHALLOW * least[:, None]
    turns = (retreat[:, :-1] < 0) & (retreat[:, 1:] >= 0) & (near[:, :-1] | near[:, 1:])
    loop, k = np.nonzero(clear & turns)
    near = np.fmin(low.distance, high.distance) < SHALLOW * least[own.loop]
    turning = own.of((low.retreat < 0) & (high.retreat >= 0) & near)
    stretches = _Stretches(loop, shared[k], shared[k + 1]).joined(turning)
    few = loops.plants.of(stretches.loop)

    def slope(x: FloatArray) -> FloatArray:
        motion = loops.motion(np.exp(x), few)
        return np.asarray(motion.retreat / motion.distance)

    found = np.full(loops.count, np.inf)
    if stretches.loop.size:
        nearest = np.exp(bisect(slope, np.log(stretches.low), np.log(stretches.high), WITHIN))
        np.minimum.at(found, stretches.loop, np.abs(1 + loops.motion(nearest, few).L))
    return found


def _at_ends(loops: _Loops) -> FloatArray:
    """Smallest ``|1 + L|`` at ω = 0 and at infinity, where a dead time turns L; nan if unknown."""
    feedback, (num, den, delay) = loops.feedback, loops.plants
    every = np.arange(delay.size)
    zeros, poles = (np.argmax(p[::-1] != 0, axis=0) for p in (num, den))
    level, power = feedback.lowest
    level = level * num[-1 - zeros, every] / den[-1 - poles, every]
    order = power + zeros - poles
    at_zero = np.abs(1 + np.where(order > 0, 0.0, np.where(order < 0, np.inf, level)))
    if feedback.numerator.degree + num.shape[0] < feedback.denominator.degree + den.shape[0]:
        return np.asarray(np.fmin(at_zero, 1.0))
    if feedback.denominator.delay:  # L does not tend to a circle
        return np.full(delay.shape, np.nan)
    limit = feedback.numerator.q[0] * num[0] / (feedback.denominator.q[0] * den[0])
    at_infinity = np.abs(1 - np.abs(limit)) if loops.late else np.abs(1 + limit)
    return np.asarray(np.fmin(at_zero, at_infinity))
