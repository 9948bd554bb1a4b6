"""Roots in the right half plane by the argument along the axis, in balls: a proof, or None."""

from __future__ import annotations

import math

import flint

from .plain import Terms

MOST_BALLS = 20_000
"""Balls after which the count is given up, as it is next to a root on the axis."""


def rhp_by_argument(found: Terms, most: int = MOST_BALLS) -> float | None:
    """Roots in the open right half plane; None where that takes more than `most` balls.

    Each piece of the axis is a ball of s, in whose image 0 is not: there the argument changes by
    less than half a turn, and is that of the quotient of both ends. Beyond `top` the leading terms
    are larger than all others. nan says that a delayed term is as large as the leading one.
    """
    flint.ctx.prec = 100
    lead = found[0][0]
    n = lead.degree()
    rest = sum(abs(float(p[n])) for p, _ in found[1:])
    if any(p.degree() > n for p, _ in found) or rest >= abs(float(lead[n])) * (1 - 1e-9):
        return math.nan
    sizes = [sum(abs(float(p[k])) for p, _ in found) for k in range(n)]
    gap = abs(float(lead[n])) - rest
    top = max((2 * (2 * size / gap) ** (1 / (n - k)) for k, size in enumerate(sizes)), default=1.0)

    def value(low, high):
        s = flint.acb(0, flint.arb((low + high) / 2, (high - low) / 2 * 1.0001))
        return sum((value_at(p, s) * (-flint.arb(T) * s).exp() for p, T in found), flint.acb(0))

    todo, angle, count = [(0.0, top)], 0.0, 0
    while todo:
        low, high = todo.pop()
        count += 1
        if count > most or high - low < 1e-13 * high:
            return None
        if value(low, high).contains(0):
            middle = (low + high) / 2
            todo += [(middle, high), (low, middle)]
            continue
        angle += float((value(high, high) / value(low, low)).arg().mid())
    end = flint.acb(flint.arb(lead[n])) * flint.acb(0, 1) ** n
    angle += float((end / value(top, top)).arg().mid())
    return round(n / 2 - angle / math.pi)


def value_at(p: flint.fmpq_poly, s: flint.acb) -> flint.acb:
    """Evaluate a polynomial in balls."""
    value = flint.acb(0)
    for k in range(p.degree(), -1, -1):
        value = value * s + flint.acb(flint.arb(p[k]))
    return value
