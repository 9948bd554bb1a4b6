"""Skogestad's rules: the formulas by derivation, the half rule by the examples of his paper."""

from math import inf

import control as ct
import numpy as np
import pytest
import sympy as sp

import nrdob
from nrdob import LowPassFilter, delay
from nrdob.alternatives import half_rule

s = ct.tf("s")


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
    found = nrdob.simc_pi(G, 1.0).margins().plant_loop
    assert (round(found.gm, 2), round(found.pm, 1), round(found.ms, 2)) == (gm, pm, ms)


@pytest.mark.parametrize("time_constant", [0.05, 1.0, 3.0])
def test_without_dead_time_the_pi_is_the_observer_of_order_1(time_constant):
    G = 2 / (0.2 * s + 1)  # τ1 <= 4 τc; for a longer lag SIMC integrates more than IMC
    pi_loop = nrdob.simc_pi(G, time_constant)
    observer = nrdob.NRDOB(G, G, 1.0, LowPassFilter(time_constant, 1))
    at = np.array([0.01j, 1j, 30j])
    np.testing.assert_allclose(pi_loop.K(at), observer.K(at), rtol=1e-12)


def test_a_pid_is_what_its_series_form_says():
    G = delay(0.4) * 3 / ((5 * s + 1) * (2 * s + 1))
    loop = nrdob.simc_pid(G, 0.6)
    gain, integral = 5 / 3, min(5.0, 4.0)
    at = np.array([0.05j, 1j, 8j])
    by_hand = gain * (integral * at + 1) * (2 * at + 1) / (integral * at * (0.2 * at + 1))
    np.testing.assert_allclose(loop.K(at), by_hand, rtol=1e-10)


@pytest.mark.parametrize(
    ("G", "order", "reduced"),
    [
        # Four lags, 1, 0.2, 0.04 and 0.008 s: examples of the half rule in Skogestad's paper.
        (1 / ((s + 1) * (0.2 * s + 1) * (0.04 * s + 1) * (0.008 * s + 1)), 1, (1, 1.1, 0, 0.148)),
        (1 / ((s + 1) * (0.2 * s + 1) * (0.04 * s + 1) * (0.008 * s + 1)), 2, (1, 1, 0.22, 0.028)),
        (1 / (s + 1) ** 4, 1, (1, 1.5, 0, 2.5)),
        (1 / (s + 1) ** 4, 2, (1, 1, 1.5, 1.5)),
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


@pytest.mark.parametrize(
    ("G", "message"),
    [
        (1 / (s - 1), "a pole at 1; these rules are for stable or integrating processes: use an"),
        (1 / (s**2 + 0.2 * s + 1), "these rules are for lags, without oscillation"),
        (1 / (s**2 * (s + 1)), "has 2 integrators; these rules take one: use nrdob.linear_adrc"),
        (s / (s + 1) ** 2, "has a zero at s = 0: no controller holds a load there"),
        ((s**2 + 0.1 * s + 1) / (s + 1) ** 3, "these rules take real ones"),
        (ct.tf([3], [1]), "no lag of the process is left"),
    ],
)
def test_what_the_rule_does_not_fit_is_named(G, message):
    with pytest.raises(ValueError, match=message):
        nrdob.simc_pi(G, 1.0)


def test_a_pid_needs_two_lags_and_every_rule_a_time():
    with pytest.raises(ValueError, match="one lag, and a PID needs two: take a PI"):
        nrdob.simc_pid(1 / (s + 1), 1.0)
    with pytest.raises(ValueError, match=r"closed_loop_time is -1.0; τc is positive"):
        nrdob.simc_pi(1 / (s + 1), -1.0)
    with pytest.raises(TypeError, match="closed_loop_time is None"):
        nrdob.simc_pi(1 / (s + 1), None)
