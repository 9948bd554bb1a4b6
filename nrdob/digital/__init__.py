"""The loop on a processor: process behind a hold, observer as difference equations."""

from .code import ControllerCode
from .controller import SampledBlock, SampledController, Wait
from .hold import HeldProcess, held_process
from .limits import Limits
from .sampled import SampledLoop
from .sections import Section
from .simulation import SimulatedResponse

__all__ = [
    "ControllerCode",
    "HeldProcess",
    "Limits",
    "SampledBlock",
    "SampledController",
    "SampledLoop",
    "Section",
    "SimulatedResponse",
    "Wait",
    "held_process",
]
