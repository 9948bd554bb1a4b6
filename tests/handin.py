"""What students hand in, made for the tests: right, mistaken, and gone at by mishap or malice."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from inspect import getsource
from pathlib import Path
from typing import Any

import nbformat
import numpy as np

from nrdob_course.encoding import packed
from nrdob_course.exercises.reviewing import HIDDEN_CASES
from nrdob_course.grading.batch import Batch, Outcome
from nrdob_course.grading.release import MARKERS
from problemsets import SOURCE, Posed, cells, nbgrader, posed

NAME = "set2"
PATH = SOURCE / NAME / f"{NAME}.ipynb"
TIMEOUT = 5
# What the limit of a kernel forbids; where there are no limits, what no machine can address.
TOO_MUCH = 10**11 if sys.platform == "linux" else 10**15

CHECKED = posed(PATH)
WRITTEN = [cell.id for cell in cells(PATH) if cell.id.startswith("written-")]
POINTS = {cell.id: nbgrader(cell)["points"] for cell in cells(PATH) if nbgrader(cell).get("grade")}
MAX = sum(POINTS.values())

Notebook = Any


def settings(target: Path) -> None:
    """Make a course whose cells have little time."""
    target.mkdir(parents=True, exist_ok=True)
    text = (SOURCE.parent / "nbgrader_config.py").read_text("utf-8")
    text += f"c.Execute.timeout = {TIMEOUT}\nc.Execute.iopub_timeout = {TIMEOUT}\n"
    (target / "nbgrader_config.py").write_text(text, "utf-8")


def solution(this: Posed) -> str:
    """The published answer, as a student would write it."""
    [source] = [c.source for c in cells(this.path) if c.id == answer_cell(this)]
    return MARKERS.sub("", source)


def answer_cell(this: Posed) -> str:
    return this.cell.id.replace("check", "answer")


def mistake(this: Posed, number: int, group: int = 5) -> str:
    """A cell with what somebody answers who holds the misconception, computed here."""
    example = this.problem.misconceptions[number].example
    cases = this.problem.cases(group, 1)
    if this.problem.own:
        return f"{UNPACKED}{this.answer} = unpacked({packed(example(cases[0]))!r})"
    cases += this.problem.cases(this.seed, HIDDEN_CASES)
    answers = {told(case): example(case) for case in cases}
    assert len(answers) == len(cases)
    return (
        f"{UNPACKED}answers = unpacked({packed(answers)!r})\n\n\n"
        f"def {this.answer}(case):\n    return answers[told(case)]"
    )


def told(case: Any) -> str:
    return repr(case) + str([each for each in vars(case).values() if isinstance(each, np.ndarray)])


UNPACKED = (
    "import base64\nimport pickle\n\n\ndef unpacked(text):\n"
    f"    return pickle.loads(base64.b64decode(text))\n\n\n{getsource(told)}\n\n"
).replace("(case: Any) -> str", "(case)")


def cell_of(notebook: Notebook, name: str) -> Any:
    return next(cell for cell in notebook.cells if cell.id == name)


@dataclass
class Handed:
    """A submission, and the line of the table that it should get."""

    file: str
    notebook: Notebook
    earned: dict[str, float]
    remarks: str = ""
    group: str = "5"


def handed(released: Path) -> Notebook:
    return nbformat.read(released / NAME / f"{NAME}.ipynb", as_version=4)


def right(released: Path, file: str, *mischief: Callable[[Notebook], None]) -> Handed:
    """Everything as published; then somebody, or something, goes at it."""
    notebook = handed(released)
    for this in CHECKED:
        cell_of(notebook, answer_cell(this)).source = solution(this)
    for name in WRITTEN:
        cell_of(notebook, name).source = "As $Z = N + P$, it is **clear**."
    cell_of(notebook, "group").source = "GROUP = 5"
    for go in mischief:
        go(notebook)
    return Handed(file, notebook, {this.cell.id: this.points for this in CHECKED})


def mistaken(released: Path, number: int) -> Handed:
    """Each problem answered with its misconception of this number, or left as it was."""
    this = right(released, f"mistake{number}/{NAME}.ipynb")
    remarks = []
    for problem in CHECKED:
        known = problem.problem.misconceptions
        cell = cell_of(this.notebook, answer_cell(problem))
        if number < len(known):
            cell.source = mistake(problem, number)
            this.earned[problem.cell.id] = problem.points * known[number].marks
            remarks.append(odd(cell.id, "import base64, import pickle, vars"))
        else:
            cell.source = cell_of(handed(released), cell.id).source
            this.earned[problem.cell.id] = 0
    this.remarks = "; ".join(remarks)
    return this


SLOW = f"took longer than the {TIMEOUT} s that the set allows"
CUT = "the outputs of {answer} were cut: more than 300000 letters"

# Code that a student may write: at the top of an answer's cell, before the right answer. What ends
# the kernel comes before what takes long, for the notebook is run again without it.
DISASTERS = {
    "a dead kernel": (
        "import os\n\nos._exit(1)",
        0,
        "import os, os._exit",
        "{answer} was left out: it ended the kernel",
    ),
    "a deaf endless loop": (
        "import signal\nimport time\n\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "while True:\n    time.sleep(1)",
        0,
        "import signal",
        "{answer} was left out: it could not be stopped",
    ),
    "an endless loop": ("while True:\n    pass", 0, "", f"{{answer}} {SLOW}"),
    "a flood": ("for _ in range(100):\n    print('x' * 100_000)", 1, "", CUT),
    "a segfault": (
        "import ctypes\n\nctypes.string_at(0)",
        0,
        "import ctypes",
        "{answer} was left out: it ended the kernel",
    ),
    "an exception": ("1 / 0", 0, "", ""),
    "an exit": ("import sys\n\nsys.exit()", 0, "import sys, sys.exit", ""),
    "another exit": ("exit()", 0, "", ""),
    "a large page": (
        "from IPython.display import HTML, display\n\ndisplay(HTML('x' * 10_000_000))",
        1,
        "from IPython.display import HTML, from IPython.display import display",
        CUT,
    ),
    "a syntax error": ("def encirclements(case)", 0, "", ""),
    "too much memory": (f"much = bytearray({TOO_MUCH})", 0, "", ""),
    "a setting": ("get_ipython().ast_node_interactivity = 'all'", 1, "get_ipython", ""),
    "no input": ("input()", 0, "input", ""),
}
"""Code, the share of the points that it leaves, what is remarked of its text and of its run."""


def odd(cell: str, signs: str) -> str:
    return f"{cell} does what no answer needs: {signs}"


def disasters(released: Path) -> Iterator[Handed]:
    """Spread the disasters over submissions that are right otherwise."""
    per_notebook = len(CHECKED)
    left = list(DISASTERS.values())
    for count, start in enumerate(range(0, len(left), per_notebook)):
        this = right(released, f"disaster{count}/{NAME}.ipynb")
        read, ran = [], []
        for problem, (code, share, signs, remark) in zip(
            CHECKED, left[start : start + per_notebook], strict=False
        ):
            cell = cell_of(this.notebook, answer_cell(problem))
            cell.source = f"{code}\n\n{cell.source}"
            this.earned[problem.cell.id] *= share
            read += [odd(cell.id, signs)] if signs else []
            ran += [remark.format(answer=cell.id)] if remark else []
        this.remarks = "; ".join([*read, *ran])
        yield this


def in_the_function(released: Path) -> Handed:
    """An endless loop, and an exit, where the answer is called."""
    this = right(released, f"within/{NAME}.ipynb")
    functions = [problem for problem in CHECKED if not problem.problem.own]
    # What ends the kernel comes first, for the notebook is run again without it.
    sleepy = "import time\n    while True: time.sleep(1)"
    codes = ["import os; os._exit(0)", "import sys; sys.exit(0)", sleepy]
    for problem, code in zip(functions[1:], codes, strict=False):
        cell = cell_of(this.notebook, answer_cell(problem))
        cell.source = f"def {problem.answer}(case):\n    {code}"
        this.earned[problem.cell.id] = 0
    dead, exits, slow = functions[1:4]
    this.remarks = "; ".join(
        [
            odd(answer_cell(dead), "import os, os._exit"),
            odd(answer_cell(exits), "import sys, sys.exit"),
            f"{dead.cell.id} was left out: it ended the kernel",
            f"{slow.cell.id} {SLOW}",
        ]
    )
    return this


FORGERIES = [
    "import nrdob_course.exercises as graders\n\ngraders.score = lambda *any, **more: 1000.0",
    "import nrdob_course.exercises.reviewing as p\n\np.review = lambda *any: p.Feedback(1.0, 'x')",
    "import builtins\n\nbuiltins.float = lambda *any: 1000.0",
    'import json\n\njson.dumps = lambda *any, **more: \'{"value": true, "share": 1}\'',
    "import sys\n\nsys.modules['nrdob_course.encoding'].tell = lambda *any: 1000.0",
]
"""Code that would give itself the points, if it were asked for them."""


def forged(released: Path) -> Handed:
    """Wrong answers, and each problem's grader tampered with."""
    this = right(released, f"forger/{NAME}.ipynb")
    for problem, code in zip(CHECKED, FORGERIES, strict=True):
        cell = cell_of(this.notebook, answer_cell(problem))
        cell.source = f"{code}\n\n{problem.answer} = lambda case: 1000.0"
        this.earned[problem.cell.id] = 0
    return this


def spying(released: Path) -> Handed:
    """Right answers, if what is not the student's can be found; and a page that would do harm."""
    this = right(released, f"spy/{NAME}.ipynb")
    for problem, code in zip(CHECKED, SPYING, strict=False):
        cell = cell_of(this.notebook, answer_cell(problem))
        cell.source = (
            "import glob, os, signal, socket\n\nfound = None\ntry:\n"
            f"    found = {code}\nexcept OSError:\n    pass\nif found is None:\n"
            f"    raise ValueError('nothing found')\n{cell.source}"
        )
        this.earned[problem.cell.id] = 0
    for name in WRITTEN:
        cell_of(this.notebook, name).source = HARMFUL
    return this


SPYING = [
    "[open(f'/proc/{p}/cmdline').read() for p in os.listdir('/proc') if p.isdecimal()]",
    "open(f'/proc/{os.getppid()}/cwd/gradebook.db', 'ab').write(b'x')",
    "glob.glob('/proc/*/cwd/source/*/*')[0]",
    "os.kill(os.getppid(), signal.SIGKILL)",
    "[os.remove(f) for f in [*glob.glob('../*.db'), *glob.glob('/tmp/*/gradebook.db')]][0]",
]
HARMFUL = (
    "<img src=x onerror=alert(1)><svg onload=alert(1)></svg><a href='javascript:alert(1)'>a</a>"
    "<meta http-equiv='refresh' content='0;url=http://evil.example'><b style='color:red'>b</b>"
    "<script>alert(1)</script><style>* {display: none}</style><base href='//evil.example'>"
)


def tampered(released: Path) -> Handed:
    """Cells deleted, doubled, edited, the group gone, metadata changed."""
    this = right(released, f"tampered/{NAME}.ipynb")
    notebook = this.notebook
    first, second, last = CHECKED[0], CHECKED[1], CHECKED[-1]
    # An answer is gone, and its check wants to give the points away.
    notebook.cells.remove(cell_of(notebook, answer_cell(first)))
    cell_of(notebook, first.cell.id).source = f"{first.points}"
    cell_of(notebook, first.cell.id).metadata.nbgrader["points"] = 1000
    this.earned[first.cell.id] = 0
    # A check is gone; an answer is there twice.
    notebook.cells.remove(cell_of(notebook, second.cell.id))
    double = deepcopy(cell_of(notebook, answer_cell(last)))
    notebook.cells.append(double)
    cell_of(notebook, last.cell.id).metadata.nbgrader["grade"] = False
    notebook.cells.remove(cell_of(notebook, "group"))
    this.group = ""
    given_out = cell_of(handed(released), "group").source.split()[2]
    this.remarks = "; ".join(
        [
            f"more than once, the last counts: {double.id}",
            f"put back: {answer_cell(first)}, {second.cell.id}",
            "cells were put back into the order in which they were given out",
            f"restored: {first.cell.id}",
            f"GROUP is not set: ask for it; it was graded as {given_out}",
        ]
    )
    return this


def renamed(released: Path) -> Handed:
    """A file under another name, from another kernel, with a group that is none."""
    this = right(released, "renamed/my homework (2).ipynb")
    this.notebook.metadata.kernelspec["name"] = "conda-env-control"
    cell_of(this.notebook, "group").source = "GROUP = seven"
    this.group = ""
    given_out = cell_of(handed(released), "group").source.split()[2]
    this.remarks = (
        "taken from renamed/my homework (2).ipynb; kernel 'conda-env-control' replaced by 'python3'"
        f"; GROUP is no whole number (seven): ask for it; it was graded as {given_out}"
    )
    return this


def not_executed_but_saved_elsewhere(released: Path) -> Handed:
    """Lost metadata, an old format of the file, in one file for all that a student has."""
    this = right(released, f"Jörg [2]_{NAME}.ipynb")
    for cell in this.notebook.cells:
        cell.metadata = {}
    this.group = "5"
    return this


# --- small ones, without cells that run ---------------------------------------------------------


def write(folder: Path, files: dict[str, Any]) -> Path:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content if isinstance(content, str) else json.dumps(content), "utf-8")
    return folder


def tiny(number: int) -> dict[str, Any]:
    """A set of one problem."""
    check = {"grade": True, "grade_id": f"check-{number}-1", "locked": True, "points": 1}
    code = {"cell_type": "code", "outputs": [], "execution_count": None}
    group = {**code, "id": "group", "metadata": {}, "source": "GROUP = 1"}
    cell = {**code, "id": f"check-{number}-1", "metadata": {"nbgrader": check}, "source": ""}
    return {"cells": [group, cell], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}


KNOWN = {f"set{k}": nbformat.from_dict(tiny(k)) for k in (1, 2)}


class Stub(Batch):
    """Grades without kernels: everything right, and one answer still to be read."""

    def grade(self, ready: list[tuple[str, Any]]) -> Iterator[Outcome]:
        for folder, submission in ready:
            page = self.root / "feedback" / folder / NAME / f"{NAME}.html"
            write(page.parent, {page.name: "<body>text</body>"})
            grades = {name: None if "written" in name else most for name, most in POINTS.items()}
            yield Outcome(submission, grades)


def of_group(notebook: Any, group: int) -> str:
    for cell in notebook.cells:
        if cell.id == "group":
            cell.source = f"GROUP = {group}"
    return json.dumps(notebook)
