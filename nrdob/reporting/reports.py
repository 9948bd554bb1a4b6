"""A report on a loop, on a process that has none yet, or on a record, as one page.

Every part is written for itself. One that cannot be says why, and the others are still there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from os import PathLike
from pathlib import Path
from typing import Any

from ..loop import NRDOB
from ..measured import Identification, Record, identified
from ..numerics import number
from .datasections import data_sections, record_section
from .loopsections import Given, sections_of
from .page import Page, Section, Table
from .proposals import Proposal, propose
from .trials import trial_table
from .wording import character, formula, intervals

__all__ = ["compose", "report"]

EXPECTED = (
    ArithmeticError,
    AttributeError,
    LookupError,
    NotImplementedError,
    TypeError,
    ValueError,
)
"""What a part may raise that cannot be written."""

NEAR = 2.5
"""Peak of the sensitivity above which a stable loop is not called good."""

CHECKED = (
    "What is said here is said of the linear loop with these blocks, in continuous time unless a "
    "sampling time is named: limits of the actuator, friction, quantisation and whatever the model "
    "of the plant leaves out are not in it.",
    "Stability is decided exactly, in two independent ways that must agree, also with dead time. "
    "Sets of λ are complete above a smallest λ where there is a dead time. Margins tell how much "
    "one thing may change while all others stay; several may change at once; then less is left.",
)


def report(
    subject: Any,
    path: str | PathLike[str] | None = None,
    *,
    model: Any = None,
    controller: Any = None,
    time_constant: float | None = None,
    order: int | None = None,
    title: str = "",
) -> str:
    """Write a report as one self-contained HTML page.

    Of a loop it says whether and how nearly not it is stable, which filters would do, what it does,
    and what a processor makes of it. For a process alone, model, filter and controller are chosen
    first, with the reasons; for a record, the process is identified before. A part that cannot be
    written says why, and the rest is written.

    Parameters
    ----------
    subject : NRDOB, Identification, Record, or a process as for `nrdob.NRDOB`
        What to report on.
    path : str or path, optional
        Where to write the page.
    model, controller : as for `nrdob.NRDOB`, optional
        Blocks that are given; others are chosen.
    time_constant : float, optional
        λ of the filter, in seconds.
    order : int, optional
        n of the filter.
    title : str
        Heading of the page.

    Returns
    -------
    str
        The page.

    Raises
    ------
    TypeError, ValueError
        If a loop is given and a block beside it, or blocks that cannot stand in a loop.
    OSError
        If the page cannot be written.

    Examples
    --------
    >>> import control as ct
    >>> page = report(ct.tf([1], [1, 1]), title="A lag")
    >>> "The loop is stable" in page
    True
    """
    given = {"model": model, "controller": controller, "time_constant": time_constant}
    page = compose(subject, **given, order=order, title=title).html()
    if path is not None:
        Path(path).write_text(page, encoding="utf-8")
    return page


def compose(
    subject: Any,
    *,
    model: Any = None,
    controller: Any = None,
    time_constant: float | None = None,
    order: int | None = None,
    title: str = "",
) -> Page:
    """Gather what a report says; parameters and errors are those of `report`."""
    sections: list[Section] = []
    given = (model, controller, time_constant, order)
    if isinstance(subject, NRDOB):
        if any(each is not None for each in given):
            raise ValueError("a loop has its model, controller and filter; give the process alone")
        loop: NRDOB | None = subject
        name, step = "Loop", None
    else:
        process, name, step, found = subject, "Process", None, None
        if isinstance(subject, Record):
            name, step = subject.name or "Record", subject.sampling_time
            process = _identified(subject, sections)
        if isinstance(process, Identification):
            name, step = process.record.name or name, process.record.sampling_time
            sections += _written(data_sections(process))
            found, process = process, process.process
        loop = None
        if process is not None:
            proposal = _proposed(found or process, model, controller, time_constant, order)
            sections += _written(
                [("What is proposed, and why", lambda: _reasons(process, proposal))]
            )
            loop = proposal.loop
    if loop is not None:
        sections += _written(sections_of(Given(loop, step)))
    sections.append(Section("What was checked, and what was not", CHECKED))
    return Page(title or f"{name}: report", *_verdict(loop), tuple(sections))


def _written(parts: Iterable[tuple[str, Callable[[], Section]]]) -> list[Section]:
    """Write each part, or say why it cannot be."""
    sections = []
    for title, write in parts:
        try:
            sections.append(write())
        except EXPECTED as error:
            sections.append(Section(title, (f"This part cannot be written: {error}",)))
    return sections


def _identified(record: Record, sections: list[Section]) -> Identification | None:
    try:
        return identified(record)
    except EXPECTED as error:
        sections += _written([("What was measured", lambda: record_section(record))])
        said = f"No process can be found in the record: {error}."
        sections.append(Section("The process behind it", (said,), warnings=(said,)))
        return None


def _proposed(process: Any, *given: Any) -> Proposal:
    model, controller, time_constant, order = given
    try:
        return propose(
            process, model=model, controller=controller, time_constant=time_constant, order=order
        )
    except EXPECTED as error:
        if any(each is not None for each in given):
            raise
        said = f"No loop can be proposed for this process: {error}."
        return Proposal(None, (said,), warnings=(said,))


def _reasons(process: Any, proposal: Proposal) -> Section:
    rows = tuple(
        (
            formula(each.model),
            each.how,
            str(each.order),
            intervals(each.time_constants),
            _peak(each),
        )
        for each in proposal.candidates
    )
    tables = (
        Table(
            "Models compared, best first",
            ("model", "in what it differs", "n", "filters that stabilise", "smallest peak Ms"),
            rows,
        ),
    )
    if proposal.trials:
        tables = (*(tables if rows else ()), trial_table(proposal.trials))
    words = proposal.words
    if proposal.loop is None:
        words = (f"The process is G = {_shown(process)}. {_kind(process)}", *words)
    return Section(
        "What is proposed, and why",
        words,
        tables if rows or proposal.trials else (),
        (),
        proposal.warnings,
    )


def _peak(candidate: Any) -> str:
    return f"{candidate.ms:.3g}" if candidate.time_constants else "–"


def _shown(process: Any) -> str:
    try:
        return formula(process)
    except EXPECTED:
        return "…"


def _kind(process: Any) -> str:
    try:
        return " ".join(character(process))
    except EXPECTED:
        return ""


def _verdict(loop: NRDOB | None) -> tuple[str, str]:
    if loop is None:
        return "No loop that works was found; the reasons are below.", "bad"
    try:
        stable = loop.stability().stable
    except EXPECTED as error:
        return f"Whether the loop is stable cannot be told: {error}", "open"
    if stable is None:
        return "Whether the loop is stable could not be decided.", "open"
    if not stable:
        return "The loop is NOT stable.", "bad"
    try:
        margins = loop.margins().plant_loop
    except EXPECTED:
        return "The loop is stable.", "good"
    if margins.ms > NEAR:
        peak = number(margins.ms)
        return f"The loop is stable, but near its limit: its sensitivity peaks at {peak}.", "open"
    return f"The loop is stable; its sensitivity peaks at {number(margins.ms)}.", "good"
