"""Certificates of random loops: accepted, with the count of the verdict; or none, with the reason.

The loops are those of the campaigns of verdicts, of two dead times and of sampled loops. The
checker builds the characteristic functions anew, in exact fractions, and shares no code with the
package. Each certificate is then tampered with: a claim is changed, points are left out or put in
another order, or the blocks are those of the loop before, which may be accepted only if its count
is the claim.

Run `python -m tests.campaigns.certificates --count 1000 --seed 0`.
"""

from __future__ import annotations

import copy
import time
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from nrdob.certificates import check

from . import sampled, verdicts, waiting
from .runner import asked

COLUMNS = "points", "s to make", "s to check"
FAMILIES = (*verdicts.FAMILIES, "two dead times", "sampled")

FEW = 500
"""Points up to which a certificate is tampered with: a refusal may take as long as the check."""

WAYS = 4
"""In how many ways, of all that there are, each certificate is tampered with."""

Content = dict[str, Any]


def drawn(rng: np.random.Generator, family: str) -> Any:
    """Draw a loop that is well-posed."""
    while True:
        if family in verdicts.FAMILIES:
            return verdicts.random_blocks(rng, family).loop()
        loop = waiting.random_loop(rng) if family == "two dead times" else sampled.draw(rng)
        try:
            found = loop.sampled() if family == "sampled" else loop
        except ValueError:  # a rule that cannot sample these blocks
            continue
        if not getattr(found, "ill_posed", ""):
            return found


def tampered(content: Content, before: Content | None) -> Iterator[tuple[str, Content]]:
    """Change one thing after another, each so that what is claimed is not proved."""

    def changed(part: str, name: str, value: Any) -> Content:
        other = copy.deepcopy(content)
        other[part][name] = value
        return other

    for name, count in content["claim"].items():
        for by in (-2, -1, 1, 2, 3):
            yield "a claim changed", changed("claim", name, count + by)
        points = content["points"][name]
        yield "points reversed", changed("points", name, points[::-1])
        yield "no points but the first", changed("points", name, points[:1])
        yield "a point twice", changed("points", name, [*points, points[-1]])
        yield "points in numbers", changed("points", name, [0.0, 1.0])
    longest = max(Fraction(block["delay"]) for block in content["blocks"]["process"])
    yield "a dead time more uncertain than long", content | {"within": str(2 * longest + 1)}
    if before is not None and before["claim"] != content["claim"]:
        yield (
            "the blocks of another loop",
            content
            | {
                "blocks": before["blocks"],
                "cancelled": before["cancelled"],
            },
        )


def refused(content: Content) -> bool:
    """Tell whether the checker refuses, with a reason."""
    try:
        check(content)
    except ValueError as reason:
        return bool(str(reason))
    return False


def campaign(count: int, seed: int) -> tuple[Counter[str], list[tuple[int, float, float]]]:
    """What became of each loop; points, and seconds to make and to check, of the certificates."""
    rng = np.random.default_rng(seed)
    outcomes: Counter[str] = Counter()
    costs, before = [], None
    for k in range(count):
        family = FAMILIES[k % len(FAMILIES)]
        verdict = drawn(rng, family).stability()
        start = time.process_time()
        try:
            content = verdict.certificate().content
        except ArithmeticError as reason:
            told = str(reason).split(": ", 1)[-1]
            outcomes[f"{family}: none, verdict {verdict.stable}: {told[:70]}"] += 1
            continue
        made = time.process_time()
        check(content)
        checked = time.process_time()
        parts = verdict.model_loop, verdict.observer_loop
        same = [content["claim"][p] for p in ("p_A", "p_B")] == [q.closed_loop_rhp for q in parts]
        outcomes["count of the verdict" if same else f"WRONG: {family}, loop {k}"] += 1
        outcomes[f"{family}: certified, {'stable' if verdict.stable else 'unstable'}"] += 1
        points = max(map(len, content["points"].values()))
        costs.append((points, made - start, checked - made))
        if points <= FEW:
            ways = list(tampered(content, before))
            picked = rng.choice(len(ways), WAYS, replace=False)
            for what, other in (ways[i] for i in {*picked.tolist(), len(ways) - 1}):
                right = refused(other)
                outcomes["tampered, refused" if right else f"WRONG, accepted: {what}, {k}"] += 1
            before = content
    return outcomes, costs


if __name__ == "__main__":
    outcomes, costs = campaign(*asked(__doc__, 1000))
    for name, number in sorted(outcomes.items()):
        print(f"{number:6}  {name}")
    for name, values in zip(COLUMNS, zip(*costs, strict=True), strict=True):
        middle, late, most = np.quantile(values, [0.5, 0.99, 1.0])
        print(f"{name:10}  median {middle:.4g}, 99 % {late:.4g}, most {most:.4g}")
