"""A wall around the process that runs a student's code, where the system can build one.

On Linux 6.2 and newer the process gives up, before any of the student's code runs and for ever,
every file but those that it needs (Landlock, which asks for no rights), and with them the
processes of others; from 6.7 on the network too, but for the channels of the notebook. Elsewhere
there is no wall, and `missing` says so. If it was started by root it becomes *nobody*, with a wall
or without; where it cannot, `stays_root` says so.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

__all__ = ["adopt_orphans", "build", "generation", "missing", "stays_root"]

NOBODY = 65534

PACKAGE = Path(__file__).resolve().parents[2]

# The numbers of Linux, the same on every processor: include/uapi/linux/landlock.h.
CREATE, ADD, RESTRICT = 444, 445, 446
READ = 0b1101  # execute, read a file, read a folder
FILE = 0b111 | 1 << 14  # what a rule for a single file may name: execute, write, read, truncate
PORT = 0b1  # bind
NO_NEW_PRIVILEGES, CHILD_SUBREAPER = 38, 36

TREES = (
    "/usr",
    "/lib",
    "/lib64",
    "/lib32",
    "/bin",
    "/opt",
    "/nix",
    "/gnu",
    "/etc/fonts",
    "/etc/ssl",
)
FILES = ("/etc/ld.so.cache", "/etc/localtime", "/etc/mime.types", "/dev/random", "/dev/urandom")
BOTH_WAYS = ("/dev/null", "/dev/zero", "/dev/full")


@cache
def generation() -> int:
    """Give the version of Landlock that this system has; 0 if it has none."""
    if sys.platform != "linux":
        return 0
    return max(0, _call(CREATE, None, 0, 1))


def missing() -> str:
    """Say why no wall can be built here; empty if it can."""
    if sys.platform != "linux":
        return f"there is no wall around students' code on {sys.platform}; there is one on Linux"
    if generation() < 3:
        return "there is no wall around students' code: it needs Linux 6.2 with Landlock"
    return ""


def _call(number: int, *arguments: object) -> int:
    return int(ctypes.CDLL(None, use_errno=True).syscall(number, *arguments))


def _checked(number: int, *arguments: object) -> int:
    result = _call(number, *arguments)
    if result < 0:
        raise OSError(ctypes.get_errno(), "the wall around students' code cannot be built")
    return result


def stays_root() -> str:
    """Say why a student's code would keep the rights of root; empty if it does not."""
    if os.name != "posix" or os.getuid() != 0:
        return ""
    if sys.platform != "linux":
        return f"you are root, and on {sys.platform} students' code would be root, too"
    for place in (Path(sys.prefix), Path(sys.base_prefix), PACKAGE):
        if not _open_to_all(place):
            return f"you are root, and students' code would be, too: not everybody can read {place}"
    return ""


def build(desk: Path, ports: Iterable[int]) -> None:
    """Leave this process, for ever, its libraries to read and one folder to write.

    It must have one thread yet. What this system cannot do is left out, see `missing` and
    `stays_root`.
    """
    ruleset = None if missing() else _rules(desk, ports)
    if ruleset is not None:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0):
            raise OSError(ctypes.get_errno(), "the wall around students' code cannot be built")
    if os.name == "posix" and os.getuid() == 0 and not stays_root():
        _become_nobody(desk)
    if ruleset is not None:
        _checked(RESTRICT, ruleset, 0)
        os.close(ruleset)


def _rules(desk: Path, ports: Iterable[int]) -> int:
    """Make the rules of the wall; they are opened while everything can still be."""
    number = generation()
    everything = (1 << {3: 15, 4: 15}.get(number, 16)) - 1
    network = 0b11 if number >= 4 else 0
    scoped = 0b11 if number >= 6 else 0
    rules = struct.pack("QQQ", everything, network, scoped)
    size = 24 if number >= 6 else 16 if number >= 4 else 8
    ruleset = _checked(CREATE, rules[:size], size, 0)
    # What is imported later must still be found.
    libraries = [Path(path) for path in sys.path if "-packages" in path or "python3" in path]
    for name in (sys.prefix, sys.base_prefix, *TREES, *FILES):
        _allow(ruleset, Path(name), READ)
    for path in (PACKAGE, *libraries):
        _allow(ruleset, path, READ)
    for name in BOTH_WAYS:
        _allow(ruleset, Path(name), READ | 0b10)
    _allow(ruleset, desk, everything)
    for port in ports if network else ():
        _checked(ADD, ruleset, 2, struct.pack("QQ", PORT, port), 0)
    return ruleset


def adopt_orphans() -> None:
    """Let what a student's code leaves running become a child of this process, to be ended."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(CHILD_SUBREAPER, 1, 0, 0, 0)


def _allow(ruleset: int, path: Path, rights: int) -> None:
    try:
        place = os.open(path, os.O_PATH | os.O_CLOEXEC)  # type: ignore[attr-defined, unused-ignore]
    except OSError:  # there is none on this system
        return
    if not path.is_dir():
        rights &= FILE
    try:
        _checked(ADD, ruleset, 1, struct.pack("=Qi", rights, place), 0)
    finally:
        os.close(place)


def _open_to_all(path: Path) -> bool:
    """Tell whether any user can read there."""
    return all(each.stat().st_mode & 0o005 == 0o005 for each in [path, *path.parents])


def _become_nobody(desk: Path) -> None:
    for path in [desk, *desk.rglob("*")]:
        os.chown(path, NOBODY, NOBODY)
    os.setgroups([])
    os.setgid(NOBODY)
    os.setuid(NOBODY)
