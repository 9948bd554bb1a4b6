"""Curves on a chart, given point by point: drawn without gaps, cut to what may be seen."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..numerics import BoolArray, FloatArray, IntArray
from .chartaxes import PIXELS, Axis

__all__ = ["BESIDE", "Border", "Places", "cut", "drawn", "drawn_together", "parts", "within"]

ASTRAY = 0.75
"""How far a new point may lie from the middle of a step, against the step."""

TORN = 16.0
"""Pixels of a step that leads from one curve to another."""

LONGEST, HALVINGS, BESIDE = 3.0, 14, 0.05
"""Pixels of the longest step of a curve, how often a step is halved at most, and how far beside the
chart a curve is followed, against its width."""


class Border(NamedTuple):
    """A curve on which roots are on the imaginary axis.

    Attributes
    ----------
    x, y : (N,) array of float
        Its points.
    omega : (N,) array of float
        Where the roots are, in rad/s: 0 or inf for a real root.
    """

    x: FloatArray
    y: FloatArray
    omega: FloatArray


Places = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Turns places along a curve, a column each, into better ones, and into the two coordinates.

A column that is no number is no place on this curve.
"""


def drawn(
    axes: tuple[Axis, Axis], place: FloatArray, at: Places, located: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Put points between those of a curve until no step on the chart is long.

    A chord across a bend would leave a region open to its neighbour. The first rows of the places,
    `located`, say where on the curve a point is; further ones belong to it.
    """
    ((place, first, second),) = drawn_together(axes, [place], at, located)
    return place, first, second


def drawn_together(
    axes: tuple[Axis, Axis], places: list[FloatArray], at: Places, located: int
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Do so for many curves of one kind at once, which takes hardly longer than for one."""
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
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    yield from (slice(first, last) for first, last in zip(edges[::2], edges[1::2], strict=True))


def within(seen: BoolArray) -> BoolArray:
    """Tell what is seen, and the points beside."""
    near = seen.copy()
    near[1:] |= seen[:-1]
    near[:-1] |= seen[1:]
    return near


def cut(x: Axis, y: Axis, border: Border) -> Iterator[Border]:
    """Cut a curve into the parts that may be seen."""
    u, v = x.share(border.x), y.share(border.y)
    with np.errstate(invalid="ignore"):
        good = np.isfinite(u) & np.isfinite(v)
        seen = good & (np.maximum(np.abs(u - 0.5), np.abs(v - 0.5)) < 0.5 + BESIDE)
    whole = np.append(np.hypot(np.diff(u), np.diff(v)) < TORN / PIXELS, True)
    straight = np.all(border.omega == border.omega[0]) and border.omega[0] in (0.0, np.inf)
    for part in parts(within(seen) & good):
        ends = part.start + 1 + np.flatnonzero(~whole[part]) if not straight else []
        for first, last in pairwise([part.start, *ends, part.stop]):
            if last - first > 1:
                yield Border(border.x[first:last], border.y[first:last], border.omega[first:last])
