"""Lemma 1 on the unit circle, each verdict in two ways.

Condition i is about p_A in the plane of w, where it is the same as in continuous time; condition ii
about p_B. The turn of the argument on the unit circle counts the zeros of p_B that lie outside, and
the eigenvalues of the whole sampled loop, delay line included, count all roots together. Where they
differ there is no verdict. The time for eigenvalues grows with the third power of the samples of
dead time: above `MOST_STATES` they are left out, and the zeros of p_B are counted from where its
two parts are of equal size (`nrdob.digital.delayedpair`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import nan
from typing import Any, ClassVar

import numpy as np

from ..analysis import LoopStability, Stability, judge, rhp_roots
from ..certificates import W
from ..diagram import Fraction, LoopEquations
from ..numerics import ComplexArray, QuasiPolynomial
from .closedloop import ClosedLoop
from .controller import SampledController
from .delayedpair import DelayedPair
from .hold import HeldProcess
from .unitcircle import CircleFunction, count_outside

__all__ = ["SampledStability", "sampled_stability"]

# The ways in which roots are counted:
TURNS, EIGENVALUES = "by the argument on the unit circle", "by eigenvalues"
WHOLE_NUMBERS = "by Routh and Hurwitz's test in whole numbers"
SIZES = "by the crossings of |P| = |Q| in p_B = P + Q/z^N"

MOST_STATES, MOST_ALONE = 300, 1000
"""States up to which a loop has eigenvalues; the latter where there is no other second way."""

CLEARLY = 1e-6  # distance from the circle at which an eigenvalue is on its side, however rounded


@dataclass(frozen=True, repr=False)
class SampledStability(Stability):
    """The verdict on a sampled loop: as in continuous time, with the unit circle for the axis.

    In `model_loop` and `observer_loop` the counts are of roots z outside the unit circle, and
    `rightmost` is the root with the largest modulus, the rightmost of ln(z)/dt.

    Attributes
    ----------
    stable, reason, model_loop, observer_loop, loop : as in `nrdob.analysis.Stability`
    eigenvalues : array of complex
        Of the whole loop from sample to sample, the largest first; none if there are so many that
        they are left out.
    in_w : callable
        Gives the loop in the plane of w, and the fraction by which its model is delayed, if it is.
    """

    eigenvalues: ComplexArray = field(compare=False)
    in_w: Callable[[], tuple[LoopEquations, Fraction | None]] = field(compare=False)

    _title: ClassVar[str] = "Sampled NR-DOB loop"
    _root: ClassVar[str] = "largest root z"

    @property
    def spectral_radius(self) -> float:
        """Modulus of the largest root that has been computed, nan if none has."""
        known = [abs(part.rightmost) for part in (self.model_loop, self.observer_loop)]
        return float(np.fmax.reduce([nan, *np.abs(self.eigenvalues[:1]), *known]))

    def _provable(self, continuous_only: bool) -> tuple[LoopEquations, dict[str, Any]]:
        if continuous_only:
            raise ValueError("of a sampled loop only gains and time constants may be given")
        try:
            loop, model_delay = self.in_w()
        except ValueError as reason:
            raise ArithmeticError(f"no certificate: {reason}") from reason
        return loop, {"variable": W, "model_delay": model_delay}


def sampled_stability(
    loop: LoopEquations,
    blocks: LoopEquations,
    p_B: CircleFunction,
    process: HeldProcess,
    controller: SampledController,
    in_w: Callable[[], tuple[LoopEquations, Fraction | None]],
) -> SampledStability:
    """Judge a sampled loop; `blocks` has model, controller and filter in the plane of w."""
    dt, states = process.dt, process.B.size + process.memory + controller.states
    model_loop, pair = _model_loop(blocks, dt), DelayedPair.of(p_B)
    with_values = states <= (MOST_ALONE if pair is None else MOST_STATES)
    matrix = ClosedLoop(controller, process).A if with_values else np.empty((0, 0))
    values = np.linalg.eigvals(matrix).astype(complex)
    values = values[np.argsort(-np.abs(values), kind="stable")]
    filters = _image(QuasiPolynomial(blocks.fractions.F.den).roots, dt)
    observer_loop = _observer_loop(
        blocks, p_B, _without(values, np.concatenate([model_loop.roots, *[filters] * 3]))
    )
    if pair is not None and not with_values:
        observer_loop = replace(observer_loop, rightmost=pair.largest_root())
    both, found = (model_loop, observer_loop), None
    if None not in (counts := [part.closed_loop_rhp for part in both]):
        found = int(sum(filter(None, counts)))
    second, way = _second_count(values if with_values else None, found, p_B, model_loop, pair)
    ways = tuple(each for each in (TURNS, way) if each)
    stable = None if found is None else found == 0
    reason = f"p_A and p_B have all roots inside the unit circle, {' and '.join(ways)}"
    if found is not None and way and second != found:
        stable, told = None, "nothing" if second is None else second
        reason = f"{TURNS} {found} roots are outside the unit circle, {way} {told}: no verdict"
    largest = np.append(np.abs(values[:1]), np.abs(observer_loop.rightmost))
    if found is None and (
        any(part.stable is False for part in both) or np.any(largest > 1 + CLEARLY)
    ):
        stable = False  # one root on the circle within rounding: others are clearly outside
    if stable is False or found is None:
        failing = [f"{part.name}: {part.reason}" for part in both if part.stable is not True]
        reason = "; ".join(failing)
    if not with_values:
        reason += f"; the eigenvalues of its {states} states are left out"
        reason += "" if way else ", and there is no other second way"
    observer_loop = replace(observer_loop, ways=ways)
    return SampledStability(stable, reason, model_loop, observer_loop, loop, values, in_w)


def _second_count(
    values: ComplexArray | None,
    found: int | None,
    p_B: CircleFunction,
    model_loop: LoopStability,
    pair: DelayedPair | None,
) -> tuple[int | None, str]:
    """Count the roots outside the unit circle again, and say by which way; "" if there is none."""
    if values is not None:
        # With a short dt eigenvalues beside the circle may be on the wrong side; others may not.
        size = np.abs(values)
        count = int(np.sum(size > 1))
        doubtful = np.sum(size > 1 + CLEARLY) <= (found or 0) <= np.sum(size > 1 - CLEARLY)
        other = p_B.polynomial or pair
        if found is None or count == found or not doubtful or other is None:
            return count, EIGENVALUES
    if values is not None and p_B.polynomial is not None:
        of_p_B, way = p_B.polynomial.rhp_in_whole_numbers, WHOLE_NUMBERS
    elif pair is not None:
        of_p_B, way = pair.count(), SIZES
    else:
        return None, ""
    return None if of_p_B is None else of_p_B + int(model_loop.closed_loop_rhp or 0), way


def _model_loop(blocks: LoopEquations, dt: float) -> LoopStability:
    """Condition i in the plane of w, where Tustin's blocks are those of continuous time."""
    found = judge("C Gm (i)", blocks.CGm.den, blocks.p_A, blocks.ill_posed_model_loop)
    roots = _image(found.roots, dt)
    roots = roots[np.argsort(-np.abs(roots), kind="stable")]
    reason = found.reason.replace("in the right half plane", "outside the unit circle")
    reason = reason.replace("at s = 0", "at z = 1")
    return replace(found, reason=reason, rightmost=_largest(roots), roots=roots)


def _observer_loop(
    blocks: LoopEquations, p_B: CircleFunction, roots: ComplexArray
) -> LoopStability:
    P = int(rhp_roots(QuasiPolynomial(blocks.fractions.G.den)) + rhp_roots(blocks.built.Nm))
    counted = count_outside(p_B)
    Z, stable = counted.count, None if counted.count is None else counted.count == 0
    if Z is not None:
        reason = f"{Z or 'no'} {'root' if Z == 1 else 'roots'} outside the unit circle"
    elif counted.angle == 0 and blocks.model_delay and blocks.fractions.Gm.den[-1] == 0:
        stable = False
        reason = "a root at z = 1, the delayed model's integrator: in continuous time it cancels"
    elif counted.angle == 0 and p_B.vanishes_at_one:
        stable, reason = False, "a root at z = 1 exactly, as in continuous time at s = 0"
    else:
        at = "z = 1" if counted.angle == 0 else f"z = exp({counted.angle:.6g}j)"
        reason = f"a root on the unit circle within rounding, at {at}"
    turns = None if Z is None else Z - P
    return LoopStability("F H (ii)", stable, reason, turns, P, Z, _largest(roots), "sampled", roots)


def _image(roots: ComplexArray, dt: float) -> ComplexArray:
    """Map roots w to z."""
    with np.errstate(divide="ignore"):
        return np.asarray((1 + roots * dt / 2) / (1 - roots * dt / 2))


def _without(values: ComplexArray, known: ComplexArray) -> ComplexArray:
    """Take out of the eigenvalues those nearest to what is known, each once."""
    left = values.copy()
    for root in known:
        if left.size:
            left = np.delete(left, np.abs(left - root).argmin())
    return left


def _largest(roots: ComplexArray) -> complex:
    root = complex(roots[0]) if roots.size else complex(nan, nan)
    return root.conjugate() if root.imag < 0 else root
