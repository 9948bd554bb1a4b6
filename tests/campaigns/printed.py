"""Print every chapter of the built site: how many pages, and which of them end half empty.

python -m tests.campaigns.printed build/html

A page is half empty if its lowest third is white, and it is not the last of its chapter. Poppler's
pdftoppm draws the pages.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.image import imread

TESTS = Path(__file__).resolve().parents[1]
sys.path += [str(TESTS), str(TESTS.parent / "book" / "make")]  # where the tests find their browser

from browser import browser, printed  # noqa: E402

WHITE = 0.8


def whites(paper: Path) -> Iterator[float]:
    """Give the share of each page that is white at its end."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["pdftoppm", "-r", "20", "-gray", "-png", str(paper), f"{folder}/page"]
        subprocess.run(command, check=True)
        for drawn in sorted(Path(folder).iterdir()):
            inked = (imread(drawn) < WHITE).any(axis=(1, 2))
            yield float(np.argmax(inked[::-1])) / len(inked) if inked.any() else 1.0


def main() -> None:
    """Print the chapters one after the other."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("site", type=Path)
    site = parser.parse_args().site.resolve()
    with browser() as opened, tempfile.TemporaryDirectory() as folder:
        tab = opened.new_page()
        for page in sorted((site / "chapters").glob("*.html")):
            paper = Path(folder) / f"{page.stem}.pdf"
            count = len(printed(tab, page, paper).pages)
            empty = [k for k, white in enumerate(whites(paper), 1) if white > 1 / 3 and k < count]
            print(f"{page.stem:40} {count:3}  {empty or ''}", flush=True)


if __name__ == "__main__":
    main()
