"""The loop on a processor: process behind a hold, observer as difference equations."""

from .actuatorlimits import ActuatorLimits
from .bilinear import held_in_w, process_in_w
from .code import ControllerCode
from .hold import HeldProcess, in_samples
from .sampled import SampledLoop
from .samplingtime import largest_sampling_time
from .sections import Section
from .signals import Signal, external_signals, signal_at
from .simulation import SimulatedResponse
from .verdict import SampledStability

__all__ = [
    "ActuatorLimits", "ControllerCode", "HeldProcess", "SampledLoop", "SampledStability", "Section",
    "Signal", "SimulatedResponse", "external_signals", "held_in_w", "in_samples",
    "largest_sampling_time", "process_in_w", "signal_at",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
