r"""Time responses of the NR-DOB loop, exact with dead time.

Every response is computed twice, in two units of time, by one of the ways of `nrdob.analysis.ways`.
Where rounding makes the ninth digit differ it is refused: there is no such thing here as a response
that is only nearly right.
"""

from __future__ import annotations

from functools import cache
from math import inf, log10, pi
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import fftconvolve

from ..diagram import LoopEquations
from ..numerics import FloatArray, roots_by_time_scale
from .ways import Solver, Way, even_step, maps, ways

__all__ = ["even_times", "forced_response", "step_response"]

SETTLED = 0.002  # distance from its end, against its span, at which a response has settled
POINTS = 1001  # times in a default window
_SHORTER = 8.0  # where a window is refused, the next one tried is that much shorter
_SHORTEST = _SHORTER**39  # how much shorter the last one is
_DIRECT_CONVOLUTION = 10_000  # samples up to which sums are direct

_AGREEMENT = 1e-10  # of the size of a signal: what may hang on rounding
_TRACE = 1e-6  # of the jump at t = 0, against which what has died out is measured
_GRID = 32  # times at which each response is looked at, besides some of those asked for
_SPOT_CHECKS = 9


def step_response(
    loop: LoopEquations, input: str, timepts: ArrayLike | None = None
) -> ct.TimeResponseData:
    r"""Response of y and u to a unit step at t = 0, all signals zero before.

    Parameters
    ----------
    loop : LoopEquations
        Stable or not.
    input : {"R", "d", "delta", "eta"}
        Where the step enters: reference, output disturbance, input disturbance or noise.
    timepts : (N,) array_like or float, optional
        Increasing times from 0 on, in seconds; evenly spaced ones are fastest. A number is the
        last of 1,001 times, by default when y and u have settled, or after a few e-foldings of an
        unstable loop; earlier where that cannot be computed.

    Returns
    -------
    control.TimeResponseData
        `time` (N,), `inputs` (1, 1, N) and `outputs` (2, 1, N) as `control.step_response` shapes
        them for one input and two outputs: `outputs[0, 0]` is y, `outputs[1, 0]` is u. As in
        eq. (7), u is the controller output for R, d and eta, and the plant input u + δ for delta.
        Where a signal jumps, its value is the one just after the jump; once an unstable loop
        has left the floating-point range, it is nan.

    Raises
    ------
    ValueError, ArithmeticError
        If the input or the times cannot be, or the loop is ill-posed; if nine digits of the largest
        value since t = 0 cannot be had, or not within some seconds.

    Examples
    --------
    >>> from nrdob.diagram import LowPassFilter, delay
    >>> Gm = ct.tf([1], [1, 1])
    >>> loop = LoopEquations(delay(1.0) * Gm, Gm, 1.0, LowPassFilter(2.0, 1))
    >>> y, u = step_response(loop, "d", [0.0, 0.5, 1.0]).outputs[:, 0]
    >>> y.round(6).tolist(), u.round(6).tolist()
    ([1.0, 1.0, 1.0], [-0.5, -0.75, -1.0])
    """
    _check(loop, input)
    if timepts is None:
        times, outputs = _default_response(loop, input)
    else:
        times = _checked_times(timepts)
        outputs = _prepared(loop, input, float(times[-1]))(times)
    more = {"trace_labels": [f"From {input}"], "trace_types": ["step"], "plot_inputs": False}
    inputs = np.ones((1, 1, times.size))
    return _data(times, outputs[:, np.newaxis], inputs, input, "Step response", **more)


def forced_response(
    loop: LoopEquations, input: str, timepts: ArrayLike, inputs: ArrayLike
) -> ct.TimeResponseData:
    """Response of y and u to a sampled input, piecewise linear between its samples.

    Parameters
    ----------
    loop, input : LoopEquations, {"R", "d", "delta", "eta"}
        As for `step_response`.
    timepts : (N,) array_like
        Evenly spaced times from 0 on, N >= 2, in seconds.
    inputs : (N,) array_like
        The signal at these times; zero before, so that it may jump at t = 0.

    Returns
    -------
    control.TimeResponseData
        `time` (N,), `inputs` (1, N) and `outputs` (2, N) with rows y and u, as
        `control.forced_response` shapes them.

    Raises
    ------
    ValueError, ArithmeticError
        As `step_response`; or if `timepts` is not evenly spaced from 0, or `inputs` does not
        hold one finite number for each time.

    Examples
    --------
    >>> from nrdob.diagram import LowPassFilter
    >>> G = ct.tf([1], [1, 1])
    >>> loop = LoopEquations(G, G, 1.0, LowPassFilter(1.0, 1))
    >>> response = forced_response(loop, "R", [0.0, 1.0, 2.0], [0.0, 1.0, 2.0])
    >>> response.outputs[0].round(6).tolist()          # T_R = 1/(s + 2)
    [0.0, 0.283834, 0.754579]
    """
    _check(loop, input)
    times = _checked_times(timepts)
    signal = _real(inputs, "inputs", "give one real number for each time")
    step = even_step(times)
    if step is None or times[0] != 0:
        raise ValueError("timepts must be evenly spaced from 0, two or more: np.linspace(0, …)")
    if signal.shape != times.shape or not np.isfinite(signal).all():
        raise ValueError(
            f"inputs has shape {signal.shape}; it needs one finite number for each of the "
            f"{times.size} timepts"
        )
    unit, ramp = (_prepared(loop, input, float(times[-1]), order)(times) for order in (1, 2))
    # The input is a sum of hats, one around each sample; the first is cut in half at t = 0.
    # Hat responses die out where ramp responses grow, so that long records lose no digits.
    rise = np.diff(ramp, axis=1, prepend=0.0) / step
    hat = np.diff(rise, axis=1, append=0.0)[:, :-1]
    outputs = signal[0] * (unit - rise)
    # Direct sums are causal to the last digit; the FFT is for records too long for them.
    convolve = np.convolve if signal.size <= _DIRECT_CONVOLUTION + 1 else fftconvolve
    for row, pulse in zip(outputs, hat, strict=True):
        row[1:] += convolve(signal[1:], pulse)[: signal.size - 1]
    return _data(times, outputs, signal[np.newaxis], input, "Forced response")


def _data(
    times: FloatArray, outputs: FloatArray, inputs: FloatArray, input: str, kind: str, **more: Any
) -> ct.TimeResponseData:
    return ct.TimeResponseData(
        times, outputs, inputs=inputs, issiso=False, output_labels=["y", "u"],
        input_labels=[input], title=f"{kind} to {input}", **more,
    )  # fmt: skip


def _check(loop: LoopEquations, input: str) -> None:
    maps(loop, input)  # refuses what is no input
    if loop.ill_posed:
        raise ValueError(f"no time response: {loop.ill_posed}")


def _checked_times(timepts: ArrayLike) -> FloatArray:
    times = _real(timepts, "timepts", "give times in seconds, or the last one, as real numbers")
    if times.ndim == 0:
        times = np.linspace(0.0, float(times), POINTS) if 0 < times < inf else np.full(2, np.nan)
    if times.ndim != 1 or times.size == 0:
        raise ValueError(f"timepts has shape {times.shape}; it must be a non-empty 1-D array")
    if not (np.isfinite(times).all() and times[0] >= 0 and (np.diff(times) > 0).all()):
        raise ValueError("timepts must be finite and increasing from 0 or later, in seconds")
    return times


def _real(values: ArrayLike, name: str, remedy: str) -> FloatArray:
    """Read real numbers, or raise TypeError with the remedy."""
    try:
        array = np.asarray(values)
        if np.iscomplexobj(array) and array.imag.any():
            raise TypeError("complex numbers")
        return array.real.astype(float)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name} is {values!r}; {remedy}") from error


def _prepared(loop: LoopEquations, input: str, horizon: float, integrals: int = 1) -> Solver:
    """Prepare y and u up to a horizon, for as many sets of times as are asked for."""
    jumps = np.array([quotient.at_infinity[0] for quotient in maps(loop, input)])
    solver = cache(lambda way, attempt: way(loop, input, horizon, integrals, attempt))

    def solve(times: FloatArray) -> FloatArray:
        # Compared are some of the times, and others, evenly up to the last, that show the size.
        few, grid = _SPOT_CHECKS, times[-1] * np.arange(1, _GRID + 1) / _GRID
        if times.size > _GRID and not times[0] and even_step(times) is not None:
            few, grid = _SPOT_CHECKS + _GRID, grid[:0]
        asked = np.unique(np.linspace(0, times.size - 1, few).astype(int))
        reason = ""

        def both(way: Way, attempt: int, times: FloatArray) -> tuple[FloatArray, FloatArray]:
            found = solver(way, attempt)
            return found(times), found(grid) if grid.size else np.zeros((2, 0))

        for way in ways(loop, horizon):
            try:
                with np.errstate(all="ignore"):
                    outputs, seen = both(way, 0, times)
                    pair = both(way, 1, times[asked])
            except (ValueError, ArithmeticError) as refusal:
                reason = reason or str(refusal)
                continue
            # At t = 0 the value just after the jump, which the leading coefficients give.
            at_once = jumps[:, np.newaxis] if integrals == 1 else 0.0
            outputs[:, times == 0] = pair[0][:, times[asked] == 0] = at_once
            found, again = np.hstack([outputs[:, asked], seen]), np.hstack(pair)
            size = _largest(np.hstack([outputs, seen]))
            size = np.maximum(size, _TRACE * np.minimum(np.abs(jumps), 1.0))
            if (_largest(found - again) <= _AGREEMENT * size).all():
                outputs[~np.isfinite(outputs)] = np.nan
                return outputs
            reason = reason or (
                f"the response to {input} over {times[-1]:g} s cannot be given to nine digits: "
                "they hang on the last digits of the coefficients, as a mode turns or grows too "
                "often in this time or nearly cancels; shorten timepts, or give blocks without "
                "what cancels"
            )
        raise ArithmeticError(reason)

    return solve


def _largest(signals: FloatArray) -> FloatArray:
    """Largest size of y and of u; what has left the floating-point range does not count."""
    finite = np.isfinite(signals)
    return np.asarray(np.abs(np.where(finite, signals, 0.0)).max(axis=1))


# The default window: long enough to settle, short enough to see.


def _default_response(loop: LoopEquations, input: str) -> tuple[FloatArray, FloatArray]:
    """Choose evenly spaced times over what there is to see and can be computed, and respond."""
    window, settles = _estimate(loop, input)
    shortest = window / _SHORTEST
    while True:
        try:
            times = even_times(window)
            respond = _prepared(loop, input, float(times[-1]))
            if settles:
                times = even_times(_settling_time(respond, window))
            return times, respond(times)
        except (ValueError, ArithmeticError):
            if window <= shortest:
                raise
            window /= _SHORTER


def even_times(window: float) -> FloatArray:
    """Return times from 0 to `window`, rounded up to 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** np.floor(log10(window))
    nice = next(factor for factor in (1, 2, 5, 10) if factor * decade >= window * (1 - 1e-9))
    return np.linspace(0.0, nice * decade, POINTS)


def _estimate(loop: LoopEquations, input: str) -> tuple[float, bool]:
    """Time in seconds after which nothing is left to see, and whether the response settles."""
    factors = [loop.p_A, loop.p_B] if input == "R" else [loop.p_B]
    try:
        with np.errstate(all="ignore"):
            each = [p.roots if p.delay else roots_by_time_scale(p.q) for p in factors]
    except ArithmeticError:  # so long a delay that it alone sets the pace
        factors, each = [loop.p_B], [np.zeros(0, dtype=complex)]
    roots = np.concatenate(each)
    on_axis = np.concatenate([p.near_axis(own) for p, own in zip(factors, each, strict=True)])
    rates, swings = roots.real[~on_axis], np.abs(roots.imag[on_axis])
    longest = max(loop.delay, loop.model_delay)
    growth, decay = max(rates, default=0.0), -max(rates[rates < 0], default=-inf)
    if growth > 0:
        return max(6 / growth, 3 * longest), False
    periods = 10 * pi / min(swings[swings > 0], default=inf)
    # Neither modes nor dead time: any window will do.
    return max(12 / decay + 5 * longest, periods) or 10.0, True


def _settling_time(respond: Solver, window: float) -> float:
    """Time from which y and u stay near where they are at the end of `window`, seconds."""
    final: FloatArray | None = None
    while True:
        times = np.linspace(0.0, window, POINTS)
        outputs = respond(times)
        final = outputs[:, -1:] if final is None else final
        span = np.ptp(np.hstack([outputs, final]), axis=1, keepdims=True)
        moving = np.flatnonzero((np.abs(outputs - final) > SETTLED * span).any(axis=0))
        last = min(int(moving[-1]) + 1 if moving.size else 0, POINTS - 1)
        if last > POINTS // 20 or last == 0:
            return float(times[last]) or window
        window = 2 * float(times[last])  # the slowest mode hardly shows: look closer
