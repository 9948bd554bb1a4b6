"""Motion between events and the events themselves: closed forms, and SciPy as the second way."""

from math import exp, log

import numpy as np
import pytest
from scipy.interpolate import BPoly
from scipy.linalg import expm

from campaigns.drives import campaign
from nrdob.drives import Friction, Motion, OneMass, TwoMasses
from nrdob.drives.pieces import Stretch, first_exit


@pytest.mark.thorough
def test_random_drives_move_as_scipy_integrates_them():
    found = campaign(10, 1)
    assert found["alike to 1e-7"] == 10 and "NOT alike" not in found
    assert found["that stuck and slipped"] == 10 and found["of TwoMasses"] > 2


def test_coulomb_friction_stops_a_shaft_in_the_time_of_the_closed_form():
    J, b, Fc = 0.01, 0.1, 0.2
    motion = Motion(OneMass(J), Friction(Fc, viscous=b), 1.0)
    motion.advance(1.2)
    speed = (1.2 - Fc) / b * (1 - exp(-b / J))
    assert motion.speed == pytest.approx(speed, rel=1e-12)
    angle = motion.angle
    motion.advance(0.0)
    # J ω' = -Fc - b ω until ω = 0.
    stop = J / b * log(1 + b * speed / Fc)
    turned = J / b * speed - Fc / b * stop
    assert stop < 1.0 and motion.at_rest and motion.speed == 0.0
    assert motion.angle - angle == pytest.approx(turned, rel=1e-11)


def test_stiction_holds_up_to_its_edge_and_not_beyond():
    for torque, moves in ((0.15, False), (-0.15, False), (0.1500001, True), (-0.1500001, True)):
        motion = Motion(OneMass(0.01), Friction(0.1, 0.15), 0.01)
        for _ in range(5):
            motion.advance(torque)
        assert motion.at_rest == (not moves)
        assert np.sign(motion.speed) == np.sign(torque) * moves


def test_at_rest_nothing_chatters():
    motion = Motion(OneMass(0.01), Friction(0.1, 0.15, 0.1), 0.001)
    for k in range(1000):
        motion.advance(0.149 * (-1) ** k)
    assert motion.events == 0 and motion.angle == 0.0 and motion.speed == 0.0


def test_a_load_swings_on_a_motor_that_friction_holds():
    drive = TwoMasses(1e-3, 4e-3, 10.0)
    motion = Motion(drive, Friction(1.0), 1e-3)
    for _ in range(500):
        motion.advance(0.0, 0.1)
    t = 0.5
    twist = -0.1 / 10 * (1 - np.cos(50.0 * t))
    assert motion.at_rest and motion.angle == 0.0
    np.testing.assert_allclose(motion.states[2], twist, atol=1e-13)


def test_a_delay_is_passed_in_samples_and_fractions():
    late, early = (
        Motion(OneMass(0.01), Friction(), 0.01, 0.023),
        Motion(OneMass(0.01), Friction(), 1e-3),
    )
    for _ in range(10):
        late.advance(1.0)
    for k in range(100):
        early.advance(float(k >= 23))
    np.testing.assert_allclose(late.states, early.states, rtol=1e-12)


def test_a_long_sample_is_divided_and_a_short_slip_within_it_found():
    drive, friction = TwoMasses(1e-3, 4e-3, 40.0, 1e-3), Friction(0.05, 0.08, 0.3, 0.001)
    coarse, fine = Motion(drive, friction, 0.2), Motion(drive, friction, 0.2 / 64)
    for torque in (0.3, -0.2, 0.07, 0.0):
        coarse.advance(torque)
        for _ in range(64):
            fine.advance(torque)
        np.testing.assert_allclose(coarse.states, fine.states, rtol=1e-9, atol=1e-12)
    assert coarse.events == fine.events > 4


@pytest.mark.slow
def test_where_a_polynomial_leaves_is_its_first_root():
    rng = np.random.default_rng(0)
    found = 0
    for _ in range(300):
        roots = np.sort(rng.uniform(-0.5, 1.5, 5))
        degree = 12
        t = np.linspace(0, 1, degree + 1)
        signal = np.prod(t[:, None] - roots, axis=1)
        nodes = [BPoly(np.eye(degree + 1)[i][:, None], [0, 1])(t) for i in range(degree + 1)]
        signal *= np.sign(signal[0])
        bernstein = np.linalg.solve(np.transpose(nodes), signal)
        inside = roots[(roots > 0) & (roots < 1)]
        at = first_exit(bernstein, 1e-14)
        if inside.size:
            gap = np.diff(np.append(inside, 2.0)).min()
            if gap > 1e-3:
                assert at == pytest.approx(inside[0], abs=1e-8)
                found += 1
        else:
            assert at is None
    assert found > 150
    assert first_exit(np.array([-1.0, 1.0]), 1e-14) == 0.0
    assert first_exit(np.array([0.0, 1.0, 0.5]), 1e-14) is None
    assert first_exit(np.array([0.0, -1.0]), 1e-14) == 0.0


def test_a_signal_that_stays_at_zero_never_leaves():
    assert first_exit(np.zeros(3), 0.0) is None
    assert first_exit(np.array([2.0, -1e-9, 2.0]), 1e-9) is None


@pytest.mark.slow
def test_a_motion_that_finds_no_end_is_refused(monkeypatch):
    monkeypatch.setattr("nrdob.drives.motion.MOST_EVENTS", 100)
    motion = Motion(OneMass(0.01), Friction(0.1), 0.01)
    with pytest.raises(ArithmeticError, match="choose a shorter dt, or a drive of one mass"):
        motion.advance(np.nan)


def test_a_stretch_moves_states_as_the_matrix_exponential_does():
    M, z = np.array([[-1.0, 0.5], [0.25, -2.0]]), np.array([1.0, 2.0])
    stretch = Stretch(M, np.eye(2), 0.4, 2)
    for share in (0.5, 1.0):
        np.testing.assert_allclose(stretch.states_at(z, share), expm(0.4 * share * M) @ z)
