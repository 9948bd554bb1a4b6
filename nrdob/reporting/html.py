"""A page that stands alone: sections of words, tables and pictures, written as one HTML file.

All text goes through a template that escapes it; pictures are drawn into the page. It needs no
network and holds no script, and it says so to the browser that shows it.
"""

from __future__ import annotations

import re
from base64 import b64encode
from dataclasses import dataclass
from io import StringIO
from typing import Any
from zlib import crc32

import matplotlib as mpl
import matplotlib.pyplot as plt
from jinja2 import Environment, PackageLoader, StrictUndefined

from ..plotting import styled

__all__ = ["Attachment", "Picture", "Section", "Table", "picture", "written"]


@dataclass(frozen=True)
class Table:
    """Rows under headings; the first cell of each row names it.

    Attributes
    ----------
    caption, head, rows : str, tuple of str, tuple of tuple of str
        What it shows, the headings and the cells.
    """

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A drawing, and the same in words.

    Attributes
    ----------
    svg, alt, caption : str
        The drawing as an element of a page, the facts that it shows, and what stands below it.
    """

    svg: str
    alt: str
    caption: str


@dataclass(frozen=True)
class Attachment:
    """A file that the page holds, to be saved: its name, what is in it, what it is good for."""

    name: str
    text: str
    says: str

    @property
    def address(self) -> str:
        """The file itself, as the address of a link."""
        return f"data:application/json;base64,{b64encode(self.text.encode()).decode()}"


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes
    ----------
    title, words : str, tuple of str
        Its heading and paragraphs.
    tables, pictures, attachments : tuple
        What is shown, and files to be saved.
    warnings : tuple of str
        What must not be overlooked; also listed at the top of the page.
    alarms : tuple of str
        What speaks against using the loop, or the process; the first of a page is its headline.
    """

    title: str
    words: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    warnings: tuple[str, ...] = ()
    alarms: tuple[str, ...] = ()
    attachments: tuple[Attachment, ...] = ()


def written(report: Any) -> str:
    """Lay a `nrdob.reporting.Report` out as a page of HTML."""
    loader = PackageLoader("nrdob.reporting", ".")
    pages = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    pages.filters["unbroken"] = _unbroken
    return pages.get_template("page.html.j2").render(page=report)


def picture(figure: Any, caption: str) -> Picture:
    """Draw an `nrdob.plotting.Figure` into the page, with names of its own, and close it."""
    text = StringIO()
    with styled(), mpl.rc_context({"svg.fonttype": "path"}):
        figure.figure.savefig(
            text, format="svg", transparent=True, metadata={"Date": None, "Creator": None}
        )
    plt.close(figure.figure)
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>p{crc32(svg.encode()):x}-", svg)
    # The width is the page's; the height follows from the view box.
    svg = re.sub(r' (?:height|width)="[^"]*"', "", svg, count=2)
    return Picture(svg, figure.alt, caption)


def _unbroken(text: str) -> str:
    """Keep a number and its unit in one line."""
    return re.sub(r"(?<=[\d∞]) (?=(?:s|dB|rad/s|%)(?!\w))", "\N{NO-BREAK SPACE}", text)
