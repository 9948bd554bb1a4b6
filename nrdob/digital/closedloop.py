r"""Process, controller and all inputs as one recursion, from sample to sample.

Every signal of the loop is a row over the states (the process, the past u that still act on it, the
controller), the external inputs, and the *decisions* of the sample: the reading, if a converter
rounds it, and the u that the actuator applies. With x the states, w the inputs and v the decisions,

.. math:: x_{k+1} = A x_k + B w_k + G v_k, \qquad v_k = \text{rule}(C x_k + D w_k + H v_k, v_{k-1})

with H strictly lower triangular. Everything else rests on this recursion: without limits it is the
matrix whose eigenvalues decide about stability and the system whose covariance is that of noise;
with limits it is what a simulation runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from ..numerics import FloatArray
from .controller import SampledController
from .hold import WHOLE, HeldProcess

__all__ = ["ClosedLoop", "Recursion", "first_unstable"]

ENTERING = ("R", "d", "eta", "delta", "delta a sample earlier")
"""The external inputs, δ behind the dead time of the process."""

SHARP = 10.0  # how much more a local maximum may rise between values than it does over them
STILL = 1e-9  # rate of change, against what u and δ would cause, that is rounding


class Recursion(NamedTuple):
    """The matrices of one sample, for n states, q inputs, p decisions: A is (n, n), H (p, p)."""

    A: FloatArray
    B: FloatArray
    G: FloatArray
    C: FloatArray
    D: FloatArray
    H: FloatArray


class ClosedLoop:
    """A sampled loop as one recursion, over the states of process, past u and controller.

    `process` has the dead time from u to y, that of computation included, `disturbed` that from δ,
    by default the same. `observer_input` says whether the observer receives the "applied" or the
    "commanded" u, `tracking` which share of u's limitation is added to the error of C, and `rounds`
    whether the reading is a decision, too.
    """

    def __init__(
        self,
        controller: SampledController,
        process: HeldProcess,
        disturbed: HeldProcess | None = None,
        *,
        observer_input: str = "applied",
        tracking: float = 0.0,
        rounds: bool = False,
    ) -> None:
        self._controller, self.process = controller, process
        self.disturbed = disturbed or process
        ends = np.cumsum([process.B.size, process.memory, controller.states]).tolist()
        self._cuts = [ends[-1], ends[-1] + len(ENTERING)]
        unit = np.eye(self._cuts[-1] + 1 + rounds)
        states, (R, d, eta, *late_delta), decided = np.split(unit, self._cuts)
        x, past, own = np.split(states, ends[:-1])
        applied = decided[-1]
        late_u = [applied, *past, applied][process.samples : process.samples + 2]

        y = process.C @ x + d + process.D * (late_u[1] + late_delta[1])
        measured = decided[0] if rounds else y + eta
        u = controller.C @ own + controller.D @ np.array([R, measured])
        received = applied if observer_input == "applied" else u
        entering = np.array([R, measured, received])
        self._signals = {
            "x": x, "felt": np.array([*late_u, *late_delta]), "d": d, "y": y, "read": y + eta,
            "measured": measured, "u": u,
            "d_hat": controller.estimate @ np.vstack([own, entering]),
        }  # fmt: skip

        renewed_own = controller.A @ own + controller.B @ entering
        if tracking:
            renewed_own[controller.rows["C"]] += np.outer(
                controller.blocks["C"].B, tracking * (applied - u)
            )
        renewed_x = process.Ad @ x
        for held, (now, before) in ((process, late_u), (self.disturbed, late_delta)):
            renewed_x += np.outer(held.B0, now) + np.outer(held.B1, before)
        renewed = [renewed_x, *[applied, *past][: process.memory], renewed_own]
        by_states = np.split(np.vstack(renewed), self._cuts, axis=1)
        self.recursion = Recursion(*by_states, *self.rows(["read", "u"] if rounds else ["u"]))

    @property
    def A(self) -> FloatArray:
        """Matrix of the linear loop from sample to sample, shape (n, n)."""
        return np.asarray(self.recursion.A + self.recursion.G @ self.recursion.C)

    @property
    def spectral_radius(self) -> float:
        """Modulus of the largest eigenvalue of `A`."""
        return float(np.abs(np.linalg.eigvals(self.A)).max(initial=0.0))

    @cached_property
    def from_noise(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The linear loop from η to y and u, shapes (n, n), (n,), (2, n) and (2,)."""
        eta = ENTERING.index("eta")
        C, D, H = self.rows(["y", "u"])
        proposed, direct = self.recursion.C, self.recursion.D[:, eta]
        B = self.recursion.B[:, eta] + self.recursion.G @ direct
        return self.A, B, C + H @ proposed, D[:, eta] + H @ direct

    def rows(self, names: Sequence[str]) -> list[FloatArray]:
        """Write signals as rows over states, inputs and decisions: three matrices.

        Signals are "x" (of the process), "d", "y", "read" (y with noise), "measured" (what is
        rounded of it), "u", "d_hat", and "felt", u and δ as the process receives them at the end of
        a sample and at its beginning.
        """
        return np.split(np.vstack([self._signals[name] for name in names]), self._cuts, axis=1)

    def output_after(self, time: float, x: FloatArray, felt: FloatArray) -> FloatArray:
        """Compute the output, without d, some seconds after N samples; after a jump where it jumps.

        `x` and `felt` are those of `rows`, shapes (n, N) and (4, N).
        """
        process = self.process
        Phi, Gamma = process.transition(time)
        x, direct = Phi @ x, np.zeros(x.shape[1])
        for held, (now, before) in ((process, felt[:2]), (self.disturbed, felt[2:])):
            jump = held.fraction * held.dt
            arrived = time >= jump - WHOLE * held.dt
            direct += now if arrived else before
            x += np.outer(Gamma, before if jump else now)
            if jump and arrived and np.any(now != before):
                x += np.outer(process.transition(max(time - jump, 0.0))[1], now - before)
        return np.asarray(process.C @ x + process.D * direct)

    def entering(self, external: FloatArray, *, at_rest: bool) -> FloatArray:
        """Turn R, d, δ, η, shape (N, 4), into the inputs of the recursion, shape (N, 5).

        Before the first sample δ is 0, or `at_rest` what it is at first.
        """
        R, d, delta, eta = external.T
        before = np.full(self.disturbed.samples + 1, delta[0] if at_rest else 0.0)
        late = np.concatenate([before, delta])
        return np.column_stack([R, d, eta, late[1 : delta.size + 1], late[: delta.size]])

    def at_rest(
        self, u: float, external: FloatArray, read: Callable[[float], float]
    ) -> tuple[FloatArray, float]:
        """Find the state of rest under a constant u, shape (n,), and the reading of y + η.

        `external` holds R, d, δ and η. A process that integrates u + δ has none: ValueError.
        """
        process, (R, d, delta, eta) = self.process, external.tolist()
        x = np.linalg.lstsq(process.A, -process.B * (u + delta), rcond=None)[0]
        left = process.A @ x + process.B * (u + delta)
        size = np.abs(process.B).max(initial=0.0) * (abs(u) + abs(delta))
        if np.abs(left).max(initial=0.0) > STILL * size:
            raise ValueError(
                f"the process integrates and is not at rest at u + delta = {u + delta:.6g}: start "
                f"from u = {0.0 - delta:.6g}"
            )
        measured = read(float(process.C @ x) + process.D * (u + delta) + d + eta)
        past = np.full(process.memory, u)
        return np.concatenate([x, past, self._controller.start(R, measured, u)]), measured


def first_unstable(
    excess: Callable[[float], float], values: FloatArray
) -> tuple[float, float] | None:
    """Bracket the first value of a parameter at which a loop is unstable; at the lowest it is not.

    `excess` gives the spectral radius, less 1, at a value; `values`, increasing, are looked at, and
    between them each local maximum that may reach 0.
    """
    seen: list[float] = []
    for k, value in enumerate(values.tolist()):
        seen.append(excess(value))
        if seen[-1] >= 0:
            return float(values[k - 1]), value
        if k < 2:
            continue
        before, top, after = seen[-3:]
        if top >= max(before, after) and top + SHARP * (top - min(before, after)) >= 0:
            # A local maximum, near enough to 0 for how sharp it is: how high is it?
            low, high = float(values[k - 2]), value
            highest = minimize_scalar(lambda t: -excess(t), bounds=(low, high), method="bounded")
            if -highest.fun >= 0:
                return low, float(highest.x)
    return None
