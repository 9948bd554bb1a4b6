"""A process out of a record: several structures fitted, one chosen, all of it shown.

Each structure is fitted to one part of the record by output-error least squares and then has to
foretell the other part. The level of the output and the state at the beginning are fitted along,
so that no record has to start from rest.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import ceil, log, nan
from numbers import Real
from typing import Any

import numpy as np
from scipy.stats import t as student

from ..diagram import DelayedTransferFunction
from ..numerics import FloatArray
from .fitting import Fit, Problem, best_fit, refined
from .naming import Names, named_slopes, process_of
from .records import Record, checked_record
from .residuals import Noise, ResidualCheck, check_residuals, noise_of
from .structures import STRUCTURES, Structure

__all__ = ["Candidate", "Identification", "Parameter", "identified", "identify"]

TRIES = 3
"""Starting points for each structure."""

MOVES, LEAST = 0.1, 50
"""Share of the input's variance, and samples, that each part of a record must have."""

LITTLE = 30.0
"""Per cent of the output explained below which a process is doubtful."""

CLEARLY = 0.995
"""A simpler structure is taken if it foretells better than by this factor."""


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


@dataclass(frozen=True)
class Candidate:
    """A structure that was tried.

    Attributes
    ----------
    structure : str
        In words.
    parameters : int
        How many numbers it has, without level and initial state.
    fit_percent : float
        How much of the output it explains in the part it was fitted to.
    validation_percent : float
        How much of the part that was held out; nan if none was.
    levelled_percent : float
        The same with the level and initial state of that part fitted.
    bic : float
        Bayesian information criterion against the best one, 0 for that one.
    process : DelayedTransferFunction
        The process it gives.
    """

    structure: str
    parameters: int
    fit_percent: float
    validation_percent: float
    levelled_percent: float
    bic: float
    process: DelayedTransferFunction = field(repr=False)


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """A process, and why to believe in it; prints its evidence.

    Attributes
    ----------
    process : DelayedTransferFunction
        What `nrdob.NRDOB` takes, in seconds and the units of u and y.
    structure : str
        What kind of process, in words.
    parameters : dict of str: Parameter
        Its numbers, with standard errors and intervals.
    covariance : (n, n) array
        Of the parameters, in that order.
    confidence : float
        Of the intervals.
    fit_percent : float
        ``100 (1 - |y - model| / |y - mean of y|)`` in the part that was fitted.
    validation_percent : float
        The same in the part held out, simulated on from the fitted part; nan if none was held out.
    levelled_percent : float
        The same with the level and initial state of that part fitted: where it is much better, the
        level has drifted, and the dynamics are right.
    residuals : ResidualCheck
        Is what is left noise, and nothing of the input?
    candidates : tuple of Candidate
        All structures tried, from simple to rich.
    reason : str
        Why this one, in words.
    remarks : tuple of str
        What else should be known of the record.
    record : Record
        What was measured.
    predicted : (N,) array
        The model's output on the record; nan before the first sample compared.
    fitted : int
        How many samples, from the first on, were fitted.
    """

    process: DelayedTransferFunction
    structure: str
    parameters: dict[str, Parameter]
    covariance: FloatArray
    confidence: float
    fit_percent: float
    validation_percent: float
    levelled_percent: float
    residuals: ResidualCheck
    candidates: tuple[Candidate, ...]
    reason: str
    remarks: tuple[str, ...]
    record: Record
    predicted: FloatArray
    fitted: int

    def __repr__(self) -> str:
        held = self.validation_percent
        rows = [
            f"{name:18} {p.value:10.4g} {p.unit:6} {p.low:10.4g} to {p.high:.4g}"
            for name, p in self.parameters.items()
        ]
        return "\n".join(
            [
                f"{self.structure}: fit {self.fit_percent:.1f} %, "
                + ("nothing held out" if np.isnan(held) else f"held-out part {held:.1f} %"),
                f"{'':18} {'value':>10} {'':6} {100 * self.confidence:9.3g} % interval",
                *rows,
                self.residuals.reason,
                *self.remarks,
            ]
        )


@dataclass(frozen=True, eq=False)
class _Judged:
    """A fit and what it is worth."""

    fit: Fit
    noise: Noise
    whiteness: float
    covariance: FloatArray
    bic: float
    fit_percent: float
    validation: float
    levelled: float


def identify(
    t: Any,
    u: Any,
    y: Any,
    *,
    structure: str | None = None,
    held_out: float = 0.5,
    confidence: float = 0.95,
) -> Identification:
    r"""Fit a process with dead time to a step or any other test signal.

    Integrators, one and two lags (two may be a resonance) with dead time, with and without a zero,
    are fitted by output-error least squares: the input is held between samples, the dead time need
    not be a whole number of them, and nothing is approximated. The level of y (of an integrator:
    the level of u at which it rests) and the initial state are fitted along. The plant must be
    stable or an integrator, and must not be under control while it is measured.

    Parameters
    ----------
    t : (N,) array_like
        Evenly spaced times, in seconds.
    u, y : (N,) array_like
        Input, held from each sample to the next, and output.
    structure : str, optional
        One of `nrdob.measured.STRUCTURES` by name; by default the one of smallest Bayesian
        information criterion, or a simpler one that foretells the held-out part better.
    held_out : float
        Share of the record, at its end, on which the process is tried; 0 to fit all of it. All is
        fitted, too, where the input does not move enough in both parts.
    confidence : float
        Of the intervals, between 0 and 1.

    Returns
    -------
    Identification
        `.process`, `.fit_percent`, `.parameters`, `.covariance` and the evidence.

    Raises
    ------
    TypeError, ValueError
        If the record, see `nrdob.measured.checked_record`, or an option is not as it must be; or if
        the numbers of the process cannot be told from it.

    Examples
    --------
    A lag of 2 s and a dead time of three samples, every 0.1 s:

    >>> import numpy as np
    >>> k = np.arange(400)
    >>> u = np.sign(np.sin(0.01 * k**1.3))
    >>> y = np.zeros(400)
    >>> for j in range(3, 399):
    ...     y[j + 1] = np.exp(-0.05) * y[j] + 1.5 * (1 - np.exp(-0.05)) * u[j - 3]
    >>> found = identify(0.1 * k, u, y, structure="one lag with dead time")
    >>> [round(p.value, 4) for p in found.parameters.values()]
    [1.5, 2.0, 0.3]
    """
    record = checked_record(t, u, y)
    for name, given, top in (("held_out", held_out, 0.9), ("confidence", confidence, 1.0)):
        if isinstance(given, bool) or not isinstance(given, Real):
            raise TypeError(f"{name} is {given!r}; give a number, such as 0.5")
        if not (0 <= given < top and (name == "held_out" or given > 0)):
            raise ValueError(f"{name} is {given}; it must be between 0 and {top:g}")
    for remark in record.remarks:
        warnings.warn(remark, UserWarning, stacklevel=2)
    return identified(record, _asked(structure), held_out, confidence)


def identified(
    record: Record,
    structures: tuple[Structure, ...] = STRUCTURES,
    held_out: float = 0.5,
    confidence: float = 0.95,
) -> Identification:
    """Do what `identify` does, for a record that was checked.

    Parameters
    ----------
    record : Record
        The record.
    structures : tuple of Structure
        Those that are tried.
    held_out, confidence : float
        As for `identify`.

    Returns
    -------
    Identification
        The process and the evidence.

    Raises
    ------
    ValueError
        If the numbers of the process cannot be told from the record.
    """
    sizes = np.ptp(record.u), np.ptp(record.y)
    inputs, outputs = (record.u - record.u[0]) / sizes[0], (record.y - record.y[0]) / sizes[1]
    unit = float(sizes[1] / sizes[0])
    whole = Problem(inputs, outputs, record.free)
    count, parting = _parted(record, held_out)
    problem = whole.first(count)
    fits = [best_fit(each, problem, TRIES) for each in structures]
    # What the input was before the record is not known: the samples that the dead time keeps it
    # alive for are left out, the same for all, so that they can be compared.
    leading = min(fits, key=lambda fit: count * log(fit.misfit) + 2 * fit.structure.count)
    start = min(ceil(leading.shape[0]) + 1, count // 2)
    fits = [refined(fit, problem, start) for fit in fits]
    richest = min(fits, key=lambda fit: fit.misfit)
    noise, _ = noise_of(problem.left(richest), richest.structure.count)
    judged = [_judged(fit, whole, problem, noise.inflation) for fit in fits]
    best, reason = _chosen(judged, parting)
    least = min(each.bic for each in judged)
    response = sizes[1] * best.fit.response(inputs) + record.y[0]
    step = record.sampling_time
    candidates = tuple(
        Candidate(
            each.fit.structure.name, each.fit.structure.count - each.fit.structure.free,
            each.fit_percent, each.validation, each.levelled, each.bic - least,
            process_of(each.fit, step, unit),
        )
        for each in judged
    )  # fmt: skip
    parameters, covariance = _parameters(best, problem, (step, unit), confidence)
    fit = best.fit
    return Identification(
        process=process_of(fit, step, unit),
        structure=fit.structure.name,
        parameters=parameters,
        covariance=covariance,
        confidence=confidence,
        fit_percent=best.fit_percent,
        validation_percent=best.validation,
        levelled_percent=best.levelled,
        residuals=check_residuals(
            sizes[1] * problem.left(fit), problem.inputs[start:], best.noise, best.whiteness,
            fit.structure.count - fit.structure.free,
        ),
        candidates=candidates,
        reason=reason,
        remarks=(*record.remarks, *_doubts(best.fit_percent, parameters, step * count)),
        record=record,
        predicted=np.concatenate([np.full(start, nan), response]),
        fitted=count,
    )  # fmt: skip


def _asked(structure: str | None) -> tuple[Structure, ...]:
    if structure is None:
        return STRUCTURES
    named = {each.name: each for each in STRUCTURES}
    if structure not in named:
        raise ValueError(f"structure is {structure!r}; choose one of: {'; '.join(named)}")
    return (named[structure],)


def _parted(record: Record, held_out: float) -> tuple[int, str]:
    """How many samples are fitted, and what to say where that is all of them."""
    count = record.u.size
    first = count - round(count * held_out)
    if first == count:
        return count, "nothing was held out"
    parts = (record.u[:first], record.u[first:])
    if any(part.size < LEAST or np.var(part) < MOVES * np.var(record.u) for part in parts):
        return count, (
            "nothing was held out, because the input does not move enough in both parts of the "
            "record to fit one and foretell the other"
        )
    return first, ""


def _judged(fit: Fit, whole: Problem, problem: Problem, inflation: float) -> _Judged:
    left = problem.left(fit)
    noise, whiteness = noise_of(left, fit.structure.count)
    used = problem.used[fit.start :]
    # As many samples as tell something new: with a memory a rich structure explains noise.
    effective = max(10.0, float(used.sum()) / inflation)
    return _Judged(
        fit,
        noise,
        whiteness,
        noise.covariance(fit.jacobian(problem.inputs) * used[:, None]),
        effective * log(fit.misfit) + fit.structure.count * log(effective),
        _percent(left[used], problem.outputs[fit.start :][used]),
        *_foretold(fit, whole, problem.outputs.size),
    )


def _foretold(fit: Fit, whole: Problem, first: int) -> tuple[float, float]:
    """Per cent of the held-out part that is explained, without and with its own level fitted."""
    if first == whole.outputs.size:
        return nan, nan
    columns, outputs = whole.columns(fit.structure, fit.shape, first)
    known, own = np.split(columns, [fit.structure.numerators], axis=1)
    rest = outputs - known @ fit.linear[: fit.structure.numerators]
    rest -= own @ np.linalg.lstsq(own, rest, rcond=None)[0]
    going_on = whole.left(fit)[first - fit.start :][whole.used[first:]]
    return _percent(going_on, outputs), _percent(rest, outputs)


def _percent(rest: FloatArray, outputs: FloatArray) -> float:
    spread = np.linalg.norm(outputs - outputs.mean())
    return float(100 * (1 - np.linalg.norm(rest) / spread)) if spread else nan


def _chosen(judged: list[_Judged], parting: str) -> tuple[_Judged, str]:
    """Take the smallest criterion, or a simpler structure that foretells better."""
    possible = [each for each in judged if np.isfinite(each.covariance).all()]
    if not possible:
        raise ValueError(
            "the record does not tell the numbers of the process from each other: let the input "
            "move more often, record longer or, if the plant answers at once, sample faster"
        )
    best = min(possible, key=lambda each: each.bic)
    reason = "of all structures it has the smallest Bayesian information criterion"
    if len(judged) == 1:
        reason = "it was asked for"
    for each in sorted(possible, key=lambda each: each.fit.structure.count):
        simpler = each.fit.structure.count < best.fit.structure.count
        if simpler and 100 - each.levelled < CLEARLY * (100 - best.levelled):
            reason = (
                f"it is simpler than {best.fit.structure.name}, which fits better but foretells "
                "the part held out less well"
            )
            best = each
            break
    return best, f"{reason}; {parting}".removesuffix("; ")


def _doubts(fit_percent: float, parameters: dict[str, Parameter], duration: float) -> Iterator[str]:
    """Say what makes a process doubtful that was found nevertheless."""
    if not fit_percent > LITTLE:
        yield (
            f"the input explains only {max(fit_percent, 0.0):.0f} % of the output: look whether "
            "these columns belong to each other and the plant needs longer than one sample, or "
            "make larger steps"
        )
    for name, found in parameters.items():
        if name == "gain":
            if found.low <= 0 <= found.high:
                yield (
                    "the gain may be zero, or of either sign: the record does not show that u acts "
                    "on y"
                )
        elif found.unit == "s" and abs(found.value) > duration:
            yield (
                f"the {name} of {found.value:.3g} s is longer than what was fitted, {duration:.3g} "
                "s: record longer"
            )
        elif found.unit == "s" and found.standard_error > max(abs(found.value), 0.1 * duration):
            yield (
                f"the {name} is hardly known ({found.value:.3g} ± {found.standard_error:.2g} s): "
                "let the input move more often"
            )


def _parameters(
    best: _Judged, problem: Problem, units: tuple[float, float], confidence: float
) -> tuple[dict[str, Parameter], FloatArray]:
    fit = best.fit
    names = Names(fit, best.covariance, *units)
    slopes = named_slopes(names, fit)
    covariance = slopes @ best.covariance @ slopes.T
    used = float(problem.used[fit.start :].sum())
    freedom = max(1.0, used / best.noise.inflation - fit.structure.count)
    reach = float(student.ppf(0.5 + confidence / 2, freedom))
    parameters = {}
    for (name, unit), value, error in zip(
        names.units.items(),
        names.values(fit.unknowns).tolist(),
        np.sqrt(np.diag(covariance)).tolist(),
        strict=True,
    ):
        low = value - reach * error
        if name == "dead time":
            low = max(low, 0.0)
        parameters[name] = Parameter(value, unit, error, low, value + reach * error)
    return parameters, covariance
