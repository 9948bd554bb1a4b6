"""Verdicts of graders that rest on theorems, found again with nothing but polynomials and roots."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Any

import control as ct
import numpy as np
import pytest

from nrdob import LowPassFilter
from nrdob_course.exercises import PROBLEMS, own_case
from problemsets import SETS, posed, published

POSED = {this.id: this for path in SETS for this in posed(path)}
GROUPS = range(1, 6)

each_group = pytest.mark.parametrize("group", GROUPS)


def fraction(block: Any) -> tuple[Any, Any]:
    """Numerator and denominator, descending."""
    if isinstance(block, LowPassFilter):
        return np.ones(1), product(*[[block.time_constant, 1.0]] * block.order)
    tf = block if isinstance(block, ct.TransferFunction) else ct.tf([float(block)], [1])
    return np.trim_zeros(tf.num[0][0], "f"), np.trim_zeros(tf.den[0][0], "f")


def product(*polynomials: Any) -> Any:
    return reduce(np.convolve, polynomials)


def left(polynomial: Any, share: float = 1e-9) -> bool:
    """Whether all roots are on the left, by more than rounding."""
    roots = np.roots(polynomial)
    return bool((roots.real < -share * np.abs(roots).max(initial=0)).all())


def right(polynomial: Any) -> int:
    return int(np.sum(np.roots(polynomial).real > 0))


def p_B(process: Any, model: Any, F: Any) -> Any:
    (N, D), (Nm, Dm), (Nf, Df) = map(fraction, (process, model, F))
    return np.polyadd(product(D, Nm, np.polysub(Df, Nf)), product(N, Dm, Nf))


def p_A(model: Any, controller: Any) -> Any:
    (Nm, Dm), (Nc, Dc) = map(fraction, (model, controller))
    return np.polyadd(product(Dm, Dc), product(Nm, Nc))


def stable(loop: Any) -> bool:
    return left(p_A(loop.model, loop.controller)) and left(
        p_B(loop.process, loop.model, loop.filter)
    )


def own_answer(id: str, group: int) -> Any:
    answer = published(POSED[id], group)
    return answer if PROBLEMS[id].own else answer(own_case(id, group))


def accepts(id: str, case: Any, answer: Any) -> bool:
    return not PROBLEMS[id].lacks(case, PROBLEMS[id].reads(answer))


@each_group
def test_1_5_a_twin_has_the_same_K_and_a_filter_that_is_stable(group: int) -> None:
    case = own_case("1.5", group)
    loop, s = case.loop, np.array([0.3 + 1j, 2j, 5 + 3j])
    Df = fraction(loop.filter)[1]
    for c in (2.0, 0.5, 0.01, -1.0, 8.9, 9.2):
        den = np.polyadd(Df, [c - 1])
        F, given = c / np.polyval(den, s), 1 / np.polyval(Df, s)
        assert np.allclose(F / ((1 - F) * c), given / (1 - given))  # K, but for Gm
        assert accepts("1.5", case, (c, [c], den)) is left(den)


def visible(numerator: Any, denominator: Any) -> list[complex]:
    """Zeros of a fraction on the right that are left when what is equal has cancelled."""
    zeros = list(np.roots(numerator))
    for pole in np.roots(denominator):
        near = [k for k, zero in enumerate(zeros) if abs(zero - pole) < 1e-6 * max(1, abs(pole))]
        if near:
            zeros.pop(near[0])
    return [zero for zero in zeros if zero.real >= 0]


@each_group
def test_2_5_the_published_loop_is_unstable_and_neither_fraction_shows_it(group: int) -> None:
    loop = own_answer("2.5", group)
    (_, D), (Nm, Dm), (_, Df) = map(fraction, (loop.process, loop.model, loop.filter))
    assert not stable(loop)
    assert not visible(p_B(loop.process, loop.model, loop.filter), product(D, Nm, Df))
    Dc = fraction(loop.controller)[1]
    assert not visible(p_A(loop.model, loop.controller), product(Dm, Dc))


@each_group
def test_2_6_the_published_loop_is_stable_and_H_makes_no_turn(group: int) -> None:
    loop = own_answer("2.6", group)
    (N, D), (Nm, Dm) = map(fraction, (loop.process, loop.model))
    assert stable(loop)
    assert right(D) == 1
    assert right(product(N, Dm)) == right(product(D, Nm))  # 1 + H = G/Gm


def edge(of: Callable[[float], Any]) -> float:
    """The largest gain from 1 on up to which a polynomial has its roots on the left."""
    low = high = 1.0
    while left(of(high)):
        low, high = high, 1.3 * high
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if left(of(middle)) else (low, middle)
    return low


@each_group
def test_3_5_a_gain_is_right_between_the_two_upper_margins(group: int) -> None:
    case = own_case("3.5", group)
    loop = case.loop
    (N, D), (Nm, Dm), (Nf, Df) = map(fraction, (loop.process, loop.model, loop.filter))
    H = np.polysub(product(N, Dm), product(D, Nm))
    of_FH = edge(lambda k: np.polyadd(product(D, Nm, Df), k * product(H, Nf)))
    of_L = edge(lambda k: p_B(k * loop.process, loop.model, loop.filter))
    assert stable(loop) and of_L < of_FH
    for k in (0.97 * of_L, 1.03 * of_L, (of_L * of_FH) ** 0.5, 0.98 * of_FH, 1.02 * of_FH):
        assert accepts("3.5", case, k) is bool(of_L < k < of_FH)


@each_group
def test_4_5_slow_filters_fail_beyond_the_closed_form(group: int) -> None:
    case = own_case("4.5", group)
    n, model = case.order, case.model
    bound, mirror = 1 + 1 / np.cos(np.pi / n) ** n, ct.tf([-1, 1], [1, 1])
    plants = [own_answer("4.5", group), 3 * model, -2 * model * mirror]
    for plant in [*plants, *(share * bound * model * mirror for share in (0.9, 1.1))]:
        (N, D), (Nm, Dm) = map(fraction, (plant, model))
        lost = not any(left(p_B(plant, model, LowPassFilter(T, n))) for T in (3e2, 3e3, 1e4))
        ratio = N[-1] / D[-1] / (Nm[-1] / Dm[-1])
        turns = right(product(N, Dm)) - right(product(D, Nm))
        assert lost is bool(ratio < 0 or ratio > bound)
        refutes = left(D) and ratio > 0 and lost and turns >= 1
        assert accepts("4.5", case, plant) is bool(refutes)


@pytest.mark.thorough
@each_group
def test_5_5_fast_filters_fail_where_n_exceeds_the_lags_by_more_than_two(group: int) -> None:
    case = own_case("5.5", group)
    process = ct.tf([case.gain], np.poly([case.pole, -case.decay]))
    for lags in (1, 2, 3):
        over = np.poly([-case.pole, -case.decay, *[-10 * case.decay] * lags])
        model = ct.tf([case.gain], over / (10 * case.decay) ** lags)
        for n in range(lags + 2, 8):
            fast = [LowPassFilter(T / case.decay, n) for T in (1e-4, 3e-5)]
            lost = not any(left(p_B(process, model, F), 1e-12) for F in fast)
            assert lost is (n - lags > 2)
            assert accepts("5.5", case, (model, n)) is lost
        assert not accepts("5.5", case, (model, lags + 1))  # F/model is not causal


@pytest.mark.thorough
@each_group
def test_6_4_a_plant_between_the_two_is_lost(group: int) -> None:
    case = own_case("6.4", group)

    def survives(gain: float, lag: float) -> bool:
        return stable(case.changed(gain, lag))

    assert survives(1, 0) and survives(case.gain, case.lag)
    half = (1 + case.gain) / 2
    places = [own_answer("6.4", group), (1, case.lag), (half, case.lag), (half, case.lag / 4)]
    for gain, lag in [*places, (1, case.lag / 3), (case.gain, case.lag), (1, 2 * case.lag)]:
        inside = case.gain <= gain <= 1 and 0 <= lag <= case.lag
        assert accepts("6.4", case, (gain, lag)) is (inside and not survives(gain, lag))
