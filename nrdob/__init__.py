"""Stability and robustness of loops with a noise-reduction disturbance observer (NR-DOB)."""

from . import paper
from .controllers import design_controller
from .delay import DelayedTransferFunction, delay
from .design import design_filter
from .filters import LowPassFilter
from .loop import NRDOB
from .margins import margin_bounds
from .models import suggest_model
from .timeconstants import critical_time_constants, stabilizing_time_constants

__all__ = [
    "NRDOB", "DelayedTransferFunction", "LowPassFilter", "critical_time_constants", "delay",
    "design_controller", "design_filter", "margin_bounds", "paper",
    "stabilizing_time_constants", "suggest_model",
]  # fmt: skip
