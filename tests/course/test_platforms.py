"""Files as learning platforms give them, and tables as they take them."""

from __future__ import annotations

import json
import os
import re
import time
import zipfile
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from exported import CLASS, Sent, canvas, moment_of, moodle, plan, read_canvas, read_moodle, table
from handin import KNOWN, NAME, POINTS, Stub, handed, of_group, tiny, write
from nrdob_course.grading import command as exercises
from nrdob_course.grading import marks, platforms, submissions, written
from nrdob_course.grading.roster import Course, Student, read_course, spellings

pytestmark = pytest.mark.filterwarnings("ignore:Object of type")

ANNA = "Anna Müller_12345_assignsubmission_file_"


# --- names --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "student", "identifier", "file"),
    [
        (ANNA, "Anna Müller", "12345", ""),
        ("Anna Müller_12345_assignsubmission_file", "Anna Müller", "12345", ""),
        (f"{ANNA}set1.ipynb", "Anna Müller", "12345", "set1.ipynb"),
        ("de la Cruz_José_7_assignsubmission_file_", "de la Cruz_José", "7", ""),
        ("Participant_99_assignsubmission_file_", "Participant 99", "99", ""),
        ("muelleranna_12345_67890_set1.ipynb", "muelleranna", "12345", "set1.ipynb"),
        ("muelleranna_LATE_12345_67890_set1.ipynb", "muelleranna", "12345", "set1.ipynb"),
        ("muelleranna_12345_67890_set1-2.ipynb", "muelleranna", "12345", "set1.ipynb"),
    ],
)
def test_whose_a_file_is(name: str, student: str, identifier: str, file: str) -> None:
    found = platforms.owner_of(name)
    assert found is not None
    assert (found[0].student, found[0].identifier, found[1]) == (student, identifier, file)


@pytest.mark.parametrize("name", ["anna", "anna_set1.ipynb", "set1.ipynb", "anna_1_set1.ipynb"])
def test_other_names_are_no_platforms(name: str) -> None:
    assert platforms.owner_of(name) is None


@pytest.mark.parametrize(
    ("name", "spelling"),
    [
        ("Anna Müller", "muelleranna"),
        ("Anna Müller", "mulleranna"),
        ("Anna Müller", "annamüller"),
        ("Müller, Anna", "annamuller"),
        ("José de la Cruz", "delacruzjose"),
        ("Ørsted Hans", "hansørsted"),
    ],
)
def test_a_name_is_known_however_it_is_written(name: str, spelling: str) -> None:
    assert spelling in spellings(name)


def test_two_of_one_name_are_known_by_their_numbers_only() -> None:
    course = Course((Student("Anna Müller", "1"), Student("Anna Müller", "2")))
    assert course.find("Anna Müller") is None
    found = course.find("Anna Müller", "2")
    assert found is not None and found.identifier == "2"


@pytest.mark.parametrize(
    ("files", "found"),
    [
        ({f"{ANNA}/set1.ipynb": 1}, ["Anna Müller set1"]),
        ({f"{ANNA}set1.ipynb": 1}, ["Anna Müller set1"]),
        (
            {f"{ANNA}/set1.ipynb": 1, f"{ANNA.replace('file', 'onlinetext')}/x.html": "hi"},
            ["Anna Müller set1"],
        ),
        (
            {"Bo_2_assignsubmission_onlinetext_/onlinetext.html": "hi", f"{ANNA}/set1.ipynb": 1},
            ["Anna Müller set1", "Bo set1: a text was typed"],
        ),
        (
            {f"Bo_{k}_assignsubmission_file_/set1.ipynb": 1 for k in (1, 2)},
            ["Bo (1) set1", "Bo (2) set1"],
        ),
        ({"a_1_5_set1.ipynb": 1, "a_1_9_set1-1.ipynb": 1}, ["a set1 (a_1_5_set1.ipynb was left)"]),
        ({"a_LATE_1_5_set1.ipynb": 1}, ["a set1 (late, says Canvas)"]),
        ({"a_1_5_my work.ipynb": 1}, ["a set1 (taken from a_1_5_my work.ipynb)"]),
        ({"a_1_5_essay.pdf": "x", "b_2_6_set1.ipynb": 1}, ["a set1: it is no notebook", "b set1"]),
        # Nobody who handed in another set is told that nothing came.
        ({"a/set1.ipynb": 1, "b/set2.ipynb": 2}, ["a set1", "b set2"]),
    ],
)  # fmt: skip
def test_what_platforms_give_is_found(
    files: dict[str, Any], found: list[str], tmp_path: Path
) -> None:
    contents = {k: tiny(v) if isinstance(v, int) else v for k, v in files.items()}
    result = submissions.find(write(tmp_path, contents), KNOWN)
    told = []
    for this in result:
        note = f": {this.reason}" if this.reason else ""
        note += f" ({this.remarks[0]})" if this.remarks else ""
        told.append(f"{this.student} {this.set}{note}")
    assert len(told) == len(found)
    for line, start in zip(sorted(told), sorted(found), strict=True):
        assert line.startswith(start.removesuffix(")"))


# --- archives -----------------------------------------------------------------------------------


def pack(path: Path, files: dict[str, bytes | str]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in files.items():
            packed.writestr(name, content)
    return path


def unpack(given: Path, place: Path) -> tuple[list[str], list[str]]:
    place.mkdir()
    told = list(platforms.unpacked(given, place))
    return told, sorted(p.relative_to(place).as_posix() for p in place.rglob("*") if p.is_file())


def test_an_export_a_students_archive_and_plain_files_lie_side_by_side(tmp_path: Path) -> None:
    given = tmp_path / "given"
    given.mkdir()
    pack(given / "CS 1-Set 1-4711.zip", {f"{ANNA}/set1.ipynb": "{}", f"{ANNA}/page.jpg": b"x"})
    pack(given / "b_2_6_work.zip", {"set1.ipynb": "{}"})
    pack(given / "cleo_set1.zip", {"set1.ipynb": "{}"})
    (given / "dan").mkdir()
    pack(given / "dan" / "mine.zip", {"deep/set1.ipynb": "{}"})
    told, found = unpack(given, tmp_path / "place")
    assert told == []
    assert found == [
        f"{ANNA}/page.jpg",
        f"{ANNA}/set1.ipynb",
        "b_2_6_work/set1.ipynb",
        "cleo_set1/set1.ipynb",
        "dan/mine/deep/set1.ipynb",
    ]


@pytest.mark.parametrize(
    "name", ["../out.ipynb", "/etc/out.ipynb", "a/../../out.ipynb", "..\\out.ipynb", "C:/out.ipynb"]
)
def test_no_archive_writes_outside_of_its_folder(name: str, tmp_path: Path) -> None:
    told, found = unpack(pack(tmp_path / "x.zip", {name: "x", "b.txt": "y"}), tmp_path / "place")
    assert told == [f"x.zip: {name!r} was left out: it leads out of the archive"]
    assert found == ["b.txt"]
    assert not list(tmp_path.rglob("out.ipynb"))


def test_a_students_archive_is_the_students_whatever_it_is_called(tmp_path: Path) -> None:
    (tmp_path / "given").mkdir()
    for name in ("bob_set1.zip", "carl_set1.ipynb.zip", "dora.zip", "eva.zip"):
        mac = {"__MACOSX/._set1.ipynb": "x"}
        pack(tmp_path / "given" / name, {"set1.ipynb": json.dumps(tiny(1)), **mac})
    told, _ = unpack(tmp_path / "given", tmp_path / "place")
    found = submissions.find(tmp_path / "place", KNOWN)
    assert told == []
    assert [(this.student, this.reason) for this in found] == [
        ("bob", ""), ("carl", ""), ("dora", ""), ("eva", "")
    ]  # fmt: skip


def test_nothing_of_an_archive_is_written_over_anything(tmp_path: Path) -> None:
    given = write(tmp_path / "given", {"anna/set1.ipynb": "by hand"})
    pack(given / "One.zip", {"anna/set1.ipynb": "1", "bo/set1.ipynb": "1"})
    pack(given / "Two.zip", {"bo/set1.ipynb": "2"})
    told, _ = unpack(given, tmp_path / "place")
    assert told == [
        "One.zip: 'anna/set1.ipynb' was left out: one of this name was there before",
        "Two.zip: 'bo/set1.ipynb' was left out: one of this name was there before",
    ]
    assert (tmp_path / "place" / "anna" / "set1.ipynb").read_text("utf-8") == "by hand"
    assert (tmp_path / "place" / "bo" / "set1.ipynb").read_text("utf-8") == "1"


def test_no_link_is_unpacked(tmp_path: Path) -> None:
    link = zipfile.ZipInfo("a")
    link.external_attr = 0o120777 << 16
    with zipfile.ZipFile(tmp_path / "x.zip", "w") as packed:
        packed.writestr(link, "/etc/passwd")
    told, _ = unpack(tmp_path / "x.zip", tmp_path / "place")
    assert "is a link" in told[0]


def test_no_bomb_is_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platforms, "ONE_FILE", 10**6)
    told, _ = unpack(pack(tmp_path / "x.zip", {"a": b"0" * 10**7}), tmp_path / "one")
    assert "too large" in told[0]
    monkeypatch.setattr(platforms, "MOST_BYTES", 10**6)
    many = {str(k): b"0" * 10**5 for k in range(20)}
    told, _ = unpack(pack(tmp_path / "y.zip", many), tmp_path / "two")
    assert "holds too much" in told[0]


def test_a_file_that_is_larger_than_it_says_is_not_unpacked(tmp_path: Path) -> None:
    path = pack(tmp_path / "x.zip", {"a": b"0" * 10**6})
    data = path.read_bytes()
    path.write_bytes(data.replace((10**6).to_bytes(4, "little"), (100).to_bytes(4, "little")))
    told, _ = unpack(path, tmp_path / "place")
    assert len(told) == 1
    assert all(p.stat().st_size <= 10**5 for p in (tmp_path / "place").rglob("a"))


def test_what_is_no_archive_is_told(tmp_path: Path) -> None:
    (tmp_path / "given").mkdir()
    (tmp_path / "given" / "b.zip").write_text("x", "utf-8")
    told, found = unpack(tmp_path / "given", tmp_path / "place")
    assert told == ["b.zip was not unpacked: File is not a zip file"]
    assert found == ["b.zip"]


def test_the_time_in_the_archive_is_the_time_of_the_file(tmp_path: Path) -> None:
    entry = zipfile.ZipInfo("anna/set1.ipynb", (2026, 11, 2, 13, 30, 0))
    with zipfile.ZipFile(tmp_path / "x.zip", "w") as packed:
        packed.writestr(entry, json.dumps(tiny(1)))
    unpack(tmp_path / "x.zip", tmp_path / "place")
    [this] = submissions.find(tmp_path / "place", KNOWN)
    assert this.handed_in is not None
    assert this.handed_in.replace(tzinfo=None) == datetime(2026, 11, 2, 13, 30)


def test_what_a_student_has_packed_has_the_time_at_which_it_was_handed_in(tmp_path: Path) -> None:
    inner = zipfile.ZipInfo("set1.ipynb", (2020, 1, 1, 0, 0, 0))
    with zipfile.ZipFile(tmp_path / "work.zip", "w") as packed:
        packed.writestr(inner, json.dumps(tiny(1)))
    for name in (f"{ANNA}/work.zip", "muelleranna_12345_67890_work.zip"):
        outer = zipfile.ZipInfo(name, (2026, 11, 2, 13, 30, 0))
        place = tmp_path / name.split("_")[0]
        with zipfile.ZipFile(tmp_path / "x.zip", "w") as packed:
            packed.writestr(outer, (tmp_path / "work.zip").read_bytes())
        unpack(tmp_path / "x.zip", place)
        [this] = submissions.find(place, KNOWN)
        assert this.handed_in is not None
        assert this.handed_in.replace(tzinfo=None) == datetime(2026, 11, 2, 13, 30)


@pytest.mark.parametrize("name", [f"{ANNA}/work.zip", "bob_set1.zip", "dora.zip"])
def test_a_student_who_packs_a_note_of_the_time_gains_nothing(name: str, tmp_path: Path) -> None:
    path = tmp_path / "given" / name
    path.parent.mkdir(parents=True)
    pack(path, {"set1.ipynb": json.dumps(tiny(1)), "Timestamp.txt": "2020-01-01 12:00:00 UTC"})
    moment = datetime(2026, 11, 2, 13, 30).timestamp()
    os.utime(path, (moment, moment))
    told, _ = unpack(tmp_path / "given", tmp_path / "place")
    [this] = submissions.find(tmp_path / "place", KNOWN)
    assert this.handed_in is not None and this.handed_in.timestamp() == moment
    assert "'Timestamp.txt' was left out: the time of the archive counts" in told[0]


def test_a_note_of_the_time_that_a_platform_gives_is_a_students_own(tmp_path: Path) -> None:
    write(
        tmp_path, {f"{ANNA}/set1.ipynb": tiny(1), f"{ANNA}/timestamp.txt": "2020-01-01 12:00 UTC"}
    )
    [this] = submissions.find(tmp_path, KNOWN)
    assert this.handed_in is not None and this.handed_in.year > 2020


# --- a class of sixty ---------------------------------------------------------------------------


@pytest.fixture
def notebook(released: Path) -> Any:
    return handed(released)


def sent(notebook: Any) -> list[Sent]:
    """What the class hands in: one has taken another's number, one file is broken."""
    return [
        Sent(
            of_group(notebook, 101 if k == 7 else 101 + k) if k != 9 else "{",
            moment_of(k),
            earlier=of_group(notebook, 1) if k % 6 == 0 else "",
            zipped=k % 10 == 4,
        )
        for k in range(60)
    ]


@pytest.mark.thorough
@pytest.mark.parametrize("platform", [moodle, canvas])
def test_sixty_exported_graded_and_brought_back(
    platform: Any, notebook: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exercises, "Batch", Stub)
    monkeypatch.setattr("builtins.print", lambda *texts, **_: None)
    course, archive = plan(tmp_path, NAME), platform(tmp_path, NAME, sent(notebook))
    target = tmp_path / "out"
    # One has not come, one cannot be read.
    assert exercises.grade(archive, target=target, plan=course) == 2

    rows = {row["student"]: row for row in table(target / "grades.csv")}
    assert set(rows) == {*CLASS, "Zoe Absent"}
    checked = sum(most for name, most in POINTS.items() if "written" not in name)
    assert rows[CLASS[0]]["total"] == marks.number(checked)
    assert (rows[CLASS[1]]["late"], rows[CLASS[1]]["total"]) == (
        "2 d, −20 %",
        marks.number(0.8 * checked),
    )
    assert rows[CLASS[2]]["late"] == rows[CLASS[3]]["late"] == ""
    assert "group 101, and 108 on the roster" in rows[CLASS[7]]["remarks"]
    assert "not graded: the file is no valid JSON" in rows[CLASS[9]]["remarks"]
    assert rows["Zoe Absent"]["remarks"] == "not graded: nothing was handed in"

    whole = {row["student"]: row for row in table(target / "course.csv")}
    assert whole["Zoe Absent"]["not handed in"] == NAME
    assert whole[CLASS[9]]["not graded"] == NAME
    assert whole[CLASS[0]]["id"] == "1000" and whole[CLASS[0]]["group"] == "101"

    late = page_of(target, CLASS[1])
    assert "each day begun costs 10 % of the points; after 5 days nothing is earned" in late
    assert f"Points so far before the rule: {checked:g} of {sum(POINTS.values()):g}" in late

    # Nothing is final before the answers in words are marked.
    answers = table(target / "written.csv")
    for row in answers:
        row["points"] = row["of"]
    marks.write_table(target / "written.csv", list(written.WRITTEN), answers)
    monkeypatch.setattr(exercises, "write_feedback", lambda *any: None)
    name = f"moodle_{NAME}.csv" if platform is moodle else "canvas.csv"
    column = "Grade" if platform is moodle else NAME
    assert {row[column] for row in table(target / name)} <= {"", marks.number(sum(POINTS.values()))}
    assert exercises.report(target, course) == 0

    assert_only_the_late_page_says_so(target, sum(POINTS.values()))
    rows_back = table(target / name)
    grades = read_moodle(rows_back) if platform is moodle else read_canvas(rows_back, NAME)
    assert set(grades) == set(range(60)) - {9}
    full = sum(POINTS.values())
    assert tuple(map(float, grades[0])) == (full, full)
    assert float(grades[1][0]) == pytest.approx(0.8 * full)


def page_of(target: Path, student: str) -> str:
    folder = student.replace(" ", "_")
    return (target / "feedback" / folder / NAME / f"{NAME}.html").read_text("utf-8")


def assert_only_the_late_page_says_so(target: Path, marked: float) -> None:
    late = [student for student in CLASS[:9] if "late" in page_of(target, student)]
    assert late == [CLASS[1]]
    page = page_of(target, CLASS[1])
    assert page.count("This came late. It was due 2026-11-02 at 23:59 and came 2026-11-04 at") == 1
    assert "which counts as 2 days" in page
    assert f"Points before the rule: {marked:g} of {marked:g}; after it: {0.8 * marked:g}." in page


@pytest.mark.thorough
def test_what_was_graded_stays_when_a_late_one_comes_alone(
    notebook: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exercises, "Batch", Stub)
    monkeypatch.setattr("builtins.print", lambda *texts, **_: None)
    course = Course((Student("Anna Müller", "1", 5), Student("Bo Rossi", "2", 6)))
    for first, folder in (("Anna Müller", "one"), ("Bo Rossi", "two")):
        write(tmp_path / folder, {f"{first}/{NAME}.ipynb": of_group(notebook, 5)})
        exercises.grade(tmp_path / folder, target=tmp_path / "out", plan=course)
    rows = table(tmp_path / "out" / "grades.csv")
    assert [row["total"] for row in rows] == [rows[0]["total"]] * 2 != ["", ""]
    assert rows[1]["remarks"] == "group 5, and 6 on the roster"


# --- settings -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ("x = ", "cannot be read"),
        ("[late]\nper_week = 3", "knows no late.per_week"),
        ("[deadline]", "knows no deadline"),
        ('[deadlines]\nset1 = "soon"', "set1 = soon is no time"),
        ('roster = "nowhere.csv"', "there is no roster"),
    ],
)
def test_settings_that_mean_nothing_are_named(settings: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "course.toml").write_text(settings, "utf-8")
    with pytest.raises(ValueError, match=re.escape(says)):
        read_course(tmp_path / "course.toml")


@pytest.mark.parametrize(
    ("text", "students"),
    [
        ("id,name,group\n7,Anna,3\n", [("Anna", "7", 3)]),
        ("\ufeffName;Group\nAnna;\n", [("Anna", "", None)]),
        ("First name,Last name,ID number\nAnna,Müller,7\n", [("Anna Müller", "7", None)]),
        ('Student,ID\n    Points Possible,\n"Müller, Anna",7\n', [("Müller, Anna", "7", None)]),
    ],
)  # fmt: skip
def test_rosters_are_read(text: str, students: list[Any], tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(text, "utf-8")
    (tmp_path / "course.toml").write_text('roster = "r.csv"', "utf-8")
    found = read_course(tmp_path / "course.toml").students
    assert [(each.name, each.identifier, each.group) for each in found] == students


def test_no_cell_of_a_table_is_a_formula(tmp_path: Path) -> None:
    row = {"student": "=HYPERLINK(1)", "points": "-2.5", "answer": "@x", "set": "+cmd"}
    marks.write_table(tmp_path / "t.csv", list(row), [row])
    [found] = table(tmp_path / "t.csv")
    assert found == {"student": "'=HYPERLINK(1)", "points": "-2.5", "answer": "'@x", "set": "'+cmd"}


def test_nbgraders_own_timestamp_comes_first(tmp_path: Path) -> None:
    write(tmp_path, {"a/set1.ipynb": tiny(1), "a/timestamp.txt": "2026-11-02 12:00:00.5 UTC"})
    os.utime(tmp_path / "a" / "set1.ipynb", (time.time(), time.time()))
    [this] = submissions.find(tmp_path, KNOWN)
    assert this.handed_in is not None
    assert this.handed_in.isoformat().startswith("2026-11-02T12:00:00.5")
