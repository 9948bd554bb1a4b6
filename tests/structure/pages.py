"""Pages that list what there is name all of it, and nothing that does not exist."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from .modules import COURSE, PACKAGE, modules, subpackage_of

CHECKED = ("README.md", "CONTRIBUTING.md")
"""Pages that tell which file to open and which command to run."""

REFERENCE = "book/api"
"""The folder with a page for each subpackage; the page of the same name leads to them."""


def faults(root: Path) -> Iterator[str]:
    """Name every line of a page that is out of step with the code.

    Parameters
    ----------
    root : Path
        Folder of the project.

    Yields
    ------
    str
        A fault, with its place.
    """
    yield from _reference(root)
    yield from _contents(root)
    yield from _table_of_subpackages(root)
    for page in CHECKED:
        yield from _paths_and_targets(root, page)


def _reference(root: Path) -> Iterator[str]:
    """The pages of the subpackages have a section for each module, and none twice."""
    shown: dict[str, str] = {}
    for path in sorted((root / REFERENCE).glob("*.md")):
        for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
            if line.startswith(".. automodule::"):
                name, place = line.split()[-1], f"{REFERENCE}/{path.name}:{number}"
                if name not in modules(root):
                    yield f"{place}: there is no module {name}"
                if name in shown:
                    yield f"{place}: {name} stands in {shown[name]} already"
                shown[name] = place
    for name, module in modules(root).items():
        if not module.is_package and not name.startswith(COURSE) and name not in shown:
            yield f"{REFERENCE}: {name} has no section: enter `.. automodule:: {name}`"


def _contents(root: Path) -> Iterator[str]:
    """The page of the package leads to every name that `import nrdob` gives."""
    page = f"{REFERENCE}.md"
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
