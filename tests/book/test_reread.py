"""Pages are made anew when a program that makes them has changed, and only then."""

from __future__ import annotations

from pathlib import Path

import pytest

import chapters


def test_a_change_of_an_extension_is_a_new_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for file in ("explorables.toml", "ext/one.py", "make/two.py", "ext/notes.txt"):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text("1", encoding="utf-8")
    monkeypatch.setattr(chapters, "BOOK", tmp_path)
    before = chapters.version()
    (tmp_path / "ext/notes.txt").write_text("2", encoding="utf-8")
    assert chapters.version() == before
    (tmp_path / "make/two.py").write_text("2", encoding="utf-8")
    assert chapters.version() != before
