"""Sets of λ on a processor whose model has a dead time, against the verdict of the sampled loop."""

from __future__ import annotations

import warnings

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import NRDOB, LowPassFilter, delay, stabilizing_time_constants
from nrdob.digital import process_in_w

s = ct.tf("s")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_the_verdict_changes_at_every_end(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = np.exp(rng.uniform(-1, 1, 2))
    theta = float(np.exp(rng.uniform(-1.5, 0.5)))
    dt, order = theta / float(rng.uniform(1, 20)), int(rng.integers(2, 4))
    process = delay(theta) * rng.uniform(0.6, 1.6) / ((a * s + 1) * (b * s + 1))
    model = delay(theta * rng.uniform(0.6, 1.5)) / (
        (a * rng.uniform(0.7, 1.3) * s + 1) * (b * s + 1)
    )
    wait = float(rng.choice([0.0, 0.3, 1.0])) * dt
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sets = stabilizing_time_constants(process, model, order, dt=dt, computation_delay=wait)

    def stable(value: float) -> bool | None:
        loop = NRDOB(process, model, 0, LowPassFilter(value, order))
        return loop.sampled(dt, computation_delay=wait).stability().stable

    ends = [end for interval in sets for end in interval if 0 < end < np.inf]
    assert ends
    for value in [end * share for end in ends for share in (0.999, 1.001)]:
        assert stable(value) is any(low < value < high for low, high in sets)


def test_without_an_error_of_the_dead_time_it_is_that_of_the_rest() -> None:
    """With θ = θm only G0/Gm0 - 1 is left, behind the same samples: the filter may be fast."""
    prompt = 1 / ((s + 1) * (0.3 * s + 1))
    for late in (0.5, 0.53):
        ((low, high),) = stabilizing_time_constants(
            delay(late) * prompt, delay(late) * prompt, 2, dt=0.1
        )
        assert low < 0.1 and high == np.inf  # not 0: the model is not behind a hold


def test_few_samples_more_than_the_longer_dead_time_are_multiplied_out() -> None:
    prompt = 1 / (s + 1)
    held = process_in_w(delay(1.0) * prompt, 0.1, model=delay(1.23) * prompt)
    assert held.den.size - 1 == 1 + 1 + 13  # the process, the model, thirteen samples


def test_a_delayed_model_must_be_stable() -> None:
    with pytest.raises(ValueError, match="pole that is not in the open left half plane"):
        stabilizing_time_constants(delay(0.1) / s, delay(0.1) / s, 2, dt=0.01)
    with pytest.raises(ValueError, match=r"holds 100 samples .* for up to 40"):
        stabilizing_time_constants(1 / (s + 1), delay(1.0) / (s + 1), 2, dt=0.01)


def test_the_measured_plant_with_a_delayed_model() -> None:
    air = nrdob.plants.heated_air()
    ((low, high),) = stabilizing_time_constants(0.95 * air, air, 2, dt=0.08)
    assert high == np.inf
    for value, stable in ((0.99 * low, False), (1.01 * low, True)):
        loop = NRDOB(0.95 * air, air, 0, LowPassFilter(value, 2)).sampled(0.08)
        assert loop.stability().stable is stable
