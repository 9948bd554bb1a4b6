"""Grade submissions two at a time, each in a process and a course of its own.

Whatever a student's code does, it gives an outcome: points, or the reason why there are none.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from ..running import kernel_environment
from .submissions import Submission

__all__ = ["Batch", "Outcome"]

GRADER = f"{__package__}.autograde"


@dataclass
class Outcome:
    """What came of one submission: points by cell, or the reason why there are none."""

    submission: Submission
    grades: dict[str, float | None] = field(default_factory=dict)
    comments: dict[str, str | None] = field(default_factory=dict)
    reason: str = ""
    seconds: float = 0.0


class Batch:
    """Grades the submissions that lie in a course's folder."""

    def __init__(self, root: Path, jobs: int, limit: float) -> None:
        self.root, self.jobs, self.limit = root, jobs, limit
        self.running: set[int] = set()

    def grade(self, submissions: list[tuple[str, Submission]]) -> Iterator[Outcome]:
        """Grade all, each given with the name of its folder; outcomes come as they are ready."""
        pool = ThreadPoolExecutor(self.jobs)
        try:
            futures = [pool.submit(self.grade_one, *submission) for submission in submissions]
            for future in as_completed(futures):
                yield future.result()
        finally:  # after an interrupt, too
            pool.shutdown(wait=False, cancel_futures=True)
            for pid in list(self.running):
                end(pid)

    def grade_one(self, student: str, submission: Submission) -> Outcome:
        """Grade one, in a copy of the course.

        So two can be graded at a time (sqlite is not made for two who write), and the real
        gradebook is out of reach.
        """
        start = time.perf_counter()
        outcome = Outcome(submission)
        work = Path(student) / submission.set
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            private = Path(folder)
            try:
                for file in ("gradebook.db", "nbgrader_config.py"):
                    shutil.copy(self.root / file, private)
                for part in (Path("source") / submission.set, "submitted" / work):
                    shutil.copytree(self.root / part, private / part)
                outcome.reason = self.run(private, student, submission.set)
                if not outcome.reason:
                    self.take(private, work, outcome)
            except (OSError, ValueError, KeyError, shutil.Error) as error:
                outcome.reason = f"{type(error).__name__}: {error}"
        outcome.seconds = time.perf_counter() - start
        return outcome

    def run(self, private: Path, student: str, name: str) -> str:
        """Run the grader; give back what went wrong, empty if nothing did."""
        environment = kernel_environment()
        # Neither the teacher's own settings nor their history have a part in it.
        environment["IPYTHONDIR"] = str(private / "ipython")
        environment["JUPYTER_CONFIG_DIR"] = str(private / "jupyter")
        log = private / "log.txt"
        with log.open("wb") as output:
            process = subprocess.Popen(
                [sys.executable, "-m", GRADER, str(private), student, name],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=environment,
                start_new_session=True,  # Ctrl-C is for the batch, which then ends this one
            )
            self.running.add(process.pid)
            try:
                code = process.wait(self.limit)
            except subprocess.TimeoutExpired:
                end(process.pid)
                process.wait()
                return f"it took longer than {self.limit:.0f} s"
            finally:
                self.running.discard(process.pid)
        if code < 0:
            return f"something ended the grader (signal {-code})"
        return last_line(log.read_text("utf-8", "replace")) if code else ""

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


def end(pid: int) -> None:
    """End a process and all that it started: a kernel may be deaf to everything else."""
    try:
        process = psutil.Process(pid)
        family = [*process.children(recursive=True), process]
    except psutil.NoSuchProcess:
        return
    for member in family:
        try:
            member.kill()
        except psutil.NoSuchProcess:
            continue


def last_line(text: str) -> str:
    """Give the last line that says something."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1][:300] if lines else "nothing was said"


def replace(new: Path, old: Path) -> None:
    """Put a folder in the place of another, and make it writable: nbgrader protects its files."""
    if old.exists():
        shutil.rmtree(old)
    shutil.copytree(new, old)
    for path in [old, *old.rglob("*")]:
        path.chmod(path.stat().st_mode | 0o200)
