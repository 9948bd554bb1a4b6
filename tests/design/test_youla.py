"""Controllers as observers: against eigenvalues, and against the loop that they make."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob.design import observer_form, stable_model_exists
from nrdob.sampling import random_block

s = ct.tf("s")


@pytest.mark.thorough
def test_random_controllers_have_stable_blocks_where_the_closed_loop_has():
    rng, seen = np.random.default_rng(5), set()
    for _ in range(120):
        model = random_block(rng, 3)
        K = random_block(rng, 2) / s * 10 ** rng.uniform(-1, 1)
        found = observer_form(K, model)
        parts = [ct.tf2ss(K), ct.tf2ss(model)]
        roots = ct.feedback(parts[0] * parts[1], 1).poles()
        assert found.holds == bool(roots.real.max() < 0)
        seen.add(found.holds)
        if found:
            assert found.F.poles().real.max() < 0
            assert found.F.dcgain() == pytest.approx(1)
    assert seen == {True, False}


@pytest.mark.parametrize(
    ("K", "model"),
    [
        ((3 * s + 4) / s, 1 / (s + 1)),
        ((3 * s + 2) / s, 1 / (s - 1)),
        (20 * (s + 1) ** 2 / (s * (s / 40 + 1)), 1 / (s * (s + 4))),
    ],
)
def test_the_diagram_with_these_blocks_feeds_back_K(K, model):
    found = observer_form(K, model)
    assert found
    loop = nrdob.NRDOB(model, model, 0.1, found.F)
    at = 1j * np.array([0.01, 0.3, 2.0, 50.0])
    assert np.asarray(loop.K(at)) == pytest.approx(K(at), rel=1e-9)
    assert loop.stability().observer_loop.stable


def test_what_fails_is_named():
    assert "F(0) = 1.5" in observer_form(3.0, 1 / (s - 1)).reason
    assert "zero at s = 0.7" in observer_form(0.3, 1 / (s - 1)).reason
    ill_posed = observer_form(-1.0, (s + 2) / (s + 1))
    assert "ill-posed" in ill_posed.reason and not ill_posed


def test_stable_models_exist_by_parity():
    assert stable_model_exists((s - 2) / ((s - 1) * (s + 5))).holds is True
    assert stable_model_exists((s - 1) / ((s - 2) * (s + 5))).holds is False
    assert stable_model_exists((s - 1) / ((s - 2) * (s - 3))).holds is True
    assert stable_model_exists((s - 1) / (s + 5)).holds is True
    # The zero at infinity counts only while K falls off; what cancels counts not at all.
    assert stable_model_exists((s - 1) * (s + 7) / ((s - 2) * (s + 5))).holds is True
    assert stable_model_exists((s - 1) * (s - 2) / ((s - 2) * (s + 5) ** 2)).holds is True


@pytest.mark.thorough
def test_no_stable_model_that_was_tried_stabilises_against_parity():
    rng, K = np.random.default_rng(0), (s - 1) / ((s - 2) * (s + 5))
    for _ in range(300):
        roots = -(10 ** rng.uniform(-1, 2, 2))
        gain = rng.choice([-1, 1]) * 10 ** rng.uniform(-1, 3)
        model = ct.tf(gain * np.poly(rng.normal(size=2) * 10), np.poly(roots))
        assert not observer_form(K, model).holds
        assert (
            "does not stabilise" in observer_form(K, model).reason
            or "ill" in observer_form(K, model).reason
        )


@pytest.mark.parametrize("order", [1, 2, 3])
def test_with_a_model_made_for_it_an_integral_controller_has_filter_1_and_keeps_every_factor(
    order: int,
) -> None:
    """The model F/((1 - F) K): p_B is ((Df - 1)/s) times the loop of K and the process."""
    F = nrdob.LowPassFilter(0.1, order)
    process = 1.02 * (14 * s - 1) / ((s - 9) * (0.001 * s + 1))
    rest = np.polysub(F.den, [1.0])[:-1]  # (Df - 1)/s
    model = ct.tf([1, -2], np.polymul([1, -1], rest))  # K = (s - 1)/(s (s - 2))
    loop = nrdob.NRDOB(process, model, 1, F, keep_factors=True)
    points = 1j * np.geomspace(0.01, 100, 9)
    assert np.allclose(loop.K(points), (points - 1) / (points * (points - 2)))
    num, den = process.num[0][0], process.den[0][0]
    closed = np.polyadd(np.polymul(den, [1, -2, 0]), np.polymul(num, [1, -1]))
    wanted = np.polymul(closed, rest)
    assert np.allclose(loop.p_B.q / loop.p_B.q[0], wanted / wanted[0])
    assert loop.stability().observer_loop.closed_loop_rhp == 0
