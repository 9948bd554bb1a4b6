"""One table of the public calls: today beside python-control in one run, and the editions before.

Processor time, since wall time would measure whoever else uses the machine; medians, each call on
a loop that remembers nothing, taken by turns with what python-control does for the same question.
It gets its loops multiplied out, Padé's approximant of order 5 in place of the plant's dead time,
and none in the model.

    python tests/bench/table.py                                 print the table
    python tests/bench/table.py --keep "second edition, a829c29"    and keep the numbers

The second command, run with an earlier commit's package on PYTHONPATH, makes `editions.json`.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import time
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from statistics import median

import control as ct
import cpuinfo
import numpy as np

import nrdob
from nrdob import LowPassFilter, paper

ORDERS = (2, 4, 8)
PADE = 5
EDITIONS = Path(__file__).with_name("editions.json")

ROUNDS = 15
ENOUGH = 5.0
"""Seconds after which a call is not repeated any more."""

Task = Callable[[], object]
Times = tuple[float | None, float | None]


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


def loops() -> Iterator[tuple[str, tuple]]:
    """Blocks by name."""
    for order in ORDERS:
        for dead_time in (0, 0.2):
            name = f"order {order}" + f", dead time {dead_time} s" * bool(dead_time)
            yield name, blocks(order, dead_time)
    example = paper.example(4)
    process, model, others = example.process, example.model, (example.controller, example.filter)
    yield "Example 4", (process, model, *others)
    yield "Example 4, model with 0.04 s", (process, nrdob.delay(0.04) * model, *others)


def undelayed(block: object, order: int) -> ct.TransferFunction:
    """Padé's approximant of a block."""
    if isinstance(block, ct.TransferFunction):
        return block
    return block.tf * ct.tf(*ct.pade(block.delay, order))


def questions() -> Iterator[tuple[str, Task, Task | None]]:
    """Name, our call, and what python-control is asked, if it knows an answer."""
    for name, given in loops():
        process, model, *others = given
        rational = nrdob.NRDOB(undelayed(process, PADE), undelayed(model, 0), *others)
        gains = [rational.CGm.to_tf(), rational.FH.to_tf(), rational.L.to_tf()]
        maps = [rational.T_R.to_tf(), rational.U_R.to_tf()]

        def fresh(given: tuple = given) -> nrdob.NRDOB:
            return nrdob.NRDOB(*given)

        yield (
            f"verdict, {name}",
            lambda fresh=fresh: fresh().stability(),
            lambda gains=gains: [ct.nyquist_response(gain) for gain in gains[:2]],
        )
        yield (
            f"margins, {name}",
            lambda fresh=fresh: fresh().margins(),
            lambda gains=gains: [ct.stability_margins(gain) for gain in gains],
        )
        verdict = cache(lambda fresh=fresh: fresh().stability())
        yield (
            f"margins with the verdict known, {name}",
            lambda fresh=fresh, verdict=verdict: nrdob.analysis.loop_margins(fresh(), verdict()),
            lambda gains=gains: [ct.stability_margins(gain) for gain in gains],
        )
        yield (
            f"step response, {name}",
            lambda fresh=fresh: fresh().step_response("R"),
            lambda maps=maps: [ct.step_response(map) for map in maps],
        )
    for name, (process, model, _, filter) in loops():
        yield (
            f"stabilising λ, {name}",
            lambda p=process, m=model, n=filter.order: nrdob.stabilizing_time_constants(p, m, n),
            None,
        )
    example = paper.example(4)
    yield (
        "design_filter, Example 4",
        lambda: nrdob.design_filter(example.process, example.model, max_ms=1.6),
        None,
    )
    yield "suggest_model, Example 4", lambda: nrdob.suggest_model(example.process), None


def by_turns(ours: Task, theirs: Task | None) -> Times:
    """Medians of the processor time in ms, after one call of each to warm up."""
    tasks = [ours] if theirs is None else [ours, theirs]
    times: list[list[float]] = [[] for _ in tasks]
    begin = time.process_time()
    while len(times[-1]) <= ROUNDS and (len(times[-1]) < 2 or time.process_time() - begin < ENOUGH):
        for task, found in zip(tasks, times, strict=True):
            start = time.process_time()
            task()
            found.append(time.process_time() - start)
    ms = [1e3 * median(found[1:]) for found in times]
    return ms[0], ms[1] if theirs else None


def measure() -> dict[str, Times]:
    """Time every question; what an earlier edition did not know has no time."""
    found: dict[str, Times] = {}
    for name, ours, theirs in questions():
        try:
            found[name] = by_turns(ours, theirs)
        except (AttributeError, TypeError, ValueError, ArithmeticError):
            found[name] = None, None
    return found


def machine() -> str:
    """Name the processor, and the kernel that OpenBLAS chose where NumPy brings its own."""
    library = ctypes.CDLL(np.linalg._umath_linalg.__file__)
    kernel = getattr(library, "scipy_openblas_get_corename64_", None)
    if kernel is None:
        return f"{cpuinfo.get_cpu_info()['brand_raw']}"
    kernel.restype = ctypes.c_char_p
    return f"{cpuinfo.get_cpu_info()['brand_raw']}; OpenBLAS, {kernel().decode()}"


def written(times: Times | None) -> str:
    """A ratio to python-control, or a time where it has no answer."""
    ours, theirs = times or (None, None)
    if ours is None:
        return "none"
    return f"{ours / theirs:.2f}" if theirs else f"{ours:.3g} ms"


def table(today: dict[str, Times], editions: dict[str, dict[str, Times]]) -> str:
    """Write the table in Markdown, one row to a question."""
    heads = ["", "nrdob, ms", "control, ms", "ratio today", *editions]
    lines = ["| " + " | ".join(heads) + " |", "|---|" + "--:|" * (len(heads) - 1)]
    for name, times in today.items():
        ms = ["" if each is None else f"{each:.3g}" for each in times]
        ratios = [written(each) for each in (times, *(e.get(name) for e in editions.values()))]
        lines.append("| " + " | ".join([name, *ms, *ratios]) + " |")
    return "\n".join(lines)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Time the public calls and print one table.")
    parser.add_argument("--keep", metavar="NAME", help="keep the numbers in editions.json")
    options = parser.parse_args()

    warnings.simplefilter("ignore")  # python-control's, of Nyquist plots
    kept = json.loads(EDITIONS.read_text(encoding="utf-8")) if EDITIONS.exists() else {}
    today = measure()
    if options.keep:
        kept[options.keep] = {"machine": machine(), "ms": today}
        EDITIONS.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    print(table(today, {name: each["ms"] for name, each in kept.items()}))
    print(
        f"\nMedians of processor time; ratios are to python-control in the same run. {machine()}."
    )
    for name, each in kept.items():
        print(f"{name}: {each['machine']}.")


if __name__ == "__main__":
    main()
