r"""C alone, the conventional observer and the Smith predictor, as NR-DOBs with other filters.

Whatever feeds back y by a controller K is an NR-DOB whose filter is the complementary sensitivity
of the model under K (`nrdob.design.observer_form`). So

=====================================  =====================================================
C alone, u = C (R - y)                 :math:`F = C\tilde G/(1 + C\tilde G)`
conventional observer with F           :math:`(F + C\tilde G)/(1 + C\tilde G)` in place of F
Smith predictor                        :math:`C\tilde G_0/(1 + C\tilde G_0)`; the model keeps its
                                       dead time
=====================================  =====================================================

with the same C and model: all maps from R, d, δ and η are those of the other diagram. The
conventional observer compares y itself with the reference,
:math:`u = C(R - y) + Fu - (F/\tilde G)y`, so that :math:`K = (C + F/\tilde G)/(1 - F)`.

.. rubric:: References

Ohnishi, K., M. Shibata, T. Murakami, Motion control for advanced mechatronics, IEEE/ASME Trans.
Mechatronics 1 (1996) 56-67.

Smith, O. J. M., Closer control of loops with dead time, Chem. Eng. Progress 53 (1957) 217-219.

Zhong, Q.-C., J. E. Normey-Rico, Control of integral processes with dead-time. Part 1: Disturbance
observer-based 2DOF control scheme, IEE Proc. Control Theory Appl. 149 (2002) 285-290.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control as ct
import numpy as np

from ..design import observer_form
from ..diagram import undelayed
from ..loop import NRDOB
from ..numerics import add, count_rhp, written

__all__ = ["controller_alone", "conventional_observer", "smith_predictor"]


def controller_alone(process: Any, model: Any, controller: Any) -> NRDOB:
    """Close a process with the controller alone, u = C (R - y), so that K = C.

    Parameters
    ----------
    process, model, controller : as for `nrdob.NRDOB`
        G; a model that C stabilises, on which nothing of the loop depends and whose dead time is
        left out; and C, so that C or the model integrates.

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
    F = _filter_of("C alone", model, controller)
    return NRDOB(process, undelayed(model)[0], controller, F)


def smith_predictor(process: Any, model: Any, controller: Any) -> NRDOB:
    r"""Close the loop of a Smith predictor, :math:`K = C/(1 + C\tilde G_0(1 - e^{-s\theta_m}))`.

    Parameters
    ----------
    process, model, controller : as for `nrdob.NRDOB`
        G, the model with its dead time, and C, which stabilises the model without it; one of the
        two integrates.

    Raises
    ------
    TypeError, ValueError
        As `controller_alone`.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import delay
    >>> Gm = delay(1.0) * ct.tf([1], [1, 1])
    >>> loop = smith_predictor(Gm, Gm, ct.tf([2, 2], [1, 0]))     # F = 2/(s + 2)
    >>> loop.stability().stable, round(loop.margins().plant_loop.gm, 3)
    (True, 2.52)
    """
    return NRDOB(process, model, controller, _filter_of("a Smith predictor", model, controller))


def conventional_observer(process: Any, model: Any, controller: Any, filter: Any) -> NRDOB:
    """Close a process with C and a conventional disturbance observer, K = (C + F/G̃)/(1 - F).

    Parameters
    ----------
    process, model, controller, filter : as for `nrdob.NRDOB`
        G, G̃ without dead time, C and F.

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
    loop = NRDOB(process, undelayed(model)[0], controller, filter)
    (_, Gm, C, F), p_A = loop.fractions, loop.p_A
    if p_A.zeros_at_origin or count_rhp(p_A).count != 0:
        raise ValueError(
            f"C does not stabilise the model: p_A has the root {written(complex(p_A.roots[0]))}; "
            "change C"
        )
    opened, closing = np.convolve(C.den, Gm.den), np.convolve(C.num, Gm.num)
    num = add(np.convolve(F.num, opened), np.convolve(F.den, closing))
    return replace(loop, filter=ct.tf(num, np.convolve(F.den, p_A.q)))


def _filter_of(scheme: str, model: Any, controller: Any) -> Any:
    """Return the complementary sensitivity of the model without dead time under C."""
    found = observer_form(controller, undelayed(model)[0])
    if not found:
        raise ValueError(f"{scheme} cannot be written as an observer: {found.reason}")
    return found.F
