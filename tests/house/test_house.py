"""The house keeps itself in order: whatever is put in the wrong place is named with its place.

Each test spoils a small house in one way, and looks whether that is told.
"""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from textwrap import indent
from types import ModuleType

import pytest

from house import doors, pages
from house.docstrings import Shown, judged, misread
from house.rooms import Module

ROOT = Path(__file__).resolve().parents[2]

SMALL = {
    "nrdob/__init__.py": """
from .design import design
__all__ = ["design"]
""",
    "nrdob/sampling.py": """
__all__ = ["draw"]
def draw(): ...
""",
    "nrdob/design/__init__.py": """
from . import cards
from .search import design
__all__ = ["cards", "design"]
""",
    "nrdob/design/cards.py": """
__all__ = ["bound"]
def bound(): ...
""",
    "nrdob/design/search.py": """
from ..numerics import bisect
__all__ = ["design"]
def design(): bisect()
""",
    "nrdob/numerics/__init__.py": """
from .bisect import bisect
__all__ = ["bisect"]
""",
    "nrdob/numerics/bisect.py": """
__all__ = ["bisect"]
def bisect(): ...
def halve(): ...
""",
    "notebooks/01_first.ipynb": [
        "import nrdob\nfrom nrdob.design import cards, design",
        "%matplotlib inline\ncards.bound()\nnrdob.numerics.bisect()\nnrdob.sampling.draw()",
    ],
    "tests/test_design.py": """
import os
from nrdob.design import search
class Case:
    def __init__(self): self._x = search.design()
os._exit(Case()._repr_html_())
""",
    "README.md": "Type `make book`; the rest is in `nrdob/design/`.",
    "CONTRIBUTING.md": """
| Subpackage | What is in it |
|---|---|
| `sampling` | random loops |
| `design/` | which filter |
| `numerics/` | polynomials |
""",
    "Makefile": "book: all",
    "book/api.md": "{py:obj}`~nrdob.design.search.design`",
    "book/api/rooms.md": """
.. automodule:: nrdob.sampling
.. automodule:: nrdob.design.search
.. automodule:: nrdob.design.cards
.. automodule:: nrdob.numerics.bisect
""",
}
"""A house in order."""


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """Build the small house."""
    for place, content in SMALL.items():
        spoil(tmp_path, place, opened(content) if isinstance(content, str) else cells(*content))
    return tmp_path


def opened(content: str) -> Callable[[str], str]:
    """Give a file, a module with its opening sentence before it."""
    opening = '"""For a test."""' if "__all__" in content else ""
    return lambda _: f"{opening}{content}\n"


def cells(*sources: str) -> Callable[[str], str]:
    """Give a notebook."""
    notebook = {"cells": [{"cell_type": "code", "source": [source]} for source in sources]}
    return lambda _: json.dumps(notebook)


def module(line: str) -> Callable[[str], str]:
    """Give a module that is in order but for one line."""
    return opened(f"\n{line}\n__all__: list[str] = []")


def spoil(house: Path, place: str, change: Callable[[str], str]) -> None:
    path = house / place
    path.parent.mkdir(parents=True, exist_ok=True)
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    changed = change(text)
    assert changed != text
    path.write_text(changed, encoding="utf-8")


def test_the_small_house_is_in_order(house: Path) -> None:
    assert [*doors.faults(house), *pages.faults(house)] == []


# --- the contract of imports --------------------------------------------------------------------


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Copy the package and its contract."""
    no_cache = shutil.ignore_patterns("__pycache__")
    for package in ("nrdob", "book/nrdob_course"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=no_cache)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def broken(copy: Path) -> str:
    """Ask the contract, which must be broken; give what is said, in one line."""
    lint = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [lint, "--no-cache"],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy / "book")},
        capture_output=True,
        text=True,
        encoding="utf-8",
    )
    assert done.returncode != 0
    return " ".join(done.stdout.split())


def test_a_module_moved_to_another_room_is_named(copy: Path) -> None:
    (copy / "nrdob/analysis/window.py").rename(copy / "nrdob/diagram/window.py")
    assert "nrdob.analysis.window does not exist" in broken(copy)


def test_a_module_in_the_wrong_room_and_an_import_upwards_are_named(copy: Path) -> None:
    spoil(copy, "nrdob/diagram/window.py", module(""))
    spoil(copy, "nrdob/diagram/noise.py", lambda text: f"{text}\nfrom ..analysis import margins\n")
    said = broken(copy)
    assert "nrdob.diagram.window" in said
    assert "nrdob.diagram.noise -> nrdob.analysis" in said


def also(line: str) -> Callable[[str], str]:
    """Write a line below a module."""
    return lambda text: f"{text}\n{line}\n"


def test_imports_upwards_within_the_course_are_named(copy: Path) -> None:
    upwards = {
        "claims.ledger": "section2",
        "exercises.problems": "cases",
        "exercises.set1": "set2",  # beside it: one set does not lean on another
        "grading.judge": "marks",
    }
    for module_above, name in upwards.items():
        path = f"book/nrdob_course/{module_above.replace('.', '/')}.py"
        spoil(copy, path, also(f"from . import {name}"))
    spoil(copy, "book/nrdob_course/grading/new.py", module(""))
    said = broken(copy)
    for module_above, name in upwards.items():
        room = module_above.split(".")[0]
        below = f"nrdob_course.{module_above} -> nrdob_course.{room}.{name}"
        assert below in said
    assert "nrdob_course.grading.new" in said


# --- doors ----------------------------------------------------------------------------------------

NEW, CHAPTER = "nrdob/design/new.py", "notebooks/99_new.ipynb"

WRONG = {
    "past a front": (
        NEW,
        module("from ..numerics.bisect import bisect"),
        f"{NEW}:2: nrdob.design.new takes bisect from nrdob.numerics.bisect, past the front of the "
        "room: import it from nrdob.numerics",
    ),
    "past a front, by the module": (
        NEW,
        module("from ..numerics import bisect as b\nb.halve()"),
        f"{NEW}:3: nrdob.design.new takes halve from nrdob.numerics.bisect, past the front of the "
        "room: import it from nrdob.numerics",
    ),
    "not shown": (
        NEW,
        module("from ..numerics import bisect, halve"),
        f"{NEW}:2: nrdob.numerics does not show halve: enter it in its __all__",
    ),
    "no list": (
        "nrdob/sampling.py",
        lambda text: text.replace("__all__", "SHOWN"),
        "nrdob/sampling.py:1: nrdob.sampling has no __all__",
    ),
    "shown, but gone": (
        "nrdob/sampling.py",
        lambda text: text.replace("def draw", "def drawn"),
        "nrdob/sampling.py:1: nrdob.sampling shows draw, which is not there",
    ),
    "no opening sentence": (
        "nrdob/sampling.py",
        lambda text: text.replace("a test.", "a test"),
        "nrdob/sampling.py:1: nrdob.sampling does not open with a sentence that says what it is "
        "for",
    ),
    "a deep room in a chapter": (
        CHAPTER,
        cells("1", "\nfrom nrdob.design.search import design"),
        f"{CHAPTER}, cell 2, line 2: design comes from the deep room nrdob.design.search; a "
        "chapter takes what it needs from a front, such as nrdob.design",
    ),
    "a deep room behind a function of its name": (
        "notebooks/class/new.ipynb",
        cells("from nrdob.numerics.bisect import halve"),
        "notebooks/class/new.ipynb, cell 1, line 1: halve comes from the deep room "
        "nrdob.numerics.bisect; a chapter takes what it needs from a front, such as nrdob.numerics",
    ),
    "a deep room by its whole name": (
        CHAPTER,
        cells("import nrdob\nnrdob.design.search.design()"),
        f"{CHAPTER}, cell 1, line 2: design comes from the deep room nrdob.design.search; a "
        "chapter takes what it needs from a front, such as nrdob.design",
    ),
    "a module that its front does not show": (
        "book/nrdob_course/sets/source/set1/new.ipynb",
        cells("from nrdob.design import search"),
        "book/nrdob_course/sets/source/set1/new.ipynb, cell 1, line 1: nrdob.design does not show "
        "search",
    ),
    "a private name in a chapter": (
        CHAPTER,
        cells("%matplotlib inline\nloop._parts"),
        f"{CHAPTER}, cell 1, line 2: _parts is private; a chapter shows public names only",
    ),
    "a private name imported by a test": (
        "tests/test_new.py",
        lambda _: "from nrdob.numerics.bisect import _trim\n",
        "tests/test_new.py:1: _trim is private: test what is public, or make it public",
    ),
    "a private attribute in a test": (
        "tests/test_new.py",
        lambda _: "import nrdob\n\nnrdob.design()._parts\n",
        "tests/test_new.py:3: _parts is private: test what is public, or make it public",
    ),
    "a private name replaced by a test": (
        "tests/test_new.py",
        lambda _: "def test(monkeypatch):\n    monkeypatch.setattr('nrdob.sampling._map', None)\n",
        "tests/test_new.py:2: nrdob.sampling._map is private: test what is public, or make it "
        "public",
    ),
}


@pytest.mark.parametrize("kind", WRONG)
def test_who_passes_a_door_by_is_named_with_the_place(house: Path, kind: str) -> None:
    place, change, fault = WRONG[kind]
    spoil(house, place, change)
    assert list(doors.faults(house)) == [fault]


# --- pages ----------------------------------------------------------------------------------------

OUT_OF_STEP = {
    "a module on no page": (
        NEW,
        module(""),
        ["book/api: nrdob.design.new has no section: enter `.. automodule:: nrdob.design.new`"],
    ),
    "a room on no page": (
        "nrdob/attic/__init__.py",
        module(""),
        ["CONTRIBUTING.md:2: the subpackage attic has no row in the table"],
    ),
    "a section of what is gone": (
        "book/api/rooms.md",
        lambda text: f"{text}.. automodule:: nrdob.attic\n",
        ["book/api/rooms.md:7: there is no module nrdob.attic"],
    ),
    "a row of what is gone": (
        "CONTRIBUTING.md",
        lambda text: text.replace("| `design/`", "| `attic/` | old |\n| `design/`"),
        ["CONTRIBUTING.md:5: there is no subpackage attic"],
    ),
    "a section twice": (
        "book/api/rooms.md",
        lambda text: f"{text}.. automodule:: nrdob.design.cards\n",
        ["book/api/rooms.md:7: nrdob.design.cards stands in book/api/rooms.md:4 already"],
    ),
    "a name without a link": (
        "book/api.md",
        lambda text: text.replace("search.design", "search.other"),
        ["book/api.md: the name design of the front door has no link"],
    ),
    "a file that is gone": (
        "CONTRIBUTING.md",
        lambda text: f"{text}See `nrdob/design/card.py`.\n",
        ["CONTRIBUTING.md:8: there is no nrdob/design/card.py"],
    ),
    "a command that is gone": (
        "README.md",
        lambda text: f"Type `make tea`.\n{text}",
        ["README.md:1: the Makefile has no target tea"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", OUT_OF_STEP)
def test_a_page_out_of_step_is_named_with_the_line(house: Path, kind: str) -> None:
    place, change, faults = OUT_OF_STEP[kind]
    spoil(house, place, change)
    assert list(pages.faults(house)) == faults


# --- docstrings -----------------------------------------------------------------------------------

SOURCE = '''
from dataclasses import dataclass
from typing import NamedTuple

def gain(order, floor):
    """Find a gain.

    Parameters
    ----------
    order : int
        Of the filter.
    """

def sizes(order):
    """Find sizes.

    Parameters
    ----------
    order
        Of the filter.
    """

def nameless(order):
    pass

@dataclass
class Found:
    """What was found.

    Attributes
    ----------
    low : float
        Lower end.
    """

    low: float
    high: float

    def wider(self, factor):
        """Make it wider."""

class Pair(NamedTuple):
    """Two ends.

    Attributes
    ----------
    low, high : float
        The ends.
    """

    low: float
    high: float
'''


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """Import a module whose docstrings leave something out."""
    (tmp_path / "written_badly.py").write_text(SOURCE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    import written_badly  # type: ignore[import-not-found]

    yield written_badly
    del sys.modules["written_badly"]


@pytest.mark.parametrize(
    ("name", "line", "faults"),
    [
        ("gain", 5, ["Parameters {'floor'} not documented"]),
        ("sizes", 14, ['Parameter "order" has no type']),
        ("nameless", 23, ["The object does not have a docstring"]),
        ("Found", 27, ["the field high is not documented", "{'factor'} not documented"]),
        ("Pair", 0, []),
    ],
)
def test_what_a_docstring_leaves_out_is_named_with_the_line(
    written: ModuleType, name: str, line: int, faults: list[str]
) -> None:
    found = list(judged(Shown(f"{written.__name__}.{name}", getattr(written, name))))
    assert len(found) == len(faults)
    for told, fault in zip(found, faults, strict=True):
        assert fault in told
        assert "written_badly.py:" in told
    if found:
        assert int(found[0].split("written_badly.py:")[1].split(":")[0]) in (line - 1, line)


def test_at_the_front_door_an_example_and_what_comes_back_are_asked_for(
    written: ModuleType,
) -> None:
    shown = Shown(f"{written.__name__}.gain", written.gain)
    found = " ".join(judged(shown, at_the_door=True))
    assert "EX01" in found and "RT01" not in found  # it returns nothing


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("References\n----------\nW. Michiels, Stability, 2014.", 'py:6: "W." begins a list'),
        (".. rubric:: References\n\nK. J. Smith, A loop, 1957.", 'py:6: "K." begins a list'),
        ("Attributes\n----------\nplant : Loop\n    G.", 'py:7: "G." begins a list'),
        ("Attributes\n----------\norder: int\n    Its order.", 'py:6: "order: int" is all name'),
        (r"It is :math:`y\\,dt`.", r'py:4: "\\," is a new line'),
        (r"It is :math:`y\,dt`.", None),
        ("References\n----------\nMichiels, W., Stability, 2014.", None),
        ("Attributes\n----------\norder : int\n    Its order.", None),
        ("Notes\n-----\nTwice: once here\n\n    said below.", None),
    ],
)
def test_what_the_pages_would_misread_is_named_with_the_line(text: str, told: str | None) -> None:
    source = f'def gain():\n    r"""Find a gain.\n\n{indent(text, "    ")}\n    """\n'
    found = list(misread(Module("gains", Path("gains.py"), ast.parse(source), None)))
    assert len(found) == (told is not None)
    assert told is None or told in found[0]
