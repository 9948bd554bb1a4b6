"""The pipeline around the problem sets: giving out, collecting, grading, marking by hand.

With nbgrader and kernels, on one of the sets. What the graders say to each answer is asked, for
all sets and without kernels, in ``test_exercises.py``.
"""

from __future__ import annotations

import csv
import json
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nbformat
import pytest
from bs4 import BeautifulSoup
from nbconvert.filters import markdown2html

from nrdob.course.grading import command as exercises
from nrdob.course.grading import marks, submissions
from nrdob.course.grading.autograde import course, keep_points
from nrdob.course.grading.feedback import offline
from problemsets import SETS, SOURCE, Posed, cells, nbgrader, posed

ROOT = Path(__file__).resolve().parents[2]


NAME = "set2"
PATH = SOURCE / NAME / f"{NAME}.ipynb"
TIMEOUT = 10
# What the limit of a kernel forbids; where there are no limits, what no machine can address.
TOO_MUCH = 10**11 if sys.platform == "linux" else 10**15

CHECKED = posed(PATH)
WRITTEN = [cell.id for cell in cells(PATH) if cell.id.startswith("written-")]
POINTS = {cell.id: nbgrader(cell)["points"] for cell in cells(PATH) if nbgrader(cell).get("grade")}
MAX = sum(POINTS.values())

Notebook = Any

# Every test runs nbgrader and kernels; nbgrader quarrels with its own database.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:Object of type")]


# --- giving out ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def released(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Release every set, twice."""
    for name in ("first", "second"):
        folder = tmp_path_factory.getbasetemp() / name
        names = [path.stem for path in SETS]
        exercises.release(names, SOURCE, folder, solutions=False)
    return tmp_path_factory.getbasetemp() / "first" / "release"


def test_releasing_twice_gives_the_same_bytes(released: Path) -> None:
    files = [path.relative_to(released) for path in released.rglob("*") if path.is_file()]
    assert {path.suffix for path in files} >= {".ipynb", ".zip"}
    again = released.parent.parent / "second" / "release"
    for file in files:
        assert (released / file).read_bytes() == (again / file).read_bytes(), file


@pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
def test_the_release_holds_neither_solutions_nor_hidden_tests(path: Path, released: Path) -> None:
    text = (released / path.stem / path.name).read_text("utf-8")
    assert not re.search("SOLUTION|HIDDEN|seed=", text)
    for this in posed(path):
        assert str(this.seed) not in text
    given_out = {cell.id: cell for cell in nbformat.reads(text, as_version=4).cells}
    for cell in cells(path):
        if nbgrader(cell).get("solution"):
            inside = cell.source.split("BEGIN SOLUTION")[1].split("END SOLUTION")[0]
            lines = [line for line in inside.splitlines() if len(line.strip()) > 25]
            assert not [line for line in lines if line in given_out[cell.id].source]
            assert re.search("YOUR (CODE|ANSWER) HERE", given_out[cell.id].source)
    assert [cell.id for cell in cells(path)] == list(given_out)
    assert not any(cell.get("outputs") for cell in given_out.values())


def test_the_solutions_run_and_hold_no_hidden_tests() -> None:
    text = exercises.solved(PATH)
    assert "HIDDEN" not in text and "BEGIN SOLUTION" not in text
    assert str(CHECKED[0].seed) not in text
    outputs = str([cell.get("outputs") for cell in nbformat.reads(text, as_version=4).cells])
    for this in CHECKED:
        assert this.problem.praise in outputs


def test_an_unknown_set_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert exercises.main(["release", "99"]) == 2
    assert "there is no set99; there are" in capsys.readouterr().err


# --- what is handed in --------------------------------------------------------------------------


def solution(this: Posed) -> str:
    """The published answer, as a student would write it."""
    [source] = [c.source for c in cells(PATH) if c.id == answer_cell(this)]
    return exercises.MARKERS.sub("", source)


def answer_cell(this: Posed) -> str:
    return this.cell.id.replace("check", "answer")


def mistake(this: Posed, number: int) -> str:
    """A cell with what somebody answers who holds the misconception."""
    example = f'PROBLEMS["{this.id}"].misconceptions[{number}].example'
    if this.problem.own:
        example += f'(own_case("{this.id}", GROUP))'
    return f"from nrdob.course.exercises import PROBLEMS, own_case\n\n{this.answer} = {example}"


def cell_of(notebook: Notebook, name: str) -> Any:
    return next(cell for cell in notebook.cells if cell.id == name)


@dataclass
class Handed:
    """A submission, and the line of the table that it should get."""

    file: str
    notebook: Notebook
    earned: dict[str, float]
    remarks: str = ""
    group: str = "5"


def handed(released: Path) -> Notebook:
    return nbformat.read(released / NAME / f"{NAME}.ipynb", as_version=4)


def right(released: Path, file: str, *mischief: Callable[[Notebook], None]) -> Handed:
    """Everything as published; then somebody, or something, goes at it."""
    notebook = handed(released)
    for this in CHECKED:
        cell_of(notebook, answer_cell(this)).source = solution(this)
    for name in WRITTEN:
        cell_of(notebook, name).source = "As $Z = N + P$, it is **clear**."
    cell_of(notebook, "group").source = "GROUP = 5"
    for go in mischief:
        go(notebook)
    return Handed(file, notebook, {this.cell.id: this.points for this in CHECKED})


def mistaken(released: Path, number: int) -> Handed:
    """Each problem answered with its misconception of this number, or left as it was."""
    this = right(released, f"mistake{number}/{NAME}.ipynb")
    for problem in CHECKED:
        known = problem.problem.misconceptions
        cell = cell_of(this.notebook, answer_cell(problem))
        if number < len(known):
            cell.source = mistake(problem, number)
            this.earned[problem.cell.id] = problem.points * known[number].marks
        else:
            cell.source = cell_of(handed(released), cell.id).source
            this.earned[problem.cell.id] = 0
    return this


# Code that a student may write: at the top of an answer's cell, before the right answer.
DISASTERS = {
    "an exception": ("1 / 0", 0, ""),
    "an exit": ("import sys\n\nsys.exit()", 0, ""),
    "another exit": ("exit()", 0, ""),
    "a dead kernel": ("import os\n\nos._exit(1)", 0, "{answer} was left out: it ended the kernel"),
    "an endless loop": (
        "while True:\n    pass",
        0,
        f"{{answer}} was stopped after {TIMEOUT} s",
    ),
    "a deaf endless loop": (
        "import signal\n\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\nwhile True:\n    pass",
        0,
        "{answer} was left out: it could not be stopped",
    ),
    "a flood": ("for _ in range(1000):\n    print('x' * 100_000)", 1, ""),
    "a syntax error": ("def turns(case)", 0, ""),
    "too much memory": (f"much = bytearray({TOO_MUCH})", 0, ""),
    "a setting": (
        "get_ipython().ast_node_interactivity = 'all'",
        1,
        "",
    ),
    "no input": ("input()", 0, ""),
}
"""Code, the share of the points that it leaves, and what is remarked."""


def disasters(released: Path) -> Iterator[Handed]:
    """Spread the disasters over submissions that are right otherwise."""
    per_notebook = max(1, len(CHECKED) - 1)
    left = list(DISASTERS.values())
    for count, start in enumerate(range(0, len(left), per_notebook)):
        this = right(released, f"disaster{count}/{NAME}.ipynb")
        remarks = []
        for problem, (code, share, remark) in zip(
            CHECKED, left[start : start + per_notebook], strict=False
        ):
            cell = cell_of(this.notebook, answer_cell(problem))
            cell.source = f"{code}\n\n{cell.source}"
            this.earned[problem.cell.id] *= share
            remarks += [remark.format(answer=cell.id)] if remark else []
        this.remarks = "; ".join(remarks)
        yield this


def in_the_function(released: Path) -> Handed:
    """An endless loop, and an exit, where the check calls the answer."""
    this = right(released, f"within/{NAME}.ipynb")
    functions = [problem for problem in CHECKED if not problem.problem.own]
    codes = ["while True: pass", "import sys; sys.exit(0)", "import os; os._exit(0)"]
    remarks = [
        "{check} was stopped after " + f"{TIMEOUT} s",
        "",
        "{check} was left out: it ended the kernel",
    ]
    said = []
    for problem, code, remark in zip(functions[1:], codes, remarks, strict=False):
        cell = cell_of(this.notebook, answer_cell(problem))
        cell.source = f"def {problem.answer}(case):\n    {code}"
        this.earned[problem.cell.id] = 0
        said += [remark.format(check=problem.cell.id)] if remark else []
    this.remarks = "; ".join(said)
    return this


def tampered(released: Path) -> Handed:
    """Cells deleted, doubled, edited, the group gone, metadata changed."""
    this = right(released, f"tampered/{NAME}.ipynb")
    notebook = this.notebook
    first, second, last = CHECKED[0], CHECKED[1], CHECKED[-1]
    # An answer is gone, and its check wants to give the points away.
    notebook.cells.remove(cell_of(notebook, answer_cell(first)))
    cell_of(notebook, first.cell.id).source = f"{first.points}"
    cell_of(notebook, first.cell.id).metadata.nbgrader["points"] = 1000
    this.earned[first.cell.id] = 0
    # A check is gone; an answer is there twice.
    notebook.cells.remove(cell_of(notebook, second.cell.id))
    double = deepcopy(cell_of(notebook, answer_cell(last)))
    notebook.cells.append(double)
    cell_of(notebook, last.cell.id).metadata.nbgrader["grade"] = False
    notebook.cells.remove(cell_of(notebook, "group"))
    this.group = ""
    this.remarks = "; ".join(
        [
            f"more than once, the last counts: {double.id}",
            f"put back: {answer_cell(first)}, {second.cell.id}",
            f"restored: {first.cell.id}",
            "GROUP is not set: taken as in the notebook given out",
        ]
    )
    return this


def renamed(released: Path) -> Handed:
    """A file under another name, from another kernel, with a group that is none."""
    this = right(released, "renamed/my homework (2).ipynb")
    this.notebook.metadata.kernelspec["name"] = "conda-env-control"
    cell_of(this.notebook, "group").source = "GROUP = seven"
    this.group = ""
    this.remarks = (
        "taken from renamed/my homework (2).ipynb; GROUP is no whole number: seven; "
        "kernel 'conda-env-control' replaced by 'python3'"
    )
    return this


def not_executed_but_saved_elsewhere(released: Path) -> Handed:
    """Lost metadata, an old format of the file, in one file for all that a student has."""
    this = right(released, f"Jörg [2]_{NAME}.ipynb")
    for cell in this.notebook.cells:
        cell.metadata = {}
    this.group = "5"
    return this


REFUSED = {
    "corrupt": "the file is no valid JSON (Expecting value: line 1 column 11 (char 10))",
    "empty": "the file is empty",
    "forgot": "there is no notebook in the folder",
    "undecided": (f"2 notebooks for one set: undecided/a_{NAME}.ipynb, undecided/b_{NAME}.ipynb"),
}


@pytest.fixture(scope="module")
def everything(released: Path) -> list[Handed]:
    most = max(len(this.problem.misconceptions) for this in CHECKED)
    blank = Handed(f"blank/{NAME}/{NAME}.ipynb", handed(released), {}, group="1")
    blank.earned = dict.fromkeys(POINTS, 0.0)
    return [
        right(released, f"anna/{NAME}.ipynb"),
        blank,
        *(mistaken(released, number) for number in range(most)),
        *disasters(released),
        in_the_function(released),
        tampered(released),
        renamed(released),
        not_executed_but_saved_elsewhere(released),
    ]


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
def graded(everything: list[Handed], tmp_path_factory: pytest.TempPathFactory) -> Graded:
    """Hand in everything, and grade it."""
    folder = tmp_path_factory.mktemp("handed_in")
    for this in everything:
        path = folder / this.file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(this.notebook), "utf-8")
    for student in ("corrupt", "empty", "forgot", "undecided"):
        (folder / student).mkdir()
    (folder / "corrupt" / f"{NAME}.ipynb").write_text('{"cells": ', "utf-8")
    (folder / "empty" / f"{NAME}.ipynb").write_text("", "utf-8")
    for letter in "ab":
        nbformat.write(everything[0].notebook, folder / "undecided" / f"{letter}_{NAME}.ipynb")
    target = tmp_path_factory.mktemp("grading")
    settings = (SOURCE.parent / "nbgrader_config.py").read_text("utf-8")
    settings += f"c.Execute.timeout = {TIMEOUT}\nc.Execute.iopub_timeout = {TIMEOUT}\n"
    (target / "nbgrader_config.py").write_text(settings, "utf-8")
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
        "total": marks.number(sum(this.earned.values())),
        "max": marks.number(MAX),
        "remarks": this.remarks,
    }


def test_every_line_of_the_table(everything: list[Handed], graded: Graded) -> None:
    wanted = {student(this): line(this) for this in everything}
    for name, reason in REFUSED.items():
        nothing = dict.fromkeys(wanted["anna"], "")
        wanted[name] = {**nothing, "student": name, "set": NAME}
        wanted[name]["remarks"] = f"not graded: {reason}"
    found = {row["student"]: row for row in graded.table()}
    assert list(found) == sorted(wanted)
    for name, row in wanted.items():
        assert found[name] == row, name


def test_what_could_not_be_graded_is_told_by_name(graded: Graded) -> None:
    assert graded.failures == len(REFUSED)
    for name, reason in REFUSED.items():
        assert f"{name} {NAME}: NOT GRADED: {reason}" in graded.said


def test_progress_is_told(everything: list[Handed], graded: Graded) -> None:
    lines = re.findall(r"^\[ ?(\d+)/(\d+)\]", graded.said, re.MULTILINE)
    assert lines == [(f"{k}", f"{len(everything)}") for k in range(1, len(everything) + 1)]


def pages(graded: Graded) -> list[Path]:
    return sorted((graded.target / "feedback").rglob("*.html"))


def test_everyone_graded_has_feedback(everything: list[Handed], graded: Graded) -> None:
    assert len(pages(graded)) == len(everything)


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


def test_marks_by_hand_reach_table_and_feedback(graded: Graded, tmp_path: Path) -> None:
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
    marks.write_table(target / "written.csv", list(marks.WRITTEN), rows)

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
    # They stay when the tables are written again, and when it is graded again.
    written = {row["student"]: row["points"] for row in Graded(target, 0, "").table("written")}
    assert written["anna"] == "0.5"
    assert exercises.report(target) == 0
    assert {row["student"]: row for row in Graded(target, 0, "").table()} == table


def test_the_result_is_a_course_of_nbgraders(graded: Graded, everything: list[Handed]) -> None:
    with course(graded.target).gradebook as gradebook:
        assert len(gradebook.assignment_submissions(NAME)) == len(everything)
        found = gradebook.find_submission(NAME, "anna")
        assert found.score == sum(this.points for this in CHECKED)
        assert found.needs_manual_grade is bool(WRITTEN)


# --- the parts, without kernels -----------------------------------------------------------------


def write(folder: Path, files: dict[str, Any]) -> Path:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content if isinstance(content, str) else json.dumps(content), "utf-8")
    return folder


def tiny(number: int) -> dict[str, Any]:
    """A set of one problem."""
    check = {"grade": True, "grade_id": f"check-{number}-1", "locked": True, "points": 1}
    code = {"cell_type": "code", "outputs": [], "execution_count": None}
    group = {**code, "id": "group", "metadata": {}, "source": "GROUP = 1"}
    cell = {**code, "id": f"check-{number}-1", "metadata": {"nbgrader": check}, "source": ""}
    return {"cells": [group, cell], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}


KNOWN = {f"set{k}": nbformat.from_dict(tiny(k)) for k in (1, 2)}


@pytest.mark.parametrize(
    ("files", "wanted", "found"),
    [
        ({"a/set1.ipynb": 1, "b/set1.ipynb": 1}, (), ["a set1", "b set1"]),
        ({"a/set1.ipynb": 1, "a/set2.ipynb": 2}, (), ["a set1", "a set2"]),
        ({"a/set1.ipynb": 1, "a/set2.ipynb": 2}, ("set2",), ["a set2"]),
        ({"a/set1/set1.ipynb": 1}, (), ["a set1"]),
        ({"a_set1.ipynb": 1, "b-set-01.ipynb": 1}, (), ["a set1", "b set1 taken"]),
        ({"a/.ipynb_checkpoints/set1.ipynb": 1, "a/set1.ipynb": 1}, (), ["a set1"]),
        ({".git/set1.ipynb": 1, "__MACOSX/x.ipynb": 1, "a/set1.ipynb": 1}, (), ["a set1"]),
        # The cells tell what it is, whatever it is called.
        ({"a/Set 1 (2).ipynb": 1}, (), ["a set1 taken"]),
        ({"a/homework.ipynb": 2}, (), ["a set2 taken"]),
        ({"a/set1.ipynb": 2}, (), ["a set2 taken"]),
        ({"a/set1.ipynb.txt": 1}, (), ["a set1 taken"]),
        ({"a/deep/in/set1.ipynb": 1}, (), ["a set1 taken"]),
        # The proper name wins; without it nobody can choose.
        ({"a/set1.ipynb": 1, "a/old.ipynb": 1}, (), ["a set1 left out"]),
        ({"a/new.ipynb": 1, "a/old.ipynb": 1}, (), ["a set1 refused"]),
        ({"a/set1.ipynb": 1, "a_set1.ipynb": 1}, (), ["a set1 left out"]),
        # Missing, unreadable, unknown.
        ({"a/set1.ipynb": 1, "b/notes.txt": "x"}, (), ["a set1", "b set1 refused"]),
            ({"b/notes.txt": "x"}, (), ["b  refused"]),
        ({"a/set1.ipynb": 1, "a/set2.ipynb": 2, "b/set2.ipynb": 2}, (),
         ["a set1", "a set2", "b set1 refused", "b set2"]),
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


@pytest.mark.parametrize(
    ("tex", "shown"),
    [
        ("$x^2$", "<msup>"),
        ("$$x$$", 'display="block"'),
        (r"\(x\) and \[y\]", "<mi>y</mi>"),
        (r"\begin{align} a &= b \\ c &= d \end{align}", "<mtable"),
        (r"\begin{equation} a = b \end{equation}", 'display="block"'),
        (r"$a, \dots, b$", "…"),
        (r"$\dfrac12$", "<mfrac"),
        (r"$\frac1\pi$", "<mfrac>"),
        (r"$\tfrac 1{ab}$", "<mfrac"),
        (r"$\nonsense{x}$", r"<code>$\nonsense{x}$</code>"),
        ("it costs $5 and $6", "it costs $5 and $6"),
        (r"a price of \$5 and $x$", r"\$5 and <math"),
        ("<pre>echo $HOME $PATH</pre>", "<pre>echo $HOME $PATH</pre>"),
        ("<code>$x$</code>", "<code>$x$</code>"),
    ],
)
def test_formulas_become_mathml(tex: str, shown: str) -> None:
    assert shown in offline(f"<p>{tex}</p>")


@pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
def test_every_formula_of_a_set_becomes_mathml(path: Path) -> None:
    for cell in cells(path):
        if cell.cell_type == "markdown":
            page = BeautifulSoup(offline(markdown2html(cell.source)), "html.parser")
            assert "$" not in page.get_text(), cell.id


def test_what_would_be_loaded_is_taken_out() -> None:
    page = offline(
        '<script src="https://a/b.js"></script><link href="//a/b.css"><iframe src="x"></iframe>'
        '<img src="https://a/b.png"><img src="data:image/png;base64,">'
    )
    assert page == '[https://a/b.png]<img src="data:image/png;base64,"/>'


def output(kind: str, text: str = "") -> Any:
    if kind == "stream":
        return nbformat.v4.new_output("stream", name="stderr", text=text)
    if kind == "error":
        return nbformat.v4.new_output("error", ename="E", evalue="", traceback=[])
    return nbformat.v4.new_output(kind, data={"text/plain": text})


@pytest.mark.parametrize(
    ("outputs", "kept"),
    [
        ([output("execute_result", "2.5")], ["2.5"]),
        # A warning costs no points, and no result before the last is taken for them.
        ([output("stream", "careful"), output("execute_result", "2.5")], ["2.5"]),
        ([output("execute_result", "Right."), output("execute_result", "2.5")], ["2.5"]),
        ([output("execute_result", "Right.")], ["Right.", "NoPoints"]),
        ([output("execute_result", "1000")], ["1000", "NoPoints"]),
        ([output("execute_result", "nan")], ["nan", "NoPoints"]),
        ([], ["NoPoints"]),
        ([output("error"), output("execute_result", "4")], ["E", "4"]),
    ],
)
def test_a_test_cell_gives_its_points_or_none(outputs: list[Any], kept: list[str]) -> None:
    cell = nbformat.v4.new_code_cell("", outputs=outputs)
    cell.metadata.nbgrader = {"points": 4}
    keep_points(cell)
    found = [out.get("ename") or out.data["text/plain"] for out in cell.outputs]
    assert found == kept
