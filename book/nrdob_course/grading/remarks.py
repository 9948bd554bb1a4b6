"""Read a submission's code before it runs, and remark what no answer needs.

A remark is no verdict: there are honest reasons to open a file. It says where to look. And no
reading finds everything, for names can be put together while the code runs; see `sandbox` for what
holds.
"""

import ast
import re
import tomllib
from collections.abc import Iterable, Iterator
from importlib.resources import files
from typing import Any

__all__ = ["parsed", "suspicious"]

OURS = ("nrdob", "nrdob_course")
LISTS = tomllib.loads(files(__package__).joinpath("remarks.toml").read_text("utf-8"))
MODULES, OUTWARD, BUILT_IN = (set(LISTS[name]) for name in ("modules", "outward", "built_in"))
PLACES = re.compile(LISTS["places"], re.IGNORECASE)


def suspicious(cells: Iterable[Any], given_out: Iterable[Any]) -> list[str]:
    """List what the code cells do that no answer needs, each with the name of its cell.

    What the cells do as they were given out is left out: their own imports may be used.
    """
    usual = {sign for cell in given_out for sign in _signs(cell)}
    found: dict[str, list[str]] = {}
    for cell in cells:
        for sign in _signs(cell):
            if sign not in usual and sign not in found.setdefault(cell.id, []):
                found[cell.id].append(sign)
    told = {name: ", ".join(signs[:5]) for name, signs in found.items() if signs}
    return [f"{name} does what no answer needs: {signs}" for name, signs in told.items()]


def parsed(source: str) -> ast.Module | None:
    """Parse a cell without its magics; None if it is no Python."""
    lines = [re.sub(r"^(\s*)[%!].*", r"\1pass", line) for line in source.splitlines()]
    try:
        return ast.parse("\n".join(lines))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None


def _signs(cell: Any) -> Iterator[str]:
    if cell.cell_type != "code":
        return
    commands = re.findall(r"^\s*([!%]+\w*)", cell.source, re.MULTILINE)
    yield from (f"the command {command}" for command in commands)
    tree = parsed(cell.source)
    literal = set()  # where an attribute is asked for by a name that leads nowhere
    for node in ast.walk(tree) if tree else ():
        match node:
            case ast.Call(ast.Name("getattr") as asked, [_, ast.Constant(str(name)), *_]):
                literal |= set() if _leads_out(name) else {asked}
        if node not in literal:  # a call comes before its function
            yield from _of_node(node)


def _of_node(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.Import(names=names):
            for name in names:
                if not _allowed(name.name):
                    yield f"import {name.name}"
        case ast.ImportFrom(module=module, names=names, level=level):
            for name in names:
                if level or name.name == "*" or not _allowed(f"{module}.{name.name}"):
                    yield f"from {'.' * level}{module or ''} import {name.name}"
        case ast.Name(id=name) if name in BUILT_IN or name.startswith("__"):
            yield name
        case ast.Attribute(attr=attribute):
            text = ast.unparse(node)
            if _leads_out(attribute) or text.startswith(("os.", "sys.")):
                yield text[-60:]
            elif isinstance(node.ctx, ast.Store) and text.split(".")[0] in OURS:
                yield f"{text[:60]} = …"
        case ast.MatchClass(kwd_attrs=names):
            yield from filter(_leads_out, names)
        case ast.Constant(value=str(text)) if PLACES.search(text):
            yield repr(text[:60])


def _leads_out(name: str) -> bool:
    return name.startswith("_") or name in OUTWARD


def _allowed(module: str) -> bool:
    """Tell whether an answer may import that; the graders' package, by what was given out only."""
    first, *others = module.split(".")
    return first in MODULES and not any(map(_leads_out, others))
