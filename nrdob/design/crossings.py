r"""Time constants at which a root of the observer loop crosses the imaginary axis.

At each ω the polynomial p_B(jω) in λ has n roots :math:`\lambda_k(\omega)`, each continuous in ω,
and complex but where a root s = jω is on the axis: there one of them is real and positive. So one
looks for the frequencies at which one of n branches :math:`z_k = j\omega\lambda_k` crosses the
positive imaginary axis, with every dead time exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..numerics import BoolArray, ComplexArray, FloatArray, IntArray, bisect, exponential, side
from .columns import positive_roots, root_near, roots_of_columns, values_and_slopes
from .mismatch import Mismatch, summed

__all__ = ["Branches", "CriticalTimeConstant", "crossings"]

CLEAR = 0.35  # how far a branch may move in a step, against its distance from the others

AWAY = 2.0
"""By how much the way to the line and back must be longer than how far a branch moves between two
frequencies, for it to be no matter which one it is."""

NEAR = 0.3  # cosine of the angle to the line below which a branch may touch it in a step
ZOOMS, ACROSS = 9, 13  # how often a dip is looked at more closely, at how many frequencies

CUTS, PARTS, NARROWEST, MOST = 18, 4, 1e-10, 8
"""How often a step in frequency is cut until it is clear who is who, into how many parts, its least
width, and how many times more frequencies that may take."""

ROUNDING = 1e-12  # rounding error of n roots that are one, to the power n, against their size

ROUGH, STEP, FARTHEST = 1e-11, 1e-15, 1e-3
"""Bound of the rounding error of a critical λ from which it is found exactly; step of the frequency
for that, and by how much it may differ at most."""

ENDS = 4  # coefficients of p_B at either end that are looked at
JUMP = 1e-6  # distance from the line, against the branch's size, that makes it a jump


class CriticalTimeConstant(NamedTuple):
    """A time constant at which roots cross the imaginary axis.

    Attributes
    ----------
    time_constant : float
        λ in seconds.
    frequency : float
        Where they cross, in rad/s; 0 for a real root that passes through s = 0, inf for one that
        passes through infinity.
    direction : int
        +1 if they enter the right half plane as λ grows, -1 if they leave it.
    """

    time_constant: float
    frequency: float
    direction: int


def crossings(mismatch: Mismatch, omega: FloatArray, floor: float) -> list[CriticalTimeConstant]:
    """Find all critical λ above a floor, increasing; none may hide between two frequencies."""
    found = _on_axis(Branches.on(mismatch, omega)) + _through_ends(mismatch)
    return sorted(c for c in found if c.time_constant > floor)


@dataclass(frozen=True, eq=False)
class Branches:
    """The branches jωλ of a family, (n, N), at frequencies, (N,), dense where they are close."""

    mismatch: Mismatch
    omega: FloatArray
    excess: ComplexArray

    @classmethod
    def on(cls, mismatch: Mismatch, omega: FloatArray) -> Branches:
        """Follow the branches over given frequencies."""

        def at(omega: FloatArray) -> ComplexArray:
            return 1j * omega * roots_of_columns(mismatch.coefficients(omega))

        roots, most = at(omega), MOST * omega.size
        steps = np.arange(omega.size - 1)
        for _ in range(CUTS):
            unclear = _matched(roots[:, steps], roots[:, steps + 1])[1]
            unclear &= omega[steps + 1] > omega[steps] * (1 + NARROWEST)
            steps = steps[unclear]
            width = omega[steps + 1] / omega[steps]
            inner = omega[steps, None] * width[:, None] ** (np.arange(1, PARTS) / PARTS)
            kept = ~mismatch.at_pole(inner).any(axis=1)
            steps, inner = steps[kept], inner[kept].ravel()
            if not steps.size or omega.size > most:
                break
            where = np.repeat(steps + 1, PARTS - 1)
            omega = np.insert(omega, where, inner)
            roots = np.insert(roots, where, at(inner), axis=1)
            # Those that were clear are so still.
            steps = steps + (PARTS - 1) * np.arange(steps.size)
            steps = (steps[:, None] + np.arange(PARTS)).ravel()
        return cls(mismatch, omega, _continued(roots))

    def __call__(self, of: IntArray, at: IntArray, omega: FloatArray) -> ComplexArray:
        """Branches `of` between two frequencies of the grid: the root nearest to the chord."""
        cell = np.clip(np.searchsorted(self.omega, omega, "right") - 1, 0, self.omega.size - 2)
        low, high = self.omega[cell], self.omega[cell + 1]
        share = (omega - low) / (high - low)
        guess = (1 - share) * self.excess[of, cell] + share * self.excess[of, cell + 1]
        found = root_near(self.mismatch.coefficients(omega), guess / (1j * omega))
        return np.asarray(1j * omega * found)

    def rounding(self, omega: FloatArray, excess: ComplexArray) -> FloatArray:
        """Bound the rounding error of a branch: dλ = dp/(dp/dλ)."""
        mismatch = self.mismatch
        values = np.atleast_2d(excess / (1j * omega))
        errors = mismatch.uncertainty(omega)
        error = np.polyval(errors[::-1], np.abs(values))
        slope = values_and_slopes(mismatch.coefficients(omega), values)[1]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = np.nan_to_num(omega * error / np.abs(slope), posinf=1e300)
        return np.asarray(np.reshape(found, np.shape(excess)))


def _near_line(excess: ComplexArray) -> BoolArray:
    """Whether a branch may touch the line between two frequencies and leave it again."""
    return np.asarray(np.abs(excess.real) < NEAR * np.abs(excess))


def _matched(before: ComplexArray, after: ComplexArray) -> tuple[IntArray, BoolArray, BoolArray]:
    """Find for each root its successor, where to look closer, and where it is not one to one."""
    away = np.abs(before[:, None] - after[None])
    successor, moved = away.argmin(axis=1), away.min(axis=1)
    n = before.shape[0]
    # Roots that are one but for rounding need not be told from each other.
    least = ROUNDING ** (1 / n) * np.abs(before)
    apart = np.full(moved.shape, np.inf)
    for k in range(1, n):
        distance = np.abs(before - np.roll(before, k, axis=0))
        apart = np.minimum(apart, np.where(distance > least, distance, np.inf))
    # On one side of the line, and away from it, it is all the same who is who.
    there = np.take_along_axis(after, successor, axis=0)
    way = np.where(before.real * there.real > 0, np.abs(before.real + there.real), 0.0)
    near = _near_line(before) | (way < AWAY * moved)
    closer = ((moved > CLEAR * apart) & near).any(axis=0)
    double = (np.sort(successor, axis=0) != np.arange(n)[:, None]).any(axis=0)
    return successor, closer, closer | double


def _continued(roots: ComplexArray) -> ComplexArray:
    """Sort the roots of every frequency into branches."""
    successor, _, unclear = _matched(roots[:, :-1], roots[:, 1:])
    # Beside a pole on the axis, where branches meet, or where it is all the same who is who.
    where = np.flatnonzero(unclear)
    before, after = roots[:, None, where], roots[None, :, where + 1]
    far = np.nan_to_num(np.abs(before - after) / (np.abs(before) + np.abs(after) + 1e-300))
    for k, each in zip(where, far.transpose(2, 0, 1), strict=True):
        successor[:, k] = linear_sum_assignment(each)[1]
    # All steps up to each frequency, one after the other, in steps of twice the length each time.
    every = np.vstack([np.arange(roots.shape[0]), successor.T])
    length = 1
    while length < every.shape[0]:
        every[length:] = np.take_along_axis(every[length:], every[:-length], axis=1)
        length *= 2
    return np.take_along_axis(roots, every.T, axis=0)


Brackets = tuple[IntArray, IntArray, FloatArray, FloatArray]
"""Which branch changes sides, from which frequency on it is reached, and between which two."""


def _on_axis(branches: Branches) -> list[CriticalTimeConstant]:
    """Find where a branch crosses the line Re w = 1 with a positive imaginary part."""
    # Where R nearly vanishes a branch is so close to 1 that its side is only rounding.
    rounding = branches.rounding(branches.omega, branches.excess)
    known = np.abs(branches.excess.real) >= rounding
    parts = (_sign_changes(branches, known), *_hidden_pairs(branches, known, rounding))
    of, at, low, high = (np.concatenate(part) for part in zip(*parts, strict=True))
    where = bisect(lambda w: branches(of, at, w).real, low, high)
    value = branches(of, at, where)
    true = _accepted(branches, where, value)
    # A pair leaves where the branch rises through the line as ω grows, and enters where it falls:
    # Re ds/dλ has the sign opposite to that of the slope.
    directions = side(branches(of, at, low).real)[true].astype(int)
    where, value = where[true], value[true]
    critical = value.imag / where
    rough = branches.rounding(where, value) > ROUGH * np.abs(value)
    critical[rough] = _exactly(branches.mismatch, where[rough], critical[rough])
    columns = critical.tolist(), where.tolist(), directions.tolist()
    return [CriticalTimeConstant(*each) for each in zip(*columns, strict=True)]


def _exactly(mismatch: Mismatch, omega: FloatArray, critical: FloatArray) -> FloatArray:
    """Find critical λ by a secant beside a pole of R, where for a steep λ(ω) ω is too coarse."""
    if not omega.size:
        return critical
    one, other = (
        root_near(mismatch.coefficients(w, exact=True), critical + 0j)
        for w in (omega, omega * (1 + STEP))
    )
    with np.errstate(all="ignore"):
        found = one.real - one.imag * (other - one).real / (other - one).imag
    return np.where(np.abs(found - critical) <= FARTHEST * critical, found, critical)


def _sign_changes(branches: Branches, known: BoolArray) -> Brackets:
    """Bracket the changes of side between neighbouring frequencies where it is known."""
    of, columns = np.nonzero(known)
    sign = side(branches.excess.real[of, columns])
    changed = np.flatnonzero((of[1:] == of[:-1]) & (sign[1:] != sign[:-1]))
    before, after = columns[changed], columns[changed + 1]
    return (of[changed], before, branches.omega[before], branches.omega[after])


def _hidden_pairs(
    branches: Branches, known: BoolArray, rounding: FloatArray
) -> tuple[Brackets, Brackets]:
    """Bracket pairs of crossings that leave the same side at both neighbours, but a dip."""
    real, omega = branches.excess.real, branches.omega
    sign, size = side(real), np.abs(real)
    inner = np.s_[:, 1:-1]
    least = size[inner] - rounding[inner]
    dips = (least <= size[:, :-2]) & (least <= size[:, 2:]) & known[inner]
    dips &= (sign[inner] == sign[:, :-2]) & (sign[inner] == sign[:, 2:])
    dips &= _near_line(branches.excess)[inner]
    of, at = np.nonzero(dips & (branches.excess.imag[inner] > 0))
    at = at + 1
    left, right = omega[at - 1], omega[at + 1]
    bottom = _across(branches, (of, at, left, right), sign[of, at])
    through = np.isfinite(bottom)
    of, at, bottom = of[through], at[through], bottom[through]
    return (of, at, left[through], bottom), (of, at, bottom, right[through])


def _across(branches: Branches, brackets: Brackets, way: FloatArray) -> FloatArray:
    """Find frequencies at which branches on one side, `way`, are on the other; nan for none.

    Around the lowest value ever more closely, until a parabola through it stays on its side.
    """
    of, at, low, high = brackets
    found, share = np.full(of.size, np.nan), np.linspace(0, 1, ACROSS)
    k = np.arange(of.size)
    for _ in range(ZOOMS):
        if not k.size:
            break
        omega = low[:, None] + share * (high - low)[:, None]
        each, near = np.repeat(of[k], ACROSS), np.repeat(at[k], ACROSS)
        values = way[k, None] * branches(each, near, omega.ravel()).real.reshape(omega.shape)
        rows, lowest = np.arange(k.size), np.clip(values.argmin(axis=1), 1, ACROSS - 2)
        least = values.min(axis=1)
        below = least < 0
        found[k[below]] = omega[rows, values.argmin(axis=1)][below]
        beside = np.maximum(values[rows, lowest - 1], values[rows, lowest + 1])
        more = ~below & ~(2 * least > beside)
        low, high = omega[rows, lowest - 1][more], omega[rows, lowest + 1][more]
        k = k[more]
    return found


def _accepted(branches: Branches, omega: FloatArray, excess: ComplexArray) -> BoolArray:
    """Tell crossings from jumps at a pole on the axis, and from zeros there, where λ = 0."""
    rounding, size = branches.rounding(omega, excess), np.abs(excess)
    on_line = np.abs(excess.real) <= JUMP * size + rounding
    # Beside a pole a branch is not known at all.
    near_pole = (rounding >= size) | branches.mismatch.at_pole(omega)
    return on_line & (excess.imag > rounding) & ~near_pole


def _through_ends(mismatch: Mismatch) -> list[CriticalTimeConstant]:
    """Find the λ at which a real root passes through s = 0 or through infinity.

    There p_B(0), or its leading coefficient, vanishes; the next coefficient gives the direction. If
    that vanishes, too, two roots pass.
    """
    found = []
    for (end, other, *further), frequency in zip(_at_ends(mismatch), (0.0, inf), strict=True):
        for critical in positive_roots(end).tolist():
            slopes = [float(np.polyval(np.polyder(p), critical)) for p in (end, other)]
            value = float(np.polyval(other, critical))
            direction = int(-np.sign(slopes[0] * value))
            if abs(value) <= ROUNDING * np.polyval(np.abs(other), critical):
                direction = _of_pair(slopes, [float(np.polyval(p, critical)) for p in further])
            found.append(CriticalTimeConstant(critical, frequency, direction))
    return found


def _at_ends(mismatch: Mismatch) -> tuple[FloatArray, FloatArray]:
    """Coefficients of s^0 to s^3 in p_B, and of the four highest powers without dead time.

    Each a polynomial in λ, in descending powers.
    """
    m = mismatch.divided
    tables = [(mismatch.E, mismatch.a, 0.0)]
    tables += [(mismatch.Nf, p, delay) for p, delay in mismatch.behind]
    lowest = summed(
        [(table.T, p[:, None], exponential(T, m + ENDS)[:, None]) for table, p, T in tables]
    )[-m - ENDS :][:ENDS]
    top = summed([(table.T, p[:, None]) for table, p, delay in tables if not delay])
    first = int(np.flatnonzero(top.any(axis=1))[0])
    highest = np.pad(top, ((0, ENDS - 1), (0, 0)))[first : first + ENDS]
    return lowest[::-1, ::-1], highest[:, ::-1]


def _of_pair(slopes: list[float], further: list[float]) -> int:
    """Find the direction where two coefficients of p_B at one end vanish at one λ.

    Two roots pass: they are real on one side of it, and a pair close to the axis on the other. 0 if
    more than two do. At s = 0 and, in 1/s, at infinity it is the same polynomial.
    """
    (lead, second), (third, fourth) = slopes, further
    if not (lead and third):
        return 0
    of_pair = 2 if fourth / third > second / lead else 0
    return of_pair - 1 if third / lead > 0 else 1 - of_pair
