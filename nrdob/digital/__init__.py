"""The loop on a processor: process behind a hold, observer as difference equations."""

from .actuatorlimits import ActuatorLimits, limited
from .bilinear import held_in_w, process_in_w
from .code import ControllerCode
from .hold import HeldProcess, in_samples
from .sampled import SampledLoop
from .samplingtime import largest_sampling_time
from .sections import Section
from .signals import Signal, external_signals, sample_times
from .simulation import SimulatedResponse
from .verdict import SampledStability

__all__ = [
    "ActuatorLimits", "ControllerCode", "HeldProcess", "SampledLoop", "SampledStability", "Section",
    "Signal", "SimulatedResponse", "external_signals", "held_in_w", "in_samples",
    "largest_sampling_time", "limited", "process_in_w", "sample_times",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
