"""The index of ideas: in it, every word of the glossary has the chapters that speak of it.

A chapter speaks of a word if the glossary leads to it, if a heading has it, or if the text has it
often. The names of the package stay out: they have a page of their own, and would drown the rest.
"""

from __future__ import annotations

import re
from itertools import compress
from pathlib import Path
from typing import NamedTuple

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

CHAPTERS, GLOSSARY, NAMES = "chapters", "glossary.md", "api/"
OFTEN = 4
FENCE = re.compile(r"```\{glossary\}\n(.*?)\n```", re.DOTALL)


class Word(NamedTuple):
    """An entry of the glossary: the names of one meaning, and the chapter that it leads to."""

    names: list[str]
    page: str


def words(glossary: Path) -> list[Word]:
    """Read the entries of the glossary."""
    fence = FENCE.search(glossary.read_text("utf-8"))
    entries = re.split(r"\n\s*\n", fence[1]) if fence else []
    return [
        Word(
            [line.strip() for line in entry.splitlines() if line[:1].strip()],
            "".join(re.findall(r"\((chapters/\w+)\.ipynb\)", entry)[-1:]),
        )
        for entry in entries
    ]


class Concordance(SphinxTransform):
    """Index a chapter by the words of the glossary; leave the names of the package out."""

    default_priority = 840  # before Sphinx notes the entries

    def apply(self, **_: object) -> None:
        if self.env.docname.startswith(NAMES):
            for index in self.document.findall(addnodes.index):
                index["entries"] = []
        glossary = Path(self.env.srcdir) / GLOSSARY
        if not self.env.docname.startswith(f"{CHAPTERS}/") or not glossary.exists():
            return
        self.env.note_dependency(glossary)
        sections = list(self.document.findall(nodes.section))
        if not sections:
            return
        title = sections[0][0].astext().replace(";", ",")
        prose = [own_text(section) for section in sections]
        for word in words(glossary):
            place = self.place(word, sections, prose)
            if place is not None:
                entry = ("single", f"{word.names[0]}; {title}", place["ids"][0], "", None)
                place.insert(1, addnodes.index(entries=[entry]))

    def place(
        self, word: Word, sections: list[nodes.section], prose: list[str]
    ) -> nodes.section | None:
        """Find the section that speaks of a word, if the chapter does."""
        either = "|".join(r"\s+".join(map(re.escape, name.split())) for name in word.names)
        pattern = re.compile(rf"(?<!\w)(?:{either})(?:e?s)?(?!\w)", re.IGNORECASE)
        for section in sections:
            if pattern.search(section[0].astext()):
                return section
        counts = [len(pattern.findall(text)) for text in prose]
        if word.page != self.env.docname and sum(counts) < OFTEN:
            return None
        return next(compress(sections, counts), sections[0])


def own_text(section: nodes.section) -> str:
    """Give the prose of a section, without that of the sections in it."""
    return "\n".join(
        paragraph.astext()
        for child in section
        if not isinstance(child, nodes.section)
        for paragraph in child.findall(nodes.paragraph)
    )


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_transform(Concordance)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
