"""The README's code prints what the README prints, and its commands run."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from nrdob.reporting import main as nrdob

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
COMMANDS = [
    line.partition(" #")[0].strip()
    for language, block in BLOCKS
    for line in block.splitlines()
    if not language
]


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
    assert nrdob(shlex.split(command)[1:]) in (0, 3)
    assert "<svg" in Path("report.html").read_text(encoding="utf-8")


@pytest.mark.skipif(sys.platform == "win32", reason="make is for Linux and macOS")
def test_every_other_command_is_make_or_pip():
    others = [shlex.split(each) for each in COMMANDS if not each.startswith("nrdob ")]
    assert ["make", "book"] in others and ["pip", "install", "."] in others
    for command in others:
        if command[0] == "make":
            subprocess.run([*command, "--dry-run"], cwd=ROOT, capture_output=True, check=True)
        else:
            assert command == ["pip", "install", "."]


def test_it_can_be_read_in_two_minutes():
    assert len(TEXT.splitlines()) <= 110
