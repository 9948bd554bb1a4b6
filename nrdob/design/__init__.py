"""Which filters, models and controllers to choose, and what limits the choice."""

from . import closedforms
from .closedforms import (
    disturbance_index,
    largest_for_unstable_pole,
    noise_index,
    sensitivity_floor,
    smallest_for_delay,
    smallest_for_double_lag,
    smallest_for_rhp_zero,
)
from .controllers import design_controller
from .limits import (
    Answer,
    gain_bound,
    right_half_plane_parity,
    stabilizing_filter_exists,
    stable_for_fast_filters,
    stable_for_slow_filters,
)
from .mismatch import Mismatch
from .models import ModelCandidate, suggest_model
from .search import admissible_time_constants, design_filter
from .timeconstants import (
    CriticalTimeConstant,
    critical_time_constants,
    default_floor,
    stabilizing_time_constants,
)

__all__ = [
    "Answer",
    "CriticalTimeConstant",
    "Mismatch",
    "ModelCandidate",
    "admissible_time_constants",
    "closedforms",
    "critical_time_constants",
    "default_floor",
    "design_controller",
    "design_filter",
    "disturbance_index",
    "gain_bound",
    "largest_for_unstable_pole",
    "noise_index",
    "right_half_plane_parity",
    "sensitivity_floor",
    "smallest_for_delay",
    "smallest_for_double_lag",
    "smallest_for_rhp_zero",
    "stabilizing_filter_exists",
    "stabilizing_time_constants",
    "stable_for_fast_filters",
    "stable_for_slow_filters",
    "suggest_model",
]
