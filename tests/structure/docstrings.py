"""Docstrings of the public API, as numpydoc validates them, and those that would be misread.

ruff (D) requires that there is one, with a first sentence. numpydoc takes the fields of dataclasses
and named tuples for parameters only; here they may stand under Attributes, too.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
from collections.abc import Iterable, Iterator
from enum import Enum
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from numpydoc.docscrape import NumpyDocString
from numpydoc.validate import validate

from .modules import PACKAGE, Module, modules, nodes

REQUIRED = {"PR01", "PR02", "PR03", "PR04", "PR10", "RT03", "YD01"}
"""Every parameter once, in order, with a type; what comes back described."""

AT_THE_TOP = {"EX01", "RT01"}
"""Of what `import nrdob` shows, besides: an example, and what comes back."""

MISREAD = {
    re.compile(r"(?:\A|(?<=\n\n)|(?<=-\n)) *[A-Z]\. "): "begins a list: write the surname first",
    re.compile(r"^ +[A-Z]\.$", re.MULTILINE): "begins a list: say it in words",
    re.compile(r"\\\\[,;!]"): "is a new line and a mark: write one backslash",
    re.compile(r"^\w+: [^\n]*(?=\n {4}\S)", re.MULTILINE): "is all name: write `name : type`",
}
"""What docutils, MathJax and numpydoc take for something else."""


def faults(root: Path) -> Iterator[str]:
    """Name every docstring that leaves something out, or would be misread."""
    public = [m.name for m in modules(root).values() if m.is_package or m.name.count(".") == 1]
    top = _shown([PACKAGE])
    found = [
        *(
            fault
            for name, thing in _shown(public).items()
            for fault in judged(name, thing, name in top)
        ),
        *(fault for module in modules(root).values() for fault in misread(module)),
    ]
    yield from (fault.replace(f"{root}/", "") for fault in found)


def misread(module: Module) -> Iterator[str]:
    """Name every docstring of a module that its page would not show as it is meant."""
    for node in nodes(module.tree):
        match node:
            case ast.Expr(ast.Constant(str() as written)):
                text = inspect.cleandoc(written)
                for pattern, fault in MISREAD.items():
                    for found in pattern.finditer(text):
                        line = node.lineno + text.count("\n", 0, found.start())
                        yield f'{module.path}:{line}: "{found.group().strip()}" {fault}'


def judged(name: str, thing: Any, at_the_top: bool = False) -> Iterator[str]:
    """Judge the docstring of a function or a class, and of its public methods."""
    if inspect.isclass(thing) and issubclass(thing, Exception | Enum):
        return
    required = REQUIRED | (AT_THE_TOP if at_the_top else set())
    fields = set(_fields(thing))
    verdict = validate(name)
    place = f"{verdict['file']}:{verdict['file_line']}: {name}: "
    if fields:
        documented = set(_documented(thing))
        yield from (f"{place}the field {f} is not documented" for f in sorted(fields - documented))
        for field in sorted(documented - fields - set(dir(thing))):
            yield f"{place}there is no field {field}"
        required = required - {"PR01", "PR02", "PR03"}
    yield from (f"{place}{said} ({code})" for code, said in verdict["errors"] if code in required)
    for member in vars(thing) if inspect.isclass(thing) else ():
        method = inspect.unwrap(getattr(vars(thing)[member], "__func__", vars(thing)[member]))
        # A function that is a field's default is no method.
        own = getattr(method, "__qualname__", "") == f"{thing.__qualname__}.{member}"
        if inspect.isfunction(method) and own and not member.startswith("_"):
            found = validate(f"{name}.{member}")
            for code, said in found["errors"]:
                if code in required - {"EX01"} | REQUIRED:
                    yield f"{found['file']}:{found['file_line']}: {name}.{member}: {said} ({code})"


def _shown(packages: Iterable[str]) -> dict[str, Any]:
    """Find the functions and classes that packages show; of a module shown there, what it shows."""
    found: dict[str, Any] = {}
    for package in packages:
        for name in import_module(package).__all__:
            thing = getattr(import_module(package), name, None)
            thing = thing or import_module(f"{package}.{name}")
            if isinstance(thing, ModuleType) and not hasattr(thing, "__path__"):
                found |= _shown([thing.__name__])
            elif inspect.isclass(thing) or inspect.isfunction(thing):
                found[f"{thing.__module__}.{thing.__qualname__}"] = thing
    return found


def _fields(thing: Any) -> Iterable[str]:
    """Return the fields of a dataclass or a named tuple."""
    if dataclasses.is_dataclass(thing):
        return [field.name for field in dataclasses.fields(thing) if field.init]
    return getattr(thing, "_fields", ())


def _documented(thing: Any) -> Iterator[str]:
    """Find the names that a class documents as parameters or attributes."""
    text = NumpyDocString(inspect.getdoc(thing) or "")
    for section in ("Parameters", "Attributes"):
        for entry in text[section]:
            yield from (name.strip() for name in entry.name.split(","))
