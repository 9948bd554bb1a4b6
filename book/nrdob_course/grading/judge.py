"""Give points to answers, in another process than the one that runs the student's code.

The hidden test of a problem is read, not run: ``score("2.1", turns, GROUP, points=3, seed=1)``. The
case is sent to the student's code, its answer comes back as plain data, and is judged here.
Whatever that code does to its own process, the graders in it included, the points stay out of
its reach; all that it can do is to answer.

It is asked twice, in two processes. `look` asks for the group's own case, and whatever comes back
can be shown. `judge` sends hidden cases, too, and gives points and sentences known beforehand.
"""

import ast
import json
import multiprocessing
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from .. import encoding
from ..encoding import LONGEST_TEXT, decode, packed
from ..exercises import Feedback, judge_all, judge_own
from . import sandbox

__all__ = ["Ask", "HiddenTest", "Stopped", "apart", "hidden_test", "judge", "look"]

Ask = Callable[[str], Any]
"""Runs an expression where the student's code runs, and gives back the text that it told."""


Found = TypeVar("Found")


class Stopped(BaseException):
    """An answer that never came; no grader may take it for one."""


@dataclass(frozen=True)
class HiddenTest:
    """What a hidden test asks."""

    problem: str
    answer: str
    group: str
    settings: dict[str, Any]


def hidden_test(source: str) -> HiddenTest | None:
    """Find the call of `score` in the source of a test cell; None if it is another kind of test.

    >>> hidden_test('score("2.1", turns, GROUP, points=3, seed=1)').answer
    'turns'
    >>> hidden_test("assert x == 1") is None
    True
    """
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "score":
            problem, answer, group = node.args
            settings = {str(word.arg): ast.literal_eval(word.value) for word in node.keywords}
            asked = ast.literal_eval(problem), ast.unparse(answer), ast.unparse(group)
            return HiddenTest(*asked, settings)
    return None


def look(test: HiddenTest, ask: Ask) -> tuple[Feedback, str]:
    """Judge an answer on the own case of the group that it was given for; give the group, too."""
    group = _value(ask(asking(test.group)))
    is_whole = isinstance(group, float) and group.is_integer()
    group = str(int(group) if is_whole else group)[:50]
    return judge_own(test.problem, _answer(test, ask), group), group


def judge(test: HiddenTest, own: Feedback, group: str, ask: Ask) -> Feedback:
    """Judge an answer on the hidden cases, too, after a `look` at it."""
    return judge_all(test.problem, _answer(test, ask), group, test.settings["seed"], own)


def _answer(test: HiddenTest, ask: Ask) -> Any:
    told = json.loads(ask(asking(test.answer)))
    # A function of the student's is called where it is.
    return partial(_called, ask, test.answer) if "function" in told else decode(told["value"])


def apart(work: Callable[[Ask], Found], ask: Ask, seconds: float) -> Found:
    """Judge in a process of its own, which may take so long and not more memory than it needs.

    Where no process can be copied, on Windows, it is done in this one, without these limits. Else
    TimeoutError says that it took longer, MemoryError that the process ended without a verdict.
    """
    if not hasattr(os, "fork"):
        return work(ask)
    end = time.monotonic() + seconds
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    process = context.Process(target=_work_there, args=(work, there), daemon=True)
    process.start()
    there.close()
    try:
        while here.poll(max(0.0, end - time.monotonic())):
            kind, what = here.recv()
            if kind == "ask":
                here.send(ask(what))
            elif kind == "error":
                raise what
            else:
                found: Found = what
                return found
        raise TimeoutError
    except EOFError:
        raise MemoryError("judging it takes too much memory") from None
    finally:
        process.kill()
        process.join()
        here.close()


def _work_there(work: Callable[[Ask], Any], pipe: Connection) -> None:
    """Judge what the other end of the pipe asks the student's code for."""
    sandbox.limit()

    def ask(source: str) -> Any:
        pipe.send(("ask", source))
        return pipe.recv()

    try:
        pipe.send(("found", work(ask)))
    except Exception as error:  # whatever was sent in the place of an answer
        pipe.send(("error", ValueError(f"{type(error).__name__}: {error}"[:300])))


def asking(expression: str, case: str = "") -> str:
    """Write what the student's process is to run."""
    tell = f"__import__({encoding.__name__!r}, fromlist=['tell']).tell"
    return f"{tell}({expression}, {case!r})"


def _called(ask: Ask, expression: str, case: Any) -> Any:
    return _value(ask(asking(expression, packed(case))))


def _value(text: str) -> Any:
    told = json.loads(text)
    if "error" not in told:
        return decode(told["value"])
    name, words = (str(part)[:LONGEST_TEXT] for part in told["error"])
    if name == "NotImplementedError":
        raise NotImplementedError
    raise type(name if name.isidentifier() else "Error", (Exception,), {})(words)
