r"""Stability charts: where an observer loop is stable, in two parameters, with exact borders.

The parameters are a gain, the dead time and an additional lag of the process, and the time constant
of the filter; the model may have a dead time. Condition i of Lemma 1 depends on none of them: what
is charted is condition ii. The borders are curves with roots on the axis, see
`nrdob.design.chartborders`. Between them the number of roots in the right half plane does not
change (Neimark's D-partition); it is counted by the argument, at points of every region.

.. rubric:: References

Neimark, J., D-subdivisions and spaces of quasipolynomials, Prikl. Mat. Mekh. 13 (1949) 349-380.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
from contourpy import contour_generator
from scipy.ndimage import distance_transform_edt, label

from ..numerics import FloatArray, IntArray, is_real
from .chartborders import ChartLoops, borders_of
from .chartcurves import PIXELS, Axis, Border, check_value, given_axis

__all__ = ["Axis", "Border", "Region", "StabilityChart", "stability_chart"]

if TYPE_CHECKING:
    from ..plotting import Figure

LARGEST = 300.0  # bound of the logarithm of a sensitivity, so that nothing overflows
MS_GRID = 44  # points to an axis at which Ms is computed
SMALLEST = 4  # pixels of the smallest region that is counted


@dataclass(frozen=True)
class Region:
    """A part of the chart in which the number of roots in the right half plane is the same.

    Attributes
    ----------
    count : float
        Roots of p_B in the right half plane; infinite beyond a neutral border.
    x, y, share : float
        A point well inside, and the part of the chart that it covers, on its axes.
    """

    count: float
    x: float
    y: float
    share: float


@dataclass(frozen=True, eq=False, repr=False)
class StabilityChart:
    """Where an observer loop is stable, in two parameters.

    Attributes
    ----------
    x, y : Axis
        The parameters.
    borders : tuple of Border
        The curves on which the number of unstable roots may change.
    regions : tuple of Region
        What they leave, the largest first.
    ms_levels : dict
        For each level of Ms asked for, its lines within the stable regions, each (N, 2).
    labels : array of int
        The region of each cell of a raster, from 1 on; 0 on a border.
    count_at : callable
        What `count` asks.
    """

    x: Axis
    y: Axis
    borders: tuple[Border, ...]
    regions: tuple[Region, ...]
    ms_levels: dict[float, list[FloatArray]]
    labels: IntArray
    count_at: Callable[[float, float], float]

    def count(self, x: float, y: float) -> float:
        """Count the roots of p_B in the right half plane at one point, by the argument.

        Parameters
        ----------
        x, y : float
            Values of the two parameters.

        Raises
        ------
        ValueError
            If the parameters have no meaning.
        ArithmeticError
            On a border, where there are roots on the axis.
        """
        for axis, value in ((self.x, x), (self.y, y)):
            check_value(axis.name, value)
        return self.count_at(float(x), float(y))

    def plot(self, *, title: str = "", ax: Any = None) -> Figure:
        """Draw borders, regions and levels: see `nrdob.plotting.chart_plot`.

        Parameters
        ----------
        title : str
            Written above the chart.
        ax : matplotlib axes, optional
            Where to draw.
        """
        from ..plotting import chart_plot

        return chart_plot(self, title=title, ax=ax)

    def __repr__(self) -> str:
        stable = sum(region.share for region in self.regions if region.count == 0)
        return (
            f"<stability chart in {self.x.name} and {self.y.name}: {len(self.regions)} regions, "
            f"{100 * stable:.3g} % of it stable>"
        )


def stability_chart(
    process: Any,
    model: Any,
    filter: Any,
    *,
    x: tuple[str, float, float],
    y: tuple[str, float, float],
    ms: tuple[float, ...] = (),
) -> StabilityChart:
    """Chart the stability of the observer loop in two parameters.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G and G̃, both with or without dead time.
    filter : as for `nrdob.NRDOB`, or FilterFamily, or int
        F; where its time constant is on an axis, a family, an order, or a LowPassFilter of it.
    x, y : (name, low, high)
        Two of "time_constant" (λ of the filter, s), "gain" (a factor of the process), "delay" (its
        dead time, s, whatever it has) and "lag" (the time constant of an additional lag, s).
    ms : tuple of float
        Levels of the peak of the sensitivity to be drawn.

    Returns
    -------
    StabilityChart
        Borders, regions with their counts, and levels of Ms; it can be drawn.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put, an axis is none, or a dead time turns too often.
    ArithmeticError
        If two counts within one region differ.

    Examples
    --------
    A dead time that the model leaves out: stable for λ > 2θ/π.

    >>> import control as ct
    >>> lag = ct.tf([1], [1, 1])
    >>> chart = stability_chart(lag, lag, 1, x=("delay", 0.1, 1.0), y=("time_constant", 0.1, 1.0))
    >>> chart.count(0.5, 2 * 0.5 / 3.1), chart.count(0.5, 2 * 0.5 / 3.2)
    (0, 2)
    """
    axes = given_axis("x", x), given_axis("y", y)
    if axes[0].name == axes[1].name:
        raise ValueError(f"both axes are {axes[0].name}: choose two different parameters")
    for level in ms:
        if not is_real(level) or not 1 < level < inf:
            raise ValueError(
                f"ms has the level {level!r}; give numbers above 1, such as (1.5, 2.0)"
            )
    loops = ChartLoops.of(process, model, filter, {axis.name for axis in axes})
    borders = tuple(borders_of(loops, *axes))
    regions, labels = _regions_of(loops, axes, _labelled(axes, borders))
    lines = _ms_levels(loops, axes, labels, regions, ms) if ms else {}

    def count_at(x: float, y: float) -> float:
        return loops.counts([{axes[0].name: x, axes[1].name: y}])[0]

    return StabilityChart(*axes, borders, regions, lines, labels, count_at)


def _labelled(axes: tuple[Axis, Axis], borders: tuple[Border, ...]) -> IntArray:
    """Give a number to the parts that the borders leave, on a raster; 0 on a border."""
    drawn = np.zeros((PIXELS, PIXELS), dtype=bool)
    for border in borders:
        u, v = axes[0].share(border.x) * PIXELS, axes[1].share(border.y) * PIXELS
        steps = np.maximum(np.abs(np.diff(u)), np.abs(np.diff(v)))
        count = np.minimum(np.ceil(3 * steps).astype(int), 40 * PIXELS) + 1
        ends = np.append(0, np.cumsum(count))
        along = np.arange(ends[-1])
        columns, rows = (np.floor(np.interp(along, ends, w)).astype(int) for w in (u, v))
        inside = (columns >= 0) & (columns < PIXELS) & (rows >= 0) & (rows < PIXELS)
        drawn[rows[inside], columns[inside]] = True
    found: IntArray = label(~drawn)[0]
    return found


def _regions_of(
    loops: ChartLoops, axes: tuple[Axis, Axis], labels: IntArray
) -> tuple[tuple[Region, ...], IntArray]:
    """Count in every part, at two points of the larger ones."""
    depth = distance_transform_edt(np.pad(labels > 0, 1))[1:-1, 1:-1]
    sizes = np.bincount(labels.ravel())
    parts = np.split(np.argsort(labels, axis=None, kind="stable"), np.cumsum(sizes)[:-1])
    sizes[0] = 0
    order = [int(k) for k in np.argsort(-sizes) if sizes[k] >= SMALLEST]
    places = [_inside(axes, depth, parts[k]) for k in order]
    names = axes[0].name, axes[1].name
    points = [dict(zip(names, place, strict=True)) for some in places for place in some]
    counted = iter(loops.counts(points))
    regions, numbers = [], np.zeros(sizes.size, dtype=labels.dtype)
    for k, some in zip(order, places, strict=True):
        counts = set(islice(counted, len(some)))
        if len(counts) > 1:
            raise ArithmeticError(
                f"within one region of the chart, {counts} roots are counted, at {some}: a "
                "border is too fine for it; let the axes be shorter"
            )
        share = float(sizes[k]) / PIXELS**2
        regions.append(Region(counts.pop(), *some[0], share))
        numbers[k] = len(regions)
    return tuple(regions), numbers[labels]


def _inside(
    axes: tuple[Axis, Axis], depth: FloatArray, part: IntArray
) -> list[tuple[float, float]]:
    """Give the point that is deepest in a part, and in a larger one another far from it."""
    rows, columns = np.divmod(part, PIXELS)
    deep = depth[rows, columns]
    points = [int(deep.argmax())]
    if rows.size > 40 * SMALLEST:
        far = np.abs(rows - rows[points[0]]) + np.abs(columns - columns[points[0]])
        points.append(int(np.where(deep >= 2, far, -1).argmax()))
    x = axes[0].value((columns[points] + 0.5) / PIXELS)
    y = axes[1].value((rows[points] + 0.5) / PIXELS)
    return list(zip(x.tolist(), y.tolist(), strict=True))


def _ms_levels(
    loops: ChartLoops,
    axes: tuple[Axis, Axis],
    labels: IntArray,
    regions: tuple[Region, ...],
    levels: tuple[float, ...],
) -> dict[float, list[FloatArray]]:
    """Lines of equal Ms in the stable regions."""
    places = (np.arange(MS_GRID) + 0.5) / MS_GRID
    x, y = axes[0].value(places), axes[1].value(places)
    counts = np.array([np.nan, *(region.count for region in regions)])
    pixel = np.floor(places * PIXELS).astype(int)
    stable = counts[labels[np.ix_(pixel, pixel)]] == 0
    omega = loops.frequencies(axes)
    found = np.full((MS_GRID, MS_GRID), np.nan)
    for row in range(MS_GRID):
        columns = np.flatnonzero(stable[row])
        if columns.size:
            given = {axes[0].name: x[columns, None], axes[1].name: y[row]}
            found[row, columns] = _peaks(loops, given, omega)
    generator = contour_generator(x, y, np.ma.masked_invalid(found))
    return {float(level): [np.asarray(p) for p in generator.lines(level)] for level in levels}


def _peaks(loops: ChartLoops, given: dict[str, Any], omega: FloatArray) -> FloatArray:
    """Peak of the sensitivity of each stable loop, one a row."""
    values = loops.fixed | given
    ahead, behind, delayed = loops.mismatch.terms(omega, values["time_constant"])
    ahead = (ahead + delayed) * (1 + 1j * values["lag"] * omega)
    behind = behind * values["gain"] * np.exp(-1j * values["delay"] * omega)
    with np.errstate(all="ignore"):
        size = np.log(np.abs(ahead / (ahead + behind)))
    size = np.nan_to_num(size, nan=-LARGEST, neginf=-LARGEST, posinf=LARGEST)
    top = np.clip(size.argmax(axis=1), 1, omega.size - 2)
    before, at, after = (size[np.arange(top.size), top + k] for k in (-1, 0, 1))
    curvature = np.minimum(before - 2 * at + after, -1e-300)
    risen = at - (after - before) ** 2 / (8 * curvature)
    return np.asarray(np.exp(np.where((at >= before) & (at >= after), risen, size.max(axis=1))))
