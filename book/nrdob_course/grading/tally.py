"""A class at a glance: points for each problem, the mistakes that were recognised, and times.

One page without names and network, to be looked at before the next session.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from statistics import mean, median
from typing import Any

import nbformat

from ..exercises import PROBLEMS
from .feedback import NOWHERE
from .marking import PAGES
from .marks import Line, in_order, in_order_of_sets, number, problem_of, unmarked

__all__ = ["mistakes", "write_tally"]


def mistakes(root: Path, found: Iterable[Line]) -> Counter[tuple[str, str]]:
    """Count the misconceptions that the feedback has named, by problem."""
    counts: Counter[tuple[str, str]] = Counter()
    known = [(id, kind) for id, problem in PROBLEMS.items() for kind in problem.misconceptions]
    said = {(id, kind.name): escape(kind.says) for id, kind in known}
    for line in found:
        name = line.entry["set"]
        path = root / "autograded" / line.entry["folder"] / name / f"{name}.ipynb"
        if not path.exists():
            continue
        told = {
            problem_of(cell.id): "".join(
                str(out.get("data", {}).get("text/html", "")) for out in cell.get("outputs", [])
            )
            for cell in nbformat.read(path, as_version=4).cells
            if cell.get("id", "").startswith("check")
        }
        counts.update(key for key, words in said.items() if words in told.get(key[0], ""))
    return counts


def write_tally(path: Path, root: Path, found: Sequence[Line]) -> None:
    """Write the page, with a part for each set."""
    graded = [line for line in found if line.grades]
    sets = sorted({line.entry["set"] for line in graded}, key=in_order_of_sets)
    counts = mistakes(root, graded)
    by_set = {name: [line for line in graded if line.entry["set"] == name] for name in sets}
    parts = [_set(name, lines, counts) for name, lines in by_set.items()]
    page = PAGES.get_template("class.html").render(sets=parts, nowhere=NOWHERE)
    path.write_text(page + "\n", "utf-8")


def _set(name: str, graded: list[Line], counts: Counter[tuple[str, str]]) -> dict[str, Any]:
    """Give what the page says of a set."""
    shares: dict[str, list[float]] = {}
    for grade in (grade for line in graded for grade in line.grades):
        given = shares.setdefault(problem_of(grade.name), [])
        if grade.max_score and not unmarked(grade):
            given.append(float(grade.score) / float(grade.max_score))
    times = [line.entry.get("seconds", 0.0) for line in graded]
    totals = [line.earned for line in graded]
    return {
        "name": name,
        "said": (
            f"{len(graded)} graded; {sum(bool(line.days) for line in graded)} late; points so far: "
            f"median {number(median(totals))}, from {number(min(totals))} to "
            f"{number(max(totals))} of {number(max(line.most for line in graded))}. Grading took "
            f"{median(times):.0f} s each in the middle, {max(times):.0f} s at most."
        ),
        "points": [
            {
                "problem": problem,
                "marked": len(mine),
                "mean": mean(mine or [0.0]),
                "full": sum(share > 0.999 for share in mine),
                "none": sum(share < 0.001 for share in mine),
            }
            for problem, mine in sorted(shares.items(), key=lambda item: in_order(item[0]))
        ],
        "mistakes": sorted(
            ((*key, count) for key, count in counts.items() if key[0] in shares),
            key=lambda item: (-item[2], in_order(item[0])),
        ),
    }
