"""Roots of polynomials whose time scales lie far apart, against those they were made of."""

import numpy as np
import pytest

from nrdob.numerics import roots_by_time_scale, split

UNITS = (1e-140, 1e-9, 1.0, 1e9, 1e140)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("size", [-1e5, 1.0, 3e-8])
def test_two_roots_are_found_in_any_unit_of_time(unit, size):
    pairs = [(-1.0, -1e12), (-1.0, 2.0), (3.0, -3.0), (-1 + 2j, -1 - 2j), (1j, -1j)]
    pairs += [(-1e-9 + 1j, -1e-9 - 1j), (1e-12, 1.0), (-0.5, -0.5)]
    for pair in pairs:
        rtol = 1e-7 if pair[0] == pair[1] else 1e-14  # half of the digits of a double root
        wanted = np.array(pair) * unit
        a, b, c = np.real(np.poly(pair)) * size
        found = roots_by_time_scale(np.array([a, b * unit, c * unit * unit]))
        assert found.dtype == complex
        found, wanted = np.sort_complex(found), np.sort_complex(wanted)
        assert np.allclose(found, wanted, rtol=rtol, atol=0)


@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1.0, 1e6, 1e9])
def test_roots_of_any_degree_are_accurate_within_their_time_scale(unit):
    """Moduli of 1e-6 to 1e6; a wide companion matrix would lose the slow ones altogether."""
    rng = np.random.default_rng(3)
    for degree in range(2, 8):
        wanted = -(10.0 ** np.sort(rng.uniform(-6, 6, degree)))[::-1] * unit
        found = np.sort(roots_by_time_scale(np.poly(wanted)).real)
        assert np.allclose(found, wanted, rtol=1e-9, atol=0)


@pytest.mark.filterwarnings("error")
def test_a_double_integrator_typed_with_rounding_is_realised_without_a_warning():
    slow, fast = split([np.ones(1)], np.array([1.0, 1.0, 1e-25, 1e-50]), horizon=1e3)
    assert np.allclose(fast.A, -1.0)
    assert np.allclose([slow.C @ slow.B, slow.C @ slow.A @ slow.B], [[-1.0], [1.0]])
