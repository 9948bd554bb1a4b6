"""Formulas as a browser reads them: what the LaTeX means is in elements that browsers know."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from mathml import KEPT, TexError, mathml

KNOWN = {"accent", "alttext", "form", "lspace", "mathvariant", "rspace", "style"} | KEPT


def tree(latex: str, display: bool = False) -> ElementTree.Element:
    return ElementTree.fromstring(mathml(latex, display))


def letters(element: ElementTree.Element) -> str:
    return "".join(element.itertext())


@pytest.mark.parametrize(
    ("latex", "said"),
    [
        (r"\frac12", "12"),
        (r"\mathbf{Ax}", "𝐀𝐱"),
        (r"\mathsf{ET}", "𝖤𝖳"),
        (r"\mathcal{NF}", "𝒩ℱ"),
        (r"\Gm", "G˜"),
        (r"a\text{ in }b", "a\N{NO-BREAK SPACE}in\N{NO-BREAK SPACE}b"),
        (r"\e^{-\theta s}", "e−θs"),
    ],
)
def test_letters_are_those_of_their_alphabet(latex: str, said: str) -> None:
    assert letters(tree(latex)) == said


def test_a_fraction_of_two_digits_is_one() -> None:
    (fraction,) = tree(r"\frac12")
    assert fraction.tag == "mfrac" and [part.text for part in fraction] == ["1", "2"]


@pytest.mark.parametrize(
    ("latex", "sign"),
    [
        ("a=-1", True),
        ("(-1)", True),
        ("a,-1", True),
        ("-1", False),
        ("a-1", False),
        ("|a|-1", False),
    ],
)
def test_a_sign_stands_close_to_its_number(latex: str, sign: bool) -> None:
    """At the beginning of a row a browser knows it by itself."""
    minus = next(each for each in tree(latex).iter("mo") if each.text == "−")
    assert (minus.get("form") == "prefix") == sign


@pytest.mark.parametrize(
    ("latex", "gaps"),
    [(r"\sin x", 1), (r"2\sin x", 2), (r"\sin(x)", 0), (r"\max_\omega x", 1), (r"x\sin^2 x", 2)],
)
def test_a_name_of_a_function_stands_apart(latex: str, gaps: int) -> None:
    assert len(list(tree(latex).iter("mspace"))) == gaps


def test_columns_are_aligned_without_attributes_of_old() -> None:
    (table,) = tree(r"\begin{aligned}a&=b\\c&=d\end{aligned}", display=True)
    assert [cell.get("style", "").split(";")[0] for cell in table[0]] == [
        "text-align: right", "text-align: left",
    ]  # fmt: skip


@pytest.mark.parametrize(
    "latex",
    [r"\bigl(\tfrac12\bigr)", r"\lVert x\rVert_\infty^2", r"\left.\binom nk\right|_0", "a'"],
)
def test_every_attribute_means_something_to_a_browser(latex: str) -> None:
    math = tree(latex, display=True)
    assert {name for each in math.iter() for name in each.attrib} <= KNOWN
    assert math.get("display") == "block"


@pytest.mark.parametrize(
    ("latex", "said"), [(r"\frac{1", "Missing close brace"), (r"\nosuch", "Undefined control")]
)
def test_what_cannot_be_read_is_said(latex: str, said: str) -> None:
    with pytest.raises(TexError, match=said):
        mathml(latex)
