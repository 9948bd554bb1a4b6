"""Figures in words: the facts that a figure is drawn for, computed, with three digits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, isnan
from typing import NamedTuple

from ..analysis import Margins
from ..diagram import MAPS
from ..numerics import number, written
from .contour import Approach

__all__ = [
    "BodePoint",
    "StepFacts",
    "bode",
    "complex_number",
    "frequency",
    "nyquist",
    "spoken",
    "steps",
    "turns",
]

_WORDS = ("no", "one", "two", "three", "four", "five", "six")


class BodePoint(NamedTuple):
    """One point of a Bode diagram."""

    omega: float
    decibels: float
    degrees: float


@dataclass(frozen=True)
class StepFacts:
    """One step response: its signed peak, and its final value.

    The latter is inf if the response grows without bound, nan if it does not come to rest.
    """

    input: str
    peak: float
    final: float


def spoken(name: str) -> str:
    """Write the name of a map as one says it.

    Parameters
    ----------
    name : str
        Attribute of a loop, as "FH".
    """
    return MAPS[name].spoken if name in MAPS else name or "the loop"


def turns(count: float | None, point: float = -1.0) -> str:
    """Say how often a curve encircles a point, `count` positive clockwise.

    Parameters
    ----------
    count : float or None
        N; None where the curve meets the point.
    point : float
        Point of the real axis.

    Examples
    --------
    >>> turns(-1)
    'one counter-clockwise encirclement of −1'
    >>> turns(0, point=1)
    'no encirclement of +1'
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
    name: str,
    title: str,
    point: float,
    count: float | None,
    approach: Approach,
    left_out: int = 0,
) -> str:
    """Describe a Nyquist plot, with the number of like turns that are not drawn one by one."""
    closest = f"closest approach {number(approach.distance)} {frequency(approach.omega)}"
    like = f"; {left_out} turns of the dead time, each within the line of another, are left out"
    return (
        f"{_opening('Nyquist plot', [name], title)}: {turns(count, point)}, {closest}"
        f"{like if left_out else ''}"
    )


def bode(title: str, curves: Mapping[str, Sequence[BodePoint]], margins: Margins | None) -> str:
    """Describe Bode diagrams: the margins if given, else where each curve starts and ends."""
    opening = _opening("Bode diagrams", curves, title)
    if margins:
        return f"{opening}: {_margins(margins)}"
    ways = (
        f"{spoken(name)} from " + " to ".join(map(_bode_point, ends))
        for name, ends in curves.items()
    )
    return f"{opening}: {'; '.join(ways)}"


def steps(signal: str, title: str, facts: Iterable[StepFacts], compared: Iterable[str] = ()) -> str:
    """Describe step responses."""
    said = "; ".join(
        f"to {f.input} " + ("grows without bound" if f.final == inf else f"peak {number(f.peak)}, "
        + ("no final value" if isnan(f.final) else f"final value {number(f.final)}"))
        for f in facts
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


def _bode_point(point: BodePoint) -> str:
    where = frequency(point.omega)
    if isnan(point.decibels):
        return f"zero {where}"
    return f"{number(point.decibels)} dB and {number(point.degrees)}° {where}"


def _opening(kind: str, names: Iterable[str], title: str) -> str:
    return f"{kind} of {_listed(map(spoken, names))}" + (f", {title}" if title else "")


def _listed(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def _margins(m: Margins) -> str:
    if not m.stable:
        return "no margins, the closed loop is not known to be stable"
    gain = f"gain margin {number(m.gm_db)} dB {frequency(m.wpc)}" if isfinite(m.gm_db) else (
        "infinite gain margin"
    )  # fmt: skip
    phase = f"phase margin {number(m.pm)}° {frequency(m.wgc)}" if isfinite(m.pm) else (
        "infinite phase margin"
    )  # fmt: skip
    return f"{gain}, {phase}"
