"""What stands where: the modules of the package, and what each of them shows."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path
from typing import NamedTuple

PACKAGE = "nrdob"


class Module(NamedTuple):
    """A module of the package, read without being run.

    Attributes
    ----------
    name : str
        Its dotted name.
    path : Path
        Where it stands.
    tree : ast.Module
        What is in it.
    """

    name: str
    path: Path
    tree: ast.Module

    @property
    def is_front(self) -> bool:
        """Whether it is the front of a room."""
        return self.path.name == "__init__.py"

    @property
    def room(self) -> str:
        """First name below the package: a room, or a module at the top."""
        return room_of(self.name)

    @property
    def shows(self) -> list[str] | None:
        """Names in `__all__`; None if it has none."""
        for statement in self.tree.body:
            match statement:
                case (
                    ast.Assign(targets=[ast.Name("__all__")], value=ast.List() as names)
                    | ast.AnnAssign(target=ast.Name("__all__"), value=ast.List() as names)
                ):
                    return list(ast.literal_eval(names))
        return None


def room_of(name: str) -> str:
    """Return the room in which a module stands, or the package for its own front."""
    parts = name.split(".")
    return parts[1] if len(parts) > 1 else PACKAGE


@cache
def modules(root: Path) -> dict[str, Module]:
    """Read every module of the package under a folder."""
    found = {}
    for path in sorted((root / PACKAGE).rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found[name] = Module(name, path, ast.parse(path.read_text(encoding="utf-8")))
    return found
