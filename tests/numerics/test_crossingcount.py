from math import floor, pi

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from nrdob.numerics import QuasiPolynomial, Term, count_rhp
from nrdob.numerics.crossingcount import count_by_crossings, crossings_between
from strategies import root_sets


@pytest.mark.parametrize("delay", 10.0 ** np.arange(-3, 10))
def test_an_integrator_gains_a_pair_at_every_turn(delay):
    count = 2 * floor((delay - pi / 2) / (2 * pi)) + 2
    assert count_by_crossings(np.array([1.0, 0.0]), np.array([1.0]), delay) == count


@pytest.mark.slow
@given(
    st.integers(1, 6).flatmap(lambda n: root_sets(n)),
    st.integers(0, 5).flatmap(lambda n: root_sets(n)),
    st.floats(-1, 1),
    st.floats(-4, 5),
)
def test_it_agrees_with_the_argument_which_shares_nothing_with_it(zq, zr, log_gain, log_delay):
    assume(zr.size <= zq.size)
    q, r = np.real(np.poly(zq)), np.atleast_1d(np.real(np.poly(zr)))
    size = abs(q[-1] / r[-1]) if zr.size < zq.size else min(0.09, abs(q[-1] / r[-1]))
    p = QuasiPolynomial(q, 10**log_gain * size * r, 10**log_delay)
    found = count_rhp(p).count
    assume(found is not None)
    assert p.rhp_in_whole_numbers == found


@pytest.mark.parametrize("delay", [0.1, 1.0, 1.9, 30.0, 1e4])
def test_a_pair_that_starts_on_the_axis_crosses_from_there(delay):
    # s² + 1/2 + exp(-sT)/2 has ±j for T = 0; the pair moves to the right, or to the left.
    for share in (0.5, -0.5):
        p = QuasiPolynomial([1.0, 0.0, 1 - share], [share], delay)
        found = count_rhp(p)
        assert found.count is not None
        assert p.rhp_in_whole_numbers == found.count


@pytest.mark.slow
@given(st.floats(0.05, 0.99), st.floats(-2, 3))
@settings(max_examples=50)
def test_neutral_equations_below_the_limit_are_counted(ratio, log_delay):
    p = QuasiPolynomial([1.0, 0.3, 0.5], [ratio, 0.2, 0.7], 10**log_delay)
    assert p.rhp_in_whole_numbers == count_rhp(p).count


@pytest.mark.parametrize(("start", "end"), [(1.0, 10.0), (10.0, 1.0), (0.3, 0.31), (2.0, 30.0)])
def test_what_crosses_while_a_dead_time_changes_is_the_difference_of_the_counts(start, end):
    q, r, moving = np.array([1.0, 1.0, 2.0]), np.array([1.5, 0.3]), np.array([-0.8, 4.0])
    counts = [
        count_rhp(QuasiPolynomial(q, r, 0.7, more=(Term(moving, delay),))).count
        for delay in (start, end)
    ]
    assert crossings_between(q, (r, 0.7), moving, start, end) == counts[1] - counts[0]


def test_nothing_crosses_where_the_moving_term_is_the_smallest():
    q, r, moving = np.array([1.0, 4.0]), np.array([1.0]), np.array([1.0])
    assert crossings_between(q, (r, 3.0), moving, 0.1, 1e6) == 0


@pytest.mark.slow
@given(
    st.integers(1, 4).flatmap(lambda n: root_sets(n)),
    st.integers(0, 3).flatmap(lambda n: root_sets(n)),
    st.floats(-1, 1),
    st.floats(-3, 3),
)
@settings(max_examples=60)
def test_a_root_that_stays_at_zero_is_not_counted(zq, zr, log_share, log_delay):
    assume(zr.size < zq.size)
    q, r = np.real(np.poly(zq)), np.atleast_1d(np.real(np.poly(zr)))
    r = r * 10**log_share
    r[-1] = -q[-1]
    p = QuasiPolynomial(q, r, 10**log_delay)
    assert p.zeros_at_origin
    found = count_rhp(p).count
    assume(found is not None)
    assert p.rhp_in_whole_numbers == found


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_root_that_stays_at_the_origin_is_not_counted_but_the_real_one_that_passes_it_is(scale):
    # p_B over s of an integrating model that waits for another time than the process.
    rng = np.random.default_rng(3)
    for _ in range(25):
        theta, wait, lag = scale * 10 ** rng.uniform([-1, -1, -2], [1, 1, 0])
        pole, gain = rng.choice([-1, 1, 1]) * 10 ** rng.uniform(-2, 0.5) / scale, 0.9 / scale
        q = np.convolve([1.0, pole], [lag**2, 2 * lag, 1.0])
        terms = Term(np.array([gain, 0.0]), theta), Term(-np.array([1.0, pole]), wait)
        p = QuasiPolynomial(q, more=terms).over_s(1)
        found = count_rhp(p).count
        assert found is not None
        assert p.rhp_in_whole_numbers == found


@pytest.mark.parametrize("zeros", [1, 2, 3])
def test_zeros_at_the_origin_of_every_term_cross_nowhere(zeros):
    origin = np.append(1.0, np.zeros(zeros))
    q, r = np.convolve([1.0, 1.0], origin), 4 * origin
    alone = crossings_between(np.array([1.0, 1.0]), (np.array([-4.0]), 1.0), np.array([4.0]), 1, 10)
    assert crossings_between(q, (-r, 1.0), r, 1.0, 10.0) == alone == 10


def test_beside_a_root_that_stays_at_zero_a_crossing_by_rounding_is_none_at_dead_time_zero():
    # |F| of Butterworth is flat: it is 1 once more, by rounding, at 1e-8 of the bandwidth.
    den, num = np.array([5.659121834898622e-11, 1.063872345246235e-05, 1.0]), np.array([-1.0])
    assert count_by_crossings(den, num, 1e-9) == 0
