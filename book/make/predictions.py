"""Bring the prediction questions of notebooks/class into the chapters, to choose and then to see.

A question is written once, in the notebook of its week. Its chapter holds a copy in one Markdown
cell, made here, with the figures attached: each choice can be opened and tells what is wrong with
it, without a kernel or a script.
"""

import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import nbformat

from pages import NOTEBOOKS, keep, options, render

KEY = "prediction"
"""The metadata of a cell that is made here: the chapter of its question."""

CHOICE = re.compile(r"^- \*\*([A-D])\*\* (.+)$", re.MULTILINE)
ANSWER = re.compile(r"#### \*\*([A-D])\*\*: (.+)")
COMMENT = re.compile(r"\s*<!--.*?-->")


class Picture(NamedTuple):
    """A figure as a notebook stores it: PNG in base64, and what it says."""

    png: str
    alt: str


@dataclass(frozen=True)
class Question:
    """A question for class: what is asked, the choices, what each comes from, what follows."""

    chapter: str
    title: str
    asks: str
    choices: dict[str, str]
    right: str
    answer: str
    why: str
    wrong: dict[str, str]
    further: str
    further_answer: str
    asked_with: Picture | None
    answered_with: Picture


def read_questions(folder: Path = NOTEBOOKS / "class") -> dict[str, Question]:
    """Read the questions of all weeks, by their chapters."""
    weeks = [nbformat.read(path, as_version=4) for path in sorted(folder.glob("*.ipynb"))]
    found = [_read(cells) for week in weeks for cells in split(week.cells)]
    return {question.chapter: question for question in found}


def split(cells: list[Any]) -> list[list[Any]]:
    """Give the cells of each question; what comes before the first one is left out."""
    starts = [k for k, cell in enumerate(cells) if _data(cell).get("kind") == "question"]
    return [cells[a:b] for a, b in zip(starts, [*starts[1:], len(cells)], strict=True)]


def _data(cell: Any) -> dict[str, str]:
    return dict(cell.metadata.get("slideshow", {}).get("data", {}))


def _read(cells: list[Any]) -> Question:
    kinds = [_data(cell).get("kind") for cell in cells]
    reveal, answer = kinds.index("reveal"), kinds.index("answer")
    texts = [
        COMMENT.sub("", cell.source).strip() if cell.cell_type == "markdown" else ""
        for cell in cells
    ]
    title, _, asks = texts[0].partition("\n")
    headline, _, told = texts[answer].partition("\n")
    letter = ANSWER.fullmatch(headline)
    assert letter, headline
    slides = [cell.metadata.get("slideshow", {}).get("slide_type") for cell in cells]
    further, further_answer = (
        text for text, slide in zip(texts, slides, strict=True) if slide == "fragment"
    )
    (picture,) = _pictures(cells[reveal:answer])
    return Question(
        chapter=_data(cells[0])["chapter"],
        title=title.partition(" ")[2].partition(" ")[2],
        asks=asks.strip(),
        choices=dict(CHOICE.findall("\n".join(texts[:reveal]))),
        right=letter[1],
        answer=letter[2],
        why=CHOICE.split(told)[0].strip(),
        wrong=dict(CHOICE.findall(told)),
        further=further.removeprefix("*And then:* "),
        further_answer=further_answer,
        asked_with=next(iter(_pictures(cells[:reveal])), None),
        answered_with=picture,
    )


def _pictures(cells: list[Any]) -> list[Picture]:
    return [
        Picture(output["data"]["image/png"], about["alt"])
        for cell in cells
        for output in cell.get("outputs", [])
        if (about := output.get("metadata", {}).get("image/png"))
    ]


def in_html(markdown: str) -> str:
    """Give a line as HTML; formulas stay, Jupyter sets them wherever they stand."""
    parts = re.split(r"(\$[^$]+\$)", markdown)
    for k in range(0, len(parts), 2):
        bold = re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", parts[k])
        parts[k] = re.sub(r"\*(.+?)\*", r"<i>\1</i>", bold)
    return "".join(parts)


def markdown(question: Question) -> str:
    """Write a question: its choices can be opened, each one tells what it comes from."""
    return render("prediction.md", question=question, html=in_html).rstrip("\n")


def put_into(notebook: Any, question: Question) -> None:
    """Put a question into its chapter: where it stands already, else after the opening."""
    if not any(KEY in cell.metadata for cell in notebook.cells):
        notebook.cells.insert(1, nbformat.v4.new_markdown_cell(id=KEY, metadata={KEY: ""}))
    (cell,) = (cell for cell in notebook.cells if KEY in cell.metadata)
    cell.metadata[KEY] = question.chapter
    cell.source = markdown(question)
    cell["attachments"] = {
        f"{which}.png": {"image/png": picture.png}
        for which in ("asked_with", "answered_with")
        if (picture := getattr(question, which))
    }


def main(arguments: list[str] | None = None) -> int:
    given = options(__doc__, arguments, check=True)
    made = {}
    for chapter, question in read_questions().items():
        path = NOTEBOOKS / f"{chapter}.ipynb"
        notebook = nbformat.read(path, as_version=4)
        put_into(notebook, question)
        made[path] = nbformat.writes(notebook).rstrip("\n") + "\n"
    return keep(made, check=given.check)


if __name__ == "__main__":
    sys.exit(main())
