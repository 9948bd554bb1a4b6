"""Write the page that says why the package may be trusted, from the runs that are stored.

What was run, how often and with what result stands in ``book/runs.toml``, entered by who ran it.

    python book/make/trust.py              write book/trust.md
    python book/make/trust.py --check      fail if the stored page is behind
"""

from __future__ import annotations

import sys
import tomllib

from pages import ROOT, options, render, same, store

SOURCE, PAGE = ROOT / "book" / "runs.toml", ROOT / "book" / "trust.md"


def main(arguments: list[str] | None = None) -> int:
    check = options(__doc__, arguments, check=True).check
    runs = tomllib.loads(SOURCE.read_text("utf-8"))
    page = render(
        PAGE.name, groups=runs["group"], mended=runs["mended"], uncovered=runs["uncovered"]
    )
    if not check:
        store(page, PAGE)
    elif not same(page, PAGE):
        print("book/trust.md is behind book/runs.toml: make pages writes it", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
