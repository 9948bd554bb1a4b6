"""What the tests of the course share: a set that was given out."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest
from nbgrader import api

from handin import NAME
from nrdob_course.exercises.problems import Case
from nrdob_course.grading import command
from nrdob_course.grading.release import SOURCE, found_course, generate


@pytest.fixture(scope="session", autouse=True)
def _asked_once() -> Iterator[None]:
    """Ask for the version of nbgrader's database once.

    For each new gradebook nbgrader starts a Python that reads all of nbgrader to print it.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(api, "get_alembic_version", cache(api.get_alembic_version))
        yield


@pytest.fixture(scope="session")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Make the students' copy of a set, once; the course must stay as it is."""

    @cache
    def course(name: str) -> Path:
        root = tmp_path_factory.mktemp("fresh")
        found_course(root)
        generate(root, SOURCE, name)
        return root

    return course


@pytest.fixture(scope="session", autouse=True)
def _given_out_once(fresh: Callable[[str], Path]) -> Iterator[None]:
    """Give it to all empty courses: all are alike."""

    def given_out(root: Path, source: Path, name: str) -> Path:
        if source != SOURCE or (root / "gradebook.db").exists():
            return generate(root, source, name)
        for folder in ("source", "release"):
            shutil.copytree(fresh(name) / folder / name, root / folder / name, dirs_exist_ok=True)
        shutil.copy(fresh(name) / "gradebook.db", root)
        return root / "release" / name

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "generate", given_out)
        yield


@pytest.fixture(scope="session")
def released(fresh: Callable[[str], Path]) -> Path:
    """What was given out of the set that is handed in."""
    return fresh(NAME) / "release"


@pytest.fixture
def case(request: pytest.FixtureRequest) -> Case:
    """Draw the case that `each_case` asks for."""
    problem, number = request.param
    return problem.cases(1, number + 1)[number]
