"""Loops whose model waits, with two dead times: verdicts, margins and responses."""

import math
from functools import cache

import control as ct
import mpmath as mp
import numpy as np
import pytest

import nrdob
from densegrid import roots_on_the_right, values_on_axis
from nrdob.analysis import judge, step_response
from nrdob.diagram import INPUTS
from nrdob.numerics import QuasiPolynomial, Term, count_rhp
from tests.campaigns import waiting
from tests.campaigns.runner import plain
from tests.oracles.contour import rhp_by_argument
from tests.oracles.plain import p_B

s = ct.tf("s")
LAG = ct.tf([1], [1, 1])


def example_4(wait, delay=0.05, gain=1.0):
    """Example 4 of the paper with a model that waits."""
    ex = nrdob.paper.example(4)
    G = nrdob.delay(delay) * gain * ex.process.tf
    return nrdob.NRDOB(G, nrdob.delay(wait) * ex.model, ex.controller, ex.filter)


def adaptive_argument_count(loop, integrators=0):
    """RHP roots of p_B by halving steps of ω until the argument moves little, from its formula.

    Without roots at s = 0, as many as integrators of the model cancel.
    """
    G, Gm, _, F = loop.fractions

    def p(omega):
        x = 1j * omega
        N, D, Nm, Dm, Nf, Df = (np.polyval(c, x) for f in (G, Gm, F) for c in f)
        wait = np.exp(-loop.model_delay * x)
        total = D * Nm * (Df - Nf * wait) + N * Dm * Nf * np.exp(-loop.delay * x)
        return total / x**integrators

    degree = G.den.size + Gm.num.size + F.den.size - 3 - integrators
    fastest = max(1, *np.abs(np.roots(np.polymul(G.den, F.den))))
    top, turn = 1e4 * fastest, 2 * math.pi / max(loop.delay, loop.model_delay)
    # Between two frequencies less than a turn, or what turns is small.
    lowest = 1e-6 if integrators < 2 else 1e-4
    omega = np.union1d(np.geomspace(lowest, top, 2000), np.arange(lowest, 50 * fastest, turn / 15))
    lead = G.den[0] * Gm.num[0] * F.den[0]
    return round(roots_on_the_right(values_on_axis(p, omega), lead, degree))


# Verdicts.


@pytest.mark.thorough
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


@pytest.mark.slow
def test_random_verdicts_neutral_ones_included_are_those_of_ball_arithmetic():
    rng = np.random.default_rng(12)
    neutral = 0
    for _ in range(25):
        loop = waiting.random_loop(rng)
        found, true = loop.stability().observer_loop, rhp_by_argument(p_B(plain(loop)))
        neutral += found.kind == "neutral"
        if true is not None and not math.isnan(true):
            assert found.closed_loop_rhp == true
    assert neutral


@pytest.mark.slow
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
    at_origin = QuasiPolynomial([1.0, 1.0], [-2.0, -2.0], 1.0, more=(Term(np.array([1.0]), 0.7),))
    assert at_origin.zeros_at_origin == 1
    assert count_rhp(at_origin).count == math.inf


# Margins.


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("wait", [0.02, 0.05, 0.4, 1.0])
def test_the_sensitivity_peak_is_the_highest_of_a_dense_grid(wait):
    loop = example_4(wait)
    margins = loop.margins().plant_loop
    near = margins.wms * (1 + np.linspace(-0.01, 0.01, 4001))
    omega = np.concatenate([np.geomspace(1e-3, 1e3, 200_001), near])
    assert np.abs(loop.S_d(1j * omega)).max() == pytest.approx(margins.ms, rel=1e-9)


@pytest.mark.slow
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

    @cache  # y and u are asked at the same points
    def maps(x):
        N, D, Nm, Dm, Nc, Dc, Nf, Df = (mp.polyval(row, x) for row in rows)
        E, Em = mp.exp(-x * loop.delay), mp.exp(-x * loop.model_delay)
        p_A, p_B = Dm * Dc + Nm * Nc, D * Nm * (Df - Nf * Em) + N * Dm * Nf * E
        S_d = D * Nm * (Df - Nf * Em) / p_B
        return {
            "R": lambda: (N * E * Nc * Nm * Dm * Df / p_A / p_B, Nc * D * Nm * Dm * Df / p_A / p_B),
            "d": lambda: (S_d, -D * Dm * Nf / p_B),
            "delta": lambda: (N * E / D * S_d, S_d),
            "eta": lambda: (-N * E * Dm * Nf / p_B, -D * Dm * Nf / p_B),
        }[input]()

    return [
        float(mp.invertlaplace(lambda x, k=k: maps(x)[k] / x, t, method="dehoog", degree=60))
        for k in (0, 1)
    ]


@pytest.mark.thorough
@pytest.mark.parametrize("input", INPUTS)
@pytest.mark.parametrize(("theta", "wait"), [(0.05, 0.03), (0.05, 0.2), (0.0, 0.3)])
def test_steps_are_the_inverse_laplace_transform(theta, wait, input):
    loop = example_4(wait, delay=theta)
    found = step_response(loop, input, [0.513]).outputs[:, 0, 0]
    assert found == pytest.approx(laplace(loop, input, 0.513), abs=1e-11)


@pytest.mark.slow
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


def test_what_comes_later_does_not_change_the_beginning():
    fast = 100 / (s + 100)
    loop = nrdob.NRDOB(
        nrdob.delay(1.0) * fast, nrdob.delay(0.9) * fast, 0.2 / s, nrdob.LowPassFilter(1.0, 1)
    )
    times = np.linspace(0, 30, 50)
    whole, first = (step_response(loop, "d", t).outputs[:, 0] for t in (times, times[:10]))
    assert whole[:, :10] == pytest.approx(first, abs=1e-12)


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
    assert y[:2] == pytest.approx([0, 0], abs=1e-15) and v[0] == pytest.approx(1, abs=1e-15)
    assert y[2] == pytest.approx(plant[-1], rel=1e-6)  # δ alone: u reaches y after 0.2 s
    forced = loop.forced_response("delta", np.linspace(0, 0.35, 36), np.ones(36)).outputs
    assert forced[:, -1] == pytest.approx([y[3], v[3]], abs=1e-10)


# A model that integrates and waits.


def integrating_loop(rng):
    """Draw a loop whose model integrates once or twice, with a filter that lets that cancel."""
    loop = waiting.random_loop(rng)
    while not loop.delay or loop.fractions.F.num.size > 1:
        loop = waiting.random_loop(rng)
    k, leak = int(rng.integers(1, 3)), 10 ** rng.uniform(-1.5, 0)
    plant = (s + leak * rng.integers(0, 2)) * (s + leak * rng.integers(0, 2)) ** (k - 1)
    model = loop.model / s**k
    ramp = k + int(rng.integers(0, 2))
    F = nrdob.interpolating_filter(model, loop.filter.time_constant, ramp=ramp)
    if k == 1 and ramp == 1:
        F = nrdob.LowPassFilter(loop.filter.time_constant, loop.filter.order + 1)
    return nrdob.NRDOB(loop.process / plant, model, loop.controller, F), k


@pytest.mark.thorough
def test_random_verdicts_with_integrators_that_cancel_are_those_of_an_independent_count():
    rng = np.random.default_rng(21)
    seen = set()
    for _ in range(40):
        loop, k = integrating_loop(rng)
        found, counted = loop.stability().observer_loop, adaptive_argument_count(loop, k)
        if found.stable is None:  # dead times so long that the roots are not computed
            assert not loop.p_B.roots_resolved and f"Z = {counted}, " in found.reason
            continue
        assert found.closed_loop_rhp == counted
        seen.add((k, loop.p_B.divided, found.stable))
    assert {(1, 0, True), (1, 1, True), (2, 2, False), (1, 1, False), (2, 0, True)} <= seen


@pytest.mark.parametrize("theta", [0.4, 1.0, 1.3])
def test_an_exact_integrating_model_leaves_the_poles_of_the_filter_and_a_wrong_one_does_not(theta):
    F = nrdob.LowPassFilter(0.5, 2)
    loop = nrdob.NRDOB(nrdob.delay(theta) / s, nrdob.delay(1.0) / s, 0.3, F)
    verdict = loop.stability()
    assert verdict.stable and "memory of length θm" in verdict.reason
    if theta == 1.0:
        assert not loop.p_B.delay and loop.p_B.roots.real == pytest.approx([-2, -2], rel=1e-6)
    else:
        x = loop.p_B.roots[0]  # (λs + 1)² - exp(-s) + exp(-θs)
        value = (0.5 * x + 1) ** 2 - np.exp(-x) + np.exp(-theta * x)
        assert abs(value) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("leak", [0.0, 0.2])
def test_a_constant_input_disturbance_leaves_something_unless_one_more_zero_is_taken(
    leak,
):
    plant, model = nrdob.delay(0.9) * 1.2 / (s + leak), nrdob.delay(1.0) / s
    loop = nrdob.NRDOB(plant, model, 0.3, nrdob.LowPassFilter(0.5, 1))
    # E(0) = nλ + θm, and S_δ(0) = N E/(D E + N)
    remains = 1.2 * 1.5 / (leak * 1.5 + 1.2)
    assert loop.S_delta.dc_gain == pytest.approx(remains, rel=1e-12)
    assert loop.step_response("delta", [200.0]).outputs[0, 0, 0] == pytest.approx(remains, rel=1e-9)
    F = nrdob.interpolating_filter(model, 0.5, ramp=2)
    ramp = nrdob.NRDOB(plant, model, 0.3, F)
    assert ramp.S_delta.dc_gain == 0.0 and ramp.stability().stable
    assert abs(ramp.step_response("delta", [200.0]).outputs[0, 0, 0]) < 1e-9


def test_two_integrators_take_a_filter_that_leads_by_the_dead_time():
    model = nrdob.delay(0.1) / s**2
    F = nrdob.interpolating_filter(model, 0.2)
    assert F.num[0][0] == pytest.approx([3 * 0.2 + 0.1, 1.0], rel=1e-15)
    assert nrdob.judge_observer(nrdob.delay(0.12) * 1.2 / s**2, model, F).stable
    usual = nrdob.judge_observer(model, model, nrdob.LowPassFilter(0.2, 2))
    assert usual.stable is False and "interpolating_filter" in usual.reason


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("leak", "theta", "input", "t"),
    [
        (0.0, 0.9, "R", 3.313),
        (0.2, 0.9, "delta", 0.513),
        (0.2, 1.0, "eta", 3.313),
        (0.2, 0, "d", 2),
    ],
)
def test_steps_with_an_integrator_that_cancels_are_the_inverse_laplace_transform(
    leak, theta, input, t
):
    plant, model = nrdob.delay(theta) * 1.2 / (s + leak), nrdob.delay(1.0) / s
    loop = nrdob.NRDOB(plant, model, 0.3, nrdob.LowPassFilter(0.5, 2))
    found = step_response(loop, input, [t]).outputs[:, 0, 0]
    assert found == pytest.approx(laplace(loop, input, t), abs=1e-10)


def simulated(loop, naive, start, last, dt):
    """u after a step of R, marched as the diagram is wired, with (1 - F exp(-θm s))/s as one block.

    For F = 1/(λs + 1), a model gain/s and a plant b/(s + a). The block is (1 - F)/s = λF and F of
    an integral over the last θm; naive, of an integral less a delayed integral, which begin with
    `start` instead of 0.
    """
    lam, wait, late = loop.filter.time_constant, loop.model_delay, loop.delay
    (b,), (_, a) = loop.fractions.G
    gain, C = loop.fractions.Gm.num[0], loop.fractions.C.num[0]
    steps, behind, ahead = (round(T / dt) for T in (last, wait, late))
    u = np.zeros(steps + 1)
    y = f_y = f_u = f_now = f_memory = 0.0
    memory, integral, delayed = 0.0, start, 0.0
    for k in range(steps):
        then = u[k - behind] if k >= behind else 0.0
        window = integral - delayed if naive else memory
        y_f = f_y + gain * (lam * f_now + f_memory)
        inverse = (y - f_y) / (lam * gain)  # (F/Gm0) y = s F y/gain
        u[k] = C * (1.0 - y_f) + f_u - inverse
        into = u[k - ahead] if k >= ahead else 0.0
        y += dt * (b * into - a * y)
        f_y += dt * (y - f_y) / lam
        f_u += dt * (then - f_u) / lam
        f_now += dt * (u[k] - f_now) / lam
        f_memory += dt * (window - f_memory) / lam
        integral += dt * u[k]
        delayed += dt * then
        memory = dt * u[max(k + 1 - behind, 0) : k + 1].sum()
    return u[:-1]


def test_the_diagram_marched_with_a_memory_answers_so_and_with_two_integrators_it_remembers():
    plant, model = nrdob.delay(0.9) * 1.2 / (s + 0.2), nrdob.delay(1.0) / s
    loop = nrdob.NRDOB(plant, model, 0.3, nrdob.LowPassFilter(0.5, 1))
    times = np.array([0.3, 1.5, 4.0, 12.0])
    exact = loop.step_response("R", times).outputs[1, 0]
    for dt, error in ((0.02, 0.04), (0.01, 0.02)):
        at = np.round(times / dt).astype(int)
        found = simulated(loop, naive=False, start=0.0, last=13.0, dt=dt)[at]
        assert found == pytest.approx(exact, abs=error)
    # What the two integrators begin with apart stays for ever, as a constant error of u.
    wrong = simulated(loop, naive=True, start=0.5, last=60.0, dt=0.02)
    right = simulated(loop, naive=True, start=0.0, last=60.0, dt=0.02)
    assert abs(wrong[-1] - right[-1]) > 0.05
    kept = nrdob.NRDOB(plant, model, 0.3, loop.filter, keep_factors=True).stability()
    assert kept.stable is False and "keep_factors=False" in kept.reason


@pytest.mark.slow
def test_a_gain_beside_the_margin_of_an_integrating_loop_is_on_the_side_that_the_margin_says():
    def loop(gain):
        G = nrdob.delay(0.9) * (1.2 * gain) / (s + 0.2)
        return nrdob.NRDOB(G, nrdob.delay(1.0) / s, 0.3, nrdob.LowPassFilter(0.5, 1))

    margins = loop(1.0).margins().plant_loop
    omega = np.geomspace(1e-3, 1e2, 100_001)
    assert margins.ms == pytest.approx(np.abs(loop(1.0).S_d(1j * omega)).max(), rel=1e-6)
    for factor, stable in ((1 - 1e-6, True), (1 + 1e-6, False)):
        assert loop(factor * margins.gm_high).stability().observer_loop.stable is stable
    turned = nrdob.encirclements(loop(1.05 * margins.gm_high).L)
    assert turned.closed_loop_rhp == 2 == turned.encirclements


@pytest.mark.thorough
@pytest.mark.parametrize("which", ["S_eta", "U_eta", "S_delta"])
def test_noise_power_with_an_integrator_that_cancels_is_the_integral(which):
    plant, model = nrdob.delay(0.9) * 1.2 / (s + 0.2), nrdob.delay(1.0) / s
    loop = nrdob.NRDOB(plant, model, 0.3, nrdob.LowPassFilter(0.5, 2))
    quotient = getattr(loop, which)
    omega = np.concatenate([np.linspace(0, 400, 400_001)[1:], np.geomspace(400, 1e5, 200_001)[1:]])
    density = np.abs(quotient(1j * omega)) ** 2
    ends = omega[0] * density[0] + omega[-1] * density[-1]  # what falls off with 1/ω² at least
    power = (np.trapezoid(density, omega) + ends) / np.pi
    assert quotient.noise_power() == pytest.approx(power, rel=1e-5)


@pytest.mark.parametrize(
    ("plant", "order"), [(1.2 / s, 1), (1.2 / (s + 0.2), 2), (1.2 / (s - 0.2), 1)]
)
def test_sets_under_an_integrating_model_that_waits_end_where_roots_cross(plant, order):
    G, Gm = nrdob.delay(0.9) * plant, nrdob.delay(1.0) / s
    found = nrdob.stabilizing_time_constants(G, Gm, order)
    assert found
    floor = nrdob.critical_time_constants(G, Gm, order)[0].time_constant * 0.999
    for low, high in found:
        for end, inside in ((low, 1 + 1e-6), (high, 1 - 1e-6)):
            if floor < end < math.inf:
                for factor, stable in ((inside, True), (2 - inside, False)):
                    F = nrdob.LowPassFilter(factor * end, order)
                    assert nrdob.judge_observer(G, Gm, F).stable is stable
    if plant.den[0][0][-1] < 0:  # (nλ + θm) D(0) + N(0) = 0
        assert found[-1][1] == pytest.approx((1.2 / 0.2 - 1.0) / order, rel=1e-12)


def test_an_integrator_is_met_exactly_and_another_pole_on_the_right_is_refused_with_the_reason():
    model = nrdob.delay(0.5) * 2 * (1 - 0.3 * s) / (s * (s + 1))
    F = nrdob.interpolating_filter(model, 0.2, ramp=3)
    num, den = (p[0][0][::-1] for p in (F.num, F.den))
    late = [sum(num[i] * (-0.5) ** (k - i) / math.factorial(k - i) for i in range(k + 1))
            for k in range(3)]  # fmt: skip
    assert late == pytest.approx(den[:3], rel=1e-12) and abs(F(1 / 0.3)) < 1e-13
    assert nrdob.judge_observer(model, model, F).stable
    with pytest.raises(ValueError, match="pole at s = 2 and a dead time"):
        nrdob.interpolating_filter(nrdob.delay(0.5) / (s - 2), 0.2)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("time_constant", [1e-3, 3e-4])
def test_a_filter_far_too_fast_for_an_integrating_model_is_decided_by_two_ways(
    order, time_constant
):
    plant, model = nrdob.delay(0.12) * 0.9 / (s + 0.2), nrdob.delay(0.1) / s
    loop = nrdob.NRDOB(plant, model, 0.3, nrdob.LowPassFilter(time_constant, order))
    found = loop.stability().observer_loop
    assert found.stable is False and len(found.ways) == 2
    assert found.closed_loop_rhp == adaptive_argument_count(loop, integrators=1)


def test_a_gain_is_limited_by_what_turns_for_ever():
    # p_B ~ 1 + (4k - 1)/5 exp(-sθ) at infinity, where |kR - 1||F| is largest.
    G, F = nrdob.delay(0.1) * ct.tf([0.04, 1], [0.01, 1]), ct.tf([0.2, 1], [1, 1])
    margins = nrdob.NRDOB(G, nrdob.delay(0.1) * ct.tf([1], [1]), 0.1 / s, F).margins().plant_loop
    assert margins.stable and margins.gm_high == pytest.approx(1.5)


def test_a_verdict_says_which_ways_were_used_for_which_function():
    plant, model = nrdob.delay(2.0033) * LAG, nrdob.delay(2.0) * LAG
    found = nrdob.NRDOB(plant, model, 1 / s, nrdob.LowPassFilter(0.002, 2)).stability()
    first, second = (
        " and ".join(f"by {way}" for way in part.ways)
        for part in (found.model_loop, found.observer_loop)
    )
    assert first != second and found.stable
    assert found.reason.endswith(f", p_A {first}, p_B {second}")


def test_an_input_disturbance_of_a_gain_is_that_gain_times_an_output_disturbance():
    loop = nrdob.NRDOB(
        ct.tf([2.0], [1.0]), nrdob.delay(0.5) * ct.tf([1.0], [1.0]), 0.5 / s,
        nrdob.LowPassFilter(0.5, 1),
    )  # fmt: skip
    times = np.linspace(0, 4, 9)
    by_delta, by_d = (step_response(loop, name, times).outputs[:, 0] for name in ("delta", "d"))
    assert by_delta[0] == pytest.approx(2 * by_d[0], abs=1e-9)
    assert by_delta[1] == pytest.approx(1 + 2 * by_d[1], abs=1e-9)  # v = u + δ
