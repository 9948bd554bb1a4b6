"""A small book built for its place on the web, and the same for a disk."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest
import yaml
from bs4 import BeautifulSoup
from sphinx.application import Sphinx
from sphinx.util.docutils import docutils_namespace

import published

ADDRESS = "https://somebody.example/book"
EXT = Path(published.__file__).parent
WORKFLOWS = Path(__file__).resolve().parents[2] / ".github" / "workflows"

# Of the book's tools, not ours.
pytestmark = pytest.mark.filterwarnings("ignore:.* is deprecated. Check CHANGES")

INDEX = """A & B
=====

.. only:: published

   With a PDF.

.. toctree::

   chapters/one
"""


def built(folder: Path, theme: str = "basic") -> Path:
    source = folder / "source"
    (source / "chapters").mkdir(parents=True, exist_ok=True)
    (source / "conf.py").write_text(f"extensions = ['published']\nhtml_theme = '{theme}'\n")
    (source / "index.rst").write_text(INDEX)
    (source / "chapters" / "one.rst").write_text("One\n===\n\nText.\n")
    with docutils_namespace():  # directives are left to no other book of this process
        Sphinx(source, source, folder / "html", folder / "trees", "html", status=None).build()
    return folder / "html"


@pytest.mark.slow
def test_a_published_book_names_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NRDOB_SITE", ADDRESS)
    monkeypatch.syspath_prepend(str(EXT))
    site = built(tmp_path)
    for name, title, kind in (("index", "A & B", "website"), ("chapters/one", "One", "article")):
        page = BeautifulSoup((site / f"{name}.html").read_text("utf-8"), "html.parser")
        said = {tag["property"]: tag["content"] for tag in page.select("meta[property]")}
        assert said["og:title"] == title and said["og:type"] == kind
        assert said["og:url"] == f"{ADDRESS}/{name}.html"
        assert said["og:image"] == f"{ADDRESS}/_static/readme.png"
        (canonical,) = page.select("link[rel=canonical]")
        assert canonical["href"] == said["og:url"]
    places = [each.text for each in ElementTree.parse(site / "sitemap.xml").iter() if each.text]
    assert {f"{ADDRESS}/index.html", f"{ADDRESS}/chapters/one.html"} <= set(places)
    missing = BeautifulSoup((site / "404.html").read_text("utf-8"), "html.parser")
    links = [str(link["href"]) for link in missing.select("a")]
    assert links == [f"{ADDRESS}/", f"{ADDRESS}/search.html"]


@pytest.mark.slow
def test_a_book_on_a_disk_names_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NRDOB_SITE", raising=False)
    site = built(tmp_path)
    assert not (site / "sitemap.xml").exists() and not (site / "404.html").exists()
    text = (site / "index.html").read_text("utf-8")
    assert "og:" not in text and "canonical" not in text
    assert "published" in sys.modules


@pytest.mark.thorough
def test_pages_lead_to_the_pdf_only_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(EXT))
    for address, links in (("", []), (ADDRESS, ["../nrdob.pdf"]), ("", [])):
        monkeypatch.setenv("NRDOB_SITE", address)
        site = built(tmp_path, "sphinx_book_theme")
        page = BeautifulSoup((site / "chapters/one.html").read_text("utf-8"), "html.parser")
        menu = page.select(".dropdown-download-buttons a[href$='.pdf']")
        assert [link["href"] for link in menu] == links
        assert ("With a PDF." in (site / "index.html").read_text("utf-8")) == bool(links)


def steps(workflow: str, job: str) -> list[dict[str, Any]]:
    text = (WORKFLOWS / f"{workflow}.yml").read_text("utf-8")
    return list(yaml.safe_load(text)["jobs"][job]["steps"])


def test_the_pdf_lies_where_the_published_pages_lead() -> None:
    *_, make, copy, upload = steps("pages", "build")
    assert make["run"] == "make pdf" and "NRDOB_SITE" in make["env"]
    assert copy["run"] == f"cp build/nrdob.pdf build/html/{published.PDF}"
    assert upload["with"]["path"] == "build/html"


def test_a_release_has_the_pdf_and_a_site_that_leads_to_no_other() -> None:
    *_, make, upload = steps("release", "book")
    assert make == {"run": "make pdf zip"}, "without an address the pages lead to no PDF"
    assert upload["with"]["path"].split() == ["build/nrdob.pdf", "build/nrdob-book.zip"]
