"""What every question about filters starts from: process over model, nothing cancelled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb, log10
from typing import Any

import numpy as np

from ..diagram import DelayedTransferFunction, LowPassFilter, ObserverEquations, as_fraction
from ..numerics import BoolArray, ComplexArray, FloatArray, QuasiPolynomial, Term, add

__all__ = ["ERROR", "Mismatch", "multiplied"]

ERROR = 64 * float(np.finfo(float).eps)
"""Bound of the rounding error of a polynomial's value, against the sum of its terms' sizes."""


@dataclass(frozen=True, eq=False)
class Mismatch:
    """The ratio R = G/G̃ = b/a · exp(-(θ - θm)s) and the order of the filter.

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
        (1 - F)·model, or (1 - F exp(-θm s))·model, and p_B is divided by s. One that both have is
        in no factor at all.
    wait : float
        θm in seconds, for a model that waits.
    """

    a: FloatArray
    b: FloatArray
    delay: float
    order: int
    factors: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
    integrator: bool = False
    wait: float = 0.0

    @classmethod
    def of(
        cls, process: Any, model: Any, order: int | None = None, *, waits: bool = False
    ) -> Mismatch:
        """Read process and model as the loop does, with the same refusals.

        Without an order, the lowest that is causal. A model with a dead time is refused unless it
        may wait.

        Parameters
        ----------
        process, model : as for `nrdob.NRDOB`
            G, with or without dead time, and G̃.
        order : int, optional
            n of the filter.
        waits : bool
            Whether the model may have a dead time.
        """
        if order is None:
            undelayed = model.tf if isinstance(model, DelayedTransferFunction) else model
            order = max(1, as_fraction(undelayed, "model").relative_degree)
        loop = ObserverEquations(process, model, LowPassFilter(1.0, order))
        if loop.model_delay and not waits:
            raise ValueError(
                f"model has a dead time of {loop.model_delay:g} s; for a model that waits ask "
                "nrdob.NRDOB, judge_observer, stabilizing_time_constants or "
                "critical_time_constants; here, leave the dead time out"
            )
        G, Gm = loop.fractions.G, loop.fractions.Gm
        integrator = Gm.den[-1] == 0
        if integrator and G.den[-1] == 0:
            G, Gm, integrator = G._replace(den=G.den[:-1]), Gm._replace(den=Gm.den[:-1]), False
        a, b = multiplied(G.den, Gm.num), multiplied(G.num, Gm.den)
        return cls(a, b, loop.delay, int(order), (*G, *Gm), bool(integrator), loop.model_delay)

    @property
    def longest_delay(self) -> float:
        """The longer of the two dead times, in seconds."""
        return max(self.delay, self.wait)

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
        if self.excess < self.order or not self.delay:
            return 0.0
        return float(abs(self.b[0] / self.a[0]) ** (1 / self.order))

    @cached_property
    def speeds(self) -> FloatArray:
        """Sizes of all roots, and one over the dead time, in rad/s; 1 where there is neither."""
        delays = [1 / delay for delay in (self.delay, self.wait) if delay]
        sizes = np.append(np.abs(self.roots), delays)
        return sizes if sizes.size else np.ones(1)

    def ratio(self, omega: FloatArray) -> ComplexArray:
        """R(jω), multiplied from the values of the factors.

        A factor with an undamped root keeps its own accuracy there, which its product with the
        others would lose.

        Parameters
        ----------
        omega : array of float, shape (N,)
            Frequencies, in rad/s.
        """
        N, D, Nm, Dm = self._values(omega)
        with np.errstate(divide="ignore", invalid="ignore"):  # at a pole on the axis
            R = N * Dm / (D * Nm)
            delay = self.delay - self.wait
            return np.asarray(R * np.exp(-1j * delay * omega) if delay else R)

    def noise(self, omega: FloatArray) -> FloatArray:
        """Bound the rounding error of R(jω), which near a zero on the axis exceeds R itself.

        Parameters
        ----------
        omega : array of float, shape (N,)
            Frequencies, in rad/s.
        """
        values = [np.abs(value) for value in self._values(omega)]
        sizes = self._sizes(omega)
        with np.errstate(divide="ignore", invalid="ignore"):
            poles = values[1] * values[2]
            at_most = sizes[0] * sizes[3] / poles
            relative = sizes[1] / values[1] + sizes[2] / values[2]
            # The angle ωθ of the dead time is rounded in proportion to its size.
            turned = at_most * (1 + self.longest_delay * omega / 8)
            return np.asarray(ERROR * (turned + values[0] * values[3] / poles * relative))

    def at_pole(self, omega: FloatArray) -> BoolArray:
        """Tell at which frequencies a pole of R lies within rounding.

        Parameters
        ----------
        omega : array of float, shape (N,)
            Frequencies, in rad/s.
        """
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
        """Characteristic function for one filter, without what cancels inside (1 - F)·model.

        Parameters
        ----------
        time_constant : float
            λ in seconds.
        """
        if self.wait:
            return self._waiting(time_constant)
        # No term of (λs + 1)^n - 1 is negative, so that its sizes are its coefficients.
        sizes = np.convolve(np.abs(self.a), _den_less_1(time_constant, self.order))
        terms = self.undelayed(time_constant), self.delayed
        return QuasiPolynomial(*terms, self.delay, add(sizes[: terms[0].size], np.abs(terms[1])))

    def _waiting(self, time_constant: float) -> QuasiPolynomial:
        den = _den_less_1(time_constant, self.order)
        den[-1] = 1.0
        ahead = np.convolve(self.a, den)
        scale = add(np.convolve(np.abs(self.a), den), add(np.abs(self.a), np.abs(self.b)))
        more = (Term(-self.a, self.wait),)
        p = QuasiPolynomial(ahead, self.b, self.delay, scale, more)
        return p.over_s(1) if self.integrator else p

    def undelayed(self, time_constant: float) -> FloatArray:
        """Coefficients of D Nm (Df - 1) or of that over s, or of D Nm Df where the model waits.

        Parameters
        ----------
        time_constant : float
            λ in seconds.
        """
        den = _den_less_1(time_constant, self.order)
        den[-1] = float(self.wait > 0)
        product = np.convolve(self.a, den)
        return product[:-1] if self.integrator else product

    @property
    def delayed(self) -> FloatArray:
        """Coefficients of N Dm, or of that over s."""
        return self.b[:-1] if self.integrator else self.b


def multiplied(of_process: FloatArray, of_model: FloatArray) -> FloatArray:
    """Multiply a polynomial of the process by one of the model, within the range of floats.

    Parameters
    ----------
    of_process, of_model : array of float
        Coefficients in descending powers.

    Raises
    ------
    ValueError
        If the product leaves the range of floating-point numbers.
    """
    with np.errstate(over="ignore", under="ignore"):
        product = np.convolve(of_process, of_model)
    if not (np.isfinite(product).all() and product[0]):
        raise ValueError(
            "the coefficients of process and model are so large or so small that their product "
            "leaves the range of floating-point numbers: divide numerator and denominator of each "
            "block by its leading coefficient, or change the units"
        )
    return product


def _den_less_1(time_constant: float, order: int) -> FloatArray:
    """Coefficients of (λs + 1)^n - 1, whose zero at s = 0 is exact."""
    if abs(order * log10(time_constant)) > 300:
        raise ArithmeticError(
            f"time constant {time_constant:g} s to the power {order} leaves the range of "
            "floating-point numbers: choose another unit of time"
        )
    powers = [comb(order, k) * time_constant**k for k in range(order, 0, -1)]
    return np.array([*powers, 0.0])
