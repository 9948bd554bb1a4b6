from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from nrdob.numerics.exact import (
    positive_sign_changes,
    rhp_count,
    sign_at,
    squared_size,
    total,
    whole,
)
from strategies import root_sets


def value(p, x):
    return sum(c * x ** (len(p) - 1 - k) for k, c in enumerate(p))


@given(st.integers(1, 12).flatmap(lambda n: root_sets(n)))
def test_the_test_of_routh_and_hurwitz_counts_the_roots_a_polynomial_was_made_of(roots):
    coefficients = np.real(np.poly(roots))
    assume(np.abs(roots.real / np.abs(roots)).min() >= 1e-3)  # the coefficients have been rounded
    assert rhp_count(whole(coefficients)[0]) == np.sum(roots.real > 0)


def test_roots_twenty_two_decades_apart_are_counted_without_rounding():
    roots = 10.0 ** np.arange(-11, 12, 2) * np.resize([-1, 1, -1], 12)
    p = [1]
    for root in roots:  # the product of whole numbers, not of floats
        num, den = float(root).as_integer_ratio()
        p = total([den * c for c in p] + [0], [-num * c for c in p])
    assert rhp_count(p) == np.sum(roots > 0)


@pytest.mark.parametrize(
    ("p", "count"),
    [
        ([1, 0, -1], 1),
        ([1, 0, 0, 0, 1], 2),  # a quadruple that mirrors itself in both axes
        ([1, 0, 1], None),
        ([1, 1, 4, 4], None),
        ([1, 0, 2, 0, 1], None),
        ([1, -1, 0], None),
        ([1, 1, -1, -1], 1),
        ([-3], 0),
    ],
)
def test_roots_that_come_with_their_mirror_image_are_told_from_those_on_the_axis(p, count):
    assert rhp_count(p) == count


def test_the_squared_size_on_the_axis_is_a_polynomial_in_the_squared_frequency():
    p = [2, -3, 5, 7]
    for omega in (Fraction(1, 3), Fraction(7, 2)):
        real, imaginary = -3 * -(omega**2) + 7, 2 * -(omega**3) + 5 * omega
        assert value(squared_size(p), omega**2) == real**2 + imaginary**2


@given(st.lists(st.floats(-8, 8), min_size=1, max_size=7, unique=True))
@settings(max_examples=60)
def test_sign_changes_are_found_to_the_last_bits_of_the_roots(decades):
    roots = np.sort(10.0 ** np.array(decades))
    assume(np.all(np.diff(roots) >= 1e-12 * roots[1:]))
    p = [1]
    for root in roots:
        num, den = float(root).as_integer_ratio()
        p = total([den * c for c in p] + [0], [-num * c for c in p])
    found = positive_sign_changes(p)
    assert [x for x, _ in found] == pytest.approx(roots, rel=4e-16)
    assert [side for _, side in found][::-1] == [(-1) ** k for k in range(len(roots))]


def test_roots_at_which_the_sign_stays_are_left_out():
    assert positive_sign_changes([1, -2, 1]) == []  # (x - 1)²
    assert positive_sign_changes([1, -3, 3, -1]) == [(1.0, 1)]  # (x - 1)³
    assert positive_sign_changes([1, 1]) == positive_sign_changes([5]) == []


def test_signs_are_those_of_exact_arithmetic():
    p = whole(np.poly([1 / 3, 1 / 3 + 1e-9]))[0]
    for x in (1 / 3, 1 / 3 + 1e-12, 1 / 3 + 5e-10, 1e300, 1e-300):
        exact = value(p, Fraction(x))
        assert sign_at(p, x) == (exact > 0) - (exact < 0)
