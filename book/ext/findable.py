"""What leads a reader to a word: what the search of the site knows, and the index of ideas.

The search knows of each page its kind, and of each section the anchor, the title and the text as a
reader reads it, with formulas in plain letters; and for each word of the glossary the chapter that
introduces it. All of it lies in one script, ``_static/texts.js``, since a page opened from a disk
may load no other page.

In the index every word of the glossary has the chapters that speak of it: those to which the
glossary leads, those with the word in a heading, and those whose text has it often. The names of
the package stay out: they have a page of their own, and would drown the rest.
"""

import json
import re
from functools import cache
from itertools import compress
from pathlib import Path
from typing import Any, NamedTuple
from unicodedata import normalize
from xml.etree import ElementTree

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.search.en import SearchEnglish
from sphinx.transforms import SphinxTransform

from mathml import TexError, mathml
from pages import on_html

TEXTS, GLOSSARY = "texts.js", "glossary.md"
LONGEST = {"chapter": 540, "page": 400, "names": 120, "teaching": 250}
"""Letters kept of a section, by the kind of its page."""
KINDS = {"chapters": "chapter", "teaching": "teaching", "api": "names"}
"""What sort of page lies in a folder."""
OFTEN = 4

UNREAD = (nodes.comment, nodes.raw, nodes.image, nodes.target, addnodes.index, addnodes.toctree,
          nodes.literal_block, nodes.figure)  # fmt: skip
BLOCKS = (nodes.paragraph, nodes.math_block, nodes.term, nodes.caption, nodes.rubric)

ENTRIES = re.compile(r"```\{glossary\}\n(.*?)\n```", re.DOTALL)
PLAIN = str.maketrans("−ϕϵ∘⋅\u2061˜ˆ˙¯", "-φε°· \u0303\u0302\u0307\u0304")
"""Signs of a formula, and accents, which are set after their letter."""
SUPERSCRIPTS = str.maketrans("0123456789+-n", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ")


# --- formulas in plain letters --------------------------------------------------------------------


@cache
def plain(latex: str, display: bool = False) -> str:
    """Write a formula in one line of plain letters, near enough to be recognised."""
    try:
        read = mathml(re.sub(r"\\tag\{\d+\}", "", latex).strip(), display)
    except TexError:  # it is named where the formula is set
        return latex
    return " ".join(letters(ElementTree.fromstring(read)).split())


def letters(element: ElementTree.Element) -> str:
    """Write an element of a formula in one line, with the brackets it needs."""
    parts = [letters(each) for each in element]
    match element.tag:
        case "mspace":
            return " "
        case "mtable":
            return "; ".join(parts)
        case "mtr":
            return " ".join(parts)
        case "mfrac":
            bare = re.compile(r"[\w\u0303]+")
            return "/".join(part if bare.fullmatch(part) else f"({part})" for part in parts)
        case "msqrt":
            return f"√({''.join(parts)})"
        case "msub" | "munder":
            return f"{parts[0]}_{parts[1]}"
        case "msup":
            return parts[0] + power(parts[1])
        case "msubsup" | "munderover":
            return f"{parts[0]}_{parts[1]}{power(parts[2])}"
    text = (element.text or "").translate(PLAIN)
    return (text if text in "ϱ…" else normalize("NFKC", text)) + "".join(parts)


def power(exponent: str) -> str:
    """Write a short exponent above the line, another one behind a caret."""
    raised = exponent.translate(SUPERSCRIPTS)
    return raised if re.fullmatch(r"[⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ′°]+", raised) else f"^({exponent})"


# --- what a reader reads --------------------------------------------------------------------------


def read_aloud(node: nodes.Node) -> str:
    """Give the text of a node, formulas in plain letters, without what no one reads."""
    if isinstance(node, nodes.Text):
        return str(node.astext())
    if isinstance(node, UNREAD):
        return ""
    if isinstance(node, addnodes.pending_xref) and node.get("refdomain") == "cite":
        return ", ".join(map(cited, node["reftarget"].split(",")))
    if isinstance(node, (nodes.math, nodes.math_block)):
        return plain(node.astext(), isinstance(node, nodes.math_block))
    return "".join(read_aloud(child) for child in node.children)


def cited(key: str) -> str:
    """Write the key of a reference as author and year."""
    found = re.match(r"\s*([a-z]+)(\d{4})", key)
    return f"{found[1].title()} ({found[2]})" if found else key


def text_of(section: nodes.section) -> str:
    """Give the prose of a section, without that of the sections in it."""
    blocks = section.findall(lambda node: isinstance(node, BLOCKS) and is_in(section, node))
    return " ".join(" ".join(map(read_aloud, blocks)).split())


def is_in(section: nodes.section, block: nodes.Node) -> bool:
    """Tell whether a block is a section's own, and in nothing that is unread."""
    while (block := block.parent) is not section:
        if isinstance(block, (nodes.section, *UNREAD, *BLOCKS)):
            return False
    return True


class Word(NamedTuple):
    """An entry of the glossary: the names of one meaning, and the chapter that it leads to."""

    names: list[str]
    page: str


def words(glossary: Path) -> list[Word]:
    """Read the entries of the glossary; none without one."""
    found = ENTRIES.search(glossary.read_text("utf-8")) if glossary.exists() else None
    return [
        Word(
            [line.strip() for line in entry.splitlines() if line[:1].strip()],
            "".join(re.findall(r"\((chapters/\w+)\.ipynb\)", entry)[-1:]),
        )
        for entry in (re.split(r"\n\s*\n", found[1]) if found else ())
    ]


# --- the search -----------------------------------------------------------------------------------


def entry(page: str, tree: nodes.document) -> dict[str, Any]:
    """Give what the search knows of one page."""
    sections = list(tree.findall(nodes.section))
    kind = KINDS.get(page.partition("/")[0], "page")
    titles = [read_aloud(section[0]) for section in sections]
    texts = [cut(text_of(section), LONGEST[kind]) for section in sections]
    ids = [section["ids"][0] for section in sections]
    told = [list(each) for each in zip(ids, titles, texts, strict=True)]
    return {"kind": kind, "title": titles[0] if titles else page, "sections": told}


def cut(text: str, most: int) -> str:
    """Keep the beginning of a text, up to a word."""
    return text if len(text) <= most else text[:most].rpartition(" ")[0] + " …"


def write_texts(app: Sphinx, folder: Path) -> None:
    pages = {page: entry(page, app.env.get_doctree(page)) for page in sorted(app.env.found_docs)}
    linked = [word for word in words(Path(app.srcdir) / GLOSSARY) if word.page]
    terms = {name.lower(): word.page for word in linked for name in word.names}
    known = {"pages": pages, "terms": terms}
    text = json.dumps(known, ensure_ascii=False, separators=(",", ":"))
    (folder / "_static" / TEXTS).write_text(f"window.TEXTS = {text};\n", "utf-8")


def add_scripts(app: Sphinx, page: str, *_: object) -> None:
    """Load on the page of the search what it needs."""
    if page == "search":
        app.add_js_file(TEXTS)
        app.add_js_file("search.js", loading_method="defer")


# --- the index ------------------------------------------------------------------------------------


class Concordance(SphinxTransform):
    """Index a chapter by the words of the glossary; leave the names of the package out."""

    default_priority = 840  # before Sphinx notes the entries

    def apply(self, **_: object) -> None:
        kind = KINDS.get(self.env.docname.partition("/")[0])
        if kind == "names":
            for index in self.document.findall(addnodes.index):
                index["entries"] = []
        sections = list(self.document.findall(nodes.section))
        if kind != "chapter" or not sections:
            return
        glossary = Path(self.env.srcdir) / GLOSSARY
        self.env.note_dependency(glossary)
        title = sections[0][0].astext().replace(";", ",")
        prose = [text_of(section) for section in sections]
        for word in words(glossary):
            if place := self.place(word, sections, prose):
                entry = ("single", f"{word.names[0]}; {title}", place["ids"][0], "", None)
                place.insert(1, addnodes.index(entries=[entry]))

    def place(
        self, word: Word, sections: list[nodes.section], prose: list[str]
    ) -> nodes.section | None:
        """Find the section that speaks of a word, if the chapter does."""
        either = "|".join(r"\s+".join(map(re.escape, name.split())) for name in word.names)
        pattern = re.compile(rf"(?<!\w)(?:{either})(?:e?s)?(?!\w)", re.IGNORECASE)
        if named := [each for each in sections if pattern.search(each[0].astext())]:
            return named[0]
        counts = [len(pattern.findall(text)) for text in prose]
        if word.page != self.env.docname and sum(counts) < OFTEN:
            return None
        return next(compress(sections, counts), sections[0])


def setup(app: Sphinx) -> dict[str, bool]:
    # Sphinx finds the stem of a word anew on each page.
    SearchEnglish.stem = cache(SearchEnglish.stem)  # type: ignore[method-assign]
    app.add_transform(Concordance)
    app.connect("html-page-context", add_scripts)
    app.connect("build-finished", on_html(write_texts))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
