"""Processes that take an order in each line of their input, and answer it in a line: JSON both."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from typing import Any

import psutil

__all__ = ["Child", "end", "serve"]


class Child:
    """Such a process, as the one sees it that has started it: Python runs a module that serves."""

    def __init__(self, module: str, **how: Any) -> None:
        self.module = module
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            encoding="utf-8",
            **how,
        )

    def ask(self, order: Mapping[str, Any]) -> Any:
        """Give an order, and take the answer; OSError if the process has ended."""
        assert self.process.stdin and self.process.stdout
        self.process.stdin.write(json.dumps(order) + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise OSError(f"{self.module} has ended")
        return json.loads(answer)

    def close(self) -> None:
        """End it, and all that it has started."""
        end(self.process.pid)
        with self.process:  # its pipes are closed, and its end is waited for
            pass


def serve(answer: Callable[[dict[str, Any]], Any]) -> None:
    """Answer orders until there are no more."""
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), flush=True)


def end(pid: int, itself: bool = True) -> None:
    """End all that a process started, and itself: a kernel may be deaf to everything else."""
    try:
        process = psutil.Process(pid)
        family = process.children(recursive=True) + ([process] if itself else [])
    except psutil.NoSuchProcess:
        return
    for member in family:
        try:
            member.kill()
        except psutil.NoSuchProcess:
            continue
