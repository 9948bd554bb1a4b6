"""What the loop does: its stability, its margins, its responses, its encirclements of -1."""

from .frequencies import on_axis, resolved_frequencies, subdivided
from .locus import Locus, notable_frequencies
from .margins import (
    Ends,
    LoopMargins,
    MarginBounds,
    Margins,
    loop_margins,
    margin_bounds,
    margins,
    margins_at,
    quotient_margins,
)
from .nyquist import NyquistCount, encirclements, minus_point, rhp_roots
from .response import forced_response, step_response
from .stability import LoopStability, Stability, judge, judge_observer, stability
from .variance import NoiseVariance, noise_variance

__all__ = [
    "Ends", "Locus", "LoopMargins", "LoopStability", "MarginBounds", "Margins", "NoiseVariance",
    "NyquistCount", "Stability", "encirclements", "forced_response", "judge", "judge_observer",
    "loop_margins", "margin_bounds", "margins", "margins_at", "minus_point", "noise_variance",
    "notable_frequencies", "on_axis", "quotient_margins", "resolved_frequencies", "rhp_roots",
    "stability", "step_response", "subdivided",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
