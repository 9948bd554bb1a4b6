r"""Small gain: a weight that holds a set of plants, and what it promises.

The loop is stable with all plants :math:`G(1+W\Delta)`, :math:`|\Delta(j\omega)|\le1`, if and only
if :math:`|W T|<1` at all frequencies, T = L/(1 + L) = -S_η. A family lies within such a set, but is
smaller: a weight has no phase. So what the test refuses may be stable; `conservatism` says how much
it refuses too early.

.. rubric:: References

Doyle, J. C., B. A. Francis, A. R. Tannenbaum, Feedback Control Theory, 1992, ch. 4.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from typing import Any, NamedTuple

import control as ct
import numpy as np
from scipy.optimize import linprog

from ..analysis import resolved_frequencies
from ..diagram import Quotient, as_fraction
from ..loop import NRDOB
from ..numerics import FloatArray, QuasiPolynomial, golden
from .boxes import largest_box
from .intervalplants import largest_share
from .plantfamily import whole_number

__all__ = ["Conservatism", "conservatism", "fit_weight", "small_gain"]

CORNERS = 41  # corner frequencies that are tried for a weight
NEAR_PEAK = 0.9  # share of the largest value from which a peak is looked at
MOST_PLANTS = 500  # members of a family that a weight is fitted to
PER_STRETCH, ACROSS = 4, 15  # frequencies of a stretch; values of dead time and lag of a box


class Conservatism(NamedTuple):
    """Shares of one box of plants, as in `nrdob.uncertain.Box`.

    Attributes
    ----------
    small_gain, exact : float
        What the small gain theorem grants, with the best weight there can be; what is stable.
    """

    small_gain: float
    exact: float


def fit_weight(
    process: Any, plants: Iterable[Any], omega: FloatArray, order: int = 1
) -> ct.TransferFunction:
    r"""Fit the smallest stable weight W with :math:`|W|\ge|G_i/G-1|` for every plant.

    Of all with one corner of multiplicity `order`: :math:`|W|^2=\sum c_i x^i/(1+x)^n`,
    :math:`x=(\omega\tau)^2`, with :math:`c_i\ge0`. For each τ the c are a linear programme, the
    least mean of :math:`|W|^2` over what it must exceed; the best τ is taken.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`
        The nominal plant G.
    plants : iterable of such, or PlantFamily
        The others; of a family the first 500 members.
    omega : (N,) array of float
        Frequencies at which W holds them, in rad/s; increasing, positive.
    order : int
        n, from 1 on.

    Returns
    -------
    control.TransferFunction
        Stable, with all zeros in the left half plane.

    Raises
    ------
    TypeError, ValueError
        If there is no plant, `order` or `omega` are out of range, or a plant differs infinitely.

    Examples
    --------
    A neglected lag T of 0.1 s is ``|Ts/(Ts + 1)|`` away, which is a weight itself:

    >>> G = ct.tf([1], [1, 1])
    >>> W = fit_weight(G, [G * ct.tf([1], [0.1, 1])], np.geomspace(0.1, 1e3, 200))
    >>> round(abs(complex(W(10j))), 3)
    0.707
    """
    omega = np.asarray(omega, dtype=float)
    if omega.ndim != 1 or omega.size < 2 or not (np.diff(omega) > 0).all() or omega[0] <= 0:
        raise ValueError("omega must be two or more increasing, positive frequencies in rad/s")
    order = whole_number(order, "order", 1)
    s = 1j * omega
    nominal = process(s)
    # The indices of a family end, so that it is iterable as a sequence.
    errors = [np.abs(plant(s) / nominal - 1) for plant in islice(plants, MOST_PLANTS)]
    if not errors:
        raise ValueError("there is no plant to fit a weight to")
    needed = np.max(errors, axis=0) ** 2
    if not np.isfinite(needed).all():
        raise ValueError("a plant differs infinitely from the process: leave out that frequency")
    needed = np.maximum(needed, 1e-12 * needed.max(initial=1e-300))
    best, chosen = np.inf, None
    for tau in 1 / np.geomspace(omega[0], omega[-1], CORNERS):
        x = (omega * tau) ** 2
        shape = np.array([x**i / (1 + x) ** order for i in range(order + 1)]) / needed
        found = linprog(shape.mean(axis=1), A_ub=-shape.T, b_ub=-np.ones(omega.size))
        if found.status == 0 and found.fun < best:
            best, chosen = found.fun, (tau, np.maximum(found.x, 0.0))
    if chosen is None:
        raise ValueError("no weight of this order was found; give another order or fewer plants")
    tau, c = chosen
    return ct.tf(_spectral_factor(c, tau), np.poly([-1 / tau] * order) * tau**order)


def _spectral_factor(c: FloatArray, tau: float) -> FloatArray:
    """Stable polynomial whose square of size is the sum of c_i (ωτ)^2i."""
    used = np.flatnonzero(c > 1e-14 * c.max())
    x = np.roots(c[used[0] : used[-1] + 1][::-1])
    zeros = -np.sqrt(-x.astype(complex))  # s² = -x: the root in the left half plane
    lead = np.sqrt(c[used[-1]])
    p = lead * np.real(np.poly(np.concatenate([zeros, np.zeros(used[0])])))
    return np.atleast_1d(p) * tau ** np.arange(p.size - 1, -1, -1.0)


def small_gain(loop: NRDOB, weight: Any) -> float:
    """Compute the peak of ``|W T|``; below 1 the loop is stable with every plant within W.

    Parameters
    ----------
    loop : NRDOB
        A stable loop, with its nominal plant.
    weight : control.TransferFunction or (num, den)
        W of the relative error, stable.

    Returns
    -------
    float
        The peak, over all frequencies.

    Raises
    ------
    TypeError, ValueError
        If the weight is none, or it or the nominal loop is not stable.

    Examples
    --------
    >>> import nrdob
    >>> small_gain(nrdob.paper.example(2), 0.5) < 1                 # half of G, of whatever phase
    True
    """
    num, den = map(QuasiPolynomial, as_fraction(weight, "weight"))
    if (den.roots.real >= 0).any():
        raise ValueError("the weight has poles that are not in the left half plane; mirror them")
    if not bool(loop.stability()):
        raise ValueError(f"the nominal loop is not stable: {loop.stability().reason}")
    T = loop.S_eta
    weighted = Quotient((num, *T.num), (den, *T.den), "W T")
    omega = resolved_frequencies(weighted)
    size = np.abs(weighted(1j * omega))
    inner = 1 + np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:]))
    inner = inner[size[inner] > NEAR_PEAK * size.max()]
    tops = golden(lambda w: -np.abs(weighted(1j * w)), omega[inner - 1], omega[inner + 1])
    ends = [abs(weighted.dc_gain), sum(map(abs, weighted.at_infinity))]
    return float(max([size.max(), *np.abs(weighted(1j * tops)).tolist(), *ends]))


def conservatism(loop: NRDOB, **box: tuple[float, float]) -> Conservatism:
    """Compare what the small gain theorem grants of a box of plants with the exact share.

    The weight is the best there can be: at every frequency just what the farthest plant needs.

    Parameters
    ----------
    loop : NRDOB
        A stable loop, with its nominal plant.
    **box : (low, high)
        As for `nrdob.largest_box`: gain, delay, lag.

    Returns
    -------
    Conservatism
        Both shares.

    Examples
    --------
    >>> import nrdob
    >>> found = conservatism(nrdob.paper.example(3), gain=(0.5, 2.0), lag=(0.0, 0.2))
    >>> found.small_gain < found.exact
    True
    """
    exact = largest_box(loop, **box)
    omega = resolved_frequencies(loop.L, PER_STRETCH, loop.p_B)
    T = np.abs(loop.S_eta(1j * omega))
    granted = largest_share(lambda share: bool((_farthest(box, share, omega) * T).max() < 1))
    return Conservatism(granted, exact.share)


def _farthest(box: dict[str, tuple[float, float]], share: float, omega: FloatArray) -> FloatArray:
    """Largest ``|k exp(-jωτ)/(1 + jωT) - 1|`` of a share of a box; the size is convex in k."""
    k, tau, T = (
        nominal + share * (np.linspace(*box[name], count) - nominal) if name in box else [nominal]
        for name, nominal, count in (("gain", 1.0, 2), ("delay", 0.0, ACROSS), ("lag", 0.0, ACROSS))
    )
    gain, late, lag = (each[..., None] for each in np.meshgrid(k, tau, T))
    s = 1j * omega
    off = np.abs(gain * np.exp(-late * s) / (1 + lag * s) - 1)
    return np.asarray(off.max(axis=(0, 1, 2)))
