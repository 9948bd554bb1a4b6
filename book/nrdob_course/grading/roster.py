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

import csv
import io
import re
import tomllib
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from math import ceil
from os.path import isfile
from pathlib import Path
from typing import Any

__all__ = ["UNPLANNED", "Course", "Student", "read_course", "read_table", "text_in"]


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
            numbered = identifier and identifier == student.identifier
            if numbered or name in (student.identifier, self.called(student)):
                return student
        found = self.namesakes(name)
        return found[0] if len(found) == 1 else None

    def namesakes(self, name: str) -> list[Student]:
        """Give all of a name, however it is written."""
        asked = spellings(name)
        return [student for student in self.students if asked & spellings(student.name)]

    def called(self, student: Student) -> str:
        """Name a student as nobody else is named."""
        alone = sum(other.name == student.name for other in self.students) == 1
        return student.name if alone else f"{student.name} ({student.identifier})"

    def due(self, name: str, student: str) -> datetime | None:
        """Give the deadline of a set, or a student's own; None if there is none."""
        known = self.find(student)
        for who, moment in self.extensions.get(name, {}).items():
            if who == student or (known and self.find(who) == known):
                return moment
        return self.deadlines.get(name)

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

        >>> rule = Course(per_day=10, most_days=5)
        >>> rule.share(0), rule.share(2), rule.share(6)
        (1.0, 0.8, 0.0)
        """
        return 0.0 if days > self.most_days else max(0.0, 1 - self.per_day * days / 100)


UNPLANNED = Course()

MOST = 1_000_000  # largest number in the rules of a course


def spellings(name: str) -> set[str]:
    """Give the forms in which platforms write a name: letters only, either part first.

    >>> "muelleranna" in spellings("Anna Müller") and "annamuller" in spellings("Müller, Anna")
    True
    """
    german = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "ø": "oe", "å": "aa"})
    low = unicodedata.normalize("NFC", name).casefold()
    found = set()
    for text in (low, low.translate(german)):
        plain = unicodedata.normalize("NFD", text)
        for form in (text, "".join(c for c in plain if not unicodedata.combining(c))):
            words = re.findall(r"\w+", form)
            found |= {"".join(words[turn:] + words[:turn]) for turn in range(len(words))}
    return found


def read_course(path: Path) -> Course:
    """Read the settings of a course; a ValueError says what in it, or its roster, is wrong."""
    try:
        settings = tomllib.loads(path.read_text("utf-8-sig"))
    except (ValueError, RecursionError) as error:  # no TOML, no UTF-8, or brackets too deep
        raise ValueError(f"{path.name} cannot be read: {error}") from None
    for key in ("deadlines", "late", "extensions"):
        if not isinstance(settings.get(key, {}), dict):
            raise ValueError(f"{path.name}: {key} = {settings[key]!r} is no table: write [{key}]")
    unknown = set(settings) - {"roster", "deadlines", "late", "extensions"}
    late = dict(settings.get("late", {}))
    unknown |= {f"late.{key}" for key in set(late) - {"grace", "per_day", "most_days"}}
    if unknown:
        raise ValueError(f"{path.name} knows no {', '.join(sorted(unknown))}")
    for key, value in late.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= MOST:
            told = f"late.{key} = {value!r:.40} is no number from 0 to a million"
            raise ValueError(f"{path.name}: {told}")
    if not isinstance(settings.get("roster", ""), str):
        raise ValueError(f"{path.name}: roster = {settings['roster']!r} is no name of a file")
    found = Course(
        students=read_roster(path.parent / settings["roster"]) if "roster" in settings else (),
        deadlines=_times(settings.get("deadlines", {}), path),
        extensions={n: _times(own, path) for n, own in settings.get("extensions", {}).items()},
        **late,
    )
    for name, given in found.extensions.items():
        for who in given:
            if found.students and not found.find(who):
                told = f"nobody on the roster, or more than one, is called {who!r}"
                raise ValueError(f"{path.name}: extensions.{name}: {told}")
    return found


def _times(given: Any, path: Path) -> dict[str, datetime]:
    if not isinstance(given, dict):
        raise ValueError(f"{path.name}: {given!r} stands where names and times should")
    for name, value in given.items():
        if not isinstance(value, datetime) or not 1970 < value.year < 2200:
            raise ValueError(f"{path.name}: {name} = {value} is no time like 2026-11-02T23:59:00")
    return dict(given)


COLUMNS = {
    "identifier": ("id", "student id", "identifier", "id number", "matriculation", "number"),
    "name": ("name", "student", "full name"),
    "group": ("group",),
    "first": ("first name",),
    "last": ("last name", "surname"),
}


def read_roster(path: Path) -> tuple[Student, ...]:
    """Read a roster: a table with the columns id, name and group, or a gradebook of Canvas.

    A ValueError tells of a missing file or column, a group that is no whole number, and students
    who cannot be told apart.
    """
    if not isfile(path):  # unlike the path's own method, also for a name that is too long
        raise ValueError(f"there is no roster {path}")
    rows = read_table(path)
    columns = {(column or "").strip().casefold(): column for column in (rows[0][1] if rows else ())}
    where = {
        key: next((columns[name] for name in names if name in columns), None)
        for key, names in COLUMNS.items()
    }
    if not where["name"] and not (where["first"] and where["last"]):
        raise ValueError(f"{path.name} needs a column name; it has {', '.join(columns) or 'none'}")
    students: dict[tuple[str, str], Student] = {}
    for line, row in rows:
        if None in row:
            raise ValueError(f"{path.name}, line {line}: it has more cells than the first line")
        found = {key: text_in(row, column) for key, column in where.items()}
        full = f"{found['first']} {found['last']}".strip()
        name, identifier = found["name"] if where["name"] else full, found["identifier"]
        if not name or name == "Points Possible":
            continue
        if found["group"] and not found["group"].isdecimal():
            told = f"the group of {name} is {found['group']!r}, no whole number"
            raise ValueError(f"{path.name}, line {line}: {told}")
        group = int(found["group"]) if found["group"] else None
        given = {key: value or "" for key, value in row.items() if key}
        key = ("id", identifier) if identifier else ("name", name)
        if key in students:
            raise ValueError(
                f"{path.name}, line {line}: {name} cannot be told from {students[key].name}, "
                f"{'who has the same number' if identifier else 'for there is no number'}"
            )
        students[key] = Student(name, identifier, group, given)
    return tuple(students.values())


def read_table(path: Path) -> list[tuple[int, dict[Any, Any]]]:
    """Read a CSV file of whatever country: each row with the number of the line where it ends.

    A ValueError names the file and the line where it is no table, or no text in UTF-8 or UTF-16.
    """
    data = path.read_bytes()
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        what = "a spreadsheet" if data[:2] == b"PK" else "in another encoding"
        raise ValueError(f"{path.name}, line {line}: it is {what}: save it as CSV UTF-8") from None
    first = text.partition("\n")[0]
    delimiter = max(",;\t", key=first.count)
    reader = csv.DictReader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    try:
        return [(reader.line_num, row) for row in reader]
    except csv.Error as error:
        line = reader.reader.line_num
        raise ValueError(f"{path.name}, line {line}: {error}") from None


def text_in(row: Mapping[Any, str | None], column: str | None) -> str:
    """Give what stands in a column of a row; empty if nothing does, or there is no such column."""
    return (row.get(column) or "").strip()
