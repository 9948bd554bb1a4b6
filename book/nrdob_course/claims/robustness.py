"""Lemma 2 and Corollary 1: robustness, and the perfect model."""

from dataclasses import replace
from math import inf

import control as ct
import numpy as np

from nrdob.analysis import Margins
from nrdob.design import gain_bound
from nrdob.diagram import Fraction, LowPassFilter
from nrdob.loop import NRDOB
from nrdob.numerics import number
from nrdob.paper import example
from nrdob.sampling import random_block

from .ledger import Finding, counted, every, numbers, same
from .recurring import both, section
from .signals import critical_gain, in_right_half, is_stable, modes

__all__ = ["SECTION"]

SECTION = section("robustness")

_s = ct.tf("s")


@SECTION.check("lemma2.i")
def _margins_without_the_process() -> Finding:
    loop = example(3)
    process = 4 / ((2 - _s - _s**2) * (0.1 * _s + 1))
    lagging = replace(loop, process=process)
    pm = [case.margins().model_loop.pm for case in (loop, lagging)]
    fixed, shaped = [], []
    for which in (2, 3, 4):
        nominal, modified = both(which)
        fixed.append(_equal(nominal.margins().model_loop, modified.margins().model_loop))
        scaled = [replace(nominal, controller=k * nominal.controller) for k in (0.5, 1.0, 2.0)]
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
            "Example 3 is stable": is_stable(loop),
            "with the lag it is not": verdict.stable is False,
            "the phase margin of C Gm stays what it was": pm[0] == pm[1],
            "margins of C Gm are free of G, those of L of C": every(fixed),
            "C shapes the crossover of C Gm": every(shaped),
        },
    )


def _equal(one: Margins, other: Margins) -> bool:
    return np.allclose(list(one), list(other), rtol=1e-9, equal_nan=True)


@SECTION.check("lemma2.ii")
def _margins_of_the_mismatch() -> Finding:
    texts: list[str] = []
    inside: dict[str, list[bool]] = {"FH": [], "L": []}
    outside: list[bool] = []
    for loop in map(example, (2, 3, 4)):
        margins = loop.margins()
        ranges = {"FH": margins.observer_loop, "L": margins.plant_loop}
        said = (f"{number(m.gm_low, 4)} to {number(m.gm_high, 5)}" for m in ranges.values())
        texts.append(" against ".join(said))
        for name, range_ in ranges.items():
            ends = [(range_.gm_low, 1.001)] if range_.gm_low else []
            ends += [(range_.gm_high, 0.999)] if range_.gm_high < inf else []
            inside[name] += [_with_gain(loop, end * inwards) for end, inwards in ends]
            if name == "L":  # only the true range may, and must, end there
                outside += [_with_gain(loop, end * (2 - inwards)) for end, inwards in ends]
    return Finding(
        every(inside["FH"]),
        f"gain factors that FH and the process allow in Examples 2 to 4: {'; '.join(texts)}",
        conditions={
            "the range of L is that of the process": every(inside["L"]) and not any(outside)
        },
    )


def _with_gain(loop: NRDOB, gain: float) -> bool:
    """Whether the loop is stable with so many times the process."""
    return is_stable(replace(loop, process=gain * loop.process))


# Corollary 1.


@SECTION.check("cor1.stable")
def _perfect_models() -> Finding:
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
        stable.append(bool(modes(*loop.fractions).real.max() < 0))
        factored.append(same(loop.p_B.q, np.convolve(np.convolve(num, den), F.den)))
    return Finding(
        every(stable) and every(factored),
        f"{counted(stable)} random loops that fulfil the conditions are stable; "
        f"p_B = N D Df in {sum(factored)}",
        "p_B: 1e-8 relative",
    )


@SECTION.check("cor1.necessary")
def _each_condition_dropped() -> Finding:
    one, F = np.ones(1), Fraction(np.ones(1), np.array([0.1, 1.0]))
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
            in_right_half(np.polyadd(np.convolve(G.den, C.den), np.convolve(G.num, C.num))) > 0,
            in_right_half(low_pass.den) > 0,
            *(bool((np.roots(part).real >= 0).any()) for part in (G.den, G.num)),
        ]
        for G, C, low_pass in cases.values()
    ]
    single = [sum(row) for row in dropped] == [0, *[1] * (len(cases) - 1)]
    return Finding(
        single and right.pop("none") < 0 and every(value >= 0 for value in right.values()),
        "rightmost mode with one condition dropped: "
        + ", ".join(f"{name} {number(value, 4)}" for name, value in right.items()),
    )


@SECTION.check("cor1.robust")
def _margins_of_a_perfect_model() -> Finding:
    first = example(1)
    other = 5 * (_s + 4) / ((_s + 1) * (_s + 2))
    limits, phases, same_margins, ends = [], [], [], []
    for order in range(1, 7):
        own = replace(first, model=first.process, filter=LowPassFilter(0.01, order))
        louder = replace(own, controller=2 * own.controller)
        loops = [own, louder, NRDOB(other, other, 1 / _s, LowPassFilter(0.3, order))]
        margins = [loop.margins().plant_loop for loop in loops]
        limits.append(margins[0].gm_high)
        phases.append(margins[0].pm)
        of_order = [phases[-1], limits[-1]]
        same_margins += [same([found.pm, found.gm_high], of_order, 1e-6) for found in margins]
        limit = critical_gain(order)
        for loop in loops[::2]:
            ends += [_with_gain(loop, k) for k in (1e-3, 0.999 * min(limit, 1e4))]
            ends.append(not _with_gain(loop, -0.1))
            ends += [not _with_gain(loop, 1.001 * limit)] if limit < inf else []
    gains = [*map(critical_gain, range(1, 7))]
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
            "the closed form of M_n agrees": same([*map(gain_bound, range(1, 7))], gains, 1e-9),
        },
    )
