r"""Every stabilising filter: the time constants at which the loop changes sides, exactly.

The critical time constants, at which a root of p_B is on the imaginary axis, come from
`nrdob.design.crossings`. Between two neighbouring ones the number of roots in the right half plane
does not change; it is counted there by the argument of p_B, which knows nothing of the crossings.
"""

from __future__ import annotations

from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from ..diagram import FilterFamily, real_number, undelayed
from ..digital import process_in_w
from ..numerics import count_rhp
from .crossings import CriticalTimeConstant, crossings
from .mismatch import Mismatch
from .mismatchgrid import Frequencies

__all__ = [
    "CriticalTimeConstant", "Interval", "critical_time_constants", "intersection",
    "stabilizing_set", "stabilizing_time_constants", "stable_filters",
]  # fmt: skip

Interval = tuple[float, float]

SAME = 1e-9  # relative distance below which two critical time constants are one


def critical_time_constants(
    process: Any, model: Any, order: int | FilterFamily, *, floor: float | None = None
) -> list[CriticalTimeConstant]:
    r"""Find every time constant λ at which the observer loop has a root on the imaginary axis.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G and G̃, both with or without dead time.
    order : int or FilterFamily
        n of the filter :math:`1/(\lambda s + 1)^n`, or a family.
    floor : float, optional
        Smallest λ of interest, in seconds. With a dead time θ the critical time constants
        accumulate at 0 and the list must end somewhere: by default where every critical frequency
        above lies within 32 turns of exp(-jωθ), and not below θ/1000. Where none is left in p_B,
        as with a model that is the process, the default is 0, and the list is complete.

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
    frequencies = Frequencies(Mismatch.of(process, model, order))
    return _crossings(frequencies, _checked_floor(frequencies, floor))


def stabilizing_time_constants(
    process: Any,
    model: Any,
    order: int | FilterFamily,
    *,
    floor: float | None = None,
    dt: float | None = None,
    computation_delay: float = 0.0,
) -> list[tuple[float, float]]:
    r"""Find all λ for which the filter :math:`1/(\lambda s + 1)^n` stabilises the observer loop.

    That is condition ii of Lemma 1: p_B has all its roots in the open left half plane. Of a family
    the filters that are not stable are left out. What F/G̃ and (1 - F)G̃ share with themselves for
    every λ is in no block, and so not in p_B.

    Parameters
    ----------
    process, model, order, floor : as for `critical_time_constants`
        G and G̃; n or a family; the smallest λ of interest, in seconds.
    dt : float, optional
        Sampling time in seconds of a processor that runs the observer by Tustin's rule. In the
        plane of w Tustin's filter is the same polynomial in λ, and the process behind its hold is
        rational, with any dead time (`nrdob.digital.process_in_w`), as is a stable model with one:
        the set is exact, and complete from 0 on.
    computation_delay : float
        Time from reading y to writing u there, in seconds.

    Returns
    -------
    list of (low, high)
        Open intervals in seconds, increasing; `high` may be inf. Empty where no λ works. Without
        dead time in p_B the list is complete and `low` may be 0. With one it is complete above the
        floor, and an interval that begins at the floor may reach below it. A single λ at which a
        root touches the axis and turns back is not left out: rounding cannot tell it from one
        that comes near.

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
    if dt is not None:
        process = process_in_w(process, dt, computation_delay, model)
        model, _ = undelayed(model)
    elif computation_delay:
        raise ValueError(
            "computation_delay belongs to a processor: give its sampling time dt, too, or multiply "
            "the process by nrdob.delay(computation_delay)"
        )
    frequencies = Frequencies(Mismatch.of(process, model, order))
    found = stabilizing_set(frequencies, _checked_floor(frequencies, floor))
    return intersection(found, stable_filters(frequencies.mismatch.family))


def stabilizing_set(frequencies: Frequencies, floor: float) -> list[Interval]:
    """Find the set of `stabilizing_time_constants` above a floor, or above the lowest one."""
    intervals, changes = _intervals(floor, _crossings(frequencies, floor))
    counts = _counts(frequencies.mismatch, intervals, changes)
    return [part for part, count in zip(intervals, counts, strict=True) if count == 0]


def _crossings(frequencies: Frequencies, floor: float) -> list[CriticalTimeConstant]:
    omega = frequencies.base if _matched(frequencies) else frequencies.above(floor)
    return crossings(frequencies.mismatch, omega, floor)


def _matched(frequencies: Frequencies) -> bool:
    """Whether process and model, with the same dead time, leave none in p_B."""
    return not any(term.q.any() for term in frequencies.mismatch.behind)


def stable_filters(family: FilterFamily) -> list[Interval]:
    """Find all λ for which the filters of a family are stable themselves."""
    if family.kind != "own":
        return [(0.0, inf)]
    # Under a process of 1 and a model of 1 the observer loop is the filter.
    return stabilizing_set(Frequencies(Mismatch.of(1.0, 1.0, family)), 0.0)


def intersection(first: list[Interval], second: list[Interval]) -> list[Interval]:
    """Intersect two increasing lists of open intervals (low, high)."""
    pairs = ((max(a, c), min(b, d)) for a, b in first for c, d in second)
    return [(low, high) for low, high in pairs if low < high]


def _checked_floor(frequencies: Frequencies, floor: float | None) -> float:
    """Return the floor asked for, or the default; an error for one that cannot be."""
    if floor is None:
        return 0.0 if _matched(frequencies) else frequencies.lowest_floor
    remedy = "it is the smallest time constant of interest in seconds, positive and finite, or None"
    floor = real_number(floor, "floor", remedy, above=0.0)
    if floor <= frequencies.neutral_limit:
        raise ValueError(
            f"floor is {floor:g} s, but with dead time and order "
            f"{frequencies.mismatch.family.order} every time constant up to "
            f"{frequencies.neutral_limit:.6g} s leaves infinitely many roots in the right half "
            "plane: choose a larger floor, or a higher order"
        )
    return floor


def _intervals(
    floor: float, critical: list[CriticalTimeConstant]
) -> tuple[list[Interval], list[int]]:
    """Neighbouring ends, and by how much the count of roots changes at each lower one."""
    ends, changes = [floor], [0]
    for time_constant, frequency, direction in critical:
        if time_constant > ends[-1] * (1 + SAME) or len(ends) == 1:
            ends.append(time_constant)
            changes.append(0)
        changes[-1] += direction * (1 if frequency in (0.0, inf) else 2)
    return list(pairwise([*ends, inf])), changes


def _counts(
    mismatch: Mismatch, intervals: list[Interval], changes: list[int]
) -> list[float | None]:
    """Count the roots in the right half plane in each interval; None where they cannot be.

    The crossings carry a count from one to the next; wherever that is 0 the argument must agree.
    """
    counted: dict[int, float | None] = {}
    for start in reversed(range(len(intervals))):
        counted[start] = _count(mismatch, *intervals[start])
        if counted[start] is not None:
            break
    else:
        return [None] * len(intervals)
    carried = np.cumsum(changes)
    carried = carried - carried[start] + counted[start]
    for k in {0, *np.flatnonzero(carried <= 0).tolist()}:
        if k not in counted:
            counted[k] = _count(mismatch, *intervals[k])
        if (found := counted[k]) is not None and found != carried[k]:
            low, high = intervals[k]
            raise ArithmeticError(
                f"between λ = {low:.9g} s and {high:.9g} s the crossings leave {carried[k]:g} "
                f"roots in the right half plane, but {found:g} are counted: the loop is too stiff "
                "for a trustworthy answer; leave out what is much faster or much slower than the "
                "filter"
            )
    return [counted.get(k, float(value)) for k, value in enumerate(carried)]


def _count(mismatch: Mismatch, low: float, high: float) -> float | None:
    """Count at a λ inside; near an end a root may be too close to the axis to be counted."""
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
