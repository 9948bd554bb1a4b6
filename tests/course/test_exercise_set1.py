"""Set 1: what is special about its problems, beyond what holds for every set."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from nrdob import NRDOB, LowPassFilter
from nrdob.numerics import FloatArray
from nrdob_course.exercises import PROBLEMS, check, own_case
from nrdob_course.exercises.set1 import (
    INPUTS,
    PolynomialCase,
    SettledCase,
    TwinCase,
    WishCase,
    draw_sensitivity,
    gain_readings,
)
from problemsets import accepts

GROUPS = range(1, 16)  # tests/campaigns/misconceptions.py takes more of them


def shifted(case: TwinCase, c: float) -> tuple[float, list[float], list[float]]:
    """The twin with the model's gain multiplied by c: F' = c/(Df + c - 1)."""
    return c, [c], [*case.loop.filter.den[:-1], float(case.loop.filter.den[-1]) + c - 1]


def p_B(case: PolynomialCase) -> FloatArray:
    """What Problem 1.3 asks for, by the definition."""
    F = LowPassFilter(case.time_constant, case.order)
    rest = np.convolve(np.convolve(case.D, case.Nm), np.polysub(F.den, [1.0]))
    return np.polyadd(rest, np.convolve(case.N, case.Dm))


def test_the_final_values_solve_the_diagram() -> None:
    for group in GROUPS:
        case: SettledCase = own_case("1.1", group)
        found = {}
        for name in INPUTS:
            R, delta, d, eta = (float(name == each) for each in INPUTS)
            left = [[1, 0, 1], [1 / case.Gm, 0, -case.C], [1, -case.G, 0]]  # of y, u, e
            right = [R - eta, -eta / case.Gm, case.G * delta + d]
            found[name] = tuple(np.linalg.solve(left, right))
        assert accepts(PROBLEMS["1.1"], case, found)


def test_the_observer_cannot_be_fed_by_the_model_alone() -> None:
    C, F, Gm, R, ym, u = sp.symbols("C F Gm R ym u")
    law = sp.solve(sp.Eq(u, C * (R - Gm * u) + F * u - F / Gm * ym), u)[0]
    K = -sp.diff(law, ym)
    assert sp.simplify(K - F / (Gm * (1 - F + C * Gm))) == 0
    assert sp.simplify(sp.diff(law, R) - C / (1 - F + C * Gm)) == 0
    assert sp.limit(K.subs(F, 1), C, sp.oo) == 0


@pytest.mark.parametrize("factor", [1.0, -3.0, 1e4])
def test_a_polynomial_may_have_any_constant_factor(factor: float) -> None:
    assert check("1.3", lambda case: factor * p_B(case), 1).share == 1
    assert check("1.3", lambda case: np.poly1d(factor * p_B(case)), 1).share == 1


def test_every_loop_of_the_polynomials_hides_an_unstable_mode() -> None:
    for group in GROUPS:
        case: PolynomialCase = own_case("1.3", group)
        F = LowPassFilter(case.time_constant, case.order)
        loop = NRDOB((case.N, case.D), (case.Nm, case.Dm), 1.0, F)
        verdict = loop.stability().observer_loop
        assert verdict.stable is False
        shared = max(np.roots(case.D).real)
        assert np.isclose(np.polyval(p_B(case), shared), 0, atol=1e-9)
        assert np.isclose(verdict.roots, shared).any()


def test_roots_in_place_of_coefficients_are_told() -> None:
    text = check("1.3", lambda case: np.roots(p_B(case)) + 0j, 1).text
    assert "look like roots" in text


@pytest.mark.parametrize("seed", range(6))
def test_the_left_end_of_the_curve_tells_the_gain_of_the_plant(seed: int) -> None:
    case, loop = draw_sensitivity(np.random.default_rng(seed))
    assert gain_readings(case)["right"] == pytest.approx(loop.G.dc_gain, rel=1e-4)


def test_the_gain_may_be_read_within_a_tenth_and_not_worse() -> None:
    for group in GROUPS:
        case = own_case("1.4", group)
        true = gain_readings(case)["right"]
        assert all(check("1.4", share * true, group).share == 1 for share in (0.91, 1, 1.1))
        assert all(check("1.4", share * true, group).share < 1 for share in (0.8, 1.25, -1))


@pytest.mark.parametrize("c", [0.01, 0.5, 0.99, 1.01, 1.5, 4.0, 8.9])
def test_any_factor_has_a_twin(c: float) -> None:
    for group in range(1, 6):
        assert check("1.5", lambda case: shifted(case, c), group).share == 1


@pytest.mark.parametrize("c", [-1.0, 9.1])
def test_a_twin_with_an_unstable_filter_is_refused_with_the_reason(c: float) -> None:
    # Beyond M_3 = 9 the filter of order 3 is unstable; any is for a negative c.
    [case] = [each for each in PROBLEMS["1.5"].cases(1, 30) if each.loop.filter.order == 3][:1]
    assert "F must be stable" in PROBLEMS["1.5"].lacks(
        case, PROBLEMS["1.5"].reads(shifted(case, c))
    )
    kinds, got = PROBLEMS["1.5"].misconceptions, PROBLEMS["1.5"].reads(shifted(case, c))
    assert not any(kind.recognises(case, got) for kind in kinds)


@pytest.mark.slow
def test_other_filters_may_meet_the_wishes() -> None:
    met = set()
    for group in GROUPS:
        case: WishCase = own_case("1.6", group)
        for extra in (1, 2, 3):
            for share in (0.85, 0.95, 1.0):
                order = case.relative_degree + extra
                F = LowPassFilter(share * 0.1 / (order * case.omega_d), order)
                if accepts(PROBLEMS["1.6"], case, F) is True:
                    met.add((extra, share))
    assert len(met) > 5


def test_the_wishes_are_no_rounder_than_they_can_be_met() -> None:
    for group in GROUPS:
        case: WishCase = own_case("1.6", group)
        order = case.relative_degree + 1
        for share, expected in ((0.75, False), (0.85, True), (0.99, True), (1.05, False)):
            F = LowPassFilter(share * 0.1 / (order * case.omega_d), order)
            assert (accepts(PROBLEMS["1.6"], case, F) is True) is expected, (case, share)


@pytest.mark.thorough
@pytest.mark.parametrize("id", ["1.1", "1.3", "1.4", "1.5", "1.6"])
def test_cases_are_found_for_every_group(id: str) -> None:
    texts = {str(own_case(id, group)) for group in range(150)}
    assert len(texts) > 140


@pytest.mark.thorough
def test_the_figure_tells_a_point_of_the_curve() -> None:
    figure = own_case("1.4", 1).plot()
    assert "rad/s" in figure.alt
    assert figure.png() == own_case("1.4", 1).plot().png()
