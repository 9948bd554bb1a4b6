"""Stability and robustness of loops with a noise-reduction disturbance observer (NR-DOB)."""

from . import paper, plants
from .controllers import design_controller
from .delay import DelayedTransferFunction, delay
from .design import admissible_time_constants, design_filter
from .filters import LowPassFilter
from .loop import NRDOB
from .margins import margin_bounds
from .models import suggest_model
from .stability import judge_observer
from .timeconstants import critical_time_constants, stabilizing_time_constants

__all__ = [
    "NRDOB", "DelayedTransferFunction", "LowPassFilter", "admissible_time_constants",
    "critical_time_constants", "delay", "design_controller", "design_filter", "judge_observer",
    "margin_bounds", "paper", "plants",
    "stabilizing_time_constants", "suggest_model",
]  # fmt: skip
