r"""The sampled loop run on given signals, with an actuator that has limits.

The processor runs the sections that the generated code runs, too; between hold and sampler the
process is exact. All signals from outside are held over a sample, as u is. What is decided in a
sample are the reading, if a converter rounds it, and the u that is applied, if the actuator has
limits: all else is linear and is done for many samples at once (`nrdob.digital.recursion`).

The observer asks what the process has been given, and what it is told decides whether it winds up.
Told the *applied* u, its blocks F, F/G̃ and (1 - F)G̃ are driven by bounded signals, from outside,
while the actuator is at its limit: they stay bounded iff they are stable. Told the *commanded* u,
F u goes round in a circle of its own, u = F u + …, with 1/(1 - F), an integrator: what the actuator
withholds is taken for a disturbance, which more u is to fight.

.. rubric:: References

K. J. Åström, L. Rundqwist, Integrator windup and how to avoid it, Proc. American Control Conference
(1989) 1693-1698.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..diagram import real_number
from ..numerics import BoolArray, FloatArray
from .code import ControllerCode
from .hold import HeldProcess
from .limits import Rule, limited, rounded
from .recursion import March, Recursion, march

__all__ = ["Signal", "SimulatedResponse", "simulate"]

Signal = ArrayLike | Callable[[FloatArray], ArrayLike]
"""A signal: a number, one value for each sample, or a function of the times."""

OUTSIDE = ("R", "d", "delta")
"""What may be given as an input; noise is a matter of its own."""

TOLD = ("applied", "commanded")
"""Which u the observer may be told."""


@dataclass(frozen=True, eq=False)
class SimulatedResponse:
    """What `SampledLoop.simulate` returns.

    Attributes
    ----------
    time : array of float, shape (N,)
        Times of the samples, in seconds.
    y : array of float, shape (N,)
        The output at these times, just before u changes.
    measured : array of float, shape (N,)
        What the processor reads: y with noise, in steps of the resolution.
    u : array of float, shape (N,)
        What the controller commands.
    applied : array of float, shape (N,)
        What the actuator does, from the sample (and the computation) on.
    d_hat : array of float, shape (N,)
        The observer's estimate of the disturbance at the input, in the unit of u.
    time_between, y_between : array of float, shape (N n_between,)
        The output in continuous time; where it jumps, its value after the jump.
    """

    time: FloatArray
    y: FloatArray
    measured: FloatArray
    u: FloatArray
    applied: FloatArray
    d_hat: FloatArray
    time_between: FloatArray = field(default_factory=lambda: np.zeros(0))
    y_between: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def limited(self) -> BoolArray:
        """Samples in which the actuator does not do what it is told, shape (N,)."""
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


def simulate(
    code: ControllerCode,
    process: HeldProcess,
    disturbed: HeldProcess,
    inputs: Mapping[str, Signal],
    noise: float | ArrayLike | None = None,
    *,
    timepts: ArrayLike | None = None,
    seed: int | np.random.Generator = 0,
    told: str = "applied",
    start: float | None = None,
    resolution: float | None = None,
    u_resolution: float | None = None,
    n_between: int = 0,
) -> SimulatedResponse:
    """Run a sampled loop: see `SampledLoop.simulate`, which says what everything is.

    Parameters
    ----------
    code : ControllerCode
        The controller, its limits and its tracking.
    process, disturbed : HeldProcess
        The process as u reaches it, with the dead time of computation, and as δ does.
    inputs, noise, timepts, seed, told, start, resolution, u_resolution, n_between : see there
        The signals and what else is to be seen.
    """
    if told not in TOLD:
        raise ValueError(f"observer_input is {told!r}; choose one of {', '.join(TOLD)}")
    if isinstance(n_between, bool) or not isinstance(n_between, int) or n_between < 0:
        raise ValueError(f"n_between is {n_between!r}; how many points a sample: 0, 1, 2, …")
    time = _times(timepts, inputs, noise, code.dt)
    outside = _outside(inputs, noise, time, seed)
    diagram = _Diagram(code, process, disturbed, told, resolution is not None)
    rules = [limited(code.limits, code.dt, u_resolution)]
    if resolution is not None:
        rules.insert(0, rounded(resolution))
    states, before = diagram.start(outside[0], start, rules)
    gone = march(diagram.recursion, states, outside, rules, before)
    shown = gone.outputs(*diagram.shown(("y", "measured", "u", "d_hat")))
    y, measured, u, d_hat = shown.T
    between = np.arange(n_between) * (code.dt / max(n_between, 1))
    return SimulatedResponse(
        time, y, measured, u, gone.decisions[:, -1], d_hat,
        (time[:, None] + between).ravel(), diagram.between(gone, between).ravel(),
    )  # fmt: skip


class _Diagram:
    """The loop as rows over (states, R, d, δ, η, the reading if it is rounded, applied u)."""

    def __init__(
        self,
        code: ControllerCode,
        process: HeldProcess,
        disturbed: HeldProcess,
        told: str,
        reads_in_steps: bool,
    ) -> None:
        self.code, self.process, self.disturbed = code, process, disturbed
        controller = code.wired
        sizes = {
            "process": process.B.size,
            "u": process.memory,
            "delta": disturbed.memory,
            "controller": controller.states,
        }
        ends = np.cumsum([0, *sizes.values()]).tolist()
        self.at = {
            name: slice(low, high) for name, low, high in zip(sizes, ends, ends[1:], strict=False)
        }
        self.states, self.decisions = ends[-1], 1 + reads_in_steps
        unit = np.eye(self.states + 4 + self.decisions)
        x, (r, d, delta, eta), decided = np.split(unit, [self.states, self.states + 4])
        applied = decided[-1]
        # The inputs that the process still feels, the youngest first.
        self.inputs = [
            ([now, *x[self.at[name]]], held)
            for name, now, held in (("u", applied, process), ("delta", delta, disturbed))
        ]
        y = process.C @ x[self.at["process"]] + d
        for past, held in self.inputs:
            if held.D:
                y = y + held.D * past[held.samples + 1]
        measured = decided[0] if reads_in_steps else y + eta
        own = x[self.at["controller"]]
        u = controller.C @ own + controller.D @ np.array([r, measured])
        fed = applied if told == "applied" else u
        self.signals = {"y": y, "measured": measured, "u": u, "read": y + eta, "d": d}
        self.signals["d_hat"] = self._estimate(own, measured, fed)

        renewed = np.zeros((self.states, len(unit)))
        renewed[self.at["process"]] = process.Ad @ x[self.at["process"]]
        for past, held in self.inputs:
            renewed[self.at["process"]] += np.outer(held.B0, past[held.samples])
            if held.fraction:
                renewed[self.at["process"]] += np.outer(held.B1, past[held.samples + 1])
        for name, (past, held) in zip(("u", "delta"), self.inputs, strict=True):
            if held.memory:
                renewed[self.at[name]] = past[: held.memory]
        renewed[self.at["controller"]] = controller.A @ own + controller.B @ np.array(
            [r, measured, fed]
        )
        rows = controller.rows["C"]
        C_block = controller.blocks["C"]
        start = self.at["controller"].start
        renewed[start + rows.start : start + rows.stop] += np.outer(
            C_block.B, code.tracking * (applied - u)
        )
        proposed = ["read", "u"] if reads_in_steps else ["u"]
        self.recursion = Recursion(*self._parts(renewed), *self.shown(proposed))

    def _estimate(self, own: FloatArray, measured: FloatArray, fed: FloatArray) -> FloatArray:
        """(F/Gm)(y + η) - F u, with u as late as the model's dead time."""
        controller = self.code.wired
        F, inverse = controller.blocks["F"], controller.blocks["F/Gm"]
        past = [fed, *own[controller.rows["wait"]]]
        late = (
            sum(weight * past[age] for weight, age in self.code.waited) if self.code.wait else fed
        )
        explained = inverse.C @ own[controller.rows["F/Gm"]] + inverse.D * measured
        return np.asarray(explained - F.C @ own[controller.rows["F u"]] - F.D * late)

    def _parts(self, rows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        by_state, by_input, by_decision = np.split(rows, [self.states, self.states + 4], axis=1)
        return by_state, by_input, by_decision

    def shown(self, names: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rows of some signals over states, inputs, decisions."""
        return self._parts(np.array([self.signals[name] for name in names]))

    def between(self, gone: March, after: FloatArray) -> FloatArray:
        """Follow the output some seconds after each sample, shape (N, len(after))."""
        if not after.size:
            return np.zeros((0, 0))
        rows = np.array([self._later(time) for time in after.tolist()])
        return gone.outputs(*self._parts(rows))

    def _later(self, time: float) -> FloatArray:
        """Y at a time within the sample, as a row."""
        state = (
            self.process.between(time)[0]
            @ np.eye(self.states + 4 + self.decisions)[self.at["process"]]
        )
        row = self.signals["d"] + self.process.C @ state
        for past, held in self.inputs:
            changes = held.fraction * held.dt
            late = past[held.samples + 1] if held.fraction else past[held.samples]
            if time < changes:
                felt = np.outer(held.between(time)[1], late)
                now = late
            else:
                rest, given = held.between(time - changes)
                felt = rest @ np.outer(held.between(changes)[1], late)
                now = past[held.samples]
                felt = felt + np.outer(given, now)
            row = row + held.C @ felt + held.D * now
        return np.asarray(row)

    def start(
        self, outside: FloatArray, manual: float | None, rules: list[Rule]
    ) -> tuple[FloatArray, list[float]]:
        """States and decisions before the first sample: zero, or at rest under a constant u."""
        states = np.zeros(self.states)
        if manual is None:
            return states, [0.0] * self.decisions
        u = _finite(manual, "start", "give the constant u to take over from")
        reference, d, delta, eta = outside.tolist()
        process = self.process
        given = u + delta
        x = np.linalg.lstsq(process.A, -process.B * given, rcond=None)[0]
        left = process.A @ x + process.B * given
        if np.abs(left).max(initial=0.0) > 1e-9 * np.abs(process.B * given).max(initial=0.0):
            raise ValueError(
                f"the process integrates and is not at rest at u + delta = {given:.6g}: start from "
                f"u = {-delta:.6g}"
            )
        y = float(process.C @ x) + process.D * given + d
        measured = y + eta
        before = [u]
        if len(rules) == 2:
            measured = rules[0].apply(measured, measured)
            before = [measured, u]
        states[self.at["process"]] = x
        states[self.at["u"]], states[self.at["delta"]] = u, delta
        states[self.at["controller"]] = self.code.start(reference, measured, u)
        return states, before


def _times(
    timepts: ArrayLike | None, inputs: Mapping[str, Signal], noise: Any, dt: float
) -> FloatArray:
    """Find the times of the samples: as asked, or as long as the signals are."""
    if not isinstance(inputs, Mapping):
        raise TypeError(
            f"inputs is a {type(inputs).__name__}; give a mapping, as {{'R': 1.0, 'd': values}}"
        )
    unknown = [name for name in inputs if name not in OUTSIDE]
    if unknown:
        hint = " (noise is given as noise=)" if "eta" in unknown else ""
        raise ValueError(f"{unknown[0]!r} is no input; choose from {', '.join(OUTSIDE)}{hint}")
    if timepts is None:
        given = dict(inputs) | ({} if noise is None else {"noise": noise})
        lengths = {name: np.shape(signal)[0] for name, signal in given.items()
                   if not callable(signal) and np.ndim(signal) == 1}  # fmt: skip
        if not lengths:
            raise ValueError(
                "no input says how many samples there are: give one as an array, or timepts"
            )
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{name} has {count}" for name, count in lengths.items())
            raise ValueError(f"the signals differ in length: {said} samples; make them equal")
        return np.asarray(np.arange(next(iter(lengths.values()))) * dt)
    asked = np.asarray(timepts, dtype=float)
    if asked.ndim == 0:
        last = float(asked)
        if not (isfinite(last) and last >= 0):
            raise ValueError(f"timepts is {last}; the last time is a number of seconds, 0 or more")
        return np.asarray(np.arange(int(np.floor(last / dt + 1e-9)) + 1) * dt)
    expected = np.arange(asked.size) * dt
    if asked.ndim != 1 or not asked.size:
        raise ValueError(f"timepts has the shape {asked.shape}; give the times of the samples")
    off = ~(np.abs(asked - expected) <= 1e-6 * dt)
    if off.any():
        k = int(np.argmax(off))
        raise ValueError(
            f"timepts[{k}] is {asked[k]:.6g} s, and sample {k} is at {expected[k]:.6g} s: the loop "
            f"is sampled every {dt:.6g} s from 0 on; resample the signals, or sample the loop "
            "with their dt"
        )
    return expected


def _outside(
    inputs: Mapping[str, Signal],
    noise: float | ArrayLike | None,
    time: FloatArray,
    seed: int | np.random.Generator,
) -> FloatArray:
    """All that comes from outside, R, d, δ, η, shape (N, 4)."""
    columns = [_signal(inputs.get(name, 0.0), name, time) for name in OUTSIDE]
    if noise is None:
        noise = 0.0
    if np.ndim(noise) == 0:
        deviation = _finite(noise, "noise", "give its standard deviation, or an array")
        if deviation < 0:
            raise ValueError(
                f"noise is {deviation:g}; as a number it is a standard deviation, 0 or more"
            )
        columns.append(deviation * np.random.default_rng(seed).standard_normal(time.size))
    else:
        columns.append(_signal(noise, "noise", time))
    return np.column_stack(columns)


def _signal(signal: Signal, name: str, time: FloatArray) -> FloatArray:
    values = signal(time) if callable(signal) else signal
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise TypeError(
            f"{name} is {values!r:.60}; give a number, an array with one value for each sample, or "
            "a function of the times"
        ) from None
    if found.ndim == 0:
        found = np.full(time.size, float(found))
    if found.shape != time.shape:
        raise ValueError(
            f"{name} has the shape {found.shape}, and there are {time.size} samples: give one "
            "value for each"
        )
    bad = ~np.isfinite(found)
    if bad.any():
        raise ValueError(
            f"{name}[{int(np.argmax(bad))}] is {found[bad][0]}; every value must be finite: fill "
            "the gaps first"
        )
    return found


def _finite(value: Any, name: str, remedy: str) -> float:
    number = real_number(value, name, remedy)
    if not isfinite(number):
        raise ValueError(f"{name} is {number}; {remedy}")
    return number
