"""Who comes in by which door: imports past a front, chapters in a deep room, private names.

That imports run one way, and that every module stands in the room it was given, is asked by the
contract in pyproject.toml.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from .rooms import PACKAGE, Module, modules, room_of

OPEN = ("_repr_html_", "_repr_mimebundle_", "_replace", "_asdict", "_fields", "_make")
"""Names with an underscore that belong to the language of others, not to one class."""


class Use(NamedTuple):
    """A name taken from a module of the package, and where."""

    line: int
    module: str
    name: str


def faults(root: Path) -> Iterator[str]:
    """Name every door that is passed by.

    Parameters
    ----------
    root : Path
        Folder of the project.

    Yields
    ------
    str
        A fault, with its place.
    """
    for module in modules(root).values():
        yield from _shown(root, module)
        yield from _within(root, module)
    for path in sorted((root / "tests").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for line, name in _private(root, tree):
            yield (
                f"{path.relative_to(root)}:{line}: {name} is private: test what is public, or make "
                "it public"
            )
    for path in sorted((root / "notebooks").rglob("*.ipynb")):
        yield from _chapter(root, path)


def _shown(root: Path, module: Module) -> Iterator[str]:
    """Ask for an opening sentence, and for a list of what the module shows."""
    place = f"{module.path.relative_to(root)}:1"
    opening = (ast.get_docstring(module.tree) or "").split("\n\n")[0]
    if not opening.endswith((".", "?")):
        yield f"{place}: {module.name} does not open with a sentence that says what it is for"
    if module.path.name == "__main__.py":
        return
    if module.shows is None:
        yield f"{place}: {module.name} has no __all__"
        return
    there = _bound(module.tree) | _below(root, module.name)
    for name in module.shows:
        if name not in there:
            yield f"{place}: {module.name} shows {name}, which is not there"


def _within(root: Path, module: Module) -> Iterator[str]:
    """Another room is entered by its front, and what is taken is shown."""
    for use in _uses(root, module.tree, module):
        place = f"{module.path.relative_to(root)}:{use.line}"
        front = f"{PACKAGE}.{room_of(use.module)}"
        if room_of(use.module) not in (module.room, PACKAGE) and use.module != front:
            yield (
                f"{place}: {module.name} takes {use.name} from {use.module}, past the front of "
                f"the room: import it from {front}"
            )
        elif not _is_shown(root, use.module, use.name):
            yield f"{place}: {use.module} does not show {use.name}: enter it in its __all__"


def _chapter(root: Path, path: Path) -> Iterator[str]:
    """A reader meets only what the fronts show."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    for number, cell in enumerate(cells, 1):
        if cell["cell_type"] != "code":
            continue
        tree = _parsed("".join(cell["source"]))
        place = f"{path.relative_to(root)}, cell {number}, line "
        for use in _uses(root, tree, None):
            if not _is_open(root, use.module):
                yield (
                    f"{place}{use.line}: {use.name} comes from the deep room {use.module}; "
                    "a chapter takes what it needs from a front, such as "
                    f"{use.module.rpartition('.')[0]}"
                )
            elif not _is_shown(root, use.module, use.name):
                yield f"{place}{use.line}: {use.module} does not show {use.name}"
        for line, name in _private(root, tree):
            yield f"{place}{line}: {name} is private; a chapter shows public names only"


def _is_open(root: Path, name: str) -> bool:
    """Tell fronts, modules at the top, and those that a front shows, from deep rooms."""
    front, _, last = name.rpartition(".")
    return modules(root)[name].is_front or front == PACKAGE or _is_shown(root, front, last)


def _is_shown(root: Path, module: str, name: str) -> bool:
    """Tell whether a module shows a name; the package shows all its rooms."""
    return name in (modules(root)[module].shows or ()) or (
        module == PACKAGE and name in _below(root, module)
    )


def _below(root: Path, module: str) -> set[str]:
    """Return the names of the modules right below a front."""
    return {name.rpartition(".")[2] for name in modules(root) if name.rpartition(".")[0] == module}


def _bound(tree: ast.Module) -> set[str]:
    """Return the names that a module binds at its top, imports included."""
    found: set[str] = set()
    for statement in tree.body:
        match statement:
            case ast.FunctionDef() | ast.ClassDef():
                found.add(statement.name)
            case ast.Import() | ast.ImportFrom():
                found |= {alias.asname or alias.name for alias in statement.names}
            case _:
                names = (node for node in ast.walk(statement) if isinstance(node, ast.Name))
                found |= {node.id for node in names if isinstance(node.ctx, ast.Store)}
    return found


def _uses(root: Path, tree: ast.Module, inside: Module | None) -> Iterator[Use]:
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
                # Within the package it is told where something is taken from that module.
                if whole not in known or inside is None:
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


def _private(root: Path, tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Find the private names of others: imported, asked for as attributes, or by a text."""
    foreign = {"self", "cls"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            ours = isinstance(node, ast.ImportFrom) and node.module in modules(root)
            for alias in node.names:
                if ours and _is_private(alias.name):
                    yield node.lineno, alias.name
                elif not ours:
                    foreign.add((alias.asname or alias.name).split(".")[0])
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and _is_private(node.attr):
            if _first(node) not in foreign:
                yield node.lineno, node.attr
        elif isinstance(node, ast.Call) and _is_reflection(node.func):
            texts = (a.value for a in node.args if isinstance(a, ast.Constant))
            for text in texts:
                if isinstance(text, str) and _is_private(text.rpartition(".")[2]):
                    yield node.lineno, text


def _is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__") and name not in OPEN


def _is_reflection(function: ast.expr) -> bool:
    return ast.unparse(function).rpartition(".")[2] in ("getattr", "setattr", "delattr", "object")


def _first(node: ast.expr) -> str:
    """Return the name with which a chain of attributes begins."""
    while isinstance(node, ast.Attribute):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def _parsed(source: str) -> ast.Module:
    """Parse a cell without the lines that are commands of the notebook."""
    lines = ("" if line.lstrip().startswith(("%", "!")) else line for line in source.splitlines())
    return ast.parse("\n".join(lines))
