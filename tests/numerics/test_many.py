"""Many polynomials at once: what is said is certain, and the same as is said of one."""

import math

import numpy as np
import pytest

from nrdob.numerics import (
    ROUNDING,
    ManyTerms,
    QuasiPolynomial,
    Term,
    convolved,
    count_rhp,
    follow_together,
    hurwitz,
    padded_sum,
    rhp_counts,
    values_and_slopes,
    values_on_axis,
)


def _from_roots(rng, degree, count):
    """Polynomials with a pair near the axis, and how many of their roots are on the right."""
    roots = -(10 ** rng.uniform(-1, 1, (count, degree))).astype(complex)
    angle = rng.uniform(1.3, 1.85, count)
    roots[:, 0] = 10 ** rng.uniform(-1, 1, count) * np.exp(1j * angle)
    roots[:, 1] = roots[:, 0].conj()
    p = np.array([np.real(np.poly(each)) for each in roots]).T
    return p, (roots.real > 0).sum(axis=1)


@pytest.mark.parametrize("degree", [2, 3, 5, 8])
def test_routh_and_the_turns_count_the_roots_that_polynomials_were_made_of(degree):
    p, right = _from_roots(np.random.default_rng(degree), degree, 400)
    left, not_left = hurwitz(p, ROUNDING * np.abs(p))
    assert np.array_equal(left, right == 0) and np.array_equal(not_left, right > 0)
    counts = rhp_counts([ManyTerms(p, np.zeros(1))], np.abs(p))
    assert np.array_equal(counts, right)


@pytest.mark.slow
def test_polynomials_of_all_degrees_and_time_scales_turn_together_as_they_do_alone():
    rng = np.random.default_rng(0)
    for _ in range(20):
        made = []
        for degree in rng.integers(3, 12, 6):
            p, right = _from_roots(rng, degree, 1)
            unit = (10.0 ** rng.uniform(-4, 4)) ** np.arange(degree + 1)
            made.append((p[:, 0] * unit * 10.0 ** rng.uniform(-5, 5), right[0]))
        # One with a root on the axis, one behind a root at s = 0, and one with a dead time.
        beside = [
            QuasiPolynomial(np.poly([2j, -2j, -1]).real),
            QuasiPolynomial([1.0, 2.0, 2.5, 3.0, 0.0]),
            QuasiPolynomial([1.0, 2.0, 2.0, 1.0], [0.3], 1.0),
        ]
        together = [QuasiPolynomial(p) for p, _ in made] + beside
        follow_together(together)
        found = [p.finite_part for p in together if "argument_change" in vars(p.finite_part)]
        assert found == [p.finite_part for p in (*together[:6], together[7])]
        for p in found:
            alone = QuasiPolynomial(p.q).argument_change.angle
            assert p.argument_change.angle == pytest.approx(alone, abs=1e-9)
        for p, (_, right) in zip(together, made, strict=False):
            assert count_rhp(p).count == right
        assert count_rhp(together[6]).count is None and count_rhp(together[8]).count == 0


@pytest.mark.parametrize("dead_times", [1, 2])
def test_retarded_and_neutral_equations_of_all_degrees_turn_together_as_they_do_alone(dead_times):
    rng = np.random.default_rng(dead_times)
    together = []
    for degree in rng.integers(1, 9, 40):
        q = np.poly(-(10 ** rng.uniform(-1, 1, degree)))
        sizes = rng.integers(1, degree + 2, dead_times)
        late = [0.4 * q[-size:] * rng.uniform(-1, 1, size) for size in sizes]
        delays = 10 ** rng.uniform(-2, 1, dead_times)
        together.append(QuasiPolynomial(q, more=tuple(map(Term, late, delays.tolist()))))
    assert any(p.neutral_ratio for p in together)
    follow_together(together)
    assert all("argument_change" in vars(p) for p in together)
    for p in together:
        alone = QuasiPolynomial(p.q, more=p.delayed).argument_change.angle
        assert p.argument_change.angle == pytest.approx(alone, abs=1e-9)


def test_a_chain_of_unstable_roots_is_not_followed_beside_an_equation_of_higher_degree():
    chain = QuasiPolynomial([1.0, 1.0], [2.0, 1.0], 1.0)
    retarded = QuasiPolynomial([1.0, 3.0, 3.0, 1.0], [0.1], 1.0)
    follow_together([chain, retarded])
    assert "argument_change" in vars(retarded) and "argument_change" not in vars(chain)


def test_a_root_on_the_axis_within_rounding_is_left_open():
    # (s² + 4)(s + 1), once exact and once moved by less than rounding.
    p = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-15], [4.0, 4.0], [4.0, 4.0]])
    left, right = hurwitz(p, ROUNDING * np.abs(p))
    assert not left.any() and not right.any()
    assert rhp_counts([ManyTerms(p, np.zeros(1))], np.abs(p)).tolist() == [-1, -1]


def test_a_leading_or_constant_coefficient_of_rounding_is_left_open():
    p = np.array([[1e-16, 1.0], [1.0, 2.0], [1.0, 1e-16]])
    scale = np.ones_like(p)
    left, right = hurwitz(p, ROUNDING * scale)
    assert not left.any() and not right.any()
    assert rhp_counts([ManyTerms(p, np.zeros(1))], scale).tolist() == [-1, -1]


def test_a_definite_negative_coefficient_is_a_root_on_the_right_whatever_else_is_uncertain():
    left, right = hurwitz(np.array([[1.0], [0.0], [-1.0]]), np.full((3, 1), 1e-9))
    assert right.all() and not left.any()


def test_no_number_is_no_verdict():
    p = np.array([[1.0, 1.0], [np.nan, np.inf], [1.0, 1.0]])
    left, right = hurwitz(p, ROUNDING * np.abs(p))
    assert not left.any() and not right.any()


@pytest.mark.parametrize("side", [-1, 1])
def test_a_lag_that_waits_is_lost_at_its_hayes_border(side):
    # s + k exp(-s θ): stable for k θ < π/2.
    delay = np.geomspace(1e-3, 1e3, 40)
    gain = math.pi / 2 / delay * (1 + side * 1e-6)
    q, r = np.array([np.ones(40), np.zeros(40)]), gain[None, :]
    counts = rhp_counts(
        [ManyTerms(q, np.zeros(1)), ManyTerms(r, delay)], np.array([np.ones(40), gain])
    )
    assert np.array_equal(counts, np.full(40, 0 if side < 0 else 2))


def test_counts_with_one_and_two_dead_times_are_those_of_each_alone():
    rng = np.random.default_rng(5)
    count = 60
    q, _ = _from_roots(rng, 4, count)
    r, more = 3 * rng.standard_normal((3, count)), rng.standard_normal((2, count))
    delay, longer = 10 ** rng.uniform(-2, 1, count), np.full(1, 0.7)
    scale = padded_sum(*map(np.abs, (q, r, more)))
    terms = [ManyTerms(q, np.zeros(1)), ManyTerms(r, delay), ManyTerms(more, longer)]
    for kept in (2, 3):
        counts = rhp_counts(terms[:kept], scale)
        for k in range(0, count, 3):
            few = [(term.q[:, k], float(term.delay[k % term.delay.size])) for term in terms[1:kept]]
            p = QuasiPolynomial(q[:, k], scale=scale[:, k], more=tuple(Term(*each) for each in few))
            assert counts[k] == count_rhp(p).count


def test_values_products_and_slopes_are_those_of_numpy():
    rng = np.random.default_rng(1)
    p, q = rng.standard_normal((4, 3)), rng.standard_normal((3, 3))
    omega = np.array([0.3, 2.0, 11.0])
    product = convolved(p, q)
    value, slope = values_and_slopes(product, omega)
    for k in range(3):
        expected = np.convolve(p[:, k], q[:, k])
        assert product[:, k] == pytest.approx(expected)
        assert value[k] == pytest.approx(np.polyval(expected, 1j * omega[k]))
        assert slope[k] == pytest.approx(np.polyval(np.polyder(expected), 1j * omega[k]))
    assert values_on_axis(product, omega) == pytest.approx(value)
