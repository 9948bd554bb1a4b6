"""A whole family judged, the doubtful members one by one, and the table of what was found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from ..analysis import quotient_margins
from ..diagram import undelayed
from ..loop import NRDOB
from .batch import Feedback
from .plantfamily import Grid, PlantFamily, judged

if TYPE_CHECKING:
    from ..design import StabilityChart
    from ..plotting import Figure

__all__ = ["Share", "SweepTable", "sweep"]

QUANTITIES = ("stable", "ms")  # what can be asked of every member
LISTED = 10  # members of a table that are printed one by one, at most

LABELS = {
    "gain": "factor of the process's gain",
    "delay": "dead time θ (s)",
    "lag": "additional lag (s)",
}
"""What is written beside an axis."""


def sweep(loop: NRDOB, family: PlantFamily, quantities: Iterable[str] = QUANTITIES) -> SweepTable:
    r"""Judge every member of a family in place of the loop's process.

    Model, controller and filter remain. Verdicts are those of `NRDOB.stability`, found for many
    members at once where Routh's test, or with dead time the argument, are certain within rounding.

    Parameters
    ----------
    loop : NRDOB
        The loop.
    family : PlantFamily
        What the plant may be, see `nrdob.plant_family`.
    quantities : iterable of str
        Of "stable" and "ms", the peak of the sensitivity of the plant loop L.

    Returns
    -------
    SweepTable
        With a row for each member.

    Raises
    ------
    TypeError, ValueError
        If there is no such quantity, or an argument is of the wrong kind.

    See Also
    --------
    nrdob.design.chart.stability_chart : exact borders in two parameters.

    Examples
    --------
    Example 3 of the paper, with a gain known to a factor of two and one more lag:

    >>> import nrdob
    >>> loop = nrdob.paper.example(3)
    >>> plants = nrdob.plant_family(loop.process, gain=(0.5, 2.0), lag=(0.0, 0.2), samples=1000)
    >>> table = nrdob.sweep(loop, plants, ("stable", "ms"))
    >>> table["stable"].size, table["gain"].min() > 0.5, int((~table["decided"]).sum())
    (1000, np.True_, 0)
    """
    if not isinstance(loop, NRDOB):
        raise TypeError(f"loop is a {type(loop).__name__}; give an nrdob.NRDOB")
    if not isinstance(family, PlantFamily):
        raise TypeError(f"family is a {type(family).__name__}; make one with nrdob.plant_family")
    asked = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    if unknown := [name for name in asked if name not in QUANTITIES]:
        raise ValueError(f"there is no {unknown[0]!r} to ask; choose from {', '.join(QUANTITIES)}")
    blocks = [_judge_block(loop, family, "ms" in asked, block) for block in range(family.blocks)]
    joined = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    return SweepTable(family, joined)


def _judge_block(
    loop: NRDOB, family: PlantFamily, peaks: bool, block: int
) -> dict[str, NDArray[Any]]:
    """Judge the members of one block: the columns of the table."""
    drawn = family.drawn.block(block)
    plants, problems = family.plants(drawn)
    n = plants.delay.size
    reason = np.full(n, "", dtype=object)
    condition_i = loop.stability().model_loop
    if condition_i.stable:
        stable, unstable, ms = judged(plants, Feedback(loop), peaks=peaks)
        decided = stable | unstable
    else:
        stable, decided = np.zeros(n, dtype=bool), np.full(n, condition_i.stable is False)
        ms = np.full(n, np.nan)
        reason[:] = f"C Gm (i): {condition_i.reason}"
    alone = ~decided & (condition_i.stable is True)
    for k in np.flatnonzero(alone).tolist():
        if k in problems:
            reason[k] = problems[k]
            continue
        try:
            member = replace(loop, process=plants.plant(k))
            verdict = member.stability()
            stable[k], decided[k] = verdict.stable is True, verdict.stable is not None
            reason[k] = "" if decided[k] else verdict.reason
            if peaks and verdict:
                ms[k] = quotient_margins(member.L, True).ms
        except (ArithmeticError, TypeError, ValueError) as error:
            reason[k] = str(error)
    columns = {**drawn, "stable": stable, "decided": decided, "alone": alone, "reason": reason}
    return columns | ({"ms": ms} if peaks else {})


class Share(NamedTuple):
    """A share of a family.

    Attributes
    ----------
    share, low, high : float
        Among the members looked at, and its bounds among all that could have been drawn.
    """

    share: float
    low: float
    high: float


@dataclass(frozen=True, eq=False, repr=False)
class SweepTable:
    """A table with a row for each member: ``table["stable"]``, ``table["gain"]``.

    Beside the parameters and the quantities asked for there are the columns

    - "stable": True where that is certain;
    - "decided": whether the verdict is known, one way or the other;
    - "alone": members too close to call, or too odd, for many at once, and judged one by one;
    - "reason": for those, why there is no verdict, or no plant; empty otherwise.

    Ms of members that are not known to be stable is nan.

    Attributes
    ----------
    family : PlantFamily
        Whose members these are.
    columns : dict of str: (N,) array
        The columns.
    """

    family: PlantFamily
    columns: Mapping[str, NDArray[Any]]

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self.columns:
            raise KeyError(f"there is no {name!r}; the columns are {', '.join(self.columns)}")
        return self.columns[name]

    def __len__(self) -> int:
        return int(self["stable"].size)

    def __repr__(self) -> str:
        stable, decided = self["stable"], self["decided"]
        lines = [
            f"<sweep of {len(self)} plants: {int(stable.sum())} stable, "
            f"{int((decided & ~stable).sum())} not, {int((~decided).sum())} not decided; "
            f"{int(self['alone'].sum())} judged one by one"
        ]
        if "ms" in self.columns and stable.any():
            lines.append(f"  worst ms           {np.nanmax(self['ms'][stable]):.4g}")
        if len(self) <= LISTED:
            shown = [*self.family.names, *(["ms"] if "ms" in self.columns else [])]
            lines += [
                "  " + ", ".join(f"{name} {self[name][k]:.4g}" for name in shown)
                for k in range(len(self))
            ]
        return "\n".join(lines) + ">"

    def stable_share(self, confidence: float = 0.95) -> Share:
        """Share of stable members, and what it can be among all that could have been drawn.

        Clopper and Pearson's interval (1934), which holds at least as often as it says, as of
        `scipy.stats.binomtest`. Members without a verdict count as unstable for the lower bound
        and as stable for the upper one. On a grid nothing is drawn: both bounds are then the share
        itself, up to those members.

        Parameters
        ----------
        confidence : float
            How often the interval is to hold, between 0 and 1.

        Returns
        -------
        Share
            The share and its bounds.

        Raises
        ------
        TypeError, ValueError
            If `confidence` is no number between 0 and 1, or the table is empty.
        """
        n = len(self)
        if not n:
            raise ValueError("the table is empty: there is no share of nothing")
        stable = int(self["stable"].sum())
        perhaps = stable + int((~self["decided"]).sum())
        if isinstance(self.family.drawn, Grid):
            return Share(stable / n, stable / n, perhaps / n)
        low, high = (binomtest(k, n).proportion_ci(confidence) for k in (stable, perhaps))
        return Share(stable / n, float(low.low), float(high.high))

    def worst(self, count: int = 10) -> SweepTable:
        """Members of largest Ms, the worst first; those not known to be stable before all.

        Parameters
        ----------
        count : int
            How many.

        Returns
        -------
        SweepTable
            A shorter table.
        """
        chosen = np.lexsort((-self["ms"], self["stable"]))[:count]
        return replace(self, columns={name: v[chosen] for name, v in self.columns.items()})

    def plot_map(
        self,
        x: str,
        y: str,
        *,
        chart: StabilityChart | None = None,
        title: str = "",
        ax: Any = None,
    ) -> Figure:
        """Draw the members over two parameters, and the exact borders of a chart of the same two.

        The borders come from the frequency response alone, the colours from verdicts on members.
        A dead time is drawn as the whole one of the plant, as charts have it.

        Parameters
        ----------
        x, y : str
            Names of columns.
        chart : StabilityChart, optional
            Of `nrdob.stability_chart` with the nominal plant, its axes x and y.
        title : str
            Written above it.
        ax : matplotlib axes, optional
            Where to draw.

        Returns
        -------
        Figure
            As of `nrdob.plotting.map_plot`.
        """
        from ..plotting import MapAxis, map_plot

        if chart and (chart.x.name, chart.y.name) != (x, y):
            raise ValueError(
                f"the chart is of {chart.x.name} and {chart.y.name}, the map of {x} and {y}; make "
                "both of the same two"
            )
        _, delay = undelayed(self.family.process)
        across, up = (
            MapAxis(LABELS.get(name, name), self[name] + (name == "delay") * delay)
            for name in (x, y)
        )
        # Borders are drawn a little beyond their chart: there is no lag below zero.
        borders = [
            (border.x, np.where(border.y < 0, np.nan, border.y))
            for border in (chart.borders if chart else ())
        ]
        return map_plot(
            across, up, self["stable"], self["decided"], borders=borders, title=title, ax=ax
        )
