"""A report says which small error of a resonance makes the loop unstable, if any does."""

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob.reporting.formulas import character, formula, intervals, roots_listed
from nrdob.reporting.resonances import moved, resonance_warnings

s = ct.tf("s")


def resonance(frequency, damping):
    return frequency**2 / (s**2 + 2 * damping * frequency * s + frequency**2)


def roots_of_loop(frequency, lag):
    """Roots with a filter of order 2, a model at 10 rad/s and no controller, multiplied out."""
    model, plant = np.array([1, 0.4, 100]), np.array([1, 0.04 * frequency, frequency**2])
    sum_of_both = np.polymul(np.polysub(np.polymul([lag, 1], [lag, 1]), [1]), 100 * plant)
    return np.roots(np.polyadd(sum_of_both, frequency**2 * model))


@pytest.mark.parametrize("lag", [0.015, 0.0316, 0.05, 0.23, 0.3, 1.0])
def test_the_first_shift_that_makes_the_loop_unstable_is_named(lag):
    loop = nrdob.NRDOB(resonance(10, 0.02), resonance(10, 0.02), 0, 1 / (lag * s + 1) ** 2)
    said = [said for _, said in resonance_warnings(loop)]
    lost = [
        (shift, way)
        for shift in (2, 5, 10)
        for sign, way in ((-1, "lower"), (1, "higher"))
        if roots_of_loop(10 * (1 + sign * shift / 100), lag).real.max() >= 0
    ]
    assert [f"{lost[0][0]} % {lost[0][1]}" in each for each in said] == [True] * bool(lost)


def test_a_resonance_without_any_damping_is_one():
    plant, model = 100 / (s**2 + 100), 100 / (s**2 + 0.4 * s + 100)
    loop = nrdob.NRDOB(plant, model, 0, nrdob.LowPassFilter(0.0316, 2))
    assert loop.stability().stable
    (said,) = [said for _, said in resonance_warnings(loop)]
    assert "5 % lower the loop is unstable" in said


@pytest.mark.slow
def test_an_antiresonance_and_a_dead_time_count_as_well():
    def plant(high=10.0, low=8.0):
        notch = (s**2 + 0.02 * low * s + low**2) / low**2
        return nrdob.delay(0.001) * (resonance(high, 0.02) * notch / (0.1 * s + 1))

    def loop(process):
        return nrdob.NRDOB(process, plant().tf, 0, nrdob.LowPassFilter(0.1, 1))

    said = " ".join(said for _, said in resonance_warnings(loop(plant())))
    assert "antiresonance at 8 rad/s 5 % higher" in said
    assert "resonance at 10 rad/s 5 % lower" in said
    within = [plant(low=8 * 1.02), plant(high=10 * 0.98), plant(low=8 * 0.98)]
    assert [loop(each).stability().stable for each in within] == [True] * 3
    beyond = [plant(low=8 * 1.05), plant(high=10 * 0.95)]
    assert [loop(each).stability().stable for each in beyond] == [False] * 2


def test_what_is_well_damped_is_let_alone():
    loop = nrdob.NRDOB(resonance(10, 0.3), resonance(10, 0.3), 0, nrdob.LowPassFilter(0.03, 2))
    assert list(resonance_warnings(loop)) == []


def test_a_moved_pair_keeps_its_damping_and_the_others():
    polynomial = np.polymul([1, 0.4, 100], [1, 3])
    pair = np.roots(moved(polynomial, complex(-0.2, np.sqrt(99.96)), 1.1))
    assert np.sort_complex(pair) == pytest.approx(
        np.sort_complex([-3, -0.22 + 1.1j * np.sqrt(99.96), -0.22 - 1.1j * np.sqrt(99.96)])
    )


def test_a_zero_at_the_origin_is_said_and_a_missing_term_is_none():
    def said(num):
        return any("zero at s = 0" in text for text in character(ct.tf(num, [1, 2, 3, 1])))

    assert said([1, 0]) and said([1, 2, 0])
    assert not said([1, 0, 2]) and not said([2])


def test_intervals_of_time_constants_are_written_with_both_ends():
    inf = float("inf")
    assert intervals([(0.0, inf)]) == "every λ > 0"
    assert intervals([(0.0, 5.0)]) == "0 s < λ < 5 s"
    assert intervals([(0.375, inf)]) == "λ > 0.375 s"
    assert intervals([(0.1, 0.2), (3.0, inf)]) == "0.1 s < λ < 0.2 s or λ > 3 s"
    assert intervals([]) == "no λ at all"
    assert intervals([(0.109384, 0.381966)]) == "0.1094 s < λ < 0.3819 s"
    assert intervals([(60.0444, 8.88888e6)]) == "60.05 s < λ < 8.888e+06 s"
    assert intervals([(0.1 + 0.2, 0.6 * (1 + 1e-15))]) == "0.3 s < λ < 0.6 s"


def test_a_multiple_root_is_listed_as_often_as_it_is_there():
    for order in (2, 3, 4):
        assert roots_listed(np.roots(np.poly(-2.16 * np.ones(order)))).count("−2.16") == order
    assert roots_listed([-1 + 2j, -1 - 2j]) == "−1 ± 2j"


def test_zeros_on_the_axis_are_not_called_harmless():
    (said,) = character(ct.tf([1, 0, 4], [1, 3, 3, 1]))
    assert said.startswith("It has zeros on the imaginary axis, at ± 2j rad/s")


def test_what_stands_below_a_bar_is_in_brackets():
    assert formula(ct.tf([1], [1e-7, 0])).startswith("1/(") and formula(ct.tf([2], [1, 0])) == "2/s"
