"""Records out of files: tables as they are found, read as text and nothing else.

A cell is a number, a time or an error; nothing in a file is ever run, and nothing is guessed that
the record does not say. Line numbers in messages are those of an editor.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import product
from math import isfinite
from os import PathLike
from pathlib import Path
from statistics import mode

import numpy as np

from ..diagram import real_number
from ..numerics import FloatArray
from .columns import SAMPLING, Choice, checked_columns, chosen
from .parsing import ABSENT, THOUSANDS, UNITS, is_moment, number_in, parted, seconds_in, short
from .records import SHORTEST, Record, checked_record, look_swapped
from .resampling import MISSING
from .textfiles import SEEN, Sheet, read_sheet

__all__ = ["heated_air", "read_data"]

# Days since 1970, 1900 (of spreadsheets, in the years 1982 to 2064), the year 0 and 4713 BC, and
# the steps below which they are taken for such, if they have decimals and last less than ten.
DAYS = {
    (1e4, 3e4): 1e-2, (3e4, 6e4): np.inf, (7.2e5, 7.6e5): 1e-2, (2.4e6, 2.5e6): 1e-2,
}  # fmt: skip
# Until then whole milliseconds, microseconds and nanoseconds since 1970 are told by their size.
EPOCHS = {"ms": 1e14, "us": 1e17, "ns": np.inf}
# Units of 100 ns since 1601 and the year 1, of the years 1981 to 2044 and 1965 to 2060.
TICKS = ((1.2e17, 1.4e17), (6.2e17, 6.5e17))
# Steps that are hardly seconds, more than a day, and those that are rather ns than us.
LONG, NANO = 9e4, 1e8
# What may be thousands that a mark parts, and what has decimals behind it.
PARTED = {mark: re.compile(rf"[+-]?[1-9]\d{{0,2}}([{mark}]\d{{3}})+") for mark in ".,"}
DECIMAL = {mark: re.compile(rf"[+-]?\d+[{mark}]\d+") for mark in ".,"}
SWITCHED = {"off": "0", "false": "0", "on": "1", "true": "1"}
HEATED_AIR_STEP = 0.08


def read_data(
    path: str | PathLike[str],
    *,
    sampling_time: float | None = None,
    columns: Mapping[str, str | int] | None = None,
    input_before: float | None = None,
) -> Record:
    r"""Read a record from a table of columns t, u, y.

    Columns are found by their headings (t or time, u or input, y or output, in any order, with
    units) or, where these do not say, taken in the order t, u, y, with a remark. They are separated
    by tabs, semicolons, vertical bars, white space or commas; the decimal mark is a point or a
    comma (in quotes, if commas separate the columns). Times are numbers in the unit that their
    heading names (else seconds), dates or times of day; a column of these needs no heading that
    says so. An input that is on or off, or true or false, is 1 or 0. Lines in which u or y is
    empty, nan, null or a dash are missing, of which a few are filled in. Lines that begin with #, %
    or // are left out, and so is what stands above the headings, or tells of the columns between
    them and the numbers; a row of units may follow the headings.
    The file is UTF-8, UTF-16 or Latin-1.

    Parameters
    ----------
    path : str or path
        The file.
    sampling_time : float, optional
        In seconds, for a table without times, or with times that are not to be used.
    columns : mapping, optional
        Heading or number (from 1 on) of the columns of "t", "u" and "y"; those that are found by
        themselves may be left out. The unit of times may stand behind: ``{"t": "1 [ms]"}``.
    input_before : float, optional
        What u was before a record that begins with the step, with the plant at rest.

    Returns
    -------
    Record
        Times in seconds, input and output; unpacks as ``t, u, y``. Its notes and remarks say what
        was converted, left out, filled in and taken for granted.

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
    ...     rows = (f"{100 * k};{k % 7 // 3};{k % 5},5" for k in range(30))
    ...     _ = path.write_text("time [ms];Heater;Oven\n" + "\n".join(rows))
    ...     record = read_data(path, columns={"u": "Heater", "y": "Oven"})
    >>> record.t[-1].item(), record.y[:3].tolist(), record.notes
    (2.9, [0.5, 1.5, 2.5], ('times are in ms; they were converted to seconds',))
    """
    asked = checked_columns(columns)
    if sampling_time is not None:
        real_number(sampling_time, "sampling_time", "give positive seconds, such as 0.1", above=0)
        if "t" in asked:
            raise ValueError("sampling_time and a column t are given; one of them must do")
    path = Path(path)
    sheet = read_sheet(path)
    heads = sheet.heads or [""] * len(sheet.rows[0])
    table = f"line {sheet.head_line} of {short(path.name)}" if sheet.heads else short(path.name)
    _check_widths(sheet, len(heads))
    first = next(iter(sheet.rows), [])
    dates = [k for k, cell in enumerate(first) if number_in(cell) is None and is_moment(cell)]
    moments = [k for k in dates if ":" in first[k]] or dates  # a date beside the time of day
    blank = [k for k in range(len(heads)) if sheet.rows and not any(_column(sheet, k))]
    choice = chosen(heads, asked, sampling_time is None, table, moments, dates + blank)
    written = {what: list(_column(sheet, k)) for what, k in choice.order.items()}
    samples, absent = _complete(written, sheet.lines)
    cells = {what: [column[k] for k in samples] for what, column in written.items()}
    # From here on only these cells are read.
    sheet = replace(sheet, rows=(), lines=[sheet.lines[k] for k in samples])
    cells["u"], switched = _switched(cells["u"])
    _check_marks(cells, sheet.lines)
    (u, unit_of_u), (y, unit_of_y) = (_numbers(sheet, what, cells[what]) for what in ("u", "y"))
    if choice.remarks and look_swapped(u, y):
        raise ValueError(
            f"nothing in {short(path.name)} says which column is u and which is y, and in the "
            "order t, u, y the output would rest or jump between a few values, as an input does, "
            "and the input move like an output: name them, such as --columns "
            f"u={choice.order['y'] + 1},y={choice.order['u'] + 1} (in Python columns="
            f"{{'u': {choice.order['y'] + 1}, 'y': {choice.order['u'] + 1}}})"
        )
    if choice.remarks and (np.diff(u) > 0).all():
        raise ValueError(
            f"column {choice.order['u'] + 1} of {short(path.name)} grows in every line, as times "
            "do, and no heading says that it is the input: a record needs one of the input and one "
            "of the output; name them, --columns u=2,y=3 (in Python columns={'u': 2, 'y': 3})"
        )
    notes, remarks = sheet.notes + absent, choice.remarks + switched
    for what, unit in (("u", unit_of_u), ("y", unit_of_y)):
        notes += (f"{what} is in {unit}, which stands in its cells",) * bool(unit)
    if sampling_time is None:
        times, said = _times(sheet, choice, cells["t"])
        notes += said
    else:
        if sheet.blank:
            raise ValueError(
                f"line {sheet.blank} is empty, and without times each line is one sample: take it "
                "out, or put in the sample that is missing"
            )
        times = sampling_time * np.array(samples)
    try:
        return checked_record(
            times, u, y, name=path.name, place=lambda k: f"line {sheet.lines[k]}", notes=notes,
            remarks=remarks, input_before=input_before, numbers=samples,
        )  # fmt: skip
    except ValueError as error:
        raise ValueError("; ".join([str(error), *remarks])) from None


def heated_air() -> Record:
    """Read 1,000 samples measured on a laboratory plant, one every 0.08 s.

    The input is binary, 3.41 or 6.41; the output lies between 3.2 and 6.25. The file does not name
    its plant, nor its sampling time. Length, levels and dynamics are those of the hot-air trainer
    PT326, a classic of system identification: a fan blows air through a tube, a resistor heats it,
    a thermistor at the outlet measures; it was sampled every 0.08 s.

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


def _check_widths(sheet: Sheet, width: int) -> None:
    """Refuse rows that are too short or too long.

    What stands behind the others in a few rows, if at all, as a comment does, may lack, unless
    the heading may have been parted at a comma or a blank of its own.
    """
    if len(sheet.rows) < SHORTEST <= width:
        raise ValueError(
            f"the table has {len(sheet.rows)} rows and {width} columns; a record has a row for "
            "each sample: exchange rows and columns"
        )
    usual = mode(map(len, sheet.rows)) if sheet.rows else width
    least = usual if usual == width - 1 and sheet.separator not in ", " else width
    for number, row in zip(sheet.lines, sheet.rows, strict=True):
        if least <= len(row) <= width:
            continue
        if len(row) > width and not any(cell.strip() for cell in row[width:]):
            continue
        remedies = []
        if sheet.separator == "," and len(row) > width:
            remedies.append("if a comma stands in numbers, separate the columns by semicolons")
        if sheet.head_line and len(row) == usual == width + 1:
            remedies.append("a heading is missing: give each column one")
        if sheet.head_line and number == sheet.lines[0]:
            remedies.append("take out what stands above the headings, if anything does")
        if not remedies:
            remedies.append("take that line out")
        raise ValueError(
            f"line {number} has {len(row)} cell{'s' * (len(row) != 1)} where the first has {width}"
            + "; ".join(["", *remedies])
        )


def _column(sheet: Sheet, k: int) -> Iterator[str]:
    """Give the cells of a column; what a row lacks at its end is empty."""
    return (row[k].strip() if k < len(row) else "" for row in sheet.rows)


def _complete(
    cells: Mapping[str, Sequence[str]], lines: Sequence[int]
) -> tuple[list[int], tuple[str, ...]]:
    """Find the lines in which neither u nor y is missing, and note how many are left out."""
    lost = {k: w for w in ("y", "u") for k, cell in enumerate(cells[w]) if cell.lower() in ABSENT}
    kept = [k for k in range(len(lines)) if k not in lost]
    if not lost:
        return kept, ()
    first, more = min(lost), len(lost) - 1
    if len(lost) > MISSING * len(lines):
        what = lost[first]
        raise ValueError(
            f"line {lines[first]}: {what} {_said(cells[what][first])}, and values are missing in "
            f"{len(lost)} of {len(lines)} lines; at most {100 * MISSING:g} % are filled in: use a "
            "stretch without gaps, and repeat in every line what is written only where it changes"
        )
    said = f"values are missing in line {lines[first]}" + f" and {more} more" * (more > 0)
    return kept, (f"{said}: left out",)


def _switched(cells: list[str]) -> tuple[list[str], tuple[str, ...]]:
    """Write 1 and 0 for an input that is on or off throughout, with a remark."""
    words = set(cells)
    if not words or not {word.lower() for word in words} <= SWITCHED.keys():
        return cells, ()
    named = " or ".join(map(repr, sorted(words, key=lambda word: SWITCHED[word.lower()])))
    return [SWITCHED[cell.lower()] for cell in cells], (
        f"u is {named}, read as 0 and 1: a controller gives values between them, so switch the "
        "actuator on for that share of each of many short periods, or use one that can be set",
    )


def _check_marks(cells: Mapping[str, Sequence[str]], lines: Sequence[int]) -> None:
    """Refuse what may part thousands, where another column has it the other way round."""
    for what, (mark, called, other) in product(cells, ((".", "point", ","), (",", "comma", "."))):
        marked = [k for k, cell in enumerate(cells[what][:SEEN]) if mark in cell]
        elsewhere = (
            (beside, cell) for beside in cells if beside != what for cell in cells[beside][:SEEN]
        )
        decimals = [(beside, cell) for beside, cell in elsewhere if DECIMAL[other].fullmatch(cell)]
        if marked and decimals and all(PARTED[mark].fullmatch(cells[what][k]) for k in marked):
            beside, cell = decimals[0]
            raise ValueError(
                f"line {lines[marked[0]]}: {what} is {short(cells[what][marked[0]])!r}, which may "
                f"have a {called} between thousands where {beside} has {short(cell)!r}: use one "
                "decimal mark, and no separator of thousands"
            )


def _said(cell: str) -> str:
    return f"is {short(cell)!r}, which is no finite number" if cell else "is empty"


def _numbers(sheet: Sheet, what: str, written: Sequence[str]) -> tuple[FloatArray, str]:
    """Read the numbers of a column, and the unit behind each; or name the first that is none."""
    parts = [parted(cell) if number_in(cell) is None else (cell, "") for cell in written]
    cells = [number for number, _ in parts]
    values = [number_in(cell) for cell in cells]
    units = {parts[k][1]: k for k in reversed(range(len(cells))) if values[k] is not None}
    if len(units) > 1:
        first, other = sorted(units.values())[:2]
        here, there = short(written[other]), short(written[first])
        raise ValueError(
            f"line {sheet.lines[other]}: {what} is {here!r} where line {sheet.lines[first]} has "
            f"{there!r}: write all in one unit, or without any"
        )
    _check_decimals(sheet, what, cells)
    for k, value in enumerate(values):
        if value is None or not isfinite(value):
            none = all(each is None for each in values)
            raise ValueError(f"line {sheet.lines[k]}: {what} {_remedy(what, cells[k], none)}")
    return np.array(values, dtype=float), "".join(units)


def _remedy(what: str, cell: str, none: bool) -> str:
    """Say that a cell is no finite number, or that none of its column is, and what to do."""
    thousands = THOUSANDS.fullmatch(cell)
    if none and cell and not thousands:
        words = (
            f"write times as 2024-01-31 12:00:00, or {SAMPLING}"
            if what == "t"
            else "write numbers in place of words, such as 1 for on and 0 for off, and give "
            "signals that share a column a column each"
        )
        return f"is {short(cell)!r}, and no line has a number there: name another column; {words}"
    more = (
        "; write thousands without a separator" if thousands else ", or fill a short gap yourself"
    )
    if what == "t" and not cell:
        more += f"; or, if the samples are even, {SAMPLING}"
    return (
        f"{_said(cell)}; cut the record there, take the line out (a few missing lines are filled "
        f"in){more}"
    )


def _check_decimals(sheet: Sheet, what: str, cells: Sequence[str]) -> None:
    """Refuse a column in which a comma may be a decimal mark or part thousands."""
    commas, points = (
        [k for k, cell in enumerate(cells) if mark in cell and other not in cell]
        for mark, other in (",.", ".,")
    )
    if commas and points:
        other, k = sorted((commas[0], points[0]))
        raise ValueError(
            f"line {sheet.lines[k]}: {what} is {short(cells[k])!r} where another line has "
            f"{short(cells[other])!r}: use one decimal mark, and no separator of thousands"
        )
    unlike = len(commas) < len(cells) or sheet.separator == ","
    # Who leaves out the zeros of 950.000 leaves out that of 1.150, too, if it is a decimal.
    hundreds = any(re.fullmatch(r"[+-]?[1-9]\d\d", cell) for cell in cells)
    grown = hundreds and any(cells[k].endswith("0") for k in points)
    for mark, marked, doubtful in ((",", commas, unlike), (".", points, grown)):
        if marked and doubtful and all(PARTED[mark].fullmatch(cells[k]) for k in marked):
            cell = cells[marked[0]]
            raise ValueError(
                f"line {sheet.lines[marked[0]]}: {what} is {short(cell)!r}, which may be "
                f"{cell.replace(',', '.')} or {cell.replace(mark, '')}: write thousands without "
                "a separator, and decimals with a point"
            )


def _times(
    sheet: Sheet, choice: Choice, cells: Sequence[str]
) -> tuple[FloatArray, tuple[str, ...]]:
    """Read the times in seconds, and say how."""
    column = choice.order["t"]
    if cells and number_in(cells[0]) is None and is_moment(cells[0]):
        times, first = seconds_in(cells, lambda k: f"line {sheet.lines[k]}")
        return times, (f"t is in seconds since {first}, the time of the first row",)
    times, within = _numbers(sheet, "t", cells)
    below = sheet.units[column] if column < len(sheet.units) else ""
    # Dashes and colons draw the line below the headings of a table in a text.
    unit = choice.unit or below.strip(" \t[]()-=:").lower() or within
    if not unit:
        return _without_unit(times, sheet.heads[column] if sheet.heads else "")
    seconds = UNITS.get(unit.lower())
    if seconds is None:
        raise ValueError(
            f"t is in {short(unit)!r}, which is no unit of time that is known: give one of "
            f"{', '.join(each for each in UNITS if len(each) < 4)}, such as --columns "
            f'"t={column + 1} [ms]" (in Python columns={{"t": "{column + 1} [ms]"}})'
        )
    if within and UNITS.get(within.lower()) != seconds:
        raise ValueError(
            f"t is in {short(unit)} by its heading, and {within!r} stands in its cells: correct one"
        )
    if seconds == 1.0:
        return times, ()
    # Exact where the unit is a whole number of seconds, or seconds are of it.
    times = times * seconds if seconds > 1 else times / round(1 / seconds)
    return times, (f"times are in {unit}; they were converted to seconds",)


def _without_unit(times: FloatArray, head: str) -> tuple[FloatArray, tuple[str, ...]]:
    """Take seconds, unless the numbers can hardly be that."""
    said = "no unit of time is named; seconds were taken"
    if times.size < 2:
        return times, (said,)
    start, span, step = times[0], np.ptp(times), float(np.median(np.abs(np.diff(times))))
    days = span < 10 and (times % 1).any() and any(
        low <= start <= high and step < most for (low, high), most in DAYS.items()
    )  # fmt: skip
    date = head.lower().startswith("date") and start < 1e8
    if not (days or date or start >= 1e11 or step > LONG):
        counted = start in (0, 1) and (np.diff(times) == 1).all()
        return times, (f"{said}: 1 s a sample is assumed" if counted else said,)
    begins = f"t begins with {start:.17g} and its unit is not named; "
    if moment := _written_together(start):
        raise ValueError(
            f"{begins}it looks like {moment} without the marks between: write times with them, or "
            "in seconds"
        )
    if any(low <= start <= high for low, high in TICKS):
        raise ValueError(
            f"{begins}it looks like a count of 100 ns: divide by 10000000, and write seconds from "
            f"the first row on; or, if the samples are even, {SAMPLING}"
        )
    since = next(unit for unit, most in EPOCHS.items() if start < most)
    guess = "d" if days or date else since if start >= 1e11 else "us" if step < NANO else "ns"
    raise ValueError(
        f"t begins with {start:.12g}, with steps of {step:.5g}, and its unit is not named; this "
        f"can hardly be seconds: name the unit in the heading, or say it, such as --columns "
        f'"t={short(head) or 1} [{guess}]" (in Python columns={{"t": '
        f'"{short(head) or 1} [{guess}]"}})'
    )


def _written_together(number: float) -> str:
    """Read a number as year, month, day, hour, minute and second; empty if it is none."""
    try:
        together = f"{int(number):014}"  # two digits each, and four of the year
        return str(datetime.strptime(together, "%Y%m%d%H%M%S")) if number >= 1e13 else ""
    except ValueError:
        return ""
