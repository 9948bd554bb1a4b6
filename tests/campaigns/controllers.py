"""Generated controllers of random loops, in C and in Python, against the simulation.

    PYTHONPATH=tests python -m tests.campaigns.controllers --count 200 --seed 0

Every loop is simulated with noise and with limits of some kind, started at rest or taken over from
a manual value; some models wait, some controllers track. The C is compiled with all warnings as
errors, and fed with what the simulated processor has read, sample by sample.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from firmware import relative, run_c, run_python
from nrdob.digital import ActuatorLimits
from nrdob.sampling import random_loop

from .runner import print_tally
from .waiting import random_loop as random_waiting_loop

PROMISED = 1e-12
SAMPLES = 300


def campaign(count: int, seed: int) -> dict[str, int]:
    """Count what came of so many loops; what is not equal is printed."""
    rng, tally, worst = np.random.default_rng(seed), Counter(), 0.0
    while sum(tally.values()) < count:
        waits = rng.random() < 0.3
        loop = random_waiting_loop(rng) if waits else random_loop(rng, delayed=True)
        longest = max(loop.model_delay, loop.delay, 1e-2)
        dt = longest * 10 ** rng.uniform(-1.5, 0.5)
        try:
            method = "zoh" if rng.random() < 0.2 else "tustin"
            late = float(rng.choice([0, 0.4, 1])) * dt
            sampled = loop.sampled(dt, method, computation_delay=late)
            controller = sampled.controller
        except ValueError as refusal:
            tally["refused: " + str(refusal).split(" (")[0][:60]] += 1
            continue
        if np.abs(np.linalg.eigvals(controller.A)).max() > 1 + 1e-9:
            continue  # unstable blocks: rounding grows in them, whoever runs them
        once = [section.integrates for section in controller.sections["C"]].count(True) == 1
        more = {"tracking_time": 5 * dt / abs(controller.factor)} if once else {}
        limits = rng.choice(
            [None, ActuatorLimits(-1, 1.5), ActuatorLimits(-1, 2, 0.5 / dt), ActuatorLimits(rate=5)]
        )
        start = rng.choice([None, 0.7])
        R, d = rng.standard_normal((2, SAMPLES))
        try:
            expected = sampled.simulate(
                {"R": R, "d": d, "delta": 0.2}, 0.1, limits, start=start, seed=rng, **more
            )
        except ArithmeticError:
            tally["leaves the range of numbers"] += 1
            continue
        except ValueError:
            tally["not at rest at the start"] += 1
            continue
        given = R, expected.measured, expected.applied, start
        in_c = run_c(sampled, "c", *given, limits=limits, **more)
        in_python = run_python(sampled.code(limits=limits, **more).to_python(), *given)
        # What u is made of: at a start from rest the first two terms nearly cancel.
        terms = controller.blocks["F/Gm"].D / controller.factor * expected.measured
        names = ("u", "applied", "d_hat")
        error = max(
            relative(found, getattr(expected, name), terms)
            for signals in (in_c, in_python)
            for name, found in zip(names, signals, strict=True)
        )
        worst = max(worst, error)
        same = all(np.array_equal(a, b) for a, b in zip(in_c, in_python, strict=True))
        tally["C and Python equal in every bit" if same else "C and Python differ"] += 1
        if error > PROMISED:
            tally["not equal to the simulation"] += 1
            print(f"{error:.1e}", dt, limits, start, loop.fractions, loop.delay, loop.model_delay)
    print(f"largest relative difference from the simulation: {worst:.1e}")
    return dict(tally)


if __name__ == "__main__":
    print_tally(campaign, __doc__, 200)
