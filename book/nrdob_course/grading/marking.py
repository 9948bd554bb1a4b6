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
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from nbconvert.filters.markdown_mistune import markdown2html_mistune
from nbgrader.api import Gradebook

from .feedback import offline
from .marks import Record, Records, grades_of, in_order, number, problem_of
from .release import MARKERS
from .submissions import PICTURES
from .written import answers_of, to_be_marked

__all__ = ["write_marking"]

MIME = {".jpg": "jpeg", ".jpeg": "jpeg", ".png": "png", ".gif": "gif"}

STYLE, SCRIPT = (
    files(__package__).joinpath(f"marking.{kind}").read_text("utf-8") for kind in ("css", "js")
)


def write_marking(
    path: Path, gradebook: Gradebook, records: Records, sets: Mapping[str, Any], advice: Path
) -> None:
    """Write the page; `sets` are the sets with their solutions, `advice` a file with rubrics."""
    answers: dict[tuple[str, str, str], list[tuple[Record, Any]]] = {}
    for entry in records.entries:
        for grade in filter(to_be_marked, grades_of(gradebook, entry)):
            place = (entry["set"], problem_of(grade.name), grade.name)
            answers.setdefault(place, []).append((entry, grade))
    if not answers:
        path.unlink(missing_ok=True)
        return
    rubrics = tomllib.loads(advice.read_text("utf-8")) if advice.exists() else {}
    body = "".join(
        _problem(path, sets[name], problem, cell, found, gradebook, rubrics.get(problem, {}))
        for (name, problem, cell), found in sorted(
            answers.items(), key=lambda item: in_order(item[0][1])
        )
    )
    digest = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
    policy = (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{digest}'"
    )
    mine = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:8]
    path.write_text(
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}"/>'
        f'<title>Answers to be marked</title><style>{STYLE}</style></head><body data-key="{mine}">'
        "<h1>Answers to be marked</h1><p>Type points and, if you like, a comment. Enter goes to "
        "the next answer, Shift+Enter back, Ctrl+S writes <code>marked.csv</code>; then: "
        "<code>python -m nrdob_course.grading report marked.csv</code></p>"
        '<header><button id="download">Write marked.csv</button> '
        f'<span id="state" role="status"></span></header><main>{body}</main>'
        f"<script>{SCRIPT}</script></body></html>\n",
        "utf-8",
    )


def _problem(
    path: Path,
    source: Any,
    problem: str,
    name: str,
    found: Iterable[tuple[Record, Any]],
    gradebook: Gradebook,
    advice: Mapping[str, Any],
) -> str:
    """Write what was asked, what is right, and each of the answers, in the order of the codes."""
    texts = {cell.id: MARKERS.sub("", cell.source) for cell in source.cells if "id" in cell}
    task = texts.get(name.replace("written", "task"), "")
    rubric = "".join(
        f"<li>{number(points)}: {_shown(what)}</li>" for points, what in advice.get("rubric", [])
    )
    wrong = "".join(
        f"<li>{_shown(what)} <em>Say:</em> {_shown(say)}</li>"
        for what, say in advice.get("wrong", [])
    )
    each = "".join(
        _answer(path, entry, grade, gradebook)
        for entry, grade in sorted(found, key=lambda pair: str(pair[0]["code"]))
    )
    return (
        f"<section><h2>Problem {escape(problem)}</h2><details open><summary>The problem</summary>"
        f"{_shown(task)}</details><details><summary>The solution, with its points</summary>"
        f"{_shown(texts.get(name, ''))}</details>"
        + (f"<details open><summary>Rubric</summary><ul>{rubric}</ul></details>" if rubric else "")
        + (
            f"<details><summary>What goes wrong</summary><ul>{wrong}</ul></details>"
            if wrong
            else ""
        )
        + f"{each}</section>"
    )


def _answer(path: Path, entry: Record, grade: Any, gradebook: Gradebook) -> str:
    where = (grade.name, entry["set"], entry["set"], entry["folder"])
    comment = gradebook.find_comment(*where).manual_comment or ""
    place = path.parent / "submitted" / entry["folder"] / entry["set"]
    pictures = dict(_pictures(place))
    cell = dict(answers_of(path, entry)).get(grade.name)
    text = cell.source if cell else ""
    for name, held in (cell.get("attachments", {}) if cell else {}).items():
        for mime, data in held.items() if isinstance(held, dict) else ():
            text = text.replace(f"attachment:{name}", f"data:{mime};base64,{data}")
    for name in [name for name in pictures if f"({name})" in text]:
        text = text.replace(f"({name})", f"({pictures.pop(name)})")
    others = "".join(f'<img src="{data}" alt="a page"/>' for data in pictures.values())
    problem, most = problem_of(grade.name), number(grade.max_score)
    code, label = escape(entry["code"]), f"Points for {entry['code']}, of {most}"
    return (
        f'<article data-code="{code}" data-set="{entry["set"]}" data-problem="{problem}" '
        f'data-of="{most}"><h3>{code}</h3><div>{_shown(text)}</div>'
        + (f"<details><summary>Pictures</summary>{others}</details>" if others else "")
        + f'<p><input name="points" inputmode="decimal" autocomplete="off" aria-label="{label}" '
        f'value="{number(grade.manual_score)}"/> of {most}</p><textarea name="comment" rows="2" '
        f'aria-label="Comment for {code}" placeholder="A comment">{escape(comment)}</textarea>'
        "</article>"
    )


def _pictures(place: Path) -> Iterator[tuple[str, str]]:
    for file in sorted(place.iterdir()) if place.is_dir() else ():
        kind = MIME.get(file.suffix.lower()) if file.suffix.lower() in PICTURES else None
        if kind and file.is_file() and not file.is_symlink():
            data = base64.b64encode(file.read_bytes()).decode()
            yield file.name, f"data:image/{kind};base64,{data}"


def _shown(text: str) -> str:
    """Convert Markdown to a piece of a page that does nothing but be read."""
    html = re.sub(r"\A<p>(.*)</p>\Z", r"\1", markdown2html_mistune(text).strip())
    return offline(html)
