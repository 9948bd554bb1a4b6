"""Giving out: what students get, and what they must not."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest

from handin import CHECKED, PATH
from nrdob_course.grading import command as exercises
from nrdob_course.grading.release import solved
from problemsets import SETS, SOURCE, cells, nbgrader, posed

# nbgrader gives out every set; it quarrels with its own database.
pytestmark = [pytest.mark.thorough, pytest.mark.filterwarnings("ignore:Object of type")]


@pytest.fixture(scope="module")
def released(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Release every set, twice."""
    for name in ("first", "second"):
        folder = tmp_path_factory.getbasetemp() / name
        names = [path.stem for path in SETS]
        exercises.release(names, SOURCE, folder, solutions=False)
    return tmp_path_factory.getbasetemp() / "first" / "release"


def test_releasing_twice_gives_the_same_bytes(released: Path) -> None:
    files = [path.relative_to(released) for path in released.rglob("*") if path.is_file()]
    assert {path.suffix for path in files} >= {".ipynb", ".zip"}
    again = released.parent.parent / "second" / "release"
    for file in files:
        assert (released / file).read_bytes() == (again / file).read_bytes(), file


@pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
def test_the_release_holds_neither_solutions_nor_hidden_tests(path: Path, released: Path) -> None:
    text = (released / path.stem / path.name).read_text("utf-8")
    assert not re.search("SOLUTION|HIDDEN|seed=", text)
    for this in posed(path):
        assert str(this.seed) not in text
    given_out = {cell.id: cell for cell in nbformat.reads(text, as_version=4).cells}
    for cell in cells(path):
        if nbgrader(cell).get("solution"):
            inside = cell.source.split("BEGIN SOLUTION")[1].split("END SOLUTION")[0]
            lines = [line for line in inside.splitlines() if len(line.strip()) > 25]
            assert not [line for line in lines if line in given_out[cell.id].source]
            assert re.search("YOUR (CODE|ANSWER) HERE", given_out[cell.id].source)
    assert [cell.id for cell in cells(path)] == list(given_out)
    assert not any(cell.get("outputs") for cell in given_out.values())


def test_the_solutions_run_and_hold_no_hidden_tests() -> None:
    text = solved(PATH)
    assert "HIDDEN" not in text and "BEGIN SOLUTION" not in text
    assert str(CHECKED[0].seed) not in text
    outputs = str([cell.get("outputs") for cell in nbformat.reads(text, as_version=4).cells])
    for this in CHECKED:
        assert this.problem.praise in outputs


def test_an_unknown_set_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert exercises.main(["release", "99"]) == 2
    assert "there is no set99; there are" in capsys.readouterr().err
