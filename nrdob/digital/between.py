r"""Step responses of a sampled loop, exact between the samples, too.

From sample to sample the loop is one matrix. In between the process goes on in continuous time, fed
with what the hold gave d + φ samples ago::

    x(k dt + σ) = exp(A σ) x[k] + Γ(σ) u[k-d-1] + Γ(σ - φ dt) (u[k-d] - u[k-d-1])

with Γ(σ) = ∫ exp(A τ) B dτ from 0 to σ, and 0 for negative σ. The disturbances are signals in
continuous time: d is added to the output y(t), and the processor reads it at its samples; δ is
added to the input of the process and passes the process' dead time, but neither the hold nor the
computation. R and η are only ever read at the samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..diagram import INPUTS
from ..numerics import FloatArray
from .controller import SampledController
from .hold import WHOLE, HeldProcess

__all__ = ["Running", "sampled_step_response"]

MOST_SAMPLES = 1_000_000
FEWEST, MOST_BY_DEFAULT = 20, 20_000
"""Samples in a response."""

POINTS = 1000
"""Times in a response by default, at least."""

SETTLED = 1e-3


@dataclass(frozen=True)
class Running:
    """What runs: the process behind its hold, the controller, and the dead times by themselves.

    Attributes
    ----------
    process : HeldProcess
        With all dead time that lies between u and y.
    controller : SampledController
        The difference equations.
    delay : float
        Dead time of the process alone, in seconds.
    computation_delay : float
        Time from reading y to writing u, in seconds.
    largest : float
        Modulus of the largest eigenvalue of the loop, nan if it is not known.
    """

    process: HeldProcess
    controller: SampledController
    delay: float
    computation_delay: float
    largest: float

    @property
    def dt(self) -> float:
        """Sampling time in seconds."""
        return self.process.dt


def sampled_step_response(
    loop: Running, input: str, timepts: ArrayLike | None = None
) -> ct.TimeResponseData:
    """Response of y and u to a unit step at t = 0, all signals zero before.

    Parameters
    ----------
    loop : Running
        Stable or not.
    input : {"R", "d", "delta", "eta"}
        Where the step enters.
    timepts : (N,) array_like or float, optional
        Increasing times from 0 on, in seconds, or the last one; by default until the loop has
        settled, with whole fractions of a sample.

    Returns
    -------
    control.TimeResponseData
        With y and u; nan once an unstable loop has left the floating-point range.
    """
    if input not in INPUTS:
        raise ValueError(f"input is {input!r}; choose one of {', '.join(INPUTS)}")
    times = _times(loop, timepts)
    samples = int(times[-1] / loop.dt * (1 + WHOLE)) + 2
    if samples > MOST_SAMPLES:
        raise ValueError(
            f"timepts end at {times[-1]:g} s, {samples} samples of dt = {loop.dt:g} s; at most "
            f"{MOST_SAMPLES} are computed: shorten timepts"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        outputs = _between(loop, input, times, *_samples(loop, input, samples))
    outputs[~np.isfinite(outputs)] = np.nan
    return ct.TimeResponseData(
        times,
        outputs[:, np.newaxis],
        inputs=np.ones((1, 1, times.size)),
        issiso=False,
        output_labels=["y", "u"],
        input_labels=[input],
        title=f"Step response to {input}, dt = {loop.dt:g} s",
        trace_labels=[f"From {input}"],
        trace_types=["step"],
        plot_inputs=False,
    )


def _times(loop: Running, timepts: ArrayLike | None) -> FloatArray:
    if timepts is None:
        rate = 1.0 if loop.largest == 0 else abs(log(loop.largest))
        rate = max(1 / MOST_BY_DEFAULT, rate)  # also where the largest is not known, nan
        count = ceil(-log(SETTLED) / rate) + 2 * loop.process.memory
        count = min(max(count, FEWEST), MOST_BY_DEFAULT)
        each = ceil(POINTS / count)
        return np.arange(count * each + 1) / each * loop.dt
    times = np.asarray(timepts, dtype=float)
    if times.ndim == 0:
        times = np.linspace(0.0, float(times), POINTS + 1)
    good = times.ndim == 1 and times.size and np.isfinite(times).all()
    if not (good and times[0] >= 0 and np.all(np.diff(times) > 0)):
        raise ValueError(
            "timepts must be increasing times from 0 on, in seconds, or the last one, above 0"
        )
    return times


def _samples(loop: Running, input: str, count: int) -> tuple[FloatArray, FloatArray]:
    """States of the process at the samples (count, n), and u (count,)."""
    process, controller = loop.process, loop.controller
    n = process.B.size
    states, written = np.zeros((count + 1, n)), np.zeros(count)
    x, inner = np.zeros(n), np.zeros(controller.states)
    r = float(input == "R")
    added = float(input in ("d", "eta"))
    # The controller's states and inputs in one product, the process in another.
    step = np.hstack([controller.A, controller.B])
    now = np.concatenate([controller.C, controller.D])
    both = np.zeros(controller.states + 3)
    for k in range(count):
        states[k] = x
        v = _past(written, k - process.samples - 1)
        y = process.C @ x + added
        if process.D:
            y += process.D * (v + _delta(loop, input, k * loop.dt, before=True))
        both[:-3], both[-3], both[-2] = inner, r, y
        both[-1] = written[k] = now @ both[:-1]
        inner = step @ both
        x = process.Ad @ x + process.B0 * _past(written, k - process.samples) + process.B1 * v
        if input == "delta":
            since = min(max((k + 1) * loop.dt - loop.delay, 0.0), loop.dt)
            if since > 0:
                x = x + process.between(since)[1]
    return states, written


def _past(written: FloatArray, k: int) -> float:
    return float(written[k]) if k >= 0 else 0.0


def _delta(loop: Running, input: str, time: float, *, before: bool = False) -> float:
    """Tell whether δ has got through the dead time; the processor sees what was before."""
    late = loop.delay
    tolerance = WHOLE * loop.dt
    arrived = time > late + tolerance if before else time >= late - tolerance
    return float(input == "delta" and arrived)


def _between(
    loop: Running, input: str, times: FloatArray, states: FloatArray, written: FloatArray
) -> FloatArray:
    """Y and u at any times."""
    process, dt = loop.process, loop.dt
    k = np.floor(times / dt + WHOLE).astype(int)
    inside = np.maximum(times - k * dt, 0.0)
    inside[inside < WHOLE * dt] = 0.0
    jump = process.fraction * dt
    offsets, which = np.unique(np.round(inside / dt, 12), return_inverse=True)
    u = np.concatenate([np.zeros(process.samples + 2), written])
    old, new = (u[k + 1 + shift] for shift in (0, 1))
    y = np.empty(times.size)
    for i, offset in enumerate(offsets * dt):
        at = which == i
        Phi, Gamma = process.between(offset)
        arrived = offset >= jump - WHOLE * dt
        late = process.between(max(offset - jump, 0.0))[1] if arrived else np.zeros_like(Gamma)
        x = states[k[at]] @ Phi.T + np.outer(old[at], Gamma)
        x += np.outer(new[at] - old[at], late)
        if input == "delta":
            x += _since(loop, k[at], offset)
        y[at] = x @ process.C
        if process.D:
            disturbance = [_delta(loop, input, time) for time in times[at].tolist()]
            y[at] += process.D * ((new if arrived else old)[at] + np.array(disturbance))
    late_u = np.floor((times - loop.computation_delay) / dt + WHOLE).astype(int)
    applied = np.where(late_u >= 0, written[np.maximum(late_u, 0)], 0.0)
    return np.stack([y + (input == "d"), applied + (input == "delta")])


def _since(loop: Running, k: FloatArray, offset: float) -> FloatArray:
    """Return what δ has added to the states since the last sample; 0 before it arrives."""
    process, first = loop.process, loop.delay
    since = np.clip(k * loop.dt + offset - first, 0.0, offset)
    added = np.zeros((k.size, process.B.size))
    for length in np.unique(since):
        if length > 0:
            added[since == length] = process.between(length)[1]
    return added
