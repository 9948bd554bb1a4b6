import copy
import math
import pickle
from dataclasses import replace

import control as ct
import numpy as np
import pytest
from hypothesis import given

import nrdob
from nrdob import LowPassFilter, paper
from nrdob.diagram import ObserverEquations, Quotient
from nrdob.numerics import QuasiPolynomial
from strategies import loops

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


@pytest.mark.slow
@given(loops())
def test_every_map_of_a_random_loop_is_the_printed_formula(loop):
    assert_maps_are_the_printed_ones(loop, np.array([0.3 + 0.7j, 3 + 1j]), 1e-6)


@pytest.mark.slow
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
        ({"controller": nrdob.delay(0.1) / s}, ValueError, "only the process and the model"),
        ({"filter": nrdob.delay(0.1) / (s + 1) ** 2}, ValueError, "filter has a dead time"),
        ({"model": nrdob.delay(0.1) * s**2 / (s + 2)}, ValueError, "model is improper"),
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


@pytest.mark.usefixtures("no_warning_leaks")
class TestMapsAtDelicatePoints:
    """Poles that cancel, true poles, and values beyond floating point."""

    @pytest.mark.parametrize("dead_time", [0.0, 1.0])
    @pytest.mark.parametrize("name", ["S_d", "S_eta", "T_R", "U_delta", "E_R", "L"])
    def test_an_undamped_pole_that_cancels_leaves_the_limit(self, name, dead_time):
        P = 1 / (s**2 + 4)
        G = nrdob.delay(dead_time) * P if dead_time else P
        loop = nrdob.NRDOB(G, P, 0.1 / s, nrdob.LowPassFilter(0.5, 2))
        at = 2j + 1e-3 * np.array([1, 1j, -1, -1j, *(np.exp(0.25j * np.pi * np.arange(1, 8, 2)))])
        limit = printed_maps(loop, at)[name].mean()  # of a smooth function, to its 8th derivative
        for s_near in (2j, 2j * (1 + 1e-12), 2j * (1 - 1e-9)):
            assert getattr(loop, name)(s_near) == pytest.approx(limit, rel=1e-6, abs=1e-6)
        many = getattr(loop, name)(np.array([[2j, 0.3j], [2j, 1.0]]))
        assert many[0, 0] == many[1, 0] == pytest.approx(limit, rel=1e-6, abs=1e-6)

    def test_poles_that_do_not_cancel_are_infinite(self):
        loop = nrdob.NRDOB(1 / (s**2 + 4), 1 / (s + 1), 0.1 / s, nrdob.LowPassFilter(0.5, 2))
        assert all(np.isinf(getattr(loop, name)(2j)) for name in ("G", "H", "FH", "L", "ratio"))
        detuned = nrdob.NRDOB(
            1 / (s**2 + 4), 1 / (s**2 + 4 + 1e-6), 0.1 / s, nrdob.LowPassFilter(0.5, 2)
        )
        assert np.isinf(detuned.ratio(2j))

    def test_a_perfect_model_has_no_mismatch_not_even_at_its_poles(self):
        P = 1 / (s**2 + 4)
        loop = nrdob.NRDOB(P, P, 0.1 / s, nrdob.LowPassFilter(0.5, 2))
        assert loop.H(2j) == loop.FH(2j) == 0

    def test_far_to_the_left_the_dead_time_wins(self):
        loop = nrdob.NRDOB(
            nrdob.delay(1.0) / (s + 1), 1 / (s + 1), 0.1 / s, nrdob.LowPassFilter(0.5, 2)
        )
        for point in (-1e4, -1e4 + 3j, -720.0):
            assert loop.S_d(point) == pytest.approx(0, abs=1e-300)
            assert loop.S_eta(point) == pytest.approx(-1, rel=1e-12)
            assert np.isinf(loop.G(point))
        # The two ways agree where both can be had: e^700 is still a number.
        assert loop.S_d(-690.0) == pytest.approx(printed_maps(loop, -690.0)["S_d"], rel=1e-9)

    def test_far_out_the_leading_terms_win(self):
        G = 2 / (s + 1) ** 4
        loop = nrdob.NRDOB(G, 1 / (s + 1) ** 4, (s + 2) / s, nrdob.LowPassFilter(0.5, 4))
        assert loop.ratio(1e200j) == pytest.approx(2, rel=1e-9)
        assert loop.K(-1e150) == pytest.approx(16, rel=1e-9)


def test_roots_that_are_only_near_do_not_cancel():
    G = 1.2 / ((s + 1) * (1e-4 * s + 1))
    loop = nrdob.NRDOB(G, 1 / (s + 1), 0.1 / s, nrdob.LowPassFilter(10.0, 3))
    tf = loop.S_d.to_tf()
    assert abs(tf(0.01j)) == pytest.approx(0.2488415, rel=1e-6)
    assert tf.poles().real.max() < 0


@pytest.mark.thorough
@pytest.mark.parametrize("order", [1, 2, 4, pytest.param(10, marks=pytest.mark.slow)])
@pytest.mark.parametrize("seed", range(6))
def test_transfer_functions_of_separated_time_scales_are_the_maps(seed, order):
    rng = np.random.default_rng(100 * order + seed)
    poles = -(10 ** rng.uniform(-3, 3, order))
    if seed % 2:
        poles[:] = -1.0
    Gm = ct.tf([abs(np.prod(poles))], np.poly(poles))
    fast = 10 ** rng.uniform(-4, -2)
    for G in (Gm, 1.2 * Gm, 1.2 * Gm * ct.tf([1], [fast, 1]), Gm * ct.tf([1, 2], [1, 1.7])):
        F = nrdob.LowPassFilter(10 ** rng.uniform(-1, 1), order)
        loop = nrdob.NRDOB(G, Gm, ct.tf([0.1, 0.123], [1, 0]), F)
        at = 1j * np.geomspace(1e-4, 1e4, 17)
        for name in ("T_R", "S_d", "S_delta", "S_eta", "U_R", "U_d", "L", "FH"):
            quotient = getattr(loop, name)
            assert quotient.to_tf()(at) == pytest.approx(quotient(at), rel=1e-7, abs=1e-13), name
        if G is Gm:
            assert loop.T_R.to_tf().poles().size == order + 1
            assert loop.S_d.to_tf().poles().size == order


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda loop: pickle.loads(pickle.dumps(loop))])
def test_a_loop_that_has_been_used_can_be_copied_and_sent_to_another_process(copied):
    loop = paper.example(3)
    maps = printed_maps(loop, S)  # the factors are made
    assert loop.S_eta(S) == pytest.approx(maps["S_eta"])
    again = copied(loop)
    assert again is not loop
    assert again.T_R(S) == pytest.approx(maps["T_R"])


def test_an_observer_can_be_given_another_filter():
    observer = ObserverEquations(ct.tf([2], [1, 1]), ct.tf([1], [1, 1]), LowPassFilter(0.5, 1))
    changed = replace(observer, filter=LowPassFilter(0.25, 1))
    assert changed.p_B.q.tolist() == [0.25, 2.25, 2.0]
    assert "controller" not in repr(changed)


@pytest.mark.parametrize(
    ("num", "den", "limit"),
    [
        ([[1e-200, 1], [1e-200, 1]], [[1e-200, 2], [2e-200, 1]], 0.5),
        ([[1e200, 1], [1e200, 1]], [[1e200, 2], [4e200, 1]], 0.25),
        ([[0.0]], [[1, 1]], 0.0),
        ([[1, 1, 1]], [[1, 1]], math.inf),
    ],
)
def test_the_limit_at_infinity_needs_no_product_of_leading_coefficients(num, den, limit):
    factors = (tuple(QuasiPolynomial(p) for p in part) for part in (num, den))
    assert Quotient(*factors).at_infinity == (limit, 0.0)
