"""Set 6: what its texts and its solutions by hand say, beyond what every set is asked."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import control as ct
import numpy as np
import pytest

from nrdob import NRDOB, LowPassFilter, stabilizing_time_constants
from nrdob_course.exercises import PROBLEMS, check, own_case
from nrdob_course.exercises.set6 import (
    STAGES,
    Project,
    controller_of,
    ends_of_quiet,
    loop_of,
    mirrored_model,
    rms,
    survives,
)

GROUPS = range(1, 13)


@pytest.mark.parametrize("seed", range(12))
def test_the_lag_must_be_shorter_than_half_the_time_of_the_unstable_pole(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, g, share = 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-1, 1), rng.uniform(0.05, 0.9)
    lag = share / p
    model = ct.tf([1.0], [1.0, p])
    plant = g * ct.tf([1.0], np.polymul([1.0, -p], [lag, 1.0]))
    found = stabilizing_time_constants(plant, model, 1)
    if share > 0.5:
        assert found == []
    else:
        ((low, high),) = found
        assert low == 0
        assert high == pytest.approx(g / p * (1 - 2 * share) / (1 - share))


@pytest.mark.thorough
@pytest.mark.parametrize("group", GROUPS)
def test_the_project_is_about_one_plant(group: int) -> None:
    figure, project = own_case("6.2", group), own_case("6.6", group)
    assert repr(figure) == repr(project)
    for name in ("plant", "modified"):
        first, second = (getattr(case, name)([1, 2j]) for case in (figure, project))
        assert np.array_equal(first, second)


@pytest.mark.thorough
@pytest.mark.parametrize("group", GROUPS)
def test_the_figure_shows_what_the_package_finds(group: int) -> None:
    case = own_case("6.2", group)
    found = ends_of_quiet(case)
    for plant, value in (
        (case.modified, found["slow"]),
        (case.modified, found["fast"]),
        (case.plant, found["nominal"]),
    ):
        ms = NRDOB(plant, case.model, 0.0, LowPassFilter(value, 3)).margins().plant_loop.ms
        assert ms == pytest.approx(case.max_ms, rel=2e-3)
    assert f"to {1000 * found['slow']:.3g} ms" in case.plot().alt


@pytest.mark.parametrize("group", GROUPS)
def test_noise_is_the_norm_that_the_text_names(group: int) -> None:
    case = own_case("6.6", group)
    loop = loop_of(case, 0.07)
    assert rms(loop.U_eta) == pytest.approx(ct.norm(loop.U_eta.to_tf(), 2), rel=1e-6)
    assert rms(replace(loop, filter=LowPassFilter(0.07 / case.pole, 2)).U_eta) == inf


def test_every_stage_earns_a_point_more() -> None:
    problem = PROBLEMS["6.6"]
    marks = {kind.name: 7 * kind.marks for kind in problem.misconceptions}
    earned = [
        marks[name]
        for name in (
            "controller for the plant, not for the model",
            "Ms above its limit",
            "disturbances not held",
            "reference too slow",
            "unstable with a changed plant",
            "too much noise in u",
        )
    ]
    assert earned == pytest.approx([1, 2, 3, 4, 5, 6])
    assert len(STAGES) == 7


@pytest.mark.parametrize("group", GROUPS[:3])
def test_a_root_on_the_axis_earns_no_more_than_one_beyond_it(group: int) -> None:
    case, s = own_case("6.6", group), ct.tf("s")
    model = mirrored_model(case)
    # A zero of the model at s = 0 cancels the integrator of C: there p_A has a root.
    design = model * s / (s + 1), np.sign(model.dcgain()) / s, LowPassFilter(0.07 / case.pole, 3)
    assert NRDOB(case.plant, *design).stability().stable is False
    assert check("6.6", design, group).recognised == "controller for the plant, not for the model"
    assert [goal.met for goal in case.goals(*design)] == [False, True]


def passing(case: Project, order: int, gain: float) -> list[float]:
    """Tell the λ of a scan with which a design of another kind meets everything."""
    model, controller = gain * mirrored_model(case), (1 / gain) * controller_of(case)
    tried = np.geomspace(0.02, 0.2, 40) / case.pole
    return [
        float(value)
        for value in tried
        if all(
            goal.met for goal in case.goals(model, controller, LowPassFilter(float(value), order))
        )
    ]


@pytest.mark.thorough
@pytest.mark.parametrize("group", [1, 2, 3])
def test_more_than_one_design_counts_and_not_every_one(group: int) -> None:
    case = own_case("6.6", group)
    for order, gain in ((3, 1.0), (4, 1.0)):
        good = passing(case, order, gain)
        assert good, "there is room"
        assert len(good) < 12, "but not much"
        design = (
            gain * mirrored_model(case),
            (1 / gain) * controller_of(case),
            LowPassFilter(good[0], order),
        )
        assert check("6.6", design, group).share == 1


@pytest.mark.thorough
@pytest.mark.parametrize("group", GROUPS)
def test_the_modified_plant_survives_and_its_neighbour_does_not(group: int) -> None:
    for case in PROBLEMS["6.4"].cases(group, 3):
        assert survives(case, 1, 0)
        assert survives(case, case.gain, case.lag)
        assert survives(case, 1, case.lag) is False


@pytest.mark.parametrize("group", range(1, 5))
def test_a_good_design_does_on_the_bench_what_a_slow_one_does_not(
    group: int, capsys: pytest.CaptureFixture[str]
) -> None:
    case = own_case("6.6", group)
    for filter, met in ((0.07, True), (0.25, False)):
        loop = loop_of(case, filter)
        case.on_bench(loop.model, loop.controller, loop.filter)
        lines = capsys.readouterr().out.splitlines()[1:]
        assert all("not met" not in line for line in lines) is met
    assert 1 - np.exp(-1) < case.max_input < 1  # less than the load, and enough for some loop
