"""Margins of random loops against oracles that share no code with them.

`python -m tests.campaigns.margins --count 5000 --seed 0`

Every loop is swept: the blocks are evaluated as they were given, without multiplying any two of
them, on frequencies that close in on every root of every block and of both characteristic
functions; what decides is then looked at ever closer, in long doubles. Hard loops without dead time
have a certified oracle as well: coefficients as exact fractions, polynomials in ω² in integers,
their real roots enclosed in balls.
"""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from functools import reduce

import control as ct
import flint
import numpy as np

import nrdob
from nrdob.analysis import Margins
from nrdob.diagram import Quotient
from tests.oracles.plain import Block, Plain
from tests.oracles.sweep import loop_gains, swept

from .runner import print_tally

HARD = ("detuned", "spread", "integrating", "lags", "resonant")
ORDERS = ("order lags", "order resonant", "order integrator", "order right zero", "order unstable")
FAMILIES = (*HARD, *ORDERS)


def random_hard_loop(rng: np.random.Generator, family: str, *, delayed: bool = False):
    """Draw a loop of one family, often stable."""
    lags = 10 ** rng.uniform(-1, 1, int(rng.integers(1, 3)))
    G = Gm = _lags(lags)
    if family == "detuned":
        zeta, omega = 10 ** rng.uniform(-6, -2), 10 ** rng.uniform(-1, 1)
        d = 1 + zeta * rng.uniform(-6, 6)
        G = (_mode(omega * d, zeta * rng.uniform(0.3, 3)), np.polymul(G[1], _mode(omega, zeta)))
    elif family == "spread":
        spread = 10 ** rng.uniform(-7, 3, int(rng.integers(1, 4)))
        G, Gm = _lags(np.append(lags, spread)), _lags(np.append(lags, spread[:1]))
    elif family == "integrating":
        slow = 10 ** rng.uniform(-4, -1)
        G, Gm = (G[0], np.append(G[1], 0.0)), (Gm[0], np.polymul(Gm[1], [1, slow]))
    elif family == "lags":
        lags = 10 ** rng.uniform(-10, -8) * rng.uniform(1, 3, int(rng.integers(3, 7)))
        G, Gm = _lags(lags), _lags(lags * rng.uniform(0.8, 1.2))
    else:
        zeta, omega = 10 ** rng.uniform(-7, -1), 10 ** rng.uniform(-1, 1)
        G = (10 ** rng.uniform(-2, 0) * np.ones(1), np.polymul(G[1], _mode(omega, zeta)))
    G = (10 ** rng.uniform(-0.5, 0.5) * G[0], G[1])
    process = ct.tf(*G)
    slowest = float(np.max(np.abs(1 / np.roots(Gm[1]))))
    if delayed:
        process = nrdob.delay(slowest * 10 ** rng.uniform(-2, 1)) * process
    order = max(1, Gm[1].size - Gm[0].size) + int(rng.integers(0, 2))
    C = ([10 ** rng.uniform(-2, 0.5)] * 2, [slowest, 0.0])
    return nrdob.NRDOB(
        process,
        ct.tf(*Gm),
        ct.tf(*C),
        nrdob.LowPassFilter(slowest * 10 ** rng.uniform(-1, 1.5), order),
    )


def random_loop_of_order(rng: np.random.Generator, family: str, *, delayed: bool = False):
    """Draw a loop whose process is of order 3 to 12, in any unit of time over eight decades."""
    order, unit = int(rng.integers(3, 13)), 10 ** rng.uniform(-4, 4)
    spread = 10 ** rng.uniform(-2, 0)  # lags nearly equal, or over a decade
    lags = unit * 10 ** rng.uniform(-spread / 2, spread / 2, order)
    num, known = np.ones(1), lags * rng.uniform(0.85, 1.15, order)
    den, model = (_lags(each)[1] for each in (lags, known))
    if family == "order resonant":
        zeta, omega = 10 ** rng.uniform(-4, -0.5), 10 ** rng.uniform(-1, 1) / unit
        mode = _mode(omega, zeta)
        num = _mode(omega * (1 + zeta * rng.uniform(-3, 3)), zeta * rng.uniform(0.3, 3))
        num = num if rng.random() < 0.5 else 10 ** rng.uniform(-2, 0) * np.ones(1)
        den = np.polymul(_lags(lags[2:])[1] if order > 3 else _lags(lags[:1])[1], mode)
        model = _lags(known[: den.size - num.size])[1]
    elif family == "order integrator":
        den = np.append(_lags(lags[1:])[1] * unit, 0.0)
        slow = 10 ** rng.uniform(-3, 0) * (rng.random() < 0.7)
        model = np.polymul(_lags(known[1:])[1] * unit, [1.0, slow / unit])
    elif family == "order right zero":
        num = np.array([-unit * 10 ** rng.uniform(-2, 0.3), 1.0])
        model = _lags(known[1:])[1]
    elif family == "order unstable":
        den = np.polymul(_lags(lags[1:])[1], [-unit * 10 ** rng.uniform(-0.5, 1), 1.0]) * -1.0
    gain = 10 ** rng.uniform(-0.3, 0.3)
    process = ct.tf(gain * num, den)
    if delayed:
        process = nrdob.delay(unit * 10 ** rng.uniform(-2, 1)) * process
    C = ct.tf([10 ** rng.uniform(-2, 0)] * 2, [order * unit, 0.0])
    low = -3 if family == "order unstable" else -0.5
    constant = unit * 10 ** rng.uniform(low, 1.5 if low > -1 else -1)
    return nrdob.NRDOB(
        process, ct.tf([1.0], model), C, nrdob.LowPassFilter(constant, model.size - 1)
    )


def _lags(lags) -> tuple[np.ndarray, np.ndarray]:
    return np.ones(1), reduce(np.polymul, [[lag, 1.0] for lag in lags], np.ones(1))


def _mode(omega: float, zeta: float) -> np.ndarray:
    return np.array([1 / omega**2, 2 * zeta / omega, 1.0])


# Without dead time: everything exact.


def certified(loop: Quotient) -> tuple[float, float, float, float]:
    """Return (sm, pm, gm_low, gm_high) of a stable rational loop, without rounding.

    The factors' coefficients are taken as they are; only pm and the evaluation at certified
    frequencies, in 400 bits, are not exact.
    """
    num, den = (reduce(lambda a, b: a * b, map(_exact, fs)) for fs in (loop.num, loop.den))
    (ne, no), (de, do), (pe, po) = map(_even_odd, (num, den, num + den))
    x = flint.fmpq_poly([0, 1])
    n2, d2, p2 = (e * e + x * o * o for e, o in ((ne, no), (de, do), (pe, po)))

    def value(at: flint.arb) -> flint.acb:
        w = at.sqrt()
        top, bottom = (flint.acb(_at(e, at), w * _at(o, at)) for e, o in ((ne, no), (de, do)))
        return top / bottom

    tops = [1 + value(at) for at in _positive_roots(p2.derivative() * d2 - p2 * d2.derivative())]
    ends = [e for e in (_at_zero(num, den), _at_infinity(num, den)) if e is not None]
    sm = min([float(abs(z)) for z in tops] + [abs(1 + e) for e in ends])
    turns = [float(abs((-value(at)).arg())) for at in _positive_roots(n2 - d2)]
    real = [value(at).real for at in _positive_roots(no * de - ne * do)]
    gains = [-1 / float(z) for z in real if z < 0] + [-1 / e for e in ends if e < 0]
    pm = float(np.degrees(min(turns, default=np.inf)))
    low = max([g for g in gains if g < 1], default=0.0)
    return sm, pm, low, min([g for g in gains if g > 1], default=np.inf)


def _exact(factor) -> flint.fmpq_poly:
    ratios = [Fraction(c).as_integer_ratio() for c in factor.q[::-1].tolist()]
    return flint.fmpq_poly([flint.fmpq(*ratio) for ratio in ratios])


def _even_odd(p: flint.fmpq_poly) -> tuple[flint.fmpq_poly, flint.fmpq_poly]:
    c = p.coeffs()
    return tuple(flint.fmpq_poly([(-1) ** k * v for k, v in enumerate(c[i::2])]) for i in (0, 1))


def _positive_roots(p: flint.fmpq_poly) -> list[flint.arb]:
    if p.degree() < 1:
        return []
    roots = [root for root, _ in p.numer().complex_roots()]
    return [root.real for root in roots if root.imag == 0 and root.real > 0]


def _at(p: flint.fmpq_poly, x: flint.arb) -> flint.arb:
    total = flint.arb(0)
    for c in reversed(p.coeffs()):
        total = total * x + flint.arb(c)
    return total


def _at_zero(num: flint.fmpq_poly, den: flint.fmpq_poly) -> float | None:
    a, b = num[0], den[0]
    return None if b == 0 else float(Fraction(int(a.p), int(a.q)) / Fraction(int(b.p), int(b.q)))


def _at_infinity(num: flint.fmpq_poly, den: flint.fmpq_poly) -> float:
    if num.degree() < den.degree():
        return 0.0
    a, b = num[num.degree()], den[den.degree()]
    return float(Fraction(int(a.p), int(a.q)) / Fraction(int(b.p), int(b.q)))


def differs(found: Margins, loop: Quotient) -> str:
    """Name the margins that differ from the certified ones; empty if none does."""
    wrong = []
    names = ("sm", "pm", "gm_low", "gm_high")
    for name, true in zip(names, certified(loop), strict=True):
        got = getattr(found, name)
        if not np.isclose(got, true, rtol=1e-5, atol=1e-9):
            wrong.append(f"{name} {got:.9g} for {true:.9g}")
    return "; ".join(wrong)


# With and without dead time: a sweep in long doubles.

FIGURES = ("ms", "pm", "gm_low", "gm_high", "delay_margin", "disk_margin")


def missed(found: Margins, gain, omega: np.ndarray, rtol: float = 1e-6) -> str:
    """Name the figures that differ from those of the sweep; empty if none does."""
    true, wrong = swept(gain, omega), []
    for name in FIGURES:
        got, want = getattr(found, name), true[name]
        if not (np.isclose(got, want, rtol=rtol, atol=1e-12) or min(got, want) > 1e9):
            wrong.append(f"{name} {got:.9g} for {want:.9g}")
    return "; ".join(wrong)


def blocks_of(loop: nrdob.NRDOB) -> Plain:
    """The blocks as they were given."""
    given = getattr(loop.process, "tf", loop.process), loop.model, loop.controller, loop.filter.tf
    blocks = (Block(G.num_array[0, 0], G.den_array[0, 0]) for G in given)
    return Plain(*blocks, loop.delay)


def run(count: int, seed: int, *, show: bool = True) -> Counter[str]:
    """Compare `count` random loops; return how many margins were compared and how many differ."""
    rng, tally = np.random.default_rng(seed), Counter()
    for i in range(count):
        family, delayed = FAMILIES[i % len(FAMILIES)], bool(i // len(FAMILIES) % 2)
        draw = random_hard_loop if family in HARD else random_loop_of_order
        loop = draw(rng, family, delayed=delayed)
        every = loop.margins()
        if every.stable:
            tally["loops stable as a whole"] += 1
        for name, (gain, omega) in loop_gains(blocks_of(loop)).items():
            found = getattr(every, name)
            if not found.stable or (name == "observer_loop" and loop.condition_ii is not loop.FH):
                tally[f"{family}: not stable"] += not found.stable
                continue
            tally[f"{family}: compared"] += 1
            check = missed(found, gain, omega)
            if family in HARD and not delayed:
                quotient = {"observer_loop": loop.FH, "plant_loop": loop.L}.get(name, loop.CGm)
                check = check or differs(found, quotient)
            if check:
                tally["wrong"] += 1
                if show:
                    print(f"{i} {family} {name} {'delayed' if delayed else ''}: {check}")
    return tally


if __name__ == "__main__":
    print_tally(run, __doc__, 1000)
