"""What can be moved on a page, without a kernel: a loop of the paper, with sliders.

    ```{explorable} 3
    :range-lambda: 0.005 2
    :last: 6

    The caption.
    ```

stands for Example 3 of the paper. The page carries the coefficients of its blocks, which come from
`nrdob.paper`, and a still picture for those without a script; the script computes the rest. Into
chapters, which are notebooks, it comes after the question that opens them: see `explorables.toml`.
"""

from __future__ import annotations

import base64
import json
import tomllib
from html import escape
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from nrdob import NRDOB, paper
from predictions import KEY

SCRIPTS = ("explore/loop.js", "explore/view.js")
LEAST_ORDER, MOST_ORDER = 1, 6
CHAPTERS, PLACES = "chapters", "explorables.toml"


def limits(text: str) -> tuple[float, float]:
    """Read the two ends of a slider."""
    low, high = map(float, text.split())
    return low, high


def coefficients(loop: NRDOB) -> dict[str, Any]:
    """Give the loop's blocks as the script wants them, in descending powers of s."""
    names = {"G": ("N", "D"), "Gm": ("Nm", "Dm"), "C": ("Nc", "Dc")}
    found: dict[str, Any] = {"delay": loop.delay}
    for block, (num, den) in names.items():
        fraction = getattr(loop.fractions, block)
        found[num], found[den] = fraction.num.tolist(), fraction.den.tolist()
    return found


class Explorable(SphinxDirective):
    """A figure that can be moved: the number of the example, the ends of the sliders."""

    required_arguments = 1
    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {
        "range-lambda": limits, "range-gain": limits, "range-lag": limits, "range-zero": limits,
        "range-delay": limits, "last": float, "name": directives.unchanged,
    }  # fmt: skip

    def run(self) -> list[nodes.Node]:
        """Make the figure: the still, and what the script needs."""
        loop = paper.example(int(self.arguments[0]))
        least = loop.model.den[0][0].size - loop.model.num[0][0].size
        ranges = {
            name.removeprefix("range-"): value
            for name, value in self.options.items()
            if name.startswith("range-")
        }
        given = {
            "plant": coefficients(loop),
            "start": {
                "lambda": loop.filter.time_constant, "order": loop.filter.order, "gain": 1.0,
                "lag": 0.0, "zero": 0.0, "delay": 0.0,
            },
            "range": {
                "lambda": ranges.pop("lambda"),
                "order": (max(least, LEAST_ORDER), MOST_ORDER),
                **ranges,
            },
            "last": self.options.get("last", 10.0),
        }  # fmt: skip
        still = loop.plot_nyquist("FH")
        picture = base64.b64encode(still.png()).decode()
        figure = nodes.figure(classes=["explorable"])
        figure += nodes.raw(
            "",
            f'<div data-explorable="{escape(json.dumps(given), quote=True)}">'
            f'<img class="explorable-still" alt="{escape(still.alt, quote=True)}" '
            f'src="data:image/png;base64,{picture}"></div>',
            format="html",
        )
        caption = nodes.caption()
        text, _ = self.parse_inline(" ".join(self.content))
        caption += text
        figure += caption
        self.env.metadata[self.env.docname]["explorable"] = "yes"
        return [figure]


def fenced(place: dict[str, Any]) -> str:
    """Write an entry of the table as the directive."""
    options = [
        f":range-{name}: {low} {high}"
        for name in ("lambda", "gain", "lag", "zero", "delay")
        if name in place
        for low, high in [place[name]]
    ]
    lines = [f"```{{explorable}} {place['example']}", *options, f":last: {place['last']}"]
    return "\n".join([*lines, "", place["caption"], "```"])


def into_chapter(app: Sphinx, page: str, source: list[str]) -> None:
    """Lay what can be moved behind the question of a chapter that is being read."""
    table = Path(app.srcdir) / PLACES
    place = tomllib.loads(table.read_text("utf-8")).get(page.removeprefix(f"{CHAPTERS}/"))
    if place is None or not page.startswith(f"{CHAPTERS}/"):
        return
    app.env.note_dependency(table)
    notebook = json.loads(source[0])
    after = next(i for i, cell in enumerate(notebook["cells"]) if KEY in cell["metadata"])
    cell = {"cell_type": "markdown", "id": "explorable", "metadata": {}, "source": fenced(place)}
    notebook["cells"].insert(after + 1, cell)
    source[0] = json.dumps(notebook)


def add_scripts(
    app: Sphinx, page: str, _template: str, _context: dict[str, Any], doctree: object
) -> None:
    """Load the scripts where there is something to be moved."""
    if doctree is not None and "explorable" in app.env.metadata[page]:
        for script in SCRIPTS:
            app.add_js_file(script, loading_method="defer")


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive, and its scripts to the pages that need them."""
    app.add_directive("explorable", Explorable)
    app.connect("source-read", into_chapter)
    app.connect("html-page-context", add_scripts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
