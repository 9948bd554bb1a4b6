"""Docstrings of all that the package shows: every parameter told, with its type.

numpydoc judges the objects as they are imported. The fields of dataclasses and named tuples, which
it takes for parameters only, may stand under Attributes. How they are written is asked of all
docstrings: docutils takes a line such as "W. Michiels, 2014" for an entry of a list, numpydoc takes
"order: int" for a name, and MathJax takes two backslashes for a new line.
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
from typing import Any, NamedTuple

from numpydoc.docscrape import NumpyDocString
from numpydoc.validate import validate

from .rooms import PACKAGE, Module, modules

ASKED = {"GL08", "SS03", "PR01", "PR02", "PR03", "PR04", "PR10", "RT03", "YD01"}
"""Of all: a docstring, a first sentence, every parameter once, in order, with a type."""

ASKED_AT_THE_DOOR = {"EX01", "RT01"}
"""Of what `import nrdob` shows, besides: what comes back, and an example."""

MISREAD = {
    re.compile(r"(?:\A|(?<=\n\n)|(?<=-\n)) *[A-Z]\. "): "begins a list: write the surname first",
    re.compile(r"^ +[A-Z]\.$", re.MULTILINE): "begins a list: say it in words",
    re.compile(r"\\\\[,;!]"): "is a new line and a mark: write one backslash",
    re.compile(r"^\w+: [^\n]*(?=\n {4}\S)", re.MULTILINE): "is all name: write `name : type`",
}
"""What those who set the page take for something else."""


class Shown(NamedTuple):
    """Something that a front shows, and its name."""

    name: str
    thing: Any


def faults(root: Path) -> list[str]:
    """Name every docstring of the fronts that leaves something out, and all that are misread.

    Parameters
    ----------
    root : Path
        Folder of the project.

    Returns
    -------
    list of str
        Faults, each with its place.
    """
    # At the top of the package a module is its own front.
    fronts = [m.name for m in modules(root).values() if m.is_front or m.name.count(".") == 1]
    door = {shown.name for shown in _shown([PACKAGE])}
    found = [fault for shown in _shown(fronts) for fault in judged(shown, shown.name in door)]
    found += [fault for module in modules(root).values() for fault in misread(module)]
    return [fault.replace(f"{root}/", "") for fault in found]


def misread(module: Module) -> Iterator[str]:
    """Name every docstring that the pages would not show as it is meant.

    Parameters
    ----------
    module : Module
        A module of the package.

    Yields
    ------
    str
        A fault, with its place.
    """
    for node in ast.walk(module.tree):
        match node:
            case ast.Expr(ast.Constant(str() as written)):
                text = inspect.cleandoc(written)
                for pattern, fault in MISREAD.items():
                    for found in pattern.finditer(text):
                        line = node.lineno + text.count("\n", 0, found.start())
                        yield f'{module.path}:{line}: "{found.group().strip()}" {fault}'


def judged(shown: Shown, at_the_door: bool = False) -> Iterator[str]:
    """Judge the docstring of one thing, and of its public members.

    Parameters
    ----------
    shown : Shown
        A function or a class.
    at_the_door : bool
        Whether `import nrdob` shows it.

    Yields
    ------
    str
        A fault, with its place.
    """
    asked = ASKED | (ASKED_AT_THE_DOOR if at_the_door else set())
    if inspect.isclass(shown.thing) and issubclass(shown.thing, Exception | Enum):
        asked = {"GL08", "SS03"}
    yield from _judged(shown, asked)
    if inspect.isclass(shown.thing):
        for name, member in vars(shown.thing).items():
            method = getattr(member, "__func__", member)
            # A function that is a field's default is not a method.
            own = getattr(method, "__qualname__", "") == f"{shown.thing.__qualname__}.{name}"
            if inspect.isfunction(method) and own and not name.startswith("_"):
                yield from _judged(Shown(f"{shown.name}.{name}", member), asked - {"EX01"})


def _judged(shown: Shown, asked: set[str]) -> Iterator[str]:
    verdict = validate(shown.name)
    place = f"{verdict['file']}:{verdict['file_line']}: {shown.name}"
    fields = set(_fields(shown.thing))
    if fields:
        documented = set(_documented(shown.thing))
        for name in sorted(fields - documented):
            yield f"{place}: the field {name} is not documented"
        for name in sorted(documented - fields - set(dir(shown.thing))):
            yield f"{place}: there is no field {name}"
        asked = asked - {"PR01", "PR02", "PR03"}
    for code, message in verdict["errors"]:
        if code in asked:
            yield f"{place}: {message} ({code})"


def _shown(fronts: Iterable[str]) -> list[Shown]:
    """Find the functions and classes that fronts show; of a module shown there, what it shows."""
    found: dict[str, Any] = {}
    for front in fronts:
        for name in import_module(front).__all__:
            thing = getattr(import_module(front), name, None) or import_module(f"{front}.{name}")
            if isinstance(thing, ModuleType) and not hasattr(thing, "__path__"):
                found |= dict(_shown([thing.__name__]))
            elif inspect.isclass(thing) or inspect.isfunction(thing):
                found[f"{thing.__module__}.{thing.__qualname__}"] = thing
    return [Shown(name, thing) for name, thing in found.items()]


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
