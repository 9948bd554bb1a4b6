"""The whole drive under its loop: linear where nothing else is, hunting, limits, generated C."""

import time

import control as ct
import numpy as np
import pytest

import nrdob
from firmware import c_controller
from nrdob.digital import ActuatorLimits
from nrdob.drives import (
    Counting,
    Drive,
    EdgeTiming,
    Encoder,
    Friction,
    OneMass,
    Tracking,
    TwoMasses,
)

J, B, H = 0.01, 0.1, 0.001
ANGLE = ct.tf([1], [J, B, 0])
LEAD = 9 + 0.32 * ct.tf([1, 0], [0.005, 1])
VISCOUS, STICKY = Friction(viscous=B), Friction(0.10, 0.15, 0.05, viscous=B)


def position_loop(ramp=2, late=0.0, lag=0.02):
    filter = nrdob.interpolating_filter(ANGLE, lag, ramp=ramp)
    return nrdob.NRDOB(ANGLE, ANGLE, LEAD, filter).sampled(H, computation_delay=late)


def speed_loop(plant, lag=0.02):
    model = ct.tf([1], [J, B])
    PI = ct.tf([20 * J, 20 * B], [1, 0])
    return nrdob.NRDOB(plant, model, PI, nrdob.LowPassFilter(lag, 1)).sampled(H)


@pytest.mark.parametrize("late", [0.0, 0.0023])
@pytest.mark.parametrize("limits", [None, ActuatorLimits(-2, 2), ActuatorLimits(-5, 5, rate=800)])
def test_without_friction_and_steps_it_is_the_linear_simulation(late, limits):
    sampled = position_loop(late=late)
    given = {"R": 1.0, "delta": lambda t: -0.5 * (t > 0.5)}
    expected = sampled.simulate(given, limits=limits, timepts=1.0, noise=1e-4, seed=3)
    found = Drive(OneMass(J), VISCOUS).simulate(
        sampled, given, limits=limits, timepts=1.0, noise=1e-4, seed=3
    )
    for name in ("y", "measured", "u", "applied", "d_hat"):
        size = np.abs(getattr(expected, name)).max()
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-9 * size)
    assert np.array_equal(found.limited, expected.limited) and found.limited.any() == bool(limits)


def test_the_integrator_tracks_as_in_the_linear_simulation():
    plant, limits = ct.tf([1], [J, B]), ActuatorLimits(-1.5, 1.5)
    sampled = speed_loop(plant)
    drive = Drive(OneMass(J), VISCOUS, None, Counting())
    ends = [
        drive.simulate(sampled, {"R": 10.0}, limits=limits, timepts=2.0, tracking_time=Tt).y.max()
        for Tt in (None, 0.1)
    ]
    linear = [
        sampled.simulate({"R": 10.0}, limits=limits, timepts=2.0, tracking_time=Tt).y.max()
        for Tt in (None, 0.1)
    ]
    np.testing.assert_allclose(ends, linear, rtol=0.01)  # but for half a sample of the estimate


@pytest.mark.parametrize("viscous", [0.0, B])
def test_two_masses_without_friction_are_the_linear_simulation_of_their_transfer_function(viscous):
    masses = TwoMasses(J / 2, J / 2, 50.0, 0.01)
    plant = masses.speed(viscous) * ct.tf([1], [1, 0])
    filter = nrdob.interpolating_filter(ANGLE, 0.05, ramp=2)
    soft = 2 + 0.15 * ct.tf([1, 0], [0.01, 1])
    sampled = nrdob.NRDOB(plant, ANGLE, soft, filter).sampled(H)
    expected = sampled.simulate({"R": 1.0}, timepts=1.0)
    found = Drive(masses, Friction(viscous=viscous)).simulate(sampled, {"R": 1.0}, timepts=1.0)
    np.testing.assert_allclose(found.y, expected.y, atol=1e-8)
    np.testing.assert_allclose(found.u, expected.u, atol=1e-8 * np.abs(expected.u).max())


def test_the_load_of_two_masses_acts_behind_the_shaft():
    # By reciprocity the motor's speed from the load's torque is the load's speed from the motor's.
    masses = TwoMasses(J / 2, J / 3, 50.0, 0.01)
    motions = [Drive(masses).motion(H) for _ in range(2)]
    for _ in range(200):
        motions[0].advance(1.0, 0.0)
        motions[1].advance(0.0, 1.0)
        assert motions[1].speed == pytest.approx(motions[0].states[3], abs=1e-10)
    linear = ct.step_response(masses.speed(), np.linspace(0, 0.2, 201)).outputs[-1]
    assert motions[0].speed == pytest.approx(linear, rel=1e-6)


# Friction.


def hunting(response, last=10_000):
    """Least and largest torque of the last samples."""
    return float(response.applied[-last:].min()), float(response.applied[-last:].max())


@pytest.mark.slow
def test_a_position_loop_hunts_between_the_breakaway_torques():
    drive = Drive(OneMass(J), STICKY, Encoder(10_000))
    low, high = hunting(drive.simulate(position_loop(), {"R": 1.0}, timepts=30.0))
    assert -0.16 < low < -0.145 and 0.145 < high < 0.16


@pytest.mark.slow
def test_what_helps_against_hunting_and_its_price():
    drive = Drive(OneMass(J), STICKY, Encoder(10_000))
    banded = drive.simulate(position_loop(), {"R": 1.0}, timepts=20.0, dead_band=0.02)
    assert np.ptp(banded.applied[-5000:]) < 1e-9 and banded.at_rest[-5000:].all()
    assert 0 < abs(banded.y[-1] - 1.0) <= 0.0205
    # Without the second integrator it rests, and a load leaves an error.
    moved = drive.simulate(position_loop(ramp=1), {"R": 1.0, "delta": -0.5}, timepts=20.0)
    assert moved.at_rest[-5000:].all() and abs(moved.y[-1] - 1.0) > 0.01


@pytest.mark.slow
def test_friction_fed_forward_leaves_a_moving_reference_less_error():
    drive = Drive(OneMass(J), STICKY, Encoder(10_000))
    t = np.arange(4000) * H
    R, planned = 0.5 * (1 - np.cos(2 * np.pi * t)), np.pi * np.sin(2 * np.pi * t)
    sampled = position_loop(lag=0.05)
    fed = STICKY.feedforward(planned)
    errors = [
        drive.simulate(sampled, {"R": R}, timepts=t, feedforward=more).y
        - np.convolve(R, [1], "same")
        for more in (0.0, fed)
    ]
    plain = Drive(OneMass(J), VISCOUS).simulate(sampled, {"R": R}, timepts=t).y - R
    sizes = [np.abs((error - plain)[1000:]).max() for error in errors]
    assert sizes[1] < 0.5 * sizes[0]


@pytest.mark.parametrize("stiction", [None, 0.15])
def test_a_first_harmonic_predicts_where_friction_damps_the_swing(stiction):
    # Forced: J ω' + N(A) ω = τ at one frequency; far above friction the first harmonic is exact.
    friction = Friction(0.1, stiction, 0.05, viscous=0.02)
    omega, size = 40.0, 1.0
    motion = Drive(OneMass(J), friction).motion(1e-3)
    speeds = []
    for k in range(4000):
        speeds.append(motion.speed)
        motion.advance(size * np.sin(omega * (k + 0.5) * 1e-3))
    t = np.arange(4000)[-3142:] * 1e-3
    A = 2 * abs(np.mean(np.array(speeds)[-3142:] * np.exp(-1j * omega * t)))
    predicted = size / abs(1j * omega * J + friction.describing_function(A))
    assert pytest.approx(predicted, rel=0.01) == A


# Generated C.

TABLE = [
    (Drive(OneMass(J), STICKY, Encoder(10_000)), position_loop, None),
    (Drive(OneMass(J), STICKY, Encoder(10_000)), position_loop, ActuatorLimits(-1, 1, rate=100)),
    (Drive(OneMass(1.3 * J), Friction(0.05), Encoder(4000), Counting(4)), speed_loop, None),
    (Drive(OneMass(J), STICKY, Encoder(4000), EdgeTiming()), speed_loop, ActuatorLimits(-2, 2)),
    (Drive(TwoMasses(J / 2, J / 2, 900.0, 0.05), STICKY, Encoder(10_000), Tracking(500.0)),
     speed_loop, ActuatorLimits(-2, 2)),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("drive", "made", "limits"), TABLE)
def test_the_generated_c_drives_it_as_the_simulation_does(drive, made, limits):
    late = nrdob.delay(0.0015)
    sampled = made(late=0.0015) if made is position_loop else made(late * ct.tf([1], [J, B]))
    R, load = (1.0, -0.2) if drive.estimate is None else (4.0, -0.2)
    expected = drive.simulate(sampled, {"R": R, "delta": load}, limits=limits, timepts=1.0)
    motion = drive.motion(H, 0.0015)
    read = drive.reader(motion)
    angles, torques = [], []
    with c_controller(sampled, "drive", limits=limits) as controller:
        for _ in range(1001):
            torque = controller.output(R, read(motion.angle))
            controller.update(torque)
            angles.append(motion.angle)
            torques.append(torque)
            motion.advance(torque, load)
    np.testing.assert_allclose(angles, expected.angle, atol=1e-9)
    np.testing.assert_allclose(torques, expected.applied, atol=1e-7)


# Repeatability, speed, bad input.


def test_a_seed_repeats_a_run():
    drive, sampled = Drive(OneMass(J), STICKY, Encoder(10_000)), position_loop()
    runs = [
        drive.simulate(sampled, {"R": 1.0}, noise=1e-4, timepts=0.5, seed=seed).u
        for seed in (5, 5, 6)
    ]
    assert np.array_equal(runs[0], runs[1]) and not np.array_equal(runs[0], runs[2])


@pytest.mark.thorough
def test_a_hundred_thousand_samples_take_seconds():
    drive = Drive(OneMass(J), STICKY, Encoder(10_000))
    begun = time.process_time()
    drive.simulate(position_loop(), {"R": 1.0}, timepts=100.0)
    assert time.process_time() - begun < 6


def test_the_response_says_what_happened():
    drive = Drive(OneMass(J), STICKY, Encoder(10_000), Counting(2))
    found = drive.simulate(speed_loop(ct.tf([1], [J, B])), {"R": 1.0}, timepts=0.2)
    assert "201 samples to 0.2 s" in repr(found)
    assert np.array_equal(found.y, found.speed) and found.at_rest[0] and not found.at_rest[-1]


@pytest.mark.slow
def test_a_loop_that_runs_away_is_said_to():
    loop = nrdob.NRDOB(ANGLE, ANGLE, -LEAD, nrdob.LowPassFilter(0.02, 2)).sampled(H)
    for encoder in (None, Encoder(10_000)):
        with pytest.raises(ArithmeticError, match="the loop is unstable; simulate fewer samples"):
            Drive(OneMass(J), STICKY, encoder).simulate(loop, {"R": 1.0}, timepts=60.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"inputs": {"d": 1.0}}, "a drive has no disturbance at its output: give the load"),
        ({"inputs": {"load": 1.0}}, "'load' is no input"),
        ({"dead_band": -1.0}, "dead_band is -1.0; give a finite width"),
        ({"feedforward": [1.0, 2.0]}, r"^feedforward has the shape .*there are 101 samples"),
    ],
)
def test_runs_that_cannot_be_are_named(given, message):
    given = {"inputs": {"R": 1.0}, "timepts": 0.1, **given}
    with pytest.raises(ValueError, match=message):
        Drive(OneMass(J)).simulate(position_loop(), **given)
