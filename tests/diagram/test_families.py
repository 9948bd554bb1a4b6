"""Families of filters: what each is for every time constant, and what is refused."""

from __future__ import annotations

from math import sqrt

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import filter_family, interpolating_filter

s = ct.tf("s")


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7])
@pytest.mark.parametrize("lag", [0.02, 1.0, 30.0])
def test_butterworth_is_down_by_root_two_at_one_over_lambda_and_flat(order, lag):
    F = filter_family("butterworth", order).at(lag)
    for x in (0.3, 1.0, 4.0):
        assert abs(F(1j * x / lag)) == pytest.approx(1 / sqrt(1 + x ** (2 * order)), rel=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7])
def test_bessel_has_the_phase_of_a_delay_up_to_order_2n(order):
    F, x = filter_family("bessel", order).at(2.0), 0.01
    assert np.angle(F(1j * x / 2.0)) == pytest.approx(-x, abs=1e-13 + x ** (2 * order + 1))


@pytest.mark.parametrize(("order", "ramp"), [(2, 2), (3, 2), (3, 3), (5, 4)])
def test_ramp_filters_have_so_many_zeros_of_1_minus_F_at_the_origin(order, ramp):
    family = filter_family("ramp", order, ramp=ramp)
    assert family.ramp == ramp and family.den.shape[0] - family.num.shape[0] == order - ramp + 1
    small = 1e-3
    F = family.at(0.5)
    found = abs(1 - F(small)) / small**ramp
    assert found == pytest.approx(family.ramp_coefficient(0.5), rel=2e-2)


@pytest.mark.parametrize(
    "model",
    [4 / (2 - s - s**2), (1 - s) / (s + 1) ** 2, (s - 3) / (s * (s - 1) * (s + 2)), 1 / s**2],
)
@pytest.mark.parametrize("ramp", [1, 2])
def test_interpolating_family_holds_the_interpolating_filter_of_every_time_constant(model, ramp):
    family = filter_family("interpolating", model=model, ramp=ramp)
    for lag in (0.03, 0.7, 12.0):
        one, other = family.at(lag), interpolating_filter(model, lag, ramp=ramp)
        assert one.num[0][0] == pytest.approx(other.num[0][0], rel=1e-10)
        assert one.den[0][0] == pytest.approx(other.den[0][0], rel=1e-12)
        assert one.num[0][0][-1] == one.den[0][0][-1] == 1.0


def test_binomial_family_gives_low_pass_filters():
    assert filter_family("binomial", 3).at(0.2) == nrdob.LowPassFilter(0.2, 3)


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        (("gauss", 2), ValueError, "choose one of"),
        (("bessel",), ValueError, "needs order"),
        (("bessel", 0), ValueError, "order >= 1"),
        (("bessel", 2.5), TypeError, "whole"),
        (("ramp", 2, {"ramp": 3}), ValueError, "higher order"),
        (("bessel", 2, {"ramp": 2}), ValueError, "takes no ramp"),
        (("interpolating", 1, {"model": 4 / (2 - s - s**2)}), ValueError, "take order 3"),
    ],
)
def test_what_is_no_family_is_refused_with_the_remedy(given, error, message):
    *positional, options = (*given, {}) if not isinstance(given[-1], dict) else given
    with pytest.raises(error, match=message):
        filter_family(*positional, **options)
