"""A whole family judged: blocks of ten thousand members, many at once, the doubtful one by one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..loop import NRDOB
from ..numerics import IntArray
from .batch import PlantBatch
from .batchmargins import MARGINS, batch_margins
from .batchstability import SLAB, Feedback
from .plantfamily import PlantFamily
from .sweeptable import SweepTable

__all__ = ["QUANTITIES", "sweep"]

QUANTITIES = ("stable", *MARGINS)
"""What can be asked of every member."""

Columns = dict[str, NDArray[Any]]


class _Job(NamedTuple):
    """What is the same for all blocks: loop, plants and what is asked."""

    loop: NRDOB
    family: PlantFamily
    quantities: tuple[str, ...]


def sweep(
    loop: NRDOB,
    family: PlantFamily,
    quantities: Iterable[str] = QUANTITIES,
) -> SweepTable:
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
    Example 3 of the paper, if the gain of the plant is known to a factor of two, and it has one
    more lag:

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
    job = _Job(loop, family, asked)
    blocks = [_judge_block(job, block) for block in range(family.blocks)]
    joined = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    return SweepTable(family, joined, np.arange(len(family)))


def _asked(quantities: Iterable[str]) -> tuple[str, ...]:
    asked = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    if unknown := [name for name in asked if name not in QUANTITIES]:
        raise ValueError(f"there is no {unknown[0]!r} to ask; choose from {', '.join(QUANTITIES)}")
    return tuple(name for name in QUANTITIES if name in (*asked, "stable"))


def _judge_block(job: _Job, block: int) -> Columns:
    """Judge the members of one block: the columns of the table."""
    drawn = job.family.drawn.block(block)
    plants, problems = job.family.plants(drawn)
    found = _Found(job, plants, problems)
    condition_i = job.loop.stability().model_loop
    if condition_i.stable:
        feedback = Feedback(job.loop)
        for chosen, few in plants.groups():
            found.judge(feedback, chosen, few)
        for k in np.flatnonzero(~found.decided).tolist():
            found.judge_alone(k)
    else:
        found.all_alike(condition_i.stable is False, f"C Gm (i): {condition_i.reason}")
    return drawn | found.columns


class _Found:
    """What is known so far about the members of a block."""

    def __init__(self, job: _Job, plants: PlantBatch, problems: dict[int, str]) -> None:
        self.job, self.plants, self.problems = job, plants, problems
        n = plants.delay.size
        self.stable, self.decided, self.alone = (np.zeros(n, dtype=bool) for _ in range(3))
        self.reason = np.full(n, "", dtype=object)
        self.asked = [name for name in QUANTITIES if name in job.quantities and name != "stable"]
        self.values = {name: np.full(n, np.nan) for name in self.asked}

    @property
    def columns(self) -> Columns:
        flags = {"stable": self.stable, "decided": self.decided, "alone": self.alone}
        return {**flags, **self.values, "reason": self.reason}

    def all_alike(self, decided: bool, reason: str) -> None:
        """Write down what no plant can change."""
        self.decided[:] = decided
        self.reason[:] = reason

    def judge(self, feedback: Feedback, chosen: IntArray, plants: PlantBatch) -> None:
        """Judge plants of the same degrees together."""
        stable, unstable = feedback.verdicts(plants)
        self.stable[chosen], self.decided[chosen] = stable, stable | unstable
        if not self.asked:
            return
        here = np.flatnonzero(stable)
        for first in range(0, here.size, SLAB):
            few = here[first : first + SLAB]
            self._ask(feedback, chosen[few], plants.of(few))

    def _ask(self, feedback: Feedback, chosen: IntArray, plants: PlantBatch) -> None:
        found, trusted = batch_margins(feedback, plants)
        for name in self.asked:
            self.values[name][chosen] = found[name]
        for k in chosen[~trusted].tolist():
            self.judge_alone(k)

    def _member(self, k: int) -> NRDOB:
        loop = self.job.loop
        plant = self.plants.plant(k)
        return NRDOB(plant, loop.model, loop.controller, loop.filter, loop.keep_factors)

    def judge_alone(self, k: int) -> None:
        """Judge one member as `nrdob.NRDOB` does."""
        self.alone[k] = True
        if k in self.problems:
            self.reason[k] = self.problems[k]
            return
        try:
            member = self._member(k)
            verdict = member.stability()
            self.stable[k] = verdict.stable is True
            self.decided[k] = verdict.stable is not None
            if verdict.stable is None:
                self.reason[k] = verdict.reason
            if verdict.stable and self.asked:
                margins = member.margins().plant_loop
                for name in self.asked:
                    self.values[name][k] = getattr(margins, name)
        except (ArithmeticError, TypeError, ValueError) as error:
            self.reason[k] = str(error)
