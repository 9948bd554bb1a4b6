"""Roots of polynomials whose time scales lie far apart, against those they were made of."""

import numpy as np
import pytest

from nrdob.numerics import roots_by_time_scale

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


def test_roots_of_any_degree_are_accurate_within_their_time_scale():
    """Moduli of 1e-6 to 1e6; a wide companion matrix would lose the slow ones altogether."""
    rng = np.random.default_rng(3)
    for degree in range(2, 8):
        wanted = -(10.0 ** np.sort(rng.uniform(-6, 6, degree)))[::-1]
        found = np.sort(roots_by_time_scale(np.poly(wanted)).real)
        assert np.allclose(found, wanted, rtol=1e-9)
