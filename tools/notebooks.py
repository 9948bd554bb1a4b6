"""Run the notebooks: into a folder, in place, or as a check against what is committed.

The result depends on nothing but the notebook, the code and the installed versions: no times,
no counters left over, one fixed set of metadata. So a second run gives the same bytes, and a
difference means that something really changed.

    python tools/notebooks.py --output build/notebooks    run into a folder
    python tools/notebooks.py --in-place                  run, and store the outputs
    python tools/notebooks.py --check                     run, and compare with what is stored
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "notebooks"
CLASS = FOLDER / "class"

METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


class NotebookRuleError(Exception):
    """A notebook that does not run, or that breaks a rule which the runner needs."""


@dataclass(frozen=True)
class Run:
    """What came out of running one notebook: the text to store, or what went wrong."""

    path: Path
    text: str = ""
    problem: str = ""
    seconds: float = 0.0
    peak_megabytes: float | None = None


def kernel_environment() -> dict[str, str]:
    """Set the environment in which results cannot depend on the reader's own settings."""
    import matplotlib

    return {
        **os.environ,
        "PYTHONHASHSEED": "0",
        # A personal matplotlibrc would change the figures.
        "MATPLOTLIBRC": str(Path(matplotlib.get_data_path()) / "matplotlibrc"),
        # The kernel of this environment, even where the user has registered another "python3".
        "JUPYTER_PREFER_ENV_PATH": "1",
        # Two notebooks run side by side: keep them from fighting for the cores.
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
    }


def copy_alt_text(cell: Any) -> None:
    """Copy the alt text of the cell's figure to where the book looks for it.

    Our figures carry their alt text in the metadata of the output; the book reads it from the
    metadata of the cell, ``mystnb.image.alt``. Caption and name, which the author writes in
    ``mystnb.figure``, stay as they are.
    """
    alts = [
        output.metadata["image/png"]["alt"]
        for output in cell.outputs
        if "alt" in output.get("metadata", {}).get("image/png", {})
    ]
    if len(alts) > 1:
        raise NotebookRuleError(f"cell {cell.id} shows {len(alts)} figures; show one")
    if alts:
        cell.metadata.setdefault("mystnb", {}).setdefault("image", {})["alt"] = alts[0]
    elif "image" in cell.metadata.get("mystnb", {}):
        # The figure is gone or has lost its alt text: an old one must not stay behind.
        cell.metadata["mystnb"]["image"].pop("alt", None)


def drop_widget_views(cell: Any) -> None:
    """Keep the picture of a figure with sliders; its sliders live only as long as the kernel."""
    for output in cell.outputs:
        output.get("data", {}).pop("application/vnd.jupyter.widget-view+json", None)


def execute(path: Path, timeout: int) -> str:
    """Run one notebook from its own folder and give back the text to store."""
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook,
        timeout=timeout,
        kernel_name="python3",
        record_timing=False,
        store_widget_state=False,
        coalesce_streams=True,  # else one print may be stored in two parts, as the timing falls
        # Else the kernel remarks, each time, that it talks over the loopback unencrypted.
        extra_arguments=["--log-level=ERROR"],
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute(env=kernel_environment())
    for cell in notebook.cells:
        if cell.cell_type == "code":
            copy_alt_text(cell)
            drop_widget_views(cell)
    notebook.metadata = nbformat.from_dict(METADATA)
    nbformat.validate(notebook)
    return str(nbformat.writes(notebook)).rstrip("\n") + "\n"


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
