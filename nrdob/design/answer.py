"""A verdict that may be left open, and the reason for it in words."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Answer"]


@dataclass(frozen=True)
class Answer:
    """A verdict and the reason for it.

    Attributes
    ----------
    holds : bool or None
        None where the question is left open.
    reason : str
        Why, in a sentence, and what to do about it.
    """

    holds: bool | None
    reason: str

    def __repr__(self) -> str:
        word = {True: "yes", False: "no", None: "open"}[self.holds]
        return f"{word}: {self.reason}"
