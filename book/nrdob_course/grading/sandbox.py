"""A sandbox for the process that runs a student's code, where the system can build one.

On Linux 6.2 and newer the process gives up, before any of the student's code runs and for ever,
every file but those that it needs (Landlock, which asks for no rights). On every Linux it is then
sealed, see `seccomp`: no network, no other process, no permissions. Elsewhere there is no sandbox,
and `missing` says so. If it was started by root it becomes *nobody*, with a sandbox or without;
where it cannot, `stays_root` says so, and it keeps the user but none of the rights of root.
"""

import ctypes
import os
import struct
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

import nrdob

from . import seccomp
from .seccomp import seal

__all__ = [
    "adopt_orphans", "build", "generation", "is_root", "limit", "missing", "readable", "seal",
    "shared_libraries", "stays_root",
]  # fmt: skip

NOBODY = 65534

COURSE = Path(__file__).resolve().parents[1]  # the graders, which no student's code may read
PACKAGE = Path(nrdob.__file__).resolve().parent

# The numbers of Linux, the same on every processor: include/uapi/linux/landlock.h.
CREATE, ADD, RESTRICT = 444, 445, 446
LIST, READ, WRITE, TRUNCATE = 0b1000, 0b1100, 0b10, 1 << 14
EXECUTE, DEVICES, CONTROL = 0b1, 1 << 6 | 1 << 9 | 1 << 11, 1 << 15
FILE = EXECUTE | WRITE | 0b100 | TRUNCATE  # what a rule for a single file may name
PORT = 0b1  # bind
NO_NEW_PRIVILEGES, CHILD_SUBREAPER, DROP_FROM_BOUNDS = 38, 36, 24

DATA = (
    "/usr/share/fonts", "/usr/share/zoneinfo", "/usr/lib/locale", "/etc/fonts", "/etc/ld.so.cache",
    "/etc/localtime", "/etc/mime.types", "/dev/random", "/dev/urandom",
)  # fmt: skip
BOTH_WAYS = ("/dev/null", "/dev/zero", "/dev/full")

MEMORY = 5 << 28  # bytes, 1.25 GiB, that a process may use besides what its libraries take
FILE_SIZE, FILES = 20 << 20, 256


@cache
def generation() -> int:
    """Give the version of Landlock that this system has; 0 if it has none."""
    if sys.platform != "linux":
        return 0
    return max(0, _call(CREATE, None, 0, 1))


def missing() -> str:
    """Say why no sandbox can be built here; empty if it can."""
    if sys.platform != "linux":
        return f"there is no sandbox for students' code on {sys.platform}; there is one on Linux"
    if generation() < 3:
        return "there is no sandbox for students' code: it needs Linux 6.2 with Landlock"
    if not seccomp.available():
        return "there is no sandbox for students' code: this Linux has no filter of system calls"
    return ""


def _call(number: int, *arguments: object) -> int:
    return int(ctypes.CDLL(None, use_errno=True).syscall(number, *arguments))


def _checked(result: int) -> int:
    if result < 0:
        raise OSError(ctypes.get_errno(), "the sandbox for students' code cannot be built")
    return result


def is_root() -> bool:
    """Tell whether this is run by root."""
    return os.name == "posix" and os.geteuid() == 0


def stays_root() -> str:
    """Say why a student's code would keep the user root; empty if it does not."""
    if not is_root():
        return ""
    if sys.platform != "linux":
        return f"you are root, and on {sys.platform} students' code would be root, too"
    for place in (Path(sys.prefix), Path(sys.base_prefix), PACKAGE):
        if any(each.stat().st_mode & 0o005 != 0o005 for each in [place, *place.parents]):
            return f"you are root, and students' code would be, too: not everybody can read {place}"
    return ""


def build(workdir: Path, ports: Iterable[int]) -> None:
    """Leave this process, for ever, its libraries to read and one folder to write.

    It must have one thread yet, and still has to `seal` itself when its sockets are open. What
    this system cannot do is left out, see `missing` and `stays_root`.
    """
    ruleset = None if missing() else _rules(workdir, ports)
    if sys.platform == "linux":
        _checked(ctypes.CDLL(None, use_errno=True).prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0))
    if is_root():
        if not stays_root():
            _become_nobody(workdir)
        elif sys.platform == "linux":
            _drop_rights()
    if ruleset is not None:
        _checked(_call(RESTRICT, ruleset, 0))
        os.close(ruleset)


def limit(memory: int = MEMORY, file_size: int = FILE_SIZE) -> None:
    """Limit what this process takes of the machine, where that is possible."""
    try:
        import resource
    except ImportError:  # Windows
        return
    import psutil

    limits = {"FSIZE": file_size, "NOFILE": FILES, "CORE": 0, "MSGQUEUE": 0, "MEMLOCK": 0}
    limits["AS"] = psutil.Process().memory_info().vms + memory
    for name, most in limits.items():
        with suppress(AttributeError, ValueError, OSError):
            resource.setrlimit(getattr(resource, f"RLIMIT_{name}"), (most, most))


def readable() -> list[Path]:
    """List what the interpreter needs: its library, its packages, the shared libraries, data.

    The graders are left out; where nrdob or they are not installed but stand in a project, so is
    all of the project but nrdob.
    """
    closed = {COURSE}
    for project, package in ((PACKAGE.parent, PACKAGE), (COURSE.parents[1], COURSE)):
        if not _is_library(package.parent):
            closed.add(project)
    paths = [Path(path) for path in (*sysconfig.get_paths().values(), *sys.path)]
    standard = {Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib")}
    needed = {path for path in paths if path in standard or _is_library(path)}
    needed |= {path for path in paths if path.suffix == ".zip"}
    needed |= {*map(Path, DATA), *shared_libraries()}
    parts = [part for path in sorted(needed) for part in _around(path.resolve(), closed)]
    return [*parts, *_around(PACKAGE, {COURSE})]


def _is_library(path: Path) -> bool:
    return path.name in ("site-packages", "dist-packages")


def shared_libraries() -> set[Path]:
    """Give the folders of the shared libraries that this process has loaded."""
    try:
        lines = Path("/proc/self/maps").read_text("utf-8").splitlines()
    except OSError:
        return set()
    files = {Path(line.split(maxsplit=5)[5]) for line in lines if ".so" in line.split("/")[-1]}
    return {file.parent for file in files if file.is_absolute()}


def _around(path: Path, closed: set[Path]) -> Iterator[Path]:
    """Give the parts of a tree that hold nothing of what is closed."""
    if path in closed:
        return
    if not any(path in each.parents for each in closed):
        yield path
        return
    for child in path.iterdir():
        yield from _around(child.resolve(), closed)


def _rules(workdir: Path, ports: Iterable[int]) -> int:
    """Make the rules of the sandbox; they are opened while everything can still be."""
    number = generation()
    everything = (1 << {3: 15, 4: 15}.get(number, 16)) - 1
    network = 0b11 if number >= 4 else 0
    scoped = 0b11 if number >= 6 else 0
    rules = struct.pack("QQQ", everything, network, scoped)
    size = 24 if number >= 6 else 16 if number >= 4 else 8
    ruleset = _checked(_call(CREATE, rules[:size], size, 0))
    # What is imported later must still be found, so folders can be listed that were taken apart.
    for path in {PACKAGE, *(Path(path) for path in sys.path if _is_library(Path(path)))}:
        _allow(ruleset, path, LIST)
    for path in readable():
        _allow(ruleset, path, READ)
    for name in BOTH_WAYS:
        _allow(ruleset, Path(name), READ | WRITE)
    _allow(ruleset, workdir, everything & ~(EXECUTE | DEVICES | CONTROL))
    for port in ports if network else ():
        _checked(_call(ADD, ruleset, 2, struct.pack("QQ", PORT, port), 0))
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
        _checked(_call(ADD, ruleset, 1, struct.pack("=Qi", rights, place), 0))
    finally:
        os.close(place)


def _drop_rights() -> None:
    """Give up what root may and others may not; what root owns stays open."""
    libc = ctypes.CDLL(None, use_errno=True)
    for right in range(64):
        libc.prctl(DROP_FROM_BOUNDS, right, 0, 0, 0)
    _checked(libc.capset(struct.pack("Ii", 0x20080522, 0), bytes(24)))


def _become_nobody(workdir: Path) -> None:
    for path in [workdir, *workdir.rglob("*")]:
        os.chown(path, NOBODY, NOBODY)
    os.setgroups([])
    os.setgid(NOBODY)
    os.setuid(NOBODY)
