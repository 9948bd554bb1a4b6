"""Examples 1 (a matched model) and 2 (a zero left out of the model)."""

from dataclasses import replace
from math import cos, pi, tan

import control as ct
import numpy as np

from nrdob import NRDOB, LowPassFilter, encirclements, plant_family, sweep
from nrdob.analysis import minus_point
from nrdob.diagram import INPUTS
from nrdob.numerics import number
from nrdob.paper import example

from .ledger import Finding, same
from .recurring import both, filtered, inverse_degree, map_text, npz, performance, section, steps
from .signals import is_refused, is_stable, turned

__all__ = ["SECTION"]

SECTION = section("examples12")


@SECTION.check("ex1.F")
def _any_stable_filter() -> Finding:
    loop = example(1)
    filters = [LowPassFilter(lam, n) for n in (1, 2, 3, 4) for lam in np.geomspace(1e-3, 1e3, 8)]
    others = [
        ct.tf([0.1, 1], [0.01, 0.2, 1]),
        ct.tf([-0.5, 1], [1, 2, 1]),
        ct.tf([1], [1, 0.1, 1]),
        ct.tf([3, 0.5, 1], [2, 3, 3, 1]),
    ]
    plant = np.polymul(loop.process.num_array[0, 0], loop.process.den_array[0, 0])
    tried = [replace(loop, filter=F, keep_factors=True) for F in (*filters, *others)]
    holds = all(
        same(each.p_B.q, np.polymul(plant, each.fractions[-1].den), 1e-12) and is_stable(each)
        for each in tried
    )
    wrong = ct.tf([-1], [0.1, -1]), ct.tf([0.1, 1], [0.2, 1])
    refused = [is_refused(loop.process, loop.model, loop.controller, F) for F in wrong]
    count = len(tried)
    return Finding(
        holds and all(refused),
        f"p_B = N·D·Df, and stable, for {count if holds else 'not all'} of {count} filters; an "
        "unstable or a too flat one is refused",
    )


@SECTION.check("ex1.causal")
def _causal() -> Finding:
    first, second = (inverse_degree(filtered(example(1), 0.01, order)) for order in (1, 2))
    also = f"; {number(first)}, still causal, for n = 1" if first >= 0 else ""
    return Finding(second >= 0, f"relative degree of F/Gm: {number(second)} for n = 2{also}")


@SECTION.check("fig02")
def _figure_2() -> Finding:
    loop = example(1)
    found = loop.step_response("d")
    scaled = found.time / loop.filter.time_constant
    closed_form = (1 + scaled) * np.exp(-scaled)
    agrees = np.allclose(found.outputs[0, 0], closed_form, atol=1e-9)
    settles = steps(loop)
    return Finding(settles.as_printed and bool(agrees), settles.computed)


@SECTION.check("ex1.responses_prove")
def _responses_prove() -> Finding:
    first = example(1)
    plant, C = ([-1, 1], [1, 2, 1]), ([1, -1], [1, 3, 0])
    in_model_loop = NRDOB(([-0.5], [1, 1]), ([1], [1, -1]), C, LowPassFilter(1.0, 1))
    in_observer = NRDOB(plant, plant, 0.1, LowPassFilter(0.05, 1))
    loops = (first, in_model_loop, in_observer)
    bounded = [  # common factors divided out
        all((getattr(loop, input.to_y).to_tf().poles().real < 0).all() for input in INPUTS.values())
        for loop in loops
    ]
    stable = [loop.stability().stable for loop in loops]
    hidden = in_model_loop.p_A.roots[0].real, in_observer.p_B.roots[0].real
    peak = max(np.abs(in_model_loop.step_response(i).outputs[0]).max() for i in INPUTS)
    return Finding(
        all(verdict is True for verdict, harmless in zip(stable, bounded, strict=True) if harmless),
        "Example 1 is stable; with Gm = 1/(s − 1), C = (s − 1)/(s(s + 3)) no response of y "
        f"exceeds {number(peak, 4)} in size and p_A has a root at {number(hidden[0], 4)}",
        conditions={
            "all responses of y are bounded in the three loops": all(bounded),
            "of the three Example 1 alone is stable": stable == [True, False, False],
            "a root at 1 is hidden in each of the others": np.allclose(hidden, 1, rtol=1e-9),
        },
    )


# Example 2.


@SECTION.check("fig03")
def _good_model() -> Finding:
    loop = example(2)
    omega = np.linspace(0, 20, 2001)
    ratio, mismatch = loop.ratio(1j * omega), np.abs(loop.H(1j * omega))
    gain, phase = np.abs(np.abs(ratio) - 1), np.degrees(np.abs(np.angle(ratio)))
    return Finding(
        bool(gain[:-1].max() < 0.02 and mismatch[:-1].max() < 0.2),
        f"gain within {number(100 * gain.max(), 3)} %, phase within {number(phase.max(), 4)}°, "
        f"|H| up to {number(mismatch.max(), 4)}",
        "good: gain within 2 %, |H| below 0.2",
    )


@SECTION.check("ex2.H")
def _mismatch_2() -> Finding:
    loop = example(2)
    left = loop.H.to_tf()
    only_zero = left.poles().size == 0 and np.array_equal(left.zeros(), [0])
    coefficients = left.num_array[0, 0] / left.den_array[0, 0]
    is_s = np.allclose(coefficients, [-0.01, 0], rtol=1e-12) and loop.H.zeros_at_origin == 1
    holds = only_zero and is_s and np.isclose(loop.G.dc_gain, loop.Gm.dc_gain, rtol=1e-12)
    words = f"{map_text(loop.H)}; DC gains {number(loop.G.dc_gain)} and {number(loop.Gm.dc_gain)}"
    return Finding(bool(holds), words)


@SECTION.check("fig05")
def _figure_5() -> Finding:
    H = example(2).H
    radius = 1e8
    line = turned(1 + H(1j * radius * np.linspace(-1, 1, 100_001)))
    arc = turned(1 + H(radius * np.exp(1j * np.linspace(pi / 2, -pi / 2, 1001))))
    count = encirclements(H)
    return Finding(
        round(line, 4) == 1,
        f"{number(line, 4)} encirclements without the arc, {number(line + arc, 4)} with it; "
        f"1 + H has a zero at {number(minus_point(H).roots[0].real, 4)}",
        conditions={
            "the closed curve turns once clockwise": bool(np.isclose(line + arc, 1, atol=1e-5)),
            "so does the count, P = 0 and Z = 1": npz(count) == (1, 0, 1),
        },
    )


@SECTION.check("ex2.slow")
def _slow_enough() -> Finding:
    loop, zero = example(2), 100.0

    def smallest(n: int) -> float:
        # (1 + jλω)^n = jω/z: the phase gives λω = tan(π/2n), the size then λ.
        return 1 / zero if n == 1 else tan(pi / (2 * n)) * cos(pi / (2 * n)) ** n / zero

    factors = np.array([0.01, 0.1, 0.5, 0.9, 0.99, 0.9999, 1.0001, 1.01, 1.1, 2, 10, 100])
    holds = all(
        filtered(loop, factor * smallest(n), n).stability().stable is bool(factor > 1)
        for n in (1, 2, 3, 4)
        for factor in factors
    )
    borders = ", ".join(f"{number(smallest(n), 4)} s for n = {n}" for n in (1, 2, 3, 4))
    return Finding(holds, f"stable exactly for λ above {borders}")


@SECTION.check("eq10")
def _filter_2() -> Finding:
    loop = example(2)
    part = loop.stability().observer_loop
    degree = inverse_degree(loop)
    words = f"p_B rightmost {number(part.rightmost.real, 4)}; F/Gm has relative degree {degree}"
    return Finding(part.stable is True and degree >= 0, words)


def swings(loop: NRDOB, input: str, size: float) -> int:
    """Count how often y changes sides, each time beyond ±size, after a unit step."""
    y = loop.step_response(input).outputs[0, 0]
    sides = np.sign(y[np.abs(y) > size])
    return int(np.count_nonzero(np.diff(sides)))


@SECTION.check("ex2.performance")
def _performance_2() -> Finding:
    found = performance(2, times=2.0)
    before, after = (swings(loop, "d", 0.1) for loop in both(2))
    rings = {"S_d rings, as it did not before": before == 0 and after >= 3}
    return replace(found, conditions={**found.conditions, **rings})


@SECTION.check("ex2.family")
def _family_2() -> Finding:
    loop, lam = example(2), 0.025

    def with_zero(zero: float) -> tuple[list[float], list[float]]:
        return [-10 / zero, 10.0], [1.0, 2.0]

    plants = plant_family(
        loop.process, parameters=with_zero, zero=(80.0, 120.0), lag=(0.0, 0.1), grid=21
    )
    table = sweep(loop, plants, "stable")
    z, T = table["zero"], table["lag"]
    by_hand = bool((lam * (2 * lam - 1 / z) + T * (3 * lam - 2 / z) > 0).all())
    corners = [replace(loop, process=plants[k]).stability().stable for k in (0, 20, 420, 440)]
    least = 2 / (3 * lam)
    return Finding(
        bool(table["stable"].all()) and by_hand and corners == 4 * [True],
        f"stable with {int(table['stable'].sum())} of {len(table)} plants; with every lag if the "
        f"zero is above {number(least, 4)}",
    )


@SECTION.check("ex2.nmp")
def _non_minimum_phase() -> Finding:
    loops = both(2)
    zeros = [loop.G.to_tf().zeros().real[0] for loop in loops]
    words = f"stable with a zero at {number(zeros[0], 4)}, and at {number(zeros[1], 4)}"
    return Finding(min(zeros) > 0 and all(map(is_stable, loops)), words)
