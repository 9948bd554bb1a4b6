"""The chapters on their way onto the pages: what each gets before Sphinx reads it, and a last look.

While a chapter is read its title gets its number, its opening picture comes up to the question that
it belongs to, and the figures attached to the prediction are laid beside the page; behind the
prediction, or the first figure, comes what can be moved, as ``explorables.toml`` has it; and behind
a cell whose metadata names claims, as ``{"claims": ["eq03"]}``, they are shown at the margin.

A build fails on a chapter that lacks what `shape` says, whatever Sphinx remembers of an earlier
one. And Sphinx forgets all of it when a program that makes pages has changed: the number of this
extension's version is made of all their texts.
"""

import base64
import json
import re
from collections.abc import Iterable
from io import BytesIO
from itertools import takewhile
from pathlib import Path
from typing import Any
from zlib import crc32

from PIL import Image
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util import logging

from explorable import places
from nrdob.plotting.figure import PIXELS
from openings import GOALS
from predictions import KEY
from shape import faults_of_book

CHAPTERS, PICTURES = "chapters", "predictions"
BOOK = Path(__file__).resolve().parents[1]
CHAPTER = re.compile(rf"{CHAPTERS}/(0?(\d+|[A-Z])_\w+)")

logger = logging.getLogger(__name__)


def folder_of(env: BuildEnvironment, *, noted: bool = False) -> Path:
    """Give the folder of the chapters; noted, the page is written again when one changes."""
    folder = Path(env.srcdir) / CHAPTERS
    for path in folder.glob("*.ipynb") if noted else ():
        env.note_dependency(path)
    return folder


def complete(app: Sphinx, page: str, source: list[str]) -> None:
    """Put into a chapter that is being read what its notebook does not store."""
    if not (chapter := CHAPTER.fullmatch(page)):
        return
    notebook = json.loads(source[0])
    cells = notebook["cells"]
    title = "".join(cells[0]["source"])
    cells[0]["source"] = re.sub(r"\A# ", rf"# {chapter[2]}. ", title)
    ask(app, chapter[1], cells)
    move(app, chapter[1], cells)
    picture_first(cells)
    notebook["cells"] = [each for cell in cells for each in (cell, *claims_beside(cell))]
    source[0] = json.dumps(notebook)


def ask(app: Sphinx, chapter: str, cells: list[dict[str, Any]]) -> None:
    """Lay the figures of the question beside the page, and let Sphinx read the lines to click."""
    for cell in cells:
        if KEY not in cell["metadata"]:
            continue
        text = "".join(cell["source"])  # between empty lines a line to click is Markdown
        text = re.sub("<summary>(.*)</summary>", r"<summary>\n\n\1\n\n</summary>", text)
        for name, data in cell.pop("attachments").items():
            png, place = base64.b64decode(data["image/png"]), f"{PICTURES}/{chapter}-{name}"
            (folder_of(app.env) / PICTURES).mkdir(exist_ok=True)
            (folder_of(app.env) / place).write_bytes(png)
            picture = Image.open(BytesIO(png))
            width = round(picture.width / picture.info["dpi"][0] * PIXELS)
            text = text.replace(f"(attachment:{name})", f"({place}){{width={width}px}}")
        cell["source"] = text


def move(app: Sphinx, chapter: str, cells: list[dict[str, Any]]) -> None:
    """Lay what can be moved behind the question of a chapter, or its first figure."""
    if chapter in places(Path(app.srcdir)):
        about = [cell["metadata"] for cell in cells]
        questions = [k for k, each in enumerate(about) if KEY in each]
        figures = [k for k, each in enumerate(about) if "figure" in each.get("mystnb", {})]
        text = f"```{{explorable}} {chapter}\n```"
        cells.insert((questions + figures)[0] + 1, new_cell("explorable", text))


def picture_first(cells: list[dict[str, Any]]) -> None:
    """Bring the opening picture up to the question, before what the chapter teaches.

    A notebook runs in order, so there the first imports come before the picture. Only a picture
    before any other text opens a chapter.
    """
    opening = takewhile(lambda cell: cell["cell_type"] == "code", cells[1:])
    pictures = [cell for cell in opening if "figure" in cell["metadata"].get("mystnb", {})]
    question, goals, rest = "".join(cells[0]["source"]).partition(GOALS)
    if not (pictures and goals):
        return
    cells.remove(pictures[0])
    cells[0]["source"] = question
    cells[1:1] = [pictures[0], new_cell("goals", goals + rest)]


def claims_beside(cell: dict[str, Any]) -> list[dict[str, Any]]:
    """Give the cell that shows at the margin the claims which this one's metadata names."""
    if not (claims := cell["metadata"].get("claims")):
        return []
    links = " ".join(f"`claim:{id}`" for id in claims)
    text = f":::{{container}} margin-claims\n{links}\n:::"
    return [new_cell(f"{cell['id']}-claims"[-64:], text)]


def new_cell(id: str, text: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "id": id, "metadata": {}, "source": text}


def warn(faults: Iterable[str]) -> None:
    """Name faults of chapters, each of which begins with the name of one."""
    for fault in faults:
        page, _, said = fault.partition(": ")
        logger.warning(said, location=f"{CHAPTERS}/{page}")


def check(app: Sphinx) -> None:
    warn(faults_of_book(Path(app.srcdir) / CHAPTERS))


def version() -> int:
    """Give a number that changes with each change of a program that makes pages."""
    made = ("explorables.toml", "ext/*.py", "make/*.py", "templates/*.j2")
    files = sorted(file for pattern in made for file in BOOK.glob(pattern))
    return crc32(b"".join(file.read_bytes() for file in files))


def setup(app: Sphinx) -> dict[str, bool | int]:
    app.connect("builder-inited", check)
    app.connect("source-read", complete)
    return {"env_version": version(), "parallel_read_safe": True, "parallel_write_safe": True}
