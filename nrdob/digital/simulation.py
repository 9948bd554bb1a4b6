r"""A sampled loop run on given signals: step responses, and simulations with an actuator's limits.

Between hold and sampler the process is exact. All external signals are held over a sample, as u is.

A loop with a limit is linear in everything but its decisions v (`nrdob.digital.closedloop`). Over a
block of m samples all that is proposed is p = O x + T w + S v, x being the states at its beginning
and S strictly lower triangular. The parts in w are products of matrices, computed for all blocks at
once. If every rule leaves p as it is, v = (I - S)^{-1}(O x + T w) is the answer for the whole
block; otherwise the block is computed sample by sample, at one scalar product for each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf, log
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular
from scipy.sparse import csr_array
from scipy.sparse.linalg import matrix_power

from ..diagram import INPUTS, real_number
from ..numerics import BoolArray, FloatArray
from .actuatorlimits import Rule
from .closedloop import ClosedLoop, Recursion
from .hold import WHOLE, HeldProcess
from .signals import EXTERNAL

__all__ = ["SimulatedResponse", "run", "sampled_step_response", "simulated"]


LONGEST = 64  # samples in one block: the work for a sample grows with it, for a block it is spread
GROWTH = 1e3  # by how much a block may multiply what has been decided in it: digits are lost
MOST_DENSE = 100  # states up to which nothing is gained by leaving out zeros
FEWEST, MOST_BY_DEFAULT, MOST_SAMPLES = 20, 20_000, 1_000_000  # samples in a step response

POINTS, SETTLED = 1000, 1e-3
"""Times in a step response by default, at least, and what is left of it at the end."""


@dataclass(frozen=True, eq=False)
class SimulatedResponse:
    """What `SampledLoop.simulate` returns.

    Attributes
    ----------
    time, y, measured : arrays of float, shape (N,)
        Times of the samples, in seconds, the output just before u changes, and what the processor
        reads: y with noise, in steps of the resolution.
    u, applied, d_hat : arrays of float, shape (N,)
        The controller's command, the actuator's output from then (and the computation) on, and the
        observer's estimate of the disturbance at the input.
    """

    time: FloatArray
    y: FloatArray
    measured: FloatArray
    u: FloatArray
    applied: FloatArray
    d_hat: FloatArray

    @property
    def limited(self) -> BoolArray:
        """Samples in which the actuator is at a limit, shape (N,)."""
        return np.asarray(np.abs(self.applied - self.u) > 1e-9 * (1 + np.abs(self.u)))

    def __repr__(self) -> str:
        lines = [
            f"{self.time.size} samples to {self.time[-1]:.6g} s, u limited in "
            f"{int(self.limited.sum())} of them"
        ]
        for name in ("y", "u", "applied"):
            signal = getattr(self, name)
            lines.append(
                f"{name:8} from {signal.min():.6g} to {signal.max():.6g}, at last {signal[-1]:.6g}"
            )
        return "\n".join(lines)


def simulated(
    loop: ClosedLoop,
    rules: Sequence[Rule],
    time: FloatArray,
    external: FloatArray,
    start: float | None,
) -> SimulatedResponse:
    """Run a loop on R, d, δ and η, shape (N, 4): see `SampledLoop.simulate`."""
    states: FloatArray = np.zeros(len(loop.recursion.A))
    before = [0.0] * len(rules)
    if start is not None:
        u = real_number(start, "start", "give the constant u to take over from", above=-inf)
        *converter, _ = rules
        states, measured = loop.at_rest(
            u, external[0], lambda y: converter[0].apply(y, y) if converter else y
        )
        before = [measured, u][-len(rules) :]
    entering = loop.entering(external, at_rest=start is not None)
    found = run(loop.recursion, states, entering, rules, before)
    finite = np.isfinite(found.starts).all(axis=1) & np.isfinite(found.decided).all(axis=1)
    if not finite.all():
        raise ArithmeticError(
            "the signals leave the range of floating-point numbers near sample "
            f"{int(np.argmin(finite)) * found.length}: the loop is unstable, or the limits are too "
            "narrow for an unstable process; simulate fewer samples"
        )
    y, measured, u, d_hat = found.outputs(loop.rows(("y", "measured", "u", "d_hat"))).T
    return SimulatedResponse(time, y, measured, u, found.decisions[:, -1], d_hat)


def sampled_step_response(
    loop: ClosedLoop, input: str, timepts: ArrayLike | None, spectral_radius: float
) -> ct.TimeResponseData:
    """Respond to a unit step at t = 0, all signals zero before: see `SampledLoop.step_response`.

    The spectral radius, nan if it is not known, says how long the response is by default; y and u
    are nan once an unstable loop has left the floating-point range.
    """
    if input not in INPUTS:
        raise ValueError(f"input is {input!r}; choose one of {', '.join(INPUTS)}")
    dt = loop.process.dt
    times = _step_times(timepts, loop.process, spectral_radius)
    samples = int(times[-1] / dt * (1 + WHOLE)) + 2
    if samples > MOST_SAMPLES:
        raise ValueError(
            f"timepts end at {times[-1]:g} s, {samples} samples of dt = {dt:g} s; at most "
            f"{MOST_SAMPLES} are computed: shorten timepts"
        )
    external = np.zeros((samples, 4))
    external[:, (*EXTERNAL, "eta").index(input)] = 1.0
    entering = loop.entering(external, at_rest=False)
    free = Rule(lambda value, before: value, lambda values, before: True)
    with np.errstate(over="ignore", invalid="ignore"):
        found = run(loop.recursion, np.zeros(len(loop.recursion.A)), entering, [free], [0.0])
        rows = found.outputs(loop.rows(("x", "felt", "d"))).T
        x, felt, d = rows[:-5], rows[-5:-1], rows[-1]
        k = np.floor(times / dt + WHOLE).astype(int)
        inside = np.maximum(times / dt - k, 0.0)
        inside[inside < WHOLE] = 0.0
        offsets, which = np.unique(np.round(inside, 12), return_inverse=True)
        y = d[k]
        for i, offset in enumerate((offsets * dt).tolist()):
            at = which == i
            y[at] += loop.output_after(offset, x[:, k[at]], felt[:, k[at]])
    # u reaches the process after the time of computation.
    late = np.floor((times - loop.process.delay + loop.disturbed.delay) / dt + WHOLE).astype(int)
    u = np.where(late >= 0, found.decisions[np.maximum(late, 0), 0], 0.0) + (input == "delta")
    outputs = np.stack([y, u])
    outputs[~np.isfinite(outputs)] = np.nan
    return ct.TimeResponseData(
        times, outputs[:, np.newaxis], inputs=np.ones((1, 1, times.size)), issiso=False,
        output_labels=["y", "u"], input_labels=[input], trace_labels=[f"From {input}"],
        title=f"Step response to {input}, dt = {dt:g} s", trace_types=["step"], plot_inputs=False,
    )  # fmt: skip


def _step_times(
    timepts: ArrayLike | None, process: HeldProcess, spectral_radius: float
) -> FloatArray:
    if timepts is None:
        rate = 1.0 if spectral_radius == 0 else abs(log(spectral_radius))
        rate = max(1 / MOST_BY_DEFAULT, rate)  # also where the radius is not known, nan
        count = ceil(-log(SETTLED) / rate) + 2 * process.memory
        count = min(max(count, FEWEST), MOST_BY_DEFAULT)
        each = ceil(POINTS / count)
        return np.arange(count * each + 1) / each * process.dt
    times = np.asarray(timepts, dtype=float)
    if times.ndim == 0:
        times = np.linspace(0.0, float(times), POINTS + 1)
    good = times.ndim == 1 and times.size and np.isfinite(times).all()
    if not (good and times[0] >= 0 and np.all(np.diff(times) > 0)):
        raise ValueError(
            "timepts must be increasing times from 0 on, in seconds, or the last one, above 0"
        )
    return times


# The recursion, many samples at once.


@dataclass(frozen=True, eq=False)
class Run:
    """A recursion that has been run over so many samples, in b blocks of m.

    `inputs` has the shape (b, m q), the last block filled up with zeros; `starts`, the states at
    the beginning of each block, (b, n); `decided` (b, m p).
    """

    recursion: Recursion
    inputs: FloatArray
    starts: FloatArray
    decided: FloatArray
    samples: int

    @property
    def length(self) -> int:
        """Samples in a block, m."""
        return int(self.decided.shape[1] // self.recursion.G.shape[1])

    @property
    def decisions(self) -> FloatArray:
        """The decisions of each sample, shape (N, p)."""
        return self.decided.reshape(-1, self.recursion.G.shape[1])[: self.samples]

    def outputs(self, rows: Sequence[FloatArray]) -> FloatArray:
        """Signals C x + D w + H v of each sample, shape (N, r), from their rows C, D and H."""
        from_states, from_inputs, from_decisions = _over_block(self.recursion, self.length, *rows)
        found = self.starts @ from_states.T + self.inputs @ from_inputs.T
        found += self.decided @ from_decisions.T
        return found.reshape(-1, len(rows[0]))[: self.samples]


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is seen afterwards
def run(
    recursion: Recursion,
    states: FloatArray,
    inputs: FloatArray,
    rules: Sequence[Rule],
    before: Sequence[float],
) -> Run:
    """Run a recursion over N samples.

    `states`, shape (n,), are those at the first sample, `inputs` has the shape (N, q), `rules` say
    how each of the p decisions is made, and `before` are those in the sample before the first.
    """
    (n, p), samples = recursion.G.shape, len(inputs)
    m = _block_length(recursion, samples)
    blocks = -(-samples // m)
    padded = np.zeros((blocks * m, inputs.shape[1]))
    padded[:samples] = inputs
    grouped = padded.reshape(blocks, -1)

    from_states, from_inputs, from_decisions = _over_block(recursion, m, *recursion[3:])
    # Long dead times are mostly zeros, which are left out.
    A = recursion.A
    over: Any = np.linalg.matrix_power(A, m) if n <= MOST_DENSE else matrix_power(csr_array(A), m)
    to_end, decisions_to_end = (_to_the_end(A, into, m) for into in (recursion.B, recursion.G))
    undecided = _all_free(from_decisions)
    from_outside, outside_to_end = grouped @ from_inputs.T, grouped @ to_end.T

    values = np.zeros(m * p)  # decisions of the block at hand
    steps = [
        (from_decisions[i, :i].dot, values[:i], rules[i % p].apply, i, i % p) for i in range(m * p)
    ]
    starts, decided = np.zeros((blocks, n)), np.zeros((blocks, m * p))
    x, previous = states, [float(value) for value in before]
    for block in range(blocks):
        starts[block] = x
        proposed = from_outside[block] + from_states @ x
        values[:] = undecided @ proposed
        if not all(rule.leaves(values[r::p], previous[r]) for r, rule in enumerate(rules)):
            now = previous.copy()
            for own, (dot, past, apply, i, r) in zip(proposed.tolist(), steps, strict=True):
                values[i] = now[r] = apply(own + float(dot(past)), now[r])
        previous = values[-p:].tolist()
        decided[block] = values
        x = over @ x + outside_to_end[block] + decisions_to_end @ values
    return Run(recursion, grouped, starts, decided, samples)


def _block_length(recursion: Recursion, samples: int) -> int:
    """Choose the samples that go together, few where decisions grow from one to the next."""
    p = len(recursion.H)
    m = min(LONGEST, samples)
    while m > 1:
        from_states, _, coupling = _over_block(recursion, m, *recursion[3:])
        growth = np.abs(_all_free(coupling)) @ np.abs(coupling)
        # Decisions of one kind among themselves, which does not depend on their units.
        largest = max(growth[r::p, r::p].max() for r in range(p))
        if largest <= GROWTH and np.isfinite(from_states).all():
            break
        m //= 2
    return m


def _all_free(coupling: FloatArray) -> FloatArray:
    """Solve for decisions that are all left as proposed, none of them by way of a later one."""
    unit = np.eye(len(coupling))
    return np.asarray(
        solve_triangular(unit - coupling, unit, lower=True, unit_diagonal=True, check_finite=False)
    )


def _over_block(
    recursion: Recursion, m: int, C: FloatArray, D: FloatArray, H: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Write signals C x + D w + H v of m samples over the first x, all w and all v."""
    powers = [C]
    for _ in range(m - 1):
        powers.append(powers[-1] @ recursion.A)
    observed = np.array(powers)  # C A^k

    def lower(direct: FloatArray, into: FloatArray) -> FloatArray:
        # The answer k samples after an impulse, and last of all none before it.
        answers = np.concatenate([direct[None], observed[:-1] @ into, 0 * direct[None]])
        lag = np.subtract.outer(np.arange(m), np.arange(m))
        grid = answers[np.where(lag >= 0, lag, m)]
        return np.asarray(grid.transpose(0, 2, 1, 3).reshape(m * direct.shape[0], -1))

    return observed.reshape(-1, C.shape[1]), lower(D, recursion.B), lower(H, recursion.G)


def _to_the_end(A: FloatArray, into: FloatArray, m: int) -> FloatArray:
    """How the inputs or the decisions of m samples move the states at their end."""
    moved = [into]
    for _ in range(m - 1):
        moved.append(A @ moved[-1])
    return np.hstack(moved[::-1])
