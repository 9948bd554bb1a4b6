r"""Many plants as arrays of coefficients, and condition ii of Lemma 1 for all, certified.

Model, filter and controller are the same for all plants, so that condition i is judged once, and

.. math:: p_B = D\,(N_m' E) + N\,(D_m' N_f')\,e^{-\theta s}

is a sum of two products with fixed polynomials, in an array for plants of the same degrees. Without
dead time Routh's test decides; with it, or where a sign in Routh's array is not certain, the
argument along the axis. What is within rounding of the border is left to `nrdob.NRDOB.stability`.

For Ms all plants are looked at on the same frequencies, and each on frequencies of its own where
around the stretch between two of them a factor of L, or 1 + L, may have a root, or a dead time
turns it far. Closest points to -1 are solved for, all together. A plant that would need too many
frequencies is left to `nrdob.analysis.margins`.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, prod
from typing import Any, NamedTuple

import control as ct
import numpy as np

from ..analysis import Locus
from ..diagram import DelayedTransferFunction, LoopEquations, as_fraction, undelayed
from ..numerics import (
    ROUNDING,
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    ManyTerms,
    QuasiPolynomial,
    bisect,
    convolved,
    frequency_range,
    hurwitz,
    multiply,
    padded_sum,
    rhp_counts,
    values_and_slopes,
    zero_free,
)

__all__ = ["SLAB", "Feedback", "PlantBatch", "batch_peaks"]

SLAB = 500  # plants looked at together: what they need fits into the cache

PER_OCTAVE, AT_MOST = 8, 400  # frequencies of an octave that all plants share, and all at most
CLEAR = 2.0  # around each stretch nothing may vanish on a disc so many times as wide
ROUNDS, OWN = 25, 400  # how often stretches are halved, and how many a plant may have
RADIANS = 0.5  # how far a dead time may turn L from one frequency to the next
SMALL = 1e-3  # size of L below which that is no matter
SHALLOW = 2.7  # minima of ``|1 + L|²`` so many times above the least are left out
WITHIN = 1e-10  # how well a frequency is to be known, relatively


class PlantBatch(NamedTuple):
    """Numerators and denominators (k, n), descending, and dead times (n,): plants in columns."""

    num: FloatArray
    den: FloatArray
    delay: FloatArray

    def of(self, chosen: IntArray) -> PlantBatch:
        """Take the columns of these numbers."""
        return PlantBatch(self.num[:, chosen], self.den[:, chosen], self.delay[chosen])

    def groups(self) -> Iterator[tuple[IntArray, PlantBatch]]:
        """Proper plants of finite numbers by degrees, and with or without dead time: which."""
        finite = np.isfinite(self.num).all(axis=0) & np.isfinite(self.den).all(axis=0)
        causal = np.isfinite(self.delay) & (self.delay >= 0)
        num, den = (np.argmax(c != 0, axis=0) for c in (self.num, self.den))
        proper = self.den.shape[0] - den >= self.num.shape[0] - num
        given = self.num.any(axis=0) & self.den.any(axis=0)
        usable = np.flatnonzero(finite & causal & given & proper)
        key = np.stack([num[usable], den[usable], self.delay[usable] > 0])
        for kind in np.unique(key, axis=1).T:
            chosen = usable[(key == kind[:, None]).all(axis=0)]
            few = self.of(chosen)
            yield chosen, few._replace(num=few.num[kind[0] :], den=few.den[kind[1] :])

    def plant(self, k: int) -> ct.TransferFunction | DelayedTransferFunction:
        """Return one as a block that `nrdob.NRDOB` takes; ValueError if it is none."""
        num, den = as_fraction((self.num[:, k], self.den[:, k]), "the plant", proper=False)
        plant = ct.tf(num, den)
        delay = float(self.delay[k])
        return DelayedTransferFunction(plant, delay) if delay else plant

    @classmethod
    def of_blocks(cls, blocks: list[Any]) -> PlantBatch:
        """Gather plants of any degrees; nan where one is None."""
        prompt, delays = zip(*map(undelayed, blocks), strict=True)
        none = np.full(1, np.nan), np.ones(1)
        fractions = [
            none if block is None else as_fraction(block, "the plant", proper=False)
            for block in prompt
        ]
        tables = []
        for rows in zip(*fractions, strict=True):
            size = max(row.size for row in rows)
            tables.append(np.array([np.pad(row, (size - row.size, 0)) for row in rows]).T)
        num, den = tables
        return cls(num, den, np.array(delays))


class Feedback:
    """All of a loop that does not depend on the plant."""

    def __init__(self, loop: LoopEquations) -> None:
        self.K, self.locus = loop.K, Locus(loop.K)
        # Of what is multiplied with denominator and numerator of the plant.
        self.sizes = [
            multiply(*(QuasiPolynomial(p.scale) for p in part)).q
            for part in (self.K.den, self.K.num)
        ]

    def characteristic(self, plants: PlantBatch) -> tuple[list[ManyTerms], FloatArray]:
        """Terms of p_B, and for each power of s the size of what is summed."""
        products = [
            (convolved(plants.den, p[:, None]), np.full(1, delay))
            for p, delay in self.K.denominator.terms
        ]
        late = convolved(plants.num, self.K.numerator.q[:, None])
        size = convolved(np.abs(plants.den), self.sizes[0][:, None])
        scale = padded_sum(size, convolved(np.abs(plants.num), self.sizes[1][:, None]))
        if not plants.delay.any():
            (prompt, none), *others = products
            products = [(padded_sum(prompt, late), none), *others]
        else:
            products.append((late, plants.delay))
        return [ManyTerms(q, delay) for q, delay in products], scale

    def verdicts(self, plants: PlantBatch) -> tuple[BoolArray, BoolArray]:
        """Tell for which plants of one degree p_B is certainly stable, and unstable."""
        terms, scale = self.characteristic(plants)
        q = terms[0].q
        stable, unstable = np.zeros((2, scale.shape[1]), dtype=bool)
        # Advanced or ill-posed, or an integrator of a delayed model cancels: not for arrays.
        if q.shape[0] < scale.shape[0] or self.K.denominator.divided:
            return stable, unstable
        if len(terms) == 1:
            stable, unstable = hurwitz(q, ROUNDING * scale)
        well_posed = np.abs(q[0]) > ROUNDING * scale[0]
        unstable |= well_posed & (np.sum([term.q[-1] != 0 for term in terms], axis=0) == 0)
        unsure = np.flatnonzero(~(stable | unstable))
        for first in range(0, unsure.size, SLAB):
            few = unsure[first : first + SLAB]
            counts = rhp_counts([term.of(few) for term in terms], scale[:, few])
            stable[few], unstable[few] = counts == 0, counts > 0
        return stable, unstable


# Sensitivity peaks of stable loops.


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
        # What may vanish: p_B, numerators and denominators of the plants, factors of K.
        found = [feedback.characteristic(plants)]
        for part in (plants.num, plants.den):
            found.append(([ManyTerms(part, np.zeros(1))], np.abs(part)))
        for each in (*feedback.K.num, *feedback.K.den):
            # One that vanishes at s = 0 is not divided by s: no stretch begins there.
            p = each if each.without_origin.divided else each.without_origin
            terms = [ManyTerms(q[:, None], np.full(1, delay)) for q, delay in p.terms]
            found.append((terms, p.scale[:, None]))
        self.factors = [factor for factor in found if factor[1].shape[0] > 1]

    def motion(self, omega: FloatArray, of: PlantBatch) -> _Motion:
        """Evaluate L(jω) and how it moves."""
        d, dd = values_and_slopes(of.den, omega)
        n, dn = values_and_slopes(of.num, omega)
        value, slope = n / d, -dd / d
        if of.num.shape[0] > 1:
            slope += dn / n
        if self.late:
            value, slope = value * np.exp(-1j * (of.delay * omega)), slope - of.delay
        (log,), (its_slope,) = self.feedback.locus.log_and_slope(omega)
        return _Motion(value * np.exp(log), 1j * omega * slope + its_slope)

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
    kept = doubtful.of(np.zeros(loop.size, dtype=bool))  # none so far
    trusted = np.ones(loops.count, dtype=bool)
    own = np.zeros(loops.count, dtype=int)
    for _ in range(ROUNDS):
        if not doubtful.loop.size:
            break
        halves = doubtful.halved()
        alone = _clear(loops, halves.low, halves.high, halves.loop)
        kept = kept.joined(halves.of(alone))
        doubtful = halves.of(~alone)
        own += np.bincount(halves.loop, minlength=loops.count)
        trusted &= own <= OWN
        doubtful = doubtful.of(trusted[doubtful.loop])
    trusted[doubtful.loop] = False
    # Beyond all roots little happens, but a size may still pass 1, and a phase creep to the axis.
    end = omega[-1] + 4 * pi / loops.plants.delay.max() if loops.late else 1e8 * omega[-1]
    below = omega[0] * np.geomspace(1e-8, 0.8, 12)
    above = np.geomspace(omega[-1], end, 17)[1:]
    clear = np.pad(clear, ((0, 0), (below.size, above.size)), constant_values=True)
    return np.concatenate([below, omega, above]), clear, kept, trusted


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
    K, (num, den, delay) = loops.feedback.K, loops.plants
    every = np.arange(delay.size)
    zeros, poles = (np.argmax(p[::-1] != 0, axis=0) for p in (num, den))
    above, below = (prod(p.without_origin.constant for p in part) for part in (K.num, K.den))
    level = above / below * num[-1 - zeros, every] / den[-1 - poles, every]
    order = K.zeros_at_origin + zeros - poles
    at_zero = np.abs(1 + np.where(order > 0, 0.0, np.where(order < 0, np.inf, level)))
    if K.numerator.degree + num.shape[0] < K.denominator.degree + den.shape[0]:
        return np.asarray(np.fmin(at_zero, 1.0))
    if K.denominator.delay:  # L does not tend to a circle
        return np.full(delay.shape, np.nan)
    limit = K.numerator.q[0] * num[0] / (K.denominator.q[0] * den[0])
    at_infinity = np.abs(1 - np.abs(limit)) if loops.late else np.abs(1 + limit)
    return np.asarray(np.fmin(at_zero, at_infinity))
