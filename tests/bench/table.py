"""One table of the public calls, in processor time: before and after a change.

Wall time would measure whoever else uses the machine; these are medians of `time.process_time`,
each call on a loop that remembers nothing. A figure is timed as far as the call goes, without
rendering it.

    python tests/bench/table.py                      print the table
    python tests/bench/table.py --save now.json      and keep the numbers
    python tests/bench/table.py --before then.json   two numbers in each place: before → after
"""

from __future__ import annotations

import argparse
import ctypes
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median

import control as ct
import cpuinfo
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

import nrdob
from nrdob import LowPassFilter, paper

ORDERS = (2, 6, 10)
DEAD_TIMES = (0, 0.2)
LATE = (1e2, 1e3, 1e4, 1e5)

ROUNDS = 7
ENOUGH = 5.0
"""Seconds after which a call is not repeated any more."""

Task = Callable[[], object]


def blocks(order: int, dead_time: float) -> tuple:
    """A plant of oscillating pairs, relative degree 2, a model 3 % beside it, and a filter."""
    poles = np.geomspace(0.4, 2.5, order // 2) * np.exp(0.75j * np.pi)
    zeros = -np.geomspace(0.5, 3, order - 2)

    def block(error: float) -> ct.TransferFunction:
        den = np.real(np.poly(np.append(poles, poles.conj()) * (1 + error)))
        num = np.atleast_1d(np.poly(zeros))
        return ct.tf(num / num[-1], den / den[-1])

    process = block(0.03)
    if dead_time:
        process = nrdob.delay(dead_time) * process
    return process, block(0), ct.tf([0.2, 0.1], [1, 0]), LowPassFilter(0.6, 2)


def judge_late(ratio: float, time_constant: float) -> None:
    """Judge a lag of 1 s behind a dead time of `ratio` seconds."""
    process = nrdob.delay(ratio) * ct.tf([1.02], [1, 1])
    F = LowPassFilter(time_constant, 1)
    verdict = nrdob.NRDOB(process, ct.tf([1], [0.9, 1]), 0.5, F).stability()
    if verdict.stable is None:
        raise ArithmeticError("no verdict")


def tasks() -> Iterator[tuple[str, str, Task]]:
    """Give the row, the column and the call of every entry of the table."""
    for order in ORDERS:
        for dead_time in DEAD_TIMES:
            given = blocks(order, dead_time)
            row = f"order {order}" + f", dead time {dead_time} s" * bool(dead_time)
            yield row, "stability", lambda g=given: nrdob.NRDOB(*g).stability()
            yield row, "margins", lambda g=given: nrdob.NRDOB(*g).margins()
            yield row, "sets", lambda g=given: nrdob.stabilizing_time_constants(g[0], g[1], 2)
            yield row, "step", lambda g=given: nrdob.NRDOB(*g).step_response("R")
            yield row, "Nyquist plot", lambda g=given: nrdob.NRDOB(*g).plot_nyquist()
            yield row, "step plot", lambda g=given: nrdob.NRDOB(*g).plot_step()

    hotend = ct.tf([337.6], [36.7, 1])
    example = paper.example(4)
    for row, wait in (("Example 4", 0.0), ("Example 4, waits 0.04 s", 0.04)):
        model = nrdob.delay(wait) * example.model
        given = example.process, model, example.controller, example.filter
        yield row, "stability", lambda g=given: nrdob.NRDOB(*g).stability()
        yield row, "margins", lambda g=given: nrdob.NRDOB(*g).margins()
        yield row, "sets", lambda g=given: nrdob.stabilizing_time_constants(g[0], g[1], 3)
        yield row, "step", lambda g=given: nrdob.NRDOB(*g).step_response("R")
    for row, process, model in (
        ("Example 4", example.process, example.model),
        ("hotend", nrdob.delay(0.8) * hotend, hotend),
    ):
        yield row, "design_filter", lambda p=process, m=model: nrdob.design_filter(p, m, max_ms=1.6)
        yield row, "suggest_model", lambda p=process: nrdob.suggest_model(p)
    for ratio in LATE:
        row = f"dead time / lag = {ratio:.0e}"
        yield row, "λ = θ, stable", lambda r=ratio: judge_late(r, r)
        yield row, "λ = 30 lags, unstable", lambda r=ratio: judge_late(r, 30)


def milliseconds(task: Task) -> float | None:
    """Median of the processor time, after one call to warm up; None where there is no answer."""
    times: list[float] = []
    begin = time.process_time()
    while len(times) <= ROUNDS and (len(times) < 2 or time.process_time() - begin < ENOUGH):
        start = time.process_time()
        try:
            task()
        except (ArithmeticError, ValueError):
            return None
        times.append(time.process_time() - start)
        plt.close("all")
        if times[-1] > ENOUGH:
            return 1e3 * times[-1]
    return 1e3 * median(times[1:])


def blas_kernel() -> str:
    """Name the kernel that OpenBLAS chose, where NumPy brings its own OpenBLAS."""
    library = ctypes.CDLL(np.linalg._umath_linalg.__file__)
    try:
        name = library.scipy_openblas_get_corename64_
    except AttributeError:
        return "not OpenBLAS"
    name.restype = ctypes.c_char_p
    return f"OpenBLAS, {name().decode()}"


def measure() -> dict[str, dict[str, float | None]]:
    """Time every task."""
    found: dict[str, dict[str, float | None]] = {}
    for row, column, task in tasks():
        found.setdefault(row, {})[column] = milliseconds(task)
    return found


def written(value: float | None) -> str:
    """Write a time with three digits at most."""
    if value is None:
        return "none"
    return f"{value:.3g}" if value < 1e3 else f"{value:.0f}"


def table(after: dict, before: dict | None) -> str:
    """Write the table in Markdown, one row to a plant, in ms."""
    columns = list(dict.fromkeys(column for row in after.values() for column in row))
    lines = [f"| ms | {' | '.join(columns)} |", "|---|" + "--:|" * len(columns)]
    for name, row in after.items():
        entries = []
        for column in columns:
            entry = written(row[column]) if column in row else ""
            if column in row and before is not None and column in before.get(name, {}):
                entry = f"{written(before[name][column])} → {entry}"
            entries.append(entry)
        lines.append(f"| {name} | {' | '.join(entries)} |")
    return "\n".join(lines)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Time the public calls and print one table.")
    parser.add_argument("--before", type=Path, metavar="FILE", help="numbers kept earlier")
    parser.add_argument("--save", type=Path, metavar="FILE", help="keep the numbers there")
    options = parser.parse_args()

    mpl.use("Agg")
    machine = f"{cpuinfo.get_cpu_info()['brand_raw']}; {blas_kernel()}"
    times = measure()
    if options.save:
        text = json.dumps({"machine": machine, "ms": times}, indent=1)
        options.save.write_text(text + "\n", encoding="utf-8")
    before = json.loads(options.before.read_text(encoding="utf-8")) if options.before else None
    print(table(times, before and before["ms"]))
    print(f"\nMedians of processor time. After: {machine}." if before else f"\n{machine}.")
    if before:
        print(f"Before: {before['machine']}.")


if __name__ == "__main__":
    main()
