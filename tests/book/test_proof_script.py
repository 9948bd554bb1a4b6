"""The half planes that a page draws count the roots that the package counts."""

from __future__ import annotations

import json
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from test_explorables import drawn

from explorable import AT_REST, coefficients
from nrdob import paper

SCRIPTS = Path(__file__).resolve().parents[2] / "book" / "_static" / "explore"

COUNTED = """
const { readFileSync } = require("fs");
globalThis.window = globalThis;
for (const name of process.argv.slice(1)) (0, eval)(readFileSync(name, "utf8"));
const found = JSON.parse(readFileSync(0, "utf8")).map((at) => nrdob.halfPlanes(nrdob.loopOf(at)));
process.stdout.write(JSON.stringify(found.map((proof) => proof && [proof.roots, proof.pieces])));
"""


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("node") is None, reason="no node: the script was NOT run")
def test_half_planes_of_a_page_count_what_the_package_counts() -> None:
    rng, asked, counts = np.random.default_rng(3), [], []
    for _ in range(120):
        number = int(rng.integers(1, 5))
        at, loop = drawn(rng, number)
        count = loop.stability().observer_loop.closed_loop_rhp
        if count is not None and np.isfinite(count):
            asked.append({**AT_REST, **at, "plant": coefficients(paper.example(number))})
            counts.append(count)
    scripts = [str(SCRIPTS / f"{name}.js") for name in ("loop", "curve", "proof")]
    done = subprocess.run(
        ["node", "-e", COUNTED, "--", *scripts], input=json.dumps(asked), text=True,
        capture_output=True, check=True,
    )  # fmt: skip
    found = json.loads(done.stdout)
    assert len(found) > 100 and 0 < counts.count(0) < len(counts)
    assert [proof[0] for proof in found] == counts
    for _, pieces in found:
        assert len(pieces) < 500 and pieces[0]["from"] == 0
        for before, after in pairwise(pieces):
            assert before["to"] == after["from"]
            assert abs(after["middle"] - before["middle"]) < np.pi
