"""What every campaign takes from the command line, and the table that most of them print."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tests.oracles.plain import Block, Plain


class Asked(NamedTuple):
    """How many cases, and the seed of their random numbers."""

    count: int
    seed: int


def asked(description: str, count: int) -> Asked:
    """Read the command line; `count` is how many cases are tried where it does not say."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    return Asked(given.count, given.seed)


def plain(loop: Any) -> Plain:
    """The coefficients of a loop, as the oracles take them."""
    G, Gm, C, F = (Block(part.num, part.den) for part in loop.fractions)
    return Plain(G, Gm, C, F, loop.delay, loop.model_delay)


def tallied(
    draw: Callable[[np.random.Generator], Any], outcome: Callable[[Any], str], count: int, seed: int
) -> dict[str, int]:
    """Count outcomes of drawn cases; what is refused counts by its message."""
    rng = np.random.default_rng(seed)
    tally: Counter[str] = Counter()
    for _ in range(count):
        case = draw(rng)
        try:
            tally[outcome(case)] += 1
        except ValueError as refusal:
            tally[f"refused: {refusal}"] += 1
    return tally


def labelled(
    outcome: Callable[[np.random.Generator, str], str], count: int, seed: int
) -> Counter[str]:
    """Count outcomes of random cases, which get their label; "WRONG" begins that of a fault."""
    rng = np.random.default_rng(seed)
    return Counter(outcome(rng, f"seed {seed}, number {k}") for k in range(count))


def print_tally(
    campaign: Callable[[int, int], dict[str, int]], description: str, count: int
) -> None:
    """Run a campaign and print how often each outcome came."""
    for name, number in sorted(campaign(*asked(description, count)).items()):
        print(f"{number:6}  {name}")
