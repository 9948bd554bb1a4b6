"""Answers cross from one process to another as plain data, and are judged as they would be here."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
import time
import traceback
from collections import ChainMap, UserDict
from collections.abc import Iterator
from dataclasses import fields
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import control as ct
import IPython.display
import mpmath
import nbformat
import numpy as np
import pytest
import sympy
from nbgrader.preprocessors import Execute
from scipy import signal

import nrdob
from nrdob import LowPassFilter
from nrdob_course import encoding
from nrdob_course.encoding import decode, encode
from nrdob_course.exercises import PROBLEMS, Feedback, check, score
from nrdob_course.grading import autograde
from nrdob_course.grading.autograde import PatientExecute, failure
from nrdob_course.grading.handout import handout
from nrdob_course.grading.judge import HiddenTest, apart, asking, hidden_test, judge, look
from nrdob_course.grading.kernel import AnotherGroupError, Graders, Note
from problemsets import SETS, SOURCE, posed, published, run

s = ct.tf("s")


# --- plain data ---------------------------------------------------------------------------------


def there_and_back(value: Any) -> Any:
    return decode(json.loads(json.dumps(encode(value))))


@pytest.mark.parametrize(
    "value",
    [
        None,
        ...,
        True,
        7,
        0.1,
        1e300,
        float("inf"),
        2 - 3j,
        "stable",
        (1, [2.0, (3j, None)]),
        {"N": 1, "all": [True]},
        [],
        np.float64(0.1),
        np.int64(7),
        np.bool_(True),
    ],
)
def test_values_come_back_as_they_were(value: Any) -> None:
    assert there_and_back(value) == value


@pytest.mark.parametrize(
    "value", [np.arange(6.0).reshape(2, 3), np.array([1j, 2]), np.array([True]), np.array(3)]
)
def test_arrays_come_back_as_they_were(value: Any) -> None:
    back = there_and_back(value)
    assert back.shape == value.shape and back.dtype.kind == value.dtype.kind
    assert np.array_equal(back, value)


@pytest.mark.parametrize(
    "block",
    [
        (s + 2) / (s**2 + 3 * s + 5),
        ct.ss([[-1.0]], [[1.0]], [[2.0]], [[0.0]]),
        nrdob.delay(0.5) / (s + 1),
        LowPassFilter(0.25, 3),
        np.polynomial.Polynomial([1, 2, 3]),
        np.poly1d([1, 2, 3]),
    ],
)
def test_blocks_come_back_as_they_were(block: Any) -> None:
    back = there_and_back(block)
    assert type(back) is type(block)
    if isinstance(block, LowPassFilter):
        assert back == block
    else:
        assert np.isclose(complex(np.squeeze(back(1 + 2j))), complex(np.squeeze(block(1 + 2j))))


def test_a_loop_comes_back_as_its_four_blocks_and_is_judged_anew() -> None:
    loop = nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), 2.0, LowPassFilter(0.5, 1))
    loop.__dict__["stability"] = lambda: "stable, believe me"
    back = there_and_back(loop)
    assert "stability" not in vars(back)
    assert back.stability().stable
    assert back.filter == loop.filter and back.controller == 2.0


@pytest.mark.parametrize(
    ("value", "same"),
    [
        (sympy.Rational(1, 4), 0.25),
        (range(3), [0, 1, 2]),
        (np.str_("a"), "a"),
        (map(float, "12"), [1.0, 2.0]),
        ({"gain": 1, "lag": 2}.values(), [1, 2]),
        (zip("ab", (1, 2), strict=True), [("a", 1), ("b", 2)]),
        (sympy.sqrt(4), 2),
        (sympy.sqrt(2), 2**0.5),
        (sympy.sqrt(2) + sympy.Float(1e-20) * sympy.I, 2**0.5 + 1e-20j),
        (sympy.Matrix([[2]]), [[2]]),
        (mpmath.mpc(2, 3), 2 + 3j),
        (np.longdouble(2), 2),
        (np.clongdouble(2j), 2j),
        (np.array(sympy.Integer(2), dtype=object), 2),
        (UserDict(N=1), {"N": 1}),
        (ChainMap({"N": 1}, {"P": np.longdouble(2)}), {"N": 1, "P": 2}),
        (MappingProxyType({"N": 1}), {"N": 1}),
    ],
)
def test_numbers_and_lists_of_other_kinds_are_read(value: Any, same: Any) -> None:
    assert there_and_back(value) == same


@pytest.mark.parametrize(
    ("value", "shape"),
    [
        (np.ones((1, 2)).view(np.matrix), (1, 2)),
        (np.full((1, 1, 1), 3.0), ()),
        ((1 / (s + 2)).horner(0), ()),
    ],
)
def test_what_has_more_axes_than_numbers_is_read(value: Any, shape: tuple[int, ...]) -> None:
    back = there_and_back(value)
    assert type(back) is np.ndarray and back.shape == shape
    assert np.array_equal(np.ravel(back), np.ravel(np.asarray(value)))


@pytest.mark.parametrize(
    "block",
    [
        signal.lti([2.0], [1.0, 3.0]),
        signal.TransferFunction([2.0], [1.0, 3.0]),
        signal.ZerosPolesGain([], [-3.0], 2.0),
        signal.StateSpace([[-3.0]], [[1.0]], [[2.0]], [[0.0]]),
    ],
)
def test_blocks_of_scipy_are_read_alone_and_in_a_loop(block: Any) -> None:
    loop = there_and_back(nrdob.NRDOB(block, block, 1.0, LowPassFilter(0.5, 1)))
    for back in (there_and_back(block), loop.process, loop.model):
        assert isinstance(back, ct.TransferFunction)
        assert np.isclose(back(1j), 2 / (3 + 1j))


@pytest.mark.parametrize("value", [object(), {1}, lambda: 1, np.array([object()])[0], b"x"])
def test_what_is_no_answer_comes_as_its_name(value: Any) -> None:
    assert type(there_and_back(value)).__name__ == type(value).__name__


@pytest.mark.parametrize(
    "data",
    [[1], {}, {"tf": 3}, {"run": ["rm"]}, {"loop": [1]}, {"filter": [-1, 2]}, {"dict": [[1]]}],
)
def test_what_was_written_by_something_else_is_refused(data: Any) -> None:
    with pytest.raises((ValueError, TypeError)):
        decode(data)


def filled(kind: str, count: int) -> Any:
    ones = {"array": [1.0] * count, "shape": [count]}
    return {
        "list": {"list": [1.0] * count},
        "tf": {"tf": [ones, {"array": [1.0], "shape": [1]}, None]},
        "ss": {"ss": [{"array": [0.0] * count**2, "shape": [count, count]}] * 4},
        "polynomial": {"polynomial": [ones, ones, ones]},
        "filter": {"filter": [1.0, count]},
        "empty": {"array": [], "shape": [0, count]},
    }[kind]


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["list", "tf", "ss", "polynomial", "filter", "empty"])
def test_what_is_too_large_is_refused_before_anything_is_computed(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    built: list[Any] = []
    for name in encoding.BUILD.keys() - {"filter"}:
        monkeypatch.setitem(encoding.BUILD, name, built.append)
    monkeypatch.setattr(encoding, "LowPassFilter", built.append)
    with pytest.raises(ValueError, match="at most"):
        decode(filled(kind, 9000 if kind != "ss" else 51))
    assert [each for each in built if np.size(each) > encoding.MOST] == []


@pytest.mark.parametrize("kind", ["list", "tf", "filter"])
def test_what_has_fifty_coefficients_is_read(kind: str) -> None:
    assert decode(filled(kind, encoding.MOST)) is not None


def test_many_small_parts_are_too_large_too() -> None:
    loop = {"loop": [1, 1, 1, {"filter": [1.0, 2]}]}
    with pytest.raises(ValueError, match="parts; at most"):
        decode({"list": [{"list": [loop] * 40}] * 40})


# --- judging ------------------------------------------------------------------------------------


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Stands for the process of the student's code; makes the way to ask there."""
    published: list[dict[str, str]] = []
    monkeypatch.setattr(IPython.display, "publish_display_data", published.append)

    def asks(space: dict[str, Any]) -> Any:
        def ask(source: str) -> str:
            eval(source, space)
            return published.pop()[encoding.MIME]

        return ask

    return asks


TEST = HiddenTest("2.1", "encirclements", "GROUP", {"points": 3, "seed": 1})


def judged(test: HiddenTest | None, ask: Any) -> tuple[Feedback, Any]:
    """Judge an answer as it is graded, only that both kernels are the same."""
    assert test is not None
    own, group = look(test, ask)
    return judge(test, own, group, ask), group


def test_every_hidden_test_is_read() -> None:
    for path in SETS:
        for this in posed(path):
            found = hidden_test(this.cell.source)
            assert found is not None
            assert (found.problem, found.answer, found.group) == (this.id, this.answer, "GROUP")
            assert found.settings == {"points": this.points, "seed": this.seed}


@pytest.mark.thorough
@pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
def test_judged_apart_is_judged_alike(path: Path, kernel: Any) -> None:
    space = {**run(path, 5), "GROUP": 5}
    for this in posed(path):
        found, group = judged(hidden_test(this.cell.source), kernel(space))
        assert (found.share, group) == (1, "5"), this.id


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("def encirclements(case):\n    return case.nothing", "AttributeError"),
        ("def encirclements(case):\n    return 1 / 0", "In the line: return 1 / 0"),
        ("def encirclements(case):\n    raise SystemExit(3)", "SystemExit"),
        ("def encirclements(case):\n    raise NotImplementedError", "Nothing to check yet"),
        ("def encirclements(case):\n    return None", "returns nothing"),
        ("def encirclements(case):\n    x = []\n    x.append(x)\n    return x", "fails"),
        ("def encirclements(case):\n    return 'x' * 3_000_000", "an answer of 3000"),
        ("def encirclements(case):\n    return lambda: 1", "fails"),
        ("encirclements = 3", "must be a function"),
        ("encirclements = ...", "Nothing to check yet"),
    ],
)
def test_what_goes_wrong_is_told_as_the_check_tells_it(
    source: str, says: str, kernel: Any, tmp_path: Path
) -> None:
    file = tmp_path / "cell.py"
    file.write_text(source, "utf-8")
    space: dict[str, Any] = {"GROUP": 3}
    exec(compile(source, str(file), "exec"), space)
    found, _ = judged(TEST, kernel(space))
    assert found.share == 0
    assert says in found.text
    assert "raise type" not in found.text


@pytest.mark.parametrize(
    ("dress", "share"),
    [
        (np.longdouble, 1),
        (lambda turns: np.full((1, 1, 1), turns), 1),
        (lambda turns: np.array(sympy.Integer(turns), dtype=object), 1),
        (lambda turns: {turns}, 0),
        (lambda turns: str(turns).encode(), 0),
        (lambda turns: [[turns] * (encoding.MOST + 1)], 0),
    ],
)
def test_the_check_says_right_where_the_grading_does(dress: Any, share: int, kernel: Any) -> None:
    right = published(posed(SOURCE / "set2" / "set2.ipynb")[0], 5)

    def encirclements(case: Any) -> Any:
        return dress(right(case))

    found, _ = judged(TEST, kernel({"encirclements": encirclements, "GROUP": 5}))
    assert (check("2.1", encirclements, 5).share, found.share) == (share, share), found.text


def test_a_tampered_grader_gives_no_points(kernel: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    # The graders in the student's process are another process's; whatever they say is not asked.
    asked: list[str] = []

    def ask(source: str) -> str:
        asked.append(source)
        value = {"value": 5, "share": 1, "points": 3}
        return json.dumps({"function": True} if source == asking("encirclements") else value)

    assert judged(TEST, ask)[0].share == 0
    assert all("score" not in source and "seed" not in source for source in asked)


def test_a_tampered_error_is_cut() -> None:
    def ask(source: str) -> str:
        told = {asking("GROUP"): {"value": 5}, asking("encirclements"): {"function": True}}
        return json.dumps(told.get(source, {"error": ["A" * 10**6, "B" * 10**6]}))

    assert len(judged(TEST, ask)[0].text) < 3000


def test_neither_seed_nor_key_is_sent() -> None:
    assert asking("encirclements").endswith(".tell(encirclements, '')")
    for path in sorted(SOURCE.glob("*/*.ipynb")):
        for this in posed(path):
            case = encoding.packed(PROBLEMS[this.id].cases(this.seed, 1)[0])
            assert str(this.seed) not in case


def test_the_points_are_those_of_score(kernel: Any) -> None:
    def encirclements(case: Any) -> Any:
        return -PROBLEMS["2.1"].misconceptions[0].example(case)

    found, group = judged(TEST, kernel({"encirclements": encirclements, "GROUP": "7"}))
    assert found == score("2.1", encirclements, "7", points=3, seed=1).feedback
    assert group == "7"


def test_another_kind_of_test_is_left_to_nbgrader() -> None:
    assert hidden_test("assert encirclements is not None") is None


# --- in a process of its own ---------------------------------------------------------------------

forks = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a process that can be copied")


def test_judged_in_a_process_of_its_own_it_is_judged_alike(kernel: Any) -> None:
    ask = kernel({"GROUP": 5, "encirclements": PROBLEMS["2.1"].misconceptions[0].example})
    assert apart(partial(look, TEST), ask, 60) == look(TEST, ask)


@forks
def test_a_verdict_that_takes_too_long_is_given_up() -> None:
    with pytest.raises(TimeoutError):
        apart(lambda ask: time.sleep(600), str, 0.5)


@forks
def test_a_verdict_that_takes_too_much_memory_is_given_up() -> None:
    with pytest.raises(ValueError, match="MemoryError"):
        apart(lambda ask: [bytes(400 << 20) for _ in range(5)], str, 60)


@forks
def test_a_process_that_ends_without_a_verdict_gives_none() -> None:
    with pytest.raises(MemoryError):
        apart(lambda ask: os._exit(1), str, 60)


@pytest.mark.parametrize(
    ("value", "group"), [(5, "5"), (5.0, "5"), ("5", "5"), (5.5, "5.5"), ("5" * 10**6, "5" * 50)]
)
def test_a_group_is_a_short_text(value: Any, group: str) -> None:
    assert look(TEST, lambda source: json.dumps({"value": value}))[1] == group


# --- what is handed out --------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
def test_no_answer_is_handed_out(path: Path) -> None:
    given = handout([this.id for this in posed(path)], 5)
    names = {name for source in given["sources"].values() for name in vars_of(source)}
    assert names.isdisjoint({"PROBLEMS", "Misconception", "settled_table", "_p_B", "_good"})
    assert not any(name.startswith("_not_") or name.endswith("_case") for name in names)


def vars_of(source: str) -> set[str]:
    return {node.name for node in ast.walk(ast.parse(source)) if hasattr(node, "name")}


@pytest.fixture(scope="module")
def found_there() -> dict[str, dict[str, str]]:
    """The cases that a process finds to which each of the sets is handed out, one after another."""
    given = {path.stem: handout([this.id for this in posed(path)], 5) for path in SETS}
    program = """
import json, sys
from nrdob_course.grading.kernel import Graders
found = {}
for name, given in json.load(sys.stdin).items():
    graders = Graders(given)
    sys.meta_path.insert(0, graders)
    from nrdob_course.exercises import check, own_case
    found[name] = {problem: repr(own_case(problem, 5)) for problem in given["cases"]}
    sys.meta_path.remove(graders)
    for module in [each for each in sys.modules if each.startswith("nrdob_course.exercises")]:
        del sys.modules[module]
print(json.dumps(found))
"""
    command, told = [sys.executable, "-c", program], json.dumps(given)
    done = subprocess.run(command, input=told, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


@pytest.mark.thorough
@pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
def test_the_cases_that_are_handed_out_are_those_of_the_graders(
    path: Path, found_there: dict[str, dict[str, str]]
) -> None:
    found = found_there[path.stem]
    assert found == {name: repr(PROBLEMS[name].cases(5, 1)[0]) for name in found}
    assert len(found) == len(posed(path))


# --- a kernel that does not start ---------------------------------------------------------------


@pytest.mark.parametrize(("failing", "starts"), [(2, 3), (3, 3)])
def test_a_kernel_whose_ports_were_taken_is_started_again(
    failing: int, starts: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[int] = []

    def preprocess(self: Any, nb: Any, resources: Any, km: Any) -> tuple[Any, Any]:
        tried.append(1)
        if len(tried) <= failing:
            raise RuntimeError("Kernel died before replying to kernel_info")
        return nb, resources

    monkeypatch.setattr(Execute, "preprocess", preprocess)
    notebook, resources = nbformat.v4.new_notebook(), {"metadata": {"path": str(tmp_path)}}
    if failing < starts:
        assert PatientExecute().preprocess(notebook, resources)[0] == notebook
    else:
        with pytest.raises(RuntimeError, match="Kernel died"):
            PatientExecute().preprocess(notebook, resources)
    assert len(tried) == starts


def test_the_clock_is_as_patient_with_the_cell_of_an_answer_as_with_its_function(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    allowed: list[tuple[float, str]] = []

    def execute(self: Any, cell: Any, resources: Any, index: int) -> None:
        allowed.append((self.timeout, self.error_on_timeout["evalue"]))

    monkeypatch.setattr(Execute, "preprocess_cell", execute)
    runs = PatientExecute(timeout=5)
    runs.nb = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell()])
    runs.run_cell(runs.nb.cells[0], {}, 0)
    assert allowed == [(8, "took longer than the 5 s that the set allows")]
    assert runs.timeout == 5


@pytest.fixture
def runner(monkeypatch: pytest.MonkeyPatch) -> PatientExecute:
    """Runs cells in this process, where they find what was handed out for problem 2.1."""
    runs, graders = PatientExecute(), Graders(handout(["2.1"], 5))
    runs.problems, runs.groups, runs.left_out = ["2.1"], [5], {}
    runs.nb = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell()])

    def execute(self: Any, cell: Any, resources: Any, index: int) -> None:
        cell.outputs = []
        try:
            exec(cell.source, {"own_case": graders.own_case})
        except AnotherGroupError as error:
            cell.outputs = [failure(type(error).__name__, str(error))]

    def execute_ours(self: Any, cell: Any, index: int) -> None:
        eval(cell.source.partition(").")[2], {"add": graders.add})

    monkeypatch.setattr(Execute, "preprocess_cell", execute)
    monkeypatch.setattr(Execute, "execute_cell", execute_ours)
    monkeypatch.setattr(autograde, "REMARKS", [])
    return runs


@pytest.mark.parametrize(("groups", "said"), [(6, ""), (9, ""), (10, "asks for more groups")])
def test_an_answer_may_be_tried_on_the_cases_of_other_groups(
    groups: int, said: str, runner: PatientExecute
) -> None:
    source = f"[own_case('2.1', group) for group in range(60, {60 + groups})]"
    cell = nbformat.v4.new_code_cell(source, id="answer-2-1")
    runner.preprocess_cell(cell, {}, 0)
    assert [out.evalue for out in cell.outputs if said not in out.evalue] == []
    assert len(cell.outputs) == len(autograde.REMARKS) == bool(said)
    assert all(remark.startswith(f"answer-2-1 {said}") for remark in autograde.REMARKS)


def test_what_the_check_gives_while_it_is_graded_can_be_asked_like_feedback() -> None:
    note = Note("not now")
    for field in fields(Feedback):
        assert type(getattr(note, field.name)) is type(getattr(Feedback(0.0, "x"), field.name))
    assert (note.text, repr(note)) == ("not now", "not now")


def test_what_breaks_one_kernel_after_the_other_has_no_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def preprocess(self: Any, nb: Any, resources: Any, km: Any) -> tuple[Any, Any]:
        self.at = len(self.left_out)
        raise ValueError("Invalid Signature: words of the kernel")

    monkeypatch.setattr(Execute, "preprocess", preprocess)
    cells = [nbformat.v4.new_code_cell() for _ in range(12)]
    notebook, resources = nbformat.v4.new_notebook(cells=cells), {"metadata": {"path": tmp_path}}
    with pytest.raises(RuntimeError, match="more than 10 cells") as found:
        PatientExecute().preprocess(notebook, resources)
    assert "Signature" not in "".join(traceback.format_exception(found.value))


def test_what_no_file_takes_does_not_stop_the_grading(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def preprocess(self: Any, nb: Any, resources: Any, km: Any) -> tuple[Any, Any]:
        nb.cells[0].outputs = [nbformat.v4.new_output("stream", text="half a smiley: \ud83d")]
        return nb, resources

    monkeypatch.setattr(Execute, "preprocess", preprocess)
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell()])
    marked, _ = PatientExecute().preprocess(notebook, {"metadata": {"path": tmp_path}})
    nbformat.write(marked, tmp_path / "marked.ipynb")
    assert "half a smiley: ?" in (tmp_path / "marked.ipynb").read_text("utf-8")
