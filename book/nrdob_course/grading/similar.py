"""Find answers that are alike, for a person to look at.

Names, spaces, comments and quotes do not count: two cells are compared by the shapes of their
statements. What was given out, what is short, and what many have in common is left out, for some
problems have one short way. Answers that are the published solution's are listed by themselves,
however many have copied them. A line of the list is a question, not a verdict.
"""

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any

from .remarks import parsed

__all__ = ["copies", "pairs"]

RUN = 5  # symbols, or words, that are compared together
FEWEST = 12  # runs that an answer must have, to be compared at all
ALIKE = 0.8  # share of the runs of the shorter answer that the other one has, too
COMMON, FEW = 0.25, 4
"""What more than this share of a class has written, and more than a few, is nobody's."""
PUBLISHED = "the published solution"


def pairs(notebooks: Mapping[str, Any], given_out: Any) -> list[dict[str, str]]:
    """Compare the cells of one set, by student; those with the most in common come first.

    A line tells the two of whom answers are alike, in which cells, and the shares there.
    """
    found = Found(list)
    for name, answers in _own(notebooks, given_out).items():
        for first, second, share in _alike(answers):
            found[first, second].append((name, round(share, 2)))
    return _listed(found)


def copies(notebooks: Mapping[str, Any], given_out: Any, solution: Any) -> list[dict[str, str]]:
    """List who has answers that hold the published solution, whatever else stands in the cell."""
    published = _own({PUBLISHED: solution}, given_out)
    found = Found(list)
    for name, answers in _own(notebooks, given_out).items():
        wanted = published.get(name, {}).get(PUBLISHED, frozenset())
        for student, own in sorted(answers.items()):
            share = len(own & wanted) / max(len(wanted), 1)
            if len(wanted) >= FEWEST and share >= ALIKE:
                found[student, PUBLISHED].append((name, round(share, 2)))
    return _listed(found)


Runs = frozenset[tuple[str, ...]]
Found = defaultdict[tuple[str, str], list[tuple[str, float]]]
"""Cells and shares by the two who have written them."""


def _own(notebooks: Mapping[str, Any], given_out: Any) -> dict[str, dict[str, Runs]]:
    """Give what each has written into the cells of a set, by cell and student."""
    skeleton = {cell.id: _runs(cell) for cell in given_out.cells}
    cells: dict[str, dict[str, Runs]] = {}
    for student, notebook in notebooks.items():
        for cell in notebook.cells:
            if cell.id in skeleton and not cell.metadata.get("nbgrader", {}).get("locked"):
                own = _runs(cell) - skeleton[cell.id]
                cells.setdefault(cell.id, {})[student] = frozenset(own)
    return cells


def _listed(found: Found) -> list[dict[str, str]]:
    return [
        {
            "first": first,
            "second": second,
            "cells": " ".join(name for name, _ in sorted(shares)),
            "share": " ".join(f"{share:g}" for _, share in sorted(shares)),
        }
        for (first, second), shares in sorted(found.items(), key=lambda x: (-len(x[1]), x[0]))
    ]


def _alike(answers: Mapping[str, Runs]) -> Iterator[tuple[str, str, float]]:
    counts = Counter(run for runs in answers.values() for run in runs)
    most = max(FEW, COMMON * len(answers))
    few = {run for run, count in counts.items() if count <= most}
    rare = {student: runs & few for student, runs in answers.items()}
    long = sorted(student for student, runs in rare.items() if len(runs) >= FEWEST)
    for first, second in combinations(long, 2):
        shorter = min(len(rare[first]), len(rare[second]))
        share = len(rare[first] & rare[second]) / shorter
        if share >= ALIKE:
            yield first, second, share


MARK = re.compile(r"^.*(BEGIN|END) SOLUTION.*$", re.MULTILINE)


def _runs(cell: Any) -> set[tuple[str, ...]]:
    tree = parsed(cell.source) if cell.cell_type == "code" else None
    text = MARK.sub("", cell.source)
    words = re.findall(r"\w+|[^\w\s]", text.casefold())
    symbols = list(_symbols(tree)) if tree else words
    return {tuple(symbols[k : k + RUN]) for k in range(len(symbols) - RUN + 1)}


def _symbols(tree: ast.AST) -> Iterator[str]:
    """Give the shape of code: names of one's own are all alike, what they are used for is not."""
    waiting = [tree]
    while waiting:  # a statement with all that is in it, then the next one
        node = waiting.pop()
        match node:
            case ast.Expr(value=ast.Constant(value=str())) | ast.Load() | ast.Store():
                continue
            case ast.Attribute(attr=name):
                yield f".{name}"
            case ast.Constant(value=value):
                yield (hex(value) if type(value) is int else repr(value))[:40]  # however long
            case _:
                yield type(node).__name__
        waiting += reversed([*ast.iter_child_nodes(node)])
