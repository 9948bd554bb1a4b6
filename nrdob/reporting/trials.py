"""A loop tried on every process that a record does not exclude."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import inf, isfinite

from ..loop import NRDOB
from ..measured import Identification
from ..numerics import number
from .html import Table

__all__ = ["Trial", "in_words", "trial_table", "trials_on"]

TOLERATED = 2.5  # largest sensitivity peak on a process that the record does not exclude
SHOWN = 4  # corners in the table, worst first


@dataclass(frozen=True)
class Trial:
    """The proposed loop on a process that the record does not exclude.

    The process is a structure or a corner, numbers at the ends of their intervals; stable is None
    if that could not be decided, and the sensitivity peak infinite where the loop is not stable.
    """

    process: str
    corner: bool
    stable: bool | None
    ms: float

    @property
    def holds(self) -> bool:
        """Whether it is stable with a peak that can be tolerated."""
        return self.ms <= TOLERATED


def trials_on(loop: NRDOB, found: Identification | None) -> Iterator[Trial]:
    """Try a loop on what was identified, its rivals, and all corners of the intervals, if any."""
    if found is None:
        return
    plants = {f"{found.structure} (chosen)": found.process}
    plants |= {each.structure: each.process for each in found.candidates if each.rival}
    if found.plain is not None:
        plants["one lag with dead time, plain least squares"] = found.plain
    for corner, group in ((False, plants), (True, found.corners)):
        for name, plant in group.items():
            stable, ms = None, inf
            with suppress(ArithmeticError, ValueError):
                tried = NRDOB(plant, loop.model, loop.controller, loop.filter)
                stable = tried.stability().stable
                ms = tried.margins().plant_loop.ms if stable else inf
            yield Trial(name, corner, stable, ms)


def in_words(trials: tuple[Trial, ...]) -> str:
    """Say what became of all trials of a loop."""
    corners = sum(each.corner for each in trials)
    rivals = len(trials) - corners - 1
    some = f"{rivals} rival{'s' * (rivals > 1)}" if rivals else "no rival"
    among = f"the process found, {some} of it and {corners} corners of the intervals"
    failed = [each for each in trials if not each.holds]
    if not failed:
        worst = number(max(each.ms for each in trials))
        return f"Tried on {among}, it is stable on all, with a peak of {worst} at most."
    unstable = sum(not each.stable for each in failed)
    return (
        f"The record does not tell enough to rely on this loop. Tried on {among}, it is unstable "
        f"on {unstable}, and on {len(failed) - unstable} more the sensitivity peaks above "
        f"{TOLERATED:g}; a slower filter does not help. Measure again, longer or with larger "
        "steps, so that the intervals become narrower."
    )


def trial_table(trials: tuple[Trial, ...]) -> Table:
    """Show the trials of a loop: all structures, and the worst corners."""
    corners = sorted((each for each in trials if each.corner), key=lambda each: -each.ms)
    shown = [*(each for each in trials if not each.corner), *corners[:SHOWN]]
    answer = {True: "yes", False: "NO", None: "not decided"}
    rows = tuple(
        (each.process, answer[each.stable], number(each.ms) if isfinite(each.ms) else "–")
        for each in shown
    )
    caption = (
        "The loop on what the process may be: structures that explain the record about as well, "
        f"and the worst {len(corners[:SHOWN])} of {len(corners)} corners of the intervals"
    )
    return Table(caption, ("process", "stable", "peak Ms"), rows)
