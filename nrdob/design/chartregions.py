"""The regions that the borders of a chart leave, and how many unstable roots there are in each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice

import numpy as np
from scipy.ndimage import distance_transform_edt, find_objects, label

from ..numerics import FloatArray, IntArray
from .chartaxes import MANY_ROOTS, PIXELS, Axis
from .chartcurves import Border

__all__ = ["Region", "labelled", "regions_of"]

SMALLEST = 4
"""Pixels of the smallest region that is counted."""


@dataclass(frozen=True)
class Region:
    """A part of the chart in which the number of roots on the right is the same.

    Attributes
    ----------
    count : float
        Roots of p_B in the right half plane; infinite beyond a neutral border.
    exact : bool
        False where there are `count` or more, and curves too close to be drawn.
    x, y : float
        A point well inside.
    share : float
        Part of the chart that it covers, on its axes.
    """

    count: float
    x: float
    y: float
    share: float
    exact: bool = True


def labelled(axes: tuple[Axis, Axis], borders: tuple[Border, ...]) -> IntArray:
    """Give a number to the parts that the borders leave, on a raster; 0 on a border."""
    drawn = np.zeros((PIXELS, PIXELS), dtype=bool)
    for border in borders:
        u, v = axes[0].share(border.x) * PIXELS, axes[1].share(border.y) * PIXELS
        steps = np.maximum(np.abs(np.diff(u)), np.abs(np.diff(v)))
        count = np.minimum(np.ceil(3 * steps).astype(int), 40 * PIXELS) + 1
        begin = np.repeat(np.arange(count.size), count)
        share = (np.arange(begin.size) - np.repeat(np.cumsum(count) - count, count)) / count[begin]
        columns, rows = (
            np.floor(values[begin] + share * (values[begin + 1] - values[begin])).astype(int)
            for values in (u, v)
        )
        inside = (columns >= 0) & (columns < PIXELS) & (rows >= 0) & (rows < PIXELS)
        drawn[rows[inside], columns[inside]] = True
    found: IntArray = label(~drawn)[0]
    return found


def regions_of(
    axes: tuple[Axis, Axis],
    labels: IntArray,
    counts_at: Callable[[list[tuple[float, float]]], list[float]],
    *,
    capped: bool,
) -> tuple[tuple[Region, ...], IntArray]:
    """Count in every part, at two points of the larger ones; if `capped`, up to `MANY_ROOTS`."""
    depth = distance_transform_edt(np.pad(labels > 0, 1))[1:-1, 1:-1]
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    boxes = find_objects(labels)
    order = [int(k) for k in np.argsort(-sizes) if sizes[k] >= SMALLEST]
    places = [_inside(axes, labels, depth, k, boxes[k - 1]) for k in order]
    counted = iter(counts_at([place for some in places for place in some]))
    regions, numbers = [], np.zeros(sizes.size, dtype=labels.dtype)
    for k, some in zip(order, places, strict=True):
        counts = set(islice(counted, len(some)))
        many = capped and min(counts) >= MANY_ROOTS
        counts = {MANY_ROOTS} if many else counts
        if len(counts) > 1:
            raise ArithmeticError(
                f"within one region of the chart, {counts} roots are counted, at {some}: a "
                "border is too fine for it; let the axes be shorter"
            )
        share = float(sizes[k]) / PIXELS**2
        regions.append(Region(counts.pop(), *some[0], share, exact=not many))
        numbers[k] = len(regions)
    return tuple(regions), numbers[labels]


def _inside(
    axes: tuple[Axis, Axis],
    labels: IntArray,
    depth: FloatArray,
    number: int,
    box: tuple[slice, slice],
) -> list[tuple[float, float]]:
    """Give the point that is deepest in a part, and in a larger one another far from it."""
    rows, columns = np.nonzero(labels[box] == number)
    rows, columns = rows + box[0].start, columns + box[1].start
    deep = depth[rows, columns]
    points = [int(deep.argmax())]
    if rows.size > 40 * SMALLEST:
        far = np.abs(rows - rows[points[0]]) + np.abs(columns - columns[points[0]])
        points.append(int(np.where(deep >= 2, far, -1).argmax()))
    return [
        (float(axes[0].value((columns[i] + 0.5) / PIXELS)),
         float(axes[1].value((rows[i] + 0.5) / PIXELS)))
        for i in points
    ]  # fmt: skip
