"""The fastest filter that meets a specification: met at the border, missed just beyond it."""

from __future__ import annotations

from math import inf, sqrt

import control as ct
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import nrdob
from campaigns.designs import campaign
from nrdob import LowPassFilter, admissible_time_constants, design_filter, paper
from nrdob.design.forbidden import Curve, limits
from nrdob.design.slack import Specification
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


@pytest.mark.parametrize(
    "specification",
    [{"max_ms": 1.5}, {"min_gm_db": 8.0}, {"min_pm_deg": 50.0}, {"max_ms": 2.0, "min_gm_db": 9.0}],
)
@pytest.mark.parametrize(("number", "modified"), [(2, False), (2, True), (4, False), (4, True)])
def test_the_specification_is_met_and_no_faster_filter_meets_it(number, modified, specification):
    loop = paper.example(number, modified)
    F = design_filter(loop.process, loop.model, order=loop.filter.order, **specification)
    faster = LowPassFilter(F.time_constant * (1 - 1e-5), F.order)
    assert meets(plant_loop(loop.process, loop.model, F), **specification)
    assert not meets(plant_loop(loop.process, loop.model, faster), **specification)


def meets(found, max_ms=float("inf"), min_gm_db=0.0, min_pm_deg=0.0, by=1e-7):
    return bool(
        found.stable
        and found.ms <= max_ms + by
        and abs(found.gm_db) >= min_gm_db - by
        and found.pm >= min_pm_deg - by
    )


def test_of_several_orders_the_one_that_rejects_most_is_chosen():
    loop = paper.example(4, modified=True)
    wanted = {"min_gm_db": 6.0, "min_pm_deg": 45.0}
    chosen = design_filter(loop.process, loop.model, **wanted)
    each = [design_filter(loop.process, loop.model, order=n, **wanted) for n in (2, 3, 4)]
    assert chosen == min(each, key=lambda F: F.order * F.time_constant)
    # nλ/R(0) is the slope of S_d at s = 0; the filter of widest bandwidth has a steeper one.
    slopes = [abs(nrdob.NRDOB(loop.process, loop.model, 0.0, F).S_d(1e-6j)) for F in each]
    assert each[int(np.argmin(slopes))] == chosen
    assert chosen.bandwidth < max(F.bandwidth for F in each)


def test_of_a_zero_in_the_right_half_plane_the_first_order_makes_the_most():
    # R = 1 - s/z, Ms = 2: n = 1 has λ = 2/z exactly, n = 2 needs nλ = 2.29/z.
    F = design_filter((1 - s) * lag, lag, max_ms=2.0)
    assert (F.order, F.time_constant) == (1, pytest.approx(2.0, rel=1e-8))
    second = design_filter((1 - s) * lag, lag, order=2, max_ms=2.0)
    assert 2 * second.time_constant == pytest.approx(2.29, abs=5e-3)


# Every window is found.


def test_a_window_of_a_twelfth_between_two_limits_is_found():
    process = nrdob.delay(14.7215208) * ct.tf([0.27462913], [80.0843766, 1, 0])
    model = ct.tf([0.50988488], [75.0729764, 1.1632964, 0.00217516937])
    wanted = {"max_ms": 1.3, "min_pm_deg": 60.0}
    F = design_filter(process, model, order=2, **wanted)
    assert meets(plant_loop(process, model, F), **wanted)
    (window,) = admissible_time_constants(process, model, 2, **wanted)
    assert window == (pytest.approx(23.8, abs=0.05), pytest.approx(25.85, abs=0.05))
    assert F.time_constant == pytest.approx(window[0], rel=1e-8)


@pytest.mark.slow
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


def test_a_window_between_two_limits_that_no_sample_shows():
    # From below it is bounded by Ms, from above by a phase crossover that appears at once.
    process = ct.tf([0.1553, 0.7645], [0.002378, 0.02574, 0.1412, 0.6161, 1])
    model = ct.tf([0.2031, 1], [0.01132, 0.05687, 0.4166, 1])
    wanted = {"max_ms": 1.926, "min_gm_db": 11.6}
    first, second = admissible_time_constants(process, model, 2, **wanted)
    assert first == (pytest.approx(0.13, abs=1e-3), pytest.approx(0.1414, abs=1e-3))
    assert second == (pytest.approx(0.209, abs=1e-3), inf)
    assert design_filter(process, model, order=2, **wanted).time_constant == first[0]
    for end, beyond in ((first[0], 1 - 1e-6), (first[1], 1 + 1e-6), (second[0], 1 - 1e-6)):
        assert meets(plant_loop(process, model, LowPassFilter(end, 2)), **wanted)
        assert not meets(plant_loop(process, model, LowPassFilter(end * beyond, 2)), **wanted)


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


@pytest.mark.parametrize("lateness", [0.01, 1.0, 100.0])
def test_dead_time_alone_has_closed_forms(lateness):
    # n = 1, R = exp(-θs): L = exp(-jωθ)/(jλω) is -2θ/(πλ) at ω = π/(2θ), of size 1 at 1/λ.
    process = nrdob.delay(lateness) * lag
    (by_gain,) = admissible_time_constants(process, lag, 1, min_gm_db=20 * np.log10(3.0))
    (by_phase,) = admissible_time_constants(process, lag, 1, min_pm_deg=30.0)
    assert by_gain == (pytest.approx(6 / np.pi * lateness, rel=1e-8), inf)
    assert by_phase == (pytest.approx(3 / np.pi * lateness, rel=1e-8), inf)


@pytest.mark.parametrize(
    ("specification", "ends"),
    [({"max_ms": 1.5}, 3.0), ({"min_gm_db": 20 * np.log10(2.0)}, 2.0)],
)
def test_a_loop_that_does_not_vanish_at_infinite_frequency_has_closed_forms(specification, ends):
    # n = 1, R = 1 - s: L = (1 - s)/(λs) tends to -1/λ.
    (window,) = admissible_time_constants((1 - s) * lag, lag, 1, **specification)
    assert window == (pytest.approx(ends, rel=1e-8), inf)


@pytest.mark.slow
def test_slow_filters_lose_their_phase_margin_beside_an_undamped_mode():
    # Close to the mode L is a straight line through 0, whose angle tends to a limit with λ.
    process, model = 1 / ((s**2 + 1) * (s + 1)), 1 / ((s**2 + 0.2 * s + 1.1) * (s + 1))
    for wanted in (20.0, 40.0, 60.0):
        windows = admissible_time_constants(process, model, 3, min_pm_deg=wanted)
        for value in np.geomspace(0.2, 100, 25).tolist():
            inside = any(low <= value <= high for low, high in windows)
            found = plant_loop(process, model, LowPassFilter(value, 3))
            assert inside is meets(found, min_pm_deg=wanted)


@pytest.mark.parametrize("order", [1, 2, 5, 12, 13, 20])
def test_the_inverses_of_the_curve_of_each_order(order):
    curve = Curve.of(order)
    x = np.geomspace(1e-3, 1e3, 400)
    value = (1 + 1j * x) ** order - 1
    if order > 1:
        angle = np.unwrap(np.angle(value))
        assert np.exp(curve.at_angle(angle)) == pytest.approx(x, rel=1e-6)
    stretches = list(curve.rising())
    assert (len(stretches) == 1) is (order <= 12)  # the size of the curve is monotone up to 12
    sizes = np.log(np.abs(value))
    for size, u in zip(sizes, np.log(x), strict=True):
        inverses = [inverse(size) for first, last, inverse in stretches if first < size < last]
        assert np.abs(np.array(inverses) - u).min() < 1e-6


@pytest.mark.parametrize("max_ms", [1.001, 1.6, 5.0])
@pytest.mark.parametrize("order", [1, 2, 5, 12, 20])
def test_what_the_sensitivity_forbids_at_a_frequency_is_one_range(order, max_ms):
    rng = np.random.default_rng(order)
    (limit,) = limits(order, Specification(max_ms=max_ms))
    size, angle = rng.uniform(-10, 10, 60), rng.uniform(0, order * np.pi / 2 + 1.5, 60)
    found = limit.forbids(size, angle)
    low, high = found.edges()
    x = np.geomspace(1e-16, 1e16, 16001)
    log_D = order * np.log1p(1j * x) + np.log(-np.expm1(-order * np.log1p(1j * x)))
    for k in range(60):
        turned = angle[k] - log_D.imag
        ratio = -np.exp(size[k] - log_D.real + 1j * turned)
        there = np.flatnonzero((np.abs(turned) < np.pi / 2) & (np.abs(1 + ratio) < 1 / max_ms))
        if there.size:
            assert np.all(np.diff(there) == 1)
            assert np.exp(low[k]) == pytest.approx(x[there[0]], rel=0.01)
            assert np.exp(high[k]) == pytest.approx(x[there[-1]], rel=0.01)
        assert there.size or found.depth[k] < 1e-3 * max_ms


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
    (window,) = admissible_time_constants(process, model, 1, min_gm_db=20.0)
    assert window == (pytest.approx(10 * gain, rel=1e-8), inf)
    assert design_filter(process, model, order=1, max_ms=1.6).time_constant == pytest.approx(
        8 / 3 * gain, rel=1e-8
    )


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


@pytest.mark.slow
@settings(max_examples=60)
@given(fractions(), fractions(), st.floats(1.2, 3.0))
def test_random_designs_keep_their_promise(process, model, max_ms):
    try:
        F = design_filter(process, model, max_ms=max_ms)
    except ValueError:
        return  # what refusals say is tested below, one by one
    found = plant_loop(process, model, F)
    assume(found.stable is not None)
    assert found.stable and found.ms <= max_ms * (1 + 1e-6)


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
        ({}, "nothing is specified"),
        ({"max_ms": 1.0}, "max_ms is 1.0"),
        ({"max_ms": float("nan")}, "max_ms is nan"),
        ({"min_gm_db": -6.0}, "min_gm_db is -6.0"),
        ({"min_pm_deg": 180.0}, "min_pm_deg is 180.0"),
        ({"max_ms": "2"}, "max_ms is '2'"),
        ({"max_ms": True}, "max_ms is True"),
        ({"min_gm_db": 6 + 1j}, r"min_gm_db is \(6\+1j\)"),
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


def test_contradictory_specifications_say_what_comes_closest():
    loop = paper.example(3, modified=True)
    with pytest.raises(ValueError, match=r"meets Ms ≤ 1.6, PM ≥ 60°; closest comes"):
        design_filter(loop.process, loop.model, max_ms=1.6, min_pm_deg=60.0)


def test_an_order_too_low_for_causality_is_refused():
    with pytest.raises(ValueError, match="not causal"):
        design_filter(lag**2, lag**2, order=1, max_ms=2)


@pytest.mark.slow
def test_a_sample_of_the_campaign_finds_no_fault():
    found = campaign(4, seed=2)
    assert not [name for name in found if name.startswith("WRONG")]


@pytest.mark.parametrize("gain", [1e-12, 1e12])
def test_the_unit_of_the_output_changes_nothing(gain):
    loop = paper.example(4)
    F = design_filter(loop.process, loop.model, order=3, max_ms=1.8)
    scaled = design_filter(gain * loop.process, gain * loop.model, order=3, max_ms=1.8)
    assert scaled.time_constant == pytest.approx(F.time_constant, rel=1e-9)


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


@pytest.mark.slow
def test_a_window_ends_where_a_new_crossover_appears():
    # The loop gain just reaches 1 at a second frequency: the phase margin jumps from 69° to 46°.
    process = ct.tf([0.5054], [20.4, 118.8, 178.6, 56.74, 5.157, 1])
    model = ct.tf([1], [36.81, 97.09, 39.18, 4.104, 1])
    first, *_ = nrdob.admissible_time_constants(process, model, 5, min_pm_deg=64.1)
    for factor, meets in ((1 - 1e-5, True), (1 + 1e-5, False)):
        F = LowPassFilter(factor * first[1], 5)
        pm = nrdob.NRDOB(process, model, 0, F).margins().plant_loop.pm
        assert (pm >= 64.1) is meets
