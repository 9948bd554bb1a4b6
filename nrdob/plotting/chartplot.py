"""Charts of stability, with borders and levels of Ms, and maps of the members of a family."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.colors import ListedColormap

from ..numerics import BoolArray, FloatArray, number
from .figure import COLOURS, INK, SMALLEST, TALL, Figure, axes_for, headings, styled

__all__ = ["MapAxis", "chart_plot", "map_plot"]

LABELS = {
    "time_constant": "time constant λ (s)",
    "gain": "factor of the process's gain",
    "delay": "dead time θ (s)",
    "lag": "additional lag τ (s)",
    "observer_bandwidth": "bandwidth of the observer ωo (rad/s)",
    "b0": "assumed gain b0",
}

NUMBERED = 0.004  # regions that cover less of a chart have no number written in them
NAMED = 3  # how many of the regions the alt text names


def chart_plot(chart: Any, *, title: str = "", ax: Any = None) -> Figure:
    """Draw a stability chart.

    Parameters
    ----------
    chart : StabilityChart
        From `nrdob.stability_chart`.
    title, ax : str, matplotlib axes, optional
        Heading, and where to draw.
    """
    (axes,) = axes_for(ax, 1, TALL)
    x, y = chart.x, chart.y
    lines = []
    with styled():
        counts = np.array([np.nan, *(region.count for region in chart.regions)])[chart.labels]
        edges = [axis.value(np.linspace(0, 1, counts.shape[0] + 1)) for axis in (x, y)]
        stable = np.ma.masked_where(~(counts == 0), np.ones(counts.shape))
        green = ListedColormap([COLOURS["loop"]])
        axes.pcolormesh(*edges, stable, cmap=green, alpha=0.22, shading="flat", rasterized=True)
        for border in chart.borders:
            lines += axes.plot(border.x, border.y, color=INK, lw=1.0)
        for level, parts in chart.ms_levels.items():
            for k, part in enumerate(parts):
                lines += axes.plot(*part.T, color=COLOURS["filter"], lw=1.0, ls="--")
                if k == 0:
                    at = part[len(part) // 2]
                    axes.annotate(
                        f"$M_s$ = {level:g}", at, color=COLOURS["filter"], fontsize=SMALLEST,
                        ha="center", va="center",
                        bbox={"fc": axes.get_facecolor(), "ec": "none", "pad": 1},
                    )  # fmt: skip
        for region in chart.regions:
            if region.share >= NUMBERED:
                colour = COLOURS["loop"] if region.count == 0 else INK
                axes.annotate(
                    _many(region), (region.x, region.y), color=colour, ha="center",
                    va="center", weight="bold" if region.count == 0 else "normal",
                )  # fmt: skip
        for way, axis in (("x", x), ("y", y)):
            if axis.logarithmic:
                axes.set(**{f"{way}scale": "log"})
            axes.set(**{f"{way}lim": (axis.low, axis.high), f"{way}label": LABELS[axis.name]})
        headings(axes, title)
    return Figure(lines, axes, _alt(chart))


def _many(region: Any) -> str:
    return "∞" if region.count == np.inf else f"{region.count:g}"


def _alt(chart: Any) -> str:
    axes = " and ".join(LABELS[axis.name].partition(" (")[0] for axis in (chart.x, chart.y))
    stable = sum(region.share for region in chart.regions if region.count == 0)
    where = f"in {number(100 * stable)} % of it" if stable else "nowhere in it"
    text = f"Stability chart in {axes}: the loop is stable {where}"
    others = [region for region in chart.regions if region.count]
    if others:
        named = ", ".join(
            f"{_many(region)} around {number(region.x)} and {number(region.y)}"
            for region in others[:NAMED]
        )
        text += f"; unstable roots elsewhere: {named}"
    if chart.ms_levels:
        levels = ", ".join(f"{level:g}" for level in chart.ms_levels)
        text += f"; dashed lines where Ms is {levels}"
    return text


class MapAxis(NamedTuple):
    """A parameter of the members.

    Attributes
    ----------
    label, values : str, (N,) array of float
        What is written beside the axis, and the value of each member.
    """

    label: str
    values: FloatArray


def map_plot(
    x: MapAxis,
    y: MapAxis,
    stable: BoolArray,
    decided: BoolArray,
    *,
    borders: Iterable[tuple[FloatArray, FloatArray]] = (),
    title: str = "",
    ax: Any = None,
) -> Figure:
    """Draw members of a family over two of their parameters.

    Parameters
    ----------
    x, y : MapAxis
        The parameters.
    stable, decided : (N,) array of bool
        What becomes of each member; without a verdict it is drawn as a cross.
    borders : iterable of (x, y)
        Curves, from `nrdob.stability_chart`.
    title, ax : str, matplotlib axes, optional
        Heading, and where to draw.
    """
    (axes,) = axes_for(ax, 1, TALL)
    kinds: tuple[tuple[str, BoolArray, dict[str, Any]], ...] = (
        ("stable", stable, {"marker": "o", "color": COLOURS["loop"]}),
        ("unstable", decided & ~stable, {"marker": "o", "mfc": "none", "color": COLOURS["noise"]}),
        ("not decided", ~decided, {"marker": "x", "color": INK}),
    )
    size = float(np.clip(150 / np.sqrt(max(stable.size, 1)), 1.5, 5.0))
    lines = []
    with styled():
        for label, chosen, look in kinds:
            if chosen.any():
                lines += axes.plot(
                    x.values[chosen], y.values[chosen], ls="none", ms=size, label=label,
                    rasterized=True, **look,
                )  # fmt: skip
        drawn = list(borders)
        for curve in drawn:
            lines += axes.plot(*curve, color=INK, lw=1.2)
        for way, axis in (("x", x), ("y", y)):
            low, high = float(axis.values.min()), float(axis.values.max())
            room = 0.02 * (high - low)
            axes.set(**{f"{way}lim": (low - room, high + room), f"{way}label": axis.label})
        # Above the map: wherever it stood within, members would lie behind its words.
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(kinds))
        headings(axes, title)
    names = " and ".join(axis.label.partition(" (")[0] for axis in (x, y))
    text = (
        f"Map of {stable.size} plants over {names}: {number(100 * float(stable.mean()))} % of them "
        "are stable"
    )
    if not decided.all():
        text += f", {int((~decided).sum())} not decided"
    if drawn:
        text += "; lines are the exact borders of stability"
    return Figure(lines, axes, text)
