"""The core of the graders: what is the same, what is blank, and what an answer may do to them."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import control as ct
import numpy as np
import pytest

from nrdob.diagram import delay
from nrdob_course.exercises import PROBLEMS, check, own_case, score
from nrdob_course.exercises.comparing import rounds, same, unlike
from nrdob_course.exercises.drawing import few
from nrdob_course.exercises.problems import (
    BUDGET,
    Feedback,
    Lack,
    Misconception,
    Points,
    Problem,
    any_of,
    lacking,
    pose,
)
from nrdob_course.exercises.reading import numbers
from nrdob_course.exercises.reviewing import BLANK, HARD_CODED, TOO_SLOW, review
from problemsets import accepts


@dataclass(frozen=True)
class Square:
    """A square, whose area is asked for."""

    side: float
    notes: list[float] = field(default_factory=list, compare=False)

    def __str__(self) -> str:
        return f"side {self.side:.3f}"


def judged(case: Square, got: Any) -> str:
    return "" if same(case.side**2, got) else "the area of a square of side 1 is 1"


TEXTS = {
    "title": "Area of a square",
    "praise": "Right: the side, squared.",
    "misconceptions": {
        "circumference": {"says": "That is the way around.", "marks": "1/4"},
        "negative": {"says": "An area is not negative.", "marks": 0.1},
    },
}


def without_texts(**says: str) -> dict[str, Any]:
    texts = {name: {"says": words, "marks": 0.25} for name, words in says.items()}
    return {"title": "", "praise": "Right.", "misconceptions": texts}


AREA = pose(
    "0.1",
    texts=TEXTS,
    case=lambda rng: Square(rng.uniform(1, 9)),
    lacks=judged,
    misconceptions={
        "circumference": lambda case: 4 * case.side,
        "negative": Misconception(lambda case: -1.0, lambda case, got: got < 0),
    },
)
CASES = AREA.cases(1, 5)


# --- the same -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("expected", "got"),
    [
        (1, 1.0),
        (1.0, 1.00005),
        (1, np.float64(1)),
        (1j, np.complex128(1j)),
        (0.0, 1e-13),
        (math.inf, math.inf),
        (math.nan, math.nan),
        ([1, 2], (1, 2)),
        ([1, 2], np.array([1, 2])),
        ([1e5, 0], [1e5, 1e-6]),  # zero but for rounding
        ((2, "stable"), [2.00001, "stable"]),
        ((None, 1.0), (None, 1.00001)),
        (True, np.True_),
        ("stable", "stable"),
        ({"N": 1}, {"N": 1}),
        ([], []),
    ],
)
def test_the_same(expected: Any, got: Any) -> None:
    assert same(expected, got) is True


@pytest.mark.parametrize(
    ("expected", "got"),
    [
        (1, 1.001),
        (1, True),
        (True, 1),
        (False, None),
        (1, "1"),
        ("1", 1),
        ([1, 2], ["1", "2"]),
        ([1, 0], [True, False]),
        ([1, 2], [1, 2, 3]),
        ([1, 2], 1),
        ((None, 1.0), (None, 1.1)),
        ((None, 1.0), (1.0, None)),
        (3e-10, 0.0),  # small is not zero
        (0.0, 1e-6),
        (math.inf, -math.inf),
        (math.inf, 1e300),
        (1.0, math.inf),
        (1.0, math.nan),
        (1.0, {"a": 1.0}),
        (1.0, lambda case: 1.0),
        (("stable", 1), np.array([1, 2])),
        ([[1], [2, 3]], [[1], [2, 4]]),
    ],
)
def test_not_the_same(expected: Any, got: Any) -> None:
    assert same(expected, got) is False


# --- an answer that is right, blank, mistaken ---------------------------------------------------


def test_a_right_answer_is_praised() -> None:
    assert review(AREA, lambda case: case.side**2, CASES) == Feedback(1.0, AREA.praise)


def not_written(case: Square) -> float:
    raise NotImplementedError


@pytest.mark.parametrize("blank", [None, ..., not_written])
def test_a_blank_answer_gets_nothing_and_is_told_so(blank: Any) -> None:
    assert review(AREA, blank, CASES) == Feedback(0.0, BLANK)


@pytest.mark.parametrize("nothing", [lambda case: None, lambda case: ...])
def test_a_function_without_return_is_told_so(nothing: Any) -> None:
    assert "returns nothing" in review(AREA, nothing, CASES).text


def test_a_search_that_finds_nothing_in_one_case_is_told_in_which() -> None:
    last = max(CASES, key=lambda case: case.side)
    found = review(AREA, lambda case: None if case == last else case.side**2, [*CASES[1:], last])
    assert found.share == 0
    assert f"nothing for {last}" in found.text


def test_a_value_is_no_function() -> None:
    assert "must be a function" in review(AREA, 16.0, CASES).text


@pytest.mark.parametrize("misconception", AREA.misconceptions, ids=lambda m: m.name)
def test_a_misconception_is_recognised_and_gets_its_marks(misconception: Misconception) -> None:
    found = review(AREA, misconception.example, CASES)
    assert found == Feedback(misconception.marks, misconception.says, misconception.name)


def test_a_misconception_that_shows_in_some_cases_only_is_recognised() -> None:
    def partly(case: Square) -> float:
        return case.side**2 if case == CASES[0] else 4 * case.side

    assert review(AREA, partly, CASES).recognised == "circumference"


def test_two_kinds_of_mistake_at_once_are_not_taken_for_one() -> None:
    def mixed(case: Square) -> float:
        return 4 * case.side if case == CASES[0] else -1.0

    assert review(AREA, mixed, CASES).recognised == ""


@pytest.mark.parametrize(
    ("answer", "shown"),
    [
        (ct.tf([1], [1, 2, 1]), "the answer 1/(s + 1)² fails"),
        (delay(0.5) * ct.tf([1], [1, 1]), "the answer exp(−0.5s) 1/(s + 1) fails"),
        (ct.ss(-1, 1, 1, 0), "the answer an object of type StateSpace fails"),
        (ct.tf([[[1], [2]]], [[[1, 1], [1, 2]]]), "(a system with inputs: 2, outputs: 1)"),
    ],
)
def test_a_block_is_shown_without_the_number_that_counts_blocks(answer, shown) -> None:
    said = str(check("4.3", lambda case: answer, 1))
    assert shown in said and "sys[" not in said


def test_a_function_is_shown_without_its_address() -> None:
    assert "the answer (a function) fails" in review(AREA, lambda case: judged, CASES).text


def test_another_wrong_answer_is_shown_with_its_case_and_the_reason() -> None:
    found = review(AREA, lambda case: 7 * case.side**2, CASES)
    assert found.share == 0
    assert str(CASES[0]) in found.text
    assert "of side 1 is 1" in found.text


def test_a_number_of_the_first_case_is_recognised_as_hard_coded() -> None:
    assert review(AREA, lambda case: CASES[0].side ** 2, CASES) == Feedback(
        0.0, HARD_CODED, "hard-coded"
    )


def test_a_constant_that_is_always_wrong_is_not_called_hard_coded() -> None:
    assert review(AREA, lambda case: 1000.0, CASES).recognised == ""


def test_a_misconception_may_be_known_by_what_its_answers_lack() -> None:
    def signed(case: Square, got: float) -> str:
        return judged(case, got) and Lack("sign" if got < 0 else "size", judged(case, got))

    area = pose(
        "0.2",
        texts=without_texts(negative="An area is not negative."),
        case=AREA.case,
        lacks=signed,
        misconceptions={"negative": lacking("sign", lambda case: -1.0)},
    )
    found = review(area, lambda case: -case.side, CASES)
    assert found == Feedback(0.25, "An area is not negative.", "negative")
    assert review(area, lambda case: 1e9, CASES).recognised == ""
    # Without a word for it, what an answer lacks is no kind.
    assert review(replace(area, lacks=judged), lambda case: -1.0, CASES).recognised == ""


def test_one_of_several_answers_is_recognised_and_the_first_is_the_example() -> None:
    area = pose(
        "0.2",
        texts=without_texts(around="Around."),
        case=AREA.case,
        lacks=judged,
        misconceptions={"around": any_of(lambda case: [4 * case.side, 2 * case.side])},
        alike=partial(same, rtol=0.1),
    )
    [around] = area.misconceptions
    assert around.example(CASES[0]) == 4 * CASES[0].side
    for share, recognised in ((4, "around"), (2, "around"), (2.1, "around"), (3, "")):
        found = review(area, lambda case, share=share: share * case.side, CASES)
        assert found.recognised == recognised


def test_a_misconception_without_a_text_and_a_text_without_one_are_named() -> None:
    for misconceptions in ({}, {"twice": lambda case: 2.0, "thrice": lambda case: 3.0}):
        with pytest.raises(
            ValueError, match=r"problem 0\.2: (twice|thrice): in the texts of its set, or"
        ):
            pose(
                "0.2",
                texts=without_texts(twice="That is half."),
                lacks=judged,
                case=AREA.case,
                misconceptions=misconceptions,
            )


@pytest.mark.parametrize("verdict", [True, False, None, np.bool_(True)])
def test_a_grader_that_gives_no_sentence_says_so_at_once(verdict: Any) -> None:
    # True would read as lacking something, False as a sentence without words.
    unclear = Problem("0.2", "", AREA.case, lambda case, got: verdict, "Right.")
    with pytest.raises(TypeError, match=r"problem 0\.2.* sentence"):
        review(unclear, lambda case: 1, CASES)


def test_a_problem_accepts_what_lacks_nothing() -> None:
    assert accepts(AREA, CASES[0], CASES[0].side ** 2) is True
    assert accepts(AREA, CASES[0], -1.0) is False


# --- answers that misbehave ---------------------------------------------------------------------


def faulty(case: Square) -> float:
    return case.side / 0


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (faulty, "ZeroDivisionError"),
        (lambda: 1, "TypeError"),
        (lambda case: case.edge, "AttributeError"),
        (lambda case: sys.exit(3), "SystemExit"),
        (lambda case: recursion(case), "RecursionError"),
    ],
)
def test_an_error_is_told_with_its_case(answer: Any, says: str) -> None:
    found = review(AREA, answer, CASES)
    assert found.share == 0
    assert says in found.text and str(CASES[0]) in found.text


def recursion(case: Square) -> float:
    return recursion(case)


def test_the_line_of_an_error_is_shown() -> None:
    assert "return case.side / 0" in review(AREA, faulty, CASES).text


def test_an_interrupt_is_not_swallowed() -> None:
    def endless(case: Square) -> float:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        review(AREA, endless, CASES)


class Nasty:
    def __str__(self) -> str:
        raise RuntimeError

    __repr__ = __str__

    def __eq__(self, other: object) -> bool:
        raise RuntimeError

    __hash__ = None  # type: ignore[assignment]


@pytest.mark.parametrize(
    "got", ["x" * 10**6, list(range(10**5)), Nasty(), {"a": 1}, {1}, b"1", object(), np.array("?")]
)
def test_whatever_is_returned_gives_a_short_message(got: Any) -> None:
    found = review(AREA, lambda case: got, CASES)
    assert found.share == 0
    assert len(found.text) < 500


def test_an_answer_that_changes_its_case_is_judged_on_the_case_it_was_given() -> None:
    problem = Problem(
        "0.3",
        "",
        case=lambda rng: Square(rng.uniform(1, 9), [1.0, 2.0]),
        lacks=lambda case, got: "" if same(sum(case.notes), got) else "another sum",
        praise="Right.",
    )

    def careless(case: Square) -> float:
        case.notes.append(7.0)
        return sum(case.notes)

    assert review(problem, careless, problem.cases(1, 2)).share == 0


def test_warnings_of_an_answer_do_not_reach_stderr() -> None:
    def warns(case: Square) -> float:
        warnings.warn("careful", stacklevel=1)
        return case.side**2

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert review(AREA, warns, CASES).share == 1


# --- cases, and an own value --------------------------------------------------------------------


def test_cases_depend_on_problem_and_seed_only() -> None:
    assert AREA.cases(3, 4) == AREA.cases(3, 4)
    assert AREA.cases(3, 4)[:2] == AREA.cases(3, 2)
    assert AREA.cases(3, 1) != AREA.cases(4, 1)
    other = Problem("0.9", "", AREA.case, AREA.lacks, "")
    assert other.cases(3, 1) != AREA.cases(3, 1)


def test_cases_are_drawn_once_whoever_asks_and_nobody_changes_those_of_another() -> None:
    drawn: list[Square] = []

    def draw(rng: np.random.Generator) -> Square:
        drawn.append(Square(rng.uniform(1, 9)))
        return drawn[-1]

    counted = replace(AREA, case=draw)
    first = counted.cases(3, 4)
    first[0].notes.append(7.0)
    assert counted.cases(3, 4)[0].notes == []
    assert counted.cases("3", 4) == first
    assert len(drawn) == 4


def test_an_answer_is_asked_once_for_each_case_and_judged_once() -> None:
    asked: list[Square] = []
    judged_of: list[Square] = []

    def answer(case: Square) -> float:
        asked.append(case)
        return -7.0

    def lacks(case: Square, got: float) -> str:
        judged_of.append(case)
        return judged(case, got)

    review(replace(AREA, lacks=lacks), answer, CASES)
    assert asked == judged_of == CASES


@pytest.mark.parametrize("seed", [7.0, "7", np.int64(7), np.float64(7)])
def test_a_number_written_otherwise_is_the_same_group(seed: Any) -> None:
    assert AREA.cases(seed, 2) == AREA.cases(7, 2)


@pytest.mark.parametrize("seed", [None, ..., "seven", 7.5, -1, 10**30, math.nan, math.inf, [7]])
def test_a_group_that_is_no_number_does_not_stop_the_grading(seed: Any) -> None:
    assert len(AREA.cases(seed, 2)) == 2


def test_a_value_for_the_own_case_is_judged_on_that_case_alone() -> None:
    own = Problem("0.4", "", AREA.case, judged, "Right.", AREA.misconceptions, own=True)
    mine = own.cases(5, 1)[0]
    assert review(own, mine.side**2, own.cases(5, 4)).share == 1
    assert review(own, 4 * mine.side, own.cases(5, 4)).share == 0.25
    assert review(own, None, own.cases(5, 4)).text == BLANK
    # One case cannot show that a number is hard-coded: it is asked for.
    assert review(own, 1000.0, own.cases(5, 4)).recognised == ""


# --- parts, digits, dress -----------------------------------------------------------------------

SIDES = pose(
    "0.5",
    texts=without_texts(twice="That is half."),
    case=AREA.case,
    lacks=lambda case, got: (
        "" if same([4 * case.side, case.side**2], got) else "one of the two is wrong"
    ),
    misconceptions={"twice": lambda case: [2 * case.side, case.side**2]},
    reads=partial(numbers, names="around, area"),
    parts=lambda case, got: unlike(
        (4 * case.side, case.side**2), got, {"around": "too short", "area": "too small"}
    ),
    rounded=lambda case, got: rounds([4 * case.side, case.side**2], got),
)


def test_independent_parts_are_marked_apart() -> None:
    found = review(SIDES, lambda case: (4 * case.side, 1000.0), CASES)
    assert found.share == 0.5
    assert found.notes == ("Right in every case: around.",)
    assert review(SIDES, lambda case: (1000.0, 1000.0), CASES).share == 0


def test_a_part_must_be_right_in_every_case() -> None:
    def once(case: Square) -> tuple[float, float]:
        return 4 * case.side, case.side**2 if case == CASES[0] else -1.0

    assert review(SIDES, once, CASES).share == 0.5


def test_a_mistake_that_is_known_earns_no_less_than_one_that_is_not() -> None:
    found = review(SIDES, lambda case: (2 * case.side, case.side**2), CASES)
    assert (found.share, found.recognised) == (0.5, "twice")


@pytest.mark.parametrize(("digits", "share"), [(2, 0.75), (3, 0.75), (4, 1), (6, 1)])
def test_rounding_costs_a_quarter_and_is_called_so(digits: int, share: float) -> None:
    found = review(
        SIDES, lambda case: [few(x, digits) for x in (4 * case.side, case.side**2)], CASES
    )
    assert found.share == share
    assert ("rounded" in found.text) is (share < 1)


def test_what_cannot_be_read_is_told_in_the_words_of_the_reader() -> None:
    text = review(SIDES, lambda case: 7.0, CASES).text
    assert text.endswith(
        "2 numbers are asked for, (around, area), in a list or a tuple; this is a float"
    )


def test_kinds_of_cases_take_turns_and_either_may_be_the_first() -> None:
    kinds = replace(AREA, case=(lambda rng: "near", lambda rng: "far"))
    drawn = {tuple(kinds.cases(seed, 4)) for seed in range(20)}
    assert drawn == {("near", "far") * 2, ("far", "near") * 2}
    assert kinds.cases(3, 2) == kinds.cases(3, 5)[:2]


# --- check and score ----------------------------------------------------------------------------


class Clock:
    """A clock that answers set forward."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        monkeypatch.setattr("nrdob_course.exercises.reviewing.time.perf_counter", lambda: self.now)

    def answer(self, seconds: float) -> Any:
        def slow(case: Square) -> float:
            self.now += seconds
            return case.side**2

        return slow


@pytest.fixture
def area(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PROBLEMS, AREA.id, AREA)


@pytest.mark.usefixtures("area")
class TestCheckAndScore:
    def test_the_time_is_told_that_the_graded_answer_will_take(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        found = check("0.1", Clock(monkeypatch).answer(4.0), 3)
        assert found.share == 1
        assert repr(found).endswith("When it is graded it takes about 36 s of the 60 s allowed.")
        assert "36 s of the 60 s" in found._repr_html_()

    def test_what_is_too_slow_is_not_called_right(self, monkeypatch: pytest.MonkeyPatch) -> None:
        found = check("0.1", Clock(monkeypatch).answer(7.0), 3)
        assert (found.share, found.text) == (0, TOO_SLOW)
        assert f"63 s of the {BUDGET:g} s" in repr(found)

    def test_little_time_is_not_talked_about(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert repr(check("0.1", Clock(monkeypatch).answer(0.1), 3)) == AREA.praise

    def test_nothing_is_checked_while_it_is_graded(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("NBGRADER_EXECUTION", "autograde")
        asked: list[Square] = []
        assert "Not checked" in check("0.1", asked.append, 3).text
        assert asked == []
        assert score("0.1", lambda case: case.side**2, 3, points=4, seed=1) == 4

    def test_a_group_that_was_not_written_down_is_remarked(self) -> None:
        assert "group 0" in repr(check("0.1", lambda case: case.side**2, 0))
        assert "group 0" not in repr(check("0.1", lambda case: case.side**2, 1))

    def test_right(self) -> None:
        assert check("0.1", lambda case: case.side**2, 3).share == 1
        assert score("0.1", lambda case: case.side**2, 3, points=4, seed=1) == 4

    def test_marks(self) -> None:
        assert score("0.1", lambda case: 4 * case.side, 3, points=4, seed=1) == 1

    def test_hard_coding_of_the_visible_cases_is_caught(self) -> None:
        seen = {case.side: case.side**2 for case in AREA.cases(3, 4)}

        def table(case: Square) -> float:
            return seen.get(case.side, 0.0)

        assert check("0.1", table, 3).share == 1
        assert score("0.1", table, 3, points=4, seed=1) == 0

    def test_the_own_case_counts_too(self) -> None:
        own = own_case("0.1", 3)

        def all_but_the_own(case: Square) -> float:
            return -2.0 if case == own else case.side**2

        assert score("0.1", all_but_the_own, 3, points=4, seed=1) < 4

    @pytest.mark.parametrize(
        "wrong", [AREA.misconceptions[0].example, lambda case: 1.01 * case.side**2]
    )
    def test_a_mistake_is_not_named_that_the_own_case_alone_shows(
        self, wrong: Callable[[Square], float], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        roughly = replace(AREA, rounded=lambda case, got: same(case.side**2, got, rtol=0.02))
        monkeypatch.setitem(PROBLEMS, "0.1", roughly)
        own = own_case("0.1", 3)

        def answer(case: Square) -> float:
            return wrong(case) if case == own else 1000.0

        points = score("0.1", answer, 3, points=4, seed=1)
        assert (points, points.feedback.recognised) == (0, "")
        assert points.feedback.text.startswith(f"Not yet. For {own} the answer")

    def test_points_are_a_number_to_nbgrader_and_words_to_the_reader(self) -> None:
        points = score("0.1", lambda case: 4 * case.side, 3, points=4, seed=1)
        assert isinstance(points, Points)
        assert float(repr(points)) == 1
        assert "1 of 4 points" in points._repr_html_()
        assert "That is the way around." in points._repr_html_()

    def test_what_an_answer_prints_stays_out_of_the_score(self, capfd: Any) -> None:
        def chatty(case: Square) -> float:
            print("side", case.side)
            print("area", case.side**2, file=sys.stderr)
            return case.side**2

        assert score("0.1", chatty, 3, points=4, seed=1) == 4
        assert capfd.readouterr() == ("", "")


def test_an_unknown_problem_is_named_with_the_known_ones() -> None:
    with pytest.raises(KeyError, match=r"no problem '9\.9'.*2\.1"):
        check("9.9", None, 1)


def test_feedback_reads_as_its_text_and_escapes_it() -> None:
    assert repr(Feedback(0.0, "a < b")) == "a < b"
    assert "a &lt; b" in Feedback(0.0, "a < b")._repr_html_()
    assert "✓" in Feedback(1.0, "yes")._repr_html_()
