r"""The loop on a processor: the process behind a hold, the observer as difference equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..analysis import Margins, NoiseVariance
from ..diagram import Fraction, LoopEquations, six_digits, undelayed
from ..numerics import FloatArray
from .actuatorlimits import ActuatorLimits, rounded
from .bilinear import after_samples, delay_in_w, held_blocks, held_in_w
from .closedloop import ClosedLoop
from .code import ControllerCode, tracking
from .controller import ModelDelay, SampledController
from .hold import HeldProcess, checked_times, held_process, in_samples
from .margins import sampled_margins
from .noise import sampled_noise_variance
from .signals import Signal, external_signals
from .simulation import SimulatedResponse, sampled_step_response, simulated
from .unitcircle import CircleFunction, Product
from .verdict import SampledStability, sampled_stability

__all__ = ["METHODS", "SampledLoop"]

METHODS = ("tustin", "zoh")  # how a block is sampled
OBSERVER_INPUTS = ("applied", "commanded")  # which u the observer receives


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """An NR-DOB loop whose controller runs on a processor: what `NRDOB.sampled` returns.

    y is read just before the next u is written: a direct path of the process answers one sample
    later, also without dead time.

    Parameters
    ----------
    loop : LoopEquations
        In continuous time.
    dt, method, computation_delay : as for `nrdob.NRDOB.sampled`
    """

    loop: LoopEquations
    dt: float
    method: str = "tustin"
    computation_delay: float = 0.0

    def __post_init__(self) -> None:
        checked = checked_times(self.dt, self.computation_delay)
        for name, value in zip(("dt", "computation_delay"), checked, strict=True):
            object.__setattr__(self, name, value)
        if self.method not in METHODS:
            raise ValueError(f"method is {self.method!r}; choose one of {', '.join(METHODS)}")
        if self.loop.ill_posed_model_loop:
            raise ValueError(f"no sampled loop: {self.loop.ill_posed_model_loop}")
        _ = self.controller

    def __repr__(self) -> str:
        return (
            f"SampledLoop(dt={six_digits(self.dt)}, method={self.method!r}, "
            f"computation_delay={six_digits(self.computation_delay)})"
        )

    @property
    def model_delay(self) -> ModelDelay:
        """Dead time of the model in samples."""
        return ModelDelay(*in_samples(self.loop.model_delay, self.dt))

    @cached_property
    def process(self) -> HeldProcess:
        """The process between hold and sampler, with its dead time and that of computation."""
        delay = self.loop.delay + self.computation_delay
        return held_process(self.loop.fractions.G, delay, self.dt)

    @cached_property
    def blocks(self) -> LoopEquations:
        """Model, controller and filter in the plane of w, where Tustin's blocks are unchanged.

        The process is still the one in continuous time.
        """
        return self.loop if self.method == "tustin" else held_blocks(self.loop, self.dt)

    @cached_property
    def controller(self) -> SampledController:
        """The difference equations of the processor."""
        _, Gm, C, F = self.blocks.fractions
        Nf, Nm, Dm, E = (getattr(self.blocks.built, name).q for name in ("Nf", "Nm", "Dm", "E"))
        factors = {name: ([num], [den]) for name, (num, den) in (("C", C), ("F", F))}
        factors["F/Gm"] = [Nf, Gm.den], [F.den, Nm]
        if self.model_delay:
            factors["Gm"] = [Gm.num], [Gm.den]
        else:
            factors["(1-F)Gm"] = [E, Gm.num], [F.den, Dm]
        return SampledController(factors, self.model_delay, self.dt)

    @cached_property
    def closed_loop(self) -> ClosedLoop:
        """Process and controller as one recursion."""
        return ClosedLoop(self.controller, self.process)

    @cached_property
    def p_B(self) -> CircleFunction:
        """Characteristic function of the observer loop on the unit circle."""
        numerator, denominator = self._loop_gain
        return CircleFunction((*denominator, numerator))

    @cached_property
    def _stability(self) -> SampledStability:
        return sampled_stability(
            self.loop, self.blocks, self.p_B, self.process, self.controller, self._in_w
        )

    def _in_w(self) -> tuple[LoopEquations, Fraction | None]:
        """Give the loop in the plane of w, and the delay of its model, samples multiplied out."""
        process = after_samples(self.held, self.process.samples, self.dt)
        model, delay = undelayed(self.loop.model)
        if not delay:
            return replace(self.blocks, process=process), None
        return replace(self.blocks, process=process, model=model), delay_in_w(delay, self.dt)

    def stability(self) -> SampledStability:
        """Judge the sampled loop by Lemma 1 on the unit circle, in two ways."""
        return self._stability

    def margins(self) -> Margins:
        """Compute the margins of the sampled plant loop L = K·G on the unit circle.

        The delay margin is the smallest dead time that must be added to the process, or to the
        computation, for the loop to become unstable: whole samples turn L, fractions act on the
        hold. With a direct path, or a lag shorter than two samples, the loop may become unstable
        and stable again within one sample, so that eigenvalues are computed in each; beyond 120
        states they are not, and the margin of such a process may be too large.
        """
        numerator, denominator = self._loop_gain
        stable = self._stability.observer_loop.stable
        return sampled_margins(numerator, denominator, self.process, self.controller, stable)

    def step_response(self, input: str, timepts: ArrayLike | None = None) -> ct.TimeResponseData:
        """Respond to a unit step, exactly between the samples, too.

        Parameters
        ----------
        input, timepts : as for `nrdob.NRDOB.step_response`

        Returns
        -------
        control.TimeResponseData
            As there; u is what the hold puts out, for "delta" the input of the process u + δ.
        """
        loop = ClosedLoop(self.controller, self.process, self._disturbed)
        return sampled_step_response(loop, input, timepts, self._stability.spectral_radius)

    def noise_variance(self, shaping: Any = None) -> NoiseVariance:
        """Compute the variances of y and u at the samples, for noise η added to each y read.

        Parameters
        ----------
        shaping : control.TransferFunction, StateSpace or number, optional
            A stable discrete-time W(z) with the loop's sampling time, behind which the noise is
            coloured. By default η is white of unit variance; with a variance σ² give σ.

        Raises
        ------
        TypeError, ValueError
            If the sampled loop is not stable, or W is not; if W is no block, or has another
            sampling time.
        """
        return sampled_noise_variance(self.closed_loop, self.dt, shaping)

    def code(
        self, limits: ActuatorLimits | None = None, *, tracking_time: float | None = None
    ) -> ControllerCode:
        """Make the controller ready to be written as C or Python, stable loop or not.

        Parameters
        ----------
        limits : ActuatorLimits, optional
            Range and rate of the actuator.
        tracking_time : float, optional
            Time in seconds in which the integrator of C follows a u that is limited
            (back-calculation); by default it does not.

        Raises
        ------
        TypeError, ValueError
            If the limits are something else, or there is no integrator to track with, or the
            tracking time is too short.

        Examples
        --------
        >>> from nrdob import paper
        >>> from nrdob.digital import ActuatorLimits
        >>> code = paper.example(1).sampled(0.01).code(ActuatorLimits(0, 10))
        >>> "class Heater:" in code.to_python("Heater")
        True
        """
        if not isinstance(limits, ActuatorLimits | None):
            raise TypeError(
                f"limits is a {type(limits).__name__}; give nrdob.digital.ActuatorLimits(low, high)"
            )
        share = 0.0 if tracking_time is None else tracking(self.controller, tracking_time)
        return ControllerCode(self.controller, limits or ActuatorLimits(), share)

    def simulate(
        self,
        inputs: Mapping[str, Signal],
        noise: float | ArrayLike | None = None,
        limits: ActuatorLimits | None = None,
        *,
        timepts: ArrayLike | None = None,
        seed: int | np.random.Generator = 0,
        observer_input: str = "applied",
        tracking_time: float | None = None,
        start: float | None = None,
        resolution: float | None = None,
    ) -> SimulatedResponse:
        """Run the loop on given signals, with noise and an actuator that has limits.

        Parameters
        ----------
        inputs : mapping of "R", "d", "delta" to signals
            Reference, output and input disturbance: a number, an array (N,), or a function of the
            times. Each value is held from its sample to the next; what is left out is 0.
        noise : float or (N,) array_like, optional
            Measurement noise, or the standard deviation of white noise.
        limits : ActuatorLimits, optional
        timepts : (N,) array_like or float, optional
            Times of the samples, 0, dt, 2 dt, …, in seconds, or the last one; by default as many
            as the arrays have.
        seed : int or numpy.random.Generator
            Of white noise.
        observer_input : {"applied", "commanded"}
            Which u the observer receives: the actuator's or the controller's.
        tracking_time : float, optional
            As for `code`.
        start : float, optional
            A constant u to take over from without a bump, the process at rest under it and the
            first d and delta. By default everything is 0 before.
        resolution : float, optional
            Step of the converter that reads y.

        Raises
        ------
        TypeError, ValueError, ArithmeticError
            If signals and times do not fit, or the process is not at rest at `start`; if the
            signals leave the range of floating-point numbers.

        Examples
        --------
        >>> import control as ct
        >>> import nrdob
        >>> Gm = ct.tf([2], [1, 1])
        >>> loop = nrdob.NRDOB(process=Gm, model=Gm, controller=ct.tf([1, 1], [1, 0]),
        ...                    filter=nrdob.LowPassFilter(0.5, 1))
        >>> given, limits = {"R": 1.0, "delta": -0.3}, nrdob.digital.ActuatorLimits(0, 0.9)
        >>> loop.sampled(0.1).simulate(given, limits=limits, timepts=10)
        101 samples to 10 s, u limited in 8 of them
        y        from 0 to 0.999983, at last 0.999983
        u        from 0.8 to 1.05, at last 0.8
        applied  from 0.8 to 0.9, at last 0.8
        """
        if observer_input not in OBSERVER_INPUTS:
            choices = ", ".join(OBSERVER_INPUTS)
            raise ValueError(f"observer_input is {observer_input!r}; choose one of {choices}")
        code = self.code(limits, tracking_time=tracking_time)
        time, external = external_signals(inputs, noise, timepts, self.dt, seed)
        rules = [code.rule]
        if resolution is not None:
            rules.insert(0, rounded(resolution))
        loop = ClosedLoop(
            self.controller, self.process, self._disturbed, observer_input=observer_input,
            tracking=code.tracking, rounds=resolution is not None,
        )  # fmt: skip
        return simulated(loop, rules, time, external, start)

    @cached_property
    def _disturbed(self) -> HeldProcess:
        """The process as δ reaches it."""
        return self.process.after(self.loop.delay)

    @cached_property
    def held(self) -> Fraction:
        """The process behind its hold, in powers of w, without the whole samples."""
        return held_in_w(self.loop.fractions.G, self.dt, fraction=self.process.fraction)

    @cached_property
    def _loop_gain(self) -> tuple[Product, tuple[Product, ...]]:
        """N Dm Nf and D Nm (Df - Nf), numerator and denominator of L = K G in powers of v."""
        built, (_, Gm, _, F) = self.blocks.built, self.blocks.fractions
        Nm, Nf, Dm, delayed = built.Nm.q, built.Nf.q, built.Dm.q, [(built.E.q, 0)]
        if self.model_delay:  # on a processor nothing cancels in (1 - F exp(-θm s)) Gm0
            later = [(-weight * F.num, age) for weight, age in self.model_delay.terms]
            Dm, delayed = Gm.den, [(F.den, 0), *later]
        D, size = self.held.den, delayed[0][0].size
        above = (self.held.num, D.size), (Dm, Nm.size + size - Nf.size), (Nf, Nf.size)
        below = [((D, D.size), (Nm, Nm.size), (p, size)) for p, _ in delayed]
        num, *den = (tuple(self._in_v(*factor) for factor in term) for term in (above, *below))
        denominator = tuple(Product(term, age) for term, (_, age) in zip(den, delayed, strict=True))
        return Product(num, self.process.samples), denominator

    def _in_v(self, p: FloatArray, size: int) -> FloatArray:
        """Powers of w as powers of v = αw, with leading zeros up to a size."""
        return np.pad(p, (size - p.size, 0)) * (self.dt / 2) ** np.arange(size)
