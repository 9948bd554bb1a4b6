"""The prediction questions on the pages of the book: as in the notebooks, and with their figures.

The cell that a chapter stores is exchanged, while the chapter is read, for one that is made of the
same question, with the pictures of the notebook for class.
"""

from __future__ import annotations

import base64
import json
from functools import partial
from pathlib import Path

from sphinx.application import Sphinx

from predictions import KEY, Question, markdown, read_questions

CHAPTERS = "chapters"
PICTURES = "predictions"


def summary(text: str) -> str:
    """Give a line to be clicked as Markdown, between empty lines, so that Sphinx reads it."""
    return f"\n\n{text}\n\n"


def store_picture(folder: Path, question: Question, which: str) -> str:
    """Lay a picture beside the chapters, and give the Markdown that shows it."""
    picture = getattr(question, which)
    if picture is None:
        return ""
    name = f"{PICTURES}/{question.chapter}-{which}.png"
    (folder / PICTURES).mkdir(exist_ok=True)
    (folder / name).write_bytes(base64.b64decode(picture.png))
    return f"![{picture.alt}]({name}){{width={picture.width}px}}"


def show_pictures(app: Sphinx, page: str, source: list[str]) -> None:
    """Exchange the cell of the question in a chapter that is being read."""
    if not page.startswith(f"{CHAPTERS}/"):
        return
    classes = Path(app.srcdir) / app.config.nrdob_class
    questions = read_questions(classes)
    notebook = json.loads(source[0])
    for cell in notebook["cells"]:
        if chapter := cell["metadata"].get(KEY):
            question = questions[chapter]
            app.env.note_dependency(classes / Path(question.deck).name)
            picture = partial(store_picture, Path(app.srcdir) / CHAPTERS)
            cell["source"] = markdown(question, summary, picture)
    source[0] = json.dumps(notebook)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_config_value("nrdob_class", "../notebooks/class", "env", str)
    app.connect("source-read", show_pictures)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
