"""Sets of filter families: closed forms, the same as for lags, and the verdict beside every end."""

from __future__ import annotations

from math import inf, pi, sqrt

import control as ct
import numpy as np
import pytest
from scipy.optimize import brentq

import nrdob
from campaigns.families import campaign
from campaigns.sets import floor_of
from nrdob import (
    critical_time_constants,
    filter_family,
    judge_observer,
    paper,
    stabilizing_time_constants,
)
from nrdob.design.columns import last_root, none_beyond, roots_of_columns
from nrdob.design.crossings import Branches
from nrdob.design.mismatch import Mismatch
from nrdob.design.mismatchgrid import Frequencies
from nrdob.diagram import FilterFamily

s = ct.tf("s")
lag = 1 / (s + 1)


def lags(order):
    """The filters of eq. (1), as any family is read."""
    rows = filter_family("binomial", order)
    return FilterFamily("own", rows.num, rows.den)


@pytest.mark.parametrize("number", [2, 3])
@pytest.mark.parametrize("modified", [False, True])
@pytest.mark.parametrize("more", [0, 1, 2])
def test_lags_as_a_family_have_the_set_of_their_order(number, modified, more):
    loop = paper.example(number, modified)
    order = loop.filter.order + more
    one = critical_time_constants(loop.process, loop.model, order)
    other = critical_time_constants(loop.process, loop.model, lags(order))
    assert [c.direction for c in one] == [c.direction for c in other]
    for a, b in zip(one, other, strict=True):
        assert a.time_constant == pytest.approx(b.time_constant, rel=1e-10)
    binomial = filter_family("binomial", order)
    expected = stabilizing_time_constants(loop.process, loop.model, order)
    assert stabilizing_time_constants(loop.process, loop.model, binomial) == expected


@pytest.mark.parametrize("delay", [0.05, 5.0])
@pytest.mark.parametrize("kind", ["butterworth", "bessel"])
def test_first_order_is_a_lag_and_needs_two_theta_over_pi(kind, delay):
    found = stabilizing_time_constants(nrdob.delay(delay) * lag, lag, filter_family(kind, 1))
    assert found[-1] == (pytest.approx(2 * delay / pi, rel=1e-10), inf)


@pytest.mark.parametrize("zeta", [0.5, sqrt(0.5), 1.0])
def test_pure_delay_under_a_second_order_filter(zeta):
    # exp(-jωθ) = 1 - 1/F = x² - 2ζjx with x = λω.
    family = FilterFamily("own", np.ones((1, 1)), np.diag([1.0, 2 * zeta, 1.0]))
    x = brentq(lambda x: x**4 + 4 * zeta**2 * x**2 - 1, 0, 2)
    angle = -np.angle(x**2 - 2j * zeta * x)  # = ωθ
    theta = 0.7
    low, high = stabilizing_time_constants(nrdob.delay(theta) * lag, lag, family)[-1]
    assert (low, high) == (pytest.approx(x * theta / angle, rel=1e-9), inf)


@pytest.mark.slow
@pytest.mark.parametrize(
    "model",
    [4 / (2 - s - s**2), (1 - s) / (s + 1) ** 2, (s - 3) / (s * (s - 1) * (s + 2)), 1 / s**2],
)
@pytest.mark.parametrize("ramp", [1, 2])
def test_every_interpolating_filter_works_where_the_model_matches(model, ramp):
    family = filter_family("interpolating", model=model, ramp=ramp)
    assert stabilizing_time_constants(model, model, family) == [(0.0, inf)]


def test_an_inexact_model_bounds_the_interpolating_filters_of_an_unstable_plant():
    model, process = 4 / (2 - s - s**2), 0.6 * 4 / (2 - s - s**2)
    family = filter_family("interpolating", model=model)
    ((low, high),) = stabilizing_time_constants(process, model, family)
    assert low == 0
    for side in (-1, 1):
        F = family.at(high * (1 + side * 1e-6))
        assert nrdob.judge_observer(process, model, F).stable is (side < 0)


def test_time_constants_at_which_the_filter_itself_is_unstable_are_left_out():
    family = FilterFamily("own", np.ones((1, 1)), np.array([[1, 0, 0], [-1, 2, 0], [0, 0, 1]]))
    assert stabilizing_time_constants(lag, lag, family) == [(0.0, pytest.approx(2.0, rel=1e-12))]


def test_a_double_integrator_needs_a_ramp_filter_and_has_all_of_them():
    model = 1 / s**2
    assert stabilizing_time_constants(model, model, filter_family("ramp", 3, ramp=2)) == [(0, inf)]
    assert stabilizing_time_constants(model, model, filter_family("bessel", 3)) == []


def test_an_order_too_low_for_the_model_is_refused():
    with pytest.raises(ValueError, match="not causal"):
        stabilizing_time_constants(1 / s**2, 1 / (s + 1) ** 2, filter_family("ramp", 2))


@pytest.mark.parametrize("spread", [0, 3, 8])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_roots_of_many_polynomials_are_those_that_they_were_made_of(n, spread):
    rng = np.random.default_rng(n)
    size = 10 ** rng.uniform(-spread, spread, (n, 500))
    roots = size * (rng.normal(size=(n, 500)) + 1j * rng.normal(size=(n, 500)))
    columns = np.array([np.poly(column)[::-1] for column in roots.T]).T
    found = roots_of_columns(columns)
    away = np.abs(found[:, None] - roots[None])
    assert np.all(away.min(axis=0) < 1e-9 * np.abs(roots))
    assert np.all(away.min(axis=1) < 1e-9 * np.abs(found))


def test_two_roots_that_nearly_meet_keep_the_digits_of_the_product():
    rng = np.random.default_rng(0)
    roots = 10 ** rng.uniform(-3, 3, (3, 2000)) * np.exp(2j * np.pi * rng.random((3, 2000)))
    roots[1] = roots[0] * (1 + 10 ** rng.uniform(-6, -5, 2000))
    columns = np.array([np.poly(each)[::-1] for each in roots.T]).T
    product = np.prod(roots_of_columns(columns), axis=0)
    assert np.abs(product / -columns[0] - 1).max() < 1e-14


def test_multiple_roots_of_polynomials_and_those_at_0_and_infinity_are_found():
    columns = np.array([[1, 3, 3, 1], [0, 0, 0, 1], [1, 2, 1, 0], [-1, 0, 0, 1]]).T
    triple, zero, quadratic, cube = roots_of_columns(columns).T
    assert triple == pytest.approx(-np.ones(3), abs=1e-4)
    assert zero == pytest.approx(np.zeros(3), abs=1e-30)
    assert np.sort(np.abs(quadratic))[:2] == pytest.approx(1, abs=1e-6)
    assert np.sort(np.abs(quadratic))[2] > 1e10
    assert cube**3 == pytest.approx(np.ones(3), rel=1e-12)


@pytest.mark.thorough
def test_random_sets_are_right_beside_every_end():
    found = campaign(18, 11)
    assert not [name for name in found if name.startswith("WRONG")]
    assert sum(number for name, number in found.items() if "right" in name) >= 16


# A model that waits.


@pytest.mark.parametrize(("theta", "wait"), [(1.05, 1.0), (0.5, 0.5), (0.0, 0.3), (0.7, 1.2)])
def test_lags_as_a_family_have_the_set_of_their_order_where_the_model_waits(theta, wait):
    process = nrdob.delay(theta) * 1.3 * lag**3
    model = nrdob.delay(wait) * lag**2 / (0.9 * s + 1)
    one = critical_time_constants(process, model, 3, floor=0.02)
    other = critical_time_constants(process, model, lags(3), floor=0.02)
    assert [c.direction for c in one] == [c.direction for c in other]
    for a, b in zip(one, other, strict=True):
        assert a.time_constant == pytest.approx(b.time_constant, rel=1e-10)
        assert a.frequency == pytest.approx(b.frequency, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 3])
def test_butterworth_filters_bear_a_wrong_dead_time_of_their_own_number_of_time_constants(order):
    # |1/F| = sqrt(1 + x^(2n)) meets 2 sin(φ/2) at x = (4 sin²(φ/2) - 1)^(1/(2n)); the least φ/x.
    phi = np.linspace(pi / 3, 5 * pi / 3, 400_001)[1:-1]
    number = np.min(phi / (4 * np.sin(phi / 2) ** 2 - 1) ** (1 / (2 * order)))
    wrong = 1e-3
    process, model = nrdob.delay(1 + wrong) * lag**order, nrdob.delay(1.0) * lag**order
    family = filter_family("butterworth", order)
    found = stabilizing_time_constants(process, model, family, floor=0.8 * wrong / number)
    assert wrong / found[-1][0] == pytest.approx(number, rel=2e-5) and found[-1][1] == inf


@pytest.mark.parametrize("kind", ["butterworth", "bessel", "ramp"])
def test_an_exact_model_that_waits_is_stable_for_every_filter_of_a_family(kind):
    model = nrdob.delay(2.0) * lag**2
    found = stabilizing_time_constants(model, model, filter_family(kind, 3), floor=1e-2)
    assert found == [(1e-2, inf)]


@pytest.mark.slow
@pytest.mark.parametrize("wait", [0.0, 0.3])
@pytest.mark.parametrize("gain", [1.0, 0.4])
def test_beyond_the_largest_time_constant_the_plant_loop_is_smaller_than_the_gain(wait, gain):
    model = nrdob.delay(wait) * lag**2 if wait else lag**2
    process, family = nrdob.delay(0.4) * 1.5 * lag**2, filter_family("butterworth", 2)
    mismatch = Mismatch.of(process, model, family)
    omega = np.geomspace(0.1, 100, 40)
    for w, most in zip(omega, last_root(mismatch.off_gain(omega, gain)), strict=True):
        for time_constant in most * np.array([1.001, 2.0, 10.0]):
            loop = nrdob.NRDOB(process, model, 0.0, family.at(float(time_constant)))
            assert most == 0 or abs(loop.L(1j * w)) < gain


INTEGRATING = [
    (nrdob.delay(0.1) * 1.2 / s, nrdob.delay(0.09) / s),
    (nrdob.delay(0.1) * 1.2 / (s + 0.1), nrdob.delay(0.09) / s),
    (1.2 / ((s + 0.1) * (0.05 * s + 1)), nrdob.delay(0.09) / (s * (0.04 * s + 1))),
    (nrdob.delay(0.2) / (s * (s + 1)), nrdob.delay(0.2) * 1.1 / (s * (s + 1.2))),
    (nrdob.delay(0.1) / (s - 0.1), nrdob.delay(0.1) / s),
]
"""Models that integrate and wait, for processes that do so, and that do not."""


@pytest.mark.parametrize(("process", "model"), INTEGRATING)
def test_lags_as_a_family_have_the_set_of_their_order_where_a_model_waits_and_integrates(
    process, model
):
    one = critical_time_constants(process, model, 2, floor=0.01)
    other = critical_time_constants(process, model, lags(2), floor=0.01)
    assert [c.direction for c in one] == [c.direction for c in other]
    for a, b in zip(one, other, strict=True):
        assert a.time_constant == pytest.approx(b.time_constant, rel=1e-9)
    sets = [stabilizing_time_constants(process, model, f, floor=0.01) for f in (2, lags(2))]
    assert np.ravel(sets[1]) == pytest.approx(np.ravel(sets[0]), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("pole", [0.0, 0.05, -0.05])
def test_two_integrators_of_a_model_that_waits_cancel_for_a_whole_family(pole):
    model = nrdob.delay(0.1) / s**2
    process = nrdob.delay(0.12) * 1.3 / ((s + pole) * (s + 0.1))
    family = filter_family("interpolating", model=model)
    found = stabilizing_time_constants(process, model, family, floor=0.02)
    assert found
    for end in np.ravel(found):
        if 0.02 < end < inf:
            sides = [judge_observer(process, model, family.at(end * k)) for k in (0.9999, 1.0001)]
            assert sides[0].stable is not sides[1].stable
    inside = [family.at(1.1 * low) for low, _ in found]
    assert all(judge_observer(process, model, F).stable for F in inside)


@pytest.mark.parametrize("kind", ["butterworth", "bessel", "ramp"])
def test_branches_that_meet_away_from_the_line_need_hardly_more_frequencies(kind):
    # Once in each turn of the dead time R is nearly 0, and the branches of a ramp nearly one.
    loop = paper.example(4)
    blocks = loop.process, loop.model, filter_family(kind, 3)
    frequencies = Frequencies(Mismatch.of(*blocks))
    omega = frequencies.above(floor_of(*blocks))
    branches = Branches.on(frequencies.mismatch, omega)
    assert omega.size <= branches.omega.size <= 1.15 * omega.size


def test_roots_that_are_one_are_found_by_the_formula_as_well():
    # Newton's steps lead anywhere there; (1 + x)^3, scaled, has the product of its roots kept.
    scale = np.geomspace(1e-6, 1e6, 7)
    columns = np.array([[1.0], [3.0], [3.0], [1.0]]) / scale ** np.arange(4)[:, None]
    roots = roots_of_columns(columns)
    np.testing.assert_allclose(np.prod(roots, axis=0), -(scale**3), rtol=1e-8)
    np.testing.assert_allclose(roots / scale, -np.ones((3, 7)), atol=1e-4)


@pytest.mark.parametrize("inertia", [1.0, 0.3])
@pytest.mark.parametrize("family", [1, filter_family("butterworth", 1)])
def test_a_double_root_through_infinity_is_crossed_by_one(inertia, family):
    # A quarter of a sample late, an integrator has a double root z = -1 at λ = T/4.
    inertial = 1 / (inertia * s)
    for dt in (0.5, 1.0, 0.7):
        found = stabilizing_time_constants(
            inertial, inertial, family, dt=dt, computation_delay=dt / 4
        )
        assert found == [(pytest.approx(dt / 4, rel=1e-9), inf)]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_where_two_coefficients_vanish_at_once_the_roots_are_those_on_both_sides(order):
    rng, model = np.random.default_rng(4), 1 / (s + 1) ** order
    for _ in range(8):
        time_constant = 2.0 ** rng.integers(-2, 3)
        a = np.array([1.0, rng.uniform(-2, 3)])
        b = rng.uniform(-2, 3, order + 2)
        b[:2] = (
            -(time_constant**order),
            -(time_constant ** (order - 1)) * (order + time_constant * a[1]),
        )
        process = ct.tf(b, np.convolve(a, model.den[0][0]))
        critical = critical_time_constants(process, model, order)
        (here,) = [c for c in critical if c.frequency == inf]
        assert here.time_constant == pytest.approx(time_constant, rel=1e-12)

        sides = [_on_the_right(a, b, order, time_constant * (1 + step)) for step in (-1e-4, 1e-4)]
        assert sides[1] - sides[0] == here.direction


def _on_the_right(a, b, order, time_constant):
    """Roots of a (Df - 1) + b on the right."""
    lags = np.poly(np.full(order, -1 / time_constant)) * time_constant**order
    p = np.polyadd(np.convolve(a, np.polysub(lags, [1.0])), b)
    return int(np.sum(np.roots(p).real > 0))


def test_polynomials_surely_have_no_root_beyond_their_last_one():
    # (x - 1)(x - 2) and its negative, ascending, and x² + 1.
    columns = np.array([[2.0, -2.0, 1.0], [-3.0, 3.0, 0.0], [1.0, -1.0, 1.0]])
    assert none_beyond(columns, 2.5).tolist() == [True, True, True]
    assert none_beyond(columns, 1.5).tolist() == [False, False, True]
