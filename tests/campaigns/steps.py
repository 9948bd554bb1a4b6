"""Step responses of random loops against certified inversions of their Laplace transforms.

    python -m tests.campaigns.steps --count 1000 --seed 0

Coefficients are taken as the exact rationals that floating-point numbers are. The exponential of a
companion matrix in ball arithmetic then gives y and u with a bound for their error; with dead time
the series in powers of exp(-θs) is summed term by term, each a rational transform.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from fractions import Fraction
from functools import reduce
from operator import mul
from typing import NamedTuple

import numpy as np
from flint import fmpq, fmpq_poly

from nrdob.analysis import step_response
from nrdob.diagram import INPUTS, DelayedTransferFunction, LoopEquations, LowPassFilter
from tests.oracles.inversion import inverse_laplace
from tests.oracles.plain import exact_polynomial

from .runner import asked

PROMISED = 1e-9


# Certified inversion.


def exact_step(loop, input, t):
    """Return y and u at time t after a unit step, certified; t not on a multiple of the delay."""
    N, D, Nm, Dm, Nc, Dc, Nf, Df = (
        exact_polynomial(part) for block in loop.fractions for part in block
    )
    s, q, r = fmpq_poly([0, 1]), D * Nm * (Df - Nf), N * Dm * Nf
    once = (Nc * Nm * Dm * Df, Dm * Dc + Nm * Nc)
    (y_num, y_late), (u_num, _), den = {
        "R": ((N * once[0], True), (D * once[0], False), once[1]),
        "d": ((D * Nm * (Df - Nf), False), (-D * Dm * Nf, False), 1),
        "delta": ((N * Nm * (Df - Nf), True), (D * Nm * (Df - Nf), False), 1),
        "eta": ((-N * Dm * Nf, True), (-D * Dm * Nf, False), 1),
    }[input]
    time = fmpq(*Fraction(float(t)).as_integer_ratio())
    if not loop.delay:
        return [inverse_laplace(num, s * den * (q + r), time) for num in (y_num, u_num)]
    delay = fmpq(*Fraction(loop.delay).as_integer_ratio())
    values = []
    for num, late in ((y_num, y_late), (u_num, False)):
        total, k = 0.0, 0
        while time - (k + late) * delay >= 0:
            term = num * reduce(mul, [-r] * k, fmpq_poly([1])), s * den * q * q**k
            total += inverse_laplace(*term, time - (k + late) * delay)
            k += 1
        values.append(total)
    return values


# Random loops.


class Case(NamedTuple):
    """One loop, one input and the times to look at; `asked` of them are compared."""

    family: str
    loop: LoopEquations
    input: str
    times: np.ndarray
    asked: np.ndarray


def random_case(rng):
    """Draw a loop with lags around one second, or 1e11 apart, and λ down to 1e-9 of them."""
    wide = rng.random() < 0.25
    k = int(rng.integers(1, 7))
    order = int(rng.integers(k, 7))
    lags = 10 ** rng.uniform(-9 if wide else -1, 2 if wide else 1, k)
    if rng.random() < 0.3:
        lags[:] = lags[0]
    longest = lags.max()
    detuned = lags * (1 if rng.random() < 0.2 else rng.uniform(0.9, 1.1, k))
    Dm, D = (reduce(np.convolve, [np.array([T, 1.0]) for T in each]) for each in (lags, detuned))
    N, Nm = np.array([rng.uniform(0.6, 1.3)]), np.ones(1)
    if k > 1 and rng.random() < 0.3:
        zero = np.array([longest * 10 ** rng.uniform(-1, 0.5), 1.0])
        N, Nm = np.convolve(N, zero * [rng.uniform(0.9, 1.1), 1]), zero
    C = ([rng.uniform(0.1, 1), rng.uniform(0.1, 1) / longest], [1.0, 0.0])
    F = LowPassFilter(longest * 10 ** rng.uniform(-9, 0.5), order)
    delay = longest * 10 ** rng.uniform(-2, 1) if rng.random() < 0.4 else 0.0
    if delay:
        horizon = delay * rng.uniform(0.2, 4.0)
    else:
        horizon = max(longest, F.time_constant) * 10 ** rng.uniform(-2, 1.7)
    kind = rng.integers(3)
    times = [
        np.linspace(0, horizon, 101),
        np.sort(rng.uniform(0, horizon, 4)),
        horizon * np.append(0.0, np.geomspace(1e-9, 1, 12)),
    ][kind]
    asked = np.unique(rng.integers(0, times.size, 3))
    if delay:  # none on a jump
        phase = times[asked] / delay % 1
        asked = asked[np.minimum(phase, 1 - phase) > 1e-6]
    family = ("lags 1e11 apart" if wide else "lags 1e2 apart") + (", dead time" if delay else "")
    loop = LoopEquations(DelayedTransferFunction((N, D), delay), (Nm, Dm), C, F)
    return Case(family, loop, str(rng.choice(list(INPUTS))), times, asked)


def error(case):
    """Return the largest error of y or u relative to its size over the times asked for."""
    found = step_response(case.loop, case.input, case.times).outputs[:, 0]
    wanted = np.array([exact_step(case.loop, case.input, t) for t in case.times[case.asked]]).T
    if not wanted.size:
        return 0.0
    if not np.isfinite(found).all():
        raise OverflowError("the response leaves the range of floating-point numbers")
    size = np.maximum(np.abs(found).max(axis=1), np.abs(wanted).max(axis=1))
    size = np.maximum(size, _transient(case))
    wrong = np.abs(found[:, case.asked] - wanted).max(axis=1)
    return float(np.max(wrong / np.where(size > 0, size, 1.0)))


def _transient(case):
    """Return what y and u had been before the times asked for: of that, a last trace is left.

    A step of d or δ makes y or u + δ jump by 1, and a fast filter gives u a peak at about nλ.
    """
    jumps = np.array([case.input == "d", case.input == "delta"]) * 1e-6
    peak = case.loop.filter.order * case.loop.filter.time_constant
    if case.loop.delay or peak >= case.times[-1]:
        return jumps
    return np.maximum(jumps, np.abs(exact_step(case.loop, case.input, peak)))


def campaign(count, seed):
    """Return the errors by family and how often each reason to refuse was given."""
    rng = np.random.default_rng(seed)
    errors, refusals = defaultdict(list), Counter()
    for number in range(count):
        case = random_case(rng)
        try:
            errors[case.family].append((error(case), number))
        except (ValueError, ArithmeticError) as refusal:
            refusals[case.family, str(refusal)[:60]] += 1
    return errors, refusals


def main():
    """Print one row for each family, and the refusals."""
    given = asked(__doc__, 1000)
    errors, refusals = campaign(*given)
    print(f"{'family':32} {'count':>5} {'median':>8} {'worst':>8}  case  over {PROMISED:g}")
    for family, found in sorted(errors.items()):
        worst, number = max(found)
        over = sum(each > PROMISED for each, _ in found)
        median = np.median([each for each, _ in found])
        print(f"{family:32} {len(found):5} {median:8.1e} {worst:8.1e} {number:5}  {over}")
    for (family, reason), times in sorted(refusals.items()):
        print(f"refused {times:3} × {family}: {reason}…")


if __name__ == "__main__":
    main()
