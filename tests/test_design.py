"""The fastest filter that meets a specification: met at the border, missed just beyond it."""

from __future__ import annotations

from math import sqrt

import control as ct
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import fractions

import nrdob
from nrdob import LowPassFilter, design_filter, paper

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


def test_the_widest_of_several_orders_is_chosen():
    loop = paper.example(4, modified=True)
    wanted = {"min_gm_db": 6.0, "min_pm_deg": 45.0}
    chosen = design_filter(loop.process, loop.model, **wanted)
    each = [design_filter(loop.process, loop.model, order=n, **wanted) for n in (2, 3, 4)]
    assert chosen.bandwidth == max(filter.bandwidth for filter in each)


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
    with pytest.raises(ValueError, match="every filter of order 2"):
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
    ],
)
def test_impossible_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        design_filter(lag, lag, **specification)


def test_contradictory_specifications_say_what_comes_closest():
    loop = paper.example(3, modified=True)
    with pytest.raises(ValueError, match=r"meets Ms ≤ 1.6, PM ≥ 60°; closest comes"):
        design_filter(loop.process, loop.model, max_ms=1.6, min_pm_deg=60.0)


def test_an_order_too_low_for_causality_is_refused():
    with pytest.raises(ValueError, match="not causal"):
        design_filter(lag**2, lag**2, order=1, max_ms=2)
