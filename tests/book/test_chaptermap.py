"""The map of the chapters and the ways through the book, as the chapters' openings have it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from maps import told
from openings import PARTS, read_chapter, read_chapters

ROOT = Path(__file__).resolve().parents[2]

OPENING = """# A title: and more

**You need** [this](11_the_loop.ipynb), [that](03_unstable.ipynb), [this](11_the_loop.ipynb).

**Time** 45 minutes, the questions at the end not counted.
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "19_something.ipynb"
    path.write_text(json.dumps({"cells": [{"source": text.splitlines(keepends=True)}]}), "utf-8")
    return path


def test_an_opening_is_read_once_for_each_chapter_it_needs(tmp_path: Path):
    found = read_chapter(written(tmp_path, OPENING))
    assert (found.number, found.title, found.minutes) == ("19", "A title: and more", 45)
    assert found.needs == ("11", "03")


@pytest.mark.parametrize("lacking", ["# A title", "**You need**", "**Time**"])
def test_an_opening_that_lacks_a_part_is_named(tmp_path: Path, lacking: str):
    path = written(tmp_path, OPENING.replace(lacking, ""))
    with pytest.raises(ValueError, match=r"19_something\.ipynb must open with"):
        read_chapter(path)


def test_each_chapter_stands_in_a_part_and_needs_what_there_is():
    openings = {each.number: each for each in read_chapters(ROOT / "notebooks")}
    in_parts = [number for numbers in PARTS.values() for number in numbers]
    assert len(set(in_parts)) == len(in_parts) and set(openings) <= set(in_parts)
    assert all(set(opening.needs) <= set(openings) for opening in openings.values())
    assert all(opening.number not in opening.needs for opening in openings.values())


@pytest.mark.parametrize(
    ("minutes", "text"), [(45, "45 min"), (60, "1 h"), (100, "1¾ h"), (225, "3¾ h"), (671, "11¼ h")]
)
def test_times_are_told_to_the_quarter_of_an_hour(minutes: int, text: str):
    assert told(minutes) == text
