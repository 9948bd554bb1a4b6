"""Who wants points without an answer: each attack in a notebook, to be graded for real."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import nbformat

from attacks import FORGERIES, LATER
from handin import CHECKED, Notebook, answer_cell, cell_of, right

GROUP = 13
"""Of nobody else, who would be remarked; and its own cases are printed unlike all hidden ones."""


def answered(released: Path) -> Notebook:
    """Everything as published, for a group of their own."""
    notebook = right(released, "").notebook
    cell_of(notebook, "group").source = f"GROUP = {GROUP}"
    return notebook


def forging(released: Path) -> Iterator[tuple[Notebook, dict[str, str]]]:
    """Spread the attacks over notebooks; the names of what each of them tries, by problem."""
    names = list(FORGERIES)
    for start in range(0, len(names), len(CHECKED)):
        notebook = answered(released)
        tried = {}
        for this, name in zip(CHECKED, names[start:], strict=False):
            cell = cell_of(notebook, answer_cell(this))
            cell.source = FORGERIES[name].format(answer=this.answer)
            if this.problem.own:
                cell.source += f"\n{this.answer} = {this.answer}(None)"
            tried[this.id] = name
        notebook.cells.append(nbformat.v4.new_code_cell(LATER, id="own-later"))
        yield notebook, tried


KEEPS, *OTHERS = sorted(CHECKED, key=lambda each: each.problem.own)
CARRIED = (
    "return ' '.join(KEPT)",  # a wrong result
    "raise ValueError(' '.join(KEPT))",
    "raise type('kept', (BaseException,), {})(' '.join(KEPT))",  # no call takes it for an error
    "return {'in no form': KEPT}",
)
"""How the answer to one problem would show the cases of an earlier one."""

UNREAD = """
from nrdob_course import encoding
encode = encoding.encode
encoding.encode = lambda it: {" ".join(KEPT): []} if it == {"in no form": KEPT} else encode(it)
"""


SHOWS = {
    "own-shows": """print('cases kept:', len(KEPT))
if len(KEPT) > 1:
    print("x" * 400_000)  # so much is remarked
    get_ipython().execution_count = 987654000 + 321
""",
    "own-counted": "len(KEPT)",
}
"""Cells after all others that would show what was kept: what they print, and their numbers."""

KEEPING = {"keeper": CARRIED, "keeper2": CARRIED[::-1]}


def keeping(released: Path, ways: Sequence[str]) -> Notebook:
    """One answer is right, and keeps the cases that it sees; the others would show them."""
    notebook = answered(released)
    cell_of(notebook, answer_cell(KEEPS)).source += f"""
KEPT, plain_answer = [], {KEEPS.answer}
def {KEEPS.answer}(case):
    KEPT.append("kept: " + repr(case))
    return plain_answer(case)
{UNREAD}
"""
    for this, way in zip(OTHERS, ways, strict=False):
        told = f"{this.answer} = KEPT" if this.problem.own else ""
        source = told or f"def {this.answer}(case):\n    {way}"
        cell_of(notebook, answer_cell(this)).source = source
    for name, source in SHOWS.items():
        notebook.cells.append(nbformat.v4.new_code_cell(source, id=name))
    return notebook
