"""Write the built book as one PDF, with an outline, page numbers, and links that stay inside.

A browser sets it: Debian's Chromium, or any other on the path. Formulas are set once; then it is
printed twice, the second time with the page numbers in the contents. It takes some minutes.
"""

import logging
import re
import shutil
import sys
from collections.abc import Iterator
from importlib.metadata import distribution
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urldefrag, urljoin

from bs4 import BeautifulSoup, Tag
from markupsafe import Markup
from pypdf import PdfReader, PdfWriter
from pypdf.generic import NameObject, TextStringObject

from pages import ROOT, options, render, store

LEFT_OUT = ("api", "search", "genindex", "teaching/")
"""Not for reading from the front to the back; teachers have pages of their own to be printed."""

UNPRINTED = "a.headerlink, script, button, .claims-filter, .toctree-wrapper, #all-chapters"
"""What needs a screen, and the map of the chapters: on paper the contents stand before it."""

NAMES = ("id", "for", "aria-labelledby", "aria-describedby", "aria-controls")

PAPER = 650
"""Width of the text in pixels, as a browser counts them on paper."""

SETTLED = "() => document.fonts.ready.then(() => true)"
"""Once the letters are there the page has its final form."""


class Chapter(NamedTuple):
    """A page of the site, as it stands in the book: the name that links lead to, title and text."""

    place: str
    title: str
    text: Tag


class Part(NamedTuple):
    """Some chapters with a title."""

    title: str
    chapters: tuple[Chapter, ...]


def read(page: Path) -> BeautifulSoup:
    return BeautifulSoup(page.read_text("utf-8"), "html.parser")


def one(tree: Tag, selector: str) -> Tag:
    """Give the one element that a page of the site is sure to have."""
    found = tree.select_one(selector)
    if found is None:
        raise ValueError(f"the site has no {selector!r}; build it anew with make book")
    return found


def contents(site: Path) -> dict[str, list[str]]:
    """Read off the front page which pages there are, part by part."""
    listed = one(read(site / "index.html"), "nav.bd-links")
    titles, lists = listed.select("p.caption"), listed.select("p.caption + ul")
    found = {"": ["index"]}
    for title, part in zip(titles, lists, strict=True):
        links = [str(link["href"]) for link in part.select("li.toctree-l1 > a")]
        pages = [link.removesuffix(".html") for link in links if not link.startswith(LEFT_OUT)]
        if pages:
            found[title.get_text(strip=True)] = pages
    return found


def anchor(page: str, name: str = "") -> str:
    """Name a place of a page, where all pages are one."""
    return f"{page.replace('/', '-')}--{name}"


def address(page: str, link: str, printed: frozenset[str]) -> str:
    """Lead a link to a printed page inside, and see other files from the top of the site."""
    if re.match(r"[a-z]+:", link):
        return link
    target, name = urldefrag(urljoin(f"{page}.html", link))
    stem = target.removesuffix(".html")
    return f"#{anchor(stem, name)}" if stem in printed else target


def chapter(site: Path, page: str, printed: frozenset[str]) -> Chapter:
    """Take the text out of a page; its names and links become those of the whole."""
    text = one(read(site / f"{page}.html"), "article.bd-article")
    for unwanted in text.select(UNPRINTED):
        unwanted.decompose()
    for element in text.find_all(True):
        for name in NAMES:
            if given := element.get_attribute_list(name):
                element[name] = " ".join(anchor(page, each) for each in given if each)
        for name in {"href", "src"} & element.attrs.keys():
            element[name] = address(page, str(element[name]), printed)
        if element.name == "details":
            element["open"] = ""
    for link in text.select("a[href]"):
        if not re.match(r"#|[a-z]+:", str(link["href"])):  # what it leads to is not in the PDF
            link.unwrap()
    return Chapter(anchor(page), one(text, "h1").get_text(" ", strip=True), text)


def parts(site: Path) -> Iterator[Part]:
    """Read the book off its site."""
    listed = contents(site)
    printed = frozenset(chain.from_iterable(listed.values()))
    for title, pages in listed.items():
        yield Part(title, tuple(chapter(site, page, printed) for page in pages))


def head(site: Path) -> Markup:
    """Give the styles of the site, and what moves the answers."""
    page = read(min(site.glob("chapters/*.html")))
    wanted = one(page, "head").select("link[rel=stylesheet], script[src*='paper.js']")
    return Markup("".join(map(str, wanted)).replace("../_static", "_static"))


def headings(book: list[Part]) -> Iterator[str]:
    """Give what stands in the outline, in this order, each on one line."""
    for part in book:
        yield from [part.title] if part.title else []
        for each in part.chapters:
            for heading in each.text.select("h1, h2, h3, h4, h5, h6"):
                yield " ".join(heading.get_text(" ", strip=True).split())


def numbers(printed: Path) -> dict[str, int]:
    """Read on which page each place stands that a link leads to."""
    reader = PdfReader(printed)
    return {
        name.lstrip("/"): reader.get_destination_page_number(place) + 1  # type: ignore[operator]
        for name, place in reader.named_destinations.items()
    }


def finish(printed: Path, output: Path, book: list[Part], about: dict[str, Any]) -> None:
    """Write the headings into the outline as they are; a browser breaks them like its lines."""
    writer = PdfWriter(clone_from=printed)
    titles = headings(book)

    def name(entry: Any) -> None:
        while entry is not None:
            node = entry.get_object()
            node[NameObject("/Title")] = TextStringObject(next(titles))
            name(node.get("/First"))
            entry = node.get("/Next")

    name(writer.get_outline_root().get("/First"))
    writer.add_metadata({"/Title": about["title"], "/Author": about["author"]})
    writer.write(output)


def browser_on_path() -> str | None:
    """Find the browser that sets the PDF and opens the pages in the tests; None without one."""
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    return next(filter(None, map(shutil.which, names)), None)


def build(site: Path, output: Path) -> None:
    """Set the site as a book and print it."""
    from playwright.sync_api import sync_playwright

    browser_path = browser_on_path()
    if browser_path is None:
        sys.exit("The PDF is set by a browser. Install Chromium: `chromium` must be on the path.")
    book = list(parts(site))
    title, version = book[0].chapters[0].title, distribution("nrdob").version
    about = {"title": title, "author": "the nrdob authors", "version": version}
    whole = site / "whole.html"  # beside what it shows
    draft = output.with_suffix(".draft.pdf")
    output.parent.mkdir(parents=True, exist_ok=True)
    store(render("book.html", book=book, head=head(site), about=about), whole)
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=browser_path, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": PAPER, "height": 900})
        tab.emulate_media(media="print")
        tab.set_default_timeout(0)
        tab.goto(whole.as_uri())
        tab.evaluate(SETTLED)
        tab.evaluate("() => fit()")
        tab.pdf(path=draft, prefer_css_page_size=True)
        tab.evaluate("(pages) => number(pages)", numbers(draft))
        tab.pdf(path=draft, prefer_css_page_size=True, outline=True, tagged=True)
        browser.close()
    finish(draft, output, book, about)
    draft.unlink()
    whole.unlink()


def main() -> None:
    given = options(__doc__, None, site=ROOT / "build/html", output=ROOT / "build/nrdob.pdf")
    # A browser miscounts its objects; what reads them would say so, and heals it.
    logging.getLogger("pypdf").setLevel(logging.ERROR)
    build(given.site.resolve(), given.output.resolve())
    print(f"The book is in {given.output}")


if __name__ == "__main__":
    main()
