"""Skogestad's rules: the formulas by derivation, the half rule by the examples of his paper."""

from math import inf

import control as ct
import numpy as np
import pytest
import sympy as sp

import nrdob
from nrdob import LowPassFilter, delay
from nrdob.alternatives import half_rule, simc_pi, simc_pid

s = ct.tf("s")


@pytest.mark.slow
def test_the_rule_makes_the_reference_arrive_as_asked():
    S, k, t1, t2, tc, theta = sp.symbols("S k t1 t2 tc theta", positive=True)
    undelayed = k / ((t1 * S + 1) * (t2 * S + 1))
    wanted = 1 / (tc * S + 1)  # times exp(-θs), of which K must know 1 - θs
    K = wanted / undelayed / (1 - wanted * (1 - theta * S))
    rule = t1 / (k * (tc + theta)) * (t1 * S + 1) * (t2 * S + 1) / (t1 * S)
    assert sp.simplify(K - rule) == 0


def test_four_times_tc_and_theta_leaves_an_integrator_just_without_oscillation():
    S, slope, wait = sp.symbols("S slope wait", positive=True)
    gain, integral = 1 / (slope * wait), 4 * wait
    p = sp.expand(S**2 * integral + gain * slope * (integral * S + 1))
    assert sp.discriminant(p, S) == 0


@pytest.mark.parametrize(
    ("G", "gm", "pm", "ms"),
    [
        (delay(1.0) / (5 * s + 1), 3.14, 61.4, 1.59),
        (delay(1.0) * 0.2 / s, 2.96, 46.9, 1.70),
    ],
)
def test_tight_control_has_the_margins_of_skogestads_table(G, gm, pm, ms):
    found = simc_pi(G, 1.0).margins().plant_loop
    assert (round(found.gm, 2), round(found.pm, 1), round(found.ms, 2)) == (gm, pm, ms)


@pytest.mark.parametrize("time_constant", [0.05, 1.0, 3.0])
def test_without_dead_time_the_pi_is_the_observer_of_order_1(time_constant):
    G = 2 / (0.2 * s + 1)  # τ1 <= 4 τc; for a longer lag SIMC integrates more than IMC
    pi_loop = simc_pi(G, time_constant)
    observer = nrdob.NRDOB(G, G, 1.0, LowPassFilter(time_constant, 1))
    at = np.array([0.01j, 1j, 30j])
    np.testing.assert_allclose(pi_loop.K(at), observer.K(at), rtol=1e-12)


@pytest.mark.parametrize(("tc", "filtered"), [(0.6, 0.2), (0.3, 0.15)])
def test_a_pid_is_what_its_series_form_says_its_filter_counted_as_dead_time(tc, filtered):
    G = delay(0.4) * 3 / ((5 * s + 1) * (2 * s + 1))
    loop = simc_pid(G, tc)
    wait = tc + 0.4 + filtered
    gain, integral = 5 / (3 * wait), min(5.0, 4 * wait)
    at = np.array([0.05j, 1j, 8j])
    by_hand = gain * (integral * at + 1) * (2 * at + 1) / (integral * at * (filtered * at + 1))
    np.testing.assert_allclose(loop.K(at), by_hand, rtol=1e-10)


def highest_sensitivity(G, reduced):
    """Ms of the PI or the PID without a filter, for τc = θ, over a dense grid."""
    at = 1j * np.geomspace(1e-3, 1e3, 300_001) / reduced.delay
    wait = 2 * reduced.delay
    integral = min(reduced.first, 4 * wait)
    K = (integral * at + 1) * (reduced.second * at + 1) / (reduced.slope * wait * integral * at)
    return np.abs(1 / (1 + K * G(at))).max()


# The 15 examples of Skogestad's paper. The paper was not at hand when this table was made, so no
# number is copied from it: the reductions k, τ1, τ2, θ follow from its rules by hand (those of E2
# and E5 are worked out in its text), Kc, τI and τD from these with τc = θ, and each Ms was computed
# on a grid that shares nothing with the package. For E6 with PI the paper, as remembered, takes all
# of the lag of 1 s for dead time (θ = 1.69, τI = 13.5, Ms 1.48); the half rule takes one half.
E = {
    1: 1 / ((s + 1) * (0.2 * s + 1)),
    2: (1 - 0.3 * s) * (0.08 * s + 1)
    / ((2 * s + 1) * (s + 1) * (0.4 * s + 1) * (0.2 * s + 1) * (0.05 * s + 1) ** 3),
    3: 2 * (15 * s + 1) / ((20 * s + 1) * (s + 1) * (0.1 * s + 1) ** 2),
    4: 1 / (s + 1) ** 4,
    5: 1 / ((s + 1) * (0.2 * s + 1) * (0.04 * s + 1) * (0.008 * s + 1)),
    6: (0.17 * s + 1) ** 2 / (s * (s + 1) ** 2 * (0.028 * s + 1)),
    7: (1 - 2 * s) / (s + 1) ** 3,
    8: 1 / (s * (s + 1) ** 2),
    9: delay(1) / (s + 1) ** 2,
    10: delay(1) / ((20 * s + 1) * (2 * s + 1)),
    11: delay(1) * (1 - s) / ((6 * s + 1) * (2 * s + 1) ** 2),
    12: delay(0.3) * (6 * s + 1) * (3 * s + 1) / ((10 * s + 1) * (8 * s + 1) * (s + 1)),
    13: delay(1) * (2 * s + 1) / ((10 * s + 1) * (0.5 * s + 1)),
    14: (1 - s) / s,
    15: (1 - s) / (s + 1),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "reduced", "settings", "ms"),
    [
        (1, (1, 1.1, 0, 0.1), (5.5, 0.8, 0), 1.56),
        (2, (1, 2.5, 0, 1.47), (0.85, 2.5, 0), 1.66),
        (2, (1, 2, 1.2, 0.77), (1.3, 2, 1.2), 1.72),
        (3, (1.5, 1.05, 0, 0.15), (2.33, 1.05, 0), 1.55),
        (3, (1.5, 1, 0.15, 0.05), (6.67, 0.4, 0.15), 1.50),
        (4, (1, 1.5, 0, 2.5), (0.3, 1.5, 0), 1.46),
        (4, (1, 1.5, 1, 1.5), (0.5, 1.5, 1), 1.43),
        (5, (1, 1.1, 0, 0.148), (3.72, 1.1, 0), 1.59),
        (5, (1, 1, 0.22, 0.028), (17.9, 0.224, 0.22), 1.83),
        (6, (1, inf, 0, 1.188), (0.421, 9.50, 0), 1.74),
        (6, (1, inf, 1.33, 0.358), (1.4, 2.86, 1.33), 1.23),
        (7, (1, 1.5, 0, 3.5), (0.214, 1.5, 0), 1.66),
        (7, (1, 1.5, 1, 2.5), (0.3, 1.5, 1), 1.85),
        (8, (1, inf, 0, 1.5), (0.333, 12, 0), 1.77),
        (8, (1, inf, 1.5, 0.5), (1, 4, 1.5), 1.60),
        (9, (1, 1.5, 0, 1.5), (0.5, 1.5, 0), 1.61),
        (9, (1, 1, 1, 1), (0.5, 1, 1), 1.59),
        (10, (1, 21, 0, 2), (5.25, 16, 0), 1.72),
        (10, (1, 20, 2, 1), (10, 8, 2), 1.65),
        (11, (1, 7, 0, 5), (0.7, 7, 0), 1.63),
        (11, (1, 6, 3, 3), (1, 6, 3), 1.66),
        (12, (0.225, 1, 0, 0.3), (7.41, 1, 0), 1.66),
        (13, (0.625, 4.5, 0, 1.25), (2.88, 4.5, 0), 1.74),
        (13, (0.5, 3, 0.5, 1), (3, 3, 0.5), 2.58),
        (14, (1, inf, 0, 1), (0.5, 8, 0), 2.0),
        (15, (1, 1, 0, 1), (0.5, 1, 0), 2.0),
    ],
)
def test_the_examples_of_skogestads_paper(number, reduced, settings, ms):
    G, order, theta = E[number], 2 if reduced[2] else 1, reduced[-1]
    found = half_rule(G, order, theta)
    assert tuple(found) == pytest.approx(reduced, rel=1e-3)
    gain, integral = 1 / (found.slope * 2 * found.delay), min(found.first, 8 * found.delay)
    assert (gain, integral, found.second) == pytest.approx(settings, rel=5e-3)
    ideal = highest_sensitivity(G, found)
    assert ideal == pytest.approx(ms, abs=0.005)
    if order == 1:
        peak = simc_pi(G, found.delay).margins().plant_loop.ms
        assert peak == pytest.approx(ideal, rel=1e-4)
    else:  # its filter costs little at most where it counts as dead time
        tight = found.delay + found.second / 10
        assert simc_pid(G, tight).margins().plant_loop.ms < ideal + 0.15
        assert simc_pid(G, found.delay).margins().plant_loop.ms < ideal + 0.3


@pytest.mark.parametrize(
    ("G", "order", "reduced"),
    [
        # Four lags, 1, 0.2, 0.04 and 0.008 s: examples of the half rule in Skogestad's paper.
        (1 / ((s + 1) * (0.2 * s + 1) * (0.04 * s + 1) * (0.008 * s + 1)), 1, (1, 1.1, 0, 0.148)),
        (1 / ((s + 1) * (0.2 * s + 1) * (0.04 * s + 1) * (0.008 * s + 1)), 2, (1, 1, 0.22, 0.028)),
        (1 / (s + 1) ** 4, 1, (1, 1.5, 0, 2.5)),
        (1 / (s + 1) ** 4, 2, (1, 1.5, 1, 1.5)),
        (delay(0.3) * 2 * (1 - 0.5 * s) / (4 * s + 1), 1, (2, 4, 0, 0.8)),
        (0.5 / (s * (2 * s + 1)), 1, (0.5, inf, 0, 1.0)),
        (0.5 / (s * (2 * s + 1)), 2, (0.5, inf, 2.0, 0)),
    ],
)
def test_half_of_the_largest_neglected_lag_becomes_dead_time(G, order, reduced):
    assert tuple(half_rule(G, order, 0.1)) == pytest.approx(reduced, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize(
    ("zero", "lag", "time", "gain", "left"),
    [
        (3.0, 1.0, 0.5, 3.0, None),  # T1: T/τ
        (3.0, 1.0, 2.0, 1.5, None),  # T1a: T/τc
        (3.0, 1.0, 4.0, 1.0, None),  # T1b: 1
        (3.0, 20.0, 0.1, 0.15, None),  # T2: T/τ
        (3.0, 20.0, 1.0, 0.25, 2.0),  # T3: 5τc/τ, and a lag of 5τc - T
        (3.0, 4.0, 1.0, 1.0, 1.0),  # T3: τ itself is shorter than 5τc
    ],
)
def test_a_zero_on_the_left_is_cancelled_by_the_rule_that_fits(zero, lag, time, gain, left):
    G = (zero * s + 1) / (lag * s + 1)
    if left is not None:
        assert tuple(half_rule(G, 1, time)) == pytest.approx((gain, left, 0, 0))
        return
    # A lag far below, to have one that is left.
    found = half_rule(G / (1e-3 * s + 1), 1, time)
    assert tuple(found) == pytest.approx((gain, 1e-3, 0, 0), rel=1e-6)


def test_an_integrator_is_a_lag_that_is_very_long():
    # T3 with 5τc: gain 5τc, and a lag of 5τc - T beside the one of 1 s.
    integrating = half_rule((3 * s + 1) / (s * (s + 1)), 1, 1.0)
    assert tuple(integrating) == pytest.approx((5.0, 2.5, 0.0, 0.5))
    slow = half_rule(1e9 * (3 * s + 1) / ((1e9 * s + 1) * (s + 1)), 1, 1.0)
    assert tuple(integrating) == pytest.approx(tuple(slow), rel=1e-6)


@pytest.mark.parametrize(
    ("G", "message"),
    [
        (1 / (s - 1), "a pole at 1; these rules are for stable or integrating processes: use an"),
        (1 / (s**2 + 0.2 * s + 1), "these rules are for lags, without oscillation"),
        (1 / (s**2 * (s + 1)), "has 2 integrators; these rules take one: use nrdob.alternatives"),
        (s / (s + 1) ** 2, "has a zero at s = 0: no controller holds a load there"),
        ((s**2 + 0.1 * s + 1) / (s + 1) ** 3, "these rules take real ones"),
        (ct.tf([3], [1]), "no lag of the process is left"),
    ],
)
def test_what_the_rule_does_not_fit_is_named(G, message):
    with pytest.raises(ValueError, match=message):
        simc_pi(G, 1.0)


def test_a_pid_needs_two_lags_and_every_rule_a_time():
    with pytest.raises(ValueError, match="one lag, and a PID needs two: take a PI"):
        simc_pid(1 / (s + 1), 1.0)
    with pytest.raises(ValueError, match=r"closed_loop_time is -1.0; τc is positive"):
        simc_pi(1 / (s + 1), -1.0)
    with pytest.raises(ValueError, match=r"closed_loop_time is 0.0; τc is positive"):
        simc_pi(1 / (s + 1), 0.0)
    with pytest.raises(TypeError, match="closed_loop_time is None"):
        simc_pi(1 / (s + 1), None)
    for order in (0, 3):
        with pytest.raises(ValueError, match=f"order is {order}; the rule keeps one lag or two"):
            half_rule(1 / (s + 1) ** 4, order, 1.0)
    with pytest.raises(ValueError, match=r"closed_loop_time is -1.0; τc is positive"):
        half_rule((2 * s + 1) / (s + 1) ** 4, 1, -1.0)
