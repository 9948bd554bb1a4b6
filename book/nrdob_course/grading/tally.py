"""A class at a glance: points for each problem, the mistakes that were recognised, and times.

One page without names and network, to be looked at before the next session.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from statistics import mean, median

import nbformat

from ..exercises import PROBLEMS
from .feedback import NOWHERE
from .marks import Line, in_order, in_order_of_sets, number, problem_of, unmarked

__all__ = ["mistakes", "write_tally"]

STYLE = """
body { max-width: 60rem; margin: auto; padding: 0 1rem 4rem; font: 1rem/1.5 sans-serif; }
table { border-collapse: collapse; margin-bottom: 2rem; } caption { text-align: left; }
th, td { padding: .2rem .6rem; border-bottom: 1px solid; text-align: right; }
th:first-child, td:first-child, td.text { text-align: left; }
meter { width: 8rem; }
"""


def mistakes(root: Path, found: Iterable[Line]) -> Counter[tuple[str, str]]:
    """Count the misconceptions that the feedback has named, by problem."""
    counts: Counter[tuple[str, str]] = Counter()
    said = {
        (id, kind.name): escape(kind.says)
        for id, problem in PROBLEMS.items()
        for kind in problem.misconceptions
    }
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
    body = "".join(
        _set(name, [line for line in graded if line.entry["set"] == name], counts) for name in sets
    )
    path.write_text(
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
        f'<meta http-equiv="Content-Security-Policy" content="{NOWHERE}"/>'
        f"<title>The class</title><style>{STYLE}</style></head><body><h1>The class</h1>"
        f"{body or '<p>Nothing is graded yet.</p>'}</body></html>\n",
        "utf-8",
    )


def _set(name: str, graded: list[Line], counts: Counter[tuple[str, str]]) -> str:
    problems: dict[str, list[tuple[float, float]]] = {}
    for line in graded:
        for grade in line.grades:
            given = problems.setdefault(problem_of(grade.name), [])
            if not unmarked(grade):
                given.append((float(grade.score), float(grade.max_score)))
    rows = []
    for problem in sorted(problems, key=in_order):
        shares = [score / most for score, most in problems[problem] if most]
        if not shares:
            rows.append([problem, "0", "", "", "", ""])
            continue
        share = mean(shares)
        rows.append(
            [
                problem,
                f"{len(shares)}",
                f"{share:.0%}",
                f'<meter value="{share:.3f}" aria-label="{share:.0%}"></meter>',
                f"{sum(s > 0.999 for s in shares)}",
                f"{sum(s < 0.001 for s in shares)}",
            ]
        )
    known = sorted(
        ((key, count) for key, count in counts.items() if key[0] in problems),
        key=lambda item: (-item[1], in_order(item[0][0])),
    )
    times = [line.entry.get("seconds", 0.0) for line in graded]
    late = sum(bool(line.days) for line in graded)
    totals = [line.earned for line in graded]
    head = (
        f"<h2>{escape(name)}</h2><p>{len(graded)} graded; {late} late; points so far: median "
        f"{number(median(totals))}, from {number(min(totals))} to {number(max(totals))} of "
        f"{number(max(line.most for line in graded))}. Grading took {median(times):.0f} s each in "
        f"the middle, {max(times):.0f} s at most.</p>"
    )
    columns = ["problem", "marked", "mean", "", "full points", "no points"]
    told = [
        [problem, f'<span class="text">{escape(kind)}</span>', f"{count}"]
        for (problem, kind), count in known
    ]
    return (
        head
        + _table("Points", columns, rows)
        + (_table("Recognised", ["problem", "mistake", "students"], told) if told else "")
    )


def _table(caption: str, columns: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    head = "".join(f'<th scope="col">{column}</th>' for column in columns)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><caption>{caption}</caption><tr>{head}</tr>{body}</table>"
