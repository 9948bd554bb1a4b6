"""Refuse, for ever, the system calls that a student's code has no use for.

A filter of Linux (seccomp), which asks for no rights: whatever the files and the network have to do
with, see `sandbox`, a process that has sealed itself starts no other one, opens no socket, signals
and measures nobody but itself, locks no file, and changes no file's permissions, owner or times.
Refused is what is named here; each with the error EPERM.
"""

import ctypes
import os
import platform
import struct
import sys
import tomllib
from pathlib import Path

__all__ = ["ARCHITECTURES", "available", "program", "seal"]

ARCHITECTURES = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}

TABLES = tomllib.loads(Path(__file__).with_name("seccomp.toml").read_text("utf-8"))
REFUSED, OWN, IGNORED = (TABLES[name] for name in ("refused", "own", "ignored"))
"""Calls that are refused, that one may do to oneself only, and that seem to have been done."""

CLONE, SOCKETPAIR, FCNTL, IOCTL = (56, 220), (53, 199), (72, 25), (16, 29)
CLONE3 = 435
THREAD = 0x10000  # CLONE_THREAD
OWNERS = (8, 10, 15)  # F_SETOWN, F_SETSIG, F_SETOWN_EX: signals by way of a file
LOCKS = (5, 6, 7, 36, 37, 38, 1024)  # F_GETLK to F_SETLEASE: signals to whoever can read a file
CONTROLS = (0x8901, 0x8902, 0x5412, 0x541C, 0x40086602, 0x401C5820, 0x541D)
"""Owners of a socket, input into a terminal, flags of a file."""

ALLOW, KILL, NOTHING, EPERM, ENOSYS = 0x7FFF0000, 0x80000000, 0x50000, 0x50001, 0x50026
LOAD, EQUAL, AT_LEAST, ANY_BIT, MASK, RETURN = 0x20, 0x15, 0x35, 0x45, 0x54, 0x06
NO_NEW_PRIVILEGES, MODE_FILTER, ALL_THREADS = 38, 1, 1
SECCOMP = {"x86_64": 317, "aarch64": 277}

Step = tuple[int, int, int, int]


def available() -> bool:
    """Tell whether this system has such a filter."""
    if sys.platform != "linux" or platform.machine() not in ARCHITECTURES:
        return False
    libc = ctypes.CDLL(None, use_errno=True)
    return int(libc.prctl(21, 0, 0, 0, 0)) >= 0  # PR_GET_SECCOMP


def program(machine: str, pid: int) -> list[Step]:
    """Write the filter for a kind of processor and a process: code, jump if so, if not, value."""
    column = list(ARCHITECTURES).index(machine)

    def numbers(table: str) -> list[int]:
        rows = [row.split()[1:] for row in table.split(",")]
        return [int(row[column]) for row in rows if row[column] != "-"]

    steps: list[Step] = [(LOAD, 0, 0, 4), (EQUAL, 1, 0, ARCHITECTURES[machine])]
    steps += [(RETURN, 0, 0, KILL), (LOAD, 0, 0, 0)]
    if machine == "x86_64":  # the numbers of x32
        steps += [(AT_LEAST, 0, 1, 0x40000000), (RETURN, 0, 0, EPERM)]

    def when(number: int, *then: Step) -> None:
        steps.extend([(EQUAL, 0, len(then), number), *then])

    for number in numbers(REFUSED):
        when(number, (RETURN, 0, 0, EPERM))
    when(CLONE3, (RETURN, 0, 0, ENOSYS))  # its flags lie in memory; everybody falls back to clone
    yes, no = (RETURN, 0, 0, ALLOW), (RETURN, 0, 0, EPERM)
    when(CLONE[column], _argument(0), (ANY_BIT, 0, 1, THREAD), yes, no)
    unix, stream = (EQUAL, 0, 3, 1), (EQUAL, 1, 0, 1)  # datagrams could be sent anywhere
    when(SOCKETPAIR[column], _argument(0), unix, _argument(1), (MASK, 0, 0, 0xF), stream, no, yes)
    for table, answer in ((OWN, no), (IGNORED, (RETURN, 0, 0, NOTHING))):
        for number in numbers(table):
            when(number, _argument(0), (EQUAL, 1, 0, pid), (EQUAL, 0, 1, 0), yes, answer)
    for number, commands in ((FCNTL[column], OWNERS + LOCKS), (IOCTL[column], CONTROLS)):
        tests = [(EQUAL, len(commands) - k, 0, each) for k, each in enumerate(commands)]
        when(number, _argument(1), *tests, yes, no)
    return [*steps, yes]


def _argument(number: int) -> Step:
    """Load the lower half of an argument; all of those that are looked at are an int."""
    return (LOAD, 0, 0, 16 + 8 * number)


def seal() -> None:
    """Refuse all this to the process and all of its threads, where the system can."""
    if not available():
        return
    machine = platform.machine()
    steps = b"".join(struct.pack("HBBI", *step) for step in program(machine, os.getpid()))
    code = ctypes.create_string_buffer(steps, len(steps))
    filter = struct.pack("HxxxxxxP", len(steps) // 8, ctypes.addressof(code))
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    if libc.syscall(SECCOMP[machine], MODE_FILTER, ALL_THREADS, filter):
        raise OSError(ctypes.get_errno(), "the sandbox for students' code cannot be sealed")
