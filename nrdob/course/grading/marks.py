"""Points in tables: from nbgrader's gradebook to ``grades.csv``, and from ``written.csv`` back.

What the gradebook does not know (remarks, the group, what could not be graded) is kept beside it.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from nbgrader.api import Gradebook, MissingEntry

from .batch import Outcome
from .submissions import Submission

__all__ = [
    "WRITTEN",
    "Records",
    "enter",
    "grades_of",
    "number",
    "problem_of",
    "read_written",
    "unmarked",
    "write_grades",
    "write_table",
    "write_written",
]

GRADED_CELL = re.compile(r"(?:check|written)-(\d+)-(\w+)")
WRITTEN = ("student", "set", "problem", "of", "points", "comment")

Record = dict[str, Any]


def problem_of(cell: str) -> str:
    """Give the problem that a graded cell belongs to: "check-2-1" is for 2.1."""
    match = GRADED_CELL.fullmatch(cell)
    return f"{match[1]}.{match[2]}" if match else cell


def in_order(problem: str) -> tuple[int, int, str]:
    """Sort problems by their numbers."""
    match = re.match(r"(\d+)\.(\d+)", problem)
    return (int(match[1]), int(match[2]), problem) if match else (10**6, 0, problem)


def number(points: float | None) -> str:
    """Write points as people do; empty if there are none yet."""
    return "" if points is None else f"{round(points, 3):g}"


# --- what the gradebook does not know -----------------------------------------------------------


class Records:
    """Who handed in what, and what there was to remark; one entry for student and set."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.entries: list[Record] = json.loads(path.read_text("utf-8")) if path.exists() else []

    def folder_of(self, student: str) -> str:
        """Name a student's folder: no pattern to nbgrader, allowed everywhere, and unique."""
        for entry in self.entries:
            if entry["student"] == student:
                return str(entry["folder"])
        taken = {entry["folder"].lower() for entry in self.entries}
        base = re.sub(r"[^\w.@-]+", "_", student).strip("._") or "student"
        name, count = base, 1
        while name.lower() in taken:
            count += 1
            name = f"{base}-{count}"
        return name

    def add(self, submission: Submission, reason: str = "") -> Record:
        """Enter a submission, in the place of an earlier one of the same student and set."""
        entry = {
            "student": submission.student,
            "folder": self.folder_of(submission.student),
            "set": submission.set,
            "group": submission.group,
            "remarks": submission.remarks,
            "reason": reason,
        }
        key = (submission.student, submission.set)
        others = [old for old in self.entries if (old["student"], old["set"]) != key]
        self.entries = sorted([*others, entry], key=lambda e: (e["student"], e["set"]))
        return entry

    def save(self) -> None:
        """Store the entries beside the gradebook."""
        text = json.dumps(self.entries, indent=1, ensure_ascii=False)
        self.path.write_text(text + "\n", "utf-8")


# --- the gradebook ------------------------------------------------------------------------------


def enter(gradebook: Gradebook, folder: str, outcome: Outcome) -> None:
    """Enter what was graded automatically; marks given by hand stay."""
    name = outcome.submission.set
    gradebook.update_or_create_student(folder)
    gradebook.update_or_create_submission(name, folder)
    for cell, points in outcome.grades.items():
        grade = gradebook.find_grade(cell, name, name, folder)
        grade.auto_score = points
        grade.needs_manual_grade = points is None or grade.manual_score is not None
    for cell, comment in outcome.comments.items():
        gradebook.find_comment(cell, name, name, folder).auto_comment = comment
    gradebook.db.commit()


def grades_of(gradebook: Gradebook, entry: Record) -> list[Any]:
    """Give nbgrader's grades of a submission, in the order of the problems."""
    if entry["reason"]:
        return []
    try:
        notebook = gradebook.find_submission_notebook(entry["set"], entry["set"], entry["folder"])
    except MissingEntry:
        return []
    return sorted(notebook.grades, key=lambda grade: in_order(problem_of(grade.name)))


def to_be_marked(grade: Any) -> bool:
    """Tell whether somebody has to read the answer."""
    return grade.auto_score is None


def unmarked(grade: Any) -> bool:
    """Tell whether nobody has read it yet."""
    return to_be_marked(grade) and grade.manual_score is None


# --- the tables ---------------------------------------------------------------------------------


def write_grades(path: Path, gradebook: Gradebook, records: Records) -> None:
    """Write a line for each student and set."""
    rows, problems = [], set()
    for entry in records.entries:
        grades = grades_of(gradebook, entry)
        row = {
            "student": entry["student"],
            "set": entry["set"],
            "group": "" if entry["group"] is None else entry["group"],
            "to mark by hand": " ".join(problem_of(g.name) for g in grades if unmarked(g)),
            "remarks": "; ".join(entry["remarks"]),
        }
        if entry["reason"]:
            row["remarks"] = "; ".join([f"not graded: {entry['reason']}", *entry["remarks"]])
        else:
            row["total"] = number(sum(grade.score for grade in grades))
            row["max"] = number(sum(grade.max_score for grade in grades))
        for grade in grades:
            row[problem_of(grade.name)] = "" if unmarked(grade) else number(grade.score)
            problems.add(problem_of(grade.name))
        rows.append(row)
    columns = ["student", "set", "group", *sorted(problems, key=in_order)]
    write_table(path, [*columns, "to mark by hand", "total", "max", "remarks"], rows)


def write_written(path: Path, gradebook: Gradebook, records: Records) -> None:
    """Write a line for each answer that is marked by hand; the points are to be filled in."""
    rows = []
    for entry in records.entries:
        for grade in filter(to_be_marked, grades_of(gradebook, entry)):
            comment = gradebook.find_comment(
                grade.name, entry["set"], entry["set"], entry["folder"]
            )
            rows.append(
                {
                    "student": entry["student"],
                    "set": entry["set"],
                    "problem": problem_of(grade.name),
                    "of": number(grade.max_score),
                    "points": number(grade.manual_score),
                    "comment": comment.manual_comment or "",
                }
            )
    write_table(path, list(WRITTEN), rows)


def write_table(path: Path, columns: list[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """Write a table as CSV, with Unix line ends."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, columns, restval="", lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def read_written(path: Path, gradebook: Gradebook, records: Records) -> list[str]:
    """Enter the points that were filled in; give back what could not be."""
    if not path.exists():
        return []
    problems = []
    with path.open(newline="", encoding="utf-8-sig") as file:
        sample = file.readline()
        file.seek(0)
        # Spreadsheets in many countries write semicolons.
        delimiter = ";" if sample.count(";") > sample.count(",") else ","
        for line, row in enumerate(csv.DictReader(file, delimiter=delimiter), start=2):
            if (row.get("points") or "").strip() or (row.get("comment") or "").strip():
                problem = _enter_mark(row, gradebook, records)
                if problem:
                    problems.append(f"{path.name}, line {line}: {problem}")
    gradebook.db.commit()
    return problems


def _enter_mark(row: Mapping[str, str | None], gradebook: Gradebook, records: Records) -> str:
    student, name, problem = (row.get(column) or "" for column in WRITTEN[:3])
    for entry in records.entries:
        if (entry["student"], entry["set"]) != (student, name):
            continue
        for grade in grades_of(gradebook, entry):
            if problem_of(grade.name) == problem and to_be_marked(grade):
                return _enter_points(row, grade, gradebook, entry)
    return f"{student or 'nobody'} has no answer to {problem or '?'} in {name or '?'} to be marked"


def _enter_points(
    row: Mapping[str, str | None], grade: Any, gradebook: Gradebook, entry: Record
) -> str:
    text = (row.get("points") or "").strip()
    if text:
        try:
            points = float(text.replace(",", "."))
        except ValueError:
            return f"{text!r} is no number"
        if not 0 <= points <= grade.max_score:
            return f"{text} is not between 0 and {number(grade.max_score)}"
        grade.manual_score = points
        grade.needs_manual_grade = False
    where = (grade.name, entry["set"], entry["set"], entry["folder"])
    gradebook.find_comment(*where).manual_comment = (row.get("comment") or "").strip() or None
    return ""
