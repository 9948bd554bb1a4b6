"""What the wheel can do with its declared dependencies alone."""

import operator
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.thorough
def test_every_name_plot_and_report_needs_only_what_is_declared(tmp_path):
    # What the wheel consists of, away from the source and from what stands beside it.
    shutil.copytree(ROOT / "nrdob", tmp_path / "wheel" / "nrdob")
    done = subprocess.run(
        [sys.executable, "-I", ROOT / "tests" / "plain.py", tmp_path / "wheel"],
        cwd=tmp_path, capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    counts = [int(part.split()[0]) for part in done.stdout.splitlines()[-1].split(", ")]
    assert all(map(operator.gt, counts, (300, 7, 10)))
