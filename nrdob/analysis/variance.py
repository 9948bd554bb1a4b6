"""How much of a noise arrives at y and at u: variances by the one integral of `diagram.noise`."""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

from ..diagram import LoopEquations, as_shaping

__all__ = ["NoiseVariance", "noise_variance"]


class NoiseVariance(NamedTuple):
    """Variances of the output and of the control signal, in their units squared.

    Attributes
    ----------
    y, u : float
        Infinite for white noise that reaches the signal directly.
    """

    y: float
    u: float


def noise_variance(loop: LoopEquations, shaping: Any = None) -> NoiseVariance:
    r"""Variances of y and u for white or coloured measurement noise, also with dead time.

    Parameters
    ----------
    loop : LoopEquations
        A stable loop.
    shaping : control.TransferFunction, StateSpace, number or (num, den), optional
        A stable W: the noise has the two-sided density :math:`|W(j\omega)|^2` in units squared
        times seconds. White noise of unit density by default, of the density Φ for W = √Φ.

    Raises
    ------
    TypeError, ValueError
        If the loop is not stable, or W is not, or no block.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import NRDOB, LowPassFilter
    >>> G = ct.tf([1], [1, 1])
    >>> y, u = noise_variance(NRDOB(G, G, 1.0, LowPassFilter(0.5, 1)), ct.tf([1], [0.1, 1]))
    >>> round(y, 6), round(u, 6)
    (0.833333, 17.5)
    """
    W = None if shaping is None else as_shaping(shaping)
    passes = W is None or (W.relative_degree == 0 and bool(W.num.any()))
    variances = []
    for quotient in (loop.S_eta, loop.U_eta):
        endless = passes and any(quotient.at_infinity)
        if endless:
            quotient.check_stable()
        variances.append(inf if endless else quotient.noise_power(shaping))
    return NoiseVariance(*variances)
