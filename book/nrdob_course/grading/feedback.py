"""Make a page of feedback that needs nothing but itself, and does nothing but be read.

What students wrote, and what their code put out, passes a list of the tags and attributes that are
allowed (nh3): no scripts, no styles, nothing that is loaded or that answers to the mouse. Pictures
stay that lie in the page itself. Formulas become MathML, which browsers draw without help; one that
cannot be converted is shown as it was written.
"""

import re
import tomllib
from html import escape
from importlib.resources import files
from typing import Any

import nh3
from bs4 import BeautifulSoup
from docutils.utils.math.latex2mathml import tex2mathml

__all__ = ["NOWHERE", "offline", "with_note"]

VERBATIM = {"pre", "code"}
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


ALLOWED = tomllib.loads(files(__package__).joinpath("feedback.toml").read_text("utf-8"))
TAGS, MATH = set(ALLOWED["tags"]), set(ALLOWED["mathml"])
ATTRIBUTES = {tag: set(names) for tag, names in ALLOWED["attributes"].items()}
PICTURE = re.compile(r"data:image/(png|jpeg|gif|webp);base64,[A-Za-z0-9+/=\s]*")
PLACE = re.compile(r"#|https?://", re.IGNORECASE)
NOWHERE = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
"""What a browser is told: even if something got through, it can load nothing and run nothing."""

NARROW = """
img { max-width: 100%; height: auto; }
pre, .output_subarea, .rendered_html { max-width: 100%; overflow-x: auto; }
div.input, div.output_area { display: block; }
div.inner_cell, div.prompt { min-width: 0; }
"""
"""What the template lacks for a phone: what is wide scrolls by itself, and the page does not."""


def offline(page: str) -> str:
    """Convert a page of nbgrader's feedback, or a piece of one."""
    head, found, body = page.partition("</head>")
    if not found:
        return _body(page)
    # The head is the template's, and comes before anything of a student's.
    styles = "".join(map(str, BeautifulSoup(head, "html.parser").find_all("style")))
    title = BeautifulSoup(head, "html.parser").title
    return (
        f'<!DOCTYPE html>\n<html><head><meta charset="utf-8"/>'
        f'<meta name="viewport" content="width=device-width"/>'
        f'<meta http-equiv="Content-Security-Policy" content="{NOWHERE}"/>'
        f"{title or ''}{styles}<style>{NARROW}</style></head><body>{_body(body)}</body></html>\n"
    )


NOTE = re.compile(r"(<body>)(?:<!--note-->.*?<!--/note-->)?", re.DOTALL)
"""Where a note stands. Comments are the teacher's: `offline` leaves none of a student's."""


def with_note(page: str, note: str) -> str:
    """Put a note on top of a page, in the place of an earlier one; none if it is empty.

    >>> with_note("<body>text</body>", "late")
    '<body><!--note--><p><strong>late</strong></p><!--/note-->text</body>'
    >>> with_note(with_note("<body>text</body>", "late"), "")
    '<body>text</body>'
    """
    told = f"<!--note--><p><strong>{escape(note)}</strong></p><!--/note-->" if note else ""
    return NOTE.sub(lambda found: found[1] + told, page, count=1)


def _body(text: str) -> str:
    """Clean what a page shows, and convert its formulas."""
    soup = BeautifulSoup(text, "html.parser")
    for tag in soup.find_all("img", src=re.compile(r"^\s*(https?:)?//", re.IGNORECASE)):
        tag.replace_with(f"[{tag['src']}]")
    clean = nh3.clean(
        str(soup),
        tags=TAGS,
        clean_content_tags={"script", "style"},
        attributes=ATTRIBUTES,
        attribute_filter=_kept,
        url_schemes={"http", "https", "data"},
    )
    soup = BeautifulSoup(clean, "html.parser")
    for formula in soup.find_all(string=FORMULA):
        if not any(parent.name in VERBATIM for parent in formula.parents):
            _convert(formula)
    return str(soup)


def _kept(tag: str, attribute: str, value: str) -> str | None:
    """Keep an attribute, unless it leads to what may not be loaded."""
    allowed = {"src": PICTURE.fullmatch, "href": PLACE.match}.get(attribute)
    return value if allowed is None or allowed(value) else None


def _convert(text: Any) -> None:
    pieces: list[Any] = []
    end = 0
    for match in FORMULA.finditer(str(text)):
        pieces += [str(text)[end : match.start()], mathml(match)]
        end = match.end()
    text.replace_with(*pieces, str(text)[end:])


def mathml(match: re.Match[str]) -> Any:
    """Convert one formula; the formula itself, as code, where that is not possible."""
    inline = match["inline"] or match["round"]
    tex = inline or match["dollars"] or match["brackets"] or match["environment"]
    try:
        converted = tex2mathml(_known(tex), as_block=not inline)
        found = BeautifulSoup(converted, "html.parser").find("math")
        if found is None or {tag.name for tag in found.find_all(True)} - MATH:
            raise ValueError("no formula")
        return found
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
