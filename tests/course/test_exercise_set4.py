"""Set 4: what its texts and its solutions by hand say, beyond what every set is asked."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

from nrdob import NRDOB, LowPassFilter
from nrdob_course.exercises import PROBLEMS, check, own_case
from nrdob_course.exercises.set4 import borders_of, edges_of, fastest_of, just_good, peaks_of

GROUPS = range(1, 13)  # tests/campaigns/misconceptions.py takes more of them


@pytest.mark.parametrize("seed", range(8))
def test_a_neglected_lag_costs_the_disturbance_and_not_the_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lag, value = 10 ** rng.uniform(-1, 1, 2)
    model = ct.tf([2.0], [1.5, 1.0])
    loop = NRDOB(model * ct.tf([1], [lag, 1]), model, 0.0, LowPassFilter(value, 1))
    assert loop.stability().observer_loop.stable
    roots = loop.p_B.roots
    pair = roots[np.argsort(np.abs(np.polyval([lag * value, value, 1], roots)))[:2]]
    assert np.prod(pair) == pytest.approx(1 / (lag * value))
    assert -np.sum(pair).real / 2 * np.sqrt(lag * value) == pytest.approx(np.sqrt(value / lag) / 2)
    noise = ct.norm(loop.S_eta.to_tf(), 2) ** 2
    S_d = loop.S_d.to_tf()
    num, den = S_d.num_array[0, 0], S_d.den_array[0, 0]
    assert abs(num[-1]) < 1e-12 * np.abs(num).max()
    error = ct.norm(ct.tf(num[:-1], den), 2) ** 2
    assert noise == pytest.approx(1 / (2 * value))
    assert error == pytest.approx((lag + value) / 2)


@pytest.mark.thorough
@pytest.mark.parametrize("group", GROUPS)
def test_the_lowest_order_is_the_fastest_and_is_lost_first(group: int) -> None:
    case = own_case("4.2", group)
    fastest, edges = fastest_of(case), edges_of(case)
    assert fastest[2] > 1.08 * fastest[3] > 1.08 * fastest[4]
    assert edges[2] < edges[3] < edges[4]
    for order, bandwidth in fastest.items():
        F = LowPassFilter(LowPassFilter(1.0, order).bandwidth / bandwidth, order)
        ms = NRDOB(case.plant, case.model, 0.0, F).margins().plant_loop.ms
        assert ms == pytest.approx(case.max_ms, rel=2e-3)


def test_the_figure_says_in_words_what_is_to_be_read_off_it() -> None:
    case = own_case("4.2", 1)
    alt = case.plot().alt
    for order in (2, 3, 4):
        assert f"n = {order} reaches {case.max_ms:g} at {fastest_of(case)[order]:.3g}" in alt


@pytest.mark.thorough
def test_either_of_the_changed_plants_may_decide() -> None:
    decided_by = set()
    for group in GROUPS:
        for case in PROBLEMS["4.3"].cases(group, 4):
            borders = borders_of(case)
            decided_by.add(int(np.argmax(borders)))
            worst = lambda value, case=case: max(peaks_of(case, value))  # noqa: E731
            assert just_good(case, worst, max(borders)), "the numbers of the card are right"
    assert decided_by == {1, 2}


@pytest.mark.thorough
@pytest.mark.parametrize("group", range(1, 4))
def test_equal_lags_cannot_do_it_and_others_can(group: int) -> None:
    case = own_case("4.6", group)
    n = case.model.poles().size
    for value in np.geomspace(0.05, 20, 25) / case.fastest:
        assert check("4.6", LowPassFilter(float(value), n), group).share < 1
    found = []
    for ratio in (3.0, 4.0, 5.0, 6.0):
        for slow in np.geomspace(0.1, 0.3, 40) * case.fastest:
            den = np.poly([-slow, *[-ratio * slow] * (n - 1)])
            found.append(check("4.6", ct.tf([den[-1]], den), group).share == 1)
    assert sum(found) >= 3, "there is room, but not much"


@pytest.mark.parametrize("group", GROUPS)
def test_a_plant_that_is_ten_times_as_strong_refutes_for_every_order_and_model(group: int) -> None:
    s = ct.tf("s")
    strong = check("4.5", lambda case: 10 * case.model * (1 - s) / (1 + s), group)
    weak = check("4.5", lambda case: 0.5 * case.model * (1 - s) / (1 + s), group)
    assert strong.share == 1
    assert weak.recognised == "a zero in the right half plane alone"
