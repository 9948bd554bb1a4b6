"""Each public name has a caller: a chapter, an exercise, a page, another subpackage.

A page of the book counts where it calls or qualifies something as code, `f(x, order=2)` or `.ms`:
so a name that is kept because users of python-control expect it stands on a page. A class counts as
used where it types a result, and an exception where it is raised. The same holds of the members of
public classes and of parameters. What a module shows another file uses, be it a test; what it does
not show it uses itself.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from .modules import PACKAGE, Module, cells, code, modules, nodes, notebooks, subpackage_of, uses
from .pages import CONTENTS

PAGES = ("README.md", "book/*.md", "book/teaching/*.md", "book/templates/*.j2")
"""Pages that a reader is shown; those of the reference, which list everything, are none."""

CODE = re.compile(r"```.*?```|`[^`]+`", re.DOTALL)
ROLE = re.compile(r"\{[\w:]+\}`[^`]+`")
"""A link to the reference, which is no use."""

TOLD, GIVEN = re.compile(r"\w+(?=\()|(?<=\.)\w+"), re.compile(r"\w+(?==)")
"""What is called or taken from something, and parameters: a mere word may be any other."""

USED_OTHERWISE = {
    "Row.noise_y": "a column, taken by its name",
    "Row.noise_u": "a column, taken by its name",
    "Row.peak_u": "a column, taken by its name",
    "Margins.disk_margin": "users of python-control look for it",
    "certify(variable=)": "a sampled loop gives it in **",
    "half_plane_points(within=)": "given in **",
}
"""Members and parameters without a user that can be read, and why they are kept."""


def faults(root: Path) -> Iterator[str]:
    """Name what nobody uses: public names, members and parameters, and names of inner modules."""
    yield from _public(root)
    for place, name in members(root):
        if name not in USED_OTHERWISE:
            yield f"{place}: {name} has no user: take it out, or use it in a chapter or on a page"
    yield from _inner(root)


def _public(root: Path) -> Iterator[str]:
    taken, told = _taken(root), _told(root)
    typed = {name for module in modules(root).values() for name in _annotations(module.tree)}
    for name, module in modules(root).items():
        if not _is_front(module) or name.split(".")[0] != PACKAGE:
            continue
        for shown in module.shows or ():
            if (name, shown) not in taken and shown not in told | typed:
                yield (
                    f"{module.path.relative_to(root)}:1: {name}.{shown} has no caller: use it in a "
                    "chapter or on a page, or take it out of __all__"
                )


def members(root: Path) -> Iterator[tuple[str, str]]:
    """Give place and name of members of classes and of parameters that only tests use."""
    trees = [module.tree for module in modules(root).values()] + _outside(root)
    read = {n.attr for t in trees for n in nodes(t) if isinstance(n, ast.Attribute)}
    for template in (root / PACKAGE).rglob("*.j2"):
        read.update(TOLD.findall(template.read_text("utf-8")))
    given = {k.arg for t in trees for n in nodes(t) if isinstance(n, ast.Call) for k in n.keywords}
    told, given = _told(root), given | _told(root, GIVEN)
    for name, module in modules(root).items():
        if not name.startswith(f"{PACKAGE}."):
            continue
        for node in module.tree.body:
            place = f"{module.path.relative_to(root)}:{node.lineno}"
            if getattr(node, "name", "_").startswith("_"):
                continue
            if isinstance(node, ast.ClassDef):
                for member in _members(node):
                    if member not in read | told:
                        yield place, f"{node.name}.{member}"
            if isinstance(node, ast.FunctionDef) and node.name in (module.shows or ()):
                for argument in node.args.kwonlyargs:
                    if argument.arg not in given:
                        yield place, f"{node.name}({argument.arg}=)"


def _inner(root: Path) -> Iterator[str]:
    """Name what a module shows and no other file uses, and what it keeps and does not use."""
    files = [p for folder in (PACKAGE, "book", "tests") for p in (root / folder).rglob("*.py")]
    words = Counter(w for p in files for w in set(re.findall(r"\w+", p.read_text("utf-8"))))
    taken = _taken(root)
    for module in modules(root).values():
        place = f"{module.path.relative_to(root)}:1: {module.name}"
        # The problems of a set are found by vars().
        if not (_is_front(module) or re.search(r"exercises\.set\d$", module.name)):
            for name in module.shows or ():
                if words[name] < 2 and (module.name, name) not in taken:
                    yield f"{place} shows {name}, which no other file uses: take it out of __all__"
        names = (n for n in nodes(module.tree) if isinstance(n, ast.Name))
        loaded = {n.id for n in names if isinstance(n.ctx, ast.Load)}
        for name in _kept(module):
            if name not in loaded:
                yield f"{place} does not use its {name}: take it out"


def _is_front(module: Module) -> bool:
    """Tell whether all may use what it shows: of an inner module the package decides that."""
    return module.is_package or module.name == subpackage_of(module.name)


def _members(node: ast.ClassDef) -> Iterator[str]:
    for statement in node.body:
        match statement:
            case ast.FunctionDef(name=name) | ast.AnnAssign(target=ast.Name(name)):
                if not name.startswith("_"):
                    yield name


def _kept(module: Module) -> Iterator[str]:
    """Give the functions, classes and constants that a module does not show."""
    for statement in module.tree.body:
        match statement:
            case (
                ast.FunctionDef(name=name, decorator_list=[])
                | ast.ClassDef(name=name)
                | ast.Assign(targets=[ast.Name(name)])
                | ast.AnnAssign(target=ast.Name(name))
            ) if not name.startswith("__") and name not in (module.shows or ()):
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
    chapters = [code(path) for path in notebooks(root)]
    return [*(ast.parse(path.read_text("utf-8")) for path in programs), *chapters]


@cache
def _told(root: Path, names: re.Pattern[str] = TOLD) -> frozenset[str]:
    """Return the names that pages and chapters use where they print code."""
    pages = {path for glob in PAGES for path in root.glob(glob)} - {root / CONTENTS}
    texts = [path.read_text("utf-8") for path in pages]
    texts += [text for path in notebooks(root) for _, text in cells(path, "markdown")]
    return frozenset(
        word
        for text in texts
        for printed in CODE.findall(ROLE.sub("", text))
        for word in names.findall(printed)
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
