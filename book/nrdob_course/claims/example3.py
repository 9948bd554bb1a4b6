"""Section IV: Example 3, an unstable process."""

from dataclasses import replace
from itertools import product
from math import pi, sqrt
from typing import Any

import numpy as np
from scipy.optimize import brentq

from nrdob import NRDOB, LowPassFilter, encirclements, largest_box, plant_family, sweep
from nrdob.diagram import Quotient
from nrdob.numerics import number
from nrdob.paper import PRINTED_FUNCTIONS, PrintedFunction, example
from nrdob.plotting import turns

from .ledger import Finding, counted, every, same
from .recurring import border, both, filtered, map_text, npz, npz_text, performance, section
from .signals import is_stable, turned

__all__ = ["SECTION"]

SECTION = section("example3")

PLANT = ([4], [-1, -1, 2])


@SECTION.check("ex3.matched_fails")
def _matched_fails() -> Finding:
    filters = [LowPassFilter(lam, n) for n in (2, 3, 4) for lam in (0.001, 0.03, 0.3, 3.0, 100.0)]
    ND = np.polymul(*PLANT)
    exact = [same(NRDOB(PLANT, PLANT, -2, F).p_B.q, np.polymul(ND, F.den), 1e-12) for F in filters]
    others = product([3.6, 4.4], [0.8, 1.1], [-1.9, -2.1])
    models = [([gain], -np.poly([pole, stable])) for gain, pole, stable in others]
    loops = [NRDOB(PLANT, model, -2, each) for model in (PLANT, *models) for each in filters]
    signs = all(loop.p_B.q[0] * loop.p_B.q[-1] < 0 for loop in loops)
    counts = [_unstable_roots(loop) or 0 for loop in loops]
    odd = [count % 2 == 1 for count in counts]
    return Finding(
        every(exact) and signs and every(odd),
        f"an odd number of roots in the right half plane, {number(min(counts))} or more, in "
        f"{counted(odd)} loops",
    )


def _unstable_roots(loop: NRDOB) -> float | None:
    return loop.stability().observer_loop.closed_loop_rhp


@SECTION.check("ex3.negative_gain")
def _negative_gain() -> Finding:
    poles = ([-1, -2], [-0.3, -5], [-2 + 3j, -2 - 3j], [-1, -2, -4])
    positive = [
        NRDOB(PLANT, ([gain], np.real(np.poly(chosen))), 0.01, LowPassFilter(lam, 3))
        for chosen in poles
        for gain in (0.1, 1.0, 30.0)
        for lam in (0.001, 0.03, 0.3, 3.0, 100.0)
    ]
    model = ([-1, 3], np.poly([-1, -1, -2]))
    with_zero = [NRDOB(PLANT, model, 0.1, LowPassFilter(lam, 2)) for lam in (0.01, 0.05, 0.2)]
    reversed_sign = [replace(x, model=([1, -3], x.model[1]), controller=-0.1) for x in with_zero]

    def odd(loops: list[NRDOB]) -> int:
        return sum((_unstable_roots(loop) or 0) % 2 == 1 for loop in loops)

    stable = all(map(is_stable, with_zero))
    paper, gain = example(3), with_zero[0].Gm.dc_gain
    works = paper.Gm.dc_gain < 0 and is_stable(paper)
    return Finding(
        not (stable and gain > 0),
        f"minimum-phase models of positive gain: unstable in {odd(positive)} of {len(positive)} "
        f"loops; Gm = (3 − s)/((s + 1)²(s + 2)), of DC gain {number(gain)}: "
        f"{'stable' if stable else 'not stable'} with n = 2, λ = 0.01, 0.05, 0.2 s",
        conditions={
            "minimum-phase models of positive gain are unstable": odd(positive) == len(positive),
            "with a zero on the right a positive gain is stable": stable and gain > 0,
            "with it a negative gain is unstable": odd(reversed_sign) == len(reversed_sign),
            "the model of Example 3 has a negative gain and is stable": works,
        },
    )


@SECTION.check("ex3.rotation")
def _rotation() -> Finding:
    ratio = example(3).ratio
    zeros = ratio.to_tf().zeros().real
    omega = np.tan(np.linspace(-1.57, 1.57, 2001))
    angle = np.unwrap(np.angle(ratio(1j * omega)))
    count = encirclements(ratio, 0.0)
    grows = (zeros < 0).all() and (np.diff(angle) > 0).all()
    once = round((angle[-1] - angle[0]) / (2 * pi), 2) == 1 and npz(count) == (-1, 1, 0)
    words = f"zero at {number(zeros[0], 4)}; {turns(count.encirclements, 0.0)}"
    return Finding(bool(grows and once), words)


@SECTION.check("ex3.smaller")
def _smaller() -> Finding:
    def loop(k: float, lam: float) -> NRDOB:
        return NRDOB(PLANT, ([-k], [1, 3, 2]), -1.8 / k, LowPassFilter(lam, 2))

    def largest(k: float) -> float:
        return (k + 2 - sqrt(k * k + 4)) / k

    exact = all(
        loop(k, factor * largest(k)).stability().observer_loop.stable is bool(factor < 1)
        for k in (0.1, 1.0, 3.9, 4.1, 8.0, 100.0)
        for factor in (0.01, 0.5, 0.999, 1.001, 2.0, 100.0)
    )
    louder = loop(8, 0.05)
    sizes = np.abs(louder.ratio(1j * np.geomspace(1e-3, 1e4, 201)))
    works = is_stable(louder) and bool(sizes.max() < 1)
    return Finding(
        not works,
        f"with Gm = −8/(s² + 3s + 2), |G/Gm| is {number(sizes.max(), 4)} and the loop "
        f"{'stable' if works else 'not stable'} at λ = 0.05 s; the border is "
        f"{number(largest(8), 4)} s",
        conditions={
            "stable exactly for λ below the border, whatever k": exact,
            "the larger model of k = 8 is stable": works,
        },
    )


@SECTION.check("eq11")
def _model() -> Finding:
    loop = example(3)
    poles, gain = loop.Gm.to_tf().poles().real, loop.Gm.dc_gain
    zeros = loop.ratio.to_tf().zeros().real
    return Finding(
        bool(poles.max() < 0 and gain < 0 and zeros.max() < 0),
        f"poles {' and '.join(number(p, 4) for p in sorted(poles))}, DC gain {number(gain, 4)}, "
        f"zero of the ratio {number(zeros[0], 4)}",
    )


@SECTION.check("fig10")
def _figure_10() -> Finding:
    loop = example(3)
    count, zeros = encirclements(loop.ratio, 1.0), loop.H.numerator.roots
    own = loop.H.to_tf().zeros().real
    words = f"{npz_text(count)}; the zero of H is at {number(own[0], 4)}"
    return Finding(npz(count) == (-1, 1, 0) and bool(np.all(zeros.real < 0)), words)


@SECTION.check("fig10.caption")
def _caption_10() -> Finding:
    loop = example(3)
    caption = Quotient((*loop.C.num, *loop.Gm.den), (*loop.C.den, *loop.Gm.num), "C/Gm")
    by_caption, by_text = (encirclements(q, 1.0).encirclements for q in (caption, loop.ratio))
    words = f"C/Gm makes {turns(by_caption, 1.0)}, G/Gm {turns(by_text, 1.0)}"
    met = {"G/Gm encircles +1 once counter-clockwise": by_text == -1}
    return Finding(by_caption == -1, words, conditions=met)


@SECTION.check("eq14")
def _equation_14() -> Finding:
    loop, printed = example(3), PRINTED_FUNCTIONS["ex3.H"]
    other = PrintedFunction(tuple(-c for c in printed.num), printed.den, 0.0, printed.place)
    s = np.array([2.0, 0.5 + 3j, -4j])
    by_definition = np.allclose(loop.H(s), loop.G(s) / loop.Gm(s) - 1, rtol=1e-12)
    with_printed = np.polyadd(np.polymul(printed.den, loop.filter.den), printed.num)
    root = np.roots(with_printed).real.max()
    return Finding(
        printed.agrees_with(loop.H),
        f"{map_text(loop.H)}; the printed sign would give p_B a root at +{number(root, 4)}",
        conditions={
            "H has the other sign": other.agrees_with(loop.H),
            "H is G/Gm − 1": by_definition,
            "the printed sign would give p_B an unstable root": root > 0,
        },
    )


@SECTION.check("fig11")
def _figure_11() -> Finding:
    loop = example(3)
    count, zero = encirclements(loop.H), loop.ratio.to_tf().zeros().real
    words = f"{npz_text(count)}; 1 + H has its zero at {number(zero[0], 4)}"
    return Finding(npz(count) == (-1, 1, 0) and bool(np.all(zero < 0)), words)


@SECTION.check("ex3.fast")
def _fast_enough() -> Finding:
    loop, largest = example(3), 3 - sqrt(5)
    crossing = border(loop, 2, 0.5, 1.0)
    factors = (1e-4, 0.001, 0.01, 0.1, 0.5, 0.9, 0.9999, 1.0001, 1.1, 2.0, 10.0, 100.0, 1e3, 1e4)
    exact = all(filtered(loop, k * largest, 2).stability().stable is (k < 1) for k in factors)
    words = f"with n = 2 stable exactly for 0 < λ < 3 − √5 = {number(crossing, 5)} s"
    return Finding(exact and abs(crossing - largest) < 1e-9, words)


@SECTION.check("ex3.critical_point")
def _critical_point() -> Finding:
    loops = [filtered(example(3), lam, 2) for lam in (0.01, 0.05, 0.5, 1.0, 5.0)]
    loops += [filtered(example(4), lam, 3) for lam in (0.005, 0.01, 0.02, 0.09, 0.9)]
    verdicts = [loop.stability().observer_loop.stable for loop in loops]

    def decides(point: float) -> int:
        counts = [encirclements(loop.FH, point) for loop in loops]
        said = [count.encirclements == -count.open_loop_rhp for count in counts]
        return sum(one is other for one, other in zip(said, verdicts, strict=True))

    right, wrong = decides(-1.0), decides(1.0)
    return Finding(
        wrong == len(loops),
        f"encirclements of −1 give the verdict in {right} of {len(loops)} loops, of +1 in {wrong}",
        conditions={"encirclements of −1 tell every verdict": right == len(loops)},
    )


@SECTION.check("eq15")
def _filter_of_example_3() -> Finding:
    loop = example(3)
    part, end = loop.stability().observer_loop, abs(loop.F(1e8j) / loop.Gm(1e8j))
    words = f"p_B rightmost {number(part.rightmost.real, 4)}; |F/Gm| tends to {number(end, 4)}"
    return Finding(part.stable is True and bool(np.isclose(end, 400, rtol=1e-6)), words)


@SECTION.check("fig12")
def _figure_12() -> Finding:
    loop = example(3)
    part = loop.stability().observer_loop
    omega = 1e4 * np.tan(np.linspace(-1.57, 1.57, 200_001)) / np.tan(1.57)
    along = turned(1 + loop.FH(1j * omega))
    words = f"{npz_text(part)}; {number(along, 3)} encirclements along the curve"
    return Finding(npz(part) == (-1, 1, 0) and round(along, 3) == -1, words)


@SECTION.check("ex3.performance")
def _performance() -> Finding:
    found, nominal = performance(3, times=3.0), example(3)
    plants = ([4], np.polymul([-1, -1, 2], [0.1, 1])), ([2], [-1, -1, 2])
    pole_alone, gain_alone = (replace(nominal, process=plant).stability() for plant in plants)
    right = pole_alone.observer_loop.closed_loop_rhp
    return Finding(
        found.as_printed and pole_alone.stable is True,
        f"{found.computed}; with the pole alone {right} roots in the right half plane",
        found.tolerance,
        conditions={
            **found.conditions,
            "the pole alone leaves two unstable roots": right == 2,
            "the gain alone is stable": gain_alone.stable is True,
        },
    )


@SECTION.check("ex3.family")
def _family_3() -> Finding:
    loop = example(3)
    plants = plant_family(loop.process, gain=(0.5, 1.0), lag=(0.0, 0.1), grid=21)
    table = sweep(loop, plants, "stable")
    routh = _routh(table["gain"], table["lag"]) > 0
    lost = largest_box(loop, gain=(0.5, 1.0), lag=(0.0, 0.1)).critical or {}
    longest = float(brentq(lambda T: float(_routh(1.0, T)), 0.05, 0.1))
    highest = float(brentq(lambda k: float(_routh(k, 0.1)), 0.6, 1.0))

    def stable(gain: float, lag: float) -> bool:
        plant = ([4 * gain], np.polymul([-1, -1, 2], [lag, 1]))
        return is_stable(replace(loop, process=plant))

    sides = [stable(1, k * longest) for k in (0.999, 1.001)]
    sides += [stable(k * highest, 0.1) for k in (0.999, 1.001)]
    count = int((~table["stable"]).sum())
    limited = bool(abs(lost.get("lag", 0.0) - longest) < 1e-6 and abs(longest - 0.08775) < 1e-5)
    return Finding(
        count == 0,
        f"unstable with {count} of {len(table)} plants; at full gain the lag must be below "
        f"{number(longest, 4)} s, at the full lag the gain below {number(highest, 4)}",
        conditions={
            "the nominal and the modified loop are stable": every(map(is_stable, both(3))),
            "verdicts are those of Routh's condition": np.array_equal(routh, table["stable"]),
            "the lag is limited to 0.08775 s at full gain": limited,
            "the gain is limited to 0.9427 at the full lag": abs(highest - 0.9427) < 1e-4,
            "the loop is lost just beyond both limits": sides == [True, False, True, False],
        },
    )


def _routh(k: Any, T: Any) -> Any:
    """Routh's condition for (s − 1)(Ts + 1)(λ²s² + 2λs) + 4k(s + 1), positive where it holds."""
    lam = 0.05
    a4, a3, a2 = T * lam**2, (1 - T) * lam**2 + 2 * lam * T, 2 * lam * (1 - T) - lam**2
    a1, a0 = 4 * k - 2 * lam, 4 * k
    return a1 * (a2 * a3 - a1 * a4) - a0 * a3**2


@SECTION.check("ex3.overparametrise")
def _overparametrise() -> Finding:
    def stable(g: float, lam: float, n: int, lags: int = 2) -> bool:
        loop = _overparametrised(g, lags)
        return filtered(loop, lam, n).stability().observer_loop.stable is True

    g_2 = _overparametrised(2)
    low, high = border(g_2, 4, 0.005, 0.02), border(g_2, 4, 0.2, 0.4)
    scan = np.geomspace(1e-4, 100, 25)
    interval = [stable(2, lam, 4) for lam in scan] == [bool(low < lam < high) for lam in scan]
    edges = [stable(2, lam, 4) for lam in (0.999 * low, 1.001 * low, 0.999 * high, 1.001 * high)]
    none = not any(stable(10, lam, n) for lam in scan for n in (4, 5, 6))
    third = all(stable(g, lam, 3, lags=1) for g in (2, 10) for lam in (1e-4, 1e-3))
    fast = any(stable(g, lam, n) for g in (2, 10) for lam in (1e-4, 1e-3) for n in (4, 5))
    return Finding(
        not none and fast,
        f"n = 4, g = 2: stable for {number(low, 4)} < λ < {number(high, 4)} s only; g = 10: for "
        f"{'no' if none else 'some'} λ of the scan, n = 4, 5, 6",
        conditions={
            "g = 2, n = 4: the good λ are an interval": interval,
            "it ends at these two λ": edges == [False, True, True, False],
            "g = 10: there are no good λ": none,
            "fast filters stabilise for n = 3": third,
            "fast filters fail for n ≥ 4": not fast,
        },
    )


def _overparametrised(g: float, lags: int = 2) -> NRDOB:
    """Plant −g/((s−1)(s+2)^lags); the model has the poles −1 and −10 instead of +1."""
    shared = [-2] * lags
    model = ([-1], np.poly([-1, -10, *shared]) / 10)
    return NRDOB(([-g], np.poly([1, *shared])), model, -1, LowPassFilter(0.1, 2 + lags))
