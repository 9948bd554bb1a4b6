"""The loop on a processor: linear against control and scipy, with limits against the clock."""

import time

import control as ct
import numpy as np
import pytest
from scipy.signal import dlsim

import nrdob
from nrdob.digital import ActuatorLimits

DT = 0.01
LAG = ct.tf([2.0], [1.0, 1.0])
LOOP = nrdob.NRDOB(LAG, LAG, ct.tf([1.0, 1.0], [1.0, 0.0]), nrdob.LowPassFilter(0.5, 1))


@pytest.fixture(scope="module")
def same():
    """d to y of the sampled loop, as control has it."""
    K = ct.ss(ct.sample_system(LOOP.K.to_tf(), DT, "bilinear"))
    G = ct.ss(ct.sample_system(ct.ss(LAG), DT, "zoh"))
    return ct.feedback(ct.ss([], [], [], [[1.0]], DT), G * K)


@pytest.mark.parametrize("side", ["nrdob", "control"])
def test_a_linear_simulation_of_100000_samples(race, same, side):
    d = np.random.default_rng(0).standard_normal(100_000)
    times = np.arange(d.size) * DT

    def ours():
        return LOOP.sampled(DT).simulate({"d": d})

    def theirs():
        return ct.forced_response(same, times, d)

    race("100,000 samples, linear", side, ours, theirs)


def test_simulations_of_a_million_samples(same, note):
    rng = np.random.default_rng(0)
    R = np.sign(np.sin(np.arange(1_000_000) * DT * 0.2))
    d = rng.standard_normal(R.size)
    sampled = LOOP.sampled(DT)

    def timed(run):
        start = time.process_time()
        run()
        return time.process_time() - start

    for what, options in (
        ("without limits", {}),
        ("limits and rate, noise", {"limits": ActuatorLimits(-0.6, 0.6, 5), "noise": 0.1}),
        ("chattering between limits", {"limits": ActuatorLimits(-0.01, 0.01), "noise": 0.5}),
        ("limits and converters", {"limits": ActuatorLimits(-0.6, 0.6, 5), "resolution": 0.01}),
    ):
        seconds = timed(lambda options=options: sampled.simulate({"R": R}, **options))
        note(f"a million samples, {what}: {seconds:.2f} s")
    note(f"a million samples, scipy's dlsim, linear: "
         f"{timed(lambda: dlsim((same.A, same.B, same.C, same.D, DT), d)):.2f} s")  # fmt: skip
