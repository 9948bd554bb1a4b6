"""On a phone 360 pixels wide every letter of a figure is 8 pixels high, and none covers another."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

from lettering import LEAST, collisions, drawn_texts, shown, too_small
from nrdob import paper, stability_chart
from nrdob.plotting import Figure, MapAxis, map_plot, winding_animation, winding_plot
from nrdob.plotting.figure import SMALLEST, STYLE, WIDTH, headings

mpl.use("Agg")
ROOT = Path(__file__).resolve().parents[2]
SOURCES = [
    *(ROOT / "nrdob").rglob("*.py"), *(ROOT / "book").rglob("*.py"),
    *(ROOT / "notebooks").rglob("*.py"),
]  # fmt: skip
ZEROS, POLES = [-0.5, 0.5j, 1.5 + 1j], [0.3 + 0.2j]
LONG = "Example 3 with a plant that differs from its model in its gain and in its lag"


def chart() -> Figure:
    loop = paper.example(2)
    x, y = ("time_constant", 0.005, 0.5), ("gain", 0.5, 2.0)
    return stability_chart(loop.process, loop.model, loop.filter, x=x, y=y).plot(title="Example 2")


def members() -> Figure:
    gain, lag = (axis.ravel() for axis in np.meshgrid(np.linspace(0.5, 1, 9), np.linspace(0, 1, 9)))
    stable = gain * lag < 0.5
    x, y = MapAxis("gain, times the nominal", gain), MapAxis("additional lag (s)", lag)
    return map_plot(x, y, stable, gain < 0.9, title="Members")


DRAW: dict[str, Callable[[], Figure]] = {
    **{
        f"{kind} of example {k}": lambda kind=kind, k=k, of=of: getattr(paper.example(k), kind)(
            *of, title=f"Example {k}"
        )
        for k in (1, 2, 3, 4)
        for kind, of in (("plot_nyquist", ["L"]), ("plot_bode", ["L"]), ("plot_step", []))
    },
    "two curves": lambda: paper.example(3).plot_bode("FH", "T_R", title=LONG),
    "compared loops": lambda: paper.example(3).plot_step(
        compare=paper.example(3, modified=True), title=LONG
    ),
    "control signal": lambda: paper.example(3).plot_step(signal="u"),
    "chart": chart,
    "map": members,
    "walk": lambda: winding_plot(ZEROS, POLES),
    "end of the walk": lambda: winding_animation(ZEROS, POLES),
}
each_kind = pytest.mark.parametrize("draw", DRAW.values(), ids=DRAW)


@pytest.fixture(autouse=True)
def _no_figures() -> Iterator[None]:
    plt.close("all")
    yield
    plt.close("all")


def test_the_smallest_type_can_be_read_on_a_phone() -> None:
    assert shown(SMALLEST) >= LEAST


def test_no_type_of_the_style_is_smaller() -> None:
    style = mpl.rc_params_from_file(STYLE, use_default_template=False)
    sizes = {name: size for name, size in style.items() if name.endswith("size")}
    sizes = {name: size for name, size in sizes.items() if "minor" not in name}
    assert {"font.size", "legend.fontsize", "xtick.labelsize"} <= set(sizes)
    assert min(sizes.values()) == SMALLEST


@pytest.mark.thorough
@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.name)
def test_no_code_writes_smaller(path: Path) -> None:
    assert too_small(path.read_text("utf-8")) == []


def test_smaller_type_is_found() -> None:
    assert too_small('ax.text(0, 0, "here", size=8)\nax.legend(fontsize="small")') == [
        "line 1: size=8",
        "line 2: fontsize='small'",
    ]
    assert too_small("rng.normal(size=2)\nax.text(0, 0, '', fontsize=9)") == []


@pytest.mark.thorough
@each_kind
def test_no_text_is_too_small_cut_off_or_over_another(draw: Callable[[], Figure]) -> None:
    figure = draw().figure
    texts = drawn_texts(figure)
    assert figure.get_figwidth() == WIDTH
    assert min(shown(text.get_fontsize(), figure.get_figwidth()) for text in texts) >= LEAST
    assert collisions(texts, figure.bbox) == []


def test_type_of_the_animation_can_be_read_too() -> None:
    svg = winding_animation(ZEROS, POLES).svg
    width = float(svg.partition('viewBox="0 0 ')[2].split()[0])
    points = float(svg.partition('font-size="')[2].partition('"')[0])
    assert shown(points, width / 72) >= LEAST


@pytest.mark.slow
def test_a_heading_that_is_too_long_takes_more_lines_and_keeps_its_formulas_whole() -> None:
    _, ax = plt.subplots(figsize=(WIDTH, 3))
    headings(ax, "Short", "$N$ = 0")
    assert (ax.get_title(loc="left"), ax.get_title(loc="right")) == ("Short", "$N$ = 0")
    said = f"{LONG}, $F = 1/(1 + 0.1 s)$"
    headings(ax, said)
    lines = ax.get_title(loc="left").split("\n")
    assert len(lines) == 3 and " ".join(lines) == said
    assert all(line.count("$") % 2 == 0 for line in lines)


def test_a_heading_stands_above_what_has_no_room_beside_it() -> None:
    _, ax = plt.subplots(figsize=(WIDTH, 3))
    headings(ax, LONG[:45], "$N$ = −1,  $P$ = 1")
    assert ax.get_title(loc="left") == f"{LONG[:45].strip()}\n"
