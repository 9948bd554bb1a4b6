"""A process out of a record: several structures fitted, one chosen, all of it shown.

Each structure is fitted to one part of the record, and then has to foretell the other part: the
state goes on, and nothing is fitted anew. Only then the one chosen is fitted to all of it. A drift
of the output is taken for what it is, a random walk, and not for dynamics. The plant rests before
the record, or moves, whichever is more likely.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ..diagram import DelayedTransferFunction, real_number
from ..numerics import FloatArray
from .choice import chosen, criterion, denied_sign, estimates, judge, mirrored, weighed
from .diagnostics import LITTLE, doubts, why_open
from .fitting import FEWEST, Problem, best_fit, simple_fit
from .parameters import CONFIDENCE, Parameter, corners_of, process_of
from .records import Record, checked_record, resolution
from .residuals import ResidualCheck, check_residuals
from .structures import STRUCTURES, Structure

__all__ = ["Candidate", "Identification", "identified", "identify"]

# Share of the input's variance, and samples, that each part of a record must have; and its last
# samples, in which a move of the input is hardly seen in y.
MOVES, LEAST, SEEN = 0.1, 50, 10


@dataclass(frozen=True)
class Candidate:
    """A structure that was tried.

    Attributes
    ----------
    structure, process : str, DelayedTransferFunction
        In words, and the process it gives.
    parameters : int
        How many numbers it has, without level and initial state.
    fit_percent, validation_percent : float
        How much of the output it explains in the part it was fitted to, and of the part that was
        held out; nan if none was.
    bic : float
        Bayesian information criterion against the best one, 0 for that one.
    rival : bool
        Whether it explains the record about as well as the one chosen.
    """

    structure: str
    parameters: int
    fit_percent: float
    validation_percent: float
    bic: float
    process: DelayedTransferFunction = field(repr=False)
    rival: bool = False


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
        Its numbers, with standard errors and intervals of 95 %.
    covariance : (n, n) array
        Of the parameters, in that order.
    fit_percent : float
        ``100 (1 - |y - model| / |y - mean of y|)`` in the part that was fitted first.
    validation_percent : float
        The same in the part held out, which that fit foretells; nan if none was held out. The
        process and its numbers are of the whole record.
    residuals : ResidualCheck
        Is what is left noise, and nothing of the input?
    candidates : tuple of Candidate
        All structures tried, from simple to rich.
    reason : str
        Why this one, in words.
    remarks : tuple of str
        What is doubtful, each with a remedy, the gravest first.
    unsure : str
        Why no loop should be designed for this process; empty where one may.
    corners : dict of str: DelayedTransferFunction
        The process with its numbers at the ends of their intervals, in all combinations.
    least_squares : DelayedTransferFunction or None
        One lag with dead time by least squares over the whole record, what disturbs it left aside;
        None where it explains far less.
    record : Record
        What was measured.
    predicted : (N,) array
        Output of the first fit, the part held out foretold; nan before the first sample compared.
    fitted : int
        How many samples, from the first on, were fitted first.
    """

    process: DelayedTransferFunction
    structure: str
    parameters: dict[str, Parameter]
    covariance: FloatArray
    fit_percent: float
    validation_percent: float
    residuals: ResidualCheck
    candidates: tuple[Candidate, ...]
    reason: str
    remarks: tuple[str, ...]
    unsure: str
    corners: dict[str, DelayedTransferFunction]
    least_squares: DelayedTransferFunction | None
    record: Record
    predicted: FloatArray
    fitted: int

    def __repr__(self) -> str:
        held = self.validation_percent
        foretold = "nothing held out" if np.isnan(held) else f"held-out part {held:.1f} %"
        heading = f"{'':18} {'value':>10} {'':6} {100 * CONFIDENCE:9.3g} % interval"
        rows = [f"{self.structure}: fit {self.fit_percent:.1f} %, {foretold}", heading]
        rows += (
            f"{name:18} {p.value:10.4g} {p.unit:6} {p.low:10.4g} to {p.high:.4g}"
            for name, p in self.parameters.items()
        )
        return "\n".join([*rows, self.residuals.reason, *self.remarks])


def identify(
    t: Any,
    u: Any = None,
    y: Any = None,
    *,
    structure: str | None = None,
    held_out: float = 0.5,
    input_before: float | None = None,
) -> Identification:
    r"""Fit a process with dead time to a step or any other test signal.

    Integrators, one and two lags (two may be a resonance) with dead time, with and without a zero,
    are fitted: the input is held between samples, the dead time need not be a whole number of them,
    and nothing is approximated. The most likely numbers are found under noise of the sensor, its
    memory, and a drift of y: a random walk with a slow wave beside it, or a smooth one. The plant
    must be stable or an integrator, and must not be under control while it is measured. A stop into
    which y runs is seen; one that it creeps up to is not, and the gain is then too small.

    The structure is the one of smallest Bayesian information criterion over the whole record, the
    part held out included, or a simpler one from which the record does not tell it; an integrator
    must be told from every lag. Passed over, if there is another, is one that foretells the part
    held out worse than a constant, one whose gain may be zero, one whose lag is longer than the
    record, one that moves by itself though y rests until the input moves, and one that explains
    both parts far worse than one no richer.

    Parameters
    ----------
    t : (N,) array_like or Record
        Evenly spaced times, in seconds; or what `read_data` has read, with all that it noticed.
    u, y : (N,) array_like
        Input, held from each sample to the next, and output; not beside a record.
    structure : str, optional
        One of `nrdob.measured.STRUCTURES` by name; by default it is chosen.
    held_out : float
        Share of the record, at its end, on which the process is tried before all of it is fitted;
        0 for none. None is held out, too, where the input does not move enough in both parts.
    input_before : float, optional
        Input before the record, under which the plant was at rest; of a record `read_data` takes
        it.

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
    if not isinstance(t, Record):
        record = checked_record(t, u, y, input_before=input_before)
    elif u is None and y is None and input_before is None:
        record = t
    else:
        raise TypeError(
            "a record holds u, y and what the input was before it: give identify the record alone, "
            "and input_before to read_data"
        )
    if not 0 <= real_number(held_out, "held_out", "give a number, such as 0.5") < 0.9:
        raise ValueError(f"held_out is {held_out}; it must be between 0 and 0.9")
    for remark in record.remarks:
        warnings.warn(remark, UserWarning, stacklevel=2)
    structures = tuple(each for each in STRUCTURES if structure in (None, each.name))
    if not structures:
        names = "; ".join(each.name for each in STRUCTURES)
        raise ValueError(f"structure is {structure!r}; choose one of: {names}")
    return identified(record, structures, held_out)


def identified(
    record: Record, structures: tuple[Structure, ...] = STRUCTURES, held_out: float = 0.5
) -> Identification:
    """Do what `identify` does, for a record that was checked.

    Parameters
    ----------
    record : Record
        The record.
    structures : tuple of Structure
        Those that are tried.
    held_out : float
        As for `identify`.

    Raises
    ------
    ValueError
        If the numbers of the process cannot be told from the record.
    """
    # The matrices are small: several threads would wait for each other most of the time.
    with threadpool_limits(limits=1, user_api="blas"):
        return _found(record, structures, held_out)


def _found(record: Record, structures: tuple[Structure, ...], held_out: float) -> Identification:
    sizes = np.ptp(np.append(record.inputs, 0.0)), np.ptp(record.y[record.free])
    inputs, outputs = record.inputs / sizes[0], (record.y - record.y[0]) / sizes[1]
    every = np.arange(outputs.size)  # across what was not measured, for the memory of the filters
    outputs = np.interp(every, every[record.free], outputs[record.free])
    whole = Problem(inputs, outputs, record.free, resolution(record.y) / float(sizes[1]))
    count, parting = _parted(record, held_out)
    problem = whole.part(slice(count))
    # An integrator moves, for nobody knows the input that keeps it at rest, unless it was said.
    known = record.input_before is not None
    begun = [
        [best_fit(each, problem, moving) for moving in {each.integrates and not known, not known}]
        for each in structures
    ]
    # Where the input before the record is not known, the samples that the dead time keeps it alive
    # for are left out, the same for all, so that they can be compared.
    leading = min(
        (fit for each in begun for fit in each),
        key=lambda fit: (problem.hides(fit), criterion(fit, count)),
    )
    start = 0 if known else min(ceil(leading.shape[0]) + 1, count // 2)
    units = record.sampling_time, float(sizes[1] / sizes[0])
    judged = [judge(weighed(each, problem, start), whole, problem, units) for each in begun]
    best, rivals, reason = chosen(judged, count)
    if count < outputs.size:  # what was held out has been foretold: now it counts, too
        problem, place = whole, judged.index(best)
        fit = weighed(begun[place], whole, start)
        parameters, covariance = estimates(fit, whole, units)
        best = replace(best, fit=fit, parameters=parameters, covariance=covariance)
        judged[place] = best
    fit = best.fit
    rest = sizes[1] * np.where(problem.used[start:], problem.left(fit), 0.0)
    residuals = check_residuals(rest, problem.inputs[start:], fit.structure.told)
    follows = residuals.independent is False
    needless = (best.fit_percent < LITTLE and not follows) and (
        criterion(fit, problem.samples(start)) > problem.criterion_without(start)
    )
    least = min(each.bic for each in judged)
    candidates = tuple(
        Candidate(
            each.fit.structure.name, each.fit.structure.told,
            each.fit_percent, each.validation, each.bic - least,
            process_of(each.fit, *units), each in rivals,
        )
        for each in judged
    )  # fmt: skip
    # What it does by itself is a ramp, and so is its answer to a step as the record begins.
    alike = fit.structure.integrates and fit.moving and not np.diff(record.u)[FEWEST:].any()
    turned = not known and mirrored(fit, problem)
    parameters, denied = denied_sign(best, rivals, judged, needless or alike, turned)
    open_gain, remedy = why_open(
        parameters["gain"], follows, best.unsettled and not (denied or needless), alike
    )
    remarks = doubts(
        record, parameters, (best.fit_percent, best.validation, follows),
        f"{open_gain}: {remedy}" if open_gain else "",
        sizes[1] * np.where(record.free[start:], whole.left(fit), 0.0), fit,
    )  # fmt: skip
    simple = simple_fit(whole, fit)
    vetoed = "the process foretells the part held out worse than a constant would"
    unsure = (vetoed if best.validation < 0 else "", open_gain)
    return Identification(
        process=process_of(fit, *units),
        structure=fit.structure.name,
        parameters=parameters,
        covariance=best.covariance,
        fit_percent=best.fit_percent,
        validation_percent=best.validation,
        residuals=residuals,
        candidates=candidates,
        reason=f"{reason}; {parting}".removesuffix("; "),
        remarks=(*denied, *remarks, *record.remarks),
        unsure=", and ".join(filter(None, unsure)),
        corners=corners_of(fit.structure, parameters),
        least_squares=process_of(simple, *units) if simple else None,
        record=record,
        predicted=sizes[1] * best.predicted + record.y[0],
        fitted=count,
    )  # fmt: skip


def _parted(record: Record, held_out: float) -> tuple[int, str]:
    """How many samples are fitted, and what to say where that is all of them."""
    count = record.u.size
    first = count - round(count * held_out)
    if first == count:
        return count, "nothing was held out"
    u = np.append(0.0, record.inputs)
    parts = [part[:-SEEN] for part in (u[: first + 1], u[first + 1 :])]
    if any(part.size < LEAST - SEEN or np.var(part) < MOVES * np.var(u) for part in parts):
        return count, (
            "nothing was held out, because the input does not move enough in both parts of the "
            "record to fit one and foretell the other"
        )
    return first, ""
