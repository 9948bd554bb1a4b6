import control as ct
import numpy as np
import pytest

import nrdob

s = ct.tf("s")
S = np.array([0.3 + 2j, -1 + 0.5j, 4j])


def test_delay_multiplies_and_divides_with_blocks_and_numbers_on_both_sides():
    exact = np.exp(-0.05 * S) / (S + 2) ** 2
    for G in (
        nrdob.delay(0.05) / (s + 2) ** 2,
        1 / (s + 2) ** 2 * nrdob.delay(0.05),
        np.float64(0.5) * (nrdob.delay(0.05) * (2 / (s + 2) ** 2)),
        nrdob.delay(0.02) * (nrdob.delay(0.03) / (s + 2) ** 2),
        -(-1 * nrdob.delay(0.05)) / (s + 2) ** 2,
        ct.tf2ss(1 / (s + 2) ** 2) * nrdob.delay(0.05),
    ):
        assert G(S) == pytest.approx(exact, rel=1e-12)
        assert G.delay == pytest.approx(0.05)


def test_ratio_of_delays_is_the_difference_and_must_be_causal():
    assert (nrdob.delay(0.5) / nrdob.delay(0.2)).delay == pytest.approx(0.3)
    with pytest.raises(ValueError, match="predict the future"):
        nrdob.delay(0.2) / nrdob.delay(0.5)
    with pytest.raises(ValueError, match="predict the future"):
        1 / nrdob.delay(0.2)


@pytest.mark.parametrize("seconds", [-0.1, float("nan"), float("inf")])
def test_dead_time_is_finite_and_not_negative(seconds):
    with pytest.raises(ValueError, match="delay is"):
        nrdob.delay(seconds)


def test_what_is_no_factor_is_refused():
    with pytest.raises(TypeError):
        nrdob.delay(0.1) * "s"
    with pytest.raises(TypeError):
        nrdob.delay(0.1) / [1, 2]


def test_repr_shows_what_was_built():
    G = nrdob.delay(0.1) / (s + 2)
    assert repr(G) == "DelayedTransferFunction(([1.0], [1.0, 2.0]), delay=0.1)"


def test_sums_and_differences_need_equal_dead_times():
    G = nrdob.delay(0.3) / (s + 1)
    exact = np.exp(-0.3 * S) * (1 / (S + 1) - 2 / (S + 3))
    assert (G - nrdob.delay(0.3) * 2 / (s + 3))(S) == pytest.approx(exact, rel=1e-12)
    assert (nrdob.delay(0) + 1 / (s + 1))(S) == pytest.approx(1 + 1 / (S + 1), rel=1e-12)
    assert (1 - nrdob.delay(0) / (s + 1))(S) == pytest.approx(1 - 1 / (S + 1), rel=1e-12)
    for sum_of in (
        lambda: G + 1 / (s + 1), lambda: 1 / (s + 1) + G, lambda: 1 + G, lambda: 1 - G,
        lambda: G - 1, lambda: G + nrdob.delay(0.2), lambda: ct.tf2ss(1 / (s + 1)) + G,
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"dead times .* s is no .*use nrdob\.NRDOB"):
            sum_of()


def test_powers_are_repeated_products():
    G = nrdob.delay(0.3) / (s + 2)
    assert (G**3)(S) == pytest.approx(G(S) ** 3, rel=1e-12)
    assert (G**3).delay == pytest.approx(0.9)
    assert (G**0)(S) == pytest.approx(np.ones(3))
    assert ((nrdob.delay(0) * 2 / (s + 2)) ** -1)(S) == pytest.approx((S + 2) / 2, rel=1e-12)
    with pytest.raises(ValueError, match="predict the future"):
        G**-1
    for exponent in (0.5, True, "2"):
        with pytest.raises(TypeError, match="whole number"):
            G**exponent


def test_equal_blocks_are_equal_and_hash_alike():
    one, other = nrdob.delay(0.1) * ct.tf([2], [2, 4]), nrdob.delay(0.1) / (s + 2)
    assert one == other and hash(one) == hash(other)
    assert one != nrdob.delay(0.2) / (s + 2) and one != 2 * other and one != "a plant"
    assert len({one, other}) == 1


def test_poles_zeros_and_dc_gain_are_those_of_the_rational_part():
    G = nrdob.delay(0.4) * 3 * (s + 4) / ((s + 1) * (s + 2))
    assert sorted(G.poles().real) == pytest.approx([-2, -1])
    assert G.zeros() == pytest.approx([-4])
    assert G.dcgain() == pytest.approx(6)
    assert (nrdob.delay(1) / s).dcgain() == np.inf
    assert np.isnan((nrdob.delay(1) * ct.tf([1, 0], [1, 0])).dcgain())


def test_rounding_of_a_difference_of_dead_times_is_no_prediction():
    assert (nrdob.delay(0.3) / nrdob.delay(0.1) / nrdob.delay(0.2)).delay == 0.0


def test_dividing_by_a_dead_time_says_what_would_happen():
    lag = 1 / (s + 1)
    for dividend in (lag, ct.tf2ss(lag), 1, nrdob.delay(0.1) * lag):
        with pytest.raises(
            ValueError, match=r"is an advance, which is not causal.* divide by .*\.tf"
        ):
            dividend / nrdob.delay(0.2)
    found = lag / (nrdob.delay(0.0) * s)
    assert (found.delay, found(2j)) == (0.0, pytest.approx(lag(2j) / 2j))
    for outside in (np.asarray, lambda G: np.array([G, G]), lambda G: np.array(G, ndmin=2)):
        with pytest.raises(TypeError, match="is no array"):
            outside(nrdob.delay(0.2))
    with pytest.raises(ZeroDivisionError, match="divisor"):
        nrdob.delay(0.2) / 0


@pytest.mark.usefixtures("no_warning_leaks")
def test_values_at_poles_and_far_to_the_left_are_infinite_without_a_warning():
    G = nrdob.delay(1.0) / (s * (s + 1))
    assert np.isinf(G(0)) and np.isinf(G(-1e4)) and np.isinf(G(-1e4 + 3j)) and G(1e4) == 0


def test_repr_rounds_to_six_digits():
    G = nrdob.delay(0.1 + 0.2) * ct.tf([1 / 3], [1.0, 2 / 3])
    assert repr(G) == "DelayedTransferFunction(([0.333333], [1.0, 0.666667]), delay=0.3)"
