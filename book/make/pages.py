"""What the programs that make pages share: templates, notebooks, installed files, options."""

import argparse
import json
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "notebooks"
TEACHING = ROOT / "book" / "teaching"


def quarters(number: float) -> str:
    """Write a number to its quarters, 2.75 as 2¾."""
    return f"{int(number) or ''}{('', '¼', '½', '¾')[int(number * 4) % 4]}"


TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).resolve().parents[1] / "templates"),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
"""The templates, NAME.j2 for the page NAME; a line with nothing but a statement leaves no line."""

TEMPLATES.filters |= {
    # Plain text, so that Markdown shows it as it is.
    "plain": lambda text: re.sub(r"([\\`*_{}\[\]<>|$~#])", r"\\\1", text),
    # Markdown, so that it fits into a cell of a table.
    "cell": lambda text: text.replace("|", r"\|").replace("\n", " "),
    "hours": quarters,
    "points": lambda points: "1 point" if points == 1 else f"{points:g} points",
}


def render(name: str, **given: Any) -> str:
    return TEMPLATES.get_template(f"{name}.j2").render(**given)


def same(text: str, target: Path) -> bool:
    """Tell whether a page is stored as it is made; git may have changed the line ends."""
    return target.exists() and target.read_bytes().replace(b"\r\n", b"\n") == text.encode()


def store(text: str, target: Path) -> None:
    """Store a page, with Unix line ends everywhere, and only where it changed."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if not target.exists() or target.read_bytes() != text.encode():
        target.write_bytes(text.encode())


def keep(made: Mapping[Path, str], *, check: bool) -> int:
    """Store pages, or only name those that are behind their source; the result is an exit code."""
    for target, text in made.items():
        if not check:
            store(text, target)
    behind = [target.name for target, text in made.items() if not same(text, target)]
    return report("What is stored", [f"{name} is behind its source: make pages" for name in behind])


def report(what: str, problems: Sequence[str]) -> int:
    """Say what is not in order, all of it; the result is an exit code."""
    if problems:
        print(f"{what} is not in order:", *problems, sep="\n  ", file=sys.stderr)
    return 1 if problems else 0


def on_html(write: Callable[[Any, Path], None]) -> Callable[[Any, Exception | None], None]:
    """Make a handler of Sphinx that writes into the folder of the site once its pages are there."""

    def written(app: Any, failed: Exception | None) -> None:
        if failed is None and app.builder.format == "html":
            write(app, Path(app.outdir))

    return written


def installed(package: str, end: str) -> Path:
    """Find a file that an installed package carries, by the end of its path."""
    files = distribution(package).files or []
    return Path(str(next(file for file in files if file.match(end)).locate()))


def cells_of(notebook: Path) -> list[dict[str, Any]]:
    """Read the cells of a notebook, the source of each in one piece."""
    cells = json.loads(notebook.read_text("utf-8"))["cells"]
    return [cell | {"source": "".join(cell["source"])} for cell in cells]


def prose_of(notebook: Path) -> list[str]:
    """Give the text of the Markdown cells of a notebook."""
    return [cell["source"] for cell in cells_of(notebook) if cell["cell_type"] == "markdown"]


def options(
    about: str | None, arguments: list[str] | None, *, check: bool = False, **paths: Path
) -> argparse.Namespace:
    """Read a command line: a folder or file for each name, and whether only to compare."""
    parser = argparse.ArgumentParser(description=(about or "").partition("\n")[0])
    for name, default in paths.items():
        parser.add_argument(f"--{name}", type=Path, default=default, help="by default %(default)s")
    if check:
        parser.add_argument("--check", action="store_true", help="only compare with what is stored")
    return parser.parse_args(arguments)
