"""Cards that are folded: a line to see, and the rest behind it, without a script.

::::{fold} claim reproduced
:name: claim-eq03
:lines: 2

What is always seen: the first block, or as many as `lines` says.

The rest.
::::
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class Card(nodes.General, nodes.Element):
    """What can be folded: its line, and the rest."""


class CardLine(nodes.General, nodes.Element):
    """What is seen of it when it is folded."""


class Fold(SphinxDirective):
    """A card: the classes as argument, the first blocks seen, the others folded."""

    optional_arguments = 1
    final_argument_whitespace = True
    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {
        "name": directives.unchanged, "lines": directives.positive_int,
    }  # fmt: skip

    def run(self) -> list[nodes.Node]:
        blocks = self.parse_content_to_nodes()
        seen = self.options.get("lines", 1)
        card = Card(
            "",
            CardLine("", *blocks[:seen]),
            *blocks[seen:],
            classes=" ".join(self.arguments).split(),
        )
        self.add_name(card)
        return [card]


def element(name: str) -> tuple[Callable[[Any, Any], None], Callable[[Any, Any], None]]:
    """Give what begins an element of a page, and what ends it."""
    return (
        lambda translator, node: translator.body.append(translator.starttag(node, name)),
        lambda translator, _: translator.body.append(f"</{name}>\n"),
    )


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_node(Card, html=element("details"))
    app.add_node(CardLine, html=element("summary"))
    app.add_directive("fold", Fold)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
