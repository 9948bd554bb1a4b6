"""A record of input and output, evenly sampled: what is wrong with it is found here, and named."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..numerics import BoolArray, FloatArray, IntArray, is_real, runs
from .resampling import evenly_sampled

__all__ = ["BEFORE", "SHORTEST", "Record", "checked_record", "look_swapped", "resolution"]

SHORTEST = 20  # samples below which nothing is fitted
STUCK = 5  # samples in a row at one extreme value from which on an output may be at its limit
# Last step before a limit, against the largest of the record, that no settling output makes.
ABRUPT = 0.2
COARSE = 3.0  # steps of a coarse sensor that the last one before a limit must exceed
# Samples and share of the range in which an output rests at a stop, where its noise is far less.
RESTS, CLOSE, QUIET = 15, 0.02, 0.25
SPIKE = 8.0  # largest other steps of y that a few samples that are none are away
MOST_SPIKES, LASTING = 50, 10  # how many there may be, and samples that each may last
PULSE = 4  # samples before the last one in which the input may explain it
IMPOSSIBLE, MIDDLE = 10.0, 0.02  # times as far as all but 2 % on either side that u may reach
BEFORE = "give what the input was before (input_before=0; in the shell --input-before 0)"
# Times as often as y that u may change, and times as many values that it may take, if y takes few.
SWAPPED, FEW = 10, 5
LARGEST = 1e100  # above it squares overflow
SINCE_1970 = 1e8  # times in seconds that count from 1970, and not from the beginning of a test


@dataclass(frozen=True, eq=False)
class Record:
    """Input and output of a plant at even times; unpacks as ``t, u, y``.

    Attributes
    ----------
    t, u, y : (N,) array
        Times in seconds, the input, held from each sample to the next, and the output.
    free : (N,) array of bool
        Where the output was measured, and is not stuck at a limit.
    remarks, notes, name : tuple of str, tuple of str, str
        What was noticed and must be heeded, what was done in reading it (units converted, a few
        missing samples filled in), and where it comes from.
    input_before : float or None
        What the input was before the record, with the plant at rest; None if that is not known.
    """

    t: FloatArray = field(repr=False)
    u: FloatArray = field(repr=False)
    y: FloatArray = field(repr=False)
    free: BoolArray = field(repr=False)
    remarks: tuple[str, ...] = ()
    name: str = ""
    notes: tuple[str, ...] = ()
    input_before: float | None = None

    def __iter__(self) -> Iterator[FloatArray]:
        return iter((self.t, self.u, self.y))

    @property
    def inputs(self) -> FloatArray:
        """The input, less what it was before the record, or else less its first value."""
        return self.u - (self.u[0] if self.input_before is None else self.input_before)

    @property
    def sampling_time(self) -> float:
        """Time from one sample to the next, in seconds."""
        return float((self.t[-1] - self.t[0]) / (self.t.size - 1))


def checked_record(
    t: Any,
    u: Any,
    y: Any,
    *,
    name: str = "",
    place: Callable[[int], str] = "sample {}".format,
    notes: tuple[str, ...] = (),
    remarks: tuple[str, ...] = (),
    input_before: float | None = None,
    numbers: Any = None,
) -> Record:
    """Make a record of three lists of numbers, or say what is wrong with them.

    Parameters
    ----------
    t, u, y : (N,) array_like
        Times in seconds, input and output. A few missing samples are filled in, and jitter of the
        times is resampled, with a note or a remark on how much.
    name, place : str, callable
        Where the record comes from, and what the sample of a number is called in messages.
    notes, remarks : tuple of str
        What was done and noticed before.
    input_before : float, optional
        What u was before the record, with the plant at rest: what a first sample steps from.
    numbers : (N,) array_like of int, optional
        Which samples they are, from 0 on, where some are known to be missing.

    Raises
    ------
    TypeError, ValueError
        If they are no numbers, are of different lengths, too few, not finite, not evenly sampled
        (and cannot be resampled without hiding something), or constant.
    """
    times, inputs, outputs = (
        _numbers(values, called, place) for values, called in ((t, "t"), (u, "u"), (y, "y"))
    )
    if not times.size == inputs.size == outputs.size:
        raise ValueError(
            f"t, u and y have {times.size}, {inputs.size} and {outputs.size} values; each time "
            "needs one of each"
        )
    if times.size < SHORTEST:
        raise ValueError(
            f"the record has {times.size} samples; at least {SHORTEST} are needed, better some "
            "hundred, and long enough for the output to answer"
        )
    if times[0] >= SINCE_1970:
        notes = (*notes, f"times count from {times[0]:.10g} s, that of the first sample")
        times = times - times[0]
    if input_before is not None:
        input_before = _before(input_before)
        notes = (*notes, f"before it u is {input_before:g}, as you say, and the plant at rest")
    moves = inputs if input_before is None else np.append(input_before, inputs)
    _check_moving(moves, outputs)
    free, noticed = np.ones(outputs.size, dtype=bool), _far_inputs(inputs, place)
    if (spikes := _spikes(moves, outputs)).size:
        free[spikes] = False
        more = f", and {spikes.size - 1} more" if spikes.size > 1 else ""
        noticed.append(
            f"y is {outputs[spikes[0]]:g} at {place(int(spikes[0]))}{more}, far from the samples "
            f"beside it: taken for {'outliers' if more else 'an outlier'} and left out; look what "
            "the sensor did there"
        )
    every = np.arange(outputs.size)
    unstuck, cut = _stuck(np.interp(every, every[free], outputs[free]), place)
    free &= unstuck
    noticed += cut
    if unstuck.all() and (stop := _stopped(outputs)) is not None:
        free[stop] = False
        noticed.append(
            f"y moves on steadily until {place(stop.start)}, and then rests at "
            f"{outputs[stop].mean():.3g} without its noise: it looks stopped by a limit, and these "
            f"{stop.stop - stop.start} samples are left out; measure again with a smaller input"
        )
    if look_swapped(inputs, outputs):
        noticed.append(
            "y rests or jumps between a few values and u moves far more, as if u and y were "
            "swapped: name the columns; if they are right, the sensor is too coarse"
        )
    counted = every if numbers is None else np.asarray(numbers)
    if counted.shape != every.shape or (np.diff(counted) < 1).any():
        raise ValueError("numbers must tell of each sample which one it is, and grow")
    counted = counted - counted[0]
    even = evenly_sampled(times, inputs, outputs, place, counted)
    if np.ptp(even.u[:-1]) == 0 and input_before in (None, even.u[0]):
        raise ValueError(
            "u changes at the last sample only: let the record go on after the step; or, if it "
            f"begins with one, {BEFORE}"
        )
    if even.t.size != times.size or not np.array_equal(even.t, times):
        free = np.interp(even.t, times, free) > 1 - 1e-9
    return Record(
        even.t, even.u, even.y, free & even.measured, (*remarks, *even.remarks, *noticed), name,
        (*notes, *even.notes), input_before,
    )  # fmt: skip


def _far_inputs(inputs: FloatArray, place: Callable[[int], str]) -> list[str]:
    """Find where u is what a controller may have asked for, but hardly what an actuator did."""
    aside = int(MIDDLE * inputs.size) + 1
    low, high = np.sort(inputs)[[aside, -1 - aside]].tolist()
    far = np.flatnonzero(np.abs(inputs - (low + high) / 2) > (IMPOSSIBLE + 0.5) * (high - low))
    if high == low or not far.size:
        return []
    more = f", and in {far.size - 1} more samples as far away" if far.size > 1 else ""
    return [
        f"u is {inputs[far[0]]:g} at {place(int(far[0]))}{more}, while otherwise it moves "
        f"between {low:g} and {high:g}: if the actuator cannot do that, cut u off at its limits or "
        "correct these samples, for they decide about the fit"
    ]


def look_swapped(u: FloatArray, y: FloatArray) -> bool:
    """Say whether u looks measured, and y like what somebody has set."""
    moves_of_u, moves_of_y = (int(np.count_nonzero(np.diff(values))) for values in (u, y))
    values_of_u, values_of_y = (np.unique(values).size for values in (u, y))
    few = values_of_y <= FEW and values_of_u > SWAPPED * values_of_y
    return bool(moves_of_u > SWAPPED * max(moves_of_y, 1) or few)


def _before(value: Any) -> float:
    if not is_real(value):
        raise TypeError(f"input_before is {value!r}; give a number in the units of u, such as 0")
    if not abs(float(value)) < LARGEST:
        raise ValueError(f"input_before is {value}; give a finite number in the units of u")
    return float(value)


def _check_moving(inputs: FloatArray, outputs: FloatArray) -> None:
    """Refuse what does not change, with what to do about it."""
    for values, called, remedy in (
        (inputs, "u", "make a step, or any signal that moves, and begin the record before it; or, "
         f"if it begins with the step, {BEFORE}"),
        (outputs, "y", "look whether the sensor is connected, or make a larger step"),
    ):  # fmt: skip
        if np.ptp(values) <= 1e-12 * np.abs(values).max():
            raise ValueError(
                f"{called} is {values[-1]:g} in the whole record: nothing can be learned from it; "
                f"{remedy}"
            )


def _numbers(values: Any, called: str, place: Callable[[int], str]) -> FloatArray:
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different length
        array = np.array([None], dtype=object)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{called} holds {array.dtype} values; it must be a list of real numbers")
    if array.ndim != 1:
        raise ValueError(f"{called} has shape {array.shape}; it must be a list of numbers")
    array = array.astype(float)
    bad = np.flatnonzero(~(np.abs(array) < LARGEST))
    if bad.size:
        many = f", and {bad.size - 1} more" if bad.size > 1 else ""
        raise ValueError(
            f"{called} is {array[bad[0]]:g} at {place(int(bad[0]))}{many}; every sample needs a "
            "finite number: cut the record there, or fill a short gap yourself"
        )
    return array


def _stuck(outputs: FloatArray, place: Callable[[int], str]) -> tuple[BoolArray, list[str]]:
    """Find where the output runs into an extreme value abruptly, not in ever smaller steps."""
    steps = np.abs(np.diff(outputs))
    moves = np.abs(outputs[STUCK:] - outputs[:-STUCK])  # of several samples: noise is no motion
    coarse = COARSE * resolution(outputs)
    abrupt, far = (max(ABRUPT * each.max(), coarse) for each in (steps, moves))
    begins = np.flatnonzero(np.diff(outputs, prepend=np.nan))
    lasts = np.diff(begins, append=outputs.size)
    cut = [
        first
        for first in begins[lasts >= STUCK].tolist()
        if steps[max(first - 2, 0) : first].max(initial=0.0) > abrupt
        and moves[max(first - STUCK, 0)] > far
    ]
    free = np.ones(outputs.size, dtype=bool)
    remarks: list[str] = []
    extremes = {outputs.max(): "largest", outputs.min(): "smallest"}
    if any(outputs[first] not in extremes for first in cut):  # the sensor rests elsewhere as well
        return free, remarks
    for extreme, called in extremes.items():
        places = [first for first in cut if outputs[first] == extreme]
        if places:
            held = outputs == extreme
            free &= ~held
            remarks.append(
                f"y stays at its {called} value, {extreme:g}, for {held.sum()} samples, at "
                f"{place(places[0])} after it was still moving fast: it looks cut off by a limit, "
                "and these samples are left out; measure again with a smaller input"
            )
    return free, remarks


def _stopped(outputs: FloatArray) -> slice | None:
    """Find where the output, moving steadily, comes to a sudden rest at its largest or smallest.

    No settling output does, whose steps become smaller; one that integrates keeps its noise.
    """
    noise, coarse = np.abs(np.diff(outputs, 2)), COARSE * resolution(outputs)
    moves = outputs[STUCK:] - outputs[:-STUCK]
    largest = np.abs(moves).max()
    for extreme in (outputs.max(), outputs.min()):
        near = np.abs(outputs - extreme) <= CLOSE * np.ptp(outputs)
        for first, behind in runs(near).tolist():
            if behind - first < RESTS or first < 2 * STUCK:
                continue
            before, last = moves[first - 2 * STUCK], moves[first - STUCK]
            steady = min(abs(before), abs(last)) > 0.5 * max(abs(before), abs(last))
            fast = before * last > 0 and abs(last) > ABRUPT * largest
            if not (steady and fast):
                continue
            usual = float(np.median(noise[: first - STUCK]))
            quiet = noise[first : behind - 2].mean() < QUIET * usual
            if quiet and usual > coarse:
                return slice(first, behind)
    return None


def _spikes(moves: FloatArray, outputs: FloatArray) -> IntArray:
    """Find samples to which y leaps and from which it leaps back, or with which it begins or ends.

    Elsewhere its steps are far smaller, and the input does not explain it.
    """
    turns = np.abs(np.diff(moves, prepend=moves[0])[-outputs.size :])
    moved, far = turns > 0, np.flatnonzero(turns > turns.max() / 2)
    # The record begins and ends as if y came from where it goes, and went back to where it was.
    first = outputs[0 if moved[:2].any() else 1]
    last = outputs[-1 if moved[-PULSE:].any() else -2]
    steps = np.diff(outputs, prepend=first, append=last)
    sizes = np.abs(steps)
    order = np.argsort(-sizes)[: 2 * MOST_SPIKES]
    for count in range(order.size, 1, -1):
        leaps = np.sort(order[:count])
        least = sizes[order[count - 1]]
        back = np.abs(np.cumsum(steps[leaps])) < least / 2  # to where y was at first
        groups = np.split(leaps, 1 + np.flatnonzero(back[:-1]))
        spikes = np.concatenate([np.arange(group[0], group[-1]) for group in groups])
        lasting = max(map(np.ptp, groups))
        if not back[-1] or lasting > LASTING or spikes.size > MOST_SPIKES:
            continue
        others = np.delete(sizes, np.union1d(spikes, spikes + 1)).max(initial=0.0)
        largest = [group[sizes[group] > sizes[group].max() / 2] for group in groups]
        # Were there many more moves as large, y would have leapt after each.
        explained = far.size <= 2 * count and any(_explained(group, far) for group in largest)
        if 0 < others < least / SPIKE and not explained:
            return spikes
    return order[:0]


def _explained(leaps: IntArray, moved: IntArray) -> bool:
    """Whether the input moved before as y leaps, a fraction of a sample being one or two leaps."""
    causes = moved if np.ptp(leaps) == 1 else np.union1d(moved, moved + 1)
    late = leaps[:, None] - np.arange(leaps[-1] + 1)
    return bool(np.isin(late, causes).all(axis=0).any())


def resolution(outputs: FloatArray) -> float:
    """Step of a coarse sensor, of which most others are multiples; 0 if there is none."""
    steps = np.abs(np.diff(outputs))
    moved = steps[steps > 0]
    # Written with few digits, alike steps differ by some per cent.
    usual = float(np.median(moved[moved <= 1.1 * np.median(moved)]))
    multiples = moved / usual
    off = np.abs(multiples - np.round(multiples))
    return usual if np.mean(off < 0.05 * np.maximum(multiples, 1)) > 0.9 else 0.0
