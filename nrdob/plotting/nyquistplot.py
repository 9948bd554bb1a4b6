"""The Nyquist plot, with -1, the closest approach to it, and what closes the curve at infinity."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..analysis import LoopStability, NyquistCount, encirclements
from ..diagram import as_quotient, real_number
from ..numerics import ComplexArray, FloatArray, number
from . import alttext
from .contour import Approach, Contour, closest_approach, contour
from .figure import (
    COLOURS,
    INK,
    SMALLEST,
    TALL,
    Figure,
    axes_for,
    colour_of,
    headings,
    label_of,
    styled,
)

__all__ = ["nyquist_plot"]

# Distances, in points, at which a text may stand from what it belongs to.
REACHES = (14.0, 20.0, 27.0, 35.0)
CROWDED = 5000  # so many points near a text need not be told apart by less than one point of type
ENOUGH = 5.0  # room around a text, in points, of which more is not better


def nyquist_plot(
    quotient: Any,
    *,
    verdict: LoopStability | NyquistCount | None = None,
    point: float = -1.0,
    title: str = "",
    ax: Axes | None = None,
) -> Figure:
    """Draw a complete Nyquist plot: both halves, and the arcs that close it at infinity.

    Where the plot is so large that the point would drown, an inset magnifies it.

    Parameters
    ----------
    quotient : as for `nrdob.margins`
        A map of the loop, such as ``loop.FH``, or a loop gain L, proper or not.
    verdict : LoopStability or NyquistCount, optional
        N, P and Z if they are known; by default they are counted.
    point : float
        Point of the real axis to encircle: -1, or +1 for the paper's G̃⁻¹G.
    title, ax : optional
        As for `nrdob.NRDOB.plot_nyquist`.

    Raises
    ------
    TypeError, ValueError
        If something is given that cannot be drawn; the message names it and the remedy.
    """
    remedy = "it must be a finite real number: -1, or +1 for the ratio G̃⁻¹G"
    point = real_number(point, "point", remedy, above=-inf)
    quotient = as_quotient(quotient, "L")
    curve = contour(quotient)
    approach = closest_approach(quotient, curve, point)
    counted = encirclements(quotient, point) if verdict is None else verdict
    (ax,) = axes_for(ax, 1, TALL)
    with styled():
        colour = colour_of(quotient.name)
        lines = _draw_contour(ax, curve, colour)
        label = label_of(quotient.name)
        ax.set(xlabel=f"Re {label}".strip(), ylabel=f"Im {label}".strip())
        headings(ax, title, _n_p_z(counted))
        _window(ax, curve, point)
        _arrows(ax, curve, colour)
        _arc_labels(ax, curve)
        _critical(ax, point)
        if curve.size > 7 * max(1.0, abs(point)):
            _inset(ax, curve, colour, point, approach)
        else:
            _mark_approach(ax, curve, approach, point)
        # A later change of the layout may move the limits again, without a message. Reading them
        # first settles what the drawing above has left pending.
        ax.get_xlim()
        ax.set_autoscale_on(True)
    alt = alttext.nyquist(
        quotient.name, title, point, counted.encirclements, approach, curve.left_out
    )
    return Figure(np.array([lines], dtype=object), ax, alt)


def _n_p_z(count: LoopStability | NyquistCount) -> str:
    counts = count.encirclements, count.open_loop_rhp, count.closed_loop_rhp
    n, p, z = ("?" if each is None else number(each) for each in counts)
    endless = count.encirclements == inf != count.closed_loop_rhp
    relation = "$Z$" if endless else "$Z$ = $N + P$"
    return f"$N$ = {n},  $P$ = {p},  {relation} = {z}"


def _draw_contour(ax: Axes, curve: Contour, colour: str) -> list[Line2D]:
    lines = []
    for branch in curve.branches:
        lines += ax.plot(branch.real, branch.imag, color=colour, zorder=3)
        lines += ax.plot(branch.real, -branch.imag, "--", color=colour, lw=1.3, zorder=3)
    for arc in curve.arcs:
        closed = arc.points
        lines += ax.plot(closed.real, closed.imag, color=colour, lw=1.1, alpha=0.45, zorder=2)
    first = curve.values[0]
    if curve.size < inf and curve.omega[0] == 0:
        ax.plot(first.real, first.imag, "o", ms=4.5, color=colour, zorder=4)
    turn = np.linspace(0, 2 * np.pi, 361)
    ax.plot(np.cos(turn), np.sin(turn), ":", color=INK, lw=1.0, zorder=1)
    ax.axhline(0, color=INK, lw=0.6, zorder=1)
    ax.axvline(0, color=INK, lw=0.6, zorder=1)
    return lines


def _critical(ax: Axes, point: float) -> None:
    ax.plot([point], [0], "+", color=COLOURS["critical"], ms=9, mew=2.2, zorder=6)


def _window(ax: Axes, curve: Contour, point: float) -> None:
    drawn = _drawn(curve)
    low = min(float(drawn.real.min()), point, -0.1)
    high = max(float(drawn.real.max()), point, 0.4)
    tall = max(float(np.abs(drawn.imag).max()), 0.3 * (high - low), 0.5)
    ax.update_datalim([(low, -tall), (high, tall)])
    ax.margins(0.06)
    ax.set_aspect("equal", adjustable="datalim")
    # Settles layout and limits now, so that arrows and labels know where they stand.
    ax.figure.figure.draw_without_rendering()
    ax.autoscale(False)


def _drawn(curve: Contour) -> ComplexArray:
    return np.concatenate([*curve.branches, *(arc.points for arc in curve.arcs)])


def _arrows(ax: Axes, curve: Contour, colour: str) -> None:
    """Arrowheads half way along what is seen: the way of increasing frequency."""
    branch = max(curve.branches, key=lambda z: float(np.abs(np.diff(z)).sum()))
    view = abs(np.subtract(*ax.get_ylim()))
    long = _along(branch)[-1]
    if long < 0.05 * view:
        return
    ways = [(branch, 0.35), (branch, 0.7), (np.conj(branch[::-1]), 0.5)]
    arrows = [(z, fraction * min(long, 4 * view), 1.0) for z, fraction in ways]
    arrows += [(arc.points, 0.3 * _along(arc.points)[-1], 0.6) for arc in curve.arcs]
    for z, where, alpha in arrows:
        ends = where + 0.012 * view * np.array([1, -1])
        head, tail = np.interp(ends, _along(z), z)
        ax.annotate(
            "", (head.real, head.imag), (tail.real, tail.imag), zorder=4,
            arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 0, "mutation_scale": 15,
                        "shrinkA": 0, "shrinkB": 0, "alpha": alpha},
        )  # fmt: skip


def _along(z: ComplexArray) -> FloatArray:
    """Length of a polygon up to each of its points."""
    return np.append(0.0, np.cumsum(np.abs(np.diff(z))))


def _arc_labels(ax: Axes, curve: Contour) -> None:
    for arc in curve.arcs:
        middle = arc.points[arc.points.size // 2]
        outward = middle / abs(middle)
        left, right = ax.get_xlim()
        if min(middle.real - left, right - middle.real) < 0.2 * (right - left):
            outward = -outward  # no room outside
        ax.annotate(
            arc.label, (middle.real, middle.imag), (6 * outward.real, 7 + 6 * outward.imag),
            textcoords="offset points", fontsize=SMALLEST, va="center",
            ha="left" if outward.real > 0.3 else "right" if outward.real < -0.3 else "center",
        )  # fmt: skip


def _mark_approach(ax: Axes, curve: Contour, approach: Approach, point: float) -> None:
    """Draw the shortest way from the point to the curve, with its length where there is room."""
    near = approach.value
    ax.plot([point, near.real], [0, near.imag], color=INK, lw=1.1, zorder=5)
    ax.plot(near.real, near.imag, "o", ms=3.5, color=INK, zorder=5)
    text = number(approach.distance)
    middle = complex((point + near.real) / 2, near.imag / 2)
    anchor, offset = _roomiest(ax, curve, (middle, complex(point)), approach, 3.3 * len(text))
    ax.annotate(
        text, (anchor.real, anchor.imag), (offset.real, offset.imag), textcoords="offset points",
        ha="center", va="center", zorder=7,
    )  # fmt: skip


def _roomiest(
    ax: Axes, curve: Contour, anchors: Sequence[complex], approach: Approach, half_width: float
) -> tuple[complex, complex]:
    """Place a short text: the anchor and the offset in points with most room between all lines."""
    way = anchors[1] + (approach.value - anchors[1]) * np.linspace(0, 1, 40)
    axis = np.linspace(*ax.get_xlim(), 600)
    circle = np.exp(1j * np.linspace(0, 2 * np.pi, 300))
    pieces = [*curve.branches, *(arc.points for arc in curve.arcs)]
    drawn = np.concatenate([_dense(piece, (axis[-1] - axis[0]) / 400) for piece in pieces])
    obstacles = np.concatenate([drawn, np.conj(drawn), way, axis, 1j * axis, circle])
    scale = 72 / ax.figure.figure.dpi
    points = _pixels(ax, obstacles) * scale
    far = REACHES[-1] + half_width + 2 * ENOUGH
    reach, k = np.repeat(REACHES, 16), np.tile(np.arange(16), len(REACHES))
    offsets = reach * np.exp(1j * np.pi * k / 8)
    rooms = []
    for anchor in anchors:
        gap = points - _pixels(ax, np.array([anchor])) * scale
        near = gap[np.all(np.abs(gap) < far, axis=1)] @ [1, 1j]
        if near.size > CROWDED:
            near = np.unique(np.round(near))
        beside = near - offsets[:, None]
        aside, above = np.abs(beside.real) - half_width, np.abs(beside.imag) - 5.0
        room = np.hypot(np.maximum(aside, 0.0), np.maximum(above, 0.0))
        rooms.append(room.min(axis=1, initial=ENOUGH) - 0.04 * reach)
    of, best = divmod(int(np.argmax(rooms)), reach.size)
    return anchors[of], complex(offsets[best])


def _dense(z: ComplexArray, step: float) -> ComplexArray:
    """Points along a polygon, no farther apart than `step`."""
    length = _along(z)
    even = np.linspace(0.0, length[-1], 2 + int(min(length[-1] / step, 1e5)))
    return np.asarray(np.interp(even, length, z), dtype=complex)


def _pixels(ax: Axes, z: ComplexArray) -> FloatArray:
    """Where points are drawn, shape (N, 2)."""
    return np.asarray(ax.transData.transform(np.column_stack([z.real, z.imag])))


def _inset(ax: Axes, curve: Contour, colour: str, point: float, approach: Approach) -> None:
    """Magnify the neighbourhood of the point in the emptiest place."""
    half = max(1.3, 1.6 * min(approach.distance, 4.0))
    size = (0.32, 0.40)
    places = [(x, y) for x in (0.03, 0.34, 0.40, 0.65) for y in (0.56, 0.30, 0.04)]
    drawn = _drawn(curve)
    drawn = np.concatenate([drawn, np.conj(drawn), np.linspace(-1.0, 1.0, 50)])
    weights = np.abs(np.diff(drawn, append=drawn[-1:]))
    seen = ax.transAxes.inverted().transform(_pixels(ax, drawn))

    def crossed(place: tuple[float, float]) -> float:
        inside = (seen >= np.array(place) - 0.02) & (seen <= np.array(place) + size)
        return float(weights[inside.all(axis=1)].sum())

    box = ax.inset_axes((*min(places, key=crossed), *size))
    _draw_contour(box, curve, colour)
    _critical(box, point)
    extent = box.get_window_extent()
    wide = half * extent.width / extent.height
    box.set(xlim=(point - wide, point + wide), ylim=(-half, half), aspect="equal")
    # The unit circle is scale enough; tick labels would cover the curve around the inset.
    box.set(xticks=[], yticks=[])
    box.spines[["top", "right"]].set_visible(True)
    _mark_approach(box, curve, approach, point)
    ax.indicate_inset_zoom(box, edgecolor=INK, lw=0.8)
