r"""What becomes of the observer loop with all fast filters, and with all slow ones.

It follows from where the roots go when λ tends to 0 or to infinity, without finding one.
"""

from __future__ import annotations

from math import cos, inf, pi
from typing import Any

from ..diagram import LowPassFilter
from ..numerics import ROUNDING, ComplexArray, QuasiPolynomial, written
from .existence import INTEGRATOR, ROOT_AT_ORIGIN, Answer, roots_by_side
from .mismatch import Mismatch

__all__ = ["gain_bound", "stable_for_fast_filters", "stable_for_slow_filters"]

EXACTLY = "stabilizing_time_constants gives the exact set"


def gain_bound(order: int) -> float:
    r"""Upper bound M_n of a pure gain error that a filter of order n tolerates, whatever λ.

    :math:`M_n = 1 + \sec^n(\pi/n)` for n ≥ 3, infinite for n ≤ 2: there the curve
    :math:`1 - (1 + jx)^n`, x > 0, meets the positive real axis.

    Parameters
    ----------
    order : int
        n of the filter.

    Raises
    ------
    TypeError, ValueError
        If the order is no whole number, or below 1.

    Examples
    --------
    >>> [round(gain_bound(n), 3) for n in (2, 3, 4, 5, 6)]
    [inf, 9.0, 5.0, 3.885, 3.37]
    """
    LowPassFilter(1.0, order)  # the same refusals
    return inf if order <= 2 else 1 + cos(pi / order) ** -order


def stable_for_slow_filters(process: Any, model: Any, order: int) -> Answer:
    r"""Tell whether the observer loop is stable for every large enough λ.

    As λ → ∞ the roots of p_B tend to those of D·Nm, and n of them to 0 as
    :math:`(-1 + (1 - g_0)^{1/n})/\lambda`, with :math:`g_0 = G(0)/\tilde G(0)`: stable if D·Nm is
    Hurwitz and :math:`0 < g_0 < M_n`, and unstable if either fails strictly (Theorem A.9 of the
    book). With m roots of D·Nm at 0, m + n roots leave 0 in all directions. No dead time changes
    any of this: the filter is slow against it.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G and G̃, both with or without dead time.
    order : int
        n of the filter :math:`1/(\lambda s + 1)^n`.

    Returns
    -------
    Answer
        Open where roots of the limit are on the imaginary axis, or a condition is met with
        equality within rounding.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put, or the order is no whole number.

    Examples
    --------
    >>> import control as ct
    >>> stable_for_slow_filters(ct.tf([2], [1, -1]), ct.tf([1], [1, 1]), 1)
    no: process or inverse model is unstable (pole at 1): a slow filter leaves it so
    """
    mismatch = Mismatch.of(process, model, order)
    _, D, Nm, _ = mismatch.factors
    right, axis = roots_by_side(D, Nm)
    if right.size:
        return Answer(
            False,
            f"process or inverse model is unstable (pole at {written(right[0], pair=True)}): "
            "a slow filter leaves it so",
        )
    if mismatch.held_at_origin:
        return Answer(False, ROOT_AT_ORIGIN)
    return _unless_on_axis(_slow_roots(mismatch), axis, "process or inverse model")


def _unless_on_axis(answer: Answer, axis: ComplexArray, whose: str) -> Answer:
    """Leave a yes open where roots of the limit on the axis may go to either side."""
    upper = axis[axis.imag > 0]
    if answer.holds is False or not upper.size:
        return answer
    pole = f"{whose} has a pole on the imaginary axis at ±{upper[0].imag:.4g}j"
    return Answer(None, f"{pole}, which may go to either side: {EXACTLY}")


def _slow_roots(mismatch: Mismatch) -> Answer:
    """Tell where the roots go that tend to 0 as λ grows."""
    if mismatch.divided:
        return Answer(True, f"process and inverse model are stable, and {INTEGRATOR}")
    n, (a, b) = mismatch.family.order, (mismatch.a, mismatch.b)
    if origin := QuasiPolynomial(a).zeros_at_origin:
        poles = f"process over model has {origin} pole{'s' if origin > 1 else ''} at s = 0"
        if origin + n > 2:
            return Answer(
                False,
                f"{poles}: with a slow filter of order {n}, {origin + n} roots leave 0 in all "
                "directions",
            )
        if b[-1] * a[-1 - origin] < 0:
            return Answer(
                False,
                "process and model differ in sign at low frequency: a real root goes to the "
                "right; give the model the other sign",
            )
        return Answer(None, f"{poles}, with a slow filter of order 1 a pair near 0: {EXACTLY}")
    g0, bound = float(b[-1] / a[-1]), gain_bound(n)
    if g0 < 0:
        return Answer(
            False,
            f"G(0)/model(0) = {g0:.4g} is negative: with a stable process and a minimum-phase "
            "model both need the same DC sign",
        )
    if abs(g0 - bound) <= ROUNDING * g0:
        return Answer(None, f"G(0)/model(0) = {g0:.6g} is exactly the bound for order {n}")
    if g0 > bound:
        return Answer(
            False,
            f"G(0)/model(0) = {g0:.4g} exceeds {bound:.4g}, the bound for order {n}: raise the "
            "model's gain or lower the order",
        )
    return Answer(
        True,
        f"process and inverse model are stable, and 0 < G(0)/model(0) = {g0:.4g} < {bound:.4g}",
    )


def stable_for_fast_filters(process: Any, model: Any, order: int) -> Answer:
    r"""Tell whether the observer loop is stable for every small enough λ.

    As λ → 0 the slow roots of p_B tend to those of N·Dm, and the fast ones to those of
    :math:`(\lambda s + 1)^n - 1 = -c\,s^m`, with :math:`R \to c\,s^m` at high frequency: Theorem
    11.2 of the book, case by case. A dead time that the model has not leaves more and more roots in
    the right half plane as λ → 0.

    Parameters
    ----------
    process, model, order : as for `stable_for_slow_filters`
        G, G̃ and n.

    Returns
    -------
    Answer
        Open with a dead time in the model, where roots of the limit are on the imaginary axis, or a
        condition is met with equality within rounding.

    Raises
    ------
    TypeError, ValueError
        As `stable_for_slow_filters`.

    Examples
    --------
    >>> import control as ct
    >>> G, Gm = ct.tf([-0.1, 10], [1, 2]), ct.tf([10], [1, 2])
    >>> stable_for_fast_filters(G, Gm, 2)
    no: the slow roots tend to a zero of the process or a pole of the model at 100
    """
    mismatch = Mismatch.of(process, model, order)
    if mismatch.delay and not mismatch.model_delay:
        return Answer(False, "with a dead time ever more roots are unstable as λ falls")
    if mismatch.held_at_origin:
        return Answer(False, ROOT_AT_ORIGIN)
    if mismatch.model_delay:
        return Answer(None, f"the model has a dead time: above a floor {EXACTLY}")
    N, _, _, Dm = mismatch.factors
    right, axis = roots_by_side(N, Dm)
    if right.size:
        return Answer(
            False,
            "the slow roots tend to a zero of the process or a pole of the model at "
            f"{written(right[0], pair=True)}",
        )
    answer = _fast_roots(mismatch)
    if answer.holds is not False and not mismatch.b[-1 - mismatch.divided]:
        return Answer(None, f"process over model vanishes at s = 0 more than once: {EXACTLY}")
    return _unless_on_axis(answer, axis, "inverse process or model")


def _fast_roots(mismatch: Mismatch) -> Answer:
    n, m = mismatch.family.order, mismatch.excess
    c, bound = float(mismatch.b[0] / mismatch.a[0]), gain_bound(mismatch.family.order)
    if m == n:
        return Answer(True, "all roots tend to those of N·Dm, which are in the left half plane")
    if m <= -2:
        return Answer(
            False,
            f"the process has {-m} more lags than the model: a model of the same relative degree "
            "is needed",
        )
    if c < 0:
        return Answer(
            False,
            f"process and model have opposite signs at high frequency (ratio {c:.4g}): a fast root "
            "is real and positive",
        )
    if m == -1:
        of_poles, of_zeros = (-p[1] / p[0] if p.size > 1 else 0.0 for p in (mismatch.a, mismatch.b))
        sums = float(of_poles - of_zeros)
        real = (n - 1) * c / (4 * n) + sums / 2
        verdict = None if abs(real) <= ROUNDING * (c + abs(sums)) else real < 0
        return Answer(
            verdict,
            "the process has a lag that the model lacks; the fast pair has a real part that "
            f"tends to {real:.4g} rad/s",
        )
    if m == 0:
        verdict = None if abs(c - bound) <= ROUNDING * c else c < bound
        return Answer(
            verdict,
            f"the gain ratio at high frequency is {c:.4g}, the bound for order {n} is {bound:.4g}",
        )
    return Answer(
        n - m <= 2,
        f"the model has relative degree {m} more than the process, and the filter's order is "
        f"{n - m} more than that; a difference of two is the most that works",
    )
