r"""Time responses of the NR-DOB loop, exact with dead time.

The loop is kept as the blocks that run it: the process rational part G0, the observer with its two
inputs u and y + η, and, for a reference, the prefilter to which the model loop collapses because
E/R = 1/(1 + Gm C)::

    y = G0 z + d       u = (Nc Dm/p_A) R + F u - (F/Gm)(y + η)       v = u + δ       z(t) = v(t - θ)

One signal v is delayed, everything else is a linear system. Without dead time z = v closes it and
matrix exponentials are the answer. With dead time z is known on every interval of length θ from
the interval before (the method of steps): the interval is cut into panels on which signals are
polynomials through Chebyshev nodes, and one matrix leads from any panel to the next. Jumps fall on
panel borders, so that no polynomial ever crosses one. What is left is rounding: some 1e-14 of the
signal, and more only where millions of delays are marched through.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import fftconvolve

from .blocks import FloatArray, Fraction
from .equations import LoopEquations
from .steps import delayed_response
from .timescales import impulse_states, split
from .window import default_times

INPUTS = ("R", "d", "delta", "eta")
OUTPUTS = ("y", "u")

MAX_PANELS = 400_000
"""Panels that fit into memory, for a loop faster than its dead time."""

_DEGREE = 16
_PANEL_REACH = 2.0  # fastest rate times panel length: degree 16 then leaves nothing but rounding
_DIRECT_CONVOLUTION = 10_000


def step_response(
    loop: LoopEquations, input: str, timepts: ArrayLike | None = None
) -> ct.TimeResponseData:
    r"""Response of y and u to a unit step at t = 0, all signals zero before.

    Parameters
    ----------
    loop : LoopEquations
        The loop, stable or not.
    input : {"R", "d", "delta", "eta"}
        Where the step enters: reference, output disturbance, input disturbance or noise.
    timepts : (N,) array_like, optional
        Increasing times from 0 on, in seconds; evenly spaced ones are fastest. By default
        1,001 points until y and u have settled, or over a few e-foldings of an unstable loop.

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
    ValueError
        If `input` is none of the four, `timepts` is not increasing from 0 or later, the loop is
        ill-posed, or, with dead time, `timepts` spans over `MAX_PANELS` of its fastest modes.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob.delay import delay
    >>> from nrdob.filters import LowPassFilter
    >>> Gm = ct.tf([1], [1, 1])
    >>> loop = LoopEquations(delay(1.0) * Gm, Gm, 1.0, LowPassFilter(2.0, 1))
    >>> y, u = step_response(loop, "d", [0.0, 0.5, 1.0]).outputs[:, 0]
    >>> y.tolist(), [round(float(value), 12) for value in u]
    ([1.0, 1.0, 1.0], [-0.5, -0.75, -1.0])
    """
    _check(loop, input)
    if timepts is None:
        times = default_times(loop, input, lambda times: _response(loop, input, times))
    else:
        times = _checked_times(timepts)
    outputs = _response(loop, input, times)[:, np.newaxis]
    return ct.TimeResponseData(
        times,
        outputs,
        inputs=np.ones((1, 1, times.size)),
        issiso=False,
        output_labels=list(OUTPUTS),
        input_labels=[input],
        title=f"Step response to {input}",
        trace_labels=[f"From {input}"],
        trace_types=["step"],
        plot_inputs=False,
    )


def forced_response(
    loop: LoopEquations, input: str, timepts: ArrayLike, inputs: ArrayLike
) -> ct.TimeResponseData:
    """Response of y and u to a sampled input, piecewise linear between its samples.

    Parameters
    ----------
    loop : LoopEquations
        The loop, stable or not.
    input : {"R", "d", "delta", "eta"}
        Where the signal enters, see `step_response`.
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
    ValueError
        As `step_response`; or if `timepts` is not evenly spaced from 0, or `inputs` does not
        hold one finite number for each time.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob.filters import LowPassFilter
    >>> G = ct.tf([1], [1, 1])
    >>> loop = LoopEquations(G, G, 1.0, LowPassFilter(1.0, 1))
    >>> response = forced_response(loop, "R", [0.0, 1.0, 2.0], [0.0, 1.0, 2.0])
    >>> response.outputs[0].round(6).tolist()          # T_R = 1/(s + 2)
    [0.0, 0.283834, 0.754579]
    """
    _check(loop, input)
    times, signal = _checked_times(timepts), np.asarray(inputs, dtype=float)
    step = _even_step(times)
    if step is None or times[0] != 0:
        raise ValueError("timepts must be evenly spaced from 0, two or more: np.linspace(0, …)")
    if signal.shape != times.shape or not np.isfinite(signal).all():
        raise ValueError(
            f"inputs has shape {signal.shape}; it needs one finite number for each of the "
            f"{times.size} timepts"
        )
    unit, ramp = (_response(loop, input, times, integrals) for integrals in (1, 2))
    # The input is a sum of hats, one around each sample; the first is cut in half at t = 0.
    # Hat responses die out where ramp responses grow, so that long records lose no digits.
    rise = np.diff(ramp, axis=1, prepend=0.0) / step
    hat = np.diff(rise, axis=1, append=0.0)[:, :-1]
    outputs = signal[0] * (unit - rise)
    for row, pulse in zip(outputs, hat, strict=True):
        row[1:] += _convolve(signal[1:], pulse)
    return ct.TimeResponseData(
        times,
        outputs,
        inputs=signal[np.newaxis],
        issiso=False,
        output_labels=list(OUTPUTS),
        input_labels=[input],
        title=f"Forced response to {input}",
    )


def _check(loop: LoopEquations, input: str) -> None:
    if input not in INPUTS:
        raise ValueError(f"input is {input!r}; it must be one of {', '.join(map(repr, INPUTS))}")
    if loop.ill_posed:
        raise ValueError(f"no time response: {loop.ill_posed}")


def _checked_times(timepts: ArrayLike) -> FloatArray:
    times = np.asarray(timepts, dtype=float)
    if times.ndim != 1 or times.size == 0:
        raise ValueError(f"timepts has shape {times.shape}; it must be a non-empty 1-D array")
    if not (np.isfinite(times).all() and times[0] >= 0 and (np.diff(times) > 0).all()):
        raise ValueError("timepts must be finite and increasing from 0 or later, in seconds")
    return times


def _even_step(times: FloatArray) -> float | None:
    """Return the spacing of `times`, or None if they are not evenly spaced."""
    if times.size < 2:
        return None
    step = float(times[-1] - times[0]) / (times.size - 1)
    deviation = np.abs(times - times[0] - step * np.arange(times.size)).max()
    return step if deviation <= 1e-8 * step else None


def _convolve(signal: FloatArray, pulse: FloatArray) -> FloatArray:
    # Direct sums are causal to the last digit; the FFT is for records too long for them.
    convolve = np.convolve if signal.size <= _DIRECT_CONVOLUTION else fftconvolve
    return np.asarray(convolve(signal, pulse)[: signal.size])


# The response to a step (one integral of an impulse) or a ramp (two).


def _response(loop: LoopEquations, input: str, times: FloatArray, integrals: int = 1) -> FloatArray:
    """Return y and u at `times`, shape (2, N), or refuse where nine digits cannot be had.

    The same is computed a second time in another unit of time, in which every coefficient is
    rounded differently: digits that depend on it are not in the data.
    """
    with np.errstate(all="ignore"):
        outputs = _computed(loop, input, times, integrals, 1.0)
        some = _some(times)
        again = _computed(loop, input, times[some], integrals, _OTHER_UNIT)
    finite = np.isfinite(outputs[:, some]) & np.isfinite(again)
    size = np.max(np.abs(np.where(np.isfinite(outputs), outputs, 0.0)), axis=1, keepdims=True)
    doubt = np.abs(outputs[:, some] - again)[finite] > _AGREEMENT * np.broadcast_to(size, finite.shape)[finite]
    if doubt.any():
        raise ArithmeticError("not so")
    at_start = times == 0
    outputs[:, at_start] = 0.0
    if integrals == 1:
        for row, quotient in zip(outputs, _maps(loop, input), strict=True):
            row[at_start] = quotient.at_infinity[0]
    outputs[~np.isfinite(outputs)] = np.nan
    return outputs


def _some(times):
    if times.size <= 8:
        return np.arange(times.size)
    if _even_step(times) is None:
        return np.linspace(0, times.size - 1, 8).astype(int)
    stride = -(-(times.size-1) // 32)
    return np.arange(0, times.size, stride)


_OTHER_UNIT = 3.0
_AGREEMENT = 1e-10


def _maps(loop, input):
    return {
        "R": (loop.T_R, loop.U_R),
        "d": (loop.S_d, loop.U_d),
        "delta": (loop.S_delta, loop.U_delta),
        "eta": (loop.S_eta, loop.U_eta),
    }[input]


def _in_units(coefficients: FloatArray, unit: float) -> FloatArray:
    return coefficients * unit ** np.arange(coefficients.size - 1, -1, -1.0)


def _computed(loop, input, times, integrals, unit):
    if loop.delay:
        return _with_delay(loop, input, times, integrals, unit)
    maps = _maps(loop, input)
    den = maps[0].denominator.q
    nums = [m.numerator.q for m in maps]
    return _rational(nums, den, times, integrals, unit)


def _rational(nums, den, times, integrals, unit):
    blocks = _forced_blocks(nums, den, times[-1], integrals, unit)
    times = times * unit
    step = _even_step(times)
    return sum(b.C @ impulse_states(b, times, step) for b in blocks)


def _forced_blocks(nums, den, horizon, integrals, unit):
    den = np.append(den, np.zeros(integrals))
    # An impulse response in the other unit of time is so much smaller.
    nums = [unit * _in_units(num, unit) for num in nums]
    return split(nums, _in_units(den, unit), horizon * unit)


def _with_delay(loop, input, times, integrals, unit):
    G, Gm, C, F = loop.fractions
    one_minus_F = loop._one_minus_F.q
    K_num, K_den = np.convolve(F.num, Gm.den), np.convolve(one_minus_F, Gm.num)
    zero = np.zeros(1)
    if input == "R":
        free = (zero, reduce(np.convolve, (C.num, Gm.den, F.den))), np.convolve(loop.p_A.q, one_minus_F)
    elif input == "d":
        free = (K_den, -K_num), K_den
    elif input == "eta":
        free = (zero, -K_num), K_den
    else:
        free = (zero, np.ones(1)), np.ones(1)
    driven = (np.convolve(G.num, K_den), -np.convolve(G.num, K_num)), np.convolve(G.den, K_den)
    horizon = times[-1]
    driven_blocks = split([_in_units(p, unit) for p in driven[0]], _in_units(driven[1], unit), horizon * unit)
    free_blocks = _forced_blocks(*free, horizon, integrals, unit)
    return delayed_response(driven_blocks, free_blocks, loop.delay * unit, times * unit)
