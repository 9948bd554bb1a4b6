"""The loop on a processor: process behind a hold, observer as difference equations."""

from .actuatorlimits import ActuatorLimits
from .bilinear import held_in_w, process_in_w
from .code import ControllerCode
from .controller import ModelDelay, SampledController
from .hold import HeldProcess, held_process
from .sampled import SampledLoop
from .samplingtime import largest_sampling_time
from .sections import Section
from .simulation import SimulatedResponse
from .verdict import SampledStability

__all__ = [
    "ActuatorLimits",
    "ControllerCode",
    "HeldProcess",
    "ModelDelay",
    "SampledController",
    "SampledLoop",
    "SampledStability",
    "Section",
    "SimulatedResponse",
    "held_in_w",
    "held_process",
    "largest_sampling_time",
    "process_in_w",
]


def __dir__() -> list[str]:
    return __all__
