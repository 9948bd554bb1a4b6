"""Random loops: to try a statement on cases that nobody prepared."""

from __future__ import annotations

import control as ct
import numpy as np

from .diagram import DelayedTransferFunction, LowPassFilter
from .loop import NRDOB
from .numerics import FloatArray

__all__ = ["random_block", "random_loop"]


def random_loop(rng: np.random.Generator, *, delayed: bool = False) -> NRDOB:
    """Draw a well-posed loop, stable or not, from plants and models of orders 1 to 3.

    Poles and zeros lie on both sides of the imaginary axis, real or in pairs, between 0.1 and
    10 rad/s; plant and model share nothing but the scale. The low-pass filter is of the lowest
    causal order.

    Parameters
    ----------
    rng, delayed : numpy.random.Generator, bool
        Source of the numbers, and whether the process has a dead time between 0.01 and 1 s.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> verdicts = [random_loop(rng).stability().stable for _ in range(40)]
    >>> True in verdicts and False in verdicts
    True
    """
    while True:
        process, model = random_block(rng, 3), random_block(rng, 3)
        if delayed:
            process = DelayedTransferFunction(process, 10 ** rng.uniform(-2, 0))
        order = max(1, model.den[0][0].size - model.num[0][0].size)
        controller = random_block(rng, 2)
        filter = LowPassFilter(10 ** rng.uniform(-1.5, 0.5), order)
        loop = NRDOB(process, model, controller, filter)
        if not loop.ill_posed:
            return loop


def random_block(rng: np.random.Generator, max_order: int) -> ct.TransferFunction:
    """Draw a proper rational block of order 1 to `max_order` with a DC gain of either sign.

    Parameters
    ----------
    rng, max_order : numpy.random.Generator, int
        Source of the numbers, and highest order drawn.
    """
    order = int(rng.integers(1, max_order + 1))
    degrees = int(rng.integers(0, order + 1)), order
    num, den = (_random_polynomial(rng, degree) for degree in degrees)
    gain = rng.choice([-1, 1], p=[0.2, 0.8]) * 10 ** rng.uniform(-0.5, 0.5)
    return ct.tf(gain * num / num[-1], den / den[-1])


def _random_polynomial(rng: np.random.Generator, degree: int) -> FloatArray:
    roots: list[complex] = []
    while len(roots) < degree:
        size = 10 ** rng.uniform(-1, 1)
        side = -1 if rng.random() < 0.85 else 1
        if degree - len(roots) >= 2 and rng.random() < 0.5:
            angle = np.arccos(rng.uniform(0.05, 1))
            roots += [side * size * np.exp(1j * angle), side * size * np.exp(-1j * angle)]
        else:
            roots.append(complex(side * size))
    return np.atleast_1d(np.real(np.poly(roots)))
