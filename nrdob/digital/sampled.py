r"""The loop on a processor: the process behind a hold, the observer as difference equations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, pi, tan
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..analysis import Margins, NoiseVariance
from ..diagram import Fraction, LoopEquations, real_number, six_digits
from ..numerics import FloatArray, QuasiPolynomial
from .between import Running, sampled_step_response
from .circle import CircleFunction, Product
from .circlemargins import CircleLocus, added_delay, circle_margins
from .controller import SampledController, Wait, bilinear_block, wired
from .heldblocks import held_blocks
from .hold import HeldProcess, checked_times, held_process, in_samples
from .noise import sampled_noise_variance
from .running import RunningLoop
from .verdict import SampledStability, sampled_stability
from .wplane import held_in_w

__all__ = ["METHODS", "SampledLoop"]

METHODS = ("tustin", "zoh")
"""How a block is sampled."""

Factor = FloatArray | QuasiPolynomial


@dataclass(frozen=True, eq=False)
class SampledLoop(RunningLoop):
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
        checked = checked_times(self.dt, self.computation_delay)
        for name, value in zip(("dt", "computation_delay"), checked, strict=True):
            object.__setattr__(self, name, value)
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
    def blocks(self) -> LoopEquations:
        """Model, controller and filter in the plane of w, which Tustin's rule takes as they are.

        The process is still the one in continuous time.
        """
        return self.loop if self.method == "tustin" else held_blocks(self.loop, self.dt)

    @cached_property
    def p_B(self) -> CircleFunction:
        """Characteristic function of the observer loop on the unit circle."""
        return CircleFunction((*self._denominator, self._numerator))

    @cached_property
    def _stability(self) -> SampledStability:
        return sampled_stability(self.blocks, self.p_B, self.process, self.controller, self.alpha)

    def stability(self) -> SampledStability:
        """Judge the sampled loop by Lemma 1 on the unit circle, in two ways.

        Returns
        -------
        SampledStability
            The verdict, and for C·G̃ and F·H the counts and roots that prove it.
        """
        return self._stability

    def margins(self) -> Margins:
        """Compute the margins of the sampled plant loop L = K·G on the unit circle.

        Returns
        -------
        Margins
            Which unpack as `control.stability_margins`, with frequencies up to π/dt. The delay
            margin is the smallest dead time that must be added to the process, or to the
            computation, for the loop to be lost: whole samples turn L, fractions act on the hold.
        """
        return self._margins

    @cached_property
    def _margins(self) -> Margins:
        stable = self._stability.observer_loop.stable
        found = circle_margins(self._numerator, self._denominator, self.p_B, self.dt, stable)
        if not stable or found.delay_margin == inf:
            return found
        locus = CircleLocus(self._numerator, CircleFunction(self._denominator), self.dt)
        more = added_delay(
            self.process,
            self.controller,
            lambda omega: locus.values(omega)[0],
            found.gain_crossovers,
        )
        return replace(found, delay_margin=more)

    def step_response(self, input: str, timepts: ArrayLike | None = None) -> ct.TimeResponseData:
        """Respond to a unit step, exactly between the samples, too: see `nrdob.digital.between`.

        Parameters
        ----------
        input : {"R", "d", "delta", "eta"}
            Where the step enters: reference, output disturbance, input disturbance or noise.
        timepts : (N,) array_like or float, optional
            Increasing times from 0 on, in seconds, or the last one; by default until y and u have
            settled.

        Returns
        -------
        control.TimeResponseData
            `time` (N,), and `outputs` (2, 1, N) with y and u; u is what the hold puts out, for
            "delta" the input of the process u + δ.
        """
        running = Running(
            self.process,
            self.controller,
            self.loop.delay,
            self.computation_delay,
            self._stability.spectral_radius,
        )
        return sampled_step_response(running, input, timepts)

    @cached_property
    def held(self) -> Fraction:
        """The process behind its hold, in powers of v = αw, without the whole samples."""
        return held_in_w(self.loop.fractions.G, self.dt, fraction=self.process.fraction, alpha=1.0)

    @cached_property
    def _numerator(self) -> Product:
        """Numerator of L = K G, N Dm Nf."""
        built = self.blocks.built
        F = self.blocks.fractions.F
        degree = built.Nm.q.size + (F.den if self.wait else built.E.q).size
        return Product(
            (
                _filled(self.held.num, self.held.den.size),
                self._in_v(built.Dm.q, degree - built.Nf.q.size),
                self._in_v(built.Nf.q, built.Nf.q.size),
            ),
            self.process.samples,
        )

    @cached_property
    def _denominator(self) -> tuple[Product, ...]:
        """Denominator of L, D Nm (Df - Nf), term by term for a model that waits."""
        built, F, wait = self.blocks.built, self.blocks.fractions.F, self.wait
        common = self.held.den, self._in_v(built.Nm.q, built.Nm.q.size)
        if not wait:
            return (Product((*common, self._in_v(built.E.q, built.E.q.size))),)
        late = self._in_v(F.num, F.den.size)
        terms = [Product((*common, self._in_v(F.den, F.den.size)))]
        shares = (1 - wait.fraction, wait.samples), (wait.fraction, wait.samples + 1)
        terms += [Product((*common, -share * late), m) for share, m in shares if share]
        return tuple(terms)

    def _in_v(self, p: FloatArray, size: int) -> FloatArray:
        """Powers of w as powers of v = αw, with leading zeros up to a size."""
        return _filled(p, size) * self.alpha ** np.arange(size)

    @cached_property
    def fractions(self) -> dict[str, Fraction]:
        """The blocks of the controller, each as one, in powers of w."""
        _, Gm, C, F = self.blocks.fractions
        built = self.blocks.built
        fractions = {"C": C, "F": F, "F/Gm": _over((built.Nf, Gm.den), (F.den, built.Nm))}
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


def _filled(p: FloatArray, size: int) -> FloatArray:
    return np.pad(p, (size - p.size, 0))


def _over(num: tuple[Factor, Factor], den: tuple[Factor, Factor]) -> Fraction:
    """Multiply out one block from its factors."""
    (a, b), (c, d) = ([_coefficients(part) for part in parts] for parts in (num, den))
    return Fraction(np.trim_zeros(np.convolve(a, b), "f"), np.convolve(c, d))


def _coefficients(part: Factor) -> FloatArray:
    return part.q if isinstance(part, QuasiPolynomial) else part
