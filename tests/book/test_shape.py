"""What a chapter lacks is named, with its cell, before a page is made of it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import nbformat
import pytest

import chapters
from shape import faults, faults_of_book

ROOT = Path(__file__).resolve().parents[2]


def chapter() -> list[dict[str, Any]]:
    """Make up a chapter that lacks nothing: a title, a cell, a figure."""
    figure = {
        "output_type": "display_data",
        "data": {"image/png": "AAAA"},
        "metadata": {"image/png": {"alt": "One turn."}},
    }
    return [
        {"cell_type": "markdown", "metadata": {}, "source": "# A title\nand more"},
        {
            "cell_type": "code", "id": "sum", "metadata": {}, "source": "1 + 1",
            "execution_count": 1, "outputs": [],
        },
        {
            "cell_type": "code", "id": "turn", "source": "plot()", "execution_count": 2,
            "outputs": [figure],
            "metadata": {
                "mystnb": {
                    "figure": {"caption": "A turn.", "name": "fig-turn"},
                    "image": {"alt": "One turn."},
                }
            },
        },
    ]  # fmt: skip


def test_a_chapter_that_lacks_nothing_has_no_fault() -> None:
    assert list(faults("17_lemma_1", chapter())) == []


def test_the_chapters_lack_nothing() -> None:
    assert faults_of_book(ROOT / "notebooks") == []


def without_title(cells: list[Any]) -> None:
    cells[0]["source"] = "Some text.\n\n# A title"


def opened_by_code(cells: list[Any]) -> None:
    del cells[0]


def without_figure(cells: list[Any]) -> None:
    del cells[2]


def not_run(cells: list[Any]) -> None:
    cells[1]["execution_count"] = None


def run_twice(cells: list[Any]) -> None:
    cells[2]["execution_count"] = 5


def figure_not_shown(cells: list[Any]) -> None:
    cells[2]["outputs"] = []


def without_alt(cells: list[Any]) -> None:
    cells[2]["outputs"][0]["metadata"] = {}


def alt_left_behind(cells: list[Any]) -> None:
    cells[2]["metadata"]["mystnb"]["image"]["alt"] = "Another turn."


def without_caption(cells: list[Any]) -> None:
    cells[2]["metadata"]["mystnb"]["figure"]["caption"] = " "


def without_name(cells: list[Any]) -> None:
    del cells[2]["metadata"]["mystnb"]["figure"]["name"]


def two_figures(cells: list[Any]) -> None:
    cells[2]["outputs"] *= 2


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (without_title, "does not open with its title"),
        (opened_by_code, "does not open with its title"),
        (without_figure, "has no figure"),
        (not_run, "cell 'sum' (1 + 1) was not run in its turn"),
        (run_twice, "cell 'turn' (plot()) was not run in its turn"),
        (figure_not_shown, "cell 'turn' (plot()) has the caption of a figure, and shows none"),
        (without_alt, "shows a figure without alt text"),
        (alt_left_behind, "whose alt text is not carried to the page"),
        (without_caption, "shows a figure without a caption"),
        (without_name, "shows a figure without a name"),
        (two_figures, "shows 2 figures"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_what_a_chapter_lacks_is_named(spoil: Any, complaint: str) -> None:
    cells = chapter()
    spoil(cells)
    found = list(faults("17_lemma_1", cells))
    assert any(complaint in fault for fault in found), found
    assert all(fault.startswith("17_lemma_1: ") for fault in found)


def test_the_build_warns_of_it_and_so_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "chapters").mkdir()
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell("No title.")])
    nbformat.write(notebook, tmp_path / "chapters" / "17_lemma_1.ipynb")
    said: list[tuple[str, str]] = []
    monkeypatch.setattr(
        chapters,
        "logger",
        SimpleNamespace(warning=lambda text, location: said.append((location, text))),
    )
    chapters.check(SimpleNamespace(srcdir=tmp_path))
    assert said == [
        ("chapters/17_lemma_1", "does not open with its title, '# …'"),
        ("chapters/17_lemma_1", "has no figure"),
    ]


def test_on_the_page_the_opening_picture_stands_at_its_question() -> None:
    *_, figure = chapter()
    imports = chapters.new_cell("imports", "") | {"cell_type": "code"}
    question = "# 1. A title\n\nWhy?\n\n**You will be able to**\n\n- say"
    opening = chapters.new_cell("opening", question)
    text = chapters.new_cell("text", "## A section")
    cells = [opening, imports, figure, text]
    chapters.picture_first(cells)
    assert [cell["id"] for cell in cells] == ["opening", "turn", "goals", "imports", "text"]
    assert cells[0]["source"].endswith("Why?\n\n")
    assert cells[2]["source"] == "**You will be able to**\n\n- say"


def test_a_picture_behind_other_text_stays_where_it_is() -> None:
    *_, figure = chapter()
    opening = chapters.new_cell("opening", "# A. A title\n\n**You will be able to**\n\n- say")
    cells = [opening, chapters.new_cell("text", "## A section"), figure]
    chapters.picture_first(cells)
    assert [cell["id"] for cell in cells] == ["opening", "text", "turn"]


@pytest.mark.slow
def test_every_chapter_that_is_read_through_opens_with_a_picture() -> None:
    without = []
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        cells = nbformat.read(path, as_version=4).cells
        chapters.picture_first(cells)
        if "figure" not in cells[1].metadata.get("mystnb", {}):
            without.append(path.stem)
    assert without == ["A_proofs"]
