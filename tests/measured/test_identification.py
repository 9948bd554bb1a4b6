"""Processes out of records: known truth, the measured plant, and what is wrong with a record."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter
from threadpoolctl import threadpool_info, threadpool_limits

import nrdob
from nrdob.measured import STRUCTURES, checked_record, heated_air, identified, identify, read_data
from nrdob.measured.fitting import Fit
from nrdob.measured.parameters import Parameter, corners_of, process_of
from nrdob.measured.residuals import Whitening, check_residuals
from nrdob.measured.structures import free_responses, held_responses
from nrdob.reporting import propose
from tests.campaigns.identification import DISTURBANCES, held, measured, response

BY_NAME = {each.name: each for each in STRUCTURES}


@cache
def of_heated_air(structure=None):
    """Identify the plant that was measured, once for all tests."""
    return identify(*heated_air(), structure=structure)


@pytest.mark.parametrize("delay", [0.0, 0.3, 2.0, 7.75])
@pytest.mark.parametrize("den", [[1.0, 0.2], [1.0, 0.5, 0.04], [1.0, 0.1, 0.0], [1.0, 0.02, 0.3]])
def test_held_response_is_exact_for_every_dead_time(den, delay):
    rng = np.random.default_rng(1)
    u = rng.standard_normal(60)
    u[0] = 0.0
    modal = response(np.array(den), np.ones(1), delay, u)
    assert held_responses(den, u, delay)[0] == pytest.approx(modal, abs=1e-9)


def test_what_goes_in_before_the_record_comes_out_late_or_never():
    assert not held_responses([1.0, 1.0], np.ones(5), 5.0).any()
    assert not held_responses([1.0, 1.0], np.ones(5), 50.5).any()


@pytest.mark.slow
@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda each: each.name)
@pytest.mark.parametrize(
    "kind",
    ["step", *(pytest.param(kind, marks=pytest.mark.thorough) for kind in ("binary", "waves"))],
)
def test_without_noise_every_number_is_found(structure, kind):
    rng = np.random.default_rng(3)
    case = measured(structure, kind, "white", rng, noise=0.0)
    found = identify(case.t, case.u, case.y, structure=structure.name, held_out=0)
    told = {name: p.value for name, p in found.parameters.items()}
    assert told == pytest.approx(case.truth, rel=1e-3)
    assert found.fit_percent > 99.9


@pytest.mark.thorough
@pytest.mark.parametrize("disturbed", DISTURBANCES)
def test_intervals_hold_the_truth_as_often_as_they_say(disturbed):
    # 95 % of 36 intervals; the long campaign has thousands.
    told = [
        inside
        for case in range(12)
        for inside in held(
            STRUCTURES[1], "step", disturbed, np.random.default_rng([case, 7])
        ).values()
    ]
    assert len(told) == 36 and sum(told) >= 31


@pytest.mark.thorough
def test_the_structure_behind_a_record_is_chosen():
    rng = np.random.default_rng(11)
    chosen = []
    for structure in STRUCTURES[:4]:
        case = measured(structure, "binary", "white", rng)
        chosen.append(identify(case.t, case.u, case.y).structure == structure.name)
    assert all(chosen)


@pytest.mark.thorough
def test_resonance_is_told_as_frequency_and_damping():
    rng = np.random.default_rng(2)
    u = np.sign(rng.standard_normal(600)).repeat(2)[:600]
    u[0] = 0
    y = response(np.array([1.0, 0.04, 0.09]), np.array([0.18]), 3.4, u)
    found = identify(0.1 * np.arange(600), u, y + 0.05 * rng.standard_normal(600))
    assert found.structure == "two lags with dead time"
    assert found.parameters["natural frequency"].value == pytest.approx(3.0, rel=0.02)
    assert found.parameters["damping ratio"].value == pytest.approx(0.04 / 0.6, rel=0.2)
    assert found.process.delay == pytest.approx(0.34, abs=0.05)


@pytest.mark.thorough
def test_heated_air_is_two_lags_behind_two_samples():
    found = of_heated_air()
    assert found.structure == "two lags with dead time"
    assert found.fit_percent == pytest.approx(89.1, abs=0.1)
    assert found.validation_percent == pytest.approx(85.5, abs=0.1)
    assert found.process.delay == pytest.approx(0.157, abs=0.002)
    assert found.process.dcgain() == pytest.approx(0.936, abs=0.002)
    assert -1 / found.process.poles().real == pytest.approx([0.136, 0.254], abs=0.003)
    assert "has a memory" in found.residuals.reason and not found.remarks and not found.unsure


@pytest.mark.thorough
def test_what_one_lag_cannot_explain_is_not_taken_for_drift():
    found = of_heated_air("one lag with dead time")
    assert found.fit_percent == pytest.approx(86.0, abs=0.3)
    assert found.validation_percent == pytest.approx(82.4, abs=0.3)


@pytest.mark.thorough
def test_one_lag_by_least_squares_is_a_rival():
    record = heated_air()
    step = record.sampling_time
    inputs, outputs = record.u - record.u[0], record.y
    fine = np.arange(10 * inputs.size) * step / 10

    def rest(tried):
        late = np.floor((fine - tried[2]) / step + 1e-9).astype(int)
        shifted = np.where(late >= 0, inputs[np.maximum(late, 0)], 0.0)
        left = np.exp(-step / 10 / tried[1])
        return outputs - tried[3] - tried[0] * lfilter([0, 1 - left], [1, -left], shifted)[::10]

    starts = ([0.9, 0.4, delay, 6.0] for delay in (0.1, 0.2, 0.3))
    bounds = [-9, 0.05, 0, -9], [9, 5, 1, 9]
    fits = [least_squares(rest, start, bounds=bounds, diff_step=1e-2) for start in starts]
    gain, lag, delay, _ = min(fits, key=lambda fit: fit.cost).x
    found = of_heated_air()
    assert found.least_squares.dcgain() == pytest.approx(gain, rel=0.02)
    assert -1 / found.least_squares.poles()[0].real == pytest.approx(lag, rel=0.05)
    assert found.least_squares.delay == pytest.approx(delay, abs=0.2 * step)
    assert any("plain least squares" in trial.process for trial in propose(found).trials)


@pytest.mark.slow
def test_process_stands_in_a_loop():
    found = of_heated_air("one lag with dead time")
    model = found.process.tf
    assert nrdob.stabilizing_time_constants(found.process, model, 1)


@pytest.mark.slow
def test_a_record_that_begins_with_the_step_has_the_numbers_of_the_plant():
    t = 0.1 * np.arange(300)
    noise = np.random.default_rng(0).standard_normal(300)
    y = 20 + 15 * -np.expm1(-np.maximum(t - 1.23, 0) / 3) + 0.05 * noise
    record = checked_record(t, 0 * t + 50, y, input_before=0)
    found = identified(record)
    assert found.structure == "one lag with dead time" and record.t.size == 300
    told = [p.value for p in found.parameters.values()]
    assert told == pytest.approx([0.3, 3.0, 1.23], rel=0.02)
    assert all(
        p.low < true < p.high
        for p, true in zip(found.parameters.values(), (0.3, 3, 1.23), strict=True)
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_a_structure_that_is_too_simple_is_not_said_to_have_no_gain(seed):
    rng = np.random.default_rng(seed)
    u = np.sign(rng.standard_normal(600)).repeat(2)[:600]
    u[0] = 0
    y = response(np.array([1.0, 0.04, 0.09]), np.array([0.18]), 3.4, u)
    y += 0.05 * rng.standard_normal(600)
    found = identify(0.1 * np.arange(600), u, y, structure="one lag with dead time")
    said = " ".join([*found.remarks, found.unsure])
    assert found.residuals.independent is False and "zero" not in said
    assert "explains only" not in said


@pytest.mark.thorough
def test_units_scale_with_the_time_axis():
    t, u, y = heated_air()
    slow = identify(1000 * t, u, y, structure="two lags with dead time")
    fast = of_heated_air("two lags with dead time")
    assert slow.process.delay == pytest.approx(1000 * fast.process.delay)
    assert slow.process(0.001j) == pytest.approx(fast.process(1j))


@pytest.mark.slow
def test_output_cut_off_by_a_limit_is_left_out():
    rng = np.random.default_rng(4)
    case = measured(BY_NAME["one lag with dead time"], "binary", "white", rng, noise=1e-4)
    top = np.quantile(case.y, 0.8)
    cut = np.minimum(case.y, top)
    with pytest.warns(UserWarning, match="cut off by a limit"):
        found = identify(case.t, case.u, cut, structure="one lag with dead time")
    told = {name: p.value for name, p in found.parameters.items()}
    assert told == pytest.approx(case.truth, rel=0.01)
    assert "largest value" in " ".join(found.remarks)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda t, u, y: (t[:10], u[:10], y[:10]), "10 samples; at least 20"),
        (lambda t, u, y: (t, u[:-1], y), "100, 99 and 100 values"),
        (lambda t, u, y: (t, 0 * u + 3, y), "u is 3 in the whole record"),
        (lambda t, u, y: (t, u, 0 * y), "y is 0 in the whole record"),
        (lambda t, u, y: (t**4.0, u, y), "not evenly sampled: .* most before sample 99; use a"),
        (
            lambda t, u, y: (np.delete(t, [50, 51]), u[2:], y[2:]),
            "2 of them in a row before sample 50",
        ),
        (lambda t, u, y: (t[::-1], u, y), "times must increase"),
        (lambda t, u, y: (t, u, np.where(t == 7, np.nan, y)), "y is nan at sample 7;"),
        (
            lambda t, u, y: (t, np.eye(100)[99], y),
            r"changes at the last sample only.*input_before=0",
        ),
        (lambda t, u, y: (t, u, y.reshape(10, 10)), "shape"),
    ],
)
def test_what_is_wrong_with_a_record_is_said(spoil, said):
    t = np.arange(100.0)
    u = (t > 10) * 1.0
    y = 1 - np.exp(-0.1 * np.maximum(t - 12, 0))
    with pytest.raises(ValueError, match=said):
        checked_record(*spoil(t, u, y))
    with pytest.raises(TypeError, match="list of real numbers"):
        checked_record(t, list("ab" * 50), y)


def test_an_output_that_settles_is_not_taken_for_cut_off():
    t = np.arange(200.0)
    y = np.round(1 - np.exp(-0.1 * np.maximum(t - 12, 0)), 2)
    assert checked_record(t, (t > 10) * 1.0, y).free.all()


GOOD = [(k, k // 7 % 2, k % 5) for k in range(30)]


def _written(folder, head, rows, between=","):
    path = folder / "data.csv"
    lines = [head] if head else []
    lines += [between.join(map(str, row)) for row in rows]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.mark.parametrize("between", [",", ";", "\t"])
@pytest.mark.parametrize("head", ["", "time (s){0}Input{0}Y", "t{0}u{0}y"])
def test_columns_are_told_by_name_or_order(tmp_path, head, between):
    record = read_data(_written(tmp_path, head.format(between), GOOD, between))
    assert np.array_equal(np.array(list(record)).T, GOOD)
    assert bool(record.remarks) == (not head)


def test_columns_with_names_come_in_any_order(tmp_path):
    turned = [(y, "x", t, u) for t, u, y in GOOD]
    record = read_data(_written(tmp_path, "y,comment,t,u", turned))
    assert np.array_equal(np.array(list(record)).T, GOOD)


def test_decimal_commas_beside_semicolons(tmp_path):
    rows = [(f"{k},5", k % 2, "1,25e1" if k else 3) for k in range(30)]
    t, _, y = read_data(_written(tmp_path, "t;u;y", rows, ";"))
    assert t[1] == 1.5 and y[1] == 12.5


@pytest.mark.parametrize(
    ("head", "rows", "said"),
    [
        ("t,u,y", [*GOOD[:9], (9, "on", 1), *GOOD[10:]], "line 11: u is 'on', which is no"),
        ("t,u,y", [*GOOD[:9], (9, 1), *GOOD[10:]], "line 11 has 2 cells where the first has 3"),
        ("t,u,y", [*GOOD[:9], *GOOD[12:]], "3 of them in a row before line 11;"),
        ("t,u,y", [*GOOD[:9], (3, 1, 1), *GOOD[10:]], "from 8 to 3 at line 11;"),
        ("t,u,y", GOOD[:9], "9 samples"),
        ("t,u,y", [], "0 samples"),
        ("u,y", [row[1:] for row in GOOD], "no time: add a column t"),
        ("", [row[1:] for row in GOOD], "2 columns and no headings"),
        ("a,b,c,d", [(*row, 1) for row in GOOD], "which holds t, u, y is not known: choose"),
        ("", [], "is empty"),
    ],
)
def test_what_is_wrong_with_a_table_is_said_with_its_line(tmp_path, head, rows, said):
    with pytest.raises(ValueError, match=said):
        read_data(_written(tmp_path, head, rows))


def test_no_time_column_but_a_sampling_time(tmp_path):
    path = _written(tmp_path, "u,y", [row[1:] for row in GOOD])
    assert read_data(path, sampling_time=0.5).t[3] == 1.5
    for wrong in (0, -1, float("nan")):
        with pytest.raises(ValueError, match="positive seconds"):
            read_data(path, sampling_time=wrong)


@pytest.mark.slow
def test_a_record_is_identified_with_all_that_was_noticed_in_reading_it(tmp_path):
    _, u, y = heated_air()
    rows = [(k, u[k], "" if k % 50 == 25 else y[k]) for k in range(300)]
    record = read_data(_written(tmp_path, "t,u,y", rows))
    with pytest.warns(UserWarning, match=r"samples are missing|u changes while") as warned:
        found = identify(record, structure="one lag with dead time")
    assert found.record is record and record.t.tolist() == list(range(300))
    assert np.flatnonzero(~record.free).tolist() == [*range(25, 300, 50)]
    assert "6 of 300 samples are missing" in str(warned[0].message)
    again = read_data(_written(tmp_path, "u,y", [row[1:] for row in rows]), sampling_time=1.0)
    assert all(np.array_equal(*each) for each in zip(again, record, strict=True))
    halves = [(k // 2, *row[1:]) for k, row in enumerate(rows)]
    coarse = read_data(_written(tmp_path, "t,u,y", halves))
    assert coarse.t == pytest.approx(np.arange(300) / 2, rel=0.01)
    assert np.array_equal(coarse.free, record.free)
    for beside in ({"u": u}, {"y": y}, {"input_before": 0}):
        with pytest.raises(TypeError, match="a record holds u, y and what the input was before"):
            identify(record, **beside)


def test_files_that_are_no_text_are_named(tmp_path):
    path = tmp_path / "data.xlsx"
    path.write_bytes(b"PK\x03\x04\n\xff\xfe")
    with pytest.raises(ValueError, match="see line 2: save it as CSV"):
        read_data(path)
    path.write_bytes(b"t,u,y\n1,\0,3")
    with pytest.raises(ValueError, match="see line 2: save it as CSV"):
        read_data(path)


def test_cells_are_never_run(tmp_path):
    rows = [*GOOD[:9], (9, "__import__('os').system('true')", 1), *GOOD[10:]]
    with pytest.raises(ValueError, match="line 11: u is"):
        read_data(_written(tmp_path, "t,u,y", rows))


def test_a_coarse_sensor_and_a_plant_without_lag_are_not_taken_for_cut_off():
    t = np.arange(200.0)
    u = (t > 10) * 1.0
    coarse = np.round(1 - np.exp(-0.1 * np.maximum(t - 12, 0)), 1)
    assert checked_record(t, u, coarse).free.all()
    assert checked_record(t, np.sign(np.sin(t**1.3)), 2 * np.sign(np.sin(t**1.3))).free.all()


@pytest.mark.thorough
def test_units_of_u_and_y_do_not_matter():
    t, u, y = heated_air()
    plain = of_heated_air("two lags with dead time")
    scaled = identify(t, 1e12 * u, 1e-9 * y, structure="two lags with dead time")
    assert 1e21 * scaled.process(2j) == pytest.approx(plain.process(2j), rel=1e-6)
    assert scaled.fit_percent == pytest.approx(plain.fit_percent, rel=1e-6)


@pytest.mark.thorough
def test_noise_that_has_nothing_to_do_with_the_input_is_called_so():
    rng = np.random.default_rng(0)
    u, y = np.sign(rng.standard_normal(300)), rng.standard_normal(300)
    assert "explains only" in " ".join(identify(0.1 * np.arange(300), u, y).remarks)


@pytest.mark.thorough
def test_a_long_record_is_fitted_as_a_short_one():
    rng = np.random.default_rng(8)
    u = np.sign(np.sin(0.001 * np.arange(8000) ** 1.3))
    y = response(np.array([1.0, 0.01]), np.array([0.02]), 30.4, u)
    t = 0.01 * np.arange(8000)
    found = identify(t, u, y + 0.05 * rng.standard_normal(8000), structure="one lag with dead time")
    told = [p.value for p in found.parameters.values()]
    assert told == pytest.approx([2.0, 1.0, 0.304], rel=0.01)


@pytest.mark.slow
def test_a_step_just_before_the_end_tells_no_numbers():
    t = np.arange(100.0)
    y = (t > 98) + 1e-3 * np.random.default_rng(0).standard_normal(100)
    with pytest.raises(ValueError, match="does not tell the numbers of the process"):
        identify(t, 1.0 * (t > 97), y, structure="one lag with dead time")


@pytest.mark.thorough
def test_a_coarse_sensor_widens_the_intervals():
    rng = np.random.default_rng(4)
    case = measured(BY_NAME["one lag with dead time"], "binary", "white", rng, noise=1e-4)
    grain = 0.05 * np.ptp(case.y)
    fine, coarse = (
        identify(case.t, case.u, y, structure="one lag with dead time").parameters
        for y in (case.y, grain * np.round(case.y / grain))
    )
    for name, truth in case.truth.items():
        assert coarse[name].low <= truth <= coarse[name].high
        assert coarse[name].high - coarse[name].low > fine[name].high - fine[name].low


def test_what_a_second_order_plant_does_by_itself_is_spanned_by_its_modes():
    k = np.arange(8)
    basis = free_responses([1.0, 3.0, 2.0], k.size)  # (s + 1)(s + 2)
    modes = np.exp(-np.outer([1, 2], k))
    assert basis.shape == modes.shape
    assert np.linalg.lstsq(basis.T, modes.T)[0].T @ basis == pytest.approx(modes, abs=1e-12)


def test_every_corner_of_an_integrating_plant_integrates():
    gain, wait = Parameter(2.0, "", 0.1, 1.0, 3.0), Parameter(0.5, "s", 0.1, 0.4, 0.6)
    numbers = {"gain": gain, "dead time": wait}
    found = corners_of(BY_NAME["integrator with dead time"], numbers)
    expected = [k * np.exp(-2j * T) / 2j for k in (1, 3) for T in (0.4, 0.6)]
    assert [each(2j) for each in found.values()] == pytest.approx(expected)


def test_an_input_too_poor_for_so_many_numbers_leaves_independence_open():
    # One sine has correlations in two directions, and two numbers were fitted.
    rest = np.random.default_rng(1).standard_normal(400)
    found = check_residuals(rest, np.sin(0.3 * np.arange(400)), 2)
    assert found.independent is None and np.isnan(found.independence)
    assert "too poor" in found.reason


@pytest.mark.thorough
def test_an_integrator_whose_record_begins_with_the_step_needs_to_be_known_at_rest():
    # A ramp that it had before looks like its answer; what is left would tell a wrong sign.
    u, v, y = np.where(np.arange(250) >= 3, 64.0, 0.0), 0.0, np.zeros(250)
    for k in range(249):
        y[k + 1] = y[k] + 0.01 * v * (1 + 0.1 * np.sin(y[k] / 30))
        v += (1 - np.exp(-0.2)) * (4 * u[k] - v)
    t = 0.01 * np.arange(250)
    found = identified(checked_record(t, u, np.round(y)))
    assert found.parameters["gain"].low <= 0 <= found.parameters["gain"].high
    assert found.unsure.startswith("u moves only as the record begins")
    assert "input_before=0" in " ".join(found.remarks)
    noise = 0.5 * np.random.default_rng(1).standard_normal(250)
    found = nrdob.identify(t[2:], u[2:], np.round(y + noise)[2:], input_before=0)
    assert found.parameters["gain"].low < 4 < found.parameters["gain"].high
    assert not found.unsure


def test_a_thousandth_of_a_sample_is_no_dead_time():
    rough = Fit(STRUCTURES[1], np.array([1e-3, 3.0]), np.ones(1), 0, False, Whitening(), 0.0, 0.0)
    assert process_of(rough, 0.1, 1.0).delay == 0
    late = replace(rough, shape=np.array([0.02, 3.0]))
    assert process_of(late, 0.1, 1.0).delay == pytest.approx(0.002)


@pytest.mark.slow
def test_small_matrices_do_not_wait_for_other_threads(monkeypatch):
    def threads():
        return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}

    seen = []
    judge = "nrdob.measured.identification.judge"
    monkeypatch.setattr(judge, lambda *_: seen.append(threads()) or 1 / 0)
    with threadpool_limits(limits=2, user_api="blas"):
        with pytest.raises(ZeroDivisionError):
            identify(*heated_air(), structure="one lag with dead time")
        assert seen == [{1}] and threads() == {2}


@pytest.mark.thorough
def test_a_resonance_that_is_fast_against_a_long_record_is_found():
    # Nine samples a period, and 20,000 samples: in means over ten of them nothing is left of it.
    rng = np.random.default_rng(0)
    u = rng.standard_normal(20_000)
    omega = 2 * np.pi / 9
    num, den, _ = cont2discrete(([2 * omega**2], [1, 0.1 * omega, omega**2]), 1.0)
    y = lfilter(num.ravel(), den, u)
    y += 0.05 * y.std() * rng.standard_normal(y.size)
    found = identify(np.arange(y.size), u, y, structure="two lags with dead time")
    gain, frequency, damping, dead_time = (p.value for p in found.parameters.values())
    assert (gain, frequency, damping) == pytest.approx((2.0, omega, 0.05), rel=0.01)
    assert dead_time < 0.01 and found.fit_percent > 90
