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
from scipy.linalg import block_diag

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
    if _radius(A) >= STABLE:
        raise ValueError(
            f"the variances are infinite: the sampled loop has a root of size {_radius(A):.6g}; "
            "all must be inside the unit circle, see stability()"
        )
    if shaping is not None:
        W = _shaping(shaping, dt)
        n = B.size
        A, B = block_diag(A, W.A), np.append(B * W.D, W.B)
        A[:n, n:] = np.outer(loop.from_noise[1], W.C)
        C, D = np.hstack([C, np.outer(D, W.C)]), D * W.D[0, 0]
    P = _covariance(A, B)
    y, u = (float(row @ P @ row + direct**2) for row, direct in zip(C, D, strict=True))
    return NoiseVariance(y, u)


def _covariance(A: FloatArray, B: FloatArray) -> FloatArray:
    """Solve P = A P Aᵀ + B Bᵀ by the sum of A^k B Bᵀ (A^k)ᵀ, doubled in each step.

    States of very different sizes then do not disturb one another.
    """
    P: FloatArray = np.outer(B, B)
    while True:
        more = A @ P @ A.T
        if (np.abs(np.diag(more)) <= SUMMED * np.abs(np.diag(P))).all():
            return P
        P, A = P + more, A @ A


def _shaping(shaping: Any, dt: float) -> Any:
    """Read a shaping filter as a state space."""
    if is_number(shaping):
        return ct.ss([], [], [], [[float(shaping)]], dt)
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
    if _radius(system.A) >= STABLE:
        raise ValueError(
            f"shaping has a pole of size {_radius(system.A):.6g}: behind it noise has no finite "
            "power; every pole must be inside the unit circle"
        )
    return system


def _radius(A: FloatArray) -> float:
    return float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
