"""What all figures share: the result, the style, one colour for each role, the names."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager
from io import BytesIO
from pathlib import Path
from typing import Any

import control as ct
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from ..diagram import INPUTS, MAPS

__all__ = [
    "COLOURS", "DPI", "INK", "PIXELS", "SHORT", "SMALLEST", "TALL", "WIDTH", "Figure", "axes_for",
    "colour_of", "dress", "headings", "in_lines", "label_of", "missing", "new_axes", "styled",
]  # fmt: skip

STYLE = Path(__file__).with_name("nrdob.mplstyle")
WIDTH, TALL, SHORT = 5.0, 4.0, 2.8
"""Size of a figure in inches: one width, two heights.

So narrow that its type can still be read where a phone of 360 pixels shows it.
"""

SMALLEST = 8.5  # size in points below which no type of a figure goes, indices apart
# CSS pixels to an inch of a figure where there is room: its labels are as large as text.
PIXELS = 125
DPI = 200
INK = "#757575"
COLOURS = {
    "process": "#0072B2",
    "model": "#D55E00",
    "loop": "#009E73",
    "filter": "#B57B00",
    "noise": "#CC79A7",
    "reference": "#2E96D1",
    "disturbance": "#8A8200",
    "controller": "#8573B5",
    "critical": "#E0202E",
}
"""Colour of each role, after Okabe and Ito, darkened where white paper asks for it."""

_NAMES = MAPS | INPUTS


class Figure(ct.ControlPlot):  # type: ignore[misc]
    """What every plot function returns: control's plot result, and the figure in words.

    Parameters
    ----------
    lines, axes : as in `control.ControlPlot`
        What was drawn, and where.
    alt : str
        Alt text: the facts that the figure shows.
    svg : str
        Is shown in place of the drawing where SVG can be: an animation.
    """

    def __init__(self, lines: Any, axes: Any, alt: str, svg: str = "") -> None:
        shaped = np.atleast_2d(axes)
        # The figure of a subfigure's axes is the whole one.
        super().__init__(lines, shaped, shaped[0, 0].figure.figure)
        self.alt, self.svg = alt, svg

    def __repr__(self) -> str:
        return self.alt

    def png(self) -> bytes:
        """Render at 200 dpi on a transparent ground; the same figure gives the same bytes."""
        buffer = BytesIO()
        with styled():
            self.figure.savefig(
                buffer, format="png", dpi=DPI, transparent=True, metadata={"Software": None}
            )
        return buffer.getvalue()

    def _repr_mimebundle_(self, **_: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        width, height = (round(float(PIXELS * inches)) for inches in self.figure.get_size_inches())
        data = {"image/png": self.png(), "text/plain": self.alt}
        if self.svg:
            data["image/svg+xml"] = self.svg
        # Left open, the inline backend would show the figure a second time; a window stays.
        if self.figure.canvas.required_interactive_framework is None:
            plt.close(self.figure)
        return data, {"image/png": {"alt": self.alt, "width": width, "height": height}}


def styled() -> AbstractContextManager[None]:
    """Draw in the style of this package and leave the user's settings as they are."""
    return plt.style.context(STYLE)


def axes_for(given: Any, count: int, height: float) -> list[Axes]:
    """Return the user's axes, or new ones in a figure of the one width.

    Parameters
    ----------
    given : matplotlib Axes, a sequence of them, or None
        What the user gave.
    count, height : {1, 2, 4}, float
        How many the figure needs, and the height of a new one, in inches.
    """
    if given is not None:
        axes = list(np.ravel(np.asarray(given, dtype=object)))
        if len(axes) != count:
            raise ValueError(f"{len(axes)} axes given; this figure needs {count}")
        for ax in axes:
            if not isinstance(ax, Axes):
                raise TypeError(
                    f"{ax!r} is a {type(ax).__name__}; give matplotlib axes, such as those that "
                    "plt.subplots() returns"
                )
        return axes
    return list(new_axes({1: (1, 1), 2: (2, 1), 4: (2, 2)}[count], height).flat)


def new_axes(shape: tuple[int, int], height: float) -> Any:
    """Make rows and columns of axes in a figure of the one width."""
    # The first figure loads the backend, which in a notebook turns plotting interactive: within
    # the style that would be undone, and no figure of the user's would ever be shown.
    figure = plt.figure(figsize=(WIDTH, height), layout="constrained")
    with styled():
        axes = figure.subplots(*shape, squeeze=False)
        for ax in axes.flat:
            dress(ax)
    return axes


def dress(ax: Axes) -> None:
    """Fix the style of ticks, which matplotlib would otherwise look up when it draws.

    Parameters
    ----------
    ax : matplotlib Axes
        New ones, within `styled`.
    """
    ax.tick_params(colors=INK, labelsize=mpl.rcParams["xtick.labelsize"], which="both")
    ax.grid(True, color=INK, alpha=mpl.rcParams["grid.alpha"], lw=mpl.rcParams["grid.linewidth"])


def headings(ax: Axes, left: str, right: str = "") -> None:
    """Write above the axes, at the left and at the right; what is too long takes more lines."""
    figure, room = ax.figure.figure, ax.bbox.width
    above = in_lines(figure, left, room)
    last = above.rpartition("\n")[2]
    if right and left and _width(figure, f"{last}    {right}") > room:
        above += "\n"
    if left:
        ax.set_title(above, loc="left")
    if right:
        ax.set_title(right, loc="right")


def in_lines(figure: Any, text: str, room: float) -> str:
    """Break a heading into lines of at most `room` pixels; a formula stays whole."""
    lines: list[str] = []
    for word in re.findall(r"(?:\$[^$]*\$|[^\s$])+", text):
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and _width(figure, longer) <= room:
            lines[-1] = longer
        else:
            lines.append(word)
    return "\n".join(lines)


def _width(figure: Any, text: str) -> float:
    """Measure a heading, in pixels."""
    written = figure.text(0, 0, text, size=mpl.rcParams["axes.titlesize"])
    width = float(written.get_window_extent().width)
    written.remove()
    return width


def colour_of(name: str) -> str:
    """Return the colour of a map or an input.

    Parameters
    ----------
    name : str
        Attribute of a loop, as "FH", or an input, as "delta".
    """
    return COLOURS[_NAMES[name].role if name in _NAMES else "loop"]


def label_of(name: str) -> str:
    """Write the name of a map or an input, as "FH" or "delta", as in the book; "" as it is."""
    return _NAMES[name].label if name in _NAMES else name and f"${name}$"


def missing(error: ImportError, extra: str) -> ImportError:
    """Name the command that brings a library which is not installed.

    Parameters
    ----------
    error, extra : ImportError, str
        What Python says, and the extra of this package that the library comes with.
    """
    return ImportError(
        f'{error.name} is not installed; it comes with an extra: pip install "nrdob[{extra}]"',
        name=error.name,
    )
