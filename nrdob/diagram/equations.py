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

The blocks F/Gm and (1 - F) Gm are each built as one. Zeros of the model that F has too, and poles
of the model at which F = 1, are then in no block at all::

    Nm = gz Nm'     Nf = gz Nf'     gz = gcd(Nm, Nf)           F/Gm     = Nf' Dm/(Df Nm')
    Dm = gp Dm'     Df - Nf = gp E  gp = gcd(Dm, Df - Nf)      (1-F) Gm = E Nm/(Df Dm')

With these blocks, two of F, C and G the diagram has the characteristic function Df³ p_A p_B/(gz gp)
and condition ii is about ``p_B/(gz gp) = D Nm' E + N Dm' Nf' exp(-θs)``, which is what `p_B` means
here; every map is the same quotient in these factors. `keep_factors=True` keeps gz and gp, as a
diagram does in which 1 - F, Gm and 1/Gm are blocks of their own.

.. rubric:: A delayed model

A model with a dead time, Gm = Gm0 exp(-θm s), Gm0 = Nm/Dm, cannot be inverted: no block predicts.
The inverse leaves the dead time out, and what it is compared with is delayed instead::

             e            u                 δ              d
    R --->(+)-->[ C ]-->(+)--------+------>(+)-->[ G ]--->(+)-----+---> y
          -^            -^         |                              |
           |             |         v                              v
           |             |  [ exp(-θm s) ]                       (+)<--- η
           |             |         v                              |
           |             |       [ F ]                            |
           |             |        -v                              |
           |             +--------(+)<-----[ F/Gm0 ]<-------------+
           |                                                      |
           +-----[ yf = F (y + η) + (1 - F exp(-θm s)) Gm0 u ]<---+

    e = R - yf       u = C e + F exp(-θm s) u - (F/Gm0)(y + η)       y = G (u + δ) + d

The line for u says Gm0 C e = (1 - F exp(-θm s)) Gm0 u + F (y + η): this is the only yf with
yf = Gm0 C e, that is with E/R = 1/(1 + Gm0 C). It is also Gm0 u + F (y + η - Gm u), a Smith
predictor with an observer. C and the model loop see no dead time, p_A stays what it is, and all
other maps are the same quotients with ::

    1 - F exp(-θm s)                                                in place of 1 - F
    p_B = D Nm (Df - Nf exp(-θm s)) + N Dm Nf exp(-θs)              condition ii
    H   = G/Gm0 - exp(-θm s)                                        as large as G/Gm - 1
    K   = F/((1 - F exp(-θm s)) Gm0)

Which poles of Gm0 cancel inside the block (1 - F exp(-θm s)) Gm0 changes, too: those at which
F(p) exp(-θm p) = 1. At s = 0 that is exact: 1 - F exp(-θm s) ~ (θm - F'(0)) s, so that one
integrator of the model cancels, and k of them if F meets exp(θm s) up to the power k - 1::

    (1 - F exp(-θm s))/s = (1 - F)/s + F (1 - exp(-θm s))/s
    p_B/s^k              = D Nm' (Df - Nf exp(-θm s))/s^k + N (Dm/s^k) Nf' exp(-θs)

Here (1 - exp(-θm s))/s is the integral of u over the last θm, a memory of that length and no more.
It has to be built as that: a sum over the samples in a buffer, or an integral begun anew for every
window. The difference of two integrators, of which one is θm late, or a running sum that adds the
newest sample and takes off the oldest, has the same response, but it is not stable: what rounding,
or a wrong start, once puts into the difference never leaves it again. That is the diagram with
`keep_factors=True`. For p != 0, F(p) exp(-θm p) = 1 holds to rounding at best; in the right half
plane the memory then grows from one end of its window to the other, and replacing its integral by a
sum can make the loop unstable, however fine the steps. Such poles are kept.

.. rubric:: References

Smith, O. J. M., Chem. Eng. Progress 53 (1957) 217-219; Palmor, Z. J., Int. J. Control 32 (1980)
937-949; Yamanaka, K., E. Shimemura, Automatica 23 (1987) 787-791; Zhong, Q.-C., J. E. Normey-Rico,
IEE Proc. Control Theory Appl. 149 (2002) 285-290; on sums in place of the integral Van Assche, V.,
M. Dambrine, J.-F. Lafay, J.-P. Richard, Proc. 38th IEEE Conference on Decision and Control (1999).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, reduce
from math import factorial
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from ..numerics import FloatArray, QuasiPolynomial, Shared, Term, add, shared_factor, unstable_roots
from .blocks import Fraction, as_fraction, nonzero
from .delay import undelayed
from .filters import TYPED_IN, filter_fraction
from .quotient import Quotient

__all__ = ["LoopEquations", "ObserverEquations"]

MADE = {
    "Nm'": attrgetter("built.Nm"),
    "Nf'": attrgetter("built.Nf"),
    "Dm'": attrgetter("built.Dm"),
    "E": attrgetter("built.E"),
    "mismatch": attrgetter("_mismatch"),
    "A": attrgetter("p_A"),
    "B": attrgetter("p_B"),
}
"""Factors of the maps that are not made before they are asked for."""

SAME_DELAY = 4 * float(np.finfo(float).eps)  # of two dead times: 0.1 + 0.2 is not 0.3


class BuiltFactors(NamedTuple):
    """Factors of the blocks F/Gm = Nf Dm/(Df Nm) and (1 - F) Gm = E Nm/(Df Dm), each as one.

    `zeros` and `poles` are what has cancelled inside them; 1 where nothing has.
    """

    Nm: QuasiPolynomial
    Nf: QuasiPolynomial
    Dm: QuasiPolynomial
    E: QuasiPolynomial
    zeros: QuasiPolynomial
    poles: QuasiPolynomial


class LoopFractions(NamedTuple):
    """Numerators and denominators of the four blocks: process, model, controller, filter."""

    G: Fraction
    Gm: Fraction
    C: Fraction
    F: Fraction


class _Map(cached_property[Quotient]):
    """A map of the loop: the factors of its numerator and denominator, by their names."""

    def __init__(self, num: str, den: str, doc: str) -> None:
        super().__init__(self._made)
        self.parts, self.__doc__ = (num.split(), den.split()), doc

    def _made(self, loop: Any) -> Quotient:
        num, den = (
            tuple(MADE[part](loop) if part in MADE else loop._factors[part] for part in parts)
            for parts in self.parts
        )
        return Quotient(num, den, self.attrname or "")


@dataclass(frozen=True, eq=False)
class LoopEquations:
    """The four blocks of an NR-DOB loop and every map between its signals.

    Parameters
    ----------
    process, model, controller, filter, keep_factors : as for `nrdob.NRDOB`
        G, Gm, C and F, with the same refusals.
    """

    process: Any
    model: Any
    controller: Any
    filter: Any
    keep_factors: bool = False

    def __post_init__(self) -> None:
        _ = self.fractions

    @cached_property
    def fractions(self) -> LoopFractions:
        """Numerators and denominators of the blocks, without dead times."""
        G, Gm = (
            nonzero(as_fraction(undelayed(block)[0], name), name)
            for block, name in ((self.process, "process"), (self.model, "model"))
        )
        F = filter_fraction(self.filter)
        if F.relative_degree < Gm.relative_degree:
            raise ValueError(
                f"filter has relative degree {F.relative_degree}, model has "
                f"{Gm.relative_degree}: F/model is not causal; use a filter of order "
                f"{Gm.relative_degree} or more"
            )
        return LoopFractions(G, Gm, as_fraction(self.controller, "controller"), F)

    @property
    def delay(self) -> float:
        """Dead time θ of the process, in seconds."""
        return undelayed(self.process)[1]

    @property
    def model_delay(self) -> float:
        """Dead time θm of the model, in seconds; θ where only rounding keeps them apart."""
        _, found = undelayed(self.model)
        return self.delay if abs(found - self.delay) <= SAME_DELAY * found else found

    @cached_property
    def one_minus_F(self) -> QuasiPolynomial:
        """Numerator Df - Nf exp(-θm s) of 1 - F, or of 1 - F exp(-θm s) in a delayed model."""
        # Both constant coefficients are exactly 1, so 1 - F keeps its zero at s = 0 exactly. Those
        # of its next powers that are only rounding are zeros of the same kind.
        num, den = self.fractions.F
        scale = add(np.abs(den), np.abs(num))
        if delay := self.model_delay:
            origin = _zeros_of_difference(den, num, delay)
            return QuasiPolynomial(den, -num, delay, scale, origin=origin)
        difference = add(den, -num)
        used = np.flatnonzero(np.abs(difference) > TYPED_IN * scale)
        difference[used[-1] + 1 :] = 0.0
        return QuasiPolynomial(difference, scale=scale)

    @cached_property
    def built(self) -> BuiltFactors:
        """Factors of the blocks F/Gm and (1 - F) Gm as they are built."""
        gz, Nm, Nf = self.shared_zeros
        gp, Dm, E = _shared(self._factors["Dm"], self.one_minus_F, keep=self.keep_factors)
        return BuiltFactors(Nm, Nf, Dm, E, gz, gp)

    @cached_property
    def shared_zeros(self) -> Shared:
        """What the numerators of model and filter share, and what is left of them."""
        return _shared(self._factors["Nm"], self._factors["Nf"], keep=self.keep_factors)

    @cached_property
    def p_A(self) -> QuasiPolynomial:
        """Characteristic polynomial of the model loop, Dm Dc + Nm Nc."""
        _, Gm, C, _ = self.fractions
        return _sum_of_products(((Gm.den, C.den), 0.0), ((Gm.num, C.num), 0.0))

    @cached_property
    def p_B(self) -> QuasiPolynomial:
        """Characteristic function of the observer loop, without what cancels inside its blocks."""
        G, built = self.fractions.G, self.built
        power = built.E.divided  # of which the terms hold s only together
        delayed = [((G.den, built.Nm.q, p), delay) for p, delay in built.E.terms]
        loop = (G.num, built.Dm.lifted(power).q, built.Nf.q), self.delay
        return _sum_of_products(*delayed, loop, origin=power).over_s(power)

    @cached_property
    def condition_ii(self) -> Quotient:
        """The open loop on which condition ii is counted: F H, or L.

        With a pole on the axis or right of it that has cancelled inside (1 - F) Gm, 1 + FH has a
        zero there, which is no root of the loop; 1 + L has none.
        """
        cancelled = self.built.poles
        if not cancelled.degree:
            return self.FH
        return self.L if cancelled.zeros_at_origin or unstable_roots(cancelled).size else self.FH

    @property
    def ill_posed_model_loop(self) -> str:
        """Why the model loop has no solution at infinite frequency; empty if well posed."""
        _, Gm, C, _ = self.fractions
        if self.p_A.degree == Gm.den.size + C.den.size - 2 and self.p_A.q.any():
            return ""
        return "the model loop is ill-posed: 1 + C(∞)·model(∞) = 0; change the controller"

    @property
    def ill_posed_observer_loop(self) -> str:
        """Why the observer loop has no solution at infinite frequency; empty if well posed."""
        G, _, _, F = self.fractions
        full = G.den.size + self.built.Nm.degree + F.den.size - 1 - self.built.poles.degree
        if self.p_B.q.size - self.p_B.divided == full and self.p_B.q.any():
            return ""
        value = "1 - F(∞) = 0" if self.delay else "1 + F(∞)·H(∞) = 0"
        return f"the observer loop is ill-posed: {value}; choose a filter with another F(∞)"

    @property
    def ill_posed(self) -> str:
        """Why the loop has no solution at infinite frequency; empty if it is well posed."""
        return self.ill_posed_model_loop or self.ill_posed_observer_loop

    # Eq. (4): to the output y.

    T_R = _Map("Nc Ne Nm' Dm' Df", "A B", "Reference R to output y, eq. (4).")
    S_d = _Map("D Nm' E", "B", "Output disturbance d to output y, eq. (4): sensitivity of L.")
    S_delta = _Map("Ne Nm' E", "B", "Input disturbance δ to output y, eq. (4).")
    S_eta = _Map("-1 Ne Dm' Nf'", "B", "Measurement noise η to output y, eq. (4).")

    # Eq. (7): to the error and to the control signal.

    E_R = _Map("Dm Dc", "A", "Reference R to error e, eq. (7), which collapses to 1/(1 + Gm C).")
    U_R = _Map("Nc D Nm' Dm' Df", "A B", "Reference R to controller output u, eq. (7).")
    U_d = _Map("-1 D Dm' Nf'", "B", "Output disturbance d to controller output u, eq. (7).")
    U_delta = _Map("D Nm' E", "B", "Input disturbance δ to plant input u + δ, eq. (7).")
    U_eta = _Map("-1 D Dm' Nf'", "B", "Noise η to controller output u, eq. (7): same as `U_d`.")

    # Blocks and open loops.

    G = _Map("Ne", "D", "The process.")
    Gm = _Map("Nme", "Dm", "The model G̃.")
    C = _Map("Nc", "Dc", "The controller.")
    F = _Map("Nf", "Df", "The filter.")
    ratio = _Map("Ne Dm", "D Nm", "Process over model, G̃⁻¹G; the model without its dead time.")
    CGm = _Map("Nc Nm", "Dc Dm", "Model loop C G̃, condition i; the model without its dead time.")
    H = _Map("mismatch", "D Nm", "Relative mismatch G/G̃ - 1 of Lemma 1, or G/G̃0 - exp(-θm s).")
    FH = _Map("Nf' mismatch", "D Nm' Df", "Observer loop F H, condition ii of Lemmas 1 and 2.")
    K = _Map("Nf' Dm'", "E Nm'", "All the feedback: F/((1 - F) G̃), or F/((1 - F exp(-θm s)) G̃0).")
    L = _Map("Nf' Dm' Ne", "E Nm' D", "Plant loop L = K G, the loop that the plant itself sees.")

    @cached_property
    def _factors(self) -> dict[str, QuasiPolynomial]:
        """Factors of the maps by name, as they are handed in; Ne and Nme are delayed."""
        G, Gm, C, F = self.fractions
        given = {
            "-1": -np.ones(1), "D": G.den, "Nm": Gm.num, "Dm": Gm.den,
            "Nc": C.num, "Dc": C.den, "Nf": F.num, "Df": F.den,
        }  # fmt: skip
        delayed = {"Ne": (G.num, self.delay), "Nme": (Gm.num, self.model_delay)}
        late = {name: QuasiPolynomial(np.zeros(1), *term) for name, term in delayed.items()}
        return {name: QuasiPolynomial(p) for name, p in given.items()} | late

    @cached_property
    def _mismatch(self) -> QuasiPolynomial:
        """Numerator of G/Gm0 - exp(-θm s)."""
        G, Gm, _, _ = self.fractions
        return _sum_of_products(((-G.den, Gm.num), self.model_delay), ((G.num, Gm.den), self.delay))


@dataclass(frozen=True, eq=False)
class ObserverEquations(LoopEquations):
    """Process, model and filter alone: condition ii does not depend on the controller.

    Parameters
    ----------
    process, model, filter, keep_factors : as for `nrdob.NRDOB`
        G, Gm and F, with the same refusals.

    Attributes
    ----------
    controller : float
        0.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import LowPassFilter
    >>> observer = ObserverEquations(ct.tf([2], [1, 1]), ct.tf([1], [1, 1]), LowPassFilter(0.5, 1))
    >>> observer.p_B.q.tolist()                             # (s + 1)(0.5 s) + 2 (s + 1)
    [0.5, 2.5, 2.0]
    """

    controller: Any = field(default=0.0, init=False, repr=False)


def _shared(model: QuasiPolynomial, filter: QuasiPolynomial, *, keep: bool) -> Shared:
    """Take out what a polynomial of the model shares with the filter's; of a delayed one s only."""
    one = QuasiPolynomial(np.ones(1))
    if keep or not (model.degree and filter.degree):
        return Shared(one, model, filter)
    if not filter.delay:
        return shared_factor(model, filter)
    power = min(model.zeros_at_origin, filter.zeros_at_origin)
    return Shared(one.lifted(power), model.over_s(power), filter.over_s(power))


def _zeros_of_difference(den: FloatArray, num: FloatArray, delay: float) -> int:
    """Count the zeros of Df - Nf exp(-θm s) at s = 0, by Taylor's coefficients to rounding."""
    ahead, behind, n = den[::-1], num[::-1], den.size
    taylor = np.array([(-delay) ** k / factorial(k) for k in range(n)])
    difference = ahead - np.convolve(behind, taylor)[:n]
    sizes = np.abs(ahead) + np.convolve(np.abs(behind), np.abs(taylor))[:n]
    return int(np.argmax(np.append(np.abs(difference) > TYPED_IN * sizes, True)))


def _sum_of_products(
    *products: tuple[tuple[FloatArray, ...], float], origin: int = 0
) -> QuasiPolynomial:
    """Multiply out and add, each with its dead time, keeping the size of what may cancel."""
    scale = reduce(add, [reduce(np.convolve, map(np.abs, factors)) for factors, _ in products])
    terms = tuple(Term(reduce(np.convolve, factors), delay) for factors, delay in products)
    return QuasiPolynomial(np.zeros(1), scale=scale, more=terms, origin=origin)
