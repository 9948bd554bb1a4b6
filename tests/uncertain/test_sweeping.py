"""Sweeps: verdicts and margins of whole families are those of each member."""

import math
import warnings
from functools import cache

import control as ct
import numpy as np
import pytest

import nrdob
from campaigns.sweeps import differences, loops, plants
from nrdob import LowPassFilter, paper

LAG = ct.tf([1], [1, 1])


@cache
def some_loops():
    return dict(loops(3))


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["Example 1", "Example 2", "Example 3", "Example 4", "random 2",
                                  "random 5 with dead time", "random 8"])  # fmt: skip
def test_a_sweep_says_of_each_member_what_is_said_of_it_alone(name):
    loop = some_loops()[name]
    assert differences(loop, plants(loop, 40, 11), every=4) == []


@pytest.mark.slow
def test_a_model_that_waits_is_swept_too():
    loop = nrdob.NRDOB(
        nrdob.delay(0.5) * LAG, nrdob.delay(0.5) * LAG, ct.tf([1], [1, 0]), LowPassFilter(0.1, 2)
    )
    assert differences(loop, nrdob.plant_family(loop.process, gain=(0.3, 3), delay=(-0.3, 0.3),
                                          samples=40), every=4) == []  # fmt: skip


@pytest.mark.slow
def test_a_delayed_model_with_an_integrator_is_swept_too():
    motor = nrdob.delay(0.2) * ct.tf([1], [1, 1, 0])
    loop = nrdob.NRDOB(1.1 * motor, motor, 0.3, LowPassFilter(0.8, 2))
    assert loop.built.E.divided == 1 and loop.stability().stable
    assert differences(loop, nrdob.plant_family(loop.process, gain=(0.3, 3), samples=12)) == []


@pytest.mark.parametrize(("order", "bound"), [(3, 9.0), (4, 5.0), (6, 1 + (2 / 3**0.5) ** 6)])
def test_a_pure_gain_error_is_survived_up_to_the_closed_form_bound(order, bound):
    matched = ct.tf([1], [1, 3, 2])
    loop = nrdob.NRDOB(matched, matched, ct.tf([1], [1, 0]), LowPassFilter(0.05, order))
    table = nrdob.sweep(
        loop, nrdob.plant_family(matched, gain=(0.1, 2 * bound), samples=3000), "stable"
    )
    assert np.array_equal(table["stable"], table["gain"] < bound) and table["decided"].all()


def test_a_pure_dead_time_is_survived_below_half_pi_lambda():
    loop = nrdob.NRDOB(LAG, LAG, ct.tf([1], [1, 0]), LowPassFilter(0.2, 1))
    table = nrdob.sweep(loop, nrdob.plant_family(LAG, delay=(0, 1), samples=1000), "stable")
    assert np.array_equal(table["stable"], table["delay"] < math.pi / 2 * 0.2)


def test_members_on_the_border_are_judged_alone_and_flagged():
    # Example 1's plant as its own model: gain 0 is no plant, and n = 3 is lost at gain 9.
    matched = ct.tf([1], [1, 3, 2])
    loop = nrdob.NRDOB(matched, matched, ct.tf([1], [1, 0]), LowPassFilter(0.5, 3))
    table = nrdob.sweep(loop, nrdob.plant_family(matched, gain=(0, 18), grid=5), ("stable", "ms"))
    assert table["stable"].tolist() == [False, True, False, False, False]
    assert table["decided"].tolist() == [False, True, False, True, True]
    assert table["alone"].tolist() == [True, False, True, False, False]
    assert "identically zero" in table["reason"][0] and "axis" in table["reason"][2]


def test_an_unstable_model_loop_is_lost_with_every_plant():
    loop = nrdob.NRDOB(LAG, LAG, -5.0, LowPassFilter(0.2, 1))
    table = nrdob.sweep(loop, nrdob.plant_family(LAG, gain=(0.5, 2), samples=10))
    assert table["decided"].all() and not table["stable"].any()
    assert np.isnan(table["ms"]).all() and "C Gm" in table["reason"][0]


def strange(k):
    kinds = {
        0: lambda: ([1.0], [1.0, 1.0]),
        1: lambda: ([math.nan], [1.0, 1.0]),
        2: lambda: ([1.0, 0.0, 0.0], [1.0, 1.0]),
        3: lambda: ([1.0], [1.0, 1.0, math.inf]),
        4: lambda: 1 / 0,
        5: lambda: nrdob.delay(0.1) * ct.tf([1], [1, 1]),
        6: lambda: "a plant",
    }
    return kinds[round(k)]()


def test_members_that_are_no_plants_are_reported_and_the_sweep_goes_on():
    loop = nrdob.NRDOB(LAG, LAG, ct.tf([1], [1, 0]), LowPassFilter(0.2, 1))
    family = nrdob.plant_family(LAG, parameters=strange, k=(0, 6), grid=7)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        table = nrdob.sweep(loop, family)
    assert table["decided"].tolist() == [True, False, False, False, False, True, False]
    assert table["stable"].tolist() == [True, False, False, False, False, True, False]
    for k, said in ((1, "finite"), (2, "improper"), (3, "finite"), (4, "division"), (6, "str")):
        assert said in table["reason"][k]
    assert "parameters(k=1)" in table["reason"][1]
    with pytest.raises(ValueError, match="member 1 is no plant"):
        family[1]


def test_a_negative_dead_time_and_an_ill_posed_member_are_reported():
    loop = nrdob.NRDOB(LAG, LAG, ct.tf([1], [1, 0]), LowPassFilter(0.2, 1))
    table = nrdob.sweep(loop, nrdob.plant_family(LAG, delay=(-0.1, 0.1), grid=2), "stable")
    assert table["decided"].tolist() == [False, True] and "future" in table["reason"][0]
    # R = 1 - 0.01 s with λ = 0.01: 1 + F(∞) H(∞) = 0 where the gain is 1.
    process, model = ct.tf([-0.01, 1], [1, 1]), LAG
    loop = nrdob.NRDOB(process, model, ct.tf([1], [1, 0]), LowPassFilter(0.01, 1))
    table = nrdob.sweep(loop, nrdob.plant_family(process, gain=(0.5, 1.5), grid=3), "stable")
    assert "ill-posed" in table["reason"][1] and not table["decided"][1]


def test_the_share_is_bounded_as_clopper_and_pearson_do():
    loop = paper.example(1)
    plants = nrdob.plant_family(loop.process, gain=(0.5, 2), samples=100)
    table = nrdob.sweep(loop, plants, "stable")
    share = table.stable_share()
    assert share.share == share.high == 1.0
    assert share.low == pytest.approx(0.025 ** (1 / 100))
    for wrong, kind in ((1.5, ValueError), ("much", TypeError)):
        with pytest.raises(kind):
            table.stable_share(wrong)


def test_the_worst_come_first():
    loop = paper.example(3)
    family = nrdob.plant_family(loop.process, gain=(0.5, 2), lag=(0, 0.2), grid=5)
    table = nrdob.sweep(loop, family, "ms")
    worst = table.worst(30)
    stable = worst["stable"]
    assert not stable[: (~stable).sum()].any()
    assert (np.diff(worst["ms"][stable]) <= 0).all() and len(table.worst(3)) == 3
    with pytest.raises(KeyError, match="the columns are"):
        table["gm"]
    assert "stable" in repr(table)


def test_what_cannot_be_swept_is_refused():
    loop = paper.example(1)
    family = nrdob.plant_family(loop.process, gain=(0.5, 2), samples=3)
    for given, kind in (
        ((loop.process, family), TypeError),
        ((loop, [loop.process]), TypeError),
        ((loop, family, ("bandwidth",)), ValueError),
    ):
        with pytest.raises(kind):
            nrdob.sweep(*given)


@pytest.mark.slow
def test_a_resonance_beside_the_closest_point_does_not_hide_it():
    process = ct.tf([1.25022371], [66.00996982, 31.30550646, 2.1087145, 1.0])
    model = ct.tf([1], [9.37512818, 13.33847147, 6.32577382, 1.0])
    controller = ct.tf([4.15167212, 1.96893166], [2.10859127, 0.0])
    loop = nrdob.NRDOB(process, model, controller, LowPassFilter(20.734760868429852, 3))
    family = nrdob.plant_family(process, gain=(0.3, 2.0), lag=(0.0, 1.0), samples=12, seed=10)
    assert differences(loop, family, every=1) == []


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_loop_gain_of_one_lag_is_closest_at_zero_or_at_infinity(sign):
    # L = ±k/(2s + 2): |1 + L| falls to 1, or to 1 - k/2 at rest.
    loop = nrdob.NRDOB(0.5 * sign * LAG, ct.tf([1], [1, 0]), 1.0, LowPassFilter(1.0, 1))
    family = nrdob.plant_family(loop.process, gain=(0.5, 1.5), grid=3)
    table = nrdob.sweep(loop, family, "ms")
    peak = 1.0 if sign > 0 else 1 / (1 - table["gain"] / 2)
    np.testing.assert_allclose(table["ms"], peak, rtol=1e-12)


def test_a_gain_that_acts_at_once_is_closest_to_minus_one_at_infinity():
    # The model is the process but for its gain k: L tends to k f/(1 - f), with f = 0.3.
    process, F = ct.tf([1, 3], [1, 1]), ct.tf([0.3, 1], [1, 1])
    loop = nrdob.NRDOB(process, process, ct.tf([0.5], [1, 0]), F)
    table = nrdob.sweep(loop, nrdob.plant_family(process, gain=(0.5, 2), grid=4))
    assert table["ms"] == pytest.approx(1 / (1 + table["gain"] * 0.3 / 0.7))


def test_the_share_of_a_grid_is_counted():
    matched = ct.tf([1], [1, 3, 2])
    loop = nrdob.NRDOB(matched, matched, ct.tf([1], [1, 0]), LowPassFilter(0.05, 3))
    plants = nrdob.plant_family(matched, gain=(2, 14), grid=4)  # lost at a gain of 9
    assert tuple(nrdob.sweep(loop, plants, "stable").stable_share()) == (0.5, 0.5, 0.5)
