"""Zeros of many functions at once."""

from __future__ import annotations

import numpy as np
import pytest

from nrdob.numerics import newton


@pytest.mark.parametrize("start", [-1.0, 0.0, 0.1, 7.0, 10.0])
def test_newtons_steps_stay_in_the_bracket(start):
    # At 0 the slope of x² - c is zero; from there, and from 0.1, a step would leave.
    c = np.array([1e-4, 0.25, 2.0, 49.0])

    def function(x):
        return x**2 - c, 2 * x

    found = newton(function, np.zeros(4), np.full(4, 10.0), np.full(4, start), 1e-9)
    assert found == pytest.approx(np.sqrt(c), rel=1e-12)


def test_steps_that_do_not_shrink_are_halved():
    # Newton's steps for the cube root are twice as long from one to the next.
    def function(x):
        size = np.abs(x - 0.3)
        return np.sign(x - 0.3) * size ** (1 / 3), size ** (-2 / 3) / 3

    found = newton(function, np.array([-1.0]), np.array([1.0]), np.array([0.9]), 1e-9)
    assert found == pytest.approx([0.3], abs=1e-8)
