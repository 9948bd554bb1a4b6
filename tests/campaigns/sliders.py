"""How long a move of a slider takes, in a browser, on every page that has sliders.

    python -m tests.campaigns.sliders --count 500 --seed 0

The pages are those of `make book`. On each, the sliders go to all combinations of their ends, with
each curve and the signals in turn, and to `count` random positions. A move is timed from the event
until verdict, curves and layout are there; a longer task that follows, a piece of the background or
the painting, counts instead. What takes more than 40 ms is tried again, up to 20 times, and the
fastest counts, which the rest of the machine disturbed least. 50 ms would be felt under the hand.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from .runner import asked

ROOT = Path(__file__).resolve().parents[2]
sys.path += [str(ROOT / "tests"), str(ROOT / "book" / "make")]  # where the tests find their browser

from browser import browser  # noqa: E402

SITE = ROOT / "build" / "html"

TIMED = """async ([count, seed]) => {
  const [page] = nrdob.explorables;
  const random = () => (seed = (seed * 1103515245 + 12345) % 2147483648) / 2147483648;
  const pick = (choices) => choices[Math.floor(random() * choices.length)];
  const sliders = Object.entries(page.given.range);
  const selects = [...page.board.querySelectorAll("select")];
  const values = (select) => [...select.options].map((each) => each.value);
  const [curves, signals] = selects.map(values);
  const charts = selects[2] ? values(selects[2]) : [undefined];
  const positions = [];
  for (let k = 0; k < 2 ** sliders.length; k++) {
    const ends = Object.fromEntries(sliders.map(([name, range], i) => [name, range[(k >> i) & 1]]));
    for (const curve of curves) {
      const signal = signals[positions.length % signals.length];
      positions.push({ ...ends, curve, signal, upwards: pick(charts) });
    }
  }
  const between = (name, [low, high]) =>
    name === "order" ? low + Math.floor(random() * (high - low + 1))
    : low > 0 ? low * (high / low) ** random() : low + random() * (high - low);
  for (let k = 0; k < count; k++) {
    const drawn = Object.fromEntries(sliders.map(([name, range]) => [name, between(name, range)]));
    positions.push({ ...drawn, curve: pick(curves), signal: pick(signals), upwards: pick(charts) });
  }
  const tasks = new PerformanceObserver(() => {});
  tasks.observe({ type: "longtask" }); // of more than 50 ms
  const move = async (position) => {
    await new Promise((go) => requestAnimationFrame(() => setTimeout(go)));
    tasks.takeRecords();
    const started = performance.now();
    page.to(position);
    page.board.getBoundingClientRect();
    const took = performance.now() - started;
    await new Promise((go) => requestAnimationFrame(() => setTimeout(go, 20)));
    return Math.max(took, ...tasks.takeRecords().map((each) => each.duration));
  };
  const moves = [];
  for (const position of positions) {
    let took = await move(position);
    for (let again = 0; took > 40 && again < 20; again++) {
      await move(page.given.start);
      took = Math.min(took, await move(position));
    }
    moves.push([took, position]);
  }
  moves.sort(([a], [b]) => b - a);
  const over = moves.filter(([took]) => took > 50).length;
  const [worst, at] = moves[0];
  return { moves: moves.length, usual: moves[moves.length >> 1][0], worst, over, at };
}"""


def pages() -> list[Path]:
    """Give the pages of the built book that have sliders."""
    return [
        page
        for page in sorted(SITE.rglob("*.html"))
        if "data-explorable" in page.read_text("utf-8")
    ]


def campaign(count: int, seed: int) -> list[tuple[str, dict[str, Any]]]:
    """Time the moves of every page."""
    with browser() as opened:
        found = []
        for path in pages():
            tab = opened.new_page(viewport={"width": 1400, "height": 900})
            tab.goto(path.as_uri())
            tab.wait_for_function("() => window.nrdob?.explorables")
            found.append((path.stem, tab.evaluate(TIMED, [count, seed])))
            tab.close()
    return found


if __name__ == "__main__":
    print(f"{'ms':32} moves  usual  worst  over 50  worst at")
    for name, at in campaign(*asked(__doc__, 500)):
        where = ", ".join(
            f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
            for key, value in at["at"].items()
        )
        print(
            f"{name[:32]:32} {at['moves']:5}  {at['usual']:5.1f}  {at['worst']:5.1f}"
            f"  {at['over']:7}  {where}"
        )
