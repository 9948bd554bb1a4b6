"""Pages that list what there is name all of it, and nothing that does not exist."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from .modules import COURSE, PACKAGE, modules, subpackage_of

CHECKED = ("README.md", "CONTRIBUTING.md")
"""Pages that tell which file to open and which command to run."""

CONTENTS = "book/api.md"
"""Leads to every name that `import nrdob` gives, and to the pages of the subpackages."""


def faults(root: Path) -> Iterator[str]:
    """Name every line of a page that is out of step with the code."""
    yield from _contents(root)
    yield from _table_of_subpackages(root)
    for page in CHECKED:
        yield from _paths_and_targets(root, page)


def _contents(root: Path) -> Iterator[str]:
    """The page of the package leads to every name."""
    page = CONTENTS
    linked = set(re.findall(r"[.`](\w+)`", (root / page).read_text("utf-8")))
    for name in sorted(set(modules(root)[PACKAGE].shows or ()) - linked):
        yield f"{page}: {PACKAGE}.{name} has no link"


def _table_of_subpackages(root: Path) -> Iterator[str]:
    """The table of CONTRIBUTING.md has a row for each subpackage, and none besides."""
    page = "CONTRIBUTING.md"
    lines = (root / page).read_text("utf-8").splitlines()
    start = lines.index("| Subpackage | What is in it |")
    rows: dict[str, int] = {}
    for number, line in enumerate(lines[start + 2 :], start + 3):
        if not (row := re.match(r"\| `(\w+)/?` \| (.*) \|$", line)):
            break
        rows[f"{PACKAGE}.{row[1]}"] = number
    there = {subpackage_of(name) for name in modules(root)} - {PACKAGE, COURSE}
    for name in rows.keys() - there:
        yield f"{page}:{rows[name]}: there is no subpackage {name}"
    for name in sorted(there - rows.keys()):
        yield f"{page}:{start + 1}: {name} has no row in the table"


def _paths_and_targets(root: Path, page: str) -> Iterator[str]:
    """Files and targets of make that a page names exist."""
    makefile = (root / "Makefile").read_text("utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    for number, line in enumerate((root / page).read_text("utf-8").splitlines(), 1):
        for path in re.findall(r"`((?:book|notebooks|nrdob|tests)/[\w./-]*)`", line):
            if not (root / path).exists():
                yield f"{page}:{number}: there is no {path}"
        for target in re.findall(r"(?:^|`)make ([a-z-]+)\b", line):
            if target not in targets:
                yield f"{page}:{number}: the Makefile has no target {target}"
