"""Fig. 1 solved number by number: what the checks compare the printed formulas with.

At one complex s the four blocks are four numbers, and the diagram is three linear equations for the
signals e, u and y. They are solved as they stand; no transfer function is formed on the way. A
formula that is a quotient of polynomials in the four numbers and agrees with the solution for many
random ones is no coincidence. `modes` does the same for the whole diagram as a state space: its
eigenvalues know nothing of p_A, p_B or any encirclement.
"""

from collections.abc import Callable
from math import inf
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq

from nrdob import NRDOB, paper
from nrdob.diagram import Fraction, Quotient
from nrdob.numerics import ComplexArray, FloatArray
from nrdob.sampling import random_loop

__all__ = [
    "ORDERS", "PRINTED_MAPS", "QUADRUPLES", "Values", "critical_gain", "in_right_half",
    "is_refused", "is_stable", "loop_modes", "many_loops", "modes", "n_p", "random_loops",
    "random_points", "rightmost", "turned", "turns", "turns_around_minus_one",
]  # fmt: skip

ORDERS = (1, 2, 3, 4)
AXIS = 1e-7  # how far to the right of the imaginary axis a curve is followed, rad/s
QUADRUPLES = 100  # how many random values of the four blocks a formula is tried on


class Signals(NamedTuple):
    """Error, controller output and process output."""

    e: ComplexArray
    u: ComplexArray
    y: ComplexArray


class Values(NamedTuple):
    """The four blocks at some points s, as arrays of complex numbers, and the diagram solved."""

    G: ComplexArray
    Gm: ComplexArray
    C: ComplexArray
    F: ComplexArray

    @classmethod
    def random(cls, rng: np.random.Generator | int, count: int = QUADRUPLES) -> Self:
        """Draw complex numbers for the four blocks, around 1 in size."""
        parts = np.random.default_rng(rng).normal(size=(2, len(cls._fields), count))
        return cls(*(parts[0] + 1j * parts[1]))

    @classmethod
    def of(cls, loop: NRDOB, s: ComplexArray) -> Self:
        """Evaluate the blocks of a loop."""
        return cls(loop.G(s), loop.Gm(s), loop.C(s), loop.F(s))

    @property
    def matched(self) -> Self:
        """The same blocks with a perfect model."""
        return self._replace(G=self.Gm)

    @property
    def H(self) -> ComplexArray:
        """Relative mismatch G/Gm - 1."""
        return self.G / self.Gm - 1

    @property
    def FH(self) -> ComplexArray:
        """Observer loop."""
        return self.F * self.H

    @property
    def CGm(self) -> ComplexArray:
        """Model loop."""
        return self.C * self.Gm

    @property
    def B(self) -> ComplexArray:
        """First form of B in Lemma 1, Gm + F (G - Gm)."""
        return self.Gm + self.F * (self.G - self.Gm)

    def equations(self, *, conventional: bool = False) -> ComplexArray:
        """Matrix of the diagram's equations for (e, u, y), one for each point, shape (..., 3, 3).

        Under the conventional observer the measurement, not its filtered estimate, is compared
        with R.
        """
        G, Gm, C, F = self
        one, zero = np.ones_like(G), np.zeros_like(G)
        measured = [one, zero, one] if conventional else [one, (1 - F) * Gm, F]
        rows = [measured, [-C, 1 - F, F / Gm], [zero, -G, one]]
        return np.moveaxis(np.array(rows), (0, 1), (-2, -1))

    def solve(
        self, R: Any = 0, d: Any = 0, delta: Any = 0, eta: Any = 0, *, conventional: bool = False
    ) -> Signals:
        """Solve the diagram for given inputs, numbers or arrays of the shape of the blocks."""
        G, Gm, _, F = self
        compared = eta if conventional else F * eta
        inputs = np.broadcast_arrays(R - compared + 0 * G, -F / Gm * eta, G * delta + d)
        right = np.stack(inputs, axis=-1)[..., None]
        found = np.linalg.solve(self.equations(conventional=conventional), right)[..., 0]
        return Signals(*np.moveaxis(found, -1, 0))

    def map(self, name: str, *, conventional: bool = False) -> ComplexArray:
        """Value of one closed-loop map, by a unit input at one place and nothing elsewhere.

        That of δ to the plant input, U_delta, is u + δ.
        """
        letter, _, source = name.partition("_")
        e, u, y = self.solve(**{source: 1.0}, conventional=conventional)
        return {"E": e, "U": u + 1.0 if source == "delta" else u, "T": y, "S": y}[letter]


PRINTED_MAPS: dict[str, Callable[[Values], ComplexArray]] = {
    "T_R": lambda v: v.C * v.G * v.Gm / ((1 + v.CGm) * v.B),
    "S_d": lambda v: v.Gm * (1 - v.F) / v.B,
    "S_delta": lambda v: v.G * v.Gm * (1 - v.F) / v.B,
    "S_eta": lambda v: -v.G * v.F / v.B,
    "E_R": lambda v: (v.F * (v.G - v.Gm) + v.Gm) / ((1 + v.CGm) * v.B),
    "U_R": lambda v: v.CGm / ((1 + v.CGm) * v.B),
    "U_d": lambda v: -v.F / v.B,
    "U_eta": lambda v: -v.F / v.B,
    "U_delta": lambda v: v.Gm * (1 - v.F) / v.B,
}
"""Eqs. (4) and (7) as the paper prints them."""


def random_points(rng: np.random.Generator) -> ComplexArray:
    """Draw points of the right half plane, where a dead time makes nothing large."""
    points: ComplexArray = rng.uniform(0.1, 3, 4) + 1j * rng.uniform(-10, 10, 4)
    return points


def many_loops() -> list[NRDOB]:
    """Give the seven loops of the paper, 20 random ones, and 10 random ones with dead time."""
    rng = np.random.default_rng(2020)
    printed = [paper.example(number) for number in paper.EXAMPLES]
    modified = [paper.example(number, modified=True) for number in (2, 3, 4)]
    rational = [random_loop(rng) for _ in range(20)]
    delayed = [random_loop(rng, delayed=True) for _ in range(10)]
    return printed + modified + rational + delayed


def loop_modes(loop: NRDOB) -> ComplexArray:
    """Modes of a loop without dead time.

    Parameters
    ----------
    loop : NRDOB
        Without dead time.

    Returns
    -------
    array of complex
        Eigenvalues of the whole diagram, every block realised by itself, in rad/s.
    """
    return modes(*loop.fractions)


def is_refused(*blocks: Any) -> bool:
    """Whether no loop can be built of these blocks."""
    try:
        NRDOB(*blocks)
    except ValueError:
        return True
    return False


def modes(G: Fraction, Gm: Fraction, C: Fraction, F: Fraction) -> ComplexArray:
    """Eigenvalues of the whole diagram, every block realised by itself; F may be unstable here.

    Six blocks run it: C and G, F on u, F/Gm on y, and F on y with (1 - F) Gm on u.
    """
    F_over_Gm = Fraction(np.convolve(F.num, Gm.den), np.convolve(F.den, Gm.num))
    rest = Fraction(np.convolve(np.polysub(F.den, F.num), Gm.num), np.convolve(F.den, Gm.den))
    blocks = [_state_space(block) for block in (C, G, F, F_over_Gm, F, rest)]
    A, B, c, D = (block_diag(*parts) for parts in zip(*blocks, strict=True))
    e, u, y = [0, 0, 0, 0, -1, -1], [1, 0, 1, -1, 0, 0], [0, 1, 0, 0, 0, 0]
    wiring = np.array([e, u, u, y, y, u])  # what each block gets, from what all of them give
    closed = A + B @ wiring @ np.linalg.solve(np.eye(len(blocks)) - D @ wiring, c)
    return np.linalg.eigvals(closed)


def _state_space(block: Fraction) -> tuple[FloatArray, ...]:
    """Companion form of a proper block."""
    den = block.den / block.den[0]
    order = den.size - 1
    num = np.zeros(den.size)
    num[den.size - block.num.size :] = block.num / block.den[0]
    A = np.vstack([-den[1:], np.eye(order)[:-1]]) if order else np.zeros((0, 0))
    c = (num[1:] - num[0] * den[1:])[None]
    return A, np.eye(order)[:, :1].reshape(order, 1), c, num[:1][None]


def turned(values: ComplexArray) -> float:
    """Clockwise turns around 0 along a curve, of which each step is less than half a turn."""
    angle = np.unwrap(np.angle(values))
    return float(angle[0] - angle[-1]) / (2 * np.pi)


def turns(values_at: Callable[[ComplexArray], ComplexArray], excess: int = 0) -> int:
    """Clockwise turns around 0 that a closed Nyquist curve makes, followed point by point.

    It is given at s, which runs up the imaginary axis and leaves poles on it at its left. The arc
    at infinity adds a half turn for each degree of `excess`, by which the map is improper.
    """
    omega = np.append(0.0, np.geomspace(1e-5, 1e6, 2001))
    for _ in range(40):
        values = values_at(1j * omega + AXIS)
        steps = np.angle(values[1:] / values[:-1])
        wide = np.flatnonzero(np.abs(steps) > 0.5)
        if not wide.size:
            return round(excess / 2 - float(steps.sum()) / np.pi)
        omega = np.insert(omega, wide + 1, (omega[wide] + omega[wide + 1]) / 2)
    raise ArithmeticError("the curve turns faster than it can be followed")


def rightmost(loop: NRDOB) -> float:
    """Largest real part of the roots of p_B, for a loop without dead time."""
    return float(np.roots(loop.p_B.q).real.max())


def in_right_half(coefficients: FloatArray) -> int:
    """Roots of a polynomial with positive real part."""
    return int(np.sum(np.roots(coefficients).real > 0))


def critical_gain(order: int) -> float:
    """M_n, the gain factor at which F/(1 − F) is lost, by the roots of (s + 1)^n − 1 + k."""

    def rightmost_root(gain: float) -> float:
        coefficients = np.poly(-np.ones(order))
        coefficients[-1] += gain - 1
        return float(np.roots(coefficients).real.max())

    return inf if rightmost_root(1e3) < 0 else float(brentq(rightmost_root, 1.0, 1e3))


def random_loops(count: int, *, delayed: bool = False) -> list[NRDOB]:
    """Draw loops, always the same ones."""
    rng = np.random.default_rng(11)
    return [random_loop(rng, delayed=delayed) for _ in range(count)]


def n_p(loop: NRDOB) -> int:
    """Right half plane poles of G and zeros of Gm, before cancellation."""
    return in_right_half(loop.G.denominator.q) + in_right_half(loop.Gm.numerator.q)


def turns_around_minus_one(open_loop: Quotient, excess: int = 0) -> int:
    """Clockwise turns, followed point by point."""
    return turns(lambda s: 1 + open_loop(s), excess)


def is_stable(loop: NRDOB) -> bool:
    """Whether a loop is known to be internally stable."""
    return loop.stability().stable is True
