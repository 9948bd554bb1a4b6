r"""Power of white noise behind a map: the square of its :math:`\mathcal H_2` norm.

.. math:: \|Q\|_2^2 = \frac1{2\pi}\int_{-\infty}^{\infty} |Q(j\omega)|^2\,d\omega

Without dead time it follows from the coefficients in finitely many steps, none of which subtracts
a larger number (Åström's recursion, the Routh table carried on). With dead time it is an
integral over frequencies between which the denominator provably has no zero, so that no resonance
is missed; beyond the last one

.. math:: |Q|^2 = W + 2\,\mathrm{Re}\,X,\qquad W = \frac{n\tilde n}{q\tilde q - r\tilde r},\qquad
          X = -W\,\frac{r\,e^{-sT}}{q + r\,e^{-sT}},\qquad \tilde n(s) = n(-s),

where W is rational, and X, which turns for ever on the imaginary axis, dies out to its right: there
it is integrated. With several dead times the integral goes on until what turns cannot matter any
more, and of what is beyond only the mean is left, which is rational. By Parseval's theorem the same
integral of Q/s is the energy :math:`\int_0^\infty q(t)^2 dt` of what is left of a step.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, pi
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from ..numerics import (
    ComplexArray,
    FloatArray,
    QuasiPolynomial,
    count_rhp,
    frequency_segments,
    multiply,
)

__all__ = ["check_stable", "noise_power", "rational_power", "step_energy"]

Density = Callable[[FloatArray], FloatArray]

TOLERANCE = 1e-10  # relative error of the integral at which no interval is halved any more

MAX_INTERVALS = 2_000_000

(FEWER_NODES, FEWER_WEIGHTS), (MORE_NODES, MORE_WEIGHTS) = map(leggauss, (7, 10))
NODES, UNIT = np.append(FEWER_NODES, MORE_NODES), np.array([0.0, 0.5, 1.0])


def noise_power(
    num: tuple[QuasiPolynomial, ...], den: tuple[QuasiPolynomial, ...], name: str
) -> float:
    """Integrate ``|num/den|²`` over all frequencies, over 2π: see `Quotient.noise_power`."""
    check_stable(den, f"the noise power of {name}")
    top, bottom = multiply(*num), multiply(*den)
    if top.degree >= bottom.degree:
        raise ValueError(
            f"the noise power of {name} is infinite: it is not strictly proper and lets all "
            "frequencies through; use a filter of higher order, or a map that rolls off, or give "
            "the noise a shaping filter"
        )
    return _power(num, den)


def step_energy(
    num: tuple[QuasiPolynomial, ...], den: tuple[QuasiPolynomial, ...], name: str
) -> float:
    """Integrate ``|num/(den s)|²`` over all frequencies, over 2π: see `Quotient.step_energy`."""
    check_stable(den, f"the energy of a step through {name}")
    k = next((k for k, factor in enumerate(num) if factor.zeros_at_origin), None)
    return inf if k is None else _power((*num[:k], num[k].over_s(1), *num[k + 1 :]), den)


def check_stable(den: tuple[QuasiPolynomial, ...], what: str) -> None:
    """Refuse a denominator with roots that are not in the left half plane: nothing is finite."""
    for factor in den:
        found = count_rhp(factor)
        if factor.zeros_at_origin or found.count != 0:
            where = found.reason or "roots in the right half plane"
            if factor.zeros_at_origin:
                where = "a root at s = 0"
            raise ValueError(
                f"{what} is infinite or undecided: its denominator has {where}; "
                "make the loop stable first, see stability()"
            )


def _power(num: tuple[QuasiPolynomial, ...], den: tuple[QuasiPolynomial, ...]) -> float:
    top, bottom = multiply(*num), multiply(*den)
    if not any(term.q.any() for term in top.terms):
        return 0.0

    def density(omega: FloatArray) -> FloatArray:
        return np.asarray(np.abs(top(1j * omega) / bottom(1j * omega)) ** 2)

    power = max(top.divided, bottom.divided)
    above, below = top.lifted(power), bottom.lifted(power)  # the terms without powers of 1/s
    num_alone = above.r if above.delay else above.q  # a dead time alone changes no size
    several = below.more or above.more or (above.delay and above.q.any())
    if not (several or below.delay):
        return rational_power(num_alone, below.q)
    edges = np.unique(np.concatenate([frequency_segments(factor) for factor in den]))
    body = _integral(density, edges, 0.0).real
    if several:
        return _turning_power(above, below, density, edges, body)
    return _delayed_power(num_alone, below, float(edges[-1]), body)


def rational_power(num: FloatArray, den: FloatArray) -> float:
    r"""Integrate ``|num/den|²`` over all frequencies and divide by 2π, by Åström's recursion.

    That of Introduction to Stochastic Control Theory, Academic Press 1970, chapter 5.

    Parameters
    ----------
    num, den : array of float
        Coefficients in descending powers; den Hurwitz and of higher degree.

    Examples
    --------
    >>> rational_power(np.array([1.0]), np.array([2.0, 1.0]))
    0.25
    """
    a = den / den[0]
    b = np.concatenate([np.zeros(den.size - 1 - num.size), num / den[0]])
    power = 0.0
    while a.size > 1:
        if not a[1] > 0:
            raise ArithmeticError("the denominator has a root on the imaginary axis to rounding")
        ratio, share, third = a[0] / a[1], b[0] / a[1], a[3::2]
        power += share * share / (2 * ratio)
        a, b = a[1:].copy(), b[1:].copy()
        a[1 : 2 * third.size : 2] -= ratio * third
        b[1 : 2 * third.size : 2] -= share * third
    return float(power)


def _delayed_power(num: FloatArray, den: QuasiPolynomial, end: float, body: float) -> float:
    """Add to the integral up to a frequency what is beyond it: W, and X beside the axis."""
    top, q, r = QuasiPolynomial(num), QuasiPolynomial(den.q), QuasiPolynomial(den.r)

    def rational(s: ComplexArray) -> ComplexArray:
        return np.asarray(top(s) / q(s) * top(-s) / q(-s) / (1 - r(s) / q(s) * (r(-s) / q(-s))))

    def turning(s: ComplexArray) -> ComplexArray:
        delayed = r(s) / q(s) * np.exp(-den.delay * s)
        return np.asarray(-rational(s) * delayed / (1 + delayed))

    def beside(x: FloatArray) -> ComplexArray:  # s = j end + end x/(1 - x)
        return np.asarray(turning(1j * end + end * x / (1 - x)) * end / (1 - x) ** 2)

    side = _integral(beside, UNIT, body)
    return float(body + _beyond(rational, end, body) + 2 * (side / 1j).real) / pi


def _turning_power(
    top: QuasiPolynomial, den: QuasiPolynomial, density: Density, edges: FloatArray, body: float
) -> float:
    """Integrate with several dead times further than `edges`, until their turning averages out."""
    lead = QuasiPolynomial(den.q)
    delays = sorted({delay for p in (top, den) for _, delay in p.terms})
    beats = np.diff(delays)

    def mean(s: ComplexArray) -> FloatArray:
        sizes = [np.abs(np.polyval(p, s)) ** 2 for p, _ in top.terms]
        return np.asarray(sum(sizes) / np.abs(lead(s)) ** 2)

    def turning(omega: float) -> float:
        """Bound of the integral beyond of what turns: once around, and what two turns leave."""
        s = np.array([1j * omega])
        late = sum(float(np.abs(np.polyval(p, s) / lead(s))[0]) for p, _ in den.delayed)
        sizes = [float(np.abs(np.polyval(p, s) / lead(s))[0]) for p, _ in top.terms]
        once = sum(sizes) ** 2 - sum(size**2 for size in sizes) + 2 * late * sum(sizes) ** 2
        twice = 3 * late**2 * sum(sizes) ** 2 / max(1 - late, 1e-3) ** 2
        return once * min(4 / float(beats.min()), omega) + twice * omega

    step = pi / delays[-1]
    while turning(edges[-1]) > TOLERANCE * body:
        count = max(int(edges[-1] / step), 1)
        if count > MAX_INTERVALS:
            raise ArithmeticError(
                "what turns with the dead times dies out too slowly: the noise power needs over "
                f"{MAX_INTERVALS} intervals; use a filter of higher order"
            )
        edges = edges[-1] + max(edges[-1] / count, step) * np.arange(count + 1)
        body += _integral(density, edges, body).real
    return float(body + _beyond(mean, edges[-1], body)) / pi


def _beyond(f: Callable[[ComplexArray], NDArray[Any]], end: float, besides: float) -> float:
    """Integrate over the frequencies ω = end/x from `end` on."""
    return _integral(lambda x: f(1j * (end / x)) * end / x**2, UNIT, besides).real


def _integral(
    f: Callable[[FloatArray], NDArray[Any]], edges: FloatArray, besides: float
) -> complex:
    """Two of Gauss's rules on every interval, halved where they differ."""
    left, right = edges[:-1], edges[1:]
    total, used = 0j, 0
    while left.size:
        used += left.size
        if used > MAX_INTERVALS:
            raise ArithmeticError(
                "the dead time is too long against the loop's bandwidth: the noise power needs "
                f"over {MAX_INTERVALS} intervals"
            )
        half = (right - left) / 2
        points = (left + half)[:, None] + half[:, None] * NODES
        values = np.reshape(f(points.ravel()), points.shape)
        fewer, more = values[:, : FEWER_NODES.size], values[:, FEWER_NODES.size :]
        check, found = half * (fewer @ FEWER_WEIGHTS), half * (more @ MORE_WEIGHTS)
        error, size = np.abs(found - check), abs(total) + np.abs(found).sum() + besides
        done = (error <= TOLERANCE * np.abs(found)) | (error <= 1e-3 * TOLERANCE * size)
        total += complex(found[done].sum())
        left, right = left[~done], right[~done]
        middle = (left + right) / 2
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
    return total
