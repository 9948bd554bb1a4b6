r"""Output-error least squares: the plant whose exact response comes nearest to what was measured.

The residual is :math:`y - \Phi(\vartheta)b` with the responses :math:`\Phi` of dead time and
denominator :math:`\vartheta`, and with b found by linear least squares for each of them: the
search has three unknowns at most (Golub and Pereyra's variable projection).

.. rubric:: References

Golub, G., V. Pereyra, Separable nonlinear least squares: the variable projection method and its
applications, Inverse Problems 19 (2003) R1-R26.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ..numerics import ROUNDING, BoolArray, FloatArray
from .starts import starting_points
from .structures import Structure

__all__ = ["Fit", "Problem", "best_fit", "refined"]

STEP = 1e-5
"""Of dead time in samples, and of logarithms, for derivatives."""

SHIFTS = (-0.5, 0.5)
"""Of the dead time in samples: for a lag the misfit has a kink at each whole one."""

ROUGHLY, FINELY = 8, 40
"""Most steps of a search, to compare starting points and to the end."""

LONG = 2000
"""Samples to which longer records are thinned, to begin with."""

INSIDE = 1e-9
"""Distance from the bounds at which a search begins."""


@dataclass(frozen=True)
class Problem:
    """What is to be explained.

    Attributes
    ----------
    inputs, outputs : (N,) array
        The record, less the first value of each.
    used : (N,) array of bool
        Samples that count.
    """

    inputs: FloatArray
    outputs: FloatArray
    used: BoolArray

    def first(self, count: int) -> Problem:
        """Keep so many samples, from the first on."""
        return Problem(self.inputs[:count], self.outputs[:count], self.used[:count])

    def thinned(self, factor: int) -> Problem:
        """Take means of so many samples."""
        count = self.outputs.size // factor * factor
        inputs, outputs, used = (
            each[:count].reshape(-1, factor) for each in (self.inputs, self.outputs, self.used)
        )
        return Problem(inputs.mean(axis=1), outputs.mean(axis=1), np.asarray(used.all(axis=1)))

    def columns(
        self, structure: Structure, shape: FloatArray, start: int
    ) -> tuple[FloatArray, FloatArray]:
        """Responses and outputs at the samples that count, from `start` on."""
        used = self.used[start:]
        columns = structure.columns(shape, self.inputs, start)
        return columns[used], self.outputs[start:][used]

    def left(self, fit: Fit) -> FloatArray:
        """Compute the residual from the first sample compared on, 0 where none counts."""
        rest = self.outputs[fit.start :] - fit.response(self.inputs)
        return np.where(self.used[fit.start :], rest, 0.0)


@dataclass(frozen=True)
class Fit:
    """A structure with numbers.

    Attributes
    ----------
    structure : Structure
        The kind of plant.
    shape : array of float
        Dead time in samples, and what shapes the denominator.
    linear : array of float
        Coefficients of the numerator, initial state, level.
    start : int
        First sample compared.
    misfit : float
        Mean square of the residual, at least what rounding makes of the output.
    """

    structure: Structure
    shape: FloatArray
    linear: FloatArray
    start: int
    misfit: float

    @property
    def unknowns(self) -> FloatArray:
        """Shape and linear coefficients in one array."""
        return np.concatenate([self.shape, self.linear])

    def response(self, inputs: FloatArray) -> FloatArray:
        """Compute the output from `start` on."""
        return np.asarray(self.structure.columns(self.shape, inputs, self.start) @ self.linear)

    def jacobian(self, inputs: FloatArray) -> FloatArray:
        """Differentiate the output by all unknowns, at all samples from `start` on."""
        columns = self.structure.columns(self.shape, inputs, self.start)
        slopes = []
        for k in range(self.shape.size):
            # A dead time of zero can only grow.
            back = 0.0 if k == 0 and self.shape[0] < STEP else STEP
            ends = [self.shape.copy(), self.shape.copy()]
            ends[0][k] -= back
            ends[1][k] += STEP
            low, high = (self.structure.columns(s, inputs, self.start) for s in ends)
            slopes.append((high - low) @ self.linear / (STEP + back))
        return np.column_stack([*slopes, columns])


def best_fit(structure: Structure, problem: Problem, tries: int) -> Fit:
    """Search from several starting points, and with the dead time half a sample to either side.

    Parameters
    ----------
    structure : Structure
        The kind of plant.
    problem : Problem
        What is to be explained.
    tries : int
        How many starting points.

    Returns
    -------
    Fit
        The one of smallest misfit.
    """
    factor = problem.outputs.size // LONG
    if factor > 1:
        rough = best_fit(structure, problem.thinned(factor), tries)
        return _search(structure, problem, structure.stretched(rough.shape, factor), 0, FINELY)
    starts = starting_points(structure, problem.inputs, problem.outputs, tries)
    found = [_search(structure, problem, shape, 0, ROUGHLY) for shape in starts]
    best = min(found, key=lambda fit: fit.misfit)
    for shift in SHIFTS:
        moved = best.shape + shift * np.eye(best.shape.size)[0]
        found.append(_search(structure, problem, moved, 0, FINELY))
    return min(found, key=lambda fit: fit.misfit)


def refined(fit: Fit, problem: Problem, start: int) -> Fit:
    """Search on from a fit, with samples from `start` on."""
    return _search(fit.structure, problem, fit.shape, start, FINELY)


def _search(
    structure: Structure, problem: Problem, shape: FloatArray, start: int, most: int
) -> Fit:
    low, high = structure.bounds(problem.outputs.size)
    floor = (ROUNDING * np.ptp(problem.outputs)) ** 2

    def solved(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        columns, outputs = problem.columns(structure, at, start)
        linear = np.linalg.lstsq(columns, outputs, rcond=None)[0]
        return linear, outputs - columns @ linear

    result = least_squares(
        lambda at: solved(at)[1], np.clip(shape, low + INSIDE, high - INSIDE), bounds=(low, high),
        max_nfev=most, xtol=1e-8, ftol=1e-10, gtol=1e-14,
    )  # fmt: skip
    linear, rest = solved(result.x)
    return Fit(structure, result.x, linear, start, float(np.mean(rest**2) + floor))
