"""Run every check of the ledger, and write its two pages into the book: ledger and errata.

Nothing is published that was not checked in this run. The exit code is 1, and every reason is
listed, if a check does not give its verdict, or if ledger and chapters do not fit together: a
citation of a claim that does not exist, a claim that its own chapter does not cite, a claim whose
chapter is missing. The pages are written in any case, with what could be settled, so that the
author of a chapter can look at them.
"""

import re
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from nrdob_course.claims import LEDGER, Claim, Entry, Verdict
from nrdob_course.claims.ledger import settle
from pages import NOTEBOOKS, ROOT, cells_of, options, render, report, store

CITED_IN_PROSE = re.compile(r"(?<!`)`claim:([^`\s]+)`(?!`)")
HEADING = re.compile(r"#{1,6}\s+(.*?)\s*#*$")
FENCED = re.compile(r"^\s*(```|~~~).*?(?:^\s*\1[^\n]*$|\Z)", re.MULTILINE | re.DOTALL)

PAGES = ("ledger.md", "errata.md")

PARTS = {
    "Sections I, II: the loop": "sec[12]|eq0[1-6]|fig01",
    "Section III: stability and robustness": "sec3|eq07|lemma[12]|cor1",
    "Example 1: the perfect model": "ex1|fig02",
    "Example 2: the zero in the right half plane": "ex2|eq(08|09|10)|fig0[3-8]",
    "Example 3: the unstable process": "ex3|eq1[1-5]|fig(09|1[0-4])",
    "Example 4: the dead time": "ex4|eq1[67]|fig(15[ab]|1[6-9])",
    "Conclusions: Section V, and the references": "concl|ref02",
}
"""The parts of the paper, and what the ids of their claims have before the first dot."""


class Chapter(NamedTuple):
    """A notebook as the ledger sees it: its title, and the first heading below which a claim is."""

    stem: str
    title: str
    citations: Mapping[str, str]


def read_chapter(path: Path) -> Chapter:
    """Read title and citations of one notebook, in prose and in the metadata of cells."""
    title = heading = ""
    cited: dict[str, str] = {}
    for cell in cells_of(path):
        if cell["cell_type"] != "code":
            for line in FENCED.sub("", cell["source"]).splitlines():
                if match := HEADING.match(line):
                    heading = match.group(1)
                    title = title or heading
                for id in CITED_IN_PROSE.findall(line):
                    cited.setdefault(id, heading)
        for id in cell["metadata"].get("claims", ()):
            cited.setdefault(id, heading)
    return Chapter(path.stem, title or path.stem, cited)


def settle_all(
    ledger: Mapping[str, Claim], settle: Callable[[Claim], Entry]
) -> tuple[list[Entry], list[str]]:
    """Run every check; give the entries that are settled, and what is wrong with the others."""
    entries, problems = [], []
    for id, claim in ledger.items():
        try:
            entries.append(settle(claim))
        except Exception as error:  # whatever a check raises, the other checks are still to run
            text = str(error) or type(error).__name__
            problems.append(text if text.startswith(f"{id}:") else f"{id}: the check fails: {text}")
    return entries, problems


def misfits(ledger: Mapping[str, Claim], chapters: Mapping[str, Chapter]) -> list[str]:
    """Tell where ledger and chapters do not fit together."""
    told = [
        f"{id}: cited in {chapter.stem}, section {heading!r}, but there is no such claim"
        for chapter in chapters.values()
        for id, heading in chapter.citations.items()
        if id not in ledger
    ]
    for id, claim in ledger.items():
        if claim.chapter not in chapters:
            told.append(f"{id}: belongs to the chapter {claim.chapter}, which does not exist")
        elif id not in chapters[claim.chapter].citations:
            told.append(f"{id}: not cited in its own chapter, {claim.chapter}")
        if part_of(id) is None:
            told.append(f"{id}: begins like no part of the paper; see PARTS in book/make/ledger.py")
    return told


def part_of(id: str) -> str | None:
    """Name the part of the paper that a claim belongs to."""
    stem = id.partition(".")[0]
    return next((part for part, stems in PARTS.items() if re.fullmatch(stems, stem)), None)


def by_part(entries: Sequence[Entry]) -> dict[str, list[Entry]]:
    """Group the entries by part of the paper, in its order."""
    groups = {part: [e for e in entries if part_of(e.claim.id) == part] for part in PARTS}
    return {part: members for part, members in groups.items() if members}


def count(entries: Sequence[Entry], verdict: Verdict) -> int:
    return sum(entry.verdict is verdict for entry in entries)


def places(claim: Claim, chapters: Mapping[str, Chapter]) -> str:
    """Link every chapter that shows a claim, its own first, at the first mention in it."""
    shown = [chapter for chapter in chapters.values() if claim.id in chapter.citations]
    shown.sort(key=lambda chapter: chapter.stem != claim.chapter)
    links = []
    for chapter in shown:
        heading = chapter.citations[claim.id]
        section = f" › {heading}" if heading != chapter.title else ""
        links.append(f"[{chapter.title}{section}](#shown-{chapter.stem}-{claim.id.lower()})")
    return "; ".join(links)


def main(
    arguments: list[str] | None = None,
    ledger: Mapping[str, Claim] = LEDGER,
    settle: Callable[[Claim], Entry] = settle,
) -> int:
    """Run the command line; the result is the exit code.

    `settle` may be one that remembers the claims it has settled before, as in the tests.
    """
    given = options(__doc__, arguments, output=ROOT / "book", notebooks=NOTEBOOKS)
    start = time.perf_counter()
    chapters = {path.stem: read_chapter(path) for path in sorted(given.notebooks.glob("*.ipynb"))}
    entries, problems = settle_all(ledger, settle)
    told = {"entries": entries, "parts": by_part(entries), "verdicts": Verdict, "count": count}
    for name in PAGES:  # the ledger with every claim, the errata with what does not hold as printed
        text = render(name, places=lambda claim: places(claim, chapters), **told)
        store(text, given.output / name)
    verdicts = ", ".join(f"{count(entries, verdict)} {verdict.value}" for verdict in Verdict)
    print(f"The ledger: {len(entries)} claims ({verdicts}), {time.perf_counter() - start:.1f} s")
    return report("The ledger", problems + misfits(ledger, chapters))


if __name__ == "__main__":
    sys.exit(main())
