r"""The largest ``|y|`` after a unit step of d, for many plants at once.

Without dead time y is a sum of exponentials, :math:`c_0 + \sum_k r_k e^{p_k t}`, which is looked at
over the first swings of every mode; what is largest there is found between its neighbours. Loops
whose modes nearly coincide, or are hardly damped, are left to the method for one.
"""

from __future__ import annotations

import numpy as np

from ..numerics import BoolArray, ComplexArray, FloatArray, convolved
from .batch import PlantBatch
from .batchstability import Feedback

__all__ = ["batch_peaks"]

SWINGS = {0.3: 2, 0.1: 12, 0.03: 40, 0.01: 120}
"""Over how many turns of every mode y is looked at, by the damping ratio that no mode falls below;
then a mode has died down to a thousandth, or it has not even one swing."""

PER_SWING = 20
"""At how many points of a turn."""

WELL_APART = 1e4
"""Sum of the sizes of all modes up to which they are trusted to add up."""

ADDED_UP = 1e-9
"""How well the modes must add up to the jump at t = 0."""

NEAR_PEAK, ACROSS, ZOOMS = 0.9, 9, 8
"""Share of the largest value from which a peak is looked at; at how many points, how often."""


def batch_peaks(feedback: Feedback, plants: PlantBatch) -> tuple[FloatArray, BoolArray]:
    """Find the peaks of loops that are known to be stable.

    Parameters
    ----------
    feedback : Feedback
        All the feedback there is.
    plants : PlantBatch
        Of the same degrees, without dead time, like the model.

    Returns
    -------
    (n,) array of float
        Largest ``|y|``.
    (n,) array of bool
        Which of them are to be trusted.
    """
    (prompt, *_), _ = feedback.characteristic(plants)
    den = prompt.q
    num = convolved(plants.den, feedback.denominator.q[:, None])
    with np.errstate(all="ignore"):  # what is not finite is looked at again
        poles = _roots(den)
        residues = _at(num, poles) / (poles * _at(_slope(den), poles))
        level = num[-1] / den[-1]
        jump = num[0] / den[0] if num.shape[0] == den.shape[0] else np.zeros(level.size)
        trusted = np.abs(level + residues.sum(axis=1).real - jump) < ADDED_UP
        trusted &= np.abs(residues).sum(axis=1) < WELL_APART
        damping = (-poles.real / np.abs(poles)).min(axis=1)
        peak, above = np.full(level.size, np.nan), np.inf
        for least, swings in SWINGS.items():
            few = np.flatnonzero(trusted & (damping >= least) & (damping < above))
            above = least
            if few.size:
                times = _times(poles[few], swings)
                peak[few] = _largest(poles[few], residues[few], level[few], times)
    return np.maximum(peak, np.abs(jump)), trusted & np.isfinite(peak)


def _roots(den: FloatArray) -> ComplexArray:
    """Roots of every polynomial, (n, k), each improved by Newton's steps."""
    degree, n = den.shape[0] - 1, den.shape[1]
    companion = np.zeros((n, degree, degree))
    # In a unit of time in which the roots have the mean size 1.
    unit = np.abs(den[-1] / den[0]) ** (1 / degree)
    powers = unit ** np.arange(1, degree + 1)[:, None]
    companion[:, 0, :] = (-(den[1:] / den[0]) / powers).T
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companion[~np.isfinite(companion).all(axis=(1, 2))] = 0.0
    roots = np.asarray(np.linalg.eigvals(companion) * unit[:, None], dtype=complex)
    for _ in range(2):
        step = _at(den, roots) / _at(_slope(den), roots)
        roots = np.where(np.abs(step) < 1e-3 * np.abs(roots), roots - step, roots)
    return roots


def _at(p: FloatArray, s: ComplexArray) -> ComplexArray:
    value = np.zeros_like(s)
    for coefficient in p:
        value = value * s + coefficient[:, None]
    return value


def _slope(p: FloatArray) -> FloatArray:
    return np.asarray(p[:-1] * np.arange(p.shape[0] - 1, 0, -1)[:, None])


def _times(poles: ComplexArray, swings: int) -> FloatArray:
    """Choose times that show the first swings of every mode, (n, m), increasing."""
    turned = 2 * np.pi * np.linspace(0, swings, swings * PER_SWING + 1)[1:]
    times = (turned / np.abs(poles)[:, :, None]).reshape(poles.shape[0], -1)
    return np.sort(times, axis=1)


def _response(
    poles: ComplexArray, residues: ComplexArray, level: FloatArray, times: FloatArray
) -> FloatArray:
    """Size of y at times (n, m)."""
    y = np.repeat(level[:, None], times.shape[1], axis=1)
    for p, r in zip(poles.T, residues.T, strict=True):
        y += (r[:, None] * np.exp(p[:, None] * times)).real
    return np.abs(y)


def _largest(
    poles: ComplexArray, residues: ComplexArray, level: FloatArray, times: FloatArray
) -> FloatArray:
    """Largest size of y, looked at more closely around the largest values of the first look."""
    size = _response(poles, residues, level, times)
    peak = np.asarray(size.max(axis=1))
    inner = size[:, 1:-1]
    top = (inner >= size[:, :-2]) & (inner >= size[:, 2:]) & (inner > NEAR_PEAK * peak[:, None])
    member, k = np.nonzero(top)
    low, high = times[member, k], times[member, k + 2]
    few = poles[member], residues[member], level[member]
    row = np.arange(member.size)
    for _ in range(ZOOMS if member.size else 0):
        closer = np.linspace(low, high, ACROSS, axis=1)
        size = _response(*few, closer)
        at = size.argmax(axis=1)
        np.maximum.at(peak, member, size[row, at])
        low = closer[row, np.maximum(at - 1, 0)]
        high = closer[row, np.minimum(at + 1, ACROSS - 1)]
    return peak
