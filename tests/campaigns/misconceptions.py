"""What graders say to right, rounded and mistaken answers, in many groups.

python -m tests.campaigns.misconceptions --count 24 4.3 4.5

The published answer must get full marks; rounded to six and four digits, too, and to three it is
told so; each misconception must be recognised as what it is and get its marks; what only looks
right must fail. The tests ask the same in a few groups; here the groups are 1, 2, … and the hidden
seeds others for each.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1]))  # where the tests find what they share

from course.test_exercise_routes import WRONG
from course.test_exercise_routes import points as judged_alone
from nrdob_course.exercises import PROBLEMS, own_case
from problemsets import SETS, Posed, posed, published, rounded

ALL = {this.id: this for path in SETS for this in posed(path)}


def seed_of(group: int) -> int:
    return 300_000 + group


def faults(this: Posed, group: int) -> Iterator[str]:
    """What is not as it must be, for one problem and group."""
    with contextlib.redirect_stdout(io.StringIO()):  # what the cells of the set print
        right = published(this, group)

    def judged(change: Any) -> Any:
        answer = change(right) if this.problem.own else lambda case: change(right(case))
        return this.score(answer, group, seed_of(group)).feedback

    for digits in (None, 6, 4, 3):
        found = judged(partial(rounded, digits=digits) if digits else lambda value: value)
        if found.recognised not in ("", "rounded"):
            yield f"accused of {found.recognised!r}, with {digits} digits"
        if found.share < 1 and digits != 3:
            yield f"no full marks, with {digits} digits: {found.text}"
        if found.share < 1 and not ("four digits" in found.text and found.share >= 0.5):
            yield f"not told that it is rounded: {found.text}"
    for number, wrong in enumerate(WRONG.get(this.id, ())):
        if judged_alone(this.id, wrong, group).share == 1:
            yield f"what only looks right, number {number}, gets full marks"
    for misconception in this.problem.misconceptions:
        mistaken: Any = misconception.example
        if this.problem.own:
            mistaken = mistaken(own_case(this.id, group))
        points = this.score(mistaken, group, seed_of(group))
        least = this.points * misconception.marks
        if points.feedback.recognised != misconception.name:
            yield f"{misconception.name!r} is told {points.feedback.text}"
        elif points < least - 1e-9 or (points > least + 1e-9 and not this.problem.parts):
            yield f"{misconception.name!r} gets {float(points):g}, not {least:g}"


def campaign(count: int, ids: list[str]) -> Counter[str]:
    """Count what became of problems and groups; "WRONG" begins the name of every fault."""
    found: Counter[str] = Counter()
    for id in ids:
        for group in range(1, count + 1):
            wrong = list(faults(ALL[id], group))
            for fault in wrong:
                print(f"{id}, group {group}: {fault}", flush=True)
            found[f"WRONG {id}" if wrong else f"{id}: as it must be"] += 1
        print(
            f"{id}: {found[f'{id}: as it must be']} of {count} groups", file=sys.stderr, flush=True
        )
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("problems", nargs="*", metavar="PROBLEM")
    parser.add_argument("--count", type=int, default=24)
    given = parser.parse_args()
    if unknown := [id for id in given.problems if id not in ALL]:
        parser.error(f"no program checks {', '.join(unknown)}; it checks {', '.join(ALL)}")
    for outcome, number in sorted(campaign(given.count, given.problems or list(PROBLEMS)).items()):
        print(f"{number:6}  {outcome}")
