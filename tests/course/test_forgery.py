"""What gives points without an answer: nothing of what was tried, each for real, by the grader."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup

from attacks import FORGERIES, LATER
from exported import table
from handin import CHECKED, NAME, Notebook, answer_cell, cell_of, right, settings
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


KEEPS, RAISES = [each for each in CHECKED if not each.problem.own][:2]


def keeping(released: Path) -> Notebook:
    """One answer is right, keeps the cases that it sees, and would show them at the end.

    Another one would show them by what ends it, which no call takes for an error.
    """
    notebook = right(released, "").notebook
    cell_of(notebook, answer_cell(KEEPS)).source += f"""
KEPT, plain_answer = [], {KEEPS.answer}
def {KEEPS.answer}(case):
    KEPT.append(case)
    return plain_answer(case)
"""
    cell_of(notebook, answer_cell(RAISES)).source += f"""
def {RAISES.answer}(case, plain_answer={RAISES.answer}, seen=[]):
    seen.append(case)
    if len(seen) > 1:
        raise type("kept", (BaseException,), {{}})("kept: " + repr(case))
    return plain_answer(case)
"""
    shows = nbformat.v4.new_code_cell("print('cases kept:', len(KEPT))", id="own-shows")
    notebook.cells.append(shows)
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
    notebooks, tried = {"keeps": keeping(released)}, {}
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


def test_what_an_answer_remembers_of_hidden_cases_is_not_shown(graded: Graded) -> None:
    assert float(graded.rows["keeps"][KEEPS.id]) > 0
    page = (graded.out / "feedback" / "keeps" / NAME / f"{NAME}.html").read_text("utf-8")
    assert "cases kept: 0" in page
    assert float(graded.rows["keeps"][RAISES.id]) == 0
    assert "Error: it ended the call of the answer" in page
    text = BeautifulSoup(page, "html.parser").get_text()
    assert "kept: " + repr(RAISES.problem.cases(RAISES.seed, 1)[0])[:20] not in text
