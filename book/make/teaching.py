"""Write the pages of the instructor's pack that are made from the problems and the chapters.

They are stored with the project, so that they can be read without a build.

What a program knows comes from it: the problems, their points and typical mistakes, what the
chapters promise. What only a teacher knows stands in ``book/nrdob_course/problems.toml``: what to
ask a student, what earns points where somebody reads the answer. The exit code is 1, and every
reason is listed, if the two do not fit together; the pages are written in any case.

    python book/make/teaching.py                     write the pages into book/teaching
    python book/make/teaching.py --output FOLDER     write them there
    python book/make/teaching.py --check             fail if a stored page is behind its source
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nbformat

import nrdob_course
from nrdob_course.exercises import PROBLEMS, Problem
from openings import PARTS, Chapter, read_chapter
from pages import NOTEBOOKS, TEACHING, options, render, same, store

COURSE = Path(nrdob_course.__file__).parent
SOURCE, ADVICE = COURSE / "sets" / "source", COURSE / "problems.toml"

GRADED = re.compile(r"(check|written)-(\d+)-(\d+)([a-z]?)")
SOLUTION = re.compile(r"### BEGIN SOLUTION\n(.*?)\s*### END SOLUTION", re.DOTALL)

PAGES = ("objectives.md", "mistakes.md", "rubric.md")


@dataclass(frozen=True)
class Rule:
    """How long a problem takes: what is read and written in a minute, and minutes for the rest.

    A line of code takes a minute, too. A step that must be found, and the checks of an answer, have
    two numbers: for a quick student and for a slow one.
    """

    words_read: int = 100
    words_written: int = 10
    step: tuple[int, int] = (2, 4)
    check: tuple[int, int] = (2, 4)


RULE = Rule()


# --- what there is ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Task:
    """A graded cell of a set, with the minutes that its text and its solution take to read, write.

    What has to be thought of in between is counted in steps, by hand: `Advice.steps`.
    """

    id: str
    title: str
    points: float
    written: bool
    reading: float
    writing: float


@dataclass(frozen=True)
class ProblemSet:
    """A notebook of problems."""

    name: str
    title: str
    tasks: tuple[Task, ...]

    @property
    def points(self) -> float:
        return sum(task.points for task in self.tasks)


@dataclass(frozen=True)
class Advice:
    """What a teacher knows about a problem.

    `trains` names objectives: the chapter, and how the objective begins. `steps` are the thoughts
    that a solution takes.
    """

    ask: str
    steps: int
    trains: Sequence[tuple[str, str]]
    rubric: Sequence[tuple[float, str]] = ()
    wrong: Sequence[tuple[str, str]] = ()


def read_set(path: Path) -> ProblemSet:
    """Read titles, points and times of a set."""
    cells = nbformat.read(path, as_version=4).cells
    text = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    headings = dict(re.findall(r"^## (\d+\.\d+) (.+)$", text, re.MULTILINE))
    title = re.search(r"^# (.+)$", text, re.MULTILINE)
    tasks = []
    for cell in cells:
        kind = cell.metadata.get("nbgrader", {})
        if kind.get("grade") and (name := GRADED.fullmatch(kind["grade_id"])):
            number = f"{name[2]}.{name[3]}"
            of_task = [each for each in cells if _number(each) == number + name[4]]
            read = " ".join(each.source for each in of_task if each.id.startswith("task-"))
            task = Task(
                number + name[4],
                headings.get(number, ""),
                kind["points"],
                name[1] == "written",
                len(read.split()) / RULE.words_read,
                _writing(of_task),
            )
            tasks.append(task)
    return ProblemSet(path.stem, title[1] if title else path.stem, tuple(tasks))


def _number(cell: Any) -> str:
    """Give the problem that a cell belongs to, "2.4" for answer-2-4."""
    found = re.fullmatch(r"[a-z]+-(\d+)-(\d+[a-z]?)", cell.id)
    return f"{found[1]}.{found[2]}" if found else ""


def _writing(cells: Sequence[Any]) -> float:
    """Give the minutes that it takes to write the solution down, once it is known."""
    minutes = 0.0
    for cell in cells:
        for solution in SOLUTION.findall(cell.source):
            if cell.cell_type == "markdown":
                minutes += len(solution.split()) / RULE.words_written
            else:
                minutes += len(re.findall(r"^\s*[^\s#]", solution, re.MULTILINE))
    return minutes


def read_advice() -> dict[str, Advice]:
    """Read what teachers know."""
    entries = tomllib.loads(ADVICE.read_text("utf-8"))
    for entry in entries.values():
        entry["trains"] = [text.partition(": ")[::2] for text in entry["trains"]]
    return {id: Advice(**entry) for id, entry in entries.items()}


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
        told = [f"{id}: posed in no set" for id in self.problems if id not in tasks]
        told += [f"{id}: not in {ADVICE.name}" for id in tasks if id not in self.advice]
        told += [
            f"{id}: in {ADVICE.name}, and no such problem" for id in self.advice if id not in tasks
        ]
        for id, advice in self.advice.items():
            for stem, begins in advice.trains:
                chapter = self.chapters.get(stem)
                found = [o for o in chapter.objectives if o.startswith(begins)] if chapter else []
                if len(found) != 1:
                    told.append(f"{id}: {stem} has {len(found)} objectives that begin {begins!r}")
        for id, task in tasks.items():
            given = sum(points for points, _ in self.rubric_of(task))
            if task.written and given != task.points:
                told.append(f"{id}: the rubric does not give the {task.points:g} points of the set")
        return told

    # What the pages ask for.

    @property
    def parts(self) -> dict[str, list[Chapter]]:
        """The chapters of each part of the book."""
        return {
            part: [chapter for chapter in self.chapters.values() if chapter.number in numbers]
            for part, numbers in PARTS.items()
        }

    def problems_for(self, stem: str, objective: str) -> list[str]:
        """Name the problems that practise an objective of a chapter."""
        return [task.id for task in self.tasks if (stem, objective) in self.objectives_of(task.id)]

    def chapters_of(self, task: Task) -> list[Chapter]:
        """Give the chapters that a problem belongs to."""
        stems = dict.fromkeys(stem for stem, _ in self.objectives_of(task.id))
        return [self.chapters[stem] for stem in stems]

    def kind_of(self, task: Task) -> str:
        """Tell how a problem is judged."""
        if task.written:
            return "by hand"
        own = task.id in self.problems and self.problems[task.id].own
        return "checked, own plant" if own else "checked"

    def minutes_of(self, task: Task) -> tuple[float, float]:
        """Give the minutes that a problem takes a quick student, and a slow one."""
        steps = self.advice[task.id].steps if task.id in self.advice else 0
        fixed = task.reading + task.writing
        quick, slow = (
            fixed + steps * step + (0 if task.written else check)
            for step, check in zip(RULE.step, RULE.check, strict=True)
        )
        return quick, slow

    def hours_of(self, tasks: Iterable[Task]) -> tuple[float, float]:
        """Give the hours that problems take together, to a quarter."""
        quick, slow = map(sum, zip(*map(self.minutes_of, tasks), strict=True))
        return round(quick / 15) / 4, round(slow / 15) / 4

    def rubric_of(self, task: Task) -> Sequence[tuple[float, str]]:
        """Give what earns points in a written answer."""
        return self.advice[task.id].rubric if task.id in self.advice else ()


def read_pack() -> Pack:
    """Read everything where it is, in its order."""
    chapters = {path.stem: read_chapter(path) for path in sorted(NOTEBOOKS.glob("*.ipynb"))}
    sets = [read_set(path) for path in sorted(SOURCE.glob("set*/set*.ipynb"))]
    return Pack(chapters, sets, read_advice(), PROBLEMS)


# --- the command line ---------------------------------------------------------------------------


def main(arguments: list[str] | None = None) -> int:
    given = options(__doc__, arguments, check=True, output=TEACHING)
    pack = read_pack()
    made = {name: render(name, pack=pack, rule=RULE) for name in PAGES}
    if given.check:
        behind = [name for name in PAGES if not same(made[name], given.output / name)]
        if behind:
            print("Behind their source:", *behind, "- make pages writes them", file=sys.stderr)
        return 1 if behind else 0
    given.output.mkdir(parents=True, exist_ok=True)
    for name, text in made.items():
        store(text, given.output / name)
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
