"""What the tests of the course share: a set that was given out."""

from __future__ import annotations

from pathlib import Path

import pytest

from handin import release


@pytest.fixture(scope="session")
def released(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give out, once, the set that is handed in; its folder must stay as it is."""
    return release(tmp_path_factory.mktemp("released"))
