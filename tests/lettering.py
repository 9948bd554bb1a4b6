"""The texts of a figure as they are drawn: how large, and where."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import combinations
from typing import Any
from unittest.mock import patch

from matplotlib.text import Text
from matplotlib.transforms import Bbox

from nrdob.plotting.figure import SMALLEST, WIDTH

PHONE = 360 - 2 * 4
"""CSS pixels that a figure has on a phone: the screen, and a margin on either side (book.css)."""

LEAST = 8
"""CSS pixels below which no type may be shown on a phone."""

SIZES = {"fontsize", "size", "labelsize", "title_fontsize"}
WRITES = {
    "annotate", "figtext", "legend", "set_fontsize", "set_title", "set_xlabel", "set_ylabel",
    "suptitle", "text", "tick_params",
}  # fmt: skip
SMALLER = {"xx-small", "x-small", "small", "smaller"}
"""Sizes by name; they go below the smallest type."""


def shown(points: float, inches: float = WIDTH) -> float:
    """CSS pixels of type on a phone, in a figure so many inches wide."""
    return points / 72 * PHONE / inches


def drawn_texts(figure: Any) -> dict[Text, Bbox]:
    """Draw a figure; give each text that it really shows, and its box, in pixels."""
    seen: list[Text] = []
    draw = Text.draw

    def noted(text: Text, renderer: Any, *more: Any, **how: Any) -> None:
        seen.append(text)
        draw(text, renderer, *more, **how)

    with patch.object(Text, "draw", noted):
        figure.canvas.draw()
    visible = (text for text in seen if text.get_visible() and text.get_text().strip())
    return {text: text.get_window_extent() for text in visible}


def collisions(texts: dict[Text, Bbox], canvas: Bbox) -> list[str]:
    """Name what stands over another text, or over the edge of the figure."""
    cut = [
        f"{text.get_text()!r} is cut off"
        for text, box in texts.items()
        if not (canvas.contains(box.x0, box.y0) and canvas.contains(box.x1, box.y1))
    ]
    over = [
        f"{a.get_text()!r} stands over {b.get_text()!r}"
        for (a, box), (b, other) in combinations(texts.items(), 2)
        if box.overlaps(other)
    ]
    return cut + over


def too_small(source: str) -> list[str]:
    """Name the calls of Python code that write in type below the smallest."""
    return [
        f"line {call.lineno}: {keyword.arg}={size!r}"
        for call in _writing(source)
        for keyword in call.keywords
        if keyword.arg in SIZES and isinstance(keyword.value, ast.Constant)
        if (size := keyword.value.value) in SMALLER
        or (isinstance(size, int | float) and size < SMALLEST)
    ]


def _writing(source: str) -> Iterator[ast.Call]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") in WRITES:
            yield node
