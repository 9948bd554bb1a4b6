"""Turns of a curve and roots on the right, on a dense grid: an oracle without certificates."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def turned(values: np.ndarray) -> float:
    """Angle in radians by which a curve turns around 0 from its first value to its last."""
    return float(np.angle(values[1:] / values[:-1]).sum())


def roots_on_the_right(values: np.ndarray, lead: float, degree: int) -> float:
    """Roots of a function from its values on jω, ω from about 0 up; it ends as lead·s^degree."""
    return degree / 2 - (turned(values) + np.angle(lead * 1j**degree / values[-1])) / np.pi


def values_on_axis(function: Callable, omega: np.ndarray, step: float = 0.3) -> np.ndarray:
    """Values on a grid that is refined until none turns far from its neighbours."""
    for _ in range(60):
        values = function(omega)
        coarse = np.flatnonzero(np.abs(np.angle(values[1:] / values[:-1])) > step)
        if not coarse.size:
            break
        omega = np.insert(omega, coarse + 1, (omega[coarse] + omega[coarse + 1]) / 2)
    return values
