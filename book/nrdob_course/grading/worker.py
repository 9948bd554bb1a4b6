"""A process that has read its libraries, and grades one submission after the other in a fork of it.

    python -P -m nrdob_course.grading.worker

It takes an order in each line of its input, ``{"root": …, "student": …, "set": …, "source": …}``,
and answers each with the exit code. Reading the libraries takes longer than grading, and so does
drawing the cases of the hidden tests, which are everybody's: it draws them before the fork.
"""

from __future__ import annotations

import os
import subprocess
import sys
import traceback
from pathlib import Path

import nbformat

from ..exercises import PROBLEMS
from . import autograde
from .children import Child, end, serve
from .judge import hidden_test

__all__ = ["draw", "main", "run"]

CASES = 8  # as many as a hidden test draws; others are drawn when they are asked for


def draw(source: str) -> None:
    """Draw the cases of a set's hidden tests; they stay known."""
    if not source:
        return
    for cell in nbformat.read(source, as_version=4).cells:
        test = hidden_test(cell.source) if autograde.is_test(cell) else None
        if test and test.problem in PROBLEMS and not PROBLEMS[test.problem].own:
            PROBLEMS[test.problem].cases(test.settings.get("seed"), CASES)


def ready() -> None:
    """Start what starts kernels, where a process can be copied safely, or start it again."""
    servers = autograde.FORK_SERVERS
    if sys.platform == "linux" and not (servers and servers[-1].process.poll() is None):
        servers.append(Child(autograde.KERNEL))


def run(root: str, student: str, name: str) -> int:
    """Grade one submission in a process of its own; its exit code, as `subprocess` has it."""
    log = Path(root) / "log.txt"
    ready()
    arguments = [root, student, name]
    if not hasattr(os, "fork"):  # Windows
        with log.open("wb") as output:
            command = [sys.executable, "-P", "-m", autograde.__name__, *arguments]
            return subprocess.call(command, cwd=root, stdout=output, stderr=output)
    child = os.fork()
    if not child:
        code = 1
        try:
            for number, mode in ((0, os.O_RDONLY), (1, os.O_WRONLY), (2, os.O_WRONLY)):
                path = log if number else os.devnull
                os.dup2(os.open(path, mode | (os.O_CREAT | os.O_APPEND if number else 0)), number)
            os.chdir(root)  # what a process can learn of its parents leads nowhere
            code = autograde.main(arguments)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stderr.flush()
            os._exit(code)
    _, status = os.waitpid(child, 0)
    for server in autograde.FORK_SERVERS:
        end(server.process.pid, itself=False)
    return os.waitstatus_to_exitcode(status)


def main() -> None:
    """Take orders until there are no more."""
    ready()  # it reads its libraries while the cases are drawn
    drawn: set[str] = set()

    def graded(order: dict[str, str]) -> int:
        if order["source"] not in drawn:
            draw(order["source"])
            drawn.add(order["source"])
        return run(order["root"], order["student"], order["set"])

    serve(graded)


if __name__ == "__main__":
    main()
