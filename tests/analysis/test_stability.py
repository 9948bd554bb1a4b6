from dataclasses import replace

import control as ct
import numpy as np
import pytest
from hypothesis import assume, given

import nrdob
from densegrid import roots_on_the_right
from nrdob import LowPassFilter, paper
from nrdob.numerics.exact import rhp_count, whole
from strategies import loops

s = ct.tf("s")
PI = 0.001 / s  # a controller that never decides anything


def observer(process, model, time_constant, order):
    return nrdob.judge_observer(process, model, LowPassFilter(time_constant, order))


@pytest.mark.parametrize(
    ("number", "modified"),
    [(1, False), (2, False), (2, True), (3, False), (3, True), (4, False), (4, True)],
)
def test_every_loop_of_the_paper_is_stable(number, modified):
    verdict = paper.example(number, modified).stability()
    assert verdict.stable is True
    assert verdict.observer_loop.rightmost.real < 0


@pytest.mark.slow
@given(loops())
def test_random_verdicts_agree_with_closed_loop_poles(loop):
    verdict = loop.stability()
    assume(verdict.stable is not None)
    roots = np.concatenate([np.roots(loop.p_A.q), np.roots(loop.p_B.q)])
    if np.abs(roots.real / (1e-30 + np.abs(roots))).min() > 1e-6:
        assert verdict.stable == (roots.real.max() < 0)
        assert verdict.observer_loop.closed_loop_rhp == np.sum(np.roots(loop.p_B.q).real > 0)


@pytest.mark.thorough
@given(loops(delayed=True))
def test_random_delayed_verdicts_agree_with_an_independent_argument_count(loop):
    verdict = loop.stability().observer_loop
    if verdict.closed_loop_rhp == np.inf:
        assert loop.p_B.neutral_ratio > 1
        return
    omega = np.union1d(np.geomspace(1e-6, 1e5, 20_001), np.linspace(0, 2000, 30_001)[1:])
    values = loop.p_B.without_origin(1j * omega)
    p = loop.p_B.without_origin
    floor = np.polyval(np.abs(p.q), omega) + np.polyval(np.abs(p.r), omega)
    assume(verdict.stable is not None and (np.abs(values) / floor).min() >= 1e-3)
    assume(np.abs(np.angle(values[1:] / values[:-1])).max() <= 1.5)  # else faster than the grid
    assert round(roots_on_the_right(values, p.q[0], p.degree)) == verdict.closed_loop_rhp
    assert verdict.stable == (verdict.closed_loop_rhp == 0)


def test_a_matched_unstable_plant_is_not_stable_although_b_is_identically_one():
    G = 4 / (2 - s - s**2)
    verdict = nrdob.NRDOB(G, G, -2, LowPassFilter(0.05, 2)).stability()
    assert verdict.model_loop.stable is True
    assert verdict.observer_loop.closed_loop_rhp == 1
    assert verdict.observer_loop.rightmost == pytest.approx(1.0)
    assert "s = 1 is an open-loop pole that cancels out of sight" in verdict.reason


def test_a_controller_that_cancels_an_unstable_model_pole_is_found_out():
    loop = nrdob.NRDOB(1 / (s + 1), 1 / (s - 1), (s - 1) / (s * (s + 3)), LowPassFilter(0.05, 1))
    model_loop = loop.stability().model_loop
    assert model_loop.stable is False
    assert model_loop.rightmost == pytest.approx(1.0)
    assert model_loop.open_loop_rhp == model_loop.closed_loop_rhp == 1


@pytest.mark.parametrize(("time_constant", "stable"), [(0.0049, False), (0.0051, True)])
def test_example_2_needs_a_time_constant_above_5_ms(time_constant, stable):
    loop = paper.example(2)
    assert observer(loop.process, loop.model, time_constant, 2).stable is stable


@pytest.mark.parametrize(("factor", "stable"), [(0.999, True), (1.001, False)])
def test_example_3_needs_a_time_constant_below_three_minus_root_five(factor, stable):
    loop = paper.example(3)
    assert observer(loop.process, loop.model, factor * (3 - 5**0.5), 2).stable is stable


@pytest.mark.parametrize("delay", [0.05, 0.5, 5.0])
@pytest.mark.parametrize(("factor", "stable"), [(0.9999, False), (1.0001, True)])
def test_pure_delay_mismatch_needs_lambda_above_two_theta_over_pi(delay, factor, stable):
    model = 1 / (s + 1)
    lam = factor * 2 * delay / np.pi
    assert observer(nrdob.delay(delay) * model, model, lam, 1).stable is stable


def test_at_the_critical_time_constant_no_verdict_is_given():
    loop = paper.example(2)
    verdict = observer(loop.process, loop.model, 0.005, 2)
    assert verdict.stable is None
    assert "near 200 rad/s" in verdict.reason
    assert verdict.closed_loop_rhp is None


@pytest.mark.parametrize(
    ("time_constant", "stable"), [(0.04, True), (0.05, False), (1.0, False), (2.7, True)]
)
def test_a_resonance_mismatch_of_ten_percent_is_judged(time_constant, stable):
    model = 1 / (s**2 + 0.02 * s + 1)
    process = 1 / ((s / 0.9) ** 2 + 0.02 * s / 0.9 + 1)
    assert observer(process, model, time_constant, 2).stable is stable


def test_pade_of_order_one_would_call_this_unstable_loop_stable():
    model = 1 / (s + 1)
    verdict = observer(nrdob.delay(0.5) * model, model, 0.28, 1)
    pade = ct.tf(*ct.pade(0.5, 1))
    assert nrdob.NRDOB(pade * model, model, PI, LowPassFilter(0.28, 1)).stability().stable is True
    assert verdict.stable is False


def test_a_wrong_sign_in_eq_14_puts_a_root_near_17():
    loop = paper.example(3)
    printed = paper.PRINTED_FUNCTIONS["ex3.H"]
    # 1 + F H = 0 with the printed H: (λs+1)^2 (s-1) - (3s+5) = 0
    p = np.polysub(np.polymul([0.0025, 0.1, 1], printed.den), np.abs(printed.num))
    assert np.roots(p).real.max() == pytest.approx(17.4, abs=0.05)
    assert loop.stability().stable is True


def test_an_integrator_matched_by_an_integrator_keeps_its_root_at_zero_if_its_factors_are_kept():
    loop = nrdob.NRDOB(1 / s, 1 / s, 2, LowPassFilter(0.05, 1), keep_factors=True)
    verdict = loop.stability()
    assert verdict.stable is False
    assert "s = 0 exactly" in verdict.reason
    assert "the model has an integrator" in verdict.reason


def test_an_integrating_plant_is_served_by_a_model_with_a_slow_pole():
    verdict = nrdob.NRDOB(1 / s, 1 / (s + 0.1), 2, LowPassFilter(0.05, 1)).stability()
    assert verdict.stable is True


def test_a_zero_of_the_plant_at_the_origin_stays_for_every_filter():
    for lam in (0.01, 1.0):
        verdict = nrdob.NRDOB(s / (s + 1) ** 2, 1 / (s + 1), 1, LowPassFilter(lam, 1)).stability()
        assert verdict.stable is False
        assert "the process has a zero there" in verdict.reason


def test_an_ill_posed_loop_is_not_decided_and_says_why():
    loop = nrdob.NRDOB(0.1 * (100 - s) / (s + 2), 10 / (s + 2), 1 / s, LowPassFilter(0.01, 1))
    verdict = loop.stability()
    assert verdict.stable is None
    assert "ill-posed" in verdict.reason
    model = -(s + 2) / (s + 1)
    verdict = nrdob.NRDOB(model, model, 1, LowPassFilter(0.1, 1)).stability()
    assert verdict.stable is None
    assert "C(∞)" in verdict.reason


BIPROPER = (0.5 * s + 1) / (s + 1)


@pytest.mark.parametrize(("gain", "stable"), [(0.8, True), (1.2, False), (1.0, None)])
def test_neutral_loops_are_reported_as_what_they_are(gain, stable):
    model = (s + 1) / (s + 2)
    loop = nrdob.NRDOB(nrdob.delay(0.3) * gain * model, model, 1 / s, BIPROPER)
    verdict = loop.stability()
    assert verdict.observer_loop.kind == "neutral"
    assert verdict.stable is stable
    assert "neutral" in verdict.observer_loop.reason


def test_roots_of_very_different_size_are_judged():
    process = 1 / ((1e-6 * s + 1) * (1e6 * s + 1))
    model = 1 / (1e6 * s + 1)
    verdict = observer(process, model, 1e-3, 1)
    assert verdict.stable is True
    assert verdict.roots.size == 3
    assert min(abs(verdict.roots.real)) == pytest.approx(1e-6, rel=1e-3)


@pytest.mark.parametrize("multiplicity", [1, 2])
def test_plant_poles_on_the_axis_are_judged(multiplicity):
    process = 1 / (s**2 + 1) ** multiplicity
    model = 1 / (s**2 + s + 1) ** multiplicity
    loop = observer(process, model, 0.01, 2 * multiplicity)
    exact = np.roots(loop_polynomial(process, model, 0.01, 2 * multiplicity))
    assert loop.open_loop_rhp == 0
    assert loop.closed_loop_rhp == np.sum(exact.real > 0)


def loop_polynomial(process, model, time_constant, order):
    N, D, Nm, Dm = (c for b in (process, model) for c in (b.num[0][0], b.den[0][0]))
    Df = np.poly([-1 / time_constant] * order) * time_constant**order
    return np.polyadd(np.polymul(np.polymul(D, Nm), np.polysub(Df, [1])), np.polymul(N, Dm))


def test_the_verdict_prints_its_evidence_in_a_terminal_and_in_a_notebook():
    verdict = paper.example(3).stability()
    assert repr(verdict).splitlines()[3].split() == ["F", "H", "(ii)", "-1", "1", "0", "-1.053"]
    html = verdict._repr_html_()
    assert "<strong>stable</strong>" in html
    assert html.count("<tr>") == 3
    assert ">−1</td>" in html
    assert "></th>" not in html, "a column without a head"
    assert "<i>p</i><sub>A</sub> and <i>p</i><sub>B</sub> have" in html
    assert ">CG\u0303 (i)</td>" in html and ">FH (ii)</td>" in html
    assert "p_A" in repr(verdict)


def test_example_2_without_its_filter_is_the_verdict_that_fails():
    G = paper.example(2)
    verdict = nrdob.NRDOB(G.process, G.model, G.controller, LowPassFilter(0.004, 2)).stability()
    assert "NOT stable" in repr(verdict)
    assert "2 roots in the right half plane" in verdict.reason


# Two ways that can differ.


def test_the_observer_alone_is_judged_as_within_a_loop():
    loop = paper.example(3)
    alone = nrdob.judge_observer(loop.process, loop.model, loop.filter)
    assert alone == loop.stability().observer_loop
    with pytest.raises(ValueError, match="not causal"):
        nrdob.judge_observer(loop.process, loop.model, LowPassFilter(1, 1))


@pytest.mark.parametrize("counted", ["rhp_roots", "count_rhp"])
def test_a_pole_or_a_turn_miscounted_leaves_no_verdict(counted, monkeypatch):
    right = getattr(nrdob.analysis.nyquist, counted)

    def wrong(p):
        found = right(p)
        return found + 1 if counted == "rhp_roots" else replace(found, count=found.count + 1)

    monkeypatch.setattr(nrdob.analysis.nyquist, counted, wrong)
    part = paper.example(3).stability().observer_loop
    assert part.stable is None and part.closed_loop_rhp is None
    assert "the encirclements give Z" in part.reason and "no verdict" in part.reason


def test_a_verdict_is_true_or_false_and_none_is_no_answer():
    loop = paper.example(3)
    assert loop.stability() and loop.stability().observer_loop
    assert not observer(loop.process, loop.model, 1.0, 2)
    with pytest.raises(ValueError, match=r"near 200 rad/s.*ask for \.stable"):
        bool(observer(paper.example(2).process, paper.example(2).model, 0.005, 2))


@pytest.mark.parametrize("ratio", [1e3, 1e4, 1e5])
def test_dead_times_much_longer_than_the_fastest_lag_are_judged(ratio):
    model = 1 / (s + 1)
    process = nrdob.delay(1.0) / ((s + 1) * (s / ratio + 1))
    slow, quick = (observer(process, model, value, 1) for value in (5.0, 1 / ratio))
    assert slow.stable is True and slow.rightmost.real < 0
    assert quick.stable is False and quick.rightmost.real > 0
    # |F R/(1 - F)| = 1 at about the corner of the filter, and a pair crosses at every turn.
    assert quick.closed_loop_rhp == pytest.approx(0.62 * ratio / np.pi, rel=0.5)
    assert quick.ways == ("encirclements", "Walton and Marshall's count")
    assert "by encirclements and by Walton and Marshall's count" in quick.reason


def test_a_rational_loop_is_judged_by_its_roots_as_the_second_way():
    model = 1 / (s + 1)
    assert observer(model, model, 0.5, 2).ways == ("encirclements", "roots")


@pytest.mark.parametrize("ratio", [1e-3, 0.3, 3.0, 1e5])
@pytest.mark.parametrize(("factor", "stable"), [(0.9999, False), (1.0001, True)])
def test_the_border_is_where_it_is_for_every_ratio_of_dead_time_to_lag(ratio, factor, stable):
    model = 1 / (s + 1)
    found = observer(nrdob.delay(ratio) * model, model, factor * 2 * ratio / np.pi, 1)
    assert found.stable is stable


def test_roots_on_the_right_decide_beside_one_on_the_axis():
    # Matched but for the dead time, with an undamped mode: p_B keeps s² + 1.
    model = 1 / (s**2 + 1)
    found = observer(nrdob.delay(100.0) * model, model, 1.0, 2)
    assert found.stable is False and found.closed_loop_rhp is None
    assert "16 roots in the right half plane, and a root on the imaginary axis" in found.reason
    assert observer(nrdob.delay(0.01) * model, model, 1.0, 2).stable is None


def test_scales_eleven_decades_apart_are_judged():
    process = 1.1 / ((1e6 * s + 1) * (1e-5 * s + 1) * (10 * s + 1))
    model = 1 / ((1.2e6 * s + 1) * (11 * s + 1))
    for lam in (1e-7, 1e-3, 1.0, 1e5):
        found = observer(process, model, lam, 2)
        loop = nrdob.diagram.equations.ObserverEquations(process, model, LowPassFilter(lam, 2))
        assert found.stable is (rhp_count(whole(loop.p_B.q)[0]) == 0)


@pytest.mark.thorough
@pytest.mark.parametrize("size", [1e-30, 1e30])
@pytest.mark.parametrize("time", [1e-9, 1e9])
@pytest.mark.parametrize("gain", [1e-12, 1e12])
@pytest.mark.parametrize("delay", [0.0, 0.5, 500.0])
def test_units_change_no_verdict(size, time, gain, delay):
    def block(num, den, gain=1.0):
        return tuple(
            size * factor * np.array(p) * time ** np.arange(len(p) - 1, -1, -1.0)
            for p, factor in ((num, gain), (den, 1.0))
        )

    process, model = ([0.2, 1.1], [1.0, 2.2, 1.0]), ([1.0], [1.1, 2.0, 1.0])
    for lam in (0.01, 1.0, 1e3):
        scaled = ct.tf(*block(*process, gain))
        scaled = nrdob.delay(delay * time) * scaled if delay else scaled
        plain = nrdob.delay(delay) * ct.tf(*process) if delay else ct.tf(*process)
        found = nrdob.judge_observer(scaled, block(*model, gain), LowPassFilter(lam * time, 2))
        expected = observer(plain, model, lam, 2)
        assert found.stable is expected.stable is not None
        assert found.closed_loop_rhp == expected.closed_loop_rhp
        assert found.rightmost * time == pytest.approx(expected.rightmost, rel=1e-6)


def test_a_table_of_large_numbers_keeps_its_columns_apart():
    model = 1 / (s + 1)
    verdict = nrdob.NRDOB(nrdob.delay(1e5) * model, model, PI, LowPassFilter(0.1, 1)).stability()
    row = repr(verdict).splitlines()[3].split()
    count = verdict.observer_loop.closed_loop_rhp
    assert count > 1e5 and row[3:6] == [f"{count:g}", "0", f"{count:g}"]


@pytest.mark.usefixtures("no_warning_leaks")
@pytest.mark.parametrize(("unit", "time_constant"), [(1e12, 1e3), (1e-12, 1e-6), (1.0, 1e3)])
@pytest.mark.parametrize("dead_time", [1e-3, 1e3])
def test_verdicts_do_not_depend_on_a_unit_in_which_squares_overflow(unit, time_constant, dead_time):
    # 1.02/(Ts + 1)^3 under a filter of order 9: coefficients over hundreds of decades.
    den = LowPassFilter(unit, 3).den
    process = nrdob.delay(dead_time * unit) * ct.tf([1.02], den)
    F = LowPassFilter(time_constant * unit, 9)
    found = nrdob.judge_observer(process, ct.tf([1.0], den), F)
    natural = LowPassFilter(1.0, 3).tf
    same = nrdob.judge_observer(
        nrdob.delay(dead_time) * 1.02 * natural, natural, LowPassFilter(time_constant, 9)
    )
    assert found.stable is not None and found.stable is same.stable


@pytest.mark.thorough
@pytest.mark.usefixtures("no_warning_leaks")
@pytest.mark.parametrize("delay", [0.1, 50.0])
def test_a_filter_of_300_lags_leaves_a_reason_and_no_warning(delay):
    lag = ct.tf([1.0], [1.0, 1.0])
    verdict = nrdob.NRDOB(nrdob.delay(delay) * 1.1 * lag, lag, 0.5, LowPassFilter(1.0, 300))
    assert verdict.stability().stable is None
    assert "within rounding" in verdict.stability().reason


@pytest.mark.parametrize(
    ("num", "F", "delay", "kind"),
    [
        ([1.0], [1.0], 0.0, "rational"),
        ([1.0], [1.0], 0.1, "retarded"),
        ([0.5, 1.0], [0.2, 1.0], 0.1, "neutral"),
    ],
)
def test_the_kind_of_an_equation_is_that_of_its_delayed_term(num, F, delay, kind):
    process, model = (
        ct.tf(num, [1.0, 1.0]),
        ct.tf([0.6, 1.0] if len(num) > 1 else [1.0], [1.0, 1.0]),
    )
    process = nrdob.delay(delay) * process if delay else process
    loop = nrdob.NRDOB(process, model, ct.tf([1.0], [1.0, 0.0]), ct.tf(F, [1.0, 1.0]))
    assert loop.stability().observer_loop.kind == kind
    assert loop.stability().model_loop.kind == "rational"
