"""The way from a submission to its points, with nbgrader and kernels, on one of the sets.

What gives points without an answer is nothing of what was tried, each for real, by the grader.
What the graders say to each answer is asked, for all sets and without kernels, in
``test_exercises.py``.
"""

from __future__ import annotations

import csv
import json
import re
import shutil
import sqlite3
from dataclasses import dataclass
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup

import forgers
from attacks import FORGERIES
from forgers import KEEPING, KEEPS, OTHERS
from handin import (
    CHECKED,
    MAX,
    NAME,
    POINTS,
    WRITTEN,
    Handed,
    Notebook,
    answer_cell,
    cell_of,
    disasters,
    forged,
    handed,
    in_the_function,
    mistaken,
    not_executed_but_saved_elsewhere,
    renamed,
    right,
    settings,
    spying,
    tampered,
)
from nrdob_course.exercises.reviewing import HIDDEN_CASES
from nrdob_course.grading import command as exercises
from nrdob_course.grading import marks, sandbox
from nrdob_course.grading.autograde import course
from nrdob_course.grading.written import WRITTEN as COLUMNS

# Every test runs nbgrader and kernels; nbgrader quarrels with its own database.
pytestmark = [pytest.mark.thorough, pytest.mark.filterwarnings("ignore:Object of type")]
walled = pytest.mark.skipif(bool(sandbox.missing()), reason="there is no sandbox on this system")

REFUSED = {
    "corrupt": "the file is no valid JSON (Expecting value: line 1 column 11 (char 10))",
    "empty": "the file is empty",
    "forgot": "there is no notebook in the folder",
    "undecided": (f"2 notebooks for one set: undecided/a_{NAME}.ipynb, undecided/b_{NAME}.ipynb"),
}


@pytest.fixture(scope="module")
def everything(released: Path) -> list[Handed]:
    blank = Handed(f"blank/{NAME}/{NAME}.ipynb", handed(released), {})
    cell_of(blank.notebook, "group").source = "GROUP = 100 + 50"
    blank.group = "150"
    blank.earned = dict.fromkeys(POINTS, 0.0)
    return [
        right(released, f"anna/{NAME}.ipynb"),
        blank,
        mistaken(released, 0),
        forged(released),
        spying(released),
        *disasters(released),
        in_the_function(released),
        tampered(released),
        renamed(released),
        not_executed_but_saved_elsewhere(released),
    ]


@dataclass
class Forgers:
    """Those whose every attack must fail: their notebooks, and who tries what on which problem."""

    notebooks: dict[str, Notebook]
    tried: dict[str, tuple[str, str]]


@pytest.fixture(scope="module")
def forging(released: Path) -> Forgers:
    """Make the forgers; nobody runs their code where there is no sandbox."""
    if sandbox.missing():
        return Forgers({}, {})
    found = {name: forgers.keeping(released, ways) for name, ways in KEEPING.items()}
    tried = {}
    for number, (notebook, names) in enumerate(forgers.forging(released)):
        found[f"n{number}"] = notebook
        tried |= {name: (f"n{number}", problem) for problem, name in names.items()}
    return Forgers(found, tried)


@dataclass
class Graded:
    """What the grading of all submissions gave."""

    target: Path
    failures: int
    said: str

    def table(self, name: str = "grades") -> list[dict[str, str]]:
        with (self.target / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def graded(
    everything: list[Handed], forging: Forgers, tmp_path_factory: pytest.TempPathFactory
) -> Graded:
    """Hand in everything, and grade it."""
    folder = tmp_path_factory.mktemp("handed_in")
    files = {f"{name}/{NAME}.ipynb": notebook for name, notebook in forging.notebooks.items()}
    for file, notebook in [*((this.file, this.notebook) for this in everything), *files.items()]:
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(notebook), "utf-8")
    for student in ("corrupt", "empty", "forgot", "undecided"):
        (folder / student).mkdir()
    (folder / "corrupt" / f"{NAME}.ipynb").write_text('{"cells": ', "utf-8")
    (folder / "empty" / f"{NAME}.ipynb").write_text("", "utf-8")
    for letter in "ab":
        nbformat.write(everything[0].notebook, folder / "undecided" / f"{letter}_{NAME}.ipynb")
    target = tmp_path_factory.mktemp("grading")
    settings(target)
    output = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("builtins.print", lambda *texts, **_: output.append(" ".join(texts)))
        failures = exercises.grade(folder, target=target)
    return Graded(target, failures, "\n".join(output))


def student(this: Handed) -> str:
    return this.file.split("/")[0].removesuffix(f"_{NAME}.ipynb")


def line(this: Handed) -> dict[str, str]:
    """The line of the table that a submission should get."""
    unmarked = [name for name in WRITTEN if name not in this.earned]
    points = {marks.problem_of(name): marks.number(this.earned.get(name)) for name in POINTS}
    return {
        "student": student(this),
        "set": NAME,
        "group": this.group,
        **points,
        "to mark by hand": " ".join(map(marks.problem_of, unmarked)),
        "late": "",
        "total": marks.number(sum(this.earned.values())),
        "max": marks.number(MAX),
        "remarks": this.remarks,
    }


@pytest.mark.thorough
def test_every_line_of_the_table(
    everything: list[Handed], forging: Forgers, graded: Graded
) -> None:
    wanted = {student(this): line(this) for this in everything}
    rows = {row["student"]: row for row in graded.table()}
    assert rows.keys() >= forging.notebooks.keys()
    found = {name: row for name, row in rows.items() if name not in forging.notebooks}
    same = [this for this in everything if this.group == "5"]
    for this in same:
        shared = f"the same group in {len(same)} notebooks: group 5"
        wanted[student(this)]["remarks"] = "; ".join(filter(None, [this.remarks, shared]))
    for name in ("forger", "spy"):  # what is said of them is asked elsewhere
        wanted[name]["remarks"] = found[name]["remarks"]
    for name, reason in REFUSED.items():
        nothing = dict.fromkeys(wanted["anna"], "")
        wanted[name] = {**nothing, "student": name, "set": NAME}
        wanted[name]["remarks"] = f"not graded: {reason}"
    assert list(found) == sorted(wanted)
    for name, row in wanted.items():
        assert found[name] == row, name


def test_who_tampers_earns_nothing_by_it_and_is_remarked(graded: Graded) -> None:
    rows = {row["student"]: row for row in graded.table()}
    for name in ("forger", "spy"):
        for this in CHECKED:
            assert rows[name][this.id] == "0"
        remarks = rows[name]["remarks"]
        for problem in CHECKED if name == "spy" else CHECKED[:3]:
            assert f"{answer_cell(problem)} does what no answer needs" in remarks


@walled
@pytest.mark.parametrize("name", FORGERIES)
def test_no_attempt_to_forge_points_succeeds(name: str, forging: Forgers, graded: Graded) -> None:
    who, problem = forging.tried[name]
    [row] = [row for row in graded.table() if row["student"] == who]
    assert float(row[problem]) == 0


@walled
@pytest.mark.parametrize("name", KEEPING)
def test_what_an_answer_remembers_of_hidden_cases_is_not_shown(name: str, graded: Graded) -> None:
    [row] = [row for row in graded.table() if row["student"] == name]
    assert float(row[KEEPS.id]) > 0
    assert all(float(row[this.id]) == 0 for this in OTHERS)
    page = (graded.target / "feedback" / name / NAME / f"{NAME}.html").read_text("utf-8")
    text = BeautifulSoup(page, "html.parser").get_text()
    # The own case is the student's, and what comes of it is shown.
    own = KEEPS.problem.cases(forgers.GROUP, 1)[0]
    hidden = KEEPS.problem.cases(KEEPS.seed, HIDDEN_CASES)
    assert "cases kept: 1" in text
    assert text.count(f"kept: {own!r}") >= len(OTHERS)
    assert not [case for case in hidden if repr(case) in text]
    assert "987654321" not in page
    assert "kept" not in str(row)
    assert "were cut" not in row["remarks"]


def test_the_gradebook_is_as_it_was(graded: Graded) -> None:
    with sqlite3.connect(graded.target / "gradebook.db") as book:
        assert book.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def test_nobodys_code_is_in_a_page(graded: Graded) -> None:
    for page in pages(graded):
        soup = BeautifulSoup(page.read_text("utf-8"), "html.parser")
        attributes = {name for tag in soup.find_all(True) for name in tag.attrs}
        assert not [name for name in attributes if name.startswith("on") or name == "style"]
        assert all(tag["href"].startswith(("#", "http")) for tag in soup.find_all(href=True))
        assert not soup.body.find_all(["style", "meta", "base", "svg"])


def test_what_could_not_be_graded_is_told_by_name(graded: Graded) -> None:
    assert graded.failures == len(REFUSED)
    for name, reason in REFUSED.items():
        assert f"{name} {NAME}: NOT GRADED: {reason}" in graded.said


def test_progress_is_told(everything: list[Handed], forging: Forgers, graded: Graded) -> None:
    lines = re.findall(r"^\[ ?(\d+)/(\d+)\]", graded.said, re.MULTILINE)
    count = len(everything) + len(forging.notebooks)
    assert lines == [(f"{k}", f"{count}") for k in range(1, count + 1)]


def pages(graded: Graded) -> list[Path]:
    return sorted((graded.target / "feedback").rglob("*.html"))


def test_everyone_graded_has_feedback(
    everything: list[Handed], forging: Forgers, graded: Graded
) -> None:
    assert len(pages(graded)) == len(everything) + len(forging.notebooks)


def test_feedback_needs_no_network(graded: Graded) -> None:
    for page in pages(graded):
        soup = BeautifulSoup(page.read_text("utf-8"), "html.parser")
        assert not soup.find_all(["script", "link", "iframe", "object", "embed"])
        sources = [tag["src"] for tag in soup.find_all(src=True)]
        assert all(source.startswith("data:") for source in sources)
        assert "HIDDEN" not in soup.get_text()
        assert soup.find("math")
        assert len(page.read_bytes()) < 3e6


def test_feedback_says_what_went_wrong(graded: Graded) -> None:
    text = BeautifulSoup(
        (graded.target / "feedback" / "mistake0" / NAME / f"{NAME}.html").read_text("utf-8"),
        "html.parser",
    ).get_text(" ")
    for this in CHECKED:
        assert this.problem.misconceptions[0].says in text
    assert "Not marked yet" in text


@pytest.mark.thorough
def test_marks_by_hand_reach_table_and_feedback(
    graded: Graded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "grading"
    shutil.copytree(graded.target, target)
    rows = graded.table("written")
    assert [row["student"] for row in rows if row["student"] in ("anna", "blank")] == ["anna"]
    for row in rows:
        if row["student"] == "anna":
            row.update(points="0,5", comment="See $Z$ again.")
        if row["student"] == "renamed":
            row.update(points="1000")
    rows.append({**rows[0], "student": "nobody", "points": "1"})
    marks.write_table(target / "written.csv", list(COLUMNS), rows)

    assert exercises.report(target) == 1 + len(WRITTEN)

    table = {row["student"]: row for row in Graded(target, 0, "").table()}
    checked = sum(this.points for this in CHECKED)
    assert table["anna"]["total"] == marks.number(checked + 0.5 * len(WRITTEN))
    assert table["anna"]["to mark by hand"] == ""
    assert table["renamed"]["total"] == marks.number(checked)
    page = target / "feedback" / "anna" / NAME / f"{NAME}.html"
    text = BeautifulSoup(page.read_text("utf-8"), "html.parser").get_text(" ")
    assert "See" in text and "again." in text
    assert "Not marked yet" not in text
    # They stay when the tables are written again; so do the slips, until they are mended.
    written = {row["student"]: row["points"] for row in Graded(target, 0, "").table("written")}
    assert written["anna"] == "0.5"
    assert written["nobody"] == "1" and written["renamed"] == "1000"
    monkeypatch.setattr(exercises, "write_feedback", lambda *any: None)  # it has been, just now
    assert exercises.report(target) == 1 + len(WRITTEN)
    assert {row["student"]: row for row in Graded(target, 0, "").table()} == table


def test_the_result_is_a_course_of_nbgraders(
    graded: Graded, everything: list[Handed], forging: Forgers
) -> None:
    with course(graded.target).gradebook as gradebook:
        count = len(everything) + len(forging.notebooks)
        assert len(gradebook.assignment_submissions(NAME)) == count
        found = gradebook.find_submission(NAME, "anna")
        assert found.score == sum(this.points for this in CHECKED)
        assert found.needs_manual_grade is bool(WRITTEN)
