r"""Margins of a sampled loop gain: the crossings of the unit circle's image, exactly.

Between two certified angles neither the parts of L nor 1 + L turn by more than a right angle; there
the crossings are bracketed and refined by the same search as in continuous time
(`nrdob.analysis.locus`). z = 1 and z = -1, at the Nyquist frequency π/dt, are looked at, too.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from math import inf, pi

import numpy as np
from scipy.optimize import brentq, root

from ..analysis import Ends, Locus, Margins, margins_at, notable_frequencies, subdivided
from ..numerics import ComplexArray, FloatArray
from .circle import CircleFunction, Product, resolved
from .controller import SampledController
from .hold import HeldProcess
from .verdict import lifted

__all__ = ["CircleLocus", "added_delay", "circle_margins"]

PER_SEGMENT = 4
"""Angles in each certified stretch."""

LOWEST = 1e-8
"""Frequency, against the lowest at which anything turns, down to which crossings are sought."""

LOOKED_AT, DEAD_TIMES = 60, 32
"""States of a loop up to which eigenvalues are looked at, and at how many dead times."""

SOLVED = 1e-9
"""What may be left of 1 + L where the loop is lost."""


class CircleLocus(Locus):
    """A sampled loop gain on the unit circle.

    Parameters
    ----------
    numerator : Product
        Of L.
    denominator : CircleFunction
        Of L.
    dt : float
        Sampling time in seconds.
    """

    def __init__(self, numerator: Product, denominator: CircleFunction, dt: float) -> None:
        self.count = 1
        self.numerator, self.denominator, self.dt = numerator, denominator, dt

    def log_and_slope(self, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Evaluate log L and its derivative with respect to log ω.

        Parameters
        ----------
        omega : array of float
            Frequencies in rad/s, between 0 and π/dt.
        """
        angle = omega * self.dt
        with np.errstate(all="ignore"):
            below = self.denominator(angle)
            terms = self.denominator.terms
            slope = sum(term(angle) * term.slope(angle) for term in terms) / below
            log = np.log(self.numerator(angle) / below)
            return log[None], (angle * (self.numerator.slope(angle) - slope))[None]


def circle_margins(
    numerator: Product,
    denominator: tuple[Product, ...],
    closed: CircleFunction,
    dt: float,
    stable: bool | None,
) -> Margins:
    """Compute the margins of a sampled loop gain.

    Parameters
    ----------
    numerator : Product
        Of L.
    denominator : tuple of Product
        Terms of the denominator of L.
    closed : CircleFunction
        Their sum, the characteristic function.
    dt : float
        Sampling time in seconds.
    stable : bool or None
        Verdict on 1 + L.
    """
    below = CircleFunction(denominator)
    parts = [CircleFunction((term.inside,)) for term in (numerator, *denominator)]
    grids = [resolved(part)[0] for part in (closed, *parts)]
    angles = reduce(np.union1d, grids)[1:-1]
    angles = np.union1d(angles, angles[0] * np.geomspace(LOWEST, 0.8, 25))
    angles = np.union1d(angles, pi - (pi - angles[-1]) * np.geomspace(1e-6, 0.8, 9))
    locus = CircleLocus(numerator, below, dt)
    (found,) = notable_frequencies(locus, subdivided(angles, PER_SEGMENT) / dt)
    first, last = _at_ends(numerator, below)
    return margins_at(found, Ends(first, last, 0.0, pi / dt), stable, "L")


def _at_ends(numerator: Product, below: CircleFunction) -> tuple[float, float]:
    """L at z = 1 and z = -1, where it is real; infinite with an integrator."""
    ends = np.array([0.0, pi])
    num, den = numerator(ends).real, below(ends).real
    vanishing = np.abs(den) <= below.rounding(ends)
    with np.errstate(divide="ignore", invalid="ignore"):
        values = np.where(vanishing, np.inf, num / den)
    return float(values[0]), float(values[1])


def added_delay(
    held: HeldProcess,
    controller: SampledController,
    gain: Callable[[FloatArray], ComplexArray],
    crossovers: FloatArray,
) -> float:
    """Find the dead time that must be added for the loop to be lost, in seconds.

    At every gain crossover the dead time that would turn L to -1 is the start of a search in both,
    dead time and frequency, with the hold's true answer to fractions of a sample. Where the loop is
    small its eigenvalues are looked at in between, too.

    Parameters
    ----------
    held : HeldProcess
        The process behind its hold.
    controller : SampledController
        The difference equations.
    gain : callable
        L at frequencies in rad/s.
    crossovers : array of float
        Where its size is 1, in rad/s.
    """
    dt = held.dt

    def later(samples: float) -> HeldProcess:
        return held.after(held.delay + samples * dt)

    def off(unknown: FloatArray) -> list[float]:
        # L with its frequency moved, and the process in it exchanged for the later one.
        at, samples = unknown
        moved = complex(gain(np.array([at]))[0]) / _response(held, at)
        value = moved * _response(later(max(samples, 0.0)), at) + 1
        return [value.real, value.imag]

    found, starts = [inf], []
    for omega, value in zip(crossovers, gain(crossovers), strict=True):
        start = np.array([omega, float(np.angle(-value) % (2 * pi)) / (omega * dt)])
        solution = root(off, start, tol=1e-13)
        starts.append(float(start[1]))
        near = abs(solution.x[1] - start[1]) <= 2 and 0 < solution.x[0] <= pi / dt
        if near and max(map(abs, off(solution.x))) < SOLVED:
            found.append(max(0.0, float(solution.x[1])))
    least = min(found)
    if not crossovers.size:
        return inf
    turned = min(starts) if least == inf else least
    states = held.B.size + held.memory + controller.states
    if states + min(least, max(starts)) > LOOKED_AT:
        return turned * dt

    def excess(samples: float) -> float:
        values = np.linalg.eigvals(lifted(later(samples), controller))
        return float(np.abs(values).max()) - 1

    if excess(0.0) >= 0:  # another part of the loop is lost already
        return turned * dt
    # A direct path jumps from sample to sample, so that no dead time solves 1 + L = 0.
    end, last = (max(starts) + 2 if least == inf else least), 0.0
    for samples in np.linspace(0, end, DEAD_TIMES)[1 : None if least == inf else -1].tolist():
        if excess(samples) >= 0:
            return float(brentq(excess, last, samples, xtol=1e-12)) * dt
        last = samples
    return least * dt


def _response(held: HeldProcess, omega: float) -> complex:
    """Evaluate the process behind its hold at z = exp(jω dt)."""
    z = np.exp(1j * omega * held.dt)
    state = np.linalg.solve(z * np.eye(held.B.size) - held.Ad, held.B0 + held.B1 / z)
    return complex((held.C @ state + held.D / z) * z**-held.samples)
