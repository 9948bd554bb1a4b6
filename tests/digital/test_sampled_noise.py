"""Variances of the sampled loop: against its own impulse response, and Welch's spectra."""

import warnings
from functools import cache

import control as ct
import numpy as np
import pytest
from scipy.signal import welch
from scipy.stats import chi2

import nrdob
from nrdob import LowPassFilter, delay

s = ct.tf("s")
DT = 0.05
PLANTS = {
    "lag": (2 / (s + 1), 1.0, 0.0),
    "dead time of two samples": (delay(0.1) * 2 / (s + 1), 1.0, 0.0),
    "fractional dead time": (delay(0.13) * 2 / (s + 1), 1.0, 0.0),
    "a sample of computation": (2 / (s + 1), 1.0, DT),
    "direct path": ((0.1 * s + 2) / (s + 1), 1.0, 0.0),
}


@cache
def sampled(name):
    G, C, computation = PLANTS[name]
    loop = nrdob.NRDOB(G, 1.8 / (s + 1.1), C, LowPassFilter(0.4, 2))
    return loop.sampled(DT, computation_delay=computation)


def run(found, noise):
    """Step hold, process and controller sample by sample; no equation of the whole loop."""
    process, controller = found.process, found.controller
    x, own = np.zeros(process.C.size), np.zeros(controller.states)
    past = np.zeros(process.samples + 2)  # u[k-1], u[k-2], …
    signals = np.zeros((2, len(noise)))
    for k, eta in enumerate(noise):
        y = process.C @ x + process.D * past[process.samples]
        u = controller.C @ own + controller.D[1] * (y + eta)
        line = np.concatenate([[u], past])
        x = (process.Ad @ x + process.B0 * line[process.samples]
             + process.B1 * line[process.samples + 1])  # fmt: skip
        own = controller.A @ own + controller.B @ [0.0, y + eta, u]
        past = line[:-1]
        signals[:, k] = y, u
    return signals


@pytest.mark.parametrize("name", PLANTS)
def test_the_variance_is_the_energy_of_the_impulse_response(name):
    found = sampled(name)
    pulse = run(found, np.eye(1, 1200)[0])
    assert found.noise_variance() == pytest.approx(tuple((pulse**2).sum(axis=1)), rel=1e-9)
    coloured = np.convolve(0.3 * 0.8 ** np.arange(300), np.eye(1, 900)[0])
    pulse = run(found, coloured)
    W = ct.tf([0.3, 0.0], [1, -0.8], DT)
    assert found.noise_variance(W) == pytest.approx(tuple((pulse**2).sum(axis=1)), rel=1e-9)
    assert found.noise_variance(0.5).u == pytest.approx(0.25 * found.noise_variance().u, rel=1e-12)


def test_fast_sampling_gives_the_variance_of_white_noise_in_continuous_time():
    loop = sampled("lag").loop
    continuous = loop.noise_variance()
    for dt, accuracy in ((0.02, 0.1), (0.002, 0.01)):
        found = loop.sampled(dt).noise_variance()
        assert found.y / dt == pytest.approx(continuous.y, rel=accuracy)
        assert found.u / dt == pytest.approx(continuous.u, rel=accuracy)


@pytest.mark.thorough
def test_welchs_spectrum_of_a_simulation_agrees_with_the_continuous_one_within_its_confidence():
    found = sampled("fractional dead time").loop.sampled(0.01)
    noise = np.random.default_rng(7).standard_normal(60_000) / np.sqrt(0.01)  # unit density
    signals = run(found, noise)
    segment = 2_000
    for quotient, signal in zip((found.loop.S_eta, found.loop.U_eta), signals, strict=True):
        hertz, density = welch(signal[5_000:], 1 / 0.01, "hann", segment, detrend=False)
        seen = slice(2, 61)  # 0.1 to 3 Hz, far below the sampling
        theory = 2 * quotient.spectrum(2 * np.pi * hertz[seen])
        # 54 halves overlapping under Hann's window count as 29 independent segments (Welch 1967).
        freedom = 2 * 29
        low, high = chi2.ppf([0.005, 0.995], freedom) / freedom
        ratio = density[seen] / theory
        assert np.mean((ratio > low * 0.98) & (ratio < high * 1.02)) > 0.95  # of 99 %
        assert ratio.mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / freedom / 59 * 1.9))


def test_an_unstable_sampled_loop_and_unfit_shaping_are_refused():
    loop = sampled("lag").loop
    unstable = nrdob.NRDOB(5 * loop.process, loop.model, loop.controller, LowPassFilter(0.02, 2))
    with pytest.raises(ValueError, match="the sampled loop has a root of size"):
        unstable.sampled(0.1, computation_delay=0.2).noise_variance()
    with pytest.raises(ValueError, match=r"shaping has dt = 0.1; .* with dt = 0.05"):
        sampled("lag").noise_variance(ct.tf([1], [1, -0.5], 0.1))
    with pytest.raises(ValueError, match="shaping has dt = 0; it colours the samples"):
        sampled("lag").noise_variance(1 / (s + 1))
    with pytest.raises(ValueError, match=r"shaping has a pole of size 1\.2"):
        sampled("lag").noise_variance(ct.tf([1], [1, -1.2], DT))
    with pytest.raises(TypeError, match="shaping is a list; give a discrete-time block"):
        sampled("lag").noise_variance([1, 2])
    assert sampled("lag").noise_variance(np.array(0.5)) == sampled("lag").noise_variance(0.5)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1 + 1j])
def test_shaping_that_is_no_finite_number_is_refused(value):
    with pytest.raises(ValueError, match=r"shaping is .*; give a finite real number, or a block"):
        sampled("lag").noise_variance(value)
    with pytest.raises(ValueError, match="shaping has coefficients that are not finite"):
        sampled("lag").noise_variance(ct.ss([[0.5]], [[1]], [[np.nan]], [[0]], DT))


@pytest.mark.parametrize("ratio", [0.02, 0.5, 1.9])
def test_states_of_different_sizes_do_not_disturb_the_variance(ratio):
    # Motor without friction, n = 1: y[k+1] = (1 - a) y[k] - a η[k] with a = dt/λ.
    dt, motor = 0.01, 1 / (0.01 * s)
    loop = nrdob.NRDOB(motor, motor, 0.1, LowPassFilter(dt / ratio, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = loop.sampled(dt).noise_variance()
        friction = 0.01 / (0.01 * s + 0.1001)
        C = (0.01 * s + 0.1001) / (0.001 * s)
        nrdob.NRDOB(friction, friction, C, LowPassFilter(0.02, 1)).sampled(dt).noise_variance()
    assert found.y == pytest.approx(ratio / (2 - ratio), rel=1e-9)
