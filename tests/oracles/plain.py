"""A loop as coefficients, with its polynomials in exact fractions."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from flint import fmpq, fmpq_poly

Terms = list[tuple[fmpq_poly, float]]


class Block(NamedTuple):
    """Coefficients in descending powers of s."""

    num: Any
    den: Any


class Plain(NamedTuple):
    """The four blocks of Fig. 1 without their dead times, and these in seconds."""

    G: Block
    Gm: Block
    C: Block
    F: Block
    delay: float = 0.0
    model_delay: float = 0.0


def low_pass(time_constant: float, order: int) -> Block:
    """F of eq. (1)."""
    den = np.ones(1)
    for _ in range(order):
        den = np.convolve(den, [time_constant, 1.0])
    return Block(np.ones(1), den)


def exact_polynomial(descending: Any) -> fmpq_poly:
    """The polynomial whose coefficients are exactly these floating-point numbers."""
    pairs = (Fraction(float(c)).as_integer_ratio() for c in reversed(descending))
    return fmpq_poly([fmpq(*pair) for pair in pairs])


def p_A(loop: Plain) -> Terms:
    """The characteristic polynomial of the model loop."""
    Nm, Dm, Nc, Dc = (exact_polynomial(p) for block in (loop.Gm, loop.C) for p in block)
    return [(Dm * Dc + Nm * Nc, 0.0)]


def p_B(loop: Plain) -> Terms:
    """Polynomials of the observer loop with their dead times; equal dead times are added up.

    What F/Gm and (1 - F) Gm share with themselves stays in.
    """
    blocks = loop.G, loop.Gm, loop.F
    N, D, Nm, Dm, Nf, Df = (exact_polynomial(p) for block in blocks for p in block)
    total: dict[float, fmpq_poly] = {}
    for p, delay in (
        (D * Nm * Df, 0.0),
        (-D * Nm * Nf, loop.model_delay),
        (N * Dm * Nf, loop.delay),
    ):
        total[delay] = total.get(delay, fmpq_poly()) + p
    return [(p, delay) for delay, p in total.items() if p != 0]
