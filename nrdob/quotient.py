"""A map of the loop kept as factors, so that nothing cancels in floating point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf, prod
from typing import Any

import control as ct
import numpy as np

from .blocks import ROUNDING, ComplexArray
from .quasipoly import QuasiPolynomial, multiply


@dataclass(frozen=True, eq=False)
class Quotient:
    r"""A transfer function kept as factors: product of `num` over product of `den`.

    Parameters
    ----------
    num, den : tuple of QuasiPolynomial
        The factors, as the block diagram gives them.
    name : str
        How the map is written in messages and figures.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import NRDOB, LowPassFilter
    >>> G = ct.tf([2, 10], [1, 11, 10])
    >>> loop = NRDOB(G, G, ct.tf([1.39], [1, 0]), LowPassFilter(0.01, 2))
    >>> complex(loop.S_d(0.0))
    0j
    >>> loop.T_R.to_tf().den[0][0].size - 1
    3
    """

    num: tuple[QuasiPolynomial, ...]
    den: tuple[QuasiPolynomial, ...]
    name: str = ""

    @property
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

    @property
    def zeros_at_origin(self) -> int:
        """Power of s that is left when those of both sides are cancelled; negative for poles."""
        return sum(f.zeros_at_origin for f in self.num) - sum(f.zeros_at_origin for f in self.den)

    @property
    def at_infinity(self) -> tuple[float, float]:
        """The a and b of the limit a + b exp(-jωθ) over an undelayed denominator.

        Infinite for an improper map.
        """
        den = self.denominator.q
        limits = []
        for part in (self.numerator.q, self.numerator.r):
            excess = part.size - den.size if part.any() else -1
            limits.append(0.0 if excess < 0 else inf if excess else float(part[0] / den[0]))
        return limits[0], limits[1]

    def __call__(self, s: complex | ComplexArray) -> Any:
        """Evaluate at complex `s`, a number or an array of any shape; infinite at poles."""
        s = np.asarray(s, dtype=complex)
        power = self.zeros_at_origin
        num = prod((f.without_origin(s) for f in self.num), start=s**power if power > 0 else 1.0)
        den = prod((f.without_origin(s) for f in self.den), start=s**-power if power < 0 else 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(den == 0, inf, num / den)[()]

    @property
    def dc_gain(self) -> float:
        """Value at s = 0, infinite with a pole there."""
        power = self.zeros_at_origin
        num, den = (
            prod(f.without_origin.constant for f in factors) for factors in (self.num, self.den)
        )
        return inf if power < 0 or den == 0 else 0.0 if power else num / den

    def to_tf(self) -> ct.TransferFunction:
        """Return the map as a `control.TransferFunction` in lowest structural order.

        Factors that numerator and denominator share, because blocks of the diagram share them,
        are divided out; hidden modes are then invisible: only `stability` may judge a loop.

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
            num[i], den[j] = _without_common_roots(num[i], den[j])
        return ct.tf(multiply(*num).q, multiply(*den).q)


def _without_common_roots(
    num: QuasiPolynomial, den: QuasiPolynomial
) -> tuple[QuasiPolynomial, QuasiPolynomial]:
    """Divide out the roots of `num` at which `den` vanishes to rounding."""
    if num.degree == 0 or den.degree == 0:
        return num, den
    shared: list[complex] = []
    left, scale = den.q, den.scale
    for root in num.roots:
        if left.size > 1 and abs(np.polyval(left, root)) <= ROUNDING * np.polyval(scale, abs(root)):
            shared.append(root)
            # A double root of num is shared once only, unless den has it twice.
            left, scale = np.polydiv(left, [1, -root])[0], np.polydiv(scale, [1, -abs(root)])[0]
    if not shared:
        return num, den
    divisor = np.real(np.poly(shared))
    num_left, den_left = (np.polydiv(p.q, divisor)[0] for p in (num, den))
    return QuasiPolynomial(num_left), QuasiPolynomial(den_left)
