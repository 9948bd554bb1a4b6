"""Points in tables: from nbgrader's gradebook to CSV files.

``grades.csv`` has a line for each student and set, ``course.csv`` one for each student; Moodle and
Canvas import ``moodle_set1.csv`` and ``canvas.csv``. What the gradebook does not know (remarks, the
group, what could not be graded) is kept beside it.
"""

import csv
import json
import re
import secrets
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from nbgrader.api import Gradebook, MissingEntry

from .batch import Outcome
from .feedback import with_note
from .platforms import pack
from .roster import Course
from .submissions import NOTHING, Submission

__all__ = [
    "Line", "Record", "Records", "comment_of", "enter", "grades_of", "harmless", "in_order",
    "lines", "number", "pack_feedback", "page_of", "place_of", "problem_of", "tell_late",
    "unmarked", "write_course", "write_grades", "write_platforms", "write_table",
]  # fmt: skip

GRADED_CELL = re.compile(r"(?:check|written)-(\d+)-(\w+)")
FORMULA = re.compile(r"\s*[=+@|-](?![\d.,\s]*$)|[\t\r]")
"""What a spreadsheet would compute, where a student has written it."""

SHARED = "the same group in "

Record = dict[str, Any]


def problem_of(cell: str) -> str:
    """Give the problem that a graded cell belongs to: "check-2-1" is for 2.1."""
    match = GRADED_CELL.fullmatch(cell)
    return f"{match[1]}.{match[2]}" if match else cell


def in_order(name: str) -> list[Any]:
    """Sort problems and sets by their numbers, others after them."""
    return [int(part) if k % 2 else part for k, part in enumerate(re.split(r"(\d+)", name))]


def number(points: float | None) -> str:
    """Write points as people do; empty if there are none yet."""
    return "" if points is None else f"{round(points, 3):g}"


# --- what the gradebook does not know -----------------------------------------------------------


class Records:
    """Who handed in what, and what there was to remark; one entry for student and set."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            text = path.read_text("utf-8") if path.exists() else "[]"
            self.entries: list[Record] = json.loads(text)
        except ValueError as error:
            raise ValueError(f"{path.name} cannot be read: {error}") from None

    def folder_of(self, student: str) -> str:
        """Name a student's folder: no pattern to nbgrader, allowed everywhere, and unique."""
        for entry in self.entries:
            if entry["student"] == student:
                return str(entry["folder"])
        taken = {entry["folder"].lower() for entry in self.entries}
        base = re.sub(r"[^\w.@-]+", "_", student).strip("._") or "student"
        names = (base, *(f"{base}-{count}" for count in range(2, len(taken) + 2)))
        return next(name for name in names if name.lower() not in taken)

    def code_of(self, student: str) -> str:
        """Give what stands for a student's name where answers are marked blindly."""
        codes = {entry["student"]: entry.get("code") for entry in self.entries}
        code = codes.get(student)
        while not code or (student not in codes and code in codes.values()):
            code = "".join(secrets.choice("BCDFGHJKLMNPQRSTVWXZ") for _ in range(4))
        return str(code)

    def add(self, submission: Submission, reason: str = "", seconds: float = 0.0) -> Record:
        """Enter a submission, in the place of an earlier one of the same student and set."""
        entry = {
            "student": submission.student,
            "folder": self.folder_of(submission.student),
            "set": submission.set,
            "group": submission.group,
            "remarks": submission.remarks,
            "reason": reason,
            "platform": submission.owner.platform,
            "identifier": submission.owner.identifier,
            "back": submission.owner.back,
            "handed in": submission.handed_in.isoformat() if submission.handed_in else "",
            "seconds": round(seconds, 1),
            "code": self.code_of(submission.student),
        }
        key = (submission.student, submission.set)
        others = [old for old in self.entries if (old["student"], old["set"]) != key]
        self.entries = sorted([*others, entry], key=lambda e: (e["student"], e["set"]))
        return entry

    def graded(self, submission: Submission) -> bool:
        """Tell whether a student's set was graded earlier."""
        key = (submission.student, submission.set)
        return any((e["student"], e["set"]) == key and not e["reason"] for e in self.entries)

    def remark_shared_groups(self, course: Course) -> None:
        """Remark a group's number in the notebooks of several, unless the roster has it so."""
        holders: dict[tuple[str, int], list[Record]] = {}
        for entry in self.entries:
            entry["remarks"] = [r for r in entry["remarks"] if not r.startswith(SHARED)]
            if not entry["reason"] and entry["group"] is not None:
                known = course.find(entry["student"], entry.get("identifier", ""))
                if known is None or known.group != entry["group"]:
                    holders.setdefault((entry["set"], entry["group"]), []).append(entry)
        for (_, group), entries in holders.items():
            for entry in entries if len(entries) > 1 else ():
                entry["remarks"].append(f"{SHARED}{len(entries)} notebooks: group {group}")

    def save(self) -> None:
        """Store the entries beside the gradebook."""
        new = self.path.with_suffix(".new")
        new.write_text(json.dumps(self.entries, indent=1, ensure_ascii=False) + "\n", "utf-8")
        new.replace(self.path)


# --- the gradebook ------------------------------------------------------------------------------


def enter(gradebook: Gradebook, folder: str, outcome: Outcome) -> None:
    """Enter what was graded automatically; marks given by hand stay."""
    name = outcome.submission.set
    gradebook.update_or_create_student(folder)
    gradebook.update_or_create_submission(name, folder)
    for cell, points in outcome.grades.items():
        grade = gradebook.find_grade(cell, name, name, folder)
        grade.auto_score = points
        grade.needs_manual_grade = points is None or grade.manual_score is not None
    for cell, comment in outcome.comments.items():
        gradebook.find_comment(cell, name, name, folder).auto_comment = comment
    gradebook.db.commit()


def grades_of(gradebook: Gradebook, entry: Record) -> list[Any]:
    """Give nbgrader's grades of a submission, in the order of the problems."""
    if entry["reason"]:
        return []
    try:
        notebook = gradebook.find_submission_notebook(entry["set"], entry["set"], entry["folder"])
    except MissingEntry:
        return []
    return sorted(notebook.grades, key=lambda grade: in_order(problem_of(grade.name)))


def comment_of(gradebook: Gradebook, entry: Record, grade: Any) -> Any:
    """Give nbgrader's comment on what a grade is for."""
    return gradebook.find_comment(grade.name, entry["set"], entry["set"], entry["folder"])


def unmarked(grade: Any) -> bool:
    """Tell whether somebody has to read an answer, and nobody has done so yet."""
    return grade.auto_score is None and grade.manual_score is None


# --- the tables ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Line:
    """What a student has for a set, after what being late costs."""

    entry: Record
    grades: list[Any]
    days: int
    share: float

    @property
    def before(self) -> float:
        """Points, without those that nobody has given yet, as if it had come in time."""
        return float(sum(grade.score for grade in self.grades))

    @property
    def earned(self) -> float:
        """Points, without those that nobody has given yet."""
        return self.before * self.share

    @property
    def most(self) -> float:
        """Points that there are."""
        return float(sum(grade.max_score for grade in self.grades))

    @property
    def open(self) -> list[str]:
        """Problems that nobody has marked yet."""
        return [problem_of(grade.name) for grade in self.grades if unmarked(grade)]

    @property
    def late(self) -> str:
        """Say how late it was, and what that costs."""
        if not self.days:
            return ""
        cost = f", −{number(100 * (1 - self.share))} %" if self.share < 1 else ""
        return f"{self.days} d{cost}"


def lines(gradebook: Gradebook, records: Records, course: Course) -> list[Line]:
    """Give a line for each student and set."""
    found = []
    for entry in records.entries:
        moment = datetime.fromisoformat(when) if (when := entry.get("handed in")) else None
        days = course.days_late(entry["set"], entry["student"], moment)
        grades = grades_of(gradebook, entry)
        found.append(Line(entry, grades, days if grades else 0, course.share(days)))
    return found


def tell_late(folder: Path, found: Iterable[Line], course: Course) -> None:
    """Say in the feedback of what came late what that costs; and no more where it did not."""
    for line in found:
        page = folder / page_of(line.entry)
        if page.exists():
            text = page.read_text("utf-8")
            told = with_note(text, why_less(line, course) if line.days else "")
            if told != text:
                page.write_text(told, "utf-8")


def why_less(line: Line, course: Course) -> str:
    """Say when it was due and came, the rule, and the points before and after it."""
    name, student = line.entry["set"], line.entry["student"]
    due, came = course.due(name, student), datetime.fromisoformat(line.entry["handed in"])
    days = "1 day" if line.days == 1 else f"{line.days} days"
    so_far = " so far" if line.open else ""
    return (
        f"This came late. It was due {due:%Y-%m-%d at %H:%M} and came {came:%Y-%m-%d at %H:%M}, "
        f"which counts as {days}. The rule: {course.rule}. Points{so_far} before the rule: "
        f"{number(line.before)} of {number(line.most)}; after it: {number(line.earned)}."
    )


def place_of(entry: Record, step: str = "submitted", kind: str = "ipynb") -> str:
    """Give the place of a notebook, or of a page made of it, in the folder of the course."""
    return f"{step}/{entry['folder']}/{entry['set']}/{entry['set']}.{kind}"


def page_of(entry: Record) -> str:
    """Give the place of a feedback page, in the folder of the course."""
    return place_of(entry, "feedback", "html")


def write_grades(path: Path, found: list[Line]) -> None:
    """Write a line for each student and set."""
    rows, problems = [], set()
    for line in found:
        entry = line.entry
        refused = [f"not graded: {entry['reason']}"] if entry["reason"] else []
        row = {
            "student": entry["student"],
            "set": entry["set"],
            "group": "" if entry["group"] is None else entry["group"],
            "to mark by hand": " ".join(line.open),
            "late": line.late,
            "remarks": "; ".join([*refused, *entry["remarks"]]),
        }
        if not refused:
            row["total"], row["max"] = number(line.earned), number(line.most)
        for grade in line.grades:
            row[problem_of(grade.name)] = "" if unmarked(grade) else number(grade.score)
            problems.add(problem_of(grade.name))
        rows.append(row)
    columns = ["student", "set", "group", *sorted(problems, key=in_order)]
    write_table(path, [*columns, "to mark by hand", "late", "total", "max", "remarks"], rows)


def by_student(found: list[Line], course: Course) -> dict[str, dict[str, Line]]:
    """Give the lines of each student by set; those on the roster who have none, too."""
    students: dict[str, dict[str, Line]] = {course.called(each): {} for each in course.students}
    for line in found:
        known = course.find(line.entry["student"], line.entry.get("identifier", ""))
        name = course.called(known) if known else line.entry["student"]
        students.setdefault(name, {})[line.entry["set"]] = line
    return dict(sorted(students.items()))


def write_course(path: Path, found: list[Line], course: Course) -> None:
    """Write a line for each student: the points of every set, and all together."""
    sets = sorted({line.entry["set"] for line in found if line.grades}, key=in_order)
    most = {name: max(line.most for line in found if line.entry["set"] == name) for name in sets}
    rows = []
    for name, mine in by_student(found, course).items():
        graded = {each: line for each, line in mine.items() if line.grades}
        reasons = {each: line.entry["reason"] for each, line in mine.items()}
        known = course.find(name)
        row: dict[str, Any] = {each: number(line.earned) for each, line in graded.items()}
        row["student"], row["id"] = name, known.identifier if known else ""
        row["group"] = known.group if known and known.group is not None else ""
        row["total"] = number(sum(line.earned for line in graded.values()))
        row["max"] = number(sum(most.values()))
        row["not handed in"] = " ".join(n for n in sets if reasons.get(n, NOTHING) == NOTHING)
        row["not graded"] = " ".join(n for n in mine if reasons[n] not in ("", NOTHING))
        row["to mark by hand"] = " ".join(p for line in graded.values() for p in line.open)
        rows.append(row)
    columns = ["student", "id", "group", *sets, "total", "max"]
    write_table(path, [*columns, "not handed in", "not graded", "to mark by hand"], rows)


CANVAS = ("Student", "ID", "SIS User ID", "SIS Login ID", "Section")


def write_platforms(folder: Path, found: list[Line], course: Course) -> None:
    """Write what Moodle and Canvas import; points that are not final yet are left blank."""
    graded = [line for line in found if line.grades]
    sets = sorted({line.entry["set"] for line in graded}, key=in_order)
    for name in sets:
        rows = [
            {
                "Identifier": f"Participant {line.entry['identifier']}",
                "Full name": line.entry["student"],
                "Grade": _final(line),
                "Maximum Grade": number(line.most),
                "Last modified (grade)": "-",
                "Feedback comments": f"late: {line.late}" if line.late else "",
            }
            for line in graded
            if line.entry["set"] == name and line.entry.get("platform") == "moodle"
        ]
        if rows:
            write_table(folder / f"moodle_{name}.csv", list(rows[0]), rows)
    students = by_student(graded, course)
    canvas = [
        _canvas_row(student, mine, course)
        for student, mine in students.items()
        if any(line.entry.get("platform") == "canvas" for line in mine.values())
    ]
    if canvas:
        most = {line.entry["set"]: number(line.most) for line in graded}
        possible = {"Student": "    Points Possible", **most}
        write_table(folder / "canvas.csv", [*CANVAS, *sets], [possible, *canvas])


def pack_feedback(folder: Path, found: Iterable[Line]) -> None:
    """Pack the feedback as Moodle and Canvas take it: under the names of what was handed in.

    Moodle reads name and number in the folder's name, Canvas the two numbers in the file's.
    """
    archives: dict[Path, dict[str, Path]] = {}
    for line in found:
        entry, page = line.entry, folder / page_of(line.entry)
        name, platform, back = entry["set"], entry.get("platform"), entry.get("back")
        if line.grades and platform and back and page.exists():
            member = f"{back}/{name}.html" if platform == "moodle" else f"{back}.html"
            archive = folder / f"{platform}_feedback_{name}.zip"
            archives.setdefault(archive, {})[member] = page
    for archive, members in archives.items():
        pack(archive, members)


def _canvas_row(student: str, mine: Mapping[str, Line], course: Course) -> dict[str, str]:
    known = course.find(student)
    row = {column: known.row.get(column, "") for column in CANVAS} if known else {}
    numbers = [line.entry["identifier"] for line in mine.values() if line.entry["identifier"]]
    row.update(Student=row.get("Student") or student, ID=row.get("ID") or numbers[0])
    return {**row, **{name: _final(line) for name, line in mine.items()}}


def _final(line: Line) -> str:
    return "" if line.open else number(line.earned)


def write_table(path: Path, columns: list[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """Write a table as CSV, with Unix line ends; no cell is a formula to a spreadsheet."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, columns, restval="", lineterminator="\n")
        table.writeheader()
        for row in rows:
            table.writerow({column: harmless(value) for column, value in row.items()})


def harmless(value: Any) -> Any:
    """Write a text so that no spreadsheet computes it.

    >>> harmless("=HYPERLINK(1)"), harmless("-2.5"), harmless("anna")
    ("'=HYPERLINK(1)", '-2.5', 'anna')
    """
    return f"'{value}" if isinstance(value, str) and FORMULA.match(value) else value
