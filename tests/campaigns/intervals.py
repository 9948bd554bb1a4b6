"""Intervals of gain, dead time and λ, and boxes, against a count of roots that shares nothing.

python -m tests.campaigns.intervals --count 300 --seed 0

The blocks are multiplied out with numpy and the phase of p_B is followed along the axis, step by
step, until no step is long. A third of the models waits, a third of the plants is in state space.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import control as ct
import numpy as np

import nrdob
from nrdob.sampling import random_loop
from nrdob.uncertain import delay_intervals, gain_intervals

from .runner import print_tally

ROUNDS = 50
"""How often steps are halved before a phase is given up."""

POINTS = 6
"""Plants of each box that are judged."""

Terms = list[tuple[np.ndarray, float]]


def campaign(count: int, seed: int) -> Counter[str]:
    """Count what became of random loops; "WRONG" begins the name of every fault."""
    rng = np.random.default_rng(seed)
    tally: Counter[str] = Counter()
    for k in range(count):
        loop = draw(rng)
        for asked in (_intervals, _critical, _box):
            try:
                tally.update(asked(rng, loop))
            except (ValueError, ArithmeticError) as refusal:
                tally[f"{asked.__name__[1:]} refused: {str(refusal)[:40]}"] += 1
        if any(name.startswith("WRONG") for name in tally):
            print(f"seed {seed}, number {k}", loop)
    return tally


def draw(rng: np.random.Generator) -> nrdob.NRDOB:
    """Draw a loop whose condition i holds."""
    while True:
        loop = random_loop(rng, delayed=bool(rng.random() < 0.5))
        model, plant = loop.model, ct.tf(*loop.fractions.G)
        if rng.random() < 0.7:
            plant = model * rng.uniform(0.6, 1.6)
            if rng.random() < 0.4:
                plant *= nrdob.plants.resonance(10 ** rng.uniform(-0.5, 1.3), 0.1 * rng.random())
        plant = ct.ss(plant) if rng.random() < 0.3 else plant
        plant = nrdob.delay(loop.delay) * plant if loop.delay else plant
        if rng.random() < 0.3:
            model = nrdob.delay(10 ** rng.uniform(-2, 0.5)) * model
        loop = nrdob.NRDOB(plant, model, loop.controller, loop.filter)
        _, Gm, C, _ = loop.fractions
        p_A = np.polyadd(np.convolve(Gm.den, C.den), np.convolve(Gm.num, C.num))
        if (np.roots(p_A).real < 0).all():
            return loop


def p_B(loop: nrdob.NRDOB, *, gain: float = 1, delay: float = 0, lag: float = 0) -> Terms:
    """Give polynomials and dead times of p_B, the one without dead time first."""
    G, Gm, _, F = loop.fractions
    ahead = np.convolve(np.convolve(G.den, Gm.num), [lag, 1.0] if lag else [1.0])
    behind = gain * np.convolve(np.convolve(G.num, Gm.den), F.num)
    parts = [(-np.convolve(ahead, F.num), loop.model_delay), (behind, loop.delay + delay)]
    first = np.convolve(ahead, F.den)
    for q, late in parts:
        first = first if late > 1e-15 else np.polyadd(first, q)
    terms = [(first, 0.0), *(part for part in parts if part[1] > 1e-15)]
    while all(q[-1] == 0 for q, _ in terms):
        terms = [(q[:-1], late) for q, late in terms]
    return terms


def rhp_count(terms: Terms) -> float | None:
    """Count roots in the right half plane; None near the axis, inf for a neutral loop."""
    terms = [(np.trim_zeros(q, "f"), late) for q, late in terms]
    degree, lead = terms[0][0].size - 1, terms[0][0][0]
    rivals = sum(abs(q[0]) for q, _ in terms[1:] if q.size > degree) / abs(lead)
    if rivals > 0.98:
        return np.inf if rivals > 1.02 else None

    def at(w: np.ndarray) -> np.ndarray:
        return np.array([np.polyval(q, 1j * w) * np.exp(-1j * w * late) for q, late in terms])

    w = np.unique(np.concatenate([[0], np.geomspace(1e-7, 1e7, 2000)]))
    longest = max(late for _, late in terms)
    for _ in range(ROUNDS):
        parts = at(w) / (1j * w + 1) ** degree / lead
        value, late = parts.sum(axis=0), np.abs(parts[1:]).sum(axis=0)
        size = np.abs(value)
        if size.min() < 1e-9:
            return None
        least = np.minimum(size[1:], size[:-1])
        long = np.abs(np.diff(value)) > 0.6 * least
        late = np.maximum(late[1:], late[:-1])
        long |= (np.diff(w) * longest > 0.4) & (late > 0.3 * least)
        if not long.any():
            return round(-np.angle(value[1:] / value[:-1]).sum() / np.pi)
        k = np.flatnonzero(long)
        w = np.insert(w, k + 1, (w[k] + w[k + 1]) / 2)
    return None


def _compared(what: str, terms: Terms, stable: bool) -> str:
    count = rhp_count(terms)
    if count is None:
        return f"{what}: too near the axis"
    return f"{what}: right" if (count == 0) is stable else f"WRONG {what}"


def _intervals(rng: np.random.Generator, loop: nrdob.NRDOB) -> list[str]:
    low, high, found = {}, {}, {}
    low["delay"], high["delay"] = 0.0, 10 ** rng.uniform(-1, 2)
    low["gain"], high["gain"] = 10 ** rng.uniform(-2, 0), 10 ** rng.uniform(0.1, 2)
    found["delay"] = delay_intervals(loop, low["delay"], high["delay"])
    found["gain"] = gain_intervals(loop, low["gain"], high["gain"])
    told = []
    for name, intervals in found.items():
        ends = [end for end in np.ravel(intervals) if low[name] < end < high[name]]
        beside = [end * (1 + side * 1e-4) for end in ends[:4] for side in (-1, 1)]
        for value in [*beside, *rng.uniform(low[name], high[name], 3)]:
            stable = any(a < value < b for a, b in intervals)
            told.append(_compared(name, p_B(loop, **{name: float(value)}), stable))
    return told


def _critical(rng: np.random.Generator, loop: nrdob.NRDOB) -> list[str]:
    order, told = loop.filter.order, []
    found = nrdob.critical_time_constants(loop.process, loop.model, order)[-6:]
    for k, (lam, omega, direction) in enumerate(found):
        beside = []
        for side in (-1, 1):
            near = lam * (1 + side * 1e-4)
            others = (each for i, each in enumerate(found) if i != k)
            if any(
                (each.time_constant - lam) * (each.time_constant - near) <= 0 for each in others
            ):
                break
            F = nrdob.LowPassFilter(near, order)
            other = nrdob.NRDOB(loop.process, loop.model, loop.controller, F)
            beside.append(rhp_count(p_B(other)))
        if len(beside) < 2 or None in beside or np.inf in beside:
            told.append("critical: too near the axis")
            continue
        change = direction * (1 if omega in (0.0, np.inf) else 2)
        told.append("critical: right" if beside[1] - beside[0] == change else "WRONG critical")
    return told


def _box(rng: np.random.Generator, loop: nrdob.NRDOB) -> list[str]:
    asked: dict[str, Any] = {"delay": (-loop.delay * rng.random(), 10 ** rng.uniform(-2, 1))}
    if rng.random() < 0.6:
        asked["gain"] = (rng.uniform(0.2, 1), rng.uniform(1, 4))
    if rng.random() < 0.6:
        asked["lag"] = (0.0, 10 ** rng.uniform(-2, 1))
    box, told = nrdob.largest_box(loop, **asked), []
    for k in range(POINTS):
        plant = {}
        for name, (low, high) in asked.items():
            nominal = float(name == "gain")
            share = rng.random() if k % 2 else rng.integers(0, 2)
            value = low + share * (high - low)
            plant[name] = float(nominal + (1 - 1e-4) * box.share * (value - nominal))
        told.append(_compared("box", p_B(loop, **plant), stable=True))
    if box.critical and box.frequency:
        terms, s = p_B(loop, **box.critical), 1j * box.frequency
        parts = [np.polyval(q, s) * np.exp(-s * late) for q, late in terms]
        there = abs(sum(parts)) < 1e-3 * sum(map(abs, parts))
        told.append("lost: right" if there else "WRONG lost")
    return told


if __name__ == "__main__":
    print_tally(campaign, __doc__ or "", 300)
