"""Grade submissions two at a time, each in a process and a course of its own.

Whatever a student's code does, it gives an outcome: points, or the reason why there are none.
"""

import json
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue
from threading import Event, Timer

import nrdob
import nrdob_course

from ..running import kernel_environment
from .children import Child, end
from .submissions import Submission

__all__ = ["Batch", "Outcome", "replace"]

WORKER = f"{__package__}.autograde"
LIMIT = 1200.0  # seconds for one submission; its cells have a limit of their own
FOUND = [str(Path(module.__file__ or "").resolve().parents[1]) for module in (nrdob, nrdob_course)]
"""Where the packages were found, so that the graders find the same."""


@dataclass
class Outcome:
    """What came of one submission: points by cell, and for which groups, or why there are none."""

    submission: Submission
    grades: dict[str, float | None] = field(default_factory=dict)
    comments: dict[str, str | None] = field(default_factory=dict)
    groups: list[str] = field(default_factory=list)
    reason: str = ""
    seconds: float = 0.0


class Worker(Child):
    """A process that grades one submission after the other, see `autograde`."""

    def __init__(self) -> None:
        environment = kernel_environment()
        found = [*FOUND, os.getenv("PYTHONPATH")]
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, found))
        # Ctrl-C is for the batch, which then ends this one.
        super().__init__(WORKER, cwd=tempfile.gettempdir(), env=environment, start_new_session=True)

    def run(self, order: dict[str, str]) -> int | None:
        """Grade one, and give the exit code; None if it took too long."""
        late = Event()

        def stop() -> None:
            late.set()
            end(self.process.pid, itself=False)

        timer = Timer(LIMIT, stop)
        timer.start()
        try:
            code = self.ask(order)
        finally:
            timer.cancel()
        return None if late.is_set() else int(code)


class Batch:
    """Grades the submissions that lie in a course's folder."""

    def __init__(self, root: Path, jobs: int) -> None:
        self.root, self.jobs = root.resolve(), jobs
        self.idle: SimpleQueue[Worker] = SimpleQueue()
        self.workers: list[Worker] = []

    def grade(self, submissions: list[tuple[str, Submission]]) -> Iterator[Outcome]:
        """Grade all, each given with the name of its folder; outcomes come as they are ready."""
        pool = ThreadPoolExecutor(self.jobs)
        try:
            for _ in range(min(self.jobs, len(submissions))):
                self.open_worker()
            futures = [pool.submit(self.grade_one, *submission) for submission in submissions]
            for future in as_completed(futures):
                yield future.result()
        finally:  # after an interrupt, too
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in self.workers:
                worker.close()

    def open_worker(self) -> None:
        """Start one more process that grades."""
        self.workers.append(Worker())
        self.idle.put(self.workers[-1])

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
                source, submitted = Path("source") / submission.set, Path("submitted") / work
                replace(self.root / source, private / source, "*.ipynb")  # which hold solutions
                replace(self.root / submitted, private / submitted)
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
        worker = self.idle.get()
        try:
            code = worker.run(order)
        except OSError:  # whatever ended it, the next one needs another
            self.open_worker()
            raise
        self.idle.put(worker)
        if code is None:
            return f"it took longer than {LIMIT:.0f} s"
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
        outcome.groups = result["groups"]


ERROR = re.compile(r"[\w.]*(Error|Exception|Exit|Interrupt)\b.*")


def last_line(text: str) -> str:
    r"""Give the last line that names an error, else the last one that says something.

    >>> last_line("Traceback:\n  sqlite3.OperationalError: disk full\n[ERROR] See above.")
    'sqlite3.OperationalError: disk full'
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    named = [line for line in lines if ERROR.fullmatch(line)]
    return (named or lines or ["nothing was said"])[-1][:300]


def replace(new: Path, old: Path, *left_out: str) -> None:
    """Put a folder in the place of another, and make it writable: nbgrader protects its files."""
    if old.exists():
        shutil.rmtree(old)
    shutil.copytree(new, old, ignore=shutil.ignore_patterns(*left_out))
    for path in [old, *old.rglob("*")]:
        path.chmod(path.stat().st_mode | 0o200)
