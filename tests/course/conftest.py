"""What the tests of the course share: a set that was given out."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from nbgrader import api

from handin import release


@pytest.fixture(scope="session", autouse=True)
def _asked_once() -> Iterator[None]:
    """Ask for the version of nbgrader's database once.

    For each new gradebook nbgrader starts a Python that reads all of nbgrader to print it.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(api, "get_alembic_version", cache(api.get_alembic_version))
        yield


@pytest.fixture(scope="session")
def released(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give out, once, the set that is handed in; its folder must stay as it is."""
    return release(tmp_path_factory.mktemp("released"))
