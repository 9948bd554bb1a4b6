"""The oracles themselves, against closed forms."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from flint import acb_poly, arb, fmpq, fmpq_poly

from tests.oracles import contour, events, inversion, sweep, wired
from tests.oracles.plain import Block, Plain, exact_polynomial, low_pass, p_A, p_B

ONE = Block([1.0], [1.0])


def test_roots_of_a_polynomial_are_counted():
    for roots in ([-1, -2], [1, -2], [0.001, 3, -1], [0.1 + 5j, 0.1 - 5j, -4]):
        p = exact_polynomial(np.real(np.poly(roots)))
        assert contour.rhp_by_argument([(p, 0.0)]) == sum(np.real(roots) > 0)


@pytest.mark.parametrize(("gain", "count"), [(1.5707, 0), (1.5709, 2), (7.853, 2), (7.855, 4)])
def test_an_integrator_behind_a_dead_time_loses_two_roots_at_each_odd_multiple(gain, count):
    # s + k exp(-s): on the axis at k = π/2, 5π/2, …
    terms = [(fmpq_poly([0, 1]), 0.0), (exact_polynomial([gain]), 1.0)]
    assert contour.rhp_by_argument(terms) == count


def test_a_neutral_function_that_is_not_strongly_stable_has_no_count():
    terms = [(exact_polynomial([1.0, 1.0]), 0.0), (exact_polynomial([1.1, 1.0]), 1.0)]
    assert math.isnan(contour.rhp_by_argument(terms))


def test_the_characteristic_functions_of_a_loop_by_hand():
    loop = Plain(Block([2.0], [1, 1]), Block([1.0], [1, 1]), Block([3.0], [1.0]), low_pass(0.5, 1))
    # p_A = s + 4; p_B = (s + 1) (0.5 s + 1 - 1) + 2 (s + 1) with the factor s + 1 of both.
    assert p_A(loop)[0][0] == fmpq_poly([4, 1])
    assert p_B(loop)[0][0] == fmpq_poly([1, 1]) * fmpq_poly([2, fmpq(1, 2)])


def test_talbot_gives_thirty_digits():
    for t in (0.1, 1.0, 7.0):
        ways = [([1], [0, 1, 1], lambda t: 1 - mpmath.exp(-t)), ([1], [1, 0, 1], mpmath.sin)]
        for num, den, true in ways:
            fractions = acb_poly(num), acb_poly(den)
            found = inversion.inverted(*fractions, arb(t), inversion.points_of(200))
            with mpmath.workdps(60):
                digits = mpmath.mpf(found.mid().str(60, radius=False))
                assert abs(digits - true(mpmath.mpf(t))) < 1e-30


def test_both_inversions_of_a_double_pole():
    value = inversion.inverse_laplace(fmpq_poly([1]), fmpq_poly([1, 2, 1]), fmpq(3, 2))
    assert value == pytest.approx(1.5 * math.exp(-1.5), rel=1e-14)


@pytest.mark.parametrize("t", [0.9, 1.1, 2.5])
def test_a_matched_loop_answers_as_its_model_loop_behind_the_dead_time(t):
    lag = Block([1.0], [1.0, 1.0])
    loop = Plain(lag, lag, ONE, low_pass(0.3, 1), 1.0, 1.0)
    y, u = inversion.talbot_step(loop, "R", t)
    assert y == pytest.approx(max(0.0, (1 - math.exp(-2 * (t - 1))) / 2), abs=1e-12)
    assert u == pytest.approx((1 + math.exp(-2 * t)) / 2, abs=1e-12)


def test_a_fast_pole_in_the_right_half_plane_is_inside_the_contour():
    # u of a plant at rest by a step of d, G = 1/(s - 9), with neither controller nor observer.
    plant, idle = Block([1.0], [1.0, -9.0]), Block([0.0], [1.0])
    loop = Plain(plant, Block([1.0], [1.0, 1.0]), idle, low_pass(1e6, 1), 0.0, 0.0)
    y, _ = inversion.talbot_step(loop, "delta", 12.0)
    # (1 - F)/(1 - F + F G (s + 1)), where F is nearly nothing: 1/(s - 9) moved by 1e-6.
    pole = np.roots(np.polyadd(np.convolve([1.0, -9.0], [1e6, 0.0]), [1.0, 1.0])).max()
    assert y == pytest.approx((math.exp(12 * pole) - 1) / pole, rel=1e-4)


@pytest.mark.parametrize(("gain", "T"), [(1.0, 0.5), (0.2, 3.0)])
def test_margins_of_an_integrator_behind_a_dead_time(gain, T):
    found = sweep.swept(lambda s: gain * np.exp(-T * s) / s, np.geomspace(1e-4, 40 / T, 20_001))
    assert found["gm_high"] == pytest.approx(math.pi / (2 * gain * T), rel=1e-9)
    assert found["pm"] == pytest.approx(90 - math.degrees(gain * T), rel=1e-9)
    assert found["delay_margin"] == pytest.approx(math.pi / (2 * gain) - T, rel=1e-9)


def test_the_largest_sensitivity_of_a_lag():
    # |1 + L| = |s + 1 - k|/|s + 1| is smallest at s = 0.
    found = sweep.swept(lambda s: -0.6 / (s + 1), np.geomspace(1e-6, 1e4, 4001))
    assert found["ms"] == pytest.approx(2.5, rel=1e-6)
    assert found["gm_high"] == pytest.approx(1 / 0.6, rel=1e-6)


@pytest.mark.parametrize(("gain", "dt"), [(0.5, 0.1), (3.0, 0.4)])
def test_poles_of_a_static_plant_on_a_processor(gain, dt):
    # (1 - F) + F g/z = 0 with F = h (z + 1)/((h + 2λ) z + h - 2λ).
    lam = 0.3
    loop = Plain(Block([gain], [1.0]), ONE, Block([0.0], [1.0]), low_pass(lam, 1))
    by_hand = np.roots([2 * lam, gain * dt - 2 * lam, gain * dt])
    found = wired.poles(loop, dt)
    assert all(np.abs(found - pole).min() < 1e-9 for pole in by_hand)


def test_a_saturated_actuator_is_a_step_of_the_process():
    loop = Plain(
        Block([2.0], [0.5, 1.0]), Block([2.0], [0.5, 1.0]), ONE, low_pass(0.1, 1), delay=0.13
    )
    y, u = events.step(loop, 0.1, 40, "R", computation_delay=0.04, limit=0.01, size=9.0)
    late = np.maximum(np.arange(40) * 0.1 - 0.17, 0)
    assert np.all(u == 0.01)
    assert y == pytest.approx(0.02 * (1 - np.exp(-2 * late)), abs=1e-14)


@pytest.mark.slow
def test_events_grow_as_the_largest_pole():
    loop = Plain(
        Block([2.0], [1.0, 1.0]), Block([1.0], [1.0, 1.0]), ONE, low_pass(0.1, 1), delay=0.25
    )
    y, _ = events.step(loop, 0.1, 400, "d", computation_delay=0.02)
    radius = np.abs(wired.poles(loop, 0.1, "tustin", 0.02)).max()
    assert radius > 1
    size = [np.abs(y[k : k + 40]).max() for k in (80, 360)]
    assert (size[1] / size[0]) ** (1 / 280) == pytest.approx(radius, rel=3e-3)
