"""Print the rooms of the package floor by floor, as its imports put them.

    python -m tests.house.map

A module stands one floor above the highest one that it imports. What is imported from a front comes
from the module that defines it. Modules that import each other in a circle have no floor: they are
named, and the program fails.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

from .rooms import PACKAGE, Module, Use, modules, room_of, uses

Tree = Mapping[str, set[str]]
"""For each module those that it imports."""


def imports(root: Path) -> dict[str, set[str]]:
    """Find for each module that defines something those whose definitions it takes.

    Parameters
    ----------
    root : Path
        Folder of the project.

    Returns
    -------
    dict of set
        By dotted name. Fronts that only show what is behind them are left out.
    """
    found: dict[str, set[str]] = {}
    for module in modules(root).values():
        if not module.is_front or _defines(module):
            taken = {defining(root, use.module, use.name) for use in _taken(root, module.name)}
            found[module.name] = taken - {module.name}
    return {name: taken & found.keys() - {name} for name, taken in found.items()}


@cache
def _taken(root: Path, module: str) -> tuple[Use, ...]:
    # A front is asked for each of its names: it is read once.
    found = modules(root)[module]
    return tuple(uses(root, found.tree, found))


@cache
def defining(root: Path, module: str, name: str) -> str:
    """Return the module that defines a name which another shows.

    Parameters
    ----------
    root : Path
        Folder of the project.
    module : str
        Where the name is taken from.
    name : str
        The name.

    Returns
    -------
    str
        Dotted name of a module.
    """
    for use in _taken(root, module):
        if use.name == name and use.module != module:
            return defining(root, use.module, name)
    whole = f"{module}.{name}"
    return whole if whole in modules(root) else module


def floors(tree: Tree) -> dict[str, int]:
    """Give each module its floor: 0 if it imports none of the others.

    Parameters
    ----------
    tree : dict of set
        For each module those that it imports.

    Returns
    -------
    dict of int
        A floor for each module that is in no circle, and above none.
    """
    found: dict[str, int] = {}
    while ready := [m for m in tree if m not in found and tree[m] <= found.keys()]:
        found |= {m: 1 + max((found[below] for below in tree[m]), default=-1) for m in ready}
    return found


def circle(tree: Tree) -> list[str]:
    """Find the modules that import each other, directly or by way of others.

    Parameters
    ----------
    tree : dict of set
        For each module those that it imports.

    Returns
    -------
    list of str
        Sorted; empty if there is no circle.
    """
    return sorted(m for m in tree if m in _reached(tree, m))


def drawn(title: str, tree: Tree, lines: Mapping[str, int]) -> Iterator[str]:
    """Write a map, the highest floor first.

    Parameters
    ----------
    title : str
        What stands on the floors.
    tree : dict of set
        For each module those that it imports.
    lines : dict of int
        Their sizes.

    Yields
    ------
    str
        A line of the map.
    """
    found = floors(tree)
    yield f"{title}: {max(found.values(), default=-1) + 1} floors"
    for floor in range(max(found.values(), default=-1), -1, -1):
        names = sorted(m for m, at in found.items() if at == floor)
        yield f"  {floor:2}  " + "  ".join(
            f"{m.removeprefix(PACKAGE + '.')} {lines[m]}" for m in names
        )


def main(root: Path) -> str:
    """Print the map of the rooms, then that of the modules, each with its lines of code.

    Parameters
    ----------
    root : Path
        Folder of the project.

    Returns
    -------
    str
        What is wrong: the modules of a circle; empty if there is none.
    """
    tree = imports(root)
    rooms: dict[str, set[str]] = {room_of(name): set() for name in tree}
    lines: dict[str, int] = dict.fromkeys(rooms, 0)
    for module in modules(root).values():
        lines[module.name] = len(module.path.read_text(encoding="utf-8").splitlines())
        lines[module.room] = lines.get(module.room, 0) + lines[module.name]
    for name, taken in tree.items():
        rooms[room_of(name)] |= {room_of(below) for below in taken} - {room_of(name)}
    wrong = []
    for title, each in (("Rooms", rooms), ("Modules", tree)):
        print(*drawn(title, each, lines), sep="\n")
        wrong += [f"these import each other: {', '.join(found)}"] if (found := circle(each)) else []
    return "\n".join(wrong)


def _defines(module: Module) -> bool:
    return any(isinstance(s, ast.FunctionDef | ast.ClassDef) for s in module.tree.body)


def _reached(tree: Tree, start: str) -> set[str]:
    """Return what a module imports, directly or by way of others."""
    found: set[str] = set()
    new = set(tree[start])
    while new:
        found |= new
        new = {below for m in new for below in tree.get(m, ())} - found
    return found


if __name__ == "__main__":
    sys.exit(main(Path(__file__).resolve().parents[2]) or None)
