r"""A drive under a sampled NR-DOB: inertia, friction, encoder, limits and dead time, all at once.

In each sample the encoder is read and, for a speed loop, a speed made of its counts. The controller
is the one that `SampledLoop.code` writes: its difference equations give the command, what is fed
forward is added, the actuator limits the sum, and the controller renews its states with what was
applied, less what was fed forward. Then the drive moves to the next sample, exactly
(`nrdob.drives.motion`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..diagram import real_number
from ..digital import (
    ActuatorLimits,
    SampledLoop,
    Signal,
    SimulatedResponse,
    external_signals,
    signal_at,
)  # fmt: skip
from ..numerics import BoolArray, FloatArray
from .encoder import Encoder, SpeedEstimate, reader
from .friction import Friction
from .motion import Motion
from .two_mass import OneMass, TwoMasses

__all__ = ["Drive", "DriveResponse"]

FRICTIONLESS = Friction()
FARTHEST = 1e150  # angle, in rad, at which a loop is said to have run away


@dataclass(frozen=True, eq=False, repr=False)
class DriveResponse(SimulatedResponse):
    """What `Drive.simulate` returns: y is the true angle or speed, `measured` is made of counts.

    Attributes
    ----------
    time, y, measured, u, applied, d_hat : arrays of float
        As of `nrdob.digital.SimulatedResponse`; u with what is fed forward.
    angle, speed, at_rest : arrays of float and of bool, shape (N,)
        The motor's true angle and speed at the samples, in rad and rad/s, and whether it is held.
    """

    angle: FloatArray
    speed: FloatArray
    at_rest: BoolArray


@dataclass(frozen=True)
class Drive:
    """A motor with what it turns, its friction, and its encoder.

    Parameters
    ----------
    inertia, friction : OneMass or TwoMasses, Friction
        What the motor turns, and its friction.
    encoder, estimate : Encoder, SpeedEstimate, optional
        In which steps its angle is read, by default none, and how a speed is made of it; by default
        the loop is one for the angle.

    Examples
    --------
    A motor that friction holds, and that lets go:

    >>> motion = Drive(OneMass(0.01), Friction(0.10, 0.15)).motion(0.1)
    >>> for torque in (0.149, 0.151):
    ...     motion.advance(torque)
    ...     print(round(motion.speed, 6))                   # 0.051 N m / 0.01 kg m² for 0.1 s
    0.0
    0.51
    """

    inertia: OneMass | TwoMasses
    friction: Friction = FRICTIONLESS
    encoder: Encoder | None = None
    estimate: SpeedEstimate | None = None

    def motion(self, dt: float, delay: float = 0.0) -> Motion:
        """Start to move the drive from sample to sample.

        Parameters
        ----------
        dt, delay : float
            As of `nrdob.drives.motion.Motion`.
        """
        return Motion(self.inertia, self.friction, dt, delay)

    def reader(self, motion: Motion) -> Callable[[float], float]:
        """Start to read the encoder, once in each sample from the first one on.

        What is given makes y of a true angle in rad: an angle in steps, or a speed made of them.

        Parameters
        ----------
        motion : Motion
            Which this drive makes.
        """
        return reader(self.encoder, self.estimate, motion)

    @np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
    def simulate(
        self,
        sampled: SampledLoop,
        inputs: Mapping[str, Signal],
        noise: float | ArrayLike | None = None,
        limits: ActuatorLimits | None = None,
        *,
        timepts: ArrayLike | None = None,
        seed: int | np.random.Generator = 0,
        tracking_time: float | None = None,
        feedforward: Signal = 0.0,
        dead_band: float = 0.0,
    ) -> DriveResponse:
        """Run the drive under a sampled controller, from rest at the angle 0.

        Parameters
        ----------
        sampled : SampledLoop
            Its controller runs, and the dead time of its process and computation passes. Otherwise
            the process is this drive, and not the one that the loop was designed for.
        inputs : mapping of "R", "delta" to signals
            Reference and the load's torque on the load: a number, an array (N,), or a function of
            the times. Each value is held from its sample to the next.
        noise : float or (N,) array_like, optional
            Added to the angle before it is rounded, in rad, or the standard deviation of it.
        limits, timepts, seed, tracking_time : optional
            As for `SampledLoop.simulate`; the limits are those of the torque.
        feedforward, dead_band : Signal, float
            Torque that is added to the controller's, see `Friction.feedforward`, and the error, in
            the unit of y, by which what the controller reads is nearer to R.

        Examples
        --------
        A position loop pushes until the motor breaks away at 0.15 N m, and hunts:

        >>> import control as ct
        >>> import nrdob
        >>> angle = ct.tf([1], [0.01, 0.1, 0])
        >>> F = nrdob.interpolating_filter(angle, 0.02, ramp=2)
        >>> loop = nrdob.NRDOB(angle, angle, 9 + 0.32 * ct.tf([1, 0], [0.005, 1]), F)
        >>> drive = Drive(OneMass(0.01), Friction(0.10, 0.15, 0.05, viscous=0.1), Encoder(10_000))
        >>> found = drive.simulate(loop.sampled(0.001), {"R": 1.0}, timepts=10.0)
        >>> bool(found.u[-5000:].max() > 0.14 and found.u[-5000:].min() < -0.14)
        True
        """
        remedy = "give a finite width in the unit of y, 0 or more"
        width = real_number(dead_band, "dead_band", remedy, least=0.0)
        if "d" in inputs:
            raise ValueError("a drive has no disturbance at its output: give the load as 'delta'")
        code = sampled.code(limits, tracking_time=tracking_time)
        time, external = external_signals(inputs, noise, timepts, sampled.dt, seed)
        fed = signal_at(feedforward, "feedforward", time)
        motion = self.motion(sampled.dt, sampled.process.delay)
        read = self.reader(motion)

        controller = code.controller
        n = controller.states
        # States to come, command, estimate over (states, r, y) while nothing is limited, and what
        # they gain for each N m that the applied torque has more than the command.
        command_row = np.append(controller.C, controller.D)
        acting = np.concatenate([controller.B[:, 2], [0.0], controller.estimate[-1:]])
        free = np.vstack([
            np.column_stack([controller.A, controller.B[:, :2]]),
            command_row,
            controller.estimate[:-1],
        ]) + np.outer(acting, command_row)  # fmt: skip
        acting[:n][controller.rows["C"]] += code.tracking * controller.blocks["C"].B
        limit = code.rule.apply
        z, applied = np.zeros(n + 2), 0.0
        rows: list[tuple[float, ...]] = []
        for R, _, load, eta, more in np.column_stack([external, fed]).tolist():
            angle, speed, held = motion.angle, motion.speed, motion.at_rest
            measured = read(angle + eta)
            z[n] = R
            z[n + 1] = R - max(R - measured - width, min(R - measured + width, 0.0))
            found = free.dot(z)
            command = float(found[n]) + more
            applied = limit(command, applied)
            if applied != command:
                found += (applied - command) * acting
            rows.append((angle, speed, measured, command, applied, float(found[n + 1]), held))
            z[:n] = found[:n]
            motion.advance(applied, load)
            if not abs(motion.angle) < FARTHEST:
                raise ArithmeticError(
                    f"the signals leave the range of floating-point numbers near sample "
                    f"{len(rows)}: the loop is unstable; simulate fewer samples"
                )
        angles, speeds, readings, u, acted, d_hat, rests = np.array(rows).T
        return DriveResponse(
            time, angles if self.estimate is None else speeds, readings, u, acted, d_hat,
            angle=angles, speed=speeds, at_rest=rests.astype(bool),
        )  # fmt: skip
