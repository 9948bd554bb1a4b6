"""A block diagram of the package on a page that is no notebook: ``{diagram} nrdob``."""

from __future__ import annotations

import base64
from html import escape

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from nrdob.plotting import Figure, diagrams


def embedded(figure: Figure, kind: str) -> str:
    """Write a figure as an image that the page holds, of a class of the style sheet."""
    picture = base64.b64encode(figure.png()).decode()
    alt = escape(figure.alt, quote=True)
    return f'<img class="{kind}" alt="{alt}" src="data:image/png;base64,{picture}">'


class BlockDiagram(SphinxDirective):
    """Draw one of `nrdob.plotting.diagrams`, with what it shows in words."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        drawn = getattr(diagrams, self.arguments[0])().plot()
        return [nodes.raw("", embedded(drawn, "diagram"), format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("diagram", BlockDiagram)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
