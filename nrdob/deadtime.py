r"""Loops whose model waits for the dead time, by the names under which they are known.

An observer whose model is :math:`\tilde G_0e^{-s\theta_m}` inverts :math:`\tilde G_0` alone and
compares with what u was :math:`\theta_m` ago (`nrdob.diagram.equations` draws it). Its feedback is

.. math:: K = \frac{F}{(1 - F e^{-s\theta_m})\,\tilde G_0}.

A Smith predictor with the controller C has :math:`K = C/(1 + C\tilde G_0(1 - e^{-s\theta_m}))`. The
two are the same for :math:`F = C\tilde G_0/(1 + C\tilde G_0)`, the complementary sensitivity of
what the loop would be without dead time, and with that F all maps of the two loops are the same.

.. rubric:: References

Smith, O. J. M., Closer control of loops with dead time, Chem. Eng. Progress 53 (1957) 217-219.

Zhong, Q.-C., J. E. Normey-Rico, Control of integral processes with dead-time. Part 1: Disturbance
observer-based 2DOF control scheme, IEE Proc. Control Theory Appl. 149 (2002) 285-290.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .diagram import DelayedTransferFunction, as_fraction
from .loop import NRDOB
from .numerics import QuasiPolynomial, add, count_rhp, written

__all__ = ["dead_time_observer", "smith_predictor"]


def dead_time_observer(process: Any, model: Any, controller: Any, filter: Any) -> NRDOB:
    """Close a loop whose model waits as long as the process does.

    Parameters
    ----------
    process : DelayedTransferFunction
        G with its dead time.
    model : control.TransferFunction, StateSpace or (num, den)
        The model without dead time; with one of its own it keeps that.
    controller, filter : as for `nrdob.NRDOB`
        C and F.

    Returns
    -------
    NRDOB
        The loop, with a model that waits.

    Raises
    ------
    TypeError, ValueError
        As `nrdob.NRDOB`.

    Examples
    --------
    Matched, condition ii is left with the poles of plant and filter, whatever the dead time:

    >>> import control as ct
    >>> from nrdob import LowPassFilter, delay
    >>> Gm = ct.tf([1], [1, 1])
    >>> loop = dead_time_observer(delay(5.0) * Gm, Gm, 2.0, LowPassFilter(0.5, 1))
    >>> loop.p_B.delay, loop.p_B.roots.real.tolist()
    (0.0, [-1.0, -2.0])
    """
    waits = getattr(model, "delay", 0.0) or getattr(process, "delay", 0.0)
    return NRDOB(process, _behind(model, waits), controller, filter)


def smith_predictor(process: Any, model: Any, controller: Any) -> NRDOB:
    r"""Close the loop of a Smith predictor, written as the observer that it is.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`
        The process G.
    model : DelayedTransferFunction
        The model with its dead time.
    controller : as for `nrdob.NRDOB`
        C, which stabilises the model without dead time and integrates: F(0) = 1.

    Returns
    -------
    NRDOB
        With :math:`F = C\tilde G_0/(1 + C\tilde G_0)`. F/model has no zeros of the model any more.

    Raises
    ------
    ValueError
        If C does not integrate, or does not stabilise the model without dead time.
    TypeError, ValueError
        As `nrdob.NRDOB`.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import delay
    >>> Gm = delay(1.0) * ct.tf([1], [1, 1])
    >>> loop = smith_predictor(Gm, Gm, ct.tf([2, 2], [1, 0]))     # F = 2/(s + 2)
    >>> loop.stability().stable, round(loop.margins().plant_loop.gm, 3)
    (True, 2.52)
    """
    undelayed = model.tf if isinstance(model, DelayedTransferFunction) else model
    Gm, C = as_fraction(undelayed, "model"), as_fraction(controller, "controller")
    num, opened = np.convolve(C.num, Gm.num), np.convolve(C.den, Gm.den)
    den = add(opened, num)
    if opened[-1]:
        raise ValueError(
            "controller and model do not integrate: F(0) = 1 needs C·model to be infinite at "
            "s = 0; give the controller an integrator"
        )
    closed = QuasiPolynomial(den, scale=add(np.abs(opened), np.abs(num)))
    if closed.zeros_at_origin or count_rhp(closed).count != 0:
        raise ValueError(
            f"controller leaves the model without dead time a pole at "
            f"{written(complex(closed.roots[0]))}; a predictor needs a C that stabilises it"
        )
    return NRDOB(process, model, controller, (num, den))


def _behind(model: Any, seconds: float) -> Any:
    if (isinstance(model, DelayedTransferFunction) and model.delay) or not seconds:
        return model
    return DelayedTransferFunction(model, seconds)
