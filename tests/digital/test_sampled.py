"""Loops on a processor against closed forms, brute force, scipy and python-control."""

import math
import pickle
import tracemalloc
from functools import cache

import control as ct
import mpmath as mp
import numpy as np
import pytest
from scipy.signal import cont2discrete, lsim

import nrdob
from nrdob import paper
from nrdob.diagram import Fraction
from nrdob.digital import (
    largest_sampling_time,
    process_in_w,
    verdict,
)
from nrdob.digital.bilinear import held_in_w
from nrdob.digital.closedloop import ClosedLoop
from nrdob.digital.hold import held_process
from nrdob.digital.unitcircle import CircleFunction, Product, TurnCount, count_outside
from tests.campaigns import sampled as campaign

s = ct.tf("s")
NUMBERS = [1, 2, 3, 4]


def fraction(num, den):
    return Fraction(np.array(num, float), np.array(den, float))


def at(block, w):
    return np.polyval(block.num, w) / np.polyval(block.den, w)


# The process behind its hold.


@pytest.mark.parametrize("part", [0.0, 0.25, 0.999])
@pytest.mark.parametrize("pole", [-3.0, 0.5])
def test_a_lag_with_a_fractional_delay_is_its_closed_form(pole, part):
    dt = 0.2
    held = held_process(fraction([2.0], [1.0, -pole]), (1 + part) * dt, dt)
    late = math.exp(pole * (1 - part) * dt)
    assert held.samples == 1 and held.fraction == pytest.approx(part, abs=1e-12)
    assert pytest.approx(2 * (late - 1) / pole, rel=1e-12) == held.C * held.B0
    second = 2 * late * (math.exp(pole * part * dt) - 1) / pole
    assert pytest.approx(second, rel=1e-10, abs=1e-15) == held.C * held.B1


def test_the_hold_is_that_of_scipy_without_dead_time():
    num, den, dt = [1.0, 3.0], [1.0, 2.0, 5.0, 0.0], 0.3
    held = held_in_w(fraction(num, den), dt)
    zs, ps, _ = cont2discrete((num, den), dt, "zoh")
    z = np.exp(1j * dt * np.array([0.1, 1.0, 5.0]))
    w = 2 / dt * (z - 1) / (z + 1)
    assert at(held, w) == pytest.approx(np.polyval(zs.ravel(), z) / np.polyval(ps, z), rel=1e-10)


@cache
def certified(num, den, delay, dt, omega):
    """The held process at exp(jω dt) with 60 digits."""
    with mp.workdps(60):
        n = len(den) - 1
        num = [mp.mpf(0)] * (n + 1 - len(num)) + [mp.mpf(x) / den[0] for x in num]
        den = [mp.mpf(x) / den[0] for x in den]
        A, B = mp.zeros(n, n), mp.zeros(n, 1)
        for k in range(n):
            A[0, k] = -den[k + 1]
        for k in range(1, n):
            A[k, k - 1] = 1
        B[0] = 1
        C = mp.matrix([[num[k + 1] - num[0] * den[k + 1] for k in range(n)]])

        def over(time):
            whole = mp.zeros(n + 1, n + 1)
            whole[:n, :n], whole[:n, n] = A * time, B * time
            both = mp.expm(whole)
            return both[:n, :n], both[:n, n]

        dt, delay = mp.mpf(dt), mp.mpf(delay)
        late, young = over(dt - delay)
        early, old = over(delay)
        z = mp.expj(mp.mpf(omega) * dt)
        state = mp.lu_solve(z * mp.eye(n) - late * early, young + late * old / z)
        return complex((C * state)[0] + num[0] / z), complex((z - 1) / (z + 1) * 2 / dt)


@pytest.mark.thorough
@pytest.mark.parametrize("dt", [1.0, 1e-2, 1e-5])
@pytest.mark.parametrize("part", [0.0, 0.625])
@pytest.mark.parametrize(
    ("num", "den"),
    [
        ((1.0,), (1.0, 4.0, 6.0, 4.0, 1.0)),
        ((1.0,), (1.0, 0.0, 0.0)),
        ((-0.1, 10.0), (1.0, 2.0)),
        ((4.0,), (-1.0, -1.0, 2.0)),
        ((1.0,), (1e-3, 1.0, 0.1, 0.0)),
    ],
)
def test_the_held_process_keeps_its_digits_at_any_sampling_time(num, den, part, dt):
    held = held_in_w(fraction(num, den), dt, fraction=part)
    for omega in (0.01, 0.9, 1 / dt, 3 / dt):
        if omega < math.pi / dt:
            value, w = certified(num, den, part * dt, dt, omega)
            assert at(held, w) == pytest.approx(value, rel=1e-12)


def test_a_mode_that_grows_beyond_all_digits_leaves_the_others_theirs():
    # exp(235) has 339 binary digits: with fewer, two precisions agree on slow poles that are wrong.
    poles = np.array([235.0, -0.5, -1.0, -2.0, -3.0])
    held = held_in_w(fraction([1.0], np.poly(poles)), 1.0)
    np.testing.assert_allclose(held.den, np.poly(2 * np.tanh(poles / 2)), rtol=1e-14)


def test_an_integrator_and_a_differentiator_stay_exact():
    assert held_in_w(fraction([1.0], [1.0, 1.0, 0.0]), 0.3).den[-1] == 0
    assert held_in_w(fraction([1.0, 0.0], [1.0, 3.0, 2.0]), 0.3, fraction=0.5).num[-1] == 0


def test_the_series_of_an_unstable_process_ends():
    # Rounded down, its last term would stay at -1 in the last digit for ever.
    den, dt = [1.0, 0.8785238977609302, -1.9886010147198556, -1.901535504894597], 1.5957739697585993
    held = held_in_w(fraction([-0.12797586, -0.8586237], den), dt, fraction=0.9510734755857962)
    expected = np.append(np.tanh(np.roots(den) * dt / 2), -1.0) * 2 / dt
    assert np.sort_complex(np.roots(held.den)) == pytest.approx(np.sort_complex(expected), rel=1e-9)


def test_a_whole_dead_time_turns_the_process_and_a_fraction_does_not():
    G, dt, w = 1 / (s + 1), 0.1, 1j * 7.0
    turn = (1 - w * dt / 2) / (1 + w * dt / 2)
    plain, late = (at(process_in_w(nrdob.delay(T) * G, dt), w) for T in (0.0, 0.3))
    assert late == pytest.approx(plain * turn**3, rel=1e-12)
    half = at(process_in_w(nrdob.delay(0.05) * G, dt), w)
    assert abs(half / plain - np.exp(-1j * math.atan(7.0 * dt / 2))) > 1e-3


# What the processor runs.


def test_blocks_are_those_of_python_control():
    loop, dt = paper.example(4), 0.05
    controller = loop.sampled(dt).controller
    z = np.exp(1j * dt * np.array([0.3, 4.0, 30.0]))
    s_blocks = {"C": loop.C.to_tf(), "F": loop.filter.tf, "F/Gm": loop.filter.tf / loop.model}
    for name, block in s_blocks.items():
        theirs = ct.sample_system(block, dt, "bilinear")
        ours = controller.blocks[name]
        pulse = ct.ss(ours.A, ours.B[:, None], ours.C[None], ours.D, dt)
        assert pulse(z) == pytest.approx(theirs(z), rel=1e-9)


def test_u_solves_the_diagram_that_has_it_on_both_sides():
    rng = np.random.default_rng(3)
    controller = paper.example(3).sampled(0.02).controller
    blocks, rows = controller.blocks, controller.rows
    x, (r, y) = rng.normal(size=controller.states), rng.normal(size=2)
    u = controller.C @ x + controller.D @ (r, y)

    def out(name, block, signal):
        return blocks[block].C @ x[rows[name]] + blocks[block].D * signal

    yf = out("F y", "F", y) + out("(1-F)Gm", "(1-F)Gm", u)
    assert u == pytest.approx(out("C", "C", r - yf) + out("F u", "F", u) - out("F/Gm", "F/Gm", y))


def test_an_observer_fed_with_the_applied_input_does_not_wind_up():
    sampled = paper.example(4).sampled(0.01)
    process, controller = sampled.process, sampled.controller
    observer = np.r_[controller.rows["F u"], controller.rows["F/Gm"]]
    assert np.abs(np.linalg.eigvals(controller.A[np.ix_(observer, observer)])).max() < 1
    assert process.samples == 5


def test_a_model_that_waits_whole_samples_leaves_a_matched_loop_its_model_loop():
    Gm = 1 / ((s + 1) * (0.5 * s + 1))
    late = nrdob.delay(0.6) * Gm
    sampled = nrdob.NRDOB(late, late, 0.8 * (s + 1) / s, nrdob.LowPassFilter(0.2, 2)).sampled(0.1)
    found = sampled.stability()
    images = [(1 + w * 0.05) / (1 - w * 0.05) for w in sampled.loop.p_A.roots]
    assert found.stable
    for root in images:
        assert np.abs(found.eigenvalues - root).min() < 1e-9


# Verdicts.


@cache
def drawn():
    rng = np.random.default_rng(11)
    return [campaign.draw(rng) for _ in range(25)]


@pytest.mark.slow
def test_verdicts_and_counts_are_those_of_brute_force():
    outcomes = [campaign.outcome(case) for case in drawn()]
    assert {each.split(",")[0] for each in outcomes} == {"stable", "not stable"}


@pytest.mark.slow
def test_our_own_matrix_has_the_poles_of_brute_force():
    for case in drawn()[:10]:
        sampled = case.sampled()
        ours = np.abs(np.linalg.eigvals(sampled.closed_loop.A)).max()
        assert ours == pytest.approx(np.abs(campaign.brute_force(case)).max(), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("number", NUMBERS)
def test_sampled_fast_a_loop_is_what_it_is_in_continuous_time(number):
    loop = paper.example(number)
    there = loop.margins().plant_loop
    gaps = []
    for dt in (1e-2, 1e-3):
        sampled = loop.sampled(dt * loop.filter.time_constant)
        assert sampled.stability().stable
        gaps.append(abs(sampled.margins().ms / there.ms - 1))
    assert gaps[1] < 0.2 * gaps[0] < 0.02


def test_the_verdict_prints_its_evidence():
    text = repr(paper.example(3).sampled(0.01).stability())
    assert text.splitlines()[:4] == [
        "Sampled NR-DOB loop: stable",
        "                N    P    Z   largest root z",
        "C Gm (i)        0    0    0   0.995 + 0.008022j",
        "F H (ii)       -1    1    0   0.9895",
    ]


def test_a_dead_time_of_a_thousand_samples_is_counted():
    loop = nrdob.NRDOB(nrdob.delay(1.0) / (s + 1), 1 / (s + 1), 1 / s, nrdob.LowPassFilter(0.4, 1))
    assert not loop.stability().stable
    assert loop.sampled(0.004).stability().observer_loop.closed_loop_rhp == (
        loop.stability().observer_loop.closed_loop_rhp
    )


LATE = nrdob.delay(10.0) / (20 * s + 1)


@pytest.mark.parametrize(("lam", "count"), [(8.0, 0), (5.0, 2)])
@pytest.mark.parametrize("samples", [1000, 10_000, 100_000])
def test_ten_seconds_of_dead_time_are_counted_at_any_rate_in_two_ways(samples, lam, count):
    loop = nrdob.NRDOB(LATE, 1 / (20 * s + 1), (20 * s + 1) / (40 * s), nrdob.LowPassFilter(lam, 1))
    found = loop.sampled(10 / samples).stability()
    assert found.observer_loop.closed_loop_rhp == count and found.stable is (count == 0)
    assert found.observer_loop.ways == (verdict.TURNS, verdict.SIZES) and not found.eigenvalues.size
    assert "states are left out" in repr(found).replace("\n ", "")
    # In the limit the largest root is the rightmost one of continuous time.
    rate = np.log(found.observer_loop.rightmost) * samples / 10
    rightmost = loop.stability().observer_loop.rightmost
    assert min(abs(rate - rightmost), abs(rate - rightmost.conjugate())) < 2 / samples


def test_a_real_largest_root_has_no_imaginary_part_of_rounding():
    process, F = nrdob.delay(10.0) / (s + 1), nrdob.LowPassFilter(30.0, 1)
    loop = nrdob.NRDOB(process, 1 / (s + 1), 0.05 / s, F)
    largest = loop.sampled(1e-3).stability().observer_loop.rightmost
    assert largest.imag == 0 and 0.999 < largest.real < 1


@pytest.mark.parametrize("size", [0.65, 0.7, 0.9, 1.3])
def test_an_argument_that_turns_with_the_dead_time_is_followed(size):
    for samples in range(1, 40):  # c + z^-N: all N zeros are outside, or none
        parts = Product((np.array([size]),)), Product((np.ones(1),), samples)
        assert count_outside(CircleFunction(parts)).count == (samples if size < 1 else 0)


@pytest.mark.thorough
def test_a_delayed_model_of_ten_thousand_samples_is_counted():
    model = nrdob.delay(10.0) / (20.5 * s + 1)
    loop = nrdob.NRDOB(LATE, model, (20 * s + 1) / (40 * s), nrdob.LowPassFilter(2.0, 1))
    found = loop.sampled(1e-3, computation_delay=1.5e-3).stability()
    assert found.stable and len(found.observer_loop.ways) == 2
    other = nrdob.NRDOB(LATE, nrdob.delay(9.0) * model.tf, loop.controller, loop.filter)
    found = other.sampled(1e-3).stability()
    assert found.stable is other.stability().stable and len(found.observer_loop.ways) == 1
    assert "no other second way" in found.reason


@pytest.mark.thorough
def test_without_eigenvalues_verdicts_and_counts_are_those_of_brute_force(monkeypatch):
    monkeypatch.setattr(verdict, "MOST_STATES", 0)
    monkeypatch.setattr(verdict, "MOST_ALONE", 0)
    outcomes = [campaign.outcome(case) for case in drawn()]
    assert {each.split(",")[0] for each in outcomes} == {"stable", "not stable"}


def test_a_model_with_an_integrator_is_built_without_it():
    model = 1 / (s * (s + 1))
    sampled = nrdob.NRDOB(model, model, 0.2, nrdob.LowPassFilter(0.5, 2)).sampled(0.1)
    inverse = sampled.controller.blocks["F/Gm"]
    dc_gain = inverse.D + inverse.C @ np.linalg.solve(np.eye(2) - inverse.A, inverse.B)
    assert sampled.stability().stable and np.abs(sampled.stability().eigenvalues).max() < 1
    assert dc_gain == pytest.approx(0.0, abs=1e-12)
    kept = nrdob.NRDOB(model, model, 0.2, nrdob.LowPassFilter(0.5, 2), keep_factors=True)
    assert kept.sampled(0.1).stability().stable is False


@pytest.mark.parametrize("process", [1 / (s * (s + 1)), 1 / (s + 1)])
def test_the_integrator_of_a_delayed_model_cancels_in_continuous_time_only(process):
    # On the processor it is fed with u - F W u, whose sum need not be 0 when u is at rest again.
    model = nrdob.delay(0.2) * (1 / (s * (s + 1)))
    F = nrdob.LowPassFilter(1.0, 2)
    loop = nrdob.NRDOB(nrdob.delay(0.2) * process, model, (s + 1) / (0.1 * s + 1), F)
    assert loop.built.poles.degree == 1 and loop.stability().observer_loop.closed_loop_rhp == 0
    found = loop.sampled(0.03).stability()
    assert found.stable is False and "z = 1, the delayed model's integrator" in found.reason
    assert np.abs(found.eigenvalues - 1).min() < 1e-9


@pytest.mark.slow
def test_a_process_that_only_amplifies_is_a_closed_form():
    # K = F/(1 - F) = 1/s: z (z - 1) + dt (z + 1) = 0, whose roots have the product dt.
    loop = nrdob.NRDOB(ct.tf([2], [1]), ct.tf([1], [1]), 0.5 / s, nrdob.LowPassFilter(1.0, 1))
    assert largest_sampling_time(loop) == pytest.approx(1.0, rel=1e-9)
    assert loop.sampled(1 - 1e-6).stability().stable
    assert loop.sampled(0.1).margins().gm == pytest.approx(10.0, rel=1e-9)


def test_the_dead_time_of_a_process_that_only_amplifies_goes_by_samples():
    # With d whole samples of it, and a part of one, z^(d + 1) (z - 1) + dt (z + 1) = 0.
    loop = nrdob.NRDOB(ct.tf([2], [1]), ct.tf([1], [1]), 0.5 / s, nrdob.LowPassFilter(1.0, 1))

    def largest(samples):
        late = np.append(np.array([1.0, -1.0]), np.zeros(samples + 1))
        return np.abs(np.roots(np.polyadd(late, [0.1, 0.1]))).max()

    first = next(d for d in range(50) if largest(d) > 1)
    margins = loop.sampled(0.1).margins()
    assert margins.delay_margin == pytest.approx(0.1 * first, rel=1e-6)


@pytest.mark.slow
def test_it_does_so_where_another_crossing_is_200_samples_off():
    F = nrdob.filter_family("butterworth", 12).at(0.785)
    model, C = ct.tf([39], [1, 11, 27, 0]), ct.tf([1.15, 0.2], [1, 0])
    sampled = nrdob.NRDOB(ct.tf([-0.87], [1]), model, C, F).sampled(0.035, "tustin", 0.3 * 0.035)
    assert sampled.margins().delay_margin == pytest.approx(0.7 * 0.035 + 0.035, rel=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("lag", "lam", "dt"), [(0.0, 1.0, 0.05), (0.0, 2.0, 0.2), (0.01, 1.0, 0.1), (0.1, 1.0, 0.2)]
)
def test_a_loop_that_is_unstable_for_a_part_of_a_sample_only_has_its_margin_there(lag, lam, dt):
    process = (s + 1) / (s + 2) / (lag * dt * s + 1)
    loop = nrdob.NRDOB(process, 1 / (s + 1), 0.2 / s, nrdob.LowPassFilter(lam, 1))
    margin = loop.sampled(dt).margins().delay_margin

    def radius(late):
        return np.abs(campaign.brute_force(campaign.Case(loop, dt, late))).max()

    assert max(map(radius, np.arange(0, margin - 1e-4 * dt, 0.05 * dt))) < 1
    assert radius(margin * (1 + 1e-6)) > 1 - 1e-12


def test_an_unstable_process_that_grows_too_far_within_a_sample_is_refused():
    loop = nrdob.NRDOB(1 / (s - 1), 1 / (s + 1), 1.0, nrdob.LowPassFilter(0.5, 1))
    with pytest.raises(ValueError, match="choose a shorter dt"):
        loop.sampled(1e4).stability()
    assert np.isnan(loop.sampled(50.0).step_response("R", 2000.0).outputs).any()


def test_a_root_at_z_equal_to_1_is_said_and_not_counted():
    loop = nrdob.NRDOB(s / (s + 1) ** 2, 1 / (s + 1), 1 / s, nrdob.LowPassFilter(0.4, 1))
    found = loop.sampled(0.1).stability()
    assert found.stable is not True and "z = 1" in found.observer_loop.reason


# Margins.


@pytest.mark.slow
@pytest.mark.parametrize("number", NUMBERS)
def test_margins_are_where_the_loop_is_lost(number):
    loop = paper.example(number)
    dt = loop.filter.time_constant / 3
    late = 0.3 * dt
    margins = loop.sampled(dt, computation_delay=late).margins()
    assert margins.stable and margins.wgc < math.pi / dt
    for gain in (margins.gm_low, margins.gm_high):
        for beyond in (0.999, 1.001):
            if gain and gain < math.inf:
                process = (gain * beyond) * loop.process
                other = nrdob.NRDOB(process, loop.model, loop.controller, loop.filter)
                inside = (beyond < 1) == (gain > 1)
                assert other.sampled(dt, computation_delay=late).stability().stable is inside
    for beyond in (0.999, 1.001):
        later = late + beyond * margins.delay_margin
        assert loop.sampled(dt, computation_delay=later).stability().stable is (beyond < 1)


def test_margins_are_those_of_python_control_at_a_delay_of_one_sample():
    loop, dt = paper.example(1), 0.005
    L = (
        ct.sample_system(loop.K.to_tf(), dt, "tustin")
        * ct.sample_system(ct.ss(loop.process), dt, "zoh")
        * ct.tf([1], [1, 0], dt)
    )
    ours = loop.sampled(dt, computation_delay=dt).margins()
    gm, pm, wpc, wgc = ct.margin(L)
    assert [ours.gm, ours.pm, ours.wpc, ours.wgc] == pytest.approx([gm, pm, wpc, wgc], rel=1e-6)
    grid = np.exp(1j * np.linspace(0.01, math.pi, 20_000))
    assert ours.sm == pytest.approx(np.abs(1 + L(grid)).min(), rel=1e-6)


@pytest.mark.slow
def test_the_delay_margin_is_looked_for_only_where_it_is_asked_for(monkeypatch):
    found = paper.example(4).sampled(0.02).margins()
    again = pickle.loads(pickle.dumps(found))
    assert again.delay_margin == found.delay_margin > 0
    monkeypatch.setattr(ClosedLoop, "spectral_radius", None)
    other = paper.example(4).sampled(0.02).margins()
    assert other.ms == found.ms and other.pm == found.pm
    with pytest.raises(TypeError):
        _ = other.delay_margin


def test_an_unstable_loop_has_no_margins():
    margins = paper.example(3).sampled(0.06).margins()
    assert margins.stable is False and math.isnan(margins.gm) and math.isnan(margins.delay_margin)


# How slowly, and with which filters.


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("number", "ratio"),
    [
        *(pytest.param(*known, marks=pytest.mark.slow) for known in ((1, 4.027499), (2, 4.422033))),
        (3, 0.957231),
        (4, 6.684925),
    ],
)
def test_the_largest_sampling_time_of_the_examples(number, ratio):
    loop = paper.example(number)
    longest = largest_sampling_time(loop)
    assert longest / loop.filter.time_constant == pytest.approx(ratio, rel=1e-6)
    for beyond in (1 - 1e-8, 1 + 1e-8):
        case = campaign.Case(loop, longest * beyond, 0.0)
        assert bool((np.abs(campaign.brute_force(case)) < 1).all()) is (beyond < 1)


def test_where_the_sampled_controller_is_lost_under_zoh_is_a_closed_form():
    # Example 2: C Gm = 5/s, so z1 z2 = a + 5 (1 - a)(dt - 0.5), a = exp(-2 dt), which is 1 at 0.7.
    for dt in (0.7 * (1 - 1e-9), 0.7 * (1 + 1e-9)):
        assert paper.example(2).sampled(dt, "zoh").stability().stable is (dt < 0.7)


@pytest.mark.slow
def test_the_end_in_dt_is_an_end_of_the_set_of_time_constants():
    loop = paper.example(3)
    dt = largest_sampling_time(loop)
    ends = nrdob.stabilizing_time_constants(loop.process, loop.model, 2, dt=dt)
    assert np.abs(np.ravel(ends) / loop.filter.time_constant - 1).min() < 1e-8


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("late", [0.0, 0.35, 2.0])
def test_sets_of_time_constants_are_where_brute_force_is_stable(number, late):
    loop, dt, order = paper.example(number), 0.02, paper.example(number).filter.order
    found = nrdob.stabilizing_time_constants(
        loop.process, loop.model, order, dt=dt, computation_delay=late * dt
    )
    ends = [end for end in np.ravel(found) if 0 < end < math.inf]
    assert ends
    for end in ends:
        inside = []
        for beyond in (1 - 1e-6, 1 + 1e-6):
            F = nrdob.LowPassFilter(end * beyond, order)
            case = campaign.Case(
                nrdob.NRDOB(loop.process, loop.model, loop.controller, F), dt, late * dt
            )
            stable = bool((np.abs(campaign.brute_force(case)) < 1).all())
            inside.append(stable)
            assert stable == any(low < end * beyond < high for low, high in found)
        assert inside[0] != inside[1]


def test_sets_tend_to_those_of_continuous_time():
    loop = paper.example(3)
    ((low, high),) = nrdob.stabilizing_time_constants(loop.process, loop.model, 2, dt=1e-6)
    assert low < 1e-5 and high == pytest.approx(3 - math.sqrt(5), rel=1e-5)


def test_at_the_ends_of_a_set_poles_are_on_the_circle():
    loop, dt = paper.example(3), 0.05
    for end in nrdob.stabilizing_time_constants(loop.process, loop.model, 2, dt=dt)[0]:
        F = nrdob.LowPassFilter(end, 2)
        loop_there = nrdob.NRDOB(loop.process, loop.model, loop.controller, F)
        poles = campaign.brute_force(campaign.Case(loop_there, dt, 0.0))
        assert np.abs(np.abs(poles) - 1).min() < 1e-6


# Blocks behind a hold.


def test_zoh_is_refused_where_the_sampling_makes_zeros_outside():
    for model in (1 / s**2, 1 / (s + 1) ** 3):
        order = model.den[0][0].size - 1
        loop = nrdob.NRDOB(model, model, 1.0, nrdob.interpolating_filter(model, 0.5, ramp=order)
                           if order == 2 else nrdob.LowPassFilter(0.5, order))  # fmt: skip
        with pytest.raises(ValueError, match=r"only the sampling has made.*tustin"):
            loop.sampled(0.01, "zoh")


def test_zoh_takes_a_model_of_relative_degree_one_and_its_matched_loop_is_the_filter():
    G = (s + 3) / ((s + 1) * (s + 2))
    loop = nrdob.NRDOB(G, G, 1 / s, nrdob.LowPassFilter(0.3, 1))
    found = loop.sampled(0.2, "zoh").stability()
    assert found.stable
    # p_B = Nm D Df: of the roots the one of the filter is exp(-dt/λ).
    assert np.abs(found.observer_loop.roots - math.exp(-0.2 / 0.3)).min() < 1e-5


# Responses.


@pytest.mark.parametrize("input", ["R", "d", "delta", "eta"])
@pytest.mark.parametrize("process", [nrdob.delay(0.15) * 3 / (s**2 + s + 2), (1 - s) / (s + 2)])
def test_between_the_samples_the_process_answers_to_what_was_held(process, input):
    model = 1 / (s + 1) if isinstance(process, ct.TransferFunction) else 2 / (s + 1) ** 2
    order = model.den[0][0].size - 1
    loop = nrdob.NRDOB(process, model, 0.2 / s, nrdob.LowPassFilter(2.0, order))
    dt, late = 0.1, 0.05
    fine = np.arange(0, 201) * dt / 4
    y, u = loop.sampled(dt, computation_delay=late).step_response(input, fine).outputs[:, 0]
    # What enters the process, held over each quarter of a sample, by scipy.
    shift = round(loop.delay / (dt / 4))
    G = loop.fractions.G
    entered = np.concatenate([np.zeros(shift), u])[: fine.size]
    theirs = lsim((G.num, G.den), entered, fine, interp=False)[1]
    if G.num.size == G.den.size:
        theirs = theirs.ravel()
    assert y == pytest.approx(theirs + (input == "d"), abs=1e-9)
    # And u is what the processor makes of the samples, one delay of computation later.
    held = u[2::4][: u[4::4].size] - (input == "delta")
    assert u[4::4] - (input == "delta") == pytest.approx(held, abs=1e-12)


def test_a_response_settles_where_the_continuous_one_does():
    for number in NUMBERS:
        loop = paper.example(number)
        found = loop.sampled(loop.filter.time_constant / 2).step_response("R")
        assert found.outputs[0, 0, -1] == pytest.approx(1.0, abs=0.02)


# Bad input.


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"dt": 0.0}, ValueError, "dt is 0.0; the sampling time is a positive"),
        ({"dt": -1.0}, ValueError, "positive"),
        ({"dt": math.nan}, ValueError, "positive, finite"),
        ({"dt": "1"}, TypeError, "the sampling time is a positive, finite number of seconds"),
        ({"computation_delay": -0.1}, ValueError, "0 or more"),
        ({"computation_delay": math.inf}, ValueError, "finite"),
        ({"method": "euler"}, ValueError, "choose one of tustin, zoh"),
    ],
)
def test_bad_input_is_named_with_its_remedy(change, error, message):
    with pytest.raises(error, match=message):
        paper.example(1).sampled(**({"dt": 0.1} | change))


def test_a_pole_that_tustin_maps_to_infinity_is_refused():
    loop = nrdob.NRDOB(1 / (s - 1), 1 / (s + 1), 1 / (s - 20), nrdob.LowPassFilter(0.1, 1))
    with pytest.raises(ValueError, match=r"C has a pole at 20 rad/s.*another dt"):
        loop.sampled(0.1)


def test_an_algebraic_loop_without_solution_is_refused():
    # 1 + C·model = 0 at z = ∞, that is at s = 2/dt = 20: C = -(20 + 1).
    loop = nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), -21.0, nrdob.LowPassFilter(0.1, 1))
    with pytest.raises(ValueError, match="ill-posed"):
        loop.sampled(0.1)


def test_a_mode_at_the_nyquist_frequency_is_refused():
    with pytest.raises(ValueError, match=r"Nyquist|stiff"):
        held_in_w(fraction([1.0], [1.0, 0.0, (math.pi / 0.5) ** 2]), 0.5)


def test_sets_say_which_dead_times_they_do_not_take():
    G = 1 / (s + 1)
    ask = nrdob.stabilizing_time_constants
    with pytest.raises(ValueError, match=r"holds 1000 samples.*longer dt"):
        ask(nrdob.delay(1.0) * G, G, 1, dt=1e-3)
    with pytest.raises(ValueError, match=r"model has a dead time, and a pole that is not"):
        ask(G, nrdob.delay(1.0) / s, 1, dt=0.1)
    with pytest.raises(ValueError, match="give its sampling time dt"):
        ask(G, G, 1, computation_delay=0.1)


@pytest.mark.thorough
def test_a_matched_loop_behind_a_hold_is_stable_however_slow_the_samples():
    # The model's loop has its root at exp(-T) - 0.1 (1 - exp(-T)), within the circle for every T.
    model = 1 / (s + 1)
    loop = nrdob.NRDOB(model, model, 0.1, nrdob.LowPassFilter(1.0, 1))
    assert largest_sampling_time(loop, "zoh") == math.inf


@pytest.mark.slow
def test_behind_a_hold_a_matched_loop_ends_where_its_model_loop_does():
    # What F and the model wait for cancels in F/Gm, however little is left of F after a sample.
    loop = paper.example(1)
    end = largest_sampling_time(loop, "zoh")
    for dt, stable in ((0.999 * end, True), (1.001 * end, False)):
        C, model = (ct.c2d(block, dt, "zoh") for block in (loop.controller, loop.model))
        assert (np.abs(ct.poles(ct.feedback(C * model))).max() < 1) is np.bool_(stable)
        assert loop.sampled(dt, method="zoh").stability().stable is stable


@pytest.mark.parametrize("order", [1, 2, 5])
def test_behind_a_hold_a_filter_of_which_a_sample_leaves_nothing_is_a_delay(order):
    # F = 1/z then, so that 1 - F is 1 - 1/z and the observer loop of a wrong gain k has k/z - 1/z.
    G, model = ct.tf([1.5], [1.0, 1.0]), ct.tf([1.0], [1.0, 1.0])
    loop = nrdob.NRDOB(G, model, 0.1, nrdob.LowPassFilter(1e-4, order))
    sampled = loop.sampled(1.0, method="zoh")
    assert sampled.stability().stable is True
    poles = np.linalg.eigvals(sampled.closed_loop.A)
    assert np.abs(poles + 0.5).min() < 1e-6  # z - 1 + 1.5 = 0


def test_a_loop_that_is_not_stable_has_no_largest_sampling_time():
    loop = nrdob.NRDOB(1 / (s - 1), 1 / (s + 1), 1.0, nrdob.LowPassFilter(5.0, 1))
    with pytest.raises(ValueError, match="not stable in continuous time"):
        largest_sampling_time(loop)
    with pytest.raises(ValueError, match=r"with 9 s of computation"):
        largest_sampling_time(paper.example(4), computation_delay=9.0)


@pytest.mark.parametrize("part", [0.0, 0.25])
def test_a_gain_behind_its_hold_takes_no_time_however_slow_the_samples(part):
    # When y is read the input is still the last one: g/z with 1/z = (1 - v)/(1 + v).
    gain = Fraction(np.array([3.0]), np.array([1.0]))
    for dt in (1e-9, 1.0, 1e9):
        num, den = held_in_w(gain, dt, fraction=part)
        v = 0.3
        value = np.polyval(num, 2 * v / dt) / np.polyval(den, 2 * v / dt)
        assert value == pytest.approx(3 * (1 - v) / (1 + v), rel=1e-12)


def test_the_search_begins_with_few_samples_in_the_dead_time_of_the_model_too():
    lag = ct.tf([1.0], [1.0, 1.0])
    loop = nrdob.NRDOB(lag, nrdob.delay(3.0) * lag, 0.1, nrdob.LowPassFilter(0.003, 1))
    tracemalloc.start()
    with pytest.raises(ArithmeticError, match="1 root outside the unit circle"):
        largest_sampling_time(loop)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 50e6  # at 0.02 λ the model alone would hold 50 000 samples


@pytest.mark.parametrize("times", [-1.0, [0.0, 2.0, 1.0], [-1.0, 0.0], [0.0, math.nan], []])
def test_times_that_do_not_increase_from_0_are_refused(times):
    with pytest.raises(ValueError, match="timepts must be increasing times from 0 on"):
        paper.example(1).sampled(0.1).step_response("R", times)


def test_a_zero_on_the_circle_is_not_counted_but_told_by_its_angle():
    # v² + 1 has its zeros at v = ±j, where z = (1 + v)/(1 - v) = ±j.
    found = count_outside(CircleFunction((Product((np.array([1.0, 0.0, 1.0]),)),)))
    assert found.count is None and found.angle == pytest.approx(math.pi / 2)


def test_a_sampled_loop_that_is_unstable_says_so_in_its_reason():
    found = paper.example(3).sampled(0.06).stability()
    largest = np.abs(found.eigenvalues)
    assert found.stable is False
    assert found.reason == f"F H (ii): {np.sum(largest > 1)} roots outside the unit circle"


def test_two_ways_that_differ_give_no_verdict(monkeypatch):
    monkeypatch.setattr(verdict, "count_outside", lambda p_B: TurnCount(3))
    found = paper.example(1).sampled(0.01).stability()
    assert found.stable is None and "3 roots are outside the unit circle" in found.reason
    assert f"{verdict.EIGENVALUES} 0: no verdict" in found.reason


def test_a_second_way_that_finds_nothing_gives_no_verdict(monkeypatch):
    monkeypatch.setattr(verdict.DelayedPair, "count", lambda self: None)
    C, F = (20 * s + 1) / (40 * s), nrdob.LowPassFilter(8.0, 1)
    found = nrdob.NRDOB(LATE, 1 / (20 * s + 1), C, F).sampled(0.01).stability()
    assert found.stable is None and f"{verdict.SIZES} nothing: no verdict" in found.reason


def test_where_every_sampling_time_fails_the_reason_is_said():
    lag = nrdob.delay(3.7) * ct.tf([1.0], [1.0, 1.0])
    waiting = nrdob.NRDOB(lag, lag, 0.1, nrdob.LowPassFilter(1.0, 1))
    with pytest.raises(ValueError, match="use method='tustin'"):
        largest_sampling_time(waiting, "zoh")
    model = nrdob.delay(0.5) * ct.tf([1.0], [1.0, 1.0, 0.0])
    integrating = nrdob.NRDOB(model, model, 0.2, nrdob.LowPassFilter(1.0, 2))
    with pytest.raises(ArithmeticError, match="a root at z = 1, the delayed model's integrator"):
        largest_sampling_time(integrating)
    # So short a dt for so short a dead time that the filter's eigenvalues stray over the circle.
    Gm = ct.tf([1.0, 5.0], [1.0, 3.6])
    stiff = nrdob.NRDOB(nrdob.delay(1e-6) * Gm, Gm, 1.4, nrdob.LowPassFilter(0.08, 5))
    with pytest.raises(ArithmeticError, match="no verdict; judge the dt at hand"):
        largest_sampling_time(stiff, "zoh")
