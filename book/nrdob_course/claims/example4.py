"""Section IV: Example 4, a process with dead time."""

from dataclasses import replace
from itertools import product
from math import exp, inf, log1p, pi

import numpy as np

from nrdob import NRDOB, LowPassFilter, encirclements, largest_box, plant_family, sweep
from nrdob.analysis import minus_point
from nrdob.diagram import DelayedTransferFunction, Quotient
from nrdob.numerics import QuasiPolynomial, count_rhp, number
from nrdob.paper import example
from nrdob.plotting import turns

from .ledger import Finding, same
from .recurring import OMEGA, border, filtered, inverse_degree, npz, npz_text, section
from .signals import is_stable

__all__ = ["SECTION"]

SECTION = section("example4")


@SECTION.check("ex4.model_delay")
def _model_delay() -> Finding:
    theta = 0.05

    def size(s: float, lam: float, n: int) -> float:  # log of |F(s) exp(θs)|, s > 0
        return theta * s - n * log1p(lam * s)

    grows = all(
        size(1e6, lam, n) > 1000 and size(1e7, lam, n) > 5 * size(1e6, lam, n)
        for n in range(1, 7)
        for lam in (1e-3, 0.01, 0.09, 1.0, 100.0)
    )
    loop = example(4)
    inverse = loop.filter(1e4) / loop.process.tf(1e4)
    left_out = abs(replace(loop, model=loop.process).K(1e4) / inverse - 1) < 1e-12
    x = theta / 0.09
    early = 1 - exp(-x) * (1 + x + x**2 / 2)
    return Finding(
        grows and left_out,
        f"F exp(0.05s) of eq. (16) is {number(exp(size(1000.0, 0.09, 3)), 4)} at s = 1000 and "
        f"grows without bound; {number(100 * early, 4)} % of its impulse response comes before "
        "t = 0",
    )


PAIRS = list(product([(n, m) for n in range(1, 4) for m in range(n + 1)], repeat=2))
"""Degrees (n, m) of plant and model, 0 ≤ m ≤ n ≤ 3, n ≥ 1."""


def _relative_degree(plant: tuple[int, int], model: tuple[int, int]) -> int:
    """Measure the relative degree of G/Gm from its size at two high frequencies."""
    G, Gm = (
        (np.poly(-1.0 - np.arange(m)), np.poly(-1.5 - np.arange(n))) for n, m in (plant, model)
    )
    ratio = NRDOB(G, Gm, 1, LowPassFilter(1.0, 3)).ratio
    return round(float(np.log10(abs(ratio(1e7j)) / abs(ratio(1e8j)))))


@SECTION.check("ex4.relative_degree")
def _ratio_degree() -> Finding:
    measured = [_relative_degree(*pair) for pair in PAIRS]
    printed = [n * m1 - n1 * m for (n, m), (n1, m1) in PAIRS]
    subtracted = [(n - m) - (n1 - m1) for (n, m), (n1, m1) in PAIRS]

    def agree(formula: list[int]) -> int:
        return sum(a == b for a, b in zip(formula, measured, strict=True))

    return Finding(
        agree(printed) == len(PAIRS),
        f"the printed formula holds for {agree(printed)} of {len(PAIRS)} pairs of blocks, the "
        f"difference for {agree(subtracted)}",
        conditions={"relative degrees subtract": agree(subtracted) == len(PAIRS)},
    )


@SECTION.check("ex4.order_causal")
def _order_causal() -> Finding:
    measured = {pair: _relative_degree(*pair) for pair in PAIRS}
    lower = [measured[pair] for pair in PAIRS if pair[1][0] < pair[0][0]]
    higher = [measured[pair] for pair in PAIRS if pair[1][0] > pair[0][0]]
    failing = sum(degree <= 0 for degree in lower)
    failing_too = sum(degree >= 0 for degree in higher)
    rule = all((value >= 0) == (n - m >= n1 - m1) for ((n, m), (n1, m1)), value in measured.items())
    case = measured[(3, 2), (2, 0)]
    return Finding(
        failing + failing_too == 0,
        f"of {len(lower)} pairs with ñ < n {failing} fail, of {len(higher)} with n < ñ "
        f"{failing_too}; n = 3, m = 2, ñ = 2, m̃ = 0 gives relative degree {number(case)}",
        conditions={
            "causal if and only if n − m ≥ ñ − m̃": rule,
            "a model of lower order makes it improper": case < 0,
        },
    )


@SECTION.check("ex4.infinite_turns")
def _infinite_turns() -> Finding:
    loops = [_late([4, 4], [1.5]), example(4), _late([2], [4, 3.75])]
    own = [encirclements(loop.H) for loop in loops]
    time_constants = (1.0, 1e-2, 1e-3, 1e-4)
    faster = [[filtered(loop, lam, 3).FH for lam in time_constants] for loop in loops]
    right = [[encirclements(FH).closed_loop_rhp or 0 for FH in row] for row in faster]
    small = zip(loops, (1e-3, 1e-3, 1e-2), strict=True)
    second = [filtered(loop, lam, 3).stability().observer_loop.stable for loop, lam in small]
    for_ever = [*map(npz, own)] == 3 * [(inf, 0, 0)]
    return Finding(
        all(count.encirclements == inf and (count.closed_loop_rhp or 0) > 0 for count in own),
        f"1 + H: {npz_text(own[1])}; p_B of Example 4: Z = "
        f"{', '.join(number(z) for z in right[1])} for λ = 1, 0.01, 0.001, 0.0001 s",
        conditions={
            "H turns for ever, and 1 + H has no zero on the right": for_ever,
            "p_B has unstable roots for small λ only": all(row[0] == 0 < row[2] for row in right),
            "they are ever more as λ → 0": all(row == sorted(row) for row in right),
            "the loops with small λ are judged unstable": second == [False] * 3,
        },
    )


def _late(den: list[float], model_den: list[float], num: list[float] | None = None) -> NRDOB:
    """Plant num/(s^n + den) with a dead time of 0.05 s, model 1/(s^n + model_den), order 3."""
    plant = DelayedTransferFunction((num or [1.0], [1.0, *den]), 0.05)
    return NRDOB(plant, ([1.0], [1.0, *model_den]), 1, LowPassFilter(0.1, 3))


@SECTION.check("ex4.noncausal_order")
def _noncausal_order() -> Finding:
    plant, holds, ends = ([1.0, 1.0], [1.0, 2.0]), True, []
    for m, den in ((2, [4.0, 3.0]), (3, [6.0, 11.0, 6.0])):
        loop = _late(plant[1][1:], den, num=plant[0])
        above = [filtered(loop, 20.0, m + k) for k in (1, 2)]
        holds &= all(other.FH.at_infinity == (0, 0) for other in above)
        holds &= all(other.stability().observer_loop.kind == "retarded" for other in above)
        holds &= all(map(is_stable, above))
        equal = filtered(loop, 0.5, m)
        ends.append(abs(equal.FH.at_infinity[1]))
        holds &= equal.stability().observer_loop.kind == "neutral"
        holds &= ends[-1] > 1 and equal.stability().observer_loop.closed_loop_rhp == inf
        # With order m - 1 F/Gm is improper: p_B can be written down, but not built.
        q = np.polymul(plant[1], np.polysub(LowPassFilter(0.5, m - 1).den, [1.0]))
        advanced = QuasiPolynomial(q, np.polymul(plant[0], [1.0, *den]), loop.delay)
        holds &= advanced.neutral_ratio == inf and count_rhp(advanced).count == inf
    return Finding(
        bool(holds),
        "one or two orders above m = 2 and 3 are stable with λ = 20 s; order m is neutral: |FH| "
        f"tends to {number(ends[0], 4)} and {number(ends[1], 4)} with λ = 0.5 s, which leaves "
        "infinitely many roots in the right half plane",
    )


@SECTION.check("ex4.radius")
def _radius() -> Finding:
    loop = example(4)
    size = np.abs(loop.ratio(1j * np.append(0.0, OMEGA)))
    gains = (0.5, 1.0, 2.0)
    limits = [replace(loop, process=k * loop.process).ratio.at_infinity[1] for k in gains]
    far = abs(loop.ratio(1e7j))
    return Finding(
        bool(np.allclose(size, 1, rtol=1e-3)) and all(abs(v) == 1 for v in limits),
        f"|G/Gm| is {number(size[0], 4)} at ω = 0, at most {number(size.max(), 5)}, and tends to "
        f"{number(far, 4)}; to {number(limits[2], 4)} with twice the plant's gain",
        conditions={
            "|G/Gm| tends to 1 in Example 4": bool(np.isclose(far, 1, rtol=1e-9)),
            "it tends to the ratio of the leading gains": same(limits, gains, 1e-12),
        },
    )


def _endless(loop: Quotient, point: float) -> Finding:
    """Find whether a map encircles a point infinitely often, and how often up to 10 000 rad/s."""
    omega = np.linspace(0, 1e4, 100_001)
    angle = np.unwrap(np.angle(loop(1j * omega) - point))
    half, full = (-angle[k] / pi for k in (50_000, 100_000))  # both halves of the curve together
    endless = encirclements(loop, point).encirclements == inf
    steady = abs(full / half - 2) < 0.01 and abs(full - 1e4 * 0.05 / pi) < 1
    return Finding(
        endless and bool(steady),
        f"{turns(inf, point)}; {number(half, 4)} of them up to 5000 rad/s, {number(full, 4)} up to "
        "10 000 rad/s",
    )


SECTION.check("fig15a")(lambda: _endless(example(4).ratio, 0.0))
SECTION.check("fig15b")(lambda: _endless(example(4).H, -1.0))


@SECTION.check("eq16")
def _filter_of_example_4() -> Finding:
    loop = example(4)
    part = loop.stability().observer_loop
    smallest = border(loop, 3, 0.0125, 0.02)
    factors = (0.1, 0.5, 0.9, 0.99, 0.999, 1.001, 1.01, 1.1, 2.0, 10.0, 100.0, 1000.0)
    sides = all(filtered(loop, k * smallest, 3).stability().stable is (k > 1) for k in factors)
    degree = inverse_degree(loop)
    return Finding(
        part.stable is True and sides and smallest < 0.09 and degree >= 0,
        f"p_B rightmost {number(part.rightmost.real, 4)}; with n = 3 the loop is unstable below "
        f"λ = {number(smallest, 4)} s; F/Gm has relative degree {degree}",
    )


@SECTION.check("ex4.gain_margin")
def _gain_margin() -> Finding:
    loop = example(4)
    margins = loop.margins()
    by_FH, by_L = margins.observer_loop.gm, margins.plant_loop.gm

    def plant(k: float) -> bool | None:
        return replace(loop, process=k * loop.process).stability().stable

    def scaled(k: float) -> bool:
        return count_rhp(minus_point(loop.FH, -1 / k)).count == 0

    factors = (0.5, 0.99, 0.999)
    lost = all(plant(k) is False for k in (1.001 * by_L, 1.1 * by_L, 0.999 * by_FH))
    borne = all(scaled(factor * by_FH) for factor in factors)
    return Finding(
        all(plant(factor * by_FH) is True for factor in factors) and plant(1.001 * by_FH) is False,
        f"a factor on FH: {number(by_FH, 4)}; on the plant: {number(by_L, 4)}, that is "
        f"{number(margins.plant_loop.gm_db, 4)} dB",
        conditions={
            "the plant bears factors below the margin of L": all(plant(k * by_L) for k in factors),
            "it bears none above, though the margin of FH allows them": lost,
            "the mismatch bears factors below the margin of FH": borne,
            "it bears none above": not scaled(1.001 * by_FH),
        },
    )


@SECTION.check("ex4.family")
def _family_4() -> Finding:
    loop = example(4)
    plants = plant_family(loop.process, delay=(0.0, 0.05), lag=(0.0, 0.1), grid=21)
    table = sweep(loop, plants, "stable")
    corners = [replace(loop, process=plants[k]).stability().stable for k in (0, 20, 420, 440)]
    known = corners == 4 * [True]  # without a stable nominal plant there is no box around it
    share, wider = (
        largest_box(loop, delay=(0.0, 0.05 * times), lag=(0.0, 0.1 * times)).share if known else 0.0
        for times in (1, 7)
    )
    return Finding(
        known and bool(table["stable"].all()) and share == 1,
        f"stable with {int(table['stable'].sum())} of {len(table)} plants, and with the whole box; "
        f"of one seven times as large {number(100 * wider, 3)} % of the way to its sides",
    )
