"""The question that opens a chapter is the one of its week, and opens choice by choice."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup

import predictions
from predictions import KEY, Question, markdown, read_questions

QUESTIONS = read_questions()

each_question = pytest.mark.parametrize("question", QUESTIONS.values(), ids=QUESTIONS.keys())


@pytest.mark.slow
def test_every_chapter_holds_its_question_as_it_is_asked_in_class() -> None:
    assert predictions.main(["--check"]) == 0
    for path in sorted(predictions.NOTEBOOKS.glob("*.ipynb")):
        cells = nbformat.read(path, as_version=4).cells
        asked = [path.stem] if path.stem in QUESTIONS else []
        assert [cell.metadata[KEY] for cell in cells if KEY in cell.metadata] == asked


@pytest.mark.slow
def test_a_picture_comes_first_and_the_question_where_it_can_be_answered() -> None:
    for chapter in QUESTIONS:
        cells = nbformat.read(predictions.NOTEBOOKS / f"{chapter}.ipynb", as_version=4).cells
        (place,) = (k for k, cell in enumerate(cells) if KEY in cell.metadata)
        assert 1 < place < len(cells) - 2, chapter


@pytest.mark.slow
def test_a_notebook_holds_the_figures_of_its_question() -> None:
    for chapter, question in QUESTIONS.items():
        cells = nbformat.read(predictions.NOTEBOOKS / f"{chapter}.ipynb", as_version=4).cells
        (cell,) = (cell for cell in cells if KEY in cell.metadata)
        assert cell.attachments["answered_with.png"]["image/png"] == question.answered_with.png
        assert all(f"(attachment:{name})" in cell.source for name in cell.attachments)


def test_no_letter_is_the_right_one_all_week() -> None:
    for deck in sorted((predictions.NOTEBOOKS / "class").glob("*.ipynb")):
        asked = predictions.split(nbformat.read(deck, as_version=4).cells)
        chapters = [cells[0].metadata["slideshow"]["data"]["chapter"] for cells in asked]
        right = [QUESTIONS[chapter].right for chapter in chapters]
        assert len(set(right)) > 1, f"{deck.name}: the answer is {right[0]} each time"


@pytest.mark.thorough
def test_a_changed_question_is_noticed_and_brought_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(predictions.NOTEBOOKS / "class", tmp_path / "class")
    for path in predictions.NOTEBOOKS.glob("*.ipynb"):
        shutil.copy(path, tmp_path)
    deck = tmp_path / "class" / "week1.ipynb"
    deck.write_text(deck.read_text("utf-8").replace("A motor runs", "A fan runs"), "utf-8")
    monkeypatch.setattr(predictions, "NOTEBOOKS", tmp_path)
    monkeypatch.setattr(predictions, "read_questions", lambda: read_questions(tmp_path / "class"))
    assert predictions.main(["--check"]) == 1
    assert "01_can_you_compute_the_load.ipynb" in capsys.readouterr().err
    before = (tmp_path / "03_is_a_perfect_model_perfect.ipynb").read_bytes()
    assert predictions.main([]) == 0 and predictions.main(["--check"]) == 0
    first = (tmp_path / "01_can_you_compute_the_load.ipynb").read_text("utf-8")
    assert "A fan runs" in first
    assert (tmp_path / "03_is_a_perfect_model_perfect.ipynb").read_bytes() == before


def test_a_new_chapter_gets_its_question_after_the_opening() -> None:
    cells = [nbformat.v4.new_markdown_cell(f"# {k}") for k in range(3)]
    notebook = nbformat.v4.new_notebook(cells=cells)
    question = QUESTIONS["05_how_slow_must_the_filter_be"]
    predictions.put_into(notebook, question)
    assert [KEY in cell.metadata for cell in notebook.cells] == [False, True, False, False]
    nbformat.validate(notebook)
    predictions.put_into(notebook, question)
    assert len(notebook.cells) == 4


@each_question
def test_each_choice_opens_by_itself_and_one_says_yes(question: Question) -> None:
    page = BeautifulSoup(markdown(question), "html.parser")
    (box,) = page.select("div.prediction")
    choices = box.find_all("details", recursive=False)
    assert [each.summary.b.get_text() for each in choices] == list(question.choices)
    verdicts = [re.search(r"\*\*(Yes|No)", each.get_text())[1] for each in choices]
    assert verdicts == ["Yes" if k == question.right else "No" for k in question.choices]
    for letter, each in zip(question.choices, choices, strict=True):
        (yes,) = [question.answer] if letter == question.right else [question.wrong[letter]]
        assert yes in each.get_text()
        assert len(each.select("details")) == (letter == question.right)
    assert not page.select("script, input") and not re.search(r"\son\w+=", str(page))


@each_question
def test_what_is_clicked_has_no_markdown_left(question: Question) -> None:
    """Jupyter reads no Markdown in a line of HTML; formulas it sets everywhere."""
    for line in re.findall("<summary>(.*)</summary>", markdown(question)):
        plain = re.sub(r"\$[^$]+\$", "", line)
        assert not re.search(r"[*`\\]", plain), line
        assert not re.search(r"<(?!/?(?:b|i)>)", line), line
        assert line.count("$") % 2 == 0
