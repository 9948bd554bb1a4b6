"""Set 5, what is special about it: other ways to the same properties, and pictures to be read."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

from nrdob import NRDOB, LowPassFilter, stabilizing_time_constants
from nrdob_course.exercises import own_case
from nrdob_course.exercises.cases import s
from nrdob_course.exercises.set5 import (
    ADVICE,
    BORDER,
    DESIGN,
    EDGE,
    SIGN,
    borders_read,
    draw_edge,
    edge_of,
    side_of,
)
from problemsets import accepts, each_case


@each_case(SIGN, 4)
def test_with_the_other_sign_no_filter_stabilises(case: Any) -> None:
    """Ask the exact sets, which know nothing of parity."""
    for process, model in case.pairs:
        sets = [stabilizing_time_constants(process, k * model, 2) for k in (1, -1)]
        assert [] in sets


@each_case(BORDER, 3)
@pytest.mark.parametrize(("factor", "right"), [(1.0005, True), (0.9995, True), (1.003, False)])
def test_the_border_is_wanted_to_one_part_in_a_thousand(
    case: Any, factor: float, right: bool
) -> None:
    assert (accepts(BORDER, case, factor * borders_read(case)["true"]) is True) is right


@each_case(EDGE, 6)
def test_an_edge_may_be_read_with_the_eye(case: Any) -> None:
    value, _ = edge_of(case)
    for factor in (0.93, 1.07):
        assert accepts(EDGE, case, (factor * value, side_of(case))) is True
    for factor in (0.7, 1.4):
        assert accepts(EDGE, case, [factor * value, side_of(case)]) is not True


@pytest.mark.parametrize("group", range(1, 7))
def test_the_edge_lies_between_marks(group: int) -> None:
    """The alt text names points of both curves before the crossing, and beyond it."""
    case = own_case("5.4", group)
    value, omega = edge_of(case)
    figure = draw_edge(case)
    frequencies, points = figure.alt.split(". −Γ₂ passes x = ")
    plt.close(figure.figure)
    marks = [float(part.split(" rad/s")[0]) for part in frequencies.split("ω = ")[1].split(", ")]
    x = [float(part.split(" at ")[0]) for part in points.split(", ")]
    assert marks[0] < omega < marks[-1]
    assert x[0] < value * omega < x[-1]
    assert len({np.sign(mark - omega) for mark in marks}) == 2
    assert len(marks) < 14 and len(x) < 20


@each_case(ADVICE, 4)
def test_every_order_above_the_lowest_refutes_the_advice(case: Any) -> None:
    for lags in (1, 2):
        model = case.gain / ((s + case.pole) * (s + case.decay) * (s / 50 + 1) ** lags)
        assert accepts(ADVICE, case, (model, 2 + lags)) is not True
        for order in (3 + lags, 4 + lags):
            assert accepts(ADVICE, case, (model, order)) is True
        assert accepts(ADVICE, case, (model, float(3 + lags))) is True


@pytest.mark.thorough
@each_case(DESIGN, 4)
def test_other_designs_count_as_well(case: Any) -> None:
    k, p, a = case.gain, case.pole, case.decay
    model = k / ((s + p) * (s / a + 1))
    for value, order in ((0.09, 2), (0.13, 2), (0.08, 3)):
        for C in (p / (k * s), 0.5 * p * (s + p) / (k * s)):
            loop = NRDOB(case.process, model, C, LowPassFilter(value / p, order))
            assert accepts(DESIGN, case, loop) is True
    slow = NRDOB(case.process, model, p / (k * s), LowPassFilter(0.3 / p, 2))
    assert "a faster filter lowers it" in DESIGN.lacks(case, slow)
    without = NRDOB(case.process, model, 0, LowPassFilter(0.1 / p, 2))
    assert "comes to rest at 0" in DESIGN.lacks(case, without)
