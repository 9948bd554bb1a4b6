"""Numbered theorems: the chapters keep their form, and a build names each one that does not."""

from __future__ import annotations

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup
from sphinx.cmd.build import main

from statements import faults, faults_of_book, lost_mentions, mentions, read

ROOT = Path(__file__).resolve().parents[2]

# Of the book's tools, not ours.
pytestmark = pytest.mark.filterwarnings("ignore:.* is deprecated. Check CHANGES")

SOUND = """As in

> **Theorem 17.1 (Lemma 1, with $F$ *exact*).** *Let*
>
> 1. the blocks be proper
>    and without common factors;
> 2. $F$ be stable with $F(0)=1$.
>
> *Then* the loop is stable if and only if
>
> $$1 + FH \\ne 0.$$
>
> *Without 1:* the loop $G=1/s$ has a root at $+1$.
>
> *Without 2:* the statement has no meaning: see [the loop](18_more.ipynb).
>
> *Proof:* the determinant above.
>
> *Known:* textbook.

and so on."""


def test_a_mention_of_a_part_begins_none() -> None:
    text = SOUND.replace("has a root at $+1$.", "has a root, as the loop of *Without 2* above has.")
    (theorem,) = read("17_page", [text])
    assert theorem.without[1].endswith("above has.")
    assert theorem.without[2].startswith("the statement has no meaning")


def test_a_part_that_ends_within_a_sentence_is_named() -> None:
    cut = SOUND.replace("has a root at $+1$.", "has a root, which is")
    assert any("'*Without 1:*' that ends within" in fault for fault in faults("17_page", [cut]))


@pytest.mark.slow
def test_the_chapters_keep_the_form() -> None:
    assert faults_of_book(ROOT / "notebooks") == []


@pytest.mark.slow
def test_the_pages_mention_no_theorem_that_is_not_there() -> None:
    there = {
        theorem.number
        for path in (ROOT / "notebooks").glob("*.ipynb")
        for theorem in read(path.stem, [cell.source for cell in nbformat.read(path, 4).cells])
    }
    for page in sorted((ROOT / "book").rglob("*.md")):
        assert lost_mentions(page.name, [page.read_text("utf-8")], there) == []


def test_a_theorem_is_read_part_by_part() -> None:
    (theorem,) = read("17_lemma_1", [SOUND])
    assert theorem.number == "17.1" and theorem.anchor == "theorem-17-1"
    assert theorem.name == "Lemma 1, with $F$ *exact*"
    assert list(theorem.conditions) == [1, 2]
    assert "without common factors" in theorem.conditions[1]
    assert theorem.then.endswith("$$1 + FH \\ne 0.$$")
    assert theorem.without[1].startswith("the loop $G=1/s$")
    assert (theorem.proof, theorem.known) == ("the determinant above.", "textbook.")
    assert faults("17_lemma_1", [SOUND]) == []


def test_a_part_begins_behind_its_comma() -> None:
    cell = SOUND.replace("*Then* the loop", "*Then*, with $F$, the loop")
    (theorem,) = read("17_lemma_1", [cell])
    assert theorem.then.startswith("with $F$")


def test_other_quotations_are_no_theorems() -> None:
    others = ["> A word of the paper.", "Theorem 1.1 (x)."]
    assert read("17_x", others) == [] and faults("17_x", others) == []


def test_a_theorem_without_a_number_is_named() -> None:
    (fault,) = faults("17_x", ["> **Theorem (parity).** Let it be."])
    assert "17_x" in fault


def changed(old: str, new: str, text: str = SOUND) -> str:
    assert old in text
    return text.replace(old, new)


NO_CONDITIONS = SOUND.replace("> 1. the", "> the").replace("> 2. $F$", "> $F$")


@pytest.mark.parametrize(
    ("cells", "complaint"),
    [
        ([NO_CONDITIONS], "has no numbered conditions"),
        ([changed("*Without 2:*", "*Without 1:*")], "happens without condition 2: '*Without 2:*'"),
        ([changed("*Without 2:*", "*Without 3:*")], "without condition 3, which it does not have"),
        ([changed("> 2. $F$", "> 4. $F$")], "numbers its conditions 1, 4, not from 1 on"),
        ([changed("*Then* the", "So the")], "has no '*Then*'"),
        ([changed("*Proof:*", "Proof:")], "has no '*Proof:*'"),
        ([changed("*Known:* textbook.", "*Known:*")], "does not say who knew it: '*Known:*'"),
        ([changed("17.1", "18.1")], "has the number of another chapter"),
        ([SOUND, SOUND], "has a number that an earlier theorem has"),
        ([SOUND, changed("17.1", "17.3")], "comes where 2 is expected: a number is left out"),
        ([changed("17.1", "17.2")], "comes where 1 is expected: a number is left out"),
        ([changed("exact*).**", "exact*)**")], "it must begin with '**Theorem 17.1 (Name).**'"),
    ],
)
def test_what_is_amiss_is_named_with_its_place(cells: list[str], complaint: str) -> None:
    found = faults("17_lemma_1", cells)
    assert any(complaint in fault for fault in found), found
    assert all(fault.startswith("17_lemma_1: ") for fault in found)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("by Theorem 17.1 ([Lemma 1](17_lemma_1.ipynb))", ["17.1"]),
        ("Theorems 17.1, 17.2 and 18.1 say; and 3.5 s", ["17.1", "17.2", "18.1"]),
        ("theorem 2 and `Theorem 17.9` and Theorem\n17.2.", ["17.2"]),
    ],
)
def test_mentions_are_found(text: str, numbers: list[str]) -> None:
    assert mentions(text) == numbers


def test_a_mention_of_nothing_is_named() -> None:
    assert lost_mentions("18_more", ["as Theorem 17.4 says"], {"17.1"}) == [
        "18_more: mentions Theorem 17.4, which the book does not have"
    ]


# --- a small book ---------------------------------------------------------------------------------

CONF = """
import sys
sys.path[:0] = [{ext!r}, {make!r}]
extensions = ["myst_nb", "mentions"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
nb_execution_mode = "off"
suppress_warnings = ["myst.mathjax"]
"""


def small_book(folder: Path, **chapters: str) -> tuple[int, str]:
    """Build a book of a few chapters; give the exit code and what was said."""
    (folder / "chapters").mkdir(parents=True)
    conf = CONF.format(ext=str(ROOT / "book" / "ext"), make=str(ROOT / "book" / "make"))
    (folder / "conf.py").write_text(conf, "utf-8")
    (folder / "index.md").write_text(
        "# Book\n\n```{toctree}\n:glob:\ntheorems\nchapters/*\n```\n\nTheorem 17.1 is here.\n",
        "utf-8",
    )
    (folder / "theorems.md").write_text("# Theorems\n\n```{theorem-index}\n```\n", "utf-8")
    for stem, text in chapters.items():
        notebook = nbformat.v4.new_notebook()
        notebook.cells = [nbformat.v4.new_markdown_cell(f"# Chapter {stem}\n\n{text}")]
        nbformat.write(notebook, folder / "chapters" / f"{stem.removeprefix('c')}.ipynb")
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()) as said:
        code = main(["-W", "--keep-going", "-n", "-q", str(folder), str(folder / "html")])
    return code, said.getvalue()


@pytest.mark.thorough
def test_a_theorem_becomes_a_box_with_links_and_an_entry(tmp_path: Path) -> None:
    more = "Theorem 17.1 ([Lemma 1](17_lemma_1.ipynb)) and Theorems 17.1, 17.1."
    code, said = small_book(tmp_path, c17_lemma_1=SOUND, c18_more=more)
    assert (code, said) == (0, "")

    def page(name: str) -> BeautifulSoup:
        text = (tmp_path / "html" / f"{name}.html").read_text("utf-8")
        return BeautifulSoup(text, "html.parser")

    (box,) = page("chapters/17_lemma_1").select("div.theorem#theorem-17-1")
    assert box.select_one("strong").get_text().startswith("Theorem 17.1 (Lemma 1")
    assert len(box.select("ol > li")) == 2 and len(box.select("p.theorem-note")) == 4
    for name, count in (("index", 1), ("chapters/18_more", 3)):
        assert len(page(name).select("a[href$='17_lemma_1.html#theorem-17-1']")) == count
    (entry,) = page("theorems").select(".theorem-entry")
    assert [term.get_text() for term in entry("dt")] == [
        "If", "Then", "Without 1", "Without 2", "Proof", "Known",
    ]  # fmt: skip
    assert entry.select("a[href='chapters/17_lemma_1.html#theorem-17-1']")
    assert entry.select("a[href^='chapters/18_more.html']")


@pytest.mark.thorough
def test_a_book_with_a_theorem_amiss_does_not_build(tmp_path: Path) -> None:
    text = changed("*Proof:*", "Proof:") + "\n\nSee Theorem 21.1."
    code, said = small_book(tmp_path, c17_lemma_1=text)
    assert code != 0
    assert "17_lemma_1" in said and "Theorem 17.1" in said and "has no '*Proof:*'" in said
    assert "mentions Theorem 21.1, which the book does not have" in said
