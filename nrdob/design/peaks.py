"""The largest value of a map over frequency, and of a step response over time."""

from __future__ import annotations

import numpy as np

from ..analysis import resolved_frequencies, step_response
from ..diagram import LoopEquations, Quotient
from ..numerics import golden

__all__ = ["peak_gain", "step_peak"]

NEAR_PEAK, ROUNDS, ACROSS = 0.9, 2, 65
"""Share of the largest value from which a peak is looked at; how often, at how many points."""

EVENLY, EARLIEST = 1001, 1e-6
"""Times of the first look at a response, evenly and by ratio; the first of these, of the last."""


def peak_gain(quotient: Quotient) -> float:
    """Largest size of a stable map on the imaginary axis, its limit at infinity included.

    Parameters
    ----------
    quotient : Quotient
        The map.
    """
    omega = resolved_frequencies(quotient)
    size = np.abs(quotient(1j * omega))
    largest = size.max()
    inner = 1 + np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:]))
    inner = inner[size[inner] > NEAR_PEAK * largest]
    tops = golden(lambda w: -np.abs(quotient(1j * w)), omega[inner - 1], omega[inner + 1])
    ends = [abs(quotient.dc_gain), sum(map(abs, quotient.at_infinity))]
    return float(max([largest, *np.abs(quotient(1j * tops)).tolist(), *ends]))


def step_peak(loop: LoopEquations, input: str, signal: str) -> float:
    """Largest ``|y|`` or ``|u|`` after a unit step.

    Parameters
    ----------
    loop : LoopEquations
        A stable loop.
    input : {"R", "d", "delta", "eta"}
        Where the step enters.
    signal : {"y", "u"}
        What is looked at.
    """
    row = "yu".index(signal)
    last = step_response(loop, input).time[-1]
    # A slow end must not hide a fast beginning.
    times = last * np.union1d(np.linspace(0, 1, EVENLY), np.geomspace(EARLIEST, 1, EVENLY))
    size = np.abs(step_response(loop, input, times).outputs[row, 0])
    largest = np.nanmax(size)
    for _ in range(ROUNDS):
        k = int(np.nanargmax(size))
        if k == 0:
            break
        low, high = times[k - 1], times[min(k + 1, times.size - 1)]
        times = np.linspace(low, high, ACROSS)
        size = np.abs(step_response(loop, input, times).outputs[row, 0])
    return float(max(largest, np.nanmax(size)))
