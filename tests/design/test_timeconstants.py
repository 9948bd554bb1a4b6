"""Every stabilising filter: closed forms, and counts of roots on both sides of every end."""

from __future__ import annotations

from math import cos, inf, pi, sqrt, tan

import control as ct
import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import nrdob
from campaigns.sets import campaign, floor_of
from nrdob import paper
from nrdob.design import (
    critical_time_constants,
    stabilizing_time_constants,
)
from nrdob.design.mismatch import Mismatch
from nrdob.numerics import count_rhp
from nrdob.sampling import random_block
from strategies import fractions, root_sets

s = ct.tf("s")
lag = 1 / (s + 1)


def above(process, model, order, **options):
    """Give the low end of a set that is everything above it."""
    *_, (low, high) = stabilizing_time_constants(process, model, order, **options)
    assert high == inf
    return low


@pytest.mark.parametrize("delay", [0.05, 0.5, 5.0])
def test_pure_delay_needs_lambda_above_two_theta_over_pi(delay):
    intervals = stabilizing_time_constants(nrdob.delay(delay) * lag, lag, 1, floor=0.1 * delay)
    assert intervals == [(pytest.approx(2 * delay / pi, rel=1e-12), inf)]


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 6])
def test_pure_delay_of_any_order(order):
    # exp(-jωθ) = 1 - (1 + jx)^n: |.| = 1 means 2 cos(nφ) cosⁿφ = 1 with x = tan φ.
    phi = brentq(lambda p: 2 * cos(order * p) * cos(p) ** order - 1, 1e-9, pi / (2 * order))
    expected = 0.7 * tan(phi) / (pi - 2 * order * phi)
    assert above(nrdob.delay(0.7) * lag, lag, order) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("zero", [0.03, 1.0, 100.0])
@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 6])
def test_zero_in_the_right_half_plane(order, zero):
    half = pi / (2 * order)
    expected = 1 / zero if order == 1 else tan(half) * cos(half) ** order / zero
    assert above((1 - s / zero) * lag, lag, order) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_neglected_double_lag(order):
    expected = {1: 0.5, 2: 0.3247, 3: 0.2419, 4: 0.1930}[order]
    found = above(lag / (0.2 * s + 1) ** 2, lag, order)
    assert found / 0.2 == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("side", [-1, 1])
def test_gain_error_is_borne_up_to_M_n_whatever_the_filter(order, side):
    limit = inf if order <= 2 else 1 + 1 / cos(pi / order) ** order
    gain = (1e6 if order <= 2 else limit) * (1 + side * 1e-6)
    stable = gain < limit
    assert stabilizing_time_constants(gain * lag, lag, order) == ([(0.0, inf)] if stable else [])
    assert stabilizing_time_constants(-0.01 * lag, lag, order) == []


def test_example_3_is_stable_below_three_minus_root_five():
    loop = paper.example(3)
    (interval,) = stabilizing_time_constants(loop.process, loop.model, 2)
    assert interval == (0, pytest.approx(3 - sqrt(5), rel=1e-12))


@pytest.mark.parametrize("g", [0.5, 2.0, 10.0, 40.0])
@pytest.mark.parametrize(("z", "p"), [(1.0, -1.0), (0.2, -3.0), (5.0, -0.5)])
def test_unstable_first_order_mismatch_has_the_smaller_root_of_a_quadratic(g, z, p):
    model = lag / (s + z)
    process = g * lag / (s + p)
    expected = min(
        root.real for root in np.roots([2 * p**2, -(4 * abs(p) + g * abs(p) + g * z), 2 * g])
    )
    (interval,) = stabilizing_time_constants(process, model, 2)
    assert interval == (0, pytest.approx(expected, rel=1e-9))


def test_disconnected_set_of_a_shifted_resonance():
    model = 1 / (s**2 + 0.02 * s + 1)
    process = 1 / ((s / 0.9) ** 2 + 0.02 * s / 0.9 + 1)
    (low, first), (second, high) = stabilizing_time_constants(process, model, 2)
    assert (low, high) == (0, inf)
    assert (first, second) == (pytest.approx(0.043, abs=5e-4), pytest.approx(2.67, abs=5e-3))


def test_no_filter_for_a_large_gain_and_two_lags_too_few():
    process, model = 20 / (s - 1) / (s + 2), 1 / ((s + 1) * (s + 2) * (0.1 * s + 1))
    assert stabilizing_time_constants(process, model, 4) == []


def test_a_matched_model_has_no_critical_time_constant():
    assert critical_time_constants(lag, lag, 1) == []
    assert stabilizing_time_constants(lag, lag, 1) == [(0.0, inf)]
    unstable = 1 / (s - 1)
    assert stabilizing_time_constants(unstable, unstable, 1) == []


def test_a_root_at_the_origin_leaves_nothing():
    assert stabilizing_time_constants(s * lag * lag, lag, 2) == []


def test_the_real_root_that_passes_through_infinity():
    (critical,) = critical_time_constants((1 - 0.01 * s) * lag, lag, 1)
    assert critical == (pytest.approx(0.01), inf, -1)


def test_the_critical_time_constants_of_a_dead_time_accumulate_at_zero():
    G = nrdob.delay(1.0) * lag
    near, far = (critical_time_constants(G, lag, 2, floor=floor) for floor in (0.1, 0.005))
    assert len(far) > 10 * len(near) > 0
    assert np.allclose(far[-len(near) :], near)


@pytest.mark.parametrize("order", [2, 3])
def test_a_critical_root_moves_as_its_direction_says(order):
    loop = paper.example(4, modified=True)
    mismatch = Mismatch.of(loop.process, loop.model, 3)
    for time_constant, frequency, direction in critical_time_constants(loop.process, loop.model, 3):
        assert (
            abs(mismatch.p_B(time_constant)(1j * frequency))
            < 1e-8
            * np.abs(mismatch.p_B(time_constant).scale)
            @ frequency ** np.arange(mismatch.p_B(time_constant).scale.size)[::-1]
        )
        before, after = (
            count_rhp(mismatch.p_B(time_constant * f)).count for f in (1 - 1e-6, 1 + 1e-6)
        )
        assert after - before == 2 * direction


def test_neutral_loops_are_complete_above_their_limit():
    # R = 2 s exp(-0.1 s) (1 + 1/s)…, n = 1: below λ = 2 infinitely many roots on the right.
    process, model = nrdob.delay(0.1) * 2 * (s + 1) / (s + 2), (s + 1) / (s + 2) / (s + 3)
    with pytest.raises(ValueError, match=r"up to 2 s leaves infinitely many roots"):
        stabilizing_time_constants(process, model, 1, floor=1.5)
    assert floor_of(process, model, 1) > 2


@pytest.mark.parametrize("floor", [0, -1.0, inf, float("nan")])
def test_floor_must_be_positive_and_finite(floor):
    with pytest.raises(ValueError, match="floor is"):
        stabilizing_time_constants(nrdob.delay(1) * lag, lag, 1, floor=floor)


def test_floor_so_small_that_it_never_ends_is_refused():
    with pytest.raises(ValueError, match="choose a larger one, or None for"):
        critical_time_constants(nrdob.delay(1) * lag, lag, 1, floor=1e-9)


def test_order_too_low_for_causality_is_refused():
    with pytest.raises(ValueError, match="not causal"):
        stabilizing_time_constants(lag**2, lag**2, 1)


# Random mismatches, orders to 6: roots on both sides of every end.


def roots_on_the_right(mismatch, time_constant):
    """Count by the roots themselves; the sets are backed by the argument."""
    return int(np.sum(mismatch.p_B(time_constant).roots.real > 0))


@st.composite
def mismatches(draw, *, delayed):
    order = draw(st.integers(1, 6))
    poles, zeros = draw(root_sets(order)), draw(root_sets(draw(st.integers(0, order)), right=False))
    stretch = 10 ** draw(st.floats(-0.3, 0.3))
    gain = 10 ** draw(st.floats(-0.5, 0.5))

    def block(stretch, gain):
        num, den = (np.real(np.poly(stretch * r)) if r.size else np.ones(1) for r in (zeros, poles))
        return ct.tf(gain * num / num[-1], den / den[-1])

    process = block(1.0, gain)
    model = draw(st.one_of(st.just(block(stretch, 1.0)), fractions(max_order=6)))
    if delayed:
        process = nrdob.delay(10 ** draw(st.floats(-2, 0.5))) * process
    relative_degree = model.den[0][0].size - model.num[0][0].size
    return process, model, max(1, relative_degree) + draw(st.integers(0, 1))


@pytest.mark.thorough
@pytest.mark.parametrize("delayed", [False, True])
@settings(max_examples=60)  # thousands in tests/campaigns/sets.py
@given(data=st.data())
def test_every_end_of_random_sets(delayed, data):
    process, model, order = data.draw(mismatches(delayed=delayed))
    assume(order <= 6)
    intervals = stabilizing_time_constants(process, model, order)
    mismatch, floor = Mismatch.of(process, model, order), floor_of(process, model, order)
    for low, high in intervals:
        for end, inside in ((low, 1 + 1e-5), (high, 1 - 1e-5)):
            if end in (0.0, inf, floor) or not low < end * inside < high:
                continue
            if end < 1e-4:  # λ^n is so small there that the roots themselves are only rounding
                continue
            try:
                found = roots_on_the_right(mismatch, end * inside)
                beyond = roots_on_the_right(mismatch, end / inside)
            except ArithmeticError:  # the root finder gives up on very long delays
                continue
            assert found == 0 < beyond


@pytest.mark.thorough
@settings(max_examples=60)
@given(data=st.data())
def test_random_sets_miss_nothing_on_a_scan(data):
    process, model, order = data.draw(mismatches(delayed=False))
    assume(order <= 6)
    intervals = stabilizing_time_constants(process, model, order)
    mismatch = Mismatch.of(process, model, order)
    for value in np.geomspace(1e-2, 1e2, 40):
        roots = mismatch.p_B(value).roots
        if np.min(np.abs(roots.real) / np.abs(roots)) < 1e-6:
            continue
        inside = any(low < value < high for low, high in intervals)
        assert inside == (not np.any(roots.real > 0))


# Poles and zeros on the axis, where branches jump, or pass through 1 at λ = 0.


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.1])
@pytest.mark.parametrize(
    ("process", "model", "order"),
    [
        ((2 * s**2 + 2) / (s**2 + 2 * s + 2), s / (s**2 + 4 * s + 3), 1),
        (1 / (s * (s + 1)), 1 / ((s + 0.1) * (s + 1)), 2),
        (1 / (s**2 + 1), 1 / (s**2 + 0.2 * s + 1.01), 2),
        ((s**2 + 4) / (s + 1) ** 3, 4 * lag**3, 3),
        ((s**2 + 1) / (s**2 + 1), 1 / (s**2 + 1), 4),
        (-1 * lag, (s**3 + 3 * s**2 + s + 3) / (s + 1) ** 3, 1),
    ],
)
def test_poles_and_zeros_on_the_axis(process, model, order, delay, no_warning_leaks):
    process = nrdob.delay(delay) * process if delay else process
    intervals = stabilizing_time_constants(process, model, order)
    mismatch = Mismatch.of(process, model, order)
    for value in np.geomspace(max(0.02, 2 * floor_of(process, model, order)), 50, 25):
        roots = mismatch.p_B(value).roots
        if np.abs(roots.real).min() > 1e-7:
            inside = any(low < value < high for low, high in intervals)
            assert inside == (not np.any(roots.real > 0))


def test_a_very_fast_filter_is_counted_without_overflow(no_warning_leaks):
    process = ct.tf([1.0, 3.0002, 4.0006, 4.0006, 3.0002, 1], [10.0, 41, 64, 46, 14, 1])
    model = ct.tf([-1.0], [1, 2.02, 2.04, 2.02, 1])
    assert stabilizing_time_constants(process, model, 5) == []
    counts = [count_rhp(Mismatch.of(process, model, 5).p_B(10.0**-k)).count for k in (9, 12, 16)]
    assert counts == [1, 1, 1]


@pytest.mark.thorough
@pytest.mark.parametrize("order", [1, 2])
def test_no_crossing_is_lost_where_it_falls_on_a_frequency_tried(order):
    for gain in np.geomspace(0.2, 10, 120):
        process = gain * nrdob.delay(1.0) * lag
        intervals = stabilizing_time_constants(process, lag, order)
        assert len(intervals) == 1
    critical = critical_time_constants(3.885 * nrdob.delay(1.0) * lag, lag, 1)
    frequencies = np.array([c.frequency for c in critical])
    # n = 1: cos ω = 0 and sin ω = 1, every turn one.
    assert np.allclose(np.diff(np.sort(frequencies)), 2 * pi)


@pytest.mark.slow
def test_a_fast_pair_far_beyond_all_roots_is_found():
    # R(∞) = 1e7: the pair of the fast filter crosses at some 1e7 times the fastest root.
    process = 1e3 * (s + 2) * (s + 1) / ((s - 100) * (s + 1))
    model = 1e-4 * (s + 1) / (s + 3)
    intervals = stabilizing_time_constants(process, model, 2)
    mismatch = Mismatch.of(process, model, 2)
    counts = {float(v): count_rhp(mismatch.p_B(v)).count for v in np.geomspace(1e-6, 1e6, 60)}
    for value, count in counts.items():
        assert (count == 0) == any(low < value < high for low, high in intervals)


def test_a_pair_that_creeps_across_far_out_has_its_direction():
    # At 1.7e8 rad/s the real part moves a ten-millionth as fast as the imaginary one.
    process = ct.tf([0.1, 10.11, 11.01, 1.0], [1e-5, 3.2e-4, 0.10261, 1.2043, 2.102, 1.0])
    model = ct.tf([-1.0], [-1e6, -3.01e6, -3.0299e6, -1.029699e6, -9697.0, 103.0, 1.0])
    creeping, last = critical_time_constants(process, model, 6)
    assert creeping.frequency > 1e8 and (creeping.direction, last.direction) == (1, -1)


def test_whole_turns_of_the_phase_leave_no_false_crossing(no_warning_leaks):
    # The phase of -H ends a turn away from where it began; far out R is below 1e-25.
    process = ct.tf([1.0, 1.0], [1.0, 4.02, 7.08, 8.12, 7.08, 4.02, 1.0])
    critical = critical_time_constants(process, ct.tf([-1.0], [1.0]), 1)
    assert all(c.time_constant > 1e-12 for c in critical)
    assert stabilizing_time_constants(process, ct.tf([-1.0, -1.0], [1.0, 1.0]), 1) == []


def test_a_crossing_of_a_branch_that_is_large_is_found():
    # H = 1/(s² + 2e-6 s + 1), n = 1: λ = 2e-6 and 5e5, where the branch is 5e5 in size.
    process = ([1, 2e-6, 2], np.polymul([1, 1], [1, 2e-6, 1]))
    (first, second) = stabilizing_time_constants(process, lag, 1)
    assert first == (0, pytest.approx(2e-6, rel=1e-6))
    assert second == (pytest.approx(5e5, rel=1e-6), inf)


def test_a_crossing_beside_a_pole_on_the_axis_is_kept_apart_from_the_jump():
    # H = 1e-10 (s + 1)/(s² + 4), n = 1: λs³ + … is lost at λ = 1, 2.5e-11 rad/s from the pole.
    process = ([1, 1e-10, 4 + 1e-10], np.polymul([1, 1], [1, 0, 4]))
    (interval,) = stabilizing_time_constants(process, lag, 1)
    assert interval == (0, pytest.approx(1.0, rel=1e-4))  # as well as 4 + 1e-10 is known


def test_the_jump_at_an_undamped_pole_is_no_crossing_at_a_huge_time_constant():
    process = ct.tf([-0.28157946, 0, -0.26895486], np.polymul([1, 0.12244663], [1, 0, 3.3426]))
    model = ct.tf([-0.3918, -1.068], [1, 1.745, 0.3919])
    for time_constant, _, _ in critical_time_constants(process, model, 2):
        assert time_constant < 1e4


@pytest.mark.parametrize("floor", [True, "0.1", 1j])
def test_a_floor_that_is_no_number_is_named(floor):
    with pytest.raises(TypeError, match="floor is"):
        stabilizing_time_constants(nrdob.delay(1) * lag, lag, 1, floor=floor)


@pytest.mark.parametrize("exponent", [-9, 9])
def test_another_unit_of_time_changes_nothing_else(exponent):
    unit = 10.0**exponent
    loop = paper.example(4, modified=True)

    def rescaled(block):
        num, den = block.num_array[0, 0], block.den_array[0, 0]
        return ct.tf(*(c * unit ** np.arange(c.size - 1.0, -1, -1) for c in (num, den)))

    process = nrdob.delay(loop.delay * unit) * rescaled(loop.process.tf)
    model = rescaled(loop.model)
    there = stabilizing_time_constants(process, model, 3)
    here = stabilizing_time_constants(loop.process, loop.model, 3)
    assert np.array(there) == pytest.approx(np.array(here) * unit, rel=1e-9)


@pytest.mark.thorough
def test_a_sample_of_the_campaign_finds_no_fault():
    found = campaign(40, seed=1)
    assert not [name for name in found if name.startswith("WRONG")]


# Models with an integrator, which cancels inside (1 - F)·model.


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_an_integrating_model_of_a_lag_is_lost_where_the_root_passes_zero(order):
    # p_B = (s + 1)((λs + 1)^n - 1)/s - g passes s = 0 at λ = g/n.
    for gain in (0.02, 1.0, 30.0):
        process, model = ct.tf([-gain], [1, 1]), ct.tf([1], [1, 0])
        critical = critical_time_constants(process, model, order)
        assert (gain / order, 0.0, -1) in [
            (pytest.approx(c.time_constant), c.frequency, c.direction) for c in critical
        ]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_matched_integrator_works_with_every_filter_of_one_and_two_with_none(order):
    one, two = ct.tf([1], [1, 0]), ct.tf([1], [1, 0, 0])
    assert stabilizing_time_constants(one, one, order) == [(0.0, inf)]
    assert stabilizing_time_constants(two, two, order + 1) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_sets_of_integrating_models_agree_with_verdicts(seed):
    rng = np.random.default_rng(seed)
    model = random_block(rng, 2) / ct.tf("s")
    process = random_block(rng, 2)
    if seed % 2:
        process = process / ct.tf("s")
    if seed % 4 > 1:
        process = nrdob.delay(0.3) * process
    order = model.den[0][0].size - model.num[0][0].size + 1
    floor = 0.1 if seed % 4 > 1 else None
    found = stabilizing_time_constants(process, model, order, floor=floor)
    for value in np.geomspace(0.11, 30, 8):
        stable = nrdob.judge_observer(process, model, nrdob.LowPassFilter(value, order)).stable
        assert stable is any(low < value < high for low, high in found)


# A model that waits.


PRACTICAL = (1.4775, 2.3911, 3.0427, 3.5775, 4.0421, 4.4585)
"""c_n: a matched model that waits is lost where its dead time is wrong by c_n λ, λ far below it."""


def lost_at(n):
    """Minimum of (2/x) arcsin((1 + x²)^(n/2)/2), from |exp(jωΔ) - 1| = |1 + jλω|^n, x = λω."""
    x = np.linspace(0, sqrt(4 ** (1 / n) - 1), 1_000_001)[1:-1]
    return float(np.min(2 / x * np.arcsin((1 + x**2) ** (n / 2) / 2)))


@pytest.mark.thorough
@pytest.mark.parametrize("n", range(1, 7))
@pytest.mark.parametrize("side", [-1, 1])
def test_a_dead_time_wrong_by_c_n_time_constants_is_too_wrong(n, side):
    wrong = 1e-3
    plant = nrdob.delay(1.0 + side * wrong) * lag
    low = above(plant, nrdob.delay(1.0) * lag, n, floor=wrong / PRACTICAL[n - 1] / 2)
    assert wrong / low == pytest.approx(PRACTICAL[n - 1], abs=6e-5)
    assert wrong / low == pytest.approx(lost_at(n), rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 3])
def test_an_exact_model_that_waits_is_stable_for_every_filter(n):
    G = nrdob.delay(2.0) * lag
    assert critical_time_constants(G, G, n) == []
    assert stabilizing_time_constants(G, G, n, floor=1e-3) == [(1e-3, inf)]
    assert stabilizing_time_constants(G, G, n) == [(0, inf)], "no dead time is left in p_B"
    unstable = nrdob.delay(2.0) / (s - 1)
    assert stabilizing_time_constants(unstable, unstable, n) == []
    low, _ = nrdob.admissible_time_constants(G, G, n, max_ms=1.6)[0]
    assert low > 0.1, "the dead time still limits the sensitivity"


def test_waiting_makes_example_4_stable_for_every_filter_and_a_wrong_wait_does_not():
    ex = paper.example(4)
    assert len(stabilizing_time_constants(ex.process, ex.model, 3)) == 1
    waits = nrdob.delay(0.05) * ex.model
    floor = 1e-3
    assert stabilizing_time_constants(ex.process, waits, 3, floor=floor) == [(floor, inf)]
    late = nrdob.delay(0.07) * ex.model
    *_, (low, high) = stabilizing_time_constants(ex.process, late, 3, floor=floor)
    assert low > floor and high == inf


@pytest.mark.thorough
def test_sets_of_models_that_wait_end_where_verdicts_change():
    rng = np.random.default_rng(0)
    ends = 0
    for k in range(16):
        order = 1 + k % 2
        poles = 10 ** rng.uniform(-1, 1, order) * rng.choice([1, 1, 1, -1], order)
        near = np.abs(poles) * 10 ** rng.uniform(-0.3, 0.3, order)
        G = ct.tf([10 ** rng.uniform(-0.5, 0.5)], np.poly(-poles))
        Gm = ct.tf([1.0], np.poly(-near))
        theta = 0.0 if k % 5 == 0 else 10 ** rng.uniform(-2, 0.5)
        wait = theta if k % 7 == 0 else (theta or 0.5) * 10 ** rng.uniform(-0.3, 0.3)
        G, Gm = nrdob.delay(theta) * G, nrdob.delay(wait) * Gm
        n = order + int(rng.integers(0, 2))
        intervals = stabilizing_time_constants(G, Gm, n)
        floor = floor_of(G, Gm, n)
        inner = [end for pair in intervals for end in pair if 1.001 * floor < end < inf]
        tried = [end * (1 + side * 1e-5) for end in inner for side in (-1, 1)]
        for time_constant in [*tried, *np.geomspace(max(1.01 * floor, 1e-4), 100, 4)]:
            found = nrdob.judge_observer(G, Gm, nrdob.LowPassFilter(time_constant, n))
            assert found.stable is any(low < time_constant < high for low, high in intervals)
        ends += len(inner)
    assert ends >= 10


@pytest.mark.parametrize("order", [2, 7])
@pytest.mark.parametrize("gain", [0.9, 1e-6])
@pytest.mark.parametrize("damping", [0.0, 5e-11])
def test_a_border_beside_an_undamped_pole_is_exact(damping, gain, order):
    # There λ(ω) is so steep that the frequencies that floats can tell apart are too coarse.
    process = gain * ct.tf([1.0], [1.0, 2 * damping, 1.0])
    model = ct.tf([1.0], [1.0, 0.02, 1.01])
    factors = Mismatch.of(process, model, order).factors
    N, D, Nm, Dm = ([mp.mpf(float(c)) for c in p] for p in factors)

    def p_B(w, time_constant):
        jw = mp.mpc(0, w)
        ahead = mp.polyval(D, jw) * mp.polyval(Nm, jw) * ((1 + time_constant * jw) ** order - 1)
        value = ahead + mp.polyval(N, jw) * mp.polyval(Dm, jw)
        return [value.real, value.imag]

    with mp.workdps(40):
        for found, frequency, _ in critical_time_constants(process, model, order):
            exact = mp.findroot(p_B, (mp.mpf(frequency), mp.mpf(found)))[1]
            assert abs(found / exact - 1) < 1e-10


@pytest.mark.parametrize(
    ("process", "model", "order", "expected"),
    [
        (4 / (-(s**2) - s + 2), -1 / s, 2, [(0, 1)]),
        (2 / (s - 2), (0.25 * s + 1) / s, 2, [(0, 0.5)]),
        (-1 / (s**2 + 0.75 * s + 1), 1 / (s**2 + s), 2, [(0.5, inf)]),
        (nrdob.delay(0.125) * 2 / (s - 2), (0.125 * s + 1) / s, 2, [(0.41899036722961414, 0.5)]),
        (ct.tf([1], [1]), -1 / s, 1, [(0, 1), (1, inf)]),  # p_B vanishes at λ = 1: ill-posed
    ],
)
def test_two_roots_that_pass_the_origin_at_one_time_constant(process, model, order, expected):
    found = stabilizing_time_constants(process, model, order)
    assert [pytest.approx(each, rel=1e-9) for each in expected] == found
    for low, high in found:  # on both sides of every end
        for lam in (low * 1.0001, high * 0.9999, low * 0.9999, high * 1.0001):
            if 0 < lam < inf:
                verdict = nrdob.judge_observer(process, model, nrdob.LowPassFilter(lam, order))
                assert verdict.stable is any(a < lam < b for a, b in found)
