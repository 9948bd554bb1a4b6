"""The loop on a processor: process behind a hold, observer as difference equations."""

from .controller import SampledBlock, SampledController, Wait
from .hold import HeldProcess, held_process
from .sampled import SampledLoop

__all__ = [
    "HeldProcess",
    "SampledBlock",
    "SampledController",
    "SampledLoop",
    "Wait",
    "held_process",
]
