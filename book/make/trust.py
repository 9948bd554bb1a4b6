"""Write the page that says why the package may be trusted, from the runs that are stored.

What was run, how often and with what result stands in ``book/runs.toml``, entered by who ran it.
"""

import sys
import tomllib

from pages import ROOT, keep, options, render

SOURCE, PAGE = ROOT / "book" / "runs.toml", ROOT / "book" / "trust.md"


def main(arguments: list[str] | None = None) -> int:
    given = options(__doc__, arguments, check=True)
    runs = tomllib.loads(SOURCE.read_text("utf-8"))
    page = render(PAGE.name, groups=runs.pop("group"), **runs)
    return keep({PAGE: page}, check=given.check)


if __name__ == "__main__":
    sys.exit(main())
