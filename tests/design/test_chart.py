"""Stability charts: closed forms on the borders, and every region's count at random points."""

from __future__ import annotations

from math import inf, pi, sqrt

import control as ct
import numpy as np
import pytest
from matplotlib.collections import QuadMesh

import nrdob
from campaigns.charts import campaign, region_at
from nrdob import LowPassFilter, filter_family, paper, stability_chart, stabilizing_time_constants
from nrdob.design.chartborders import ChartLoops
from nrdob.design.chartcurves import Axis, Border, cut

s = ct.tf("s")
lag = 1 / (s + 1)

EXAMPLE_4 = paper.example(4)
RANGES = {
    "time_constant": (0.005, 0.5),
    "gain": (0.1, 10.0),
    "delay": (0.0, 0.2),
    "lag": (0.0, 0.3),
}
PAIRS = [(a, b) for a in RANGES for b in RANGES if a != b]


def wrong_points(chart, count, seed, least=0.8):
    """Points off the borders at which the region's count is not the loop's."""
    rng, wrong, seen = np.random.default_rng(seed), [], 0
    for u, v in rng.random((count, 2)):
        x, y = float(chart.x.value(u)), float(chart.y.value(v))
        region = region_at(chart, x, y)
        if region is not None:
            seen += 1
            if region.count != chart.count(x, y):
                wrong.append((x, y))
    assert seen > least * count
    return wrong


@pytest.mark.thorough
@pytest.mark.parametrize("pair", PAIRS)
def test_every_region_of_example_4_has_its_count(pair):
    x, y = ((name, *RANGES[name]) for name in pair)
    chart = stability_chart(EXAMPLE_4.process, EXAMPLE_4.model, EXAMPLE_4.filter, x=x, y=y)
    assert wrong_points(chart, 42, 1) == []


@pytest.mark.slow
def test_every_region_of_an_unstable_plant_under_its_interpolating_family_has_its_count():
    model = 4 / (2 - s - s**2)
    family = filter_family("interpolating", model=model)
    chart = stability_chart(
        model, model, family, x=("time_constant", 0.02, 2.0), y=("delay", 0.0, 0.5)
    )
    assert wrong_points(chart, 80, 2) == []
    assert any(region.count == 0 for region in chart.regions)


def test_pure_delay_has_its_border_at_two_theta_over_pi():
    chart = stability_chart(lag, lag, 1, x=("delay", 0.1, 1.0), y=("time_constant", 0.1, 1.0))
    top = max(chart.borders, key=lambda border: float((border.y / border.x).max()))
    assert top.y == pytest.approx(2 * top.x / pi, rel=1e-8)
    assert top.omega * top.x == pytest.approx(np.full(top.x.size, pi / 2), rel=1e-8)


def test_gain_of_a_matched_third_order_filter_has_its_border_at_nine():
    # M_3 = 1 + sec³(π/3) = 9, whatever λ.
    model = 1 / (s + 1) ** 3
    chart = stability_chart(model, model, 3, x=("time_constant", 0.1, 10), y=("gain", 0.5, 50))
    (border,) = chart.borders
    assert border.y == pytest.approx(np.full(border.y.size, 9.0), rel=1e-8)
    assert border.x * border.omega == pytest.approx(np.full(border.x.size, sqrt(3)), rel=1e-8)


@pytest.mark.slow
def test_a_vertical_line_through_a_chart_is_a_set_of_time_constants():
    x, y = ("time_constant", 0.002, 0.2), ("delay", 0.01, 0.1)
    G, model = EXAMPLE_4.process.tf, EXAMPLE_4.model
    chart = stability_chart(G, model, 3, x=x, y=y)
    for theta in (0.02, 0.05, 0.09):
        ends = [
            end
            for interval in stabilizing_time_constants(nrdob.delay(theta) * G, model, 3)
            for end in interval
            if 0.002 < end < 0.2
        ]
        found = []
        for border in chart.borders:
            cut = np.flatnonzero(np.diff(np.sign(border.y - theta)))
            share = (theta - border.y[cut]) / (border.y[cut + 1] - border.y[cut])
            found += (border.x[cut] + share * (border.x[cut + 1] - border.x[cut])).tolist()
        for end in ends:
            assert min(abs(value / end - 1) for value in found) < 1e-3


def test_a_real_root_crosses_on_a_line_with_frequency_zero_or_infinity():
    chart = stability_chart(
        (1 - 0.01 * s) * lag, lag, 1, x=("time_constant", 0.001, 0.1), y=("gain", 0.1, 3.0)
    )
    (border,) = [border for border in chart.borders if border.omega[0] == np.inf]
    assert border.y == pytest.approx(border.x / 0.01, rel=1e-9)
    assert wrong_points(chart, 60, 3) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("x", "filter", "lags"),
    [
        ("time_constant", 2, (1e3, 1e12)),
        ("gain", nrdob.LowPassFilter(0.5, 2), (0.01, 1e6)),
    ],
)
def test_borders_run_on_where_an_axis_is_ever_so_long(x, filter, lags):
    process = 1 / (s**2 + 0.1 * s + 1)
    span = {"time_constant": (1e-6, 1e3), "gain": (0.1, 1e6)}[x]
    chart = stability_chart(process, lag**2, filter, x=(x, *span), y=("lag", *lags))
    assert wrong_points(chart, 60, 4) == []
    assert {region.count for region in chart.regions} == {0, 2}


@pytest.mark.filterwarnings("error")
def test_a_border_that_is_nowhere_near_warns_of_nothing():
    # λs (s + 1)(τs + 1) + k (s + 1): stable for every k and τ.
    chart = stability_chart(
        lag, lag, nrdob.LowPassFilter(0.3, 1), x=("gain", 0.1, 10.0), y=("lag", 0.0, 10.0)
    )
    (region,) = chart.regions
    assert region.count == 0 == chart.count(7.0, 9.0)


def test_an_infinite_count_is_one():
    # F/model and the process are biproper: neutral with the ratio k/λ, and beyond 1 lost.
    loops = ChartLoops.of((s + 2) * lag, lag, nrdob.LowPassFilter(0.5, 1), {"gain", "delay"})
    given = [{"gain": k, "delay": 0.1} for k in (0.4, 0.6)]
    assert [loops.counts([each])[0] for each in given] == loops.counts(given) == [0, inf]


@pytest.mark.slow
def test_levels_of_the_sensitivity_lie_where_the_margins_have_them():
    G, model, F = EXAMPLE_4.process, EXAMPLE_4.model, EXAMPLE_4.filter
    chart = stability_chart(
        G, model, F, x=("time_constant", 0.03, 0.3), y=("gain", 0.5, 1.5), ms=(1.6,)
    )
    (line,) = chart.ms_levels[1.6]
    for lam, gain in line[:: max(1, len(line) // 6)]:
        filter = nrdob.LowPassFilter(float(lam), F.order)
        loop = nrdob.NRDOB(G * float(gain), model, EXAMPLE_4.controller, filter)
        assert loop.margins().plant_loop.ms == pytest.approx(1.6, rel=2e-2)


@pytest.mark.slow
def test_the_plot_says_what_it_shows():
    chart = stability_chart(lag, lag, 1, x=("delay", 0.1, 1.0), y=("time_constant", 0.1, 1.0))
    figure = chart.plot()
    assert "the loop is stable in 71.9 % of it" in figure.alt and "2 around" in figure.alt
    assert figure.png()[:4] == b"\x89PNG"


def test_what_is_stable_is_coloured():
    chart = stability_chart(
        (1 - 0.01 * s) * lag, lag, 1, x=("time_constant", 0.001, 0.1), y=("gain", 0.1, 3.0)
    )
    (axes,) = chart.plot().axes.flat
    (mesh,) = [each for each in axes.collections if isinstance(each, QuadMesh)]
    coloured = ~np.ma.getmaskarray(mesh.get_array())
    stable = sum(region.share for region in chart.regions if region.count == 0)
    unstable = sum(region.share for region in chart.regions if region.count == 1)
    assert coloured.mean() == pytest.approx(stable, abs=1e-9) and 0 < unstable != stable


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"x": ("delay", 0, 1), "y": ("delay", 0, 1)}, ValueError, "two different"),
        ({"x": ("tempo", 0, 1), "y": ("delay", 0, 1)}, ValueError, "one of"),
        ({"x": ("gain", 1, 0.5), "y": ("delay", 0, 1)}, ValueError, "increasing"),
        ({"x": "gain", "y": ("delay", 0, 1)}, TypeError, "name, low, high"),
        ({"x": ("gain", 1, "2"), "y": ("delay", 0, 1)}, TypeError, "real numbers"),
        ({"x": ("gain", 1, 2), "y": ("delay", 0, 1)}, TypeError, "whole family"),
        ({"x": ("gain", 1, 2), "y": ("time_constant", 0, 1), "ms": (0.9,)}, ValueError, "above 1"),
    ],
)
def test_what_is_no_chart_is_refused(options, error, message):
    with pytest.raises(error, match=message):
        stability_chart(lag, lag, 2, **options)


def test_no_roots_are_counted_where_a_parameter_has_no_meaning():
    F, delays = LowPassFilter(1.0, 1), ("delay", 0.0, 1.0)
    gains = stability_chart(lag, lag, F, x=("gain", 0.5, 1.0), y=delays)
    filters = stability_chart(lag, lag, F, x=("time_constant", 0.5, 1.0), y=delays)
    assert gains.count(1.0, 0.0) == filters.count(1.0, 0.0) == 0
    for chart, name in ((gains, "gain"), (filters, "time_constant")):
        for value in (0.0, -1.0):
            with pytest.raises(ValueError, match=f"{name} is .*; it must be positive"):
                chart.count(value, 0.1)
    with pytest.raises(ValueError, match=r"delay is -1\.0; it must be 0 or above"):
        gains.count(1.0, -1.0)


def test_what_would_have_to_be_followed_for_ever_is_refused_with_a_remedy():
    biproper, F = (s + 2) / (s + 1), ct.tf([0.6, 1], [1, 1])
    axes = {"x": ("gain", 0.1, 3.0), "y": ("delay", 0.1, 1.0)}
    with pytest.raises(ValueError, match="take a filter that rolls off"):
        stability_chart(biproper, nrdob.delay(1.0) * biproper, F, **axes)


def test_more_turns_of_a_dead_time_than_a_chart_can_show_are_refused_with_a_remedy():
    with pytest.raises(ValueError, match=r"turns within the chart: .* or end earlier"):
        stability_chart(
            lag, lag, LowPassFilter(1.0, 1), x=("delay", 0.01, 1e4), y=("gain", 0.1, 10.0)
        )


@pytest.mark.slow
def test_a_border_that_bends_sharply_parts_its_regions():
    # Chords between frequencies that resolve the dead time had left this one open.
    process = ct.tf([-14.2678, 1.76137], [17.4017, 23.046, 9.15973, 1.0])
    model = ct.tf([1.0], [9.181, 14.53, 6.954, 1.0])
    F = ct.tf([1.0], [2.113, 3.293, 2.566, 1.0])
    axes = {"x": ("gain", 0.0556, 4.83), "y": ("lag", 0.0, 53.1)}
    chart = stability_chart(nrdob.delay(15.0226) * process, model, F, **axes)
    assert wrong_points(chart, 60, 4) == []
    border = max(chart.borders, key=lambda border: border.x.size)
    u, v = chart.x.share(border.x), chart.y.share(border.y)
    assert np.hypot(np.diff(u), np.diff(v)).max() < 0.011


# A model that waits.

LAGS, RAMP_OF_2 = nrdob.filter_family("binomial", 2), nrdob.filter_family("ramp", 2)

WAITING_PAIRS = [(a, b) for i, a in enumerate(RANGES) for b in list(RANGES)[i + 1 :]]


@pytest.mark.slow
@pytest.mark.parametrize("wait", [0.05, 0.08])
@pytest.mark.parametrize("pair", WAITING_PAIRS)
def test_every_region_of_example_4_with_a_model_that_waits_has_its_count(pair, wait):
    x, y = ((name, *RANGES[name]) for name in pair)
    model = nrdob.delay(wait) * EXAMPLE_4.model
    chart = stability_chart(EXAMPLE_4.process, model, EXAMPLE_4.filter, x=x, y=y)
    assert wrong_points(chart, 30, 5) == []


@pytest.mark.slow
@pytest.mark.parametrize("filter", [LAGS, RAMP_OF_2], ids=["lags", "ramp"])
@pytest.mark.parametrize("pole", [0.0, 0.2])
@pytest.mark.parametrize("first", ["time_constant", "gain"])
def test_charts_of_a_model_that_waits_and_integrates_have_the_counts(first, pole, filter):
    chart = stability_chart(
        nrdob.delay(0.1) * 1.2 / (s + pole),
        nrdob.delay(0.09) / s,
        filter if first == "time_constant" else filter.at(0.1),
        x=(first, 0.05, 3.0),
        y=("delay", 0.05, 0.6),
    )
    assert len(chart.regions) > 1
    assert wrong_points(chart, 20, 3) == []


@pytest.mark.thorough
def test_random_charts_have_the_counts_of_their_loops():
    found = campaign(6, 21)
    assert sum(found.values()) == sum(n for name, n in found.items() if name.endswith("right"))


C_N = (1.4775, 2.3911, 3.0427, 3.5775, 4.0421, 4.4585)


@pytest.mark.slow
@pytest.mark.parametrize("n", range(1, 7))
def test_practical_stability_is_lost_at_c_n_time_constants(n):
    # Each border touches |θ - θm| = c_n λ, and none comes nearer.
    chart = stability_chart(
        lag**n, nrdob.delay(1.0) * lag**n, n, x=("time_constant", 0.05, 0.2), y=("delay", 0.5, 1.5)
    )
    errors = [float(np.min(np.abs(border.y - 1) / border.x)) for border in chart.borders]
    assert min(errors) == pytest.approx(C_N[n - 1], abs=6e-5)
    assert region_at(chart, 0.1, 1.0).count == 0


@pytest.mark.slow
def test_levels_of_a_model_that_waits_lie_where_the_margins_have_them():
    G, F = EXAMPLE_4.process, EXAMPLE_4.filter
    model = nrdob.delay(0.06) * EXAMPLE_4.model
    chart = stability_chart(
        G, model, F, x=("time_constant", 0.01, 0.1), y=("gain", 0.5, 1.8), ms=(1.8,)
    )
    line = max(chart.ms_levels[1.8], key=len)
    for lam, gain in line[:: max(1, len(line) // 4)]:
        filter = nrdob.LowPassFilter(float(lam), F.order)
        loop = nrdob.NRDOB(float(gain) * G, model, EXAMPLE_4.controller, filter)
        assert loop.margins().plant_loop.ms == pytest.approx(1.8, rel=3e-2)


@pytest.mark.thorough
def test_a_tongue_that_ends_between_the_lines_of_the_grid_is_closed():
    # Eight roots on one side of its border and six on the other, seen only if it has no gap.
    chart = stability_chart(
        1.2 * lag, nrdob.delay(0.5) * lag, 2, x=("time_constant", 0.02, 0.5), y=("delay", 0.0, 10.0)
    )
    assert len(chart.regions) > 400
    assert wrong_points(chart, 60, 5, least=0.6) == []


def test_roots_of_many_loops_of_a_chart_are_counted_as_those_of_one():
    names = {"time_constant", "delay"}
    loops = ChartLoops.of(1.2 * lag, nrdob.delay(0.5) * lag, 2, names)
    points = [
        {"time_constant": value, "delay": delay}
        for value in (0.03, 0.1, 0.4)
        for delay in (0.0, 0.5, 0.7, 8.0)
    ]
    assert loops.counts(points) == [loops.counts([point])[0] for point in points]


def test_a_curve_is_cut_before_the_step_that_leads_to_another_one():
    axes = Axis("time_constant", 0.0, 1.0), Axis("gain", 0.0, 1.0)
    x = np.array([0.1, 0.12, 0.14, 0.15, 0.17])
    y = np.array([0.1, 0.11, 0.12, 0.9, 0.91])
    first, last = cut(*axes, Border(x, y, np.arange(1.0, 6.0)))
    assert first.y.tolist() == [0.1, 0.11, 0.12] and last.y.tolist() == [0.9, 0.91]
    # A real root at 0 or at infinity has a straight border.
    (whole,) = cut(*axes, Border(x, y, np.zeros(5)))
    assert whole.y.tolist() == y.tolist()


def test_a_border_meets_the_edge_on_which_there_is_no_lag():
    chart = stability_chart(
        nrdob.delay(1.0) * lag, lag, 1, x=("time_constant", 0.3, 2.0), y=("lag", 0.0, 0.5)
    )
    (border,) = chart.borders
    # Without lag λs + exp(-sθ) has its roots on the axis at λ = 2θ/π.
    assert np.interp(0.0, border.y, border.x, left=0.0) == pytest.approx(2 / pi, rel=1e-3)


@pytest.mark.parametrize(
    ("x", "y", "said"),
    [(-0.1, 1.0, "0 or above"), (0.5, 0.0, "positive"), (float("nan"), 1.0, "delay is nan")],
)
def test_no_roots_are_counted_where_a_dead_time_or_lag_has_no_meaning(x, y, said):
    chart = stability_chart(lag, lag, 1, x=("delay", 0.1, 1.0), y=("time_constant", 0.1, 1.0))
    with pytest.raises(ValueError, match=said):
        chart.count(x, y)
