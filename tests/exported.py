"""A class of sixty, and what it handed in as learning platforms export it and import it again."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

from nrdob_course.grading.roster import Course, read_course

__all__ = ["CLASS", "DUE", "Sent", "canvas", "moment_of", "moodle", "plan", "read_canvas"]
__all__ += ["read_moodle", "table", "taken_by_canvas", "taken_by_moodle"]

FIRST = ["Anna", "Bo", "Cleo", "Dan", "Eva", "Finn", "Gül", "Hana", "Ivo", "José"]
LAST = ["Müller", "Nguyen", "O'Brien", "Pérez", "Qvist", "Rossi"]
CLASS = [f"{first} {last}" for last in LAST for first in FIRST]
DUE = datetime(2026, 11, 2, 23, 59)

Entry = tuple[str, str | bytes, datetime]


@dataclass(frozen=True)
class Sent:
    """What one student handed in: a notebook's text, when, and how.

    ``earlier`` was handed in before it; ``zipped`` says that the student has packed it.
    """

    text: str
    moment: datetime
    earlier: str = ""
    zipped: bool = False


def moment_of(k: int) -> datetime:
    """The second is two days late, the third in the minutes of grace, the fourth has leave."""
    late = {1: timedelta(hours=25), 2: timedelta(minutes=10), 3: timedelta(days=9)}
    return DUE + late.get(k, -timedelta(days=1)) + timedelta(seconds=k % 2)


def moodle(place: Path, name: str, sent: Sequence[Sent]) -> Path:
    """Write the zip of *Download all submissions*; it holds the last of each student's."""
    files: list[Entry] = []
    for k, (student, this) in enumerate(zip(CLASS, sent, strict=True)):
        stem = f"{student}_{5000 + k}_assignsubmission"
        files.append(as_file(f"{stem}_file_/{name}", name, this.text, this))
        if k % 5 == 0:
            files.append((f"{stem}_onlinetext_/onlinetext.html", "<p>Hello</p>", this.moment))
    return export(place / "Course-Set 2-4711.zip", files)


def canvas(place: Path, name: str, sent: Sequence[Sent]) -> Path:
    """Write the zip of *Download Submissions*; the number before the dot grows with each try."""
    files: list[Entry] = []
    for k, (student, this) in enumerate(zip(CLASS, sent, strict=True)):
        first, last = student.split()
        stem = re.sub(r"\W", "", (last + first)).lower() + ("_LATE" if k == 1 else "")
        if this.earlier:
            early = f"{stem}_{1000 + k}_{90000 + k}_{name}"
            files.append(as_file(early, name, this.earlier, this))
        again = "-1" if this.earlier else ""
        path = f"{stem}_{1000 + k}_{90100 + k}_{name}{again}"
        files.append(as_file(path, name, this.text, this))
    return export(place / "submissions.zip", files)


def as_file(path: str, name: str, text: str, this: Sent) -> Entry:
    if not this.zipped:
        return f"{path}.ipynb", text, this.moment
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"my work/{name}.ipynb", text)
    return f"{path}.zip", packed.getvalue(), this.moment


def export(path: Path, files: Sequence[Entry]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content, moment in files:
            packed.writestr(zipfile.ZipInfo(name, moment.timetuple()[:6]), content)
    return path


def plan(place: Path, name: str) -> Course:
    """Settle roster, deadline and rule; one on the roster hands in nothing."""
    lines = [f"{1000 + k},{student},{101 + k}" for k, student in enumerate([*CLASS, "Zoe Absent"])]
    (place / "roster.csv").write_text("\n".join(["id,name,group", *lines]), "utf-8")
    (place / "course.toml").write_text(
        f'roster = "roster.csv"\n[deadlines]\n{name} = {DUE.isoformat()}\n'
        "[late]\ngrace = 15\nper_day = 10\nmost_days = 5\n"
        f'[extensions.{name}]\n"{CLASS[3]}" = 2026-11-30T12:00:00\n',
        "utf-8",
    )
    return read_course(place / "course.toml")


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def read_moodle(rows: Sequence[Mapping[str, str]]) -> dict[int, tuple[str, str]]:
    """Read the worksheet as Moodle does, by the number after its word for a participant.

    The grade and the maximum, by the place in the class.
    """
    assert {"Identifier", "Grade", "Last modified (grade)"} <= rows[0].keys()
    return {
        int(row["Identifier"].removeprefix("Participant ")) - 5000: (
            row["Grade"],
            row["Maximum Grade"],
        )
        for row in rows
    }


def taken_by_moodle(archive: Path) -> dict[int, str]:
    """Read an archive of feedback as Moodle does: the participant's number, and the file.

    Of the parts of a path the first counts that is made of a name, a number, the kind of a plugin
    and its name, with underscores between.
    """
    taken: dict[int, str] = {}
    with zipfile.ZipFile(archive) as packed:
        for path in packed.namelist():
            for k, part in enumerate(parts := path.split("/")):
                info = part.split("_", 4)
                if len(info) >= 4 and info[1].isdecimal() and info[2:4] == MOODLES:
                    taken[int(info[1]) - 5000] = "/".join([*info[4:], *parts[k + 1 :]]).strip("/")
                    break
    return taken


MOODLES = ["assignsubmission", "file"]


def taken_by_canvas(archive: Path) -> dict[int, tuple[int, str]]:
    """Read it as Canvas does: the first two numbers of a file's name are student and attachment."""
    taken = {}
    with zipfile.ZipFile(archive) as packed:
        for path in packed.namelist():
            name = path.rpartition("/")[2]
            student, attachment = [p for p in name.split("_") if p.isdecimal()][:2]
            taken[int(student) - 1000] = int(attachment) - 90100, name.rpartition(".")[2]
    return taken


def read_canvas(rows: Sequence[Mapping[str, str]], name: str) -> dict[int, tuple[str, str]]:
    """Read the gradebook as Canvas does: five columns, the points possible, a line for each."""
    assert list(rows[0])[:5] == ["Student", "ID", "SIS User ID", "SIS Login ID", "Section"]
    assert rows[0]["Student"].strip() == "Points Possible"
    return {int(row["ID"]) - 1000: (row[name], rows[0][name]) for row in rows[1:]}
