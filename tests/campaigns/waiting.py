"""Loops whose model waits: verdicts and step responses against certified oracles.

    python -m tests.campaigns.waiting --count 1000 --seed 0

The sum of three terms is built once more, in exact fractions, from what the loop was made of, and
its argument is followed along the axis in balls (python-flint). Step responses are the double
series in exp(-θs) and exp(-θm s), each term a rational transform inverted in balls.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter, defaultdict
from fractions import Fraction
from functools import reduce
from math import comb

import control as ct
import numpy as np
from flint import fmpq, fmpq_poly

import nrdob
from nrdob.diagram import INPUTS
from tests.oracles.contour import rhp_by_argument
from tests.oracles.inversion import inverse_laplace
from tests.oracles.plain import exact_polynomial, p_B

from .runner import plain

# Random loops.


def random_loop(rng):
    """Draw a loop with two dead times: near each other, equal, far apart, or only one of them."""
    order = int(rng.integers(1, 4))
    lags = 10 ** rng.uniform(-1, 1, order)
    signs = np.where(rng.random(order) < 0.12, -1.0, 1.0)
    near = 10 ** rng.uniform(-0.2, 0.2, order)
    process = ct.tf([10 ** rng.uniform(-0.4, 0.4)], _from_lags(signs * lags))
    model = ct.tf([1.0], _from_lags(lags * near))
    if order > 1 and rng.random() < 0.3:
        zero = 10 ** rng.uniform(-1, 1) * (1 if rng.random() < 0.7 else -1)
        process *= ct.tf([zero, 1.0], [1.0])
    longest = lags.max()
    delay = longest * 10 ** rng.uniform(-2, 0.7)
    kind = rng.integers(6)
    wait = delay * (10 ** rng.uniform(-0.7, 0.7) if kind < 2 else 1 + 0.2 * rng.standard_normal())
    wait = delay if kind == 4 else abs(wait)
    delay = 0.0 if kind == 5 else delay
    n = order + int(rng.integers(0, 2))
    F = nrdob.LowPassFilter(max(delay, wait) * 10 ** rng.uniform(-1.7, 1), n)
    if order == 1 and rng.random() < 0.3:  # neutral
        process *= ct.tf([0.5 * longest, 1.0], [1.0])
        model *= ct.tf([0.4 * longest, 1.0], [1.0])
        F = ct.tf([rng.uniform(0.05, 0.4), 1.0], [1.0, 1.0])
    controller = ct.tf([rng.uniform(0.1, 1), rng.uniform(0.1, 1) / longest], [1.0, 0.0])
    G, Gm = (nrdob.delay(T) * block for T, block in ((delay, process), (wait, model)))
    return nrdob.NRDOB(G, Gm, controller, F)


def _from_lags(lags):
    return reduce(np.convolve, [np.array([T, 1.0]) for T in lags])


# Oracles.


def exact_step(loop, input, t):
    """Return y and u at time t after a unit step, certified; t at no echo."""
    N, D, Nm, Dm, Nc, Dc, Nf, Df = (exact_polynomial(p) for block in loop.fractions for p in block)
    one, s = fmpq_poly([1]), fmpq_poly([0, 1])
    theta, wait = (fmpq(*Fraction(T).as_integer_ratio()) for T in (loop.delay, loop.model_delay))
    time = fmpq(*Fraction(float(t)).as_integer_ratio())
    q, r, w = D * Nm * Df, N * Dm * Nf, -D * Nm * Nf
    if not loop.delay:
        q, r = q + r, fmpq_poly()
    prefilter = Nc * Nm * Dm * Df
    less_F = ((Df, fmpq(0)), (-Nf, wait))
    y_terms, u_terms, den = {
        "R": ([(N * prefilter, theta)], [(D * prefilter, fmpq(0))], Dm * Dc + Nm * Nc),
        "d": ([(D * Nm * p, T) for p, T in less_F], [(-D * Dm * Nf, fmpq(0))], one),
        "delta": (
            [(N * Nm * p, T + theta) for p, T in less_F], [(D * Nm * p, T) for p, T in less_F], one,
        ),
        "eta": ([(-N * Dm * Nf, theta)], [(-D * Dm * Nf, fmpq(0))], one),
    }[input]  # fmt: skip
    values = []
    for ends in (y_terms, u_terms):
        total = 0.0
        for i in range(int(time / theta) + 1 if loop.delay else 1):
            for k in range(int((time - i * theta) / wait) + 1):
                around = comb(i + k, i) * (-r) ** i * (-w) ** k
                bottom = s * den * q ** (i + k + 1)
                for p, late in ends:
                    since = time - i * theta - k * wait - late
                    if since >= 0 and p * around != 0:
                        total += inverse_laplace(p * around, bottom, since)
        values.append(total)
    return values


def step_error(loop, rng, horizon=6.0):
    """Largest error of a step response within some of the shorter dead times, against its size."""
    shortest = min(T for T in (loop.delay, loop.model_delay) if T)
    times = np.sort(rng.uniform(0, horizon * shortest, 3))
    input = str(rng.choice(list(INPUTS)))
    found = loop.step_response(input, times).outputs[:, 0]
    wanted = np.array([exact_step(loop, input, t) for t in times]).T
    size = np.maximum(
        np.abs(wanted).max(axis=1), [1e-6 * (input == "d"), 1e-6 * (input == "delta")]
    )
    return float(np.max(np.abs(found - wanted).max(axis=1) / np.where(size > 0, size, 1.0)))


# The campaign.


def main():
    """Print the counts and the errors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    verdicts, refusals, errors, seconds = Counter(), Counter(), [], defaultdict(list)
    for number in range(asked.count):
        loop = random_loop(rng)
        if loop.ill_posed:
            verdicts["ill-posed"] += 1
            continue
        start = time.process_time()
        found = loop.stability().observer_loop
        seconds[len(loop.p_B.delayed)].append(time.process_time() - start)
        true = rhp_by_argument(p_B(plain(loop)))
        if true is None or found.stable is None:
            verdicts["not known to the oracle" if true is None else "None"] += 1
            if found.stable is None:
                print("None", number, found.reason)
        elif math.isnan(true):
            right = found.stable is False and found.closed_loop_rhp == math.inf
            verdicts["endless chains" if right else "WRONG"] += 1
        else:
            right = found.closed_loop_rhp == true
            verdicts[("stable" if true == 0 else "unstable") if right else "WRONG"] += 1
            if not right:
                print("WRONG", number, true, found)
        verdicts[" and ".join(found.ways)] += 1
    for _ in range(asked.steps):
        loop = random_loop(rng)
        if loop.ill_posed:
            continue
        try:
            errors.append(step_error(loop, rng))
        except (ValueError, ArithmeticError) as refusal:
            refusals[str(refusal)[:60]] += 1
    for what, times in verdicts.most_common():
        print(f"{times:6}  {what}")
    for delays, spent in sorted(seconds.items()):
        ms = 1e3 * np.array(spent)
        print(f"{delays} dead times: {np.median(ms):.1f} ms, 99 % {np.percentile(ms, 99):.1f} ms")
    print(f"steps: {len(errors)}, median {np.median(errors):.1e}, worst {max(errors):.1e}")
    for reason, times in refusals.most_common():
        print(f"refused {times:3} × {reason}…")


if __name__ == "__main__":
    main()
