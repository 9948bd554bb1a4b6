"""The page that a student gets back: it can be read, and does nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from bs4 import BeautifulSoup
from nbconvert.filters import markdown2html

from nrdob.course.grading.autograde import keep_points
from nrdob.course.grading.feedback import offline
from problemsets import SETS, cells


@pytest.mark.parametrize(
    ("tex", "shown"),
    [
        ("$x^2$", "<msup>"),
        ("$$x$$", 'display="block"'),
        (r"\(x\) and \[y\]", "<mi>y</mi>"),
        (r"\begin{align} a &= b \\ c &= d \end{align}", "<mtable"),
        (r"\begin{equation} a = b \end{equation}", 'display="block"'),
        (r"$a, \dots, b$", "…"),
        (r"$\dfrac12$", "<mfrac"),
        (r"$\frac1\pi$", "<mfrac>"),
        (r"$\tfrac 1{ab}$", "<mfrac"),
        (r"$\nonsense{x}$", r"<code>$\nonsense{x}$</code>"),
        ("it costs $5 and $6", "it costs $5 and $6"),
        (r"a price of \$5 and $x$", r"\$5 and <math"),
        ("<pre>echo $HOME $PATH</pre>", "<pre>echo $HOME $PATH</pre>"),
        ("<code>$x$</code>", "<code>$x$</code>"),
    ],
)
def test_formulas_become_mathml(tex: str, shown: str) -> None:
    assert shown in offline(f"<p>{tex}</p>")


@pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
def test_every_formula_of_a_set_becomes_mathml(path: Path) -> None:
    for cell in cells(path):
        if cell.cell_type == "markdown":
            page = BeautifulSoup(offline(markdown2html(cell.source)), "html.parser")
            assert "$" not in page.get_text(), cell.id


def test_what_would_be_loaded_is_taken_out() -> None:
    page = offline(
        '<script src="https://a/b.js"></script><link href="//a/b.css"><iframe src="x"></iframe>'
        '<img src="https://a/b.png"><img src="data:image/png;base64,">'
    )
    assert page == '[https://a/b.png]<img src="data:image/png;base64,"/>'


def output(kind: str, text: str = "") -> Any:
    if kind == "stream":
        return nbformat.v4.new_output("stream", name="stderr", text=text)
    if kind == "error":
        return nbformat.v4.new_output("error", ename="E", evalue="", traceback=[])
    return nbformat.v4.new_output(kind, data={"text/plain": text})


@pytest.mark.parametrize(
    ("outputs", "kept"),
    [
        ([output("execute_result", "2.5")], ["2.5"]),
        # A warning costs no points, and no result before the last is taken for them.
        ([output("stream", "careful"), output("execute_result", "2.5")], ["2.5"]),
        ([output("execute_result", "Right."), output("execute_result", "2.5")], ["2.5"]),
        ([output("execute_result", "Right.")], ["Right.", "NoPoints"]),
        ([output("execute_result", "1000")], ["1000", "NoPoints"]),
        ([output("execute_result", "nan")], ["nan", "NoPoints"]),
        ([], ["NoPoints"]),
        ([output("error"), output("execute_result", "4")], ["E", "4"]),
    ],
)
def test_a_test_cell_gives_its_points_or_none(outputs: list[Any], kept: list[str]) -> None:
    cell = nbformat.v4.new_code_cell("", outputs=outputs)
    cell.metadata.nbgrader = {"points": 4}
    keep_points(cell)
    found = [out.get("ename") or out.data["text/plain"] for out in cell.outputs]
    assert found == kept
