"""Eq. (7) and Lemma 1: what makes the loop internally stable."""

from dataclasses import replace

import control as ct
import numpy as np

from nrdob.diagram import Fraction, LowPassFilter
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray, number
from nrdob.paper import example

from .ledger import EXACT, TOLERANCE, Finding, counted, every, numbers, same
from .recurring import printed_map, section
from .signals import (
    PRINTED_MAPS,
    QUADRUPLES,
    Values,
    in_right_half,
    loop_modes,
    many_loops,
    modes,
    n_p,
    random_loops,
    random_points,
    rightmost,
    turns_around_minus_one,
)

__all__ = ["SECTION"]

SECTION = section("lemma1")

_s = ct.tf("s")


@SECTION.check("eq07.E_R")
def _reference_to_error() -> Finding:
    finding = printed_map("E_R")
    v = Values.random(7)
    collapses = same(PRINTED_MAPS["E_R"](v), 1 / (1 + v.CGm))
    words = f"both are {'' if collapses else 'not '}1/(1 + C Gm), free of F and of the process"
    return Finding(finding.as_printed and collapses, f"{finding.computed}; {words}", TOLERANCE)


@SECTION.check("eq07.E_zero")
def _the_error_sees_no_disturbance() -> Finding:
    v = Values.random(7)
    solved = [v.solve(delta=1.0), v.solve(d=1.0), v.solve(eta=1.0)]
    zero = np.ravel([np.abs(x.e) < EXACT * (np.abs(x.u) + np.abs(x.y)) for x in solved])
    words = f"e is 0 against u and y in {counted(zero)} random solutions of the diagram"
    return Finding(every(zero), words, TOLERANCE)


@SECTION.check("eq07.U_d")
def _output_disturbance_to_control() -> Finding:
    by_d, by_eta = printed_map("U_d"), printed_map("U_eta")
    words = f"d: {by_d.computed}; η: {by_eta.computed}"
    return Finding(by_d.as_printed and by_eta.as_printed, words, TOLERANCE)


@SECTION.check("eq07.U_delta")
def _input_disturbance_to_control() -> Finding:
    v = Values.random(7)
    u = v.solve(delta=1.0).u
    printed = PRINTED_MAPS["U_delta"](v)
    agree = np.isclose(printed, u, rtol=EXACT, atol=0)
    plant_input = np.isclose(printed, u + 1, rtol=EXACT, atol=0)
    return Finding(
        every(agree),
        f"the printed formula is u in {agree.sum()} and u + δ in {counted(plant_input)} random "
        "solutions of the diagram",
        TOLERANCE,
        conditions={
            "the printed formula is (U + δ)/δ": every(plant_input),
            "it is so in the package, too": printed_map("U_delta").as_printed,
            "U/δ = −FG/(Gm + F(G − Gm))": same(u, -v.F * v.G / v.B),
        },
    )


# Lemma 1.


@SECTION.check("lemma1.polynomials")
def _rational_functions_not_polynomials() -> Finding:
    loops = many_loops()
    at = [Values.of(loop, np.array([3.0 + 0j, 1e9 + 0j])) for loop in loops]
    A, B = (np.abs(sizes) for sizes in ([1 + v.CGm for v in at], [v.B for v in at]))
    grows = [same(size, later) or later > 1e6 * size for size, later in (*A, *B)]
    are_roots = every(_modes_are_the_roots(loop) for loop in loops if not loop.delay)
    return Finding(
        every(grows),
        f"Examples 1 to 4: from s = 3 to 10⁹ the size of A goes from {numbers(A[:4, 0])} to "
        f"{numbers(np.round(A[:4, 1], 6))}; {counted(grows)} functions A and B of "
        f"{len(loops)} loops are constant or grow, as a polynomial must",
        conditions={
            "A = p_A/(Dm Dc), 1 + FH = p_B/(D Nm Df), and the diagram has their product": every(
                _factors(loop) for loop in loops
            ),
            "the modes are the roots of Df³ p_A p_B": are_roots,
        },
    )


def _factors(loop: NRDOB) -> bool:
    """Whether p_A and p_B are what the diagram gives, times the denominators."""
    s = random_points(np.random.default_rng(7))
    v = Values.of(loop, s)
    A, B = loop.p_A(s) / loop.CGm.denominator(s), loop.p_B(s) / loop.FH.denominator(s)
    return same(A, 1 + v.CGm) and same(B, 1 + v.FH) and same(np.linalg.det(v.equations()), A * B)


def _modes_are_the_roots(loop: NRDOB) -> bool:
    """Whether the modes of the whole diagram are the roots of Df³ p_A p_B."""
    s = random_points(np.random.default_rng(7))
    by_modes = np.prod(s[:, None] - loop_modes(loop), axis=1)
    by_roots = loop.F.denominator(s) ** 3 * loop.p_A(s) * loop.p_B(s)
    return same(by_modes / by_modes[0], by_roots / by_roots[0], rtol=1e-6)


@SECTION.check("lemma1.forms")
def _three_forms_of_b() -> Finding:
    v = Values.random(7)
    second = 1 + v.F * (v.G / v.Gm - 1)
    loops = [loop for loop in many_loops() if not loop.delay]
    vanish = [_vanishes_at_roots(loop) for loop in loops if not _shares(loop)]
    G = (1 - _s) / (_s + 2)
    shared = NRDOB(G, G, 0.1, LowPassFilter(0.1, 1))
    at = Values.of(shared, np.array([1.0 + 1e-9j]))  # at 1 itself G/Gm is 0/0
    first, third = np.round([abs(at.B[0]), abs(1 + at.FH[0])], 8)
    root = rightmost(shared)
    return Finding(
        (first < EXACT) == (third < EXACT),
        f"G = Gm = (1 − s)/(s + 2): at s = 1 the first form is {number(first, 4)}, the third "
        f"{number(third, 4)}, and p_B has the root {number(root, 4)}; in {counted(vanish)} "
        "loops that share nothing all forms vanish at every root of p_B",
        conditions={
            "the first form is Gm times the second": same(v.B, v.Gm * second),
            "the second form is the third": same(second, 1 + v.FH),
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
    v = Values.of(loop, loop.p_B.roots)
    first = np.abs(v.B) / (np.abs(v.Gm) + np.abs(v.F * (v.G - v.Gm)))
    third = np.abs(1 + v.FH) / (1 + np.abs(v.FH))
    return every(np.concatenate([first, third]) < 1e-5)


@SECTION.check("lemma1.H_forms")
def _three_forms_of_h() -> Finding:
    rng = np.random.default_rng(7)
    v = Values.random(rng)
    pairs = [(loop, random_points(rng)) for loop in many_loops()]
    agree = [_h_forms_agree(Values.of(loop, s), loop.H(s)) for loop, s in pairs]
    return Finding(
        _h_forms_agree(v, v.H) and every(agree),
        f"the three forms agree for {QUADRUPLES} random values of the blocks and, with the "
        f"package's H, for {counted(agree)} loops",
        TOLERANCE,
    )


def _h_forms_agree(v: Values, H: ComplexArray) -> bool:
    """Whether the three forms give H; the difference is compared with their terms."""
    ratio = v.G / v.Gm
    forms = np.array([ratio - 1, -(1 - ratio), (v.G - v.Gm) / v.Gm])
    return every((np.abs(forms - H) <= EXACT * (1 + np.abs(ratio))).ravel())


@SECTION.check("lemma1.sufficient")
def _what_lemma_1_does_not_see() -> Finding:
    unstable = 4 / (2 - _s - _s**2)
    in_b = NRDOB(unstable, unstable, -2.0, LowPassFilter(0.05, 2))
    in_a = NRDOB(-1 / (_s + 1), 1 / (_s - 1), (_s - 1) / (_s * (_s + 3)), LowPassFilter(2.0, 1))
    # Zeros of 1 + L after everything that cancels in L is gone.
    parts = [[ct.feedback(1, part.to_tf()) for part in (x.CGm, x.FH)] for x in (in_b, in_a)]
    seen = [np.concatenate([part.poles() for part in pair]).real.max() for pair in parts]
    true = [loop_modes(loop).real.max() for loop in (in_b, in_a)]
    loops = random_loops(60)
    stable = np.array([loop_modes(loop).real.max() < 0 for loop in loops])
    hurwitz = np.array([in_right_half(x.p_A.q) + in_right_half(x.p_B.q) == 0 for x in loops])
    # An unstable F = 1/(1 − 0.1s), for G = −Gm = −1/(s + 1).
    one, lag, den = np.ones(1), np.array([1.0, 1.0]), np.array([-0.1, 1.0])
    p_b = np.polysub(np.convolve(lag, np.polysub(den, one)), lag)
    blocks = (-one, lag), (one, lag), (one, one), (one, den)
    by_filter = modes(*(Fraction(*block) for block in blocks))
    ill_posed = replace(example(2), filter=LowPassFilter(0.01, 1))
    unstable_too = every(loop.stability().stable is False for loop in (in_b, in_a))
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
            "both loops with a cancellation have an unstable mode": min(true) > 0,
            "they are judged unstable": unstable_too,
            "p_B is Hurwitz under the unstable F": not in_right_half(p_b),
            "an unstable F brings an unstable mode": bool(by_filter.real.max() > 0),
            "the ill-posed loop gets no verdict": ill_posed.stability().stable is None,
        },
    )


def _condition_ii(loop: NRDOB) -> bool:
    """Whether all roots of p_B are in the open left half plane."""
    if loop.delay:
        return loop.stability().observer_loop.stable is True
    return bool(rightmost(loop) < -1e-9)


def _enough_turns(loop: NRDOB) -> bool:
    """Whether FH turns around −1 as often as Lemma 1 requires."""
    return turns_around_minus_one(loop.FH) == -n_p(loop)


def _is_pole(loop: NRDOB, root: complex) -> bool:
    """Whether |H| grows as its argument comes closer to `root`."""
    far, close = np.abs(loop.H(root + np.array([1e-6j, 1e-9j])))
    return bool(close > 100 * far > 0)


def _poles_and_zeros(loop: NRDOB) -> ComplexArray:
    return np.concatenate([loop.G.denominator.roots, loop.Gm.numerator.roots])


@SECTION.check("lemma1.H_poles")
def _poles_of_the_mismatch() -> Finding:
    before, after, stay = [], [], []
    for loop in map(example, (1, 2, 3)):
        roots, p_B = _poles_and_zeros(loop), loop.p_B
        gone = [root for root in roots if not _is_pole(loop, root)]
        before.append(roots.size)
        after.append(roots.size - len(gone))
        stay += [abs(p_B(root)) <= EXACT * np.polyval(p_B.scale, abs(root)) for root in gone]
    loops = random_loops(20) + random_loops(10, delayed=True)
    poles = [_is_pole(loop, root) for loop in loops for root in _poles_and_zeros(loop)]
    return Finding(
        before == after,
        f"Examples 1 to 3 have {numbers(before)} poles of G and zeros of Gm, of which "
        f"{numbers(after)} are poles of H; in random loops, where nothing is shared, "
        f"{counted(poles)} are",
        conditions={
            "where nothing is shared all are poles of H": every(poles),
            "those that cancel stay roots of p_B": every(stay),
        },
    )


@SECTION.check("lemma1.N_p")
def _turns_that_condition_ii_needs() -> Finding:
    rational = random_loops(80)
    delayed = [loop for loop in random_loops(40, delayed=True) if not any(loop.FH.at_infinity)]
    integrating = NRDOB(1 / _s, 1 / (_s + 0.1), 2.0, LowPassFilter(0.05, 1))
    agree = [_enough_turns(loop) == _condition_ii(loop) for loop in [*rational, *delayed]]
    hidden = NRDOB(1 / _s, 1 / _s, 2.0, LowPassFilter(0.05, 1), keep_factors=True)
    as_one = NRDOB(1 / _s, 1 / _s, 2.0, LowPassFilter(0.05, 1))
    notch = NRDOB(1 / (_s**2 + 1), 1 / (_s + 1) ** 2, 1.0, (_s**2 + 1) / (_s + 1) ** 4)
    G = 4 / (2 - _s - _s**2)
    matched = NRDOB(G, G, -2.0, LowPassFilter(0.05, 2))
    after = sum(_is_pole(matched, root) for root in _poles_and_zeros(matched) if root.real > 0)
    turned = turns_around_minus_one(matched.FH)
    stable = sum(_condition_ii(loop) for loop in [*rational, *delayed])
    passed = _enough_turns(integrating) and _condition_ii(integrating)
    return Finding(
        every(agree) and _enough_turns(hidden) == _condition_ii(hidden),
        f"encirclements and roots agree for {counted(agree)} random loops, of "
        f"which {stable} fulfil condition ii; G = Gm = 1/s has "
        f"{turns_around_minus_one(hidden.FH)} encirclements, N_p = {n_p(hidden)} and a root of p_B "
        f"at {number(rightmost(hidden))}; "
        f"G = Gm = 4/(2 − s − s²) has {turned} encirclements, N_p = {n_p(matched)} before and "
        f"{after} after cancellation, and a root at {number(rightmost(matched), 4)}",
        conditions={
            "turns and roots agree": every(agree),
            "both verdicts occur": 0 < stable < len(agree),
            "there are loops with dead time": len(delayed) > 0,
            "a pole on the axis, passed on its right, is no obstacle": passed,
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
