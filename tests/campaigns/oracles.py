"""Every public number of a loop against an oracle of tests/oracles, which shares nothing with it.

Loops are drawn as plain coefficients: lags, resonances, an unstable pole, a zero in the right half
plane, dead times of the process and of the model. Compared are the verdict and the counts, the
count of the certificate, the margins of three loops, step responses, the sets of λ, of dead times
and of gains beside every end, the verdict on a processor and its step responses.

Run `python -m tests.campaigns.oracles --count 300 --seed 0`; a sample is among the tests.
"""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from typing import Any

import control as ct
import numpy as np

import nrdob
from nrdob.diagram import INPUTS
from nrdob.uncertain import delay_intervals, gain_intervals
from tests.oracles import contour, events, inversion, sweep, wired
from tests.oracles.plain import Block, Plain, low_pass, p_A, p_B

from .runner import asked

FIGURES = "ms", "pm", "gm_low", "gm_high", "delay_margin", "disk_margin"

BESIDE = 1e-4
"""How far inside and outside an end the roots are counted."""

PEAK = 1e-3
"""The same for the ends of what is set by a peak."""

CLOSE = 1e-7
"""Distance from the unit circle at which nobody is asked to decide."""

RIGHT, UNKNOWN = "right", "not known to the oracle"

Drawn = tuple[Plain, tuple[float, int]]


def draw(rng: np.random.Generator) -> Drawn:
    """A loop as coefficients, and λ and n of its filter."""
    order = int(rng.integers(1, 4))
    lags = 10 ** rng.uniform(-1, 1, order)
    process, model = np.ones(1), np.ones(1)
    for k, lag in enumerate(lags):
        process = np.convolve(process, [-lag if k == 0 and rng.random() < 0.12 else lag, 1.0])
        model = np.convolve(model, [lag * rng.uniform(0.8, 1.25), 1.0])
    num = np.array([10 ** rng.uniform(-0.3, 0.3)])
    if rng.random() < 0.3:
        size = 10 ** rng.uniform(-0.5, 1)
        process = np.convolve(process, [1 / size**2, 2 * rng.uniform(0.02, 0.7) / size, 1.0])
    if order > 1 and rng.random() < 0.3:
        num = num * [10 ** rng.uniform(-1, 0.5) * rng.choice([-1, 1]), 1.0]
    longest = float(lags.max())
    delay = float(longest * 10 ** rng.uniform(-2, 0.3)) if rng.random() < 0.7 else 0.0
    wait = delay * float(rng.choice([1.0, rng.uniform(0.3, 2)])) if rng.random() < 0.35 else 0.0
    lam = float(longest * 10 ** rng.uniform(-1, 0.8))
    n = order + int(rng.integers(0, 2))
    C = Block(np.array([longest, 1.0]) * 10 ** rng.uniform(-0.7, 0.3), np.array([longest, 0.0]))
    blocks = Block(num, process), Block(np.ones(1), model), C, low_pass(lam, n)
    return Plain(*blocks, delay, wait), (lam, n)


def made(drawn: Drawn) -> nrdob.NRDOB:
    """The same loop in the package."""
    loop, filter = drawn
    G, Gm = (
        nrdob.delay(T) * ct.tf(*block) if T else ct.tf(*block)
        for block, T in ((loop.G, loop.delay), (loop.Gm, loop.model_delay))
    )
    return nrdob.NRDOB(G, Gm, ct.tf(*loop.C), nrdob.LowPassFilter(*filter))


# One question after the other. Each gives what came of it.


def counts(rng: np.random.Generator, drawn: Drawn) -> Iterator[str]:
    """Verdict, p_A and p_B."""
    verdict = made(drawn).stability()
    parts = verdict.model_loop, verdict.observer_loop
    true = [contour.rhp_by_argument(p(drawn[0])) for p in (p_A, p_B)]
    for part, count in zip(parts, true, strict=True):
        yield UNKNOWN if count is None else _same(part.closed_loop_rhp, count)
    if None not in true:
        yield _same(verdict.stable, true == [0, 0])


def certificate(rng: np.random.Generator, drawn: Drawn) -> Iterator[str]:
    """The count that a certificate proves."""
    try:
        claim = made(drawn).stability().certificate().content["claim"]
    except ArithmeticError as reason:
        yield f"none: {str(reason)[:50]}"
        return
    for name, p in (("p_A", p_A), ("p_B", p_B)):
        count = contour.rhp_by_argument(p(drawn[0]))
        yield UNKNOWN if count is None else _same(claim[name], count)


def margins(rng: np.random.Generator, drawn: Drawn) -> Iterator[str]:
    """Six figures of each of the three loops, where these are stable."""
    found = made(drawn).margins()
    for name, (gain, omega) in sweep.loop_gains(drawn[0]).items():
        if not getattr(found, name).stable:
            yield "not stable"
            continue
        true = sweep.swept(gain, omega)
        for figure in FIGURES:
            got, want = getattr(getattr(found, name), figure), true[figure]
            near = np.isclose(got, want, rtol=1e-6, atol=1e-12) or min(got, want) > 1e9
            yield RIGHT if near else f"WRONG {figure} of {name}: {got:.9g} for {want:.9g}"


def steps(rng: np.random.Generator, drawn: Drawn) -> Iterator[str]:
    """y and u after a step, at two times, by the contour of Talbot."""
    loop = drawn[0]
    input = str(rng.choice(list(INPUTS)))
    longest = max(loop.delay, loop.model_delay) or float(max(abs(np.roots(loop.G.den)) ** -1))
    times = np.sort(rng.uniform(0.05, 3, 2)) * longest
    try:
        found = made(drawn).step_response(input, times).outputs[:, 0]
    except (ValueError, ArithmeticError) as refusal:
        yield f"refused: {str(refusal)[:40]}"
        return
    for k, t in enumerate(times.tolist()):
        jumps = [i * loop.delay + j * loop.model_delay for i in range(70) for j in range(70)]
        if min(abs(t - jump) for jump in jumps) < 1e-6 * t:
            continue
        try:
            want = np.array(inversion.talbot_step(loop, input, t))
        except ArithmeticError:
            yield UNKNOWN
            continue
        size = max(float(np.abs(want).max()), 1e-3)
        error = float(np.abs(found[:, k] - want).max()) / size
        yield RIGHT if error < 1e-8 else f"WRONG step of {input}: {error:.1e}"


def time_constants(rng: np.random.Generator, drawn: Drawn) -> Iterator[str]:
    """The set of λ: beside every end above the smallest of interest, and at random."""
    loop, (lam, order) = drawn
    floor = lam / 100
    package = made(drawn)
    try:
        found = nrdob.stabilizing_time_constants(package.process, package.model, order, floor=floor)
    except (ValueError, ArithmeticError) as refusal:
        yield f"refused: {str(refusal)[:40]}"
        return
    for value in _beside(found, lam * 10 ** rng.uniform(-1, 1, 2)):
        if value < floor * (1 + 2 * BESIDE):
            continue
        other = loop._replace(F=low_pass(value, order))
        yield _inside(value, found, contour.rhp_by_argument(p_B(other)))


def admissible(rng: np.random.Generator, drawn: Drawn) -> Iterator[str]:
    """The set of λ with a peak of the sensitivity that is small enough."""
    loop, (lam, order) = drawn
    package, max_ms = made(drawn), float(rng.uniform(1.3, 2.5))
    try:
        found = nrdob.admissible_time_constants(
            package.process, package.model, order, max_ms=max_ms
        )
    except (ValueError, ArithmeticError) as refusal:
        yield f"refused: {str(refusal)[:40]}"
        return
    for value in _beside(found, lam * 10 ** rng.uniform(-1, 1, 2), PEAK):
        if value < lam / 20:  # with a dead time nothing is looked for below a floor
            continue
        other = loop._replace(F=low_pass(value, order))
        count = contour.rhp_by_argument(p_B(other))
        ms = sweep.swept(*sweep.loop_gains(other)["plant_loop"])["ms"] if count == 0 else math.inf
        if abs(ms / max_ms - 1) < CLOSE:
            yield "peak at its limit"
            continue
        yield _inside(value, found, None if count is None else int(ms > max_ms))


def dead_times(rng: np.random.Generator, drawn: Drawn) -> Iterator[str]:
    """The dead times that may be added."""
    loop, package = drawn[0], made(drawn)
    high = 3 * (loop.delay or float(drawn[1][0]))
    yield from _intervals(
        drawn, lambda: delay_intervals(package, 0.0, high), rng.uniform(0, high, 2), (0.0, high),
        lambda value: loop._replace(delay=loop.delay + value),
    )  # fmt: skip


def gains(rng: np.random.Generator, drawn: Drawn) -> Iterator[str]:
    """The factors that the process may have."""
    loop, package = drawn[0], made(drawn)
    yield from _intervals(
        drawn, lambda: gain_intervals(package, 0.05, 20.0), 10 ** rng.uniform(-1.3, 1.3, 2),
        (0.05, 20.0), lambda value: loop._replace(G=Block(value * loop.G.num, loop.G.den)),
    )  # fmt: skip


def processor(rng: np.random.Generator, drawn: Drawn) -> Iterator[str]:
    """The verdict and the step responses of the loop on a processor."""
    loop, (lam, _) = drawn
    dt = max(float(lam * rng.uniform(0.05, 0.5)), (loop.delay + loop.model_delay) / 40)
    late = dt * float(rng.choice([0.0, rng.random()]))
    sampled = made(drawn).sampled(dt, computation_delay=late)
    try:
        verdict = sampled.stability()
    except ValueError as refusal:
        yield f"refused: {str(refusal)[:40]}"
        return
    size = np.abs(wired.poles(loop, dt, "tustin", late))
    if verdict.stable is None:
        yield "undecided, with the reason" if verdict.reason else "WRONG: undecided"
    elif np.all(np.abs(size - 1) > CLOSE):
        yield _same(verdict.stable, bool((size < 1).all()))
    if loop.model_delay:
        return
    input = str(rng.choice(list(INPUTS)))
    found = sampled.step_response(input, dt * np.arange(25)).outputs[:, 0]
    y, u = events.step(loop, dt, 25, input, late)
    held = np.append(0.0, u[:-1]) if late else u  # what the hold puts out when y is read
    true = y, held + (input == "delta")
    for got, want, name in zip(found, true, "yu", strict=True):
        error = float(np.abs(got - want).max() / max(np.abs(want).max(), 1e-3))
        yield RIGHT if error < 1e-6 else f"WRONG {name} of the sampled step of {input}: {error:.1e}"


QUESTIONS = (
    counts, certificate, margins, steps, time_constants, admissible, dead_times, gains, processor,
)  # fmt: skip


def _same(got: Any, want: Any) -> str:
    want = math.inf if isinstance(want, float) and math.isnan(want) else want
    return RIGHT if got == want else f"WRONG: {got} for {want}"


def _beside(
    intervals: list[tuple[float, float]], others: np.ndarray, share: float = BESIDE
) -> list[float]:
    ends = [end for pair in intervals for end in pair if 0 < end < math.inf][:4]
    return [end * (1 + side * share) for end in ends for side in (-1, 1)] + others.tolist()


def _inside(value: float, intervals: Any, count: float | None) -> str:
    if count is None:
        return UNKNOWN
    inside = any(low < value < high for low, high in intervals)
    return RIGHT if inside is (count == 0) else f"WRONG: {value:.9g} in {intervals}, count {count}"


def _intervals(drawn: Drawn, asked: Any, others: Any, ends: Any, changed: Any) -> Iterator[str]:
    if contour.rhp_by_argument(p_A(drawn[0])) != 0:
        yield "condition i does not hold"
        return
    try:
        found = asked()
    except (ValueError, ArithmeticError) as refusal:
        yield f"refused: {str(refusal)[:40]}"
        return
    for value in _beside(found, others):
        if ends[0] < value < ends[1]:
            yield _inside(value, found, contour.rhp_by_argument(p_B(changed(value))))


def campaign(count: int, seed: int) -> tuple[dict[str, Counter[str]], Counter[str]]:
    """What became of each question, and the processor time that it took, in seconds."""
    rng = np.random.default_rng(seed)
    tally: dict[str, Counter[str]] = defaultdict(Counter)
    spent: Counter[str] = Counter()
    for k in range(count):
        drawn = draw(rng)
        for question in QUESTIONS:
            start = time.process_time()
            for outcome in question(rng, drawn):
                wrong = outcome.startswith("WRONG")
                tally[question.__name__][f"{outcome}; loop {k}" if wrong else outcome] += 1
            spent[question.__name__] += time.process_time() - start
    return tally, spent


if __name__ == "__main__":
    tally, spent = campaign(*asked(__doc__, 300))
    for question, outcomes in tally.items():
        print(f"{question.replace('_', ' ')}, {spent[question]:.0f} s")
        for outcome, times in outcomes.most_common():
            print(f"{times:6}  {outcome}")
