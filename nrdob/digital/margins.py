r"""Margins of a sampled loop gain: the crossings of the unit circle's image, exactly.

Between two certified angles neither the parts of L nor 1 + L turn by more than a right angle; there
the crossings are bracketed and refined by the same search as in continuous time
(`nrdob.analysis.locus`), at frequencies ω = angle/dt. z = 1 and z = -1, at the Nyquist frequency
π/dt, are evaluated, too.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial, reduce
from math import inf, pi

import numpy as np
from scipy.optimize import brentq, root

from ..analysis import Ends, Locus, Margins, margins_at, notable_frequencies, subdivided
from ..numerics import ComplexArray, FloatArray
from .closedloop import ClosedLoop, first_unstable
from .controller import SampledController
from .hold import HeldProcess
from .unitcircle import CircleFunction, Product, resolved

__all__ = ["sampled_margins"]

PER_SEGMENT = 4  # angles in each certified stretch
LOWEST = 1e-8  # of the frequencies of crossings, against the lowest at which anything turns

LOOKED_AT, DEAD_TIMES = 120, 32
"""States of a loop up to which eigenvalues are computed, and at how many dead times."""

BETWEEN = (-0.75, -0.5, -0.25, -1e-6, 0.0)  # samples before and at each jump
AT_ONCE = 0.5  # inverse time constants per sample from which on a lag answers like a direct path

SOLVED = 1e-9  # what may be left of 1 + L where the loop becomes unstable


class _CircleLocus(Locus):
    """A sampled loop gain, numerator over denominator, at frequencies in rad/s."""

    def __init__(self, numerator: Product, denominator: CircleFunction, dt: float) -> None:
        self.count = 1
        self.numerator, self.denominator, self.dt = numerator, denominator, dt

    def log_and_slope(self, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Evaluate log L and its derivative with respect to log ω."""
        angle = omega * self.dt
        with np.errstate(all="ignore"):
            below = self.denominator(angle)
            terms = self.denominator.terms
            slope = sum(term(angle) * term.slope(angle) for term in terms) / below
            log = np.log(self.numerator(angle) / below)
            return log[None], (angle * (self.numerator.slope(angle) - slope))[None]


def sampled_margins(
    numerator: Product,
    denominator: tuple[Product, ...],
    process: HeldProcess,
    controller: SampledController,
    stable: bool | None,
) -> Margins:
    """Compute the margins of L, numerator over the sum of the denominator's terms."""
    dt, below = process.dt, CircleFunction(denominator)
    closed = CircleFunction((*denominator, numerator))
    parts = [CircleFunction((term.inside,)) for term in (numerator, *denominator)]
    angles = reduce(np.union1d, map(resolved, (closed, *parts)))[1:-1]
    angles = np.union1d(angles, angles[0] * np.geomspace(LOWEST, 0.8, 25))
    angles = np.union1d(angles, pi - (pi - angles[-1]) * np.geomspace(1e-6, 0.8, 9))
    locus = _CircleLocus(numerator, below, dt)
    (notable,) = notable_frequencies(locus, subdivided(angles, PER_SEGMENT) / dt)
    ends = np.array([0.0, pi])  # where L is real, and infinite with an integrator
    vanishing = np.abs(below(ends).real) <= below.rounding(ends)
    with np.errstate(divide="ignore", invalid="ignore"):
        values = np.where(vanishing, np.inf, numerator(ends).real / below(ends).real)
    first, last = values.tolist()
    found = margins_at(notable, Ends(first, last, 0.0, pi / dt), stable, "L")
    if not stable or found.delay_margin == inf:
        return found
    return replace(found, late=partial(_added_delay, process, controller, locus, found))


def _added_delay(
    held: HeldProcess, controller: SampledController, locus: Locus, margins: Margins
) -> float:
    """Find the added dead time at which the loop becomes unstable, in seconds.

    At every gain crossover the dead time that would turn L to -1 starts a search in both, dead time
    and frequency, with the hold's true answer to fractions of a sample.
    """
    dt, crossovers = held.dt, margins.gain_crossovers
    values = locus.values(crossovers)[0]

    def later(samples: float) -> HeldProcess:
        return held.after(held.delay + samples * dt)

    def off(unknown: FloatArray) -> list[float]:
        # L with its frequency moved, and the process in it exchanged for the later one.
        at, samples = unknown
        moved = complex(locus.values(np.array([at]))[0, 0]) / _response(held, at)
        value = moved * _response(later(max(samples, 0.0)), at) + 1
        return [value.real, value.imag]

    found, starts = [inf], []
    for omega, value in zip(crossovers, values, strict=True):
        start = np.array([omega, float(np.angle(-value) % (2 * pi)) / (omega * dt)])
        solution = root(off, start, tol=1e-13)
        starts.append(float(start[1]))
        near = abs(solution.x[1] - start[1]) <= 2 and 0 < solution.x[0] <= pi / dt
        if near and max(map(abs, off(solution.x))) < SOLVED:
            found.append(max(0.0, float(solution.x[1])))
    least = min(found)
    turned = min(starts) if least == inf else least
    states = held.B.size + held.memory + controller.states
    if states + min(least, min(starts)) > LOOKED_AT:
        return turned * dt

    @cache  # the ends of a bracket are asked for twice
    def excess(samples: float) -> float:
        return ClosedLoop(controller, later(samples)).spectral_radius - 1

    if excess(0.0) >= 0:  # another part of the loop is unstable already
        return turned * dt
    tried = _tried(held, max(starts) + 2 if least == inf else least)
    bracket = first_unstable(excess, tried if least == inf else tried[:-1])
    if bracket is None:
        return least * dt
    return float(brentq(excess, *bracket, xtol=1e-12)) * dt


def _tried(held: HeldProcess, end: float) -> FloatArray:
    """Choose added dead times in samples, from 0 to `end`, at which the loop is looked at.

    What answers at once jumps from sample to sample, so that 1 + L = 0 need not have a solution
    where the loop becomes unstable, and it may soon be stable again: each sample counts then.
    """
    fastest = np.abs(np.linalg.eigvals(held.A)).max(initial=0.0)
    if not held.D and fastest * held.dt < AT_ONCE:
        return np.linspace(0, end, DEAD_TIMES)
    jumps = np.arange(1, end + 2) - held.fraction
    tried = np.add.outer(jumps, BETWEEN).ravel()
    return np.concatenate([[0.0], tried[(tried > 0) & (tried < end)], [end]])


def _response(held: HeldProcess, omega: float) -> complex:
    """Evaluate the process behind its hold at z = exp(jω dt)."""
    z = np.exp(1j * omega * held.dt)
    state = np.linalg.solve(z * np.eye(held.B.size) - held.Ad, held.B0 + held.B1 / z)
    return complex((held.C @ state + held.D / z) * z**-held.samples)
