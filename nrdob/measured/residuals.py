r"""What a model leaves unexplained: whether it is noise, has a memory or follows the input.

A drift is a random walk, of which only the steps are noise. With coloured noise of the sensor on
top the innovations are

.. math:: e = \frac{(1-z^{-1})(1-\varphi z^{-1})}{1-\theta z^{-1}}\,r,

:math:`\theta=1` without drift. A fit is made of what this filter leaves, so that it does not take
the drift for dynamics; how far its numbers scatter, see `nrdob.measured.disturbance`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, sqrt

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter
from scipy.stats import chi2

from ..numerics import FloatArray

__all__ = [
    "DECISIVE", "ResidualCheck", "Whitening", "check_residuals", "products", "whitening_of",
]  # fmt: skip

LAGS, PER_LAG = 25, 8  # most lags looked at, and samples that each must have
# Probability below which chance is not believed, and above which whiteness is.
UNLIKELY, DOUBTFUL = 0.01, 0.05
NO_CHANCE = 0.001  # probability below which only that is said
# Values of 1 - θ among which the search begins.
DRIFTS = (0.0, 1e-3, 3e-3, 6e-3, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.18, 0.27, 0.4, 0.6, 1.0)
MEMORY = 0.95  # largest φ
# What the criterion must gain for a drift to be believed in, or one structure before another.
DECISIVE = 10.0
LONGEST = 20.0  # how often a memory must pass in a record; one that is longer is a drift
ORDER = 4  # of the autoregressions that are tried without drift


@dataclass(frozen=True)
class Whitening:
    """The filter that makes white noise of a disturbance.

    Memory is an autoregression, beginning with 1: alone for white noise. Theta is 1 without drift,
    0 where the disturbance is a random walk.
    """

    memory: tuple[float, ...] = (1.0,)
    theta: float = 1.0

    def applied(self, columns: FloatArray) -> FloatArray:
        """Filter each column; where a memory has not begun yet, nothing counts."""
        if len(self.memory) == 1 and self.theta == 1:
            return columns
        filtered = np.asarray(lfilter(*self.taps, columns, axis=0))
        if self.theta == 1:  # a drift begins where it is, but of a memory the past is not known
            filtered[: len(self.memory) - 1] = 0.0
        return filtered

    def carried_on(self, residual: FloatArray, count: int) -> FloatArray:
        """Predict a residual for so many samples more."""
        num, den = self.taps
        innovations = np.concatenate([lfilter(num, den, residual), np.zeros(count)])
        return np.asarray(lfilter(den, num, innovations)[residual.size :])

    def walked(self, deviation: float, count: int) -> float:
        """Give the standard deviation of the drift after `count` samples, from the innovations'."""
        return (1 - self.theta) / sum(self.memory) * deviation * sqrt(count)

    @property
    def taps(self) -> tuple[FloatArray, FloatArray]:
        """Numerator and denominator."""
        memory = np.array(self.memory)
        if self.theta == 1:
            return memory, np.ones(1)
        return np.convolve(memory, [1.0, -1.0]), np.array([1.0, -self.theta])


def whitening_of(residual: FloatArray) -> Whitening:
    """Find the most likely filter: a drift and a short memory, or a longer memory and no drift."""
    count = residual.size

    def left(tried: Whitening) -> float:
        e = tried.applied(residual)
        free = len(tried.memory) - 1 + (tried.theta < 1)
        seen = count - (len(tried.memory) - 1) * (tried.theta == 1)
        penalty = free * log(count) + DECISIVE * (tried.theta < 1)
        return count * log(max(float(e @ e) / seen, np.finfo(float).tiny)) + penalty

    def drifting(drift: float) -> Whitening:
        rest = Whitening(theta=1 - drift).applied(residual)
        past = rest[:-1]
        size = float(past @ past)
        phi = min(max(float(past @ rest[1:]) / size, -MEMORY), MEMORY) if size else 0.0
        return Whitening((1.0, -phi), 1 - drift)

    scores = [left(drifting(drift)) for drift in DRIFTS]
    least = int(np.clip(np.argmin(scores), 1, len(DRIFTS) - 2))
    drift = minimize_scalar(
        lambda drift: left(drifting(drift)),
        bounds=(DRIFTS[least - 1], DRIFTS[least + 1]), method="bounded", options={"maxiter": 12},
    ).x  # fmt: skip
    found = [drifting(float(drift)), drifting(DRIFTS[int(np.argmin(scores))]), Whitening()]
    own = products(residual, residual, ORDER + 1)
    if own[0] > 0:
        for order in range(1, min(ORDER, count // PER_LAG) + 1):
            a = solve_toeplitz(own[:order], own[1 : order + 1])
            if 1 - float(a.sum()) > LONGEST / count:  # one that lasts as long as the record drifts
                found.append(Whitening((1.0, *(-a).tolist())))
    return min(found, key=left)


@dataclass(frozen=True)
class ResidualCheck:
    """What the residual says about the model.

    Attributes
    ----------
    independent : bool or None
        Whether nothing of the input is left in it; None where the input is too poor to tell.
    independence : float
        Probability of correlations with the input as large as these by chance; nan for None.
    reason : str
        In words.
    """

    independent: bool | None
    independence: float
    reason: str

    def __repr__(self) -> str:
        return self.reason


def check_residuals(residual: FloatArray, inputs: FloatArray, fitted: int) -> ResidualCheck:
    """Judge a residual, with the input beside it, of a response described by so many numbers."""
    chance = _whiteness(residual)
    filter = whitening_of(residual)
    independence = _independence(filter.applied(residual), filter.applied(inputs), fitted)
    independent = None if np.isnan(independence) else independence > UNLIKELY
    said = [
        f"The residual is white ({_told(chance)}): what is left looks like noise of the sensor."
        if chance >= DOUBTFUL
        else f"The residual has a memory ({_told(chance)}): what disturbs the plant is not white, "
        "or the structure misses something; the intervals are widened for it."
    ]
    if independent is None:
        said.append("The input is too poor to tell whether something of it is left.")
    elif independent:
        said.append(f"Nothing of the input is left in it ({_told(independence)}).")
    else:
        said.append(
            f"It still follows the input ({_told(independence)}): the plant does something that "
            "this structure cannot, and the intervals do not cover that."
        )
    return ResidualCheck(independent, independence, " ".join(said))


def _told(chance: float) -> str:
    """Write a chance; of a very small one the digits mean nothing."""
    return f"p = {chance:.2g}" if chance >= NO_CHANCE else f"p < {NO_CHANCE}"


def _whiteness(residual: FloatArray) -> float:
    """Chance of correlations as large as these if the residual were white (Ljung and Box)."""
    count = residual.size
    most = max(1, min(LAGS, count // PER_LAG))
    power, *others = products(residual, residual, most + 1)
    if power == 0:
        return 1.0
    terms = (np.array(others) / power) ** 2 / (count - np.arange(1, most + 1))
    return float(chi2.sf(count * (count + 2) * terms.sum(), most))


def _independence(e: FloatArray, inputs: FloatArray, fitted: int) -> float:
    """Chance of correlations between innovations and the input through the same filter."""
    lags = max(1, min(LAGS, e.size // PER_LAG))
    x = inputs - inputs.mean()
    power = float(np.mean(e**2))
    own = products(x, x, lags)
    if power == 0 or own[0] <= 0:
        return 1.0 if power == 0 else float("nan")
    index = np.abs(np.subtract.outer(np.arange(lags), np.arange(lags)))
    values, vectors = np.linalg.eigh(own[index] / own[0])
    seen = values > 0.02 * values[-1]
    freedom = int(seen.sum()) - fitted
    if freedom < 1:
        return float("nan")
    parts = vectors[:, seen].T @ products(e, x, lags)
    statistic = e.size * float(np.sum(parts**2 / values[seen])) / (power * own[0])
    return float(chi2.sf(statistic, freedom))


def products(later: FloatArray, earlier: FloatArray, lags: int) -> FloatArray:
    """Mean of later(k) earlier(k - lag), for lags from 0 on."""
    count = later.size
    return np.array([later[k:] @ earlier[: count - k] for k in range(lags)]) / count
