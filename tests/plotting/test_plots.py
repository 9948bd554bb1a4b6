"""Every figure says what is true, draws where it is told, and leaves nothing behind."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO

import control as ct
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.axes import Axes

import nrdob
from nrdob import LowPassFilter, delay, paper
from nrdob.diagram import Quotient, as_quotient
from nrdob.numerics import QuasiPolynomial
from nrdob.plotting import (
    WIDTH,
    Figure,
    alttext,
    bode_plot,
    complex_number,
    nyquist_plot,
    step_plot,
)
from nrdob.plotting.contour import closest_approach, contour

mpl.use("Agg")
LOOPS = [(1, False), *((k, modified) for k in (2, 3, 4) for modified in (False, True))]
METHODS = {"plot_nyquist": 1, "plot_bode": 2, "plot_step": 4}


@pytest.fixture(autouse=True)
def _no_figures() -> Iterator[None]:
    plt.close("all")
    yield
    plt.close("all")


def texts(ax: Axes) -> list[str]:
    return [text.get_text() for text in ax.texts]


# What is returned, and where it is drawn.


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_figure_is_what_control_returns_with_alt_text(method: str) -> None:
    figure = getattr(paper.example(3), method)(title="Example 3")
    assert isinstance(figure, Figure)
    assert isinstance(figure, ct.ControlPlot)
    assert figure.axes.ndim == 2
    assert figure.axes.size == METHODS[method]
    assert figure.figure is plt.gcf()
    assert figure.figure.get_figwidth() == WIDTH
    assert ", Example 3" in figure.alt
    assert repr(figure) == figure.alt


@pytest.mark.parametrize("method", METHODS)
def test_the_users_axes_are_used_and_no_others_made(method: str) -> None:
    count = METHODS[method]
    user, axes = plt.subplots(count, squeeze=False)
    given = {"ax": axes[0, 0]} if count == 1 else {"axes": axes}
    figure = getattr(paper.example(2), method)(**given)
    assert figure.figure is user
    assert list(figure.axes.flat) == list(axes.flat)
    assert plt.get_fignums() == [user.number]
    assert all(ax.lines for ax in axes.flat)


@pytest.mark.slow
def test_axes_in_a_subfigure_are_rendered_with_the_whole_figure() -> None:
    whole = plt.figure()
    left, _ = whole.subfigures(1, 2)
    figure = paper.example(3).plot_nyquist(ax=left.subplots())
    assert figure.figure is whole
    assert figure.png().startswith(b"\x89PNG")


def test_the_wrong_number_of_axes_is_refused() -> None:
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match="1 axes given; this figure needs 2"):
        paper.example(2).plot_bode(axes=[ax])


@pytest.mark.thorough
@pytest.mark.parametrize("method", METHODS)
def test_the_users_settings_are_untouched(method: str) -> None:
    before = dict(mpl.rcParams)
    getattr(paper.example(4), method)().png()
    assert dict(mpl.rcParams) == before


# In a notebook.


@pytest.mark.slow
def test_the_backend_is_loaded_outside_the_style(monkeypatch: pytest.MonkeyPatch) -> None:
    # Within it, a notebook would lose the interactive mode that the backend switches on.
    seen, make = [], plt.figure

    def figure(**kwargs: object) -> object:
        seen.append(mpl.rcParams["text.color"])
        return make(**kwargs)

    monkeypatch.setattr(plt, "figure", figure)
    paper.example(2).plot_nyquist()
    assert seen == [mpl.rcParamsDefault["text.color"]]


@pytest.mark.slow
def test_the_notebook_gets_one_png_with_alt_text_and_its_size() -> None:
    figure = paper.example(3).plot_nyquist()
    data, metadata = figure._repr_mimebundle_()
    png = data["image/png"]
    width, height = struct.unpack(">II", png[16:24])
    assert set(data) == {"image/png", "text/plain"}
    assert data["text/plain"] == metadata["image/png"]["alt"] == figure.alt
    assert (width, height) == (1000, 800)
    assert metadata["image/png"]["width"] == 625
    assert metadata["image/png"]["height"] == pytest.approx(625 * height / width, abs=1)


@pytest.mark.thorough
@pytest.mark.parametrize("method", METHODS)
def test_nothing_is_left_open_after_it_is_shown(method: str) -> None:
    getattr(paper.example(2), method)()._repr_mimebundle_()
    assert plt.get_fignums() == []


@pytest.mark.thorough
@pytest.mark.parametrize("method", METHODS)
def test_the_same_figure_has_the_same_bytes(method: str) -> None:
    first, second = (getattr(paper.example(4), method)().png() for _ in range(2))
    assert first == second
    assert b"Software" not in first
    assert b"matplotlib" not in first


@pytest.mark.slow
def test_the_ground_is_transparent() -> None:
    figure = paper.example(3).plot_nyquist()
    png = figure.png()
    assert png[25] == 6  # colour type: red, green, blue, alpha
    assert plt.imread(BytesIO(png))[0, 0, 3] == 0


# Nyquist.

ENCIRCLEMENTS = {
    ("FH", 1, False): "no encirclement of −1",
    ("FH", 2, False): "no encirclement of −1",
    ("FH", 3, False): "one counter-clockwise encirclement of −1",
    ("FH", 3, True): "one counter-clockwise encirclement of −1",
    ("FH", 4, True): "no encirclement of −1",
    ("H", 2, False): "one clockwise encirclement of −1",
    ("H", 3, False): "one counter-clockwise encirclement of −1",
    ("H", 4, False): "infinitely many clockwise encirclements of −1",
    ("L", 3, False): "one counter-clockwise encirclement of −1",
}


@pytest.mark.thorough
@pytest.mark.parametrize(("which", "number", "modified"), ENCIRCLEMENTS)
def test_nyquist_alt_text_counts_the_encirclements(which: str, number: int, modified: bool) -> None:
    figure = paper.example(number, modified).plot_nyquist(which)
    assert ENCIRCLEMENTS[which, number, modified] in figure.alt


@pytest.mark.slow
def test_nyquist_alt_text_of_example_3() -> None:
    assert paper.example(3).plot_nyquist(title="Example 3").alt == (
        "Nyquist plot of F·H, Example 3: one counter-clockwise encirclement of −1, "
        "closest approach 0.733 at 46.8 rad/s"
    )


@pytest.mark.slow
def test_a_curve_without_a_name_is_drawn_without_one() -> None:
    quotient = replace(paper.example(3).FH, name="")
    (ax,) = nyquist_plot(quotient).axes.flat
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Re", "Im")
    assert bode_plot(quotient).axes.flat[0].get_ylabel() == "magnitude (dB)"


@pytest.mark.slow
def test_the_papers_ratio_encircles_plus_one() -> None:
    figure = paper.example(3).plot_nyquist("ratio", point=1)
    assert "one counter-clockwise encirclement of +1" in figure.alt


@pytest.mark.parametrize(("number", "modified"), LOOPS)
def test_the_closest_approach_is_the_modulus_margin(number: int, modified: bool) -> None:
    loop = paper.example(number, modified)
    margins = loop.margins()
    for quotient, found in (
        (loop.FH, margins.observer_loop),
        (loop.CGm, margins.model_loop),
        (loop.L, margins.plant_loop),
    ):
        approach = closest_approach(quotient, contour(quotient))
        assert approach.distance == pytest.approx(found.sm, rel=1e-9)


@pytest.mark.slow
def test_an_improper_loop_is_closed_by_an_arc_clockwise_around_minus_one() -> None:
    curve = contour(paper.example(2).H)
    (arc,) = curve.arcs
    assert arc.label == "arc at infinity"
    (branch,) = curve.branches
    closed = np.concatenate([np.conj(branch[::-1]), branch, arc.points]) + 1
    turns = np.angle(closed[1:] / closed[:-1]).sum() / (2 * np.pi)
    assert -turns == pytest.approx(1, abs=0.01)  # clockwise is positive
    figure = nyquist_plot(paper.example(2).H)
    assert "arc at infinity" in texts(figure.axes[0, 0])
    assert "$N$ = 1" in figure.axes[0, 0].get_title(loc="right")


@pytest.mark.parametrize(("number", "modified"), LOOPS)
@pytest.mark.parametrize("which", ["FH", "CGm", "L"])
def test_the_drawn_curve_turns_as_often_as_is_counted(
    which: str, number: int, modified: bool
) -> None:
    loop = paper.example(number, modified)
    curve = contour(getattr(loop, which))
    (branch,) = curve.branches
    arcs = [arc.points for arc in curve.arcs]
    closed = np.concatenate([*arcs, branch, np.conj(branch[::-1])]) + 1
    turns = np.angle(closed[1:] / closed[:-1]).sum() / (2 * np.pi)
    counted = nrdob.analysis.nyquist.encirclements(getattr(loop, which)).encirclements
    assert -turns == pytest.approx(counted, abs=0.02)


def test_an_undamped_plant_is_passed_on_the_right_at_both_its_poles() -> None:
    s = ct.tf("s")
    loop = nrdob.NRDOB(1 / (s * (s**2 + 1)), 1 / (s + 1) ** 2, 1 / s, LowPassFilter(0.05, 3))
    curve = contour(loop.FH)
    assert [arc.label for arc in curve.arcs].count("indentation") == 2
    for arc in curve.arcs[:2]:  # the third mirrors the second
        turn = np.angle(arc.points[1:] / arc.points[:-1]).sum()
        assert turn == pytest.approx(-np.pi, abs=0.5)


@pytest.mark.slow
def test_a_resonance_between_grid_points_is_drawn_to_its_peak() -> None:
    damping = 1e-6
    s = ct.tf("s")
    loop = nrdob.NRDOB(
        1 / (s**2 + 2 * damping * s + 1), 1 / (s + 1) ** 2, 1 / s, LowPassFilter(0.05, 2)
    )
    peak = abs(loop.FH(1j))
    figure = loop.plot_nyquist()
    drawn = figure.lines[0][0].get_xydata()
    assert np.hypot(*drawn.T).max() == pytest.approx(peak, rel=0.01)
    assert np.abs(np.diff(drawn, axis=0)).max() < 0.06 * peak


def test_the_curve_is_smooth() -> None:
    curve = contour(paper.example(4).FH)
    middle = (curve.omega[1:-2] + curve.omega[2:-1]) / 2
    chord = (curve.values[1:-2] + curve.values[2:-1]) / 2
    off = np.abs(paper.example(4).FH(1j * middle) - chord)
    assert off.max() < 2e-3 * curve.size


def test_a_way_to_infinity_is_no_peak_that_must_be_shown() -> None:
    s = ct.tf("s")
    loop = nrdob.NRDOB(1 / (s**2 + 1), 1 / (s + 1) ** 2, 1 / s, LowPassFilter(0.5, 2))
    near = np.abs(loop.FH(1j * (1 + 1e-4)))
    assert contour(loop.FH).size < 10 < 1000 < near


@pytest.mark.slow
def test_a_curve_within_the_unit_circle_leaves_the_circle_to_fill_the_window() -> None:
    figure = paper.example(4).plot_nyquist()
    assert max(np.hypot(*line.get_xydata().T).max() for line in figure.lines[0]) < 1
    ax = figure.axes[0, 0]
    sides = [abs(np.subtract(*limits)) for limits in (ax.get_xlim(), ax.get_ylim())]
    assert 2 < min(sides) < 2.5


@pytest.mark.slow
def test_a_plot_much_larger_than_one_gets_an_inset() -> None:
    loop = paper.example(3)
    assert len(loop.plot_nyquist("L").axes[0, 0].child_axes) == 1
    assert not loop.plot_nyquist("FH").axes[0, 0].child_axes


@pytest.mark.slow
def test_a_matched_model_has_nothing_to_encircle() -> None:
    alt = paper.example(1).plot_nyquist().alt
    assert alt.endswith("no encirclement of −1, closest approach 1 at every frequency")


# Bode.


def test_bode_without_margins_says_where_each_curve_starts_and_ends():
    alt = paper.example(2).plot_bode("G", "Gm").alt
    assert "G from 13.9 dB and −5.83° at 0.2 rad/s" in alt
    assert "Gm from 13.9 dB" in alt
    assert "zero at" in paper.example(1).plot_bode("H").alt


def test_bode_alt_text_gives_the_margins_and_where() -> None:
    assert paper.example(2).plot_bode(title="Example 2").alt == (
        "Bode diagrams of F·H, Example 2: gain margin 14 dB at 40 rad/s, infinite phase margin"
    )
    assert (
        paper.example(3)
        .plot_bode("CGm")
        .alt.endswith("infinite gain margin, phase margin 54° at 0.728 rad/s")
    )


def test_a_gain_margin_below_one_at_zero_frequency_is_drawn_at_the_edge() -> None:
    figure = paper.example(3).plot_bode()
    assert texts(figure.axes[0, 0]) == ["GM −14 dB at ω = 0"]
    assert texts(figure.axes[1, 0]) == ["PM 65.1° at 28.3 rad/s"]
    assert "gain margin −14 dB at ω = 0, phase margin 65.1° at 28.3 rad/s" in figure.alt


def test_both_gain_margins_of_a_conditionally_stable_loop_are_drawn() -> None:
    figure = paper.example(3, modified=True).plot_bode()
    assert texts(figure.axes[0, 0]) == ["GM −9.54 dB at ω = 0", "GM 2.08 dB at 13.4 rad/s"]


@pytest.mark.slow
def test_an_unstable_loop_shows_no_margins() -> None:
    unstable = nrdob.NRDOB(
        delay(5) * ct.tf([1], [1, 1]), ct.tf([1], [1, 1]), 0.5, LowPassFilter(0.1, 1)
    )
    figure = unstable.plot_bode()
    assert not texts(figure.axes[0, 0])
    assert "no margins" in figure.alt


def test_curves_are_labelled_directly() -> None:
    figure = paper.example(2).plot_bode("G", "Gm")
    assert texts(figure.axes[0, 0]) == ["$G$", r"$\tilde{G}$"]
    assert figure.axes[0, 0].get_legend() is None


@pytest.mark.slow
@pytest.mark.parametrize("which", ["CGm", "L"])
def test_phase_is_continuous_and_starts_at_the_integrators_angle(which: str) -> None:
    figure = paper.example(4).plot_bode(which, omega_limits=(1e-3, 1e3))
    omega, phase = figure.lines[1, 0][0].get_data()
    assert phase[0] == pytest.approx(-90, abs=1)
    assert np.abs(np.diff(phase)).max() < 90
    if which == "L":  # -90 degrees of dead time for every half turn
        assert phase[-1] < -np.degrees(0.05 * omega[-1])


def test_bode_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match=r"at least one map"):
        bode_plot()


# Steps and roots.


def test_step_alt_text_gives_peak_and_final_value() -> None:
    alt = paper.example(1).plot_step(title="Example 1").alt
    assert alt.startswith("Step responses of y, Example 1: to R peak 1.18, final value 1; ")
    assert alt.endswith("to eta peak −1, final value −1")


def test_an_unstable_response_grows_without_bound_in_words() -> None:
    unstable = nrdob.NRDOB(ct.tf([1], [1, -1]), ct.tf([1], [1, 1]), 1.0, LowPassFilter(5.0, 1))
    assert unstable.stability().stable is False
    assert "to d grows without bound" in unstable.plot_step().alt


@pytest.mark.slow
def test_compared_loops_share_their_times_and_are_named() -> None:
    nominal, modified = paper.example(3), paper.example(3, modified=True)
    figure = modified.plot_step(compare=nominal)
    for lines in figure.lines.flat:
        one, other = lines
        assert np.array_equal(one.get_xdata(), other.get_xdata())
        assert other.get_linestyle() == "--"
    assert "beside nominal" in figure.alt
    named = step_plot(modified, compare={"as designed": nominal})
    assert [t.get_text() for t in named.axes[0, 0].get_legend().get_texts()] == ["as designed"]


@pytest.mark.slow
def test_step_panels_show_the_responses() -> None:
    loop, times = paper.example(4), np.linspace(0, 3, 40)
    for row, signal in enumerate("yu"):
        figure = loop.plot_step(signal, timepts=times)
        for lines, given in zip(figure.lines.flat, ("R", "d", "delta", "eta"), strict=True):
            expected = nrdob.analysis.response.step_response(loop, given, times).outputs[row, 0]
            assert np.array_equal(lines[0].get_ydata(), expected)


# Wrong names.


def test_unknown_maps_and_signals_are_refused_with_the_choices() -> None:
    loop = paper.example(2)
    with pytest.raises(ValueError, match=r"no map 'HF'.*FH, H, CGm"):
        loop.plot_nyquist("HF")
    with pytest.raises(ValueError, match=r"no map 'S'"):
        loop.plot_bode("FH", "S")
    with pytest.raises(ValueError, match=r"must be 'y' or 'u'"):
        loop.plot_step("x")


# Numbers in words.


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (0.73284, "0.733"), (-1.0, "−1"), (1e-17, "1.00e−17"), (0.0, "0"), (1234.5, "1230"),
        (12.25, "12.2"), (12.25 - 1e-14, "12.2"), (float("inf"), "∞"), (2.5e7, "2.50e+07"),
    ],
)  # fmt: skip
def test_numbers_are_said_with_three_digits_the_same_everywhere(value: float, said: str) -> None:
    assert alttext.number(value) == said


def test_closed_loop_maps_of_an_ill_posed_loop_are_not_drawn_but_its_open_loops_are():
    s = ct.tf("s")
    filter = nrdob.LowPassFilter(0.01, 1)
    loop = nrdob.NRDOB(0.1 * (100 - s) / (s + 2), 10 / (s + 2), 1 / s, filter)
    with pytest.raises(ValueError, match="S_d cannot be drawn: the observer loop is ill-posed"):
        loop.plot_nyquist("S_d")
    assert "F·H" in loop.plot_bode("FH").alt


# Long dead times, extreme units, and what cannot be drawn.


@pytest.mark.parametrize("ratio", [1e3, 1e4])
def test_turns_within_the_line_of_others_are_left_out_and_said(ratio: float) -> None:
    s = ct.tf("s")
    plant = delay(ratio) * 1.3 / (s + 2)
    loop = nrdob.NRDOB(plant, 1 / (s + 1), 0.1 / s, LowPassFilter(2 * ratio, 1))
    curve = contour(loop.H)
    assert curve.left_out > 100
    assert curve.omega.size < 60_000
    assert f"{curve.left_out} turns of the dead time" in alttext.nyquist(
        "H", "", -1.0, 0, closest_approach(loop.H, curve), curve.left_out
    )


@pytest.mark.slow
def test_no_turn_that_is_left_out_lies_off_the_line() -> None:
    s = ct.tf("s")
    loop = nrdob.NRDOB(delay(1e3) / (s + 1), 1 / (s + 2), 0.1 / s, LowPassFilter(2e3, 1))
    curve = contour(loop.H)
    assert curve.left_out > 0
    omega = np.random.default_rng(0).uniform(curve.omega[1], curve.omega[-1], 2000)
    gap = [np.abs(curve.values - value).min() for value in loop.H(1j * omega)]
    # Half the distance of neighbouring samples along the line, and the width of the line.
    step = np.abs(np.diff(curve.values)).max()
    assert max(gap) < 0.5 * step + 1e-2 * curve.size


@pytest.mark.slow
def test_ordinary_loops_are_drawn_turn_by_turn() -> None:
    loop = paper.example(4, modified=True)
    assert contour(loop.FH).left_out == contour(loop.H).left_out == 0
    assert "left out" not in loop.plot_nyquist().alt


@pytest.mark.thorough
@pytest.mark.parametrize("unit", [1e-30, 1e30])
@pytest.mark.parametrize("which", ["FH", "L", "K"])
def test_a_loop_in_extreme_units_is_drawn(unit: float, which: str) -> None:
    s = ct.tf("s")
    for loop in (
        nrdob.NRDOB(unit / (s + 1), unit / (s + 1), 1 / (unit * s), LowPassFilter(1.0, 1)),
        nrdob.NRDOB(([1.2], [unit, 1]), ([1], [unit, 1]), 0.1, LowPassFilter(unit, 1)),
        nrdob.NRDOB(([unit], [1, 1]), 1 / (s + 1), 1 / s, LowPassFilter(1.0, 1)),
    ):
        assert "Nyquist" in loop.plot_nyquist(which).alt
        assert "Bode" in loop.plot_bode(which).alt


@pytest.mark.parametrize(
    ("method", "given", "error", "said"),
    [
        ("plot_nyquist", {"point": np.nan}, ValueError, "point is nan"),
        ("plot_nyquist", {"point": 1j}, TypeError, "finite real number"),
        ("plot_nyquist", {"ax": 3}, TypeError, "plt.subplots"),
        ("plot_bode", {"axes": [3, 4]}, TypeError, "plt.subplots"),
        ("plot_bode", {"omega_limits": (1,)}, ValueError, "pair"),
        ("plot_bode", {"omega_limits": (0, 1)}, ValueError, "0 < low < high"),
        ("plot_bode", {"omega_limits": (2, 1)}, ValueError, "0 < low < high"),
        ("plot_bode", {"omega_limits": (1, np.inf)}, ValueError, "0 < low < high"),
        ("plot_step", {"compare": 3}, TypeError, "loops by label"),
        ("plot_step", {"compare": {"a": 3}}, TypeError, "an NRDOB"),
        (
            "plot_step",
            {"compare": dict.fromkeys("abcd", paper.example(1))},
            ValueError,
            "compare holds 4 loops",
        ),
    ],
)
def test_what_cannot_be_drawn_is_named_with_the_remedy(
    method: str, given: dict[str, object], error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        getattr(paper.example(2), method)(**given)


def test_a_plot_function_is_told_a_map_from_a_loop() -> None:
    loop = paper.example(2)
    for plot in (nyquist_plot, bode_plot):
        with pytest.raises(TypeError, match="pass one of its maps"):
            plot(loop)
    with pytest.raises(TypeError, match="an NRDOB"):
        step_plot(loop.FH)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="margins is a int"):
        bode_plot(loop.FH, margins=3)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_loop_gain_of_ones_own_is_drawn_like_a_map() -> None:
    L = delay(0.5) * ct.tf([1], [1, 0])
    assert "no encirclement of −1" in nyquist_plot(L).alt and "L" in bode_plot(L).alt
    assert nyquist_plot(as_quotient(L, "L")).alt == nyquist_plot(L).alt


@pytest.mark.slow
def test_of_a_million_turns_few_are_drawn_and_the_words_say_so() -> None:
    lag = ct.tf([1], [1, 1])
    loop = nrdob.NRDOB(delay(1e4) * lag, lag, 0.1, LowPassFilter(0.01, 1))
    plot = loop.plot_nyquist()
    drawn = [line for line in np.ravel(plot.lines) if line is not None]
    assert sum(line.get_xdata().size for line in drawn) < 100_000
    assert "turns of the dead time, each within the line of another, are left out" in plot.alt


@pytest.mark.thorough
def test_loops_with_two_dead_times_are_drawn(no_warning_leaks):
    lag, s = ct.tf([1], [1, 1]), ct.tf("s")
    plant, model = delay(300.0) * lag, delay(299.9) * 1.1 * lag
    near = nrdob.NRDOB(plant, model, 1 / s, LowPassFilter(0.2, 2))
    ex = paper.example(4)
    waits = nrdob.NRDOB(ex.process, delay(0.04) * ex.model, ex.controller, ex.filter)
    for loop, names in ((waits, ("FH", "L", "H", "ratio", "Gm")), (near, ("FH", "H"))):
        for name in names:
            curve = contour(getattr(loop, name))
            assert curve.omega.size == curve.values.size
            assert "Nyquist" in loop.plot_nyquist(name).alt
    assert "dB" in waits.plot_bode("FH", "L", "S_d").alt
    assert waits.plot_step().alt


@pytest.mark.parametrize(
    ("value", "said"), [(-1 - 2j, "−1 ± 2j"), (-3 + 1e-12j, "−3"), (1e-12 + 2j, "± 2j"), (0j, "0")]
)
def test_a_root_is_said_with_its_mirror_image_and_without_rounding(value: complex, said: str):
    assert complex_number(value) == said


def test_a_loop_gain_that_ends_at_a_finite_value_has_no_arc_at_infinity() -> None:
    G = ct.tf([1, 2], [1, 1])
    curve = contour(nrdob.NRDOB(G, G, ct.tf([1], [1, 0]), ct.tf([0.5, 1], [1, 1])).L)
    assert curve.values[-1] == pytest.approx(1.0)
    assert [arc.label for arc in curve.arcs] == ["indentation"]


def test_a_curve_that_grows_slowly_after_a_high_peak_still_reaches_its_arc() -> None:
    # L = 8000·0.02/(s² + 0.02 s + 1) + s/1000 has the size 1 again at 1000 rad/s only.
    den = np.array([1.0, 0.02, 1.0])
    num = np.polyadd(np.polymul([1e-3, 0.0], den), [160.0])
    curve = contour(Quotient((QuasiPolynomial(num),), (QuasiPolynomial(den),), "L"))
    assert curve.radius > 8000
    (branch,), (arc,) = curve.branches, curve.arcs
    assert abs(branch[-1]) == pytest.approx(abs(arc.points[0]), rel=0.1)


def test_a_curve_that_shrinks_to_a_circle_is_closest_at_infinity() -> None:
    # |H + 1| = |R| falls to 1/2.
    s = ct.tf("s")
    process = delay(1.0) * ((s + 2) / (2 * (s + 1)))
    H = nrdob.NRDOB(process, (s + 1) / (s + 3), 0.1, LowPassFilter(1.0, 1)).H
    assert closest_approach(H, contour(H)) == (0.5, np.inf, pytest.approx(-0.5))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("num", "den"), [([1], [1, 1, 0]), ([1], [1, 1, 0, 0]), ([1], [1, 0, 1]), ([1, 1], [1])]
)
def test_the_label_of_an_arc_grows_away_from_it(num: list[float], den: list[float]) -> None:
    loop = Quotient((QuasiPolynomial(num),), (QuasiPolynomial(den),), "L")
    (ax,) = nyquist_plot(loop).axes.flat
    labels = [each for each in ax.texts if each.get_text() in ("indentation", "arc at infinity")]
    assert labels
    for label in labels:
        across = label.xyann[0] / 6
        side = "left" if across > 0.3 else "right" if across < -0.3 else "center"
        assert label.get_horizontalalignment() == side


@pytest.mark.parametrize(
    ("omega", "said"),
    [
        (np.inf, "as ω → ∞"),
        (0.0, "at ω = 0"),
        (np.nan, "at every frequency"),
        (2.5, "at 2.5 rad/s"),
    ],
)
def test_a_frequency_is_named(omega: float, said: str) -> None:
    assert alttext.frequency(omega) == said
