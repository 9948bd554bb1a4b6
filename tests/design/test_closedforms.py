"""The design card against the exact sets, and against norms computed another way."""

from __future__ import annotations

from math import inf, sqrt

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import LowPassFilter
from nrdob.design import (
    disturbance_index,
    gain_bound,
    noise_index,
    sensitivity_floor,
    smallest_for_delay,
    smallest_for_double_lag,
    smallest_for_rhp_zero,
    stabilizing_time_constants,
)

s = ct.tf("s")
lag = 1 / (s + 1)
ORDERS = [1, 2, 3, 4, 5, 6]

each_order = pytest.mark.parametrize("order", ORDERS)


def above(process, model, order):
    *_, (low, high) = stabilizing_time_constants(process, model, order)
    assert high == inf
    return low


@each_order
@pytest.mark.parametrize("delay", [0.02, 3.0])
def test_delay(order, delay):
    exact = above(nrdob.delay(delay) * lag, lag, order)
    assert smallest_for_delay(delay, order) == pytest.approx(exact, rel=1e-9)


@each_order
@pytest.mark.parametrize("zero", [0.02, 3.0])
def test_zero_in_the_right_half_plane(order, zero):
    exact = above((1 - s / zero) * lag, lag, order)
    assert smallest_for_rhp_zero(zero, order) == pytest.approx(exact, rel=1e-9)


@each_order
@pytest.mark.parametrize("time_constant", [0.02, 3.0])
def test_double_lag(order, time_constant):
    exact = above(lag / (time_constant * s + 1) ** 2, lag, order)
    assert smallest_for_double_lag(time_constant, order) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("order", [*ORDERS, 12])
def test_one_neglected_lag_is_harmless(order):
    # |H| = |Tjω/(Tjω + 1)| < 1 at every frequency.
    assert stabilizing_time_constants(lag / (0.2 * s + 1), lag, order) == [(0.0, inf)]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("function", "largest", "process"),
    [
        (smallest_for_delay, 27, nrdob.delay(1.0) * lag),
        (smallest_for_rhp_zero, 18, (1 - s) * lag),
        (smallest_for_double_lag, 8, lag * (1 / (s + 1)) ** 2),
    ],
)
def test_closed_forms_hold_to_their_largest_order_and_refuse_the_next(function, largest, process):
    assert function(1.0, largest) == pytest.approx(above(process, lag, largest), rel=1e-8)
    with pytest.raises(NotImplementedError, match=f"up to {largest}"):
        function(1.0, largest + 1)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(("g", "z", "p"), [(4, 1, 1), (0.3, 2, 5), (50, 0.1, 2)])
def test_unstable_pole(order, g, z, p):
    # By Routh: λ < g/p for n = 1; for n = 2 the smaller root of a quadratic.
    largest = g / p if order == 1 else np.roots([2 * p**2, -(4 + g) * p - g * z, 2 * g]).min()
    (interval,) = stabilizing_time_constants(g / (s - p), 1 / (s + z), order)
    assert interval == (0, pytest.approx(largest, rel=1e-9))


@each_order
def test_gain_bound_is_where_every_filter_is_lost(order):
    bound = gain_bound(order)
    assert stabilizing_time_constants(min(bound, 1e9) * (1 - 1e-9) * lag, lag, order)
    if bound < inf:
        assert not stabilizing_time_constants(bound * (1 + 1e-9) * lag, lag, order)


@each_order
@pytest.mark.parametrize("time_constant", [0.1, 2.0])
def test_noise_index_is_the_squared_norm_of_the_filter(order, time_constant):
    norm = ct.system_norm(LowPassFilter(time_constant, order).tf, 2, print_warning=False)
    assert noise_index(order) / time_constant == pytest.approx(norm**2, rel=1e-6)


@each_order
@pytest.mark.parametrize("time_constant", [0.1, 2.0])
def test_disturbance_index_is_the_integral_square_error(order, time_constant):
    F = LowPassFilter(time_constant, order)
    error = ct.tf((F.den - np.eye(1, order + 1, order)[0])[:-1], F.den)  # (1 - F)/s
    norm = ct.system_norm(error, 2, print_warning=False)
    assert disturbance_index(order) * time_constant == pytest.approx(norm**2, rel=1e-6)


def test_sensitivity_floor_of_the_first_three_orders():
    assert [sensitivity_floor(n) for n in (1, 2, 3)] == pytest.approx([1, 2 / sqrt(3), 9 / 7])


@each_order
def test_sensitivity_floor_is_the_peak_of_a_matched_loop(order):
    found = nrdob.NRDOB(lag, lag, 0.0, LowPassFilter(0.3, order)).margins().plant_loop.ms
    assert sensitivity_floor(order) == pytest.approx(found, rel=1e-9)


@pytest.mark.parametrize("value", [0.0, -1.0, inf, float("nan")])
@pytest.mark.parametrize(
    "function", [smallest_for_delay, smallest_for_rhp_zero, smallest_for_double_lag]
)
def test_lengths_and_zeros_must_be_positive(function, value):
    with pytest.raises(ValueError, match="must be positive and finite"):
        function(value, 2)


@pytest.mark.parametrize("function", [noise_index, disturbance_index, sensitivity_floor])
def test_an_order_counts_lags(function):
    with pytest.raises(ValueError, match="order"):
        function(0)
    with pytest.raises(TypeError, match="order"):
        function(1.5)
