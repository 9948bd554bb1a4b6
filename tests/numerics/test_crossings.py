"""Zeros of many functions at once."""

from __future__ import annotations

import numpy as np
import pytest

from nrdob.numerics import halley


@pytest.mark.parametrize("start", [-1.0, 0.0, 0.1, 7.0, 10.0])
def test_halleys_steps_stay_in_the_bracket(start):
    # At 0 the slope of x² - c is zero; from there, and from 0.1, a step would leave.
    c = np.array([1e-4, 0.25, 2.0, 49.0])
    within = np.full(4, 1e-14)
    found = halley(lambda x: x**2 - c, np.zeros(4), np.full(4, 10.0), np.full(4, start), within)
    assert found == pytest.approx(np.sqrt(c), rel=1e-12)


def test_steps_that_do_not_shrink_are_halved():
    # Halley's steps for the cube root are as long from one to the next, and turn back.
    low, high, start, within = (np.array([value]) for value in (-1.0, 1.0, 0.9, 1e-12))
    found = halley(lambda x: np.cbrt(x - 0.3), low, high, start, within)
    assert found == pytest.approx([0.3], abs=1e-8)
