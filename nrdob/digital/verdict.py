"""Lemma 1 on the unit circle, each verdict in two ways.

Condition i is about p_A in the plane of w, where it is what it was in continuous time; condition ii
about p_B. The turn of the argument on the unit circle counts how many zeros of p_B lie outside, and
the eigenvalues of the whole sampled loop, delay line and all, say how many there are together.
Where they differ nothing is decided. The time for eigenvalues grows with the third power of the
samples of dead time: above `MOST_STATES` they are left out, and the zeros of p_B are counted from
where its two parts are of equal size (`nrdob.digital.circlesizes`).
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass, field, replace
from math import nan

import numpy as np

from ..analysis import judge, rhp_roots
from ..diagram import LoopEquations
from ..numerics import ComplexArray, FloatArray, QuasiPolynomial, written
from .circle import CircleFunction, count_outside
from .circlesizes import DelayedPair
from .controller import SampledController
from .hold import HeldProcess

__all__ = ["SampledCondition", "SampledStability", "lifted", "sampled_stability"]

TURNS, EIGENVALUES = "by turns on the unit circle", "by eigenvalues"
WHOLE_NUMBERS = "by Routh and Hurwitz's test in whole numbers"
SIZES = "by the crossings of |P| = |Q| in p_B = P + Q/z^N"
"""The ways in which roots are counted."""

MOST_STATES, MOST_ALONE = 300, 1000
"""States of a loop up to which it has eigenvalues; the latter where there is no other second way.
"""

CLEARLY = 1e-6
"""Distance from the unit circle at which an eigenvalue is on its side, whatever the rounding."""


@dataclass(frozen=True)
class SampledCondition:
    """Evidence for one condition of Lemma 1 on the unit circle.

    Attributes
    ----------
    name : str
        Which loop: "C Gm (i)" or "F H (ii)".
    stable : bool or None
        All roots inside the unit circle; None if that cannot be told.
    reason : str
        Why, in words.
    encirclements : int or None
        N, clockwise encirclements of -1.
    open_loop_outside : int
        P, open-loop poles outside the unit circle, before cancellation.
    closed_loop_outside : int or None
        Z, roots of the characteristic function outside the unit circle.
    largest : complex
        Root z with the largest modulus, nan if there is none.
    roots : array of complex
        Roots z, the largest first; none where the eigenvalues are left out.
    """

    name: str
    stable: bool | None
    reason: str
    encirclements: int | None
    open_loop_outside: int
    closed_loop_outside: int | None
    largest: complex
    roots: ComplexArray = field(repr=False, compare=False)

    def __bool__(self) -> bool:
        """Whether the condition holds; ValueError if that cannot be told."""
        return _known(self.stable, self.reason)


@dataclass(frozen=True, repr=False)
class SampledStability:
    """The verdict on a sampled loop; prints its evidence as a table.

    Attributes
    ----------
    stable : bool or None
        Whether the sampled loop is internally stable; None if that cannot be told.
    reason : str
        Why, in words.
    model_loop, observer_loop : SampledCondition
        Conditions i (C·Gm) and ii (F·H) of Lemma 1.
    eigenvalues : array of complex
        Of the whole loop from sample to sample, the largest first; none if there are so many that
        they are left out.
    ways : tuple of str
        How the roots have been counted; only one where there is no second way.
    """

    stable: bool | None
    reason: str
    model_loop: SampledCondition
    observer_loop: SampledCondition
    eigenvalues: ComplexArray
    ways: tuple[str, ...]

    @property
    def spectral_radius(self) -> float:
        """Modulus of the largest root that has been computed, nan if none has."""
        known = [abs(part.largest) for part in (self.model_loop, self.observer_loop)]
        return max([*np.abs(self.eigenvalues[:1]).tolist(), *known], default=nan)

    def __bool__(self) -> bool:
        """Whether the loop is stable; ValueError if that cannot be told."""
        return _known(self.stable, self.reason)

    def __repr__(self) -> str:
        verdict = {True: "stable", False: "NOT stable", None: "not decided"}[self.stable]
        lines = [f"Sampled NR-DOB loop: {verdict}", f"{'':12}    N    P    Z   largest root z"]
        for part in (self.model_loop, self.observer_loop):
            counts = part.encirclements, part.open_loop_outside, part.closed_loop_outside
            told = "".join(f"{'?' if count is None else count:>5}" for count in counts)
            root = "none" if np.isnan(part.largest) else written(part.largest)
            lines.append(f"{part.name:12}{told}   {root}")
        return "\n".join([*lines, *textwrap.wrap(self.reason, 95, subsequent_indent="  ")])


def sampled_stability(
    blocks: LoopEquations,
    p_B: CircleFunction,
    process: HeldProcess,
    controller: SampledController,
    alpha: float,
) -> SampledStability:
    """Judge a sampled loop.

    Parameters
    ----------
    blocks : LoopEquations
        Model, controller and filter in the plane of w.
    p_B : CircleFunction
        Characteristic function of the observer loop.
    process : HeldProcess
        The process behind its hold.
    controller : SampledController
        The difference equations.
    alpha : float
        α in seconds.
    """
    model_loop = _model_loop(blocks, alpha)
    pair = DelayedPair.of(p_B)
    states = process.B.size + process.memory + controller.states
    values = np.empty(0, dtype=complex)
    with_values = states <= (MOST_ALONE if pair is None else MOST_STATES)
    if with_values:
        values = np.linalg.eigvals(lifted(process, controller)).astype(complex)
        values = values[np.argsort(-np.abs(values), kind="stable")]
    filters = _image(QuasiPolynomial(blocks.fractions.F.den).roots, alpha)
    others = np.concatenate([model_loop.roots, *[filters] * 3])
    observer_loop = _observer_loop(blocks, p_B, _without(values, others))
    if pair is not None and not with_values:
        observer_loop = replace(observer_loop, largest=pair.largest_root())
    both = (model_loop, observer_loop)
    found = None
    if model_loop.closed_loop_outside is not None and observer_loop.closed_loop_outside is not None:
        found = model_loop.closed_loop_outside + observer_loop.closed_loop_outside
    by_values = _by_eigenvalues(values, found, p_B, model_loop, pair) if with_values else None
    second, way = by_values or _by_sizes(model_loop, pair)
    ways = tuple(each for each in (TURNS, way) if each)
    stable, reason = _compared(found, second, ways)
    largest = np.append(np.abs(values[:1]), np.abs(observer_loop.largest))
    if found is None and (
        any(part.stable is False for part in both) or np.any(largest > 1 + CLEARLY)
    ):
        stable = False  # one root on the circle within rounding: others are clearly outside
    if not stable:
        failing = [f"{part.name}: {part.reason}" for part in both if part.stable is not True]
        reason = "; ".join(failing) if stable is False or found is None else reason
    if not with_values:
        reason += f"; the eigenvalues of its {states} states are left out"
        reason += "" if way else ", and there is no other second way"
    return SampledStability(stable, reason, model_loop, observer_loop, values, ways)


def _by_eigenvalues(
    values: ComplexArray,
    found: int | None,
    p_B: CircleFunction,
    model_loop: SampledCondition,
    pair: DelayedPair | None,
) -> tuple[int | None, str]:
    """Count eigenvalues outside the circle; in another way if they are too close to it."""
    # With a short dt eigenvalues beside the circle may be on the wrong side; others may not.
    size = np.abs(values)
    count = int(np.sum(size > 1))
    doubtful = np.sum(size > 1 + CLEARLY) <= (found or 0) <= np.sum(size > 1 - CLEARLY)
    if found is None or count == found or not doubtful:
        return count, EIGENVALUES
    if (polynomial := p_B.polynomial) is not None:
        exact = polynomial.rhp_in_whole_numbers
        more = model_loop.closed_loop_outside or 0
        return None if exact is None else exact + more, WHOLE_NUMBERS
    return _by_sizes(model_loop, pair) if pair else (count, EIGENVALUES)


def _by_sizes(model_loop: SampledCondition, pair: DelayedPair | None) -> tuple[int | None, str]:
    if pair is None:
        return None, ""
    count = pair.count()
    return None if count is None else count + (model_loop.closed_loop_outside or 0), SIZES


def _compared(
    found: int | None, second: int | None, ways: tuple[str, ...]
) -> tuple[bool | None, str]:
    """Compare what the turns have found with the second count, if there is one."""
    if found is None:
        return None, ""
    if len(ways) > 1 and second != found:
        told = "nothing" if second is None else f"{second}"
        turns, other = ways
        return (
            None,
            f"{turns} {found} roots are outside the unit circle, {other} {told}: no verdict",
        )
    return found == 0, f"p_A and p_B have all roots inside the unit circle, {' and '.join(ways)}"


def _model_loop(blocks: LoopEquations, alpha: float) -> SampledCondition:
    """Condition i in the plane of w, where Tustin's blocks are those of continuous time."""
    found = judge("C Gm (i)", blocks.CGm.den, blocks.p_A, blocks.ill_posed_model_loop)
    roots = _image(found.roots, alpha)
    roots = roots[np.argsort(-np.abs(roots), kind="stable")]
    counts = (
        None if count is None else int(count)
        for count in (found.encirclements, found.closed_loop_rhp)
    )
    turns, outside = counts
    reason = _on_circle(found.reason)
    P = int(found.open_loop_rhp)
    return SampledCondition(
        "C Gm (i)", found.stable, reason, turns, P, outside, _largest(roots), roots
    )


def _observer_loop(
    blocks: LoopEquations, p_B: CircleFunction, roots: ComplexArray
) -> SampledCondition:
    G, built = QuasiPolynomial(blocks.fractions.G.den), blocks.built
    P = int(rhp_roots(G) + rhp_roots(built.Nm))
    counted = count_outside(p_B)
    Z = counted.count
    if Z is None:
        at = "z = 1" if counted.angle == 0 else f"z = exp({counted.angle:.6g}j)"
        stable, reason = None, f"a root on the unit circle within rounding, at {at}"
        if counted.angle == 0 and p_B.vanishes_at_one:
            stable, reason = False, "a root at z = 1 exactly, as in continuous time at s = 0"
    else:
        stable = Z == 0
        reason = f"{_many(Z)} outside the unit circle"
    turns = None if Z is None else Z - P
    return SampledCondition("F H (ii)", stable, reason, turns, P, Z, _largest(roots), roots)


def lifted(process: HeldProcess, controller: SampledController) -> FloatArray:
    """Matrix of the whole loop from sample to sample: process, past inputs, controller.

    Parameters
    ----------
    process : HeldProcess
        The process behind its hold, with n states and m past inputs, youngest first.
    controller : SampledController
        The difference equations, with k states.

    Returns
    -------
    array of float, shape (n + m + k, n + m + k)
        States of the process, past inputs, states of the controller.
    """
    n, m = process.B.size, process.memory
    size = n + m + controller.states
    every = np.eye(size)
    y = np.zeros(size)
    y[:n] = process.C
    u = np.zeros(size)
    if process.D:
        y += process.D * every[n + process.samples]
    u[n + m :] = controller.C
    u += controller.D[1] * y
    inputs = [u, *every[n : n + m]]
    whole = np.zeros((size, size))
    whole[:n, :n] = process.Ad
    whole[:n] += np.outer(process.B0, inputs[process.samples])
    if process.fraction:
        whole[:n] += np.outer(process.B1, inputs[process.samples + 1])
    for k in range(m):
        whole[n + k] = inputs[k]
    whole[n + m :, n + m :] = controller.A
    whole[n + m :] += np.outer(controller.B[:, 1], y) + np.outer(controller.B[:, 2], u)
    return whole


def _image(roots: ComplexArray, alpha: float) -> ComplexArray:
    """Where roots w are in the plane of z."""
    with np.errstate(divide="ignore"):
        return np.asarray((1 + alpha * roots) / (1 - alpha * roots))


def _without(values: ComplexArray, known: ComplexArray) -> ComplexArray:
    """Take out of the eigenvalues those nearest to what is known, each once."""
    left = values.copy()
    for root in known:
        if left.size:
            left = np.delete(left, np.abs(left - root).argmin())
    return left


def _largest(roots: ComplexArray) -> complex:
    if not roots.size:
        return complex(nan, nan)
    root = complex(roots[0])
    return root.conjugate() if root.imag < 0 else root


def _on_circle(reason: str) -> str:
    return reason.replace("in the right half plane", "outside the unit circle").replace(
        "at s = 0", "at z = 1"
    )


def _many(count: int) -> str:
    return f"{count or 'no'} {'root' if count == 1 else 'roots'}"


def _known(stable: bool | None, reason: str) -> bool:
    if stable is None:
        raise ValueError(f"stability is not decided: {reason}")
    return stable
