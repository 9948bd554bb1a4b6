"""A figure with sliders, which moves in a running notebook and is a still picture in a page.

The fixed part of the figure (axes, grid, labels) is drawn once. A move of a slider changes the data
of a few artists and draws only these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO
from math import log10
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from .figure import DPI, PIXELS, Figure, missing, styled

__all__ = ["WIDGET_VIEW", "Explorer", "Slider"]

WIDGET_VIEW = "application/vnd.jupyter.widget-view+json"


@dataclass(frozen=True)
class Slider:
    """A number that the reader can change.

    Attributes
    ----------
    label : str
        Symbol and unit, as "λ (s)".
    low, high, value, log : float, float, float, bool
        Range and initial value, and whether the scale is logarithmic. Three whole numbers make a
        slider of whole numbers.

    Raises
    ------
    ValueError
        If the range is empty, does not hold the value, or is logarithmic and not positive.
    """

    label: str
    low: float
    high: float
    value: float
    log: bool = False

    def __post_init__(self) -> None:
        if not self.low < self.high or not self.low <= self.value <= self.high:
            raise ValueError(
                f"slider {self.label} goes from {self.low} to {self.high} and stands at "
                f"{self.value}; it needs low < high, and a value between them"
            )
        if self.log and self.low <= 0:
            raise ValueError(
                f"slider {self.label} begins at {self.low}; on a logarithmic scale it must begin "
                "above 0"
            )

    def widget(self) -> Any:
        """Make the slider; an ImportError without ipywidgets."""
        widgets = _widgets()
        kind, low, high = widgets.FloatSlider, self.low, self.high
        steps = {"step": (high - low) / 200, "readout_format": ".3g"}
        if all(isinstance(number, int) for number in (low, high, self.value)):
            kind, steps = widgets.IntSlider, {}
        elif self.log:
            kind, low, high = widgets.FloatLogSlider, log10(low), log10(high)
            steps["step"] = 0.005
        return kind(
            value=self.value, min=low, max=high, description=self.label, continuous_update=True,
            **steps,
        )  # fmt: skip


class Explorer:
    """A figure whose moving artists follow sliders.

    Parameters
    ----------
    figure, moving : Figure, sequence of matplotlib artists
        Drawn with the initial values of the sliders, as its alt text says, and what of it `update`
        changes. The axes' limits stay as they are.
    update : callable
        Takes the sliders' values by name, sets the data of the moving artists, and returns a line
        of text that says what is to be seen: a verdict, numbers.
    **sliders : Slider
        By the names that `update` takes.

    Examples
    --------
    >>> from nrdob.plotting import SHORT, axes_for
    >>> (ax,) = axes_for(None, 1, SHORT)
    >>> line, = ax.plot([0, 1], [0, 1])
    >>> def update(slope):
    ...     line.set_ydata([0, slope])
    ...     return f"slope {slope:g}"
    >>> explorer = Explorer(
    ...     Figure([line], ax, alt="A line"), [line], update, slope=Slider("slope", 0.0, 1.0, 0.5)
    ... )
    >>> explorer.move(slope=0.25)
    'slope 0.25'
    """

    def __init__(
        self,
        figure: Figure,
        moving: Sequence[Artist],
        update: Callable[..., str],
        **sliders: Slider,
    ) -> None:
        self.figure, self.moving, self.update, self.sliders = figure, moving, update, sliders
        self.alt = figure.alt
        self.values: dict[str, float] = {name: s.value for name, s in sliders.items()}
        self._background: Any = None
        self.update(**self.values)

    def __repr__(self) -> str:
        return self.alt

    def move(self, **values: float) -> str:
        """Set some sliders' values and update the artists; give the line of text.

        Parameters
        ----------
        **values : float
            By the sliders' names.
        """
        if unknown := set(values) - set(self.sliders):
            raise ValueError(
                f"there is no slider {', '.join(sorted(unknown))}; there are "
                f"{', '.join(self.sliders)}"
            )
        self.values |= values
        return self.update(**self.values)

    def frame(self) -> bytes:
        """Render the present state as PNG: the fixed part once, then only what moves."""
        figure = self.figure.figure
        canvas = FigureCanvasAgg(figure)
        with styled():
            if self._background is None:
                figure.set_dpi(DPI)
                for patch in (figure.patch, *(ax.patch for ax in figure.axes)):
                    patch.set_alpha(0.0)
                for artist in self.moving:
                    artist.set_animated(True)
                canvas.draw()
                self._background = canvas.copy_from_bbox(figure.bbox)
            renderer = canvas.get_renderer()
            canvas.restore_region(self._background)
            for artist in self.moving:
                artist.draw(renderer)
        buffer = BytesIO()
        Image.fromarray(np.asarray(canvas.buffer_rgba())).save(buffer, "png", compress_level=1)
        return buffer.getvalue()

    def widget(self) -> Any:
        """Make sliders, picture and line of text, connected; an ImportError without ipywidgets."""
        widgets = _widgets()
        width = round(float(PIXELS * self.figure.figure.get_figwidth()))
        picture = widgets.Image(value=self.frame(), format="png", width=width)
        line = widgets.Label(value=self.update(**self.values))
        controls = {name: slider.widget() for name, slider in self.sliders.items()}

        def follow(_change: Any) -> None:
            line.value = self.move(**{name: control.value for name, control in controls.items()})
            picture.value = self.frame()

        for control in controls.values():
            control.observe(follow, names="value")
        return widgets.VBox([*controls.values(), line, picture])

    def _repr_mimebundle_(self, **_: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        # A page shows the picture; a running notebook, which knows widgets, prefers the view.
        data, metadata = self.figure._repr_mimebundle_()
        try:
            view = self.widget()._repr_mimebundle_()[WIDGET_VIEW]
        except ImportError:
            return data, metadata
        return data | {WIDGET_VIEW: view}, metadata


def _widgets() -> Any:
    # Loaded only where sliders are shown.
    try:
        import ipywidgets
    except ImportError as error:
        raise missing(error, "notebooks") from error
    return ipywidgets
