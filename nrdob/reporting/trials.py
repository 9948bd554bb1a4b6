"""A loop tried on every process that a record does not exclude."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import inf

from ..analysis import quotient_margins
from ..digital import SampledLoop
from ..loop import NRDOB
from ..measured import Identification
from ..numerics import number
from .html import Table

__all__ = ["Trial", "in_words", "trial_table", "trials_on"]

TOLERATED = 2.5  # largest sensitivity peak on a process that the record does not exclude
SHOWN = 4  # corners in the table, worst first


@dataclass(frozen=True)
class Outcome:
    """What a loop does: stable is None if that could not be decided.

    The sensitivity peak is infinite where the loop is not stable.
    """

    stable: bool | None = None
    ms: float = inf

    @property
    def holds(self) -> bool:
        """Whether it is stable with a peak that can be tolerated."""
        return self.ms <= TOLERATED

    def __str__(self) -> str:
        words = {True: number(self.ms), False: "UNSTABLE", None: "not decided"}
        return words[self.stable]


@dataclass(frozen=True)
class Trial:
    """The proposed loop on a process that the record does not exclude.

    The process is a structure or a corner, numbers at the ends of their intervals; the loop is
    tried in continuous time and sampled like the record, at dt, in seconds.
    """

    process: str
    corner: bool
    dt: float
    continuous: Outcome
    sampled: Outcome

    @property
    def stable(self) -> bool | None:
        """Whether it is stable in both; None if that could not be decided."""
        both = self.continuous.stable, self.sampled.stable
        return False if False in both else None if None in both else True

    @property
    def ms(self) -> float:
        """The larger of both sensitivity peaks."""
        return max(self.continuous.ms, self.sampled.ms)

    @property
    def holds(self) -> bool:
        """Whether it holds in both."""
        return self.continuous.holds and self.sampled.holds


def trials_on(loop: NRDOB, found: Identification | None, suspect: str = "") -> Iterator[Trial]:
    """Try a loop on what was identified, its rivals, and all corners of the intervals, if any.

    The suspect is the process to begin with, by its name.
    """
    if found is None:
        return
    plants = {f"{found.structure} (chosen)": found.process}
    plants |= {each.structure: each.process for each in found.candidates if each.rival}
    if found.least_squares is not None:
        plants["one lag with dead time, plain least squares"] = found.least_squares
    dt = found.record.sampling_time
    plants |= found.corners
    for name in sorted(plants, key=lambda name: name != suspect):
        tried = NRDOB(plants[name], loop.model, loop.controller, loop.filter)
        continuous, sampled = Outcome(), Outcome()
        with suppress(ArithmeticError, ValueError):
            continuous = _outcome(tried)
        with suppress(ArithmeticError, NotImplementedError, ValueError):
            sampled = _outcome(tried.sampled(dt))
        yield Trial(name, name in found.corners, dt, continuous, sampled)


def _outcome(loop: NRDOB | SampledLoop) -> Outcome:
    stable = loop.stability().stable
    if not stable:
        return Outcome(stable)
    found = loop.margins() if isinstance(loop, SampledLoop) else quotient_margins(loop.L, True)
    return Outcome(True, found.ms)


def in_words(trials: tuple[Trial, ...], slower: bool = True) -> str:
    """Say what became of all trials of a loop; slower tells whether slower filters were tried."""
    corners = sum(each.corner for each in trials)
    rivals = len(trials) - corners - 1
    some = f"{rivals} rival{'s' * (rivals > 1)}" if rivals else "no rival"
    among = f"the process found, {some} of it and {corners} corners of the intervals"
    like = f"sampled like the record, at dt = {number(trials[0].dt, 4)} s"
    if all(each.holds for each in trials):
        worst = number(max(each.ms for each in trials))
        return (
            f"Tried on {among}, in continuous time and {like}, it is stable on all, with a peak of "
            f"{worst} at most."
        )
    failed = [each.continuous for each in trials if not each.continuous.holds]
    if failed:
        start = "The record does not tell enough to rely on this loop. Tried on"
        change = (
            "Measure again, longer or with larger steps, so that the intervals become narrower."
        )
    else:
        failed = [each.sampled for each in trials if not each.sampled.holds]
        start = f"{like.capitalize()}, the loop fails. Tried on"
        change = "Let the controller sample faster."
    unstable = sum(not each.stable for each in failed)
    in_vain = "; none of the slower filters tried helps" * slower
    return (
        f"{start} {among}, it is unstable on {unstable}, and on {len(failed) - unstable} more the "
        f"sensitivity peaks above {TOLERATED:g}{in_vain}. {change}"
    )


def trial_table(trials: tuple[Trial, ...]) -> Table:
    """Show the trials of a loop: all structures, and the worst corners."""
    corners = sorted((each for each in trials if each.corner), key=lambda each: -each.ms)
    shown = [*(each for each in trials if not each.corner), *corners[:SHOWN]]
    rows = tuple((each.process, str(each.continuous), str(each.sampled)) for each in shown)
    caption = (
        "The loop on what the process may be: structures that explain the record about as well, "
        f"and the worst {len(corners[:SHOWN])} of {len(corners)} corners of the intervals"
    )
    return Table(caption, ("process", "peak Ms", "peak Ms, sampled"), rows)
