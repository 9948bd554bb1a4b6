r"""Process, controller and all that enters, as the rows of one recursion.

Every signal of the loop is a row over the states (the process, the u that it still feels, the
sections of the controller), what comes from outside, and the decisions of the sample: the reading,
if a converter rounds it, and the u that is applied. The process feels u and δ some samples later; δ
is known in advance and enters as late as it is felt.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..numerics import FloatArray
from .code import ControllerCode
from .hold import HeldProcess
from .recursion import Recursion

__all__ = ["WholeLoop"]

Rows = tuple[FloatArray, FloatArray, FloatArray]
"""Rows of signals over states, inputs and decisions."""

ENTERING = ("R", "d", "eta", "delta", "delta a sample earlier")
"""What comes from outside, δ as late as the process feels it."""


STILL = 1e-9
"""Rate of change, against what u and δ would cause, that is rounding."""


class WholeLoop:
    """The loop as one recursion.

    Parameters
    ----------
    code : ControllerCode
        The controller.
    process, disturbed : HeldProcess
        The process as u reaches it, with the dead time of computation, and as δ does.
    told : {"applied", "commanded"}
        Which u the observer is told.
    rounds : bool
        Whether the reading is a decision, too.

    Attributes
    ----------
    recursion : Recursion
        Its matrices; what is decided is the reading, if it is rounded, and the applied u.
    """

    def __init__(
        self,
        code: ControllerCode,
        process: HeldProcess,
        disturbed: HeldProcess,
        told: str,
        rounds: bool,
    ) -> None:
        self._code, self._process, self._disturbed = code, process, disturbed
        controller = code.wired
        sizes = {
            "process": process.B.size,
            "u": process.memory,
            "controller": controller.states,
        }
        ends = np.cumsum([0, *sizes.values()]).tolist()
        self._at = dict(zip(sizes, map(slice, ends[:-1], ends[1:]), strict=True))
        self._cuts = [ends[-1], ends[-1] + len(ENTERING)]
        unit = np.eye(self._cuts[-1] + 1 + rounds)
        states, (R, d, eta, *late_delta), decided = np.split(unit, self._cuts)
        x, past, own = (states[rows] for rows in self._at.values())
        applied = decided[-1]
        late_u = [applied, *past, applied][process.samples : process.samples + 2]
        self._felt = ((late_u, process), (late_delta, disturbed))

        y = process.C @ x + d + process.D * (late_u[1] + late_delta[1])
        measured = decided[0] if rounds else y + eta
        u = controller.C @ own + controller.D @ np.array([R, measured])
        fed = applied if told == "applied" else u
        self._signals = {
            "x": x, "d": d, "y": y, "read": y + eta, "measured": measured, "u": u,
            "d_hat": self._estimate(own, measured, fed),
        }  # fmt: skip

        renewed_own = controller.A @ own + controller.B @ np.array([R, measured, fed])
        renewed_own[controller.rows["C"]] += np.outer(
            controller.blocks["C"].B, code.tracking * (applied - u)
        )
        renewed = [self._moved(process.dt), [applied, *past][: process.memory], renewed_own]
        self.recursion = Recursion(
            *self._split(np.vstack([np.reshape(rows, (-1, len(unit))) for rows in renewed])),
            *self.rows(["read", "u"] if rounds else ["u"]),
        )

    def rows(self, names: Sequence[str]) -> Rows:
        """Show some signals.

        Parameters
        ----------
        names : sequence of str
            From "y", "read" (y with noise), "measured" (what is made of it), "u", "d_hat".
        """
        return self._split(np.array([self._signals[name] for name in names]))

    def later(self, times: Sequence[float]) -> Rows:
        """Show the output at some times after each sample.

        Parameters
        ----------
        times : sequence of float
            Seconds, from 0 on and below dt.
        """
        found = []
        for time in times:
            y = self._process.C @ self._moved(time) + self._signals["d"]
            for (now, before), held in self._felt:
                y = y + held.D * (before if time < held.fraction * held.dt else now)
            found.append(y)
        return self._split(np.array(found))

    def entering(self, outside: FloatArray, *, at_rest: bool) -> FloatArray:
        """Make of R, d, δ, η what enters the recursion.

        Parameters
        ----------
        outside : (N, 4) array of float
            The signals.
        at_rest : bool
            Whether δ has been before what it is at first, or 0.

        Returns
        -------
        (N, 5) array of float
            R, d, η, and δ as late as it is felt, and one sample earlier.
        """
        R, d, delta, eta = outside.T
        before = np.full(self._disturbed.samples + 1, delta[0] if at_rest else 0.0)
        late = np.concatenate([before, delta])
        return np.column_stack([R, d, eta, late[1 : delta.size + 1], late[: delta.size]])

    def at_rest(self, u: float, outside: FloatArray) -> tuple[FloatArray, float]:
        """Start at rest under a constant u.

        Parameters
        ----------
        u : float
            The constant input.
        outside : (4,) array of float
            R, d, δ, η at the first sample.

        Returns
        -------
        states : (n,) array of float
            The process and the u that it feels; the controller is left at 0.
        y : float
            The output.

        Raises
        ------
        ValueError
            If the process integrates u + δ.
        """
        process, (_, d, delta, _) = self._process, outside.tolist()
        x = np.linalg.lstsq(process.A, -process.B * (u + delta), rcond=None)[0]
        left = process.A @ x + process.B * (u + delta)
        size = np.abs(process.B).max(initial=0.0) * (abs(u) + abs(delta))
        if np.abs(left).max(initial=0.0) > STILL * size:
            raise ValueError(
                f"the process integrates and is not at rest at u + delta = {u + delta:.6g}: start "
                f"from u = {0.0 - delta:.6g}"
            )
        states = np.zeros(self._cuts[0])
        states[self._at["process"]], states[self._at["u"]] = x, u
        return states, float(process.C @ x) + process.D * (u + delta) + d

    def start(self, states: FloatArray, R: float, measured: float, u: float) -> FloatArray:
        """Put the controller at rest, too.

        Parameters
        ----------
        states : (n,) array of float
            From `at_rest`.
        R, measured, u : float
            Reference, reading, and the constant u.
        """
        found = states.copy()
        found[self._at["controller"]] = self._code.start(R, measured, u)
        return found

    def _moved(self, time: float) -> FloatArray:
        """States of the process some time after the sample."""
        x = self._process.between(time)[0] @ self._signals["x"]
        for (now, before), held in self._felt:
            change = min(held.fraction * held.dt, time)
            rest, given = held.between(time - change)
            x = x + np.outer(given, now) + np.outer(rest @ held.between(change)[1], before)
        return np.asarray(x)

    def _estimate(self, own: FloatArray, measured: FloatArray, fed: FloatArray) -> FloatArray:
        """(F/Gm)(y + η) - F u, with u as late as the model's dead time."""
        controller = self._code.wired
        F, inverse = controller.blocks["F"], controller.blocks["F/Gm"]
        late = fed
        if self._code.wait:
            past = np.array([fed, *own[controller.rows["wait"]]])
            late = np.sum([weight * past[age] for weight, age in self._code.waited], axis=0)
        explained = inverse.C @ own[controller.rows["F/Gm"]] + inverse.D * measured
        return np.asarray(explained - F.C @ own[controller.rows["F u"]] - F.D * late)

    def _split(self, rows: FloatArray) -> Rows:
        by_state, by_input, by_decision = np.split(rows, self._cuts, axis=1)
        return by_state, by_input, by_decision
