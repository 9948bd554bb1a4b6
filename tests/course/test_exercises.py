"""Every problem of every set: what is published, left blank or mistaken gets what it deserves.

The cells run in this process, without a kernel. That the pipeline around them works, with
nbgrader and kernels, is asked in ``test_course.py``.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbgrader.nbgraderformat import MetadataValidator

from nrdob_course.exercises import PROBLEMS, Misconception, own_case
from nrdob_course.exercises.reviewing import BLANK, HARD_CODED, NOTHING, ROUNDED
from problemsets import SETS, Posed, calls, cells, nbgrader, posed, published, run

# More groups, with other seeds: tests/campaigns/misconceptions.py.
GROUPS_AND_SEEDS = [(1, 11), pytest.param(7, 13, marks=pytest.mark.thorough)]

ALL = [problem for path in SETS for problem in posed(path)]
each_set = pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
each_problem = pytest.mark.parametrize("this", ALL, ids=lambda this: this.id)
# Where the answer is a value for the own case, there is no other to try it on.
each_problem_of_many_cases = pytest.mark.parametrize(
    "this",
    [this for this in ALL if this.id in PROBLEMS and not this.problem.own],
    ids=lambda this: this.id,
)
each_misconception = pytest.mark.parametrize(
    ("this", "misconception"),
    [
        pytest.param(this, misconception, id=f"{this.id}-{misconception.name}")
        for this in ALL
        if this.id in PROBLEMS
        for misconception in this.problem.misconceptions
    ],
)


def blank(this: Posed, group: int) -> Any:
    """What stands in the place of the answer."""
    return eval(this.answer, run(this.path, group if this.problem.own else 1, blank=True))


# --- the notebooks ------------------------------------------------------------------------------


def test_there_are_sets() -> None:
    assert SETS
    assert [path.parent.name for path in SETS] == [path.stem for path in SETS]


def test_every_problem_is_posed_once_in_the_notebook_of_its_set() -> None:
    wanted = {(f"set{id.split('.')[0]}", id) for id in PROBLEMS}
    found = Counter((this.path.stem, this.id) for this in ALL)
    assert set(found) == wanted
    assert set(found.values()) == {1}


@each_set
def test_the_format_is_nbgraders(path: Path) -> None:
    MetadataValidator().validate_nb(nbformat.read(path, as_version=4))
    found = cells(path)
    names = [nbgrader(cell)["grade_id"] for cell in found if nbgrader(cell)]
    assert len(set(names)) == len(names)
    for cell in found:
        assert not cell.get("outputs"), f"{cell.id} has outputs"
        kind = nbgrader(cell)
        if not kind:
            continue
        assert cell.id == kind["grade_id"], "the cell is known by one name"
        assert kind["schema_version"] == 3
        assert not kind["task"]
        assert kind["locked"] is (not kind["solution"])
        marked = ("BEGIN SOLUTION" in cell.source, "END SOLUTION" in cell.source)
        assert marked == (kind["solution"],) * 2, cell.id


@each_set
def test_names_of_cells_tell_what_they_are_for(path: Path) -> None:
    number = path.stem.removeprefix("set")
    for cell in cells(path):
        kind = nbgrader(cell)
        prefix = {
            (True, False): "check",
            (True, True): "written",
            (False, True): "answer",
        }.get((kind.get("grade", False), kind.get("solution", False)))
        if prefix:
            assert re.fullmatch(rf"{prefix}-{number}-\d+[a-z]?", cell.id), cell.id
            assert (cell.cell_type == "markdown") is (prefix == "written"), cell.id
        if prefix == "check":
            id = ast.literal_eval(calls(cell.source)["check"].args[0])
            assert cell.id == f"check-{id.replace('.', '-')}"


@each_set
def test_the_group_is_asked_for_once_in_a_plain_cell(path: Path) -> None:
    [cell] = [cell for cell in cells(path) if re.search(r"^GROUP\s*=", cell.source, re.M)]
    assert not nbgrader(cell)
    assert re.match(r"GROUP = \d+\b", cell.source)


@each_problem
def test_the_hidden_tests_ask_what_the_check_asks(this: Posed) -> None:
    assert this.answer.isidentifier()
    visible, hidden = this.cell.source.split("### BEGIN HIDDEN TESTS\n")
    assert hidden.rstrip().endswith("### END HIDDEN TESTS")
    shown, scored = calls(visible)["check"], calls(hidden)["score"]
    # Nothing else is a result: nbgrader reads the first one as points.
    assert list(calls(this.cell.source)) == ["check", "score"]
    assert [ast.unparse(arg) for arg in shown.args] == [ast.unparse(arg) for arg in scored.args]
    assert ast.unparse(shown.args[2]) == "GROUP"
    assert "import score" in hidden
    assert "score" not in visible


@each_problem
def test_points_are_those_of_the_cell(this: Posed) -> None:
    assert this.points == nbgrader(this.cell)["points"] > 0


def test_no_two_problems_share_a_seed() -> None:
    assert max(Counter(this.seed for this in ALL).values()) == 1
    assert not {this.seed for this in ALL} & set(range(1000)), "a group might have it"


@each_set
def test_the_points_of_a_set_sum_to_a_round_number(path: Path) -> None:
    total = sum(nbgrader(cell).get("points", 0) for cell in cells(path))
    assert total > 0
    assert total % 10 == 0


# --- the graders --------------------------------------------------------------------------------


@pytest.mark.thorough
@each_problem
@pytest.mark.parametrize(("group", "seed"), GROUPS_AND_SEEDS)
def test_the_published_solution_gets_full_marks(this: Posed, group: int, seed: int) -> None:
    points = this.score(published(this, group), group, seed)
    assert points == this.points, points.feedback.text
    assert points.feedback.text == this.problem.praise


@each_problem
@pytest.mark.parametrize(("group", "seed"), GROUPS_AND_SEEDS)
def test_the_blank_gets_nothing(this: Posed, group: int, seed: int) -> None:
    points = this.score(blank(this, group), group, seed)
    assert points == 0
    assert points.feedback.text == (BLANK if this.problem.own else NOTHING)


@pytest.mark.thorough
@each_misconception
@pytest.mark.parametrize(("group", "seed"), GROUPS_AND_SEEDS[1:])
def test_a_misconception_gets_its_message_and_its_marks(
    this: Posed, misconception: Misconception, group: int, seed: int
) -> None:
    mistaken: Any = misconception.example
    if this.problem.own:
        mistaken = misconception.example(this.problem.drawn(group, 1)[0])
    points = this.score(mistaken, group, seed)
    assert points.feedback.recognised == misconception.name, points.feedback.text
    assert points.feedback.text == misconception.says
    # More only where parts of the answer are right all the same.
    assert points == pytest.approx(this.points * misconception.marks) or (
        this.problem.parts and points > this.points * misconception.marks
    )


@pytest.mark.thorough
@each_problem_of_many_cases
@pytest.mark.parametrize(("group", "seed"), GROUPS_AND_SEEDS[1:])
def test_an_answer_written_for_the_visible_cases_does_not_pass(
    this: Posed, group: int, seed: int
) -> None:
    right = published(this, group)
    constant = right(own_case(this.id, group))
    assert this.score(lambda case: constant, group, seed) < this.points
    table = iter([right(case) for case in this.problem.cases(group, 4)])
    assert this.score(lambda case: next(table, constant), group, seed) < this.points


@pytest.mark.slow
@each_problem
def test_everyone_has_another_case(this: Posed) -> None:
    first, *others = range(1, 7)
    text = str(own_case(this.id, first))
    # Two that differ are enough: no further case is drawn.
    assert any(str(own_case(this.id, group)) != text for group in others)


@pytest.mark.thorough
@each_problem
def test_cases_can_be_read(this: Posed) -> None:
    for group in range(1, 4):
        text = str(own_case(this.id, group))
        assert not re.search(r"object at|TransferFunction|array\(", text), text
        assert len(text) < 400


@each_problem
def test_messages_differ_and_are_sentences(this: Posed) -> None:
    kinds = this.problem.misconceptions
    said = [
        BLANK,
        NOTHING,
        HARD_CODED,
        ROUNDED,
        this.problem.praise,
        *(kind.says for kind in kinds),
    ]
    assert len(set(said)) == len(said)
    assert len({kind.name for kind in kinds}) == len(kinds)
    assert all(re.search(r"[.?…][)”]?$", text) for text in said)


@each_problem
def test_a_problem_knows_its_typical_mistakes(this: Posed) -> None:
    assert this.problem.misconceptions
    assert all(0 <= kind.marks < 1 for kind in this.problem.misconceptions)
