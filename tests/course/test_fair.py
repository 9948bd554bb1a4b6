"""Slips of honest students: each is read, or told as what it is; none is praised or refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import inf, log10, pi
from typing import Any

import numpy as np
import pytest
import sympy as sp

from nrdob import LowPassFilter
from nrdob.design import disturbance_index, noise_index
from nrdob_course.encoding import decode, encode
from nrdob_course.exercises import PROBLEMS, check, own_case, score
from nrdob_course.exercises.problems import Lack
from nrdob_course.exercises.reading import numbers
from nrdob_course.exercises.reviewing import HIDDEN, OTHER
from problemsets import SETS, accepts, posed, published

POSED = {this.id: this for path in SETS for this in posed(path)}
Answer = Callable[[Any], Any]


def judged(id: str, change: Answer, group: int = 2) -> Any:
    """What is said to the published answer, changed, as it is when it is graded."""
    right = published(POSED[id], group)
    answer = change(right) if PROBLEMS[id].own else lambda case: change(right(case))
    return score(id, answer, group, points=1, seed=910_000 + group).feedback


def shifted(case: Any, c: float) -> tuple[float, list[float], list[float]]:
    """The same K with c times the model: F' = c/(Df + c - 1)."""
    den = case.loop.filter.den
    return c, [c], [*map(float, den[:-1]), float(den[-1]) + c - 1]


# --- 1.5 and 4.6 --------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize("c", [-10.0, -1.0, -0.02, 20.0, 1e6])
def test_a_twin_with_an_unstable_filter_is_no_right_one_that_was_rounded(c: float) -> None:
    for group in range(1, 6):
        third = PROBLEMS["1.5"].cases(group, 40)
        [case] = [each for each in third if each.loop.filter.order == 3][:1]
        assert np.roots(shifted(case, c)[2]).real.max() > 0
        rounded = PROBLEMS["1.5"].rounded
        assert rounded and not rounded(case, PROBLEMS["1.5"].reads(shifted(case, c)))
        found = check("1.5", lambda case: shifted(case, c), group)
        if c < 0:  # of every order
            assert (found.recognised, found.share) == ("a filter that is unstable", 0.25)


@pytest.mark.parametrize("twin", [(0, 0), (0.0, [0.0], [1.0]), (1e-9, 1e-9), (1e-300, 1e-300)])
def test_a_twin_of_nothing_is_no_filter_scaled_along(twin: tuple[Any, ...]) -> None:
    assert score("1.5", lambda case: twin, 2, points=1, seed=11).feedback.share == 0


@pytest.mark.parametrize("answer", [(0, 0), (0, 3), (-3, -3), (1, 0)])
def test_no_model_or_no_filter_is_no_model_with_too_few_lags(answer: tuple[int, int]) -> None:
    assert score("5.5", lambda case: answer, 2, points=1, seed=11).feedback.share == 0


def test_a_twin_with_three_digits_is_told_that_it_is_rounded() -> None:
    def rounded(case: Any) -> Any:
        c, num, den = shifted(case, 2.0)
        return c, num, [float(f"{value:.3g}") for value in den]

    assert score("1.5", rounded, 2, points=1, seed=11).feedback.recognised == "rounded"


def test_equal_lags_miss_the_limits_where_they_are_causal_and_one_or_two_do_not() -> None:
    for group in range(1, 21):
        case = own_case("4.6", group)
        degree = case.model.poles().size
        for order in range(1, 8):
            # |S_η| ~ 1/λ, the error ~ λ: both are met for some λ if and only if their product is.
            met = noise_index(order) * disturbance_index(order) <= case.noise * case.error
            assert met or order > 2
            assert not met or order < degree
    assert "causal" in PROBLEMS["4.6"].praise
    [text] = [c.source for c in _cells("4.6") if c.id == "task-4-6"]
    assert re.search(r"No filter \$.+?\$ for which \$F/\\tilde G\$ is causal keeps to both", text)


def _cells(id: str) -> Any:
    import nbformat

    return nbformat.read(POSED[id].path, as_version=4).cells


# --- units, orders, gaps ------------------------------------------------------------------------


def in_decibels(value: float) -> float:
    return 20 * log10(value)


SLIPS: list[tuple[str, str, Answer, float]] = [
    ("1.3", "ascending powers", lambda p: p[::-1], 0.75),
    ("1.4", "hertz for rad/s", lambda gain: gain / (2 * pi), 0.5),
    ("1.4", "decibels", in_decibels, 0.75),
    ("3.1", "gains in decibels", lambda a: (in_decibels(a[0]), in_decibels(a[1]), a[2]), 0.75),
    ("3.1", "gains in decibels", lambda a: (-in_decibels(a[0]), in_decibels(a[1]), a[2]), 0.75),
    ("3.1", "low and high exchanged", lambda a: (a[1], a[0], a[2]), 0.75),
    ("3.3", "milliseconds", lambda value: 1000 * value, 0.75),
    ("3.4", "hertz for rad/s", lambda value: value / (2 * pi), 0.75),
    ("3.5", "decibels taken for a factor", in_decibels, 0.5),
    ("4.1", "milliseconds", lambda a: [1000 * value for value in a], 0.75),
    ("6.5", "decibels", lambda a: [in_decibels(value) for value in a], 0.75),
    ("6.5", "nan reported", lambda a: [None if value == inf else value for value in a], 0.5),
]


@pytest.mark.thorough
@pytest.mark.parametrize(("id", "name", "slip", "share"), SLIPS)
def test_a_unit_or_an_order_is_told_as_what_it_is(
    id: str, name: str, slip: Answer, share: float
) -> None:
    found = judged(id, slip)
    assert found.recognised == name, found.text
    assert found.share == pytest.approx(share)


def test_a_minus_between_the_two_terms_is_told() -> None:
    def mistaken(case: Any) -> Any:
        Df = LowPassFilter(case.time_constant, case.order).den
        first = np.polymul(np.polymul(case.D, case.Nm), np.polysub(Df, [1]))
        return np.polysub(first, np.polymul(case.N, case.Dm))

    assert check("1.3", mistaken, 3).recognised == "minus between the two terms"


@pytest.mark.thorough
def test_decibels_are_not_told_that_they_went_beyond_a_margin() -> None:
    for group in range(1, 9):
        found = judged("3.5", in_decibels, group)
        assert found.recognised == "decibels taken for a factor"
        case = own_case("3.5", group)
        beyond = 1.02 * case.loop.margins().observer_loop.gm_high
        assert not accepts(PROBLEMS["3.5"], case, beyond)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("id", "gap", "share"),
    [
        ("2.3", lambda a: [a[0], None, a[2]], 2 / 3),
        ("3.1", lambda a: [None, a[1], a[2]], 2 / 3),
        ("4.1", lambda a: [a[0], a[1], None, a[3]], 3 / 4),
        ("6.5", lambda a: [*a[:2], 17.0], 2 / 3),
        ("6.5", lambda a: [*a[:2], "one"], 2 / 3),
    ],
)
def test_each_number_counts_by_itself_whatever_the_others_are(
    id: str, gap: Answer, share: float
) -> None:
    assert judged(id, gap).share == pytest.approx(share)


@pytest.mark.thorough
def test_nan_for_every_filter_earns_nothing() -> None:
    assert judged("6.5", lambda a: [float("nan")] * len(a)).share == 0


# --- how an answer may be written ---------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("id", "dress"),
    [
        ("1.3", lambda p: sp.Poly([sp.Float(float(v), 17) for v in p], sp.Symbol("s"))),
        ("1.3", lambda p: sp.Poly([float(v) for v in p], sp.Symbol("x")).as_expr()),
        ("1.3", lambda p: ", ".join(repr(float(v)) for v in p)),
        ("1.5", lambda a: dict(zip(("c", "num", "den"), a, strict=True))),
        ("2.3", lambda a: dict(zip(("Z", "P", "N"), a[::-1], strict=True))),
        ("2.3", lambda a: "({}, {}, {})".format(*map(int, a))),
        ("2.3", lambda a: "{};{};{}".format(*map(float, a)).replace(".", ",")),
        ("3.1", lambda a: dict(zip(("high", "low", "Angle"), (a[1], a[0], a[2]), strict=True))),
        ("4.1", lambda a: "; ".join(map(str, a)).replace(".", ",")),
    ],
)
def test_dictionaries_texts_and_symbols_are_read(id: str, dress: Answer) -> None:
    assert judged(id, dress).share == 1
    # Also on the way from the process of the student's code to the one that judges.
    assert judged(id, lambda right: decode(encode(dress(right)))).share == 1


@pytest.mark.parametrize("given", ["1, 2", "1 2 3 4", "1, two, 3", "", {"N": 1, "P": 2}])
def test_what_is_not_three_numbers_is_refused(given: Any) -> None:
    with pytest.raises(ValueError, match="3 numbers are asked for"):
        numbers(given, "N, P, Z")


def test_numbers_in_a_message_have_four_digits() -> None:
    given = (np.float64(-4.095470971820237), np.int64(1), [np.float64(1 / 3)])
    found = judged("2.3", lambda a: given)
    assert "(-4.095, 1, [0.3333])" in found.text
    assert "np." not in found.text


# --- hidden cases -------------------------------------------------------------------------------


def own_case_only(id: str, group: int, otherwise: Answer) -> Answer:
    """Answer as one should, for the own case; the others otherwise."""
    right, own = published(POSED[id], group), str(own_case(id, group))
    return lambda case: right(case) if str(case) == own else otherwise(case)


def tells(case: Any) -> Any:
    raise ValueError(f"the case is {case}")


def tells_by_name(case: Any) -> Any:
    name = re.sub(r"\W", "_", str(case))
    raise type(f"E{name}", (Exception,), {})


@pytest.mark.thorough
@pytest.mark.parametrize("otherwise", [lambda case: 17.25, tells, tells_by_name, lambda case: None])
@pytest.mark.parametrize("id", ["1.1", "1.3", "2.1", "4.1", "5.3"])
def test_nothing_of_a_hidden_case_is_said(id: str, otherwise: Answer) -> None:
    found = score(id, own_case_only(id, 4, otherwise), 4, points=1, seed=77).feedback
    assert found.share < 1
    assert HIDDEN.partition(". ")[2] in found.text or OTHER in found.text
    for case in PROBLEMS[id].cases(77, 8):
        for number in re.findall(r"\d+\.\d+", str(case)):
            assert number not in found.text
        assert re.sub(r"\W", "_", str(case)) not in found.text
    # The own case is shown, and so are those of the check.
    assert str(own_case(id, 4)) in score(id, lambda case: 17.25, 4, points=1, seed=77).feedback.text


def test_what_a_filter_lacks_is_told_by_its_kind() -> None:
    case = own_case("1.5", 1)
    problem = PROBLEMS["1.5"]
    lack = problem.lacks(case, problem.reads(shifted(case, -1.0)))
    assert isinstance(lack, Lack) and lack.kind == "unusable"
    assert PROBLEMS["6.5"].parts is not None
