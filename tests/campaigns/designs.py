"""Designs against brute force: a dense scan, what it finds confirmed by exact margins.

python -m tests.campaigns.designs --count 1000 --seed 0
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

import nrdob
from nrdob import LowPassFilter
from nrdob.analysis import quotient_margins
from nrdob.design import Mismatch
from nrdob.diagram import ObserverEquations

from .plants import plant_and_model
from .runner import print_tally

PER_DECADE = 100
"""Time constants of the scan."""

EXACT_EACH = 12
"""Which of them are looked at by exact margins, where no frequency of the scan shows a mode.

Where the verdict is left open a mode is too narrow for the margins, too.
"""


def campaign(count: int, seed: int) -> Counter[str]:
    """Count what became of random designs; "WRONG" begins the name of every fault."""
    rng = np.random.default_rng(seed)
    return Counter(_design(rng, f"seed {seed}, number {k}") for k in range(count))


def _design(rng: np.random.Generator, label: str) -> str:
    _, process, model = plant_and_model(rng)
    order = Mismatch.of(process, model).order + int(rng.integers(0, 2))
    try:
        intervals = nrdob.stabilizing_time_constants(process, model, order)
    except ArithmeticError:
        return "set refused"
    if not intervals:
        return "no filter stabilises"
    scan = _scan(process, model, order, intervals)
    wanted = _specification(rng, scan)
    good = _meets(scan, wanted, by=1e-3)
    try:
        windows = nrdob.admissible_time_constants(process, model, order, **wanted)
    except ArithmeticError:
        return "margins refused"
    for end in (end for window in windows for end in window):
        if 0 < end < np.inf and not any(end in ends for ends in intervals):
            found = _exact(process, model, order, intervals, end)
            if not _meets(found, wanted, by=-1e-6)[0]:
                return f"WRONG an end that does not meet it ({label})"
    missed = [value for value in scan[0][good] if not _within(value, windows)]
    sure = [v for v in missed if _meets(_exact(process, model, order, intervals, v), wanted)[0]]
    if sure:
        faster = not windows or sure[0] < windows[0][0]
        print(label, order, wanted, windows, sure[:5])
        return "WRONG a faster filter exists" if faster else "WRONG a window is missed"
    bad = [v for v in scan[0][~_meets(scan, wanted, by=-1e-3)] if _within(v, windows)]
    if any(not _meets(_exact(process, model, order, intervals, v), wanted)[0] for v in bad):
        print(label, order, wanted, windows, bad[:5])
        return "WRONG a window holds what does not meet it"
    return "right: refused" if not windows else f"right: {min(len(windows), 3)} window(s)"


def _within(value: float, windows: list[tuple[float, float]]) -> bool:
    return any(low <= value <= high for low, high in windows)


def _scan(
    process: Any, model: Any, order: int, intervals: list[tuple[float, float]]
) -> tuple[np.ndarray, ...]:
    """Ms, gain margin and phase margin over time constants, off a very dense grid."""
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
    R = mismatch.ratio(omega)
    found = [_read(R / ((1 + 1j * value * omega) ** order - 1)) for value in grid]
    scanned = grid, *map(np.array, zip(*found, strict=True))
    exact = [
        _exact(process, model, order, intervals, value)
        for value in narrow
        if nrdob.NRDOB(process, model, 0.0, LowPassFilter(value, order)).margins().plant_loop.stable
    ]
    return tuple(map(np.concatenate, zip(scanned, *exact, strict=True)))


def _read(L: np.ndarray) -> tuple[float, float, float]:
    ms = 1 / np.abs(1 + L).min()
    size, step = np.log(np.abs(L)), np.log(L[1:] / L[:-1])
    k = np.flatnonzero((size[1:] >= 0) != (size[:-1] >= 0))
    there = L[k] * np.exp(step[k] * size[k] / (size[k] - size[k + 1]))
    pm = np.degrees(np.abs(np.angle(-there))).min(initial=np.inf)
    k = np.flatnonzero((L.imag[1:] >= 0) != (L.imag[:-1] >= 0))
    share = L.imag[k] / (L.imag[k] - L.imag[k + 1])
    real = (L[k] + share * (L[k + 1] - L[k])).real
    gm = np.abs(20 * np.log10(-real[real < 0])).min(initial=np.inf)
    return float(ms), float(gm), float(pm)


def _exact(
    process: Any, model: Any, order: int, intervals: list[tuple[float, float]], value: float
) -> tuple[np.ndarray, ...]:
    loop = ObserverEquations(process, model, LowPassFilter(value, order))
    stable = any(low < value < high for low, high in intervals)
    found = quotient_margins(loop.L, stable)
    numbers = (value, found.ms, abs(found.gm_db), found.pm)
    return tuple(np.array([number]) for number in numbers)


def _specification(rng: np.random.Generator, scan: tuple[np.ndarray, ...]) -> dict[str, float]:
    """One to three limits, some only just above the best that can be had."""
    wanted: dict[str, float] = {}
    if rng.random() < 0.7:
        tight = 10 ** rng.uniform(-3, -1)
        best = float(scan[1].min()) * (1 + tight)
        wanted["max_ms"] = max(1.0001, best if rng.random() < 0.5 else rng.uniform(1.1, 3.0))
    if rng.random() < 0.4:
        wanted["min_gm_db"] = float(rng.uniform(2, 12))
    if rng.random() < 0.4 or not wanted:
        wanted["min_pm_deg"] = float(rng.uniform(20, 70))
    return wanted


def _meets(scan: tuple[np.ndarray, ...], wanted: dict[str, float], by: float = 0.0) -> np.ndarray:
    _, ms, gm, pm = scan
    limit = wanted.get("max_ms", np.inf)
    return np.asarray(
        (ms * (1 + by) <= limit)
        & (gm >= wanted.get("min_gm_db", 0.0) + 20 * by)
        & (pm >= wanted.get("min_pm_deg", 0.0) + 60 * by)
    )


if __name__ == "__main__":
    print_tally(campaign, __doc__, 1000)
