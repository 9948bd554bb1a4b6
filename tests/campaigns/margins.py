"""Margins of random hard loops against oracles that share no code with them.

`python -m tests.campaigns.margins --count 1000 --seed 0`

Without dead time the oracle is certified: coefficients as exact fractions, polynomials in ω² in
integers, their real roots enclosed in balls. With dead time it is a dense grid that closes in on
every root of every factor: whatever it sees must have been found.
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

from .runner import print_tally

FAMILIES = ("detuned", "spread", "integrating", "lags", "resonant")


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
        process, ct.tf(*Gm), C, nrdob.LowPassFilter(slowest * 10 ** rng.uniform(-1, 1.5), order)
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


# With dead time: a dense grid.


def overlooks(found: Margins, loop: Quotient, closed) -> str:
    """Name the crossings that a dense grid sees and `found` does not; empty if there are none."""
    omega = _dense(loop, closed)
    with np.errstate(all="ignore"):
        values = loop(1j * omega)
    wrong = []
    least = float(np.nanmin(np.abs(1 + values)))
    if found.sm > least * (1 + 1e-7) + 1e-12:
        wrong.append(f"sm {found.sm:.9g} for {least:.9g}")
    size, side = np.abs(values) - 1, values.imag / np.abs(values)
    at = _sign_changes(size)
    low, high = omega[at] * (1 - 1e-9), omega[at + 1] * (1 + 1e-9)
    known = found.gain_crossovers[:, None]
    missed = ~((known >= low) & (known <= high)).any(axis=0)
    wrong += [f"gain crossover near {w:.9g} rad/s" for w in low[missed]]
    at = _sign_changes(side)
    at = at[(values[at].real < 0) & (values[at + 1].real < 0)]
    gains = -1 / np.stack([values[at].real, values[at + 1].real])
    missed = (gains > found.gm_low * 1.0001).all(axis=0) & (gains < found.gm_high * 0.9999).all(
        axis=0
    )
    wrong += [f"critical gain near {k:.6g}" for k in gains[0, missed]]
    return "; ".join(wrong)


def _sign_changes(values: np.ndarray) -> np.ndarray:
    clear = np.minimum(np.abs(values[1:]), np.abs(values[:-1])) > 1e-11
    return np.flatnonzero((values[1:] * values[:-1] < 0) & clear)


def _dense(loop: Quotient, closed) -> np.ndarray:
    """Frequencies evenly on a log scale, closing in on every root, and following the delay."""
    factors = [*loop.num, *loop.den, closed]
    roots = [np.roots(c) for f in factors for c in (f.q, f.r) if c.any()]
    roots = np.concatenate([*roots, closed.roots])
    roots = roots[np.abs(roots) > 0]
    size = np.abs(roots)
    close = np.sort(np.concatenate([s * np.geomspace(1e-3, 1e3, 400) for s in (-1, 1)]))
    around = np.abs(roots.imag)[:, None] + np.abs(roots.real)[:, None] * close
    turn = 2 * np.pi / loop.delay
    even = np.arange(1, 40_000) * turn / 256
    wide = np.geomspace(size.min() / 1e3, min(1e3 * size.max(), 1e3 * turn), 40_000)
    omega = np.unique(np.concatenate([wide, around.ravel(), even]))
    return omega[omega > 0]


def run(count: int, seed: int, *, show: bool = True) -> Counter[str]:
    """Compare `count` random loops; return how many margins were compared and how many differ."""
    rng, tally = np.random.default_rng(seed), Counter()
    for i in range(count):
        family, delayed = FAMILIES[i % len(FAMILIES)], bool(i // len(FAMILIES) % 2)
        loop = random_hard_loop(rng, family, delayed=delayed)
        every = loop.margins()
        for name, quotient, closed in (
            ("model_loop", loop.CGm, loop.p_A),
            ("observer_loop", loop.FH, loop.p_B),
            ("plant_loop", loop.L, loop.p_B),
        ):
            found = getattr(every, name)
            if not found.stable:
                tally[f"{family}: not stable"] += 1
                continue
            tally[f"{family}: compared"] += 1
            check = overlooks(found, quotient, closed) if quotient.delay else differs(
                found, quotient
            )  # fmt: skip
            if check:
                tally["wrong"] += 1
                if show:
                    print(f"{i} {family} {name} {'delayed' if delayed else ''}: {check}")
    return tally


if __name__ == "__main__":
    print_tally(run, __doc__, 1000)
