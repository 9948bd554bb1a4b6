r"""A process with any dead time between a zero-order hold and a sampler, exactly.

The processor writes u[k] at the time k dt and the hold keeps it until the next sample. With a dead
time θ = (d + φ) dt, 0 <= φ < 1, the process x' = A x + B v, y = C x + D v receives v = u[k-d-1] for
the first φ dt seconds of a sample and u[k-d] for the rest of it::

    x[k+1] = exp(A dt) x[k] + B1 u[k-d-1] + B0 u[k-d]        y[k] = C x[k] + D u[k-d-1]
    B0 = ∫ exp(A τ) B dτ from 0 to (1-φ) dt,   B1 = exp(A (1-φ) dt) ∫ exp(A τ) B dτ from 0 to φ dt

y is read just before the next u is written, so that a process with a direct path answers with the
input it has had until then, also without dead time (Åström, Wittenmark, Computer-Controlled
Systems, 3rd ed., Prentice Hall 1997, 2.3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import floor

import numpy as np
from scipy.linalg import block_diag

from ..diagram import Fraction, real_number
from ..numerics import FloatArray, split, transition

__all__ = ["WHOLE", "HeldProcess", "checked_times", "held_process", "in_samples"]

WHOLE = 1e-9  # fraction of a sample that is rounding: 0.3 s are three samples of 0.1 s
SLOWEST = 1e6  # samples after which slow modes are no longer told apart


@dataclass(frozen=True, eq=False)
class HeldProcess:
    """A process with dead time between a hold and a sampler.

    Attributes
    ----------
    A, B, C, D : arrays of float, shapes (n, n), (n,), (n,), ()
        The process in continuous time without its dead time, x' = A x + B v and y = C x + D v.
    dt : float
        Sampling time in seconds.
    samples, fraction : int, float
        d and φ: the dead time in whole samples, and what is left of it, 0 <= φ < 1.
    Ad, B0, B1 : arrays of float, shapes (n, n), (n,), (n,)
        From sample to sample, x[k+1] = Ad x[k] + B0 u[k-d] + B1 u[k-d-1].
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: float
    dt: float
    samples: int
    fraction: float
    Ad: FloatArray
    B0: FloatArray
    B1: FloatArray

    @property
    def delay(self) -> float:
        """The dead time in seconds."""
        return (self.samples + self.fraction) * self.dt

    @property
    def memory(self) -> int:
        """Number of past inputs that still act: d, and one more with a fraction or D."""
        return self.samples + int(self.fraction > 0 or self.D != 0)

    def after(self, delay: float) -> HeldProcess:
        """Return the same process behind another dead time, in seconds.

        Parameters
        ----------
        delay : float
        """
        samples, fraction = in_samples(delay, self.dt)
        late, B0 = self.transition((1 - fraction) * self.dt)
        B1 = late @ self.transition(fraction * self.dt)[1] if fraction else np.zeros_like(B0)
        return replace(self, samples=samples, fraction=fraction, B0=B0, B1=B1)

    def transition(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Compute exp(A t) and ∫ exp(A τ) B dτ: see `nrdob.numerics.transition`.

        Parameters
        ----------
        time : float
            In seconds, at least 0. A ValueError if an unstable mode overflows within it.
        """
        found = transition(self.A, self.B, time)
        if not all(np.isfinite(part).all() for part in found):
            raise ValueError(
                f"an unstable mode of the process leaves the range of floating-point numbers "
                f"within {time:g} s, less than a sample: choose a shorter dt"
            )
        return found


def held_process(process: Fraction, delay: float, dt: float) -> HeldProcess:
    """Discretise a proper process, with its dead time, under zero-order hold, exactly."""
    # Parts of different time scales stand side by side.
    parts = split([process.num], process.den, SLOWEST * dt)
    A = block_diag(*(part.A for part in parts)) if process.den.size > 1 else np.zeros((0, 0))
    B = np.concatenate([part.B for part in parts])
    C = np.concatenate([part.C[0] for part in parts])
    D = float(sum(part.D[0] for part in parts))
    bare = HeldProcess(np.asarray(A), B, C, D, dt, 0, 0.0, A, B, B)
    return replace(bare, Ad=bare.transition(dt)[0]).after(delay)


def checked_times(dt: float, computation_delay: float) -> tuple[float, float]:
    """Read sampling time and computation delay, in seconds, or refuse them."""
    dt = real_number(
        dt, "dt", "the sampling time is a positive, finite number of seconds", above=0.0
    )
    remedy = "u is written a number of seconds after y is read: 0 or more, and finite"
    return dt, real_number(computation_delay, "computation_delay", remedy, least=0.0)


def in_samples(delay: float, dt: float) -> tuple[int, float]:
    """Divide a dead time into whole samples and a fraction of one, at least 0 and below 1.

    Parameters
    ----------
    delay, dt : float
        In seconds.

    Examples
    --------
    >>> in_samples(0.3, 0.1), in_samples(0.25, 0.1)
    ((3, 0.0), (2, 0.5))
    """
    count = delay / dt
    samples = floor(count + WHOLE)
    fraction = count - samples
    return samples, fraction if fraction > WHOLE else 0.0
