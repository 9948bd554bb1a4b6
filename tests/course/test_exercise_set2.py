"""Set 2, what is special about it: the reader counts, and a statement of the paper is refuted."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest

from nrdob import NRDOB, LowPassFilter
from nrdob.analysis import encirclements
from nrdob_course.exercises import own_case, score
from nrdob_course.exercises.cases import POINTS, alike, s
from nrdob_course.exercises.drawing import first_fitting
from nrdob_course.exercises.figures import draw_without_count
from nrdob_course.exercises.set2 import CLOSING, LITERAL, READING, UNTURNED
from problemsets import accepts, each_case

GROUPS = range(1, 13)
(FORGOTTEN,) = (
    each
    for each in CLOSING.misconceptions
    if each.name == "one of the two closing pieces forgotten"
)


def test_a_generator_that_never_fits_says_so() -> None:
    with pytest.raises(RuntimeError, match="none of 50 cases"):
        first_fitting(lambda: 1, lambda case: False, tries=50)


@pytest.mark.parametrize("group", GROUPS[:4])
def test_the_plot_does_not_tell_its_count(group: int) -> None:
    figure = draw_without_count(own_case("2.3", group).loop)
    (ax,) = np.ravel(figure.axes)
    written = [ax.get_title(loc=loc) for loc in ("left", "center", "right")]
    assert written == ["", "", ""]
    assert "turn" not in figure.alt
    plt.close(figure.figure)


@pytest.mark.thorough
def test_every_count_occurs_and_the_plot_hides_a_root() -> None:
    loops = [READING.cases(group, 1)[0].loop for group in range(40)]
    found = [loop.stability().observer_loop for loop in loops]
    assert {count.encirclements for count in found} == {-2, -1, 1, 2}
    for loop, count in zip(loops, found, strict=True):
        assert "cancels out of sight" in count.reason
        shown = loop.FH.to_tf().poles()
        assert np.sum(shown.real > 0) == count.open_loop_rhp - 1


@pytest.mark.thorough
@pytest.mark.parametrize("group", GROUPS)
def test_the_alt_text_of_the_plot_suffices_to_count(group: int) -> None:
    """Crossings left of -1, upwards less downwards, on both halves; the start lies on both."""
    loop = own_case("2.3", group).loop
    figure = draw_without_count(loop)
    plt.close(figure.figure)
    start, *crossings = figure.alt.split(": ")[1].split(", ")[:-1]
    ways = {"upwards": 1, "downwards": -1}
    at, way = (start.split()[k].replace("−", "-") for k in (3, -1))
    turns = ways[way] if float(at) < -1 else 0
    for crossing in crossings:
        at, way = (crossing.split()[k].replace("−", "-") for k in (-2, -1))
        turns += 2 * ways[way] if float(at) < -1 else 0
    assert turns == loop.stability().observer_loop.encirclements


@pytest.mark.thorough
@each_case(CLOSING, 12)
def test_the_closed_curve_has_data_enough(case: object) -> None:
    curve = 1 + case.values  # type: ignore[attr-defined]
    steps = np.abs(np.angle(curve[1:] / curve[:-1]))
    assert steps.max() < 0.5


@pytest.mark.thorough
@pytest.mark.parametrize("whole", [float, round], ids=["as it is", "rounded"])
@pytest.mark.parametrize("group", GROUPS[:5])
def test_a_piece_of_the_path_forgotten_is_told_though_it_was_rounded(group: int, whole) -> None:
    """Half a turn less may be rounded to the number that `int` leaves; never to worse marks."""
    for number in (0, 1):

        def forgetful(case: object, number: int = number) -> float:
            return whole(FORGOTTEN.several(case)[number])

        feedback = score("2.4", forgetful, group, points=1, seed=group).feedback
        assert feedback.recognised == FORGOTTEN.name or (
            whole is round and feedback.recognised == "cut off instead of rounded"
        )
        assert feedback.share >= FORGOTTEN.marks


@each_case(LITERAL, 4)
def test_a_pole_that_the_controller_cancels_is_a_counterexample_too(case: object) -> None:
    pole, plant = case.pole, case.process  # type: ignore[attr-defined]
    hidden = NRDOB(
        plant, 1 / (s - pole), (s - pole) / (s * (s + 3 * pole)), LowPassFilter(0.1 / pole, 1)
    )
    assert accepts(LITERAL, case, hidden) is True
    held = NRDOB(plant, 1 / (s - pole), 2 * pole, LowPassFilter(0.1 / pole, 2))
    assert accepts(LITERAL, case, held) is True


def stand_in(plant: ct.TransferFunction) -> ct.TransferFunction:
    """A stable plant with the values of another one where functions of s are compared."""
    poles, values = -np.geomspace(0.3, 300, 2 * POINTS.size), plant(POINTS)
    lags = poles / (poles - POINTS[:, None]) / values[:, None]  # those of the plant are then 1
    wanted = np.repeat([1.0, 0.0], POINTS.size)
    gains = np.linalg.lstsq(np.concatenate([lags.real, lags.imag]), wanted, rcond=1e-15)[0]
    num = sum(-k * p * np.poly(np.setdiff1d(poles, p)) for k, p in zip(gains, poles, strict=True))
    return ct.tf(num, np.poly(poles))


@pytest.mark.parametrize("group", GROUPS[:4])
def test_a_loop_is_judged_around_the_plant_and_not_around_what_resembles_it(group: int) -> None:
    plant = stand_in(own_case("2.6", group).process)
    assert alike(plant, own_case("2.6", group).process)
    loops = (
        NRDOB(plant, ct.tf([gain], [1.0, 1.0]), 0, LowPassFilter(1.0, 2))
        for gain in np.outer(10.0 ** np.arange(-3, 7), [1, -1]).ravel()
    )
    simple = next(loop for loop in loops if loop.stability().stable)
    assert not accepts(UNTURNED, own_case("2.6", group), simple)


@each_case(UNTURNED, 6)
def test_no_stable_model_makes_the_turn(case: object) -> None:
    """Count the turns of H for three models of either sign: never the one that is said needed."""
    plant = case.process  # type: ignore[attr-defined]
    for poles in ([-1.0, -2.0], [-0.3, -0.5, -40.0], [-2 + 3j, -2 - 3j]):
        for gain in (0.7, -0.7):
            model = ([gain], np.real(np.poly(poles)))
            count = encirclements(NRDOB(plant, model, 0, LowPassFilter(0.1, 3)).H)
            assert (count.encirclements, count.open_loop_rhp) == (0, 1)
