r"""What a plant may be: a family of members around the one that was expected.

A member is :math:`k\,G(s)\,e^{-\theta s}/(Ts+1)`: the nominal process G times a gain k, with one
more lag T and an additional dead time θ; or whatever a function of the user's makes of drawn
parameters in place of G. What is drawn stands in columns that are read by name.

Samples come in blocks of `BLOCK`, each with its own stream of random numbers, spawned from one
seed. A block is always drawn whole: member 17 is the same one in a family of a hundred and of a
million, and whoever draws it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, isfinite
from typing import Any, NamedTuple

import numpy as np

from ..analysis import judge_observer, quotient_margins
from ..diagram import ObserverEquations, as_fraction, nonzero, undelayed
from ..numerics import BoolArray, FloatArray, convolved, is_real, is_whole
from .batch import SLAB, Feedback, PlantBatch, batch_peaks

__all__ = [
    "Grid", "Interval", "PlantFamily", "judged", "plant_family", "read_range", "whole_number",
]  # fmt: skip

BLOCK = 10_000  # members drawn together, which are also judged together, as one task
BUILT_IN = ("gain", "delay", "lag")


class Interval(NamedTuple):
    """An interval of which every value is as likely."""

    low: float
    high: float


class Fit(NamedTuple):
    """Means (k,) of parameters and a square root (k, k) of their covariance, as identified."""

    names: tuple[str, ...]
    mean: FloatArray
    root: FloatArray


@dataclass(frozen=True, eq=False)
class Samples:
    """Random members: what is drawn by itself, what together, how many times, from which seed."""

    ranges: Mapping[str, Interval]
    fit: Fit | None
    count: int
    seed: int

    @property
    def names(self) -> tuple[str, ...]:
        """What is drawn, in the order of the columns."""
        return (*self.ranges, *(self.fit.names if self.fit else ()))

    def block(self, k: int) -> dict[str, FloatArray]:
        """Draw block k of the members, k from 0."""
        rng = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(k,)))
        drawn = {name: rng.uniform(*each, BLOCK) for name, each in self.ranges.items()}
        if self.fit:
            numbers = rng.standard_normal((BLOCK, len(self.fit.names)))
            together = self.fit.mean[:, None] + np.einsum("ij,kj->ik", self.fit.root, numbers)
            drawn |= zip(self.fit.names, together, strict=True)
        here = min(BLOCK, self.count - k * BLOCK)
        return {name: values[:here] for name, values in drawn.items()}


@dataclass(frozen=True, eq=False)
class Grid:
    """Members on a grid of values of each parameter, the last one changing fastest."""

    ranges: Mapping[str, Interval]
    points: int

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters, in the order of the columns."""
        return tuple(self.ranges)

    @property
    def count(self) -> int:
        """How many members there are."""
        return int(self.points ** len(self.ranges))

    def block(self, k: int) -> dict[str, FloatArray]:
        """Return block k of the members."""
        here = np.arange(k * BLOCK, min((k + 1) * BLOCK, self.count))
        where = np.unravel_index(here, [self.points] * len(self.ranges))
        return {
            name: np.linspace(*each, self.points)[i]
            for (name, each), i in zip(self.ranges.items(), where, strict=True)
        }


def read_range(name: str, given: Any) -> Interval:
    """Read an interval (low, high)."""
    remedy = "give an interval, such as (0.5, 2.0)"
    if not isinstance(given, Sequence | np.ndarray) or isinstance(given, str) or len(given) != 2:
        raise TypeError(f"{name} is {given!r}; {remedy}")
    if not all(map(is_real, given)):
        raise TypeError(f"{name} is {given!r}, whose ends are no real numbers; {remedy}")
    low, high = map(float, given)
    if not (isfinite(low) and isfinite(high)):
        raise ValueError(f"{name} is ({low:g}, {high:g}); both ends must be finite numbers")
    if low > high:
        raise ValueError(
            f"{name} is ({low:g}, {high:g}), from high to low; write ({high:g}, {low:g})"
        )
    if low == high:
        raise ValueError(
            f"{name} is ({low:g}, {high:g}), in which nothing is uncertain; leave it out, and "
            "give the process that value"
        )
    return Interval(low, high)


def read_fit(given: Any) -> Fit:
    """Read means by name, numbers or what has them as `value`, and their covariance (k, k)."""
    if not (isinstance(given, tuple) and len(given) == 2 and isinstance(given[0], Mapping)):
        raise TypeError(
            f"fit is a {type(given).__name__}; give means by name and their covariance in the "
            "same order, fit=({'gain': 1.0, 'lag': 0.1}, [[0.01, 0.0], [0.0, 0.0001]])"
        )
    means, covariance = given
    values = [getattr(value, "value", value) for value in means.values()]
    if not all(map(is_real, values)):
        raise TypeError(f"fit has the means {means!r}; give real numbers by name")
    mean = np.array(values, dtype=float)
    matrix = np.array(covariance, dtype=float)
    k = mean.size
    if matrix.shape != (k, k):
        raise ValueError(
            f"fit has {k} means and a covariance of shape {matrix.shape}; it must be ({k}, {k})"
        )
    if not (np.isfinite(mean).all() and np.isfinite(matrix).all()):
        raise ValueError("fit has means or covariances that are no finite numbers")
    powers, directions = np.linalg.eigh((matrix + matrix.T) / 2)
    size = np.abs(matrix).max()
    if np.abs(matrix - matrix.T).max() > 1e-8 * size or powers.min() < -1e-8 * size:
        raise ValueError(
            "the covariance in fit is not symmetric, or has a negative variance in some "
            f"direction ({powers.min():.3g}); give the covariance matrix of the estimates"
        )
    return Fit(tuple(means), mean, directions * np.sqrt(np.maximum(powers, 0.0)))


def whole_number(value: Any, name: str, least: int) -> int:
    """Return a whole number, or refuse what is none or below the least."""
    if not is_whole(value):
        raise TypeError(f"{name} is {value!r}; give a whole number")
    if value < least:
        raise ValueError(f"{name} is {value}; give {least} or more")
    return int(value)


# The family.


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
        together; they are drawn from the normal distribution. Without `parameters` their names are
        gain, delay or lag.
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
                f"fit names {', '.join(strange)}, which only a function parameters=… can use"
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
        drawn = Grid(ranges, whole_number(grid, "grid", 2))
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
