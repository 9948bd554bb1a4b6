"""A page is read again when what reads it has changed: the extensions, and what they ask.

Sphinx reads again only the pages that are new, or that a remembered file made. It asks each
extension for the number of its version, and begins anew when one of them is another one; here that
number is made of all their texts.
"""

from __future__ import annotations

from pathlib import Path
from zlib import crc32

from sphinx.application import Sphinx

BOOK = Path(__file__).resolve().parents[1]


def version() -> int:
    """Give a number that changes with each change of a program that makes pages."""
    files = [BOOK / "explorables.toml", *BOOK.glob("ext/*.py"), *BOOK.glob("make/*.py")]
    return crc32(b"".join(file.read_bytes() for file in sorted(files)))


def setup(_app: Sphinx) -> dict[str, bool | int]:
    """Give the version."""
    return {
        "env_version": version(),
        "parallel_read_safe": True,
        "parallel_write_safe": True,
    }
