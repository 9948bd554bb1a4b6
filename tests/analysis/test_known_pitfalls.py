"""Cases in which the usual software is silently wrong: each must come out right here."""

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest

import nrdob
from nrdob import LowPassFilter, paper
from nrdob.analysis import encirclements

s = ct.tf("s")


def turns_seen_on_a_grid(quotient, omega):
    """What a fixed frequency grid, as of measured data, would count."""
    values = quotient(1j * omega) + 1
    return round(float(-np.angle(values[1:] / values[:-1]).sum() / np.pi))


def test_a_lightly_damped_mode_between_grid_points_is_counted():
    process = (1 / (s + 1)) * (1 - 0.05 * s / (s**2 + 2e-5 * s + 1))
    loop = nrdob.NRDOB(process, 1 / (s + 1), 1, LowPassFilter(0.1, 1))
    truth = int(np.sum(np.roots(loop.p_B.q).real > 0))
    coarse = np.geomspace(1e-3, 1e3, 600)
    count = encirclements(loop.FH)
    assert truth == 2
    assert count.closed_loop_rhp == truth
    assert turns_seen_on_a_grid(loop.FH, coarse) != count.encirclements


def test_repeated_poles_on_the_axis_do_not_spoil_the_count():
    process = (1 + s) ** 2 / (s**2 + 1) ** 2
    model = 1 / (s**2 + 2 * s + 1)
    loop = nrdob.NRDOB(process, model, 1, LowPassFilter(0.2, 2))
    observer = loop.stability().observer_loop
    roots = np.roots(loop.p_B.q)
    assert observer.open_loop_rhp == 0
    assert observer.closed_loop_rhp == np.sum(roots.real > 0)


def test_three_integrators_are_indented_exactly():
    model = (s + 1) ** 2 / s**3
    for gain, roots in ((0.4, 2), (1.0, 0)):  # s^3 + k (s+1)^2 needs k > 1/2
        loop = nrdob.NRDOB(model, model, gain, LowPassFilter(0.1, 1))
        count = encirclements(loop.CGm)
        assert (count.encirclements, count.open_loop_rhp) == (roots, 0)


def test_a_pade_step_is_far_off_where_the_exact_one_is_not():
    lag = 1 / (s + 1)
    blocks = {"model": lag, "controller": 1, "filter": LowPassFilter(0.4, 1)}
    times = np.linspace(0, 8, 1601)
    exact = nrdob.NRDOB(nrdob.delay(0.5) * lag, **blocks).step_response("d", times).outputs[0, 0]
    pade = nrdob.NRDOB(ct.tf(*ct.pade(0.5, 1)) * lag, **blocks).step_response("d", times)
    assert np.abs(pade.outputs[0, 0] - exact).max() > 0.1
    # Up to the dead time the output is exactly the disturbance: nothing has come back yet.
    assert np.allclose(exact[times < 0.5], 1.0, atol=1e-12)


def test_units_are_never_mixed():
    found = paper.example(3).margins().observer_loop
    assert found.gm == pytest.approx(0.2)  # a factor, as its name does not say dB
    assert found.gm_db == pytest.approx(20 * np.log10(0.2))
    assert found.pm == pytest.approx(65.09, abs=0.01)  # degrees


@pytest.mark.thorough
@pytest.mark.usefixtures("no_warning_leaks")
@pytest.mark.parametrize(
    "number", [*(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 3)), 4]
)
def test_nothing_is_printed_and_nothing_warns(number, capfd):
    loop = paper.example(number)
    loop.stability()
    loop.margins()
    loop.step_response("eta")
    for draw in (loop.plot_nyquist, loop.plot_bode, loop.plot_step):
        draw()._repr_mimebundle_()
    plt.close("all")
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""
