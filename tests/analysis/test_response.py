"""Time responses against independent high-precision inversions and against python-control."""

import math
import warnings
from functools import cache

import control as ct
import matplotlib as mpl
import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nrdob
from nrdob.analysis import forced_response, step_response
from nrdob.analysis.response import even_times
from nrdob.analysis.steps import radau
from nrdob.diagram import INPUTS, LoopEquations, LowPassFilter, delay
from tests.campaigns import delayedsteps
from tests.campaigns.steps import campaign, exact_step

pytestmark = pytest.mark.usefixtures("no_warning_leaks")
mpl.use("Agg")
s = ct.tf("s")
LAG = ct.tf([1], [1, 1])


def example(k):
    """Return the four examples of the paper."""
    if k == 1:
        G = (2 * s + 10) / (s**2 + 11 * s + 10)
        return LoopEquations(G, G, 1.39 / s, LowPassFilter(0.01, 2))
    if k == 2:
        G, Gm = 0.1 * (-s + 100) / (s + 2), 10 / (s + 2)
        return LoopEquations(G, Gm, (0.5 * s + 1) / s, LowPassFilter(0.025, 2))
    if k == 3:
        G, Gm = 4 / (-(s**2) - s + 2), -1 / (s**2 + 3 * s + 2)
        return LoopEquations(G, Gm, -1.8 * (0.5 * s + 1) / s, LowPassFilter(0.05, 2))
    G, Gm = delay(0.05) / (s + 2) ** 2, 1 / ((s + 1.5) * (s + 2.5))
    return LoopEquations(G, Gm, 2.7 * (s + 1.5) / s, LowPassFilter(0.09, 3))


def neutral(seconds=1.0):
    """Return a stable loop whose biproper plant and filter repeat every jump."""
    G, Gm = delay(seconds) * ct.tf([1, 2], [2, 1]), ct.tf([1, 2], [1, 1])
    return LoopEquations(G, Gm, 1 / s, ct.tf([0.3, 1], [1, 1]))


def delayed_lag(seconds, time_constant=0.5):
    process = delay(seconds) * LAG if seconds else LAG
    return LoopEquations(process, LAG, 0.5 * (s + 1) / s, LowPassFilter(time_constant, 1))


def maps(loop, input):
    """Return the maps from `input` to y and to u."""
    to_y = {"R": loop.T_R, "d": loop.S_d, "delta": loop.S_delta, "eta": loop.S_eta}
    to_u = {"R": loop.U_R, "d": loop.U_d, "delta": loop.U_delta, "eta": loop.U_eta}
    return to_y[input], to_u[input]


# The reference: eqs. (4) and (7) at 50 digits, in the frequency domain.


def exact_term(loop, input, signal, k):
    """Return the rational factor of exp(-kθs) in the step response.

    With E = exp(-θs) the loop's 1/p_B = 1/(q + r E) is the sum of (-r)^k E^k / q^(k+1).
    """
    coefficients = [[mp.mpf(c) for c in part] for block in loop.fractions for part in block]

    def term(s):
        N, D, Nm, Dm, Nc, Dc, Nf, Df = (mp.polyval(c, s) for c in coefficients)
        q, r = D * Nm * (Df - Nf), N * Dm * Nf
        through_process, num = {
            ("R", "y"): (True, lambda: Nc * N * Nm * Dm * Df / (Dm * Dc + Nm * Nc)),
            ("R", "u"): (False, lambda: Nc * D * Nm * Dm * Df / (Dm * Dc + Nm * Nc)),
            ("d", "y"): (False, lambda: q),
            ("d", "u"): (False, lambda: -D * Dm * Nf),
            ("delta", "y"): (True, lambda: N * Nm * (Df - Nf)),
            ("delta", "u"): (False, lambda: q),
            ("eta", "y"): (True, lambda: -r),
            ("eta", "u"): (False, lambda: -D * Dm * Nf),
        }[input, signal]
        if not loop.delay:
            return num() / (q + r) / s
        power = k - through_process
        return num() * (-r) ** power / q ** (power + 1) / s if power >= 0 else mp.mpf(0)

    return term


@cache
@mp.workdps(50)  # as many digits as any test asks for
def contour(nodes):
    """Return points of Talbot's contour and their weights, both at t = 1."""
    r = mp.mpf(2 * nodes) / 5
    found = [(r, r * mp.exp(r) / 2 / nodes)]
    for i in range(1, nodes):
        angle = i * mp.pi / nodes
        cot = mp.cot(angle)
        point = r * angle * (cot + 1j)
        slope = 1 + 1j * angle * (1 + cot**2) - 1j * cot
        found.append((point, r * mp.exp(point) * slope / nodes))
    return found


def talbot(transform, t, nodes=50):
    """Fixed-Talbot inversion of a Laplace transform at t > 0, with the digits that are set."""
    return sum(mp.re(weight * transform(point / t)) for point, weight in contour(nodes)) / t


def exact(loop, input, signal, t):
    """Step response at one time t > 0, which must not be on a jump."""
    last = math.floor(t / loop.delay) if loop.delay else 0
    with mp.workdps(45):
        return float(sum(
            talbot(exact_term(loop, input, signal, k), mp.mpf(t) - k * mp.mpf(loop.delay))
            for k in range(last + 1)
        ))  # fmt: skip


def assert_close(found, wanted, rel):
    """Compare two signals, the error relative to the largest value."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() <= rel * max(np.abs(wanted).max(), 1e-9)


def assert_exact(loop, input, times, rel):
    for row, signal in enumerate("yu"):
        found = step_response(loop, input, times).outputs[row, 0]
        wanted = np.array([exact(loop, input, signal, t) for t in times])
        assert_close(found, wanted, rel)


@pytest.mark.thorough
@pytest.mark.parametrize("input", INPUTS)
@pytest.mark.parametrize("k", [1, 2, 3])
def test_delay_free_examples_equal_the_inverse_laplace_transform(k, input):
    assert_exact(example(k), input, np.linspace(0.01, 0.5, 8), 1e-10)
    assert_exact(example(k), input, np.array([0.003, 0.02, 0.7, 4.0]), 1e-10)


@pytest.mark.thorough
@pytest.mark.parametrize("input", INPUTS)
def test_example_4_equals_the_series_in_delayed_terms(input):
    assert_exact(example(4), input, np.array([0.02, 0.049, 0.0501, 0.12, 0.33, 0.61]), 1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("input", INPUTS)
@pytest.mark.parametrize(
    "loop", [neutral(), neutral(0.1), delayed_lag(1.0, 1.5), delayed_lag(1.0, 1e-3)]
)
def test_delayed_loops_equal_the_series_in_delayed_terms(loop, input):
    times = loop.delay * np.array([0.3, 0.999, 1.001, 1.5, 2.001, 3.7, 4.999])
    assert_exact(loop, input, times, 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("input", INPUTS)
def test_biproper_process_with_many_panels_per_delay_is_exact(input):
    # Poles at -200 and a delay of 1: a hundred panels in every delay.
    G, Gm = delay(1.0) * ct.tf([1, 100], [1, 200]), ct.tf([1, 2], [2, 3])
    loop = LoopEquations(G, Gm, 1 / s, ct.tf([0.1, 1], [0.5, 1]))
    assert_exact(loop, input, np.array([0.01, 0.5, 1.002, 1.3, 2.004, 2.9]), 1e-9)


# Against python-control.


def assert_equals_control(loop, input, times, rel=1e-9):
    for found, quotient in zip(
        step_response(loop, input, times).outputs[:, 0], maps(loop, input), strict=True
    ):
        wanted = ct.step_response(quotient.to_tf(), times).outputs
        assert_close(found, wanted, rel)


@pytest.mark.parametrize("input", INPUTS)
@pytest.mark.parametrize("k", [1, 2, 3])
def test_delay_free_examples_equal_control(k, input):
    assert_equals_control(example(k), input, np.linspace(0, 5, 1001))


pole = st.floats(0.2, 5.0)


@pytest.mark.slow
@settings(max_examples=40, deadline=None, derandomize=True)
@given(p1=pole, p2=pole, zero=pole, gain=pole, off=st.floats(0.7, 1.4), lam=st.floats(0.02, 0.5),
       input=st.sampled_from(list(INPUTS)))  # fmt: skip
def test_random_stable_loops_equal_control(p1, p2, zero, gain, off, lam, input):
    Gm = gain * (s + zero) / ((s + p1) * (s + p2))
    G = off * gain * (s + zero) / ((s + off * p1) * (s + p2))
    loop = LoopEquations(G, Gm, (s + p1) / s / gain, LowPassFilter(lam, 2))
    if max(loop.p_A.roots.real.max(), loop.p_B.roots.real.max()) < 0:
        assert_equals_control(loop, input, np.linspace(0, 3, 31), 1e-8)


@pytest.mark.slow
def test_data_is_shaped_as_control_shapes_one_input_and_two_outputs():
    two_outputs = ct.ss([[-1.0]], [[1.0]], [[1.0], [2.0]], [[0.0], [0.0]])
    times = np.linspace(0, 1, 11)
    theirs, ours = ct.step_response(two_outputs, times), step_response(example(1), "R", times)
    assert ours.outputs.shape == theirs.outputs.shape == (2, 1, 11)
    assert ours.inputs.shape == theirs.inputs.shape
    assert (ours.issiso, ours.ntraces, ours.plot_inputs) == (False, 1, theirs.plot_inputs)
    assert (ours.output_labels, ours.input_labels) == (["y", "u"], ["R"])
    forced = forced_response(example(1), "eta", times, np.sin(times))
    theirs = ct.forced_response(two_outputs, times, np.sin(times))
    assert forced.outputs.shape == theirs.outputs.shape == (2, 11)
    assert forced.inputs.shape == theirs.inputs.shape
    for data in (ours, forced):
        assert data.plot().figure is not None
        mpl.pyplot.close("all")


# Jumps and limits.


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_output_disturbance_appears_at_once_on_y(k):
    assert step_response(example(k), "d", [0.0, 1.0]).outputs[0, 0, 0] == pytest.approx(1)


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_plant_input_counts_an_input_disturbance_at_once(k):
    assert step_response(example(k), "delta", [0.0, 1.0]).outputs[1, 0, 0] == pytest.approx(1)


def test_neutral_loop_jumps_at_every_multiple_of_the_delay_by_powers_of_its_ratio():
    loop = neutral(0.7)
    ratio = -loop.p_B.r[0] / loop.p_B.q[0]
    # S_d at infinite frequency is 1/(1 - ratio E) with E = exp(-θs).
    k = np.arange(5)
    before, at = (step_response(loop, "d", t).outputs[0, 0] for t in (k[1:] * 0.7 - 1e-7, k * 0.7))
    assert at[0] == pytest.approx(1)
    assert at[1:] - before == pytest.approx(ratio ** k[1:], abs=1e-6)


def test_times_that_rounding_puts_before_a_jump_are_after_it():
    loop = neutral(0.1)
    exact_multiple, rounded = 3 * 0.1, 0.3
    assert rounded < exact_multiple
    y = [step_response(loop, "d", [t]).outputs[0, 0, 0] for t in (rounded, exact_multiple)]
    assert y[0] == pytest.approx(y[1], abs=1e-9)


def test_retarded_output_waits_for_the_delay():
    loop = delayed_lag(1.0)
    y = step_response(loop, "R", np.linspace(0, 2, 201)).outputs[0, 0]
    assert np.abs(y[:101]).max() < 1e-15
    assert (y[101:] > 0).all()


@pytest.mark.parametrize("input", INPUTS)
@pytest.mark.parametrize("seconds", [1e-3, 1e-5])
def test_short_delays_approach_the_delay_free_loop_in_proportion(seconds, input):
    times = np.linspace(0.05, 10, 201)
    short, none = (step_response(delayed_lag(d), input, times).outputs for d in (seconds, 0.0))
    assert 0 < np.abs(short - none).max() < 10 * seconds


@pytest.mark.parametrize("loop", [*map(example, (1, 2, 3, 4)), neutral(), delayed_lag(1.0, 1.5)])
@pytest.mark.parametrize("input", INPUTS)
def test_final_values_are_the_dc_gains(loop, input):
    final = step_response(loop, input, [0.0, 80.0]).outputs[:, 0, -1]
    wanted = [quotient.dc_gain for quotient in maps(loop, input)]
    assert final == pytest.approx(wanted, abs=1e-8)


def test_a_long_stiff_horizon_stays_at_its_end():
    # Model and process pole at -1000, delay 1: five hundred panels per delay, twenty delays.
    G = LAG * 1000 / (s + 1000)
    loop = LoopEquations(delay(1.0) * G, LAG, 0.5 * (s + 1) / s, LowPassFilter(2.0, 1))
    y = step_response(loop, "R", [0.0, 1.0, 60.0]).outputs[0, 0]
    assert y[-1] == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("seconds", [0.0, 0.1])
def test_unstable_loops_grow_at_the_rate_of_the_rightmost_root(seconds):
    # The model's gain has the wrong sign, which gives p_B a real root in the right half plane.
    process = delay(seconds) * LAG if seconds else LAG
    loop = LoopEquations(process, -LAG, -1.0, LowPassFilter(0.5, 1))
    rate = loop.p_B.roots[0]
    assert rate.imag == 0
    assert rate.real > 0
    for input in INPUTS:
        start, end = step_response(loop, input, [20.0, 21.0]).outputs[:, 0].T / rate.real
        assert np.log(end / start) == pytest.approx(rate.real, rel=1e-9)


def test_overflow_of_an_unstable_loop_is_silent():
    loop = LoopEquations(LAG, -LAG, -1.0, LowPassFilter(0.1, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        y = step_response(loop, "d", np.linspace(0, 1e4, 1001)).outputs[0, 0]
    assert y[0] == 1
    assert np.isnan(y[-1])


def test_idle_unstable_prefilter_does_not_disturb():
    loop = LoopEquations(LAG, LAG, -50.0, LowPassFilter(0.1, 1))
    assert loop.p_A.roots[0].real > 0
    y = step_response(loop, "d", [0.0, 500.0]).outputs[0, 0]
    assert y[1] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("loop", [example(3), example(4), neutral(0.3)])
@pytest.mark.parametrize("input", INPUTS)
def test_uneven_times_give_the_same_curve(loop, input):
    even = np.linspace(0, 3, 301)
    chosen = np.array([0, 1, 2, 10, 11, 50, 200, 299])
    whole, some = (step_response(loop, input, t).outputs[:, 0] for t in (even, even[chosen]))
    for a, b in zip(some, whole[:, chosen], strict=True):
        assert_close(a, b, 1e-11)


def test_pure_dead_time_process_is_a_staircase_of_the_observer():
    loop = LoopEquations(delay(1.0), 1.0, 0.0, LowPassFilter(1.0, 1))
    # u = -F/(1-F) y = -∫ y: for d, u falls with slope 1 until its own effect returns.
    y, u = step_response(loop, "d", [0.5, 1.0, 1.5, 2.0]).outputs[:, 0]
    assert u == pytest.approx([-0.5, -1.0, -1.375, -1.5])
    assert y == pytest.approx([1.0, 1.0, 0.5, 0.0])


# Forced responses.


@pytest.mark.parametrize("input", INPUTS)
@pytest.mark.parametrize("k", [1, 2, 3])
def test_forced_response_equals_control_without_delay(k, input):
    times = np.linspace(0, 3, 301)
    signal = np.cos(7 * times) + np.random.default_rng(k).normal(size=times.size)
    found = forced_response(example(k), input, times, signal).outputs
    for row, quotient in zip(found, maps(example(k), input), strict=True):
        wanted = ct.forced_response(quotient.to_tf(), times, signal).outputs
        assert_close(row, wanted, 1e-10)


@pytest.mark.parametrize("loop", [example(2), example(4), neutral(0.25)])
@pytest.mark.parametrize("input", INPUTS)
def test_constant_input_is_a_step(loop, input):
    times = np.linspace(0, 3, 301)
    step = step_response(loop, input, times).outputs[:, 0]
    forced = forced_response(loop, input, times, np.full(times.size, -2.0)).outputs
    assert_close(forced, -2 * step, 1e-11)


@pytest.mark.parametrize("loop", [example(4), delayed_lag(0.37)])
@pytest.mark.parametrize("input", INPUTS)
def test_fine_ramp_is_a_sum_of_shifted_steps(loop, input):
    # A ramp is the integral of steps; Simpson's rule over each panel between the breaks.
    times = np.linspace(0, 2 * loop.delay, 401)
    steps = step_response(loop, input, times).outputs[:, 0]
    ramp = forced_response(loop, input, times, times).outputs
    w = times[1] / 3 * np.array([1.0, 4.0, 1.0])
    # Where a step response jumps, only the interval before the jump ends on its left limit.
    pieces = np.stack([steps[:, i : i + 3] @ w for i in range(0, 198, 2)], axis=1)
    assert_close(ramp[:, 2:200:2], np.cumsum(pieces, axis=1), 1e-8)


@pytest.mark.parametrize("loop", [example(4), neutral(0.25), delayed_lag(0.37)])
@pytest.mark.parametrize("input", INPUTS)
def test_a_hat_is_three_ramps(loop, input):
    times = np.linspace(0, 2, 201)
    corner = times[50]
    hat = np.maximum(0, corner - np.abs(times - corner))
    ramp = forced_response(loop, input, times, times).outputs
    late = [np.pad(ramp, ((0, 0), (n, 0)))[:, : times.size] for n in (0, 50, 100)]
    found = forced_response(loop, input, times, hat).outputs
    assert_close(found, late[0] - 2 * late[1] + late[2], 1e-11)


def test_ramp_follows_the_reference_with_the_lag_of_the_integrator():
    loop = delayed_lag(1.0, 1.5)
    times = np.linspace(0, 200, 2001)
    y, u = forced_response(loop, "R", times, times).outputs
    # T_R = 1 - s T + ..., and the end of a ramp response is t - T with T = -T_R'(0).
    h = 1e-4
    lag = -(complex(loop.T_R(h)) - complex(loop.T_R(-h))).real / (2 * h)
    assert times[-1] - y[-1] == pytest.approx(lag, rel=1e-6)
    assert u[-1] - u[-2] == pytest.approx(0.1, rel=1e-8)


@pytest.mark.slow
def test_long_records_use_the_fft_and_agree_with_direct_sums():
    rng = np.random.default_rng(0)
    signal = rng.normal(size=12_000)
    times = 0.01 * np.arange(signal.size)
    whole = forced_response(example(4), "eta", times, signal).outputs
    part = forced_response(example(4), "eta", times[:9000], signal[:9000]).outputs
    assert_close(whole[:, :9000], part, 1e-11)


# The default window.


@pytest.mark.parametrize("input", INPUTS)
@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_default_window_holds_the_transient_and_little_more(k, input):
    data = step_response(example(k), input)
    steps = np.diff(data.time)
    assert data.time.size == 1001
    assert steps == pytest.approx(steps[0])
    outputs = data.outputs[:, 0]
    final = np.array([[q.dc_gain] for q in maps(example(k), input)])
    away = np.abs(outputs - final) / np.ptp(np.hstack([outputs, final]), axis=1, keepdims=True)
    assert away[:, -1].max() < 0.003
    assert away[:, 150:].max() > 0.002
    assert 0.1 < data.time[-1] < 50


@pytest.mark.parametrize("window", [1, 2, 5, 10])
def test_default_window_is_a_round_number(window):
    assert even_times(0.99 * window)[-1] == window


def test_default_window_looks_closer_where_the_slowest_mode_does_not_show():
    # Nominal: noise meets F alone, 1 ms, although the loop also has the process mode of 100 s.
    G = 1 / (100 * s + 1)
    loop = LoopEquations(G, G, 1.0, LowPassFilter(1e-3, 1))
    assert loop.p_B.roots[0] == pytest.approx(-0.01)
    assert step_response(loop, "eta").time[-1] == pytest.approx(0.01)


def test_default_window_of_an_unstable_loop_spans_some_e_foldings():
    loop = LoopEquations(delay(0.1) * LAG, -LAG, -1.0, LowPassFilter(0.5, 1))
    foldings = step_response(loop, "d").time[-1] * loop.p_B.roots[0].real
    assert 5 < foldings < 20


def test_default_window_with_an_integrator_is_set_by_the_next_mode():
    # The filter removes an input disturbance before an integrator, but leaves y displaced.
    loop = LoopEquations(1 / s, 1 / s, 1.0, LowPassFilter(0.1, 1), keep_factors=True)
    assert 0 in loop.p_B.roots
    assert step_response(loop, "delta").time[-1] == 1.0


def test_default_window_of_a_loop_on_the_axis_shows_some_periods():
    loop = LoopEquations(1 / s, 1 / s, 4 / s, LowPassFilter(0.1, 1))
    assert loop.p_A.roots == pytest.approx([2j, -2j])
    assert 5 <= step_response(loop, "R").time[-1] * 2 / (2 * math.pi) < 15


def test_default_window_shows_some_dead_times_where_hundreds_of_roots_are_on_the_right():
    loop = delayed_lag(1.0, 1e-3)
    assert not loop.p_B.roots_resolved
    assert step_response(loop, "d").time[-1] == 5.0


# What is refused.


def test_unknown_input_names_the_four():
    with pytest.raises(ValueError, match="'R', 'd', 'delta', 'eta'"):
        step_response(example(1), "r")


@pytest.mark.parametrize("times", [[[0.0, 1.0]], []])
def test_times_must_be_a_list(times):
    with pytest.raises(ValueError, match="1-D"):
        step_response(example(1), "R", times)


@pytest.mark.parametrize("times", [[0, 1, 1], [1, 0], [-1, 0], [0, math.nan], [0, math.inf]])
def test_times_must_increase_from_zero(times):
    with pytest.raises(ValueError, match="increasing"):
        step_response(example(4), "R", times)


@pytest.mark.parametrize("times", [[0, 1, 3], [1, 2, 3], [0.0]])
def test_forced_response_needs_an_even_grid_from_zero(times):
    with pytest.raises(ValueError, match="evenly spaced"):
        forced_response(example(1), "R", times, np.ones(len(times)))


@pytest.mark.parametrize("inputs", [[1.0], [1.0, math.nan, 0.0], [[0.0, 1.0, 2.0]]])
def test_forced_response_needs_one_number_per_time(inputs):
    with pytest.raises(ValueError, match="one finite number"):
        forced_response(example(1), "R", [0, 1, 2], inputs)


@pytest.mark.parametrize("loop", [
    LoopEquations(LAG, ct.tf([1, 0], [1, 1]), -1.0, LowPassFilter(0.1, 1)),
    LoopEquations(delay(1.0) * LAG, 1.0, 1.0, ct.tf([1, 1, 1], [1, 2, 1])),
])  # fmt: skip
def test_ill_posed_loops_are_refused_with_their_reason(loop):
    with pytest.raises(ValueError, match=r"ill-posed: .* = 0"):
        step_response(loop, "R", [0.0, 1.0])


def test_a_lag_of_a_millionth_of_the_dead_time_is_no_obstacle():
    # The lag delays what comes around by 1e-6 s, and that is all it does.
    fast, none = (
        step_response(LoopEquations(delay(1.0) * G, LAG, 1.0, LowPassFilter(2.0, 1)), "R", 10.0)
        for G in (LAG * 1e6 / (s + 1e6), LAG)
    )
    assert_close(fast.outputs[:, 0], none.outputs[:, 0], 3e-6)


def test_undamped_modes_that_turn_too_often_in_a_dead_time_are_refused():
    G = 1 / ((s + 1) * (1e-12 * s**2 + 1))
    loop = LoopEquations(delay(1.0) * G, LAG, 1.0, LowPassFilter(2.0, 1))
    with pytest.raises(ArithmeticError, match="damp the mode"):
        step_response(loop, "R", [0.0, 10.0])


# Time scales far apart.


@pytest.mark.parametrize("lam", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 6])
def test_a_matched_loop_answers_a_disturbance_with_the_filter_alone(order, lam):
    # S_d = 1 - F, and U_d = -F (s + 1)^n is the derivative of the filter n times and less often.
    lags = ct.tf([1], np.poly(-np.ones(order)))
    loop = LoopEquations(lags, lags, 0.5 * (s + 1) / s, LowPassFilter(lam, order))
    x = np.array([0.0, 0.3, 1.0, 4.0, 20.0])
    y = step_response(loop, "d", np.append(lam * x, [1.0, 30.0])).outputs[0, 0]
    wanted = np.exp(-x) * sum(x**k / math.factorial(k) for k in range(order))
    assert y == pytest.approx(np.append(wanted, [0.0, 0.0]), abs=1e-12)
    u = step_response(loop, "d", [1.0, 5.0, 30.0]).outputs[1, 0]
    assert u == pytest.approx([-1.0, -1.0, -1.0], rel=1e-11)


@pytest.mark.parametrize("lam", [1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("order", [3, 6])
def test_the_reference_is_followed_as_with_the_model_alone(order, lam):
    # A fast filter makes the plant behave as its model: an error of the order of λ.
    process = 1.3 / (s**3 + 3.3 * s**2 + 3 * s + 1)
    Gm, C = 1 / (s + 1) ** 3, 0.5 * (s + 1) / s
    loop = LoopEquations(process, Gm, C, LowPassFilter(lam, order))
    times = np.linspace(0, 30, 301)
    y = step_response(loop, "R", times).outputs[0, 0]
    model = ct.step_response(ct.feedback(C * Gm).minreal(), times).outputs
    assert np.abs(y - model).max() < 10 * lam + 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("lam", [1e-4, 1e-5, 1e-9])
def test_five_detuned_lags_under_a_fast_filter_are_certified(lam):
    loop = LoopEquations(
        1 / (1.02 * s + 1) ** 5, 1 / (s + 1) ** 5, 0.1 * (s + 1) / s, LowPassFilter(lam, 5)
    )
    for input in INPUTS:
        found = step_response(loop, input, [0.0, 2.0, 10.0]).outputs[:, 0, 1:]
        wanted = np.array([exact_step(loop, input, t) for t in (2.0, 10.0)]).T
        for row, exactly in zip(found, wanted, strict=True):
            assert_close(row, exactly, 1e-9)
        assert np.isfinite(step_response(loop, input).outputs).all()


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.0, 0.3])
def test_a_process_with_lags_1e11_apart_is_certified(seconds):
    G = 1.2 / ((1e9 * s + 1) * (s + 1) * (1e-2 * s + 1))
    loop = LoopEquations(delay(seconds) * G, 1e-9 / (s * (s + 1)), 0.3, LowPassFilter(0.5, 2))
    for input in INPUTS:
        found = step_response(loop, input, [0.1, 0.7, 1.1]).outputs[:, 0]
        wanted = np.array([exact_step(loop, input, t) for t in (0.1, 0.7, 1.1)]).T
        for row, exactly in zip(found, wanted, strict=True):
            assert_close(row, exactly, 1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("input", INPUTS)
def test_a_filter_far_below_the_dead_time_is_certified(input):
    # The plant's input is next to an impulse and its derivatives: 1e36 for some microseconds.
    loop = LoopEquations(
        delay(0.5) / (1.1 * s + 1) ** 4, 1 / (s + 1) ** 4, 0.3 / s, LowPassFilter(1e-9, 5)
    )
    times = [0.5 + 3e-9, 0.75]
    found = step_response(loop, input, times).outputs[:, 0]
    wanted = np.array([exact_step(loop, input, t) for t in times]).T
    for row, exactly in zip(found, wanted, strict=True):
        assert_close(row, exactly, 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("input", INPUTS)
def test_a_dead_time_far_below_everything_is_as_good_as_its_transform(input):
    loop = delayed_lag(1e-7)
    to_y, to_u = maps(loop, input)
    times = np.array([0.5, 3.0, 12.0])
    found = step_response(loop, input, times).outputs[:, 0]
    with mp.workdps(40):
        for row, quotient in zip(found, (to_y, to_u), strict=True):

            def transform(s, quotient=quotient):
                num, den = (
                    mp.fprod(
                        mp.polyval(list(map(mp.mpf, f.q)), s)
                        + mp.polyval(list(map(mp.mpf, f.r)), s) * mp.exp(-mp.mpf(f.delay) * s)
                        for f in factors
                    )
                    for factors in (quotient.num, quotient.den)
                )
                return num / den / s

            assert_close(row, [float(talbot(transform, mp.mpf(t))) for t in times], 1e-9)


def test_short_and_long_ways_meet():
    # 19,000 dead times are marched through, 21,000 are taken with a rational in their place.
    loop = delayed_lag(1e-3)
    march, rational = (step_response(loop, "R", np.linspace(0, T, T + 1)) for T in (19, 21))
    assert_close(march.outputs[:, 0], rational.outputs[:, 0, :20], 1e-10)


def test_a_mode_that_turns_too_often_for_nine_digits_is_refused():
    G = 1 / (1e-16 * s**2 + 1)
    loop = LoopEquations(G, 1.0, 0.0, LowPassFilter(1.0, 1))
    assert np.isfinite(step_response(loop, "d", 1e-6).outputs).all()
    with pytest.raises(ArithmeticError, match="shorten timepts"):
        step_response(loop, "d", [0.0, 1e3])


@pytest.mark.thorough
def test_random_loops_are_certified():
    errors, refusals = campaign(12, seed=18)
    assert max(max(found) for found in errors.values())[0] < 1e-9
    assert sum(refusals.values()) <= 1


# How times may be given.


def test_a_number_is_the_last_time():
    response = step_response(example(1), "R", 10)
    assert response.time == pytest.approx(np.linspace(0, 10, 1001))
    listed = step_response(example(1), "R", np.linspace(0, 10, 1001))
    assert_close(response.outputs, listed.outputs, 1e-12)


@pytest.mark.parametrize("last", [0.0, -1.0, math.nan, math.inf])
def test_the_last_time_must_be_positive_and_finite(last):
    with pytest.raises(ValueError, match="increasing"):
        step_response(example(1), "R", last)


@pytest.mark.parametrize("inputs", [[0.0, 1j, 2.0], ["a", "b", "c"]])
def test_a_signal_must_be_real_numbers(inputs):
    with pytest.raises(TypeError, match=r"inputs is .*; give one real number for each time"):
        forced_response(example(1), "R", [0.0, 1.0, 2.0], inputs)


def test_real_numbers_may_be_stored_as_complex_ones():
    found, same = (
        forced_response(example(1), "R", [0.0, 1.0, 2.0], x) for x in ([1, 2, 3], [1, 2, 3 + 0j])
    )
    assert np.array_equal(found.outputs, same.outputs)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1])
def test_random_loops_with_dead_times_are_summed_echo_by_echo(seed):
    errors, refusals = delayedsteps.campaign(15, seed)
    assert not refusals
    assert max(error for found in errors.values() for error, _ in found) < delayedsteps.PROMISED


def test_times_must_be_numbers():
    with pytest.raises(TypeError, match="timepts is 'soon'"):
        step_response(example(1), "R", "soon")


@pytest.mark.parametrize("input", INPUTS)
def test_the_default_window_works_where_a_slow_loop_meets_a_fast_lag(input):
    process = delay(1) / ((s + 1) * (1e-4 * s + 1))
    loop = LoopEquations(process, LAG, 0.01 / s, LowPassFilter(2.0, 1))
    response = step_response(loop, input)
    final = [quotient.dc_gain for quotient in maps(loop, input)]
    assert response.outputs[:, 0, -1] == pytest.approx(final, abs=0.01)


@pytest.mark.parametrize("size", [1e30, 1e-30])
@pytest.mark.parametrize("input", INPUTS)
def test_huge_and_tiny_units_give_the_same_curve(size, input):
    for seconds in (0.0, 1.0):
        unit, other = (
            LoopEquations(
                delay(seconds * T) * ct.tf([k], [T, 1]),
                ct.tf([k], [T, 1]),
                ct.tf([0.3 / k], [T, 0]),
                LowPassFilter(2.0 * T, 1),
            )
            for T, k in ((1.0, 1.0), (size, 1 / size))
        )
        usual, scaled = step_response(unit, input), step_response(other, input)
        assert 0.4 < scaled.time[-1] / size / usual.time[-1] < 2.6
        again = step_response(other, input, size * usual.time).outputs[:, 0]
        u_unit = 1.0 if input == "delta" else size
        assert_close(again[0] * (size if input == "delta" else 1), usual.outputs[0, 0], 1e-9)
        assert_close(again[1] / u_unit, usual.outputs[1, 0], 1e-9)


def test_collocation_integrates_powers_from_the_start_of_a_panel():
    nodes, integral = radau()
    for k in range(nodes.size):
        np.testing.assert_allclose(integral @ nodes**k, nodes ** (k + 1) / (k + 1), atol=1e-13)


def test_the_window_of_an_unstable_loop_shows_a_few_of_its_e_foldings():
    # The pole of the process at 0.05 rad/s is hidden by the exact model.
    plant = ct.tf([1], [1, -0.05])
    loop = nrdob.NRDOB(plant, plant, ct.tf([5], [1]), nrdob.LowPassFilter(0.1, 1))
    assert loop.stability().stable is False
    for input in ("R", "d"):
        assert loop.step_response(input).time[-1] >= 6 / 0.05
