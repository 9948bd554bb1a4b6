"""The map of the rooms: few floors, no way back up, and a circle is named."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from house import map as plan
from house.rooms import room_of

ROOT = Path(__file__).resolve().parents[2]
MOST = 10


@pytest.fixture(scope="module")
def tree() -> plan.Tree:
    """Read the imports of the package."""
    return plan.imports(ROOT)


def test_rooms_and_what_is_in_each_stand_on_few_floors(tree: plan.Tree) -> None:
    inside = {name: below for name, below in tree.items() if not name.endswith("__main__")}
    rooms = {room_of(name): set[str]() for name in inside}
    for name, below in inside.items():
        rooms[room_of(name)] |= {room_of(other) for other in below} - {room_of(name)}
    for plans in (rooms, *(_within(tree, room) for room in rooms)):
        found = plan.floors(plans)
        assert found.keys() == plans.keys()
        assert max(found.values()) < MOST


def _within(tree: plan.Tree, room: str) -> dict[str, set[str]]:
    # A command line is a door from outside: it stands on no floor of the room.
    names = {n for n in tree if room_of(n) == room and not n.endswith("__main__")}
    return {name: tree[name] & names for name in names}


def test_a_module_stands_one_floor_above_the_highest_that_it_imports() -> None:
    tree = {"roof": {"hall", "cellar"}, "hall": {"cellar"}, "cellar": set[str]()}
    assert plan.floors(tree) == {"cellar": 0, "hall": 1, "roof": 2}
    sizes = {"roof": 1, "hall": 20, "cellar": 300}
    assert list(plan.drawn("Floors", tree, sizes)) == [
        "Floors: 3 floors", "   2  roof 1", "   1  hall 20", "   0  cellar 300",
    ]  # fmt: skip


def test_a_circle_is_named_without_what_stands_above_it() -> None:
    tree = {"roof": {"a"}, "a": {"b"}, "b": {"c"}, "c": {"a", "cellar"}, "cellar": set[str]()}
    assert plan.circle(tree) == ["a", "b", "c"]
    assert plan.floors(tree) == {"cellar": 0}


def test_what_a_front_shows_comes_from_the_module_behind_it(tree: plan.Tree) -> None:
    assert plan.defining(ROOT, "nrdob", "design_filter") == "nrdob.design.search"
    assert "nrdob.numerics.quasipoly" in tree["nrdob.design.mismatch"]
    assert "nrdob.numerics" not in tree


def test_a_circle_fails_with_its_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    room = tmp_path / "nrdob"
    room.mkdir()
    (room / "__init__.py").write_text("", encoding="utf-8")
    (room / "one.py").write_text("from .two import b\na = 1\n", encoding="utf-8")
    (room / "two.py").write_text("from .one import a\nb = 1\n", encoding="utf-8")
    assert "these import each other: nrdob.one, nrdob.two" in plan.main(tmp_path)
    assert "Modules: 0 floors" in capsys.readouterr().out


@pytest.mark.slow
def test_the_command_succeeds_where_there_is_no_circle() -> None:
    command = [sys.executable, "-m", "tests.house.map"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, encoding="utf-8")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("Rooms: ")


@pytest.mark.slow
def test_the_front_door_loads_no_figures_no_course_and_no_algebra() -> None:
    code = (
        "import sys, nrdob\n"
        "unasked = {'nrdob.plotting', 'nrdob_course', 'nrdob.reporting', 'sympy', 'jinja2'}\n"
        "sys.exit(', '.join(unasked & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8")
    assert done.returncode == 0, f"import nrdob loads {done.stderr}"
