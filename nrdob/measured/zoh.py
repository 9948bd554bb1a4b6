r"""What a plant does to an input that is held between samples, exactly, whatever its dead time.

Time is counted in samples. With the dead time :math:`\theta = d + f`, d whole and
:math:`0 \le f < 1`, the input switches f after each sample, so that the state of
:math:`\dot x = Ax + Bu(t - \theta)` goes from one sample to the next by

.. math:: x_{k+1} = e^Ax_k + \Gamma(1-f)\,u_{k-d} + e^{A(1-f)}\Gamma(f)\,u_{k-d-1},
          \qquad \Gamma(t) = \int_0^t e^{A\sigma}B\,d\sigma .

No approximation of the dead time is made, and the response is continuous in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import floor

import numpy as np
from scipy.signal import lfilter

from ..numerics import FloatArray, transition

__all__ = ["free_responses", "held_responses"]


def held_responses(den: Sequence[float], inputs: FloatArray, delay: float = 0.0) -> FloatArray:
    r"""Respond from rest, shape (n, N), with :math:`e^{-\theta s}s^i/D(s)` for i from 0 to n - 1.

    Den is the monic :math:`D(s)` of degree n, 1 or 2, descending; the input is zero before its
    first sample, shape (N,). A lag of one sampling time after half a sample of dead time:

    >>> held_responses([1.0, 1.0], np.ones(3), 0.5).round(4)
    array([[0.    , 0.3935, 0.7769]])
    """
    whole = floor(delay)
    part = delay - whole
    (early, late), (before, now) = transition(*_companion(den), [part, 1 - part])
    n = len(den) - 1
    before, step = late @ before, late @ early
    # (zI - step)^-1 applied to the two vectors, over the characteristic polynomial.
    if n == 1:
        poles = np.array([1.0, -step[0, 0]])
        taps = np.array([[0.0, now[0], before[0]]])
    else:
        trace = step[0, 0] + step[1, 1]
        poles = np.array([1.0, -trace, np.linalg.det(step)])
        turned = step - trace * np.eye(2)
        taps = np.stack([0 * now, now, turned @ now + before, turned @ before], axis=1)
    shifted = np.concatenate([np.zeros(min(whole, inputs.size)), inputs[: -whole or None]])
    return np.array([lfilter(row, poles, shifted[: inputs.size]) for row in taps])


def free_responses(den: Sequence[float], count: int) -> FloatArray:
    """Give a basis, shape (n, count), of what the output does by itself after any initial state."""
    n = len(den) - 1
    step, _ = transition(*_companion(den), 1.0)
    poles = [1.0, -step[0, 0]] if n == 1 else [1.0, -np.trace(step), np.linalg.det(step)]
    impulse = np.eye(1, count)[0]
    return np.array([lfilter(late, poles, impulse) for late in np.eye(n)])


def _companion(den: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """Give A and B of 1/D(s)."""
    n = len(den) - 1
    A = np.eye(n, k=1)
    A[-1] = -np.asarray(den, dtype=float)[:0:-1]
    return A, np.eye(n)[-1]
