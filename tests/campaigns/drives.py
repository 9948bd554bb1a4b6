"""Random drives with friction against SciPy's `solve_ivp` with events.

    python -m tests.campaigns.drives --count 200 --seed 0

One mass or two, with and without Stribeck's slope, stiction above Coulomb friction, viscous
friction and damping; torques around the friction, so that they stick and slip.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from .drivesolver import difference, moved, random_case
from .runner import print_tally

AGREEMENT = 1e-7


def campaign(count: int, seed: int) -> dict[str, int]:
    """Count how many drives move alike, and how they moved."""
    found: Counter[str] = Counter()
    for case in (random_case(np.random.default_rng([seed, i])) for i in range(count)):
        apart = difference(case)
        found["alike to 1e-7" if apart <= AGREEMENT else "NOT alike"] += 1
        found["alike to 1e-10"] += apart <= 1e-10
        found[f"of {type(case.inertia).__name__}"] += 1
        events = moved(case)
        found["that stuck and slipped"] += events > 0
        found["events of friction"] += events
    return dict(found)


if __name__ == "__main__":
    print_tally(campaign, __doc__ or "", 200)
