"""Models proposed for plants that nobody prepared: what is promised of them holds."""

from __future__ import annotations

from math import inf

import control as ct
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import nrdob
from nrdob import NRDOB, LowPassFilter
from nrdob.design import design_controller, suggest_model
from nrdob.diagram import as_family
from strategies import fractions

s = ct.tf("s")
lag = 1 / (s + 1)


def dc_gain(tf):
    return float(np.real(tf(0)))


def test_a_well_behaved_process_is_matched():
    (candidate,) = suggest_model(lag)
    assert candidate.how == "matched" and candidate.time_constants == [(0.0, inf)]


@pytest.mark.slow
def test_an_unstable_process_gets_the_opposite_dc_sign():
    process = 4 / (2 - s - s**2)
    for candidate in suggest_model(process):
        assert dc_gain(candidate.model) * dc_gain(process) < 0
        assert candidate.model.poles().real.max() < 0
        assert candidate.time_constants


@pytest.mark.slow
def test_two_unstable_poles_keep_the_dc_sign():
    process = 5 / ((s - 1) * (s - 2) * (s + 4))
    assert all(dc_gain(c.model) * dc_gain(process) > 0 for c in suggest_model(process))


@pytest.mark.slow
def test_a_zero_in_the_right_half_plane_is_left_out_or_mirrored():
    process = 0.1 * (100 - s) / (s + 2)
    left_out, mirrored = suggest_model(process)
    assert left_out.how.endswith("left out") and mirrored.how.endswith("mirrored")
    assert dc_gain(left_out.model) == dc_gain(mirrored.model) == pytest.approx(5)
    # R = 1 - s/z needs λ > 1/z, R = (z - s)/(z + s) the same; and Ms = λ/(λ - 1/z) = 2 at 2/z.
    assert left_out.time_constants == [(pytest.approx(0.01), inf)]
    assert left_out.fastest == pytest.approx(0.02, rel=1e-6)


@pytest.mark.slow
def test_dead_time_is_left_out_or_replaced_by_a_lag():
    kinds = {candidate.how for candidate in suggest_model(nrdob.delay(0.05) / (s + 2) ** 2)}
    assert kinds == {"dead time left out", "dead time replaced by a lag"}


@pytest.mark.slow
def test_an_integrator_is_moved_to_the_left_or_kept_with_filters_that_let_it_cancel():
    moved, ramp, constant = suggest_model(1 / (s * (s + 1)))
    assert moved.model.poles().real.max() == pytest.approx(-0.1)
    assert (moved.family, constant.family, ramp.family.ramp) == (None, None, 2)
    for kept in (ramp, constant):
        assert kept.how.startswith("integrator kept") and dc_gain_is_infinite(kept.model)
        assert kept.time_constants == [(0.0, inf)] and kept.fastest == 0
    assert [c.filters for c in (moved, constant)] == [2, 2] and ramp.filters is ramp.family


def dc_gain_is_infinite(tf):
    return tf.den[0][0][-1] == 0


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("process", "integrators"),
    [(nrdob.delay(0.1) / s, 1), (1 / s**2, 2), (1 / (s * (s - 1)), 1), ((1 - 0.2 * s) / s**2, 2)],
)
def test_the_sets_of_models_that_integrate_are_those_of_their_filters(process, integrators):
    kept = [c for c in suggest_model(process) if "kept" in c.how]
    assert {as_family(c.filters).ramp for c in kept} == {integrators, integrators + 1}
    for candidate in kept:
        family = as_family(candidate.filters)
        for low, high in candidate.time_constants:
            middle = (
                np.sqrt(low * high) if 0 < high < inf and low else max(2 * low, 0.01 * min(high, 1))
            )
            for value, stable in ((middle, True), (0.99 * low, False), (1.01 * high, False)):
                if 0 < value < inf:
                    found = nrdob.judge_observer(process, candidate.model, family.at(value))
                    assert found.stable is stable
        if candidate.fastest:
            loop = NRDOB(process, candidate.model, 0.0, family.at(candidate.fastest))
            assert loop.margins().plant_loop.ms == pytest.approx(2.0, rel=1e-6)
            assert (loop.S_delta.dc_gain == 0) is (family.ramp > integrators)


@pytest.mark.slow
def test_undamped_zeros_of_the_process_are_not_left_in_the_model():
    candidates = suggest_model((s**2 + 4) / (s + 1) ** 3)
    assert any(candidate.time_constants for candidate in candidates)


@pytest.mark.slow
@pytest.mark.parametrize("process", [1 / ((s + 1) * (s**2 + 4)), (s + 3) / ((s + 2) * (s**2 + 9))])
def test_an_undamped_mode_is_damped_in_the_model(process):
    best = suggest_model(process)[0]
    assert best.how == "poles on the axis moved to the left"
    assert best.model.poles().real.max() < -0.05
    assert best.time_constants[0][0] == 0 and best.ms < 1.4 and best.fastest is not None
    filter = LowPassFilter(0.9 * best.time_constants[0][1], best.order)
    assert NRDOB(process, best.model, 0.0, filter).margins().plant_loop.stable


@pytest.mark.slow
@pytest.mark.parametrize("lags", [3, 6, 10, 14])
def test_a_matched_model_has_the_coefficients_of_the_process(lags):
    process = ct.tf([2.0], np.poly([-1.0] * lags))
    (candidate,) = suggest_model(process)
    assert candidate.how == "matched"
    assert candidate.model.den[0][0].tolist() == process.den[0][0].tolist()


@pytest.mark.slow
def test_what_need_not_change_is_not_changed():
    lags = np.poly([-1.0] * 6)
    candidate, *_ = suggest_model(ct.tf([2.0], np.polymul(lags, [1, -0.5])))
    assert candidate.model.den[0][0] == pytest.approx(np.polymul(lags, [1, 0.5]), rel=1e-9)


@pytest.mark.slow
def test_candidates_are_ranked_by_what_is_left_of_a_slow_disturbance():
    # S_δ tends to nλ·G̃(0)·s: a small model gain rejects as a small λ does.
    process = 1 / ((0.3 * s - 1) * (0.05 * s + 1))
    met = [c for c in suggest_model(process, max_ms=4.0) if c.fastest]
    left = [c.order * c.fastest * abs(dc_gain(c.model)) for c in met]
    assert left == sorted(left)


def test_a_process_with_a_zero_at_the_origin_has_no_model():
    with pytest.raises(ValueError, match="zero at s = 0"):
        suggest_model(s * lag**2)


def test_with_a_zero_at_the_origin_only_a_model_that_integrates_is_stable_and_rejects_nothing():
    with pytest.raises(ValueError, match="unless the model integrates"):
        suggest_model(s * lag**2)
    idle = NRDOB(s * lag**2, 1 / s, 1, LowPassFilter(0.5, 1))
    assert idle.stability().stable and idle.S_d.dc_gain == 1


@pytest.mark.slow
def test_candidates_are_written_with_what_they_allow():
    text = repr(suggest_model(0.1 * (100 - s) / (s + 2))[0])
    assert "left out" in text and "0.01 < λ < inf" in text and "met from λ = 0.02 s" in text


@pytest.mark.thorough
@settings(max_examples=8)
@given(fractions(), st.floats(-2, 0))
def test_what_is_promised_holds(process, dead_time):
    # Without a dead time nearly every model has a filter as fast as one likes, or none.
    late = nrdob.delay(10**dead_time) * process
    candidates = suggest_model(late)
    ranks = [candidate.fastest is None for candidate in candidates]
    assert ranks == sorted(ranks)
    assume(not ranks[0])
    for candidate in candidates:
        if candidate.fastest:
            filter = LowPassFilter(candidate.fastest, candidate.order)
            found = NRDOB(late, candidate.model, 0.0, filter).margins().plant_loop
            assert found.stable and found.ms == pytest.approx(2.0, rel=1e-4)


# Controllers for the model loop.


@pytest.mark.slow
@pytest.mark.parametrize("phase_margin", [30.0, 45.0, 60.0, 75.0])
@pytest.mark.parametrize("bandwidth", [0.5, 1.0, 2.0])
@pytest.mark.parametrize(
    "model", [1 / (s**2 + 4 * s + 3.75), -1 / (s**2 + 3 * s + 2), 10 / (s + 2), (2 * s + 10) * lag]
)
def test_bandwidth_and_phase_margin_are_met(model, bandwidth, phase_margin):
    found = model_loop(
        model, design_controller(model, bandwidth=bandwidth, phase_margin=phase_margin)
    )
    assert found.wgc == pytest.approx(bandwidth, rel=1e-9)
    assert found.pm >= phase_margin * (1 - 1e-9)


def model_loop(model, controller):
    order = max(1, model.den[0][0].size - model.num[0][0].size)
    return NRDOB(model, model, controller, LowPassFilter(1.0, order)).margins().model_loop


@pytest.mark.thorough
@pytest.mark.parametrize("model", [lag**2, lag**3, -(lag**2), (1 - s) * lag**2])
def test_without_a_bandwidth_the_integral_gain_is_the_largest(model):
    controller = design_controller(model, phase_margin=50)
    assert model_loop(model, controller).pm == pytest.approx(50, rel=1e-6)
    integral = abs(controller.num[0][0][-1] / controller.den[0][0][-2])
    for bandwidth in np.geomspace(0.1, 3, 15):
        try:
            other = design_controller(model, bandwidth=bandwidth, phase_margin=50)
        except ValueError:
            continue
        if other.den[0][0].size == 2 and model_loop(model, other).pm < 50.1:
            assert abs(other.num[0][0][-1] / other.den[0][0][-2]) < integral * 1.02


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("den", "gain", "phase_margin"),
    [
        ([1, 2.16083, 34.1958, 73.4772], 0.43538, 60.0),  # a resonance limits an integrator
        ([1, 0.3, 1.0], 1.0, 45.0),
        ([1, 3, 3, 1], -2.0, 30.0),
        ([1, 1.06, 1.0608, 1.0408, 0.04], 0.1, 60.0),
    ],
)
def test_no_gain_and_integral_time_of_a_scan_have_more_integral_action(den, gain, phase_margin):
    model = ct.tf([gain], den)
    controller = design_controller(model, phase_margin=phase_margin)
    best = abs(controller.num[0][0][-1] / controller.den[0][0][-2])
    assert model_loop(model, controller).pm >= phase_margin * (1 - 1e-6)
    poles = np.roots(den)
    near = np.concatenate([abs(p.imag) + abs(p) * np.geomspace(1e-4, 1, 80) * k
                           for p in poles for k in (-1, 1)])  # fmt: skip
    omega = np.union1d(np.geomspace(1e-4, 1e4, 800), near[near > 0])
    G = np.sign(gain) * model(1j * omega)
    for time in [0.0, *np.geomspace(1e-2, 1e2, 50)]:
        for integral in best * np.array([1.02, 1.1, 1.3, 2.0, 4.0]):
            L = (integral * time + integral / (1j * omega)) * G
            size = np.log(np.abs(L))
            at = np.flatnonzero((size[1:] >= 0) != (size[:-1] >= 0))
            if np.degrees(np.abs(np.angle(-L[at]))).min(initial=180) < phase_margin + 0.5:
                continue
            closed = np.polyadd([*den, 0], abs(gain) * np.array([integral * time, integral]))
            assert np.roots(closed).real.max() > 0


def test_a_first_order_model_does_not_limit_the_bandwidth():
    with pytest.raises(ValueError, match="does not limit the bandwidth"):
        design_controller(lag)


def test_a_model_that_lags_too_far_is_refused_with_the_angle():
    with pytest.raises(ValueError, match=r"had to be .*° ahead, a PID reaches 43.6°"):
        design_controller(lag**3, bandwidth=1.7)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"phase_margin": 0}, "phase_margin is 0"),
        ({"phase_margin": 90}, "phase_margin is 90"),
        ({"bandwidth": 0.0}, "bandwidth is 0.0"),
        ({"bandwidth": inf}, "bandwidth is inf"),
        ({"bandwidth": True}, "bandwidth is True"),
        ({"phase_margin": "60"}, "phase_margin is '60'"),
        ({"phase_margin": 60j}, "phase_margin is 60j"),
    ],
)
def test_impossible_wishes_are_refused(options, message):
    with pytest.raises((ValueError, TypeError), match=message):
        design_controller(lag, **options)


@pytest.mark.thorough
@pytest.mark.parametrize("zeta", [0.01, 0.03])
@pytest.mark.parametrize("max_ms", [1.2, 2.0])
def test_an_integrator_before_a_resonance_is_limited_by_its_sensitivity_peak(zeta, max_ms):
    """At the resonance k G(jω)/(jω) is about -k/(2ζ), so the peak is 1/(1 - k/(2ζ))."""
    resonance = ct.tf([1], [1, 2 * zeta, 1])
    controller = design_controller(resonance, max_ms=max_ms)
    (k,), (_, zero) = controller.num[0][0], controller.den[0][0]
    assert zero == 0
    assert k == pytest.approx(2 * zeta * (1 - 1 / max_ms), rel=zeta)
    omega = 1 + zeta * np.arange(-9, 9, 0.01)
    L = controller(1j * omega) * resonance(1j * omega)
    assert 0.999 * max_ms < np.abs(1 / (1 + L)).max() <= max_ms * (1 + 1e-6)


@pytest.mark.slow
def test_a_controller_that_keeps_the_peak_is_left_as_it_is():
    model = ct.tf([1], [1, 2, 1])
    free, limited = (design_controller(model, max_ms=max_ms) for max_ms in (None, 2.0))
    assert np.array_equal(free.num[0][0], limited.num[0][0])


def test_with_a_bandwidth_a_peak_above_the_limit_is_refused():
    with pytest.raises(ValueError, match=r"sensitivity peaks at .* choose another bandwidth"):
        design_controller(ct.tf([1], [1, 0.02, 1]), bandwidth=0.0199, max_ms=2.0)
    with pytest.raises(ValueError, match=r"max_ms is 1\.0"):
        design_controller(ct.tf([1], [1, 1]), max_ms=1.0)


@pytest.mark.parametrize("wait", [0.01, 0.5, 3.0])
def test_a_controller_for_a_model_that_waits_keeps_its_margin_in_the_loop_that_waits(wait):
    # E/R = 1/(1 + C G̃0): the dead time is outside of the loop of condition i.
    prompt = ct.tf([1.0], [1, 4, 3.75])
    model = nrdob.delay(wait) * prompt
    controller = design_controller(model, bandwidth=1.0, phase_margin=68)
    loop = nrdob.NRDOB(model, model, controller, nrdob.LowPassFilter(0.3, 2))
    assert loop.stability().stable
    margins = loop.margins().model_loop
    assert margins.pm == pytest.approx(68, abs=1e-6) and margins.wgc == pytest.approx(1.0)
    alone = design_controller(prompt, bandwidth=1.0, phase_margin=68)
    np.testing.assert_array_equal(controller.num[0][0], alone.num[0][0])


@pytest.mark.slow
def test_a_model_is_written_without_the_terms_that_it_does_not_have():
    written = [repr(found) for found in nrdob.suggest_model(ct.tf([1], [1, 1, 0]))]
    assert any(text.startswith("(1)/(1 s^2 + 1 s): integrator kept") for text in written)
