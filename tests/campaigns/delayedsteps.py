"""Step responses of random loops with dead times against Talbot's inversion, echo by echo.

    python -m tests.campaigns.delayedsteps --count 1000 --seed 0

The diagram is solved here once more, for one or two dead times. What has come around the loop i
times through the plant and k times through the model is a rational transform behind its own dead
time; each is inverted by Talbot's contour in 120 digits, with more points until two sums agree.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import control as ct
import numpy as np
from flint import fmpq_poly

import nrdob
from nrdob.diagram import INPUTS
from tests.oracles.inversion import talbot_step
from tests.oracles.plain import Block, Plain

from .runner import asked

PROMISED = 1e-8
"""Error against the largest value since t = 0; nine digits, and coefficients that are rounded."""

Polynomial = fmpq_poly


class Case(NamedTuple):
    """A loop as blocks with exact coefficients, and what is asked of it."""

    family: str
    G: tuple[list[float], list[float]]
    Gm: tuple[list[float], list[float]]
    C: tuple[list[float], list[float]]
    F: tuple[list[float], list[float]]
    delays: tuple[float, float]
    state_space: bool
    input: str
    times: np.ndarray

    def loop(self) -> nrdob.NRDOB:
        """The loop, its blocks as state spaces where that is asked for."""
        G, Gm, C = (ct.tf(*block) for block in (self.G, self.Gm, self.C))
        if self.state_space:
            C = ct.tf2ss(C)
        blocks = []
        for block, delay in ((G, self.delays[0]), (Gm, self.delays[1])):
            if self.state_space and not delay:
                block = ct.tf2ss(block)
            blocks.append(nrdob.delay(delay) * block if delay else block)
        return nrdob.NRDOB(*blocks, C, self.F)


# The oracle.


# Random loops.


def _lags(rng: np.random.Generator, count: int) -> np.ndarray:
    den = np.ones(1)
    for lag in 10 ** rng.uniform(-1, 1, count):
        den = np.convolve(den, [lag, 1.0])
    return den


def random_case(rng: np.random.Generator) -> Case:
    """Draw a loop with lags around one second, of one of five families."""
    family = str(rng.choice(["process", "both alike", "two dead times", "model only", "neutral"]))
    n = int(rng.integers(1, 4))
    den = _lags(rng, n)
    num = np.array([rng.uniform(0.5, 1.5)])
    biproper = family == "neutral"
    if biproper or (n > 1 and rng.random() < 0.3):
        zeros = n if biproper else 1
        num = num * np.real(np.poly(-(10 ** rng.uniform(-1, 1, zeros))))
        num = num / num[-1]
    kind = rng.random()
    if kind < 0.15:  # an integrator, or an unstable lag, or an oscillation
        den = np.append(den, 0.0)
    elif kind < 0.25:
        den[-1] = -den[-1]
    elif kind < 0.4:
        den = np.convolve(den, [1.0, 2 * 10 ** rng.uniform(-2, 0), 10 ** rng.uniform(-0.5, 0.5)])
    detuned = den * (1.0 if rng.random() < 0.2 else rng.uniform(0.9, 1.1, den.size))
    order = max(den.size - num.size, 1) + int(rng.integers(0, 2))
    lam = float(10 ** rng.uniform(-1.5, 0.5))
    F = (np.ones(1), np.real(np.poly([-1.0] * order)) * lam ** np.arange(order, -1, -1.0))
    if num.size == den.size and rng.random() < 0.7:
        F = (np.array([rng.uniform(0.05, 0.9) * lam, 1.0]), np.array([lam, 1.0]))
    theta = float(10 ** rng.uniform(-1.5, 0.7))
    wait = theta * float(rng.choice([rng.uniform(0.2, 2.0), 0.5, 2.0, 1.0 + 1e-3]))
    delays = {
        "process": (theta, 0.0),
        "both alike": (theta, theta),
        "two dead times": (theta, wait),
        "model only": (0.0, theta),
        "neutral": (theta, float(rng.choice([0.0, theta, wait]))),
    }[family]
    C = ([rng.uniform(0.1, 1.0), rng.uniform(0.05, 0.5)], [1.0, 0.0])
    horizon = 10 ** rng.uniform(-0.5, 1.0) * max(delays)
    times = [
        np.linspace(0, horizon, 201),
        np.sort(rng.uniform(0, horizon, 6)),
        horizon * np.append(0.0, np.geomspace(1e-6, 1, 12)),
    ][rng.integers(3)]
    gains = [list(map(float, c)) for c in (num, detuned, num * rng.uniform(0.9, 1.1), den, *F)]
    pairs = list(zip(gains[::2], gains[1::2], strict=True))
    state_space = bool(rng.random() < 0.25)
    return Case(
        family, pairs[0], pairs[1], C, pairs[2], delays, state_space, str(rng.choice(list(INPUTS))),
        times,
    )  # fmt: skip


def error(case: Case) -> float:
    """Return the largest error of y and u at three times, against the size since t = 0."""
    found = case.loop().step_response(case.input, case.times).outputs[:, 0]
    size = np.maximum(np.abs(found).max(axis=1), 1e-6)
    last = case.times[-1]
    known = [k * case.delays[0] + m * case.delays[1] for k in range(99) for m in range(99)]
    moments = np.unique([moment for moment in known if moment <= 1.1 * last])
    blocks = (Block(*block) for block in (case.G, case.Gm, case.C, case.F))
    plain, worst = Plain(*blocks, *case.delays), 0.0
    picks = np.linspace(0, case.times.size - 1, 4).astype(int)[1:]
    for k in picks.tolist():
        t = float(case.times[k])
        if np.abs(moments - t).min() < 1e-6 * last or t < 1e-3 * min(filter(None, case.delays)):
            continue
        wanted = np.array(talbot_step(plain, case.input, t))
        worst = max(
            worst, float((np.abs(found[:, k] - wanted) / np.maximum(size, abs(wanted))).max())
        )
    return worst


def cases(count: int, seed: int) -> Iterator[Case]:
    """Draw `count` loops."""
    rng = np.random.default_rng(seed)
    return (random_case(rng) for _ in range(count))


def campaign(count: int, seed: int) -> tuple[dict[str, list[tuple[float, int]]], Counter[str]]:
    """Return the errors by family, and how often each reason to refuse was given."""
    errors, refusals = defaultdict(list), Counter[str]()
    for number, case in enumerate(cases(count, seed)):
        family = case.family + ", state space" * case.state_space
        try:
            found = error(case)
        except (ValueError, ArithmeticError) as refusal:
            refusals[f"{family}: {str(refusal)[:70]}"] += 1
        else:
            errors[family].append((found, number))
    return errors, refusals


def main() -> None:
    """Print one row for each family, and the refusals."""
    errors, refusals = campaign(*asked(__doc__, 500))
    print(f"{'family':30} {'count':>5} {'median':>8} {'worst':>8}  case  over {PROMISED:g}")
    for family, found in sorted(errors.items()):
        worst, number = max(found)
        over = [k for each, k in found if each > PROMISED]
        median = np.median([each for each, _ in found])
        print(f"{family:30} {len(found):5} {median:8.1e} {worst:8.1e} {number:5}  {over}")
    for reason, times in sorted(refusals.items()):
        print(f"refused {times:3} × {reason}…")


if __name__ == "__main__":
    main()
