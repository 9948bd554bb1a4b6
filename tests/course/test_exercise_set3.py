"""Set 3: what is special about its problems, beyond what holds for every set."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
import pytest

from nrdob import NRDOB, LowPassFilter, delay
from nrdob.analysis import margin_bounds
from nrdob.sampling import random_loop
from nrdob_course.exercises import PROBLEMS, check, own_case
from nrdob_course.exercises.set3 import (
    SHARES,
    GainCase,
    PeakCase,
    delay_readings,
    delays_of,
    draw_close,
    draw_far,
    draw_margin_loop,
    draw_measured_loop,
    draw_noise_loop,
    measured_crossovers,
    noise_readings,
)
from problemsets import accepts

GROUPS = range(1, 13)  # tests/campaigns/misconceptions.py takes more of them


@pytest.mark.thorough
def test_the_promise_is_kept_by_every_loop() -> None:
    rng, tried = np.random.default_rng(31), 0
    for _ in range(300):
        m = random_loop(rng).margins().plant_loop
        if m.stable and m.ms > 1.001:
            case = PeakCase(m.ms)
            low, high, angle = margin_bounds(case.ms)
            assert accepts(PROBLEMS["3.1"], case, (low, high, angle)) is True
            assert m.gm_low <= low * (1 + 1e-9) and m.gm_high >= high * (1 - 1e-9)
            assert m.pm >= angle * (1 - 1e-9)
            tried += 1
    assert tried > 20


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_nobody_can_promise_more(share: float) -> None:
    for k in range(3):

        def moved(case: PeakCase, k: int = k) -> list[float]:
            found = list(margin_bounds(case.ms))
            found[k] *= share
            return found

        assert check("3.1", moved, 1).share < 1


def test_the_neglected_lag_by_hand() -> None:
    rng = np.random.default_rng(32)
    model = ct.tf([2], [1, 3])
    for T, constant in 10 ** rng.uniform(-1, 1, (20, 2)):
        lagging = NRDOB(model * ct.tf([1], [T, 1]), model, 1.0, LowPassFilter(constant, 2))
        found = lagging.margins()
        assert found.plant_loop.gm_high == pytest.approx(4 + 2 * constant / T)
        limit = 1 + 2 * constant / T - constant / (constant + 2 * T)
        assert found.observer_loop.gm_high == pytest.approx(limit)


KINDS = pytest.mark.parametrize(("draw", "which"), [(draw_far, -1), (draw_close, 0)])


@KINDS
def test_the_measurement_gives_the_delay_margin_of_the_loop(draw: Any, which: int) -> None:
    for seed in range(12):
        case, loop = draw_measured_loop(draw, which, np.random.default_rng(seed))
        true = loop.margins().plant_loop
        assert delay_readings(case)["right"] == pytest.approx(true.delay_margin, rel=2e-3)
        assert measured_crossovers(case)[0] == pytest.approx(true.gain_crossovers, rel=2e-3)


@KINDS
def test_roots_cross_where_the_grader_says(draw: Any, which: int) -> None:
    for seed in range(4):
        case, loop = draw_measured_loop(draw, which, np.random.default_rng(seed))
        margin = delay_readings(case)["right"]
        for share, expected in ((0.97, True), (1.03, False)):
            plant = delay(share * margin) * loop.process
            late = NRDOB(plant, loop.model, loop.controller, loop.filter)
            assert late.stability().stable is expected


@pytest.mark.thorough
def test_every_group_meets_a_loop_that_is_lost_first_at_either_end() -> None:
    for group in range(1, 61):
        ends = {int(np.argmin(delays_of(case))) for case in PROBLEMS["3.3"].cases(group, 2)}
        assert ends == {0, 2}


def test_a_later_border_is_no_delay_margin() -> None:
    # With more dead time the loop is stable once more; a border there would pass a test at two
    # dead times alone.
    case, loop = draw_measured_loop(draw_far, -1, np.random.default_rng(1))
    later = delay_readings(case)["phase margin"]

    def stable(theta: float) -> bool | None:
        plant = delay(theta) * loop.process
        return NRDOB(plant, loop.model, loop.controller, loop.filter).stability().stable

    assert stable(0.96 * later) is True and stable(1.04 * later) is False
    assert "already unstable" in PROBLEMS["3.3"].lacks(case, later)


def test_beyond_the_border_no_change_of_the_size_does_harm_and_before_it_one_does() -> None:
    for group in range(1, 9):
        case, loop = draw_noise_loop(np.random.default_rng(group))
        border = noise_readings(case)["right"]
        for share, expected in ((0.8, False), (1.25, True)):
            # A narrow resonance at w, of the size, turned such that T Δ is negative there.
            w = share * border
            turned = 1 / loop.S_eta(1j * w)
            top = case.size * turned / abs(turned)
            num = 0.001 * w * np.array([top.real, -w * top.imag])
            shape = ct.tf(num, [1, 0.001 * w, w**2])
            assert shape(1j * w) == pytest.approx(top)
            plant = loop.process * (1 + shape)
            changed = NRDOB(plant, loop.model, loop.controller, loop.filter)
            assert changed.stability().observer_loop.stable is expected, (group, share)


def test_a_frequency_may_be_read_within_a_tenth_and_not_worse() -> None:
    for group in GROUPS:
        true = noise_readings(own_case("3.4", group))["right"]
        assert all(check("3.4", share * true, group).share == 1 for share in (0.91, 1, 1.1))
        assert all(check("3.4", share * true, group).share < 1 for share in (0.8, 1.25))


def test_every_gain_between_the_margins_is_a_counterexample() -> None:
    for group in GROUPS:
        case: GainCase = own_case("3.5", group)
        found = case.loop.margins()
        low, high = found.plant_loop.gm_high, found.observer_loop.gm_high
        for part in (0.02, 0.5, 0.98):
            assert accepts(PROBLEMS["3.5"], case, low ** (1 - part) * high**part) is True
        assert accepts(PROBLEMS["3.5"], case, 0.99 * low) is not True
        assert accepts(PROBLEMS["3.5"], case, 1.01 * high) is not True


@pytest.mark.thorough
def test_every_design_in_the_room_that_is_left_counts() -> None:
    for seed in GROUPS:
        case, good = draw_margin_loop(np.random.default_rng(seed))
        for share in (0.92, 1.0, 1.12):
            assert accepts(PROBLEMS["3.6"], case, LowPassFilter(share * good, 2)) is True
        for share in (0.65, 0.8, 1.2):
            assert accepts(PROBLEMS["3.6"], case, LowPassFilter(share * good, 2)) is not True
    assert SHARES[0] < 0.8 < SHARES[1] < 1 < SHARES[2]


def test_a_number_is_no_filter() -> None:
    assert "LowPassFilter" in check("3.6", 0.5, 1).text


@pytest.mark.thorough
@pytest.mark.parametrize("id", ["3.1", "3.4", "3.5", "3.6"])
def test_cases_are_found_for_every_group(id: str) -> None:
    for group in range(100):
        own_case(id, group)


def test_the_figure_tells_points_of_the_curve() -> None:
    figure = own_case("3.4", 1).plot()
    assert "rad/s" in figure.alt
    assert figure.png() == own_case("3.4", 1).plot().png()
