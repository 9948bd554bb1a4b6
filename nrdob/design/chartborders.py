r"""The borders of a stability chart, parametrised by frequency.

Of W(jω), see `nrdob.design.chartloops`, a root is on the axis where it equals
:math:`k e^{-j\omega\theta}`. Of any two parameters ω gives the values: :math:`|W| = k` and
:math:`\theta = (2\pi m - \arg W)/\omega`, or k where :math:`W e^{j\omega\theta}` is real, and so
on; with λ, all of them on a curve in the plane of ω and λ. A real root crosses at ω = 0 or at
infinity. With long dead times the curves get denser than a chart can show; they are drawn up to
where so many roots are on the right that no more dead time brings all of them back (`most_turns`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import ceil, inf, pi

import numpy as np

from ..numerics import ComplexArray, FloatArray, bisect
from .chartaxes import MANY_ROOTS, PIXELS, Axis
from .chartcurves import BESIDE, Border, cut, drawn, drawn_together, parts, within
from .chartlevels import level_set, projected
from .chartloops import MANY, ChartLoops, positive

__all__ = ["borders_of", "most_turns"]

LAMBDAS = 160
"""Number of λ over an axis."""

AT_ONCE = 256
"""Turns of the dead time whose curves are drawn at once."""

FEW = PIXELS // 2
"""Turns of the dead time up to which all curves are drawn."""

VALUES = 80
"""Number of values of the other parameter for which the turns are counted."""

Curve = tuple[FloatArray, FloatArray, FloatArray]


def borders_of(loops: ChartLoops, x: Axis, y: Axis, most: float) -> Iterator[Border]:
    """Give the curves on which the number of roots on the right may change."""
    for flipped, axes in ((False, (x, y)), (True, (y, x))):
        if (axes[0].name, axes[1].name) in PAIRS:
            crossing = _with_lambda if axes[0].name == "time_constant" else _without_lambda
            curves = (*crossing(loops, axes, most), *_ends(loops, axes))
            for omega, first, second in curves:
                points = (second, first) if flipped else (first, second)
                yield from cut(x, y, Border(*points, omega))


PAIRS = {
    ("time_constant", "delay"), ("time_constant", "gain"), ("time_constant", "lag"),
    ("gain", "delay"), ("gain", "lag"), ("lag", "delay"),
}  # fmt: skip
"""Which of two axes comes first."""


def most_turns(loops: ChartLoops, x: Axis, y: Axis) -> float:
    r"""Count the turns θω/2π up to which the curves of a dead time are drawn; inf for all of them.

    Whatever θ is, a pair of roots goes right where :math:`|W| = k` and :math:`|W|` rises with ω,
    and left where it falls: up to one, so many times as θω/2π. After t seconds at least
    t Σ ±ω/2π - K pairs are on the right, for K such frequencies.
    """
    if y.name != "delay":
        x, y = y, x
    if y.name != "delay":
        return inf
    omega = loops.frequencies((x, y))
    first, last = positive(x) if x.name in ("time_constant", "gain") else (x.low, x.high)
    values = np.linspace(first, last, VALUES)
    if x.logarithmic:
        values = np.geomspace(first, last, VALUES)
    values = values[:, None]
    size = np.abs(loops.ratio(omega, values if x.name == "time_constant" else 1.0))
    size = size * np.abs(1 + 1j * omega * values) if x.name == "lag" else size
    large = size < (values if x.name == "gain" else loops.fixed["gain"])
    steps = large[:, :-1] * 1.0 - large[:, 1:]
    rate, crossings = (steps * omega[:-1]).sum(axis=1), np.abs(steps).sum(axis=1)
    fastest = (np.abs(steps) * omega[:-1]).max(axis=1)
    if fastest.max() * y.high / (2 * pi) <= FEW:
        return inf
    turning = crossings > 0
    needed = (MANY_ROOTS / 2 + 2 * crossings) * fastest
    return float(np.max(needed[turning] / np.maximum(rate[turning], 1e-300)))


# Without λ: both parameters are functions of ω.


def _without_lambda(loops: ChartLoops, axes: tuple[Axis, Axis], most: float) -> Iterator[Curve]:
    omega = loops.frequencies(axes)
    if axes[1].name == "lag":
        yield from _gain_and_lag(loops, axes, omega)
    else:
        yield from _with_delay(loops, axes, omega, most)


def _gain_and_lag(loops: ChartLoops, axes: tuple[Axis, Axis], omega: FloatArray) -> Iterator[Curve]:
    """With V = W exp(jωθ): (1 + jτω) V = k."""

    def at(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        omega = np.exp(place[0])
        V = loops.turned(omega)
        with np.errstate(all="ignore"):
            return place, np.abs(V) ** 2 / V.real, -V.imag / (omega * V.real)

    omega = _closer(lambda w: loops.turned(w).real, omega)
    for part in parts(loops.turned(omega).real > 0):
        place, gain, lag = drawn(axes, np.log(omega[part])[None], at, 1)
        yield np.exp(place[0]), gain, lag


def _closer(function: Callable[[FloatArray], FloatArray], omega: FloatArray) -> FloatArray:
    """Add frequencies on both sides of each change of sign, where a curve runs off to infinity."""
    values = function(omega)
    k = np.flatnonzero((values[:-1] > 0) != (values[1:] > 0))
    at = bisect(function, omega[k], omega[k + 1])
    share = np.geomspace(1e-9, 1, 28)
    added = [at[:, None] + (omega[end] - at)[:, None] * share for end in (k, k + 1)]
    return np.unique(np.concatenate([omega, *(each.ravel() for each in added)]))


def _with_delay(
    loops: ChartLoops, axes: tuple[Axis, Axis], omega: FloatArray, most: float
) -> Iterator[Curve]:
    """Take the gain, or the lag, from the size of W, and the dead time from its angle."""
    first = axes[0]

    def read(omega: FloatArray) -> tuple[FloatArray, ComplexArray]:
        W = loops.ratio(omega)
        if first.name == "gain":
            return np.abs(W), W
        with np.errstate(all="ignore"):
            square = (loops.fixed["gain"] / np.abs(W)) ** 2 - 1
            lag = np.sign(square) * np.sqrt(np.abs(square)) / omega
        return lag, W * (1 + 1j * np.maximum(lag, 0.0) * omega)

    def curve(place: FloatArray) -> tuple[FloatArray, FloatArray, ComplexArray]:
        return (place, *read(np.exp(place[0])))

    values, W = read(omega)
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(W) & (values <= first.high) & (values >= first.low)
    for part in parts(within(seen) & np.isfinite(W)):
        yield from _turns(axes, np.log(omega[part])[None], curve, most)


def _turns(
    axes: tuple[Axis, Axis],
    place: FloatArray,
    curve: Callable[[FloatArray], tuple[FloatArray, FloatArray, ComplexArray]],
    most: float,
) -> Iterator[Curve]:
    """Give the dead times that turn 1 to the angle of W, one turn after the other.

    The angle is a row of the places, so that between two points it is followed from both.
    """
    place, _, W = curve(place)
    omega, angle = np.exp(place[0]), np.unwrap(-np.angle(W))
    ends = axes[1].value(np.array([-BESIDE, 1 + BESIDE]))[:, None]
    turns = (np.minimum(ends * omega, 2 * pi * most) - angle) / (2 * pi)
    first, last = ceil(np.nanmin(turns)) - 1, int(np.nanmax(turns)) + 1
    if last - first > MANY:
        raise ValueError(
            f"the dead time makes {last - first} turns within the chart: let the axes begin "
            "farther from 0, or end earlier"
        )

    def at(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        better, values, W = curve(place[:-1])
        angle = -np.angle(W)
        angle = angle + 2 * pi * np.round((place[-1] - angle) / (2 * pi))
        return np.vstack([better, angle]), values, angle / np.exp(better[0])

    places = []
    for m in range(first, last + 1):
        below, above = m < turns[0], m > turns[1]
        shown = ~((below[1:] & below[:-1]) | (above[1:] & above[:-1]))
        kept = np.append(shown, False) | np.append(False, shown)
        turned = np.vstack([place, angle + 2 * pi * m])
        places += [turned[:, part] for part in parts(kept)]
    for k in range(0, len(places), AT_ONCE):
        together = drawn_together(axes, places[k : k + AT_ONCE], at, len(place))
        yield from ((np.exp(found[0]), values, theta) for found, values, theta in together)


# With λ: where a function of ω and λ vanishes.

Function = Callable[[ChartLoops, FloatArray, FloatArray], FloatArray]


def _with_lambda(loops: ChartLoops, axes: tuple[Axis, Axis], most: float) -> Iterator[Curve]:
    second = axes[1].name
    function = FUNCTIONS[second]

    def vanishing(u: FloatArray, v: FloatArray) -> FloatArray:
        return function(loops, np.exp(u), np.exp(v))

    def on(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        place = projected(vanishing, place)
        return place, *np.exp(place)

    def with_gain(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        place, omega, lam = on(place)
        return place, lam, loops.turned(omega, lam).real

    def with_lag(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        place, omega, lam = on(place)
        with np.errstate(all="ignore"):
            return place, lam, (1 / loops.turned(omega, lam)).imag / omega

    def with_size(place: FloatArray) -> tuple[FloatArray, FloatArray, ComplexArray]:
        place, omega, lam = on(place)
        return place, lam, loops.ratio(omega, lam)

    for line in level_set(vanishing, np.log(loops.frequencies(axes)), _lambdas(axes[0])):
        if second == "delay":
            yield from _turns(axes, line, with_size, most)
            continue
        place, lam, other = drawn(axes, line, with_gain if second == "gain" else with_lag, 2)
        for part in parts(other > 0 if second == "gain" else np.isfinite(other)):
            yield np.exp(place[0, part]), lam[part], other[part]


def _size_off(loops: ChartLoops, omega: FloatArray, lam: FloatArray) -> FloatArray:
    """For θ on the other axis: ln|W/k|."""
    with np.errstate(all="ignore"):
        return np.log(np.abs(loops.ratio(omega, lam)) / loops.fixed["gain"])


def _angle_off(loops: ChartLoops, omega: FloatArray, lam: FloatArray) -> FloatArray:
    """For k on the other axis: sine of the angle of W exp(jωθ)."""
    V = loops.turned(omega, lam)
    with np.errstate(all="ignore"):
        return np.asarray(V.imag / np.abs(V))


def _real_part_off(loops: ChartLoops, omega: FloatArray, lam: FloatArray) -> FloatArray:
    """For τ on the other axis: the real part of k exp(-jωθ)/W, less 1."""
    with np.errstate(all="ignore"):
        U = 1 / loops.turned(omega, lam)
        return np.asarray((U.real - 1) / (1 + np.abs(U)))


FUNCTIONS: dict[str, Function] = {
    "delay": _size_off,
    "gain": _angle_off,
    "lag": _real_part_off,
}
"""What vanishes where the parameter on the other axis can have a value."""


def _lambdas(axis: Axis) -> FloatArray:
    """Give ln λ all over an axis."""
    lambdas = axis.value(np.linspace(0, 1, LAMBDAS))
    low, high = positive(axis)
    return np.asarray(np.log(np.concatenate([[low], lambdas[lambdas > low], [high]])))


# Where a real root crosses.


def _ends(loops: ChartLoops, axes: tuple[Axis, Axis]) -> Iterator[Curve]:
    """Lines on which p_B(0), or its leading coefficient, vanishes."""
    first, second = axes
    names = {first.name, second.name}
    values = first.value(np.linspace(0, 1, 8 * PIXELS + 1))
    if first.name == "time_constant":
        values = values[values >= positive(first)[0]]
    lambdas = values if first.name == "time_constant" else np.ones(1)
    whole = np.array([second.low, second.high])
    lagging = bool(loops.fixed["lag"]) or "lag" in names
    turning = bool(loops.fixed["delay"]) or "delay" in names
    for at, p, q in loops.ends(lambdas, lagging=lagging, turning=turning):
        with np.errstate(all="ignore"):
            gain = p / q
        if second.name == "gain":
            for part in parts(np.isfinite(gain) & (gain > 0)):
                yield np.full(values[part].size, at), values[part], gain[part]
        elif first.name == "gain":
            if np.isfinite(gain[0]) and gain[0] > 0:
                yield np.full(2, at), np.full(2, gain[0]), whole
        elif first.name == "time_constant":
            off = p - loops.fixed["gain"] * q
            for i in np.flatnonzero((off[:-1] < 0) != (off[1:] < 0)):
                share = off[i] / (off[i] - off[i + 1])
                lam = values[i] + share * (values[i + 1] - values[i])
                yield np.full(2, at), np.full(2, lam), whole
