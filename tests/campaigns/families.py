"""Sets of families of filters against the verdict beside every end, and on a scan.

python -m tests.campaigns.families --count 500 --seed 0

Some of the models wait: as long as the process, nearly so, or as they like.
"""

from __future__ import annotations

from functools import partial

import control as ct
import numpy as np

import nrdob
from nrdob import filter_family
from nrdob.diagram import DelayedTransferFunction, FilterFamily
from nrdob.sampling import random_block

from .plants import plant_and_model
from .runner import labelled, print_tally
from .sets import floor_of

BESIDE = 1e-5
"""How far inside and outside an end the loop is judged."""

SCANNED = 16

KINDS = ["butterworth", "bessel", "ramp", "interpolating", "own"]


def _loop(rng: np.random.Generator):
    """Plant and model: near each other, or anything, some of them stiff or resonant."""
    if rng.random() < 0.3:
        return plant_and_model(rng)[1:]
    model = random_block(rng, 3)
    process = random_block(rng, 3)
    if rng.random() < 0.5:
        num, den = model.num[0][0], model.den[0][0]
        process = ct.tf(num * rng.uniform(0.5, 1.5), den * (1 + 0.1 * rng.normal(size=den.size)))
    return nrdob.delay(10 ** rng.uniform(-2, 0)) * process if rng.random() < 0.4 else process, model


def _family(rng: np.random.Generator, model) -> FilterFamily:
    kind = KINDS[int(rng.integers(len(KINDS)))]
    least = max(1, model.den[0][0].size - model.num[0][0].size)
    order = least + int(rng.integers(0, 3))
    if kind == "ramp":
        return filter_family(kind, order + 1)
    if kind == "interpolating":
        return filter_family(kind, model=model, ramp=int(rng.integers(1, 3)))
    if kind == "own":  # one lag that is fixed, behind those that are chosen
        x = rng.uniform(0.1, 2)
        den = np.zeros((order + 2, order + 1))
        lags = np.poly(-np.ones(order))
        for k, c in enumerate(lags):
            den[k, k] += x * c
            den[k + 1, k] += c
        return FilterFamily(kind, np.ones((1, 1)), den)
    return filter_family(kind, order)


def _waiting(rng: np.random.Generator, process, model):
    """Let some of the models wait."""
    if rng.random() < 0.5:
        return model
    delay = getattr(process, "delay", 0.0) or 10 ** rng.uniform(-2, 0)
    kind = rng.integers(3)
    wait = delay * (1.0, 1 + 0.1 * rng.normal(), 10 ** rng.uniform(-1, 1))[kind]
    return nrdob.delay(abs(wait)) * model


def _set(rng: np.random.Generator, label: str) -> str:
    process, model = _loop(rng)
    try:
        family = _family(rng, model)
        model = _waiting(rng, process, model)
        intervals = nrdob.stabilizing_time_constants(process, model, family)
        floor = floor_of(process, model, family)
    except (ArithmeticError, ValueError) as error:
        return f"refused: {type(error).__name__}"
    ends = {end for ends in intervals for end in ends if 0 < end < np.inf}
    beside = [end * (1 + side * BESIDE) for end in ends for side in (-1, 1)]
    scanned = np.geomspace(max(1e-3, 1.01 * floor), max(1e2, 2 * floor), SCANNED)
    for value in [*beside, *scanned.tolist()]:
        if value <= floor * (1 + 2 * BESIDE):
            continue
        stable = nrdob.judge_observer(process, model, family.at(value)).stable
        if stable is None:
            continue
        if any(low < value < high for low, high in intervals) != stable:
            print(label, family, intervals, value)
            return f"WRONG {family.kind}"
    waits = isinstance(model, DelayedTransferFunction)
    return f"{family.kind}: right{', waits' if waits else ''}"


campaign = partial(labelled, _set)

if __name__ == "__main__":
    print_tally(campaign, __doc__, 500)
