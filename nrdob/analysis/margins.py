r"""Lemma 2 and the true loop: gain, phase, modulus and delay margins of C·G̃, F·H and L = K·G.

Frequencies are exact: without delay the crossings and the extremes of :math:`|1+L|` are roots of
polynomials in :math:`\omega^2`. With delay they are bracketed on frequencies between which the loop
provably turns by less than half a revolution (`nrdob.analysis.locus`); and so they are where time
scales are far apart or modes hardly damped, because polynomials in :math:`\omega^2` would lose what
lies close together. The points ω = 0 and ω = ∞ are looked at too: a loop may be lost there as well
as in between.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import acos, asin, degrees, inf, isfinite, log10, nan, pi
from numbers import Real
from typing import NamedTuple

import numpy as np

from ..diagram import LoopEquations, Quotient
from ..numerics import (
    ROUNDING,
    ComplexArray,
    FloatArray,
    QuasiPolynomial,
    add,
    companion_roots,
    differentiate,
    multiply,
)
from .frequencies import on_axis, resolved_frequencies
from .locus import Locus, Notable, notable_frequencies
from .nyquist import minus_point
from .stability import Stability, stability

__all__ = [
    "Ends",
    "LoopMargins",
    "MarginBounds",
    "Margins",
    "loop_margins",
    "margin_bounds",
    "margins",
    "margins_at",
]

MAX_SPREAD = 1e4
"""Ratio of the fastest to the slowest root up to which polynomials in ω² are trusted."""

LITTLE_DAMPING = 0.01
"""Damping ratio of roots below which polynomials in ω² are not trusted."""

TINY = 1e-60
"""Coefficients below it, or above its inverse, are in units in which products may overflow."""

CONFIRMED = 1e-6
"""How well the factors must confirm a crossing that the polynomials in ω² give."""

AT_POLE = 1e-9
"""A crossing so close to a pole on the axis, as a fraction, is the pole."""

PER_SEGMENT = 4
"""Frequencies in each certified stretch, where derivatives tell what lies between them."""


@dataclass(frozen=True)
class Margins:
    r"""Margins of one loop, which unpack as `control.stability_margins` does.

    ``gm, pm, sm, wpc, wgc, wms = margins``. All numbers are nan unless the closed loop is known to
    be stable: an unstable loop has no margins; its crossings are still listed.

    Attributes
    ----------
    gm : float
        Gain factor nearest to 1 (on a log scale) at which the loop is lost; below 1 where the gain
        must not fall. Absolute; inf if there is none.
    pm : float
        Smallest rotation of the loop gain, in either sense, at which the loop is lost, degrees.
    sm : float
        Modulus margin :math:`\min |1 + L|`, the distance from -1.
    wpc, wgc, wms : float
        Frequencies of gm, pm and sm in rad/s; nan where there is none.
    gm_low, gm_high : float
        The loop stays stable for every gain factor strictly between them.
    delay_margin : float
        Smallest extra dead time at which the loop is lost, in seconds.
    stable : bool or None
        The verdict on the closed loop, without which the numbers mean nothing.
    gain_crossovers, phase_crossovers : array of float
        All frequencies with :math:`|L| = 1`, and all with L real and negative (0 and inf
        included), rad/s.
    name : str
        Which loop.
    """

    gm: float
    pm: float
    sm: float
    wpc: float
    wgc: float
    wms: float
    gm_low: float
    gm_high: float
    delay_margin: float
    stable: bool | None
    name: str
    gain_crossovers: FloatArray = field(repr=False)
    phase_crossovers: FloatArray = field(repr=False)

    def __iter__(self) -> Iterator[float]:
        return iter((self.gm, self.pm, self.sm, self.wpc, self.wgc, self.wms))

    @property
    def gm_db(self) -> float:
        """Gain margin in dB, negative where the gain must not fall."""
        return 20 * log10(self.gm) if 0 < self.gm < inf else self.gm

    @property
    def ms(self) -> float:
        r"""Peak of the sensitivity :math:`|1/(1 + L)|`, the inverse of the modulus margin."""
        return 1 / self.sm if self.sm else inf

    def __str__(self) -> str:
        if not self.stable:
            verdict = "NOT stable" if self.stable is False else "not decided"
            return f"{self.name:4} {verdict}: no margins"
        gains = f"{self.gm_low:.4g} to {self.gm_high:.4g}"
        return (
            f"{self.name:4} {self.gm_db:9.3f}  {gains:16} {self.pm:7.2f} {self.ms:8.4f}"
            f" {self.delay_margin:13.4g}"
        )


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
        Verdict of Lemma 1 on the whole NR-DOB loop.
    """

    model_loop: Margins
    observer_loop: Margins
    plant_loop: Margins
    stable: bool | None

    def __repr__(self) -> str:
        head = f"       GM (dB)  {'gains':16}  PM (°)       Ms   delay margin (s)"
        rows = {each.name: str(each) for each in (self.model_loop, self.observer_loop)}
        return "\n".join([head, *(rows | {self.plant_loop.name: str(self.plant_loop)}).values()])


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
    if isinstance(ms, bool) or not isinstance(ms, Real):
        raise TypeError(f"ms is {ms!r}; give the sensitivity's peak as a number, such as 1.4")
    if not 1 < ms < inf:
        raise ValueError(
            f"ms is {ms}; bounds exist for a finite peak above 1: a peak of 1 or less bounds no "
            "gain from above (the sensitivity of a loop that falls off is never below 1)"
        )
    return MarginBounds(ms / (ms + 1), ms / (ms - 1), degrees(2 * asin(1 / (2 * ms))))


def loop_margins(loop: LoopEquations, verdict: Stability | None = None) -> LoopMargins:
    """Compute the margins of C·G̃, F·H and L.

    Parameters
    ----------
    loop : LoopEquations
        The four blocks.
    verdict : Stability, optional
        Its stability, if already known.
    """
    verdict = stability(loop) if verdict is None else verdict
    return LoopMargins(
        margins(loop.CGm, verdict.model_loop.stable, loop.p_A),
        margins(
            loop.condition_ii,
            verdict.observer_loop.stable,
            multiply(loop.p_B, loop.built.poles) if loop.condition_ii is loop.FH else loop.p_B,
        ),
        margins(loop.L, verdict.observer_loop.stable, loop.p_B),
        verdict.stable,
    )


def margins(loop: Quotient, stable: bool | None, closed: QuasiPolynomial | None = None) -> Margins:
    """Compute the margins of one loop gain.

    Parameters
    ----------
    loop : Quotient
        The loop gain L.
    stable : bool or None
        Verdict on 1 + L, None where it is not known.
    closed : QuasiPolynomial, optional
        Numerator of 1 + L if it is known better than by adding.
    """
    closed = closed or minus_point(loop)
    locus = Locus(loop)
    found = _rational_crossings(loop, closed) if _tame(loop, closed) else None
    logs = _logs(locus, found) if found else []
    if not found or not _confirmed(logs):
        found = _bracketed_crossings(loop, closed, locus)
        logs = _logs(locus, found)
    ends = Ends(loop.dc_gain, *_circle_at_infinity(loop))
    return margins_at(found, [np.exp(log) for log in logs], ends, stable, loop.name)


class Ends(NamedTuple):
    """What a loop gain is at its ends: L(0), and a + b exp(-jωθ), the circle that it tends to.

    Attributes
    ----------
    dc_gain : float
        L(0), infinite with an integrator.
    undelayed, delayed : float
        a and b.
    last : float
        Where that is: at infinite frequency, or at a sampled loop's Nyquist frequency, in rad/s.
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


def margins_at(
    found: Notable, values: Sequence[ComplexArray], ends: Ends, stable: bool | None, name: str
) -> Margins:
    """Read the margins off a loop gain where something happens to it.

    Parameters
    ----------
    found : Notable
        The frequencies where :math:`|L| = 1`, where L is real and where :math:`|1 + L|` is
        smallest.
    values : sequence of three arrays of complex
        L there.
    ends : Ends
        L at the ends.
    stable : bool or None
        Verdict on 1 + L, None where it is not known.
    name : str
        Which loop.
    """
    gain, phase, nearest = found
    at_gain, at_phase, at_nearest = values
    gains, phase = _critical_gains(phase, at_phase.real, ends)
    if not stable:
        return Margins(nan, nan, nan, nan, nan, nan, nan, nan, nan, stable, name, gain, phase)
    gm_low = float(np.max(gains[gains < 1], initial=0.0))
    gm_high = float(np.min(gains[gains > 1], initial=inf))
    gm = gm_low if gm_low * gm_high > 1 else gm_high
    wpc = float(phase[gains == gm][0]) if 0 < gm < inf else nan
    pm, wgc, delay_margin = _rotations(gain, at_gain, ends)
    sm, wms = _closest(nearest, at_nearest, ends)
    return Margins(
        gm, pm, sm, wpc, wgc, wms, gm_low, gm_high, delay_margin, True, name, gain, phase
    )


def _circle_at_infinity(loop: Quotient) -> tuple[float, float]:
    """Return the a and b of the circle a + b exp(-jωθ) that L(jω) tends to.

    With a denominator 1 + c exp(-jωθm) that a model with a direct term leaves it is the image of
    one; where two different dead times turn, the circle around 0 that holds all L comes near to.
    """
    num, den = loop.numerator, loop.denominator
    a, b = loop.at_infinity
    c = [(float(p[0] / den.q[0]), delay) for p, delay in den.delayed if p.size == den.q.size]
    if not c or den.neutral_ratio >= 1 or not isfinite(a + b):
        return a, b
    ratio, delay = c[0]
    size = den.neutral_ratio
    shrink = 1 - size**2
    if not b:
        return a / shrink, abs(a) * size / shrink
    if not a and len(c) == 1 and num.delayed == num.delayed[:1] and num.delay == delay:
        return -b * ratio / shrink, abs(b) / shrink
    return a / shrink, abs(a) * size / shrink + abs(b) / (1 - size)


def _tame(loop: Quotient, closed: QuasiPolynomial) -> bool:
    """Whether products multiplied out into polynomials in ω² can be trusted."""
    if loop.delay:
        return False
    sizes = np.abs(np.concatenate([loop.numerator.q, loop.denominator.q, closed.q]))
    if not sizes.any() or sizes.max() > 1 / TINY or sizes[sizes > 0].min() < TINY:
        return False
    factors = (*loop.num, *loop.den, closed)
    roots = np.concatenate([factor.without_origin.roots for factor in factors])
    size = np.abs(roots)
    damped = np.abs(roots.real) >= LITTLE_DAMPING * size
    return bool(damped.all() and size.max(initial=0.0) <= MAX_SPREAD * size.min(initial=inf))


def _critical_gains(
    phase: FloatArray, values: FloatArray, ends: Ends
) -> tuple[FloatArray, FloatArray]:
    """Gain factors k > 0 with k·L(jω) = -1, and where, ω = 0 and ω = ∞ included."""
    size = abs(ends.delayed)
    last = {ends.undelayed - size, ends.undelayed + size}
    values = np.concatenate([[ends.dc_gain], values, list(last)])
    omega = np.concatenate([[0.0], phase, [ends.last] * len(last)])
    negative = np.isfinite(values) & (values < 0)
    return -1 / values[negative], omega[negative]


def _rotations(gain: FloatArray, values: ComplexArray, ends: Ends) -> tuple[float, float, float]:
    """Phase margin in degrees, its frequency, and the delay margin."""
    endless = ends.last == inf and abs(ends.undelayed) + abs(ends.delayed) >= 1
    delay_margin = 0.0 if endless else inf
    angle = np.angle(-values)
    delay_margin = float(np.min(np.mod(angle, 2 * np.pi) / gain, initial=delay_margin))
    angles, omega = np.append(np.abs(angle), ends.angles), np.append(gain, [0.0, ends.last])
    k = int(np.argmin(angles))
    if angles[k] == inf:
        return inf, nan, delay_margin
    return float(np.degrees(angles[k])), float(omega[k]), delay_margin


def _closest(nearest: FloatArray, values: ComplexArray, ends: Ends) -> tuple[float, float]:
    """Smallest |1 + L| and where."""
    limits = [abs(1 + ends.dc_gain), abs(abs(1 + ends.undelayed) - abs(ends.delayed))]
    distance = np.concatenate([np.abs(1 + values), limits])
    k = int(np.nanargmin(distance))
    return float(distance[k]), float(np.concatenate([nearest, [0.0, ends.last]])[k])


# Without delay: polynomials in x = ω², with p(jω) = even(x) + jω odd(x).


def _rational_crossings(loop: Quotient, closed: QuasiPolynomial) -> Notable:
    """Frequencies where |L| = 1, where L is real, and where |1 + L| is extreme."""
    num, den = loop.numerator.q, loop.denominator.q
    (ne, no), (de, do), (pe, po) = map(_even_odd, (num, den, closed.q))
    square_num, square_den, square_closed = _square(ne, no), _square(de, do), _square(pe, po)
    one = np.ones(1)
    gain = _positive_roots([(square_num, one), (square_den, -one)])
    phase = _positive_roots([(no, de), (ne, -do)])
    slope_closed, slope_den = differentiate(square_closed), differentiate(square_den)
    nearest = _positive_roots([(slope_closed, square_den), (square_closed, -slope_den)])
    return Notable(gain, phase, nearest)


def _even_odd(p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients in x = ω² (descending) of the real part and of the imaginary part over ω."""
    ascending = p[::-1]
    signs = (-1.0) ** np.arange((p.size + 1) // 2)
    even, odd = ascending[::2] * signs, ascending[1::2] * signs[: p.size // 2]
    return even[::-1], odd[::-1] if odd.size else np.zeros(1)


def _square(even: FloatArray, odd: FloatArray) -> FloatArray:
    """Return |p(jω)|² as a polynomial in x."""
    return add(np.convolve(even, even), np.append(np.convolve(odd, odd), 0.0))


def _positive_roots(products: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Frequencies ω > 0 at whose square the sum of the products vanishes."""
    (a, b), (c, d) = products
    total = add(np.convolve(a, b), np.convolve(c, d))
    scale = add(np.convolve(np.abs(a), np.abs(b)), np.convolve(np.abs(c), np.abs(d)))
    total[np.abs(total) <= ROUNDING * scale] = 0.0
    used = np.flatnonzero(total)
    if not used.size:
        return np.empty(0)
    total = total[used[0] : used[-1] + 1]
    roots = companion_roots(total)
    real = roots.real[(np.abs(roots.imag) <= 1e-5 * np.abs(roots)) & (roots.real > 0)]
    if not real.size:
        return real
    # Eigenvalues are accurate against the largest root, a Newton step makes each so by itself.
    return np.sort(np.sqrt([_newton(total.tolist(), x) for x in real.tolist()]))


def _newton(polynomial: list[float], x: float) -> float:
    """One Newton step, unless it would lead away."""
    value = slope = 0.0
    for coefficient in polynomial:
        slope = slope * x + value
        value = value * x + coefficient
    step = value / slope if slope else 0.0
    return x - step if abs(step) < 1e-3 * x else x


def _logs(locus: Locus, found: Notable) -> list[ComplexArray]:
    """Evaluate log L at each kind of frequency, all at once."""
    gain, phase, _ = (omega.size for omega in found)
    return np.split(locus.log(np.concatenate(found)), [gain, gain + phase])


def _confirmed(logs: list[ComplexArray]) -> bool:
    """Whether the factors, which know better than the products, find the same crossings."""
    sizes, sides = logs[0].real, np.sin(logs[1].imag)
    return bool((np.abs(sizes) < CONFIRMED).all() and (np.abs(sides) < CONFIRMED).all())


# With delay, and wherever polynomials in ω² cannot be trusted.


def _bracketed_crossings(loop: Quotient, closed: QuasiPolynomial, locus: Locus) -> Notable:
    """Frequencies where |L| = 1, where L is real, and where |1 + L| is smallest."""
    omega = resolved_frequencies(loop, PER_SEGMENT, closed)
    # Far beyond all roots L is small or large, but its phase may still creep across the axis.
    end = omega[-1] + 4 * pi / loop.delay if loop.delay else 1e8 * omega[-1]
    found = notable_frequencies(locus, np.union1d(omega, np.geomspace(omega[-1], end, 65)))
    poles = on_axis(loop.den)
    at_pole = np.abs(found.phase[:, None] / poles - 1).min(axis=1, initial=1.0) < AT_POLE
    return found._replace(phase=found.phase[~at_pole])
