r"""What holds for every filter, for all fast ones and for all slow ones, without finding a root.

With R = G/G̃ = b/a, where a = D·Nm and b = N·Dm, the observer loop has the characteristic function
p_B = a (Df - Nf) + b Nf. Its ends do not depend on the filter's inside: p_B(0) = b(0), and its
leading coefficient is that of a·Df. From these two, and from where the roots go when λ tends to 0
or to infinity, follow necessary conditions, and some that are sufficient too. Each answer comes
with its reason in words.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, pi
from typing import Any

import numpy as np

from .blocks import ROUNDING, FloatArray
from .filters import LowPassFilter
from .mismatch import Mismatch
from .quasipoly import QuasiPolynomial, add


@dataclass(frozen=True)
class Answer:
    """A verdict and the reason for it.

    Attributes
    ----------
    holds : bool or None
        None where the question is left open.
    reason : str
        Why, in a sentence, and what to do about it.
    """

    holds: bool | None
    reason: str

    def __repr__(self) -> str:
        word = {True: "yes", False: "no", None: "open"}[self.holds]
        return f"{word}: {self.reason}"


def gain_bound(order: int) -> float:
    r"""Upper bound M_n of a pure gain error that a filter of order n bears, whatever λ.

    :math:`M_n = 1 + \sec^n(\pi/n)` for n ≥ 3, infinite for n ≤ 2: there the curve
    :math:`1 - (1 + jx)^n`, x > 0, meets the positive real axis.

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
    fails strictly.

    Parameters
    ----------
    process, model, order
        As for `nrdob.stabilizing_time_constants`.

    Examples
    --------
    >>> import control as ct
    >>> stable_for_slow_filters(ct.tf([2], [1, -1]), ct.tf([1], [1, 1]), 1)
    no: process or inverse model is unstable (pole at 1): a slow filter leaves it so
    """
    mismatch = Mismatch.of(process, model, order)
    if (pole := _rightmost(mismatch.a)).real > 0:
        return Answer(
            False,
            f"process or inverse model is unstable (pole at {_text(pole)}): "
            "a slow filter leaves it so",
        )
    if mismatch.b[-1] == 0:
        return Answer(False, ROOT_AT_ORIGIN)
    if pole.real == 0:
        return Answer(
            None,
            "process or inverse model has a pole on the imaginary axis; a slow filter moves it, "
            "but to which side depends on more than its limit",
        )
    g0, bound = float(mismatch.b[-1] / mismatch.a[-1]), gain_bound(order)
    if g0 < 0:
        return Answer(False, f"G(0)/model(0) = {g0:.4g} is negative: {OPPOSITE_SIGNS}")
    if g0 == bound:
        return Answer(None, f"G(0)/model(0) = {g0:.6g} is exactly the bound for order {order}")
    if g0 > bound:
        return Answer(
            False,
            f"G(0)/model(0) = {g0:.4g} exceeds {bound:.4g}, the bound for order {order}: raise the "
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

    A dead time leaves more and more roots on the right as λ → 0.

    Parameters
    ----------
    process, model, order
        As for `nrdob.stabilizing_time_constants`.

    Examples
    --------
    >>> import control as ct
    >>> G, Gm = ct.tf([-0.1, 10], [1, 2]), ct.tf([10], [1, 2])
    >>> stable_for_fast_filters(G, Gm, 2)
    no: the slow roots tend to a zero of the process or a pole of the model at 100
    """
    mismatch = Mismatch.of(process, model, order)
    if mismatch.delay:
        return Answer(False, "with a dead time ever more roots are on the right as λ falls")
    if mismatch.b[-1] == 0:
        return Answer(False, ROOT_AT_ORIGIN)
    if (root := _rightmost(mismatch.b)).real > 0:
        return Answer(
            False,
            f"the slow roots tend to a zero of the process or a pole of the model at {_text(root)}",
        )
    if root.real == 0:
        return Answer(
            None,
            "the process has a zero, or the model a pole, on the imaginary axis; to which side a "
            "fast filter moves it depends on more than its limit",
        )
    return _fast_roots(mismatch)


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
        verdict = None if c == bound else c < bound
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
    process, model
        As for `nrdob.NRDOB`; a dead time changes nothing.

    Returns
    -------
    Answer
        `holds` False: no filter with F·H strictly proper stabilises the loop. True: the signs
        forbid nothing.

    Examples
    --------
    >>> import control as ct
    >>> right_half_plane_parity(ct.tf([4], [-1, -1, 2]), ct.tf([1], [1, 3, 2]))
    no: 1 unstable pole of G/model: the model must have the opposite DC sign
    """
    mismatch = Mismatch.of(process, model)
    if mismatch.b[-1] == 0:
        return Answer(False, ROOT_AT_ORIGIN)
    P = int(np.sum(QuasiPolynomial(mismatch.a).roots.real > 0))
    even = bool(mismatch.b[-1] * mismatch.a[0] > 0)
    poles = f"{P or 'no'} unstable pole{'' if P == 1 else 's'} of G/model"
    if even:
        return Answer(True, f"{poles}, and DC signs that fit")
    wanted = "opposite" if P % 2 else "same"
    return Answer(False, f"{poles}: the model must have the {wanted} DC sign")


def stabilizing_filter_exists(process: Any, model: Any) -> Answer:
    r"""Tell whether any stable F stabilises the loop that has F(0) = 1 and rolls off, F(∞) = 0.

    Such an F is a stable controller for the mismatch H = (b - a)/a with one value prescribed. By
    the parity interlacing property it exists if and only if a and b have no common root in the
    closed right half plane and p_B can keep one sign on the positive real axis. There p_B has the
    sign of a at infinity (F rolls off), that of a at each real zero z > 0 of b - a, and that of b
    at s = 0.

    Parameters
    ----------
    process, model
        As for `nrdob.NRDOB`. For a dead time the question is left open unless the signs at 0 and at
        infinity already forbid it.

    References
    ----------
    D. C. Youla, J. J. Bongiorno, C. N. Lu, Single-loop feedback-stabilization of linear
    multivariable dynamical plants, Automatica 10 (1974).

    Examples
    --------
    >>> import control as ct
    >>> stabilizing_filter_exists(ct.tf([4], [-1, -1, 2]), ct.tf([-1], [1, 3, 2]))
    yes: a and b - a interlace: p_B can be positive on the whole positive real axis
    """
    mismatch = Mismatch.of(process, model)
    a, b = mismatch.a, mismatch.b
    shared = [root for root in QuasiPolynomial(a).roots if root.real >= 0 and _vanishes(b, root)]
    if shared:
        return Answer(
            False, f"a mode at {_text(shared[0])} cancels in G/model, out of reach of every filter"
        )
    parity = right_half_plane_parity(process, model)
    if not parity.holds:
        return parity
    if mismatch.delay:
        return Answer(None, "with a dead time the signs at zero and at infinity forbid nothing")
    difference = add(b, -a)
    zeros = QuasiPolynomial(difference).roots if difference.any() else np.empty(0, dtype=complex)
    real = zeros.real[(np.abs(zeros.imag) <= 1e-9 * np.abs(zeros)) & (zeros.real > 0)]
    wrong = real[np.polyval(a, real) * a[0] < 0]
    if wrong.size:
        return Answer(
            False,
            f"an odd number of unstable poles of G/model lies above the real zero {wrong[0]:.4g} "
            "of H: no stable filter that rolls off stabilises that",
        )
    return Answer(
        True, "a and b - a interlace: p_B can be positive on the whole positive real axis"
    )


ROOT_AT_ORIGIN = (
    "p_B(0) = N(0)·Dm(0) = 0 for every filter: the process has a zero at s = 0, or the model an "
    "integrator; give the model a slow stable pole instead, or build (1 - F)·model as one block"
)

OPPOSITE_SIGNS = "with a stable process and a minimum-phase model both need the same DC sign"


def _rightmost(p: FloatArray) -> complex:
    """Rightmost root of a polynomial; far on the left if it has none."""
    found = QuasiPolynomial(p).roots
    return complex(found[0]) if found.size else complex(-inf)


def _sum_of_roots(p: FloatArray) -> float:
    return float(-p[1] / p[0]) if p.size > 1 else 0.0


def _vanishes(p: FloatArray, s: complex) -> bool:
    return bool(abs(np.polyval(p, s)) <= 1e-9 * np.polyval(np.abs(p), abs(s)))


def _text(root: complex) -> str:
    return f"{root.real:.4g}" + (f" ± {abs(root.imag):.4g}j" if root.imag else "")
