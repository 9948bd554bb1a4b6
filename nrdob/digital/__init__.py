"""The loop on a processor: process behind a hold, observer as difference equations."""

from .circle import CircleFunction, Product
from .code import ControllerCode
from .controller import SampledBlock, SampledController, Wait
from .hold import HeldProcess, held_process
from .limits import Limits
from .longest import largest_sampling_time
from .sampled import SampledLoop
from .sections import Section
from .simulation import SimulatedResponse
from .verdict import SampledCondition, SampledStability, lifted
from .wplane import held_in_w, process_in_w

__all__ = [
    "CircleFunction",
    "ControllerCode",
    "HeldProcess",
    "Limits",
    "Product",
    "SampledBlock",
    "SampledCondition",
    "SampledController",
    "SampledLoop",
    "SampledStability",
    "Section",
    "SimulatedResponse",
    "Wait",
    "held_in_w",
    "held_process",
    "largest_sampling_time",
    "lifted",
    "process_in_w",
]


def __dir__() -> list[str]:
    return __all__
