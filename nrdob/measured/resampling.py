"""Times that are not even: rounded, with missing rows, or with jitter.

What can be repaired without inventing anything is repaired, and how much is said; the rest is
refused, with the place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ..numerics import BoolArray, FloatArray, IntArray

__all__ = ["MISSING", "Sampled", "evenly_sampled"]

# Largest distance of a sample from the even grid, in sampling times, that is left as it is.
EVEN = 0.05
JITTER = 0.25  # error of an interval, in sampling times, from which on it is no multiple of one
# Longest of intervals that are no multiples of one: in their mean, or as a share of the record.
LONG, GAP = 3.0, 0.02
# Largest share of missing samples, or of uneven intervals, and of those missing in one gap (of more
# than one).
MISSING, LONGEST = 0.05, 0.01
SMOOTH = 0.05  # largest difference of two ways to interpolate y, against its standard deviation
MINOR = 0.01  # share of missing samples up to which filling them is not worth a warning
COARSE = 2.5  # largest step of rounded times, in sampling times
# Irregular intervals that rounding must have left; fewer are missing or repeated rows.
IRREGULAR = 3
IF_EVEN = "if the samples are even and only their times are wrong, give the sampling time"
HOUR = 3600.0


@dataclass(frozen=True)
class Sampled:
    """A record at even times, measured or filled in; what was done is noted, or remarked."""

    t: FloatArray
    u: FloatArray
    y: FloatArray
    measured: BoolArray
    notes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


def evenly_sampled(
    t: FloatArray, u: FloatArray, y: FloatArray, place: Callable[[int], str], number: IntArray
) -> Sampled:
    """Bring a record to even times, or say where these would hide something, as `place` calls it.

    Number says which samples they are, from 0 on, as far as it is known that others are missing.

    Times within 5 % of a sampling time of an even grid are left as they are. Times that were
    rounded are taken as even. Where a few rows are missing, y is interpolated (and not used) and u
    held. Other times are resampled: y along straight lines, u averaged over each interval.

    >>> t = np.delete(np.arange(200.0), 7)
    >>> even = evenly_sampled(t, t > 20, t, "sample {}".format, np.arange(199))
    >>> even.t.size, even.y[7].item(), even.notes
    (200, 7.0, ('1 of 200 samples is missing: y is interpolated there, and not used',))
    """
    span, count = t[-1] - t[0], t.size
    done: list[tuple[str, bool]] = []
    line = np.linspace(t[0], t[-1], int(number[-1]) + 1)[number]
    even = bool(np.abs(t - line).max() <= EVEN * span / number[-1])
    if span > 0 and not even:
        step, spacing = _rounding(t, number)
        if step:
            said = (
                f"times are given to {step:g} s only; they are taken as even, one sample every "
                f"{spacing:.5g} s: a missing row would not be seen, and with a sampling time of "
                "your own the times are not needed"
            )
            done, t, even = [(said, False)], t[0] + spacing * number, True
    if span > 0 and even and number[-1] == count - 1:
        return Sampled(t, u, y, np.ones(count, dtype=bool), (), tuple(said for said, _ in done))
    steps = np.diff(t)
    if (steps <= 0).any():
        k = int(np.argmax(steps <= 0)) + 1
        raise ValueError(
            f"t goes from {t[k - 1]:.10g} to {t[k]:.10g} at {place(k)}; times must increase: put "
            f"the samples in order, and take out what stands twice (or, {IF_EVEN}){_clock(steps)}"
        )
    multiples = steps / np.median(steps)
    off = np.abs(multiples - np.round(multiples))
    # As many even times as uneven ones; also where two samples would get one place on a grid.
    if even:
        index, small, apart = number, True, ""
    elif np.mean(off > JITTER) > MISSING or multiples.min() < 0.5:
        index, small = np.arange(count), False
        apart = f"the times lie between {steps.min():.4g} and {steps.max():.4g} s apart"
        if steps.max() > max(LONG * span / (count - 1), GAP * span):
            raise ValueError(
                f"t is not evenly sampled: {apart}, most before {place(int(np.argmax(steps)) + 1)};"
                f" use a stretch without gaps, or log at a fixed rate ({IF_EVEN})"
            )
    else:
        index = np.concatenate([[0], np.cumsum(np.round(multiples).astype(int))])
        small = float(off.max()) <= 2 * EVEN
        apart = f"intervals between the times differ by up to {100 * off.max():.2g} %"
    spacing = float((t[-1] - t[0]) / index[-1])
    done += _gaps(index, t, u, place)
    size = int(index[-1]) + 1
    measured = np.zeros(size, dtype=bool)
    measured[index] = True
    grid = t[0] + spacing * np.arange(size)
    if np.abs(t - grid[index]).max() <= EVEN * spacing:
        held = u[np.maximum.accumulate(np.where(measured, np.cumsum(measured) - 1, 0))]
    else:
        held = _averaged(t, u, grid)
        done.append((_resampling(t, y, grid, place, apart), small))
    notes, remarks = (
        tuple(said for said, small in done if small == kind) for kind in (True, False)
    )
    return Sampled(grid, held, np.interp(grid, t, y), measured, notes, remarks)


def _rounding(t: FloatArray, number: IntArray) -> tuple[float, float]:
    """Find the step to which even times were rounded (0 if they were not), and their spacing."""
    elapsed = t - t[0]
    for step in (3600.0, 60.0, *(10.0**-k for k in range(7))):
        whole = np.round(elapsed / step)
        if np.abs(elapsed - step * whole).max() <= 1e-6 * step:
            break
    else:
        return 0.0, 0.0
    line = np.polyfit(number, elapsed, 1)
    spacing = float(line[0])
    rest = elapsed - np.polyval(line, number)
    steps = np.diff(elapsed)[np.diff(number) == 1]
    irregular = np.count_nonzero(np.abs(steps - np.median(steps)) > 0.5 * step)
    rounded = np.ptp(rest) <= 1.05 * step and EVEN * spacing < step <= COARSE * spacing
    return (step if rounded and irregular >= IRREGULAR else 0.0), spacing


def _gaps(
    index: IntArray, t: FloatArray, u: FloatArray, place: Callable[[int], str]
) -> Iterator[tuple[str, bool]]:
    """Say how much is missing, each with whether it is minor; refuse gaps that hide something."""
    missing = np.diff(index) - 1
    total, size = int(missing.sum()), int(index[-1]) + 1
    if not total:
        return
    worst = int(np.argmax(missing))
    if total > MISSING * size or missing.max() > max(1.0, LONGEST * size):
        raise ValueError(
            f"t is not evenly sampled: {total} of {size} samples are missing, {missing.max()} of "
            f"them in a row before {place(worst + 1)}; at most {100 * MISSING:g} % are filled in, "
            f"and {100 * LONGEST:g} % in a row: use a stretch without gaps "
            f"({IF_EVEN}){_clock(np.diff(t))}"
        )
    moved = np.flatnonzero((missing > 0) & (np.diff(u) != 0))
    if moved.size and missing[moved].max() > 1:
        k = int(moved[np.argmax(missing[moved])]) + 1
        raise ValueError(
            f"u changes from {u[k - 1]:g} to {u[k]:g} while {missing[k - 1]} samples are missing "
            f"before {place(k)}: when is not known; use a stretch without that gap"
        )
    are = "is" if total == 1 else "are"
    said = f"{total} of {size} samples {are} missing: y is interpolated there, and not used"
    yield said, total <= MINOR * size
    if moved.size:
        more = f" and {moved.size - 1} times more" if moved.size > 1 else ""
        said = (
            f"u changes while a sample is missing, before {place(int(moved[0]) + 1)}{more}: u is "
            "taken to change after it; the dead time may be wrong by up to one sample"
        )
        yield said, False


def _clock(steps: FloatArray) -> str:
    """Recall what puts times off by an hour."""
    off = abs(float(np.abs(steps).max()) - HOUR) <= 2 * np.median(steps)
    return "; an hour is what summer time puts clocks forward and back" if off else ""


def _resampling(
    t: FloatArray, y: FloatArray, grid: FloatArray, place: Callable[[int], str], apart: str
) -> str:
    """Say what resampling does; refuse it where the way of interpolating matters."""
    changes = np.abs(CubicSpline(t, y)(grid) - np.interp(grid, t, y))
    change = float(np.sqrt(np.mean(changes**2)))
    if change > SMOOTH * y.std():
        k = int(np.searchsorted(t, grid[np.argmax(changes)]))
        raise ValueError(
            f"t is not evenly sampled ({apart}), and y moves too fast between samples to be "
            f"resampled, most before {place(k)}: sample faster, or log at a fixed rate ({IF_EVEN})"
        )
    return (
        f"{apart}: resampled to one sample every {grid[1] - grid[0]:.5g} s, y along straight lines "
        f"(which changes it by about {100 * change / np.ptp(y):.1g} % of its range), u averaged "
        "over each interval"
    )


def _averaged(t: FloatArray, u: FloatArray, grid: FloatArray) -> FloatArray:
    """Average a held input over each interval of the grid, so that its area is kept."""
    area = np.concatenate([[0.0], np.cumsum(u[:-1] * np.diff(t))])
    mean = np.append(np.diff(np.interp(grid, t, area)) / np.diff(grid), u[-1])
    held = u[np.clip(np.searchsorted(t, grid, side="right") - 1, 0, u.size - 1)]
    return np.where(np.abs(mean - held) <= 1e-9 * np.ptp(u), held, mean)
