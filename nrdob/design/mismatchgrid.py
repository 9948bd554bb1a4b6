"""Frequencies at which a mismatch is looked at, so that nothing hides between two of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from ..numerics import FloatArray, QuasiPolynomial, add
from .columns import last_root, none_beyond, positive_roots
from .mismatch import Mismatch

__all__ = ["Frequencies"]

PER_DECADE, DECADES = 16, 5  # density of frequencies, how far beyond all poles and zeros
FARTHER, SPARSE = 10, 4  # decades beyond, and frequencies in each, where R is a power of s
NARROWEST = 4 * float(np.finfo(float).eps)  # relative width looked at beside an undamped root
LAST_DECADE = 40.0  # frequencies beyond 10^40 rad/s, or below 10^-40, are not looked at
PER_TURN = 24  # frequencies to each turn of the dead time

MAX_FREQUENCIES = 2_000_000

TURNS = 32  # turns of the dead time over which the default floor resolves critical λ
FASTEST = 1000  # how many times faster than the dead time a filter of the default range may be


@dataclass(frozen=True, eq=False)
class Frequencies:
    """The frequencies for one mismatch."""

    mismatch: Mismatch

    @cached_property
    def base(self) -> FloatArray:
        """Frequencies over the whole range of R, dense where a pole or zero is near the axis."""
        mismatch = self.mismatch
        roots = mismatch.roots
        if not mismatch.longest_delay:  # a zero of H turns its phase as fast
            difference = QuasiPolynomial(add(mismatch.b, -mismatch.a))
            roots = np.append(roots, difference.without_origin.roots)
        sizes = np.append(np.abs(roots), mismatch.speeds)
        first, last = self._far_crossings
        low = min(np.log10(sizes.min()) - DECADES, first - 1)
        high = max(np.log10(sizes.max()) + DECADES, last + 1)
        grids: list[FloatArray] = [np.logspace(low, high, int(PER_DECADE * (high - low)) + 1)]
        for root in roots[roots.imag >= 0]:
            narrowest = NARROWEST if root.imag else 1e-8
            width = max(abs(root.real), narrowest * abs(root))
            steps = np.geomspace(0.1 * width, abs(root), int(8 * np.log10(abs(root) / width)) + 9)
            grids += [root.imag + steps, root.imag - steps]
        near = np.unique(np.concatenate(grids))
        near = near[near >= 10**low]
        near = near[~mismatch.at_pole(near)]
        if mismatch.family.is_binomial:
            return np.asarray(near)
        beyond = np.geomspace(1, 10.0**FARTHER, FARTHER * SPARSE + 1)[1:]
        omega = np.concatenate([near[0] / beyond[::-1], near, near[-1] * beyond])
        return np.asarray(omega[np.abs(np.log10(omega)) < LAST_DECADE])

    @cached_property
    def _far_crossings(self) -> tuple[float, float]:
        """Decades of ω below and above which a large R cannot bring λ(ω) to the real axis any more.

        Where R ≈ c s^m, λ jω may run along the imaginary axis but for an angle of (largest root)/ω.
        """
        mismatch = self.mismatch
        n, speeds = mismatch.family.order, mismatch.speeds
        slowest, fastest = np.log10(speeds.min()), np.log10(speeds.max())
        first, last = slowest, fastest
        m, size = mismatch.excess, np.log10(abs(mismatch.b[0] / mismatch.a[0]))
        if 0 <= m < n:
            last = min((size / n + fastest) * n / (n - m), LAST_DECADE)
        b, a = (np.trim_zeros(p, "b") for p in (mismatch.b, mismatch.a))  # the lowest terms last
        m, size = m - (b.size - a.size), np.log10(abs(b[-1] / a[-1]))
        if -n < m <= 0:
            first = max((slowest - size / n) * n / (n + m), -LAST_DECADE)
        return first, last

    @cached_property
    def lowest_floor(self) -> float:
        """Smallest time constant down to which sets are complete by default, in seconds."""
        mismatch = self.mismatch
        longest = mismatch.longest_delay
        if not longest:
            return 0.0
        last = 2 * pi * TURNS / longest
        beyond = np.append(last, self.base[self.base > last])
        highest = float(last_root(mismatch.off_gain(beyond)).max())
        return max(highest, longest / FASTEST, 1.001 * self.neutral_limit)

    @cached_property
    def neutral_limit(self) -> float:
        """λ below which a dead time leaves infinitely many unstable roots; 0 if there is none."""
        delay, model_delay = self.mismatch.delay, self.mismatch.model_delay
        ahead, behind, delayed = (p[::-1] for p in self.mismatch.leading())
        least = ahead + (delay == 0) * behind
        # Those with dead time are all multiples of the same polynomial in λ.
        most = (delay > 0) * np.abs(behind) + np.abs(delayed)
        if delay == model_delay:
            most = (delay > 0) * np.abs(behind + delayed)
        if not most.any():
            return 0.0
        square = np.trim_zeros(np.convolve(least, least) - np.convolve(most, most), "f")
        if not square.size or square[0] < 0:
            raise ValueError(
                "with dead time every slow filter of this family leaves infinitely many roots in "
                "the right half plane: take one of higher relative degree"
            )
        return float(positive_roots(square).max(initial=0.0))

    def above(self, floor: float, gain: float = 1.0) -> FloatArray:
        """Frequencies at which λ above a floor may be critical, or L as large as a gain."""
        omega = self.base
        longest = self.mismatch.longest_delay
        if not longest:
            return omega
        columns = self.mismatch.off_gain(omega, gain)
        # Roots are dear: at most frequencies a bound tells that there is none beyond the floor.
        possible = np.flatnonzero(~none_beyond(columns, floor))
        found = possible[last_root(columns[:, possible]) > floor]
        last = omega[min(found.max(initial=-1) + 1, omega.size - 1)]
        step = 2 * pi / (longest * PER_TURN)
        if last > step * MAX_FREQUENCIES or last == omega[-1]:
            raise ValueError(
                f"floor is {floor:g} s; down to it the dead time of {longest:g} s "
                f"would have to be followed up to {last:.3g} rad/s: choose a larger one, or None "
                "for the default"
            )
        turns = np.arange(step, last, step)
        return np.union1d(omega[omega <= last], turns[~self.mismatch.at_pole(turns)])
