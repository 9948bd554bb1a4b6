"""A report on a loop, on a process that has none yet, or on a record.

Each part is written for itself. If one cannot be written, it says why, and the others are still
there. The headline is the worst of what the parts found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from inspect import signature
from math import inf
from os import PathLike
from pathlib import Path
from typing import Any

from ..diagram import as_fraction
from ..loop import NRDOB
from ..measured import Identification, Record, identified
from ..numerics import number
from .datasections import data_sections, record_section
from .formulas import character, formula, intervals
from .html import Section, Table, written
from .loopsections import UNDECIDED, sections_of
from .proposals import Proposal, propose
from .trials import trial_table

__all__ = ["Report", "report"]

# What a part may raise that cannot be written.
EXPECTED = (
    ArithmeticError, AttributeError, LookupError, NotImplementedError, TypeError, ValueError,
)  # fmt: skip
PROPOSED = "What is proposed, and why"
CHECKED = (
    "What is said here is said of the linear loop with these blocks, in continuous time unless a "
    "sampling time is named: limits of the actuator, friction, quantisation and whatever the model "
    "of the plant leaves out are not in it.",
    "Stability is decided exactly, in two independent ways that must agree, also with dead time. "
    "Sets of λ are complete above a smallest λ where there is a dead time. Margins tell how much "
    "one thing may change while all others stay; several may change at once; then less is left.",
)


@dataclass(frozen=True, eq=False)
class Report:
    """What can be said of a record, a process or a loop; in a notebook it shows as a page.

    Attributes
    ----------
    title, sections : str, tuple of Section
        Its heading and parts.
    sound : str
        What is said of the loop where nothing speaks against it.
    process : as for `nrdob.NRDOB`, or None
        The process G; None if none was found in the record.
    loop : NRDOB or None
        The loop that was given or proposed.
    identification, proposal : Identification or None, Proposal or None
        How the process was found in a record, and what was chosen, and why, if no loop was given.
    """

    title: str
    sections: tuple[Section, ...] = field(repr=False)
    sound: str = field(repr=False)
    process: Any = field(default=None, repr=False)
    loop: NRDOB | None = None
    identification: Identification | None = field(default=None, repr=False)
    proposal: Proposal | None = field(default=None, repr=False)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What must not be overlooked, the gravest first; empty if nothing was found."""
        alarms = [each for section in self.sections for each in section.alarms]
        others = [each for section in self.sections for each in section.warnings]
        return tuple(dict.fromkeys(alarms + others))

    @property
    def mood(self) -> str:
        """Good, without any warning; bad, if one speaks against using the loop; or open."""
        if self.loop is None or any(section.alarms for section in self.sections):
            return "bad"
        return "open" if self.warnings else "good"

    @property
    def verdict(self) -> str:
        """The headline: the worst that was found."""
        worst = self.warnings[:1]
        if self.loop is None:
            return " ".join(["No loop that works was found.", *worst])
        if self.mood == "bad":
            return worst[0]
        return " ".join([self.sound, *(f"But: {each}" for each in worst)])

    @cached_property
    def html(self) -> str:
        """The page, as one file that needs no other."""
        return written(self)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the page into a file, or raise OSError if it cannot be written.

        Parameters
        ----------
        path : str or path
            The file, such as report.html.
        """
        Path(path).write_text(self.html, encoding="utf-8")

    def _repr_html_(self) -> str:
        """Show the page within a notebook, in a frame of its own since it has its own styles."""
        return (
            f'<iframe title="{escape(self.title)}" sandbox srcdoc="{escape(self.html)}" '
            'style="width:100%;height:40rem;border:1px solid #c9c9c9"></iframe>'
        )

    def __str__(self) -> str:
        parts = [self.title, self.verdict]
        if self.process is not None:
            parts.append(f"process G = {_shown(self.process)}")
        if self.loop is not None:
            for name in ("model", "controller", "filter"):
                parts.append(f"{name} = {_shown(getattr(self.loop, name))}")
        others = [each for each in self.warnings if each not in self.verdict]
        return "\n".join([*parts, *(f"- {each}" for each in others)])


def report(
    subject: Any,
    path: str | PathLike[str] | None = None,
    *,
    title: str = "",
    progress: Callable[[str], object] = lambda part: None,
    **given: Any,
) -> Report:
    """Write a report as one self-contained HTML page.

    Of a loop it says whether it is stable, with which margins, which filters stabilise it, how it
    responds, and what becomes of it on a processor. For a process alone, model, filter and
    controller are chosen first, with the reasons, see `nrdob.reporting.propose`; for a record, the
    process is identified before. A part that cannot be written says why.

    Parameters
    ----------
    subject : NRDOB, Identification, Record, or a process as for `nrdob.NRDOB`
        What to report on.
    path, title : str or path, str, optional
        Where to write the page, and its heading.
    progress : callable
        Called with the name of each part before it is worked on.
    **given : Any
        What is not to be chosen: model, controller, time_constant and order, and max_ms, as for
        `nrdob.reporting.propose`.

    Returns
    -------
    Report
        With ``.verdict``, ``.warnings``, ``.process``, ``.loop``, ``.html`` and ``.save(path)``.

    Raises
    ------
    TypeError, ValueError, OSError
        If the subject is nothing of that kind, if a loop is given and a block beside it, or blocks
        that cannot stand in a loop; if the page cannot be written.

    Examples
    --------
    >>> import control as ct
    >>> found = report(ct.tf([1], [1, 1]), title="A lag")
    >>> found.verdict, found.warnings
    ('The loop is stable; its sensitivity peaks at 1.', ())
    >>> found.loop.filter
    LowPassFilter(time_constant=0.1, order=1)
    """
    signature(propose).bind(subject, **given)
    if isinstance(subject, NRDOB) and any(each is not None for each in given.values()):
        raise ValueError("a loop has its model, controller and filter; give the process alone")
    if not isinstance(subject, NRDOB | Identification | Record):
        _check_kind(subject)
    found = _composed(subject, given, title, progress)
    if path is not None:
        found.save(path)
    return found


def _check_kind(process: Any) -> None:
    """Refuse what is no block at all; one that cannot be used gets a page that says why."""
    try:
        as_fraction(getattr(process, "tf", process), "process", proper=False)
    except TypeError as error:
        raise TypeError(
            f"{error}; a report is on a process, an nrdob.NRDOB, a record (nrdob.read_data) or an "
            "identification (nrdob.identify)"
        ) from None
    except EXPECTED:
        return


def _composed(
    subject: Any, given: Mapping[str, Any], title: str, progress: Callable[[str], object]
) -> Report:
    sections: list[Section] = []
    loop, proposal, identification = None, None, None
    process, name, step = subject, "Process", None
    if isinstance(subject, NRDOB):
        loop, process, name = subject, subject.process, "Loop"
    if isinstance(subject, Record):
        name, step = subject.name or "Record", subject.sampling_time
        progress(f"The process behind {subject.t.size} samples")
        process = _identified(subject, sections)
    if isinstance(process, Identification):
        identification, process = process, process.process
        name, step = identification.record.name or name, identification.record.sampling_time
        sections += _each_written(data_sections(identification), progress)
    if loop is None and process is not None:
        progress(PROPOSED)
        proposal = _proposed(identification or process, given)
        sections += _each_written([(PROPOSED, lambda: _reasons(process, proposal))])
        loop = proposal.loop
    if loop is not None:
        sections += _each_written(sections_of(loop, step), progress)
    sections.append(Section("What was checked, and what was not", CHECKED))
    return Report(
        title or f"{name}: report", tuple(sections), _sound(loop, proposal), process, loop,
        identification, proposal,
    )  # fmt: skip


def _each_written(
    parts: Iterable[tuple[str, Callable[[], Section]]],
    progress: Callable[[str], object] = lambda part: None,
) -> Iterator[Section]:
    """Write each part, or say why it cannot be."""
    for title, write in parts:
        progress(title)
        try:
            yield write()
        except EXPECTED as error:
            said = f"This part cannot be written: {error}"
            yield Section(title, (said,), warnings=(f"{title}: {said}.",))


def _identified(record: Record, sections: list[Section]) -> Identification | None:
    try:
        return identified(record)
    except EXPECTED as error:
        sections += _each_written([("What was measured", lambda: record_section(record))])
        said = f"No process can be found in the record: {error}."
        sections.append(Section("The process behind it", (said,), alarms=(said,)))
        return None


def _proposed(process: Any, given: Mapping[str, Any]) -> Proposal:
    try:
        return propose(process, **given)
    except EXPECTED as error:
        if any(each is not None for each in given.values()):
            raise
        said = f"No loop can be proposed for this process: {error}."
        return Proposal(None, (said,), warnings=(said,))


def _reasons(process: Any, proposal: Proposal) -> Section:
    rows = tuple(
        (
            formula(each.model), each.how, str(each.order), intervals(each.time_constants),
            f"{each.ms:.3g}" if each.time_constants else "–",
        )
        for each in proposal.candidates
    )  # fmt: skip
    head = ("model", "in what it differs", "n", "filters that stabilise", "smallest peak Ms")
    tables = [Table("Models compared, best first", head, rows)] * bool(rows)
    if proposal.trials:
        tables.append(trial_table(proposal.trials))
    words = proposal.words
    if proposal.loop is None:
        kind = ""
        with suppress(*EXPECTED):
            kind = " ".join(character(process))
        words = (f"The process is G = {_shown(process)}. {kind}", *words)
    # Where the loop is unstable on a process that the record does not exclude, that comes first.
    grave = None if proposal.loop is None else int(any(not each.stable for each in proposal.trials))
    return Section(
        PROPOSED, words, tuple(tables), alarms=proposal.warnings[:grave],
        warnings=() if grave is None else proposal.warnings[grave:],
    )  # fmt: skip


def _shown(process: Any) -> str:
    try:
        return formula(process)
    except EXPECTED:
        return "…"


def _sound(loop: NRDOB | None, proposal: Proposal | None) -> str:
    """Say what the headline is where nothing speaks against the loop."""
    if loop is None:
        return ""
    worst = max((each.ms for each in proposal.trials), default=0.0) if proposal else 0.0
    try:
        stable = loop.stability().stable
        if stable:
            peak = loop.margins().plant_loop.ms
            elsewhere = ""
            if 1.005 * peak < worst < inf:
                elsewhere = f", and at {number(worst)} at most on all that the record allows"
            return f"The loop is stable; its sensitivity peaks at {number(peak)}{elsewhere}."
    except EXPECTED as error:
        return f"Whether the loop is stable, and with which margins, is not known: {error}."
    return "The loop is NOT stable." if stable is False else UNDECIDED
