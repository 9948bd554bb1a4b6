"""A small book built for its place on the web, and the same for a disk."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from bs4 import BeautifulSoup
from sphinx.application import Sphinx

import published

ADDRESS = "https://somebody.example/book"
EXT = Path(published.__file__).parent


def built(folder: Path) -> Path:
    source = folder / "source"
    (source / "chapters").mkdir(parents=True)
    (source / "conf.py").write_text("extensions = ['published']\nhtml_theme = 'basic'\n")
    (source / "index.rst").write_text("A & B\n=====\n\n.. toctree::\n\n   chapters/one\n")
    (source / "chapters" / "one.rst").write_text("One\n===\n\nText.\n")
    Sphinx(source, source, folder / "html", folder / "trees", "html", status=None).build()
    return folder / "html"


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


def test_a_book_on_a_disk_names_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NRDOB_SITE", raising=False)
    site = built(tmp_path)
    assert not (site / "sitemap.xml").exists() and not (site / "404.html").exists()
    text = (site / "index.html").read_text("utf-8")
    assert "og:" not in text and "canonical" not in text
    assert "published" in sys.modules
