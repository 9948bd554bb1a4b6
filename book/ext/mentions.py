r"""What a page mentions and another one holds: claims of the ledger, and theorems with their index.

Inline code ``claim:ID`` leads to the entry of ID in the ledger. For the way back the first mention
of a claim in a chapter gets the label ``shown-<chapter>-<ID>``, to which its entry links.

A displayed equation of a chapter with ``\tag{3}`` is the paper's (3): the page gives it the
number, the anchor ``paper-eq-3`` and a line that leads to the ledger.

A theorem becomes a box, and each mention of it a link. What a theorem is, and what is amiss with
one, stands in `statements`; the build fails on it. ``{theorem-index}`` stands for the index of all
theorems, which is made from the chapters each time it is read.
"""

import re
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.transforms import SphinxTransform
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import make_refnode

from chapters import CHAPTERS, folder_of, logger, warn
from findable import read_aloud
from nrdob_course.claims import LEDGER
from pages import render
from statements import MENTION, NUMBER, Theorem, anchor, faults_of_book, theorems_of, title_of

CLAIM = re.compile(r"claim:(\S+)")
TAG = re.compile(r"\s*\\tag\{(\d+)\}")
TITLE = re.compile(rf"Theorem ({NUMBER.pattern}) \((.+)\)\.", re.DOTALL)
NO_MENTION = (nodes.literal, nodes.literal_block, nodes.math, nodes.math_block, nodes.raw,
              nodes.reference, nodes.title, nodes.comment, addnodes.pending_xref)  # fmt: skip


def link(kind: str, name: str, shown: nodes.Node, page: str, beside: nodes.Node) -> nodes.Element:
    """Make a link to a claim or a theorem, which stands where this node does."""
    found = addnodes.pending_xref("", shown, reftype=kind, reftarget=name, refdoc=page)
    found.source, found.line = beside.source, beside.line
    return found


def resolve(
    app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, shown: nodes.TextElement
) -> nodes.Element | None:
    """Lead a mention to the claim or the theorem, or say that there is none."""
    name, at = node["reftarget"], (app.builder, node["refdoc"])
    if node["reftype"] == "claim":
        if place := env.domains.standard_domain.anonlabels.get(f"claim-{name}".lower()):
            return make_refnode(*at, *place, shown, "in the ledger of claims")
        logger.warning("there is no claim %r in the ledger", name, location=node)
    elif node["reftype"] == "theorem":
        theorem: Theorem | None = env.nrdob_theorems.get(name)  # type: ignore[attr-defined]
        if theorem:
            page, title = f"{CHAPTERS}/{theorem.page}", re.sub(r"[$\\]", "", theorem.name)
            return make_refnode(*at, page, theorem.anchor, shown, title)
        if not node["refdoc"].startswith(f"{CHAPTERS}/"):  # of chapters it is said already
            logger.warning("there is no Theorem %s", name, location=node)
    else:
        return None
    return shown


# --- claims ---------------------------------------------------------------------------------------


def claim_link(id: str, page: str, beside: nodes.Element) -> nodes.Element:
    return link("claim", id, nodes.literal(id, id, classes=["claim-link"]), page, beside)


class Claims(SphinxTransform):
    """Turn citations of claims into links, and label the first one of each claim in a chapter."""

    default_priority = 500

    def apply(self, **_: object) -> None:
        page = self.env.docname
        chapter = page.removeprefix(f"{CHAPTERS}/")
        marked: set[str] = set()
        for node in list(self.document.findall(nodes.literal)):
            if match := CLAIM.fullmatch(node.astext()):
                cited = claim_link(match[1], page, node)
                node.replace_self(cited)
                if chapter != page and match[1] not in marked:
                    marked.add(match[1])
                    cited[0]["names"].append(f"shown-{chapter}-{match[1]}".lower())
                    self.document.note_explicit_target(cited[0])


def claims_of(stem: str, figure: int = 0) -> list[str]:
    """Give the claims of the ledger about one thing in the paper: eq03, fig15a, lemma1, ex2.

    For a figure those, too, that the paper makes of another thing and shows there.
    """
    return [
        id
        for id, claim in LEDGER.items()
        if re.fullmatch(rf"{stem}[a-z]?", id.partition(".")[0].partition("_")[0])
        or (figure and re.search(rf"Fig\. {figure}(?!\d)", claim.place))
    ]


class PaperNumbers(SphinxTransform):
    """Give the paper's equations their numbers, anchors, and the way to the ledger."""

    default_priority = 480

    def apply(self, **_: object) -> None:
        if not self.env.docname.startswith(f"{CHAPTERS}/"):
            return
        led: set[str] = set()
        for formula in list(self.document.findall(nodes.math_block)):
            latex = formula.astext()
            numbers = TAG.findall(latex)
            if len(numbers) == 1:  # the page sets it, where any formula can
                formula.rawsource = TAG.sub("", latex)
                formula.children = []
                formula += nodes.Text(formula.rawsource)
                formula["number"] = numbers[0]
            if new := [number for number in numbers if number not in led]:
                led |= set(new)
                self.lead(formula, new)

    def lead(self, formula: nodes.math_block, numbers: list[str]) -> None:
        """Give a formula its anchors, and a line that leads to the ledger."""
        anchors = [f"paper-eq-{number}" for number in numbers]
        targets = [nodes.target("", "", ids=[each], names=[each]) for each in anchors]
        if not formula.get("ids"):
            formula["ids"] = [f"paper-formula-{numbers[0]}"]
        listed = ", ".join(f"({number})" for number in numbers)
        said = f"The paper's equation{'s' * (len(numbers) > 1)} {listed}"
        line = nodes.paragraph("", "", nodes.Text(said), classes=["paper-number"])
        for k, id in enumerate(id for number in numbers for id in claims_of(f"eq{int(number):02}")):
            line += [nodes.Text("; " if k else ": "), claim_link(id, self.env.docname, formula)]
        place = formula.parent.index(formula)
        formula.parent[place : place + 1] = [*targets, formula, line]


# --- theorems -------------------------------------------------------------------------------------


def check(app: Sphinx) -> None:
    """Name what is amiss with the theorems, in every build, whatever Sphinx remembers."""
    warn(faults_of_book(folder_of(app.env)))
    chapters = theorems_of(folder_of(app.env)).values()
    by_number = {theorem.number: theorem for theorems in chapters for theorem in theorems}
    app.env.nrdob_theorems = by_number  # type: ignore[attr-defined]


class Boxes(SphinxTransform):
    """Make a box of each theorem, and a link of each mention."""

    default_priority = 490

    def apply(self, **_: object) -> None:
        for quotation in list(self.document.findall(nodes.block_quote)):
            self.box(quotation)
        for text in list(self.document.findall(nodes.Text)):
            if MENTION.search(text) and not inside(text):
                pieces = [each for each in self.linked(text) if each.astext()]
                text.parent.replace(text, pieces)

    def box(self, quotation: nodes.block_quote) -> None:
        """Turn a quotation into a box, if it is a theorem."""
        strong = leading(quotation[0]) if quotation.children else None
        if not isinstance(strong, nodes.strong):
            return
        match = TITLE.fullmatch(read_aloud(strong))
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
        name = re.sub(r"^(A|An|The) ", "", match[2]).replace(";", ",").replace("_n", "ₙ")
        entry = (f"{name[:1].upper()}{name[1:]} (Theorem {match[1]})", anchor(match[1]))
        index = addnodes.index(entries=[("single", *entry, "main", None)])
        box.parent.insert(box.parent.index(box), index)
        for paragraph in box.findall(nodes.paragraph):
            label = leading(paragraph)
            notes = ("Without", "Proof", "Known")
            if isinstance(label, nodes.emphasis) and label.astext().startswith(notes):
                paragraph["classes"].append("theorem-note")

    def linked(self, text: nodes.Text) -> Iterator[nodes.Node]:
        """Cut a text into what is said and the links; the first of a mention has its word, too."""
        done = 0
        for mention in MENTION.finditer(text):
            start = mention.start()
            for number in NUMBER.finditer(text, *mention.span(1)):
                yield nodes.Text(text[done:start])
                shown = nodes.inline("", text[start : number.end()])
                yield link("theorem", number[0], shown, self.env.docname, text.parent)
                done = number.end()
                rest = NUMBER.search(text, done, mention.end())
                start = rest.start() if rest else done
        yield nodes.Text(text[done:])


def leading(paragraph: nodes.Node) -> nodes.Node | None:
    """Give what a paragraph begins with; the reader of Markdown leaves empty texts before it."""
    return next((node for node in paragraph.children if node.astext()), None)


def inside(node: nodes.Node) -> bool:
    """Tell whether a node stands where nothing is a mention, or in the title of a theorem."""
    while (node := node.parent) is not None:
        if isinstance(node, NO_MENTION) or "theorem-title" in node.get("classes", ()):
            return True
    return False


class TheoremIndex(SphinxDirective):
    """All theorems by chapter: conditions, statement, counterexamples, proof, who knew it."""

    def run(self) -> list[nodes.Node]:
        folder = folder_of(self.env, noted=True)
        chapters = [
            (f"/{CHAPTERS}/{page}.ipynb", title_of(folder / f"{page}.ipynb"), theorems)
            for page, theorems in theorems_of(folder).items()
            if theorems
        ]
        text = render("theorem_index.md", chapters=chapters, entry=entry)
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def entry(theorem: Theorem) -> dict[str, str]:
    """Give what the index says of a theorem, by label, its links as seen from there."""
    plain = theorem.setting.replace("*", "")
    about = re.sub(r"^(Let|For)[ ,]+(for )?|([ .,]*\b([Ll]et|and))+[ ,]*$", "", plain).strip(" ,")
    said = {
        "For": "" if about in ("Let", "the loop of Figure 1") else about,
        "If": "\n".join(f"{k}. {text}" for k, text in theorem.conditions.items()),
        **theorem.parts,
    }
    link = re.compile(r"\]\((?!https?:|#|/)([^)]+\.ipynb)")
    return {label: link.sub(rf"](/{CHAPTERS}/\1", text) for label, text in said.items() if text}


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("theorem-index", TheoremIndex)
    app.add_transform(Boxes)
    app.add_transform(Claims)
    app.add_transform(PaperNumbers)
    app.connect("builder-inited", check)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
