"""The kernel in which a student's code runs, in a sandbox.

    python -P -m nrdob_course.grading.kernel CONNECTION WORKDIR

CONNECTION is Jupyter's file of ports; WORKDIR the only folder that the code can write. What every
notebook imports is imported before the sandbox is built and the clock runs. In the place of the
graders stands what was handed out, see `handout`, in a file that is gone when the code begins.
Without arguments it starts kernels as copies of itself: an order has the arguments of a kernel and
its environment, the answer is the process.
"""

import base64
import builtins
import json
import os
import pickle
import signal
import sys
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

from ipykernel.kernelapp import IPKernelApp
from IPython.core.compilerop import CachingCompiler
from matplotlib.mathtext import MathTextParser

import nrdob.plotting  # noqa: F401

from ..encoding import HANDOUT
from . import sandbox
from .children import serve

__all__ = ["AnotherGroupError", "Graders", "Note", "leave", "main"]

COURSE = __package__.rpartition(".")[0]


def leave(*code: Any) -> None:
    """End a cell: IPython's own would end the kernel a moment later, and nobody knew why."""
    raise SystemExit(*code)


class Note(str):
    """What `check` gives while the notebook is graded: it has what `Feedback` has."""

    share, recognised, notes = 0.0, "", ()
    text = property(str.__str__)
    __repr__ = str.__str__


class AnotherGroupError(LookupError):
    """The cases of another group are wanted; the grader sends them, and runs the cell again."""


class Graders(MetaPathFinder, Loader):
    """Finds in the place of the graders what was handed out."""

    def __init__(self, handout: dict[str, Any]) -> None:
        self.package, self.sources = handout["package"], handout["sources"]
        self.tools, self.note = handout["tools"], Note(handout["note"])
        self.cases: dict[tuple[str, str], str] = {}
        self.add(handout["group"], handout["cases"])

    def add(self, group: Any, cases: dict[str, str]) -> None:
        """Take the cases of a group, by problem."""
        self.cases |= {(problem, str(group)): case for problem, case in cases.items()}

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """Find what was handed out, and nothing else of the course."""
        if name == self.package or (name.rpartition(".")[0] == self.package and self.of(name)):
            return spec_from_loader(name, self, is_package=name == self.package)
        if name.startswith(f"{COURSE}.") and name not in sys.modules:
            raise ModuleNotFoundError(f"{name} is not there while the notebook is graded")
        return None

    def of(self, name: str) -> str:
        """Give the source of a module; empty if there is none."""
        return str(self.sources.get(name.rpartition(".")[2], ""))

    def exec_module(self, module: ModuleType) -> None:
        """Fill a module."""
        if module.__name__ != self.package:
            exec(compile(self.of(module.__name__), f"<{module.__name__}>", "exec"), vars(module))
            return
        vars(module).update(own_case=self.own_case, add=self.add)
        vars(module)["check"] = lambda *any, **more: self.note
        for beside, name in self.tools:
            vars(module)[name] = getattr(import_module(f"{self.package}.{beside}"), name)

    def own_case(self, id: str, group: Any) -> Any:
        """Give the case of a group."""
        if isinstance(group, float) and group.is_integer():
            group = int(group)
        if (id, str(group)) not in self.cases:
            raise AnotherGroupError(str(group))
        return pickle.loads(base64.b64decode(self.cases[id, str(group)]))


def main(arguments: list[str]) -> None:
    """Build the sandbox, then be a kernel like any other."""
    connection, workdir = Path(arguments[0]), Path(arguments[1])
    os.chdir(workdir)
    ports = json.loads(connection.read_text("utf-8"))
    handout = json.loads((workdir / HANDOUT).read_text("utf-8"))
    (workdir / HANDOUT).unlink()
    sandbox.limit()
    sandbox.build(workdir, [port for name, port in ports.items() if name.endswith("_port")])
    sys.meta_path.insert(0, Graders(handout))
    builtins.exit = builtins.quit = leave  # type: ignore[assignment]
    sys.modules["debugpy"] = None  # type: ignore[assignment]  # nobody steps through the cells
    app: Any = IPKernelApp.instance()
    app.initialize(["-f", str(connection), "--HistoryManager.enabled=False", "--log-level=ERROR"])
    app.shell.user_ns.update(exit=leave, quit=leave)
    # The kernel's own compiler reads each letter of a cell to name it.
    app.shell.compile = CachingCompiler()  # type: ignore[no-untyped-call]
    sandbox.seal()
    app.start()


def started(order: dict[str, Any]) -> int:
    """Start a kernel, which leaves all that is the server's, its pipes above all; its process."""
    if child := os.fork():
        return child
    try:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        os.setsid()
        for number in (0, 1, 2):
            os.dup2(os.open(os.devnull, os.O_RDWR), number)
        os.closerange(3, 1024)
        os.environ.clear()
        os.environ.update(order["environment"])
        main(order["start"])
    finally:
        os._exit(0)  # nobody asks how it ended


if __name__ == "__main__":
    if sys.argv[1:]:
        main(sys.argv[1:])
    else:
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody asks for the exit codes of kernels
        MathTextParser("agg").parse("$x$")  # the first formula makes the grammar of all
        serve(started)
