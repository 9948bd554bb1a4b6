"""Sampled loops against brute force: every block a state space of its own, wired by one matrix.

The oracle is tests/oracles/wired.py; nothing is shared with the package. A third of the models
waits.

Run `python -m tests.campaigns.sampled --count 600 --seed 0`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import control as ct
import numpy as np

import nrdob
from nrdob.sampling import random_loop
from tests.oracles.wired import poles

from .runner import plain, print_tally, tallied

CLOSE = 1e-7
"""Distance from the unit circle at which nobody is asked to decide."""


class Case(NamedTuple):
    """A loop, and how it is sampled."""

    loop: nrdob.NRDOB
    dt: float
    computation_delay: float
    method: str = "tustin"

    def sampled(self) -> Any:
        return self.loop.sampled(self.dt, self.method, self.computation_delay)


def draw(rng: np.random.Generator) -> Case:
    loop = random_loop(rng, delayed=bool(rng.random() < 0.6))
    if rng.random() < 0.3:
        model = nrdob.delay(10 ** rng.uniform(-2, -0.3)) * loop.model
        loop = nrdob.NRDOB(loop.process, model, loop.controller, loop.filter)
    elif rng.random() < 0.5:  # near to its model, so that some are stable
        process = loop.model * rng.uniform(0.6, 1.6)
        process = nrdob.delay(loop.delay) * process if loop.delay else process
        loop = nrdob.NRDOB(process, loop.model, loop.controller, loop.filter)
    if rng.random() < 0.25 and not loop.model_delay:
        # A model with an integrator, which cancels inside (1 - F) Gm; the process has it, too.
        integrator = ct.tf([1], [1, 0])
        model, process = loop.model * integrator, ct.tf(*loop.fractions.G) * integrator
        F = nrdob.LowPassFilter(loop.filter.time_constant, loop.filter.order + 1)
        process = nrdob.delay(loop.delay) * process if loop.delay else process
        loop = nrdob.NRDOB(process, model, loop.controller, F)
    dt = max(10 ** rng.uniform(-2, 0.3), (loop.delay + loop.model_delay) / 40)
    late = float(rng.choice([0.0, 1.0, rng.random(), 3 * rng.random()])) * dt
    sound = not loop.model_delay and loop.fractions.Gm.relative_degree <= 1
    if sound and rng.random() < 0.5:
        return Case(loop, float(dt), late, "zoh")
    return Case(loop, float(dt), late)


def brute_force(case: Case) -> np.ndarray:
    """Poles of the loop from sample to sample, in the plane of z."""
    return poles(plain(case.loop), case.dt, case.method, case.computation_delay)


def lasts_as_long_as_it_says(case: Case) -> bool:
    """Whether the loop is stable with less dead time than its margin, and unstable with more.

    Looked at are shares of the margin, and the dead times at which the samples that lie in it
    become one more: there a process with a direct path jumps.
    """
    sampled = case.sampled()
    margin = sampled.margins().delay_margin
    if sampled.process.memory + margin / case.dt > 60:
        return True
    jumps = np.arange(1, 7) - sampled.process.fraction
    beside = case.dt * np.append(jumps, jumps - 1e-4)
    tried = np.union1d(margin * np.array([0.1, 0.35, 0.6, 0.85, 0.999]), beside)

    def radius(added: float) -> float:
        late = case._replace(computation_delay=case.computation_delay + added)
        return float(np.abs(brute_force(late)).max())

    shorter = tried[(tried > 0) & (tried < 0.9999 * margin)]
    return max(map(radius, shorter), default=0.0) < 1 < radius(1.00001 * margin) + CLOSE


def outcome(case: Case) -> str:
    size = np.abs(brute_force(case))
    verdict = case.sampled().stability()
    if np.any(np.abs(size - 1) < CLOSE):
        return "beside the circle"
    if verdict.stable is None:
        return f"undecided: {verdict.reason}"
    if verdict.stable != bool((size < 1).all()):
        return f"WRONG verdict, {case.method}"
    counts = verdict.model_loop.closed_loop_rhp, verdict.observer_loop.closed_loop_rhp
    if None not in counts and sum(counts) != np.sum(size > 1):
        return "WRONG count"
    if verdict.stable and not lasts_as_long_as_it_says(case):
        return f"WRONG delay margin, {case.method}"
    found = "stable" if verdict.stable else "not stable"
    return f"{found}, as by brute force, {case.method}"


def campaign(count: int, seed: int) -> dict[str, int]:
    return tallied(draw, outcome, count, seed)


if __name__ == "__main__":
    print_tally(campaign, __doc__ or "", 600)
