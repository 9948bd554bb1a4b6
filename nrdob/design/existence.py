r"""Whether any filter stabilises the observer loop: conditions on process and model alone.

With R = G/G̃ = b/a, where a = D·Nm and b = N·Dm, the observer loop has the characteristic function
p_B = a (Df - Nf) + b Nf. Its ends do not depend on the filter's inside: p_B(0) = b(0), and its
leading coefficient is that of a·Df. Each answer comes with its reason in words.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..numerics import (
    ROUNDING,
    ComplexArray,
    FloatArray,
    QuasiPolynomial,
    add,
    shared_factor,
    written,
)
from .mismatch import Mismatch, multiplied

__all__ = [
    "INTEGRATOR", "ROOT_AT_ORIGIN", "Answer", "right_half_plane_parity", "roots_by_side",
    "stabilizing_filter_exists",
]  # fmt: skip

ROOT_AT_ORIGIN = (
    "p_B(0) = 0 for every filter 1/(λs + 1)^n: the process has a zero at s = 0, or the model more "
    "than one integrator, as the process has, which takes a filter with 1 - F ~ s^2 or more"
)

INTEGRATOR = "the model's integrator, which cancels in (1 - F)·model, leaves p_B(0) to the filter"


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


def right_half_plane_parity(process: Any, model: Any) -> Answer:
    r"""Tell whether the DC signs allow a stable observer loop: a necessary condition on the model.

    A real root enters the right half plane through s = 0 or infinity. But p_B(0) = N(0)Dm(0), and
    the leading coefficient of p_B is that of D·Nm·Df, if F·H is strictly proper: neither depends on
    F. So the number of right-half-plane roots is even, or odd, for every F: even if and only if
    G(0)/G̃(0) has the sign :math:`(-1)^{P}`, with P poles of process and zeros of model there.

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
    mismatch = Mismatch.of(process, model)
    if mismatch.held_at_origin:
        # Of a zero of the process no filter is rid, of integrators one with 1 - F ~ s^2 or more.
        return Answer(False if mismatch.factors[0][-1] == 0 else None, ROOT_AT_ORIGIN)
    if mismatch.divided:
        return Answer(True, INTEGRATOR)
    _, D, Nm, _ = mismatch.factors
    P = roots_by_side(D, Nm)[0].size
    poles = f"{P or 'no'} unstable pole{'' if P == 1 else 's'} of G/model"
    if mismatch.b[-1] * mismatch.a[0] > 0:
        return Answer(True, f"{poles}, and DC signs that fit")
    wanted = "opposite" if P % 2 else "same"
    return Answer(False, f"{poles}: the model must have the {wanted} DC sign")


def stabilizing_filter_exists(process: Any, model: Any) -> Answer:
    r"""Tell whether any stable, causal F stabilises the loop that has F(0) = 1 and F(∞) = 0.

    The blocks F/G̃ and (1 - F)G̃ are each built as one. Let :math:`\bar D` hold the model's poles
    p, Re p ≥ 0, that the process has, too, each as often as the model has it, and :math:`\bar N`
    such zeros. They must cancel inside the blocks. With :math:`1 - F = \bar D E/D_f`,
    :math:`F = \bar N N_f'/D_f`, :math:`D_m = \bar D D_m'` and :math:`N_m = \bar N N_m'`, two
    polynomials must have all roots in the left half plane,

    .. math:: \bar D\,E + \bar N\,N_f' = D_f \quad\text{and}\quad
              D N_m'\,E + N D_m'\,N_f' = p :

    :math:`N_f'/E` must stabilise :math:`\bar N/\bar D` and :math:`N D_m'/(D N_m')` at once, which
    is strong stabilisation of their difference (Vidyasagar and Viswanadham). At the zeros of b - a,
    a = D·Nm and b = N·Dm, :math:`p = \kappa D_f` with :math:`\kappa = D N_m'/\bar D =
    N D_m'/\bar N` wherever the one or the other is finite. So by the parity interlacing property
    an F exists if and only if p/Df can keep one sign on the positive real axis: if κ has one sign
    at s = 0, where F = 1; at each real zero s > 0 of b - a, the common poles and zeros among them;
    and at infinity, where p/Df has the sign of a, if F·H rolls off. It must, unless the process is
    biproper and the model is not: then infinity forbids nothing. At s = 0 nothing is forbidden if
    the model integrates and the process does not.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G and G̃, both with or without dead time. For a dead time the question is left open unless
        the signs already forbid it: at 0 and at infinity, and where both have the same dead time at
        the zeros of b - a. A delayed model cancels no unstable poles but integrators.

    Returns
    -------
    Answer
        Open also where two real zeros of b - a cannot be told from a complex pair, and for a block
        that is not in lowest terms and has a root in the right half plane in common with the other.

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
    mismatch = Mismatch.of(process, model)
    a, b = mismatch.a, mismatch.b
    N, D, Nm, Dm = mismatch.factors
    unstable = np.concatenate(roots_by_side(D, Nm))
    shared = [root for root in unstable if any(_vanishes(p, root) for p in (N, Dm))]
    integrators = Dm[-1] == 0 and not mismatch.divided  # beside the one that both have
    if N[-1] and (shared or integrators):
        return _made_for_common_roots(mismatch, [*shared, *([0j] if integrators else [])])
    # With a dead time p_B has the sign of a far out on the real axis, whatever F.
    free_at_infinity = N.size == D.size and Nm.size < Dm.size and not mismatch.longest_delay
    parity = right_half_plane_parity(process, model)
    if not parity.holds and (mismatch.held_at_origin or not free_at_infinity):
        return parity
    if mismatch.delay != mismatch.model_delay:
        return Answer(None, "with a dead time the signs at zero and at infinity forbid nothing")
    zeros = _real_zeros(b, a)
    signs = np.sign(np.polyval(a, zeros.real))
    first = b[-1]
    if mismatch.divided:  # the sign at 0 is free
        first = signs[0] if free_at_infinity and signs.size else a[0]
    wrong = zeros[signs * first < 0]
    if wrong.size:
        sure = wrong[wrong.imag == 0]
        where, zero = "below" if free_at_infinity else "above", [*sure, *wrong][0].real
        lies = (
            f"an odd number of unstable poles of G/model lies {where} the real zero {zero:.4g} of H"
        )
        if sure.size:
            return Answer(False, f"{lies}: no stable filter that rolls off stabilises that")
        rounding = "if that is not a complex pair: within rounding either may be true"
        return Answer(None, f"{lies}, {rounding}")
    interlaced = "a and b - a interlace: p_B can be positive on the whole positive real axis"
    if mismatch.model_delay:
        return Answer(None, f"{interlaced}, and with a dead time that may not be enough")
    return Answer(True, interlaced)


class _Common(NamedTuple):
    """What a polynomial of the process shares with one of the model.

    `roots` are those in common, not on the left and not 0; `process` and `model` are without the
    common factor. All of the model's with common roots `cancels`, and leaves `rest`.
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
        right, axis = roots_by_side(once.common.q)
        roots = np.append(right, axis[axis != 0])
        return cls(roots, once.u.q, once.v.q, cancels, rest.without_origin.q)


def _made_for_common_roots(mismatch: Mismatch, shared: list[complex]) -> Answer:
    """Decide by the signs of κ whether an F exists that is made for the common poles and zeros."""
    N, D, Nm, Dm = mismatch.factors
    poles, zeros = _Common.of(D, Dm), _Common.of(N, Nm)
    if mismatch.model_delay and poles.roots.size:
        pole = written(complex(poles.roots[0]), pair=True)
        return Answer(
            False,
            f"process and model have a pole at {pole} in common, and the model has a dead time: "
            "nothing but integrators cancels inside (1 - F exp(-θm s))·model",
        )
    if not (poles.roots.size + zeros.roots.size) and any(shared):
        return Answer(
            None,
            f"process and model may have a mode at {written(shared[0], pair=True)} in common, "
            "within rounding: give both the same one, or two that differ",
        )
    which = ", ".join(dict.fromkeys(written(root, pair=True) for root in shared))
    made = f"an F made for what process and model have in common at {which}"
    signs = {"s = 0": _sign(0.0, N, poles.rest, zeros.cancels)} if not mismatch.divided else {}
    for p in poles.roots[poles.roots.imag == 0].real.tolist():
        signs[f"the common pole {p:.4g}"] = _sign(p, N, poles.rest, zeros.cancels)
    for z in zeros.roots[zeros.roots.imag == 0].real.tolist():
        signs[f"the common zero {z:.4g}"] = _sign(z, D, zeros.rest, poles.cancels)
    if N.size != D.size or Nm.size == Dm.size or mismatch.longest_delay:
        signs["infinity"] = float(np.sign(mismatch.a[0]))
    doubtful = False
    if not mismatch.longest_delay:
        a, b = multiplied(poles.process, zeros.model), multiplied(zeros.process, poles.model)
        for root in _real_zeros(b, a).tolist():
            sign = _sign(root.real, D, Nm, poles.cancels, zeros.cancels)
            signs[f"the zero {root.real:.4g} of H"] = sign
            doubtful |= root.imag != 0
    if not all(signs.values()):
        return Answer(
            None,
            "numerator and denominator of process or model have an unstable root in common, "
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


def _real_zeros(b: FloatArray, a: FloatArray) -> ComplexArray:
    """Real zeros of b - a in the right half plane; a possible pair keeps its imaginary part."""
    difference = QuasiPolynomial(add(b, -a), scale=add(np.abs(a), np.abs(b)))
    zeros = difference.roots
    zeros = zeros[(zeros.real > 0) & (zeros.imag >= 0)]
    rounding = ROUNDING * np.polyval(difference.scale, zeros.real)
    real = (zeros.imag == 0) | (np.abs(difference(zeros.real + 0j)) <= rounding)
    return np.asarray(zeros[real])


def roots_by_side(*polynomials: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Sort the roots of polynomials: in the right half plane, rightmost first, and on the axis."""
    functions = [QuasiPolynomial(p) for p in polynomials]
    roots = np.concatenate([p.roots for p in functions])
    on_axis = np.concatenate([p.near_axis(p.roots) for p in functions])
    right = roots[~on_axis & (roots.real > 0)]
    return right[np.argsort(-right.real, kind="stable")], 1j * roots.imag[on_axis]


def _vanishes(p: FloatArray, s: complex) -> bool:
    """Tell whether a polynomial is 0 at a point within rounding."""
    return bool(abs(np.polyval(p, s)) <= 1e-9 * np.polyval(np.abs(p), abs(s)))
