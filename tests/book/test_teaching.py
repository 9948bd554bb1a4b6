"""The instructor's pack: what it says of chapters, problems and commands is so."""

from __future__ import annotations

import contextlib
import re
import shlex
import textwrap
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
import test_formulas
from test_notebooks import CLASS

import pages
import predictions
import slides
import teaching
from nrdob.design import closedforms
from nrdob_course.exercises import PROBLEMS
from nrdob_course.exercises.reviewing import review
from nrdob_course.grading import command as exercises

ROOT = Path(__file__).resolve().parents[2]

PACK = teaching.read_pack()
PAGES = {
    path.stem: path.read_text("utf-8")
    for path in sorted(teaching.TEACHING.glob("*.md"))
    if path.name not in teaching.PAGES
}
MADE = {
    name.removesuffix(".md"): pages.render(name, pack=PACK, rule=teaching.RULE)
    for name in teaching.PAGES
}

LOOKED_UP = {"C_traps", "D_a_proof_you_can_check"}
"""Appendices without a question for class."""

LINK = r"\[[^\]]*\]\(\.\./\.\./notebooks/(\w+)\.ipynb\)"
READ = re.compile(LINK + r" \((\d+)\)")

each_written = pytest.mark.parametrize(
    "task", [task for task in PACK.tasks if task.written], ids=lambda task: task.id
)


def rows(text: str) -> list[list[str]]:
    """Give the cells of every line of a table but its head and the rule below."""
    lines = re.findall(r"^ *\|(.*)\|$", text, re.MULTILINE)
    cells = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)] for line in lines]
    return [row for row in cells if not set("".join(row)) <= set("-: ")]


# --- problems, objectives, advice ---------------------------------------------------------------


def test_problems_chapters_and_advice_fit_together() -> None:
    assert PACK.misfits() == []


def test_every_problem_has_a_question_to_ask_and_an_objective() -> None:
    for task in PACK.tasks:
        assert PACK.advice[task.id].ask.endswith("?"), task.id
        assert PACK.objectives_of(task.id), task.id
    asked = [advice.ask for advice in PACK.advice.values()]
    assert len(set(asked)) == len(asked)


@each_written
def test_every_written_answer_has_its_rubric_and_its_mistakes(task: teaching.Task) -> None:
    advice = PACK.advice[task.id]
    assert sum(points for points, _ in advice.rubric) == task.points
    assert all(points <= 2 and text for points, text in advice.rubric)
    assert len(advice.wrong) >= 2
    section = MADE["rubric"].split(f"## {task.id} ")[1].split("\n## ")[0]
    assert [row[0] for row in rows(section)[1:]] == [f"{points:g}" for points, _ in advice.rubric]


@pytest.mark.slow
def test_misfits_are_noticed() -> None:
    some = next(task.id for task in PACK.tasks if task.written)
    chapters = dict(PACK.chapters)
    del chapters["05_how_slow_must_the_filter_be"]
    mean = replace(PACK.advice[some], rubric=((0.5, "something"),))
    misfits = [
        replace(PACK, advice={**PACK.advice, "9.9": PACK.advice[some]}),
        replace(PACK, advice={id: each for id, each in PACK.advice.items() if id != some}),
        replace(PACK, advice={**PACK.advice, some: mean}),
        replace(PACK, chapters=chapters),
        replace(PACK, sets=PACK.sets[1:]),
    ]
    for pack in misfits:
        assert pack.misfits()
        for name in teaching.PAGES:
            # The author of a set can look at the pages all the same.
            assert pages.render(name, pack=pack, rule=teaching.RULE)


@pytest.mark.slow
def test_the_program_tells_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert teaching.main(["--output", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == set(teaching.PAGES)
    monkeypatch.setattr(teaching, "read_pack", lambda: replace(PACK, sets=PACK.sets[1:]))
    assert teaching.main(["--output", str(tmp_path)]) == 1
    assert "1.1: posed in no set" in capsys.readouterr().err


@pytest.mark.slow
def test_the_stored_pages_are_in_step_with_their_sources(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert teaching.main(["--check"]) == 0, capsys.readouterr().err
    assert teaching.main(["--check", "--output", str(tmp_path)]) == 1  # nothing is stored there
    teaching.main(["--output", str(tmp_path)])
    with (tmp_path / "rubric.md").open("a", encoding="utf-8") as page:
        page.write("written by hand\n")
    assert teaching.main(["--check", "--output", str(tmp_path)]) == 1
    assert "rubric.md" in capsys.readouterr().err.splitlines()[-1]


# --- the pages that are made --------------------------------------------------------------------


def test_every_chapter_and_every_problem_has_its_place_among_the_objectives() -> None:
    head, sets = MADE["objectives"].split("## The sets\n")
    table = [row for row in rows(head) if row[0] != "Chapter"]
    assert [re.findall(LINK, row[0])[0] for row in table if row[0]] == list(PACK.chapters)
    assert len(table) == sum(len(chapter.objectives) for chapter in PACK.chapters.values())
    named = {id for row in table for id in row[2].split(", ") if id}
    assert named == {task.id for task in PACK.tasks} >= set(PROBLEMS)
    listed = [row[0].split()[0] for row in rows(sets) if row[0] != "Problem"]
    assert listed == [task.id for task in PACK.tasks]


def test_every_mistake_is_told_with_what_the_student_reads() -> None:
    for id, problem in PROBLEMS.items():
        section = MADE["mistakes"].split(f"### {id} ")[1].split("\n### ")[0]
        points = next(task.points for task in PACK.tasks if task.id == id)
        told = [[unescaped(cell) for cell in row] for row in rows(section)[1:]]
        assert told == [[m.name, m.says, f"{m.marks * points:g}"] for m in problem.misconceptions]
        assert f"**Ask.** {PACK.advice[id].ask}" in section


def unescaped(text: str) -> str:
    return re.sub(r"\\([^\w\s]|_)", r"\1", text)


# --- how long problems take -----------------------------------------------------------------------


def test_minutes_follow_the_rule() -> None:
    rule, [task] = teaching.RULE, [task for task in PACK.tasks if task.id == "2.4"]
    source = nbformat.read(teaching.SOURCE / "set2" / "set2.ipynb", as_version=4)
    cells = {cell.id: cell.source for cell in source.cells}
    assert task.reading == len(cells["task-2-4"].split()) / rule.words_read
    lines = cells["answer-2-4"].split("### BEGIN SOLUTION")[1].split("### END")[0].splitlines()
    assert task.writing == sum(bool(re.match(r" *[^ #]", line)) for line in lines)
    steps = PACK.advice["2.4"].steps
    for k, minutes in enumerate(PACK.minutes_of(task)):
        assert minutes == task.reading + task.writing + steps * rule.step[k] + rule.check[k]


def test_every_problem_has_its_minutes_on_the_page() -> None:
    table = {row[0].split()[0]: row for row in rows(MADE["objectives"].split("## The sets")[1])}
    for task in PACK.tasks:
        quick, slow = map(round, PACK.minutes_of(task))
        assert table[task.id][3] == f"{quick}–{slow}"
        assert 5 < quick < slow < 240
        assert PACK.advice[task.id].steps >= 3


@pytest.mark.parametrize(("hours", "text"), [(2, "2"), (2.75, "2¾"), (0.5, "½"), (3.25, "3¼")])
def test_hours_are_written_with_quarters(hours: float, text: str) -> None:
    assert pages.TEMPLATES.filters["hours"](hours) == text
    assert hours_in(text) == [hours]


def hours_in(text: str) -> list[float]:
    """Read the hours that a text names, 2¾ as 2.75."""
    quarters = {"": 0, "¼": 0.25, "½": 0.5, "¾": 0.75}
    return [
        int(whole or 0) + quarters[part] for whole, part in re.findall(r"(\d*)([¼½¾]?)", text)
        if whole or part
    ]  # fmt: skip


def test_the_syllabus_says_how_long_a_set_takes() -> None:
    section = PAGES["syllabus"].split("## How long the sets take")[1].split("\n## ")[0]
    said = {row[0]: hours_in(row[1].split(" and ")[0].split(",")[0]) for row in rows(section)[1:]}
    project = [task for task in PACK.tasks if task.id == "6.6"]
    for each in PACK.sets:
        tasks = [task for task in each.tasks if task not in project]
        assert said[each.name.removeprefix("set")] == pytest.approx(PACK.hours_of(tasks), abs=0.26)
        # A set that names hours names these.
        path = teaching.SOURCE / each.name / f"{each.name}.ipynb"
        opening = nbformat.read(path, as_version=4).cells[0].source
        if own := re.search(r"\*\*Time\*\* (.*?) hours", opening):
            assert hours_in(own[1]) == said[each.name.removeprefix("set")]
    assert said["the project, 6.6"] == pytest.approx(PACK.hours_of(project), abs=0.26)


# --- the syllabus -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Week:
    """A row of the plan week by week."""

    theme: str
    read: dict[str, int]
    minutes: int
    given_out: list[str]
    due: list[str]


@cache
def plan() -> dict[int, Week]:
    """Give the weeks, those without a session or without reading too."""
    found = {}
    for row in rows(PAGES["syllabus"].split("## How long")[0]):
        if row[0].isdigit():
            read = {stem: int(minutes) for stem, minutes in READ.findall(row[2])}
            sets = ([f"set{number}" for number in re.findall(r"\d+", cell)] for cell in row[4:])
            found[int(row[0])] = Week(row[1], read, int(row[3]), *sets)
    return found


def weeks() -> dict[int, Week]:
    """Give the weeks that teach."""
    return {number: week for number, week in plan().items() if week.read}


def week_of(stem: str) -> int:
    [week] = [number for number, week in weeks().items() if stem in week.read]
    return week


def test_reading_times_are_those_of_the_chapters() -> None:
    promised = {stem: chapter.minutes for stem, chapter in PACK.chapters.items()}
    planned = [item for week in weeks().values() for item in week.read.items()]
    assert sorted(planned) == sorted(promised.items())
    for week in plan().values():
        assert sum(week.read.values()) == week.minutes
    assert dict(READ.findall(PAGES["syllabus"].split("## Two days")[1])).items() <= {
        (stem, str(minutes)) for stem, minutes in promised.items()
    }


def test_what_a_student_spends_is_added_up() -> None:
    said = re.search(
        r"about (\d+) hours reading, ([\d.]+) in\s+class, and ([\d.]+) to ([\d.]+) on the sets",
        PAGES["syllabus"].replace("½", ".5"),
    )
    assert said
    reading, in_class, least, most = map(float, said.groups())
    assert reading == hours_of_reading()
    assert in_class == 1.5 * len(sessions())
    without = re.search(
        r"Without weeks 7 to 9 it is (\d+) hours of reading and ([\d.]+) in class",
        PAGES["syllabus"],
    )
    assert without
    left_out = [plan()[7], plan()[8], plan()[9]]
    assert float(without[1]) == hours_of_reading(without=left_out)
    assert float(without[2]) == 1.5 * (len(sessions()) - len(left_out))
    assert [least, most] == [round(2 * each) / 2 for each in PACK.hours_of(PACK.tasks)]


def hours_of_reading(without: Sequence[Week] = ()) -> int:
    minutes = sum(chapter.minutes for chapter in PACK.chapters.values())
    return round((minutes - sum(week.minutes for week in without)) / 60)


def test_the_weeks_that_may_be_left_out_are_the_bench_and_only_the_set_of_week_8_needs_them() -> (
    None
):
    left_out = {stem for week in (7, 8, 9) for stem in plan()[week].read}
    bench = {chapter.stem for chapter in PACK.parts["The bench"]}
    assert left_out == {*bench, "17_will_it_survive", *LOOKED_UP}
    for each in PACK.sets:
        trained = {stem for task in each.tasks for stem, _ in PACK.objectives_of(task.id)}
        needs = bool(left_out & {*trained, *needed_by(each.name)})
        assert needs is (each.name in plan()[8].given_out), each.name


@pytest.mark.slow
def test_what_a_chapter_needs_is_read_before_it() -> None:
    order = [stem for week in weeks().values() for stem in week.read]
    for path in (ROOT / "notebooks").glob("*.ipynb"):
        opening = nbformat.read(path, as_version=4).cells[0].source
        needs = re.search(r"\*\*You need\*\*(.*)", opening)
        assert needs
        for stem in re.findall(r"\((\w+)\.ipynb\)", needs[1]):
            assert order.index(stem) < order.index(path.stem), f"{path.stem} needs {stem}"


def test_what_a_set_needs_is_read_by_then() -> None:
    given_out = {name: number for number, week in plan().items() for name in week.given_out}
    assert sorted(given_out) == [each.name for each in PACK.sets]
    for each in PACK.sets:
        for task in each.tasks:
            for stem, _ in PACK.objectives_of(task.id):
                assert week_of(stem) <= given_out[each.name], f"{task.id} trains {stem}"
        for stem in needed_by(each.name):
            assert week_of(stem) <= given_out[each.name], f"{each.name} needs {stem}"


def test_a_set_is_due_after_it_was_given_out_and_talked_about_in_a_session() -> None:
    given_out = {name: number for number, week in plan().items() for name in week.given_out}
    due = {name: number for number, week in plan().items() for name in week.due}
    assert sorted(due) == sorted(given_out) == [each.name for each in PACK.sets]
    section = PAGES["syllabus"].split("## How long the sets take")[1].split("\n## ")[0]
    for row in rows(section)[1:]:
        number = "6" if "project" in row[0] else row[0]
        assert row[2] == f"week {due[f'set{number}']}"
    for name, week in due.items():
        assert week > given_out[name]
        later = [number for number in sessions() if number >= week]
        assert f"set {name[-1]}" in sessions()[min(later)].split("### Board")[0], name
        assert re.search(rf"set{name[-1]}|sets? [\d and]*{name[-1]}", sessions()[given_out[name]])
    assert set(plan()) == set(sessions())


def test_what_is_begun_in_a_session_has_been_on_the_board() -> None:
    for number, session in sessions().items():
        for line in session.split("### Board")[0].splitlines():
            for id in re.findall(r"problem (\d\.\d)|begins (\d\.\d)", line):
                for stem, _ in PACK.objectives_of("".join(id)):
                    assert week_of(stem) <= number, f"week {number} poses {id}"


def test_a_problem_that_is_solved_in_class_fits_into_its_minutes() -> None:
    tasks = {task.id: task for task in PACK.tasks}
    for session in sessions().values():
        for minutes, what in re.findall(r"^\| (\d+) \| (.*) \|$", session, re.MULTILINE):
            for id in re.findall(r"^problem (\d\.\d) in pairs", what):
                assert int(minutes) >= PACK.minutes_of(tasks[id])[0], what
    for day in PAGES["syllabus"].split("## Two days")[1].split("| Day ")[1:]:
        for row in rows("| " + day)[1:]:
            there = clock(row[1]) - clock(row[0])
            asked = 5 * len(re.findall(r"\w+", row[3]))
            solved = [PACK.minutes_of(tasks[id])[0] for id in re.findall(r"\d\.\d", row[4])]
            assert there - asked - sum(solved) >= (0 if "in pairs" in row[2] else 10), row


def needed_by(name: str) -> Iterator[str]:
    """Give the chapters that a set asks for, by the beginnings of their titles."""
    path = teaching.SOURCE / name / f"{name}.ipynb"
    opening = nbformat.read(path, as_version=4).cells[0].source
    needs = re.search(r"\*\*You need\*\*(.*)", opening)
    assert needs
    for title in re.findall(r"\*([^*]+)\*", needs[1]):
        [stem] = [stem for stem, each in PACK.chapters.items() if each.title.startswith(title)]
        yield stem


def test_what_is_left_out_to_shorten_takes_its_problems_along() -> None:
    said = re.search(r"To shorten: leave out (.*?)\. To lengthen", PAGES["syllabus"], re.DOTALL)
    assert said
    left_out = set(re.findall(LINK, said[1]))
    only = {task.id for task in PACK.tasks if PACK.objectives_of(task.id)[0][0] in left_out}
    assert set(re.findall(r"\d\.\d", said[1])) == only


def test_two_days_and_a_third_run_on_time_and_leave_no_question_out() -> None:
    days = PAGES["syllabus"].split("## Two days")[1].split("| Day ")[1:]
    asked, minutes = [], []
    for day in days:
        times = [(clock(row[0]), clock(row[1])) for row in rows("| " + day)[1:]]
        assert all(start < end for start, end in times)
        assert all(before[1] <= after[0] for before, after in pairwise(times))
        assert (times[0][0], times[-1][1]) == (9 * 60, 17 * 60)
        minutes.append(sum(end - start for start, end in times))
        for row in rows("| " + day)[1:]:
            asked += re.findall(r"\w+", row[3])
            assert set(re.findall(r"\d\.\d", row[4])) <= {task.id for task in PACK.tasks}
    numbers = [stem.partition("_")[0] for stem in PACK.chapters if stem not in LOOKED_UP]
    assert sorted(asked) == numbers
    said = re.search(r"(\d+) hours in a room.* reads (\d+) hours of chapters", PAGES["syllabus"])
    assert said
    assert [int(hours) for hours in said.groups()] == [sum(minutes[:2]) / 60, hours_of_reading()]
    third = re.search(r"A third day, .* has ([\d.]+) hours", PAGES["syllabus"])
    assert third and [60 * float(third[1])] == minutes[2:]


def clock(text: str) -> int:
    hours, minutes = text.split(":")
    return 60 * int(hours) + int(minutes)


# --- in class -----------------------------------------------------------------------------------


def sessions() -> dict[int, str]:
    """Give the sessions by their weeks."""
    parts = re.split(r"^## Week (\d+)\n", PAGES["in_class"], flags=re.MULTILINE)[1:]
    return {int(week): text for week, text in zip(parts[::2], parts[1::2], strict=True)}


def teaching_sessions() -> list[str]:
    return [sessions()[number] for number in weeks()]


def test_a_session_takes_ninety_minutes() -> None:
    assert {"ten": 10}[re.search(r"(\w+) sessions", PAGES["in_class"])[1].lower()] == len(
        sessions()
    )
    for session in sessions().values():
        plan = rows(session.split("### Board")[0])
        assert sum(int(row[0]) for row in plan if row[0].isdigit()) == 90


def test_a_session_asks_the_questions_of_its_chapters() -> None:
    titles = {}
    for deck in CLASS:
        for cell in nbformat.read(deck, as_version=4).cells:
            data = cell.metadata.get("slideshow", {}).get("data", {})
            if data.get("kind") == "question":
                titles[data["chapter"]] = cell.source.partition("\n")[0].removeprefix("## ")
    for session, week in zip(teaching_sessions(), weeks().values(), strict=True):
        asked = re.findall(r"^\| 5 \| question (\w+), \*(.+)\* \|$", session, re.MULTILINE)
        assert sorted(f"{number} {title}" for number, title in asked) == sorted(
            titles[stem] for stem in week.read if stem not in LOOKED_UP
        )
        opening = re.search(r"Open with \*(.+)\*\.", session)
        assert opening and opening[1] == asked[0][1]


def test_a_session_has_the_theme_of_its_week() -> None:
    for number, session in sessions().items():
        assert session.startswith(f"*{plan()[number].theme}.*")


def test_a_session_needs_one_deck_with_its_questions_in_its_order() -> None:
    for number, session in zip(weeks(), teaching_sessions(), strict=True):
        notebook = nbformat.read(slides.FOLDER / f"week{number}.ipynb", as_version=4)
        deck = [cells[0].source.partition("\n")[0] for cells in predictions.split(notebook.cells)]
        asked = re.findall(r"question (\w+), \*(.+)\* \|$", session, re.MULTILINE)
        assert deck == [f"## {number} {title}" for number, title in asked]
        opening = notebook.cells[0].source.partition("\n")[0].partition(": ")[2]
        assert opening.lower() == plan()[number].theme.lower()


SYMBOLS = ("p_A", "p_B", "FH", "H", "K", "L", "T_R", "S_d", "S_\\delta", "S_\\eta", "M_s")
"""What a class learns to read from the board."""


@pytest.mark.thorough
def test_a_question_uses_what_was_on_the_board_before() -> None:
    known: set[str] = set()
    for number, session in zip(weeks(), teaching_sessions(), strict=True):
        deck = nbformat.read(slides.FOLDER / f"week{number}.ipynb", as_version=4)
        asked = {cells[0].source.split()[1]: cells for cells in predictions.split(deck.cells)}
        table, board = session.split("### Board")
        lines = re.split(r"^\d+\. ", board, flags=re.MULTILINE)
        for row in table.splitlines():
            for first, _, last in re.findall(r"board (\d+)( (?:to|and) (\d+))?:", row):
                known |= symbols(" ".join(lines[int(first) : int(last or first) + 1]))
            if found := re.search(r"question (\w+),", row):
                question = predictions.read_questions()[
                    next(c for c in PACK.chapters if c.startswith(f"{found[1]}_"))
                ]
                text = " ".join([question.asks, *question.choices.values()])
                own = {name for name in SYMBOLS if re.search(rf"\$\s*{re.escape(name)} *=", text)}
                assert symbols(text) <= known | own, f"week {number}, question {found[1]}"
                assert found[1] in asked


def symbols(text: str) -> set[str]:
    """Give the symbols in the formulas of a text."""
    formulas = " ".join(re.findall(r"\$+([^$]+)\$+", text))
    return {
        name
        for name in SYMBOLS
        if re.search(rf"(?<![A-Za-z_\\]){re.escape(name)}(?![A-Za-z_])", formulas)
    }


def test_everybody_has_opened_a_notebook_when_the_class_goes_to_the_computer() -> None:
    rows_of_week_1 = sessions()[1].split("### Board")[0].splitlines()
    [first] = [k for k, row in enumerate(rows_of_week_1) if "at the computer" in row]
    assert "everybody opens" in rows_of_week_1[first]
    assert all("everybody opens" not in row for row in rows_of_week_1[:first])
    assert "# Before the first session" in PAGES["syllabus"]


def test_the_plan_names_every_line_of_the_board_once() -> None:
    for session in teaching_sessions():
        minutes, board = session.split("### Board")
        lines = [int(number) for number in re.findall(r"^(\d+)\. ", board, re.MULTILINE)]
        assert lines == list(range(1, len(lines) + 1))
        named = []
        for first, _, last in re.findall(r"board (\d+)( (?:to|and) (\d+))?:", minutes):
            named += range(int(first), int(last or first) + 1)
        assert named == lines


@pytest.mark.slow
def test_formulas_on_the_board_are_true() -> None:
    lines = [
        textwrap.dedent(line)
        for session in teaching_sessions()
        for line in re.split(r"^\d+\. ", session.split("### Board")[1], flags=re.MULTILINE)[1:]
    ]
    cells = [nbformat.v4.new_markdown_cell(line) for line in ["# In class", *lines]]
    displayed = [formula for cell in cells for formula in test_formulas.formulas(cell)]
    assert sum(formula.displayed for formula in displayed) > 15
    assert test_formulas.problems(nbformat.v4.new_notebook(cells=cells)) == []


def test_numbers_on_the_board_are_right() -> None:
    board = sessions()[5]
    for kind, function in (
        ("a dead time $\\theta$", closedforms.smallest_for_delay),
        ("two lags $T$", closedforms.smallest_for_double_lag),
    ):
        [row] = [row for row in rows(board) if row[0] == kind]
        assert f"${function(1, 2):.4f}\\," in row[2]
    assert np.isclose(closedforms.smallest_for_delay(1, 1), 2 / np.pi)
    assert np.isclose(closedforms.smallest_for_double_lag(1, 1), 1 / 2)
    assert np.isclose(closedforms.smallest_for_rhp_zero(1, 1), 1)
    assert np.isclose(closedforms.smallest_for_rhp_zero(1, 2), 1 / 2)
    assert np.allclose([closedforms.gain_bound(n) for n in (1, 2, 3)], [np.inf, np.inf, 9])
    chapter = nbformat.read(ROOT / "notebooks" / "11_rules.ipynb", as_version=4)
    assert "0.9620" in str(chapter), "Ms ≤ 2 for a dead time"


def test_sections_that_are_shown_at_the_computer_exist() -> None:
    for stem, heading in (
        ("01_can_you_compute_the_load", "The loop in ten lines"),
        ("10_all_filters", "The fastest filter to a specification"),
        ("12_choosing_the_model", "The recipe"),
        ("12_choosing_the_model", "First design: the ball"),
    ):
        cells = nbformat.read(ROOT / "notebooks" / f"{stem}.ipynb", as_version=4).cells
        assert any(f"## {heading}\n" in f"{cell.source}\n" for cell in cells), heading


def test_the_slides_are_where_the_page_says() -> None:
    said = re.findall(r"`(\w+)\.html`", PAGES["in_class"])
    decks = [path.stem for path in sorted(slides.FOLDER.glob("*.ipynb"))]
    assert said == [decks[0], decks[-1]] and decks == [f"week{number}" for number in weeks()]


# --- commands and names -------------------------------------------------------------------------

BLOCK = re.compile(r"^ *```([\w{}]*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
EVERYTHING = "\n".join([*PAGES.values(), *MADE.values()])
COMMANDS = [
    *[
        line.strip()
        for language, block in BLOCK.findall(EVERYTHING)
        if not language
        for line in block.splitlines()
    ],
    *re.findall(r"`((?:make|python|nbgrader) [^`]+)`", re.sub(r"\s+", " ", EVERYTHING)),
]


def test_every_make_target_exists() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.M))
    named = [command.split()[1] for command in COMMANDS if command.startswith("make ")]
    assert {"release", "grade", "report", "slides"} <= set(named) <= targets


def test_our_own_programs_take_these_arguments() -> None:
    commands = [shlex.split(command) for command in COMMANDS if "nrdob_course.grading" in command]
    assert commands
    for command in commands:
        program = "nrdob_course.grading"
        arguments = command[command.index(program) + 1 :]
        with contextlib.suppress(SystemExit):
            assert exercises.parse(arguments).command == arguments[0]
            continue
        pytest.fail(f"{program} does not take {arguments}")


def test_files_and_folders_that_are_named_exist() -> None:
    made = ("build/", "grading", "dist/", "submissions", "book/nrdob_course/sets/submitted")
    to_come = {"set8"}
    for name in re.findall(r"`([\w./-]+/[\w./-]+)`", "\n".join(PAGES.values())):
        if name.startswith(("/", *made)) or any(part in name for part in to_come):
            continue
        assert (ROOT / name).exists(), name


def test_new_seeds_can_be_set_as_the_page_says() -> None:
    [command] = [command for command in COMMANDS if command.startswith("perl")]
    expression = re.search(r"s/(.*)/\$\{1\}26/", command)
    assert expression
    for path in teaching.SOURCE.glob("*/*.ipynb"):
        text = path.read_text("utf-8")
        changed = re.sub(expression[1], r"\g<1>26", text)
        assert len(re.findall(r"seed=\d", text)) == len(re.findall(r"seed=26\d{4,}", changed)) > 0
        assert re.sub("seed=26", "seed=", changed) == text


# --- the example of a problem -------------------------------------------------------------------


def test_the_example_of_a_new_problem_works(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = dict(BLOCK.findall(PAGES["adding"]))
    code, texts = blocks["python"], tomllib.loads(textwrap.dedent(blocks["toml"]))
    monkeypatch.setattr("nrdob_course.exercises.problems.texts_of", {"set8": texts}.get)
    space: dict[str, Any] = {"__name__": __name__}
    exec(textwrap.dedent(code), space)
    [problem] = map(space.get, space["__all__"])
    for seed in (1, 2, 2024):
        cases = problem.cases(seed, 8)
        right = review(problem, lambda c: (2 ** (1 / c.order) - 1) ** 0.5 / c.time_constant, cases)
        assert right.share == 1
        short = review(
            problem, lambda c: f"{(2 ** (1 / c.order) - 1) ** 0.5 / c.time_constant:.2g}", cases
        )
        assert short.recognised == "rounded"
        for mistake in problem.misconceptions:
            assert review(problem, mistake.example, cases).recognised == mistake.name
        assert "no" in review(problem, lambda case: 2 / case.time_constant, cases).text.lower()
