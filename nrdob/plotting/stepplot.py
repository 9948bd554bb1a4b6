"""Responses of the loop to unit steps, one panel for each input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, nan
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..analysis import step_response
from ..diagram import INPUTS, LoopEquations, Quotient
from ..numerics import count_rhp
from . import alttext
from .figure import INK, TALL, Figure, axes_for, colour_of, in_lines, label_of, styled

__all__ = ["step_plot"]

STYLES = ("--", ":", "-.")  # of the loops that are compared


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
    signal, compare, timepts, title, axes : optional
        As for `nrdob.NRDOB.plot_step`; another loop without a label is called "nominal".

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
    if len(others) > len(STYLES):
        raise ValueError(
            f"compare holds {len(others)} loops; more than {len(STYLES)} lines beside one cannot "
            "be told apart: draw them in several figures"
        )
    row, facts = "yu".index(signal), []
    panels = axes_for(axes, 4, 1.1 * TALL)
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
            for style, (label, other) in zip(STYLES, others.items(), strict=False):
                faint = step_response(other, given, times).outputs[row, 0]
                lines[k] += ax.plot(times, faint, style, color=INK, lw=1.2, label=label, zorder=4)
            name = INPUTS[given].to_y if signal == "y" else f"U_{given}"
            _step_frame(ax, given, name, signal, bottom=k > 1)
            peak = float(values[int(np.argmax(np.abs(values)))])
            facts.append((given, peak, _final(loop, given, getattr(loop, name))))
        if others:
            panels[0].legend(loc="best", handlelength=2.4)
        if axes is None:
            whole = panels[0].figure.figure
            above = in_lines(whole, title, 0.98 * whole.bbox.width)
            whole.suptitle(above, x=0.01, ha="left", fontsize="medium")
    alt = alttext.steps(signal, title, facts, tuple(others))
    return Figure(lines.reshape(2, 2), np.array(panels, dtype=object).reshape(2, 2), alt)


def _final(loop: LoopEquations, given: str, through: Quotient) -> float:
    """Give the final value, by the loop's roots: inf if a response grows, nan without rest."""
    excited = (loop.p_A, loop.p_B) if given == "R" else (loop.p_B,)
    # Where a long dead time has more roots than are listed, they are counted.
    if any(
        (p.roots.real > 0).any() if p.roots_resolved else count_rhp(p).at_least for p in excited
    ):
        return inf
    rightmost = max(p.roots[0].real if p.roots.size else -inf for p in excited)
    return nan if rightmost == 0 else through.dc_gain


def _step_frame(ax: Axes, given: str, name: str, signal: str, *, bottom: bool) -> None:
    # As in eq. (7): an input disturbance is seen where it acts.
    reached = r"u + $\delta$" if (signal, given) == ("u", "delta") else signal
    ax.set_title(f"{label_of(name)}   {label_of(given)} → {reached}\n{INPUTS[given].spoken}")
    ax.set(xlabel="time (s)" if bottom else "", ylabel=f"{reached} (per unit step)")
    ax.set_xlim(left=0)
    low, high = ax.get_ylim()
    if high - low < 1e-6:
        ax.set_ylim(-0.5, 0.5)
    ax.axhline(0, color=INK, lw=0.6)
