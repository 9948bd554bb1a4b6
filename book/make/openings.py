"""What the chapters promise in their first cells: to the map of the book, and to teachers."""

import re
from pathlib import Path
from typing import NamedTuple

from pages import cells_of

PARTS = {
    "The paper in an afternoon": ["01", "02", "03", "04", "05", "06", "07", "08"],
    "Design": ["09", "10", "11", "12", "13", "14", "15", "16", "17"],
    "The bench": ["18", "19", "20", "21", "22", "23", "24"],
    "Appendices": ["A", "B", "C", "D"],
}
"""The parts of the book, with the numbers of their chapters, as on the front page."""

TITLE = re.compile(r"# (.+)")
GOALS = "**You will be able to**"
PROMISED = re.compile(rf"{re.escape(GOALS)}(.*?)\*\*You need\*\*", re.DOTALL)
NEEDED = re.compile(r"^\*\*You need\*\* (.+)$", re.MULTILINE)
MINUTES = re.compile(r"\*\*Time\*\* (\d+) minutes")
CHAPTER = re.compile(r"\((\d\d|[A-D])_\w+\.ipynb\)")


class Chapter(NamedTuple):
    """What a chapter promises, and the numbers of the chapters that it needs."""

    stem: str
    title: str
    minutes: int
    objectives: tuple[str, ...]
    needs: tuple[str, ...]

    @property
    def link(self) -> str:
        """Lead to its notebook, from a page for teachers."""
        return f"[{self.title}](../../notebooks/{self.stem}.ipynb)"

    @property
    def number(self) -> str:
        """What its file begins with: two digits, or the letter of an appendix."""
        return self.stem.partition("_")[0]


def read_chapter(path: Path) -> Chapter:
    """Read the first cell of a chapter, or say what it lacks."""
    opening = cells_of(path)[0]["source"]
    title, time = TITLE.match(opening), MINUTES.search(opening)
    promised, needed = PROMISED.search(opening), NEEDED.search(opening)
    if not (title and time and needed):
        raise ValueError(f"{path.name} must open with a title, **You need** and **Time** n minutes")
    listed = re.findall(r"^- (.*?)[;. ]*$", promised[1], re.MULTILINE) if promised else []
    needs = dict.fromkeys(CHAPTER.findall(needed[1]))
    return Chapter(path.stem, title[1], int(time[1]), tuple(listed), tuple(needs))


def read_chapters(folder: Path) -> list[Chapter]:
    """Read the openings of all chapters in a folder, in reading order."""
    return [read_chapter(path) for path in sorted(folder.glob("*.ipynb"))]
