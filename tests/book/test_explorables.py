"""What can be moved on the pages computes what the package computes, over the range of its sliders.

The scripts run in a real browser, without any page of the book around them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

import control as ct
import numpy as np
import pytest

import nrdob
from browser import CHROMIUM, browser
from explorable import SCRIPTS, coefficients, scene
from nrdob import NRDOB, LowPassFilter, paper

STATIC = Path(__file__).resolve().parents[2] / "book" / "_static"
RANGE = {
    "lambda": (0.005, 3.0), "gain": (0.1, 10.0), "lag": (0.0, 0.5), "zero": (0.0, 0.3),
    "delay": (0.0, 0.3),
}  # fmt: skip

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: NOTHING WAS MOVED ON A PAGE"),
]


@pytest.fixture(scope="module")
def tab() -> Iterator[Any]:
    """Give an empty page that has the formulas."""
    with browser() as opened:
        page = opened.new_page()
        for script in SCRIPTS[:-1]:
            page.add_script_tag(path=str(STATIC / script))
        yield page


def drawn(rng: np.random.Generator, number: int) -> tuple[dict[str, Any], NRDOB]:
    """Draw a position of the sliders, and the loop that it stands for."""
    given = paper.example(number)
    at: dict[str, Any] = {
        name: float(np.exp(rng.uniform(*np.log(RANGE[name])))) for name in ("lambda", "gain")
    }
    at |= {
        name: float(rng.uniform(*RANGE[name])) if rng.random() < 0.4 else 0.0
        for name in ("lag", "zero", "delay")
    }
    at["order"] = int(rng.integers(given.filter.order, 6))
    lag = ct.tf([1.0], [at["lag"], 1.0] if at["lag"] else [1.0])
    zero = ct.tf([-at["zero"], 1.0] if at["zero"] and at["lag"] else [1.0], [1.0])
    if not at["lag"]:
        at["zero"] = 0.0  # alone it may make the plant improper
    G = given.fractions.G
    process = at["gain"] * ct.tf(G.num, G.den) * lag * zero
    delayed = nrdob.delay(given.delay + at["delay"]) * process
    filter_ = LowPassFilter(at["lambda"], at["order"])
    return (
        {**at, "plant": coefficients(given)},
        NRDOB(delayed, given.model, given.controller, filter_),
    )


def distance(found: dict[str, Any], loop: Any, signal: str, *, least: float, end: int) -> float:
    """Tell how far a response in the browser is from the package's, over its size, at 25 times."""
    times = np.array(found["time"])
    looked = np.unique(np.linspace(1, times.size - end, 25).astype(int))
    wanted = loop.step_response(signal, np.append(0.0, times[looked])).outputs[0, 0, 1:]
    size = max(least, float(np.abs(wanted).max()))
    return float(np.abs(np.array(found["y"])[looked] - wanted).max()) / size


def within(sets: list[tuple[float, float]], low: float, high: float) -> list[tuple[float, float]]:
    """Cut intervals to the ends of a slider."""
    return [(max(a, low), min(b, high)) for a, b in sets if b > low and a < high]


@pytest.mark.parametrize("number", paper.EXAMPLES)
def test_verdict_counts_and_sensitivity_are_those_of_the_package(tab: Any, number: int) -> None:
    rng = np.random.default_rng(number)
    for _ in range(25):
        at, loop = drawn(rng, number)
        verdict = loop.stability()
        found = tab.evaluate("(at) => nrdob.judge(nrdob.loopOf(at))", at)
        assert found["Z"] == verdict.observer_loop.closed_loop_rhp, at
        assert found["P"] == verdict.observer_loop.open_loop_rhp
        assert found["stable"] == verdict.stable
        if verdict.stable:
            assert found["Ms"] == pytest.approx(loop.margins().plant_loop.ms, rel=1e-6)


@pytest.mark.parametrize("number", paper.EXAMPLES)
def test_the_bar_shows_the_stabilising_set(tab: Any, number: int) -> None:
    rng = np.random.default_rng(10 + number)
    low, high = RANGE["lambda"]
    for _ in range(8):
        at, loop = drawn(rng, number)
        found = tab.evaluate(
            "([at, low, high]) => nrdob.stabilizing(at, low, high)", [at, low, high]
        )
        sets = nrdob.stabilizing_time_constants(
            loop.process, loop.model, at["order"], floor=low / 2
        )
        wanted = within(sets, low, high)
        assert len(found) == len(wanted), at
        assert np.allclose(found, wanted, rtol=1e-6)


@pytest.mark.parametrize("number", paper.EXAMPLES)
@pytest.mark.parametrize("signal", ["R", "d", "delta", "eta"])
def test_steps_are_those_of_the_package(tab: Any, number: int, signal: str) -> None:
    rng = np.random.default_rng(20 + number)
    last, compared = 5.0, 0
    while compared < 3:
        at, loop = drawn(rng, number)
        if not loop.stability().stable:
            continue
        script = "([at, signal, last]) => nrdob.step(nrdob.loopOf(at), signal, last)"
        found = tab.evaluate(script, [at, signal, last])
        assert distance(found, loop, signal, least=1.0, end=1) < 5e-3, at
        compared += 1


# --- The motor on a processor, and under ADRC -----------------------------------------------------


def drawn_sampled(rng: np.random.Generator) -> tuple[dict[str, Any], NRDOB]:
    """Draw a position of the sliders of the sampled loop, and the loop that it stands for."""
    at: dict[str, Any] = {
        "lambda": float(np.exp(rng.uniform(*np.log([0.0005, 0.5])))),
        "T": float(np.exp(rng.uniform(*np.log([0.0005, 0.05])))),
        "gain": float(np.exp(rng.uniform(*np.log([0.1, 10.0])))),
        "order": int(rng.integers(1, 5)),
        "delay": 0.0,
    }
    if rng.random() < 0.6:
        at["delay"] = float(rng.uniform(0, min(0.02, 8 * at["T"])))
    shown = scene("sampled")
    process = nrdob.delay(at["delay"]) * (at["gain"] * shown.loop.process)
    filter_ = LowPassFilter(at["lambda"], at["order"])
    loop = NRDOB(process, shown.loop.model, shown.loop.controller, filter_)
    return {**at, "plant": shown.plant}, loop


def drawn_adrc(rng: np.random.Generator) -> tuple[dict[str, Any], Any]:
    """Draw a position of the sliders of ADRC, and the process that it stands for."""
    at: dict[str, Any] = {
        name: float(np.exp(rng.uniform(*np.log(ends))))
        for name, ends in {
            "observer": (3.0, 3000.0), "controller": (3.0, 300.0), "gain": (0.1, 10.0),
        }.items()
    }  # fmt: skip
    at["lag"] = float(rng.uniform(0.0005, 0.05)) if rng.random() < 0.6 else 0.0
    at["delay"] = float(rng.uniform(0.0005, 0.02)) if rng.random() < 0.6 else 0.0
    shown = scene("adrc")
    lag = ct.tf([1.0], [at["lag"], 1.0] if at["lag"] else [1.0])
    process = nrdob.delay(at["delay"]) * (at["gain"] * shown.loop.process * lag)
    return {**at, "plant": shown.plant}, process


def test_the_sampled_loop_is_judged_as_by_the_package(tab: Any) -> None:
    rng = np.random.default_rng(30)
    seen = set()
    for _ in range(40):
        at, loop = drawn_sampled(rng)
        sampled = loop.sampled(at["T"])
        verdict = sampled.stability()
        found = tab.evaluate("(at) => nrdob.judge(nrdob.kinds.sampled.loopOf(at))", at)
        assert found["stable"] == verdict.stable, at
        seen.add(verdict.stable)
        if verdict.stable:
            assert found["Ms"] == pytest.approx(sampled.margins().ms, rel=1e-5)
    assert seen == {True, False}


def test_the_bar_of_the_sampled_loop_is_the_set_of_the_package(tab: Any) -> None:
    rng = np.random.default_rng(31)
    low, high = 0.0005, 0.5
    script = "([at, low, high]) => nrdob.kinds.sampled.stabilizing(at, low, high)"
    for _ in range(15):
        at, loop = drawn_sampled(rng)
        found = tab.evaluate(script, [at, low, high])
        sets = nrdob.stabilizing_time_constants(
            loop.process, loop.model, at["order"], floor=low / 2, dt=at["T"]
        )
        wanted = within(sets, low, high)
        assert len(found) == len(wanted), at
        assert np.allclose(found, wanted, rtol=1e-5), at


@pytest.mark.parametrize("signal", ["R", "d", "delta", "eta"])
def test_the_sampled_loop_answers_as_in_the_package(tab: Any, signal: str) -> None:
    rng = np.random.default_rng(32)
    compared = 0
    while compared < 4:
        at, loop = drawn_sampled(rng)
        sampled = loop.sampled(at["T"])
        if not sampled.stability().stable:
            continue
        script = "([at, s]) => nrdob.kinds.sampled.step(nrdob.kinds.sampled.loopOf(at), s, 0.3)"
        found = tab.evaluate(script, [at, signal])
        assert distance(found, sampled, signal, least=1e-3, end=2) < 1e-6, at
        compared += 1


def test_adrc_is_judged_as_by_the_package(tab: Any) -> None:
    rng = np.random.default_rng(33)
    seen = set()
    for _ in range(40):
        at, process = drawn_adrc(rng)
        loop = nrdob.linear_adrc(process, 1, at["plant"]["b0"], at["observer"], at["controller"])
        found = tab.evaluate("(at) => nrdob.judge(nrdob.kinds.adrc.loopOf(at))", at)
        assert found["stable"] == loop.stability().stable, at
        seen.add(found["stable"])
        if found["stable"]:
            assert found["Ms"] == pytest.approx(loop.margins().plant_loop.ms, rel=1e-5)
    assert seen == {True, False}


def test_the_bar_of_adrc_is_the_set_of_the_package(tab: Any) -> None:
    rng = np.random.default_rng(34)
    low, high = 3.0, 3000.0
    script = "([at, low, high]) => nrdob.kinds.adrc.stabilizing(at, low, high)"
    for _ in range(20):
        at, process = drawn_adrc(rng)
        found = tab.evaluate(script, [at, low, high])
        sets = nrdob.adrc_stabilizing_bandwidths(
            process, 1, at["plant"]["b0"], at["controller"], highest=2 * high
        )
        wanted = within(sets, low, high)
        assert len(found) == len(wanted), at
        assert np.allclose(found, wanted, rtol=1e-5), at


@pytest.mark.parametrize("signal", ["R", "d", "delta", "eta"])
def test_adrc_answers_as_in_the_package(tab: Any, signal: str) -> None:
    rng = np.random.default_rng(35)
    compared = 0
    while compared < 3:
        at, process = drawn_adrc(rng)
        loop = nrdob.linear_adrc(process, 1, at["plant"]["b0"], at["observer"], at["controller"])
        if not loop.stability().stable:
            continue
        script = "([at, signal]) => nrdob.step(nrdob.kinds.adrc.loopOf(at), signal, 0.3)"
        found = tab.evaluate(script, [at, signal])
        assert distance(found, loop, signal, least=1e-3, end=1) < 5e-3, at
        compared += 1


def test_every_move_is_drawn_in_words_and_stays_right(tab: Any) -> None:
    given = {
        "kind": "lags",
        "plant": coefficients(paper.example(3)),
        "start": {"lambda": 0.05, "order": 2, "gain": 1.0, "lag": 0.0, "zero": 0.0, "delay": 0.0},
        "range": {"lambda": RANGE["lambda"], "order": (2, 6), "gain": RANGE["gain"]},
        "last": 8.0,
    }  # fmt: skip
    data, still = escape(json.dumps(given), quote=True), '<img class="explorable-still">'
    tab.set_content(f'<!doctype html><div data-explorable="{data}">{still}</div>')
    for script in SCRIPTS:
        tab.add_script_tag(path=str(STATIC / script))
    sliders = tab.locator("input[type=range]")
    assert sliders.count() == 3
    verdict = tab.locator(".explorable-verdict")
    low, high = (math.log10(end) for end in RANGE["lambda"])
    ((_, edge),) = nrdob.stabilizing_time_constants(*_example_3(), 2)
    for share in np.linspace(0, 1, 9):
        at = low + float(share) * (high - low)
        sliders.nth(0).evaluate(
            "(slider, at) => { slider.value = at; slider.dispatchEvent(new Event('input')); }", at
        )
        moved = 10 ** float(sliders.nth(0).input_value())
        word = "stable" if moved < edge else "unstable"
        assert verdict.inner_text().lstrip("✓✗ ").startswith(word)
        words = tab.locator("svg[role=img]").evaluate_all("all => all.map(e => e.ariaLabel)")
        assert len(words) == 3 and all(words)
        assert f"{edge:.3f} s" in words[2]
    sliders.nth(0).focus()
    tab.keyboard.press("Home")
    assert verdict.inner_text().lstrip("✓ ").startswith("stable")
    tab.get_by_role("button").click()
    assert sliders.nth(0).get_attribute("aria-valuetext") == "0.05 s"


def _example_3() -> tuple[Any, Any]:
    loop = paper.example(3)
    return loop.process, loop.model
