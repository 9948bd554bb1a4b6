"""Sweeps against the method for one loop, member by member.

The families of the paper's examples, and of twenty random loops, half of them with dead time. Each
member is judged by `NRDOB.stability`, and every tenth one's Ms is that of `NRDOB.margins`.

Run `python -m tests.campaigns.sweeps --count 10000 --seed 0`: so many members of each family.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import isclose

import control as ct
import numpy as np

import nrdob
from nrdob.sampling import random_loop

from .runner import print_tally

RANGES = {"gain": (0.3, 2.0), "lag": (0.0, 0.2), "poles": (0.7, 1.4), "zeros": (0.7, 1.4)}
WITHIN = 1e-6
"""How well Ms must agree; that of a loop that is next to lost hangs on more than that."""


def loops(seed: int) -> Iterator[tuple[str, nrdob.NRDOB]]:
    """The paper's loops and twenty random ones of which some members are stable."""
    for k in nrdob.paper.EXAMPLES:
        yield f"Example {k}", nrdob.paper.example(k)
    rng = np.random.default_rng(seed)
    for k in range(20):
        while True:
            loop = random_loop(rng, delayed=k % 2 == 1)
            if loop.stability().stable:
                break
        yield f"random {k}" + " with dead time" * (k % 2), loop


def plants(loop: nrdob.NRDOB, count: int, seed: int) -> nrdob.uncertain.Family:
    """A family of everything that can be uncertain: poles and zeros are faster by a factor."""
    ranges = dict(RANGES)
    if loop.delay:
        ranges["delay"] = (0.0, loop.delay)
    G = loop.fractions.G

    def moved(poles: float, zeros: float) -> nrdob.diagram.DelayedTransferFunction:
        num, den = (
            p * factor ** -np.arange(p.size - 1.0, -1.0, -1.0)
            for p, factor in ((G.num, zeros), (G.den, poles))
        )
        return nrdob.delay(loop.delay) * ct.tf(num, den)

    return nrdob.plant_family(loop.process, parameters=moved, **ranges, samples=count, seed=seed)


def differences(loop: nrdob.NRDOB, family: nrdob.uncertain.Family, every: int = 10) -> list[str]:
    """What a sweep says otherwise than the method for one loop."""
    table = nrdob.sweep(loop, family)
    found = []
    for k in range(len(family)):
        one = nrdob.NRDOB(family[k], loop.model, loop.controller, loop.filter)
        verdict = one.stability().stable
        mine = bool(table["stable"][k]) if table["decided"][k] else None
        if verdict is not mine:
            found.append(f"member {k}: {mine} for {verdict}")
        elif verdict and k % every == 0:
            expected, given = one.margins().plant_loop.ms, float(table["ms"][k])
            if not isclose(expected, given, rel_tol=WITHIN * max(1.0, expected)):
                found.append(f"member {k}: Ms {given:.9g} for {expected:.9g}")
    return found


def campaign(count: int, seed: int) -> dict[str, int]:
    """How many members of how many are judged otherwise, family by family."""
    tally = {}
    for name, loop in loops(seed):
        found = differences(loop, plants(loop, count, seed))
        for line in found[:5]:
            print(name, line)
        tally[f"other, of {count}: {name}"] = len(found)
    return tally


if __name__ == "__main__":
    print_tally(campaign, __doc__, 10_000)
