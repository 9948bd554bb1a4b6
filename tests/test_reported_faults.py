"""Faults that were found by hostile use, each kept from coming back."""

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import LowPassFilter, delay
from nrdob.diagram import as_fraction
from nrdob.numerics import count_rhp

s = ct.tf("s")


pytestmark = pytest.mark.usefixtures("no_warning_leaks")


def rotated(poles, seed):
    """State space of a chain of lags in coordinates that hide its structure."""
    n = len(poles)
    T = np.linalg.qr(np.random.default_rng(seed).standard_normal((n, n)))[0]
    A, B, C = np.diag(poles) + np.eye(n, k=1), np.eye(n)[:, -1:], np.eye(n)[:1]
    return ct.ss(T.T @ A @ T, T.T @ B, C @ T, 0)


@pytest.mark.parametrize("seed", range(25))
def test_a_rotated_state_space_is_the_transfer_function_it_realises(seed):
    n = 1 + seed % 5
    poles = -(10 ** np.random.default_rng(seed).uniform(-1, 1, n))
    found = as_fraction(rotated(poles, seed), "process")
    w = 1j * np.geomspace(0.01, 100, 9)
    exact = 1 / np.prod(w[:, None] - poles, axis=1)
    assert found.relative_degree == n
    assert np.polyval(found.num, w) / np.polyval(found.den, w) == pytest.approx(exact, rel=1e-8)


def test_integrators_of_a_rotated_state_space_stay_at_the_origin():
    found = as_fraction(rotated([0.0, 0.0], 3), "process")
    assert list(found.den[1:]) == [0.0, 0.0]


def test_a_model_loop_that_cancels_completely_is_ill_posed_not_stable():
    verdict = nrdob.NRDOB(-1.0, -1.0, 1.0, LowPassFilter(1, 1)).stability()
    assert verdict.stable is None
    assert "ill-posed" in verdict.reason


@pytest.mark.parametrize("unit", [1, 4096, 2**20])
def test_delayed_margins_do_not_depend_on_the_unit_of_time(unit):
    loop = nrdob.NRDOB(delay(1.578 * unit) * 0.806, 0.756, 0, LowPassFilter(7 * unit, 1))
    found = loop.margins().plant_loop
    assert found.gm_high == pytest.approx(6.5357837, rel=1e-6)
    assert found.sm == pytest.approx(0.8077248, rel=1e-6)


def test_delayed_crossings_far_below_the_corner_frequencies_are_found():
    slow = nrdob.NRDOB(delay(3.8) * 2.0026, 1.0, 0, LowPassFilter(330.0, 1))
    found = slow.margins().observer_loop
    assert (found.pm, found.wgc) == (
        pytest.approx(175.78, abs=0.01),
        pytest.approx(2.19e-4, rel=1e-2),
    )
    slower = nrdob.NRDOB(
        delay(152.3549555589906) * 0.35747453, 1.78737986, 0, LowPassFilter(37.75568786036981, 1)
    )
    assert slower.margins().observer_loop.gm_high == pytest.approx(1.24532, abs=1e-5)


def test_crossings_of_a_loop_with_time_scales_far_apart_are_found():
    model = ct.tf([584.65288344, 1.8148644], [3.25422490e-4, 2.45834858e-3, 1])
    controller = ct.tf([784947.813, 0, 2.01333323], [0.02597589, 1, 0])
    found = nrdob.NRDOB(model, model, controller, LowPassFilter(1, 1)).margins().model_loop
    assert found.gain_crossovers[:2] == pytest.approx([1.60122681e-3, 1.60185064e-3], rel=1e-7)
    assert found.pm == pytest.approx(62.7075, abs=1e-3)


@pytest.mark.slow
def test_poles_of_the_loop_gain_on_the_axis_are_no_crossings():
    loop = nrdob.NRDOB(1 / (s**2 + 1), 1 / (s**2 + 1.1), 1 / (s + 1), LowPassFilter(0.5, 2))
    every = loop.margins()
    assert not np.any(np.abs(every.observer_loop.phase_crossovers - 1) < 1e-6)
    loop.plot_bode("FH")


@pytest.mark.slow
@pytest.mark.parametrize(("dead_time", "lag"), [(1.0, 0.001), (10.0, 0.01)])
def test_a_delay_much_longer_than_a_fast_lag_is_judged(dead_time, lag):
    process = delay(dead_time) / ((lag * s + 1) * (s + 1))
    loop = nrdob.NRDOB(process, 1 / (s + 1), 0.1 / s, LowPassFilter(4 * dead_time, 1))
    verdict = loop.stability()
    assert verdict.stable is True
    assert count_rhp(loop.p_B).count == 0
    loop.plot_step()


def test_a_difference_equation_has_roots_on_its_vertical_line():
    loop = nrdob.NRDOB(delay(0.0676) * -0.626, 1.365 / s, 0, LowPassFilter(25.0, 1))
    assert loop.stability().stable is False  # the model's integrator leaves a root at s = 0
    rest = loop.p_B.without_origin
    assert count_rhp(rest).count == 0
    line = np.log(0.626 / (1.365 * 25.0)) / 0.0676
    assert rest.roots.real == pytest.approx(np.full(rest.roots.size, line), rel=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["G", "H", "ratio", "L", "S_eta"])
def test_maps_of_a_pure_delay_are_drawn_without_a_warning(name):
    loop = nrdob.NRDOB(delay(1.0) / (s + 1), 1 / (s + 1), 1 / s, LowPassFilter(2, 1))
    loop.plot_nyquist(name)._repr_mimebundle_()


def test_a_loop_through_minus_one_has_an_infinite_sensitivity_peak():
    loop = nrdob.NRDOB(1 / (s + 1), -1.0, 1.0, LowPassFilter(1, 1))
    assert "no margins" in repr(loop.margins())


def test_a_long_response_comes_to_rest_where_it_should():
    den = [12.66828722, 40.99920869, 1]
    loop = nrdob.NRDOB(
        ct.tf([-1.57218853e-4, -1.65688874e-7, -0.213790231], den),
        ct.tf([-1.602385e-4, -1.68871201e-7, -0.217896423], den),
        ct.tf([11.63432361, 0.14723448], [0.0385711, 0.63488803, 1]),
        LowPassFilter(0.17807366614, 1),
    )
    assert loop.step_response("eta").outputs[0, 0, -1] == pytest.approx(-1, abs=1e-9)


def test_a_pole_and_a_zero_that_almost_cancel_near_the_axis_make_no_crossing():
    den = [0.0148736, 0.2439147, 1.0]
    loop = nrdob.NRDOB(
        ct.tf([5.36099153e-6, 3.64094585e-8, 3.19376194], den),
        ct.tf([2.68510490e-6, 1.82360324e-8, 1.59962682], den),
        ct.tf([3.39571793e-3, 2.52535211, 8.43950695], [0.02668938, 0.32673772, 1.0]),
        LowPassFilter(0.00012544379591233315, 1),
    )
    # G/Gm is 1.9966 up to a dipole of relative width 1e-8; the rest of FH never reaches 1.
    assert loop.margins().observer_loop.pm == np.inf
    assert loop.margins().plant_loop.gm_high == np.inf
