"""The rules that every notebook keeps: run in order, figures in words, numbers from the code.

Whether the stored outputs are still what the code gives is not asked here but by nbval, which
runs the notebooks (``make notebooks``).
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import nbformat
import pytest
from bs4 import BeautifulSoup

from predictions import KEY

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
CLASS = sorted((FOLDER / "class").glob("*.ipynb"))
OPENING = ("**You will be able to**", "**You need**", "**Time**")
LONGEST_MEDIAN, LONGEST = 8, 22

each_chapter = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
each_notebook = pytest.mark.parametrize("path", NOTEBOOKS + CLASS, ids=lambda path: path.stem)


def cells(path: Path, kind: str) -> list[Any]:
    """Give the cells of one kind, "code" or "markdown"; code cells that hold nothing left out."""
    found = [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == kind]
    return [cell for cell in found if kind != "code" or cell.source.strip()]


def code_outputs(path: Path) -> Iterator[tuple[Any, Any]]:
    for cell in cells(path, "code"):
        for output in cell.outputs:
            yield cell, output


def short(cell: Any) -> str:
    """Name a cell in a message by its first line."""
    return f"cell {cell.id!r} ({cell.source.strip().splitlines()[0]})"


# --- numbers in prose -------------------------------------------------------------------------

# A minus sign belongs to the number unless something to subtract from stands before it.
SIGN = r"(?:(?<![\w)\]}.,])-)?"
DECIMAL = re.compile(rf"(?<![\w.]){SIGN}\d+\.\d+")
SPACE = r"(?:\s|\\[,;:! ]|~|&nbsp;)*"
UNIT = (
    r"(?:°|\^\{?\\circ|\\deg\b|\\?%|"
    r"(?:\\(?:text|mathrm|operatorname)\{\s*(?:\\,)?)?(?:dB|rad/s|ms|s)(?![\w/]))"
)
INTEGER_WITH_UNIT = re.compile(rf"(?<![\w.]){SIGN}\d+(?={SPACE}{UNIT})")
# Where a number is part of an address, a DOI or a name, not a statement.
NOT_PROSE = re.compile(
    r"\bTheorems? \d+\.\d+(?:(?:,| and| to) \d+\.\d+)*|\]\([^)]*\)|<https?:[^>]*>|"
    r"https?://\S+|\bdoi:\S+|\{[a-z:]+\}`[^`]*`"
)


def plain_minus(text: str) -> str:
    """Write every minus sign, and the hyphen that looks like one, as ASCII '-'."""
    return re.sub("[\N{MINUS SIGN}\N{EN DASH}\N{NON-BREAKING HYPHEN}]", "-", text)


def numbers_in_prose(text: str) -> list[str]:
    """Find the numbers that must come from code: decimals, and integers with a unit."""
    text = plain_minus(NOT_PROSE.sub(" ", text))
    text = re.sub(r"(?<=\d)\{,\}(?=\d)", "", text)
    found = [*DECIMAL.finditer(text), *INTEGER_WITH_UNIT.finditer(text)]
    return [unsigned_if_factor(match, text) for match in found]


def unsigned_if_factor(match: re.Match[str], text: str) -> str:
    """Drop the minus of a factor, as in -0.01s or e^{-0.05 s}: it belongs to the formula."""
    number = match.group()
    factor = re.match(r"[A-Za-z(]", text[match.end() :]) or text[: match.start()].endswith("^{")
    return number.removeprefix("-") if factor else number


def appears(number: str, text: str) -> bool:
    """Look for the same digits, with the same sign if there is one, and no digit more."""
    return re.search(rf"(?<![\d.]){re.escape(number)}(?!\d|\.\d)", text) is not None


def text_of(output: Any) -> str:
    """Give what an output says in text: printed, plain or in HTML."""
    if output.output_type == "stream":
        return str(output.text)
    data = output.get("data", {})
    html = BeautifulSoup(data.get("text/html", ""), "html.parser").get_text(" ")
    return "\n".join([data.get("text/plain", ""), html])


def text_from_code(path: Path) -> str:
    sources = [cell.source for cell in cells(path, "code")]
    outputs = [text_of(output) for _, output in code_outputs(path)]
    return plain_minus("\n".join(sources + outputs))


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("closest at 46.8 rad/s", ["46.8"]),
        ("a root at −1.053 or at -1.053", ["-1.053", "-1.053"]),
        (r"$\lambda = 0.025$, so $1 - 0.01s$", ["0.025", "0.01"]),
        ("between 0.0109–0.2686", ["0.0109", "0.2686"]),
        (r"$H = -0.01s$, $e^{-0.05 s}$, $s = -0.5 + 0.806j$", ["0.01", "0.05", "-0.5", "0.806"]),
        (r"$P_M = 54^\circ$ and $G_M = -14\,\text{dB}$", ["54", "-14"]),
        ("14 dB, 65°, 20 %, 50%, 5 s, 30 ms, 3 rad/s", ["14", "65", "20", "50", "5", "30", "3"]),
        (r"$60^{\circ}$ and 20 \%", ["60", "20"]),
        ("three loops, 4 examples, 2 seconds, Lemma 1", []),
        ("Theorems 17.1 and 17.2 hold, and Theorem 11.3 for 0.5 s", ["0.5"]),
        ("see [the paper](https://doi.org/10.1080/1.2) and {numref}`fig-1.5`", []),
        ("Theorem 17.1, and Theorems 19.5 and 19.6 for 0.5 s", ["0.5"]),
    ],
)
def test_numbers_in_prose_are_found(text: str, numbers: list[str]) -> None:
    assert numbers_in_prose(text) == numbers


@pytest.mark.parametrize(
    ("number", "text", "there"),
    [
        ("0.05", "delay = 0.05", True),
        ("0.05", "delay = 0.051", False),
        ("0.05", "delay = 10.05", False),
        ("14.0", "-14.0 dB", True),
        ("-14.0", "14.0 dB", False),
        ("54", "54.0", False),
        ("54", "pm == 54", True),
    ],
)
def test_a_number_appears_with_the_same_digits(number: str, text: str, there: bool) -> None:
    assert appears(number, text) is there


@pytest.mark.slow
@each_notebook
def test_numbers_in_prose_come_from_code(path: Path) -> None:
    computed = text_from_code(path)
    missing = [
        f"{number}  in {short(cell)}"
        for cell in cells(path, "markdown")
        if KEY not in cell.metadata  # a question for class: its own notebook holds the code
        for number in numbers_in_prose(cell.source)
        if not appears(number, computed)
    ]
    assert not missing, (
        f"{path.name}: these numbers stand in the text, but no code cell holds or shows the same "
        "digits:\n  " + "\n  ".join(missing)
    )


# --- formulas ---------------------------------------------------------------------------------

# The commands of TeX that the chapters use. A letter that stands against a command, as in
# \frach for \frac h, makes a new one, which no browser can draw.
COMMANDS = frozenset(
    re.findall(
        r"\w+",
        """Big Delta Gamma Lambda Omega Phi Psi Rightarrow Sigma Theta alpha approx arccos arcsin
        arctan arg bar begin beta big bigl bigr binom cdot chi cos cot ddot deg delta dfrac
        displaystyle dot dots ell end epsilon equiv eta frac gamma ge gg hat in infty int kappa
        lVert lambda ldots le left lim ll ln lvert mathbf mathcal mathrm mathsf max min mu ne neq
        nu omega operatorname partial phi pi pm prod psi qquad quad rVert rho right rvert sec
        sigma sim sin sqrt sum sup tag tan tau text tfrac theta tilde times to underbrace
        varepsilon varphi varrho xi zeta""",
    )
)


def unknown_commands(text: str) -> set[str]:
    return set(re.findall(r"\\([A-Za-z]+)", text)) - COMMANDS


def test_a_letter_against_a_command_is_noticed() -> None:
    assert unknown_commands(r"$\frach2$ and $\varphih$") == {"frach", "varphih"}
    assert not unknown_commands(r"$\frac h2$ and $\varphi h$")


@each_notebook
def test_the_commands_of_formulas_are_known(path: Path) -> None:
    for cell in cells(path, "markdown"):
        unknown = unknown_commands(cell.source)
        assert not unknown, f"{path.name}: {short(cell)} has commands that are not TeX: {unknown}"


# --- outputs ----------------------------------------------------------------------------------


def test_there_are_notebooks() -> None:
    assert NOTEBOOKS, f"no notebooks in {FOLDER}: there is nothing to test, and no book"


@each_notebook
def test_executed_from_top_to_bottom(path: Path) -> None:
    counts = [cell.execution_count for cell in cells(path, "code")]
    assert counts == list(range(1, len(counts) + 1)), (
        f"{path.name} was not run once from top to bottom (make execute does that)"
    )


@each_notebook
def test_no_errors_and_nothing_on_stderr(path: Path) -> None:
    bad = [
        short(cell)
        for cell, output in code_outputs(path)
        if output.output_type == "error" or output.get("name") == "stderr"
    ]
    assert not bad, f"{path.name} shows an error or a warning in " + ", ".join(bad)


@each_notebook
def test_figures_have_alt_text_and_in_the_book_caption_and_name(path: Path) -> None:
    problems = []
    for cell, output in code_outputs(path):
        if "image/png" not in output.get("data", {}):
            continue
        book = cell.metadata.get("mystnb", {})
        alt = output.metadata.get("image/png", {}).get("alt", "")
        if not alt.strip():
            problems.append(f"{short(cell)}: the figure has no alt text; show one of our plots")
        elif book.get("image", {}).get("alt") != alt:
            problems.append(f"{short(cell)}: alt text not carried to the book (make execute)")
        problems += [
            f"{short(cell)}: metadata mystnb.figure.{key} is missing"
            for key in ("caption", "name")
            if path in NOTEBOOKS and not str(book.get("figure", {}).get(key, "")).strip()
        ]
    assert not problems, f"{path.name}:\n  " + "\n  ".join(problems)


@each_notebook
def test_one_figure_to_a_cell(path: Path) -> None:
    for cell in cells(path, "code"):
        figures = [out for out in cell.outputs if "image/png" in out.get("data", {})]
        assert len(figures) <= 1, f"{path.name}: {short(cell)} shows {len(figures)} figures"


@pytest.mark.slow
def test_figure_names_are_unique() -> None:
    names = [
        cell.metadata["mystnb"]["figure"]["name"]
        for path in NOTEBOOKS
        for cell in cells(path, "code")
        if "name" in cell.metadata.get("mystnb", {}).get("figure", {})
    ]
    twice = sorted({name for name in names if names.count(name) > 1})
    assert not twice, f"figure names used twice: {twice}"


# --- shape ------------------------------------------------------------------------------------


@each_notebook
def test_something_is_asserted(path: Path) -> None:
    source = "\n".join(
        line
        for cell in cells(path, "code")
        for line in cell.source.splitlines()
        if not line.lstrip().startswith(("%", "!"))
    )
    asserts = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Assert)]
    assert asserts, f"{path.name} asserts nothing: what it claims could silently go wrong"


@each_notebook
def test_code_cells_are_short(path: Path) -> None:
    """Of the code in sight; what is folded is opened by those who want to read it."""
    folded = {"hide-cell", "hide-input"}
    lengths = [
        len(cell.source.strip().splitlines())
        for cell in cells(path, "code")
        if not folded & {*cell.metadata.get("tags", ())}
    ]
    assert max(lengths) <= LONGEST, f"{path.name}: a cell in sight is longer than {LONGEST} lines"
    assert median(lengths) <= LONGEST_MEDIAN, (
        f"{path.name}: half of the code cells are longer than {LONGEST_MEDIAN} lines: {lengths}"
    )


@each_chapter
def test_opens_with_goal_need_and_time(path: Path) -> None:
    opening = nbformat.read(path, as_version=4).cells[0]
    assert opening.cell_type == "markdown", f"{path.name} must open with a markdown cell"
    assert opening.source.startswith("# "), f"{path.name} must open with its title, '# …'"
    missing = [label for label in OPENING if label not in opening.source]
    assert not missing, f"{path.name}: the opening cell must say {' and '.join(missing)}"


@each_chapter
def test_ends_with_try_it_and_a_summary(path: Path) -> None:
    text = "\n\n".join(cell.source for cell in cells(path, "markdown"))
    sections = re.findall(r"^## +(.+?) *$", text, flags=re.MULTILINE)
    assert sections.count("Try it") == 1, f"{path.name} needs one section '## Try it': {sections}"
    assert sections[-1] == "Summary", f"{path.name}: the last section must be '## Summary'"


@each_chapter
def test_answers_are_folded_and_their_first_line_gives_nothing_away(path: Path) -> None:
    """JupyterLab shows the first line of a folded cell, and folds no Markdown but <details>."""
    every = nbformat.read(path, as_version=4).cells
    start, end = (
        next(k for k, cell in enumerate(every) if re.search(f"^## {name}$", cell.source, re.M))
        for name in ("Try it", "Summary")
    )
    for cell in every[start:end]:
        if cell.cell_type == "code":
            assert cell.source.startswith("# Solution\n"), short(cell)
            assert cell.metadata["jupyter"] == {"outputs_hidden": True, "source_hidden": True}
            assert "hide-cell" in cell.metadata["tags"], short(cell)
        else:
            assert cell.source.count("<details>") == cell.source.count("</details>"), short(cell)


@pytest.mark.slow
def test_every_figure_of_the_paper_is_reproduced_and_named_after_it():
    found = {
        int(match.group(1))
        for path in NOTEBOOKS
        for cell in cells(path, "code")
        if (name := cell.metadata.get("mystnb", {}).get("figure", {}).get("name"))
        and (match := re.fullmatch(r"fig-(\d+)(-[a-zH]+)?", name))
    }
    assert found == set(range(1, 20))
