"""How what is uncertain is drawn: from an interval, on a grid, from a fit.

Samples come in blocks of `BLOCK`, each with its own stream of random numbers, spawned from one
seed. A block is always drawn whole: member 17 is the same one in a family of a hundred and of a
million, and whoever draws it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from ..numerics import FloatArray, is_real, is_whole

__all__ = [
    "BLOCK",
    "Fit",
    "Grid",
    "Interval",
    "Samples",
    "read_fit",
    "read_range",
    "whole_number",
]

BLOCK = 10_000  # members drawn together, which are also judged together, as one task


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

    axes: Mapping[str, FloatArray]

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters, in the order of the columns."""
        return tuple(self.axes)

    @property
    def count(self) -> int:
        """How many members there are."""
        return int(np.prod([axis.size for axis in self.axes.values()], dtype=object))

    def block(self, k: int) -> dict[str, FloatArray]:
        """Return block k of the members."""
        here = np.arange(k * BLOCK, min((k + 1) * BLOCK, self.count))
        shape = tuple(axis.size for axis in self.axes.values())
        where = np.unravel_index(here, shape)
        return {name: axis[i] for (name, axis), i in zip(self.axes.items(), where, strict=True)}


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
