"""What can be moved on a page, without a kernel: a loop with sliders.

    ```{explorable} 05_how_slow_must_the_filter_be
    ```

stands for what ``explorables.toml`` has under this name. There `shows = 3` is Example 3 of the
paper, `motor` a motor's speed under a load, with the observer and without, `sampled` the motor's
speed loop on a processor, `adrc` the same motor under linear ADRC, `proof` Example 4 with the half
planes that count its roots. With `upwards = "delay"` or `"gain"` the page has a stability chart as
well: λ across, this of the plant upwards. The page carries the coefficients of its blocks, which
come from `nrdob.paper`, and a still picture for those without a script; the script computes the
rest. Beside it ``{diagram} nrdob`` draws a block diagram of the package on a page that is no
notebook.
"""

import base64
import json
import tomllib
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import Any, Self

import control as ct
import numpy as np
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from nrdob import NRDOB, LowPassFilter, delay, paper, stability_chart
from nrdob.alternatives import linear_adrc
from nrdob.plotting import COLOURS, SHORT, TALL, Figure, axes_for, diagrams, styled

SCRIPTS = tuple(
    f"explore/{name}.js"
    for name in ("loop", "curve", "chart", "sampled", "adrc", "proof", "plot", "view")
)
AT_REST = {"gain": 1.0, "lag": 0.0, "zero": 0.0, "delay": 0.0}
SLIDERS = ("lambda", "observer", "controller", "T", "gain", "lag", "zero", "delay")
"""What a slider may move, in the order of the page."""
TABLE = "explorables.toml"
"""What can be moved, by chapter."""
OTHERS = {"shows", "caption", "last", "upwards"}
"""What an entry of the table says besides."""


@dataclass(frozen=True)
class Scene:
    """What stands on a page before anything is moved, and from which to which order one can go."""

    kind: str
    loop: NRDOB
    start: dict[str, float]
    orders: tuple[int, int] | None
    more: dict[str, float] = field(default_factory=dict)
    told: dict[str, Any] = field(default_factory=dict)

    @property
    def plant(self) -> dict[str, Any]:
        """The coefficients that the script starts from."""
        return coefficients(self.loop) | self.more

    def charted(self) -> Self:
        """Begin with the whole dead time as one that can be moved."""
        start = self.start | {"delay": self.loop.delay}
        return replace(self, start=start, more=self.more | {"delay": 0.0})


def scene(name: str) -> Scene:
    """Give what an explorable shows: an example of the paper by its number, or the motor."""
    motor = ct.tf([1.0], [0.01, 0.1])  # torque to speed: 1/(J s + b)
    if name == "motor":
        loop = NRDOB(motor, motor, 1.0, LowPassFilter(0.006, 1))
        start = {"lambda": 0.006, "order": 1, "delay": 0.005}
        told = {"load": -1.0, "output": "speed error in rad/s"}
        return Scene("lags", loop, start, None, told=told)
    if name == "sampled":
        loop = NRDOB(motor, motor, 1.0, LowPassFilter(0.02, 2))
        return Scene(name, loop, {"lambda": 0.02, "order": 2, "T": 0.005}, (1, 4))
    if name == "adrc":
        b0, start = 100.0, {"observer": 100.0, "controller": 30.0}
        motor = ct.tf([b0], [1.0, 10.0])
        loop = linear_adrc(motor, 1, b0, start["observer"], start["controller"])
        return Scene(name, loop, start, None, {"b0": b0})
    kind, number = ("proof", 4) if name == "proof" else ("lags", int(name))
    loop = paper.example(number)
    least = loop.model.den[0][0].size - loop.model.num[0][0].size
    start = {"lambda": loop.filter.time_constant, "order": loop.filter.order}
    return Scene(kind, loop, start, (max(least, 1), 6))


def still(shown: Scene, upwards: str, ranges: dict[str, tuple[float, float]]) -> Figure:
    """Draw what stands on a page without a script: the chart, or the curve whose turns count."""
    loop = shown.loop
    if shown.told:
        return under_load(shown)
    if not upwards:
        return loop.plot_nyquist("L" if shown.kind == "adrc" else "FH")
    start = AT_REST | shown.start
    x, y = ("time_constant", *ranges["lambda"]), (upwards, *ranges[upwards])
    chart = stability_chart(loop.process, loop.model, loop.filter, x=x, y=y)
    with styled():
        (ax,) = axes_for(None, 1, TALL)
        figure = chart.plot(ax=ax)
        ax.plot(start["lambda"], start[upwards], "o", color=COLOURS["critical"], clip_on=False)
    count = chart.count(start["lambda"], start[upwards])
    said = f"; the loop of this page has {count:g} at λ = {start['lambda']:g} s"
    return Figure(chart, ax, alt=figure.alt + said)


def under_load(shown: Scene) -> Figure:
    """Draw the speed under the load, with the observer and without."""
    late = delay(shown.start["delay"]) * shown.loop.process
    times, load = np.linspace(0.0, 0.5, 501), shown.told["load"]

    def speed(filter: LowPassFilter) -> Any:
        loop = NRDOB(late, shown.loop.model, shown.loop.controller, filter)
        return load * loop.step_response("delta", times).outputs[0, 0]

    # A filter that is slower by far than what is shown is no observer.
    held, plain = speed(shown.loop.filter), speed(LowPassFilter(5e5, 1))
    with styled():
        (ax,) = axes_for(None, 1, SHORT)
        ax.plot(times, plain, color=COLOURS["model"], label="controller alone")
        ax.plot(times, held, color=COLOURS["loop"], label="with the observer")
        ax.set(xlabel="time (s)", ylabel=shown.told["output"])
        ax.legend(loc="center right")
    said = f"{held[-1]:.2f} rad/s with the observer and {plain[-1]:.2f} without"
    return Figure(None, ax, alt=f"Speed error after a load of {-load:g} N m: in the end {said}")


def embedded(figure: Figure, kind: str) -> str:
    """Write a figure as an image that the page holds, of a class of the style sheet."""
    picture = base64.b64encode(figure.png()).decode()
    return f'<img class="{kind}" alt="{escape(figure.alt)}" src="data:image/png;base64,{picture}">'


def coefficients(loop: NRDOB) -> dict[str, Any]:
    """Give the loop's blocks as the script wants them, in descending powers of s."""
    found: dict[str, Any] = {"delay": loop.delay}
    for block, end in (("G", ""), ("Gm", "m"), ("C", "c")):
        fraction = getattr(loop.fractions, block)
        found |= {f"N{end}": fraction.num.tolist(), f"D{end}": fraction.den.tolist()}
    return found


def carried(
    shown: Scene, upwards: str, ranges: dict[str, tuple[float, float]], last: float
) -> dict[str, Any]:
    """Give what the script is told by the page."""
    first, *others = ranges
    orders = {"order": shown.orders} if shown.orders else {}
    return {
        "kind": shown.kind,
        "plant": shown.plant,
        **shown.told,
        "start": AT_REST | shown.start | ({"upwards": upwards} if upwards else {}),
        "range": {first: ranges[first]} | orders | {slider: ranges[slider] for slider in others},
        "last": last,
    }


def places(book: Path) -> dict[str, dict[str, Any]]:
    """Read the table of what can be moved."""
    return tomllib.loads((book / TABLE).read_text("utf-8"))


class Explorable(SphinxDirective):
    """A figure that can be moved."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        book = Path(self.env.srcdir)
        self.env.note_dependency(book / TABLE)
        place = places(book)[self.arguments[0]]
        if unknown := place.keys() - {*OTHERS, *SLIDERS}:
            raise self.error(f"an explorable has no {', '.join(sorted(unknown))}")
        upwards = place.get("upwards", "")
        shown = scene(str(place["shows"]))
        shown = shown.charted() if upwards else shown
        ranges = {slider: tuple(place[slider]) for slider in SLIDERS if slider in place}
        picture = embedded(still(shown, upwards, ranges), "explorable-still")
        told = escape(json.dumps(carried(shown, upwards, ranges, place.get("last", 10.0))))
        html = f'<div data-explorable="{told}">{picture}</div>'
        text, _ = self.parse_inline(place["caption"])
        figure = nodes.figure(classes=["explorable"])
        figure += [nodes.raw("", html, format="html"), nodes.caption("", "", *text)]
        self.env.metadata[self.env.docname]["explorable"] = "yes"
        return [figure]


class BlockDiagram(SphinxDirective):
    """Draw one of `nrdob.plotting.diagrams`, with what it shows in words."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        drawn = getattr(diagrams, self.arguments[0])().plot()
        return [nodes.raw("", embedded(drawn, "diagram"), format="html")]


def add_scripts(app: Sphinx, page: str, _: str, _context: object, doctree: object) -> None:
    """Load the scripts where there is something to be moved."""
    if doctree is not None and "explorable" in app.env.metadata[page]:
        for script in SCRIPTS:
            app.add_js_file(script, loading_method="defer")


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("explorable", Explorable)
    app.add_directive("diagram", BlockDiagram)
    app.connect("html-page-context", add_scripts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
