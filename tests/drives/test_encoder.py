"""The encoder and its estimates: rest points, delays, the exact verdict."""

from math import pi

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob.drives import (
    Counting,
    Drive,
    EdgeTiming,
    Encoder,
    Friction,
    OneMass,
    Tracking,
    encoded,
)

J, B = 0.01, 0.1
MOTOR = ct.tf([1], [J, B])
PI = ct.tf([20 * J, 20 * B], [1, 0])
DRIVE = OneMass(J), Friction(viscous=B)
ESTIMATES = [Counting(), Counting(5), Tracking(300.0)]


def speed_loop(lag=0.03, dt=0.01, late=0.0):
    process = nrdob.delay(late) * MOTOR if late else MOTOR
    return nrdob.NRDOB(process, MOTOR, PI, nrdob.LowPassFilter(lag, 1)).sampled(dt)


# Where a loop comes to rest: a speed in steps of 0.5 rad/s, and the angle in the same step.


@pytest.mark.parametrize(("R", "rounded"), [(5.0, 4.8333), (5.15, 5.225)])
def test_a_rounded_speed_rests_beside_the_reference_and_a_rounded_angle_on_it(R, rounded):
    sampled = speed_loop()
    by_speed = sampled.simulate({"R": R}, timepts=10.0, resolution=0.5)
    assert by_speed.y[-400:].mean() == pytest.approx(rounded, abs=1e-3)
    drive = Drive(*DRIVE, Encoder(2 * pi / (0.5 * 0.01)), Counting())
    found = drive.simulate(sampled, {"R": R}, timepts=30.0)
    assert (found.angle[-1] - found.angle[-1001]) / 10.0 == pytest.approx(R, abs=5e-5)


# An estimate as a linear block.


@pytest.mark.parametrize("late", [0.0, 0.0013])
@pytest.mark.parametrize("estimate", [*ESTIMATES, EdgeTiming()])
def test_the_verdict_holds_in_two_ways_and_its_loop_is_what_is_simulated(estimate, late):
    sampled = speed_loop(0.02, 0.001, late)
    verdict = encoded(sampled, estimate).stability()
    assert verdict.stable and len(verdict.observer_loop.ways) == 2
    if isinstance(estimate, EdgeTiming):
        return
    # Without steps the drive is linear: its slowest mode is the verdict's largest root.
    drive = Drive(*DRIVE, None, estimate)
    found = drive.simulate(sampled, {"delta": 1.0}, timepts=3.0)
    left = np.abs(found.speed - found.speed[-1])
    root = (left[1100] / left[600]) ** (1 / 500)
    assert root == pytest.approx(verdict.spectral_radius, abs=2e-4)


@pytest.mark.thorough
def test_as_the_lag_falls_each_estimate_becomes_unstable_where_the_verdict_says():
    for estimate in ESTIMATES:
        low, high = 1e-4, 0.1
        for _ in range(20):
            lag = (low * high) ** 0.5
            stable = encoded(speed_loop(lag, 0.001), estimate).stability().stable
            low, high = (low, lag) if stable else (lag, high)
        for lag, grows in ((0.97 * low, True), (1.03 * high, False)):
            drive = Drive(*DRIVE, None, estimate)
            y = drive.simulate(speed_loop(lag, 0.001), {"R": 1.0}, timepts=3.0).speed
            swing = [np.ptp(y[part]) for part in (slice(1000, 1500), slice(2500, 3000))]
            assert (swing[1] > swing[0]) == grows


def test_the_delay_is_the_slope_of_the_phase():
    dt = 0.001
    for estimate in ESTIMATES:
        num, den = estimate.smoothing(dt)
        z = np.exp(1j * 1e-3 * dt * 1000)
        mean = (1 - 1 / z) / (1e-3 * 1000 * dt * 1j)
        phase = np.angle(np.polyval(num, z) / np.polyval(den, z) * mean)
        assert -phase / (1e-3 * 1000) == pytest.approx(estimate.delay(dt), rel=1e-4)
    assert Counting(7).delay(dt) == pytest.approx(0.0035)
    r = np.exp(-0.3)
    assert Tracking(300.0).delay(dt) == pytest.approx(2 * dt / (1 - r) - 1.5 * dt)


@pytest.mark.slow
def test_an_estimate_costs_the_margin_its_delay():
    sampled = speed_loop(0.02, 0.001)
    have = [encoded(sampled, each).margins().delay_margin for each in (Counting(), Counting(5))]
    assert have[0] - have[1] == pytest.approx(Counting(5).delay(0.001) - 0.0005, rel=0.06)
    assert sampled.margins().delay_margin - have[0] == pytest.approx(0.0005, rel=0.06)


@pytest.mark.thorough
def test_the_noise_of_rounding_is_what_the_variance_says():
    sampled, estimate, step = speed_loop(0.02, 0.001), Counting(), 1e-4
    shaping = ct.tf([1, -1], [1, 0], 0.001) / 0.001
    theory = encoded(sampled, estimate).noise_variance(step * shaping)
    drive = Drive(*DRIVE, None, estimate)
    calm = drive.simulate(sampled, {"R": 1.0}, timepts=40.0)
    found = drive.simulate(sampled, {"R": 1.0}, noise=step, timepts=40.0, seed=1)
    assert np.var((found.u - calm.u)[2000:]) == pytest.approx(theory.u, rel=0.05)


def test_a_certificate_of_an_encoded_loop_is_given():
    assert encoded(speed_loop(0.02, 0.001, 0.0025), Counting(3)).stability().certificate()


def test_a_certificate_of_an_encoded_loop_with_a_delayed_model_has_its_count():
    loop = nrdob.NRDOB(
        nrdob.delay(0.002) * ct.tf([1], [0.05, 1]),
        nrdob.delay(0.0015) * ct.tf([1], [0.05, 1]),
        ct.tf([0.5, 10], [1, 0]),
        nrdob.LowPassFilter(0.02, 1),
    )
    found = encoded(loop.sampled(0.001), Counting(3)).stability()
    assert found.certificate().content["claim"]["p_B"] == found.observer_loop.closed_loop_rhp


# Edges.


def test_edges_give_a_constant_speed_exactly():
    drive = Drive(OneMass(J), Friction(0.1), Encoder(1000), EdgeTiming())
    motion = drive.motion(0.001)
    read = drive.reader(motion)
    found = []
    for k in range(2000):
        found.append(read(motion.angle))
        motion.advance(0.2 if k < 1000 else 0.1)  # from then on friction takes it all
    assert motion.speed == pytest.approx(0.1 / J)
    np.testing.assert_allclose(found[1100:], motion.speed, rtol=1e-9)
    # Counting the same edges shows steps of 2π/1000 in a millisecond.
    assert 2 * pi / 1000 / 0.001 == pytest.approx(6.283, abs=1e-3)


def test_without_edges_the_speed_falls_as_one_could_have_been_seen():
    drive = Drive(OneMass(J), Friction(0.1), Encoder(100), EdgeTiming())
    motion = drive.motion(0.001)
    read = drive.reader(motion)
    for _ in range(500):
        read(motion.angle)
        motion.advance(0.2)
    last = []
    for _ in range(1000):
        last.append(read(motion.angle))
        motion.advance(-1.0 if motion.speed > 0.05 else 0.0)
    assert motion.at_rest and 0 < last[-1] < 2 * pi / 100 / 0.9 < last[0]
    assert all(np.diff(last) <= 1e-12)


@pytest.mark.slow
def test_edges_of_a_shaft_that_turns_back_are_angles_and_no_counts():
    drive = Drive(OneMass(J), Friction(0.01, viscous=0.01), Encoder(2000), EdgeTiming())
    motion = drive.motion(0.001)
    read = drive.reader(motion)
    speeds, reads = [], []
    for k in range(3000):
        speeds.append(motion.speed)
        reads.append(read(motion.angle))
        motion.advance(0.3 * np.sin(0.01 * k))
    late = np.abs(np.array(reads) - speeds)
    assert np.median(late) < 0.05 and np.max(np.abs(speeds)) > 2


# Counts, and bad input.


def test_an_encoder_rounds_to_the_nearest_count():
    drive = Drive(OneMass(J), encoder=Encoder(4))
    read = drive.reader(drive.motion(0.1))
    found = [read(angle * pi / 2) / (pi / 2) for angle in (-0.6, -0.4, 0.4, 0.6, 7.2)]
    assert found == [-1, 0, 0, 1, 7]


def test_an_encoder_may_have_one_count_in_a_turn():
    assert Encoder(1).step == 2 * pi


@pytest.mark.parametrize("counts", [0, -100, 0.5, float("nan"), float("inf")])
def test_an_encoder_without_counts_is_refused(counts):
    with pytest.raises(ValueError, match=r"counts is .*; an encoder has at least one count"):
        Encoder(counts)


def test_estimates_that_cannot_be_are_named():
    with pytest.raises(ValueError, match="samples is 0; give a whole number from 1 on"):
        Counting(0)
    with pytest.raises(ValueError, match=r"bandwidth is -1\.0; give .* of rad/s"):
        Tracking(-1.0)
    with pytest.raises(ValueError, match="EdgeTiming needs edges"):
        Drive(*DRIVE, None, EdgeTiming()).simulate(speed_loop(), {"R": 1.0}, timepts=1.0)
    direct = nrdob.NRDOB(
        ct.tf([1, 2], [1, 1]), ct.tf([1], [1, 1]), 1.0, nrdob.LowPassFilter(0.1, 1)
    )
    with pytest.raises(ValueError, match="the process has a direct path"):
        encoded(direct.sampled(0.01), Counting())
