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
from functools import lru_cache
from math import ceil, pi

import control as ct
import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, expm, matrix_balance
from scipy.signal import fftconvolve

from .blocks import FloatArray, Fraction
from .equations import LoopEquations
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
        times = default_times(loop, input, lambda times: _unit_responses(loop, input, times)[:, 0])
    else:
        times = _checked_times(timepts)
    outputs = _unit_responses(loop, input, times)[:, :1]
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
    unit, ramp = np.moveaxis(_unit_responses(loop, input, times), 1, 0)
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


# The loop as one linear system with one delayed signal.


@dataclass(frozen=True)
class _System:
    """x' = A x + B z and (y, v) = C x + D z.

    The last two states generate the input: its value w and its slope, w' = slope.

    Attributes
    ----------
    A, B, C, D : arrays of shapes (n, n), (n,), (2, n), (2,)
    start : (n, 2) array
        Initial states for a unit step (w = 1) and a unit ramp (slope = 1).
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    start: FloatArray


def _system(loop: LoopEquations, input: str) -> _System:
    """Connect process, prefilter and observer; without dead time z = v is closed as well."""
    G, Gm, C, F = loop.fractions
    prefilter = Fraction(np.zeros(1), np.ones(1))  # when idle; an unstable one could overflow
    if input == "R":
        prefilter = Fraction(np.convolve(C.num, Gm.den), loop.p_A.q)
    F_and_inverse = np.convolve(F.num, Gm.num), -np.convolve(F.num, Gm.den)
    blocks = (
        _observable([G.num], G.den),
        _observable([prefilter.num], prefilter.den),
        _observable(F_and_inverse, np.convolve(F.den, Gm.num)),
    )
    a, b, c, d = (block_diag(*parts) for parts in zip(*blocks, strict=True))
    n = a.shape[0]
    # Block inputs (process, prefilter, observer u, observer y + η) from the outputs of the blocks,
    # and from z and w, which stand in columns n and n + 1.
    feedback, outside = np.zeros((4, 3)), np.zeros((4, n + 2))
    feedback[2, 1:] = feedback[3, 0] = 1.0
    if loop.delay:
        outside[0, n] = 1.0
    else:
        feedback[0, 1:] = 1.0
        outside[0, n + 1] = input == "delta"
    outside[1, n + 1] = input == "R"
    outside[3, n + 1] = input in ("d", "eta")
    pad = np.zeros((3, 2))
    block_outputs = np.linalg.solve(np.eye(3) - d @ feedback, np.hstack([c, pad]) + d @ outside)
    x_dot = np.hstack([a, np.zeros((n, 2))]) + b @ (feedback @ block_outputs + outside)
    y_v = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]) @ block_outputs
    y_v[:, n + 1] += [input == "d", input == "delta"]

    A, B, out = np.zeros((n + 2, n + 2)), np.zeros(n + 2), np.zeros((2, n + 2))
    A[:n, : n + 1], B[:n], A[n, n + 1] = np.delete(x_dot, n, axis=1), x_dot[:, n], 1.0
    out[:, : n + 1] = np.delete(y_v, n, axis=1)
    return _balanced(_System(A, B, out, y_v[:, n], np.eye(n + 2)[:, n:]))


def _balanced(system: _System) -> _System:
    """Scale the states by powers of two until companion forms are as good as any other."""
    around_the_loop = np.abs(system.A) + np.abs(np.outer(system.B, system.C[1]))
    _, (scale, _) = matrix_balance(around_the_loop, permute=False, separate=True)
    column = scale[:, np.newaxis]
    A, B, C = system.A * scale / column, system.B / scale, system.C * scale
    return _System(A, B, C, system.D, system.start / column)


def _observable(
    nums: Sequence[FloatArray], den: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return A, B, C, D of one output with proper fractions `nums`/`den` from each input."""
    n, monic = den.size - 1, den[1:] / den[0]
    padded = np.array([np.pad(num, (n + 1 - num.size, 0)) for num in nums]) / den[0]
    A = np.eye(n, k=1)
    A[:, :1] = -monic[:, np.newaxis]
    D = padded[:, :1].T
    return A, padded[:, 1:].T - np.outer(monic, D), np.eye(1, n), D


# Marching.


def _unit_responses(loop: LoopEquations, input: str, times: FloatArray) -> FloatArray:
    """Return y and u after a unit step and a unit ramp at `times`, shape (2, 2, N)."""
    with np.errstate(over="ignore", invalid="ignore"):
        system = _system(loop, input)
        if loop.delay:
            return _delayed_outputs(system, loop.delay, times)
        outputs: FloatArray = np.einsum("on,nsi->osi", system.C, _delay_free_states(system, times))
        return outputs


def _delay_free_states(system: _System, times: FloatArray) -> FloatArray:
    """States at `times` by matrix exponentials, shape (n, 2, N)."""
    states = _free_states(system.A, system.start, times)
    n = system.A.shape[0] - 2
    A, constant = system.A[:n, :n], system.A[:n, n:] @ system.start[n:, :1]
    rates = np.abs(np.linalg.eigvals(A))
    if n and rates.min() > 1e-12 * rates.max():
        # A step response is its rest plus what dies out, and rounding then dies out with it.
        rest = -np.linalg.solve(A, constant)
        fading = _free_states(A, system.start[:n, :1] - rest, times)
        states[:n, :1] = rest[:, :, np.newaxis] + fading
    return states


def _free_states(A: FloatArray, start: FloatArray, times: FloatArray) -> FloatArray:
    """Solve x' = A x from each column of `start`, an array of states, columns and times."""
    states: FloatArray = (expm(A * times[0]) @ start)[:, :, np.newaxis]
    step = _even_step(times)
    if step is not None:  # Twice as many states with every product.
        power = expm(A * step)
        while states.shape[2] < times.size:
            states = np.concatenate([states, np.einsum("mn,nsi->msi", power, states)], axis=2)
            power = power @ power
        return states[:, :, : times.size]
    steps, which = np.unique(np.diff(times), return_inverse=True)
    transitions = [expm(A * step) for step in steps]
    state, columns = states[:, :, 0], [states[:, :, 0]]
    for i in which:
        state = transitions[i] @ state
        columns.append(state)
    return np.stack(columns, axis=2)


@dataclass(frozen=True)
class _Panel:
    """What one panel does to [x at its start; z at its nodes].

    Attributes
    ----------
    advance : (n+m, n+m) array
        To [x at its end; v at its nodes].
    outputs : (2, m, n+m) array
        To y and v at its m nodes.
    """

    advance: FloatArray
    outputs: FloatArray


def _delayed_outputs(system: _System, delay: float, times: FloatArray) -> FloatArray:
    """Return the outputs at `times` by the method of steps, shape (2, 2, N)."""
    fastest = float(np.abs(np.linalg.eigvals(system.A)).max())
    per_delay = max(1, ceil(delay * fastest / _PANEL_REACH))
    position = times * (per_delay / delay)
    # A time that only rounding puts before a border is meant to be on it.
    index = np.floor(position + 1e-9).astype(int)
    panels, which = np.unique(index, return_inverse=True)
    panel = _panel(system, delay / per_delay)
    walk = _leap if per_delay == 1 else _march
    rows = walk(panel.advance, system.start, panels, per_delay)
    values = np.einsum("ojn,kns->kojs", panel.outputs, rows)
    local = np.clip(position - index, 0.0, 1.0)
    basis = chebyshev.chebvander(2 * local - 1, _DEGREE) @ _collocation()[0]
    outputs: FloatArray = np.einsum("ij,iojs->osi", basis, values[which])
    return outputs


def _panel(system: _System, length: float) -> _Panel:
    """Solve x = x(0) + ∫(A x + B z), integrated exactly for polynomials through the nodes."""
    _, integral = _collocation()
    m, n = integral.shape[0], system.A.shape[0]
    left = np.eye(m * n) - length * np.kron(integral, system.A)
    from_start = np.kron(np.ones((m, 1)), np.eye(n))
    from_delayed = length * np.kron(integral, system.B[:, np.newaxis])
    x = np.linalg.solve(left, np.hstack([from_start, from_delayed])).reshape(m, n, n + m)
    outputs = np.einsum("on,jnk->ojk", system.C, x)
    outputs[:, np.arange(m), n + np.arange(m)] += system.D[:, np.newaxis]
    return _Panel(np.vstack([x[-1], outputs[1]]), outputs)


@lru_cache(maxsize=1)
def _collocation() -> tuple[FloatArray, FloatArray]:
    """Chebyshev coefficients and integral over [0, t] from values at the nodes t in [0, 1]."""
    x = -np.cos(pi * np.arange(_DEGREE + 1) / _DEGREE)
    coefficients = np.linalg.inv(chebyshev.chebvander(x, _DEGREE))
    antiderivative = chebyshev.chebint(np.eye(_DEGREE + 1), lbnd=-1)
    integral = chebyshev.chebvander(x, _DEGREE + 1) @ antiderivative @ coefficients / 2
    integral[0] = 0.0
    return np.asarray(coefficients, dtype=float), np.asarray(integral, dtype=float)


def _march(
    advance: FloatArray, start: FloatArray, panels: FloatArray, per_delay: int
) -> FloatArray:
    """Panel by panel: [x; z] at the start of `panels`, shape (panels, n+m, 2)."""
    count, n = int(panels[-1]) + 1, start.shape[0]
    if count > MAX_PANELS:
        raise ValueError(
            f"timepts spans {count:,} time constants of the fastest mode, more than the "
            f"{MAX_PANELS:,} that dead time allows; shorten timepts or slow the fastest block"
        )
    rows = np.zeros((count, advance.shape[0], 2))
    rows[0, :n] = start
    for k in range(count - 1):
        end = advance @ rows[k]
        rows[k + 1, :n] = end[:n]
        rows[k + per_delay : k + per_delay + 1, n:] = end[n:]
    seen: FloatArray = rows[panels]
    return seen


def _leap(advance: FloatArray, start: FloatArray, panels: FloatArray, per_delay: int) -> FloatArray:
    """With one panel per delay [x; z] is the whole state: powers jump over unseen panels."""
    row = np.zeros((advance.shape[0], 2))
    row[: start.shape[0]] = start
    jumps, which = np.unique(np.diff(panels, prepend=0), return_inverse=True)
    transitions = [np.linalg.matrix_power(advance, jump) for jump in jumps]
    rows = []
    for i in which:
        row = transitions[i] @ row
        rows.append(row)
    return np.array(rows)
