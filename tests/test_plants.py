"""Plants against the equations they come from."""

import numpy as np
import pytest

from nrdob import plants


def test_lags_multiply():
    s = 0.3 + 1.7j
    expected = 2 / ((0.5 * s + 1) * (0.1 * s + 1) * (-3 * s + 1))
    assert complex(plants.lags(0.5, 0.1, -3, gain=2)(s)) == pytest.approx(expected, rel=1e-12)


def test_two_masses_move_as_one_at_low_frequency_and_the_motor_alone_at_high():
    motor, load, stiffness = 1e-3, 4e-3, 10.0
    plant = plants.two_masses(motor, load, stiffness, damping=1e-3)
    for omega, inertia in ((1e-3, motor + load), (1e6, motor)):
        assert complex(plant(1j * omega)) == pytest.approx(1 / (1j * omega * inertia), rel=1e-3)


@pytest.mark.parametrize("omega", [0.3, 40.0, 700.0])
def test_two_masses_solve_their_equations_of_motion(omega):
    motor, load, stiffness, damping = 2e-3, 5e-3, 8.0, 2e-3
    s = 1j * omega
    shaft = stiffness / s + damping
    # Rows: torque on the motor, torque on the load; unknowns: both speeds.
    equations = np.array([[motor * s + shaft, -shaft], [-shaft, load * s + shaft]])
    speed = np.linalg.solve(equations, [1.0, 0.0])[0]
    found = complex(plants.two_masses(motor, load, stiffness, damping)(s))
    assert found == pytest.approx(speed, rel=1e-9)


def test_motor_position_integrates_its_speed_exactly():
    assert plants.motor_position().den[0][0][-1] == 0.0
    s = 2.0 + 5j
    assert complex(plants.motor_position()(s)) == pytest.approx(
        complex(plants.motor_speed()(s)) / s, rel=1e-12
    )


def test_dead_time_leaves_the_gain_alone():
    assert complex(plants.heated_air()(0.0)) == pytest.approx(0.93, rel=1e-12)


def test_an_antiresonance_has_its_zero_below_its_pole_and_passes_slow_signals_unchanged():
    shape = plants.antiresonance(5.0, 3.0, 0.02)
    assert np.abs(shape.zeros()) == pytest.approx([3.0, 3.0])
    assert np.abs(shape.poles()) == pytest.approx([5.0, 5.0])
    assert shape(0) == pytest.approx(1)
