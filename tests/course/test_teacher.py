"""A teacher's week: marking, slips in a table, regrades, what goes back, what a class has done."""

from __future__ import annotations

import csv
import json
import re
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nbformat
import pytest
from bs4 import BeautifulSoup
from nbformat.v4 import new_output

from exported import table, taken_by_canvas, taken_by_moodle
from handin import MAX, NAME, POINTS, WRITTEN, Stub, cell_of, handed, of_group, write
from nrdob_course.exercises import PROBLEMS
from nrdob_course.grading import command, marks, written
from nrdob_course.grading.batch import Outcome
from nrdob_course.grading.roster import Course, Student

[PROBLEM] = map(marks.problem_of, WRITTEN)
CHECKED = MAX - POINTS[WRITTEN[0]]
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:Object of type")]
NAMES = ("Anna Müller", "Bo Rossi", "Cléo")
SECRET = "root:x:0:0"


@dataclass
class Class:
    """Three who were graded, and what was printed."""

    target: Path
    said: list[str]

    def rows(self, name: str) -> list[dict[str, str]]:
        return table(self.target / f"{name}.csv")

    def row(self, student: str, name: str = "grades") -> dict[str, str]:
        return next(row for row in self.rows(name) if row["student"] == student)

    def type(self, student: str, **cells: str) -> None:
        """Fill in a line as a person would, and touch no other."""
        rows = self.rows("written")
        for row in rows:
            if row["student"] == student:
                row.update(cells)
        marks.write_table(self.target / "written.csv", list(written.WRITTEN), rows)

    def grade(self, folder: Path, course: Course | None = None) -> int:
        return command.grade(folder, target=self.target, plan=course)


@pytest.fixture
def notebook(released: Path) -> Any:
    return handed(released)


def without_kernels(patch: pytest.MonkeyPatch, said: list[str]) -> None:
    patch.setattr(command, "Batch", Stub)
    patch.setattr(command, "write_feedback", lambda *any: None)
    patch.setattr("builtins.print", lambda *texts, **_: said.append(" ".join(map(str, texts))))


@pytest.fixture
def school(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Class:
    """A course in which nothing has been graded yet."""
    said: list[str] = []
    without_kernels(monkeypatch, said)
    return Class(tmp_path / "grading", said)


@pytest.fixture(scope="module")
def class_of_three(released: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What three handed in, and their course, graded once; it must stay as it is."""
    place, notebook = tmp_path_factory.mktemp("class"), handed(released)
    cell_of(notebook, WRITTEN[0]).source = "As $Z = N + P$, **yes** <script>alert(1)</script>."
    write(place / "in", {f"{n}/{NAME}.ipynb": of_group(notebook, 5) for n in NAMES})
    with pytest.MonkeyPatch.context() as patch:
        without_kernels(patch, [])
        assert command.grade(place / "in", target=place / "grading") == 0
    return place


@pytest.fixture
def graded(school: Class, class_of_three: Path, tmp_path: Path) -> Class:
    """A copy of the class that was graded."""
    shutil.copytree(class_of_three, tmp_path, dirs_exist_ok=True)
    return school


# --- points that were typed ---------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("text", "says"),
    [("5", "5 is not between 0 and 3"), ("abc", "'abc' is no number"), ("-1", "-1 is not between"),
     ("nan", "nan is not between"), ("1e9", "1e9 is not between"), ("2;5", "'2;5' is no number")],
)  # fmt: skip
def test_a_slip_is_named_with_its_line_and_kept(graded: Class, text: str, says: str) -> None:
    graded.type("Anna Müller", points=text, comment="See = 3, please.")
    graded.type("Bo Rossi", points="2,5", comment="good")
    typed = (graded.target / "written.csv").read_text("utf-8")
    for _ in range(2):  # it stays, however often
        graded.said.clear()
        assert command.report(graded.target) == 1
        fault = f"written.csv, line 2: Anna Müller {PROBLEM}: {says}"
        assert graded.said[0].startswith(fault)  # before anything else
        row = graded.row("Anna Müller", "written")
        assert (row["points"], row["comment"]) == (text, "See = 3, please.")
        assert graded.row("Bo Rossi", "written")["points"] == "2.5"
        assert graded.row("Anna Müller")["to mark by hand"] == PROBLEM
    backups = [path.read_text("utf-8") for path in (graded.target / "backup").iterdir()]
    assert typed in backups
    graded.type("Anna Müller", points="3")
    assert command.report(graded.target) == 0
    assert graded.row("Anna Müller")["total"] == marks.number(MAX)


def test_a_line_about_nobody_is_kept_too(graded: Class) -> None:
    rows = graded.rows("written")
    rows.append({**rows[0], "student": "Ana Müller", "points": "2", "comment": "long work"})
    marks.write_table(graded.target / "written.csv", list(written.WRITTEN), rows)
    assert command.report(graded.target) == 1
    assert "line 5: Ana Müller has no answer to set2 2.2 that is to be marked" in graded.said[0]
    assert graded.rows("written")[-1]["comment"] == "long work"


def test_the_same_answer_with_two_marks_is_told(graded: Class) -> None:
    rows = graded.rows("written")
    rows = [{**rows[0], "points": "1"}, *rows[1:], {**rows[0], "points": "2"}]
    marks.write_table(graded.target / "written.csv", list(written.WRITTEN), rows)
    assert command.report(graded.target) == 1
    assert "line 5: Anna Müller 2.2: line 2 gives other points to the same answer" in graded.said[0]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"PK\x03\x04\x8f\xff", "line 1: it is a spreadsheet"),
        ("student,set,problem,points\nJos\xe9,set2,2.2,1\n".encode("latin-1"), "line 2: it is in"),
        (b"student;set;problem;mark\nAnna;set2;2.2;1\n", "line 1: there is no column 'points'"),
        (b"student,set,problem,of,points,comment\nBo Rossi,set2,2.2,3,2,5,ok\n", "line 2: it has"),
        (b'student,set,problem,points\nBo,set2,2.2,"1\n', "line 2: unexpected end"),
    ],
)
def test_a_table_that_cannot_be_read_stays_as_it_is(
    graded: Class, content: bytes, says: str
) -> None:
    (graded.target / "written.csv").write_bytes(content)
    assert command.report(graded.target) == 1
    assert f"written.csv, {says}" in graded.said[0]
    assert (graded.target / "written.csv").read_bytes() == content
    assert graded.row("Bo Rossi")["total"] == marks.number(CHECKED)


def test_what_was_typed_while_others_were_graded_is_taken(
    graded: Class, notebook: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Slow(Stub):
        def grade(self, ready: Any) -> Any:
            graded.type("Bo Rossi", points="1")
            yield from super().grade(ready)

    monkeypatch.setattr(command, "Batch", Slow)
    write(tmp_path / "late", {f"Dan/{NAME}.ipynb": of_group(notebook, 6)})
    graded.grade(tmp_path / "late")
    assert graded.row("Bo Rossi", "written")["points"] == "1"
    assert graded.row("Bo Rossi")["total"] == marks.number(CHECKED + 1)


# --- the page for marking -----------------------------------------------------------------------


def test_the_page_for_marking_has_codes_and_no_names_and_runs_nothing_of_a_students(
    graded: Class,
) -> None:
    text = (graded.target / "marking.html").read_text("utf-8")
    assert not set(re.findall(r"\w+", text)) & {part for name in NAMES for part in name.split()}
    page = BeautifulSoup(text, "html.parser")
    assert len(page.find_all("script")) == 1
    assert "alert" not in text
    assert not page.find_all(src=re.compile("^(?!data:)"))
    assert len(page.find_all("article")) == len(NAMES)
    # The problem, the solution and the rubric are there, with formulas that need no network.
    said = page.get_text(" ")
    assert "Why the sign is not a matter of taste" in said
    assert "Rubric" in said and "The solution, with its points" in said
    assert page.article.find("math")


def test_points_come_back_by_their_codes(graded: Class, tmp_path: Path) -> None:
    page = BeautifulSoup((graded.target / "marking.html").read_text("utf-8"), "html.parser")
    rows = [
        {"code": a["data-code"], "set": a["data-set"], "problem": a["data-problem"], "points": p}
        for a, p in zip(page.find_all("article"), ("1", "2,5", "9"), strict=True)
    ]
    marks.write_table(tmp_path / "marked.csv", list(rows[0]), rows)
    assert command.report(graded.target, tables=[tmp_path / "marked.csv"]) == 1
    assert "marked.csv, line 4: " in graded.said[0]
    codes = {e["code"]: e["student"] for e in json.loads(_records(graded).read_text("utf-8"))}
    earned = {row["student"]: row["points"] for row in graded.rows("written")}
    assert earned == {codes[r["code"]]: r["points"].replace(",", ".") for r in rows}
    # What was right replaces what was wrong.
    rows[2]["points"] = "3"
    marks.write_table(tmp_path / "marked.csv", list(rows[0]), rows)
    assert command.report(graded.target, tables=[tmp_path / "marked.csv"]) == 0


def _records(graded: Class) -> Path:
    return graded.target / "submissions.json"


@pytest.mark.thorough
def test_pictures_are_in_the_page(school: Class, notebook: Any, tmp_path: Path) -> None:
    cell_of(notebook, WRITTEN[0]).source = "![](page.png) ![](attachment:a.png)"
    cell_of(notebook, WRITTEN[0]).attachments = {"a.png": {"image/png": "QUJD"}}
    write(tmp_path / "in", {f"anna/{NAME}.ipynb": of_group(notebook, 5)})
    (tmp_path / "in" / "anna" / "page.png").write_bytes(b"XYZ")
    school.grade(tmp_path / "in")
    text = (school.target / "marking.html").read_text("utf-8")
    assert 'src="data:image/png;base64,WFla"' in text
    assert 'src="data:image/png;base64,QUJD"' in text


@pytest.mark.thorough
@pytest.mark.parametrize(
    "shown",
    ["![](attachment:a.png)", "![][r]", "![](attachment\\:a.png)", "![](attachment:lost.png)"],
)
def test_a_picture_is_in_the_page_once_however_often_it_is_shown(
    shown: str, school: Class, notebook: Any, tmp_path: Path
) -> None:
    cell_of(notebook, WRITTEN[0]).source = shown * 4000 + "\n\n[r]: <attachment:a.png>"
    cell_of(notebook, WRITTEN[0]).attachments = {"a.png": {"image/png": "QUJD" * 5000}}
    write(tmp_path / "in", {f"anna/{NAME}.ipynb": of_group(notebook, 5)})
    assert school.grade(tmp_path / "in") == 0
    assert (school.target / "marking.html").read_text("utf-8").count("QUJD" * 5000) == 1


@pytest.mark.thorough
def test_pictures_that_are_too_many_are_named_and_the_rest_is_graded(
    school: Class, notebook: Any, tmp_path: Path
) -> None:
    write(tmp_path / "in", {f"anna/{NAME}.ipynb": of_group(notebook, 5)})
    (tmp_path / "in" / "anna" / "small.png").write_bytes(b"XYZ")
    with (tmp_path / "in" / "anna" / "huge.png").open("wb") as file:
        file.truncate(60_000_000)
    assert school.grade(tmp_path / "in") == 0
    row = school.row("anna")
    assert row["total"] == marks.number(CHECKED)
    assert row["remarks"] == "huge.png was left out: the pictures have more than 50 MB"
    pictures = (school.target / "submitted" / "anna" / NAME).glob("*.png")
    assert [file.name for file in pictures] == ["small.png"]


# --- what goes back -----------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize("platform", ["moodle", "canvas"])
def test_feedback_goes_back_under_the_names_under_which_it_came(
    platform: str, school: Class, notebook: Any, tmp_path: Path
) -> None:
    text = of_group(notebook, 5)
    files = {
        "moodle": {
            f"Anna Müller_5001_assignsubmission_file_/{NAME}.ipynb": text,
            f"Bo_5002_assignsubmission_file/{NAME}.ipynb": text,  # as Moodle 4.1 and newer
            f"José Pérez_5003_assignsubmission_file_{NAME}.ipynb": text,
        },
        "canvas": {
            f"muelleranna_1001_90101_{NAME}.ipynb": text,
            f"bo_LATE_1002_90102_{NAME}-1.ipynb": text,
            f"bo_LATE_1002_90002_{NAME}.ipynb": "{",
            f"perezjose_1003_90103_{NAME}.ipynb": text,
        },
    }[platform]
    roster = (Student("Anna Maria Müller", "1001"), Student("José Pérez", "5003"))
    school.grade(write(tmp_path / "in", files), Course(roster))
    archive = school.target / f"{platform}_feedback_{NAME}.zip"
    if platform == "moodle":
        assert taken_by_moodle(archive) == dict.fromkeys((1, 2, 3), f"{NAME}.html")
        with zipfile.ZipFile(archive) as packed:
            folders = {name.partition("/")[0] for name in packed.namelist()}
        assert folders == {re.sub(r"(file_?).*", "file_", name) for name in files}
    else:
        assert taken_by_canvas(archive) == {k: (k, "html") for k in (1, 2, 3)}
    before = archive.read_bytes()
    assert command.report(school.target, Course(roster)) == 0
    assert archive.read_bytes() == before


# --- overrides and regrades ---------------------------------------------------------------------


@pytest.mark.thorough
def test_an_override_is_logged_survives_and_can_be_withdrawn(graded: Class, tmp_path: Path) -> None:
    key = ("Bo Rossi", NAME, "2.1")
    command.override(graded.target, key, "1,5", "Prof. X", "read it, the idea is right")
    less = POINTS["check-2-1"] - 1.5
    assert graded.row("Bo Rossi")["total"] == marks.number(CHECKED - less)
    graded.grade(tmp_path / "in")  # again
    (graded.target / "gradebook.db").unlink()
    graded.grade(tmp_path / "in")  # and from nothing
    assert graded.row("Bo Rossi")["2.1"] == "1.5"
    assert graded.row("Cléo")["total"] == marks.number(CHECKED)
    command.override(graded.target, key, "auto", "Prof. X", "a mistake of mine")
    assert graded.row("Bo Rossi")["total"] == marks.number(CHECKED)
    [first, second] = graded.rows("changes")
    assert re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d[+-]\d{4}$", first["when"])
    assert list(first.values())[1:] == [
        "Prof. X", "override", *key, marks.number(POINTS["check-2-1"]), "1.5",
        "read it, the idea is right",
    ]  # fmt: skip
    assert (second["old"], second["new"]) == ("1.5", "auto")


def test_an_override_of_a_written_answer_is_not_undone_by_the_table(graded: Class) -> None:
    command.override(graded.target, ("Cléo", NAME, PROBLEM), "3", "me", "it was on paper")
    graded.type("Cléo", points="1")
    assert command.report(graded.target) == 1
    assert "an override gives 3; withdraw it first" in "\n".join(graded.said)
    assert graded.row("Cléo")["total"] == marks.number(MAX)


@pytest.mark.parametrize(
    ("student", "problem", "points", "says"),
    [
        ("Bo Rosi", "2.1", "1", "nothing of Bo Rosi is graded in set2; there are: Anna Müller, Bo"),
        ("Bo Rossi", "2.9", "1", "set2 has no problem '2.9'; it has 2.1"),
        ("Bo Rossi", "2.1", "99", "99 is not between 0 and 3"),
        ("Bo Rossi", "2.1", "much", "'much' is no number; give a number, or auto"),
    ],
)
def test_an_override_of_nothing_changes_nothing(
    graded: Class, student: str, problem: str, points: str, says: str
) -> None:
    given = ["override", "--student", student, "--problem", problem, "--points", points]
    assert command.main([*given, "--why", "w", "--output", str(graded.target)]) == 2
    assert says in graded.said[0]
    assert not (graded.target / "changes.csv").exists()


@pytest.mark.thorough
def test_a_regrade_changes_what_was_asked_for_and_nothing_else(
    graded: Class, monkeypatch: pytest.MonkeyPatch
) -> None:
    graded.type("Anna Müller", points="2")
    command.report(graded.target)
    command.override(graded.target, ("Bo Rossi", NAME, "2.1"), "1", "me", "why not")

    class Harsher(Stub):
        def grade(self, ready: Any) -> Any:
            for outcome in super().grade(ready):
                low = {name: p and p - 1 for name, p in outcome.grades.items()}
                yield Outcome(outcome.submission, low)

    monkeypatch.setattr(command, "Batch", Harsher)
    assert command.regrade(graded.target, ["Anna Müller"], ["2.3"], "me", "the grader erred") == 0
    assert graded.row("Anna Müller")["total"] == marks.number(CHECKED + 2 - 1)
    assert graded.row("Cléo")["total"] == marks.number(CHECKED)
    assert command.regrade(graded.target, [], ["2.1"], "me", "it erred again") == 0
    assert graded.row("Bo Rossi")["2.1"] == "1"  # given by hand
    assert graded.row("Cléo")["total"] == marks.number(CHECKED - 1)
    log = [(row["student"], row["problem"], row["why"]) for row in graded.rows("changes")[1:]]
    again = "it erred again"
    assert log == [
        ("Anna Müller", "2.3", "the grader erred"),
        *((name, "2.1", again) for name in NAMES),
    ]


@pytest.mark.parametrize(
    ("problem", "says"),
    [("2.9", "nothing is graded of 2.9; there is 2.1, 2.2,"), ("9.1", "of 9.1; there is nothing")],
)
def test_a_regrade_of_no_problem_is_refused(graded: Class, problem: str, says: str) -> None:
    given = ["regrade", "--problem", problem, "--why", "w", "--as-root"]
    assert command.main([*given, "--output", str(graded.target)]) == 2
    assert says in graded.said[0]


# --- the class ----------------------------------------------------------------------------------


def test_the_page_of_the_class_counts_points_and_mistakes(graded: Class) -> None:
    kind = PROBLEMS["2.1"].misconceptions[0]
    data = {"text/html": f"<p>1.5 of 3 points</p><p><strong>→</strong> {kind.says}</p>"}
    for name in ("Anna_Müller", "Cléo"):
        page = nbformat.read(graded.target / "submitted" / name / NAME / f"{NAME}.ipynb", 4)
        cell_of(page, "check-2-1").outputs = [new_output("display_data", data)]
        place = graded.target / "autograded" / name / NAME
        place.mkdir(parents=True)
        nbformat.write(page, place / f"{NAME}.ipynb")
    command.override(graded.target, ("Bo Rossi", NAME, "2.1"), "1.5", "me", "half")
    page = BeautifulSoup((graded.target / "class.html").read_text("utf-8"), "html.parser")
    rows = [[cell.get_text() for cell in row.find_all("td")] for row in page.find_all("tr")]
    share = (2 + 1.5 / POINTS["check-2-1"]) / 3
    assert ["2.1", "3", f"{share:.0%}", "", "2", "0"] in rows
    assert ["2.1", kind.name, "2"] in rows
    assert "Müller" not in page.get_text()


# --- who runs it --------------------------------------------------------------------------------


def test_root_is_stopped_unless_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr("os.geteuid", lambda: 0)
    given = ["grade", str(tmp_path / "in"), "--output", str(tmp_path / "out")]
    assert command.main(given) == 2
    assert "--as-root" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert command.main([*given, "--as-root"]) == 2
    assert "there is no folder" in capsys.readouterr().err
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    assert command.main(given) == 2
    assert "there is no folder" in capsys.readouterr().err


# --- whose it is --------------------------------------------------------------------------------

TWO = tuple(f"Bo Rossi_{k}_assignsubmission_file_/{NAME}.ipynb" for k in (11, 12))


@pytest.mark.parametrize(
    ("roster", "graded_as", "reasons"),
    [
        (("11", "12"), {"Bo Rossi (11)", "Bo Rossi (12)"}, set()),
        ((), {"Bo Rossi (11)", "Bo Rossi (12)"}, set()),
        # The platform's numbers are not the roster's: nobody is told that nothing came.
        (("71", "72"), {"Bo Rossi (11)", "Bo Rossi (12)"}, {"Bo Rossi (71)", "Bo Rossi (72)"}),
    ],
)
def test_namesakes_are_graded_both(
    roster: tuple[str, ...],
    graded_as: set[str],
    reasons: set[str],
    school: Class,
    notebook: Any,
    tmp_path: Path,
) -> None:
    course = Course(tuple(Student("Bo Rossi", number) for number in roster))
    files = {name: of_group(notebook, 5 + k) for k, name in enumerate(TWO)}
    left = school.grade(write(tmp_path / "in", files), course)
    rows = {row["student"]: row for row in school.rows("grades")}
    assert {name for name, row in rows.items() if row["total"]} == graded_as
    assert {name for name, row in rows.items() if not row["total"]} == reasons
    assert left == len(reasons)
    said = "\n".join(school.said)
    assert "nothing was handed in" not in said
    assert ("not on the roster" in said) is False
    totals = {row["student"]: row["total"] for row in school.rows("course")}
    assert all(totals[name] == marks.number(CHECKED) for name in graded_as)
    assert taken_by_moodle(school.target / f"moodle_feedback_{NAME}.zip") == {
        k - 5000: f"{NAME}.html" for k in (11, 12)
    }


def test_an_extension_counts_however_the_name_is_written() -> None:
    from datetime import datetime

    due, later = datetime(2026, 11, 2), datetime(2026, 11, 9)
    students = (Student("Anna Müller", "7"), Student("Bo", "8"))
    for who in ("Anna Müller", "Müller, Anna", "7"):
        course = Course(students, {"set1": due}, {"set1": {who: later}})
        assert (course.due("set1", "Anna Müller"), course.due("set1", "Bo")) == (later, due)


# --- links --------------------------------------------------------------------------------------

Lay = Callable[[Path, Path], None]


def whole_folder(place: Path, outside: Path) -> None:
    (place / "eve").symlink_to(outside, target_is_directory=True)


def one_file(place: Path, outside: Path) -> None:
    (place / "eve").mkdir()
    (place / "eve" / f"{NAME}.ipynb").symlink_to(outside / f"{NAME}.ipynb")


def flat_file(place: Path, outside: Path) -> None:
    (place / f"eve_{NAME}.ipynb").symlink_to(outside / f"{NAME}.ipynb")


def nested_folder(place: Path, outside: Path) -> None:
    (place / "eve").mkdir()
    (place / "eve" / "work").symlink_to(outside, target_is_directory=True)


@pytest.mark.thorough
@pytest.mark.parametrize("zipped", [False, True])
@pytest.mark.parametrize("lay", [whole_folder, one_file, flat_file, nested_folder])
def test_no_link_is_followed(
    lay: Lay, zipped: bool, school: Class, notebook: Any, tmp_path: Path
) -> None:
    outside = write(tmp_path / "outside", {f"{NAME}.ipynb": of_group(notebook, 9)})
    place = write(tmp_path / "in", {f"anna/{NAME}.ipynb": of_group(notebook, 5)})
    lay(place, outside)
    if zipped:  # then what was given is copied first
        with zipfile.ZipFile(place / "bo_set2.zip", "w") as packed:
            packed.writestr(f"{NAME}.ipynb", of_group(notebook, 6))
    assert school.grade(place) == 1
    row = school.row("eve")
    assert row["total"] == ""
    assert "link" in row["remarks"] or lay is nested_folder
    assert school.row("anna")["total"] == marks.number(CHECKED)


def test_a_picture_that_is_a_link_is_left_out_and_said(
    school: Class, notebook: Any, tmp_path: Path
) -> None:
    (tmp_path / "secret.png").write_text(SECRET, "utf-8")
    place = write(tmp_path / "in", {f"eve/{NAME}.ipynb": of_group(notebook, 5)})
    (place / "eve" / "page.png").symlink_to(tmp_path / "secret.png")
    assert school.grade(place) == 0
    assert "page.png was left out: it is a link" in school.row("eve")["remarks"]
    for path in school.target.rglob("*"):
        assert not path.is_file() or SECRET.encode() not in path.read_bytes()


def test_nothing_is_unpacked_through_a_link(school: Class, notebook: Any, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    place = write(tmp_path / "in", {f"eve/{NAME}.ipynb": of_group(notebook, 5)})
    (place / "eve" / "mine").symlink_to(outside, target_is_directory=True)
    with zipfile.ZipFile(place / "eve" / "mine.zip", "w") as packed:
        packed.writestr("out.txt", "x")
    school.grade(place)
    assert not list(outside.iterdir())


# --- copies of the published solution -----------------------------------------------------------


def test_who_has_copied_the_published_solution_is_listed_however_many_they_are(
    school: Class, notebook: Any, tmp_path: Path
) -> None:
    from handin import CHECKED as PROBLEMS_OF_SET
    from handin import answer_cell, solution

    honest = of_group(notebook, 5)
    for this in PROBLEMS_OF_SET:
        cell_of(notebook, answer_cell(this)).source = solution(this)
    copied = of_group(notebook, 6)
    files = {f"s{k}/{NAME}.ipynb": copied if k % 2 else honest for k in range(8)}
    school.grade(write(tmp_path / "in", files))
    with (school.target / "similar.csv").open(encoding="utf-8") as file:
        found = {
            row["first"] for row in csv.DictReader(file) if row["second"].startswith("the publ")
        }
    assert found == {"s1", "s3", "s5", "s7"}
