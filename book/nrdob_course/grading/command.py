"""Give out the problem sets, and grade what comes back.

The result is a course in nbgrader's layout, with tables and pages of ours: see
``book/teaching/running.md``, and ``python -m nrdob_course.grading --help``.
"""

import argparse
import csv
import getpass
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import nbformat
from sqlalchemy.exc import DatabaseError

from . import marks, sandbox, similar, written
from .autograde import course, write_feedback
from .batch import Batch, Outcome
from .marking import write_marking, write_tally
from .marks import Record, Records, grades_of, number, problem_of, unmarked
from .platforms import packed, unpacked
from .release import SOURCE, CourseError, found_course, generate, release, sets_in
from .roster import UNPLANNED, Course, read_course
from .submissions import NOTHING, Notebooks, Submission, find, remark_group, repair
from .written import Key, Typed, read_written, write_written

__all__ = ["grade", "main", "override", "parse", "regrade", "release", "report"]

ADVICE = SOURCE.parents[1] / "problems.toml"

# Beside each other in the folder where the command is run.
RELEASE = Path("build") / "exercises"
GRADING = Path("grading")
COURSE = Path("course.toml")

Notebook = Any


# --- grading ------------------------------------------------------------------------------------


def grade(
    folder: Path,
    wanted: Sequence[str] = (),
    target: Path = GRADING,
    jobs: int = 2,
    plan: Course | None = None,
    trust: bool = False,
) -> int:
    """Grade what students handed in; the result is how many could not be graded."""
    if not folder.exists():
        raise CourseError(f"there is no folder {folder}")
    plan = plan or UNPLANNED
    if sandbox.missing():
        print(f"{sandbox.missing()}. {NO_SANDBOX}")
    if sandbox.stays_root():
        print(f"{sandbox.stays_root()}. Grade as a user of your own.")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as place:
        faults = []
        if packed(folder):
            faults = list(unpacked(folder, Path(place)))
            folder = Path(place)
        submissions = find(folder, sets_in(SOURCE), wanted, plan)
        if not submissions:
            raise CourseError(f"there are no submissions in {folder}")
        found_course(target)
        records = Records(target / "submissions.json")
        faults += take_marks(target, records).faults.values()
        given_out = released(target, {s.set for s in submissions if not s.reason})
        for fault in faults:
            print(fault, flush=True)
        ready = []
        for submission in list(submissions):
            if submission.reason and records.graded(submission):  # what came earlier stays
                submissions.remove(submission)
                if submission.reason != NOTHING:
                    told = f"{submission.reason}. What was graded earlier stays"
                    faults.append(f"{submission.name}: {told}")
                continue
            if not submission.reason:
                hand_over(submission, given_out[submission.set], target, records, plan)
            if not submission.reason and submission.suspicious and sandbox.missing() and not trust:
                submission.reason = NOT_RUN
            entry = records.add(submission, submission.reason or "it is still to be graded")
            if submission.reason:
                print(f"not graded: {submission.name}: {submission.reason}", flush=True)
            else:
                ready.append((entry["folder"], submission))
    try:
        run(ready, target, records, jobs)
        records.remark_shared_groups(plan)
    finally:  # after an interrupt, too
        write_tables(target, records, plan)
    compare(target, records, given_out, sets_in(SOURCE))
    return summary(target, submissions, records, faults)


def released(target: Path, names: set[str]) -> Notebooks:
    """Give the students' copy of each of some sets, made anew."""
    places = {name: generate(target, SOURCE, name) for name in sorted(names)}
    return {name: nbformat.read(p / f"{name}.ipynb", as_version=4) for name, p in places.items()}


NO_SANDBOX = (
    "It runs with your rights, and could read and change what you can: what looks as if it did is "
    "not run, unless you have read it and say --trust. Grade strangers' work in a virtual machine."
)
NOT_RUN = (
    "it was not run, for there is no sandbox on this system: read what is remarked, then --trust"
)


def hand_over(
    submission: Submission, given_out: Notebook, target: Path, records: Records, plan: Course
) -> None:
    """Put a submission where nbgrader looks for it, repaired."""
    known = plan.find(submission.student, submission.owner.identifier)
    place = target / "submitted" / records.folder_of(submission.student) / submission.set
    try:
        repair(submission, given_out, known.group if known else None)
        if place.exists():
            shutil.rmtree(place)
        place.mkdir(parents=True)
        nbformat.write(submission.notebook, place / f"{submission.set}.ipynb")
        for picture in submission.pictures():
            shutil.copy(picture, place)
    except Exception as error:  # whatever a file may hold
        submission.reason = f"its cells cannot be read ({type(error).__name__}: {error!s:.200})"


def run(ready: list[tuple[str, Submission]], target: Path, records: Records, jobs: int) -> None:
    """Grade, and tell how it goes."""
    with course(target).gradebook as gradebook:
        for count, outcome in enumerate(Batch(target, jobs).grade(ready), start=1):
            remark_group(outcome.submission, outcome.groups)
            entry = records.add(outcome.submission, outcome.reason, outcome.seconds)
            if not outcome.reason:
                marks.enter(gradebook, entry["folder"], outcome)
            print(f"[{count:>{len(str(len(ready)))}}/{len(ready)}] {came_of(outcome)}", flush=True)


def compare(target: Path, records: Records, given_out: Notebooks, solutions: Notebooks) -> None:
    """List the submissions whose answers are alike, or published ones, of the sets just graded."""
    path = target / "similar.csv"
    columns = ["set", "first", "second", "cells", "share"]
    rows: list[dict[str, Any]] = []
    if path.exists():
        with path.open(newline="", encoding="utf-8", errors="replace") as file:
            before = [{c: row.get(c) for c in columns} for row in csv.DictReader(file)]
        rows = [row for row in before if row["set"] not in given_out]
    for name, skeleton in given_out.items():
        graded = [e for e in records.entries if e["set"] == name and not e["reason"]]
        places = {entry["student"]: target / marks.place_of(entry) for entry in graded}
        notebooks = {who: nbformat.read(place, as_version=4) for who, place in places.items()}
        copies = similar.copies(notebooks, skeleton, solutions[name])
        found = similar.pairs(notebooks, skeleton)
        rows += [{"set": name, **line} for line in [*copies, *found]]
        if copies:
            print(f"{name}: {len(copies)} students have answers like the published ones: {path}")
        if found:
            print(f"{name}: {len(found)} pairs of students have answers that are alike: {path}")
    marks.write_table(path, columns, rows)


def came_of(outcome: Outcome) -> str:
    """Tell in a line what came of a submission."""
    points = [points for points in outcome.grades.values() if points is not None]
    open_ones = len(outcome.grades) - len(points)
    reason = outcome.reason
    parts = [f"not graded: {reason}" if reason else f"{number(sum(points))} points"]
    if open_ones:
        parts.append(f"{open_ones} to mark by hand")
    parts += outcome.submission.remarks
    return f"{outcome.submission.name} ({outcome.seconds:.0f} s): {'; '.join(parts)}"


def take_marks(target: Path, records: Records, tables: Sequence[Path] = ()) -> Typed:
    """Enter the marks written by hand, if there are any yet, from tables of their own at last."""
    typed = Typed()
    if not (target / "gradebook.db").exists():
        return typed
    given = written.overridden(target)
    with course(target).gradebook as gradebook:
        for table in (target / "written.csv", *tables):
            typed.add(read_written(table, gradebook, records, given))
        written.apply(gradebook, records, given)
    return typed


def write_tables(target: Path, records: Records, plan: Course, tables: Sequence[Path] = ()) -> None:
    """Write what the teacher reads, and what the platform imports."""
    records.save()
    typed = take_marks(target, records, tables)  # also what was typed in the meantime
    with course(target).gradebook as gradebook:
        found = marks.lines(gradebook, records, plan)
        marks.write_grades(target / "grades.csv", found)
        marks.write_course(target / "course.csv", found, plan)
        write_written(target / "written.csv", gradebook, records, typed)
        write_marking(target / "marking.html", gradebook, records, sets_in(SOURCE), ADVICE)
        marks.tell_late(target, found, plan)
        marks.write_platforms(target, found, plan)
        marks.pack_feedback(target, found)
        write_tally(target / "class.html", target, found)


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
            print(f"  {Submission(entry['student'], entry['set']).name}: {remark}")
    for fault in faults:
        print(f"  {fault}")
    print(
        f"Points: {target / 'grades.csv'}, {target / 'course.csv'}\nFeedback: {target / 'feedback'}"
    )
    with course(target).gradebook as gradebook:
        left = sum(unmarked(grade) for entry in entries for grade in grades_of(gradebook, entry))
    if left:
        print(
            f"{left} answers are to be marked by hand: in {target / 'marking.html'}, without "
            f"names, or in {target / 'written.csv'}; then: python -m nrdob_course.grading report"
        )
    return len(refused) + len(faults)


def report(target: Path = GRADING, plan: Course | None = None, tables: Sequence[Path] = ()) -> int:
    """Enter the marks written by hand; write feedback and tables anew."""
    records = records_of(target)
    if missing := [table for table in tables if not table.is_file()]:
        raise CourseError(f"there is no table {missing[0]}")
    faults = take_marks(target, records, tables).faults.values()
    for fault in faults:
        print(fault, flush=True)
    entries = [entry for entry in records.entries if not entry["reason"]]
    write_anew(target, records, entries, plan, tables)
    for fault in faults:
        print(f"  {fault}")
    print(f"Points: {target / 'grades.csv'}")
    return len(faults)


def records_of(target: Path) -> Records:
    """Give what is known of a course that was graded."""
    if not (target / "gradebook.db").exists():
        raise CourseError(f"nothing is graded yet in {target}")
    return Records(target / "submissions.json")


def write_anew(
    target: Path,
    records: Records,
    entries: Iterable[Record],
    plan: Course | None,
    tables: Sequence[Path] = (),
) -> None:
    """Write the feedback of some submissions, and all tables, anew."""
    api = course(target)
    for entry in entries:
        write_feedback(api, entry["folder"], entry["set"])
        print(f"feedback for {entry['student']} {entry['set']}", flush=True)
    write_tables(target, records, plan or UNPLANNED, tables)


# --- changing -----------------------------------------------------------------------------------


def override(
    target: Path, key: Key, points: str, who: str, why: str, plan: Course | None = None
) -> int:
    """Give the points of one answer by hand, or withdraw such points; it is logged."""
    records = records_of(target)
    with course(target).gradebook as gradebook:
        entry = written.override(gradebook, target, records, key, points, who, why)
    write_anew(target, records, [entry], plan)
    print(f"{' '.join(key)}: {points}. The log: {target / written.LOG}")
    return 0


def regrade(
    target: Path,
    students: Sequence[str],
    problems: Sequence[str],
    who: str,
    why: str,
    jobs: int = 2,
    plan: Course | None = None,
) -> int:
    """Judge anew what some students have handed in, or some problems of all; it is logged.

    Points given by hand, and those of other problems, stay.
    """
    records = records_of(target)
    sets = {f"set{problem.partition('.')[0]}" for problem in problems}
    chosen = [entry for entry in records.entries if not entry["reason"]]
    chosen = [entry for entry in chosen if not students or entry["student"] in students]
    chosen = [entry for entry in chosen if not sets or entry["set"] in sets]
    if unknown := set(students) - {entry["student"] for entry in chosen}:
        raise CourseError(f"nothing of {', '.join(sorted(unknown))} is graded there")
    with course(target).gradebook as gradebook:
        there = {problem_of(g.name) for entry in chosen for g in grades_of(gradebook, entry)}
    if (missing := set(problems) - there) or not there:
        told, graded = (", ".join(sorted(each, key=marks.in_order)) for each in (missing, there))
        raise CourseError(f"nothing is graded of {told}; there is {graded or 'nothing'}")
    released(target, {entry["set"] for entry in chosen})
    entries = {(entry["student"], entry["set"]): entry for entry in chosen}
    ready = [(entry["folder"], Submission(entry["student"], entry["set"])) for entry in chosen]
    failed = 0
    for outcome in Batch(target, jobs).grade(ready):
        submission = outcome.submission
        entry = entries[submission.student, submission.set]
        if outcome.reason:
            failed += 1
            print(f"not regraded: {submission.name}: {outcome.reason}", flush=True)
            continue
        for cell in list(outcome.grades):
            if problems and problem_of(cell) not in problems:
                del outcome.grades[cell]
        with course(target).gradebook as gradebook:
            before = {grade.name: grade.auto_score for grade in grades_of(gradebook, entry)}
            marks.enter(gradebook, entry["folder"], outcome)
        changed = [
            ((entry["student"], entry["set"], problem_of(cell)), number(before[cell]), number(new))
            for cell, new in outcome.grades.items()
            if number(before[cell]) != number(new)
        ]
        written.log(target, "regrade", who, why, changed)
        for key, old, new in changed:
            print(f"{' '.join(key)}: {old} → {new}", flush=True)
    write_anew(target, records, chosen, plan)
    print(f"The log: {target / written.LOG}")
    return failed


# --- command line -------------------------------------------------------------------------------


def login() -> str:
    """Tell who is at the keyboard; where the system does not know, nobody does."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return "unknown"


ARGUMENTS: dict[str, dict[str, Any]] = {
    "sets": dict(nargs="*", metavar="SET", help="set1, set2, …; by default all"),
    "folder": dict(type=Path, metavar="FOLDER"),
    "tables": dict(nargs="*", type=Path, metavar="TABLE", help="marked.csv, from marking.html"),
    "--set": dict(dest="wanted", action="append", default=[], help="only this one, e.g. set2"),
    "--trust": dict(action="store_true", help="run suspicious code even where there is no sandbox"),
    "--student": dict(required=True, metavar="NAME"),
    "--problem": dict(required=True, metavar="ID", help="e.g. 2.3"),
    "--points": dict(required=True, metavar="NUMBER", help="or auto, to withdraw earlier ones"),
    "--student …": dict(dest="students", action="append", default=[], metavar="NAME"),
    "--problem …": dict(
        dest="problems", action="append", default=[], metavar="ID", help="e.g. 2.3"
    ),
    "--why": dict(required=True, metavar="REASON"),
    "--who": dict(default=login(), metavar="NAME", help="yours"),
    "--jobs": dict(type=int, default=2, help="how many at a time"),
    "--as-root": dict(action="store_true", help="run students' code even if you are root"),
    "--output": dict(dest="target", type=Path, default=GRADING, metavar="FOLDER"),
    "--course": dict(type=Path, metavar="FILE", help="roster, deadlines; by default course.toml"),
}
RUNNING, WRITING = ("--jobs", "--as-root"), ("--output", "--course")
ASKED: dict[str, tuple[str, ...]] = {
    "release": ("make the students' copies and the solutions", "sets", "--output"),
    "grade": ("grade what students handed in", "folder", "--set", "--trust", *RUNNING, *WRITING),
    "report": ("after marks were written into written.csv", "tables", *WRITING),
    "regrade": ("judge students, or problems, anew; it is logged", "--student …", "--problem …",
                "--why", "--who", *RUNNING, *WRITING),
    "override": ("change the points of one answer; it is logged", "--student", "--problem",
                 "--points", "--why", "--who", *WRITING),
}  # fmt: skip
"""What can be asked of the graders: about it, and what it is told, by the names above."""


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m nrdob_course.grading", description="Give out problem sets, and grade them."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    for name, (about, *told) in ASKED.items():
        command = commands.add_parser(name, help=about)
        for argument in told:
            command.add_argument(argument.removesuffix(" …"), **ARGUMENTS[argument])
    commands.choices["release"].set_defaults(target=RELEASE)
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
        return UNPLANNED
    try:
        found = read_course(path or COURSE)
    except OSError as error:
        raise CourseError(str(error)) from None
    if unknown := {*found.deadlines, *found.extensions} - set(sets_in(SOURCE)):
        raise CourseError(f"{(path or COURSE).name}: there is no {', '.join(sorted(unknown))}")
    return found


ROOT_STOPS = (
    "You are root: what students have written would run with more rights than it needs. Grade as a "
    "user of your own, or say --as-root."
)


COMMANDS: dict[str, Callable[..., int]] = {
    "grade": grade, "report": report, "regrade": regrade, "override": override,
}  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; 0 if all is well, 1 if some could not be graded, 2 if nothing was."""
    if isinstance(sys.stdout, TextIOWrapper):  # a terminal may lack a letter of a name
        sys.stdout.reconfigure(errors="replace")
    given = vars(parse(arguments))
    command, as_root = given.pop("command"), given.pop("as_root", True)
    try:
        if command == "release":
            release(checked(given["sets"]) or list(sets_in(SOURCE)), SOURCE, given["target"])
            return 0
        if not as_root and sandbox.is_root():
            raise CourseError(ROOT_STOPS)
        given["plan"] = planned(given.pop("course"))
        if command == "grade":
            given["wanted"] = checked(given["wanted"])
        if command == "override":
            student, problem = given.pop("student"), given.pop("problem")
            given["key"] = (student, f"set{problem.partition('.')[0]}", problem)
        left = COMMANDS[command](**given)
    except (CourseError, ValueError) as error:
        print(error, file=sys.stderr)
    except DatabaseError as error:
        print(f"gradebook.db cannot be read or written: {error.orig}", file=sys.stderr)
    except KeyboardInterrupt:
        print("Stopped. What was graded is in the tables.", file=sys.stderr)
    else:
        return 1 if left else 0
    return 2
