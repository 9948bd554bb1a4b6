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
from explorable import AT_REST, SCRIPTS, carried, coefficients, scene, still
from nrdob import NRDOB, LowPassFilter, paper
from nrdob.alternatives import adrc_stabilizing_bandwidths, linear_adrc

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


@pytest.mark.thorough
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


@pytest.mark.thorough
@pytest.mark.parametrize("number", paper.EXAMPLES)
def test_the_bar_shows_the_stabilising_set(tab: Any, number: int) -> None:
    rng = np.random.default_rng(10 + number)
    low, high = RANGE["lambda"]
    for _ in range(8):
        at, loop = drawn(rng, number)
        found = tab.evaluate(
            "([at, low, high]) => nrdob.drained(nrdob.stabilizing(at, low, high))", [at, low, high]
        )
        sets = nrdob.stabilizing_time_constants(
            loop.process, loop.model, at["order"], floor=low / 2
        )
        wanted = within(sets, low, high)
        assert len(found) == len(wanted), at
        assert np.allclose(found, wanted, rtol=1e-6)


@pytest.mark.thorough
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


@pytest.mark.thorough
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


@pytest.mark.thorough
def test_the_bar_of_the_sampled_loop_is_the_set_of_the_package(tab: Any) -> None:
    rng = np.random.default_rng(31)
    low, high = 0.0005, 0.5
    script = "([at, low, high]) => nrdob.drained(nrdob.kinds.sampled.stabilizing(at, low, high))"
    for _ in range(15):
        at, loop = drawn_sampled(rng)
        found = tab.evaluate(script, [at, low, high])
        sets = nrdob.stabilizing_time_constants(
            loop.process, loop.model, at["order"], floor=low / 2, dt=at["T"]
        )
        wanted = within(sets, low, high)
        assert len(found) == len(wanted), at
        assert np.allclose(found, wanted, rtol=1e-5), at


@pytest.mark.thorough
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


@pytest.mark.thorough
def test_adrc_is_judged_as_by_the_package(tab: Any) -> None:
    rng = np.random.default_rng(33)
    seen = set()
    for _ in range(40):
        at, process = drawn_adrc(rng)
        loop = linear_adrc(process, 1, at["plant"]["b0"], at["observer"], at["controller"])
        found = tab.evaluate("(at) => nrdob.judge(nrdob.kinds.adrc.loopOf(at))", at)
        assert found["stable"] == loop.stability().stable, at
        seen.add(found["stable"])
        if found["stable"]:
            assert found["Ms"] == pytest.approx(loop.margins().plant_loop.ms, rel=1e-5)
    assert seen == {True, False}


@pytest.mark.thorough
def test_the_bar_of_adrc_is_the_set_of_the_package(tab: Any) -> None:
    rng = np.random.default_rng(34)
    low, high = 3.0, 3000.0
    script = "([at, low, high]) => nrdob.drained(nrdob.kinds.adrc.stabilizing(at, low, high))"
    for _ in range(20):
        at, process = drawn_adrc(rng)
        found = tab.evaluate(script, [at, low, high])
        sets = adrc_stabilizing_bandwidths(
            process, 1, at["plant"]["b0"], at["controller"], highest=2 * high
        )
        wanted = within(sets, low, high)
        assert len(found) == len(wanted), at
        assert np.allclose(found, wanted, rtol=1e-5), at


@pytest.mark.thorough
@pytest.mark.parametrize("signal", ["R", "d", "delta", "eta"])
def test_adrc_answers_as_in_the_package(tab: Any, signal: str) -> None:
    rng = np.random.default_rng(35)
    compared = 0
    while compared < 3:
        at, process = drawn_adrc(rng)
        loop = linear_adrc(process, 1, at["plant"]["b0"], at["observer"], at["controller"])
        if not loop.stability().stable:
            continue
        script = "([at, signal]) => nrdob.step(nrdob.kinds.adrc.loopOf(at), signal, 0.3)"
        found = tab.evaluate(script, [at, signal])
        assert distance(found, loop, signal, least=1e-3, end=1) < 5e-3, at
        compared += 1


# --- The chart ------------------------------------------------------------------------------------

UPWARDS = {"delay": (0.0, 0.3), "gain": (0.1, 10.0)}

BORDERS = """([at, upwards, across, ends]) => {
  const { abs, add, late, mul, value } = nrdob.parts;
  const drawn = [...nrdob.borders(at, upwards, across, ends)].filter(Boolean);
  return drawn.map((curve) => curve.map((p) => {
    const loop = nrdob.loopOf({ ...at, lambda: p.lambda, [upwards]: p.up });
    const s = [0, p.omega];
    const [q, back] = [value(loop.q, s), mul(value(loop.r, s), late(loop, p.omega))];
    return [p.lambda, p.up, abs(add(q, back)) / abs(q)];
  }));
}"""


def drawn_chart(rng: np.random.Generator, upwards: str) -> tuple[dict[str, Any], NRDOB]:
    """Draw a position of the sliders of a chart, and the loop that stands at its lowest values."""
    at, _ = drawn(rng, 3 + int(rng.integers(2)))
    shown = scene("4" if at["plant"]["delay"] else "3").charted()
    at |= {"plant": shown.plant, "zero": 0.0, "delay": at["delay"] or 0.05}
    at[upwards] = {"delay": 0.0, "gain": 1.0}[upwards]
    G = shown.loop.fractions.G
    lag = ct.tf([1.0], [at["lag"], 1.0] if at["lag"] else [1.0])
    process = nrdob.delay(at["delay"]) * (at["gain"] * ct.tf(G.num, G.den) * lag)
    return at, NRDOB(process, shown.loop.model, 0, LowPassFilter(at["lambda"], at["order"]))


def charted(at: dict[str, Any], loop: NRDOB, upwards: str) -> nrdob.StabilityChart:
    """Give the package's chart of these sliders."""
    across = ("time_constant", *RANGE["lambda"])
    return nrdob.stability_chart(
        loop.process, loop.model, at["order"], x=across, y=(upwards, *UPWARDS[upwards])
    )


def shares(chart: nrdob.StabilityChart, x: Any, y: Any) -> np.ndarray:
    """Give points as parts of the width and of the height of a chart."""
    return np.column_stack([chart.x.share(x), chart.y.share(y)])


def farthest(points: list[np.ndarray], lines: list[np.ndarray]) -> float:
    """Tell how far the farthest of some points on the chart is from all lines, 30 of each curve."""
    given = np.vstack([*(each[:: 1 + len(each) // 30] for each in points), np.empty((0, 2))])
    given = given[((given >= 0) & (given <= 1)).all(axis=1)]
    nearest = np.full(len(given), np.inf)
    for line in lines:
        start, way = line[:-1], np.diff(line, axis=0)
        for k, point in enumerate(given):
            along = ((point - start) * way).sum(axis=1) / ((way**2).sum(axis=1) + 1e-30)
            off = point - start - np.clip(along, 0, 1)[:, None] * way
            nearest[k] = min(nearest[k], np.hypot(*off.T).min())
    return float(nearest.max(initial=0.0))


@pytest.mark.thorough
@pytest.mark.parametrize("upwards", UPWARDS)
def test_the_borders_of_the_chart_are_those_of_the_package(tab: Any, upwards: str) -> None:
    rng = np.random.default_rng(40)
    seen = 0
    for _ in range(8):
        at, loop = drawn_chart(rng, upwards)
        chart = charted(at, loop, upwards)
        curves = tab.evaluate(BORDERS, [at, upwards, RANGE["lambda"], UPWARDS[upwards]])
        found = [np.array(curve) for curve in curves]
        assert all(curve[:, 2].max() < 1e-9 for curve in found), at
        mine = [shares(chart, *curve.T[:2]) for curve in found]
        wanted = [shares(chart, border.x, border.y) for border in chart.borders]
        assert farthest(mine, wanted) < 1e-3 and farthest(wanted, mine) < 1e-3, at
        seen += len(found)
    assert seen > 8


@pytest.mark.thorough
@pytest.mark.parametrize("upwards", UPWARDS)
def test_the_count_at_the_point_of_the_chart_is_that_of_the_package(tab: Any, upwards: str) -> None:
    rng = np.random.default_rng(41)
    seen = set()
    for _ in range(5):
        at, loop = drawn_chart(rng, upwards)
        chart = charted(at, loop, upwards)
        for u, v in rng.random((8, 2)):
            lam, up = float(chart.x.value(u)), float(chart.y.value(v))
            moved = {**at, "lambda": lam, upwards: up}
            count = tab.evaluate("(at) => nrdob.judge(nrdob.loopOf(at)).Z", moved)
            assert count == chart.count(lam, up), moved
            seen.add(count)
    assert {0, 2} <= seen


@pytest.mark.thorough
@pytest.mark.parametrize("upwards", UPWARDS)
def test_the_point_of_the_chart_is_moved_by_keys_and_mouse(tab: Any, upwards: str) -> None:
    ranges = {"lambda": RANGE["lambda"], "gain": UPWARDS["gain"], "delay": UPWARDS["delay"]}
    shown = scene("4").charted()
    opened(tab, carried(shown, upwards, ranges, 8.0))
    chart, sliders = tab.get_by_role("slider", name="Stability chart"), tab.locator("input")
    height = sliders.nth(1 + list(ranges).index(upwards))
    tab.wait_for_function("() => nrdob.explorables[0].chart.done")
    assert chart.locator(".border").count() > 0 and chart.locator(".works").count() > 9
    before, up = float(sliders.nth(0).input_value()), float(height.input_value())
    chart.focus()
    for key in ("ArrowLeft", "Shift+ArrowLeft", "Shift+ArrowUp"):
        tab.keyboard.press(key)
    low, high = map(math.log10, RANGE["lambda"])
    moved = float(sliders.nth(0).input_value())
    assert moved == pytest.approx(before - 0.11 * (high - low), abs=0.005)
    assert float(height.input_value()) > up
    box = chart.bounding_box()
    for x, word in ((0.93, "stable"), (0.16, "unstable")):
        tab.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        tab.mouse.down()
        tab.mouse.move(box["x"] + x * box["width"], box["y"] + 0.07 * box["height"])
        tab.mouse.up()
        verdict = tab.locator(".explorable-verdict").inner_text()
        assert verdict.lstrip("✓✗ ").lower().startswith(word)
        count = tab.evaluate("nrdob.explorables[0].last.found.Z")
        assert f"{abs(count):g} roots in the right half plane" in chart.get_attribute(
            "aria-valuetext"
        )
    assert ": stable for λ from " in tab.locator(".explorable-set").inner_text()


@pytest.mark.thorough
def test_a_finger_on_the_point_of_the_chart_moves_it_and_elsewhere_the_page(tab: Any) -> None:
    page = tab.context.browser.new_page(has_touch=True, viewport={"width": 360, "height": 500})
    ranges = {"lambda": RANGE["lambda"], "delay": UPWARDS["delay"]}
    opened(page, carried(scene("4").charted(), "delay", ranges, 8.0))
    fingers = page.context.new_cdp_session(page)

    def drag(place: dict[str, float]) -> tuple[str, float]:
        x, y = place["x"] + 0.5 * place["width"], place["y"] + 0.5 * place["height"]
        for k in range(6):
            at = [{"x": x - 8 * k, "y": y - 8 * k}]
            kind = "touchMove" if k else "touchStart"
            fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": at})
        fingers.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        page.wait_for_timeout(200)
        return chart.get_attribute("aria-valuetext"), page.evaluate("scrollY")

    chart = page.locator(".chart")
    before = chart.get_attribute("aria-valuetext")
    moved, scrolled = drag(page.locator(".chart .here").bounding_box())
    assert moved != before and scrolled == 0
    kept, scrolled = drag(chart.bounding_box() | {"width": 120})
    assert kept == moved and scrolled > 0
    page.close()


def test_stills_show_what_the_pages_begin_with() -> None:
    ranges = {"lambda": (0.003, 1.0), "delay": (0.0, 0.3)}
    picture = still(scene("4").charted(), "delay", ranges)
    assert picture.alt.startswith("Stability chart in time constant λ and dead time")
    assert picture.alt.endswith("the loop of this page has 0 at λ = 0.09 s")
    assert "of L" in still(scene("adrc"), "", {}).alt


def opened(tab: Any, given: dict[str, Any]) -> None:
    """Set a page that is told this, with its scripts."""
    data, picture = escape(json.dumps(given), quote=True), '<img class="explorable-still">'
    tab.set_content(
        f'<!doctype html><div class="explorable" data-explorable="{data}">{picture}</div>'
    )
    tab.add_style_tag(path=str(STATIC / "book.css"))
    for script in SCRIPTS:
        tab.add_script_tag(path=str(STATIC / script))


def test_every_move_is_drawn_in_words_and_stays_right(tab: Any) -> None:
    given = {
        "kind": "lags",
        "plant": coefficients(paper.example(3)),
        "start": AT_REST | {"lambda": 0.05, "order": 2},
        "range": {"lambda": RANGE["lambda"], "order": (2, 6), "gain": RANGE["gain"]},
        "last": 8.0,
    }  # fmt: skip
    opened(tab, given)
    sliders = tab.locator("input[type=range]")
    assert sliders.count() == 4  # with the instant of the step
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
        assert verdict.inner_text().lstrip("✓✗ ").lower().startswith(word)
        words = tab.locator("svg[role=img]").evaluate_all("all => all.map(e => e.ariaLabel)")
        assert len(words) == 3 and all(words)
        assert f"{edge:.3f} s" in words[2]
    sliders.nth(0).focus()
    tab.keyboard.press("Home")
    assert verdict.inner_text().lstrip("✓ ").lower().startswith("stable")
    tab.get_by_role("button", name="Reset").click()
    assert sliders.nth(0).get_attribute("aria-valuetext") == "0.05 s"


def _example_3() -> tuple[Any, Any]:
    loop = paper.example(3)
    return loop.process, loop.model


def test_a_curve_that_is_one_point_is_seen(tab: Any) -> None:
    """The model of Example 1 is exact: F·H is 0, until the plant has a lag."""
    shown = scene("1")
    opened(tab, carried(shown, "", {"lambda": (0.003, 0.3), "lag": (0.0, 0.5)}, 2.0))
    nyquist = tab.locator("svg[aria-label^=Nyquist]")
    assert nyquist.locator("circle.point").count() == 1
    assert "F·H is the point 0" in nyquist.locator("text").all_text_contents()
    assert "F·H is the point 0" in nyquist.get_attribute("aria-label")
    tab.locator("input[type=range]").nth(2).press("End")
    assert nyquist.locator("circle.point").count() == 0
    assert nyquist.locator("polyline.curve").count() == 1
    facts = tab.locator(".explorable-fact").all_text_contents()
    assert [fact.split(" = ")[0] for fact in facts[:3]] == ["N", "P", "Z"]


# --- Under the hand, and to the ear ---------------------------------------------------------------

DELAYED = {"lambda": (0.003, 1.0), "gain": (0.1, 5.0), "lag": (0.0, 0.5), "delay": (0.0, 0.3)}


def spoken(slider: Any) -> float:
    """Give the value that a slider says."""
    return float(slider.get_attribute("aria-valuetext").split()[0].replace("−", "-"))


def dragged(tab: Any, piece: Any, by: float) -> None:
    """Take hold of the middle of a piece of the page and drag it to the right by some pixels."""
    box = piece.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x + by, y)
    tab.mouse.up()


def test_the_filter_is_dragged_on_the_bar_and_by_keys(tab: Any) -> None:
    opened(tab, carried(scene("4"), "", DELAYED, 8.0))
    slider, bar = tab.get_by_label("filter’s time constant λ"), tab.locator(".bar")
    low, high = DELAYED["lambda"]
    dragged(tab, bar, 0.25 * bar.bounding_box()["width"])
    share = (0.75 * 480 - 8) / 464
    assert spoken(slider) == pytest.approx(low * (high / low) ** share, rel=0.01)
    slider.focus()
    heard = []
    for key in ("Home", "ArrowRight", "PageUp", "End", "ArrowLeft", "PageDown"):
        tab.keyboard.press(key)
        heard.append(float(slider.input_value()))
    first, right, far, last, left, back = heard
    assert [first, last] == pytest.approx([math.log10(low), math.log10(high)], abs=1e-9)
    assert first < right < far < back < left < last
    assert far - right > 5 * (right - first)


@pytest.mark.thorough
def test_the_step_is_dragged_to_its_instant_and_the_answer_follows(tab: Any) -> None:
    page = tab.context.browser.new_page()  # one that was opened anew captures no pointer
    opened(page, carried(scene("motor"), "", {"lambda": (0.003, 0.3), "gain": (0.5, 2.0)}, 0.5))
    plot, slider = page.locator("svg.step"), page.get_by_label("the step comes at")
    assert spoken(slider) == 0
    dragged(page, plot.locator(".instant .grip"), 0.2 * plot.bounding_box()["width"])
    at = spoken(slider)
    assert 0.1 < at < 0.15
    # Until then nothing has happened, with the observer and without.
    mark = plot.locator(".instant").bounding_box()
    middle = mark["x"] + mark["width"] / 2
    begun = plot.locator("polyline").evaluate_all(
        "all => all.map(e => new DOMPoint(e.points[1].x, 0).matrixTransform(e.getScreenCTM()).x)"
    )
    assert begun == pytest.approx([middle, middle], abs=1)
    assert f"after a load of 1 N m at {slider.get_attribute('aria-valuetext')}" in (
        plot.get_attribute("aria-label")
    )
    slider.press("End")
    assert spoken(slider) == 0.25
    page.get_by_role("button", name="Reset").click()
    assert spoken(slider) == 0
    page.close()


@pytest.mark.parametrize("upwards", UPWARDS)
def test_home_end_and_the_page_keys_move_the_point_of_the_chart(tab: Any, upwards: str) -> None:
    opened(tab, carried(scene("4").charted(), upwards, DELAYED, 8.0))
    tab.get_by_role("slider", name="Stability chart").focus()
    state = "nrdob.explorables[0].state"
    tab.keyboard.press("Home")
    assert tab.evaluate(f"{state}.lambda") == pytest.approx(DELAYED["lambda"][0])
    tab.keyboard.press("End")
    assert tab.evaluate(f"{state}.lambda") == pytest.approx(DELAYED["lambda"][1])
    before = tab.evaluate(f"{state}.{upwards}")
    tab.keyboard.press("PageUp")
    above = tab.evaluate(f"{state}.{upwards}")
    tab.keyboard.press("PageDown")
    assert above > before == pytest.approx(tab.evaluate(f"{state}.{upwards}"))


def test_every_slider_has_a_name_and_a_value_and_one_sentence_is_spoken(tab: Any) -> None:
    """As a screen reader is told: what the browser hands on, not what the page is written in."""
    opened(tab, carried(scene("4").charted(), "delay", DELAYED, 8.0))
    tab.get_by_role("slider", name="plant’s gain over the model’s").press("ArrowRight")
    spy = tab.context.new_cdp_session(tab)
    nodes = spy.send("Accessibility.getFullAXTree")["nodes"]
    heard = [node for node in nodes if not node["ignored"]]

    def value_text(node: dict[str, Any]) -> str:
        # The protocol tells no text of a value, so it is read where the browser takes it from.
        found = spy.send("DOM.describeNode", {"backendNodeId": node["backendDOMNodeId"]})["node"]
        given = found["attributes"]
        return dict(zip(given[::2], given[1::2], strict=True))["aria-valuetext"]

    def told(node: dict[str, Any], name: str) -> Any:
        found = [
            each["value"].get("value")
            for each in node.get("properties", [])
            if each["name"] == name
        ]
        return found[0] if found else None

    sliders = [node for node in heard if node["role"]["value"] == "slider"]
    assert len(sliders) == 2 + len(DELAYED) + 1  # with the order, the instant and the chart
    for node in sliders:
        assert node["name"]["value"] and value_text(node), node
    assert len({node["name"]["value"] for node in sliders}) == len(sliders)
    live = [node for node in nodes if told(node, "live") not in (None, "off")]
    assert [(node["role"]["value"], told(node, "live")) for node in live] == [("status", "polite")]
    # Nothing is said while the hand moves, and then the verdict, once.
    quiet = """() => {
      const [page] = nrdob.explorables;
      const before = page.live.textContent;
      return [0.1, 5, 0.2].every((gain) => (page.to({ gain }), page.live.textContent === before));
    }"""
    assert tab.evaluate(quiet)
    verdict = tab.locator(".explorable-verdict").inner_text().lstrip("✓✗ ")
    spoken = "(verdict) => document.querySelector('[role=status]').textContent.startsWith(verdict)"
    tab.wait_for_function(spoken, arg=verdict)


SHARPEST = """() => Math.max(...[...document.querySelectorAll(".nyquist .curve")].flatMap((e) => {
  const points = [...e.points];
  return points.slice(1, -1).map((b, k) => {
    const [a, c] = [points[k], points[k + 2]];
    const [u, v] = [[b.x - a.x, b.y - a.y], [c.x - b.x, c.y - b.y]];
    // By so many pixels would an arc leave the two lines.
    const angle = Math.abs(Math.atan2(u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1]));
    return (Math.min(Math.hypot(...u), Math.hypot(...v)) * Math.tan(angle / 4)) / 2;
  });
}))"""


def test_the_spirals_of_a_dead_time_are_round(tab: Any) -> None:
    opened(tab, carried(scene("4"), "", DELAYED, 8.0))
    for curve in ("FH", "H", "L"):
        for lam in (0.003, 0.03, 0.3):
            at = {"curve": curve, "lambda": lam, "delay": 0.3, "gain": 5.0}
            tab.evaluate("(at) => nrdob.explorables[0].to(at)", at)
            assert tab.locator(".nyquist .curve").count() > 0
            assert tab.evaluate(SHARPEST) < 0.5, at
    nyquist = tab.locator(".nyquist")
    assert nyquist.locator(".arrow").count() > 0
    assert nyquist.locator("circle.unit").count() == nyquist.locator("path.minus-one").count() == 1
    assert nyquist.locator(".title").text_content() == "Nyquist curve of L"
    tab.evaluate("nrdob.explorables[0].to({ curve: 'FH', lambda: 0.3, gain: 1 })")
    assert nyquist.locator(".distance").count() == 1


CROWDED = """() => [...document.querySelectorAll(".explorable svg")].flatMap((plot) => {
  const room = plot.getBoundingClientRect();
  const words = [...plot.querySelectorAll("text")].map((e) => [e, e.getBoundingClientRect()]);
  const over = ([, a], [, b]) =>
    a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 3 && b.top < a.bottom - 3;
  const outside = words.filter(([, a]) => a.left < room.left - 1 || a.right > room.right + 1);
  const frame = words.filter(([each]) => each.parentNode === words[0][0].parentNode);
  return [...outside, ...frame.filter((a, k) => frame.slice(k + 1).some((b) => over(a, b)))]
    .map(([each]) => each.textContent);
})"""


@pytest.mark.thorough
@pytest.mark.parametrize("shown", ["motor", "4", "proof", "sampled", "adrc"])
def test_no_word_of_a_plot_is_cut_or_lies_over_another(tab: Any, shown: str) -> None:
    ranges = DELAYED
    if shown == "adrc":
        ranges = {"observer": (3.0, 3000.0), "controller": (3.0, 300.0), "gain": (0.1, 10.0)}
    opened(tab, carried(scene(shown), "", ranges, 0.5))
    tab.set_viewport_size({"width": 800, "height": 900})
    curves = tab.evaluate("Object.keys(nrdob.explorables[0].kind.curves)")
    first = next(iter(ranges))
    for curve in curves:
        for signal in ("delta", "R"):
            for lead in ranges[first]:
                for gain in ranges["gain"]:
                    at = {"curve": curve, "signal": signal, first: lead, "gain": gain}
                    tab.evaluate("(at) => nrdob.explorables[0].to(at)", at)
                    assert tab.evaluate(CROWDED) == [], at


def test_counts_are_whole_numbers(tab: Any) -> None:
    opened(tab, carried(scene("3"), "", {"lambda": RANGE["lambda"], "gain": RANGE["gain"]}, 8.0))
    for lam in np.geomspace(*RANGE["lambda"], 9):
        tab.evaluate("(at) => nrdob.explorables[0].to(at)", {"lambda": float(lam)})
        facts = tab.locator(".explorable-fact").all_inner_texts()[:3]
        assert all(fact.split("= ")[-1].lstrip("−").isdigit() for fact in facts), facts
    order = tab.get_by_label("filter’s order n")
    order.press("ArrowRight")
    assert order.get_attribute("aria-valuetext") == "3"
