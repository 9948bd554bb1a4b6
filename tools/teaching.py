"""Write the pages of the instructor's pack that are made from the problems and the chapters.

What a program knows comes from it: the problems, their points and typical mistakes, what the
chapters promise. What only a teacher knows stands in ``book/teaching/problems.toml``: what to ask a
student, what earns points where somebody reads the answer. The exit code is 1, and every reason is
listed, if the two do not fit together; the pages are written in any case.

    python tools/teaching.py                     write the pages into book/teaching
    python tools/teaching.py --output FOLDER     write them there
"""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nbformat

from ledger import store
from nrdob.exercises import PROBLEMS, Problem

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = ROOT / "notebooks"
TEACHING = ROOT / "book" / "teaching"
ADVICE = "problems.toml"

GRADED = re.compile(r"(check|written)-(\d+)-(\d+)([a-z]?)")
TIME = re.compile(r"\*\*Time\*\* (.*?minutes)")

PARTS = {"0": "The examples", "1": "The derivations", "2": "Design"}
"""The parts of the book, by the first digit of a chapter's name."""

OBJECTIVES_PAGE = """\
# Objectives, chapters and problems

What each chapter promises, in its own words, and the problems in which a student shows it. Where no
problem is named, the chapter's own questions under *Try it* are the practice. This page is made
from the chapters and the sets each time the book is built.

After the chapter, the student can …
"""

SETS_INTRODUCTION = """\
## The sets

*Checked* problems are graded by a program, on cases drawn anew; those marked *own plant* on the
numbers of the student's group alone. The others are read by somebody, with the [rubric](rubric.md).
"""

MISTAKES_PAGE = """\
# Expected wrong answers

For each problem: a question to ask the student who is stuck, and the mistakes that the grader
recognises, with what the student is told, by the check at once and by the feedback later, and with
the points that such an answer gets. One that is wrong in no known way is shown the first case
that it fails, and gets nothing.

Ask before you tell. The question helps whatever the mistake is; the message below it is what the
student has read already. This page is made from the graders each time the book is built, and the
tests see to it that each mistake is recognised, with the message and the points that stand here.
"""

RUBRIC_PAGE = """\
# Rubric of the written answers

Each set has a problem that is done with paper and pencil and read by somebody. What is asked for
earns the points below; the model solutions are in the notebooks that `make release` writes into
`build/exercises/solutions`.

- Half points are allowed. A slip of the pen costs half a point once, not again where it is carried
  on.
- Another way that leads there is as good as ours. A right result without a reason earns half.
- A formula need not be typed well to be read: a photo of a page in the cell is an answer.
- Write one sentence into the column *comment* where points are missing; the student reads it.
"""


# --- what there is ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Chapter:
    """What a chapter promises."""

    stem: str
    title: str
    minutes: int
    objectives: tuple[str, ...]

    @property
    def link(self) -> str:
        return f"[{self.title}](../chapters/{self.stem}.ipynb)"


@dataclass(frozen=True)
class Task:
    """A graded cell of a set."""

    id: str
    title: str
    points: float
    written: bool


@dataclass(frozen=True)
class ProblemSet:
    """A notebook of problems."""

    name: str
    title: str
    time: str
    tasks: tuple[Task, ...]

    @property
    def points(self) -> float:
        return sum(task.points for task in self.tasks)


@dataclass(frozen=True)
class Advice:
    """What a teacher knows about a problem.

    `trains` names objectives: the chapter, and how the objective begins.
    """

    ask: str
    trains: tuple[tuple[str, str], ...]
    rubric: tuple[tuple[float, str], ...] = ()
    wrong: tuple[tuple[str, str], ...] = ()


def read_chapter(path: Path) -> Chapter:
    """Read the first cell of a chapter."""
    opening = nbformat.read(path, as_version=4).cells[0].source
    title = opening.partition("\n")[0].lstrip("# ")
    time = re.search(r"\*\*Time\*\* (\d+) minutes", opening)
    promised = re.search(r"\*\*You will be able to\*\*(.*?)\*\*You need\*\*", opening, re.DOTALL)
    lines = promised[1].splitlines() if promised else []
    objectives = [line.removeprefix("- ").rstrip(";. ") for line in lines if line.startswith("- ")]
    return Chapter(path.stem, title, int(time[1]) if time else 0, tuple(objectives))


def read_chapters(folder: Path = NOTEBOOKS) -> dict[str, Chapter]:
    """Read every chapter, in reading order."""
    return {path.stem: read_chapter(path) for path in sorted(folder.glob("*.ipynb"))}


def read_set(path: Path) -> ProblemSet:
    """Read titles, time and points of a set."""
    cells = nbformat.read(path, as_version=4).cells
    text = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    headings = dict(re.findall(r"^## (\d+\.\d+) (.+)$", text, re.MULTILINE))
    title = re.search(r"^# (.+)$", text, re.MULTILINE)
    time = TIME.search(text)
    tasks = []
    for cell in cells:
        kind = cell.metadata.get("nbgrader", {})
        if kind.get("grade") and (name := GRADED.fullmatch(kind["grade_id"])):
            number = f"{name[2]}.{name[3]}"
            task = Task(
                number + name[4], headings.get(number, ""), kind["points"], name[1] == "written"
            )
            tasks.append(task)
    return ProblemSet(
        path.stem, title[1] if title else path.stem, time[1] if time else "", tuple(tasks)
    )


def read_sets(folder: Path = NOTEBOOKS / "exercises" / "source") -> list[ProblemSet]:
    """Read every set, in order."""
    return [read_set(path) for path in sorted(folder.glob("set*/set*.ipynb"))]


def read_advice(path: Path = TEACHING / ADVICE) -> dict[str, Advice]:
    """Read what teachers know."""
    entries = tomllib.loads(path.read_text("utf-8"))
    return {id: _advice(entry) for id, entry in entries.items()}


def _advice(entry: Mapping[str, Any]) -> Advice:
    trains = (text.partition(": ") for text in entry["trains"])
    return Advice(
        entry["ask"],
        tuple((stem, begins) for stem, _, begins in trains),
        tuple((points, text) for points, text in entry.get("rubric", ())),
        tuple((did, say) for did, say in entry.get("wrong", ())),
    )


@dataclass(frozen=True)
class Pack:
    """All that the pages are made from."""

    chapters: Mapping[str, Chapter]
    sets: Sequence[ProblemSet]
    advice: Mapping[str, Advice]
    problems: Mapping[str, Problem]

    @property
    def tasks(self) -> Iterator[Task]:
        return (task for each in self.sets for task in each.tasks)

    def objectives_of(self, id: str) -> list[tuple[str, str]]:
        """Give chapter and objective for all that a problem trains, as far as they exist."""
        advice = self.advice.get(id)
        return [
            (stem, objective)
            for stem, begins in (advice.trains if advice else ())
            if stem in self.chapters
            for objective in self.chapters[stem].objectives
            if objective.startswith(begins)
        ]

    def misfits(self) -> list[str]:
        """Tell where problems, chapters and advice do not fit together."""
        tasks = {task.id: task for task in self.tasks}
        written = {id: task for id, task in tasks.items() if task.written}
        told = [f"{id}: posed in no set" for id in self.problems if id not in tasks]
        told += [f"{id}: not in {ADVICE}" for id in tasks if id not in self.advice]
        told += [f"{id}: in {ADVICE}, and no such problem" for id in self.advice if id not in tasks]
        for id, advice in self.advice.items():
            for stem, begins in advice.trains:
                chapter = self.chapters.get(stem)
                found = [o for o in chapter.objectives if o.startswith(begins)] if chapter else []
                if len(found) != 1:
                    told.append(f"{id}: {stem} has {len(found)} objectives that begin {begins!r}")
        for id, task in written.items():
            rubric = self.advice[id].rubric if id in self.advice else ()
            if sum(points for points, _ in rubric) != task.points:
                told.append(f"{id}: the rubric does not give the {task.points:g} points of the set")
        return told


def read_pack() -> Pack:
    """Read everything where it is."""
    return Pack(read_chapters(), read_sets(), read_advice(), PROBLEMS)


# --- the pages ----------------------------------------------------------------------------------


def plain(text: str) -> str:
    """Write a plain text so that Markdown shows it as it is."""
    return re.sub(r"([\\`*_{}\[\]<>|$~#])", r"\\\1", text)


def in_cell(text: str) -> str:
    """Write Markdown so that it fits into a cell of a table."""
    return text.replace("|", r"\|").replace("\n", " ")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Write a table, and an empty line."""
    lines = [head, ["---"] * len(head), *rows]
    return [*(f"| {' | '.join(line)} |" for line in lines), ""]


def points_of(points: float) -> str:
    return "1 point" if points == 1 else f"{points:g} points"


def kind_of(task: Task, problems: Mapping[str, Problem]) -> str:
    """Tell how a problem is judged."""
    if task.written:
        return "by hand"
    own = task.id in problems and problems[task.id].own
    return "checked, own plant" if own else "checked"


def objectives_page(pack: Pack) -> str:
    """Write the page that maps objectives to chapters and problems."""
    practised: dict[tuple[str, str], list[str]] = {}
    for task in pack.tasks:
        for objective in pack.objectives_of(task.id):
            practised.setdefault(objective, []).append(task.id)
    lines = [OBJECTIVES_PAGE]
    for digit, part in PARTS.items():
        rows = [
            (
                chapter.link if number == 0 else "",
                in_cell(objective),
                ", ".join(practised.get((chapter.stem, objective), [])),
            )
            for chapter in pack.chapters.values()
            if chapter.stem.startswith(digit)
            for number, objective in enumerate(chapter.objectives)
        ]
        lines += [f"## {part}", "", *table(("Chapter", "… can", "Problems"), rows)]
    lines.append(SETS_INTRODUCTION)
    for each in pack.sets:
        lines += [f"### {each.title}", "", f"{points_of(each.points)}, {each.time}.", ""]
        listed = [
            (
                task.id,
                in_cell(task.title),
                f"{task.points:g}",
                kind_of(task, pack.problems),
                ", ".join(dict.fromkeys(chapter_links(pack, task.id))),
            )
            for task in each.tasks
        ]
        lines += table(("Problem", "", "Points", "", "Chapters"), listed)
    return "\n".join(lines)


def chapter_links(pack: Pack, id: str) -> list[str]:
    return [pack.chapters[stem].link for stem, _ in pack.objectives_of(id)]


def heading(task: Task) -> str:
    return f"### {task.id} {task.title}"


def asked(pack: Pack, task: Task) -> list[str]:
    """Write what to ask the student."""
    advice = pack.advice.get(task.id)
    return [f"**Ask.** {advice.ask}", ""] if advice else []


def mistakes_page(pack: Pack) -> str:
    """Write the page with every mistake that the graders recognise."""
    lines = [MISTAKES_PAGE]
    for each in pack.sets:
        lines += [f"## {each.title}", ""]
        for task in each.tasks:
            lines += [heading(task), ""]
            kind = kind_of(task, pack.problems)
            lines += [f"{points_of(task.points)}, {kind}.", "", *asked(pack, task)]
            if task.written:
                rows: list[tuple[str, ...]] = [
                    (in_cell(did), in_cell(say)) for did, say in wrong_of(pack, task)
                ]
                lines += table(("The student writes", "What to say"), rows) if rows else []
            elif task.id in pack.problems:
                rows = [
                    (plain(m.name), plain(m.says), f"{m.marks * task.points:g}")
                    for m in pack.problems[task.id].misconceptions
                ]
                lines += table(("The mistake", "What the student reads", "Points"), rows)
    return "\n".join(lines)


def wrong_of(pack: Pack, task: Task) -> tuple[tuple[str, str], ...]:
    return pack.advice[task.id].wrong if task.id in pack.advice else ()


def rubric_page(pack: Pack) -> str:
    """Write the page with what earns points in the written answers."""
    lines = [RUBRIC_PAGE]
    for each in pack.sets:
        for task in (task for task in each.tasks if task.written):
            lines += [
                f"## {task.id} {task.title}",
                "",
                f"{each.title}. {points_of(task.points)}.",
                "",
            ]
            rubric = pack.advice[task.id].rubric if task.id in pack.advice else ()
            rows = [(f"{points:g}", in_cell(text)) for points, text in rubric]
            lines += table(("Points", "For"), rows)
    return "\n".join(lines)


PAGES = {
    "objectives.md": objectives_page,
    "mistakes.md": mistakes_page,
    "rubric.md": rubric_page,
}


# --- the command line ---------------------------------------------------------------------------


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; the result is the exit code."""
    parser = argparse.ArgumentParser(
        description="Write the generated pages of the instructor's pack: " + ", ".join(PAGES)
    )
    parser.add_argument(
        "--output", type=Path, default=TEACHING, metavar="FOLDER", help="write them there"
    )
    folder = parser.parse_args(arguments).output
    pack = read_pack()
    folder.mkdir(parents=True, exist_ok=True)
    for name, page in PAGES.items():
        store(page(pack), folder / name)
    mistakes = sum(len(problem.misconceptions) for problem in pack.problems.values())
    print(
        f"The instructor's pack: {len(pack.sets)} sets, {sum(1 for _ in pack.tasks)} problems, "
        f"{mistakes} mistakes with what to say"
    )
    if misfits := pack.misfits():
        print("The instructor's pack is not in order:", *misfits, sep="\n  ", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
