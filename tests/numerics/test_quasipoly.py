import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.special import lambertw

from densegrid import roots_on_the_right
from nrdob.numerics import QuasiPolynomial, Term, count_rhp, exponential_rest, multiply
from strategies import root_sets


def dense_argument_count(p, top, points=200_001):
    """RHP roots from the unwrapped argument on a brute-force frequency grid."""
    omega = np.union1d(np.geomspace(1e-6 * top, top, points), np.linspace(0, top, points))
    return round(roots_on_the_right(p(1j * omega), p.q[0], p.degree))


def distance_from_axis(roots):
    """Smallest value on the axis beside the roots of a polynomial, against its terms'."""
    omega = np.abs(roots.imag)
    sizes = np.polyval(np.abs(np.poly(roots)), omega)
    return np.min(np.abs(np.prod(1j * omega[:, None] - roots, axis=1)) / sizes)


@pytest.mark.slow
@given(st.integers(1, 10).flatmap(lambda n: root_sets(n)))
def test_count_and_roots_agree_with_the_roots_a_polynomial_was_made_of(roots):
    assume(distance_from_axis(roots) > 1e-12)  # else the coefficients' rounding decides
    p = QuasiPolynomial(np.real(np.poly(roots)))
    assert count_rhp(p).count == np.sum(roots.real > 0) == np.sum(p.roots.real > 0)


@pytest.mark.parametrize("spread", [1e-6, 1e6])
def test_roots_of_very_different_size_are_counted(spread):
    p = QuasiPolynomial(np.real(np.poly([1.0, -2.0, spread, -3 * spread, 0.5 * spread**2])))
    assert count_rhp(p).count == 3
    assert np.sum(p.roots.real > 0) == 3


@pytest.mark.parametrize("damping", [1e-3, 1e-6, 1e-9])
def test_a_resonance_of_any_sharpness_is_seen(damping):
    for sign, count in ((1, 0), (-1, 2)):
        p = QuasiPolynomial(np.polymul([1, 2 * sign * damping, 1], [1, 5, 6]))
        assert count_rhp(p).count == count == np.sum(p.roots.real > 0)


@pytest.mark.parametrize("multiplicity", [1, 2, 3])
def test_roots_on_the_axis_are_reported_with_their_frequency_not_counted(multiplicity):
    p = QuasiPolynomial(np.poly([2j, -2j] * multiplicity + [-1]).real)
    result = count_rhp(p)
    assert result.count is None
    assert "near 2" in result.reason or "near 1.99" in result.reason


@pytest.mark.parametrize("multiplicity", [1, 2, 5])
def test_exact_roots_at_the_origin_are_known_and_divided_out(multiplicity):
    p = QuasiPolynomial([1.0, -1.0] + [0.0] * multiplicity)
    assert p.zeros_at_origin == multiplicity
    assert count_rhp(p).count == 1


@pytest.mark.parametrize("gain", [0.5, 1.5, math.pi / 2 - 1e-6])
def test_integrator_with_delay_is_stable_below_half_pi(gain):
    p = QuasiPolynomial([1.0, 0.0], [gain], delay=1.0)
    assert count_rhp(p).count == 0
    assert p.roots[0].real < 0


JUST_LOST = math.pi / 2 + 1e-6


@pytest.mark.parametrize(("gain", "count"), [(JUST_LOST, 2), (8.0, 4), (50.0, 16), (-1, 1)])
def test_integrator_with_delay_gains_a_pair_at_every_turn(gain, count):
    p = QuasiPolynomial([1.0, 0.0], [gain], delay=1.0)
    assert count_rhp(p).count == count == np.sum(p.roots.real > 0)


def test_rightmost_root_is_the_lambert_w_function():
    p = QuasiPolynomial([1.0, 0.0], [1.2], delay=0.7)
    assert p.roots[0] == pytest.approx(lambertw(-1.2 * 0.7) / 0.7, rel=1e-12) or p.roots[
        0
    ] == pytest.approx(np.conj(lambertw(-1.2 * 0.7) / 0.7), rel=1e-12)


@pytest.mark.thorough
@given(
    st.integers(1, 5).flatmap(lambda n: root_sets(n)),
    st.integers(0, 4).flatmap(lambda n: root_sets(n)),
    st.floats(-1, 1),
    st.floats(-2, 0.3),
)
@settings(max_examples=60)
def test_delayed_counts_agree_with_roots_and_with_a_dense_grid(zq, zr, log_gain, log_delay):
    assume(zr.size < zq.size)
    q, r = np.real(np.poly(zq)), np.atleast_1d(np.real(np.poly(zr)))
    r = 10**log_gain * r * abs(q[-1] / r[-1])
    p = QuasiPolynomial(q, r, 10**log_delay)
    count = count_rhp(p)
    assume(count.count is not None)
    if not p.roots_resolved:  # not all of them are known
        assert (count.count > 0) == (p.roots[0].real > 0)
        return
    assert count.count == np.sum(p.roots.real > 0)
    top = 3 * (1 + np.abs(q[1:] / q[0]).max() + np.abs(r / q[0]).max())
    if top < 2e4 and min(abs(p.roots.real) / (1e-9 + abs(p.roots))) > 1e-3:
        assert count.count == dense_argument_count(p, top)


@pytest.mark.parametrize("ratio", [0.3, -0.9])
def test_neutral_equations_below_the_limit_are_counted(ratio):
    stable = QuasiPolynomial([1.0, 2.0], [ratio, 0.1], delay=1.0)
    assert stable.neutral_ratio == pytest.approx(abs(ratio))
    assert count_rhp(stable).count == 0
    assert stable.roots[0].real < 0


def test_neutral_equation_beyond_the_limit_has_infinitely_many_rhp_roots():
    assert count_rhp(QuasiPolynomial([1.0, 2.0], [1.1, 0.1], delay=1.0)).count == math.inf
    assert count_rhp(QuasiPolynomial([1.0], [1.0, 1.0], delay=1.0)).count == math.inf


def test_neutral_equation_at_the_limit_is_not_judged():
    result = count_rhp(QuasiPolynomial([1.0, 2.0], [-1.0, 0.1], delay=1.0))
    assert result.count is None
    assert "neutral" in result.reason


def test_cancelled_leading_coefficients_are_dropped_not_kept_as_rounding():
    a, b = np.array([0.1, 0.2, 0.3]), np.array([-0.3, 0.1, 1.0])
    p = QuasiPolynomial(3 * a, b, scale=3 * abs(a) + abs(b))
    assert p.degree == 1


def test_product_of_factors_has_the_product_of_values():
    a = QuasiPolynomial([1.0, 2.0], [3.0], delay=0.5)
    b = QuasiPolynomial([2.0, 0.0, 1.0])
    c = QuasiPolynomial([0.0], [1.0, -1.0], delay=0.2)
    s = np.array([0.2 + 1j, -0.5j])
    for factors in ((a, b), (a, a), (a, b, c)):
        values = np.prod([factor(s) for factor in factors], axis=0)
        assert multiply(*factors)(s) == pytest.approx(values, rel=1e-14)
    assert [term.delay for term in multiply(a, c).terms] == [0.0, 0.7, 0.2]


def test_a_delay_too_long_for_eigenvalues_leaves_the_rightmost_root():
    p = QuasiPolynomial([1e-6, 1.0, 0.0], [1.0], delay=1e4)
    assert not p.roots_resolved
    assert abs(p(p.roots[:6])).max() < 1e-9
    # (1e-6 s² + s) exp(1e4 s) = -1, and the first term hardly counts.
    expected = lambertw(-1e4) / 1e4
    assert p.roots[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("unit", [1e-30, 1e-9, 1e9, 1e30])
def test_counts_and_roots_do_not_hang_on_units(unit):
    q, r, delay = np.array([1.0, 0.3, 1.2, 0.0]), np.array([0.5, 0.7]), 3.0
    plain = QuasiPolynomial(q, r, delay)
    scaled = QuasiPolynomial(unit * q, unit * r, delay)
    slower = QuasiPolynomial(
        q * unit ** np.arange(3, -1, -1), r * unit ** np.arange(1, -1, -1), delay * unit
    )
    for p, time in ((scaled, 1.0), (slower, unit)):
        assert count_rhp(p).count == p.rhp_in_whole_numbers == count_rhp(plain).count == 2
        assert p.roots[:2] * time == pytest.approx(plain.roots[:2], rel=1e-9)


@pytest.mark.parametrize("unit", [1e-30, 1e-9, 1e9, 1e18])
@pytest.mark.parametrize(("slope", "count"), [(3.0, 0), (-3.0, 1)])
def test_a_zero_that_the_terms_have_only_together_does_not_hang_on_the_unit(slope, count, unit):
    # s³ + 2s² + slope s - 1 + exp(-s) = s (s² + … + slope - 1)
    powers = unit ** np.arange(3, -1, -1)
    p = QuasiPolynomial(np.array([1.0, 2.0, slope, -1.0]) * powers, [1.0], unit)
    assert count_rhp(p).count == count


@pytest.mark.parametrize("delay", [0.0, 1.0, 1e3])
def test_roots_clearly_on_the_right_are_counted_beside_one_on_the_axis(delay):
    q, r = np.polymul([1.0, -0.6, 1.0], [1.0, 0.0, 4.0]), np.polymul([0.3], [1.0, 0.0, 4.0])
    found = count_rhp(QuasiPolynomial(q, r, delay))
    assert found.count is None and "near 2 rad/s" in found.reason
    assert found.at_least == count_rhp(QuasiPolynomial([1.0, -0.6, 1.0], [0.3], delay)).count > 0


@pytest.mark.thorough
@given(
    st.integers(1, 4).flatmap(lambda n: root_sets(n)),
    st.lists(st.floats(-4, 4), min_size=1, max_size=3),
    st.lists(st.floats(-4, 4), min_size=1, max_size=3),
    st.floats(-2, 0.5),
    st.floats(-2, 0.5),
)
@settings(max_examples=60)
def test_two_delays_are_counted_alike_by_argument_roots_and_crossings(zq, r1, r2, log_1, log_2):
    q = np.real(np.poly(zq))
    assume(max(len(r1), len(r2)) < q.size and any(r1) and any(r2))
    p = QuasiPolynomial(q, r1, 10**log_1, more=(Term(np.array(r2), 10**log_2),))
    found = count_rhp(p).count
    assume(found is not None and not p.near_axis(p.roots).any())
    assert found == dense_argument_count(p, 3e3 * max(1, *np.abs(zq)))
    if p.roots_resolved:
        assert found == np.sum(p.roots.real > 0)
    if (other := p.rhp_in_whole_numbers) is not None:
        assert found == other


def test_terms_with_equal_delays_are_one_and_none_is_kept_that_is_rounding():
    one, two = Term(np.array([1.0]), 0.5), Term(np.array([2.0, 1.0]), 0.5)
    p = QuasiPolynomial([1.0, 0.0, 0.0], [3.0], 0.2, more=(one, two, Term(np.array([7.0]), 0.0)))
    assert [(term.q.tolist(), term.delay) for term in p.terms] == [
        ([1.0, 0.0, 7.0], 0.0), ([2.0, 2.0], 0.5), ([3.0], 0.2),
    ]  # fmt: skip
    gone = QuasiPolynomial([1.0, 1.0], [0.3], 0.5, more=(Term(np.array([-0.1 - 0.2]), 0.5),))
    assert gone.delay == 0 and gone.terms == (gone.terms[0],)


def test_the_three_roots_of_a_sum_with_two_delays_are_found_to_the_last_digit():
    # s + 1 + a exp(-s) + b exp(-s/2) with roots 0.3 and -0.2, by choice of a and b.
    x = np.array([0.3, -0.2])
    a, b = np.linalg.solve(np.exp(-np.outer(x, [1.0, 0.5])), -(x + 1))
    p = QuasiPolynomial([1.0, 1.0], [a], 1.0, more=(Term(np.array([b]), 0.5),))
    real = p.roots[p.roots.imag == 0].real
    assert min(abs(real - 0.3)) < 1e-13 and min(abs(real + 0.2)) < 1e-13


def test_a_zero_that_the_terms_have_only_together_is_divided_out_without_losing_digits():
    # 2s + 1 - exp(-3s) = s (2 + 3 - 9s/2 + …)
    p = QuasiPolynomial([2.0, 1.0], [-1.0], 3.0)
    rest = p.without_origin
    assert p.zeros_at_origin == 1 and rest.zeros_at_origin == 0 and rest.constant == 5
    assert rest(0.0) == 5 and rest(1e-10) == pytest.approx(5 - 4.5e-10, rel=1e-15)
    s = np.array([0.7 - 2j, -0.1, 5j])
    assert rest(s) * s == pytest.approx(p(s), rel=1e-14)
    assert count_rhp(p).count == 0 == rest.rhp_in_whole_numbers
    assert np.min(np.abs(rest.roots)) > 0.1 and p.roots[0] == 0


@pytest.mark.parametrize(("slope", "count"), [(2.9, 1), (3.1, 0)])
def test_the_root_beside_a_zero_that_stays_is_told_from_it(slope, count):
    p = QuasiPolynomial([-slope, 1.0], [-1.0], -0.0 + 3.0)  # (3 - slope) s - 9/2 s² + …
    assert count_rhp(p).count == count == p.rhp_in_whole_numbers == np.sum(p.roots.real > 1e-9)


@pytest.mark.parametrize(("size", "count"), [(1e-15, 0), (-1e-15, 1)])
def test_a_root_far_slower_than_the_dead_time_is_told_from_the_zero_beside_it(size, count):
    p = QuasiPolynomial([1.0, 0.0, size], [-size], 1.0)  # s (s + size - …)
    assert count_rhp(p).count == count


def test_no_term_with_a_third_delay_is_forgotten():
    more = (Term(np.array([1.0]), 2.0), Term(np.array([2.0]), 1.0))
    p = QuasiPolynomial([1.0, 1.0, 1.0], [-0.5], 3.0, more=more)
    assert count_rhp(p).count == 2 == dense_argument_count(p, 1e3)
    assert p.rhp_in_whole_numbers in (None, 2)


def test_sizes_of_several_delayed_leading_terms_add_up():
    def neutral(a, b):
        return QuasiPolynomial([1.0, 2.0], [a, 0.1], 1.0, more=(Term(np.array([b, 0.3]), 0.6),))

    assert neutral(0.5, -0.3).neutral_ratio == pytest.approx(0.8)
    assert count_rhp(neutral(0.5, -0.3)).count == 0
    assert "add up to 1.2" in count_rhp(neutral(0.7, -0.5)).reason
    assert count_rhp(neutral(2.0, -0.5)).count == math.inf


@pytest.mark.parametrize("m", [0, 1, 2, 3])
def test_the_rest_of_an_exponential_keeps_its_digits_near_zero(m):
    z = np.array([1e-12, -3e-5j, 0.2 - 0.9j, -1.0 + 1e-3j, 1.1j, -8 + 30j])
    with mp.workdps(60):
        rest = [
            mp.exp(mp.mpc(x)) - sum(mp.mpc(x) ** k / mp.factorial(k) for k in range(m)) for x in z
        ]
        divided = [complex(value / mp.mpc(x) ** m) for value, x in zip(rest, z, strict=True)]
        rest = [complex(value) for value in rest]
    assert exponential_rest(z, m) == pytest.approx(rest, rel=1e-13)
    assert exponential_rest(z, m, divided=True) == pytest.approx(divided, rel=1e-13)
    assert exponential_rest(np.zeros(1), m, divided=True) == pytest.approx(1 / math.factorial(m))


@pytest.mark.thorough
@pytest.mark.parametrize("lam", [0.1, 0.5, 3.0])
def test_a_double_root_at_zero_is_divided_out_and_the_others_are_counted(lam):
    # (λs + 1)² - ((2λ + 1) s + 1) exp(-s) vanishes twice at s = 0.
    num = np.array([2 * lam + 1, 1.0])
    p = QuasiPolynomial([lam**2, 2 * lam, 1.0], -num, 1.0, origin=2)
    rest = p.without_origin
    assert (p.zeros_at_origin, rest.zeros_at_origin, rest.degree) == (2, 0, 0)
    assert rest.constant == pytest.approx(lam**2 + 2 * lam + 0.5)
    assert rest(1e-9j) == pytest.approx(rest.constant, rel=1e-8)
    omega = np.union1d(np.geomspace(1e-3, 1e4, 9001), np.linspace(1e-3, 300, 9001))
    s = 1j * omega
    values = ((lam * s + 1) ** 2 - np.polyval(num, s) * np.exp(-s)) / s**2
    assert rest(s) == pytest.approx(values, rel=1e-8)
    count = round(roots_on_the_right(values, lam**2, 0))
    assert count_rhp(rest).count == count == count_rhp(p).count
    assert np.sum(rest.roots.real > 0) == count or not rest.roots_resolved
    assert (count > 0) is (lam < 1.0)
