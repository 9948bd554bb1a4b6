"""What makes a process doubtful that was found nevertheless, each with its remedy."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.ndimage import median_filter
from scipy.signal import lfilter
from scipy.stats import chi2, norm

from ..numerics import FloatArray
from .fitting import Fit
from .parameters import Parameter
from .records import BEFORE, Record
from .residuals import products, whitening_of

__all__ = ["LITTLE", "doubts", "why_open"]

LITTLE = 30.0  # per cent of the output explained below which a process is doubtful
SETTLED = 2.0  # lags that a record must last after the input first moves
FAR = 8.0  # deviations from the samples around it at which a sample is an outlier
TAIL = 0.95  # share of the samples from the rest of which the tails of the noise are seen
DRIFTED = 0.05  # share of the output's range from which on a drift is told
PAST = 20  # samples over which a controller is looked for
# Correlation of u with what disturbed y, and its probability by chance, that tell of one.
FEEDBACK, NEVER = 0.3, 1e-6
LEVELS = 12  # limits of the actuator that are tried
# Misfit with a limit, against that without and against y itself, that tells of one.
CLIPPED, EXPLAINED = 0.7, 0.1
# Deviations by which the response's square counts, and by how much the gain then changes over y.
CURVED, GROWN = 4.4, 1.25
MOVES = 3  # steps of the input from which on that is looked at


def doubts(
    record: Record,
    parameters: dict[str, Parameter],
    worth: tuple[float, float, bool],
    open_gain: str,
    residual: FloatArray,
    fit: Fit,
) -> tuple[str, ...]:
    """Look for all that is known to mislead a fit; the gravest first.

    Worth: per cent explained of the part fitted and of that held out, and whether the residual, in
    units of y from the start of the fit on, still follows the input. Open_gain: what to do where
    the gain is open, or empty.
    """
    return (
        *_worth(*worth, open_gain),
        *_closed_loop(record, residual, fit),
        *(tuple(_limited(record, fit)) or _curved(record, residual, fit)),
        *_short(record, parameters),
        *_outliers(record, residual, fit.start),
        *_drift(record, residual, fit),
    )


def why_open(gain: Parameter, follows: bool, unsettled: bool, alike: bool) -> tuple[str, str]:
    """Say why a gain may be zero, and what to do about it; two empty texts if it may not.

    Follows: the residual still follows the input; unsettled: gain and lag are not told apart;
    alike: what an integrator does by itself looks like its answer to the input.
    """
    if not gain.low <= 0 <= gain.high:
        return "", ""
    if alike:
        return (
            "u moves only as the record begins, where y may have been moving already, so that the "
            "gain of the integrator is open",
            f"begin the record well before the step; or, if the plant was at rest, {BEFORE}",
        )
    if unsettled:
        return (
            "y does not come to rest in the record, so that the gain is not told from the lag",
            "record longer",
        )
    if follows:
        return (
            "the structure leaves so much of what u does to y unexplained that its gain is open",
            "try another one, or look for what else moves y",
        )
    return (
        "the gain of the process may be zero, or of either sign",
        "the record does not show that u acts on y; make a larger step, or repeat it",
    )


def _worth(fitted: float, foretold: float, follows: bool, open_gain: str) -> Iterator[str]:
    if foretold < 0:
        yield (
            "the part held out is foretold worse than a constant would: the process changes, "
            "something else moves y, or the record is too short; repeat the measurement"
        )
    if open_gain:
        yield open_gain
    if not fitted > LITTLE and not follows:
        yield (
            f"the input explains only {max(fitted, 0.0):.0f} % of the output: look whether "
            "these columns belong to each other and the plant needs longer than one sample, or "
            "make larger steps"
        )


def _short(record: Record, parameters: dict[str, Parameter]) -> Iterator[str]:
    moved = int(np.flatnonzero(record.inputs)[0])
    duration = record.sampling_time * (record.t.size - moved)
    for name, found in parameters.items():
        if found.unit != "s":
            continue
        if name.endswith("lag") and SETTLED * found.value > duration:
            yield (
                f"the record is short: {duration:.3g} s from the first move of the input on, for a "
                f"{name} of {found.value:.3g} s; record at least three times as long as the lag"
            )
        elif found.standard_error > max(abs(found.value), 0.1 * duration):
            error = found.standard_error
            about = f" ({found.value:.3g} ± {error:.2g} s)" * (error < duration)
            slow = found.value > record.sampling_time
            remedy = "let the input move more often" if slow else "sample faster"
            yield f"the {name} is hardly known{about}: {remedy}"


def _outliers(record: Record, residual: FloatArray, start: int) -> Iterator[str]:
    """Find samples whose residual is far from the two on either side.

    Far is what neither the noise, with its tails, nor the steps in which y usually changes explain.
    """
    apart = np.abs(residual - median_filter(residual, 5, mode="mirror"))
    steps = np.abs(np.diff(record.y))
    tail = float(np.quantile(apart, TAIL)) / float(norm.ppf(0.5 + TAIL / 2))
    scale = max(tail, float(np.median(steps[steps > 0])))
    far = np.flatnonzero(apart > FAR * scale)
    if far.size:
        k = start + int(far[np.argmax(apart[far])])
        said = "an outlier," if far.size == 1 else f"{far.size} outliers, such as"
        yield (
            f"y has {said} {record.y[k]:g} at {record.t[k]:g} s: correct such samples or replace "
            "them by their neighbours, for they pull the fit"
        )


def _drift(record: Record, residual: FloatArray, fit: Fit) -> Iterator[str]:
    innovations = fit.whitening.applied(residual)
    walked = fit.whitening.walked(float(innovations.std()), record.y.size)
    if fit.whitening.theta < 1:  # more than at random where it goes on in its direction
        tenth = residual.size // 10
        walked = max(walked, abs(float(residual[-tenth:].mean() - residual[:tenth].mean())))
    if walked > DRIFTED * np.ptp(record.y[record.free]):
        yield (
            f"y drifts, by about {walked:.2g} over the record, without the input's "
            "doing; the intervals count that in: let the plant come to rest before the record, or "
            "make larger steps and more of them"
        )


def _closed_loop(record: Record, residual: FloatArray, fit: Fit) -> Iterator[str]:
    """See whether u answers what disturbs y, against the plant's gain, as a controller does."""
    moves = np.diff(record.inputs, prepend=0.0)[fit.start :]
    fresh = _fresh(moves)
    if fresh is None:
        return
    e = whitening_of(residual).applied(residual)[-fresh.size :]
    e = np.clip(e, *np.quantile(e, [0.02, 0.98]))
    e = e - e.mean()
    size = np.sqrt(float(e @ e) * float(fresh @ fresh))
    if not size:
        return
    # In the same sample only if the plant cannot have answered within it.
    found = products(fresh, e, PAST)[int(fit.shape[0] < 1) :] * e.size / size
    chance = float(chi2.sf(e.size * float(found @ found), found.size))
    found *= -np.sign(fit.linear[0])
    if chance < NEVER and found.max() > FEEDBACK:
        yield (
            "u follows what disturbed y before: the plant was under control while it was measured, "
            "and the fit may show the controller instead; open the loop, or move the set point and "
            "trust only what the held-out part confirms"
        )


def _fresh(moves: FloatArray) -> FloatArray | None:
    """Give what its own past does not tell of an input that always moves; None of any other."""
    if np.count_nonzero(moves) < moves.size / 2 or moves.size < 5 * PAST:
        return None
    own = products(moves, moves, PAST + 1)
    own[0] *= 1 + 1e-9
    past = solve_toeplitz(own[:-1], own[1:])
    fresh = lfilter(np.concatenate([[1.0], -past]), [1.0], moves)[PAST:]
    low, high = np.quantile(fresh, [0.05, 0.95])
    if high - low < 1e-6 * np.ptp(moves):
        return None
    fresh = np.clip(fresh, low, high)
    return np.asarray(fresh - fresh.mean())


def _curved(record: Record, residual: FloatArray, fit: Fit) -> Iterator[str]:
    """See whether the square of the response explains what no other numbers of the fit would.

    A linear plant answers as much at high outputs as at low ones (Ramsey, J. Royal Statistical
    Society B 31, 1969, 350-371). An integrator has no level to which its answers belong, and after
    a single step or two the square is one more transient, such as a drift may look like.
    """
    if fit.structure.integrates or np.count_nonzero(np.diff(record.inputs)) < MOVES:
        return
    inputs = record.inputs / np.ptp(np.append(record.inputs, 0.0))
    response = fit.response(inputs)
    level = response - response.mean()
    whitening = fit.whitening if fit.whitening.theta < 1 else whitening_of(residual)
    rest = residual / np.ptp(record.y[record.free])
    columns = whitening.applied(np.column_stack([fit.jacobian(inputs), level**2, rest]))
    corner = np.asarray(np.linalg.qr(columns[record.free[fit.start :]], mode="r"))[-2:, -2:]
    left = abs(corner[1, 1]) / np.sqrt(max(len(columns) - columns.shape[1], 1))
    if abs(corner[0, 1]) <= CURVED * left or not corner[0, 0]:
        return
    low, high = 1 + 2 * corner[0, 1] / corner[0, 0] * np.quantile(level, [0.05, 0.95])
    if max(low, high) > GROWN * max(min(low, high), 0.0):
        yield (
            "what is left follows the square of the response: the plant answers otherwise at high "
            "values of the output than at low ones, it is not linear, and the intervals do not "
            "cover that; make smaller steps about the point at which it is to run"
        )


def _limited(record: Record, fit: Fit) -> Iterator[str]:
    """Try whether y is explained far better if the input is cut off."""
    inputs = record.inputs
    levels = np.unique(np.quantile(inputs, np.linspace(0, 1, LEVELS + 2)))
    if levels.size < 3:
        return
    outputs = record.y[fit.start :]

    def misfit(inputs: FloatArray) -> float:
        columns = fit.structure.columns(fit.shape, inputs, fit.start, fit.moving)
        rest = outputs - columns @ np.linalg.lstsq(columns, outputs, rcond=None)[0]
        return float(rest @ rest)

    plain = misfit(inputs)
    least, side, level = min(
        (misfit(cut(inputs, level)), side, level)
        for cut, side in ((np.minimum, "above"), (np.maximum, "below"))
        for level in levels[1:-1]
    )
    level += record.u[0] - inputs[0]
    if least < min(CLIPPED * plain, EXPLAINED * outputs.size * float(np.var(outputs))):
        yield (
            f"the plant answers as if u were cut off {side} {level:g}: the actuator looks "
            "saturated there; keep the steps inside its limits"
        )
