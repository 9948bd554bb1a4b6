"""Loops proposed for records, tried on the plants that made them, sampled like the records.

The plants are simulated in closed form; whether the loop is stable on them is found by brute force,
tests/oracles/wired.py. A lag has 4 to 150 samples.

Run `python -m tests.campaigns.proposals --count 240 --seed 2`.
"""

from __future__ import annotations

from typing import NamedTuple

import control as ct
import numpy as np

import nrdob
from nrdob.measured import identify
from nrdob.reporting import propose
from tests.oracles.plain import Block, Plain
from tests.oracles.wired import poles

from .identification import response
from .runner import plain, print_tally, tallied

PLANTS = {
    "one lag": lambda lag: ([1.0], [lag, 1.0]),
    "two lags": lambda lag: ([1.0], np.polymul([lag, 1.0], [0.4 * lag, 1.0])),
    "oscillating": lambda lag: ([1.0], [lag**2 / 9, lag / 5, 1.0]),
    "integrating": lambda lag: ([1.0], [lag, 0.0]),
}


class Case(NamedTuple):
    """A plant, and a record of it."""

    name: str
    process: nrdob.diagram.DelayedTransferFunction
    t: np.ndarray
    u: np.ndarray
    y: np.ndarray


def draw(rng: np.random.Generator) -> Case:
    name = str(rng.choice(list(PLANTS)))
    samples = int(rng.choice([4, 6, 10, 20, 50, 150]))
    dt, delay = 10 ** rng.uniform(-3, 2), int(rng.choice([0, 0, 0.1, 0.5, 1.5]) * samples)
    gain = rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-2, 2)
    num, den = PLANTS[name](float(samples))
    count = max(12 * samples, 150)
    lasting = rng.integers(max(samples // 2, 2), 2 * samples, size=count)
    u = np.repeat(rng.choice([-1.0, 1.0], size=count), lasting)[:count]
    y = gain * response(np.array(den), np.array(num), delay, u - u[0])
    y += rng.choice([0.002, 0.01, 0.05]) * np.std(y) * rng.standard_normal(count)
    scale = dt ** np.arange(len(den))[::-1]  # from samples to seconds
    process = nrdob.delay(delay * dt) * ct.tf(gain * np.array(num), den * scale)
    return Case(name, process, dt * np.arange(count), u, y)


def in_samples(loop: Plain, dt: float) -> Plain:
    """The same loop in units of the sampling time, in which its numbers are moderate."""

    def scaled(block: Block) -> Block:
        num, den = (np.asarray(p) / dt ** np.arange(len(p))[::-1] for p in block)
        return Block(num / den[0], den / den[0])

    blocks = (scaled(block) for block in loop[:4])
    return Plain(*blocks, loop.delay / dt, loop.model_delay / dt)


def outcome(case: Case) -> str:
    found = identify(case.t, case.u, case.y)
    proposal = propose(found)
    if proposal.loop is None:
        return "no loop proposed"
    blocks = proposal.loop.model, proposal.loop.controller, proposal.loop.filter
    true, dt = nrdob.NRDOB(case.process, *blocks), float(case.t[1])
    stable = bool((np.abs(poles(in_samples(plain(true), dt), 1.0)) < 1).all())
    if true.sampled(dt).stability().stable is not stable:
        return "WRONG verdict"
    warned = any(not trial.holds for trial in proposal.trials)
    if not warned and not (stable and true.stability().stable):
        return "proposed without a warning, and UNSTABLE"
    return f"{'with a warning' if warned else 'proposed'}, {'' if stable else 'not '}stable"


def campaign(count: int, seed: int) -> dict[str, int]:
    return tallied(draw, lambda case: f"{case.name}: {outcome(case)}", count, seed)


if __name__ == "__main__":
    print_tally(campaign, __doc__ or "", 240)
