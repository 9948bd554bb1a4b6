"""What every question about filters starts from: process over model, nothing cancelled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb, log10
from typing import Any

import numpy as np

from ..diagram import LowPassFilter, ObserverEquations, as_fraction
from ..numerics import BoolArray, ComplexArray, FloatArray, QuasiPolynomial, add

ERROR = 64 * float(np.finfo(float).eps)
"""Bound of the rounding error of a polynomial's value, against the sum of its terms' sizes."""


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
    integrator : bool
        Whether the model has an integrator that the process has not. It cancels inside
        (1 - F)·model, and p_B is divided by s. One that both have is in no factor at all.
    """

    a: FloatArray
    b: FloatArray
    delay: float
    order: int
    factors: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
    integrator: bool = False

    @classmethod
    def of(cls, process: Any, model: Any, order: int | None = None) -> Mismatch:
        """Read process and model as the loop does, with the same refusals.

        Without an order, the lowest that is causal.
        """
        if order is None:
            order = max(1, as_fraction(model, "model").relative_degree)
        loop = ObserverEquations(process, model, LowPassFilter(1.0, order))
        G, Gm = loop.fractions.G, loop.fractions.Gm
        integrator = Gm.den[-1] == 0
        if integrator and G.den[-1] == 0:
            G, Gm, integrator = G._replace(den=G.den[:-1]), Gm._replace(den=Gm.den[:-1]), False
        with np.errstate(over="ignore", under="ignore"):
            a, b = np.convolve(G.den, Gm.num), np.convolve(G.num, Gm.den)
        for product in (a, b):
            if not (np.isfinite(product).all() and product[0]):
                raise ValueError(
                    "the coefficients of process and model are so large or so small that their "
                    "product leaves the range of floating-point numbers: divide numerator and "
                    "denominator of each block by its leading coefficient, or change the units"
                )
        return cls(a, b, loop.delay, int(order), (*G, *Gm), bool(integrator))

    @property
    def held_at_origin(self) -> bool:
        """Whether p_B(0) = N(0) Dm(0) = 0 whatever λ."""
        return bool(self.b[-1] == 0) and not self.integrator

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

    @cached_property
    def speeds(self) -> FloatArray:
        """Sizes of all roots, and one over the dead time, in rad/s; 1 where there is neither."""
        sizes = np.append(np.abs(self.roots), 1 / self.delay if self.delay else [])
        return sizes if sizes.size else np.ones(1)

    def ratio(self, omega: FloatArray) -> ComplexArray:
        """R(jω), multiplied from the values of the factors.

        A factor with an undamped root keeps its own accuracy there, which its product with the
        others would lose.
        """
        N, D, Nm, Dm = self._values(omega)
        with np.errstate(divide="ignore", invalid="ignore"):  # at a pole on the axis
            R = N * Dm / (D * Nm)
            return np.asarray(R * np.exp(-1j * self.delay * omega) if self.delay else R)

    def noise(self, omega: FloatArray) -> FloatArray:
        """Bound the rounding error of R(jω), which near a zero on the axis exceeds R itself."""
        values = [np.abs(value) for value in self._values(omega)]
        sizes = self._sizes(omega)
        with np.errstate(divide="ignore", invalid="ignore"):
            poles = values[1] * values[2]
            at_most = sizes[0] * sizes[3] / poles
            relative = sizes[1] / values[1] + sizes[2] / values[2]
            # The angle ωθ of the dead time is rounded in proportion to its size.
            turned = at_most * (1 + self.delay * omega / 8)
            return np.asarray(ERROR * (turned + values[0] * values[3] / poles * relative))

    def at_pole(self, omega: FloatArray) -> BoolArray:
        """Tell at which frequencies a pole of R lies within rounding."""
        values, sizes = self._values(omega), self._sizes(omega)
        return np.asarray(
            (np.abs(values[1]) <= ERROR * sizes[1]) | (np.abs(values[2]) <= ERROR * sizes[2])
        )

    def _values(self, omega: FloatArray) -> list[ComplexArray]:
        s = 1j * np.asarray(omega)
        return [np.asarray(np.polyval(p, s)) for p in self.factors]

    def _sizes(self, omega: FloatArray) -> list[FloatArray]:
        return [np.asarray(np.polyval(np.abs(p), omega)) for p in self.factors]

    def p_B(self, time_constant: float) -> QuasiPolynomial:
        """Characteristic function for one filter, without what cancels inside (1 - F)·model."""
        # No term of (λs + 1)^n - 1 is negative, so that its sizes are its coefficients.
        sizes = np.convolve(np.abs(self.a), _den_less_1(time_constant, self.order))
        terms = self.undelayed(time_constant), self.delayed
        scale = add(sizes[: terms[0].size], np.abs(terms[1]))
        return QuasiPolynomial(*terms, self.delay, scale)

    def undelayed(self, time_constant: float) -> FloatArray:
        """Coefficients of D Nm (Df - 1), or of that over s."""
        product = np.convolve(self.a, _den_less_1(time_constant, self.order))
        return product[:-1] if self.integrator else product

    @property
    def delayed(self) -> FloatArray:
        """Coefficients of N Dm, or of that over s."""
        return self.b[:-1] if self.integrator else self.b


def _den_less_1(time_constant: float, order: int) -> FloatArray:
    """Coefficients of (λs + 1)^n - 1, whose zero at s = 0 is exact."""
    if abs(order * log10(time_constant)) > 300:
        raise ArithmeticError(
            f"time constant {time_constant:g} s to the power {order} leaves the range of "
            "floating-point numbers: choose another unit of time"
        )
    powers = [comb(order, k) * time_constant**k for k in range(order, 0, -1)]
    return np.array([*powers, 0.0])
