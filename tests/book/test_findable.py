"""What leads a reader: plain formulas for the search, the glossary, the paper's numbers."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest

from findable import cut, plain, words
from maps import EQUATIONS, equations_in, table
from mentions import claims_of
from nrdob_course.claims import LEDGER

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("latex", "letters"),
    [
        (r"\tilde G^{-1}G=\frac{4(s+1)}{s-1}\tag{13}", "G̃⁻¹G=(4(s+1))/(s-1)"),
        (r"\Gm_0e^{-\theta_ms}", "G̃_0e^(-θ_ms)"),
        (r"\lambda\omega = \sqrt{\left(2\sin\frac\varphi2\right)^{2/n}-1}", None),
        (r"\left|1+\mathrm j\lambda\omega\right|^n", "|1+jλω|ⁿ"),
        (r"\begin{aligned}a&=b\\c&=d\end{aligned}", "a =b; c =d"),
        (r"54^\circ", "54°"),
    ],
)
def test_a_formula_is_read_in_plain_letters(latex: str, letters: str | None) -> None:
    found = plain(latex)
    assert not set(found) & set("\\{}$")
    assert letters is None or found == letters


def test_a_long_text_is_cut_at_a_word() -> None:
    assert cut("one two three", 9) == "one two …"
    assert cut("one two", 9) == "one two"


def test_the_glossary_is_in_order_and_each_word_leads_to_a_chapter() -> None:
    page = ROOT / "book" / "glossary.md"
    first = [word.names[0].lower() for word in words(page)]
    assert len(first) >= 60 and first == sorted(first)
    every = [name.lower() for word in words(page) for name in word.names]
    assert len(set(every)) == len(every)
    chapters = {f"chapters/{path.stem}" for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert {word.page for word in words(page)} <= chapters
    names = {
        "smith predictor", "imc", "youla parameter", "parity interlacing", "encirclement",
        "crossing frequency", "retarded", "neutral", "disturbance observer", "q-filter",
        "delayed model", "adrc", "extended state observer", "anti-windup", "small gain",
    }  # fmt: skip
    assert names <= set(every)


def test_every_equation_of_the_paper_leads_to_its_claims() -> None:
    of_equations = {id for n in EQUATIONS for id in claims_of(f"eq{n:02}")}
    assert of_equations == {id for id in LEDGER if id.startswith("eq")}
    assert claims_of("fig15") == [id for id in LEDGER if id.startswith("fig15")]


def test_tags_of_displayed_equations_are_found() -> None:
    cells = [
        "In (3), $$a=b,\\tag{3}$$ and\n\\begin{align}c&=d\\tag{4}\\\\e&=f\\tag{6}\\end{align}",
        "$x\\tag{9}$ is in a line, and `\\tag{8}` is code",
    ]
    assert equations_in(cells) == [3, 4, 6]


def test_the_table_leads_from_the_paper_to_chapters_figures_and_ledger(tmp_path: Path) -> None:
    notebook = nbformat.v4.new_notebook()
    notebook.cells = [
        nbformat.v4.new_markdown_cell("# The loop and Lemma 1\n\n$$a=b\\tag{3}$$"),
        nbformat.v4.new_code_cell(
            "plot()", metadata={"mystnb": {"figure": {"name": "fig-2", "caption": "It."}}}
        ),
    ]
    nbformat.write(notebook, tmp_path / "11_the_loop.ipynb")
    rows = table(tmp_path).splitlines()
    link = "[11 The loop and Lemma 1](/chapters/11_the_loop.ipynb)"
    assert f"| eq. (3) | {link} | `claim:eq03` |" in rows
    assert any(row.startswith(f"| Lemma 1 | {link} | `claim:lemma1") for row in rows)
    assert any(row.startswith("| Figure 2 | [11, Figure 2](#fig-2) | `claim:fig02") for row in rows)
    assert "| eq. (2) | – | " in "\n".join(rows)
