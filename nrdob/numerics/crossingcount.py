r"""Roots in the right half plane counted by the crossings that a growing dead time makes.

As T grows from 0, the roots of :math:`q(s) + r(s)\,e^{-sT}` cross the imaginary axis only at the
frequencies where :math:`|q(j\omega)| = |r(j\omega)|`, which do not depend on T: at :math:`\omega`
for :math:`T = (\varphi + 2\pi m)/\omega` with :math:`e^{j\varphi} = -r/q` and m = 0, 1, 2, …, from
left to right if :math:`|q|^2 - |r|^2` grows with frequency there, else from right to left (Walton
and Marshall, IEE Proceedings D 134, 1987, 101-107). The roots of :math:`q + r` are those for T = 0.
With a second dead time that does not change q is a sum of two terms, which only makes it harder to
find the frequencies.
"""

from __future__ import annotations

from math import floor, sqrt, tau

import numpy as np

from .arrays import FloatArray
from .coefficients import add, exponential
from .crossings import side, zeros
from .exact import multiply, positive_sign_changes, rhp_count, squared_size, total, whole
from .rootfinding import companion_roots, frequencies_beside, polynomial_roots

__all__ = ["count_by_crossings", "crossings_between"]

PER_TURN, MAX_FREQUENCIES = 24, 1_000_000  # of a dead time, and in a band at most
BESIDE_ZERO = 1e-6  # least frequency beside a root at s = 0, against the slowest root or 1/T
AT_ZERO = 1e-6  # angle in radians, and size, at which a crossing belongs to the dead time zero


def count_by_crossings(q: FloatArray, r: FloatArray, delay: float) -> int | None:
    """Count the roots of q + r exp(-sT) in the open right half plane.

    The leading coefficient of q dominates. None where the equation without dead time has roots on
    the axis; a root at s = 0 for every dead time, where q + r = 0, is not counted.
    """
    Q, R = whole(q, r)
    changes = positive_sign_changes(total(squared_size(Q), [-x for x in squared_size(R)]))
    crossings = [(sqrt(x), _crossing_angle(q, r, sqrt(x)), direction) for x, direction in changes]
    count = _count_without_delay(q, r, [omega for omega, angle, _ in crossings if angle == 0])
    if count is None:
        return None
    for omega, angle, direction in crossings:
        # A pair that starts on the axis does not come from the right: it is not lost there.
        first = 0 if angle == 0 and direction < 0 else 1
        count += 2 * direction * (floor((omega * delay - angle) / tau) + first)
    return count + _past_zero(q, (np.zeros(1), 0.0), r, 0.0, delay)


def crossings_between(
    q: FloatArray, fixed: tuple[FloatArray, float], moving: FloatArray, start: float, end: float
) -> int | None:
    """Count the roots that enter the right half plane while one of two dead times changes.

    The term r exp(-sT) in `fixed` stays; the dead time of `moving` goes from `start` to `end`, in
    seconds. None if there are too many frequencies to look at; a root at s = 0 for all dead times,
    where q + r + moving = 0, is not counted.
    """
    r, delay = fixed

    def excess(omega: FloatArray) -> FloatArray:
        s = 1j * omega
        a, b, c = (np.polyval(p, s) for p in (q, r, moving))
        size = np.abs(a) ** 2 + np.abs(b) ** 2 + np.abs(c) ** 2
        return np.asarray((np.abs(a + b * np.exp(-delay * s)) ** 2 - np.abs(c) ** 2) / size)

    count = _past_zero(q, fixed, moving, start, end)
    least = _beside_zero(q, r, moving, max(delay, start, end))
    for low, high in _bands(q, r, moving):
        omega = _frequencies([q, r, moving], delay, max(low, least), high)
        if omega.size > MAX_FREQUENCIES:
            return None
        where = zeros(excess, omega)
        ends = np.concatenate([[low], where, [high]])
        beyond = side(excess((ends[1:-1] + ends[2:]) / 2))
        s = 1j * where
        rest = np.polyval(q, s) + np.polyval(r, s) * np.exp(-delay * s)
        angle = np.angle(-np.polyval(moving, s) / rest)
        turns = [np.floor((where * each - angle) / tau) for each in (start, end)]
        count += 2 * int((beyond * (turns[1] - turns[0])).sum())
    return count


def _bands(q: FloatArray, r: FloatArray, moving: FloatArray) -> list[tuple[float, float]]:
    """Frequencies between which |q + r exp(-sT)| may be as large as the moving term, for any T."""
    a, b, c = map(squared_size, whole(q, r, moving))
    between = total(total(a, b), [-x for x in c])
    product = [-4 * x for x in multiply(a, b)]
    changes = positive_sign_changes(total(multiply(between, between), product))
    edges = [sqrt(x) for x, _ in changes]
    if changes and changes[0][1] > 0:  # negative from zero frequency on
        edges = [0.0, *edges]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _frequencies(
    polynomials: list[FloatArray], delay: float, low: float, high: float
) -> FloatArray:
    """Frequencies of a band, some to each turn of the dead time, dense at roots near the axis."""
    low = max(low, 1e-9 * high)
    step = tau / (PER_TURN * delay)
    count = min((high - low) / step, MAX_FREQUENCIES)
    roots = np.concatenate([companion_roots(p) for p in polynomials])
    grids = [np.linspace(low, high, int(count) + 64), np.geomspace(low, high, 64)]
    omega = np.unique(np.concatenate([*grids, *frequencies_beside(roots, 60)]))
    return np.asarray(omega[(omega >= low) & (omega <= high)])


def _past_zero(
    q: FloatArray, fixed: tuple[FloatArray, float], moving: FloatArray, start: float, end: float
) -> int:
    """Count the real root that passes s = 0, where another one stays, between two dead times."""

    def series(delay: float, power: int) -> float:
        late = ((q, 0.0), fixed, (moving, delay))
        return sum(float(np.convolve(p, exponential(T, power + 1))[-1 - power]) for p, T in late)

    before, after = series(start, 1), series(end, 1)
    if series(start, 0) or before * after >= 0:
        return 0
    at = start + (end - start) * before / (before - after)
    return 1 if after * series(at, 2) < 0 else -1


def _beside_zero(q: FloatArray, r: FloatArray, moving: FloatArray, longest: float) -> float:
    """Frequency below which the excess, which a root at s = 0 makes vanish there, is rounding."""
    if q[-1] + r[-1] + moving[-1]:
        return 0.0
    sizes = np.abs(np.concatenate([companion_roots(p) for p in (q, r, moving)]))
    return BESIDE_ZERO * min(1 / longest, float(sizes[sizes > 0].min(initial=np.inf)))


def _crossing_angle(q: FloatArray, r: FloatArray, omega: float) -> float:
    s, p = 1j * omega, add(q, r)
    angle = float(np.angle(-np.polyval(r, s) / np.polyval(q, s)))
    # Near a root at s = 0 for every dead time all angles are small.
    on_axis = abs(np.polyval(p, s)) <= AT_ZERO * np.polyval(np.abs(p), omega)
    return 0.0 if abs(angle) < AT_ZERO and on_axis else angle % tau


def _count_without_delay(q: FloatArray, r: FloatArray, on_axis: list[float]) -> int | None:
    """Roots of q + r in the right half plane, without those on the axis: they cross from there."""
    p = total(*whole(q, r))
    if not p[-1]:
        p = p[:-1]
    if not on_axis:
        return rhp_count(p)
    roots = polynomial_roots(np.trim_zeros(np.polyadd(q, r), "b"))
    for omega in on_axis:
        for s in (1j * omega, -1j * omega):
            roots = np.delete(roots, np.argmin(np.abs(roots - s)))
    return int(np.sum(roots.real > 0))
