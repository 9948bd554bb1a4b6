"""Which filters, models and controllers to choose, and what limits the choice."""

from . import closedforms
from .chart import Axis, Border, Region, StabilityChart, stability_chart
from .closedforms import (
    disturbance_index,
    noise_index,
    sensitivity_floor,
    smallest_for_delay,
    smallest_for_double_lag,
    smallest_for_rhp_zero,
)
from .controllers import design_controller
from .existence import Answer, right_half_plane_parity, stabilizing_filter_exists
from .fastandslow import gain_bound, stable_for_fast_filters, stable_for_slow_filters
from .fastest import design_filter
from .models import ModelCandidate, suggest_model
from .search import Bracket, admissible_time_constants, solved
from .timeconstants import CriticalTimeConstant, critical_time_constants, stabilizing_time_constants
from .youla import ObserverForm, observer_form, stable_model_exists

__all__ = [
    "Answer", "Axis", "Border", "Bracket", "CriticalTimeConstant", "ModelCandidate", "ObserverForm",
    "Region", "StabilityChart", "admissible_time_constants", "closedforms",
    "critical_time_constants", "design_controller", "design_filter", "disturbance_index",
    "gain_bound", "noise_index", "observer_form", "right_half_plane_parity", "sensitivity_floor",
    "smallest_for_delay", "smallest_for_double_lag", "smallest_for_rhp_zero", "solved",
    "stability_chart", "stabilizing_filter_exists", "stabilizing_time_constants",
    "stable_for_fast_filters", "stable_for_slow_filters", "stable_model_exists", "suggest_model",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
