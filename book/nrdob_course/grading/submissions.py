"""Find the notebooks that students handed in, and put right what can be put right.

The form that is asked for is ``FOLDER/<student>/set2.ipynb``, or what Moodle and Canvas export.
What is near enough is taken and remarked: the set in a folder of its own,
``FOLDER/<student>_set2.ipynb``, another name of the file (the cells tell which set it is), another
kernel, a cell that is gone or doubled. What cannot be read or told apart is refused, with the
reason; it never stops the others.
"""

import ast
import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, field, replace
from datetime import datetime
from operator import itemgetter
from pathlib import Path
from typing import Any

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_raw_cell

from .platforms import NOTE, Owner, owner_of
from .remarks import parsed, suspicious
from .roster import UNPLANNED, Course

__all__ = [
    "NOTHING", "Notebooks", "Submission", "find", "group_of", "read", "remark_group", "repair",
    "writable",
]  # fmt: skip

Notebook = Any
Notebooks = Mapping[str, Notebook]
Cell = Any

LARGEST, MOST_VALUES, LONGEST_CELL = 50e6, 1_000_000, 100_000
"""Bytes of a file that is opened, values in it that are read, and letters of a cell."""

NEW_CELL: dict[str, Any] = {"code": new_code_cell, "markdown": new_markdown_cell}
SET_IN_NAME = re.compile(r"set[\s_-]*0*(\d+)", re.IGNORECASE)
STUDENT_IN_NAME = re.compile(r"(?P<student>.*[^\s_-])[\s_-]+set[\s_-]*\d+", re.IGNORECASE)
PICTURES = {".png", ".jpg", ".jpeg", ".gif", ".svg"}
MOST_PICTURES, TOO_MANY = 50e6, "the pictures have more than 50 MB"


@dataclass
class Submission:
    """What a student handed in for a set.

    ``reason`` says why it cannot be graded; it is empty if it can. ``assigned`` is the group that
    the roster has; ``assumed``, the one that was put in where the student gave none, and ``doubt``
    says so; ``suspicious`` says that its code does what no answer needs; ``shared``, that the
    folder is not the student's own. ``file`` is its name as the student gave it, ``shown`` its
    place in what was handed in.
    """

    student: str
    set: str
    path: Path | None = None
    notebook: Notebook = None
    group: int | None = None
    remarks: list[str] = field(default_factory=list)
    reason: str = ""
    owner: Owner = field(default_factory=lambda: Owner(""))
    handed_in: datetime | None = None
    assigned: int | None = None
    assumed: int | None = None
    doubt: str = ""
    suspicious: bool = False
    shared: bool = False
    file: str = ""
    shown: str = ""

    @property
    def name(self) -> str:
        """The student and the set, if it is known."""
        return f"{self.student} {self.set}".strip()

    def pictures(self) -> Iterator[Path]:
        """Give the pictures beside the notebook, in a student's own folder; remark the others."""
        beside = self.path.parent.iterdir() if self.path and not self.shared else ()
        room = MOST_PICTURES
        for file in sorted(beside, key=lambda file: (file.lstat().st_size, file)):
            if file.suffix.lower() in PICTURES and file.is_file() and not file.is_symlink():
                room -= file.stat().st_size
                if room >= 0:
                    yield file
                else:
                    self.remarks.append(f"{_told(file.name)} was left out: {TOO_MANY}")


# --- which files there are ----------------------------------------------------------------------


NOTHING = "nothing was handed in"
UNCLEAR = "another of this name is on the roster, and what was handed in says not whose it is"
LINK = "it is a link, and links are not followed"
NOT_SET, NO_NUMBER = "GROUP is not set", "GROUP is no whole number"
NAMELESS = (
    "none of its cells has the name that it had when the set was given out, as if they were copied "
    "into another notebook: ask for the answers in the one that was given out"
)


def find(
    folder: Path, sets: Notebooks, wanted: Iterable[str] = (), course: Course = UNPLANNED
) -> list[Submission]:
    """Find what each student handed in.

    `sets` are the sets there are; `wanted` restricts the answer to some. A student who handed in
    nothing gets an entry with that reason, for each of the sets wanted, or for the only one that
    was handed in by others; so does everybody on the course's roster who is not there.
    """
    everything = [_candidate(*found, folder, sets) for found in _files(folder, course)]
    students = list(dict.fromkeys(found.student for found in everything))
    looked_for = sorted(set(wanted) or {found.set for found in everything if found.set})
    expected = looked_for if wanted or len(looked_for) == 1 else []
    submissions = []
    for student in students:
        own = [found for found in everything if found.student == student]
        if own[0].file == student and own[0].path and own[0].path.is_file():  # nobody's
            submissions.append(own[0])
            continue
        empty = [found for found in own if not found.file]
        unknown = [found for found in own if not found.set and found not in empty]
        if not looked_for:
            unknown += empty
        mine = []
        for name in looked_for:
            named = [found for found in own if found.set == name]
            if not named and len(looked_for) == 1 and len(unknown) == 1:
                named, unknown = unknown, []  # nothing else that it could be
            if named or name in expected:
                mine.append(_choose(student, name, named or empty))
        unknown = [_of_no_set(found) for found in unknown]
        submissions += [*mine, *unknown] or [_of_no_set(own[0])]
    return submissions + _on_the_roster(course, submissions, expected or [""])


def _on_the_roster(
    course: Course, submissions: list[Submission], expected: list[str]
) -> list[Submission]:
    """Remark who is not on the roster; give an entry to everybody who is, and is not there."""
    there, unclear = [], []
    for submission in submissions:
        known = course.find(submission.student, submission.owner.identifier)
        there.append(known)
        if course.students and not known:
            number = f" ({submission.owner.identifier})"
            namesakes = course.namesakes(submission.student.removesuffix(number))
            unclear += namesakes
            told = f"the roster has {len(namesakes)} of this name, and none with this number"
            submission.remarks.append(told if namesakes else "not on the roster")
    return [
        Submission(course.called(student), name, reason=UNCLEAR if student in unclear else NOTHING)
        for student in course.students
        for name in (expected if student not in there else [])
    ]


def _files(folder: Path, course: Course) -> Iterator[tuple[Owner, str, Path]]:
    """Give owner, name and path of every notebook, and of what else lies where one should.

    A folder without a notebook stands, without a name, for its student, who must not be forgotten.
    """
    found = list(_named(folder))
    numbers: dict[str, set[str]] = {}
    for owner, _, _ in found:
        numbers.setdefault(owner.student, set()).add(owner.identifier)
    for owner, name, path in found:
        known = course.find(owner.student, owner.identifier) if owner.platform else None
        if known:
            owner = replace(owner, student=course.called(known))
        elif len(numbers[owner.student]) > 1:  # two of one name
            owner = replace(owner, student=f"{owner.student} ({owner.identifier})")
        yield owner, name, path


def _named(folder: Path) -> Iterator[tuple[Owner, str, Path]]:
    entries = [e for e in sorted(folder.iterdir()) if not e.name.startswith((".", "__"))]
    files = [found[0] for entry in entries if (found := owner_of(_told(entry.name)))]
    with_files = {(owner.student, owner.identifier) for owner in files if not owner.text}
    for entry in entries:
        name = _told(entry.name)
        match = STUDENT_IN_NAME.match(name)
        owner, name = owner_of(name) or (Owner(match["student"] if match else name), name)
        if entry.is_symlink():
            yield owner, "", entry
        elif owner.text:  # a greeting beside the file
            if (owner.student, owner.identifier) not in with_files:
                yield owner, "", entry
        elif entry.is_dir():
            inside = [path for path in sorted(entry.rglob("*")) if _is_notebook(path, entry)]
            yield from ((owner, _told(path.name), path) for path in inside)
            if not inside:
                yield owner, "", entry
        else:
            yield owner, "" if owner.platform and not _is_notebook(entry, folder) else name, entry


def _told(name: str) -> str:
    """Give a name so that every table takes it, whatever the system has its bytes for."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def _is_notebook(path: Path, top: Path) -> bool:
    hidden = any(part.startswith((".", "__")) for part in path.relative_to(top).parts)
    return ".ipynb" in path.name.lower() and not hidden and (path.is_symlink() or path.is_file())


def _candidate(owner: Owner, name: str, path: Path, folder: Path, sets: Notebooks) -> Submission:
    shown = _told(path.relative_to(folder).as_posix())
    found = Submission(owner.student, "", path, owner=owner, file=name, shown=shown)
    if path.is_symlink():
        found.set, found.reason = _named_set(path.name, sets), f"{shown}: {LINK}"
    elif owner.text:
        found.file = ""
        found.reason = "a text was typed into the platform, and no notebook handed in"
    elif path.is_dir():
        files = ", ".join(sorted(_told(file.name) for file in path.iterdir())[:3])
        found.file = ""
        found.reason = "there is no notebook in the folder" + (f", but {files}" if files else "")
    elif not _is_notebook(path, folder):
        found.reason = "it is no notebook"
    else:
        found.notebook, found.reason = read(path)
        if owner.student == name:
            found.reason = found.reason or "the name of the file does not say whose it is"
        named = _named_set(name, sets) or _named_set(path.parent.name, sets)
        found.set = set_of(found.notebook, sets) or named
        if found.set and not found.reason:
            known = {each for cell in sets[found.set].cells for each in _names(cell)}
            if not any(known.intersection(_names(cell)) for cell in found.notebook.cells):
                found.reason = NAMELESS
    return found


def _named_set(name: str, sets: Notebooks) -> str:
    number = SET_IN_NAME.search(name)
    return f"set{number[1]}" if number and f"set{number[1]}" in sets else ""


def _of_no_set(found: Submission) -> Submission:
    return replace(found, set="", reason=found.reason or f"{found.shown} is none of the sets")


def _choose(student: str, name: str, found: list[Submission]) -> Submission:
    if not found:
        return Submission(student, name, reason=NOTHING)
    newest = [each for each in found if each.owner.turn == max(e.owner.turn for e in found)]
    exact = [each for each in newest if each.file == f"{name}.ipynb"]
    chosen = replace((exact if len(exact) == 1 else newest)[0], set=name, remarks=[])
    if len(newest) > 1 and len(exact) != 1:
        told = ", ".join(each.shown for each in newest)
        chosen.reason = f"{len(newest)} notebooks for one set: {told}"
    if chosen.reason or not chosen.path:
        return chosen
    chosen.handed_in = _time_of(chosen.path, chosen.owner)
    chosen.shared = "/" not in chosen.shown
    proper = [f"{student}{between}{name}.ipynb" for between in ("/", f"/{name}/", "_", f"_{name}/")]
    if chosen.shown not in proper and not (chosen.owner.platform and exact):
        chosen.remarks.append(f"taken from {chosen.shown}")
    others = [each.shown for each in found if each.path != chosen.path]
    chosen.remarks += [f"{other} was left out" for other in others]
    if not chosen.shared:
        links = [path for path in sorted(chosen.path.parent.iterdir()) if path.is_symlink()]
        chosen.remarks += [f"{_told(link.name)} was left out: {LINK}" for link in links]
    if chosen.owner.late:
        chosen.remarks.append("late, says Canvas")
    return chosen


def _time_of(path: Path, owner: Owner) -> datetime | None:
    """Tell when a file was handed in: as nbgrader noted it, else by the time of the file."""
    note = path.parent / NOTE
    try:
        if not owner.platform and note.exists() and not note.is_symlink():
            text = note.read_text("utf-8").strip().removesuffix(" UTC")
            return datetime.fromisoformat(f"{text}+00:00" if "+" not in text else text)
        return datetime.fromtimestamp(path.stat().st_mtime).astimezone()
    except (OSError, ValueError, OverflowError):
        return None


def read(path: Path) -> tuple[Notebook, str]:
    """Read a notebook; the second is what is wrong with it, empty if nothing is."""
    try:
        if path.stat().st_size > LARGEST:
            return None, "the file is too large"
        data = path.read_bytes()
        if not data.strip():
            return None, "the file is empty"
        if sum(map(data.count, b",[{")) > MOST_VALUES:  # each takes far more memory than here
            return None, "the file holds too much"
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
        content = writable(json.loads(text))
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
        return None, f"the file cannot be read ({type(error).__name__}: {error!s:.200})"
    return notebook, ""


def writable(content: Any) -> Any:
    r"""Give what was read as JSON without halves of surrogate pairs, which no file takes.

    >>> writable(["\ud83d", "é"])
    ['?', 'é']
    """
    return json.loads(json.dumps(content, ensure_ascii=False).encode("utf-8", "replace"))


def set_of(notebook: Notebook, sets: Notebooks) -> str:
    """Tell from the cells which set a notebook belongs to; empty if it is not clear."""
    if notebook is None:
        return ""
    there = {name for cell in notebook.cells for name in _names(cell)}
    counts: Counter[str] = Counter()
    for name, source in sets.items():
        asked = [cell.metadata.get("nbgrader", {}) for cell in source.cells]
        counts[name] = sum(bool(of.get("grade")) and of["grade_id"] in there for of in asked)
    most = max(counts.values(), default=0)
    best = [name for name, count in counts.items() if count == most > 0]
    return best[0] if len(best) == 1 else ""


def _names(cell: Cell) -> list[str]:
    """Give the names under which a cell of a set may be known: nbgrader's, and its id."""
    names = (_within(cell, "metadata", "nbgrader", "grade_id"), cell.get("id"))
    return [name for name in names if isinstance(name, str)]


def _within(data: Any, *keys: str) -> Any:
    """Give what stands under these keys, one in the other; None if nothing does."""
    for key in keys:
        data = data.get(key) if isinstance(data, dict) else None
    return data


# --- putting right ------------------------------------------------------------------------------


def repair(submission: Submission, released: Notebook, assigned: int | None = None) -> None:
    """Build the notebook anew from the student's text and the released cells' metadata.

    Nothing else of the file is kept: no outputs, no settings. Cells of the set that are gone come
    back as they were given out, doubled ones count once, all stand in their order, locked ones that
    were changed are remarked (nbgrader restores their text). `assigned` is the roster's group.
    """
    known = {cell.id: cell for cell in released.cells}
    cells, remarks = _recognised(submission.notebook, known)
    group_cell = next(cell for cell in released.cells if cell.source.startswith("GROUP ="))
    there = {group_cell.id, *(cell.id for cell in cells)}
    missing = [cell.id for cell in released.cells if cell.id not in there]
    for previous, cell in zip([None, *released.cells], released.cells, strict=False):
        if cell.id in missing:
            before = (k for k, each in enumerate(cells, 1) if previous and each.id == previous.id)
            cells.insert(next(before, 0), deepcopy(cell))
    if missing:
        remarks.append(f"put back: {_listed(missing)}")
    if (ordered := _in_order(cells, [*known])) != cells:
        cells = ordered
        remarks.append("cells were put back into the order in which they were given out")
    is_locked = [c for c in released.cells if _within(c, "metadata", "nbgrader", "locked")]
    locked = {cell.id: cell.source for cell in is_locked}
    changed = [cell.id for cell in cells if locked.get(cell.id, cell.source) != cell.source]
    if changed:
        remarks.append(f"restored: {_listed(changed)}")

    submission.group, submission.doubt = group_of(cells)
    if submission.group == 0:  # nobody's: so it may be given out
        submission.group, submission.doubt = None, NOT_SET
    submission.assigned = assigned
    if submission.doubt:
        given_out = group_of([group_cell])[0]
        submission.assumed = given_out if assigned is None else assigned
        source = f"GROUP = {submission.assumed}"
        cells.insert(0, new_code_cell(source, id="group-default"))
        for cell in cells[1:]:
            if cell.id == group_cell.id and cell.source.strip() == group_cell.source.strip():
                cell.source = source
    name = _within(submission.notebook, "metadata", "kernelspec", "name")
    if name not in (None, "python3"):
        remarks.append(f"kernel {name!r} replaced by 'python3'")

    signs = suspicious(cells, released.cells)
    submission.suspicious = bool(signs)
    remarks += signs

    submission.notebook = new_notebook(cells=cells, metadata=deepcopy(released.metadata))
    submission.remarks += remarks


def _in_order(cells: list[Cell], names: list[str]) -> list[Cell]:
    """Put the cells of a set into their order, and those of one's own behind the same as before."""
    at, keyed = -1, []
    for cell in cells:
        at = names.index(cell.id) if cell.id in names else at
        keyed.append((at, cell))
    return [cell for _, cell in sorted(keyed, key=itemgetter(0))]


def _listed(names: list[str]) -> str:
    return ", ".join(names) if len(names) <= 6 else f"{len(names)} cells"


def _recognised(notebook: Notebook, known: Mapping[str, Cell]) -> tuple[list[Cell], list[str]]:
    """Rebuild each cell; those of the set get their name and metadata back."""
    graded = [cell for cell in known.values() if "nbgrader" in cell.metadata]
    by_grade_id = {cell.metadata.nbgrader.grade_id: cell.id for cell in graded}
    keys = []
    for cell in notebook.cells:
        names = (by_grade_id.get(name, name) for name in _names(cell))
        keys.append(next((name for name in names if name in known), ""))
    doubled = [key for key, count in Counter(filter(None, keys)).items() if count > 1]
    cells, cut = [], []
    for index, (cell, key) in enumerate(zip(notebook.cells, keys, strict=True)):
        if key in keys[index + 1 :]:  # the last one counts
            key = ""
        kind = known[key].cell_type if key else cell.get("cell_type")
        text = _text(cell.get("source"))
        if len(text) > LONGEST_CELL:
            text = text[:LONGEST_CELL]
            cut.append(key or f"own-{index}")
        new = NEW_CELL.get(kind, new_raw_cell)(text, id=key or f"own-{index}")
        if key:
            new.metadata = deepcopy(known[key].metadata)
        if kind == "markdown" and isinstance(cell.get("attachments"), dict):
            new.attachments = {  # pasted photos of a page
                name: {kind: _text(x) for kind, x in held.items() if kind.startswith("image/")}
                for name, held in cell.attachments.items()
                if isinstance(held, dict)
            }
        cells.append(new)
    remarks = [f"more than once, the last counts: {', '.join(doubled)}"] if doubled else []
    if cut:
        remarks.append(f"cut to {LONGEST_CELL} letters: {_listed(cut)}")
    return cells, remarks


def _text(source: Any) -> str:
    if isinstance(source, list):
        return "".join(part for part in source if isinstance(part, str))
    return source if isinstance(source, str) else ""


def group_of(cells: Iterable[Cell]) -> tuple[int | None, str]:
    """Find the group's number; the second says what is wrong with it, empty if nothing is."""
    found: Any = None
    trees = [parsed(cell.source) for cell in cells if cell.cell_type == "code"]
    for statement in (each for tree in trees if tree for each in tree.body):
        match statement:
            case ast.Assign([ast.Name("GROUP"), *_] | [*_, ast.Name("GROUP")], value):
                found = value
            case ast.AnnAssign(target=ast.Name("GROUP"), value=value):
                found = value
    if found is None:
        return None, NOT_SET
    with suppress(ValueError, TypeError, RecursionError):
        if type(group := ast.literal_eval(found)) is int:
            return (group, "") if abs(group) < 10**9 else (None, "GROUP has more than nine digits")
    return None, f"{NO_NUMBER} ({ast.unparse(found)[:40]})"


def remark_group(submission: Submission, used: Sequence[str]) -> None:
    """Remark for which groups answers were judged, or if none was, what was read of them."""
    read = submission.assumed if submission.group is None else submission.group
    group, *others = used or [str(read)]
    if others:
        submission.remarks.append(f"answers for several groups: {', '.join(used)}")
        return
    assigned, nobodys = submission.assigned, group == str(submission.assumed)
    is_number = re.fullmatch(r"-?\d{1,9}", group)
    if assigned is not None or not nobodys:
        submission.group = int(group) if is_number else None
    if assigned is None:
        if nobodys or not is_number:
            doubt = submission.doubt or NO_NUMBER
            submission.remarks.append(f"{doubt}: ask for it; it was graded as {group}")
    elif group != str(assigned):
        submission.remarks.append(f"group {group}, and {assigned} on the roster")
    elif submission.doubt == NOT_SET:
        submission.remarks.append(f"{NOT_SET}: on the roster it is {assigned}")
