"""Lemma 1, corrected: the loop is stable if and only if p_A and p_B have all roots on the left.

Each condition is judged twice, by the encirclement count and by the roots themselves, before any
cancellation. A verdict is given only where the two agree; otherwise it is None, with the reason.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from html import escape
from math import inf, nan

import numpy as np

from .blocks import ComplexArray
from .equations import LoopEquations
from .nyquist import NyquistCount, nyquist_count
from .quasipoly import QuasiPolynomial

AT_ORIGIN = "a root at s = 0 exactly"


@dataclass(frozen=True)
class LoopStability:
    """Evidence for one condition of Lemma 1.

    Attributes
    ----------
    name : str
        Which loop: "C Gm (i)" or "F H (ii)".
    stable : bool or None
        All roots in the open left half plane; None if that cannot be told.
    reason : str
        Why, in words.
    encirclements : float or None
        N, clockwise encirclements of -1 (as in control's `count`).
    open_loop_rhp : float
        P, open-loop poles in the right half plane, before cancellation.
    closed_loop_rhp : float or None
        Z, roots of the characteristic function in the right half plane.
    rightmost : complex
        Root with the largest real part (the one with positive imaginary part of a pair), rad/s.
    roots : array of complex
        Roots, rightmost first: all of them, or with a delay the rightmost ones.
    kind : str
        "rational", "retarded", "neutral" or "advanced".
    """

    name: str
    stable: bool | None
    reason: str
    encirclements: float | None
    open_loop_rhp: float
    closed_loop_rhp: float | None
    rightmost: complex
    kind: str
    roots: ComplexArray = field(repr=False, compare=False)


@dataclass(frozen=True, repr=False)
class Stability:
    """The verdict on an NR-DOB loop; prints its evidence as a table.

    Attributes
    ----------
    stable : bool or None
        Whether the loop is internally stable; None if that cannot be told.
    reason : str
        Why, in words.
    model_loop, observer_loop : LoopStability
        Conditions i (C·Gm) and ii (F·H) of Lemma 1.
    """

    stable: bool | None
    reason: str
    model_loop: LoopStability
    observer_loop: LoopStability

    @property
    def _verdict(self) -> str:
        return {True: "stable", False: "NOT stable", None: "not decided"}[self.stable]

    @property
    def _rows(self) -> list[list[str]]:
        return [
            [
                part.name,
                _count(part.encirclements),
                _count(part.open_loop_rhp),
                _count(part.closed_loop_rhp),
                _complex(part.rightmost),
            ]
            for part in (self.model_loop, self.observer_loop)
        ]

    def __repr__(self) -> str:
        rows = [["", "N", "P", "Z", "rightmost root"], *self._rows]
        table = [f"{name:12}{n:>5}{p:>5}{z:>5}   {root}" for name, n, p, z, root in rows]
        reason = textwrap.wrap(self.reason, 95, subsequent_indent="  ")
        return "\n".join([f"NR-DOB loop: {self._verdict}", *table, *reason])

    def _repr_html_(self) -> str:
        def row(tag: str, cells: Iterable[str]) -> str:
            # Notebook and book style tables differently; the numbers must stand apart in both.
            style = 'style="padding: 0.2em 0.9em; text-align: right"'
            return "<tr>" + "".join(f"<{tag} {style}>{cell}</{tag}>" for cell in cells) + "</tr>"

        head = row("th", ("", "N", "P", "Z", "rightmost root"))
        cells = ([escape(cell).replace("-", "−") for cell in found] for found in self._rows)
        body = "".join(row("td", found) for found in cells)
        return (
            f"<p>NR-DOB loop: <strong>{self._verdict}</strong></p>"
            f"<table><thead>{head}</thead><tbody>{body}</tbody></table>"
            f"<p>{escape(self.reason)}</p>"
        )


def stability(loop: LoopEquations) -> Stability:
    """Judge internal stability by Lemma 1.

    Parameters
    ----------
    loop : LoopEquations
        The four blocks, with or without dead time in the process.

    Returns
    -------
    Stability
        The verdict with its evidence, which prints as a table.
    """
    model_loop = judge("C Gm (i)", loop.CGm.den, loop.p_A, loop.ill_posed_model_loop)
    observer_loop = judge("F H (ii)", loop.FH.den, loop.p_B, loop.ill_posed_observer_loop)
    if observer_loop.reason == AT_ORIGIN:
        observer_loop = replace(
            observer_loop, reason=f"{AT_ORIGIN}, {_root_for_every_filter(loop)}"
        )
    both = (model_loop, observer_loop)
    for verdict in (False, None):
        failing = [f"{part.name}: {part.reason}" for part in both if part.stable is verdict]
        if failing:
            return Stability(verdict, "; ".join(failing), model_loop, observer_loop)
    reason = "p_A and p_B have all roots in the left half plane, by encirclements and by roots"
    return Stability(True, reason, model_loop, observer_loop)


def _root_for_every_filter(loop: LoopEquations) -> str:
    """Explain p_B(0) = N(0) Dm(0) = 0."""
    if loop.Gm.dc_gain == inf:
        return (
            "for every filter: the model has an integrator; give it a slow stable pole instead, or "
            "build (1 - F)·model as one block, without the factor s that cancels in it"
        )
    return "for every filter: the process has a zero there, which no feedback moves"


def judge(
    name: str,
    open_loop: Iterable[QuasiPolynomial],
    closed_loop: QuasiPolynomial,
    ill_posed: str = "",
) -> LoopStability:
    """Judge one characteristic function by its argument and by its roots.

    Parameters
    ----------
    name : str
        What to call the loop.
    open_loop : iterable of QuasiPolynomial
        Factors of the open-loop denominator.
    closed_loop : QuasiPolynomial
        The characteristic function, nothing cancelled.
    ill_posed : str
        Why the loop has no solution at infinite frequency, if it has none.
    """
    factors = tuple(open_loop)
    by_argument = nyquist_count(factors, closed_loop)
    roots, trouble = _roots(closed_loop)
    stable, reason = _verdict(closed_loop, by_argument, roots, trouble, factors)
    if ill_posed:
        stable, reason = None, ill_posed
    return LoopStability(
        name=name,
        stable=stable,
        reason=reason,
        encirclements=by_argument.encirclements,
        open_loop_rhp=by_argument.open_loop_rhp,
        closed_loop_rhp=by_argument.closed_loop_rhp if stable is not None else None,
        rightmost=complex(roots[0]) if roots.size else complex(nan, nan),
        kind=_kind(closed_loop),
        roots=roots,
    )


def _verdict(
    p: QuasiPolynomial,
    by_argument: NyquistCount,
    roots: ComplexArray,
    trouble: str,
    open_loop: tuple[QuasiPolynomial, ...],
) -> tuple[bool | None, str]:
    count = by_argument.closed_loop_rhp
    if count == inf:
        return False, (
            f"{_kind(p)} with |r/q| = {p.neutral_ratio:.4g} at infinite frequency: "
            "infinitely many roots in the right half plane"
        )
    if p.zeros_at_origin:
        return False, AT_ORIGIN
    if count is None:
        return None, by_argument.reason
    if trouble:
        return None, f"the argument gives Z = {count}, but no second opinion: {trouble}"
    unsafe = p.near_axis(roots)
    if unsafe.any():
        return None, f"a root at {_complex(roots[unsafe][0])}, on the axis within rounding"
    if count != (found := int(np.sum(roots.real > 0))):
        return None, f"the argument gives Z = {count}, the roots {found}: no verdict"
    if count == 0:
        return True, "no roots in the right half plane" + (
            f" ({_kind(p)}, |r/q| = {p.neutral_ratio:.4g} at infinity)" if p.neutral_ratio else ""
        )
    plural = "root" if count == 1 else "roots"
    hidden = [z for z in roots[roots.real > 0] if any(_vanishes(f, z) for f in open_loop)]
    return False, f"{count} {plural} in the right half plane" + (
        f", of which s = {_complex(hidden[0])} is an open-loop pole that cancels out of sight"
        if hidden
        else ""
    )


def _roots(p: QuasiPolynomial) -> tuple[ComplexArray, str]:
    if p.neutral_ratio >= 1:
        return np.empty(0, dtype=complex), "a neutral or advanced equation has no rightmost root"
    try:
        return p.roots, ""
    except ArithmeticError as error:
        return np.empty(0, dtype=complex), str(error)


def _vanishes(factor: QuasiPolynomial, s: complex) -> bool:
    """Whether `factor` is zero at `s` within rounding."""
    # The root itself is known to about sqrt(rounding) of a double one at worst.
    return bool(abs(factor(s)) <= 1e-9 * np.polyval(factor.scale, abs(s)))


def _kind(p: QuasiPolynomial) -> str:
    if not p.delay:
        return "rational"
    if p.neutral_ratio == 0:
        return "retarded"
    return "advanced" if p.neutral_ratio == inf else "neutral"


def _count(value: float | None) -> str:
    if value is None:
        return "?"
    return f"{value:g}".replace("inf", "∞")


def _complex(root: complex) -> str:
    if np.isnan(root):
        return "none"
    if root.imag == 0:
        return f"{root.real:.4g}"
    return f"{root.real:.4g} {'-' if root.imag < 0 else '+'} {abs(root.imag):.4g}j"
