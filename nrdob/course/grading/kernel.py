"""The kernel in which a student's code runs, behind a wall.

    python -P -m nrdob.course.grading.kernel CONNECTION DESK

CONNECTION is Jupyter's file of ports; DESK the only folder that the code can write. What every
notebook imports is imported before the wall stands and the clock runs.
"""

from __future__ import annotations

import builtins
import json
import os
import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot  # noqa: F401
from ipykernel.kernelapp import IPKernelApp

from .. import exercises  # noqa: F401
from . import plain, wall  # noqa: F401

__all__ = ["leave", "limit", "main"]

MEMORY, FILE_SIZE = 4 << 30, 50 << 20


def leave(*code: Any) -> None:
    """End a cell: IPython's own would end the kernel a moment later, and nobody knew why."""
    raise SystemExit(*code)


def limit() -> None:
    """Limit memory and the size of a file, where that is possible."""
    try:
        import resource
    except ImportError:  # Windows
        return
    limits = {resource.RLIMIT_AS: MEMORY, resource.RLIMIT_FSIZE: FILE_SIZE}
    for kind, most in limits.items():
        try:
            resource.setrlimit(kind, (most, most))
        except (ValueError, OSError):
            continue


def main(arguments: list[str]) -> None:
    """Build the wall, then be a kernel like any other."""
    connection, desk = Path(arguments[0]), Path(arguments[1])
    os.chdir(desk)
    ports = json.loads(connection.read_text("utf-8"))
    wall.build(desk, [port for name, port in ports.items() if name.endswith("_port")])
    limit()
    builtins.exit = builtins.quit = leave  # type: ignore[assignment]
    app: Any = IPKernelApp.instance()
    app.initialize(["-f", str(connection), "--HistoryManager.enabled=False", "--log-level=ERROR"])
    app.shell.user_ns.update(exit=leave, quit=leave)
    app.start()


if __name__ == "__main__":
    main(sys.argv[1:])
