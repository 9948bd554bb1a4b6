"""The sampled loop run with limits: against a fine grid, closed forms, and linear simulations."""

from fractions import Fraction
from math import inf

import control as ct
import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

import nrdob
from firmware import python_class
from nrdob.digital import ActuatorLimits
from nrdob.sampling import random_loop

s = ct.tf("s")
LAG = ct.tf([2.0], [1.0, 1.0])
PI = ct.tf([1.0, 1.0], [1.0, 0.0])


def lag_loop(process=LAG, controller=PI, lag=0.5):
    return nrdob.NRDOB(
        process=process, model=LAG, controller=controller, filter=nrdob.LowPassFilter(lag, 1)
    )


def on_a_fine_grid(sampled, controller, num, den, delays, inputs, eta, finer):
    """Run the generated class against the process stepped `finer` times a sample.

    Dead times of u and of delta are whole numbers of fine steps, so that holding u over a fine
    step is exact.
    """
    A, B, C, D, _ = cont2discrete(
        ct.ssdata(ct.ss(ct.tf(num, den))), sampled.dt / finer, method="zoh"
    )
    R, d, delta = inputs
    late_u, late_delta = [0.0] * (delays[0] + 1), [0.0] * (delays[1] + 1)
    x = np.zeros((len(A), 1))
    ys, us = [], []
    v = 0.0
    for k in range(len(R)):
        y = float((C @ x)[0, 0] + D[0, 0] * v) + d[k]
        u = controller.step(R[k], y + eta[k])
        ys.append(y)
        us.append(u)
        for _ in range(finer):
            late_u = [u, *late_u[:-1]]
            late_delta = [delta[k], *late_delta[:-1]]
            v = late_u[delays[0]] + late_delta[delays[1]]
            x = A @ x + B * v
    return np.array(ys), np.array(us)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("num", "den", "delay", "computation"),
    [
        ([2.0], [1.0, 1.0], 0.0, 0.0),
        ([2.0], [1.0, 1.0], 0.07, 0.0),
        ([1.8], [0.3, 1.3, 1.0], 0.26, 0.05),
        ([0.4, 2.0], [1.0, 1.0], 0.0, 0.03),  # with a direct path
        ([0.4, 2.0], [1.0, 1.0], 0.24, 0.0),
        ([1.0], [1.0, 0.2, 4.0], 0.1, 0.1),
    ],
)
def test_signals_are_those_of_a_process_stepped_a_hundred_times_finer(num, den, delay, computation):
    rng = np.random.default_rng(3)
    process = ct.tf(num, den)
    loop = lag_loop(nrdob.delay(delay) * process if delay else process)
    sampled = loop.sampled(0.1, computation_delay=computation)
    limits = ActuatorLimits(-1.2, 2.5, rate=8)
    R, d, delta, eta = rng.standard_normal((4, 120))
    controller = python_class(sampled.code(limits=limits).to_python())()
    delays = round(1000 * (delay + computation)), round(1000 * delay)
    y, applied = on_a_fine_grid(
        sampled, controller, num, den, delays, (R, d, delta), 0.1 * eta, 100
    )
    found = sampled.simulate({"R": R, "d": d, "delta": delta}, 0.1 * eta, limits)
    assert found.limited.mean() > 0.2
    np.testing.assert_allclose(found.y, y, atol=1e-10)
    np.testing.assert_allclose(found.applied, applied, atol=1e-10)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_without_limits_it_is_the_linear_loop_of_scipy(number):
    paper, dt = nrdob.paper.example(number), 0.01
    rational = ct.tf(*paper.fractions.G)
    sampled = nrdob.NRDOB(rational, paper.model, paper.controller, paper.filter).sampled(dt)
    d = np.random.default_rng(number).standard_normal(400)
    # Tustin's rule puts (2/dt)(z - 1)/(z + 1) for s, in all the feedback as in each block.
    K = ct.ss(ct.sample_system(paper.K.to_tf(), dt, "bilinear"))
    # A direct path answers with what the hold gave until the sample.
    A, B, C, D = ct.ssdata(ct.ss(rational))
    held = ct.ss(ct.sample_system(ct.ss(A, B, C, 0), dt, "zoh"))
    G = held + D[0, 0] * ct.ss(0, 1, 1, 0, dt)
    S = ct.feedback(ct.ss([], [], [], [[1.0]], dt), G * K)
    expected = dlsim((S.A, S.B, S.C, S.D, dt), d)[1][:, 0]
    size = np.maximum.accumulate(np.abs(expected))
    assert np.max(np.abs(sampled.simulate({"d": d}).y - expected) / size) < 1e-7


def test_between_samples_a_lag_answers_with_exponentials():
    times = np.arange(5) / 10
    found = lag_loop().sampled(0.5).step_response("R", times)
    first = found.outputs[1, 0, 0]
    after = 2 * first * (1 - np.exp(-times))
    np.testing.assert_allclose(found.outputs[0, 0], after, rtol=1e-12)


def test_limits_hold_in_every_sample():
    limits = ActuatorLimits(-0.3, 0.8, rate=2.0)
    found = (
        lag_loop()
        .sampled(0.05)
        .simulate(
            {"R": lambda t: np.sign(np.sin(t)), "d": 0.1}, noise=0.2, limits=limits, timepts=20.0
        )
    )
    steps = np.abs(np.diff(found.applied, prepend=0.0))
    assert found.applied.min() >= -0.3
    assert found.applied.max() <= 0.8
    assert steps.max() <= 2.0 * 0.05 * (1 + 1e-12)
    free = ~found.limited
    assert 0 < free.sum() < free.size
    np.testing.assert_allclose(found.applied[free], found.u[free], atol=1e-9)


def test_limits_too_wide_to_be_met_change_nothing():
    sampled = lag_loop(nrdob.delay(0.13) * LAG).sampled(0.05)
    R = np.random.default_rng(0).standard_normal(300)
    free, wide = (
        sampled.simulate({"R": R}),
        sampled.simulate({"R": R}, limits=ActuatorLimits(-99, 99, 1e6)),
    )
    np.testing.assert_array_equal(free.y, wide.y)


def test_the_estimate_ends_at_the_disturbance():
    found = lag_loop().sampled(0.1).simulate({"delta": -0.7, "R": 0.5}, timepts=30.0)
    assert found.d_hat[-1] == pytest.approx(-0.7, abs=1e-9)
    assert found.y[-1] == pytest.approx(0.5, abs=1e-9)


# Windup.


def far_and_back(observer_input, tracking_time=None, controller=1.0):
    """Reference out of reach for 20 s, then within."""
    sampled = lag_loop(controller=controller).sampled(0.05)
    return sampled.simulate(
        {"R": lambda t: np.where(t < 20, 2.0, 0.3)}, limits=ActuatorLimits(-0.4, 0.4), timepts=60.0,
        observer_input=observer_input, tracking_time=tracking_time,
    )  # fmt: skip


def test_an_observer_told_the_command_winds_up_and_one_told_what_is_applied_does_not():
    wound, cured = far_and_back("commanded"), far_and_back("applied")
    at_change = 400
    assert wound.u[at_change - 1] > 5 * cured.u[at_change - 1]
    # It grows like an integrator for as long as the actuator withholds.
    assert wound.u[399] - wound.u[299] == pytest.approx(wound.u[299] - wound.u[199], rel=1e-3)
    assert cured.u[399] == pytest.approx(cured.u[299], rel=1e-6)
    late = {name: np.argmax(~r.limited[at_change:]) for name, r in
            (("wound", wound), ("cured", cured))}  # fmt: skip
    assert late["cured"] * 0.05 < 1 < 5 < late["wound"] * 0.05


def test_back_calculation_lets_the_integrator_of_the_controller_follow():
    wound = far_and_back("applied", controller=PI)
    cured = far_and_back("applied", tracking_time=0.5, controller=PI)
    assert wound.limited[400:700].all()
    assert not cured.limited[420:].any()
    assert cured.y[-1] == pytest.approx(0.3, abs=1e-6)


def test_tracking_that_would_make_a_limited_c_unstable_is_refused():
    G = (s + 3) / ((s + 1) * (s**2 + 0.04 * s + 4))
    lead = ct.tf([5.076, 13.04, 7.018], [0.1599, 1.304, 0])
    sampled = nrdob.NRDOB(
        G, (s + 3) / ((s + 1) * (s + 2) ** 2), lead, nrdob.LowPassFilter(0.0652, 2)
    ).sampled(0.0061)
    limits = ActuatorLimits(-2, 2)
    for short in (0.0305, 3.0):
        with pytest.raises(ValueError, match=r"unstable while u is limited"):
            sampled.code(limits, tracking_time=short)
    calm = sampled.simulate({"R": np.ones(800)}, limits=limits, tracking_time=10.0)
    assert np.abs(calm.u).max() < 50


def test_fed_with_what_is_applied_the_blocks_keep_their_own_poles():
    rng = np.random.default_rng(5)
    for _ in range(20):
        sampled = random_loop(rng).sampled(0.05)
        wired = sampled.controller
        own = np.concatenate(
            [np.linalg.eigvals(wired.A[rows, rows]) for rows in wired.rows.values()]
        )
        whole = np.linalg.eigvals(wired.A)
        assert abs(np.prod(1.7 - whole) / np.prod(1.7 - own) - 1) < 1e-9
        # With F u fed back on itself, 1 - F stands in the denominator: z = 1 is a pole.
        circle = wired.A + np.outer(wired.B[:, 2], wired.C)
        assert np.abs(np.linalg.eigvals(circle) - 1).min() < 1e-5


# Start.


def test_a_start_from_manual_is_bumpless_and_stays_at_rest():
    sampled = lag_loop(nrdob.delay(0.12) * LAG).sampled(0.05)
    u, delta, d = 0.4, 0.1, 0.05
    y = 2 * (u + delta) + d
    found = sampled.simulate({"R": y, "delta": delta, "d": d}, timepts=5.0, start=u)
    np.testing.assert_allclose(found.u, u, rtol=1e-12)
    np.testing.assert_allclose(found.y, y, rtol=1e-12)
    np.testing.assert_allclose(found.d_hat, 0.1 + 0.05 / 2, rtol=1e-12)


def test_with_an_integrator_in_the_controller_the_first_command_is_the_manual_one():
    found = lag_loop().sampled(0.05).simulate({"R": 3.0}, noise=0.1, timepts=5.0, start=0.4)
    assert found.u[0] == pytest.approx(0.4, rel=1e-12)
    assert found.u[1] != pytest.approx(0.4, abs=1e-3)
    assert found.u[-1] == pytest.approx(1.5, abs=0.3)


def test_an_integrating_process_starts_where_nothing_moves():
    process = ct.tf([1.0], [1.0, 0.0])
    loop = nrdob.NRDOB(process, ct.tf([1.0], [1.0, 0.01]), 1.0, nrdob.LowPassFilter(0.2, 1))
    sampled = loop.sampled(0.05)
    with pytest.raises(ValueError, match=r"start from u = -0\.2"):
        sampled.simulate({"delta": 0.2}, timepts=1.0, start=0.0)
    with pytest.raises(ValueError, match=r"start from u = 0$"):
        sampled.simulate({"R": 0.0}, timepts=1.0, start=1.0)
    found = sampled.simulate({"delta": 0.2, "R": 0.0}, timepts=1.0, start=-0.2)
    assert np.abs(found.y).max() < 1e-12


# Converters.


def test_a_rounded_reading_is_a_whole_number_of_steps_nearest_to_the_noisy_output():
    found = (
        lag_loop()
        .sampled(0.05)
        .simulate(
            {"R": 1.0}, noise=0.1, timepts=10.0, resolution=0.04, limits=ActuatorLimits(0, 0.7)
        )
    )
    exact = lag_loop().sampled(0.05).simulate({"R": 1.0}, noise=0.1, timepts=10.0)
    steps = found.measured / 0.04
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    noise = exact.measured - exact.y  # of the same seed
    assert np.abs(found.measured - found.y - noise).max() <= 0.02 * (1 + 1e-9)


def test_rounding_far_below_a_signal_changes_nothing_to_speak_of():
    sampled = lag_loop().sampled(0.05)
    R = np.random.default_rng(0).standard_normal(300)
    plain, rounded = sampled.simulate({"R": R}), sampled.simulate({"R": R}, resolution=1e-12)
    np.testing.assert_allclose(plain.y, rounded.y, atol=1e-9)


# A model that waits.


@pytest.mark.parametrize("wait", [0.2, 0.13, 0.02])
def test_a_matched_model_that_waits_never_sees_the_dead_time(wait):
    process = nrdob.delay(0.2) * LAG
    loop = nrdob.NRDOB(process, nrdob.delay(wait) * LAG, PI, nrdob.LowPassFilter(0.5, 1))
    sampled = loop.sampled(0.05)
    R = np.ones(200)
    found = sampled.simulate({"R": R}, limits=ActuatorLimits(-1, 0.9))
    controller = python_class(sampled.code(limits=ActuatorLimits(-1, 0.9)).to_python())()
    u = []
    for r, y in zip(R.tolist(), found.measured.tolist(), strict=True):
        u.append(controller.step(r, y))
    np.testing.assert_allclose(found.applied, u, rtol=1e-11)
    assert found.y[-1] == pytest.approx(1.0, abs=1e-3)


# Noise.


def test_noise_is_white_of_its_deviation_and_of_its_seed():
    sampled = lag_loop().sampled(0.05)
    one, same, other = (sampled.simulate({}, 0.3, timepts=500.0, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.y, same.y)
    assert np.abs(one.y - other.y).max() > 0
    eta = one.measured - one.y
    assert eta.std() == pytest.approx(0.3, rel=0.05)
    assert abs(np.corrcoef(eta[1:], eta[:-1])[0, 1]) < 0.05
    generator = np.random.default_rng(1)
    np.testing.assert_array_equal(sampled.simulate({}, 0.3, timepts=500.0, seed=generator).y, one.y)


# Bad input.


@pytest.mark.parametrize(
    ("inputs", "more", "error", "match"),
    [
        ({"R": np.ones(5), "d": np.ones(6)}, {}, ValueError, "differ in length: R has 5, d has 6"),
        ({"R": np.ones(5)}, {"timepts": 1.0}, ValueError, "R has the shape .5,., and there are 11"),
        ({"R": [1.0, np.nan]}, {}, ValueError, r"R\[1\] is nan; every value must be finite"),
        ({"R": [1.0, 2.0]}, {"noise": [0.0, inf]}, ValueError, r"noise\[1\] is inf"),
        ({"eta": [1.0]}, {}, ValueError, "'eta' is no input.*noise="),
        ({"r": [1.0]}, {}, ValueError, "'r' is no input; choose from R, d, delta"),
        ({"R": 1.0}, {}, ValueError, "no input says how many samples"),
        ({"R": "one"}, {"timepts": 1.0}, TypeError, "R is 'one'"),
        ([1.0, 2.0], {}, TypeError, "inputs is a list; give a mapping"),
        ({"R": 1.0}, {"timepts": [0.0, 0.2]}, ValueError, r"timepts\[1\] is 0.2 s, and sample"),
        ({"R": []}, {}, ValueError, "the signals are empty"),
        ({"R": 1.0}, {"timepts": "all"}, TypeError, "timepts is 'all'; give the times"),
        ({"R": [1.0]}, {"limits": (0, 1)}, TypeError, "tuple; give nrdob.digital.ActuatorLimits"),
        ({"R": 1.0}, {"timepts": -1.0}, ValueError, "timepts is -1.0"),
        ({"R": 1.0}, {"timepts": inf}, ValueError, "timepts is inf"),
        ({"R": [1.0]}, {"noise": -1.0}, ValueError, "noise is -1"),
        ({"R": [1.0]}, {"observer_input": "u"}, ValueError, "observer_input is 'u'; choose one of"),
        ({"R": [1.0]}, {"resolution": 0.0}, ValueError, "the resolution is 0"),
        ({"R": [1.0]}, {"start": np.nan}, ValueError, "start is nan"),
        ({"R": [1.0]}, {"tracking_time": 1e-3}, ValueError, "tracking_time is 0.001 s; .*least"),
    ],
)  # fmt: skip
def test_a_signal_that_cannot_be_is_refused_with_its_remedy(inputs, more, error, match):
    with pytest.raises(error, match=match):
        lag_loop().sampled(0.1).simulate(inputs, **more)


@pytest.mark.parametrize(
    ("limits", "error", "match"),
    [
        ((1.0, 1.0), ValueError, "low must be below high"),
        ((2.0, 1.0), ValueError, r"low = 2 and high = 1.*is it ActuatorLimits\(low, high\)"),
        ((Fraction(5, 2), Fraction(1)), ValueError, r"low = 2\.5 and high = 1"),
        ((0.0, 1.0, Fraction(-1, 2)), ValueError, r"the rate limit is -0\.5"),
        ((np.nan, 1.0), ValueError, "low must be below high"),
        ((0.0, 1.0, 0.0), ValueError, "the rate limit is 0.*must be positive"),
        ((0.0, 1.0, -5.0), ValueError, "must be positive"),
        ((0.0, 1.0, np.nan), ValueError, "must be positive"),
        (("0", 1.0), TypeError, "low is '0', a str; limits are numbers"),
        ((True, 2.0), TypeError, "low is True"),
        ((10**400, 2.0), ValueError, "low = inf and high = 2"),  # too large for a float
    ],
)
def test_limits_that_leave_nothing_are_refused(limits, error, match):
    with pytest.raises(error, match=match):
        ActuatorLimits(*limits)


def test_tracking_needs_one_integrator_in_the_controller():
    with pytest.raises(ValueError, match=r"and this one has none: leave it out"):
        lag_loop(controller=1.0).sampled(0.1).simulate({"R": [1.0]}, tracking_time=1.0)


@pytest.mark.slow
def test_a_loop_that_runs_away_says_where():
    loop = lag_loop(ct.tf([2.0], [1.0, -3.0]), controller=0.1, lag=5.0)
    with pytest.raises(ArithmeticError, match="the loop is unstable, or the limits"):
        loop.sampled(0.1).simulate({"R": 1.0}, timepts=1e4)


def test_one_sample_is_enough():
    found = lag_loop().sampled(0.1).simulate({"R": [1.0]}, limits=ActuatorLimits(0, 0.2))
    assert found.time.tolist() == [0.0]
    assert found.applied.tolist() == [0.2]
    assert "1 samples to 0 s, u limited in 1 of them" in repr(found)


@pytest.mark.slow
@pytest.mark.parametrize("last", [9e4, 1.1e5])
def test_a_step_response_of_more_than_a_million_samples_is_refused(last):
    sampled = lag_loop().sampled(0.1)
    if last < 1e5:
        y, u = sampled.step_response("R", [last]).outputs[:, 0, -1]
        assert (y, u) == (pytest.approx(1), pytest.approx(0.5))
    else:
        with pytest.raises(ValueError, match=r"110000\d samples .*; at most 1000000"):
            sampled.step_response("R", [last])


# The same by other ways.


@pytest.mark.parametrize("method", ["tustin", "zoh"])
@pytest.mark.parametrize("input", ["R", "d", "delta", "eta"])
def test_a_unit_step_is_the_step_response(method, input):
    sampled = lag_loop(nrdob.delay(0.13) * LAG).sampled(0.05, method, computation_delay=0.02)
    times = np.arange(240) * 0.0125
    y = sampled.step_response(input, times).outputs[0, 0]
    step = np.ones(60)
    given = ({}, step) if input == "eta" else ({input: step}, None)
    np.testing.assert_allclose(sampled.simulate(*given).y, y[::4], atol=1e-9)


@pytest.mark.parametrize("lag", [0.05, 0.5, 3.0])
def test_a_matched_model_of_an_unstable_process_works_on_the_processor_too(lag):
    s = ct.tf("s")
    Gm = 4 / (2 - s - s**2)
    loop = nrdob.NRDOB(Gm, Gm, -1.0, nrdob.interpolating_filter(Gm, lag))
    sampled = loop.sampled(0.02)
    assert sampled.stability().stable
    found = sampled.simulate({"d": np.eye(1, 3000)[0]})
    assert np.abs(found.y[-100:]).max() < 1e-6 * np.abs(found.y).max()


@pytest.mark.parametrize("model", [ct.tf([1.0], [1.0, 2.0, 0.0]), 4 / ct.tf([-1, -1, 2], [1])])
def test_each_block_is_what_the_diagram_says_whatever_cancels_in_another(model):
    filter = nrdob.interpolating_filter(model, 0.3)
    blocks = nrdob.NRDOB(model, model, -1.0, filter).sampled(0.05).controller.blocks
    w = 1j * np.logspace(-1, 2, 30)
    z = (1 + 0.025 * w) / (1 - 0.025 * w)
    F, inverse, prediction = (
        ct.ss(block.A, block.B[:, None], block.C[None], block.D, 0.05)(z)
        for block in (blocks["F"], blocks["F/Gm"], blocks["(1-F)Gm"])
    )
    np.testing.assert_allclose(inverse * model(w), F, rtol=1e-9)
    np.testing.assert_allclose(prediction, (1 - F) * model(w), rtol=1e-7)
