"""The argument principle: a walk around the unit circle, and how far f(s) has turned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from ..numerics import ComplexArray, FloatArray
from .figure import COLOURS, INK, TALL, WIDTH, Figure, dress, styled

__all__ = ["winding_plot"]

CIRCLE: ComplexArray = np.exp(-2j * np.pi * np.linspace(0, 1, 401))
"""The walk: clockwise, from +1 to +1."""


def winding_plot(zeros: Sequence[complex], poles: Sequence[complex]) -> Figure:
    """Draw a walk around the unit circle in four moments, and f(s) below it.

    Parameters
    ----------
    zeros, poles : sequence of complex
        Of f, none of them on the circle.

    Returns
    -------
    Figure
        Above the walker with a vector from each zero and pole, below f(s) and its turns.
    """
    turned = _swept(_rational(zeros, poles))
    axes, moments = _panels(), (100, 200, 300, 400)
    with styled():
        for (above, below), k in zip(axes.T, moments, strict=True):
            _draw_walk(above, zeros, poles, k)
            _draw_value(below, _rational(zeros, poles), k)
            above.set_title(f"{k // 100} of 4 quarters")
            below.set_title(f"{turned[k]:+.2f} turns")
        axes[0, 0].set(xlabel="Re s", ylabel="Im s")
        axes[1, 0].set(xlabel="Re f", ylabel="Im f")
    said = ", ".join(f"{turned[k]:.2f}" for k in moments)
    return Figure([], axes, f"f(s) after each quarter of the way: {said} clockwise turns around 0")


def _rational(zeros: Sequence[complex], poles: Sequence[complex]) -> ComplexArray:
    """Give f on the circle."""
    value = np.ones_like(CIRCLE)
    for a in zeros:
        value = value * (CIRCLE - a)
    for a in poles:
        value = value / (CIRCLE - a)
    return value


def _swept(values: ComplexArray) -> FloatArray:
    """Angle turned so far, in clockwise turns."""
    steps = np.angle(values[1:] / values[:-1])
    return np.append(0.0, -np.cumsum(steps) / (2 * np.pi))


def _panels() -> Any:
    figure = plt.figure(figsize=(WIDTH, TALL), layout="constrained")
    with styled():
        axes = figure.subplots(2, 4)
        for ax in axes.flat:
            dress(ax)
            ax.set_aspect("equal", adjustable="datalim")
    return axes


def _draw_walk(ax: Axes, zeros: Sequence[complex], poles: Sequence[complex], k: int) -> None:
    walker = CIRCLE[k]
    for points, marker, role in ((zeros, "o", "process"), (poles, "x", "model")):
        for a in points:
            colour = COLOURS[role]
            ax.plot([a.real, walker.real], [a.imag, walker.imag], color=colour, lw=1.1)
            ax.plot(a.real, a.imag, marker, color=colour, ms=5.5)
    ax.plot(CIRCLE.real, CIRCLE.imag, color=INK, lw=0.7)
    ax.plot(CIRCLE[: k + 1].real, CIRCLE[: k + 1].imag, color=COLOURS["reference"])
    ax.plot(walker.real, walker.imag, ".", color=COLOURS["reference"], ms=9)


def _draw_value(ax: Axes, image: ComplexArray, k: int) -> None:
    ax.plot(image.real, image.imag, color=INK, lw=0.7)
    ax.plot(image[: k + 1].real, image[: k + 1].imag, color=COLOURS["loop"])
    ax.plot([0, image[k].real], [0, image[k].imag], color=INK, lw=1.1)
    ax.plot(image[k].real, image[k].imag, ".", color=COLOURS["loop"], ms=9)
    ax.plot(0, 0, "+", color=COLOURS["critical"], ms=9, mew=2.2, zorder=6)
