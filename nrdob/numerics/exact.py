r"""Polynomials in whole numbers: what their coefficients prove about their roots.

A floating-point number is a whole number times a power of two, so a polynomial with such
coefficients is one in whole numbers, and Sturm's chains decide where its roots are without any
rounding (Gantmacher, The Theory of Matrices, vol. 2, 1959, ch. XV). Lists hold coefficients in
descending powers, the first one not zero.
"""

from __future__ import annotations

from itertools import pairwise, zip_longest
from math import gcd, nextafter, sqrt

from .arrays import FloatArray

__all__ = [
    "Whole", "multiply", "positive_sign_changes", "rhp_count", "sign_at", "squared_size",
    "total", "whole",
]  # fmt: skip

Whole = list[int]


def whole(*polynomials: FloatArray) -> list[Whole]:
    """Write polynomials in whole numbers, all multiplied by the same positive number."""
    ratios = [[c.as_integer_ratio() for c in p.tolist()] for p in polynomials]
    common = max(den for row in ratios for _, den in row)  # denominators are powers of two
    return [_stripped([num * (common // den) for num, den in row]) for row in ratios]


def total(a: Whole, b: Whole) -> Whole:
    """Add two polynomials."""
    return _stripped([x + y for x, y in zip_longest(a[::-1], b[::-1], fillvalue=0)][::-1])


def multiply(a: Whole, b: Whole) -> Whole:
    """Multiply two polynomials."""
    product = [0] * (len(a) + len(b) - 1) if a and b else []
    for i, x in enumerate(a):
        for k, y in enumerate(b):
            product[i + k] += x * y
    return product


def rhp_count(p: Whole) -> int | None:
    """Count the roots in the open right half plane, None if there are roots on the axis.

    Routh and Hurwitz's test: the real and the imaginary part of p(jω) make a Sturm chain, whose
    changes of sign at ω = ±∞ give the argument.
    """
    if not p[-1]:
        return None
    n = len(p) - 1
    # j^k c_k: signs + + - - for the powers k = 0, 1, 2, 3; either part has every other power only.
    signed = [-c if (n - i) % 4 >= 2 else c for i, c in enumerate(p)]
    every, other = ([0 if (i - first) % 2 else c for i, c in enumerate(signed)] for first in (0, 1))
    chain = sturm_chain(every, _stripped(other))
    index = _changes_at_infinity(chain, -1) - _changes_at_infinity(chain, 1)
    shared = chain[-1]  # holds the roots that come with their mirror image in the axis
    m = len(shared) - 1
    if m:
        own = sturm_chain(shared, _derivative(shared))
        if _changes_at_infinity(own, -1) != _changes_at_infinity(own, 1):
            return None
    turns = index if n % 2 else -index
    return (n - m - turns) // 2 + m // 2


def squared_size(p: Whole) -> Whole:
    """Return ``|p(jω)|²`` as a polynomial in x = ω²."""
    even, odd = ([(-1) ** i * c for i, c in enumerate(p[::-1][k::2])][::-1] for k in (0, 1))
    return total(multiply(even, even), [*multiply(odd, odd), 0])


def positive_sign_changes(p: Whole) -> list[tuple[float, int]]:
    """Find every x > 0 at which p changes its sign, and the sign beyond it.

    Each x is known to the last bit or two.
    """
    while p and not p[-1]:
        p = p[:-1]
    if len(p) < 2:
        return []
    low, high = 1 / _bound(p[::-1]), _bound(p)
    chain = sturm_chain(p, _derivative(p))
    found = []
    todo = [(low, _changes(chain, low), high, _changes(chain, high))]
    while todo:
        a, at_a, b, at_b = todo.pop()
        middle = _between(a, b)
        if at_a - at_b > 1 and a < middle < b:
            while not sign_at(p, middle):
                middle = nextafter(middle, b)
            inside = _changes(chain, middle)
            todo += [(middle, inside, b, at_b), (a, at_a, middle, inside)]
        elif at_a > at_b and (side := sign_at(p, b)) != sign_at(p, a):
            found.append((_bisect(p, a, b, side), side))
    return found


def sign_at(p: Whole, x: float) -> int:
    """Sign of p at a floating-point number, exactly."""
    num, den = x.as_integer_ratio()
    shift = den.bit_length() - 1
    value = 0
    for k, c in enumerate(p):
        value = value * num + (c << (k * shift))
    return (value > 0) - (value < 0)


def sturm_chain(a: Whole, b: Whole) -> list[Whole]:
    """Return a, b and Euclid's remainders with changed sign, the last one their divisor."""
    chain = [a]
    while b:
        chain.append(b)
        a, b = b, _negative_remainder(a, b)
    return chain


def _negative_remainder(a: Whole, b: Whole) -> Whole:
    lead, sign = abs(b[0]), 1 if b[0] > 0 else -1
    while len(a) >= len(b):
        factor = sign * a[0]
        pairs = zip_longest(a[1:], b[1:], fillvalue=0)
        a = _stripped([lead * x - factor * y for x, y in pairs])
    content = gcd(*a) if a else 1
    return [-x // content for x in a]


def _changes(chain: list[Whole], x: float) -> int:
    return _sign_changes([sign_at(p, x) for p in chain])


def _changes_at_infinity(chain: list[Whole], side: int) -> int:
    return _sign_changes([(1 if p[0] > 0 else -1) * side ** (len(p) - 1) for p in chain])


def _sign_changes(signs: list[int]) -> int:
    present = [sign for sign in signs if sign]
    return sum(a != b for a, b in pairwise(present))


def _bisect(p: Whole, a: float, b: float, side: int) -> float:
    """Halve (a, b), at whose end b the sign is `side`, to two neighbouring numbers."""
    while a < (middle := _between(a, b)) < b:
        if sign_at(p, middle) == side:
            b = middle
        else:
            a = middle
    return a if not sign_at(p, a) else b


def _between(a: float, b: float) -> float:
    return sqrt(a) * sqrt(b) if b > 2 * a else (a + b) / 2


def _bound(p: Whole) -> float:
    """Power of two beyond every root (Fujiwara)."""
    lead = p[0].bit_length()
    powers = [-((lead - 1 - c.bit_length()) // i) for i, c in enumerate(p[1:], 1) if c]
    return 2.0 ** (max(powers) + 1)


def _derivative(p: Whole) -> Whole:
    n = len(p) - 1
    return [c * (n - i) for i, c in enumerate(p[:-1])]


def _stripped(p: Whole) -> Whole:
    used = next((i for i, c in enumerate(p) if c), len(p))
    return p[used:]
