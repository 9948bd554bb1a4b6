"""What a cell of a table says: a number, with a point or a comma, or a time."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from datetime import date

import numpy as np

from ..numerics import FloatArray

__all__ = [
    "ABSENT", "NUMBER", "THOUSANDS", "UNITS", "is_moment", "is_value", "number_in", "parted",
    "seconds_in", "short",
]  # fmt: skip

LONGEST = 60  # characters of a cell or a heading that a message repeats
# Seconds in each unit of time that a heading may name, in small letters.
UNITS = {
    unit: seconds
    for units, seconds in (
        (("ns", "nsec", "nanos", "nanosec", "nanosecond", "nanoseconds"), 1e-9),
        (("us", "µs", "μs", "usec", "micros", "microsec", "microsecond", "microseconds"), 1e-6),
        (("ms", "msec", "millis", "millisecond", "milliseconds"), 1e-3),
        (("s", "sec", "secs", "second", "seconds", "sekunden"), 1.0),
        (("min", "mins", "minute", "minutes", "minuten"), 60.0),
        (("h", "hr", "hrs", "hour", "hours", "stunden"), 3600.0),
        (("d", "day", "days"), 86400.0),
    )
    for unit in units
}
# What stands where there is no value, in small letters.
ABSENT = ("", "-", "--", "---", "?", "nan", "na", "n/a", "#n/a", "#nv", "null", "none")
# A comma at its end separates columns.
NUMBER = re.compile(r"[+-]?(\d+([.,]\d+|\.)?|[.,]\d+)(e[+-]?\d+)?", re.I)
# With three figures in each group behind the first, and maybe decimals.
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}([\s.,'’]\d{3})+([.,]\d*)?")
# Digits of a unit are exponents, as in "m3/h", "m/s^2" or "min-1", and a blank stands before it.
MEASURED = re.compile(
    rf"(?P<number>{NUMBER.pattern})\s*(?P<unit>([^\W\d_]|[°%])([^\W\d_]|[°%/²³]){{0,7}}"
    r"|(?<=\s)[^\W\d_]([^\W\d_]|[/*·²³]|(?<=[^\W\d_])\^?-?\d(?!\d)){1,9})?",
    re.I,
)
MOMENT = re.compile(
    r"(?:(?P<days>[+-]?\d+)\s+days?,?\s+\+?(?=\d))?(?P<sign>^[+-])?"
    r"(?:(?P<day>\d{1,4}[-./](?:\d{1,2}|[a-z]{3,9})[-./]\d{1,4})(?:[t\s]\s*|$))?"
    r"(?:(?P<hour>\d{1,3}):(?P<minute>\d\d)(?::(?P<second>\d\d(?:[.,]\d+)?))?"
    r"(?:\s*(?P<half>[ap])\.?m\.?)?)?\s*(?P<zone>z|utc|gmt|[+-]\d\d:?\d\d)?",
    re.I,
)
MINUTES = re.compile(r"([+-]?)(\d{1,3}):(\d\d[.,]\d+)")  # and seconds, for no other has a fraction
ISO_DAY = re.compile(r"(\d{4})[-./](\d\d?)[-./](\d\d?)")


def short(text: str) -> str:
    """Repeat a piece of a file in a message: what cannot be printed as ?, and not too long."""
    clean = "".join(c if c.isprintable() else "?" for c in text)
    return clean if len(clean) <= LONGEST else f"{clean[:LONGEST]}…"


def number_in(cell: str) -> float | None:
    """Read a number with a decimal point or comma, maybe nan or inf; None if it is none.

    >>> number_in("-2,5"), number_in("1,234.5"), number_in("=1+1")
    (-2.5, None, None)
    """
    text = cell.strip().replace(",", ".")  # with a second one it is no number
    if "_" in text or len(text) > LONGEST:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def parted(cell: str) -> tuple[str, str]:
    """Part a number from the unit behind it; a cell that is no number comes back whole.

    >>> parted("21.5 °C"), parted("-2,5"), parted("off")
    (('21.5', '°C'), ('-2,5', ''), ('off', ''))
    """
    found = MEASURED.fullmatch(cell)
    return (found["number"], found["unit"] or "") if found else (cell, "")


def is_moment(cell: str) -> bool:
    """Tell whether a cell looks like a date or a time of day."""
    text = cell.strip()
    found = MOMENT.fullmatch(_with_hours(text)) if 4 < len(text) <= LONGEST else None
    return found is not None and (found["day"] is not None or found["hour"] is not None)


def _with_hours(text: str) -> str:
    """Write minutes and seconds with the hours before them."""
    found = MINUTES.fullmatch(text)
    hour, minute = divmod(int(found[2]), 60) if found else (0, 0)
    return f"{found[1]}{hour}:{minute:02}:{found[3]}" if found else text


def is_value(cell: str) -> bool:
    """Tell numbers and times from words; nan and inf are words of a heading, too."""
    text = cell.strip()
    return any(form.fullmatch(text) for form in (MEASURED, THOUSANDS)) or is_moment(cell)


def seconds_in(cells: Sequence[str], place: Callable[[int], str]) -> tuple[FloatArray, str]:
    """Read dates and times of day: seconds since the first, shape (N,), and the first cell.

    Such as 2024-01-31T12:00:00.5, 12:00:00, 31.01.2024 12:00:00, 1/31/2024 12:00:00 PM, or 00:00.5,
    whose fraction tells that it is minutes and seconds. An order of day and month that is not year,
    month, day is not guessed: such a day may stand there as long as it is the same in all rows. A
    ValueError names the cell as `place` does.
    """
    days, clock, zones = [], np.empty(len(cells)), []
    for k, cell in enumerate(cells):
        day, clock[k], zone = _moment(cell, place(k))
        days.append(day)
        zones.append(zone)
        if (zone is None) != (zones[0] is None) or (day is None) != (days[0] is None):
            raise ValueError(
                f"{place(k)}: t is {short(cell)!r}, and {short(cells[0])!r} in the first row; "
                "write all times alike"
            )
    clock -= np.array([zone or 0.0 for zone in zones])
    back = np.flatnonzero(np.diff(clock) < -43200.0)
    if days[0] is None and back.size:
        k = int(back[0]) + 1
        raise ValueError(
            f"{place(k)}: t goes from {short(cells[k - 1])} to {short(cells[k])}; where midnight "
            "passes, the day is needed: write 2024-01-31 12:00:00, or give the sampling time"
        )
    if len(set(days)) > 1:
        numbers = {day: _ordinal(day) for day in set(days)}
        for k, day in enumerate(days):
            if numbers[day] is None:
                raise ValueError(
                    f"{place(k)}: t is {short(cells[k])!r}; where the day changes, it is not "
                    "guessed which number is the month: write 2024-01-31 12:00:00, or give the "
                    "sampling time"
                )
        clock += 86400.0 * np.array([numbers[day] for day in days])
    return clock - clock[0], cells[0].strip()


def _moment(cell: str, where: str) -> tuple[str | None, float, float | None]:
    """Take a cell apart: its day, the seconds of that day, its zone in seconds."""
    found = MOMENT.fullmatch(_with_hours(cell.strip())) if is_moment(cell) else None
    if found is None:
        said = f"is {short(cell)!r}, which is no time like the ones before" * bool(cell)
        raise ValueError(
            f"{where}: t {said or 'is empty'}; take the line out, or cut the record there"
        )
    clock = 0.0
    if found["hour"] is not None:
        if found["second"] is None and found["day"] is None and found["half"] is None:
            raise ValueError(
                f"{where}: t is {short(cell)!r}, which may be hours and minutes or minutes and "
                "seconds: write 12:00:00, or give the sampling time"
            )
        hour, minute = int(found["hour"]), int(found["minute"])
        second = float((found["second"] or "0").replace(",", "."))
        top = 12 if found["half"] else 23 if found["day"] else 999
        if hour > top or minute > 59 or second >= 60 or (found["half"] and hour == 0):
            raise ValueError(f"{where}: t is {short(cell)!r}, which is no time of a day")
        if found["half"]:
            hour = hour % 12 + 12 * (found["half"].lower() == "p")
        clock = 86400.0 * int(found["days"] or 0) + 3600.0 * hour + 60.0 * minute + second
        clock = -clock if found["sign"] == "-" else clock
    zone = None
    if found["zone"] is not None:
        named = found["zone"][0].isalpha()
        digits = "+0000" if named else found["zone"].replace(":", "")
        zone = float(digits[0] + "1") * (3600.0 * int(digits[1:3]) + 60.0 * int(digits[3:]))
    if found["day"] is not None and ISO_DAY.fullmatch(found["day"]) and not _ordinal(found["day"]):
        raise ValueError(f"{where}: t is {short(cell)!r}, which is no day of a calendar")
    return found["day"], clock, zone


def _ordinal(day: str | None) -> int | None:
    """Count days, for a day written as year, month, day."""
    found = ISO_DAY.fullmatch(day or "")
    try:
        return date(*map(int, found.groups())).toordinal() if found else None
    except ValueError:
        return None
