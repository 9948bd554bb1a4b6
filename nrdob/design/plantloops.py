r"""Peaks of the sensitivity of one process with many filters of a family, all at once.

.. math:: L = \frac{b\,N_f\,e^{-\theta s}}{a\,E - D N_m N_f\,e^{-\theta_m s}},

all polynomials in λ at each frequency, so that many λ are read in one array. The peaks are those of
`nrdob.analysis.margins`, found here for hundreds of loops, to see which of them come into question.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi

import numpy as np

from ..numerics import BoolArray, ComplexArray, FloatArray, IntArray
from .existence import roots_by_side
from .mismatch import Mismatch
from .mismatchgrid import Frequencies

__all__ = ["PlantLoops"]

EQUAL = 1e-13  # relative difference of two values that may be rounding
DEEPEST = 1.2  # a dip of ``|1 + L|`` may turn out the deepest if on the grid it is this close to it
FARTHER = 1.5  # how many times larger L may be beside a frequency of the grid
NARROW = 1e-9  # width of a resonance, against its frequency, below which its residue is looked at
NOISE = 1e-2  # relative rounding error of L, beside a root on the axis, that hides it
FAR, SPARSE = 10, 4  # decades beyond, and frequencies in each, for filters so slow or fast
WITHIN, BESIDE = 3.0, 25  # how far beside a resonance of L, in widths, at how many frequencies
FOUND = 8  # steps in which such a resonance is found
ZOOMS, ACROSS = 6, 9  # how often a dip is looked at more closely, and at how many frequencies
SETTLED = 1e-5  # relative difference of three values from which they lie on a parabola
AT_ONCE = 400_000  # values of L that are held at a time


@dataclass(frozen=True, eq=False)
class PlantLoops:
    """The plant loops L of one process and model with all filters of a family, at frequencies."""

    mismatch: Mismatch
    omega: FloatArray

    @classmethod
    def above(cls, frequencies: Frequencies, slowest: float, gain: float = 1.0) -> PlantLoops:
        """Choose the frequencies for all λ from the smallest of interest on, up to a gain of L."""
        mismatch, omega = frequencies.mismatch, frequencies.above(slowest, gain)
        far = np.logspace(0, FAR, FAR * SPARSE + 1)[1:]
        above = omega[:0] if mismatch.longest_delay else omega[-1] * far
        omega = np.concatenate([omega[0] / far[::-1], omega, above])
        with np.errstate(over="ignore", invalid="ignore"):
            noise, size = mismatch.uncertainty(omega)[-1], np.abs(mismatch.coefficients(omega)[-1])
        return cls(mismatch, omega[noise < NOISE * size])

    def distances(self, time_constants: FloatArray, limit: float) -> tuple[FloatArray, FloatArray]:
        """How near to -1 stable loops come, 1/Ms, and how far ln λ may surely change.

        So far ``|1 + L|`` neither falls nor rises to the limit at the frequencies of the grid.
        """
        rows = max(1, AT_ONCE // self.omega.size)
        parts = [
            self._distances(time_constants[k : k + rows], limit)
            for k in range(0, max(1, time_constants.size), rows)
        ]
        least, reach = (np.concatenate(part) for part in zip(*parts, strict=True))
        return least, reach

    def _distances(self, time_constants: FloatArray, limit: float) -> list[FloatArray]:
        distance, size = self._distance_and_size(time_constants[:, None], self.omega)
        ends = np.minimum(self.at_infinity(time_constants), self._at_zero(time_constants))
        least = np.minimum(np.minimum(distance.min(axis=1), ends), self.at_poles(time_constants))
        loop, beside = self._beside_turns(time_constants)
        near, large = self._distance_and_size(time_constants[loop, None], beside)
        np.minimum.at(least, loop, near.min(axis=1))

        def off(row: IntArray, omega: FloatArray) -> FloatArray:
            return self._distance_and_size(time_constants[row, None], omega)[0]

        row, column = np.nonzero(_dips(distance, size, least))
        at, k = np.nonzero(_dips(near, large, least[loop]))
        low, high = (np.append(self.omega[column + step], beside[at, k + step]) for step in (0, 2))
        _lower(least, off, np.append(row, loop[at]), low, high)
        # |dL/d ln λ| is about the number of lags times |L|, at most.
        with np.errstate(all="ignore"):
            spare = np.nanmin((distance - limit) / size, axis=1)
            np.fmin.at(spare, loop, ((near - limit) / large).min(axis=1))
        reach = np.log1p(np.abs(spare)) / (len(self.mismatch.E) - 1)
        return [np.maximum(least, 1e-300), reach]

    def _beside_turns(self, time_constants: FloatArray) -> tuple[IntArray, FloatArray]:
        """Loops, (m,), and frequencies, (m, BESIDE), where L may hide a narrow resonance.

        There 1 - F exp(-θm s) is small, before each whole turn of the model's dead time.
        """
        delay, k = self.mismatch.model_delay, time_constants.size
        if not delay:
            return np.empty(0, dtype=int), np.empty((0, BESIDE))
        turns = 2 * pi / delay * np.arange(1, self.omega[-1] * delay / (2 * pi) + 2)
        omega = np.tile(turns, (k, 1))
        with np.errstate(all="ignore"):
            for step in range(FOUND + 1):
                ahead, behind, delayed = self.mismatch.terms(omega, time_constants[:, None])
                around = -delayed / ahead
                if step < FOUND:
                    omega = omega + np.nan_to_num(np.angle(around)) / delay
                    omega = np.clip(omega, turns - pi / delay, turns + pi / delay)
            R, least = np.abs(behind / ahead), np.abs(1 - around)
            # Wider ones the frequencies of the grid show.
            loop, which = np.nonzero((least < 4 * R) & (R + least < 1))
        centre, width = omega[loop, which], (R + least)[loop, which] / delay
        share = np.linspace(-WITHIN, WITHIN, BESIDE)
        beside = centre[:, None] + np.minimum(width, centre / (2 * WITHIN))[:, None] * share
        return loop, np.asarray(beside)

    def _distance_and_size(
        self, time_constants: FloatArray, omega: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """``|1 + L|`` and ``|L|`` at points (ω, λ); infinite at a pole of L."""
        with np.errstate(all="ignore"):  # far beyond all speeds powers overflow, and L is 0
            ahead, behind, delayed = self.mismatch.terms(omega, time_constants)
            L = behind / (ahead + delayed if self.mismatch.model_delay else ahead)
        L = np.where(np.isfinite(L), L, inf + 0j)
        return np.abs(1 + L), np.abs(L)

    def at_infinity(self, time_constants: FloatArray) -> FloatArray:
        """Limit of ``|1 + L|`` at infinite frequency, with dead time at its worst."""
        with np.errstate(all="ignore"):
            ahead, behind, delayed = self.mismatch.highest(time_constants)
            last = np.nan_to_num(behind / ahead, nan=0.0)
            if self.mismatch.longest_delay:  # a circle
                last = -np.abs(last) / (1 - np.abs(delayed / ahead))
        return np.abs(1 + last)

    def _at_zero(self, time_constants: FloatArray) -> FloatArray:
        """``|1 + L(0)|``; finite if an integrator of the model alone cancels."""
        with np.errstate(all="ignore"):
            ahead, behind, delayed = self.mismatch.lowest(time_constants)
            return np.abs(1 + np.nan_to_num(behind / (ahead + delayed), nan=inf, neginf=inf))

    def at_poles(self, time_constants: FloatArray) -> FloatArray:
        """Smallest ``|1 + L|`` beside poles of R on the axis too narrow for the grid.

        There L = ρ/(j(ω - ω0)) is a straight line through 0.
        """
        distances = np.ones(time_constants.shape)
        _, D, Nm, _ = self.mismatch.factors
        axis = roots_by_side(D, Nm)[1]
        for root in axis[axis.imag > 0].tolist():
            with np.errstate(all="ignore"):
                residue = self._residue(time_constants, root)
                size = np.abs(residue)
                along = np.abs(residue.real) / size
            narrow = (size > 0) & (size <= NARROW * abs(root))
            distances = np.where(narrow, np.minimum(distances, along), distances)
        return distances

    def _residue(self, time_constants: FloatArray, root: complex) -> ComplexArray:
        """Residue ρ of each loop at a pole of R on the axis."""
        mismatch = self.mismatch
        powers = time_constants ** np.arange(len(mismatch.E))[:, None]
        E, Nf = (np.polyval(table.T, root) @ powers for table in (mismatch.E, mismatch.Nf))
        ahead = np.polyval(np.polyder(mismatch.a), root) * E
        if mismatch.model_delay:
            delayed = np.polyval(np.polyder(mismatch.delayed), root)
            ahead = ahead - delayed * Nf * np.exp(-mismatch.model_delay * root)
        behind = np.polyval(mismatch.b, root) * np.exp(-mismatch.delay * root) * Nf
        return np.asarray(behind / ahead)


def _dips(distance: FloatArray, size: FloatArray, least: FloatArray) -> BoolArray:
    """Tell at which inner frequencies, one row for each loop, the smallest distance may be."""
    # Of two frequencies a rounding error apart both are dips: the true one lies on either side.
    inner = distance[:, 1:-1] * (1 - EQUAL)
    dips = (inner <= distance[:, :-2]) & (inner <= distance[:, 2:])
    dips &= (inner <= DEEPEST * least[:, None]) & (1 - FARTHER * size[:, 1:-1] < least[:, None])
    return np.asarray(dips)


def _lower(
    least: FloatArray,
    function: Callable[[IntArray, FloatArray], FloatArray],
    row: IntArray,
    low: FloatArray,
    high: FloatArray,
) -> None:
    """Lower the smallest value of each loop to that between each `low` and `high`.

    Ever more closely around the lowest of some values, until they lie on a parabola: this, and a
    kink, is below the middle one by at most half of what the others rise from it.
    """
    share = np.linspace(0, 1, ACROSS)
    for _ in range(ZOOMS):
        if not row.size:
            break
        omega = low[:, None] + share * (high - low)[:, None]
        values = function(row, omega)
        k, rows = np.clip(values.argmin(axis=1), 1, ACROSS - 2), np.arange(low.size)
        before, middle, after = (values[rows, k + i] for i in (-1, 0, 1))
        lowest, beside = values.min(axis=1), np.maximum(before, after)
        settled = beside - lowest <= SETTLED * lowest
        with np.errstate(all="ignore"):
            drop = np.nan_to_num((before - after) ** 2 / (before - 2 * middle + after) / 8)
            np.minimum.at(least, row, np.where(settled & (middle <= lowest), lowest - drop, lowest))
            open_yet = ~settled & ~(lowest - (beside - lowest) > least[row])
        row, low, high = (of[open_yet] for of in (row, omega[rows, k - 1], omega[rows, k + 1]))
