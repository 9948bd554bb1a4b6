"""Stability and robustness of loops with a noise-reduction disturbance observer (NR-DOB).

The names below are what most loops need, by topic. The rest is in the subpackages: `analysis`
(verdicts, margins, responses), `design` (filters, models and controllers), `digital` (the loop on a
processor), `alternatives` (PI, Smith predictor, ADRC), `measured` (identification), `uncertain`
(families of plants), `drives` (encoder, friction, two masses), `certificates` (proofs of verdicts),
`reporting` (reports), `diagram` (blocks and the maps between them), `numerics` (polynomials with
dead times) and `plotting` (figures).
"""

from typing import TYPE_CHECKING, Any

from . import paper, plants
from .alternatives import compare
from .analysis import encirclements, judge_observer, margins
from .design import (
    admissible_time_constants,
    critical_time_constants,
    design_controller,
    design_filter,
    stability_chart,
    stabilizing_time_constants,
    suggest_model,
)
from .diagram import LowPassFilter, delay, filter_family, interpolating_filter
from .loop import NRDOB
from .measured import identify, read_data
from .uncertain import largest_box, plant_family, sweep

if TYPE_CHECKING:
    from .reporting import report

__all__ = [  # noqa: RUF022  (by topic: the contents of the package)
    # The loop, and what it is made of.
    "NRDOB", "LowPassFilter", "filter_family", "interpolating_filter", "delay",
    # Is it stable, and by what margin? judge_observer needs no controller.
    "judge_observer", "encirclements", "margins",
    # Which filters work, and which is the fastest?
    "stabilizing_time_constants", "critical_time_constants", "admissible_time_constants",
    "design_filter", "stability_chart",
    # Which model, and which controller? What process was measured?
    "suggest_model", "design_controller", "identify", "read_data",
    # Is it robust, and better than another scheme?
    "plant_family", "sweep", "largest_box", "compare",
    # All that can be said, on one page.
    "report",
    # Loops to try things on: the paper's, and some with a name.
    "paper", "plants",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    # A report has figures; without one matplotlib's drawing is not loaded.
    if name == "report":
        from .reporting import report

        return report
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
