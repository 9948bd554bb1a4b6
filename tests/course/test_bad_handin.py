"""Broken archives, notebooks, rosters, tables: each is named, the rest is graded, nothing lost."""

from __future__ import annotations

import io
import json
import os
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from exported import table
from handin import MAX, NAME, POINTS, WRITTEN, Stub, handed, of_group, write
from nrdob_course.grading import command, marks

CHECKED = marks.number(MAX - POINTS[WRITTEN[0]])
GOOD = f"Anna_1_assignsubmission_file_/{NAME}.ipynb"
BAD = f"Eve_2_assignsubmission_file_/{NAME}.ipynb"

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:Object of type")]
Said = list[str]


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Said:
    found: Said = []
    monkeypatch.setattr(command, "Batch", Stub)
    monkeypatch.setattr(command, "write_feedback", lambda *any: None)
    monkeypatch.setattr(
        "builtins.print", lambda *texts, **_: found.append(" ".join(map(str, texts)))
    )
    return found


@pytest.fixture
def good(released: Path) -> str:
    return of_group(handed(released), 5)


def zipped(files: dict[str, str | bytes], kind: int = zipfile.ZIP_STORED) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", kind) as packed:
        for name, content in files.items():
            packed.writestr(zipfile.ZipInfo(name, (2026, 11, 2, 12, 0, 0)), content)
    return data.getvalue()


# --- archives -----------------------------------------------------------------------------------


def damaged(good: str) -> bytes:
    data = zipped({GOOD: good, BAD: "#" * 500})
    return data.replace(b"#" * 500, b"#" * 499 + b"!")


def encrypted(good: str) -> bytes:
    data = bytearray(zipped({GOOD: good, BAD: "x"}))
    for start, flag in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.rindex(start) + flag] |= 1
    return bytes(data)


def other_method(good: str) -> bytes:
    data = bytearray(zipped({GOOD: good, BAD: "x"}))
    for start, method in ((b"PK\x03\x04", 8), (b"PK\x01\x02", 10)):
        data[data.rindex(start) + method] = 97
    return bytes(data)


def a_link(good: str) -> bytes:
    link = zipfile.ZipInfo(BAD)
    link.external_attr = 0o120777 << 16
    data = io.BytesIO(zipped({GOOD: good}))
    with zipfile.ZipFile(data, "a") as packed:
        packed.writestr(link, "/etc/passwd")
    return data.getvalue()


def doubled(good: str) -> bytes:
    other = BAD.replace("Eve", "Evf")
    return zipped({GOOD: good, BAD: good, other: "{"}).replace(other.encode(), BAD.encode())


ARCHIVES: dict[str, tuple[Callable[[str], bytes], str]] = {
    "a checksum": (damaged, f"'{BAD}' was left out: Bad CRC-32"),
    "a password": (encrypted, "is encrypted, password required"),
    "another method": (other_method, f"'{BAD}' was left out: That compression method"),
    "a link": (a_link, f"'{BAD}' was left out: it is a link"),
    "one name twice": (doubled, f"'{BAD}' was left out: one of this name was there before"),
    "a way out": (
        lambda good: zipped({GOOD: good, "../Eve/x.ipynb": "x"}),
        "'../Eve/x.ipynb' was left out: it leads out of the archive",
    ),
    "a file where a folder is": (
        lambda good: zipped({GOOD: good, BAD: "{", f"{BAD}/x.ipynb": good}),
        f"'{BAD}/x.ipynb' was left out: ",
    ),
    "a name that is too long": (
        lambda good: zipped({GOOD: good, "Eve_2_assignsubmission_file_/" + "x" * 300: "x"}),
        "was left out: [Errno 36] File name too long",
    ),
    "no archive in it": (
        lambda good: zipped({GOOD: good, BAD.replace(".ipynb", ".zip"): "x"}),
        f"Eve_2_assignsubmission_file_/{NAME}.zip was not unpacked: File is not a zip file",
    ),
    "a broken archive in it": (
        lambda good: zipped({GOOD: good, BAD.replace(".ipynb", ".zip"): damaged(good)}),
        f"Eve_2_assignsubmission_file_/{NAME}.zip: '{BAD}' was left out: Bad CRC-32",
    ),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", ARCHIVES)
def test_what_is_bad_in_an_archive_is_named_and_the_rest_is_graded(
    name: str, good: str, said: Said, tmp_path: Path
) -> None:
    make, fault = ARCHIVES[name]
    (tmp_path / "Course-Set 2-4711.zip").write_bytes(make(good))
    left = command.grade(tmp_path / "Course-Set 2-4711.zip", target=tmp_path / "out")
    assert left >= 1
    assert any(fault in text for text in said), said
    rows = {row["student"]: row for row in table(tmp_path / "out" / "grades.csv")}
    assert rows["Anna"]["total"] == CHECKED
    # Its owner is in the table, where the archive says who that is.
    assert "Eve" in rows or name in ("a way out",)


# --- notebooks ----------------------------------------------------------------------------------

NOTEBOOKS: dict[str, tuple[bytes, str]] = {
    "nothing": (b"", "the file is empty"),
    "blanks": (b" \n\t", "the file is empty"),
    "half of it": (b'{"cells": [\n {"source": ', "no valid JSON (Expecting value: line 2 column"),
    "a list": (b"[1, 2]", "the file is no notebook"),
    "a word": (b'"set2"', "the file is no notebook"),
    "another object": (b'{"name": "x"}', "the file is no notebook"),
    "cells that are none": (b'{"cells": [1, 2], "nbformat": 4}', "the file is no notebook"),
    "no cells": (b'{"cells": null, "nbformat": 4}', "the file cannot be read"),
    "a page of HTML": (b"<!DOCTYPE html><html>", "no valid JSON (Expecting value: line 1"),
    "bytes": (bytes(range(128, 256)), "the file cannot be read (UnicodeDecodeError"),
    "an archive": (zipped({"x": "y"}), "the file"),
    "too many values": (
        b'{"x": [' + b'{"a":{"b":{}}},' * 300_000 + b"1]}",
        "the file holds too much",
    ),
    "too deep": (b'{"cells": ' + b"[" * 10**5, "the file"),
    "another version": (b'{"cells": [], "nbformat": 99, "nbformat_minor": 0}', "set2"),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_broken_notebook_is_named_and_the_others_are_graded(
    name: str, good: str, said: Said, tmp_path: Path
) -> None:
    content, fault = NOTEBOOKS[name]
    write(tmp_path / "in", {f"anna/{NAME}.ipynb": good, f"eve/{NAME}.ipynb": ""})
    (tmp_path / "in" / "eve" / f"{NAME}.ipynb").write_bytes(content)
    left = command.grade(tmp_path / "in", target=tmp_path / "out")
    rows = {row["student"]: row for row in table(tmp_path / "out" / "grades.csv")}
    assert rows["anna"]["total"] == CHECKED
    assert left == 1 or name == "another version"
    assert fault in " ".join(rows["eve"].values())
    assert any("eve set2" in text and fault in text for text in said)


@pytest.mark.thorough
def test_a_broken_one_that_comes_later_costs_nothing(good: str, said: Said, tmp_path: Path) -> None:
    for text in (good, "{"):
        write(tmp_path / "in", {f"anna/{NAME}.ipynb": text})
        left = command.grade(tmp_path / "in", target=tmp_path / "out")
    assert left == 1
    assert any("no valid JSON" in text and "What was graded earlier stays" in text for text in said)
    [row] = table(tmp_path / "out" / "grades.csv")
    assert row["total"] == CHECKED


def in_depth(levels: int) -> Any:
    return {"a": in_depth(levels - 1)} if levels else "x"


LONG = "0x" + "F" * 4000
CELLS: dict[str, tuple[str, dict[str, Any], str]] = {
    "a group with 4000 digits": (
        "group",
        {"source": f"GROUP = {LONG}"},
        "GROUP has more than nine digits: ask for it; it was graded as 0",
    ),
    "a number with 4000 digits": ("answer-2-1", {"source": f"MASK = {LONG}"}, ""),
    "attachments 200 deep": (WRITTEN[0], {"attachments": {"p.png": in_depth(200)}}, ""),
    "attachments 400 deep": (WRITTEN[0], {"attachments": {"p.png": in_depth(400)}}, ""),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", CELLS)
def test_what_stands_in_a_cell_costs_nobody_else_anything(
    name: str, good: str, said: Said, tmp_path: Path
) -> None:
    id, change, remark = CELLS[name]
    notebook = json.loads(good)
    next(cell for cell in notebook["cells"] if cell["id"] == id).update(change)
    write(tmp_path / "in", {f"anna/{NAME}.ipynb": good, f"eve/{NAME}.ipynb": notebook})
    assert command.grade(tmp_path / "in", target=tmp_path / "out") == 0
    rows = {row["student"]: row for row in table(tmp_path / "out" / "grades.csv")}
    assert rows["anna"]["total"] == rows["eve"]["total"] == CHECKED
    assert rows["eve"]["remarks"].startswith(remark) and len(rows["eve"]["remarks"]) < 200
    assert (tmp_path / "out" / "similar.csv").exists()


@pytest.mark.thorough
def test_a_notebook_that_cannot_be_written_is_named_briefly(
    good: str, said: Said, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "in", {f"anna/{NAME}.ipynb": good, f"eve/{NAME}.ipynb": good})
    whole = command.nbformat.write

    def narrow(notebook: Any, path: Path) -> None:
        if "eve" in path.parts:
            raise ValueError("x" * 10**5)
        whole(notebook, path)

    monkeypatch.setattr(command.nbformat, "write", narrow)
    assert command.grade(tmp_path / "in", target=tmp_path / "out") == 1
    rows = {row["student"]: row for row in table(tmp_path / "out" / "grades.csv")}
    assert rows["anna"]["total"] == CHECKED
    assert rows["eve"]["remarks"].startswith("not graded: its cells cannot be read (ValueError: x")
    assert len(rows["eve"]["remarks"]) < 300


# --- names --------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform != "linux", reason="needs names that are any bytes")
def test_names_in_another_encoding_are_told_apart_and_written(
    good: str, said: Said, tmp_path: Path
) -> None:
    place = os.fsencode(write(tmp_path / "in", {f"anna/{NAME}.ipynb": good}))
    moodle = b"B\xf6hm_7_assignsubmission_file_"
    for name in (b"M\xfcller", b"M\xf6ller", moodle):
        os.mkdir(place + b"/" + name)
        with open(place + b"/" + name + b"/l\xf6sung.ipynb", "w", encoding="utf-8") as file:
            file.write(good)
    os.mkdir(place + b"/Zo\xeb")
    os.symlink(b"nowhere", place + b"/M\xfcller/\xff.png")
    Path(os.fsdecode(place + b"/Zo\xeb/l\xf6sung.txt")).touch()
    assert command.grade(tmp_path / "in", target=tmp_path / "out") == 1
    rows = {row["student"]: row for row in table(tmp_path / "out" / "grades.csv")}
    assert list(rows) == ["B\\xf6hm", "M\\xf6ller", "M\\xfcller", "Zo\\xeb", "anna"]
    assert [row["total"] for row in rows.values()] == [CHECKED] * 3 + ["", CHECKED]


def test_a_name_that_the_terminal_cannot_show_stops_nothing(
    good: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "Batch", Stub)
    monkeypatch.setattr(command, "write_feedback", lambda *any: None)
    shown = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(shown, "cp1252", write_through=True))
    write(tmp_path / "in", {f"Łukasz/{NAME}.ipynb": good})
    given = ["grade", str(tmp_path / "in"), "--as-root", "--output", str(tmp_path / "out")]
    assert command.main(given) == 0
    assert b"?ukasz" in shown.getvalue()


# --- rosters and settings -----------------------------------------------------------------------

ROSTERS: dict[str, tuple[str | bytes, str]] = {
    "no names": ("number;group\n1;2\n", "r.csv needs a column name; it has number, group"),
    "nothing": ("", "r.csv needs a column name; it has none"),
    "a group in words": (
        "name,group\nAnna,1\nEve,two\n",
        "r.csv, line 3: the group of Eve is 'two'",
    ),
    "too many cells": ("id,name\n1,Anna\n2,Eve,,x\n", "r.csv, line 3: it has more cells"),
    "a number twice": ("id,name\n1,Anna\n1,Eve\n", "r.csv, line 3: Eve cannot be told from Anna"),
    "a name twice": ("name\nAnna\nAnna\n", "r.csv, line 3: Anna cannot be told from Anna"),
    "a spreadsheet": (zipped({"x": "y"}) + b"\xff", "r.csv, line 1: it is a spreadsheet"),
    "another encoding": ("id,name\n1,José\n".encode("latin-1"), "r.csv, line 2: it is in another"),
    "an open quote": ('id,name\n1,"Anna\n2,Eve\n', "r.csv, line 3: unexpected end of data"),
}

SETTINGS: dict[str, tuple[str | bytes, str]] = {
    "no TOML": ("roster = ", "course.toml cannot be read: Invalid value (at end of"),
    "no UTF-8": (b'roster = "\xff"', "course.toml cannot be read: 'utf-8' codec"),
    "no table": ('late = "never"', "course.toml: late = 'never' is no table: write [late]"),
    "a word for a number": ('[late]\nper_day = "ten"', "late.per_day = 'ten' is no number from 0"),
    "a negative number": ("[late]\ngrace = -5", "late.grace = -5 is no number from 0 to"),
    "no end of grace": ("[late]\ngrace = inf", "late.grace = inf is no number from 0 to a million"),
    "no day of ours": (
        "[deadlines]\nset2 = 9999-12-31T23:59:00",
        "set2 = 9999-12-31 23:59:00 is no time like",
    ),
    "no such set": ("[deadlines]\nset99 = 2026-11-02T12:00:00", "there is no set99"),
    "a name for a table": ('[extensions]\nset1 = "Anna"', "'Anna' stands where names and times"),
    "brackets too deep": (
        "roster = " + "[" * 3000,
        "course.toml cannot be read: maximum recursion",
    ),
    "a name that no system takes": (f'roster = "{"r" * 400}.csv"', "there is no roster "),
    "a roster that is none": ("roster = 7", "roster = 7 is no name of a file"),
    "nobody's extension": (
        'roster = "ok.csv"\n[extensions.set2]\nAna = 2026-11-02T12:00:00',
        "extensions.set2: nobody on the roster, or more than one, is called 'Ana'",
    ),
}


@pytest.mark.parametrize(("name", "kind"), [(n, "r.csv") for n in ROSTERS] + [
    (n, "course.toml") for n in SETTINGS
])  # fmt: skip
def test_a_bad_roster_or_setting_is_named_before_anything_is_graded(
    name: str, kind: str, good: str, said: Said, tmp_path: Path
) -> None:
    content, fault = (ROSTERS if kind == "r.csv" else SETTINGS)[name]
    write(tmp_path, {"course.toml": 'roster = "r.csv"', "ok.csv": "name\nAnna\n"})
    data = content if isinstance(content, bytes) else content.encode()
    (tmp_path / kind).write_bytes(data)
    write(tmp_path / "in", {f"anna/{NAME}.ipynb": good})
    options = ["--course", str(tmp_path / "course.toml"), "--output", str(tmp_path / "out")]
    assert command.main(["grade", str(tmp_path / "in"), "--as-root", *options]) == 2
    assert any(fault in text for text in said), said
    assert not (tmp_path / "out").exists()


# --- what the grading itself has written --------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("file", "content", "fault"),
    [
        ("submissions.json", '[{"student": ', "submissions.json cannot be read: Expecting value"),
        ("gradebook.db", "no database " * 100, "gradebook.db cannot be read or written"),
        ("changes.csv", "how,student,set,problem,new\noverride,a,set2,2.1,x\n", "csv, line 2: 'x'"),
    ],
)
def test_a_broken_file_of_the_grading_stops_it_and_stays(
    file: str, content: str, fault: str, good: str, said: Said, tmp_path: Path
) -> None:
    write(tmp_path / "in", {f"anna/{NAME}.ipynb": good})
    given = ["grade", str(tmp_path / "in"), "--as-root", "--output", str(tmp_path / "out")]
    assert command.main(given) == 0
    before = (tmp_path / "out" / "written.csv").read_bytes()
    (tmp_path / "out" / file).write_text(content, "utf-8")
    assert command.main(given) == 2
    assert any(fault in text for text in said), said[-5:]
    assert (tmp_path / "out" / file).read_text("utf-8") == content
    assert (tmp_path / "out" / "written.csv").read_bytes() == before


def test_files_of_strange_kinds_stop_nothing(good: str, said: Said, tmp_path: Path) -> None:
    place = write(tmp_path / "in", {f"anna/{NAME}.ipynb": good, "note.txt": "x"})
    for name in ("pipe", "deep"):
        (place / name).mkdir()
    if hasattr(os, "mkfifo"):
        os.mkfifo(place / "pipe" / f"{NAME}.ipynb")
    (place / "deep" / f"{NAME}.ipynb").mkdir()
    (place / "broken").symlink_to(tmp_path / "nowhere")
    (place / "round").symlink_to(place)
    command.grade(place, target=tmp_path / "out")
    rows: dict[str, Any] = {row["student"]: row for row in table(tmp_path / "out" / "grades.csv")}
    assert rows["anna"]["total"] == CHECKED
    assert {"pipe", "deep", "broken", "round", "note.txt"} <= set(rows)
    assert "not graded" in json.dumps(rows["pipe"])
