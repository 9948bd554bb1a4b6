"""What a reader can take home: archives, notebooks that start elsewhere, the book as a PDF."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import sys
import tomllib
from pathlib import Path
from zipfile import ZipFile

import pytest
from bs4 import BeautifulSoup
from hatchling.builders.wheel import WheelBuilder
from pypdf import PdfReader

import bundle
import getting
import pdf
from browser import CHROMIUM

ROOT = Path(__file__).resolve().parents[2]
GITHUB, ELSEWHERE = "https://github.com/owner/name", "https://code.example.org/owner/name"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> ZipFile:
    target = tmp_path_factory.mktemp("archive") / "notebooks.zip"
    bundle.pack(target, dict(bundle.to_run()))
    return ZipFile(target)


@pytest.mark.slow
def test_the_archive_has_each_chapter_and_the_package(archive: ZipFile):
    names = {name.removeprefix("nrdob-book/") for name in archive.namelist()}
    assert {f"notebooks/{path.name}" for path in (ROOT / "notebooks").glob("*.ipynb")} <= names
    assert {f"book/nrdob_course/{each}/__init__.py" for each in ("claims", "exercises")} <= names
    assert {"nrdob/__init__.py", "nrdob/py.typed", "pyproject.toml", "LICENSE"} <= names


@pytest.mark.slow
def test_the_archive_can_be_installed(archive: ZipFile, tmp_path: Path):
    archive.extractall(tmp_path)
    for folder in ("nrdob-book", "nrdob-book/book"):  # as binder/requirements.txt names them
        list(WheelBuilder(str(tmp_path / folder)).build(directory=str(tmp_path / "wheels")))
    assert len(list((tmp_path / "wheels").glob("*.whl"))) == 2


@pytest.mark.slow
def test_the_archive_has_no_solution_of_a_set(archive: ZipFile):
    assert not [name for name in archive.namelist() if "/sets/" in name or "problems.toml" in name]
    assert not [name for name in archive.namelist() if "__pycache__" in name]


@pytest.mark.thorough
def test_the_same_book_gives_the_same_archive(tmp_path: Path):
    for name in ("one.zip", "two.zip"):
        bundle.pack(tmp_path / name, dict(bundle.to_run()))
    assert (tmp_path / "one.zip").read_bytes() == (tmp_path / "two.zip").read_bytes()


def test_the_slim_environment_names_all_that_chapters_import():
    imported = {
        found
        for path in (ROOT / "notebooks").glob("*.ipynb")
        for cell in json.loads(path.read_text("utf-8"))["cells"]
        if cell["cell_type"] == "code"
        for found in re.findall(r"^(?:from|import) (\w+)", "".join(cell["source"]), re.MULTILINE)
    }
    foreign = imported - set(sys.stdlib_module_names) - {"nrdob", "IPython"}  # Jupyter brings it
    wanted = (ROOT / "binder" / "requirements.txt").read_text("utf-8")
    assert "./book\n" in wanted, "the course is installed from there"
    foreign -= {"nrdob_course"}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    installed = [wanted, *project["dependencies"], *project["optional-dependencies"]["notebooks"]]
    assert not {name for name in foreign if name not in "".join(installed)}
    assert all(importlib.util.find_spec(name) for name in foreign)


def test_a_chapter_starts_on_binder_and_on_colab():
    found = getting.starts(GITHUB, "chapters/11_the_loop")
    notebook = "notebooks/11_the_loop.ipynb"
    assert found["Binder"].endswith(f"/gh/owner/name/main?urlpath=lab/tree/{notebook}")
    assert found["Colab"].endswith(f"/github/owner/name/blob/main/{notebook}")


def test_elsewhere_than_on_github_only_binder_can_start_it():
    found = getting.starts(ELSEWHERE, "chapters/11_the_loop")
    assert list(found) == ["Binder"] and "/git/https%3A%2F%2Fcode.example.org" in found["Binder"]


@pytest.mark.parametrize(("address", "page"), [("", "chapters/11_the_loop"), (GITHUB, "notation")])
def test_nothing_starts_without_an_address_or_a_notebook(address: str, page: str):
    assert getting.starts(address, page) == {}


def test_the_address_stands_in_one_place():
    address = getting.repository(ROOT)
    assert address == "" or (ROOT / "pyproject.toml").read_text("utf-8").count(address) == 1


# --- the PDF ----------------------------------------------------------------------------------

PAGE = """<html><head><title>A book</title><link rel="stylesheet" href="../_static/book.css">
<script defer src="../_static/paper.js"></script></head><body>
<nav class="bd-links"><p class="caption">One part</p><ul>
<li class="toctree-l1"><a href="chapters/11_first.html">First</a></li>
<li class="toctree-l1"><a href="notation.html">Signs</a></li>
<li class="toctree-l1"><a href="api.html">Names</a></li></ul></nav>
<article class="bd-article">{text}</article></body></html>"""

TEXTS = {
    "index": '<h1>A book</h1><p><a href="notation.html#x">there</a></p>',
    "chapters/11_first": '<h1>11. First, with a title that is so long that it needs more than one'
    ' line of the page<a class="headerlink" href="#">¶</a></h1><h2 id="more">More</h2>'
    '<a href="#more">up</a><a href="../notation.html#x">x</a><a href="../api.html">api</a>'
    "<div class='prediction'><details><summary>Twelve?</summary>No.</details></div>"
    "<div class='cell tag_hide-input'><details class='hide above-input'><summary>How</summary>"
    "<div class='cell_input'>plot()</div></details><div class='cell_output'>drawn</div></div>"
    "<div class='cell tag_hide-cell'><details class='hide above-input'><summary><p>Show</p>"
    "</summary><div class='cell_input'>assert True</div></details></div>"
    "<details class='solution'><summary>Solution</summary>forty-two</details>"
    "<h2>Summary</h2>",
    "notation": '<h1>Signs</h1><p id="x">x</p><a href="https://example.org">away</a>',
}  # fmt: skip


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A book of three pages."""
    folder = tmp_path / "html"
    (folder / "chapters").mkdir(parents=True)
    (folder / "_static").mkdir()
    for name in ("book.css", "paper.js"):
        shutil.copy(ROOT / "book" / "_static" / name, folder / "_static")
    for name, text in TEXTS.items():
        (folder / f"{name}.html").write_text(PAGE.format(text=text), "utf-8")
    return folder


def test_links_lead_inside_where_their_page_is_printed(site: Path):
    front, part = pdf.parts(site)
    first, signs = part.chapters
    assert [link["href"] for link in first.text.select("a")] == [
        "#chapters-11_first--more", "#notation--x",
    ]  # fmt: skip
    assert "api" in first.text.get_text()  # the word stays where its page is not printed
    assert front.chapters[0].text.select_one("a")["href"] == "#notation--x"
    assert signs.text.select_one("a")["href"] == "https://example.org"
    assert first.text.select_one("h2")["id"] == "chapters-11_first--more"
    assert first.text.select_one("details").has_attr("open")


def test_a_site_of_another_theme_is_named():
    with pytest.raises(ValueError, match="article"):
        pdf.one(BeautifulSoup("<p>", "html.parser"), "article")


@pytest.mark.thorough
@pytest.mark.skipif(CHROMIUM is None, reason="a PDF needs Chromium, and there is none here")
def test_the_pdf_has_page_numbers_an_outline_and_its_answers_at_the_end(site: Path, tmp_path: Path):
    pdf.build(site, tmp_path / "book.pdf")
    printed = PdfReader(tmp_path / "book.pdf")
    titles = [entry for entry in printed.outline if not isinstance(entry, list)]
    assert [entry.title for entry in titles] == [
        "A book",
        "One part",
        "11. First, with a title that is so long that it needs more than one line of the page",
        "Signs",
    ]  # fmt: skip
    last = printed.get_destination_page_number(titles[-1]) + 1
    contents = " ".join(printed.pages[1].extract_text().split())
    assert re.search(rf"Signs {last}\b", contents)
    chapter = printed.pages[last - 2].extract_text()
    before, after = chapter.split("Answers")
    assert "Twelve?" in before and "Summary" in before
    assert "No." in after and "forty-two" in after
    assert "drawn" in before and "Here the notebook checks this." in before
    assert "plot()" not in chapter and "assert" not in chapter
    assert list(tmp_path.glob("*.draft.pdf")) == []
