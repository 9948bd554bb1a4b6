"""Make a page of feedback that needs nothing but itself: no scripts, no network.

Formulas become MathML, which browsers draw without help. What would be loaded from elsewhere is
taken out. A formula that cannot be converted is shown as it was written.
"""

from __future__ import annotations

import re
from typing import Any

from bs4 import BeautifulSoup
from docutils.utils.math.latex2mathml import tex2mathml

__all__ = ["offline"]

LOADED = {"script": "src", "link": "href", "iframe": "src", "embed": "src", "object": "data"}
VERBATIM = {"pre", "code", "style", "textarea", "title"}
TOKEN = r"[^{}\s\\]|\\[A-Za-z]+"
FORMULA = re.compile(
    r"""
      \$\$ (?P<dollars>.+?) \$\$
    | \\\[ (?P<brackets>.+?) \\\]
    | \\\( (?P<round>.+?) \\\)
    | (?P<environment> \\begin\{(?P<name>equation|align|gather)\*?\} .+? \\end\{(?P=name)\*?\} )
    | (?<![\\$\w]) \$ (?P<inline> (?!\s) (?: [^$\\] | \\. )+? ) (?<!\s) \$ (?![\d$])
    """,
    re.VERBOSE | re.DOTALL,
)


def offline(page: str) -> str:
    """Convert a page of nbgrader's feedback."""
    soup = BeautifulSoup(page, "html.parser")
    for name in LOADED:
        for tag in soup.find_all(name):
            tag.decompose()
    for tag in soup.find_all(src=re.compile(r"^\s*(https?:)?//", re.IGNORECASE)):
        tag.replace_with(f"[{tag['src']}]")
    for text in soup.find_all(string=FORMULA):
        if not any(parent.name in VERBATIM for parent in text.parents):
            _convert(text)
    return str(soup)


def _convert(text: Any) -> None:
    """Replace the formulas of one piece of text."""
    pieces: list[Any] = []
    end = 0
    for match in FORMULA.finditer(str(text)):
        pieces += [str(text)[end : match.start()], mathml(match)]
        end = match.end()
    pieces.append(str(text)[end:])
    text.replace_with(*pieces)


def mathml(match: re.Match[str]) -> Any:
    """Convert one formula; the formula itself, as code, where that is not possible."""
    inline = match["inline"] or match["round"]
    tex = inline or match["dollars"] or match["brackets"] or match["environment"]
    try:
        converted = tex2mathml(_known(tex), as_block=not inline)
        return BeautifulSoup(converted, "html.parser").find("math")
    except Exception:  # whatever a student writes
        code = BeautifulSoup("<code></code>", "html.parser").code
        assert code is not None
        code.string = match.group()
        return code


def _known(tex: str) -> str:
    """Write a formula in the words that the converter knows."""
    tex = re.sub(r"\\(begin|end)\{(equation|gather)\*?\}", "", tex)
    tex = re.sub(r"\\(begin|end)\{align\*?\}", r"\\\1{aligned}", tex)
    # A fraction of single tokens needs no braces in TeX; here it does.
    tex = re.sub(rf"\\([dt]?frac)\s*({TOKEN})\s*({TOKEN})", r"\\\1{\2}{\3}", tex)
    tex = re.sub(rf"\\([dt]?frac)\s*({TOKEN})\s*{{", r"\\\1{\2}{", tex)
    tex = re.sub(r"\\dots(?![A-Za-z])", r"\\ldots", tex.strip())
    return re.sub(r"(?<=.)\\displaystyle(?![A-Za-z])", "", tex)
