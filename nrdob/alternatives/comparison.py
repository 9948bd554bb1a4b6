"""One table for one plant: what each scheme does with it, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from html import escape
from math import isnan, nan
from typing import Any

from ..analysis import noise_variance, quotient_margins
from ..diagram import as_fraction, nonzero, undelayed
from ..loop import NRDOB
from .measures import load_errors, step_peak
from .tuning import Scheme, checked_limits, tune

__all__ = ["Comparison", "Row", "compare"]

COLUMNS = {
    "ms": "Ms",
    "delay_margin": "delay margin (s)",
    "iae": "IAE",
    "ise": "ISE",
    "noise_y": "noise on y",
    "noise_u": "noise on u",
    "peak_u": "peak of u",
}
"""Columns of numbers, and how they are headed."""


@dataclass(frozen=True)
class Row:
    """One scheme on one plant; all numbers are nan where it is not stable.

    Attributes
    ----------
    name, tuning : str
        The scheme, and the parameter that was found, if one was looked for, see `Tuned`.
    stable : bool or None
        None if that is not known, or if there is no loop.
    reason : str
        Why there are no numbers, empty where there are.
    ms, delay_margin : float
        Peak of the sensitivity; delay margin in seconds.
    iae, ise : float
        Integrals of ``|y|`` and of y² after a unit step of the load δ; inf where an offset stays.
    noise_y, noise_u : float
        Variances of y and u for the noise η; inf for white noise that reaches u directly.
    peak_u : float
        Largest ``|u|`` after a unit step of d.
    changed : dict of str to float
        Ms on each of the changed plants, nan where the loop is unstable; empty without numbers.
    loop : NRDOB or None
        The loop itself.
    """

    name: str
    tuning: str
    stable: bool | None
    reason: str
    ms: float = nan
    delay_margin: float = nan
    iae: float = nan
    ise: float = nan
    noise_y: float = nan
    noise_u: float = nan
    peak_u: float = nan
    changed: Mapping[str, float] = field(default_factory=dict, hash=False)
    loop: NRDOB | None = None


@dataclass(frozen=True, repr=False)
class Comparison:
    """What `compare` found; prints as a table.

    Attributes
    ----------
    rows : tuple of Row
        One for each scheme.
    changed : tuple of str
        Names of the changed plants.
    shown : tuple of str, optional
        Columns that are printed, see `only`.
    """

    rows: tuple[Row, ...]
    changed: tuple[str, ...]
    shown: tuple[str, ...] | None = None

    def __getitem__(self, name: str) -> Row:
        rows = {row.name: row for row in self.rows}
        if name not in rows:
            raise KeyError(f"there is no scheme {name!r}; there are {', '.join(rows)}")
        return rows[name]

    def column(self, name: str) -> dict[str, Any]:
        """Return one column, by scheme.

        Parameters
        ----------
        name : str
            An attribute of `Row`, or the name of a changed plant.

        Raises
        ------
        ValueError
            If there is no such column.
        """
        if name in self.changed:
            return {row.name: row.changed.get(name, nan) for row in self.rows}
        known = [each.name for each in fields(Row)]
        if name not in known:
            raise ValueError(
                f"there is no column {name!r}; choose one of {', '.join([*known, *self.changed])}"
            )
        return {row.name: getattr(row, name) for row in self.rows}

    def only(self, *names: str) -> Comparison:
        """Return the same table, to be printed with these columns.

        Parameters
        ----------
        *names : str
            Numbers of `Row`, as "ms", or names of changed plants, in the order wanted.

        Raises
        ------
        ValueError
            If there is no such column of numbers.

        Examples
        --------
        >>> from nrdob import paper
        >>> loop = paper.example(1)
        >>> compare(loop.process, {"as printed": loop}).only("iae", "ms")
                    tuning   IAE     Ms
        as printed          0.02  1.155
        """
        known = (*COLUMNS, *self.changed)
        for name in names:
            if name not in known:
                raise ValueError(f"there is no column {name!r}; choose from {', '.join(known)}")
        return replace(self, shown=names)

    @property
    def _cells(self) -> list[list[str]]:
        every = [(name, False) for name in COLUMNS] + [(name, True) for name in self.changed]
        after = dict(every)  # a changed plant comes first, as in `column`
        shown = every if self.shown is None else [(name, after[name]) for name in self.shown]
        heads = ["Ms, " + name if changed else COLUMNS[name] for name, changed in shown]
        table = [["", "tuning", *heads]]
        for row in self.rows:
            cells = []
            for name, changed in [] if row.reason else shown:
                value = row.changed.get(name, nan) if changed else getattr(row, name)
                cells.append(_number(value, "unstable" if changed else "-"))
            table.append([row.name, row.tuning, *(cells or [""] * len(shown))])
        return table

    def __repr__(self) -> str:
        table = self._cells
        wide = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = []
        for cells, reason in zip(table, ("", *(row.reason for row in self.rows)), strict=True):
            text = [cell.rjust(w) for cell, w in zip(cells, wide, strict=True)]
            text[:2] = cells[0].ljust(wide[0]), cells[1].ljust(wide[1])
            lines.append("  ".join([*text[:2], reason] if reason else text).rstrip())
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        padded = "padding: 0.2em 0.5em"
        style = f'style="{padded}; text-align: right; white-space: nowrap"'
        head, *body = self._cells
        head[0] = "scheme"  # who hears a table hears the head of each column
        rows = ["".join(f"<th {style}>{escape(cell)}</th>" for cell in head) + "</tr>"]
        for cells, row in zip(body, self.rows, strict=True):
            shown = [f"<td {style}>{escape(cell)}</td>" for cell in cells]
            if row.reason:
                left = f'colspan="{len(cells) - 2}" style="{padded}; text-align: left"'
                shown[2:] = [f"<td {left}>{escape(row.reason)}</td></tr>"]
            rows.append("".join(shown))
        return f"<table>{''.join(f'<tr>{row}' for row in rows)}</table>"


def compare(
    process: Any,
    candidates: Mapping[str, NRDOB | Scheme],
    *,
    changed: Mapping[str, Any] | None = None,
    shaping: Any = None,
    max_ms: float | None = None,
    max_noise: float | None = None,
) -> Comparison:
    """Compare schemes on one plant, and on plants that it may become.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`
        G, on which every scheme is judged.
    candidates : dict of str to NRDOB or Scheme
        Loops as they are; or schemes from `nrdob.alternatives.candidates`, tuned to the same limits
        by `nrdob.alternatives.tune`.
    changed : dict of str to process, optional
        What the plant may become; the schemes stay as they are.
    shaping, max_ms, max_noise : as for `nrdob.alternatives.tune`, optional
        What colours the noise η, and limits for candidates.

    Returns
    -------
    Comparison
        One row for each scheme. A scheme that does not fit, or that the plant makes unstable, has
        a row that says why.

    Raises
    ------
    TypeError, ValueError
        If the process or a changed one cannot stand in a loop, `candidates` is no dict of loops
        and candidates, or a candidate is given without a limit.

    Examples
    --------
    >>> from nrdob import paper
    >>> from nrdob.alternatives import candidates
    >>> loop = paper.example(4)
    >>> every = candidates(loop.process, loop.model, loop.controller, 3)
    >>> two = {name: every[name] for name in ("NR-DOB", "PI")}
    >>> late = {"late": paper.example(4, modified=True).process}
    >>> found = compare(loop.process, two, changed=late, max_ms=1.6)
    >>> {name: round(ms, 3) for name, ms in found.column("late").items()}
    {'NR-DOB': 3.209, 'PI': 2.416}
    """
    if not isinstance(candidates, Mapping) or not all(
        isinstance(each, NRDOB | Scheme) for each in candidates.values()
    ):
        raise TypeError(
            "candidates must be a dict of names to NRDOB loops or to candidates from "
            "nrdob.alternatives.candidates(process, model, controller)"
        )
    if not isinstance(changed, Mapping | None):
        raise TypeError(f"changed is a {type(changed).__name__}; give a dict of names to plants")
    others = dict(changed or {})
    for name, plant in (("process", process), *others.items()):
        nonzero(as_fraction(undelayed(plant)[0], name), name)
    if any(isinstance(each, Scheme) for each in candidates.values()):
        checked_limits(max_ms, max_noise)  # such refusals are about what is asked, not a scheme
    rows = []
    for name, each in candidates.items():
        tuning = ""
        try:
            if isinstance(each, Scheme):
                tuned = tune(each, max_ms=max_ms, max_noise=max_noise, shaping=shaping)
                loop, tuning = tuned.loop, tuned.text
            else:
                loop = each
            loop = replace(loop, process=process)
        except ValueError as refusal:
            rows.append(Row(name, tuning, None, str(refusal)))
            continue
        rows.append(_judged(name, tuning, loop, shaping, others))
    return Comparison(tuple(rows), tuple(others))


def _judged(name: str, tuning: str, loop: NRDOB, shaping: Any, others: dict[str, Any]) -> Row:
    verdict = loop.stability()
    if not verdict.stable:
        said = "not stable" if verdict.stable is False else "not decided"
        return Row(name, tuning, verdict.stable, f"{said}: {verdict.reason}", loop=loop)
    try:
        found = quotient_margins(loop.L, True)
        noise = noise_variance(loop, shaping)
        errors = load_errors(loop)
        peak = step_peak(loop)
    except ArithmeticError as refusal:  # of a loop that is all but unstable
        return Row(name, tuning, True, f"stable, but {refusal}", loop=loop)
    after = {key: _ms(replace(loop, process=plant)) for key, plant in others.items()}
    return Row(
        name, tuning, True, "", found.ms, found.delay_margin, errors.iae, errors.ise,
        noise.y, noise.u, peak, after, loop,
    )  # fmt: skip


def _ms(loop: NRDOB) -> float:
    """Ms of a loop, nan where it is not known to be stable."""
    return quotient_margins(loop.L, True).ms if loop.stability().stable else nan


def _number(value: float, missing: str) -> str:
    return missing if isnan(value) else f"{value:.4g}"
