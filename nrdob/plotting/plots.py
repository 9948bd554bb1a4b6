"""Bode diagrams, step responses and roots, each with its alt text.

A plot function draws into the axes it is given or into a figure of its own, and returns what
control's plot functions return, plus the figure in words. All figures share one width, two heights,
one style file and one colour for each role; nothing outside the figure is changed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, nan
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from ..analysis import Margins, resolved_frequencies, step_response
from ..diagram import INPUTS, LoopEquations, Quotient
from ..numerics import ComplexArray, FloatArray, QuasiPolynomial, count_rhp, number
from . import alttext
from .alttext import complex_number
from .figure import (
    COLOURS,
    INK,
    SHORT,
    TALL,
    Figure,
    as_map,
    as_number,
    axes_for,
    colour_of,
    headings,
    label_of,
    styled,
)

__all__ = ["bode_plot", "roots_plot", "step_plot"]

MAX_PHASE_SPAN = 720.0
"""Degrees below which a delay's phase is not followed."""

# Bode.


def bode_plot(
    *quotients: Quotient,
    margins: Margins | None = None,
    omega_limits: tuple[float, float] | None = None,
    title: str = "",
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Draw Bode diagrams, with margins where they are.

    Parameters
    ----------
    *quotients : Quotient
        One or more maps of the loop.
    margins : Margins, optional
        Those of the first map; finite ones are drawn, whether gain may rise or fall.
    omega_limits : (float, float), optional
        Frequency range in rad/s; by default what there is to see.
    title : str
        Heading, which also enters the alt text.
    axes : two matplotlib Axes, optional
        Where to draw magnitude and phase.

    Returns
    -------
    Figure
        With `.lines`, `.axes`, `.figure` and `.alt`.

    Raises
    ------
    TypeError, ValueError
        Without a map, or if something is given that cannot be drawn.
    """
    if not quotients:
        raise ValueError("bode_plot needs at least one map, such as loop.FH")
    quotients = tuple(map(as_map, quotients))
    if not isinstance(margins, Margins | None):
        raise TypeError(
            f"margins is a {type(margins).__name__}; give those of the map that is drawn, such as "
            "loop.margins().observer_loop for loop.FH"
        )
    low, high = _limits(omega_limits) or _frequency_range(quotients, margins)
    magnitude, phase = axes_for(axes, 2, TALL)
    with styled():
        lines: list[list[Line2D]] = [[], []]
        used: set[str] = set()
        curves: dict[str, list[alttext.BodePoint]] = {}
        for quotient in quotients:
            omega = _bode_frequencies(quotient, low, high)
            decibel, degrees = _decibels(quotient, omega), _degrees(quotient, omega)
            kind = {"color": colour_of(quotient.name), "label": label_of(quotient.name)}
            kind["ls"] = "--" if kind["color"] in used else "-"
            used.add(kind["color"])
            ends = [alttext.BodePoint(omega[k], decibel[k], degrees[k]) for k in (0, -1)]
            curves[quotient.name] = ends
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


def _limits(given: Any) -> tuple[float, float] | None:
    """Check the frequency range that the user wants to see."""
    if given is None:
        return None
    needed = "the pair (low, high) of frequencies in rad/s, 0 < low < high"
    if np.shape(given) != (2,):
        raise ValueError(f"omega_limits is {given!r}; it must be {needed}")
    low, high = (as_number(end, "omega_limits", needed) for end in given)
    if not 0 < low < high:
        raise ValueError(f"omega_limits is {given!r}; it must be {needed}")
    return low, high


def _frequency_range(quotients: Sequence[Quotient], margins: Margins | None) -> tuple[float, float]:
    """Cover all corners and margins and most of a decade around them, in round numbers."""
    corners = [
        np.abs(np.roots(part))
        for quotient in quotients
        for factor in (*quotient.num, *quotient.den)
        for part, _ in factor.terms
    ]
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
    gain = (values[0] / (1j * omega[0]) ** zeros).real
    expected = 90.0 * zeros - 180.0 * (gain < 0)
    degrees += 360 * np.round((expected - degrees[0]) / 360)
    return np.where(np.abs(values) > 0, degrees, nan)


def _bode_frame(
    magnitude: Axes, phase: Axes, limits: tuple[float, float], quotients: Sequence[Quotient]
) -> None:
    of = f" of {label_of(quotients[0].name)}" if len(quotients) == 1 else ""
    magnitude.set(ylabel=f"magnitude{of} (dB)", xlim=limits)
    phase.set(ylabel="phase (deg)", xlabel="frequency ω (rad/s)", xlim=limits)
    magnitude.tick_params(labelbottom=False)
    low, high = phase.get_ylim()
    phase.set_ylim(max(low, min(high, 0.0) - MAX_PHASE_SPAN), high)
    span = abs(np.subtract(*phase.get_ylim()))
    step = next((s for s in (45, 90, 180, 360) if span / s <= 6), None)
    if step:
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


# Step responses.


def step_plot(
    loop: LoopEquations,
    *,
    signal: str = "y",
    compare: LoopEquations | Mapping[str, LoopEquations] | None = None,
    timepts: Any = None,
    title: str = "",
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Draw the responses to a unit step of reference, disturbances and noise.

    Parameters
    ----------
    loop : LoopEquations
        The loop.
    signal : {"y", "u"}
        Output or control signal.
    compare : LoopEquations or dict of str: LoopEquations, optional
        Other loops, drawn dashed and grey; one without a label is called "nominal".
    timepts : array_like or float, optional
        Times in seconds, or the last one; by default each panel shows what there is to see.
    title : str
        Heading, which also enters the alt text.
    axes : four matplotlib Axes, optional
        Where to draw R, d, δ and η.

    Returns
    -------
    Figure
        With `.lines`, `.axes`, `.figure` and `.alt`.

    Raises
    ------
    TypeError, ValueError
        If `signal` is neither "y" nor "u", or something is given that is no loop.
    """
    if signal not in ("y", "u"):
        raise ValueError(f"signal is {signal!r}; it must be 'y' or 'u'")
    named = {"nominal": compare} if isinstance(compare, LoopEquations) else compare
    if not isinstance(named, Mapping | None):
        raise TypeError(
            f"compare is a {type(compare).__name__}; give another loop, or loops by label: "
            '{"slower filter": loop}'
        )
    others = dict(named or {})
    for each in (loop, *others.values()):
        if not isinstance(each, LoopEquations):
            raise TypeError(f"a {type(each).__name__} is given where a loop, an NRDOB, is needed")
    row, facts = "yu".index(signal), []
    panels = axes_for(axes, 4, TALL)
    with styled():
        lines = np.empty(4, dtype=object)
        for k, (ax, given) in enumerate(zip(panels, INPUTS, strict=True)):
            times = timepts
            if times is None and others:
                longest = max(step_response(x, given).time[-1] for x in (loop, *others.values()))
                times = np.linspace(0.0, longest, 1001)
            response = step_response(loop, given, times)
            times, values = response.time, response.outputs[row, 0]
            lines[k] = ax.plot(times, values, color=colour_of(given), zorder=3)
            for style, (label, other) in zip(("--", ":", "-."), others.items(), strict=False):
                faint = step_response(other, given, times).outputs[row, 0]
                lines[k] += ax.plot(times, faint, style, color=INK, lw=1.2, label=label, zorder=4)
            name = ("T_" if given == "R" else "S_") + given if signal == "y" else f"U_{given}"
            _step_frame(ax, given, name, signal, bottom=k > 1)
            facts.append(_step_facts(loop, given, getattr(loop, name), values))
        if others:
            panels[0].legend(loc="best", handlelength=2.4)
        if axes is None:
            panels[0].figure.suptitle(title, x=0.01, ha="left", fontsize="medium")
    alt = alttext.steps(signal, title, facts, tuple(others))
    return Figure(lines.reshape(2, 2), np.array(panels, dtype=object).reshape(2, 2), alt)


def _step_facts(
    loop: LoopEquations, given: str, through: Quotient, values: FloatArray
) -> alttext.StepFacts:
    """Peak and rest of one response; the loop's own roots say whether there is rest."""
    excited = (loop.p_A, loop.p_B) if given == "R" else (loop.p_B,)
    rightmost = max(p.roots[0].real if p.roots.size else -inf for p in excited)
    unstable = any(_on_the_right(p) for p in excited)
    final = inf if unstable else nan if rightmost == 0 else through.dc_gain
    peak = float(values[int(np.argmax(np.abs(values)))])
    return alttext.StepFacts(given, peak, final)


def _step_frame(ax: Axes, given: str, name: str, signal: str, *, bottom: bool) -> None:
    # As in eq. (7): an input disturbance is seen where it acts.
    reached = r"u + $\delta$" if (signal, given) == ("u", "delta") else signal
    ax.set_title(f"{label_of(name)}   {INPUTS[given].spoken} {label_of(given)} → {reached}")
    ax.set(xlabel="time (s)" if bottom else "", ylabel=f"{reached} (per unit step)")
    ax.set_xlim(left=0)
    low, high = ax.get_ylim()
    if high - low < 1e-6:
        ax.set_ylim(-0.5, 0.5)
    ax.axhline(0, color=INK, lw=0.6)


# Roots.


def roots_plot(
    roots: LoopEquations | Mapping[str, ComplexArray],
    *,
    title: str = "",
    ax: Axes | None = None,
) -> Figure:
    """Draw the roots of p_A and p_B in the complex plane, the right half of which is forbidden.

    Parameters
    ----------
    roots : LoopEquations or dict of str: array of complex
        A loop, or roots by label, in rad/s, rightmost first.
    title : str
        Heading, which also enters the alt text.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    Figure
        With `.lines`, `.axes`, `.figure` and `.alt`.

    Raises
    ------
    TypeError, ValueError
        If `roots` is neither a loop nor lists of finite roots by label.
    """
    if isinstance(roots, LoopEquations):
        factors = {"p_A": roots.p_A, "p_B": roots.p_B}
        found = {label: p.roots for label, p in factors.items()}
        right = {label: _on_the_right(p) for label, p in factors.items()}
    elif isinstance(roots, Mapping) and roots:
        found = {label: _roots(values, label) for label, values in roots.items()}
        right = {label: float(np.sum(values.real > 0)) for label, values in found.items()}
    else:
        raise TypeError(
            f"roots is {roots!r}; give a loop, or roots by label: {{'p_B': loop.p_B.roots}}"
        )
    (ax,) = axes_for(ax, 1, SHORT)
    with styled():
        lines = []
        palette = (COLOURS["model"], COLOURS["loop"], COLOURS["process"], COLOURS["filter"])
        for k, (label, values) in enumerate(found.items()):
            name = f"${label}$" if label in ("p_A", "p_B") else label
            rightmost = complex_number(values[0]) if values.size else "none"
            lines += ax.plot(
                values.real, values.imag, "x+1o"[k % 4], ms=8 if k % 4 < 3 else 5, mew=1.8,
                color=palette[k % 4], label=f"{name}: rightmost {rightmost}", zorder=4 + k,
            )  # fmt: skip
        _roots_window(ax, list(found.values()))
        columns = min(len(found), 2)
        ax.legend(loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0.2, ncols=columns)
        ax.set(xlabel="Re s (rad/s)", ylabel="Im s (rad/s)")
        headings(ax, title)
    return Figure(np.array([lines], dtype=object), ax, alttext.roots(title, found, right))


def _on_the_right(p: QuasiPolynomial) -> float:
    """Roots in the right half plane; counted where a long dead time has more than are listed."""
    return float(np.sum(p.roots.real > 0)) if p.roots_resolved else count_rhp(p).at_least


def _roots(values: Any, label: str) -> ComplexArray:
    """Check the roots of one label."""
    found = np.asarray(values)
    if found.dtype.kind not in "iufc" or found.ndim != 1 or not np.isfinite(found).all():
        raise ValueError(
            f"roots of {label} are {values!r}; give a list of finite numbers, in rad/s"
        )
    return found


def _roots_window(ax: Axes, groups: Sequence[ComplexArray]) -> None:
    """Show the rightmost roots and their neighbours; say how many lie farther left."""
    values = np.concatenate(groups)
    slow = max((abs(group[0]) for group in groups if group.size and group[0]), default=1.0)
    seen = values[np.abs(values) <= 8 * slow]
    left = 1.15 * min(float(seen.real.min(initial=-0.5)), -0.5 * slow)
    right = max(1.25 * float(seen.real.max(initial=0.0)), -0.2 * left)
    top = 1.35 * max(float(np.abs(seen.imag).max(initial=0.0)), -0.2 * left)
    ax.set(xlim=(left, right), ylim=(-top, top))
    ax.axvspan(0, right, color=COLOURS["critical"], alpha=0.10, lw=0)
    ax.axvline(0, color=INK, lw=0.9)
    ax.axhline(0, color=INK, lw=0.6)
    hidden = values.size - int(np.sum((values.real >= left) & (np.abs(values.imag) <= top)))
    if hidden:
        ax.text(0.01, 0.03, f"{hidden} more outside, down to Re s = {number(values.real.min())}",
                transform=ax.transAxes, fontsize="small")  # fmt: skip
