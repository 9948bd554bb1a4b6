"""Points given by hand: in ``written.csv``, for answers in words, and in the place of others.

What was typed is not lost. A line that cannot be entered stays as it is, and is named; before the
file is written anew, a copy of the one that was there goes into the folder ``backup``. A table
from the page for blind marking has codes in the place of names.

An override gives points to any problem; it stands when the work is graded again, until it is
withdrawn. A regrade lets the graders judge anew. Both leave a line in ``changes.csv``, which nobody
rewrites.
"""

import csv
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Self
from urllib.parse import quote

import nbformat
from nbgrader.api import Gradebook

from .marks import (
    Record,
    Records,
    comment_of,
    grades_of,
    harmless,
    number,
    page_of,
    place_of,
    problem_of,
    write_table,
)
from .roster import read_table, text_in

__all__ = [
    "LOG", "WRITTEN", "Key", "Typed", "answers_of", "apply", "log", "overridden", "override",
    "read_written", "to_be_marked", "write_written",
]  # fmt: skip

WRITTEN = ("student", "set", "problem", "of", "points", "comment", "answer", "feedback")

Key = tuple[str, str, str]  # student, set and problem


@dataclass
class Typed:
    """What came of points that were filled in: what is wrong, what was entered, what is kept.

    Where the table cannot be read, `readable` is False, and nobody may write another in its place.
    """

    faults: dict[Key, str] = field(default_factory=dict)
    entered: set[Key] = field(default_factory=set)
    kept: dict[Key, Mapping[str, str]] = field(default_factory=dict)
    readable: bool = True

    def add(self, later: Self) -> None:
        """Take over what came of another table; what that has entered is no fault any more."""
        for key in later.entered:
            self.faults.pop(key, None)
            self.kept.pop(key, None)
        self.faults |= later.faults
        self.kept |= later.kept
        self.readable &= later.readable


def to_be_marked(grade: Any) -> bool:
    """Tell whether somebody has to read the answer."""
    return grade.auto_score is None


def read_written(
    path: Path, gradebook: Gradebook, records: Records, overridden: Mapping[Key, float]
) -> Typed:
    """Enter the points that were filled in; those of an override stay."""
    typed = Typed()
    if not path.exists():
        return typed
    try:
        rows = read_table(path)
        columns = set(rows[0][1]) if rows else set(WRITTEN)
        whose = "code" if "code" in columns else "student"
        if missing := [name for name in ("set", "problem", "points", whose) if name not in columns]:
            raise ValueError(f"{path.name}, line 1: there is no column {missing[0]!r}")
        if wide := [line for line, row in rows if None in row]:
            raise ValueError(
                f"{path.name}, line {wide[0]}: it has more cells than the first line; "
                'a number with a comma must stand in quotes, "2,5"'
            )
    except (OSError, ValueError) as error:
        told = f"{error}. Nothing was taken from it, and it stays as it is"
        return Typed({("", "", path.name): told}, readable=False)
    entries = {
        (harmless(name), entry["set"]): entry
        for entry in records.entries
        for name in (entry["student"], entry.get("code"))
        if name
    }
    done: dict[Key, tuple[int, str]] = {}
    for line, row in rows:
        text, comment = text_in(row, "points"), text_in(row, "comment")
        if not (text or comment):
            continue
        who = text_in(row, "student") or text_in(row, "code")
        entry = entries.get((harmless(who), text_in(row, "set")))
        student = entry["student"] if entry else who
        key = student, text_in(row, "set"), text_in(row, "problem")
        grades = filter(to_be_marked, grades_of(gradebook, entry) if entry else [])
        grade = next((each for each in grades if problem_of(each.name) == key[2]), None)
        if entry is None or grade is None:
            name = " ".join(filter(None, key[1:])) or "?"
            problem = f"{student or 'nobody'} has no answer to {name} that is to be marked"
        elif key in done and done[key][1] != text:
            problem = f"line {done[key][0]} gives other points to the same answer"
        else:
            problem = wrong_points(text, grade.max_score) or _overridden(text, overridden.get(key))
        done.setdefault(key, (line, text))
        if problem:
            whose = f"{student} {key[2]}: " if entry else ""
            typed.faults[key] = f"{path.name}, line {line}: {whose}{problem}. The line is kept"
            typed.kept[key] = {name: text_in(row, name) for name in WRITTEN} | {"student": student}
            if done[key][0] != line:  # somebody has to decide
                typed.kept[key] = {**typed.kept[key], "points": f"{done[key][1]} or {text}"}
        elif entry is not None and grade is not None:
            if text:
                grade.manual_score = float(text.replace(",", "."))
                grade.needs_manual_grade = False
            comment_of(gradebook, entry, grade).manual_comment = comment or None
            typed.entered.add(key)
    gradebook.db.commit()
    return typed


def wrong_points(text: str, most: float) -> str:
    """Tell what is wrong with points that somebody has typed; empty if nothing is."""
    if not text:
        return ""
    try:
        points = float(text.replace(",", "."))
    except ValueError:
        return f"{text!r} is no number"
    return "" if 0 <= points <= most else f"{text} is not between 0 and {number(most)}"


def _overridden(text: str, points: float | None) -> str:
    if points is None or not text or float(text.replace(",", ".")) == points:
        return ""
    return f"an override gives {number(points)}; withdraw it first"


def write_written(path: Path, gradebook: Gradebook, records: Records, typed: Typed) -> None:
    """Write a line for each answer that is marked by hand; the points are to be filled in."""
    if not typed.readable:
        return
    left, rows = dict(typed.kept), []
    for entry in records.entries:
        texts = {name: " ".join(cell.source.split()) for name, cell in answers_of(path, entry)}
        for grade in filter(to_be_marked, grades_of(gradebook, entry)):
            key = entry["student"], entry["set"], problem_of(grade.name)
            row = {
                "of": number(grade.max_score),
                "points": number(grade.manual_score),
                "comment": comment_of(gradebook, entry, grade).manual_comment or "",
                "answer": texts.get(grade.name, "")[:3000],
                "feedback": f"{quote(page_of(entry))}#{grade.name}",
            }
            if kept := left.pop(key, None):
                row |= {"points": kept["points"], "comment": kept["comment"]}
            rows.append(dict(zip(WRITTEN[:3], key, strict=True)) | row)
    new = path.with_suffix(".new")
    write_table(new, list(WRITTEN), [*rows, *left.values()])
    if path.exists() and path.read_bytes() != new.read_bytes():
        backup = path.parent / "backup"
        backup.mkdir(exist_ok=True)
        shutil.copy2(path, backup / f"{path.stem}-{datetime.now():%Y%m%d-%H%M%S-%f}.csv")
    new.replace(path)


def answers_of(beside: Path, entry: Record) -> Iterable[tuple[str, Any]]:
    """Give the name and the cell of all that was handed in, of a submission that was graded."""
    path = beside.parent / place_of(entry)
    if entry["reason"] or not path.exists():
        return []
    cells = nbformat.read(path, as_version=4).cells
    return [(cell.id, cell) for cell in cells if "id" in cell]


# --- changes ------------------------------------------------------------------------------------

LOG = "changes.csv"
LOG_COLUMNS = ("when", "who", "how", "student", "set", "problem", "old", "new", "why")
AUTO = "auto"  # stands for the points of an override that was withdrawn


def log(root: Path, how: str, who: str, why: str, rows: Iterable[tuple[Key, str, str]]) -> None:
    """Append a line for each of the changes: student, set and problem, points before and after."""
    path, now = root / LOG, f"{datetime.now().astimezone():%Y-%m-%d %H:%M:%S%z}"
    if not path.exists():
        write_table(path, list(LOG_COLUMNS), [])
    with path.open("a", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerows([now, who, how, *key, old, new, why] for key, old, new in rows)


def overridden(root: Path) -> dict[Key, float]:
    """Give the points of the overrides that stand."""
    path = root / LOG
    found: dict[Key, float] = {}
    for line, row in read_table(path) if path.exists() else ():
        if row.get("how") != "override":
            continue
        key = (row["student"], row["set"], row["problem"])
        try:
            if row["new"] == AUTO:
                found.pop(key, None)
            else:
                found[key] = float(row["new"])
        except (TypeError, ValueError):
            raise ValueError(f"{path.name}, line {line}: {row['new']!r} is no number") from None
    return found


def apply(gradebook: Gradebook, records: Records, given: Mapping[Key, float | None]) -> None:
    """Enter the points of overrides; None withdraws one."""
    for entry in records.entries:
        for grade in grades_of(gradebook, entry):
            key = entry["student"], entry["set"], problem_of(grade.name)
            if key in given:
                grade.manual_score = given[key]
                grade.needs_manual_grade = given[key] is None and grade.auto_score is None
    gradebook.db.commit()


def override(
    gradebook: Gradebook, root: Path, records: Records, key: Key, points: str, who: str, why: str
) -> Record:
    """Give points by hand, or withdraw what was given so; the entry that has changed."""
    student, name, problem = key
    entries = {e["student"]: e for e in records.entries if e["set"] == name}
    entry = entries.get(student)
    if entry is None or entry["reason"]:
        there = ", ".join(sorted(entries))
        raise ValueError(f"nothing of {student} is graded in {name}; there are: {there}")
    grades = {problem_of(grade.name): grade for grade in grades_of(gradebook, entry)}
    if not (grade := grades.get(problem)):
        raise ValueError(f"{name} has no problem {problem!r}; it has {', '.join(grades)}")
    wrong = wrong_points(points, grade.max_score) if points else "no points are given"
    if wrong and points != AUTO:
        raise ValueError(f"{wrong}; give a number, or {AUTO} to withdraw an override")
    value = None if points == AUTO else float(points.replace(",", "."))
    old = number(grade.score) if grade.manual_score is not None else number(grade.auto_score)
    apply(gradebook, records, {key: value})
    new = AUTO if value is None else number(value)
    log(root, "override", who, why, [(key, old, new)])
    return entry
