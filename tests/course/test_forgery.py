"""What gives points without an answer: nothing of what was tried, each for real, by the grader."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import nbformat
import pytest

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


@pytest.fixture(scope="module")
def earned(released: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, float]:
    """What each attack got."""
    place = tmp_path_factory.mktemp("forgers")
    settings(place / "out")
    tried = {}
    for number, (notebook, names) in enumerate(forging(released)):
        (place / "in" / f"n{number}").mkdir(parents=True)
        nbformat.write(notebook, place / "in" / f"n{number}" / f"{NAME}.ipynb")
        tried[f"n{number}"] = names
    assert command.grade(place / "in", target=place / "out") == 0
    rows = {row["student"]: row for row in table(place / "out" / "grades.csv")}
    return {
        name: float(rows[student][problem])
        for student, names in tried.items()
        for problem, name in names.items()
    }


@pytest.mark.parametrize("name", FORGERIES)
def test_no_attempt_to_forge_points_succeeds(name: str, earned: dict[str, float]) -> None:
    assert earned[name] == 0


def test_what_an_answer_remembers_of_hidden_cases_is_not_shown(released, tmp_path):
    notebook = right(released, "").notebook
    this = next(each for each in CHECKED if not each.problem.own)
    cell = cell_of(notebook, answer_cell(this))
    cell.source += f"""
KEPT, plain_answer = [], {this.answer}
def {this.answer}(case):
    KEPT.append(case)
    return plain_answer(case)
"""
    shows = nbformat.v4.new_code_cell("print('cases kept:', len(KEPT))", id="own-shows")
    notebook.cells.append(shows)
    settings(tmp_path / "out")
    (tmp_path / "in" / "anna").mkdir(parents=True)
    nbformat.write(notebook, tmp_path / "in" / "anna" / f"{NAME}.ipynb")
    assert command.grade(tmp_path / "in", target=tmp_path / "out") == 0
    (row,) = table(tmp_path / "out" / "grades.csv")
    assert float(row[this.id]) > 0
    page = (tmp_path / "out" / "feedback" / "anna" / NAME / f"{NAME}.html").read_text("utf-8")
    assert "cases kept: 0" in page
