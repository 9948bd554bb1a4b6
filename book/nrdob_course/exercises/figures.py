"""The figures of the cases; the alt text of each says what the eye would see."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from nrdob.analysis import resolved_frequencies
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray, FloatArray, number, written
from nrdob.plotting import COLOURS, INK, SHORT, TALL, Figure, axes_for, colour_of, styled

from .drawing import few

__all__ = ["Peaks", "draw_crossing", "draw_gains", "draw_peaks", "draw_without_count"]


def draw_gains(omega: FloatArray, gains: Mapping[str, FloatArray], alt: str, **how: Any) -> Figure:
    """Draw gains over the frequency in rad/s, both on log scales; a filter's is dashed."""
    with styled():
        (ax,) = axes_for(None, 1, SHORT)
        lines = []
        for name, size in gains.items():
            label = {"S_eta": r"$|S_\eta|$"}.get(name, f"$|{name}|$")
            style = "--" if name == "F" else "-"
            lines += ax.loglog(omega, size, style, color=colour_of(name), label=label)
        ax.axhline(1, color=INK, lw=0.8, ls=":")
        ax.grid(True, which="minor", alpha=0.15)
        ax.set(xlabel="frequency (rad/s)", **({"ylabel": "gain"} | how))
        if len(gains) > 1:
            ax.legend(loc="center left")
    return Figure(lines, ax, alt=alt)


class Peaks(NamedTuple):
    """A curve of Ms: its name, what stands at the edge of stability, and its looks."""

    label: str
    x: FloatArray
    ms: list[float]
    edge: float
    role: str
    style: str


def draw_peaks(curves: Sequence[Peaks], limit: float, top: float, xlabel: str, alt: str) -> Figure:
    """Draw curves of Ms, a dotted line at each edge of stability, and the limit as a red line."""
    with styled():
        (ax,) = axes_for(None, 1, TALL)
        for label, x, ms, edge, role, style in curves:
            colour = COLOURS[role]
            lines = ax.plot(x, ms, style, color=colour, label=label)
            ax.axvline(edge, color=colour, ls=":", lw=1.5)
            looks: dict[str, Any] = {"color": colour, "rotation": 90, "ha": "right", "va": "top"}
            ax.text(edge, 0.98 * top, f"{label} unstable ", **looks)
        ax.axhline(limit, color=COLOURS["critical"], lw=1)
        ax.minorticks_on()
        ax.grid(True, which="minor", color=INK, alpha=0.12, lw=0.5)
        ax.set(xlabel=xlabel, ylabel="$M_s$", ylim=(1, top))
        ax.set_xlim(0, 1.04 * max(curve.edge for curve in curves))
        ax.legend(loc="upper left")
    return Figure(lines, ax, alt=alt)


def draw_without_count(loop: NRDOB) -> Figure:
    """Draw the Nyquist plot of FH as the book does, but let the reader count.

    The alt text says where the plot crosses the real axis, which is what the eye would see.

    Parameters
    ----------
    loop : NRDOB
        The loop of a case.
    """
    figure = loop.plot_nyquist("FH")
    for ax in np.ravel(figure.axes):
        ax.set_title("", loc="right")
    return Figure(figure.lines, figure.axes, alt=f"Nyquist plot of F·H: {_crossings(loop)}")


def _crossings(loop: NRDOB) -> str:
    omega = resolved_frequencies(loop.FH)
    values = loop.FH(1j * omega)
    found = [f"it starts at {number(loop.FH.dc_gain)} for zero frequency"]
    for k in np.flatnonzero(np.diff(np.sign(values.imag))):
        weight = values.imag[k] / (values.imag[k] - values.imag[k + 1])
        real = float(values.real[k] + weight * (values.real[k + 1] - values.real[k]))
        way = "upwards" if values.imag[k + 1] > 0 else "downwards"
        if abs(real) > 0.01:
            found.append(f"crosses the real axis at {number(real)} {way}")
    found[0] += f" and leaves {'up' if values.imag[0] > 0 else 'down'}wards"
    last = "and ends at 0; the half for negative frequencies is its mirror image"
    return ", ".join([*found, last])


def draw_crossing(loop: NRDOB, value: float, omega: float) -> Figure:
    """Draw H, marked at round frequencies, and the curve of order 2, marked at round x.

    They cross at `omega`, in rad/s, where the time constant is `value`.
    """

    def H(w: Any) -> Any:
        return loop.H(1j * np.asarray(w))

    step = few(0.15 * omega, 1)
    frequencies = step * np.arange(np.ceil(0.5 * omega / step), 1 + 1.5 * omega // step)
    x = 0.2 * np.arange(1, 1 + 1.4 * value * omega // 0.2)
    seen = np.concatenate([H(frequencies), _gamma(x), [-1, 0]])
    low = complex(seen.real.min(), seen.imag.min())
    size = complex(seen.real.max(), seen.imag.max()) - low
    centre, half = low + size / 2, 0.62 * max(size.real / 1.7, size.imag)
    along_H, along_curve = H(omega * np.geomspace(1e-3, 1e3, 6001)), _gamma(np.linspace(0, 9, 3001))
    (ax,) = axes_for(None, 1, TALL)
    with styled():
        across, up = np.array([-1.7, 1.7]) * half, np.array([-1, 1]) * half
        ax.set(xlim=centre.real + across, ylim=centre.imag + up, aspect="equal")
        ax.set(xlabel="real part", ylabel="imaginary part")
        label = r"$H$, marked at $\omega$ in rad/s"
        lines = ax.plot(along_H.real, along_H.imag, color=COLOURS["process"], label=label)
        label = r"$-\Gamma_2$, marked at $x$"
        ax.plot(along_curve.real, along_curve.imag, color=COLOURS["filter"], label=label)
        point = half / 125  # of type, about
        labels = _marks(ax, H, frequencies, "process", along_curve, point)
        _marks(ax, _gamma, x, "filter", np.concatenate([along_H, labels]), point)
        ax.plot(-1, 0, "+", color=COLOURS["critical"], ms=9, mew=2.2, zorder=6)
        ax.axhline(0, color=INK, lw=0.6)
        ax.axvline(0, color=INK, lw=0.6)
        ax.legend(loc="best")
    places = ", ".join(f"{number(w)} rad/s at {written(H(w), _two_digits)}" for w in frequencies)
    points = ", ".join(f"{number(v, 2)} at {written(_gamma(v), _two_digits)}" for v in x)
    return Figure(lines, ax, alt=f"H passes ω = {places}. −Γ₂ passes x = {points}")


_two_digits = partial(number, digits=2)


def _gamma(x: Any) -> Any:
    return -((1 + 1j * np.asarray(x)) ** 2)


def _marks(
    ax: Any, curve: Any, values: FloatArray, role: str, others: ComplexArray, point: float
) -> ComplexArray:
    """Mark points of a curve, with their values on the roomier side; return where those stand."""
    places = []
    for value in values:
        here, ahead = complex(curve(value)), complex(curve(1.001 * value))
        sides = [turn * 10 * (ahead - here) / abs(ahead - here) for turn in (1j, -1j)]
        room = [float(np.abs(others - here - point * side).min()) for side in sides]
        ax.plot(here.real, here.imag, ".", color=COLOURS[role], ms=7)
        if max(room) < 8 * point:
            continue
        side = sides[int(np.argmax(room))]
        places.append(here + point * side)
        offset = {"xytext": (1.2 * side.real, side.imag), "textcoords": "offset points"}
        looks = {"color": COLOURS[role], "fontsize": 8.5, "ha": "center", "va": "center"}
        ax.annotate(number(value, 2), (here.real, here.imag), **offset, **looks)
    return np.array(places, dtype=complex)
