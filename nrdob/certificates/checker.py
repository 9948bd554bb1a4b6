"""Check a certificate of an NR-DOB loop with the standard library: ``python checker.py FILE``.

From the blocks it builds in exact fractions D_F, the filter's denominator, p_A = Dm Dc + Nm Nc and
p_B = D Nm (Df - Nf exp(-θm s)) + N Dm Nf exp(-θ s), less what cancels inside its blocks. Between
two points of the imaginary axis f(jω) stays in an open half plane, by Taylor's formula; beyond the
last one the leading term dominates. So no root is on the axis, and how often f turns counts Z.
"""

import json
import re
import sys
from fractions import Fraction
from functools import reduce
from itertools import pairwise, zip_longest
from math import isqrt
from typing import Any

__all__ = ["check"]

Poly = list[Fraction]  # in descending powers
Terms = dict[Fraction, Poly]  # a sum of q(s) exp(-delay s), by delay
MOST = {"coefficients": 60, "points": 20_000, "digits": 1_000}
ZERO, NUMBER = Fraction(0), re.compile(r"-?[0-9]+(/0*[1-9][0-9]*)?").fullmatch
SECTORS: list[Any] = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]


def check(certificate: Any) -> str:
    """Say in a sentence what a certificate proves.

    Parameters
    ----------
    certificate : dict
        As read from JSON.

    Returns
    -------
    str
        How many roots of each function are in the right half plane.

    Raises
    ------
    ValueError
        If it does not prove what it claims; the message says what is missing.
    """
    parts = members(certificate, "format version blocks cancelled claim points")
    need(parts[:2] == ["nrdob certificate", 1], f"format and version are {parts[:2]}")
    functions, cancelled, uneven = build(*parts[2:4])
    claims, points = (members(part, " ".join(functions)) for part in parts[4:])
    for (name, f), claim, given in zip(functions.items(), claims, points, strict=True):
        found = rhp_count(name, *f, read(given, "points"))
        need(str(found) == f"{claim!r}", f"{name} has {found} such roots, not {claim!r:.60}")
    counts = ", ".join(f"{name} {n}" for name, n in zip(functions, claims, strict=True))
    rest = f"; {cancelled} cancel inside its blocks, to {float(uneven):.0e}" if cancelled else ""
    verdict = "unstable" if any(claims) else "internally stable"
    return f"Proved: the loop is {verdict}. Roots with Re s >= 0: {counts}{rest}."


def need(condition: bool, reason: str) -> None:
    """Refuse the certificate unless `condition` holds."""
    if not condition:
        raise ValueError(reason)


def members(given: Any, keys: str) -> list[Any]:
    """Take an object apart that has these keys and no others."""
    need(isinstance(given, dict) and set(given) == set(keys.split()), f"an object needs {keys}")
    return [given[key] for key in keys.split()]


def read(given: Any, kind: str = "coefficients") -> Poly:
    """Read a list of fractions such as ["1", "-3/4"]; the first coefficient is not 0."""
    need(isinstance(given, list) and 0 < len(given) <= MOST[kind], f"too many or no {kind}")
    for c in given:
        fits = isinstance(c, str) and len(c) <= MOST["digits"] and NUMBER(c)
        need(bool(fits), f"{c!r:.60} is no fraction such as '-3/4'")
    need(kind != "coefficients" or Fraction(given[0]) != 0, "a polynomial begins with 0")
    return [Fraction(c) for c in given]


def build(blocks: Any, inside: Any) -> tuple[dict[str, tuple[Terms, int]], int, Fraction]:
    """Build the functions, each with the power of s divided out; what cancels, and how well."""
    four = members(blocks, "process model controller filter")
    given = [members(block, "num den delay") for block in four]
    fractions = [(read(num), read(den)) for num, den, _ in given]
    (N, D), (Nm, Dm), (Nc, Dc), (Nf, Df) = fractions
    delay, model_delay, *others = read([delay for *_, delay in given], "points")
    need(delay >= 0 and model_delay >= 0 and not any(others), "dead times")
    need(all(len(num) <= len(den) for num, den in fractions), "a block is not proper")
    need(len(Df + Nm) >= len(Dm + Nf) and Nf[-1] == Df[-1], "F/model not causal, or F(0) not 1")
    p_A = total(times(Dm, Dc), times(Nm, Nc))
    need(len(p_A) == len(Dm) + len(Dc) - 1, "the model loop is ill-posed")
    zeros, poles = map(read, members(inside, "zeros poles"))
    (Nm, error), (built, other), power = divided(Nm, zeros), divided(Nf, zeros), 0
    if model_delay:  # s^k, a factor of the sum, of which not every term has it
        power = len(poles) - 1
        need(not any([*poles[1:], *Dm[len(Dm) - power :]]), "with a delay only s = 0 cancels")
        p_B = {ZERO: times(D, Nm, Df), model_delay: times([Fraction(-1)], D, Nm, Nf)}
    else:
        (Dm, first), (E, second) = divided(Dm, poles), divided(total(Df, [-c for c in Nf]), poles)
        p_B, error = {ZERO: times(D, Nm, E)}, max(error, first, second)
    p_B[delay] = total(p_B.get(delay, []), times(N, Dm, built))
    degree = len(D + Nm + Df) - 2 - (len(poles) - power)
    need(len(p_B[ZERO]) - 1 == degree, "the observer loop is ill-posed")
    need(max(error, other) <= Fraction(1, 10**9), "what is said to cancel is no common factor")
    functions = {"D_F": ({ZERO: Df}, 0), "p_A": ({ZERO: p_A}, 0), "p_B": (p_B, power)}
    return functions, len(zeros) + len(poles) - 2, max(error, other)


def rhp_count(name: str, f: Terms, power: int, points: Poly) -> int:
    """Count the roots of f(s)/s^power in the right half plane, from the half planes of f(jω)."""
    p, n, last, steps = f[ZERO], len(f[ZERO]) - 1, points[-1], list(pairwise(points))
    need(points[0] == 0 and bool(steps) and all(a < b for a, b in steps), f"points of {name}")
    rest = size({t: q[1:] if q is p else q for t, q in f.items()}, last)
    need(abs(p[0]) * last**n > rest, f"the leading term of {name} does not dominate beyond {last}")
    at_zero = [[q[-1] for q in derivative(f, k).values() if q] for k in range(power + 1)]
    *zeros, first = (sum(values, ZERO) for values in at_zero)
    need(not any(zeros) and first != 0, f"{name} has another number of roots at s = 0 than said")
    directions = [SECTORS[(2 * power + 4 * (first < 0)) % 8]]
    if power:
        rise = size(derivative(f, power + 1), points[1]) * points[1] / (power + 1)
        need(rise < abs(first), f"{name} is not proved to keep its first direction")
    change, bend = derivative(f, 1), derivative(f, 2)
    for a, b in steps[power > 0 :]:
        c = half_plane(f, change, (b - a) / 2, (a + b) / 2, size(bend, b))
        need(any(c), f"{name} is not proved to stay in a half plane on [{float(a)}, {float(b)}]")
        directions.append(c)
    directions.append(SECTORS[(2 * n + 4 * (p[0] < 0)) % 8])
    # Mikhailov: f turns by n - power - 2 Z quarters of a revolution, from ω = 0 to infinity.
    return (2 * (n - power) - sum(turn(c, d) for c, d in pairwise(directions))) // 4


def half_plane(f: Terms, change: Terms, r: Fraction, w: Fraction, bend: Fraction) -> Any:
    """Give c with Re(conj(c) f) > 0 from j(w - r) to j(w + r), by Taylor's formula; or (0, 0)."""
    value, slope, slack = [ZERO, ZERO], [ZERO, ZERO], r * r * bend / 2
    for t, q in f.items():
        cosine, sine, error = cosine_sine(t * w)
        for place, p, reach in ((value, q, 1), (slope, change[t], r)):
            x, y = on_axis(p, w)
            place[0] += x * cosine + y * sine
            place[1] += y * cosine - x * sine
            slack += 2 * error * reach * (abs(x) + abs(y))
    c, d = (round(part / (max(map(abs, value)) or 1) * 2**30) for part in value)
    clear = c * value[0] + d * value[1] - r * abs(d * slope[0] - c * slope[1])  # of j f'(jω)
    return (c, d) if clear > (isqrt(c * c + d * d) + 1) * slack else (0, 0)


def turn(c: Any, d: Any) -> int:
    """Eighths of a revolution from the sector of c to that of d, less than half a turn away."""
    cross = c[0] * d[1] - c[1] * d[0]
    need(cross != 0 or c[0] * d[0] + c[1] * d[1] > 0, "neighbouring half planes are opposite")
    a, b = (SECTORS.index(tuple((x > 0) - (x < 0) for x in z)) for z in (c, d))
    return (b - a) % 8 if cross > 0 else -((a - b) % 8)


def cosine_sine(x: Fraction) -> tuple[Fraction, Fraction, Fraction]:
    """Cosine and sine of x >= 0, and a bound on their errors: halved, summed up, doubled."""
    halvings, one = int(x).bit_length() + 1, 1 << 192
    y = x.numerator * one // (x.denominator << halvings)  # below 1/2, less than 1 too small
    term, parts, k = one, [one, 0], 0
    while term:  # (jy)^k/k!, each known to 4: what it is rounded by, and what y is
        k += 1
        term = term * y // one // k
        parts[k % 2] += term if k % 4 < 2 else -term
    for _ in range(halvings):  # an error e of z makes one of 2e + e² + 2 in z²
        parts = [(parts[0] ** 2 - parts[1] ** 2) // one, 2 * parts[0] * parts[1] // one]
    return Fraction(parts[0], one), Fraction(parts[1], one), Fraction(8 * k + 8 << halvings, one)


def on_axis(p: Poly, w: Fraction) -> tuple[Fraction, Fraction]:
    """Evaluate p(jw)."""
    x = y = ZERO
    for c in p:
        x, y = c - y * w, x * w
    return x, y


def size(f: Terms, w: Fraction) -> Fraction:
    """Bound |f| on the imaginary axis up to w."""
    return sum((abs(c) * w**k for q in f.values() for k, c in enumerate(reversed(q))), ZERO)


def derivative(f: Terms, n: int) -> Terms:
    """Differentiate f n times."""
    for _ in range(n):
        inner = {t: [c * k for k, c in enumerate(q[-2::-1], 1)][::-1] for t, q in f.items()}
        f = {t: total(inner[t], [-t * c for c in q]) for t, q in f.items()}
    return f


def times(p: Poly, *others: Poly) -> Poly:
    """Multiply polynomials."""
    for q in others:
        p = reduce(total, [[c * d for d in q] + [ZERO] * k for k, c in enumerate(reversed(p))])
    return p


def total(p: Poly, q: Poly) -> Poly:
    """Add polynomials, without leading zeros."""
    both = [x + y for x, y in zip_longest(reversed(p), reversed(q), fillvalue=ZERO)]
    return both[::-1][next((k for k, c in enumerate(reversed(both)) if c), len(both)) :]


def divided(p: Poly, q: Poly) -> tuple[Poly, Fraction]:
    """Divide p by q: the quotient, and how large the rest is against the coefficients of p."""
    need(len(p) >= len(q), "a cancelled factor has too many roots")
    rest, quotient = list(p), []
    for i in range(len(p) - len(q) + 1):
        quotient.append(rest[i] / q[0])
        rest[i : i + len(q)] = [x - quotient[-1] * c for x, c in zip(rest[i:], q, strict=False)]
    return quotient, max(map(abs, rest)) / max(map(abs, p))


if __name__ == "__main__":
    try:
        with open(sys.argv[1], encoding="utf-8") as file:
            print(check(json.load(file)))
    except (IndexError, OSError, ValueError, RecursionError) as reason:
        sys.exit(f"Not proved: {reason}")
