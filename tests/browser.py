"""The pages of the book in a real browser, with the network cut off."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
OFFLINE = "--host-resolver-rules=MAP * ~NOTFOUND"

# Once the formulas are set the page has its final form.
SETTLED = "() => window.MathJax?.startup?.promise?.then(() => true) ?? true"

FINDINGS = """() => {
  const room = document.documentElement.clientWidth;
  const drawn = (image) => image.clientWidth / image.clientHeight;
  const asMade = (image) => image.naturalWidth / image.naturalHeight;
  const cut = (formula) => formula.scrollWidth > formula.clientWidth + 1
    && getComputedStyle(formula).overflowX === "hidden";
  return {
    overflow: document.documentElement.scrollWidth - room,
    distorted: [...document.images]
      .filter((image) => image.naturalWidth && image.clientWidth > 20)
      .filter((image) => Math.abs(drawn(image) / asMade(image) - 1) > 0.03)
      .map((image) => image.alt),
    cut: [...document.querySelectorAll("span.math")].filter(cut).map((each) => each.textContent),
    torn: [...document.querySelectorAll("summary span.math.wide")]
      .filter((each) => each.firstElementChild.offsetWidth < each.clientWidth / 2)
      .map((each) => each.closest("summary").textContent),
    stops: document.querySelectorAll("mjx-container[tabindex='0']").length,
  };
}"""


@dataclass(frozen=True)
class Look:
    """What a browser finds on one page: pixels too wide, and everything else that is amiss."""

    overflow: int
    distorted: list[str]
    cut: list[str]
    torn: list[str]
    stops: int
    said: list[str]


@contextmanager
def browser() -> Iterator[Any]:
    """Open a browser that reaches no network; the context ends it."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        opened = play.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu", OFFLINE]
        )
        yield opened
        opened.close()


def look(tab: Any, page: Path) -> Look:
    """Open a page in a tab, wait until it is set, and look it over."""
    said: list[str] = []

    def asked(request: Any) -> None:
        if not request.url.startswith(("file:", "data:", "blob:")):
            said.append(f"asked for {request.url}")

    def told(message: Any) -> None:
        if message.type in ("error", "warning"):
            said.append(f"{message.type}: {message.text}")

    tab.on("request", asked)
    tab.on("console", told)
    tab.goto(page.as_uri())
    tab.evaluate(SETTLED)
    tab.wait_for_timeout(50)
    found = tab.evaluate(FINDINGS)
    tab.remove_listener("request", asked)
    tab.remove_listener("console", told)
    return Look(**found, said=said)
