"""The settings of a course: who is in it, when a set is due, and what is taken off for being late.

They stand in a file that the teacher writes, ``course.toml``::

    roster = "roster.csv"       # columns id, name, group; the last one may be left out

    [deadlines]
    set1 = 2026-11-02T23:59:00  # local time

    [late]
    grace = 15                  # minutes that cost nothing
    per_day = 10                # per cent of the points earned, for each day begun
    most_days = 5               # later than that nothing is earned

    [extensions.set1]
    "Anna Müller" = 2026-11-05T23:59:00
"""

from __future__ import annotations

import csv
import re
import tomllib
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from math import ceil
from pathlib import Path
from typing import Any

__all__ = ["Course", "Student", "read_course"]


@dataclass(frozen=True)
class Student:
    """A line of the roster."""

    name: str
    identifier: str = ""
    group: int | None = None
    row: Mapping[str, str] = field(default_factory=dict, compare=False)


@dataclass(frozen=True)
class Course:
    """What a teacher has settled; nothing, without a file."""

    students: tuple[Student, ...] = ()
    deadlines: Mapping[str, datetime] = field(default_factory=dict)
    extensions: Mapping[str, Mapping[str, datetime]] = field(default_factory=dict)
    grace: float = 0.0
    per_day: float = 0.0
    most_days: float = float("inf")

    def find(self, name: str, identifier: str = "") -> Student | None:
        """Find who is meant: by number, or by a name that is nobody else's."""
        for student in self.students:
            if identifier and identifier == student.identifier:
                return student
        asked = spellings(name)
        found = [
            student
            for student in self.students
            if name == student.identifier or asked & spellings(student.name)
        ]
        return found[0] if len(found) == 1 else None

    def due(self, name: str, student: str) -> datetime | None:
        """Give the deadline of a set, or a student's own; None if there is none."""
        return self.extensions.get(name, {}).get(student) or self.deadlines.get(name)

    def days_late(self, name: str, student: str, handed_in: datetime | None) -> int:
        """Count the days begun after the deadline of a set, or after a student's own."""
        due = self.due(name, student)
        if due is None or handed_in is None:
            return 0
        late = handed_in.astimezone() - due.astimezone() - timedelta(minutes=self.grace)
        return max(0, ceil(late / timedelta(days=1)))

    @property
    def rule(self) -> str:
        """Say what being late costs.

        Examples
        --------
        >>> Course(grace=15, per_day=10).rule
        'each day begun costs 10 % of the points; 15 minutes are free'
        """
        parts = [f"each day begun costs {self.per_day:g} % of the points"]
        if self.most_days < float("inf"):
            parts.append(f"after {self.most_days:g} days nothing is earned")
        if self.grace:
            parts.append(f"{self.grace:g} minutes are free")
        return "; ".join(parts)

    def share(self, days: int) -> float:
        """Give the share of the points that stay, after so many days.

        Examples
        --------
        >>> rule = Course(per_day=10, most_days=5)
        >>> rule.share(0), rule.share(2), rule.share(6)
        (1.0, 0.8, 0.0)
        """
        return 0.0 if days > self.most_days else max(0.0, 1 - self.per_day * days / 100)


def spellings(name: str) -> set[str]:
    """Give the forms in which platforms write a name: letters only, either part first.

    Examples
    --------
    >>> "muelleranna" in spellings("Anna Müller") and "annamuller" in spellings("Müller, Anna")
    True
    """
    german = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "ø": "oe", "å": "aa"})
    low = unicodedata.normalize("NFC", name).casefold()
    found = set()
    for text in (low, low.translate(german)):
        plain = unicodedata.normalize("NFD", text)
        words = re.findall(r"\w+", "".join(c for c in plain if not unicodedata.combining(c)))
        for turn in range(len(words)):
            found.add("".join(words[turn:] + words[:turn]))
        letters = re.findall(r"\w+", text)
        for turn in range(len(letters)):
            found.add("".join(letters[turn:] + letters[:turn]))
    return found


def read_course(path: Path) -> Course:
    """Read the settings of a course.

    Raises
    ------
    ValueError
        If something in the file, or in the roster that it names, is not as it must be.
    """
    try:
        settings = tomllib.loads(path.read_text("utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path.name} cannot be read: {error}") from None
    unknown = set(settings) - {"roster", "deadlines", "late", "extensions"}
    late = dict(settings.get("late", {}))
    unknown |= {f"late.{key}" for key in set(late) - {"grace", "per_day", "most_days"}}
    if unknown:
        raise ValueError(f"{path.name} knows no {', '.join(sorted(unknown))}")
    extensions = settings.get("extensions", {})
    return Course(
        students=read_roster(path.parent / settings["roster"]) if "roster" in settings else (),
        deadlines=_times(settings.get("deadlines", {}), path),
        extensions={name: _times(given, path) for name, given in extensions.items()},
        **late,
    )


def _times(given: Mapping[str, Any], path: Path) -> dict[str, datetime]:
    for name, value in given.items():
        if not isinstance(value, datetime):
            raise ValueError(f"{path.name}: {name} = {value} is no time like 2026-11-02T23:59:00")
    return dict(given)


COLUMNS = {
    "identifier": ("id", "student id", "identifier", "id number", "matriculation", "number"),
    "name": ("name", "student", "full name"),
    "group": ("group",),
}


def read_roster(path: Path) -> tuple[Student, ...]:
    """Read a roster: a table with the columns id, name and group, or a gradebook of Canvas.

    Raises
    ------
    ValueError
        If there is no such file, no column for names, or a group that is no whole number.
    """
    if not path.exists():
        raise ValueError(f"there is no roster {path}")
    with path.open(newline="", encoding="utf-8-sig") as file:
        sample = file.readline()
        file.seek(0)
        delimiter = ";" if sample.count(";") > sample.count(",") else ","
        rows = list(csv.DictReader(file, delimiter=delimiter))
    columns = {(column or "").strip().casefold(): column for column in (rows[0] if rows else ())}
    where = {key: _first(columns, names) for key, names in COLUMNS.items()}
    first, last = _first(columns, ("first name",)), _first(columns, ("last name", "surname"))
    if not where["name"] and not (first and last):
        raise ValueError(f"{path.name} needs a column name; it has {', '.join(columns)}")
    students = []
    for row in rows:
        name = row[where["name"]] if where["name"] else f"{row[first or '']} {row[last or '']}"
        name = (name or "").strip()
        if not name or name == "Points Possible":
            continue
        text = (row[where["group"]] or "").strip() if where["group"] else ""
        if text and not text.isdecimal():
            raise ValueError(f"{path.name}: the group of {name} is {text!r}, no whole number")
        identifier = (row[where["identifier"]] or "").strip() if where["identifier"] else ""
        given = {key: value or "" for key, value in row.items() if key}
        students.append(Student(name, identifier, int(text) if text else None, given))
    return tuple(students)


def _first(columns: Mapping[str, str], names: Iterable[str]) -> str | None:
    return next((columns[name] for name in names if name in columns), None)
