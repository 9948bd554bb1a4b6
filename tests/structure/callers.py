"""Each public name has a caller: a chapter, an exercise, a page, another subpackage.

    python -m tests.structure.callers    the members and parameters without one, too

A page of the book counts where it names something as code: so a name that is kept because users of
python-control expect it stands on a page. A class counts as used where it types a result, and an
exception where it is raised.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from .modules import PACKAGE, cells, modules, nodes, notebooks, subpackage_of, uses

PAGES = ("README.md", "book/*.md", "book/teaching/*.md", "book/templates/*.j2")
"""Pages that a reader is shown; those of the reference, which list everything, are none."""

CODE = re.compile(r"```.*?```|`[^`]+`", re.DOTALL)
ROLE = re.compile(r"\{[\w:]+\}`[^`]+`")
"""A link to the reference, which is no use."""


def faults(root: Path) -> Iterator[str]:
    """Name every public name without a caller."""
    taken, told = _taken(root), _told(root)
    typed = {name for module in modules(root).values() for name in _annotations(module.tree)}
    for name, module in modules(root).items():
        if not name.startswith(f"{PACKAGE}.") and name != PACKAGE:
            continue
        if not module.is_package and name.count(".") > 1:
            continue  # of an inner module the package decides what is public
        for shown in module.shows or ():
            if (name, shown) not in taken and shown not in told | typed:
                yield (
                    f"{module.path.relative_to(root)}:1: {name}.{shown} has no caller: use it in a "
                    "chapter or on a page, or take it out of __all__"
                )


def members(root: Path) -> Iterator[str]:
    """Name members of public classes and optional parameters that nobody but tests uses."""
    trees = [module.tree for module in modules(root).values()] + _outside(root)
    read = {n.attr for t in trees for n in nodes(t) if isinstance(n, ast.Attribute)}
    given = {k.arg for t in trees for n in nodes(t) if isinstance(n, ast.Call) for k in n.keywords}
    told = _told(root)
    for name, module in modules(root).items():
        if not name.startswith(f"{PACKAGE}."):
            continue
        for node in module.tree.body:
            place = f"{module.path.relative_to(root)}:{node.lineno}: "
            if getattr(node, "name", "_").startswith("_"):
                continue
            if isinstance(node, ast.ClassDef):
                for member in _members(node):
                    if member not in read | told:
                        yield f"{place}{node.name}.{member}"
            if isinstance(node, ast.FunctionDef) and node.name in (module.shows or ()):
                for argument in node.args.kwonlyargs:
                    if argument.arg not in given:
                        yield f"{place}{node.name}({argument.arg}=)"


def _members(node: ast.ClassDef) -> Iterator[str]:
    for statement in node.body:
        match statement:
            case ast.FunctionDef(name=name) | ast.AnnAssign(target=ast.Name(name)):
                if not name.startswith("_"):
                    yield name


def _taken(root: Path) -> set[tuple[str, str]]:
    """Return what is taken from each module by another subpackage, by chapters and programs."""
    found = {
        (use.module, use.name)
        for module in modules(root).values()
        for use in uses(root, module.tree, module)
        if subpackage_of(use.module) != subpackage_of(module.name) or module.name == PACKAGE
    }
    return found | {(use.module, use.name) for tree in _outside(root) for use in uses(root, tree)}


@cache
def _outside(root: Path) -> list[ast.Module]:
    programs = [*(root / "book/make").glob("*.py"), *(root / "book/ext").glob("*.py")]
    chapters = ["\n".join(dict(cells(path, "code")).values()) for path in notebooks(root)]
    return [ast.parse(text) for text in [*(p.read_text("utf-8") for p in programs), *chapters]]


@cache
def _told(root: Path) -> frozenset[str]:
    """Return the words that pages and chapters print as code."""
    texts: list[str] = [p.read_text("utf-8") for glob in PAGES for p in root.glob(glob)]
    texts += [text for path in notebooks(root) for _, text in cells(path, "markdown")]
    return frozenset(
        word
        for text in texts
        for code in CODE.findall(ROLE.sub("", text))
        for word in re.findall(r"\w+", code)
    )


def _annotations(tree: ast.Module) -> Iterator[str]:
    """Give the names in the types of results and of fields, and of the errors that are raised."""
    for node in nodes(tree):
        match node:
            case (
                ast.FunctionDef(returns=ast.expr() as found)
                | ast.AnnAssign(annotation=found)
                | ast.Raise(exc=ast.Call(func=found))
            ):
                yield from re.findall(r"\w+", ast.unparse(found))


if __name__ == "__main__":
    print(*members(Path(__file__).resolve().parents[2]), sep="\n", file=sys.stdout)
