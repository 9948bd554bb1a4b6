r"""Variances of y and u at the samples for noise in a sampled loop, exactly.

The whole loop is one set of difference equations, :math:`x_{k+1} = A x_k + B e_k` with white
:math:`e_k` of unit variance, behind a shaping filter if there is one. In the long run the
covariance of x is the solution of Lyapunov's equation :math:`P = A P A^T + B B^T`, and that of a
signal :math:`C x + D e` is :math:`C P C^T + D^2` (Åström, Introduction to Stochastic Control
Theory, Academic Press 1970, chapter 4).
"""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..analysis import NoiseVariance
from ..diagram import is_number
from ..numerics import FloatArray
from .closedloop import ClosedLoop

__all__ = ["sampled_noise_variance"]

STABLE = 1 - 1e-12  # spectral radius from which nothing settles any more
SUMMED = 1e-16  # relative size of what may be left out of a sum of positive terms
SAME_DT = 1e-9  # relative difference of two sampling times that are meant to be one


def sampled_noise_variance(loop: ClosedLoop, dt: float, shaping: Any = None) -> NoiseVariance:
    r"""Compute the variances of y and u at the samples: see `SampledLoop.noise_variance`."""
    A, B, C, D = loop.from_noise
    if (size := loop.spectral_radius) >= STABLE:
        raise ValueError(
            f"the variances are infinite: the sampled loop has a root of size {size:.6g}; all must "
            "be inside the unit circle, see stability()"
        )
    to_both = ct.ss(A, B[:, None], C, D[:, None], dt)
    if shaping is not None:
        to_both = to_both * _shaping(shaping, dt)
    P = _covariance(to_both.A, to_both.B)
    y, u = np.diag(to_both.C @ P @ to_both.C.T + to_both.D @ to_both.D.T).tolist()
    return NoiseVariance(y, u)


def _covariance(A: FloatArray, B: FloatArray) -> FloatArray:
    """Solve P = A P Aᵀ + B Bᵀ by the sum of A^k B Bᵀ (A^k)ᵀ, doubled in each step.

    States of very different sizes then do not disturb one another.
    """
    P = B @ B.T
    while True:
        more = A @ P @ A.T
        if (np.abs(np.diag(more)) <= SUMMED * np.abs(np.diag(P))).all():
            return P
        P, A = P + more, A @ A


def _shaping(shaping: Any, dt: float) -> Any:
    if is_number(shaping):
        value = complex(shaping)
        if value.imag or not np.isfinite(value):
            raise ValueError(f"shaping is {shaping}; give a finite real number, or a block")
        return value.real
    if not isinstance(shaping, ct.TransferFunction | ct.StateSpace):
        raise TypeError(
            f"shaping is a {type(shaping).__name__}; give a discrete-time block, such as "
            "control.tf([0.1], [1, -0.9], dt), or a number"
        )
    if not shaping.issiso():
        raise ValueError("shaping has several inputs or outputs; give one channel of it")
    if not shaping.isdtime(strict=True) or (
        shaping.dt is not True and abs(shaping.dt - dt) > SAME_DT * dt
    ):
        raise ValueError(
            f"shaping has dt = {shaping.dt}; it colours the samples of this loop: give a "
            f"discrete-time block with dt = {dt:g}"
        )
    system = ct.ss(shaping)
    if not all(np.isfinite(M).all() for M in (system.A, system.B, system.C, system.D)):
        raise ValueError("shaping has coefficients that are not finite; give its numbers")
    if (size := np.abs(system.poles()).max(initial=0.0)) >= STABLE:
        raise ValueError(
            f"shaping has a pole of size {size:.6g}: behind it noise has no finite "
            "power; every pole must be inside the unit circle"
        )
    return system
