"""The default window of a step response: long enough to settle, short enough to see."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, log10, pi

import numpy as np

from ..diagram import LoopEquations
from ..numerics import BoolArray, ComplexArray, FloatArray, roots_by_time_scale

__all__ = ["POINTS", "default_response", "even_times"]

SETTLED = 0.002
"""A response has settled when it stays this close to its end, as a fraction of its span."""

POINTS = 1001  # times in a default window
_SHORTER = 8.0  # where a window is refused, the next one tried is that much shorter
_ATTEMPTS = 40

Response = Callable[[FloatArray], FloatArray]


def default_response(
    loop: LoopEquations, input: str, prepared: Callable[[float], Response]
) -> tuple[FloatArray, FloatArray]:
    """Choose evenly spaced times over what there is to see, and respond.

    `prepared` takes a last time in seconds and gives what gives y and u, (2, N), at N times until
    then; both raise ValueError or ArithmeticError where that takes too long or too many digits.
    """
    window, settles = _estimate(loop, input)
    for attempt in range(_ATTEMPTS):
        try:
            times = even_times(window)
            step_response = prepared(float(times[-1]))
            if settles:
                times = even_times(_settling_time(step_response, window))
            return times, step_response(times)
        except (ValueError, ArithmeticError):
            if attempt == _ATTEMPTS - 1:
                raise
        window /= _SHORTER
    raise AssertionError  # the last attempt has returned or raised


def even_times(window: float) -> FloatArray:
    """Return times from 0 to `window`, rounded up to 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** np.floor(log10(window))
    nice = next(factor for factor in (1, 2, 5, 10) if factor * decade >= window * (1 - 1e-9))
    return np.linspace(0.0, nice * decade, POINTS)


def _estimate(loop: LoopEquations, input: str) -> tuple[float, bool]:
    """Time in seconds after which nothing is left to see, and whether the response settles."""
    roots, on_axis = _modes(loop, input)
    rates, swings = roots.real[~on_axis], np.abs(roots.imag[on_axis])
    longest = max(loop.delay, loop.model_delay)
    growth, decay = max(rates, default=0.0), -max(rates[rates < 0], default=-inf)
    if growth > 0:
        return max(6 / growth, 3 * longest), False
    periods = 10 * pi / min(swings[swings > 0], default=inf)
    # Neither modes nor dead time: any window will do.
    return max(12 / decay + 5 * longest, periods) or 10.0, True


def _modes(loop: LoopEquations, input: str) -> tuple[ComplexArray, BoolArray]:
    """Roots that `input` excites, and which of them lie on the imaginary axis within rounding."""
    factors = [loop.p_A, loop.p_B] if input == "R" else [loop.p_B]
    try:
        with np.errstate(all="ignore"):
            roots = [p.roots if p.delay else roots_by_time_scale(p.q) for p in factors]
    except ArithmeticError:  # so long a delay that it alone sets the pace
        return np.zeros(0, dtype=complex), np.zeros(0, dtype=bool)
    on_axis = [p.near_axis(found) for p, found in zip(factors, roots, strict=True)]
    return np.concatenate(roots), np.concatenate(on_axis)


def _settling_time(step_response: Response, window: float) -> float:
    """Time from which y and u stay near where they are at the end of `window`, seconds."""
    final: FloatArray | None = None
    while True:
        times = np.linspace(0.0, window, POINTS)
        outputs = step_response(times)
        final = outputs[:, -1:] if final is None else final
        span = np.ptp(np.hstack([outputs, final]), axis=1, keepdims=True)
        moving = np.flatnonzero((np.abs(outputs - final) > SETTLED * span).any(axis=0))
        last = min(int(moving[-1]) + 1 if moving.size else 0, POINTS - 1)
        if last > POINTS // 20 or last == 0:
            return float(times[last]) or window
        window = 2 * float(times[last])  # the slowest mode hardly shows: look closer
