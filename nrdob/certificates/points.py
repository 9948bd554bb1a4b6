"""Points of the imaginary axis between which a function keeps to a half plane.

With u the direction of f(jm), m the middle between two points a and b, r half their distance ::

    Re(conj(u) f(jm)) > r |Re(conj(u) j f'(jm))| + r²/2 max|f''|

keeps f(jω) to the half plane around u from a to b, by Taylor's formula; what fails is halved. With
several functions u is the middle of their directions. Where a dead time may differ by up to h, the
term that has it changes by at most min(hω, 2) times its size, which is added to the rest. This is
computed in floating point, for all pieces at once and with some slack; the proof is the checker's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..numerics import BoolArray, ComplexArray, FloatArray, Term, add

__all__ = ["half_plane_points"]

SLACK = 1.02  # by how much values exceed their bounds here, so that they do in exact fractions, too
MOST = 20_000  # points that a certificate may have

OCTAVES = np.arange(-400.0, 400.0)

Terms = tuple[Term, ...]
Moved = tuple[float, float]


def half_plane_points(
    functions: Sequence[Terms], power: int = 0, *, delay: float = 0.0, within: float = 0.0
) -> FloatArray:
    """Find points of the imaginary axis that prove how often functions turn around 0, in rad/s.

    Functions are sums of terms, first the one without a dead time, of which a `power` of s is
    divided out; `delay` is the dead time that may differ, by `within`. They are followed from 0 to
    where the leading term dominates. An ArithmeticError if a root is on the axis to rounding, or a
    delayed term is as large as the leading one at infinite frequency.
    """
    last = max(map(_last, functions))
    scaled = [_scaled(terms, last) for terms in functions]
    moved = delay * last, within * last
    ends = _pieces(scaled, _first(scaled, power, moved), moved)
    return np.sort(ends) * last


def _scaled(terms: Terms, frequency: float) -> Terms:
    """Take a function over to another unit of frequency, with the leading coefficient ±1."""
    lead = abs(terms[0].q[0]) * frequency ** (terms[0].q.size - 1)
    return tuple(
        Term(q * frequency ** np.arange(q.size)[::-1] / lead, T * frequency) for q, T in terms
    )


def _pieces(functions: Sequence[Terms], first: float, moved: Moved) -> FloatArray:
    """Halve the octaves between `first` and 1 until each piece has its half plane."""
    high = first * 2.0 ** np.arange(1, 1 - np.log2(first))
    low, done = high / 2, np.array([0.0, first])
    while low.size:
        held = _keep_to_half_plane(functions, low, high, moved)
        done = np.append(done, high[held])
        low, high = low[~held], high[~held]
        middle = (low + high) / 2
        if done.size + 2 * low.size > MOST:
            raise ArithmeticError(f"more than {MOST} points of the imaginary axis are needed")
        if np.any((middle <= low) | (middle >= high)):
            raise ArithmeticError("a root is on the imaginary axis, or too close to it")
        low, high = np.append(low, middle), np.append(middle, high)
    return done


def _keep_to_half_plane(
    functions: Sequence[Terms], low: FloatArray, high: FloatArray, moved: Moved
) -> BoolArray:
    found = [_around(terms, low, high, moved) for terms in functions]
    first, *_ = (value for value, *_ in found)
    angles = np.array([np.angle(value * np.conj(first)) for value, *_ in found])
    middle = (angles.min(axis=0) + angles.max(axis=0)) / 2
    u = np.exp(1j * (np.angle(first) + middle))
    held = [
        (np.conj(u) * value).real - np.abs((np.conj(u) * change).real) * SLACK > SLACK * rest
        for value, change, rest in found
    ]
    return np.asarray(np.all(held, axis=0))


def _around(
    terms: Terms, low: FloatArray, high: FloatArray, moved: Moved
) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Give f in the middle, its change up to the end, and a bound on the rest with rounding."""
    middle, reach = (low + high) / 2, (high - low) / 2
    s = 1j * middle
    value: ComplexArray = np.zeros_like(s)
    slope: ComplexArray = np.zeros_like(s)
    bend, rounding, stray = (np.zeros_like(high) for _ in range(3))
    for q, delay in terms:
        delayed = np.exp(-delay * s)
        once, twice = _derivatives(q, delay, 2)
        value += np.polyval(q, s) * delayed
        slope += np.polyval(once, s) * 1j * delayed
        bend += np.polyval(np.abs(twice), high)
        if delay == moved[0]:
            stray += np.minimum(moved[1] * high, 2) * np.polyval(np.abs(q), high)
        rounding += np.polyval(np.abs(q), middle) * (q.size + delay * middle)
    rest = reach**2 / 2 * bend + stray + 4 * float(np.finfo(float).eps) * rounding
    return value, reach * slope, rest


def _last(terms: Terms) -> float:
    """Power of two beyond which the leading term is larger than all others together."""
    (p, _), *delayed = terms
    n, others = p.size - 1, [p[1:], *(q for q, _ in delayed)]
    rest = np.zeros_like(OCTAVES)
    with np.errstate(over="ignore", invalid="ignore"):
        for q in others:
            powers = np.arange(q.size)[::-1] - n
            sizes = np.abs(q) * 2.0 ** np.multiply.outer(OCTAVES, powers)
            rest += np.sum(sizes, axis=1, where=q != 0)
    beyond = np.flatnonzero(rest >= np.abs(p[0]) / SLACK)
    if beyond.size and beyond[-1] == OCTAVES.size - 1:
        raise ArithmeticError("a delayed term is as large as the leading one at infinite frequency")
    return float(2.0 ** OCTAVES[beyond[-1] + 1 if beyond.size else 0])


def _first(functions: Sequence[Terms], power: int, moved: Moved) -> float:
    """Power of two below 1 up to which all, less roots at s = 0, keep their first direction."""
    high = 2.0 ** np.arange(0.0, OCTAVES[0], -1)
    if power:
        held = np.all([_keeps(terms, power, high) for terms in functions], axis=0)
    else:
        held = _keep_to_half_plane(functions, np.zeros_like(high), high, moved)
    if not held.any():
        raise ArithmeticError("a root is at s = 0, or too close to it")
    return float(high[np.argmax(held)])


def _keeps(terms: Terms, power: int, high: FloatArray) -> BoolArray:
    """Whether f, of which a power of s is divided out, keeps its first direction up to `high`."""
    known, bend = 0.0, np.zeros_like(high)
    for q, delay in terms:
        *_, last, beyond = q, *_derivatives(q, delay, power + 1)
        known += float(np.polyval(last, 0.0))  # nothing is left of a polynomial of low degree
        bend += np.polyval(np.abs(beyond), high)
    return np.asarray(abs(known) > SLACK * high * bend / (power + 1))


def _derivatives(q: FloatArray, delay: float, order: int) -> list[FloatArray]:
    """Polynomials before exp(-delay s) in the derivatives of q(s) exp(-delay s)."""
    found = [q]
    for _ in range(order):
        found.append(add(np.polyder(found[-1]), -delay * found[-1]))
    return found[1:]
