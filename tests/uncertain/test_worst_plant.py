"""Filters for families: the worst member meets the specification, and a faster filter fails one."""

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import LowPassFilter, paper

LAG = ct.tf([1], [1, 1])


def worst_ms(plants, loop, filter):
    """Of members that are all stable; infinite if one is not."""
    loop = nrdob.NRDOB(loop.process, loop.model, loop.controller, filter)
    table = nrdob.sweep(loop, plants, "ms")
    return table["ms"].max() if table["stable"].all() else np.inf


@pytest.mark.slow
@pytest.mark.parametrize("number", [2, 4])
def test_the_worst_member_meets_the_specification_and_with_a_faster_filter_it_does_not(number):
    loop = paper.example(number)
    plants = nrdob.plant_family(loop.process, gain=(0.8, 1.2), lag=(0.0, 0.02), samples=100)
    F = nrdob.design_filter(plants, loop.model, order=loop.filter.order, max_ms=1.7)
    assert worst_ms(plants, loop, F) == pytest.approx(1.7, rel=1e-5)
    assert worst_ms(plants, loop, LowPassFilter(0.99 * F.time_constant, F.order)) > 1.7
    one = nrdob.NRDOB(plants[3], loop.model, loop.controller, F)
    assert one.margins().plant_loop.ms <= 1.7 * (1 + 1e-5)


def test_what_is_met_however_fast_is_left_to_the_noise():
    loop = paper.example(3)
    plants = nrdob.plant_family(loop.process, gain=(0.8, 1.2), samples=20)
    with pytest.raises(ValueError, match="however fast"):
        nrdob.design_filter(plants, loop.model, order=2, max_ms=1.7)


@pytest.mark.thorough
def test_a_dead_time_of_the_longest_decides():
    plants = nrdob.plant_family(LAG, delay=(0.1, 0.3), grid=3)
    F = nrdob.design_filter(plants, LAG, order=1, max_ms=2.0)
    alone = nrdob.design_filter(plants[2], LAG, order=1, max_ms=2.0)
    assert F.time_constant == pytest.approx(alone.time_constant, rel=1e-6)
    several = nrdob.design_filter(plants, LAG, max_ms=2.0)
    assert several.order * several.time_constant <= F.order * F.time_constant * (1 + 1e-9)


def test_plants_that_exclude_each_other_are_named():
    plants = nrdob.plant_family(-LAG, gain=(-1.0, 1.0), grid=2)
    with pytest.raises(ValueError, match="members 0, 1 exclude each other"):
        nrdob.design_filter(plants, LAG, order=1, max_ms=2.0)
    with pytest.raises(TypeError, match="max_ms"):
        nrdob.design_filter(plants, LAG, order=1)
