"""What can be said of a record and of the process found in it, as sections of a report."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import isnan

import numpy as np

from ..measured import Identification, Record
from ..numerics import FloatArray, number
from ..plotting import COLOURS, INK, TALL, Figure, axes_for, styled
from .formulas import formula
from .html import Picture, Section, Table, picture

__all__ = ["data_sections", "record_section"]

MOST_POINTS = 4000  # points of a record that are drawn; more would make the page large
ROOM = 0.05  # of the range of y, above and below it


def data_sections(found: Identification) -> Iterator[tuple[str, Callable[[], Section]]]:
    """Give each section by its title, to be written one by one."""
    yield "What was measured", lambda: record_section(found.record, found)
    yield "The process behind it", lambda: _process(found)
    yield "How well is it known?", lambda: _trust(found)


def record_section(record: Record, found: Identification | None = None) -> Section:
    """Show a record, and what a process found in it makes of it."""
    said = f"{record.u.size} samples every {number(record.sampling_time, 4)} s"
    ranges = f"{said}; u lies {_range(record.u)}, y {_outputs(record)}."
    words = (ranges, *map(_sentence, record.notes))
    remarks = tuple(map(_sentence, (found or record).remarks))
    return Section("What was measured", words, (), (_drawn(record, found),), remarks)


def _process(found: Identification) -> Section:
    rows = tuple(
        (name, number(p.value, 4), p.unit, f"{number(p.low, 4)} to {number(p.high, 4)}")
        for name, p in found.parameters.items()
    )
    words = (
        f"G = {formula(found.process)}: {found.structure}, chosen because {found.reason}.",
        found.residuals.reason,
    )
    misses = "The model misses something that the input does: trust its intervals with care."
    warnings = (misses,) if found.residuals.independent is False else ()
    head = ("", "value", "unit", "95 % interval")
    table = Table("What was found, in seconds and the units of the file", head, rows)
    return Section("The process behind it", words, (table,), (), warnings)


def _trust(found: Identification) -> Section:
    held = found.fitted < found.record.u.size
    rows = tuple(
        (
            each.structure,
            str(each.parameters),
            f"{number(each.fit_percent)} %",
            *["–" if isnan(each.validation_percent) else f"{number(each.validation_percent)} %"]
            * held,
            number(each.bic),
            "chosen" if each.structure == found.structure else "about as well" * each.rival or "–",
        )
        for each in found.candidates
    )
    table = Table(
        "All structures tried: how much of y each explains (100 % is all)",
        (
            "structure", "numbers", "fitted part", *["part held out"] * held, "BIC",
            "explains the record",
        ),
        rows,
    )  # fmt: skip
    said = (
        "To be tried, each was fitted to the first part alone and foretold the part held out, with "
        "plant and drift going on from their state. The one chosen was then fitted to all of it."
        if held
        else "Nothing was held out, so that no part of the record confirms what was fitted."
    )
    bic = (
        "BIC weighs the fit of the whole record against the number of parameters: 0 is best. About "
        "as well does what is nearly as likely, or foretells the part held out within 1 %."
    )
    return Section("How well is it known?", (f"{said} {bic}",), (table,))


def _drawn(record: Record, found: Identification | None) -> Picture:
    every = -(-record.u.size // MOST_POINTS)
    t, u, y = (each[::every] for each in record)
    upper, lower = axes_for(None, 2, TALL)
    with styled():
        upper.plot(t, y, color=COLOURS["process"], lw=1.0, label="measured")
        if found is not None:
            predicted = found.predicted[::every]
            upper.plot(t, predicted, "--", color=COLOURS["model"], lw=1.2, label="model")
            if found.fitted < record.t.size:
                for ax in (upper, lower):
                    ax.axvline(record.t[found.fitted], color=INK, lw=0.9, ls=":")
                upper.set_title("left of the dotted line fitted,\nright of it foretold")
            upper.legend(loc="best")
        lower.step(t, u, where="post", color=COLOURS["controller"], lw=1.0)
        upper.set(ylabel="output y")
        if not record.free.all():  # what a sensor writes where it fails would hide all others
            upper.set_ylim(*_around(record, found))
        lower.set(ylabel="input u", xlabel="time (s)")
        for ax in (upper, lower):
            ax.set_xlim(t[0], t[-1])
    alt = (
        f"Record of {record.u.size} samples over {number(float(np.ptp(record.t)))} s: "
        f"y {_outputs(record)}, u {_range(record.u)}"
    )
    if found is not None:
        alt += f"; the model explains {number(found.fit_percent)} % of the fitted part"
        if not isnan(found.validation_percent):
            alt += f" and {number(found.validation_percent)} % of the part held out"
    figure = Figure(upper.lines, np.array([[upper], [lower]]), alt)
    caption = "What was measured" + (" and what the process found makes of u." if found else ".")
    return picture(figure, caption)


def _outputs(record: Record) -> str:
    aside = "" if record.free.all() else " in the samples that count"
    return _range(record.y[record.free]) + aside


def _around(record: Record, found: Identification | None) -> tuple[float, float]:
    """Give limits for the outputs that count, and for what the model makes of u."""
    shown = record.y[record.free]
    if found is not None:
        shown = np.append(shown, found.predicted)
    low, high = float(np.nanmin(shown)), float(np.nanmax(shown))  # none before what is compared
    return low - ROOM * (high - low), high + ROOM * (high - low)


def _range(values: FloatArray) -> str:
    return f"between {number(values.min())} and {number(values.max())}"


def _sentence(text: str) -> str:
    symbol = text[:2] in {"t ", "u ", "y "}
    return f"{text[0] if symbol else text[0].upper()}{text[1:]}."
