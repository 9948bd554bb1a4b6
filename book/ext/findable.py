"""What the search of the site knows of the pages, beyond Sphinx's own index of words.

For each page its kind, and for each section its anchor, title and text as a reader reads it, with
formulas in plain letters; and for each word of the glossary the chapter that introduces it. All of
it lies in one script, ``_static/texts.js``, since a page opened from a disk may load no other page.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

TEXTS = "texts.js"
LONGEST = {"chapter": 540, "page": 400, "names": 120, "teaching": 250}
"""Letters kept of a section, by the kind of its page."""

UNREAD = (nodes.comment, nodes.raw, nodes.image, nodes.target, addnodes.index, addnodes.toctree,
          nodes.literal_block, nodes.figure)  # fmt: skip
BLOCKS = (nodes.paragraph, nodes.math_block, nodes.term, nodes.caption, nodes.rubric)

LETTERS = {
    "alpha": "α", "beta": "β", "gamma": "γ", "Gamma": "Γ", "delta": "δ", "Delta": "Δ",
    "varepsilon": "ε", "epsilon": "ε", "eta": "η", "theta": "θ", "lambda": "λ", "Lambda": "Λ",
    "mu": "μ", "nu": "ν", "pi": "π", "rho": "ρ", "varrho": "ϱ", "sigma": "σ", "tau": "τ",
    "varphi": "φ", "phi": "φ", "omega": "ω", "Omega": "Ω", "infty": "∞", "le": "≤", "ge": "≥",
    "leq": "≤", "geq": "≥", "ne": "≠", "approx": "≈", "cdot": "·", "times": "×", "pm": "±",
    "to": "→", "int": "∫", "sum": "Σ", "in": "∈", "Gm": "G̃", "sim": "∼", "ll": "≪", "gg": "≫",
    "Rightarrow": "⇒", "iff": "⇔", "quad": " ", "qquad": " ", "e": "e", "j": "j", "angle": "∠",
    "lvert": "|", "rvert": "|", "vert": "|", "lVert": "‖", "rVert": "‖", "ln": "ln ",
    "dots": "…", "ldots": "…", "cdots": "…", "circ": "°", "max": "max ", "min": "min ",
    "prime": "′",
}  # fmt: skip
LETTERS |= {
    name: f"{name} "
    for name in ("sin", "cos", "tan", "arcsin", "arctan", "arg", "exp", "log", "sup")
}
ACCENTS = {"tilde": "\u0303", "hat": "\u0302", "dot": "\u0307", "bar": "\u0304"}
SUPERSCRIPTS = str.maketrans("0123456789+-n", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ")


def plain(latex: str) -> str:
    """Write a formula in one line of plain letters, near enough to be recognised."""
    text = re.sub(r"\\tag\{\d+\}|\\(?:begin|end)\{\w+\*?\}(?:\{[lcr]+\})?|&", " ", latex)
    text = text.replace(r"\\", "; ").replace(r"^\circ", "°")
    text = re.sub(
        rf"\\(?:wide)?({'|'.join(ACCENTS)})(?![a-z])\s*\{{?\s*(?:\\([A-Za-z]+)|([A-Za-z]))\s*\}}?",
        lambda found: (found[3] or LETTERS.get(found[2], "")) + ACCENTS[found[1]],
        text,
    )
    text = re.sub(r"\\(?:mathrm|mathcal|mathbf|operatorname|text)\s*\{?([^{}]*)\}?", r"\1", text)
    part = r"\s*(?:\{([^{}]*)\}|(\\[A-Za-z]+|\w))"
    for _ in range(4):  # fractions stand in fractions
        text = re.sub(rf"\\[dt]?frac{part}{part}", fraction, text)
        text = re.sub(r"\\sqrt\s*\{([^{}]*)\}", r"√(\1)", text)
        text = re.sub(r"_\{([^{}]*)\}", r"_\1", text)
        text = re.sub(r"\^(?:\{([^{}]*)\}|(\w))", power, text)
    text = re.sub(r"\\([A-Za-z]+)", lambda found: LETTERS.get(found[1], ""), text)
    return " ".join(re.sub(r"\\[,;:!|]?|[{}~$]", " ", text).split())


def fraction(found: re.Match[str]) -> str:
    """Write a fraction in one line, with the brackets it needs."""
    above, below = found[1] or found[2] or "", found[3] or found[4] or ""

    def held(part: str) -> str:
        return part if re.fullmatch(r"[\w\\ \u0303]+", part) else f"({part})"

    return f"{held(above)}/{held(below)}"


def power(found: re.Match[str]) -> str:
    """Write a short exponent above the line, another one behind a caret."""
    exponent = found[1] or found[2] or ""
    raised = exponent.translate(SUPERSCRIPTS)
    return raised if re.fullmatch(r"[⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ]+", raised) else f"^({exponent})"


def read_aloud(node: nodes.Node) -> str:
    """Give the text of a node, formulas in plain letters, without what no one reads."""
    if isinstance(node, nodes.Text):
        return str(node.astext())
    if isinstance(node, UNREAD):
        return ""
    if isinstance(node, addnodes.pending_xref) and node.get("refdomain") == "cite":
        return ", ".join(map(cited, node["reftarget"].split(",")))
    if isinstance(node, (nodes.math, nodes.math_block)):
        return plain(node.astext())
    return "".join(read_aloud(child) for child in node.children)


def cited(key: str) -> str:
    """Write the key of a reference as author and year."""
    found = re.match(r"\s*([a-z]+)(\d{4})", key)
    return f"{found[1].title()} ({found[2]})" if found else key


def texts_of(section: nodes.Element) -> str:
    """Give the prose of a section, without that of the sections in it."""
    blocks = (
        block
        for child in section.children
        if not isinstance(child, (nodes.section, nodes.title))
        for block in ([child] if isinstance(child, BLOCKS) else child.findall(is_block))
    )
    return " ".join(" ".join(map(read_aloud, blocks)).split())


def is_block(node: nodes.Node) -> bool:
    """Tell a piece of text from what holds pieces."""
    parent = node.parent
    while parent is not None and not isinstance(parent, nodes.section):
        if isinstance(parent, UNREAD):
            return False
        parent = parent.parent
    return isinstance(node, BLOCKS)


def kind_of(page: str) -> str:
    """Tell what sort of page it is: a chapter, for teachers, the names, or another."""
    folder = page.partition("/")[0]
    if folder in ("chapters", "teaching"):
        return folder.removesuffix("s")
    return "names" if folder == "api" else "page"


def entry(page: str, tree: nodes.document) -> dict[str, Any]:
    """Give what the search knows of one page."""
    sections = list(tree.findall(nodes.section))
    kind = kind_of(page)
    return {
        "kind": kind,
        "title": read_aloud(sections[0][0]) if sections else page,
        "sections": [
            [section["ids"][0], read_aloud(section[0]), cut(texts_of(section), LONGEST[kind])]
            for section in sections
        ],
    }


def cut(text: str, most: int) -> str:
    """Keep the beginning of a text, up to a word."""
    return text if len(text) <= most else text[:most].rpartition(" ")[0] + " …"


def led_by_glossary(tree: nodes.document) -> dict[str, str]:
    """Give for each word of the glossary the chapter that its definition leads to."""
    found = {}
    for item in tree.findall(nodes.definition_list_item):
        targets = [str(node["reftarget"]) for node in item.findall(addnodes.pending_xref)]
        if links := [target for target in targets if target.startswith("chapters/")]:
            for term in item.findall(nodes.term):
                found[read_aloud(term).lower()] = links[-1]
    return found


def write_texts(app: Sphinx, failed: Exception | None) -> None:
    """Write the script beside the pages."""
    if failed or app.builder.name != "html":
        return
    trees = {page: app.env.get_doctree(page) for page in sorted(app.env.found_docs)}
    known = {
        "pages": {page: entry(page, tree) for page, tree in trees.items()},
        "terms": led_by_glossary(trees["glossary"]) if "glossary" in trees else {},
    }
    text = json.dumps(known, ensure_ascii=False, separators=(",", ":"))
    (Path(app.outdir) / "_static" / TEXTS).write_text(f"window.TEXTS = {text};\n", "utf-8")


def add_scripts(
    app: Sphinx, page: str, _template: str, _context: dict[str, Any], _doctree: object
) -> None:
    """Load on the page of the search what it needs."""
    if page == "search":
        app.add_js_file(TEXTS)
        app.add_js_file("search.js", loading_method="defer")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", add_scripts)
    app.connect("build-finished", write_texts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
