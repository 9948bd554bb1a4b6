r"""Every stabilising filter: the time constants at which the loop changes sides, exactly.

The observer loop has a root at :math:`s = j\omega` if and only if
:math:`(1 + j\lambda\omega)^n = -H(j\omega)`: an n-th root w of :math:`-H(j\omega)` must have real
part 1, and then :math:`\lambda = \operatorname{Im} w/\omega`. So one looks for the frequencies at
which one of n branches crosses the line Re w = 1, with H evaluated exactly, dead time included;
for a model that waits, :math:`-H = e^{-j\omega\theta_m} - e^{-j\omega\theta} G_0/\tilde G_0`.
Between two neighbouring critical time constants the number of roots in the right half plane does
not change; it is counted there by the argument of p_B, which knows nothing of the crossings.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import atan, comb, inf, isfinite, pi
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from ..diagram import DelayedTransferFunction, FilterFamily
from ..digital import process_in_w
from ..numerics import (
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    add,
    bisect,
    count_rhp,
    golden,
    side,
)
from .familybranches import FamilyBranches
from .familygrid import frequencies_for
from .familymismatch import FamilyMismatch, positive_roots
from .mismatch import ERROR, Mismatch
from .mismatchgrid import Frequencies

__all__ = [
    "CriticalTimeConstant",
    "critical_time_constants",
    "default_floor",
    "intersection",
    "lowest_floor",
    "stabilizing_set",
    "stabilizing_time_constants",
    "stable_filters",
]

SAME = 1e-9
"""Relative distance below which two critical time constants are one."""

JUMP = 1e-6
"""Distance from the line, against the branch's own size, at which a change of side is a jump."""

TURNS = 32
"""Turns of the dead time over which the default floor resolves the critical time constants."""

FASTEST = 1000
"""How many times faster than the dead time a filter of the default range may be."""


class CriticalTimeConstant(NamedTuple):
    """A time constant at which roots cross the imaginary axis.

    Attributes
    ----------
    time_constant : float
        λ in seconds.
    frequency : float
        Where they cross, in rad/s; 0 for a real root that passes through s = 0, inf for one that
        passes through infinity.
    direction : int
        +1 if they enter the right half plane as λ grows, -1 if they leave it.
    """

    time_constant: float
    frequency: float
    direction: int


def critical_time_constants(
    process: Any,
    model: Any,
    order: int | FilterFamily,
    *,
    floor: float | None = None,
    dt: float | None = None,
    computation_delay: float = 0.0,
) -> list[CriticalTimeConstant]:
    r"""Find every time constant λ at which the observer loop has a root on the imaginary axis.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G and G̃, both with or without dead time.
    order : int or FilterFamily
        n of the filter :math:`1/(\lambda s + 1)^n`, or a family from `nrdob.filter_family`.
    floor : float, optional
        Smallest λ of interest, in seconds. With dead time the critical time constants accumulate
        at 0 and the list must end somewhere: by default at `default_floor`. Without dead time the
        default is 0, and the list is complete.
    dt : float, optional
        Sampling time in seconds of a processor that runs the observer by Tustin's rule, see
        `stabilizing_time_constants`.
    computation_delay : float
        Time from reading y to writing u there, in seconds.

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
    process = _held(process, model, dt, computation_delay)
    frequencies = frequencies_for(process, model, order)
    found = _critical(frequencies, _checked_floor(frequencies, floor))
    if dt is None:
        return found
    return [c._replace(frequency=2 / dt * atan(c.frequency * dt / 2)) for c in found]


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

    That is condition ii of Lemma 1: p_B has all its roots in the open left half plane. Condition i
    does not depend on the filter. Of a family whose filters are not all stable, those that are not
    are left out. What F/G̃ and (1 - F)G̃ share with themselves for every λ is in no block, and so not
    in p_B.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G, with or without dead time, and G̃.
    order : int
        n of the filter.
    floor : float, optional
        Smallest λ of interest, in seconds, as for `critical_time_constants`.
    dt : float, optional
        Sampling time in seconds of a processor that runs the observer by Tustin's rule. In the
        plane of w Tustin's filter is the same polynomial in λ, and the process behind its hold is
        rational, with any dead time (`nrdob.digital.wplane`): the set is exact, and complete from
        0 on.
    computation_delay : float
        Time from reading y to writing u there, in seconds.

    Returns
    -------
    list of (low, high)
        Open intervals in seconds, increasing; `high` may be inf. Empty where no λ works. Without
        dead time the list is complete and `low` may be 0. With dead time it is complete above the
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

    The same on a processor that samples ten times a second:

    >>> sampled = stabilizing_time_constants(
    ...     4/(2 - s - s**2), -1/((s + 1)*(s + 2)), 2, dt=0.1)
    >>> [(round(low, 6), round(high, 6)) for low, high in sampled]
    [(0.111006, 0.651317)]
    """
    process = _held(process, model, dt, computation_delay)
    frequencies = frequencies_for(process, model, order)
    found = stabilizing_set(frequencies, _checked_floor(frequencies, floor))
    return intersection(found, stable_filters(order)) if found else found


def _held(process: Any, model: Any, dt: float | None, computation_delay: float) -> Any:
    """Put the process behind a hold, where there is a sampling time."""
    if dt is None:
        if computation_delay:
            raise ValueError(
                "computation_delay belongs to a processor: give its sampling time dt, too, or "
                "multiply the process by nrdob.delay(computation_delay)"
            )
        return process
    if isinstance(model, DelayedTransferFunction) and model.delay:
        raise ValueError(
            f"model has a dead time of {model.delay:g} s; with dt sets are computed for models "
            "that do not wait: leave it out, or ask NRDOB(…).sampled(dt).stability() for one λ"
        )
    return process_in_w(process, dt, computation_delay)


def stabilizing_set(frequencies: Frequencies, floor: float) -> list[tuple[float, float]]:
    """Find the set of `stabilizing_time_constants` for a mismatch that is already read."""
    intervals = _intervals(floor, _critical(frequencies, floor))
    counts = _counts(frequencies.mismatch, intervals)
    return [
        (part.low, part.high) for part, count in zip(intervals, counts, strict=True) if count == 0
    ]


def stable_filters(order: int | FilterFamily) -> list[tuple[float, float]]:
    """Find all λ for which the filters of a family are stable themselves.

    Parameters
    ----------
    order : int or FilterFamily
        n of the filters of eq. (1), or a family.

    Returns
    -------
    list of (low, high)
        Intervals in seconds.

    Examples
    --------
    >>> from nrdob import filter_family
    >>> resonant = filter_family("own", num=[1], den=[[1, 0, 0], [-1, 2, 0], 1])
    >>> [(low, round(high, 6)) for low, high in stable_filters(resonant)]
    [(0.0, 2.0)]
    """
    if not isinstance(order, FilterFamily) or order.kind != "own":
        return [(0.0, inf)]
    # Under a process of 1 and a model of 1 the observer loop is the filter.
    return stabilizing_set(frequencies_for(1.0, 1.0, order), 0.0)


def intersection(
    first: list[tuple[float, float]], second: list[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Intersect two increasing lists of open intervals.

    Parameters
    ----------
    first, second : list of (low, high)
        The intervals.

    Examples
    --------
    >>> intersection([(0.0, 2.0), (3.0, 5.0)], [(1.0, 4.0)])
    [(1.0, 2.0), (3.0, 4.0)]
    """
    pairs = ((max(a, c), min(b, d)) for a, b in first for c, d in second)
    return [(low, high) for low, high in pairs if low < high]


def default_floor(process: Any, model: Any, order: int | FilterFamily) -> float:
    """Smallest time constant down to which the sets are complete by default, in seconds.

    0 without dead time. With a dead time θ: the λ above which every critical frequency lies within
    the first 32 turns of exp(-jωθ), and at least θ/1000.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G, with or without dead time, and G̃.
    order : int
        n of the filter.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import delay
    >>> G = ct.tf([1], [1, 1])
    >>> round(default_floor(delay(0.5) * G, G, 1), 5)
    0.00431
    """
    return lowest_floor(frequencies_for(process, model, order))


def lowest_floor(frequencies: Frequencies) -> float:
    """Find the `default_floor` of a mismatch that is already read."""
    mismatch = frequencies.mismatch
    longest = mismatch.longest_delay
    if not longest:
        return 0.0
    last = 2 * pi * TURNS / longest
    beyond = np.append(last, frequencies.base[frequencies.base > last])
    return max(frequencies.highest(beyond), longest / FASTEST, 1.001 * mismatch.neutral_limit)


def _checked_floor(frequencies: Frequencies, floor: float | None) -> float:
    """Return the floor asked for, or the default; an error for one that cannot be."""
    if floor is None:
        return lowest_floor(frequencies)
    if isinstance(floor, bool) or not isinstance(floor, Real):
        raise TypeError(
            f"floor is {floor!r}; it is the smallest time constant of interest, a number of "
            "seconds, or None"
        )
    if not (isfinite(floor) and floor > 0):
        raise ValueError(
            f"floor is {floor}; it is the smallest time constant of interest, in seconds: "
            "positive and finite, or None"
        )
    mismatch = frequencies.mismatch
    if floor <= mismatch.neutral_limit:
        raise ValueError(
            f"floor is {floor:g} s, but with dead time and order {mismatch.order} every time "
            f"constant up to {mismatch.neutral_limit:.6g} s leaves infinitely many roots in the "
            "right half plane: choose a larger floor, or a higher order"
        )
    return float(floor)


# Where the crossings are.


def _critical(frequencies: Frequencies, floor: float) -> list[CriticalTimeConstant]:
    mismatch = frequencies.mismatch
    omega = frequencies.above(floor)
    if isinstance(mismatch, FamilyMismatch):
        found = _crossings(FamilyBranches.on(mismatch, omega)) + _through_ends(mismatch)
    else:
        found = _crossings(_Branches.on(mismatch, omega))
        found += _through_zero(mismatch) + _through_infinity(mismatch)
    return sorted(c for c in found if c.time_constant > floor)


@dataclass(frozen=True, eq=False)
class _Branches:
    """The n-th roots w of -H(jω), each continuous in ω, less 1.

    Attributes
    ----------
    mismatch : Mismatch
        The ratio R and the order.
    omega : array of float
        Frequencies, N of them.
    phase : array of float
        arg(-H) at each, followed from one frequency to the next.
    excess : array of complex
        w - 1, of shape (n, N).
    """

    mismatch: Mismatch
    omega: FloatArray
    phase: FloatArray
    excess: ComplexArray

    @classmethod
    def on(cls, mismatch: Mismatch, omega: FloatArray) -> _Branches:
        """Follow the branches over given frequencies."""
        root = _log_minus_H(mismatch, omega)
        phase = np.unwrap(root.imag)
        each = np.arange(mismatch.order)[:, None]
        return cls(mismatch, omega, phase, _less_1(root, phase, each, mismatch.order))

    def __call__(self, of: IntArray, at: IntArray, omega: FloatArray) -> ComplexArray:
        """Branches `of`, reached continuously from frequencies number `at`, less 1."""
        root = _log_minus_H(self.mismatch, omega)
        return _less_1(root, self.phase[at], of, self.mismatch.order)

    @staticmethod
    def size(excess: ComplexArray) -> FloatArray:
        """Size of a branch w, against which a jump is told from a crossing."""
        return np.asarray(np.abs(1 + excess))

    def nearest(
        self, of: IntArray, at: IntArray, way: FloatArray, low: FloatArray, high: FloatArray
    ) -> FloatArray:
        """Frequencies at which branches on one side, `way`, come closest to the line."""
        return golden(lambda omega: way * self(of, at, omega).real, low, high)

    @staticmethod
    def near_line(excess: ComplexArray) -> BoolArray:
        """Whether a branch may touch the line between two frequencies and leave it again."""
        return np.asarray(np.abs(excess.real) < 1)

    @staticmethod
    def lost(excess: ComplexArray, rounding: FloatArray) -> BoolArray:
        """Whether a branch is not known at all, as beside a pole."""
        return rounding >= np.ones(excess.shape)

    def rounding(self, omega: FloatArray, excess: ComplexArray) -> FloatArray:
        """Bound the rounding error of a branch w, where w - 1 is `excess`: dw/w = dH/(nH)."""
        mismatch = self.mismatch
        with np.errstate(divide="ignore", invalid="ignore"):  # at zeros of H and poles of R
            relative = mismatch.noise(omega) / np.abs(1 - mismatch.ratio(omega))
            relative += mismatch.wait * omega * ERROR / 8
            return np.asarray(np.nan_to_num(relative / mismatch.order * np.abs(1 + excess)))


class _Brackets(NamedTuple):
    """Between which frequencies which branch changes sides, and from which one it is reached."""

    of: IntArray
    at: IntArray
    low: FloatArray
    high: FloatArray


def _crossings(branches: _Branches | FamilyBranches) -> list[CriticalTimeConstant]:
    """Find where a branch crosses the line Re w = 1 with a positive imaginary part."""
    # Where R nearly vanishes a branch is so close to 1 that its side is only rounding.
    rounding = branches.rounding(branches.omega, branches.excess)
    known = np.abs(branches.excess.real) >= rounding
    parts = (_sign_changes(branches, known), *_hidden_pairs(branches, known, rounding))
    of, at, low, high = (np.concatenate(part) for part in zip(*parts, strict=True))
    where = bisect(lambda w: branches(of, at, w).real, low, high)
    value = branches(of, at, where)
    true = _accepted(branches, where, value)
    # A pair leaves where the branch rises through the line as ω grows, and enters where it falls:
    # Re ds/dλ has the sign opposite to that of the slope.
    directions = side(branches(of, at, low).real)[true]
    where, critical = where[true], value.imag[true] / where[true]
    return [
        CriticalTimeConstant(float(c), float(w), int(d))
        for c, w, d in zip(critical, where, directions, strict=True)
    ]


def _sign_changes(branches: _Branches | FamilyBranches, known: BoolArray) -> _Brackets:
    """Bracket the changes of side between neighbouring frequencies where it is known."""
    of, columns = np.nonzero(known)
    sign = side(branches.excess.real[of, columns])
    changed = np.flatnonzero((of[1:] == of[:-1]) & (sign[1:] != sign[:-1]))
    before, after = columns[changed], columns[changed + 1]
    return _Brackets(of[changed], before, branches.omega[before], branches.omega[after])


def _hidden_pairs(
    branches: _Branches | FamilyBranches, known: BoolArray, rounding: FloatArray
) -> tuple[_Brackets, _Brackets]:
    """Bracket pairs of crossings that leave the same side at both neighbours, but a dip.

    Of two frequencies so close that only rounding tells them apart both may be the bottom.
    """
    real, omega = branches.excess.real, branches.omega
    sign, size = side(real), np.abs(real)
    inner = np.s_[:, 1:-1]
    least = size[inner] - rounding[inner]
    dips = (least <= size[:, :-2]) & (least <= size[:, 2:]) & known[inner]
    dips &= (sign[inner] == sign[:, :-2]) & (sign[inner] == sign[:, 2:])
    dips &= branches.near_line(branches.excess)[inner]
    of, at = np.nonzero(dips & (branches.excess.imag[inner] > 0))
    at = at + 1
    left, right, way = omega[at - 1], omega[at + 1], sign[of, at]
    bottom = branches.nearest(of, at, way, left, right)
    through = way * branches(of, at, bottom).real < 0
    of, at, bottom = of[through], at[through], bottom[through]
    return _Brackets(of, at, left[through], bottom), _Brackets(of, at, bottom, right[through])


def _accepted(
    branches: _Branches | FamilyBranches, omega: FloatArray, excess: ComplexArray
) -> BoolArray:
    """Tell crossings from jumps at a pole on the axis, and from zeros there, where λ = 0."""
    rounding = branches.rounding(omega, excess)
    size = branches.size(excess)
    on_line = np.abs(excess.real) <= JUMP * size + rounding
    # Beside a pole a branch is so large that the line cannot be told from the imaginary axis.
    near_pole = branches.lost(excess, rounding) | branches.mismatch.at_pole(omega)
    return on_line & (excess.imag > rounding) & ~near_pole


def _less_1(value: ComplexArray, near: FloatArray, of: IntArray, order: int) -> ComplexArray:
    """n-th root number `of`, less 1, where ln(-H) is `value` and its phase near to `near`."""
    # Whole turns are counted apart: a phase of 2π would leave a branch near 1 only rounding.
    turns = (np.round((near - value.imag) / (2 * pi)) + of) % order
    return np.asarray(np.expm1(value.real / order + 1j * (value.imag + 2 * pi * turns) / order))


def _log_minus_H(mismatch: Mismatch, omega: FloatArray) -> ComplexArray:
    """ln(1 - R(jω)), accurate for small R too, where numpy's complex log1p is not.

    Where the model waits, -H is that behind its dead time.
    """
    R = mismatch.ratio(omega)
    with np.errstate(divide="ignore"):  # where H vanishes exactly, all branches are at 0
        size = np.log1p(-R.real * (2 - R.real) + R.imag**2) / 2
    return np.asarray(size + 1j * (np.arctan2(-R.imag, 1 - R.real) - mismatch.wait * omega))


def _through_zero(mismatch: Mismatch) -> list[CriticalTimeConstant]:
    """Find the λ at which p_B(0) = (nλ + θm) a(0) + b'(0) vanishes, where the integrator cancels.

    The direction is that of the root -p_B(0)/p_B'(0) beside it.
    """
    if not mismatch.integrator:
        return []
    n, wait = mismatch.order, mismatch.wait
    (a1, a0), (b1, b0) = (np.append(0.0, p)[-2:].tolist() for p in (mismatch.a, mismatch.delayed))
    critical = -(b0 / a0 + wait) / n
    if critical <= 0:
        return []
    tilt = a0 * (comb(n, 2) * critical**2 - wait**2 / 2) + a1 * (n * critical + wait)
    tilt += b1 - mismatch.delay * b0
    return [CriticalTimeConstant(critical, 0.0, int(-np.sign(n * a0 * tilt)))]


def _through_infinity(mismatch: Mismatch) -> list[CriticalTimeConstant]:
    """Find the λ at which the leading coefficient of p_B vanishes: 1 + F(∞) H(∞) = 0."""
    n, (a, b) = mismatch.order, (mismatch.a, mismatch.b)
    if mismatch.delay or mismatch.excess != n or b[0] / a[0] > 0:
        return []
    critical = float((-b[0] / a[0]) ** (1 / n))
    # Near it p_B is a0 (λ^n - critical^n) s^N + second s^(N-1) + …, with one large root.
    second = add(mismatch.undelayed(critical), mismatch.delayed)[1]
    direction = int(-np.sign(second / a[0]))
    if mismatch.p_B(critical).q.size == a.size + n - 2 - mismatch.integrator:
        a1 = a[1] if a.size > 1 else 0.0
        slopes = critical * a[0], (n - 1) * a[0] + critical * a1
        direction = _pair_at_infinity(mismatch, critical, slopes)
    return [CriticalTimeConstant(critical, inf, direction)]


def _pair_at_infinity(mismatch: Mismatch, critical: float, slopes: tuple[float, float]) -> int:
    """Find the direction where the two highest coefficients of p_B vanish at one λ.

    Next to it they grow by their slopes in λ. On one side the two large roots are real, one to the
    right and one to the left; on the other they are a pair whose real part is finite.
    """
    lead, second = slopes
    third, fourth = np.append(mismatch.p_B(critical).q, 0.0)[:2]
    of_pair = 2 if fourth / third > second / lead else 0
    return of_pair - 1 if third / lead > 0 else 1 - of_pair


def _through_ends(mismatch: FamilyMismatch) -> list[CriticalTimeConstant]:
    """Find the λ at which a real root passes through s = 0 or through infinity.

    There p_B(0), or its leading coefficient, vanishes; the root is near -p_B(0)/p_B'(0), or near
    minus the second coefficient over the leading one.
    """
    constant, slope, leading, second = mismatch.at_ends[:, ::-1]
    found = []
    for end, other, frequency in ((constant, slope, 0.0), (leading, second, inf)):
        for critical in positive_roots(end).tolist():
            lead, second = (float(np.polyval(np.polyder(p), critical)) for p in (end, other))
            direction = int(-np.sign(lead * np.polyval(other, critical)))
            rest = mismatch.p_B(critical)
            if frequency and not rest.delay and rest.q.size == mismatch.degree - 1:
                direction = _pair_at_infinity(mismatch, critical, (lead, second))
            found.append(CriticalTimeConstant(critical, frequency, direction))
    return found


# What the intervals between them hold.


class _Interval(NamedTuple):
    """Neighbouring ends, and by how much the count of roots must change at the lower one."""

    low: float
    high: float
    change: int


def _intervals(floor: float, critical: list[CriticalTimeConstant]) -> list[_Interval]:
    ends, changes = [floor], [0]
    for time_constant, frequency, direction in critical:
        if time_constant > ends[-1] * (1 + SAME) or len(ends) == 1:
            ends.append(time_constant)
            changes.append(0)
        changes[-1] += direction * (1 if frequency in (0.0, inf) else 2)
    return [
        _Interval(low, high, change)
        for (low, high), change in zip(pairwise([*ends, inf]), changes, strict=True)
    ]


def _counts(mismatch: Mismatch, intervals: list[_Interval]) -> list[float | None]:
    """Count the roots in the right half plane in each interval; None where they cannot be.

    The crossings carry one count through all intervals. It is counted again by the argument at
    both ends, and wherever it is said to be 0.
    """
    counted: dict[int, float | None] = {}

    def count(k: int) -> float | None:
        if k not in counted:
            counted[k] = _count(mismatch, intervals[k])
        return counted[k]

    last = len(intervals) - 1
    start = next((k for k in range(last, -1, -1) if count(k) is not None), None)
    if start is None:
        return [None] * len(intervals)
    carried = np.cumsum([interval.change for interval in intervals])
    carried = carried - carried[start] + counted[start]
    for k in {0, *np.flatnonzero(carried <= 0).tolist()}:
        if (found := count(k)) is not None and found != carried[k]:
            raise ArithmeticError(
                f"between λ = {intervals[k].low:.9g} s and {intervals[k].high:.9g} s the crossings "
                f"leave {carried[k]:g} roots in the right half plane, but {found:g} are counted: "
                "the loop is too stiff for a trustworthy answer; leave out what is much faster or "
                "much slower than the filter"
            )
    return [counted.get(k, float(value)) for k, value in enumerate(carried)]


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
