"""Friction: its curve, its first harmonic in closed form, and what cannot be."""

import numpy as np
import pytest
from scipy.integrate import quad

from nrdob.drives import Friction


@pytest.mark.parametrize("amplitude", [0.01, 0.3, 20.0])
def test_coulomb_friction_has_the_gain_of_a_relay(amplitude):
    gain = Friction(0.1, viscous=0.03).describing_function(amplitude)
    assert gain == pytest.approx(4 * 0.1 / (np.pi * amplitude) + 0.03, rel=1e-12)


@pytest.mark.parametrize("amplitude", [0.05, 0.2, 0.21, 3.0])
def test_the_first_harmonic_with_stribecks_slope_is_fouriers_integral(amplitude):
    friction = Friction(0.1, 0.17, 0.2, 0.05)

    def first(phi):
        return float(friction.torque(amplitude * np.sin(phi))) * np.sin(phi)

    corner = np.arcsin(min(1.0, 0.2 / amplitude))
    parts = [quad(first, *ends, epsabs=1e-13)[0] for ends in ((0, corner), (corner, np.pi / 2))]
    expected = 4 / np.pi * sum(parts) / amplitude
    assert friction.describing_function(amplitude) == pytest.approx(expected, rel=1e-9)


def test_the_curve_falls_from_stiction_to_coulomb_and_rises_with_the_speed():
    friction = Friction(0.1, 0.15, 0.2, 0.3)
    assert friction.torque(1e-12) == pytest.approx(0.15)
    assert friction.torque([0.1, 0.2, 2.0]) == pytest.approx([0.125 + 0.03, 0.1 + 0.06, 0.7])
    speeds = np.linspace(-3, 3, 101)
    np.testing.assert_array_equal(friction.torque(speeds), -friction.torque(-speeds))
    at_once = Friction(0.1, 0.15)
    assert at_once.torque(1e-9) == pytest.approx(0.1)
    assert (at_once.slope, at_once.breakaway, Friction(0.1).breakaway) == (0.0, 0.15, 0.1)


def test_what_is_fed_forward_is_the_dry_friction_of_the_planned_speed():
    friction = Friction(0.1, 0.15, 0.2, 0.3)
    speeds = np.array([-2.0, 0.0, 0.1, 2.0])
    found = friction.feedforward(speeds)
    np.testing.assert_allclose(found + 0.3 * speeds, friction.torque(speeds), atol=1e-15)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"coulomb": -0.1}, r"coulomb is -0.1; friction takes energy out, .* give its size"),
        ({"viscous": -1.0}, "viscous is -1.0; friction takes energy out"),
        ({"coulomb": 0.1, "stribeck_speed": -1.0}, "stribeck_speed is -1"),
        ({"coulomb": float("nan")}, "coulomb is nan"),
        ({"coulomb": 0.15, "stiction": 0.1}, "stiction is 0.1 N m, below .* exchange them"),
    ],
)
def test_friction_that_cannot_be_is_named(given, message):
    with pytest.raises(ValueError, match=message):
        Friction(**given)


@pytest.mark.parametrize("amplitude", [0.0, -1.0, np.inf])
def test_a_first_harmonic_needs_a_motion(amplitude):
    with pytest.raises(ValueError, match="give a positive, finite amplitude"):
        Friction(0.1).describing_function(amplitude)


def test_a_text_is_no_friction():
    message = r"coulomb is '0\.1', a str; friction takes energy out, so it must be a number"
    with pytest.raises(TypeError, match=message):
        Friction("0.1")
