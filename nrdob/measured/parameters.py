"""A fit told in the words of the field: gain, lags or frequency and damping, dead time."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import exp, sqrt

import numpy as np

from ..diagram import DelayedTransferFunction
from ..numerics import ROUNDING, FloatArray
from .disturbance import Scatter
from .fitting import Fit
from .structures import Structure

__all__ = ["Parameter", "corners_of", "process_of", "told"]

APART = 2.0
"""Standard errors by which a damping ratio must exceed 1 for two lags to be told apart."""

NO_DELAY = 1e-6
"""Dead time, in samples, that is none."""

STEP = 1e-6

LEAST = 0.01
"""Of its value, the least that a time or a damping ratio is in a corner."""


@dataclass(frozen=True)
class Parameter:
    """A number of the process, and how well it is known.

    Attributes
    ----------
    value : float
        The estimate.
    unit : str
        Its unit.
    standard_error : float
        Standard deviation of the estimate.
    low, high : float
        Confidence interval.
    """

    value: float
    unit: str
    standard_error: float
    low: float
    high: float


class _Names:
    """How the unknowns of a fit are told: lags that may be equal as frequency and damping ratio."""

    def __init__(self, fit: Fit, covariance: FloatArray, step: float, unit: float) -> None:
        self._structure, self._shapes, self._step = fit.structure, fit.shape.size, step
        self._gain = unit / (step if fit.structure.integrates else 1.0)
        last = self._shapes - 1
        self._apart = fit.shape[last] > APART * sqrt(covariance[last, last])
        self.units = {"gain": "y/u/s" if fit.structure.integrates else "y/u"}
        if fit.structure.zero:
            self.units["lead of the zero"] = "s"
        if fit.structure.lags == 1:
            self.units["lag"] = "s"
        elif fit.structure.lags == 2 and self._apart:
            self.units |= {"slow lag": "s", "fast lag": "s"}
        elif fit.structure.lags == 2:
            self.units |= {"natural frequency": "rad/s", "damping ratio": ""}
        self.units["dead time"] = "s"

    def values(self, unknowns: FloatArray) -> FloatArray:
        """Compute the numbers, in the order of `units`, from unknowns as `Fit.unknowns`."""
        shape, linear = unknowns[: self._shapes], unknowns[self._shapes :]
        told = [linear[0] * self._gain]
        if self._structure.zero:
            told.append(linear[1] / linear[0] * self._step)
        if self._structure.lags == 1:
            told.append(exp(shape[1]) * self._step)
        elif self._structure.lags == 2:
            omega, damping = exp(shape[1]) / self._step, exp(shape[2])
            both = damping + sqrt(max(damping**2 - 1, 0.0))
            told += [both / omega, 1 / (omega * both)] if self._apart else [omega, damping]
        dead_time = shape[0] if abs(shape[0]) > ROUNDING else 0.0  # in samples
        return np.array([*told, dead_time * self._step])


def told(
    fit: Fit, scatter: Scatter, units: tuple[float, float], confidence: float
) -> tuple[dict[str, Parameter], FloatArray]:
    """Give the numbers of a fit with intervals, and the covariance of these numbers.

    Units: sampling time in seconds, and what a gain of 1 in the fit is in units of y over u.
    """
    covariance = scatter.covariance
    names = _Names(fit, covariance, *units)
    slopes = _slopes(names, fit)
    known = bool(np.isfinite(covariance).all())
    covariance = slopes @ covariance @ slopes.T if known else np.full((len(slopes),) * 2, np.inf)
    parameters = {}
    for (name, unit), value, error, slope in zip(
        names.units.items(),
        names.values(fit.unknowns).tolist(),
        np.sqrt(np.diag(covariance)).tolist(),
        slopes,
        strict=True,
    ):
        reach = scatter.reach(slope, confidence) if known else np.inf
        low = max(value - reach, 0.0) if name == "dead time" else value - reach
        parameters[name] = Parameter(value, unit, error, low, value + reach)
    return parameters, covariance


def _slopes(names: _Names, fit: Fit) -> FloatArray:
    """Differentiate the told numbers by the unknowns of the fit, shape (numbers, unknowns)."""
    columns = []
    for k, at in enumerate(fit.unknowns):
        step = STEP * max(1.0, abs(float(at)))
        ends = [fit.unknowns.copy(), fit.unknowns.copy()]
        ends[0][k] -= step
        ends[1][k] += step
        columns.append((names.values(ends[1]) - names.values(ends[0])) / (2 * step))
    return np.array(columns).T


def corners_of(
    structure: Structure, parameters: dict[str, Parameter]
) -> dict[str, DelayedTransferFunction]:
    """Give the processes at the ends of the intervals, in all combinations, by their numbers."""
    ends = []
    for name, each in parameters.items():
        positive = name not in ("gain", "lead of the zero", "dead time")
        low = max(each.low, LEAST * each.value) if positive else each.low
        ends.append((low, each.high))
    corners = {}
    for corner in product(*ends):
        numbers = dict(zip(parameters, corner, strict=True))
        name = ", ".join(f"{called} {value:.3g}" for called, value in numbers.items())
        corners[name] = _process(structure, numbers)
    return corners


def _process(structure: Structure, numbers: dict[str, float]) -> DelayedTransferFunction:
    num = [numbers["gain"]]
    if structure.zero:
        num.insert(0, numbers["gain"] * numbers["lead of the zero"])
    if "natural frequency" in numbers:
        omega, damping = numbers["natural frequency"], numbers["damping ratio"]
        den = np.array([1 / omega**2, 2 * damping / omega, 1.0])
    else:
        den = np.ones(1)
        for name in ("lag", "slow lag", "fast lag"):
            if name in numbers:
                den = np.convolve(den, [numbers[name], 1.0])
    if structure.integrates:
        den = np.append(den, 0.0)
    return DelayedTransferFunction((num, den), numbers["dead time"])


def process_of(fit: Fit, step: float, unit: float) -> DelayedTransferFunction:
    """Write a fit as a process in seconds, whose denominator ends with 1, or with an integrator.

    Step and unit as for `told`.
    """
    den = np.array(fit.structure.den(fit.shape))
    scale = next(c for c in den[::-1] if c)
    num = unit * fit.linear[: fit.structure.numerators][::-1]
    powers = float(step) ** np.arange(den.size)[::-1]
    den = den / scale * powers
    last = next(c for c in den[::-1] if c)
    delay = float(fit.shape[0]) * step
    return DelayedTransferFunction(
        (num * powers[-num.size :] / last, den / last), delay if fit.shape[0] > NO_DELAY else 0.0
    )
