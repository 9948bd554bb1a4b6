"""The largest sampling time at which a loop is stable."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import inf

import numpy as np
from scipy.optimize import brentq

from ..analysis import stability
from ..diagram import DelayedTransferFunction, LoopEquations
from ..numerics import FloatArray
from .closedloop import first_unstable
from .sampled import SampledLoop

__all__ = ["largest_sampling_time"]

STEP = 1.04  # ratio of neighbouring sampling times in the search
FASTEST, SLOWEST = 0.02, 100.0  # sampling times, against the shortest and longest time of the loop
SAMPLES = 100  # samples in the dead time at the shortest sampling time, at most
REFINED = 1e-12  # relative error of the end


def largest_sampling_time(
    loop: LoopEquations, method: str = "tustin", computation_delay: float = 0.0
) -> float:
    """Find the sampling time up to which a stable loop stays stable on a processor, in seconds.

    For every shorter one the sampled loop is stable. The spectral radius is evaluated on a 4 % grid
    of sampling times, from a fiftieth of the shortest time of the loop (but no more than 100
    samples in a dead time) on; an unstable interval narrower than 4 % can be missed, and shorter
    sampling times are taken for continuous time. The end itself is refined to rounding and counted
    on both of its sides, by the argument on the unit circle.

    Parameters
    ----------
    loop : NRDOB
        Stable in continuous time, with the delay of the computation, too.
    method, computation_delay : {"tustin", "zoh"}, float
        As in `NRDOB.sampled`; "zoh" may end where it is refused.

    Returns
    -------
    float
        Seconds; inf if the loop is stable for all sampling times up to a hundred times its longest
        time.

    Raises
    ------
    ValueError, ArithmeticError
        If the loop is not stable in continuous time, or "zoh" is refused; if the loop is not
        stable at the shortest sampling time, or the counts do not confirm the end.

    Examples
    --------
    >>> from nrdob import paper
    >>> loop = paper.example(1)
    >>> round(largest_sampling_time(loop) / loop.filter.time_constant, 4)
    4.0275
    """
    SampledLoop(loop, 1.0, "tustin", computation_delay)  # refuses bad input
    late = DelayedTransferFunction(loop.fractions.G, loop.delay + computation_delay)
    verdict = stability(replace(loop, process=late))
    if not verdict.stable:
        with_delay = f" with {computation_delay:g} s of computation" if computation_delay else ""
        raise ValueError(
            f"the loop is not stable in continuous time{with_delay}, so that no sampling time is "
            f"short enough: {verdict.reason}"
        )

    @cache
    def excess(dt: float) -> float:
        try:
            sampled = SampledLoop(loop, dt, method, computation_delay)
        except ValueError:  # "zoh" where it is unsound
            return inf
        return sampled.closed_loop.spectral_radius - 1

    longest = max(loop.delay + computation_delay, loop.model_delay)
    times = _times(loop, longest)
    shortest = SampledLoop(loop, float(times[0]), method, computation_delay)
    verdict = shortest.stability()
    if verdict.stable is False or excess(shortest.dt) >= 0:
        raise ArithmeticError(
            f"the loop is stable in continuous time, but not clearly at dt = {shortest.dt:g} s, "
            f"the shortest in the search: {verdict.reason}; judge the dt at hand, by "
            "loop.sampled(dt).stability()"
        )
    bracket = first_unstable(excess, times)
    if bracket is None:
        return inf
    low, high = bracket
    end = float(brentq(lambda dt: min(excess(dt), 1.0), low, high, xtol=REFINED * high))
    beside = end * (1 - 1e-6), end * (1 + 1e-6)
    try:
        loops = [SampledLoop(loop, dt, method, computation_delay) for dt in beside]
    except ValueError:  # it ends where "zoh" is refused
        return end
    inside, outside = (each.stability().stable for each in loops)
    if inside is not True or outside is True:
        raise ArithmeticError(
            f"the loop seems to become unstable at dt = {end:.9g} s, but the counts beside it "
            "do not confirm it"
        )
    return end


def _times(loop: LoopEquations, delay: float) -> FloatArray:
    """Return the sampling times of the search, from short to long."""
    rates = [np.abs(p.roots) for p in (loop.p_A, loop.p_B)]
    rates += [np.abs(np.roots(p)) for fraction in loop.fractions for p in fraction]
    found = np.concatenate(rates)
    lengths = np.append(1 / found[found > 0], [delay] if delay else [])
    first = max(FASTEST * lengths.min(), delay / SAMPLES)
    last = SLOWEST * lengths.max()
    return np.geomspace(first, last, max(2, int(np.log(last / first) / np.log(STEP)) + 1))
