"""The fastest filter that meets a specification: met at the border, missed just beyond it."""

from __future__ import annotations

from math import inf, sqrt

import control as ct
import numpy as np
import pytest
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import nrdob
from campaigns.designs import campaign
from nrdob import LowPassFilter, admissible_time_constants, design_filter, paper
from strategies import fractions

s = ct.tf("s")
lag = 1 / (s + 1)


def plant_loop(process, model, filter):
    return nrdob.NRDOB(process, model, 0.0, filter).margins().plant_loop


@pytest.mark.parametrize("zero", [0.3, 100.0])
@pytest.mark.parametrize("max_ms", [1.1, 1.6, 2.5])
def test_zero_in_the_right_half_plane_has_a_closed_form(zero, max_ms):
    # n = 1: S_d = λs/((λ - 1/z)s + 1) has its peak λ/(λ - 1/z) at infinite frequency.
    F = design_filter((1 - s / zero) * lag, lag, order=1, max_ms=max_ms)
    assert F.time_constant == pytest.approx(max_ms / (max_ms - 1) / zero, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "specification",
    [{"max_ms": 1.5}, {"max_ms": 1.7}, {"max_ms": 3.0}],
)
@pytest.mark.parametrize(("number", "modified"), [(2, False), (2, True), (4, False), (4, True)])
def test_the_specification_is_met_and_no_faster_filter_meets_it(number, modified, specification):
    loop = paper.example(number, modified)
    F = design_filter(loop.process, loop.model, order=loop.filter.order, **specification)
    faster = LowPassFilter(F.time_constant * (1 - 1e-5), F.order)
    assert meets(plant_loop(loop.process, loop.model, F), **specification)
    assert not meets(plant_loop(loop.process, loop.model, faster), **specification)


def meets(found, max_ms, by=1e-7):
    return bool(found.stable and found.ms <= max_ms + by)


@pytest.mark.slow
def test_of_several_orders_the_one_that_rejects_most_is_chosen():
    loop = paper.example(2)
    wanted = {"max_ms": 2.0}
    chosen = design_filter(loop.process, loop.model, **wanted)
    each = [design_filter(loop.process, loop.model, order=n, **wanted) for n in (1, 2, 3)]
    assert chosen == min(each, key=lambda F: F.order * F.time_constant)
    # nλ/R(0) is the slope of S_d at s = 0; the filter of widest bandwidth has a steeper one.
    slopes = [abs(nrdob.NRDOB(loop.process, loop.model, 0.0, F).S_d(1e-6j)) for F in each]
    assert each[int(np.argmin(slopes))] == chosen
    assert chosen.bandwidth < max(F.bandwidth for F in each)


@pytest.mark.slow
def test_of_a_zero_in_the_right_half_plane_the_first_order_makes_the_most():
    # R = 1 - s/z, Ms = 2: n = 1 has λ = 2/z exactly, n = 2 needs nλ = 2.29/z.
    F = design_filter((1 - s) * lag, lag, max_ms=2.0)
    assert (F.order, F.time_constant) == (1, pytest.approx(2.0, rel=1e-8))
    second = design_filter((1 - s) * lag, lag, order=2, max_ms=2.0)
    assert 2 * second.time_constant == pytest.approx(2.29, abs=5e-3)


# Every window is found.


@pytest.mark.thorough
@pytest.mark.parametrize(("number", "modified"), [(2, True), (3, True), (4, True)])
@pytest.mark.parametrize("above", [2e-3, 1e-5])
def test_a_limit_just_above_the_best_there_is_can_be_met(number, modified, above):
    loop = paper.example(number, modified)
    with pytest.raises(ValueError, match="closest comes") as refusal:
        design_filter(loop.process, loop.model, order=3, max_ms=1.0001)
    time_constant = float(str(refusal.value).split("λ = ")[1].split()[0])
    best = min(
        plant_loop(loop.process, loop.model, LowPassFilter(time_constant * f, 3)).ms
        for f in np.linspace(0.99, 1.01, 21)
    )
    limit = best * (1 + above)
    F = design_filter(loop.process, loop.model, order=3, max_ms=limit)
    assert plant_loop(loop.process, loop.model, F).ms <= limit * (1 + 1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "max_ms", [1.16, *(pytest.param(ms, marks=pytest.mark.slow) for ms in (1.3, 2.0))]
)
def test_two_windows_beside_a_resonance_that_shifted(max_ms):
    model = 1 / (s**2 + 0.2 * s + 1)
    process = 1 / ((s / 0.9) ** 2 + 0.2 * s / 0.9 + 1)
    windows = admissible_time_constants(process, model, 2, max_ms=max_ms)
    grid = np.geomspace(1e-3, 1e3, 300)
    met = [
        meets(plant_loop(process, model, LowPassFilter(value, 2)), max_ms=max_ms, by=0.0)
        for value in grid.tolist()
    ]
    inside = [any(low <= value <= high for low, high in windows) for value in grid]
    assert inside == met and len(windows) == 2


@pytest.mark.slow
def test_a_high_limit_of_the_sensitivity_is_kept_all_over_a_window():
    # The peak grows smoothly from 38 to infinity, and is narrow.
    process = ct.tf([1.99], [-0.02339, -0.03169, 1.252, 3.326, 1])
    model = ct.tf([-1], [0.04419, 0.643, 2.929, 4.198, 1])
    (window,) = admissible_time_constants(process, model, 5, max_ms=47.2)
    assert window[0] == 0
    inside = np.geomspace(1e-5, window[1], 8)
    peaks = [plant_loop(process, model, LowPassFilter(v, 5)).ms for v in inside.tolist()]
    assert peaks == sorted(peaks)
    assert peaks[-1] == pytest.approx(47.2, rel=1e-8)


@pytest.mark.parametrize("max_ms", [1.01, 1.5, 30.0])
def test_a_loop_that_does_not_vanish_at_infinite_frequency_has_closed_forms(max_ms):
    # n = 1, R = 1 - s: L = (1 - s)/(λs) tends to -1/λ.
    (window,) = admissible_time_constants((1 - s) * lag, lag, 1, max_ms=max_ms)
    assert window == (pytest.approx(max_ms / (max_ms - 1), rel=1e-8), inf)


@pytest.mark.parametrize("max_ms", [1.01, 1.5, 3.0])
def test_with_dead_time_the_limit_at_infinite_frequency_is_at_its_worst_phase(max_ms):
    # n = 1, R = 0.3 (s + 0.2)(s + 0.5)/(s + 2) exp(-0.3s): L tends to a circle of radius 0.3/λ,
    # from within.
    process = nrdob.delay(0.3) * 0.3 * (s + 0.2) * (s + 0.5) / (s + 2) * lag
    (window,) = admissible_time_constants(process, lag, 1, max_ms=max_ms)
    assert window == (pytest.approx(0.3 * max_ms / (max_ms - 1), rel=1e-8), inf)


@pytest.mark.slow
@pytest.mark.parametrize("above", [1e-4, 1e-6, 1e-9])
def test_a_peak_close_to_1_needs_a_filter_as_much_slower_than_the_dead_time(above):
    # L = exp(-θs)/(λs): |1 + L|² = 1 - 2 sin(θω)/(λω) + 1/(λω)², so Ms - 1 → θ/λ for slow filters.
    (window,) = admissible_time_constants(nrdob.delay(3.0) * lag, lag, 1, max_ms=1 + above)
    assert window == (pytest.approx(3.0 / above, rel=above**0.5), inf)


@pytest.mark.parametrize("gain", [0.01, 2.0])
def test_with_an_integrator_of_the_model_alone_the_gain_at_zero_decides(gain):
    # n = 1: L = -(k/λ)/(s + 1), whose largest sensitivity is λ/(λ - k), at zero frequency.
    process, model = -gain * lag, ct.tf([1], [1, 0])
    (window,) = admissible_time_constants(process, model, 1, max_ms=1.6)
    assert window == (pytest.approx(8 / 3 * gain, rel=1e-8), inf)
    assert design_filter(process, model, order=1, max_ms=1.6).time_constant == pytest.approx(
        8 / 3 * gain, rel=1e-8
    )


@pytest.mark.slow
@pytest.mark.parametrize("above", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_an_undamped_mode_comes_too_close_however_narrow_it_is(above, delay):
    # Beside the pole at j, R/D(λ) is a straight line through 0, at an angle that λ turns.
    process, model = lag / (s**2 + 1), lag**2
    residue = (1 + 1j) / 2j * np.exp(-1j * delay)

    def peak(slowness):
        value = residue / ((1 + 1j * slowness) ** 3 - 1)
        return abs(value) / abs(value.real)

    max_ms = peak(1e12) * (1 + above)
    end = brentq(lambda u: peak(np.exp(u)) - max_ms, 4.0, 14.0, xtol=1e-12)
    wanted = {"order": 3, "max_ms": max_ms}
    *_, window = admissible_time_constants(nrdob.delay(delay) * process, model, **wanted)
    assert window == (pytest.approx(np.exp(end), rel=1e-4), inf)


def test_admissible_time_constants_end_where_the_closed_form_says():
    # n = 1, R = 1 - s/z: Ms = λ/(λ - 1/z), so that Ms ≤ 1.6 from 8/3 on, and for every slow one.
    (window,) = admissible_time_constants((1 - s) * lag, lag, 1, max_ms=1.6)
    assert window == (pytest.approx(8 / 3, rel=1e-8), inf)
    assert admissible_time_constants(lag, lag, 2, max_ms=1.2) == [(0.0, inf)]
    assert admissible_time_constants(lag, lag, 2, max_ms=1.1) == []
    assert admissible_time_constants(4 / (2 - s - s**2), 1 / (s + 1) ** 2, 2, max_ms=2) == []


@pytest.mark.thorough
@settings(max_examples=40)
@given(fractions(), fractions(), st.floats(-3, 0), st.floats(1.2, 3.0))
def test_random_designs_keep_their_promise(process, model, dead_time, max_ms):
    excess, other = (each.den[0][0].size - each.num[0][0].size for each in (model, process))
    order = max(1, excess, excess - other + 1)  # so that L vanishes at infinite frequency
    process = nrdob.delay(10**dead_time) * process  # without it most limits are met by every filter
    try:
        F = design_filter(process, model, order=order, max_ms=max_ms)
    except ValueError:
        reject()  # what refusals say is tested below, one by one
    found = plant_loop(process, model, F)
    assume(found.stable is not None)
    assert found.stable and found.ms <= max_ms * (1 + 1e-6)


def test_a_peak_before_a_circle_at_infinite_frequency_keeps_the_limit():
    # L = (s + 1) exp(-0.1s)/(λs) is larger than 1/λ, its limit: Ms is largest at 31 rad/s.
    process = nrdob.delay(0.1) * ct.tf([1, 1], [1, 1])
    F = design_filter(process, lag, order=1, max_ms=2.0)
    omega = np.linspace(25, 40, 150_001)
    L = (1j * omega + 1) * np.exp(-0.1j * omega) / (F.time_constant * 1j * omega)
    assert 1 / np.abs(1 + L).min() == pytest.approx(2.0, rel=1e-8)
    assert 1 / (1 - 1 / F.time_constant) < 1.9990


def test_the_floor_of_the_sensitivity_is_told():
    # A matched loop of order 2 has S_d = 1 - F, whose peak is 2/√3 for every λ.
    with pytest.raises(ValueError, match=rf"closest comes .* Ms = {2 / sqrt(3):.4g}"):
        design_filter(lag, lag, order=2, max_ms=1.1)


def test_without_a_limit_the_noise_must_choose():
    with pytest.raises(ValueError, match="every filter of order 2, however fast; let the noise"):
        design_filter(lag, lag, order=2, max_ms=1.2)


def test_no_stabilising_filter_is_told_with_the_reason():
    with pytest.raises(ValueError, match="opposite DC sign"):
        design_filter(4 / (2 - s - s**2), 1 / ((s + 1) * (s + 2)), max_ms=2)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ({"max_ms": 1.0}, "max_ms is 1.0"),
        ({"max_ms": float("nan")}, "max_ms is nan"),
        ({"max_ms": "2"}, "max_ms is '2'"),
        ({"max_ms": True}, "max_ms is True"),
        ({"max_ms": 2 + 1j}, r"max_ms is \(2\+1j\)"),
    ],
)
@pytest.mark.parametrize("design", [design_filter, admissible_time_constants])
def test_impossible_specifications_are_refused(design, specification, message):
    with pytest.raises((ValueError, TypeError), match=message):
        design(lag, lag, order=1, **specification)


@pytest.mark.parametrize("order", [True, 2.0, "2"])
@pytest.mark.parametrize("design", [design_filter, admissible_time_constants])
def test_an_order_that_is_no_whole_number_is_named(design, order):
    with pytest.raises(TypeError, match="order is"):
        design(lag, lag, order=order, max_ms=2.0)


@pytest.mark.slow
def test_a_limit_that_no_filter_meets_says_what_comes_closest():
    loop = paper.example(3, modified=True)
    with pytest.raises(ValueError, match=r"meets Ms ≤ 1.6; closest comes"):
        design_filter(loop.process, loop.model, max_ms=1.6)


def test_an_order_too_low_for_causality_is_refused():
    with pytest.raises(ValueError, match="not causal"):
        design_filter(lag**2, lag**2, order=1, max_ms=2)


@pytest.mark.thorough
def test_a_sample_of_the_campaign_finds_no_fault():
    found = campaign(4, seed=2)
    assert not [name for name in found if name.startswith("WRONG")]


@pytest.mark.slow
@pytest.mark.parametrize("gain", [1e-12, 1e12])
def test_the_unit_of_the_output_changes_nothing(gain):
    loop = paper.example(4)
    F = design_filter(loop.process, loop.model, order=3, max_ms=1.8)
    scaled = design_filter(gain * loop.process, gain * loop.model, order=3, max_ms=1.8)
    assert scaled.time_constant == pytest.approx(F.time_constant, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_the_unit_of_time_scales_the_answer(unit):
    F = design_filter((1 - unit * s) / (unit * s + 1), 1 / (unit * s + 1), order=2, max_ms=1.6)
    here = design_filter((1 - s) / (s + 1), 1 / (s + 1), order=2, max_ms=1.6)
    assert F.time_constant == pytest.approx(unit * here.time_constant, rel=1e-9)


@pytest.mark.parametrize("size", [1e-30, 1e30])
def test_the_size_of_the_coefficients_changes_nothing(size):
    process, model = ct.tf([-size, size], [size, size]), ct.tf([size], [size, size])
    F = design_filter(process, model, order=1, max_ms=1.6)
    assert F.time_constant == pytest.approx(8 / 3, rel=1e-8)


def test_coefficients_whose_products_leave_the_range_of_numbers_are_refused():
    with pytest.raises(ValueError, match="range of floating-point numbers"):
        design_filter(([1e-200], [1e-200, 1e-200]), ([1e-200], [1e-200, 1e-200]), max_ms=2)


def test_a_resonance_that_a_long_dead_time_turns_keeps_its_distance():
    # With a lag as model and filter L is (s + 1)/(λs) times the process.
    mode = ct.tf([0.1, 5, 1], [0.01, 0.1, 1])
    ((low, high),) = admissible_time_constants(nrdob.delay(30.0) * mode, lag, 1, max_ms=2.0)
    omega = 1j * np.linspace(5.0, 20.0, 100_001)
    L = (1 + 1 / omega) * mode(omega) * np.exp(-30 * omega)
    peaks = [np.max(1 / np.abs(1 + L / (share * low))) for share in (1, 0.999)]
    assert peaks[0] == pytest.approx(2.0, rel=1e-4) and peaks[1] > 2.001 and high == inf


@pytest.mark.slow
def test_of_several_orders_the_one_tried_last_may_be_chosen():
    process = 0.3 * (1 - s / 4.12) * lag
    # nλ/R(0) is the time in which the loop rejects.
    alone = [design_filter(process, lag, order=n, max_ms=2.5) for n in (1, 2, 3)]
    chosen = design_filter(process, lag, max_ms=2.5)
    assert chosen == min(alone, key=lambda F: F.order * F.time_constant) == alone[0]
    with pytest.raises(TypeError, match="order is"):
        design_filter(process, lag, order=(2, 1), max_ms=2.5)


@pytest.mark.parametrize(
    ("family", "named"),
    [(4, "order 4"), (nrdob.filter_family("binomial", 4), "order 4")],
)
def test_where_only_other_filters_stabilise_no_reason_against_all_is_given(family, named):
    # (λs + 1)^4 = -9 has roots on the right whatever λ; a lag has none, (λs + 1) = -9.
    refusal = f"^no filter of {named} stabilises the loop: choose another model"
    with pytest.raises(ValueError, match=refusal):
        design_filter(10 * lag, lag, order=family, max_ms=2.0)
