"""The fastest filter whose worst plant meets a specification.

For each plant the time constants that will do are known exactly (`admissible_time_constants`), and
what several plants allow is what they have in common. Of a large family only few members decide:
the fastest filter for some is tried on all, the one that it serves worst joins them, until none is
served too badly.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, reduce
from typing import Any

import numpy as np

from ..analysis import judge_observer, quotient_margins
from ..design import (
    UNSTABLE,
    Mismatch,
    Specification,
    admissible_time_constants,
    intersection,
)
from ..diagram import LowPassFilter, ObserverEquations
from ..numerics import FloatArray
from .family import Family
from .manymargins import many_margins
from .plants import Plants
from .verdicts import SLAB, Feedback

__all__ = ["design_filter_for"]

EXTRA_ORDERS = 2
"""Orders beyond the lowest causal one that are compared by default."""

MET = 1e-6
"""By how little the slack of a plant may fall short that decides itself."""

MOST = 60
"""Plants that may decide."""


def design_filter_for(
    plants: Family | Sequence[Any],
    model: Any,
    *,
    order: int | Sequence[int] | None = None,
    max_ms: float | None = None,
    min_gm_db: float | None = None,
    min_pm_deg: float | None = None,
) -> LowPassFilter:
    """Find the fastest filter with which every plant meets a specification.

    Parameters
    ----------
    plants : Family, or sequence of processes as for `nrdob.NRDOB`
        What the plant may be.
    model : as for `nrdob.NRDOB`
        The model.
    order : int or several, optional
        Order of the filter; by default the lowest causal one and the next two are compared.
    max_ms, min_gm_db, min_pm_deg : float, optional
        What is asked of the plant loop of every plant, as for `nrdob.design_filter`.

    Returns
    -------
    LowPassFilter
        The one of smallest nλ. Of a family it is proved for its members, not for what lies between.

    Raises
    ------
    TypeError, ValueError
        As `nrdob.design_filter`; if no filter will do for all, with plants that exclude each other.

    See Also
    --------
    nrdob.design.search.design_filter : for one plant.

    Examples
    --------
    >>> import nrdob
    >>> loop = nrdob.paper.example(2)
    >>> alone = nrdob.design_filter(loop.process, loop.model, order=2, max_ms=1.6)
    >>> plants = nrdob.family(loop.process, gain=(0.7, 1.5), samples=200)
    >>> worst = design_filter_for(plants, loop.model, order=2, max_ms=1.6)
    >>> alone.time_constant < worst.time_constant
    True
    """
    specification = Specification(max_ms, min_gm_db, min_pm_deg)
    members = _Members(plants, model, specification)
    if order is None:
        lowest = Mismatch.of(members.plant(0), model).order
        orders = list(range(lowest, lowest + EXTRA_ORDERS + 1))
    else:
        orders = [order] if isinstance(order, int) else list(order)
    best: LowPassFilter | None = None
    for n in orders:
        found = members.fastest(n, best)
        if found:
            best = found
    if best is None:
        named = ", ".join(map(str, members.deciding))
        raise ValueError(
            f"no filter of order {' or '.join(map(str, orders))} meets {specification} with every "
            f"plant: members {named} exclude each other; relax the specification, or choose "
            "another model"
        )
    return best


class _Members:
    """The plants, and how well filters serve them."""

    def __init__(self, plants: Any, model: Any, specification: Specification) -> None:
        if not len(plants):
            raise ValueError("there are no plants")
        self.given, self.model, self.specification = plants, model, specification
        self.deciding: list[int] = [0]

        @cache
        def allowed(k: int, order: int) -> list[tuple[float, float]]:
            return admissible_time_constants(
                self.plant(k), model, order, max_ms=specification.max_ms,
                min_gm_db=specification.min_gm_db, min_pm_deg=specification.min_pm_deg,
            )  # fmt: skip

        self.allowed = allowed

    def plant(self, k: int) -> Any:
        return self.given[k]

    def fastest(self, order: int, best: LowPassFilter | None) -> LowPassFilter | None:
        """Find the fastest filter of one order, if it is faster than the best so far."""
        while True:
            windows = reduce(intersection, [self.allowed(k, order) for k in self.deciding])
            if not windows:
                return None
            time_constant = windows[0][0]
            if best and order * time_constant >= best.order * best.time_constant:
                return None
            if time_constant == 0:
                time_constant = 1e-3 * min(windows[0][1], 1.0)
                if self._worst(LowPassFilter(time_constant, order))[1] >= -MET:
                    raise ValueError(
                        f"{self.specification} is met with every plant by filters of order {order} "
                        "however fast; let the noise choose"
                    )
            filter = LowPassFilter(time_constant, order)
            k, slack = self._worst(filter)
            if slack >= -MET or k in self.deciding:
                return filter
            self.deciding.append(k)
            if len(self.deciding) > MOST:
                raise ValueError(f"over {MOST} plants would decide; give a smaller family")

    def _worst(self, filter: LowPassFilter) -> tuple[int, float]:
        """Find the plant that is served worst, and its slack."""
        observer = ObserverEquations(self.plant(0), self.model, filter)
        feedback = Feedback(observer)
        worst, least, start = 0, np.inf, 0
        for plants in self._blocks():
            slacks = self._slacks(feedback, plants, filter)
            k = int(slacks.argmin())
            if slacks[k] < least:
                worst, least = start + k, float(slacks[k])
            start += slacks.size
        return worst, least

    def _blocks(self) -> list[Plants]:
        if not isinstance(self.given, Family):
            return [Plants.of_blocks(list(self.given))]
        drawn = self.given.drawn
        return [self.given.plants(drawn.block(k))[0] for k in range(self.given.blocks)]

    def _slacks(self, feedback: Feedback, plants: Plants, filter: LowPassFilter) -> FloatArray:
        asked = self.specification
        slacks = np.full(plants.delay.size, np.nan)
        for chosen, few in plants.groups():
            stable, unstable = feedback.verdicts(few)
            slacks[chosen[unstable]] = UNSTABLE
            here = np.flatnonzero(stable)
            for first in range(0, here.size, SLAB):
                part = here[first : first + SLAB]
                found, trusted = many_margins(feedback, few.of(part))
                with np.errstate(divide="ignore"):
                    gm_db = np.abs(20 * np.log10(found["gm"]))
                slack = asked.slacks(found["ms"], gm_db, found["pm"])
                slacks[chosen[part]] = np.where(trusted, slack, np.nan)
        for k in np.flatnonzero(np.isnan(slacks)).tolist():
            loop = ObserverEquations(plants.plant(k), self.model, filter)
            verdict = judge_observer(loop.process, self.model, filter)
            slacks[k] = asked.slack(quotient_margins(loop.L, verdict.stable))
        return slacks
