"""The folder that a kernel writes: end the kernel that fills it, and take it away afterwards.

No limit of the system adds up what a process has written.
"""

import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import psutil

__all__ = ["MOST_BYTES", "MOST_FILES", "used", "watched", "workdir"]

MOST_BYTES, MOST_FILES = 100 << 20, 2000
INTERVAL = 0.25
GONE = (FileNotFoundError, NotADirectoryError)  # while it was looked at


@contextmanager
def workdir() -> Iterator[Path]:
    """Make a folder, and remove it with whatever is in it then."""
    folder = Path(tempfile.mkdtemp())
    try:
        yield folder
    finally:
        with suppress(OSError):  # else the system's, to be cleaned with its temporary folders
            _empty(folder)
            folder.rmdir()


def _empty(folder: Path) -> None:
    """Remove what is in a folder; one that is too deep for a path is moved up level by level."""
    while folders := [each for each in os.scandir(folder) if not _removed(each)]:
        for each in folders:
            os.chmod(each.path, 0o700)
            for inner in list(os.scandir(each.path)):
                if not _removed(inner):
                    os.rename(inner.path, folder / os.urandom(16).hex())
            os.rmdir(each.path)


def _removed(entry: os.DirEntry[str]) -> bool:
    """Remove what is no folder."""
    if entry.is_dir(follow_symlinks=False):
        return False
    os.unlink(entry.path)
    return True


@contextmanager
def watched(workdir: Path, kernel: Callable[[], int | None]) -> Iterator[Event]:
    """Watch a folder while a kernel runs; the event tells that it was ended for what it wrote."""
    full, done = Event(), Event()

    def watch() -> None:
        while not done.wait(INTERVAL):
            pid = kernel()
            count, size = used(workdir, pid)
            if pid and (count > MOST_FILES or size > MOST_BYTES):
                full.set()
                with suppress(psutil.NoSuchProcess):
                    psutil.Process(pid).kill()

    thread = Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield full
    finally:
        done.set()
        thread.join()


def used(workdir: Path, pid: int | None) -> tuple[int, int]:
    """Count the files below a folder and their bytes, with those deleted that are still open.

    What cannot be looked into, for it is locked or its path is too long, counts as too much.
    """
    count = size = 0
    folders = [str(workdir)]
    while folders and count <= MOST_FILES:
        try:
            entries = list(os.scandir(folders.pop()))
        except GONE:
            continue
        except OSError:
            return MOST_FILES + 1, size
        for entry in entries:
            count += 1
            try:
                found = entry.stat(follow_symlinks=False)
            except GONE:
                continue
            except OSError:
                return MOST_FILES + 1, size
            size += getattr(found, "st_blocks", 0) * 512 or found.st_size
            if stat.S_ISDIR(found.st_mode):
                folders.append(entry.path)
    return count, size + sum(_deleted(pid))


def _deleted(pid: int | None) -> Iterator[int]:
    """Give the bytes of each file that a process holds open and has deleted; on Linux."""
    try:
        files = list(os.scandir(f"/proc/{pid}/fd"))
    except OSError:
        return
    for file in files:
        with suppress(OSError):  # it is closed meanwhile
            found = os.stat(file.path)
            if stat.S_ISREG(found.st_mode) and not found.st_nlink:
                yield found.st_blocks * 512
