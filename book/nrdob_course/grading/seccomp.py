"""Refuse, for ever, the system calls that a student's code has no use for.

A filter of Linux (seccomp), which asks for no rights: whatever the files and the network have to do
with, see `wall`, a process that has sealed itself starts no other one, opens no socket, signals and
measures nobody but itself, and changes no file's permissions, owner or times. Refused is what is
named here; each with the error EPERM.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct
import sys

__all__ = ["ARCHITECTURES", "available", "program", "seal"]

ARCHITECTURES = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}

REFUSED = """
    fork 57 -, vfork 58 -, execve 59 221, execveat 322 281, unshare 272 97, setns 308 268,
    socket 41 198, bind 49 200, connect 42 203, listen 50 201,
    tkill 200 130, pidfd_open 434 434, pidfd_send_signal 424 424, pidfd_getfd 438 438,
    ptrace 101 117, process_vm_readv 310 270, process_vm_writev 311 271, process_madvise 440 440,
    process_mrelease 448 448, kcmp 312 272, setpriority 141 140, ioprio_set 251 30,
    migrate_pages 256 238, move_pages 279 239,
    add_key 248 217, request_key 249 218, keyctl 250 219,
    perf_event_open 298 241, bpf 321 280, userfaultfd 323 282,
    io_uring_setup 425 425, io_uring_enter 426 426, io_uring_register 427 427, io_setup 206 0,
    mount 165 40, umount2 166 39, pivot_root 155 41, chroot 161 51, open_tree 428 428,
    move_mount 429 429, fsopen 430 430, fsconfig 431 431, fsmount 432 432, fspick 433 433,
    mount_setattr 442 442, open_tree_attr 467 467,
    name_to_handle_at 303 264, open_by_handle_at 304 265, mknod 133 -, mknodat 259 33,
    chmod 90 -, fchmod 91 52, fchmodat 268 53, fchmodat2 452 452, chown 92 -, lchown 94 -,
    fchown 93 55, fchownat 260 54, utime 132 -, utimes 235 -, futimesat 261 -, utimensat 280 88,
    setxattr 188 5, lsetxattr 189 6, fsetxattr 190 7, removexattr 197 14, lremovexattr 198 15,
    fremovexattr 199 16, setxattrat 463 463, removexattrat 466 466, file_setattr 469 469,
    inotify_init 253 -, inotify_init1 294 26, fanotify_init 300 262,
    memfd_create 319 279, memfd_secret 447 447, shmget 29 194, shmat 30 196, shmctl 31 195,
    semget 64 190, semctl 66 191, msgget 68 186, msgctl 71 187, mq_open 240 180, mq_unlink 241 181,
    reboot 169 142, swapon 167 224, swapoff 168 225, init_module 175 105, finit_module 313 273,
    delete_module 176 106, kexec_load 246 104, kexec_file_load 320 294, iopl 172 -, ioperm 173 -,
    settimeofday 164 170, clock_settime 227 112, adjtimex 159 171, clock_adjtime 305 266,
    sethostname 170 161, setdomainname 171 162, syslog 103 116, acct 163 89, quotactl 179 60,
    quotactl_fd 443 443, vhangup 153 58, personality 135 92, modify_ldt 154 -
"""
"""Name, and number on x86_64 and on aarch64: what is refused, whatever its arguments are."""

OWN = """
    kill 62 129, tgkill 234 131, rt_sigqueueinfo 129 138, rt_tgsigqueueinfo 297 240,
    prlimit64 302 261
"""
"""What a process may do to itself only; the first argument says to whom."""

IGNORED = """
    sched_setaffinity 203 122, sched_setscheduler 144 119, sched_setparam 142 118,
    sched_setattr 314 274
"""
"""What it believes to have done to others: the threads of ZeroMQ end the process if it fails."""

CLONE, SOCKETPAIR, FCNTL, IOCTL = (56, 220), (53, 199), (72, 25), (16, 29)
CLONE3 = 435
THREAD = 0x10000  # CLONE_THREAD
OWNERS = (8, 10, 15)  # F_SETOWN, F_SETSIG, F_SETOWN_EX: signals by way of a file
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
    for number, commands in ((FCNTL[column], OWNERS), (IOCTL[column], CONTROLS)):
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
        raise OSError(ctypes.get_errno(), "the wall around students' code cannot be sealed")
