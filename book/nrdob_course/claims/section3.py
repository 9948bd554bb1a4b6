"""Section III: stability and robustness, Lemmas 1 and 2, Corollary 1."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

from nrdob.analysis import Margins, encirclements
from nrdob.design import gain_bound
from nrdob.diagram import Fraction, LowPassFilter, Quotient
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray, FloatArray, number
from nrdob.paper import EXAMPLES, example
from nrdob.plants import resonance
from nrdob.sampling import random_block, random_loop

from .ledger import Amendment, Finding, Section, Verdict
from .recurring import enter_map
from .signals import (
    EXACT,
    PRINTED_MAPS,
    QUADRUPLES,
    TOLERANCE,
    Values,
    blocks_of,
    equations,
    every,
    fraction,
    loop_modes,
    many_loops,
    modes,
    numbers,
    printed_map,
    random_blocks,
    random_points,
    same,
    solve,
    turns,
)

__all__ = ["SECTION"]

SECTION = Section()

_s = ct.tf("s")


def observer(ratio: Any, model: Any, time_constant: float, order: int) -> NRDOB:
    """Give a loop by its ratio G/Gm; the controller does not matter."""
    return NRDOB(ratio * model, model, 0.0, LowPassFilter(time_constant, order))


def rightmost(loop: NRDOB) -> float:
    """Largest real part of the roots of p_B, for a loop without dead time."""
    return float(np.roots(loop.p_B.q).real.max())


def in_right_half(coefficients: FloatArray) -> int:
    """Roots of a polynomial with positive real part."""
    return int(np.sum(np.roots(coefficients).real > 0))


def critical_gain(order: int) -> float:
    """M_n, the gain factor at which F/(1 − F) is lost, by the roots of (s + 1)^n − 1 + k."""

    def rightmost_root(gain: float) -> float:
        coefficients = np.poly(-np.ones(order))
        coefficients[-1] += gain - 1
        return float(np.roots(coefficients).real.max())

    return inf if rightmost_root(1e3) < 0 else float(brentq(rightmost_root, 1.0, 1e3))


# Eq. (7).


@SECTION.claim(
    "eq07.E_R",
    "eq. (7)",
    r"$\dfrac{E}{R}=\dfrac{F(G-\tilde G)+\tilde G}{(1+\tilde G C)\,[\tilde G+F(G-\tilde G)]}$.",
    "02_why_two_conditions",
)
def reference_to_error() -> Finding:
    """Solve the diagram with R alone at random values; compare e with the printed formula.

    The formula is compared with 1/(1 + C Gm), too.
    """
    finding = printed_map("E_R")
    blocks = random_blocks(np.random.default_rng(7))
    collapses = same(PRINTED_MAPS["E_R"](blocks), 1 / (1 + blocks.CGm))
    return replace(
        finding,
        as_printed=finding.as_printed and collapses,
        computed=f"{finding.computed}; both are "
        f"{'' if collapses else 'not '}1/(1 + C Gm), free of F and of the process",
    )


@SECTION.claim(
    "eq07.E_zero",
    "eq. (7)",
    r"$E/\delta=0$, $E/d=0$ and $E/\eta=0$.",
    "02_why_two_conditions",
)
def the_error_sees_no_disturbance() -> Finding:
    """Solve the diagram with δ, d and η at random values; compare e with the other signals."""
    blocks = random_blocks(np.random.default_rng(7))
    sizes = []
    for found in (solve(blocks, delta=1.0), solve(blocks, d=1.0), solve(blocks, eta=1.0)):
        sizes.append(np.abs(found.e) / (np.abs(found.u) + np.abs(found.y)))
    zero = np.array(sizes) < EXACT
    return Finding(
        every(zero.ravel()),
        f"e is 0 against u and y in {zero.sum()} of {zero.size} random solutions of the diagram",
        TOLERANCE,
    )


enter_map(
    SECTION,
    "eq07.U_R",
    r"$\dfrac{U}{R}=\dfrac{\tilde G C}{(1+\tilde G C)\,[\tilde G+F(G-\tilde G)]}$.",
    "02_why_two_conditions",
    ("R", "u"),
)


@SECTION.claim(
    "eq07.U_d",
    "eq. (7)",
    r"$\dfrac{U}{d}=\dfrac{U}{\eta}=\dfrac{-F}{\tilde G+F(G-\tilde G)}$.",
    "02_why_two_conditions",
)
def output_disturbance_to_control() -> Finding:
    """Solve the diagram with d alone, then η alone; compare u with the printed formula."""
    by_d, by_eta = printed_map("U_d"), printed_map("U_eta")
    return replace(
        by_d,
        as_printed=by_d.as_printed and by_eta.as_printed,
        computed=f"d: {by_d.computed}; η: {by_eta.computed}",
    )


@SECTION.claim(
    "eq07.U_delta",
    "eq. (7)",
    r"$\dfrac{U}{\delta}=\dfrac{\tilde G(1-F)}{\tilde G+F(G-\tilde G)}$.",
    "02_why_two_conditions",
    amendment=Amendment(
        Verdict.CORRECTED,
        r"This is the plant input, $(U+\delta)/\delta$. The controller output, which $U$ is in "
        r"every other map of eq. (7), has $\dfrac{U}{\delta}=\dfrac{-FG}{\tilde G+F(G-\tilde G)}$; "
        "the two differ by 1.",
    ),
)
def input_disturbance_to_control() -> Finding:
    """Solve the diagram with δ alone at random values; compare u and u + δ with the formulas."""
    blocks = random_blocks(np.random.default_rng(7))
    u = solve(blocks, delta=1.0).u
    printed = PRINTED_MAPS["U_delta"](blocks)
    agree = np.isclose(printed, u, rtol=EXACT, atol=0)
    plant_input = np.isclose(printed, u + 1, rtol=EXACT, atol=0)
    return Finding(
        every(agree),
        f"the printed formula is u in {agree.sum()} and u + δ in {plant_input.sum()} of "
        f"{QUADRUPLES} random solutions of the diagram",
        TOLERANCE,
        conditions={
            "the printed formula is (U + δ)/δ": every(plant_input),
            "it is so in the package, too": printed_map("U_delta").as_printed,
            "U/δ = −FG/(Gm + F(G − Gm))": same(u, -blocks.F * blocks.G / blocks.B),
        },
    )


# Lemma 1.


@SECTION.claim(
    "lemma1.polynomials",
    "Lemma 1",
    r"$\Lambda$, $A=1+\tilde G C$ and $B$ are polynomials.",
    "04_what_exactly_is_lemma_1",
    amendment=Amendment(
        Verdict.CORRECTED,
        r"They are rational functions. The polynomials are $p_A=D_mD_c+N_mN_c$ and "
        r"$p_B=DN_m(D_f-N_f)+ND_mN_fe^{-\theta s}$ (with dead time, a quasi-polynomial), where "
        r"$A=p_A/(D_mD_c)$ and $1+FH=p_B/(DN_mD_f)$. With every block realised by itself the "
        r"modes of the loop are the roots of $D_f^3\,p_A\,p_B$.",
    ),
)
def rational_functions_not_polynomials() -> Finding:
    """Follow A, and B in its first form, from s = 3 to 10⁹: a polynomial is constant or grows.

    Diagram, p_A and p_B are compared at random points; the eigenvalues of a state space of the
    whole diagram with the roots of the product, as polynomials.
    """
    loops = many_loops()
    near, far = np.array([3.0 + 0j]), np.array([1e9 + 0j])
    grows, starts, ends = [], [], []
    for loop in loops:
        here, there = blocks_of(loop, near), blocks_of(loop, far)
        a, a_far = abs(1 + here.CGm[0]), abs(1 + there.CGm[0])
        b, b_far = abs(here.B[0]), abs(there.B[0])
        grows += [same(a, a_far) or a_far > 1e6 * a, same(b, b_far) or b_far > 1e6 * b]
        starts.append(a)
        ends.append(a_far)
    return Finding(
        every(grows),
        f"Examples 1 to 4: from s = 3 to 10⁹ the size of A goes from {numbers(starts[:4])} to "
        f"{numbers(np.round(ends[:4], 6))}; {sum(grows)} of {len(grows)} functions A and B of "
        f"{len(loops)} loops are constant or grow, as a polynomial must",
        conditions={
            "A = p_A/(Dm Dc), 1 + FH = p_B/(D Nm Df), and the diagram has their product": every(
                _factors(loop) for loop in loops
            ),
            "the modes are the roots of Df³ p_A p_B": every(
                _modes_are_the_roots(loop) for loop in loops if not loop.delay
            ),
        },
    )


def _value(factors: Iterable[Any], s: ComplexArray) -> ComplexArray:
    return np.asarray(np.prod([factor(s) for factor in factors], axis=0))


def _factors(loop: NRDOB) -> bool:
    """Whether p_A and p_B are what the diagram gives, times the denominators."""
    s = random_points(np.random.default_rng(7))
    blocks = blocks_of(loop, s)
    A, B = loop.p_A(s) / _value(loop.CGm.den, s), loop.p_B(s) / _value(loop.FH.den, s)
    return (
        same(A, 1 + blocks.CGm)
        and same(B, 1 + blocks.FH)
        and same(np.linalg.det(equations(blocks)), A * B)
    )


def _modes_are_the_roots(loop: NRDOB) -> bool:
    """Whether the modes of the whole diagram are the roots of Df³ p_A p_B."""
    s = random_points(np.random.default_rng(7))
    by_modes = np.prod(s[:, None] - loop_modes(loop), axis=1)
    by_roots = _value([*loop.F.den] * 3 + [loop.p_A, loop.p_B], s)
    return same(by_modes / by_modes[0], by_roots / by_roots[0], rtol=1e-6)


@SECTION.claim(
    "lemma1.forms",
    "Lemma 1, condition ii",
    r"The conditions on $\tilde G+F(G-\tilde G)$, on $1+F(G/\tilde G-1)$ and on $1+FH$ are the "
    "same.",
    "04_what_exactly_is_lemma_1",
    amendment=Amendment(
        Verdict.CONDITION,
        r"The first form is $\tilde G$ times the other two, which are equal. Before cancellation "
        r"all three have the numerator $p_B$; their zeros agree as long as $p_B$ shares none with "
        r"$\tilde G$. If plant and model share a zero in the right half plane, the first form has "
        "it and the others do not.",
    ),
)
def three_forms_of_b() -> Finding:
    """Compare the forms at random values, at the roots of p_B, and for G = Gm = (1 − s)/(s + 2)."""
    blocks = random_blocks(np.random.default_rng(7))
    second = 1 + blocks.F * (blocks.G / blocks.Gm - 1)
    loops = [loop for loop in many_loops() if not loop.delay]
    vanish = [_vanishes_at_roots(loop) for loop in loops if not _shares(loop)]
    G = (1 - _s) / (_s + 2)
    shared = NRDOB(G, G, 0.1, LowPassFilter(0.1, 1))
    at = blocks_of(shared, np.array([1.0 + 1e-9j]))  # at 1 itself G/Gm is 0/0
    first, third = np.round([abs(at.B[0]), abs(1 + at.FH[0])], 8)
    root = rightmost(shared)
    return Finding(
        (first < EXACT) == (third < EXACT),
        f"G = Gm = (1 − s)/(s + 2): at s = 1 the first form is {number(first, 4)}, the third "
        f"{number(third, 4)}, and p_B has the root {number(root, 4)}; in {sum(vanish)} of "
        f"{len(vanish)} loops that share nothing all forms vanish at every root of p_B",
        conditions={
            "the first form is Gm times the second": same(blocks.B, blocks.Gm * second),
            "the second form is the third": same(second, 1 + blocks.FH),
            "all vanish at the roots of p_B that Gm does not share": every(vanish),
            "a zero that plant and model share is a root of p_B": same(root, 1.0),
        },
    )


def _shares(loop: NRDOB) -> bool:
    """Whether p_B has a root in common with the model."""
    roots = np.concatenate([loop.Gm.numerator.roots, loop.Gm.denominator.roots])
    return bool((np.abs(np.subtract.outer(loop.p_B.roots, roots)) < 1e-6).any())


def _vanishes_at_roots(loop: NRDOB) -> bool:
    """Whether the first and the third form of B are 0 at the roots of p_B, against their terms."""
    blocks = blocks_of(loop, loop.p_B.roots)
    first = np.abs(blocks.B) / (np.abs(blocks.Gm) + np.abs(blocks.F * (blocks.G - blocks.Gm)))
    third = np.abs(1 + blocks.FH) / (1 + np.abs(blocks.FH))
    return every(np.concatenate([first, third]) < 1e-5)


@SECTION.claim(
    "lemma1.H_forms",
    "Lemma 1",
    r"$H=\dfrac{G}{\tilde G}-1=-\left(1-\dfrac{G}{\tilde G}\right)=\dfrac{G-\tilde G}{\tilde G}$.",
    "04_what_exactly_is_lemma_1",
)
def three_forms_of_h() -> Finding:
    """Compare the three at random values of the blocks, and on loops with the package's H."""
    rng = np.random.default_rng(7)
    loops = many_loops()
    blocks = random_blocks(rng)
    agree = []
    for loop in loops:
        s = random_points(rng)
        agree.append(_h_forms_agree(blocks_of(loop, s), loop.H(s)))
    return Finding(
        _h_forms_agree(blocks, blocks.H) and every(agree),
        f"the three forms agree for {QUADRUPLES} random values of the blocks and, with the "
        f"package's H, for {sum(agree)} of {len(loops)} loops",
        TOLERANCE,
    )


def _h_forms_agree(blocks: Values, H: ComplexArray) -> bool:
    """Whether the three forms give H; the difference is compared with their terms."""
    ratio = blocks.G / blocks.Gm
    forms = np.array([ratio - 1, -(1 - ratio), (blocks.G - blocks.Gm) / blocks.Gm])
    return every((np.abs(forms - H) <= EXACT * (1 + np.abs(ratio))).ravel())


@SECTION.claim(
    "lemma1.sufficient",
    "Lemma 1",
    r"The loop is globally and internally stable if $C$ stabilises $\tilde G$ ($A$ has no zeros in "
    r"the closed right half plane) and $F$ stabilises $B$ (nor has $B$).",
    "04_what_exactly_is_lemma_1",
    amendment=Amendment(
        Verdict.CONDITION,
        r"It is if, and only if, the polynomials $p_A$ and $p_B$ have all roots in the open left "
        r"half plane, before anything is cancelled; $F$ is stable, $F$ and $F\tilde G^{-1}$ are "
        r"causal, and the loop is well posed ($1+C\tilde G$ and $1+FH$ are not 0 at infinity). "
        r"Zeros of the rational $A$ and $B$ do not show what has cancelled.",
    ),
)
def what_lemma_1_does_not_see() -> Finding:
    """Compare zeros of A and B after cancellation with the modes of the whole diagram, twice.

    On 60 random loops the modes and the roots of p_A and p_B must give the same verdict. The modes
    are eigenvalues of a state space in which every block is realised by itself. An unstable F
    under which p_B is Hurwitz must have an unstable mode, and Example 2 with n = 1, λ = 0.01 s
    be ill-posed.
    """
    unstable = 4 / (2 - _s - _s**2)
    in_b = NRDOB(unstable, unstable, -2.0, LowPassFilter(0.05, 2))
    in_a = NRDOB(-1 / (_s + 1), 1 / (_s - 1), (_s - 1) / (_s * (_s + 3)), LowPassFilter(2.0, 1))
    seen, true = [], []
    for loop in (in_b, in_a):
        zeros = np.concatenate([_zeros_of_one_plus(loop.CGm), _zeros_of_one_plus(loop.FH)])
        seen.append(float(zeros.real.max()))
        true.append(float(loop_modes(loop).real.max()))
    loops = _random_loops(60)
    stable = np.array([loop_modes(loop).real.max() < 0 for loop in loops])
    hurwitz = np.array(
        [not in_right_half(loop.p_A.q) and not in_right_half(loop.p_B.q) for loop in loops]
    )
    p_b, by_filter = _unstable_filter()
    second = example(2)
    ill_posed = NRDOB(second.process, second.model, second.controller, LowPassFilter(0.01, 1))
    return Finding(
        every((value < 0) <= (mode < 0) for value, mode in zip(seen, true, strict=True)),
        f"zeros of A and B up to {number(seen[0], 4)} but a mode at {number(true[0], 4)} "
        f"(G = Gm = 4/(2 − s − s²), C = −2); up to {number(seen[1], 4)} but {number(true[1], 4)} "
        f"(Gm = 1/(s − 1), C = (s − 1)/(s(s + 3)), G = −1/(s + 1), λ = 2 s, n = 1); modes, and "
        f"p_A with p_B, agree for {np.sum(stable == hurwitz)} of {len(loops)} random loops, of "
        f"which {stable.sum()} are stable",
        conditions={
            "modes, and p_A with p_B, give the same verdict": every(stable == hurwitz),
            "both verdicts occur": 0 < stable.sum() < len(loops),
            "both loops with a cancellation have an unstable mode": every(
                value > 0 for value in true
            ),
            "they are judged unstable": every(
                loop.stability().stable is False for loop in (in_b, in_a)
            ),
            "p_B is Hurwitz under the unstable F": not in_right_half(p_b),
            "an unstable F brings an unstable mode": by_filter > 0,
            "the ill-posed loop gets no verdict": ill_posed.stability().stable is None,
        },
    )


def _unstable_filter() -> tuple[FloatArray, float]:
    """p_B and the rightmost mode for F = 1/(1 − 0.1s) and G = −Gm = −1/(s + 1)."""
    one, lag = np.ones(1), np.array([1.0, 1.0])
    F = Fraction(one, np.array([-0.1, 1.0]))
    p_b = np.polysub(np.convolve(lag, np.polysub(F.den, F.num)), lag)
    found = modes(Fraction(-one, lag), Fraction(one, lag), Fraction(one, one), F)
    return p_b, float(found.real.max())


def _random_loops(count: int, *, delayed: bool = False) -> list[NRDOB]:
    rng = np.random.default_rng(11)
    return [random_loop(rng, delayed=delayed) for _ in range(count)]


def _zeros_of_one_plus(loop: Quotient) -> ComplexArray:
    """Zeros of 1 + L after everything that cancels in L is gone."""
    tf = loop.to_tf()
    zeros = np.roots(np.polyadd(tf.num_array[0, 0], tf.den_array[0, 0]))
    return zeros.astype(complex)


@SECTION.claim(
    "lemma1.H_poles",
    "below Lemma 1",
    r"The poles of $H$ are the poles of $G$ and the zeros of $\tilde G$.",
    "05_how_slow_must_the_filter_be",
    amendment=Amendment(
        Verdict.CONDITION,
        r"Before cancellation they are: $H=(ND_me^{-\theta s}-DN_m)/(DN_m)$. Those that $G$ and "
        r"$\tilde G$ have in common cancel and are no poles of $H$; they stay roots of $p_B$ all "
        "the same.",
    ),
)
def poles_of_the_mismatch() -> Finding:
    """Approach every pole of G and every zero of Gm, in Examples 1 to 3 and in random loops.

    It is a pole of H if |H| grows like one over the distance. Where one has cancelled, p_B must
    vanish.
    """
    before, after, stay = [], [], []
    for which in (1, 2, 3):
        loop = example(which)
        roots = _poles_and_zeros(loop)
        kept = [_is_pole(loop, root) for root in roots]
        before.append(roots.size)
        after.append(sum(kept))
        stay += [
            abs(loop.p_B(root)) <= EXACT * np.polyval(loop.p_B.scale, abs(root))
            for root, is_pole in zip(roots, kept, strict=True)
            if not is_pole
        ]
    loops = _random_loops(20) + _random_loops(10, delayed=True)
    poles = [_is_pole(loop, root) for loop in loops for root in _poles_and_zeros(loop)]
    return Finding(
        before == after,
        f"Examples 1 to 3 have {numbers(before)} poles of G and zeros of Gm, of which "
        f"{numbers(after)} are poles of H; in random loops, where nothing is shared, "
        f"{sum(poles)} of {len(poles)} are",
        conditions={
            "where nothing is shared all are poles of H": every(poles),
            "those that cancel stay roots of p_B": every(stay),
        },
    )


def _poles_and_zeros(loop: NRDOB) -> ComplexArray:
    """Poles of G and zeros of Gm."""
    return np.concatenate([loop.G.denominator.roots, loop.Gm.numerator.roots])


def _is_pole(loop: NRDOB, root: complex) -> bool:
    """Whether |H| grows as its argument comes closer to `root`."""
    far, close = np.abs(loop.H(root + np.array([1e-6j, 1e-9j])))
    return bool(close > 100 * far > 0)


@SECTION.claim(
    "lemma1.N_p",
    "below Lemma 1",
    r"Condition ii holds if the plot of $FH$ encircles $-1$ anticlockwise $N_p$ times, the number "
    r"of right half plane poles of $G$ plus that of right half plane zeros of $\tilde G$.",
    "05_how_slow_must_the_filter_be",
    amendment=Amendment(
        Verdict.CONDITION,
        r"If and only if, provided that $N_p$ is counted before cancellation, that nothing cancels "
        r"on the imaginary axis ($G=\tilde G=1/s$ has $N_p=0$ and no turns, yet $p_B(0)=0$ if "
        r"every factor is kept; built as one, $(1-F)\tilde G$ has no such root), that "
        r"$F$ is stable, not zero where $D\,N_m$ is zero on the axis, and "
        r"$F(\infty)H(\infty)\ne-1$, and that the contour passes open-loop "
        "poles on the axis on their right. With dead time the plot must not circle $-1$ for ever; "
        "it does not if $FH$ is strictly proper.",
    ),
)
def turns_that_condition_ii_needs() -> Finding:
    """Follow 1 + FH point by point and count its turns; compare with the roots of p_B.

    Random loops with and without dead time, a plant with an integrator, G = Gm = 1/s with every
    factor kept and with blocks built as one, a filter that is zero on the axis, and
    G = Gm = 4/(2 − s − s²), for which a count after cancellation would call the loop stable.
    """
    rational = _random_loops(80)
    delayed = [loop for loop in _random_loops(40, delayed=True) if not any(loop.FH.at_infinity)]
    integrating = NRDOB(1 / _s, 1 / (_s + 0.1), 2.0, LowPassFilter(0.05, 1))
    agree = [_enough_turns(loop) == _condition_ii(loop) for loop in [*rational, *delayed]]
    hidden = NRDOB(1 / _s, 1 / _s, 2.0, LowPassFilter(0.05, 1), keep_factors=True)
    as_one = NRDOB(1 / _s, 1 / _s, 2.0, LowPassFilter(0.05, 1))
    notch = NRDOB(1 / (_s**2 + 1), 1 / (_s + 1) ** 2, 1.0, (_s**2 + 1) / (_s + 1) ** 4)
    G = 4 / (2 - _s - _s**2)
    matched = NRDOB(G, G, -2.0, LowPassFilter(0.05, 2))
    after = sum(_is_pole(matched, root) for root in _poles_and_zeros(matched) if root.real > 0)
    turned = _turns_around_minus_one(matched.FH)
    stable = sum(_condition_ii(loop) for loop in [*rational, *delayed])
    return Finding(
        every(agree) and _enough_turns(hidden) == _condition_ii(hidden),
        f"turns and roots agree for {sum(agree)} of {len(agree)} random loops, of which {stable} "
        f"fulfil condition ii; G = Gm = 1/s has {_turns_around_minus_one(hidden.FH)} turns, "
        f"N_p = {_n_p(hidden)} and a root of p_B at {number(rightmost(hidden))}; "
        f"G = Gm = 4/(2 − s − s²) has {turned} turns, N_p = {_n_p(matched)} before and {after} "
        f"after cancellation, and a root at {number(rightmost(matched), 4)}",
        conditions={
            "turns and roots agree": every(agree),
            "both verdicts occur": 0 < stable < len(agree),
            "there are loops with dead time": len(delayed) > 0,
            "a pole on the axis, passed on its right, is no obstacle": (
                _enough_turns(integrating) and _condition_ii(integrating)
            ),
            "G = Gm = 1/s violates condition ii if every factor is kept": not _condition_ii(hidden),
            "built as one it fulfils it": _condition_ii(as_one),
            "a zero of F on a pole of G on the axis: enough turns, and roots on the axis": (
                _enough_turns(notch) and not _condition_ii(notch)
            ),
            "the matched unstable plant violates condition ii": not _condition_ii(matched),
            "N_p before cancellation tells": not _enough_turns(matched),
            "N_p after cancellation does not": turned == -after,
        },
    )


def _n_p(loop: NRDOB) -> int:
    """Right half plane poles of G and zeros of Gm, before cancellation."""
    return in_right_half(loop.G.denominator.q) + in_right_half(loop.Gm.numerator.q)


def _enough_turns(loop: NRDOB) -> bool:
    return _turns_around_minus_one(loop.FH) == -_n_p(loop)


def _turns_around_minus_one(open_loop: Quotient, excess: int = 0) -> int:
    """Clockwise turns, followed point by point."""
    return turns(lambda s: 1 + open_loop(s), excess)


def _condition_ii(loop: NRDOB) -> bool:
    """Whether all roots of p_B are in the open left half plane."""
    if loop.delay:
        return loop.stability().observer_loop.stable is True
    return bool(rightmost(loop) < -1e-9)


# What Section III says of H.


@SECTION.claim(
    "sec3.rhp_zeros",
    "below Lemma 1",
    r"Right half plane zeros of $H$ can prevent stabilisation.",
    "B_rules",
)
def a_zero_that_no_filter_survives() -> Finding:
    """Try H = 4(s − 1)/(s − 2) with 21 λ and n = 1 to 4, and the same with its zero at −1.

    Parity proves it for all: B is 1 at the zero s = 1, whatever the filter, and the pole of H at
    s = 2 is one of B. So p_B is negative at 1 and positive at 2, with a root in between.
    """
    with_zero, without = 1 + 4 * (_s - 1) / (_s - 2), 1 + 4 * (_s + 1) / (_s - 2)
    model = 1 / (_s + 1)
    tried = [(value, order) for value in np.geomspace(1e-3, 1e3, 21) for order in (1, 2, 3, 4)]
    counts, parity, saved = [], [], []
    for value, order in tried:
        loop = observer(with_zero, model, value, order)
        counts.append(in_right_half(loop.p_B.q))
        parity.append(same(1 + loop.FH(1.0), 1) and loop.p_B(1.0).real < 0 < loop.p_B(2.0).real)
        saved.append(in_right_half(observer(without, model, value, order).p_B.q) == 0)
    return Finding(
        min(counts) > 0 and any(saved) and every(parity),
        f"H = 4(s − 1)/(s − 2): {min(counts)} or more roots in the right half plane for all "
        f"{len(tried)} filters, p_B(1) < 0 < p_B(2) for {sum(parity)}; H = 4(s + 1)/(s − 2): no "
        f"such root for {sum(saved)} of them",
    )


@SECTION.claim(
    "sec3.Z_H",
    "Section III",
    r"The number of right half plane zeros of $H$ is $Z_H=N_H+P_H$, with $N_H$ the clockwise turns "
    r"of $G/\tilde G$ around $+1$.",
    "05_how_slow_must_the_filter_be",
    amendment=Amendment(
        Verdict.CONDITION,
        r"The plot must not pass through $+1$: it does when $G(0)=\tilde G(0)$ and when the limit "
        r"$M$ at high frequency is 1, which the paper recommends; with dead time it must not come "
        r"arbitrarily close for ever. $P_H$ is counted before cancellation, and an improper "
        "$G/\\tilde G$ has to be closed by its arc at infinity.",
    ),
)
def zeros_of_the_mismatch() -> Finding:
    """See whether the plot meets +1 in the examples; count turns and zeros of H on random loops.

    Turns are followed point by point, without and with the arc, zeros are roots of N Dm − D Nm.
    """
    meets = [_meets_plus_one(example(which).ratio) for which in EXAMPLES]
    loops = [loop for loop in _random_loops(60) if not _meets_plus_one(loop.ratio)]
    agree, improper = [], 0
    for loop in loops:
        excess = max(0, loop.ratio.numerator.degree - loop.ratio.denominator.degree)
        zeros = in_right_half(loop.H.numerator.q)
        agree.append(turns(loop.H, excess) + _n_p(loop) == zeros)
        improper += excess > 0
    third = example(3)
    n_h, p_h = turns(third.H), _n_p(third)
    z_h = in_right_half(third.H.numerator.q)
    undefined = [str(which) for which, met in zip(EXAMPLES, meets, strict=True) if met]
    return Finding(
        not any(meets) and every(agree),
        f"the plot meets +1, or circles through it for ever, in Examples {', '.join(undefined)}; "
        f"in Example 3 N_H = {number(n_h)}, P_H = {p_h}, Z_H = {z_h}; the formula holds for "
        f"{sum(agree)} of {len(agree)} random loops, {improper} of them with an arc at infinity",
        conditions={
            "Z_H = N_H + P_H where the plot does not meet +1": every(agree),
            "some of the plots are closed by an arc": improper > 0,
            "the plot of Example 3 does not meet +1": not meets[2],
            "Z_H = N_H + P_H in Example 3": n_h + p_h == z_h,
        },
    )


def _meets_plus_one(ratio: Quotient) -> bool:
    """Whether the plot of G/Gm starts at +1, ends there, or ends on a circle through it."""
    centre, radius = ratio.at_infinity
    starts = abs(ratio.dc_gain - 1) < EXACT
    return starts or (np.isfinite(centre) and bool(abs(abs(1 - centre) - abs(radius)) < EXACT))


@SECTION.claim(
    "sec3.slow_filter_always",
    "Section III",
    r"Clockwise turns of $H$ around $-1$ are avoided by reducing the bandwidth of $F$.",
    "B_rules",
    amendment=Amendment(
        Verdict.CONDITION,
        r"For all sufficiently large $\lambda$ the observer loop is stable if and only if the "
        r"poles of $G$ and the zeros of $\tilde G$ are in the open left half plane and "
        r"$0<G(0)/\tilde G(0)<M_n$, where $M_n=\infty$ for $n\le2$ and $1+\sec^n(\pi/n)$ for "
        r"$n\ge3$ (at $G(0)/\tilde G(0)=0$ or $M_n$ it depends on more).",
    ),
)
def slowing_the_filter_down() -> Finding:
    """Slow the filter down for two H with one clockwise turn, and for random loops.

    G/Gm = (s − 1)/(s + 1) has the wrong sign at low frequency; 10(1 − s/100)/(1 + s/100) is too
    large for n = 3. On random loops the roots of p_B for λ = 10⁵ s are compared with the rule.
    """
    tried = np.geomspace(1e-2, 1e5, 29)
    model = 1 / (_s + 1)
    cases = [((_s - 1) / (_s + 1), 1), (10 * (1 - 0.01 * _s) / (1 + 0.01 * _s), 3)]
    turning = [_turns_around_minus_one(observer(R, model, 1.0, n).H) for R, n in cases]
    stable = [sum(rightmost(observer(R, model, value, n)) < 0 for value in tried) for R, n in cases]
    agree, wins = [], 0
    for loop in _random_loops(60):
        for order in range(max(1, loop.Gm.denominator.degree - loop.Gm.numerator.degree), 5):
            slow = NRDOB(loop.process, loop.model, 0.0, LowPassFilter(1e5, order))
            rule = _n_p(loop) == 0 and 0 < loop.ratio.dc_gain < critical_gain(order)
            agree.append((rightmost(slow) < 0) == rule)
            wins += rule
    return Finding(
        every(count > 0 for count in stable),
        f"(s − 1)/(s + 1), n = 1, and 10(1 − s/100)/(1 + s/100), n = 3: H turns "
        f"{numbers(turning)} times clockwise, and {numbers(stable)} of {tried.size} λ up to "
        f"10⁵ s are stable; the rule decides {sum(agree)} of {len(agree)} random cases, {wins} of "
        "them stable",
        conditions={
            "the rule decides": every(agree),
            "both verdicts occur": 0 < wins < len(agree),
            "H turns once clockwise in both cases": every(count == 1 for count in turning),
            "no filter is slow enough for them": not any(stable),
        },
    )


@SECTION.claim(
    "sec3.no_turns_no_filter",
    "Section III",
    r"If $H$ has $P_H$ unstable poles and its plot does not turn $P_H$ times anticlockwise around "
    r"$-1$, no filter $F$ stabilises $B$.",
    "B_rules",
    amendment=Amendment(
        Verdict.REFUTED,
        r"It is $FH$ that has to turn, not $H$. $G/\tilde G=(s+1)(1-s/100)/(s-1)$ has $P_H=1$, its "
        r"$H$ does not turn, and a filter stabilises it. Nor are the turns of $H$ enough: for "
        r"$G/\tilde G=10(s+1)/(s-1)$ they are there, and with $n=3$ no $\lambda$ does.",
    ),
)
def turns_of_h_alone() -> Finding:
    """Count the turns of H (with its arc) and the roots of p_B for n = 2, λ = 0.1 s.

    For the converse 81 λ from 0.1 ms to 10⁴ s are tried, and Routh's conditions for the quartic
    (s − 1)((λs + 1)³ − 1) + 10(s + 1) computed: they ask for λ < 1 and for 3λ² > 9λ + 1 at once.
    """
    stabilised = NRDOB(
        -(1 - 0.01 * _s) / ((_s - 1) * (_s + 2)),
        -1 / ((_s + 1) * (_s + 2)),
        0.0,
        LowPassFilter(0.1, 2),
    )
    model = 1 / (_s + 1) ** 3
    process = 10 * (_s + 1) / (_s - 1) * model
    turning = [
        NRDOB(process, model, 0.0, LowPassFilter(value, 3)) for value in np.geomspace(1e-4, 1e4, 81)
    ]
    no_turn = _turns_around_minus_one(stabilised.H, excess=1)
    one_turn = _turns_around_minus_one(turning[0].H)
    root = rightmost(stabilised)
    routh = [_routh(loop.filter) for loop in turning]
    counts = [in_right_half(loop.p_B.q) for loop in turning]
    return Finding(
        no_turn == -_n_p(stabilised) or root >= 0,
        f"P_H = {_n_p(stabilised)}, H turns {number(-no_turn)} times anticlockwise, and the "
        f"rightmost root is {number(root, 4)}; conversely P_H = {_n_p(turning[0])}, H turns "
        f"{number(-one_turn)} times, and {min(counts)} or more roots are in the right half plane "
        f"for all {len(counts)} λ",
        conditions={
            "P_H = 1 in both cases": _n_p(stabilised) == _n_p(turning[0]) == 1,
            "in the first H does not turn": (
                no_turn == encirclements(stabilised.H).encirclements == 0
            ),
            "a filter stabilises it all the same": (
                root < 0 and stabilised.stability().observer_loop.stable is True
            ),
            "in the other H turns once anticlockwise": (
                one_turn == encirclements(turning[0].H).encirclements == -1
            ),
            "no λ stabilises it": min(counts) > 0,
            "by Routh's conditions none can": every(routh),
        },
    )


def _routh(F: LowPassFilter) -> bool:
    """Whether Routh's conditions for R = 10(s + 1)/(s − 1) are the stated ones, and fail."""
    quartic = np.polyadd(np.convolve([1, -1], np.polysub(F.den, [1])), [10, 10])
    a4, a3, a2, a1, _ = quartic
    value = F.time_constant
    condition = 3 * value**2 - 9 * value - 1
    stated = np.isclose(a3 * a2 - a4 * a1, value**3 * condition, rtol=1e-6, atol=1e-9 * a4)
    return bool(stated) and (a2 > 0) == (value < 1) and not (value < 1 and condition > 0)


@SECTION.claim(
    "sec3.three_dof",
    "Sections III and V",
    r"A controller with NR-DOB has three degrees of freedom: $C$, $F$ and $\tilde G$.",
    "15_what_it_is",
    amendment=Amendment(
        Verdict.REFUTED,
        r"Three blocks, two degrees of freedom: $u=VR-K(y+\eta)$ with the feedback "
        r"$K=F/((1-F)\tilde G)$ and $V=C/((1+C\tilde G)(1-F))$. Another model gives the same $u$ "
        r"and $y$ with a suitable $F$ and $C$, and a stable loop if it is stable and minimum phase "
        r"and $K$ stabilises it; for $n=1$, $\tilde G$ with $\lambda$ and $2\tilde G$ with "
        r"$\lambda/2$ are the same feedback.",
    ),
)
def three_blocks_two_freedoms() -> Finding:
    """Replace the model by a random one, at random values; find F and C that undo it.

    With all four inputs at once u and y must not change. The pair of filters of order 1 is
    compared on loops.
    """
    rng = np.random.default_rng(9)
    blocks = random_blocks(rng)
    G, Gm, C, F = blocks
    K, V = F / ((1 - F) * Gm), C / ((1 + C * Gm) * (1 - F))
    other = random_blocks(rng).Gm
    F_other = K * other / (1 + K * other)
    C_other = V * (1 - F_other) / (1 - V * (1 - F_other) * other)
    replaced = Values(G, other, C_other, F_other)
    R, d, delta, eta = random_blocks(rng)  # four more random numbers each
    before, after = (solve(case, R=R, d=d, delta=delta, eta=eta) for case in (blocks, replaced))
    undone = np.isclose(before.y, after.y, rtol=1e-6) & np.isclose(before.u, after.u, rtol=1e-6)
    feedback = same(before.u, V * R - K * (before.y + eta))
    model, s = 1 / (_s + 1), random_points(rng)
    first = NRDOB(1 / (_s + 2), model, 1.0, LowPassFilter(0.4, 1))
    second = NRDOB(1 / (_s + 2), 2 * model, 1.0, LowPassFilter(0.2, 1))
    return Finding(
        not every(undone),
        f"another model is undone by F and C in {undone.sum()} of {QUADRUPLES} random cases; "
        f"Gm = 1/(s + 1) with λ = 0.4 s and 2 Gm with λ = 0.2 s have K(1) = "
        f"{number(abs(first.K(1.0)), 5)} and {number(abs(second.K(1.0)), 5)}",
        "1e-6 relative",
        conditions={
            "another model is undone by F and C": every(undone),
            "u = VR − K(y + η)": feedback,
            "Gm with λ and 2Gm with λ/2 are the same feedback": same(first.K(s), second.K(s)),
            "the two models differ": not same(first.Gm(s), second.Gm(s)),
        },
    )


def _normalised(rng: np.random.Generator) -> tuple[Fraction, Fraction]:
    """Plant and model of one order, relative degree and gain, constant coefficients 1."""
    n = int(rng.integers(1, 4))
    m = int(rng.integers(0, n + 1))
    gain = rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 5)

    def block() -> Fraction:
        num, den = (np.append(rng.uniform(0.2, 5, degree), 1.0) for degree in (m, n))
        return Fraction(gain * num, den)

    return block(), block()


def _normalised_loops(count: int) -> list[NRDOB]:
    rng = np.random.default_rng(13)
    pairs = [_normalised(rng) for _ in range(count)]
    return [NRDOB(G, Gm, 0.0, LowPassFilter(1.0, max(1, Gm.relative_degree))) for G, Gm in pairs]


@SECTION.claim(
    "sec3.H_zero",
    "Section III",
    r"If $G$ and $\tilde G$ have the same steady state gain, $\lim_{\omega\to0}G/\tilde G=1$ and "
    r"$H(0)=0$.",
    "B_rules",
)
def equal_gains_at_zero() -> Finding:
    """Draw 40 pairs of one order and gain; take H at s = 0 and follow it towards 0."""
    loops = _normalised_loops(40)
    small = np.array([np.abs(loop.H(1j * np.array([1e-3, 1e-6]))) for loop in loops])
    at_zero = [abs(loop.H.dc_gain) < EXACT for loop in loops]
    shrinks = small[:, 1] < 2e-3 * small[:, 0]
    return Finding(
        every(at_zero) and every(shrinks),
        f"H(0) = 0 for {sum(at_zero)} of {len(loops)} random pairs, and |H(jω)| falls with ω "
        f"for {shrinks.sum()}",
        TOLERANCE,
    )


@SECTION.claim(
    "sec3.M",
    "Section III",
    r"With constant coefficients 1 and equal orders, "
    r"$\lim_{\omega\to\infty}G/\tilde G=\dfrac{b_m\tilde a_n}{\tilde b_m a_n}=M$, and "
    r"$H(\infty)=0$ if $M=1$.",
    "B_rules",
)
def ratio_at_high_frequency() -> Finding:
    """Draw 40 pairs of one order and gain; follow G/Gm to ω = 10⁹ rad/s.

    Then scale the model's leading coefficient so that M = 1, and follow H.
    """
    right, vanish = [], []
    for loop in _normalised_loops(40):
        G, Gm = fraction(loop.G), fraction(loop.Gm)
        M = G.num[0] * Gm.den[0] / (Gm.num[0] * G.den[0])
        right.append(abs(loop.ratio(1e9j) / M - 1) < 1e-6 and same(loop.ratio.at_infinity[0], M))
        den = np.append(Gm.den[0] / M, Gm.den[1:])
        equal = NRDOB(loop.process, Fraction(Gm.num, den), 0.0, loop.filter)
        vanish.append(abs(equal.H(1e9j)) < 1e-6)
    return Finding(
        every(right) and every(vanish),
        f"the limit is M for {sum(right)} of {len(right)} random pairs, and H(∞) = 0 for "
        f"{sum(vanish)} of {len(vanish)} with M = 1",
        "1e-6 at ω = 10⁹ rad/s",
    )


@SECTION.claim(
    "sec3.speculation",
    "Section III",
    r"If the parameters of $G$ and $\tilde G$ differ little, the plot of $H$ may be expected in "
    "the right half plane.",
    "B_rules",
    amendment=Amendment(
        Verdict.REFUTED,
        r"It may lie anywhere. Exchange $G$ and $\tilde G$, and $H$ becomes $-H/(1+H)$: where the "
        r"one is in the right half plane, the other is in the left. Nor is $H$ small with the "
        r"differences: a resonance that is 10 % off makes the loop unstable for $\lambda$ over "
        r"almost two decades ($n=2$). What suffices is the size: $|H(\mathrm{j}\omega)|<1$ for all "
        r"$\omega$, with the poles of $G$ and the zeros of $\tilde G$ in the left half plane, is "
        r"stable for every $\lambda$ and $n$, since $|F|\le1$.",
    ),
)
def plots_of_small_mismatches() -> Finding:
    """Follow Re H of a resonance that is 10 % off; find its critical λ by bisection.

    40 random pairs with parameters within 1 % are exchanged. 8 random H with |H| below 0.96 are
    tried with 5 λ and n up to 4.
    """
    process, model = resonance(0.9, 0.01), resonance(1.0, 0.01)

    def resonant(time_constant: float) -> NRDOB:
        return NRDOB(process, model, 0.0, LowPassFilter(time_constant, 2))

    real = resonant(1.0).H(1j * np.linspace(0.5, 1.5, 4001)).real
    fast, middle, slow = 0.01, 0.3, 100.0
    low, high = (
        float(np.exp(brentq(lambda x: rightmost(resonant(float(np.exp(x)))), *np.log(within))))
        for within in ((fast, middle), (middle, slow))
    )
    ends = (0.99 * low, 1.01 * low, 0.99 * high, 1.01 * high)
    exchanged, left = _exchanged()
    small = list(_small_mismatches(8))
    return Finding(
        real.min() >= 0 and not any(left),
        f"resonance 10 % off: Re H from {number(real.min(), 4)} to {number(real.max(), 4)}, "
        f"unstable for λ from {number(low, 4)} to {number(high, 4)} s; {sum(left)} of {len(left)} "
        "random pairs within 1 % leave the right half plane in one order or the other; "
        f"{sum(small)} of {len(small)} loops with |H| < 0.96 are stable",
        conditions={
            "exchanging G and Gm changes the side of H": every(exchanged),
            "in one order or the other H leaves the right half plane": every(left),
            "|H| < 1 suffices for every λ and n": every(small),
            "the resonance costs almost two decades of λ": high > 50 * low,
            "they end at these two λ": [rightmost(resonant(x)) < 0 for x in ends]
            == [True, False, False, True],
        },
    )


def _exchanged() -> tuple[list[bool], list[bool]]:
    """Whether Re H > 0 in one order means Re H < 0 in the other; and whether either is left."""
    rng = np.random.default_rng(17)
    s = 1j * np.geomspace(1e-3, 1e3, 301)
    opposite, left = [], []
    for _ in range(40):
        G, _ = _normalised(rng)
        near = Fraction(*(part * rng.uniform(0.99, 1.01, part.size) for part in G))
        loops = [
            NRDOB(*pair, 0.0, LowPassFilter(1.0, max(1, G.relative_degree)))
            for pair in ((G, near), (near, G))
        ]
        one, other = (loop.H(s).real for loop in loops)
        opposite.append(every(other[one > 0] < 0) if (one > 0).any() else every(one <= 0))
        left.append(bool(min(one.min(), other.min()) < 0))
    return opposite, left


def _small_mismatches(count: int) -> Iterator[bool]:
    """Random loops with D and Nm Hurwitz and |H| < 0.96; whether each is stable."""
    rng = np.random.default_rng(19)
    grid = 1j * np.append(0.0, np.geomspace(1e-3, 1e4, 401))
    for _ in range(count):
        pole = -rng.uniform(0.2, 5, 3)
        den = np.poly(pole)
        num = rng.normal(size=3 + int(rng.integers(0, 2)))
        num = num * 0.95 / np.abs(np.polyval(num, grid) / np.polyval(den, grid)).max()
        process = np.polyadd(den, num), np.convolve(den, [1.0, 1.0])
        model = [1.0], [1.0, 1.0]
        for order in (1, 2, 3, 4):
            for value in np.geomspace(1e-2, 1e2, 5):
                loop = NRDOB(process, model, 0.0, LowPassFilter(value, order))
                bounded = bool(np.abs(loop.H(grid)).max() < 0.96)
                yield bounded and rightmost(loop) < 0


@SECTION.claim(
    "sec3.any_bandwidth",
    "Section III",
    r"If $H$ stays in the right half plane, and $G$ and $\tilde G$ are stable and minimum phase, "
    r"$B$ is stable whatever the bandwidth of $F$.",
    "B_rules",
    amendment=Amendment(
        Verdict.CONDITION,
        r"True for $n=1$ and a proper $H$: $FH$ never turns by 180°. For $n\ge2$ it can: with "
        r"$H=10s/((s+0.01)(s+1))$, $n=2$, $\lambda=1$ s is unstable, and $H=49s/(s+1)$ with $n=3$ "
        r"is stable only for $\lambda$ beyond a border.",
    ),
)
def right_half_plane_mismatch() -> Finding:
    """Take two H with a nonnegative real part and find roots of p_B in the right half plane.

    The border for n = 3 is found by bisection. Then 12 random sums of positive real terms are
    tried with n = 1 and 9 λ.
    """
    model = 1 / (_s + 1)
    hump, step = 10 * _s / ((_s + 0.01) * (_s + 1)), 49 * _s / (_s + 1)
    second = [observer(1 + hump, model, value, 2) for value in (1e-3, 1.0, 1e3)]
    third = [observer(1 + step, model, value, 3) for value in (0.1, 10.0)]

    def at_border(value: float) -> float:
        return rightmost(observer(1 + step, model, value, 3))

    border = float(brentq(at_border, 0.1, 10.0))
    within = [_in_the_right(loop) for loop in (second[0], third[0])]
    roots = [rightmost(loop) for loop in second]
    first_order = [
        _in_the_right(loop) and rightmost(loop) < 0
        for H in _positive_real(12)
        for value in np.geomspace(1e-3, 1e3, 9)
        if (loop := observer(1 + H, model, value, 1))
    ]
    return Finding(
        every(root < 0 for root in roots) and every(rightmost(loop) < 0 for loop in third),
        f"H = 10s/((s + 0.01)(s + 1)), n = 2: rightmost root {number(roots[1], 4)} for λ = 1 s; "
        f"H = 49s/(s + 1), n = 3: stable from λ = {number(border, 5)} s on; n = 1: "
        f"{sum(first_order)} of {len(first_order)} loops with a random positive real H are stable",
        conditions={
            "both H stay in the right half plane, G and Gm stable and minimum phase": every(within),
            "n = 2 is unstable for λ = 1 s, and neither much faster nor much slower": (
                [root < 0 for root in roots] == [True, False, True]
            ),
            "n = 3 is stable for the slow filter only": (
                [rightmost(loop) < 0 for loop in third] == [False, True]
            ),
            "n = 3 is lost at the border": (
                at_border(0.999 * border) > 0 > at_border(1.001 * border)
            ),
            "n = 1 is stable with every λ": every(first_order),
        },
    )


def _positive_real(count: int) -> Iterator[ct.TransferFunction]:
    """Draw sums of three lags or their complements, none of which leaves the right half plane."""
    rng = np.random.default_rng(23)
    for _ in range(count):
        weights, poles = rng.uniform(0, 10, 3), 10 ** rng.uniform(-2, 2, 3)
        tops = [
            _s if high else pole for high, pole in zip(rng.integers(0, 2, 3), poles, strict=True)
        ]
        terms = zip(weights, tops, poles, strict=True)
        yield sum(weight * top / (_s + pole) for weight, top, pole in terms)


def _in_the_right(loop: NRDOB) -> bool:
    """Whether Re H ≥ 0 on the axis, with G and Gm stable and minimum phase."""
    H = loop.H(1j * np.append(0.0, np.geomspace(1e-5, 1e5, 401)))
    parts = (loop.G.numerator, loop.G.denominator, loop.Gm.numerator, loop.Gm.denominator)
    in_the_left = all((np.roots(part.q).real < 0).all() for part in parts)
    return in_the_left and bool((H.real >= -EXACT * np.abs(H)).all())


# Lemma 2.


@SECTION.claim(
    "lemma2.i",
    "Lemma 2",
    r"The loop is robust if $C$ is designed such that $C\tilde G$ has adequate gain and phase "
    "margins (with ii).",
    "08_which_margin_is_the_plants",
    amendment=Amendment(
        Verdict.CONDITION,
        r"$C\tilde G$ does not contain the process: its margins are the same for every $G$, and "
        r"$C$ is not in the loop $L=KG=\dfrac{F}{1-F}\cdot\dfrac{G}{\tilde G}$ that a change of "
        r"$G$ can make unstable. $C$ has to stabilise the model, and it shapes $T_R$; robustness "
        "is read from the margins of $L$.",
    ),
)
def margins_without_the_process() -> Finding:
    """Neglect a lag of 0.1 s in Example 3; compare margins of C Gm and the verdict.

    In Examples 2 to 4 the margins of C Gm must not change with the plant, nor those of L with C,
    while those of C Gm do.
    """
    loop = example(3)
    process = 4 / ((2 - _s - _s**2) * (0.1 * _s + 1))
    lagging = NRDOB(process, loop.model, loop.controller, loop.filter)
    pm = [case.margins().model_loop.pm for case in (loop, lagging)]
    fixed, shaped = [], []
    for which in (2, 3, 4):
        nominal, modified = example(which), example(which, modified=True)
        fixed.append(_equal(nominal.margins().model_loop, modified.margins().model_loop))
        scaled = [
            NRDOB(nominal.process, nominal.model, gain * nominal.controller, nominal.filter)
            for gain in (0.5, 1.0, 2.0)
        ]
        plant = [case.margins().plant_loop for case in scaled]
        fixed += [_equal(plant[0], plant[1]), _equal(plant[1], plant[2])]
        crossovers = [case.margins().model_loop.wgc for case in scaled]
        shaped.append(crossovers[0] < 0.9 * crossovers[1] < 0.8 * crossovers[2])
    verdict = lagging.stability()
    return Finding(
        verdict.stable is True,
        f"Example 3: the phase margin of C Gm is {number(pm[0], 4)}° and, with a lag of 0.1 s "
        f"neglected in the process, {number(pm[1], 4)}°; the loop then has a root at "
        f"{number(verdict.observer_loop.rightmost.real, 4)} ± "
        f"{number(abs(verdict.observer_loop.rightmost.imag), 4)}j",
        conditions={
            "Example 3 is stable": loop.stability().stable is True,
            "with the lag it is not": verdict.stable is False,
            "the phase margin of C Gm stays what it was": pm[0] == pm[1],
            "margins of C Gm are free of G, those of L of C": every(fixed),
            "C shapes the crossover of C Gm": every(shaped),
        },
    )


def _equal(one: Margins, other: Margins) -> bool:
    return np.allclose(list(one), list(other), rtol=1e-9, equal_nan=True)


@SECTION.claim(
    "lemma2.ii",
    "Lemma 2",
    r"The loop is robust if $F$ is designed such that $FH$ has adequate gain and phase margins "
    "(with i).",
    "08_which_margin_is_the_plants",
    amendment=Amendment(
        Verdict.CONDITION,
        r"Margins of $FH$ are margins of the mismatch, not of the process: with $kG$ for $G$ the "
        r"mismatch is $kG/\tilde G-1$, not $kH$. How much the process may change is told by the "
        r"margins of $L=KG=\dfrac{F}{1-F}\cdot\dfrac{G}{\tilde G}$.",
    ),
)
def margins_of_the_mismatch() -> Finding:
    """Multiply the process by a gain, in Examples 2 to 4, and compare the verdict with both.

    0.1 % inside and outside the range of L the loop must be stable and not stable; 0.1 % inside
    the range of FH it should be stable, were this the range of the process.
    """
    texts: list[str] = []
    as_claimed: list[bool] = []
    as_amended: list[bool] = []
    for which in (2, 3, 4):
        loop = example(which)
        margins = loop.margins()
        observer_loop, plant_loop = margins.observer_loop, margins.plant_loop
        texts.append(
            f"{number(observer_loop.gm_low, 4)} to {number(observer_loop.gm_high, 5)} against "
            f"{number(plant_loop.gm_low, 4)} to {number(plant_loop.gm_high, 5)}"
        )
        for low, high, judged in (
            (observer_loop.gm_low, observer_loop.gm_high, as_claimed),
            (plant_loop.gm_low, plant_loop.gm_high, as_amended),
        ):
            judged += [_with_gain(loop, low * 1.001)] if low else []
            judged += [_with_gain(loop, high * 0.999)] if high < inf else []
            # Only the true range may, and must, end there.
            if judged is as_amended:
                judged += [not _with_gain(loop, low * 0.999)] if low else []
                judged += [not _with_gain(loop, high * 1.001)] if high < inf else []
    return Finding(
        every(as_claimed),
        f"gain factors that FH and the process allow in Examples 2 to 4: {'; '.join(texts)}",
        conditions={"the range of L is that of the process": every(as_amended)},
    )


def _with_gain(loop: NRDOB, gain: float) -> bool:
    """Whether the loop is stable with so many times the process."""
    changed = NRDOB(gain * loop.process, loop.model, loop.controller, loop.filter)
    return changed.stability().stable is True


# Corollary 1.


@SECTION.claim(
    "cor1.stable",
    "Corollary 1",
    r"If $G=\tilde G$, the loop is stable when $C$ stabilises $\tilde G$, $F$ is stable, and $G$ "
    "is stable and minimum phase.",
    "03_is_a_perfect_model_perfect",
)
def perfect_models() -> Finding:
    """Draw blocks that fulfil the three conditions; take the modes of the whole diagram.

    p_B must be N D Df, coefficient by coefficient.
    """
    rng = np.random.default_rng(29)
    stable: list[bool] = []
    factored: list[bool] = []
    while len(stable) < 40:
        G, C = random_block(rng, 3), random_block(rng, 2)
        num, den = G.num_array[0, 0], G.den_array[0, 0]
        F = LowPassFilter(10 ** rng.uniform(-1.5, 0.5), max(1, den.size - num.size))
        loop = NRDOB(G, G, C, F)
        if in_right_half(num) or in_right_half(den) or in_right_half(loop.p_A.q) or loop.ill_posed:
            continue
        stable.append(bool(loop_modes(loop).real.max() < 0))
        factored.append(same(loop.p_B.q, np.convolve(np.convolve(num, den), F.den)))
    return Finding(
        every(stable) and every(factored),
        f"{sum(stable)} of {len(stable)} random loops that fulfil the conditions are stable; "
        f"p_B = N D Df in {sum(factored)}",
        "p_B: 1e-8 relative",
    )


@SECTION.claim(
    "cor1.necessary",
    "Corollary 1",
    r"Each of the conditions of Corollary 1 is needed, if the blocks are built as drawn; they "
    "exclude poles and zeros of $G$ on the imaginary axis, too.",
    "03_is_a_perfect_model_perfect",
)
def each_condition_dropped() -> Finding:
    """Drop one condition at a time and take the modes of the whole diagram.

    The rest of the conditions is checked in each case. An integrator and a zero at s = 0 stand for
    poles and zeros on the axis.
    """
    one, F = np.ones(1), fraction(_lag(0.1))
    zero, poles = np.array([1.0, 3.0]), np.array([1.0, 3.0, 2.0])
    G, C = Fraction(zero, poles), Fraction(one, np.array([1.0, 0.0]))
    half, gain = Fraction(0.5 * one, one), Fraction(4 * one, one)
    cases = {
        "none": (G, C, F),
        "C does not stabilise": (G, Fraction(-one, np.array([1.0, 0.0])), F),
        "F unstable": (G, C, Fraction(one, np.array([-0.1, 1.0]))),
        "G unstable": (Fraction(zero, np.array([1.0, 1.0, -2.0])), gain, F),
        "zero at +1": (Fraction(np.array([-1.0, 1.0]), poles), half, F),
        "integrator": (Fraction(one, np.array([1.0, 0.0])), gain, F),
        "zero at 0": (Fraction(np.array([1.0, 0.0]), poles), half, F),
    }
    right = {}
    for name, (process, controller, low_pass) in cases.items():
        found = modes(process, process, controller, low_pass).real.max()
        right[name] = float(np.round(found, 9)) + 0.0
    dropped = [
        [
            in_right_half(_closed(process, controller)) > 0,
            in_right_half(low_pass.den) > 0,
            _reaches_right(process.den),
            _reaches_right(process.num),
        ]
        for process, controller, low_pass in cases.values()
    ]
    single = [sum(row) for row in dropped] == [0, *[1] * (len(cases) - 1)]
    return Finding(
        single and right.pop("none") < 0 and every(value >= 0 for value in right.values()),
        "rightmost mode with one condition dropped: "
        + ", ".join(f"{name} {number(value, 4)}" for name, value in right.items()),
    )


def _lag(time_constant: float) -> Quotient:
    return NRDOB(1.0, 1.0, 0.0, LowPassFilter(time_constant, 1)).F


def _closed(model: Fraction, controller: Fraction) -> FloatArray:
    """p_A."""
    return np.polyadd(
        np.convolve(model.den, controller.den), np.convolve(model.num, controller.num)
    )


def _reaches_right(coefficients: FloatArray) -> bool:
    """Whether a polynomial has a root in the closed right half plane."""
    return bool((np.roots(coefficients).real >= 0).any())


@SECTION.claim(
    "cor1.robust",
    "Corollary 1",
    r"If $G=\tilde G$, the loop is robust when $C\tilde G$ has adequate gain and phase margins.",
    "03_is_a_perfect_model_perfect",
    amendment=Amendment(
        Verdict.CONDITION,
        r"With a perfect model $L=F/(1-F)$: gain and phase margins against a change of the process "
        r"depend on the order $n$ of $F$ alone, neither on $\lambda$ nor on $C$. A gain factor $k$ "
        r"is survived if and only if $0<k<M_n$, with $M_n=\infty$ for $n\le2$ and "
        r"$1+\sec^n(\pi/n)$ for $n\ge3$.",
    ),
)
def margins_of_a_perfect_model() -> Finding:
    """Compute the margins of L for matched loops with n = 1 to 6, and multiply the process by k.

    Example 1 with its own C and with one twice as large, another process, and other λ must give
    the same margins; 0.1 % below M_n the loop must be stable, above it must not.
    """
    first = example(1)
    other = 5 * (_s + 4) / ((_s + 1) * (_s + 2))
    limits, phases, same_margins, ends = [], [], [], []
    for order in range(1, 7):
        loops = [
            NRDOB(first.process, first.process, first.controller, LowPassFilter(0.01, order)),
            NRDOB(first.process, first.process, 2 * first.controller, LowPassFilter(0.01, order)),
            NRDOB(other, other, 1 / _s, LowPassFilter(0.3, order)),
        ]
        margins = [loop.margins().plant_loop for loop in loops]
        limits.append(margins[0].gm_high)
        phases.append(margins[0].pm)
        for found in margins:
            same_margins += [
                same(found.pm, phases[-1], 1e-6),
                same(found.gm_high, limits[-1], 1e-6),
            ]
        limit = critical_gain(order)
        for loop in loops[::2]:
            ends += [_with_gain(loop, k) for k in (1e-3, 0.999 * min(limit, 1e4))]
            ends.append(not _with_gain(loop, -0.1))
            ends += [not _with_gain(loop, 1.001 * limit)] if limit < inf else []
    gains = [critical_gain(order) for order in range(1, 7)]
    pm = first.margins().model_loop
    return Finding(
        # C Gm of Example 1 has an infinite gain margin: were it that of the loop, so had this.
        every(value == pm.gm for value in limits),
        f"Example 1: C Gm has a gain margin of {number(pm.gm)}, the process may grow by "
        f"{numbers(limits)} for n = 1 to 6, with phase margins {numbers(phases)}°",
        conditions={
            "the margins of L depend on n alone": every(same_margins),
            "the process may grow up to M_n and no further": every(ends),
            "the upper gain margin of L is M_n": same(limits, gains, 1e-6),
            "the closed form of M_n agrees": same(
                [gain_bound(order) for order in range(1, 7)], gains, 1e-9
            ),
        },
    )
