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

Åström, K. J., L. Rundqwist, Integrator windup and how to avoid it, Proc. American Control
Conference (1989) 1693-1698.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from ..numerics import BoolArray, FloatArray
from .code import ControllerCode
from .hold import HeldProcess
from .limits import Rule, limited, rounded
from .recursion import march
from .signals import Signal, finite, outside, sample_times
from .wholeloop import WholeLoop

__all__ = ["SimulatedResponse", "simulate"]

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
    time = sample_times(timepts, inputs, noise, code.dt)
    given = outside(inputs, noise, time, seed)
    loop = WholeLoop(code, process, disturbed, told, resolution is not None)
    rules = [limited(code.limits, code.dt, u_resolution)]
    if resolution is not None:
        rules.insert(0, rounded(resolution))
    states, before = _start(loop, given[0], start, rules)
    entering = loop.entering(given, at_rest=start is not None)
    gone = march(loop.recursion, states, entering, rules, before)
    y, measured, u, d_hat = gone.outputs(*loop.rows(("y", "measured", "u", "d_hat"))).T
    found = SimulatedResponse(time, y, measured, u, gone.decisions[:, -1], d_hat)
    if not n_between:
        return found
    after = np.arange(n_between) * (code.dt / n_between)
    return replace(
        found,
        time_between=(time[:, None] + after).ravel(),
        y_between=gone.outputs(*loop.later(after.tolist())).ravel(),
    )


def _start(
    loop: WholeLoop, first: FloatArray, manual: float | None, rules: Sequence[Rule]
) -> tuple[FloatArray, list[float]]:
    """States and decisions before the first sample: zero, or at rest under a constant u."""
    if manual is None:
        return np.zeros(len(loop.recursion.A)), [0.0] * len(rules)
    u = finite(manual, "start", "give the constant u to take over from")
    states, y = loop.at_rest(u, first)
    R, _, _, eta = first.tolist()
    measured = y + eta
    if len(rules) == 1:
        return loop.start(states, R, measured, u), [u]
    measured = rules[0].apply(measured, measured)
    return loop.start(states, R, measured, u), [measured, u]
