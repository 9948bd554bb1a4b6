"""Formulas of the pages, set when they are written: a browser shows them without a script.

Where one is wider than its place on a phone, formulas.js sets it a little smaller.
"""

from __future__ import annotations

from html import escape
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number

from mathml import TexError, mathml

logger = logging.getLogger(__name__)


def set_formula(translator: Any, node: nodes.Element, latex: str, display: bool) -> None:
    """Write a formula into the page, or say where one cannot be read."""
    try:
        translator.body.append(mathml(latex, display))
    except TexError as error:
        logger.warning("%s: %s", error, latex, location=node)
        translator.body.append(f"<code>{escape(latex)}</code>")


def visit_inline(translator: Any, node: nodes.math) -> None:
    """Set a formula in a line of text."""
    translator.body.append(translator.starttag(node, "span", "", CLASS="math notranslate"))
    set_formula(translator, node, node.astext(), display=False)
    translator.body.append("</span>")
    raise nodes.SkipNode


def visit_display(translator: Any, node: nodes.math_block) -> None:
    """Set a formula in a line of its own, with its number."""
    translator.body.append(translator.starttag(node, "div", CLASS="math notranslate"))
    if node["number"]:
        translator.body.append(f'<span class="eqno">({get_node_equation_number(translator, node)})')
        translator.add_permalink_ref(node, "Link to this equation")
        translator.body.append("</span>")
    set_formula(translator, node, node.astext().strip(), display=True)
    translator.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("formulas", (visit_inline, None), (visit_display, None))
    app.add_js_file("formulas.js", loading_method="defer")
    return {"parallel_read_safe": True, "parallel_write_safe": True}
