"""The external signals of a simulation: checked, and turned into one value for each sample."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..diagram import real_number
from ..numerics import FloatArray

__all__ = ["EXTERNAL", "Signal", "external_signals", "signal_at"]

Signal = ArrayLike | Callable[[FloatArray], ArrayLike]
"""A signal: a number, one value for each sample, or a function of the times."""

EXTERNAL = ("R", "d", "delta")  # the inputs of a simulation; noise is given apart


def _sample_times(
    timepts: ArrayLike | None, inputs: Mapping[str, Signal], noise: Any, dt: float
) -> FloatArray:
    """Find the times of the samples: as given, or as many as the signals have."""
    if not isinstance(inputs, Mapping):
        raise TypeError(
            f"inputs is a {type(inputs).__name__}; give a mapping, as {{'R': 1.0, 'd': values}}"
        )
    unknown = [name for name in inputs if name not in EXTERNAL]
    if unknown:
        hint = " (noise is given as noise=)" if "eta" in unknown else ""
        raise ValueError(f"{unknown[0]!r} is no input; choose from {', '.join(EXTERNAL)}{hint}")
    if timepts is None:
        return np.asarray(np.arange(_common_length({**inputs, "noise": noise})) * dt)
    asked = _numbers(timepts, "timepts", "the times of the samples in seconds, or the last one")
    if asked.ndim == 0:
        if not 0 <= asked < inf:
            raise ValueError(f"timepts is {asked}; the last time is a number of seconds, 0 or more")
        return np.asarray(np.arange(int(asked / dt + 1e-9) + 1) * dt)
    expected = np.arange(asked.size) * dt
    if asked.ndim != 1 or not asked.size:
        raise ValueError(f"timepts has the shape {asked.shape}; give the times of the samples")
    off = ~(np.abs(asked - expected) <= 1e-6 * dt)
    if off.any():
        k = int(np.argmax(off))
        raise ValueError(
            f"timepts[{k}] is {asked[k]:.6g} s, and sample {k} is at {expected[k]:.6g} s: the loop "
            f"is sampled every {dt:.6g} s from 0 on; resample the signals, or sample the loop "
            "with their dt"
        )
    return expected


def _common_length(signals: Mapping[str, Any]) -> int:
    lengths: dict[str, int] = {name: np.shape(signal)[0] for name, signal in signals.items()
               if not callable(signal) and np.ndim(signal) == 1}  # fmt: skip
    if not lengths:
        raise ValueError(
            "no input says how many samples there are: give one as an array, or timepts"
        )
    if len(set(lengths.values())) > 1:
        said = ", ".join(f"{name} has {count}" for name, count in lengths.items())
        raise ValueError(f"the signals differ in length: {said} samples; make them equal")
    if not (count := min(lengths.values())):
        raise ValueError("the signals are empty; give one value for each sample")
    return count


def external_signals(
    inputs: Mapping[str, Signal],
    noise: float | ArrayLike | None,
    timepts: ArrayLike | None,
    dt: float,
    seed: int | np.random.Generator = 0,
) -> tuple[FloatArray, FloatArray]:
    """Gather the times (N,) of a simulation, and its signals R, d, δ and η as columns (N, 4).

    Parameters
    ----------
    inputs, noise, timepts, dt, seed : as of `SampledLoop.simulate`
    """
    time = _sample_times(timepts, inputs, noise, dt)
    columns = [signal_at(inputs.get(name, 0.0), name, time) for name in EXTERNAL]
    if noise is None or np.ndim(noise) == 0:
        remedy = "as a number it is a standard deviation, 0 or more: give one, or an array"
        deviation = real_number(noise or 0.0, "noise", remedy, least=0.0)
        columns.append(deviation * np.random.default_rng(seed).standard_normal(time.size))
    else:
        columns.append(signal_at(noise, "noise", time))
    return time, np.column_stack(columns)


def signal_at(signal: Any, name: str, time: FloatArray) -> FloatArray:
    """Read a signal at the times of the samples.

    Parameters
    ----------
    signal, name, time : Signal, str, (N,) array
        A refusal, TypeError or ValueError, says the name.
    """
    remedy = "a number, an array with one value for each sample, or a function of the times"
    found = _numbers(signal(time) if callable(signal) else signal, name, remedy)
    if found.ndim == 0:
        found = np.full(time.size, found)
    if found.shape != time.shape:
        raise ValueError(
            f"{name} has the shape {found.shape}, and there are {time.size} samples: give one "
            "value for each"
        )
    bad = ~np.isfinite(found)
    if bad.any():
        raise ValueError(
            f"{name}[{int(np.argmax(bad))}] is {found[bad][0]}; every value must be finite: fill "
            "the gaps first"
        )
    return found


def _numbers(values: Any, name: str, remedy: str) -> FloatArray:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {values!r:.60}; give {remedy}") from None
