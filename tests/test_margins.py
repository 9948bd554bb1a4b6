import math

import control as ct
import numpy as np
import pytest
from hypothesis import assume, given, settings
from strategies import loops

import nrdob
from nrdob import LowPassFilter, paper
from nrdob.margins import margins
from nrdob.quasipoly import QuasiPolynomial, add, count_rhp

s = ct.tf("s")


def rhp_with_gain(loop, k):
    """RHP roots of 1 + k L = 0, counted anew."""
    num, den = loop.numerator, loop.denominator
    closed = QuasiPolynomial(add(k * num.q, den.q), add(k * num.r, den.r), loop.delay)
    return count_rhp(closed).count


@pytest.mark.parametrize("claim", paper.PRINTED)
def test_printed_margins_reproduce(claim):
    example, name, quantity = claim.split(".")
    every = paper.example(int(example[2])).margins()
    found = {"CGm": every.model_loop, "FH": every.observer_loop}[name]
    computed = found.pm if quantity == "pm" else found.gm_db
    assert paper.PRINTED[claim].agrees_with(computed)


def test_a_printed_value_is_not_met_by_its_neighbour():
    assert not paper.PRINTED["ex1.CGm.pm"].agrees_with(50.7)
    assert not paper.PRINTED["ex1.CGm.gm"].agrees_with(200.0)


@given(loops())
def test_margins_agree_with_python_control_on_stable_loops_with_crossings(loop):
    every = loop.margins()
    for found, quotient in ((every.observer_loop, loop.FH), (every.plant_loop, loop.L)):
        if not found.stable:
            continue
        theirs = ct.stability_margins(ct.tf(quotient.numerator.q, quotient.denominator.q))
        # Where control finds a crossing, ours is the same or a nearer one (at ω = 0 or ∞).
        _, pm, sm, _, _, wms = theirs
        if np.isfinite(pm):
            assert found.pm <= abs(pm) * (1 + 1e-5) + 1e-9
        if np.isfinite(sm) and wms > 0:
            assert found.sm <= sm * (1 + 1e-5)


@given(loops())
def test_modulus_margin_is_the_smallest_distance_on_a_dense_grid(loop):
    found = loop.margins().plant_loop
    assume(found.stable and 1e-4 < found.wms < 1e4)
    omega = np.geomspace(1e-5, 1e5, 100_001)
    distance = np.abs(1 + loop.L(1j * omega))
    assert found.sm <= distance.min() * (1 + 1e-9)
    assert found.sm >= distance.min() * 0.98
    assert found.ms == pytest.approx(1 / found.sm)


@given(loops())
@settings(max_examples=80)
def test_the_loop_keeps_its_roots_inside_the_gain_interval_and_loses_them_outside(loop):
    check_gain_interval(loop.L, loop.margins().plant_loop)


@given(loops(delayed=True))
@settings(max_examples=50)
def test_the_delayed_loop_keeps_its_roots_inside_the_gain_interval(loop):
    check_gain_interval(loop.L, loop.margins().plant_loop)


def check_gain_interval(quotient, found):
    assume(found.stable)
    low, high = max(found.gm_low, 1e-3), min(found.gm_high, 50.0)
    inside = np.geomspace(low * (1 + 1e-3), high * (1 - 1e-3), 5)
    counts = [rhp_with_gain(quotient, k) for k in inside]
    assert {c for c in counts if c is not None} <= {0}
    for edge, factor in ((found.gm_low, 1 - 1e-4), (found.gm_high, 1 + 1e-4)):
        if 1e-3 < edge < 50:
            assert rhp_with_gain(quotient, edge * factor) != 0


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_the_delay_margin_is_where_more_dead_time_loses_the_loop(number):
    loop = paper.example(number)
    extra = loop.margins().plant_loop.delay_margin
    for factor, stable in ((0.999, True), (1.001, False)):
        process = nrdob.delay(factor * extra) * loop.process
        delayed = nrdob.NRDOB(process, loop.model, loop.controller, loop.filter)
        assert delayed.stability().stable is stable


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_the_phase_margin_is_where_a_rotated_loop_meets_minus_one(number):
    loop = paper.example(number)
    found = loop.margins().plant_loop
    value = loop.L(1j * found.wgc)
    rotated = [value * np.exp(1j * sign * np.radians(found.pm)) for sign in (1, -1)]
    assert min(abs(1 + np.array(rotated))) < 1e-9


def test_example_4_is_lost_at_a_plant_gain_of_3_712_not_at_the_5_02_of_its_fh():
    loop = paper.example(4)
    every = loop.margins()
    assert every.observer_loop.gm == pytest.approx(5.02, abs=5e-3)
    assert every.plant_loop.gm == pytest.approx(3.712, abs=5e-4)
    for gain, stable in ((3.711, True), (3.713, False)):
        louder = nrdob.NRDOB(gain * loop.process, loop.model, loop.controller, loop.filter)
        assert louder.stability().stable is stable


def test_gain_margin_at_zero_frequency_is_seen():
    fh = paper.example(3).margins().observer_loop
    assert (fh.gm, fh.wpc) == (pytest.approx(0.2), 0.0)
    assert (fh.gm_low, fh.gm_high) == (pytest.approx(0.2), math.inf)


def test_modulus_margin_at_zero_and_at_infinite_frequency_is_seen():
    at_zero = nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), -0.9, LowPassFilter(0.1, 1)).margins()
    assert (at_zero.model_loop.sm, at_zero.model_loop.wms) == (pytest.approx(0.1), 0.0)
    model = (s + 1) / (s + 3)
    at_infinity = nrdob.NRDOB(model, model, -0.9, LowPassFilter(0.1, 1)).margins().model_loop
    assert (at_infinity.sm, at_infinity.wms) == (pytest.approx(0.1), math.inf)
    assert at_infinity.gm_high == pytest.approx(1 / 0.9)
    assert at_infinity.wpc == math.inf


def test_an_unstable_loop_has_no_margins_though_its_phase_looks_positive():
    # Five lags turn the phase past -360 degrees, where control reads it as a positive margin.
    model = 1 / (s + 1) ** 5
    loop = nrdob.NRDOB(model, model, 6330, LowPassFilter(0.1, 5))
    assert ct.stability_margins(6330 * model)[1] > 100
    found = loop.margins().model_loop
    assert found.stable is False
    assert all(math.isnan(value) for value in found)
    assert "no margins" in str(found)
    assert found.gain_crossovers.size > 0


def test_a_conditionally_stable_loop_has_gain_limits_on_both_sides():
    model = (s + 1) ** 2 / (s**3 * (0.01 * s + 1) ** 2)
    loop = nrdob.NRDOB(model, model, 10, LowPassFilter(0.1, 3))
    found = loop.margins().model_loop
    assert found.stable
    assert 0 < found.gm_low < 1 < found.gm_high < math.inf
    for k in (found.gm_low * 1.001, found.gm_high * 0.999):
        assert rhp_with_gain(loop.CGm, k) == 0
    for k in (found.gm_low * 0.999, found.gm_high * 1.001):
        assert rhp_with_gain(loop.CGm, k) > 0


def test_margins_unpack_in_controls_order():
    found = paper.example(3).margins().observer_loop
    gm, pm, sm, wpc, wgc, wms = found
    theirs = ct.stability_margins(paper.example(3).FH.to_tf())
    assert (gm, pm, sm, wpc, wgc, wms) == pytest.approx(theirs, rel=1e-6, abs=1e-9)


def test_margins_with_delay_agree_with_a_dense_grid():
    loop = paper.example(4, modified=True)
    found = loop.margins().plant_loop
    omega = np.geomspace(1e-3, 100, 2_000_001)
    values = loop.L(1j * omega)
    assert found.sm == pytest.approx(np.abs(1 + values).min(), rel=1e-9)
    crossover = np.flatnonzero(np.diff(np.sign(np.abs(values) - 1)))
    assert found.wgc == pytest.approx(omega[crossover[0]], rel=1e-5)
    crossing = np.flatnonzero((np.diff(np.sign(values.imag)) != 0) & (values.real[1:] < 0))
    assert found.gm == pytest.approx(np.min(-1 / values.real[crossing]), rel=1e-5)


def test_a_neutral_loop_has_its_gain_margin_at_infinite_frequency():
    model = (s + 1) / (s + 2)
    loop = nrdob.NRDOB(nrdob.delay(0.3) * 0.5 * model, model, 1 / s, (0.5 * s + 1) / (s + 1))
    found = loop.margins().plant_loop
    # L tends to 0.5 exp(-jωθ): no gain up to 2 is lost before the chain of roots arrives.
    assert found.gm_high <= 2.0
    assert rhp_with_gain(loop.L, found.gm_high * (1 - 1e-3)) == 0


def test_a_lightly_damped_crossing_is_not_missed():
    model = 1 / (s + 1)
    process = model * (s**2 + 2e-4 * s + 1.02) / (s**2 + 2e-4 * s + 1)
    for plant in (process, nrdob.delay(0.01) * process):
        found = nrdob.NRDOB(plant, model, 0.1, LowPassFilter(10.0, 1)).margins().plant_loop
        assert np.sum(np.abs(found.gain_crossovers - 1) < 0.1) == 2


def test_a_matched_model_has_an_observer_loop_with_nothing_to_lose():
    found = paper.example(1).margins().observer_loop
    assert tuple(found)[:3] == (math.inf, math.inf, 1.0)


def test_margins_of_a_loop_follow_from_its_own_terms():
    loop = paper.example(2)
    by_sum = margins(loop.L, True)
    assert by_sum.sm == pytest.approx(margins(loop.L, True, loop.p_B).sm)
    assert len(repr(loop.margins()).splitlines()) == 4


@pytest.mark.parametrize("stable", [False, None])
def test_without_stability_there_are_no_margins(stable):
    found = margins(paper.example(2).L, stable)
    assert found.stable is stable and all(math.isnan(value) for value in found)
