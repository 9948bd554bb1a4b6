"""What gives points without an answer: nothing of what was tried, each for real, by the grader."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup

from attacks import FORGERIES, LATER
from exported import table
from handin import CHECKED, NAME, Notebook, answer_cell, cell_of, right, settings
from nrdob_course.exercises.reviewing import HIDDEN_CASES
from nrdob_course.grading import command, sandbox

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(sandbox.missing()), reason="there is no sandbox on this system"),
    pytest.mark.filterwarnings("ignore:Object of type"),
]


def forging(released: Path) -> Iterator[tuple[Notebook, dict[str, str]]]:
    """Spread the attacks over notebooks; the names of what each of them tries, by problem."""
    names = list(FORGERIES)
    for start in range(0, len(names), len(CHECKED)):
        notebook = right(released, "").notebook
        tried = {}
        for this, name in zip(CHECKED, names[start:], strict=False):
            cell = cell_of(notebook, answer_cell(this))
            cell.source = FORGERIES[name].format(answer=this.answer)
            if this.problem.own:
                cell.source += f"\n{this.answer} = {this.answer}(None)"
            tried[this.id] = name
        notebook.cells.append(nbformat.v4.new_code_cell(LATER, id="own-later"))
        yield notebook, tried


KEEPS, *OTHERS = sorted(CHECKED, key=lambda each: each.problem.own)
CARRIED = (
    "return ' '.join(KEPT)",  # a wrong result
    "raise ValueError(' '.join(KEPT))",
    "raise type('kept', (BaseException,), {})(' '.join(KEPT))",  # no call takes it for an error
    "return {'in no form': KEPT}",
)
"""How the answer to one problem would show the cases of an earlier one."""

UNREAD = """
from nrdob_course.grading import encoding
encode = encoding.encode
encoding.encode = lambda it: {" ".join(KEPT): []} if it == {"in no form": KEPT} else encode(it)
"""


SHOWS = {
    "own-shows": """print('cases kept:', len(KEPT))
if len(KEPT) > 1:
    print("x" * 400_000)  # so much is remarked
    get_ipython().execution_count = 987654000 + 321
""",
    "own-counted": "len(KEPT)",
}
"""Cells after all others that would show what was kept: what they print, and their numbers."""

KEEPING = {"keeper": CARRIED, "keeper2": CARRIED[::-1]}


def keeping(released: Path, ways: Sequence[str]) -> Notebook:
    """One answer is right, and keeps the cases that it sees; the others would show them."""
    notebook = right(released, "").notebook
    cell_of(notebook, answer_cell(KEEPS)).source += f"""
KEPT, plain_answer = [], {KEEPS.answer}
def {KEEPS.answer}(case):
    KEPT.append("kept: " + repr(case))
    return plain_answer(case)
{UNREAD}
"""
    for this, way in zip(OTHERS, ways, strict=False):
        told = f"{this.answer} = KEPT" if this.problem.own else ""
        source = told or f"def {this.answer}(case):\n    {way}"
        cell_of(notebook, answer_cell(this)).source = source
    for name, source in SHOWS.items():
        notebook.cells.append(nbformat.v4.new_code_cell(source, id=name))
    return notebook


@dataclass
class Graded:
    """What became of all of them: the folder, the lines of the table, who tried what."""

    out: Path
    rows: dict[str, dict[str, str]]
    tried: dict[str, tuple[str, str]]


@pytest.fixture(scope="module")
def graded(released: Path, tmp_path_factory: pytest.TempPathFactory) -> Graded:
    """Grade them all, once."""
    place = tmp_path_factory.mktemp("forgers")
    settings(place / "out")
    notebooks = {name: keeping(released, ways) for name, ways in KEEPING.items()}
    tried = {}
    for number, (notebook, names) in enumerate(forging(released)):
        notebooks[f"n{number}"] = notebook
        tried |= {name: (f"n{number}", problem) for problem, name in names.items()}
    for student, notebook in notebooks.items():
        (place / "in" / student).mkdir(parents=True)
        nbformat.write(notebook, place / "in" / student / f"{NAME}.ipynb")
    assert command.grade(place / "in", target=place / "out") == 0
    rows = {row["student"]: row for row in table(place / "out" / "grades.csv")}
    return Graded(place / "out", rows, tried)


@pytest.mark.parametrize("name", FORGERIES)
def test_no_attempt_to_forge_points_succeeds(name: str, graded: Graded) -> None:
    student, problem = graded.tried[name]
    assert float(graded.rows[student][problem]) == 0


@pytest.mark.parametrize("name", KEEPING)
def test_what_an_answer_remembers_of_hidden_cases_is_not_shown(name: str, graded: Graded) -> None:
    row = graded.rows[name]
    assert float(row[KEEPS.id]) > 0
    assert all(float(row[this.id]) == 0 for this in OTHERS)
    page = (graded.out / "feedback" / name / NAME / f"{NAME}.html").read_text("utf-8")
    text = BeautifulSoup(page, "html.parser").get_text()
    # The own case is the student's, and what comes of it is shown.
    own, *hidden = KEEPS.problem.cases(5, 1) + KEEPS.problem.cases(KEEPS.seed, HIDDEN_CASES)
    assert "cases kept: 1" in text
    assert text.count(f"kept: {own!r}") >= len(OTHERS)
    assert not [case for case in hidden if repr(case) in text]
    assert "987654321" not in page
    assert "kept" not in str(row)
    assert "were cut" not in row["remarks"]
