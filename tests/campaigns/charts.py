"""Stability charts of random loops: each region's count against the loop's at random points.

python -m tests.campaigns.charts --count 300 --seed 0

The points are judged by `nrdob.judge_observer`, which knows of no border. Those on a border, and
so near to one that the verdict is left open, are not judged.
"""

from __future__ import annotations

from functools import partial
from itertools import permutations
from typing import Any

import control as ct
import numpy as np

import nrdob
from nrdob import filter_family
from nrdob.design import Region, StabilityChart
from nrdob.diagram import DelayedTransferFunction

from .runner import labelled, print_tally

POINTS = 40

NAMES = ("time_constant", "gain", "delay", "lag")


def region_at(chart: StabilityChart, x: float, y: float) -> Region | None:
    """Give the region that holds a point of a chart; None on a border."""
    rows, columns = chart.labels.shape
    row, column = int(chart.y.share(y) * rows), int(chart.x.share(x) * columns)
    found = int(chart.labels[row, column])
    return chart.regions[found - 1] if found else None


def random_chart(rng: np.random.Generator) -> tuple[tuple[Any, Any, Any], dict[str, Any]]:
    """Draw process, model and filter, and the axes."""
    order = int(rng.integers(1, 4))
    lags = 10 ** rng.uniform(-1, 1, order)
    signs = np.where(rng.random(order) < 0.12, -1.0, 1.0)
    near = 10 ** rng.uniform(-0.3, 0.3, order)
    process = ct.tf([10 ** rng.uniform(-0.4, 0.4)], _from_lags(signs * lags))
    model = ct.tf([1.0], _from_lags(lags * near))
    if order > 1 and rng.random() < 0.4:
        process *= ct.tf([10 ** rng.uniform(-1, 1) * rng.choice([1, 1, -1]), 1.0], [1.0])
    longest = lags.max()
    x, y = list(permutations(NAMES, 2))[int(rng.integers(12))]
    delay = longest * 10 ** rng.uniform(-2, 0.5) if rng.random() < 0.7 else 0.0
    if rng.random() < 0.5:
        kind = rng.integers(3)
        typical = delay or longest / 10
        wait = typical * (1.0, 1 + 0.2 * rng.normal(), 10 ** rng.uniform(-0.7, 0.7))[kind]
        model = nrdob.delay(abs(wait)) * model
    n = order + int(rng.integers(0, 2))
    typical = longest * 10 ** rng.uniform(-1, 0.5)
    filter: Any = n
    if rng.random() < 0.3:
        filter = filter_family(str(rng.choice(["butterworth", "bessel"])), n)
    if "time_constant" not in (x, y):
        filter = filter_family("binomial", n) if isinstance(filter, int) else filter
        filter = filter.at(typical)
    highs = {"time_constant": typical, "gain": 1.0, "delay": longest, "lag": longest}
    axes = {}
    for which, name in (("x", x), ("y", y)):
        high = highs[name] * 10 ** rng.uniform(0, 1)
        low = high * 10 ** rng.uniform(-2, -0.5)
        if name in ("delay", "lag") and rng.random() < 0.5:
            low = 0.0
        axes[which] = (name, float(low), float(high))
    return (nrdob.delay(delay) * process if delay else process, model, filter), axes


def _from_lags(lags: np.ndarray) -> np.ndarray:
    den = np.ones(1)
    for lag in lags:
        den = np.convolve(den, [lag, 1.0])
    return den


def _chart(rng: np.random.Generator, label: str) -> str:
    blocks, axes = random_chart(rng)
    points = rng.random((POINTS, 2))
    names = "/".join(sorted(axes[which][0] for which in "xy"))
    waits = ", waits" if isinstance(blocks[1], DelayedTransferFunction) else ""
    try:
        chart = nrdob.stability_chart(*blocks, **axes)
    except ValueError as error:
        return f"refused: {str(error)[:45]}"
    except ArithmeticError as error:
        print(label, axes, error)
        return f"WRONG {names}{waits}: two counts in one region"
    for u, v in points:
        x, y = float(chart.x.value(u)), float(chart.y.value(v))
        region = region_at(chart, x, y)
        if region is None:
            continue
        count = judged(blocks, {chart.x.name: x, chart.y.name: y})
        if count not in (None, region.count):
            print(label, axes, x, y, region, count)
            return f"WRONG {names}{waits}"
    return f"{names}{waits}: right"


def judged(blocks: tuple[Any, Any, Any], given: dict[str, float]) -> float | None:
    """Count by the loop's verdict; None where it is left open."""
    process, model, filter = blocks
    delay = getattr(process, "delay", 0.0)
    process = process.tf if delay else process
    process = process * given.get("gain", 1.0) * ct.tf([1], [given.get("lag", 0.0), 1])
    if "time_constant" in given:
        family = filter_family("binomial", filter) if isinstance(filter, int) else filter
        filter = family.at(given["time_constant"])
    found = nrdob.judge_observer(nrdob.delay(given.get("delay", delay)) * process, model, filter)
    return found.closed_loop_rhp if found.stable is not None else None


campaign = partial(labelled, _chart)

if __name__ == "__main__":
    print_tally(campaign, __doc__, 300)
