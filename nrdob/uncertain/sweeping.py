"""A whole family judged: blocks of ten thousand members, many at once, the doubtful one by one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..loop import NRDOB
from .batch import Feedback, PlantBatch
from .batchmargins import MARGINS
from .plantfamily import PlantFamily, judged
from .sweeptable import SweepTable

__all__ = ["QUANTITIES", "sweep"]

QUANTITIES = ("stable", *MARGINS)  # what can be asked of every member

Columns = dict[str, NDArray[Any]]


def sweep(loop: NRDOB, family: PlantFamily, quantities: Iterable[str] = QUANTITIES) -> SweepTable:
    r"""Judge every member of a family in place of the loop's process.

    Model, controller and filter remain. Verdicts are those of `NRDOB.stability`, found for many
    members at once where Routh's test, or with dead time the turns of the argument, are certain
    however the coefficients are rounded; the others are judged one by one and flagged in the column
    "alone".

    Parameters
    ----------
    loop : NRDOB
        The loop.
    family : PlantFamily
        What the plant may be, see `nrdob.plant_family`.
    quantities : iterable of str
        Of "stable"; "ms", "gm", "pm", "delay_margin", the margins of the plant loop L as
        `nrdob.analysis.Margins` has them.

    Returns
    -------
    SweepTable
        With a row for each member.

    Raises
    ------
    TypeError, ValueError
        If there is no such quantity, or an argument is of the wrong kind.

    See Also
    --------
    nrdob.design.chart.stability_chart : exact borders in two parameters.

    Examples
    --------
    Example 3 of the paper, with a gain known to a factor of two and one more lag:

    >>> import nrdob
    >>> loop = nrdob.paper.example(3)
    >>> plants = nrdob.plant_family(loop.process, gain=(0.5, 2.0), lag=(0.0, 0.2), samples=1000)
    >>> table = nrdob.sweep(loop, plants, ("stable", "ms"))
    >>> table["stable"].size, table["gain"].min() > 0.5, int((~table["decided"]).sum())
    (1000, np.True_, 0)
    """
    if not isinstance(loop, NRDOB):
        raise TypeError(f"loop is a {type(loop).__name__}; give an nrdob.NRDOB")
    if not isinstance(family, PlantFamily):
        raise TypeError(f"family is a {type(family).__name__}; make one with nrdob.plant_family")
    asked = _asked(quantities)
    blocks = [_judge_block(loop, family, asked, block) for block in range(family.blocks)]
    joined = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    return SweepTable(family, joined, np.arange(len(family)))


def _asked(quantities: Iterable[str]) -> list[str]:
    """Give the margins asked for, in the order of the columns."""
    asked = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    if unknown := [name for name in asked if name not in QUANTITIES]:
        raise ValueError(f"there is no {unknown[0]!r} to ask; choose from {', '.join(QUANTITIES)}")
    return [name for name in MARGINS if name in asked]


def _judge_block(loop: NRDOB, family: PlantFamily, asked: list[str], block: int) -> Columns:
    """Judge the members of one block: the columns of the table."""
    drawn = family.drawn.block(block)
    plants, problems = family.plants(drawn)
    n = plants.delay.size
    reason = np.full(n, "", dtype=object)
    condition_i = loop.stability().model_loop
    if condition_i.stable:
        stable, unstable, values = judged(plants, Feedback(loop), asked)
        decided = stable | unstable
    else:
        stable, decided = np.zeros(n, dtype=bool), np.full(n, condition_i.stable is False)
        values = {name: np.full(n, np.nan) for name in asked}
        reason[:] = f"C Gm (i): {condition_i.reason}"
    alone = ~decided & (condition_i.stable is True)
    for k in np.flatnonzero(alone).tolist():
        verdict, reason[k], found = None, problems.get(k, ""), dict.fromkeys(asked, np.nan)
        if not reason[k]:
            verdict, reason[k] = _alone(loop, plants, k, found)
        stable[k], decided[k] = verdict is True, verdict is not None
        for name, value in found.items():
            values[name][k] = value
    flags = {"stable": stable, "decided": decided, "alone": alone}
    return {**drawn, **flags, **values, "reason": reason}


def _alone(
    loop: NRDOB, plants: PlantBatch, k: int, margins: dict[str, float]
) -> tuple[bool | None, str]:
    """Judge one member as `nrdob.NRDOB` does, and enter its margins where it is stable."""
    stable = None
    try:
        member = replace(loop, process=plants.plant(k))
        verdict = member.stability()
        stable = verdict.stable
        if stable and margins:
            found = member.margins().plant_loop
            margins |= {name: getattr(found, name) for name in margins}
        return stable, verdict.reason if stable is None else ""
    except (ArithmeticError, TypeError, ValueError) as error:
        return stable, str(error)
