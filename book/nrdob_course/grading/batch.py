"""Grade submissions two at a time, each in a process and a course of its own.

Whatever a student's code does, it gives an outcome: points, or the reason why there are none.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue
from threading import Timer

import psutil

import nrdob
import nrdob_course

from ..running import kernel_environment
from .submissions import Submission

__all__ = ["Batch", "Outcome", "end"]

NURSERY = f"{__package__}.nursery"
FOUND = [str(Path(module.__file__ or "").resolve().parents[1]) for module in (nrdob, nrdob_course)]
"""Where the packages were found, so that the graders find the same."""


@dataclass
class Outcome:
    """What came of one submission: points by cell, or the reason why there are none."""

    submission: Submission
    grades: dict[str, float | None] = field(default_factory=dict)
    comments: dict[str, str | None] = field(default_factory=dict)
    reason: str = ""
    seconds: float = 0.0


class Nursery:
    """A process that grades one submission after the other, see `nursery`."""

    def __init__(self) -> None:
        environment = kernel_environment()
        found = [*FOUND, os.getenv("PYTHONPATH")]
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, found))
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", NURSERY],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            encoding="utf-8",
            cwd=tempfile.gettempdir(),
            env=environment,
            start_new_session=True,  # Ctrl-C is for the batch, which then ends this one
        )
        self.late = False

    def run(self, order: dict[str, str], limit: float) -> int | None:
        """Grade one, and give the exit code; None if it took too long."""
        assert self.process.stdin and self.process.stdout
        self.late = False
        timer = Timer(limit, self.stop)
        timer.start()
        try:
            self.process.stdin.write(json.dumps(order) + "\n")
            self.process.stdin.flush()
            answer = self.process.stdout.readline()
        finally:
            timer.cancel()
        if not answer:
            raise OSError("the grader ended")
        return None if self.late else int(answer)

    def stop(self) -> None:
        """End what it is grading."""
        self.late = True
        end(self.process.pid, itself=False)

    def close(self) -> None:
        """End it."""
        end(self.process.pid)
        with self.process:  # its pipes are closed, and its end is waited for
            pass


class Batch:
    """Grades the submissions that lie in a course's folder."""

    def __init__(self, root: Path, jobs: int, limit: float) -> None:
        self.root, self.jobs, self.limit = root.resolve(), jobs, limit
        self.idle: SimpleQueue[Nursery] = SimpleQueue()
        self.nurseries: list[Nursery] = []

    def grade(self, submissions: list[tuple[str, Submission]]) -> Iterator[Outcome]:
        """Grade all, each given with the name of its folder; outcomes come as they are ready."""
        pool = ThreadPoolExecutor(self.jobs)
        try:
            for _ in range(min(self.jobs, len(submissions))):
                self.open_nursery()
            futures = [pool.submit(self.grade_one, *submission) for submission in submissions]
            for future in as_completed(futures):
                yield future.result()
        finally:  # after an interrupt, too
            pool.shutdown(wait=False, cancel_futures=True)
            for nursery in self.nurseries:
                nursery.close()

    def open_nursery(self) -> None:
        """Start one more process that grades."""
        self.nurseries.append(Nursery())
        self.idle.put(self.nurseries[-1])

    def grade_one(self, student: str, submission: Submission) -> Outcome:
        """Grade one, in a copy of the course.

        So two can be graded at a time (sqlite is not made for two who write), and neither the real
        gradebook nor a solution is anywhere near.
        """
        start = time.perf_counter()
        outcome = Outcome(submission)
        work = Path(student) / submission.set
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            private = Path(folder)
            try:
                for file in ("gradebook.db", "nbgrader_config.py"):
                    shutil.copy(self.root / file, private)
                solutions = shutil.ignore_patterns("*.ipynb")
                source = Path("source") / submission.set
                shutil.copytree(self.root / source, private / source, ignore=solutions)
                shutil.copytree(self.root / "submitted" / work, private / "submitted" / work)
                outcome.reason = self.run(private, student, submission.set)
                if not outcome.reason:
                    self.take(private, work, outcome)
            except (OSError, ValueError, KeyError, shutil.Error) as error:
                outcome.reason = f"{type(error).__name__}: {error}"
        outcome.seconds = time.perf_counter() - start
        return outcome

    def run(self, private: Path, student: str, name: str) -> str:
        """Run the grader; give back what went wrong, empty if nothing did."""
        source = self.root / "source" / name / f"{name}.ipynb"
        order = {"root": str(private), "student": student, "set": name, "source": str(source)}
        nursery = self.idle.get()
        try:
            code = nursery.run(order, self.limit)
        except OSError:  # whatever ended it, the next one needs another
            self.open_nursery()
            raise
        self.idle.put(nursery)
        if code is None:
            return f"it took longer than {self.limit:.0f} s"
        if code < 0:
            return f"something ended the grader (signal {-code})"
        return last_line((private / "log.txt").read_text("utf-8", "replace")) if code else ""

    def take(self, private: Path, work: Path, outcome: Outcome) -> None:
        """Take over what the grader found."""
        result = json.loads((private / "result.json").read_text("utf-8"))
        if "error" in result:
            outcome.reason = last_line(result["error"])
            return
        for step in ("autograded", "feedback"):
            replace(private / step / work, self.root / step / work)
        outcome.grades, outcome.comments = result["grades"], result["comments"]
        outcome.submission.remarks += result["remarks"]
        groups = result["groups"]
        if len(groups) > 1:
            told = ", ".join(map(str, groups))
            outcome.submission.remarks.append(f"answers for several groups: {told}")
        elif groups and groups[0] != outcome.submission.assumed:
            outcome.submission.group = groups[0]  # also where it was computed


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


ERROR = re.compile(r"[\w.]*(Error|Exception|Exit|Interrupt)\b.*")


def last_line(text: str) -> str:
    r"""Give the last line that names an error, else the last one that says something.

    Examples
    --------
    >>> last_line("Traceback:\n  sqlite3.OperationalError: disk full\n[ERROR] See above.")
    'sqlite3.OperationalError: disk full'
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    named = [line for line in lines if ERROR.fullmatch(line)]
    return (named or lines or ["nothing was said"])[-1][:300]


def replace(new: Path, old: Path) -> None:
    """Put a folder in the place of another, and make it writable: nbgrader protects its files."""
    if old.exists():
        shutil.rmtree(old)
    shutil.copytree(new, old)
    for path in [old, *old.rglob("*")]:
        path.chmod(path.stat().st_mode | 0o200)
