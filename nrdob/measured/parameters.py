"""A fit told in the words of the field: gain, lags or frequency and damping, dead time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial, reduce
from itertools import product
from math import exp, sqrt

import numpy as np

from ..diagram import DelayedTransferFunction
from ..numerics import ROUNDING, FloatArray
from .disturbance import Scatter
from .fitting import Fit
from .structures import Structure

__all__ = ["CONFIDENCE", "Parameter", "corners_of", "process_of", "told"]

CONFIDENCE = 0.95  # of the intervals
APART = 2.0  # standard errors by which a damping ratio must exceed 1 for two lags to be told apart
NO_DELAY = 0.01  # dead time, in samples, that is none
STEP = 1e-6
SIGNED = ("gain", "lead of the zero")  # numbers that may be negative
LEAST = 0.01  # of its value, the least that a time or a damping ratio is in a corner


@dataclass(frozen=True)
class Parameter:
    """A number of the process, and how well it is known.

    Attributes
    ----------
    value, unit, standard_error : float, str, float
        The estimate, and its standard deviation.
    low, high : float
        Confidence interval of 95 %.
    """

    value: float
    unit: str
    standard_error: float
    low: float
    high: float


def told(
    fit: Fit, scatter: Scatter, units: tuple[float, float]
) -> tuple[dict[str, Parameter], FloatArray]:
    """Give the numbers of a fit with intervals, and the covariance of these numbers.

    Units: sampling time in seconds, and what a gain of 1 in the fit is in units of y over u.
    """
    covariance, last = scatter.covariance, fit.shape.size - 1
    apart = bool(fit.shape[last] > APART * sqrt(covariance[last, last]))
    numbers = partial(_numbers, fit.structure, units=units, apart=apart)
    columns = []
    for size, along in zip(np.abs(fit.unknowns), np.eye(fit.unknowns.size), strict=True):
        step = STEP * max(1.0, float(size)) * along
        below, above = (
            np.array([value for value, _ in numbers(fit.unknowns + way * step).values()])
            for way in (-1, 1)
        )
        columns.append((above - below) / (2 * step.sum()))
    slopes = np.array(columns).T
    known = bool(np.isfinite(covariance).all())
    covariance = slopes @ covariance @ slopes.T if known else np.full((len(slopes),) * 2, np.inf)
    errors = np.sqrt(np.diag(covariance)).tolist()
    parameters = {}
    found = numbers(fit.unknowns).items()
    for (name, (value, unit)), error, slope in zip(found, errors, slopes, strict=True):
        reach = scatter.reach(slope, CONFIDENCE) if known else np.inf
        low = value - reach if name in SIGNED else max(value - reach, 0.0)
        parameters[name] = Parameter(value, unit, error, low, value + reach)
    return parameters, covariance


def _numbers(
    structure: Structure, unknowns: FloatArray, units: tuple[float, float], apart: bool
) -> dict[str, tuple[float, str]]:
    """Tell unknowns as numbers with units: lags that are not apart as frequency and damping."""
    step, gain = units
    shape, linear = np.split(unknowns, [1 + structure.lags])
    told = {"gain": (linear[0] * gain, "y/u")}
    if structure.integrates:
        told["gain"] = (linear[0] * (gain / step), "y/u/s")
    if structure.zero:  # any lead where the record ends before the plant answers, with a gain of 0
        lead = linear[1] / (linear[0] or np.finfo(float).eps)
        told["lead of the zero"] = (lead * step, "s")
    if structure.lags == 1:
        told["lag"] = (exp(shape[1]) * step, "s")
    elif structure.lags == 2:
        omega, damping = exp(shape[1]) / step, exp(shape[2])
        both = damping + sqrt(max(damping**2 - 1, 0.0))
        told |= (
            {"slow lag": (both / omega, "s"), "fast lag": (1 / (omega * both), "s")} if apart
            else {"natural frequency": (omega, "rad/s"), "damping ratio": (damping, "")}
        )  # fmt: skip
    dead_time = shape[0] if abs(shape[0]) > ROUNDING else 0.0  # in samples
    return {name: (float(value), unit) for name, (value, unit) in told.items()} | {
        "dead time": (float(dead_time) * step, "s")
    }


def corners_of(
    structure: Structure, parameters: dict[str, Parameter]
) -> dict[str, DelayedTransferFunction]:
    """Give the processes at the ends of the intervals, in all combinations, by their numbers."""
    ends = []
    for name, each in parameters.items():
        positive = name not in (*SIGNED, "dead time")
        ends.append((max(each.low, LEAST * each.value) if positive else each.low, each.high))
    corners = [dict(zip(parameters, corner, strict=True)) for corner in product(*ends)]
    return {
        ", ".join(f"{name} {value:.3g}" for name, value in numbers.items()):
            _process(structure, numbers)
        for numbers in corners
    }  # fmt: skip


def _process(structure: Structure, numbers: dict[str, float]) -> DelayedTransferFunction:
    num = [numbers["gain"]]
    if structure.zero:
        num.insert(0, numbers["gain"] * numbers["lead of the zero"])
    if "natural frequency" in numbers:
        omega, damping = numbers["natural frequency"], numbers["damping ratio"]
        den = np.array([1 / omega**2, 2 * damping / omega, 1.0])
    else:
        lags = [[value, 1.0] for name, value in numbers.items() if name.endswith("lag")]
        den = reduce(np.convolve, lags, np.ones(1))
    if structure.integrates:
        den = np.append(den, 0.0)
    return DelayedTransferFunction((num, den), numbers["dead time"])


def process_of(fit: Fit, step: float, unit: float) -> DelayedTransferFunction:
    """Write a fit as a process in seconds, whose denominator ends with 1, or with an integrator.

    Step and unit as for `told`.
    """
    numbers = _numbers(fit.structure, fit.unknowns, (step, unit), apart=False)
    values = {name: value for name, (value, _) in numbers.items()}
    if fit.shape[0] <= NO_DELAY:
        values["dead time"] = 0.0
    return _process(fit.structure, values)
