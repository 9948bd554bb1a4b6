r"""What disturbs the output, and how far it scatters the numbers of a fit.

The disturbance is taken as :math:`d=\bigl(\frac{1-\theta z^{-1}}{1-\varphi z^{-1}}\bigr)^me` with
white noise e: white noise alone for :math:`\theta=\varphi`, coloured noise for
:math:`|\varphi|<1`, and for :math:`\varphi=1` a drift with white noise of the sensor on top, which
is a random walk (m = 1) or smooth, noise integrated twice (m = 2). Beside a random walk passes a
slow wave of unknown size, as of a room by day and by night: it is not seen in the changes from
sample to sample, and moves the gain all the more. A record seldom tells which of these three kinds
it is. So all are kept, each as likely beforehand, weighted by the restricted likelihood of the
residual r,

.. math:: |V|^{-1/2}\,|J^TV^{-1}J|^{-1/2}\,(r^TPr)^{-(N-n)/2},

where V is the covariance of d over that of e, J the Jacobian of the response by its n unknowns, and
P leaves of the residual what they do not explain in the sense of V. Each tells where the unknowns
are, :math:`(J^TV^{-1}J)^{-1}J^TV^{-1}r` away from the estimate, and how surely; an interval about
the estimate holds as much of the mixture of all as it says. A sensor that rounds adds errors that
are alike wherever its reading is the same, unless noise dithers it.

.. rubric:: References

Harville, D. A., Maximum likelihood approaches to variance component estimation and to related
problems, Journal of the American Statistical Association 72 (1977) 320-338.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from math import exp, pi, sqrt
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.signal import lfilter
from scipy.special import stdtr, stdtrit

from ..numerics import BoolArray, FloatArray

__all__ = ["Scatter", "scatter_of"]

# Poles φ of coloured noise.
COLOURED = (0.3, 0.5, 0.65, 0.75, 0.82, 0.87, 0.91, 0.94, 0.96, 0.975, 0.985, 0.993)
# Distances of the zero from the pole, 1 - θ/φ.
SHARES = (1e-3, 3e-3, 6e-3, 0.012, 0.025, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0)
SMOOTH = SHARES[1:8]  # the same for a drift that goes on in its direction
LEAST = 0.02  # distance φ - θ below which coloured noise is white
# Sizes of each part of the wave beside a random walk, over e, and how many periods it makes.
WAVES, PERIODS = (6.0, 60.0, 600.0), (0.5, 1.0, 1.5)
BLOCK = 1000  # samples that are triangularised at once
# How often noise must have forgotten itself in a record; what remembers longer is a drift.
FORGOTTEN = 50


class Hypothesis(NamedTuple):
    """Order m, φ and θ, and the sizes that a wave beside it may have, if one passes."""

    order: int
    pole: float
    zero: float
    waves: tuple[float, ...] = (1.0,)


HYPOTHESES = (
    [Hypothesis(1, pole, 0.0) for pole in (0.0, -0.3, -0.6)]
    + [
        Hypothesis(1, pole, pole * (1 - far))
        for pole in COLOURED
        for far in SHARES
        if pole * far > LEAST
    ],
    [Hypothesis(1, 1.0, 1 - far, WAVES) for far in SHARES],
    [Hypothesis(2, 1.0, 1 - far) for far in SMOOTH],
)
"""Noise, random walks and smooth drifts."""


@dataclass(frozen=True, eq=False)
class Scatter:
    """Where the truth may be, seen from the n estimates, under each of h possible disturbances.

    Weights of the disturbances, shape (h,), whose sum is 1; means, (h, n), and covariances,
    (h, n, n), of the truth under each; and degrees of freedom.
    """

    weights: FloatArray
    shifts: FloatArray
    covariances: FloatArray
    freedom: float

    @property
    def covariance(self) -> FloatArray:
        """About the estimates; infinite where something cannot be told from the record."""
        outer = self.shifts[:, :, None] * self.shifts[:, None]
        return np.asarray(np.tensordot(self.weights, self.covariances + outer, 1))

    def reach(self, slope: FloatArray, confidence: float) -> float:
        """Half width of the confidence interval of what has this slope, (n,), by the estimates."""
        errors = np.sqrt(np.einsum("i,hij,j->h", slope, self.covariances, slope))
        if not 0 < errors.max() < np.inf:
            return float(errors.max())
        errors = np.maximum(errors, 1e-9 * errors.max())
        shifts = self.shifts @ slope

        def excess(half: float) -> float:
            beyond = stdtr(self.freedom, (np.outer([1, -1], shifts) - half) / errors)
            return float(self.weights @ beyond.sum(axis=0)) - (1 - confidence)

        top = np.abs(shifts).max() + errors.max() * stdtrit(self.freedom, (3 + confidence) / 4)
        return float(brentq(excess, 0.0, float(top)))


def scatter_of(
    residual: FloatArray, jacobian: FloatArray, used: BoolArray, readings: FloatArray, grain: float
) -> Scatter:
    """Find where the truth may be, from what a fit leaves of the samples that count.

    The Jacobian, shape (N, n), holds the derivatives of the response by what was estimated; grain
    is what the sensor of these readings resolves, 0 if that cannot be seen.
    """
    size = np.linalg.norm(jacobian[used], axis=0)
    scaled = jacobian / np.where(size > 0, size, 1.0)
    n = size.size
    freedom = float(max(1, used.sum() - n))
    if np.linalg.matrix_rank(scaled[used]) < n:
        return Scatter(np.ones(1), np.zeros((1, n)), np.full((1, n, n), np.inf), freedom)
    rows = np.vstack([scaled.T, residual])
    levels = np.unique(readings, return_inverse=True)[1]
    logarithms, shifts, covariances = [], [], []
    kinds = [
        [each for each in kind if each.pole == 1 or (1 - each.pole) * residual.size > FORGOTTEN]
        for kind in HYPOTHESES
    ]
    for order, pole, zero, waves in chain(*kinds):
        den, num = (np.poly([root] * order) for root in (pole, zero))
        beside = _beside(order, pole, zero, residual.size)
        count = len(beside)
        white = lfilter(den, num, np.vstack([*beside, rows]))[:, used]
        triangle = _triangle(white)  # stands for all samples
        for wave in waves:
            scale = np.repeat([wave, 1.0], [count, n + 1])
            stacked = np.vstack([np.eye(count, count + n + 1), triangle * scale])
            corner = np.asarray(np.linalg.qr(stacked, mode="r"))
            variance = float(corner[-1, -1] ** 2) / freedom + np.finfo(float).tiny
            corners = np.abs(np.diag(corner)[:-1])
            logarithms.append(-np.log(corners).sum() - 0.5 * freedom * np.log(variance))
            whole = np.linalg.inv(corner[:-1, :-1])
            inverse = whole[count:]
            covariance = variance * inverse @ inverse.T
            if grain:
                estimator: FloatArray = np.zeros((n, residual.size))
                estimator[:, used] = (inverse @ whole.T * scale[:-1]) @ white[:-1]
                back = lfilter(den, num, estimator[:, ::-1])[:, ::-1]
                alike = np.array([np.bincount(levels, moved) for moved in back])
                covariance += _rounded(grain, variance) * alike @ alike.T
            shifts.append(inverse @ corner[:-1, -1] / size)
            covariances.append(covariance / np.outer(size, size))
    weights = np.exp(np.array(logarithms) - max(logarithms))
    sizes = [sum(len(each.waves) for each in kind) for kind in kinds]
    weights /= np.repeat(sizes, sizes)
    return Scatter(weights / weights.sum(), np.array(shifts), np.array(covariances), freedom)


def _triangle(rows: FloatArray) -> FloatArray:
    """Triangularise rows.T: first in blocks, which is faster by far where there are many."""
    count, blocks = rows.shape[0], rows.shape[1] // BLOCK
    parts = rows[:, : blocks * BLOCK].reshape(count, blocks, BLOCK).transpose(1, 2, 0)
    corners = np.asarray(np.linalg.qr(parts, mode="r")).reshape(-1, count)
    return np.asarray(np.linalg.qr(np.vstack([corners, rows[:, blocks * BLOCK :].T]), mode="r"))


def _beside(order: int, pole: float, zero: float, samples: int) -> list[FloatArray]:
    """List what enters the output beside filtered noise; the size of each varies as e does."""
    times = np.arange(samples)
    if pole < 1:  # what the noise remembers from before the record
        return [abs(pole - zero) / sqrt(1 - pole**2) * pole**times]
    if order > 1:  # the slope of the drift as the record begins
        return [sqrt(samples) * (1 - zero) ** 2 * times]
    angles = [2 * pi * each * times / samples for each in PERIODS]
    return [part(angle) for angle in angles for part in (np.sin, np.cos)]


def _rounded(grain: float, variance: float) -> float:
    """Variance of the rounding error that noise of this variance, rounding included, leaves."""
    dither = max(variance / grain**2 - 1 / 12, 0.0)
    return grain**2 / 12 * exp(-4 * pi**2 * dither)
