"""Answers that are alike are found, whatever was renamed; those that must be alike are not."""

from __future__ import annotations

from typing import Any

import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from nrdob_course.grading.similar import copies, pairs

GIVEN_OUT = "def encirclements(case):\n    ..."
ORIGINAL = """
def encirclements(case):
    # count what is on the right
    poles = np.sum(case.plant_poles.real > 0) + np.sum(case.model_zeros.real > 0)
    roots = np.sum(case.closed_loop_roots.real > 0)
    for factor in case.others:
        roots = roots + 2 * int(factor > 0)
    return roots - poles
"""
RENAMED = """
def encirclements(c):
    "Another text."

    open_ones = np.sum(c.plant_poles.real>0)+np.sum(c.model_zeros.real>0)
    closed = np.sum(c.closed_loop_roots.real > 0)
    for k in c.others:  # all of them
        closed = closed + 2*int(k > 0)
    return closed - open_ones
"""
OTHER = """
def encirclements(case):
    counted = {}
    while len(counted) < 3:
        counted[len(counted)] = [root for root in case.closed_loop_roots if root.imag == 7]
    if counted[0] and not counted[1]:
        raise ValueError("there is no such case")
    return sum(map(len, counted.values()), start=-4) // 2
"""
TEXT = "The colleague counts the other way round, so that a stable loop is called unstable by him"


def notebook(code: str, text: str = "", extra: str = "") -> Any:
    cells = [
        new_code_cell(code, id="answer-2-1"),
        new_markdown_cell(text, id="written-2-2"),
        new_code_cell(extra, id="own"),
    ]
    return new_notebook(cells=cells)


def found(**notebooks: Any) -> list[tuple[str, str, list[str]]]:
    listed = pairs(notebooks, notebook(GIVEN_OUT))
    return [(pair["first"], pair["second"], pair["cells"].split()) for pair in listed]


def test_new_names_and_comments_hide_nothing() -> None:
    assert found(anna=notebook(ORIGINAL), bo=notebook(RENAMED), cleo=notebook(OTHER)) == [
        ("anna", "bo", ["answer-2-1"])
    ]


def test_sentences_are_compared_too() -> None:
    both = {"anna": notebook("", TEXT + "."), "bo": notebook("", TEXT.upper() + "!")}
    assert found(**both) == [("anna", "bo", ["written-2-2"])]


def test_those_with_most_in_common_come_first() -> None:
    listed = found(
        anna=notebook(OTHER), bo=notebook(ORIGINAL, TEXT), cleo=notebook(RENAMED, TEXT),
        dan=notebook(OTHER),
    )  # fmt: skip
    assert listed[0] == ("bo", "cleo", ["answer-2-1", "written-2-2"])
    assert listed[1] == ("anna", "dan", ["answer-2-1"])


def test_what_was_given_out_is_nobodys() -> None:
    same = notebook(ORIGINAL)
    assert pairs({"anna": same, "bo": same}, notebook(ORIGINAL)) == []


def test_what_is_short_or_what_many_write_is_nobodys() -> None:
    short = notebook("def encirclements(case):\n    return 2 * case.x")
    assert found(anna=short, bo=short) == []
    assert found(**{f"s{k}": notebook(ORIGINAL) for k in range(12)}) == []


def test_code_that_does_not_parse_is_compared_as_text() -> None:
    broken = notebook(ORIGINAL + "\n)")
    assert found(anna=broken, bo=broken) == [("anna", "bo", ["answer-2-1"])]


def test_a_number_too_long_for_ten_digits_is_compared() -> None:
    long = notebook(ORIGINAL.replace("2 *", "0x" + "F" * 4000 + " *"))
    assert found(anna=long, bo=long) == [("anna", "bo", ["answer-2-1"])]


def test_a_pair_tells_how_much() -> None:
    [pair] = pairs({"a": notebook(ORIGINAL), "b": notebook(ORIGINAL)}, notebook(GIVEN_OUT))
    assert (pair["cells"], pair["share"]) == ("answer-2-1", "1")


PADDING = "\n".join(
    f"spare_{k} = [{k}, {k + 1}]\nif spare_{k}:\n    other_{k} = sum(spare_{k}) % {k + 3}"
    for k in range(8)
)


@pytest.mark.parametrize("padded", [f"{ORIGINAL}{PADDING}", f"{PADDING}\n{ORIGINAL}"])
def test_what_stands_beside_the_published_solution_does_not_hide_it(padded: str) -> None:
    solution, own = notebook(ORIGINAL), {"anna": notebook(padded), "bo": notebook(OTHER)}
    [copy] = copies(own, notebook(GIVEN_OUT), solution)
    assert (copy["first"], copy["cells"]) == ("anna", "answer-2-1")
