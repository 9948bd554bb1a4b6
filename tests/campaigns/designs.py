"""Designs against brute force: a dense scan, what it finds confirmed by exact margins.

python -m tests.campaigns.designs --count 1000 --seed 0
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

import nrdob
from nrdob import LowPassFilter
from nrdob.analysis import quotient_margins
from nrdob.design.mismatch import Mismatch
from nrdob.diagram import ObserverEquations

from .plants import plant_and_model
from .runner import labelled, print_tally

PER_DECADE = 100
"""Time constants of the scan."""

EXACT_EACH = 12
"""Which of them are looked at by exact margins, where no frequency of the scan shows a mode.

Where the verdict is left open a mode is too narrow for the margins, too.
"""


def _design(rng: np.random.Generator, label: str) -> str:
    _, process, model = plant_and_model(rng)
    order = Mismatch.of(process, model).family.order + int(rng.integers(0, 2))
    try:
        intervals = nrdob.stabilizing_time_constants(process, model, order)
    except ArithmeticError:
        return "set refused"
    if not intervals:
        return "no filter stabilises"
    scan = _scan(process, model, order, intervals)
    limit = _limit(rng, scan)
    try:
        windows = nrdob.admissible_time_constants(process, model, order, max_ms=limit)
    except ArithmeticError:
        return "margins refused"

    def exact(value: float) -> float:
        return _exact(process, model, order, intervals, value)

    for end in (end for window in windows for end in window):
        known = any(end in ends for ends in intervals)
        if 0 < end < np.inf and not known and exact(end) > limit * (1 + 1e-6):
            return f"WRONG an end that does not meet it ({label})"
    values, ms = scan
    missed = [v for v in values[ms * (1 + 1e-3) <= limit] if not _within(v, windows)]
    sure = [v for v in missed if exact(v) <= limit]
    if sure:
        faster = not windows or sure[0] < windows[0][0]
        print(label, order, limit, windows, sure[:5])
        return "WRONG a faster filter exists" if faster else "WRONG a window is missed"
    bad = [v for v in values[ms * (1 - 1e-3) > limit] if _within(v, windows)]
    if any(exact(v) > limit for v in bad):
        print(label, order, limit, windows, bad[:5])
        return "WRONG a window holds what does not meet it"
    return "right: refused" if not windows else f"right: {min(len(windows), 3)} window(s)"


def _within(value: float, windows: list[tuple[float, float]]) -> bool:
    return any(low <= value <= high for low, high in windows)


def _scan(
    process: Any, model: Any, order: int, intervals: list[tuple[float, float]]
) -> tuple[np.ndarray, np.ndarray]:
    """Time constants, and Ms of each off a very dense grid of frequencies."""
    mismatch = Mismatch.of(process, model, order)
    slow, fast = 1 / mismatch.speeds.min(), 1 / mismatch.speeds.max()
    grid = np.geomspace(fast / 300, slow * 300, int(PER_DECADE * np.log10(slow / fast * 9e4)))
    grid = np.array([v for v in grid if any(a < v < b for a, b in intervals)])
    narrow = grid[:0]
    if any(root.real > -1e-9 * abs(root) for root in mismatch.roots):
        # Under a slow filter an undamped mode is so narrow that no frequency of the scan shows it.
        grid, narrow = grid[grid < 3 * slow], grid[grid >= 3 * slow][::EXACT_EACH]
    if not grid.size:
        low, high = intervals[0]
        grid = np.array([np.sqrt(low * min(high, 4 * low))])
    omega = np.geomspace(1e-3 / slow, 1e4 / fast, 6000)
    for root in mismatch.roots[mismatch.roots.imag > 0]:
        steps = np.geomspace(1e-13 if abs(root.real) < 1e-9 else 1e-6, 1, 400) * abs(root)
        omega = np.concatenate([omega, root.imag + steps, root.imag - steps])
    omega = np.unique(omega[omega > 0])
    if mismatch.delay:
        last = 40 / (grid[0] + mismatch.delay / 100)
        turns = np.arange(0.02 / mismatch.delay, last, 0.02 / mismatch.delay)
        omega = np.union1d(omega[omega < max(20 * last, 10 / slow)], turns)
    R = nrdob.NRDOB(process, model, 0.0, LowPassFilter(1.0, order)).ratio(1j * omega)
    found = [1 / np.abs(1 + R / ((1 + 1j * v * omega) ** order - 1)).min() for v in grid]
    alone = [
        value
        for value in narrow.tolist()
        if nrdob.NRDOB(process, model, 0.0, LowPassFilter(value, order)).margins().plant_loop.stable
    ]
    exact = [_exact(process, model, order, intervals, value) for value in alone]
    return np.concatenate([grid, alone]), np.array([*found, *exact])


def _exact(
    process: Any, model: Any, order: int, intervals: list[tuple[float, float]], value: float
) -> float:
    loop = ObserverEquations(process, model, LowPassFilter(value, order))
    stable = any(low < value < high for low, high in intervals)
    return quotient_margins(loop.L, stable).ms if stable else np.inf


def _limit(rng: np.random.Generator, scan: tuple[np.ndarray, np.ndarray]) -> float:
    """Draw a limit, half of them only just above the best that can be had."""
    tight = 10 ** rng.uniform(-3, -1)
    best = float(scan[1].min()) * (1 + tight)
    return max(1.0001, best if rng.random() < 0.5 else float(rng.uniform(1.1, 3.0)))


campaign = partial(labelled, _design)

if __name__ == "__main__":
    print_tally(campaign, __doc__, 1000)
