r"""C without the observer, and with the conventional one: as NR-DOBs with other filters.

Whatever feeds back y by a controller K is an NR-DOB whose filter is the complementary sensitivity
of the model under K (`nrdob.observer_form`). So

=====================================  =====================================================
C alone, u = C (R - y)                 :math:`F = C\tilde G/(1 + C\tilde G)`
conventional observer with F           :math:`(F + C\tilde G)/(1 + C\tilde G)` in place of F
=====================================  =====================================================

with the same C and the same model: all maps from R, d, δ and η are those of the other diagram, and
all that judges an NR-DOB judges these loops, too. The conventional observer compares y itself with
the reference, :math:`u = C(R - y) + Fu - (F/\tilde G)y`, so that
:math:`K = (C + F/\tilde G)/(1 - F)`.

.. rubric:: References

Ohnishi, K., M. Shibata, T. Murakami, Motion control for advanced mechatronics, IEEE/ASME Trans.
Mechatronics 1 (1996) 56-67.
"""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..design import observer_form
from ..diagram import as_fraction, filter_fraction, undelayed
from ..loop import NRDOB
from ..numerics import QuasiPolynomial, add, count_rhp, written

__all__ = ["controller_alone", "conventional_observer"]


def controller_alone(process: Any, model: Any, controller: Any) -> NRDOB:
    """Close a process with the controller alone, u = C (R - y).

    Parameters
    ----------
    process : as for `nrdob.NRDOB`
        The process G.
    model : as for `nrdob.NRDOB`
        A model that C stabilises; nothing of the loop depends on it. Its dead time is left out.
    controller : as for `nrdob.NRDOB`
        C, so that C or the model integrates.

    Returns
    -------
    NRDOB
        With :math:`K = C`.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put, C does not stabilise the model, or neither of the
        two integrates.

    Examples
    --------
    >>> import control as ct
    >>> loop = controller_alone(ct.tf([2], [1, 2]), ct.tf([1], [1, 1]), ct.tf([1, 3], [1, 0]))
    >>> loop.p_B.q.round(6).tolist()                    # s (s + 2) + 2 (s + 3), times a constant
    [0.333333, 1.333333, 2.0]
    """
    prompt = undelayed(model)
    found = observer_form(controller, prompt)
    if not found:
        raise ValueError(f"C alone cannot be written as an observer: {found.reason}")
    return NRDOB(process, prompt, controller, found.F)


def conventional_observer(process: Any, model: Any, controller: Any, filter: Any) -> NRDOB:
    """Close a process with C and a conventional disturbance observer.

    Parameters
    ----------
    process, model, controller, filter : as for `nrdob.NRDOB`
        G, G̃ without dead time, C and F.

    Returns
    -------
    NRDOB
        With :math:`K = (C + F/G̃)/(1 - F)`.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put, or C does not stabilise the model.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import LowPassFilter
    >>> G = ct.tf([1], [1, 1])
    >>> loop = conventional_observer(G, G, 2.0, LowPassFilter(0.5, 1))
    >>> loop.p_B.roots.real.round(6).tolist()           # of F, and of C·model
    [-2.0, -3.0]
    """
    prompt = undelayed(model)
    Gm, C = as_fraction(prompt, "model"), as_fraction(controller, "controller")
    F = filter_fraction(filter)
    opened, closing = np.convolve(C.den, Gm.den), np.convolve(C.num, Gm.num)
    p_A = QuasiPolynomial(add(opened, closing), scale=add(np.abs(opened), np.abs(closing)))
    if p_A.zeros_at_origin or count_rhp(p_A).count != 0:
        raise ValueError(
            f"C does not stabilise the model: p_A has the root {written(complex(p_A.roots[0]))}; "
            "change C"
        )
    num = add(np.convolve(F.num, opened), np.convolve(F.den, closing))
    return NRDOB(process, prompt, controller, ct.tf(num, np.convolve(F.den, p_A.q)))
