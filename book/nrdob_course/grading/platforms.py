"""How learning platforms hand over what students handed in: names of files and folders, archives.

Moodle gives a folder for each student, ``Anna Müller_12345_assignsubmission_file_``, or a file that
begins so; Canvas a file, ``muelleranna_LATE_12345_67890_set1.ipynb``, with ``-1`` before the dot if
it was handed in again. Both come as one zip, which is unpacked as if it came from anywhere.
"""

import re
import shutil
import time
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from os import utime
from pathlib import Path, PurePosixPath

__all__ = ["NOTE", "Owner", "owner_of", "pack", "packed", "unpacked"]

MOODLE = re.compile(
    r"(?P<name>.+)_(?P<identifier>\d+)_assignsubmission_(?P<kind>[a-z]+)(?:_(?P<file>.*))?$"
)
CANVAS = re.compile(
    r"(?P<name>[^_]+)_(?P<late>LATE_)?(?P<identifier>\d+)_(?P<number>\d+)_(?P<file>.+)$", re.DOTALL
)
AGAIN = re.compile(r"-(\d+)(?=(\.\w+)*$)")
NOTE = "timestamp.txt"  # of nbgrader, which has collected a file; elsewhere a student's own

MOST_BYTES, MOST_FILES = 2_000_000_000, 20_000  # of all that an archive unpacks to
ONE_FILE = 200_000_000


@dataclass(frozen=True)
class Owner:
    """Whose a file is, as the platform says it in its name."""

    student: str
    platform: str = ""  # "moodle" or "canvas"
    identifier: str = ""
    late: bool = False  # says Canvas
    turn: tuple[int, int] = (0, 0)  # grows each time that the same file is handed in
    text: bool = False  # typed into the platform
    back: str = ""  # where feedback goes: Moodle's folder, or how the file's name begins in Canvas


def owner_of(name: str) -> tuple[Owner, str] | None:
    """Read the name of a file or folder; None if no platform gave it. The second is what it was.

    >>> owner_of("Anna Müller_12345_assignsubmission_file_")[0].student
    'Anna Müller'
    >>> owner, file = owner_of("muelleranna_LATE_12345_67890_set1-2.ipynb")
    >>> owner.student, owner.late, owner.turn, file
    ('muelleranna', True, (67890, 2), 'set1.ipynb')
    >>> owner_of("anna_set1.ipynb") is None
    True
    """
    if match := MOODLE.match(name):
        student, file = match["name"], match["file"] or ""
        if student.casefold() in ("participant", "teilnehmer", "participante"):  # marked blindly
            student = f"{student} {match['identifier']}"
        text, back = match["kind"] == "onlinetext", name.removesuffix(file).rstrip("_") + "_"
        return Owner(student, "moodle", match["identifier"], text=text, back=back), file
    if match := CANVAS.match(name):
        again = AGAIN.search(match["file"])
        turn = (int(match["number"]), int(again[1]) if again else 0)
        known = match["name"], "canvas", match["identifier"], bool(match["late"]), turn
        return Owner(*known, back=PurePosixPath(name).stem), AGAIN.sub("", match["file"])
    return None


def packed(given: Path) -> bool:
    """Tell whether there is an archive to unpack."""
    return given.is_file() or any(given.rglob("*.[zZ][iI][pP]"))


def unpacked(given: Path, place: Path) -> Iterator[str]:
    """Copy what was given into an empty folder, archives unpacked; say what was left out.

    A zip that is no student's is taken as an export: what is in it lies beside the others.
    """
    listed = [given] if given.is_file() else sorted(given.iterdir())
    # Archives come last, so that nothing of one is in the way of what lies beside it.
    for path in sorted(listed, key=lambda path: path.suffix.lower() == ".zip"):
        if path.name.startswith((".", "__")):
            continue
        if path.is_symlink() and path != given:  # not followed: `find` says so
            shutil.copy2(path, place, follow_symlinks=False)
        elif path.is_dir():
            shutil.copytree(path, place / path.name, symlinks=True, dirs_exist_ok=True)
        elif path.suffix.lower() == ".zip":
            students = _is_students(path)
            left_out = list(_unzip(path, place / path.stem if students else place, students))
            if left_out and left_out[0].startswith(PACKED.format(path.name)):
                shutil.copy2(path, place)
            yield from left_out
        else:
            shutil.copy2(path, place)
    inner = [*place.glob("*/**/*.[zZ][iI][pP]"), *place.glob("*.[zZ][iI][pP]")]
    for path in sorted(path for path in inner if not path.is_symlink()):  # packed by students
        if path.parent == place and not owner_of(path.name):
            continue
        left_out = list(_unzip(path, path.with_suffix(""), students=True))
        packed_still = left_out and left_out[0].startswith(PACKED.format(path.name))
        if not packed_still:
            path.unlink()
        if not (packed_still and path.parent == place):  # that has been said
            where = path.parent.relative_to(place).as_posix()
            yield from (text if where == "." else f"{where}/{text}" for text in left_out)


def _is_students(archive: Path) -> bool:
    """Tell whether a student has packed it: its name says whose it is, or none within does."""
    names = [archive.name]
    with suppress(*BROKEN), zipfile.ZipFile(archive) as packed:
        names += [n for n in packed.namelist() if ".ipynb" in n.lower() and n[0] not in "._"]
    said = [name for name in names if owner_of(name) or STUDENTS.search(name)]
    return archive.name in said or (not said and len(names) > 1)


STUDENTS = re.compile(r"._set[\s_-]*\d|[/\\]", re.IGNORECASE)
PACKED = "{} was not unpacked: "
BROKEN = (ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error, RuntimeError)
"""What a broken archive leads to; NotImplementedError is a RuntimeError."""


def _unzip(archive: Path, place: Path, students: bool) -> Iterator[str]:
    """Unpack an archive, but for what cannot be trusted or read in it; say what was left out.

    What a student has packed was handed in when the archive was, whatever the times in it are.
    Where a file is left out an empty one stands, so that its owner is not forgotten.
    """
    moment = archive.stat().st_mtime if students else None
    try:
        with zipfile.ZipFile(archive) as packed:
            entries = [entry for entry in packed.infolist() if not entry.is_dir()]
            if len(entries) > MOST_FILES or sum(e.file_size for e in entries) > MOST_BYTES:
                raise ValueError("it holds too much")
            for entry in entries:
                told = f"{archive.name}: {entry.filename!r} was left out: "
                path = PurePosixPath(entry.filename.replace("\\", "/"))
                if path.is_absolute() or ".." in path.parts or ":" in f"{path}".partition("/")[0]:
                    yield f"{told}it leads out of the archive"
                    continue
                try:
                    if students and path.name.lower() == NOTE:
                        raise ValueError("the time of the archive counts")
                    if (place / path).exists():
                        raise ValueError("one of this name was there before")
                    steps = (place, *(place / step for step in (path, *path.parents)))
                    if any(step.is_symlink() for step in steps):
                        raise ValueError("a link stands in its way")
                    _extract(packed, entry, place / path, moment)
                except BROKEN as error:
                    yield f"{told}{error}"
    except BROKEN as error:
        yield f"{PACKED.format(archive.name)}{error}"


def _extract(
    packed: zipfile.ZipFile, entry: zipfile.ZipInfo, target: Path, moment: float | None
) -> None:
    """Write one file, with this time or its own; no more of it than the archive promised."""
    target.parent.mkdir(parents=True, exist_ok=True)
    target.touch()
    try:
        if entry.external_attr >> 16 & 0o170000 == 0o120000:
            raise ValueError("it is a link")
        if entry.file_size > ONE_FILE:
            raise ValueError("it is too large")
        left = entry.file_size
        with packed.open(entry) as source, target.open("wb") as file:
            while chunk := source.read(1 << 20):
                left -= len(chunk)
                if left < 0:
                    raise ValueError("it is larger than it says")
                file.write(chunk)
    except BROKEN:
        target.write_bytes(b"")
        raise
    with suppress(ValueError, OverflowError):  # a date that there never was
        moment = time.mktime((*entry.date_time, 0, 0, -1)) if moment is None else moment
        utime(target, (moment, moment))


def pack(path: Path, files: Mapping[str, Path]) -> None:
    """Write an archive of files, each under a name; the same files give the same bytes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, file in sorted(files.items()):
            entry = zipfile.ZipInfo(name)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            packed.writestr(entry, file.read_bytes())
