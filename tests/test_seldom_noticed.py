"""What hardly any test noticed when it was changed: faults put into the package on purpose."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import NRDOB, LowPassFilter, delay
from nrdob.design import right_half_plane_parity, stable_for_fast_filters
from nrdob.design.timeconstants import intersection
from nrdob.digital import largest_sampling_time
from nrdob.digital.unitcircle import CircleFunction, Product, count_outside
from nrdob.measured import heated_air
from nrdob.reporting.datasections import data_sections
from nrdob.reporting.formulas import character, formula
from nrdob.reporting.loopsections import sections_of
from nrdob.reporting.trials import Outcome, Trial, in_words

s = ct.tf("s")


@pytest.mark.thorough
def test_a_model_that_misses_what_the_input_does_is_a_warning() -> None:
    found = nrdob.identify(*heated_air())
    for independent in (True, False, None):
        residuals = replace(found.residuals, independent=independent)
        sections = dict(data_sections(replace(found, residuals=residuals)))
        section = sections["The process behind it"]()
        assert bool(section.warnings) is (independent is False)


@pytest.mark.slow
def test_a_report_samples_ten_times_as_fast_as_the_loop_or_its_filter_requires() -> None:
    loop = nrdob.paper.example(2)
    longest, filter = largest_sampling_time(loop), loop.filter
    assert isinstance(filter, LowPassFilter)
    dt = float(f"{min(longest, 2 * filter.time_constant) / 10:.2g}")
    section = dict(sections_of(loop))["On a processor"]()
    assert f"At dt = {dt:g} s, chosen here, the sampled loop is stable" in " ".join(section.words)


@pytest.mark.parametrize("clock", ["13:00:00 pm", "0:30:00 am", "24:00:00", "12:60:00"])
def test_a_time_that_is_none_of_a_day_is_named(tmp_path, clock: str) -> None:
    rows = ["t,u,y", *(f"2026-01-02 {clock},{k % 2},{k}" for k in range(12))]
    path = tmp_path / "times.csv"
    path.write_text("\n".join(rows), encoding="utf-8")
    with pytest.raises(ValueError, match=r"no time (of a day|like)"):
        nrdob.read_data(path)


@pytest.mark.slow
def test_a_root_at_zero_that_comes_only_where_both_dead_times_are_equal_is_no_reason_to_count() -> (
    None
):
    """Of s + 1 - 2 exp(-0.3s) + exp(-0.5s) the sum at equal delays keeps its root at s = 0."""
    plant, model = delay(0.5) * (1 / (s + 1)), delay(0.3) * (1 / (s + 1))
    found = NRDOB(plant, model, 0.5, LowPassFilter(0.4, 1)).stability()
    values = found.observer_loop.closed_loop_rhp
    w = np.linspace(-400, 400, 400_001)
    curve = NRDOB(plant, model, 0.5, LowPassFilter(0.4, 1)).FH(1j * w)
    turned = np.unwrap(np.angle(1 + curve))
    assert values == round((turned[0] - turned[-1]) / (2 * np.pi)) == 0


@pytest.mark.thorough
def test_a_loop_that_is_stable_at_every_sampling_time_has_no_longest() -> None:
    loop = NRDOB(1 / (s + 1), 1 / (s + 1), 0, LowPassFilter(1.0, 1))
    assert largest_sampling_time(loop, "zoh") == inf


def test_method_zoh_takes_a_loop_without_a_controller() -> None:
    """Its controller became an empty list of coefficients."""
    loop = NRDOB(1 / (s + 1), 1 / (s + 1), 0, LowPassFilter(0.5, 1)).sampled(0.02, method="zoh")
    sizes = np.abs(np.linalg.eigvals(loop.closed_loop.A))
    assert loop.stability().stable is True and sizes.max() == pytest.approx(np.exp(-0.02))


def test_a_root_on_the_circle_is_no_count() -> None:
    """z - exp(jω) and its conjugate: the argument is not defined there, and the angle is told."""
    angle = 1.0
    # v² - 2cos(ω)… in v = (1 - w)/(1 + w): z² - 2 cos(ω) z + 1
    found = count_outside(
        CircleFunction((Product((np.array([2 + 2 * np.cos(angle), 0.0, 2 - 2 * np.cos(angle)]),)),))
    )
    assert found.count is None and found.angle == pytest.approx(angle)


def test_a_resonance_that_may_be_elsewhere_is_a_warning_or_an_alarm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said = [(1e-9, "far too near"), (0.05, "near")]
    monkeypatch.setattr("nrdob.reporting.loopsections.resonance_warnings", lambda loop: said)
    section = dict(sections_of(nrdob.paper.example(1)))["How nearly not?"]()
    assert section.alarms == ("far too near",) and "near" in section.warnings


def test_the_heated_air_is_the_plant_that_was_fitted() -> None:
    air = nrdob.plants.heated_air()
    assert air.delay == 0.16
    np.testing.assert_allclose(sorted(-1 / air.tf.poles().real), [0.12, 0.27])
    assert air.tf.dcgain() == pytest.approx(0.93)


def test_blocks_are_written_as_one_knows_them() -> None:
    assert formula(LowPassFilter(0.5, 2)) == "1/(0.5 s + 1)²"
    assert formula(LowPassFilter(0.5, 1)) == "1/(0.5 s + 1)"
    assert formula(delay(0.3) * 2 / (s + 1)) == "2/(s + 1) · e^(−0.3 s)"


@pytest.mark.parametrize(
    ("process", "said"),
    [
        (2.0, "pure gain"), ((s + 2) / (s + 1), "lets the input through at once"),
        (1 / s**2, "double integrator"), (s / (s + 1) ** 2, "zero at s = 0"),
        (1 / (s**2 + 0.2 * s + 1), "resonates at 1 rad/s with a damping ratio of 0.1"),
        (1 / (s + 1) ** 5, "order 5"), (1 / (s - 2), "unstable: poles at 2 rad/s"),
    ],
)  # fmt: skip
def test_a_process_is_known_by_what_makes_it_hard(process: object, said: str) -> None:
    assert any(said in sentence for sentence in character(process))
    assert not any(said in sentence for sentence in character(1 / (s + 1)))


@pytest.mark.slow
def test_a_refusal_names_the_orders_that_were_tried() -> None:
    third = nrdob.paper.example(3, modified=True)
    with pytest.raises(ValueError, match=r"no filter of order 2 or 3 or 4 meets Ms ≤ 1.05"):
        nrdob.design_filter(third.process, third.model, max_ms=1.05)


def test_intervals_that_do_not_meet_have_nothing_in_common() -> None:
    assert intersection([(0.0, 1.0), (4.0, 5.0)], [(2.0, 3.0), (4.5, 9.0)]) == [(4.5, 5.0)]
    assert intersection([(0.0, 1.0)], [(1.0, 2.0)]) == []


def test_trials_are_told_in_a_sentence() -> None:
    fine, peaked, lost = Outcome(True, 1.4), Outcome(True, 2.6), Outcome(False)
    good = Trial("the process found", False, 0.1, fine, fine)
    rival = Trial("a rival", False, 0.1, fine, Outcome(True, 1.6))
    told = in_words((good, rival))
    assert told.endswith("1 rival of it and 0 corners of the intervals, in continuous time and "
                         "sampled like the record, at dt = 0.1 s, it is stable on all, with a peak "
                         "of 1.6 at most.")  # fmt: skip
    corners = tuple(Trial("a corner", True, 0.1, each, lost) for each in (peaked, lost, fine))
    told = in_words((good, *corners))
    assert "does not tell enough" in told and "on 1, and on 1 more" in told
    sampled = in_words((good, corners[2]), slower=False)
    assert sampled.startswith("Sampled like the record, at dt = 0.1 s, the loop fails. Tried on")
    assert (
        "unstable on 1, and on 0 more" in sampled and "slower" in told and "slower" not in sampled
    )
    assert (corners[2].stable, good.stable) == (False, True)
    assert Trial("a corner", True, 0.1, fine, Outcome()).stable is None


def test_the_share_of_a_record_that_is_held_out_has_a_top() -> None:
    with pytest.raises(ValueError, match="held_out"):
        nrdob.identify(*heated_air(), held_out=0.95)


@pytest.mark.thorough
def test_a_report_is_saved_where_it_is_asked(tmp_path) -> None:
    path = tmp_path / "report.html"
    nrdob.report(nrdob.paper.example(1), path)
    assert path.read_text("utf-8").startswith("<!DOCTYPE html>")


def test_what_no_fast_filter_and_what_no_filter_stabilises() -> None:
    late = stable_for_fast_filters(1 / (s + 1) ** 3, 1 / (s + 1), 1)
    assert late.holds is False and "2 more lags than the model" in late.reason
    assert right_half_plane_parity(s / (s + 1), s / (s + 2)).holds is False
    assert right_half_plane_parity(1 / s**2, 1 / s**2).holds is None  # another filter may
