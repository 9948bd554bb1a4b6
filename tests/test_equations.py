import control as ct
import numpy as np
import pytest
from hypothesis import given
from strategies import loops

import nrdob
from nrdob import paper

s = ct.tf("s")
S = np.array([0.1 + 0.3j, 2j, 1.5 - 40j, 0.05])


def printed_maps(loop, s):
    """Eqs. (4) and (7) as the paper prints them, evaluated block by block."""
    G, Gm, C, F = (block(s) for block in (loop.G, loop.Gm, loop.C, loop.F))
    B = Gm + F * (G - Gm)
    A = 1 + Gm * C
    return {
        "T_R": C * G * Gm / (A * B),
        "S_d": Gm * (1 - F) / B,
        "S_delta": G * Gm * (1 - F) / B,
        "S_eta": -G * F / B,
        "E_R": (F * (G - Gm) + Gm) / (A * B),
        "U_R": Gm * C / (A * B),
        "U_d": -F / B,
        "U_eta": -F / B,
        "U_delta": Gm * (1 - F) / B,
        "H": G / Gm - 1,
        "FH": F * (G / Gm - 1),
        "ratio": G / Gm,
        "CGm": C * Gm,
        "K": F / ((1 - F) * Gm),
        "L": G * F / ((1 - F) * Gm),
    }


def assert_maps_are_the_printed_ones(loop, s, rel):
    for name, value in printed_maps(loop, s).items():
        assert getattr(loop, name)(s) == pytest.approx(value, rel=rel), name


@pytest.mark.parametrize("number", paper.EXAMPLES)
def test_every_map_is_the_printed_formula(number):
    assert_maps_are_the_printed_ones(paper.example(number), S, 1e-10)


@given(loops())
def test_every_map_of_a_random_loop_is_the_printed_formula(loop):
    assert_maps_are_the_printed_ones(loop, np.array([0.3 + 0.7j, 3 + 1j]), 1e-6)


@given(loops(delayed=True))
def test_every_map_of_a_random_delayed_loop_is_the_printed_formula(loop):
    assert_maps_are_the_printed_ones(loop, np.array([0.3 + 0.7j, 3 + 1j]), 1e-6)


@pytest.mark.parametrize("number", paper.EXAMPLES)
def test_sensitivity_minus_noise_map_is_one(number):
    loop = paper.example(number)
    assert loop.S_d(S) - loop.S_eta(S) == pytest.approx(np.ones(S.size), abs=1e-12)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_transfer_functions_have_the_values_of_the_factored_maps(number):
    loop = paper.example(number)
    for name in printed_maps(loop, 1j):
        quotient = getattr(loop, name)
        assert quotient.to_tf()(S) == pytest.approx(quotient(S), rel=1e-9), name


def test_example_3_reference_map_has_order_5_and_no_pole_at_plus_one():
    poles = paper.example(3).T_R.to_tf().poles()
    assert poles.size == 5
    assert poles.real.max() < 0


def test_multiplying_transfer_functions_instead_gives_order_14_and_a_pole_at_plus_one():
    loop = paper.example(3)
    G, Gm, C, F = loop.process, loop.model, loop.controller, loop.filter.tf
    naive = C * G * Gm / ((1 + Gm * C) * (Gm + F * (G - Gm)))
    assert naive.poles().size == 14
    assert np.abs(naive.poles() - 1).min() < 1e-3


def test_double_shared_roots_are_divided_out_too():
    G = 1 / (s + 1) ** 2
    loop = nrdob.NRDOB(G, G, (s + 1) ** 2 / (s * (s + 5)), nrdob.LowPassFilter(0.1, 2))
    # T_R is C G/(1 + C G) = 1/(s^2 + 5 s + 1) exactly.
    assert loop.T_R.to_tf().poles().size == 2


def test_maps_with_dead_time_have_no_rational_form():
    with pytest.raises(ValueError, match=r"dead time of 0.05 s"):
        paper.example(4).T_R.to_tf()
    assert paper.example(4).CGm.to_tf().poles().size == 2  # the controller cancels s + 1.5


def test_poles_give_infinity_and_common_zeros_at_the_origin_give_the_limit():
    loop = nrdob.NRDOB(1 / s, 1 / s, 2, nrdob.LowPassFilter(0.05, 1))
    assert np.isinf(loop.G(0.0))
    assert loop.S_delta(0.0) == pytest.approx(0.05)  # n λ, not the 0 of eq. (5)


def test_blocks_may_come_as_state_space_as_pairs_and_as_numbers():
    loop = paper.example(1)
    other = nrdob.NRDOB(
        ct.tf2ss(loop.process), ([2, 10], [1, 11, 10]), ([1.39], [1, 0]), loop.filter.tf
    )
    assert other.T_R(S) == pytest.approx(loop.T_R(S), rel=1e-9)
    assert nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), 2, nrdob.LowPassFilter(1, 1)).T_R.dc_gain == (
        pytest.approx(2 / 3)
    )


def test_any_stable_filter_with_unit_gain_serves():
    Q = (0.3 * s + 1) / (0.1 * s + 1) ** 3
    loop = nrdob.NRDOB(1 / (s + 2), 1 / (s + 1), 1 / s, Q)
    assert_maps_are_the_printed_ones(loop, S, 1e-10)
    assert loop.S_d.dc_gain == 0


@pytest.mark.parametrize(
    ("blocks", "error", "words"),
    [
        ({"filter": nrdob.LowPassFilter(0.1, 1)}, ValueError, "use a filter of order 2"),
        ({"process": s * (s + 1) / (s + 2)}, ValueError, "process is improper"),
        ({"model": s**2 / (s + 2)}, ValueError, "model is improper"),
        ({"controller": s}, ValueError, "controller is improper"),
        ({"process": ct.tf([0.0], [1.0])}, ValueError, "process is identically zero"),
        ({"model": ct.tf([0.0], [1.0])}, ValueError, "model is identically zero"),
        ({"model": nrdob.delay(0.1) / (s + 1) ** 2}, ValueError, "leave the dead time out"),
        ({"controller": nrdob.delay(0.1) / s}, TypeError, "only the process"),
        ({"process": ct.tf([1.0], [1.0, 2.0], 0.1)}, ValueError, "process is discrete-time"),
        ({"filter": 2 / (s + 1) ** 2}, ValueError, r"F\(0\)"),
        ({"process": [[1.0], [float("nan"), 1.0]]}, ValueError, "finite"),
        ({"controller": "PI"}, TypeError, "controller"),
    ],
)
def test_a_block_that_cannot_stand_where_it_is_put_is_named(blocks, error, words):
    good = {
        "process": 1 / (s + 1) ** 2,
        "model": 1 / (s + 1) ** 2,
        "controller": 1 / s,
        "filter": nrdob.LowPassFilter(0.1, 2),
    }
    nrdob.NRDOB(**good)
    with pytest.raises(error, match=words):
        nrdob.NRDOB(**(good | blocks))


def test_a_double_root_of_the_numerator_cancels_a_single_one_once():
    model = (s + 0.5) / (s + 1) ** 2
    process = (s + 0.5) / ((s + 0.75) * (s + 1))
    loop = nrdob.NRDOB(process, model, (s + 1) / s, nrdob.LowPassFilter(0.5, 2))
    for name in printed_maps(loop, 1j):
        quotient = getattr(loop, name)
        assert quotient.to_tf()(S) == pytest.approx(quotient(S), rel=1e-9), name
