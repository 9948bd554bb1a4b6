"""A page for marking answers in words: one file, problem by problem, without names and network.

It shows the problem, the published solution with the points, what the instructor's pack says, and
all the answers to it, each under a code. Points and comments are typed beside the answers; a button
writes them as a table, which ``report`` takes. What was typed is kept in the browser meanwhile.
"""

from __future__ import annotations

import base64
import hashlib
import re
import tomllib
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader
from markupsafe import Markup
from nbconvert.filters.markdown_mistune import markdown2html_mistune
from nbgrader.api import Gradebook

from .feedback import offline
from .marks import Record, Records, grades_of, in_order, number, problem_of
from .release import MARKERS
from .submissions import PICTURES
from .written import answers_of, to_be_marked

__all__ = ["PAGES", "write_marking"]

MIME = {".jpg": "jpeg", ".jpeg": "jpeg", ".png": "png", ".gif": "gif"}

PAGES = Environment(loader=PackageLoader(__package__, "pages"), autoescape=True, trim_blocks=True)


def write_marking(
    path: Path, gradebook: Gradebook, records: Records, sets: Mapping[str, Any], advice: Path
) -> None:
    """Write the page; `sets` are the sets with their solutions, `advice` a file with rubrics."""
    answers: dict[tuple[str, str, str], list[tuple[Record, Any]]] = {}
    for entry in sorted(records.entries, key=lambda entry: str(entry.get("code"))):
        for grade in filter(to_be_marked, grades_of(gradebook, entry)):
            place = (entry["set"], problem_of(grade.name), grade.name)
            answers.setdefault(place, []).append((entry, grade))
    if not answers:
        path.unlink(missing_ok=True)
        return
    rubrics = tomllib.loads(advice.read_text("utf-8")) if advice.exists() else {}
    problems = [
        {"problem": problem}
        | _problem(sets[name], cell, rubrics.get(problem, {}))
        | {"answers": [_answer(path, *each, gradebook) for each in found]}
        for (name, problem, cell), found in sorted(
            answers.items(), key=lambda item: in_order(item[0][1])
        )
    ]
    style, script = (
        Markup(files(__package__).joinpath("pages", f"marking.{kind}").read_text("utf-8"))
        for kind in ("css", "js")
    )
    page = PAGES.get_template("marking.html").render(
        problems=problems,
        style=style,
        script=script,
        digest=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        key=hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:8],
    )
    path.write_text(page + "\n", "utf-8")


def _problem(source: Any, name: str, advice: Mapping[str, Any]) -> dict[str, Any]:
    """Give what was asked, what is right, and what goes wrong."""
    texts = {cell.id: MARKERS.sub("", cell.source) for cell in source.cells if "id" in cell}
    return {
        "task": _shown(texts.get(name.replace("written", "task"), "")),
        "solution": _shown(texts.get(name, "")),
        "rubric": [(number(points), _shown(what)) for points, what in advice.get("rubric", [])],
        "wrong": [(_shown(what), _shown(say)) for what, say in advice.get("wrong", [])],
    }


def _answer(path: Path, entry: Record, grade: Any, gradebook: Gradebook) -> dict[str, Any]:
    where = (grade.name, entry["set"], entry["set"], entry["folder"])
    pictures = dict(_pictures(path.parent / "submitted" / entry["folder"] / entry["set"]))
    cell = dict(answers_of(path, entry)).get(grade.name)
    text = cell.source if cell else ""
    for name, held in (cell.get("attachments", {}) if cell else {}).items():
        for mime, data in held.items() if isinstance(held, dict) else ():
            text = text.replace(f"attachment:{name}", f"data:{mime};base64,{data}")
    for name in [name for name in pictures if f"({name})" in text]:
        text = text.replace(f"({name})", f"({pictures.pop(name)})")
    return {
        "code": entry["code"],
        "set": entry["set"],
        "text": _shown(text),
        "pictures": list(pictures.values()),
        "most": number(grade.max_score),
        "points": number(grade.manual_score),
        "comment": gradebook.find_comment(*where).manual_comment or "",
    }


def _pictures(place: Path) -> Iterator[tuple[str, str]]:
    for file in sorted(place.iterdir()) if place.is_dir() else ():
        kind = MIME.get(file.suffix.lower()) if file.suffix.lower() in PICTURES else None
        if kind and file.is_file() and not file.is_symlink():
            data = base64.b64encode(file.read_bytes()).decode()
            yield file.name, f"data:image/{kind};base64,{data}"


def _shown(text: str) -> Markup:
    """Convert Markdown to a piece of a page that does nothing but be read."""
    html = re.sub(r"\A<p>(.*)</p>\Z", r"\1", markdown2html_mistune(text).strip())
    return Markup(offline(html))
