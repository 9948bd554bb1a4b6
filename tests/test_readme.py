"""The README's code prints what the README prints, and its commands run."""

import ast
import re
import shlex
import subprocess
import sys
from contextlib import nullcontext
from inspect import signature
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest

from nrdob.reporting import main

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
COMMANDS = [
    line.partition(" #")[0].strip()
    for language, block in BLOCKS
    for line in block.splitlines()
    if not language
]
INLINE = re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```$", "", TEXT, flags=re.DOTALL | re.MULTILINE))
SAID = [each for each in INLINE if re.match(r"(nrdob|loop)\.\w", each)]
CALLS = [each for each in SAID if "(" in each and "…" not in each]
VARIABLES = set(re.findall(r"\$\((\w+)\)", (ROOT / "Makefile").read_text(encoding="utf-8")))
LONG = "compare", "largest_sampling_time"


@pytest.fixture(scope="module")
def names():
    """Give the names of the README's example, and those that its table has besides."""
    found = {}
    exec(next(text for language, text in BLOCKS if language == "python"), found)
    return found | {"order": 2, "dt": 0.01, "L": found["loop"].L}


@pytest.mark.parametrize("said", SAID)
def test_what_it_names_exists_and_takes_these_arguments(said, names):
    for node in ast.walk(ast.parse(said.replace("…", "..."), mode="eval")):
        called = node.func if isinstance(node, ast.Call) else node
        place, _, path = ast.unparse(called).partition(".")
        if isinstance(called, ast.Attribute) and place in ("nrdob", "loop") and "(" not in path:
            found = attrgetter(path)(names[place])
            if isinstance(node, ast.Call):
                signature(found).bind_partial(**{each.arg: None for each in node.keywords})


@pytest.mark.parametrize(
    "call",
    [
        pytest.param(each, marks=[pytest.mark.slow] * any(name in each for name in LONG))
        for each in CALLS
    ],
)
def test_a_call_of_its_table_answers_for_its_example(call, names, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refuses = f"`{call}`, which refuses where every fast filter does, as here" in TEXT
    with pytest.raises(ValueError, match="however fast") if refuses else nullcontext():
        eval(call, names)


@pytest.mark.slow
def test_the_code_prints_what_stands_below_it():
    code, printed = (text for language, text in BLOCKS if language)
    command = [sys.executable, "-W", "error::UserWarning", "-c", code]
    run = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert run.stdout.splitlines() == printed.splitlines(), run.stderr


@pytest.mark.thorough
@pytest.mark.parametrize("command", [each for each in COMMANDS if each.startswith("nrdob ")])
def test_a_command_of_the_package_writes_its_report(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    named = dict(pair.split("=") for pair in re.findall(r"\b([tuy]=\w+)", command))
    t = 0.2 * np.arange(150)
    y = np.where(t > 1, 1 - np.exp(-np.maximum(t - 1.4, 0) / 3), 0)
    y += 1e-3 * np.random.default_rng(1).standard_normal(t.size)
    heading = ",".join(named.get(name, name) for name in "tuy")
    table = np.transpose([t, t > 1, y])
    np.savetxt("data.csv", table, delimiter=",", header=heading, comments="")
    assert main(shlex.split(command)[1:]) in (0, 3)
    assert "<svg" in Path("report.html").read_text(encoding="utf-8")


@pytest.mark.skipif(sys.platform == "win32", reason="make is for Linux and macOS")
def test_every_other_command_is_make_or_pip():
    others = [shlex.split(each) for each in COMMANDS if not each.startswith("nrdob ")]
    assert ["make", "book"] in others and ["pip", "install", "."] in others
    for command in others:
        if command[0] == "make":
            given = {each.partition("=")[0] for each in command if "=" in each}
            assert given <= VARIABLES
            subprocess.run([*command, "--dry-run"], cwd=ROOT, capture_output=True, check=True)
        else:
            assert command == ["pip", "install", "."]


def test_it_can_be_read_in_two_minutes():
    assert len(TEXT.splitlines()) <= 110
