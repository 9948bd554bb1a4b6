"""One mass and two: poles and zeros in closed form, and the same as states."""

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob.drives import OneMass, TwoMasses

DRIVE = TwoMasses(1e-3, 4e-3, 10.0)


def test_resonance_and_antiresonance_are_poles_and_zeros():
    G = DRIVE.speed()
    assert sorted(G.poles().imag)[-1] == pytest.approx(DRIVE.resonance, rel=1e-12)
    assert sorted(G.zeros().imag)[-1] == pytest.approx(50.0, rel=1e-12)
    assert DRIVE.resonance == pytest.approx(50.0 * np.sqrt(1 + 4))


def test_another_resonance_ratio_is_another_motor():
    wanted = TwoMasses(4e-3, 4e-3, 10.0).with_resonance_ratio(5**0.5)
    assert wanted.motor == pytest.approx(1e-3)
    assert (wanted.load, wanted.stiffness) == (DRIVE.load, DRIVE.stiffness)


def test_as_a_model_it_moves_the_resonance_below_the_bandwidth():
    plant = TwoMasses(4e-3, 4e-3, 10.0, 0.01)
    model = plant.with_resonance_ratio(5**0.5)
    filter = nrdob.LowPassFilter(5e-5, 1)
    loop = nrdob.NRDOB(plant.speed(), model.speed(), 0.05, filter)
    assert loop.stability().stable
    omega = np.linspace(60, 100, 15)
    seen = loop.T_R(1j * omega)
    wanted = ct.feedback(0.05 * model.speed(), 1)(1j * omega)
    assert np.abs(seen / wanted - 1).max() < 0.05
    bare = ct.feedback(0.05 * plant.speed(), 1)(1j * omega)
    assert np.abs(bare / wanted - 1).max() > 0.5


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((0.0, 1e-3, 1.0), "motor is 0 kg m²; it must be positive"),
        ((-1e-3, 1e-3, 1.0), "motor is -0.001 kg m²; .* check its sign"),
        ((1e-3, 0.0, 1.0), "load is 0 kg m²; .* a drive without load is OneMass"),
        ((1e-3, 1e-3, 0.0), "stiffness is 0 N m/rad"),
        ((1e-3, 1e-3, 1.0, -0.1), "damping is -0.1 N m s/rad; it must be positive"),
        ((1e-3, np.inf, 1.0), "load is inf"),
    ],
)
def test_masses_that_cannot_be_are_named(given, message):
    with pytest.raises(ValueError, match=message):
        TwoMasses(*given)


def test_other_numbers_that_cannot_be_are_named():
    with pytest.raises(ValueError, match="inertia is -1 kg m²"):
        OneMass(-1.0)
    with pytest.raises(TypeError, match="inertia is 'heavy'"):
        OneMass("heavy")
    with pytest.raises(ValueError, match=r"ratio is 1\.0; give one above 1, such as 5\*\*0.5"):
        DRIVE.with_resonance_ratio(1.0)
