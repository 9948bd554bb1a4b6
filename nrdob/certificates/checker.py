"""Check a certificate of an NR-DOB loop with the standard library: ``python checker.py FILE``.

From the blocks it builds in exact fractions D_F = Df Dw, p_A = Dm Dc + Nm Nc and p_B =
D Nm (Df Dw - Nf Nw exp(-θm s)) + N Dm Nf Dw exp(-θ s), less what cancels inside its blocks; the
model is delayed by Nw/Dw exp(-θm s), a fraction where the loop is sampled. Between two points of
the imaginary axis f(jω) stays in an open half plane, by Taylor's formula; beyond the last one the
leading term dominates. So no root is on the axis, and how often f turns counts Z. What holds for
several processes or filters in the same half planes holds for their convex combinations. That the
blocks of a sampled loop are causal is not checked: c is not part of a certificate.
"""

import json
import re
import sys
from fractions import Fraction
from functools import reduce
from itertools import pairwise, product, zip_longest
from math import isqrt
from typing import Any

__all__ = ["build", "check", "times"]

Poly = list[Fraction]  # in descending powers
Terms = dict[Fraction, Poly]  # a sum of q(s) exp(-delay s), by delay
MOST = {"coefficients": 90, "points": 20_000}
ZERO, NUMBER = Fraction(0), re.compile(r"-?[0-9]+(/0*[1-9][0-9]*)?").fullmatch
SECTORS: list[Any] = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]


def check(certificate: Any) -> str:
    """Say in a sentence what a certificate proves; ValueError says why it proves nothing.

    Parameters
    ----------
    certificate : dict or list of dict
        As read from JSON; a list for intervals of the process's dead time that join.

    Returns
    -------
    str
        How many roots of each function are in the right half plane; of several processes or
        filters, for every convex combination of their numerators and denominators.
    """
    proofs = [prove(c) for c in (certificate if isinstance(certificate, list) else [certificate])]
    pairs = list(pairwise(proofs))  # joined by their dead times, or by a filter of both
    late = all(a[:2] == b[:2] and a[2] <= b[2] <= a[3] for a, b in pairs)
    chained = all((a[0], a[1][-1], *a[2:]) == (b[0], b[1][0], *b[2:]) for a, b in pairs)
    need(bool(proofs) and (late or chained), "there are no parts, or they do not join")
    ((verdict, counts, *_), _, low, _), (*_, high) = proofs[0], proofs[-1]
    ends = " to ".join(shown(x, low, high) for x in (low, high))
    each = f" for every dead time from {ends}" if low < high else ""
    parts = f" in {len(proofs)} parts that join" if len(proofs) > 1 else ""
    return f"Proved{parts}: the loop is {verdict}{each}. Roots with {counts}."


def prove(certificate: Any) -> tuple[Any, ...]:
    """Give what is proved of which blocks, the filters, the lowest and the highest dead time."""
    keys = "format version variable blocks within cancelled claim points"
    *kind, variable, given, within, cancelled, claims, points = members(certificate, keys)
    need(kind == ["nrdob certificate", 1], f"format and version are {kind}")
    need(variable in ("s", "w = c (z - 1)/(z + 1)"), "the variable is neither s nor w")
    processes, *others, filters = members(given, "process model model_delay controller filter")
    need(all(type(b) is list and 0 < len(b) < 65 for b in (processes, filters)), "give block lists")
    built = [build([G, *others, F], cancelled) for G, F in product(processes, filters)]
    (functions, factors, _, *ends), uneven = built[0], max(error for _, _, error, *_ in built)
    need(all(other[3:] == ends for other in map(list, built)), "dead times or signs of D differ")
    delay, model_delay, _ = ends
    need(len(filters) == 1 or not uneven, "with several filters only what is exact cancels")
    need(variable == "s" or delay == model_delay == 0, "a sampled loop has no dead times")
    need(0 <= (reach := read([within], "points")[0]) <= delay, "the dead time becomes negative")
    need(delay != model_delay or not reach, "cut the interval where the dead time is the model's")
    claims, points = (members(part, " ".join(functions)) for part in (claims, points))
    for (name, (f, power)), claim, chosen in zip(functions.items(), claims, points, strict=True):
        every = [f, *(other[name][0] for other, *_ in built if other[name][0] != f)]
        found = rhp_count(name, every, power, read(chosen, "points"), [delay, reach])
        need(str(found) == f"{claim!r}", f"{name} has {found} such roots, not {claim!r:.60}")
    counts = ", ".join(f"{name} {n}" for name, n in zip(functions, claims, strict=True))
    counts += f"; {factors} cancel inside its blocks, to {float(uneven):.0e}" if factors else ""
    verdict = "unstable" if any(claims) else "internally stable"
    verdict += f" for all blocks between {len(built)} corners" if len(built) > 1 else ""
    same = [*others, cancelled], [G | {"delay": 0} for G in processes]
    return (verdict, f"Re {variable} >= 0: {counts}", *same), filters, delay - reach, delay + reach


def shown(x: Fraction, low: Fraction, high: Fraction) -> str:  # short, if that is not beyond
    short = f"{float(x):g}"
    return short if low <= float(short) <= high else str(float(x))


def need(condition: bool, reason: str) -> None:
    if not condition:
        raise ValueError(reason)


def members(given: Any, keys: str) -> list[Any]:  # of an object with these keys and no others
    need(isinstance(given, dict) and set(given) == set(keys.split()), f"an object needs {keys}")
    return [given[key] for key in keys.split()]


def read(given: Any, kind: str = "coefficients") -> Poly:
    """Read a list of fractions such as ["1", "-3/4"]; the first coefficient is not 0."""
    need(isinstance(given, list) and 0 < len(given) <= MOST[kind], f"too many or no {kind}")
    for c in given:
        need(type(c) is str and len(c) <= 1000 and bool(NUMBER(c)), f"{c!r:.60} is no fraction")
    need(kind != "coefficients" or Fraction(given[0]) != 0, "a polynomial begins with 0")
    return [Fraction(c) for c in given]


def build(blocks: list[Any], inside: Any) -> tuple[Any, ...]:
    """Build the functions and the power of s divided out; what cancels, how well; dead times."""
    given = [members(block, "num den delay") for block in blocks]
    fractions = [(read(num), read(den)) for num, den, _ in given]
    (N, D), (Nm, Dm), (Nw, Dw), (Nc, Dc), (Nf, Df) = fractions
    delay, own, model_delay, *others = read([delay for *_, delay in given], "points")
    need(delay >= 0 and model_delay >= 0 and not any([own, *others]), "dead times")
    need(all(len(num) <= len(den) for num, den in fractions), "a block is not proper")
    need(len(Df + Nm) >= len(Dm + Nf) and Nf[-1] == Df[-1], "F/model not causal, or F(0) not 1")
    need(Nw[-1] == Dw[-1], "the model's delay has another gain than 1")
    p_A = total(times(Dm, Dc), times(Nm, Nc))
    need(len(p_A) == len(Dm) + len(Dc) - 1, "the model loop is ill-posed")
    zeros, poles = map(read, members(inside, "zeros poles"))
    (Nm, error), (built, other), power = divided(Nm, zeros), divided(Nf, zeros), 0
    late, Df = [-c for c in times(Nf, Nw)], times(Df, Dw)
    if model_delay:  # s^k, a factor of the sum, of which not every term has it
        power, rest = len(poles) - 1, {ZERO: Df, model_delay: late}
        need(not any(poles[1:]) and divided(Dm, poles)[1] == 0, "with a delay only s = 0 cancels")
        p_B = {t: times(D, Nm, q) for t, q in rest.items()}
        for values in (at_zero(rest, k) for k in range(power)):
            error = max(error, abs(sum(values, ZERO)) / (sum(map(abs, values), ZERO) or 1))
    else:
        (Dm, first), sizes = divided(Dm, poles), total(list(map(abs, Df)), list(map(abs, late)))
        E, second = divided(total(Df, late), poles, sizes)
        p_B, error = {ZERO: times(D, Nm, E)}, max(error, first, second)
    p_B[delay] = total(p_B.get(delay, []), times(N, Dm, built, Dw))
    degree = len(D + Nm + Df) - 2 - (len(poles) - power)
    need(len(p_B[ZERO]) - 1 == degree, "the observer loop is ill-posed")
    need(max(error, other) <= Fraction(1, 10**9), "what is said to cancel is no common factor")
    functions = {"D_F": ({ZERO: Df}, 0), "p_A": ({ZERO: p_A}, 0), "p_B": (p_B, power)}
    return functions, len(zeros) + len(poles) - 2, max(error, other), delay, model_delay, D[0] > 0


def rhp_count(name: str, functions: list[Terms], power: int, points: Poly, moved: Poly) -> int:
    """Count the roots of f(s)/s^power: f(jω) turns by n - power - 2 Z quarters, by Mikhailov."""
    steps, last, ends = list(pairwise(points)), points[-1], []
    need(points[0] == 0 and all(a < b for a, b in steps), f"points of {name} do not increase")
    need(not (power and moved[1]), f"{name} has roots at s = 0, and no one dead time")
    for f in functions:
        p, n = f[ZERO], len(f[ZERO]) - 1
        rest = size({t: q[1:] if q is p else q for t, q in f.items()}, last)
        need(abs(p[0]) * last**n > rest, f"the leading term of {name} does not dominate in the end")
        *zeros, first = (sum(at_zero(f, k), ZERO) for k in range(power + 1))
        need(not any(zeros) and first != 0, f"{name} has not as many roots at s = 0 as said")
        rise = size(derivative(f, power + 1), points[1]) * points[1] / (power + 1) if power else 0
        need(rise < abs(first), f"{name} is not proved to keep its first direction")
        ends.append((n, list(f), first > 0, p[0] > 0))
    need(all(end == ends[0] for end in ends), f"{name} changes degree, delay or sign")
    directions = [SECTORS[(2 * power + 4 * (first < 0)) % 8]]
    orders = [[derivative(f, k) for k in range(3)] for f in functions]
    for a, b in steps[power > 0 :]:
        directions.append(half_plane(orders, a, b, moved))
        need(any(directions[-1]), f"{name} is not proved to keep to a half plane at {float(a)}")
    directions.append(SECTORS[(2 * n + 4 * (p[0] < 0)) % 8])
    return (2 * (n - power) - sum(turn(c, d) for c, d in pairwise(directions))) // 4


def half_plane(orders: list[Any], a: Fraction, b: Fraction, moved: Poly) -> tuple[int, int]:
    """Give c with Re(conj(c) f) > 0 from ja to jb for every f, by Taylor's formula; or (0, 0)."""
    w, r, found, units = (a + b) / 2, (b - a) / 2, [], []
    for f, change, bend in orders:
        value, slope, slack = [ZERO, ZERO], [ZERO, ZERO], r * r * size(bend, b) / 2
        slack += min(moved[1] * b, Fraction(2)) * size({ZERO: f.get(moved[0], [])}, b)
        for t, q in f.items():
            cosine, sine, error = cosine_sine(t * w)
            for place, p, reach in ((value, q, 1), (slope, change[t], r)):
                x, y = on_axis(p, w)
                place[0] += x * cosine + y * sine
                place[1] += y * cosine - x * sine
                slack += 2 * error * reach * (abs(x) + abs(y))
        u, v = (round(part / (max(map(abs, value)) or 1) * 2**30) for part in value)
        units.append([part * 2**30 // (isqrt(u * u + v * v) or 1) for part in (u, v)])
        found.append((value, slope, slack))
    first, second = min(product(units, units), key=lambda z: z[0][0] * z[1][0] + z[0][1] * z[1][1])
    c, d = first[0] + second[0], first[1] + second[1]  # between the two furthest apart
    for value, slope, slack in found:  # along the axis f changes by j f'(jω)
        clear = c * value[0] + d * value[1] - r * abs(d * slope[0] - c * slope[1])
        if clear <= (isqrt(c * c + d * d) + 1) * slack:
            return 0, 0
    return c, d


def turn(c: Any, d: Any) -> int:
    """Eighths of a revolution from the sector of c to that of d, less than half a turn away."""
    cross = c[0] * d[1] - c[1] * d[0]
    need(cross != 0 or c[0] * d[0] + c[1] * d[1] > 0, "neighbouring half planes are opposite")
    a, b = (SECTORS.index(tuple((x > 0) - (x < 0) for x in z)) for z in (c, d))
    return (b - a) % 8 if cross > 0 else -((a - b) % 8)


def cosine_sine(x: Fraction) -> tuple[Fraction, Fraction, Fraction]:
    """Cosine and sine of x >= 0, and a bound on their errors: halved, summed up, doubled."""
    one = 1 << 192 + (halvings := int(x).bit_length() + 1)  # so that e stays far below 1
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
    x = y = ZERO  # p(jw)
    for c in p:
        x, y = c - y * w, x * w
    return x, y


def size(f: Terms, w: Fraction) -> Fraction:  # a bound of |f| on the imaginary axis up to jw
    return sum((abs(c) * w**k for q in f.values() for k, c in enumerate(reversed(q))), ZERO)


def at_zero(f: Terms, n: int) -> Poly:  # the terms of the n-th derivative
    return [q[-1] for q in derivative(f, n).values() if q]


def derivative(f: Terms, n: int) -> Terms:
    for _ in range(n):
        inner = {t: [c * k for k, c in enumerate(q[-2::-1], 1)][::-1] for t, q in f.items()}
        f = {t: total(inner[t], [-t * c for c in q]) for t, q in f.items()}
    return f


def times(p: Poly, *others: Poly) -> Poly:
    """Multiply polynomials."""
    for q in others:
        p = reduce(total, [[c * d for d in q] + [ZERO] * k for k, c in enumerate(reversed(p))])
    return p


def total(p: Poly, q: Poly) -> Poly:  # without leading zeros
    both = [x + y for x, y in zip_longest(reversed(p), reversed(q), fillvalue=ZERO)]
    return both[::-1][next((k for k, c in enumerate(reversed(both)) if c), len(both)) :]


def divided(p: Poly, q: Poly, whole: Poly | None = None) -> tuple[Poly, Fraction]:
    """Divide p by q: the quotient, and how large the rest is, power by power, against its terms."""
    need(len(p) >= len(q), "a cancelled factor has too many roots")
    rest, quotient = list(p), []
    for i in range(len(p) - len(q) + 1):
        quotient.append(rest[i] / q[0])
        rest[i : i + len(q)] = [x - quotient[-1] * c for x, c in zip(rest[i:], q, strict=False)]
    sizes = times(list(map(abs, q)), list(map(abs, quotient)))
    sizes = total(sizes, list(map(abs, whole or p)))
    pairs = zip(reversed(rest), reversed(sizes), strict=False)
    return quotient, max(abs(c) / (size or 1) for c, size in pairs)


def once(pairs: list[Any]) -> Any:
    need(len(dict(pairs)) == len(pairs), "a name is given twice in an object")
    return dict(pairs)


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1] in ("-h", "--help"):
        sys.exit("usage: python checker.py certificate.json, one certificate at a time")
    try:
        with open(sys.argv[1], encoding="utf-8") as file:
            print(check(json.load(file, object_pairs_hook=once)))
    except (OSError, ValueError, OverflowError, RecursionError) as reason:
        sys.exit(f"Not proved: {reason}")
