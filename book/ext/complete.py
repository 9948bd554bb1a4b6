"""A build fails on a chapter without title, figure, caption or alt text, or with a cell not run.

What a chapter must be stands in `shape`. It is checked in every build, before anything is read,
whatever Sphinx remembers of an earlier one. And Sphinx forgets all of it when a program that makes
pages has changed: the number of this extension's version is made of all their texts.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from zlib import crc32

from sphinx.application import Sphinx
from sphinx.util import logging

from shape import faults_of_book

CHAPTERS = "chapters"
BOOK = Path(__file__).resolve().parents[1]

logger = logging.getLogger(__name__)


def warn(faults: Iterable[str]) -> None:
    """Name faults of chapters, each of which begins with the name of one."""
    for fault in faults:
        page, _, said = fault.partition(": ")
        logger.warning(said, location=f"{CHAPTERS}/{page}")


def check(app: Sphinx) -> None:
    """Name what the chapters lack."""
    warn(faults_of_book(Path(app.srcdir) / CHAPTERS))


def version() -> int:
    """Give a number that changes with each change of a program that makes pages."""
    files = [BOOK / "explorables.toml", *BOOK.glob("ext/*.py"), *BOOK.glob("make/*.py")]
    return crc32(b"".join(file.read_bytes() for file in sorted(files)))


def setup(app: Sphinx) -> dict[str, bool | int]:
    app.connect("builder-inited", check)
    return {"env_version": version(), "parallel_read_safe": True, "parallel_write_safe": True}
