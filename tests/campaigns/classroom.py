"""Grade a class of sixty with kernels, as Moodle and as Canvas export it, and take its time.

python -m tests.campaigns.classroom --set set6 --platform moodle

Right, mistaken, blank, hostile and broken notebooks, packed, handed in again, late: each must get
the points that it deserves, in the table and in the file that the platform imports. What nobody may
do is tried out in `tests/course/test_sandbox.py`; here it is done in the middle of a class.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import nbformat

sys.path.append(str(Path(__file__).resolve().parents[1]))  # where the tests find what they share

from exported import (
    CLASS,
    Sent,
    canvas,
    moment_of,
    moodle,
    plan,
    read_canvas,
    read_moodle,
    table,
    taken_by_canvas,
    taken_by_moodle,
)
from handin import DISASTERS, FORGERIES, HARMFUL, SPYING, answer_cell, cell_of, mistake, solution
from nrdob_course.grading import command, marks
from problemsets import SOURCE, Posed, cells, nbgrader, posed

BROKEN = 9
"""The one whose file cannot be read."""

KINDS = [*["right"] * 6, "mistake", "blank", "packed", "hostile", "disaster", "mistake"]


@dataclass
class Sheet:
    """A set as it was given out, to be filled in."""

    name: str
    released: Any = field(repr=False)

    @property
    def path(self) -> Path:
        return SOURCE / self.name / f"{self.name}.ipynb"

    @property
    def checked(self) -> tuple[Posed, ...]:
        return posed(self.path)

    @property
    def written(self) -> dict[str, float]:
        graded = {cell.id: nbgrader(cell).get("points", 0) for cell in cells(self.path)}
        return {name: points for name, points in graded.items() if name.startswith("written")}

    def blank(self, group: int) -> Any:
        notebook = deepcopy(self.released)
        cell_of(notebook, "group").source = f"GROUP = {group}"
        return notebook

    def right(self, group: int) -> Any:
        notebook = self.blank(group)
        for this in self.checked:
            cell_of(notebook, answer_cell(this)).source = solution(this)
        for name in self.written:
            cell_of(notebook, name).source = "As $Z = N + P$, it is **clear**."
        return notebook


Earned = dict[str, tuple[float, float]]
"""The least and the most that is right, by problem."""


def filled(sheet: Sheet, kind: str, k: int) -> tuple[Any, Earned]:
    """One notebook, and the points that its answers deserve."""
    notebook = sheet.blank(101 + k) if kind == "blank" else sheet.right(101 + k)
    share = {this.id: (1.0, 1.0) for this in sheet.checked}
    if kind == "blank":
        share = dict.fromkeys(share, (0.0, 0.0))
    for count, this in enumerate(sheet.checked):
        cell = cell_of(notebook, answer_cell(this))
        known = this.problem.misconceptions
        if kind == "mistake" and known:
            number = k % len(known)
            cell.source = mistake(this, number, 101 + k)
            most = 1.0 if this.problem.parts else known[number].marks
            share[this.id] = known[number].marks, most
        elif kind == "hostile" and k // len(KINDS) % 2:
            cell.source = f"{FORGERIES[count]}\n\n{this.answer} = lambda case: 1000.0"
            share[this.id] = 0.0, 0.0
        elif kind == "hostile":
            cell.source = (
                "import glob, os, signal\n\n"
                f"if not ({SPYING[count]}):\n    raise ValueError('nothing found')\n{cell.source}"
            )
            share[this.id] = 0.0, 0.0
    if kind == "hostile":
        for name in sheet.written:
            cell_of(notebook, name).source = HARMFUL
    if kind == "disaster":
        least = len(sheet.checked) - 1
        begin = k // len(KINDS) * least  # each of the disasters once
        for this, (code, left, _, _) in zip(
            sheet.checked, list(DISASTERS.values())[begin : begin + least], strict=False
        ):
            cell = cell_of(notebook, answer_cell(this))
            cell.source = f"{code}\n\n{cell.source}"
            share[this.id] = float(left), float(left)
    earned = {this.id: tuple(this.points * s for s in share[this.id]) for this in sheet.checked}
    return notebook, earned


def class_of(sheet: Sheet) -> Iterator[tuple[Sent, Earned]]:
    """What each of the class hands in."""
    for k in range(len(CLASS)):
        kind = KINDS[k % len(KINDS)]
        notebook, earned = filled(sheet, kind, k)
        earlier = json.dumps(sheet.blank(101 + k)) if kind == "packed" else ""
        text = "{" if k == BROKEN else json.dumps(notebook)
        yield Sent(text, moment_of(k), earlier, zipped=kind == "packed"), earned


def campaign(name: str, platform: str, place: Path) -> Counter[str]:
    """Grade the class; "WRONG" begins the name of every fault."""
    command.release([name], SOURCE, place, solutions=False)
    released = nbformat.read(place / "release" / name / f"{name}.ipynb", as_version=4)
    sheet = Sheet(name, released)
    sent, earned = zip(*class_of(sheet), strict=True)
    pack = moodle if platform == "moodle" else canvas
    course, archive = plan(place, name), pack(place, name, sent)
    target = place / "grading"

    with clock(f"{len(CLASS)} graded"):
        refused = command.grade(archive, target=target, plan=course)
    found = Counter({f"{refused} not graded": 1})
    rows = {row["student"]: row for row in table(target / "grades.csv")}
    found += Counter(judged(rows, earned))

    fields = ("code", "set", "problem", "of", "points")
    answers = [dict(zip(fields, (*found, found[-1]), strict=True)) for found in blind(target)]
    marks.write_table(place / "marked.csv", list(fields), answers)
    with clock("feedback after marking"):
        command.report(target, course, [place / "marked.csv"])
    returned = target / f"{platform}_feedback_{name}.zip"
    handed_back = (taken_by_moodle if platform == "moodle" else taken_by_canvas)(returned)
    found["WRONG who gets feedback"] += set(handed_back) != {*range(60)} - {BROKEN}
    print(f"{returned.name}: {len(handed_back)} pages, {returned.stat().st_size / 1e6:.1f} MB")
    rows = {row["student"]: row for row in table(target / "grades.csv")}
    if platform == "moodle":
        back = read_moodle(table(target / f"moodle_{name}.csv"))
    else:
        back = read_canvas(table(target / "canvas.csv"), name)
    found["WRONG who is in the file to be imported"] += set(back) != {*range(60)} - {BROKEN}
    for k, grades in back.items():
        row = rows[CLASS[k]]
        right = grades == (row["total"], row["max"])
        found["imported as in the table" if right else "WRONG in the file to be imported"] += 1
        owed = (0.8 if k == 1 else 1.0) * sum(float(row[p]) for p in row if "." in p and row[p])
        found["WRONG after the late rule"] += abs(float(row["total"]) - owed) > 1e-2
    return +found


def blind(target: Path) -> list[tuple[str, ...]]:
    """What the page for marking holds of each answer: code, set, problem and points."""
    page = (target / "marking.html").read_text("utf-8")
    data = r'data-code="(\w+)" data-set="(\w+)" data-problem="([\d.\w]+)" data-of="([\d.]+)"'
    return re.findall(data, page)


def judged(rows: Mapping[str, Mapping[str, str]], earned: tuple[Earned, ...]) -> Iterator[str]:
    """Compare each line of the table with what was handed in."""
    for k, wanted in enumerate(earned):
        row, kind = rows[CLASS[k]], KINDS[k % len(KINDS)]
        if k == BROKEN:
            yield "broken: told" if "no valid JSON" in row["remarks"] else "WRONG broken"
            continue
        wrong = [
            f"{problem}: {row[problem]}, not {least:g} to {most:g}"
            for problem, (least, most) in wanted.items()
            if not (row[problem] and least - 1e-3 <= float(row[problem]) <= most + 1e-3)
        ]
        if wrong:
            print(CLASS[k], kind, wrong, row["remarks"])
        yield f"WRONG {kind}" if wrong else f"{kind}: as deserved"


class clock:  # noqa: N801
    """Print the time on the wall and of the processor, that of kernels included."""

    def __init__(self, what: str) -> None:
        self.what = what

    def __enter__(self) -> None:
        self.start = time.perf_counter(), spent()

    def __exit__(self, *any: object) -> None:
        wall, used = time.perf_counter() - self.start[0], spent() - self.start[1]
        print(f"{self.what}: {wall:.0f} s on the wall, {used:.0f} s of a processor", flush=True)


def spent() -> float:
    """Seconds of a processor, of this process and of those that it has waited for."""
    return sum(
        usage.ru_utime + usage.ru_stime
        for usage in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--set", default="set6")
    parser.add_argument("--platform", choices=["moodle", "canvas"], default="moodle")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for outcome, number in sorted(campaign(given.set, given.platform, Path(folder)).items()):
            print(f"{number:6}  {outcome}")
