"""Who comes in by which door: imports past a front, chapters in a deep room, private names.

That imports run one way, and that every module stands in the room it was given, is asked by the
contract in pyproject.toml.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from pathlib import Path

from .rooms import COURSE, PACKAGE, Module, below, bound, modules, room_of, uses

OPEN = ("_repr_html_", "_repr_mimebundle_", "_replace", "_asdict", "_fields", "_make")
"""Names with an underscore that belong to the language of others, not to one class."""


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
    sets = root / "book" / COURSE / "sets"
    for path in sorted([*(root / "notebooks").rglob("*.ipynb"), *sets.rglob("*.ipynb")]):
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
    there = bound(module.tree) | below(root, module.name)
    for name in module.shows:
        if name not in there:
            yield f"{place}: {module.name} shows {name}, which is not there"


def _within(root: Path, module: Module) -> Iterator[str]:
    """Another room is entered by its front, and what is taken is shown."""
    for use in uses(root, module.tree, module):
        if f"{use.module}.{use.name}" in modules(root):
            continue  # a module; what is taken from it is asked about where it is taken
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
        for use in uses(root, tree, None):
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
    if modules(root)[name].is_front or front == PACKAGE:
        return True
    # A front may show a function of the same name.
    imported = (n for n in modules(root)[front].tree.body if isinstance(n, ast.ImportFrom))
    named = {alias.name for n in imported if n.module for alias in n.names}
    return _is_shown(root, front, last) and last not in named


def _is_shown(root: Path, module: str, name: str) -> bool:
    """Tell whether a module shows a name; the package shows all its rooms."""
    if name.startswith("__"):
        return True  # such as __name__, which every module has
    return name in (modules(root)[module].shows or ()) or (
        module == PACKAGE and name in below(root, module)
    )


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
