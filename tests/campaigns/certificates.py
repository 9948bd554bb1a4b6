"""Certificates of random loops: accepted, with the count of the verdict; or none, with the reason.

The loops are those of the campaign of verdicts. The checker builds the characteristic functions
anew, in exact fractions, and shares no code with the package.

Run `python -m tests.campaigns.certificates --count 5000 --seed 0`.
"""

from __future__ import annotations

import time
from collections import Counter

import numpy as np

from nrdob.certificates import check

from .runner import asked
from .verdicts import FAMILIES, random_blocks

COLUMNS = "points", "s to make", "s to check"


def campaign(count: int, seed: int) -> tuple[Counter[str], list[tuple[int, float, float]]]:
    """What became of each loop; points, and seconds to make and to check, of the certificates."""
    rng = np.random.default_rng(seed)
    outcomes: Counter[str] = Counter()
    costs = []
    for k in range(count):
        family = list(FAMILIES)[k % len(FAMILIES)]
        verdict = random_blocks(rng, family).loop().stability()
        start = time.process_time()
        try:
            content = verdict.certificate().content
        except ArithmeticError as reason:
            told = str(reason).split(": ", 1)[-1]
            outcomes[f"{family}: none, verdict {verdict.stable}: {told}"] += 1
            continue
        made = time.process_time()
        check(content)
        checked = time.process_time()
        parts = verdict.model_loop, verdict.observer_loop
        same = [content["claim"][p] for p in ("p_A", "p_B")] == [q.closed_loop_rhp for q in parts]
        outcomes["count of the verdict" if same else f"WRONG: {family}, loop {k}"] += 1
        points = max(map(len, content["points"].values()))
        costs.append((points, made - start, checked - made))
    return outcomes, costs


if __name__ == "__main__":
    outcomes, costs = campaign(*asked(__doc__, 5000))
    for name, number in sorted(outcomes.items()):
        print(f"{number:6}  {name}")
    for name, values in zip(COLUMNS, zip(*costs, strict=True), strict=True):
        middle, late, most = np.quantile(values, [0.5, 0.99, 1.0])
        print(f"{name:10}  median {middle:.4g}, 99 % {late:.4g}, most {most:.4g}")
