r"""Every formula of the chapters, held against the loops it speaks of.

Read are the displayed formulas, $$...$$, and those inline formulas that say what a map of the loop,
a loop gain or a characteristic polynomial is. Each of their equations must be one of these:

- true for all loops: evaluated on random ones, with and without dead time, at random complex s;
- true for the loops of its cell. A comment in the cell, or for a whole chapter in its first cell,
  names them: ``<!-- formulas: rational -->`` are those without dead time, and
  ``<!-- formulas: matched -->`` those whose plant is the model, without dead time. A cell that says
  $G = \tilde G$ need not say it again in a comment;
- printed by a cell of the same notebook, by SymPy;
- in a cell with ``<!-- formulas: given -->``: data, definitions, other cases.

An inline formula with only numbers, s and parameters on its right, such as $H = -0.01 s$, is data
and passed over. A name of the chapter's own is known by its definition, the nearest equation before
it, in text or output, with that name alone on its left; without one it stands for any number.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import product
from pathlib import Path
from typing import Any, Protocol

import nbformat
import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray
from sympy.core.function import AppliedUndef

from latex import Equation, FormulaError, equations, parse
from nrdob import NRDOB
from nrdob.sampling import random_loop
from predictions import KEY

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb")) + sorted(FOLDER.glob("class/*.ipynb"))

TOLERANCE = 1e-9
LOOPS, POINTS = 6, 5

Values = NDArray[Any]
"""What an expression is worth at the points that are tried."""


# --- expressions into numbers -------------------------------------------------------------------


class Names(Protocol):
    """What names are worth: at the points that are tried, and at another point."""

    def here(self, name: str) -> Values: ...
    def at(self, name: str, point: sp.Expr) -> Values: ...


FUNCTIONS: dict[str, Callable[[Values], Values]] = {
    "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "sec": lambda x: 1 / np.cos(x), "csc": lambda x: 1 / np.sin(x), "cot": lambda x: 1 / np.tan(x),
    "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
    "Abs": np.abs, "re": np.real, "im": np.imag,
}  # fmt: skip


def evaluate(expression: sp.Expr, names: Names) -> tuple[Values, Values]:
    """Evaluate, and give the size of what was added up on the way: rounding goes with it."""
    if expression.is_Symbol:
        value = names.here(str(expression))
    elif isinstance(expression, AppliedUndef):
        value = names.at(expression.func.__name__, expression.args[0])
    elif expression.is_number:
        value = np.full(POINTS, complex(expression))
    else:
        values, sizes = zip(*(evaluate(part, names) for part in expression.args), strict=True)
        if expression.is_Add:
            return np.sum(values, axis=0), np.sum(sizes, axis=0)
        if expression.is_Mul:
            return np.prod(values, axis=0), np.prod(sizes, axis=0)
        if isinstance(expression, sp.Pow):
            value = values[0] ** values[1]
            worse = np.abs(values[1]) * sizes[0] / np.abs(values[0])
        else:
            value = FUNCTIONS[expression.func.__name__](values[0])
            worse = sizes[0]
        return value, np.abs(value) * np.maximum(1, worse)
    return value, np.abs(value)


def disagreement(left: sp.Expr, right: sp.Expr, names: Names) -> float:
    """Give the largest relative difference of two expressions."""
    with np.errstate(all="ignore"):
        (a, size_a), (b, size_b) = evaluate(left, names), evaluate(right, names)
        relative = np.abs(a - b) / np.maximum(size_a, size_b)
    return float(np.where(a == b, 0.0, np.nan_to_num(relative, nan=np.inf)).max())


def any_number(name: str) -> Values:
    """Give numbers that mean nothing, always the same for the same name."""
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    return np.full(POINTS, rng.uniform(0.3, 2)) * np.exp(1j * rng.uniform(-1, 1))


class AnyNumbers:
    """Every name any number: expressions agree only if they are the same."""

    def here(self, name: str) -> Values:
        return any_number(name)

    def at(self, name: str, point: sp.Expr) -> Values:
        return any_number(f"{name}({point})")


# --- the vocabulary of the book -----------------------------------------------------------------

POLYNOMIALS = {
    "N": "G num", "D": "G den", "N_m": "Gm num", "D_m": "Gm den",
    "N_c": "C num", "D_c": "C den", "N_f": "F num", "D_f": "F den",
}  # fmt: skip
BLOCKS = {"G": "G", "tilde G": "Gm", "C": "C", "F": "F"}
RESULTS = {
    "H": "H", "K": "K", "L": "L", "p_A": "p_A", "p_B": "p_B",
    "T_R": "T_R", "S_d": "S_d", "S_delta": "S_delta", "S_eta": "S_eta",
    "Y/R": "T_R", "Y/d": "S_d", "Y/delta": "S_delta", "Y/eta": "S_eta",
    "U/R": "U_R", "U/d": "U_d", "U/delta": "U_delta", "U/eta": "U_eta",
    "U_R": "U_R", "U_d": "U_d", "U_delta": "U_delta", "U_eta": "U_eta",
    "E/R": "E_R", "E/d": "0", "E/delta": "0", "E/eta": "0",
    "A": "1 + C G~", "B": "1 + F H", "Lambda": "A B",
}  # fmt: skip
"""What an inline formula must not be wrong about."""

READINGS = {
    "R": ("reference", "ratio"),  # where there is no reference, R is G over its model
    "U/delta": ("plant", "controller"),  # eq. (7) means the input of the plant, u + delta
    "U_delta": ("plant", "controller"),
    "Lambda": ("A B", "A B G~"),  # as Lemma 1 first writes it
}
"""Names to which the paper, or common use, gives two meanings."""

CONSTANTS: dict[str, Callable[[NRDOB], float]] = {
    "lambda": lambda loop: loop.filter.time_constant,
    "n": lambda loop: loop.filter.order,
    "theta": lambda loop: loop.delay,
    "omega": lambda loop: 1.7,
    "omega_B": lambda loop: loop.filter.bandwidth,
    "omega_B_F": lambda loop: loop.filter.bandwidth,
    "g_0": lambda loop: loop.ratio.dc_gain,
}
CLOSED_LOOP = {name for name in RESULTS if "/" in name or name[:2] in {"T_", "S_", "U_"}}
"""Here even a number on the right is a statement about all loops: S_d(0) = 0."""

SIGNALS = ("R", "d", "delta", "eta")
SIGNAL_NAMES = {"Y", "U", "E", "y", "u", "e", "y_m", "y_f", "hat delta"}
FUNCTION_NAMES = {*POLYNOMIALS, *BLOCKS, *RESULTS, "R", "varrho"}
"""Functions of s that belong to a loop."""


@dataclass(frozen=True)
class Loop:
    """What the vocabulary is worth in one loop."""

    loop: NRDOB
    s: Values
    inputs: Values
    readings: tuple[tuple[str, str], ...] = ()
    definitions: tuple[tuple[str, sp.Expr], ...] = ()

    def here(self, name: str) -> Values:
        reading = dict(self.readings).get(name, "reference")
        if name in CONSTANTS:
            return np.full(POINTS, CONSTANTS[name](self.loop), dtype=complex)
        if name == "s":
            return self.s
        if name in SIGNALS and reading == "reference":
            return np.full(POINTS, self.inputs[SIGNALS.index(name)])
        if name in (own := dict(self.definitions)):
            return evaluate(own[name], self)[0]
        if name in self.signals:
            return self.signals[name]
        if name in FUNCTION_NAMES:
            return self.function(name, self.s)
        return any_number(name)

    def at(self, name: str, point: sp.Expr) -> Values:
        s, _ = evaluate(point, self)
        if name in (own := dict(self.definitions)):
            return evaluate(own[name], replace(self, s=s))[0]
        return self.function(name, s) if name in FUNCTION_NAMES else any_number(f"{name}({point})")

    def function(self, name: str, s: Values) -> Values:
        """Give a function of the loop at any s."""
        loop, reading = self.loop, dict(self.readings).get(name)
        if name in {"R", "varrho"}:
            return loop.ratio(s)
        if name in POLYNOMIALS:
            block, part = POLYNOMIALS[name].split()
            return np.polyval(getattr(getattr(loop.fractions, block), part), s)
        value = {
            "0": lambda s: 0 * s,
            "1 + C G~": lambda s: 1 + loop.CGm(s),
            "1 + F H": lambda s: 1 + loop.FH(s),
            "A B": lambda s: (1 + loop.CGm(s)) * (1 + loop.FH(s)),
        }.get(attribute := (BLOCKS | RESULTS)[name]) or getattr(loop, attribute)
        shift = 1 if reading == "controller" else 0
        factor = loop.Gm(s) if reading == "A B G~" else 1
        return value(s) * factor - shift

    @cached_property
    def signals(self) -> dict[str, Values]:
        """What the inputs together make of the signals in the loop."""
        loop, s, (R, d, delta, eta) = self.loop, self.s, self.inputs
        y = loop.T_R(s) * R + loop.S_d(s) * d + loop.S_delta(s) * delta + loop.S_eta(s) * eta
        u = loop.U_R(s) * R + loop.U_d(s) * d + loop.U_eta(s) * eta
        u = u + (loop.U_delta(s) - 1) * delta  # U_delta is the map to the input of the plant
        e = loop.E_R(s) * R
        F, Gm = loop.F(s), loop.Gm(s)
        return {
            **{"Y": y, "U": u, "E": e, "y": y, "u": u, "e": e, "y_m": y + eta},
            "y_f": F * (y + eta) + (1 - F) * Gm * u,
            "hat delta": F / Gm * (y + eta) - F * u,
        }


@cache
def loops(context: str) -> list[Loop]:
    """Draw loops: all kinds, rational ones (no dead time), or matched ones (G is the model)."""
    rng = np.random.default_rng(2020)
    drawn = []
    while len(drawn) < LOOPS:
        loop = random_loop(rng, delayed=context == "all" and len(drawn) < LOOPS - 2)
        if context == "matched":
            loop = NRDOB(loop.model, loop.model, loop.controller, loop.filter)
        if loop.ill_posed:
            continue
        s = rng.uniform(0.3, 2, POINTS) * np.exp(1j * rng.uniform(-np.pi, np.pi, POINTS))
        drawn.append(Loop(loop, s, rng.normal(size=4) + 1j * rng.normal(size=4)))
    return drawn


def names_in(expression: sp.Expr) -> set[str]:
    """Give every name that occurs, those of functions too."""
    applied = {f.func.__name__ for f in expression.atoms(AppliedUndef)}
    return {str(symbol) for symbol in expression.free_symbols} | applied


def holds(equation: Equation, context: str, definitions: dict[str, sp.Expr]) -> bool:
    """Tell whether an equation is true on every loop of a context, in one reading of its names."""
    used = needed(equation, definitions)
    ambiguous = [name for name in READINGS if name in used]
    own = tuple((name, definitions[name]) for name in used & definitions.keys())
    return any(
        all(
            disagreement(equation.left, equation.right, loop) < TOLERANCE
            for loop in (replace(loop, readings=meant, definitions=own) for loop in loops(context))
        )
        for chosen in product(*(READINGS[name] for name in ambiguous))
        for meant in [tuple(zip(ambiguous, chosen, strict=True))]
    )


def needed(equation: Equation, definitions: dict[str, sp.Expr]) -> set[str]:
    """Give the names that an equation uses, directly or through definitions."""
    used = names_in(equation.left) | names_in(equation.right)
    while True:
        more = used.union(*(names_in(definitions[name]) for name in used & definitions.keys()))
        if more == used:
            return used
        used = more


# --- the formulas of a notebook -----------------------------------------------------------------

DISPLAYED = re.compile(r"\$\$(.+?)\$\$", re.DOTALL)
INLINE = re.compile(r"(?<![\\$])\$([^$\n]+(?:\n[^$\n]+)*)\$(?!\$)")
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
COMMENT = re.compile(r"<!--\s*formulas:\s*(\w+)\s*-->")
CONTEXTS = {"": ["all"], "rational": ["all", "rational"], "matched": ["all", "matched"]}


@dataclass(frozen=True)
class Formula:
    """One formula of a Markdown cell."""

    text: str
    displayed: bool


def formulas(cell: Any) -> Iterator[Formula]:
    """Give the formulas of a Markdown cell, the displayed ones first."""
    text = CODE.sub(" ", cell.source)
    yield from (Formula(found, True) for found in DISPLAYED.findall(text))
    yield from (Formula(found, False) for found in INLINE.findall(DISPLAYED.sub(" ", text)))


def read(formula: Formula) -> list[Equation]:
    """Read a formula; an inline one that cannot be read must not be one of those we answer for."""
    if "=" not in formula.text:
        return []
    try:
        return equations(formula.text)
    except FormulaError:
        if formula.displayed or must_be_read(formula.text):
            raise
        return []


def must_be_read(text: str) -> bool:
    """Tell whether an inline formula says what one of RESULTS is."""
    try:
        return str(parse(text.partition("=")[0])) in RESULTS
    except FormulaError:
        return False


def is_claim(formula: Formula, equation: Equation) -> bool:
    """Tell whether an equation must be vouched for."""
    if formula.displayed:
        return True
    left, right = names_in(equation.left), names_in(equation.right)
    return bool(left & CLOSED_LOOP or (left & RESULTS.keys() and right & FUNCTION_NAMES))


def printed(notebook: Any) -> Iterator[tuple[int, Equation]]:
    """Give the equations that the cells of a notebook print, with the number of the cell."""
    for number, cell in enumerate(notebook.cells):
        for output in cell.get("outputs", []):
            latex = output.get("data", {}).get("text/latex", "")
            try:
                found = equations(latex.strip().strip("$"))
            except FormulaError:
                continue  # a matrix, a tuple, a series: not for this reader
            yield from ((number, equation) for equation in found)


def same(one: Equation, other: Equation) -> bool:
    """Tell whether two equations say the same, side by side."""
    return any(
        disagreement(one.left, left, AnyNumbers()) < TOLERANCE
        and disagreement(one.right, right, AnyNumbers()) < TOLERANCE
        for left, right in ((other.left, other.right), (other.right, other.left))
    )


def problems(notebook: Any) -> list[str]:
    """Check every formula of a notebook, and tell which ones nothing vouches for."""
    outputs = list(printed(notebook))
    definitions: dict[str, sp.Expr] = {}
    whole_chapter = context_of(notebook.cells[0])
    told = []
    for number, cell in enumerate(notebook.cells):
        for _, equation in (output for output in outputs if output[0] == number):
            definitions |= definition(equation)
        if cell.cell_type != "markdown" or KEY in cell.metadata:
            continue  # a question for class is read where it is written
        context = context_of(cell) or whole_chapter
        here: list[tuple[Formula, Equation]] = []
        for formula in formulas(cell):
            try:
                here += [(formula, equation) for equation in read(formula)]
            except FormulaError as error:
                if context != "given":
                    told.append(f"{cell.id}: cannot read {formula.text.strip()}: {error}")
        for _, equation in here:
            definitions |= definition(equation)
        if context == "given":
            continue
        if context not in CONTEXTS:
            told.append(f"{cell.id}: there is no context {context!r}")
            continue
        contexts = {*CONTEXTS[context]} | {"matched" for _, found in here if says_matched(found)}
        claims = [(formula, found) for formula, found in here if is_claim(formula, found)]
        told += [
            f"{cell.id}: nothing vouches for {equation.text}"
            for formula, equation in claims
            if not any(true_in(equation, context, definitions) for context in contexts)
            and not any(same(equation, other) for _, other in outputs)
            and not (formula.displayed and serves(equation, [other for _, other in claims]))
        ]
    return told


def context_of(cell: Any) -> str:
    """Give the context that the comment of a cell names, empty without one."""
    comment = COMMENT.search(cell.source)
    return comment.group(1) if comment else ""


def true_in(equation: Equation, context: str, definitions: dict[str, sp.Expr]) -> bool:
    """Tell whether an equation holds in a context, with names as in the book or as defined here."""
    others = {
        name: meaning
        for name, meaning in definitions.items()
        if definition(equation) != {name: meaning}
    }
    of_the_book = {name: meaning for name, meaning in others.items() if name not in SIGNAL_NAMES}
    return any(holds(equation, context, known) for known in (of_the_book, others))


def says_matched(equation: Equation) -> bool:
    """Tell whether an equation is the hypothesis that the plant is the model."""
    return {str(equation.left), str(equation.right)} == {"G", "tilde G"}


def definition(equation: Equation) -> dict[str, sp.Expr]:
    """Give the name that an equation defines: alone on the left, and not one of the book's."""
    name = str(equation.left)
    taken = FUNCTION_NAMES | {*SIGNALS, *CONSTANTS, "s"}
    if not equation.left.is_Symbol or name in taken | names_in(equation.right):
        return {}
    return {name: equation.right}


def serves(equation: Equation, claims: list[Equation]) -> bool:
    """Tell whether an equation defines a name that another claim of its cell is about."""
    others = [claim for claim in claims if claim != equation]
    used = set().union(*(names_in(side) for claim in others for side in (claim.left, claim.right)))
    return not used.isdisjoint(definition(equation))


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_formula_is_true_or_printed(path: Path) -> None:
    found = problems(nbformat.read(path, as_version=4))
    assert not found, (
        f"{path.name}: put these formulas right, let a cell print them, or say of which loops they "
        f"speak; {Path(__file__).name} tells how:\n  " + "\n  ".join(found)
    )


# --- that this test would notice ----------------------------------------------------------------

TRUE_FOR_ALL = [
    r"p_A = D_mD_c+N_mN_c",
    r"p_B = D\,N_m(D_f-N_f)+N\,D_mN_f\,e^{-\theta s}",
    r"p_B(0) = N(0)D_m(0)",
    r"T_R = \frac{C\tilde G}{1+C\tilde G}\cdot\frac{1+H}{1+FH}",
    r"S_d = \dfrac{1-F}{1+FH}",
    r"S_\delta = \frac{G(1-F)}{1+FH}",
    r"S_\eta = -\frac{F\tilde G^{-1}G}{1+FH}",
    r"S_d-S_\eta = 1",
    r"E/R = 1/(1+\tilde GC)",
    r"E/\delta = E/d = E/\eta = 0",
    r"\frac Ud = \frac{U}{\eta} = -\frac{K}{1+L}",
    r"\frac{U}{\delta} = \frac{\tilde G(1-F)}{\tilde G+F(G-\tilde G)}",
    r"\frac{U}{\delta} = \frac{-FG}{\tilde G+F(G-\tilde G)}",
    r"K = \frac{F}{(1-F)\tilde G},\qquad L = KG .",
    r"Y = T_RR+S_dd+S_\delta\delta+S_\eta\eta",
    r"u = C(R-y_f)+Fu-F\tilde G^{-1}(y+\eta)",
    r"F(\mathrm{j}\omega) = (1+\mathrm{j}\lambda\omega)^{-n}",
    r"1-F = \frac{(\lambda s+1)^n-1}{(\lambda s+1)^n}",
    r"H = R-1",
    r"\Lambda = AB = (1+\tilde GC)\,[1+F(\tilde G^{-1}G-1)]",
    r"\omega_{B_F} = \sqrt{2^{1/n}-1}/\lambda",
]
TRUE_IF_RATIONAL = [r"p_B = D\,N_m(D_f-1)+N\,D_m", r"G = N/D"]
TRUE_IF_MATCHED = [r"p_B = N\,D\,D_f", r"S_d = 1-F", r"L = F/(1-F)", r"T_R = CG/(1+CG)", "FH = 0"]


def notebook(*cells: str, output: str = "") -> Any:
    """Make up a chapter of Markdown cells, the last followed by a code cell with an output."""
    made = nbformat.v4.new_notebook()
    made.cells = [nbformat.v4.new_markdown_cell(cell) for cell in ["# Title", *cells]]
    printed = nbformat.v4.new_output("display_data", {"text/latex": rf"$\displaystyle {output}$"})
    made.cells.append(nbformat.v4.new_code_cell("x", outputs=[printed] if output else []))
    return made


@pytest.mark.parametrize("formula", TRUE_FOR_ALL)
def test_what_is_true_for_all_loops_passes(formula: str) -> None:
    assert problems(notebook(f"$${formula}$$")) == []


@pytest.mark.parametrize(
    ("formula", "context"),
    [(formula, "rational") for formula in TRUE_IF_RATIONAL]
    + [(formula, "matched") for formula in TRUE_IF_MATCHED],
)
def test_what_is_true_for_some_loops_must_say_so(formula: str, context: str) -> None:
    assert len(problems(notebook(f"$${formula}$$"))) == 1
    assert problems(notebook(f"<!-- formulas: {context} -->\n$${formula}$$")) == []


def test_a_cell_or_a_chapter_says_that_the_model_is_perfect() -> None:
    assert problems(notebook(r"If $\tilde G = G$, then $S_d = 1-F$.")) == []
    chapter = notebook("$S_d = 1-F$")
    chapter.cells[0].source += "\n\n<!-- formulas: matched -->"
    assert problems(chapter) == []


@pytest.mark.thorough
@pytest.mark.parametrize("formula", [*TRUE_FOR_ALL, *TRUE_IF_RATIONAL, *TRUE_IF_MATCHED])
def test_every_wrong_sign_is_noticed(formula: str) -> None:
    for sign in re.finditer("[+-]", formula):
        wrong = "-" if sign.group() == "+" else "+"
        corrupted = formula[: sign.start()] + wrong + formula[sign.end() :]
        for context in ("", "<!-- formulas: matched -->\n"):
            if not (context and still_true_if_matched(corrupted)):
                assert problems(notebook(f"{context}$${corrupted}$$")), corrupted


def still_true_if_matched(formula: str) -> bool:
    """Tell whether the wrong sign stands before something that vanishes with a perfect model."""
    try:
        return all(holds(equation, "matched", {}) for equation in equations(formula))
    except FormulaError:
        return False


@pytest.mark.parametrize(
    "text",
    [
        "$p_A = D_mD_c-N_mN_c$",
        "$S_d=1-F$",
        r"$S_\delta(0) = 1$",
        r"In words, $L = \max G$.",
        "$$Z = N+P$$",
        "<!-- formulas: sometimes -->\n$F=1/(\\lambda s+1)^n$",
    ],
)
def test_what_nothing_vouches_for_is_told(text: str) -> None:
    assert len(problems(notebook(text))) == 1


@pytest.mark.parametrize(
    "text",
    [
        "Let $H = -0.01 s$; code: `$S_d = 2$`.",
        "<!-- formulas: given -->\n$$G = \\frac{1}{s+1}$$",
        "The turns are $Z = N+P$, and $1+FH = 0$ has no root.",
        r"$$p_B(s) = q(s)+r(s)e^{-\theta s},\qquad q = D N_m (D_f-1),\quad r = N D_m .$$",
        r"With $T = L/(1+L)$ we have $S_\eta = -T$.",
        r"$1+F(kR-1) = (1-F)(1+kL)$ for every $k$, where $R = G/\tilde G$.",
    ],
)
def test_data_and_definitions_pass(text: str) -> None:
    assert problems(notebook(text)) == []


@pytest.mark.parametrize(
    ("formula", "passes"),
    [
        (r"\lambda_{\max} = 3-\sqrt5", True),
        (r"3-\sqrt{5} = \lambda_{\max}", True),
        (r"\lambda_{\max} = 3+\sqrt5", False),
        (r"\lambda_{\min} = 3-\sqrt5", False),
    ],
)
def test_what_a_cell_prints_passes(formula: str, passes: bool) -> None:
    chapter = notebook(f"$${formula}$$", output=r"\lambda_{max} = 3 - \sqrt{5}")
    assert (problems(chapter) == []) is passes


# --- the reader of LaTeX --------------------------------------------------------------------------

s, n, F, G, N, x = sp.symbols("s n F G N x")
lam, theta, phi, delta = sp.symbols("lambda theta varphi delta")
model = sp.Symbol("tilde G")


@pytest.mark.parametrize(
    ("text", "expression"),
    [
        (r"\frac{1}{s} + \dfrac1s - \tfrac{2}{s}", 0),
        (r"(\lambda s+1)^n", (lam * s + 1) ** n),
        (r"\left(\lambda s + 1\right)^{n}", (lam * s + 1) ** n),
        (r"2.5\,s^2\cdot G", sp.Rational(5, 2) * s**2 * G),
        (r"\tilde G^{-1}G", G / model),
        (r"\tilde{G}\Gm", model**2),
        (r"N e^{-\theta s}", N * sp.exp(-theta * s)),
        (r"\mathrm{e}^{-\theta s}+\e^s", sp.exp(-theta * s) + sp.exp(s)),
        ("N_mN_{m}", sp.Symbol("N_m") ** 2),
        (r"S_\delta\omega_{B_F}", sp.Symbol("S_delta") * sp.Symbol("omega_B_F")),
        (r"K_\mathrm{conv}-K_{\mathrm{conv}}", 0),
        (r"F'(0)", sp.Function("F'")(0)),
        (r"\lambda^*\lambda^{\mathrm{low}}", sp.Symbol("lambda^*") * sp.Symbol("lambda^low")),
        ("F(s)", F),
        (r"F{\left(s \right)}", F),
        (r"F(0)G(\infty)", sp.Function("F")(0) * sp.Function("G")(sp.oo)),
        ("FG(0)", sp.Function("F")(0) * sp.Function("G")(0)),
        (r"F\,G(0)", F * sp.Function("G")(0)),
        (r"F(j\omega)", sp.Function("F")(sp.I * sp.Symbol("omega"))),
        (r"F(\mathrm{j}\omega)", sp.Function("F")(sp.I * sp.Symbol("omega"))),
        ("s(s+3)", s**2 + 3 * s),
        ("G(1-F)", G * (1 - F)),
        (r"\sqrt{2^{1/n}-1}", sp.sqrt(2 ** (1 / n) - 1)),
        (r"\sqrt[3]{x}", sp.cbrt(x)),
        (r"\sec^n(\pi/n)", sp.sec(sp.pi / n) ** n),
        (r"\cos n\varphi\,\cos^n\!\varphi", sp.cos(n * phi) * sp.cos(phi) ** n),
        (r"2 \operatorname{asin}{\left(\frac{1}{x} \right)}", 2 * sp.asin(1 / x)),
        (r"|F-1|\lvert G\rvert", sp.Abs(F - 1) * sp.Abs(G)),
        (r"U/\delta", sp.Symbol("U/delta")),
        (r"G\,\frac{u}{\delta}", G * sp.Symbol("U/delta")),
        (r"\hat\delta/\delta", sp.Symbol("hat delta") / delta),
        (r"G/\tilde G\,e^{s}", G / model * sp.exp(s)),
        ("-x^{-1}-[x-(1-x)]", -1 / x - 2 * x + 1),
        (r"\bigl(1{,}000\bigr)x", 1000 * x),
    ],
)
def test_latex_is_read(text: str, expression: sp.Expr) -> None:
    assert sp.expand(parse(text) - expression) == 0


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (r"\lim_{s\to0} G", r"\\lim' is not known"),
        (r"\max G", r"\\max' is not known"),
        ("G/2s", "two ways"),
        ("(G", r"'\)' expected"),
        ("G)", "does not belong here"),
        ("G+", "ends too early"),
        ("", "ends too early"),
        ("x^2^3", "two exponents"),
        (r"\begin{matrix} G", r"\\begin' is not known"),
        ("G_{", "never closed"),
    ],
)
def test_what_cannot_be_read_is_told(text: str, complaint: str) -> None:
    with pytest.raises(FormulaError, match=complaint):
        parse(text)


@pytest.mark.parametrize(
    ("text", "pairs"),
    [
        ("F = G = N.", [("F", "G"), ("G", "N")]),
        (r"F = G,\qquad N = s", [("F", "G"), ("N", "s")]),
        (r"F = G \quad\text{and so}\quad N = s", [("F", "G"), ("N", "s")]),
        (r"F = 0 \iff G = N", [("F", "0"), ("G", "N")]),
        (r"0 < F = G \le 3", [("F", "G")]),
        (r"F \approx 3", []),
        (r"\sum_{k=1}^n k", []),
        (r"\begin{aligned} F &= G \\ &= N + \\ &\quad s, \\ x &= 1 \end{aligned}",
         [("F", "G"), ("G", "N + s"), ("x", "1")]),
        (r"\begin{aligned} F &= G \\ &\quad + N \end{aligned}", [("F", "G + N")]),
    ],
)  # fmt: skip
def test_lists_chains_and_rows_are_taken_apart(text: str, pairs: list[tuple[str, str]]) -> None:
    found = [(str(e.left), str(e.right)) for e in equations(text)]
    assert found == pairs
