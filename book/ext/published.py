"""What a site needs where it is published: canonical links, a card for links to it, sitemap, 404.

There the book as a PDF lies beside the pages, and they lead to it; a page shows what stands under
``{only} published``.

The address is given by the environment, ``NRDOB_SITE``, when the site is built for its place; a
build without it, on a disk, has none of these, and names no server.
"""

import os
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

from sphinx.application import Sphinx
from sphinx.config import Config

from pages import on_html, render, store

PICTURE = "_static/readme.png"
PDF = "nrdob.pdf"
"""The workflow that publishes the pages puts it there."""

SAYS = (
    "When is a loop with a disturbance observer stable, and how far from trouble? An executable "
    "book: every number is computed in front of you."
)


def set_address(app: Sphinx, config: Config) -> None:
    """Take the address from the environment, ending in a slash."""
    address = os.environ.get("NRDOB_SITE", "").rstrip("/")
    config.html_baseurl = f"{address}/" if address else ""
    if address:
        app.tags.add("published")


def add_card(app: Sphinx, page: str, _: str, context: Any, doctree: object) -> None:
    """Put into the head of each page what a link to it shows elsewhere."""
    address = app.config.html_baseurl
    if doctree is None or not address:
        return
    said = {
        "og:type": "article" if page.startswith("chapters/") else "website",
        "og:title": app.env.titles[page].astext(),
        "og:description": SAYS,
        "og:url": context["pageurl"],
        "og:image": urljoin(address, PICTURE),
        "twitter:card": "summary_large_image",
    }
    tags = [f'<meta property="{name}" content="{escape(text)}">' for name, text in said.items()]
    context["metatags"] = "\n".join([context.get("metatags", ""), *tags])


def add_pdf(app: Sphinx, _page: str, _: str, context: Any, _doctree: object) -> None:
    """Put the whole book into the menu of what can be downloaded."""
    for group in context.get("header_buttons", []):
        if app.config.html_baseurl and group["label"] == "download-buttons":
            group["buttons"].append(
                {"type": "link", "text": "The book, .pdf", "url": context["pathto"](PDF, 1),
                 "icon": "fas fa-book", "tooltip": "Get the whole book as a PDF",
                 "label": "download-book-button"}
            )  # fmt: skip


def write_lists(app: Sphinx, folder: Path) -> None:
    """Write the sitemap for search engines, and the page for what is not there."""
    if address := app.config.html_baseurl:
        for name in ("sitemap.xml", "404.html"):
            store(render(name, address=address, pages=sorted(app.env.found_docs)), folder / name)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("config-inited", set_address)
    app.connect("html-page-context", add_card)
    app.connect("html-page-context", add_pdf, priority=600)
    app.connect("build-finished", on_html(write_lists))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
