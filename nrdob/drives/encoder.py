r"""An encoder and what becomes of its counts: the angle in steps, and three estimates of a speed.

An incremental encoder rounds the *angle*. A speed is made of its counts on the processor:

- *Counting*: the counts of the last m samples, over their time. With :math:`\theta_k` the angle
  read, :math:`(\theta_k-\theta_{k-m})/(mh)`: the mean speed over a time mh, so mh/2 old.
- *Timing edges* (M/T counting): the angle between the last edges of two samples, over the time
  between *them*. As old at high speed; at low speed by up to the time between two edges more.
- *Tracking* (a phase-locked loop): a model of constant speed, corrected by the error of its angle,
  critically damped with both roots at :math:`r=e^{-\omega_0h}`; :math:`2h/(1-r)-3h/2` old.

Each one is linear, but for the rounding: the mean speed of the last sample,
:math:`(1-z^{-1})\theta/h`, through a filter M(z) with M(1) = 1. So the verdict on a loop with an
estimate in it is as exact as one without (`EncodedLoop`); what the rounding does is simulated.

.. rubric:: References

Ohmae, T., T. Matsuda, K. Kamiyama, M. Tachikawa, A microprocessor-controlled high-accuracy
wide-range speed regulator for motor drives, IEEE Trans. Industrial Electronics 29 (1982) 207-211.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import exp, floor, inf, isfinite, pi
from typing import Any

import numpy as np

from ..analysis import Margins, NoiseVariance
from ..diagram import Fraction, LoopEquations, real_number
from ..digital import HeldProcess, SampledLoop, SampledStability, held_in_w
from ..numerics import FloatArray, is_whole, transition
from .motion import Motion

__all__ = ["Counting", "EdgeTiming", "EncodedLoop", "Encoder", "SpeedEstimate", "Tracking"]

Reading = Callable[[float], float]
"""From the angle read at a sample to the speed."""


@dataclass(frozen=True)
class Encoder:
    """An incremental encoder.

    Parameters
    ----------
    counts : float
        Counts in a turn of the motor, edges of both channels; any number behind a gear.

    Raises
    ------
    ValueError
        If there is less than one count.

    Examples
    --------
    >>> encoder = Encoder(10_000)
    >>> round(encoder.step, 8), encoder.count(0.001)
    (0.00062832, 2)
    """

    counts: float

    def __post_init__(self) -> None:
        counts = real_number(self.counts, "counts", "give the counts in a turn as a number")
        if not (isfinite(counts) and counts >= 1):
            raise ValueError(
                f"counts is {counts:g}; an encoder has at least one count in a turn, four for each "
                "line of its disc: leave the encoder out (None) for an angle without steps"
            )
        object.__setattr__(self, "counts", counts)

    @property
    def step(self) -> float:
        """Angle of one count, in rad."""
        return 2 * pi / self.counts

    def count(self, angle: float) -> int:
        """Give the counter at an angle in rad: the nearest whole number of steps."""
        return floor(angle / self.step + 0.5)


class SpeedEstimate(ABC):
    """How a speed is made of angles that are read in each sample."""

    @abstractmethod
    def smoothing(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Give M(z), from the mean speed of the last sample to the estimate.

        Parameters
        ----------
        dt : float
            Sampling time in seconds.

        Returns
        -------
        num, den : arrays of float, shape (n+1,)
            In descending powers of z.
        """

    @abstractmethod
    def reader(self, dt: float, encoder: Encoder | None, motion: Motion) -> Reading:
        """Start to estimate, from rest.

        Parameters
        ----------
        dt : float
            Sampling time in seconds.
        encoder : Encoder, optional
            Whose steps the angle has.
        motion : Motion
            The drive, for what has happened between two samples.

        Returns
        -------
        callable
            Gives the speed in rad/s for the angle read in rad, sample after sample.
        """

    def delay(self, dt: float) -> float:
        """Say how old the estimate of a slowly changing speed is: -H'(0) of its transfer function.

        Parameters
        ----------
        dt : float
            Sampling time in seconds.

        Returns
        -------
        float
            In seconds, by edges that come many times in a sample.

        Examples
        --------
        >>> round(Counting(4).delay(0.001), 6), round(Tracking(200.0).delay(0.001), 6)
        (0.002, 0.009533)
        """
        num, den = self.smoothing(dt)
        lag = (
            np.polyval(np.polyder(den), 1) / den.sum() - np.polyval(np.polyder(num), 1) / num.sum()
        )
        return float((lag + 0.5) * dt)


@dataclass(frozen=True)
class Counting(SpeedEstimate):
    """Counts of the last samples over their time.

    Parameters
    ----------
    samples : int
        m, how many samples the counts are of.
    """

    samples: int = 1

    def __post_init__(self) -> None:
        if not (is_whole(self.samples) and self.samples >= 1):
            raise ValueError(f"samples is {self.samples!r}; give a whole number from 1 on")

    def smoothing(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Give M(z), the mean of the last m: see `SpeedEstimate.smoothing`."""
        m = self.samples
        return np.full(m, 1.0 / m), np.eye(1, m)[0]

    def reader(self, dt: float, encoder: Encoder | None, motion: Motion) -> Reading:
        """Start to count: see `SpeedEstimate.reader`."""
        past: deque[float] = deque(maxlen=self.samples)
        whole = self.samples * dt

        def read(angle: float) -> float:
            if not past:
                past.extend([angle] * self.samples)
            before = past[0]
            past.append(angle)
            return (angle - before) / whole

        return read


@dataclass(frozen=True)
class Tracking(SpeedEstimate):
    """A phase-locked loop on the counts, critically damped.

    Parameters
    ----------
    bandwidth : float
        The natural frequency of its roots, in rad/s.
    """

    bandwidth: float

    def __post_init__(self) -> None:
        value = real_number(self.bandwidth, "bandwidth", "give rad/s as a number")
        if not (isfinite(value) and value > 0):
            raise ValueError(f"bandwidth is {value:g} rad/s; give a positive, finite one")
        object.__setattr__(self, "bandwidth", value)

    def smoothing(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Give M(z), (1 - r)² z²/(z - r)²: see `SpeedEstimate.smoothing`."""
        r = exp(-self.bandwidth * dt)
        return np.array([(1 - r) ** 2, 0.0, 0.0]), np.array([1.0, -2 * r, r * r])

    def reader(self, dt: float, encoder: Encoder | None, motion: Motion) -> Reading:
        """Start to track: see `SpeedEstimate.reader`."""
        r = exp(-self.bandwidth * dt)
        for_angle, for_speed = 1 - r * r, (1 - r) ** 2 / dt
        expected, speed, started = 0.0, 0.0, False

        def read(angle: float) -> float:
            nonlocal expected, speed, started
            if not started:
                expected, started = angle, True
            error = angle - expected
            speed += for_speed * error
            expected += for_angle * error + dt * speed
            return speed

        return read


@dataclass(frozen=True)
class EdgeTiming(SpeedEstimate):
    """The angle between two edges over the time between them: M/T counting.

    Where no edge has come in a sample the last speed is kept, as long as an edge could not have
    been seen by now: it is at most one step over the time since the last edge.
    """

    def smoothing(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Give M(z) = 1, for many edges in a sample: see `SpeedEstimate.smoothing`."""
        return np.ones(1), np.ones(1)

    def reader(self, dt: float, encoder: Encoder | None, motion: Motion) -> Reading:
        """Start to time edges: see `SpeedEstimate.reader`."""
        if encoder is None:
            raise ValueError("EdgeTiming needs edges: give the drive an Encoder(counts)")
        step = encoder.step
        motion.keep_passages()
        edge, since, speed = 0.0, inf, 0.0

        def read(_: float) -> float:
            nonlocal edge, since, speed
            since += dt
            found = _last_edge(motion, step, dt)
            if found is not None:
                now, ago = found
                if isfinite(since):
                    speed = (now - edge) / (since - ago)
                edge, since = now, ago
            elif abs(speed) * since > step:
                speed = step / since if speed > 0 else -step / since
            return speed

        return read


def _last_edge(motion: Motion, step: float, dt: float) -> tuple[float, float] | None:
    """Find the last edge of a sample: its angle, and how long it is ago."""
    for start, time, share, angle in motion.passages():
        powers = np.array(angle[::-1])
        first, last = float(powers[-1]), float(np.polyval(powers, share))
        before, after = floor(first / step + 0.5), floor(last / step + 0.5)
        if before == after:
            continue
        edge = (after - 0.5 if last > first else after + 0.5) * step
        low, high, rising = 0.0, share, last > first
        for _ in range(52):  # the angle does not turn back in a passage
            middle = (low + high) / 2
            if (np.polyval(powers, middle) > edge) == rising:
                high = middle
            else:
                low = middle
        return edge, dt - start - high * time
    return None


@dataclass(frozen=True, eq=False)
class EncodedLoop:
    """A sampled speed loop whose y is an estimate, judged exactly but for the rounding.

    Parameters
    ----------
    sampled : SampledLoop
        The loop with the *speed* for its process, strictly proper.
    estimate : SpeedEstimate
        How the speed is made of angles.

    Raises
    ------
    ValueError
        If the process has a direct path, so that its angle jumps.

    Examples
    --------
    An observer that is stable with a measured speed, and not with a slow estimate of it:

    >>> import control as ct
    >>> import nrdob
    >>> motor = ct.tf([1], [0.01, 0.1])
    >>> loop = nrdob.NRDOB(motor, motor, ct.tf([0.2, 2.0], [1, 0]), nrdob.LowPassFilter(0.004, 1))
    >>> sampled = loop.sampled(0.001)
    >>> [EncodedLoop(sampled, each).stability().stable for each in (Counting(), Counting(20))]
    [True, False]
    """

    sampled: SampledLoop
    estimate: SpeedEstimate

    def __post_init__(self) -> None:
        if not self.sampled.loop.fractions.G.relative_degree:
            raise ValueError("the process has a direct path, and a speed has none: give an inertia")

    @cached_property
    def _loop(self) -> _Encoded:
        of = self.sampled
        return _Encoded(of.loop, of.dt, of.method, of.computation_delay, self.estimate)

    def stability(self) -> SampledStability:
        """Judge the loop: see `SampledLoop.stability`."""
        return self._loop.stability()

    def margins(self) -> Margins:
        """Compute the margins of its plant loop: see `SampledLoop.margins`."""
        return self._loop.margins()

    def noise_variance(self, shaping: Any = None) -> NoiseVariance:
        """Compute variances for noise added to each estimate: see `SampledLoop.noise_variance`.

        Parameters
        ----------
        shaping : control.TransferFunction, StateSpace or number, optional
            As there. That of an angle's error of deviation σ is σ M(z) (1 - 1/z)/dt.
        """
        return self._loop.noise_variance(shaping)


@dataclass(frozen=True, eq=False)
class _Encoded(SampledLoop):
    """The same loop with the estimate behind its process, in state space and in the plane of w."""

    estimate: SpeedEstimate = Counting()

    @cached_property
    def process(self) -> HeldProcess:
        """The process, the angle it turns in each sample, and the estimate's states."""
        bare = super().process
        num, den = self.estimate.smoothing(self.dt)
        n, m = bare.B.size, num.size - 1
        A = np.zeros((n + 1 + m, n + 1 + m))
        A[:n, :n], A[n, :n] = bare.A, bare.C
        B = np.append(bare.B, np.zeros(1 + m))
        Ad = transition(A, B, self.dt)[0]
        Ad[:, n] = 0.0  # each sample turns its own angle
        Ad[n + 1 :, n + 1 :] = np.eye(m, k=1)
        Ad[n + 1 :, n + 1 : n + 2] -= den[1:, None]
        Ad[n + 1 :, n] = (num[1:] - den[1:] * num[0]) / self.dt
        C = np.zeros(n + 1 + m)
        C[n : n + 2] = [num[0] / self.dt, 1.0][: 1 + min(m, 1)]
        built = replace(bare, A=A, B=B, C=C, Ad=Ad)
        return built.after(bare.delay)

    @cached_property
    def held(self) -> Fraction:
        """The angle behind its hold, in powers of w, times (1 - 1/z)/dt and M."""
        G, alpha = self.loop.fractions.G, self.dt / 2
        angle = held_in_w(
            Fraction(G.num, np.append(G.den, 0.0)), self.dt, fraction=self.process.fraction
        )
        smooth, rough = (_in_w(p, alpha) for p in self.estimate.smoothing(self.dt))
        # (1 - 1/z)/dt = w/(1 + αw), and w is the angle's pole.
        den = np.polymul(angle.den[:-1], [alpha, 1.0])
        return Fraction(np.polymul(angle.num, smooth), np.polymul(den, rough))

    def _in_w(self) -> LoopEquations:
        if self.model_delay:
            raise ValueError("the model has a dead time, which is no fraction in w")
        alpha, samples = self.dt / 2, self.process.samples
        lead, lag = (np.poly1d([sign * alpha, 1.0]) ** samples for sign in (-1, 1))
        num, den = self.held
        return replace(self.blocks, process=(np.polymul(num, lead.coef), np.polymul(den, lag.coef)))


def _in_w(p: FloatArray, alpha: float) -> FloatArray:
    """Write a polynomial of z, of degree n, times (1 - αw)^n, as one of w."""
    up, down = np.poly1d([alpha, 1.0]), np.poly1d([-alpha, 1.0])
    n = p.size - 1
    found = sum((c * up ** (n - i) * down**i for i, c in enumerate(p.tolist())), np.poly1d([0.0]))
    return np.pad(found.coef, (n + 1 - found.coef.size, 0))
