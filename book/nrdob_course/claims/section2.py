"""Sections I and II: the loop, its diagram and its filter."""

from functools import reduce
from itertools import product
from math import sqrt

import numpy as np
from scipy.optimize import brentq

from nrdob.diagram import LowPassFilter, rational_power
from nrdob.loop import NRDOB
from nrdob.numerics import FloatArray, number
from nrdob.paper import example
from nrdob.sampling import random_block

from .ledger import ABOUT, EXACT, NEAR, STOPPED, TOLERANCE, Finding, counted, every, numbers, same
from .recurring import TO_OUTPUT, section
from .signals import ORDERS, PRINTED_MAPS, QUADRUPLES, Values, is_refused, many_loops, random_points

__all__ = ["SECTION"]

SECTION = section("section2")


def _noise_powers(loop: NRDOB, time_constant: float) -> FloatArray:
    """Noise at y under NR-DOB, conventional observer and C alone, for a perfect model, n = 2."""
    matched = NRDOB(loop.model, loop.model, loop.controller, LowPassFilter(time_constant, 2))
    _, model, C, F = matched.fractions
    alone = np.convolve(model.num, C.num), matched.p_A.q  # C Gm/(1 + C Gm)
    conventional = (  # (F + C Gm)/(1 + C Gm)
        np.polyadd(np.convolve(alone[0], F.den), reduce(np.convolve, (model.den, C.den, F.num))),
        np.convolve(alone[1], F.den),
    )
    others = [rational_power(*each) for each in (conventional, alone)]
    return np.array([matched.S_eta.noise_power(), *others])


@SECTION.check("sec1.dob_noise")
def _conventional_observer_and_noise() -> Finding:
    loop = example(1)
    nr, conventional, alone = _noise_powers(loop, loop.filter.time_constant)

    equal = float(brentq(lambda lam: _noise_powers(loop, lam) @ [1, 0, -1], 0.01, 20.0))
    tried = np.geomspace(0.01, 20, 15)
    powers = np.array([_noise_powers(loop, value) for value in tried])
    matched = Values.random(1).matched
    tracking = matched.CGm / (1 + matched.CGm)
    other = [matched.map(name, conventional=True) for name in ("T_R", "S_eta")]
    below = every((powers[:, 0] < alone) == (tried > equal))
    passes = same(other[1], -(matched.F + matched.CGm) / (1 + matched.CGm))
    return Finding(
        nr < alone,
        f"Example 1, noise power at y: {number(nr, 5)} with the NR-DOB, {number(conventional, 5)} "
        f"with the conventional observer, {number(alone, 4)} with C alone; the NR-DOB falls below "
        f"C alone at λ = {number(equal, 4)} s",
        conditions={
            "the noise power of the NR-DOB is 1/(4λ)": same(powers[:, 0], 0.25 / tried),
            "it equals that of C alone where 1/(4λ) does": same(equal, 0.25 / alone, rtol=1e-6),
            "it is below that of C alone for the slower filters and for no others": below,
            "the conventional observer passes more than C alone": every(powers[:, 1] > alone),
            "T_R of the NR-DOB is free of F": same(matched.map("T_R"), tracking),
            "T_R of the conventional observer is free of F": same(other[0], tracking),
            "S_eta of the conventional observer is -(F + C Gm)/(1 + C Gm)": passes,
        },
    )


# Section II: the diagram and the filter.


@SECTION.check("fig01")
def _one_diagram() -> Finding:
    v = Values.random(1)
    agreeing = [same(formula(v), v.map(name)) for name, formula in PRINTED_MAPS.items()]
    return Finding(
        every(agreeing),
        f"{counted(agreeing)} printed maps are those of the diagram, each for {QUADRUPLES} random "
        "values of the four blocks",
        TOLERANCE,
    )


@SECTION.check("eq01.causal")
def _a_causal_choice_of_the_order() -> Finding:
    rng = np.random.default_rng(1)
    right, possible = [], []
    for _ in range(40):
        model = random_block(rng, 3)
        degree = model.den_array[0, 0].size - model.num_array[0, 0].size
        causal = []
        for order in ORDERS:
            F = LowPassFilter(1.0, order)
            size = [abs(F(1j * omega) / model(1j * omega)) for omega in (1e5, 1e6)]
            causal.append(bool(size[1] < 2 * size[0]))
            right.append(causal[-1] == (order >= degree) == (not is_refused(model, model, 1.0, F)))
        possible.append(any(causal))
    return Finding(
        every(possible) and every(right),
        f"40 random models: a causal choice for {sum(possible)}; exactly from the model's "
        f"relative degree on in {counted(right)} pairs of model and order",
    )


@SECTION.check("eq01.bandwidth")
def _time_constant_and_bandwidth() -> Finding:
    filters = [LowPassFilter(1.0, n) for n in ORDERS]
    corners = [brentq(lambda x, F=F: abs(F(1j * x)) ** 2 - 0.5, 0, 2) for F in filters]
    x = np.geomspace(1e-2, 1e2, 41)
    agree = [
        same(F(1j * x / value), LowPassFilter(1.0, order)(1j * x))
        and same(F.bandwidth * value, corner)
        and same(sqrt(2 ** (1 / order) - 1), corner)
        for order, corner in zip(ORDERS, corners, strict=True)
        for value in (1e-3, 0.05, 1.0, 1e3)
        if (F := LowPassFilter(value, order))
    ]
    return Finding(every(agree), f"λω_B = {numbers(corners)} for n = 1 to 4", TOLERANCE)


@SECTION.check("eq02.low")
def _filter_in_its_pass_band() -> Finding:
    x = np.linspace(0, 1, 1001)
    filters = [LowPassFilter(0.05, order) for order in ORDERS]
    at_corner = [abs(F(1j * F.bandwidth)) for F in filters]
    share: dict[float, list[float]] = {NEAR: [], 0.01: []}
    exact = []
    for F, allowed in product(filters, share):
        limit = sqrt((1 - allowed) ** (-2 / F.order) - 1) / F.time_constant
        omega = x * F.bandwidth
        within = np.abs(F(1j * omega)) >= 1 - allowed
        # On the limit itself the last digit decides; the grid does not meet it.
        exact.append(every(within == (omega <= limit)) and 0 < limit < F.bandwidth)
        share[allowed].append(limit / F.bandwidth)
    return Finding(
        min(at_corner) >= 1 - NEAR,
        f"at ω_B |F| = {numbers(set(np.round(at_corner, 9)))} for n = 1 to 4; within 10 % of 1 "
        f"only up to {numbers(share[NEAR])} of ω_B",
        ABOUT,
        conditions={
            "|F| ≥ 1 − ε exactly up to ω_ε, and ω_ε < ω_B": every(exact),
            "ω_ε is about half of ω_B for ε = 0.1": every(0.45 < x < 0.55 for x in share[NEAR]),
        },
    )


@SECTION.check("eq02.high")
def _filter_in_its_stop_band() -> Finding:
    width: dict[float, list[float]] = {0.1: [], STOPPED: [], 0.001: []}
    right = []
    for order, allowed in product(ORDERS, width):
        F = LowPassFilter(1.0, order)
        found = brentq(lambda x, F=F, e=allowed: abs(F(1j * x)) - e, F.bandwidth, 1e4)
        beyond = np.abs(F(1j * np.geomspace(found, 1e6, 400)[1:]))
        right.append(same(found, sqrt(allowed ** (-2 / order) - 1)) and beyond.max() < allowed)
        width[allowed].append(found - F.bandwidth)
    words = f"|F| ≤ 0.01 needs λΔ = {numbers(width[STOPPED])} for n = 1 to 4"
    return Finding(every(right), words, TOLERANCE)


# Eqs. (3) and (4).


@SECTION.check("eq03")
def _output_is_the_sum_of_four() -> Finding:
    rng = np.random.default_rng(3)
    v, given = Values.random(rng), Values.random(rng)  # four random numbers each
    total = sum(PRINTED_MAPS[name](v) * x for name, x in zip(TO_OUTPUT, given, strict=True))
    agree = np.isclose(v.solve(*given).y, total, rtol=EXACT, atol=0)
    by_package = []
    for loop in many_loops():
        s, given = random_points(rng), Values.random(rng, 4)
        total = sum(getattr(loop, name)(s) * x for name, x in zip(TO_OUTPUT, given, strict=True))
        by_package.append(same(Values.of(loop, s).solve(*given).y, total))
    words = f"{counted(agree)} random values of blocks and inputs agree, and {counted(by_package)}"
    return Finding(every(agree) and every(by_package), f"{words} loops", TOLERANCE)
