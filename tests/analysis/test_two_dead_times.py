"""Loops whose model waits, with two dead times: verdicts, margins and responses."""

import math

import control as ct
import mpmath as mp
import numpy as np
import pytest

import nrdob
from nrdob.analysis import judge, step_response
from nrdob.diagram import INPUTS
from nrdob.numerics import QuasiPolynomial, Term, count_rhp
from tests.campaigns import waiting

s = ct.tf("s")
LAG = ct.tf([1], [1, 1])


def example_4(wait, delay=0.05, gain=1.0):
    """Example 4 of the paper with a model that waits."""
    ex = nrdob.paper.example(4)
    G = nrdob.delay(delay) * gain * ex.process.tf
    return nrdob.NRDOB(G, nrdob.delay(wait) * ex.model, ex.controller, ex.filter)


def adaptive_argument_count(loop):
    """RHP roots of p_B by halving steps of ω until the argument moves little, from its formula."""
    G, Gm, _, F = loop.fractions

    def p(omega):
        x = 1j * omega
        N, D, Nm, Dm, Nf, Df = (np.polyval(c, x) for f in (G, Gm, F) for c in f)
        wait = np.exp(-loop.model_delay * x)
        return D * Nm * (Df - Nf * wait) + N * Dm * Nf * np.exp(-loop.delay * x)

    degree = G.den.size + Gm.num.size + F.den.size - 3
    fastest = max(1, *np.abs(np.roots(np.polymul(G.den, F.den))))
    top, turn = 1e4 * fastest, 2 * math.pi / max(loop.delay, loop.model_delay)
    # Between two frequencies less than a turn, or what turns is small.
    omega = np.union1d(np.geomspace(1e-6, top, 2000), np.arange(0, 50 * fastest, turn / 15))
    for _ in range(60):
        values = p(omega)
        turned = np.abs(np.angle(values[1:] / values[:-1]))
        coarse = np.flatnonzero(turned > 0.3)
        if not coarse.size:
            break
        omega = np.insert(omega, coarse + 1, (omega[coarse] + omega[coarse + 1]) / 2)
    lead = G.den[0] * Gm.num[0] * F.den[0] * 1j**degree
    turn = np.angle(values[1:] / values[:-1]).sum() + np.angle(lead / values[-1])
    return round(degree / 2 - turn / math.pi)


# Verdicts.


def test_random_verdicts_are_those_of_an_independent_count():
    rng = np.random.default_rng(11)
    seen = set()
    for _ in range(100):
        loop = waiting.random_loop(rng)
        found = loop.stability().observer_loop
        if found.kind == "neutral" or loop.p_B.neutral_ratio:
            continue
        assert found.stable is not None
        assert found.closed_loop_rhp == adaptive_argument_count(loop)
        seen.add((len(loop.p_B.delayed), found.stable))
    assert {(1, True), (1, False), (2, True), (2, False)} <= seen


def test_random_verdicts_neutral_ones_included_are_those_of_ball_arithmetic():
    rng = np.random.default_rng(12)
    neutral = 0
    for _ in range(25):
        loop = waiting.random_loop(rng)
        found, true = loop.stability().observer_loop, waiting.rhp_by_argument(waiting.terms(loop))
        neutral += found.kind == "neutral"
        if true is not None and not math.isnan(true):
            assert found.closed_loop_rhp == true
    assert neutral


@pytest.mark.parametrize("share", [0.7, 0.999, 1.001, 1.3])
def test_a_long_dead_time_is_counted_a_second_time_by_crossings(share):
    fast = nrdob.LowPassFilter(0.002, 2)
    # Lost at |θ - θm| = 2.3911 λ.
    plant, model = (nrdob.delay(T) * LAG for T in (2.0 + share * 2.3911 * 0.002, 2.0))
    found = nrdob.judge_observer(plant, model, fast)
    assert found.stable is (share < 1)
    assert "crossings between" in found.ways[1]
    assert found.closed_loop_rhp == adaptive_argument_count(nrdob.NRDOB(plant, model, 1 / s, fast))


@pytest.mark.parametrize(
    ("end", "theta", "stable"), [(0.3, 1.0, True), (0.45, 1.0, True), (0.55, 1.0, None)]
)
def test_a_biproper_filter_may_let_half_through_and_no_more(end, theta, stable):
    # |F(∞)| + |F(∞) R(∞)| < 1, the practical stability of Smith predictors: 2 |F(∞)| < 1.
    block = ct.tf([1, 2], [1, 1])
    F = ct.tf([end, 1], [1, 1])
    found = nrdob.judge_observer(nrdob.delay(theta) * block, nrdob.delay(0.9) * block, F)
    assert found.stable is stable
    if stable is None:
        assert "add up to 1.1" in found.reason and "smallest change of a dead time" in found.reason
        exact = nrdob.judge_observer(nrdob.delay(0.9) * block, nrdob.delay(0.9) * block, F)
        assert exact.stable  # an illusion


def test_one_delayed_term_that_outweighs_all_others_makes_endless_chains():
    p = QuasiPolynomial([1.0, 1.0], [2.5, 1.0], 1.0, more=(Term(np.array([1.0, 0.0]), 0.7),))
    assert count_rhp(p).count == math.inf
    assert judge("", (), p).stable is False


# Margins.


@pytest.mark.parametrize("wait", [0.02, 0.05, 0.08, 0.4, 1.0])
def test_a_gain_beside_the_margin_is_on_the_side_that_the_margin_says(wait):
    margins = example_4(wait).margins().plant_loop
    assert margins.stable and 1 < margins.gm < math.inf
    for factor, stable in ((1 - 1e-6, True), (1 + 1e-6, False)):
        found = example_4(wait, gain=factor * margins.gm).stability().observer_loop
        assert found.stable is stable


@pytest.mark.parametrize("wait", [0.02, 0.08, 0.4])
def test_more_dead_time_than_the_delay_margin_is_too_much(wait):
    margins = example_4(wait).margins().plant_loop
    for factor, stable in ((1 - 1e-6, True), (1 + 1e-6, False)):
        found = example_4(wait, delay=0.05 + factor * margins.delay_margin).stability()
        assert found.observer_loop.stable is stable


@pytest.mark.parametrize("wait", [0.02, 0.05, 0.4, 1.0])
def test_the_sensitivity_peak_is_the_highest_of_a_dense_grid(wait):
    loop = example_4(wait)
    margins = loop.margins().plant_loop
    near = margins.wms * (1 + np.linspace(-0.01, 0.01, 4001))
    omega = np.concatenate([np.geomspace(1e-3, 1e3, 200_001), near])
    assert np.abs(loop.S_d(1j * omega)).max() == pytest.approx(margins.ms, rel=1e-9)


def test_near_poles_of_the_predictor_are_not_missed():
    # 1 - F exp(-jωθm) nearly vanishes at every turn of a long θm within F's bandwidth.
    loop = nrdob.NRDOB(
        nrdob.delay(3.0) * 0.5 * LAG, nrdob.delay(3.0) * LAG, 1 / s, nrdob.LowPassFilter(0.02, 1)
    )
    margins = loop.margins().plant_loop
    omega = np.geomspace(1e-2, 3e2, 400_001)
    peak = np.abs(loop.S_d(1j * omega)).max()
    assert margins.ms == pytest.approx(peak, rel=1e-6) and margins.ms >= peak
    # 1 + (k R - 1) F exp(-sθ): lost where |k/2 - 1| = 1 on the first turns.
    assert 3.9 < margins.gm_high < 4.1


@pytest.mark.parametrize(("theta", "wait"), [(1.0, 0.7), (1.0, 1.0), (0.0, 0.7)])
def test_margins_of_a_neutral_loop_count_what_turns_for_ever(theta, wait):
    def loop(gain):
        G = nrdob.delay(theta) * gain * ct.tf([1, 2], [2, 1])
        F = ct.tf([0.4, 1], [1, 1])
        return nrdob.NRDOB(G, nrdob.delay(wait) * ct.tf([1, 2], [1, 1]), 1 / s, F)

    margins = loop(1.0).margins().plant_loop
    assert margins.stable
    if math.isfinite(margins.gm_high):
        assert loop(0.999 * margins.gm_high).stability().stable
        assert loop(1.001 * margins.gm_high).stability().stable is not True


# Responses.


def laplace(loop, input, t):
    """y and u by numerical inversion at 30 digits (de Hoog), at one t away from every jump."""
    mp.mp.dps = 30
    rows = [[mp.mpf(float(c)) for c in part] for block in loop.fractions for part in block]

    def maps(x):
        N, D, Nm, Dm, Nc, Dc, Nf, Df = (mp.polyval(row, x) for row in rows)
        E, Em = mp.exp(-x * loop.delay), mp.exp(-x * loop.model_delay)
        p_A, p_B = Dm * Dc + Nm * Nc, D * Nm * (Df - Nf * Em) + N * Dm * Nf * E
        S_d = D * Nm * (Df - Nf * Em) / p_B
        return {
            "R": (N * E * Nc * Nm * Dm * Df / p_A / p_B, Nc * D * Nm * Dm * Df / p_A / p_B),
            "d": (S_d, -D * Dm * Nf / p_B),
            "delta": (N * E / D * S_d, S_d),
            "eta": (-N * E * Dm * Nf / p_B, -D * Dm * Nf / p_B),
        }[input]

    return [
        float(mp.invertlaplace(lambda x, k=k: maps(x)[k] / x, t, method="dehoog", degree=60))
        for k in (0, 1)
    ]


@pytest.mark.parametrize("input", INPUTS)
@pytest.mark.parametrize(("theta", "wait"), [(0.05, 0.03), (0.05, 0.2), (0.0, 0.3)])
def test_steps_are_the_inverse_laplace_transform(theta, wait, input):
    loop = example_4(wait, delay=theta)
    found = step_response(loop, input, [0.513]).outputs[:, 0, 0]
    assert found == pytest.approx(laplace(loop, input, 0.513), abs=1e-11)


def test_random_steps_are_certified():
    rng = np.random.default_rng(5)
    errors = []
    for _ in range(6):
        errors.append(waiting.step_error(waiting.random_loop(rng), rng, horizon=3.0))
    assert max(errors) < 1e-9


def test_an_exact_model_answers_as_the_filter_and_the_model_alone():
    G = nrdob.delay(0.8) * LAG
    loop = nrdob.NRDOB(G, G, 2 * (s + 1) / s, nrdob.LowPassFilter(0.25, 1))
    times = np.linspace(0, 4, 401)
    y, u = step_response(loop, "R", times).outputs[:, 0]
    late = times - 0.8  # T_R = 2/(s + 2) exp(-θs)
    assert y == pytest.approx(np.where(late > 0, 1 - np.exp(-2 * late), 0.0), abs=1e-11)
    assert u == pytest.approx(1 + np.exp(-2 * times), abs=1e-11)
    y, u = step_response(loop, "d", times).outputs[:, 0]
    assert y == pytest.approx(np.where(late >= 0, np.exp(-late / 0.25), 1.0), abs=1e-11)


def test_both_meshes_give_the_same_curve(monkeypatch):
    loop = example_4(0.033)
    times = np.linspace(0, 1, 50)
    evenly = step_response(loop, "d", times).outputs
    monkeypatch.setattr("nrdob.analysis.lattice.SMOOTH", 10**9)
    assert step_response(loop, "d", times).outputs == pytest.approx(evenly, abs=1e-11)


def test_a_window_of_too_many_echoes_is_refused_with_the_reason():
    loop = nrdob.NRDOB(
        nrdob.delay(1.0) * LAG, nrdob.delay(1e-5) * LAG, 1 / s, nrdob.LowPassFilter(1.0, 1)
    )
    with pytest.raises(ArithmeticError, match="echoes of the dead times 1, 1e-05 s"):
        step_response(loop, "R", [5.0])


def test_an_input_disturbance_meets_the_process_but_not_the_model():
    loop = example_4(0.3, delay=0.1)
    times = np.array([0.05, 0.1, 0.2, 0.35])
    y, v = step_response(loop, "delta", times).outputs[:, 0]
    plant = ct.forced_response(loop.process.tf, np.linspace(0, 0.1, 101), np.ones(101)).outputs
    assert y[:2] == pytest.approx([0, 0], abs=1e-15) and v[0] == 1
    assert y[2] == pytest.approx(plant[-1], rel=1e-6)  # δ alone: u reaches y after 0.2 s
    forced = loop.forced_response("delta", np.linspace(0, 0.35, 36), np.ones(36)).outputs
    assert forced[:, -1] == pytest.approx([y[3], v[3]], abs=1e-10)


@pytest.mark.parametrize("keep_factors", [False, True])
def test_a_model_that_integrates_and_waits_keeps_a_root_at_zero_and_the_remedies_work(keep_factors):
    plant, F = nrdob.delay(1.0) / s, nrdob.LowPassFilter(3.0, 1)
    held = nrdob.judge_observer(plant, plant, F, keep_factors=keep_factors)
    assert held.stable is False and "integrator and waits" in held.reason
    slow = nrdob.judge_observer(plant, nrdob.delay(1.0) / (s + 0.05), F)
    at_once = nrdob.judge_observer(plant, 1 / s, F)
    assert slow.stable and at_once.stable
