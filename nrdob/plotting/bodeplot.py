"""Bode diagrams, with the margins where they are."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from ..analysis import Margins, resolved_frequencies
from ..diagram import Quotient, as_quotient, real_number
from ..numerics import FloatArray, number
from . import alttext
from .figure import COLOURS, INK, TALL, Figure, axes_for, colour_of, headings, label_of, styled

__all__ = ["bode_plot"]

MAX_PHASE_SPAN = 720.0  # degrees below which a delay's phase is not followed


def bode_plot(
    *quotients: Any,
    margins: Margins | None = None,
    omega_limits: tuple[float, float] | None = None,
    title: str = "",
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Draw Bode diagrams, with margins where they are.

    Parameters
    ----------
    *quotients : as for `nrdob.margins`
        One or more maps of the loop, or loop gains L.
    margins : Margins, optional
        Those of the first map; finite ones are drawn, whether gain may rise or fall.
    omega_limits, title, axes : optional
        As for `nrdob.NRDOB.plot_bode`.

    Raises
    ------
    TypeError, ValueError
        Without a map, or if something is given that cannot be drawn.
    """
    if not quotients:
        raise ValueError("bode_plot needs at least one map, such as loop.FH")
    quotients = tuple(as_quotient(each, "L") for each in quotients)
    if not isinstance(margins, Margins | None):
        raise TypeError(
            f"margins is a {type(margins).__name__}; give those of the map that is drawn, such as "
            "loop.margins().observer_loop for loop.FH"
        )
    asked = omega_limits is not None
    low, high = _limits(omega_limits) if asked else _frequency_range(quotients, margins)
    magnitude, phase = axes_for(axes, 2, TALL)
    with styled():
        lines: list[list[Line2D]] = [[], []]
        used: set[str] = set()
        curves: dict[str, list[tuple[float, float, float]]] = {}
        for quotient in quotients:
            omega = _bode_frequencies(quotient, low, high)
            decibel, degrees = _decibels(quotient, omega), _degrees(quotient, omega)
            kind = {"color": colour_of(quotient.name), "label": label_of(quotient.name)}
            kind["ls"] = "--" if kind["color"] in used else "-"
            used.add(kind["color"])
            curves[quotient.name] = [(omega[k], decibel[k], degrees[k]) for k in (0, -1)]
            lines[0] += magnitude.semilogx(omega, decibel, **kind)
            lines[1] += phase.semilogx(omega, degrees, **kind)
            if np.isnan(decibel).all():
                magnitude.text(0.5, 0.7, f"{kind['label']} = 0 at every frequency", ha="center",
                               transform=magnitude.transAxes)  # fmt: skip
        _bode_frame(magnitude, phase, (low, high), quotients)
        headings(magnitude, title)
        if margins is not None and margins.stable:
            _draw_margins(magnitude, phase, quotients[0], margins)
        if len(quotients) > 1:
            _label_curves(magnitude, lines[0])
    alt = alttext.bode(title, curves, margins)
    shaped = np.empty((2, 1), dtype=object)
    shaped[:, 0] = lines
    return Figure(shaped, np.array([[magnitude], [phase]]), alt)


def _limits(given: Any) -> tuple[float, float]:
    """Check the frequency range that the user wants to see."""
    remedy = "it must be the pair (low, high) of frequencies in rad/s, 0 < low < high"
    ends = [
        real_number(end, "omega_limits", remedy, above=-inf) for end in np.ravel(given).tolist()
    ]
    if not (len(ends) == 2 and 0 < ends[0] < ends[1]):
        raise ValueError(f"omega_limits is {given!r}; {remedy}")
    return ends[0], ends[1]


def _frequency_range(quotients: Sequence[Quotient], margins: Margins | None) -> tuple[float, float]:
    """Cover all corners and margins and most of a decade around them, in round numbers."""
    factors = [factor for quotient in quotients for factor in (*quotient.num, *quotient.den)]
    corners = [np.abs(np.roots(part)) for factor in factors for part, _ in factor.terms]
    if margins is not None:
        corners.append(np.array([margins.wpc, margins.wgc]))
    # With a delay, as far as one turn: beyond it the phase only falls ever faster.
    seen = np.concatenate([*corners, [2 * np.pi / (5 * q.delay) for q in quotients if q.delay]])
    seen = seen[(seen > 0) & (seen < inf)]
    if not seen.size:
        return 0.1, 10.0
    decades = 10.0 ** np.floor(np.log10([seen.min() / 5, 5 * seen.max()]))
    steps = np.array([1.0, 2.0, 5.0, 10.0])
    low, high = seen.min() / 5 / decades[0], 5 * seen.max() / decades[1]
    return float(decades[0] * steps[steps <= low][-1]), float(decades[1] * steps[steps >= high][0])


def _bode_frequencies(quotient: Quotient, low: float, high: float) -> FloatArray:
    omega = resolved_frequencies(quotient)
    if quotient.delay and omega[-1] < high:
        step = 0.2 / quotient.delay
        omega = np.append(omega, np.arange(omega[-1], min(high, omega[-1] + 1e4 * step), step))
    even = np.geomspace(low, high, 500)
    return np.union1d(even, omega[(omega > low) & (omega < high)])


def _decibels(quotient: Quotient, omega: FloatArray) -> FloatArray:
    size = np.abs(quotient(1j * omega))
    return np.where(size > 0, 20 * np.log10(np.where(size > 0, size, 1.0)), nan)


def _degrees(quotient: Quotient, omega: FloatArray) -> FloatArray:
    """Continuous phase, which starts where the poles and zeros at s = 0 put it."""
    values = quotient(1j * omega)
    degrees = np.degrees(np.unwrap(np.angle(values)))
    zeros = quotient.zeros_at_origin
    gain = (values[0] / 1j**zeros).real
    expected = 90.0 * zeros - 180.0 * (gain < 0)
    degrees += 360 * np.round((expected - degrees[0]) / 360)
    return np.where(np.abs(values) > 0, degrees, nan)


def _bode_frame(
    magnitude: Axes, phase: Axes, limits: tuple[float, float], quotients: Sequence[Quotient]
) -> None:
    label = label_of(quotients[0].name) if len(quotients) == 1 else ""
    of = f" of {label}" if label else ""
    magnitude.set(ylabel=f"magnitude{of} (dB)", xlim=limits)
    phase.set(ylabel="phase (deg)", xlabel="frequency ω (rad/s)", xlim=limits)
    magnitude.tick_params(labelbottom=False)
    low, high = phase.get_ylim()
    phase.set_ylim(max(low, min(high, 0.0) - MAX_PHASE_SPAN), high)
    span = abs(np.subtract(*phase.get_ylim()))
    if step := next((s for s in (45, 90, 180, 360) if span / s <= 6), None):
        phase.yaxis.set_major_locator(MultipleLocator(step))
    for ax, level in ((magnitude, 0.0), (phase, -180.0), (phase, 180.0)):
        if ax.get_ylim()[0] < level < ax.get_ylim()[1]:
            ax.axhline(level, color=INK, lw=0.9, ls=":")


def _draw_margins(magnitude: Axes, phase: Axes, quotient: Quotient, margins: Margins) -> None:
    """Draw the way to 0 dB and to -180 degrees, with its length beside it."""
    low, high = magnitude.get_xlim()
    first, last = low * (high / low) ** 0.015, high * (low / high) ** 0.015
    omega = margins.phase_crossovers
    ends = np.clip(omega, first, last)
    levels = _decibels(quotient, ends)
    for gain in (margins.gm_low, margins.gm_high):
        if 0 < gain < inf:
            k = int(np.argmin(np.abs(levels + 20 * np.log10(gain))))
            text = f"GM {number(20 * np.log10(gain))} dB {alttext.frequency(float(omega[k]))}"
            later = _decibels(quotient, ends[k : k + 1] * 1.02)[0]
            level = -20 * float(np.log10(gain))
            _span(magnitude, float(ends[k]), level, 0.0, text, rising=bool(later > levels[k]))
    if margins.pm < inf:
        w = min(max(margins.wgc, first), last)
        grid = _bode_frequencies(quotient, low, high)
        angle, later = np.interp([w, 1.02 * w], grid, _degrees(quotient, grid))
        level = 360 * round((angle - 180) / 360) + 180.0
        text = f"PM {number(margins.pm)}° {alttext.frequency(margins.wgc)}"
        _span(phase, w, float(angle), level, text, rising=bool(later > angle))


def _span(ax: Axes, x: float, start: float, end: float, text: str, *, rising: bool) -> None:
    bottom, top = ax.get_ylim()
    # The text goes beyond the level that the curve is measured against, off the curve's side.
    beyond = 1 if end > start else -1
    room = 0.2 * (max(top, end) - min(bottom, end))
    ax.set_ylim(min(bottom, end - room * (beyond < 0)), max(top, end + room * (beyond > 0)))
    ax.plot([x, x], [start, end], color=COLOURS["critical"], lw=1.8, zorder=5)
    ax.plot(x, start, "o", color=COLOURS["critical"], ms=4, zorder=5)
    low, high = np.log(ax.get_xlim())
    place = (np.log(x) - low) / (high - low)
    # The curve crosses the level on one side of x: write on the other where there is room.
    side = "right" if rising == (beyond > 0) else "left"
    if place < 0.3 or place > 0.7:
        side = "left" if place < 0.2 else "right" if place > 0.8 else "center"
    ax.annotate(
        text, (x, end), (0, 4 * beyond), textcoords="offset points", color=COLOURS["critical"],
        ha=side, va="bottom" if beyond > 0 else "top", zorder=6,
    )  # fmt: skip


def _label_curves(ax: Axes, lines: Sequence[Line2D]) -> None:
    """Write each name on its curve, where the others are farthest."""
    low, high = np.log(ax.get_xlim())
    omega = np.exp(low + (high - low) * np.linspace(0.06, 0.94, 200))
    data = [np.asarray(line.get_data(), dtype=float) for line in lines]
    heights = np.array([np.interp(omega, x, y) for x, y in data])
    bottom, top = ax.get_ylim()
    taken = np.zeros(omega.size)
    for k, line in enumerate(lines):
        gap = heights[k] - np.delete(heights, k, axis=0)
        room = np.min(np.abs(gap), axis=0) - taken
        height = (heights[k] - bottom) / (top - bottom)
        room[(height < 0.12) | (height > 0.88)] -= 1e3
        at = int(np.argmax(room))
        taken[max(0, at - 25) : at + 25] += 1e2
        above = gap[np.argmin(np.abs(gap[:, at])), at] >= 0
        ax.annotate(
            str(line.get_label()), (omega[at], heights[k, at]), (0, 6 if above else -6),
            textcoords="offset points", ha="center", va="bottom" if above else "top",
            color=line.get_color(),
        )  # fmt: skip
