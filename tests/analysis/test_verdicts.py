"""A small sample of the campaign of verdicts; `python -m tests.campaigns.verdicts` runs it all."""

import pytest

pytest.importorskip("flint")

from campaigns.verdicts import FAMILIES, cases, distance


@pytest.mark.slow
def test_random_loops_of_every_family_are_judged_as_the_oracles_do():
    for case in cases(12 * len(FAMILIES), seed=7):
        assert not case.wrong, (case.blocks, case.verdict, case.truth)
        for name in case.undecided:
            assert distance(getattr(case.blocks.loop(), name)) < 1e-12, case.blocks
