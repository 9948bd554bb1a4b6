"""Running a notebook: a kernel that does not start is another program's fault."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import DeadKernelError

from nrdob_course.running import STARTS, execute


def runs(
    failing: int, error: type[Exception], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> list[int]:
    """Count how often a notebook is begun whose first runs end with an error."""
    begun: list[int] = []

    def run(self: NotebookClient, **kwargs: Any) -> None:
        begun.append(len(begun))
        if len(begun) <= failing:
            raise error("Kernel died before replying to kernel_info")

    monkeypatch.setattr(NotebookClient, "execute", run)
    path = folder / "one.ipynb"
    nbformat.write(nbformat.v4.new_notebook(), path)
    if failing < STARTS and error is RuntimeError:
        assert nbformat.reads(execute(path, 1), as_version=4).cells == []
    else:
        with pytest.raises(error, match="Kernel died"):
            execute(path, 1)
    return begun


@pytest.mark.parametrize(("failing", "count"), [(0, 1), (2, 3), (3, 3)])
def test_a_kernel_whose_ports_were_taken_is_started_again(
    failing: int, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(runs(failing, RuntimeError, tmp_path, monkeypatch)) == count


def test_a_kernel_that_dies_in_a_cell_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(runs(1, DeadKernelError, tmp_path, monkeypatch)) == 1
