"""The browser that sets the PDF and opens the pages in the tests."""

from __future__ import annotations

import shutil

__all__ = ["SETTLED", "find"]

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")

SETTLED = "() => document.fonts.ready.then(() => true)"
"""Once the letters are there the page has its final form."""


def find() -> str | None:
    """Find a browser on the path; nothing if there is none."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)
