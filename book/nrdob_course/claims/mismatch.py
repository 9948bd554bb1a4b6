"""What Section III says of the mismatch H, and of the three blocks."""

from collections.abc import Iterator
from itertools import product
from math import nan
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

from nrdob import NRDOB, LowPassFilter, encirclements
from nrdob.diagram import Fraction, Quotient
from nrdob.numerics import number
from nrdob.paper import EXAMPLES, example
from nrdob.plants import resonance

from .ledger import EXACT, TOLERANCE, Finding, counted, every, numbers, same
from .recurring import section
from .signals import (
    QUADRUPLES,
    Values,
    critical_gain,
    in_right_half,
    n_p,
    random_loops,
    random_points,
    rightmost,
    turns,
    turns_around_minus_one,
)

__all__ = ["SECTION"]

SECTION = section("mismatch")

_s = ct.tf("s")


def _observer(ratio: Any, model: Any, time_constant: float, order: int) -> NRDOB:
    """Give a loop by its ratio G/Gm; the controller does not matter."""
    return NRDOB(ratio * model, model, 0.0, LowPassFilter(time_constant, order))


@SECTION.check("sec3.rhp_zeros")
def _a_zero_that_no_filter_survives() -> Finding:
    with_zero, without = 1 + 4 * (_s - 1) / (_s - 2), 1 + 4 * (_s + 1) / (_s - 2)
    model = 1 / (_s + 1)
    tried = list(product(np.geomspace(1e-3, 1e3, 21), (1, 2, 3, 4)))
    loops = [_observer(with_zero, model, *filter) for filter in tried]
    counts = [in_right_half(loop.p_B.q) for loop in loops]
    parity = [
        same(1 + loop.FH(1.0), 1) and loop.p_B(1.0).real < 0 < loop.p_B(2.0).real for loop in loops
    ]
    saved = [in_right_half(_observer(without, model, *each).p_B.q) == 0 for each in tried]
    return Finding(
        min(counts) > 0 and any(saved) and every(parity),
        f"H = 4(s − 1)/(s − 2): {min(counts)} or more roots in the right half plane for all "
        f"{len(tried)} filters, p_B(1) < 0 < p_B(2) for {sum(parity)}; H = 4(s + 1)/(s − 2): no "
        f"such root for {sum(saved)} of them",
    )


@SECTION.check("sec3.Z_H")
def _zeros_of_the_mismatch() -> Finding:
    meets = [_meets_plus_one(example(which).ratio) for which in EXAMPLES]
    loops = [loop for loop in random_loops(60) if not _meets_plus_one(loop.ratio)]
    agree, improper = [], 0
    for loop in loops:
        excess = max(0, loop.ratio.numerator.degree - loop.ratio.denominator.degree)
        zeros = in_right_half(loop.H.numerator.q)
        agree.append(turns(loop.H, excess) + n_p(loop) == zeros)
        improper += excess > 0
    third = example(3)
    n_h, p_h = turns(third.H), n_p(third)
    z_h = in_right_half(third.H.numerator.q)
    undefined = [str(which) for which, met in zip(EXAMPLES, meets, strict=True) if met]
    return Finding(
        not any(meets) and every(agree),
        f"the plot meets +1, or circles through it for ever, in Examples {', '.join(undefined)}; "
        f"in Example 3 N_H = {number(n_h)}, P_H = {p_h}, Z_H = {z_h}; the formula holds for "
        f"{counted(agree)} random loops, {improper} of them with an arc at infinity",
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


@SECTION.check("sec3.slow_filter_always")
def _slowing_the_filter_down() -> Finding:
    tried = np.geomspace(1e-2, 1e5, 29)
    model = 1 / (_s + 1)
    cases = [((_s - 1) / (_s + 1), 1), (10 * (1 - 0.01 * _s) / (1 + 0.01 * _s), 3)]
    turning = [turns_around_minus_one(_observer(R, model, 1.0, n).H) for R, n in cases]
    stable = [sum(rightmost(_observer(R, model, lam, n)) < 0 for lam in tried) for R, n in cases]
    agree, wins = [], 0
    for loop in random_loops(60):
        for order in range(max(1, loop.Gm.denominator.degree - loop.Gm.numerator.degree), 5):
            slow = NRDOB(loop.process, loop.model, 0.0, LowPassFilter(1e5, order))
            rule = n_p(loop) == 0 and 0 < loop.ratio.dc_gain < critical_gain(order)
            agree.append((rightmost(slow) < 0) == rule)
            wins += rule
    return Finding(
        every(count > 0 for count in stable),
        f"(s − 1)/(s + 1), n = 1, and 10(1 − s/100)/(1 + s/100), n = 3: H encircles −1 "
        f"{numbers(turning)} times clockwise, and {numbers(stable)} of {tried.size} λ up to "
        f"10⁵ s are stable; the rule decides {counted(agree)} random cases, {wins} of "
        "them stable",
        conditions={
            "the rule decides": every(agree),
            "both verdicts occur": 0 < wins < len(agree),
            "H turns once clockwise in both cases": every(count == 1 for count in turning),
            "no filter is slow enough for them": not any(stable),
        },
    )


@SECTION.check("sec3.no_turns_no_filter")
def _turns_of_h_alone() -> Finding:
    plant = -(1 - 0.01 * _s) / ((_s - 1) * (_s + 2))
    first = NRDOB(plant, -1 / ((_s + 1) * (_s + 2)), 0.0, LowPassFilter(0.1, 2))
    model = 1 / (_s + 1) ** 3
    ratio = 10 * (_s + 1) / (_s - 1)
    others = [_observer(ratio, model, lam, 3) for lam in np.geomspace(1e-4, 1e4, 81)]
    no_turn, one_turn = _turns_of_h(first, excess=1), _turns_of_h(others[0])
    poles = [n_p(first), n_p(others[0])]
    root = rightmost(first)
    counts = [in_right_half(loop.p_B.q) for loop in others]
    stable = root < 0 and first.stability().observer_loop.stable is True
    return Finding(
        no_turn == -poles[0] or root >= 0,
        f"P_H = {poles[0]}, H encircles −1 {number(-no_turn)} times anticlockwise, and the "
        f"rightmost root is {number(root, 4)}; conversely P_H = {poles[1]}, H encircles −1 "
        f"{number(-one_turn)} times, and {min(counts)} or more roots are in the right half plane "
        f"for all {len(counts)} λ",
        conditions={
            "P_H = 1 in both cases": poles == [1, 1],
            "in the first H does not turn": no_turn == 0,
            "a filter stabilises it all the same": stable,
            "in the other H turns once anticlockwise": one_turn == -1,
            "no λ stabilises it": min(counts) > 0,
            "by Routh's conditions none can": every(_routh(loop.filter) for loop in others),
        },
    )


def _turns_of_h(loop: NRDOB, excess: int = 0) -> float:
    """Clockwise turns of H around −1, if the package counts what is followed; else nan."""
    followed = turns_around_minus_one(loop.H, excess)
    return followed if followed == encirclements(loop.H).encirclements else nan


def _routh(F: LowPassFilter) -> bool:
    """Whether Routh's conditions for R = 10(s + 1)/(s − 1) are the stated ones, and fail."""
    quartic = np.polyadd(np.convolve([1, -1], np.polysub(F.den, [1])), [10, 10])
    a4, a3, a2, a1, _ = quartic
    value = F.time_constant
    condition = 3 * value**2 - 9 * value - 1
    stated = np.isclose(a3 * a2 - a4 * a1, value**3 * condition, rtol=1e-6, atol=1e-9 * a4)
    return bool(stated) and (a2 > 0) == (value < 1) and not (value < 1 and condition > 0)


@SECTION.check("sec3.three_dof")
def _three_blocks_two_freedoms() -> Finding:
    rng = np.random.default_rng(9)
    v = Values.random(rng)
    G, Gm, C, F = v
    K, V = F / ((1 - F) * Gm), C / ((1 + C * Gm) * (1 - F))
    other = Values.random(rng).Gm
    F_other = K * other / (1 + K * other)
    C_other = V * (1 - F_other) / (1 - V * (1 - F_other) * other)
    replaced = Values(G, other, C_other, F_other)
    R, d, delta, eta = Values.random(rng)  # four more random numbers each
    before, after = (case.solve(R, d, delta, eta) for case in (v, replaced))
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


def _normalised_loops() -> list[NRDOB]:
    rng = np.random.default_rng(13)
    pairs = [_normalised(rng) for _ in range(40)]
    return [NRDOB(G, Gm, 0.0, LowPassFilter(1.0, max(1, Gm.relative_degree))) for G, Gm in pairs]


@SECTION.check("sec3.H_zero")
def _equal_gains_at_zero() -> Finding:
    loops = _normalised_loops()
    small = np.array([np.abs(loop.H(1j * np.array([1e-3, 1e-6]))) for loop in loops])
    at_zero = [abs(loop.H.dc_gain) < EXACT for loop in loops]
    shrinks = small[:, 1] < 2e-3 * small[:, 0]
    return Finding(
        every(at_zero) and every(shrinks),
        f"H(0) = 0 for {sum(at_zero)} of {len(loops)} random pairs, and |H(jω)| falls with ω "
        f"for {shrinks.sum()}",
        TOLERANCE,
    )


@SECTION.check("sec3.M")
def _ratio_at_high_frequency() -> Finding:
    right, vanish = [], []
    for loop in _normalised_loops():
        G, Gm, *_ = loop.fractions
        M = G.num[0] * Gm.den[0] / (Gm.num[0] * G.den[0])
        right.append(abs(loop.ratio(1e9j) / M - 1) < 1e-6 and same(loop.ratio.at_infinity[0], M))
        den = np.append(Gm.den[0] / M, Gm.den[1:])
        equal = NRDOB(loop.process, Fraction(Gm.num, den), 0.0, loop.filter)
        vanish.append(abs(equal.H(1e9j)) < 1e-6)
    return Finding(
        every(right) and every(vanish),
        f"the limit is M for {counted(right)} random pairs, and H(∞) = 0 for {counted(vanish)} "
        "with M = 1",
        "1e-6 at ω = 10⁹ rad/s",
    )


@SECTION.check("sec3.speculation")
def _plots_of_small_mismatches() -> Finding:
    def resonant(time_constant: float) -> NRDOB:
        F = LowPassFilter(time_constant, 2)
        return NRDOB(resonance(0.9, 0.01), resonance(1.0, 0.01), 0.0, F)

    real = resonant(1.0).H(1j * np.linspace(0.5, 1.5, 4001)).real
    low, high = (
        float(np.exp(brentq(lambda x: rightmost(resonant(float(np.exp(x)))), *np.log(within))))
        for within in ((0.01, 0.3), (0.3, 100.0))
    )
    ends = (0.99 * low, 1.01 * low, 0.99 * high, 1.01 * high)
    exchanged, left = _exchanged()
    small = list(_small_mismatches())
    return Finding(
        real.min() >= 0 and not any(left),
        f"resonance 10 % off: Re H from {number(real.min(), 4)} to {number(real.max(), 4)}, "
        f"unstable for λ from {number(low, 4)} to {number(high, 4)} s; {counted(left)} "
        "random pairs within 1 % leave the right half plane in one order or the other; "
        f"{counted(small)} loops with |H| < 0.96 are stable",
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
        F = LowPassFilter(1.0, max(1, G.relative_degree))
        one, other = (NRDOB(*pair, 0.0, F).H(s).real for pair in ((G, near), (near, G)))
        opposite.append(every(other[one > 0] < 0) if (one > 0).any() else every(one <= 0))
        left.append(bool(min(one.min(), other.min()) < 0))
    return opposite, left


def _small_mismatches() -> Iterator[bool]:
    """Whether random loops with D and Nm Hurwitz and |H| < 0.96 are stable."""
    rng = np.random.default_rng(19)
    grid = 1j * np.append(0.0, np.geomspace(1e-3, 1e4, 401))
    for _ in range(8):
        den = np.poly(-rng.uniform(0.2, 5, 3))
        num = rng.normal(size=3 + int(rng.integers(0, 2)))
        num = num * 0.95 / np.abs(np.polyval(num, grid) / np.polyval(den, grid)).max()
        process = np.polyadd(den, num), np.convolve(den, [1.0, 1.0])
        for order, value in product((1, 2, 3, 4), np.geomspace(1e-2, 1e2, 5)):
            loop = NRDOB(process, ([1.0], [1.0, 1.0]), 0.0, LowPassFilter(value, order))
            yield bool(np.abs(loop.H(grid)).max() < 0.96) and rightmost(loop) < 0


@SECTION.check("sec3.any_bandwidth")
def _right_half_plane_mismatch() -> Finding:
    model = 1 / (_s + 1)
    hump, step = 10 * _s / ((_s + 0.01) * (_s + 1)), 49 * _s / (_s + 1)
    second = [_observer(1 + hump, model, value, 2) for value in (1e-3, 1.0, 1e3)]
    third = [_observer(1 + step, model, value, 3) for value in (0.1, 10.0)]

    def at_border(value: float) -> float:
        return rightmost(_observer(1 + step, model, value, 3))

    border = float(brentq(at_border, 0.1, 10.0))
    within = [_in_the_right(loop) for loop in (second[0], third[0])]
    roots = [rightmost(loop) for loop in second]
    first_order = [
        _in_the_right(loop) and rightmost(loop) < 0
        for H in _positive_real(12)
        for value in np.geomspace(1e-3, 1e3, 9)
        if (loop := _observer(1 + H, model, value, 1))
    ]
    between = [root < 0 for root in roots] == [True, False, True]
    slow_only = [rightmost(loop) < 0 for loop in third] == [False, True]
    lost = at_border(0.999 * border) > 0 > at_border(1.001 * border)
    return Finding(
        every(root < 0 for root in roots) and every(rightmost(loop) < 0 for loop in third),
        f"H = 10s/((s + 0.01)(s + 1)), n = 2: rightmost root {number(roots[1], 4)} for λ = 1 s; "
        f"H = 49s/(s + 1), n = 3: stable from λ = {number(border, 5)} s on; n = 1: "
        f"{counted(first_order)} loops with a random positive real H are stable",
        conditions={
            "both H stay in the right half plane, G and Gm stable and minimum phase": every(within),
            "n = 2 is unstable for λ = 1 s, and neither much faster nor much slower": between,
            "n = 3 is stable for the slow filter only": slow_only,
            "n = 3 is lost at the border": lost,
            "n = 1 is stable with every λ": every(first_order),
        },
    )


def _positive_real(count: int) -> Iterator[ct.TransferFunction]:
    """Draw sums of three lags or their complements, none of which leaves the right half plane."""
    rng = np.random.default_rng(23)
    for _ in range(count):
        weights, poles = rng.uniform(0, 10, 3), 10 ** rng.uniform(-2, 2, 3)
        terms = zip(weights, poles, rng.integers(0, 2, 3), strict=True)
        yield sum(weight * (_s if high else pole) / (_s + pole) for weight, pole, high in terms)


def _in_the_right(loop: NRDOB) -> bool:
    """Whether Re H ≥ 0 on the axis, with G and Gm stable and minimum phase."""
    H = loop.H(1j * np.append(0.0, np.geomspace(1e-5, 1e5, 401)))
    parts = (loop.G.numerator, loop.G.denominator, loop.Gm.numerator, loop.Gm.denominator)
    in_the_left = all((np.roots(part.q).real < 0).all() for part in parts)
    return in_the_left and bool((H.real >= -EXACT * np.abs(H)).all())
