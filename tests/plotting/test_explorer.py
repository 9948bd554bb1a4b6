"""Figures with sliders: what moves, what stays, and what a page without a kernel gets."""

from __future__ import annotations

import math
from io import BytesIO

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from nrdob.plotting import SHORT, Explorer, Figure, Slider, axes_for, styled
from nrdob.plotting.explorer import WIDGET_VIEW


@pytest.fixture
def explorer():
    with styled():
        (ax,) = axes_for(None, 1, SHORT)
        (line,) = ax.plot([0, 1], [0, 1])
        (_fixed,) = ax.plot([0, 1], [1, 0])

    def update(slope, count):
        line.set_data(np.linspace(0, 1, count), slope * np.linspace(0, 1, count))
        return f"slope {slope:g} by {count} points"

    sliders = {
        "slope": Slider("slope", 0.1, 1.0, 0.5, log=True),
        "count": Slider("points", 2, 9, 3),
    }
    yield Explorer(Figure([line], ax, alt="A line of slope 0.5"), [line], update, **sliders)
    plt.close("all")


def pixels(png):
    return np.asarray(Image.open(BytesIO(png)).convert("RGBA")).astype(int)


@pytest.mark.slow
def test_a_move_changes_the_picture_and_back_again_restores_it(explorer):
    first = explorer.frame()
    assert explorer.move(slope=1.0) == "slope 1 by 3 points"
    assert explorer.frame() != first
    explorer.move(slope=0.5)
    assert explorer.frame() == first


@pytest.mark.slow
def test_frames_look_like_the_figure_drawn_afresh(explorer):
    explorer.frame()
    explorer.move(slope=0.9)
    difference = np.abs(pixels(explorer.frame()) - pixels(explorer.figure.png())).max(axis=2)
    # What moves is drawn above what does not: only where two lines cross may pixels differ.
    assert np.mean(difference > 3) < 1e-3


@pytest.mark.slow
def test_the_ground_is_transparent(explorer):
    assert pixels(explorer.frame())[2, 2, 3] == 0


@pytest.mark.slow
def test_sliders_drive_the_picture(explorer):
    box = explorer.widget()
    slope, count, line, picture = box.children
    before = picture.value
    count.value = 5
    assert line.value == "slope 0.5 by 5 points"
    slope.value = 1.0
    assert line.value == "slope 1 by 5 points" and picture.value != before
    assert (count.min, count.max) == (2, 9) and slope.min == pytest.approx(-1)


def test_a_slider_takes_two_hundred_steps_from_end_to_end():
    widget = Slider("gain", 5.0, 7.0, 6.0).widget()
    assert (widget.min, widget.max) == (5, 7) and widget.step == pytest.approx(0.01)


@pytest.mark.slow
def test_a_page_gets_the_picture_and_a_running_notebook_the_sliders(explorer):
    data, metadata = explorer._repr_mimebundle_()
    assert data["text/plain"] == metadata["image/png"]["alt"] == "A line of slope 0.5"
    assert data["image/png"].startswith(b"\x89PNG") and "model_id" in data[WIDGET_VIEW]


def test_an_unknown_slider_is_named(explorer):
    with pytest.raises(ValueError, match="no slider lag; there are slope, count"):
        explorer.move(lag=1)


@pytest.mark.parametrize(
    ("low", "high", "value", "log"),
    [
        (1.0, 0.0, 0.5, False),
        (0.0, 1.0, 2.0, False),
        (0.0, math.nan, 0.5, False),
        (0.0, 1.0, 0.5, True),
    ],
)
def test_a_slider_without_a_range_is_refused(low, high, value, log):
    with pytest.raises(ValueError, match="slider gain"):
        Slider("gain", low, high, value, log=log)
