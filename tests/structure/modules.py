"""The modules of the package and of the course, read without being run."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

PACKAGE, COURSE = "nrdob", "nrdob_course"

NOT_IMPORTED = "nbgrader_config.py"
"""Run by nbgrader; nobody imports it."""

LONGEST = 500
"""Lines of a module of the package."""


class Module(NamedTuple):
    """A module: its dotted name, its file, its syntax tree, and the names in `__all__`."""

    name: str
    path: Path
    tree: ast.Module
    shows: tuple[str, ...] | None

    @property
    def is_package(self) -> bool:
        """Whether its names are the public API of a package."""
        return self.path.name == "__init__.py"


class Use(NamedTuple):
    """A name taken from a module, and the line where it is."""

    line: int
    module: str
    name: str


def faults(root: Path) -> Iterator[str]:
    """Name every module of the package that is too long."""
    for module in modules(root).values():
        length = len(module.path.read_text("utf-8").splitlines())
        if not module.name.startswith(COURSE) and length > LONGEST:
            yield f"{module.path.relative_to(root)}:{length}: more than {LONGEST} lines: part it"


def subpackage_of(name: str) -> str:
    """Return the subpackage, or the module at the top, to which a module belongs."""
    return ".".join(name.split(".")[: 1 if name.startswith(COURSE) else 2])


@cache
def modules(root: Path) -> dict[str, Module]:
    """Read every module of the package and of the course, by dotted name."""
    found = {}
    for folder, package in ((root, PACKAGE), (root / "book", COURSE)):
        for path in sorted((folder / package).rglob("*.py")):
            if path.name != NOT_IMPORTED:
                parts = path.relative_to(folder).with_suffix("").parts
                name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
                tree = ast.parse(path.read_text(encoding="utf-8"))
                found[name] = Module(name, path, tree, _shown(tree))
    return found


@cache
def nodes(tree: ast.AST) -> tuple[ast.AST, ...]:
    """Walk a tree once."""
    return tuple(ast.walk(tree))


def notebooks(root: Path) -> list[Path]:
    """Return the chapters, the notebooks for class and the problem sets."""
    sets = root / "book" / COURSE / "sets"
    return sorted([*(root / "notebooks").rglob("*.ipynb"), *sets.rglob("*.ipynb")])


@cache
def _sources(notebook: Path) -> list[tuple[str, str]]:
    """Read kind and text of each cell, without the outputs."""
    found = json.loads(notebook.read_text("utf-8"))["cells"]
    return [(cell["cell_type"], "".join(cell["source"])) for cell in found]


def cells(notebook: Path, kind: str) -> Iterator[tuple[int, str]]:
    """Give number and text of each cell of one kind, commands of the notebook left out."""
    for number, (what, source) in enumerate(_sources(notebook), 1):
        if what == kind:
            lines = source.splitlines()
            yield number, "\n".join("" if x.lstrip().startswith(("%", "!")) else x for x in lines)


@cache
def code(notebook: Path) -> ast.Module:
    """Parse the code of a notebook, its cells one below the other."""
    return ast.parse("\n".join(dict(cells(notebook, "code")).values()))


def below(root: Path, module: str) -> set[str]:
    """Return the names of the modules right below a package."""
    return {name.rpartition(".")[2] for name in modules(root) if name.rpartition(".")[0] == module}


@cache
def uses(root: Path, tree: ast.Module, inside: Module | None = None) -> tuple[Use, ...]:
    """Find what is taken from the modules: by import, or as `module.name`."""
    return tuple(_uses(root, tree, inside))


def _uses(root: Path, tree: ast.Module, inside: Module | None) -> Iterator[Use]:
    known = modules(root)
    aliases: dict[str, str] = {}
    for node in nodes(tree):
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
    for node in nodes(tree):
        if isinstance(node, ast.Attribute) and _module(node, aliases, known) is None:
            base = _module(node.value, aliases, known)
            if base is not None:
                yield Use(node.lineno, base, node.attr)


def _shown(tree: ast.Module) -> tuple[str, ...] | None:
    for statement in tree.body:
        match statement:
            case (
                ast.Assign(targets=[ast.Name("__all__")], value=ast.List() as names)
                | ast.AnnAssign(target=ast.Name("__all__"), value=ast.List() as names)
            ):
                return tuple(ast.literal_eval(names))
    return None


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
    base = parts[: len(parts) - node.level + inside.is_package]
    return ".".join([*base, *(node.module or "").split(".")]).rstrip(".")
