"""Run the notebooks: into a folder, in place, or as a check against what is committed.

The result depends on nothing but the notebook, the code and the installed versions: no times,
no counters left over, one fixed set of metadata. So a second run gives the same bytes, and a
difference means that something really changed.

    python book/make/notebooks.py --output build/notebooks    run into a folder
    python book/make/notebooks.py --in-place                  run, and store the outputs
    python book/make/notebooks.py --check                     run, and compare with what is stored
"""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError

from nrdob_course.running import NotebookRuleError, execute

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "notebooks"
CLASS = FOLDER / "class"


@dataclass(frozen=True)
class Run:
    """What came out of running one notebook: the text to store, or what went wrong."""

    path: Path
    text: str = ""
    problem: str = ""
    seconds: float = 0.0
    peak_megabytes: float | None = None


def peak_memory_of_children() -> float | None:
    """Peak memory of the largest finished child process, in MB; None where unknown."""
    if resource is None:
        return None
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)  # bytes there, kilobytes elsewhere


def run(path: Path, timeout: int) -> Run:
    """Run one notebook; a failure becomes a `Run` with the problem told."""
    start = time.perf_counter()
    try:
        text = execute(path, timeout)
    except (CellExecutionError, CellTimeoutError, DeadKernelError, NotebookRuleError) as error:
        return Run(path, problem=str(error))
    return Run(path, text, "", time.perf_counter() - start, peak_memory_of_children())


def run_all(paths: list[Path], timeout: int) -> list[Run]:
    """Run the notebooks, two at a time, each in a process of its own.

    One process for each notebook makes its kernel the only child there, so that the peak
    memory is the kernel's.
    """
    with ProcessPoolExecutor(max_workers=min(2, len(paths)), max_tasks_per_child=1) as pool:
        return list(pool.map(run, paths, [timeout] * len(paths)))


def store(run: Run, target: Path) -> None:
    """Write the notebook, with Unix line ends everywhere, and only where it changed."""
    content = run.text.encode()
    if not target.exists() or target.read_bytes() != content:
        target.write_bytes(content)


def report(runs: list[Run]) -> str:
    """Make a small table of the time and memory each notebook took."""
    width = max(len(run.path.name) for run in runs)
    lines = [f"{'notebook':<{width}}  {'time':>8}  {'peak memory':>11}"]
    for run in runs:
        memory = "–" if run.peak_megabytes is None else f"{run.peak_megabytes:.0f} MB"
        lines.append(f"{run.path.name:<{width}}  {run.seconds:>6.1f} s  {memory:>11}")
    return "\n".join(lines)


def same_as_stored(run: Run) -> bool:
    """Compare with the file; line ends do not count, since git may change them on Windows."""
    return run.path.read_bytes().replace(b"\r\n", b"\n") == run.text.encode()


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description="Run notebooks; by default all of notebooks/, in reading order, and those of "
        "notebooks/class/. A folder for the book gets the chapters only."
    )
    parser.add_argument("notebooks", nargs="*", type=Path, metavar="NOTEBOOK")
    mode = parser.add_mutually_exclusive_group(required=True)
    mode.add_argument("--output", type=Path, metavar="FOLDER", help="write the results there")
    mode.add_argument("--in-place", action="store_true", help="store the results in the notebooks")
    mode.add_argument("--check", action="store_true", help="fail if a result differs from the file")
    parser.add_argument("--report", action="store_true", help="show time and memory of each")
    parser.add_argument(
        "--timeout", type=int, default=300, metavar="SECONDS", help="limit for one cell"
    )
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; the result is the exit code."""
    options = parse(arguments)
    paths = [path.resolve() for path in options.notebooks] or sorted(FOLDER.glob("*.ipynb"))
    if not options.notebooks and not options.output:
        paths += sorted(CLASS.glob("*.ipynb"))
    if not paths:
        print(f"No notebooks in {FOLDER}", file=sys.stderr)
        return 1
    if options.output:
        options.output.mkdir(parents=True, exist_ok=True)
        if not options.notebooks:  # a chapter that is gone must not live on in the folder
            for old in options.output.glob("*.ipynb"):
                old.unlink()

    runs = run_all(paths, options.timeout)

    failed = [run for run in runs if run.problem]
    for run in failed:
        print(f"{run.path.name} does not run:\n{run.problem}", file=sys.stderr)
    different = []
    for done in (run for run in runs if not run.problem):
        if options.check:
            if not same_as_stored(done):
                different.append(done)
        else:
            store(done, options.output / done.path.name if options.output else done.path)
    for run in different:
        print(f"{run.path.name} is not what running it gives: make execute", file=sys.stderr)
    if options.report:
        print(report(runs))
    return 1 if failed or different else 0


if __name__ == "__main__":
    sys.exit(main())
