r"""The motion of a drive with dry friction, exact between its events, and each event where it is.

A drive is in one of five modes, and linear in each. At rest the motor stands still, and a load on a
shaft may swing on it; in motion the friction is constant, or falls with the speed on
Stribeck's slope, to either side. Signals are watched (`nrdob.drives.pieces`): the speed must not
pass 0, nor the end of the slope, and at rest the torque on the motor must not exceed the stiction.
When the speed is 0 the mode is chosen anew by that torque alone: either it is held, or it exceeds
the stiction and the motor moves its way. So a drive at rest is at rest, and does not chatter.
"""

from __future__ import annotations

from collections import deque
from math import floor

import numpy as np

from ..digital import in_samples
from ..numerics import FloatArray
from .friction import Friction
from .pieces import Stretch, stretches
from .two_mass import OneMass, TwoMasses

__all__ = ["Motion"]

# The mode at rest; -1 and 1 are on Stribeck's slope, -2 and 2 beyond it, by their direction.
REST = 0
MOST_EVENTS = 10_000  # events in one stretch of a sample

Mechanics = tuple[FloatArray, FloatArray, FloatArray]

HELD = 1e-12  # share by which a torque may exceed the stiction that holds it, by rounding


class Motion:
    """A drive that is moved from sample to sample, at rest at first.

    Parameters
    ----------
    inertia, friction : OneMass or TwoMasses, Friction
        What the motor turns, and its friction.
    dt, delay : float
        Sampling time, and time from a command to its torque, in seconds.

    Attributes
    ----------
    dt, events, mode : float, int, int
        Sampling time, how often the mode has changed, and the present one: 0 at rest, else with the
        sign of the speed.
    """

    def __init__(
        self, inertia: OneMass | TwoMasses, friction: Friction, dt: float, delay: float = 0.0
    ) -> None:
        mechanics = _mechanics(inertia, friction.viscous)
        self._n = n = len(mechanics[0])
        self._friction = friction
        kinds = (-2, -1, REST, 1, 2) if friction.slope else (-2, REST, 2)
        modes = {mode: _linear(mode, mechanics, friction) for mode in kinds}
        self._net = modes[REST][1][0] - modes[REST][1][1]  # twice the torque that friction holds
        samples, fraction = in_samples(delay, dt)
        self._past = deque([0.0] * (samples + 2), maxlen=samples + 2)
        self._plan: list[tuple[int, float, dict[int, Stretch]]] = []
        for age, share in enumerate((fraction, 1 - fraction)):
            if share:
                count = max(stretches(M, share * dt) for M, _ in modes.values())
                time = share * dt / count
                tables = {mode: Stretch(*linear, time, n) for mode, linear in modes.items()}
                self._plan += [(age, time, tables)] * count
        self.dt, self.events, self.mode = dt, 0, REST
        self._z = np.zeros(n + 3)
        self._z[-1] = 1.0
        self._passages: list[tuple[float, Stretch, float, FloatArray]] | None = None

    @property
    def angle(self) -> float:
        """Angle of the motor, in rad."""
        return float(self._z[0])

    @property
    def speed(self) -> float:
        """Speed of the motor, in rad/s."""
        return float(self._z[1])

    @property
    def at_rest(self) -> bool:
        """Whether friction holds the motor."""
        return self.mode == REST

    @property
    def states(self) -> FloatArray:
        """Angle and speed of the motor; of two masses also the twist and the load's speed."""
        return self._z[: self._n].copy()

    def last_edge(self, step: float) -> tuple[float, float] | None:
        """Find the last edge of an encoder in the last sample, if there is one.

        Given are its angle in rad, and how long it is ago in seconds. What is needed for it is kept
        from the first call on.

        Parameters
        ----------
        step : float
            Step of the encoder, in rad; edges are half a step beside whole steps.
        """
        self._passages = self._passages or []
        for start, stretch, share, z in reversed(self._passages):
            first, last = z[0], stretch.states_at(z, share)[0]
            after = floor(last / step + 0.5)
            if after == floor(first / step + 0.5):
                continue
            edge = (after - 0.5 if last > first else after + 0.5) * step
            at = stretch.crossing(z, edge, share)  # the angle does not turn back in a passage
            return edge, self.dt - start - at * stretch.time
        return None

    def advance(self, torque: float, load: float = 0.0) -> None:
        """Move through one sample.

        Parameters
        ----------
        torque, load : float
            The command from now on, which reaches the motor after the delay, and the torque on the
            load (of one mass, on the motor) during this sample, in N m.
        """
        z, n, past = self._z, self._n, self._past
        past.append(torque)
        z[n + 1] = load
        if self._passages is not None:
            self._passages.clear()
        start = 0.0
        for age, time, tables in self._plan:
            z[n] = past[age]
            stretch = tables[self.mode]
            found = stretch.watched.dot(z).tolist()
            if min(found[n:]) >= 0.0:
                self._keep(start, stretch, 1.0)
                z[:n] = found[:n]
            else:
                self._through(tables, start)
            start += time

    def _through(self, tables: dict[int, Stretch], start: float) -> None:
        """Move through a stretch in which the mode may change."""
        z, n, left = self._z, self._n, 1.0
        for _ in range(MOST_EVENTS):
            stretch = tables[self.mode]
            event = stretch.exit(z, left)
            share = left if event is None else event[0]
            self._keep(start, stretch, share)
            z[:n] = stretch.states_at(z, share)
            if event is None:
                return
            self._change(event[1])
            start, left = start + share * stretch.time, left - share
        raise ArithmeticError(
            f"{MOST_EVENTS} events of friction in {stretch.time:g} s: the shaft is so stiff that "
            "it swings that often; choose a shorter dt, or a drive of one mass"
        )

    def _keep(self, start: float, stretch: Stretch, share: float) -> None:
        if self._passages is not None and share:
            self._passages.append((start, stretch, share, self._z.copy()))

    def _change(self, guard: int) -> None:
        """Choose the mode after an event: `guard` is what would have become negative."""
        self.events += 1
        z, mode, slope = self._z, self.mode, self._friction.slope > 0
        slow, fast = (1, 2) if slope else (2, 2)
        direction = 1 if mode > 0 else -1
        if mode == REST:
            self.mode = slow if guard == 0 else -slow
        elif slope and (abs(mode) == fast or guard == 1):
            self.mode = direction * (slow if abs(mode) == fast else fast)
            z[1] = direction * self._friction.stribeck_speed
        else:
            z[1] = 0.0
            torque = -float(self._net @ z) / 2
            held = abs(torque) <= self._friction.breakaway * (1 + HELD)
            self.mode = REST if held else slow if torque > 0 else -slow


def _mechanics(inertia: OneMass | TwoMasses, viscous: float) -> Mechanics:
    """Give x' = A x + B τ + E δ, the first states the motor's angle and speed."""
    if isinstance(inertia, OneMass):
        B = np.array([0.0, 1 / inertia.inertia])
        return np.array([[0.0, 1.0], [0.0, -viscous / inertia.inertia]]), B, B
    Jm, Jl, k, c = inertia.motor, inertia.load, inertia.stiffness, inertia.damping
    A = np.array([
        [0.0, 1.0, 0.0, 0.0],
        [0.0, -(c + viscous) / Jm, -k / Jm, c / Jm],
        [0.0, 1.0, 0.0, -1.0],
        [0.0, c / Jl, k / Jl, -c / Jl],
    ])  # fmt: skip
    return A, np.array([0.0, 1 / Jm, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1 / Jl])


def _linear(mode: int, mechanics: Mechanics, friction: Friction) -> tuple[FloatArray, FloatArray]:
    """Write generator and guards of a mode over the states, the torque, the load, and 1."""
    n = len(mechanics[0])
    M = np.zeros((n + 3, n + 3))
    M[:n, :n], M[:n, n], M[:n, n + 1] = mechanics
    inertia = 1 / mechanics[1][1]
    speed, one = np.eye(n + 3)[[1, -1]]
    if mode == REST:
        torque = inertia * M[1]
        torque[1] = 0.0
        M[:2] = 0.0
        held = friction.breakaway * one
        return M, np.array([held - torque, held + torque])
    direction = 1.0 if mode > 0 else -1.0
    if abs(mode) == 1:
        M[1] += (friction.slope * speed - direction * friction.breakaway * one) / inertia
        end = friction.stribeck_speed * one - direction * speed
        return M, np.array([direction * speed, end])
    M[1] -= direction * friction.coulomb * one / inertia
    lowest = friction.stribeck_speed if friction.slope else 0.0
    return M, (direction * speed - lowest * one)[None]
