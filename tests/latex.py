r"""Read the LaTeX formulas of the chapters as SymPy expressions.

Only what the chapters use is understood; everything else raises `FormulaError`, which says what and
where. So a formula is either read completely or not at all.

    sum      [+ -] product { (+ | -) product }
    product  factor { [\cdot | \times | /] factor }     nothing between two factors multiplies
    factor   atom [ ^ exponent ]
    atom     number | name | \frac.. | \sqrt.. | \sin.. | ( sum ) | [ sum ] | { sum } | | sum |

A name is one letter, Latin or Greek, with whatever is attached to it: N_m, S_\delta, \tilde G, F',
\omega_{B_F}. It becomes the symbol N_m, S_delta, tilde G, F', omega_B_F. A name in front of (s) is
the name itself, F(s) is F; in front of (0), (\infty), a number or (j\omega) it is its value there.
The quotient of two signals, E/R or \frac{U}{\delta}, is one symbol, "U/delta": it names a map.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import sympy as sp
from sympy.core.function import AppliedUndef

OUTPUTS = {"E", "U", "Y", "e", "u", "y"}
INPUTS = {"R", "d", "delta", "eta"}

GREEK = {
    "alpha", "beta", "gamma", "delta", "epsilon", "varepsilon", "zeta", "eta", "theta", "vartheta",
    "kappa", "lambda", "mu", "nu", "xi", "rho", "varrho", "sigma", "tau", "phi", "varphi", "chi",
    "psi", "omega", "Gamma", "Delta", "Theta", "Lambda", "Xi", "Pi", "Sigma", "Phi", "Psi", "Omega",
}  # fmt: skip
FUNCTIONS = {
    "sin": sp.sin, "cos": sp.cos, "tan": sp.tan, "sec": sp.sec, "cot": sp.cot, "csc": sp.csc,
    "arctan": sp.atan, "arcsin": sp.asin, "arccos": sp.acos, "atan": sp.atan, "asin": sp.asin,
    "acos": sp.acos, "ln": sp.log, "log": sp.log, "exp": sp.exp, "Re": sp.re, "Im": sp.im,
    "re": sp.re, "im": sp.im,
}  # fmt: skip
ACCENTS = {"tilde", "hat", "bar", "dot", "overline"}
ACCENTED_MACROS = {"Gm": "tilde G"}
UPRIGHT = {"mathrm", "text", "mathit", "mathbf", "mathsf", "operatorname"}
SIZES = re.compile(r"(left|right|[bB]igg?[lrm]?|displaystyle|textstyle|limits|nolimits)$")
THIN_SPACE = {",", ";", ":", " ", "thinspace"}
NO_SPACE = {"!"}
POINT = re.compile(r"s|0|\\infty|[+-]?\d+(\.\d+)?|(j|\\j|\\mathrm\{?j\}?)\\omega")
VARIABLES = {"s", "n", "k", "lambda", "theta", "omega", "x", "z"}
"""Names that no (s) or (0) follows as their argument: s(s+3), n(0)."""

RELATIONS = {
    "=", "<", ">", "\\le", "\\leq", "\\ge", "\\geq", "\\lt", "\\gt", "\\ne", "\\neq", "\\approx",
    "\\to", "\\equiv", "\\sim", "\\propto", "\\ll", "\\gg", "\\in", "\\notin", "\\simeq",
}  # fmt: skip
ARROWS = {
    "\\iff", "\\Leftrightarrow", "\\Longleftrightarrow", "\\Rightarrow", "\\Longrightarrow",
    "\\implies",
}  # fmt: skip
SEPARATORS = {",", ";", "\\quad", "\\qquad", "\\\\", "\\text", "&"} | ARROWS
OPENING, CLOSING = {"(", "[", "{", "\\{"}, {")", "]", "}", "\\}"}

TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\d+(?:\.\d+)?|'+|\S", re.DOTALL)


class FormulaError(ValueError):
    """A formula, or a part of one, that this reader does not understand."""


@dataclass(frozen=True)
class Equation:
    """Two sides of one equality sign, and how they are written."""

    left: sp.Expr
    right: sp.Expr
    text: str


def tokens_of(text: str) -> list[str]:
    """Split a formula into its tokens; sizes, negative spaces and numbers of equations left out."""
    text = re.sub(r"\\tag\s*\{[^{}]*\}", "", text)
    text = re.sub(r"(?<!\\)%.*", "", text).replace("{,}", "")
    found = TOKEN.findall(text)
    return [
        token
        for token in found
        if not SIZES.match(token.removeprefix("\\")) or not token.startswith("\\")
        if token.removeprefix("\\") not in NO_SPACE or not token.startswith("\\")
    ]


# --- formulas into equations ----------------------------------------------------------------------


def equations(text: str) -> list[Equation]:
    r"""Give every equality of a formula: lists are taken apart, and chains a = b = c too.

    Raises
    ------
    FormulaError
        If a side of an equality cannot be read.
    """
    return [
        Equation(parse(left), parse(right), f"{written(left)} = {written(right)}")
        for statement in statements(text)
        for left, right in equalities(statement)
    ]


def written(tokens: list[str]) -> str:
    """Put tokens together again, with a space only where one is needed."""
    text = ""
    for token in tokens:
        apart = re.search(r"\\[A-Za-z]+$", text) and token[0].isalpha()
        text += f" {token}" if apart else token
    return text


def statements(text: str) -> list[list[str]]:
    """Take a formula apart at commas, wide spaces, words, arrows and line breaks."""
    tokens = tokens_of(re.sub(r"\\(begin|end)\s*\{(aligned|split|gathered)\}", r"\\\\", text))
    rows = [unaligned(row) for row in split(tokens, {"\\\\"})]
    joined: list[list[str]] = []
    for row in rows:
        goes_on = (
            joined and row and (row[0] in {"=", "+", "-"} or joined[-1][-1] in {"+", "-", "="})
        )
        if goes_on:
            joined[-1] += row
        elif row:
            joined.append(row)
    pieces = [piece for row in joined for piece in split(without_words(row), SEPARATORS)]
    return [stripped for piece in pieces if (stripped := strip(piece))]


def unaligned(row: list[str]) -> list[str]:
    """Take the alignment marks, and the spaces after them, out of a line."""
    aligned = "&" in row
    row = [token for token in row if token != "&"]
    while aligned and row and row[0] in {"\\quad", "\\qquad"}:
        row = row[1:]
    return row


def without_words(tokens: list[str]) -> list[str]:
    r"""Replace \text{...} by a separator."""
    result: list[str] = []
    position = 0
    while position < len(tokens):
        result.append(tokens[position])
        if tokens[position] == "\\text" and tokens[position + 1 : position + 2] == ["{"]:
            position = closing(tokens, position + 1)
        position += 1
    return result


def strip(tokens: list[str]) -> list[str]:
    """Drop spaces and full stops at both ends."""
    drop = {".", "\\,", "\\;", "\\:", "\\ ", "~"}
    while tokens and tokens[0] in drop:
        tokens = tokens[1:]
    while tokens and tokens[-1] in drop:
        tokens = tokens[:-1]
    return tokens


def split(tokens: list[str], at: set[str]) -> list[list[str]]:
    """Split at some tokens, but not inside brackets."""
    parts: list[list[str]] = [[]]
    depth = 0
    for token in tokens:
        depth += (token in OPENING) - (token in CLOSING)
        if token in at and depth == 0:
            parts.append([])
        else:
            parts[-1].append(token)
    return parts


def equalities(statement: list[str]) -> list[tuple[list[str], list[str]]]:
    """Give the neighbours of each equality sign of a chain; other relations are passed over."""
    members = [strip(member) for member in split(statement, RELATIONS)]
    depth, signs = 0, []
    for token in statement:
        depth += (token in OPENING) - (token in CLOSING)
        if token in RELATIONS and depth == 0:
            signs.append(token)
    return [
        (left, right)
        for left, sign, right in zip(members, signs, members[1:], strict=False)
        if sign == "="
    ]


def closing(tokens: list[str], start: int) -> int:
    """Find the bracket that closes the one at `start`."""
    depth = 0
    for position in range(start, len(tokens)):
        depth += (tokens[position] in OPENING) - (tokens[position] in CLOSING)
        if depth == 0:
            return position
    raise FormulaError(f"{tokens[start]!r} is never closed in {' '.join(tokens)!r}")


# --- expressions ----------------------------------------------------------------------------------


def parse(formula: str | list[str]) -> sp.Expr:
    """Read one expression.

    Raises
    ------
    FormulaError
        If it is not one, or holds something that this reader does not know.
    """
    reader = Reader(tokens_of(formula) if isinstance(formula, str) else formula)
    expression = reader.sum()
    if reader.token:
        raise reader.error(f"{reader.token!r} does not belong here")
    return expression


class Reader:
    """Recursive descent, one token ahead."""

    def __init__(self, tokens: list[str]) -> None:
        self.tokens = list(tokens)
        self.position = 0
        self.bars = 0

    @property
    def token(self) -> str:
        """The token to be read next, empty at the end."""
        return self.tokens[self.position] if self.position < len(self.tokens) else ""

    def error(self, what: str) -> FormulaError:
        before, after = self.tokens[: self.position], self.tokens[self.position :]
        return FormulaError(f"{what}: {' '.join(before)} >>> {' '.join(after)}")

    def take(self, expected: str = "") -> str:
        token = self.token
        if not token or (expected and token != expected):
            raise self.error(f"{expected or 'something'!r} expected")
        self.position += 1
        return token

    def skip_spaces(self) -> bool:
        """Pass over thin spaces, and tell whether there was one."""
        start = self.position
        while self.token == "~" or (self.token.startswith("\\") and self.token[1:] in THIN_SPACE):
            self.position += 1
        return self.position > start

    def sum(self) -> sp.Expr:
        self.skip_spaces()
        total: sp.Expr = sp.Integer(0)
        sign = self.take() if self.token in {"+", "-"} else "+"
        while True:
            term = self.product()
            total = total + term if sign == "+" else total - term
            self.skip_spaces()
            if self.token not in {"+", "-"}:
                return total
            sign = self.take()

    def product(self) -> sp.Expr:
        factors = [self.factor()]
        run = 0  # where the names begin that stand side by side: FH(0) is F(0) H(0)
        divided = False
        while True:
            spaced = self.skip_spaces()
            if self.token in {"\\cdot", "\\times", "*"}:
                self.take()
                factors.append(self.factor())
                run, divided = len(factors) - 1, False
            elif self.token == "/":
                self.take()
                factors[-1] = quotient(factors[-1], self.factor())
                run, divided = len(factors), True
            elif self.starts_a_factor():
                if divided and not spaced:
                    raise self.error("a/b c can be read in two ways; write (a/b) c or a/(b c)")
                factor = self.factor()
                if spaced:
                    run = len(factors)
                elif isinstance(factor, AppliedUndef):
                    for place in reversed(range(run, len(factors))):
                        if not is_map(factors[place]):
                            break
                        factors[place] = sp.Function(factors[place].name)(*factor.args)
                factors.append(factor)
                divided = False
            else:
                return sp.prod(factors)

    def starts_a_factor(self) -> bool:
        token = self.token
        if token.startswith("\\"):
            return token not in RELATIONS | SEPARATORS | {"\\}", "\\rvert", "\\rVert"}
        opens = token in {"(", "[", "{"} or (token == "|" and not self.bars)
        return opens or token.isalpha() or token[:1].isdigit()

    def factor(self) -> sp.Expr:
        self.skip_spaces()
        return self.powered(self.atom())

    def powered(self, base: sp.Expr) -> sp.Expr:
        if self.token != "^":
            return base
        self.take()
        exponent = self.argument()
        if self.token == "^":
            raise self.error("two exponents")
        return sp.exp(exponent) if base == sp.E else base**exponent

    def argument(self) -> sp.Expr:
        r"""Read what ^, \frac or \sqrt applies to: a group in braces, or one single token."""
        token = self.token
        if token[:1].isdigit() and len(token) > 1:  # \frac12 and x^23 take one digit
            self.tokens[self.position] = token[1:]
            return sp.Integer(token[0])
        if token == "{":
            return self.bracketed("}")
        return self.atom(alone=True)

    def bracketed(self, end: str) -> sp.Expr:
        self.take()
        inner = self.sum()
        self.take(end)
        return inner

    def atom(self, alone: bool = False) -> sp.Expr:
        token = self.token
        if not token:
            raise self.error("the formula ends too early")
        if token[0].isdigit():
            return sp.Rational(self.take())
        if token in {"(", "[", "{"}:
            return self.bracketed({"(": ")", "[": "]", "{": "}"}[token])
        if token in {"|", "\\lvert"}:
            self.bars += 1
            inner = self.bracketed("|" if token == "|" else "\\rvert")
            self.bars -= 1
            return sp.Abs(inner)
        if token in {"\\frac", "\\dfrac", "\\tfrac"}:
            self.take()
            numerator = self.argument()
            return quotient(numerator, self.argument())
        if token == "\\sqrt":
            self.take()
            index = self.bracketed("]") if self.token == "[" else sp.Integer(2)
            return sp.root(self.argument(), index)
        if token == "\\pi":
            self.take()
            return sp.pi
        if token == "\\infty":
            self.take()
            return sp.oo
        upright = self.upright()
        if upright in {"j", "i"} or token in {"j", "i", "\\j"}:
            self.pass_name(upright)
            return sp.I
        if upright == "e" or token == "\\e" or (token == "e" and self.ahead(1) == "^"):
            self.pass_name(upright)
            return sp.E
        function = upright or token.removeprefix("\\")
        if function in FUNCTIONS and token.startswith("\\"):
            self.pass_name(upright)
            return self.function(function)
        return self.name(alone)

    def ahead(self, by: int) -> str:
        place = self.position + by
        return self.tokens[place] if place < len(self.tokens) else ""

    def upright(self) -> str:
        r"""Give the word of \mathrm{word} or \operatorname{word} that comes next, if one does."""
        if self.token.removeprefix("\\") not in UPRIGHT or not self.token.startswith("\\"):
            return ""
        if self.ahead(1) != "{":
            return self.ahead(1)
        end = closing(self.tokens, self.position + 1)
        return "".join(self.tokens[self.position + 2 : end])

    def pass_name(self, upright: str) -> None:
        r"""Pass over one token, or over \mathrm{word}."""
        if not upright:
            self.take()
        elif self.ahead(1) == "{":
            self.position = closing(self.tokens, self.position + 1) + 1
        else:
            self.position += 2

    def function(self, name: str) -> sp.Expr:
        """Read the argument of a function, with or without brackets, and its exponent before it."""
        exponent: sp.Expr = sp.Integer(1)
        if self.token == "^":
            self.take()
            exponent = self.argument()
        self.skip_spaces()
        if self.token in {"(", "{", "["}:
            argument = self.atom()
        else:  # \cos n\varphi: as far as letters and numbers go
            argument = self.factor()
            while self.token and (self.token.isalnum() or self.token.removeprefix("\\") in GREEK):
                argument *= self.factor()
        return FUNCTIONS[name](argument) ** exponent

    def name(self, alone: bool) -> sp.Expr:
        """Read a name, and the point at which it is taken, if there is one."""
        name = self.letter()
        if not alone:
            name += self.attachments()
        if alone or name in VARIABLES:
            return sp.Symbol(name)
        inside = self.point()
        if inside is None:
            return sp.Symbol(name)
        argument = parse(inside)
        return sp.Symbol(name) if argument == sp.Symbol("s") else sp.Function(name)(argument)

    def letter(self) -> str:
        token = self.token
        word = token.removeprefix("\\")
        if len(token) == 1 and token.isalpha():
            return self.take()
        if token.startswith("\\") and word in ACCENTED_MACROS:
            self.take()
            return ACCENTED_MACROS[word]
        if token.startswith("\\") and word in GREEK:
            self.take()
            return word
        if token.startswith("\\") and word in ACCENTS:
            self.take()
            braces = self.token == "{"
            if braces:
                self.take()
            letter = self.letter()
            if braces:
                self.take("}")
            return f"{word} {letter}"
        raise self.error(f"{token!r} is not known")

    def attachments(self) -> str:
        """Read primes, a subscript, and an exponent that is a word or a star."""
        text = ""
        while True:
            if self.token.startswith("'"):
                text += self.take()
            elif self.token == "_" and "_" not in text:
                self.take()
                text += f"_{self.label()}"
            elif self.token == "^" and self.labels_ahead():
                self.take()
                text += f"^{self.label()}"
            else:
                return text

    def labels_ahead(self) -> bool:
        """Tell whether the exponent that comes is a label: a star, or upright words."""
        place = 2 if self.ahead(1) == "{" else 1
        if self.ahead(place) in {"\\mathrm", "\\text"}:
            return self.ahead(place + 1) == "{" and self.ahead(place + 2) not in {"i", "j", "e"}
        return self.ahead(place) in {"*", "\\star", "\\ast"}

    def label(self) -> str:
        """Read a subscript as a word."""
        if self.token != "{":
            if self.token.removeprefix("\\") in UPRIGHT:
                word = self.upright()
                self.pass_name(word)
                return word
            return self.take().removeprefix("\\")
        end = closing(self.tokens, self.position)
        inner = self.tokens[self.position + 1 : end]
        self.position = end + 1
        words = [
            token.removeprefix("\\")
            for token in inner
            if token not in {"{", "}"} and token.removeprefix("\\") not in UPRIGHT
        ]
        return "".join(words)

    def point(self) -> list[str] | None:
        """Read a bracket that holds a point, such as (0) or (j\\omega), and nothing else."""
        start = self.position
        if self.token == "{" and self.ahead(1) == "(":  # as SymPy writes F(s)
            start += 1
        if start >= len(self.tokens) or self.tokens[start] != "(":
            return None
        end = closing(self.tokens, start)
        inside = [token for token in self.tokens[start + 1 : end] if token[1:] not in THIN_SPACE]
        if not POINT.fullmatch("".join(inside)):
            return None
        self.position = end + 1
        if start > 0 and self.tokens[start - 1] == "{" and self.token == "}":
            self.take()
        return inside


def is_map(factor: sp.Expr) -> bool:
    """Tell whether a factor is the name of a block or a map: these are written as capitals."""
    return bool(factor.is_Symbol) and factor.name.split()[-1][0].isupper()


def quotient(numerator: sp.Expr, denominator: sp.Expr) -> sp.Expr:
    """Divide; but E/R and the like is the name of a map."""
    above, below = str(numerator), str(denominator)
    if above in OUTPUTS and below in INPUTS:
        return sp.Symbol(f"{above.upper()}/{below}")
    return numerator / denominator
