"""Formulas as MathML, set when the book is built: a browser shows them without a script.

MathJax reads the LaTeX, as it does in a notebook; here it runs without a page. What it writes is
meant for MathJax, and some of it says nothing to a browser: letters of another alphabet are
attributes, columns have attributes of their own, and what an operator is to its neighbours stands
in MathJax's notes. That is written as browsers read it (MathML Core).
"""

import atexit
from functools import cache, lru_cache
from unicodedata import lookup
from xml.etree import ElementTree

from py_mini_racer import JSEvalException, MiniRacer

from pages import installed, render

MACROS = {"Gm": r"\tilde{G}", "e": r"\mathrm{e}", "j": r"\mathrm{j}"}

APPLIED = "\N{FUNCTION APPLICATION}"
SIGNS, CLOSING, DOTS = set("+−±∓"), set(")]}|‖!…⋯"), set(".…⋯")
ACCENTS, PRIMES = {"^": "ˆ", "~": "˜"}, set("′″‴")
KEPT = {
    "display", "displaystyle", "linethickness", "maxsize", "minsize", "movablelimits", "stretchy",
    "width",
}  # fmt: skip
"""Attributes that mean the same to a browser."""
HEADED = {"msub", "msup", "msubsup", "munder", "munderover", "mrow"}


class TexError(ValueError):
    """LaTeX that cannot be read."""


@lru_cache(maxsize=1)
def mathjax() -> MiniRacer:
    """Load MathJax, which takes half a second, once."""
    script = installed("sphinx-mathjax-offline", "tex-svg-full.js")
    engine = MiniRacer()
    atexit.register(engine.close)  # its threads would be waited for
    engine.eval(render("mathml.js", mathjax=script.read_text("utf-8"), macros=MACROS))
    return engine


@cache
def mathml(latex: str, display: bool = False) -> str:
    """Set a formula.

    >>> print(mathml(r"\\Gm"))
    <math alttext="\\Gm"><mover accent="true"><mi>G</mi><mo stretchy="false">˜</mo></mover></math>
    """
    if display and r"\\" in latex and not latex.startswith(r"\begin"):
        latex = rf"\begin{{split}}{latex}\end{{split}}"
    try:
        written = mathjax().call("read", latex, display)
    except JSEvalException as error:
        raise TexError(str(error).splitlines()[0].partition("Error: ")[2]) from None
    tree = ElementTree.fromstring(
        str(written).replace(' xmlns="http://www.w3.org/1998/Math/MathML"', "")
    )
    said = plain(tree)
    said.set("alttext", " ".join(latex.split()))
    return ElementTree.tostring(said, encoding="unicode")


def plain(element: ElementTree.Element) -> ElementTree.Element:
    """Write an element, and what is in it, as a browser reads it."""
    parts = [plain(each) for each in element]
    role = element.get("data-mjx-texclass", "")
    if element.tag in {"mrow", "mstyle"} and len(parts) == 1:
        only = parts[0]
        if element.tag == "mrow" or only.tag == "mspace":
            return as_operator(only, role) if only.tag == "mo" else only
    kept = {name: value for name, value in element.items() if name in KEPT}
    new = ElementTree.Element(element.tag, kept)
    new.text = (element.text or "").strip() if len(element) == 0 else None
    new.extend(parts)
    if element.tag == "mi":
        in_alphabet(new, element.get("mathvariant", ""))
    elif element.tag == "mo":
        as_operator(new, role)
    elif element.tag == "mtext":
        new.text = element.text
    elif element.tag == "mover":
        new.set("accent", "true")
        parts[1].text = ACCENTS.get(parts[1].text or "", parts[1].text)
    elif element.tag == "msup" and set(parts[1].text or " ") <= PRIMES:
        # At its own size a prime is raised already.
        new.tag, parts[1].attrib = "mrow", {"lspace": "0", "rspace": "0"}
    elif element.tag in {"msup", "msub", "msubsup"} and parts[0].tag == "mover":
        # As in TeX, an index stands as high as beside the letter without its accent.
        new[0] = ElementTree.Element("mpadded", height="0.7em")
        new[0].append(parts[0])
    elif element.tag == "mtable":
        in_columns(new, element)
    if element.tag in {"math", "mrow", "mstyle", "mtd", "msqrt"}:
        space(new)
    return new


def in_alphabet(letter: ElementTree.Element, variant: str) -> None:
    """Write letters of another alphabet as what they are in Unicode."""
    if variant == "normal":
        letter.set("mathvariant", variant)
    elif variant:
        letter.text = "".join(sign(each, variant.upper()) for each in letter.text or "")


def sign(letter: str, alphabet: str) -> str:
    """Give a letter of another alphabet; some script capitals have an older name."""
    name = f"{alphabet} {'SMALL' if letter.islower() else 'CAPITAL'} {letter.upper()}"
    try:
        return lookup(f"MATHEMATICAL {name}")
    except KeyError:
        return lookup(name)


def as_operator(operator: ElementTree.Element, role: str) -> ElementTree.Element:
    """Say where an operator stands, from which its distances follow."""
    if role in {"OPEN", "CLOSE"}:
        operator.set("form", "prefix" if role == "OPEN" else "postfix")
    elif role == "ORD" or is_name(operator) or operator.text in DOTS:
        operator.attrib |= {"lspace": "0", "rspace": "0"}
    return operator


def in_columns(table: ElementTree.Element, described: ElementTree.Element) -> None:
    """Align the columns of a table, and keep them apart."""
    gaps = described.get("columnspacing", "1em").split()
    sides = described.get("columnalign", "center").split()
    for row in table:
        last = len(row) - 1
        for k, cell in enumerate(row):
            side = sides[min(k, len(sides) - 1)]
            gap = "0" if k == last else gaps[min(k, len(gaps) - 1)]
            cell.set("style", f"text-align: {side}; padding-inline: 0 {gap}")


def space(row: ElementTree.Element) -> None:
    """Keep names of functions apart from their neighbours, and a sign close to its number."""
    found: list[ElementTree.Element] = []
    for each in row:
        if each.get("width", "").startswith("-"):
            continue  # a browser has no room that can be taken back
        last = head(found[-1]) if found else None
        if last is not None:
            ended = last.tag not in {"mo", "mspace"} or last.text in CLOSING
            if each.text in SIGNS and last.tag == "mo" and not ended:
                each.set("form", "prefix")
            named = is_name(last) or last.text == APPLIED
            follows = head(each).tag not in {"mo", "mspace"}
            if (named and follows) or (is_name(head(each)) and ended):
                found.append(ElementTree.Element("mspace", width="0.167em"))
        found.append(each)
    row[:] = found


def head(element: ElementTree.Element) -> ElementTree.Element:
    """Give what an element begins with, its indices and limits set aside."""
    while len(element) and element.tag in HEADED:
        element = element[0]
    return element


def is_name(element: ElementTree.Element) -> bool:
    """Say whether this is the name of a function, such as sin or max."""
    text = element.text or ""
    is_word = len(text) > 1 and text.isalpha()
    return is_word and element.tag in {"mi", "mo"} and "mathvariant" not in element.attrib
