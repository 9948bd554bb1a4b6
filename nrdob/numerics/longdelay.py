r"""The rightmost roots of :math:`q(s) + r(s)\,e^{-sT} + …` when T is long.

Then the roots lie where :math:`sT = \ln(-r/q) + 2\pi jk`: close to a curve along the imaginary
axis, at a distance of :math:`\ln|r/q|/T`, and near roots of q on its right. The rightmost ones are
those near the highest points of the curve. Newton's method finds them from there, and a count of
the roots to the right of a vertical line shows that nothing has been missed (Lichtner, Wolfrum,
Yanchuk, SIAM J. Math. Anal. 43, 2011, 788-802). With a second dead time the guesses are where a
step of Newton's method from the axis is smallest.
"""

from __future__ import annotations

from math import pi, tau

import numpy as np

from .argument import Term, argument_change
from .arrays import ComplexArray, FloatArray, runs
from .coefficients import add, pade
from .rootfinding import Delayed, companion_roots, frequencies_beside, value_and_slope, vanishing

__all__ = ["rightmost_roots"]

PEAKS, NEIGHBOURS = 8, 6  # highest points of the curve, and roots on either side of each
SHOWN = 400  # if fewer roots than this are in the right half plane, all of them are looked for

PER_TURN, MOST_DIPS = 12, 100_000
"""Frequencies to each turn of the longest of several dead times, and at most."""

PADE_ORDER = 6  # of the rational that stands for the dead time near s = 0
BESIDE = 1e-4  # how far to the right of the rightmost root the line is laid, against its distance


def rightmost_roots(q: FloatArray, delayed: Delayed) -> ComplexArray:
    """Find roots of q + sum of r exp(-sT), of which none lies to the right of the first.

    The leading coefficient of q dominates; the longest dead time comes first. There may be others
    between the roots. The first one's real part is known to be the largest, to four digits; there
    are none if no such root was found.
    """
    longest = delayed[0][1]
    guesses = _guesses(q, *delayed[0]) if len(delayed) == 1 else _dips(q, delayed)
    found = _newton(q, delayed, guesses)
    if not found.size:
        return found
    rightmost = found[0]
    margin = BESIDE * max(abs(rightmost.real), 1e-6 * abs(rightmost), 1e-6 / longest)
    return found if _none_right_of(q, delayed, rightmost.real + margin) else found[:0]


def _guesses(q: FloatArray, r: FloatArray, delay: float) -> ComplexArray:
    zeros, poles = companion_roots(np.trim_zeros(r, "f")), companion_roots(q)
    omega = _frequencies(np.concatenate([zeros, poles]), delay)
    height = _log_ratio(q, r, 1j * omega).real
    inner = np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] >= height[2:])) + 1
    peaks = omega[inner[np.argsort(-height[inner])[:PEAKS]]]
    turn_of_delay = tau / delay
    beside = turn_of_delay * np.arange(-NEIGHBOURS, NEIGHBOURS + 1)
    near = [(peaks[:, None] + beside).ravel(), turn_of_delay * np.arange(0.05, NEIGHBOURS, 0.5)]
    bands = [(omega[max(i - 1, 0)], omega[min(k, omega.size - 1)]) for i, k in runs(height > 0)]
    if sum(high - low for low, high in bands) < SHOWN * turn_of_delay:
        near += [np.arange(low, high + turn_of_delay, turn_of_delay) for low, high in bands]
    s = 1j * np.maximum(np.abs(np.concatenate(near)), 1e-3 / delay)
    for _ in range(4):  # sT = ln(-r/q) + 2πjk, with the k that is nearest
        ratio = _log_ratio(q, r, s)
        excess = s.imag * delay - ratio.imag
        moved = (ratio.real + 1j * (s.imag * delay - excess + tau * np.round(excess / tau))) / delay
        s = np.where(np.isfinite(moved), moved, s)
    return np.concatenate([s, poles, _slow_roots(q, r, delay)])


def _dips(q: FloatArray, delayed: Delayed) -> ComplexArray:
    """Guesses where a sum of several terms is smallest along the axis, and poles of q."""
    poles = companion_roots(q)
    corners = [np.concatenate([poles, companion_roots(r)]) for r, _ in delayed]
    omega = _frequencies(np.concatenate(corners), delayed[0][1])
    sizes = sum(np.abs(np.polyval(r, 1j * omega)) for r, _ in delayed)
    reached = np.flatnonzero(sizes > 0.1 * np.abs(np.polyval(q, 1j * omega)))
    last = omega[reached[-1]] if reached.size else omega[0]
    step = tau / (PER_TURN * delayed[0][1])
    omega = np.union1d(omega[omega <= last], step * np.arange(1, min(last / step, MOST_DIPS)))
    s = 1j * omega
    value, slope = value_and_slope(q, delayed, s)
    nearness = np.abs(value / slope)  # about the distance of a root
    inner = nearness[1:-1]
    dips = 1 + np.flatnonzero((inner <= nearness[:-2]) & (inner <= nearness[2:]))
    nearest = dips[np.argsort(nearness[dips])[:SHOWN]]
    return np.concatenate([s[nearest] - (value / slope)[nearest], poles])


def _frequencies(roots: ComplexArray, delay: float) -> FloatArray:
    """Frequencies over the range of the roots, dense where one is near the axis."""
    corners = np.append(np.abs(roots), 1 / delay)
    corners = corners[corners > 0]
    grid = [np.geomspace(corners.min() / 1e3, corners.max() * 1e3, 600)]
    grid += frequencies_beside(roots, 40)
    omega = np.unique(np.concatenate(grid))
    return np.asarray(omega[omega > 0])


def _log_ratio(q: FloatArray, r: FloatArray, s: ComplexArray) -> ComplexArray:
    with np.errstate(all="ignore"):
        return np.asarray(np.log(-np.polyval(r, s) / np.polyval(q, s)))


def _slow_roots(q: FloatArray, r: FloatArray, delay: float) -> ComplexArray:
    """Roots of the equation with Padé's approximation of the dead time, good near s = 0."""
    num, den = pade(PADE_ORDER, delay)
    found = companion_roots(np.trim_zeros(add(np.convolve(q, den), np.convolve(r, num)), "f"))
    return found[np.abs(found) * delay < 2 * PADE_ORDER]


def _newton(q: FloatArray, delayed: Delayed, s: ComplexArray) -> ComplexArray:
    """Newton's method on p from many guesses; what converges, each once, with its conjugate."""
    longest = delayed[0][1]
    with np.errstate(all="ignore"):
        for _ in range(40):
            value, slope = value_and_slope(q, delayed, s)
            step = value / slope
            # A step of more than a turn of the dead time says nothing.
            size = np.abs(step) * longest
            s = s - np.where(size > 2, 2 * step / size, step)
            if np.all(~np.isfinite(s) | (size <= 1e-12 * (1 + np.abs(s) * longest))):
                break
        s = s[np.isfinite(s) & vanishing(q, delayed, s)]
    s = np.where(s.imag < 0, s.conj(), s)
    s = np.where(np.abs(s.imag) <= 1e-9 * np.abs(s), s.real, s)
    s = s[np.lexsort((s.real, s.imag))]
    s = s[np.abs(np.diff(s, prepend=np.inf)) > 1e-7 * (np.abs(s) + 1 / longest)]
    s = np.concatenate([s, s[s.imag > 0].conj()])
    return np.asarray(s[np.lexsort((-s.imag, -s.real))])


def _none_right_of(q: FloatArray, delayed: Delayed, line: float) -> bool:
    """Whether the argument along a vertical line shows that no root has a larger real part."""
    terms = [Term(_shifted(q, line), 0.0)]
    scale = _shifted(np.abs(q), abs(line))
    for r, delay in delayed:
        shrink = float(np.exp(-delay * line))
        terms.append(Term(shrink * _shifted(r, line), delay))
        scale[-r.size :] += shrink * _shifted(np.abs(r), abs(line))
    neutral = sum(abs(r[0]) for r, _ in terms[1:] if r.size == q.size)
    if neutral >= abs(q[0]):  # to the left of where chains of roots go
        return False
    try:
        found = argument_change(terms, scale)
    except ArithmeticError:
        return False
    return bool(abs((q.size - 1) / 2 - found.angle / pi) < 0.5)


def _shifted(p: FloatArray, by: float) -> FloatArray:
    """Coefficients of p(s + by)."""
    return np.asarray(np.poly1d(p)(np.poly1d([1.0, by])).coeffs)
