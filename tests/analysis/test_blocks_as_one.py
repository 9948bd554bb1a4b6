"""Blocks built as one: verdicts and steps against the diagram put together block by block."""

import control as ct
import numpy as np
import pytest

import nrdob
from blockwise import diagram, polynomial, step
from nrdob import NRDOB, LowPassFilter, interpolating_filter

s = ct.tf("s")


def random_roots(rng, count, right):
    """Roots on the left, and at least `right` of them on the right; pairs and double ones too."""
    roots = []
    while len(roots) < count:
        kind = rng.choice(["real", "pair", "double"]) if count - len(roots) >= 2 else "real"
        size = 10 ** rng.uniform(-0.7, 0.7) * (1 if len(roots) < right else -1)
        pair = size * np.exp(1j * rng.uniform(0.3, 1.2))
        roots += {"real": [size], "pair": [pair, pair.conjugate()], "double": [size, size]}[kind]
    return roots


def placed(rng, Nm, Dm):
    """A controller under which p_A has random roots on the left; None if it is of a wild size."""
    n = Dm.size - 1
    Nm = np.pad(Nm, (Dm.size - Nm.size, 0))
    matrix = np.zeros((2 * n, 2 * n))
    for k in range(n):
        matrix[k : k + n + 1, k], matrix[k : k + n + 1, n + k] = Dm, Nm
    if np.linalg.cond(matrix) > 1e4:
        return None
    C = np.linalg.solve(matrix, polynomial(random_roots(rng, 2 * n - 1, 0)))
    return C[n:], C[:n]


def cases(seed, count):
    """Loops whose model is unstable, non-minimum-phase or integrating, and what is in no block."""
    rng = np.random.default_rng(seed)
    while count:
        order = int(rng.integers(1, 4))
        integrators = int(rng.integers(0, min(order, 2) + 1)) if rng.random() < 0.4 else 0
        zeros = random_roots(rng, int(rng.integers(0, order)), int(rng.integers(0, 2)))
        poles = random_roots(rng, order - integrators, int(rng.integers(0, 2)))
        gain = 10 ** rng.uniform(-1, 1)
        at_0 = [0.0] * integrators
        Nm, Dm = gain * polynomial(zeros), polynomial([*poles, *at_0])
        C = placed(rng, Nm, Dm)
        if C is None:
            continue
        count -= 1
        off = rng.choice([0.0, 1e-3, 0.1, 0.5])  # matched, nearly, hardly, not at all
        shifts = 1 + off * rng.uniform(-1, 1, 3)
        N = shifts[0] * gain * polynomial(np.multiply(zeros, shifts[1]))
        D = polynomial([*np.multiply(poles, shifts[2]), *at_0])
        ramp = max(integrators, 1) + int(rng.integers(0, 2))
        F = interpolating_filter(ct.tf(Nm, Dm), 10 ** rng.uniform(-1, 0.5), ramp=ramp)
        hidden = [z for z in zeros if np.real(z) > 0], [p for p in poles if np.real(p) > 0] + at_0
        yield NRDOB(ct.tf(N, D), ct.tf(Nm, Dm), C, F), hidden, off


def apart(loop, hidden):
    return diagram(*map(tuple, loop.fractions), *hidden)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(5))
def test_random_verdicts_are_those_of_the_blocks(seed):
    verdicts = []
    for loop, hidden, off in cases(seed, 80):
        rightmost = np.linalg.eigvals(apart(loop, hidden).A).real.max()
        verdict = loop.stability()
        assert off > 0 or verdict.stable, (loop, verdict)  # matched: p_B = N D Df on the left
        if abs(rightmost) > 1e-2:  # roots at -1/λ come many at once, and scatter
            assert verdict.stable == (rightmost < 0), (loop, verdict, rightmost)
            verdicts.append(verdict.stable)
    assert verdicts.count(True) > 40 and verdicts.count(False) > 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 12])
def test_steps_are_those_of_the_blocks(seed):
    for loop, hidden, _ in cases(seed, 12):
        system, times = apart(loop, hidden), np.linspace(0, 5, 21)
        if not loop.stability().stable or np.abs(system.A).max() > 1e4:  # lost by the exponential
            continue
        for column, input in enumerate(("R", "d", "delta", "eta")):
            expected = step(system, column, times)
            if input == "delta":
                expected[1] += 1  # eq. (7) has the plant's input there
            found = loop.step_response(input, times).outputs[:, 0]
            size = np.abs(expected).max(axis=1, keepdims=True)
            assert np.abs(found - expected).max() <= 1e-5 * size.max(), (loop, input)


@pytest.mark.parametrize(
    ("gain", "pole", "rightmost"),
    [
        (1.0, 1.0, (-2.0, -2.0, -1 / 3)),
        (1.2, 1.1, (-2.0, -0.909, -0.084)),
        (0.6, 1.0, (-2.0, -0.328, 0.391)),
        (1.0, 1.3, (-2.0, -1.078, 0.151)),
    ],
)
def test_a_matched_model_works_for_an_unstable_plant_and_for_its_neighbours(gain, pole, rightmost):
    model = 4 / (2 - s - s**2)
    for lag, expected in zip((0.05, 0.5, 3.0), rightmost, strict=True):
        F = interpolating_filter(model, lag)
        found = nrdob.judge_observer(4 * gain / ((pole - s) * (s + 2)), model, F)
        assert found.rightmost.real == pytest.approx(expected, abs=6e-4)
        assert found.stable is (expected < 0)
        assert found.closed_loop_rhp == found.encirclements + found.open_loop_rhp
        assert found.name == "L (ii)" and "s = 1" in found.reason


def test_a_matched_model_works_for_a_zero_on_the_right():
    G = (1 - s) / (s + 1) ** 2
    loop = NRDOB(G, G, 0.2 / s, (1 - s) / ((1 + s) * (0.3 * s + 1)))
    verdict = loop.stability()
    assert verdict.stable is True
    assert verdict.model_loop.rightmost.real == pytest.approx(-0.214, abs=5e-4)
    assert verdict.observer_loop.name == "F H (ii)"  # nothing cancels in (1 - F) Gm
    assert "s = 1 cancels inside F/Gm" in verdict.reason


def test_an_integrating_model_and_the_filter_1_leave_no_root_at_zero():
    loop = NRDOB(1 / s, 1 / s, 2, LowPassFilter(0.05, 4))
    found = loop.stability()
    assert found.stable is True and "s = 0 cancels inside (1-F)Gm" in found.reason
    assert "rounding" not in found.reason  # s = 0 is exact
    assert loop.p_A.roots == pytest.approx([-2])
    assert loop.p_B.q == pytest.approx(np.poly([-20] * 4) * 0.05**4)
    assert loop.K(0) == pytest.approx(1 / (4 * 0.05)) and loop.S_delta(0) == pytest.approx(0.2)
    assert loop.margins().observer_loop.gm == pytest.approx(loop.margins().plant_loop.gm)
    eigenvalues = np.linalg.eigvals(apart(loop, ([], [0.0])).A)
    assert np.all(np.abs(eigenvalues - np.where(eigenvalues.real > -5, -2, -20)) < 2)


def test_two_integrators_ask_for_a_ramp_filter_and_three_zeros_for_no_error():
    model = 1 / s**2
    C = (3 * s + 1) / (0.05 * s + 1)
    refused = NRDOB(model, model, C, LowPassFilter(0.1, 2)).stability()
    assert refused.stable is False and "1 - F ~ s^2" in refused.reason
    for ramp, error in ((2, 3 * 0.1**2), (3, 0.0)):
        F = interpolating_filter(model, 0.1, ramp=ramp)
        loop = NRDOB(model, model, C, F)
        assert loop.stability().stable is True
        assert abs(loop.S_delta(0)) == pytest.approx(error, abs=1e-12)


@pytest.mark.parametrize(("zeros", "poles", "name"), [([2.0], [], "F/Gm"), ([], [2.0], "(1-F)Gm")])
def test_what_rests_on_rounding_is_named_and_what_is_only_near_is_kept(zeros, poles, name):
    model = ct.tf(polynomial(zeros), polynomial([-1, -2, *poles]))
    F = interpolating_filter(model, 0.2)
    found = nrdob.judge_observer(model, model, F)
    assert found.stable is True
    assert f"s = 2 cancels inside {name}" in found.reason
    assert f"to rounding only: build {name} as one" in found.reason
    num, den = F.num[0][0], F.den[0][0]
    num = num + 1e-9 * (np.arange(num.size) < num.size - 1)
    kept = nrdob.judge_observer(model, model, (num, den))
    assert kept.stable is False and kept.rightmost == pytest.approx(2)
    assert nrdob.judge_observer(model, model, F, keep_factors=True).stable is not True


@pytest.mark.parametrize("drop", ["pole", "zero", "double pole", "ramp"])
def test_a_condition_that_is_dropped_leaves_its_root(drop):
    G = {
        "pole": ct.tf([1], polynomial([1, -3])),
        "zero": ct.tf([-1, 2], polynomial([-1, -3])),
        "double pole": ct.tf([1], polynomial([1, 1, -3])),
        "ramp": ct.tf([1], [1, 2, 0, 0]),
    }[drop]
    of_less = {
        "pole": ct.tf([1], polynomial([-1, -3])),
        "zero": ct.tf([2], polynomial([-1, -3])),
        "double pole": ct.tf([1], polynomial([1, -1, -3])),
        "ramp": ct.tf([1], [1, 2, 0]),
    }[drop]
    whole = interpolating_filter(G, 0.3)
    order = whole.den[0][0].size - 1
    less = interpolating_filter(of_less, 0.3, order)
    assert nrdob.judge_observer(G, G, whole).stable is True
    assert nrdob.judge_observer(G, G, less).stable is not True
