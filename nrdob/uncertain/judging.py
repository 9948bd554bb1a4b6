"""One block of a family judged: many at once, and one by one those for whom that is not enough."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..design import step_peak
from ..loop import NRDOB
from ..numerics import BoolArray, FloatArray, IntArray
from .family import Family
from .manymargins import MARGINS, many_margins
from .manysteps import many_peaks
from .plants import Plants
from .verdicts import SLAB, Feedback

__all__ = ["QUANTITIES", "Job", "judge_block"]

QUANTITIES = ("stable", *MARGINS, "peak_d")
"""What can be asked of every member."""

Columns = dict[str, NDArray[Any]]


class Job(NamedTuple):
    """What is the same for all blocks.

    Attributes
    ----------
    loop : NRDOB
        Model, controller and filter; its process does not matter.
    family : Family
        The plants.
    quantities : tuple of str
        What is asked, see `QUANTITIES`.
    """

    loop: NRDOB
    family: Family
    quantities: tuple[str, ...]


def judge_block(job: Job, block: int) -> Columns:
    """Judge the members of one block.

    Parameters
    ----------
    job : Job
        Loop, family and quantities.
    block : int
        Which.

    Returns
    -------
    dict of str: (n,) array
        The columns of the table.
    """
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

    def __init__(self, job: Job, plants: Plants, problems: dict[int, str]) -> None:
        self.job, self.plants, self.problems = job, plants, problems
        n = plants.delay.size
        self.stable, self.decided, self.alone = (np.zeros(n, dtype=bool) for _ in range(3))
        self.reason = np.full(n, "", dtype=object)
        self.asked = [name for name in QUANTITIES if name in job.quantities and name != "stable"]
        self.values = {name: np.full(n, np.nan) for name in self.asked}
        self.margins = [name for name in self.asked if name in MARGINS]

    @property
    def columns(self) -> Columns:
        flags = {"stable": self.stable, "decided": self.decided, "alone": self.alone}
        return {**flags, **self.values, "reason": self.reason}

    def all_alike(self, decided: bool, reason: str) -> None:
        """Write down what no plant can change."""
        self.decided[:] = decided
        self.reason[:] = reason

    def judge(self, feedback: Feedback, chosen: IntArray, plants: Plants) -> None:
        """Judge plants of the same degrees together."""
        stable, unstable = feedback.verdicts(plants)
        self.stable[chosen], self.decided[chosen] = stable, stable | unstable
        if not self.asked:
            return
        here = np.flatnonzero(stable)
        for first in range(0, here.size, SLAB):
            few = here[first : first + SLAB]
            self._ask(feedback, chosen[few], plants.of(few))

    def _ask(self, feedback: Feedback, chosen: IntArray, plants: Plants) -> None:
        trusted: BoolArray = np.ones(chosen.size, dtype=bool)
        found: dict[str, FloatArray] = {}
        if self.margins:
            found, trusted = many_margins(feedback, plants)
        if "peak_d" in self.asked:
            found["peak_d"], known = self._peaks(feedback, chosen, plants)
            trusted &= known
        for name in self.asked:
            self.values[name][chosen] = found[name]
        for k in chosen[~trusted].tolist():
            self.judge_alone(k)

    def _peaks(
        self, feedback: Feedback, chosen: IntArray, plants: Plants
    ) -> tuple[FloatArray, BoolArray]:
        """Find peaks together, or with a dead time by one simulation each."""
        if not (feedback.waits or plants.delay.any()):
            return many_peaks(feedback, plants)
        found = np.full(chosen.size, np.nan)
        for i, k in enumerate(chosen.tolist()):
            try:
                found[i] = step_peak(self._member(k), "d", "y")
            except ArithmeticError:  # said again, as its reason, where it is judged alone
                continue
        return found, ~np.isnan(found)

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
            if verdict.stable and self.margins:
                margins = member.margins().plant_loop
                for name in self.margins:
                    self.values[name][k] = getattr(margins, name)
            if verdict.stable and "peak_d" in self.asked:
                self.values["peak_d"][k] = step_peak(member, "d", "y")
        except (ArithmeticError, TypeError, ValueError) as error:
            self.reason[k] = str(error)
