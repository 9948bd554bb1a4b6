"""What is measured in processes of its own: the import, and the notebooks."""

import os
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

import pytest

ROOT = Path(__file__).resolve().parents[2]
IMPORTS = 15


# Where no bytecode is written our modules would be compiled every time, installed ones not.
ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}


def seconds(*arguments):
    command = [sys.executable, *arguments]
    start = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, cwd=ROOT, env=ENVIRONMENT)
    return time.perf_counter() - start


def test_import(request, measured):
    rounds = 1 if request.config.getoption("benchmark_disable") else IMPORTS
    # By turns, so that a slow moment of the machine meets both.
    times = {"nrdob": [], "control": []}
    for _ in range(rounds):
        for name, found in times.items():
            found.append(seconds("-c", f"import {name}"))
    for name, found in times.items():
        measured("import, whole process", name, median(found))


def test_notebooks(request, note, tmp_path):
    if request.config.getoption("benchmark_disable"):
        pytest.skip("takes minutes")
    if not list((ROOT / "notebooks").glob("*.ipynb")):
        pytest.skip("no notebooks")
    start = time.perf_counter()
    runner = [sys.executable, "book/make/notebooks.py", "--output", str(tmp_path), "--report"]
    done = subprocess.run(runner, capture_output=True, text=True, cwd=ROOT, check=False)
    note(f"notebooks, all in {time.perf_counter() - start:.0f} s (below 180 s)")
    note(done.stdout + done.stderr)
