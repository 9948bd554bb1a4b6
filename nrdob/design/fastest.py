r"""The fastest filter that meets a specification, for one plant or for the worst of a family.

Among filters of different order the fastest is the one that rejects most. At low frequency
:math:`S_d = (1 - F)/(1 + FH)` is :math:`n\lambda s/R(0)`, with the same R(0) for every filter: so
the smallest nλ wins. Of a family of plants only few decide: the fastest filter for some is tried on
all, the one with the highest peak joins them, until none is too high.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache, reduce
from math import inf
from typing import Any

import control as ct
import numpy as np

from ..diagram import FilterFamily, LowPassFilter
from .existence import stabilizing_filter_exists
from .mismatch import Mismatch
from .search import FilterSearch, checked_ms
from .timeconstants import intersection

__all__ = ["design_filter"]

EXTRA_ORDERS = 2  # how many orders above the lowest causal one are tried where none is asked for
MET = 1e-6  # by how much Ms of a plant that decides may exceed the limit, relatively
MOST = 60  # plants that may decide


def design_filter(
    process: Any, model: Any, *, max_ms: float, order: int | FilterFamily | None = None
) -> LowPassFilter | ct.TransferFunction:
    r"""Find the filter that rejects most with a limited peak of the sensitivity.

    Of one order that is the smallest λ. Orders are compared by nλ, the slope of the filter's part
    in S_d at low frequency, which says what a slow disturbance leaves behind.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`, or PlantFamily
        G, with or without dead time. Of a `nrdob.plant_family` every member must meet the
        specification.
    model : as for `nrdob.NRDOB`
        G̃, with or without dead time.
    max_ms : float
        Largest allowed peak of ``|S_d| = |1/(1 + L)|``, above 1: margins of L = F·R/(1 - F),
        R = G/G̃, are what a change of the plant uses up, those of F·H are not. It leaves a gain
        margin of Ms/(Ms - 1) and a phase margin of 2 asin(1/(2 Ms)): 2 and 29° for Ms = 2.
    order : int or FilterFamily, optional
        Order or family of the filter. By default the lowest causal order and the next two are
        compared.

    Returns
    -------
    LowPassFilter, or control.TransferFunction of another family
        The one of smallest nλ. Of several plants it is proved for these, not for what lies
        between.

    Raises
    ------
    TypeError, ValueError
        If a block, the order or the limit cannot be; if no filter stabilises the loop, or none
        meets the limit (the message gives the best that can be had, or the plants that exclude each
        other); or if every filter does, however fast, so that noise alone must choose.

    See Also
    --------
    nrdob.design.search.admissible_time_constants : all time constants of one order that meet it.

    Examples
    --------
    Example 2 of the paper, a zero in the right half plane, and if its gain is uncertain:

    >>> import control as ct
    >>> s = ct.tf('s')
    >>> G, Gm = 0.1*(100 - s)/(s + 2), 10/(s + 2)
    >>> round(design_filter(G, Gm, order=2, max_ms=1.6).time_constant, 5)
    0.01708
    >>> import nrdob
    >>> plants = nrdob.plant_family(G, gain=(0.7, 1.5), grid=2)
    >>> round(design_filter(plants, Gm, order=2, max_ms=1.6).time_constant, 5)
    0.02942
    """
    limit = checked_ms(max_ms)
    plants: Any = process if hasattr(process, "peaks") else [process]
    first = plants[0]
    orders: Iterable[Any] = (order,)
    if order is None:
        lowest = Mismatch.of(first, model).family.order
        orders = range(lowest, lowest + EXTRA_ORDERS + 1)
    searches = sorted(
        (FilterSearch.of(first, model, n, limit) for n in orders), key=lambda each: each.promise
    )
    deciding, best, slowness = [0], None, inf
    for search in searches:
        if search.promise > slowness:
            break
        found = _fastest(search, plants, deciding)
        if found is not None and search.family.order * found < slowness:
            best, slowness = search.family.at(found), search.family.order * found
    if best is None:
        raise ValueError(_refusal(searches, deciding))
    return best


def _fastest(search: FilterSearch, plants: Any, deciding: list[int]) -> float | None:
    """Find the smallest λ of one order or family; plants that decide are added to the list."""

    @cache
    def admissible(k: int) -> list[tuple[float, float]]:
        if not k:
            return search.admissible
        return FilterSearch.of(plants[k], search.model, search.family, search.max_ms).admissible

    while True:
        windows = reduce(intersection, map(admissible, deciding))
        if not windows:
            return None
        low, high = windows[0]
        however_fast = low == search.intervals[0][0]
        value = low
        if however_fast:  # much faster than the plant, or beside the floor
            speed = float(search.frequencies.mismatch.speeds.max())
            value = low * (1 + MET) or 1e-3 * min(high, 1 / speed)
        filter = search.family.at(value)
        peaks = plants.peaks(search.model, filter) if len(plants) > 1 else np.ones(1)
        k = int(peaks.argmax())
        if peaks[k] <= search.max_ms * (1 + MET) or k in deciding:
            if however_fast:
                looked_at = f" (looked at down to {low:.3g} s)" if low else ""
                raise ValueError(
                    f"Ms ≤ {search.max_ms:g} is met by every filter of {_named(search.family)}, "
                    f"however fast{looked_at}; let the noise choose, for example by the largest "
                    "|U_eta| that the actuator allows"
                )
            return value
        deciding.append(k)
        if len(deciding) > MOST:
            raise ValueError(f"over {MOST} plants would decide; give a smaller family")


def _named(family: FilterFamily) -> str:
    whose = "" if family.is_binomial else f"the {family.kind} family of "
    return f"{whose}order {family.order}"


def _refusal(searches: list[FilterSearch], deciding: list[int]) -> str:
    """Say why there is no filter, and what comes closest."""
    first = searches[0]
    orders = " or ".join(str(n) for n in sorted(search.family.order for search in searches))
    names = f"order {orders}" if first.family.is_binomial else _named(first.family)
    if len(deciding) > 1:
        return (
            f"no filter of {names} meets Ms ≤ {first.max_ms:g} with every plant: members "
            f"{', '.join(map(str, deciding))} exclude each other; relax the specification, or "
            "choose another model"
        )
    stable = [search for search in searches if search.intervals]
    if not stable:
        answer = stabilizing_filter_exists(first.process, first.model)
        reason = "" if answer.holds else f" ({answer.reason})"
        return f"no filter of {names} stabilises the loop{reason}: choose another model"
    search = min(stable, key=lambda search: search.closest[1].ms)
    time_constant, best = search.closest
    binomial = search.family.is_binomial
    which = f"n = {search.family.order}" if binomial else _named(search.family)
    return (
        f"no filter of {names} meets Ms ≤ {search.max_ms:g}; closest comes λ = "
        f"{time_constant:.4g} s, {which}, with Ms = {best.ms:.4g}, "
        f"GM = {abs(best.gm_db):.4g} dB, PM = {best.pm:.4g}°: relax the specification or choose "
        "another model"
    )
