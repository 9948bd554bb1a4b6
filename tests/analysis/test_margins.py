import math

import control as ct
import numpy as np
import pytest
import scipy.signal
from hypothesis import assume, given, settings

import nrdob
from campaigns.margins import FAMILIES, FIGURES, blocks_of, differs, missed, random_hard_loop, run
from nrdob import LowPassFilter, paper
from nrdob.analysis import margin_bounds, quotient_margins
from nrdob.diagram import Quotient
from nrdob.numerics import QuasiPolynomial, add, count_rhp
from strategies import loops
from tests.oracles.sweep import loop_gains

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


@pytest.mark.thorough
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


def margins_if_stable(loop):
    """Margins of L alone; an unstable loop, which has none, is put aside by its verdict."""
    verdict = loop.stability().observer_loop
    assume(verdict.stable)
    return quotient_margins(loop.L, verdict.stable)


@pytest.mark.parametrize("zeta", [0.3, 0.7, 1.0])
@pytest.mark.parametrize("k", [0.5, 0.9, -0.5])
def test_a_nearest_point_exactly_on_a_frequency_that_is_looked_at_is_found(k, zeta):
    found = nrdob.margins(ct.tf([-2 * k * zeta, 0], [1, 2 * zeta, 1]))  # L(j) = -k
    assert found.sm == pytest.approx(min(1 - k, 1), rel=1e-9)
    assert found.disk_margin == pytest.approx(min(2 * (1 - k) / (1 + k), 2), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("lam", "extra"), [(0.5, 1), (1, 0.5), (1, 2), (2, 1), (0.25, 2)])
@pytest.mark.parametrize("lag", [1.0, 1e-3, 60.0])
def test_a_lag_that_the_model_lacks_has_its_peak_whatever_the_numbers(lag, lam, extra):
    s = ct.tf("s")
    G, Gm = 1 / ((lag * s + 1) * (extra * lag * s + 1)), 1 / (lag * s + 1)
    loop = nrdob.NRDOB(G, Gm, 1.0, LowPassFilter(lam * lag, 1))
    for part, L in ((loop.margins().observer_loop, loop.FH), (loop.margins().plant_loop, loop.L)):
        seen = L(1j * np.geomspace(1e-3, 1e3, 200_001) / lag)
        assert part.sm == pytest.approx(min(np.abs(1 + seen).min(), 1), rel=1e-6)
        disk = 2 * np.abs((1 + seen) / (1 - seen))
        assert part.disk_margin == pytest.approx(min(disk.min(), 2), rel=1e-6)


@pytest.mark.thorough
@given(loops())
@settings(max_examples=30)
def test_modulus_margin_is_the_smallest_distance_on_a_dense_grid(loop):
    found = margins_if_stable(loop)
    assume(1e-4 < found.wms < 1e4)
    near = found.wms * (1 + np.linspace(-1e-3, 1e-3, 2001))  # it may lie between two of the grid
    omega = np.union1d(np.geomspace(1e-5, 1e5, 20_001), near)
    distance = np.abs(1 + loop.L(1j * omega))
    assert found.sm <= distance.min() * (1 + 1e-9)
    assert found.sm >= distance.min() * 0.98
    assert found.ms == pytest.approx(1 / found.sm)


@pytest.mark.thorough
@given(loops())
@settings(max_examples=40)  # hundreds in tests/campaigns/margins.py
def test_the_loop_keeps_its_roots_inside_the_gain_interval_and_loses_them_outside(loop):
    check_gain_interval(loop.L, margins_if_stable(loop))


@pytest.mark.thorough
@given(loops(delayed=True))
@settings(max_examples=25)
def test_the_delayed_loop_keeps_its_roots_inside_the_gain_interval(loop):
    check_gain_interval(loop.L, margins_if_stable(loop))


def check_gain_interval(quotient, found):
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
    assert all(math.isnan(getattr(found, name)) for name in FIGURES)
    # Routh: stable up to 1/cos(36°)^5 = 2.885; the rotation is from there to the unit circle.
    assert found.critical_gains.min() * 6330 == pytest.approx(math.cos(math.pi / 5) ** -5)
    assert "roots on the axis at gain × " in str(found)


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


@pytest.mark.thorough
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


def test_the_three_loops_print_below_one_head():
    assert len(repr(paper.example(2).margins()).splitlines()) == 4


@pytest.mark.parametrize("stable", [False, None])
def test_without_stability_there_are_no_margins(stable):
    found = quotient_margins(paper.example(2).L, stable)
    assert found.stable is stable and all(math.isnan(value) for value in found)


# Where products of the factors lose what lies close together.


def test_a_detuned_mode_of_damping_1e_6_leaves_13_percent_of_the_distance():
    d = 1.000003
    plant = ([1 / d**2, 2e-6, 1], np.polymul([1, 1], [1, 2e-6, 1]))
    loop = nrdob.NRDOB(plant, 1 / (s + 1), 1.0, LowPassFilter(0.1, 2))
    found = loop.margins().observer_loop
    assert found.sm == pytest.approx(0.1327, abs=5e-5)
    assert found.pm == pytest.approx(8.25, abs=5e-3)
    assert not differs(found, loop.FH)


@pytest.mark.slow
def test_margins_at_60_detuned_hardly_damped_modes_are_the_certified_ones():
    rng, compared = np.random.default_rng(5), 0
    while compared < 60:
        loop = random_hard_loop(rng, "detuned")
        found = loop.margins()
        for each, quotient in ((found.observer_loop, loop.FH), (found.plant_loop, loop.L)):
            if each.stable:
                compared += 1
                assert not differs(each, quotient)


@pytest.mark.thorough
def test_random_loops_have_the_margins_of_a_sweep_in_long_doubles():
    tally = run(2 * len(FAMILIES), seed=4)
    assert tally["wrong"] == 0
    assert sum(tally[f"{family}: compared"] for family in FAMILIES) > 30


@pytest.mark.thorough
def test_hard_loops_with_and_without_dead_time_agree_with_their_oracles():
    tally = run(8 * len(FAMILIES), seed=3)
    assert tally["wrong"] == 0
    assert all(tally[f"{family}: compared"] for family in FAMILIES)


def lags_in(unit, order, gain=1.0):
    """An order of lags as a user has it who counts time in other units, and output, too."""
    plant, model = (gain / (lag * unit * s + 1) ** order for lag in (1.0, 1.05))
    return nrdob.NRDOB(plant, model, 0.06 / gain / unit / s, LowPassFilter(0.5 * unit, order))


@pytest.mark.slow
@pytest.mark.parametrize("order", [7, 8, 10, 12])
@pytest.mark.parametrize("unit", [1e-6, 60.0, 1e6])
def test_many_lags_in_slow_and_fast_units_have_the_peak_of_the_same_lags_in_seconds(order, unit):
    one, other = lags_in(1.0, order).margins(), lags_in(unit, order).margins()
    for name in ("model_loop", "observer_loop", "plant_loop"):
        a, b = getattr(one, name), getattr(other, name)
        assert a.stable and b.stable
        assert (b.gm, b.pm, b.ms) == pytest.approx((a.gm, a.pm, a.ms), rel=1e-8)
        assert b.delay_margin / unit == pytest.approx(a.delay_margin, rel=1e-8)


def test_the_peak_of_eight_lags_of_a_minute_is_that_of_a_sweep():
    loop = nrdob.NRDOB(
        1 / (60 * s + 1) ** 8, 1 / (63 * s + 1) ** 8, 0.001 / s, LowPassFilter(30.0, 8)
    )
    values = loop.L(1j * np.geomspace(1e-4, 1, 60_001))
    found = loop.margins().plant_loop
    assert found.ms == pytest.approx(1 / np.abs(1 + values).min(), rel=1e-6)
    assert found.ms == pytest.approx(1.6549, abs=5e-5)


@pytest.mark.slow
@pytest.mark.parametrize("gain", [1e-9, 1e9])
def test_eight_lags_have_the_same_margins_in_any_unit_of_their_output(gain):
    for name in ("model_loop", "observer_loop", "plant_loop"):
        a, b = (getattr(lags_in(1.0, 8, k).margins(), name) for k in (1.0, gain))
        assert tuple(b) == pytest.approx(tuple(a), rel=1e-8, nan_ok=True)


@pytest.mark.parametrize("seed", range(4))
def test_margins_beside_hardly_damped_modes_are_right_to_nine_digits(seed):
    rng = np.random.default_rng(seed)
    loop = random_hard_loop(rng, "detuned")
    every = loop.margins()
    for name, (gain, omega) in loop_gains(blocks_of(loop)).items():
        if (found := getattr(every, name)).stable:
            assert not missed(found, gain, omega, rtol=2e-9)


@pytest.mark.slow
def test_a_resonance_far_beyond_a_long_dead_time_bounds_the_gain():
    # |L| falls below 1 at once, and rises to 0.0995 at 100 rad/s, 32 turns of the dead time away.
    L = nrdob.delay(2.0) * 0.1 * (1 / (10 * s + 1) + 1e-4 * s / (1e-4 * s**2 + 2e-3 * s * 0.05 + 1))
    found = nrdob.margins(L)
    omega = np.linspace(90, 110, 400_001)
    values = L(1j * omega)
    change = np.flatnonzero((values.imag[1:] * values.imag[:-1] < 0) & (values.real[1:] < 0))
    assert found.gm_high == pytest.approx(np.min(-1 / values.real[change]), rel=1e-4)


@pytest.mark.parametrize("unit", [1e-30, 1e-9, 1e9, 1e30])
@pytest.mark.parametrize("delay", [0.0, 0.3])
def test_another_unit_of_time_scales_the_frequencies_and_nothing_else(unit, delay):
    def scaled(unit):
        process = nrdob.delay(delay * unit) * ct.tf([1.2], [0.1 * unit**2, 0.7 * unit, 1])
        model = ct.tf([1], [unit, 1])
        controller = ct.tf([unit, 1], [unit, 0])
        plant = process if delay else process.tf
        return nrdob.NRDOB(plant, model, controller, LowPassFilter(0.5 * unit, 2)).margins()

    one, other = scaled(1.0), scaled(unit)
    for name in ("model_loop", "observer_loop", "plant_loop"):
        a, b = getattr(one, name), getattr(other, name)
        assert a.stable
        assert (b.gm, b.pm, b.sm) == pytest.approx((a.gm, a.pm, a.sm), rel=1e-6)
        assert b.wms * unit == pytest.approx(a.wms, rel=1e-4)
        assert b.delay_margin / unit == pytest.approx(a.delay_margin, rel=1e-6)


@pytest.mark.parametrize("gain", [1e-30, 1e-12, 1e12, 1e30])
def test_another_unit_of_the_plants_output_changes_no_margin(gain):
    def scaled(gain):
        plant = gain * 1.2 / ((s + 1) * (0.1 * s + 1))
        return nrdob.NRDOB(plant, gain / (s + 1), 0.5 / gain / s, LowPassFilter(0.5, 2)).margins()

    for name in ("model_loop", "observer_loop", "plant_loop"):
        a, b = getattr(scaled(1.0), name), getattr(scaled(gain), name)
        assert tuple(b) == pytest.approx(tuple(a), rel=1e-6, nan_ok=True)


def test_margins_are_found_for_five_lags_in_nanoseconds():
    def margins_in(second):
        lags = np.poly(-np.arange(1.0, 6.0) / second)
        plant = ([lags[-1]], lags)
        return nrdob.NRDOB(plant, plant, 0.5, LowPassFilter(10 * second, 5)).margins()

    for name in ("model_loop", "plant_loop"):
        a, b = getattr(margins_in(1.0), name), getattr(margins_in(1e-9), name)
        assert (b.gm, b.pm, b.sm) == pytest.approx((a.gm, a.pm, a.sm), rel=1e-6)


def test_an_undamped_mode_behind_a_dead_time_divides_by_no_zero():
    plant = nrdob.delay(11.0) * (s**2 + 1) / (s**2 + 4)
    loop = nrdob.NRDOB(plant, 1 / (s + 1), 1 / s, LowPassFilter(50.0, 2))
    assert loop.margins().observer_loop.stable is False  # warnings of the package are errors


@pytest.mark.parametrize("fastest", [1e-6, 1e-8, 1e-10])
def test_a_gain_margin_of_many_decades_is_found(fastest):
    # Lags 1, T and T with an integral controller of slow loop: lost where the phases add to 180°,
    # Routh: (T s + 1)^2 s + k = 0 at k = 2/T.
    model = 1 / (fastest * s + 1) ** 2
    loop = nrdob.NRDOB(model, model, 1 / s, LowPassFilter(1.0, 2))
    found = loop.margins().model_loop
    assert found.gm_high == pytest.approx(2 / fastest, rel=1e-6)
    assert found.wpc == pytest.approx(1 / fastest, rel=1e-6)


def test_a_static_loop_of_gain_one_is_lost_by_half_a_revolution():
    found = nrdob.NRDOB(1 / (s + 1), 1.0, 1.0, LowPassFilter(1.0, 1)).margins().model_loop
    assert (found.pm, found.sm, found.gm) == (pytest.approx(180.0), pytest.approx(2.0), math.inf)


def test_a_neutral_loop_has_the_phase_margin_of_the_circle_it_ends_in():
    # a + b exp(-jωθ) meets the unit circle at the angle of cosine (1 + a² - b²)/(2a).
    a, b = 0.8, 0.5
    loop = Quotient((QuasiPolynomial([a], [b], 1.0),), (QuasiPolynomial([1.0]),))
    angle = np.degrees(np.arccos((1 + a**2 - b**2) / (2 * a)))
    assert quotient_margins(loop, True).pm == pytest.approx(180 - angle)


# What a peak of the sensitivity guarantees.


@pytest.mark.parametrize("ms", [1.01, 1.4, 2.0, 50.0])
def test_the_bounds_of_a_peak_lie_on_the_circle_around_minus_one(ms):
    bounds = margin_bounds(ms)
    rotated = -np.exp(1j * np.radians(bounds.pm))
    for point in (-1 / bounds.gm_low, -1 / bounds.gm_high, rotated):
        assert abs(1 + point) == pytest.approx(1 / ms)


def test_the_distance_of_a_loop_close_to_the_border_is_right_to_ten_digits():
    """Smallest |1 + L|, and where, found by golden section in 40 digits."""
    model = ct.tf([1.0, 1.0], [1e4, 1.02e4, 201.0, 1.0])
    loop = nrdob.NRDOB(
        ct.tf([-1.0], [-0.0392419, 1.0]), model, ct.tf([-1.0], [1.0, 1.0]), LowPassFilter(0.1, 3)
    )
    found = loop.margins().plant_loop
    assert found.sm == pytest.approx(2.81710911779e-4, rel=1e-10)
    assert found.wms == pytest.approx(15963.370716964, rel=1e-12)
    assert found.pm == pytest.approx(0.0161408469815793, rel=1e-10)


@pytest.mark.thorough
@given(loops())
@settings(max_examples=30)
def test_margins_are_never_below_the_bounds_of_the_peak(loop):
    found = loop.margins().plant_loop
    assume(found.stable and found.ms > 1 + 1e-9)
    bounds = margin_bounds(found.ms)
    assert found.gm_low <= bounds.gm_low * (1 + 1e-9)
    assert found.gm_high >= bounds.gm_high * (1 - 1e-9)
    assert found.pm >= bounds.pm * (1 - 1e-9)


@pytest.mark.parametrize("ms", [1, 0.5, -2.0, math.inf, math.nan])
def test_a_peak_of_one_or_less_bounds_nothing_and_is_refused(ms):
    with pytest.raises(ValueError, match="above 1"):
        margin_bounds(ms)


@pytest.mark.parametrize("ms", ["1.4", True, None, 1.4 + 1j])
def test_what_is_no_number_has_no_bounds(ms):
    with pytest.raises(TypeError, match="as a number"):
        margin_bounds(ms)


# Any loop gain.


@pytest.mark.parametrize("delay", [0.01, 0.5, 1.5])
def test_an_integrator_with_dead_time_has_the_margins_in_closed_form(delay):
    found = nrdob.margins(nrdob.delay(delay) / s)
    assert found.stable
    assert found.gm_high == pytest.approx(math.pi / 2 / delay)
    assert found.pm == pytest.approx(90 - math.degrees(delay))
    assert found.delay_margin == pytest.approx(math.pi / 2 - delay)


@pytest.mark.parametrize(
    "write",
    [
        lambda L: L,
        ct.tf2ss,
        lambda L: (L.num[0][0], L.den[0][0]),
        lambda L: scipy.signal.lti(L.num[0][0], L.den[0][0]),
        lambda L: scipy.signal.lti(L.num[0][0], L.den[0][0]).to_zpk(),
        lambda L: nrdob.delay(0.0) * L,
    ],
)
def test_a_loop_gain_has_controls_margins_however_it_is_written(write):
    L = ct.tf([4.0], [1.0, 3.0, 3.0, 1.0])
    found = nrdob.margins(write(L))
    assert found.stable and tuple(found) == pytest.approx(ct.stability_margins(L))
    assert nrdob.encirclements(write(L)).encirclements == 0


def test_an_unstable_loop_gain_has_no_margins_but_the_gains_at_which_roots_cross():
    found = nrdob.margins(ct.tf([4.0], [1.0, 2.0, 1.0, 0.0]))  # 1/(s (s + 1)²) bears a gain of 2
    assert found.stable is False and math.isnan(found.gm)
    assert found.critical_gains == pytest.approx([0.5])
    assert found.phase_crossovers == pytest.approx([1.0])
    turned = found.rotations * np.pi / 180
    L = 4 / (1j * found.gain_crossovers * (1j * found.gain_crossovers + 1) ** 2)
    assert L * np.exp(1j * turned) == pytest.approx(-1)


def test_a_loop_that_is_ill_posed_is_not_decided():
    assert nrdob.margins(ct.tf([-1.0, 0.0], [1.0, 1.0])).stable is None
    assert nrdob.margins(-1.0).stable is None


def test_encirclements_of_a_transfer_function_are_controls():
    L = ct.tf([-6.0], [1.0, 4.0, -5.0])
    assert nrdob.encirclements(L).encirclements == ct.nyquist_response(L).count


# The symmetric disk margin.


@pytest.mark.thorough
@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("name", ["CGm", "FH", "L"])
def test_the_disk_margin_is_controls_on_a_dense_grid(number, name):
    loop = paper.example(number)
    quotient = getattr(loop, name)
    found = nrdob.margins(quotient)
    theirs, gain_db, phase = ct.disk_margins(quotient.to_tf(), np.geomspace(1e-4, 1e6, 4001))
    assert found.disk_margin == pytest.approx(theirs, rel=1e-5)
    if theirs < 2 * (1 - 1e-6):
        high, rotation = tolerated(found.disk_margin)
        assert 20 * math.log10(high) == pytest.approx(gain_db, rel=1e-4)
        assert rotation == pytest.approx(phase, rel=1e-4)


def tolerated(alpha):
    """The largest gain, and the rotation in degrees, in the disk of the symmetric disk margin."""
    return (2 + alpha) / (2 - alpha) if alpha < 2 else math.inf, math.degrees(
        2 * math.atan(alpha / 2)
    )


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_no_margin_is_below_what_the_disk_guarantees(number):
    every = paper.example(number).margins()
    for found in (every.model_loop, every.observer_loop, every.plant_loop):
        high, rotation = tolerated(found.disk_margin)
        assert found.gm_low <= 1 / high * (1 + 1e-9)
        assert found.gm_high >= high * (1 - 1e-9)
        assert found.pm >= rotation * (1 - 1e-9)


@pytest.mark.parametrize(
    ("filter", "last"),
    [
        ((1.5 * s + 1) / (s + 1), 1.5),
        ((1 - 2 * s) / (s + 1), 2.0),
        ((1 - s) / (s + 1), 1.0),
        ((s**2 + s + 1) / (s + 1) ** 2, 1.0),
    ],
)
def test_a_filter_that_lets_fast_signals_through_leaves_margins_in_closed_form(filter, last):
    # Where the model waits as the process does, L = X/(1 - X) with X = F exp(-sθ): 1 + kL vanishes
    # where (1 - k) X = 1, 1 + L = 1/(1 - X), and (1 + L)/(1 - L) = 1/(1 - 2X). |F| tends to `last`.
    G = nrdob.delay(1.0) * (s + 2) / (s + 1)
    found = nrdob.NRDOB(G, G, 1.0, filter).margins().plant_loop
    assert found.ms == pytest.approx(1 + last, rel=1e-6)
    assert found.gm_low == pytest.approx(1 - 1 / last, abs=1e-6)
    assert found.gm_high == pytest.approx(1 + 1 / last, rel=1e-6)
    assert found.disk_margin == pytest.approx(2 / (1 + 2 * last), rel=1e-6)
    assert found.pm == pytest.approx(math.degrees(2 * math.asin(0.5 / last)), rel=1e-6)


@pytest.mark.parametrize("gain", [-0.5, 0.5])
def test_a_loop_gain_that_is_below_1_to_the_end_has_no_phase_margin(gain):
    assert nrdob.margins(ct.tf([gain, 0.2 * gain], [1, 1])).pm == math.inf


def test_margins_are_shown_without_the_lists_behind_them():
    shown = repr(paper.example(1).margins().plant_loop)
    assert "gm=" in shown and "crossovers" not in shown and "rotations" not in shown


@pytest.mark.parametrize("omega", [0.5, 1.0, 2.0, 3.0, 4.0])
@pytest.mark.parametrize("damping", [0.125, 0.25, 0.375, 0.5, 0.625])
def test_a_crossover_that_lies_on_a_frequency_looked_at_hides_no_other(omega, damping):
    # |L| = 1 at x = ω², and again at a second root of (ω² - x)² + 4 ζ² ω² (x - ω²) = 0.
    L = ct.tf([2 * damping * omega**2], [1, 2 * damping * omega, omega**2])
    x = np.roots(
        [1, 4 * damping**2 * omega**2 - 2 * omega**2, omega**4 - 4 * damping**2 * omega**4]
    )
    expected = np.sqrt(np.sort(x[x > 1e-9]))
    found = nrdob.margins(L)
    np.testing.assert_allclose(found.gain_crossovers, expected, rtol=1e-9)
    angles = 180 - np.abs(np.degrees(np.angle(L(1j * expected))))
    assert found.pm == pytest.approx(angles.min(), rel=1e-9)
