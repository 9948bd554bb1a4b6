r"""Every stabilising filter: the time constants at which the loop changes sides, exactly.

The observer loop has a root at :math:`s = j\omega` if and only if
:math:`(1 + j\lambda\omega)^n = -H(j\omega)`: an n-th root w of :math:`-H(j\omega)` must have real
part 1, and then :math:`\lambda = \operatorname{Im} w/\omega`. So one looks for the frequencies at
which one of n branches crosses the line Re w = 1, with H evaluated exactly, dead time included.
Between two neighbouring critical time constants the number of roots in the right half plane does
not change; it is counted there by the argument of p_B, which knows nothing of the crossings.
"""

from __future__ import annotations

from itertools import pairwise
from math import inf, pi
from typing import Any, NamedTuple

import numpy as np

from .blocks import BoolArray, ComplexArray, FloatArray, IntArray
from .crossings import bisect, golden, side
from .mismatch import Mismatch
from .quasipoly import add, count_rhp

SAME = 1e-9
"""Relative distance below which two critical time constants are one."""


class CriticalTimeConstant(NamedTuple):
    """A time constant at which roots cross the imaginary axis.

    Attributes
    ----------
    time_constant : float
        λ in seconds.
    frequency : float
        Where they cross, in rad/s; inf for a real root that passes through infinity.
    direction : int
        +1 if they enter the right half plane as λ grows, -1 if they leave it.
    """

    time_constant: float
    frequency: float
    direction: int


def critical_time_constants(
    process: Any, model: Any, order: int, *, floor: float | None = None
) -> list[CriticalTimeConstant]:
    r"""Find every time constant λ at which the observer loop has a root on the imaginary axis.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G, with or without dead time, and G̃.
    order : int
        n of the filter :math:`1/(\lambda s + 1)^n`.
    floor : float, optional
        Smallest λ of interest, in seconds. With dead time the critical time constants accumulate
        at 0 and the list must end somewhere: by default at `default_floor`. Without dead time the
        default is 0, and the list is complete.

    Returns
    -------
    list of CriticalTimeConstant
        Tuples (time_constant, frequency, direction) with growing time constant.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put; if `floor` is not positive and finite, or so small
        that too many turns of the dead time had to be followed.

    Examples
    --------
    Example 2 of the paper, a zero in the right half plane at z = 100: n = 2 needs λ > 1/(2z).

    >>> import control as ct
    >>> s = ct.tf('s')
    >>> critical, = critical_time_constants(0.1*(100 - s)/(s + 2), 10/(s + 2), 2)
    >>> round(critical.time_constant, 9), round(critical.frequency, 3), critical.direction
    (0.005, 200.0, -1)
    """
    mismatch = Mismatch.of(process, model, order)
    return _critical(mismatch, mismatch.checked_floor(floor))


def stabilizing_time_constants(
    process: Any, model: Any, order: int, *, floor: float | None = None
) -> list[tuple[float, float]]:
    r"""Find all λ for which the filter :math:`1/(\lambda s + 1)^n` stabilises the observer loop.

    That is condition ii of Lemma 1: p_B has all its roots in the open left half plane. Condition i
    does not depend on the filter.

    Parameters
    ----------
    process, model, order, floor
        As for `critical_time_constants`.

    Returns
    -------
    list of (low, high)
        Open intervals in seconds, increasing; `high` may be inf. Empty where no λ works. Without
        dead time the list is complete and `low` may be 0. With dead time it is complete above the
        floor, and an interval that begins at the floor may reach below it.

    Raises
    ------
    TypeError, ValueError
        As `critical_time_constants`.
    ArithmeticError
        If the counts of roots contradict the crossings, so that no answer can be trusted.

    Examples
    --------
    Example 3 of the paper: 0 < λ < 3 - √5.

    >>> import control as ct
    >>> s = ct.tf('s')
    >>> (low, high), = stabilizing_time_constants(4/(2 - s - s**2), -1/((s + 1)*(s + 2)), 2)
    >>> low, round(high, 6)
    (0.0, 0.763932)
    """
    mismatch = Mismatch.of(process, model, order)
    return stabilizing_set(mismatch, mismatch.checked_floor(floor))


def stabilizing_set(mismatch: Mismatch, floor: float) -> list[tuple[float, float]]:
    """Find the set of `stabilizing_time_constants` for a mismatch that is already read."""
    intervals = _intervals(floor, _critical(mismatch, floor))
    counts = _counts(mismatch, intervals)
    return [
        (part.low, part.high) for part, count in zip(intervals, counts, strict=True) if count == 0
    ]


def default_floor(process: Any, model: Any, order: int) -> float:
    """Smallest time constant down to which the sets are complete by default, in seconds.

    0 without dead time. With a dead time θ: the λ above which every critical frequency lies within
    the first 32 turns of exp(-jωθ), and at least θ/1000.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import delay
    >>> G = ct.tf([1], [1, 1])
    >>> round(default_floor(delay(0.5) * G, G, 1), 5)
    0.00431
    """
    return Mismatch.of(process, model, order).default_floor


class _Interval(NamedTuple):
    """Neighbouring ends, and by how much the count of roots must change at the lower one."""

    low: float
    high: float
    change: int | None


# Where the crossings are.


def _critical(mismatch: Mismatch, floor: float) -> list[CriticalTimeConstant]:
    found = _crossings(mismatch, mismatch.frequencies(floor)) + _through_infinity(mismatch)
    return sorted(c for c in found if c.time_constant > floor)


def _crossings(mismatch: Mismatch, omega: FloatArray) -> list[CriticalTimeConstant]:
    """Find where a branch of the n-th root of -H(jω) has real part 1, and a positive imaginary one.

    Each branch is continuous in ω: its phase is followed from one frequency to the next.
    """
    n = mismatch.order
    root = _log_minus_H(mismatch, omega)
    phase = np.unwrap(root.imag)

    def less_1(value: ComplexArray, near: FloatArray, of: Any) -> ComplexArray:
        """Branch `of`, less 1, where ln(-H) is `value` and its phase near to `near`."""
        # Whole turns are counted apart: a phase of 2π would leave a branch near 1 only rounding.
        turns = (np.round((near - value.imag) / (2 * pi)) + of) % n
        return np.asarray(np.expm1(value.real / n + 1j * (value.imag + 2 * pi * turns) / n))

    excess = less_1(root, phase, np.arange(n)[:, None])

    def branch(of: Any, at: Any, w: FloatArray) -> ComplexArray:
        """Branch `of`, reached continuously from frequency number `at`, less 1."""
        return less_1(_log_minus_H(mismatch, w), phase[at], of)

    real = excess.real
    sign, size = side(real), np.abs(real)
    # Where R nearly vanishes a branch is so close to 1 that its side is only rounding.
    known = size >= _rounding(mismatch, omega, excess)
    of, at, after = _changes(sign, known)
    low, high = omega[at], omega[after]

    # Two crossings between neighbours leave the same sign at both, but a dip.
    inner = np.s_[:, 1:-1]
    dips = (size[inner] <= size[:, :-2]) & (size[inner] <= size[:, 2:]) & (size[inner] < 1)
    dips &= (sign[inner] == sign[:, :-2]) & (sign[inner] == sign[:, 2:]) & (excess.imag[inner] > 0)
    dip_of, dip_at = np.nonzero(dips & known[inner])
    dip_at = dip_at + 1
    left, right, way = omega[dip_at - 1], omega[dip_at + 1], sign[dip_of, dip_at]
    bottom = golden(lambda w: way * branch(dip_of, dip_at, w).real, left, right)
    hidden = way * branch(dip_of, dip_at, bottom).real < 0
    of = np.concatenate([of, dip_of[hidden], dip_of[hidden]])
    at = np.concatenate([at, dip_at[hidden], dip_at[hidden]])
    low = np.concatenate([low, left[hidden], bottom[hidden]])
    high = np.concatenate([high, bottom[hidden], right[hidden]])
    where = bisect(lambda w: branch(of, at, w).real, low, high)
    value = branch(of, at, where)
    # A pole on the axis makes a branch jump, which is no crossing; a zero there leads through 1,
    # which is λ = 0.
    true = (np.abs(value.real) < 1e-6) & (value.imag > _rounding(mismatch, where, value))
    # A pair leaves where the branch rises through the line as ω grows, and enters where it falls:
    # Re ds/dλ has the sign opposite to that of the slope.
    directions = side(branch(of, at, low).real)[true]
    where, critical = where[true], value.imag[true] / where[true]
    return [
        CriticalTimeConstant(float(c), float(w), int(d))
        for c, w, d in zip(critical, where, directions, strict=True)
    ]


def _rounding(mismatch: Mismatch, omega: FloatArray, excess: ComplexArray) -> FloatArray:
    """Bound the rounding error of a branch w, where w - 1 is `excess`: dw/w = dH/(nH)."""
    with np.errstate(divide="ignore", invalid="ignore"):  # at zeros of H and poles of R
        relative = mismatch.noise(omega) / (mismatch.order * np.abs(1 - mismatch.ratio(omega)))
        return np.asarray(np.nan_to_num(relative * np.abs(1 + excess)))


def _changes(sign: FloatArray, known: BoolArray) -> tuple[IntArray, IntArray, IntArray]:
    """Row and columns before and after each change of sign between neighbouring known entries."""
    found = []
    for row in range(sign.shape[0]):
        columns = np.flatnonzero(known[row])
        changed = np.flatnonzero(sign[row, columns[1:]] != sign[row, columns[:-1]])
        before, after = columns[changed], columns[changed + 1]
        found.append((np.full_like(before, row), before, after))
    of, at, after = (np.concatenate(part) for part in zip(*found, strict=True))
    return of, at, after


def _log_minus_H(mismatch: Mismatch, omega: FloatArray) -> ComplexArray:
    """ln(1 - R(jω)), accurate for small R too, where numpy's complex log1p is not."""
    R = mismatch.ratio(omega)
    with np.errstate(divide="ignore"):  # where H vanishes exactly, all branches are at 0
        size = np.log1p(-R.real * (2 - R.real) + R.imag**2) / 2
    return np.asarray(size + 1j * np.arctan2(-R.imag, 1 - R.real))


def _through_infinity(mismatch: Mismatch) -> list[CriticalTimeConstant]:
    """Find the λ at which the leading coefficient of p_B vanishes: 1 + F(∞) H(∞) = 0."""
    n, (a, b) = mismatch.order, (mismatch.a, mismatch.b)
    if mismatch.delay or mismatch.excess != n or b[0] / a[0] > 0:
        return []
    critical = float((-b[0] / a[0]) ** (1 / n))
    # Near it p_B is a0 (λ^n - critical^n) s^N + second s^(N-1) + …, with one large root.
    second = add(mismatch.undelayed(critical), b)[1]
    return [CriticalTimeConstant(critical, inf, int(-np.sign(second / a[0])))]


# What the intervals between them hold.


def _intervals(floor: float, critical: list[CriticalTimeConstant]) -> list[_Interval]:
    ends, changes = [floor], [0]
    for time_constant, frequency, direction in critical:
        if time_constant > ends[-1] * (1 + SAME) or len(ends) == 1:
            ends.append(time_constant)
            changes.append(0)
        changes[-1] += direction * (1 if frequency == inf else 2)
    known = [None, *changes[1:]]
    return [
        _Interval(*pair, change) for pair, change in zip(pairwise([*ends, inf]), known, strict=True)
    ]


def _counts(mismatch: Mismatch, intervals: list[_Interval]) -> list[float | None]:
    """Count the roots in the right half plane in each interval; None where they cannot be."""
    counts = [_count(mismatch, interval) for interval in intervals]
    for (before, after), interval in zip(pairwise(counts), intervals[1:], strict=True):
        if before is not None and after is not None and after - before != interval.change:
            raise ArithmeticError(
                f"at λ = {interval.low:.9g} s the crossings say that the number of roots in the "
                f"right half plane changes by {interval.change}, but it is {before:g} below and "
                f"{after:g} above: the loop is too stiff for a trustworthy answer"
            )
    return counts


def _count(mismatch: Mismatch, interval: _Interval) -> float | None:
    """Count at a λ inside; near an end a root may be too close to the axis to be counted."""
    low, high = interval.low, interval.high
    typical = 1 / float(np.median(mismatch.speeds))
    if not low:
        low = min(typical, high) / 4
    if high == inf:
        high = 4 * max(typical, low)
    for share in (0.5, 0.25, 0.75, 1e-2, 0.99):
        p = mismatch.p_B(low ** (1 - share) * high**share)
        if p.zeros_at_origin:
            return None
        found = count_rhp(p).count
        if found is not None:
            return found
    return None
