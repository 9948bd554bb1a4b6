"""Maps of families: members as points, coloured by what becomes of them, and exact borders."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ..numerics import BoolArray, FloatArray, number
from .figure import COLOURS, INK, TALL, Figure, axes_for, headings, styled

__all__ = ["MapAxis", "map_plot"]


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
