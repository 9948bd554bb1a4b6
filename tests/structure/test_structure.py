"""What breaks a rule of the package is named with its place.

Each test breaks a small package in one way, or the contracts of the real one.
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

from structure import callers, imports, modules, pages
from structure.docstrings import judged, misread
from structure.map import drawn
from structure.modules import Module

ROOT = Path(__file__).resolve().parents[2]

SMALL = {
    "nrdob/__init__.py": "from .design import design\n__all__ = ['design']",
    "nrdob/sampling.py": "__all__ = ['draw']\ndef draw(): ...",
    "nrdob/design/__init__.py": """
from . import cards
from .search import Found, design
__all__ = ["Found", "cards", "design"]
""",
    "nrdob/design/cards.py": "__all__ = ['bound']\ndef bound(): ...",
    "nrdob/design/search.py": """
from ..numerics import bisect
__all__ = ["Found", "design"]
class Found:
    low: float
    def width(self): ...
def design(*, floor=0.0) -> Found:
    bisect()
    return _found(floor)
def _found(floor): ...
""",
    "nrdob/numerics/__init__.py": "from .bisect import bisect\n__all__ = ['bisect']",
    "nrdob/numerics/bisect.py": "__all__ = ['bisect']\ndef bisect(): halve()\ndef halve(): ...",
    "notebooks/01_first.ipynb": [
        "import nrdob\nfrom nrdob.design import cards, design",
        "%matplotlib inline\ncards.bound()\nnrdob.design()\nnrdob.sampling.draw()",
    ],
    "nrdob/page.html.j2": "{{ found.low }}",
    "README.md": "Type `make book`; `design(floor=1).width` is in `nrdob/design/`.",
    "CONTRIBUTING.md": """
| Subpackage | What is in it |
|---|---|
| `sampling` | random loops |
| `design/` | which filter |
| `numerics/` | polynomials |
""",
    "Makefile": "book: all",
    "book/api.md": "{py:obj}`~nrdob.design.search.design`",
}
"""A package in order."""

CHECKS = (imports.faults, callers.faults, modules.faults, pages.faults)

Change = Callable[[str], str]


def text(content: str) -> Change:
    """Give a file."""
    return lambda _: f"{content}\n"


def also(line: str) -> Change:
    """Write a line below a file."""
    return lambda given: f"{given}\n{line}\n"


def instead(old: str, new: str) -> Change:
    """Replace a text in a file."""
    return lambda given: given.replace(old, new)


def cells(*sources: str) -> Change:
    """Give a notebook."""
    notebook = {"cells": [{"cell_type": "code", "source": [source]} for source in sources]}
    return lambda _: json.dumps(notebook)


def change(project: Path, place: str, by: Change) -> None:
    path = project / place
    path.parent.mkdir(parents=True, exist_ok=True)
    given = path.read_text("utf-8") if path.exists() else ""
    changed = by(given)
    assert changed != given
    path.write_text(changed, "utf-8")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Write the small package."""
    for place, content in SMALL.items():
        change(tmp_path, place, text(content) if isinstance(content, str) else cells(*content))
    return tmp_path


def test_the_small_package_is_in_order(project: Path) -> None:
    assert [fault for check in CHECKS for fault in check(project)] == []


# --- the contracts of imports -------------------------------------------------------------------


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Copy the packages and their contracts."""
    no_cache = shutil.ignore_patterns("__pycache__", "sets")
    for package in ("nrdob", "book/nrdob_course"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=no_cache)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def broken(copy: Path) -> str:
    """Check the contracts, which must be broken; give what is said, in one line."""
    done = subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"],
        cwd=copy, env={**os.environ, "PYTHONPATH": str(copy / "book"), "PYTHONUTF8": "1"},
        capture_output=True, text=True, encoding="utf-8",
    )  # fmt: skip
    assert done.returncode != 0
    return " ".join(done.stdout.split())


@pytest.mark.slow
def test_a_module_moved_to_another_subpackage_is_named(copy: Path) -> None:
    (copy / "nrdob/analysis/nyquist.py").rename(copy / "nrdob/diagram/nyquist.py")
    assert "nrdob.analysis.nyquist does not exist" in broken(copy)


@pytest.mark.slow
def test_a_module_in_the_wrong_place_and_imports_upwards_are_named(copy: Path) -> None:
    upwards = {
        "nrdob.diagram.noise": "nrdob.analysis",
        "nrdob.numerics.rootfinding": "nrdob_course",
        "nrdob_course.claims.ledger": "nrdob_course.claims.section2",
        "nrdob_course.exercises.set1": "nrdob_course.exercises.set2",  # a set leans on no other
        "nrdob_course.grading.judge": "nrdob_course.grading.marks",
    }
    for low, high in upwards.items():
        folder = "book/" if low.startswith("nrdob_course") else ""
        change(copy, f"{folder}{low.replace('.', '/')}.py", also(f"import {high}"))
    new = ("nrdob/diagram/new.py", "book/nrdob_course/grading/new.py")
    for place in new:
        change(copy, place, text('"""New."""'))
    said = broken(copy)
    for low, high in upwards.items():
        assert f"{low} -> {high}" in said
    assert "nrdob.diagram.new" in said and "nrdob_course.grading.new" in said


def test_the_map_prints_each_layer_with_the_lines_of_its_modules(tmp_path: Path) -> None:
    change(tmp_path, "nrdob/design/chart.py", text("1\n2"))
    change(tmp_path, "nrdob/loop.py", text("1"))
    contract = '[[tool.importlinter.contracts]]\ncontainers = ["nrdob"]\nlayers = ["loop | design"]'
    change(tmp_path, "pyproject.toml", text(contract))
    assert list(drawn(tmp_path)) == ["nrdob: 3 lines", "    loop 1  design 2"]


# --- imports, callers, pages --------------------------------------------------------------------

NEW, CHAPTER = "nrdob/design/new.py", "notebooks/99_new.ipynb"
NONE = "__all__: list[str] = []"

WRONG: dict[str, tuple[str, Change, str]] = {
    "past a public API": (
        NEW, text(f"from ..numerics.bisect import bisect\n{NONE}"),
        f"{NEW}:1: bisect is imported from nrdob.numerics.bisect: import it from nrdob.numerics",
    ),
    "past a public API, by the module": (
        NEW, text(f"from ..numerics import bisect as b\nb.halve()\n{NONE}"),
        f"{NEW}:2: halve is imported from nrdob.numerics.bisect: import it from nrdob.numerics",
    ),
    "not shown": (
        NEW, text(f"from ..numerics import halve\n{NONE}"),
        f"{NEW}:1: nrdob.numerics does not show halve: enter it in its __all__",
    ),
    "no list": (
        "nrdob/sampling.py", instead("__all__", "SHOWN"),
        "nrdob/sampling.py:1: nrdob.sampling has no __all__",
    ),
    "an inner module in a chapter": (
        CHAPTER, cells("import nrdob", "\nnrdob.design.search.design()"),
        f"{CHAPTER}, cell 2, line 2: design is imported from the inner nrdob.design.search",
    ),
    "an inner module behind a function of its name": (
        "notebooks/class/new.ipynb", cells("from nrdob.numerics.bisect import halve"),
        "notebooks/class/new.ipynb, cell 1, line 1: halve is imported from the inner "
        "nrdob.numerics.bisect",
    ),
    "a module that its package does not show": (
        "book/nrdob_course/sets/source/set1/new.ipynb", cells("from nrdob.design import search"),
        "book/nrdob_course/sets/source/set1/new.ipynb, cell 1, line 1: nrdob.design does not show "
        "search",
    ),
    "a private name replaced by a test": (
        "tests/test_new.py", text("setattr('nrdob" + ".a._b', 1)"),
        "tests/test_new.py:1: nrdob.a._b is private: test what is public",
    ),
    "no caller": (
        "nrdob/sampling.py", instead("['draw']", "['draw', 'redraw']"),
        "nrdob/sampling.py:1: nrdob.sampling.redraw has no caller: use it in a chapter or on a "
        "page, or take it out of __all__",
    ),
    "a caller within the subpackage only": (
        "nrdob/numerics/__init__.py", instead("['bisect']", "['bisect', 'halve']"),
        "nrdob/numerics/__init__.py:1: nrdob.numerics.halve has no caller: use it in a chapter or "
        "on a page, or take it out of __all__",
    ),
    "a page that says a word": (
        "README.md", instead("design(floor=1).width", "design, floor and width"),
        "nrdob/design/search.py:4: Found.width has no user: take it out, or use it in a chapter or "
        "on a page",
    ),
    "a parameter that nobody gives": (
        "README.md", instead("floor=1", ""),
        "nrdob/design/search.py:7: design(floor=) has no user: take it out, or use it in a chapter "
        "or on a page",
    ),
    "shown to nobody": (
        "nrdob/design/search.py", instead('"design"]', '"design", "_found"]'),
        "nrdob/design/search.py:1: nrdob.design.search shows _found, which no other file uses: "
        "take it out of __all__",
    ),
    "kept for nothing": (
        "nrdob/sampling.py", also("_SEED = 1"),
        "nrdob/sampling.py:1: nrdob.sampling does not use its _SEED: take it out",
    ),
    "too long": (
        "nrdob/sampling.py", also("\n" * 500),
        "nrdob/sampling.py:504: more than 500 lines: part it",
    ),
    "a subpackage in no table": (
        "nrdob/attic/__init__.py", text(NONE),
        "CONTRIBUTING.md:2: nrdob.attic has no row in the table",
    ),
    "a row of what does not exist": (
        "CONTRIBUTING.md", instead("| `design/`", "| `attic/` | old |\n| `design/`"),
        "CONTRIBUTING.md:5: there is no subpackage nrdob.attic",
    ),
    "a name without a link": (
        "book/api.md", instead("search.design", "search.other"),
        "book/api.md: nrdob.design has no link",
    ),
    "a file that does not exist": (
        "CONTRIBUTING.md", also("See `nrdob/design/card.py`."),
        "CONTRIBUTING.md:9: there is no nrdob/design/card.py",
    ),
    "a command that does not exist": (
        "README.md", also("Type `make tea`."),
        "README.md:3: the Makefile has no target tea",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", WRONG)
def test_what_breaks_a_rule_is_named_with_its_place(project: Path, kind: str) -> None:
    place, by, fault = WRONG[kind]
    change(project, place, by)
    assert fault in [found for check in CHECKS for found in check(project)]


def test_a_page_that_names_something_as_code_is_its_caller(project: Path) -> None:
    change(project, "nrdob/sampling.py", instead("['draw']", "['draw', 'redraw']"))
    change(project, "README.md", also("Draw again with `redraw(rng)`."))
    assert list(callers.faults(project)) == []


@pytest.mark.parametrize(
    ("page", "said"), [("README.md", "Then `redraw`."), ("book/api.md", "`redraw(rng)`.")]
)
def test_a_mere_word_and_a_list_of_everything_are_no_callers(
    project: Path, page: str, said: str
) -> None:
    change(project, "nrdob/sampling.py", instead("['draw']", "['draw', 'redraw']"))
    change(project, page, also(said))
    assert any("redraw has no caller" in fault for fault in callers.faults(project))


@pytest.mark.slow
def test_what_is_allowed_to_have_no_user_has_none() -> None:
    assert callers.USED_OTHERWISE.keys() <= {name for _, name in callers.members(ROOT)}


# --- docstrings -----------------------------------------------------------------------------------

SOURCE = '''
from dataclasses import dataclass
from typing import NamedTuple

def gain(order, floor):
    """Find a gain.

    Parameters
    ----------
    order
        Of the filter.
    """

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
    ("name", "faults"),
    [
        ("gain", ["{'floor'} not documented", '"order" has no type', "No examples"]),
        ("Found", ["the field high is not documented", "No examples", "{'factor'} not documented"]),
        ("Pair", ["No examples"]),
    ],
)
def test_what_a_docstring_leaves_out_is_named(
    written: ModuleType, name: str, faults: list[str]
) -> None:
    found = list(judged(f"{written.__name__}.{name}", getattr(written, name), at_the_top=True))
    assert all("written_badly.py:" in fault for fault in found)
    assert sorted(f for f in faults for said in found if f in said) == sorted(faults)
    assert len(found) == len(faults)


@pytest.mark.parametrize(
    ("text", "said"),
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
def test_what_the_pages_would_misread_is_named_with_the_line(text: str, said: str | None) -> None:
    source = f'def gain():\n    r"""Find a gain.\n\n{indent(text, "    ")}\n    """\n'
    found = list(misread(Module("gains", Path("gains.py"), ast.parse(source), None)))
    assert len(found) == (said is not None)
    assert said is None or said in found[0]
