"""Lemma 1, corrected: stable if and only if all roots of p_A and p_B are in the left half plane.

Each condition is judged twice, before any cancellation but that inside a block that is built as
one: by Z = N + P, and by a count that follows no curve: of the roots themselves or, where not all
can be trusted, of the coefficients (`QuasiPolynomial.rhp_in_whole_numbers`). A verdict is given
only where the two agree; else it is None, with the reason.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from html import escape
from math import inf, nan
from typing import Any, ClassVar

import numpy as np

from ..certificates import Certificate, certify
from ..diagram import LoopEquations, ObserverEquations
from ..numerics import (
    ComplexArray,
    QuasiPolynomial,
    count_rhp,
    follow_together,
    unstable_roots,
    written,
)
from .nyquist import NyquistCount, nyquist_count

__all__ = ["LoopStability", "Stability", "judge", "judge_observer", "stability"]

AT_ORIGIN = "a root at s = 0 exactly"

# The ways in which roots are counted:
ENCIRCLEMENTS = "encirclements"
ROOTS = "roots"
CROSSINGS = "Walton and Marshall's count"
TWO_CROSSINGS = "Walton and Marshall's count and the crossings between the two dead times"
WHOLE_NUMBERS = "Routh and Hurwitz's test in whole numbers"


@dataclass(frozen=True)
class LoopStability:
    """Evidence for one condition of Lemma 1.

    Attributes
    ----------
    name : str
        "C Gm (i)", "F H (ii)", or "L (ii)" in its place where a pole on the axis or right of it
        cancels inside (1-F)Gm.
    stable, reason : bool or None, str
        All roots in the open left half plane, None if that cannot be told; and why.
    encirclements, open_loop_rhp, closed_loop_rhp : float or None
        N, clockwise encirclements of -1; P, open-loop poles in the right half plane, before
        cancellation; Z, roots of the characteristic function in the right half plane.
    rightmost : complex
        Root with the largest real part (of a pair the upper one), rad/s; nan if none is known.
    roots : array of complex
        Rightmost first: all of them, or with a delay the rightmost ones (see
        `nrdob.numerics.quasipoly.QuasiPolynomial.roots`).
    kind : str
        "rational", "retarded", "neutral" or "advanced"; "sampled" for roots z.
    ways : tuple of str
        The two ways in which Z was found; empty where the coefficients alone decide, or nothing
        does.
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
    ways: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Whether the condition holds; ValueError if that cannot be told."""
        return _decided(self.stable, self.reason)


@dataclass(frozen=True, repr=False)
class Stability:
    """The verdict on an NR-DOB loop; prints its evidence as a table.

    Attributes
    ----------
    stable, reason : bool or None, str
        Whether the loop is internally stable, None if that cannot be told; and why.
    model_loop, observer_loop : LoopStability
        Conditions i (C·Gm) and ii (F·H, or L) of Lemma 1.
    loop : LoopEquations
        The loop that was judged.
    """

    stable: bool | None
    reason: str
    model_loop: LoopStability
    observer_loop: LoopStability
    loop: LoopEquations = field(compare=False)

    _title: ClassVar[str] = "NR-DOB loop"
    _root: ClassVar[str] = "rightmost root"

    def __bool__(self) -> bool:
        """Whether the loop is stable; ValueError if that cannot be told."""
        return _decided(self.stable, self.reason)

    def certificate(
        self,
        *,
        gains: tuple[float, float] | None = None,
        delays: tuple[float, float] | None = None,
        time_constants: tuple[float, float] | None = None,
    ) -> Certificate:
        """Prove the counts of roots, for a checker that shares no code with this package.

        Of a sampled loop the blocks are in the plane of w = (2/dt) (z - 1)/(z + 1), the process
        behind its hold, its samples of dead time and those of the model multiplied out: for some
        thirty of them that takes minutes.

        Parameters
        ----------
        gains, delays, time_constants : tuple of two float, optional
            Lowest and highest factor of the process for which it is proved, too, dead time of the
            process (not of sampled loops), and time constant of a `LowPassFilter`, in seconds;
            where it is sampled, by Tustin's rule.

        Raises
        ------
        ValueError, ArithmeticError
            If delays are given for a sampled loop; if there is no certificate.
        """
        loop, given = self._provable(continuous_only=bool(delays))
        counts = self.model_loop.closed_loop_rhp, self.observer_loop.closed_loop_rhp
        return certify(
            loop, counts, gains=gains, delays=delays, time_constants=time_constants, **given
        )

    def _provable(self, continuous_only: bool) -> tuple[LoopEquations, dict[str, Any]]:
        """Give the loop whose roots a certificate counts, and in what; not all can be proved."""
        return self.loop, {}

    @property
    def _verdict(self) -> str:
        return {True: "stable", False: "NOT stable", None: "not decided"}[self.stable]

    @property
    def _rows(self) -> list[list[str]]:
        rows = []
        for part in (self.model_loop, self.observer_loop):
            counts = part.encirclements, part.open_loop_rhp, part.closed_loop_rhp
            rows.append([part.name, *map(_count, counts), _rightmost(part)])
        return rows

    def __repr__(self) -> str:
        rows = [["", "N", "P", "Z", self._root], *self._rows]
        wide = [max(5, 1 + max(len(row[k]) for row in rows)) for k in (1, 2, 3)]
        table = [
            f"{name:12}{n:>{wide[0]}}{p:>{wide[1]}}{z:>{wide[2]}}   {root}"
            for name, n, p, z, root in rows
        ]
        reason = textwrap.wrap(self.reason, 95, subsequent_indent="  ")
        return "\n".join([f"{self._title}: {self._verdict}", *table, *reason])

    def _repr_html_(self) -> str:
        def row(tag: str, cells: Iterable[str]) -> str:
            # Notebook and book style tables differently; the numbers must stand apart in both.
            style = 'style="padding: 0.2em 0.9em; text-align: right"'
            return "<tr>" + "".join(f"<{tag} {style}>{cell}</{tag}>" for cell in cells) + "</tr>"

        def letters(text: str) -> str:
            text = re.sub(r"\bp_([AB])\b", r"<i>p</i><sub>\1</sub>", escape(text))
            return re.sub(r"\bF H\b", "FH", re.sub(r"\bC Gm\b", "CG\N{COMBINING TILDE}", text))

        head = row("th", ("loop", "N", "P", "Z", self._root))
        cells = ([letters(cell).replace("-", "−") for cell in found] for found in self._rows)
        body = "".join(row("td", found) for found in cells)
        return (
            f"<p>{self._title}: <strong>{self._verdict}</strong></p>"
            f"<table><thead>{head}</thead><tbody>{body}</tbody></table>"
            f'<p style="margin-top: .5rem">{letters(self.reason)}</p>'
        )


def stability(loop: LoopEquations) -> Stability:
    """Judge internal stability by Lemma 1.

    Parameters
    ----------
    loop : LoopEquations
        With or without dead time in process and model.
    """
    follow_together([*loop.CGm.den, loop.p_A, *loop.condition_ii.den, loop.p_B])
    model_loop = judge("C Gm (i)", loop.CGm.den, loop.p_A, loop.ill_posed_model_loop)
    observer_loop = observer_stability(loop)
    both = (model_loop, observer_loop)
    for verdict in (False, None):
        failing = [f"{part.name}: {part.reason}" for part in both if part.stable is verdict]
        if failing:
            return Stability(verdict, "; ".join(failing), model_loop, observer_loop, loop)
    first, second = (_written(part.ways) for part in both)
    ways = first if first == second else f"p_A {first}, p_B {second}"
    reason = f"p_A and p_B have all roots in the left half plane, {ways}{_cancelled(loop)}"
    return Stability(True, reason, model_loop, observer_loop, loop)


def judge_observer(
    process: Any, model: Any, filter: Any, *, keep_factors: bool = False
) -> LoopStability:
    """Judge condition ii of Lemma 1, the observer loop, which needs no controller.

    Parameters
    ----------
    process, model, filter, keep_factors : as for `nrdob.NRDOB`
        G, G̃ and F, and whether 1 - F, the model and its inverse are blocks of their own.

    Returns
    -------
    LoopStability
        The verdict on p_B with its evidence.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put; the message names the block and the remedy.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import LowPassFilter
    >>> judge_observer(ct.tf([2], [1, 1]), ct.tf([1], [1, 1]), LowPassFilter(0.5, 1)).stable
    True
    """
    return observer_stability(ObserverEquations(process, model, filter, keep_factors))


def observer_stability(loop: LoopEquations) -> LoopStability:
    """Judge condition ii of Lemma 1 for equations that are already there."""
    counted = loop.condition_ii
    name = {"FH": "F H (ii)", "L": "L (ii)"}[counted.name]
    found = judge(name, counted.den, loop.p_B, loop.ill_posed_observer_loop)
    reason = found.reason
    if reason == AT_ORIGIN:
        reason = f"{AT_ORIGIN}, {_held_at_origin(loop)}"
    return replace(found, reason=reason + _cancelled(loop))


def _held_at_origin(loop: LoopEquations) -> str:
    """Explain p_B(0) = D(0) Nm(0) E(0) + N(0) Dm(0) = 0."""
    integrators, kept = -loop.Gm.zeros_at_origin, loop.built.Dm.zeros_at_origin
    lag = " exp(-θm s)" if loop.model_delay else ""
    if kept and loop.keep_factors:
        return (
            "for every filter: the model has an integrator; give it a slow stable pole instead, or "
            f"build (1 - F{lag})·model as one block (keep_factors=False), without what cancels "
            "in it"
        )
    if kept:
        return (
            f"the model has {integrators} integrators, of which (1 - F{lag})·model keeps {kept}: "
            f"take a filter with 1 - F{lag} ~ s^{integrators}, such as "
            "nrdob.interpolating_filter(model, time_constant)"
        )
    if integrators > 0:
        return (
            "the process has a zero there, which an observer with integral action does not move: "
            "take a filter for which 1 - F has no more zeros at s = 0 than the model has poles"
        )
    return "for every filter: the process has a zero there, which no feedback moves"


def _cancelled(loop: LoopEquations) -> str:
    """Name, after a reason, what has cancelled inside a block, and what rests on rounding."""
    notes = []
    delayed = loop.model_delay > 0
    prediction = "(1-F exp(-θm s))Gm0" if delayed else "(1-F)Gm"
    for common, block in ((loop.built.zeros, "F/Gm"), (loop.built.poles, prediction)):
        if common.degree:
            note = f"{_named(common.roots)} inside {block}"
            if delayed and block == prediction:
                note += ", which takes a memory of length θm, not a difference of two integrators"
            if (fragile := unstable_roots(common)).size:
                note += f", {_named(fragile)} to rounding only: build {block} as one"
            notes.append(f"; {note}")
    return "".join(notes)


def _named(roots: ComplexArray) -> str:
    """Say which roots cancel, each once and of a pair one."""
    upper = roots[roots.imag >= 0].tolist()
    named = list(dict.fromkeys(written(root).replace("+", "±") for root in upper))
    return f"s = {', '.join(named)} {'cancels' if len(named) == 1 else 'cancel'}"


def judge(
    name: str,
    open_loop: Iterable[QuasiPolynomial],
    closed_loop: QuasiPolynomial,
    ill_posed: str = "",
) -> LoopStability:
    """Judge one characteristic function by the turns of the curve and by a second count.

    Parameters
    ----------
    name : str
        Of the loop.
    open_loop : iterable of QuasiPolynomial
        Factors of the open-loop denominator.
    closed_loop : QuasiPolynomial
        The characteristic function, nothing cancelled.
    ill_posed : str
        Why the loop has no solution at infinite frequency, if it has none.
    """
    factors = tuple(open_loop)
    counted = nyquist_count(factors, closed_loop)
    roots = closed_loop.roots if closed_loop.neutral_ratio < 1 else np.empty(0, dtype=complex)
    stable, reason, ways = _judged(closed_loop, counted, roots, factors, ill_posed)
    return LoopStability(
        name=name,
        stable=stable,
        reason=reason,
        encirclements=counted.encirclements,
        open_loop_rhp=counted.open_loop_rhp,
        closed_loop_rhp=None if stable is None else counted.closed_loop_rhp,
        rightmost=complex(roots[0]) if roots.size else complex(nan, nan),
        kind=_kind(closed_loop),
        roots=roots,
        ways=ways,
    )


def _judged(
    p: QuasiPolynomial,
    counted: NyquistCount,
    roots: ComplexArray,
    open_loop: tuple[QuasiPolynomial, ...],
    ill_posed: str,
) -> tuple[bool | None, str, tuple[str, ...]]:
    """Whether all roots are in the left half plane, why, and by which ways Z was found."""
    count, ratio = counted.closed_loop_rhp, f"|r/q| = {p.neutral_ratio:.4g}"
    if ill_posed:
        return None, ill_posed, ()
    if count == inf:
        where = f"{_kind(p)} with {ratio} at infinite frequency"
        return False, f"{where}: infinitely many roots in the right half plane", ()
    if p.zeros_at_origin:
        return False, AT_ORIGIN, ()
    if count is None:  # beside a root on the axis within rounding others may be clearly right of it
        by_encirclements = count_rhp(p).at_least
        by_roots = int(np.sum((roots.real > 0) & ~p.near_axis(roots)))
        if not (by_encirclements and by_roots):
            return None, counted.reason, ()
        reason = f"{_in_right_half_plane(by_encirclements)}, and {counted.reason}"
        return False, reason, (ENCIRCLEMENTS, ROOTS)
    second, way = _second_count(p, count, roots)
    if count != second:
        return None, f"the encirclements give Z = {count}, {way} {second}: no verdict", ()
    ways = (ENCIRCLEMENTS, way)
    told = "" if way == ROOTS else f", {_written(ways)}"
    if count == 0:
        neutral = f" ({_kind(p)}, {ratio} at infinity)" if p.neutral_ratio else ""
        return True, f"no roots in the right half plane{neutral}{told}", ways
    right = roots[roots.real > 0]
    # A root itself is known to about sqrt(rounding) of a double one at worst.
    hidden = [np.abs(factor(right)) <= 1e-9 * factor.size(right) for factor in open_loop]
    if np.any(hidden):
        pole = written(right[np.any(hidden, axis=0)][0])
        told = f", of which s = {pole} is an open-loop pole that cancels out of sight{told}"
    return False, _in_right_half_plane(count) + told, ways


def _second_count(
    p: QuasiPolynomial, expected: float, roots: ComplexArray
) -> tuple[int | None, str]:
    """Count without the argument, and say by which way."""
    # Roots are the cheaper way; where they differ they may be too badly conditioned.
    if p.neutral_ratio < 1 and p.roots_resolved and not p.near_axis(roots).any():
        found = int(np.sum(roots.real > 0))
        if found == expected:
            return found, ROOTS
    finite = p.finite_part
    way = TWO_CROSSINGS if finite.more else CROSSINGS if finite.delay else WHOLE_NUMBERS
    return p.rhp_in_whole_numbers, way


def _in_right_half_plane(count: float) -> str:
    return f"{count:g} {'root' if count == 1 else 'roots'} in the right half plane"


def _written(ways: tuple[str, ...]) -> str:
    return " and ".join(f"by {way}" for way in ways)


def _decided(stable: bool | None, reason: str) -> bool:
    if stable is None:
        raise ValueError(
            f"neither stable nor unstable can be told: {reason}; ask for .stable, which is None"
        )
    return stable


def _kind(p: QuasiPolynomial) -> str:
    if not p.delay:
        return "rational"
    if p.neutral_ratio == 0:
        return "retarded"
    return "advanced" if p.neutral_ratio == inf else "neutral"


def _count(value: float | None) -> str:
    return "?" if value is None else f"{value:g}".replace("inf", "∞")


def _rightmost(part: LoopStability) -> str:
    if not np.isnan(part.rightmost):
        return written(part.rightmost)
    countless = part.kind in ("retarded", "neutral", "sampled") and part.closed_loop_rhp != inf
    return "not computed" if countless else "none"
