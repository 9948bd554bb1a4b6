"""What the pages need that no writer should think of: formulas, commas, columns, names of buttons.

Formulas are set when a page is written: a browser shows them without a script. Where one is wider
than its place on a phone, formulas.js sets it a little smaller.

A browser may break a line between an inline formula and the comma after it, a number and its unit,
or a word and its number; here they are tied together. Printed columns are marked, so that a phone
does not break their lines, and long code, which may go on overleaf on paper. A picture of
a chapter leads to its file, where it can be enlarged. The arrows that open a part of the contents
get a name for those who hear the page, and so do empty corners of tables.
"""

import re
from html import escape
from typing import Any
from urllib.parse import quote

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number
from sphinx.util.osutil import relative_uri

from mathml import TexError, mathml

SPACE = "\N{NO-BREAK SPACE}"
UNIT = r"(?:N\sm(?:\ss)?|N|kg\sm²|kg|rad/s²?|rad|[kM]?Hz|[mµμ]?s|mm|dB|%|V)(?![\w/²])"
NUMBERED = (
    r"\b(?i:examples?|theorems?|figures?|lemmas?|corollary|corollaries|chapters?|conditions?"
    r"|exercises?|questions?|orders?|degree)\s(?:\d|[ivx]+\b)"
)
END = r"\s∎"
LOOSE = re.compile(rf"(?<=\d)\s{UNIT}|{NUMBERED}|{END}")
AFTER = re.compile(rf"[.,;:!?)\]’”]*(?:{END})?")
AFTER_NUMBER = re.compile(rf"(?:\s{UNIT})?{AFTER.pattern}")
LONG = 14
"""Lines of code that stay together on paper."""
COLUMNS = re.compile(r"\S {2,}\S")
BEFORE = re.compile(r"[(\[“‘]+$")
VERBATIM = (nodes.FixedTextElement, nodes.literal, nodes.math, addnodes.desc_signature)


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


def typeset(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Do it all, after every reference is resolved."""
    mark_code(doctree)
    name_corners(doctree)
    tie_words(doctree)
    if app.builder.format == "html" and page.startswith("chapters/"):
        link_pictures(app, doctree, page)
    tie_punctuation(doctree)


def tie_words(doctree: nodes.document) -> None:
    """Keep numbers beside their units and names, and the sign that ends a proof in its line."""
    for text in list(doctree.findall(nodes.Text)):
        if not isinstance(text.parent, VERBATIM):
            tied = LOOSE.sub(lambda found: re.sub(r"\s", SPACE, found.group()), text)
            text.parent.replace(text, nodes.Text(tied))


def tie_punctuation(doctree: nodes.document) -> None:
    """Put each inline formula into one unbreakable piece with the marks and the unit behind it."""
    for formula in list(doctree.findall(nodes.math)):
        behind = AFTER_NUMBER if re.search(r"\d}?$", formula.astext()) else AFTER
        before, after = touching(formula, -1, BEFORE), touching(formula, 1, behind)
        if before or after:
            pieces = nodes.Text(before), formula.deepcopy(), nodes.Text(after)
            formula.replace_self(nodes.inline("", "", *pieces, classes=["tied"]))


def touching(formula: nodes.math, step: int, marks: re.Pattern[str]) -> str:
    """Cut the marks that touch a formula off the text beside it, and return them."""
    parent = formula.parent
    place = parent.index(formula) + step
    text = parent[place] if 0 <= place < len(parent) else None
    if not isinstance(text, nodes.Text):
        return ""
    found = (marks.match if step > 0 else marks.search)(text)
    if not found:
        return ""
    parent[place] = nodes.Text(text[: found.start()] + text[found.end() :])
    return re.sub(r"\s", SPACE, found.group())


def link_pictures(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Let each picture of a chapter lead to its file."""
    folder = relative_uri(app.builder.get_target_uri(page), app.builder.imagedir)
    for image in list(doctree.findall(nodes.image)):
        if image["uri"] in app.env.images and not isinstance(image.parent, nodes.reference):
            _, name = app.env.images[image["uri"]]
            link = nodes.reference(
                "", "", internal=True, refuri=f"{folder}/{quote(name)}", classes=["picture"]
            )
            image.replace_self(link)
            link += image


def mark_code(doctree: nodes.document) -> None:
    """Tell printed columns from sentences, and code too long to go onto the next sheet whole."""
    for block in doctree.findall(nodes.literal_block):
        code = block.astext()
        if "output" in block["classes"]:
            if COLUMNS.search(code):
                block["classes"].append("aligned")
        elif code.count("\n") >= LONG:
            block["classes"].append("long")


def name_corners(doctree: nodes.document) -> None:
    """Put a word into the empty corner of a table, for those who hear the heads of its columns."""
    for head in doctree.findall(nodes.thead):
        for entry in head.findall(nodes.entry):
            if not entry.astext().strip():
                word = nodes.inline("", "Row", classes=["visually-hidden"])
                entry += nodes.paragraph("", "", word)


def name_parts(_app: Sphinx, _page: str, _: str, context: Any, _doctree: object) -> None:
    """Say what the arrows in the list of contents do; call a reference the item of a list."""
    named = '<summary aria-label="The pages of this part">'
    if make := context.get("generate_toctree_html"):
        context["generate_toctree_html"] = lambda *args, **options: str(
            make(*args, **options)
        ).replace("<summary>", named)
    if "body" in context:
        context["body"] = context["body"].replace('role="doc-biblioentry"', 'role="listitem"')


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("formulas", (visit_inline, None), (visit_display, None))
    app.add_js_file("formulas.js", loading_method="defer")
    app.connect("doctree-resolved", typeset, priority=900)
    app.connect("html-page-context", name_parts, priority=900)  # the theme's functions are made
    return {"parallel_read_safe": True, "parallel_write_safe": True}
