"""Eqs. (5) and (6): what the loop does at low and at high frequency, and what follows."""

from collections.abc import Callable
from math import inf, sqrt
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

from nrdob import NRDOB, LowPassFilter
from nrdob.numerics import ComplexArray, FloatArray, number
from nrdob.paper import EXAMPLES, example

from .ledger import ABOUT, EXACT, NEAR, STOPPED, Finding, counted, every, numbers, same
from .recurring import filtered, section
from .signals import ORDERS, Values, is_stable, many_loops

__all__ = ["SECTION"]

SECTION = section("bands")

_s = ct.tf("s")


# Eq. (5): low frequency.


def _low_band(loop: NRDOB) -> ComplexArray:
    """Points jω from near 0 to ω_B."""
    return np.linspace(0, 1j, 1001)[1:] * complex(loop.filter.bandwidth)


def _worst(measure: Callable[[NRDOB], float]) -> list[float]:
    """One number for each of the four examples."""
    return [measure(example(which)) for which in EXAMPLES]


@SECTION.check("eq05.T_R")
def _tracking_at_low_frequency() -> Finding:
    v = Values.random(5)
    factor = v.map("T_R") * (1 + v.CGm) / v.CGm
    off = (1 - v.F) * v.H / (1 + v.FH)

    def compared(loop: NRDOB, s: ComplexArray) -> ComplexArray:
        return np.asarray(loop.T_R(s) * (1 + loop.CGm(s)) / loop.CGm(s))

    sizes = [np.abs(compared(loop, _low_band(loop))) for loop in map(example, EXAMPLES)]
    worst = [size[np.abs(size - 1).argmax()] for size in sizes]
    at_zero = every(same(compared(loop, np.array([1e-7j])), 1, rtol=1e-4) for loop in many_loops())
    return Finding(
        every(abs(value - 1) <= NEAR for value in worst),
        f"the factor between the two reaches {numbers(worst)} on [0, ω_B] in Examples 1 to 4",
        ABOUT,
        conditions={
            "the first factor is (1 + H)/(1 + FH)": same(factor, (1 + v.H) / (1 + v.FH)),
            "it differs from 1 by (1 − F)H/(1 + FH)": same(factor - 1, off),
            "it tends to 1 with s": at_zero,
        },
    )


@SECTION.check("eq05.S_d")
def _output_disturbance_at_low_frequency() -> Finding:
    v = Values.random(5)
    filters = [LowPassFilter(1.0, order) for order in ORDERS[:3]]
    error = [abs(1 - F(1j * F.bandwidth)) for F in filters]
    reach = [brentq(lambda x, F=F: abs(1 - F(1j * x)) - NEAR, 0, 1) / F.bandwidth for F in filters]
    worst = _worst(lambda loop: float(np.abs(loop.S_d(_low_band(loop))).max()))
    return Finding(
        every(value <= NEAR for value in worst),
        f"|S_d| reaches {numbers(worst)} on [0, ω_B] in Examples 1 to 4; |1 − F| at ω_B is "
        f"{numbers(error)} for n = 1, 2, 3, and below 0.1 only up to {numbers(reach)} of ω_B",
        ABOUT,
        conditions={
            "S_d = (1 − F)/(1 + FH)": same(v.map("S_d"), (1 - v.F) / (1 + v.FH)),
            "S_d = 1 − F with a perfect model": same(v.matched.map("S_d"), 1 - v.F),
            "S_d(0) = 0": every(loop.S_d.dc_gain == 0 for loop in many_loops()),
            "|1 − F| is near 1 at ω_B": every(value > 0.5 for value in error),
        },
    )


@SECTION.check("eq05.S_eta")
def _noise_at_low_frequency() -> Finding:
    v = Values.random(5)
    distance = _worst(lambda loop: float(np.abs(np.abs(loop.S_eta(_low_band(loop))) + 1).min()))
    at_zero = [abs(loop.S_eta.dc_gain + 1) < EXACT for loop in many_loops()]
    lost = _at(1 / (_s + 1), 1 / _s, LowPassFilter(0.5, 1), "S_eta", 1e-8)
    return Finding(
        every(value <= NEAR for value in distance),
        f"|S_η| stays at least {number(min(distance), 4)} away from −1, but S_η(0) is −1 in "
        f"{counted(at_zero)} loops; with G(0)/Gm(0) = 0, for one, {number(lost.real, 4)}",
        ABOUT,
        conditions={
            "S_η(0) = −1": every(at_zero),
            "S_η + 1 = S_d": same(v.map("S_eta") + 1, v.map("S_d")),
            "S_η(0) is another value with G(0)/Gm(0) = 0": abs(lost + 1) > NEAR,
        },
    )


def _at(G: Any, Gm: Any, F: LowPassFilter, name: str, s: complex) -> complex:
    """One map of the diagram at one point, for C = 1."""
    values = (np.array([block(s)]) for block in (G, Gm, lambda s: 1.0 + 0j, F))
    return complex(Values(*values).map(name)[0])


@SECTION.check("eq05.S_delta")
def _input_disturbance_at_low_frequency() -> Finding:
    v = Values.random(5)
    worst = _worst(lambda loop: float(np.abs(loop.S_delta(_low_band(loop))).max()))
    integrators = _at(1 / _s, 1 / _s, LowPassFilter(0.5, 2), "S_delta", 1e-6)
    plant_only = NRDOB(1 / _s, 1 / (_s + 0.1), 2.0, LowPassFilter(0.05, 1))
    slopes = [
        same(loop.S_delta(1e-6j) / 1e-6j, F.order * F.time_constant * loop.Gm.dc_gain, rtol=1e-2)
        for loop in [*many_loops(), plant_only]
        if (F := loop.filter)
    ]
    return Finding(
        every(value <= NEAR for value in worst) and abs(integrators) <= NEAR,
        f"|S_δ| reaches {numbers(worst)} on [0, ω_B] in Examples 1 to 4; for G = Gm = 1/s, "
        f"n = 2, λ = 0.5 s it tends to {number(integrators.real, 4)}",
        ABOUT,
        conditions={
            "S_δ = G S_d": same(v.map("S_delta"), v.G * v.map("S_d")),
            "the slope of S_δ at s = 0 is nλGm(0)": every(slopes),
            "the loop with an integrator in the plant only is stable": is_stable(plant_only),
            "S_δ tends to nλ for G = Gm = 1/s": abs(integrators - 2 * 0.5) < 1e-4,
        },
    )


# Eq. (6): high frequency.


def _biproper() -> tuple[NRDOB, bool, str]:
    """Give Example 2 with n = 1, where FH does not die out, whether it is stable, and say it."""
    loop = filtered(example(2), 0.02, 1)
    stable = is_stable(loop)
    said = f"in Example 2 with n = 1, λ = 0.02 s ({'stable' if stable else 'not stable'})"
    return loop, stable, said


Ratio = Callable[[Values, ComplexArray], ComplexArray]
Exactly = Callable[[Values], ComplexArray]


def _high_band(loop: NRDOB) -> ComplexArray:
    """Points jω from where |F| = 0.01 on."""
    start = sqrt(STOPPED ** (-2 / loop.filter.order) - 1) / loop.filter.time_constant
    return 1j * np.geomspace(start, 1e6 * start, 601)


def _dying() -> list[NRDOB]:
    """Loops whose FH is strictly proper."""
    return [loop for loop in many_loops() if max(map(abs, loop.FH.at_infinity)) < EXACT]


def _approach(name: str, what: str, form: str, ratio: Ratio, exactly: Exactly) -> None:
    """Enter the check of a map of eq. (6) by its `ratio` to what it should be near, called `what`.

    `form` is in words what the ratio is `exactly`, of the four blocks.
    """

    @SECTION.check(f"eq06.{name}")
    def check() -> Finding:
        def size(loop: NRDOB) -> FloatArray:
            s = _high_band(loop)
            return np.abs(ratio(Values.of(loop, s), getattr(loop, name)(s)))

        def deviation(size: FloatArray) -> float:
            off = float(np.abs(size - 1).max())
            return round(off, 9)  # for the matched example nothing but the last bit

        v = Values.random(6)
        worst = _worst(lambda loop: deviation(size(loop)))
        biproper, stable, said = _biproper()
        found, limit = size(biproper), abs(1 / (1 + biproper.FH.at_infinity[0]))
        return Finding(
            every(value <= NEAR for value in worst) and deviation(found) <= NEAR,
            f"where |F| ≤ 0.01 {what} is off by at most {numbers(worst)} in Examples 1 to 4; "
            f"{said} it tends to {number(found[-1], 4)}",
            ABOUT,
            conditions={
                f"{what} is {form}": same(ratio(v, v.map(name)), exactly(v)),
                "Example 2 with n = 1, λ = 0.02 s is stable": stable,
                f"there {what} tends to |1/(1 + FH)| at infinity, not to 1": same(
                    found[-1], limit, rtol=1e-3
                ),
                f"{what} tends to 1 if FH is strictly proper": every(
                    abs(size(loop)[-1] - 1) < 1e-3 for loop in _dying()
                ),
            },
        )


_approach(
    "T_R", "the factor between the two", "1/(1 + FH)",
    lambda v, T_R: T_R * (1 + v.CGm) / (v.C * v.G), lambda v: 1 / (1 + v.FH),
)  # fmt: skip
_approach(
    "S_d", "|S_d|", "|(1 − F)/(1 + FH)|",
    lambda v, S_d: S_d, lambda v: (1 - v.F) / (1 + v.FH),
)  # fmt: skip
_approach(
    "S_delta", "|S_δ/G|", "|(1 − F)/(1 + FH)|",
    lambda v, S_delta: S_delta / v.G, lambda v: (1 - v.F) / (1 + v.FH),
)  # fmt: skip


@SECTION.check("eq06.S_eta")
def _noise_at_high_frequency() -> Finding:
    v = Values.random(6)
    exact = -v.F * (1 + v.H) / (1 + v.FH)
    worst = _worst(lambda loop: float(np.abs(loop.S_eta(_high_band(loop))).max()))
    biproper, stable, said = _biproper()
    passes = float(np.abs(biproper.S_eta(_high_band(biproper))).min())
    dies_out = every(abs(loop.S_eta(_high_band(loop)[-1])) < 1e-3 for loop in _dying())
    return Finding(
        every(value <= NEAR for value in worst) and passes <= NEAR,
        f"where |F| ≤ 0.01 |S_η| is at most {numbers(worst)} in Examples 1 to 4; {said} it is "
        f"nowhere below {number(passes, 4)}",
        ABOUT,
        conditions={
            "S_η = −F(1 + H)/(1 + FH)": same(v.map("S_eta"), exact),
            "Example 2 with n = 1, λ = 0.02 s is stable": stable,
            "there S_η does not die out": passes > 1 - NEAR,
            "S_η dies out if FH is strictly proper": dies_out,
        },
    )


# What the paper concludes from the two bands.


@SECTION.check("sec2.noise")
def _noise_against_tracking() -> Finding:
    s = 1j * np.geomspace(1e-3, 1e4, 2001)
    loops = [example(which) for which in (2, 3, 4)]
    slower = [filtered(loop, 4 * loop.filter.time_constant, loop.filter.order) for loop in loops]
    pairs = zip(loops, slower, strict=True)
    powers = [[loop.S_eta.noise_power() for loop in pair] for pair in pairs]
    quieter = [after < before for before, after in powers] + [*map(is_stable, slower)]

    def departure(loop: NRDOB) -> float:
        return float(np.abs(loop.T_R(s) - loop.CGm(s) / (1 + loop.CGm(s))).max())

    departs = [departure(loop) for loop in slower]
    rng = np.random.default_rng(7)
    v = Values.random(rng)
    other = v._replace(F=Values.random(rng).F)
    tracking = v.map("T_R")
    enters = same(tracking * (1 + v.CGm) / v.CGm, (1 + v.H) / (1 + v.FH))
    return Finding(
        every(quieter) and every(value <= NEAR for value in departs),
        f"filters four times slower: T_R departs from C Gm/(1 + C Gm) by up to "
        f"{numbers(departs)} in Examples 2 to 4; in Example 3 it was "
        f"{number(departure(loops[1]), 4)}, while the noise power at y falls from "
        f"{number(powers[1][0], 4)} to {number(powers[1][1], 4)}",
        ABOUT,
        conditions={
            "slower filters pass less noise, and stay stable": every(quieter),
            "T_R is free of F for G = Gm": same(v.matched.map("T_R"), other.matched.map("T_R")),
            "T_R depends on F otherwise": not np.isclose(tracking, other.map("T_R")).any(),
            "F enters T_R as (1 + H)/(1 + FH)": enters,
            "S_d − S_η = 1": same(v.map("S_d") - v.map("S_eta"), 1),
        },
    )


@SECTION.check("sec2.high_disturbance")
def _disturbances_above_the_bandwidth() -> Finding:
    x = np.geomspace(LowPassFilter(1.0, 3).bandwidth, 1e6, 20_001)
    perfect = Values.random(8, x.size).matched
    filters = [perfect._replace(F=LowPassFilter(1.0, n)(1j * x)) for n in ORDERS[:3]]
    floor = [float(np.abs(v.map("S_d")).max()) for v in filters]

    def peak(loop: NRDOB) -> float:
        omega = np.geomspace(1, 1e5, 20_001) * loop.filter.bandwidth
        return float(np.abs(loop.S_d(1j * omega)).max())

    worst = _worst(peak)
    peaks_there = same(floor, [1, 2 / sqrt(3), 9 / 7], 1e-6)
    raised = every(floor[1] < value < inf for value in worst[1:])
    return Finding(
        every(abs(value - 1) <= NEAR for value in worst),
        f"|S_d| above ω_B reaches {numbers(worst)} in Examples 1 to 4; max|1 − F| is "
        f"{numbers(floor)} for n = 1, 2, 3",
        ABOUT,
        conditions={
            "|1 − F| stays below 1 for n = 1": floor[0] < 1,
            "it peaks at 1, 2/√3 and 9/7 for n = 1, 2, 3": peaks_there,
            "|S_d| of the perfect model in Example 1 peaks there": same(worst[0], floor[1], 1e-6),
            "a mismatch raises the peak, in Examples 2 to 4": raised,
        },
    )
