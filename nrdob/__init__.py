"""Stability and robustness of loops with a noise-reduction disturbance observer (NR-DOB).

The list below is the table of contents, by topic. What answers, with which fields, is one room
further: `nrdob.analysis` (verdicts, margins, responses), `nrdob.design` (which filter, model and
controller), `nrdob.digital` (the loop on a processor), `nrdob.measured` (a process out of a
record), `nrdob.uncertain` (families of plants), `nrdob.reporting` (all on one page),
`nrdob.diagram` (blocks and the maps between them), `nrdob.numerics` (polynomials with a delay),
`nrdob.plotting` (figures) and `nrdob.course` (the paper's claims, the problem sets).
"""

from typing import TYPE_CHECKING, Any

from . import paper, plants
from .alternatives import (
    adrc_chart,
    adrc_stabilizing_bandwidths,
    adrc_stabilizing_gains,
    candidates,
    compare,
    controller_alone,
    conventional_observer,
    linear_adrc,
    simc_pi,
    simc_pid,
    tune,
)
from .analysis import encirclements, judge_observer, margin_bounds, margins
from .deadtime import dead_time_observer, smith_predictor
from .design import (
    admissible_time_constants,
    critical_time_constants,
    design_controller,
    design_filter,
    observer_form,
    stability_chart,
    stabilizing_gains,
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
from .digital import Limits, largest_sampling_time
from .loop import NRDOB
from .measured import identify, read_data
from .sampling import random_loop
from .uncertain import (
    delay_intervals,
    family,
    fit_weight,
    gain_intervals,
    largest_box,
    small_gain,
    sweep,
)

if TYPE_CHECKING:
    from .reporting import report

__all__ = [  # noqa: RUF022  (by topic: the contents of the package)
    # The loop, and what it is made of.
    "NRDOB", "LowPassFilter", "interpolating_filter", "DelayedTransferFunction", "delay",
    "FilterFamily", "filter_family",
    # The same with a model that waits.
    "dead_time_observer", "smith_predictor",
    # Is it stable, and how nearly not?
    "judge_observer", "encirclements", "margins", "margin_bounds",
    # Which filters work, and which is the fastest?
    "stabilizing_time_constants", "critical_time_constants", "stabilizing_gains",
    "admissible_time_constants", "design_filter", "stability_chart",
    # How slowly may a processor run it? (NRDOB.sampled is the loop on one.)
    "largest_sampling_time",
    # What its actuator can do, for its simulation and its code.
    "Limits",
    # Which model, and which controller?
    "suggest_model", "design_controller",
    # What process was measured?
    "identify", "read_data",
    # All that can be said, on one page.
    "report",
    # Is a controller an observer?
    "observer_form", "stable_model_exists",
    # Other schemes on the same plant, in one table.
    "compare", "candidates", "tune", "controller_alone", "conventional_observer",
    "simc_pi", "simc_pid", "linear_adrc",
    "adrc_stabilizing_bandwidths", "adrc_stabilizing_gains", "adrc_chart",
    # Will it survive the real plant?
    "family", "sweep", "gain_intervals", "delay_intervals", "largest_box",
    "fit_weight", "small_gain",
    # Loops to try things on: the paper's, some with a name, random ones.
    "paper", "plants", "random_loop",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    # A report has figures; whoever asks for none does not wait for matplotlib's drawing.
    if name == "report":
        from .reporting import report

        return report
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
