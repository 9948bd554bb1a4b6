"""Can the tests fail? Faults put into the package, one at a time, and the tests that see that line.

A copy of the tree is made. There the fast tests run once under coverage, which tells for each line
the tests that execute it. Then mutants are drawn at random over all modules, as many of each kind:
a comparison, an arithmetic operator, a number, a boolean, a returned value or a condition is
changed in the syntax tree. The tests of its line run, those of its own subpackage and the quick
ones first, up to `BUDGET` seconds, and the doctests of its module; each mutant has a process of its
own, forked from one that has loaded the libraries, with a time limit and a limit of memory.

    python -m tests.campaigns.mutants --count 600 --seed 0 --kept build/mutants.json
    python -m tests.campaigns.mutants --count 100 --only certificates/checker.py --kept build/m.json
    python -m tests.campaigns.mutants --count 0 --kept build/mutants.json     the tally

A run that is interrupted goes on where it ended. What survives is read by a person: equivalent,
without consequence, or a gap.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from itertools import chain, islice, zip_longest
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
WHAT = ("nrdob", "tests", "book", "notebooks", "pyproject.toml", "README.md", "CONTRIBUTING.md")
FOLDERS = (
    "numerics", "diagram", "analysis", "certificates", "digital", "design", "measured",
    "uncertain", "alternatives", "drives", "plotting", "reporting",
)  # fmt: skip
AT_THE_TOP = ("bad_input", "paper", "plants", "reported_faults")
FAST = ("-p", "no:cacheprovider", "-m", "not thorough", "--hypothesis-profile=quick")

LIBRARIES = "control", "hypothesis", "matplotlib.pyplot", "mpmath", "scipy.linalg", "scipy.optimize"

BUDGET = 12.0
"""Seconds of tests for a mutant, as they took without it."""

THOROUGH = 60.0
"""The same with `--again`, for those that survived."""

LIMIT = 150.0
"""Seconds after which a mutant is said to run for ever."""

MEMORY = 4 << 30

SWAPS: dict[type[ast.AST], tuple[type[ast.AST], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.GtE),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.Add: (ast.Sub,),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div,),
    ast.Div: (ast.Mult,),
    ast.Pow: (ast.Mult,),
    ast.FloorDiv: (ast.Div,),
    ast.Mod: (ast.FloorDiv,),
    ast.BitAnd: (ast.BitOr,),
    ast.BitOr: (ast.BitAnd,),
    ast.And: (ast.Or,),
    ast.Or: (ast.And,),
}


class Mutant(NamedTuple):
    """A fault: module, line, place in the walk through its syntax tree, and what is changed."""

    path: str
    line: int
    place: int
    kind: str
    change: str


# Making them.


def changes(node: ast.AST) -> Iterator[tuple[str, str]]:
    """The kinds of fault that a node can have."""
    match node:
        case ast.Compare(ops=[op]):
            yield from (("comparison", each.__name__) for each in SWAPS[type(op)])
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in SWAPS:
            yield from (("arithmetic", each.__name__) for each in SWAPS[type(op)])
        case ast.BoolOp(op=op):
            yield "boolean", SWAPS[type(op)][0].__name__
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert()):
            yield "boolean" if isinstance(node.op, ast.Not) else "arithmetic", "left out"
        case ast.Constant(value=bool(value)):
            yield "boolean", str(not value)
        case ast.Constant(value=int(value) | float(value)):
            yield "constant", repr(value + 1)
            yield "constant", repr(value * 2 if value else -1)
        case ast.Return(value=ast.Constant(None)):
            pass
        case ast.Return(value=ast.expr()):
            yield "return", "None"
        case ast.If() | ast.IfExp():
            yield from (("condition", str(each)) for each in (True, False))
        case ast.comprehension(ifs=[_, *_]):
            yield "condition", "left out"


def changed(node: ast.AST, change: str) -> ast.AST:
    """The node with its fault."""
    match node:
        case ast.Compare():
            node.ops = [getattr(ast, change)()]
        case ast.BinOp() | ast.AugAssign() | ast.BoolOp():
            node.op = getattr(ast, change)()
        case ast.UnaryOp():
            return node.operand
        case ast.Constant():
            node.value = ast.literal_eval(change)
        case ast.Return():
            node.value = ast.Constant(None)
        case ast.If() | ast.IfExp():
            node.test = ast.Constant(change == "True")
        case ast.comprehension():
            node.ifs = []
    return node


def code(tree: ast.Module) -> Iterator[ast.AST]:
    """Nodes that decide what is computed: no annotations, messages, names that are shown."""
    todo: list[ast.AST] = [tree]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.Raise | ast.Import | ast.ImportFrom | ast.JoinedStr):
            continue
        if isinstance(node, ast.FunctionDef) and node.name in {"__dir__", "__repr__"}:
            continue
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            continue
        yield node
        for name, value in ast.iter_fields(node):
            if name in {"annotation", "returns", "decorator_list", "type_params"}:
                continue
            todo += [each for each in (value if isinstance(value, list) else [value])
                     if isinstance(each, ast.AST)]  # fmt: skip


def mutants(root: Path, only: str = "") -> list[Mutant]:
    """All of them, in the order of the files."""
    found = []
    for path in sorted((root / "nrdob").rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if only in name:
            for place, node in enumerate(code(ast.parse(path.read_text(encoding="utf-8")))):
                line = getattr(node, "lineno", getattr(getattr(node, "iter", None), "lineno", 0))
                found += [Mutant(name, line, place, *each) for each in changes(node)]
    return found


def picked(every: list[Mutant], count: int, seed: int) -> list[Mutant]:
    """Draw mutants, as many of each kind, whose turn comes one after the other."""
    rng = random.Random(seed)
    kinds = sorted({each.kind for each in every})
    orders = [[each for each in every if each.kind == kind] for kind in kinds]
    for order in orders:
        rng.shuffle(order)
    turns = chain.from_iterable(zip_longest(*orders))
    return list(islice((each for each in turns if each), count))


def source(text: str, mutant: Mutant) -> str:
    """The module with the fault."""
    tree = ast.parse(text)
    target = list(code(tree))[mutant.place]

    class Change(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> ast.AST:
            return changed(node, mutant.change) if node is target else self.generic_visit(node)

    return ast.unparse(ast.fix_missing_locations(Change().visit(tree)))


# Which tests see a line.


def copied(target: Path) -> Path:
    """A copy of the tree, in which the faults are made."""
    if not target.exists():
        skip = shutil.ignore_patterns("__pycache__", ".*", "build")
        for name in WHAT:
            target.mkdir(parents=True, exist_ok=True)
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, target / name, ignore=skip)
            else:
                shutil.copy2(ROOT / name, target / name)
    return target


def measure(tree: Path) -> None:
    """Run the fast tests once, and keep which lines each of them executes, and how long it took."""
    settings = tree / "coverage.rc"
    settings.write_text(
        f"[run]\nsource = nrdob\ndynamic_context = test_function\ndata_file = {tree}/coverage.db\n",
        encoding="utf-8",
    )
    tests = [f"tests/{name}" for name in FOLDERS]
    tests += [f"tests/test_{name}.py" for name in AT_THE_TOP]
    command = [sys.executable, "-m", "coverage", "run", f"--rcfile={settings}", "-m", "pytest"]
    command += ["-q", *FAST, f"--junitxml={tree}/times.xml", *tests]
    subprocess.run(command, cwd=tree, env=os.environ | {"PYTHONPATH": str(tree)}, check=True)


@cache
def seen(tree: Path) -> tuple[dict[tuple[str, int], set[str]], dict[str, float]]:
    """The tests of each line, as file::function, and the seconds that each takes."""
    from coverage import CoverageData

    seconds: dict[str, float] = defaultdict(float)
    for case in ElementTree.parse(tree / "times.xml").iter("testcase"):
        file = case.get("classname", "").replace(".", "/") + ".py"
        seconds[f"{file}::{case.get('name', '').partition('[')[0]}"] += float(case.get("time", 0))
    parts = {test: test.partition("::") for test in seconds}
    short = {(Path(file).stem, function): test for test, (file, _, function) in parts.items()}
    data = CoverageData(basename=str(tree / "coverage.db"))
    data.read()
    lines: dict[tuple[str, int], set[str]] = defaultdict(set)
    for path in data.measured_files():
        name = "nrdob/" + path.rpartition("/nrdob/")[2]
        for line, contexts in data.contexts_by_lineno(path).items():
            for context in contexts:
                module, _, function = context.rpartition(".")
                test = short.get((module.rpartition(".")[2], function))
                lines[name, line].add(test or "")
    return lines, seconds


def tests_of(mutant: Mutant, tree: Path, budget: float) -> list[str]:
    """Which tests to run, in this order."""
    lines, seconds = seen(tree)
    found = lines.get((mutant.path, mutant.line), set()) - {""}
    own = "/".join(["tests", *mutant.path.split("/")[1:-1]]) + "/"
    if not found:  # run when the module is loaded
        found = {test for test in seconds if test.startswith(own)}
    picked, spent = [], 0.0
    for test in sorted(found, key=lambda test: (not test.startswith(own), seconds[test], test)):
        spent += seconds[test]
        if picked and spent > budget:
            break
        picked.append(test)
    return picked


# Running them.


def judged(mutant: Mutant, tree: Path, budget: float = BUDGET) -> str:
    """What became of a mutant: killed, by time, or survived."""
    path = tree / mutant.path
    original = path.read_text(encoding="utf-8")
    path.write_text(source(original, mutant), encoding="utf-8")
    tests = tests_of(mutant, tree, budget)
    try:
        child = os.fork()
        if not child:
            _child(mutant.path, tests, tree)
        return _ended(child)
    finally:
        path.write_text(original, encoding="utf-8")


def _child(path: str, tests: list[str], tree: Path) -> None:
    status = 3
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        os.chdir(tree)
        os.environ["PYTHONPATH"] = str(tree)
        sys.path[:0] = [str(tree)]
        sys.dont_write_bytecode = True
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        status = int(pytest.main(["-x", "-q", *FAST, *tests])) if tests else 5
        if status in {0, 5}:
            status = int(pytest.main(["-x", "-q", *FAST, "--doctest-modules", path]))
    finally:
        os._exit(status)


def _ended(child: int) -> str:
    end = time.monotonic() + LIMIT
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return "survived" if os.waitstatus_to_exitcode(status) in {0, 5} else "killed"
        time.sleep(0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return "killed by time"


def tally(found: list[dict]) -> str:
    """A table: each subpackage with its mutants, and how many of them survived."""
    rows: dict[str, Counter[str]] = defaultdict(Counter)
    for each in found:
        parts = each["path"].split("/")
        for row in (parts[1] if len(parts) > 2 else "at the top", each["kind"], "all"):
            rows[row][each["end"].partition(" ")[0]] += 1
    lines = [f"{'':14}{'mutants':>8}{'killed':>8}{'survived':>10}"]
    for name, row in sorted(rows.items()):
        lines.append(f"{name:14}{row.total():8}{row['killed']:8}{row['survived']:10}")
    return "\n".join(lines)


def main() -> None:
    """Draw, run, keep."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="part of a path, as certificates/checker.py")
    parser.add_argument("--kept", type=Path, default=ROOT / "build" / "mutants.json")
    parser.add_argument("--tree", type=Path, default=ROOT / "build" / "mutants")
    parser.add_argument("--again", action="store_true", help="more tests for the survivors")
    given = parser.parse_args()
    kept = json.loads(given.kept.read_text("utf-8")) if given.kept.exists() else []
    if given.count or given.again:
        tree = copied(given.tree.resolve())
        if not (tree / "times.xml").exists():
            measure(tree)
        for name in LIBRARIES:  # once, for all children, and nothing of the package
            importlib.import_module(name)
        for each in kept if given.again else ():
            if each["end"] == "survived":
                mutant = Mutant(*(each[name] for name in Mutant._fields))
                if tests_of(mutant, tree, BUDGET) == tests_of(mutant, tree, THOROUGH):
                    continue
                each["end"] = judged(mutant, tree, THOROUGH)
                given.kept.write_text(json.dumps(kept, indent=0) + "\n", encoding="utf-8")
        every = mutants(tree, given.only)
        drawn = picked(every, given.count, given.seed)
        known = {tuple(each[name] for name in Mutant._fields) for each in kept}
        for mutant in drawn:
            if tuple(mutant) in known:
                continue
            kept.append(mutant._asdict() | {"end": judged(mutant, tree)})
            given.kept.parent.mkdir(parents=True, exist_ok=True)
            given.kept.write_text(json.dumps(kept, indent=0) + "\n", encoding="utf-8")
    print(tally(kept))
    for each in kept:
        if each["end"] == "survived":
            print("{path}:{line} {kind} {change}".format(**each))


if __name__ == "__main__":
    main()
