"""Pack what runs the notebooks, and with it the book, into one file to be downloaded.

The problem sets stay out: where they lie, their solutions lie, too (`make release` gives them out).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from pages import ROOT, options

TO_RUN = (
    "notebooks/*.ipynb", "notebooks/class/*", "nrdob/**/*", "book/pyproject.toml",
    "book/nrdob_course/*.py", "book/nrdob_course/[ceg]*/**/*.*", "binder/requirements.txt",
    "requirements.txt", "pyproject.toml", "README.md", "LICENSE", "LICENSE-text", "CITATION.cff",
)  # fmt: skip
"""The notebooks with their outputs, the packages, and what installs them."""

LONG_AGO = (1980, 1, 1, 0, 0, 0)
"""The time of every file, so that the same book gives the same file."""


def to_run(project: Path = ROOT) -> Iterator[tuple[str, Path]]:
    """Give what a notebook needs: the name in the archive, and the file."""
    for pattern in TO_RUN:
        for path in sorted(project.glob(pattern)):
            if path.is_file() and "__pycache__" not in path.parts:
                yield path.relative_to(project).as_posix(), path


def site(folder: Path) -> Iterator[tuple[str, Path]]:
    """Give the pages of the book, in a folder of their own."""
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.suffix != ".zip":  # a page leads to an archive of its own
            yield f"book/{path.relative_to(folder).as_posix()}", path


def pack(files: Iterator[tuple[str, Path]], target: Path) -> None:
    """Write files into an archive, all of them in one folder."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with ZipFile(target, "w", ZIP_DEFLATED) as archive:
        for name, path in files:
            entry = ZipInfo(f"nrdob-book/{name}", LONG_AGO)
            archive.writestr(entry, path.read_bytes(), ZIP_DEFLATED)


def main() -> None:
    given = options(__doc__, None, site=ROOT / "build/html", output=ROOT / "build/nrdob-book.zip")
    if not (given.site / "index.html").exists():
        sys.exit(f"There is no book in {given.site}. Build it first: make book")
    pack(chain(site(given.site), to_run()), given.output)
    print(f"Everything is in {given.output}, {given.output.stat().st_size / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
