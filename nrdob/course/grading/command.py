"""Give out the problem sets, and grade what comes back.

    python -m nrdob.course.grading release                       student copies and solutions
    python -m nrdob.course.grading grade FOLDER                  grade what students handed in
    python -m nrdob.course.grading report                        after marks were written by hand

FOLDER holds a folder for each student with the notebook in it, ``FOLDER/anna/set2.ipynb``, or is
what Moodle or Canvas exports, zipped or not. The result is a course in nbgrader's layout:
``grades.csv`` and ``course.csv``, the feedback of each student, the list ``written.csv`` of the
answers to be marked by hand, ``similar.csv``, what Moodle and Canvas import, and nbgrader's
gradebook. Roster, deadlines and the rule for late ones stand in ``course.toml``.
"""

from __future__ import annotations

import argparse
import csv
import re
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import nbformat
from nbclient.exceptions import CellExecutionError
from nbgrader.preprocessors import ClearHiddenTests

from ..running import execute
from . import similar, wall
from .autograde import SETTINGS, course, write_feedback
from .batch import Batch, Outcome
from .marks import (
    Records,
    enter,
    grades_of,
    lines,
    number,
    read_written,
    tell_late,
    unmarked,
    write_course,
    write_grades,
    write_platforms,
    write_table,
    write_written,
)
from .platforms import packed, unpacked
from .roster import Course, read_course
from .submissions import NOTHING, Submission, find, repair

__all__ = ["MARKERS", "grade", "main", "parse", "release", "report", "solved"]

ROOT = Path(__file__).resolve().parents[3]
SOURCE = ROOT / "notebooks" / "exercises" / "source"
RELEASE = ROOT / "build" / "exercises"
GRADING = ROOT / "grading"
COURSE = ROOT / "course.toml"

MARKERS = re.compile(r"^.*(BEGIN|END) (SOLUTION|HIDDEN TESTS).*\n?", re.MULTILINE)

Notebook = Any


class CourseError(Exception):
    """Something that the person at the keyboard has to put right."""


# --- giving out ---------------------------------------------------------------------------------


def sets_in(source: Path) -> dict[str, Notebook]:
    """Read the sets, by name."""
    paths = sorted(source.glob("set*/set*.ipynb"))
    return {path.stem: nbformat.read(path, as_version=4) for path in paths}


def found_course(root: Path) -> None:
    """Make a folder a course of nbgrader's; settings that are there stay."""
    root.mkdir(parents=True, exist_ok=True)
    if not (root / SETTINGS).exists():
        shutil.copy(SOURCE.parent / SETTINGS, root)


def generate(root: Path, source: Path, name: str) -> Path:
    """Let nbgrader make the students' copy of a set, in the course of a folder."""
    target = root / "source" / name
    if target.exists():
        shutil.rmtree(target)
    shutil.copytree(source / name, target, ignore=shutil.ignore_patterns(".*", "__pycache__"))
    done = course(root).generate_assignment(name)
    if "Cannot add or remove cells" in done["log"]:
        raise CourseError(
            f"{name} has other cells than when submissions of it were graded into {root}: "
            "grade into another folder, with --output"
        )
    if not done["success"]:
        raise CourseError(f"nbgrader cannot give out {name}:\n{done['log']}")
    return root / "release" / name


def release(names: Sequence[str], source: Path, target: Path, solutions: bool = True) -> None:
    """Write the students' copies, as folders and as archives, and the solutions."""
    with tempfile.TemporaryDirectory() as folder:
        found_course(Path(folder))
        for name in names:
            given_out = target / "release" / name
            if given_out.exists():
                shutil.rmtree(given_out)
            shutil.copytree(generate(Path(folder), source, name), given_out)
            archive(given_out)
            print(f"{name}: {given_out}.zip")
    if solutions:
        for name in names:
            solution = target / "solutions" / f"{name}.ipynb"
            solution.parent.mkdir(parents=True, exist_ok=True)
            solution.write_text(solved(source / name / f"{name}.ipynb"), "utf-8")
            print(f"{name}: {solution}")


def archive(folder: Path) -> None:
    """Pack a folder; the same files give the same bytes."""
    with zipfile.ZipFile(folder.with_suffix(".zip"), "w", zipfile.ZIP_DEFLATED) as packed:
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            entry = zipfile.ZipInfo(path.relative_to(folder.parent).as_posix())
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            packed.writestr(entry, path.read_bytes())


def solved(path: Path) -> str:
    """Run a set with its published solutions, without the hidden tests."""
    notebook = nbformat.read(path, as_version=4)
    notebook, _ = ClearHiddenTests().preprocess(notebook, {})
    for cell in notebook.cells:
        cell.source = MARKERS.sub("", cell.source).rstrip("\n")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        nbformat.write(notebook, copy)
        try:
            return execute(copy, timeout=120)
        except CellExecutionError as error:
            raise CourseError(f"the solutions of {path.stem} do not run:\n{error}") from None


# --- grading ------------------------------------------------------------------------------------


def grade(
    folder: Path,
    wanted: Sequence[str] = (),
    target: Path = GRADING,
    source: Path = SOURCE,
    jobs: int = 2,
    limit: float = 1200,
    plan: Course | None = None,
    trust: bool = False,
) -> int:
    """Grade what students handed in; the result is how many could not be graded."""
    if not folder.exists():
        raise CourseError(f"there is no folder {folder}")
    plan = plan or Course()
    if wall.missing():
        print(f"{wall.missing()}. {UNWALLED}")
    if wall.stays_root():
        print(f"{wall.stays_root()}. Grade as a user of your own.")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as place:
        faults = []
        if packed(folder):
            faults = list(unpacked(folder, Path(place)))
            folder = Path(place)
        submissions = find(folder, sets_in(source), wanted, plan)
        if not submissions:
            raise CourseError(f"there are no submissions in {folder}")
        found_course(target)
        names = sorted({submission.set for submission in submissions if not submission.reason})
        given_out = {
            name: nbformat.read(generate(target, source, name) / f"{name}.ipynb", as_version=4)
            for name in names
        }
        records = Records(target / "submissions.json")
        faults += take_marks(target, records)
        ready = []
        for submission in list(submissions):
            if submission.reason == NOTHING and records.graded(submission):
                submissions.remove(submission)  # it came earlier
                continue
            if not submission.reason:
                hand_over(submission, given_out[submission.set], target, records, plan)
            if not submission.reason and submission.suspicious and wall.missing() and not trust:
                submission.reason = NOT_RUN
            entry = records.add(submission, submission.reason or "it is still to be graded")
            if submission.reason:
                print(f"not graded: {described(submission)}: {submission.reason}", flush=True)
            else:
                ready.append((entry["folder"], submission))
    try:
        run(ready, target, records, jobs, limit)
        records.remark_shared_groups(plan)
    finally:  # after an interrupt, too
        write_tables(target, records, plan)
    compare(target, records, given_out)
    return summary(target, submissions, records, faults)


UNWALLED = (
    "It runs with your rights, and could read and change what you can: what looks as if it did is "
    "not run, unless you have read it and say --trust. Grade strangers' work in a virtual machine."
)
AS_ROOT = (
    "you are root, and students' code should not be: grade as a user of your own, or in a "
    "container of which nothing else is needed, and say --as-root"
)
NOT_RUN = "it was not run, for there is no wall on this system: read what is remarked, then --trust"


def hand_over(
    submission: Submission, given_out: Notebook, target: Path, records: Records, plan: Course
) -> None:
    """Put a submission where nbgrader looks for it, repaired."""
    known = plan.find(submission.student, submission.owner.identifier)
    try:
        repair(submission, given_out, known.group if known else None)
    except Exception as error:  # whatever a file may hold
        submission.reason = f"its cells cannot be read ({type(error).__name__}: {error})"
        return
    place = target / "submitted" / records.folder_of(submission.student) / submission.set
    if place.exists():
        shutil.rmtree(place)
    place.mkdir(parents=True)
    nbformat.write(submission.notebook, place / f"{submission.set}.ipynb")
    for picture in submission.pictures:
        shutil.copy(picture, place)


def run(
    ready: list[tuple[str, Submission]], target: Path, records: Records, jobs: int, limit: float
) -> None:
    """Grade, and tell how it goes."""
    for count, outcome in enumerate(Batch(target, jobs, limit).grade(ready), start=1):
        entry = records.add(outcome.submission, outcome.reason)
        if not outcome.reason:
            with course(target).gradebook as gradebook:
                enter(gradebook, entry["folder"], outcome)
        print(f"[{count:>{len(str(len(ready)))}}/{len(ready)}] {told(outcome)}", flush=True)


def compare(target: Path, records: Records, given_out: Mapping[str, Notebook]) -> None:
    """List the pairs of submissions whose answers are alike, of the sets just graded."""
    path = target / "similar.csv"
    columns = ["set", "first", "second", "cells", "share"]
    rows: list[dict[str, Any]] = []
    if path.exists():
        with path.open(newline="", encoding="utf-8") as file:
            rows = [row for row in csv.DictReader(file) if row["set"] not in given_out]
    for name, skeleton in given_out.items():
        notebooks = {
            entry["student"]: nbformat.read(
                target / "submitted" / entry["folder"] / name / f"{name}.ipynb", as_version=4
            )
            for entry in records.entries
            if entry["set"] == name and not entry["reason"]
        }
        found = similar.pairs(notebooks, skeleton)
        rows += [{"set": name, **line} for line in similar.told(found)]
        if found:
            print(f"{name}: {len(found)} pairs of students have answers that are alike: {path}")
    write_table(path, columns, rows)


def described(submission: Submission) -> str:
    """Name the student and the set."""
    return " ".join(filter(None, [submission.student, submission.set]))


def told(outcome: Outcome) -> str:
    """Tell in a line what came of a submission."""
    points = [points for points in outcome.grades.values() if points is not None]
    open_ones = len(outcome.grades) - len(points)
    parts = (
        [f"not graded: {outcome.reason}"] if outcome.reason else [f"{number(sum(points))} points"]
    )
    if open_ones:
        parts.append(f"{open_ones} to mark by hand")
    parts += outcome.submission.remarks
    return f"{described(outcome.submission)} ({outcome.seconds:.0f} s): {'; '.join(parts)}"


def take_marks(target: Path, records: Records) -> list[str]:
    """Enter the marks written by hand, if there are any yet."""
    if not (target / "gradebook.db").exists():
        return []
    with course(target).gradebook as gradebook:
        return read_written(target / "written.csv", gradebook, records)


def write_tables(target: Path, records: Records, plan: Course) -> None:
    """Write what the teacher reads, and what the platform imports."""
    records.save()
    with course(target).gradebook as gradebook:
        found = lines(gradebook, records, plan)
        write_grades(target / "grades.csv", found)
        write_course(target / "course.csv", found, plan)
        write_platforms(target, found, plan)
        write_written(target / "written.csv", gradebook, records)
        tell_late(target, found, plan)


def summary(
    target: Path, submissions: list[Submission], records: Records, faults: list[str]
) -> int:
    """Say at the end what somebody should look at, by name."""
    mine = {(submission.student, submission.set) for submission in submissions}
    entries = [entry for entry in records.entries if (entry["student"], entry["set"]) in mine]
    refused = [entry for entry in entries if entry["reason"]]
    print(f"\n{len(entries) - len(refused)} of {len(entries)} submissions are graded.")
    for entry in entries:
        said = [f"NOT GRADED: {entry['reason']}"] if entry["reason"] else []
        for remark in [*said, *entry["remarks"]]:
            print(f"  {' '.join(filter(None, [entry['student'], entry['set']]))}: {remark}")
    for fault in faults:
        print(f"  {fault}")
    print(
        f"Points: {target / 'grades.csv'}, {target / 'course.csv'}\nFeedback: {target / 'feedback'}"
    )
    with course(target).gradebook as gradebook:
        left = sum(unmarked(grade) for entry in entries for grade in grades_of(gradebook, entry))
    if left:
        print(
            f"{left} answers are to be marked by hand: fill in the points in "
            f"{target / 'written.csv'}, then: python -m nrdob.course.grading report"
        )
    return len(refused) + len(faults)


def report(target: Path = GRADING, plan: Course | None = None) -> int:
    """Enter the marks written by hand; write feedback and tables anew."""
    if not (target / "gradebook.db").exists():
        raise CourseError(f"nothing is graded yet in {target}")
    records = Records(target / "submissions.json")
    faults = take_marks(target, records)
    api = course(target)
    for entry in records.entries:
        if not entry["reason"]:
            write_feedback(api, entry["folder"], entry["set"])
            print(f"feedback for {entry['student']} {entry['set']}", flush=True)
    write_tables(target, records, plan or Course())
    for fault in faults:
        print(f"  {fault}")
    print(f"Points: {target / 'grades.csv'}")
    return len(faults)


# --- command line -------------------------------------------------------------------------------


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Give out problem sets, and grade them.")
    commands = parser.add_subparsers(dest="command", required=True)
    giving = commands.add_parser("release", help="make the students' copies and the solutions")
    giving.add_argument("sets", nargs="*", metavar="SET", help="set1, set2, …; by default all")
    giving.add_argument("--output", type=Path, default=RELEASE, metavar="FOLDER")
    grading = commands.add_parser("grade", help="grade what students handed in")
    grading.add_argument("folder", type=Path, metavar="FOLDER")
    grading.add_argument("--set", action="append", default=[], help="only this one, e.g. set2")
    grading.add_argument("--jobs", type=int, default=2, help="how many at a time")
    grading.add_argument(
        "--limit", type=float, default=1200, metavar="SECONDS", help="for one submission"
    )
    grading.add_argument(
        "--trust", action="store_true", help="run suspicious code even where there is no wall"
    )
    grading.add_argument(
        "--as-root", action="store_true", help="grade as root; students' code becomes nobody"
    )
    reporting = commands.add_parser("report", help="after marks were written into written.csv")
    for command in (grading, reporting):
        command.add_argument("--output", type=Path, default=GRADING, metavar="FOLDER")
        command.add_argument(
            "--course", type=Path, metavar="FILE", help="roster, deadlines; by default course.toml"
        )
    return parser.parse_args(arguments)


def checked(names: Sequence[str]) -> list[str]:
    """Take sets as "set2" or "2"; an unknown one is an error."""
    known = sets_in(SOURCE)
    names = [name if name.startswith("set") else f"set{name}" for name in names]
    for name in names:
        if name not in known:
            raise CourseError(f"there is no {name}; there are {', '.join(known)}")
    return names


def planned(path: Path | None) -> Course:
    """Read the settings of the course; without a file there are none."""
    if path is None and not COURSE.exists():
        return Course()
    try:
        return read_course(path or COURSE)
    except (OSError, ValueError, TypeError) as error:
        raise CourseError(str(error)) from None


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; 0 if all is well, 1 if some could not be graded, 2 if nothing was."""
    options = parse(arguments)
    try:
        if options.command == "release":
            release(checked(options.sets) or list(sets_in(SOURCE)), SOURCE, options.output)
            return 0
        plan = planned(options.course)
        if options.command == "grade":
            if wall.is_root() and not options.as_root:
                raise CourseError(AS_ROOT)
            left = grade(
                options.folder,
                checked(options.set),
                options.output,
                jobs=options.jobs,
                limit=options.limit,
                plan=plan,
                trust=options.trust,
            )
        else:
            left = report(options.output, plan)
    except CourseError as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("Stopped. What was graded is in the tables.", file=sys.stderr)
        return 2
    return 1 if left else 0
