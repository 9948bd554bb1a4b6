r"""Margins of the plant loops L = K·G of many plants at once.

The fixed feedback K and all plants are looked at on the same frequencies, which are cut finer
until around each of them no factor and no 1 + L has a root for any of the plants: nothing resonates
between two of them. Then the crossings and the closest points are solved for, each in its bracket,
all together, from the factors and their slopes, as `nrdob.analysis.margins` does for one loop.
A plant that would need too many frequencies is left to it.
"""

from __future__ import annotations

from collections.abc import Sequence
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
from .plants import Plants
from .verdicts import Feedback

__all__ = ["MARGINS", "many_margins"]

MARGINS = ("ms", "gm", "pm", "delay_margin")
"""Margins of L that are found here, by the names they have in `nrdob.analysis.Margins`."""

PER_OCTAVE, AT_MOST = 6, 1500
"""Frequencies of an octave to begin with, and frequencies in all."""

CLEAR = 3.0
"""Around each stretch nothing may vanish on a disc so many times as wide."""

ROUNDS = 12
"""How often stretches are halved."""

RADIANS = 0.5
"""How far a dead time may turn L from one frequency to the next."""

SMALL = 1e-3
"""Size of L beyond which a dead time may turn it further: no gain margin is looked for there."""

NOISE = 1e-13
"""What is below it may be rounding, and has no sign."""

CROSSING = 1e-3
"""How well a crossing found must be one: at a pole on the axis the side of L changes by a jump."""

SHALLOW = 0.5
"""Minima of ``log |1 + L|`` that begin so far above the least value are not looked into."""

WITHIN = 1e-10
"""How well a frequency is to be known, relatively."""

SIZE, SIDE, RETREAT, SIZE_SLOPE, SIDE_SLOPE, DISTANCE = range(6)
"""Rows of the motion, as in `nrdob.analysis.locus`."""


def many_margins(feedback: Feedback, plants: Plants) -> tuple[dict[str, FloatArray], BoolArray]:
    """Compute the margins of loops that are known to be stable.

    Parameters
    ----------
    feedback : Feedback
        All the feedback there is.
    plants : Plants
        Of the same degrees, all with dead time or none.

    Returns
    -------
    dict of str: (n,) array of float
        Margins by name, see `MARGINS`.
    (n,) array of bool
        Which of them are to be trusted.
    """
    loops = _Loops(feedback, plants)
    with np.errstate(all="ignore"):  # what is not finite is looked at again
        omega, trusted = _frequencies(loops)
        found = loops.margins(omega)
    for values in found.values():
        trusted &= ~np.isnan(values)
    late = bool(plants.delay.any())
    trusted &= ~(late & (found["gm"] > 0.5 / SMALL) & (loops.largest_at_end(omega) > 0))
    return found, trusted


class _Found(NamedTuple):
    """Solutions of one kind: which loop, at which frequency in rad/s, and log L there."""

    loop: IntArray
    omega: FloatArray
    log: ComplexArray


class _Loops:
    """Plant loops on the imaginary axis."""

    def __init__(self, feedback: Feedback, plants: Plants) -> None:
        self.feedback, self.plants = feedback, plants
        self.count = plants.delay.size
        self.late = bool(plants.delay.any())
        self._ratio_at_0 = plants.num[-1] / plants.den[-1]

    def factors(self) -> list[tuple[list[ManyTerms], FloatArray]]:
        """What may vanish: p_B, numerators and denominators of the plants, factors of K."""
        prompt = np.zeros(1)
        found = [self.feedback.characteristic(self.plants)]
        for p in (self.plants.num, self.plants.den):
            found.append(([ManyTerms(p, prompt)], np.abs(p)))
        for factor in (*self.feedback.zeros, *self.feedback.poles):
            p = factor.without_origin
            terms = [ManyTerms(q[:, None], np.full(1, delay)) for q, delay in p.terms]
            if terms[0].q.shape[0] == p.degree + 1 > 1 and not p.divided:
                found.append((terms, p.scale[:, None]))
        return found

    def motion(self, omega: FloatArray, loop: IntArray | slice = slice(None)) -> FloatArray:
        """What decides about margins: the rows named above, for some loops at frequencies.

        With a slice all loops at all frequencies, else each at its own.
        """
        log, slope = self.log_and_slope(omega, loop)
        size, angle = log.real, log.imag
        inverse = np.exp(-np.clip(size, -700, 700) - 1j * angle)
        retreat = (slope / (1 + inverse)).real  # d log(1 + L) = L/(1 + L) d log L
        distance = size + np.log(np.abs(1 + inverse))
        rows = (size, np.sin(angle), retreat, slope.real, np.cos(angle) * slope.imag, distance)
        return np.stack(rows)

    def log_and_slope(
        self, omega: FloatArray, loop: IntArray | slice
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return log L(jω) and its derivative with respect to log ω."""
        feedback = self.feedback
        value, slope = np.ones(omega.shape, dtype=complex), np.zeros(omega.shape, dtype=complex)
        for factors, sign in ((feedback.zeros, 1), (feedback.poles, -1)):
            for factor in factors:
                p, dp = 0.0, 0.0
                for q, delay in factor.terms:
                    late = np.exp(-1j * delay * omega) if delay else 1.0
                    at, rising = values_and_slopes(q, omega)
                    p, dp = p + at * late, dp + (rising - delay * at) * late
                value = value * p if sign > 0 else value / p
                slope = slope + sign * (dp / p)
        each = isinstance(loop, slice)
        num, den = (
            p[:, :, None] if each else p[:, loop] for p in (self.plants.num, self.plants.den)
        )
        n, dn = values_and_slopes(num, omega)
        d, dd = values_and_slopes(den, omega)
        value, slope = value * (n / d), slope + dn / n - dd / d
        if self.late:
            delay = self.plants.delay[:, None] if each else self.plants.delay[loop]
            value, slope = value * np.exp(-1j * delay * omega), slope - delay
        return np.log(value), 1j * omega * slope

    def largest_at_end(self, omega: FloatArray) -> FloatArray:
        """Size of L at the last frequency."""
        return np.exp(self.log_and_slope(omega[-1:], slice(None))[0].real[:, 0])

    def margins(self, omega: FloatArray) -> dict[str, FloatArray]:
        """Find crossings and closest points, starting from frequencies that show every turn."""
        motion = self.motion(omega)
        gain, phase, nearest = self._notable(omega, motion)
        dc, a, b = self._ends()
        return {
            "ms": 1 / self._closest(nearest, dc, a, b),
            "gm": self._gain_margin(phase, dc, a, b),
            **self._rotations(gain, dc, a, b),
        }

    def _notable(self, omega: FloatArray, motion: FloatArray) -> list[_Found]:
        log_omega = np.log(omega)
        # A function that first nears zero and then leaves it may have crossed it twice in between.
        brackets: list[_Bracket] = []
        for row, row_slope in ((SIZE, SIZE_SLOPE), (SIDE, SIDE_SLOPE)):
            bracket = _changes(motion[row], omega)
            hidden = _between(motion[row], motion[row_slope], omega)
            bottom = self._solved(hidden, row_slope)
            at = self.motion(bottom.omega, bottom.loop)[row]
            low, high = (self.motion(end, hidden.loop)[row] for end in (hidden.low, hidden.high))
            for ends in ((hidden.low, bottom.omega, low), (bottom.omega, hidden.high, high)):
                crossed = (side(at) != side(ends[2])) & (np.abs(at) > NOISE)
                bracket = bracket.joined(
                    _Bracket(hidden.loop[crossed], ends[0][crossed], ends[1][crossed])
                )
            brackets.append(bracket)
        del log_omega
        brackets[1] = self._critical(brackets[1])
        brackets.append(_deepest(motion, omega))
        found = [
            self._solved(bracket, row)
            for bracket, row in zip(brackets, (SIZE, SIDE, RETREAT), strict=True)
        ]
        for k, part in enumerate((np.real, lambda log: np.sin(log.imag))):
            at = found[k]
            kept = np.abs(part(at.log)) < CROSSING
            found[k] = _Found(*(column[kept] for column in at))
        return found

    def _critical(self, bracket: _Bracket) -> _Bracket:
        """Leave out where L crosses the positive real axis, and where it cannot be next to -1."""
        ends = [self.log_and_slope(omega, bracket.loop)[0] for omega in (bracket.low, bracket.high)]
        negative = (np.cos(ends[0].imag) < 0) | (np.cos(ends[1].imag) < 0)
        largest, smallest = (pick(ends[0].real, ends[1].real) for pick in (np.fmax, np.fmin))
        # Of those below 1 only the largest counts, of those above only the smallest.
        below, above = np.full(self.count, -np.inf), np.full(self.count, np.inf)
        small, large = negative & (largest < 0), negative & (smallest > 0)
        np.maximum.at(below, bracket.loop[small], smallest[small])
        np.minimum.at(above, bracket.loop[large], largest[large])
        kept = negative & (largest >= below[bracket.loop] - 0.1)
        kept &= smallest <= above[bracket.loop] + 0.1
        return bracket.of(kept)

    def _solved(self, bracket: _Bracket, row: int) -> _Found:
        """Find a zero of a row of the motion in every bracket."""
        loop, low, high = bracket
        if not loop.size:
            return _Found(loop, low, np.empty(0, dtype=complex))
        few = _Loops(self.feedback, self.plants.of(loop))
        each = np.arange(loop.size)
        found = np.exp(
            bisect(lambda x: few.motion(np.exp(x), each)[row], np.log(low), np.log(high), WITHIN)
        )
        return _Found(loop, found, few.log_and_slope(found, each)[0])

    def _ends(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """L(0), and a and b of the circle a + b exp(-jωθ) that L(jω) tends to."""
        feedback, plants = self.feedback, self.plants
        num, den = ([factor for factor in factors] for factors in (feedback.zeros, feedback.poles))
        power = sum(f.zeros_at_origin for f in num) - sum(f.zeros_at_origin for f in den)
        level = np.ones(self.count)
        for factor in num:
            level = level * factor.without_origin.constant
        for factor in den:
            level = level / factor.without_origin.constant
        dc = np.empty(self.count)
        zeros, poles = (_zeros_at_origin(p) for p in (plants.num, plants.den))
        at = np.arange(self.count)
        level = level * plants.num[-1 - zeros, at] / plants.den[-1 - poles, at]
        order = power + zeros - poles
        dc = np.where(order > 0, 0.0, np.where(order < 0, np.inf, level))
        a, b = np.zeros(self.count), np.zeros(self.count)
        excess = feedback.numerator.degree + plants.num.shape[0]
        excess -= feedback.denominator.degree + plants.den.shape[0]
        if excess == 0:
            lead = feedback.numerator.q[0] * plants.num[0]
            limit = lead / (feedback.denominator.q[0] * plants.den[0])
            a, b = (a, limit) if self.late else (limit, b)
            if feedback.waits:
                a, b = np.full(self.count, np.nan), b
        return dc, a, b

    def _gain_margin(
        self, phase: _Found, dc: FloatArray, a: FloatArray, b: FloatArray
    ) -> FloatArray:
        low, high = np.zeros(self.count), np.full(self.count, np.inf)
        values = (np.exp(phase.log.real) * np.cos(phase.log.imag), dc, a - np.abs(b), a + np.abs(b))
        every = np.arange(self.count)
        for loop, value in zip((phase.loop, every, every, every), values, strict=True):
            critical = np.isfinite(value) & (value < 0)
            gains, which = -1 / value[critical], loop[critical]
            np.maximum.at(low, which[gains < 1], gains[gains < 1])
            np.minimum.at(high, which[gains > 1], gains[gains > 1])
        gm = np.where(low * high > 1, low, high)
        return np.where(np.isnan(a), np.nan, gm)

    def _rotations(
        self, gain: _Found, dc: FloatArray, a: FloatArray, b: FloatArray
    ) -> dict[str, FloatArray]:
        """Phase margin in degrees, and the delay margin."""
        angle = np.angle(-np.exp(1j * gain.log.imag))
        pm = np.full(self.count, np.inf)
        np.minimum.at(pm, gain.loop, np.abs(angle))
        at_zero = np.abs(np.abs(dc) - 1) <= ROUNDING
        pm = np.where(at_zero, np.minimum(pm, np.where(dc < 0, 0.0, pi)), pm)
        cosine = (1 + a * a - b * b) / (2 * a)
        at_end = (a != 0) & (np.abs(cosine) <= 1 + ROUNDING)
        pm = np.where(at_end, np.minimum(pm, pi - np.arccos(np.clip(cosine, -1, 1))), pm)
        margin = np.where(np.abs(a) + np.abs(b) >= 1, 0.0, np.inf)
        np.minimum.at(margin, gain.loop, np.mod(angle, 2 * pi) / gain.omega)
        lost = np.isnan(a)
        return {
            "pm": np.where(lost, np.nan, np.degrees(pm)),
            "delay_margin": np.where(lost, np.nan, margin),
        }

    def _closest(self, nearest: _Found, dc: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
        """Smallest ``|1 + L|``."""
        least = np.fmin(np.abs(1 + dc), np.abs(np.abs(1 + a) - np.abs(b)))
        np.minimum.at(least, nearest.loop, np.abs(1 + np.exp(nearest.log)))
        return np.where(np.isnan(a), np.nan, least)


class _Bracket(NamedTuple):
    """Intervals of frequency, each of one loop."""

    loop: IntArray
    low: FloatArray
    high: FloatArray

    def of(self, chosen: BoolArray) -> _Bracket:
        return _Bracket(*(column[chosen] for column in self))

    def joined(self, other: _Bracket) -> _Bracket:
        return _Bracket(*map(np.concatenate, zip(self, other, strict=True)))


def _frequencies(loops: _Loops) -> tuple[FloatArray, BoolArray]:
    """Frequencies that show all of every loop, and for which loops they do."""
    factors = loops.factors()
    ranges = [frequency_range(*factor) for factor in factors if factor[1].shape[0] > 1]
    inner = [(low[np.isfinite(low)], high[np.isfinite(high)]) for low, high, _ in ranges]
    low = min((low.min(initial=np.inf) for low, _ in inner), default=1.0)
    high = max((high.max(initial=0.0) for _, high in inner), default=1.0)
    count = int(np.clip(PER_OCTAVE * np.log2(high / low), 1, AT_MOST / 2))
    omega = np.geomspace(low, high, count + 1)
    trusted = np.ones(loops.count, dtype=bool)
    tested, unclear = np.zeros(0), np.zeros((loops.count, 0), dtype=bool)
    for _ in range(ROUNDS):
        clear = _clear(factors, omega[:-1], omega[1:], loops.count)
        late = _turning(loops, omega)
        split = ~clear.all(axis=0) | late
        if not split.any():
            unclear = ~clear
            break
        unclear = ~clear
        if omega.size + split.sum() > AT_MOST:
            break
        middle = np.sqrt(omega[:-1] * omega[1:])[split]
        omega = np.sort(np.concatenate([omega, middle]))
        tested = middle
    else:
        unclear = ~_clear(factors, omega[:-1], omega[1:], loops.count)
    del tested
    trusted &= ~unclear.any(axis=1)
    if late.any():
        trusted &= False
    # Beyond all roots little happens, but a size may still pass 1, and a phase creep to the axis.
    end = omega[-1] + 4 * pi / loops.plants.delay.max() if loops.late else 1e8 * omega[-1]
    below = omega[0] * np.geomspace(1e-8, 0.8, 25)
    return np.concatenate([below, omega, np.geomspace(omega[-1], end, 33)[1:]]), trusted


def _clear(
    factors: Sequence[tuple[list[ManyTerms], FloatArray]],
    left: FloatArray,
    right: FloatArray,
    count: int,
) -> BoolArray:
    """Tell around which stretches nothing vanishes, loop by loop."""
    centre, radius = (left + right) / 2, CLEAR * (right - left) / 2
    clear = np.ones((count, left.size), dtype=bool)
    for terms, scale in factors:
        clear &= zero_free(terms, scale, centre, radius)
    return clear


def _turning(loops: _Loops, omega: FloatArray) -> BoolArray:
    """Tell on which stretches a dead time turns some loop too far, that is not yet small there."""
    if not loops.late:
        return np.zeros(omega.size - 1, dtype=bool)
    size = loops.log_and_slope(omega[:-1], slice(None))[0].real
    turned = loops.plants.delay[:, None] * np.diff(omega)
    return np.asarray(((turned > RADIANS) & (size > np.log(SMALL))).any(axis=0))


def _changes(values: FloatArray, omega: FloatArray) -> _Bracket:
    """Intervals between neighbouring values of different sides."""
    differ = side(values[:, :-1]) != side(values[:, 1:])
    loop, k = np.nonzero(differ & (np.abs(values[:, :-1]) > NOISE))
    return _Bracket(loop, omega[k], omega[k + 1])


def _between(values: FloatArray, slopes: FloatArray, omega: FloatArray) -> _Bracket:
    """Intervals between values of the same side in which a smaller one may lie."""
    sides = side(values)
    nearing = sides * slopes
    loop, k = np.nonzero(
        (sides[:, :-1] == sides[:, 1:]) & (nearing[:, :-1] < 0) & (nearing[:, 1:] > 0)
    )
    return _Bracket(loop, omega[k], omega[k + 1])


def _deepest(motion: FloatArray, omega: FloatArray) -> _Bracket:
    """Intervals in which L may be nearest to -1."""
    retreat, distance = motion[RETREAT], motion[DISTANCE]
    least = np.fmin.reduce(distance, axis=1)[:, None] + SHALLOW
    near = np.fmin(distance[:, :-1], distance[:, 1:]) < least
    loop, k = np.nonzero((retreat[:, :-1] < 0) & (retreat[:, 1:] >= 0) & near)
    return _Bracket(loop, omega[k], omega[k + 1])


def _zeros_at_origin(p: FloatArray) -> IntArray:
    return np.argmax(p[::-1] != 0, axis=0)
