r"""What holds for every filter, for all fast ones and for all slow ones, without finding a root.

With R = G/G̃ = b/a, where a = D·Nm and b = N·Dm, the observer loop has the characteristic function
p_B = a (Df - Nf) + b Nf. Its ends do not depend on the filter's inside: p_B(0) = b(0), and its
leading coefficient is that of a·Df. From these two, and from where the roots go when λ tends to 0
or to infinity, follow necessary conditions, and some that are sufficient too. Each answer comes
with its reason in words.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, inf, pi
from typing import Any, NamedTuple

import numpy as np

from ..diagram import LowPassFilter
from ..numerics import (
    ROUNDING,
    ComplexArray,
    FloatArray,
    QuasiPolynomial,
    add,
    shared_factor,
    written,
)
from .answer import Answer
from .fastwaiting import fast_where_the_model_waits
from .mismatch import Mismatch, multiplied

__all__ = [
    "Answer",
    "gain_bound",
    "right_half_plane_parity",
    "roots_by_side",
    "stabilizing_filter_exists",
    "stable_for_fast_filters",
    "stable_for_slow_filters",
]

SIDEWAYS = 1e-10
"""Share of a root's motion off the axis below which the motion is along it, within rounding."""

_NONE = np.empty(0, dtype=complex)

CLUSTER = 1e-4
"""Relative distance within which roots on the axis count as one multiple root."""


def gain_bound(order: int) -> float:
    r"""Upper bound M_n of a pure gain error that a filter of order n bears, whatever λ.

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
    :math:`(-1 + (1 - g_0)^{1/n})/\lambda`, with :math:`g_0 = G(0)/\tilde G(0)`. So the loop is
    stable for all large λ if D·Nm is Hurwitz and :math:`0 < g_0 < M_n`, and unstable if either
    fails strictly. A simple root :math:`s_0 \ne 0` of D·Nm on the axis moves by

    .. math:: -\frac{b(s_0)\,e^{-s_0\theta}}{a'(s_0)\,s_0^n}\,\lambda^{-n},

    which decides to which side. With m roots at 0, m + n roots spread evenly around a circle that
    shrinks as :math:`\lambda^{-n/(m+n)}`: three or more reach the right half plane. A dead time of
    the model changes none of this: the filter is slow against it.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G and G̃, both with or without dead time.
    order : int
        n of the filter :math:`1/(\lambda s + 1)^n`.

    Returns
    -------
    Answer
        Open where the loop is on the border at every slow filter within rounding.

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
    mismatch = Mismatch.of(process, model, order, waits=True)
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
    moved = _moved(mismatch, axis, "process or inverse model", "slow", _drift_when_slow)
    return _first_decisive([moved, _slow_roots(mismatch)])


def _drift_when_slow(mismatch: Mismatch, root: complex) -> tuple[complex, complex]:
    """First and second change of a simple root of a as λ falls from infinity."""
    n, a = mismatch.order, np.append(mismatch.a, 0.0) if mismatch.order == 1 else mismatch.a
    b, slope, curvature = (
        np.polyval(p, root) for p in (mismatch.b, np.polyder(a), np.polyder(a, 2))
    )
    lag = np.exp(-mismatch.delay * root)
    if n == 1:  # exactly s·a(s) + b(s)/λ
        first = -b * lag / slope
        tilt = (np.polyval(np.polyder(mismatch.b), root) - mismatch.delay * b) * lag
        tilt += slope / root * (1 - np.exp(-mismatch.wait * root))  # of a (1 - exp(-sθm))/λ
        return complex(first), complex(-(curvature * first**2 / 2 + tilt * first) / slope)
    first = -b * lag / (slope * root**n)
    return complex(first), complex(-n * first / root)  # ((λs + 1)^n - 1)^-1 = (λs)^-n (1 - n/λs …)


def _drift_when_fast(mismatch: Mismatch, root: complex) -> tuple[complex, complex]:
    """First and second change of a simple root of b as λ grows from 0."""
    n = mismatch.order
    a, tilt, slope, curvature = (
        np.polyval(p, root)
        for p in (
            mismatch.a, np.polyder(mismatch.a), np.polyder(mismatch.b), np.polyder(mismatch.b, 2),
        )
    )  # fmt: skip
    first = -n * root * a / slope
    second = (
        curvature * first**2 / 2 + n * first * (tilt * root + a) + n * (n - 1) * a * root**2 / 2
    )
    return complex(first), complex(-second / slope)


def _moved(
    mismatch: Mismatch,
    axis: ComplexArray,
    whose: str,
    speed: str,
    drift: Callable[[Mismatch, complex], tuple[complex, complex]],
) -> Answer:
    """Tell to which side the roots on the axis go, from the first change of each off the axis."""
    upper = axis[axis.imag > 0]
    if not upper.size:
        return Answer(True, "no root of the limit is on the axis")
    answers = []
    for root in upper:
        pole = f"{whose} has a pole on the imaginary axis at ±{abs(root.imag):.4g}j"
        if np.sum(np.abs(upper - root) <= CLUSTER * abs(root)) > 1:
            answers.append(Answer(None, f"{pole}, a multiple one; give it a trace of damping"))
        elif _vanishes(mismatch.a, root) and _vanishes(mismatch.b, root):
            answers.append(
                Answer(
                    False,
                    f"{pole}, which cancels in G/model, out of reach of every filter but one made "
                    "for it: see nrdob.interpolating_filter",
                )
            )
        else:
            off = [d for d in drift(mismatch, complex(root)) if abs(d.real) > SIDEWAYS * abs(d)]
            if off:
                side = "right" if off[0].real > 0 else "left"
                moves = f"{pole}; a {speed} filter moves it to the {side}"
                answers.append(Answer(off[0].real < 0, moves))
            else:
                answers.append(
                    Answer(None, f"{pole}, which a {speed} filter hardly moves off the axis")
                )
    return _first_decisive(answers)


def _first_decisive(answers: list[Answer]) -> Answer:
    """Put a no before an open question before a yes; of several yes take the last."""
    for wanted in (False, None):
        for answer in answers:
            if answer.holds is wanted:
                return answer
    return answers[-1]


def _slow_roots(mismatch: Mismatch) -> Answer:
    """Tell where the roots go that tend to 0 as λ grows."""
    if mismatch.integrator:
        return Answer(True, f"process and inverse model are stable, and {INTEGRATOR}")
    n, (a, b) = mismatch.order, (mismatch.a, mismatch.b)
    origin = QuasiPolynomial(a).zeros_at_origin
    if origin:
        start = a.size - 1 - origin
        ratio = float(b[-1] / a[start])
        if origin + n > 2:
            return Answer(
                False,
                f"process over model has {origin} pole{'s' if origin > 1 else ''} at s = 0: with a "
                f"slow filter of order {n}, {origin + n} roots leave 0 in all directions",
            )
        if ratio < 0:
            return Answer(False, f"process and model differ in sign at low frequency: {OPPOSITE}")
        # λ a1 s² (1 + α s) + b0 (1 + β s) = 0 has a pair whose real part is (α - β) b0/(2 λ a1).
        alpha = float(a[start - 1] / a[start]) if start else 0.0
        beta = (float(b[-2] / b[-1]) if b.size > 1 else 0.0) - mismatch.delay
        border = abs(alpha - beta) <= SIDEWAYS * (abs(alpha) + abs(beta))
        return Answer(
            None if border else beta > alpha,
            "process over model has a pole at s = 0; with a slow filter of order 1 it becomes a "
            f"pair near 0 whose real part has the sign of {alpha - beta:.4g}",
        )
    g0, bound = float(b[-1] / a[-1]), gain_bound(n)
    if g0 < 0:
        return Answer(False, f"G(0)/model(0) = {g0:.4g} is negative: {OPPOSITE_SIGNS}")
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

    As λ → 0 the slow roots of p_B tend to those of N·Dm. The fast ones follow from the excess m of
    the model's relative degree over the process's, and from the ratio c of the leading
    coefficients, :math:`R \to c\,s^m`:

    - m = 0: :math:`(-1 + (1 - c)^{1/n})/\lambda`, in the left half plane if 0 < c < M_n;
    - m > 0: :math:`s^{n-m} = -c/\lambda^n`, on the left if c > 0 and n - m ≤ 2;
    - m = -1: :math:`s^2 = -c/(n\lambda)`, whose real part tends to
      :math:`(n-1)c/(4n) + (\sum p_R - \sum z_R)/2` if c > 0;
    - m ≤ -2: at least one of the roots of :math:`s^{1-m} = -c/(n\lambda)` is on the right.

    A simple root :math:`s_0` of N·Dm on the axis moves by
    :math:`-n\lambda s_0 a(s_0)/b'(s_0)`, which decides to which side. A dead time leaves more and
    more roots on the right as λ → 0, unless the model waits for it, see
    `nrdob.design.fastwaiting`.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G and G̃, both with or without dead time.
    order : int
        n of the filter :math:`1/(\lambda s + 1)^n`.

    Returns
    -------
    Answer
        Open where the loop is on the border at every fast filter within rounding.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put, or the order is no whole number.

    Examples
    --------
    >>> import control as ct
    >>> G, Gm = ct.tf([-0.1, 10], [1, 2]), ct.tf([10], [1, 2])
    >>> stable_for_fast_filters(G, Gm, 2)
    no: the slow roots tend to a zero of the process or a pole of the model at 100
    """
    mismatch = Mismatch.of(process, model, order, waits=True)
    if mismatch.delay and not mismatch.wait:
        return Answer(False, "with a dead time ever more roots are on the right as λ falls")
    if mismatch.held_at_origin:
        return Answer(False, ROOT_AT_ORIGIN)
    if mismatch.wait:
        return fast_where_the_model_waits(mismatch)
    N, _, _, Dm = mismatch.factors
    right, axis = roots_by_side(N, Dm)
    if right.size:
        return Answer(
            False,
            "the slow roots tend to a zero of the process or a pole of the model at "
            f"{written(right[0], pair=True)}",
        )
    moved = _moved(mismatch, axis, "inverse process or model", "fast", _drift_when_fast)
    return _first_decisive([moved, _roots_near_origin(mismatch), _fast_roots(mismatch)])


def _roots_near_origin(mismatch: Mismatch) -> Answer:
    """Tell where the roots of n λ a(0) + N·Dm/s go that tend to 0 as λ falls."""
    b = QuasiPolynomial(mismatch.delayed)
    count = b.zeros_at_origin if mismatch.integrator else 0
    if not count:
        return Answer(True, "no root of the limit is at s = 0")
    positive = bool(mismatch.a[-1] * b.without_origin.q[-1] > 0)
    where = "process over model vanishes at s = 0 more than once: with a fast filter"
    if count == 1:
        return Answer(positive, f"{where} a root leaves 0 to the {'left' if positive else 'right'}")
    if count == 2 and positive:
        return Answer(None, f"{where} a pair leaves 0 along the axis")
    return Answer(False, f"{where} {count} roots leave 0 in all directions")


def _fast_roots(mismatch: Mismatch) -> Answer:
    n, m = mismatch.order, mismatch.excess
    c, bound = float(mismatch.b[0] / mismatch.a[0]), gain_bound(mismatch.order)
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
            f"process and model have opposite signs at high frequency (ratio {c:.4g}): a fast "
            "root is real and positive",
        )
    if m == -1:
        sums = float(_sum_of_roots(mismatch.a) - _sum_of_roots(mismatch.b))
        real = (n - 1) * c / (4 * n) + sums / 2
        verdict = None if abs(real) <= ROUNDING * (c + abs(sums)) else real < 0
        return Answer(
            verdict,
            "the process has one more lag than the model; the fast pair has a real part that "
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
        f"{n - m} more than that; a difference of two is the most that is borne",
    )


def right_half_plane_parity(process: Any, model: Any) -> Answer:
    r"""Tell whether the DC signs allow a stable observer loop: a necessary condition on the model.

    A root that enters the right half plane as a real one must pass through s = 0 or infinity. But
    p_B(0) = N(0)Dm(0), and the leading coefficient of p_B is that of D·Nm·Df, if F·H is strictly
    proper: neither depends on F. So the number of right-half-plane roots is even for every F or odd
    for every F: even if and only if G(0)/G̃(0) has the sign :math:`(-1)^{P}`, where P counts the
    right-half-plane poles of the process and zeros of the model.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G and G̃, both with or without dead time, which changes nothing.

    Returns
    -------
    Answer
        `holds` False: no filter with F·H strictly proper stabilises the loop, unless it cancels an
        unstable pole or zero of the model inside a block. True: the signs forbid nothing.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put.

    Examples
    --------
    >>> import control as ct
    >>> right_half_plane_parity(ct.tf([4], [-1, -1, 2]), ct.tf([1], [1, 3, 2]))
    no: 1 unstable pole of G/model: the model must have the opposite DC sign
    """
    mismatch = Mismatch.of(process, model, waits=True)
    if mismatch.held_at_origin:
        # Of a zero of the process no filter is rid, of integrators one with 1 - F ~ s^2 or more.
        return Answer(False if mismatch.factors[0][-1] == 0 else None, ROOT_AT_ORIGIN)
    if mismatch.integrator:
        return Answer(True, INTEGRATOR)
    _, D, Nm, _ = mismatch.factors
    P = roots_by_side(D, Nm)[0].size
    even = bool(mismatch.b[-1] * mismatch.a[0] > 0)
    poles = f"{P or 'no'} unstable pole{'' if P == 1 else 's'} of G/model"
    if even:
        return Answer(True, f"{poles}, and DC signs that fit")
    wanted = "opposite" if P % 2 else "same"
    return Answer(False, f"{poles}: the model must have the {wanted} DC sign")


def stabilizing_filter_exists(process: Any, model: Any) -> Answer:
    r"""Tell whether any stable, causal F stabilises the loop that has F(0) = 1 and F(∞) = 0.

    The blocks F/G̃ and (1 - F)G̃ are each built as one. Let :math:`\bar D` hold the model's poles
    p, Re p ≥ 0, that the process has, too, each as often as the model has it, and :math:`\bar N`
    such zeros. At such a pole D E vanishes whatever F is, so that p_B over what cancels is zero
    there unless 1 - F is zero at p as often as the model is infinite; at such a zero, unless F is
    zero as often as the model. So they must cancel inside the blocks. With what is left,
    :math:`1 - F = \bar D E/D_f`, :math:`F = \bar N N_f'/D_f`, :math:`D_m = \bar D D_m'` and
    :math:`N_m = \bar N N_m'`, two polynomials must have all roots on the left,

    .. math:: \bar D\,E + \bar N\,N_f' = D_f \quad\text{and}\quad
              D N_m'\,E + N D_m'\,N_f' = p :

    :math:`N_f'/E` must stabilise :math:`\bar N/\bar D` and :math:`N D_m'/(D N_m')` at once. That
    is strong stabilisation of their difference (Vidyasagar and Viswanadham): with
    :math:`E = X + \bar N Q`, :math:`N_f' = Y - \bar D Q` and :math:`\bar D X + \bar N Y` without
    roots on the right, p is A + (a - b) Q, where a = D·Nm, b = N·Dm, and no root of a - b on the
    right or on the axis is one of A. There :math:`p = \kappa D_f`, with
    :math:`\kappa = D N_m'/\bar D = N D_m'/\bar N` wherever the one or the other is finite. So by
    the parity interlacing property an F exists if and only if p/Df can keep one sign on the
    positive real axis: if κ has one sign at s = 0, where F = 1; at each real zero s > 0 of b - a,
    the common poles and zeros among them; and at infinity, where p/Df has the sign of a, if F·H
    rolls off. It must, unless the process is biproper and the model is not: then F need not fall
    faster than H grows, the leading coefficient of p has either sign, and infinity forbids nothing.
    At s = 0 nothing is forbidden if the model integrates and the process does not. With a = b all
    of this is true: p = κ Df, and all roots of κ are on the left.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G and G̃, both with or without dead time. For a dead time the question is left open unless
        the signs already forbid it: at 0 and at infinity, and where both have the same dead time at
        the zeros of b - a. A model that waits cancels no unstable poles but integrators.

    Returns
    -------
    Answer
        Open also where two real zeros of b - a cannot be told from a complex pair, and for a block
        that is not in lowest terms and has a root on the right in common with the other.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put.

    References
    ----------
    Youla, D. C., J. J. Bongiorno, C. N. Lu, Single-loop feedback-stabilization of linear
    multivariable dynamical plants, Automatica 10 (1974) 159-173.

    Vidyasagar, M., N. Viswanadham, Algebraic design techniques for reliable stabilization, IEEE
    Trans. Automatic Control 27 (1982) 1085-1095.

    Examples
    --------
    >>> import control as ct
    >>> G = ct.tf([4], [-1, -1, 2])
    >>> stabilizing_filter_exists(G, ct.tf([-1], [1, 3, 2]))
    yes: a and b - a interlace: p_B can be positive on the whole positive real axis
    >>> found = stabilizing_filter_exists(G, G)
    >>> found.holds, found.reason.split(":")[0]
    (True, 'an F made for what process and model have in common at 1')
    """
    mismatch = Mismatch.of(process, model, waits=True)
    a, b = mismatch.a, mismatch.b
    N, D, Nm, Dm = mismatch.factors
    unstable = np.concatenate(roots_by_side(D, Nm))
    shared = [root for root in unstable if any(_vanishes(p, root) for p in (N, Dm))]
    integrators = Dm[-1] == 0 and not mismatch.integrator  # beside the one that both have
    if N[-1] and (shared or integrators):
        return _made_for_common_roots(mismatch, [*shared, *([0j] if integrators else [])])
    # With a dead time p_B has the sign of a far out on the real axis, whatever F.
    free_at_infinity = N.size == D.size and Nm.size < Dm.size and not mismatch.longest_delay
    parity = right_half_plane_parity(process, model)
    if not parity.holds and (mismatch.held_at_origin or not free_at_infinity):
        return parity
    if mismatch.delay != mismatch.wait:
        return Answer(None, "with a dead time the signs at zero and at infinity forbid nothing")
    zeros = _real_zeros(_difference(b, a))
    signs = np.sign(np.polyval(a, zeros.real))
    first = b[-1]
    if mismatch.integrator:  # the sign at 0 is free
        first = signs[0] if free_at_infinity and signs.size else a[0]
    wrong = zeros[signs * first < 0]
    if wrong.size:
        where = "below" if free_at_infinity else "above"
        doubtful = bool((wrong.imag != 0).all())
        sure = complex(wrong[wrong.imag == 0][0] if not doubtful else wrong[0]).real
        return Answer(
            None if doubtful else False,
            f"an odd number of unstable poles of G/model lies {where} the real zero {sure:.4g} of H"
            + (
                ", if that is not a complex pair: within rounding either may be true"
                if doubtful
                else ": no stable filter that rolls off stabilises that"
            ),
        )
    interlaced = "a and b - a interlace: p_B can be positive on the whole positive real axis"
    if mismatch.wait:
        return Answer(None, f"{interlaced}, and with a dead time that may not be enough")
    return Answer(True, interlaced)


class _Common(NamedTuple):
    """What a polynomial of the process shares with one of the model.

    Attributes
    ----------
    roots : array of complex
        The common roots on the right or on the axis, but for s = 0, each once.
    process, model : array of float
        What is left of both without the common factor.
    cancels, rest : array of float
        All of the model's polynomial that has roots in common, and what is left of that.
    """

    roots: ComplexArray
    process: FloatArray
    model: FloatArray
    cancels: FloatArray
    rest: FloatArray

    @classmethod
    def of(cls, process: FloatArray, model: FloatArray) -> _Common:
        """Divide what is common out of both, and out of the model as often as it can be."""
        once = shared_factor(QuasiPolynomial(process), QuasiPolynomial(model))
        cancels, rest, again = once.common.q, once.v, once.common
        while again.degree and (more := shared_factor(rest, again)).common.degree:
            cancels, rest, again = np.convolve(cancels, more.common.q), more.u, more.common
        right, axis = roots_by_side(once.common.q) if once.common.degree else (_NONE, _NONE)
        roots = np.concatenate([right, axis[axis != 0]])
        return cls(roots, once.u.q, once.v.q, cancels, rest.without_origin.q)


def _made_for_common_roots(mismatch: Mismatch, shared: list[complex]) -> Answer:
    """Decide by the signs of κ whether an F exists that is made for the common poles and zeros."""
    N, D, Nm, Dm = mismatch.factors
    poles, zeros = _Common.of(D, Dm), _Common.of(N, Nm)
    if mismatch.wait and poles.roots.size:
        pole = written(complex(poles.roots[0]), pair=True)
        return Answer(
            False,
            f"process and model have a pole at {pole} in common, and the model waits: nothing "
            "but integrators cancels inside (1 - F exp(-θm s))·model",
        )
    if not (poles.roots.size + zeros.roots.size) and any(shared):
        return Answer(
            None,
            f"process and model may have a mode at {written(shared[0], pair=True)} in common, "
            "within rounding: give both the same one, or two that differ",
        )
    which = ", ".join(dict.fromkeys(written(root, pair=True) for root in shared))
    made = f"an F made for what process and model have in common at {which}"
    signs = {"s = 0": _sign(0.0, N, poles.rest, zeros.cancels)} if not mismatch.integrator else {}
    for p in _real(poles.roots):
        signs[f"the common pole {p:.4g}"] = _sign(p, N, poles.rest, zeros.cancels)
    for z in _real(zeros.roots):
        signs[f"the common zero {z:.4g}"] = _sign(z, D, zeros.rest, poles.cancels)
    if N.size != D.size or Nm.size == Dm.size or mismatch.longest_delay:
        signs["infinity"] = float(np.sign(mismatch.a[0]))
    doubtful = False
    if not mismatch.longest_delay:
        a = multiplied(poles.process, zeros.model)
        b = multiplied(zeros.process, poles.model)
        for root in _real_zeros(_difference(b, a)).tolist():
            signs[f"the zero {root.real:.4g} of H"] = _sign(
                root.real, D, Nm, poles.cancels, zeros.cancels
            )
            doubtful |= root.imag != 0
    if not all(signs.values()):
        return Answer(
            None,
            "numerator and denominator of process or model have a root on the right in common, "
            "which no feedback reaches: give both in lowest terms",
        )
    if len(set(signs.values())) < 2:
        if mismatch.longest_delay:
            return Answer(None, f"with a dead time the signs do not forbid {made}")
        return Answer(True, f"{made}: the signs of p_B at {', '.join(signs) or 'no point'} agree")
    names = [next(name for name, sign in signs.items() if sign == way) for way in (1.0, -1.0)]
    return Answer(
        None if doubtful else False,
        f"even with {made} p_B has opposite signs at {names[0]} and at {names[1]}"
        + (", if no complex pair is near: within rounding" if doubtful else ""),
    )


def _sign(x: float, *factors: FloatArray) -> float:
    return float(np.prod([np.sign(np.polyval(p, x)) for p in factors]))


def _real(roots: ComplexArray) -> list[float]:
    return [float(root.real) for root in roots if root.imag == 0]


def _difference(b: FloatArray, a: FloatArray) -> QuasiPolynomial:
    return QuasiPolynomial(add(b, -a), scale=add(np.abs(a), np.abs(b)))


def _real_zeros(difference: QuasiPolynomial) -> ComplexArray:
    """Real zeros on the right; those that may be a complex pair keep their imaginary part."""
    zeros = difference.roots if difference.degree else _NONE
    zeros = zeros[(zeros.real > 0) & (zeros.imag >= 0)]
    real = (zeros.imag == 0) | (
        np.abs(difference(zeros.real + 0j)) <= ROUNDING * np.polyval(difference.scale, zeros.real)
    )
    return np.asarray(zeros[real])


def roots_by_side(*polynomials: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Sort the roots of polynomials: in the right half plane, and on the axis within rounding.

    Parameters
    ----------
    polynomials : arrays of float
        Coefficients in descending powers.

    Returns
    -------
    right, axis : array of complex
        The roots, rightmost first; those on the axis without their rounding error.
    """
    right, axis = [np.empty(0, dtype=complex)], [np.empty(0, dtype=complex)]
    for coefficients in polynomials:
        p = QuasiPolynomial(coefficients)
        on_axis = p.near_axis(p.roots)
        axis.append(1j * p.roots.imag[on_axis])
        right.append(p.roots[~on_axis & (p.roots.real > 0)])
    found = np.concatenate(right)
    return found[np.argsort(-found.real, kind="stable")], np.concatenate(axis)


ROOT_AT_ORIGIN = (
    "p_B(0) = 0 for every filter 1/(λs + 1)^n: the process has a zero at s = 0, or the model more "
    "than one integrator, as the process has, which takes a filter with 1 - F ~ s^2 or more"
)

INTEGRATOR = "the model's integrator, which cancels in (1 - F)·model, leaves p_B(0) to the filter"

OPPOSITE = "a real root goes to the right; give the model the other sign"

OPPOSITE_SIGNS = "with a stable process and a minimum-phase model both need the same DC sign"


def _sum_of_roots(p: FloatArray) -> float:
    return float(-p[1] / p[0]) if p.size > 1 else 0.0


def _vanishes(p: FloatArray, s: complex) -> bool:
    return bool(abs(np.polyval(p, s)) <= 1e-9 * np.polyval(np.abs(p), abs(s)))
