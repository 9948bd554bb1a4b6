"""Print the layers of the package as the import contracts have them, each module with its lines.

python -m tests.structure.map
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def drawn(root: Path) -> Iterator[str]:
    """Write the contracts, the highest layer first."""
    settings = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))
    for contract in settings["tool"]["importlinter"]["contracts"]:
        for container in contract.get("containers", ()):
            yield from _layers(root, container, contract["layers"])


def _layers(root: Path, container: str, layers: list[str]) -> Iterator[str]:
    base = root / "book" if container.startswith("nrdob_course") else root
    folder = base.joinpath(*container.split("."))
    yield f"{container}: {lines(folder)} lines"
    for layer in layers:
        yield "    " + "  ".join(f"{m} {lines(folder / m)}" for m in layer.split(" | "))


def lines(place: Path) -> int:
    """Count the lines of a module, or of all modules of a package."""
    paths = place.rglob("*.py") if place.is_dir() else [place.with_suffix(".py")]
    return sum(len(path.read_text("utf-8").splitlines()) for path in paths)


if __name__ == "__main__":
    print(*drawn(ROOT), sep="\n")
