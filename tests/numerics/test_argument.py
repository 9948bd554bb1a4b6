from itertools import pairwise
from math import floor, pi

import numpy as np
import pytest

from densegrid import turned
from nrdob.numerics import QuasiPolynomial, count_rhp
from nrdob.numerics.argument import Term, argument_change, zero_free_frequencies


@pytest.mark.parametrize("delay", 10.0 ** np.arange(-3, 10))
@pytest.mark.parametrize("gain", [0.1, 1.0, 7.0])
def test_an_integrator_with_any_dead_time_has_a_pair_on_the_right_for_every_turn(delay, gain):
    # s + K exp(-sT): a pair crosses at ω = K for KT = π/2 + 2πm.
    count = 2 * floor((gain * delay - pi / 2) / (2 * pi)) + 2
    assert count_rhp(QuasiPolynomial([1.0, 0.0], [gain], delay)).count == count


@pytest.mark.parametrize("delay", [1e2, 1e4, 1e6, 1e8])
def test_a_dead_time_costs_steps_with_its_logarithm_only(delay, monkeypatch):
    import nrdob.numerics.argument

    p = QuasiPolynomial(np.poly([-1, -2, -3.0]), [40.0], delay)
    monkeypatch.setattr(nrdob.numerics.argument, "MAX_STEPS", 300 + 60 * int(np.log10(delay)))
    assert count_rhp(p).count == pytest.approx(2 * delay * 2.7 / (2 * pi), rel=0.2)


@pytest.mark.parametrize("damping", [1e-2, 1e-5, 1e-9])
def test_a_resonance_of_any_sharpness_is_seen_behind_a_long_dead_time(damping):
    # Where |q| < 1/2 near ω = 1 the delayed term rules: 2 sqrt(...) wide, T times that turns.
    p = QuasiPolynomial([1.0, 2 * damping, 1.0], [0.5], 1e4)
    edges = np.sqrt([0.5, 1.5])
    assert count_rhp(p).count == pytest.approx(1e4 * np.diff(edges)[0] / pi, abs=4)


@pytest.mark.parametrize("multiplicity", [1, 2, 3])
@pytest.mark.parametrize("right", [0, 2])
def test_zeros_on_the_axis_are_passed_on_their_right(multiplicity, right):
    roots = [3j, -3j] * multiplicity + [-1.0, -20.0] + [0.5 + 1j, 0.5 - 1j][:right]
    q = np.real(np.poly(roots))
    found = argument_change([Term(q, 0.0)], np.abs(q))
    assert found.angle == pytest.approx((len(roots) - 2 * right) * pi / 2, abs=1e-2)
    assert found.touched == pytest.approx([3.0], rel=1e-3)


def test_a_root_at_zero_within_rounding_is_passed_on_its_right():
    p = QuasiPolynomial([1.0, -2.0, 1.0 + 2e-15], [-1.0], 0.1)  # p(0) = 1 - 1 within rounding
    found = count_rhp(p)
    assert found.count is None and found.at_least == 1
    assert "s = 0" in found.reason


def test_two_close_zeros_on_the_axis_are_both_passed():
    q = np.real(np.poly([1j, -1j, 1.001j, -1.001j, -2]))
    found = argument_change([Term(q, 0.0)], np.abs(q))
    assert found.angle == pytest.approx(5 * pi / 2, abs=1e-2)


@pytest.mark.thorough
def test_a_sum_of_three_terms_is_followed_term_by_term():
    # (s + 2)(s + 3 + exp(-s)) + exp(-7 s): small enough to change no count, T = 0, 1 and 7.
    terms = [
        Term(np.array([1.0, 5.0, 6.0]), 0.0),
        Term(np.array([1.0, 2.0]), 1.0),
        Term(np.array([1.0]), 7.0),
    ]
    assert argument_change(terms, np.array([1.0, 6.0, 9.0])).angle == pytest.approx(pi)
    loud = [*terms[:2], Term(np.array([50.0]), 70.0)]
    angle = argument_change(loud, np.array([1.0, 6.0, 58.0])).angle
    omega = np.linspace(0, 500, 2_000_001)
    values = sum(np.polyval(q, 1j * omega) * np.exp(-1j * T * omega) for q, T in loud)
    brute = turned(values) + np.angle(-1 / values[-1])
    assert angle == pytest.approx(brute, abs=1e-6)


def test_between_the_frequencies_nothing_turns_by_half_a_revolution():
    p = QuasiPolynomial([1.0, 0.02, 1.0], [0.5], 40.0)
    omega = zero_free_frequencies(p.terms, p.scale)
    for low, high in pairwise(omega):
        values = p(1j * np.linspace(low, high, 50))
        assert np.ptp(np.unwrap(np.angle(values))) < pi


def test_where_the_turns_are_too_many_a_dominant_term_is_enough():
    p = QuasiPolynomial([1e-6, 1.0, 0.0], [1.0], delay=1e9)
    omega = zero_free_frequencies(p.terms, p.scale)
    assert omega.size < 2000
    assert np.min(np.abs(omega - 1.0)) < 1e-9  # where the terms are of equal size it is as dense


def test_of_three_terms_one_that_is_larger_than_both_others_together_is_enough():
    # 1.2 > 1 + 0.1, but 1.2² < 2 (1² + 0.1²): the sizes must be compared, not their squares.
    more = [Term(np.array([0.1, 0.1]), 1e8 * pi)]
    p = QuasiPolynomial([1.2, 1.2], [1.0, 1.0], delay=1e9, more=more)
    assert count_rhp(p).count == 0
