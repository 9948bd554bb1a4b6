r"""Every stabilising gain: the factors of the process at which the observer loop changes sides.

The loop with k G in place of G has a root at :math:`s = j\omega` if and only if
:math:`k L(j\omega) = -1`: so k = -1/L at the frequencies at which L is real, 0 and infinity
included. Between two neighbouring critical gains the number of roots in the right half plane does
not change; it is counted there by the argument of

.. math:: p_B = D N_m' E + k\,N D_m' N_f'\,e^{-s\theta}.

With dead time there are endlessly many critical gains. Far beyond all poles and zeros of L its size
falls and its phase falls, too, so that with growing k roots only enter the right half plane there:
what is listed up to some turns beyond is all that can bound a stable interval.
"""

from __future__ import annotations

from itertools import pairwise
from math import inf, sqrt
from typing import Any

import numpy as np

from ..analysis import quotient_margins
from ..diagram import DelayedTransferFunction, ObserverEquations, Quotient
from ..numerics import FloatArray, QuasiPolynomial, count_rhp

__all__ = ["critical_gains", "stabilizing_gains"]

FAR = 10.0
"""How far beyond all poles and zeros L is only a power of s and a dead time."""

SAME = 1e-9
"""Relative distance below which two critical gains are one."""


def stabilizing_gains(process: Any, model: Any, filter: Any) -> list[tuple[float, float]]:
    r"""Find all factors k > 0 of the process with which the observer loop is stable.

    Parameters
    ----------
    process, model, filter : as for `nrdob.NRDOB`
        G, G̃ and F.

    Returns
    -------
    list of (low, high)
        Open intervals, increasing; `high` may be inf. Empty where no gain works.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put.
    ArithmeticError
        If a count is not certain, so that no answer can be trusted.

    Examples
    --------
    Example 4 of the paper is lost at 3.712 times its gain:

    >>> from nrdob import paper
    >>> loop = paper.example(4)
    >>> (low, high), = stabilizing_gains(loop.process, loop.model, loop.filter)
    >>> low, round(high, 3)
    (0.0, 3.712)
    """
    given = ObserverEquations(process, model, filter)
    unit = _unit(given)
    G = given.fractions.G
    scaled = DelayedTransferFunction((unit * G.num, G.den), given.delay)
    loop = ObserverEquations(scaled, model, filter)
    gains = critical_gains(loop.L, quotient_margins(loop.L, None).phase_crossovers)
    apart = np.diff(gains, prepend=0.0) > SAME * gains
    ends = [0.0, *gains[apart].tolist(), inf]
    stable: list[tuple[float, float]] = []
    for low, high in pairwise(ends):
        between = 2 * low or 1.0 if high == inf else sqrt(low * high) if low else high / 2
        if _count(loop, between) == 0:
            stable.append((low * unit, high * unit))
    return stable


def critical_gains(L: Quotient, crossovers: FloatArray) -> FloatArray:
    """Find the factors k > 0 of a loop gain with k L = -1 at some frequency, increasing.

    Parameters
    ----------
    L : Quotient
        The loop gain.
    crossovers : (N,) array
        Frequencies at which it is real, in rad/s; 0 and infinity are looked at in any case.
    """
    inside = crossovers[(crossovers > 0) & np.isfinite(crossovers)]
    a, b = L.at_infinity
    values = np.concatenate([L(1j * inside).real, [L.dc_gain, a - abs(b), a + abs(b)]])
    with np.errstate(divide="ignore"):
        gains = np.sort(-1 / values[np.isfinite(values) & (values < 0)])
    return np.asarray(gains[np.isfinite(gains)])


def _unit(loop: ObserverEquations) -> float:
    """Gain with which L is 1 just beyond all that is in it, so that no more has to be followed."""
    parts = [p for factor in (*loop.L.num, *loop.L.den) for p, _ in factor.terms if p.any()]
    roots = [QuasiPolynomial(p).without_origin.roots for p in parts]
    speeds = np.append(np.abs(np.concatenate(roots)), 1 / loop.delay if loop.delay else 0.0)
    size = float(np.abs(loop.L(1j * FAR * (speeds.max() or 1.0))))
    return 1 / size if 0 < size < inf else 1.0


def _count(loop: ObserverEquations, gain: float) -> float:
    """Count the roots on the right with a factor of the process."""
    G = loop.fractions.G
    process = DelayedTransferFunction((gain * G.num, G.den), loop.delay)
    p = ObserverEquations(process, loop.model, loop.filter).p_B
    found = count_rhp(p)
    if found.count is None or p.zeros_at_origin:
        raise ArithmeticError(
            f"with {gain:.4g} times the process the loop is on the border of stability: "
            f"{found.reason or 's = 0'}; the set of gains cannot be given"
        )
    return found.count
