"""Pack what runs the notebooks, and with it the book, into one file to be downloaded.

The problem sets stay out: where they lie, their solutions lie, too (`make release` gives them out).
"""

import sys
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from nrdob_course.grading.platforms import pack
from pages import ROOT, options

TO_RUN = (
    "notebooks/*.ipynb", "notebooks/class/*", "nrdob/**/*", "book/pyproject.toml",
    "book/nrdob_course/*.py", "book/nrdob_course/LICENSE", "book/nrdob_course/[ceg]*/**/*.*",
    "binder/requirements.txt", "requirements.txt", "pyproject.toml", "hatch_build.py", "README.md",
    "LICENSE", "LICENSE-text", "CITATION.cff",
)  # fmt: skip
"""The notebooks with their outputs, the packages, and what installs them."""

FOLDER = "nrdob-book"
"""In which all of it lies when an archive is unpacked."""


def to_run(project: Path = ROOT) -> Iterator[tuple[str, Path]]:
    """Give what a notebook needs: the name in the archive, and the file."""
    for pattern in TO_RUN:
        for path in project.glob(pattern):
            if path.is_file() and "__pycache__" not in path.parts:
                yield f"{FOLDER}/{path.relative_to(project).as_posix()}", path


def site(folder: Path) -> Iterator[tuple[str, Path]]:
    """Give the pages of the book, in a folder of their own."""
    for path in folder.rglob("*"):
        if path.is_file() and path.suffix != ".zip":  # a page leads to an archive of its own
            yield f"{FOLDER}/book/{path.relative_to(folder).as_posix()}", path


def main() -> None:
    given = options(__doc__, None, site=ROOT / "build/html", output=ROOT / "build/nrdob-book.zip")
    if not (given.site / "index.html").exists():
        sys.exit(f"There is no book in {given.site}. Build it first: make book")
    pack(given.output, dict(chain(site(given.site), to_run())))
    print(f"Everything is in {given.output}, {given.output.stat().st_size / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
