"""Errors after a load: against closed forms, and time against frequency."""

from math import inf, sqrt, tanh

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import LowPassFilter, delay
from nrdob.alternatives import controller_alone, load_errors

s = ct.tf("s")


@pytest.mark.parametrize("damping", [0.9, 0.3, 0.05])
def test_area_and_energy_of_a_damped_swing(damping):
    # y = exp(-σt) sin(ωt)/ω: ∫|y| = coth(πσ/2ω)/k and ∫y² = 1/(4σk), with k = σ² + ω².
    k = 4.0
    sigma = damping * sqrt(k)
    omega = sqrt(k - sigma**2)
    loop = controller_alone(1 / (s + 2 * sigma), 1 / (s + 2 * sigma), k / s)
    found = load_errors(loop)
    assert found.iae == pytest.approx(1 / tanh(np.pi * sigma / (2 * omega)) / k, rel=1e-4)
    assert found.ise == pytest.approx(1 / (4 * sigma * k), rel=1e-9)


def test_an_offset_that_stays_has_no_finite_area():
    loop = nrdob.NRDOB(1 / s, 1 / s, 1.0, LowPassFilter(0.5, 1))  # 1 - F ~ s cancels the 1/s
    assert load_errors(loop) == (inf, inf)


@pytest.mark.parametrize(
    "loop",
    [
        nrdob.paper.example(4),
        nrdob.NRDOB(delay(0.6) * 1.1 / (s + 1), delay(0.6) / (s + 1), 1.0, LowPassFilter(0.3, 2)),
        nrdob.NRDOB(delay(0.5) / (s + 1), delay(0.4) / (s + 1), 1.0, LowPassFilter(0.6, 2)),
    ],
    ids=["one dead time", "a model that waits as long", "two dead times"],
)
def test_energy_over_frequency_is_the_energy_over_time(loop):
    last = 16 / -loop.p_B.roots[0].real
    times = np.linspace(0, last, 20_001)
    y = loop.step_response("delta", times).outputs[0, 0]
    from_time = float(np.sum((y[1:] ** 2 + y[:-1] ** 2) / 2) * times[1])
    assert loop.S_delta.step_energy() == pytest.approx(from_time, rel=1e-5)


def test_a_matched_model_rejects_with_the_known_energy():
    # J_n λ: a step of d leaves L⁻¹((1 - F)/s), whose energy is λ/2, 5λ/4, 33λ/16.
    for order, index in ((1, 1 / 2), (2, 5 / 4), (3, 33 / 16)):
        G = 1 / (s + 1) ** order
        loop = nrdob.NRDOB(G, G, 1.0, LowPassFilter(0.7, order))
        assert loop.S_d.step_energy() == pytest.approx(index * 0.7, rel=1e-12)


def test_a_well_tuned_controller_alone_passes_less_noise_at_equal_rejection():
    # ‖S_η‖² times the energy of a step of d does not depend on the time scale; 5/16 for n = 2.
    G = (2 * s + 10) / (s**2 + 11 * s + 10)

    def price(loop):
        return loop.S_eta.noise_power() * loop.S_d.step_energy()

    observer = nrdob.NRDOB(G, G, 1.39 / s, LowPassFilter(0.01, 2))
    inverting = (s**2 + 11 * s + 10) / (0.1 * s * (2 * s + 10))
    alone = [price(controller_alone(G, G, C)) for C in (0.2 / s, (s + 1) / s, inverting)]
    assert price(observer) == pytest.approx(5 / 16, rel=1e-10)
    assert alone[-1] == pytest.approx(1 / 4, rel=1e-10) and max(alone) < 5 / 16
    # The paper's own C is far from that.
    assert price(controller_alone(G, G, 1.39 / s)) > 5 / 16


def test_an_unstable_loop_has_no_energy():
    loop = nrdob.NRDOB(1 / (s - 1), 1 / (s + 1), 1.0, LowPassFilter(9.0, 1))
    with pytest.raises(ValueError, match="the energy of a step through S_delta is infinite"):
        load_errors(loop)
