"""The questions for class: one for each chapter, the answer after the vote, and no network."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import nbformat
import pytest
from bs4 import BeautifulSoup, Tag

import slides

# The slides are made.
pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]

CHAPTERS = sorted(path.stem for path in (ROOT / "notebooks").glob("*.ipynb"))
DECKS = sorted((ROOT / "notebooks" / "class").glob("*.ipynb"))
CHOICE = re.compile(r"^- \*\*([A-D])\*\* \S", flags=re.MULTILINE)

each_deck = pytest.mark.parametrize("deck", DECKS, ids=lambda path: path.stem)


# --- the notebooks ----------------------------------------------------------------------------


def questions(deck: Path) -> list[list[Any]]:
    """Split a notebook into its questions, each a list of cells; what comes before is left out."""
    found: list[list[Any]] = []
    for cell in nbformat.read(deck, as_version=4).cells:
        if data(cell).get("kind") == "question":
            found.append([])
        if found:
            found[-1].append(cell)
    return found


def data(cell: Any) -> dict[str, str]:
    return dict(cell.metadata.get("slideshow", {}).get("data", {}))


def kind(cell: Any) -> str:
    return str(cell.metadata.get("slideshow", {}).get("slide_type", "-"))


def position(cells: list[Any], wanted: str) -> int:
    (found,) = (k for k, cell in enumerate(cells) if data(cell).get("kind") == wanted)
    return found


EVERY = [
    pytest.param(cells, id=data(cells[0])["chapter"]) for deck in DECKS for cells in questions(deck)
]
LOOKED_UP = {"C_traps", "D_a_proof_you_can_check"}
"""What is looked up and has no question for class."""

each_question = pytest.mark.parametrize("cells", EVERY)


def test_every_chapter_has_one_question_in_the_deck_of_one_week() -> None:
    asked = [data(cells[0])["chapter"] for deck in DECKS for cells in questions(deck)]
    assert len(set(asked)) == len(asked), "a chapter has two questions"
    missing, strange = set(CHAPTERS) - set(asked) - LOOKED_UP, set(asked) - set(CHAPTERS)
    assert not missing, f"no question for {sorted(missing)}: add one to notebooks/class"
    assert not strange, f"questions for chapters that are not there: {sorted(strange)}"
    for deck in DECKS:
        assert (
            nbformat.read(deck, as_version=4)
            .cells[0]
            .source.startswith(f"# Week {deck.stem.removeprefix('week')}: ")
        )


@each_question
def test_question_then_figure_then_answer(cells: list[Any]) -> None:
    reveal, answer = position(cells, "reveal"), position(cells, "answer")
    assert 0 < reveal < answer
    assert [kind(cells[k]) for k in (0, reveal, answer)] == ["slide", "subslide", "subslide"]
    assert len({data(cells[k])["chapter"] for k in (0, reveal, answer)}) == 1
    assert any(has_figure(cell) for cell in cells[reveal:answer]), "nothing to look at"
    assert cells[0].source.startswith(f"## {data(cells[0])['chapter'].partition('_')[0]} ")


@each_question
def test_three_or_four_choices_and_a_line_for_each_wrong_one(cells: list[Any]) -> None:
    choices = CHOICE.findall("\n".join(markdown(cells[: position(cells, "reveal")])))
    assert choices == list("ABCD")[: len(choices)] and len(choices) in (3, 4)
    told = cells[position(cells, "answer")].source
    right = re.match(r"#### \*\*([A-D])\*\*: ", told)
    assert right and right.group(1) in choices, "the answer must open with its letter"
    assert CHOICE.findall(told) == [letter for letter in choices if letter != right.group(1)]


@each_question
def test_one_follow_up_with_its_answer(cells: list[Any]) -> None:
    last = [cell for cell in cells if kind(cell) == "fragment"]
    assert len(last) == 2 and last[0].source.startswith("*And then:*")


@each_question
def test_nothing_is_given_away_before_the_vote(cells: list[Any]) -> None:
    """In Lab the answer is in a closed section, and the code of a question's figure folded."""
    reveal = position(cells, "reveal")
    assert cells[reveal].metadata.get("jp-MarkdownHeadingCollapsed") is True
    assert cells[reveal].source.startswith("### ")
    for cell in cells[:reveal]:
        if cell.cell_type == "code":
            assert cell.metadata["jupyter"]["source_hidden"]
            assert has_figure(cell) or not cell.outputs
    for cell in cells[reveal + 1 :]:  # a heading of the same level would end the section
        assert not re.search(r"^#{1,3} ", cell.source if cell.cell_type == "markdown" else "")


@each_question
def test_the_answer_is_asserted(cells: list[Any]) -> None:
    code = [cell.source for cell in cells if cell.cell_type == "code"]
    assert any("assert " in source for source in code)


def has_figure(cell: Any) -> bool:
    return any("image/png" in output.get("data", {}) for output in cell.get("outputs", []))


def markdown(cells: list[Any]) -> list[str]:
    return [cell.source for cell in cells if cell.cell_type == "markdown"]


# --- the slides -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("slides")
    assert slides.main(["--output", str(made)]) == 0
    return made


def page(folder: Path, deck: Path) -> BeautifulSoup:
    return BeautifulSoup((folder / f"{deck.stem}.html").read_text(encoding="utf-8"), "html.parser")


def stacks(soup: BeautifulSoup) -> list[list[Tag]]:
    """Give the slides of each question: the question, and what is below it."""
    outer = soup.select(".slides > section")
    return [section.find_all("section", recursive=False) for section in outer]


@pytest.mark.thorough
@each_deck
def test_each_question_is_a_stack_of_three_slides(folder: Path, deck: Path) -> None:
    soup = page(folder, deck)
    title, *rest = stacks(soup)
    assert len(title) == 1 and soup.title.get_text() == title[0].h1.get_text().rstrip("¶")
    assert len(rest) == len(questions(deck))
    for stack in rest:
        assert [slide["data-kind"] for slide in stack] == ["question", "reveal", "answer"]
        assert len(stack[0].select("li")) in (3, 4) and not stack[0].select(".fragment")
        assert len(stack[1].select("img")) == 1
        assert len(stack[2].select(".fragment")) == 2


@pytest.mark.thorough
@each_deck
def test_no_code_on_slides(folder: Path, deck: Path) -> None:
    soup = page(folder, deck)
    assert not soup.select(".jp-CodeCell .jp-InputArea, .highlight, .cm-editor, pre")
    assert not re.search(r"\b(?:Out|In)\s*\[", soup.get_text())


@each_deck
def test_figures_have_alt_text(folder: Path, deck: Path) -> None:
    images = page(folder, deck).select("img")
    assert images and all(len(image.get("alt", "")) > 20 for image in images)


@each_deck
def test_slides_need_no_network(folder: Path, deck: Path) -> None:
    soup = page(folder, deck)
    loaded = [tag[name] for name in ("src", "href") for tag in soup.select(f"[{name}]")]
    for address in loaded:
        if not address.startswith(("data:image/png;base64,", "#")):
            assert (folder / address).is_file(), f"{deck.stem} asks for {address[:80]}"
    assert not re.search(r"@import|\bfetch\(|url\(\s*['\"]?https?:", str(soup))


def test_styles_need_no_network(folder: Path) -> None:
    for sheet in folder.glob("*.css"):
        text = sheet.read_text(encoding="utf-8")
        assert not re.search(r"@import|url\(\s*['\"]?(?!data:)", text), sheet.name


@each_deck
def test_the_first_slide_leads_to_every_question(folder: Path, deck: Path) -> None:
    soup = page(folder, deck)
    first, *rest = stacks(soup)
    wanted = [stack[0].h2["id"] for stack in rest]
    assert [unquote(link["href"].removeprefix("#")) for link in first[0].select("li a")] == wanted


def test_the_deck_of_two_days_has_every_question_in_the_order_of_the_plan(folder: Path) -> None:
    soup = BeautifulSoup((folder / "two_days.html").read_text(encoding="utf-8"), "html.parser")
    first, *rest = stacks(soup)
    asked = [stack[0]["data-chapter"] for stack in rest]
    assert sorted(asked) == sorted({*CHAPTERS} - LOOKED_UP)
    plan = (ROOT / "book" / "teaching" / "syllabus.md").read_text("utf-8").split("## Two days")[1]
    told = [number for row in slides.TWO_DAYS.findall(plan) for number in row.split(", ")]
    assert [chapter.partition("_")[0] for chapter in asked] == told
    wanted = [stack[0].h2["id"] for stack in rest]
    assert [unquote(link["href"].removeprefix("#")) for link in first[0].select("li a")] == wanted


def test_a_notebook_that_has_not_been_run_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notebook = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_markdown_cell("# Title"), nbformat.v4.new_code_cell("1 + 1")]
    )
    nbformat.write(notebook, tmp_path / "new.ipynb")
    monkeypatch.setattr(slides, "FOLDER", tmp_path)
    with pytest.raises(SystemExit, match=r"new\.ipynb has not been run: make execute"):
        slides.main(["--output", str(tmp_path / "out")])
