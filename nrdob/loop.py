"""The front door: an NR-DOB loop that answers for itself."""

from __future__ import annotations

from functools import cached_property

from .equations import LoopEquations
from .margins import LoopMargins, loop_margins
from .stability import Stability, stability


class NRDOB(LoopEquations):
    """x."""

    @cached_property
    def _stability(self) -> Stability:
        return stability(self)

    def stability(self) -> Stability:
        """Judge."""
        return self._stability

    def margins(self) -> LoopMargins:
        """Compute."""
        return loop_margins(self, self._stability)
