"""Where the plot of H lies, and what every filter 1/(λs + 1)^n makes of it."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

from nrdob.design import stabilizing_time_constants

MODEL = ct.tf([1.0], [1.0, 1.0])
AXIS = 1j * np.geomspace(1e-3, 1e3, 801)
EVERY = [(0.0, np.inf)]


def on_the_right(rng: np.random.Generator) -> ct.TransferFunction:
    """A stable, proper H with Re H >= 0 on the axis: a sum of lags and their complements."""
    s, H = ct.tf("s"), ct.tf([0.0], [1.0])
    for _ in range(int(rng.integers(1, 3))):
        size, pole = 10 ** rng.uniform(-1, 1, 2)
        H = H + size * (s if rng.integers(2) else pole) / (s + pole)
    return H


@pytest.mark.parametrize("seed", range(6))
def test_an_error_smaller_than_one_bears_every_filter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    H = on_the_right(rng) - on_the_right(rng)
    H = 0.98 * H / np.abs(H(AXIS)).max()
    order = int(rng.integers(1, 6))
    assert stabilizing_time_constants((1 + H) * MODEL, MODEL, order) == EVERY


@pytest.mark.parametrize("seed", range(6))
def test_a_plot_on_the_right_comes_into_a_circle_on_the_left_when_plant_and_model_change_places(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    ratio = 1 + on_the_right(rng)
    exchanged = 1 / ratio
    assert np.abs(exchanged(AXIS) - 0.5).max() <= 0.5 + 1e-9
    order = int(rng.integers(1, 6))
    assert stabilizing_time_constants(exchanged * MODEL, MODEL, order) == EVERY


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
def test_on_the_right_and_in_the_half_disc_every_filter_works(order: int) -> None:
    H = on_the_right(np.random.default_rng(order))
    radius = 100.0 if order == 1 else 0.99 / np.cos(np.pi / (2 * order)) ** order
    H = radius * H / np.abs(H(AXIS)).max()
    assert stabilizing_time_constants((1 + H) * MODEL, MODEL, order) == EVERY


def test_on_the_right_and_large_a_filter_of_order_two_is_lost_in_between() -> None:
    plant, damped = ct.tf([1.0], [1.0, 1.0, 1.0]), ct.tf([1.0], [1.0, 21.0, 1.0])
    assert (plant(AXIS) / damped(AXIS)).real.min() >= 1
    (_, low), (high, _) = stabilizing_time_constants(plant, damped, 2)
    assert low == pytest.approx(0.12542, rel=1e-4) and high == pytest.approx(3.1646, rel=1e-4)
    assert stabilizing_time_constants(damped, plant, 2) == EVERY
