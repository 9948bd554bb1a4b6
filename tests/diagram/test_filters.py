import control as ct
import numpy as np
import pytest

from nrdob import LowPassFilter
from nrdob.diagram import filter_fraction


@pytest.mark.parametrize("order", [1, 2, 5])
@pytest.mark.parametrize("time_constant", [1e-3, 0.09, 20.0])
def test_bandwidth_is_where_the_gain_is_down_to_one_over_root_two(time_constant, order):
    F = LowPassFilter(time_constant, order)
    assert abs(F(1j * F.bandwidth)) == pytest.approx(2**-0.5, rel=1e-12)
    assert abs(F.tf(1j * F.bandwidth)) == pytest.approx(2**-0.5, rel=1e-12)


@pytest.mark.parametrize("time_constant", [0, -1, float("nan"), float("inf")])
def test_time_constant_is_positive_and_finite(time_constant):
    with pytest.raises(ValueError, match="time_constant"):
        LowPassFilter(time_constant, 2)


def test_order_is_a_whole_number_of_at_least_one():
    with pytest.raises(ValueError, match="order"):
        LowPassFilter(0.1, 0)
    for order in (1.5, True, "2"):
        with pytest.raises(TypeError, match="whole number"):
            LowPassFilter(0.1, order)
    assert LowPassFilter(0.1, np.int64(2)).tf.den[0][0].size == 3


def test_one_minus_filter_vanishes_exactly_at_zero():
    num, den = filter_fraction(ct.tf([0.3, 3.0], [0.1, 0.7, 3.0]))
    assert num[-1] == den[-1] == 1.0


@pytest.mark.parametrize(
    ("filter", "words"),
    [
        (ct.tf([2.0], [1.0, 1.0]), r"F\(0\) = 2"),
        (ct.tf([1.0, 0.0], [1.0, 1.0]), r"F\(0\) = 0"),
        (ct.tf([-1.0], [1.0, -1.0]), "stable"),
        (ct.tf([1.0], [1.0, 0.0]), "stable"),
        (ct.tf([1.0, 1.0, 1.0], [1.0, 1.0]), "improper"),
        (1.0, "1 at every frequency"),
        (0.3, r"needs 1: for a time constant of that many seconds LowPassFilter\(0.3, 2\)"),
        (ct.tf([1.0, 2.0], [1.0, 2.0]), "1 at every frequency"),
        (ct.tf([1 - 2e-16, 1.0], [1.0, 1.0]), "1 at every frequency"),
    ],
)
def test_a_filter_is_stable_proper_and_has_unit_dc_gain(filter, words):
    with pytest.raises(ValueError, match=words):
        filter_fraction(filter)


@pytest.mark.parametrize(("time_constant", "order"), [(1e200, 3), (1e-200, 4)])
def test_a_power_beyond_floating_point_is_refused_not_rounded(time_constant, order):
    with pytest.raises(ValueError, match="another unit of time"):
        LowPassFilter(time_constant, order)


def test_repr_rounds_to_six_digits():
    found = repr(LowPassFilter(np.float64(0.01708001234567), np.int64(2)))
    assert found == "LowPassFilter(time_constant=0.01708, order=2)"


@pytest.mark.usefixtures("no_warning_leaks")
@pytest.mark.parametrize("den", [[1.0, 0.0, 4.0], [1.0, 1.0, 4.0, 4.0], [1.0, 0.0, 0.0]])
def test_a_filter_with_undamped_poles_is_not_stable(den):
    with pytest.raises(ValueError, match="F must be stable"):
        filter_fraction(([den[-1] or 1.0], den))


def test_a_time_constant_is_kept_as_a_real_number():
    assert LowPassFilter(1 + 0j, 1).den.tolist() == [1.0, 1.0]


@pytest.mark.parametrize("order", [1030, 10**6, 10**400])
def test_an_order_whose_coefficients_leave_floating_point_is_refused(order):
    with pytest.raises(ValueError, match="range of floating-point numbers"):
        LowPassFilter(1.0, order)
