"""Which column of a table holds what: by its heading, by name or number, or by its place."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from .parsing import UNITS, short

__all__ = ["SAMPLING", "Choice", "checked_columns", "chosen", "known"]

# First words of a heading of times; t and ts are others, if no column of these is there.
TIME = (
    "time", "timestamp", "zeit", "tempo", "temps", "tiempo", "elapsed", "seconds", "sec", "s",
    "date", "datetime",
)  # fmt: skip
# Words beside it that name no unit.
BESIDE = (
    "time", "stamp", "in", "of", "since", "start", "elapsed", "utc", "local", "relative", "rel",
    "abs", "absolute", "unix", "epoch", "the", "day", "date",
)  # fmt: skip
# Headings of input and output, without units and in small letters; with numbers if there are
# several.
SIGNALS = {
    "u": ("u", "input", "in", "control", "mv", "eingang", "stellgröße", "stellgrad"),
    "y": ("y", "output", "out", "measurement", "pv", "ausgang", "regelgröße", "istwert"),
}
# First words of headings beside which input and output may be those of a controller.
SET_POINTS = ("setpoint", "set", "sp", "reference", "sollwert")
CONTROLLER = {"u": ("output", "out", "ausgang"), "y": ("input", "in", "eingang")}
DOUBTFUL = {name for names in CONTROLLER.values() for name in names}
# Words in headings of which the example in a question is made; nothing is taken for them.
LIKELY = {
    "u": (
        "q", "heater", "valve", "dac", "pwm", "duty", "esc", "voltage", "effort", "command", "co",
        "op", "cv",
    ),
    "y": (
        "t", "temp", "temperature", "level", "flow", "pressure", "adc", "angle", "speed", "rpm",
        "velocity", "position", "feedback", "measured", "actual", "process",
    ),
}  # fmt: skip
# Headings of columns that number the rows: never taken for times.
COUNTERS = (
    "sample", "samples", "index", "n", "k", "i", "no", "nr", "step", "count", "row", "id",
    "entry_id", "scan", "tick", "unnamed: 0", "sample number", "sample no", "scan number",
    "row number",
)  # fmt: skip
SAMPLING = "give the sampling time (--sampling-time 0.1; in Python sampling_time=0.1)"
EXAMPLES = {"t": "Time", "u": "Q1", "y": "T1"}


@dataclass(frozen=True)
class Choice:
    """Where t (if there are times), u and y stand, from 0 on, and the unit of times if it is named.

    Remarks say what was taken for granted.
    """

    order: dict[str, int]
    unit: str = ""
    remarks: tuple[str, ...] = ()


def checked_columns(columns: Mapping[str, str | int] | None) -> dict[str, str | int]:
    """Check which columns are asked for, before a file is opened."""
    if columns is None:
        return {}
    if not isinstance(columns, Mapping):
        raise TypeError(f"columns is {columns!r}; give names or numbers, such as {EXAMPLES!r}")
    for what, each in columns.items():
        if what not in ("t", "u", "y"):
            raise ValueError(f"columns has {what!r}; it may name t, u and y, such as {EXAMPLES!r}")
        if isinstance(each, bool) or not isinstance(each, (str, int)):
            raise TypeError(
                f"columns has {each!r} for {what}; give the heading or the number of the column"
            )
    return dict(columns)


def known(heads: Iterable[str]) -> int:
    """Count headings that say what their columns hold."""
    return sum(bool(_is_time(head) or _signal(head, "u") or _signal(head, "y")) for head in heads)


def chosen(
    heads: Sequence[str],
    asked: Mapping[str, str | int],
    timed: bool,
    table: str,
    moments: Collection[int] = (),
    blank: Collection[int] = (),
) -> Choice:
    """Find the columns, or raise a ValueError that lists them and asks.

    Heads are empty texts where there are none; asked are columns by name or number, as for
    `nrdob.read_data`; timed says whether there must be one of times, table what messages call it.
    Moments are columns of dates and times of day; blank are others that hold no numbers.

    >>> chosen(["Time [ms]", "y", "u"], {}, True, "the table")
    Choice(order={'t': 0, 'u': 2, 'y': 1}, unit='ms', remarks=())
    """
    wanted = ("t", "u", "y") if timed else ("u", "y")
    named = ", ".join(f"{k} {short(head)!r}" for k, head in enumerate(heads, 1))
    titled, width = any(heads), len(heads)
    listed = f"{table} has " + (
        f"the columns {named}" if titled else f"{width} column{'s' * (width > 1)} and no headings"
    )
    picked = {what: _asked(asked[what], what, heads, listed) for what in wanted if what in asked}
    order = {what: column for what, (column, _) in picked.items()}
    unit = picked["t"][1] if "t" in picked else ""
    if len(set(order.values())) < len(order):
        raise ValueError(f"{listed}; the same one is asked for twice: t, u and y are three columns")
    found = {what: _candidates(what, heads, order.values()) for what in wanted if what not in order}
    if "t" in found and not found["t"]:
        found["t"] = sorted({*moments} - {*order.values()})
    several = {what: each for what, each in found.items() if len(each) > 1}
    order |= {what: each[0] for what, each in found.items() if len(each) == 1}
    left = [
        k
        for k in range(width)
        if k not in {*order.values(), *moments, *blank}
        if not any(k in each for each in several.values())
        if not titled or (heads[k] and heads[k].lower().rstrip(". #") not in COUNTERS)
    ]
    lacking = [what for what in wanted if what not in order and what not in several]
    if "t" in lacking:  # a unit of time says more than the order
        left.sort(key=lambda k: not _unit(heads[k]))
    remarks: tuple[str, ...] = ()
    if lacking and not several and len(left) == len(lacking):
        order |= dict(zip(lacking, left, strict=True))
        taken = ", ".join(f"{what} = {_called(order[what], heads)}" for what in lacking)
        remarks = (
            f"the headings do not say which column{'s hold' if lacking[1:] else ' holds'} "
            f"{' and '.join(lacking)}: taken in the order t, u, y, {taken}; "
            f"name the columns to be sure ({_option(order, heads)})"
            if titled
            else f"the columns were taken in the order {', '.join(wanted)}; name them to be sure "
            f"({_option(order, heads)})",
        )
    elif lacking or several:
        raise ValueError(f"{listed}; {_question(order, several, lacking, left, heads)}")
    if timed and not unit:
        unit = _unit(heads[order["t"]])
    return Choice({what: order[what] for what in wanted}, unit, remarks)


def _question(
    order: Mapping[str, int],
    several: Mapping[str, Sequence[int]],
    lacking: Sequence[str],
    left: Sequence[int],
    heads: Sequence[str],
) -> str:
    """Ask what is not known, with the option that answers it."""
    if lacking == ["t"] and not several:
        add = "add a column t in seconds"
        if left:
            option = _option({"t": left[0], **order}, heads)
            add = f"name the column that holds it, such as {option}"
        return f"and no time: {add}, or {SAMPLING}"
    controlled = _controlled(heads)
    example = {**order, **{what: each[0] for what, each in several.items()}}
    more = f"; without times {SAMPLING}" if "t" in lacking else ""
    if len(left) < len(lacking):
        wanted = [what for what in ("t", "u", "y") if what in {*example, *lacking}]
        if "t" in order and heads[order["t"]] == "T":  # may be a temperature
            more = f"; without times {SAMPLING}"
        return f"{len(wanted)} are needed: {', '.join(wanted)}{more}"
    for what in lacking:
        free = [k for k in left if k not in example.values()]
        names = {*LIKELY.get(what, ()), *SIGNALS.get(what, ())}
        if controlled:
            names = names - DOUBTFUL | {*CONTROLLER.get(what, ())}
        likely = (k for k in free if not names.isdisjoint(_words(heads[k])))
        example[what] = next(likely, free[0])
    asks = [
        f"{what} may be {' or '.join(_called(k, heads) for k in each)}"
        for what, each in several.items()
    ]
    if lacking:
        asks.append(f"which holds {', '.join(lacking)} is not known")
    if lacking and controlled:
        asks.append("beside a set point, input and output may be those of the controller")
    return f"{'; '.join(asks)}: choose, such as {_option(example, heads)}{more}"


def _option(order: Mapping[str, int], heads: Sequence[str]) -> str:
    """Write the option that names these columns, by number where a heading would need quotes."""
    named: dict[str, str | int] = {w: order[w] + 1 for w in ("t", "u", "y") if w in order}
    for what in named:
        head = heads[order[what]]
        if re.fullmatch(r"[^\W\d][\w .°%-]*", head) and len(head) < 20 and heads.count(head) == 1:
            named[what] = head
    text = ",".join(f"{what}={each}" for what, each in named.items())
    quoted = f'"{text}"' if " " in text else text
    return f"--columns {quoted}; in Python columns={named}"


def _called(k: int, heads: Sequence[str]) -> str:
    return repr(short(heads[k])) if heads[k] else f"column {k + 1}"


def _asked(column: str | int, what: str, heads: Sequence[str], listed: str) -> tuple[int, str]:
    """Find a column by its name or number, maybe with a unit of time behind it: "2 [ms]"."""
    whole = str(column).strip()
    behind = re.fullmatch(r"(.+?)\s*[\[(]\s*(\w+)\s*[\])]", whole) if what == "t" else None
    # What stands in brackets may be part of the heading, and else is a unit.
    attempts = [(whole, "")] + ([(behind[1], behind[2])] if behind else [])
    for bare, unit in attempts:
        likes = (str, str.lower, _base) if unit or not behind else (str, str.lower)
        for same in likes if isinstance(column, str) else ():
            hits = [k for k, head in enumerate(heads) if head and same(head) == same(bare)]
            if len(hits) > 1:
                raise ValueError(
                    f"{listed}; {len(hits)} of them are called {short(bare)!r}: give the "
                    f"number of the one for {what}, such as {what}={hits[0] + 1}"
                )
            if hits:
                _check_unit(heads[hits[0]], unit, hits[0] + 1)
                return hits[0], unit
        if re.fullmatch(r"\d+", bare) and 1 <= int(bare) <= len(heads):
            return int(bare) - 1, unit
    raise ValueError(f"{listed}; there is no {short(str(column))!r}, which is asked for as {what}")


def _check_unit(head: str, unit: str, number: int) -> None:
    """Refuse a unit that is not that of the heading by which the column is called."""
    named = _unit(head) if unit else ""
    if named in UNITS and UNITS[named] != UNITS.get(unit.lower()):
        raise ValueError(
            f"t is asked for in {short(unit)}, and its heading, {short(head)!r}, says {named}: "
            f'leave the unit out, or overrule the heading with "t={number} [{unit}]"'
        )


def _candidates(what: str, heads: Sequence[str], taken: Iterable[int]) -> list[int]:
    """Columns that may hold something: the surest only."""
    rest = [(k, head) for k, head in enumerate(heads) if k not in set(taken)]
    if what == "t":
        found = [k for k, head in rest if _is_time(head) == 2]
        if len(found) > 1:  # a date beside the time of day, a fraction beside seconds
            beside = ("date", "nanosec", "nsec")
            found = [k for k in found if _words(heads[k])[0] not in beside] or found
        found = found or [k for k, head in rest if _is_time(head) == 1]
    else:
        doubtful = DOUBTFUL if _controlled(heads) else set()
        found = [k for k, head in rest if _signal(head, what) and _base(head) not in doubtful]
    exact = [k for k in found if heads[k] == what]
    return exact if len(exact) == 1 else found


def _controlled(heads: Iterable[str]) -> bool:
    """Whether input and output may be those of a controller: a set point is beside them."""
    first = {word for head in heads for word in _words(head)[:1]}
    return not (first.isdisjoint(SET_POINTS) or DOUBTFUL.isdisjoint(map(_base, heads)))


def _words(head: str) -> list[str]:
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", head)
    return [word.lower() for word in re.findall(r"[^\W\d_]+|\d+", parted)]


def _is_time(head: str) -> int:
    """2 for a heading of times, 1 for t, or a unit of time in brackets, 0 for any other."""
    first, *others = _words(head) or [""]
    if not others and first in UNITS and len(first) > 1 and first != "min":
        return 2
    behind = [word for word in others if word not in BESIDE]
    measured = not behind or behind[0] in UNITS
    if first in TIME:
        return 2 if measured or re.search(r"[\[(]", head) else 0
    within = re.search(r"[\[(]\s*(\w+)\s*[\])]$", head)
    named = within is not None and within[1].lower() in UNITS
    return int(named or (first in ("t", "ts") and measured))


def _unit(head: str) -> str:
    """Find the unit that a heading of times names; empty if it names none."""
    first, *others = _words(head) or [""]
    if first in UNITS:
        return first
    behind = [word for word in others if word not in BESIDE]
    return " ".join(behind) if _is_time(head) or (behind and behind[-1] in UNITS) else ""


def _base(head: str) -> str:
    """Cut off what stands in brackets or behind a comma or a slash."""
    return re.split(r"[\[({,/<]", head)[0].strip().lower()


def _signal(head: str, what: str) -> bool:
    return re.sub(r"[ _]?\d+$", "", _base(head)) in SIGNALS[what]
