"""The Smith predictor is an observer."""

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob.alternatives import smith_predictor

s = ct.tf("s")
S = np.array([0.3 + 1j, 2j, 0.1])
LAG = ct.tf([1], [1, 1])


@pytest.mark.parametrize("theta", [0.9, 1.0, 1.3])
def test_a_smith_predictor_is_the_observer_with_the_filter_that_its_controller_makes(theta):
    G0, Gm0 = 1.1 / ((s + 1.1) * (0.4 * s + 1)), 1 / ((s + 1) * (0.5 * s + 1))
    C = 2 * (s + 1) / s
    loop = smith_predictor(nrdob.delay(theta) * G0, nrdob.delay(1.0) * Gm0, C)
    # u = C (R - y - (1 - exp(-sθm)) Gm0 u), as Smith draws it
    around = C(S) / (1 + C(S) * Gm0(S) * (1 - np.exp(-S)))
    G = G0(S) * np.exp(-theta * S)
    assert loop.K(S) == pytest.approx(around, rel=1e-12)
    assert loop.T_R(S) == pytest.approx(around * G / (1 + around * G), rel=1e-12)
    assert loop.U_R(S) == pytest.approx(around / (1 + around * G), rel=1e-12)
    assert loop.S_delta(S) == pytest.approx(G / (1 + around * G), rel=1e-12)
    assert loop.stability().stable


def test_a_predictor_is_lost_for_a_tiny_error_of_the_dead_time_if_it_lets_half_through():
    # Palmor; Yamanaka and Shimemura: |C Gm0/(1 + C Gm0)| below 1/2 at infinite frequency.
    block = (s + 2) / (s + 1)
    for gain, stable in ((0.9, True), (1.1, None)):
        C = gain * (s + 1) / s
        exact = smith_predictor(nrdob.delay(1.0) * block, nrdob.delay(1.0) * block, C)
        assert exact.stability().stable
        wrong = smith_predictor(nrdob.delay(1.001) * block, nrdob.delay(1.0) * block, C)
        assert wrong.stability().stable is stable


def test_what_makes_no_predictor_is_named_with_the_remedy():
    G = nrdob.delay(1.0) * LAG
    with pytest.raises(
        ValueError,
        match=r"Smith predictor cannot be written as an observer: F\(0\) = 0.6667, not 1",
    ):
        smith_predictor(G, G, 2.0)
    with pytest.raises(ValueError, match=r"a Smith predictor .* K does not stabilise the model"):
        smith_predictor(G, G, -2 / s)
    with pytest.raises(ValueError, match="controller has a dead time"):
        smith_predictor(G, G, nrdob.delay(0.1) / s)
    with pytest.raises(ValueError, match="delay is -1"):
        nrdob.delay(-1.0)


def test_a_smith_predictor_of_an_integrating_plant_leaves_a_constant_disturbance_of_its_input():
    # With C = k, F = k/(s + k) and S_δ(0) = 1/k + θm, however exact the model is.
    G = nrdob.delay(0.9) / s
    loop = smith_predictor(G, G, 2.0)
    assert loop.stability().stable
    assert loop.S_delta.dc_gain == pytest.approx(1 / 2 + 0.9, rel=1e-12)
