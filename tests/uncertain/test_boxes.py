"""What survives exactly: closed forms, margins, and what is sampled on both sides of the border."""

import math

import control as ct
import numpy as np
import pytest
from scipy.optimize import brentq

import nrdob
from nrdob import LowPassFilter, paper
from nrdob.uncertain import conservatism, delay_intervals, fit_weight, gain_intervals, small_gain
from tests.campaigns import intervals

LAG = ct.tf([1], [1, 1])
INTEGRATOR = ct.tf([1], [1, 0])
MATCHED = nrdob.NRDOB(LAG, LAG, INTEGRATOR, LowPassFilter(0.2, 1))


@pytest.mark.parametrize(("order", "bound"), [(3, 9.0), (4, 5.0), (6, 1 + (2 / 3**0.5) ** 6)])
def test_gains_survive_up_to_the_closed_form_bound(order, bound):
    G = ct.tf([1], [1, 3, 2])
    loop = nrdob.NRDOB(G, G, INTEGRATOR, LowPassFilter(0.05, order))
    ((low, high),) = gain_intervals(loop, 0.01, 50)
    assert low == 0.01 and high == pytest.approx(bound, rel=1e-9)


def test_intervals_are_those_of_the_margins_and_of_the_printed_example():
    loop = paper.example(4)
    margins = loop.margins().plant_loop
    ((_, gain),) = gain_intervals(loop, 0.01, 20)
    ((_, delay),) = delay_intervals(loop, 0, 2)
    assert gain == pytest.approx(margins.gm) == pytest.approx(3.7121, abs=1e-4)
    assert delay == pytest.approx(margins.delay_margin)


@pytest.mark.slow
def test_dead_times_may_be_survived_again_and_again():
    # A mode that is seen through a dead time: lost and found again with every turn.
    process = LAG * nrdob.plants.resonance(20.0, 0.02)
    loop = nrdob.NRDOB(process, LAG, INTEGRATOR, LowPassFilter(1.0, 1))
    found = delay_intervals(loop, 0.0, 1.5)
    assert len(found) > 2
    family = nrdob.plant_family(process, delay=(0.0, 1.5), samples=2000)
    table = nrdob.sweep(loop, family, "stable")
    inside = np.any([(a < table["delay"]) & (table["delay"] < b) for a, b in found], axis=0)
    assert np.array_equal(inside, table["stable"])


def test_one_dead_time_alone_is_survived_below_half_pi_lambda():
    box = nrdob.largest_box(MATCHED, delay=(0, 1))
    assert box.share == pytest.approx(math.pi / 2 * 0.2)
    assert box.frequency == pytest.approx(5.0, rel=1e-3)


@pytest.mark.thorough
@pytest.mark.parametrize("number", [2, 3, 4])
@pytest.mark.parametrize("names", ["gain lag", "gain delay", "delay lag", "gain delay lag", "lag"])
def test_a_box_survives_up_to_its_share_and_not_beyond(number, names):
    loop = paper.example(number)
    wide = {"gain": (0.2, 6.0), "delay": (0.0, 2.0), "lag": (0.0, 2.0)}
    asked = {name: wide[name] for name in names.split()}
    box = nrdob.largest_box(loop, **asked)
    if box.share == 1:
        assert box.critical is None
        table = nrdob.sweep(loop, nrdob.plant_family(loop.process, **asked, grid=201), "stable")
        assert names == "lag" and table["stable"].all()
        return
    for factor, all_stable in ((1 - 1e-6, True), (1 + 1e-6, False)):
        near = {
            name: tuple(c + box.share * factor * (x - c) for x in asked[name])
            for name, c in (("gain", 1.0), ("delay", 0.0), ("lag", 0.0))
            if name in asked
        }
        if all_stable:
            table = nrdob.sweep(loop, nrdob.plant_family(loop.process, **near, grid=9), "stable")
            assert table["stable"].all()
    # The plant that is named is at the limit: it is lost at the frequency that is named.
    lost, w = box.critical, box.frequency
    s = 1j * w
    L = lost["gain"] * loop.L(s) * np.exp(-s * lost["delay"]) / (1 + s * lost["lag"])
    assert abs(1 + L) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("narrow", [{"lag": (0.0, 0.0381)}, {"gain": (0.9999, 1.0001)}])
def test_a_box_that_is_narrow_in_all_but_the_dead_time_is_no_larger_than_its_dead_time(narrow):
    # Said to survive as a whole before: only in 0.03 % of a decade a plant of it can oscillate.
    Gm = ct.tf([0.419], [40.3, 14.0, 1])
    loop = nrdob.NRDOB(
        nrdob.delay(0.325) * 0.917 * Gm, Gm, ct.tf([4.35, 0.83], [1.82, 3.04, 1]),
        LowPassFilter(0.676, 2),
    )  # fmt: skip
    alone = nrdob.largest_box(loop, delay=(0.0, 8.0)).share
    assert alone == pytest.approx(loop.margins().plant_loop.delay_margin / 8)
    assert nrdob.largest_box(loop, delay=(0.0, 8.0), **narrow).share == pytest.approx(alone, 1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("longest", [1e-2, 1e-4, 1e-6])
def test_a_narrow_box_of_dead_times_and_a_wide_one_of_gains_end_at_the_closed_form(longest):
    # L = k exp(-(0.1 + τ)s)/(0.5s) is lost where k (0.1 + τ) = π/4, at the corner k = 1 + 39σ.
    loop = nrdob.NRDOB(nrdob.delay(0.1) * LAG, LAG, INTEGRATOR, LowPassFilter(0.5, 1))
    share = brentq(lambda x: (1 + 39 * x) * (0.1 + longest * x) - math.pi / 4, 0.0, 1.0, xtol=1e-15)
    box = nrdob.largest_box(loop, gain=(0.5, 40.0), delay=(0.0, longest))
    assert box.share == pytest.approx(share, rel=1e-8)


@pytest.mark.slow
def test_a_box_ends_where_its_plants_begin_to_oscillate_within_a_narrow_band():
    # The least share lies between an end of the band of frequencies and the next one looked at.
    process = nrdob.delay(0.37) * ct.tf(
        [0.0465, 0.12, 1.057], [0.000346, 0.00247, 0.0471, 0.197, 1.05, 1]
    )
    model = ct.tf([0.0402, 0.103, 0.913], [0.00943, 0.0308, 0.907, 1])
    loop = nrdob.NRDOB(process, model, ct.tf([-1.04], [4.93, 4.88, 1]), LowPassFilter(1.28, 1))
    box = nrdob.largest_box(loop, delay=(0.0, 4.87), lag=(0.0, 0.0789))
    corner = {"delay": 4.87 * box.share, "lag": 0.0789 * box.share}
    for beyond, stable in ((1 - 1e-5, True), (1 + 1e-5, False)):
        delay, lag = corner["delay"] * beyond, corner["lag"] * beyond
        plant = nrdob.delay(delay) * process * ct.tf([1], [lag, 1])
        other = nrdob.NRDOB(plant, model, loop.controller, loop.filter)
        assert other.stability().stable is stable


@pytest.mark.slow
def test_a_box_with_a_short_dead_time_ends_before_the_gain_margin():
    process = nrdob.delay(0.0854) * ct.tf([0.635], [39.2, 84.4, 9.29, 1])
    model = ct.tf([1.542, 2.114], [7.233, 3.249, 1])
    loop = nrdob.NRDOB(process, model, ct.tf([1.485], [0.383, 1]), LowPassFilter(2.94, 1))
    box = nrdob.largest_box(loop, gain=(0.766, 2.257), delay=(0.0, 0.114))
    assert 1 + box.share * (2.257 - 1) < loop.margins().plant_loop.gm


@pytest.mark.slow
def test_the_plant_that_is_named_waits_as_many_turns_as_the_box_allows():
    process = nrdob.delay(0.1216) * ct.tf([0.628, 1.698], [0.0164, 0.0175, 2.745, 1])
    model = ct.tf([0.644, 1.741], [2.741, 1])
    loop = nrdob.NRDOB(
        process, model, ct.tf([0.21, 0.357], [27.9, 5.95, 1]), LowPassFilter(1.12, 1)
    )
    box = nrdob.largest_box(loop, gain=(0.2152, 3.528), delay=(0.0, 9.72), lag=(0.0, 6.83))
    s, (gain, delay, lag) = 1j * box.frequency, box.critical.values()
    assert abs(1 + gain * loop.L(s) * np.exp(-s * delay) / (1 + s * lag)) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("longest", [1.0, 1e2, 1e4, 1e6])
def test_the_plant_that_is_named_is_at_the_limit_however_long_lags_may_be(longest):
    process = ct.tf([4.95, 0.635, 0.161], [1, 2.24, 1.15, 0.0967])
    model = ct.tf([6.0, 0.769, 0.196], [1, 1.89, 0.819, 0.0578])
    loop = nrdob.NRDOB(process, model, ct.tf([0.1, 0.1], [1, 0]), LowPassFilter(0.0728, 1))
    box = nrdob.largest_box(loop, gain=(0.77, 3.12), delay=(0.0, 0.248), lag=(0.0, longest))
    s, (gain, delay, lag) = 1j * box.frequency, box.critical.values()
    assert box.share == pytest.approx(0.2594, abs=2e-3) and 0.1 < lag < 0.2
    assert abs(1 + gain * loop.L(s) * np.exp(-s * delay) / (1 + s * lag)) < 1e-6


def test_a_dead_time_alone_is_lost_at_the_frequency_that_is_named():
    # Beside a model of 1.3 s another frequency was taken for it.
    process = ct.ss([[-0.693]], [[1]], [[1.018]], [[0.297]])
    model = nrdob.delay(1.328) * ct.tf([0.446, 1.838], [1.443, 1])
    C = ct.tf([0.51, 1.2], [0.189, 0.58, 1])
    loop = nrdob.NRDOB(process, model, C, LowPassFilter(0.0397, 1))
    box = nrdob.largest_box(loop, delay=(0.0, 6.7))
    s = 1j * box.frequency
    assert abs(1 + loop.L(s) * np.exp(-s * box.critical["delay"])) < 1e-8


@pytest.mark.slow
def test_how_far_dead_times_are_asked_for_does_not_change_the_answer():
    process = LAG * nrdob.plants.resonance(20.0, 0.02)
    for plant in (LAG, process):
        loop = nrdob.NRDOB(plant, LAG, INTEGRATOR, LowPassFilter(1.0, 1))
        near, far = (delay_intervals(loop, 0.0, high) for high in (20.0, 1e6))
        assert np.ravel(near) == pytest.approx(np.ravel(far)) and near[-1][1] < 20


@pytest.mark.thorough
def test_intervals_and_boxes_are_those_of_an_independent_count():
    tally = intervals.campaign(4, 0)
    assert not any(name.startswith("WRONG") for name in tally), tally
    assert {"delay: right", "gain: right", "critical: right", "box: right"} <= set(tally)


def test_a_box_that_survives_is_said_to():
    box = nrdob.largest_box(MATCHED, gain=(0.1, 100))
    assert box.share == 1 and box.critical is None


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "there is no box"),
        ({"gain": (2, 3)}, "not; give an interval that holds it"),
        ({"gain": (-1, 3)}, "positive"),
        ({"delay": (-0.1, 0.1)}, "not negative"),
    ],
)
def test_what_is_no_box_is_refused(given, said):
    with pytest.raises(ValueError, match=said):
        nrdob.largest_box(MATCHED, **given)


def test_a_loop_that_is_not_stable_has_no_box_and_no_small_gain():
    loop = nrdob.NRDOB(nrdob.delay(1) * LAG, LAG, INTEGRATOR, LowPassFilter(0.2, 1))
    for ask in (lambda: nrdob.largest_box(loop, gain=(0.5, 2)), lambda: small_gain(loop, 0.1)):
        with pytest.raises(ValueError, match="not stable"):
            ask()
    with pytest.raises(ValueError, match="predicts the future"):
        delay_intervals(MATCHED, -0.1, 1)


@pytest.mark.slow
def test_a_weight_holds_every_plant_and_touches_one():
    omega = np.geomspace(0.01, 1e3, 150)
    family = nrdob.plant_family(LAG, gain=(0.8, 1.3), lag=(0, 0.1), delay=(0, 0.02), samples=60)
    errors = [np.abs(plant(1j * omega) / LAG(1j * omega) - 1) for plant in family]
    tightness = []
    for order in (1, 2):
        W = fit_weight(LAG, family, omega, order)
        size = np.abs(W(1j * omega))
        assert (W.poles().real < 0).all() and (W.zeros().real <= 0).all()
        assert (size >= np.max(errors, axis=0) * (1 - 1e-6)).all()
        tightness.append((size / np.max(errors, axis=0)).mean())
    assert 1 <= tightness[1] <= tightness[0] < 1.3


@pytest.mark.parametrize("damping", [0.3, 0.1, 1e-3])
def test_the_peak_of_a_resonant_weight_is_found_to_the_last_digits(damping):
    # T = 1/(0.2 s + 1) cancels, and 1/(2ζ sqrt(1 - ζ²)) is the peak of what is left.
    weight = ct.tf([0.2 * 49, 49], [1, 14 * damping, 49])
    peak = 1 / (2 * damping * np.sqrt(1 - damping**2))
    assert small_gain(MATCHED, weight) == pytest.approx(peak, rel=1e-9)


def test_small_gain_is_the_peak_of_a_closed_form():
    # T = 1/(0.2 s + 1) for a matched model and n = 1: a weight k gives the peak k.
    assert small_gain(MATCHED, 0.7) == pytest.approx(0.7)
    assert small_gain(MATCHED, 1.1) == pytest.approx(1.1)
    with pytest.raises(ValueError, match="mirror"):
        small_gain(MATCHED, ct.tf([1], [1, -1]))


@pytest.mark.thorough
def test_small_gain_grants_no_more_than_what_survives():
    for number in (2, 3, 4):
        found = conservatism(paper.example(number), gain=(0.2, 6.0), delay=(0.0, 0.5))
        assert 0 < found.small_gain < found.exact < 1


def test_a_weight_that_cannot_be_fitted_is_refused():
    omega = np.geomspace(0.1, 10, 20)
    for given, said in (
        ((LAG, [], omega), "no plant"),
        ((LAG, [LAG], omega[::-1]), "increasing"),
        ((LAG, [LAG], omega, 0), "order is 0"),
    ):
        with pytest.raises(ValueError, match=said):
            fit_weight(*given)


@pytest.mark.slow
def test_a_box_ends_where_a_corner_of_gain_and_no_dead_time_leave_the_lag_free():
    # Example 3 with k of 0.5 to 1: at k = 1 the longest lag is a root of Routh's condition.
    loop = paper.example(3)
    box = nrdob.largest_box(loop, gain=(0.5, 1.0), lag=(0.0, 0.1))

    def rightmost(lag: float) -> float:
        process = loop.process * ct.tf([1], [lag, 1])
        changed = nrdob.NRDOB(process, loop.model, loop.controller, loop.filter)
        return changed.stability().observer_loop.rightmost.real

    longest = brentq(rightmost, 0.05, 0.1)
    assert 0.1 * box.share == pytest.approx(longest, rel=1e-4)
    assert box.critical is not None and box.critical["gain"] == pytest.approx(1.0, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("also", [{}, {"lag": (0.0, 0.1)}])
def test_a_box_may_end_where_a_real_root_passes_zero(also):
    # L = -0.5/(s + 1): 1 + kL vanishes at s = 0 for k = 2, a third of the way from 1 to 4.
    loop = nrdob.NRDOB(ct.tf([-0.5], [1, 1]), INTEGRATOR, 1.0, LowPassFilter(1.0, 1))
    box = nrdob.largest_box(loop, gain=(0.5, 4.0), **also)
    assert box.share == pytest.approx(1 / 3, rel=1e-12) and box.frequency == 0.0
    assert box.critical == {"gain": pytest.approx(2.0, rel=1e-12), "delay": 0.0, "lag": 0.0}
