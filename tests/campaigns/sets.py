"""Sets of stabilising filters against the roots beside every end, and on a scan.

python -m tests.campaigns.sets --count 2000 --seed 0
"""

from __future__ import annotations

from functools import partial

import numpy as np

import nrdob
from nrdob.design.mismatch import Mismatch
from nrdob.design.mismatchgrid import Frequencies

from .plants import plant_and_model
from .runner import labelled, print_tally

BESIDE = 1e-5
"""How far inside and outside an end the roots are counted."""

SCANNED = 24


def floor_of(process, model, filters):
    """Give the time constant down to which sets are complete by default."""
    return Frequencies(Mismatch.of(process, model, filters)).lowest_floor


def _set(rng: np.random.Generator, label: str) -> str:
    kind, process, model = plant_and_model(rng)
    order = Mismatch.of(process, model).family.order + int(rng.integers(0, 3))
    try:
        intervals = nrdob.stabilizing_time_constants(process, model, order)
    except ArithmeticError:
        return f"{kind}: refused"
    mismatch = Mismatch.of(process, model, order)
    ends = {end for ends in intervals for end in ends if 0 < end < np.inf}
    beside = [end * (1 + side * BESIDE) for end in ends for side in (-1, 1)]
    slow, fast = 1 / mismatch.speeds.min(), 1 / mismatch.speeds.max()
    floor = floor_of(process, model, order)
    scanned = np.geomspace(max(fast / 100, 1.01 * floor), max(slow * 100, 2 * floor), SCANNED)
    for value in [*beside, *scanned.tolist()]:
        if value <= floor * (1 + 2 * BESIDE):
            continue
        p = mismatch.p_B(value)
        try:
            roots = p.roots
        except ArithmeticError:  # so long a dead time that its roots are out of reach
            continue
        if p.near_axis(roots).any():
            continue
        if any(low < value < high for low, high in intervals) != (not (roots.real > 0).any()):
            print(label, kind, order, intervals, value)
            return f"WRONG {kind}"
    return f"{kind}: right"


campaign = partial(labelled, _set)

if __name__ == "__main__":
    print_tally(campaign, __doc__, 2000)
