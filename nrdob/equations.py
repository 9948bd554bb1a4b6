r"""The NR-DOB loop of Fig. 1 solved: eqs. (3), (4) and (7) as factored quotients.

The block diagram, with R, δ, d, η the reference, input disturbance, output disturbance and noise::

             e            u                 δ              d
    R --->(+)-->[ C ]-->(+)--------+------>(+)-->[ G ]--->(+)-----+---> y
          -^            -^         |                              |
           |             |         |                              v
           |             +---(+)<--|-------[ F/Gm ]<-------------(+)<--- η
           |                 -^    |                              |
           |                  +--[ F ]                            |
           |                                                      |
           +------------[ yf = F (y + η) + (1 - F) Gm u ]<--------+

    e = R - yf        u = C e + F u - (F/Gm)(y + η)        y = G (u + δ) + d

With G = N/D exp(-θs), model Gm = Nm/Dm, C = Nc/Dc and F = Nf/Df every closed-loop map is a quotient
over two characteristic functions, and nothing is left to cancel in floating point::

    p_A = Dm Dc + Nm Nc                          condition i  of Lemma 1
    p_B = D Nm (Df - Nf) + N Dm Nf exp(-θs)      condition ii of Lemma 1
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, reduce
from math import inf, prod
from typing import Any

import control as ct
import numpy as np

from .blocks import ROUNDING, ComplexArray, FloatArray, Fraction, as_fraction, nonzero
from .delay import DelayedTransferFunction
from .filters import filter_fraction
from .quasipoly import QuasiPolynomial, add, multiply


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


@dataclass(frozen=True, eq=False)
class LoopEquations:
    """The four blocks of an NR-DOB loop and every map between its signals.

    Parameters
    ----------
    process : control.TransferFunction, StateSpace, DelayedTransferFunction or (num, den)
        G, proper, with or without dead time.
    model : control.TransferFunction, StateSpace or (num, den)
        Gm, proper, without dead time.
    controller : control.TransferFunction, StateSpace, number or (num, den)
        C, proper.
    filter : LowPassFilter, or a stable proper block with F(0) = 1
        F, of at least the model's relative degree, so that F/model is causal.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put; the message names the block and the remedy.
    """

    process: Any
    model: Any
    controller: Any
    filter: Any

    def __post_init__(self) -> None:
        if isinstance(self.model, DelayedTransferFunction) and self.model.delay:
            raise ValueError(
                f"model has a dead time of {self.model.delay:g} s; F/model would have to predict "
                "the future: leave the dead time out of the model"
            )
        if isinstance(self.controller, DelayedTransferFunction):
            raise TypeError("controller has a dead time; only the process may have one")
        relative_degree = self._F.relative_degree
        if relative_degree < self._Gm.relative_degree:
            raise ValueError(
                f"filter has relative degree {relative_degree}, model has "
                f"{self._Gm.relative_degree}: F/model is not causal; use a filter of order "
                f"{self._Gm.relative_degree} or more"
            )
        _ = self._G, self._C

    @cached_property
    def _G(self) -> Fraction:
        given = self.process
        rational = given.tf if isinstance(given, DelayedTransferFunction) else given
        return nonzero(as_fraction(rational, "process"), "process")

    @cached_property
    def _Gm(self) -> Fraction:
        given = self.model
        rational = given.tf if isinstance(given, DelayedTransferFunction) else given
        return nonzero(as_fraction(rational, "model"), "model")

    @cached_property
    def _C(self) -> Fraction:
        return as_fraction(self.controller, "controller")

    @cached_property
    def _F(self) -> Fraction:
        return filter_fraction(self.filter)

    @property
    def delay(self) -> float:
        """Dead time of the process, in seconds."""
        return self.process.delay if isinstance(self.process, DelayedTransferFunction) else 0.0

    @cached_property
    def _one_minus_F(self) -> QuasiPolynomial:
        # Both constant coefficients are exactly 1, so 1 - F keeps its zero at s = 0 exactly.
        num, den = self._F
        return QuasiPolynomial(add(den, -num), scale=add(np.abs(den), np.abs(num)))

    @cached_property
    def p_A(self) -> QuasiPolynomial:
        """Characteristic polynomial of the model loop, Dm Dc + Nm Nc."""
        Gm, C = self._Gm, self._C
        return _sum_of_products((Gm.den, C.den), (Gm.num, C.num))

    @cached_property
    def p_B(self) -> QuasiPolynomial:
        """Characteristic quasi-polynomial of the observer loop, D Nm (Df-Nf) + N Dm Nf e^(-θs)."""
        G, Gm, F = self._G, self._Gm, self._F
        undelayed = (G.den, Gm.num, self._one_minus_F.q)
        return _sum_of_products(undelayed, (G.num, Gm.den, F.num), self.delay)

    @property
    def ill_posed_model_loop(self) -> str:
        """Why the model loop has no solution at infinite frequency; empty if well posed."""
        if self.p_A.degree == self._Gm.den.size + self._C.den.size - 2 and self.p_A.q.any():
            return ""
        return "the model loop is ill-posed: 1 + C(∞)·model(∞) = 0; change the controller"

    @property
    def ill_posed_observer_loop(self) -> str:
        """Why the observer loop has no solution at infinite frequency; empty if well posed."""
        full = self._G.den.size + self._Gm.num.size + self._F.den.size - 2
        if self.p_B.q.size == full and self.p_B.q.any():
            return ""
        value = "1 - F(∞) = 0" if self.delay else "1 + F(∞)·H(∞) = 0"
        return f"the observer loop is ill-posed: {value}; choose a filter with another F(∞)"

    @property
    def ill_posed(self) -> str:
        """Why the loop has no solution at infinite frequency; empty if it is well posed."""
        return self.ill_posed_model_loop or self.ill_posed_observer_loop

    # Eq. (4): to the output y.

    @cached_property
    def T_R(self) -> Quotient:
        """Reference R to output y, eq. (4)."""
        return self._quotient("T_R", "Nc Ne Nm Dm Df", "A B")

    @cached_property
    def S_d(self) -> Quotient:
        """Output disturbance d to output y, eq. (4): the sensitivity of the plant loop."""
        return self._quotient("S_d", "D Nm 1-F", "B")

    @cached_property
    def S_delta(self) -> Quotient:
        """Input disturbance δ to output y, eq. (4)."""
        return self._quotient("S_delta", "Ne Nm 1-F", "B")

    @cached_property
    def S_eta(self) -> Quotient:
        """Measurement noise η to output y, eq. (4)."""
        return self._quotient("S_eta", "-1 Ne Dm Nf", "B")

    # Eq. (7): to the error and to the control signal.

    @cached_property
    def E_R(self) -> Quotient:
        """Reference R to error e, eq. (7), which collapses to 1/(1 + Gm C)."""
        return self._quotient("E_R", "Dm Dc", "A")

    @cached_property
    def U_R(self) -> Quotient:
        """Reference R to controller output u, eq. (7)."""
        return self._quotient("U_R", "Nc D Nm Dm Df", "A B")

    @cached_property
    def U_d(self) -> Quotient:
        """Output disturbance d to controller output u, eq. (7)."""
        return self._quotient("U_d", "-1 D Dm Nf", "B")

    @cached_property
    def U_delta(self) -> Quotient:
        """Input disturbance δ to plant input u + δ, eq. (7)."""
        return self._quotient("U_delta", "D Nm 1-F", "B")

    @cached_property
    def U_eta(self) -> Quotient:
        """Measurement noise η to controller output u, eq. (7): the same map as `U_d`."""
        return self._quotient("U_eta", "-1 D Dm Nf", "B")

    # Blocks and open loops.

    @cached_property
    def G(self) -> Quotient:
        """The process."""
        return self._quotient("G", "Ne", "D")

    @cached_property
    def Gm(self) -> Quotient:
        """The model G̃."""
        return self._quotient("Gm", "Nm", "Dm")

    @cached_property
    def C(self) -> Quotient:
        """The controller."""
        return self._quotient("C", "Nc", "Dc")

    @cached_property
    def F(self) -> Quotient:
        """The filter."""
        return self._quotient("F", "Nf", "Df")

    @cached_property
    def ratio(self) -> Quotient:
        """Process over model, G̃⁻¹G."""
        return self._quotient("ratio", "Ne Dm", "D Nm")

    @cached_property
    def H(self) -> Quotient:
        """Relative mismatch H = G/G̃ - 1 of Lemma 1."""
        return self._quotient("H", "mismatch", "D Nm")

    @cached_property
    def FH(self) -> Quotient:
        """Observer loop F H, condition ii of Lemmas 1 and 2."""
        return self._quotient("FH", "Nf mismatch", "D Nm Df")

    @cached_property
    def CGm(self) -> Quotient:
        """Model loop C G̃, condition i of Lemmas 1 and 2."""
        return self._quotient("CGm", "Nc Nm", "Dc Dm")

    @cached_property
    def K(self) -> Quotient:
        """All the feedback there is: K = F/((1 - F) G̃)."""
        return self._quotient("K", "Nf Dm", "1-F Nm")

    @cached_property
    def L(self) -> Quotient:
        """Plant loop L = K G = F (G/G̃)/(1 - F), the loop that the plant itself sees."""
        return self._quotient("L", "Nf Dm Ne", "1-F Nm D")

    @cached_property
    def _parts(self) -> dict[str, QuasiPolynomial]:
        G, Gm, C, F = self._G, self._Gm, self._C, self._F
        parts = {
            "-1": -np.ones(1), "D": G.den, "Nm": Gm.num, "Dm": Gm.den,
            "Nc": C.num, "Dc": C.den, "Nf": F.num, "Df": F.den,
        }  # fmt: skip
        mismatch = _sum_of_products((-G.den, Gm.num), (G.num, Gm.den), self.delay)
        return {name: QuasiPolynomial(c) for name, c in parts.items()} | {
            "Ne": QuasiPolynomial(np.zeros(1), G.num, self.delay),
            "1-F": self._one_minus_F,
            "mismatch": mismatch,
            "A": self.p_A,
            "B": self.p_B,
        }

    def _quotient(self, name: str, num: str, den: str) -> Quotient:
        num_factors, den_factors = (
            tuple(self._parts[part] for part in parts.split()) for parts in (num, den)
        )
        return Quotient(num_factors, den_factors, name)


def _sum_of_products(
    undelayed: tuple[FloatArray, ...], delayed: tuple[FloatArray, ...], delay: float = 0.0
) -> QuasiPolynomial:
    """Multiply out and add, keeping the size of what may cancel."""
    scale = add(*(reduce(np.convolve, map(np.abs, factors)) for factors in (undelayed, delayed)))
    return QuasiPolynomial(
        reduce(np.convolve, undelayed), reduce(np.convolve, delayed), delay, scale
    )


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
