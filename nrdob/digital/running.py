"""What a sampled loop does: it runs on given signals, and its controller is written as code."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..diagram import Fraction, LoopEquations
from .code import ControllerCode, controller_code
from .controller import Wait
from .hold import HeldProcess, held_process
from .limits import Limits
from .signals import Signal
from .simulation import SimulatedResponse, simulate

__all__ = ["RunningLoop"]


class RunningLoop:
    """The part of `nrdob.digital.SampledLoop` that runs."""

    if TYPE_CHECKING:
        loop: LoopEquations
        dt: float

        @property
        def alpha(self) -> float:
            """Of w = (z - 1)/(α (z + 1)), in seconds."""

        @property
        def wait(self) -> Wait:
            """Dead time of the model in samples."""

        @property
        def process(self) -> HeldProcess:
            """Process between hold and sampler."""

        @property
        def fractions(self) -> Mapping[str, Fraction]:
            """Blocks of the controller in powers of w."""

    def code(
        self, limits: Limits | None = None, *, tracking_time: float | None = None
    ) -> ControllerCode:
        """Make the controller ready to be written as C, Python or JSON.

        It is written for any loop; whether the loop is stable is what `stability()` says.

        Parameters
        ----------
        limits : Limits, optional
            Range and rate of the actuator.
        tracking_time : float, optional
            Time in seconds in which the integrator of C follows a u that is limited; by default it
            is left to itself.

        Returns
        -------
        ControllerCode
            With `to_c()`, `to_python()` and `to_json()`.
        """
        return controller_code(
            self.fractions, self.alpha, self.wait, self.dt,
            limits=limits, tracking_time=tracking_time,
        )  # fmt: skip

    def to_c(
        self,
        name: str = "nrdob",
        dtype: str = "double",
        limits: Limits | None = None,
        *,
        tracking_time: float | None = None,
    ) -> str:
        """Write the controller as one small C99 file: see `nrdob.digital.ControllerCode.to_c`.

        Parameters
        ----------
        name : str
            What the names in it begin with.
        dtype : {"double", "float"}
            Type of all numbers.
        limits, tracking_time : as for `code`
            The actuator, and how C follows it.
        """
        return self.code(limits, tracking_time=tracking_time).to_c(name, dtype)

    def to_header(self, name: str = "nrdob", dtype: str = "double") -> str:
        """Write the header of the C file: see `nrdob.digital.ControllerCode.to_header`.

        Parameters
        ----------
        name, dtype : as for `to_c`
            The same as there.
        """
        return self.code().to_header(name, dtype)

    def to_python(
        self,
        name: str = "Controller",
        limits: Limits | None = None,
        *,
        tracking_time: float | None = None,
    ) -> str:
        """Write the controller as one Python class that needs nothing else.

        Parameters
        ----------
        name : str
            Name of the class.
        limits, tracking_time : as for `code`
            The actuator, and how C follows it.
        """
        return self.code(limits, tracking_time=tracking_time).to_python(name)

    def to_json(self, limits: Limits | None = None, *, tracking_time: float | None = None) -> str:
        """Write the coefficients: see `nrdob.digital.ControllerCode.to_json`.

        Parameters
        ----------
        limits, tracking_time : as for `code`
            The actuator, and how C follows it.
        """
        return self.code(limits, tracking_time=tracking_time).to_json()

    def simulate(
        self,
        inputs: Mapping[str, Signal],
        noise: float | ArrayLike | None = None,
        limits: Limits | None = None,
        *,
        timepts: ArrayLike | None = None,
        seed: int | np.random.Generator = 0,
        observer_input: str = "applied",
        tracking_time: float | None = None,
        start: float | None = None,
        resolution: float | None = None,
        u_resolution: float | None = None,
        n_between: int = 0,
    ) -> SimulatedResponse:
        """Run the loop on given signals, with noise and an actuator that has limits.

        Parameters
        ----------
        inputs : mapping of "R", "d", "delta" to signals
            Reference, output and input disturbance: a number, an array (N,), or a function of the
            times. Each value is held from its sample to the next; what is left out is 0.
        noise : float or (N,) array_like, optional
            Measurement noise, or the standard deviation of white noise.
        limits : Limits, optional
            Range and rate of the actuator.
        timepts : (N,) array_like or float, optional
            Times of the samples, 0, dt, 2 dt, …, in seconds, or the last one; by default as many
            as the arrays have.
        seed : int or numpy.random.Generator
            Where white noise comes from.
        observer_input : {"applied", "commanded"}
            Which u the observer is told: what the actuator does, or what it was to do.
        tracking_time : float, optional
            Time in seconds in which the integrator of C follows a u that is limited
            (back-calculation); by default it is left to itself.
        start : float, optional
            A constant u to take over from without a bump, the process at rest under it and the
            first d and delta. By default everything is 0 before.
        resolution, u_resolution : float, optional
            Steps of the converters that read y and write u.
        n_between : int
            Points in each sample at which the output is computed in continuous time.

        Returns
        -------
        SimulatedResponse
            `time`, `y`, `measured`, `u`, `applied`, `d_hat`, and `time_between`, `y_between`.

        Raises
        ------
        TypeError, ValueError
            If a signal is of the wrong length or not finite, an input is unknown, the times are
            not those of the samples, or the process is not at rest at `start`.
        ArithmeticError
            If the signals leave the range of floating-point numbers.

        Examples
        --------
        >>> import control as ct
        >>> import nrdob
        >>> Gm = ct.tf([2], [1, 1])
        >>> loop = nrdob.NRDOB(process=Gm, model=Gm, controller=ct.tf([1, 1], [1, 0]),
        ...                    filter=nrdob.LowPassFilter(0.5, 1))
        >>> given, limits = {"R": 1.0, "delta": -0.3}, nrdob.digital.Limits(0, 0.9)
        >>> loop.sampled(0.1).simulate(given, limits=limits, timepts=10)
        101 samples to 10 s, u limited in 8 of them
        y        from 0 to 0.999983, at last 0.999983
        u        from 0.8 to 1.05, at last 0.8
        applied  from 0.8 to 0.9, at last 0.8
        """
        return simulate(
            self.code(limits, tracking_time=tracking_time), self.process,
            held_process(self.loop.fractions.G, self.loop.delay, self.dt), inputs, noise,
            timepts=timepts, seed=seed, told=observer_input, start=start,
            resolution=resolution, u_resolution=u_resolution, n_between=n_between,
        )  # fmt: skip
