"""A map of the loop kept as factors, so that nothing cancels in floating point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import frexp, inf, pi, prod
from typing import Any

import control as ct
import numpy as np

from ..numerics import ComplexArray, FloatArray, QuasiPolynomial, multiply, shared_factor, written
from .blocks import Fraction, as_fraction
from .delay import undelayed
from .filters import unstable_pole
from .noise import check_stable, noise_power, step_energy

__all__ = ["Quotient", "as_quotient", "as_shaping"]

NEAR_ROOT = 1e-7  # size of a denominator, against its terms, below which half the digits are lost

CIRCLES = (1e-2, 1e-9), (1e-3, 1e-8), (1e-4, 1e-8), (1e-5, 1e-8)
"""Radii around such a point relative to its size, and what negative powers may be rounding."""

LARGEST = 1e300  # in place of infinity, where a difference of two would have no value

UNIT_CIRCLE = np.exp(2j * pi * (np.arange(16) + 0.5) / 16)


@dataclass(frozen=True, eq=False)
class Quotient:
    r"""A transfer function kept as factors: product of `num` over product of `den`.

    Parameters
    ----------
    num, den : tuple of QuasiPolynomial
        As the block diagram gives them.
    name : str
        In messages and figures.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import NRDOB, LowPassFilter
    >>> G = ct.tf([2, 10], [1, 11, 10])
    >>> loop = NRDOB(G, G, ct.tf([1.39], [1, 0]), LowPassFilter(0.01, 2))
    >>> loop.T_R.to_tf().den[0][0].size - 1
    3
    """

    num: tuple[QuasiPolynomial, ...]
    den: tuple[QuasiPolynomial, ...]
    name: str = ""

    @cached_property
    def delay(self) -> float:
        """Longest dead time in any factor, in seconds."""
        return max(factor.delay for factor in self.num + self.den)

    @cached_property
    def numerator(self) -> QuasiPolynomial:
        """The numerator multiplied out."""
        return multiply(*self.num)

    @cached_property
    def denominator(self) -> QuasiPolynomial:
        """The denominator multiplied out."""
        return multiply(*self.den)

    @cached_property
    def zeros_at_origin(self) -> int:
        """Power of s that is left when those of both sides are cancelled; negative for poles."""
        return sum(f.zeros_at_origin for f in self.num) - sum(f.zeros_at_origin for f in self.den)

    @property
    def at_infinity(self) -> tuple[float, float]:
        """The a and b of the limit a + b exp(-jωθ) over an undelayed denominator.

        Infinite for an improper map. With several dead times b is the sum of the sizes. A unit step
        makes the output jump by a at t = 0.
        """
        if not self.delay:
            return self._at_once, 0.0
        num, den = self.numerator, self.denominator
        late = []
        for part, _ in num.delayed:
            excess = part.size - num.divided - den.q.size + den.divided
            late.append(0.0 if excess < 0 else inf if excess else float(part[0] / den.q[0]))
        return self._at_once, sum(map(abs, late)) if len(late) > 1 else sum(late, 0.0)

    @property
    def _at_once(self) -> float:
        """The a of `at_infinity`, of factors that need not be multiplied out."""
        degrees = [sum(f.q.size - 1 - f.divided for f in fs) for fs in (self.num, self.den)]
        excess = degrees[0] - degrees[1]
        if excess < 0 or not all(f.q.any() for f in self.num):
            return 0.0
        if excess or not all(f.q.any() for f in self.den):
            return inf
        top, bottom = ([frexp(f.q[0]) for f in fs] for fs in (self.num, self.den))
        size = prod(a for a, _ in top) / prod(a for a, _ in bottom)
        with np.errstate(over="ignore", under="ignore"):
            return float(np.ldexp(size, sum(k for _, k in top) - sum(k for _, k in bottom)))

    def __call__(self, s: complex | ComplexArray) -> Any:
        """Evaluate at complex `s`, a number or an array; infinite at poles, the limit at 0/0."""
        s = np.asarray(s, dtype=complex)
        power = self.zeros_at_origin
        with np.errstate(all="ignore"):  # what is not finite is looked at again
            num = prod((f.without_origin(s) for f in self.num), start=s ** max(power, 0))
            den = prod((f.without_origin(s) for f in self.den), start=s ** max(-power, 0))
            value = np.asarray(num / den)
            vanishing = np.abs(den) <= NEAR_ROOT * self._den_size(s)
        doubtful = vanishing | ~np.isfinite(value)
        if doubtful.any():
            careful = doubtful & np.isfinite(s) & (s != 0)
            value[careful] = self._careful(s[careful])
            value[doubtful & (den == 0) & ~careful] = inf
        return value[()]

    def _den_size(self, s: ComplexArray) -> FloatArray:
        """Size of what is summed to give the denominator."""
        size = np.abs(s) ** max(-self.zeros_at_origin, 0)
        size = size * prod(f.without_origin.size(s) for f in self.den)
        if self.delay:
            size = size * np.exp(sum(f.delay for f in self.den) * np.maximum(-s.real, 0.0))
        return np.asarray(size)

    def _careful(self, s: ComplexArray) -> ComplexArray:
        """Values where plain ones may be lost: at or beside a root, or beyond floating point.

        By Laurent's series on a small circle: what has no negative powers there has no pole
        inside, and its mean is the value at the centre.
        """
        value = self._scaled(s)
        value[~np.isfinite(value)] = inf
        for size, tolerance in CIRCLES:
            radius = size * np.minimum(np.abs(s), 10 / self.delay if self.delay else inf)
            around = self._scaled(s[:, None] + radius[:, None] * UNIT_CIRCLE)
            largest = np.abs(around).max(axis=1)
            with np.errstate(all="ignore"):
                laurent = np.abs(np.fft.fft(around / largest[:, None]))
                removable = (largest == 0) | (laurent[:, 8:].max(axis=1) <= tolerance)
            value[removable] = around[removable].mean(axis=1)
            if removable.all():
                break
        return value

    def _scaled(self, s: ComplexArray) -> ComplexArray:
        """Values by factors whose size is kept apart as a logarithm, so that none overflows."""
        size, power = np.abs(s), self.zeros_at_origin
        value, log_size = (s / size) ** power, power * np.log(size)
        with np.errstate(all="ignore"):
            for factors, sign in ((self.num, 1), (self.den, -1)):
                for factor in factors:
                    mantissa, log_factor = _mantissa(factor.without_origin, s)
                    value = value * mantissa if sign > 0 else value / mantissa
                    log_size = log_size + sign * log_factor
            return np.where(np.isfinite(value), value * np.exp(log_size), value)

    @property
    def dc_gain(self) -> float:
        """Value at s = 0, infinite with a pole there."""
        power = self.zeros_at_origin
        num, den = (
            prod(f.without_origin.constant for f in factors) for factors in (self.num, self.den)
        )
        return inf if power < 0 or den == 0 else 0.0 if power else num / den

    def noise_power(self, shaping: Any = None) -> float:
        r"""Power of the output for white noise of unit density at the input, or coloured noise.

        The variance :math:`\frac1{2\pi}\int |Q(j\omega)|^2 d\omega`, square of `control.norm(sys,
        2)`, also with dead time, to 1e-8 of itself: see `nrdob.diagram.noise`.

        Parameters
        ----------
        shaping : control.TransferFunction, StateSpace, number or (num, den), optional
            A stable W behind which the noise is coloured: its density is :math:`|W(j\omega)|^2`.
            White noise of the density Φ has W = √Φ.

        Raises
        ------
        ValueError
            If the power is infinite: the map, with the shaping filter, is not strictly proper, or
            its denominator, hidden modes included, has roots that are not in the left half plane.

        Examples
        --------
        >>> import control as ct
        >>> from nrdob import NRDOB, LowPassFilter
        >>> G = ct.tf([1], [1, 1])
        >>> round(NRDOB(G, G, 1.0, LowPassFilter(0.5, 2)).S_eta.noise_power(), 12)   # 1/(4λ)
        0.5
        """
        name = self.name or "this map"
        if shaping is None:
            return noise_power(self.num, self.den, name)
        num, den = map(QuasiPolynomial, as_shaping(shaping))
        return noise_power((*self.num, num), (*self.den, den), f"{name} behind the shaping filter")

    def check_stable(self) -> None:
        """Raise ValueError if the denominator, hidden modes included, has unstable roots."""
        check_stable(self.den, f"the noise power of {self.name or 'this map'}")

    def spectrum(self, omega: Any, shaping: Any = None) -> FloatArray:
        r"""Power spectral density of the output, :math:`|Q(j\omega) W(j\omega)|^2`.

        Two-sided and over ω in rad/s: its integral over all ω, over 2π, is the variance. scipy's
        `welch` gives the one-sided density over frequency in Hz, which is twice that.

        Parameters
        ----------
        omega : array_like of float
            Frequencies in rad/s, of any shape.
        shaping : as for `noise_power`, optional
            W, a stable block; white noise of unit density by default.

        Raises
        ------
        TypeError, ValueError
            If the shaping filter is no stable block.

        Examples
        --------
        >>> import control as ct
        >>> from nrdob import NRDOB, LowPassFilter
        >>> G = ct.tf([1], [1, 1])
        >>> loop = NRDOB(G, G, 1.0, LowPassFilter(0.5, 2))
        >>> loop.S_eta.spectrum([0.0, 2.0]).round(6).tolist()        # 1/(1 + λ²ω²)²
        [1.0, 0.25]
        """
        s = 1j * np.asarray(omega, dtype=float)
        size = np.abs(self(s)) ** 2
        if shaping is not None:
            num, den = as_shaping(shaping)
            size = size * np.abs(np.polyval(num, s) / np.polyval(den, s)) ** 2
        return np.asarray(size)

    def step_energy(self) -> float:
        r"""Energy :math:`\int_0^\infty q(t)^2\,dt` of the output after a unit step at the input.

        It is the square of the norm of Q/s, exact without dead time and to 1e-8 of itself with it;
        infinite where an offset stays, Q(0) ≠ 0.

        Raises
        ------
        ValueError
            If the denominator has roots that are not in the left half plane.

        Examples
        --------
        A matched model under 1/(λs + 1) rejects a step of d with the error exp(-t/λ):

        >>> import control as ct
        >>> from nrdob import NRDOB, LowPassFilter
        >>> G = ct.tf([1], [1, 1])
        >>> round(NRDOB(G, G, 1.0, LowPassFilter(0.5, 1)).S_d.step_energy(), 12)
        0.25
        """
        return step_energy(self.num, self.den, self.name or "this map")

    def to_tf(self) -> ct.TransferFunction:
        """Return the map as a `control.TransferFunction` in lowest structural order.

        Factors that numerator and denominator share, because blocks of the diagram share them, are
        divided out as polynomials (`nrdob.numerics.sharedfactor`); roots that are only near stay.
        Hidden modes are then invisible: only `stability` may judge a loop.

        Raises
        ------
        ValueError
            If the map contains dead time, which no rational function equals.
        """
        if self.delay:
            raise ValueError(
                f"{self.name or 'this map'} contains a dead time of {self.delay:g} s and has no "
                "rational form; evaluate it at complex s, or use step_response"
            )
        num, den = list(self.num), list(self.den)
        for i, j in np.ndindex(len(num), len(den)):
            _, num[i], den[j] = shared_factor(num[i], den[j])
        return ct.tf(multiply(*num).q, multiply(*den).q)


def as_quotient(system: Any, name: str) -> Quotient:
    """Read a block, with or without dead time, as a quotient of one factor over another.

    Parameters
    ----------
    system : control.TransferFunction, StateSpace, (num, den), number, scipy.signal.lti or Quotient
        Proper or not, or a `DelayedTransferFunction`; a quotient is returned as it is. A TypeError
        or ValueError if it is no single-input single-output block in continuous time.
    name : str
    """
    if isinstance(system, Quotient):
        return system
    system, seconds = undelayed(system)
    num, den = as_fraction(system, name, proper=False)
    return Quotient((QuasiPolynomial(np.zeros(1), num, seconds),), (QuasiPolynomial(den),), name)


def as_shaping(shaping: Any) -> Fraction:
    """Read a shaping filter; a TypeError or ValueError if it is not rational, proper and stable.

    Parameters
    ----------
    shaping : control.TransferFunction, StateSpace, number or (num, den)
    """
    fraction = as_fraction(shaping, "shaping")
    if (pole := unstable_pole(fraction.den)) is not None:
        raise ValueError(
            f"shaping has a pole at {written(pole)}: behind it noise has no finite power; every "
            "pole needs a negative real part"
        )
    return fraction


def _mantissa(p: QuasiPolynomial, s: ComplexArray) -> tuple[ComplexArray, FloatArray]:
    """p(s) as a number of moderate size and the logarithm of a positive factor, s not 0."""
    size, column = np.abs(s)[..., None], s[..., None]
    exponents, terms = [], []
    for part, delay in p.terms:
        lag = delay * column
        k = np.arange(part.size - 1, -1, -1) - p.divided
        exponents.append(np.log(np.abs(part)) + k * np.log(size) - lag.real)
        terms.append(np.sign(part) * (column / size) ** k * np.exp(-1j * lag.imag))
    exponent, term = np.concatenate(exponents, axis=-1), np.concatenate(terms, axis=-1)
    largest = np.maximum(exponent.max(axis=-1), -LARGEST)  # -inf for the polynomial 0
    mantissa = (np.exp(exponent - largest[..., None]) * term).sum(axis=-1)
    if p.divided:  # near s = 0 the terms cancel
        plain = np.abs(s) * p.delay < 1
        mantissa, largest = np.where(plain, p(s), mantissa), np.where(plain, 0.0, largest)
    return mantissa, largest
