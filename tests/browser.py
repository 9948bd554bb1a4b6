"""The pages of the book in a real browser, with the network cut off."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pypdf import PdfReader

import pdf

CHROMIUM = pdf.browser_on_path()
OFFLINE = "--host-resolver-rules=MAP * ~NOTFOUND"

# How a page may be seen beside 360 pixels wide and light.
VIEWS = ((360, "dark"), (800, "light"), (800, "dark"), (1400, "light"), (1400, "dark"))

FINDINGS = """() => {
  const room = document.documentElement.clientWidth;
  const inside = (image) => {
    const style = getComputedStyle(image);
    return [image.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight),
            image.clientHeight - parseFloat(style.paddingTop) - parseFloat(style.paddingBottom)];
  };
  const drawn = (image) => inside(image)[0] / inside(image)[1];
  const asMade = (image) => image.naturalWidth / image.naturalHeight;
  const wanted = (image) => parseFloat(
    image.style.width || image.getAttribute("width") || image.naturalWidth);
  const scrolls = (box) => box.scrollWidth > box.clientWidth + 1;
  // A line that ends in dots is meant to.
  const hides = (box) => /hidden|clip/.test(getComputedStyle(box).overflowX)
    && getComputedStyle(box).textOverflow !== "ellipsis";
  const canScroll = (box) => /auto|scroll/.test(getComputedStyle(box).overflowX);
  const cutOff = (piece) => {
    const right = piece.getBoundingClientRect().right;
    for (let box = piece.parentElement; box; box = box.parentElement) {
      if (canScroll(box) || getComputedStyle(box).textOverflow === "ellipsis") return false;
      if (hides(box) && right > box.getBoundingClientRect().right + 1) return true;
    }
    return right > room + 1;
  };
  const dark = document.documentElement.dataset.theme === "dark";
  const pale = (piece) => {
    const [red, green, blue, cover = 1] = getComputedStyle(piece).backgroundColor.match(/[0-9.]+/g);
    return cover > 0.5 && Math.min(red, green, blue) > 150;
  };
  // Marks stand beside their formula.
  const parted = (tied) => {
    const formula = tied.querySelector("math")?.getBoundingClientRect();
    const marks = document.createRange();
    marks.selectNodeContents(tied.lastChild);
    const { top, bottom, width } = marks.getBoundingClientRect();
    return Boolean(formula?.width && width && tied.lastChild.nodeType === Node.TEXT_NODE)
      && (top > formula.bottom || bottom < formula.top);
  };
  const pieces = document.querySelectorAll(
    ".bd-article :is(span.math, div.math, pre, img, table, svg[role=img], input, select)");
  return {
    overflow: document.documentElement.scrollWidth - room,
    distorted: [...document.images]
      .filter((image) => image.naturalWidth && image.clientWidth > 20)
      .filter((image) => Math.abs(drawn(image) / asMade(image) - 1) > 0.03)
      .map((image) => image.alt),
    cut: [...pieces]
      .filter((piece) => piece.checkVisibility())
      .filter((piece) => cutOff(piece) || (scrolls(piece) && hides(piece)))
      .map((piece) => piece.textContent.slice(0, 80)),
    torn: [...document.querySelectorAll("summary span.math.wide > math")]
      .filter((each) => each.offsetWidth < each.closest("summary").clientWidth / 2)
      .concat([...document.querySelectorAll(".tied")].filter(parted))
      .map((each) => each.parentElement.textContent),
    glaring: !dark ? [] : [...document.querySelectorAll(
      ".bd-article :is(.output, pre, table, td, img, figure, details, .theorem, .explorable)")]
      .filter((each) => each.checkVisibility() && pale(each))
      .map((each) => `pale in the dark: ${each.alt || each.textContent.slice(0, 80)}`),
    stops: [...document.querySelectorAll(".math[tabindex='0']")]
      .filter((each) => !scrolls(each)).length,
    narrow: room > 600 ? [] : [...document.querySelectorAll(".bd-article img")]
      .filter((image) => image.checkVisibility() && image.clientWidth < room - 8)
      .filter((image) => image.clientWidth < wanted(image) - 1)
      .map((image) => `has not the whole screen: ${image.alt}`),
    picture: Math.min(...[...document.querySelectorAll(".bd-article :is(img, .explorable svg)")]
      .filter((each) => each.checkVisibility())
      .map((each) => (each.getBoundingClientRect().top + scrollY) / innerHeight)),
  };
}"""

# The letters of a formula and the words of code in their colours are thousands of pieces, which
# axe would look at one by one; all are alike. What fades in is pale until it is there.
LIGHTER = """() => {
  document.querySelectorAll("math").forEach((e) => { e.textContent = ""; });
  document.querySelectorAll(".highlight pre").forEach((e) => { e.textContent = e.textContent; });
  document.querySelectorAll("details").forEach((e) => { e.open = true; });
  document.getAnimations().forEach((each) => each.finish());
}"""


@dataclass(frozen=True)
class Look:
    """What a browser finds on one page: pixels too wide, and everything else that is amiss.

    The first picture stands `picture` screens from the top; infinitely many if there is none.
    """

    overflow: int
    distorted: list[str]
    cut: list[str]
    torn: list[str]
    glaring: list[str]
    narrow: list[str]
    stops: int
    picture: float
    said: list[str]

    @property
    def amiss(self) -> list[object]:
        """What must not be, however wide the page and whatever its colours."""
        wide = [f"{self.overflow} pixels too wide"] if self.overflow > 0 else []
        return [
            *wide,
            *self.distorted,
            *self.cut,
            *self.torn,
            *self.glaring,
            *self.narrow,
        ]


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

    def failed(error: Any) -> None:
        said.append(f"error: {error}")

    tab.on("pageerror", failed)
    tab.on("request", asked)
    tab.on("console", told)
    tab.goto(page.as_uri())
    tab.evaluate(pdf.SETTLED)
    tab.wait_for_timeout(50)
    found = tab.evaluate(FINDINGS)
    tab.remove_listener("request", asked)
    tab.remove_listener("console", told)
    tab.remove_listener("pageerror", failed)
    return Look(**found, said=said)


def recolour(tab: Any, colours: str) -> None:
    """Show the page that is open in light or dark colours."""
    tab.emulate_media(color_scheme=colours)
    tab.wait_for_function(
        "(theme) => document.documentElement.dataset.theme === theme", arg=colours
    )


def look_again(tab: Any, width: int, colours: str) -> Look:
    """Look over the page that is open, at another width or in other colours, nothing folded."""
    recolour(tab, colours)
    tab.set_viewport_size({"width": width, "height": 800})
    tab.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    tab.wait_for_timeout(250)  # the formulas are fitted a moment after the last change
    return Look(**tab.evaluate(FINDINGS), said=[])


def printed(tab: Any, page: Path, output: Path) -> PdfReader:
    """Print a page as a browser does that nobody has told how."""
    tab.goto(page.as_uri())
    tab.evaluate(pdf.SETTLED)
    tab.wait_for_timeout(300)  # the formulas are fitted, and what can be moved is drawn
    margins = dict.fromkeys(("top", "bottom", "left", "right"), "1cm")
    tab.pdf(path=output, format="A4", prefer_css_page_size=True, margin=margins)
    return PdfReader(output)
