"""Against python-control, side by side: the same question, both given what they ask for."""

from functools import partial

import control as ct
import mpmath as mp
import numpy as np
import pytest
from loops import CASES

import nrdob
from nrdob import paper
from nrdob.analysis import loop_margins

SIDES = ["nrdob", "control"]
TIMES = np.linspace(0, 6, 1500)

cases = pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
sides = pytest.mark.parametrize("side", SIDES)


@cases
@sides
def test_stability_verdict(race, case, side):
    def ours():
        return case.fresh().stability()

    def theirs():
        return ct.nyquist_response(case.CGm), ct.nyquist_response(case.FH)

    race(f"verdict, {case.name}", side, ours, theirs)


@cases
@sides
def test_margins_with_the_verdict_known(race, case, side):
    verdict = case.fresh().stability()

    def ours():
        return loop_margins(case.fresh(), verdict)

    race(f"margins, {case.name}", side, ours, lambda: their_margins(case))


@cases
@sides
def test_margins_and_verdict(race, case, side):
    def ours():
        return case.fresh().margins()

    race(f"margins and verdict, {case.name}", side, ours, lambda: their_margins(case))


def their_margins(case):
    return [ct.stability_margins(loop) for loop in (case.CGm, case.FH, case.L)]


@cases
@sides
@pytest.mark.parametrize("input", ["R", "d"])
def test_step_response(race, case, side, input):
    # y and u, as ours are; control gets them in lowest order, which the user would have to find.
    loop = case.fresh()
    to_y, to_u = (loop.T_R, loop.U_R) if input == "R" else (loop.S_d, loop.U_d)
    maps = to_y.to_tf(), to_u.to_tf()

    def ours():
        return case.fresh().step_response(input, TIMES)

    def theirs():
        return [ct.step_response(map, TIMES) for map in maps]

    race(f"step response to {input}, {case.name}", side, ours, theirs)


@sides
def test_delayed_step_response(race, side):
    blocks = blocks_of(paper.example(4))
    approximation = pade(paper.example(4), 5).S_d.to_tf()

    def ours():
        return nrdob.NRDOB(*blocks).step_response("d", TIMES)

    def theirs():
        return ct.step_response(approximation, TIMES)

    race("delayed step response, against Padé(5)", side, ours, theirs)


def test_delayed_step_response_is_ten_thousand_times_closer_than_pade_5(note):
    loop = paper.example(4)
    k = np.arange(17, TIMES.size, 247)  # off the jumps at multiples of the dead time
    exact = np.array([exact_sensitivity_step(loop, t) for t in TIMES[k]])
    ours = loop.step_response("d", TIMES).outputs[0, 0, k]
    theirs = ct.step_response(pade(loop, 5).S_d.to_tf(), TIMES).outputs[k]
    error, pade_error = (np.abs(found - exact).max() for found in (ours, theirs))
    note(f"delayed step response: error {error:.1e}, with Padé(5) {pade_error:.1e}")
    assert error * 1e4 <= pade_error


def blocks_of(loop):
    return loop.process, loop.model, loop.controller, loop.filter


def pade(loop, order):
    rational = loop.process.tf * ct.tf(*ct.pade(loop.delay, order))
    return nrdob.NRDOB(rational, loop.model, loop.controller, loop.filter)


def exact_sensitivity_step(loop, t):
    """Step response of S_d: 1/(q + r E) is the sum of (-r E)^k / q^(k+1), E = exp(-θs)."""
    blocks = (loop.process.tf, loop.model)
    N, D, Nm, Dm = (list(c) for G in blocks for c in (G.num[0][0], G.den[0][0]))

    def term(s, k):
        n, d, nm, dm = (mp.polyval(c, s) for c in (N, D, Nm, Dm))
        f = 1 / (loop.filter.time_constant * s + 1) ** loop.filter.order
        q, r = d * nm * (1 - f), n * dm * f
        return (-r / q) ** k / s

    with mp.workdps(30):
        terms = (
            mp.invertlaplace(partial(term, k=k), t - k * mp.mpf(loop.delay), method="talbot")
            for k in range(int(t / loop.delay) + 1)
        )
        return float(sum(terms))
