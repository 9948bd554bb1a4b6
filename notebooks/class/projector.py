"""Figures for a projector: fewer inches for the same letters, and more dots to the inch."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib.figure import Figure

from nrdob.plotting import figure

LARGE, SMALL = (5.0, 2.55), (2.8, 2.15)
"""Inches of a figure that fills a slide, and of one that shares it with a question."""

figure.DPI = 240


@contextmanager
def slide(columns: int = 1, size: tuple[float, float] = LARGE) -> Iterator[Any]:
    """Draw in the style of the book: gives the axes, or a list of as many as there are columns."""
    (only,) = figure.axes_for(None, 1, size[1])
    picture = only.figure
    assert isinstance(picture, Figure)  # and no part of one
    picture.set_size_inches(*size)
    with figure.styled():
        if columns == 1:
            yield only
            return
        only.remove()
        several = list(picture.subplots(1, columns))
        for ax in several:
            figure.dress(ax)
        yield several
