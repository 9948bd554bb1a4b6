"""Axes of a stability chart and curves on it: found on a grid, drawn without gaps, cut to size.

Where a function of two variables vanishes is found on a grid, and solved for. A tongue that becomes
narrower than the grid seems to end there; so wherever a step of a curve leads across it and not
along, the curve is followed from both ends of that step, by its tangent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from math import isfinite, log
from typing import Any, NamedTuple

import numpy as np
from contourpy import contour_generator
from scipy.ndimage import binary_dilation

from ..diagram import real_number
from ..numerics import BoolArray, FloatArray, IntArray, bisect, runs

__all__ = [
    "BESIDE", "PIXELS", "Axis", "Border", "beside_changes", "check_value", "cut", "drawn",
    "given_axis", "level_set", "parts", "projected",
]  # fmt: skip

AXES = {
    "time_constant": "λ of the filter, in seconds",
    "gain": "factor of the process",
    "delay": "dead time of the process, in seconds",
    "lag": "time constant of an additional lag of the process, in seconds",
}
"""What may be on an axis."""

PIXELS = 320  # regions narrower than this part of the chart may be left out
LOGARITHMIC = 20.0  # ratio of the ends of an axis from which it is logarithmic
ASTRAY = 0.75  # how far a new point may lie from the middle of a step, against the step
TORN = 16.0  # pixels of a step that leads from one curve to another

LONGEST, HALVINGS, BESIDE = 3.0, 14, 0.05
"""Pixels of the longest step of a curve, how often a step is halved at most, and how far beside the
chart a curve is followed, against its width."""

STEPS, FARTHEST, CLOSE = 9, 0.1, 1e-9  # Newton steps onto a curve, the longest, how well on it then

NUDGE = 1e-6
STENCIL = np.array([[0.0, 1.0, 0.0, -1.0, 0.0], [0.0, 0.0, 1.0, 0.0, -1.0]])
"""Distance and directions in which a slope is taken."""

ALONG = 0.9  # cosine of the angle between a step and the curve from which the step leads along

STEP, SHORTEST, MOST = 0.05, 1e-7, 400
"""Lengths of the steps by which a curve is followed, and how many there may be."""

TURN, OFF_TANGENT = 0.85, 0.3
"""Cosine of the angle by which a curve may turn in a step, and how far beside its tangent a step
may end."""


class Axis(NamedTuple):
    """A parameter and its range.

    Attributes
    ----------
    name : str
        What is on the axis.
    low, high : float
        Its ends.
    """

    name: str
    low: float
    high: float

    @property
    def logarithmic(self) -> bool:
        """Whether the ends are decades apart."""
        return self.low > 0 and self.high >= LOGARITHMIC * self.low

    @property
    def positive(self) -> tuple[float, float]:
        """The ends, a little wider and above 0, for a parameter that must be positive."""
        return (self.low or self.high / PIXELS / 9) / 1.1, 1.1 * self.high

    def share(self, values: Any) -> FloatArray:
        """Position of values between the ends, 0 to 1 within.

        Parameters
        ----------
        values : array_like of float
            Of the parameter.
        """
        values = np.asarray(values, dtype=float)
        if self.logarithmic:
            values = np.maximum(values, self.low / LOGARITHMIC)
            return np.asarray(np.log(values / self.low) / log(self.high / self.low))
        return np.asarray((values - self.low) / (self.high - self.low))

    def value(self, share: Any) -> FloatArray:
        """Values at positions.

        Parameters
        ----------
        share : array_like of float
            Positions between the ends, 0 to 1.
        """
        share = np.asarray(share, dtype=float)
        if self.logarithmic:
            return np.asarray(self.low * (self.high / self.low) ** share)
        return np.asarray(self.low + share * (self.high - self.low))


def given_axis(which: str, given: Any) -> Axis:
    """Read an axis, or say what is wrong with it."""
    if not (isinstance(given, tuple | list) and len(given) == 3):
        raise TypeError(f'{which} is {given!r}; give (name, low, high), as ("delay", 0.0, 1.0)')
    name, low, high = given
    if name not in AXES:
        known = ", ".join(f'"{each}" ({what})' for each, what in AXES.items())
        raise ValueError(f"{which} is {name!r}; it must be one of {known}")
    low, high = (real_number(end, f"an end of {which}", "give real numbers") for end in (low, high))
    if not (isfinite(low) and isfinite(high) and 0 <= low < high):
        raise ValueError(
            f"{which} reaches from {low} to {high}; give two increasing numbers, 0 or above"
        )
    return Axis(name, low, high)


def check_value(name: str, value: Any) -> None:
    """Refuse a value that the parameter cannot have."""
    value = real_number(value, name, "give a real number")
    least = "0 or above" if name in ("delay", "lag") else "positive"
    if not (isfinite(value) and value >= 0) or (value == 0 and least == "positive"):
        raise ValueError(f"{name} is {value}; it must be {least}")


class Border(NamedTuple):
    """A curve on which roots are on the imaginary axis.

    Attributes
    ----------
    x, y, omega : (N,) array of float
        Its points, and where the roots are, in rad/s: 0 or inf for a real root.
    """

    x: FloatArray
    y: FloatArray
    omega: FloatArray


Places = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Turns places along a curve, a column each, into better ones, and into the two coordinates.

A column that is no number is no place on this curve.
"""


def drawn(
    axes: tuple[Axis, Axis], places: list[FloatArray], at: Places, located: int
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Put points between those of curves until no step on the chart is long.

    The first rows of the places, `located`, say where on its curve a point is.
    """
    if not places:
        return
    place = np.hstack(places)
    curve = np.repeat(np.arange(len(places)), [each.shape[1] for each in places])
    place, first, second = at(place)
    for _ in range(HALVINGS):
        k = _long_steps(axes, first, second)
        k = k[curve[k] == curve[k + 1]]
        if not k.size:
            break
        middle, across = (place[:, k] + place[:, k + 1]) / 2, place[:, k + 1] - place[:, k]
        better, x, y = at(middle)
        with np.errstate(invalid="ignore"):  # a place that is farther off is one of another curve
            off = np.linalg.norm((better - middle)[:located], axis=0)
            good = off <= ASTRAY * np.linalg.norm(across[:located], axis=0)
        if not good.any():
            break
        k, better, x, y = k[good], better[:, good], x[good], y[good]
        place = np.insert(place, k + 1, better, axis=1)
        curve = np.insert(curve, k + 1, curve[k])
        first, second = np.insert(first, k + 1, x), np.insert(second, k + 1, y)
    ends = np.flatnonzero(np.diff(curve)) + 1
    yield from zip(
        np.split(place, ends, axis=1), np.split(first, ends), np.split(second, ends), strict=True
    )


def _long_steps(axes: tuple[Axis, Axis], first: FloatArray, second: FloatArray) -> IntArray:
    """Tell after which points a step is long that may be seen."""
    with np.errstate(all="ignore"):
        u, v = axes[0].share(first), axes[1].share(second)
        length = PIXELS * np.hypot(np.diff(u), np.diff(v))
        seen = np.isfinite(length)
        for place in (u, v):
            seen &= np.maximum(place[1:], place[:-1]) > -BESIDE
            seen &= np.minimum(place[1:], place[:-1]) < 1 + BESIDE
        return np.flatnonzero(seen & (length > LONGEST))


def parts(good: BoolArray) -> Iterator[slice]:
    """Give the stretches over which something is true."""
    yield from (slice(*run) for run in runs(good))


def cut(x: Axis, y: Axis, border: Border) -> Iterator[Border]:
    """Cut a curve into the parts that may be seen."""
    u, v = x.share(border.x), y.share(border.y)
    with np.errstate(invalid="ignore"):
        good = np.isfinite(u) & np.isfinite(v)
        seen = good & (np.maximum(np.abs(u - 0.5), np.abs(v - 0.5)) < 0.5 + BESIDE)
        whole = np.append(np.hypot(np.diff(u), np.diff(v)) < TORN / PIXELS, True)
    straight = np.all(border.omega == border.omega[0]) and border.omega[0] in (0.0, np.inf)
    for part in parts(binary_dilation(seen) & good):
        ends = part.start + 1 + np.flatnonzero(~whole[part]) if not straight else []
        for first, last in pairwise([part.start, *ends, part.stop]):
            if last - first > 1:
                yield Border(border.x[first:last], border.y[first:last], border.omega[first:last])


# Where a function vanishes.

Vanishing = Callable[[FloatArray, FloatArray], FloatArray]  # a function of two arrays of one shape


def level_set(function: Vanishing, u: FloatArray, v: FloatArray) -> Iterator[FloatArray]:
    """Give the points, (2, N), of all curves that can be told from each other on a grid."""
    values = np.ma.masked_invalid(function(u[None, :], v[:, None]))
    lines = [np.asarray(line, dtype=float).T for line in contour_generator(u, v, values).lines(0.0)]
    if not lines:
        return
    every = _on_edges(function, (u, v), np.hstack(lines))
    ends: list[FloatArray] = []
    for point in np.split(every, np.cumsum([line.shape[1] for line in lines])[:-1], axis=1):
        for part in parts(np.isfinite(point[0])):
            if part.stop - part.start > 1:
                curve = point[:, part]
                across = ~_leads_along(function, curve)
                bounds = [0, *(np.flatnonzero(across) + 1).tolist(), curve.shape[1]]
                yield from (curve[:, a:b] for a, b in pairwise(bounds) if b - a > 1)
                k = np.flatnonzero(across)
                at = np.ravel([k, k + 1], order="F")
                other, back = (np.ravel(pair, order="F") for pair in ([k + 1, k], [k - 1, k + 2]))
                last = curve.shape[1] - 1
                closed = np.array_equal(curve[:, 0], curve[:, -1])
                back = back % last if closed else np.clip(back, 0, last)
                ends.append(np.vstack([curve[:, at], curve[:, other], curve[:, back]]))
    if ends:
        bounds_of = (u[0], u[-1]), (v[0], v[-1])
        yield from _followed(function, np.hstack(ends), bounds_of)


def _on_edges(
    function: Vanishing, grid: tuple[FloatArray, FloatArray], point: FloatArray
) -> FloatArray:
    """Solve for where a function vanishes on the edges of a grid, between whose ends it does."""
    low, high = point.copy(), point.copy()
    for k, lines in enumerate(grid):
        after = np.clip(np.searchsorted(lines, point[k]), 1, lines.size - 1)
        between = (lines[after] != point[k]) & (lines[after - 1] != point[k])
        low[k], high[k] = (np.where(between, lines[after - n], point[k]) for n in (1, 0))

    def at(share: FloatArray) -> FloatArray:
        return function(*(low + share * (high - low)))

    share = bisect(at, np.zeros(point.shape[1]), np.ones(point.shape[1]))
    return projected(function, low + share * (high - low))


def projected(function: Vanishing, start: FloatArray) -> FloatArray:
    """Step from points, (2, N), at right angles to where a function vanishes; nan if that fails."""
    point = start
    for _ in range(STEPS):
        value, slope = _value_and_slope(function, point)
        with np.errstate(invalid="ignore"):
            good = np.abs(value) <= CLOSE
        if good.all():
            break
        with np.errstate(all="ignore"):
            step = -value * slope / (slope**2).sum(axis=0)
            step = step * np.minimum(1.0, FARTHEST / np.hypot(*step))
        point = np.where(good, point, point + np.nan_to_num(step))
    return np.where(good, point, np.nan)


def _value_and_slope(function: Vanishing, point: FloatArray) -> tuple[FloatArray, FloatArray]:
    u, v = (point[k] + NUDGE * STENCIL[k][:, None] for k in (0, 1))
    values = function(u, v)
    return values[0], (values[1:3] - values[3:]) / (2 * NUDGE)


def _tangent(function: Vanishing, point: FloatArray) -> FloatArray:
    """Give unit vectors along the curve."""
    _, (by_u, by_v) = _value_and_slope(function, point)
    with np.errstate(all="ignore"):
        return np.asarray(np.array([-by_v, by_u]) / np.hypot(by_u, by_v))


def _leads_along(function: Vanishing, curve: FloatArray) -> BoolArray:
    """Tell which steps of a curve lead along it, at both of their ends."""
    step, tangent = np.diff(curve), _tangent(function, curve)
    length = np.hypot(*step)
    with np.errstate(all="ignore"):
        first, last = (
            np.abs((step * end).sum(axis=0)) for end in (tangent[:, :-1], tangent[:, 1:])
        )
        return np.asarray((np.minimum(first, last) >= ALONG * length) | (length < SHORTEST))


def _followed(
    function: Vanishing, ends: FloatArray, bounds: tuple[tuple[float, float], ...]
) -> Iterator[FloatArray]:
    """Follow curves from both ends of steps that lead across, to the other end or the grid's.

    `ends` holds u and v of a point, of the other end, and of the known curve's point before it.
    """
    point, other, back = ends[:2].copy(), ends[2:4], ends[4:]
    size = np.minimum(np.hypot(*(other - point)), STEP)
    way = _tangent(function, point)
    way *= np.where(((point - back) * way).sum(axis=0) < 0, -1.0, 1.0)
    alive: BoolArray = np.asarray(np.isfinite(way).all(axis=0))
    tracks: list[list[FloatArray]] = [[p.copy()] for p in point.T]
    for _ in range(MOST):
        k = np.flatnonzero(alive)
        if not k.size:
            break
        guess = point[:, k] + size[k] * way[:, k]
        found = projected(function, guess)
        ahead = _tangent(function, found)
        ahead = ahead * np.sign((ahead * way[:, k]).sum(axis=0))
        with np.errstate(invalid="ignore"):
            good = (ahead * way[:, k]).sum(axis=0) >= TURN
            good &= np.hypot(*(found - guess)) <= OFF_TANGENT * size[k]
        gone = k[good]
        arrived = np.hypot(*(other[:, gone] - point[:, gone])) <= 1.5 * size[gone]
        point[:, gone], way[:, gone] = found[:, good], ahead[:, good]
        arrived = arrived & (np.hypot(*(other[:, gone] - point[:, gone])) <= size[gone])
        for n, last in zip(gone.tolist(), arrived.tolist(), strict=True):
            tracks[n].append(other[:, n] if last else point[:, n].copy())
        inside = np.ones(gone.size, dtype=bool)
        for axis, (low, high) in zip(point[:, gone], bounds, strict=True):
            inside &= (axis >= low) & (axis <= high)
        alive[gone[arrived | ~inside]] = False
        size[gone] = np.minimum(1.5 * size[gone], STEP)
        size[k[~good]] /= 2
        alive[size < SHORTEST] = False
    for one, two in zip(tracks[::2], tracks[1::2], strict=True):
        met = len(one) > 1 and np.array_equal(one[-1], two[0])
        for track in (one,) if met else (one, two):
            if len(track) > 1:
                yield np.array(track).T


def beside_changes(function: Callable[[FloatArray], FloatArray], omega: FloatArray) -> FloatArray:
    """Add frequencies on both sides of each change of sign, where a curve runs off to infinity."""
    values = function(omega)
    k = np.flatnonzero((values[:-1] > 0) != (values[1:] > 0))
    at = bisect(function, omega[k], omega[k + 1])
    share = np.geomspace(1e-9, 1, 28)
    added = [at[:, None] + (omega[end] - at)[:, None] * share for end in (k, k + 1)]
    return np.unique(np.concatenate([omega, *(each.ravel() for each in added)]))
