r"""An encoder and what becomes of its counts: the angle in steps, and three estimates of a speed.

An incremental encoder rounds the *angle*. A speed is made of its counts on the processor:

- *Counting*: the counts of the last m samples, over their time. With :math:`\theta_k` the angle
  read, :math:`(\theta_k-\theta_{k-m})/(mh)`: the mean speed over a time mh, so mh/2 old.
- *Timing edges* (M/T counting; Ohmae and others, IEEE Trans. Industrial Electronics 29, 1982): the
  angle between the last edges of two samples, over the time between *them*. As old at high speed;
  at low speed by up to the time between two edges more.
- *Tracking* (a phase-locked loop): a model of constant speed, corrected by the error of its angle,
  critically damped with both roots at :math:`r=e^{-\omega_0h}`; :math:`2h/(1-r)-3h/2` old.

Each one is linear, but for the rounding: the mean speed of the last sample,
:math:`(1-z^{-1})\theta/h`, through a filter M(z) with M(1) = 1. So the verdict on a loop with an
estimate in it is as exact as one without (`encoded`); what the rounding does is simulated.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import exp, floor, inf, isfinite, pi

import numpy as np

from ..diagram import Fraction, real_number
from ..digital import HeldProcess, SampledLoop, held_in_w
from ..numerics import FloatArray, is_whole, transition
from .motion import Motion

__all__ = [
    "Counting", "EdgeTiming", "EncodedLoop", "Encoder", "SpeedEstimate", "Tracking", "encoded",
    "reader",
]  # fmt: skip

Reading = Callable[[float], float]  # from the angle of a sample to what is read


@dataclass(frozen=True)
class Encoder:
    """An incremental encoder: it counts steps of the angle, the nearest whole number of them.

    Parameters
    ----------
    counts : float
        Counts in a turn of the motor, edges of both channels; any number behind a gear.

    Examples
    --------
    >>> round(Encoder(10_000).step, 8)
    0.00062832
    """

    counts: float

    def __post_init__(self) -> None:
        remedy = (
            "an encoder has at least one count in a turn, four for each line of its disc: leave "
            "the encoder out (None) for an angle without steps"
        )
        object.__setattr__(self, "counts", real_number(self.counts, "counts", remedy, least=1.0))

    @property
    def step(self) -> float:
        """Angle of one count, in rad."""
        return 2 * pi / self.counts


class SpeedEstimate(ABC):
    """How a speed is made of angles that are read in each sample."""

    def smoothing(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Give M(z), from the mean speed of the last sample to the estimate.

        Numerator and denominator, shape (n+1,), are in descending powers of z, the latter monic.

        Parameters
        ----------
        dt : float
            Sampling time in seconds.
        """
        num, den = self._smoothing(dt)
        return np.array(num), np.array(den)

    def delay(self, dt: float) -> float:
        """Say how old the estimate of a slow speed is, in seconds: the slope of its phase.

        That is so where edges come many times in a sample.

        Parameters
        ----------
        dt : float
            Sampling time in seconds.

        Examples
        --------
        >>> round(Counting(4).delay(0.001), 6), round(Tracking(200.0).delay(0.001), 6)
        (0.002, 0.009533)
        """
        num, den = self.smoothing(dt)
        slopes = [np.polyval(np.polyder(p), 1.0) / p.sum() for p in (den, num)]
        return float((slopes[0] - slopes[1] + 0.5) * dt)

    @abstractmethod
    def _smoothing(self, dt: float) -> tuple[list[float], list[float]]: ...

    def _start(self, encoder: Encoder | None, motion: Motion) -> Reading:
        """Start M(z) on the differences of the angles that are read."""
        num, den = self._smoothing(motion.dt)
        first, *later = zip(num, den, strict=True)
        states, before, dt = [0.0] * len(num), motion.angle, motion.dt

        def read(angle: float) -> float:
            nonlocal before
            mean, before = (angle - before) / dt, angle
            estimate = first[0] * mean + states[0]
            for i, (b, a) in enumerate(later):
                states[i] = states[i + 1] + b * mean - a * estimate
            return estimate

        return read


@dataclass(frozen=True)
class Counting(SpeedEstimate):
    """Counts of the last samples over their time.

    Parameters
    ----------
    samples : int
        How many samples the counts are of.
    """

    samples: int = 1

    def __post_init__(self) -> None:
        if not (is_whole(self.samples) and self.samples >= 1):
            raise ValueError(f"samples is {self.samples!r}; give a whole number from 1 on")

    def _smoothing(self, dt: float) -> tuple[list[float], list[float]]:
        m = self.samples
        return [1 / m] * m, [1.0] + [0.0] * (m - 1)


@dataclass(frozen=True)
class Tracking(SpeedEstimate):
    """A phase-locked loop on the counts, critically damped: M(z) = (1 - r)² z²/(z - r)².

    Parameters
    ----------
    bandwidth : float
        The natural frequency of its roots, in rad/s.
    """

    bandwidth: float

    def __post_init__(self) -> None:
        remedy = "give a positive, finite number of rad/s"
        value = real_number(self.bandwidth, "bandwidth", remedy, above=0.0)
        object.__setattr__(self, "bandwidth", value)

    def _smoothing(self, dt: float) -> tuple[list[float], list[float]]:
        r = exp(-self.bandwidth * dt)
        return [(1 - r) ** 2, 0.0, 0.0], [1.0, -2 * r, r * r]


@dataclass(frozen=True)
class EdgeTiming(SpeedEstimate):
    """The angle between two edges over the time between them: M/T counting.

    Where no edge has come in a sample the last speed is kept, as long as an edge could not have
    been seen by now: it is at most one step over the time since the last edge.
    """

    def _smoothing(self, dt: float) -> tuple[list[float], list[float]]:
        return [1.0], [1.0]

    def _start(self, encoder: Encoder | None, motion: Motion) -> Reading:
        if encoder is None:
            raise ValueError("EdgeTiming needs edges: give the drive an Encoder(counts)")
        step = encoder.step
        edge, since, speed = 0.0, inf, 0.0

        def read(_: float) -> float:
            nonlocal edge, since, speed
            since += motion.dt
            found = motion.last_edge(step)
            if found is not None:
                now, ago = found
                if isfinite(since):
                    speed = (now - edge) / (since - ago)
                edge, since = now, ago
            elif abs(speed) * since > step:
                speed = step / since if speed > 0 else -step / since
            return speed

        return read


def reader(encoder: Encoder | None, estimate: SpeedEstimate | None, motion: Motion) -> Reading:
    """Give what turns the true angle of each sample into y: see `Drive.reader`."""
    read = estimate._start(encoder, motion) if estimate else float
    if encoder is None:
        return read
    step, inverse = encoder.step, 1 / encoder.step
    return lambda angle: read(floor(angle * inverse + 0.5) * step)


@dataclass(frozen=True, eq=False)
class EncodedLoop(SampledLoop):
    """A sampled speed loop whose y is an estimate, exact but for the rounding.

    It is judged as any `SampledLoop`. Signals are those at the samples; between them there is no y,
    and of rest it knows only R = 0: `Drive.simulate` has the drive itself. Noise is added to each
    estimate; an error of the angle with the deviation σ is coloured by σ M(z) (1 - 1/z)/dt.

    Attributes
    ----------
    loop, dt, method, computation_delay, estimate : as of `SampledLoop` and `encoded`
        Its process is the speed.
    """

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


def encoded(sampled: SampledLoop, estimate: SpeedEstimate) -> EncodedLoop:
    """Put an estimate between the speed of a loop and its controller.

    Parameters
    ----------
    sampled, estimate : SampledLoop, SpeedEstimate
        The loop with the speed for its process (a direct path in it is a ValueError), and how the
        speed is made of angles.

    Examples
    --------
    An observer that is stable with a measured speed, and not with a slow estimate of it:

    >>> import control as ct
    >>> import nrdob
    >>> motor = ct.tf([1], [0.01, 0.1])
    >>> filter = nrdob.LowPassFilter(0.004, 1)
    >>> sampled = nrdob.NRDOB(motor, motor, ct.tf([0.2, 2.0], [1, 0]), filter).sampled(0.001)
    >>> [encoded(sampled, each).stability().stable for each in (Counting(), Counting(20))]
    [True, False]
    """
    if not sampled.loop.fractions.G.relative_degree:
        raise ValueError("the process has a direct path, and a speed has none: give an inertia")
    return EncodedLoop(
        sampled.loop, sampled.dt, sampled.method, sampled.computation_delay, estimate
    )


def _in_w(p: FloatArray, alpha: float) -> FloatArray:
    """Write a polynomial of z, of degree n, times (1 - αw)^n, as one of w."""
    up, down = np.poly1d([alpha, 1.0]), np.poly1d([-alpha, 1.0])
    n = p.size - 1
    found = sum((c * up ** (n - i) * down**i for i, c in enumerate(p.tolist())), np.poly1d([0.0]))
    return np.pad(found.coef, (n + 1 - found.coef.size, 0))
