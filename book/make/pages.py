"""Pages of the book that a program makes: Markdown out of a template, stored where it changed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).resolve().parents[1] / "templates"),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
"""The templates, NAME.j2 for the page NAME; a line with nothing but a statement leaves no line."""

TEMPLATES.filters |= {
    # Plain text, so that Markdown shows it as it is.
    "plain": lambda text: re.sub(r"([\\`*_{}\[\]<>|$~#])", r"\\\1", text),
    # Markdown, so that it fits into a cell of a table.
    "cell": lambda text: text.replace("|", r"\|").replace("\n", " "),
    # 2.75 as 2¾.
    "hours": lambda hours: f"{int(hours) or ''}{('', '¼', '½', '¾')[int(hours * 4) % 4]}",
    "points": lambda points: "1 point" if points == 1 else f"{points:g} points",
}


def render(name: str, **given: Any) -> str:
    """Write a page."""
    return TEMPLATES.get_template(f"{name}.j2").render(**given)


def same(text: str, target: Path) -> bool:
    """Tell whether a page is stored as it is made; git may have changed the line ends."""
    return target.exists() and target.read_bytes().replace(b"\r\n", b"\n") == text.encode()


def store(text: str, target: Path) -> None:
    """Store a page, with Unix line ends everywhere, and only where it changed."""
    if not target.exists() or target.read_bytes() != text.encode():
        target.write_bytes(text.encode())
