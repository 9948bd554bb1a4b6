r"""Transfer functions as one writes them: ``4/(s^2+3s+2)*exp(-0.3s)``.

A small grammar of numbers, s, sums, products (also without a sign between them), quotients, whole
powers and the dead time ``exp(-T s)``, or as a report prints them, ``s²`` and ``e^(−T s)``; nothing
in a text is ever run.

.. code-block:: text

    sum     = term {("+" | "-") term}
    term    = factor {["*" | "/"] factor}          (a sign is needed after a quotient)
    factor  = ["+" | "-"] factor | atom [("^" | "**") ["+" | "-"] whole number]
    atom    = number | "s" | "(" sum ")" | "exp" "(" sum ")"
"""

from __future__ import annotations

import re
from functools import reduce
from typing import NamedTuple
from unicodedata import normalize

import numpy as np

from ..diagram import DelayedTransferFunction
from ..numerics import FloatArray, add

__all__ = ["read_block"]

# Characters of a text, brackets within brackets, degree of a polynomial.
LONGEST, DEEPEST, HIGHEST = 1000, 40, 40
TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<exp>exp)|(?P<s>s)"
    r"|(?P<sign>\*\*|[-+*/^()])|(?P<other>\S.{0,9}))"
)
PRINTED = str.maketrans("−·", "-*")  # how a report writes what is typed as - and *
RAISED = re.compile("[⁰¹²³⁴⁵⁶⁷⁸⁹]+")


class _Value(NamedTuple):
    """A fraction times exp(-delay s)."""

    num: FloatArray
    den: FloatArray
    delay: float = 0.0


ONE = _Value(np.ones(1), np.ones(1))


def read_block(text: str, name: str = "the block") -> DelayedTransferFunction:
    """Read a transfer function out of a text.

    Parameters
    ----------
    text : str
        Such as "2(1-s)/(s^2+3s+2)*exp(-0.3s)".
    name : str
        What it is called in messages.

    Raises
    ------
    ValueError
        If the text is no transfer function; the message says where.

    Examples
    --------
    >>> read_block("4/(s^2+3s+2)*exp(-0.3s)")
    DelayedTransferFunction(([4.0], [1.0, 3.0, 2.0]), delay=0.3)
    >>> read_block("2 exp(-s")
    Traceback (most recent call last):
    ValueError: the block, "2 exp(-s": a bracket is not closed
    """
    shown = f'{name}, "{text if len(text) <= 60 else text[:60] + "…"}"'
    try:
        if len(text) > LONGEST:
            raise ValueError(f"it has {len(text)} characters, at most {LONGEST} are read")
        value = _Reader(_typed(text)).read()
        if value.delay < 0:
            raise ValueError("exp(+T s) would predict the future; a dead time is exp(-T s)")
        with np.errstate(over="ignore"):
            found = _checked(value.num / value.den[0], value.den / value.den[0], value.delay)
        return DelayedTransferFunction(found[:2], found.delay)
    except ValueError as error:
        raise ValueError(f"{shown}: {error}") from None


def _typed(text: str) -> str:
    """Write what a report has printed as one types it."""
    text = re.sub(r"\be\^(?=\()", "exp", text.translate(PRINTED))
    return RAISED.sub(lambda found: "^" + normalize("NFKC", found[0]), text)


class _Reader:
    """Recursive descent over the tokens of one text."""

    def __init__(self, text: str) -> None:
        found = (match.groupdict().items() for match in TOKEN.finditer(text))
        self._tokens = [(kind, part) for groups in found for kind, part in groups if part]
        if rest := next((part.strip() for kind, part in self._tokens if kind == "other"), ""):
            raise ValueError(f"what is {rest!r}? Write it with s, numbers, + - * / ^ and exp")
        self._tokens.append(("end", ""))
        self._at = self._depth = 0

    def read(self) -> _Value:
        if len(self._tokens) == 1:
            raise ValueError("it is empty; write a transfer function such as 4/(s^2+3s+2)")
        value = self._sum()
        kind, text = self._tokens[self._at]
        if kind != "end":
            raise ValueError(f"{text!r} stands where nothing may follow")
        return value

    def _next(self, *wanted: str) -> str | None:
        """Take the next token if it is one of these."""
        text = self._tokens[self._at][1]
        if text not in wanted:
            return None
        self._at += 1
        return text

    def _sum(self) -> _Value:
        value = self._term()
        while sign := self._next("+", "-"):
            value = _plus(value, self._term(), -1.0 if sign == "-" else 1.0)
        return value

    def _term(self) -> _Value:
        value, divided = self._factor(), False
        while True:
            sign = self._next("*", "/")
            if sign is None:
                kind, text = self._tokens[self._at]
                if kind == "end" or (kind == "sign" and text != "("):
                    return value
                if kind == "number" and self._tokens[self._at - 1][0] in ("s", "number"):
                    raise ValueError(
                        f"{text!r} stands right behind {self._tokens[self._at - 1][1]!r}: write a "
                        "power with ^, as s^2, and a product with *"
                    )
                if divided and kind != "exp":
                    raise ValueError(
                        "after a quotient a product needs a sign or brackets: 1/(s+1)/(s+2), or "
                        "(s+2)/(s+1), but not 1/(s+1)(s+2)"
                    )
            divided = sign == "/"
            other = self._factor()
            value = _over(value, other) if sign == "/" else _times(value, other)

    def _factor(self) -> _Value:
        self._deeper()
        if sign := self._next("+", "-"):
            value = self._factor()
            value = value._replace(num=-value.num) if sign == "-" else value
        else:
            value = self._atom()
            if self._next("^", "**"):
                value = _power(value, self._whole())
        self._depth -= 1
        return value

    def _whole(self) -> int:
        sign = -1 if self._next("-", "+") == "-" else 1
        if self._next("("):
            self._deeper()
            power = self._whole()
            self._close()
            self._depth -= 1
            return sign * power
        kind, text = self._tokens[self._at]
        if kind != "number" or not text.isdigit() or len(text) > 3:
            raise ValueError(
                f"{text or 'nothing'!r} is no power; a power is a whole number, such as s^2"
            )
        self._at += 1
        return sign * int(text)

    def _atom(self) -> _Value:
        kind, text = self._tokens[self._at]
        if kind == "end":
            raise ValueError("it breaks off; something must follow")
        self._at += 1
        if kind == "number":
            return ONE._replace(num=np.array([float(text)]))
        if kind == "s":
            return ONE._replace(num=np.array([1.0, 0.0]))
        if kind == "exp":
            if not self._next("("):
                raise ValueError("exp needs a bracket: exp(-0.3 s)")
            return _dead_time(self._bracket())
        if text == "(":
            return self._bracket()
        raise ValueError(f"{text!r} stands where a number, s or a bracket must")

    def _bracket(self) -> _Value:
        value = self._sum()
        self._close()
        return value

    def _close(self) -> None:
        if not self._next(")"):
            raise ValueError("a bracket is not closed")

    def _deeper(self) -> None:
        self._depth += 1
        if self._depth > DEEPEST:
            raise ValueError(f"it has more than {DEEPEST} brackets or signs within each other")


def _times(a: _Value, b: _Value) -> _Value:
    return _checked(np.convolve(a.num, b.num), np.convolve(a.den, b.den), a.delay + b.delay)


def _over(a: _Value, b: _Value) -> _Value:
    if not b.num.any():
        raise ValueError("something is divided by zero")
    return _times(a, _Value(b.den, b.num, -b.delay))


def _plus(a: _Value, b: _Value, sign: float) -> _Value:
    if abs(a.delay - b.delay) > 1e-12 * max(abs(a.delay), abs(b.delay)):
        raise ValueError(
            f"terms with dead times {a.delay:g} and {b.delay:g} are added: only one dead time, of "
            "the whole, can be dealt with"
        )
    if np.array_equal(a.den, b.den):
        return _checked(add(a.num, sign * b.num), a.den, a.delay)
    num = add(np.convolve(a.num, b.den), sign * np.convolve(b.num, a.den))
    return _checked(num, np.convolve(a.den, b.den), a.delay)


def _power(value: _Value, power: int) -> _Value:
    degree = max(value.num.size, value.den.size) - 1
    if abs(power) * max(degree, 1) > HIGHEST:
        raise ValueError(f"the power {power} makes a degree above {HIGHEST}")
    result = reduce(_times, [value] * abs(power), ONE)
    return _over(ONE, result) if power < 0 else result


def _dead_time(value: _Value) -> _Value:
    num = np.trim_zeros(value.num, "f")
    if value.delay or value.den.size != 1 or num.size > 2 or (num.size and num[-1]):
        if num.size == 1 and value.den.size == 1 and not value.delay:
            raise ValueError("exp of a number is no dead time; write exp(-T s), such as exp(-0.3s)")
        raise ValueError("exp may hold nothing but -T s, such as exp(-0.3s)")
    return ONE._replace(delay=-float(num[0] / value.den[0]) if num.size else 0.0)


def _checked(num: FloatArray, den: FloatArray, delay: float) -> _Value:
    num, den = (np.trim_zeros(p, "f") if p.any() else np.zeros(1) for p in (num, den))
    if max(num.size, den.size) - 1 > HIGHEST:
        raise ValueError(f"its degree is above {HIGHEST}")
    if not (np.isfinite(num).all() and np.isfinite(den).all()):
        raise ValueError("its coefficients overflow; write it in other units")
    return _Value(num, den, delay)
