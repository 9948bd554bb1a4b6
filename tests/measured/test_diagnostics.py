"""Records that mislead a fit: drift, rivals of the other sign, and what must be told by name."""

from functools import cache

import numpy as np
import pytest
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.stats import chi2

import nrdob
from nrdob.measured import STRUCTURES, checked_record, identified, identify
from nrdob.measured.disturbance import HYPOTHESES, scatter_of
from nrdob.measured.residuals import check_residuals, whitening_of
from nrdob.reporting import propose
from tests.campaigns.identification import response, thermal, under_a_wave

ONE_LAG = "one lag with dead time"


def lag(inputs, noise=0.02, seed=0):
    """Gain 2, 15 samples of lag and 4 of dead time, measured."""
    rng = np.random.default_rng(seed)
    clean = response(np.array([1, 1 / 15]), np.array([2 / 15]), 4.0, inputs)
    return np.arange(inputs.size), inputs, clean + noise * rng.standard_normal(inputs.size)


def switched(count=400, seed=0):
    rng = np.random.default_rng(seed)
    return np.cumprod(np.where(rng.random(count) < 0.04, -1.0, 1.0))


@cache
def of_switched_lag():
    """Fit a lag to a record with which nothing is wrong, once for all tests."""
    return identify(*lag(switched()), structure=ONE_LAG)


def oven(u, later=1.0, losses=0.0, grain=0.25):
    """Heater of 35 s; gain 29/3 and lag 2000/3 s where losses are linear; every 2 s, rounded.

    From the 100th sample on the heater gives `later` times as much.
    """
    heat, above, y = 0.0, 0.0, []
    for k, power in enumerate(u):
        y.append(above)
        for _ in range(20):
            heat += 0.1 * (power * (later if k >= 100 else 1.0) - heat) / 35
            above += 0.1 * (0.0145 * heat - 0.0015 * above - losses * above**2)
    noise = 0.2 * np.random.default_rng(0).standard_normal(u.size)
    return 2.0 * np.arange(u.size), u, grain * np.round((22 + np.array(y) + noise) / grain)


def told(t, u, y):
    return identify(t, u, y, structure=ONE_LAG).remarks


@pytest.mark.parametrize("theta", [1.0, 0.9, 0.5])
def test_drift_and_memory_are_found(theta):
    rng = np.random.default_rng(1)
    fresh = rng.standard_normal(4000)
    walk = np.cumsum((1 - theta) * fresh)
    found = whitening_of(fresh + np.concatenate([[0.0], walk[:-1]]))
    assert found.theta == pytest.approx(theta, abs=0.03)
    assert len(found.memory) == 1 or abs(found.memory[1]) < 0.1


def test_a_filter_and_what_it_foretells_are_each_others_inverse():
    rng = np.random.default_rng(2)
    walk = np.cumsum(rng.standard_normal(300)) + rng.standard_normal(300)
    found = whitening_of(walk)
    ahead = found.carried_on(walk[:299], 1)[0]
    assert walk[299] - ahead == pytest.approx(found.applied(walk)[299])


def test_a_fit_that_leaves_nothing_leaves_nothing_of_the_input():
    found = check_residuals(np.zeros(400), switched(), 3)
    assert "is white" in found.reason and found.independent is True
    assert found.independence == 1.0


def test_an_input_just_rich_enough_tells_what_is_left_of_it_and_one_lag_fewer_does_not():
    # White noise moves all 25 lags; so many numbers less one leave a single degree of freedom.
    rng = np.random.default_rng(4)
    inputs = rng.standard_normal(1000)
    residual = rng.standard_normal(1000) + 0.5 * np.roll(inputs, 2)
    assert check_residuals(residual, inputs, 24).independent is False
    assert check_residuals(residual, inputs, 25).independent is None


def test_a_memory_is_judged_by_the_samples_for_which_it_has_begun():
    found = set()
    for seed in range(20):
        residual = np.random.default_rng(seed).standard_normal(60)
        products = np.correlate(residual, residual, "full")[59:]
        scores = [60 * np.log(np.mean(residual**2))]
        for order in range(1, 5):
            a = solve_toeplitz(products[:order], products[1 : order + 1])
            e = np.convolve(residual, [1.0, *-a])[order:60]
            scores.append(60 * np.log(np.mean(e**2)) + order * np.log(60))
        assert len(whitening_of(residual).memory) == 1 + np.argmin(scores)
        found.add(int(np.argmin(scores)))
    assert len(found) > 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed", "case"),
    [
        ("step", 1, 13),
        *(
            pytest.param(*each, marks=pytest.mark.thorough)
            for each in (
                ("up and down", 1, 3), ("up and down", 1, 6),  # of the wrong sign before, as above
                ("step", 1, 6), ("up and down", 1, 10), ("three steps", 1, 12),  # integrators
                ("up and down", 5, 30), ("up and down", 5, 56),  # integrators, nothing held out
            )
        ),
    ],
)  # fmt: skip
def test_a_heater_in_a_room_that_drifts_has_the_sign_of_its_gain(kind, seed, case):
    true = thermal(kind, np.random.default_rng([seed, case, len(kind)]))
    found = identify(true.t, true.u, true.y)
    gain = found.parameters["gain"]
    assert found.structure.startswith(("one lag", "two lags")) and not found.unsure
    assert gain.value == pytest.approx(true.truth["gain"], rel=0.25)
    assert gain.low * gain.high > 0


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("kind", "case"), [("three steps", 0), ("three steps", 3), ("step", 7), ("three steps", 7)]
)
def test_intervals_allow_for_a_drift_that_looks_like_a_change_of_the_gain(kind, case):
    true = thermal(kind, np.random.default_rng([0, case, len(kind)]))
    found = identified(checked_record(true.t, true.u, true.y), (true.structure,))
    gain = found.parameters["gain"]
    assert gain.low < true.truth["gain"] < gain.high
    assert gain.high - gain.low < 0.3 * abs(gain.value)


def test_scatter_is_that_of_generalised_least_squares():
    # For a random walk in white noise, a slow wave beside it: the covariance written out, and
    # inverted as a matrix.
    rng = np.random.default_rng(3)
    times, zero = np.arange(120), 0.8
    jacobian = np.column_stack([np.ones(120), times > 40, np.exp(-times / 30)])
    response = np.tril(np.full((120, 120), 1 - zero), -1) + np.eye(120)
    angles = [np.pi * periods * times / 120 for periods in (1, 2, 3)]
    wave = 6 * np.column_stack([part(angle) for angle in angles for part in (np.sin, np.cos)])
    residual = response @ rng.standard_normal(120) + wave @ rng.standard_normal(6)
    inverse = np.linalg.inv(response @ response.T + wave @ wave.T)
    gram = np.linalg.inv(jacobian.T @ inverse @ jacobian)
    shift = gram @ jacobian.T @ inverse @ residual
    rest = residual - jacobian @ shift
    variance = rest @ inverse @ rest / 117
    found = scatter_of(residual, jacobian, np.ones(120, dtype=bool), residual, 0.0)
    _, walks, smooth = HYPOTHESES  # noise of long memory is left out of so short a record
    k = 3 * ([each.zero for each in walks].index(zero) - len(walks)) - len(smooth)  # of size 6
    assert found.shifts[k] == pytest.approx(shift, rel=1e-6)
    assert found.covariances[k] == pytest.approx(variance * gram, rel=1e-6)
    assert found.weights.sum() == pytest.approx(1) and found.weights[k] > 1e-3


@pytest.mark.thorough
def test_intervals_hold_the_gain_while_a_slow_wave_passes():
    # A step of unit gain, linear in what is estimated; 47 of these 60 were held before.
    rng = np.random.default_rng(8)
    times = np.arange(400)
    late = np.maximum(times - 60, 0) / 40
    jacobian = np.column_stack([1 - np.exp(-late), late * np.exp(-late), np.ones(400)])
    held = 0
    for _ in range(60):
        wave = 5 * rng.normal(size=2) @ [f(times * np.pi / 250) for f in (np.sin, np.cos)]
        walk = 0.1 * np.cumsum(rng.standard_normal(400))
        residual = wave + walk + rng.standard_normal(400)
        estimate = np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        rest = residual - jacobian @ estimate
        scatter = scatter_of(rest, jacobian, np.ones(400, dtype=bool), rest, 0.0)
        held += abs(estimate[0]) < scatter.reach(np.eye(3)[0], 0.95)
    assert held >= 53


@pytest.mark.slow
@pytest.mark.parametrize("case", [0, 1])  # both missed before: the wave was 6 e at most
def test_intervals_hold_the_gain_where_a_wave_drowns_the_noise(case):
    true = under_a_wave("step", np.random.default_rng([0, case, 4]))
    found = identified(checked_record(true.t, true.u, true.y), (true.structure,))
    gain = found.parameters["gain"]
    assert gain.low < true.truth["gain"] < gain.high
    assert gain.high - gain.low < 0.2 * abs(gain.value)


@pytest.mark.thorough
def test_a_search_does_not_end_with_the_wrong_sign_of_a_slow_plant():
    # Ten blocks, hardly any noise, not at rest: gain -0.96 and 43 samples for 3 before.
    rng = np.random.default_rng(0)
    u = np.repeat([0.0, 1, 1, 0, 0, 1, 1, 1, 0, 1], 20)
    for slow, late, first in ((148.468, 3.041, 0.7), (148.468, 3.041, -1.2), (40.0, 7.15, 1.0)):
        y = response(np.array([1, 1 / slow]), np.array([0.9596 / slow]), late, u)
        y += first * np.exp(-np.arange(200) / slow) + 1e-4 * rng.standard_normal(200)
        found = identify(np.arange(200.0), u, y, structure=ONE_LAG)
        assert found.parameters["gain"].value == pytest.approx(0.9596, rel=0.02)
        assert found.parameters["dead time"].value == pytest.approx(late, abs=0.5)
        assert found.validation_percent > 95


@pytest.mark.slow
@pytest.mark.parametrize(("held_out", "fitted"), [(0.25, 300), (0.5, 200), (0.0, 400)])
def test_as_much_of_the_record_is_held_out_as_was_asked_for(held_out, fitted):
    found = identify(*lag(switched()), structure=ONE_LAG, held_out=held_out)
    assert found.fitted == fitted and np.isnan(found.validation_percent) == (not held_out)


@pytest.mark.slow
def test_what_was_held_out_counts_in_the_end():
    # A half that is all noise tells little; the numbers come from both, the foretelling from one.
    t, u, y = lag(switched())
    y[:200] += 0.5 * np.random.default_rng(4).standard_normal(200)
    found = identify(t, u, y, structure=ONE_LAG)
    alone = identify(t[:200], u[:200], y[:200], structure=ONE_LAG, held_out=0)
    one, both = (each.parameters["gain"] for each in (alone, found))
    assert both.high - both.low < (one.high - one.low) / 1.3
    assert found.fit_percent == pytest.approx(alone.fit_percent, abs=1)


@pytest.mark.thorough
def test_the_held_out_part_has_a_veto():
    # After the first half the plant answers the other way round: nothing foretells that.
    t, u, y = lag(switched())
    y[200:] = 2 * y[199] - y[200:]
    found = identify(t, u, y)
    assert found.validation_percent < 0 and "held out" in found.unsure
    assert any("foretold worse than a constant" in each for each in found.remarks)
    refused = propose(found)
    assert refused.loop is None and "worse than a constant" in refused.warnings[0]


@pytest.mark.thorough
def test_a_rival_with_a_gain_of_the_other_sign_leaves_the_sign_open():
    # A gain of 1 that answers the wrong way first, in a record that ends before it has turned.
    t, rng = np.arange(32.0), np.random.default_rng(39)
    u = 1.0 * (t >= 13)
    slow = response(np.array([1, 0.02]), np.array([0.04]), 0.0, u)
    fast = response(np.array([1, 0.5]), np.array([0.5]), 0.0, u)
    record = checked_record(t, u, slow - fast + 0.25 * rng.standard_normal(32))
    names = ONE_LAG, "two lags and a zero with dead time"
    found = identified(record, tuple(each for each in STRUCTURES if each.name in names))
    gain = found.parameters["gain"]
    assert any("with a gain of the other sign" in each for each in found.remarks)
    assert gain.low <= -abs(gain.value) and gain.high >= abs(gain.value)


@pytest.mark.thorough
def test_a_rival_with_the_same_sign_leaves_the_sign_of_the_gain_alone():
    lags = [each for each in STRUCTURES if each.name in (ONE_LAG, "two lags with dead time")]
    found = identified(checked_record(*lag(switched(150), noise=0.3)), tuple(lags))
    gain = found.parameters["gain"]
    assert 0 < gain.low < 2 < gain.high and not found.remarks and not found.unsure


@pytest.mark.thorough
def test_no_loop_rests_on_a_gain_that_may_be_zero():
    rng = np.random.default_rng(0)
    found = identify(np.arange(300), np.sign(rng.standard_normal(300)), rng.standard_normal(300))
    gain = found.parameters["gain"]
    assert gain.low <= 0 <= gain.high and "may be zero" in found.unsure
    assert propose(found).loop is None


@pytest.mark.slow
def test_outliers_are_told():
    t, u, y = lag(switched())
    assert not of_switched_lag().remarks
    y[[100, 250, 333]] += [3, -2, 4]
    (said,) = identify(t, u, y, structure=ONE_LAG).remarks
    assert said.startswith("y has 3 outliers, such as") and "at 333 s" in said


@pytest.mark.thorough
def test_what_a_sensor_writes_where_it_fails_is_left_out():
    t, u, y = lag(np.where(np.arange(240) // 60 % 2, 1.0, 0.0))
    failed = [20, 101, 102 + 60, 200]
    y[failed] = -9999, -9999, -7999, -9999
    with pytest.warns(UserWarning, match=r"y is -9999 at sample 20, and 3 more, .* left out"):
        found = identify(t, u, y)
    assert np.flatnonzero(~found.record.free).tolist() == failed
    assert found.parameters["gain"].value == pytest.approx(2.0, rel=0.01)


@pytest.mark.slow
def test_an_outlier_at_the_end_is_told():
    t, u, y = lag(switched())
    y[[250, -1]] += [3, -2]
    (said,) = identify(t, u, y, structure=ONE_LAG).remarks
    assert said.startswith("y has 2 outliers, such as")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("place", "value"),
    [
        (0, 3.75),  # the sensor was not ready
        (120, 1482),  # right after a step, where a structure with a zero makes it a response
        (239, 3),  # the last line of the file is cut off
    ],
)
def test_a_spike_that_a_fit_would_follow_is_left_out(place, value):
    t, u, y = lag(np.where(np.arange(240) < 120, 0.0, 1.0))
    y = y + 30
    y[place] = value
    place = f"y is {value} at sample {place}"
    with pytest.warns(UserWarning, match=f"{place}, far from the samples .* left out"):
        found = identify(t, u, y)
    assert found.structure == ONE_LAG
    assert found.parameters["gain"].value == pytest.approx(2.0, rel=0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("case", [19, 28, 38])
def test_a_drift_that_looks_like_slow_noise_is_counted_in(case):
    true = thermal("three steps", np.random.default_rng([77, case, 11]))
    gain = identify(true.t, true.u, true.y).parameters["gain"]
    assert gain.low < true.truth["gain"] < gain.high


@pytest.mark.thorough
@pytest.mark.parametrize("losses", [0.0, 1e-5])
@pytest.mark.parametrize(("off", "count"), [(35, 240), (65, 120)])
def test_what_cools_by_itself_is_no_integrator(off, count, losses):
    times = np.arange(count)
    found = identify(*oven(np.where((times >= 15) & (times < off), 100.0, 0.0), losses=losses))
    gain = found.parameters["gain"]
    assert found.structure == "two lags with dead time" and gain.low > 0
    assert losses or gain.low < 29 / 3 < gain.high


@pytest.mark.thorough
def test_a_lag_of_many_records_is_an_integrator():
    """An angle, every 6.25 ms, of a motor of 0.36 s with dry friction that grows at first."""
    times = np.arange(1000)
    inputs = np.where(times < 60, 0.0, 0.5)
    friction = 0.2 - 0.1 * np.exp(-times / 200)
    speed, angle, y = 0.0, 0.0, []
    for drive in np.maximum(inputs - friction, 0.0):
        y.append(angle)
        for _ in range(5):
            speed += 0.00125 * (20 * drive - speed) / 0.36
            angle += 0.00125 * speed
    noise = 0.01 * np.random.default_rng(0).standard_normal(1000)
    found = identify(0.00625 * times, inputs, 0.0157 * np.round((np.array(y) + noise) / 0.0157))
    assert found.structure.startswith("integrator") and not found.unsure


@pytest.mark.thorough
@pytest.mark.parametrize("later", [1.0, 1.3])
def test_a_plant_that_rests_until_the_step_does_not_begin_to_move_by_itself_with_it(later):
    found = identify(*oven(np.where(np.arange(360) < 15, 0.0, 30.0), later))
    assert found.structure.startswith("two lags") and found.parameters["dead time"].value < 10
    assert 5 < found.parameters["gain"].value < 15


@pytest.mark.thorough
def test_a_plant_that_swings_before_the_step_moves_by_itself():
    times = np.arange(500)
    swing = np.exp(-0.004 * times) * np.cos(0.2 * times)
    inputs = np.where(times < 400, 0.0, 1.0)
    answer = response(np.array([1.0, 0.008, 0.04]), np.array([0.04]), 3.0, inputs)
    noise = 0.01 * np.random.default_rng(0).standard_normal(500)
    found = identify(times, inputs, 2 + swing + answer + noise, structure="two lags with dead time")
    gain = found.parameters["gain"]
    assert gain.low < 1 < gain.high < 1.2 and gain.low > 0.8


@pytest.mark.thorough
def test_a_gain_that_is_not_told_from_its_lag_is_called_so():
    found = identify(*oven(np.where(np.arange(60) < 15, 0.0, 30.0)))
    assert "does not come to rest" in found.unsure
    assert "record longer" in found.remarks[0]


@pytest.mark.thorough
def test_an_input_that_moves_at_the_very_end_holds_nothing_out():
    t, u, y = lag(np.concatenate([[0.0], np.ones(598), [0.0]]))
    found = identified(checked_record(t[1:], u[1:], y[1:], input_before=0.0))
    assert "nothing was held out" in found.reason and found.structure == ONE_LAG
    assert found.parameters["gain"].value == pytest.approx(2, rel=0.02)


def test_a_sensor_that_rests_at_other_values_as_well_is_not_at_a_limit():
    peaks = np.array([0, 3, 6, 9, 10.0])
    low, high = (np.concatenate([peaks, [top] * 6, peaks[::-1]]) for top in (10.0, 11.0))
    y, u = np.tile(np.concatenate([low, high, low]), 3), np.arange(144) % 48 < 20
    assert not checked_record(np.arange(144), 1.0 * u, y).remarks
    high[5:11], low[5:11] = 10.0, 10.0
    y = np.tile(np.concatenate([low, high, low]), 3)
    (said,) = checked_record(np.arange(144), 1.0 * u, y).remarks
    assert "cut off by a limit" in said


def test_a_body_that_runs_into_a_stop_is_told_from_one_that_is_switched_off():
    # An inclined rail: the ball runs ever faster, until it lies against the end, where the sensor
    # sees it without noise. A motor that is switched off keeps its angle, and the noise.
    rng = np.random.default_rng(7)
    t = np.arange(300.0)
    u = (t >= 100) * 1.0
    ball = 0.01 * np.maximum(t - 105, 0.0) ** 2
    noise = rng.standard_normal(300)
    y = np.where(ball < 60, ball + noise, 60 + 0.1 * noise)
    (said,) = checked_record(t, u, y).remarks
    assert "until sample 182, and then rests at 60" in said
    assert "these 118 samples are left out" in said
    on = (t >= 100) & (t < 180)
    angle = np.cumsum(on * 0.7)
    assert not checked_record(t, on * 1.0, angle + noise).remarks


@pytest.mark.thorough
def test_a_limit_is_told_only_where_with_it_the_record_is_explained():
    rng = np.random.default_rng(3)
    t, u, _ = lag(np.repeat(rng.uniform(0, 10, 40), 15))
    clipped = lag(np.minimum(u, 5.0), noise=0.1)[2]
    assert any("cut off above" in said for said in told(t, u, clipped))
    assert not any("cut off" in said for said in told(t, u, clipped + 1.5 * np.sin(t / 40) ** 3))


@pytest.mark.parametrize("wide", [1, 2, 8])
@pytest.mark.parametrize("late", [1, 2.5, 30])
def test_what_a_pulse_of_the_input_does_is_no_spike(wide, late):
    times = np.arange(300.0)
    u = ((times % 150 > 60) & (times % 150 <= 60 + wide)) * 1.0
    y = 3 * np.interp(times - late, times, u, left=0.0)
    y += 0.01 * np.random.default_rng(0).standard_normal(300)
    assert checked_record(times, u, y).free.all()


@pytest.mark.thorough
@pytest.mark.parametrize("lasting", [2, 3, 4, 6, 10])
@pytest.mark.parametrize("written", [0.0, 90.0, "noise"])
def test_a_sensor_that_fails_for_some_samples_is_told_and_does_not_pull(lasting, written):
    rng = np.random.default_rng(lasting)
    t, u, y = lag(np.where(np.arange(400) // 80 % 2, 1.0, 0.0))
    y += 20
    failed = slice(203, 203 + lasting)
    y[failed] = rng.standard_normal(lasting) if written == "noise" else written
    said = f"y is {y[203]:g} at sample 203, and {lasting - 1} more, .* for outliers and left out"
    with pytest.warns(UserWarning, match=said) as warned:
        found = identify(t, u, y, structure=ONE_LAG)
    assert len(warned) == 1 and np.flatnonzero(~found.record.free).size == lasting
    gain, slow = (found.parameters[name] for name in ("gain", "lag"))
    assert gain.low < 2 < gain.high and slow.low < 15 < slow.high


@pytest.mark.thorough
@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_a_plant_that_is_not_linear_is_told(power):
    u = np.repeat(np.random.default_rng(4).uniform(0.2, 1, 40), 15)
    t, _, y = lag(u, noise=0.0)
    y = y[0] + np.abs(y / 2) ** power + 0.01 * np.random.default_rng(5).standard_normal(u.size)
    remarks = told(t, u, y)
    assert any("the square of the response" in said for said in remarks) is (power != 1)
    assert power != 1 or not remarks


@pytest.mark.parametrize("place", [0, 200])
def test_an_input_that_no_actuator_follows_is_told(place):
    t, u, y = lag(switched())
    asked = u.copy()
    asked[place] = -185060.0
    (said,) = checked_record(t, asked, y).remarks
    assert f"u is -185060 at sample {place}, while otherwise it moves between -1 and 1" in said
    assert not checked_record(t, u, y).remarks and not checked_record(t, 1e6 * u, y).remarks


@pytest.mark.slow
def test_a_lag_far_shorter_than_a_sample_asks_for_faster_ones():
    t, rng = np.arange(300.0), np.random.default_rng(0)
    u = (t > 100) * 1.0
    y = np.append(0.0, u[:-1]) + 0.01 * rng.standard_normal(300)
    # How far off it may be, longer than the record, is no number to print.
    assert "the lag is hardly known: sample faster" in told(t, u, y)


@pytest.mark.slow
def test_an_outlier_upon_a_drift_is_told():
    t, u, y = lag(switched(200))
    y = y + np.sin(2 * np.pi * t / 200)
    y[50] += 2
    assert any("outlier" in said and "at 50 s" in said for said in told(t, u, y))


@pytest.mark.slow
def test_a_sample_off_by_less_than_y_usually_moves_is_no_outlier():
    t, u, y = lag(switched(200), noise=1e-4)
    usual = np.median(np.abs(np.diff(y)))
    y[120] += 2 * usual
    assert not told(t, u, y)
    y[120] += 20 * usual
    assert "y has an outlier," in told(t, u, y)[0]


@pytest.mark.thorough
def test_what_a_sensor_rounds_and_a_table_interpolates_is_no_outlier():
    inputs = (np.arange(600) > 60).astype(float)
    t, u, y = lag(inputs, noise=0.0)
    y = np.round(y / 0.05) * 0.05
    y = np.interp(t + 0.02 * np.sin(t), t, y)
    assert not [each for each in identify(t, u, y).remarks if "outliers" in each]


@pytest.mark.thorough
@pytest.mark.parametrize("drift", [0.0, 1.0, -3.0])
def test_a_steady_drift_is_told_with_its_size(drift):
    t, u, y = lag(switched(800))
    found = identify(t, u, y + drift * t / 800, structure=ONE_LAG)
    said = [each for each in found.remarks if each.startswith("y drifts")]
    assert len(said) == bool(drift)
    if said:
        assert float(said[0].split()[4]) == pytest.approx(0.9 * abs(drift), rel=0.15)
    gain = found.parameters["gain"]
    assert gain.low < 2 < gain.high


@pytest.mark.slow
def test_a_drift_is_told_and_counted_in():
    t, u, y = lag(switched())
    rng = np.random.default_rng(5)
    quiet = of_switched_lag()
    drifting = identify(t, u, y + np.cumsum(0.05 * rng.standard_normal(400)), structure=ONE_LAG)
    assert any(said.startswith("y drifts") for said in drifting.remarks)
    gain, before = drifting.parameters["gain"], quiet.parameters["gain"]
    assert gain.standard_error > 3 * before.standard_error
    assert gain.low < 2 < gain.high


@pytest.mark.slow
def test_too_short_a_record_is_told():
    t, u, y = lag(np.where(np.arange(62) < 50, 0.0, 1.0))
    found = identify(t, u, y, structure=ONE_LAG)
    assert any("the record is short" in said for said in found.remarks)


@pytest.mark.slow
@pytest.mark.parametrize("limit", [1.0, 9.0])
def test_an_actuator_that_saturates_is_told(limit):
    u = np.repeat(np.random.default_rng(3).choice([0.0, 0.5, 1.0, 1.5], 20), 25)
    t, _, y = lag(np.minimum(u, limit))
    said = " ".join(identify(t, u, y, structure=ONE_LAG).remarks)
    assert ("as if u were cut off above 1" in said) is (limit == 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_data_from_a_closed_loop_are_told(closed):
    rng = np.random.default_rng(4)
    a, state, integral, wander = np.exp(-1 / 15), 0.0, 0.0, 0.0
    late, u, y = [0.0] * 4, [], []
    for k in range(800):
        wander = 0.9 * wander + 0.03 * rng.standard_normal()
        y.append(state + wander + 0.01 * rng.standard_normal())
        error = (k // 200) % 2 - (y[-1] if closed else 0.1 * rng.standard_normal())
        integral += 0.05 * error
        u.append(error + (integral if closed else 0.0))
        late.append(u[-1])
        state = a * state + 2 * (1 - a) * late.pop(0)
    found = identify(np.arange(800), np.array(u), np.array(y), structure=ONE_LAG)
    assert any("under control" in said for said in found.remarks) is closed


@pytest.mark.slow
def test_a_sensor_that_rounds_is_not_taken_for_a_limit_at_the_end_of_a_record():
    # A heater that has nearly settled, in steps of 0.32 and 0.33 as a converter writes them.
    rng = np.random.default_rng(2)
    t = np.arange(800.0)
    for _ in range(20):
        rising = 21 + 34 * -np.expm1(-np.maximum(t - 20, 0) / 160)
        y = np.round(np.round((rising + 0.2 * rng.standard_normal(800)) / 0.3226) * 0.3226, 2)
        y[770:] = y.max()
        assert checked_record(t, (t > 10) * 50.0, y).free.all()


@pytest.mark.thorough
def test_a_loop_is_tried_on_what_the_record_does_not_exclude():
    true = thermal("three steps", np.random.default_rng([1, 4, 11]))
    found = identify(true.t, true.u, true.y)
    proposal = propose(found)
    loop = proposal.loop
    plants = [found.process, *(each.process for each in found.candidates if each.rival)]
    plants += [found.least_squares, *found.corners.values()]
    assert len(found.corners) == 2 ** len(found.parameters)
    assert len(proposal.trials) == len(plants)
    for plant, trial in zip(plants, proposal.trials, strict=True):
        tried = nrdob.NRDOB(plant, loop.model, loop.controller, loop.filter)
        assert tried.stability().stable and trial.stable
        omega = np.geomspace(1e-6, 10, 4000) / true.truth["lag"] * 100
        assert trial.ms <= 2.5 and trial.ms >= np.abs(tried.S_d(1j * omega)).max() - 1e-3


@pytest.mark.thorough
def test_a_filter_is_made_slower_until_no_corner_fails():
    t, u, y = lag(switched(120, seed=3), noise=0.6)
    found = identify(t, u, y, structure=ONE_LAG, held_out=0)
    alone, proposal = propose(found.process), propose(found)
    first = [
        nrdob.NRDOB(plant, alone.loop.model, alone.loop.controller, alone.loop.filter).margins()
        for plant in found.corners.values()
    ]
    assert any(not each.stable or each.plant_loop.ms > 2.5 for each in first)
    assert proposal.loop.filter.time_constant > alone.loop.filter.time_constant
    assert all(each.holds for each in proposal.trials) and "so λ is" in proposal.words[-2]
    given = propose(found, time_constant=alone.loop.filter.time_constant)
    assert given.loop.filter.time_constant == alone.loop.filter.time_constant
    assert "does not tell enough" in given.warnings[0] or all(e.holds for e in given.trials)
    # No slower than needed: a filter a sixth faster fails on some corner.
    faster = propose(found, time_constant=proposal.loop.filter.time_constant / 1.2)
    assert not all(each.holds for each in faster.trials)


def test_the_chance_of_a_white_residual_is_that_of_ljung_and_box():
    rng = np.random.default_rng(5)
    e, u = rng.standard_normal(40), np.sign(rng.standard_normal(40))
    r = [sum(e[k:] * e[: 40 - k]) / sum(e * e) for k in range(1, 6)]
    statistic = 40 * 42 * sum(r[k - 1] ** 2 / (40 - k) for k in range(1, 6))
    chance = chi2(5).sf(statistic)
    assert 0.1 < chance < 0.9
    assert f"white (p = {chance:.2g})" in check_residuals(e, u, 1).reason
    assert "white (p = 1)" in check_residuals(np.zeros(40), u, 1).reason


@pytest.mark.slow
def test_a_gain_that_need_not_be_there_may_be_zero():
    rng = np.random.default_rng(0)
    u, y = np.sign(rng.standard_normal(60)), rng.standard_normal(60)
    found = identify(np.arange(60), u, y, structure=ONE_LAG)
    gain = found.parameters["gain"]
    assert gain.low <= 0 <= gain.high and "may be zero" in found.unsure


SQUARE = np.where(np.arange(1400) // 20 % 2 == 0, 1.0, -1.0)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("begins", "late", "told"),
    [
        (1000, 25, True),  # has always run
        (1000, 45, True),
        (-1, 25, False),  # one sample of rest before it
        (-30, 25, False),
    ],
)
def test_the_sign_is_open_where_a_wave_has_always_run(begins, late, told):
    u = np.concatenate([np.zeros(max(-begins, 0)), SQUARE])
    forced = np.concatenate([np.zeros(late), u])[: u.size]
    y = lfilter([0.0, 2 * (1 - np.exp(-0.1))], [1.0, -np.exp(-0.1)], forced)
    y += 0.05 * np.random.default_rng(0).standard_normal(y.size)
    part = slice(max(begins, 0), max(begins, 0) + 400)
    found = identify(np.arange(400), u[part], y[part], structure=ONE_LAG)
    gain = found.parameters["gain"]
    assert any("opposite half a period later" in each for each in found.remarks) is told
    assert (gain.low <= 0 <= gain.high) is told is bool(found.unsure)
    assert told or gain.low < 2 < gain.high
