"""What stands where: the modules of the package, and what each of them shows."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

PACKAGE = "nrdob"

COURSE = "nrdob_course"
"""The distribution beside the book; to the package it is one more room, above all others."""


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
    shows : tuple of str or None
        Names in `__all__`; None if it has none.
    """

    name: str
    path: Path
    tree: ast.Module
    shows: tuple[str, ...] | None

    @property
    def is_front(self) -> bool:
        """Whether it is the front of a room."""
        return self.path.name == "__init__.py"

    @property
    def room(self) -> str:
        """First name below the package: a room, or a module at the top."""
        return room_of(self.name)


class Use(NamedTuple):
    """A name taken from a module of the package, and where."""

    line: int
    module: str
    name: str


def room_of(name: str) -> str:
    """Return the room in which a module stands, or the package for its own front."""
    parts = name.split(".")
    return parts[0] if parts[0] == COURSE else parts[1] if len(parts) > 1 else PACKAGE


@cache
def modules(root: Path) -> dict[str, Module]:
    """Read every module of the package under a folder."""
    found = {}
    paths = [(root, path) for path in sorted((root / PACKAGE).rglob("*.py"))]
    book = root / "book"
    paths += [
        (book, path)
        for path in sorted((book / COURSE).rglob("*.py"))
        if path.name != "nbgrader_config.py"  # which nbgrader runs, and nobody imports
    ]
    for folder, path in paths:
        parts = path.relative_to(folder).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        tree = ast.parse(path.read_text(encoding="utf-8"))
        found[name] = Module(name, path, tree, _shown(tree))
    return found


def _shown(tree: ast.Module) -> tuple[str, ...] | None:
    for statement in tree.body:
        match statement:
            case (
                ast.Assign(targets=[ast.Name("__all__")], value=ast.List() as names)
                | ast.AnnAssign(target=ast.Name("__all__"), value=ast.List() as names)
            ):
                return tuple(ast.literal_eval(names))
    return None


def below(root: Path, module: str) -> set[str]:
    """Return the names of the modules right below a front."""
    return {name.rpartition(".")[2] for name in modules(root) if name.rpartition(".")[0] == module}


def bound(tree: ast.Module) -> set[str]:
    """Return the names that a module binds at its top, imports included."""
    found: set[str] = set()
    for statement in tree.body:
        match statement:
            case ast.FunctionDef() | ast.ClassDef():
                found.add(statement.name)
            case ast.Import() | ast.ImportFrom():
                found |= {alias.asname or alias.name for alias in statement.names}
            case ast.If():  # what is loaded when it is asked for is imported for the types
                found |= bound(ast.Module(statement.body + statement.orelse, []))
            case _:
                names = (node for node in ast.walk(statement) if isinstance(node, ast.Name))
                found |= {node.id for node in names if isinstance(node.ctx, ast.Store)}
    return found


def uses(root: Path, tree: ast.Module, inside: Module | None) -> Iterator[Use]:
    """Find what is taken from modules of the package: by import, or as `module.name`."""
    known = modules(root)
    aliases: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name in known:
                    bound = alias.asname or alias.name.split(".")[0]
                    aliases[bound] = alias.name if alias.asname else bound
        elif isinstance(node, ast.ImportFrom):
            source = _absolute(node, inside)
            for alias in node.names if source in known else ():
                whole = f"{source}.{alias.name}"
                if whole in known:
                    aliases[alias.asname or alias.name] = whole
                yield Use(node.lineno, source, alias.name)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and _module(node, aliases, known) is None:
            base = _module(node.value, aliases, known)
            if base is not None:
                yield Use(node.lineno, base, node.attr)


def _module(node: ast.expr, aliases: dict[str, str], known: Iterable[str]) -> str | None:
    """Return the module that an expression names, as `nrdob.plotting` or an alias does."""
    if isinstance(node, ast.Name):
        return aliases.get(node.id)
    if isinstance(node, ast.Attribute) and (base := _module(node.value, aliases, known)):
        whole = f"{base}.{node.attr}"
        return whole if whole in known else None
    return None


def _absolute(node: ast.ImportFrom, inside: Module | None) -> str:
    """Return the module that an import names, seen from where it stands."""
    if not node.level or inside is None:
        return node.module or ""
    parts = inside.name.split(".")
    base = parts[: len(parts) - node.level + inside.is_front]
    return ".".join([*base, *(node.module or "").split(".")]).rstrip(".")
