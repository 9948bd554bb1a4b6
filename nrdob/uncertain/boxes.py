r"""Stable gains, dead times, and boxes of gain, dead time and lag: exact, not sampled.

With a plant :math:`k\,G\,e^{-\tau s}/(Ts+1)` in place of G the loop has a root at jω where

.. math:: k\,L(j\omega)\,e^{-j\omega\tau} = -(1 + j\omega T) .

At one frequency k and T follow each other, k growing from :math:`1/|L|` with T, and :math:`\tau`
follows both up to whole turns, falling with T; so that it can be told in closed form whether a box
holds such a plant. The share at which it first does, over all frequencies, is the stable share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial, reduce
from itertools import product
from math import atan, ceil, hypot, inf, isfinite, nan, pi, tan
from typing import Any, NamedTuple

import numpy as np

from ..analysis import Locus, quotient_margins, resolved_frequencies
from ..diagram import DelayedTransferFunction, Quotient, real_number
from ..loop import NRDOB
from ..numerics import BoolArray, ComplexArray, FloatArray, QuasiPolynomial, bisect, golden, side
from .plantfamily import Interval, read_range

__all__ = ["Box", "delay_intervals", "gain_intervals", "largest_box"]

NOMINAL = {"gain": 1.0, "delay": 0.0, "lag": 0.0}
MOST = 200_000  # frequencies at most that a dead time asks for
FAR = 10.0  # how far beyond all poles and zeros L is only a power of s and a dead time
HALVINGS = 60  # how often shares are halved
PER_STRETCH, NEAR = 16, 1.5  # frequencies of a stretch; shares, against the least, looked into
WITHIN = 0.4567  # where between critical values a loop is judged: round ones may be critical
TOUCHING = 1e-6  # slope, against its size, with which roots touch the axis and cross or not
MET = 1e-9  # distance of a gain from 1 at which it is 1, within rounding
QUARTER = pi / 2 * (1 - 1e-12)  # the most by which a lag turns, within rounding


class Box(NamedTuple):
    """Up to which share of a box around the nominal plant all loops are stable.

    Attributes
    ----------
    share : float
        What part of the way from the nominal plant to every side; 1 if all of it is stable.
    critical : dict of str: float or None
        Gain, dead time and lag of a plant on the sides of the box of that share that is at the
        limit of stability; None if the whole box is stable.
    frequency : float
        Where that plant oscillates, rad/s; nan if there is none.
    """

    share: float
    critical: dict[str, float] | None
    frequency: float


def gain_intervals(loop: NRDOB, low: float = 0.0, high: float = inf) -> list[tuple[float, float]]:
    """Find all factors of the plant's gain with which the loop is stable.

    Parameters
    ----------
    loop : NRDOB
        The loop, with its nominal plant, stable or not.
    low, high : float
        Between which gains; by default all positive ones.

    Returns
    -------
    list of (float, float)
        Open intervals; their inner ends are exact, the outer ones `low` and `high`.

    Raises
    ------
    TypeError, ValueError
        If the range is none, or begins below 0; if a verdict cannot be given.
    ArithmeticError
        If a verdict contradicts the roots that have crossed the axis.

    Examples
    --------
    A pure gain error and n = 3 are stable up to 1 + sec³(π/3) = 9:

    >>> import control as ct
    >>> import nrdob
    >>> G = ct.tf([1], [1, 3, 2])
    >>> loop = nrdob.NRDOB(G, G, ct.tf([1], [1, 0]), nrdob.LowPassFilter(0.1, 3))
    >>> [(round(a, 6), round(b, 6)) for a, b in gain_intervals(loop, 0.1, 20)]
    [(0.1, 9.0)]
    """
    remedy = "give a factor of the gain, a number"
    span = Interval(real_number(low, "low", remedy), real_number(high, "high", remedy))
    if not 0 <= span.low < span.high:
        raise ValueError(f"gains from {low:g} to {high:g}; give positive ones, the lower one first")
    return _stable_between(loop, span, _critical_gains(loop, span), "gain")


Critical = tuple[FloatArray, FloatArray]
"""Values of a parameter at which roots are on the axis, and where, in rad/s."""


def _critical_gains(loop: NRDOB, span: Interval) -> Critical:
    # With the largest gain all frequencies count at which a smaller one is critical.
    largest = span.high if span.high < inf else _all_but_small(loop)
    found = quotient_margins(_with(loop, gain=largest).L, None)
    finite = np.isfinite(found.critical_gains)
    return largest * found.critical_gains[finite], found.phase_crossovers[finite]


def _all_but_small(loop: NRDOB) -> float:
    """Gain with which L is 1 just beyond all that is in it, so that no more has to be followed."""
    parts = [p for factor in (*loop.L.num, *loop.L.den) for p, _ in factor.terms if p.any()]
    roots = [QuasiPolynomial(p).without_origin.roots for p in parts]
    speeds = np.append(np.abs(np.concatenate(roots)), 1 / loop.delay if loop.delay else 0.0)
    size = float(np.abs(loop.L(1j * FAR * (speeds.max() or 1.0))))
    return 1 / size if 0 < size < inf else 1.0


def delay_intervals(loop: NRDOB, low: float, high: float) -> list[tuple[float, float]]:
    """Find all dead times, added to the plant's own, with which the loop is stable.

    Parameters
    ----------
    loop, low, high : as for `gain_intervals`
        The ends in seconds, both needed.

    Returns
    -------
    list of (float, float)
        As of `gain_intervals`.

    Raises
    ------
    TypeError, ValueError
        As `gain_intervals`; or if more dead time than the plant has would be taken away.

    Examples
    --------
    >>> import control as ct
    >>> import nrdob
    >>> lag = ct.tf([1], [1, 1])
    >>> loop = nrdob.NRDOB(lag, lag, ct.tf([1], [1, 0]), nrdob.LowPassFilter(0.2, 1))
    >>> [(a, round(b, 6)) for a, b in delay_intervals(loop, 0, 1)]             # up to λπ/2
    [(0.0, 0.314159)]
    """
    span = read_range("delay", (low, high))
    if loop.delay + span.low < 0:
        raise ValueError(
            f"low is {low:g} s, and the process has a dead time of {loop.delay:g} s: nothing "
            "predicts the future; give a larger one"
        )
    return _stable_between(loop, span, _critical_delays(loop, span), "delay")


def _critical_delays(loop: NRDOB, span: Interval) -> Critical:
    """Dead times at which a pair of roots crosses, up to where no more can be stable.

    At a gain crossover a pair goes right where the gain falls, and left where it rises: there are
    at least as many on the right as turns on balance, and those of the last crossover are fastest.
    """
    omega = quotient_margins(loop.L, None).gain_crossovers
    omega = omega[(omega > 0) & np.isfinite(omega)]
    first = np.mod(np.angle(-loop.L(1j * omega)), 2 * pi) / omega
    turn = 2 * pi / omega
    between = np.sqrt(omega[:-1] * omega[1:])
    beside = np.concatenate([omega[:1] / 2, between, 2 * omega[-1:]])
    above = np.abs(loop.L(1j * beside)) > 1
    rate = float(((above[:-1] * 1.0 - above[1:]) / turn).sum())
    last = span.high
    if rate > 0:  # up to t after span.low a pair crosses t/turn times, or one more or less
        last = min(last, span.low + omega.size / rate)
    found = [
        start + each * np.arange(np.floor((span.low - start) / each), (last - start) / each + 1)
        for start, each in zip(first, turn, strict=True)
    ]
    count = np.array([values.size for values in found], dtype=int)
    return np.concatenate([*found, omega[:0]]), np.repeat(omega, count)


def _critical_lags(loop: NRDOB, _: Interval) -> Critical:
    """T with 1 + L + jωT = 0."""

    def real(w: FloatArray) -> FloatArray:
        return np.asarray(1 + np.real(loop.L(1j * w)))

    found = _sign_changes(real, resolved_frequencies(loop.L, PER_STRETCH, loop.p_B))
    found = found[np.abs(real(found)) < 1e-6]
    return -np.imag(loop.L(1j * found)) / found, found


def _stable_between(
    loop: NRDOB, span: Interval, critical: Critical, name: str
) -> list[tuple[float, float]]:
    """Judge the loop between every two critical values where it may be stable, and join these.

    The slope of L says to which side roots go; the last stretch is judged in any case.
    """
    values, omega = critical
    inside = (values > span.low) & (values < span.high)
    order = np.argsort(values[inside])
    inner, pairs = values[inside][order].tolist(), _going_right(loop.L, omega[inside][order], name)
    found: list[tuple[float, float]] = []
    right = nan  # roots in the right half plane, where they are known
    for low, high, more in zip(
        [span.low, *inner], [*inner, span.high], [nan, *pairs.tolist()], strict=True
    ):
        right += 2 * more
        # Two crossings may be at the same value.
        same = high < inf and high - low <= 1e-9 * max(abs(low), abs(high))
        if same or (right > 0 and high < span.high):
            continue
        middle = low + WITHIN * (high - low) if high < inf else low / WITHIN or 1.0
        verdict = _with(loop, **{name: middle}).stability()
        if not verdict:
            if not verdict.model_loop:  # whatever the process
                return []
            right = verdict.observer_loop.closed_loop_rhp or nan
            continue
        if right > 0:
            raise ArithmeticError(
                f"the loop is stable with {name} = {middle:.6g}, but {right:g} roots have crossed "
                "the imaginary axis to the right before"
            )
        right = 0.0
        if found and low - found[-1][1] <= 1e-9 * abs(low):
            found[-1] = (found[-1][0], high)
        else:
            found.append((low, high))
    return found


def _going_right(L: Quotient, omega: FloatArray, name: str) -> FloatArray:
    """Pairs that go right as the gain or the dead time grows: 1, -1, or nan where it is open."""
    pairs = np.full(omega.size, nan)
    inside = np.flatnonzero((omega > 0) & np.isfinite(omega))
    if inside.size:
        slope = Locus(L).log_and_slope(omega[inside])[1][0]
        along = -slope.imag if name == "gain" else -slope.real
        clear = np.abs(along) > TOUCHING * (1 + np.abs(slope))
        pairs[inside[clear]] = np.sign(along[clear])
    return pairs


def largest_box(loop: NRDOB, *, gain: Any = None, delay: Any = None, lag: Any = None) -> Box:
    """Find up to which share of a box around the nominal plant all loops are stable, exactly.

    Parameters
    ----------
    loop : NRDOB
        A stable loop, with its nominal plant.
    gain, delay, lag : (low, high), optional
        Factors of the gain, around 1; dead times added, around 0 or from there on; T of an
        additional lag 1/(Ts + 1), from 0 on; both in seconds.

    Returns
    -------
    Box
        The share, the box, and the plant at which it touches the limit.

    Raises
    ------
    TypeError, ValueError
        If nothing is given, a range is none or leaves the nominal plant out, the loop is not stable
        without any of it, or its gain does not fall off at high frequency.
    ArithmeticError
        If the dead times are too long for the frequencies at which the gain is above 1.

    Examples
    --------
    >>> import nrdob
    >>> loop = nrdob.paper.example(3)
    >>> box = largest_box(loop, gain=(0.5, 2.0), lag=(0.0, 0.2))
    >>> round(box.share, 4), {name: round(value, 4) for name, value in box.critical.items()}
    (0.2588, {'gain': 1.2588, 'delay': 0.0, 'lag': 0.0518})
    """
    every = {"gain": gain, "delay": delay, "lag": lag}
    given = {name: read_range(name, each) for name, each in every.items() if each is not None}
    if not given:
        raise ValueError("there is no box; give one or more of gain, delay and lag")
    asked = {name: given.get(name, Interval(each, each)) for name, each in NOMINAL.items()}
    for name, nominal in NOMINAL.items():
        low, high = asked[name]
        if not low <= nominal <= high:
            raise ValueError(
                f"{name} is ({low:g}, {high:g}), around which the nominal plant, {nominal:g}, is "
                "not; give an interval that holds it (gains are factors, dead times and lags come "
                "on top of the process's own)"
            )
    if asked["gain"].low <= 0 or asked["lag"].low < 0 or loop.delay + asked["delay"].low < 0:
        raise ValueError(
            "gains must be positive, lags and the whole dead time not negative; give smaller "
            "intervals"
        )
    if not bool(loop.stability()):
        raise ValueError(f"the nominal loop is not stable: {loop.stability().reason}")
    if any(loop.L.at_infinity):
        raise ValueError(
            "the loop gain does not fall off at high frequency, where any lag or dead time is "
            "felt: give the process or the filter an additional lag"
        )
    name, *others = given
    return _largest(loop, asked) if others else _in_one(loop, name, asked)


def _in_one(loop: NRDOB, name: str, asked: dict[str, Interval]) -> Box:
    """Find the share of an interval; one parameter alone is critical at single frequencies."""
    (low, high), nominal = asked[name], NOMINAL[name]
    critical, omega = CRITICAL[name](loop, asked[name])
    inside = (critical >= low) & (critical <= high)
    if not inside.any():
        return Box(1.0, None, nan)
    critical, omega = critical[inside], omega[inside]
    shares = (critical - nominal) / (np.where(critical > nominal, high, low) - nominal)
    k = int(shares.argmin())
    return Box(float(shares[k]), NOMINAL | {name: float(critical[k])}, float(omega[k]))


CRITICAL = {"gain": _critical_gains, "delay": _critical_delays, "lag": _critical_lags}


def _largest(loop: NRDOB, asked: dict[str, Interval]) -> Box:
    omega = resolved_frequencies(loop.L, PER_STRETCH, loop.p_B)
    # As far as the largest gain lifts L to 1; a lag only makes it smaller.
    end = omega[-1]
    while abs(loop.L(1j * end)) * asked["gain"].high > 1:
        end *= 2
    omega = np.union1d(omega, np.geomspace(omega[-1], end, 65))
    longest = max(asked["delay"].high, -asked["delay"].low)
    if longest:
        large = omega[np.abs(loop.L(1j * omega)) * asked["gain"].high > 1]
        turn = pi / 8 / longest
        if large.size and large[-1] / turn > MOST:
            raise ArithmeticError(
                f"a dead time of {longest:g} s turns L too often below {large[-1]:.4g} rad/s, up "
                "to where its gain is above 1: give a smaller box"
            )
        if large.size:
            omega = np.union1d(omega, np.arange(omega[0], large[-1] + 2 * turn, turn))

    meeting = _where_corners_meet(loop, omega, asked)
    between = meeting[:-1, None] + np.diff(meeting)[:, None] * np.linspace(0, 1, PER_STRETCH)
    omega = reduce(np.union1d, (omega, meeting, between.ravel()))

    def share(w: FloatArray) -> FloatArray:
        return _share(np.asarray(loop.L(1j * w)), w, asked)

    at = share(omega)
    least = float(at.min())
    lower = np.flatnonzero((at[1:-1] <= at[:-2]) & (at[1:-1] <= at[2:]) & (at[1:-1] < NEAR * least))
    frequency = float(omega[int(at.argmin())])
    if lower.size and least < inf:
        # Beside a stretch in which plants oscillate there is nothing to be looked for.
        before, behind = np.isfinite(at[lower]), np.isfinite(at[lower + 2])
        first = omega[np.where(before, lower, lower + 1)]
        closer = golden(share, first, omega[np.where(behind, lower + 2, lower + 1)])
        deeper = share(closer)
        if deeper.min() < least:
            least, frequency = float(deeper.min()), float(closer[int(deeper.argmin())])
    dc = loop.L.dc_gain
    if isfinite(dc) and dc < 0 and asked["gain"].high > -1 / dc > 1:
        at_zero = (-1 / dc - 1) / (asked["gain"].high - 1)
        # At the lowest frequencies plants oscillate with hardly less gain, within rounding.
        beside = at_zero + 2 * MET / dc / (asked["gain"].high - 1)
        least, frequency = (at_zero, 0.0) if beside <= least else (least, frequency)
    if least >= 1:
        return Box(1.0, None, nan)
    L = np.asarray(loop.L(1j * max(frequency, 1e-300)))
    return Box(least, _critical_plant(L, frequency, asked, least), frequency)


def _where_corners_meet(loop: NRDOB, omega: FloatArray, asked: dict[str, Interval]) -> FloatArray:
    """Frequencies at which a plant oscillates of which two parameters are at corners.

    Only between such frequencies a plant of the box can oscillate, however narrow that is.
    """
    gains, delays, lags = ({nominal, *asked[name]} for name, nominal in NOMINAL.items())

    def size(gain: float, lag: float, w: FloatArray) -> FloatArray:
        return np.asarray(gain * np.abs(loop.L(1j * w)) - np.hypot(1.0, lag * w))

    def angle(delay: float, lag: float, w: FloatArray) -> FloatArray:
        return np.asarray((loop.L(1j * w) * np.exp(-1j * delay * w) / (1 + 1j * lag * w)).imag)

    def real(gain: float, delay: float, w: FloatArray) -> FloatArray:
        return np.asarray((gain * loop.L(1j * w) * np.exp(-1j * delay * w)).real + 1)

    free = (size, gains, lags), (angle, delays, lags), (real, gains, delays)
    offs = [partial(off, *at) for off, one, other in free for at in product(one, other)]
    return np.unique(np.concatenate([_sign_changes(off, omega) for off in offs]))


def _sign_changes(function: Callable[[FloatArray], FloatArray], omega: FloatArray) -> FloatArray:
    """Find where a function changes sides between neighbouring frequencies."""
    sides = side(function(omega))
    k = np.flatnonzero(sides[:-1] != sides[1:])
    return bisect(function, omega[k], omega[k + 1])


def _share(L: ComplexArray, omega: FloatArray, asked: dict[str, Interval]) -> FloatArray:
    """Least share of the box that holds a plant that oscillates at each frequency; inf over 1."""
    low, high = np.zeros(omega.shape), np.ones(omega.shape)
    possible = _holds(L, omega, asked, high)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        inside = _holds(L, omega, asked, middle)
        low, high = np.where(inside, low, middle), np.where(inside, middle, high)
    return np.where(possible, high, inf)


def _holds(
    L: ComplexArray, omega: FloatArray, asked: dict[str, Interval], share: FloatArray
) -> BoolArray:
    """Tell whether a share of the box holds a plant that oscillates at each frequency."""
    (k1, k2), (t1, t2), (T1, T2) = (_scaled(asked[name], name, share) for name in NOMINAL)
    size = np.abs(L)
    # |k L| = |1 + jωT|: T lies between where k is smallest and largest.
    first = np.maximum(T1, _lag_of(k1 * size, omega))
    last = np.minimum(T2, _lag_of(k2 * size, omega))
    possible = (k2 * size >= 1 - MET) & (first <= last)
    angle = np.angle(-L)
    late = (angle - np.arctan(omega * first)) / omega
    early = (angle - np.arctan(omega * last)) / omega
    turn = 2 * pi / omega
    return np.asarray(
        possible & (np.floor((t2 - early) / turn + MET) >= np.ceil((t1 - late) / turn - MET))
    )


def _lag_of(size: FloatArray | float, omega: FloatArray | float) -> FloatArray:
    """T with |1 + jωT| = size, 0 where there is none."""
    return np.asarray(np.sqrt(np.maximum(size**2 - 1, 0.0)) / omega)


def _scaled(side: Interval, name: str, share: Any) -> tuple[Any, Any]:
    nominal = NOMINAL[name]
    return nominal + share * (side.low - nominal), nominal + share * (side.high - nominal)


def _critical_plant(
    L: ComplexArray, omega: float, asked: dict[str, Interval], share: float
) -> dict[str, float]:
    """Return the plant of a share that oscillates at a frequency, of the smallest lag."""
    (k1, k2), (t1, t2), (T1, T2) = (_scaled(asked[name], name, share) for name in NOMINAL)
    if not omega:
        return {"gain": k2, "delay": 0.0, "lag": 0.0}
    size, turn = float(np.abs(L)), 2 * pi / omega
    lag = min(max(T1, float(_lag_of(k1 * size, omega))), T2)
    # The longest of all delays that turn L to -1, unless a longer lag must take a part of it.
    whole = float(np.angle(-L)) / omega
    whole += turn * ceil((t1 - whole + atan(omega * lag) / omega) / turn - MET)
    delay = whole - atan(omega * lag) / omega
    if delay > t2:
        delay, lag = t2, min(max(lag, tan(min(omega * (whole - t2), QUARTER)) / omega), T2)
    gain = hypot(1.0, omega * lag) / size
    return {"gain": min(max(gain, k1), k2), "delay": max(delay, t1), "lag": lag}


def _with(loop: NRDOB, *, gain: float = 1.0, delay: float = 0.0) -> NRDOB:
    """Return the loop with another plant."""
    num, den = loop.fractions.G
    return replace(loop, process=DelayedTransferFunction((gain * num, den), loop.delay + delay))
