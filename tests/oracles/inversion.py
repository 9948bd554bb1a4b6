"""Laplace inversion: by the exponential of a matrix in balls, and on Talbot's contour.

What has come around the loop i times through the plant and k times through the model is a rational
transform behind its own dead time. One way inverts each with a certified radius, the other on a
contour in 240 digits with more points, until it goes around all poles and two sums agree.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from flint import acb, acb_poly, arb, arb_mat, ctx, fmpq, fmpq_poly

from .plain import Plain, exact_polynomial

NODES = 60, 90, 135, 200, 300, 450, 675
"""Points of the contour, until two sums agree."""

PRECISION = 800
"""Bits."""

ECHOES = 60
"""Echoes at most up to the last time."""

_CERTIFIED = 1e-13

_MOST_BITS = 200_000


def inverse_laplace(num: fmpq_poly, den: fmpq_poly, t: fmpq) -> float:
    """Return the inverse of num/den, strictly proper, at one exact time t >= 0, as a float."""
    n, lead = den.degree(), den[den.degree()]
    bits = 300
    while bits < _MOST_BITS:
        ctx.prec = bits
        A = arb_mat(n, n, [0] * n**2)
        for i in range(n - 1):
            A[i, i + 1] = 1
        for i in range(n):
            A[n - 1, i] = -arb(den[i] / lead)
        impulse = (A * arb(t)).exp()
        value = sum((arb(num[i] / lead) * impulse[i, n - 1] for i in range(n)), arb(0))
        size = abs(float(value.mid()))
        if float(value.rad()) <= max(_CERTIFIED * size, 1e-60):
            return float(value.mid())
        bits *= 2
    raise ArithmeticError("not certified")


@cache
def points_of(nodes: int) -> list[tuple[acb, acb]]:
    """Points of Talbot's contour and their weights, at t = 1."""
    ctx.prec = PRECISION
    r = arb(2 * nodes) / 5
    found = [(acb(r), acb(r).exp() * r / (2 * nodes))]
    for k in range(1, nodes):
        angle = arb.pi() * k / nodes
        cot = angle.cos() / angle.sin()
        point = acb(r * angle * cot, r * angle)
        slope = acb(1, angle * (1 + cot * cot) - cot)
        found.append((point, point.exp() * slope * r / nodes))
    return found


def inverted(num: acb_poly, den: acb_poly, t: arb, contour: list[tuple[acb, acb]]) -> arb:
    ctx.prec = PRECISION  # of the process: another oracle may have set its own
    total = arb(0)
    for point, weight in contour:
        s = point / t
        total += (weight * num(s) / den(s)).real
    return total / t


def talbot_step(loop: Plain, input: str, t: float) -> tuple[float, float]:
    """Return y and u (for delta the plant's input) at a time off all jumps."""
    before = (math.inf, math.inf)
    for nodes in NODES:
        found = _summed(loop, input, t, nodes)
        if found is None:
            continue
        if all(abs(a - b) <= 1e-11 * abs(b) for a, b in zip(before, found, strict=True)):
            return found
        before = found
    raise ArithmeticError("Talbot's contour does not resolve this transform")


def _encloses(nodes: int, p: fmpq_poly, t: float) -> bool:
    """Whether the contour goes around all roots of p, at this time and all earlier ones."""
    roots = np.roots([float(c) for c in reversed(p.coeffs())]) * t / (0.4 * nodes)
    height = np.maximum(np.abs(roots.imag), 1e-9)
    return bool(np.all((height < 2.5) & (roots.real < height / np.tan(height) - 0.1)))


def _summed(loop: Plain, input: str, t: float, nodes: int) -> tuple[float, float] | None:
    """y and u by so many nodes; None where a pole is not inside the contour by far."""
    ctx.prec = PRECISION
    (N, D), (Nm, Dm), (Nc, Dc), (Nf, Df) = (
        (exact_polynomial(num), exact_polynomial(den))
        for num, den in (loop.G, loop.Gm, loop.C, loop.F)
    )
    theta, wait = loop.delay, loop.model_delay
    one, s = fmpq_poly([1]), fmpq_poly([0, 1])
    # y and u times P = D Nm Df - D Nm Nf E' + N Dm Nf E: polynomials by the dead times before them.
    P = [(D * Nm * Df, 0, 0), (-D * Nm * Nf, 0, 1), (N * Dm * Nf, 1, 0)]
    beside = Dm * Dc + Nm * Nc if input == "R" else one
    ends = {
        "R": ([(N * Nm * Df * Nc * Dm, 1, 0)], [(D * Nm * Df * Nc * Dm, 0, 0)]),
        "d": ([(D * Nm * Df, 0, 0), (-D * Nm * Nf, 0, 1)], [(-D * Dm * Nf, 0, 0)]),
        "eta": ([(-N * Dm * Nf, 1, 0)], [(-D * Dm * Nf, 0, 0)]),
        "delta": (
            [(N * Nm * Df, 1, 0), (-N * Nm * Nf, 1, 1)],
            [(D * Nm * Df, 0, 0), (-D * Nm * Nf, 0, 1)],
        ),
    }[input]

    def late(i: int, k: int) -> fmpq:
        return i * fmpq(*theta.as_integer_ratio()) + k * fmpq(*wait.as_integer_ratio())

    q = sum((p for p, i, k in P if not late(i, k)), fmpq_poly([0]))
    r1 = P[2][0] if theta else fmpq_poly([0])
    r2 = P[1][0] if wait else fmpq_poly([0])
    if not all(_encloses(nodes, p, t) for p in (q, beside)):
        return None
    time, contour, values = fmpq(*float(t).as_integer_ratio()), points_of(nodes), []
    for end in ends:
        total = arb(0)
        for a, i0, k0 in end:
            for i in range(ECHOES if theta else 1):
                for k in range(ECHOES if wait else 1):
                    left = time - late(i0 + i, k0 + k)
                    if left <= 0:
                        break
                    num = a * (-r1) ** i * (-r2) ** k * math.comb(i + k, i)
                    den = s * beside * q ** (i + k + 1)
                    total += inverted(acb_poly(num), acb_poly(den), arb(left), contour)
        values.append(float(total.mid()))
    return values[0], values[1]
