"""The book as a reader gets it: every page there, no dead links, nothing from other servers.

The pages are built here, in a temporary folder, warnings as errors. So they are never stale, and
the checkout stays untouched.
"""

from __future__ import annotations

import gzip
import json
import re
import shutil
import string
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from copy import copy
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from io import BytesIO, StringIO
from itertools import cycle
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote, urlsplit

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from bs4 import BeautifulSoup
from fontTools.ttLib import TTFont
from PIL import Image

import apipages
import fonts
import ledger
import pdf
import teaching
from browser import (
    CHROMIUM,
    FINDINGS,
    LIGHTER,
    VIEWS,
    Look,
    browser,
    look,
    look_again,
    printed,
    recolour,
)  # fmt: skip
from digits import hanging_on_rounding
from maps import equations_in
from nrdob_course.claims import LEDGER, Verdict, check
from nrdob_course.claims.ledger import WIDTH
from nrdob_course.exercises import PROBLEMS
from pages import prose_of
from predictions import read_questions
from statements import theorems_of

# The whole book is built.
pytestmark = pytest.mark.thorough

ROOT = Path(__file__).resolve().parents[2]
REFERENCE_PAGES = {
    "index", "get", "ledger", "errata", "theorems", "paper_map", "notation", "glossary", "api",
    "comparison", "bibliography", "colophon", "trust",
}  # fmt: skip
REFERENCE_PAGES |= {f"api/{name}" for name in ("course", *apipages.pages_of(ROOT))}
TEACHING_PAGES = {
    f"teaching/{name}"
    for name in (
        "index", "syllabus", "objectives", "in_class", "mistakes", "rubric", "running", "seeds",
        "adding", "exam", "bench_lab",
    )
}  # fmt: skip
GENERATED = ("chapters", "ledger.md", "errata.md", "objectives.md", "mistakes.md", "rubric.md")

# Whatever a browser fetches by itself to show a page.
FETCHED = dict.fromkeys(("script", "iframe", "embed", "video", "audio"), ("src",))
FETCHED |= {"link": ("href",), "img": ("src", "srcset"), "source": ("src", "srcset")}
FETCHED |= {"object": ("data",)}
RELATED = {"stylesheet", "icon", "preload", "modulepreload"}


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a copy of the book's folder, without what was generated there."""
    source = tmp_path_factory.mktemp("book") / "source"
    shutil.copytree(ROOT / "book", source, ignore=shutil.ignore_patterns(*GENERATED))
    return source


Run = tuple[int, str]
"""Exit code of a program that makes pages, and what it says."""


def run(main: Callable[..., int], output: Path, **how: Any) -> Run:
    """Run a program that makes pages; a test judges the result."""
    with redirect_stdout(StringIO()) as said, redirect_stderr(said):
        code = main(["--output", str(output)], **how)
    return code, said.getvalue()


settled = cache(check)
"""Settle a claim, once for the page and the test of its verdict: all of them take a minute."""


@pytest.fixture(scope="module")
def ledger_run(source: Path) -> Run:
    """Write the pages of the ledger."""
    return run(ledger.main, source, settle=lambda claim: settled(claim.id))


@pytest.fixture(scope="module")
def teaching_run(source: Path) -> Run:
    """Write the generated pages for teachers."""
    return run(teaching.main, source / "teaching")


@pytest.fixture(scope="module")
def site(source: Path, ledger_run: Run, teaching_run: Run) -> Path:
    """Build the book from the notebooks as they are stored, and give the folder of pages."""
    folder = source.parent
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-b", "html"]
    command += ["-D", f"nrdob_notebooks={ROOT / 'notebooks'}", "-d", str(folder / "doctrees")]
    command += ["-D", f"nrdob_project={ROOT}"]
    done = subprocess.run(
        [*command, str(source), str(folder / "html")],
        capture_output=True,
        text=True,
        encoding="utf-8",
        errors="replace",
    )
    assert done.returncode == 0, f"the book does not build:\n{done.stdout}\n{done.stderr}"
    return folder / "html"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, BeautifulSoup]:
    """Give every page of the site, parsed; Sphinx's templates for other scripts are no pages."""
    return {
        path: parsed(path.read_text(encoding="utf-8"))
        for path in sorted(site.rglob("*.html"))
        if "_static" not in path.parts
    }


def parsed(page: str) -> BeautifulSoup:
    """Parse a page, but for the colours of its code, which are half of all tags."""
    plain = re.sub(
        "<pre>.*?</pre>", lambda code: re.sub("</?span[^>]*>", "", code[0]), page, flags=re.DOTALL
    )
    return BeautifulSoup(plain, "html.parser")


def is_external(address: str) -> bool:
    parts = urlsplit(address)
    return bool(parts.netloc) or parts.scheme in {"http", "https", "ftp"}


def test_the_ledger_is_in_order(ledger_run: Run) -> None:
    code, said = ledger_run
    assert code == 0, said


@pytest.mark.parametrize("id", LEDGER)
def test_every_claim_has_its_verdict(id: str) -> None:
    entry = settled(id)
    assert entry.finding.computed.strip()
    assert all(len(line) <= WIDTH for line in repr(entry).splitlines())
    assert entry.verdict.value in repr(entry)
    assert bool(entry.claim.amendment) == bool(entry.finding.conditions)


def test_a_check_finds_the_same_twice() -> None:
    for id in ("eq05.T_R", "lemma1.N_p", "sec3.speculation"):
        assert LEDGER[id].check() == settled(id).finding


def test_the_ledger_prints_nothing_that_hangs_on_rounding(source: Path, ledger_run: Run) -> None:
    text = "\n".join((source / f"{page}.md").read_text("utf-8") for page in ("ledger", "errata"))
    assert hanging_on_rounding(text) == []


def test_the_pages_for_teachers_are_in_order(teaching_run: Run) -> None:
    code, said = teaching_run
    assert code == 0, said


def test_every_page_is_there(site: Path) -> None:
    chapters = {f"chapters/{path.stem}" for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert chapters, "there are no notebooks, so there is no book"
    missing = [
        page
        for page in sorted(REFERENCE_PAGES | TEACHING_PAGES | chapters)
        if not (site / f"{page}.html").is_file()
    ]
    assert not missing, f"pages not built: {missing}"


def test_every_chapter_can_be_reached_from_the_front_page(pages: dict[Path, BeautifulSoup]) -> None:
    front = next(page for path, page in pages.items() if path.name == "index.html")
    links = {str(link["href"]).split("#")[0] for link in front.select("article a[href]")}
    wanted = {f"chapters/{path.stem}.html" for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert wanted <= links, f"no way from the front page to {sorted(wanted - links)}"


def test_a_chapter_shows_its_number_wherever_its_title_stands(
    site: Path, pages: dict[Path, BeautifulSoup]
) -> None:
    for path in sorted((site / "chapters").glob("*.html")):
        number = path.stem.partition("_")[0].lstrip("0")
        page = pages[path]
        titles = [page.title, page.select_one("article h1"), page.select_one("nav .current > a")]
        for title in titles:
            assert title and title.get_text().strip().startswith(f"{number}. "), path.name
        after = [link.get_text().strip() for link in page.select(".prev-next-title")]
        assert any(re.match(r"(\d+|[A-Z])\. ", text) for text in after), path.name


def test_pages_fetch_nothing_from_elsewhere(pages: dict[Path, BeautifulSoup]) -> None:
    external = [
        f"{path.name}: {tag.name} {tag[attribute]}"
        for path, page in pages.items()
        for tag in page(list(FETCHED))
        for attribute in FETCHED[tag.name]
        if tag.has_attr(attribute)
        and (tag.name != "link" or RELATED & set(tag.get_attribute_list("rel")))
        and any(is_external(part.strip()) for part in str(tag[attribute]).split(","))
    ]
    assert not external, "fetched from elsewhere:\n  " + "\n  ".join(external)


def test_styles_fetch_nothing_from_elsewhere(site: Path, pages: dict[Path, BeautifulSoup]) -> None:
    styles = {path.name: path.read_text(encoding="utf-8") for path in site.rglob("*.css")}
    styles |= {
        path.name: "\n".join(tag.get_text() for tag in page("style"))
        for path, page in pages.items()
    }
    fetch = re.compile(r"""(?:url\(\s*|@import\s+)["']?((?:https?:)?//[^"')\s]+)""")
    external = [
        f"{name}: {address}" for name, text in styles.items() for address in fetch.findall(text)
    ]
    assert not external, "fetched from elsewhere:\n  " + "\n  ".join(external)


def test_every_image_has_alt_text(pages: dict[Path, BeautifulSoup]) -> None:
    silent = [
        f"{path.name}: {image.get('src', '')[:80]}"
        for path, page in pages.items()
        for image in page("img")
        if not str(image.get("alt", "")).strip()
    ]
    assert not silent, "images without alt text:\n  " + "\n  ".join(silent)


def test_every_image_is_there(pages: dict[Path, BeautifulSoup]) -> None:
    missing = [
        f"{path.name}: {image['src']}"
        for path, page in pages.items()
        for image in page("img", src=True)
        if not str(image["src"]).startswith("data:")
        and not (path.parent / unquote(str(image["src"]))).is_file()
    ]
    assert not missing, "images that are not there:\n  " + "\n  ".join(missing)


def test_a_picture_of_a_chapter_opens_by_itself(pages: dict[Path, BeautifulSoup]) -> None:
    """On a phone its letters are too small, and only there it can be enlarged."""
    for path, page in pages.items():
        if path.parent.name != "chapters":
            continue
        for image in page.select(".bd-article img:not(.explorable-still)"):
            link = image.find_parent("a", class_="picture")
            assert link and link["href"] == image["src"], (path.name, image["alt"])


def test_links_inside_the_book_lead_somewhere(pages: dict[Path, BeautifulSoup]) -> None:
    anchors = {path.resolve(): {tag["id"] for tag in page(id=True)} for path, page in pages.items()}
    dead = []
    for path, page in pages.items():
        for link in page("a", href=True):
            address = urlsplit(str(link["href"]))
            if address.scheme or address.netloc:
                continue
            target = (
                (path.parent / unquote(address.path)).resolve() if address.path else path.resolve()
            )
            places = anchors.get(target)  # None: not a page, such as a notebook to download
            if not target.is_file():
                dead.append(f"{path.name}: {link['href']}")
            elif address.fragment and places and unquote(address.fragment) not in places:
                dead.append(f"{path.name}: {link['href']} (no such place on the page)")
    assert not dead, "dead links:\n  " + "\n  ".join(sorted(set(dead)))


def test_formulas_are_set_when_the_book_is_built(pages: dict[Path, BeautifulSoup]) -> None:
    with_formulas = 0
    for path, page in pages.items():
        formulas = page(class_="math")
        with_formulas += bool(formulas)
        for formula in formulas:
            (math,) = formula("math")
            assert math["alttext"] and math.find(True), (path.name, formula.get_text())
        assert not page("merror") and not page("script", src=re.compile("tex-")), path.name
        assert not re.search(r"\\[(\[]|\$\$", (page.article or page).get_text()), path.name
    assert with_formulas > 40


def test_letters_and_icons_come_with_the_site(site: Path, pages: dict[Path, BeautifulSoup]) -> None:
    """A character that is not among those shipped would be of another face."""
    static = site / "_static"
    faces = {
        face: set(TTFont(static / f"fonts/{face}.woff2").getBestCmap()) for face in fonts.FACES
    }
    icons = (static / "icons.css").read_text("utf-8")
    for path, page in pages.items():
        for math in page("math"):
            text = math.get_text() + ("ℎ" if "h" in math.get_text() else "")  # as a variable
            assert {ord(each) for each in text} <= faces["math"], math["alttext"]
        shown = {name for tag in page(class_=["fas", "fa-solid"]) for name in tag["class"]}
        wanted = {name for name in shown if re.match("fa-", name)} - {"fa-solid", "fa-fw", "fa-lg"}
        assert all(f".{name} {{ --icon" in icons for name in wanted), (path.name, wanted)
    english = {ord(each) for each in string.ascii_letters + string.digits + "é–—’“”…−λωδτη"}
    assert all(english <= found for face, found in faces.items() if face != "math")


def test_every_chapter_opens_with_a_question_that_needs_no_script(
    site: Path, pages: dict[Path, BeautifulSoup]
) -> None:
    for chapter, question in read_questions().items():
        page = pages[site / "chapters" / f"{chapter}.html"]
        (box,) = page.select(".prediction")
        choices = box.find_all("details", recursive=False)
        assert len(choices) == len(question.choices) and not box.select("script, button, input")
        for letter, choice in zip(question.choices, choices, strict=True):
            assert choice.summary.get_text().split()[0] == letter
            assert choice.get_text().count("Yes:") == (letter == question.right)
            assert len(choice.select("img")) == (letter == question.right), (
                "the figure that answers"
            )
        text = copy(box)
        for formula in text.select(".math"):
            formula.decompose()
        assert not re.search(r"[$\\*]", text.get_text()), chapter
        told = [picture for picture in (question.asked_with, question.answered_with) if picture]
        assert [image["alt"] for image in box.select("img")] == ([picture.alt for picture in told])


# --- the ledger -------------------------------------------------------------------------------


def anchor_of(id: str) -> str:
    """Give the anchor of a claim's entry; addresses in letters and papers rely on it."""
    return "claim-" + re.sub("[^a-z0-9]+", "-", id.lower())


def test_the_ledger_has_an_entry_for_every_claim(
    site: Path, pages: dict[Path, BeautifulSoup]
) -> None:
    entries = pages[site / "ledger.html"].select(".claim")
    names = [entry.select_one("h3 code").get_text() for entry in entries]
    assert names == sorted(LEDGER, key=names.index)
    assert [entry["id"] for entry in entries] == [anchor_of(id) for id in names]


def test_citations_lead_to_the_ledger(site: Path, pages: dict[Path, BeautifulSoup]) -> None:
    citations = [
        (path, code) for path, page in pages.items() for code in page.select("code.claim-link")
    ]
    assert {path.parent.name for path, _ in citations} >= {"chapters"}, "no chapter cites a claim"
    target = (site / "ledger.html").resolve()
    for path, code in citations:
        address = urlsplit(str(code.find_parent("a")["href"]))
        assert (path.parent / (address.path or path.name)).resolve() == target
        assert address.fragment == anchor_of(code.get_text())


def test_the_ledger_leads_to_the_first_citation(
    site: Path, pages: dict[Path, BeautifulSoup]
) -> None:
    places = {
        path.resolve(): {tag["id"]: tag for tag in page(id=True)} for path, page in pages.items()
    }
    for entry in pages[site / "ledger.html"].select(".claim"):
        id = entry.select_one("h3 code").get_text()
        links = entry.select("a[href*='#shown-']")
        assert links, f"{id} leads to no chapter"
        for link in links:
            address = urlsplit(str(link["href"]))
            place = places[(site / address.path).resolve()][address.fragment]
            assert id in place.get_text()


def test_only_the_ledger_has_the_filter(site: Path, pages: dict[Path, BeautifulSoup]) -> None:
    with_filter = {
        path for path, page in pages.items() if page("script", src=re.compile("claims[.]js"))
    }
    assert with_filter == {site / "ledger.html"}
    assert pages[site / "ledger.html"].select_one(".claims-filter")
    verdicts = {badge.get_text() for badge in pages[site / "ledger.html"].select("dt .verdict")}
    assert verdicts == set(Verdict)


def test_every_claim_is_a_card_folded_to_two_lines(
    site: Path, pages: dict[Path, BeautifulSoup]
) -> None:
    for entry in pages[site / "ledger.html"].select(".claim"):
        assert entry.name == "details" and not entry.has_attr("open")
        assert entry.summary.select_one(".verdict") and entry.summary.select_one(".claim-line")
        assert not entry.summary.select("a"), "a link there would open the card as well"


# --- weight -----------------------------------------------------------------------------------

# In bytes, as a server sends them: what is text, compressed. When this was written: 1.13 MB for the
# heaviest chapter with its figures, and 175 kB before a page is shown.
MOST_OF_A_PAGE, MOST_BEFORE_THE_FIRST_WORD = 1_200_000, 200_000
MOST_NODES = 20_000
MOST_SCREENS = 6


def fetched(path: Path, tags: list[Any], attribute: str) -> set[Path]:
    """Find the files beside a page that it fetches."""
    addresses = {str(tag[attribute]).split("?")[0] for tag in tags}
    return {path.parent / unquote(each) for each in addresses if not each.startswith("data:")}


@cache
def sent(path: Path) -> int:
    """Say how many bytes of a file travel; pictures and letters are compressed already."""
    data = path.read_bytes()
    return len(data if path.suffix in {".png", ".woff2"} else gzip.compress(data))


def test_pages_are_light(site: Path, pages: dict[Path, BeautifulSoup]) -> None:
    letters = set((site / "_static" / "fonts").iterdir())
    for path, page in pages.items():
        files = {path} | letters | fetched(path, page("img", src=True), "src")
        files |= fetched(path, page("script", src=True), "src")
        files |= fetched(path, page("link", rel="stylesheet"), "href")
        assert sum(map(sent, files)) < MOST_OF_A_PAGE, path.name
        nodes = re.findall("<[a-z]", path.read_text("utf-8"))
        assert len(nodes) < MOST_NODES, path.name


def test_little_keeps_a_page_from_being_shown(pages: dict[Path, BeautifulSoup]) -> None:
    """What is deferred comes after the words and the figures."""
    for path, page in pages.items():
        at_once = page("script", src=True, defer=None, attrs={"async": None})
        files = {path} | fetched(path, at_once, "src")
        files |= fetched(path, page("link", rel="stylesheet"), "href")
        if path.name != "search.html":
            assert sum(map(sent, files)) < MOST_BEFORE_THE_FIRST_WORD, path.name


def test_every_rule_of_the_styles_is_closed() -> None:
    """A browser takes what follows an open rule for a part of it, and says nothing."""
    text = re.sub(r"/\*.*?\*/", "", (ROOT / "book/_static/book.css").read_text("utf-8"), flags=re.S)
    assert text.count("{") == text.count("}")


# --- exercises --------------------------------------------------------------------------------


def test_an_answer_opens_at_one_click_and_is_named_after_its_exercise(
    pages: dict[Path, BeautifulSoup],
) -> None:
    for path, page in pages.items():
        assert not page("summary", attrs={"aria-label": re.compile("^Toggle")}), path.name
        if path.parent.name != "chapters":
            continue
        (exercises,) = page(id="try-it")
        toggles = exercises.select(".solution > summary")
        names = [" ".join(toggle.get_text().split()) for toggle in toggles]
        assert len(set(names)) == len(names) >= 3, path.name
        for name in names:
            assert re.fullmatch(r"Solution of (exercise \d+|the design brief)", name), path.name
        assert not exercises.select("details.hide"), "the code has a toggle of its own"
        assert not exercises.select(".cell_input:not(.solution .cell_input)"), path.name
        assert not exercises.select("details:not([class])"), f"{path.name}: a bare triangle"


def test_a_folded_cell_says_whether_it_checks_or_draws(pages: dict[Path, BeautifulSoup]) -> None:
    for path, page in pages.items():
        for folded in page("details", class_="hide"):
            cell = folded.find_parent(class_="cell")
            draws = cell.select_one(".cell_output img:not(.hide img)")
            checks = cell.select_one("details.hide > .cell_input ~ .cell_output")
            if draws or checks:
                said = cell.select_one("summary > .collapsed").get_text()
                assert said != "Show the code", path.name


# --- ways into the book -----------------------------------------------------------------------


def test_every_theorem_has_its_box_and_its_entry(
    site: Path, pages: dict[Path, BeautifulSoup]
) -> None:
    theorems = [each for of in theorems_of(ROOT / "notebooks").values() for each in of]
    for theorem in theorems:
        page = pages[site / "chapters" / f"{theorem.page}.html"]
        assert page.select(f"div.theorem#{theorem.anchor}"), str(theorem)
    entries = pages[site / "theorems.html"].select(".theorem-entry")
    assert len(entries) == len(theorems)
    for theorem, entry in zip(theorems, entries, strict=True):
        link = f"a[href='chapters/{theorem.page}.html#{theorem.anchor}']"
        assert entry.select(link), str(theorem)


def test_the_papers_equations_have_anchors_and_lead_to_the_ledger(
    site: Path, pages: dict[Path, BeautifulSoup]
) -> None:
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        page = pages[site / "chapters" / f"{path.stem}.html"]
        for number in equations_in(prose_of(path)):
            assert page.select_one(f"#paper-eq-{number}"), (path.stem, number)
            assert any(f"({number})" in line.get_text() for line in page.select(".paper-number"))


def test_the_index_holds_ideas_and_no_names_of_the_package(
    site: Path, pages: dict[Path, BeautifulSoup]
) -> None:
    links = [str(link["href"]) for link in pages[site / "genindex.html"].select("td a[href]")]
    assert not [link for link in links if link.startswith("api")]
    smith = [link for link in links if link.startswith("chapters/15_dead_time")]
    assert smith and any(link.startswith("glossary.html#term-") for link in links)


# --- for teachers -----------------------------------------------------------------------------


def test_formulas_of_the_pages_for_teachers_are_set(
    site: Path, pages: dict[Path, BeautifulSoup]
) -> None:
    for name in TEACHING_PAGES:
        article = copy(pages[site / f"{name}.html"].article)
        for tag in article.select("code, pre, .math"):
            tag.decompose()
        assert not re.search(r"[$\\]", article.get_text()), name


def test_every_mistake_is_shown_as_the_student_reads_it(
    site: Path, pages: dict[Path, BeautifulSoup]
) -> None:
    def text(tag: object) -> str:
        straight = str.maketrans("‘’“”", "''\"\"")  # Sphinx writes the quotes of print
        return " ".join(str(tag.get_text()).translate(straight).split())

    tables = {
        text(section.h3).split()[0]: section.select("tbody tr")
        for section in pages[site / "teaching" / "mistakes.html"].select("section section")
        if section.h3
    }
    for id, problem in PROBLEMS.items():
        shown = [[text(cell) for cell in row("td")][:2] for row in tables[id]]
        assert shown == [[m.name, " ".join(m.says.split())] for m in problem.misconceptions]


# --- in a browser -----------------------------------------------------------------------------


Looks = dict[str, Look]
Broken = dict[str, list[tuple[str, str]]]
"""By page: a rule, and the piece of the page that breaks it."""

ONE_OF_EACH_KIND = {
    "index", "chapters/01_can_you_compute_the_load", "ledger", "search", "theorems", "glossary",
    "get", "teaching/running", "bibliography",
}  # fmt: skip
"""Pages that a screen reader is asked about."""


@dataclass(frozen=True)
class Opened:
    """What was seen on every page: on a phone, in another view, and by a screen reader."""

    phone: Looks
    other: Looks
    unheard: Broken


@pytest.fixture(scope="module")
def opened() -> Iterator[Any]:
    """Open one browser for all the pages."""
    if CHROMIUM is None:
        warnings.warn("No Chromium on this machine: the pages were not opened.", stacklevel=1)
        pytest.skip("no Chromium on this machine: THE PAGES WERE NOT OPENED IN A BROWSER")
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def seen(site: Path, pages: dict[Path, BeautifulSoup], opened: Any) -> Opened:
    """Open every page as on a phone, 360 pixels wide, and then, nothing folded, in another view.

    The pages of the rooms are made alike: one of them stands for the others in the other view.
    There a screen reader is asked, too, about a page of each kind.
    """
    tab = opened.new_page()
    phone, other, unheard = {}, {}, {}
    for path, (width, colours) in zip(pages, cycle(VIEWS), strict=False):
        page = path.relative_to(site).as_posix()
        tab.goto("about:blank")  # else the page before would be set once more
        tab.emulate_media(color_scheme="light")
        tab.set_viewport_size({"width": 360, "height": 800})
        phone[page] = look(tab, path)
        if not page.startswith("api/") or page == "api/design.html":
            other[f"{page}, {width}, {colours}"] = look_again(tab, width, colours)
        if page.removesuffix(".html") in ONE_OF_EACH_KIND:
            unheard[page.removesuffix(".html")] = list(unheard_on(tab))
    return Opened(phone, other, unheard)


def unheard_on(tab: Any) -> Iterator[tuple[str, str]]:
    """Ask axe what a screen reader does not tell of the page that is open."""
    tab.evaluate(LIGHTER)
    found = Axe().run(tab, options={"resultTypes": ["violations"]}).response["violations"]
    for broken in found:
        if broken["impact"] != "minor" or broken["id"] == "empty-table-header":
            yield broken["id"], broken["nodes"][0]["html"][:100]


@pytest.fixture(scope="module")
def looks(seen: Opened) -> Looks:
    """Give what was seen on the phone."""
    return seen.phone


def test_wider_darker_and_unfolded_nothing_is_cut_or_distorted(seen: Opened) -> None:
    assert {view: look.amiss for view, look in seen.other.items() if look.amiss} == {}


def test_a_reader_with_a_screen_reader_meets_nothing_serious(seen: Opened) -> None:
    assert seen.unheard == {page: [] for page in ONE_OF_EACH_KIND}


def test_no_page_scrolls_sideways_on_a_phone(looks: dict[str, Look]) -> None:
    assert {page: seen.overflow for page, seen in looks.items() if seen.overflow > 0} == {}


def test_no_figure_is_distorted_and_no_formula_cut_on_a_phone(looks: dict[str, Look]) -> None:
    assert {page: seen.distorted for page, seen in looks.items() if seen.distorted} == {}
    assert {page: seen.cut for page, seen in looks.items() if seen.cut} == {}


def test_a_short_formula_stays_in_the_line_of_its_choice(looks: dict[str, Look]) -> None:
    assert {page: seen.torn for page, seen in looks.items() if seen.torn} == {}


def test_formulas_are_no_stops_for_the_tab_key(looks: dict[str, Look]) -> None:
    assert sum(seen.stops for seen in looks.values()) == 0, "but those that scroll"


def test_pages_say_nothing_to_the_console_and_ask_no_server(looks: dict[str, Look]) -> None:
    assert {page: seen.said for page, seen in looks.items() if seen.said} == {}


def test_the_first_picture_of_a_chapter_is_near(looks: Looks) -> None:
    """On a phone, in screens from the top; 1 to 5.5 when this was written."""
    chapters = {page: seen.picture for page, seen in looks.items() if page.startswith("chapters/")}
    far = {page[9:11]: screens for page, screens in chapters.items() if screens > MOST_SCREENS}
    assert far == {}
    assert looks["index.html"].picture < 1


MOVED = {
    "index", "chapters/10_all_filters", "chapters/15_dead_time_in_the_model",
    "chapters/19_on_a_processor", "chapters/22_alternatives", "chapters/D_a_proof_you_can_check",
}  # fmt: skip
"""Pages with sliders: one of each kind, with a load, a chart and the most sliders."""

BESIDE = """async () => {
  const [page] = nrdob.explorables;
  const found = [];
  for (const slider of page.board.querySelectorAll(".explorable-slider input")) {
    slider.focus();
    await new Promise((go) => requestAnimationFrame(() => setTimeout(go)));
    const plots = [...page.board.querySelectorAll(".explorable-plots > svg")];
    const seen = [page.verdict, plots.find((each) => each.checkVisibility()), slider];
    const whole = (box) => box.top >= 0 && box.bottom <= innerHeight;
    const boxes = seen.map((each) => each.getBoundingClientRect());
    const covers = boxes[1].bottom > boxes[2].top && boxes[1].top < boxes[2].bottom;
    if (!boxes.every(whole) || covers) found.push(slider.id);
  }
  return found;
}"""

HEIGHTS = """async () => {
  const [page] = nrdob.explorables;
  const sliders = Object.entries(page.given.range);
  const heights = new Set();
  for (let k = 0; k < 2 ** sliders.length; k++) {
    page.to(Object.fromEntries(sliders.map(([name, range], i) => [name, range[(k >> i) & 1]])));
    heights.add(Math.round(page.board.getBoundingClientRect().height));
    await new Promise((go) => setTimeout(go, 20)); // what is found in the background
    heights.add(Math.round(page.board.getBoundingClientRect().height));
  }
  return [...heights];
}"""


SLIDES = """() => [...document.querySelectorAll("html, body *")].filter((each) => {
  const { transitionDuration, animationName, scrollBehavior } = getComputedStyle(each);
  const slides = transitionDuration.split(",").some((time) => parseFloat(time) > 0);
  return slides || animationName !== "none" || scrollBehavior === "smooth";
}).map((each) => each.className)"""


def moved(site: Path, opened: Any, **how: Any) -> Iterator[tuple[str, Any]]:
    """Open each page that has sliders in a tab of its own."""
    for page in sorted(MOVED):
        with opened.new_page(**how) as tab:
            tab.goto((site / f"{page}.html").as_uri())
            tab.wait_for_function("() => window.nrdob?.explorables")
            tab.evaluate(pdf.SETTLED)
            yield page, tab


@dataclass(frozen=True)
class Slid:
    """What is amiss on a page with sliders: what slides, is cut or hidden, and all its heights."""

    slides: list[str]
    cut: list[str]
    hidden: list[str]
    heights: dict[int, list[int]]


@pytest.fixture(scope="module")
def slid(site: Path, opened: Any) -> dict[str, Slid]:
    """Look over the pages that have sliders, each in one view after the other."""
    return {page: in_turn(tab) for page, tab in moved(site, opened, reduced_motion="reduce")}


def in_turn(tab: Any) -> Slid:
    """Look without motion, with letters twice as large, as on a phone, and on a tablet."""

    def on(width: int, height: int, letters: str, script: str) -> Any:
        tab.set_viewport_size({"width": width, "height": height})
        tab.evaluate("(size) => { document.documentElement.style.fontSize = size; }", letters)
        tab.wait_for_timeout(250)
        return tab.evaluate(script)

    slides = tab.evaluate(SLIDES)
    tab.emulate_media(reduced_motion="no-preference")
    cut = on(1280, 800, "200%", CUT)
    hidden = on(360, 740, "", BESIDE)
    return Slid(slides, cut, hidden, {width: on(width, 740, "", HEIGHTS) for width in (360, 800)})


def test_on_a_phone_verdict_and_plot_are_seen_beside_every_slider(slid: dict[str, Slid]) -> None:
    assert {page: seen.hidden for page, seen in slid.items()} == {page: [] for page in MOVED}


@pytest.mark.parametrize("width", [360, 800])
def test_nothing_jumps_while_a_slider_moves(slid: dict[str, Slid], width: int) -> None:
    heights = {page: seen.heights[width] for page, seen in slid.items()}
    assert {page: found for page, found in heights.items() if len(found) > 1} == {}


def test_pages_with_sliders_can_be_enlarged(site: Path, slid: dict[str, Slid], opened: Any) -> None:
    """Twice as large on a screen of 1280 pixels, and with letters alone twice as large."""
    screen = {"viewport": {"width": 640, "height": 400}, "device_scale_factor": 2}
    for page, tab in moved(site, opened, **screen):
        tab.wait_for_timeout(250)
        assert Look(**tab.evaluate(FINDINGS), said=[]).amiss == [], page
        assert tab.evaluate(CUT) == [], page
    assert {page: seen.cut for page, seen in slid.items()} == {page: [] for page in MOVED}


CUT = """() => [...document.querySelectorAll(".explorable :is(p, label, button, span, select)")]
  .filter((each) => each.checkVisibility() && !each.closest(".visually-hidden"))
  .filter((each) => each.scrollWidth > each.clientWidth + 1 && each.clientWidth
    || each.getBoundingClientRect().right > document.documentElement.clientWidth)
  .map((each) => each.textContent)"""


def test_nothing_slides_or_fades_for_who_does_not_want_it(slid: dict[str, Slid]) -> None:
    assert {page: seen.slides for page, seen in slid.items()} == {page: [] for page in MOVED}


def test_with_forced_colours_what_differs_is_told_apart(site: Path, opened: Any) -> None:
    script = """() => {
      const style = (what) => getComputedStyle(document.querySelector(`.explorable ${what}`));
      const canvas = getComputedStyle(document.body).backgroundColor;
      return {
        ground: [canvas, style(".nyquist .curve").stroke, style("path.minus-one").stroke],
        bar: [canvas, style(".bar .ground").fill, style(".bar .works").fill],
        mark: [style(".bar .works").fill, style(".bar .present").stroke],
        load: [canvas, style(".step .plain").stroke, style(".step .curve").stroke],
        words: [canvas, style(".nyquist text").fill],
      };
    }"""
    tab = opened.new_page(forced_colors="active")
    tab.goto((site / "index.html").as_uri())
    tab.wait_for_function("() => window.nrdob?.explorables")
    for colours in ("light", "dark"):
        recolour(tab, colours)
        for name, drawn in tab.evaluate(script).items():
            assert len(set(drawn)) == len(drawn), (colours, name, drawn)


def test_the_tab_key_reaches_the_sliders_by_one_link(site: Path, opened: Any) -> None:
    tab = opened.new_page()
    tab.goto((site / "chapters" / "05_how_slow_must_the_filter_be.html").as_uri())
    tab.wait_for_function("() => window.nrdob?.explorables")
    tab.keyboard.press("Tab")
    assert tab.evaluate("document.activeElement.textContent") == "Skip to main content"
    tab.keyboard.press("Tab")
    assert tab.evaluate("document.activeElement.textContent") == "Skip to the sliders"
    tab.keyboard.press("Enter")
    assert tab.evaluate("document.activeElement.type") == "range"
    tab.reload()
    tab.keyboard.press("Tab")
    tab.keyboard.press("Enter")
    tab.keyboard.press("Tab")
    assert tab.evaluate("document.activeElement.closest('main') !== null")


SIZES = """() => {
  const size = (each) => parseFloat(getComputedStyle(each).fontSize);
  const code = [...document.querySelectorAll(".bd-content :is(p, li) > code")]
    .filter((each) => each.checkVisibility());
  const blocks = [...document.querySelectorAll(".bd-content div.cell_input pre")]
    .filter((each) => each.checkVisibility());
  const columns = blocks.map((block) => {
    const letter = Object.assign(document.createElement("span"), { textContent: "0" });
    block.append(letter);
    const { paddingLeft, paddingRight } = getComputedStyle(block);
    const room = block.clientWidth - parseFloat(paddingLeft) - parseFloat(paddingRight);
    const found = room / letter.getBoundingClientRect().width;
    letter.remove();
    return found;
  });
  return {
    code: Math.min(...code.map((each) => size(each) / size(each.parentElement))),
    block: Math.min(...blocks.map(size)), columns: Math.min(...columns),
  };
}"""


def test_code_is_as_large_as_the_text(site: Path, opened: Any) -> None:
    tab = opened.new_page()
    tab.goto((site / "chapters" / "05_how_slow_must_the_filter_be.html").as_uri())
    for width, block, columns in ((360, 13, 0), (800, 13, 88), (1400, 14, 88)):
        tab.set_viewport_size({"width": width, "height": 800})
        found = tab.evaluate(SIZES)
        assert found["code"] >= 0.95, (width, found)
        assert found["block"] >= block and found["columns"] >= columns, (width, found)


@pytest.mark.parametrize("page", ["teaching/syllabus", "chapters/11_rules"])
def test_a_table_that_goes_on_has_a_shadow_there(site: Path, opened: Any, page: str) -> None:
    tab = opened.new_page(viewport={"width": 360, "height": 740})
    tab.goto((site / f"{page}.html").as_uri())
    tab.evaluate(pdf.SETTLED)
    boxes = tab.locator(".bd-content :is(.pst-scrollable-table-container, .output.text_html)")
    wide = "e => e.scrollWidth > e.clientWidth + 20 && e.checkVisibility()"
    box = next(each for each in boxes.all() if each.evaluate(wide))
    box.evaluate("e => scrollBy({ top: e.getBoundingClientRect().top - 100, behavior: 'instant' })")
    piece = {**box.bounding_box(), "height": 150}

    def shaded(colours: str) -> tuple[bool, bool]:
        """Tell whether the left and the right edge are shaded, beside the letters."""
        taken = Image.open(BytesIO(tab.screenshot(clip=piece)))
        picture = np.asarray(taken.convert("L"), dtype=float)
        picture = picture if colours == "light" else 255 - picture
        edges = [np.percentile(picture[:, k], 90) for k in (1, -2)]
        return tuple(bool(edge < np.percentile(picture, 90) - 25) for edge in edges)

    for colours in ("light", "dark"):
        recolour(tab, colours)
        box.evaluate("e => { e.scrollLeft = 0; }")
        assert shaded(colours) == (False, True)
        box.evaluate("e => { e.scrollLeft = e.scrollWidth; }")
        assert shaded(colours) == (True, False)


QUERIES = {
    "dead time": "chapters/07_do_endless_encirclements_matter",
    "Nyquist": "chapters/05_how_slow_must_the_filter_be",
    "how to choose lambda": "chapters/10_all_filters",
    "Smith predictor": "chapters/15_dead_time_in_the_model",
    "noise": "chapters/18_noise",
    "saturation": "chapters/20_actuator_limits",
    "PID": "chapters/16_what_it_is",
    "unstable plant": "chapters/06_why_must_the_model_be_wrong",
    "nyquits": "chapters/05_how_slow_must_the_filter_be",
    "disturbence observer": "chapters/02_why_two_conditions",
    "satruation": "chapters/20_actuator_limits",
    "robutsness": "chapters/08_which_margin_is_the_plants",
    "sensitivity": "chapters/09_the_filter",
    "Ms": "chapters/08_which_margin_is_the_plants",
    "discrete time sampling": "chapters/19_on_a_processor",
    "low pass filter order": "chapters/09_the_filter",
    "gain margin": "chapters/08_which_margin_is_the_plants",
    "delay margin": "chapters/08_which_margin_is_the_plants",
    "anti-windup": "chapters/20_actuator_limits",
    "encoder": "chapters/21_a_drive",
    "stiction": "chapters/21_a_drive",
    "ADRC": "chapters/22_alternatives",
    "internal model control": "chapters/16_what_it_is",
    "parity": "chapters/06_why_must_the_model_be_wrong",
    "waterbed": "chapters/13_limits",
    "certificate": "chapters/D_a_proof_you_can_check",
    "identification": "chapters/23_a_measured_plant",
    "non-minimum phase": "chapters/14_unstable_and_non_minimum_phase",
    "small gain": "chapters/04_what_exactly_is_lemma_1",
    "Lemma 2": "chapters/08_which_margin_is_the_plants",
    "two mass resonance": "chapters/21_a_drive",
    "errata": "errata",
}
"""What a reader types, and the page that must come first."""

RANKED = """
const { readFileSync } = require("fs");
globalThis.window = globalThis;
globalThis.Search = {};
for (const name of process.argv.slice(1)) (0, eval)(readFileSync(name, "utf8"));
const asked = JSON.parse(readFileSync(0, "utf8"));
process.stdout.write(JSON.stringify(asked.map((query) => Search.best(query)[0]?.page ?? "")));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="no node: the search was NOT asked")
def test_thirty_queries_have_the_right_page_first(site: Path) -> None:
    scripts = [str(site / "_static" / name) for name in ("texts.js", "search.js")]
    done = subprocess.run(
        ["node", "-e", RANKED, "--", *scripts], input=json.dumps([*QUERIES, "xyzzy"]), text=True,
        capture_output=True, check=True,
    )  # fmt: skip
    assert len(QUERIES) >= 30
    assert dict(zip([*QUERIES, "xyzzy"], json.loads(done.stdout), strict=True)) == QUERIES | {
        "xyzzy": ""
    }


FOUND = """(query) => {
  if (query) {
    document.querySelector("#search-results").replaceChildren();
    Search.performSearch(query);
  }
  return [...document.querySelectorAll("ul.search li")].map((each) => [
    each.querySelector("a").getAttribute("href"),
    each.querySelector(".context")?.textContent ?? "",
  ]);
}"""


@pytest.fixture(scope="module")
def searched(site: Path, opened: Any) -> dict[str, list[tuple[str, str]]]:
    """Ask the search, from the disk, and give for each query the pages found, and what they say.

    The first one comes with the address, as from any other page, and has a space in it.
    """
    first, *others = (*QUERIES, "stabilizing_time_constants", "xyzzy")
    with opened.new_page(viewport={"width": 360, "height": 800}) as tab:
        tab.goto(f"{(site / 'search.html').as_uri()}?q={quote(first)}")
        tab.wait_for_function("document.querySelector('.search-summary')?.textContent")
        return {first: tab.evaluate(FOUND)} | {
            query: tab.evaluate(FOUND, query) for query in others
        }


def test_the_search_leads_a_student_to_the_right_chapter_first(
    searched: dict[str, list[tuple[str, str]]],
) -> None:
    first = {query: searched[query][0][0].split(".html")[0] for query in QUERIES}
    assert first == QUERIES
    assert searched["xyzzy"] == []
    assert searched["stabilizing_time_constants"][0][0].startswith("api/design.html#")


def test_what_the_search_shows_can_be_read(
    searched: dict[str, list[tuple[str, str]]],
) -> None:
    for query in QUERIES:
        assert searched[query][0][1], query
        for page, said in searched[query]:
            assert not re.search(r"[\\$]|\{cite|claim:", said), (query, page, said)


def test_what_the_search_loads_is_small(site: Path) -> None:
    assert (site / "_static" / "texts.js").stat().st_size < 400_000


def test_a_link_to_a_claim_opens_its_card(site: Path, opened: Any) -> None:
    with opened.new_context(viewport={"width": 360, "height": 800}) as context:
        tab = context.new_page()
        tab.goto(f"{(site / 'ledger.html').as_uri()}#claim-eq03")
        tab.wait_for_selector("#claim-eq03[open]")
        assert tab.evaluate("document.querySelectorAll('.claim[open]').length") == 1
        screens = tab.evaluate("document.documentElement.scrollHeight / innerHeight")
        assert screens < 30, f"the ledger is {screens:.0f} screens long on a phone"
        tab.keyboard.press("Escape")
        tab.focus("#claims-search")
        tab.keyboard.type("bandwidth")
        assert 0 < tab.locator(".claim:visible").count() < 60
        tab.click(".claims-reset")
        tab.emulate_media(media="print")
        printed = tab.evaluate(
            "() => [...document.querySelectorAll('.claim > dl')].filter((each) => "
            "each.checkVisibility() && each.getBoundingClientRect().height > 5).length"
        )
        assert printed == len(LEDGER), "on paper nothing can be opened"


def test_the_reference_tells_of_each_thing_once_and_in_words(
    pages: dict[Path, BeautifulSoup],
) -> None:
    seen: dict[object, str] = {}
    for path, soup in pages.items():
        if path.parent.name != "api":
            continue
        for entry in soup.select("dl.py:is(.class, .exception, .function) > dt[id]"):
            module, name = str(entry["id"]).rsplit(".", 1)
            thing = getattr(import_module(module), name)
            assert thing not in seen, f"{path.name}: {entry['id']} is {seen[thing]} once more"
            seen[thing] = str(entry["id"])
        raw = re.findall(r"Alias for field number|alias of ", soup.get_text())
        raw += [e.get_text() for e in soup.select("dt.sig") if re.search(r"[<>]", e.get_text())]
        assert not raw, f"{path.name} shows {raw}"
        lists = soup.select("ol.upperalpha")
        assert not lists, f"{path.name}: a list begins at an initial, {lists[0].get_text()}"
    assert seen


# --- on paper ---------------------------------------------------------------------------------

NOT_ON_PAPER = (
    ".cell:not(.solution *):has(> .cell_output img) .cell_input pre,"
    ".cell > details.hide .cell_input pre"
)
"""Code that draws, and code that checks."""


def squeezed(text: str) -> str:
    """Leave out where a line is broken."""
    return re.sub(r"\s", "", text)


def code(page: BeautifulSoup, on_paper: bool) -> set[str]:
    """Give the lines of code that are printed or not, if they are long enough to be known again."""
    left_out = {id(pre) for pre in page.select(NOT_ON_PAPER)}  # equal tags are compared through
    blocks = [pre for pre in page.select(".cell_input pre") if (id(pre) in left_out) != on_paper]
    found = {squeezed(line) for pre in blocks for line in pre.get_text().splitlines()}
    return {line for line in found if len(line) > 20}


@pytest.mark.parametrize(
    "name", ["05_how_slow_must_the_filter_be", "13_limits", "19_on_a_processor"]
)
def test_a_printed_chapter_is_short_and_has_its_answers_at_its_end(
    site: Path, pages: dict[Path, BeautifulSoup], opened: Any, tmp_path: Path, name: str
) -> None:
    path = site / "chapters" / f"{name}.html"
    page, tab = pages[path], opened.new_page()
    paper = printed(tab, path, tmp_path / "chapter.pdf")
    assert len(paper.pages) <= 16
    text = squeezed("".join(sheet.extract_text() for sheet in paper.pages))
    shown = code(page, on_paper=True)
    hidden = code(page, on_paper=False) - shown
    assert hidden and not [line for line in hidden if line in text]
    assert shown and not [line for line in shown if line not in text]
    before, answers = text.split("Answers")
    *_, last = page.select(".prediction > details > summary")
    choice = max(map(squeezed, last.find_all(string=True)), key=len)
    assert choice in before and "Summary" in before
    for answer in page.select(".prediction > details > p > strong, .solution > summary"):
        said = squeezed(answer.get_text())
        assert said in answers and said not in before
    assert not tab.query_selector(".answers"), "on the screen they come back"
    assert tab.locator(".prediction > details > p").count() > 0
