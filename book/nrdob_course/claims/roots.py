"""Roots of p_B, and turns of curves, found without the package's own counts."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np
from scipy.optimize import brentq

from nrdob.diagram import LowPassFilter, Quotient
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray, FloatArray
from nrdob.sampling import random_loop

from .signals import turns

__all__ = [
    "condition_ii", "critical_gain", "enough_turns", "in_right_half", "is_pole", "n_p", "observer",
    "poles_and_zeros", "random_loops", "rightmost", "turns_around_minus_one",
]  # fmt: skip


def observer(ratio: Any, model: Any, time_constant: float, order: int) -> NRDOB:
    """Give a loop by its ratio G/Gm; the controller does not matter."""
    return NRDOB(ratio * model, model, 0.0, LowPassFilter(time_constant, order))


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


def poles_and_zeros(loop: NRDOB) -> ComplexArray:
    """Poles of G and zeros of Gm."""
    return np.concatenate([loop.G.denominator.roots, loop.Gm.numerator.roots])


def is_pole(loop: NRDOB, root: complex) -> bool:
    """Whether |H| grows as its argument comes closer to `root`."""
    far, close = np.abs(loop.H(root + np.array([1e-6j, 1e-9j])))
    return bool(close > 100 * far > 0)


def n_p(loop: NRDOB) -> int:
    """Right half plane poles of G and zeros of Gm, before cancellation."""
    return in_right_half(loop.G.denominator.q) + in_right_half(loop.Gm.numerator.q)


def enough_turns(loop: NRDOB) -> bool:
    """Whether FH turns around −1 as often as Lemma 1 requires."""
    return turns_around_minus_one(loop.FH) == -n_p(loop)


def turns_around_minus_one(open_loop: Quotient, excess: int = 0) -> int:
    """Clockwise turns, followed point by point."""
    return turns(lambda s: 1 + open_loop(s), excess)


def condition_ii(loop: NRDOB) -> bool:
    """Whether all roots of p_B are in the open left half plane."""
    if loop.delay:
        return loop.stability().observer_loop.stable is True
    return bool(rightmost(loop) < -1e-9)
