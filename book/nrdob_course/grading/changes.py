"""Points that were changed after the grading, and why: the log ``changes.csv``.

An override gives points by hand, to any problem; it stands when the work is graded again, until it
is withdrawn. A regrade lets the graders judge anew. Both leave a line here, which nobody rewrites.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from nbgrader.api import Gradebook

from .marks import Record, Records, grades_of, number, problem_of, write_table
from .roster import read_table
from .written import Key, wrong_points

__all__ = ["COLUMNS", "FILE", "apply", "log", "overridden", "override"]

FILE = "changes.csv"
COLUMNS = ("when", "who", "how", "student", "set", "problem", "old", "new", "why")
AUTO = "auto"
"""Stands for the points of an override that was withdrawn."""


def log(root: Path, how: str, who: str, why: str, rows: Iterable[tuple[Key, str, str]]) -> None:
    """Append a line for each of the changes: student, set and problem, points before and after."""
    path, now = root / FILE, f"{datetime.now().astimezone():%Y-%m-%d %H:%M:%S%z}"
    if not path.exists():
        write_table(path, list(COLUMNS), [])
    with path.open("a", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerows([now, who, how, *key, old, new, why] for key, old, new in rows)


def overridden(root: Path) -> dict[Key, float]:
    """Give the points of the overrides that stand."""
    path = root / FILE
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


def found_grade(gradebook: Gradebook, records: Records, key: Key) -> tuple[Record, Any]:
    """Find what is to be changed; a ValueError tells what there is instead."""
    student, name, problem = key
    entries = {e["student"]: e for e in records.entries if e["set"] == name}
    entry = entries.get(student)
    if entry is None or entry["reason"]:
        there = ", ".join(sorted(entries))
        raise ValueError(f"nothing of {student} is graded in {name}; there are: {there}")
    grades = {problem_of(grade.name): grade for grade in grades_of(gradebook, entry)}
    if problem not in grades:
        raise ValueError(f"{name} has no problem {problem!r}; it has {', '.join(grades)}")
    return entry, grades[problem]


def override(
    gradebook: Gradebook, root: Path, records: Records, key: Key, points: str, who: str, why: str
) -> Record:
    """Give points by hand, or withdraw what was given so; the entry that has changed."""
    entry, grade = found_grade(gradebook, records, key)
    wrong = wrong_points(points, grade.max_score) if points else "no points are given"
    if wrong and points != AUTO:
        raise ValueError(f"{wrong}; give a number, or {AUTO} to withdraw an override")
    value = None if points == AUTO else float(points.replace(",", "."))
    old = number(grade.score) if grade.manual_score is not None else number(grade.auto_score)
    apply(gradebook, records, {key: value})
    new = AUTO if value is None else number(value)
    log(root, "override", who, why, [(key, old, new)])
    return entry
