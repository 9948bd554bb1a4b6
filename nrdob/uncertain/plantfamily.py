r"""What a plant may be: a family of members around the one that was expected.

A member is :math:`k\,G(s)\,e^{-\theta s}/(Ts+1)`: the nominal process G times a gain k, with one
more lag T and an additional dead time θ; or whatever a function of the user's makes of drawn
parameters in place of G. What is drawn stands in columns that are read by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np

from ..analysis import judge_observer, quotient_margins
from ..diagram import ObserverEquations, as_fraction, nonzero, undelayed
from ..numerics import BoolArray, FloatArray, convolved
from .batch import SLAB, Feedback, PlantBatch
from .batchpeaks import batch_peaks
from .distributions import BLOCK, Grid, Samples, read_fit, read_range, whole_number

__all__ = ["PlantFamily", "judged", "plant_family"]

BUILT_IN = ("gain", "delay", "lag")


@dataclass(frozen=True, eq=False)
class PlantFamily:
    """Plants around a nominal one, drawn reproducibly: ``family[i]`` is one of them.

    Attributes
    ----------
    process : as for `nrdob.NRDOB`
        The nominal plant.
    drawn : Samples or Grid
        What is uncertain, and how.
    parameters : callable or None
        What makes a plant of parameters.
    """

    process: Any
    drawn: Samples | Grid
    parameters: Callable[..., Any] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """What is uncertain: the columns."""
        return self.drawn.names

    @property
    def blocks(self) -> int:
        """In how many blocks the members are drawn."""
        return ceil(len(self) / BLOCK)

    def __len__(self) -> int:
        return self.drawn.count

    def __getitem__(self, which: int | str) -> Any:
        """Return a member as a block for `nrdob.NRDOB`, or a column of parameters by its name."""
        if isinstance(which, str):
            if which not in self.names:
                raise KeyError(f"there is no {which!r}; the columns are {', '.join(self.names)}")
            return np.concatenate([self.drawn.block(k)[which] for k in range(self.blocks)])
        k = range(len(self))[which]
        drawn = {name: values[[k % BLOCK]] for name, values in self.drawn.block(k // BLOCK).items()}
        built, problems = self.plants(drawn)
        if problems:
            raise ValueError(f"member {k} is no plant: {problems[0]}")
        return built.plant(0)

    def __repr__(self) -> str:
        return f"<family of {len(self)} plants: {', '.join(self.names)}>"

    def plants(self, drawn: Mapping[str, FloatArray]) -> tuple[PlantBatch, dict[int, str]]:
        """Build the plants of some drawn parameters.

        Parameters
        ----------
        drawn : dict of str: (n,) array of float
            The columns.

        Returns
        -------
        PlantBatch, dict of int: str
            The plants, nan where there is none; for some columns why.
        """
        n = next(iter(drawn.values())).size
        problems: dict[int, str] = {}
        if self.parameters:
            num, den, delay = self._made(drawn, n, problems)
        else:
            num, den, delay = PlantBatch.of_blocks([self.process])
        if "gain" in drawn:
            num = num * drawn["gain"]
        if "lag" in drawn:
            den = convolved(den, np.array([drawn["lag"], np.ones(n)]))
        if "delay" in drawn:
            delay = delay + drawn["delay"]
        every = (np.broadcast_to(part, (*part.shape[:-1], n)) for part in (num, den, delay))
        return PlantBatch(*every), problems

    def peaks(self, model: Any, filter: Any) -> FloatArray:
        """Ms of the plant loop of every member.

        Parameters
        ----------
        model, filter : as for `nrdob.NRDOB`
            G̃ and F.

        Returns
        -------
        (n,) array of float
            inf where the loop is not known to be stable.
        """
        feedback, every = Feedback(ObserverEquations(self.process, model, filter)), []
        for block in range(self.blocks):
            plants, _ = self.plants(self.drawn.block(block))
            stable, unstable, ms = judged(plants, feedback, peaks=True)
            ms[unstable] = np.inf
            for k in np.flatnonzero(~(stable | unstable)).tolist():
                loop = ObserverEquations(plants.plant(k), model, filter)
                one = judge_observer(loop.process, model, filter).stable
                ms[k] = quotient_margins(loop.L, True).ms if one else np.inf
            every.append(ms)
        return np.concatenate(every)

    @property
    def delay(self) -> float:
        """Dead time of the nominal plant, in seconds."""
        return undelayed(self.process)[1]

    def _made(
        self, drawn: Mapping[str, FloatArray], n: int, problems: dict[int, str]
    ) -> PlantBatch:
        """Call the user's function for every member."""
        names = [name for name in self.names if name not in BUILT_IN]
        columns = [drawn[name].tolist() for name in names]
        made: list[Any] = []
        for k in range(n):
            values = {name: column[k] for name, column in zip(names, columns, strict=True)}
            try:
                block = self.parameters(**values)  # type: ignore[misc]
                as_fraction(undelayed(block)[0], "the plant", proper=False)
            except Exception as error:  # whatever a function of the user's may raise
                call = ", ".join(f"{name}={value:.6g}" for name, value in values.items())
                problems[k] = f"parameters({call}): {error}"
                block = None
            made.append(block)
        return PlantBatch.of_blocks(made)


def plant_family(
    process: Any,
    *,
    gain: Any = None,
    delay: Any = None,
    lag: Any = None,
    parameters: Callable[..., Any] | None = None,
    fit: Any = None,
    grid: int | None = None,
    samples: int = 1000,
    seed: int = 0,
    **others: Any,
) -> PlantFamily:
    r"""Describe the plants that may turn up instead of the one that was expected.

    Every range is an interval (low, high), of which every value is as likely.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`
        The nominal plant.
    gain, delay, lag : range
        Factor of the plant; dead time that is added to its own, in seconds; T of one more factor
        :math:`1/(Ts+1)`, in seconds.
    parameters : callable
        Makes a plant, whatever `nrdob.NRDOB` takes as a process, of parameters that `others` and
        `fit` name, as keyword arguments. Gain, delay and lag come on top.
    fit : (dict of str: float, (k, k) array_like)
        Means by name, and the covariance in the same order, of parameters that were identified
        together; they are drawn from the normal distribution. A gain named here is a factor of the
        process, as `gain` is; for parameters of other meaning give the function `parameters`.
    grid : int
        Points on every interval: all their combinations in place of samples.
    samples, seed : int
        How many members are drawn, and of all random numbers. Members 0, 1, 2, … are the same
        however many there are.
    **others : range
        Arguments of `parameters`, by name.

    Returns
    -------
    PlantFamily
        With a length; ``family[i]`` is a member, ``family["gain"]`` the gains of all.

    Raises
    ------
    TypeError, ValueError
        If a range is none, empty or reversed, nothing is uncertain, or two things are given that
        exclude each other.

    Examples
    --------
    >>> import control as ct
    >>> plants = plant_family(ct.tf([1], [1, 1]), gain=(0.5, 2.0), delay=(0.0, 0.1), samples=100)
    >>> len(plants), plants[7].delay < 0.1, bool(plants["gain"].min() >= 0.5)
    (100, True, True)
    >>> plant_family(ct.tf([1], [1, 1]), gain=(0.5, 2.0), delay=(0.0, 0.1), grid=11)
    <family of 121 plants: gain, delay>
    """
    nonzero(as_fraction(undelayed(process)[0], "process"), "process")
    given = dict(zip(BUILT_IN, (gain, delay, lag), strict=True))
    ranges = {name: read_range(name, each) for name, each in given.items() if each is not None}
    if others and not parameters:
        raise TypeError(
            f"nothing takes {', '.join(others)}; give parameters, a function that makes a plant "
            "of them, or one of gain, delay, lag"
        )
    ranges |= {name: read_range(name, each) for name, each in others.items()}
    known = read_fit(fit) if fit is not None else None
    if known:
        if twice := sorted(set(known.names) & set(ranges)):
            raise ValueError(f"{', '.join(twice)} would be drawn twice, by a range and by fit")
        strange = [name for name in known.names if name not in BUILT_IN and not parameters]
        if strange:
            raise ValueError(
                f"fit names {', '.join(strange)}, which only a function parameters=… can use; "
                f"without it name some of {', '.join(BUILT_IN)}"
            )
    if not ranges and not known:
        raise ValueError("nothing is uncertain; give a range, such as gain=(0.5, 2.0)")
    drawn: Samples | Grid
    if grid is None:
        count, start = whole_number(samples, "samples", 1), whole_number(seed, "seed", 0)
        drawn = Samples(ranges, known, count, start)
    elif known:
        raise ValueError("a fit has no grid; leave grid or fit out")
    else:
        points = whole_number(grid, "grid", 2)
        drawn = Grid({name: np.linspace(*each, points) for name, each in ranges.items()})
    return PlantFamily(process, drawn, parameters)


def judged(
    plants: PlantBatch, feedback: Feedback, *, peaks: bool
) -> tuple[BoolArray, BoolArray, FloatArray]:
    """Tell which plants are certainly stable, which unstable, and Ms of the former if asked for.

    What is too close to call for many at once is neither, and must be judged alone.
    """
    stable, unstable = np.zeros((2, plants.delay.size), dtype=bool)
    ms = np.full(stable.size, np.nan)
    for chosen, few in plants.groups():
        stable[chosen], unstable[chosen] = feedback.verdicts(few)
        here = np.flatnonzero(stable[chosen] & peaks)
        for first in range(0, here.size, SLAB):
            part = here[first : first + SLAB]
            found, trusted = batch_peaks(feedback, few.of(part))
            stable[chosen[part]] = trusted
            ms[chosen[part]] = np.where(trusted, found, np.nan)
    return stable, unstable, ms
