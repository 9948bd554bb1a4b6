"""Run the notebooks: into a folder, in place, or as a check against what is committed.

The result depends on nothing but the notebook, the code and the installed versions: no times,
no counters left over, one fixed set of metadata. So a second run gives the same bytes, and a
difference means that something really changed.
"""

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError

from nrdob_course.running import NotebookRuleError, execute
from pages import NOTEBOOKS, report, same, store

SECONDS = 300
"""Limit for one cell."""


class Run(NamedTuple):
    """What came out of running one notebook: the text to store, or what went wrong."""

    path: Path
    text: str = ""
    problem: str = ""
    seconds: float = 0.0


def run(path: Path) -> Run:
    """Run one notebook; a failure becomes a `Run` that says the problem."""
    start = time.perf_counter()
    try:
        text = execute(path, SECONDS)
    except (CellExecutionError, CellTimeoutError, DeadKernelError, NotebookRuleError) as error:
        return Run(path, problem=str(error))
    return Run(path, text, "", time.perf_counter() - start)


def parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description="Run notebooks; by default all of notebooks/, in reading order, and those of "
        "notebooks/class/. A folder for the book gets the chapters only."
    )
    parser.add_argument("notebooks", nargs="*", type=Path, metavar="NOTEBOOK")
    mode = parser.add_mutually_exclusive_group(required=True)
    mode.add_argument("--output", type=Path, metavar="FOLDER", help="write the results there")
    mode.add_argument("--in-place", action="store_true", help="store the results in the notebooks")
    mode.add_argument("--check", action="store_true", help="fail if a result differs from the file")
    parser.add_argument("--report", action="store_true", help="print the time of each")
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    given = parse(arguments)
    paths = [path.resolve() for path in given.notebooks] or sorted(NOTEBOOKS.glob("*.ipynb"))
    if not given.notebooks and not given.output:
        paths += sorted((NOTEBOOKS / "class").glob("*.ipynb"))
    if not paths:
        print(f"No notebooks in {NOTEBOOKS}", file=sys.stderr)
        return 1
    if given.output and not given.notebooks:
        for old in given.output.glob("*.ipynb"):  # a chapter that was removed must not stay there
            old.unlink()
    with ProcessPoolExecutor(max_workers=min(2, len(paths))) as pool:
        runs = list(pool.map(run, paths))

    problems = []
    for done in runs:
        if done.problem:
            problems.append(f"{done.path.name} does not run:\n{done.problem}")
        elif not given.check:
            store(done.text, given.output / done.path.name if given.output else done.path)
        elif not same(done.text, done.path):
            problems.append(f"{done.path.name} is not what running it gives: make execute")
    if given.report:
        print(*(f"{done.seconds:7.1f} s  {done.path.name}" for done in runs), sep="\n")
    return report("The run", problems)


if __name__ == "__main__":
    sys.exit(main())
