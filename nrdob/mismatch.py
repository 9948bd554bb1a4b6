"""What every question about filters starts from: process over model, nothing cancelled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, pi
from typing import Any

import numpy as np

from .blocks import ComplexArray, FloatArray, as_fraction
from .equations import ObserverEquations
from .filters import LowPassFilter
from .quasipoly import QuasiPolynomial, add

PER_DECADE, DECADES = 16, 5
"""Density of the frequencies, and how far they reach below and above all poles and zeros."""

LAST_DECADE = 40.0
"""Frequencies beyond 10^40 rad/s, or below 10^-40, are not looked at."""

PER_TURN = 24
"""Frequencies to each turn of the dead time."""

TURNS = 32
"""Turns of the dead time over which the default floor resolves the critical time constants."""

FASTEST = 1000
"""How many times faster than the dead time a filter of the default range may be."""

MAX_FREQUENCIES = 2_000_000


@dataclass(frozen=True, eq=False)
class Mismatch:
    """The ratio R = G/G̃ = b/a · exp(-θs) and the order of the filter.

    Attributes
    ----------
    a, b : array of float
        D·Nm and N·Dm.
    delay : float
        θ in seconds.
    order : int
        n.
    factors : tuple of arrays
        N, D, Nm and Dm, whose roots say where R changes.
    """

    a: FloatArray
    b: FloatArray
    delay: float
    order: int
    factors: tuple[FloatArray, ...]

    @classmethod
    def of(cls, process: Any, model: Any, order: int | None = None) -> Mismatch:
        """Read process and model as the loop does, with the same refusals.

        Without an order, the lowest that is causal.
        """
        if order is None:
            order = max(1, as_fraction(model, "model").relative_degree)
        loop = ObserverEquations(process, model, LowPassFilter(1.0, order))
        G, Gm = loop.fractions.G, loop.fractions.Gm
        a, b = np.convolve(G.den, Gm.num), np.convolve(G.num, Gm.den)
        return cls(a, b, loop.delay, int(order), (*G, *Gm))

    @cached_property
    def roots(self) -> ComplexArray:
        """Poles and zeros of R, before any cancellation, without those at s = 0."""
        found = [QuasiPolynomial(p).without_origin.roots for p in self.factors]
        return np.concatenate([*found, np.empty(0, dtype=complex)])

    @cached_property
    def excess(self) -> int:
        """By how much the numerator degree of R exceeds the denominator's."""
        return int(self.b.size - self.a.size)

    @cached_property
    def neutral_limit(self) -> float:
        """λ below which a dead time leaves infinitely many roots on the right; 0 if there is none.

        There F·R is not strictly proper, and its gain at infinite frequency exceeds 1.
        """
        if self.excess < self.order:
            return 0.0
        return float(abs(self.b[0] / self.a[0]) ** (1 / self.order))

    def ratio(self, omega: FloatArray) -> ComplexArray:
        """R(jω)."""
        s = 1j * omega
        with np.errstate(divide="ignore", invalid="ignore"):  # at a pole on the axis
            R = np.polyval(self.b, s) / np.polyval(self.a, s)
            return np.asarray(R * np.exp(-self.delay * s) if self.delay else R)

    def noise(self, omega: FloatArray) -> FloatArray:
        """Bound the rounding error of R(jω), which near a zero on the axis exceeds R itself."""
        with np.errstate(divide="ignore"):
            size = np.polyval(np.abs(self.b), omega) / np.abs(np.polyval(self.a, 1j * omega))
        # The angle ωθ of the dead time is rounded in proportion to its size.
        return np.asarray(np.finfo(float).eps * size * (64 + 8 * self.delay * omega))

    def p_B(self, time_constant: float) -> QuasiPolynomial:
        """Characteristic function for one filter."""
        undelayed = self.undelayed(time_constant)
        scale = add(
            np.convolve(np.abs(self.a), _den_less_1(time_constant, self.order)), np.abs(self.b)
        )
        return QuasiPolynomial(undelayed, self.b, self.delay, scale)

    def undelayed(self, time_constant: float) -> FloatArray:
        """Coefficients of D Nm (Df - 1)."""
        return np.convolve(self.a, _den_less_1(time_constant, self.order))

    def largest_time_constant(self, omega: FloatArray) -> FloatArray:
        """Bound of the critical λ at a frequency, from ``|1 + jλω|^n = |H| <= 1 + |R|``."""
        size = np.abs(self.ratio(omega))
        return np.asarray(np.sqrt((1 + size) ** (2 / self.order) - 1) / omega)

    @cached_property
    def _base_frequencies(self) -> FloatArray:
        """Frequencies over the whole range of R, dense where a pole or zero is near the axis."""
        roots = self.roots
        if not self.delay:  # a zero of H turns its phase as fast
            difference = add(self.b, -self.a)
            if difference.any():
                roots = np.append(roots, QuasiPolynomial(difference).without_origin.roots)
        sizes = np.append(np.abs(roots), self.speeds)
        first, last = self._far_crossings
        low = min(np.log10(sizes.min()) - DECADES, first - 1)
        high = max(np.log10(sizes.max()) + DECADES, last + 1)
        grids: list[FloatArray] = [np.logspace(low, high, int(PER_DECADE * (high - low)) + 1)]
        for root in roots[roots.imag >= 0]:
            width = max(abs(root.real), 1e-8 * abs(root))
            steps = np.geomspace(0.1 * width, abs(root), int(8 * np.log10(abs(root) / width)) + 9)
            grids += [root.imag + steps, root.imag - steps]
        omega = np.unique(np.concatenate(grids))
        at_pole = np.polyval(self.a, 1j * omega) == 0
        return np.asarray(omega[(omega >= 10**low) & ~at_pole])

    @cached_property
    def _far_crossings(self) -> tuple[float, float]:
        """Decades of ω below and above which a large R cannot cross Re w = 1 any more.

        Where R ≈ c s^m is large, a branch of size |c|^(1/n) ω^(m/n) may run along the imaginary
        axis but for an angle of about (largest root)/ω, or ω/(smallest root) at low frequency.
        """
        n, slowest, fastest = self.order, np.log10(self.speeds.min()), np.log10(self.speeds.max())
        first, last = slowest, fastest
        m, size = self.excess, np.log10(abs(self.b[0] / self.a[0]))
        if 0 <= m < n:
            last = min((size / n + fastest) * n / (n - m), LAST_DECADE)
        (b0, zeros), (a0, poles) = (_lowest_term(p) for p in (self.b, self.a))
        m, size = zeros - poles, np.log10(abs(b0 / a0))
        if -n < m <= 0:
            first = max((slowest - size / n) * n / (n + m), -LAST_DECADE)
        return first, last

    @cached_property
    def speeds(self) -> FloatArray:
        """Sizes of all roots, and one over the dead time, in rad/s; 1 where there is neither."""
        sizes = np.append(np.abs(self.roots), 1 / self.delay if self.delay else [])
        return sizes if sizes.size else np.ones(1)

    @cached_property
    def default_floor(self) -> float:
        """Time constant down to which the critical ones are looked for, see `timeconstants`."""
        if not self.delay:
            return 0.0
        last = 2 * pi * TURNS / self.delay
        beyond = np.append(last, self._base_frequencies[self._base_frequencies > last])
        highest = float(self.largest_time_constant(beyond).max())
        return max(highest, self.delay / FASTEST, 1.001 * self.neutral_limit)

    def checked_floor(self, floor: float | None) -> float:
        """Return the floor asked for, or the default; ValueError for one that cannot be."""
        if floor is None:
            return self.default_floor
        if not (isfinite(floor) and floor > 0):
            raise ValueError(
                f"floor is {floor}; it is the smallest time constant of interest, in seconds: "
                "positive and finite, or None"
            )
        if self.delay and floor <= self.neutral_limit:
            raise ValueError(
                f"floor is {floor:g} s, but with dead time and order {self.order} every time "
                f"constant up to {self.neutral_limit:.6g} s leaves infinitely many roots in the "
                "right half plane: choose a larger floor, or a higher order"
            )
        return floor

    def frequencies(self, floor: float) -> FloatArray:
        """Frequencies that hold every crossing for λ above a floor, none hidden between two."""
        omega = self._base_frequencies
        if not self.delay:
            return omega
        possible = np.flatnonzero(self.largest_time_constant(omega) > floor)
        last = omega[min(possible[-1] + 1, omega.size - 1)] if possible.size else omega[0]
        step = 2 * pi / (self.delay * PER_TURN)
        if last > step * MAX_FREQUENCIES or last == omega[-1]:
            raise ValueError(
                f"floor is {floor:g} s; down to it the dead time of {self.delay:g} s would have to "
                f"be followed up to {last:.3g} rad/s: choose a larger one, or None for "
                f"{self.default_floor:.4g}"
            )
        return np.union1d(omega[omega <= last], np.arange(step, last, step))


def _lowest_term(p: FloatArray) -> tuple[float, int]:
    """Coefficient and power of the lowest term of a polynomial."""
    power = QuasiPolynomial(p).zeros_at_origin
    return float(p[p.size - 1 - power]), power


def _den_less_1(time_constant: float, order: int) -> FloatArray:
    """Coefficients of (λs + 1)^n - 1, whose zero at s = 0 is exact."""
    coefficients = LowPassFilter(time_constant, order).den
    coefficients[-1] = 0.0
    return coefficients
