"""What of the graders a student's code gets while it is graded.

The notebooks import the package of the graders, which holds the solutions. In the sandbox they
find another one in its place: the classes of their cases, cut out of the source with whatever these
need to be printed and drawn, the group's own cases, and a `check` that does not check now.
"""

import ast
import io
import pickle
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from inspect import getsource
from typing import Any

from .. import exercises
from ..encoding import packed
from ..exercises.reviewing import NOT_NOW

__all__ = ["cut", "handout", "own_cases"]

TOOLS = {("cases", "factored"), ("figures", "draw_without_count"), ("set5", "draw_edge")}
"""What the notebooks import besides, by module and name."""


def handout(problems: Iterable[str], group: Any) -> dict[str, Any]:
    """Give the sources that a kernel may import, by module, and the group's own cases."""
    classes = (_Classes(case).found for case in _drawn(problems, group).values())
    return {
        "package": exercises.__name__,
        "sources": cut(frozenset(TOOLS.union(*classes))),
        "tools": sorted(TOOLS),
        "group": group,
        "cases": own_cases(problems, group),
        "note": NOT_NOW,
    }


def own_cases(problems: Iterable[str], group: Any) -> dict[str, str]:
    """Draw and pack the cases of a group, by problem."""
    return {name: packed(case) for name, case in _drawn(problems, group).items()}


def _drawn(problems: Iterable[str], group: Any) -> dict[str, Any]:
    known = exercises.PROBLEMS
    return {name: known[name].drawn(group, 1)[0] for name in problems if name in known}


class _Classes(pickle.Unpickler):
    """Notes which classes of the graders a case is made of, by module and name."""

    def __init__(self, case: Any) -> None:
        super().__init__(io.BytesIO(pickle.dumps(case)))
        self.found: set[tuple[str, str]] = set()
        self.load()

    def find_class(self, module: str, name: str) -> Any:
        package, _, last = module.rpartition(".")
        if package == exercises.__name__:
            self.found.add((last, name))
        return super().find_class(module, name)


@cache
def cut(wanted: frozenset[tuple[str, str]]) -> dict[str, str]:
    """Cut definitions out of the graders, with all that they need; the sources by module.

    >>> list(cut(frozenset({("set1", "SettledCase")})))
    ['set1']
    >>> "settled_table" in cut(frozenset({("set1", "SettledCase")}))["set1"]
    False
    """
    needed: set[tuple[str, str]] = set()
    waiting = list(wanted)
    while waiting:
        module, name = waiting.pop()
        if (module, name) in needed or name not in _defined(module):
            continue
        needed.add((module, name))
        for node in _defined(module)[name]:
            match node:
                case ast.ImportFrom(module=str(beside), level=1) if "." not in beside:
                    waiting.append((beside, name))
                case ast.Import() | ast.ImportFrom():
                    continue
                case _:
                    waiting += [(module, used) for used in _names(node)]
    return {
        module: _source(module, {name for where, name in needed if where == module})
        for module in sorted({module for module, _ in needed})
    }


def _source(module: str, names: set[str]) -> str:
    """Write the part of a module that defines some names, in its order."""
    nodes = {id(node): node for name in names for node in _defined(module)[name]}
    body = [_without_others(nodes[id(node)], names) for node in _tree(module) if id(node) in nodes]
    future = "from __future__ import annotations\n"
    return future + ast.unparse(ast.Module(body, type_ignores=[]))


def _without_others(node: ast.stmt, names: set[str]) -> ast.stmt:
    """Leave of an import what is needed."""
    if isinstance(node, ast.ImportFrom):
        kept = [each for each in node.names if (each.asname or each.name) in names]
        return ast.ImportFrom(node.module, kept, node.level)
    return node


@cache
def _tree(module: str) -> list[ast.stmt]:
    return ast.parse(getsource(import_module(f"{exercises.__name__}.{module}"))).body


@cache
def _defined(module: str) -> dict[str, list[ast.stmt]]:
    """Give what a module defines, by name: functions, classes, values, imports."""
    found: dict[str, list[ast.stmt]] = {}
    for node in _tree(module):
        for name in _defines(node):
            found.setdefault(name, []).append(node)
    return found


def _defines(node: ast.stmt) -> Iterator[str]:
    match node:
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            yield name
        case ast.Assign(targets=targets):
            yield from (each for target in targets for each in _names(target))
        case ast.AnnAssign(target=target):
            yield from _names(target)
        case ast.Import(names=names) | ast.ImportFrom(names=names):
            yield from ((name.asname or name.name).split(".")[0] for name in names)


def _names(node: ast.AST) -> Iterator[str]:
    """Give the names in a piece of code, without those of its annotations: they are never read."""
    if isinstance(node, ast.Name):
        yield node.id
    for field, part in ast.iter_fields(node):
        if field in ("annotation", "returns"):
            continue
        for child in part if isinstance(part, list) else [part]:
            if isinstance(child, ast.AST):
                yield from _names(child)
