"""Sets of ωo and b0 that make linear ADRC stable, against the roots beside every end and on a scan.

python -m tests.campaigns.adrc --count 500 --seed 0
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np

from nrdob.alternatives import adrc_stabilizing_bandwidths, adrc_stabilizing_gains, linear_adrc
from nrdob.numerics import QuasiPolynomial

from .plants import plant_and_model
from .runner import print_tally

BESIDE = 1e-5
"""How far inside and outside an end the roots are counted."""

SCANNED = 20
"""Values in between."""


def campaign(count: int, seed: int) -> Counter[str]:
    """Count what became of random sets; "WRONG" begins the name of every fault."""
    rng = np.random.default_rng(seed)
    return sum((_sets(rng, f"seed {seed}, number {k}") for k in range(count)), Counter())


def _sets(rng: np.random.Generator, label: str) -> Counter[str]:
    kind, process, _ = plant_and_model(rng)
    order = int(rng.integers(1, 3))
    b0, wo, wc = rng.choice([-1, 1]) * 10 ** rng.uniform(-2, 2), *10 ** rng.uniform(-1, 1.5, 2)
    b0, wo, wc = float(b0), float(wo), float(wc)

    def stable(bandwidth: float, gain: float) -> bool | None:
        return _stable(linear_adrc(process, order, gain, bandwidth, wc).p_B)

    highest = 300.0
    asked: dict[str, tuple[Callable[[], list[tuple[float, float]]], Callable[[float], bool | None]]]
    asked = {
        "ωo": (
            lambda: adrc_stabilizing_bandwidths(process, order, b0, wc, highest=highest),
            lambda x: stable(x, b0) if 0 < x < highest else None,
        ),
        "b0": (
            lambda: adrc_stabilizing_gains(process, order, wo, wc),
            lambda x: stable(wo, x) if x else None,
        ),
    }
    tally: Counter[str] = Counter()
    for name, (give, judge) in asked.items():
        try:
            found = give()
        except (ValueError, ArithmeticError):
            tally[f"{name} {kind}: refused"] += 1
            continue
        ends = {end for ends in found for end in ends if 0 < abs(end) < np.inf}
        beside = [end * (1 + side * BESIDE) for end in ends for side in (-1, 1)]
        scan = np.geomspace(1e-3, 1e3, SCANNED) * (np.sign(b0) if name == "b0" else 1)
        wrong = [
            value for value in [*beside, *scan.tolist()]
            if judge(value) not in (None, any(low < value < high for low, high in found))
        ]  # fmt: skip
        if wrong:
            print(label, kind, name, order, b0, wo, wc, found, wrong)
        tally[f"{'WRONG ' if wrong else ''}{name} {kind}: {'' if wrong else 'right'}"] += 1
    return tally


def _stable(p: QuasiPolynomial) -> bool | None:
    """By the roots, which know nothing of crossings and turns; None where they cannot be told."""
    try:
        roots = p.roots
    except ArithmeticError:
        return None
    if not roots.size or p.near_axis(roots).any():
        return None if roots.size else True
    return not (roots.real > 0).any()


if __name__ == "__main__":
    print_tally(campaign, __doc__, 500)
