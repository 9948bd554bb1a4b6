"""Find the notebooks that students handed in, and put right what can be put right.

The form that is asked for is ``FOLDER/<student>/set2.ipynb``. What is near enough is taken and
remarked: the set in a folder of its own, ``FOLDER/<student>_set2.ipynb``, another name of the file
(the cells tell which set it is), another kernel, a cell that is gone or doubled. What cannot be
read or told apart is refused, with the reason; it never stops the others.
"""

from __future__ import annotations

import ast
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_raw_cell

__all__ = ["Submission", "find", "group_of", "read", "repair"]

Notebook = Any
Cell = Any

LARGEST = 200e6
"""Bytes; a larger file is not opened."""

NEW_CELL: dict[str, Any] = {
    "code": new_code_cell,
    "markdown": new_markdown_cell,
    "raw": new_raw_cell,
}
SET_IN_NAME = re.compile(r"set[\s_-]*0*(\d+)", re.IGNORECASE)
STUDENT_IN_NAME = re.compile(r"(?P<student>.*[^\s_-])[\s_-]+set[\s_-]*\d+", re.IGNORECASE)
PICTURES = {".png", ".jpg", ".jpeg", ".gif", ".svg"}


@dataclass
class Submission:
    """What a student handed in for a set.

    ``reason`` says why it cannot be graded; it is empty if it can.
    """

    student: str
    set: str
    path: Path | None = None
    notebook: Notebook = None
    group: int | None = None
    remarks: list[str] = field(default_factory=list)
    reason: str = ""

    @property
    def pictures(self) -> list[Path]:
        """Pictures that lie beside the notebook, in a student's own folder."""
        if self.path is None or self.path.parent.name not in (self.student, self.set):
            return []
        files = sorted(self.path.parent.iterdir())
        return [file for file in files if file.suffix.lower() in PICTURES and file.is_file()]


# --- which files there are ----------------------------------------------------------------------


@dataclass(frozen=True)
class _Candidate:
    student: str
    path: Path
    shown: str
    notebook: Notebook
    problem: str
    set: str


def find(
    folder: Path, sets: Mapping[str, Notebook], wanted: Iterable[str] = ()
) -> list[Submission]:
    """Find what each student handed in.

    `sets` are the sets there are; `wanted` restricts the answer to some. A student who handed in
    some set but not another that was looked for gets an entry for it, with the reason.
    """
    everything = [_candidate(student, path, folder, sets) for student, path in _files(folder)]
    students = {student: None for student, _ in _files(folder)}
    looked_for = sorted(set(wanted) or {found.set for found in everything if found.set})
    submissions = []
    for student in students:
        own = [found for found in everything if found.student == student]
        if own[0].path.name == student and own[0].path.is_file():  # nobody's
            submissions.append(Submission(student, own[0].set, own[0].path, reason=own[0].problem))
            continue
        empty = [found for found in own if found.path.is_dir()]
        unknown = [found for found in own if not found.set and found not in empty]
        if not looked_for:
            unknown += empty
        for name in looked_for:
            named = [found for found in own if found.set == name]
            if not named and len(looked_for) == 1 and len(unknown) == 1:
                named, unknown = unknown, []  # nothing else that it could be
            submissions.append(_choose(student, name, named or empty))
        submissions += [
            Submission(student, "", found.path, reason=_no_set(found)) for found in unknown
        ]
    return submissions


def _files(folder: Path) -> Iterator[tuple[str, Path]]:
    """Give student and file for every notebook, and what else lies where one should."""
    for entry in sorted(folder.iterdir()):
        if entry.name.startswith((".", "__")):
            continue
        if entry.is_dir():
            found = [path for path in sorted(entry.rglob("*")) if _is_notebook(path, entry)]
            # A folder without a notebook stands for its student, who must not be forgotten.
            yield from ((entry.name, path) for path in found or [entry])
        else:
            match = STUDENT_IN_NAME.match(entry.name) if _is_notebook(entry, folder) else None
            yield (match["student"] if match else entry.name, entry)


def _is_notebook(path: Path, top: Path) -> bool:
    hidden = any(part.startswith((".", "__")) for part in path.relative_to(top).parts)
    return ".ipynb" in path.name and not hidden and path.is_file()


def _candidate(student: str, path: Path, folder: Path, sets: Mapping[str, Notebook]) -> _Candidate:
    shown = path.relative_to(folder).as_posix()
    if path.is_dir():
        files = ", ".join(sorted(file.name for file in path.iterdir())[:3])
        problem = "there is no notebook in the folder" + (f", but {files}" if files else "")
        return _Candidate(student, path, shown, None, problem, "")
    if not _is_notebook(path, folder):
        return _Candidate(student, path, shown, None, "it is no notebook", "")
    notebook, problem = read(path)
    if student == path.name:
        problem = problem or "the name of the file does not say whose it is"
    number = SET_IN_NAME.search(path.name) or SET_IN_NAME.search(path.parent.name)
    named = f"set{number[1]}" if number else ""
    name = set_of(notebook, sets) or (named if named in sets else "")
    return _Candidate(student, path, shown, notebook, problem, name)


def _no_set(found: _Candidate) -> str:
    return found.problem or f"{found.shown} is none of the sets"


def _choose(student: str, name: str, found: list[_Candidate]) -> Submission:
    if not found:
        return Submission(student, name, reason="nothing was handed in")
    exact = [candidate for candidate in found if candidate.path.name == f"{name}.ipynb"]
    chosen = (exact if len(exact) == 1 else found)[0]
    others = [candidate.shown for candidate in found if candidate is not chosen]
    if others and len(exact) != 1:
        reason = f"{len(found)} notebooks for one set: {', '.join(c.shown for c in found)}"
        return Submission(student, name, chosen.path, reason=reason)
    if chosen.problem:
        return Submission(student, name, chosen.path, reason=chosen.problem)
    submission = Submission(student, name, chosen.path, chosen.notebook)
    proper = {
        f"{student}/{name}.ipynb",
        f"{student}/{name}/{name}.ipynb",
        f"{student}_{name}.ipynb",
    }
    if chosen.shown not in proper:
        submission.remarks.append(f"taken from {chosen.shown}")
    submission.remarks += [f"{other} was left out" for other in others]
    return submission


def read(path: Path) -> tuple[Notebook, str]:
    """Read a notebook; the second is what is wrong with it, empty if nothing is."""
    try:
        if path.stat().st_size > LARGEST:
            return None, "the file is too large"
        data = path.read_bytes()
        if not data.strip():
            return None, "the file is empty"
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
        content = json.loads(text)
        if not isinstance(content, dict) or not {"cells", "worksheets"} & content.keys():
            return None, "the file is no notebook"
        notebook = nbformat.from_dict(content)
        if content.get("nbformat") != 4:
            notebook = nbformat.convert(notebook, 4)
        if not all(isinstance(cell, dict) for cell in notebook.cells):
            return None, "the file is no notebook"
    except json.JSONDecodeError as error:
        return None, f"the file is no valid JSON ({error})"
    except Exception as error:
        return None, f"the file cannot be read ({type(error).__name__}: {error})"
    return notebook, ""


def set_of(notebook: Notebook, sets: Mapping[str, Notebook]) -> str:
    """Tell from the cells which set a notebook belongs to; empty if it is not clear."""
    if notebook is None:
        return ""
    names = {
        name: {cell.metadata.nbgrader.grade_id for cell in source.cells if _graded(cell)}
        for name, source in sets.items()
    }
    there = {name for cell in notebook.cells for name in _names(cell)}
    counts = Counter({name: len(ids & there) for name, ids in names.items()})
    best = counts.most_common(2)
    if not best or best[0][1] == 0 or (len(best) > 1 and best[1][1] == best[0][1]):
        return ""
    return best[0][0]


def _graded(cell: Cell) -> bool:
    return bool(cell.metadata.get("nbgrader", {}).get("grade"))


def _names(cell: Cell) -> list[str]:
    """Give the names under which a cell of a set may be known: nbgrader's, and its id."""
    metadata = cell.get("metadata")
    metadata = metadata.get("nbgrader") if isinstance(metadata, dict) else None
    grade_id = metadata.get("grade_id") if isinstance(metadata, dict) else None
    return [name for name in (grade_id, cell.get("id")) if isinstance(name, str)]


# --- putting right ------------------------------------------------------------------------------


def repair(submission: Submission, released: Notebook) -> None:
    """Build the notebook anew from the student's text and the released cells' metadata.

    Nothing else of the file is kept: no outputs, no settings. Cells of the set that are gone come
    back as they were given out, doubled ones count once, locked ones that were changed are
    remarked (nbgrader restores their text).
    """
    known = {cell.id: cell for cell in released.cells}
    cells, remarks = _recognised(submission.notebook, known)
    missing = [cell.id for cell in released.cells if cell.id not in {c.id for c in cells}]
    group_cell = next(cell for cell in released.cells if cell.source.startswith("GROUP ="))
    for previous, cell in zip([None, *released.cells], released.cells, strict=False):
        if cell.id in missing and cell is not group_cell:
            cells.insert(_place_after(previous, cells), deepcopy(cell))
    missing = [name for name in missing if name != group_cell.id]
    if missing:
        remarks.append(f"put back: {_listed(missing)}")
    changed = [
        cell.id
        for cell in cells
        if cell.id in known and _locked(known[cell.id]) and cell.source != known[cell.id].source
    ]
    if changed:
        remarks.append(f"restored: {_listed(changed)}")

    submission.group, problem = group_of(cells)
    if problem:
        cells.insert(0, new_code_cell(group_cell.source, id="group-default"))
        remarks.append(problem)
    name = _kernel(submission.notebook)
    if name != "python3":
        remarks.append(f"kernel {name!r} replaced by 'python3'")

    submission.notebook = new_notebook(cells=cells, metadata=deepcopy(released.metadata))
    submission.remarks += remarks


def _listed(names: list[str], most: int = 6) -> str:
    return ", ".join(names) if len(names) <= most else f"{len(names)} cells"


def _recognised(notebook: Notebook, known: Mapping[str, Cell]) -> tuple[list[Cell], list[str]]:
    """Rebuild each cell; those of the set get their name and metadata back."""
    by_grade_id = {
        cell.metadata.nbgrader.grade_id: cell.id
        for cell in known.values()
        if "nbgrader" in cell.metadata
    }
    keys = []
    for cell in notebook.cells:
        names = (by_grade_id.get(name, name) for name in _names(cell))
        keys.append(next((name for name in names if name in known), ""))
    doubled = [key for key, count in Counter(filter(None, keys)).items() if count > 1]
    cells = []
    for index, (cell, key) in enumerate(zip(notebook.cells, keys, strict=True)):
        if key in keys[index + 1 :]:  # the last one counts
            key = ""
        kind = known[key].cell_type if key else cell.get("cell_type")
        new = NEW_CELL.get(kind, new_raw_cell)(_text(cell.get("source")), id=key or f"own-{index}")
        if key:
            new.metadata = deepcopy(known[key].metadata)
        if kind == "markdown" and isinstance(cell.get("attachments"), dict):
            new.attachments = cell.attachments  # a pasted photo of a page
        cells.append(new)
    return cells, [f"more than once, the last counts: {', '.join(doubled)}"] if doubled else []


def _kernel(notebook: Notebook) -> Any:
    metadata = notebook.get("metadata")
    kernel = metadata.get("kernelspec") if isinstance(metadata, dict) else None
    return kernel.get("name", "python3") if isinstance(kernel, dict) else "python3"


def _text(source: Any) -> str:
    if isinstance(source, list):
        return "".join(part for part in source if isinstance(part, str))
    return source if isinstance(source, str) else ""


def _locked(cell: Cell) -> bool:
    return bool(cell.metadata.get("nbgrader", {}).get("locked"))


def _place_after(previous: Cell | None, cells: list[Cell]) -> int:
    names = [cell.id for cell in cells]
    return names.index(previous.id) + 1 if previous is not None and previous.id in names else 0


def group_of(cells: Iterable[Cell]) -> tuple[int | None, str]:
    """Find the group's number; the second says what is wrong with it, empty if nothing is."""
    found: Any = None
    for cell in cells:
        if cell.cell_type != "code":
            continue
        try:
            statements = ast.parse(cell.source).body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            continue
        for statement in statements:
            if isinstance(statement, ast.Assign):
                targets: list[ast.expr] = statement.targets
            elif isinstance(statement, ast.AnnAssign):
                targets = [statement.target]
            else:
                continue
            if any(isinstance(target, ast.Name) and target.id == "GROUP" for target in targets):
                found = statement.value
    if found is None:
        return None, "GROUP is not set: taken as in the notebook given out"
    try:
        group = ast.literal_eval(found)
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        group = None
    if isinstance(group, int) and not isinstance(group, bool):
        return group, ""
    return None, f"GROUP is no whole number: {ast.unparse(found)[:40]}"
