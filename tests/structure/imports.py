"""Imports pass through public APIs, in the package and in chapters.

That imports run one way and that each module is in its layer is checked by the contracts in
pyproject.toml; that tests and chapters use no private names, by ruff (SLF001, PLC2701).
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from .modules import PACKAGE, Module, below, cells, code, modules, notebooks, subpackage_of, uses

PRIVATE_BY_TEXT = re.compile(r"""["'](nrdob[\w.]*\._[a-z]\w*)["']""")
"""A private name as `monkeypatch` takes it, which ruff does not see."""


def faults(root: Path) -> Iterator[str]:
    """Name every import past a public API."""
    for module in modules(root).values():
        yield from _within(root, module)
    for path in notebooks(root):
        yield from _chapter(root, path)
    for path in sorted((root / "tests").rglob("test_*.py")):
        for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
            if found := PRIVATE_BY_TEXT.search(line):
                place = f"{path.relative_to(root)}:{number}"
                yield f"{place}: {found[1]} is private: test what is public"


def _within(root: Path, module: Module) -> Iterator[str]:
    """Another subpackage is imported from by its public API."""
    if module.shows is None and module.path.name != "__main__.py":
        yield f"{module.path.relative_to(root)}:1: {module.name} has no __all__"
    for use in uses(root, module.tree, module):
        if f"{use.module}.{use.name}" in modules(root):
            continue  # a module: what is taken from it is judged where it is taken
        place = f"{module.path.relative_to(root)}:{use.line}"
        api = subpackage_of(use.module)
        if api not in (subpackage_of(module.name), PACKAGE) and use.module != api:
            yield f"{place}: {use.name} is imported from {use.module}: import it from {api}"
        elif not _is_shown(root, use.module, use.name):
            yield f"{place}: {use.module} does not show {use.name}: enter it in its __all__"


def _chapter(root: Path, path: Path) -> Iterator[str]:
    """A chapter uses public names only."""
    sources = dict(cells(path, "code"))
    lines = [(number, k) for number in sources for k in range(1, 2 + sources[number].count("\n"))]
    for use in uses(root, code(path)):
        number, line = lines[use.line - 1]
        place = f"{path.relative_to(root)}, cell {number}, line {line}: "
        if not _is_public(root, use.module):
            yield f"{place}{use.name} is imported from the inner {use.module}"
        elif not _is_shown(root, use.module, use.name):
            yield f"{place}{use.module} does not show {use.name}"


def _is_public(root: Path, name: str) -> bool:
    """Tell packages, modules at the top and modules that a package shows from inner ones."""
    package, _, last = name.rpartition(".")
    if modules(root)[name].is_package or package == PACKAGE:
        return True
    # A package may show a function of the module's name.
    imported = (n for n in modules(root)[package].tree.body if isinstance(n, ast.ImportFrom))
    named = {alias.name for n in imported if n.module for alias in n.names}
    return _is_shown(root, package, last) and last not in named


def _is_shown(root: Path, module: str, name: str) -> bool:
    """Tell whether a module shows a name; the package shows all its subpackages."""
    return (
        name.startswith("__")  # such as __name__, which every module has
        or name in (modules(root)[module].shows or ())
        or (module == PACKAGE and name in below(root, module))
    )
