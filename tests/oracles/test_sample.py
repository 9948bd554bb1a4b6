"""A small sample of every public number of a loop against an oracle that shares nothing with it.

`python -m tests.campaigns.oracles` asks the same of many loops.
"""

import pytest

from tests.campaigns.oracles import QUESTIONS, RIGHT, campaign


@pytest.mark.thorough
def test_every_public_number_is_that_of_an_oracle():
    tally, _ = campaign(24, seed=11)
    assert [name for outcomes in tally.values() for name in outcomes if "WRONG" in name] == []
    compared = {name: outcomes[RIGHT] for name, outcomes in tally.items()}
    assert set(compared) == {question.__name__ for question in QUESTIONS}
    assert min(compared.values()) >= 20
