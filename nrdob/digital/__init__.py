"""The loop on a processor: process behind a hold, observer as difference equations."""

from .circle import CircleFunction, Product
from .controller import SampledBlock, SampledController, Wait
from .hold import HeldProcess, held_process
from .longest import largest_sampling_time
from .sampled import SampledLoop
from .verdict import SampledCondition, SampledStability, lifted
from .wplane import held_in_w, process_in_w

__all__ = [
    "CircleFunction",
    "HeldProcess",
    "Product",
    "SampledBlock",
    "SampledCondition",
    "SampledController",
    "SampledLoop",
    "SampledStability",
    "Wait",
    "held_in_w",
    "held_process",
    "largest_sampling_time",
    "lifted",
    "process_in_w",
]
