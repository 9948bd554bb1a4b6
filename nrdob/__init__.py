"""Stability and robustness of loops with a noise-reduction disturbance observer (NR-DOB)."""

from . import paper
from .delay import DelayedTransferFunction, delay
from .design import design_filter
from .filters import LowPassFilter
from .loop import NRDOB
from .timeconstants import critical_time_constants, stabilizing_time_constants

__all__ = [
    "NRDOB", "DelayedTransferFunction", "LowPassFilter", "critical_time_constants", "delay",
    "design_filter", "paper", "stabilizing_time_constants",
]  # fmt: skip
