"""All that can be checked of a release before there is an address: files, metadata, workflows."""

from __future__ import annotations

import re
import shutil
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from email.parser import Parser
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT = SETTINGS["project"]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))

KEPT = (
    ".github", "binder", "book/ext", "book/make", "book/teaching", "notebooks", "nrdob", "recipe",
    "tests",
)  # fmt: skip

CONDA = {"matplotlib": "matplotlib-base"}
"""Names that differ there: without the parts for windows on a screen."""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build wheel and sdist, from a copy whose project has an address."""
    builders = (
        pytest.importorskip("hatchling.builders.wheel"),
        pytest.importorskip("hatchling.builders.sdist"),
    )
    place = tmp_path_factory.mktemp("built")
    skipped = shutil.ignore_patterns("__pycache__")
    for folder in ("nrdob", "book/nrdob_course"):
        shutil.copytree(ROOT / folder, place / folder, ignore=skipped)
    for path in filter(Path.is_file, ROOT.iterdir()):
        shutil.copy(path, place)
    shutil.copy(ROOT / "book" / "pyproject.toml", place / "book")
    settings = (place / "pyproject.toml").read_text("utf-8")
    given = settings.replace('repository = ""', 'repository = "https://example.org/nrdob.git/"')
    assert given != settings
    (place / "pyproject.toml").write_text(given, "utf-8")
    for module, kind in zip(builders, ("WheelBuilder", "SdistBuilder"), strict=True):
        list(getattr(module, kind)(str(place)).build(directory=str(place / "dist")))
    list(builders[0].WheelBuilder(str(place / "book")).build(directory=str(place / "course")))
    return place / "dist"


@pytest.mark.slow
def test_wheel_and_sdist_hold_the_package_and_no_course(built: Path) -> None:
    (wheel,), (sdist,) = built.glob("*.whl"), built.glob("*.tar.gz")
    names = zipfile.ZipFile(wheel).namelist()
    with tarfile.open(sdist) as archive:
        sources = [name.partition("/")[2] for name in archive.getnames()]
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "nrdob").rglob("*.py")}
    for held in (names, sources):
        assert modules <= set(held) and "nrdob/py.typed" in held
        assert not [name for name in held if "course" in name or "__pycache__" in name]
    assert {"hatch_build.py", "README.md", "LICENSE"} <= set(sources)
    (about,) = (name for name in names if name.endswith("METADATA"))
    metadata = Parser().parsestr(zipfile.ZipFile(wheel).read(about).decode())
    assert (metadata["Name"], metadata["Version"]) == ("nrdob", PROJECT["version"])
    assert metadata["Project-URL"] == "Source, https://example.org/nrdob"
    assert metadata["License-Expression"] == "BSD-3-Clause"
    # On the page of an index nothing lies beside the text.
    page, here = metadata.get_payload(), "https://example.org/nrdob"
    targets = re.findall(r'\]\(([^)]+)\)|src="([^"]+)"', page)
    places = ["".join(target) for target in targets]
    assert len(places) > 8 and all(place.startswith("https://") for place in places)
    inside = [place.partition("/main/")[2] for place in places if place.startswith(here)]
    assert len(inside) > 6 and all((ROOT / each.partition("#")[0]).exists() for each in inside)


@pytest.mark.slow
def test_students_are_told_of_the_wheel_with_the_checks_which_can_grade_too(built: Path) -> None:
    (course,) = built.with_name("course").glob("*.whl")
    names = {name.removeprefix("nrdob_course/") for name in zipfile.ZipFile(course).namelist()}
    assert {"exercises/set1.toml", "sets/source/set1/set1.ipynb", "problems.toml"} <= names
    (licence,) = (each for each in names if each.endswith("licenses/nrdob_course/LICENSE"))
    assert zipfile.ZipFile(course).read(licence) == (ROOT / "LICENSE").read_bytes()
    told = (ROOT / "book" / "teaching" / "running.md").read_text("utf-8")
    (install,) = re.findall(r"^python -m pip install (nrdob.*)$", told, re.MULTILINE)
    assert install.split() == [*(each.name for each in built.glob("*.whl")), course.name]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_installs_what_its_tests_need(path: Path) -> None:
    known = PROJECT["optional-dependencies"].keys()
    for name, job in yaml.safe_load(path.read_text("utf-8"))["jobs"].items():
        lines = "\n".join(step.get("run", "") for step in job["steps"])
        for extras in re.findall(r"\.\[([\w,-]+)\]", lines):
            assert set(extras.split(",")) <= known, (name, extras)
        if "nrdob_course" in lines:
            assert "-e ./book" in lines, name


def test_the_lowest_versions_are_tested_of_all_that_is_declared() -> None:
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8"))["jobs"]
    lines = "\n".join(step.get("run", "") for step in jobs["lowest"]["steps"])
    for declared in PROJECT["dependencies"]:
        name, version = declared.split(">=")
        assert re.search(rf'"{name}=={re.escape(version)}(\.0)?"', lines), declared


def test_versions_agree() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    recipe = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text("utf-8"))
    course = tomllib.loads((ROOT / "book" / "pyproject.toml").read_text("utf-8"))["project"]
    assert {citation["version"], recipe["context"]["version"], course["version"]} == {
        PROJECT["version"]
    }


def test_the_recipe_says_what_the_project_says() -> None:
    recipe = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text("utf-8"))
    needed = [f"python {PROJECT['requires-python']}"]
    for line in PROJECT["dependencies"]:
        name, version = re.fullmatch(r"([\w-]+)(>=.+)", line).groups()
        needed.append(f"{CONDA.get(name, name)} {version}")
    assert sorted(recipe["requirements"]["run"]) == sorted(needed)
    scripts = [f"{name} = {place}" for name, place in PROJECT["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == scripts
    assert recipe["about"]["summary"] == PROJECT["description"]
    backend = SETTINGS["build-system"]["requires"]
    assert [line.replace(" ", "") for line in recipe["requirements"]["host"][1:2]] == backend


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_can_be_read_and_runs_what_exists(path: Path) -> None:
    jobs = yaml.safe_load(path.read_text("utf-8"))["jobs"]
    makefile = (ROOT / "Makefile").read_text("utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    for name, job in jobs.items():
        assert job["timeout-minutes"], name
        assert set(job.get("needs", [])) <= set(jobs) or job["needs"] in jobs
        for step in job["steps"]:
            assert ("run" in step) != ("uses" in step)
            assert re.search(r"@(v\d+|release/v\d+)$", step.get("uses", "@v1")), step
            run = step.get("run", "")
            for made in re.findall(r"^make ([a-z -]+)$", run, re.MULTILINE):
                assert set(made.split()) <= targets, run
            for file in re.findall(r"\bpython (?:-I )?((?:book|tests)/[\w/]+\.py)", run):
                assert (ROOT / file).exists(), run


def test_the_release_publishes_by_trust_and_the_address_stands_in_one_place() -> None:
    release = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text("utf-8"))
    publish = release["jobs"]["publish"]
    assert publish["permissions"]["id-token"] == "write" and publish["environment"]
    assert not re.search(r"password|secrets\.", yaml.safe_dump(release))
    assert len(list(texts_of(ROOT))) > 300
    assert list(with_an_address(ROOT)) == []


def texts_of(root: Path) -> Iterator[Path]:
    """Give what is read by people, and what runs; pyproject.toml has the address."""
    inside = [path for folder in KEPT for path in (root / folder).rglob("*.*")]
    yield from filter(Path.is_file, [*inside, *root.glob("[!p]*"), *root.glob("book/*.*")])


def with_an_address(root: Path) -> Iterator[Path]:
    """Give the texts that write where the project lives: as it is set, or on GitHub by its name."""
    address = SETTINGS["tool"]["nrdob"]["repository"].encode()
    own = re.compile(rb"github(usercontent)?(\.\w+)?/[\w./-]*nrdob")
    for path in texts_of(root):
        text = path.read_bytes()
        if (address and address in text) or own.search(text):
            yield path


@pytest.mark.parametrize(
    "place",
    ["README.md", "CITATION.cff", "book/get.md", "notebooks/01.ipynb", ".github/workflows/ci.yml"],
)
@pytest.mark.parametrize("host", ["github.com/owner", "owner.github.io"])
def test_an_address_written_elsewhere_is_found(place: str, host: str, tmp_path: Path) -> None:
    path = tmp_path / place
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"See https://{host}/nrdob/issues.", "utf-8")
    assert list(with_an_address(tmp_path)) == [path]


def test_the_lock_has_the_pins_and_a_hash_for_each():
    pins = (ROOT / "requirements.txt").read_text("utf-8").splitlines()
    lock = (ROOT / "requirements.lock").read_text("utf-8").replace("\\\n", "").splitlines()
    parts = [line.split("--hash=sha256:") for line in lock]
    assert [re.sub(r"\[[\w,-]+\]", "", pin).strip() for pin, *_ in parts] == pins
    assert all(found and all(len(each.strip()) == 64 for each in found) for _, *found in parts)
