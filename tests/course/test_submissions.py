"""What was handed in: found, read, put right."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import nbformat
import pytest

from handin import KNOWN, tiny, write
from nrdob_course.grading import marks, submissions


@pytest.mark.parametrize(
    ("files", "wanted", "found"),
    [
        ({"a/set1.ipynb": 1, "b/set1.ipynb": 1}, (), ["a set1", "b set1"]),
        ({"a/set1.ipynb": 1, "a/set2.ipynb": 2}, (), ["a set1", "a set2"]),
        ({"a/set1.ipynb": 1, "a/set2.ipynb": 2}, ("set2",), ["a set2"]),
        ({"a/set1/set1.ipynb": 1}, (), ["a set1"]),
        ({"a_set1.ipynb": 1, "b-set-01.ipynb": 1}, (), ["a set1", "b set1 taken"]),
        ({"a_set1/set1.ipynb": 1, "b_set1.zip": "x"}, (), ["a set1", "b set1 refused"]),
        ({"a/.ipynb_checkpoints/set1.ipynb": 1, "a/set1.ipynb": 1}, (), ["a set1"]),
        ({".git/set1.ipynb": 1, "__MACOSX/x.ipynb": 1, "a/set1.ipynb": 1}, (), ["a set1"]),
        # The cells tell what it is, whatever it is called.
        ({"a/Set 1 (2).ipynb": 1}, (), ["a set1 taken"]),
        ({"a/homework.ipynb": 2}, (), ["a set2 taken"]),
        ({"a/set1.ipynb": 2}, (), ["a set2 taken"]),
        ({"a/set1.ipynb.txt": 1}, (), ["a set1 taken"]),
        ({"a/SET1.IPYNB": 1}, (), ["a set1 taken"]),
        ({"a/deep/in/set1.ipynb": 1}, (), ["a set1 taken"]),
        # The proper name wins; without it nobody can choose.
        ({"a/set1.ipynb": 1, "a/old.ipynb": 1}, (), ["a set1 left out"]),
        ({"a/new.ipynb": 1, "a/old.ipynb": 1}, (), ["a set1 refused"]),
        ({"a/set1.ipynb": 1, "a_set1.ipynb": 1}, (), ["a set1 left out"]),
        # Missing, unreadable, unknown.
        ({"a/set1.ipynb": 1, "b/notes.txt": "x"}, (), ["a set1", "b set1 refused"]),
            ({"b/notes.txt": "x"}, (), ["b  refused"]),
        ({"a/set1.ipynb": 1, "a/set2.ipynb": 2, "b/set2.ipynb": 2}, (),
         ["a set1", "a set2", "b set2"]),
        ({"a/set1.ipynb": "{"}, (), ["a set1 refused"]),
        ({"a/set1.ipynb": "[]"}, (), ["a set1 refused"]),
        ({"a/set1.ipynb": '{"cells": [1]}'}, (), ["a set1 refused"]),
        ({"a/set1.ipynb": 1, "b/what.ipynb": "{"}, (), ["a set1", "b set1 refused"]),
        # Nobody's.
        ({"a/set1.ipynb": 1, "set1.ipynb": 1}, (), ["a set1", "set1.ipynb set1 refused"]),
        ({"a/set1.ipynb": 1, "b.zip": "x"}, (), ["a set1", "b.zip  refused"]),
        ({"a/what.ipynb": "{"}, (), ["a  refused"]),
    ],
)  # fmt: skip
def test_finding(
    files: dict[str, Any], wanted: tuple[str, ...], found: list[str], tmp_path: Path
) -> None:
    contents = {k: tiny(v) if isinstance(v, int) else v for k, v in files.items()}
    result = submissions.find(write(tmp_path, contents), KNOWN, wanted)
    told = []
    for this in result:
        remark = this.remarks[0] if this.remarks else ""
        note = next((word for word in ("taken", "left out") if word in remark), "")
        told.append(f"{this.student} {this.set} {'refused' if this.reason else note}".strip())
    assert sorted(told) == sorted(found)
    assert all(this.reason or this.notebook for this in result)


def test_answers_whose_cells_have_lost_their_names_are_not_marked_as_missing(
    tmp_path: Path,
) -> None:
    content = tiny(1)
    for cell in content["cells"]:
        cell.update(id="x", metadata={})
    write(tmp_path, {"a/set1.ipynb": content})
    [this] = submissions.find(tmp_path, KNOWN)
    assert "ask for the answers" in this.reason


@pytest.mark.parametrize(
    "data",
    [
        b"\xff\xfe" + json.dumps(tiny(1)).encode("utf-16-le"),
        b"\xef\xbb\xbf" + json.dumps(tiny(1)).encode(),
        json.dumps({"nbformat": 3, "nbformat_minor": 0, "metadata": {}, "worksheets": [
            {"cells": [{"cell_type": "code", "input": "x", "outputs": [], "metadata": {}}]}
        ]}).encode(),
    ],
)  # fmt: skip
def test_files_saved_by_other_programs_are_read(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "x.ipynb").write_bytes(data)
    notebook, problem = submissions.read(tmp_path / "x.ipynb")
    assert problem == ""
    assert notebook.cells


def test_a_letter_that_no_file_takes_is_replaced(tmp_path: Path) -> None:
    content = tiny(1)
    content["cells"][0]["source"] = "GROUP = 3  # half of a smiley: \ud83d"
    write(tmp_path, {"a/set1.ipynb": content})
    [this] = submissions.find(tmp_path, KNOWN)
    submissions.repair(this, KNOWN["set1"])
    nbformat.write(this.notebook, tmp_path / "taken.ipynb")
    assert (this.group, this.reason) == (3, "")


@pytest.mark.parametrize(
    "cell",
    [
        {},
        {"cell_type": "strange", "source": None},
        {"cell_type": "code", "source": [1, "x"], "metadata": [2], "outputs": "y"},
        {"cell_type": "markdown", "source": {}, "attachments": 3, "id": 4},
        {"cell_type": "code", "metadata": {"nbgrader": "z"}, "source": "GROUP = 3 +"},
        {"cell_type": "code", "metadata": {"nbgrader": {"grade_id": ["z"]}}, "source": "\x00"},
    ],
)
def test_strange_cells_are_repaired(cell: dict[str, Any], tmp_path: Path) -> None:
    content = tiny(1)
    content["cells"].append(cell)
    content["metadata"] = None
    write(tmp_path, {"a/set1.ipynb": content})
    [this] = submissions.find(tmp_path, KNOWN)
    submissions.repair(this, KNOWN["set1"])
    nbformat.validate(this.notebook)
    assert this.group == 1


ORDERS = {
    "group answer=right check": ("group answer=right check", ""),
    "group own=old answer=right check own=show": ("group own=old answer=right check own=show", ""),
    "group answer=wrong check answer=right": ("group own=wrong answer=right check", "order"),
    "group check own=help answer=right": ("group answer=right check own=help", "order"),
    "own=first answer=right group check": ("own=first group answer=right check", "order"),
    "group own=pasted check": ("group answer=blank own=pasted check", "put back: answer-1-1"),
}
"""Cells as they were handed in; as they are taken, and what is remarked."""


@pytest.mark.parametrize("handed", ORDERS)
def test_cells_are_put_into_the_order_in_which_they_were_given_out(
    handed: str, tmp_path: Path
) -> None:
    content = tiny(1)
    group, check = content["cells"]
    answer = {**group, "id": "answer-1-1", "source": "blank"}
    content["cells"] = [group, answer, check]
    released = nbformat.from_dict(content)
    cells = {"group": group, "answer": answer, "check": check, "own": {**answer, "id": "x"}}
    content["cells"] = [
        {**cells[name], "source": source} if source else cells[name]
        for name, _, source in (word.partition("=") for word in handed.split())
    ]
    write(tmp_path, {"a/set1.ipynb": content})
    [this] = submissions.find(tmp_path, {"set1": released})
    submissions.repair(this, released)
    found = [f"{cell.id.partition('-')[0]}={cell.source}" for cell in this.notebook.cells]
    taken, remark = ORDERS[handed]
    assert " ".join(found).replace("=GROUP = 1", "").replace("check=", "check") == taken
    assert bool(this.remarks) == bool(remark) and remark in "; ".join(this.remarks)


@pytest.mark.parametrize(
    ("source", "group"),
    [
        ("GROUP = 7", 7),
        ("GROUP = 7  # seven", 7),
        ("GROUP: int = 7", 7),
        ("A = GROUP = 7", 7),
        ("GROUP = -7", -7),
        ("GROUP = 1\nGROUP = 7", 7),
        ("GROUP = '7'", None),
        ("GROUP = True", None),
        ("GROUP = 7.5", None),
        ("GROUP = 0x" + "F" * 4000, None),
        ("GROUP = seven", None),
        ("GROUP = (", None),
        ("GROUP == 7", None),
        ("", None),
    ],
)
def test_the_group_is_read_from_the_code(source: str, group: int | None) -> None:
    found, problem = submissions.group_of([nbformat.v4.new_code_cell(source)])
    assert found == group
    assert bool(problem) is (group is None)


@pytest.mark.parametrize(
    ("source", "roster", "used", "group", "remark"),
    [
        # Somebody else's, however it came about.
        ("GROUP = 104\nGROUP -= 3", 104, ["101"], 101, "group 101, and 104 on the roster"),
        ("GROUP = '101'", 105, ["101"], 101, "group 101, and 105 on the roster"),
        ("GROUP = 103", None, ["103", "101"], 103, "answers for several groups: 103, 101"),
        ("GROUP = 103", 103, ["103", "101"], 103, "answers for several groups: 103, 101"),
        ("GROUP = 'x'", 105, ["x"], None, "group x, and 105 on the roster"),
        # One's own, however it is written.
        ("GROUP = int('106')", 106, ["106"], 106, ""),
        ("GROUP = int('106')", None, ["106"], 106, ""),
        ("GROUP = '101'", None, ["101"], 101, ""),
        ("GROUP = 104\nGROUP -= 3", None, ["101"], 101, ""),
        ("GROUP = 5", 5, [], 5, ""),
        # Nobody's.
        ("GROUP = x", None, ["1"], None, "whole number (x): ask for it; it was graded as 1"),
        ("GROUP = 'x'", None, ["x"], None, "whole number ('x'): ask for it; it was graded as x"),
        ("", None, ["1"], None, "GROUP is not set: ask for it; it was graded as 1"),
        ("", 7, ["7"], 7, "GROUP is not set: on the roster it is 7"),
        ("", 7, [], 7, "GROUP is not set: on the roster it is 7"),
    ],
)
def test_the_group_is_remarked_for_which_answers_were_judged(
    source: str, roster: int | None, used: list[str], group: int | None, remark: str, tmp_path: Path
) -> None:
    content = tiny(1)
    content["cells"][0]["source"] = source
    write(tmp_path, {"a/set1.ipynb": content})
    [this] = submissions.find(tmp_path, KNOWN)
    submissions.repair(this, KNOWN["set1"], roster)
    assert not [told for told in this.remarks if "GROUP" in told or "group" in told]
    submissions.remark_group(this, used)
    assert this.group == group
    assert len(this.remarks) == bool(remark) and "".join(this.remarks).endswith(remark)


def test_folders_of_students_are_unique_and_no_patterns(tmp_path: Path) -> None:
    records = marks.Records(tmp_path / "submissions.json")
    names = ["Jörg Müller", "a[1]", "a*1*", "a_1", "..", "", "A_1", "../../etc"]
    for name in names:
        records.add(submissions.Submission(name, "set1"))
    folders = [records.folder_of(name) for name in names]
    assert len({folder.lower() for folder in folders}) == len(names)
    assert all(re.fullmatch(r"\w[\w.@-]*", folder) for folder in folders)
    records.save()
    again = marks.Records(tmp_path / "submissions.json")
    assert [again.folder_of(name) for name in names] == folders
