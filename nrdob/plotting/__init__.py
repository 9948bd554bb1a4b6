"""Every figure, with one look, and the words for those who cannot see it.

`diagrams`, the block diagrams, is a module of its own: it is loaded where it is asked for.
"""

from .alttext import complex_number, frequency, spoken, turns
from .bodeplot import bode_plot
from .chartplot import MapAxis, chart_plot, map_plot
from .explorer import Explorer, Slider
from .figure import (
    COLOURS,
    INK,
    SHORT,
    TALL,
    WIDTH,
    Figure,
    axes_for,
    colour_of,
    dress,
    missing,
    styled,
)
from .nyquistplot import nyquist_plot
from .stepplot import step_plot
from .winding import winding_animation, winding_plot

__all__ = [
    "COLOURS",
    "INK",
    "SHORT",
    "TALL",
    "WIDTH",
    "Explorer",
    "Figure",
    "MapAxis",
    "Slider",
    "axes_for",
    "bode_plot",
    "chart_plot",
    "colour_of",
    "complex_number",
    "diagrams",
    "dress",
    "frequency",
    "map_plot",
    "missing",
    "nyquist_plot",
    "spoken",
    "step_plot",
    "styled",
    "turns",
    "winding_animation",
    "winding_plot",
]


def __dir__() -> list[str]:
    return __all__
