"""Filter and controller for a process and its model: how fast each may be, and why."""

from __future__ import annotations

from math import log10
from operator import itemgetter
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

from ..design import admissible_time_constants, design_controller, design_filter
from ..diagram import FilterFamily, LowPassFilter, as_fraction, filter_fraction, undelayed
from ..loop import NRDOB
from ..numerics import number

__all__ = ["controller_for", "filter_for", "slowest_lag"]

ORIGIN = 1e-9  # size of a root, against the largest, that is taken for 0
# Largest gain from noise to u against that at rest, where only noise limits the filter.
NOISE_GAIN = 10.0
# Crossovers tried for the controller, against the bandwidth 1/(nλ) of the observer.
SPEEDS = (1.0, 0.5, 0.2, 0.1, 0.05, 2.0, 5.0)
MARGINS = (60.0, 30.0, 10.0)  # phase margins tried for it, in degrees
CALM = 2.0  # largest sensitivity peak of the controller with the model that is not called swinging
INSIDE = 0.5  # of the longest time constant that will do, the longest that is taken
RELAXED = (1.0, 1.2, 1.5, 2.0, 3.0, 5.0)  # times the peak aimed at that are tried, until one is met


def slowest_lag(process: Any) -> float:
    """Largest time constant of poles and zeros, in seconds; 0 where there is none."""
    fraction = as_fraction(undelayed(process)[0], "process", proper=False)
    sizes = np.abs(np.concatenate([np.roots(part) for part in fraction]))
    return float(max(1 / sizes[sizes > ORIGIN * sizes.max(initial=0.0)], default=0.0))


def _slowest(process: Any) -> float:
    """Largest time constant, dead time included, in seconds; 1 where there is none."""
    return max(slowest_lag(process), undelayed(process)[1]) or 1.0


def filter_for(
    process: Any, model: Any, family: FilterFamily, max_ms: float
) -> tuple[LowPassFilter | ct.TransferFunction | None, str, list[str]]:
    """Choose the fastest filter that keeps the peak; where all do, what the noise allows."""
    of_order, reason = _named(family), ""
    for times in RELAXED:
        limit = max_ms * times
        try:
            found = design_filter(process, model, order=family, max_ms=limit)
        except ValueError as error:
            reason = reason or str(error)
            if "however fast" in reason:
                return *_by_noise(process, model, family, max_ms), []
            continue
        if not reason:
            peak = f"whose plant loop has a sensitivity peak of at most {max_ms:g}"
            return found, f"Filter: the fastest {of_order} {peak}.", []
        said = f"none {of_order} keeps the sensitivity peak below {max_ms:g}"
        touchy = f"No filter with this model meets a sensitivity peak of {max_ms:g}: it is touchy."
        return found, f"Filter: {said}; this is the fastest below {limit:g}.", [touchy]
    unusable = f"No filter {of_order} gives a loop that could be used with this model: {reason}."
    return None, f"Filter: {reason}.", [unusable]


def _named(family: FilterFamily) -> str:
    kind = "" if family.is_binomial else f"the {family.kind} filters of "
    return f"of {kind}order {family.order}"


def _by_noise(
    process: Any, model: Any, family: FilterFamily, max_ms: float
) -> tuple[LowPassFilter | ct.TransferFunction, str]:
    """Choose among filters that may be as fast as one likes: F/model must not amplify too much."""
    slow = _slowest(process)
    longest = admissible_time_constants(process, model, family, max_ms=max_ms)[0][1]
    omega = np.geomspace(1e-4, 1e6, 2000) / slow
    Gm = as_fraction(undelayed(model)[0], "model")
    inverse = np.abs(np.polyval(Gm.den, 1j * omega) / np.polyval(Gm.num, 1j * omega))
    allowed = NOISE_GAIN * abs(Gm.den[-1] / Gm.num[-1])

    def excess(exponent: float) -> float:
        F = filter_fraction(family.at(10**exponent))
        passed = inverse * np.abs(np.polyval(F.num, 1j * omega) / np.polyval(F.den, 1j * omega))
        return float(log10(passed.max() / allowed))

    fast, late = log10(slow) - 4, log10(slow) + 4
    if allowed > 0 and excess(fast) > 0 > excess(late):
        quiet = 10 ** brentq(excess, fast, late, xtol=1e-3)
        said = (
            f"so the noise must choose: F/G̃ passes noise to u at most {NOISE_GAIN:g} times as "
            "strongly as it passes a constant."
        )
    else:
        quiet = slow / 10
        said = (
            "and noise does not say how fast it must be: this is a tenth of the plant's slowest "
            "time constant (of 1 s where it has none). Choose your own."
        )
    if quiet > INSIDE * longest:
        quiet = INSIDE * longest
        said = "and this is a slow one: a faster one would pass even more noise to u."
    opening = f"every fast one {_named(family)} keeps the sensitivity peak below {max_ms:g}"
    return family.at(float(f"{quiet:.3g}")), f"Filter: {opening}, {said}"


def controller_for(
    model: Any, filter: Any, calm: bool = False
) -> tuple[ct.TransferFunction | None, str]:
    """Design a calm PI by its phase margin or the observer's bandwidth; if none is, the calmest."""
    prompt = undelayed(model)[0]
    known = isinstance(filter, LowPassFilter)
    speed = 1 / (filter.order * filter.time_constant if known else _slowest(prompt))
    asked: list[tuple[float | None, float]] = [] if calm else [(None, MARGINS[0])]
    asked += [(share * speed, margin) for margin in MARGINS for share in SPEEDS]
    tried: list[tuple[float, ct.TransferFunction, str]] = []
    for limit in (CALM, None):
        for bandwidth, margin in asked:
            try:
                found = design_controller(
                    prompt, bandwidth=bandwidth, phase_margin=margin, max_ms=limit
                )
            except ValueError:
                continue
            how = (
                f"the PI of largest integral gain with a phase margin of {margin:g}° on the model"
                if bandwidth is None
                else f"designed for a crossover at {number(bandwidth)} rad/s, near the bandwidth "
                f"of the observer, with a phase margin of {margin:g}° on the model"
            )
            ms = NRDOB(prompt, prompt, found, filter).margins().model_loop.ms
            if limit is not None:
                if bandwidth is None and ms > (1 - 1e-3) * limit:
                    how += f"; its gain is lowered until the sensitivity peaks at {CALM:g}"
                return found, f"Controller: {how}."
            tried.append((ms, found, f"Controller: {how}."))
    if tried:
        return min(tried, key=itemgetter(0))[1:]
    return None, "Controller: none of I, PI and PID was found that stabilises this model."
