r"""How far the plant loops of many filters are from a specification, all at once.

The mismatch R does not depend on the filter, so that :math:`L = R/((1 + j\lambda\omega)^n - 1)` is
read at all frequencies for all time constants in one array. What `nrdob.analysis.margins` finds for
one loop with all care is found here for hundreds, to find out which comes closest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import comb, inf, isfinite, log

import numpy as np

from ..analysis import Margins
from ..numerics import ComplexArray, FloatArray, IntArray, is_real
from .existence import roots_by_side
from .mismatch import Mismatch
from .mismatchgrid import Frequencies

__all__ = ["NARROW", "UNSTABLE", "PlantLoops", "Specification"]

UNSTABLE = -10.0
"""Slack given to a loop that is not stable, below that of any stable one tried."""

EQUAL = 1e-13
"""Relative difference of two values that may be rounding."""

DEEPEST = 1.2
"""A dip of ``|1 + L|`` may turn out the deepest if on the grid it is this close to it."""

NARROW = 1e-9
"""Width of a resonance, against its frequency, below which it is looked at by itself."""

ZOOMS, ACROSS = 6, 9
"""How often a dip or a zero is looked at more closely, and at how many frequencies."""


@dataclass(frozen=True)
class Specification:
    """What is asked of the plant loop; at least one of the three.

    Attributes
    ----------
    max_ms, min_gm_db, min_pm_deg : float or None
        As for `nrdob.design_filter`.
    """

    max_ms: float | None = None
    min_gm_db: float | None = None
    min_pm_deg: float | None = None

    def __post_init__(self) -> None:
        for name in ("max_ms", "min_gm_db", "min_pm_deg"):
            value = getattr(self, name)
            if value is not None and (not is_real(value)):
                raise TypeError(f"{name} is {value!r}; give a real number, or None")
        if self.max_ms is None and self.min_gm_db is None and self.min_pm_deg is None:
            raise ValueError(
                "nothing is specified; give max_ms, min_gm_db or min_pm_deg, for example max_ms=1.7"
            )
        if self.max_ms is not None and not 1 < self.max_ms < inf:
            raise ValueError(
                f"max_ms is {self.max_ms}; |S_d| tends to 1 at high frequency, so its peak cannot "
                "be held to 1 or less: give a number above 1, for example 1.7"
            )
        if self.min_gm_db is not None and not (isfinite(self.min_gm_db) and self.min_gm_db > 0):
            raise ValueError(
                f"min_gm_db is {self.min_gm_db}; it is how far the gain may move either way, in "
                "dB: give a positive number, for example 6"
            )
        if self.min_pm_deg is not None and not 0 < self.min_pm_deg < 180:
            raise ValueError(
                f"min_pm_deg is {self.min_pm_deg}; give an angle between 0 and 180 degrees, for "
                "example 45"
            )

    @property
    def smallest_gain(self) -> float:
        """Size of L below which nothing is forbidden."""
        near_1 = 1 - 1 / self.max_ms if self.max_ms else 1.0
        return min(near_1, 10 ** (-self.min_gm_db / 20) if self.min_gm_db else 1.0)

    def slack(self, found: Margins) -> float:
        """By how much a loop meets the specification; negative where it does not.

        Parameters
        ----------
        found : Margins
            Of its plant loop.
        """
        if not found.stable:
            return UNSTABLE
        slacks = self.slacks(*(np.array([x]) for x in (found.ms, abs(found.gm_db), found.pm)))
        return float(slacks[0])

    def of_many(self, loops: PlantLoops, time_constants: FloatArray) -> FloatArray:
        """Slacks of stable loops with given time constants.

        Parameters
        ----------
        loops : PlantLoops
            The loops of one mismatch.
        time_constants : (k,) array of float
            In seconds.
        """
        L = loops.gains(time_constants)
        nothing = np.full(time_constants.shape, inf)
        ms = loops.peaks(time_constants, L) if self.max_ms else nothing
        gm = loops.gain_margins(time_constants, L) if self.min_gm_db else nothing
        pm = loops.phase_margins(time_constants, L) if self.min_pm_deg else nothing
        return self.slacks(ms, gm, pm)

    def slacks(self, ms: FloatArray, gm_db: FloatArray, pm: FloatArray) -> FloatArray:
        """Take the smallest slack of those asked for, within ±10.

        Parameters
        ----------
        ms, gm_db, pm : (k,) array of float
            Margins of stable loops; the gain margin as a size in dB.
        """
        slacks = [np.full(ms.shape, -UNSTABLE)]
        if self.max_ms is not None:
            slacks.append(log(self.max_ms) - np.log(ms))
        if self.min_gm_db is not None:
            slacks.append((gm_db - self.min_gm_db) / 20)
        if self.min_pm_deg is not None:
            slacks.append((pm - self.min_pm_deg) / 60)
        return np.asarray(np.maximum(np.min(slacks, axis=0), UNSTABLE))

    def __str__(self) -> str:
        given = {"Ms ≤ %g": self.max_ms, "GM ≥ %g dB": self.min_gm_db, "PM ≥ %g°": self.min_pm_deg}
        return ", ".join(text % value for text, value in given.items() if value is not None)


@dataclass(frozen=True, eq=False)
class PlantLoops:
    """The plant loops L of one mismatch with all filters of its order.

    Attributes
    ----------
    mismatch : Mismatch
        The ratio R and the order.
    omega : (N,) array of float
        Frequencies that hold all there is to see, in rad/s.
    """

    mismatch: Mismatch
    omega: FloatArray

    @classmethod
    def of(cls, frequencies: Frequencies, slowest: float) -> PlantLoops:
        """Choose the frequencies for all time constants from the smallest of interest on."""
        return cls(frequencies.mismatch, frequencies.above(slowest))

    @cached_property
    def _ratio(self) -> ComplexArray:
        return self.mismatch.ratio(self.omega)

    def gains(self, time_constants: FloatArray) -> ComplexArray:
        """L on the grid, shape (k, N)."""
        return self._gain(time_constants[:, None], self.omega, self._ratio)

    def peaks(self, time_constants: FloatArray, L: ComplexArray) -> FloatArray:
        """Peak of the sensitivity of each loop, the limit at infinite frequency included."""
        distance = np.abs(1 + L)
        ends = self._at_infinity(time_constants, near=True)
        _, beside = self._beside_poles(time_constants)
        least = np.minimum(distance.min(axis=1), np.minimum(ends, beside))
        # Of two frequencies a rounding error apart both are dips: the true one lies on either side.
        inner = distance[:, 1:-1] * (1 - EQUAL)
        dips = (inner <= distance[:, :-2]) & (inner <= distance[:, 2:])
        row, column = np.nonzero(dips & (inner <= DEEPEST * least[:, None]))
        low, high = self.omega[column], self.omega[column + 2]

        def off(row: IntArray, omega: FloatArray) -> FloatArray:
            return np.abs(1 + self._gain(time_constants[row, None], omega))

        _lower(least, off, row, low, high)
        return np.asarray(1 / np.maximum(least, 1e-300))

    def phase_margins(self, time_constants: FloatArray, L: ComplexArray) -> FloatArray:
        """Smallest rotation of each loop gain at which it is lost, in degrees."""
        with np.errstate(divide="ignore"):
            size = np.log(np.abs(L))
        row, there = self._crossings(time_constants, size, lambda value: np.abs(value) - 1)
        angles, _ = self._beside_poles(time_constants)
        np.minimum.at(angles, row, np.degrees(np.abs(np.angle(-there))))
        return np.asarray(angles)

    def gain_margins(self, time_constants: FloatArray, L: ComplexArray) -> FloatArray:
        """Smallest change of gain, up or down, at which each loop is lost, in dB."""
        row, there = self._crossings(time_constants, L.imag, lambda value: value.imag)
        row, there = row[there.real < 0], there[there.real < 0]
        gains = np.full(time_constants.shape, inf)
        np.minimum.at(gains, row, 20 * np.abs(np.log10(np.abs(there))))
        ends = self._at_infinity(time_constants, near=False), self._at_zero(time_constants)
        with np.errstate(divide="ignore"):
            return np.asarray(
                np.min([gains, *(20 * np.abs(np.log10(end)) for end in ends)], axis=0)
            )

    def _gain(
        self, time_constants: FloatArray, omega: FloatArray, ratio: ComplexArray | None = None
    ) -> ComplexArray:
        """L = R/((1 + jλω)^n - 1), whose denominator keeps its zero at ω = 0."""
        n = self.mismatch.order
        jx = 1j * time_constants * omega
        den = np.ones_like(jx)
        for k in range(n - 1, 0, -1):
            den = den * jx + comb(n, k)
        R = self.mismatch.ratio(omega) if ratio is None else ratio
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            L = R / (den * jx)
        return np.where(np.isfinite(L), L, inf + 0j)  # at a pole

    def _at_infinity(self, time_constants: FloatArray, *, near: bool) -> FloatArray:
        """Limit of ``|1 + L|``, or size of L where it is negative, at infinite frequency."""
        mismatch = self.mismatch
        if mismatch.excess < mismatch.order:
            return np.full(time_constants.shape, 1.0 if near else 0.0)
        last = float(mismatch.b[0] / mismatch.a[0]) / time_constants**mismatch.order
        last = -np.abs(last) if mismatch.delay else last  # a circle around 0
        return np.asarray(np.abs(1 + last) if near else np.maximum(-last, 0.0))

    def _at_zero(self, time_constants: FloatArray) -> FloatArray:
        """Size of L(0) where it is negative; finite if an integrator of the model alone cancels."""
        mismatch = self.mismatch
        if not mismatch.integrator:
            return np.zeros(time_constants.shape)
        slope = float(mismatch.delayed[-1] / mismatch.a[-1]) / mismatch.order
        return np.asarray(np.maximum(-slope / time_constants, 0.0))

    def _beside_poles(self, time_constants: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Smallest phase margin, in degrees, and ``|1 + L|`` beside poles of R on the axis.

        There L = ρ/(j(ω - ω0)) is a straight line through 0. It is looked at here where |ρ| is so
        small that the frequencies of the grid are too far apart to show it.
        """
        angles, distances = (np.full(time_constants.shape, end) for end in (inf, 1.0))
        for root in self._undamped.tolist():
            residue = self._residue(time_constants, root)
            size = np.abs(residue)
            narrow = (size > 0) & (size <= NARROW * abs(root))
            with np.errstate(divide="ignore", invalid="ignore"):
                along = np.abs(residue.real) / size
            distances = np.where(narrow, np.minimum(distances, along), distances)
            angle = np.degrees(np.arcsin(np.minimum(along, 1.0)))
            angles = np.where(narrow, np.minimum(angles, angle), angles)
        return angles, distances

    def _residue(self, time_constants: FloatArray, root: complex) -> ComplexArray:
        """Residue ρ of each loop at a pole of R on the axis."""
        mismatch = self.mismatch
        residue = np.polyval(mismatch.b, root) * np.exp(-mismatch.delay * root)
        residue = residue / np.polyval(np.polyder(mismatch.a), root)
        return np.asarray(residue / ((1 + time_constants * root) ** mismatch.order - 1))

    @cached_property
    def _undamped(self) -> ComplexArray:
        """Poles of R on the positive imaginary axis."""
        _, D, Nm, _ = self.mismatch.factors
        axis = roots_by_side(D, Nm)[1]
        return axis[axis.imag > 0]

    def _crossings(
        self,
        time_constants: FloatArray,
        values: FloatArray,
        function: Callable[[ComplexArray], FloatArray],
    ) -> tuple[IntArray, ComplexArray]:
        """Find where a function of L changes sign, and L there.

        Returns
        -------
        row : array of int
            Number of the loop.
        there : array of complex
            Its L.
        """
        before, after = values[:, :-1], values[:, 1:]
        row, column = np.nonzero((before >= 0) != (after >= 0))
        chosen = time_constants[row, None]
        low, high = self.omega[column], self.omega[column + 1]
        where = _zero(lambda w: function(self._gain(chosen, w)), low, high)
        return row, self._gain(chosen[:, 0], where)


def _lower(
    least: FloatArray,
    function: Callable[[IntArray, FloatArray], FloatArray],
    row: IntArray,
    low: FloatArray,
    high: FloatArray,
) -> None:
    """Lower the smallest value of each loop to that between each `low` and `high`.

    By looking ever more closely where it may still be lower: between three values of which the
    middle one is lowest, a parabola and a kink lie below that by at most half of what they rise
    from it.
    """
    share = np.linspace(0, 1, ACROSS)
    for _ in range(ZOOMS):
        omega = low[:, None] + share * (high - low)[:, None]
        values = function(row, omega)
        k, rows = np.clip(values.argmin(axis=1), 1, ACROSS - 2), np.arange(low.size)
        lowest, beside = values.min(axis=1), np.maximum(values[rows, k - 1], values[rows, k + 1])
        np.minimum.at(least, row, lowest)
        with np.errstate(invalid="ignore"):
            open_yet = ~(lowest - (beside - lowest) > least[row])
        row, low, high = (of[open_yet] for of in (row, omega[rows, k - 1], omega[rows, k + 1]))


def _zero(
    function: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray
) -> FloatArray:
    """Zero between each `low` and `high`, on which the sides differ, by looking ever more closely.

    A dozen calls of a function with many frequencies each are faster than fifty with a few.
    """
    share, rows = np.linspace(0, 1, ACROSS), np.arange(low.size)
    for _ in range(ZOOMS):
        omega = low[:, None] + share * (high - low)[:, None]
        values = function(omega)
        k = np.argmax((values[:, 1:] >= 0) != (values[:, :1] >= 0), axis=1)
        low, high = omega[rows, k], omega[rows, k + 1]
    before, after = values[rows, k], values[rows, k + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        at = np.nan_to_num(before / (before - after), nan=0.5, posinf=0.5, neginf=0.5)
    return np.asarray(low + at * (high - low))
