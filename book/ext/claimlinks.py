"""Links between the chapters and the ledger: inline code ``claim:ID`` leads to the entry of ID.

A cell whose metadata names claims, ``{"claims": ["eq03"]}``, shows them at the margin of its page.

The way back is made here as well: the first mention of a claim in a chapter gets the label
``shown-<chapter>-<ID>``, to which its entry links.
"""

from __future__ import annotations

import json
import re

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.transforms import SphinxTransform
from sphinx.util import logging
from sphinx.util.nodes import make_refnode

CITED_IN_PROSE = re.compile(r"claim:(\S+)")
CITED_IN_CODE = re.compile(r"""\bclaims\.check\(\s*["']([^"']+)["']""")

logger = logging.getLogger(__name__)


def claim_link(id: str, page: str, beside: nodes.Element) -> pending_xref:
    """Make a link to the entry of a claim, which stands where this node does."""
    name = nodes.literal(id, id, classes=["claim-link"])
    link = pending_xref("", name, reftype="claim", reftarget=id, refdoc=page)
    link.source, link.line = beside.source, beside.line
    return link


class ClaimLinks(SphinxTransform):
    """Turn citations of claims into links, and mark the first one of each claim."""

    default_priority = 500

    def apply(self, **_: object) -> None:
        marked: set[str] = set()
        for node in list(self.document.findall(nodes.Element)):
            if isinstance(node, nodes.literal_block):
                for id in CITED_IN_CODE.findall(node.astext()):
                    self.mark(node, id, marked)
            elif isinstance(node, nodes.literal) and (
                match := CITED_IN_PROSE.fullmatch(node.astext())
            ):
                link = claim_link(match[1], self.env.docname, node)
                node.replace_self(link)
                self.mark(link[0], match[1], marked)

    def mark(self, node: nodes.Element, id: str, marked: set[str]) -> None:
        """Label the first mention of a claim in a chapter."""
        folder, _, chapter = self.env.docname.rpartition("/")
        if folder == "chapters" and id not in marked:
            marked.add(id)
            node["names"].append(f"shown-{chapter}-{id}".lower())
            self.document.note_explicit_target(node)


def show_in_margin(_app: Sphinx, page: str, source: list[str]) -> None:
    """Put behind each cell of a chapter the claims that its metadata names."""
    if not page.startswith("chapters/"):
        return
    notebook = json.loads(source[0])
    cells = []
    for cell in notebook["cells"]:
        cells.append(cell)
        if claims := cell["metadata"].get("claims"):
            links = " ".join(f"`claim:{id}`" for id in claims)
            text = f":::{{container}} margin-claims\n{links}\n:::"
            id = f"{cell['id']}-claims"[-64:]
            cells.append({"cell_type": "markdown", "id": id, "metadata": {}, "source": text})
    source[0] = json.dumps(notebook | {"cells": cells})


def resolve(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, name: nodes.TextElement
) -> nodes.Element | None:
    """Lead a citation to the entry of its claim, or say that there is none."""
    if node["reftype"] != "claim":
        return None
    label = f"claim-{node['reftarget']}".lower()
    if label not in env.domains.standard_domain.anonlabels:
        logger.warning("there is no claim %r in the ledger", node["reftarget"], location=node)
        return name
    page, anchor = env.domains.standard_domain.anonlabels[label]
    return make_refnode(app.builder, node["refdoc"], page, anchor, name, "in the ledger of claims")


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_transform(ClaimLinks)
    app.connect("source-read", show_in_margin)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
