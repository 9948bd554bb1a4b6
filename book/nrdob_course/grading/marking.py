"""Pages for the teacher, each one file without names and network.

One is for marking answers in words, problem by problem. It shows the problem, the published
solution with the points, what the instructor's pack says, and all the answers to it, each under a
code. Points and comments are typed beside the answers; a button writes them as a table, which
``report`` takes. What was typed is kept in the browser meanwhile. The other shows the class at a
glance: points for each problem, the mistakes that were recognised, and times.
"""

import base64
import hashlib
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from statistics import mean, median
from typing import Any
from urllib.parse import unquote

import nbformat
from jinja2 import Environment, PackageLoader
from markupsafe import Markup
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath
from nbgrader.api import Gradebook

from ..exercises import PROBLEMS
from .feedback import NOWHERE, offline
from .marks import (
    Line,
    Record,
    Records,
    comment_of,
    grades_of,
    in_order,
    number,
    place_of,
    problem_of,
    unmarked,
)
from .release import MARKERS
from .written import answers_of, to_be_marked

__all__ = ["write_marking", "write_tally"]

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
        | {"answers": [_answer(path, *each, gradebook) for each in answers[name, problem, cell]]}
        for name, problem, cell in sorted(answers, key=lambda place: in_order(place[1]))
    ]
    style, script = (
        Markup(files(__package__).joinpath("pages", f"marking.{kind}").read_text("utf-8"))
        for kind in ("css", "js")
    )
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    key = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:8]
    how = {"style": style, "script": script, "digest": digest, "key": key}
    page = PAGES.get_template("marking.html").render(problems=problems, **how)
    path.write_text(page + "\n", "utf-8")


def _problem(source: Any, name: str, advice: Mapping[str, Any]) -> dict[str, Any]:
    """Give what was asked, what is right, and what goes wrong."""
    texts = {cell.id: MARKERS.sub("", cell.source) for cell in source.cells if "id" in cell}
    task = texts.get(name.replace("written", "task"), "")
    return {**advice, "task": task, "solution": texts.get(name, "")}


def _answer(path: Path, entry: Record, grade: Any, gradebook: Gradebook) -> dict[str, Any]:
    pictures = dict(_pictures((path.parent / place_of(entry)).parent))
    cell = dict(answers_of(path, entry)).get(grade.name, {})
    for name, held in cell.get("attachments", {}).items():
        pictures |= {f"attachment:{name}": f"data:{kind};base64,{held[kind]}" for kind in held}
    return {
        "entry": entry,
        "grade": grade,
        "text": _shown(cell.get("source", ""), pictures),
        "pictures": list(pictures.values()),
        "comment": comment_of(gradebook, entry, grade).manual_comment or "",
    }


def _pictures(place: Path) -> Iterator[tuple[str, str]]:
    for file in sorted(place.iterdir()) if place.is_dir() else ():
        kind = MIME.get(file.suffix.lower())
        if kind and file.is_file() and not file.is_symlink():
            data = base64.b64encode(file.read_bytes()).decode()
            yield file.name, f"data:image/{kind};base64,{data}"


class _Once(IPythonRenderer):
    """Takes each of the pictures the first time that a text shows it: it may do so for ever."""

    pictures: dict[str, str]

    def image(self, text: str, url: str, title: str | None = None) -> str:
        url = self.pictures.pop(unquote(url), url)
        return str(super().image(text, "" if url.startswith("attachment:") else url, title))


def _shown(text: str, pictures: dict[str, str] | None = None) -> Markup:
    """Convert Markdown to a piece of a page that does nothing but be read; take what it shows."""
    renderer = _Once(escape=False)
    renderer.pictures = pictures or {}
    html = str(MarkdownWithMath(renderer).render(text)).strip()
    return Markup(offline(re.sub(r"\A<p>(.*)</p>\Z", r"\1", html)))


PAGES.filters |= {"number": number, "shown": _shown}


# --- the class at a glance ----------------------------------------------------------------------


def mistakes(root: Path, found: Iterable[Line]) -> Counter[tuple[str, str]]:
    """Count the misconceptions that the feedback has named, by problem."""
    counts: Counter[tuple[str, str]] = Counter()
    known = [(id, kind) for id, problem in PROBLEMS.items() for kind in problem.misconceptions]
    said = {(id, kind.name): escape(kind.says) for id, kind in known}
    for line in found:
        path = root / place_of(line.entry, "autograded")
        if not path.exists():
            continue
        told = {
            problem_of(cell.id): "".join(
                str(out.get("data", {}).get("text/html", "")) for out in cell.get("outputs", [])
            )
            for cell in nbformat.read(path, as_version=4).cells
            if cell.get("id", "").startswith("check")
        }
        counts.update(key for key, words in said.items() if words in told.get(key[0], ""))
    return counts


def write_tally(path: Path, root: Path, found: Sequence[Line]) -> None:
    """Write the page, with a part for each set."""
    graded = [line for line in found if line.grades]
    graded.sort(key=lambda line: in_order(line.entry["set"]))
    counts = mistakes(root, graded)
    sets = []
    for name, lines in groupby(graded, key=lambda line: line.entry["set"]):
        mine = list(lines)
        shares = dict(sorted(_shares(mine).items(), key=lambda item: in_order(item[0])))
        named = [(*key, count) for key, count in counts.items() if key[0] in shares]
        named.sort(key=lambda item: (-item[2], in_order(item[0])))
        sets.append({"name": name, "lines": mine, "shares": shares, "mistakes": named})
    how = {"nowhere": NOWHERE, "mean": mean, "median": median}
    page = PAGES.get_template("class.html").render(sets=sets, **how)
    path.write_text(page + "\n", "utf-8")


def _shares(graded: Iterable[Line]) -> dict[str, list[float]]:
    """Give the shares of the points that were earned, by problem."""
    shares: dict[str, list[float]] = {}
    for grade in (grade for line in graded for grade in line.grades):
        given = shares.setdefault(problem_of(grade.name), [])
        if grade.max_score and not unmarked(grade):
            given.append(float(grade.score) / float(grade.max_score))
    return shares
