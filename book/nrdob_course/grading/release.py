"""Give out the problem sets: the students' copies, as folders and archives, and the solutions."""

import re
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import nbformat
from nbclient.exceptions import CellExecutionError
from nbgrader.preprocessors import ClearHiddenTests

from ..running import execute
from .autograde import SETTINGS, course
from .batch import replace
from .platforms import pack

__all__ = [
    "MARKERS", "SOURCE", "CourseError", "found_course", "generate", "release", "sets_in", "solved",
]  # fmt: skip

SOURCE = Path(__file__).resolve().parents[1] / "sets" / "source"

MARKERS = re.compile(r"^.*(BEGIN|END) (SOLUTION|HIDDEN TESTS).*\n?", re.MULTILINE)

Notebook = Any


class CourseError(Exception):
    """Something that the person at the keyboard has to put right."""


def sets_in(source: Path) -> dict[str, Notebook]:
    """Read the sets, by name."""
    paths = sorted(source.glob("set*/set*.ipynb"))
    return {path.stem: nbformat.read(path, as_version=4) for path in paths}


def found_course(root: Path) -> None:
    """Make a folder a course of nbgrader's; settings that are there stay."""
    root.mkdir(parents=True, exist_ok=True)
    if not (root / SETTINGS).exists():
        shutil.copy(SOURCE.parent / SETTINGS, root)


def generate(root: Path, source: Path, name: str) -> Path:
    """Let nbgrader make the students' copy of a set, in the course of a folder."""
    target = root / "source" / name
    replace(source / name, target, ".*", "__pycache__")
    done = course(root).generate_assignment(name)
    if "Cannot add or remove cells" in done["log"]:
        raise CourseError(
            f"{name} has other cells than when submissions of it were graded into {root}: "
            "grade into another folder, with --output"
        )
    if not done["success"]:
        raise CourseError(f"nbgrader cannot give out {name}:\n{done['log']}")
    return root / "release" / name


def release(names: Sequence[str], source: Path, target: Path, solutions: bool = True) -> None:
    """Write the students' copies, as folders and as archives, and the solutions."""
    with tempfile.TemporaryDirectory() as folder:
        found_course(Path(folder))
        for name in names:
            given_out = target / "release" / name
            replace(generate(Path(folder), source, name), given_out)
            files = (path for path in given_out.rglob("*") if path.is_file())
            members = {path.relative_to(given_out.parent).as_posix(): path for path in files}
            pack(given_out.with_suffix(".zip"), members)
            print(f"{name}: {given_out}.zip")
    if solutions:
        for name in names:
            solution = target / "solutions" / f"{name}.ipynb"
            solution.parent.mkdir(parents=True, exist_ok=True)
            solution.write_text(solved(source / name / f"{name}.ipynb"), "utf-8")
            print(f"{name}: {solution}")


def solved(path: Path) -> str:
    """Run a set with its published solutions, without the hidden tests."""
    notebook = nbformat.read(path, as_version=4)
    notebook, _ = ClearHiddenTests().preprocess(notebook, {})
    for cell in notebook.cells:
        cell.source = MARKERS.sub("", cell.source).rstrip("\n")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        nbformat.write(notebook, copy)
        try:
            return execute(copy, timeout=120)
        except CellExecutionError as error:
            raise CourseError(f"the solutions of {path.stem} do not run:\n{error}") from None
