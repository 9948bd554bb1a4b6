r"""The time constants :math:`\lambda_k(\omega)` at which p_B(jω) vanishes, each continuous in ω.

They are complex but where a root is on the imaginary axis: there one of them is real and positive.
:math:`z_k = j\omega\lambda_k` then lies on the positive imaginary axis, as the branches of eq. (1)
do, less 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..numerics import BoolArray, ComplexArray, FloatArray, IntArray
from .familymismatch import FamilyMismatch, root_near, slope_in_lambda

__all__ = ["FamilyBranches"]

CLEAR = 0.35
"""How far a branch may move between two frequencies, against its distance from the others."""

AWAY = 2.0
"""By how much the way to the line and back must be longer than how far a branch moves between two
frequencies, for it to be no matter which one it is."""

NEAR = 0.3
"""Cosine of the angle to the line below which a branch may touch it between two frequencies."""

ZOOMS, ACROSS = 9, 13
"""How often the bottom of a dip is looked at more closely, and at how many frequencies."""

CUTS, PARTS, NARROWEST, MOST = 18, 4, 1e-10, 8
"""How often a step in frequency is cut until it is clear who is who, into how many parts, its least
width, and how many times more frequencies that may take."""

ROUNDING = 1e-12
"""Bound of the rounding error of n roots that are one, to the power n, against their size."""


@dataclass(frozen=True, eq=False)
class FamilyBranches:
    """The branches of a family over a grid of frequencies.

    Attributes
    ----------
    mismatch : FamilyMismatch
        The ratio R and the family.
    omega : (N,) array of float
        Frequencies, more than were asked for where branches come close to each other.
    excess : (n, N) array of complex
        jωλ, a row for each branch.
    """

    mismatch: FamilyMismatch
    omega: FloatArray
    excess: ComplexArray

    @classmethod
    def on(cls, mismatch: FamilyMismatch, omega: FloatArray) -> FamilyBranches:
        """Follow the branches over given frequencies."""

        def at(omega: FloatArray) -> ComplexArray:
            return 1j * omega * mismatch.roots_in_lambda(omega)

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
        slope = slope_in_lambda(mismatch.coefficients(omega), values)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = np.nan_to_num(omega * error / np.abs(slope), posinf=1e300)
        return np.asarray(np.reshape(found, np.shape(excess)))

    @staticmethod
    def size(excess: ComplexArray) -> FloatArray:
        """Size of a branch, against which a jump is told from a crossing."""
        return np.asarray(np.abs(excess))

    def nearest(
        self, of: IntArray, at: IntArray, way: FloatArray, low: FloatArray, high: FloatArray
    ) -> FloatArray:
        """Frequencies at which branches on one side, `way`, come closest to the line.

        A dozen calls with many frequencies each are faster than fifty with a few.
        """
        of, at, rows = np.repeat(of, ACROSS), np.repeat(at, ACROSS), np.arange(low.size)
        share = np.linspace(0, 1, ACROSS)
        for _ in range(ZOOMS):
            omega = low[:, None] + share * (high - low)[:, None]
            values = way[:, None] * self(of, at, omega.ravel()).real.reshape(omega.shape)
            k = np.clip(values.argmin(axis=1), 1, ACROSS - 2)
            low, high = omega[rows, k - 1], omega[rows, k + 1]
        return np.asarray((low + high) / 2)

    @staticmethod
    def near_line(excess: ComplexArray) -> BoolArray:
        """Whether a branch may touch the line between two frequencies and leave it again."""
        return np.asarray(np.abs(excess.real) < NEAR * np.abs(excess))

    @staticmethod
    def lost(excess: ComplexArray, rounding: FloatArray) -> BoolArray:
        """Whether a branch is not known at all, as beside a pole."""
        return np.asarray(rounding >= np.abs(excess))


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
    near = FamilyBranches.near_line(before) | (way < AWAY * moved)
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
