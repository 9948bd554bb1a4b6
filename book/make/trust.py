"""Write the page that says why the package may be trusted, from the runs that are stored.

What was run, how often and with what result stands in ``book/runs.toml``, entered by who ran it.

    python book/make/trust.py              write book/trust.md
    python book/make/trust.py --check      fail if the stored page is behind
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

from pages import ROOT, options, render, same, store

SOURCE, PAGE = ROOT / "book" / "runs.toml", ROOT / "book" / "trust.md"


def made(source: Path = SOURCE) -> str:
    """Make the page."""
    runs = tomllib.loads(source.read_text("utf-8"))
    return render(
        PAGE.name, groups=runs["group"], mended=runs["mended"], uncovered=runs["uncovered"]
    )


def main(arguments: list[str] | None = None) -> int:
    check = options(__doc__, arguments, check=True).check
    if not check:
        store(made(), PAGE)
    elif not same(made(), PAGE):
        print("book/trust.md is behind book/runs.toml: make pages writes it", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
