r"""Every controller that stabilises the model is an NR-DOB: the filter that makes it one.

All the feedback of the diagram is :math:`K = F/((1 - F)\tilde G)`, so that

.. math:: F = \frac{K \tilde G}{1 + K \tilde G}, \qquad
          Q = \frac{F}{\tilde G} = \frac{K}{1 + K \tilde G} :

F is the complementary sensitivity of the model under K, and the block F/G̃ is Youla's parameter. A K
that stabilises the model internally meets the conditions on F at the model's poles and zeros by
itself. What may still be missing are blocks that are stable as they stand, and F(0) = 1: K G̃ must
integrate.

.. rubric:: References

Youla, D. C., J. J. Bongiorno, C. N. Lu, Single-loop feedback-stabilization of linear multivariable
dynamical plants, Automatica 10 (1974) 159-173.

Morari, M., E. Zafiriou, Robust Process Control, Prentice Hall 1989, chapter 4 (Q as internal model
control).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import control as ct
import numpy as np

from ..diagram import as_fraction, nonzero
from ..numerics import QuasiPolynomial, add, count_rhp, shared_factor, written
from .columns import positive_roots
from .existence import Answer

__all__ = ["ObserverForm", "observer_form", "stable_model_exists"]


@dataclass(frozen=True, eq=False, repr=False)
class ObserverForm(Answer):
    """What a controller is as an NR-DOB, or why it is none.

    Attributes
    ----------
    holds : bool
        Whether K is an NR-DOB whose blocks are all stable.
    reason : str
        Why, in a sentence.
    F : control.TransferFunction or None
        The filter; None where K does not stabilise the model, or makes the loop ill-posed.
    """

    F: ct.TransferFunction | None = None

    def __bool__(self) -> bool:
        return bool(self.holds)


def observer_form(controller: Any, model: Any) -> ObserverForm:
    r"""Write a controller K as an NR-DOB for a model, with its filter if it is one.

    With :math:`K = N_k/D_k` and :math:`p = D_k D_m + N_k N_m`

    .. math:: F = \frac{N_k N_m}{p}, \qquad \frac{F}{\tilde G} = \frac{N_k D_m}{p}, \qquad
              (1 - F)\tilde G = \frac{D_k N_m}{p},

    so that all three blocks are stable if and only if K stabilises the model internally.

    Parameters
    ----------
    controller : control.TransferFunction, StateSpace, number or (num, den)
        K, proper, without dead time: all that is fed back from y to u, with u = -K y.
    model : as for `nrdob.NRDOB`
        G̃.

    Returns
    -------
    ObserverForm
        `F` is a filter for `nrdob.NRDOB` if `holds`.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put.

    Examples
    --------
    A PI controller for a lag is an observer whose filter has a zero:

    >>> import control as ct
    >>> found = observer_form(ct.tf([3, 4], [1, 0]), ct.tf([1], [1, 1]))
    >>> found
    yes: K stabilises the model, and K·model integrates
    >>> found.F.num[0][0].round(6).tolist(), found.F.den[0][0].round(6).tolist()
    ([0.75, 1.0], [0.25, 1.0, 1.0])
    """
    K = nonzero(as_fraction(controller, "controller"), "controller")
    Gm = nonzero(as_fraction(model, "model"), "model")
    pairs = (K.den, Gm.den), (K.num, Gm.num)
    value = add(*(np.convolve(one, other) for one, other in pairs))
    scale = add(*(np.convolve(np.abs(one), np.abs(other)) for one, other in pairs))
    p = QuasiPolynomial(value, scale=scale)
    if p.degree < K.den.size + Gm.den.size - 2 or not p.q.any():
        return ObserverForm(
            False, "1 + K(∞)·model(∞) = 0: the loop of K and the model is ill-posed; change K"
        )
    found = count_rhp(p)
    if p.zeros_at_origin or found.count != 0:
        where = found.reason
        if found.count is not None and p.roots.size:
            where = f"1 + K·model has a zero at s = {written(complex(p.roots[0]))}"
        return ObserverForm(
            False, f"K does not stabilise the model: {where}; change K, or the model with it"
        )
    num, den = (QuasiPolynomial(part / p.q[-1]) for part in (np.convolve(K.num, Gm.num), p.q))
    _, top, bottom = shared_factor(num, den)
    F = ct.tf(top.q / bottom.q[-1], bottom.q / bottom.q[-1])
    reason = "K stabilises the model, and K·model integrates"
    integrates = not (K.den[-1] and Gm.den[-1])
    if not integrates:
        dc = F.num[0][0][-1]
        reason = f"F(0) = {dc:.4g}, not 1: neither K nor the model integrates; give K an integrator"
    return ObserverForm(integrates, reason, F)


def stable_model_exists(controller: Any) -> Answer:
    r"""Tell whether any stable model is stabilised by a controller.

    A stable G̃ that K stabilises is a stable controller for K: by the parity interlacing property
    one exists if and only if between any two neighbouring real zeros of K with Re s ≥ 0, infinity
    among them if K is strictly proper, there is an even number of poles of K. If K integrates, too,
    such a model makes an NR-DOB of it, with stable blocks (`observer_form`). Where none exists, the
    model is unstable, and C is designed for an unstable model, or K is another one.

    Parameters
    ----------
    controller : as for `observer_form`
        K, without common factors of numerator and denominator.

    Returns
    -------
    Answer
        Whether one exists, and why.

    Raises
    ------
    TypeError, ValueError
        If the controller is no proper rational block.

    Examples
    --------
    >>> import control as ct
    >>> s = ct.tf('s')
    >>> stable_model_exists((s - 2) / ((s - 1) * (s + 5)))
    yes: the poles of K interlace with its real unstable zeros: 0 of them between 2 and ∞
    >>> stable_model_exists((s - 1) / ((s - 2) * (s + 5)))
    no: between the zeros 1 and ∞ of K there is an odd number of its real poles (1), at 2
    """
    K = nonzero(as_fraction(controller, "controller"), "controller")
    _, num, den = shared_factor(QuasiPolynomial(K.num), QuasiPolynomial(K.den))
    zeros, poles = _real_right(num), _real_right(den)
    ends = [*zeros, *([np.inf] if den.degree > num.degree else [])]
    if len(ends) < 2:
        return Answer(True, "K has no two real unstable zeros, infinity included")
    said = []
    for low, high in pairwise(ends):
        between = [pole for pole in poles if low < pole < high]
        ends_text = f"{low:.4g} and {'∞' if high == np.inf else f'{high:.4g}'}"
        if len(between) % 2:
            where = ", ".join(f"{pole:.4g}" for pole in between)
            return Answer(
                False,
                f"between the zeros {ends_text} of K there is an odd number of its real poles "
                f"({len(between)}), at {where}",
            )
        said.append(f"{len(between)} of them between {ends_text}")
    reason = "the poles of K interlace with its real unstable zeros"
    return Answer(True, f"{reason}: {', '.join(said)}")


def _real_right(p: QuasiPolynomial) -> list[float]:
    """Real roots with Re s >= 0, increasing."""
    return [*[0.0] * p.zeros_at_origin, *positive_roots(p.q).tolist()]
