"""Stability and robustness of loops with a noise-reduction disturbance observer (NR-DOB).

The list below is the table of contents, by topic. What answers, with which fields, is one room
further: `nrdob.analysis` (verdicts, margins, responses), `nrdob.design` (which filter, model and
controller), `nrdob.uncertain` (families of plants), `nrdob.diagram` (blocks and the maps between
them), `nrdob.numerics` (polynomials with a delay), `nrdob.plotting` (figures) and `nrdob.course`
(the paper's claims, the problem sets).
"""

from . import paper, plants
from .analysis import encirclements, judge_observer, margin_bounds
from .deadtime import dead_time_observer, smith_predictor
from .design import (
    admissible_time_constants,
    critical_time_constants,
    design_controller,
    design_filter,
    observer_form,
    stability_chart,
    stabilizing_time_constants,
    stable_model_exists,
    suggest_model,
)
from .diagram import (
    DelayedTransferFunction,
    FilterFamily,
    LowPassFilter,
    delay,
    filter_family,
    interpolating_filter,
)
from .loop import NRDOB
from .sampling import random_loop
from .uncertain import (
    delay_intervals,
    design_filter_for,
    family,
    fit_weight,
    gain_intervals,
    largest_box,
    small_gain,
    sweep,
)

__all__ = [  # noqa: RUF022  (by topic: the contents of the package)
    # The loop, and what it is made of.
    "NRDOB", "LowPassFilter", "interpolating_filter", "DelayedTransferFunction", "delay",
    "FilterFamily", "filter_family",
    # The same with a model that waits.
    "dead_time_observer", "smith_predictor",
    # Is it stable, and how nearly not?
    "judge_observer", "encirclements", "margin_bounds",
    # Which filters work, and which is the fastest?
    "stabilizing_time_constants", "critical_time_constants",
    "admissible_time_constants", "design_filter", "stability_chart",
    # Which model, and which controller?
    "suggest_model", "design_controller",
    # Is a controller an observer?
    "observer_form", "stable_model_exists",
    # Will it survive the real plant?
    "family", "sweep", "gain_intervals", "delay_intervals", "largest_box",
    "fit_weight", "small_gain", "design_filter_for",
    # Loops to try things on: the paper's, some with a name, random ones.
    "paper", "plants", "random_loop",
]  # fmt: skip
