"""What belongs together stays in one line, and a picture can be enlarged."""

from __future__ import annotations

from pathlib import Path

import pytest
from bs4 import BeautifulSoup
from docutils import nodes
from docutils.utils import new_document

import pdf
from typeset import LONG, SPACE, mark_code, tie_punctuation, tie_words


@pytest.mark.parametrize(
    ("text", "together"),
    [
        ("from 0.6 rad/s on", "from 0.6~rad/s on"),
        ("with 0.02 kg m², a load of 0.5 N m", "with 0.02~kg~m², a load of 0.5~N~m"),
        ("b = 0.1 N m s. After 2 ms, 30 % of it", "b = 0.1~N~m~s. After 2~ms, 30~% of it"),
        ("6 dB at 10\nHz", "6~dB at 10~Hz"),
        ("By Theorem 12.1 and\nLemma\n2", "By Theorem~12.1 and\nLemma~2"),
        ("Examples 2 and 3, condition ii, order 3", "Examples~2 and 3, condition~ii, order~3"),
        ("and this is left. ∎", "and this is left.~∎"),
        ("2 samples, 3 Nyquist plots, order is", "2 samples, 3 Nyquist plots, order is"),
    ],
)  # fmt: skip
def test_no_line_ends_between_a_number_and_its_unit_or_name(text: str, together: str) -> None:
    document = new_document("page")
    document += nodes.paragraph("", text, nodes.literal("", text))
    paragraph = document.children[0]
    paragraph.insert(0, nodes.Text(text))
    tie_words(document)
    assert paragraph.children[0] == together.replace("~", SPACE)
    assert paragraph.children[-1].astext() == text, "code is not touched"


@pytest.mark.parametrize(
    ("formula", "behind", "tied", "rest"),
    [
        ("x", ", and so on", ",", " and so on"),
        ("J=0.02", " kg m². Then", "~kg~m².", " Then"),
        (r"\lambda=\tfrac{1}{2}", " s (slow)", "~s", " (slow)"),
        ("F=1", ". ∎", ".~∎", ""),
        ("G", " s", None, " s"),
    ],
)
def test_a_formula_keeps_its_marks_its_unit_and_the_end_of_the_proof(
    formula: str, behind: str, tied: str | None, rest: str
) -> None:
    document = new_document("page")
    document += nodes.paragraph("", "", nodes.math("", formula), nodes.Text(behind))
    tie_punctuation(document)
    piece, text = document.children[0].children
    assert text == rest
    if tied is None:
        assert isinstance(piece, nodes.math)
    else:
        assert piece.children[-1] == tied.replace("~", SPACE)


def test_pictures_are_no_links_on_paper(tmp_path: Path) -> None:
    picture = '<a class="picture" href="../_images/a.png"><img alt="A" src="../_images/a.png"></a>'
    page = tmp_path / "chapters" / "11_x.html"
    page.parent.mkdir()
    page.write_text(f"<article class='bd-article'><h1>X</h1>{picture}</article>", "utf-8")
    printed = pdf.chapter(tmp_path, "chapters/11_x", frozenset({"chapters/11_x"}))
    assert not printed.text.select("a")
    assert printed.text.img == BeautifulSoup('<img alt="A" src="_images/a.png">', "html.parser").img


def test_only_long_code_is_broken_between_sheets_of_paper() -> None:
    document = new_document("page")
    for lines, kind in ((LONG, []), (LONG + 1, []), (LONG + 1, ["output"])):
        code = "\n".join(["x"] * lines)
        document += nodes.literal_block(code, code, classes=list(kind))
    mark_code(document)
    assert ["long" in code["classes"] for code in document.children] == [False, True, False]
