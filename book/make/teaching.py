"""Write the pages of the instructor's pack that are made from the problems and the chapters.

They are stored with the project, so that they can be read without a build.

What a program knows comes from it: the problems, their points and typical mistakes, what the
chapters promise. What only a teacher knows stands in ``book/nrdob_course/problems.toml``: what to
ask a student, what earns points where somebody reads the answer. The exit code is 1, and every
reason is listed, if the two do not fit together; the pages are written in any case.
"""

import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import nbformat

import nrdob_course
from nrdob_course.exercises import PROBLEMS, Problem
from openings import PARTS, Chapter, read_chapters
from pages import NOTEBOOKS, TEACHING, keep, options, render, report

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


class Task(NamedTuple):
    """A graded cell of a set, with the minutes that its text and its solution take to read, write.

    What has to be thought of in between is counted in steps, by hand: `Advice.steps`.
    """

    id: str
    title: str
    points: float
    written: bool
    reading: float
    writing: float


class ProblemSet(NamedTuple):
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

    ask: str = ""
    steps: int = 0
    trains: Sequence[tuple[str, str]] = ()
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
            own = re.compile(rf"[a-z]+-{name[2]}-{name[3]}{name[4]}")
            of_task = [each for each in cells if own.fullmatch(each.id)]
            read = " ".join(each.source for each in of_task if each.id.startswith("task-"))
            minutes = len(read.split()) / RULE.words_read, sum(map(_writing, of_task))
            task = number + name[4], headings.get(number, ""), kind["points"], name[1] == "written"
            tasks.append(Task(*task, *minutes))
    return ProblemSet(path.stem, title[1] if title else path.stem, tuple(tasks))


def _writing(cell: Any) -> float:
    """Give the minutes that it takes to write a solution down, once it is known."""
    solution = "\n".join(SOLUTION.findall(cell.source))
    if cell.cell_type == "markdown":
        return len(solution.split()) / RULE.words_written
    return len(re.findall(r"^\s*[^\s#]", solution, re.MULTILINE))


def read_advice() -> dict[str, Advice]:
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

    def advice_on(self, id: str) -> Advice:
        """Give what a teacher knows about a problem, which may be nothing."""
        return self.advice.get(id, Advice())

    def objectives_of(self, id: str) -> list[tuple[str, str]]:
        """Give chapter and objective for all that a problem trains, as far as they exist."""
        trained = self.advice_on(id).trains
        return [(stem, each) for stem, begins in trained for each in self.promised(stem, begins)]

    def promised(self, stem: str, begins: str) -> list[str]:
        """Give the objectives of a chapter that begin like this."""
        chapter = self.chapters.get(stem)
        return [each for each in chapter.objectives if each.startswith(begins)] if chapter else []

    def misfits(self) -> list[str]:
        """Tell where problems, chapters and advice do not fit together."""
        tasks = {task.id: task for task in self.tasks}
        told = [f"{id}: posed in no set" for id in self.problems if id not in tasks]
        told += [f"{id}: not in {ADVICE.name}" for id in tasks if id not in self.advice]
        told += [
            f"{id}: in {ADVICE.name}, and no such problem" for id in self.advice if id not in tasks
        ]
        told += [
            f"{id}: {stem} has {count} objectives that begin {begins!r}"
            for id, advice in self.advice.items()
            for stem, begins in advice.trains
            if (count := len(self.promised(stem, begins))) != 1
        ]
        for id, task in tasks.items():
            given = sum(points for points, _ in self.advice_on(id).rubric)
            if task.written and given != task.points:
                told.append(f"{id}: the rubric does not give the {task.points:g} points of the set")
        return told

    # What the pages ask for.

    @property
    def parts(self) -> dict[str, list[Chapter]]:
        """The chapters of each part of the book."""
        chapters = self.chapters.values()
        return {part: [c for c in chapters if c.number in of] for part, of in PARTS.items()}

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
        steps = self.advice_on(task.id).steps
        quick, slow = (
            task.reading + task.writing + steps * step + (0 if task.written else check)
            for step, check in zip(RULE.step, RULE.check, strict=True)
        )
        return quick, slow

    def hours_of(self, tasks: Iterable[Task]) -> tuple[float, float]:
        """Give the hours that problems take together, to a quarter."""
        quick, slow = map(sum, zip(*map(self.minutes_of, tasks), strict=True))
        return round(quick / 15) / 4, round(slow / 15) / 4


def read_pack() -> Pack:
    """Read everything where it is, in its order."""
    chapters = {chapter.stem: chapter for chapter in read_chapters(NOTEBOOKS)}
    sets = [read_set(path) for path in sorted(SOURCE.glob("set*/set*.ipynb"))]
    return Pack(chapters, sets, read_advice(), PROBLEMS)


def main(arguments: list[str] | None = None) -> int:
    given = options(__doc__, arguments, check=True, output=TEACHING)
    pack = read_pack()
    made = {given.output / name: render(name, pack=pack, rule=RULE) for name in PAGES}
    behind = keep(made, check=given.check)
    if given.check:
        return behind
    mistakes = sum(len(problem.misconceptions) for problem in pack.problems.values())
    print(
        f"The instructor's pack: {len(pack.sets)} sets, {sum(1 for _ in pack.tasks)} problems, "
        f"{mistakes} mistakes with what to say"
    )
    return report("The instructor's pack", pack.misfits())


if __name__ == "__main__":
    sys.exit(main())
