"""Stabilising gains: against closed forms, poles, and counts beside every end."""

from math import inf, pi

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import LowPassFilter, delay
from nrdob.diagram import ObserverEquations
from nrdob.numerics import count_rhp
from nrdob.sampling import random_loop
from nrdob.uncertain import boxes, delay_intervals, gain_intervals

s = ct.tf("s")


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
def test_a_pure_gain_error_is_bounded_by_m_n(order):
    G = 1 / (s + 1) ** order
    bound = inf if order <= 2 else 1 + 1 / np.cos(pi / order) ** order
    ((low, high),) = gain_intervals(nrdob.NRDOB(G, G, 0.1 / s, LowPassFilter(0.3, order)))
    assert low == 0 and high == pytest.approx(bound, rel=1e-9)


def test_an_unstable_plant_needs_gain():
    loop = nrdob.paper.example(3)
    found = gain_intervals(loop)
    margins = loop.margins().plant_loop
    assert found == [pytest.approx((margins.gm_low, margins.gm_high), rel=1e-9)]


def test_a_negative_gain_stabilises_nothing_here():
    G = 1 / (s + 1)
    assert gain_intervals(nrdob.NRDOB(-1 * G, G, 1 / s, LowPassFilter(0.5, 2))) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("delayed", [False, True])
def test_random_loops_are_stable_in_the_set_and_nowhere_else(seed, delayed):
    loop = random_loop(np.random.default_rng(40 + seed), delayed=delayed)
    found = gain_intervals(loop)
    ends = [end for interval in found for end in interval]
    for k in np.geomspace(1e-3, 1e3, 25).tolist():
        if any(end and abs(k / end - 1) < 1e-3 for end in ends):
            continue
        p = ObserverEquations(k * loop.process, loop.model, loop.filter).p_B
        stable = count_rhp(p).count == 0 and not p.zeros_at_origin
        stable &= bool(loop.stability().model_loop.stable)
        assert stable == any(low < k < high for low, high in found), (k, found)


@pytest.mark.parametrize("theta", [0.0, 0.01])
def test_a_resonance_leaves_two_intervals(theta):
    # Beside the pair of poles there is a pair of zeros: small and medium gains work.
    G = delay(theta) * 10 * (s**2 + 0.5 * s + 25) / (s**2 + 0.2 * s + 25)
    G = G / ((s + 1) * (0.1 * s + 1))
    F = LowPassFilter(0.3, 2)
    found = gain_intervals(nrdob.NRDOB(G, 1 / (s + 1), 1 / s, F))
    assert len(found) == 2
    for low, high in found:
        for k, stable in ((low * 0.999, False), (low * 1.001, True),
                          (high * 0.999, True), (high * 1.001, False)):  # fmt: skip
            if k:
                assert nrdob.judge_observer(k * G, 1 / (s + 1), F).stable is stable


@pytest.mark.slow
def test_few_verdicts_are_asked_for_however_often_a_long_dead_time_turns_L(monkeypatch):
    # At far more than a thousand gains roots are on the axis; beside each there was a verdict.
    G, asked = 1 / (s + 1), []
    loop = nrdob.NRDOB(delay(500) * G, G, 0.1 / s, LowPassFilter(0.5, 1))
    judge = nrdob.NRDOB.stability
    monkeypatch.setattr(nrdob.NRDOB, "stability", lambda loop: asked.append(loop) or judge(loop))
    ((low, high),) = gain_intervals(loop)
    assert low == 0 and len(asked) < 8
    beside = [nrdob.judge_observer(high * k * loop.process, G, loop.filter) for k in (0.999, 1.001)]
    assert [each.stable for each in beside] == [True, False]


def test_a_verdict_that_contradicts_the_crossings_is_told(monkeypatch):
    loop = nrdob.paper.example(3)
    monkeypatch.setattr(boxes, "_going_right", lambda L, omega, name: np.ones(omega.size))
    with pytest.raises(ArithmeticError, match="have crossed the imaginary axis"):
        gain_intervals(loop)


def test_dead_times_beside_a_crossover_at_a_round_frequency():
    # |L| = 1 at 1 rad/s, where the phase is -π/2, and at sqrt(0.75) rad/s.
    G, Gm = ct.tf([1], [1, 0.5, 1]), ct.tf([1], [1, 0])
    loop = nrdob.NRDOB(G, Gm, 1.0, LowPassFilter(2.0, 1))
    (_, first), (second, third), (fourth, _) = delay_intervals(loop, 0, 10)
    turn, period = 2 * pi, 2 * pi / np.sqrt(0.75)
    assert (first, third) == pytest.approx((pi / 2, pi / 2 + turn), rel=1e-9)
    assert fourth - second == pytest.approx(period, rel=1e-9)


@pytest.mark.parametrize("span", [(2, 10), (0, 12), (2, 11)])
def test_roots_that_touch_the_axis_at_a_round_gain_do_not_stop_the_search(span):
    # p_B/s is (s² + 2)(4 s² + 5 s + 3) at k = 6, and stable on both sides of it.
    loop = nrdob.NRDOB(([1], [1, 0.25, 1]), ([1], [1, 1, 1]), 1, LowPassFilter(2.0, 2))
    assert gain_intervals(loop, *span) == [pytest.approx(span)]
