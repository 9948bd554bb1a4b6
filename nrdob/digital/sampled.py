r"""The loop on a processor: the process behind a hold, the observer as difference equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import isfinite, pi, tan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..analysis import NoiseVariance
from ..diagram import Fraction, LoopEquations, real_number, six_digits
from ..numerics import FloatArray, QuasiPolynomial
from .code import ControllerCode, controller_code
from .controller import SampledController, Wait, bilinear_block, wired
from .hold import HeldProcess, held_process, in_samples
from .limits import Limits
from .noise import sampled_noise_variance
from .simulation import Signal, SimulatedResponse, simulate

__all__ = ["METHODS", "SampledLoop"]

METHODS = ("tustin", "zoh")
"""How a block is sampled."""

Factor = FloatArray | QuasiPolynomial


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """An NR-DOB loop whose controller runs on a processor: what `NRDOB.sampled` returns.

    Parameters
    ----------
    loop : LoopEquations
        The loop in continuous time.
    dt : float
        Sampling time in seconds.
    method : {"tustin", "zoh"}
        How the blocks are sampled.
    computation_delay : float
        Time from reading y to writing u, in seconds.
    prewarp : float, optional
        Frequency in rad/s at which Tustin's rule is exact.
    """

    loop: LoopEquations
    dt: float
    method: str = "tustin"
    computation_delay: float = 0.0
    prewarp: float | None = None

    def __post_init__(self) -> None:
        for name in ("dt", "computation_delay"):
            value = real_number(getattr(self, name), name, "give seconds as a number")
            object.__setattr__(self, name, value)
        if not (isfinite(self.dt) and self.dt > 0):
            raise ValueError(
                f"dt is {self.dt}; the sampling time is a positive, finite number of seconds"
            )
        if not (isfinite(self.computation_delay) and self.computation_delay >= 0):
            raise ValueError(
                f"computation_delay is {self.computation_delay}; u is written some seconds after y "
                "is read: 0 or more, and finite"
            )
        if self.method not in METHODS:
            raise ValueError(f"method is {self.method!r}; choose one of {', '.join(METHODS)}")
        self._check_prewarp()
        if self.loop.ill_posed_model_loop:
            raise ValueError(f"no sampled loop: {self.loop.ill_posed_model_loop}")
        _ = self.controller

    def _check_prewarp(self) -> None:
        if self.prewarp is None:
            return
        value = real_number(self.prewarp, "prewarp", "give a frequency in rad/s as a number")
        object.__setattr__(self, "prewarp", value)
        if self.method != "tustin":
            raise ValueError("prewarp belongs to Tustin's rule: leave it out, or method='tustin'")
        if not 0 < value < pi / self.dt:
            raise ValueError(
                f"prewarp is {value:g} rad/s; it must lie between 0 and the Nyquist frequency, "
                f"pi/dt = {pi / self.dt:.6g} rad/s"
            )

    def __repr__(self) -> str:
        more = f", computation_delay={six_digits(self.computation_delay)}"
        more += "" if self.prewarp is None else f", prewarp={six_digits(self.prewarp)}"
        return f"SampledLoop(dt={six_digits(self.dt)}, method={self.method!r}{more})"

    @property
    def alpha(self) -> float:
        """α of w = (z - 1)/(α (z + 1)), in seconds: dt/2, or what makes `prewarp` exact."""
        if self.prewarp is None:
            return self.dt / 2
        return tan(self.prewarp * self.dt / 2) / self.prewarp

    @property
    def wait(self) -> Wait:
        """Dead time of the model in samples."""
        samples, fraction = in_samples(self.loop.model_delay, self.dt)
        return Wait(samples, fraction)

    @cached_property
    def process(self) -> HeldProcess:
        """The process between hold and sampler, with its dead time and that of computation."""
        delay = self.loop.delay + self.computation_delay
        return held_process(self.loop.fractions.G, delay, self.dt)

    @cached_property
    def fractions(self) -> dict[str, Fraction]:
        """The blocks of the controller, in powers of w = (z - 1)/(α (z + 1))."""
        _, Gm, C, F = self.loop.fractions
        built = self.loop.built
        fractions = {"C": C, "F": F, "F/Gm": _over((built.Nf, built.Dm), (F.den, built.Nm))}
        if self.wait:
            fractions["Gm"] = Gm
        else:
            fractions["(1-F)Gm"] = _over((built.E, Gm.num), (F.den, built.Dm))
        return fractions

    @cached_property
    def controller(self) -> SampledController:
        """The difference equations of the processor."""
        sampled = {
            name: bilinear_block(name, fraction, self.alpha, self.dt)
            for name, fraction in self.fractions.items()
        }
        return wired(sampled, self.wait, self.dt)

    def noise_variance(self, shaping: Any = None) -> NoiseVariance:
        """Compute the variances of y and u at the samples: see `nrdob.digital.noise`.

        Parameters
        ----------
        shaping : control.TransferFunction, StateSpace or number, optional
            A stable discrete-time filter that colours the noise η; white of unit variance by
            default.

        Returns
        -------
        NoiseVariance
            `y`, of the process itself, and `u`.
        """
        return sampled_noise_variance(self.process, self.controller, shaping)

    def code(
        self, limits: Limits | None = None, *, tracking_time: float | None = None
    ) -> ControllerCode:
        """Make the controller ready to be written as C, Python or JSON.

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
        >>> loop.sampled(0.1).simulate({"R": 1.0, "delta": -0.3}, limits=Limits(0, 0.9), timepts=10)
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


def _over(num: tuple[Factor, Factor], den: tuple[Factor, Factor]) -> Fraction:
    """Multiply out one block from its factors."""
    above, below = (
        np.convolve(*(part.q if isinstance(part, QuasiPolynomial) else part for part in parts))
        for parts in (num, den)
    )
    return Fraction(np.trim_zeros(above, "f"), below)
