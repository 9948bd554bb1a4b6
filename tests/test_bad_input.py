"""Every kind of bad block, at every public function that takes one: named, with the remedy."""

import decimal
import fractions

import control as ct
import numpy as np
import pytest
import scipy.signal
import sympy

import nrdob
from nrdob import LowPassFilter, design
from nrdob.diagram import DelayedTransferFunction

pytestmark = pytest.mark.usefixtures("no_warning_leaks")

s = ct.tf("s")
PLANT = 1 / (s + 1)
FILTER = LowPassFilter(0.5, 1)

TAKES_A_PROCESS = {
    "NRDOB": lambda G: nrdob.NRDOB(G, PLANT, 1.0, FILTER),
    "judge_observer": lambda G: nrdob.judge_observer(G, PLANT, FILTER),
    "design_filter": lambda G: nrdob.design_filter(G, PLANT, max_ms=2),
    "admissible_time_constants": lambda G: nrdob.admissible_time_constants(G, PLANT, 1, max_ms=2),
    "suggest_model": nrdob.suggest_model,
    "stabilizing_time_constants": lambda G: nrdob.stabilizing_time_constants(G, PLANT, 1),
    "critical_time_constants": lambda G: nrdob.critical_time_constants(G, PLANT, 1),
    "stable_for_slow_filters": lambda G: design.stable_for_slow_filters(G, PLANT, 1),
    "stable_for_fast_filters": lambda G: design.stable_for_fast_filters(G, PLANT, 1),
    "right_half_plane_parity": lambda G: design.right_half_plane_parity(G, PLANT),
    "stabilizing_filter_exists": lambda G: design.stabilizing_filter_exists(G, PLANT),
}
TAKES_A_MODEL = {
    "NRDOB": lambda Gm: nrdob.NRDOB(PLANT, Gm, 1.0, FILTER),
    "judge_observer": lambda Gm: nrdob.judge_observer(PLANT, Gm, FILTER),
    "design_filter": lambda Gm: nrdob.design_filter(PLANT, Gm, order=2, max_ms=1.1),
    "admissible_time_constants": lambda Gm: nrdob.admissible_time_constants(PLANT, Gm, 1, max_ms=2),
    "design_controller": lambda Gm: nrdob.design_controller(Gm, bandwidth=1.0),
    "stabilizing_time_constants": lambda Gm: nrdob.stabilizing_time_constants(PLANT, Gm, 1),
    "critical_time_constants": lambda Gm: nrdob.critical_time_constants(PLANT, Gm, 1),
    "stable_for_slow_filters": lambda Gm: design.stable_for_slow_filters(PLANT, Gm, 1),
    "stable_for_fast_filters": lambda Gm: design.stable_for_fast_filters(PLANT, Gm, 1),
    "right_half_plane_parity": lambda Gm: design.right_half_plane_parity(PLANT, Gm),
    "stabilizing_filter_exists": lambda Gm: design.stabilizing_filter_exists(PLANT, Gm),
}
DOORS = {
    **{("process", name): door for name, door in TAKES_A_PROCESS.items()},
    **{("model", name): door for name, door in TAKES_A_MODEL.items()},
    ("controller", "NRDOB"): lambda C: nrdob.NRDOB(PLANT, PLANT, C, FILTER),
    ("filter", "NRDOB"): lambda F: nrdob.NRDOB(PLANT, PLANT, 1.0, F),
    ("filter", "judge_observer"): lambda F: nrdob.judge_observer(PLANT, PLANT, F),
    ("rational part", "DelayedTransferFunction"): lambda P: DelayedTransferFunction(P, 0.1),
    ("other factor", "delay"): lambda P: nrdob.delay(0.1) * P,
    ("other term", "delay"): lambda P: nrdob.delay(0.1) + P,
    ("divisor", "delay"): lambda P: nrdob.delay(0.1) / P,
    ("L", "margins"): nrdob.margins,
    ("L", "encirclements"): nrdob.encirclements,
}
S = sympy.Symbol("s")

BAD = {
    "a text": ("1/(s+1)", TypeError, "is a str; pass a control.TransferFunction"),
    "nothing": (None, TypeError, "is a NoneType; pass"),
    "a truth value": (True, TypeError, "is a bool; pass"),
    "a complex gain": (1 + 2j, TypeError, "complex coefficients"),
    "NaN": (float("nan"), ValueError, "finite"),
    "measured points": (ct.frd([1, 0.5], [1.0, 2.0]), TypeError, "fit a transfer function"),
    "two inputs": (
        ct.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]]),
        ValueError,
        "2 inputs and 1 outputs.*pass one channel",
    ),
    "discrete time": (ct.tf([1.0], [1.0, 0.5], 0.1), ValueError, "pass the continuous-time"),
    "discrete states": (ct.ss(-0.5, 1, 1, 0, 0.1), ValueError, "pass the continuous-time"),
    "poly1d": (np.poly1d([1, 1]), TypeError, r"\(num, den\)"),
    "Polynomial": (np.polynomial.Polynomial([1, 1]), TypeError, "descending"),
    "scipy's discrete time": (
        scipy.signal.dlti([1], [1, 0.5], dt=0.1),
        ValueError,
        "dt=0.1.*pass the continuous-time",
    ),
    "scipy's two outputs": (
        scipy.signal.TransferFunction([[1, 2], [3, 4]], [1, 1]),
        ValueError,
        "pass one channel",
    ),
    "scipy's complex zpk": (
        scipy.signal.ZerosPolesGain([], [-1 + 1j], 1),
        TypeError,
        "complex.*must be real",
    ),
    "complex states": (
        scipy.signal.StateSpace([[-1 + 1j]], [[1]], [[1]], [[0]]),
        TypeError,
        "complex entry in A",
    ),
    "states below floating point": (
        ct.ss([[-1e-300]], [[1e-300]], [[1e-300]], 0),
        ValueError,
        "beyond the range",
    ),
    "a formula": (1 / (S + 1), TypeError, "numbers first"),
    "a filter": (FILTER, TypeError, r"pass its transfer function, \.tf"),
}
BAD_PAIRS = {
    "texts": ((["1"], ["1", "1"]), TypeError, "real coefficients"),
    "a text among numbers": (([1.0, "2"], [1.0, 1.0]), TypeError, "real coefficients"),
    "truth values": (([True], [True, True]), TypeError, "real coefficients"),
    "a truth value among numbers": (([1.0], [1, True]), TypeError, "real coefficients"),
    "an array of truth values": (np.array([[True, True], [True, True]]), TypeError, "real"),
    "complex coefficients": (([1.0], [1.0, 1j]), TypeError, "complex.*must be real"),
    "rows in a row": (([[1.0, 2.0]], [1.0, 1.0]), ValueError, "1-D list"),
    "rows of different length": (([[1.0], [1.0, 2.0]], [1.0]), TypeError, "real coefficients"),
    "no coefficients": (([], [1.0, 1.0]), ValueError, "non-empty"),
    "None for a polynomial": ((None, [1.0, 1.0]), ValueError, "non-empty"),
    "infinite": (([1.0], [float("inf"), 1.0]), ValueError, "finite"),
    "beyond floating point": (([10**400], [1.0, 1.0]), ValueError, "finite"),
    "denominator zero": (([1.0], [0.0, 0.0]), ValueError, "at least one nonzero coefficient"),
    "ascending coefficients": (
        (np.polynomial.Polynomial([1]), np.polynomial.Polynomial([1, 1])),
        TypeError,
        "ascend",
    ),
    "three arrays": (([1.0], [1.0, 1.0], 0.1), TypeError, "a pair"),
}


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.parametrize("role", DOORS, ids="-".join)
def test_a_bad_block_is_named_with_the_remedy_at_every_door(role, kind):
    block, error, words = BAD[kind]
    if role[0] == "filter" and kind == "a filter":
        return  # the one place where it belongs
    with pytest.raises(error, match=words) as caught:
        DOORS[role](block)
    assert role[0] in str(caught.value)
    assert type(caught.value) is error


@pytest.mark.parametrize("kind", BAD_PAIRS)
@pytest.mark.parametrize("role", [role for role in DOORS if role[1] != "delay"], ids="-".join)
def test_a_bad_pair_of_coefficients_is_named_with_the_remedy_at_every_door(role, kind):
    block, error, words = BAD_PAIRS[kind]
    with pytest.raises(error, match=words) as caught:
        DOORS[role](block)
    assert role[0] in str(caught.value)
    assert type(caught.value) is error


@pytest.mark.slow
@pytest.mark.parametrize(
    "role",
    [role for role in DOORS if role[0] == "model"],
    ids="-".join,
)
def test_a_model_that_waits_is_taken(role):
    assert DOORS[role](nrdob.delay(0.1) * PLANT) is not None


@pytest.mark.slow
def test_no_dead_time_is_no_dead_time():
    Gm = 10 / (s + 2)
    G = 0.1 * (100 - s) / (s + 2)
    for ask in (
        lambda model: nrdob.design_filter(G, model, max_ms=1.6),
        lambda model: nrdob.stabilizing_time_constants(G, model, 2),
        lambda model: nrdob.design_controller(model, bandwidth=1.0),
        lambda model: design.right_half_plane_parity(G, model),
    ):
        assert repr(ask(nrdob.delay(0) * Gm)) == repr(ask(Gm))


@pytest.mark.parametrize("role", DOORS, ids="-".join)
def test_an_identically_zero_block_gives_no_raw_error(role):
    if role[0] in ("controller", "rational part", "other factor", "other term", "L"):
        return
    with pytest.raises((ValueError, ZeroDivisionError), match=role[0]):
        DOORS[role](ct.tf([0.0], [1.0]))


KINDS_OF_LAG = {
    "pair": ([2.0], [1.0, 1.0]),
    "whole numbers": ([2], [1, 1]),
    "padded": ([0, 0, 2], [0, 1, 1]),
    "array of two rows": np.array([[0.0, 2.0], [1.0, 1.0]]),
    "imaginary parts of zero": ([2 + 0j], np.array([1 + 0j, 1 + 0j])),
    "exact fractions": ([fractions.Fraction(2)], [decimal.Decimal(1), sympy.Integer(1)]),
    "poly1d": (np.poly1d([2]), np.poly1d([1, 1])),
    "zeros, poles, gain": ct.zpk([], [-1], 2),
    "states": ct.ss(-1, 1, 2, 0),
    "scipy's lti": scipy.signal.lti([2], [1, 1]),
    "scipy's zeros, poles, gain": scipy.signal.ZerosPolesGain([], [-1], 2),
    "scipy's states": scipy.signal.StateSpace(-1, 1, 2, 0),
    "no time base": ct.TransferFunction([2], [1, 1], None),
    "interconnected": ct.feedback(ct.tf2ss(ct.tf([2], [1, 3])), ct.tf2ss(ct.tf([-1], [1]))),
    "one channel of several": ct.tf([[[2], [1]]], [[[1, 1], [1, 2]]])[0, 0],
    "no dead time": nrdob.delay(0) * ct.tf([2], [1, 1]),
}


@pytest.mark.parametrize("kind", KINDS_OF_LAG)
def test_every_way_to_write_a_lag_is_the_same_lag(kind):
    lag = KINDS_OF_LAG[kind]
    loop = nrdob.NRDOB(lag, lag, 1.0, FILTER)
    for fraction in (loop.fractions.G, loop.fractions.Gm):
        assert fraction.num.tolist() == [2.0] and fraction.den.tolist() == [1.0, 1.0]


@pytest.mark.parametrize("number", [2, 2.0, np.float32(2), np.array(2.0), 2 + 0j, sympy.Integer(2)])
def test_every_way_to_write_a_gain_is_the_same_gain(number):
    loop = nrdob.NRDOB(PLANT, PLANT, number, FILTER)
    assert loop.fractions.C.num.tolist() == [2.0]
    assert (nrdob.delay(1) * number).dcgain() == 2.0


@pytest.mark.parametrize("seconds", ["1", b"1", True, np.True_, 1j, None, [1.0], np.array([1, 2])])
def test_seconds_are_one_real_number(seconds):
    for what in (nrdob.delay, lambda value: LowPassFilter(value, 1)):
        with pytest.raises(TypeError, match="number of seconds"):
            what(seconds)


@pytest.mark.parametrize("unit", [1e-12, 1e-9, 1e9, 1e12])
def test_units_of_time_and_gain_do_not_change_the_verdict(unit):
    G = ct.tf([1.2 / unit], [2 * unit**2, 3 * unit, 1])
    Gm = ct.tf([1 / unit], [unit**2, 2 * unit, 1])
    C = ct.tf([0.1 * unit * unit, 0.1 * unit], [unit, 0])
    assert nrdob.NRDOB(G, Gm, C, LowPassFilter(unit, 2)).stability().stable is True
