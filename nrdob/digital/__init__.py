"""The loop on a processor: process behind a hold, observer as difference equations."""

from .actuatorlimits import ActuatorLimits
from .bilinear import process_in_w
from .code import ControllerCode
from .sampled import SampledLoop
from .samplingtime import largest_sampling_time
from .sections import Section
from .simulation import SimulatedResponse
from .verdict import SampledStability

__all__ = [
    "ActuatorLimits",
    "ControllerCode",
    "SampledLoop",
    "SampledStability",
    "Section",
    "SimulatedResponse",
    "largest_sampling_time",
    "process_in_w",
]


def __dir__() -> list[str]:
    return __all__
