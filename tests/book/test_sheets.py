"""Sets, solutions and boards on paper: complete, apart from each other, and without a script."""

from __future__ import annotations

import re
from copy import copy
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup

import paper
from teaching import SOLUTION, read_pack

PACK = read_pack()
SETS = [each.name for each in PACK.sets]

each_set = pytest.mark.parametrize("name", SETS)

# Every set is printed.
pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, BeautifulSoup]:
    folder = tmp_path_factory.mktemp("paper")
    assert paper.main(["--output", str(folder)]) == 0
    return {
        path.stem: BeautifulSoup(path.read_text("utf-8"), "html.parser")
        for path in folder.glob("*.html")
    }


def source(name: str) -> list[nbformat.NotebookNode]:
    return list(nbformat.read(paper.SOURCE / name / f"{name}.ipynb", as_version=4).cells)


def lines_of_solutions(name: str) -> list[str]:
    found = [line.strip() for cell in source(name) for text in SOLUTION.findall(cell.source)
             if cell.cell_type == "code" for line in text.splitlines()]  # fmt: skip
    return [line for line in found if len(line) > 20]


def test_each_set_has_its_page_and_its_solutions_apart(printed: dict[str, BeautifulSoup]) -> None:
    pages = {name + end for name in SETS for end in ("", "_solutions")}
    assert printed.keys() == pages | {"boards"}


@each_set
def test_every_problem_is_on_both_pages(printed: dict[str, BeautifulSoup], name: str) -> None:
    posed = [task.id for each in PACK.sets if each.name == name for task in each.tasks]
    for page in (printed[name], printed[f"{name}_solutions"]):
        assert [heading.get_text().split()[0] for heading in page.select("h2")][
            : len(posed)
        ] == posed


@each_set
def test_solutions_are_on_their_own_page_only(printed: dict[str, BeautifulSoup], name: str) -> None:
    assert len(lines_of_solutions(name)) > 5
    for line in lines_of_solutions(name):
        assert line not in printed[name].get_text(), line
        assert line in printed[f"{name}_solutions"].get_text(), line
    for page in (printed[name], printed[f"{name}_solutions"]):
        assert not re.search("SOLUTION|HIDDEN|seed=", page.get_text())
    assert len(printed[name].select(".line")) == paper.LINES  # one answer in words to a set
    assert printed[f"{name}_solutions"].select("table"), "the rubric"


def test_a_page_needs_nothing_but_itself(printed: dict[str, BeautifulSoup]) -> None:
    for name, page in printed.items():
        assert not page.select("script, link, img, iframe, a[href], [src]"), name
        assert not re.search(r"url\(|@import", str(page.style)), name


def test_every_formula_is_set(printed: dict[str, BeautifulSoup]) -> None:
    for name, page in printed.items():
        text = copy(page)
        for tag in text.select("code, pre"):
            tag.extract()
        assert not re.search(r"\$|\\[a-z]", text.get_text()), name
        assert page.select("math"), name


@each_set
def test_no_formula_is_lost(printed: dict[str, BeautifulSoup], name: str) -> None:
    text = "\n".join(cell.source for cell in source(name) if cell.cell_type == "markdown" and
                     not cell.id.startswith("written"))  # fmt: skip
    text = re.sub(r"`[^`]*`", "", text)
    formulas = re.findall(r"\$\$.+?\$\$|\$[^$]+\$", text, re.DOTALL)
    assert len(printed[name].select("math")) == len(formulas) > 0


def test_each_session_begins_a_sheet(printed: dict[str, BeautifulSoup]) -> None:
    weeks = [section.h2.get_text() for section in printed["boards"].select("section")]
    assert weeks == [f"Week {number}" for number in range(1, 11)]
    boards = [section.select("ol > li") for section in printed["boards"].select("section")]
    assert all(len(board) >= 6 for board in boards[:9])
    drawn = [section.select("figure") for section in printed["boards"].select("section")]
    assert [len(figures) for figures in drawn] == [1, 1, *[0] * 8]
    assert drawn[0][0]["aria-label"].startswith("Block diagram of the NR-DOB loop: e = R - yf")
    assert drawn[0][0].svg


def test_a_page_is_the_same_each_time(printed: dict[str, BeautifulSoup], tmp_path: Path) -> None:
    assert paper.main(["--output", str(tmp_path)]) == 0
    again = (tmp_path / "boards.html").read_text("utf-8")
    assert BeautifulSoup(again, "html.parser") == printed["boards"]


def test_the_pages_are_written_into_the_folder_that_is_asked_for(tmp_path: Path) -> None:
    assert all(path.parent == tmp_path / "here" for path in paper.write(tmp_path / "here"))
