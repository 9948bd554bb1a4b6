r"""The loop on a processor: the process behind a hold, the observer as difference equations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, pi, tan
from typing import Any

import numpy as np

from ..analysis import NoiseVariance
from ..diagram import Fraction, LoopEquations, real_number, six_digits
from ..numerics import FloatArray, QuasiPolynomial
from .controller import SampledController, Wait, bilinear_block, wired
from .hold import HeldProcess, held_process, in_samples
from .noise import sampled_noise_variance

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
    def controller(self) -> SampledController:
        """The difference equations of the processor."""
        _, Gm, C, F = self.loop.fractions
        built = self.loop.built
        fractions = {"C": C, "F": F, "F/Gm": _over((built.Nf, built.Dm), (F.den, built.Nm))}
        if self.wait:
            fractions["Gm"] = Gm
        else:
            fractions["(1-F)Gm"] = _over((built.E, Gm.num), (F.den, built.Dm))
        sampled = {
            name: bilinear_block(name, fraction, self.alpha, self.dt)
            for name, fraction in fractions.items()
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


def _over(num: tuple[Factor, Factor], den: tuple[Factor, Factor]) -> Fraction:
    """Multiply out one block from its factors."""
    above, below = (
        np.convolve(*(part.q if isinstance(part, QuasiPolynomial) else part for part in parts))
        for parts in (num, den)
    )
    return Fraction(np.trim_zeros(above, "f"), below)
