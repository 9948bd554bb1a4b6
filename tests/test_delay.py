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
