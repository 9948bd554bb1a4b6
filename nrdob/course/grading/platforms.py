"""How learning platforms hand over what students handed in: names of files and folders, archives.

Moodle gives a folder for each student, ``Anna Müller_12345_assignsubmission_file_``, or a file that
begins so; Canvas a file, ``muelleranna_LATE_12345_67890_set1.ipynb``, with ``-1`` before the dot if
it was handed in again. Both come as one zip, which is unpacked as if it came from anywhere.
"""

from __future__ import annotations

import re
import shutil
import time
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from os import utime
from pathlib import Path, PurePosixPath

__all__ = ["Owner", "owner_of", "packed", "unpacked"]

MOODLE = re.compile(
    r"(?P<name>.+)_(?P<identifier>\d+)_assignsubmission_(?P<kind>[a-z]+)(?:_(?P<file>.*))?$"
)
CANVAS = re.compile(
    r"(?P<name>[^_]+)_(?P<late>LATE_)?(?P<identifier>\d+)_(?P<number>\d+)_(?P<file>.+)$", re.DOTALL
)
AGAIN = re.compile(r"-(\d+)(?=(\.\w+)*$)")

MOST_BYTES, MOST_FILES = 2_000_000_000, 20_000
"""Of all that an archive unpacks to."""
ONE_FILE = 200_000_000


@dataclass(frozen=True)
class Owner:
    """Whose a file is, as the platform says it in its name.

    Attributes
    ----------
    student : str
        The name, or what stands for it.
    platform, identifier : str
        "moodle" or "canvas", and its number for the student; empty if it is neither.
    late : bool
        Whether Canvas calls it late.
    turn : tuple of int
        Grows with each time that the same file is handed in.
    text : bool
        Whether it is a text that was typed into the platform.
    """

    student: str
    platform: str = ""
    identifier: str = ""
    late: bool = False
    turn: tuple[int, int] = (0, 0)
    text: bool = False


def owner_of(name: str) -> tuple[Owner, str] | None:
    """Read the name of a file or folder; None if no platform gave it. The second is what it was.

    Examples
    --------
    >>> owner_of("Anna Müller_12345_assignsubmission_file_")[0].student
    'Anna Müller'
    >>> owner, file = owner_of("muelleranna_LATE_12345_67890_set1-2.ipynb")
    >>> owner.student, owner.late, owner.turn, file
    ('muelleranna', True, (67890, 2), 'set1.ipynb')
    >>> owner_of("anna_set1.ipynb") is None
    True
    """
    if match := MOODLE.match(name):
        student = match["name"]
        if student.casefold() in ("participant", "teilnehmer", "participante"):  # marked blindly
            student = f"{student} {match['identifier']}"
        text = match["kind"] == "onlinetext"
        return Owner(student, "moodle", match["identifier"], text=text), match["file"] or ""
    if match := CANVAS.match(name):
        again = AGAIN.search(match["file"])
        turn = (int(match["number"]), int(again[1]) if again else 0)
        owner = Owner(match["name"], "canvas", match["identifier"], bool(match["late"]), turn)
        return owner, AGAIN.sub("", match["file"])
    return None


def packed(given: Path) -> bool:
    """Tell whether there is an archive to unpack."""
    return given.is_file() or any(given.rglob("*.[zZ][iI][pP]"))


def unpacked(given: Path, place: Path) -> Iterator[str]:
    """Copy what was given into an empty folder, archives unpacked; say what was left out.

    A zip that is no student's is taken as an export: what is in it lies beside the others.
    """
    for path in [given] if given.is_file() else sorted(given.iterdir()):
        if path.name.startswith((".", "__")):
            continue
        if path.is_dir():
            shutil.copytree(path, place / path.name, symlinks=True, dirs_exist_ok=True)
        elif path.suffix.lower() == ".zip":
            students = bool(owner_of(path.name) or STUDENTS.search(path.stem))
            reason = _unzip(path, place / path.stem if students else place, students)
            if reason:
                shutil.copy2(path, place)
                yield reason
        else:
            shutil.copy2(path, place)
    for path in sorted(place.glob("*/**/*.[zZ][iI][pP]")):  # what students have packed themselves
        reason = _unzip(path, path.with_suffix(""), students=True)
        if reason:
            yield reason
        else:
            path.unlink()
    for path in sorted(place.glob("*.[zZ][iI][pP]")):
        if owner_of(path.name) and not _unzip(path, place / path.stem, students=True):
            path.unlink()


STUDENTS = re.compile(r"._set[\s_-]*\d", re.IGNORECASE)


def _unzip(archive: Path, place: Path, students: bool) -> str:
    """Unpack an archive that can be trusted; else give the reason why it was not.

    What a student has packed was handed in when the archive was, whatever the times in it are.
    """
    moment = archive.stat().st_mtime if students else None
    try:
        with zipfile.ZipFile(archive) as packed:
            entries = [entry for entry in packed.infolist() if not entry.is_dir()]
            for entry in entries:
                _must_be_safe(entry)
            if len(entries) > MOST_FILES or sum(e.file_size for e in entries) > MOST_BYTES:
                raise ValueError("it holds too much")
            for entry in entries:
                _extract(packed, entry, place, moment)
    except (ValueError, OSError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        return f"{archive.name} was not unpacked: {error}"
    return ""


def _must_be_safe(entry: zipfile.ZipInfo) -> None:
    path = PurePosixPath(entry.filename.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts or ":" in path.parts[0]:
        raise ValueError(f"{entry.filename!r} leads out of the archive")
    if entry.external_attr >> 16 & 0o170000 == 0o120000:
        raise ValueError(f"{entry.filename!r} is a link")
    if entry.file_size > ONE_FILE:
        raise ValueError(f"{entry.filename!r} is too large")


def _extract(
    packed: zipfile.ZipFile, entry: zipfile.ZipInfo, place: Path, moment: float | None
) -> None:
    """Write one file, with this time or its own; no more of it than the archive promised."""
    target = place / PurePosixPath(entry.filename.replace("\\", "/"))
    target.parent.mkdir(parents=True, exist_ok=True)
    left = entry.file_size
    with packed.open(entry) as source, target.open("wb") as file:
        while chunk := source.read(1 << 20):
            left -= len(chunk)
            if left < 0:
                raise ValueError(f"{entry.filename!r} is larger than it says")
            file.write(chunk)
    try:
        if moment is None:
            moment = time.mktime((*entry.date_time, 0, 0, -1))
        utime(target, (moment, moment))
    except (ValueError, OverflowError):  # a date that there never was
        pass
