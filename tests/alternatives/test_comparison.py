"""The table: the same limits for all, every number as its own function gives it, no row raises."""

from dataclasses import replace
from functools import cache
from math import inf, isnan, sqrt

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import delay
from nrdob.alternatives import (
    Comparison,
    Row,
    candidates,
    controller_alone,
    linear_adrc,
    load_errors,
    simc_pi,
    tune,
)
from nrdob.alternatives.measures import step_peak
from nrdob.diagram import DelayedTransferFunction

s = ct.tf("s")
NOISE = ct.tf([1], [0.02, 1])


@cache
def examples(number):
    loop = nrdob.paper.example(number)
    each = candidates(loop.process, loop.model, loop.controller, loop.filter.order)
    changed = {} if number == 1 else {"modified": nrdob.paper.example(number, True).process}
    deviation = sqrt(loop.noise_variance(NOISE).u)
    return loop, nrdob.compare(
        loop.process, each | {"as printed": loop}, changed=changed, shaping=NOISE,
        max_ms=1.6, max_noise=deviation,
    )  # fmt: skip


@pytest.mark.thorough
@pytest.mark.parametrize("number", [2, 4])
def test_every_candidate_keeps_to_the_limits_and_is_at_one_of_them(number):
    loop, found = examples(number)
    deviation = sqrt(loop.noise_variance(NOISE).u)
    tuned = [row for row in found.rows if row.tuning]
    assert len(tuned) >= 4
    for row in tuned:
        assert row.ms <= 1.6 * (1 + 1e-6) and sqrt(row.noise_u) <= deviation * (1 + 1e-6)
        assert max(row.ms / 1.6, sqrt(row.noise_u) / deviation) > 1 - 1e-6


@pytest.mark.thorough
def test_the_numbers_are_those_of_the_loop():
    loop, found = examples(4)
    row = found["as printed"]
    margins = loop.margins().plant_loop
    assert (row.ms, row.delay_margin) == pytest.approx((margins.ms, margins.delay_margin), rel=1e-9)
    assert (row.iae, row.ise) == pytest.approx(tuple(load_errors(loop)), rel=1e-6)
    assert (row.noise_y, row.noise_u) == pytest.approx(tuple(loop.noise_variance(NOISE)), rel=1e-9)
    assert row.peak_u == pytest.approx(step_peak(loop), rel=1e-9)
    changed = nrdob.paper.example(4, modified=True).margins().plant_loop.ms
    assert found.column("modified")["as printed"] == pytest.approx(changed, rel=1e-9)


@pytest.mark.slow
def test_an_unstable_plant_has_rows_that_say_why():
    _, found = examples(3)
    assert "stable or integrating processes: use an observer" in found["PI"].reason
    reason = "the loop is unstable with every gain of C tried, from 100 to 0.01"
    assert found["C alone"].reason.startswith(reason)
    assert found["as printed"].stable and isnan(found["PI"].ms)
    assert found.column("stable")["PI"] is None


PLANTS = {
    "an integrator that answers late": (delay(0.5) / s, 1 / s, 0.5),
    "a double integrator": (2 / s**2, 2 / s**2, (3 * s + 1) / (s + 3)),
    "a resonance": (4 / (s**2 + 0.1 * s + 4), 4 / (s**2 + 2 * s + 4), 0.5 / s),
    "a long dead time": (delay(20) / (s + 1), 1 / (s + 1), 0.05 / s),
    "an inverse response": (
        (1 - s) / ((s + 1) * (2 * s + 1)),
        1 / ((s + 1) * (2 * s + 1)),
        0.3 / s,
    ),
    "an unstable plant that answers late": (delay(0.1) / (s - 1), -1 / (s + 1), -2 * (s + 1) / s),
    "a plant without dynamics": (ct.tf([2], [1]), 1 / (s + 1), 1 / s),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", PLANTS)
def test_nothing_raises_on_plants_that_nobody_prepared(name):
    G, Gm, C = PLANTS[name]
    each = candidates(G, Gm, C)
    found = nrdob.compare(G, each, max_ms=1.8)
    for row in found.rows:
        assert bool(row.reason) == isnan(row.ms) and (row.reason or row.ms <= 1.8 * (1 + 1e-6))
    assert len(found.rows) == len(each)


def test_an_observer_that_cannot_do_says_what_it_needs():
    G, Gm, C = PLANTS["a double integrator"]
    with pytest.raises(
        ValueError, match=r"the model has 2 integrators, .* take a filter with 1 - F"
    ):
        tune(candidates(G, Gm, C)["NR-DOB"], max_ms=1.8)


def test_b0_is_that_of_two_lags_where_there_are_more():
    G = 3 / ((s + 1) * (0.5 * s + 1) * (0.2 * s + 1))  # τ2 = 0.5 + 0.2/2
    adrc = candidates(G, 1 / (s + 1) ** 3, 1 / s)["ADRC"].build(8.0)
    by_hand = linear_adrc(G, 2, 3 / 0.6, 8.0, 2.0)
    np.testing.assert_allclose(
        adrc.L(1j * np.array([0.1, 3.0])), by_hand.L(1j * np.array([0.1, 3.0]))
    )


def test_a_plant_that_makes_the_loop_unstable_says_so_in_the_table():
    loop = nrdob.paper.example(2)
    away = {"three times the gain": 3 * loop.process, "ten times": 10 * loop.process}
    found = nrdob.compare(loop.process, {"NR-DOB": loop}, changed=away)
    stable = [nrdob.NRDOB(plant, loop.model, loop.controller, loop.filter).stability().stable
              for plant in away.values()]  # fmt: skip
    assert [not isnan(ms) for ms in found["NR-DOB"].changed.values()] == stable
    assert "unstable" in repr(found)
    by_hand = Comparison((Row("PI", "", True, ""),), ("three times the gain",))
    assert "unstable" in repr(by_hand) and hash(by_hand) == hash(replace(by_hand))


@pytest.mark.slow
def test_the_table_prints_and_is_written():
    _, found = examples(4)
    assert repr(found).splitlines()[0].split()[:2] == ["tuning", "Ms"]
    assert "<table>" in found._repr_html_() and "Ms, modified" in found._repr_html_()
    with pytest.raises(ValueError, match="there is no column 'cost'; choose one of"):
        found.column("cost")
    with pytest.raises(KeyError, match="there is no scheme 'MPC'"):
        found["MPC"]


@pytest.mark.slow
def test_only_the_columns_that_are_asked_for_are_printed():
    _, found = examples(4)
    few = found.only("modified", "iae")
    assert repr(few).splitlines()[0].split() == ["tuning", "Ms,", "modified", "IAE"]
    assert few["PI"] is found["PI"] and "noise on u" not in few._repr_html_()
    with pytest.raises(ValueError, match="there is no column 'cost'; choose from ms, delay_margin"):
        found.only("iae", "cost")


def test_reasons_are_text_in_the_html():
    loop = nrdob.paper.example(3)
    each = candidates(loop.process, loop.model, loop.controller)
    found = nrdob.compare(loop.process, {"<b>": each["PI"]}, max_ms=2.0)
    assert "&lt;b&gt;" in found._repr_html_() and "<b>" not in found._repr_html_()


@pytest.mark.slow
def test_limits_that_do_not_limit_are_named():
    loop = nrdob.paper.example(1)
    each = candidates(loop.process, loop.model, loop.controller, 2)
    found = tune(each["NR-DOB"], max_ms=1.6)
    assert found.text == "λ = 0.001 s, no limit"
    found = tune(each["NR-DOB"], max_ms=1.6, max_noise=10.0)
    assert not found.text.endswith("no limit")
    assert sqrt(found.loop.noise_variance().u) == pytest.approx(10.0, rel=1e-6)
    with pytest.raises(
        ValueError, match=r"max_noise = 1e-09 is not kept .*: missed by a factor of"
    ):
        tune(each["ADRC"], max_noise=1e-9)
    with pytest.raises(ValueError, match="white noise comes to u directly"):
        tune(each["PID"], max_noise=5.0)


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({}, ValueError, "nothing limits the candidates: give max_ms or max_noise"),
        ({"max_ms": 0.9}, ValueError, "max_ms is 0.9; give a finite number above 1"),
        ({"max_noise": -1}, ValueError, "max_noise is -1; give a finite number above 0"),
        ({"max_ms": "2"}, TypeError, "max_ms is '2', a str"),
    ],
)
def test_limits_must_be_limits(given, error, message):
    loop = nrdob.paper.example(1)
    each = candidates(loop.process, loop.model, loop.controller)
    with pytest.raises(error, match=message):
        nrdob.compare(loop.process, each, **given)


def test_a_loop_that_is_all_but_unstable_is_no_error():
    loop = controller_alone(1 / (s + 1e-7), 1 / (s + 1e-7), 4 / s)  # 3e7 swings to settle
    row = nrdob.compare(loop.process, {"C": loop})["C"]
    assert row.stable and row.reason.startswith("stable, but ")


@pytest.mark.slow
def test_c_alone_is_held_back_by_the_process_and_not_by_the_model():
    process = ct.tf([1.257, 2.864], [0.3166, 2.012, 2.685, 1])
    model, C = ct.tf([2.864], [0.3166, 2.012, 2.685, 1]), ct.tf([0.99, 0.686], [1, 0])
    found = tune(candidates(process, model, C, 3)["C alone"], max_ms=1.894)
    assert not (1 / (1 + found.value * C * model)).poles().real.max() < 0
    L = found.value * C * process
    seen = np.abs(1 / (1 + L(1j * np.geomspace(0.01, 100, 20_000)))).max()
    assert seen == pytest.approx(1.894, rel=1e-4)
    assert (1 / (1 + L)).poles().real.max() < 0


def test_only_loops_and_candidates_are_compared():
    with pytest.raises(TypeError, match="candidates must be a dict of names to NRDOB loops"):
        nrdob.compare(1 / (s + 1), {"PI": ct.tf([1], [1, 0])}, max_ms=2.0)
    with pytest.raises(TypeError, match="changed is a list; give a dict of names to plants"):
        nrdob.compare(1 / (s + 1), {}, changed=[1 / (s + 1)])
    with pytest.raises(TypeError, match=r"candidate is a NRDOB; give one of nrdob\.alt"):
        tune(nrdob.paper.example(1), max_ms=2.0)
    with pytest.raises(ValueError, match="late is identically zero"):
        nrdob.compare(1 / (s + 1), {}, changed={"late": ct.tf([0], [1])})


def test_noise_without_roll_off_is_infinite_in_the_table():
    loop = simc_pi(1 / (s + 1), 1.0)
    row = nrdob.compare(loop.process, {"PI": loop})["PI"]
    assert row.noise_u == inf and np.isfinite(row.noise_y)


def from_the_blocks(loop, w, tau):
    """G and K at s = jw, or right of it, from what was put in, with nothing of the package."""
    G, dead = loop.process, 0.0
    if isinstance(G, DelayedTransferFunction):
        G, dead = G.tf, G.delay
    F = getattr(loop.filter, "tf", loop.filter)
    late = getattr(loop.model, "delay", 0.0)
    Gm = getattr(loop.model, "tf", loop.model)
    Gm = ct.tf(*Gm) if isinstance(Gm, tuple) else Gm
    num, den = F.num[0][0], F.den[0][0]
    open_ = np.polyval(np.polysub(den, num), w) + np.polyval(num, w) * -np.expm1(-late * w)
    return G(w) * np.exp(-dead * w), np.polyval(num, w) / open_ / Gm(w), 1 / (tau * w + 1)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(8))
def test_the_numbers_are_those_of_a_grid_and_of_a_numerical_inverse_transform(seed):
    rng = np.random.default_rng(seed)
    lags = np.sort(10 ** rng.uniform(-0.5, 0.5, 2))
    undelayed = ct.tf([rng.uniform(0.5, 2)], np.convolve([lags[0], 1], [lags[1], 1]))
    G, tau = delay(float(rng.uniform(0.1, 0.5))) * undelayed, 0.05
    C = ct.tf([lags[1], 1], [float(rng.uniform(3, 5)), 0])
    name = ["NR-DOB", "conventional observer", "Smith predictor", "PI", "PID", "C alone", "ADRC"][
        seed % 7
    ]
    each = candidates(G, undelayed, C, 2)
    found = nrdob.compare(G, {name: each[name]}, shaping=ct.tf([1], [tau, 1]), max_ms=1.5)[name]

    x = np.linspace(np.log(1e-5), np.log(1e6), 400_001)
    w = np.exp(x)
    Gw, K, shaping = from_the_blocks(found.loop, 1j * w, tau)
    S = 1 / (1 + Gw * K)
    assert np.abs(S).max() == pytest.approx(1.5, rel=1e-5) == found.ms
    noise = [np.trapezoid(np.abs(part * S * shaping) ** 2 * w, x) / np.pi for part in (Gw * K, K)]
    assert [found.noise_y, found.noise_u] == pytest.approx(noise, rel=1e-3)

    # y after a unit step of the load, as a damped Fourier series of period 2 T.
    T, samples = 3 * found.loop.step_response("delta").time[-1], 1 << 17
    dt, shift = 2 * T / samples, np.log(1e10) / (2 * T)
    p = shift + 2j * np.pi * np.arange(samples // 2 + 1) / (2 * T)
    Gp, K, _ = from_the_blocks(found.loop, p, tau)
    t = np.arange(samples // 2) * dt
    y = np.fft.irfft(Gp / (1 + Gp * K) / p)[: t.size] / dt * np.exp(shift * t)
    errors = np.trapezoid(np.abs(y), t), np.trapezoid(y**2, t)
    assert (found.iae, found.ise) == pytest.approx(errors, rel=1e-3)
