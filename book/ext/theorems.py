"""Theorems on the pages: a box each, links wherever one is mentioned, and the index of all.

What a theorem is, and what is amiss with one, stands in `statements`; the build fails on it.

    ```{theorem-index}
    ```

stands for the index, which is made from the chapters each time it is read.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.transforms import SphinxTransform
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import make_refnode

from complete import CHAPTERS, warn
from findable import plain
from statements import MENTION, NUMBER, Theorem, anchor, faults_of_book, theorems_of, title_of

TITLE = re.compile(rf"Theorem ({NUMBER.pattern}) \((.+)\)\.", re.DOTALL)
NO_MENTION = (nodes.literal, nodes.literal_block, nodes.math, nodes.math_block, nodes.raw,
              nodes.reference, nodes.title, nodes.comment, addnodes.pending_xref)  # fmt: skip

logger = logging.getLogger(__name__)


def folder(env: BuildEnvironment) -> Path:
    """Where the chapters lie while the book is built."""
    return Path(env.srcdir) / CHAPTERS


def check(app: Sphinx) -> None:
    """Name what is amiss with the theorems, in every build, whatever Sphinx remembers."""
    warn(faults_of_book(folder(app.env)))
    app.env.nrdob_theorems = {  # type: ignore[attr-defined]
        theorem.number: theorem
        for theorems in theorems_of(folder(app.env)).values()
        for theorem in theorems
    }


class Boxes(SphinxTransform):
    """Make a box of each theorem, and a link of each mention."""

    default_priority = 490

    def apply(self, **_: object) -> None:
        for quotation in list(self.document.findall(nodes.block_quote)):
            self.box(quotation)
        for text in list(self.document.findall(nodes.Text)):
            if MENTION.search(text) and not inside(text, NO_MENTION):
                text.parent.replace(text, list(self.linked(text)))

    def box(self, quotation: nodes.block_quote) -> None:
        """Turn a quotation into a box, if it is a theorem."""
        strong = leading(quotation[0]) if quotation.children else None
        if not isinstance(strong, nodes.strong):
            return
        match = TITLE.fullmatch(strong.astext())
        if not match and strong.astext() != "Standing assumptions.":
            return
        box = nodes.container("", *quotation.children, classes=["theorem"])
        quotation.replace_self(box)
        strong["classes"].append("theorem-title")
        if not match:
            return
        box["names"].append(anchor(match[1]))
        box["ids"].append(anchor(match[1]))
        self.document.note_explicit_target(box)
        # In the order of the alphabet an article counts for nothing.
        name = re.sub(r"^(A|An|The) ", "", plain(match[2])).replace(";", ",").replace("_n", "ₙ")
        entry = (f"{name[:1].upper()}{name[1:]} (Theorem {match[1]})", anchor(match[1]))
        index = addnodes.index(entries=[("single", *entry, "main", None)])
        box.parent.insert(box.parent.index(box), index)
        for paragraph in box.findall(nodes.paragraph):
            label = leading(paragraph)
            notes = ("Without", "Proof", "Known")
            if isinstance(label, nodes.emphasis) and label.astext().startswith(notes):
                paragraph["classes"].append("theorem-note")

    def linked(self, text: nodes.Text) -> list[nodes.Node]:
        """Cut a text into what is said and the links to the theorems it mentions."""
        pieces: list[nodes.Node] = []
        done = 0
        for mention in MENTION.finditer(text):
            start = mention.start()
            for number in NUMBER.finditer(text, *mention.span(1)):
                pieces.append(nodes.Text(text[done:start]))
                shown = nodes.inline("", text[start : number.end()])
                link = addnodes.pending_xref(
                    "", shown, reftype="theorem", reftarget=number[0], refdoc=self.env.docname
                )
                link.source, link.line = text.parent.source, text.parent.line
                pieces.append(link)
                done = number.end()
                rest = NUMBER.search(text, done, mention.end())
                start = rest.start() if rest else done
        return [piece for piece in [*pieces, nodes.Text(text[done:])] if piece.astext()]


def leading(paragraph: nodes.Node) -> nodes.Node | None:
    """Give what a paragraph begins with; the reader of Markdown leaves empty texts before it."""
    return next((node for node in paragraph.children if node.astext()), None)


def inside(node: nodes.Node, kinds: tuple[type, ...]) -> bool:
    """Tell whether a node stands in one of those kinds, or in the title of a theorem."""
    while (node := node.parent) is not None:
        if isinstance(node, kinds) or (
            isinstance(node, nodes.strong) and "theorem-title" in node["classes"]
        ):
            return True
    return False


def resolve(
    app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, shown: nodes.TextElement
) -> nodes.Element | None:
    """Lead a mention to its theorem, or say that there is none."""
    if node["reftype"] != "theorem":
        return None
    theorem: Theorem | None = env.nrdob_theorems.get(node["reftarget"])  # type: ignore[attr-defined]
    if theorem is None:
        if not node["refdoc"].startswith(f"{CHAPTERS}/"):  # of chapters it is said already
            logger.warning("there is no Theorem %s", node["reftarget"], location=node)
        return shown
    page, title = f"{CHAPTERS}/{theorem.page}", re.sub(r"[$\\]", "", theorem.name)
    return make_refnode(app.builder, node["refdoc"], page, theorem.anchor, shown, title)


class TheoremIndex(SphinxDirective):
    """All theorems by chapter: conditions, statement, counterexamples, proof, who knew it."""

    def run(self) -> list[nodes.Node]:
        for path in folder(self.env).glob("*.ipynb"):
            self.env.note_dependency(path)
        text = "\n\n".join(
            written(page, title_of(folder(self.env) / f"{page}.ipynb"), theorems)
            for page, theorems in theorems_of(folder(self.env)).items()
            if theorems
        )
        return self.parse_text_to_nodes(
            text or "No chapter has a numbered theorem yet.", allow_section_headings=True
        )


def written(page: str, title: str, theorems: list[Theorem]) -> str:
    """Write the entries of a chapter."""
    lines = [f"## [{title}](/{CHAPTERS}/{page}.ipynb)"]
    for theorem in theorems:
        fields = {
            "For": setting_of(theorem),
            "If": "\n".join(f"{k}. {text}" for k, text in theorem.conditions.items()),
            "Then": theorem.then,
            **{f"Without {k}": text for k, text in theorem.without.items()},
            "Proof": theorem.proof,
            "Known": theorem.known,
        }
        lines += [
            ":::{container} theorem-entry\n",
            f"**Theorem {theorem.number}** ({theorem.name})\n",
            *(f"{label}\n: {indented(text)}\n" for label, text in fields.items() if text),
            ":::",
        ]
    return "\n".join(lines)


def setting_of(theorem: Theorem) -> str:
    """Say what a theorem is about, if that is another thing than the loop of Figure 1."""
    plain = theorem.setting.replace("*", "")
    text = re.sub(r"^(Let|For)[ ,]+(for )?|([ .,]*\b([Ll]et|and))+[ ,]*$", "", plain).strip(" ,")
    return "" if text in ("Let", "the loop of Figure 1") else text


def indented(text: str) -> str:
    """Write a text as the body of a definition, its links as seen from the page of the index."""
    text = re.sub(r"\]\((?!https?:|#|/)([^)]+\.ipynb)", rf"](/{CHAPTERS}/\1", text)
    return text.replace("\n", "\n  ")


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("theorem-index", TheoremIndex)
    app.add_transform(Boxes)
    app.connect("builder-inited", check)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
