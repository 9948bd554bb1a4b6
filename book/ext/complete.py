"""A build fails on a chapter without title, figure, caption or alt text, or with a cell not run.

What a chapter must be stands in `shape`. The question is asked in every build, before anything is
read, whatever Sphinx remembers of an earlier one.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util import logging

from shape import faults_of_book

CHAPTERS = "chapters"

logger = logging.getLogger(__name__)


def warn(faults: Iterable[str]) -> None:
    """Name faults of chapters, each of which begins with the name of one."""
    for fault in faults:
        page, _, said = fault.partition(": ")
        logger.warning(said, location=f"{CHAPTERS}/{page}")


def check(app: Sphinx) -> None:
    """Name what the chapters lack."""
    warn(faults_of_book(Path(app.srcdir) / CHAPTERS))


def setup(app: Sphinx) -> dict[str, bool]:
    """Check before anything is read."""
    app.connect("builder-inited", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
