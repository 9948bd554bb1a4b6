"""Print the rooms of the package floor by floor, as its imports put them.

    python book/make/map.py

A module stands one floor above the highest one that it imports. Modules that import each other in a
circle have no floor: they are named, and the program fails.
"""

from __future__ import annotations

import sys
from collections import defaultdict

import grimp

PACKAGE = "nrdob"


def floors(imports: dict[str, set[str]]) -> dict[str, int]:
    """Give each module its floor: 0 if it imports none of the others.

    Parameters
    ----------
    imports : dict of set
        For each module those that it imports.

    Returns
    -------
    dict of int
        A floor for each module that is in no circle.
    """
    found: dict[str, int] = {}
    while ready := [m for m in imports if m not in found and imports[m] <= found.keys()]:
        found |= {m: 1 + max((found[below] for below in imports[m]), default=-1) for m in ready}
    return found


def main() -> None:
    """Print the map of the rooms, then that of the modules in each."""
    graph = grimp.build_graph(PACKAGE)
    # The front of a room shows its contents; what a front imports is the room itself.
    fronts = {m for m in graph.modules if graph.find_children(m)}
    modules = sorted(graph.modules - fronts)
    imports = {
        m: {
            below
            for direct in graph.find_modules_directly_imported_by(m)
            for below in _behind(graph, direct, fronts)
            if below != m
        }
        for m in modules
    }
    rooms: dict[str, set[str]] = defaultdict(set)
    for module in modules:
        rooms[_room(module)] |= {_room(below) for below in imports[module]} - {_room(module)}
    for title, tree in (("Rooms", dict(rooms)), ("Modules", imports)):
        found = floors(tree)
        print(f"{title}: {max(found.values()) + 1} floors")
        for floor in range(max(found.values()), -1, -1):
            names = (m.removeprefix(PACKAGE + ".") for m, at in found.items() if at == floor)
            print(f"  {floor:2}  {'  '.join(sorted(names))}")
        if circle := tree.keys() - found.keys():
            sys.exit(f"these import each other: {', '.join(sorted(circle))}")


def _room(module: str) -> str:
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else PACKAGE


def _behind(graph: grimp.ImportGraph, module: str, fronts: set[str]) -> set[str]:
    """Return the modules that an import of `module` reaches: itself, or what a front shows."""
    if module not in fronts:
        return {module}
    return {m for m in graph.find_modules_directly_imported_by(module) if m not in fronts}


if __name__ == "__main__":
    main()
