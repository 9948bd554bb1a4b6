"""What holds for every filter, for all fast and all slow ones: held against the exact sets."""

from __future__ import annotations

from math import inf

import control as ct
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import nrdob
from nrdob import paper
from nrdob.design import (
    gain_bound,
    right_half_plane_parity,
    stabilizing_filter_exists,
    stabilizing_time_constants,
    stable_for_fast_filters,
    stable_for_slow_filters,
)
from nrdob.design.mismatch import Mismatch
from nrdob.numerics import count_rhp
from strategies import fractions

s = ct.tf("s")
lag = 1 / (s + 1)


@st.composite
def mismatches(draw):
    """Process, model and an order, with the relative degrees in every relation to each other."""
    process, model = draw(fractions()), draw(fractions())
    relative_degree = model.den[0][0].size - model.num[0][0].size
    return process, model, max(1, relative_degree) + draw(st.integers(0, 3))


@pytest.mark.thorough
@given(mismatches())
def test_the_ends_of_the_exact_set_are_as_the_limits_say(case):
    intervals = stabilizing_time_constants(*case)
    slow, fast = stable_for_slow_filters(*case), stable_for_fast_filters(*case)
    if slow.holds is not None:
        assert slow.holds == (bool(intervals) and intervals[-1][1] == inf), slow
    if fast.holds is not None:
        assert fast.holds == (bool(intervals) and intervals[0][0] == 0), fast


@pytest.mark.slow
@given(mismatches(), st.floats(-2, 2))
def test_the_parity_of_the_count_is_that_of_the_signs(case, exponent):
    process, model, order = case
    mismatch = Mismatch.of(*case)
    assume(mismatch.excess < order)
    count = count_rhp(mismatch.p_B(10**exponent)).count
    assume(count is not None)
    assert right_half_plane_parity(process, model).holds == (count % 2 == 0)


@pytest.mark.slow
@given(mismatches())
def test_where_no_filter_exists_none_of_ours_does(case):
    process, model, order = case
    if stabilizing_filter_exists(process, model).holds is False:
        assume(Mismatch.of(*case).excess < order)
        assert stabilizing_time_constants(*case) == []


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_dead_time_is_never_stable_for_all_fast_filters(order):
    answer = stable_for_fast_filters(nrdob.delay(0.1) * lag, lag, order)
    assert answer.holds is False and "dead time" in answer.reason


@pytest.mark.parametrize("number", paper.EXAMPLES)
def test_every_example_passes_the_parity_test(number):
    loop = paper.example(number)
    assert right_half_plane_parity(loop.process, loop.model).holds is True
    assert stabilizing_filter_exists(loop.process, loop.model).holds is not False


def test_an_unstable_pole_asks_for_the_opposite_sign():
    process = 4 / (2 - s - s**2)
    answer = right_half_plane_parity(process, 1 / ((s + 1) * (s + 2)))
    assert answer.holds is False and "opposite DC sign" in answer.reason
    assert right_half_plane_parity(process, -1 / ((s + 1) * (s + 2))).holds is True


def test_a_model_with_a_right_half_plane_zero_turns_the_sign_round():
    process = 4 / (2 - s - s**2)
    assert right_half_plane_parity(process, (1 - s) / ((s + 1) * (s + 2))).holds is True


def test_a_matched_model_has_a_filter_made_for_its_unstable_poles_and_zeros():
    for process in (4 / (2 - s - s**2), (s - 3) / ((s - 1) * (s + 2)), 1 / s**2, 1 / (s**2 + 1)):
        answer = stabilizing_filter_exists(process, process)
        assert (
            answer.holds is True
            and "made for what process and model have in common" in answer.reason
        )
        assert stabilizing_filter_exists(-process, process).holds is False
    waits = stabilizing_filter_exists(nrdob.delay(0.1) / (s - 1), 1 / (s - 1))
    assert waits.holds is None
    assert stabilizing_filter_exists(-nrdob.delay(0.1) / (s - 1), 1 / (s - 1)).holds is False


def test_a_model_that_waits_cancels_zeros_and_integrators_but_no_other_pole():
    def asked(plant, model):
        return stabilizing_filter_exists(nrdob.delay(0.2) * plant, nrdob.delay(0.1) * model)

    assert asked(1 / (s - 1), 1 / (s - 1)).holds is False
    for block in (1 / s**2, (1 - s) / (s + 1) ** 2, 1 / s):
        assert asked(block, block).holds is None
        assert asked(-block, block).holds is False
        F = nrdob.interpolating_filter(nrdob.delay(0.1) * block, 1.0)
        assert nrdob.judge_observer(nrdob.delay(0.1) * block, nrdob.delay(0.1) * block, F).stable


@pytest.mark.parametrize("zeros", [(2, 1), (1, 2)])
def test_a_common_zero_of_another_multiplicity_turns_the_sign_round(zeros):
    # p_B(0) has the sign of N(0)/Nc(0), but p_B(1) that of D(1) > 0.
    process, model = ((s - 1) ** k / (s + 1) ** 3 for k in zeros)
    assert stabilizing_filter_exists(process, model).holds is False
    assert stabilizing_filter_exists(-process, model).holds is True


def common_roots(rng):
    """Draw a process and a model with an unstable pole, a zero on the right or both in common."""
    kind, own = rng.integers(3), rng.random() < 0.3
    p, z, q = 10 ** rng.uniform(-0.7, 0.5, 3)
    lags, zero = -(10 ** rng.uniform(-1, 1, 4)), -(10 ** rng.uniform(-1, 1))
    roots = []
    for k in range(2):
        near = 10 ** (k * rng.uniform(-0.3, 0.3, 5))
        twice = 1 + int(rng.random() < 0.2)
        left, ends = (zero * near[4],), lags * near[:4]
        other = (q,) if own and k == 0 else ()
        roots.append([
            ((*left, *other), (*ends[:2], *[p] * twice)),
            ([z] * twice, (*ends, *other)),
            ((*left, z), (*ends[:2], *[p] * twice)),
        ][kind])  # fmt: skip
    G, Gm = (ct.tf(np.real(np.poly(zeros)), np.real(np.poly(poles))) for zeros, poles in roots)
    sign = 1 if rng.random() < 0.8 else -1
    return sign * 10 ** rng.uniform(-0.3, 0.3) / G.dcgain() * G, Gm / Gm.dcgain()


@pytest.mark.slow
def test_where_common_roots_leave_a_filter_some_are_found_and_where_they_do_not_none_is():
    rng, seen = np.random.default_rng(6), []
    for _ in range(30):
        G, Gm = common_roots(rng)
        answer = stabilizing_filter_exists(G, Gm).holds
        assert answer is not None
        filters = [nrdob.interpolating_filter(Gm, value) for value in (0.003, 0.03, 0.3, 3.0)]
        found = any(nrdob.judge_observer(G, Gm, F).stable for F in filters)
        assert answer or not found
        seen.append((answer, found))
    assert seen.count((True, True)) > 8 < seen.count((False, False))


def test_parity_interlacing_fails_between_two_real_zeros():
    # H = k (s-1)(s-3)/(s-2)^… has an unstable pole between two real zeros on the right.
    a = np.poly([2.0, 2.5, -5.0])
    difference = -0.2 * np.poly([1.0, 2.2, -1.0])
    model = ct.tf([1.0], [1, 3, 3, 1])
    process = ct.tf(a + difference, np.convolve(a, [1, 3, 3, 1]))
    answer = stabilizing_filter_exists(process, model)
    assert answer.holds is False and "stable filter" in answer.reason
    assert all(stabilizing_time_constants(process, model, n) == [] for n in (3, 4, 5, 6))


@pytest.mark.parametrize("answer", [stable_for_fast_filters, stable_for_slow_filters])
def test_a_root_at_the_origin_is_named(answer):
    found = answer(s * lag**2, lag, 2)
    assert found.holds is False and "s = 0" in found.reason


def test_exactly_at_the_bound_the_question_is_open():
    assert gain_bound(3) == pytest.approx(9, abs=1e-12)
    bound = gain_bound(4)
    assert stable_for_slow_filters(bound * lag, lag, 4).holds is None
    assert stable_for_fast_filters(bound * lag, lag, 4).holds is None


# Roots on the axis: the set decides, as other terms than the first do.


@pytest.mark.parametrize(
    ("answer", "process", "model"),
    [
        (stable_for_slow_filters, lag / (s**2 + 1), lag / (s**2 + 0.5 * s + 1)),
        (stable_for_slow_filters, 1 / (s**2 + 1) ** 2, lag**4),
        (stable_for_fast_filters, lag**2, 1 / (s**2 + 1)),
        (stable_for_fast_filters, lag / (s**2 + 1), lag / (s**2 + 1)),
        (stable_for_fast_filters, s * lag**2, (s + 3) / s**2),
    ],
)
def test_roots_of_the_limit_on_the_axis_leave_the_question_open(answer, process, model):
    found = answer(process, model, 4)
    assert found.holds is None and "stabilizing_time_constants" in found.reason


@pytest.mark.parametrize("delay", [0.0, 0.3])
@pytest.mark.parametrize("zero", [0.2, 5.0])
@pytest.mark.parametrize("order", [1, 2])
def test_an_integrator_under_a_slow_filter(order, zero, delay):
    # n = 1: λ s² a1 (1 + αs) + b0 (1 + βs) = 0 near 0, stable if β > α; from n = 2 on, never.
    process = nrdob.delay(delay) * (s + zero) / (s * (s + 1))
    answer = stable_for_slow_filters(process, 1 / (s + 1), order)
    *_, (_, high) = [(0, 0), *stabilizing_time_constants(process, 1 / (s + 1), order)]
    assert (high == inf) == (order == 1 and 1 / zero - delay > 0)
    assert answer.holds is (None if order == 1 else False)


# A filter that falls no faster than H grows.


def test_where_F_H_is_biproper_infinity_forbids_nothing():
    process, model = ct.tf([-0.137, -2.51], [1, -0.694]), ct.tf([1], [1, 0.128])
    assert stabilizing_filter_exists(process, model).holds is True
    assert right_half_plane_parity(process, model).holds is False
    assert nrdob.NRDOB(process, model, 0.0, nrdob.LowPassFilter(0.05, 1)).stability().stable
    ((low, high),) = stabilizing_time_constants(process, model, 1)
    assert low < 0.05 < high


@pytest.mark.thorough
@given(mismatches())
def test_where_a_filter_of_ours_does_the_existence_is_not_denied(case):
    if stabilizing_time_constants(*case):
        assert stabilizing_filter_exists(case[0], case[1]).holds is not False


@pytest.mark.parametrize("order", [0, -1])
def test_gain_bound_refuses_no_lag_at_all(order):
    with pytest.raises(ValueError, match="order"):
        gain_bound(order)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize(
    "process",
    [lag, -lag, lag / s, -lag / s, s * lag**2, -s * lag**2, (1 - s) * lag**2, 1 / s, 1 / (s - 1)],
)
def test_the_ends_under_an_integrating_model_are_those_of_the_set(process, order):
    model = 1 / s
    found = stabilizing_time_constants(process, model, order)
    slow, fast = (
        rule(process, model, order).holds
        for rule in (stable_for_slow_filters, stable_for_fast_filters)
    )
    assert slow is None or slow is bool(found and found[-1][1] == inf)
    assert fast is None or fast is bool(found and found[0][0] == 0)
    if found:
        assert right_half_plane_parity(process, model).holds is not False
        assert stabilizing_filter_exists(process, model).holds is not False


# A model that waits.


@pytest.mark.parametrize(
    ("gain", "theta", "n", "slow"),
    [(2.5, 1.0, 1, True), (1.0, 1.1, 1, True), (7.0, 0.0, 3, True), (9.5, 1.0, 3, False)],
)
def test_a_dead_time_of_the_model_changes_nothing_for_slow_filters(gain, theta, n, slow):
    process, model = nrdob.delay(theta) * (gain * lag), nrdob.delay(1.0) * lag
    assert stable_for_slow_filters(process, model, n).holds is slow
    assert nrdob.judge_observer(process, model, nrdob.LowPassFilter(1e3, n)).stable is slow
    fast = stable_for_fast_filters(process, model, n)
    assert fast.holds is None and "stabilizing_time_constants" in fast.reason


@pytest.mark.parametrize("theta", [0.0, 1.0, 1.3])
def test_signs_forbid_the_same_to_a_model_that_waits(theta):
    process, model = 4 / (2 - s - s**2), 1 / (s**2 + 3 * s + 2)
    late = nrdob.delay(theta) * process if theta else process
    assert right_half_plane_parity(late, nrdob.delay(1.0) * model).holds is False
    assert stabilizing_filter_exists(late, nrdob.delay(1.0) * model).holds is False
    fitting = stabilizing_filter_exists(late, nrdob.delay(1.0) * -model)
    assert fitting.holds is None and "dead time" in fitting.reason


def test_points_at_which_signs_differ_are_named_the_positive_one_first():
    G, zero = ct.tf([4], [-1, -1, 2]), ct.tf([4, -2], [1, 3])
    for process, model, named in (
        (-G, G, "s = 0 and at infinity"),
        (G, -G, "infinity and at s = 0"),
        (zero * G, G, "s = 0 and at the common pole 1"),
    ):
        answer = stabilizing_filter_exists(process, model)
        assert answer.holds is False and answer.reason.endswith(f"opposite signs at {named}")


def test_zeros_of_H_without_its_dead_time_forbid_nothing_behind_one():
    # Over the common s - 1, H has the numerator b exp(-sθ) - a. Where a < 0 it has two zeros near
    # 3.5 without dead time, which forbid every F, and none with 1 s.
    b = np.poly1d([100.0]) * np.poly1d([3.0, 4.0], r=True) * np.poly1d([1.0, 1.0])
    a = np.poly1d([-1.0, -3.0, 6.0], r=True)
    x = np.linspace(0, 6, 6001)
    assert [np.sum(np.diff(b(x) * np.exp(-x * T) > a(x))) for T in (0.0, 1.0)] == [2, 0]
    process = 100 * (s - 3) * (s - 4) / ((s - 1) * (s + 1) * (s + 3))
    model = (s - 6) / ((s - 1) * (s + 1))
    assert stabilizing_filter_exists(process, model).holds is False
    assert stabilizing_filter_exists(nrdob.delay(1.0) * process, model).holds is None
