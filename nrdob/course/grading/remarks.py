"""Read a submission's code before it runs, and remark what no answer needs.

A remark is no verdict: there are honest reasons to open a file. It says where to look. And no
reading finds everything, for names can be put together while the code runs; see `wall` for what
holds.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from typing import Any

__all__ = ["parsed", "suspicious"]

PACKAGE = "nrdob"
GRADERS = f"{PACKAGE}.course"
BUILT_IN = {
    "open", "exec", "eval", "compile", "__import__", "__builtins__", "__loader__", "globals",
    "vars", "get_ipython", "breakpoint", "memoryview",
}  # fmt: skip
MODULES = {
    "builtins", "ctypes", "gc", "importlib", "inspect", "io", "multiprocessing", "os",
    "pathlib", "pickle", "psutil", "shutil", "signal", "socket", "subprocess", "sys",
    "tempfile", "threading", "urllib", "requests", "ftplib", "http", "IPython",
}  # fmt: skip
HARMLESS = {"sys.exit", "sys.maxsize", "sys.float_info", "os.path", "os.linesep"}
PLACES = re.compile(r"/proc\b|/dev/|gradebook|\.\./|\.ipynb|/etc/|/home/|/root/", re.IGNORECASE)


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
    return [
        f"{name} does what no answer needs: {', '.join(signs[:5])}"
        for name, signs in found.items()
        if signs
    ]


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
    yield from (
        f"the command {match[1]}" for match in re.finditer(r"^\s*([!%]+\w*)", cell.source, re.M)
    )
    tree = parsed(cell.source)
    for node in ast.walk(tree) if tree else ():
        yield from _of_node(node)


def _of_node(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.Import(names=names):
            for name in names:
                if _guarded(name.name):
                    yield f"import {name.name}"
        case ast.ImportFrom(module=module, names=names):
            for name in names:
                if name.name.startswith("_") or _guarded(module or ""):
                    yield f"from {module} import {name.name}"
        case ast.Name(id=name) if name in BUILT_IN:
            yield name
        case ast.Attribute(attr=attribute):
            text = ast.unparse(node)
            if attribute.startswith("_"):
                yield text[-60:]
            elif isinstance(node.ctx, ast.Store) and text.split(".")[0] == PACKAGE:
                yield f"{text[:60]} = …"
            elif text not in HARMLESS and text.startswith((f"{GRADERS}.", "os.", "sys.")):
                yield text[:60]
        case ast.Constant(value=str(text)) if PLACES.search(text):
            yield repr(text[:60])


def _guarded(module: str) -> bool:
    """Tell whether a module leads out of the notebook, or to the graders."""
    top = module.split(".")[0]
    if top in ("os", "sys"):  # what is used of them is looked at
        return False
    return top in MODULES or module == GRADERS or module.startswith(f"{GRADERS}.")
