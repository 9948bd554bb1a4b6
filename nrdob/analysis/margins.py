r"""Lemma 2 and the true loop: gain, phase, modulus, disk and delay margins of C·G̃, F·H and L = K·G.

Where L has size 1, is real, or is nearest to -1, is bracketed on frequencies between which log L is
nearly straight over log ω (`nrdob.analysis.frequencies`), and refined to the last digits on the
factors of L (`nrdob.analysis.locus`). Dead times stay exact. The points ω = 0 and ω = ∞ are looked
at too: a loop may become unstable there as well as in between.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from math import acos, asin, degrees, inf, isfinite, log10, nan, pi
from typing import Any, NamedTuple

import numpy as np

from ..diagram import LoopEquations, Quotient, real_number
from ..numerics import ROUNDING, ComplexArray, FloatArray
from .frequencies import gentle_frequencies, with_turns
from .locus import Found, Locus, Notable, notable_frequencies
from .nyquist import closed_around
from .stability import Stability, judge, stability

__all__ = [
    "Ends", "LoopMargins", "MarginBounds", "Margins", "loop_margins", "margin_bounds", "margins",
    "margins_at", "quotient_margins",
]  # fmt: skip


TINY = 1e-200  # size of L below which it is 0
HEADING = f"       GM (dB)  {'gains':16}  PM (°)       Ms   delay margin (s)"
LARGE = 2.0**27  # radius of the circle that stands for a straight line


@dataclass(frozen=True)
class Margins:
    r"""Margins of one loop; ``gm, pm, sm, wpc, wgc, wms = margins`` as `control.stability_margins`.

    All margins are nan unless the closed loop is known to be stable: an unstable loop has none. At
    which gains and rotations the number of its unstable roots changes is still listed.

    Attributes
    ----------
    gm : float
        Gain factor nearest to 1 (on a log scale) at which the loop becomes unstable; below 1 where
        the gain must not fall, inf if there is none.
    pm : float
        Smallest rotation of L, in either sense, at which the loop becomes unstable, in degrees.
    sm : float
        Modulus margin :math:`\min |1 + L|`, the distance from -1.
    wpc, wgc, wms : float
        Frequencies of gm, pm and sm in rad/s; nan where there is none.
    gm_low, gm_high : float
        The loop stays stable for every gain factor strictly between them, but at those at which
        roots only touch the axis.
    disk_margin : float
        Symmetric disk margin :math:`\alpha = \min 2|1 + L|/|1 - L|`: the loop stays stable
        with every complex factor in the disk on the diameter from (2 - α)/(2 + α) to its inverse.
    stable : bool or None
        The verdict on the closed loop.
    gain_crossovers, phase_crossovers : array of float
        All frequencies with :math:`|L| = 1`, and all with L real and negative (0 and inf
        included), rad/s. Where dead time turns a loop gain for ever, those are left out at which
        it is small against 1 and against its largest value.
    rotations, critical_gains : array of float
        By how many degrees, from -180 to 180, a rotation of L brings it to -1 at each of the
        `gain_crossovers`, and which factor of the gain does at each of the `phase_crossovers`.
    name : str
    late : callable
        Finds the delay margin, once it is asked for: of a sampled loop that takes longest.
    """

    gm: float
    pm: float
    sm: float
    wpc: float
    wgc: float
    wms: float
    gm_low: float
    gm_high: float
    disk_margin: float
    stable: bool | None
    name: str
    gain_crossovers: FloatArray = field(repr=False)
    phase_crossovers: FloatArray = field(repr=False)
    rotations: FloatArray = field(repr=False)
    critical_gains: FloatArray = field(repr=False)
    late: Callable[[], float] = field(repr=False, compare=False)

    def __iter__(self) -> Iterator[float]:
        return iter((self.gm, self.pm, self.sm, self.wpc, self.wgc, self.wms))

    @cached_property
    def delay_margin(self) -> float:
        """Smallest extra dead time at which the loop becomes unstable, in seconds."""
        return self.late() if self.stable else nan

    @property
    def gm_db(self) -> float:
        """Gain margin in dB, negative where the gain must not fall."""
        return 20 * log10(self.gm) if 0 < self.gm < inf else self.gm

    @property
    def ms(self) -> float:
        r"""Peak of the sensitivity :math:`|1/(1 + L)|`, the inverse of the modulus margin."""
        return 1 / self.sm if self.sm else inf

    def __str__(self) -> str:
        return f"{HEADING}\n{self.row}" if self.stable else self.row

    @property
    def row(self) -> str:
        """The numbers in a line, without a heading."""
        if not self.stable:
            verdict = "NOT stable" if self.stable is False else "not decided"
            return f"{self.name:4} {verdict}: no margins{self._crossings}"
        gains = f"{self.gm_low:.4g} to {self.gm_high:.4g}"
        return (
            f"{self.name:4} {self.gm_db:9.3f}  {gains:16} {self.pm:7.2f} {self.ms:8.4f}"
            f" {self.delay_margin:13.4g}"
        )

    @property
    def _crossings(self) -> str:
        """Where the number of unstable roots changes next."""
        gains, angles = self.critical_gains, self.rotations
        said = []
        if gains.size:
            said.append(f"gain × {gains[np.argmin(np.abs(np.log(gains)))]:.4g}")
        if angles.size:
            said.append(f"rotation {angles[np.argmin(np.abs(angles))]:.2f}°")
        return f"; roots on the axis at {', '.join(said)}" if said else ""


@dataclass(frozen=True, repr=False)
class LoopMargins:
    """Margins of the three loops, with the verdict on the whole.

    Attributes
    ----------
    model_loop, observer_loop : Margins
        C·G̃ and F·H, conditions i and ii of Lemma 2; L in place of F·H where a pole on the axis or
        right of it cancels inside (1 - F)·G̃, so that F·H passes through -1 whatever the process.
    plant_loop : Margins
        L = K·G, whose margins are those that the plant feels.
    stable : bool or None
        The verdict of Lemma 1.
    """

    model_loop: Margins
    observer_loop: Margins
    plant_loop: Margins
    stable: bool | None

    def __repr__(self) -> str:
        every = self.model_loop, self.observer_loop, self.plant_loop
        return "\n".join([HEADING, *{each.name: each.row for each in every}.values()])


class MarginBounds(NamedTuple):
    """Margins that a loop has at least, whatever else it is.

    Attributes
    ----------
    gm_low, gm_high : float
        The loop stays stable for every gain factor strictly between them.
    pm : float
        It stays stable under every rotation smaller than this, in degrees.
    """

    gm_low: float
    gm_high: float
    pm: float


def margin_bounds(ms: float) -> MarginBounds:
    r"""Gain and phase margin that a peak of the sensitivity guarantees.

    L keeps the distance :math:`1/M_s` from -1: it may be multiplied by any gain between
    :math:`M_s/(M_s + 1)` and :math:`M_s/(M_s - 1)`, or rotated by less than
    :math:`2\arcsin(1/(2 M_s))`, which is the angle over a chord of that length.

    Parameters
    ----------
    ms : float
        :math:`M_s = \max|1/(1 + L)|` of a stable loop, above 1.

    Returns
    -------
    MarginBounds
        `gm_low`, `gm_high` and `pm`, in degrees.

    Raises
    ------
    TypeError, ValueError
        If `ms` is not a finite number above 1.

    Examples
    --------
    >>> low, high, pm = margin_bounds(2.0)
    >>> round(low, 4), high, round(pm, 2)
    (0.6667, 2.0, 28.96)
    """
    remedy = (
        "give the sensitivity's peak as a number, finite and above 1: one of 1 or less bounds no "
        "gain from above (the sensitivity of a loop that falls off is never below 1)"
    )
    ms = real_number(ms, "ms", remedy, above=1.0)
    return MarginBounds(ms / (ms + 1), ms / (ms - 1), degrees(2 * asin(1 / (2 * ms))))


def loop_margins(loop: LoopEquations, verdict: Stability | None = None) -> LoopMargins:
    """Compute the margins of C·G̃, F·H and L.

    Parameters
    ----------
    loop : LoopEquations
    verdict : Stability, optional
        If already known.
    """
    verdict = stability(loop) if verdict is None else verdict
    model, observer = verdict.model_loop.stable, verdict.observer_loop.stable
    loops = {loop.CGm: model, loop.condition_ii: observer, loop.L: observer}
    found = dict(zip(loops, _margins_of(*loops.items()), strict=True))
    return LoopMargins(found[loop.CGm], found[loop.condition_ii], found[loop.L], verdict.stable)


def margins(loop: Any) -> Margins:
    r"""Judge the loop closed around any loop gain, and compute its margins, with exact dead time.

    What cancels inside the loop gain before it is given cannot be seen: a pole and a zero that are
    both there count.

    Parameters
    ----------
    loop : control.TransferFunction, StateSpace, (num, den), number, scipy.signal.lti or Quotient
        The loop gain L, proper or not, closed by negative feedback; with dead time as a product
        with `nrdob.delay`, or a map such as ``loop.FH``.

    Returns
    -------
    Margins
        With the verdict, ``.stable``, and the numbers, which are nan for an unstable loop.

    Raises
    ------
    TypeError, ValueError
        If `loop` is no single-input single-output block in continuous time.

    Examples
    --------
    >>> import control as ct
    >>> import nrdob
    >>> found = margins(nrdob.delay(0.5) * ct.tf([1], [1, 0]))
    >>> round(found.gm, 4), round(found.pm, 4)                  # π, and 90° - 0.5 rad
    (3.1416, 61.3521)
    >>> print(margins(ct.tf([4], [1, 2, 1, 0])))
    L    NOT stable: no margins; roots on the axis at gain × 0.5, rotation 18.10°
    """
    L, closed, well_posed = closed_around(loop)
    verdict = judge(L.name, L.den, closed, "" if well_posed else "1 + L(∞) = 0")
    return quotient_margins(L, verdict.stable)


def quotient_margins(loop: Quotient, stable: bool | None) -> Margins:
    """Compute the margins of a loop gain L whose verdict is known.

    Parameters
    ----------
    loop : Quotient
    stable : bool or None
        On 1 + L, None where it is not known.
    """
    return _margins_of((loop, stable))[0]


def _margins_of(*loops: tuple[Quotient, bool | None]) -> list[Margins]:
    """Compute the margins of several loops that share factors."""
    gains = [loop for loop, _ in loops]
    locus, omega = Locus(*gains), gentle_frequencies(*gains)
    last = np.full(len(gains), inf)
    if any(loop.delay for loop in gains):
        omega, last = with_turns(locus, omega, *gains)
    found = notable_frequencies(locus, omega, last)
    return [
        margins_at(each, Ends(loop.dc_gain, *_circle_at_infinity(loop)), stable, loop.name)
        for each, (loop, stable) in zip(found, loops, strict=True)
    ]


class Ends(NamedTuple):
    """What a loop gain is at its ends: L(0), and a + b exp(-jωθ), the circle that it tends to.

    Attributes
    ----------
    dc_gain, undelayed, delayed : float
        L(0), infinite with an integrator, a and b.
    last : float
        Where the circle is: at infinity, or at a sampled loop's Nyquist frequency, in rad/s.
    """

    dc_gain: float
    undelayed: float
    delayed: float = 0.0
    last: float = inf

    @property
    def angles(self) -> tuple[float, float]:
        """Rotations that bring L(0), and a point of the circle, to -1; inf if not of size 1."""
        at_zero = inf
        if abs(abs(self.dc_gain) - 1) <= ROUNDING:
            at_zero = 0.0 if self.dc_gain < 0 else pi
        a, b = self.undelayed, self.delayed
        if a == 0 or not isfinite(a):
            return at_zero, inf
        cosine = (1 + a * a - b * b) / (2 * a)
        if abs(cosine) > 1 + ROUNDING:
            return at_zero, inf
        return at_zero, pi - acos(max(-1.0, min(1.0, cosine)))


def margins_at(found: Notable, ends: Ends, stable: bool | None, name: str) -> Margins:
    """Read the margins off a loop gain where something happens to it.

    Parameters
    ----------
    found : Notable
    ends : Ends
    stable, name : bool or None, str
        Of the loop, as for `quotient_margins`.
    """
    gains, phase = _critical_gains(found.phase, ends)
    omega, angle = found.gain.omega, np.angle(-found.gain.L)
    listed = omega, phase, -np.degrees(angle), gains, partial(_delay_margin, omega, angle, ends)
    if not stable:
        unknown = (nan, nan, nan, nan, nan, nan, nan, nan, nan)
        return Margins(*unknown, stable, name, *listed)
    gm_low = float(gains[gains < 1].max(initial=0.0))
    gm_high = float(gains[gains > 1].min(initial=inf))
    gm = gm_low if gm_low * gm_high > 1 else gm_high
    wpc = float(phase[gains == gm][0]) if 0 < gm < inf else nan
    pm, wgc = _rotations(omega, angle, ends)
    sm, wms = _closest(found.nearest, ends)
    disk = _disk_margin(found.disk, ends)
    return Margins(gm, pm, sm, wpc, wgc, wms, gm_low, gm_high, disk, True, name, *listed)


def _circle_at_infinity(loop: Quotient) -> tuple[float, float]:
    """Return the a and b of the circle a + b exp(-jωθ) that L(jω) tends to.

    With a denominator 1 + c exp(-jωθm) that a model with a direct term leaves it is the image of
    one, for c = ±1 a straight line; where two different dead times turn, the circle around 0 that
    holds all L comes near to.
    """
    a, b = loop.at_infinity
    if not loop.delay:
        return a, b
    num, den = loop.numerator, loop.denominator
    c = [(float(p[0] / den.q[0]), delay) for p, delay in den.delayed if p.size == den.q.size]
    if not c or not isfinite(a + b):
        return a, b
    ratio, delay = c[0]
    size = den.neutral_ratio
    one_turn = not b or (not a and num.delayed == num.delayed[:1] and num.delay == delay)
    one_turn = one_turn and size == abs(ratio)
    if size >= 1 and not one_turn:
        return a, b
    shrink = 1 - size**2
    if one_turn and abs(shrink) * LARGE < 1:
        return (b * ratio if b else a) / 2 + LARGE, LARGE
    if not b:
        return a / shrink, abs(a) * size / abs(shrink)
    if one_turn:
        return -b * ratio / shrink, abs(b) / abs(shrink)
    return a / shrink, abs(a) * size / shrink + abs(b) / (1 - size)


def _critical_gains(phase: Found, ends: Ends) -> tuple[FloatArray, FloatArray]:
    """Gain factors k > 0 with k·L(jω) = -1, and where, ω = 0 and ω = ∞ included."""
    size = abs(ends.delayed)
    last = {ends.undelayed - size, ends.undelayed + size}
    values = np.array([ends.dc_gain, *phase.L.real.tolist(), *last])
    omega = np.array([0.0, *phase.omega.tolist(), *(ends.last for _ in last)])
    negative = (values > -inf) & (values < -TINY)
    return -1 / values[negative], omega[negative]


def _delay_margin(omega: FloatArray, angle: FloatArray, ends: Ends) -> float:
    """Dead time that turns L to -1 at a gain crossover, or at once where it does not fall off."""
    endless = ends.last == inf and abs(ends.undelayed) + abs(ends.delayed) >= 1
    return float((np.mod(angle, 2 * pi) / omega).min(initial=0.0 if endless else inf))


def _rotations(omega: FloatArray, angle: FloatArray, ends: Ends) -> tuple[float, float]:
    """Phase margin in degrees, and its frequency."""
    angles = [*np.abs(angle).tolist(), *ends.angles]
    smallest = min(angles)
    if smallest == inf:
        return inf, nan
    at = [*omega.tolist(), 0.0, ends.last][angles.index(smallest)]
    return degrees(smallest), at


def _closest(nearest: Found, ends: Ends) -> tuple[float, float]:
    """Smallest |1 + L| and where."""
    limits = [abs(1 + ends.dc_gain), abs(abs(1 + ends.undelayed) - abs(ends.delayed))]
    distance = np.concatenate([np.abs(1 + nearest.L), limits])
    distance[np.isnan(distance)] = inf
    k = int(distance.argmin())
    return float(distance[k]), float([*nearest.omega, 0.0, ends.last][k])


def _disk_margin(disk: Found, ends: Ends) -> float:
    """Smallest 2 |(1 + L)/(1 - L)|; of the circle at infinite frequency its ends on the axis."""
    size = abs(ends.delayed)
    real = ends.dc_gain, ends.undelayed - size, ends.undelayed + size
    finite = [value if isfinite(value) else -1e300 for value in real]
    values: ComplexArray = np.array([*disk.L.tolist(), *finite])
    with np.errstate(divide="ignore"):
        return float(2 * (np.abs(1 + values) / np.abs(1 - values)).min())
