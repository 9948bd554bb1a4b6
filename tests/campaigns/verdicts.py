"""Verdicts on random loops against oracles that share no code with the package.

The characteristic function is built once more, in exact fractions, from what the loop was made of.
Without dead time its roots are isolated in balls (python-flint). With dead time the crossings of
the axis are found from certified roots of |q|² - |r|² in balls of 100 digits; where the dead time
is short enough, the argument is followed in balls, too.

Run `python -m tests.campaigns.verdicts --count 10000 --seed 0`.
"""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import control as ct
import flint
import numpy as np

import nrdob
from tests.oracles.contour import rhp_by_argument, value_at

from .runner import asked

DIGITS = 100
MOST_BALLS = 1000
"""For the argument, which is followed where the dead time is short enough."""


class Blocks(NamedTuple):
    """Coefficients in descending powers, dead time in seconds, F = 1/(λs + 1)^n or (num, den)."""

    process: tuple[np.ndarray, np.ndarray]
    model: tuple[np.ndarray, np.ndarray]
    controller: tuple[np.ndarray, np.ndarray]
    filter: tuple[float, int] | tuple[np.ndarray, np.ndarray]
    delay: float

    def loop(self) -> nrdob.NRDOB:
        process: Any = ct.tf(*self.process)
        if self.delay:
            process = nrdob.delay(self.delay) * process
        F = nrdob.LowPassFilter(*self.filter) if np.isscalar(self.filter[0]) else self.filter
        return nrdob.NRDOB(process, ct.tf(*self.model), ct.tf(*self.controller), F)


# Random loops.


def _lags(rng: np.random.Generator, count: int, decades: float) -> np.ndarray:
    return 10 ** rng.uniform(-decades / 2, decades / 2, count)


def _from_lags(lags: np.ndarray) -> np.ndarray:
    den = np.ones(1)
    for lag in np.atleast_1d(lags):
        den = np.convolve(den, [lag, 1.0])
    return den


def _dead_time(rng: np.random.Generator, lags: np.ndarray) -> float:
    return float(np.min(lags) * 10 ** rng.uniform(-4, 5))


def _filter(rng: np.random.Generator, order: int, *times: float) -> tuple[float, int]:
    typical = float(rng.choice(times))
    return float(typical * 10 ** rng.uniform(-1.5, 1.5)), order + int(rng.integers(0, 2))


def _near(rng: np.random.Generator, values: np.ndarray) -> np.ndarray:
    return values * (1 + rng.choice([0.01, 0.1, 0.5]) * rng.uniform(-1, 1, np.shape(values)))


def _gain(rng: np.random.Generator) -> float:
    return float(10 ** rng.uniform(-0.5, 0.5))


def low_order(rng: np.random.Generator) -> Blocks:
    lags = _lags(rng, int(rng.integers(1, 3)), 3)
    T = _dead_time(rng, lags)
    process = (np.array([_gain(rng)]), _from_lags(lags))
    model = (np.ones(1), _from_lags(_near(rng, lags)))
    return Blocks(process, model, _pi(rng, lags), _filter(rng, lags.size, T, lags.max()), T)


def integrating(rng: np.random.Generator) -> Blocks:
    lags = _lags(rng, int(rng.integers(1, 3)), 3)
    T = _dead_time(rng, lags) if rng.random() < 0.7 else 0.0
    process = (np.array([_gain(rng)]), np.append(_from_lags(lags), 0.0))
    slow = 10 ** rng.uniform(1, 3) * max(T, lags.max())
    model = (np.array([slow]), np.convolve([slow, 1.0], _from_lags(_near(rng, lags))))
    return Blocks(process, model, _pi(rng, lags), _filter(rng, lags.size + 1, T or 1, slow), T)


def resonant(rng: np.random.Generator) -> Blocks:
    damping, corner = 10 ** rng.uniform(-7, -0.5), 10 ** rng.uniform(-2, 2)
    detuned = corner * (1 + 10 ** rng.uniform(-6, -0.5) * rng.choice([-1, 1]))
    lag = 10 ** rng.uniform(-2, 1)

    def block(gain: float, corner: float, damping: float) -> tuple[np.ndarray, np.ndarray]:
        den = np.convolve([1 / corner**2, 2 * damping / corner, 1.0], [lag, 1.0])
        return np.array([gain]), den

    T = _dead_time(rng, np.array([lag, 1 / corner])) if rng.random() < 0.6 else 0.0
    model = (
        block(1.0, detuned, damping) if rng.random() < 0.5 else (np.ones(1), _from_lags([lag] * 3))
    )
    return Blocks(
        block(_gain(rng), corner, damping), model, _pi(rng, np.array([lag])),
        _filter(rng, 3, lag, 1 / corner), T,
    )  # fmt: skip


def unstable(rng: np.random.Generator) -> Blocks:
    lags = _lags(rng, int(rng.integers(1, 4)), 2)
    signed = lags.copy()
    signed[0] *= -1
    gain = float(rng.choice([-1, 1])) * _gain(rng)
    T = float(lags[0] * 10 ** rng.uniform(-4, 0.5)) if rng.random() < 0.6 else 0.0
    model = (np.array([0.3 * float(rng.choice([-1, 1]))]), _from_lags(_near(rng, lags)))
    return Blocks(
        (np.array([gain]), _from_lags(signed)), model, _pi(rng, lags),
        _filter(rng, lags.size, lags[0]), T,
    )  # fmt: skip


def neutral(rng: np.random.Generator) -> Blocks:
    lead, lag = _lags(rng, 2, 2)
    T = _dead_time(rng, np.array([lag]))
    process = (_gain(rng) * np.array([lead, 1.0]), np.array([lag, 1.0]))
    model = (np.array([_near(rng, lead), 1.0]), np.array([_near(rng, lag), 1.0]))
    end = rng.uniform(0.02, 0.95)
    time_constant = (T if rng.random() < 0.5 else lag) * 10 ** rng.uniform(-1, 1)
    F = (np.array([end * time_constant, 1.0]), np.array([time_constant, 1.0]))
    return Blocks(process, model, _pi(rng, np.array([lag])), F, T)


def high_order(rng: np.random.Generator) -> Blocks:
    lags = _lags(rng, int(rng.integers(5, 11)), 2)
    zeros = _lags(rng, int(rng.integers(0, 3)), 2) * rng.choice([-1, 1])
    T = _dead_time(rng, lags) if rng.random() < 0.5 else 0.0
    total = lags.sum()
    model = (np.ones(1), _from_lags(np.array([total / 2, total / 2])))
    process = (_gain(rng) * _from_lags(zeros), _from_lags(lags))
    return Blocks(process, model, _pi(rng, lags), _filter(rng, 2, T or total, total), T)


def scales_apart(rng: np.random.Generator) -> Blocks:
    lags = _lags(rng, int(rng.integers(2, 5)), 11)
    T = float(10 ** rng.uniform(-5, 5)) if rng.random() < 0.5 else 0.0
    process = (np.array([_gain(rng)]), _from_lags(lags))
    model = (np.ones(1), _from_lags(_near(rng, lags[:2])))
    return Blocks(process, model, _pi(rng, lags), _filter(rng, 2, *lags.tolist()), T)


def many_roots(rng: np.random.Generator) -> Blocks:
    lags = _lags(rng, int(rng.integers(1, 4)), 2)
    T = float(lags.max() * 10 ** rng.uniform(1, 4))
    process = (np.array([10 ** rng.uniform(0, 2)]), _from_lags(lags))
    model = (np.ones(1), _from_lags(_near(rng, lags)))
    return Blocks(process, model, _pi(rng, lags), _filter(rng, lags.size, lags.min()), T)


def _pi(rng: np.random.Generator, lags: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    time_constant = float(np.max(lags))
    return 10 ** rng.uniform(-2, 0.5) * np.array([time_constant, 1.0]), np.array(
        [time_constant, 0.0]
    )


FAMILIES: dict[str, Callable[[np.random.Generator], Blocks]] = {
    "first and second order": low_order,
    "integrating": integrating,
    "resonance": resonant,
    "unstable": unstable,
    "neutral": neutral,
    "high order": high_order,
    "scales 1e11 apart": scales_apart,
    "many roots on the right": many_roots,
}


def random_blocks(rng: np.random.Generator, family: str) -> Blocks:
    """One loop of a family; in half of the cases its units of time and gain are anything."""
    blocks = FAMILIES[family](rng)
    if rng.random() < 0.5:
        return blocks
    return rescaled(blocks, 10 ** rng.uniform(-9, 9), 10 ** rng.uniform(-12, 12))


def rescaled(blocks: Blocks, time: float, gain: float, factor: float = 1.0) -> Blocks:
    """The same loop in another unit of time and of the output.

    `factor` multiplies numerators and denominators alike.
    """

    def slower(coefficients: np.ndarray) -> np.ndarray:
        return np.asarray(coefficients) * time ** np.arange(len(coefficients) - 1, -1, -1.0)

    def block(num: np.ndarray, den: np.ndarray, gain: float) -> tuple[np.ndarray, np.ndarray]:
        return factor * gain * slower(num), factor * slower(den)

    F = blocks.filter
    return Blocks(
        block(*blocks.process, gain),
        block(*blocks.model, gain),
        block(*blocks.controller, 1 / gain),
        (F[0] * time, F[1]) if np.isscalar(F[0]) else block(*F, 1.0),
        blocks.delay * time,
    )


# Oracles.


def poly(coefficients: Any) -> flint.fmpq_poly:
    """Exact polynomial from floats in descending powers."""
    ratios = [float(c).as_integer_ratio() for c in np.atleast_1d(coefficients)[::-1]]
    return flint.fmpq_poly([flint.fmpq(*ratio) for ratio in ratios])


def functions(loop: nrdob.NRDOB) -> tuple[flint.fmpq_poly, tuple[flint.fmpq_poly, flint.fmpq_poly]]:
    """p_A, and q and r of p_B = q + r exp(-sT), exactly."""
    G, Gm, C, F = ([poly(part) for part in block] for block in loop.fractions)
    p_A = Gm[1] * C[1] + Gm[0] * C[0]
    return p_A, (G[1] * Gm[0] * (F[1] - F[0]), G[0] * Gm[1] * F[0])


def rhp_of_polynomial(p: flint.fmpq_poly) -> tuple[int, int]:
    """Roots in the open right half plane and on the axis, certified."""
    right = on = 0
    for root, multiplicity in p.numer().complex_roots():
        if root.real > 0:
            right += multiplicity
        elif not root.real < 0:
            on += multiplicity
    return right, on


def rhp_with_delay(q: flint.fmpq_poly, r: flint.fmpq_poly, delay: float) -> int | None:
    """Roots of q + r exp(-sT) in the open right half plane; None where T is at a crossing."""
    flint.ctx.dps = DIGITS
    T = flint.arb(delay)
    count, on_axis = rhp_of_polynomial(q + r)
    if on_axis:
        return None
    for x, multiplicity in _squared(q, r).numer().complex_roots():
        if not (x.imag == 0 and x.real > 0) or multiplicity % 2 == 0:
            continue
        omega = flint.arb(x.real).sqrt()
        side = _sign_beyond(q, r, x.real)
        s = flint.acb(0, omega)
        phase = (-value_at(r, s) / value_at(q, s)).arg() / (2 * flint.arb.pi())
        turns = omega * T / (2 * flint.arb.pi()) - phase
        start = -phase  # crossings between the dead times 0 and T
        counted = turns.floor().unique_fmpz(), start.floor().unique_fmpz()
        if None in counted:
            return None
        count += 2 * side * (int(counted[0]) - int(counted[1]))
    return count


def _squared(q: flint.fmpq_poly, r: flint.fmpq_poly) -> flint.fmpq_poly:
    """|q(jω)|² - |r(jω)|² as a polynomial in ω²."""

    def size(p: flint.fmpq_poly) -> flint.fmpq_poly:
        mirrored = flint.fmpq_poly([(-1) ** k * p[k] for k in range(p.degree() + 1)])
        product = p * mirrored  # in s², which is -ω²
        return flint.fmpq_poly(
            [(-1) ** k * product[2 * k] for k in range(product.degree() // 2 + 1)]
        )

    return size(q) - size(r)


def _sign_beyond(q: flint.fmpq_poly, r: flint.fmpq_poly, x: flint.arb) -> int:
    slope = _squared(q, r).derivative()
    value = value_at(slope, flint.acb(x)).real
    if not (value > 0 or value < 0):
        raise ArithmeticError("a multiple crossing")
    return 1 if value > 0 else -1


def truth(loop: nrdob.NRDOB) -> tuple[int | None, float | None]:
    """Z of p_A and p_B: None where the oracle finds a root on the axis, inf for endless chains."""
    flint.ctx.dps = DIGITS
    p_A, (q, r) = functions(loop)
    right_A, on_A = rhp_of_polynomial(p_A)
    Z_A = None if on_A else right_A
    if not loop.delay:
        right, on = rhp_of_polynomial(q + r)
        return Z_A, None if on else right
    n, m = q.degree(), r.degree()
    if m > n or (m == n and abs(r[m] / q[n]) > 1):
        return Z_A, math.inf
    Z_B = rhp_with_delay(q, r, loop.delay)
    by_argument = rhp_by_argument([(q, 0.0), (r, loop.delay)], MOST_BALLS)
    if Z_B is not None and by_argument is not None and by_argument != Z_B:
        raise ArithmeticError(f"the oracles disagree: {Z_B} and {by_argument}")
    return Z_A, by_argument if Z_B is None else Z_B


def distance(p: Any) -> float:
    """Relative change of the coefficients that moves a root of p onto the axis, about."""
    p = p.finite_part
    size = np.abs(np.concatenate([np.roots(c) for c in (p.q, p.r) if c.size > 1]))
    size = size[size > 0]
    omega = np.geomspace(size.min() / 100, size.max() * 100, 20001)
    for _ in range(12):
        ratio = np.abs(p(1j * omega)) / np.polyval(p.scale, omega)
        k = int(np.argmin(ratio))
        omega = np.linspace(omega[max(k - 1, 0)], omega[min(k + 1, omega.size - 1)], 2001)
    at_zero = abs(p.constant) / p.scale[-1]
    return float(min(ratio.min(), at_zero))


# The campaign.


class Case(NamedTuple):
    """One loop, what was said of it, what is true, and how much computing it took in seconds."""

    family: str
    blocks: Blocks
    verdict: nrdob.analysis.stability.Stability
    truth: tuple[int | None, float | None]
    seconds: float

    @property
    def wrong(self) -> bool:
        """Whether anything that was said is false."""
        parts = (self.verdict.model_loop, self.verdict.observer_loop)
        for part, true in zip(parts, self.truth, strict=True):
            if true is None or part.stable is None:
                continue
            if part.stable is not (true == 0) or (
                part.closed_loop_rhp is not None and part.closed_loop_rhp != true
            ):
                return True
        return False

    @property
    def undecided(self) -> list[str]:
        """Conditions without a verdict."""
        parts = {"p_A": self.verdict.model_loop, "p_B": self.verdict.observer_loop}
        return [name for name, part in parts.items() if part.stable is None]


def cases(count: int, seed: int) -> Iterator[Case]:
    """Judge `count` random loops, each family in turn."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        family = list(FAMILIES)[k % len(FAMILIES)]
        blocks = random_blocks(rng, family)
        loop = blocks.loop()
        start = time.process_time()  # of this process alone, however busy the machine
        verdict = loop.stability()
        seconds = time.process_time() - start
        yield Case(family, blocks, verdict, truth(loop), seconds)


def main() -> None:
    """Print the table of a campaign."""
    given = asked(__doc__, 10_000)
    found: dict[str, list[Case]] = defaultdict(list)
    for case in cases(*given):
        found[case.family].append(case)
        if case.wrong:
            print("WRONG", case.family, case.blocks, case.verdict, case.truth, sep="\n  ")
        for name in case.undecided:
            p = getattr(case.blocks.loop(), name)
            part = case.verdict.model_loop if name == "p_A" else case.verdict.observer_loop
            print(f"undecided: {case.family}: {name} {distance(p):.1e} {part.reason} {case.truth}")
    everyone = [case for many in found.values() for case in many]
    print(f"{'':26}{'loops':>7}{'wrong':>7}{'None':>6}{'stable':>8}{'ms':>8}{'99 %':>8}{'max':>8}")
    for family, many in [*found.items(), ("all", everyone)]:
        ms = 1e3 * np.array([case.seconds for case in many])
        print(
            f"{family:26}{len(many):7}{sum(case.wrong for case in many):7}"
            f"{sum(bool(case.undecided) for case in many):6}"
            f"{sum(case.verdict.stable is True for case in many):8}"
            f"{np.median(ms):8.2f}{np.percentile(ms, 99):8.2f}{ms.max():8.2f}"
        )
    unknown = sum(None in case.truth for case in everyone)
    print(f"{unknown:7}  not known to the oracles")
    ways = Counter(case.verdict.observer_loop.ways for case in everyone)
    for way, number in ways.most_common():
        print(f"{number:7}  {' and '.join(way) or 'no count: the coefficients alone, or None'}")


if __name__ == "__main__":
    main()
