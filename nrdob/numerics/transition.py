"""The transition of a linear system over a time, and what a constant input adds to its state."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from .arrays import FloatArray

__all__ = ["transition"]


def transition(A: FloatArray, B: FloatArray, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
    r"""Compute :math:`\Phi = e^{At}` and :math:`\Gamma = \int_0^te^{A\sigma}B\,d\sigma`.

    Both are blocks of one matrix exponential (Van Loan, IEEE Trans. Automatic Control 23, 1978).

    Parameters
    ----------
    A, B : arrays of float, shapes (n, n) and (n,)
        Of :math:`\dot x = Ax + Bv`.
    time : array_like, shape (...)
        One time or several, at least 0.

    Returns
    -------
    Phi, Gamma : arrays of float, shapes (..., n, n) and (..., n)
        So that x(t) = Phi x(0) + Gamma v for a constant v; infinite or nan where they overflow.

    Examples
    --------
    >>> Phi, Gamma = transition(np.array([[-1.0]]), np.ones(1), np.log(2))
    >>> Phi.round(6).tolist(), Gamma.round(6).tolist()
    ([[0.5]], [0.5])
    """
    n = B.size
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n], augmented[:n, n] = A, B
    with np.errstate(over="ignore", invalid="ignore"):
        both = expm(np.multiply.outer(np.asarray(time, dtype=float), augmented))
    return both[..., :n, :n], both[..., :n, n]
