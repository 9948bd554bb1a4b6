"""Figures in words: the facts that a figure is drawn for, computed, with three digits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf, isfinite, isnan

from ..analysis import Margins
from ..diagram import MAPS
from ..numerics import number, written
from .contour import Approach

__all__ = ["bode", "complex_number", "frequency", "nyquist", "spoken", "steps", "turns"]

_WORDS = ("no", "one", "two", "three", "four", "five", "six")


def spoken(name: str) -> str:
    """Write the name of a map as one says it.

    Parameters
    ----------
    name : str
        Attribute of a loop, as "FH".
    """
    return MAPS[name].spoken if name in MAPS else name or "the loop"


def turns(count: float | None, point: float = -1.0) -> str:
    """Say how often a curve encircles a point of the real axis.

    Parameters
    ----------
    count, point : float or None, float
        N, positive clockwise, None where the curve meets the point.

    Examples
    --------
    >>> turns(-1), turns(0, point=1)
    ('one counter-clockwise encirclement of −1', 'no encirclement of +1')
    """
    place = f"{'+' if point > 0 else ''}{number(point)}"
    if count is None:
        return f"no count of encirclements, the curve meets {place}"
    if count == 0:
        return f"no encirclement of {place}"
    size = abs(count)
    much = "infinitely many" if size == inf else _WORDS[int(size)] if size < 7 else f"{size:g}"
    sense = "clockwise" if count > 0 else "counter-clockwise"
    return f"{much} {sense} encirclement{'s' if size != 1 else ''} of {place}"


def frequency(omega: float) -> str:
    """Name a frequency in rad/s: inf for the limit, nan for all.

    Parameters
    ----------
    omega : float
        In rad/s.
    """
    if isnan(omega):
        return "at every frequency"
    if omega == 0:
        return "at ω = 0"
    return "as ω → ∞" if omega == inf else f"at {number(omega)} rad/s"


def nyquist(
    name: str, title: str, point: float, count: float | None, approach: Approach, left_out: int = 0
) -> str:
    """Describe a Nyquist plot, with the number of like turns that are not drawn one by one."""
    closest = f"closest approach {number(approach.distance)} {frequency(approach.omega)}"
    text = f"{_opening('Nyquist plot', [name], title)}: {turns(count, point)}, {closest}"
    if left_out:
        text += (
            f"; {left_out} turns of the dead time, each within the line of another, are left out"
        )
    return text


def bode(
    title: str, curves: Mapping[str, Sequence[tuple[float, float, float]]], margins: Margins | None
) -> str:
    """Describe Bode diagrams: the margins if given, else where each curve starts and ends.

    Each end is a frequency in rad/s, decibels and degrees.
    """
    opening = _opening("Bode diagrams", curves, title)
    if margins:
        return f"{opening}: {_margins(margins)}"
    ways = (
        f"{spoken(name)} from " + " to ".join(_bode_point(*end) for end in ends)
        for name, ends in curves.items()
    )
    return f"{opening}: {'; '.join(ways)}"


def steps(
    signal: str, title: str, facts: Iterable[tuple[str, float, float]], compared: Iterable[str] = ()
) -> str:
    """Describe step responses: input, signed peak and final value.

    The latter is inf if a response grows without bound, nan if it does not come to rest.
    """
    said = "; ".join(
        f"to {given} " + ("grows without bound" if final == inf else f"peak {number(peak)}, "
        + ("no final value" if isnan(final) else f"final value {number(final)}"))
        for given, peak, final in facts
    )  # fmt: skip
    beside = f", beside {_listed(compared)}" if compared else ""
    return f"{_opening('Step responses', [signal], title)}{beside}: {said}"


def complex_number(value: complex) -> str:
    """Write a complex number, a conjugate pair as one of the two.

    Parameters
    ----------
    value : complex
        The number.
    """
    real, imag = (
        0.0 if abs(part) <= 1e-9 * abs(value) else part for part in (value.real, value.imag)
    )
    return written(complex(real, imag), number, pair=True)


def _bode_point(omega: float, decibels: float, degrees: float) -> str:
    value = "zero" if isnan(decibels) else f"{number(decibels)} dB and {number(degrees)}°"
    return f"{value} {frequency(omega)}"


def _opening(kind: str, names: Iterable[str], title: str) -> str:
    return f"{kind} of {_listed(map(spoken, names))}" + (f", {title}" if title else "")


def _listed(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def _margins(m: Margins) -> str:
    if not m.stable:
        return "no margins, the closed loop is not known to be stable"
    kinds = ("gain", m.gm_db, " dB", m.wpc), ("phase", m.pm, "°", m.wgc)
    return ", ".join(
        f"{kind} margin {number(size)}{unit} {frequency(omega)}" if isfinite(size)
        else f"infinite {kind} margin"
        for kind, size, unit, omega in kinds
    )  # fmt: skip
