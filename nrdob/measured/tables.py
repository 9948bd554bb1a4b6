"""Records out of files: columns of numbers, read as text and nothing else.

A cell is a number or an error; nothing in a file is ever run. Line numbers in messages are those of
an editor.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from itertools import islice
from math import isfinite
from numbers import Real
from os import PathLike
from pathlib import Path

import numpy as np

from ..numerics import FloatArray
from .records import Record, checked_record

__all__ = ["heated_air", "read_data"]

MOST_BYTES, MOST_ROWS = 50_000_000, 200_000
"""Sizes beyond which a file is refused."""

LONGEST = 60
"""Characters of a cell or a heading that a message repeats."""

HEADINGS = {
    "t": ("t", "time", "seconds", "sec", "s", "zeit"),
    "u": ("u", "input", "in", "control", "u1"),
    "y": ("y", "output", "out", "measurement", "y1"),
}
"""Headings known, without units in brackets and in small letters."""

HEATED_AIR_STEP = 0.08


def read_data(path: str | PathLike[str], *, sampling_time: float | None = None) -> Record:
    r"""Read a record from a table of columns t, u, y.

    Columns are told by their headings (t or time, u or input, y or output, in any order, with units
    in brackets) or, without known headings, taken in the order t, u, y. They are parted by tabs,
    semicolons or commas; beside tabs or semicolons a comma in a number is a decimal comma. Lines
    that begin with # are left out.

    Parameters
    ----------
    path : str or path
        The file.
    sampling_time : float, optional
        In seconds, for a table without times: columns u and y.

    Returns
    -------
    Record
        Times, input and output; unpacks as ``t, u, y``.

    Raises
    ------
    TypeError, ValueError
        If the table is no such record. The message says in which line, and what to change.
    OSError
        If the file cannot be read.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "data.csv"
    ...     rows = (f"{k / 10};{k % 7 // 3};{k % 5},5" for k in range(30))
    ...     _ = path.write_text("time [s];u;y\n" + "\n".join(rows))
    ...     t, u, y = read_data(path)
    >>> t[-1].item(), y[:3].tolist()
    (2.9, [0.5, 1.5, 2.5])
    """
    if sampling_time is not None:
        if isinstance(sampling_time, bool) or not isinstance(sampling_time, Real):
            raise TypeError(f"sampling_time is {sampling_time!r}; give seconds, such as 0.1")
        if not (isfinite(sampling_time) and sampling_time > 0):
            raise ValueError(f"sampling_time is {sampling_time}; give positive seconds")
    path = Path(path)
    lines = _lines(path)
    delimiter = _delimiter(lines)
    rows = list(csv.reader((text for _, text in lines), delimiter=delimiter, strict=False))
    numbers = [number for number, _ in lines]
    if len(rows) != len(numbers):
        raise ValueError(f"{_short(path.name)} has a quoted cell that goes over several lines")
    first = [cell.strip() for cell in rows[0]]
    headed = any(_value(cell, delimiter) is None and cell for cell in first)
    if headed:
        rows, numbers = rows[1:], numbers[1:]
    order, remarks = _order(first, headed, sampling_time, path.name)
    table = _table(rows, numbers, order, len(first), delimiter)
    times = table[:, 0] if "t" in order else (sampling_time or 0.0) * np.arange(len(table))
    return checked_record(
        times,
        table[:, -2],
        table[:, -1],
        name=path.name,
        place=lambda k: f"line {numbers[k]}",
        remarks=remarks,
    )


def heated_air() -> Record:
    """Read 1,000 samples measured on a laboratory plant, one every 0.08 s.

    The input is binary, 3.41 or 6.41; the output lies between 3.2 and 6.25. The file does not name
    its plant, nor its sampling time. Length, levels and dynamics are those of the hot-air trainer
    PT326, a classic of system identification: a fan blows air through a tube, a resistor heats it,
    a thermistor at the outlet measures; it was sampled every 0.08 s.

    Returns
    -------
    Record
        The record.

    References
    ----------
    Example data of routine IB01AD of the SLICOT library (BSD-3-Clause, see heated_air.txt beside
    the file), as shipped with the Python package slycot 0.7.1. The hot-air trainer: L. Ljung,
    System Identification, 2nd ed., 1999; DaISy 96-006.

    Examples
    --------
    >>> record = heated_air()
    >>> record.u.size, float(record.u.min()), float(record.u.max())
    (1000, 3.41, 6.41)
    """
    return read_data(Path(__file__).with_name("heated_air.csv"), sampling_time=HEATED_AIR_STEP)


def _lines(path: Path) -> list[tuple[int, str]]:
    """Lines that hold something, with their numbers; or say why there are none."""
    with path.open("rb") as file:
        raw = file.read(MOST_BYTES + 1)
    name = _short(path.name)
    if len(raw) > MOST_BYTES:
        raise ValueError(
            f"{name} is larger than {MOST_BYTES // 10**6} MB; cut out the stretch that matters, "
            "some thousand samples"
        )
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise ValueError(
            f"{name} is no text in UTF-8, see line {line}: save it as CSV, not as a spreadsheet"
        ) from None
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        raise ValueError(f"{name} is no table of text, see line {line}: save it as CSV")
    every = enumerate(text.splitlines(), 1)
    found = [(k, line) for k, line in every if line.strip() and not line.lstrip().startswith("#")]
    if not found:
        raise ValueError(f"{name} is empty; it needs columns t, u and y")
    if len(found) > MOST_ROWS:
        raise ValueError(
            f"{name} has {len(found)} lines; at most {MOST_ROWS} are read: cut out the stretch "
            "that matters, or keep every tenth line"
        )
    return found


def _delimiter(lines: Iterable[tuple[int, str]]) -> str:
    """Find what parts the columns: what stands in every one of the first lines."""
    seen = [text for _, text in islice(lines, 50)]
    for each in "\t;,":
        if all(each in text for text in seen):
            return each
    return ","


def _order(
    first: Sequence[str], headed: bool, sampling_time: float | None, name: str
) -> tuple[dict[str, int], tuple[str, ...]]:
    """Tell which column holds what."""
    clean = [cell.split("[")[0].split("(")[0].strip().lower() for cell in first]
    found = {
        what: clean.index(word)
        for what, words in HEADINGS.items()
        for word in reversed(words)
        if headed and word in clean
    }
    wanted = ("t", "u", "y") if sampling_time is None else ("u", "y")
    if all(what in found for what in wanted):
        return {what: found[what] for what in wanted}, ()
    told = f"line 1 of {_short(name)} has the columns {', '.join(map(_short, first))}"
    if headed and "t" not in found and {"u", "y"} <= found.keys():
        raise ValueError(
            f"{told}, and no time: add a column t in seconds, or give the sampling time"
        )
    if len(first) == len(wanted) and not found:
        remarks = (f"the columns were taken in the order {', '.join(wanted)}",)
        return {what: k for k, what in enumerate(wanted)}, remarks
    if headed:
        missing = ", ".join(what for what in wanted if what not in found)
        raise ValueError(f"{told}; {missing} is missing: name the columns t, u and y")
    more = " (or give the sampling time, if there are only u and y)" if len(first) == 2 else ""
    raise ValueError(
        f"{_short(name)} has {len(first)} column{'s' * (len(first) != 1)} and no headings; it "
        f"needs {len(wanted)}: {', '.join(wanted)}, parted by commas, semicolons or tabs{more}"
    )


def _table(
    rows: Sequence[Sequence[str]],
    numbers: Sequence[int],
    order: dict[str, int],
    width: int,
    delimiter: str,
) -> FloatArray:
    """Read every cell that is needed, or name the first that is no number."""
    table = np.empty((len(rows), len(order)))
    for k, row in enumerate(rows):
        if len(row) != width:
            decimal = " (a comma in a number? part the columns by semicolons)" * (delimiter == ",")
            raise ValueError(
                f"line {numbers[k]} has {len(row)} cells where the first has {width}{decimal}"
            )
        for j, (what, column) in enumerate(order.items()):
            cell = row[column].strip()
            value = _value(cell, delimiter)
            if value is None or not isfinite(value):
                said = f"is {_short(cell)!r}, which is no finite number" if cell else "is empty"
                raise ValueError(
                    f"line {numbers[k]}: {what} {said}; cut the record there, or fill a short gap "
                    "yourself"
                )
            table[k, j] = value
    return table


def _value(cell: str, delimiter: str) -> float | None:
    """Read a number; None if it is none."""
    text = cell.strip()
    if delimiter != "," and "." not in text and text.count(",") == 1:
        text = text.replace(",", ".")
    if "_" in text or len(text) > LONGEST:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def _short(text: str) -> str:
    clean = "".join(c if c.isprintable() else "?" for c in text)
    return clean if len(clean) <= LONGEST else f"{clean[:LONGEST]}…"
