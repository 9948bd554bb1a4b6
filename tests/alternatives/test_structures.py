"""C alone and the conventional observer as NR-DOBs have the maps of their own diagrams."""

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import LowPassFilter, delay
from nrdob.alternatives import controller_alone, conventional_observer

s = ct.tf("s")
AT = np.array([0.2j, 1.5j, -0.3 + 4j, 30j, 0.7 + 0.1j])
CASES = [
    (delay(0.2) * 1.3 / (s + 1), 1 / (s + 1.2), (2 * s + 3) / s, LowPassFilter(0.4, 1)),
    (4 / (s**2 + 0.3 * s + 1), 3 / (s + 1) ** 2, (s + 0.5) / s, LowPassFilter(0.2, 2)),
    (2 / (s - 1), -1 / (s + 1), -3.0 * (s + 1) / s, LowPassFilter(0.1, 2)),
    (delay(0.05) / (s + 2) ** 2, 1 / (s * (s + 3)), 2.0 / (s + 5), LowPassFilter(0.3, 2)),
]


def expected(G, K, prefilter):
    """u = prefilter·R - K (y + η), y = G (u + δ) + d."""
    S = 1 / (1 + G * K)
    return {
        "T_R": G * prefilter * S, "S_d": S, "S_delta": G * S, "S_eta": -G * K * S,
        "U_R": prefilter * S, "U_d": -K * S, "U_delta": S, "U_eta": -K * S,
    }  # fmt: skip


@pytest.mark.parametrize(("G", "Gm", "C", "F"), CASES)
def test_all_maps_are_those_of_the_other_diagram(G, Gm, C, F):
    g, gm, f = G(AT), Gm(AT), F(AT)
    c = C(AT)
    for loop, K, prefilter in (
        (controller_alone(G, Gm, C), c, c),
        (conventional_observer(G, Gm, C, F), (c + f / gm) / (1 - f), c / (1 - f)),
    ):
        for name, value in expected(g, K, prefilter).items():
            np.testing.assert_allclose(getattr(loop, name)(AT), value, rtol=1e-9, err_msg=name)


@pytest.mark.parametrize("number", [1, 2, 4])
def test_the_poles_are_those_of_the_other_diagram(number):
    example = nrdob.paper.example(number)
    G, Gm, C, F = example.fractions
    alone = controller_alone(example.process, example.model, example.controller)
    if not alone.delay:
        by_hand = np.polyadd(np.convolve(G.den, C.den), np.convolve(G.num, C.num))
        np.testing.assert_allclose(
            np.sort_complex(alone.p_B.roots), np.sort_complex(np.roots(by_hand)), rtol=1e-7
        )
    both = conventional_observer(example.process, example.model, example.controller, example.filter)
    num = np.polyadd(np.convolve(F.num, np.convolve(C.den, Gm.den)),
                     np.convolve(F.den, np.convolve(C.num, Gm.num)))  # fmt: skip
    opened = np.convolve(np.convolve(G.den, Gm.num), np.convolve(C.den, np.polysub(F.den, F.num)))
    for root in both.p_B.roots:
        value = np.polyval(opened, root) + np.polyval(np.convolve(G.num, num), root) * np.exp(
            -root * both.delay
        )
        size = np.polyval(np.abs(opened), abs(root))
        assert abs(value) < 1e-7 * size


def test_a_conventional_observer_survives_the_modified_plant_of_example_2_only_just():
    loop, changed = nrdob.paper.example(2), nrdob.paper.example(2, modified=True)
    other = conventional_observer(changed.process, loop.model, loop.controller, loop.filter)
    assert other.stability().stable and other.margins().plant_loop.ms > 100


@pytest.mark.parametrize(
    ("C", "message"),
    [
        (0.5, "C alone cannot be written as an observer: F\\(0\\) = 0.3333, not 1"),
        (-2 / s, "C alone cannot be written as an observer: K does not stabilise the model"),
    ],
)
def test_a_controller_that_is_no_observer_is_refused(C, message):
    with pytest.raises(ValueError, match=message):
        controller_alone(1 / (s + 1), 1 / (s + 1), C)


def test_a_conventional_observer_needs_a_controller_for_its_model():
    with pytest.raises(ValueError, match="C does not stabilise the model: p_A has the root"):
        conventional_observer(1 / (s + 1), 1 / (s - 1), 0.5, LowPassFilter(1.0, 1))
